"""Comparison of a computed response with a recorded response, floor by floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize_scalar

from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError, RecordError, UsageError, did_you_mean
from tdint.ground_motion.reading.named_table import read_column
from tdint.ground_motion.reading.read import read_signal
from tdint.ground_motion.reading.scale import moved
from tdint.ground_motion.record import Record
from tdint.ground_motion.signal import Signal, at_times, has_offset, in_band, without_offset
from tdint.model.building import assemble
from tdint.model.definition import Model
from tdint.number_parsing import number_text, parse_positive, pluralize
from tdint.response.arguments import AnyModel, model_of
from tdint.response.runs.case import Case
from tdint.response.runs.outcome import Response
from tdint.response.runs.run import prepare
from tdint.response.spectra.elastic import spectrum
from tdint.studies.recordings.recording_file import AUTO, Recording, Sensor, load_recording
from tdint.tabular import Tabular
from tdint.units import GROUND_MOTION

# ---- Recorded event with a common clock: the ground motion that drives the model, and the motions
# of the floors at its sampling times

_MIN_SAMPLES = 10
"""Minimum number of samples of a comparison."""


@dataclass(frozen=True)
class RecordedFloor:
    """Recorded motion of a floor, without its offset and in the frequency band of the comparison.

    Attributes
    ----------
    floor : int
        Number of the floor, from 1 at the bottom.
    signal : Signal
        Absolute acceleration, m/s^2, or displacement relative to the base, m.
    first : float
        Time of the first sample of the signal, s; 0 is the first sample of the base.
    """

    floor: int
    signal: Signal
    first: float

    @property
    def quantity(self) -> str:
        """`acceleration` or `displacement`."""
        return self.signal.quantity

    def at(self, interval: float, count: int, shift: float) -> Array:
        """Return the motion at equally spaced times; nan outside the recording.

        Parameters
        ----------
        interval : float
            Interval of the times, s.
        shift : float
            Shift of the recording to later times, s.
        """
        return at_times(self.signal.samples, self.signal.dt, self.first + shift, interval, count)


class Event:
    """Recorded event.

    Attributes
    ----------
    base : Record
        Ground motion that drives the model: the mean of the sensors of the base, unfiltered. An
        offset is removed if the samples show it.
    floors : tuple of RecordedFloor
        Recorded floors, from the bottom.
    notes, warnings : tuple of str
        Assumptions and changes of the readers.
    inputs : tuple of Input
        Files of the recordings with their checksums, without repetition.
    """

    def __init__(self, recording: Recording) -> None:
        """Read the files of a recording.

        Raises
        ------
        RecordError
            A file cannot be read, its quantity differs from the expected quantity, the recordings
            do not overlap in time, or their samples do not resolve the band.
        """
        base_signals = [_read(sensor) for sensor in recording.base]
        floor_signals = [[_read(sensor) for sensor in sensors] for _, sensors in recording.floors]
        # The keys are the notes: a dictionary keeps their order and omits repetitions.
        notes: dict[str, None] = {}
        self.recording = recording
        self.base, base_start = _base_motion(base_signals, recording.source, notes)
        floors = []
        for (number, _), signals in zip(recording.floors, floor_signals, strict=True):
            floor_signal = _floor_signal(signals, f"floor {number}", notes)
            # Times are relative to the first sample of the mean motion of the base.
            first = _start_offset(floor_signal, base_signals[0], notes) - base_start
            last = first + (floor_signal.samples.size - 1) * floor_signal.dt
            if first >= self.base.duration or last <= 0.0:
                raise RecordError(
                    f"{floor_signal.label}: does not overlap in time with {base_signals[0].label}; "
                    "check their start times"
                )
            centered = floor_signal.centered()
            samples = in_band(
                centered.samples,
                floor_signal.dt,
                recording.band,
                floor_signal.label,
                floor_signal.quantity,
            )
            floors.append(RecordedFloor(number, centered.with_samples(samples), first))
        all_signals = [*base_signals, *(signal for signals in floor_signals for signal in signals)]
        reader_notes = [f"{item.label}: {text}" for item in all_signals for text in item.notes]
        warnings = [f"{item.label}: {text}" for item in all_signals for text in item.warnings]
        self.floors = tuple(floors)
        self.notes = tuple(dict.fromkeys([*reader_notes, *notes]))
        self.warnings = tuple(dict.fromkeys(warnings))
        self.inputs = tuple(dict.fromkeys(signal.input for signal in all_signals))

    @property
    def count(self) -> int:
        """Number of samples of the base."""
        return self.base.acceleration.size

    @cached_property
    def base_in_band(self) -> Array:
        """Acceleration of the base in the band of the comparison, m/s^2, shape (count,)."""
        return self.filtered(self.base.acceleration, "acceleration")

    def filtered(self, samples: Array, quantity: str) -> Array:
        """Return a computed motion without its offset and in the frequency band of the comparison.

        The recordings are processed in the same manner.

        Parameters
        ----------
        samples : ndarray, shape (count,)
            Computed motion at the sampling times of the base.
        """
        centered = without_offset(samples, quantity)
        return in_band(centered, self.base.dt, self.recording.band, self.base.source, quantity)

    @cached_property
    def base_displacement(self) -> Array:
        """Displacement of the base in the band of the comparison, m, shape (count,)."""
        velocity = cumulative_trapezoid(self.base.acceleration, dx=self.base.dt, initial=0.0)
        displacement = cumulative_trapezoid(velocity, dx=self.base.dt, initial=0.0)
        return self.filtered(displacement, "displacement")

    def window(self, recorded: Array, label: str) -> slice:
        """Return the samples that are in the time window of the comparison and in a recording.

        Parameters
        ----------
        recorded : ndarray, shape (count,)
            Recorded motion at the sampling times of the base; nan outside the recording.

        Raises
        ------
        RecordError
            Fewer than 10 samples remain.
        """
        start, end = self.recording.window or (0.0, self.base.duration)
        index, dt = np.arange(self.count), self.base.dt
        # The value 1e-6 allows for rounding errors of the times, in samples. Samples outside the
        # recording are at its ends, so that the remaining samples are successive.
        is_in_window = (index >= start / dt - 1e-6) & (index <= end / dt + 1e-6)
        used = np.flatnonzero(is_in_window & np.isfinite(recorded))
        if used.size < _MIN_SAMPLES:
            raise RecordError(
                f"{label}: has fewer than {_MIN_SAMPLES} samples in the window from {start:g} to "
                f"{end:g} s; use a longer window"
            )
        return slice(used[0], used[-1] + 1)


def _read(sensor: Sensor) -> Signal:
    """Read the signal of a sensor; raise RecordError if the quantity of the samples differs from
    the quantity in the file of the recording.
    """
    if sensor.column is None:
        signal = read_signal(sensor.file, units=sensor.units, component=sensor.component)
    else:
        signal = read_column(sensor.file, sensor.column, sensor.units)
    if sensor.quantity and signal.quantity != sensor.quantity:
        # Specified units have already been compared with the quantity. Here the units of the data
        # file, or the name of a column, differ.
        remedy = "correct the quantity, or specify the units"
        if sensor.column is not None:
            remedy = (
                "if the suffix of the column is correct, remove `quantity`; otherwise specify "
                "`units`, which override the suffix: one of "
                f"{', '.join(GROUND_MOTION[sensor.quantity])}"
            )
        raise RecordError(
            f"{signal.label}: the units of the samples are units of {signal.quantity}, but the key "
            f"`quantity` of the sensor specifies {sensor.quantity}; {remedy}"
        )
    return signal.times(sensor.sign)


def _base_motion(
    signals: Sequence[Signal], source: str, notes: dict[str, None]
) -> tuple[Record, float]:
    """Return the ground motion that drives the model, the mean acceleration of the base sensors
    over their common time, and the start of this time after the first sample of the first sensor,
    s.
    """
    accelerations = []
    for signal in signals:
        acceleration = signal
        if signal.quantity != "acceleration":
            moving = moved(signal.samples, signal.dt, signal.quantity)
            notes |= dict.fromkeys(f"{signal.label}: {text}" for text in moving.notes[:1])
            notes |= dict.fromkeys(f"{signal.label}: {text}" for text in moving.warnings)
            acceleration = signal.with_samples(moving.acceleration, "acceleration")
        accelerations.append(acceleration)
    mean, common_start = _mean_signal(accelerations, f"{source}: the base", notes)
    if len(signals) > 1:
        notes[f"the model is driven by the mean of {len(signals)} sensors of the base"] = None
    motion = mean.samples
    if has_offset(motion):
        motion = without_offset(motion, mean.quantity)
        notes[
            f"the offset of the base, {mean.samples[0] - motion[0]:.3g} m/s^2 (the median), is "
            "removed"
        ] = None
    record = Record(motion, mean.dt, start="", id="", component="base", source=source)
    return record, common_start


def _floor_signal(signals: Sequence[Signal], label: str, notes: dict[str, None]) -> Signal:
    """Return the translation of a floor: the mean of its sensors, where rotations cancel.

    Raises
    ------
    RecordError
        The sensors record different quantities or a velocity, or do not overlap in time.
    """
    quantities = sorted({signal.quantity for signal in signals})
    if len(quantities) > 1:
        raise RecordError(
            f"{label}: all sensors must record the same quantity, got {' and '.join(quantities)}"
        )
    mean, common_start = _mean_signal([signal.centered() for signal in signals], label, notes)
    if len(signals) > 1:
        notes[f"{label}: the mean of {len(signals)} sensors is compared"] = None
    if mean.quantity == "velocity":
        raise RecordError(
            f"{mean.label}: must be an acceleration or a displacement to be compared, got a "
            "velocity"
        )
    return replace(mean, start=None if mean.start is None else mean.start + common_start)


def _mean_signal(
    signals: Sequence[Signal], label: str, notes: dict[str, None]
) -> tuple[Signal, float]:
    """Return the mean of signals over their common time, with the properties of the first signal,
    and the start of this time after its first sample, s.

    Assumptions about the clocks are added to `notes`.
    """
    first_signal = signals[0]
    starts = [_start_offset(signal, first_signal, notes) for signal in signals]
    common_start = max(starts)
    ends = [
        start + (signal.samples.size - 1) * signal.dt
        for start, signal in zip(starts, signals, strict=True)
    ]
    count = math.floor((min(ends) - common_start) / first_signal.dt + 1e-6) + 1
    if count < _MIN_SAMPLES:
        raise RecordError(
            f"{label}: the recordings of the sensors on this floor do not overlap in time; check "
            "the start times of the files"
        )
    shifted_signals = [
        at_times(signal.samples, signal.dt, start - common_start, first_signal.dt, count)
        for start, signal in zip(starts, signals, strict=True)
    ]
    return first_signal.with_samples(np.nan_to_num(np.mean(shifted_signals, axis=0))), common_start


def _start_offset(signal: Signal, reference: Signal, notes: dict[str, None]) -> float:
    """Return the time from the start of a reference signal to the start of another signal, s.

    The result is negative if the signal starts earlier. It is 0 if the clocks cannot be compared;
    this assumption is added to the keys of `notes`.
    """
    if signal.start is None or reference.start is None or signal.clock != reference.clock:
        if signal.label != reference.label:
            notes[
                f"{signal.label}: assumed to start together with {reference.label}, because the "
                "files have no common clock"
            ] = None
        return 0.0
    return signal.start - reference.start


# ---- Comparison of the computed with the recorded motions

_LONGEST_SHIFT = 10.0
"""Maximum shift, s; a larger difference of clocks is not a matter of synchronization."""

# Maximum relative difference of a time step that equals the sampling interval, because intervals in
# files are written with six digits
_ROUNDING = 1e-6

_CORRELATION_GAIN = 0.05
"""Increase of the correlation above which a displacement is reported as probably absolute."""

_SHORT_STEP = 0.25
"""Maximum product of the circular frequency of a mode (rad/s) and the time step (s), below which
the error of a fourth-order method is less than 1e-4."""

# Maximum number of time steps in a sampling interval, if short periods require small steps
_MAX_STEPS_PER_INTERVAL = 64

# A limit r of the peak ratio also limits the inverse: the ratio must be between r and 1 / r.
_REQUIREMENTS: dict[str, tuple[Callable[[float, float], bool], str]] = {
    "correlation": (lambda value, limit: value >= limit, "at least {limit:g}"),
    "peak_ratio": (
        lambda value, limit: min(limit, 1.0 / limit) <= value <= max(limit, 1.0 / limit),
        "between {low:.4g} and {high:.4g}",
    ),
    "rms_difference": (lambda value, limit: value <= limit, "at most {limit:g}"),
}
"""Requirements by name of the compared value: the function (value, limit) that returns True if the
value meets its limit, and the text of this condition."""


@dataclass(frozen=True)
class FloorComparison:
    """Computed and recorded motion of a floor over the compared times.

    Attributes
    ----------
    quantity : str
        `acceleration` (absolute, m/s^2) or `displacement` (relative to the base, m).
    time : ndarray, shape (samples,)
        Times after the first sample of the base, s.
    computed, recorded : ndarray, shape (samples,)
        Motions of the floor in the frequency band of the comparison.
    base : ndarray, shape (samples,)
        Acceleration of the base in the band, m/s^2.
    """

    floor: int
    quantity: str
    time: Array
    computed: Array
    recorded: Array
    base: Array

    @property
    def correlation(self) -> float:
        """Pearson's correlation coefficient; nan if one of the motions is constant."""
        a, b = self.computed - np.mean(self.computed), self.recorded - np.mean(self.recorded)
        return _ratio(float(a @ b), float(np.linalg.norm(a) * np.linalg.norm(b)))

    @property
    def peak_ratio(self) -> float:
        """Computed over recorded maximum absolute value; nan if the recording is zero."""
        return _ratio(float(np.max(np.abs(self.computed))), float(np.max(np.abs(self.recorded))))

    @property
    def rms_difference(self) -> float:
        """Root mean square (rms) of the difference, divided by the rms of the recording.

        The value is nan if the recording is zero.
        """
        difference = float(np.sqrt(np.mean((self.computed - self.recorded) ** 2)))
        return _ratio(difference, float(np.sqrt(np.mean(self.recorded**2))))


@dataclass(frozen=True)
class FloorSpectra:
    """Response spectra of a floor's absolute acceleration."""

    floor: int
    periods: Array
    computed: Array
    recorded: Array


@dataclass(frozen=True, repr=False)
class Comparison(Tabular):
    """Computed response compared with a recording.

    Attributes
    ----------
    event : Event
        Recorded event.
    response : Response
        Response computed under the motion of the base, with its time history.
    shift : float
        Time added to the times of the floors' recordings, s.
    floors : tuple of FloorComparison
        Compared floors, from the bottom.
    """

    event: Event
    response: Response
    shift: float
    floors: tuple[FloorComparison, ...]

    def _headline(self) -> str:
        floors = pluralize(len(self.floors), "floor")
        smallest = min(floor.correlation for floor in self.floors)
        return f"of {self.response.model.name!r}: {floors}, correlations of {smallest:.3f} and more"

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of the readers and of the run."""
        return (*self.event.notes, *self.response.notes)

    @property
    def warnings(self) -> list[str]:
        """Warnings of the readers and of the run, and a warning for each floor with a recorded
        displacement that probably is absolute.

        Displacements are compared relative to the base. A recorded displacement is probably
        absolute if subtracting the displacement of the base improves the agreement considerably.
        """
        event, messages = self.event, [*self.event.warnings, *self.response.warnings]
        for floor in self.floors:
            if floor.quantity != "displacement":
                continue
            first_sample = round(floor.time[0] / event.base.dt)
            samples = slice(first_sample, first_sample + floor.time.size)
            relative = replace(floor, recorded=floor.recorded - event.base_displacement[samples])
            if (
                relative.correlation > floor.correlation + _CORRELATION_GAIN
                and relative.rms_difference < floor.rms_difference
            ):
                messages.append(
                    f"floor {floor.floor}: the recorded displacement probably is absolute, but "
                    "displacements are compared relative to the base. If the displacement of the "
                    f"base is subtracted, the correlation is {relative.correlation:.3f} instead of "
                    f"{floor.correlation:.3f}; subtract the displacement of the base in the file"
                )
        return messages

    def spectra(self, periods: Array, damping: float) -> tuple[FloorSpectra, ...]:
        """Return response spectra of the computed and of the recorded absolute floor accelerations.

        The spectra refer to the time window of the comparison. For displacements relative to the
        base, these are the accelerations of a spline and of the base.

        Parameters
        ----------
        periods : ndarray
            Periods, s.
        damping : float
            Damping ratio.
        """

        def acceleration_spectrum(floor: FloorComparison, motion: Array) -> Array:
            """Return the spectrum of absolute accelerations of a floor motion, m/s^2."""
            dt = self.event.base.dt
            if floor.quantity == "displacement":
                motion = moved(motion, dt, floor.quantity).acceleration + floor.base
            return spectrum(
                Record(motion, dt, "", "", "", self.event.recording.source), periods, damping
            ).sa

        return tuple(
            FloorSpectra(
                floor.floor,
                periods,
                acceleration_spectrum(floor, floor.computed),
                acceleration_spectrum(floor, floor.recorded),
            )
            for floor in self.floors
        )


def compare(
    model: AnyModel,
    event: Event | str | Path,
    *,
    method: str | None = None,
    dt: float | None = None,
    shift: float | None = None,
) -> Comparison:
    """Integrate a model under the recorded base motion, and compare the motions of the floors.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model, as in `run`.
    event : Event, str or Path
        Recorded event, or the YAML file that describes it.
    method, dt : optional
        As in `run`; the time step must be the sampling interval of the base divided by a whole
        number.
    shift : float, optional
        Shift of the recordings, s; default is the shift in the file.

    Returns
    -------
    Comparison
        Peaks, correlations and differences of each floor; `spectra` returns response spectra.

    Raises
    ------
    UsageError
        The method is missing or unknown, or the time step is invalid.
    ModelError
        The model or the file of recordings is invalid.
    AnalysisError
        The run fails, or ends before the recording (`FailedRun`).
    """
    model = model_of(model)
    if not isinstance(event, Event):
        event = Event(load_recording(str(event), len(model.stories)))
    response = respond(case_under(model, event, method), dt, event.recording.band)
    computed = computed_floors(response, event)
    if shift is None:
        requested_shift = event.recording.shift
        shift = best_shift(event, computed) if requested_shift == AUTO else float(requested_shift)
    return Comparison(event, response, shift, compared_floors(event, computed, shift))


def case_under(model: Model, event: Event, method: str | None = None) -> Case:
    """Prepare a model for a run under the recorded base motion instead of its own record.

    Parameters
    ----------
    method : str, optional
        Method; default is the method of the model, otherwise `exact` for a linear building.
    """
    model_without_record = replace(model, excitation=replace(model.excitation, record=None))
    specification = method or model.analysis.method or ("exact" if is_linear(model) else None)
    return prepare(model_without_record, event.base, method=specification)


def is_linear(model: Model) -> bool:
    """Return True if the method `exact` can integrate the model without discretization error.

    The building must be linear, and the model must not have forces on floors.
    """
    return assemble(model).linear and not model.excitation.has_forces


def respond(case: Case, dt: float | None, band: tuple[float, float] | None = None) -> Response:
    """Integrate a model over the complete base motion, and keep the time history.

    Parameters
    ----------
    dt : float | None
        Time step, s. None for the sampling interval of the base, or a fraction of the interval that
        is short for all modes in the band, so that the discretization error is negligible.
    band : tuple of two floats, optional
        Frequency band of the comparison, Hz; by default all frequencies.

    Raises
    ------
    UsageError
        The time step exceeds the sampling interval of the base, or does not divide it.
    FailedRun
        The run fails.
    """
    record = case.record
    assert record is not None
    if dt is None:
        # The method `exact` has no discretization error.
        largest_frequency = min(
            case.building.fastest, 2.0 * math.pi * band[1] if band else math.inf
        )
        steps_per_interval = 1
        if not case.method.family.linear_only:
            halvings = math.ceil(math.log2(largest_frequency * record.dt / _SHORT_STEP))
            steps_per_interval = 2 ** max(0, halvings)
        dt = record.dt / min(steps_per_interval, _MAX_STEPS_PER_INTERVAL)
    steps = case.steps(dt, record.duration)
    if steps.h > record.dt * (1.0 + _ROUNDING):
        raise UsageError(
            f"dt {steps.h:.6g} s must not exceed the sampling interval of the recording, "
            f"{record.dt:.6g} s; use this interval or divide it by a whole number"
        )
    return case.integrate(steps, history=True)


def computed_floors(response: Response, event: Event) -> list[Array]:
    """Return the computed motions of the recorded floors, in the frequency band of the comparison.

    Parameters
    ----------
    response : Response
        Response with its history, with one or several time steps in a sampling interval.

    Returns
    -------
    list of ndarray, shape (count,)
        Absolute acceleration (m/s^2) or displacement relative to the base (m) of each recorded
        floor, at the sampling times of the base.

    Raises
    ------
    AnalysisError
        The run ended before the recording.
    """
    history = response.history
    assert history is not None
    steps_per_interval = round(event.base.dt / response.dt)
    if history.time[::steps_per_interval].size < event.count:
        raise AnalysisError(
            f"{response.model.name}: the building collapsed after {history.time[-1]:.6g} s, before "
            "the end of the recording; a comparison requires the complete response"
        )
    motions = {"acceleration": history.absolute_acceleration, "displacement": history.displacement}
    return [
        event.filtered(
            motions[floor.quantity][::steps_per_interval, floor.floor - 1].astype(np.float64),
            floor.quantity,
        )
        for floor in event.floors
    ]


def compared_floors(
    event: Event, computed: Sequence[Array], shift: float
) -> tuple[FloorComparison, ...]:
    """Combine the computed and the recorded motion of each floor, at times of both motions.

    Parameters
    ----------
    computed : sequence of ndarray, shape (count,)
        Computed motions of the recorded floors, as from `computed_floors`.
    shift : float
        Shift of the recordings to later times, s.

    Raises
    ------
    RecordError
        A recording has too few samples in the window of the comparison.
    """
    comparisons = []
    time = np.arange(event.count, dtype=np.float64) * event.base.dt
    for floor, motion in zip(event.floors, computed, strict=True):
        recorded = floor.at(event.base.dt, event.count, shift)
        compared_window = event.window(recorded, floor.signal.label)
        comparisons.append(
            FloorComparison(
                floor.floor,
                floor.quantity,
                time[compared_window],
                motion[compared_window],
                recorded[compared_window],
                event.base_in_band[compared_window],
            )
        )
    return tuple(comparisons)


def best_shift(event: Event, computed: Sequence[Array]) -> float:
    """Return the shift of the recordings (s) that maximizes the sum of the floors' correlations.

    The shift is first determined as a whole number of samples by cross-correlation, up to 10 s in
    both directions. It is then refined to fractions of a sample. A positive shift
    moves the recordings to later times. The shift is 0 if no floor has both a computed and a
    recorded motion, so that no correlation is defined.

    Parameters
    ----------
    computed : sequence of ndarray
        Computed motions of the recorded floors at the sampling times of the base.
    """
    dt, max_lag = event.base.dt, min(event.count - 1, round(_LONGEST_SHIFT / event.base.dt))
    correlation_sum = np.zeros(2 * max_lag + 1)
    # The transforms are padded with zeros, so that the cyclic correlation does not overlap.
    padded_size = 2 * event.count
    for floor in compared_floors(event, computed, 0.0):
        scale = float(np.linalg.norm(floor.computed) * np.linalg.norm(floor.recorded))
        if scale > 0.0:
            cross_spectrum = np.fft.rfft(floor.computed, padded_size) * np.conj(
                np.fft.rfft(floor.recorded, padded_size)
            )
            correlations = np.fft.irfft(cross_spectrum, padded_size)
            # Negative lags are at the end of the inverse transform.
            correlation_sum += (
                np.concatenate([correlations[padded_size - max_lag :], correlations[: max_lag + 1]])
                / scale
            )
    if not correlation_sum.any():
        return 0.0
    best_lag = int(np.argmax(correlation_sum)) - max_lag

    def negative_sum(lag: float) -> float:
        """Return the negative sum of the correlations for a shift of `lag` samples."""
        return -sum(compared.correlation for compared in compared_floors(event, computed, lag * dt))

    bounds = (best_lag - 1.0, best_lag + 1.0)
    return float(minimize_scalar(negative_sum, bounds=bounds, method="bounded").x) * dt


def _ratio(numerator: float, denominator: float) -> float:
    """Return the ratio of two values; nan if the denominator is not positive."""
    return numerator / denominator if denominator > 0.0 else float("nan")


def parse_requirement(text: str) -> tuple[str, float]:
    """Parse a requirement such as `correlation=0.9`, and return its name and its limit.

    Raises
    ------
    UsageError
        The text has another form, the name is unknown, or the number is not positive.
    """
    name, _, number = (part.strip() for part in text.partition("="))
    if name not in _REQUIREMENTS:
        hint = did_you_mean(name, _REQUIREMENTS) or f"; known: {', '.join(_REQUIREMENTS)}"
        raise UsageError(f"{text!r}: must have the form NAME=NUMBER, such as correlation=0.9{hint}")
    return name, parse_positive(name, number)


def unmet(comparison: Comparison, requirements: Sequence[tuple[str, float]]) -> list[str]:
    """Return a message for each requirement that a floor does not meet.

    Parameters
    ----------
    requirements : sequence of (str, float)
        Names of compared values (`correlation`, `peak_ratio` or `rms_difference`) with their
        limits, as from `parse_requirement`, which accepts only positive limits.
    """
    messages = []
    for floor in comparison.floors:
        for name, limit in requirements:
            is_met, condition = _REQUIREMENTS[name]
            value = float(getattr(floor, name))
            if is_met(value, limit):
                continue
            # A value of nan meets no limit, so that it counts as unmet. The other values need
            # enough digits to differ from the nearer bound: `peak_ratio` is also limited by the
            # inverse of the limit; for other names the inverse can only add unnecessary digits.
            low, high = min(limit, 1.0 / limit), max(limit, 1.0 / limit)
            nearest_limit = 1.0 / limit if abs(value - 1.0 / limit) < abs(value - limit) else limit
            messages.append(
                f"{comparison.event.recording.source}: floor {floor.floor}: {name} is "
                f"{number_text(value, unlike=nearest_limit)}, required is "
                f"{condition.format(limit=limit, low=low, high=high)}"
            )
    return messages
