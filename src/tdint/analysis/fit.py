"""The stiffnesses and damping ratios with which a model comes closest to a recorded event.

Least squares on the floors' histories have many minima: a mode that is off by a few percent loses
step with the recording. So the floors' smoothed Fourier spectra are fitted first, in logarithms,
which lead from far away; from there the histories are fitted (Levenberg 1944, Marquardt 1963, by
trust regions: Branch, Coleman and Li 1999).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from tdint.analysis import compare
from tdint.analysis.compare import Event
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.model.definition import (
    LAWS,
    Damping,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
)
from tdint.model.recorded import AUTO

FITTED = ("stiffness", "stiffness-factor", "damping")

_STIFFNESS, _COMMON = "stiffness_N_m", "stiffness_factor"
_UNITS = {_STIFFNESS: "N/m"}

_FACTOR = 10.0  # by which a stiffness may change, either way
_RATIOS = (1e-4, 0.5)
_DIFFERENCE_STEP = (
    1e-4  # change of the logarithm of a value for a numerical derivative, so relative to the value
)
_SCAN = np.geomspace(0.4, 2.5, 41)  # common factors of the stiffnesses to start from
_STARTS, _CANDIDATES = 3, 2
_BANDWIDTH = 0.1  # of the smoothing, in the logarithm of frequency, either side
_FREQUENCIES = 120  # places of the smoothed spectrum, in equal ratios
_LOWEST_CYCLES = 5  # periods of the lowest frequency of a spectrum that the recording holds
_UNTOLD = 0.1  # relative standard error from which a value is not told by the recording
_AT = 1e-2  # of a bound, on which a value lies
_STANDARD_ERRORS = 0.01  # of a value: so near its minimum a fit ends
_FAILED = 10.0  # rms difference of a run without result


@dataclass(frozen=True)
class FittedValue:
    """A value before and after the fit.

    Attributes
    ----------
    name : str
        `stiffness_N_m`, `stiffness_factor`, `damping_ratio`, or a Rayleigh coefficient:
        `mass_coefficient_1_s`, `stiffness_coefficient_s`.
    place : int or None
        The story or mode, from 1; None for a value that is common to all.
    start, value : float
        Before and after.
    low, high : float
        The bounds of the fit.
    standard_error : float
        Of the value, if what remains of the difference were independent from sample to sample; inf
        where the recording does not tell the value.
    """

    name: str
    place: int | None
    start: float
    value: float
    low: float
    high: float
    standard_error: float

    @property
    def on_bound(self) -> bool:
        """Whether the fit ended on one of its bounds."""
        return self.value <= self.low * (1.0 + _AT) or self.value >= self.high * (1.0 - _AT)

    @property
    def unit(self) -> str:
        """Of the value, in SI, as far as it has one that other units stand for; else 1."""
        return _UNITS.get(self.name, "1")


@dataclass(frozen=True)
class Fit:
    """A model fitted to an event: its values, the runs that it took, and what there is to say of
    it."""

    model: Model
    values: tuple[FittedValue, ...]
    runs: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Free:
    """A value that may change: its bounds, and the model with another one."""

    name: str
    place: int | None
    start: float
    bounds: tuple[float, float]
    put: Callable[[Model, float], Model]


def fit(
    model: Model,
    event: Event,
    names: Sequence[str],
    *,
    progress: Callable[[int], None] = lambda runs: None,
) -> Fit:
    """Fit a model to an event.

    Parameters
    ----------
    names : sequence of str
        What may change, of `FITTED`: the stiffness of each story (yield forces stay), or one factor
        on all of them; the values of `damping` as the model has them.
    progress : callable
        Told the number of runs so far.

    Raises
    ------
    UsageError
        Nothing or something unknown to fit, or a model that has no such values of its own.
    AnalysisError
        No run with such values has a result.
    """
    free = _free_values(model, names)
    problem = _Problem(model, event, free, progress)
    bounds = np.log([value.bounds for value in free]).T
    start = np.clip(np.log([value.start for value in free]), *bounds)
    candidates = []
    for first in _starts(
        problem, start, bounds, any(name.startswith("stiffness") for name in names)
    ):
        solution = _minimize(problem.spectral, first, bounds, xtol=1e-4, ftol=1e-4, max_nfev=15)
        candidates.append((solution.cost, solution.x))
    best = None
    for _, first in sorted(candidates, key=lambda candidate: float(candidate[0]))[:_CANDIDATES]:
        problem.settle_shift(first)
        # Within d standard errors of its minimum a sum of n squares is d^2 / n of itself above it.
        close = _STANDARD_ERRORS**2 / (len(event.floors) * event.count)
        # The gradient ends nothing: beside a recording without noise it is small long before the
        # minimum.
        solution = _minimize(problem.temporal, first, bounds, xtol=1e-12, ftol=close, gtol=None)
        if best is None or solution.cost < best.cost:
            best = solution
    assert best is not None
    if not best.cost < 0.5 * _FAILED:
        raise AnalysisError(
            "the fit found no values with which the model has a result; start from other ones"
        )
    errors = _standard_errors(best)
    values = tuple(
        FittedValue(
            value.name, value.place, value.start, math.exp(x), *value.bounds, math.exp(x) * error
        )
        for value, x, error in zip(free, best.x, errors, strict=True)
    )
    notes = [
        f"{_called(value)} is hardly told by the recording: its standard error is "
        + (f"{100.0 * error:.0f} %" if math.isfinite(error) else "beyond measure")
        for value, error in zip(values, errors, strict=True)
        if error > _UNTOLD
    ]
    notes += [
        f"{_called(value)} ended on a bound of the fit, {value.low:.4g} to {value.high:.4g}: the "
        "best value may lie beyond, or the model is another one"
        for value in values
        if value.on_bound
    ]
    return Fit(problem.model(best.x), values, problem.runs, tuple(notes))


class _Problem:
    """Differences between an event and the model with other values, given by their logarithms."""

    def __init__(
        self, model: Model, event: Event, free: Sequence[_Free], progress: Callable[[int], None]
    ) -> None:
        self._start, self._event, self.free, self._progress = model, event, free, progress
        self._method = "exact" if compare.is_linear(model) else None
        stated = event.recording.shift
        self._shift = 0.0 if stated == AUTO else float(stated)
        self._auto = stated == AUTO
        self.runs = 0

    def model(self, logarithms: Array) -> Model:
        """The model with these values."""
        model = self._start
        for value, logarithm in zip(self.free, logarithms, strict=True):
            model = value.put(model, math.exp(logarithm))
        return model

    def computed(self, logarithms: Array) -> list[Array] | None:
        """The floors' motions; None if the run has no result."""
        self.runs += 1
        self._progress(self.runs)
        try:
            case = compare.case_under(self.model(logarithms), self._event, self._method)
            return compare.computed_floors(
                compare.respond(case, None, self._event.recording.band), self._event
            )
        except AnalysisError:
            return None

    def settle_shift(self, logarithms: Array) -> None:
        """Find the shift of the recordings, if it is to be found."""
        computed = self.computed(logarithms) if self._auto else None
        if computed is not None:
            self._shift = compare.best_shift(self._event, computed)

    def temporal(self, logarithms: Array) -> Array:
        """Differences of the histories over the recording's rms; their squares sum to the mean over
        the floors."""
        computed = self.computed(logarithms)
        if computed is None:
            return np.full(self._event.count, _FAILED / math.sqrt(self._event.count))
        floors = compare.compared_floors(self._event, computed, self._shift)
        size = [
            math.sqrt(len(floors)) * (float(np.linalg.norm(floor.recorded)) or 1.0)
            for floor in floors
        ]
        return np.concatenate(
            [(floor.computed - floor.recorded) / of for floor, of in zip(floors, size, strict=True)]
        )

    def spectral(self, logarithms: Array) -> Array:
        """Differences of the logarithms of the smoothed Fourier spectra."""
        computed = self.computed(logarithms)
        if computed is None:
            return np.full(len(self._event.floors) * _FREQUENCIES, _FAILED)
        floors = compare.compared_floors(self._event, computed, self._shift)
        dt, band = self._event.base.dt, self._event.recording.band
        return np.concatenate(
            [
                _smoothed(floor.computed, dt, band) - _smoothed(floor.recorded, dt, band)
                for floor in floors
            ]
        )


def _minimize(
    residuals: Callable[[Array], Array], start: Array, bounds: Array, **limits: Any
) -> OptimizeResult:
    """Minimize the sum of squared residuals over logarithms of values, with forward differences.

    SciPy's own differences have a step relative to the variable. The variable is a logarithm here:
    it is 0 at a factor of 1, where the step vanishes and the derivatives are lost.

    Parameters
    ----------
    residuals : callable
        Residuals, shape (m,), as a function of the logarithms of the values, shape (n,).
    start : array, shape (n,)
        Logarithms to start from.
    bounds : array, shape (2, n)
        Lower and upper bounds of the logarithms.
    **limits
        Tolerances and limits of `scipy.optimize.least_squares`.
    """
    latest: dict[bytes, Array] = {}

    def evaluate(x: Array) -> Array:
        latest.clear()
        latest[x.tobytes()] = residuals(x)
        return latest[x.tobytes()]

    def derivatives(x: Array) -> Array:
        # SciPy has just evaluated the residuals at x, in general.
        base = latest[x.tobytes()] if x.tobytes() in latest else evaluate(x)
        steps = np.where(x + _DIFFERENCE_STEP <= bounds[1], _DIFFERENCE_STEP, -_DIFFERENCE_STEP)
        columns = [
            (residuals(x + step * unit) - base) / step
            for step, unit in zip(steps, np.eye(x.size), strict=True)
        ]
        return np.stack(columns, axis=1)

    return least_squares(evaluate, start, jac=derivatives, bounds=bounds, **limits)


def _starts(problem: _Problem, start: Array, bounds: Array, stiffness: bool) -> list[Array]:
    """Values to begin with: those given and, where stiffnesses are fitted, the best common factors
    on them."""
    if not stiffness:
        return [start]
    # The spectral misfit has several minima along a common factor: each low point of a scan is a
    # start.
    stiff = np.array([value.name in (_STIFFNESS, _COMMON) for value in problem.free])
    points = [np.clip(start + np.where(stiff, math.log(factor), 0.0), *bounds) for factor in _SCAN]
    costs = np.array([float(np.sum(problem.spectral(point) ** 2)) for point in points])
    lowest = [i for i in range(costs.size) if costs[i] == costs[max(0, i - 1) : i + 2].min()]
    return [start, *(points[i] for i in sorted(lowest, key=lambda i: float(costs[i]))[:_STARTS])]


def _smoothed(samples: Array, dt: float, band: tuple[float, float] | None) -> Array:
    """Logarithm of the smoothed Fourier amplitude at frequencies in equal ratios, shape
    (_FREQUENCIES,)."""
    low, high = band or (0.0, math.inf)
    low, high = max(low, _LOWEST_CYCLES / (samples.size * dt)), min(high, 0.4 / dt)
    power = np.abs(np.fft.rfft(samples)) ** 2
    frequency = np.fft.rfftfreq(samples.size, dt)
    total = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(frequency))])
    centers = np.geomspace(low, high, _FREQUENCIES)
    above, below = centers * math.exp(_BANDWIDTH), centers * math.exp(-_BANDWIDTH)
    mean = (np.interp(above, frequency, total) - np.interp(below, frequency, total)) / (
        above - below
    )
    return np.asarray(0.5 * np.log(np.maximum(mean, np.finfo(float).tiny)))


def _standard_errors(solution: object) -> Array:
    """Relative standard errors from the Jacobian at the minimum, shape (values,); inf where it
    tells nothing."""
    jacobian: Array = solution.jac  # type: ignore[attr-defined]
    rows, count = jacobian.shape
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    # Directions whose singular value is nothing but rounding are not told by the recording.
    told = singular > 1e-10 * singular[0]
    variance = 2.0 * float(solution.cost) / max(1, rows - count)  # type: ignore[attr-defined]
    with np.errstate(divide="ignore"):
        weights = np.where(told, variance / singular**2, 0.0)
    errors = np.sqrt(np.sum(directions**2 * weights[:, None], axis=0))
    return np.where(np.sum(directions[~told] ** 2, axis=0) > 1e-6, math.inf, errors)


def _free_values(model: Model, names: Sequence[str]) -> list[_Free]:
    unknown = [name for name in names if name not in FITTED]
    if unknown or not names:
        raise UsageError(
            f"fit {', '.join(FITTED)}, got {', '.join(map(repr, unknown)) or 'nothing'}"
        )
    free: list[_Free] = []
    if "stiffness" in names and "stiffness-factor" in names:
        raise UsageError(
            "fit stiffness or stiffness-factor: the stiffness of each story, or one factor on all "
            "of them"
        )
    if "stiffness-factor" in names:
        # One factor on the stiffnesses of all stories.
        every = [_stiffness(model, i) for i in range(len(model.stories))]

        def put(model: Model, value: float) -> Model:
            for story in every:
                model = story.put(model, value * story.start)
            return model

        free.append(_Free(_COMMON, None, 1.0, (1.0 / _FACTOR, _FACTOR), put))
    if "stiffness" in names:
        free += [_stiffness(model, i) for i in range(len(model.stories))]
    if "damping" in names:
        free += _damping(model.damping)
    return free


def _stiffness(model: Model, i: int) -> _Free:
    story = model.stories[i]
    if LAWS[story.law.name].initial_stiffness is not None:
        raise UsageError(
            f"{model.name}: the stiffness of story {i + 1} follows from its {story.law.name} law; "
            "it cannot be fitted"
        )

    def put(model: Model, value: float) -> Model:
        stories = list(model.stories)
        stories[i] = replace(stories[i], stiffness=value)
        return replace(model, stories=tuple(stories))

    start = story.stiffness
    return _Free(_STIFFNESS, i + 1, start, (start / _FACTOR, start * _FACTOR), put)


def _damping(damping: Damping) -> list[_Free]:
    """The values of the damping as the model has them; zeros (modes without damping) stay."""
    if damping is None:
        raise UsageError(
            "the model has no damping to be fitted; write one, such as damping: {modal: 0.02}"
        )
    # Coefficients have no natural size: they may change by three decades either way.
    if isinstance(damping, RayleighCoefficients):
        names = {"mass": "mass_coefficient_1_s", "stiffness": "stiffness_coefficient_s"}
        return [
            _Free(called, None, value, (value * 1e-3, value * 1e3), _set(name))
            for name, called in names.items()
            if (value := getattr(damping, name)) > 0.0
        ]
    modes = (
        damping.modes if isinstance(damping, RayleighRatio) else range(1, len(damping.ratios) + 1)
    )
    if isinstance(damping, ModalDamping) and len(damping.ratios) == 1:
        return [
            _Free("damping_ratio", None, max(damping.ratios[0], _RATIOS[0]), _RATIOS, _set_ratio(0))
        ]
    return [
        _Free("damping_ratio", mode, ratio, _RATIOS, _set_ratio(i))
        for i, (mode, ratio) in enumerate(zip(modes, damping.ratios, strict=True))
        if ratio > 0.0
    ]


def _set(name: str) -> Callable[[Model, float], Model]:
    return lambda model, value: replace(model, damping=replace(model.damping, **{name: value}))  # type: ignore[type-var]


def _set_ratio(i: int) -> Callable[[Model, float], Model]:
    def put(model: Model, value: float) -> Model:
        assert isinstance(model.damping, ModalDamping | RayleighRatio)
        ratios = list(model.damping.ratios)
        ratios[i] = value
        return replace(model, damping=replace(model.damping, ratios=tuple(ratios)))  # type: ignore[arg-type]

    return put


def _called(value: FittedValue) -> str:
    if value.place is None:
        return value.name
    return f"{value.name} of {'story' if value.name == _STIFFNESS else 'mode'} {value.place}"
