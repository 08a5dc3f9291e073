"""Declared columns of tables, which `columns.csv` lists with their units and meanings.

Each row of the file is a column: key of its table, name, SI unit (`1`: dimensionless, `text`), and
meaning for users. The cells are the attribute of the result with the name of the column, without
the suffix of the unit. The module of a table states other cells.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from tdint.files import declared_rows
from tdint.items import grouped
from tdint.output.tables.table import Column
from tdint.units import suffix


class ColumnFile:
    """Columns that a CSV file declares.

    Parameters
    ----------
    module : str
        Path of a module; the file with its name and the suffix `.csv` is read at the first use.
    """

    def __init__(self, module: str) -> None:
        self._module = module

    def __call__(self, table: str, part: Any = None, /, **values: Any) -> tuple[Column, ...]:
        """Return the columns of a table in their order.

        Parameters
        ----------
        table : str
            Key of the table in the file, such as `campaign.profiles`.
        part : path, optional
            Part of the result with the attributes, from a `placeholder`; by default the result.
        **values : str or callable
            Cells of columns that are no attribute with their name, by the name of the column.
        """
        return tuple(
            column._replace(
                value=values.get(column.name)
                or (column.value if part is None else getattr(part, column.value))
            )
            for column in _tables(self._module)[table]
        )


@cache
def _tables(module: str) -> dict[str, list[Column]]:
    """Return the columns of all tables of a module by the key of the table."""
    return grouped(
        (table, Column(name, unit, name.removesuffix(suffix(unit)), meaning))
        for table, name, unit, meaning in map(dict.values, declared_rows(module))
    )


declared = ColumnFile(__file__)
"""Columns of the tables of this package."""
