"""Fragility functions: lognormal distributions of the intensity at which a threshold is exceeded.

Three fits are available:

- Stripes: numbers of exceedances at intensity levels (multiple stripe analysis; Baker 2015,
  Earthquake Spectra 31(1), doi 10.1193/021113EQS025M).
- Capacities of an incremental dynamic analysis: by their moments, or by maximum likelihood if some
  capacities are censored (Baker 2015, eq. 9).
- Cloud: a line through the logarithms of demand over intensity (Jalayer 2003). Some demands may be
  censored, that is, known only to be above or below a limit.

All fits use the likelihood of normal observations, some of which are censored. Each observation i
has a standardized value z_i = x_i . p, which is linear in the parameters p. The logarithm of the
likelihood is therefore concave (Pratt 1981; Olsen 1978), and Newton's iteration finds its unique
maximum. An exact value adds ln(1 / sigma) - z^2 / 2 to the logarithm, where 1 / sigma is one of the
parameters. A value known to be below a limit adds ln Phi(z); a value known to be above a limit adds
ln Phi(-z).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtr

from tdint.analysis.arguments import between
from tdint.arrays import Array, Numbers
from tdint.errors import AnalysisError, UsageError
from tdint.number_parsing import LARGEST, abbreviate, pluralize
from tdint.units import ACCELERATION, LENGTH, VELOCITY, OutputUnits

_MAX_ITERATIONS = 200
"""Maximum number of Newton iterations. The iteration usually needs fewer than 20."""

_CONVERGED = 1e-13
"""Tolerance of the Newton decrement, which is about twice the distance of the log-likelihood from
its maximum. Near the maximum, each decrement is about the square of the previous one."""

_MIN_STEP_FRACTION = 1e-12
"""Smallest fraction of a Newton step that is tried. If it does not increase the likelihood, there
is no maximum at a positive 1 / sigma."""

_MIN_CURVATURE_RATIO = 1e-12
"""Smallest ratio of the minimum to the maximum curvature of the log-likelihood, scaled to equal
diagonals. Below it, the maximum is not unique."""


@dataclass(frozen=True)
class Observations:
    """Observations of a normal variable, some of them censored, with standardized values that are
    linear in the parameters of the model.

    Attributes
    ----------
    design : ndarray, shape (n, k)
        Coefficients of the parameters: the standardized values are z = design @ parameters.
    below, above : ndarray of bool, shape (n,)
        True for a censored value: only an upper bound (`below`) or a lower bound (`above`) of the
        value is known, and the row of the design contains this bound. The value is exact if both
        are False.
    count : ndarray, shape (n,)
        Number of times that each observation was made.
    inverse_sigma : int
        Index of the parameter 1 / sigma.
    """

    design: Array
    below: NDArray[np.bool_]
    above: NDArray[np.bool_]
    count: Array
    inverse_sigma: int

    @property
    def exact_count(self) -> float:
        """Number of exact (not censored) values."""
        return float(np.sum(self.count[~(self.below | self.above)]))

    def log_likelihood(self, parameters: Array) -> float:
        """Return the logarithm of the likelihood of parameters, shape (k,), without its constant
        term; -inf if 1 / sigma is not positive."""
        inverse_sigma = float(parameters[self.inverse_sigma])
        if not inverse_sigma > 0.0:
            return -math.inf
        # Contribution of each observation: probability of being below or above its bound, or the
        # normal density of an exact value
        z = self.design @ parameters
        terms = np.where(self.below, log_ndtr(z), np.where(self.above, log_ndtr(-z), -0.5 * z * z))
        return float(np.sum(self.count * terms)) + self.exact_count * math.log(inverse_sigma)

    def derivatives(self, parameters: Array) -> tuple[Array, Array]:
        """Return the gradient and the Hessian of the log-likelihood with respect to the parameters
        of the linear model. One of these is 1 / sigma, which must be positive.
        """
        # The derivatives contain phi(z) / Phi(z), the density divided by the distribution function.
        # Compute the ratio from logarithms, because both functions underflow for large |z|.
        z = self.design @ parameters
        hazard_below, hazard_above = (
            np.exp(-0.5 * y * y - log_ndtr(y)) / math.sqrt(2.0 * math.pi) for y in (z, -z)
        )
        # First and second derivative of each term with respect to z
        first = np.where(self.below, hazard_below, np.where(self.above, -hazard_above, -z))
        second = np.where(
            self.below,
            -hazard_below * (hazard_below + z),
            np.where(self.above, -hazard_above * (hazard_above - z), -1.0),
        )
        inverse_sigma, index = float(parameters[self.inverse_sigma]), self.inverse_sigma
        gradient = self.design.T @ (self.count * first)
        hessian = (self.design.T * (self.count * second)) @ self.design
        gradient[index] += self.exact_count / inverse_sigma
        hessian[index, index] -= self.exact_count / inverse_sigma**2
        return gradient, hessian


def maximize(observations: Observations, start: Array) -> tuple[Array, Array] | None:
    """Compute the parameters of maximum likelihood by Newton's iteration.

    Parameters
    ----------
    start : ndarray, shape (k,)
        Initial parameters, with a positive 1 / sigma.

    Returns
    -------
    tuple of ndarray, or None
        Parameters, shape (k,), and their covariance, shape (k, k), which is the inverse of the
        observed information. None if no maximum exists at finite parameters.
    """
    parameters = np.asarray(start, float)
    log_likelihood = observations.log_likelihood(parameters)
    for _ in range(_MAX_ITERATIONS):
        # A likelihood without curvature in some direction has no unique maximum.
        gradient, hessian = observations.derivatives(parameters)
        if not (np.isfinite(gradient).all() and np.isfinite(hessian).all()) or _is_flat(hessian):
            return None
        step = np.linalg.solve(-hessian, gradient)
        newton_decrement = float(gradient @ step)
        # After convergence, add the last step without a check that the likelihood increases,
        # because rounding errors would exceed the increase.
        if newton_decrement <= _CONVERGED * max(1.0, abs(log_likelihood)):
            return parameters + step, np.asarray(np.linalg.inv(-hessian), float)
        # A step that does not increase the likelihood is too long, and is halved.
        fraction = 1.0
        increased = observations.log_likelihood(parameters + step)
        while not increased > log_likelihood:
            fraction *= 0.5
            if fraction < _MIN_STEP_FRACTION:
                return None
            increased = observations.log_likelihood(parameters + fraction * step)
        parameters, log_likelihood = parameters + fraction * step, increased
    return None


def _is_flat(hessian: Array) -> bool:
    """Return True if the log-likelihood with the second derivatives `hessian`, shape (k, k), has no
    curvature in some direction of the parameters. In this case it increases without limit in this
    direction, or the observations do not distinguish the parameters."""
    diagonal = -np.diagonal(hessian)
    if not np.all(diagonal > 0.0):
        return True
    # Scale the parameters so that the diagonal is 1, because they have different magnitudes. The
    # eigenvalues, in ascending order, are the curvatures.
    scale = 1.0 / np.sqrt(diagonal)
    curvatures = np.linalg.eigvalsh(-hessian * np.outer(scale, scale))
    return bool(curvatures[0] <= _MIN_CURVATURE_RATIO * curvatures[-1])


STRIPES, IDA, CLOUD = "stripes", "ida", "cloud"
FITS = (STRIPES, IDA, CLOUD)
"""Names of the available fits."""

_MIN_DISPERSION = 1e-9
"""Minimum dispersion of capacities. Smaller values are rounding errors of equal capacities."""

_MOST_NAMES = 10
"""Maximum number of names of functions in a message, so that the message stays readable."""

_NORMAL_95 = 1.959963984540054
"""Half width of the interval around the mean that contains 95 % of a normal distribution, in
standard deviations."""

SAME_LEVEL = 1e-6
"""Relative difference of intensities below which they belong to one level."""

BINS = 6
"""Number of intensity bins in which exceedances are counted. Fewer bins would hide a bend; with
more bins each bin contains few ground motions."""

_REPORTED_DIFFERENCE = 3.0
"""Number of standard errors between function and count that is reported. With 80 bins (four types,
four states) random scatter exceeds it in one of five studies."""


@dataclass(frozen=True)
class Points:
    """Observations of a fit that a figure shows next to the fitted function.

    Attributes
    ----------
    fraction : ndarray, shape (k,)
        Fraction of the records that exceed the threshold at each intensity.
    """

    im: Array
    fraction: Array


SELDOM = 0.1
"""Minimum fraction of the runs that must exceed a state, and minimum fraction that must not exceed
it, for a reliable median. With smaller fractions, the median depends on the assumption that the
function is lognormal."""


@dataclass(frozen=True)
class Counted:
    """Counts of exceedances in bins of the intensity, all arrays of shape (k,).

    Attributes
    ----------
    im : ndarray
        Intensity of each bin: geometric mean of its runs.
    fraction : ndarray
        Fraction of the runs that exceed the state.
    error : ndarray
        Standard error of the difference between `fraction` and `fitted`.
    half_motion : ndarray
        Half a ground motion as a fraction of all ground motions of the bin: the largest rounding
        error of a counted fraction.
    """

    im: Array
    runs: Array
    fraction: Array
    fitted: Array
    error: Array
    half_motion: Array

    @property
    def excess_in_errors(self) -> Array:
        """Absolute difference between fitted and counted fraction, reduced by half a ground motion
        and divided by its standard error; 0 if the difference is at most half a ground motion."""
        excess = np.abs(self.fraction - self.fitted) - self.half_motion
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(excess > 0.0, excess / self.error, 0.0)

    @property
    def bound(self) -> Array:
        """Maximum absolute difference between fitted and counted fraction that can be explained by
        random scatter (3 standard errors) and by rounding to whole ground motions. Larger
        differences are reported."""
        return _REPORTED_DIFFERENCE * self.error + self.half_motion


@dataclass(frozen=True)
class CloudPoints:
    """Observations of a cloud with the fitted line.

    Attributes
    ----------
    censored, below : ndarray of bool, shape (n,)
        True for censored demands, and for demands that count only as below the lightest state.
    intercept, slope, sigma : float
        Line ln EDP = intercept + slope ln IM, and standard deviation of ln EDP.
    """

    im: Array
    edp: Array
    censored: NDArray[np.bool_]
    below: NDArray[np.bool_]
    intercept: float
    slope: float
    sigma: float

    @property
    def light(self) -> int:
        """Number of demands that count only as below the lightest state."""
        return int(np.sum(self.below))


@dataclass(frozen=True)
class Fragility:
    """Fragility function: the probability of exceedance is Phi(ln(im / theta) / beta).

    Attributes
    ----------
    fit : str
        `stripes`, `ida` or `cloud`.
    theta, beta : float
        Median intensity, and standard deviation of its logarithm (record-to-record dispersion).
    covariance : ndarray, shape (2, 2)
        Covariance of the estimates of ln theta and beta. It is a jackknife estimate over ground
        motions if the ground motions of the runs are known, otherwise the inverse of the
        information matrix. It is nan if it is unknown or if the median is extrapolated.
    runs : int
        Number of runs, capacities or counted records that determine the function.
    censored : int
        Number of runs with a value that is known only to be above a limit.
    threshold : float
        Demand that is exceeded; nan if the observations do not specify it.
    is_drift_ratio : bool
        True if the demand is known to be a drift ratio, which is written in percent.
    im, unit : str
        Intensity measure and its unit, if known.
    damage : float
        Drift ratio of the previous damage by a main shock; 0 for an intact building, nan if the
        observations do not specify it.
    type, state : str
        Building type and damage state of the function; empty if not applicable.
    modeling_dispersion : float
        Dispersion due to the uncertainty of the model; not included in `beta`.
    failed : int
        Number of runs without a result, which are omitted from the fit.
    bounds : tuple of Fragility | None
        For stripes with failed runs: the fits with all of them counted as exceeding, and as not
        exceeding; None if a fit is not available.
    extrapolated : str
        Reason why the observations do not cover the median; empty if they do.
    pair_demand : str
        Rule that combines the components of pairs (`tdint.campaign.pairs`); empty without
        pairs.
    motions : int
        Number of ground motions of the runs; both components of a recording are one. If the runs
        have events, it is the number of events. Runs of a table that states neither are assumed to
        be under separate ground motions.
    points : Points | None
        Observations for figures.
    cloud : CloudPoints | None
        Observations and line of a cloud.
    counted : Counted | None
        Counts to be compared with the function.
    """

    fit: str
    theta: float
    beta: float
    covariance: Array
    runs: int
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
    motions: int = 0
    points: Points | None = field(default=None, repr=False)
    cloud: CloudPoints | None = field(default=None, repr=False)
    counted: Counted | None = field(default=None, repr=False)
    is_drift_ratio: bool = False

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
        """Total dispersion: root of the sum of squares of `beta` and `modeling_dispersion`."""
        return math.hypot(self.beta, self.modeling_dispersion)

    def probability(self, im: Array | float, *, total: bool = False) -> Array:
        """Return the probability of exceedance, Phi(ln(im / theta) / beta), at intensities.

        Parameters
        ----------
        im : ndarray or float
            Intensities, in the unit of theta.
        total : bool
            True to use the total dispersion `beta_total` instead of `beta`; default False.
        """
        return np.asarray(ndtr(np.log(im / self.theta) / (self.beta_total if total else self.beta)))

    def band(self, im: Array) -> tuple[Array, Array]:
        """Return the pointwise 95 % confidence band of the probability, two arrays of shape (k,).

        The delta method is applied to z = ln(im / theta) / beta, so that both bounds are
        probabilities.

        Parameters
        ----------
        im : ndarray, shape (k,)
            Intensities in the unit of the function.
        """
        z, error = self._standardize(im)
        return np.asarray(ndtr(z - _NORMAL_95 * error)), np.asarray(ndtr(z + _NORMAL_95 * error))

    def _standardize(self, im: Array) -> tuple[Array, Array]:
        """Return the standardized intensities z = ln(im / theta) / beta and their standard errors,
        by the delta method.
        """
        z = np.log(np.asarray(im) / self.theta) / self.beta
        # The differential of z is -(d ln theta + z d beta) / beta, which leads to the variance
        # (var(ln theta) + 2 z cov(ln theta, beta) + z^2 var(beta)) / beta^2.
        (ln_theta_variance, mixed), (_, beta_variance) = self.covariance
        variance = ln_theta_variance + 2.0 * mixed * z + beta_variance * z * z
        return z, np.sqrt(np.maximum(variance, 0.0)) / self.beta

    def beside_counts(
        self,
        im: Array,
        exceeding: Array,
        *,
        runs: Array | None = None,
        motion: NDArray[np.intp] | None = None,
    ) -> Fragility:
        """Return a copy of the function with the attribute `counted`: the fractions of exceedances
        in bins of the intensity, for a comparison with the function.

        The runs cover the median if 10 to 90 % of the runs exceed the state and if the median is
        within the range of their intensities. Otherwise the copy states the reason in
        `extrapolated`, and its covariance is nan (`within`).

        Parameters
        ----------
        im : ndarray, shape (n,)
            Intensity of each entry, a run or the runs at a level.
        exceeding : ndarray, shape (n,)
            Fraction of the runs of each entry that exceed the state.
        runs : ndarray, shape (n,), optional
            Number of runs of each entry; default 1.
        motion : ndarray of int, shape (n,), optional
            Ground motion of each entry. Runs under the same ground motion are correlated and count
            as a single observation. By default all entries are independent.

        Returns
        -------
        Fragility
            The copy.
        """
        weight = np.ones(im.size) if runs is None else runs
        bin_index = _bin_indices(im, weight)
        # Means over the runs of each bin; the intensity has a geometric mean
        bin_runs = np.bincount(bin_index, weight)
        bin_im = np.exp(np.bincount(bin_index, weight * np.log(im)) / bin_runs)
        fraction = np.bincount(bin_index, weight * exceeding) / bin_runs
        fitted = np.bincount(bin_index, weight * self.probability(im)) / bin_runs
        # The variance of the difference between counted and fitted fraction has two parts: the
        # binomial variance of the counted fraction, with a single independent observation per
        # ground motion, and the variance of the fit, by the delta method.
        motion_counts = bin_runs
        if motion is not None:  # count the distinct ground motions in each bin
            distinct_pairs = np.unique(np.column_stack([bin_index, motion]), axis=0)
            motion_counts = np.bincount(distinct_pairs[:, 0])
        z, z_error = self._standardize(bin_im)
        density = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
        # An unknown error of the fit (nan) is omitted from the variance.
        fit_error = np.nan_to_num(z_error) * density
        difference_error = np.sqrt(
            np.maximum(fitted * (1.0 - fitted), 0.0) / motion_counts + fit_error**2
        )
        # A counted fraction is a multiple of 1 / n for n ground motions, so half a ground motion is
        # its largest rounding error.
        half_motion = 0.5 / motion_counts
        counted = Counted(
            bin_im, bin_runs.astype(float), fraction, fitted, difference_error, half_motion
        )
        return replace(self, counted=counted).within(
            im, float(np.sum(weight * exceeding) / np.sum(weight))
        )

    def within(self, im: Array, fraction: float) -> Fragility:
        """Return the function unchanged if the runs cover its median intensity. Otherwise return a
        copy with the reason in the attribute `extrapolated`, and with a covariance of NaN.

        The runs cover the median if between 10 % and 90 % of them exceed the state, and if the
        median is within the range of their intensities.

        Parameters
        ----------
        im : ndarray, shape (n,)
            Intensities of the runs.
        fraction : float
            Fraction of the runs that exceed the state.
        """
        # In a message, the name of the state follows the text, for example "no run exceeds DS3".
        reason = ""
        if fraction == 0.0:
            reason = "no run exceeds"
        elif fraction == 1.0:
            reason = "every run exceeds"
        elif fraction < SELDOM:
            reason = f"less than {100.0 * SELDOM:g} % of the runs exceed"
        elif fraction > 1.0 - SELDOM:
            reason = f"more than {100.0 * (1.0 - SELDOM):g} % of the runs exceed"
        elif self.theta > np.max(im):
            reason = "every intensity is below the median of"
        elif not self.theta >= np.min(im):
            reason = "every intensity is above the median of"
        if not reason:
            return self
        return replace(self, extrapolated=reason, covariance=np.full((2, 2), math.nan))

    @property
    def threshold_text(self) -> str:
        """Text of the threshold: drift ratios in percent; empty if unknown."""
        if math.isnan(self.threshold):
            return ""
        return f"{100.0 * self.threshold:g} %" if self.is_drift_ratio else f"{self.threshold:g}"

    @property
    def exceeded(self) -> str:
        """Text of the limit that is exceeded: building type and damage state, if the function has
        a type, otherwise the threshold; empty if the threshold is unknown."""
        threshold = f"threshold {self.threshold_text}" if self.threshold_text else ""
        return f"{self.type}, {self.state}" if self.type else threshold

    @property
    def disagreement(self) -> str:
        """Message about the largest difference between the function and the counted fraction of
        exceedances; empty if all differences can be explained by random scatter."""
        counted = self.counted
        if counted is None or not np.any(counted.excess_in_errors > _REPORTED_DIFFERENCE):
            return ""
        largest = int(np.argmax(counted.excess_in_errors))
        prefix = f"{self.exceeded}: " if self.exceeded else ""
        level = f"{self.im or 'im'} {counted.im[largest]:.3g} {self.unit}".rstrip()
        runs_text = pluralize(round(counted.runs[largest]), "run")
        counted_percent = 100.0 * counted.fraction[largest]
        fitted_percent = 100.0 * counted.fitted[largest]
        return (
            f"{prefix}at {level} {counted_percent:.3g} % of {runs_text} exceed, "
            f"the {self.fit} function gives {fitted_percent:.3g} %: the "
            "difference exceeds the random scatter"
        )

    def named(self, threshold: float, im: str = "", unit: str = "") -> Fragility:
        """Return the function with its threshold and intensity measure.

        Parameters
        ----------
        threshold : float
            Limit of the demand, such as a drift ratio.
        im : str
            Name of the intensity measure.
        unit : str
            Unit of the intensities; empty if it is not known.
        """
        return replace(self, threshold=threshold, im=im, unit=unit)

    def in_units(self, units: OutputUnits) -> Fragility:
        """Return the function with intensities in other units.

        Parameters
        ----------
        units : OutputUnits
            Units of the result.

        Raises
        ------
        UsageError
            The unit of the intensity is unknown.
        """
        # For each SI unit, the units of the same quantity with their factors to the SI unit
        units_by_si = {"m/s^2": ACCELERATION, "m/s": VELOCITY, "m": LENGTH}
        si_unit = next((si for si, names in units_by_si.items() if self.unit in names), "")
        if not si_unit:
            raise UsageError(
                "output units cannot be used, because the unit of the intensities is unknown, got "
                f"{self.unit!r}; add a column `unit` to the table, with a unit such as m/s^2"
            )
        unit, value = units.unit(si_unit)
        factor = units_by_si[si_unit][self.unit] / value
        # Convert the observations also, because figures show them on the same axis.
        points = self.points and replace(self.points, im=factor * self.points.im)
        cloud = self.cloud
        if cloud is not None:
            # The line is ln EDP = intercept + slope ln IM. With IM' = factor IM, its intercept is
            # intercept - slope ln factor, and its slope is unchanged.
            intercept = cloud.intercept - cloud.slope * math.log(factor)
            cloud = replace(cloud, im=factor * cloud.im, intercept=intercept)
        first_bound, second_bound = (
            replace(fit, theta=factor * fit.theta, unit=unit) if fit else None
            for fit in self.bounds
        )
        counted = replace(self.counted, im=factor * self.counted.im) if self.counted else None
        converted: dict[str, Any] = {"points": points, "cloud": cloud, "counted": counted}
        return replace(
            self,
            theta=factor * self.theta,
            unit=unit,
            bounds=(first_bound, second_bound),
            **converted,
        )


def _bin_indices(im: Array, weight: Array) -> NDArray[np.intp]:
    """Divide intensities into at most `BINS` bins with about equal numbers of runs, and return the
    index of the bin of each intensity. No bin is empty.
    """
    level = levels_of(im)
    runs_at_level = np.bincount(level, weight)
    # With few levels, each level is a bin. Otherwise the bin of a level is determined by the
    # fraction of the runs below its middle run.
    bin_numbers = level
    if runs_at_level.size > BINS:
        fraction_below = (np.cumsum(runs_at_level) - 0.5 * runs_at_level) / np.sum(runs_at_level)
        bin_numbers = np.floor(BINS * fraction_below).astype(np.intp)[level]
    # Renumber the bins, because bins may be empty.
    return np.unique(bin_numbers, return_inverse=True)[1]


def extrapolated(functions: Sequence[Fragility]) -> list[str]:
    """Return messages about functions with an extrapolated median.

    Each reason for an extrapolation has one message, which lists the functions that the reason
    concerns.
    """
    names_by_reason: dict[str, list[str]] = {}
    for function in functions:
        if function.extrapolated:
            name = function.exceeded or "the threshold"
            names_by_reason.setdefault(function.extrapolated, []).append(name)
    return [
        f"{reason} {abbreviate(names, _MOST_NAMES)}: the median is extrapolated"
        for reason, names in sorted(names_by_reason.items(), reverse=True)
    ]


def levels_of(im: Array) -> NDArray[np.intp]:
    """Return the index of the level of each intensity, from 0 for the lowest level.

    In ascending order, neighboring intensities belong to the same level if their logarithms differ
    by at most `SAME_LEVEL`, which for this small value is their relative difference.

    Parameters
    ----------
    im : ndarray, shape (n,)
        Intensities, positive, in any order.
    """
    # A level begins where the logarithm of the sorted intensities increases by more than the
    # tolerance; the number of beginnings up to an intensity is the index of its level. With
    # `prepend`, the first difference is zero.
    order = np.argsort(im)
    ln_lowest = math.log(float(im[order[0]]))
    is_next_level = np.diff(np.log(im[order]), prepend=ln_lowest) > SAME_LEVEL
    result = np.empty(im.size, np.intp)
    result[order] = np.cumsum(is_next_level)
    return result


def fit_stripes(im: Numbers, exceeding: Numbers, records: Numbers) -> Fragility:
    """Fit a lognormal distribution by maximum likelihood to exceedances at intensity levels.

    Parameters
    ----------
    im : array, shape (k,)
        Intensity levels, positive.
    exceeding, records : array, shape (k,)
        Number of records that exceed, and number of all records, at each level.

    Returns
    -------
    Fragility
        Median theta in the unit of the levels, dispersion beta, and their standard errors.

    Raises
    ------
    UsageError
        The arrays have different shapes, or a value is invalid.
    AnalysisError
        The levels do not determine median and dispersion.
    """
    im_levels, exceeding_counts, record_counts = (
        np.asarray(values, float) for values in (im, exceeding, records)
    )
    _check_stripes(im_levels, exceeding_counts, record_counts)
    # An exceedance is a capacity below the level; any other record has a capacity above it.
    other_counts = record_counts - exceeding_counts
    limits = np.concatenate([im_levels, im_levels])
    is_below = np.repeat([True, False], im_levels.size)
    counts_at_limits = np.concatenate([exceeding_counts, other_counts])
    # `solution` contains ln theta, beta, and their covariance.
    solution = _lognormal(limits, is_below, ~is_below, counts_at_limits)
    if solution is None:
        raise AnalysisError(
            "the fraction of exceedances does not increase with intensity: no lognormal "
            "distribution can be fitted; check the levels, or add records"
        )
    return _function(
        STRIPES,
        *solution,
        runs=int(np.sum(record_counts)),
        motions=int(np.max(record_counts)),
        points=Points(im_levels, exceeding_counts / record_counts),
    )


def _check_stripes(im_levels: Array, exceeding_counts: Array, record_counts: Array) -> None:
    """Check that the numbers of exceedances and of all records at intensity levels determine a
    lognormal distribution.

    Raises
    ------
    AnalysisError
        The likelihood has no maximum: only exceedances or no exceedances exist, or the levels with
        and without exceedances do not overlap.
    """
    has_equal_shapes = im_levels.shape == exceeding_counts.shape == record_counts.shape
    if im_levels.ndim != 1 or not im_levels.size or not has_equal_shapes:
        raise UsageError(
            "stripes: levels, numbers of exceedances and numbers of records must be arrays of the "
            f"same length, got the shapes {im_levels.shape}, {exceeding_counts.shape} and "
            f"{record_counts.shape}"
        )
    _check_positive(im_levels, "levels of intensity")
    is_count_valid = (exceeding_counts >= 0) & (exceeding_counts <= record_counts)
    is_level_valid = is_count_valid & (record_counts > 0)
    if not np.all(is_level_valid):
        invalid_level = int(np.argmin(is_level_valid))  # index of the first invalid level
        raise UsageError(
            "stripes: at every level the number of records must be positive, and the number of "
            f"exceedances must not exceed it, got {exceeding_counts[invalid_level]:g} exceedances "
            f"of {record_counts[invalid_level]:g} records at the level {im_levels[invalid_level]:g}"
        )
    other_counts = record_counts - exceeding_counts
    if not exceeding_counts.any() or not other_counts.any():
        reason = (
            "no record exceeds at any level"
            if not exceeding_counts.any()
            else "every record exceeds at every level"
        )
        raise AnalysisError(
            f"{reason}: median and dispersion cannot be estimated; add intensity levels"
        )
    if np.min(im_levels) == np.max(im_levels):
        raise AnalysisError(
            f"all records are at the intensity level {im_levels[0]:g}: one intensity level cannot "
            "determine median and dispersion; add intensity levels"
        )
    # Exceedances that do not increase with the intensity are detected by the fit (`fit_stripes`).
    if np.min(im_levels[exceeding_counts > 0]) >= np.max(im_levels[other_counts > 0]):
        raise AnalysisError(
            "no record exceeds below some level and all records exceed above it: the dispersion "
            "cannot be estimated; add intensity levels in between"
        )


def fit_capacities(capacity: Numbers, censored: Sequence[bool] | None = None) -> Fragility:
    """Fit a lognormal distribution to capacities: the intensities where the records first exceed a
    threshold.

    Without censored capacities theta is the geometric mean, and beta is the standard deviation of
    the logarithms (n - 1). With censored capacities both are maximum-likelihood estimates.

    Parameters
    ----------
    capacity : array, shape (n,)
        Capacities, positive. A censored capacity is only known to be above the specified value.
    censored : sequence of bool, shape (n,), optional
        True for censored capacities; default none censored.

    Returns
    -------
    Fragility
        Median theta in the unit of the capacities, dispersion beta, and their standard errors.

    Raises
    ------
    UsageError
        The arrays have different shapes, or a value is invalid.
    AnalysisError
        The capacities do not determine median and dispersion.
    """
    x = np.asarray(capacity, float)
    above = np.zeros(x.size, bool) if censored is None else np.asarray(censored, bool)
    if x.ndim != 1 or above.shape != x.shape:
        raise UsageError(
            "capacities and censored must be arrays of the same length, got the shapes "
            f"{x.shape} and {above.shape}"
        )
    _check_positive(x, "capacities")
    # The dispersion cannot be estimated from one exact capacity, even with many censored
    # capacities.
    exact_count = x.size - int(np.sum(above))
    if exact_count < 2:
        raise AnalysisError(
            "an estimate of median and dispersion requires at least two capacities that are not "
            f"censored, got {exact_count} of {x.size}"
        )
    logarithms = np.log(x)
    # Without censored capacities, use the sample mean and the standard deviation (n - 1), and the
    # known standard errors of these estimates for a normal distribution.
    if not above.any():
        beta = float(np.std(logarithms, ddof=1))
        if not beta > _MIN_DISPERSION:
            raise AnalysisError(
                "all capacities are equal: the dispersion cannot be estimated; add records"
            )
        covariance = np.diag([beta**2 / x.size, beta**2 / (2.0 * x.size)])
        solution: tuple[float, float, Array] | None = (float(np.mean(logarithms)), beta, covariance)
    else:
        solution = _lognormal(x, np.zeros(x.size, bool), above, np.ones(x.size))
    if solution is None:
        raise AnalysisError(
            "the dispersion cannot be estimated, because too many capacities are equal or "
            "censored; add records"
        )
    return _function(
        IDA,
        *solution,
        runs=x.size,
        motions=x.size,
        censored=int(np.sum(above)),
        points=empirical(x, above),
    )


def fit_cloud(
    im: Numbers,
    edp: Numbers,
    thresholds: Numbers,
    censored: Sequence[bool] | NDArray[np.bool_] | None = None,
    *,
    lower_threshold: float = 0.0,
) -> list[Fragility]:
    """Fit a fragility function for each threshold to a cloud, by maximum likelihood.

    The model is ln EDP = b0 + b1 ln IM + sigma N, where N is a standard normal variable. The
    functions have theta = exp((ln threshold - b0) / b1) and beta = sigma / b1. Without censored
    demands sigma is the root mean square of the residuals.

    Parameters
    ----------
    im, edp : array, shape (n,)
        Intensities and demands, positive. A censored demand is only known to be above the specified
        value.
    thresholds : sequence of float
        Demands for which the exceedance is computed, positive.
    censored : sequence of bool, shape (n,), optional
        True for censored demands; default none censored.
    lower_threshold : float
        Smaller demands that are not censored count only as below this value; default 0. Well below
        the lightest state the response is elastic and follows another line. These demands are not
        omitted, because a selection by demand would bias the line.

    Returns
    -------
    list of Fragility
        One function per threshold.

    Raises
    ------
    UsageError
        The arrays have different shapes, or a value is invalid.
    AnalysisError
        No line with a positive slope fits.
    """
    x, y = np.asarray(im, float), np.asarray(edp, float)
    above = np.zeros(x.size, bool) if censored is None else np.asarray(censored, bool)
    if x.ndim != 1 or not x.shape == y.shape == above.shape:
        raise UsageError(
            "intensities, demands and censored of a cloud must be arrays of the same length, got "
            f"the shapes {x.shape}, {y.shape} and {above.shape}"
        )
    for values, name in (
        (x, "intensities"),
        (y, "demands"),
        (np.asarray(thresholds, float), "thresholds"),
    ):
        _check_positive(values, name)
    lower_threshold = between(lower_threshold, "lower_threshold")
    below = ~above & (y < lower_threshold)
    # Small demands count only as below the limit if the remaining exact demands determine a line:
    # at least three demands at more than one intensity. Otherwise all these demands are exact.
    exact = ~(above | below)
    if not (int(np.sum(exact)) > 2 and np.unique(x[exact]).size > 1):
        below = np.zeros(x.size, bool)
    intercept, slope, sigma, covariance = _line(
        np.log(x), np.log(np.where(below, lower_threshold, y)), above, below
    )
    # The likelihood has the parameters g0 = b0 / sigma, g1 = b1 / sigma and 1 / sigma. Convert
    # their covariance to the covariance of ln theta and beta = 1 / g1 by the delta method.
    points = CloudPoints(x, y, above, below, intercept, slope, sigma)
    common_attributes = {
        "runs": x.size,
        "motions": x.size,
        "censored": int(np.sum(above)),
        "cloud": points,
    }
    inverse_beta, functions = slope / sigma, []
    for threshold in thresholds:
        ln_theta = (math.log(threshold) - intercept) / slope
        # The rows are the derivatives of ln theta and beta with respect to (g0, g1, 1 / sigma).
        jacobian = (
            np.array([[-1.0, -ln_theta, math.log(threshold)], [0.0, -1.0 / inverse_beta, 0.0]])
            / inverse_beta
        )
        function_covariance = jacobian @ covariance @ jacobian.T
        functions.append(
            _function(
                CLOUD,
                ln_theta,
                1.0 / inverse_beta,
                function_covariance,
                threshold=float(threshold),
                **common_attributes,
            )
        )
    return functions


def _line(
    x: Array, y: Array, above: NDArray[np.bool_], below: NDArray[np.bool_]
) -> tuple[float, float, float, Array]:
    """Fit the line ln EDP = b0 + b1 ln IM with the standard deviation sigma, by maximum likelihood.
    Return b0, b1, sigma, and the covariance of (b0 / sigma, b1 / sigma, 1 / sigma).

    `above` and `below` are True for demands known only to be above, or below, their value.
    AnalysisError is raised if the demands do not determine a line with a positive slope and a
    dispersion.
    """
    exact = ~(above | below)
    if not below.any() and np.unique(x[exact]).size < 3:
        raise AnalysisError(
            "a cloud requires at least three different intensities with demands that are not "
            f"censored, got {np.unique(x[exact]).size}; add runs at other intensities"
        )
    # Start from the least-squares line. If all demands are exactly on it, the dispersion is zero,
    # and the likelihood has no maximum.
    slope, intercept = np.polyfit(x[exact], y[exact], 1)
    sigma = float(np.sqrt(np.mean((y[exact] - intercept - slope * x[exact]) ** 2)))
    # A residual of this size (1e-12 of the range of ln EDP) is a rounding error.
    if not sigma > 1e-12 * float(np.ptp(y)):
        raise AnalysisError(
            "all demands are exactly on one line over the intensities: the dispersion cannot be "
            "estimated; add runs under other ground motions"
        )
    # With demands known only to be below a limit, the few exact demands may have a slope of either
    # sign. Start from the line through all demands instead.
    if below.any():
        slope, intercept = np.polyfit(x, y, 1)
        sigma = float(np.sqrt(np.mean((y - intercept - slope * x) ** 2)))
    # The standardized value z = (y - b0 - b1 x) / sigma is linear in the three parameters b0 /
    # sigma, b1 / sigma and 1 / sigma; the last parameter has the index 2.
    observed = Observations(
        np.column_stack([-np.ones(x.size), -x, y]), below, above, np.ones(x.size), 2
    )
    solution = maximize(observed, np.array([intercept, slope, 1.0]) / sigma)
    if solution is None or not solution[0][1] > 0.0:
        raise AnalysisError(
            "demands do not increase with intensity: a line with positive slope cannot be fitted"
        )
    (scaled_intercept, scaled_slope, inverse_sigma), covariance = solution
    return (
        float(scaled_intercept / inverse_sigma),
        float(scaled_slope / inverse_sigma),
        float(1.0 / inverse_sigma),
        covariance,
    )


def _function(
    fit: str, ln_theta: float, beta: float, covariance: Array, **attributes: Any
) -> Fragility:
    """Create the fragility function of a fit. AnalysisError is raised if the observations do not
    determine the median.
    """
    # The median is not determined if its 95 % confidence interval, widened by the dispersion,
    # exceeds the range of numbers in tables (LARGEST). The comparison is also False for NaN.
    half_width = _NORMAL_95 * math.sqrt(covariance[0, 0])
    if not abs(ln_theta) + half_width + beta < math.log(LARGEST):
        raise AnalysisError(
            "the observations do not determine the median: its logarithm is "
            f"{ln_theta:.3g} +- {half_width:.3g} (95 % confidence), with a dispersion of "
            f"{beta:.3g}; add observations"
        )
    return Fragility(fit, math.exp(ln_theta), beta, covariance, **attributes)


def _lognormal(
    x: Array, below: NDArray[np.bool_], above: NDArray[np.bool_], count: Array
) -> tuple[float, float, Array] | None:
    """Fit a lognormal distribution of capacities by maximum likelihood. Return the logarithm of the
    median, the dispersion, and their covariance; None if the likelihood has no maximum.

    `below` and `above` are True if the capacity is known only to be below, or above, the intensity.
    """
    # Standardized logarithms avoid a nearly singular Hessian if all intensities are similar. If all
    # are equal, their standard deviation is zero, and any scale is possible.
    logarithms = np.log(x)
    middle, spread = float(np.mean(logarithms)), float(np.std(logarithms)) or 1.0
    # The standardized value is z = a + b (ln x - middle) / spread. The parameter b is proportional
    # to 1 / sigma and has the index 1.
    observed = Observations(
        np.column_stack([np.ones(x.size), (logarithms - middle) / spread]), below, above, count, 1
    )
    solution = maximize(observed, np.array([0.0, 1.0]))
    if solution is None:
        return None
    # a + b (ln x - middle) / spread = (ln x - ln theta) / beta: convert a and b to ln theta and
    # beta.
    (a, b), covariance = solution
    jacobian = spread * np.array([[-1.0 / b, a / b**2], [0.0, -1.0 / b**2]])
    return float(middle - spread * a / b), float(spread / b), jacobian @ covariance @ jacobian.T


def empirical(capacity: Array, censored: NDArray[np.bool_]) -> Points:
    """Return the empirical distribution of capacities, some of which may be censored (Kaplan and
    Meier 1958).

    Parameters
    ----------
    capacity : ndarray, shape (n,)
        Capacities. A censored capacity is only known to be above the specified value.

    Returns
    -------
    Points
        Capacities that are not censored, in ascending order, and the fraction of records that
        exceed at each capacity: the middle of the step of the empirical distribution.
    """
    # Sort by capacity. Among equal values, the censored capacities are last, because they are above
    # the value.
    order = np.lexsort((censored, capacity))
    # `not_exceeded` is the estimated fraction of records that do not exceed below the present
    # capacity; `remaining_count` is the number of records with a capacity at or above it.
    remaining_count, not_exceeded, im, fractions = capacity.size, 1.0, [], []
    for index in order:
        if not censored[index]:
            next_not_exceeded = not_exceeded * (remaining_count - 1) / remaining_count
            im.append(float(capacity[index]))
            fractions.append(1.0 - 0.5 * (not_exceeded + next_not_exceeded))
            not_exceeded = next_not_exceeded
        remaining_count -= 1
    return Points(np.array(im), np.array(fractions))


def _check_positive(values: Array, name: str) -> None:
    """Raise UsageError if a value is not a positive number. `name` is the name of the values in the
    message, in the plural."""
    is_valid = np.isfinite(values) & (values > 0.0)
    if not np.all(is_valid):
        raise UsageError(f"{name} must be positive numbers, got {values[~is_valid][0]:g}")


def fit_at_threshold(
    threshold: float, names: tuple[str, str], fit: Callable[[], Fragility]
) -> Fragility | AnalysisError:
    """Fit a function for a threshold. If it cannot be fitted, return the error instead of raising
    it, so that the caller can report it with the other functions.

    Parameters
    ----------
    threshold : float
        Demand that is exceeded; NaN if unknown.
    """
    try:
        return fit().named(threshold, *names)
    except AnalysisError as error:
        return AnalysisError(
            f"threshold {threshold:g}: {error}" if math.isfinite(threshold) else str(error)
        )
