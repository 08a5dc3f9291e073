"""Read ground-motion records in the formats that ObsPy and tdint know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from logging import getLogger
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.header_checks.statement import LONGEST_STEP
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.reading.contents import Contents, digested, read_bytes, read_parts
from tdint.ground_motion.reading.scale import Motion, declared_units, to_acceleration, to_motion
from tdint.ground_motion.reading.segments import (
    Channel,
    check_equal_sampling,
    check_finite,
    check_possible,
    doubts,
    group_channels,
    join,
)
from tdint.ground_motion.record import Input, Record, station_of
from tdint.ground_motion.signal import Signal
from tdint.ground_motion.text_layout import AS_STATED, TextLayout
from tdint.units import Units, parse_units

if TYPE_CHECKING:
    from tdint.ground_motion.horizontals import Horizontals
    from tdint.ground_motion.reading.instrument import Instruments

_LOGGER = getLogger("tdint.assumptions")
"""For users of Python; the command line tells the warnings of `Record` itself."""


def read_record(
    source: str | Path,
    *,
    units: str | None = None,
    component: str | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> Record:
    """Read one component of a ground motion.

    Parameters
    ----------
    source : str or Path
        A file, or `-` for standard input. The format is found from the contents.
    units : str, optional
        Units of the samples: m/s^2, cm/s^2, gal, mm/s^2, g, in/s^2 or ft/s^2; with a factor before them the value of
        one count (`2.38e-6 m/s^2`). Needed where neither the format nor the file gives them. Only floating-point
        MiniSEED of an accelerometer's channel is else taken as m/s^2, with a warning, unless its numbers speak against
        it. Units of a velocity or displacement (`cm/s`, `cm`) say that the samples are one; they are differentiated.
    component : str, optional
        Needed if the file has several: the channel code (`HNE`), the full id (`CI.CLC..HNE`), or the code's last letter
        (`E`) if only one channel ends in it; upper and lower case are the same.
    inventory : str or Path, optional
        StationXML file by which the instrument's response is removed; not together with `units`.
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
        The file cannot be read, is damaged, has gaps, overlaps or samples that are not finite, counts of unknown
        value, no such component, or several and none is named.
    """
    (record,) = _read(source, units, component, inventory, layout, single=True)
    return record


def read_records(
    source: str | Path,
    *,
    units: str | None = None,
    component: str | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> tuple[Record, ...]:
    """Read all components of a ground motion, or the named one, in the order of the file.

    Parameters and errors are those of `read_record`; that the components differ in their sampling interval is
    a RecordError, too. Channels without numbers (a recorder's log) are left out.
    """
    return _read(source, units, component, inventory, layout, single=False)


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
        As for `read_record`; needed for an array, and for a trace whose format and header do not tell them.
    component : str, optional
        As for `read_record`; of an array its name.
    name : str, optional
        What tables and messages call it; `trace`, `stream` or `array` where it is left out.

    Raises
    ------
    UsageError
        Unknown units; a sampling interval or units that are missing or given twice.
    RecordError
        As for `read_record`.
    """
    wanted = None if units is None else parse_units(units)
    traces = [data] if hasattr(data, "stats") else list(getattr(data, "traces", ()))
    if traces:
        if dt is not None:
            raise UsageError("a trace has its own sampling interval; leave dt out")
        label = name or ("stream" if hasattr(data, "traces") else "trace")
    elif hasattr(data, "traces"):
        raise RecordError(f"{name or 'stream'}: the stream has no traces")
    else:
        if dt is None or wanted is None:
            raise UsageError("samples in an array tell neither their interval nor their units; give dt and units")
        label = name or "array"
        if isinstance(dt, int | float) and not dt <= LONGEST_STEP:
            raise RecordError(f"{label}: a sampling interval of {dt:.6g} s is beyond {LONGEST_STEP:g} s")
        checked = Record(data, dt, start="", id="", component=component or "", source=label)
        traces = [_trace(checked, component or "")]
        component = None
    found = [
        _Component(label, Contents(str(traces[0].stats.get("_format", "")), [], (), ()), channel)
        for channel in group_channels(traces)
    ]
    if component is not None:
        found = [_choose(found, component, label)]
    elif len(found) > 1:
        raise RecordError(f"{label}: there are several components, choose one: {_listed(found)}")
    return _to_record(found[0], join(found[0].channel, found[0].label), wanted, None)


def _trace(record: Record, component: str) -> Any:
    """A trace of a record's samples as they are."""
    with quiet_import():
        from obspy import Trace

    return Trace(record.acceleration.copy(), {"delta": record.dt, "channel": component})


def read_horizontals(
    *sources: str | Path,
    units: str | None = None,
    inventory: str | Path | None = None,
    layout: TextLayout = AS_STATED,
) -> Horizontals:
    """Read the two horizontal components of a motion from its file, or from its files.

    Parameters, and errors beside those of `find_horizontals`, are those of `read_records`.
    """
    from tdint.ground_motion.horizontals import find_horizontals

    read = partial(read_records, units=units, inventory=inventory, layout=layout)
    return find_horizontals([one for source in sources for one in read(source)])


def _read(
    source: str | Path,
    units: str | None,
    component: str | None,
    inventory: str | Path | None,
    layout: TextLayout,
    *,
    single: bool,
) -> tuple[Record, ...]:
    if units is not None and inventory is not None:
        raise UsageError("units and an inventory are given; the inventory gives the units, leave one of them out")
    wanted = None if units is None else parse_units(units)
    found, input_file = _components(source, component, layout, single=single)
    instruments = None if inventory is None else _instruments(inventory)
    inputs = (input_file, *([instruments.input] if instruments else []))
    return tuple(replace(_to_record(one, trace, wanted, instruments), inputs=inputs) for one, trace in found)


def _instruments(inventory: str | Path) -> Instruments:
    from tdint.ground_motion.reading.instrument import read_instruments

    return read_instruments(inventory)


def read_signal(source: str | Path, *, units: str | None = None, component: str | None = None) -> Signal:
    """Read one component as it is, in SI units: a velocity or a displacement is not differentiated.

    Parameters and errors are those of `read_record`.
    """
    wanted = None if units is None else parse_units(units)
    ((one, trace),), input_file = _components(source, component, AS_STATED, single=True)
    motion = to_motion(trace, one.contents.format, wanted, one.label)
    dt = float(trace.stats.delta)
    check_finite(motion.samples, dt, one.label)
    start = _start(trace)
    return Signal(
        samples=motion.samples,
        dt=dt,
        quantity=motion.quantity,
        label=one.label,
        start=float(trace.stats.starttime.timestamp) if start else None,
        clock="UTC" if start else "",
        notes=(*one.contents.notes, *motion.notes),
        warnings=motion.warnings,
        input=input_file,
    )


def _components(
    source: str | Path, component: str | None, layout: TextLayout, *, single: bool
) -> tuple[list[tuple[_Component, Any]], Input]:
    """The components of a file, or the one of this name, each with its trace; and the file."""
    if not isinstance(source, str | Path):
        raise RecordError(f"a record is a file's name, got {source!r:.60}")
    name = str(source)
    data = read_bytes(source)
    parts = read_parts(data, name, layout)
    found = [_Component(part, read, channel) for part, read in parts for channel in group_channels(read.traces)]
    if component is not None:
        if not isinstance(component, str):
            raise UsageError(f"a component is a text such as 'HNE', got {component!r}")
        found = [_choose(found, component, name)]
    elif single and len(found) > 1:
        raise RecordError(f"{name}: the file has several components, choose one: {_listed(found)}")
    traces = [join(one.channel, one.label) for one in found]
    for part, _ in parts:
        of_part = (trace for one, trace in zip(found, traces, strict=True) if one.source == part)
        check_equal_sampling([(trace.id, float(trace.stats.delta)) for trace in of_part], part)
    return list(zip(found, traces, strict=True)), digested(data, source)


@dataclass(frozen=True)
class _Component:
    """A channel of a file, or of a file in an archive."""

    source: str
    contents: Contents
    channel: Channel

    @property
    def label(self) -> str:
        """File and channel, for messages."""
        return f"{self.source}: {self.channel.id}" if self.channel.id.strip(".") else self.source


def _choose(channels: Sequence[_Component], component: str, source: str) -> _Component:
    """The channel with this code, else with this id, else of this station (a floor is one: F04), else the only one
    whose code ends in this letter."""
    wanted = component.strip().upper()
    ways = (
        [one for one in channels if one.channel.code.upper() == wanted],
        [one for one in channels if one.channel.id.upper() == wanted],
        [one for one in channels if station_of(one.channel.id).upper() == wanted],
        [one for one in channels if len(wanted) == 1 and one.channel.code.upper().endswith(wanted)],
    )
    found = next((matches for matches in ways if matches), [])
    if len(found) == 1:
        return found[0]
    if found:
        raise RecordError(f"{source}: several components match {component!r}, choose one: {_listed(found)}")
    raise RecordError(f"{source}: there is no component {component!r}; there are {_listed(channels)}")


def _listed(components: Sequence[_Component]) -> str:
    """Names by which each of the components can be chosen."""
    codes = [one.channel.code for one in components]
    ids = [one.channel.id for one in components]
    stations = [station_of(one) for one in ids]
    ways = (codes, stations, ids)
    return ", ".join(next((names for names in ways if len(set(names)) == len(names) and all(names)), ids))


def _to_record(one: _Component, trace: Any, wanted: Units | None, instruments: Instruments | None) -> Record:
    channel, contents, label = one.channel, one.contents, one.label
    if instruments is None:
        motion = to_acceleration(trace, contents.format, wanted, label)
    else:
        if declared_units(trace, contents.format, label):
            raise RecordError(f"{label}: the file gives its own units; leave the inventory out")
        from tdint.ground_motion.reading.instrument import remove_response

        acceleration, notes = remove_response(trace, instruments, label)
        motion = Motion(acceleration, "counts", "inventory", notes=notes)
    for warning in motion.warnings:
        _LOGGER.warning("%s: %s", label, warning)
    dt = float(trace.stats.delta)
    check_finite(motion.samples, dt, label)
    check_possible(motion.samples, label)
    return Record(
        acceleration=motion.samples,
        dt=dt,
        start=_start(trace),
        id=channel.id,
        component=channel.code,
        source=one.source,
        notes=(*contents.notes, *motion.notes, *doubts(motion.samples)),
        warnings=motion.warnings,
        units=motion.units,
        units_from=motion.units_from,
        quantity=motion.quantity,
        compared=contents.compared,
        peaks=trace.stats.get("tdint_peaks", (None, None)) if instruments is None else (None, None),
    )


def _start(trace: Any) -> str:
    """Time of the first sample; formats without one get the epoch from ObsPy, which no record begins at."""
    start = trace.stats.starttime
    return "" if start.timestamp == 0 else str(start)
