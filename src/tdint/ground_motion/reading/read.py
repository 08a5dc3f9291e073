"""Read ground-motion records in the formats that ObsPy and tdint know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from logging import getLogger
from math import isclose, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.choice import AS_STATED, RecordChoice, TextLayout
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.miniseed_checks import LONGEST_STEP
from tdint.ground_motion.reading.contents import Contents, digested, read_bytes, read_parts
from tdint.ground_motion.reading.sample_units import FileUnits, SampleUnits, file_units
from tdint.ground_motion.reading.scale import (
    Motion,
    are_counts,
    declared_units,
    to_acceleration,
    to_motion,
)
from tdint.ground_motion.record import (
    IN_SI,
    UNITS_BY_LOCATION,
    Input,
    Record,
    doubt_of_peak,
    masked_samples,
    station_of,
)
from tdint.ground_motion.signal import Signal
from tdint.units import parse_units
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from tdint.ground_motion.horizontals import Horizontals
    from tdint.ground_motion.reading.instrument import Instruments


# ---- Join the traces of one channel and check its samples

_IMPOSSIBLE = 1e6
"""m/s^2; from here on the units are wrong, whatever they are: squares and integrals would leave
what floats hold."""

_OFFSET = 0.02  # of the peak: a mean beyond it is an offset, not the noise of a short record


@dataclass(frozen=True)
class _Channel:
    """The traces of a file, or of a file in an archive, that share one id, in file order."""

    source: str
    contents: Contents
    id: str
    traces: tuple[Any, ...]

    @property
    def code(self) -> str:
        """The channel code, which is the name of the component."""
        return str(self.traces[0].stats.channel)

    @property
    def label(self) -> str:
        """File and channel, for messages."""
        return f"{self.source}: {self.id}" if self.id.strip(".") else self.source


def _channels_of(source: str, contents: Contents) -> list[_Channel]:
    """Gather the traces of each channel, in the order in which the channels appear in the file."""
    groups: dict[str, list[Any]] = {}
    for trace in contents.traces:
        groups.setdefault(trace.id, []).append(trace)
    return [_Channel(source, contents, name, tuple(members)) for name, members in groups.items()]


def _joined(channel: _Channel) -> Any:
    """Join a channel's traces, which a file may hold in pieces, to one without gaps.

    Returns
    -------
    obspy.Trace
        At least two finite samples at a positive sampling interval; the type of the numbers is the
        file's.

    Raises
    ------
    RecordError
        A gap, an overlap, a change of the sampling interval, or samples that are missing or not
        finite.
    """
    label = channel.label
    pieces = sorted(
        (t for t in channel.traces if len(t.data)), key=lambda trace: trace.stats.starttime
    )
    if not pieces:
        raise RecordError(f"{label}: the channel has no samples")
    for piece in pieces:
        # Each by itself: a clock that runs, on days that there are, and no sample that the reader
        # has masked.
        dt = float(piece.stats.delta)
        if not (isfinite(dt) and dt > 0.0):
            raise RecordError(f"{label}: the sampling interval is {dt:g} s; it must be positive")
        try:
            str(piece.stats.starttime), str(piece.stats.endtime)
        except (
            Exception
        ):  # Python's and ObsPy's calendars raise different kinds beyond their last year.
            raise RecordError(
                f"{label}: the time of the record is beyond the calendar; its header is damaged"
            ) from None
        if missing := masked_samples(piece.data):
            said = how_many(missing, "sample")
            raise RecordError(
                f"{label}: {said} marked as missing; cut the record to its unbroken part"
            )
    for before, after in pairwise(pieces):
        # One record: one sampling interval, one type, and the next sample one interval behind the
        # last, to half of it.
        dt, there = float(before.stats.delta), after.stats.starttime
        if not isclose(dt, after.stats.delta, rel_tol=1e-6):
            changed = f"changes from {dt:g} s to {after.stats.delta:g} s at {there}"
            raise RecordError(f"{label}: the sampling interval {changed}; cut the record there")
        if (before.data.dtype.kind == "f") != (after.data.dtype.kind == "f"):
            raise RecordError(
                f"{label}: the samples before {there} and after are of different types"
            )
        slip = float(there - before.stats.endtime) - dt
        if abs(slip) > 0.5 * dt:
            break_ = f"a gap of {slip:.6g} s" if slip > 0.0 else f"an overlap of {-slip:.6g} s"
            raise RecordError(
                f"{label}: {break_} after {before.stats.endtime}; cut the record to its unbroken "
                "part"
            )
    whole = pieces[0]
    if len(pieces) > 1:
        whole = whole.copy()
        whole.data = np.concatenate([piece.data for piece in pieces])
    if len(whole.data) < 2:
        raise RecordError(f"{label}: one sample only; a record needs two at least")
    check_finite(whole.data, float(whole.stats.delta), label)
    return whole


def doubts(acceleration: NDArray[np.float64]) -> tuple[str, ...]:
    """Notes about an acceleration (m/s^2, shape (samples,)) that can hardly be a ground motion as
    it stands."""
    peak, mean = float(np.max(np.abs(acceleration))), float(np.mean(acceleration))
    notes = []
    if peak == 0.0:
        notes.append("all samples are zero")
    elif abs(mean) > _OFFSET * peak:
        notes.append(
            f"the mean is {mean:.3g} m/s^2, {abs(mean) / peak:.0%} of the peak: a zero offset is "
            "left in?"
        )
    return tuple(notes)


def check_finite(samples: NDArray[Any], dt: float, label: str) -> None:
    """Raise RecordError with the number and the first place of samples that are no finite
    numbers."""
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        first = int(bad[0])
        raise RecordError(
            f"{label}: {bad.size} of {samples.size} samples are not finite numbers, the first is "
            f"sample {first} (counted from 0) at {first * dt:g} s; repair or cut the record"
        )


def check_possible(acceleration: NDArray[np.float64], label: str) -> None:
    """Raise RecordError for an acceleration (m/s^2) that nothing on this planet has."""
    peak = float(np.max(np.abs(acceleration)))
    if peak > _IMPOSSIBLE:
        raise RecordError(
            f"{label}: the largest acceleration would be {peak:.4g} m/s^2; the units cannot be "
            "right"
        )


# ---- Read

_LOGGER = getLogger("tdint.assumptions")
"""For users of Python; the command line tells the warnings of `Record` itself."""


def read_record(
    source: str | Path,
    *,
    units: SampleUnits | None = None,
    component: str | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> Record:
    """Read one component of a ground motion.

    Parameters
    ----------
    source : str or Path
        A file, or `-` for standard input. The format is found from the contents.
    units : str or dict, optional
        Units of the samples: m/s^2, cm/s^2, gal, mm/s^2, g, in/s^2 or ft/s^2; with a factor before
        them the value of one count (`2.38e-6 m/s^2`). Needed where neither the format nor the file
        gives them. Only floating-point MiniSEED of an accelerometer's channel is else taken as
        m/s^2, with a warning, unless its numbers speak against it. Units of a velocity or
        displacement (`cm/s`, `cm`) say that the samples are one; they are differentiated. By file:
        `{"AT2": "g", "*.mseed": "m/s^2"}`, a format or the end of a path each (or the text
        `AT2=g,*.mseed=m/s^2`), or a table (`.csv`) with the columns record and units; what fits no
        entry has none.
    component : str, optional
        Needed if the file has several: the channel code (`HNE`), the full id (`CI.CLC..HNE`), or
        the code's last letter (`E`) if only one channel ends in it; upper and lower case are the
        same.
    inventory : str or Path, optional
        StationXML file by which the instrument's response is removed from samples whose units are
        neither stated by the file nor given; not together with units of all files.
    layout : TextLayout, optional
        Step, columns and lines to skip of text tables that do not tell them.

    Returns
    -------
    Record
        Acceleration in m/s^2. Its notes tell what was assumed and done.

    Raises
    ------
    UsageError
        The units are unknown, or units and an inventory are given.
    RecordError
        The file cannot be read, is damaged, has gaps, overlaps or samples that are not finite,
        counts of unknown value, no such component, or several and none is named.
    """
    (record,) = _read(source, RecordChoice(units, component, inventory, layout=layout), single=True)
    return record


def read_records(
    source: str | Path,
    *,
    units: SampleUnits | None = None,
    component: str | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> tuple[Record, ...]:
    """Read all components of a ground motion, or the named one, in the order of the file.

    Parameters and errors are those of `read_record`; that the components differ in their sampling
    interval is a RecordError, too. Channels without numbers (a recorder's log) are left out.
    """
    return _read(source, RecordChoice(units, component, inventory, layout=layout), single=False)


def make_record(
    data: Any,
    *,
    dt: float | None = None,
    units: str | None = None,
    component: str | None = None,
    name: str = "",
) -> Record:
    """Make a record of what is in memory: an ObsPy Trace or Stream, or an array of samples.

    Parameters
    ----------
    data : obspy.Trace, obspy.Stream or array, shape (samples,)
        The samples; of a stream with several components `component` names one.
    dt : float, optional
        Sampling interval, s: needed for an array; a trace has its own.
    units : str, optional
        As for `read_record`; needed for an array, and for a trace whose format and header do not
        tell them.
    component : str, optional
        As for `read_record`; of an array its name.
    name : str, optional
        What tables and messages call it; `trace`, `stream` or `array` where it is left out.

    Returns
    -------
    Record
        Acceleration in m/s^2. Its notes tell what was assumed and done.

    Raises
    ------
    UsageError
        Unknown units; a sampling interval or units that are missing or given twice.
    RecordError
        As for `read_record`.
    """
    parsed = None if units is None else parse_units(units)
    said = FileUnits() if parsed is None else FileUnits((("./*", parsed),), for_all=True)
    traces = [data] if hasattr(data, "stats") else list(getattr(data, "traces", ()))
    if traces:
        if dt is not None:
            raise UsageError("a trace has its own sampling interval; leave dt out")
        label = name or ("stream" if hasattr(data, "traces") else "trace")
    elif hasattr(data, "traces"):
        raise RecordError(f"{name or 'stream'}: the stream has no traces")
    else:
        if dt is None or parsed is None:
            raise UsageError(
                "samples in an array tell neither their interval nor their units; give dt and units"
            )
        label = name or "array"
        if isinstance(dt, int | float) and not dt <= LONGEST_STEP:
            raise RecordError(
                f"{label}: a sampling interval of {dt:.6g} s is beyond {LONGEST_STEP:g} s"
            )
        # An array becomes a trace first: units and doubts are then those of a file.
        checked = Record(data, dt, start="", id="", component=component or "", source=label)
        with quiet_import():
            from obspy import Trace
        traces = [
            Trace(checked.acceleration.copy(), {"delta": checked.dt, "channel": component or ""})
        ]
        component = None
    components = _channels_of(
        label, Contents(str(traces[0].stats.get("_format", "")), traces, (), ())
    )
    if component is not None:
        components = [_choose(components, component, label)]
    elif len(components) > 1:
        raise RecordError(
            f"{label}: there are several components, choose one by `component`: "
            f"{_listed(components)}"
        )
    return _to_record(components[0], _joined(components[0]), said, None)


def read_horizontals(
    *sources: str | Path,
    units: SampleUnits | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> Horizontals:
    """Read the two horizontal components of a motion from its file, or from its files.

    Parameters
    ----------
    *sources : str or Path
        A file with both, or one for each.
    units, inventory, layout
        As of `read_record`.

    Returns
    -------
    Horizontals

    Raises
    ------
    UsageError, RecordError
        As by `read_record`; there are not two components, or they are no pair (`find_horizontals`).
    """
    from tdint.ground_motion.horizontals import find_horizontals

    read = partial(read_records, units=units, inventory=inventory, layout=layout)
    return find_horizontals([component for source in sources for component in read(source)])


def _read(source: str | Path, choice: RecordChoice, *, single: bool) -> tuple[Record, ...]:
    said, inventory = file_units(choice.units), choice.inventory
    if said.for_all and inventory is not None:
        raise UsageError(
            "units and an inventory are given; the inventory gives the units, leave one of them out"
        )
    components, input_file = _components(source, choice, single=single)
    instruments = None
    if inventory is not None:
        from tdint.ground_motion.reading.instrument import read_instruments

        instruments = read_instruments(inventory)
    records = [_to_record(part, trace, said, instruments) for part, trace in components]
    # A record tells the files that it comes from: the inventory only where its response was taken.
    stations = (instruments.input,) if instruments else ()
    inputs = [
        (input_file, *(stations if record.units_from == "inventory" else ())) for record in records
    ]
    return tuple(
        replace(record, inputs=files) for record, files in zip(records, inputs, strict=True)
    )


def read_signal(
    source: str | Path, *, units: str | None = None, component: str | None = None
) -> Signal:
    """Read one component as it is, in SI units: a velocity or a displacement is not differentiated.

    Parameters and errors are those of `read_record`.
    """
    parsed = None if units is None else parse_units(units)
    ((part, trace),), input_file = _components(
        source, RecordChoice(component=component), single=True
    )
    motion = to_motion(trace, part.contents.format, parsed, part.label)
    dt = float(trace.stats.delta)
    check_finite(motion.samples, dt, part.label)
    start = _start(trace)
    peak = (
        float(np.max(np.abs(motion.samples), initial=0.0))
        if motion.quantity == "acceleration"
        else 0.0
    )
    return Signal(
        samples=motion.samples,
        dt=dt,
        quantity=motion.quantity,
        label=part.label,
        start=float(trace.stats.starttime.timestamp) if start else None,
        clock="UTC" if start else "",
        notes=(*part.contents.notes, *motion.notes),
        warnings=(*motion.warnings, *doubt_of_peak(peak, "peak acceleration")),
        input=input_file,
    )


def _components(
    source: str | Path, choice: RecordChoice, *, single: bool
) -> tuple[list[tuple[_Channel, Any]], Input]:
    """The components of a file, or the chosen one, each with its trace; and the file."""
    if not isinstance(source, str | Path):
        raise RecordError(f"a record is a file's name, got {source!r:.60}")
    name, component = str(source), choice.component
    data = read_bytes(source)
    parts = read_parts(data, name, choice.layout)
    components = [channel for part, contents in parts for channel in _channels_of(part, contents)]
    if component is not None and not isinstance(component, str):
        raise UsageError(f"a component is a text such as 'HNE', got {component!r}")

    # Velocities and displacements that tdint exported beside accelerations are taken by their full
    # id only.
    ids = {member.id.upper() for member in components}
    asked, accelerations = (component or "").strip().upper(), []
    for member in components:
        if (id := member.id.upper()) != asked:
            station, location, code = id.rsplit(".", 2)  # a damaged station's code may have dots
            is_integral = location in UNITS_BY_LOCATION and location != IN_SI
            if is_integral and f"{station}.{IN_SI}.{code}" in ids:
                continue
        accelerations.append(member)
    components = accelerations
    if component is not None:
        components = [_choose(components, component, name)]
    elif single and len(components) > 1:
        raise RecordError(
            f"{name}: the file has several components, choose one by `component`: "
            f"{_listed(components)}"
        )
    traces = [_joined(member) for member in components]
    # Components of one file go together; those of an archive's other files need not.
    for part, _ in parts:
        of_part = [
            trace for member, trace in zip(components, traces, strict=True) if member.source == part
        ]
        for trace in of_part:
            dt, first_dt = float(trace.stats.delta), float(of_part[0].stats.delta)
            if not isclose(dt, first_dt, rel_tol=1e-6):
                sampled = f"{trace.id} is sampled at {dt:g} s and {of_part[0].id} at {first_dt:g} s"
                raise RecordError(f"{part}: {sampled}; choose one component")
    return list(zip(components, traces, strict=True)), digested(data, source)


def _choose(channels: Sequence[_Channel], component: str, source: str) -> _Channel:
    """The channel with this code, else with this id, else of this station (a floor is one: F04),
    else the only one whose code ends in this letter."""
    name = component.strip().upper()
    ways = (
        [channel for channel in channels if channel.code.upper() == name],
        [channel for channel in channels if channel.id.upper() == name],
        [channel for channel in channels if station_of(channel.id).upper() == name],
        [channel for channel in channels if len(name) == 1 and channel.code.upper().endswith(name)],
    )
    channels_of_name = next((matches for matches in ways if matches), [])
    if len(channels_of_name) == 1:
        return channels_of_name[0]
    if channels_of_name:
        raise RecordError(
            f"{source}: several components match {component!r}, choose one: "
            f"{_listed(channels_of_name)}"
        )
    raise RecordError(
        f"{source}: there is no component {component!r}; there are {_listed(channels)}"
    )


def _listed(channels: Sequence[_Channel]) -> str:
    """Names by which each of the channels can be chosen."""
    codes, ids = [channel.code for channel in channels], [channel.id for channel in channels]
    stations = [station_of(id) for id in ids]
    ways = (codes, stations, ids)
    return ", ".join(
        next((names for names in ways if len(set(names)) == len(names) and all(names)), ids)
    )


def _to_record(
    channel: _Channel, trace: Any, said: FileUnits, instruments: Instruments | None
) -> Record:
    contents, label = channel.contents, channel.label
    units = said.of(channel.source, contents.format)
    counted = units is None or (
        are_counts(trace) and not units.has_factor
    )  # no unit is that of counts
    if instruments is None or not counted or declared_units(trace, contents.format, label, units):
        motion = to_acceleration(trace, contents.format, units, label)
        if instruments is not None:
            unused = f"its units are known ({motion.units}), the inventory is not used"
            motion = replace(motion, notes=(*motion.notes, unused))
            instruments = None
    else:
        from tdint.ground_motion.reading.instrument import remove_response

        acceleration, notes = remove_response(trace, instruments, label)
        motion = Motion(acceleration, "counts", "inventory", notes=notes)
    if motion.units_from == "assumed" and said.entries and not said.for_all:
        entries = ", ".join(pattern.removeprefix("./") for pattern, _ in said.entries)
        raise UsageError(
            f"{label}: does not tell its units, and none of the units given by file fits it: "
            f"{entries}"
        )
    dt = float(trace.stats.delta)
    check_finite(motion.samples, dt, label)
    check_possible(motion.samples, label)
    warnings = (
        *motion.warnings,
        *doubt_of_peak(float(np.max(np.abs(motion.samples), initial=0.0))),
    )
    for warning in warnings:
        _LOGGER.warning("%s: %s", label, warning)
    return Record(
        acceleration=motion.samples,
        dt=dt,
        start=_start(trace),
        id=channel.id,
        component=channel.code,
        source=channel.source,
        notes=(*contents.notes, *motion.notes, *doubts(motion.samples)),
        warnings=warnings,
        units=motion.units,
        units_from=motion.units_from,
        quantity=motion.quantity,
        header_checks=contents.compared,
        peaks=trace.stats.get("tdint_peaks", (None, None)) if instruments is None else (None, None),
        event=_event(trace),
    )


def _event(trace: Any) -> str:
    """Return the event as the file identifies it: as tdint's readers find it, the origin time of
    K-NET, or the name and the origin time of SAC; empty if the file states none."""
    stats = trace.stats
    if "knet" in stats:
        return f"{stats.knet.evot.datetime:%Y-%m-%d %H:%M:%S}" if stats.knet.get("evot") else ""
    if "sac" in stats:
        name, origin = str(stats.sac.get("kevnm", "")).strip(), stats.sac.get("o")
        # Times of SAC are relative to a reference time, of which the first sample is at `b`.
        if origin is not None and isfinite(origin) and _start(trace):
            time = stats.starttime + (float(origin) - float(stats.sac.get("b", 0.0)))
            name = f"{name} {time.datetime:%Y-%m-%d %H:%M:%S}".strip()
        return name
    return str(stats.get("tdint_event", ""))


def _start(trace: Any) -> str:
    """Time of the first sample; formats without one get the epoch from ObsPy, which no record
    begins at."""
    start = trace.stats.starttime
    return "" if start.timestamp == 0 else str(start)
