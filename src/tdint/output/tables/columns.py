"""Declared columns of tables, which `columns.csv` lists with their units and meanings.

Each row of the file is a column: key of its table, name, SI unit (`1`: dimensionless, `text`),
attribute of the result with its cells (empty: the name), and meaning for users.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from tdint.files import declared_rows
from tdint.output.tables.table import Column


class ColumnFile:
    """Columns that a CSV file declares.

    Parameters
    ----------
    module : str
        Path of a module; the file with its name and the suffix `.csv` is read at the first use.
    """

    def __init__(self, module: str) -> None:
        self._module = module

    def __call__(self, table: str, /, **values: Callable[[Any], Any]) -> tuple[Column, ...]:
        """Return the columns of a table in their order.

        Parameters
        ----------
        table : str
            Key of the table in the file, such as `campaign.profiles`.
        **values : callable
            Functions of a result that return the cells of a column, by the name of the column, for
            columns whose cells are no attribute of the result.
        """
        return tuple(
            column._replace(value=values.get(column.name, column.value))
            for column in _tables(self._module)[table]
        )


@cache
def _tables(module: str) -> dict[str, list[Column]]:
    """Return the columns of all tables of a module by the key of the table."""
    tables: dict[str, list[Column]] = {}
    for row in declared_rows(module):
        column = Column(row["name"], row["unit"], row["value"] or row["name"], row["meaning"])
        tables.setdefault(row["table"], []).append(column)
    return tables


declared = ColumnFile(__file__)
"""Columns of the tables of this package."""
