"""Tables on standard output: aligned text for a terminal, CSV for a pipe or a file."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

from tdint.errors import write_out_controls
from tdint_cli.terminal import emit, is_terminal

if TYPE_CHECKING:
    from tdint.output.tables.table import Cell, Table


T = TypeVar("T")

_DIGITS = 5  # significant digits of a number; files have more digits
_GAP = "  "  # space between two columns
_MIN_HEADER_WIDTH = 8
"""Width in characters up to which the words of a column header are not wrapped."""

_ERROR = "error_%"
"""Header of a column of estimated errors in percent."""
_NO_FILES = ("unit", "units", "notes")
"""Text columns whose values may contain a slash but are not paths, such as m/s^2."""

_FOLDER = "/"
_MAX_TRANSPOSED_ROWS = 3
"""Maximum number of rows that are transposed if the table is too wide for the screen."""


def with_percent_errors(table: Table) -> Table:
    """Return the table with each error column directly after its value column, to save width.

    The errors are in percent of the value, with two significant digits. The percentage is `None` if
    the value is zero, or if the value or the error is not a number.
    """
    from tdint.output.tables.table import Table, error_percent

    indices = {name: i for i, name in enumerate(table.columns)}
    # `error_columns` maps the index of each value column to the index of its error column.
    error_columns = {
        i: indices[f"{name}_error"] for name, i in indices.items() if f"{name}_error" in indices
    }
    names: list[str] = []
    rows: list[list[Cell]] = [[] for _ in table.rows]
    for name, i in indices.items():
        if i in error_columns.values():
            continue
        names += [name, _ERROR] if i in error_columns else [name]
        for row, cells in zip(rows, table.rows, strict=True):
            row.append(cells[i])
            if i in error_columns:
                row.append(error_percent(cells[error_columns[i]], cells[i]))
    return Table(tuple(names), list(map(tuple, rows)), table.meanings)


def draw(
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    width: int,
    units: Mapping[str, str] | None = None,
) -> str:
    """Return a table as text with lines of at most `width` characters, if possible.

    Columns without values are omitted. A text that is equal in all rows, and the common directory
    of all files, are printed once above the table. Column names are wrapped. A table that is too
    wide is split into blocks of columns, and each block repeats the columns that identify the row.
    A table with few rows is transposed instead.

    Parameters
    ----------
    rows : sequence of sequence
        Values of each row, in the order of `columns`. None is an empty cell.
    units : mapping, optional
        Unit of each column name. The default unit is 1.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    filled = [i for i in range(len(columns)) if not rows or any(row[i] for row in cells)]
    numeric = {
        i
        for i in filled
        if all(value is None or isinstance(value, (int, float)) for value in _at(rows, i))
    }
    common = [
        i
        for i in filled[:-1]
        if i not in numeric and len(rows) > 1 and len(set(_at(cells, i))) == 1
    ]
    common_text = "".join(f"{columns[i]}: {cells[0][i]}\n" for i in common)
    folder_text = ""
    shown = [i for i in filled if i not in common]
    for i in shown:
        if i in numeric or columns[i] in _NO_FILES or len(cells) < 2:
            continue
        if folder := _common_folder(_at(cells, i)):
            folder_text += f"{columns[i]}: in {folder}\n"
            for row in cells:
                row[i] = row[i].removeprefix(folder)
    units = units or {}
    drawn = [
        _column(
            columns[i],
            units.get(columns[i], "1"),
            _at(cells, i),
            right=i in numeric,
            limit=width // 2,
        )
        for i in shown
    ]
    table_width = sum(len(lines[0]) + len(_GAP) for lines in drawn) - len(_GAP)
    if table_width > width and 0 < len(rows) <= _MAX_TRANSPOSED_ROWS:
        # The transposed table also shows the columns with equal texts.
        names = [columns[i] for i in filled]
        return folder_text + _transposed(names, [_at(cells, i) for i in filled], width)
    texts = [i not in numeric for i in shown]
    errors = {position for position, i in enumerate(shown) if columns[i] == _ERROR}
    return common_text + folder_text + _side_by_side(drawn, texts, errors, width)


def _common_folder(files: Sequence[str]) -> str:
    """Return the common directory of all files, with its slash; empty without such a directory."""
    prefix = os.path.commonprefix(files)  # noqa: RUF071  of letters
    return prefix[: prefix.rfind(_FOLDER) + 1]


def _transposed(names: Sequence[str], columns: Sequence[Sequence[str]], width: int) -> str:
    """Return a table as text; each line contains the name and the values of a column.

    `columns` contains the cells of each column, one for each row of the table.
    """
    row_count = len(columns[0])
    name_width = max(map(len, names))
    # A shortened text of 8 characters still has five characters before its three dots.
    max_width = max(8, (width - name_width) // row_count - len(_GAP))
    # The values of a single row are not shortened.
    value_widths = [
        min(max_width, max(len(cells[k]) for cells in columns)) if row_count > 1 else None
        for k in range(row_count)
    ]
    text = ""
    for name, cells in zip(names, columns, strict=True):
        values = [
            value.ljust(value_width or 0)
            for value, value_width in zip(
                _shortened(cells, value_widths), value_widths, strict=True
            )
        ]
        text += _GAP.join([name.ljust(name_width), *values]).rstrip() + "\n"
    return text


def _at(rows: Sequence[Sequence[T]], i: int) -> list[T]:
    """Return column `i` of the rows."""
    return [row[i] for row in rows]


def _cell(value: object) -> str:
    """Return a cell as text with few digits and without terminal control characters."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        # The addition changes -0.0 to 0.0, so that no minus sign is printed.
        return format(value + 0.0, f".{_DIGITS}g")
    return write_out_controls(str(value))


def _column(name: str, unit: str, cells: Sequence[str], *, right: bool, limit: int) -> list[str]:
    """Return the lines of a column, padded to equal width: name (wrapped; may end with the unit),
    rule, cells. Cells longer than `limit` characters are shortened.
    """
    from tdint.units import suffix

    # Split the name into words. The unit is the last word and is not split.
    name_without_error = name.removesuffix("_error")
    unit_suffix = suffix(unit) if name_without_error.endswith(suffix(unit)) else ""
    error_word = ["error"] if name_without_error != name else []
    words = [
        *name_without_error.removesuffix(unit_suffix).split("_"),
        *error_word,
        *([unit] if unit_suffix else []),
    ]
    # The header is wrapped to the width of the cells. A longer word has a separate line.
    cells = _shortened(cells, [limit] * len(cells))
    max_width = max(_MIN_HEADER_WIDTH, *map(len, cells), 0)
    header = [""]
    for word in words:
        joined = f"{header[-1]} {word}".strip()
        if len(joined) <= max_width or not header[-1]:
            header[-1] = joined
        else:
            header.append(word)
    column_width = max(map(len, [*header, *cells]))
    lines = [*header, "-" * column_width, *cells]
    return [line.rjust(column_width) if right else line.ljust(column_width) for line in lines]


def _shortened(texts: Sequence[str], widths: Sequence[int | None]) -> list[str]:
    """Shorten each text to its number of characters in `widths` (None: unlimited).

    The end of each text is removed. If this makes two different texts equal, for example file names
    with different last characters, the middle of each text is removed instead.
    """
    pairs = list(zip(texts, widths, strict=True))
    short = [
        text if max_width is None or len(text) <= max_width else text[: max_width - 3] + "..."
        for text, max_width in pairs
    ]
    if len(set(short)) == len(set(texts)):
        return short
    return [
        text if max_width is None or len(text) <= max_width else _without_middle(text, max_width)
        for text, max_width in pairs
    ]


def _without_middle(text: str, width: int) -> str:
    """Shorten a text to `width` characters; three dots replace the middle."""
    kept = width - 3
    start = kept // 2
    return f"{text[:start]}...{text[len(text) - kept + start :]}"


def _side_by_side(
    columns: Sequence[list[str]], texts: Sequence[bool], errors: Collection[int], width: int
) -> str:
    """Return the columns side by side, in blocks that fit on the screen.

    `columns` contains the lines of each column, all of equal width within a column. `texts` is True
    for each column that contains text.
    """
    widths = [len(column[0]) for column in columns]
    # Every block repeats the leading text columns, which identify the row. These columns use at
    # most a third of the screen, but at least one column is repeated.
    key_count, used = 1, 0
    for count, is_text in enumerate(texts):
        used += widths[count] + len(_GAP)
        if not is_text or used > width // 3:
            key_count = max(1, count)
            break
    key_columns = list(range(min(key_count, len(columns))))
    # Keep each error column in the same block as its value column.
    blocks = [list(key_columns)]
    for i in range(len(key_columns), len(columns)):
        # A value column needs space for the error column that follows it.
        used = sum(widths[k] + len(_GAP) for k in blocks[-1])
        needed_width = widths[i] + (len(_GAP) + widths[i + 1] if i + 1 in errors else 0)
        if i not in errors and used + needed_width > width and len(blocks[-1]) > len(key_columns):
            blocks.append(list(key_columns))
        blocks[-1].append(i)
    # Align the rules of a block in one line by padding the shorter headers at the top. The rule is
    # the line that consists of hyphens.
    text = []
    for block in blocks:
        rule_lines = [
            next(k for k, line in enumerate(columns[i]) if line and not line.strip("-"))
            for i in block
        ]
        padded = [
            [" " * widths[i]] * (max(rule_lines) - rule) + columns[i]
            for i, rule in zip(block, rule_lines, strict=True)
        ]
        text.append(
            "".join(f"{_GAP.join(cells).rstrip()}\n" for cells in zip(*padded, strict=True))
        )
    return "\n".join(text)


def reading_width() -> int | None:
    """Return the width of the terminal in characters; None if there is no terminal."""
    if not is_terminal(sys.stdout):
        return None
    import shutil

    return shutil.get_terminal_size().columns


def table_bytes(table: Table, width: int | None) -> bytes:
    """Return a table as text for a screen of `width` characters, or as CSV if `width` is `None`.

    In the text, estimated errors are in percent of their values. Both are encoded as UTF-8.
    """
    if width is None:
        return table.csv()
    table = with_percent_errors(table)
    units = {name: meaning.get("unit", "1") for name, meaning in table.meanings.items()}
    return draw(table.columns, table.rows, width, units).encode("utf-8", "replace")


def emit_table(table: Table) -> None:
    """Write a table to standard output: aligned text to a terminal, CSV to a pipe or a file."""
    emit(table_bytes(table, reading_width()))
