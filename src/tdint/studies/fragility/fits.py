"""Fragility functions: lognormal distributions of the intensity where a threshold is exceeded.

Three fits are available:

- Stripes: numbers of exceedances at intensity levels (multiple stripe analysis; Baker 2015,
  Earthquake Spectra 31(1), doi 10.1193/021113EQS025M).
- Capacities of an incremental dynamic analysis: by their moments, or by maximum likelihood if some
  capacities are censored (Baker 2015, eq. 9).
- Cloud: a line through the logarithms of demand over intensity (Jalayer 2003). Some demands may be
  censored, that is, known only to be above a limit.

All fits use the likelihood of normal observations. Some observations are censored. Each observation
i has a standardized value z_i = x_i . p, which is linear in the parameters p. The logarithm of the
likelihood is therefore concave (Pratt 1981; Olsen 1978), and Newton's iteration converges to its
unique maximum. An exact value adds ln(1 / sigma) - z^2 / 2 to the logarithm, where 1 / sigma is one
of the parameters. A value that is certainly below a limit adds ln Phi(z); a value that is certainly
above a limit adds ln Phi(-z).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from tdint.arrays import Array, Numbers
from tdint.errors import AnalysisError, UsageError
from tdint.number_parsing import LARGEST
from tdint.response.arguments import between
from tdint.studies.fragility import fragility_function

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


_MIN_DISPERSION = 1e-9
"""Minimum dispersion of capacities. Smaller values are rounding errors of equal capacities."""


def fit_stripes(im: Numbers, exceeding: Numbers, records: Numbers) -> fragility_function.Fragility:
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
        fragility_function.STRIPES,
        *solution,
        runs=int(np.sum(record_counts)),
        motions=int(np.sum(record_counts)),
        error_method=fragility_function.INFORMATION,
        points=fragility_function.Points(im_levels, exceeding_counts / record_counts),
    )


def fit_levels(
    im: Array,
    level: NDArray[np.intp],
    exceeding: Array,
    is_used: NDArray[np.bool_],
    weight: Array | None = None,
) -> fragility_function.Fragility:
    """Fit a lognormal distribution to runs at intensity levels (`fit_stripes`).

    Parameters
    ----------
    im : ndarray, shape (n,)
        Intensities. Within a level, they differ by rounding errors only; their geometric mean is
        used.
    level : ndarray, shape (n,)
        Number of the level of each run (`levels_of`).
    exceeding : ndarray, shape (n,)
        Probability that each run exceeds.
    is_used : ndarray, shape (n,)
        Mask of the runs of the fit.
    weight : ndarray, shape (n,), optional
        Number of equal buildings of each run; default 1.
    """
    # Number the levels without gaps, as `bincount` requires.
    level_number = np.unique(level[is_used], return_inverse=True)[1]
    weights = np.ones(level_number.size) if weight is None else weight[is_used]
    records = np.bincount(level_number, weights)
    im_levels = np.exp(np.bincount(level_number, weights * np.log(im[is_used])) / records)
    # The sum of probabilities may exceed the number of runs by rounding errors.
    exceeding_counts = np.minimum(np.bincount(level_number, weights * exceeding[is_used]), records)
    return fit_stripes(im_levels, exceeding_counts, records)


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
        reason = "every record exceeds at every level"
        if not exceeding_counts.any():
            reason = "no record exceeds at any level"
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


def fit_capacities(
    capacity: Numbers, censored: Sequence[bool] | None = None
) -> fragility_function.Fragility:
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
        fragility_function.IDA,
        *solution,
        runs=x.size,
        motions=x.size,
        censored=int(np.sum(above)),
        points=empirical(x, above),
        error_method=fragility_function.INFORMATION if above.any() else fragility_function.NORMAL,
    )


def fit_cloud(
    im: Numbers,
    edp: Numbers,
    thresholds: Numbers,
    censored: Sequence[bool] | NDArray[np.bool_] | None = None,
    *,
    collapsed: Sequence[bool] | NDArray[np.bool_] | None = None,
    weight: Numbers | None = None,
    dispersion: float = 0.0,
) -> list[fragility_function.Fragility]:
    """Fit a fragility function for each threshold to a cloud, by maximum likelihood.

    The model is ln EDP = b0 + b1 ln IM + sigma N, where N is a standard normal variable. The
    functions have theta = exp((ln threshold - b0) / b1) and beta = sigma / b1. The line is the line
    of maximum likelihood, with a sigma that is on average too small (by 11 % for ten demands): it
    divides the squared residuals by their number n. It is multiplied by sqrt(n / (n - 2)), so that
    sigma of a regression without censored demands divides by n - 2, as usual. n is the number of
    demands that are not censored.

    With collapses, the line is fitted to the motions that the building survives, and the
    probability of collapse is a logistic function of ln IM, fitted to all motions (Jalayer and
    Cornell 2009). Each function then is a mixture (`CollapseCloud`), which is not lognormal: theta
    is its 50 % point, and beta follows from its 16 and 84 % points.

    Parameters
    ----------
    im, edp : array, shape (n,)
        Intensities and demands, positive. A censored demand is only known to be above the specified
        value; the demand of a collapse is not used.
    thresholds : sequence of float
        Demands for which the exceedance is computed, positive.
    censored : sequence of bool, shape (n,), optional
        True for censored demands; default none censored.
    collapsed : sequence of bool, shape (n,), optional
        True for motions with collapse; default no collapse.
    weight : sequence of float, shape (n,), optional
        Number of equal buildings of each demand, relative to the others; default equal weights. n
        in sqrt(n / (n - 2)) remains the number of demands.
    dispersion : float
        Standard deviation of the logarithm of each threshold; default 0. It is part of beta.

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
    above, fell = (
        np.zeros(x.size, bool) if mask is None else np.asarray(mask, bool)
        for mask in (censored, collapsed)
    )
    if x.ndim != 1 or not x.shape == y.shape == above.shape == fell.shape:
        raise UsageError(
            "intensities, demands and censored of a cloud must be arrays of the same length, got "
            f"the shapes {x.shape}, {y.shape} and {above.shape}"
        )
    if fell.all():
        raise AnalysisError(
            "every motion causes collapse: a cloud requires motions without collapse"
        )
    # Figures show collapses above all demands.
    y = np.where(fell, max(np.max(y[~fell]), *np.asarray(thresholds, float)), y)
    for values, name in (
        (x, "intensities"),
        (y, "demands"),
        (np.asarray(thresholds, float), "thresholds"),
    ):
        _check_positive(values, name)
    weights = np.ones(x.size) if weight is None else np.asarray(weight, float)
    intercept, slope, sigma, covariance = _line(
        np.log(x[~fell]), np.log(y[~fell]), above[~fell], weights[~fell] / np.mean(weights[~fell])
    )
    exact_count = int(np.sum(~(above | fell)))
    sigma *= math.sqrt(exact_count / (exact_count - 2.0))
    scatter = math.hypot(sigma, between(dispersion, "dispersion"))
    # The likelihood has the parameters g0 = b0 / sigma, g1 = b1 / sigma and 1 / sigma. Convert
    # their covariance to the covariance of ln theta and beta = 1 / g1 by the delta method.
    points = fragility_function.CloudPoints(x, y, above | fell, intercept, slope, sigma)
    common_attributes: dict[str, Any] = {
        "runs": x.size,
        "motions": x.size,
        "censored": int(np.sum(above | fell)),
        "cloud": points,
    }
    if fell.any():
        collapse = fragility_function.collapse_line(x, fell, weights / np.mean(weights))
        mixture = fragility_function.CollapseCloud(intercept, slope, scatter, *collapse)
        points = replace(points, mixture=mixture, collapsed=int(np.sum(fell)))
        common_attributes["cloud"] = points
        unknown = np.full((2, 2), math.nan)
        return [
            fragility_function.Fragility(
                fragility_function.CLOUD,
                *mixture.lognormal(float(threshold)),
                unknown,
                threshold=float(threshold),
                **common_attributes,
            )
            for threshold in thresholds
        ]
    inverse_beta, functions = slope / scatter, []
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
                fragility_function.CLOUD,
                ln_theta,
                1.0 / inverse_beta,
                function_covariance,
                threshold=float(threshold),
                error_method=fragility_function.INFORMATION,
                **common_attributes,
            )
        )
    return functions


def _line(
    x: Array, y: Array, above: NDArray[np.bool_], weight: Array
) -> tuple[float, float, float, Array]:
    """Fit the line ln EDP = b0 + b1 ln IM with the standard deviation sigma, by maximum likelihood.
    Return b0, b1, sigma, and the covariance of (b0 / sigma, b1 / sigma, 1 / sigma).

    `above` is True for demands known only to be above their value. AnalysisError is raised if the
    demands do not determine a line with a positive slope and a dispersion.
    """
    exact = ~above
    if np.unique(x[exact]).size < 3:
        raise AnalysisError(
            "a cloud requires at least three different intensities with demands that are not "
            f"censored, got {np.unique(x[exact]).size}; add runs at other intensities"
        )
    # Start from the least-squares line. If all demands are exactly on this line, the dispersion is
    # zero, and the likelihood has no maximum.
    slope, intercept = np.polyfit(x[exact], y[exact], 1)
    sigma = float(np.sqrt(np.mean((y[exact] - intercept - slope * x[exact]) ** 2)))
    # A residual of this size (1e-12 of the range of ln EDP) is a rounding error.
    if not sigma > 1e-12 * float(np.ptp(y)):
        raise AnalysisError(
            "all demands are exactly on one line over the intensities: the dispersion cannot be "
            "estimated; add runs under other ground motions"
        )
    # The standardized value z = (y - b0 - b1 x) / sigma is linear in the three parameters b0 /
    # sigma, b1 / sigma and 1 / sigma; the last parameter has the index 2.
    design = np.column_stack([-np.ones(x.size), -x, y])
    observed = Observations(design, np.zeros(x.size, bool), above, weight, 2)
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
) -> fragility_function.Fragility:
    """Create the fragility function of a fit. AnalysisError is raised if the observations do not
    determine the median.
    """
    # The median is not determined if its 95 % confidence interval, widened by the dispersion,
    # exceeds the range of numbers in tables (LARGEST). The comparison is also False for NaN.
    half_width = fragility_function.NORMAL_95 * math.sqrt(covariance[0, 0])
    if not abs(ln_theta) + half_width + beta < math.log(LARGEST):
        raise AnalysisError(
            "the observations do not determine the median: its logarithm is "
            f"{ln_theta:.3g} +- {half_width:.3g} (95 % confidence), with a dispersion of "
            f"{beta:.3g}; add observations"
        )
    return fragility_function.Fragility(fit, math.exp(ln_theta), beta, covariance, **attributes)


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


def empirical(capacity: Array, censored: NDArray[np.bool_]) -> fragility_function.Points:
    """Return the empirical distribution of capacities, some of which may be censored (Kaplan and
    Meier 1958).

    Returns
    -------
    Points
        Capacities that are not censored, in ascending order, and the fraction of records that
        exceed at each capacity: the middle of the step of the empirical distribution.
    """
    # Sort by capacity. In a group of equal values, the censored capacities are last, because they
    # are above the value.
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
    return fragility_function.Points(np.array(im), np.array(fractions))


def _check_positive(values: Array, name: str) -> None:
    """Raise UsageError if a value is not a positive number. `name` is the name of the values in the
    message, in the plural."""
    is_valid = np.isfinite(values) & (values > 0.0)
    if not np.all(is_valid):
        raise UsageError(f"{name} must be positive numbers, got {values[~is_valid][0]:g}")
