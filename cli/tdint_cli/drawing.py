"""Tables as a person at a terminal reads them: columns under each other, a few digits, no wider than the screen."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

from tdint_cli.terminal import emit, is_terminal

if TYPE_CHECKING:
    from tdint.output.tables.table import Cell, Table


T = TypeVar("T")

_DIGITS = 5
_GAP = "  "
_NARROWEST = 8
"""Characters of a column's name on one line at least."""

_ERROR = "error_%"
_NO_FILES = ("unit", "units", "notes")
"""Columns of words that are no paths: m/s^2."""

_FOLDER = "/"
_FEW = 3
"""So many rows are drawn as columns where they are too wide: every name with its values beside it."""


def reading_width() -> int | None:
    """Columns of the screen that standard output is, or None if it is none."""
    if not is_terminal(sys.stdout):
        return None
    import shutil

    return shutil.get_terminal_size().columns


def table_bytes(table: Table, width: int | None) -> bytes:
    """A table as it goes to standard output: drawn for a screen of this width, else CSV.

    What is corrected is not drawn: it differs in digits that are not, or its error says by how much.
    """
    if width is None:
        return table.csv()
    from tdint.output.tables.table import CORRECTED

    table = _errors_beside(table.chosen(name for name in table.columns if not name.startswith(CORRECTED)))
    units = {name: said.get("unit", "1") for name, said in table.meanings.items()}
    return draw(table.columns, table.rows, width, units).encode("utf-8", "replace")


def _errors_beside(table: Table) -> Table:
    """A table whose errors stand behind what they are errors of, in percent of it, two digits: there are more columns
    than a screen is wide."""
    from tdint.output.tables.table import Table

    places = {name: i for i, name in enumerate(table.columns)}
    errors = {i: places[f"{name}_error"] for name, i in places.items() if f"{name}_error" in places}
    names: list[str] = []
    rows: list[list[Cell]] = [[] for _ in table.rows]
    for name, i in places.items():
        if i in errors.values():
            continue
        names += [name, _ERROR] if i in errors else [name]
        for row, cells in zip(rows, table.rows, strict=True):
            row += [cells[i], _percent(cells[errors[i]], cells[i])] if i in errors else [cells[i]]
    return Table(tuple(names), list(map(tuple, rows)), table.meanings)


def _percent(error: Cell, value: Cell) -> Cell:
    if not isinstance(error, float) or not isinstance(value, float) or math.isnan(error) or not value:
        return None
    return float(f"{100.0 * error / abs(value):.2g}")


def emit_table(table: Table) -> None:
    """Write a table to standard output: drawn where a person reads it, CSV into a pipe or a file."""
    emit(table_bytes(table, reading_width()))


def draw(
    columns: Sequence[str], rows: Sequence[Sequence[object]], width: int, units: Mapping[str, str] | None = None
) -> str:
    """A table as text, lines of at most `width` characters if that can be done; `units` of the columns.

    Columns without any value are left out, a text that is the same in all rows stands above, and the folder of files
    that all lie in one; names of columns stand on several lines. What is too wide is drawn in blocks of columns, each
    with the columns before it that name the row; a few rows that are too wide are drawn as columns instead.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    filled = [i for i in range(len(columns)) if not rows or any(row[i] for row in cells)]
    numeric = {i for i in filled if all(value is None or isinstance(value, (int, float)) for value in _at(rows, i))}
    common = [i for i in filled[:-1] if i not in numeric and len(rows) > 1 and len(set(_at(cells, i))) == 1]
    files = [i for i in filled if i not in numeric and columns[i] not in _NO_FILES]
    folders = {i: folder for i in files if (folder := _folder(_at(cells, i)))}
    for i, folder in folders.items():
        if i not in common:
            for row in cells:
                row[i] = row[i].removeprefix(folder)
    drawn = [
        (
            i not in numeric,
            _column(_words(columns[i], units or {}), _at(cells, i), right=i in numeric, limit=width // 2),
        )
        for i in filled
        if i not in common
    ]
    whole = sum(len(column[0]) + len(_GAP) for _, column in drawn) - len(_GAP)
    if whole > width and 0 < len(rows) <= _FEW:
        return _turned([columns[i] for i in filled], [[row[i] for i in filled] for row in cells], width)
    above = "".join(f"{columns[i]}: {cells[0][i]}\n" for i in common)
    above += "".join(f"{columns[i]}: in {folder}\n" for i, folder in folders.items() if i not in common)
    keys = _keys([(text, len(column[0])) for text, column in drawn], width)
    shown = [i for i in filled if i not in common]
    errors = {place for place, i in enumerate(shown) if columns[i] == _ERROR}
    blocks = _blocks([len(column[0]) for _, column in drawn], keys, width, errors)
    return above + "\n".join("\n".join(_lines([drawn[i][1] for i in block])) + "\n" for block in blocks)


def _at(rows: Sequence[Sequence[T]], i: int) -> list[T]:
    return [row[i] for row in rows]


def _folder(cells: Sequence[str]) -> str:
    """The folder with its separator that several files all lie in, whatever lies below it; nothing without one."""
    if len(cells) < 2 or not all(_FOLDER in cell for cell in cells):
        return ""
    first, last = min(cells), max(cells)  # what these begin with alike, all do
    same = next((i for i, (part, other) in enumerate(zip(first, last, strict=False)) if part != other), len(first))
    return first[: first.rfind(_FOLDER, 0, same) + 1]


def _cell(value: object) -> str:
    """A cell in few digits; nothing that could command a terminal."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return format(value + 0.0, f".{_DIGITS}g")
    return "".join(letter if letter.isprintable() else "?" for letter in str(value))


def _column(name: Sequence[str], cells: Sequence[str], *, right: bool, limit: int) -> list[str]:
    """A column: the words of its name on as many lines as it takes, a rule, its cells; all of one width."""
    cells = [_shortened(cell, limit) for cell in cells]
    head = _broken(name, max(map(len, cells), default=0))
    wide = max(map(len, [*head, *cells]))
    lines = [*head, "-" * wide, *cells]
    return [line.rjust(wide) if right else line.ljust(wide) for line in lines]


def _broken(name: Sequence[str], room: int) -> list[str]:
    """The words of a column's name on lines of `room` characters."""
    room = max(room, _NARROWEST)
    lines = [""]
    for word in name:
        joined = f"{lines[-1]} {word}".strip()
        if len(joined) <= room or not lines[-1]:
            lines[-1] = joined
        else:
            lines.append(word)
    return lines


def _words(name: str, units: Mapping[str, str]) -> list[str]:
    """The words of a column's name, its unit last and whole."""
    from tdint.units import suffix

    bare, unit = name.removesuffix("_error"), units.get(name, "1")
    end = suffix(unit) if bare.endswith(suffix(unit)) else ""
    error = ["error"] if bare != name else []
    return [*bare.removesuffix(end).split("_"), *error, *([unit] if end else [])]


def _shortened(text: str, room: int) -> str:
    return text if len(text) <= room else text[: room - 3] + "..."


def _keys(columns: Sequence[tuple[bool, int]], width: int) -> int:
    """How many columns name the row: texts at the start that leave most of the screen, but one at least."""
    used = 0
    for count, (text, letters) in enumerate(columns):
        used += letters + len(_GAP)
        if not text or used > width // 3:
            return max(1, count)
    return 1


def _blocks(widths: Sequence[int], keys: int, width: int, errors: Collection[int] = ()) -> list[list[int]]:
    """Columns that fit on the screen together, errors with what they are errors of; the first ones, which name the row,
    stand in every block."""
    names = list(range(min(keys, len(widths))))
    blocks = [list(names)]
    for i in range(len(names), len(widths)):
        used = sum(widths[k] + len(_GAP) for k in blocks[-1])
        both = widths[i] + (len(_GAP) + widths[i + 1] if i + 1 in errors else 0)
        if i not in errors and used + both > width and len(blocks[-1]) > len(names):
            blocks.append(list(names))
        blocks[-1].append(i)
    return blocks


def _lines(columns: Sequence[list[str]]) -> list[str]:
    """Columns side by side; their rules stand in one line, the names above it end there."""
    rules = [next(i for i, line in enumerate(column) if line.strip("-") == "" and line) for column in columns]
    deepest = max(rules)
    padded = [[" " * len(column[0])] * (deepest - rule) + column for column, rule in zip(columns, rules, strict=True)]
    return [_GAP.join(cells).rstrip() for cells in zip(*padded, strict=True)]


def _turned(columns: Sequence[str], cells: Sequence[Sequence[str]], width: int) -> str:
    """A line for each column: its name and its values."""
    name = max(map(len, columns))
    room = max(8, (width - name) // len(cells) - len(_GAP))
    wides = [min(room, max(map(len, row))) if len(cells) > 1 else 0 for row in cells]
    lines = []
    for i, column in enumerate(columns):
        values = [
            _shortened(row[i], wide).ljust(wide) if wide else row[i] for row, wide in zip(cells, wides, strict=True)
        ]
        lines.append(_GAP.join([column.ljust(name), *values]).rstrip())
    return "\n".join(lines) + "\n"
