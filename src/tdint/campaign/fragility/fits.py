"""Fragility functions: lognormal distributions of the intensity at which a threshold is exceeded,
fitted three ways.

Stripes: numbers of exceedances at levels of intensity (Baker 2015, Earthquake Spectra 31(1), doi
10.1193/021113EQS025M). Capacities of an incremental dynamic analysis: by their moments, or if some
are censored by maximum likelihood (Baker 2015, eq. 9). Cloud: a line through the logarithms of
demand over intensity (Jalayer 2003), with demands that are known only to lie above a limit, or
below one.

The likelihoods are those of normal observations, some of which are known only to lie below or above
a value. Each observation i has z_i = x_i . p, linear in the parameters, which makes the logarithm
of the likelihood concave (Pratt 1981; Olsen 1978): Newton's iteration finds its one maximum. A
value that is known adds ln p_s - z^2 / 2, with p_s the parameter that is 1 / sigma; one known to be
below adds ln Phi(z), one above ln Phi(-z).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtr

from tdint.analysis.given import between
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.units import ACCELERATION, LENGTH, VELOCITY, OutputUnits
from tdint.written_numbers import LARGEST, first_few, how_many

_ITERATIONS = 200
_CONVERGED = 1e-13
"""Of Newton's decrement, twice the distance of the likelihood's logarithm from its maximum; the
next is its square."""

_SHORTEST = 1e-12
"""Part of a step below which there is no rise: the maximum is where 1 / sigma is not positive."""

_FLATTEST = 1e-12
"""Least curvature over the largest, scaled to equal diagonals: below it there is no one maximum."""


@dataclass(frozen=True)
class Observations:
    """Observations of a model that is linear in its parameters.

    Attributes
    ----------
    design : ndarray, shape (n, k)
        z = design @ parameters.
    below, above : ndarray of bool, shape (n,)
        Those whose value is known only to be below, or above, what the design has; known exactly if
        neither.
    count : ndarray, shape (n,)
        How often each was made.
    inverse_sigma : int
        The place of the parameter that is 1 / sigma.
    """

    design: Array
    below: NDArray[np.bool_]
    above: NDArray[np.bool_]
    count: Array
    inverse_sigma: int

    @property
    def known(self) -> float:
        """How many values are known exactly."""
        return float(np.sum(self.count[~(self.below | self.above)]))

    def logarithm(self, parameters: Array) -> float:
        """Logarithm of the likelihood but for a constant; -inf where 1 / sigma is not positive."""
        rate = float(parameters[self.inverse_sigma])
        if not rate > 0.0:
            return -math.inf
        z = self.design @ parameters
        terms = np.where(self.below, log_ndtr(z), np.where(self.above, log_ndtr(-z), -0.5 * z * z))
        return float(np.sum(self.count * terms)) + self.known * math.log(rate)

    def derivatives(self, parameters: Array) -> tuple[Array, Array]:
        """Gradient and Hessian of the logarithm, shapes (k,) and (k, k)."""
        # Ratios of density to distribution by logarithms: far out both underflow.
        z = self.design @ parameters
        hazard_below, hazard_above = (
            np.exp(-0.5 * y * y - log_ndtr(y)) / math.sqrt(2.0 * math.pi) for y in (z, -z)
        )
        first = np.where(self.below, hazard_below, np.where(self.above, -hazard_above, -z))
        second = np.where(
            self.below,
            -hazard_below * (hazard_below + z),
            np.where(self.above, -hazard_above * (hazard_above - z), -1.0),
        )
        # Each exact value brings a factor 1 / sigma into the likelihood.
        rate, place = float(parameters[self.inverse_sigma]), self.inverse_sigma
        gradient = self.design.T @ (self.count * first)
        hessian = (self.design.T * (self.count * second)) @ self.design
        gradient[place] += self.known / rate
        hessian[place, place] -= self.known / rate**2
        return gradient, hessian


def maximize(observations: Observations, start: Array) -> tuple[Array, Array] | None:
    """The parameters of the largest likelihood, shape (k,), and the inverse of the observed
    information, shape (k, k).

    Parameters
    ----------
    start : ndarray, shape (k,)
        Parameters to begin with, 1 / sigma positive.

    Returns
    -------
    tuple or None
        None where there is no maximum at finite parameters.
    """
    parameters = np.asarray(start, float)
    value = observations.logarithm(parameters)
    for _ in range(_ITERATIONS):
        # Newton's steps on a concave function: a flat Hessian means that it has no maximum.
        gradient, hessian = observations.derivatives(parameters)
        if not (np.isfinite(gradient).all() and np.isfinite(hessian).all()) or _is_flat(hessian):
            return None
        step = np.linalg.solve(-hessian, gradient)
        decrement = float(gradient @ step)
        if decrement <= _CONVERGED * max(
            1.0, abs(value)
        ):  # The last step: beyond it floats show no rise.
            return parameters + step, np.asarray(np.linalg.inv(-hessian), float)
        length = 1.0
        # A step that does not rise went too far: halved until it does.
        while not (moved := observations.logarithm(parameters + length * step)) > value:
            length *= 0.5
            if length < _SHORTEST:
                return None
        parameters, value = parameters + length * step, moved
    return None


def _is_flat(hessian: Array) -> bool:
    """Whether some direction has no curvature: the likelihood rises for ever, or does not tell the
    parameters apart."""
    diagonal = -np.diagonal(hessian)
    if not np.all(diagonal > 0.0):
        return True
    scale = 1.0 / np.sqrt(diagonal)
    curvatures = np.linalg.eigvalsh(-hessian * np.outer(scale, scale))
    return bool(curvatures[0] <= _FLATTEST * curvatures[-1])


STRIPES, IDA, CLOUD = "stripes", "ida", "cloud"
FITS = (STRIPES, IDA, CLOUD)
_EQUAL = 1e-9  # dispersions below this are rounding
_MOST_NAMES = 10  # that a message names
_TWO_SIDED = (
    1.959963984540054  # 95 % of a normal distribution lie within so many standard deviations
)

SAME_LEVEL = 1e-6
"""Intensities that differ by less than this part are one level."""

BINS = 6
"""Of the intensity, in which runs beyond a state are counted: fewer hide a bend, more have few
motions each."""

_APART = 3.0
"""Standard errors between function and count that are told: of 80 bins (four types, four states)
scatter alone has one so far off in every fifth study."""


@dataclass(frozen=True)
class Points:
    """What a picture shows of the observations behind a fit: intensities and the part that exceeds,
    both shape (k,)."""

    im: Array
    part: Array


SELDOM = 0.1
"""Share of runs beyond a state, and short of it, that tells a median: with fewer it hangs on the
shape of the function, which few runs do not show."""


@dataclass(frozen=True)
class Counted:
    """What was counted in bins of the intensity, shape (k,): the intensity in its middle (geometric
    mean of the runs), runs, the share of them beyond the state, the share that the function has
    there, and by how much both may part for want of runs: a standard error and half a motion."""

    im: Array
    runs: Array
    share: Array
    fitted: Array
    error: Array
    half: Array

    @property
    def apart(self) -> Array:
        """By how many standard errors function and count part, half a motion left out."""
        beyond = np.abs(self.share - self.fitted) - self.half
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(beyond > 0.0, beyond / self.error, 0.0)

    @property
    def bound(self) -> Array:
        """By how much function and count may part before it is told."""
        return _APART * self.error + self.half


@dataclass(frozen=True)
class CloudPoints:
    """The observations of a cloud: intensities, demands, which of these are censored and which
    count only as below the lightest state, all shape (n,); the line ln EDP = intercept + slope ln
    IM with its standard deviation."""

    im: Array
    edp: Array
    censored: NDArray[np.bool_]
    below: NDArray[np.bool_]
    intercept: float
    slope: float
    sigma: float

    @property
    def light(self) -> int:
        """How many count only as below the lightest state."""
        return int(np.sum(self.below))


@dataclass(frozen=True)
class Fragility:
    """A fragility function: the probability of exceedance is Phi(ln(im / theta) / beta).

    Attributes
    ----------
    fit : str
        `stripes`, `ida` or `cloud`.
    theta, beta : float
        Median intensity and standard deviation of its logarithm, from record to record.
    covariance : ndarray, shape (2, 2)
        Of the estimates of ln theta and beta: the inverse of the information matrix, or where the
        motions of the runs are known that of leaving these out one by one; nan where it is not
        known, or the median is extrapolated.
    records : int
        Records; of stripes those of the largest one.
    censored : int
        Records of which the value is known only to lie above a limit.
    threshold : float
        The demand whose exceedance is meant; nan where the observations tell none.
    im, unit : str
        The intensity measure and its unit, as far as known.
    damage : float
        The drift ratio to which a mainshock has damaged the building before; 0 of an intact one,
        nan where the observations do not tell.
    type, state : str
        The type of buildings and the damage state that the function is of; empty where it is of
        neither.
    modeling_dispersion : float
        Standard deviation of what is not known of the model; not part of `beta`.
    failed : int
        Runs without a result, which the fit leaves out.
    bounds : tuple of Fragility or None
        Of stripes with such runs the fits with all of them counted as exceeding, and as not; None
        without one.
    extrapolated : str
        Why the observations do not tell the median, in words; empty where they do.
    pair_demand : str
        How the components of pairs count (`tdint.campaign.pairs`); empty without pairs.
    """

    fit: str
    theta: float
    beta: float
    covariance: Array
    records: int
    censored: int = 0
    threshold: float = math.nan
    im: str = ""
    unit: str = ""
    damage: float = math.nan
    type: str = ""
    state: str = ""
    modeling_dispersion: float = 0.0
    failed: int = 0
    bounds: tuple[Fragility | None, Fragility | None] = (None, None)
    extrapolated: str = ""
    pair_demand: str = ""
    points: Points | None = field(default=None, repr=False)
    cloud: CloudPoints | None = field(default=None, repr=False)
    counted: Counted | None = field(default=None, repr=False)

    @property
    def theta_error(self) -> float:
        """Standard error of ln theta."""
        return math.sqrt(self.covariance[0, 0])

    @property
    def beta_error(self) -> float:
        """Standard error of beta."""
        return math.sqrt(self.covariance[1, 1])

    @property
    def beta_total(self) -> float:
        """Standard deviation with that of the model: the root of the sum of squares."""
        return math.hypot(self.beta, self.modeling_dispersion)

    def probability(self, im: Array | float, *, total: bool = False) -> Array:
        """Probability of exceedance at intensities; with `total` that of the total standard
        deviation."""
        return np.asarray(ndtr(np.log(im / self.theta) / (self.beta_total if total else self.beta)))

    def band(self, im: Array) -> tuple[Array, Array]:
        """The 95 % confidence band of the probability at intensities, each of shape (k,),
        pointwise.

        By the delta method on z = ln(im / theta) / beta, so that both bounds are probabilities.
        """
        z, error = self._z(im)
        return np.asarray(ndtr(z - _TWO_SIDED * error)), np.asarray(ndtr(z + _TWO_SIDED * error))

    def _z(self, im: Array) -> tuple[Array, Array]:
        """ln(im / theta) / beta at intensities, and its standard error by the delta method, each of
        shape (k,)."""
        z = np.log(np.asarray(im) / self.theta) / self.beta
        (of_theta, mixed), (_, of_beta) = self.covariance
        return z, np.sqrt(np.maximum(of_theta + 2.0 * mixed * z + of_beta * z * z, 0.0)) / self.beta

    def beside_counts(
        self,
        im: Array,
        beyond: Array,
        *,
        runs: Array | None = None,
        motion: NDArray[np.intp] | None = None,
    ) -> Fragility:
        """The same function with what was counted beside it.

        Parameters
        ----------
        im, beyond : ndarray, shape (n,)
            Intensities of runs, or of levels of them, and the share of each that is beyond the
            state.
        runs : ndarray, shape (n,), optional
            How many runs each stands for; 1 by default.
        motion : ndarray of int, shape (n,), optional
            The ground motion of each: runs under one err alike and count as one; by default each is
            of its own.
        """
        weight = np.ones(im.size) if runs is None else runs
        # Bins of about as many runs each; where there are few levels each is one.
        level = levels_of(im)
        total = np.bincount(level, weight)
        middle = (np.cumsum(total) - 0.5 * total) / np.sum(total)
        place = level if total.size <= BINS else np.floor(BINS * middle).astype(np.intp)[level]
        place = np.unique(place, return_inverse=True)[1]
        count = np.bincount(place, weight)
        at = np.exp(np.bincount(place, weight * np.log(im)) / count)
        share = np.bincount(place, weight * beyond) / count
        fitted = np.bincount(place, weight * self.probability(im)) / count
        # As many independent tosses with the function's probability as there are motions, and the
        # fit's own error.
        motions = (
            count
            if motion is None
            else np.bincount(np.unique(np.column_stack([place, motion]), axis=0)[:, 0])
        )
        z, error = self._z(at)
        of_fit = np.nan_to_num(error) * np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
        scatter = np.sqrt(np.maximum(fitted * (1.0 - fitted), 0.0) / motions + of_fit**2)
        counted = Counted(at, count.astype(float), share, fitted, scatter, 0.5 / motions)
        return replace(self, counted=counted).within(
            im, float(np.sum(weight * beyond) / np.sum(weight))
        )

    def within(self, im: Array, share: float) -> Fragility:
        """The same function of intensities, shape (n,), and the share of their runs that is beyond;
        without an interval where the median is extrapolated."""
        why = ""
        if share in (0.0, 1.0):
            why = f"{'every' if share else 'no'} run is beyond"
        elif share < SELDOM or share > 1.0 - SELDOM:
            limit = 100.0 * (SELDOM if share < SELDOM else 1.0 - SELDOM)
            why = f"{'less' if share < SELDOM else 'more'} than {limit:g} % of the runs are beyond"
        elif not np.min(im) <= self.theta <= np.max(im):
            why = (
                f"every intensity lies {'below' if self.theta > np.max(im) else 'above'} the "
                "median of"
            )
        return (
            replace(self, extrapolated=why, covariance=np.full((2, 2), math.nan)) if why else self
        )

    @property
    def exceeded(self) -> str:
        """What is exceeded, in words: a state of a type, a threshold, or nothing where the
        observations tell none."""
        of_demand = f"threshold {self.threshold:g}" if self.threshold == self.threshold else ""
        return f"{self.type}, {self.state}" if self.type else of_demand

    @property
    def disagreement(self) -> str:
        """Where function and count part the most, in words; nothing where their scatter allows
        it."""
        of = self.counted
        if of is None or not np.any(of.apart > _APART):
            return ""
        worst = int(np.argmax(of.apart))
        about = f"{self.exceeded}: " if self.exceeded else ""
        at = f"{self.im or 'im'} {of.im[worst]:.3g} {self.unit}".rstrip()
        return (
            f"{about}at {at} {100.0 * of.share[worst]:.3g} % of "
            f"{how_many(round(of.runs[worst]), 'run')} are beyond, the {self.fit} function has "
            f"{100.0 * of.fitted[worst]:.3g} %: more apart than their scatter allows"
        )

    def named(self, threshold: float, im: str = "", unit: str = "") -> Fragility:
        """The same function of a threshold and an intensity measure."""
        return replace(self, threshold=threshold, im=im, unit=unit)

    def in_units(self, units: OutputUnits) -> Fragility:
        """The same function of an intensity in other units.

        Raises
        ------
        UsageError
            The unit that the intensity has is not known.
        """
        kinds = {"m/s^2": ACCELERATION, "m/s": VELOCITY, "m": LENGTH}
        si = next((si for si, units in kinds.items() if self.unit in units), "")
        if not si:
            raise UsageError(
                f"output units are for intensities whose unit is known, not {self.unit!r}; give "
                "the table a column unit"
            )
        unit, value = units.unit(si)
        factor = kinds[si][self.unit] / value
        # What was observed goes along, or pictures would show it beside another axis.
        points, cloud = self.points and replace(self.points, im=factor * self.points.im), self.cloud
        if cloud is not None:  # ln EDP = a + b ln IM
            intercept = cloud.intercept - cloud.slope * math.log(factor)
            cloud = replace(cloud, im=factor * cloud.im, intercept=intercept)
        low, high = (
            replace(fit, theta=factor * fit.theta, unit=unit) if fit else None
            for fit in self.bounds
        )
        counted = replace(self.counted, im=factor * self.counted.im) if self.counted else None
        observed: dict[str, Any] = {"points": points, "cloud": cloud, "counted": counted}
        return replace(self, theta=factor * self.theta, unit=unit, bounds=(low, high), **observed)


def extrapolated(functions: Sequence[Fragility]) -> list[str]:
    """A sentence for each reason why medians are extrapolated, with the functions that it is true
    of."""
    names: dict[str, list[str]] = {}
    for fit in functions:
        if fit.extrapolated:
            names.setdefault(fit.extrapolated, []).append(fit.exceeded or "the threshold")
    return [
        f"{why} {first_few(of, _MOST_NAMES)}: the median is extrapolated"
        for why, of in sorted(names.items(), reverse=True)
    ]


def levels_of(im: Array) -> NDArray[np.intp]:
    """The number of the level of each intensity, from 0."""
    order = np.argsort(im)
    steps = np.diff(np.log(im[order]), prepend=math.log(float(im[order[0]]))) > SAME_LEVEL
    result = np.empty(im.size, np.intp)
    result[order] = np.cumsum(steps)
    return result


def fit_stripes(
    im: Sequence[float] | Array, exceeding: Sequence[int] | Array, records: Sequence[int] | Array
) -> Fragility:
    """The lognormal distribution of the largest likelihood, of numbers of exceedances at levels of
    intensity.

    Parameters
    ----------
    im : array, shape (k,)
        Levels, positive.
    exceeding, records : array, shape (k,)
        At each level the number of records that exceed, and of all records.

    Returns
    -------
    Fragility
        Median theta in the unit of the levels, dispersion beta, and their standard errors.

    Raises
    ------
    UsageError
        The numbers make no sense.
    AnalysisError
        The levels do not tell median and dispersion.
    """
    x, hits, total = (np.asarray(values, float) for values in (im, exceeding, records))
    if not (x.ndim == 1 and x.shape == hits.shape == total.shape and x.size):
        raise UsageError("stripes need as many levels as numbers of exceedances and of records")
    _check_positive(x, "levels of intensity")
    if not np.all((hits >= 0) & (hits <= total) & (total > 0)):
        raise UsageError(
            "stripes: at every level there must be records, and no more exceedances than records"
        )
    # Two cases in which the likelihood has no maximum are told in words before it is looked for.
    misses = total - hits
    if not hits.any() or not misses.any():
        reason = (
            "no record exceeds at any level"
            if not hits.any()
            else "every record exceeds at every level"
        )
        raise AnalysisError(f"{reason}: neither median nor dispersion can be told; add levels")
    if np.min(x[hits > 0]) >= np.max(x[misses > 0]):
        raise AnalysisError(
            "all records below some level do not exceed and all above it do: the dispersion cannot "
            "be told; add levels between them"
        )
    # An exceedance is a capacity below the level, any other record one above it.
    levels = np.concatenate([x, x])
    side = np.repeat([True, False], x.size)
    solution = _lognormal(levels, side, ~side, np.concatenate([hits, misses]))
    if solution is None:
        raise AnalysisError(
            "exceedances do not become more frequent with intensity: no lognormal distribution fits"
        )
    return _function(STRIPES, *solution, records=int(np.max(total)), points=Points(x, hits / total))


def fit_capacities(
    capacity: Sequence[float] | Array, censored: Sequence[bool] | None = None
) -> Fragility:
    """The lognormal distribution of capacities: intensities at which each record first exceeds.

    Without censored ones theta is the geometric mean and beta the standard deviation of the
    logarithms (n - 1); with them those of the largest likelihood.

    Parameters
    ----------
    capacity : array, shape (n,)
        Capacities, positive; of censored ones what they are known to lie above.
    censored : sequence of bool, shape (n,), optional
        Which are.

    Returns
    -------
    Fragility
        Median theta in the unit of the capacities, dispersion beta, and their standard errors.

    Raises
    ------
    UsageError
        The numbers make no sense.
    AnalysisError
        They do not tell median and dispersion.
    """
    x = np.asarray(capacity, float)
    above = np.zeros(x.size, bool) if censored is None else np.asarray(censored, bool)
    if x.ndim != 1 or above.shape != x.shape:
        raise UsageError("capacities need a row of numbers and as many marks of censored ones")
    _check_positive(x, "capacities")
    # Of one known capacity alone no scatter follows, however many are censored.
    count = x.size - int(np.sum(above))
    if count < 2:
        raise AnalysisError(
            f"of {x.size} capacities {count or 'none'} is known, the others are censored: median "
            "and dispersion need two"
        )
    logarithms = np.log(x)
    # Without censored ones the estimate is closed, with n - 1; its errors are those of a normal
    # sample.
    if not above.any():
        beta = float(np.std(logarithms, ddof=1))
        if not beta > _EQUAL:
            raise AnalysisError("all capacities are equal: the dispersion cannot be told")
        covariance = np.diag([beta**2 / x.size, beta**2 / (2.0 * x.size)])
        solution: tuple[float, float, Array] | None = (float(np.mean(logarithms)), beta, covariance)
    else:
        solution = _lognormal(x, np.zeros(x.size, bool), above, np.ones(x.size))
    if solution is None:
        raise AnalysisError("the capacities tell no dispersion: too many are equal or censored")
    points = empirical(x, above)
    return _function(IDA, *solution, records=x.size, censored=int(np.sum(above)), points=points)


def fit_cloud(
    im: Sequence[float] | Array,
    edp: Sequence[float] | Array,
    thresholds: Sequence[float],
    censored: Sequence[bool] | NDArray[np.bool_] | None = None,
    *,
    lower_threshold: float = 0.0,
) -> list[Fragility]:
    """A fragility function for each threshold, of ln EDP = b0 + b1 ln IM + sigma N by maximum
    likelihood.

    theta = exp((ln threshold - b0) / b1), beta = sigma / b1. sigma is that of the largest
    likelihood: the root of the mean square of the residuals where none is censored.

    Parameters
    ----------
    im, edp : array, shape (n,)
        Intensities and demands, positive; of censored demands what they are known to lie above.
    thresholds : sequence of float
        Demands whose exceedance is asked for, positive.
    censored : sequence of bool, shape (n,), optional
        Which are.
    lower_threshold : float
        Demands below it, which are not censored, are known only to be below: far under the lightest
        state the demands are elastic, on a line of their own. They are not left out, for a choice
        by demand bends the line.

    Returns
    -------
    list of Fragility
        One per threshold.

    Raises
    ------
    UsageError
        The numbers make no sense.
    AnalysisError
        No line with a positive slope fits.
    """
    x, y = np.asarray(im, float), np.asarray(edp, float)
    above = np.zeros(x.size, bool) if censored is None else np.asarray(censored, bool)
    if x.ndim != 1 or not x.shape == y.shape == above.shape:
        raise UsageError("a cloud needs as many demands as intensities")
    for values, name in (
        (x, "intensities"),
        (y, "demands"),
        (np.asarray(thresholds, float), "thresholds"),
    ):
        _check_positive(values, name)
    lower_threshold = between(lower_threshold, "lower_threshold")
    below = ~above & (y < lower_threshold)
    # Those known to be below help a line that others tell: three known exactly, of more than one
    # intensity.
    exact = ~(above | below)
    if not (int(np.sum(exact)) > 2 and np.unique(x[exact]).size > 1):
        below = np.zeros(x.size, bool)
    intercept, slope, sigma, covariance = _line(
        np.log(x), np.log(np.where(below, lower_threshold, y)), above, below
    )
    # In the likelihood's parameters the function is a ratio: its errors follow by its derivatives.
    points = CloudPoints(x, y, above, below, intercept, slope, sigma)
    observed = {"records": x.size, "censored": int(np.sum(above)), "cloud": points}
    g1, results = slope / sigma, []
    for threshold in thresholds:
        mean = (math.log(threshold) - intercept) / slope
        jacobian = np.array([[-1.0, -mean, math.log(threshold)], [0.0, -1.0 / g1, 0.0]]) / g1
        of_function = jacobian @ covariance @ jacobian.T
        results.append(
            _function(CLOUD, mean, 1.0 / g1, of_function, threshold=float(threshold), **observed)
        )
    return results


def _line(
    x: Array, y: Array, above: NDArray[np.bool_], below: NDArray[np.bool_]
) -> tuple[float, float, float, Array]:
    """Intercept, slope and standard deviation, and the covariance of (b0 / sigma, b1 / sigma, 1 /
    sigma)."""
    exact = ~(above | below)
    if not below.any() and np.unique(x[exact]).size < 3:
        raise AnalysisError(
            "a cloud needs demands at three different intensities at least that are not censored"
        )
    # The usual line to begin with; demands on a line to the digit leave no scatter to be fitted.
    slope, intercept = np.polyfit(x[exact], y[exact], 1)
    sigma = float(np.sqrt(np.mean((y[exact] - intercept - slope * x[exact]) ** 2)))
    if not sigma > 1e-12 * float(np.ptp(y)):
        raise AnalysisError("all demands lie on one line: the dispersion cannot be told")
    if (
        below.any()
    ):  # Between two limits the slope may have either sign: begin with that of all demands.
        slope, intercept = np.polyfit(x, y, 1)
        sigma = float(np.sqrt(np.mean((y - intercept - slope * x) ** 2)))
    observed = Observations(
        np.column_stack([-np.ones(x.size), -x, y]), below, above, np.ones(x.size), 2
    )
    solution = maximize(observed, np.array([intercept, slope, 1.0]) / sigma)
    if solution is None or not solution[0][1] > 0.0:
        raise AnalysisError(
            "demands do not grow with intensity: no line with a positive slope fits the cloud"
        )
    (g0, g1, h), covariance = solution
    return float(g0 / h), float(g1 / h), float(1.0 / h), covariance


def _function(
    fit: str, logarithm: float, beta: float, covariance: Array, **observed: Any
) -> Fragility:
    """The function of a fit, of its ln theta; AnalysisError where the observations tell next to
    nothing of it."""
    half = _TWO_SIDED * math.sqrt(covariance[0, 0])  # of the 95 % interval
    if not abs(logarithm) + half + beta < math.log(LARGEST):
        raise AnalysisError(
            f"the observations do not tell the median: it is exp({logarithm:.3g} +- {half:.3g}), "
            f"with a dispersion of {beta:.3g}"
        )
    return Fragility(fit, math.exp(logarithm), beta, covariance, **observed)


def _lognormal(
    x: Array, below: NDArray[np.bool_], above: NDArray[np.bool_], count: Array
) -> tuple[float, float, Array] | None:
    """ln theta, beta and the covariance of both; None where there is no maximum of the
    likelihood."""
    logarithms = np.log(x)
    middle, spread = float(np.mean(logarithms)), float(np.std(logarithms)) or 1.0
    observed = Observations(
        np.column_stack([np.ones(x.size), (logarithms - middle) / spread]), below, above, count, 1
    )
    solution = maximize(observed, np.array([0.0, 1.0]))
    if solution is None:
        return None
    (a, b), covariance = solution
    jacobian = spread * np.array([[-1.0 / b, a / b**2], [0.0, -1.0 / b**2]])
    return float(middle - spread * a / b), float(spread / b), jacobian @ covariance @ jacobian.T


def empirical(capacity: Array, censored: NDArray[np.bool_]) -> Points:
    """The part of records that exceed at each known capacity (Kaplan and Meier 1958), in the middle
    of each step."""
    order = np.lexsort((censored, capacity))
    survivors, share, im, part = capacity.size, 1.0, [], []
    for place in order:
        if not censored[place]:
            after = share * (survivors - 1) / survivors
            im.append(float(capacity[place]))
            part.append(1.0 - 0.5 * (share + after))
            share = after
        survivors -= 1
    return Points(np.array(im), np.array(part))


def _check_positive(values: Array, name: str) -> None:
    if not np.all(np.isfinite(values) & (values > 0.0)):
        raise UsageError(f"{name} must be positive numbers")
