"""Plain text: a column of accelerations, or a time and one or several columns, with what they are
in a header.

The header is made of comments (after #, %, ;, ! or //), of declarations `key = value` or `key:
value`, bare or in comments (`# dt = 0.01 s, units = g`), and of names of columns
(`time_s,acceleration_m_s2`, `Time (s); Acceleration (g)`). Commas, semicolons, tabs or blanks
divide columns; beside semicolons and tabs, a comma is a decimal point.

One column needs its sampling interval declared; of several, the first must be a time in equal
steps, unless the names of the columns have none. Columns without names are components called by
their number (2 is the one after the time). Velocity and displacement beside an acceleration give
its peaks; alone they are differentiated. Nothing is guessed: without declared units the user must
give them. What a table does not tell of its step, its columns and the lines above it a user may say
(`TextLayout`); the names of columns are any words then.
"""

from __future__ import annotations

import re
import warnings
from array import array
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.choice import AS_STATED, SAME_STEP, TextLayout
from tdint.ground_motion.formats.lines import ROW, Lines, equal_steps, read_lines, recognizes
from tdint.ground_motion.formats.series import (
    Series,
    code,
    motion_scale,
    motion_units,
    required_units,
    to_stream,
)
from tdint.ground_motion.formats.table_columns import (
    COLUMNS,
    COMMENT,
    MOTIONS,
    OTHER,
    SECONDS,
    TIME,
    ColumnName,
    TableHeader,
    any_names,
    column_names,
    declared_in,
    lacks_first_name,
    place_of,
    read_foreign_header,
    read_header,
)
from tdint.ground_motion.miniseed_checks import SAMPLES, STEP
from tdint.units import parse_units
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from obspy import Stream

Columns = list[NDArray[np.float64]]
Names = tuple[ColumnName, ...]

_OTHER_FORMAT = re.compile(r"#\s*DataSequence\s*:", re.IGNORECASE)
"""A comment that belongs to a format of its own (CWB)."""

_MOST = 50
"""Columns that a table may have."""


def is_text(file: Any, layout: TextLayout = AS_STATED, **_: Any) -> bool:
    """Whether a file has a header as above, if any, then rows of one number, or of several the
    first of which grows; with a layout, whether a table of numbers begins below the lines to
    skip."""
    return _begins(_first_rows(file, layout)[1]) if layout else recognizes(file, _matches)


def _first_rows(file: Any, layout: TextLayout) -> tuple[list[str], list[int]]:
    """What stands above the numbers, below the lines to skip; and how many of them each of their
    first two rows has."""
    above: list[str] = []
    widths: list[int] = []
    with suppress(RecordError):  # the file ends
        lines = read_lines(file, text_only=True)
        lines.skip(layout.skip_lines or 0)
        above = lines.take_until(ROW.fullmatch, "row of numbers")
        while len(widths) < 2 and (width := len(_numbers(lines.take()))):
            widths.append(width)
    return above, widths


def _begins(widths: list[int]) -> bool:
    return len(widths) == 2 and widths[0] == widths[1] <= _MOST


def table_in(data: bytes, layout: TextLayout) -> str:
    """What a file of unknown format has of a table, and what is to be told of it, in words; empty
    if it has none."""
    above, widths = _first_rows(BytesIO(data), layout)
    if len(widths) == 1:
        return (
            "one row of numbers; a record has two samples at least: is the rest of the file "
            "missing?"
        )
    if not _begins(widths):
        is_quoted = b'"' in data and _begins(
            _first_rows(BytesIO(data.replace(b'"', b"")), layout)[1]
        )
        return "its numbers stand in quotation marks; write them without" if is_quoted else ""
    names = any_names(above[-1], widths[0]) if above else ()
    if len(names) > 2 and names[0].kind == TIME:
        return (
            "tell by `column` which is the motion: "
            f"{', '.join(name.text[:40] for name in names[1:])}"
        )
    passed = f", past the lines above by `skip_lines={len(above)}`," if above else ""
    return (
        f"a table of numbers begins in line {len(above) + 1}: tell by `step` and `column`{passed} "
        "what it is"
    )


def read_text(
    file: Any, headonly: bool = False, layout: TextLayout = AS_STATED, **_: Any
) -> Stream:
    """Read a table; see above and `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        The sampling interval is not declared, times are not in equal steps, declarations contradict
        each other or the values, or something else than numbers stands among them.
    """
    lines = read_lines(file)
    skipped = layout.skip_lines or 0
    lines.skip(skipped)
    above = lines.take_until(ROW.fullmatch, "row of numbers")

    # Without a name for the first column the others would stand one place off.
    place = next((place for place in reversed(range(len(above))) if above[place].strip()), -1)
    if place >= 0 and lacks_first_name(above[place]):
        raise RecordError(
            f"line {skipped + place + 1}: {above[place].strip()[:60]!r} has no name for the first "
            "column, as where pandas writes its index; leave that out (index=False), or name it "
            "time if it is"
        )
    columns = _columns(lines, sum(map(_names_of, above)))
    width, size = len(columns), columns[0].size
    header = read_foreign_header(above, width, skipped) if layout else read_header(above, width)
    chosen = list(dict.fromkeys(place_of(column, header.names, width) for column in layout.column))

    # All that tells the sampling interval must agree: declarations, and the times.
    times = _times(columns, header.names, chosen, layout)
    stated = header.intervals()
    if times is not None:
        stated.append(equal_steps(times)[0])
    if stated and max(stated) - min(stated) > SAME_STEP * max(stated):
        raise RecordError(
            f"its sampling interval is stated as {' s and as '.join(f'{dt:g}' for dt in stated)} s"
        )
    dt = next(iter(stated), None) or layout.step
    if dt is None:
        raise RecordError(
            "a column of numbers without its sampling interval; declare it in a first line `# dt = "
            "0.01 s, units = g`, or give it by `step`"
        )
    if header.declared.get("samples", str(size)) != str(size):
        raise RecordError(f"its header announces {header.get('samples')} samples, there are {size}")
    compared = (
        *((SAMPLES,) if header.get("samples") else ()),
        *((STEP,) if times is not None else ()),
    )
    common = Series(
        np.empty(0),
        dt,
        "",
        channel=code(header.get("component")),
        station=code(header.get("station")),
        location=code(header.get("location")),
        network=code(header.get("network")),
        start=header.start,
        event=" ".join(header.get("event").split()),
        compared=compared,
    )
    # Where nothing has a name, a first column with the times or a count is no motion.
    is_leading = times is not None or (width > 1 and _counts(columns[0], layout.step))
    taken = chosen or _accelerations(header.names, range(int(is_leading), width))
    if skipped:
        warnings.warn(
            f"{how_many(skipped, 'line')} at its beginning passed over, as asked", stacklevel=2
        )
    if not stated:
        warnings.warn(
            f"the sampling interval of {dt:g} s is given, the file tells none", stacklevel=2
        )
    # Five samples to a line look alike: each column would be every fifth of them, at the wrong
    # times.
    if width > 2 and not header.names and not is_leading:
        told = f"each of {width} columns without names is taken for a motion"
        warnings.warn(
            f"{told}: one that runs on along the lines must have one sample to a line", stacklevel=2
        )
    return to_stream(
        [_series(common, columns, header, place, taken) for place in taken], headonly=headonly
    )


def _names_of(line: str) -> int:
    """How many columns a line above the numbers names."""
    return next(
        (len(column_names(value)) for key, value in declared_in(line) or [] if key == COLUMNS), 0
    )


def _accelerations(names: Names, places: range) -> list[int]:
    """Places of the accelerations among the columns; without any, of the velocities or else the
    displacements."""
    if not names:
        return list(places)
    for kind in MOTIONS:
        if chosen := [place for place, name in enumerate(names) if name.kind == kind]:
            return chosen
    unknown = [place for place, name in enumerate(names) if name.kind != TIME]
    if len(unknown) > 1:
        raise RecordError(
            "the names of the columns do not tell the acceleration; choose one by `column`: "
            f"{', '.join(names[place].text[:40] for place in unknown)}"
        )
    return unknown


def _series(
    common: Series, columns: Columns, header: TableHeader, place: int, taken: list[int]
) -> Series:
    """The component in a column."""
    names, declared = header.names, header.get("units")
    part = replace(common, samples=columns[place])
    if not names:
        units = required_units(declared) if declared else ""
        return replace(
            part,
            units=units,
            channel=part.channel if len(taken) == 1 and len(columns) <= 2 else str(place + 1),
        )
    name = names[place]
    text = name.units or declared
    # What is in the column by its name or else by its units.
    quantity = name.kind
    if name.kind == OTHER:
        motion = motion_units(name.units) if name.units else None
        quantity = parse_units(motion).quantity if motion else "acceleration"
    units = required_units(text, quantity) if text else ""
    channel = code(name.component) or (
        code(name.text[: len(name.plain)]) if name.kind == OTHER else common.channel
    )
    part = replace(
        part, units=units, channel=channel, quantity=quantity if name.kind != OTHER else ""
    )
    if name.kind != "acceleration":
        return part

    # The columns of its velocity and displacement give their peaks, where these have units.
    peaks: dict[str, float] = {}
    for other, column in zip(names, columns, strict=True):
        is_beside = other.kind in MOTIONS[1:] and other.component == name.component
        if is_beside and (scale := motion_scale(other.units, other.kind)):
            peaks.setdefault(other.kind, scale * float(np.max(np.abs(column))))
    return replace(part, pgv=peaks.get("velocity"), pgd=peaks.get("displacement"))


def _times(
    columns: Columns, names: Names, chosen: list[int], layout: TextLayout
) -> NDArray[np.float64] | None:
    """The times, s; None if there are none."""
    if names:
        return columns[0] * SECONDS[names[0].units] if names[0].kind == TIME else None
    if len(columns) == 1 or 0 in chosen:
        return None
    first = columns[0]
    if layout.step is not None and (
        not np.all(np.diff(first) > 0.0) or _counts(first, layout.step)
    ):
        return None
    return first


def _counts(column: NDArray[np.float64], step: float | None) -> bool:
    """Whether a column counts the samples, from 0 or 1, beside a given step that is not 1 s."""
    return (
        step not in (None, 1.0) and column[0] in (0.0, 1.0) and bool(np.all(np.diff(column) == 1.0))
    )


def _matches(lines: list[str]) -> bool:
    first = next(place for place, line in enumerate(lines) if ROW.fullmatch(line))
    unnamed = first > 0 and lacks_first_name(lines[first - 1])
    declared = [declared_in(line) for line in lines[: first - unnamed]]
    rows = [
        _numbers(line) for line in lines[first:] if line.strip() and not COMMENT.fullmatch(line)
    ]
    named = sum(map(_names_of, lines[:first]))
    width = Counter(map(len, rows)).most_common(1)[0][0]
    if any(map(_OTHER_FORMAT.match, lines[:first])):
        return False
    others = sum(len(row) != width for row in rows)
    # A table with the names of its columns is one with some cells empty, too, which reading it
    # tells.
    if (
        None in declared
        or len(rows) < 2
        or width > _MOST
        or others > (len(rows) // 4 if named else 0)
    ):
        return False
    return (
        unnamed
        or bool(named)
        or width == 1
        or (width > 1 and all(a[0] < b[0] for a, b in pairwise(rows)))
    )


def _columns(lines: Lines, named: int) -> Columns:
    """Columns of numbers, some of them with names, to the end of the file; comments may stand among
    them."""
    first, width = lines.number, 0
    values = array("d")
    while (line := lines.peek()) is not None:
        lines.take()
        if COMMENT.fullmatch(line):
            continue
        numbers = _numbers(line) if ROW.fullmatch(line) else []
        width = width or (named if _lacks(line) else len(numbers))
        if len(numbers) != width or not 1 <= width <= _MOST:
            lack = "; a cell is empty" if _lacks(line) else ""
            raise RecordError(
                f"line {lines.number}: {line.strip()[:60]!r} is not {width or 'a row of'} "
                f"numbers{lack}"
            )
        values.extend(numbers)
    return list(lines.checked(values, first).reshape(-1, width).T.copy())


def _lacks(line: str) -> bool:
    """Whether a row has a cell without a number, at its end, too."""
    return any(mark in line and not all(map(str.strip, line.split(mark))) for mark in ";\t,")


def _numbers(line: str) -> list[float]:
    """The numbers of a row; empty if there is something else, or nothing, between two
    separators."""
    separator = next((mark for mark in ";\t," if mark in line.strip()), None)
    cells = line.strip().removesuffix(separator or " ").split(separator)
    point = "," if separator in (";", "\t") else "."
    try:
        return [
            float(cell.replace(point, ".").replace("D", "E").replace("d", "e")) for cell in cells
        ]
    except ValueError:
        return []
