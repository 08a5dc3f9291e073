"""A result beside a recording: what both have in common on each floor, in numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from tdint.analysis.comparison.event import Event
from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import Response
from tdint.analysis.run.run import prepare
from tdint.analysis.spectra.elastic import spectrum
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError, did_you_mean
from tdint.ground_motion.reading.scale import differentiated
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import model_of
from tdint.model.definition import Excitation, Model
from tdint.model.recorded import AUTO, load_recording
from tdint.tabular import Tabular
from tdint.written_numbers import how_many, parse_positive

_LONGEST_SHIFT = 10.0
"""s; clocks that are further apart are no matter of a shift."""

_ROUNDING = 1e-6

_BETTER = 0.05
"""By how much a correlation must rise to say that a displacement seems to be absolute."""

_SHORT = 0.25
"""omega dt of a step that is short for a mode: errors of the fourth order are below 1e-4 there."""

_MOST_PARTS = 64

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
    """A floor's motion as it was computed and as it was recorded, over the times at which both are compared.

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
        return _correlation(self.computed, self.recorded)

    @property
    def peak_ratio(self) -> float:
        """Largest absolute value computed over that recorded; nan where nothing was recorded."""
        return _ratio(float(np.max(np.abs(self.computed))), float(np.max(np.abs(self.recorded))))

    @property
    def rms_difference(self) -> float:
        """Root mean square of the difference over that of the recording; nan where nothing was recorded."""
        difference = float(np.sqrt(np.mean((self.computed - self.recorded) ** 2)))
        return _ratio(difference, float(np.sqrt(np.mean(self.recorded**2))))


@dataclass(frozen=True)
class FloorSpectra:
    """Response spectra of a floor's absolute acceleration, computed and recorded, m/s^2, shape (k,)."""

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
        least, floors = min(one.correlation for one in self.floors), how_many(len(self.floors), "floor")
        return f"of {self.response.model.name!r}: {floors}, correlations of {least:.3f} and more"

    def spectra(self, periods: Array, damping: float) -> tuple[FloorSpectra, ...]:
        """Response spectra of the floors' absolute accelerations, of the part that is compared.

        A displacement is differentiated for it, and the base's acceleration added.
        """

        def largest(floor: FloorComparison, motion: Array) -> Array:
            dt = self.event.base.dt
            if floor.quantity == "displacement":
                motion = differentiated(motion, dt, floor.quantity) + floor.base
            return spectrum(Record(motion, dt, "", "", "", self.event.recording.source), periods, damping).sa

        return tuple(
            FloorSpectra(one.floor, periods, largest(one, one.computed), largest(one, one.recorded))
            for one in self.floors
        )


def absolute_displacements(comparison: Comparison) -> list[str]:
    """A sentence for each floor whose recorded displacement agrees much better once the base's is subtracted."""
    event, found = comparison.event, []
    for one in comparison.floors:
        if one.quantity != "displacement":
            continue
        first = round(one.time[0] / event.base.dt)
        base = event.base_displacement[first : first + one.time.size]
        relative = replace(one, recorded=one.recorded - base)
        if relative.correlation > one.correlation + _BETTER and relative.rms_difference < one.rms_difference:
            found.append(
                f"floor {one.floor}: less the base's displacement the recording has a correlation of "
                f"{relative.correlation:.3f} instead of {one.correlation:.3f}: it seems to be absolute, and a "
                "displacement is compared relative to the base; subtract the base's from it in the file"
            )
    return found


def compare(
    model: Any,
    event: Event | str | Path,
    *,
    method: str | None = None,
    dt: float | None = None,
    shift: float | None = None,
) -> Comparison:
    """Integrate a model under the base's motion of an event, and set the floors beside what was recorded.

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
        wanted = event.recording.shift
        shift = best_shift(event, computed) if wanted == AUTO else float(wanted)
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
    linear = all(story.law.name == "linear" and story.power_dashpot is None for story in model.stories)
    return linear and not model.excitation.forces


def respond(case: Case, dt: float | None, band: tuple[float, float] | None = None) -> Response:
    """The response over the whole of the base's motion, with its history.

    Without a step it is the base's sampling interval, or a part of it that is short for all modes within the band:
    what the method errs is not to be seen beside the recording.
    """
    record = case.record
    assert record is not None
    if dt is None:
        fastest = min(case.building.fastest, 2.0 * math.pi * band[1] if band else math.inf)
        exact = case.integrator.family.linear_only
        parts = 1 if exact else 2 ** max(0, math.ceil(math.log2(fastest * record.dt / _SHORT)))
        dt = record.dt / min(parts, _MOST_PARTS)
    steps = case.steps(dt, record.duration)
    if steps.h > record.dt * (1.0 + _ROUNDING):
        raise UsageError(
            f"dt {steps.h:.6g} s is longer than the recording's sampling interval, {record.dt:.6g} s; a comparison "
            "needs a result at every sample: use that or a whole part of it"
        )
    return case.march(steps, history=True)


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
            f"{response.model.name}: the building collapsed after {history.time[-1]:.6g} s, before the recording ends; "
            "there is nothing to compare"
        )
    motions = {"acceleration": history.acceleration, "displacement": history.displacement}
    return [
        event.filtered(motions[one.quantity][::every, one.floor - 1].astype(np.float64), one.quantity)
        for one in event.floors
    ]


def compared_floors(event: Event, computed: Sequence[Array], shift: float) -> tuple[FloorComparison, ...]:
    """The floors where and when both motions are known."""
    result = []
    time = np.arange(event.count, dtype=np.float64) * event.base.dt
    for floor, motion in zip(event.floors, computed, strict=True):
        recorded = floor.at(event.base.dt, event.count, shift)
        part = event.window(recorded, floor.signal.label)
        result.append(
            FloorComparison(
                floor.floor, floor.quantity, time[part], motion[part], recorded[part], event.base_in_band[part]
            )
        )
    return tuple(result)


def best_shift(event: Event, computed: Sequence[Array]) -> float:
    """What added to the times of the recordings (s) brings the floors' correlation with the result to its largest sum.

    The best whole number of samples first (by the cross-correlation), then parts of one.
    """
    dt, most = event.base.dt, min(event.count - 1, round(_LONGEST_SHIFT / event.base.dt))
    total = np.zeros(2 * most + 1)
    size = 2 * event.count
    for one in compared_floors(event, computed, 0.0):
        scale = float(np.linalg.norm(one.computed) * np.linalg.norm(one.recorded))
        if scale > 0.0:
            product = np.fft.rfft(one.computed, size) * np.conj(np.fft.rfft(one.recorded, size))
            lags = np.fft.irfft(product, size)
            total += np.concatenate([lags[size - most :], lags[: most + 1]]) / scale
    whole = int(np.argmax(total)) - most

    def apart(parts: float) -> float:
        return -sum(one.correlation for one in compared_floors(event, computed, parts * dt))

    return float(minimize_scalar(apart, bounds=(whole - 1.0, whole + 1.0), method="bounded").x) * dt


def _correlation(a: Array, b: Array) -> float:
    a, b = a - np.mean(a), b - np.mean(b)
    return _ratio(float(a @ b), float(np.linalg.norm(a) * np.linalg.norm(b)))


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
        f"{comparison.event.recording.source}: floor {floor.floor}: {name} is {value:.4g}, required is "
        + words.format(limit=limit)
        for floor in comparison.floors
        for name, limit in requirements
        for meets, words in [_MET[name]]
        if not meets(value := float(getattr(floor, name)), limit)
    ]
