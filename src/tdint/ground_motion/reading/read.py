"""Read ground motion records in the formats supported by ObsPy and tdint."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from logging import getLogger
from math import isclose, isfinite
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, max_absolute
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.choice import AS_STATED, RecordChoice, ResampledLayout, TextLayout
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.miniseed_checks import LONGEST_STEP
from tdint.ground_motion.origin import origin_of
from tdint.ground_motion.reading import scale
from tdint.ground_motion.reading.contents import (
    Contents,
    read_all_contents,
    read_bytes,
    register_input,
)
from tdint.ground_motion.reading.sample_units import FileUnits, SampleUnits, file_units
from tdint.ground_motion.record import (
    MAX_FLOOR_PEAK,
    SI_LOCATION,
    UNITS_BY_LOCATION,
    Input,
    Record,
    component_of,
    has_one_sign,
    masked_samples,
    peak_warnings,
    station_of,
)
from tdint.items import grouped
from tdint.number_parsing import SMALLEST, pluralize
from tdint.units import parse_units

if TYPE_CHECKING:
    from tdint.ground_motion.horizontals import Horizontals
    from tdint.ground_motion.reading.instrument import Instruments
    from tdint.ground_motion.signal import Signal


# ---- Join the traces of a channel and check the samples

_MAX_POSSIBLE_ACCELERATION = 1e6
"""m/s^2; larger accelerations indicate wrong units, and their squares and integrals may exceed the
range of floats."""

_MAX_MEAN_FRACTION = (
    0.02  # fraction of the peak; a larger mean is an offset, not noise of a short record
)


class _Channel(NamedTuple):
    """Traces of a channel of a record.

    Attributes
    ----------
    source : str
        Name of the file, or of the file in an archive.
    id : str
        Common id of the traces, NET.STA.LOC.CHA.
    is_one_of_several : bool
        As in `Record`: the file has further channels with this code, or further stations.
    """

    source: str
    contents: Contents
    id: str
    traces: tuple[Any, ...]
    is_one_of_several: bool = False

    @property
    def code(self) -> str:
        """Channel code, which is the name of the component."""
        return str(self.traces[0].stats.channel)

    @property
    def label(self) -> str:
        """File and channel, for messages."""
        return f"{self.source}: {self.id}" if self.id.strip(".") else self.source


def _group_by_channel(source: str, contents: Contents) -> list[_Channel]:
    """Group the traces by channel, in the order of the file."""
    traces_by_id = grouped((trace.id, trace) for trace in contents.traces)
    return [_Channel(source, contents, id, tuple(traces)) for id, traces in traces_by_id.items()]


def _join_traces(channel: _Channel) -> Any:
    """Join the traces of a channel, sorted by start time, to a single trace without gaps: at least
    two finite samples at a positive sampling interval, in the number type of the file.

    RecordError is raised if the channel has a gap, an overlap, a change of the sampling interval,
    or samples that are missing or not finite.
    """
    label = channel.label
    traces = sorted(
        (trace for trace in channel.traces if len(trace.data)),
        key=lambda trace: trace.stats.starttime,
    )
    if not traces:
        raise RecordError(f"{label}: the channel has no samples")
    for trace in traces:
        dt = float(trace.stats.delta)
        if not (isfinite(dt) and dt > 0.0):
            raise RecordError(f"{label}: the sampling interval must be positive, got {dt:g} s")
        try:
            str(trace.stats.starttime), str(trace.stats.endtime)
        # The calendars of Python and ObsPy raise different exceptions outside their range.
        except Exception:
            raise RecordError(
                f"{label}: the time of the record is not a valid date; its header is corrupt"
            ) from None
        if missing := masked_samples(trace.data):
            samples = pluralize(missing, "sample")
            raise RecordError(
                f"{label}: {samples} marked as missing; extract the continuous part of the record"
            )
    for before, after in pairwise(traces):
        _check_continuity(before, after, label)
    joined = traces[0]
    if len(traces) > 1:
        joined = joined.copy()
        joined.data = np.concatenate([trace.data for trace in traces])
    if len(joined.data) < 2:
        raise RecordError(f"{label}: the channel has only one sample; a record needs at least two")
    check_finite(joined.data, float(joined.stats.delta), label)
    return joined


def _check_continuity(before: Any, after: Any, label: str) -> None:
    """Raise RecordError unless a trace continues the trace before it.

    Both must have the same sampling interval and number type. The second must start one
    sampling interval after the end of the first, with a tolerance of half an interval.
    """
    dt, start = float(before.stats.delta), after.stats.starttime
    if not isclose(dt, after.stats.delta, rel_tol=1e-6):
        raise RecordError(
            f"{label}: the sampling interval changes from {dt:g} s to {after.stats.delta:g} s at "
            f"{start}; cut the record there"
        )
    if (before.data.dtype.kind == "f") != (after.data.dtype.kind == "f"):
        raise RecordError(
            f"{label}: the samples before {start} and after are of different types (integer and "
            "floating-point); cut the record there"
        )
    gap = float(start - before.stats.endtime) - dt  # negative for an overlap
    if abs(gap) > 0.5 * dt:
        discontinuity = f"a gap of {gap:.6g} s" if gap > 0.0 else f"an overlap of {-gap:.6g} s"
        raise RecordError(
            f"{label}: {discontinuity} after {before.stats.endtime}; cut the record to its "
            "continuous part"
        )


def sample_notes(acceleration: Array) -> tuple[str, ...]:
    """Return notes if a ground acceleration contains only zeros, or has a zero offset."""
    peak, mean = max_absolute(acceleration), float(np.mean(acceleration))
    notes = []
    if peak == 0.0:
        notes.append("all samples are zero")
    elif abs(mean) > _MAX_MEAN_FRACTION * peak:
        notes.append(
            f"the mean is {mean:.3g} m/s^2, {100.0 * abs(mean) / peak:.0f} % of the peak: check "
            "whether the record has a zero offset"
        )
    return tuple(notes)


def check_finite(samples: NDArray[Any], dt: float, label: str) -> None:
    """Raise RecordError if samples are not finite; the message states their number and the first.

    Parameters
    ----------
    samples : array, shape (samples,)
        Samples of a component, in any unit.
    """
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        first = int(bad[0])
        raise RecordError(
            f"{label}: {bad.size} of {samples.size} samples are not finite numbers, the first is "
            f"sample {first} (counted from 0) at {first * dt:g} s; repair or cut the record"
        )


def check_possible(acceleration: Array, label: str) -> None:
    """Raise RecordError if a ground acceleration is physically impossible."""
    peak = max_absolute(acceleration)
    if 0.0 < peak < SMALLEST:
        raise RecordError(
            f"{label}: the peak acceleration must be 0 or at least {SMALLEST:g} m/s^2, got "
            f"{peak:.4g} m/s^2; correct the units"
        )
    if peak > _MAX_POSSIBLE_ACCELERATION:
        raise RecordError(
            f"{label}: the peak acceleration must be at most {_MAX_POSSIBLE_ACCELERATION:g} m/s^2, "
            f"got {peak:.4g} m/s^2; correct the units"
        )


# ---- Read components of a file in m/s^2

_LOGGER = getLogger("tdint.assumptions")
"""Logger for users of Python; the command line prints the warnings of `Record`."""


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
        File name, or `-` for standard input. The format is detected from the content.
    units : str or dict, optional
        Units of the samples: m/s^2, cm/s^2, gal, mm/s^2, g, mg, %g, in/s^2 or ft/s^2. With a
        factor, the value of a count (`2.38e-6 m/s^2`). Required if the format and the file do not
        state the units. Only floating-point MiniSEED of an accelerometer channel is assumed to be
        in m/s^2, with a warning, unless its numbers make this unlikely. Units of a velocity or a
        displacement (`cm/s`, `cm`) specify that the samples are this quantity; the acceleration is
        that of a cubic spline. Units by file: `{"AT2": "g", "*.mseed": "m/s^2"}`, where each key is
        a format or the end of a path (or the text `AT2=g,*.mseed=m/s^2`), or a table (`.csv`) with
        the columns record and units. No units are specified for files that match no entry.
    component : str, optional
        Component to read, required if the file has several: the channel code (`HNE`), the full id
        (`CI.CLC..HNE`), or the last letter of the code (`E`) if it is unique. Upper and lower case
        are equivalent.
    inventory : str or Path, optional
        StationXML file. The instrument response is removed from samples without stated or
        specified units. Cannot be combined with units for all files.
    layout : TextLayout, optional
        Time step, columns and lines to skip for text tables that do not state them. Default: no
        statements.

    Returns
    -------
    Record
        Acceleration in m/s^2. Its notes report assumptions and changes.

    Raises
    ------
    UsageError
        The units are unknown, or both units and an inventory are specified.
    RecordError
        The file cannot be read, is corrupt, has gaps, overlaps or samples that are not finite, or
        contains counts of unknown value; the component does not exist, or it is required.
    """
    (record,) = channel_records(
        source, RecordChoice(units, component, inventory, layout=layout), single=True
    )
    return record


def read_records(
    source: str | Path,
    *,
    units: SampleUnits | None = None,
    component: str | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> tuple[Record, ...]:
    """Read all components of a ground motion, or the specified component, in the order of the file.

    Parameters and errors are the same as for `read_record`. RecordError is also raised if the
    components have different sampling intervals. Text channels (the log of a recorder) are omitted.

    Parameters
    ----------
    units : str or dict, optional
        Units of the samples in any form that `read_record` accepts.
    inventory : str or Path, optional
        StationXML file; cannot be combined with units for all files.
    """
    return channel_records(
        source, RecordChoice(units, component, inventory, layout=layout), single=False
    )


def make_record(
    data: Any,
    *,
    dt: float | None = None,
    units: str | None = None,
    component: str | None = None,
    name: str = "",
) -> Record:
    """Create a record from an ObsPy Trace or Stream, or from an array of samples.

    Parameters
    ----------
    data : obspy.Trace, obspy.Stream or array, shape (samples,)
        Samples; for a stream with several components, `component` selects one.
    dt : float, optional
        Sampling interval, s; required for an array, not allowed for a trace.
    units : str, optional
        Same as for `read_record`; required for an array, and for a trace if its format and header
        do not state the units.
    component : str, optional
        Same as for `read_record`; for an array, the name of the component.
    name : str, optional
        Name in tables and messages. Default `trace`, `stream` or `array`.

    Returns
    -------
    Record
        Acceleration in m/s^2. Its notes report assumptions and changes.

    Raises
    ------
    UsageError
        The units are unknown; the sampling interval or the units are missing, or the interval is
        specified for a trace.
    RecordError
        Same as for `read_record`.
    """
    parsed = None if units is None else parse_units(units)
    # The pattern "./*" matches the label of every trace.
    specified = FileUnits() if parsed is None else FileUnits((("./*", parsed),), for_all=True)
    traces = [data] if hasattr(data, "stats") else list(getattr(data, "traces", ()))
    if traces:
        if dt is not None:
            raise UsageError("dt cannot be used with a trace, which states its sampling interval")
        label = name or ("stream" if hasattr(data, "traces") else "trace")
    elif hasattr(data, "traces"):
        raise RecordError(f"{name or 'stream'}: the stream has no traces")
    else:
        if dt is None or parsed is None:
            raise UsageError("dt and units are required for an array of samples; specify both")
        label = name or "array"
        if isinstance(dt, int | float) and not dt <= LONGEST_STEP:
            raise RecordError(
                f"{label}: the sampling interval must be at most {LONGEST_STEP:g} s, got {dt:.6g} s"
            )
        # Convert the array to a trace, so that units and plausibility are handled as for a file.
        checked = Record(data, dt, start="", id="", component=component or "", source=label)
        with quiet_import():
            from obspy import Trace
        traces = [
            Trace(checked.acceleration.copy(), {"delta": checked.dt, "channel": component or ""})
        ]
        component = None
    components = _group_by_channel(
        label, Contents(str(traces[0].stats.get("_format", "")), traces, (), ())
    )
    if component is not None:
        components = [_choose_channel(components, component, label)]
    elif len(components) > 1:
        raise RecordError(
            f"{label}: the data have several components, choose one by `component`: "
            f"{_unambiguous_names(components)}"
        )
    return _to_record(components[0], _join_traces(components[0]), specified, None)


def read_horizontals(
    *sources: str | Path,
    units: SampleUnits | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> Horizontals:
    """Read the two horizontal components of a ground motion from one or two files.

    Parameters
    ----------
    *sources : str or Path
        A file with both components, or one file for each component.
    units, inventory, layout
        Same as for `read_record`.

    Returns
    -------
    Horizontals
        Components of equal length in m/s^2.

    Raises
    ------
    UsageError, RecordError
        Same as for `read_record`; also if the number of horizontal components is not two or the
        components are not a pair (`find_horizontals`).
    """
    from tdint.ground_motion.horizontals import find_horizontals, recordings

    read = partial(read_records, units=units, inventory=inventory, layout=layout)
    records = [component for source in sources for component in read(source)]
    recording, *others = recordings(records)
    return find_horizontals(records if others else recording)


def channel_records(
    source: str | Path, choice: RecordChoice, *, single: bool
) -> tuple[Record, ...]:
    """Read the components of a file without processing, in m/s^2; with `single`, exactly one
    component.

    Raises
    ------
    UsageError
        Both units for all files and an inventory are specified.
    RecordError
        The file cannot be read, or a component is missing or ambiguous.
    """
    specified, inventory = file_units(choice.units), choice.inventory
    if specified.for_all and inventory is not None:
        raise UsageError(
            "units cannot be used with an inventory, which states the units; remove "
            "the units or the inventory"
        )
    components, input_file = _select_components(source, choice, single=single)
    instruments = None
    if inventory is not None:
        from tdint.ground_motion.reading.instrument import read_instruments

        instruments = read_instruments(inventory)
    records = []
    for channel, trace in components:
        record = _to_record(channel, trace, specified, instruments, choice)
        inputs = [input_file]
        # The inventory is an input of a record only if its response was used.
        if instruments is not None and record.units_from == "inventory":
            inputs.append(instruments.input)
        # The origin in the header of a file is used if no JSON file describes this file.
        origin = trace.stats.get("tdint_origin")
        if found := origin_of(input_file.file, input_file.sha256, channel.id):
            origin, *origin_file = found
            inputs.append(Input(*origin_file))
        if origin is not None:
            # A matched motion has a separate note, which contains its target.
            steps = origin.processing if not origin.target else (origin.text,)
            record = replace(
                record,
                origin=origin,
                processing=origin.processing,
                notes=(*record.notes, *steps),
            )
        records.append(replace(record, inputs=tuple(inputs)))
    return tuple(records)


def read_signal(
    source: str | Path, *, units: str | None = None, component: str | None = None
) -> Signal:
    """Read one component in SI units; a velocity or a displacement is not differentiated.

    Parameters
    ----------
    units : str, optional
        Units of the samples, required if the file does not state them.
    component : str, optional
        Component to read, required if the file has several components.

    Raises
    ------
    UsageError, RecordError
        Same as for `read_record`.
    """
    from tdint.ground_motion.signal import Signal  # not needed by a response history

    parsed = None if units is None else parse_units(units)
    ((channel, trace),), input_file = _select_components(
        source, RecordChoice(component=component), single=True
    )
    motion = scale.to_motion(trace, channel.contents.format, parsed, channel.label)
    dt = float(trace.stats.delta)
    check_finite(motion.samples, dt, channel.label)
    start = _start_time(trace)
    # Only an acceleration can have a peak that indicates a wrong unit.
    peak = max_absolute(motion.samples) if motion.quantity == "acceleration" else 0.0
    return Signal(
        samples=motion.samples,
        dt=dt,
        quantity=motion.quantity,
        label=channel.label,
        start=float(trace.stats.starttime.timestamp) if start else None,
        clock="UTC" if start else "",
        notes=(*channel.contents.notes, *motion.notes),
        warnings=(*motion.warnings, *peak_warnings(peak, "peak acceleration", MAX_FLOOR_PEAK)),
        input=input_file,
    )


def _select_components(
    source: str | Path, choice: RecordChoice, *, single: bool
) -> tuple[list[tuple[_Channel, Any]], Input]:
    """Read the channels of a file, or the selected channel, and join the traces of each channel.
    Return each channel with its trace, in the order of the file, and the name and digest of the
    file.

    Raises
    ------
    RecordError
        The file cannot be read, the component is missing or ambiguous, or the components of the
        file have different sampling intervals.
    """
    name, component = str(source), choice.component
    data = read_bytes(source)
    layout = choice.layout
    if choice.processing.resample:
        layout = ResampledLayout(**layout.set_fields())
    parts = read_all_contents(data, name, layout)
    components = [
        channel for part, contents in parts for channel in _group_by_channel(part, contents)
    ]
    components = _without_exported_integrals(components, (component or "").strip().upper())
    counts = Counter((channel.source, channel.code) for channel in components)
    stations = Counter(source for source, _ in {(c.source, station_of(c.id)) for c in components})
    components = [
        channel._replace(
            is_one_of_several=counts[channel.source, channel.code] > 1
            or stations[channel.source] > 1
        )
        for channel in components
    ]
    if component is not None:
        components = [_choose_channel(components, component, name)]
    elif single and len(components) > 1:
        raise RecordError(
            f"{name}: the file has several components, choose one by `component`: "
            f"{_unambiguous_names(components)}"
        )
    channels = [(channel, _join_traces(channel)) for channel in components]
    # All components of one file must have the same sampling interval. Files of an archive may
    # differ.
    for file, _ in parts:
        traces = [trace for channel, trace in channels if channel.source == file]
        for trace in traces:
            dt, first_dt = float(trace.stats.delta), float(traces[0].stats.delta)
            if not isclose(dt, first_dt, rel_tol=1e-6):
                raise RecordError(
                    f"{file}: {trace.id} is sampled at {dt:g} s and {traces[0].id} at "
                    f"{first_dt:g} s; choose one component"
                )
    return channels, register_input(data, source)


def _without_exported_integrals(channels: Sequence[_Channel], requested_id: str) -> list[_Channel]:
    """Remove the velocities and displacements that tdint exported with an acceleration, unless the
    user has requested their full id.

    These channels have the id of the acceleration with another location code.
    """
    ids = {channel.id.upper() for channel in channels}
    remaining = []
    for channel in channels:
        if (id := channel.id.upper()) != requested_id:
            station, location, code = id.rsplit(".", 2)  # a corrupt station code may contain dots
            is_integral = location in UNITS_BY_LOCATION and location != SI_LOCATION
            if is_integral and f"{station}.{SI_LOCATION}.{code}" in ids:
                continue
        remaining.append(channel)
    return remaining


def _choose_channel(channels: Sequence[_Channel], component: str, source: str) -> _Channel:
    """Return the only channel that a name selects; RecordError for no channel or several.

    The name is compared with the channel codes, then with the ids, the stations (for example floor
    F04) and the labels. If it is a single letter, it is then compared with the last characters of
    the codes. The first comparison with a match decides.
    """
    name = component.strip().upper()
    candidates = (
        [channel for channel in channels if channel.code.upper() == name],
        [channel for channel in channels if channel.id.upper() == name],
        [channel for channel in channels if station_of(channel.id).upper() == name],
        [channel for channel in channels if channel.label.upper() == name],
        [channel for channel in channels if len(name) == 1 and channel.code.upper().endswith(name)],
    )
    matches = next(filter(None, candidates), [])
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise RecordError(
            f"{source}: several components match {component!r}, choose one: "
            f"{_unambiguous_names(matches, channels)}"
        )
    raise RecordError(
        f"{source}: component {component!r} not found; the components are "
        f"{_unambiguous_names(channels)}"
    )


def _unambiguous_names(channels: Sequence[_Channel], others: Sequence[_Channel] = ()) -> str:
    """Return names that distinguish the channels, also from other channels of the file, for
    messages: their codes if these are unique, otherwise their stations, ids, or labels (with the
    file of an archive)."""
    for name_of in (attrgetter("code"), lambda channel: station_of(channel.id), attrgetter("id")):
        names = [name_of(channel) for channel in others or channels]
        if len(set(names)) == len(names) and all(name.strip(".") for name in names):
            return ", ".join(map(name_of, channels))
    return ", ".join(channel.label for channel in channels)


_AS_STATED = RecordChoice()


def _to_record(
    channel: _Channel,
    trace: Any,
    specified: FileUnits,
    instruments: Instruments | None,
    choice: RecordChoice = _AS_STATED,
) -> Record:
    """Convert a channel to a record with an acceleration in m/s^2.

    `choice` states the quantity that its samples must have, and whether they may all have the
    same sign.

    The instrument response is removed if an inventory is specified and the units of the samples are
    not known from the user or from the file. Warnings are stored in the record and logged.

    Raises
    ------
    UsageError
        Units by file are specified, but none match this file, which does not state its units.
    RecordError
        The samples cannot be converted, or are not finite or not possible.
    """
    contents, label = channel.contents, channel.label
    units = specified.of(channel.source, contents.format)
    # Counts need a factor, for example 2.38e-6 m/s^2. A unit without a factor, such as m/s^2, does
    # not state the value of a count.
    lacks_units = units is None or (scale.are_counts(trace) and not units.has_factor)
    if (
        instruments is None
        or not lacks_units
        or scale.declared_units(trace, contents.format, label, units)
    ):
        motion = scale.to_acceleration(trace, contents.format, units, label, choice.quantity)
        if instruments is not None:
            unused = f"the inventory is not used, because the units are known ({motion.units})"
            motion = motion._replace(notes=(*motion.notes, unused))
            instruments = None
    else:
        from tdint.ground_motion.reading.instrument import remove_response

        acceleration, notes, response_warnings = remove_response(trace, instruments, label)
        motion = scale.Motion(
            acceleration, "counts", "inventory", notes=notes, warnings=response_warnings
        )
    if motion.units_from == "assumed" and specified.entries and not specified.for_all:
        entries = ", ".join(pattern.removeprefix("./") for pattern, _ in specified.entries)
        raise UsageError(
            f"{label}: the file does not state its units, and no entry of the units by file "
            f"matches it: {entries}"
        )
    dt = float(trace.stats.delta)
    check_finite(motion.samples, dt, label)
    check_possible(motion.samples, label)
    # A displacement of the ground that the user requests may be a permanent offset.
    may_be_one_sided = choice.layout.one_sided or choice.quantity == "displacement"
    warnings = (
        *motion.warnings,
        *peak_warnings(max_absolute(motion.samples)),
        *scale.first_sample_warnings(motion.samples),
        *([] if may_be_one_sided else _sign_warnings(trace, motion)),
    )
    for warning in warnings:
        _LOGGER.warning("%s: %s", label, warning)
    return Record(
        acceleration=motion.samples,
        dt=dt,
        start=_start_time(trace),
        id=channel.id,
        component=component_of(channel.id, channel.code),
        source=channel.source,
        notes=(*contents.notes, *motion.notes, *sample_notes(motion.samples)),
        warnings=warnings,
        units=motion.units,
        units_from=motion.units_from,
        quantity=motion.quantity,
        header_checks=contents.compared,
        peaks=trace.stats.get("tdint_peaks", (None, None)) if instruments is None else (None, None),
        event=_event(trace),
        is_one_of_several=channel.is_one_of_several,
    )


def _sign_warnings(trace: Any, motion: scale.Motion) -> list[str]:
    """Return a warning if the samples of a file, before a differentiation, have one sign."""
    samples = motion.samples if motion.quantity == "acceleration" else np.asarray(trace.data)
    if not has_one_sign(samples):
        return []
    return [
        "no sample is below zero, or none is above: check that the values are not a spectrum, a "
        "list of peaks or a resultant; if they are a pulse of one sign, specify `one_sided`"
    ]


def _event(trace: Any) -> str:
    """Return the earthquake stated in the header of a file; empty if the header states none.

    A K-NET header states the origin time. A SAC header states a name and the origin time. The
    readers of tdint store their text in `stats.tdint_event`.
    """
    stats = trace.stats
    if "knet" in stats:
        return f"{stats.knet.evot.datetime:%Y-%m-%d %H:%M:%S}" if stats.knet.get("evot") else ""
    if "sac" in stats:
        name, origin = str(stats.sac.get("kevnm", "")).strip(), stats.sac.get("o")
        # SAC times are relative to a reference time; the first sample is at `b`.
        if origin is not None and isfinite(origin) and _start_time(trace):
            # A corrupt header may contain a time outside the range of dates.
            with suppress(ValueError, OverflowError):
                time = stats.starttime + (float(origin) - float(stats.sac.get("b", 0.0)))
                name = f"{name} {time.datetime:%Y-%m-%d %H:%M:%S}".strip()
        return name
    return str(stats.get("tdint_event", ""))


def _start_time(trace: Any) -> str:
    """Return the time of the first sample; empty if it is the epoch, which ObsPy uses for formats
    without a start time."""
    start = trace.stats.starttime
    return "" if start.timestamp == 0 else str(start)
