"""Results as a person at a Python prompt or in a notebook meets them: a short line, a table, columns for pandas."""

from __future__ import annotations

from importlib import import_module
from typing import Any, ClassVar


class Tabular:
    """A result with a table. Its columns are declared where tables are written, which may know all results, while
    results know nothing of tables: the package's front door, which knows both, says where they are.

    Attributes
    ----------
    tables : str
        Name of the module with `to_dict` and `to_html`; set by `tdint/__init__.py`.
    """

    tables: ClassVar[str]

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
        columns: dict[str, Any] = import_module(self.tables).to_dict(self, units)
        return columns

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._headline()}>"

    def _repr_html_(self) -> str:
        """A caption and the first rows, for notebooks."""
        return str(import_module(self.tables).to_html(self, self._headline()))
