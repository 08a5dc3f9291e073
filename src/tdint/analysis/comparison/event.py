"""A recorded event on one clock: the ground motion that drives the model, and the floors' motions at its times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.integrate import cumulative_trapezoid

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.reading.named_table import read_column
from tdint.ground_motion.reading.read import read_signal
from tdint.ground_motion.reading.scale import differentiated
from tdint.ground_motion.record import Input, Record
from tdint.ground_motion.signal import Signal, at_times, in_band, without_offset
from tdint.model.recorded import Recording, Sensor
from tdint.units import GROUND_MOTION

_FEWEST = 10
"""Samples that a comparison needs."""


@dataclass(frozen=True)
class RecordedFloor:
    """The motion that was recorded on a floor, without its offset and in the band of the comparison.

    Attributes
    ----------
    floor : int
        From 1 at the bottom.
    signal : Signal
        Absolute acceleration, m/s^2, or displacement relative to the base, m.
    first : float
        Time of its first sample, s from the first one of the base.
    """

    floor: int
    signal: Signal
    first: float

    @property
    def quantity(self) -> str:
        """`acceleration` or `displacement`."""
        return self.signal.quantity

    def at(self, interval: float, count: int, shift: float) -> Array:
        """The motion at so many times, an interval (s) apart, later by `shift` (s); nan where nothing was recorded."""
        return at_times(self.signal.samples, self.signal.dt, self.first + shift, interval, count)


@dataclass(frozen=True)
class Event:
    """An event as it was recorded.

    Attributes
    ----------
    recording : Recording
        The file that says what was recorded.
    base : Record
        The ground motion that drives the model: the mean of the base's sensors, without its offset, unfiltered.
    floors : tuple of RecordedFloor
        From the ground up.
    notes, warnings : tuple of str
        What the readers assumed or did.
    inputs : tuple of Input
        The files of the recordings, each once.
    """

    recording: Recording
    base: Record
    floors: tuple[RecordedFloor, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    inputs: tuple[Input, ...]

    @classmethod
    def of(cls, recording: Recording) -> Event:
        """Read the files of a recording.

        Raises
        ------
        RecordError
            A file cannot be read, its quantity is another one than expected, the recordings do not meet in time, or the
            band is out of reach of their samples.
        """
        base = [_read(sensor) for sensor in recording.base]
        floors = [[_read(sensor) for sensor in sensors] for _, sensors in recording.floors]
        notes: dict[str, None] = {}
        record, lead = _base_record(recording, base, notes)
        recorded = []
        for (number, _), signals in zip(recording.floors, floors, strict=True):
            signal = _mean(signals, f"floor {number}", notes)
            if signal.quantity == "velocity":
                raise RecordError(f"{signal.label}: is a velocity; an acceleration or a displacement is compared")
            first = _later(signal, base[0], notes) - lead
            if first >= record.duration or first + (signal.samples.size - 1) * signal.dt <= 0.0:
                raise RecordError(f"{signal.label}: recorded at another time than {base[0].label}; see their starts")
            centered = signal.centered()
            samples = in_band(centered.samples, signal.dt, recording.band, signal.label, signal.quantity)
            recorded.append(RecordedFloor(number, centered.with_samples(samples), first))
        every = [*base, *(signal for signals in floors for signal in signals)]
        return cls(
            recording,
            record,
            tuple(recorded),
            notes=(*dict.fromkeys(note for signal in every for note in _named(signal, signal.notes)), *notes),
            warnings=tuple(dict.fromkeys(text for signal in every for text in _named(signal, signal.warnings))),
            inputs=tuple(dict.fromkeys(signal.input for signal in every)),
        )

    @property
    def count(self) -> int:
        """Samples of the base."""
        return self.base.acceleration.size

    @cached_property
    def base_in_band(self) -> Array:
        """Acceleration of the base in the band of the comparison, m/s^2, shape (count,)."""
        return self.filtered(self.base.acceleration, "acceleration")

    def filtered(self, samples: Array, quantity: str) -> Array:
        """What was computed at the base's times made what the recordings are: without its offset, in the band."""
        centered = without_offset(samples, quantity)
        return in_band(centered, self.base.dt, self.recording.band, self.base.source, quantity)

    @cached_property
    def base_displacement(self) -> Array:
        """Displacement of the base in the band, m, shape (count,)."""
        velocity = cumulative_trapezoid(self.base.acceleration, dx=self.base.dt, initial=0.0)
        moved = cumulative_trapezoid(velocity, dx=self.base.dt, initial=0.0)
        return self.filtered(moved, "displacement")

    def window(self, recorded: Array, label: str) -> slice:
        """The times at which a floor is compared: in the window, and where it was recorded (not nan).

        Raises
        ------
        RecordError
            Next to nothing is left.
        """
        start, end = self.recording.window or (0.0, self.base.duration)
        there = np.flatnonzero(np.isfinite(recorded))
        first = max(math.ceil(start / self.base.dt - 1e-6), int(there[0]) if there.size else self.count)
        last = min(math.floor(end / self.base.dt + 1e-6), int(there[-1]) if there.size else 0)
        if last - first + 1 < _FEWEST:
            raise RecordError(f"{label}: has fewer than {_FEWEST} samples in the window from {start:g} to {end:g} s")
        return slice(first, last + 1)


def _read(sensor: Sensor) -> Signal:
    """What a sensor recorded.

    Raises
    ------
    RecordError
        Its samples are another quantity than the file of the recording says.
    """
    if sensor.column is None:
        signal = read_signal(sensor.file, units=sensor.units, component=sensor.component)
    else:
        signal = read_column(sensor.file, sensor.column, sensor.units)
    if sensor.quantity and signal.quantity != sensor.quantity:
        raise RecordError(
            f"{signal.label}: its units say {signal.quantity}, its quantity says {sensor.quantity}; {_cure(sensor)}"
        )
    return signal.times(sensor.sign)


def _cure(sensor: Sensor) -> str:
    """What to do where a sensor's file and its quantity differ: its units would have been judged with the quantity."""
    if sensor.column is None:
        return "correct the quantity, or give its units"
    fitting = ", ".join(GROUND_MOTION[sensor.quantity or "acceleration"])
    return (
        "if the end of the column's name is right, take `quantity` out; if not, give `units` beside it, which count in "
        f"place of the name: one of {fitting}"
    )


def _base_record(recording: Recording, signals: Sequence[Signal], notes: dict[str, None]) -> tuple[Record, float]:
    """The ground motion, over the time that all sensors of the base have in common, and where that begins, s from the
    first sample of the first one."""
    mean, lead = _common([_acceleration(signal, notes) for signal in signals], f"{recording.source}: the base", notes)
    if len(signals) > 1:
        notes[f"the model is driven by the mean of {len(signals)} sensors of the base"] = None
    motion = without_offset(mean.samples, mean.quantity)
    return Record(motion, mean.dt, start="", id="", component="base", source=recording.source), lead


def _mean(signals: Sequence[Signal], place: str, notes: dict[str, None]) -> Signal:
    """The mean of the sensors of a floor: its translation, without what the floor turns."""
    if len({signal.quantity for signal in signals}) > 1:
        raise RecordError(f"{place}: its sensors are of {' and '.join(sorted({one.quantity for one in signals}))}")
    mean, lead = _common([signal.centered() for signal in signals], place, notes)
    if len(signals) > 1:
        notes[f"{place}: the mean of {len(signals)} sensors is compared"] = None
    return replace(mean, start=None if mean.start is None else mean.start + lead)


def _common(signals: Sequence[Signal], place: str, notes: dict[str, None]) -> tuple[Signal, float]:
    """The mean of signals over the time that they have in common, as the first one with other samples; and where that
    begins, s from the first one's first sample."""
    first = signals[0]
    starts = [_later(signal, first, notes) for signal in signals]
    lead = max(starts)
    ends = [start + (one.samples.size - 1) * one.dt for start, one in zip(starts, signals, strict=True)]
    count = math.floor((min(ends) - lead) / first.dt + 1e-6) + 1
    if count < _FEWEST:
        raise RecordError(f"{place}: its sensors recorded at different times")
    rows = [
        at_times(one.samples, one.dt, start - lead, first.dt, count) for start, one in zip(starts, signals, strict=True)
    ]
    return first.with_samples(np.nan_to_num(np.mean(rows, axis=0))), lead


def _acceleration(signal: Signal, notes: dict[str, None]) -> Signal:
    if signal.quantity == "acceleration":
        return signal
    notes[f"{signal.label}: the {signal.quantity} of the base is differentiated"] = None
    return signal.with_samples(differentiated(signal.samples, signal.dt, signal.quantity), "acceleration")


def _later(signal: Signal, than: Signal, notes: dict[str, None]) -> float:
    """How much later a recording begins than another, s; 0 where their clocks cannot be compared, which is noted."""
    if signal.start is None or than.start is None or signal.clock != than.clock:
        if signal.label != than.label:
            notes[f"{signal.label}: taken to begin with {than.label}: the files do not tell on one clock"] = None
        return 0.0
    return signal.start - than.start


def _named(signal: Signal, texts: Sequence[str]) -> list[str]:
    return [f"{signal.label}: {text}" for text in texts]
