"""Description of a set of records: the files, and the options for reading and processing.

A YAML file with these keys represents the records in every place where a command accepts a record,
a pattern or a directory. The key `records` of a campaign file has the same keys.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unicodedata import category

from tdint.errors import UsageError
from tdint.files import STDIN
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import USUAL, PairNames
from tdint.model.config.keys import keys
from tdint.model.config.model_file import LAYOUT, PROCESSING, read_choice
from tdint.model.keys import fields
from tdint.model.keys.document import read_document

(UNITS,) = keys("units of records")
FILES = (
    *keys("records", pairs=fields.Either((fields.Flag(), fields.TextLine()))),
    *LAYOUT,
    *PROCESSING,
)
_DESCRIPTION = fields.Keys((*FILES, UNITS))
_OTHER_YAML = frozenset(("stories", "building", "buildings", "matrices"))
"""Keys of model files and campaign files, which are no descriptions of records."""


@dataclass(frozen=True)
class RecordFiles:
    """Records in files and directories.

    Attributes
    ----------
    files : tuple of str
        Files, patterns and directories, relative to the working directory.
    pairs : PairNames | None
        Naming scheme of the two components of a motion; None: components are separate motions.
    """

    files: tuple[str, ...]
    choice: RecordChoice
    pairs: PairNames | None = None


def read_description(source: str) -> RecordFiles | None:
    """Read a description of records.

    Parameters
    ----------
    source : str
        YAML file. Relative paths in the file refer to its directory.

    Returns
    -------
    RecordFiles | None
        None if the file is a model file or a campaign file.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML, or has errors; all errors are listed with line and
        column.
    """
    _, root = read_document(source, "description of records", "`files`")
    if root.is_mapping and not _OTHER_YAML.isdisjoint(root.names):
        return None
    section = root.section(_DESCRIPTION)
    described = None
    if section:
        section.need("files", "give a list of files, patterns and directories")
        described = read_files(section)
    root.faults.raise_if_any()
    assert described is not None
    return described


def read_files(section: fields.Section) -> RecordFiles:
    """Return the files of a section with the keys `FILES` and `UNITS`, and the options for reading.
    Errors are recorded in the document."""
    empty = "is empty; give at least one record"
    files = section.files("files", "a list of files and directories", empty)
    pairs, component = section.get("pairs"), section.get("component")
    pair_names = _pair_names(pairs) if pairs else None
    if pair_names and component:
        component.fault("cannot be used with `pairs`, which use both components; remove one key")
    return RecordFiles(files, choice_of_files(section), pair_names)


def _pair_names(value: fields.Value) -> PairNames | None:
    """Return the naming scheme of the files of pairs: patterns such as `{}_N.AT2,{}_E.AT2`, or the
    usual names for `true`; None for `false` and for an invalid value, which is recorded as an
    error."""
    if "{}" in value.word:
        return value.parsed(PairNames.parse)
    return USUAL if value.boolean() else None


def choice_of_files(section: fields.Section) -> RecordChoice:
    """Return the selection of components and the processing of the records. An error is recorded if
    the keys `units` and `inventory` (station metadata, which contain the units) are combined."""
    choice, units = read_choice(section, stdin=False, many=True), section.get("units")
    if units and choice.inventory and isinstance(choice.units, str):
        units.fault("cannot be used with `inventory`, which states the units; remove one key")
    return choice


def description_text(files: Sequence[str], choice: RecordChoice, folder: Path) -> str:
    """Return the text of a description of records.

    Parameters
    ----------
    files : sequence of str
        Files, patterns and directories, relative to the working directory.
    folder : Path
        Directory of the description; its paths are relative to this directory.

    Raises
    ------
    UsageError
        A name cannot be read from a description: standard input, or a control character.
    """
    lines = ["files:"]
    for file in files:
        is_plain = not any(category(character) in _CONTROLS for character in file)
        if file == STDIN or not is_plain:
            reason = "standard input" if file == STDIN else "a name with control characters"
            raise UsageError(
                f"{file!a}: a description of records cannot contain {reason}; use a file with "
                "another name"
            )
        path = file if os.path.isabs(file) else os.path.relpath(file, folder)  # noqa: PTH117
        lines.append(f"  - {_scalar(path)}")
    for name, value in stated_settings(choice).items():
        if name == "inventory" and not os.path.isabs(value):  # noqa: PTH117
            value = os.path.relpath(value, folder)
        lines.append(f"{name}: {_scalar(value)}")
    return "\n".join((*lines, ""))


def stated_settings(choice: RecordChoice) -> dict[str, Any]:
    """Return the settings of a choice that are not the default, by the key of the description."""
    settings = {name: getattr(choice, name) for name in ("units", "component", "inventory")}
    stated = {name: value for name, value in settings.items() if value is not None}
    return stated | choice.layout.set_fields() | choice.processing.set_fields()


_CONTROLS = ("Cc", "Cs", "Zl", "Zp")
"""Unicode categories of control characters and of line ends, which a text of YAML cannot contain
on one line."""

_PLAIN = r"[A-Za-z/.][\w/.^-]*"
_WORDS = frozenset(("true", "false", "yes", "no", "on", "off", "null", "nan", "inf"))
"""Texts that YAML reads as other values, so that they need quotation marks."""


def _scalar(value: Any) -> str:
    """Return the value of a key in YAML."""
    if value is True:
        return "true"
    if isinstance(value, Mapping):
        value = ",".join(f"{name}={units}" for name, units in value.items())
    if isinstance(value, tuple):
        # A range of times is written START:END, and several columns as a list.
        if all(part is None or isinstance(part, float) for part in value):
            value = ":".join("" if part is None else repr(part) for part in value)
        elif len(value) == 1:
            value = value[0]
        else:
            return f"[{', '.join(map(_scalar, value))}]"
    if isinstance(value, int | float) or str(value).isdecimal():
        return str(value)
    text = str(value)
    is_plain = re.fullmatch(_PLAIN, text) and text.lower() not in _WORDS
    return text if is_plain else json.dumps(text, ensure_ascii=False)
