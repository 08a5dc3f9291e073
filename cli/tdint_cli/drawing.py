"""Tables as a person at a terminal reads them: columns under each other, a few digits, no wider
than the screen."""

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
"""So many rows are drawn as columns where they are too wide: every name with its values beside
it."""


def reading_width() -> int | None:
    """Columns of the screen that standard output is, or None if it is none."""
    if not is_terminal(sys.stdout):
        return None
    import shutil

    return shutil.get_terminal_size().columns


def table_bytes(table: Table, width: int | None) -> bytes:
    """A table as it goes to standard output: drawn for a screen of this width, else CSV."""
    if width is None:
        return table.csv()
    table = _errors_beside(table)
    units = {name: said.get("unit", "1") for name, said in table.meanings.items()}
    return draw(table.columns, table.rows, width, units).encode("utf-8", "replace")


def _errors_beside(table: Table) -> Table:
    """A table whose errors stand behind what they are errors of, in percent of it, two digits:
    there are more columns than a screen is wide."""
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
            row.append(cells[i])
            if i in errors:
                # Of zero, and of what is no number, there is no percentage.
                value, error = cells[i], cells[errors[i]]
                percent = None
                if (
                    isinstance(error, float)
                    and isinstance(value, float)
                    and not math.isnan(error)
                    and value
                ):
                    percent = float(f"{100.0 * error / abs(value):.2g}")
                row.append(percent)
    return Table(tuple(names), list(map(tuple, rows)), table.meanings)


def emit_table(table: Table) -> None:
    """Write a table to standard output: drawn where a person reads it, CSV into a pipe or a
    file."""
    emit(table_bytes(table, reading_width()))


def draw(
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    width: int,
    units: Mapping[str, str] | None = None,
) -> str:
    """A table as text, lines of at most `width` characters if that can be done; `units` of the
    columns.

    Columns without any value are left out, a text that is the same in all rows stands above, and
    the folder of files that all lie in one; names of columns stand on several lines. What is too
    wide is drawn in blocks of columns, each with the columns before it that name the row; a few
    rows that are too wide are drawn as columns instead.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    filled = [i for i in range(len(columns)) if not rows or any(row[i] for row in cells)]
    numeric = {
        i
        for i in filled
        if all(value is None or isinstance(value, (int, float)) for value in _at(rows, i))
    }
    # Said once, above: the text of all rows, but in the last column; the folder with its / that all
    # files lie in.
    common = [
        i
        for i in filled[:-1]
        if i not in numeric and len(rows) > 1 and len(set(_at(cells, i))) == 1
    ]
    above = "".join(f"{columns[i]}: {cells[0][i]}\n" for i in common)
    folders = ""
    shown = [i for i in filled if i not in common]
    for i in shown:
        if i in numeric or columns[i] in _NO_FILES or len(cells) < 2:
            continue
        first, last = min(_at(cells, i)), max(_at(cells, i))  # what these begin with alike, all do
        same = next(
            (
                k
                for k, (letter, other) in enumerate(zip(first, last, strict=False))
                if letter != other
            ),
            len(first),
        )
        if folder := first[: first.rfind(_FOLDER, 0, same) + 1]:
            folders += f"{columns[i]}: in {folder}\n"
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
    # A few rows that are too wide: a line for each column, with its name and its values.
    whole = sum(len(column[0]) + len(_GAP) for column in drawn) - len(_GAP)
    if whole > width and 0 < len(rows) <= _FEW:
        longest = max(len(columns[i]) for i in filled)
        room = max(
            8, (width - longest) // len(cells) - len(_GAP)
        )  # for three letters and the dots of a cut
        wides = [
            min(room, max(len(row[i]) for i in filled)) if len(cells) > 1 else None for row in cells
        ]
        text = folders
        for i in filled:
            values = [
                _shortened(row[i], wide).ljust(wide) if wide else row[i]
                for row, wide in zip(cells, wides, strict=True)
            ]
            text += _GAP.join([columns[i].ljust(longest), *values]).rstrip() + "\n"
        return text
    texts = [i not in numeric for i in shown]
    errors = {place for place, i in enumerate(shown) if columns[i] == _ERROR}
    return above + folders + _side_by_side(drawn, texts, errors, width)


def _at(rows: Sequence[Sequence[T]], i: int) -> list[T]:
    return [row[i] for row in rows]


def _cell(value: object) -> str:
    """A cell in few digits; nothing that could command a terminal."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return format(value + 0.0, f".{_DIGITS}g")
    return "".join(letter if letter.isprintable() else "?" for letter in str(value))


def _column(name: str, unit: str, cells: Sequence[str], *, right: bool, limit: int) -> list[str]:
    """A column: its name on as many lines as it takes, a rule, its cells; all of one width."""
    from tdint.units import suffix

    # The words of the name, its unit last and whole
    bare = name.removesuffix("_error")
    end = suffix(unit) if bare.endswith(suffix(unit)) else ""
    error = ["error"] if bare != name else []
    words = [*bare.removesuffix(end).split("_"), *error, *([unit] if end else [])]
    # On lines that are no longer than the cells, if a word is not
    cells = [_shortened(cell, limit) for cell in cells]
    room = max(_NARROWEST, *map(len, cells), 0)
    head = [""]
    for word in words:
        joined = f"{head[-1]} {word}".strip()
        if len(joined) <= room or not head[-1]:
            head[-1] = joined
        else:
            head.append(word)
    wide = max(map(len, [*head, *cells]))
    lines = [*head, "-" * wide, *cells]
    return [line.rjust(wide) if right else line.ljust(wide) for line in lines]


def _shortened(text: str, room: int) -> str:
    return text if len(text) <= room else text[: room - 3] + "..."


def _side_by_side(
    columns: Sequence[list[str]], texts: Sequence[bool], errors: Collection[int], width: int
) -> str:
    """Columns beside each other, in blocks that fit on the screen; `texts` are those of words."""
    widths = [len(column[0]) for column in columns]
    # The row is named by words at the start that leave most of the screen, but by one column at
    # least: in every block.
    names, used = 1, 0
    for count, is_text in enumerate(texts):
        used += widths[count] + len(_GAP)
        if not is_text or used > width // 3:
            names = max(1, count)
            break
    keys = list(range(min(names, len(columns))))
    # Errors stand with what they are errors of.
    blocks = [list(keys)]
    for i in range(len(keys), len(columns)):
        used = sum(widths[k] + len(_GAP) for k in blocks[-1])
        both = widths[i] + (len(_GAP) + widths[i + 1] if i + 1 in errors else 0)
        if i not in errors and used + both > width and len(blocks[-1]) > len(keys):
            blocks.append(list(keys))
        blocks[-1].append(i)
    # The rules of a block stand in one line, and the names above it end there.
    text = []
    for block in blocks:
        rules = [
            next(k for k, line in enumerate(columns[i]) if line and not line.strip("-"))
            for i in block
        ]
        padded = [
            [" " * widths[i]] * (max(rules) - rule) + columns[i]
            for i, rule in zip(block, rules, strict=True)
        ]
        text.append(
            "".join(f"{_GAP.join(cells).rstrip()}\n" for cells in zip(*padded, strict=True))
        )
    return "\n".join(text)
