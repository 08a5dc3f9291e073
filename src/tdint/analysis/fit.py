"""Estimation of stiffnesses and damping ratios of a model from a recorded event.

The sum of squared differences of the floors' histories has many minima: a mode with a frequency
error of a few percent loses phase with the recording. Therefore the logarithms of the smoothed
Fourier spectra are fitted first, which converges from distant start values. The histories are
fitted from the result (Levenberg 1944, Marquardt 1963; trust regions: Branch, Coleman and Li 1999).
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

_FACTOR = 10.0  # maximum factor by which a stiffness may increase or decrease
_RATIOS = (1e-4, 0.5)
# Change of the logarithm of a value (relative change of the value) for a numerical derivative
_DIFFERENCE_STEP = 1e-4
_SCAN = np.geomspace(0.4, 2.5, 41)  # common factors of the stiffnesses as start values
_STARTS, _CANDIDATES = 3, 2
_BANDWIDTH = 0.1  # half width of the smoothing, in the logarithm of frequency
_FREQUENCIES = 120  # number of frequencies of the smoothed spectrum, in equal ratios
_LOWEST_CYCLES = 5  # periods of the lowest frequency of a spectrum within the recording
_UNTOLD = 0.1  # relative standard error above which a value is reported as poorly determined
_AT = 1e-2  # relative distance from a bound within which a value is on the bound
_STANDARD_ERRORS = 0.01  # distance from the minimum, in standard errors, at which a fit ends
_FAILED = 10.0  # rms difference assigned to a run without result


@dataclass(frozen=True)
class FittedValue:
    """Value before and after the fit.

    Attributes
    ----------
    name : str
        `stiffness_N_m`, `stiffness_factor`, `damping_ratio`, or a Rayleigh coefficient:
        `mass_coefficient_1_s`, `stiffness_coefficient_s`.
    place : int or None
        Number of the story or mode, from 1; None for a value common to all of them.
    start, value : float
        Value before and after the fit.
    low, high : float
        Bounds of the fit.
    standard_error : float
        Standard error of the value, if the residuals are independent from sample to sample; inf if
        the recording does not determine the value.
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
        """True if the fit ended on one of its bounds."""
        return self.value <= self.low * (1.0 + _AT) or self.value >= self.high * (1.0 - _AT)

    @property
    def unit(self) -> str:
        """SI unit of the value if it can be converted to other units, otherwise 1."""
        return _UNITS.get(self.name, "1")


@dataclass(frozen=True)
class Fit:
    """Model fitted to an event, with its values, the number of runs, and notes."""

    model: Model
    values: tuple[FittedValue, ...]
    runs: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Free:
    """Value that may change, with its bounds and a function that sets it in a model."""

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
    model : Model
        Model of the building.
    event : Event
        Recorded event.
    names : sequence of str
        Values to be fitted, from `FITTED`: the stiffness of each story (yield forces do not
        change), or one factor on all stiffnesses; and the values of `damping` of the model.
    progress : callable
        Callback with the number of completed runs.

    Raises
    ------
    UsageError
        No value or an unknown value is to be fitted, or the model has no such values.
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
        # A sum of n squares within d standard errors of its minimum exceeds it by d^2 / n.
        close = _STANDARD_ERRORS**2 / (len(event.floors) * event.count)
        # The gradient is not used as a criterion: for a recording without noise it is small long
        # before the minimum.
        solution = _minimize(problem.temporal, first, bounds, xtol=1e-12, ftol=close, gtol=None)
        if best is None or solution.cost < best.cost:
            best = solution
    assert best is not None
    if not best.cost < 0.5 * _FAILED:
        raise AnalysisError(
            "no values were found for which the model has a result; start from other values"
        )
    errors = _standard_errors(best)
    values = tuple(
        FittedValue(
            value.name, value.place, value.start, math.exp(x), *value.bounds, math.exp(x) * error
        )
        for value, x, error in zip(free, best.x, errors, strict=True)
    )
    notes = [
        f"{_label(value)} is poorly determined by the recording: its standard error is "
        + (f"{100.0 * error:.0f} %" if math.isfinite(error) else "infinite")
        for value, error in zip(values, errors, strict=True)
        if error > _UNTOLD
    ]
    notes += [
        f"{_label(value)} ended on a bound of the fit, {value.low:.4g} to {value.high:.4g}: the "
        "best value may be outside the bounds, or the model may be unsuitable"
        for value in values
        if value.on_bound
    ]
    return Fit(problem.model(best.x), values, problem.runs, tuple(notes))


class _Problem:
    """Differences between an event and the model as functions of the logarithms of the values."""

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
        """Return the model for the logarithms of the fitted values."""
        model = self._start
        for value, logarithm in zip(self.free, logarithms, strict=True):
            model = value.put(model, math.exp(logarithm))
        return model

    def computed(self, logarithms: Array) -> list[Array] | None:
        """Return the computed motions of the floors for the logarithms of the fitted values; None
        if the run has no result."""
        self.runs += 1
        self._progress(self.runs)
        try:
            case = compare.case_under(self.model(logarithms), self._event, self._method)
            return compare.computed_floors(
                compare.respond(case, dt=None, band=self._event.recording.band), self._event
            )
        except AnalysisError:
            return None

    def settle_shift(self, logarithms: Array) -> None:
        """Compute the shift of the recordings, if it is automatic."""
        computed = self.computed(logarithms) if self._auto else None
        if computed is not None:
            self._shift = compare.best_shift(self._event, computed)

    def temporal(self, logarithms: Array) -> Array:
        """Return differences of the histories over the rms of the recordings.

        The sum of their squares is the mean over the floors.
        """
        computed = self.computed(logarithms)
        if computed is None:
            return np.full(self._event.count, _FAILED / math.sqrt(self._event.count))
        floors = compare.compared_floors(self._event, computed, self._shift)
        size = [
            math.sqrt(len(floors)) * (float(np.linalg.norm(floor.recorded)) or 1.0)
            for floor in floors
        ]
        return np.concatenate(
            [
                (floor.computed - floor.recorded) / scale
                for floor, scale in zip(floors, size, strict=True)
            ]
        )

    def spectral(self, logarithms: Array) -> Array:
        """Return differences of the logarithms of the smoothed Fourier spectra."""
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
        # SciPy has usually just evaluated the residuals at x: use these if they are still stored.
        base = latest[x.tobytes()] if x.tobytes() in latest else evaluate(x)
        steps = np.where(x + _DIFFERENCE_STEP <= bounds[1], _DIFFERENCE_STEP, -_DIFFERENCE_STEP)
        columns = [
            (residuals(x + step * unit) - base) / step
            for step, unit in zip(steps, np.eye(x.size), strict=True)
        ]
        return np.stack(columns, axis=1)

    return least_squares(evaluate, start, jac=derivatives, bounds=bounds, **limits)


def _starts(problem: _Problem, start: Array, bounds: Array, stiffness: bool) -> list[Array]:
    """Return start values: the values of the model, and the best common factors on stiffnesses.

    Parameters
    ----------
    problem : _Problem
        Differences to be minimized.
    start : ndarray, shape (n,)
        Logarithms of the values of the model.
    bounds : ndarray, shape (2, n)
        Bounds of the logarithms.
    stiffness : bool
        True if stiffnesses are fitted.
    """
    if not stiffness:
        return [start]
    # The spectral difference has several minima along a common factor. Each local minimum of a scan
    # is a start.
    stiff = np.array([value.name in (_STIFFNESS, _COMMON) for value in problem.free])
    points = [np.clip(start + np.where(stiff, math.log(factor), 0.0), *bounds) for factor in _SCAN]
    costs = np.array([float(np.sum(problem.spectral(point) ** 2)) for point in points])
    lowest = [i for i in range(costs.size) if costs[i] == costs[max(0, i - 1) : i + 2].min()]
    return [start, *(points[i] for i in sorted(lowest, key=lambda i: float(costs[i]))[:_STARTS])]


def _smoothed(samples: Array, dt: float, band: tuple[float, float] | None) -> Array:
    """Return the logarithm of the smoothed Fourier amplitude, shape (_FREQUENCIES,).

    Parameters
    ----------
    samples : ndarray
        Samples of a motion.
    dt : float
        Sampling interval, s.
    band : tuple of two floats or None
        Range of the frequencies, Hz.
    """
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
    """Return relative standard errors from the Jacobian at the minimum, shape (values,).

    The standard error is inf if the Jacobian does not determine a value.
    """
    jacobian: Array = solution.jac  # type: ignore[attr-defined]
    rows, count = jacobian.shape
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    # The recording does not determine directions with singular values at the level of rounding.
    determined = singular > 1e-10 * singular[0]
    variance = 2.0 * float(solution.cost) / max(1, rows - count)  # type: ignore[attr-defined]
    with np.errstate(divide="ignore"):
        weights = np.where(determined, variance / singular**2, 0.0)
    errors = np.sqrt(np.sum(directions**2 * weights[:, None], axis=0))
    return np.where(np.sum(directions[~determined] ** 2, axis=0) > 1e-6, math.inf, errors)


def _free_values(model: Model, names: Sequence[str]) -> list[_Free]:
    """Return the values of a model that may change, with their bounds."""
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
        # A single factor applies to the stiffnesses of all stories.
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
    """Return the stiffness of story `i` (from 0) as a value that may change."""
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
    """Return the values of the damping of a model; zeros (modes without damping) are not fitted."""
    if damping is None:
        raise UsageError(
            "the model has no damping to be fitted; add damping, such as damping: {modal: 0.02}"
        )
    # Coefficients have no typical size: they may change by three decades in both directions.
    if isinstance(damping, RayleighCoefficients):
        names = {"mass": "mass_coefficient_1_s", "stiffness": "stiffness_coefficient_s"}
        return [
            _Free(label, None, value, (value * 1e-3, value * 1e3), _set(name))
            for name, label in names.items()
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
    """Return the function that sets a coefficient of Rayleigh damping in a model."""
    return lambda model, value: replace(model, damping=replace(model.damping, **{name: value}))  # type: ignore[type-var]


def _set_ratio(i: int) -> Callable[[Model, float], Model]:
    """Return the function that sets the damping ratio `i` in a model."""

    def put(model: Model, value: float) -> Model:
        assert isinstance(model.damping, ModalDamping | RayleighRatio)
        ratios = list(model.damping.ratios)
        ratios[i] = value
        return replace(model, damping=replace(model.damping, ratios=tuple(ratios)))  # type: ignore[arg-type]

    return put


def _label(value: FittedValue) -> str:
    """Return the name of a value with its story or mode, for messages."""
    if value.place is None:
        return value.name
    return f"{value.name} of {'story' if value.name == _STIFFNESS else 'mode'} {value.place}"
