"""Components of a text table: selection of its columns, sampling interval, units and peaks."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isclose

import numpy as np

from tdint.arrays import Array, max_absolute
from tdint.errors import RecordError
from tdint.ground_motion.choice import SAME_STEP, TextLayout
from tdint.ground_motion.formats.header_statements import MAX_STEP, Statements
from tdint.ground_motion.formats.lines import (
    agrees_with_times,
    at_equal_steps,
    equal_steps,
    last_decimal,
)
from tdint.ground_motion.formats.series import (
    Series,
    code,
    largest_value,
    required_units,
    stated_peak,
)
from tdint.ground_motion.formats.table_columns import (
    MOTIONS,
    ORIGIN,
    OTHER,
    SECONDS,
    TIME,
    column_index,
    is_general,
    quantity_of_units,
)
from tdint.ground_motion.formats.table_roles import Names, Roles, other_columns
from tdint.ground_motion.miniseed_checks import SAMPLES, STEP, last_place
from tdint.ground_motion.missing import IncompleteRecord, Missing, OtherContent, likely_units
from tdint.ground_motion.origin import stated_origin
from tdint.ground_motion.record import has_one_sign


@dataclass(frozen=True)
class TableColumns:
    """Columns of a table with their meaning.

    Attributes
    ----------
    columns : list of ndarray
        All columns; rows of samples are one column.
    one_sided : bool
        The user states that samples of equal sign are a ground motion.
    """

    columns: list[Array]
    names: Names
    stated: Statements
    roles: Roles
    one_sided: bool = False

    @property
    def values(self) -> list[int]:
        """Indices of all columns except times, text and line numbers."""
        others = self.roles.ignored | {self.roles.time}
        return [index for index in range(len(self.columns)) if index not in others]

    @cached_property
    def others(self) -> dict[int, str]:
        """Reasons why values are no ground motion, by the index of the column."""
        return other_columns(self.columns, self.values, self.names, one_sided=self.one_sided)

    @property
    def candidates(self) -> list[int]:
        """Indices of the columns that may be ground motions."""
        return [index for index in self.values if index not in self.others]

    def name(self, index: int) -> str:
        """Return the name of a column for `column`: its text, or its number counted from 1."""
        return (self.names[index].text if self.names else "")[:40] or str(index + 1)


def incomplete(
    reason: str, table: TableColumns, layout: TextLayout, missing: Missing
) -> IncompleteRecord:
    """Return the error for a table that requires properties, with all properties that are missing;
    `reason` explains the properties in `missing`."""
    stated = table.stated
    lacks_step = not (stated.intervals or layout.step or table.roles.time is not None)
    has_units = len(stated.units) == 1 or any(quantity_of_units(name.units) for name in table.names)
    others = []
    if lacks_step and not missing.step:
        others.append("the sampling interval (`step`)")
    if not has_units:
        others.append("the units, if they are not specified (`units`)")
    also = f"; also required: {' and '.join(others)}" if others else ""
    peaks = [max_absolute(table.columns[index]) for index in table.candidates]
    units = "" if has_units else likely_units(max(peaks, default=0.0))
    missing = missing._replace(step=missing.step or lacks_step, units=units)
    return IncompleteRecord(f"{reason}{also}", missing)


def table_components(table: TableColumns, layout: TextLayout, reason: str) -> list[Series]:
    """Return the components of a table, and warn about assumptions.

    `reason` explains why the lines continue one ground motion; empty if the columns are separate.
    """
    if layout.is_resampled and table.roles.time is not None:
        table = _at_equal_steps(table, layout, table.roles.time)
    stated, names, columns = table.stated, table.names, table.columns
    if len(stated.units) > 1:
        warnings.warn(
            f"the header states several units, {', '.join(stated.units)}; they are not used",
            stacklevel=2,
        )
    selected = _selected(table, layout) or _accelerations(table, layout)
    if not layout.column and (others := [*map(table.name, sorted(table.others))]):
        warnings.warn(
            f"columns of other quantities or resultants are not read: {', '.join(others)}",
            stacklevel=2,
        )
    dt, is_stated = _sampling_interval(table, layout, reason)
    if not is_stated:
        warnings.warn(
            f"using the specified sampling interval of {dt:g} s; the file states none", stacklevel=2
        )
    # The continuity of the values suggests separate ground motions, but the file does not state it.
    if len(selected) > 1 and not (names or table.roles.time is not None or layout.column):
        warnings.warn(
            f"each of {len(columns)} columns without names is read as a separate ground motion; if "
            "the lines continue a single ground motion, specify `rows`",
            stacklevel=2,
        )
    compared = (
        *((SAMPLES,) if stated.counts else ()),
        *((STEP,) if table.roles.time is not None else ()),
    )
    common = Series(
        np.empty(0),
        dt,
        "",
        channel=code(stated.get("component")),
        station=code(stated.get("station")),
        location=code(stated.get("location")),
        network=code(stated.get("network")),
        start=stated.start,
        event=" ".join(stated.get("event").split()),
        compared=compared,
    )
    if stated.get(ORIGIN) and len(selected) == 1:
        common = replace(common, origin=stated_origin(stated.get(ORIGIN), columns[selected[0]]))
    series = [_series(common, table, index, is_single=len(selected) == 1) for index in selected]
    if len(series) == 1:
        series = [_with_peak(series[0], stated)]
    return series


def _selected(table: TableColumns, layout: TextLayout) -> list[int]:
    """Return the indices of the columns that the user selects, without repetition."""
    indices = [column_index(column, table.names, len(table.columns)) for column in layout.column]
    for index, column in zip(indices, layout.column, strict=True):
        if index == table.roles.time or index in table.roles.ignored:
            content = (
                "the time" if index == table.roles.time else "text or the numbers of the lines"
            )
            raise RecordError(
                f"column {column} contains {content} ({table.name(index)}); select a column with a "
                "ground motion"
            )
        if reason := table.others.get(index):
            choice = ", ".join(map(table.name, table.candidates))
            remedy = f"select one of {choice}" if choice else "specify the file of the acceleration"
            raise RecordError(f"column {table.name(index)!r} {reason}; {remedy}")
    return list(dict.fromkeys(indices))


def _accelerations(table: TableColumns, layout: TextLayout) -> list[int]:
    """Return the indices of the columns that are read as ground motion.

    Without names, these are all columns except the times. Otherwise, they are the columns named as
    acceleration; if there are no such columns, the velocity columns, otherwise the displacement
    columns. If no name states a quantity, the only column that is not the time is returned if its
    name is general (`Y`, `value`).

    Raises
    ------
    IncompleteRecord
        The names do not identify the ground motion.
    """
    names, candidates = table.names, table.candidates
    if not names:
        return candidates
    for quantity in MOTIONS:
        if named := [index for index in candidates if names[index].quantity == quantity]:
            # A column with values of both signs next to components may be another component.
            unknown = [i for i in candidates if names[i].quantity == OTHER and not names[i].units]
            if any(names[i].component for i in named) and not all(
                has_one_sign(table.columns[i]) for i in unknown
            ):
                break
            return named
    if len(candidates) == 1 and is_general(names[candidates[0]]):
        return candidates
    # A column with a unit that is no unit of a ground motion is not proposed.
    candidates = [i for i in candidates if not names[i].units or quantity_of_units(names[i].units)]
    if not candidates:
        listed = ", ".join(name.text[:40] for name in names if name.quantity != TIME)
        raise OtherContent(
            f"the columns ({listed}) state quantities that are not a ground motion; specify the "
            "file of the acceleration",
            "other quantities",
        )
    listed = ", ".join(map(table.name, candidates))
    raise incomplete(
        f"the column names do not identify the acceleration; select the ground motion by `column`: "
        f"{listed}",
        table,
        layout,
        Missing(columns=tuple(map(table.name, candidates))),
    )


def _sampling_interval(table: TableColumns, layout: TextLayout, reason: str) -> tuple[float, bool]:
    """Return the sampling interval of a table, s, and True if the file states it, False if only the
    layout of the user specifies it.

    RecordError is raised if the header and the times state different intervals, the times are not
    in equal steps, or the interval is unknown.
    """
    intervals = list(table.stated.intervals)
    if table.roles.time is not None:
        times = _times(table, layout, table.roles.time)
        mean, rounding = equal_steps(times)[0], last_decimal(times)
        # Rounded times may agree with several intervals; the stated one is right.
        stated = (step for step in (*intervals, layout.step) if step is not None)
        agreeing = (step for step in stated if agrees_with_times(step, times, rounding))
        intervals.append(next(agreeing, mean))
    if intervals and max(intervals) - min(intervals) > SAME_STEP * max(intervals):
        values = " s and ".join(f"{dt:g}" for dt in intervals)
        raise RecordError(
            f"the file states several sampling intervals, {values} s; correct the header or the "
            "times"
        )
    dt = next(iter(intervals), None) or layout.step
    if dt is not None:
        return dt, bool(intervals)
    message = (
        "the sampling interval of the column of numbers is required; declare it in a first line "
        "`# dt = 0.01 s, units = g`, or specify it by `step`"
    )
    if table.roles.ignored:
        message = (
            "the first column numbers the lines; specify the sampling interval by `step` (1 if the "
            "numbers are times in s)"
        )
    if reason:
        message = (
            f"each line continues one ground motion ({reason}), but the file does not state the "
            "sampling interval; specify it by `step`"
        )
    raise incomplete(message, table, layout, Missing(step=True))


_CLOCKS = {unit: SECONDS[unit] for unit in ("s", "ms", "us", "ns")}
_EPOCH = (1e9, 4e9)  # s since 1970: the years 2001 to 2096


def _times(table: TableColumns, layout: TextLayout, index: int) -> Array:
    """Return the times of a table, s. Their unit is stated, or it follows from the first time (a
    time since 1970) or from the step of the user.

    Raises
    ------
    RecordError
        The unit is unknown, or is not stated and the times cannot be in seconds.
    """
    times, units = table.columns[index], table.names[index].units if table.names else ""
    step, first = float(np.median(np.diff(times))), float(times[0])
    stated = (*table.stated.intervals, layout.step or 0.0)
    if units not in SECONDS:
        raise RecordError(f"the times must be in s, ms, us or ns, but the header states {units!r}")
    for unit, scale in _CLOCKS.items():
        if _EPOCH[0] <= scale * first < _EPOCH[1] and scale * step <= MAX_STEP:
            warnings.warn(f"the times are read in {unit} since 1970", stacklevel=2)
            return np.round(scale * (times - first), 6)
    if units or step <= MAX_STEP or layout.has_step(step):
        return times * SECONDS[units]
    for unit, scale in _CLOCKS.items():
        if any(isclose(scale * step, dt, rel_tol=SAME_STEP) for dt in stated):
            note = f"the times are read in {unit}: their steps are {step:g} {unit}, as specified"
            warnings.warn(note, stacklevel=2)
            return times * scale
    if table.stated.intervals:
        return times
    unit = next((unit for unit, scale in _CLOCKS.items() if scale * step <= MAX_STEP), "ns")
    raise incomplete(
        f"the times increase by {step:g} per line, too much for steps in s; if they "
        f"are in {unit}, specify `step={SECONDS[unit] * step:g}`, or name the column `Time "
        f"({unit})`",
        table,
        layout,
        Missing(),
    )


def _at_equal_steps(table: TableColumns, layout: TextLayout, time: int) -> TableColumns:
    """Return a table with all columns interpolated at equal steps, without times."""
    count = np.arange(len(table.columns[time]), dtype=float)
    rows, dt = at_equal_steps(_times(table, layout, time), count, inf)
    return replace(
        table,
        columns=[np.interp(rows, count, column) for column in table.columns],
        stated=replace(table.stated, intervals=(dt,)),
        roles=Roles(ignored=table.roles.ignored | {time}),
    )


def _series(common: Series, table: TableColumns, index: int, *, is_single: bool) -> Series:
    """Return the component in a column, with its units, channel and quantity."""
    names, stated = table.names, table.stated
    declared = stated.units[0] if len(stated.units) == 1 else ""
    # A copy of one of several columns, so that the numbers of the others need not be kept
    component = replace(common, samples=np.ascontiguousarray(table.columns[index]))
    if not names:
        # The only component of a table has the declared channel. Otherwise the channel is the
        # number of the column, counted from 1 with the time column, as the user selects it by
        # `column`.
        is_only = is_single and len(table.candidates) == 1
        quantity = stated.quantity if stated.quantity != "acceleration" else ""
        return replace(
            component,
            units=required_units(declared, quantity) if declared else "",
            channel=component.channel if is_only else str(index + 1),
            quantity=quantity,
        )
    name = names[index]
    text = name.units or declared
    # The quantity follows from the name of the column. If the name does not state it, the units
    # determine it. The series then has the quantity "" (not stated by the file), so that the user
    # may specify units of another quantity.
    is_unnamed = name.quantity == OTHER or (bool(name.component) and not name.units)
    units = required_units(text, "" if is_unnamed else name.quantity) if text else ""
    # A column of unknown quantity is named by its text in the file without units, which follow the
    # name and are cut off here.
    channel = code(name.component) or (
        code(name.text[: len(name.plain)]) if name.quantity == OTHER else common.channel
    )
    component = replace(
        component,
        units=units,
        channel=channel,
        quantity=name.quantity if name.quantity != OTHER and not (is_unnamed and units) else "",
    )
    if name.quantity != "acceleration":
        return component

    peaks: dict[str, float | None] = {}
    for other_name, column in zip(names, table.columns, strict=True):
        quantity = other_name.quantity
        if other_name.component == name.component and peaks.get(quantity) is None:
            peaks[quantity] = largest_value(column, other_name.units, quantity)
    return replace(component, pgv=peaks.get("velocity"), pgd=peaks.get("displacement"))


def _with_peak(series: Series, stated: Statements) -> Series:
    """Return a component with the peak in the header, and with the units of the peak if the file
    states no other units and the largest sample is equal to the peak."""
    number, peak_units = stated.peak
    if not number or series.quantity not in ("", "acceleration"):
        return series
    rounding = last_decimal(series.samples)
    units = series.units
    if not units and peak_units:
        largest = max_absolute(series.samples)
        tolerance = 1.01 * (last_place(number) + rounding) + 1e-6 * largest
        if abs(abs(float(number)) - largest) > tolerance:
            return series
        units = peak_units
    peak = stated_peak(number, peak_units or units or "", units or "")
    if peak is not None:
        # Programs compute the peak before the samples are rounded.
        peak = replace(peak, rounding=peak.rounding + rounding * peak.factor)
    return replace(series, units=units, peak=peak)
