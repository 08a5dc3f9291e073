"""Tables of numbers of a model file: rows in a list, or a CSV file without a header.

The size of a table is checked before its numbers are converted, and the numbers are an array.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from tdint.arrays import Array
from tdint.csv_table import numbers_in, read_rows
from tdint.errors import ModelError
from tdint.model.keys.fields import NUMBER, Value
from tdint.model.keys.nodes import ListNode, NumberRows, ScalarNode
from tdint.number_parsing import LARGEST, SMALLEST, pluralize


def numbers_of_rows(value: Value, columns: int) -> Array | None:
    """Return a list of rows of numbers, shape (rows, columns); None if a row has another length or
    an entry is not a number, which the caller reports with its position."""
    rows = value.node.items if isinstance(value.node, ListNode) else ()
    if isinstance(rows, NumberRows):
        table = np.array(rows.data).reshape(-1, rows.columns)
        size = np.abs(table)
        is_valid = rows.columns == columns and bool(
            np.all((table == 0.0) | ((size >= SMALLEST) & (size <= LARGEST)))
        )
        return table if is_valid else None
    texts: list[str] = []
    for row in rows:
        entries = row.items if isinstance(row, ListNode) else ()
        texts += [entry.text for entry in entries if isinstance(entry, ScalarNode) and entry.plain]
        if len(entries) != columns:
            return None
    if len(texts) < columns * len(rows) or not all(map(NUMBER.fullmatch, texts)):
        return None
    table = numbers_in(texts)
    return None if np.isnan(table).any() else table.reshape(-1, columns)


def square_table(value: Value, count: int | None, most: int, form: str) -> Array | None:
    """Return a square table of numbers from a list of rows or a CSV file; None after an error.

    Parameters
    ----------
    count : int | None
        Number of rows, if it is known.
    most : int
        Maximum number of rows.
    form : str
        Description of the table, for messages.
    """
    if not isinstance(value.node, ListNode):
        return _square_file(value, count, most, form)
    length = len(value.node.items)
    count = count or length
    if length and not _has_size(value, [count] * length, count, most):
        return None
    table = numbers_of_rows(value, count) if length else None
    if table is not None:
        return table
    # Report rows of another length, or each entry that is not a number.
    rows = value.items(form, "must contain at least one row") or ()
    entries = [row.items("a row of numbers") for row in rows]
    if None not in entries and _has_size(value, [len(row or ()) for row in entries], count, most):
        for entry in chain.from_iterable(filter(None, entries)):
            entry.number()
    return None


def _square_file(value: Value, count: int | None, most: int, form: str) -> Array | None:
    """Return the numbers of a CSV file; None after an error.

    No message contains text of the file, because it may not be a table.
    """
    path = value.file()
    if path is None:
        return None
    rows: list[Array] = []
    lengths: list[int] = []
    try:
        # Cells of a table that is too large are only counted.
        for line, cells in read_rows(path, f"give {form}"):
            lengths.append(len(cells))
            if len(cells) > (count or most) or len(lengths) > (count or most):
                continue
            rows.append(numbers_in([cell.strip() for cell in cells]))
            if np.isnan(rows[-1]).any():
                column = int(np.flatnonzero(np.isnan(rows[-1]))[0]) + 1
                value.fault(f"{path}:{line}: column {column} is not a number; give {form}")
                return None
    except ModelError as error:
        value.fault(str(error))
        return None
    if not lengths:
        value.fault("must contain at least one row")
        return None
    size = count or max(lengths[0], len(lengths))
    return np.array(rows) if _has_size(value, lengths, size, most) else None


def _has_size(value: Value, lengths: list[int], count: int, most: int) -> bool:
    """Return True if the rows with these numbers of entries are square; otherwise report it."""
    if count > most:
        value.fault(f"must have at most {most} rows, got {count}")
        return False
    short = next((i for i, length in enumerate(lengths) if length != count), None)
    if len(lengths) == count and short is None:
        return True
    found = pluralize(len(lengths), "row")
    if short is not None and len(lengths) == count:
        found = f"{pluralize(lengths[short], 'number')} in row {short + 1}"
    value.fault(f"must have {count} rows of {count} numbers, got {found}")
    return False
