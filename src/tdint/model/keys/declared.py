"""Declared keys of files of users, which a file of this program lists with their meanings.

Each row of the CSV file is a key: section, name, type (a name of `_TYPES`; empty if the reader of
the section states the type), meaning for users, `yes` if the key is needed, and the remedy in the
message if it is missing.
"""

from __future__ import annotations

from tdint.files import declared_rows
from tdint.model.keys import fields

_TYPES: dict[str, fields.ValueType] = {
    "any": fields.ANY,
    "drift ratio": fields.DRIFT_BOUNDS,
    "file": fields.PathOf(),
    "flag": fields.Flag(),
    "not negative": fields.NOT_NEGATIVE,
    "numbers": fields.EntriesOf(fields.ANY, least=1),
    "positive": fields.POSITIVE,
    "ratio": fields.RATIO,
    "text": fields.TextLine(),
    "text or texts": fields.Either(
        (fields.TextLine(), fields.EntriesOf(fields.TextLine(), least=1))
    ),
    "texts": fields.EntriesOf(fields.TextLine(), least=1),
}


class KeyFile:
    """Keys that a CSV file declares.

    Parameters
    ----------
    module : str
        Path of a module; the file with its name and the suffix `.csv` is read at the first use.
    """

    def __init__(self, module: str) -> None:
        self._module = module

    def __call__(self, section: str, /, **types: fields.ValueType) -> tuple[fields.Key, ...]:
        """Return the keys of a section in their order.

        Parameters
        ----------
        section : str
            Name of the section in the file, such as `buildings`.
        **types : ValueType
            Types of the keys for which the file states none, by the name of the key.
        """
        return tuple(
            fields.Key(
                row["name"],
                types[row["name"]] if row["name"] in types else _TYPES[row["type"]],
                row["meaning"],
                row["needed"] == "yes",
                row["advice"],
            )
            for row in declared_rows(self._module)
            if row["section"] == section
        )
