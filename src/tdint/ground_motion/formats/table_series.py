"""Components of a text table: selection of its columns, sampling interval, units and peaks."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.choice import SAME_STEP, TextLayout
from tdint.ground_motion.formats.header_statements import Statements
from tdint.ground_motion.formats.lines import agrees_with_times, equal_steps, last_decimal
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
    ColumnName,
    column_index,
    is_general,
    quantity_of_units,
)
from tdint.ground_motion.miniseed_checks import SAMPLES, STEP, last_place
from tdint.ground_motion.missing import IncompleteRecord, Missing, likely_units
from tdint.ground_motion.origin import stated_origin

Names = tuple[ColumnName, ...]


@dataclass(frozen=True)
class TableColumns:
    """Columns of a table with their meaning.

    Attributes
    ----------
    columns : list of ndarray
        All columns; rows of samples are one column.
    time : int or None
        Index of the column of times.
    ignored : frozenset of int
        Indices of columns that contain text or line numbers.
    """

    columns: list[NDArray[np.float64]]
    names: Names
    stated: Statements
    time: int | None
    ignored: frozenset[int]

    @property
    def candidates(self) -> list[int]:
        """Indices of the columns that may be ground motions."""
        others = self.ignored | ({self.time} if self.time is not None else set())
        return [index for index in range(len(self.columns)) if index not in others]

    def name(self, index: int) -> str:
        """Return the name of a column for `column`: its text, or its number counted from 1."""
        text = self.names[index].text if self.names else ""
        return text[:40] or str(index + 1)


def incomplete(
    reason: str, table: TableColumns, layout: TextLayout, missing: Missing
) -> IncompleteRecord:
    """Return the error for a table that requires properties, with all properties that are missing;
    `reason` explains those in `missing`."""
    stated = table.stated
    lacks_step = not (stated.intervals or layout.step or table.time is not None)
    has_units = len(stated.units) == 1 or any(quantity_of_units(name.units) for name in table.names)
    others = []
    if lacks_step and not missing.step:
        others.append("the sampling interval (`step`)")
    if not has_units:
        others.append("the units, if they are not specified (`units`)")
    also = f"; also required: {' and '.join(others)}" if others else ""
    peaks = [float(np.max(np.abs(table.columns[index]))) for index in table.candidates]
    units = "" if has_units else likely_units(max(peaks, default=0.0))
    missing = missing._replace(step=missing.step or lacks_step, units=units)
    return IncompleteRecord(f"{reason}{also}", missing)


def table_components(table: TableColumns, layout: TextLayout, reason: str) -> list[Series]:
    """Return the components of a table, and warn about assumptions.

    `reason` explains why the lines continue one ground motion; empty if the columns are separate.
    """
    stated, names, columns = table.stated, table.names, table.columns
    if len(stated.units) > 1:
        warnings.warn(
            f"the header states several units, {', '.join(stated.units)}; they are not used",
            stacklevel=2,
        )
    selected = _selected(table, layout) or _accelerations(table, layout)
    dt, is_stated = _sampling_interval(table, layout, reason)
    if not is_stated:
        warnings.warn(
            f"using the specified sampling interval of {dt:g} s; the file states none", stacklevel=2
        )
    # The continuity of the values suggests separate ground motions, but the file does not state it.
    if len(selected) > 1 and not (names or table.time is not None or layout.column):
        warnings.warn(
            f"each of {len(columns)} columns without names is read as a separate ground motion; if "
            "the lines continue a single ground motion, specify `rows`",
            stacklevel=2,
        )
    compared = (
        *((SAMPLES,) if stated.counts else ()),
        *((STEP,) if table.time is not None else ()),
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
        origin = stated_origin(stated.get(ORIGIN), columns[selected[0]])
        common = replace(common, origin=origin)
    series = [_series(common, table, index, is_single=len(selected) == 1) for index in selected]
    if len(series) == 1:
        series = [_with_peak(series[0], stated)]
    return series


def _selected(table: TableColumns, layout: TextLayout) -> list[int]:
    """Return the indices of the columns that the user selects, without repetition."""
    indices = [column_index(column, table.names, len(table.columns)) for column in layout.column]
    for index, column in zip(indices, layout.column, strict=True):
        if index == table.time or index in table.ignored:
            content = "the time" if index == table.time else "text or the numbers of the lines"
            raise RecordError(
                f"column {column} contains {content} ({table.name(index)}); select a column with a "
                "ground motion"
            )
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
            return named
    if len(candidates) == 1 and is_general(names[candidates[0]]):
        return candidates
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
    if table.time is not None:
        name = table.names[table.time] if table.names else None
        if name is not None and name.units not in SECONDS:
            raise RecordError(f"the times must be in s or ms, but the header states {name.units!r}")
        scale = SECONDS[name.units] if name is not None else 1.0
        times = table.columns[table.time] * scale
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
    if table.ignored:
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


def _series(common: Series, table: TableColumns, index: int, *, is_single: bool) -> Series:
    """Return the component in a column, with its units, channel and quantity."""
    names, stated = table.names, table.stated
    declared = stated.units[0] if len(stated.units) == 1 else ""
    component = replace(common, samples=table.columns[index])
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
        largest = float(np.max(np.abs(series.samples)))
        tolerance = 1.01 * (last_place(number) + rounding) + 1e-6 * largest
        if abs(abs(float(number)) - largest) > tolerance:
            return series
        units = peak_units
    peak = stated_peak(number, peak_units or units or "", units or "")
    if peak is not None:
        # Programs compute the peak before the samples are rounded.
        peak = replace(peak, rounding=peak.rounding + rounding * peak.factor)
    return replace(series, units=units, peak=peak)
