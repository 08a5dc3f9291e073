"""Plain text tables: a column of accelerations, or a time and one or more columns, described by a
header.

The header consists of comments (after #, %, ;, ! or //), declarations `key = value` or `key:
value`, with or without a comment mark (`# dt = 0.01 s, units = g`), and names of columns
(`time_s,acceleration_m_s2`, `Time (s); Acceleration (g)`). Columns are separated by commas,
semicolons, tabs or blanks. If the separator is a semicolon or a tab, a comma is a decimal point.

A table with one column must declare its sampling interval. If a table has several columns, the
first must be a time in equal steps, unless the column names include no time. Columns without names
are components named by their number (the column after the time is 2). Velocity and displacement
columns next to an acceleration supply its peaks; without an acceleration column they are
differentiated. Units are not guessed: if the file does not declare them, the user must specify
them. The user may also specify the time step, the columns and the number of header lines
(`TextLayout`); column names may then be arbitrary text.
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
    ORIGIN,
    OTHER,
    SECONDS,
    TIME,
    ColumnName,
    TableHeader,
    any_names,
    column_index,
    column_names,
    declared_in,
    lacks_first_name,
    read_foreign_header,
    read_header,
)
from tdint.ground_motion.formats.table_evidence import (
    FirstNumbers,
    check_first_value,
    counts_rows,
    first_numbers,
    paired,
    unexplained_first_line,
)
from tdint.ground_motion.miniseed_checks import SAMPLES, STEP
from tdint.ground_motion.origin import stated_origin
from tdint.number_parsing import pluralize
from tdint.units import parse_units

if TYPE_CHECKING:
    from obspy import Stream

Columns = list[NDArray[np.float64]]
Names = tuple[ColumnName, ...]

_OTHER_FORMAT = re.compile(r"#\s*DataSequence\s*:", re.IGNORECASE)
"""Pattern of a comment that identifies another format (CWB)."""

_FIRST_LINES = 50  # lines that are compared with the form of the first line
_MAX_COLUMNS = 50
"""Maximum number of columns of a table."""


def is_text(file: Any, layout: TextLayout = AS_STATED, **_: Any) -> bool:
    """Return True if a file contains a text table.

    Without a layout, an optional header (comments, declarations `key = value`, column names) must
    be followed by rows of a single number, or by rows of several numbers with an increasing first
    number. With a layout, a table of numbers must follow the lines to skip.
    """
    return _is_table(_first_rows(file, layout)[1]) if layout else recognizes(file, _matches)


def _first_rows(file: Any, layout: TextLayout) -> tuple[list[str], list[int]]:
    """Read the start of a table with a user-specified layout. Return the lines between the lines to
    skip and the first row of numbers, and the number of values in each of the first two rows (fewer
    if the file ends or a row contains other text).
    """
    header_lines: list[str] = []
    widths: list[int] = []
    with suppress(RecordError):  # end of the file
        lines = read_lines(file, text_only=True)
        lines.skip(layout.skip_lines or 0)
        header_lines = lines.take_until(ROW.fullmatch, "row of numbers")
        while len(widths) < 2 and (width := len(_numbers(lines.take()))):
            widths.append(width)
    return header_lines, widths


def _is_table(widths: list[int]) -> bool:
    """Return True if `widths`, the numbers of values in the first rows, are two equal numbers of at
    most `_MAX_COLUMNS`."""
    return len(widths) == 2 and widths[0] == widths[1] <= _MAX_COLUMNS


def table_in(data: bytes, layout: TextLayout) -> str:
    """Describe the table in a file of unknown format and the options that are required to read it.

    Returns
    -------
    str
        Part of an error message; empty if the file contains no table.
    """
    header_lines, widths = _first_rows(BytesIO(data), layout)
    if len(widths) == 1:
        return (
            "the file has only one row of numbers; a record needs at least two samples: check "
            "that the file is complete"
        )
    if not _is_table(widths):
        # If the file is a table without its quotation marks, the marks are the only error.
        is_quoted = b'"' in data and _is_table(
            _first_rows(BytesIO(data.replace(b'"', b"")), layout)[1]
        )
        return "its numbers are in quotation marks; remove the quotation marks" if is_quoted else ""
    names = any_names(header_lines[-1], widths[0]) if header_lines else ()
    if len(names) > 2 and names[0].quantity == TIME:
        return (
            "select the ground motion by `column`: "
            f"{', '.join(name.text[:40] for name in names[1:])}"
        )
    skip_advice = ""
    if header_lines:
        skip_advice = f" and skip the lines above by `skip_lines={len(header_lines)}`"
    return (
        f"a table of numbers starts in line {len(header_lines) + 1}: specify it by `step` and "
        f"`column`{skip_advice}"
    )


def read_text(
    file: Any, headonly: bool = False, layout: TextLayout = AS_STATED, **_: Any
) -> Stream:
    """Read a text table, and return its components as an ObsPy stream.

    Raises
    ------
    RecordError
        The sampling interval is not declared, times are not in equal steps, declarations contradict
        each other or the values, or a row contains text other than numbers.
    """
    lines = read_lines(file)
    skipped = layout.skip_lines or 0
    lines.skip(skipped)
    header_lines = lines.take_until(ROW.fullmatch, "row of numbers")

    _check_first_name(header_lines, skipped)
    first_lines = lines.preview(_FIRST_LINES)
    columns = _columns(lines, sum(map(_count_names, header_lines)))
    first = FirstNumbers()
    if len(columns) == 1:
        first = _numbers_above_samples(columns[0], first_lines, len(header_lines), layout)
        columns = [columns[0][first.lines :]]
    width = len(columns)
    if layout:
        header = read_foreign_header(header_lines, width, skipped)
    else:
        header = read_header(header_lines, width)
    if width == 1 and not first.lines and not header.intervals():
        check_first_value(first_lines, skipped + len(header_lines) + 1, layout)
    header = _with_first_numbers(header, first)
    if layout.rows and width > 1:
        raise RecordError(
            "`rows` contradicts the names or the times of the columns of the table; remove it"
        )
    times = _times(columns, header.names, _selected(layout, header.names, width), layout)
    if skipped:
        warnings.warn(
            f"{pluralize(skipped, 'line')} ignored at the beginning, as requested", stacklevel=2
        )
    return to_stream(table_series(columns, header, layout, times), headonly=headonly)


def table_series(
    columns: Columns, header: TableHeader, layout: TextLayout, times: NDArray[np.float64] | None
) -> list[Series]:
    """Return the components in the columns of a table.

    Parameters
    ----------
    columns : list of ndarray
        All columns of the table, including the times.
    times : ndarray, shape (samples,), or None
        Times in the first column, s; None if the table has no column of times.

    Raises
    ------
    RecordError
        As by `read_text`, except for text in a row.
    """
    width, size = len(columns), columns[0].size
    selected = _selected(layout, header.names, width)
    dt, is_stated = _sampling_interval(header, times, layout)
    if header.declared.get("samples", str(size)) != str(size):
        raise RecordError(
            f"the header of the table states {header.get('samples')} samples, but the file has "
            f"{size}"
        )
    compared = (
        *((SAMPLES,) if header.get("samples") else ()),
        *((STEP,) if times is not None else ()),
    )
    # All components of the table have these attributes; samples and units are added later.
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
    # A first column without a name that contains times or a sample count is not a ground motion.
    has_times = times is not None or (width > 1 and _counts_samples(columns[0], layout.step))
    component_columns = selected or _accelerations(header.names, range(int(has_times), width))
    if not is_stated:
        warnings.warn(
            f"using the specified sampling interval of {dt:g} s; the file states none", stacklevel=2
        )
    # The continuity of the values suggests separate ground motions, but the file does not state it.
    if width > 2 and not (header.names or has_times or selected):
        assumption = f"each of {width} columns without names is read as a separate ground motion"
        warnings.warn(
            f"{assumption}; if the lines continue a single ground motion, specify `rows`",
            stacklevel=2,
        )
    if header.get(ORIGIN) and len(component_columns) == 1:
        origin = stated_origin(header.get(ORIGIN), columns[component_columns[0]])
        common = replace(common, origin=origin)
    return [
        _series(common, columns, header, index, component_columns) for index in component_columns
    ]


def _selected(layout: TextLayout, names: Names, width: int) -> list[int]:
    """Return the indices of the columns that the user selects, without repetition."""
    indices = (column_index(column, names, width) for column in layout.column)
    return list(dict.fromkeys(indices))


def _numbers_above_samples(
    values: NDArray[np.float64], first_lines: list[str], above: int, layout: TextLayout
) -> FirstNumbers:
    """Return the number of samples and the interval in the first lines of a column; `above` is the
    number of header lines.

    Raises RecordError if a first line contains a number of samples other than that of the column.
    """
    first = first_numbers(values, np.ones(values.size, dtype=np.int64))
    if not first.lines and (line := unexplained_first_line(first_lines)):
        number = (layout.skip_lines or 0) + above + 1
        raise RecordError(
            f"line {number}: {line[:60]!r} is not a sample, and the numbers in the first lines do "
            f"not state the number of the {pluralize(values.size - 1, 'value')} below it; correct "
            f"it, or skip it by `skip_lines={number}`"
        )
    return first


def _with_first_numbers(header: TableHeader, first: FirstNumbers) -> TableHeader:
    """Return a header with the number of samples and the interval in the first lines of a column;
    raise RecordError if they contradict its declarations."""
    declared = dict(header.declared)
    if first.count:
        declared.setdefault("samples", str(first.count))
    if first.interval:
        stated = header.intervals()
        if stated and abs(stated[0] - first.interval) > SAME_STEP * first.interval:
            raise RecordError(
                f"the file states several sampling intervals, {stated[0]:g} s and "
                f"{first.interval:g} s; correct the header or the first lines"
            )
        declared.setdefault("dt", f"{first.interval!r} s")
    return replace(header, declared=declared)


def _check_first_name(header_lines: list[str], skipped: int) -> None:
    """Raise RecordError if the last header line names all columns except the first: the other names
    would be shifted by one column. `skipped` is the number of lines before the header lines, for
    the line number in the message.
    """
    filled = [index for index, line in enumerate(header_lines) if line.strip()]
    if filled and lacks_first_name(header_lines[filled[-1]]):
        raise RecordError(
            f"line {skipped + filled[-1] + 1}: {header_lines[filled[-1]].strip()[:60]!r} has no "
            "name for the first column, as if pandas wrote its index; omit the index "
            "(index=False), or name the column time if it contains times"
        )


def _sampling_interval(
    header: TableHeader, times: NDArray[np.float64] | None, layout: TextLayout
) -> tuple[float, bool]:
    """Return the sampling interval of a text table, s, and True if the file states it, False if
    only the layout of the user specifies it.

    RecordError is raised if the declarations of the header and the times state different intervals,
    the times are not in equal steps, or the interval is unknown.
    """
    intervals = header.intervals()
    if times is not None:
        intervals.append(equal_steps(times)[0])
    if intervals and max(intervals) - min(intervals) > SAME_STEP * max(intervals):
        values = " s and ".join(f"{dt:g}" for dt in intervals)
        raise RecordError(
            f"the file states several sampling intervals, {values} s; correct the header or the "
            "times"
        )
    dt = next(iter(intervals), None) or layout.step
    if dt is None:
        raise RecordError(
            "the sampling interval of the column of numbers is required; declare it in a first "
            "line `# dt = 0.01 s, units = g`, or specify it by `step`"
        )
    return dt, bool(intervals)


def _count_names(line: str) -> int:
    """Return the number of column names in a header line; 0 if it does not name columns."""
    return next(
        (len(column_names(value)) for key, value in declared_in(line) or [] if key == COLUMNS), 0
    )


def _accelerations(names: Names, columns: range) -> list[int]:
    """Return the indices of the columns that are read as ground motion.

    Without names (no header), these are `columns`. Otherwise, they are the columns named as
    acceleration; if there are no such columns, the velocity columns, or else the displacement
    columns. If no name states a quantity, the only column that is not the time is returned; without
    such a column the list is empty. Several such columns are a RecordError.
    """
    if not names:
        return list(columns)
    for quantity in MOTIONS:
        if selected := [index for index, name in enumerate(names) if name.quantity == quantity]:
            return selected
    others = [index for index, name in enumerate(names) if name.quantity != TIME]
    if len(others) > 1:
        raise RecordError(
            "the column names do not identify the acceleration; select a column by `column`: "
            f"{', '.join(names[index].text[:40] for index in others)}"
        )
    return others


def _series(
    common: Series, columns: Columns, header: TableHeader, index: int, component_columns: list[int]
) -> Series:
    """Return the component in a column, with its units, channel and quantity.

    `header` contains the declarations and column names. `index` is the index of the column.
    `component_columns` contains the indices of all columns that are read as components.
    """
    names, declared = header.names, header.get("units")
    component = replace(common, samples=columns[index])
    if not names:
        # The only component of a table with at most a time column in addition has the declared
        # channel. Otherwise the channel is the number of the column, counted from 1 with the time
        # column, as the user selects it by `column`.
        is_single = len(component_columns) == 1 and len(columns) <= 2
        return replace(
            component,
            units=required_units(declared) if declared else "",
            channel=component.channel if is_single else str(index + 1),
        )
    name = names[index]
    text = name.units or declared
    # The quantity follows from the name of the column. If the name does not state it, the units in
    # the name determine the quantity for the check of the units. The series then has the quantity
    # "" (not stated by the file), so that the user may specify units of another quantity.
    quantity = name.quantity
    if name.quantity == OTHER:
        motion = motion_units(name.units) if name.units else None
        quantity = parse_units(motion).quantity if motion else "acceleration"
    units = required_units(text, quantity) if text else ""
    # A column of unknown quantity is named by its text in the file without units, which follow the
    # name and are cut off here.
    channel = code(name.component) or (
        code(name.text[: len(name.plain)]) if name.quantity == OTHER else common.channel
    )
    component = replace(
        component, units=units, channel=channel, quantity=quantity if name.quantity != OTHER else ""
    )
    if name.quantity != "acceleration":
        return component

    peaks: dict[str, float] = {}
    for other_name, column in zip(names, columns, strict=True):
        is_same_component = (
            other_name.quantity in MOTIONS[1:] and other_name.component == name.component
        )
        if is_same_component and (scale := motion_scale(other_name.units, other_name.quantity)):
            peaks.setdefault(other_name.quantity, scale * float(np.max(np.abs(column))))
    return replace(component, pgv=peaks.get("velocity"), pgd=peaks.get("displacement"))


def _times(
    columns: Columns, names: Names, selected: list[int], layout: TextLayout
) -> NDArray[np.float64] | None:
    """Return the times, s; None if the table has no column of times.

    With a header, the first column contains times if it has the name of a time. Without a header
    (no names), the first of several columns contains times unless the user selects it as data, or
    specifies a sampling interval and the column does not increase or only numbers the samples.
    RecordError is raised if the first column numbers the lines, and the user does not specify the
    sampling interval.
    """
    if names:
        return columns[0] * SECONDS[names[0].units] if names[0].quantity == TIME else None
    if len(columns) == 1 or 0 in selected:
        return None
    first = columns[0]
    if layout.step is None and counts_rows(first):
        raise RecordError(
            "the first column numbers the lines; specify the sampling interval by `step` (1 if the "
            "numbers are times in s)"
        )
    if layout.step is not None and (
        not np.all(np.diff(first) > 0.0) or _counts_samples(first, layout.step)
    ):
        return None
    return first


def _counts_samples(column: NDArray[np.float64], step: float | None) -> bool:
    """Return True if a column counts the samples from 0 or 1 and the specified step is not 1 s."""
    return (
        step not in (None, 1.0) and column[0] in (0.0, 1.0) and bool(np.all(np.diff(column) == 1.0))
    )


def _matches(lines: list[str]) -> bool:
    """Return True if the first lines of a file are those of a text table.

    Without a row of numbers, StopIteration is raised, which `recognizes` treats as False.
    """
    first_row = next(index for index, line in enumerate(lines) if ROW.fullmatch(line))
    # A line of names that lacks the first name is no declaration. It is omitted here, so that the
    # reader can report it.
    lacks_name = first_row > 0 and lacks_first_name(lines[first_row - 1])
    declared = [declared_in(line) for line in lines[: first_row - lacks_name]]
    rows = [
        _numbers(line) for line in lines[first_row:] if line.strip() and not COMMENT.fullmatch(line)
    ]
    name_count = sum(map(_count_names, lines[:first_row]))
    width = Counter(map(len, rows)).most_common(1)[0][0]
    if any(map(_OTHER_FORMAT.match, lines[:first_row])):
        return False
    deviating_rows = sum(len(row) != width for row in rows)
    # A table with column names is recognized even if cells are empty in up to a quarter of its
    # rows. The error message of the reader then names the line.
    if (
        None in declared
        or len(rows) < 2
        or width > _MAX_COLUMNS
        or deviating_rows > (len(rows) // 4 if name_count else 0)
    ):
        return False
    # Lines of several samples may be numbered, and lines of several pairs may end with a shorter
    # line; the layout of such a table requires all its lines.
    regular = np.array([row for row in rows if len(row) == width])
    is_numbered = width > 3 and counts_rows(regular[:, 0])
    if not name_count and (is_numbered or paired(regular) is not None):
        return False
    # Without column names, several columns are recognized only if the first increases like times.
    return (
        lacks_name
        or bool(name_count)
        or width == 1
        or (width > 1 and all(a[0] < b[0] for a, b in pairwise(rows)))
    )


def _columns(lines: Lines, name_count: int) -> Columns:
    """Read the columns of numbers to the end of the file; comment lines are skipped.

    RecordError is raised if a row has another number of values, other text or an empty cell, or the
    table has too many columns.
    """
    first_line, width = lines.number, 0
    values = array("d")
    while (line := lines.peek()) is not None:
        lines.take()
        if COMMENT.fullmatch(line):
            continue
        numbers = _numbers(line) if ROW.fullmatch(line) else []
        # The first row determines the number of columns. If it has an empty cell, the header does.
        width = width or (name_count if _has_empty_cell(line) else len(numbers))
        if len(numbers) != width or not 1 <= width <= _MAX_COLUMNS:
            reason = "; a cell is empty" if _has_empty_cell(line) else ""
            raise RecordError(
                f"line {lines.number} must contain {width or 'a row of'} numbers, got "
                f"{line.strip()[:60]!r}{reason}"
            )
        values.extend(numbers)
    return list(lines.checked(values, first_line).reshape(-1, width).T.copy())


def _has_empty_cell(line: str) -> bool:
    """Return True if a row has an empty cell, including an empty last cell."""
    return any(mark in line and not all(map(str.strip, line.split(mark))) for mark in ";\t,")


def _numbers(line: str) -> list[float]:
    """Return the numbers of a row; empty if a cell is empty or contains other text.

    This function only counts the cells of the first rows to recognize a table. It accepts nan and
    1_000, which are refused when the rows are read.
    """
    separator = next((mark for mark in ";\t," if mark in line.strip()), None)
    # A separator at the end of a row does not start another cell.
    cells = line.strip().removesuffix(separator or " ").split(separator)
    point = "," if separator in (";", "\t") else "."
    # D is the exponent of double precision in Fortran.
    try:
        return [
            float(cell.replace(point, ".").replace("D", "E").replace("d", "e")) for cell in cells
        ]
    except ValueError:
        return []
