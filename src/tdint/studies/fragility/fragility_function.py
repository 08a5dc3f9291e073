"""Fragility function: its parameters with their uncertainty, and the observations of its fit.

Cloud with collapses: a line through the demands of the motions that the building survives, and a
logistic probability of collapse (Jalayer and Cornell 2009; Jalayer et al. 2017).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, ndtr, ndtri, stdtrit

from tdint.arrays import Array, immutable
from tdint.errors import AnalysisError, UsageError
from tdint.fractiles import RELIABLE
from tdint.items import grouped
from tdint.number_parsing import abbreviate, pluralize
from tdint.tabular import Described
from tdint.units import ACCELERATION, LENGTH, VELOCITY, OutputUnits

_MAX_STEPS = 100  # of Newton's method; it converges in about ten
_FRACTIONS = (0.16, 0.84)
"""Probabilities of the intensities from which the equivalent dispersion follows."""

_MAX_DISTANCE = 30.0
"""Distance from the median of the survivors, in logarithms of the intensity, of the search for an
intensity."""


class CollapseCloud(NamedTuple):
    """Parameters of ln d = b0 + b1 ln s with the deviation sigma for the survivors, and of the
    collapse probability 1 / (1 + exp(-a0 - a1 ln s))."""

    b0: float
    b1: float
    sigma: float
    a0: float
    a1: float

    def collapse_probability(self, im: Array) -> Array:
        """Return the probability of collapse at intensities."""
        with np.errstate(divide="ignore"):  # intensity 0
            return np.asarray(expit(self.a0 + self.a1 * np.log(im)))

    def exceedance(self, limit: float, im: Array, dispersion: float = 0.0) -> Array:
        """Return the probability that the demand exceeds a limit at intensities, averaged over a
        lognormal modeling factor of the intensity with this dispersion."""
        if dispersion:
            with np.errstate(divide="ignore"):
                ln_im = np.log(im)
            return modeling_average(lambda x: self.exceedance(limit, np.exp(x)), ln_im, dispersion)
        collapse = self.collapse_probability(im)
        with np.errstate(divide="ignore"):
            z = (self.b0 + self.b1 * np.log(im) - math.log(limit)) / self.sigma
        return np.asarray(collapse + (1.0 - collapse) * ndtr(z))

    def intensity(self, limit: float, probability: float) -> float:
        """Return the intensity where a limit is exceeded with a probability."""
        from scipy.optimize import brentq  # imported late: other commands do not need it

        def excess(ln_im: float) -> float:
            """Return the exceedance minus the probability."""
            return float(self.exceedance(limit, np.exp(ln_im))) - probability

        median = (math.log(limit) - self.b0) / self.b1
        ends = median - _MAX_DISTANCE, median + _MAX_DISTANCE
        return math.exp(brentq(excess, *ends, xtol=1e-13))

    def lognormal(self, limit: float) -> tuple[float, float]:
        """Return the intensity where the exceedance of a limit is 50 %, and the equivalent
        dispersion: that of a lognormal function with the same 16 and 84 % points."""
        low, high = (self.intensity(limit, probability) for probability in _FRACTIONS)
        width = float(ndtri(_FRACTIONS[1]) - ndtri(_FRACTIONS[0]))
        return self.intensity(limit, 0.5), math.log(high / low) / width

    def in_units(self, factor: float) -> CollapseCloud:
        """Return the parameters for intensities that are multiplied by a factor."""
        logarithm = math.log(factor)
        return self._replace(b0=self.b0 - self.b1 * logarithm, a0=self.a0 - self.a1 * logarithm)


_DEVIATIONS = np.linspace(-10.0, 10.0, 81)
"""Standard normal deviations of the modeling factor, at a distance that integrates probabilities
within 1e-9 unless they rise within a tenth of the dispersion."""

_WEIGHTS = np.exp(-0.5 * _DEVIATIONS**2) / np.sum(np.exp(-0.5 * _DEVIATIONS**2))


def modeling_average(
    probability: Callable[[Array], Array], ln_im: Array, dispersion: float
) -> Array:
    """Return the mean of a probability at ln_im + dispersion Z, where Z is a standard normal
    variable: the collapses of a cloud remain in it. Without dispersion it is the probability."""
    return np.asarray(
        sum(
            weight * probability(ln_im + dispersion * deviation)
            for weight, deviation in zip(_WEIGHTS, _DEVIATIONS, strict=True)
        )
    )


def collapse_line(im: Array, collapsed: NDArray[np.bool_], weight: Array) -> tuple[float, float]:
    """Fit the probability of collapse 1 / (1 + exp(-a0 - a1 ln s)) by maximum likelihood, and
    return a0 and a1.

    Raises
    ------
    AnalysisError
        The likelihood has no maximum, or the probability does not increase with the intensity.
    """
    if im[collapsed].min() > im[~collapsed].max():
        raise AnalysisError(
            "all collapses are at higher intensities than all other motions, so that the logistic "
            "probability of collapse has no finite maximum of the likelihood; use --fit stripes, "
            "or add motions"
        )
    design = np.column_stack([np.ones(im.size), np.log(im)])
    a = np.zeros(2)
    for _ in range(_MAX_STEPS):
        p = expit(design @ a)
        information = (design.T * (weight * p * (1.0 - p))) @ design
        if not np.isfinite(information).all() or np.linalg.cond(information) > 1e14:
            break
        step = np.linalg.solve(information, design.T @ (weight * (collapsed - p)))
        a = a + step
        if np.max(np.abs(step)) < 1e-12 * max(1.0, float(np.max(np.abs(a)))):
            if a[1] > 0.0:
                return float(a[0]), float(a[1])
            break
    raise AnalysisError(
        "the probability of collapse does not increase with the intensity: a logistic function "
        "cannot be fitted; use --fit stripes, or add motions"
    )


STRIPES, IDA, CLOUD = "stripes", "ida", "cloud"
JACKKNIFE, INFORMATION, NORMAL = "jackknife", "information", "normal"
"""Methods of standard errors: jackknife over ground motions; inverse of the observed information;
normal distribution of the logarithms, beta / sqrt(n) and beta / sqrt(2 n)."""

FITS = (STRIPES, IDA, CLOUD)
"""Names of the available fits."""

GIVEN = "given"
"""Fit of a function whose median and dispersion are given."""

_MOST_NAMES = 10
"""Maximum number of names of functions in a message, so that the message stays readable."""

_TWO_SIDED = 1.96
"""Standard errors of a two-sided 95 % interval of a normal distribution, as in texts."""

NORMAL_95 = 1.959963984540054
"""Half width of the interval around the mean that contains 95 % of a normal distribution, in
standard deviations."""

BINS = 6
"""Number of intensity bins where exceedances are counted. Fewer bins would hide a bend; with
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
    censored : ndarray of bool, shape (n,)
        True for censored demands and collapses.
    intercept, slope, sigma : float
        Line ln EDP = intercept + slope ln IM, and standard deviation of ln EDP.
    mixture : CollapseCloud | None
        Function with collapses; None without collapses.
    collapsed : int
        Number of motions with collapse, which are not points of the line.
    """

    im: Array
    edp: Array
    censored: NDArray[np.bool_]
    intercept: float
    slope: float
    sigma: float
    mixture: CollapseCloud | None = None
    collapsed: int = 0


@dataclass(frozen=True)
class Risk:
    """Mean annual frequency of exceeding a limit, by a hazard curve; intensities are in the unit of
    the function.

    Attributes
    ----------
    annual_frequency, annual_frequency_error : float
        Frequency and its standard error, 1/year.
    probability_50_years : float
        Probability of at least one exceedance in 50 years.
    frequency_below, frequency_above : float
        Contributions of intensities below the first and above the last point of the curve, 1/year.
    above_low, above_high : float
        Bounds of `frequency_above` that hold for every continuation of the curve: its last rate
        times the probability of exceedance there, and its last rate, 1/year.
    contributing_im : float
        Median contributing intensity: half of the frequency is from lower intensities.
    risk_targeted_theta, risk_targeted_im : float
        Median intensity with a probability of 1 % in 50 years for a dispersion of 0.6, and the
        intensity with a conditional probability of 10 %. They depend on the curve alone.
    """

    annual_frequency: float
    annual_frequency_error: float
    probability_50_years: float
    frequency_below: float
    frequency_above: float
    above_low: float
    above_high: float
    contributing_im: float
    risk_targeted_theta: float
    risk_targeted_im: float

    @property
    def share_outside(self) -> float:
        """Fraction of the frequency from intensities outside the points of the curve."""
        return (self.frequency_below + self.frequency_above) / self.annual_frequency

    @property
    def uncertainty_outside(self) -> float:
        """Largest change of the frequency by another continuation of the curve, as a fraction of
        the frequency. A part above the curve where the probability is 1 is known."""
        return (self.above_high - self.above_low + self.frequency_below) / self.annual_frequency

    def in_units(self, factor: float) -> Risk:
        """Return the values for intensities that are multiplied by a factor."""
        return replace(
            self,
            contributing_im=factor * self.contributing_im,
            risk_targeted_theta=factor * self.risk_targeted_theta,
            risk_targeted_im=factor * self.risk_targeted_im,
        )

    def text(self, unit: str) -> str:
        """Return a clause with the frequency, the probability and the contributing intensity."""
        error = ""
        if not math.isnan(self.annual_frequency_error):
            error = f" (standard error {self.annual_frequency_error:.2g})"
        return (
            f"annual frequency {self.annual_frequency:.4g}{error}, "
            f"{100.0 * self.probability_50_years:.3g} % in 50 years, median contributing intensity "
            f"{self.contributing_im:.4g} {unit}".rstrip()
        )

    def target_text(self, unit: str) -> str:
        """Return a sentence with the risk target of the hazard curve."""
        return (
            "Risk target (ASCE 7-16 21.2.1.2: probability of collapse 1 % in 50 years, dispersion "
            f"0.6): median {self.risk_targeted_theta:.4g} {unit}, intensity with 10 % probability "
            f"of collapse {self.risk_targeted_im:.4g} {unit}".rstrip()
            + "."
        )


@immutable
class Fragility(Described):
    """Fragility function: the probability of exceedance is Phi(ln(im / theta) / beta), except for a
    cloud with collapses (`CollapseCloud`).

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
        For stripes with failed runs: the fits with all failed runs counted as exceeding, and as not
        exceeding; None if a fit is not available.
    extrapolated : str
        Reason why the observations do not cover the median; empty if they do.
    pair_demand : str
        Rule that combines the components of pairs (`tdint.response.pairs`); empty without
        pairs.
    motions : int
        Number of ground motions of the runs; both components of a recording are one. If the runs
        have events, it is the number of events. Runs of a table that states neither are assumed to
        be under separate ground motions.
    error_method : str
        Method of the standard errors: `jackknife`, `information` or `normal`; empty if they are
        unknown.
    loss_increment : float
        Loss ratio of the damage state minus that of the state before it; nan without losses.
    annual_loss : float
        Expected annual loss ratio of the building type by a hazard curve; nan if it is unknown.
    beta_within, beta_between : float
        Root mean square of the beta of each draw of the properties, and standard deviation of the
        logarithm of its theta; nan without draws, or if a draw alone determines no function.
    points : Points | None
        Observations for figures.
    cloud : CloudPoints | None
        Observations and line of a cloud.
    counted : Counted | None
        Counts to be compared with the function.
    risk, total_risk : Risk | None
        Annual frequency by a hazard curve (`tdint.studies.fragility.hazard`), without and with the
        modeling dispersion.
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
    error_method: str = ""
    loss_increment: float = math.nan
    annual_loss: float = math.nan
    beta_within: float = math.nan
    beta_between: float = math.nan
    points: Points | None = field(default=None, repr=False)
    cloud: CloudPoints | None = field(default=None, repr=False)
    counted: Counted | None = field(default=None, repr=False)
    risk: Risk | None = field(default=None, repr=False)
    total_risk: Risk | None = field(default=None, repr=False)

    def _headline(self) -> str:
        return f"by {self.fit}: theta {self.theta:.4g} {self.unit}, beta {self.beta:.4g}"

    is_drift_ratio: bool = False

    @property
    def draws_text(self) -> str:
        """Clause on the dispersions of the draws of the properties; empty without draws."""
        if math.isnan(self.beta_within):
            return ""
        return f"beta within draws {self.beta_within:.3g}, between draws {self.beta_between:.3g}"

    @property
    def theta_error(self) -> float:
        """Standard error of ln theta."""
        return math.sqrt(self.covariance[0, 0])

    @property
    def beta_error(self) -> float:
        """Standard error of beta."""
        return math.sqrt(self.covariance[1, 1])

    @property
    def theta_interval(self) -> tuple[float, float]:
        """95 % confidence interval of theta. The standard error is the error of ln theta."""
        # Moments of capacities are those of a normal sample: Student's distribution.
        is_sample = self.error_method == NORMAL
        factor = math.exp(
            (stdtrit(self.motions - 1, 0.975) if is_sample else _TWO_SIDED) * self.theta_error
        )
        return self.theta / factor, self.theta * factor

    @property
    def beta_interval(self) -> tuple[float, float]:
        """95 % confidence interval of beta, which is not negative."""
        half_width = _TWO_SIDED * self.beta_error
        return max(self.beta - half_width, 0.0), self.beta + half_width

    @property
    def initial_damage(self) -> str:
        """State of the building before a ground motion, such as `damaged to 2 %`; empty if it is
        unknown."""
        return "" if math.isnan(self.damage) else initial_damage(self.damage)

    @property
    def beta_total(self) -> float:
        """Total dispersion: root of the sum of squares of `beta` and `modeling_dispersion`."""
        return math.hypot(self.beta, self.modeling_dispersion)

    def probability(self, im: Array | float, *, total: bool = False) -> Array:
        """Return the probability of exceedance, Phi(ln(im / theta) / beta), at intensities; with
        collapses in a cloud, the mixture.

        Parameters
        ----------
        im : ndarray or float
            Intensities, in the unit of theta.
        total : bool
            True to include the modeling dispersion; default False.
        """
        mixture = self.cloud and self.cloud.mixture
        if mixture:
            modeling = self.modeling_dispersion if total else 0.0
            return mixture.exceedance(self.threshold, np.asarray(im), modeling)
        with np.errstate(divide="ignore"):  # zero at the intensity 0, with the logarithm -inf
            logarithm = np.log(im / self.theta)
        return np.asarray(ndtr(logarithm / (self.beta_total if total else self.beta)))

    @property
    def has_band(self) -> bool:
        """True if the standard errors determine a confidence band: its limits decrease with the
        intensity if the standard error of beta is too large. A jackknife over few ground motions
        determines no band, because its standard errors are uncertain themselves."""
        is_known = bool(np.isfinite(self.covariance).all())
        is_sufficient = self.error_method != JACKKNIFE or self.motions >= RELIABLE
        return is_known and is_sufficient and NORMAL_95 * self.beta_error < self.beta

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
        return np.asarray(ndtr(z - NORMAL_95 * error)), np.asarray(ndtr(z + NORMAL_95 * error))

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
        # Divide the intensities into at most `BINS` bins with about equal numbers of runs. With few
        # levels, each level is a bin. Otherwise the bin of a level is determined by the fraction of
        # the runs below its middle run. Bins may be empty and are renumbered.
        bin_index = level = levels_of(im)
        runs_at_level = np.bincount(level, weight)
        if runs_at_level.size > BINS:
            fraction_below = np.cumsum(runs_at_level) - 0.5 * runs_at_level
            fraction_below /= np.sum(runs_at_level)
            bin_index = np.floor(BINS * fraction_below).astype(np.intp)[level]
        bin_index = np.unique(bin_index, return_inverse=True)[1]
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

        The runs cover the median if between 10 % and 90 % of the runs exceed the state, and if the
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
        unknown = np.full((2, 2), math.nan)
        return replace(self, extrapolated=reason, covariance=unknown, error_method="")

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
            mixture = cloud.mixture and cloud.mixture.in_units(factor)
            cloud = replace(cloud, im=factor * cloud.im, intercept=intercept, mixture=mixture)
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
            risk=self.risk and self.risk.in_units(factor),
            total_risk=self.total_risk and self.total_risk.in_units(factor),
            bounds=(first_bound, second_bound),
            **converted,
        )


def initial_damage(damage: float) -> str:
    """Return the text for the state of a building before a ground motion, such as `damaged to 2 %`.

    `damage` is the drift ratio reached in a previous ground motion; 0 for an undamaged building.
    """
    return f"damaged to {100.0 * damage:g} %" if damage else "intact"


def extrapolated(functions: Sequence[Fragility]) -> list[str]:
    """Return messages about functions with an extrapolated median.

    Each reason for an extrapolation has one message, which lists the functions that the reason
    concerns.
    """
    names_by_reason = grouped(
        (function.extrapolated, function.exceeded or "the threshold")
        for function in functions
        if function.extrapolated
    )
    return [
        f"{reason} {abbreviate(names, _MOST_NAMES)}: the median is extrapolated"
        for reason, names in sorted(names_by_reason.items(), reverse=True)
    ]


SAME_LEVEL = 1e-6
"""Relative difference of intensities below which they belong to one level."""


def levels_of(im: Array) -> NDArray[np.intp]:
    """Return the index of the level of each intensity, from 0 for the lowest level.

    In ascending order, neighboring intensities belong to the same level if their logarithms differ
    by at most `SAME_LEVEL`, which for this small value is their relative difference.

    Parameters
    ----------
    im : ndarray, shape (n,)
        Intensities, positive, in any order.
    """
    # A level starts where the logarithm of the sorted intensities increases by more than the
    # tolerance; the number of beginnings up to an intensity is the index of its level. With
    # `prepend`, the first difference is zero.
    order = np.argsort(im)
    ln_lowest = math.log(float(im[order[0]]))
    is_next_level = np.diff(np.log(im[order]), prepend=ln_lowest) > SAME_LEVEL
    result = np.empty(im.size, np.intp)
    result[order] = np.cumsum(is_next_level)
    return result
