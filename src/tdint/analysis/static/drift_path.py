"""A path of drifts from a CSV file."""

from __future__ import annotations

from tdint.csv_table import read_table
from tdint.errors import UsageError

COLUMN = "drift_m"


def read_drift_path(source: str) -> list[float]:
    """The numbers in the column `drift_m` of a CSV file; `-` is standard input, other columns are not read.

    Raises
    ------
    UsageError
        The file cannot be read, has no such column, or a cell of it is no finite number.
    """
    table = read_table(source, f"give a CSV file with a column {COLUMN}", columns=(COLUMN,), error=UsageError)
    if not table.has(COLUMN):
        raise UsageError(f"{source}: the first line names no column {COLUMN}")
    if not table.rows:
        raise UsageError(f"{source}: holds no drift under {COLUMN}")
    return table.numbers(COLUMN)
