"""Compare two tables of `tdint run` from different environments: same_run.py ONE OTHER.

Texts must be equal, and numbers must be equal within the rounding of different libraries. The exit
code is 1 if the tables differ.
"""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

ROUNDING = 1e-9
"""Dimensionless. Maximum difference of two numbers divided by their size: libraries that sum in
another order differ by about 1e-12 of the peaks."""

SMALLEST = 1e-12
"""Difference, in the unit of the column, that is attributed to rounding for a value near zero."""


def differences(table: list[list[str]], other_table: list[list[str]]) -> list[str]:
    """Return a message for each cell that differs."""
    if [len(row) for row in table] != [len(row) for row in other_table] or table[0] != other_table[
        0
    ]:
        return ["other rows or columns"]
    head, differing_cells = table[0], []
    for row, other_row in zip(table[1:], other_table[1:], strict=True):
        for name, a, b in zip(head, row, other_row, strict=True):
            # An estimated error is a difference of two peaks: it is rounded like the peaks.
            peak = row[head.index(name.removesuffix("_error"))] if name.endswith("_error") else ""
            allowed = max(SMALLEST, ROUNDING * abs(float(peak or 0.0)))
            if a != b and not is_close(a, b, allowed):
                differing_cells.append(f"{name}: {a} and {b}")
    return differing_cells


def is_close(a: str, b: str, allowed: float) -> bool:
    """Return whether two cells are numbers that are equal up to rounding."""
    try:
        return math.isclose(float(a), float(b), rel_tol=ROUNDING, abs_tol=allowed)
    except ValueError:
        return False


if __name__ == "__main__":
    tables = [list(csv.reader(Path(name).read_text("utf-8").splitlines())) for name in sys.argv[1:]]
    if lines := differences(*tables):
        sys.exit("\n".join([f"{sys.argv[1]} and {sys.argv[2]} differ:", *lines]))
