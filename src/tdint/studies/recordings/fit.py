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

from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.model.definition import Damping, ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.model.story_laws import LAWS
from tdint.studies.recordings import compare
from tdint.studies.recordings.compare import Event
from tdint.studies.recordings.recording_file import AUTO

FITTED = ("stiffness", "stiffness-factor", "damping")

_STIFFNESS, _STIFFNESS_FACTOR = "stiffness_N_m", "stiffness_factor"
_UNITS = {_STIFFNESS: "N/m"}

_MAX_FACTOR = 10.0  # maximum factor of increase or decrease of a stiffness
_DAMPING_BOUNDS = (1e-4, 0.5)  # bounds of a damping ratio
# Change of the logarithm of a value (relative change of the value) for a numerical derivative
_DIFFERENCE_STEP = 1e-4
_SCANNED_FACTORS = np.geomspace(0.4, 2.5, 41)  # common factors of the stiffnesses as start values
_MAX_SCANNED_STARTS = 3  # maximum number of these factors with which a fit of the spectra starts
_CONTINUED_FITS = 2  # number of best fits of the spectra that start the fits of the histories
_BANDWIDTH = 0.1  # half width of the smoothing, in the logarithm of frequency
_FREQUENCIES = 120  # number of frequencies of the smoothed spectrum, in equal ratios
# The lowest frequency of a spectrum has this number of periods within the recording
_LOWEST_CYCLES = 5
# Relative standard error above which a value is reported as poorly determined
_POORLY_DETERMINED = 0.1
_BOUND_DISTANCE = 1e-2  # relative distance from a bound within which a value is on the bound
_STANDARD_ERRORS = 0.01  # distance from the minimum, in standard errors, at which a fit ends
_FAILED_DIFFERENCE = 10.0  # rms difference assigned to a run without result


@dataclass(frozen=True)
class FittedValue:
    """Value before and after the fit.

    Attributes
    ----------
    name : str
        `stiffness_N_m`, `stiffness_factor`, `damping_ratio`, or a Rayleigh coefficient:
        `mass_coefficient_1_s`, `stiffness_coefficient_s`.
    standard_error : float
        Standard error of the value, if the residuals are independent from sample to sample; inf if
        the recording does not determine the value.
    """

    name: str
    number: int | None
    start: float
    value: float
    low: float
    high: float
    standard_error: float

    @property
    def on_bound(self) -> bool:
        """True if the fit ended on one of its bounds."""
        return self.value <= self.low * (1.0 + _BOUND_DISTANCE) or self.value >= self.high * (
            1.0 - _BOUND_DISTANCE
        )

    @property
    def unit(self) -> str:
        """SI unit of the value if it can be converted to other units, otherwise 1."""
        return _UNITS.get(self.name, "1")


@dataclass(frozen=True)
class Fit:
    """Result of a fit.

    Attributes
    ----------
    notes : tuple of str
        Notes on values that are poorly determined or on a bound.
    """

    model: Model
    values: tuple[FittedValue, ...]
    runs: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _FreeValue:
    """Value to be fitted.

    Attributes
    ----------
    name, place
        Name of the value, and number of the story or mode, as in `FittedValue`.
    set_in : callable
        Function of a model and a new value; it returns the model with the new value.
    """

    name: str
    number: int | None
    start: float
    bounds: tuple[float, float]
    set_in: Callable[[Model, float], Model]


def fit(model: Model, event: Event, names: Sequence[str]) -> Fit:
    """Fit a model to an event.

    Parameters
    ----------
    names : sequence of str
        Values to be fitted, from `FITTED`: the stiffness of each story (yield forces do not
        change), or a single factor on all stiffnesses; and the values of `damping` of the model.

    Raises
    ------
    UsageError
        No value or an unknown value is to be fitted, or the model has no such values.
    AnalysisError
        No run with such values has a result.
    """
    free_values = _free_values(model, names)
    problem = _Problem(model, event, free_values)
    is_stiffness_fitted = any(name.startswith("stiffness") for name in names)
    best = _best_solution(problem, is_stiffness_fitted)
    # The cost is half the sum of squares. A failed run has a cost of 0.5 _FAILED_DIFFERENCE^2, far
    # above this limit.
    if not best.cost < 0.5 * _FAILED_DIFFERENCE:
        raise AnalysisError(
            "no run of the fit has a result, for any of the tried values of stiffness and damping; "
            "start from other values in the model"
        )
    relative_errors = _standard_errors(best)
    values = tuple(
        FittedValue(
            value.name,
            value.number,
            value.start,
            math.exp(logarithm),
            *value.bounds,
            math.exp(logarithm) * relative_error,
        )
        for value, logarithm, relative_error in zip(
            free_values, best.x, relative_errors, strict=True
        )
    )
    notes = [
        f"{_label(value)} is poorly determined by the recording: its standard error is "
        + (f"{100.0 * relative_error:.0f} %" if math.isfinite(relative_error) else "infinite")
        for value, relative_error in zip(values, relative_errors, strict=True)
        if relative_error > _POORLY_DETERMINED
    ]
    notes += [
        f"{_label(value)} ended on a bound of the fit, {value.low:.4g} to {value.high:.4g}: the "
        "best value may be outside the bounds, or the model may be unsuitable"
        for value in values
        if value.on_bound
    ]
    return Fit(problem.model(best.x), values, problem.runs, tuple(notes))


def _best_solution(problem: _Problem, is_stiffness_fitted: bool) -> OptimizeResult:
    """Return the least-squares solution with the smallest difference between computed and recorded
    histories.

    The fits of the histories start from the `_CONTINUED_FITS` best fits of the spectra (module
    docstring).
    """
    event, free_values = problem.event, problem.free_values
    bounds = np.log([value.bounds for value in free_values]).T
    model_logarithms = np.clip(np.log([value.start for value in free_values]), *bounds)
    spectral_fits = []
    for start in _start_values(problem, model_logarithms, bounds, is_stiffness_fitted):
        solution = _minimize(
            problem.spectral_differences, start, bounds, xtol=1e-4, ftol=1e-4, max_nfev=15
        )
        spectral_fits.append((solution.cost, solution.x))
    spectral_fits.sort(key=lambda candidate: float(candidate[0]))
    best = None
    for _, start in spectral_fits[:_CONTINUED_FITS]:
        # An automatic time shift is determined again for each fit. The differences of both fits are
        # then comparable, because each is the smallest with its shift. Only the fitted values are
        # used later, and not the shift.
        problem.determine_shift(start)
        # At d standard errors from the minimum, a sum of n squares exceeds its minimum by the
        # fraction d^2 / n.
        cost_tolerance = _STANDARD_ERRORS**2 / (len(event.floors) * event.count)
        # The gradient is not used as a criterion: for a recording without noise it is small long
        # before the minimum.
        solution = _minimize(
            problem.history_differences, start, bounds, xtol=1e-12, ftol=cost_tolerance, gtol=None
        )
        if best is None or solution.cost < best.cost:
            best = solution
    assert best is not None
    return best


class _Problem:
    """Differences between an event and the model as functions of the logarithms of the values.

    Logarithms are used because the values are positive and have different magnitudes.
    """

    def __init__(self, model: Model, event: Event, free_values: Sequence[_FreeValue]) -> None:
        self._model = model
        self.event = event
        self.free_values = free_values
        # The method `exact` is the fastest for linear buildings and has no discretization error.
        # None selects the default method.
        self._method = "exact" if compare.is_linear(model) else None
        # Shift of the recordings to later times, s. An automatic shift is 0 until
        # `determine_shift` computes it.
        requested_shift = event.recording.shift
        self._shift = 0.0 if requested_shift == AUTO else float(requested_shift)
        self._has_automatic_shift = requested_shift == AUTO
        self.runs = 0

    def model(self, logarithms: Array) -> Model:
        """Return the model with the fitted values, which are given by their logarithms."""
        model = self._model
        for value, logarithm in zip(self.free_values, logarithms, strict=True):
            model = value.set_in(model, math.exp(logarithm))
        return model

    def computed(self, logarithms: Array) -> list[Array] | None:
        """Return the computed motions of the recorded floors; None if the run has no result."""
        self.runs += 1
        try:
            case = compare.case_under(self.model(logarithms), self.event, self._method)
            return compare.computed_floors(
                compare.respond(case, dt=None, band=self.event.recording.band), self.event
            )
        except AnalysisError:
            return None

    def determine_shift(self, logarithms: Array) -> None:
        """Update the time shift of the recordings for the given values, if the shift is automatic.

        The shift is not changed if the run has no result.
        """
        computed = self.computed(logarithms) if self._has_automatic_shift else None
        if computed is not None:
            self._shift = compare.best_shift(self.event, computed)

    def history_differences(self, logarithms: Array) -> Array:
        """Return the differences between computed and recorded histories, concatenated over the
        floors.

        They are scaled so that the sum of their squares is the mean over the floors of
        |computed - recorded|^2 / |recorded|^2. If the run has no result, the sum of squares is
        the square of `_FAILED_DIFFERENCE`.
        """
        computed = self.computed(logarithms)
        motions = computed or [np.zeros(self.event.count) for _ in self.event.floors]
        floors = compare.compared_floors(self.event, motions, self._shift)
        if computed is None:
            # Derivatives subtract these differences from differences of a run with a result. Both
            # need the same number of samples.
            size = sum(floor.time.size for floor in floors)
            return np.full(size, _FAILED_DIFFERENCE / math.sqrt(size))
        scales = [
            math.sqrt(len(floors)) * (float(np.linalg.norm(floor.recorded)) or 1.0)
            for floor in floors
        ]
        return np.concatenate(
            [
                (floor.computed - floor.recorded) / scale
                for floor, scale in zip(floors, scales, strict=True)
            ]
        )

    def spectral_differences(self, logarithms: Array) -> Array:
        """Return the differences between computed and recorded spectra, concatenated over the
        floors, shape (floors * _FREQUENCIES,).

        Each entry is the difference of the logarithms of the smoothed Fourier amplitudes at a
        single frequency.
        """
        computed = self.computed(logarithms)
        if computed is None:
            return np.full(len(self.event.floors) * _FREQUENCIES, _FAILED_DIFFERENCE)
        floors = compare.compared_floors(self.event, computed, self._shift)
        dt, band = self.event.base.dt, self.event.recording.band
        return np.concatenate(
            [
                _smoothed(floor.computed, dt, band) - _smoothed(floor.recorded, dt, band)
                for floor in floors
            ]
        )


def _minimize(
    residuals: Callable[[Array], Array], start: Array, bounds: Array, **limits: Any
) -> OptimizeResult:
    """Minimize the sum of squared residuals as a function of the logarithms of the fitted values.

    The derivatives are differences with the constant step `_DIFFERENCE_STEP`, forward, or backward
    at an upper bound. The differences of SciPy are not used: SciPy multiplies a specified step
    (`diff_step`) by the absolute value of the variable. The variable here is the logarithm, which
    is close to 0 for a value close to 1.
    """
    stored: dict[bytes, Array] = {}

    def evaluate(x: Array) -> Array:
        """Return the residuals at `x`, and store them for the derivatives."""
        stored.clear()
        stored[x.tobytes()] = residuals(x)
        return stored[x.tobytes()]

    def derivatives(x: Array) -> Array:
        """Return the Jacobian of the residuals by finite differences, shape (m, n)."""
        # SciPy has usually just evaluated the residuals at x: use these if they are still stored.
        base = stored[x.tobytes()] if x.tobytes() in stored else evaluate(x)
        differences = np.where(
            x + _DIFFERENCE_STEP <= bounds[1], _DIFFERENCE_STEP, -_DIFFERENCE_STEP
        )
        derivative_columns = [
            (residuals(x + difference * unit) - base) / difference
            for difference, unit in zip(differences, np.eye(x.size), strict=True)
        ]
        return np.stack(derivative_columns, axis=1)

    return least_squares(evaluate, start, jac=derivatives, bounds=bounds, **limits)


def _start_values(
    problem: _Problem, model_logarithms: Array, bounds: Array, fits_stiffness: bool
) -> list[Array]:
    """Return several start values for the fit of the spectra: the values of the model, then with
    all stiffnesses multiplied by up to three factors that are local minima of the spectral
    difference.
    """
    if not fits_stiffness:
        return [model_logarithms]
    # Along a common factor, the spectral difference has several local minima.
    is_stiffness = np.array(
        [value.name in (_STIFFNESS, _STIFFNESS_FACTOR) for value in problem.free_values]
    )
    scanned_points = [
        np.clip(model_logarithms + np.where(is_stiffness, math.log(factor), 0.0), *bounds)
        for factor in _SCANNED_FACTORS
    ]
    costs = np.array(
        [
            float(np.sum(problem.spectral_differences(scanned_point) ** 2))
            for scanned_point in scanned_points
        ]
    )
    # A local minimum is not larger than its two neighbors, or than one neighbor at an end.
    minima = [i for i in range(costs.size) if costs[i] == costs[max(0, i - 1) : i + 2].min()]
    return [
        model_logarithms,
        *(
            scanned_points[i]
            for i in sorted(minima, key=lambda i: float(costs[i]))[:_MAX_SCANNED_STARTS]
        ),
    ]


def _smoothed(samples: Array, dt: float, band: tuple[float, float] | None) -> Array:
    """Return the natural logarithm of the smoothed Fourier amplitude, shape (_FREQUENCIES,), at
    frequencies that are equally spaced on a logarithmic axis in `band` (Hz; None for all that the
    samples resolve).

    The squared amplitude is averaged over a band around each frequency.
    """
    low, high = band or (0.0, math.inf)
    # The limit 0.4 / dt is slightly below the Nyquist frequency 0.5 / dt, because the average at a
    # frequency includes higher frequencies.
    low, high = max(low, _LOWEST_CYCLES / (samples.size * dt)), min(high, 0.4 / dt)
    power = np.abs(np.fft.rfft(samples)) ** 2
    frequency = np.fft.rfftfreq(samples.size, dt)
    # The mean over a band is the difference of this integral at its limits, divided by its width.
    cumulative_power = np.concatenate(
        [[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(frequency))]
    )
    centers = np.geomspace(low, high, _FREQUENCIES)
    # The band around a frequency f extends from f exp(-_BANDWIDTH) to f exp(_BANDWIDTH).
    upper, lower = centers * math.exp(_BANDWIDTH), centers * math.exp(-_BANDWIDTH)
    mean_power = (
        np.interp(upper, frequency, cumulative_power)
        - np.interp(lower, frequency, cumulative_power)
    ) / (upper - lower)
    # Half the logarithm of the power is the logarithm of the amplitude. The maximum avoids log(0).
    return np.asarray(0.5 * np.log(np.maximum(mean_power, np.finfo(float).tiny)))


def _standard_errors(solution: object) -> Array:
    """Return the relative standard errors of the fitted values, shape (values,); inf for a value
    that the residuals do not determine.

    These are the square roots of the diagonal of the covariance matrix s^2 (J^T J)^-1 of the
    logarithms, with the Jacobian J of the residuals at the minimum and the variance s^2 of the
    residuals.
    """
    jacobian: Array = solution.jac  # type: ignore[attr-defined]
    residual_count, value_count = jacobian.shape
    # With fewer residuals than values, rows of zeros make J a square matrix, so that the
    # decomposition contains all directions of the values. They do not change J^T J.
    jacobian = np.pad(jacobian, ((0, max(0, value_count - residual_count)), (0, 0)))
    _, singular_values, directions = np.linalg.svd(jacobian, full_matrices=False)
    # The recording does not determine directions with singular values at the level of rounding.
    is_determined = singular_values > 1e-10 * singular_values[0]
    variance = 2.0 * float(solution.cost) / max(1, residual_count - value_count)  # type: ignore[attr-defined]
    # J = U S V^T, so (J^T J)^-1 = V S^-2 V^T; the rows of `directions` are the columns of V.
    with np.errstate(divide="ignore"):
        variances = np.where(is_determined, variance / singular_values**2, 0.0)
    errors = np.sqrt(np.sum(directions**2 * variances[:, None], axis=0))
    # A value with a component in a direction that is not determined is not determined either.
    return np.where(np.sum(directions[~is_determined] ** 2, axis=0) > 1e-6, math.inf, errors)


def _free_values(model: Model, names: Sequence[str]) -> list[_FreeValue]:
    """Return the values of a model to be fitted, with their bounds; raise UsageError for invalid
    names or a model without such values.
    """
    unknown = [name for name in names if name not in FITTED]
    if unknown or not names:
        raise UsageError(
            f"the fitted parameters must be one or more of {', '.join(FITTED)}, got "
            f"{', '.join(map(repr, unknown)) or 'none'}"
        )
    free_values: list[_FreeValue] = []
    if "stiffness" in names and "stiffness-factor" in names:
        raise UsageError(
            "stiffness (of each story) and stiffness-factor (one factor for all stories) cannot be "
            "fitted together; specify only one name"
        )
    if "stiffness-factor" in names:
        story_stiffnesses = [_stiffness(model, i) for i in range(len(model.stories))]

        def set_factor(model: Model, factor: float) -> Model:
            """Return a copy of the model with all initial stiffnesses multiplied by a factor."""
            for story in story_stiffnesses:
                model = story.set_in(model, factor * story.start)
            return model

        free_values.append(
            _FreeValue(_STIFFNESS_FACTOR, None, 1.0, (1.0 / _MAX_FACTOR, _MAX_FACTOR), set_factor)
        )
    if "stiffness" in names:
        free_values += [_stiffness(model, i) for i in range(len(model.stories))]
    if "damping" in names:
        free_values += _damping(model.damping)
    return free_values


def _stiffness(model: Model, i: int) -> _FreeValue:
    """Return the stiffness of story `i` (from 0) as a value to be fitted; raise UsageError if the
    law of the story determines it.
    """
    story = model.stories[i]
    if story.elements:
        raise UsageError(
            f"{model.name}: the stiffness of story {i + 1} cannot be fitted, because it is the sum "
            f"of {len(story.elements)} elements; fit only damping, or write the story as one law"
        )
    if LAWS[story.law.name].initial_stiffness is not None:
        raise UsageError(
            f"{model.name}: the stiffness of story {i + 1} cannot be fitted, because it follows "
            f"from the parameters of its {story.law.name} law; fit only damping, or use another law"
        )

    def set_stiffness(model: Model, stiffness: float) -> Model:
        """Return a copy of the model with another stiffness (N/m) of story `i`."""
        stories = list(model.stories)
        stories[i] = replace(stories[i], stiffness=stiffness)
        return replace(model, stories=tuple(stories))

    start = story.stiffness
    return _FreeValue(
        _STIFFNESS, i + 1, start, (start / _MAX_FACTOR, start * _MAX_FACTOR), set_stiffness
    )


def _damping(damping: Damping) -> list[_FreeValue]:
    """Return the positive coefficients or ratios of the damping as values to be fitted; raise
    UsageError without damping.

    Zeros, for example of modes without damping, remain zero.
    """
    if damping is None:
        raise UsageError(
            "the model has no damping to be fitted; add damping, such as damping: {modal: 0.02}"
        )
    # Coefficients have no typical size: they may change by three decades in both directions.
    if isinstance(damping, RayleighCoefficients):
        coefficient_labels = {
            "mass": "mass_coefficient_1_s",
            "stiffness": "stiffness_coefficient_s",
        }
        return [
            _FreeValue(label, None, value, (value * 1e-3, value * 1e3), _coefficient_setter(name))
            for name, label in coefficient_labels.items()
            if (value := getattr(damping, name)) > 0.0
        ]
    # A single modal ratio applies to all modes. A ratio of 0 is raised to the lower bound, because
    # its logarithm is fitted.
    if isinstance(damping, ModalDamping) and len(damping.ratios) == 1:
        start = max(damping.ratios[0], _DAMPING_BOUNDS[0])
        return [_FreeValue("damping_ratio", None, start, _DAMPING_BOUNDS, _ratio_setter(0))]
    modes = (
        damping.modes if isinstance(damping, RayleighRatio) else range(1, len(damping.ratios) + 1)
    )
    return [
        _FreeValue("damping_ratio", mode, ratio, _DAMPING_BOUNDS, _ratio_setter(i))
        for i, (mode, ratio) in enumerate(zip(modes, damping.ratios, strict=True))
        if ratio > 0.0
    ]


def _coefficient_setter(name: str) -> Callable[[Model, float], Model]:
    """Return the function that sets a coefficient of Rayleigh damping in a model."""
    return lambda model, value: replace(model, damping=replace(model.damping, **{name: value}))  # type: ignore[type-var]


def _ratio_setter(i: int) -> Callable[[Model, float], Model]:
    """Return the function that sets damping ratio `i` (from 0) in a model."""

    def set_ratio(model: Model, ratio: float) -> Model:
        """Return a copy of the model with another damping ratio `i`."""
        assert isinstance(model.damping, ModalDamping | RayleighRatio)
        ratios = list(model.damping.ratios)
        ratios[i] = ratio
        return replace(model, damping=model.damping._replace(ratios=tuple(ratios)))

    return set_ratio


def _label(value: FittedValue) -> str:
    """Return the name of a value with its story or mode, for messages."""
    if value.number is None:
        return value.name
    return f"{value.name} of {'story' if value.name == _STIFFNESS else 'mode'} {value.number}"
