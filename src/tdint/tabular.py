"""Results as a person at a Python prompt or in a notebook meets them: a short line, a table, columns for pandas."""

from __future__ import annotations

from importlib import import_module
from typing import Any


class Tabular:
    """A result with a table. Its columns are declared where tables are written (`tdint.output.tables.columns`), which
    may know all results, while results know nothing of tables: so they are asked for at the package's front door.
    """

    def _headline(self) -> str:
        """What it is, in a line."""
        raise NotImplementedError

    def to_dict(self, units: str = "") -> dict[str, Any]:
        """The columns of its table by name, as arrays: `pandas.DataFrame(result.to_dict())`.

        Parameters
        ----------
        units : str
            Units in place of SI, such as `kip,in,g`; the names change with them.

        Returns
        -------
        dict
            Arrays of one length; words as lists.
        """
        columns: dict[str, Any] = import_module("tdint").to_dict(self, units)
        return columns

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._headline()}>"

    def _repr_html_(self) -> str:
        """A caption and the first rows, for notebooks."""
        return str(import_module("tdint.output.tables.frames").to_html(self, self._headline()))
