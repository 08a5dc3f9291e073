"""A result beside a recording: what both have in common on each floor, in numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize_scalar

from tdint.analysis.given import AnyModel, model_of
from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import Response
from tdint.analysis.run.run import prepare
from tdint.analysis.spectra.elastic import spectrum
from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError, RecordError, UsageError, did_you_mean
from tdint.ground_motion.reading.named_table import read_column
from tdint.ground_motion.reading.read import read_signal
from tdint.ground_motion.reading.scale import differentiated
from tdint.ground_motion.record import Input, Record
from tdint.ground_motion.signal import Signal, at_times, has_offset, in_band, without_offset
from tdint.model.definition import Excitation, Model
from tdint.model.recorded import AUTO, Recording, Sensor, load_recording
from tdint.tabular import Tabular
from tdint.units import GROUND_MOTION
from tdint.written_numbers import how_many, parse_positive

# ---- A recorded event on one clock: the ground motion that drives the model, and the floors'
# motions at its times

_FEWEST = 10
"""Samples that a comparison needs."""


@dataclass(frozen=True)
class RecordedFloor:
    """The motion that was recorded on a floor, without its offset and in the band of the
    comparison.

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
        """The motion at so many times, an interval (s) apart, later by `shift` (s); nan where
        nothing was recorded."""
        return at_times(self.signal.samples, self.signal.dt, self.first + shift, interval, count)


@dataclass(frozen=True)
class Event:
    """An event as it was recorded.

    Attributes
    ----------
    recording : Recording
        The file that says what was recorded.
    base : Record
        The ground motion that drives the model: the mean of the base's sensors, without an offset
        that its samples tell, unfiltered.
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
            A file cannot be read, its quantity is another one than expected, the recordings do not
            meet in time, or the band is out of reach of their samples.
        """
        base = [_read(sensor) for sensor in recording.base]
        floors = [[_read(sensor) for sensor in sensors] for _, sensors in recording.floors]
        notes: dict[str, None] = {}
        # The ground motion, over the time that all sensors of the base have in common.
        accelerations = []
        for signal in base:
            if signal.quantity != "acceleration":
                notes[f"{signal.label}: the {signal.quantity} of the base is differentiated"] = None
                samples = differentiated(signal.samples, signal.dt, signal.quantity)
                signal = signal.with_samples(samples, "acceleration")
            accelerations.append(signal)
        mean, lead = _common(accelerations, f"{recording.source}: the base", notes)
        if len(base) > 1:
            notes[f"the model is driven by the mean of {len(base)} sensors of the base"] = None
        motion = mean.samples
        if has_offset(motion):
            motion = without_offset(motion, mean.quantity)
            notes[
                f"the offset of the base, {mean.samples[0] - motion[0]:.3g} m/s^2 (its median), is "
                "removed"
            ] = None
        record = Record(motion, mean.dt, start="", id="", component="base", source=recording.source)
        # The translation of each floor: the mean of its sensors, without what the floor turns.
        recorded = []
        for (number, _), signals in zip(recording.floors, floors, strict=True):
            place = f"floor {number}"
            quantities = sorted({signal.quantity for signal in signals})
            if len(quantities) > 1:
                raise RecordError(f"{place}: its sensors are of {' and '.join(quantities)}")
            signal, after = _common([signal.centered() for signal in signals], place, notes)
            if len(signals) > 1:
                notes[f"{place}: the mean of {len(signals)} sensors is compared"] = None
            signal = replace(signal, start=None if signal.start is None else signal.start + after)
            if signal.quantity == "velocity":
                raise RecordError(
                    f"{signal.label}: is a velocity; an acceleration or a displacement is compared"
                )
            first = _later(signal, base[0], notes) - lead
            if first >= record.duration or first + (signal.samples.size - 1) * signal.dt <= 0.0:
                raise RecordError(
                    f"{signal.label}: recorded at another time than {base[0].label}; see their "
                    "starts"
                )
            centered = signal.centered()
            samples = in_band(
                centered.samples, signal.dt, recording.band, signal.label, signal.quantity
            )
            recorded.append(RecordedFloor(number, centered.with_samples(samples), first))
        every = [*base, *(signal for signals in floors for signal in signals)]
        return cls(
            recording,
            record,
            tuple(recorded),
            notes=(
                *dict.fromkeys(note for signal in every for note in _named(signal, signal.notes)),
                *notes,
            ),
            warnings=tuple(
                dict.fromkeys(text for signal in every for text in _named(signal, signal.warnings))
            ),
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
        """What was computed at the base's times made what the recordings are: without its offset,
        in the band."""
        centered = without_offset(samples, quantity)
        return in_band(centered, self.base.dt, self.recording.band, self.base.source, quantity)

    @cached_property
    def base_displacement(self) -> Array:
        """Displacement of the base in the band, m, shape (count,)."""
        velocity = cumulative_trapezoid(self.base.acceleration, dx=self.base.dt, initial=0.0)
        moved = cumulative_trapezoid(velocity, dx=self.base.dt, initial=0.0)
        return self.filtered(moved, "displacement")

    def window(self, recorded: Array, label: str) -> slice:
        """The times at which a floor is compared: in the window, and where it was recorded (not
        nan).

        Raises
        ------
        RecordError
            Next to nothing is left.
        """
        start, end = self.recording.window or (0.0, self.base.duration)
        there = np.flatnonzero(np.isfinite(recorded))
        first = max(
            math.ceil(start / self.base.dt - 1e-6), int(there[0]) if there.size else self.count
        )
        last = min(math.floor(end / self.base.dt + 1e-6), int(there[-1]) if there.size else 0)
        if last - first + 1 < _FEWEST:
            raise RecordError(
                f"{label}: has fewer than {_FEWEST} samples in the window from {start:g} to "
                f"{end:g} s"
            )
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
        # Units that were given have been judged with the quantity: what differs is a file's own, or
        # a column's name.
        cure = "correct the quantity, or give its units"
        if sensor.column is not None:
            cure = (
                "if the end of the column's name is right, take `quantity` out; if not, give "
                "`units` beside it, which count in place of the name: one of "
                f"{', '.join(GROUND_MOTION[sensor.quantity])}"
            )
        raise RecordError(
            f"{signal.label}: its units say {signal.quantity}, its quantity says "
            f"{sensor.quantity}; {cure}"
        )
    return signal.times(sensor.sign)


def _common(signals: Sequence[Signal], place: str, notes: dict[str, None]) -> tuple[Signal, float]:
    """The mean of signals over the time that they have in common, as the first one with other
    samples; and where that begins, s from the first one's first sample."""
    first = signals[0]
    starts = [_later(signal, first, notes) for signal in signals]
    lead = max(starts)
    ends = [
        start + (recorded.samples.size - 1) * recorded.dt
        for start, recorded in zip(starts, signals, strict=True)
    ]
    count = math.floor((min(ends) - lead) / first.dt + 1e-6) + 1
    if count < _FEWEST:
        raise RecordError(f"{place}: its sensors recorded at different times")
    rows = [
        at_times(signal.samples, signal.dt, start - lead, first.dt, count)
        for start, signal in zip(starts, signals, strict=True)
    ]
    return first.with_samples(np.nan_to_num(np.mean(rows, axis=0))), lead


def _later(signal: Signal, than: Signal, notes: dict[str, None]) -> float:
    """How much later a recording begins than another, s; 0 where their clocks cannot be compared,
    which is noted."""
    if signal.start is None or than.start is None or signal.clock != than.clock:
        if signal.label != than.label:
            notes[
                f"{signal.label}: taken to begin with {than.label}: the files do not tell on one "
                "clock"
            ] = None
        return 0.0
    return signal.start - than.start


def _named(signal: Signal, texts: Sequence[str]) -> list[str]:
    return [f"{signal.label}: {text}" for text in texts]


# ---- Compare

_LONGEST_SHIFT = 10.0
"""s; clocks that are further apart are no matter of a shift."""

_ROUNDING = 1e-6  # of a step: steps of files are written with six digits

_BETTER = 0.05
"""By how much a correlation must rise to say that a displacement seems to be absolute."""

_SHORT = 0.25
"""omega dt of a step that is short for a mode: errors of the fourth order are below 1e-4 there."""

_MOST_PARTS = 64  # halvings of the sampling interval for short periods: six

_MET: dict[str, tuple[Callable[[float, float], bool], str]] = {
    "correlation": (lambda value, limit: value >= limit, "at least {limit:g}"),
    "peak_ratio": (
        lambda value, limit: min(limit, 1.0 / limit) <= value <= max(limit, 1.0 / limit),
        "between {limit:g} and its inverse",
    ),
    "rms_difference": (lambda value, limit: value <= limit, "at most {limit:g}"),
}
"""By name, whether a value meets its limit, and what that is in words."""


@dataclass(frozen=True)
class FloorComparison:
    """A floor's motion as it was computed and as it was recorded, over the times at which both are
    compared.

    Attributes
    ----------
    floor : int
        From 1 at the bottom.
    quantity : str
        `acceleration` (absolute, m/s^2) or `displacement` (relative to the base, m).
    time, computed, recorded : ndarray, shape (samples,)
        s from the first sample of the base, and the motions in their band.
    base : ndarray, shape (samples,)
        Acceleration of the base in the same band, m/s^2.
    """

    floor: int
    quantity: str
    time: Array
    computed: Array
    recorded: Array
    base: Array

    @property
    def correlation(self) -> float:
        """Pearson's coefficient; nan where one of both is at rest."""
        a, b = self.computed - np.mean(self.computed), self.recorded - np.mean(self.recorded)
        return _ratio(float(a @ b), float(np.linalg.norm(a) * np.linalg.norm(b)))

    @property
    def peak_ratio(self) -> float:
        """Largest absolute value computed over that recorded; nan where nothing was recorded."""
        return _ratio(float(np.max(np.abs(self.computed))), float(np.max(np.abs(self.recorded))))

    @property
    def rms_difference(self) -> float:
        """Root mean square of the difference over that of the recording; nan where nothing was
        recorded."""
        difference = float(np.sqrt(np.mean((self.computed - self.recorded) ** 2)))
        return _ratio(difference, float(np.sqrt(np.mean(self.recorded**2))))


@dataclass(frozen=True)
class FloorSpectra:
    """Response spectra of a floor's absolute acceleration, computed and recorded, m/s^2, shape
    (k,)."""

    floor: int
    periods: Array
    computed: Array
    recorded: Array


@dataclass(frozen=True, repr=False)
class Comparison(Tabular):
    """A result beside a recording.

    Attributes
    ----------
    event : Event
        What was recorded.
    response : Response
        What was computed under the motion of its base, with its history.
    shift : float
        What was added to the times of the floors' recordings, s.
    floors : tuple of FloorComparison
        From the ground up.
    """

    event: Event
    response: Response
    shift: float
    floors: tuple[FloorComparison, ...]

    def _headline(self) -> str:
        least, floors = (
            min(floor.correlation for floor in self.floors),
            how_many(len(self.floors), "floor"),
        )
        return f"of {self.response.model.name!r}: {floors}, correlations of {least:.3f} and more"

    def spectra(self, periods: Array, damping: float) -> tuple[FloorSpectra, ...]:
        """Response spectra of the floors' absolute accelerations, of the part that is compared.

        A displacement is differentiated for it, and the base's acceleration added.
        """

        def largest(floor: FloorComparison, motion: Array) -> Array:
            dt = self.event.base.dt
            if floor.quantity == "displacement":
                motion = differentiated(motion, dt, floor.quantity) + floor.base
            return spectrum(
                Record(motion, dt, "", "", "", self.event.recording.source), periods, damping
            ).sa

        return tuple(
            FloorSpectra(
                floor.floor, periods, largest(floor, floor.computed), largest(floor, floor.recorded)
            )
            for floor in self.floors
        )


def absolute_displacements(comparison: Comparison) -> list[str]:
    """A sentence for each floor whose recorded displacement agrees much better once the base's is
    subtracted."""
    event, curves = comparison.event, []
    for floor in comparison.floors:
        if floor.quantity != "displacement":
            continue
        first = round(floor.time[0] / event.base.dt)
        base = event.base_displacement[first : first + floor.time.size]
        relative = replace(floor, recorded=floor.recorded - base)
        if (
            relative.correlation > floor.correlation + _BETTER
            and relative.rms_difference < floor.rms_difference
        ):
            curves.append(
                f"floor {floor.floor}: less the base's displacement the recording has a "
                f"correlation of {relative.correlation:.3f} instead of {floor.correlation:.3f}: it "
                "seems to be absolute, and a displacement is compared relative to the base; "
                "subtract the base's from it in the file"
            )
    return curves


def compare(
    model: AnyModel,
    event: Event | str | Path,
    *,
    method: str | None = None,
    dt: float | None = None,
    shift: float | None = None,
) -> Comparison:
    """Integrate a model under the base's motion of an event, and set the floors beside what was
    recorded.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes.
    event : Event, str or Path
        What was recorded, or the YAML file that says so.
    method, dt : optional
        As in `run`; the step is the base's sampling interval or a whole part of it.
    shift : float, optional
        In place of what the recording says, s.

    Returns
    -------
    Comparison
        Peaks, correlations and differences of each floor; `floor_spectra` of both.

    Raises
    ------
    UsageError
        No method, an unknown one, or a step that does not fit.
    AnalysisError
        The run has no result, or ends before the recording (`FailedRun`).
    """
    model = model_of(model)
    if not isinstance(event, Event):
        event = Event.of(load_recording(str(event), len(model.stories)))
    response = respond(case_under(model, event, method), dt, event.recording.band)
    computed = computed_floors(response, event)
    if shift is None:
        stated = event.recording.shift
        shift = best_shift(event, computed) if stated == AUTO else float(stated)
    return Comparison(event, response, shift, compared_floors(event, computed, shift))


def case_under(model: Model, event: Event, method: str | None = None) -> Case:
    """The model under the base's motion, in place of the record that it names.

    Where neither the method nor the model's is given, a linear building is integrated by `exact`.
    """
    bare = replace(model, excitation=Excitation(None, model.excitation.forces))
    specification = method or model.analysis.method or ("exact" if is_linear(model) else None)
    return prepare(bare, event.base, method=specification)


def is_linear(model: Model) -> bool:
    """Whether `exact` integrates the model without error under a ground motion alone."""
    linear = all(
        story.law.name == "linear" and story.power_dashpot is None for story in model.stories
    )
    return linear and not model.excitation.forces


def respond(case: Case, dt: float | None, band: tuple[float, float] | None = None) -> Response:
    """The response over the whole of the base's motion, with its history.

    Without a step it is the base's sampling interval, or a part of it that is short for all modes
    within the band: what the method errs is not to be seen beside the recording.
    """
    record = case.record
    assert record is not None
    if dt is None:
        fastest = min(case.building.fastest, 2.0 * math.pi * band[1] if band else math.inf)
        exact = case.method.family.linear_only
        parts = 1 if exact else 2 ** max(0, math.ceil(math.log2(fastest * record.dt / _SHORT)))
        dt = record.dt / min(parts, _MOST_PARTS)
    steps = case.steps(dt, record.duration)
    if steps.h > record.dt * (1.0 + _ROUNDING):
        raise UsageError(
            f"dt {steps.h:.6g} s is longer than the recording's sampling interval, {record.dt:.6g} "
            "s; a comparison needs a result at every sample: use that or a whole part of it"
        )
    return case.integrate(steps, history=True)


def computed_floors(response: Response, event: Event) -> list[Array]:
    """The motions of the recorded floors at the base's times, in the band of the comparison.

    Raises
    ------
    AnalysisError
        The run ended before the recording.
    """
    history = response.history
    assert history is not None
    every = round(event.base.dt / response.dt)
    if history.time[::every].size < event.count:
        raise AnalysisError(
            f"{response.model.name}: the building collapsed after {history.time[-1]:.6g} s, before "
            "the recording ends; there is nothing to compare"
        )
    motions = {"acceleration": history.acceleration, "displacement": history.displacement}
    return [
        event.filtered(
            motions[floor.quantity][::every, floor.floor - 1].astype(np.float64), floor.quantity
        )
        for floor in event.floors
    ]


def compared_floors(
    event: Event, computed: Sequence[Array], shift: float
) -> tuple[FloorComparison, ...]:
    """The floors where and when both motions are known."""
    result = []
    time = np.arange(event.count, dtype=np.float64) * event.base.dt
    for floor, motion in zip(event.floors, computed, strict=True):
        recorded = floor.at(event.base.dt, event.count, shift)
        part = event.window(recorded, floor.signal.label)
        result.append(
            FloorComparison(
                floor.floor,
                floor.quantity,
                time[part],
                motion[part],
                recorded[part],
                event.base_in_band[part],
            )
        )
    return tuple(result)


def best_shift(event: Event, computed: Sequence[Array]) -> float:
    """What added to the times of the recordings (s) brings the floors' correlation with the result
    to its largest sum.

    The best whole number of samples first (by the cross-correlation), then parts of one.
    """
    dt, most = event.base.dt, min(event.count - 1, round(_LONGEST_SHIFT / event.base.dt))
    total = np.zeros(2 * most + 1)
    size = 2 * event.count
    for floor in compared_floors(event, computed, 0.0):
        scale = float(np.linalg.norm(floor.computed) * np.linalg.norm(floor.recorded))
        if scale > 0.0:
            product = np.fft.rfft(floor.computed, size) * np.conj(np.fft.rfft(floor.recorded, size))
            lags = np.fft.irfft(product, size)
            total += np.concatenate([lags[size - most :], lags[: most + 1]]) / scale
    whole = int(np.argmax(total)) - most

    def apart(parts: float) -> float:
        return -sum(
            compared.correlation for compared in compared_floors(event, computed, parts * dt)
        )

    return float(minimize_scalar(apart, bounds=(whole - 1.0, whole + 1.0), method="bounded").x) * dt


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0.0 else float("nan")


def parse_requirement(text: str) -> tuple[str, float]:
    """Name and number of a requirement such as `correlation=0.9`.

    Raises
    ------
    UsageError
        Another form, an unknown name, or a number that is not positive.
    """
    name, _, number = (part.strip() for part in text.partition("="))
    if name not in _MET:
        hint = did_you_mean(name, _MET) or f"; known: {', '.join(_MET)}"
        raise UsageError(f"{text!r}: write NAME=NUMBER, such as correlation=0.9{hint}")
    return name, parse_positive(name, number)


def unmet(comparison: Comparison, requirements: Sequence[tuple[str, float]]) -> list[str]:
    """A sentence for each floor and requirement that it does not meet."""
    return [
        f"{comparison.event.recording.source}: floor {floor.floor}: {name} is {value:.12g}, "
        "required is " + words.format(limit=limit)
        for floor in comparison.floors
        for name, limit in requirements
        for meets, words in [_MET[name]]
        if not meets(value := float(getattr(floor, name)), limit)
    ]
