"""A path of drifts from a CSV file."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

from tdint.errors import UsageError

COLUMN = "drift_m"


def read_drift_path(source: str) -> list[float]:
    """The numbers in the column `drift_m` of a CSV file; `-` is standard input, other columns are not read.

    Raises
    ------
    UsageError
        The file cannot be read, has no such column, or a cell of it is no finite number.
    """
    try:
        data = sys.stdin.buffer.read() if source == "-" else Path(source).read_bytes()
        rows = list(csv.reader(data.decode("utf-8-sig").splitlines()))
    except FileNotFoundError:
        raise UsageError(f"{source}: no such file; give a CSV file with a column {COLUMN}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{source}: not UTF-8 text; give a CSV file with a column {COLUMN}") from None
    except (OSError, ValueError, csv.Error) as error:
        raise UsageError(f"{source}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    if COLUMN not in header:
        raise UsageError(f"{source}: the first line names no column {COLUMN}")
    place = header.index(COLUMN)
    drifts = [_number(source, line, row, place) for line, row in enumerate(rows[1:], start=2) if any(row)]
    if not drifts:
        raise UsageError(f"{source}: holds no drift under {COLUMN}")
    return drifts


def _number(source: str, line: int, row: list[str], place: int) -> float:
    text = row[place].strip() if place < len(row) else ""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UsageError(f"{source}:{line}: {COLUMN} must be a number, got {text!r}")
    return number
