"""Mean annual frequency of exceeding a limit: a fragility function and a hazard curve.

H(s) is the mean annual rate of ground motions with an intensity above s. The frequency of exceeding
the limit is lambda = integral of F(s) |dH(s)| with the fragility function F (Cornell 1996). Between
two points of the curve, and continued outside, ln H is linear in ln s: H = k0 s^-k.

Integration by parts gives lambda = integral of H(s) dF(s). The intensities that contribute half of
this integral are below the median contributing intensity. For a lognormal F the integral over a
segment is k0 theta^-k exp(k^2 beta^2 / 2) (Phi(z_b + k beta) - Phi(z_a + k beta)), with
z = ln(s / theta) / beta.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr, ndtri

from tdint.arrays import Array
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError
from tdint.number_parsing import abbreviate
from tdint.studies.fragility.fragility_function import (
    CollapseCloud,
    Fragility,
    Risk,
    modeling_average,
)
from tdint.studies.motions.intensity import PAIRS
from tdint.units import GROUND_MOTION, canonical, parse_units, suffix

YEARS = 50.0
"""Period of time of probabilities, in years."""

TARGET_PROBABILITY, TARGET_BETA, TARGET_PERCENTILE = 0.01, 0.6, 0.1
"""Risk target of ASCE 7-16 21.2.1.2 (Luco et al. 2007): probability of collapse in 50 years,
dispersion, and probability of collapse at the intensity of the design."""

WARNED_UNCERTAINTY, LARGEST_UNCERTAINTY = 0.01, 0.1
"""Uncertainties of a frequency (`Risk.uncertainty_outside`) that cause a warning and an error."""

_NEEDS = (
    "a hazard curve is a CSV file with the columns im,unit,rate (1/year) or "
    "im,unit,probability,years, and optionally im_name"
)

_SAME_PERIOD = 0.005
"""Largest relative difference of equal periods: a period that is rounded to three digits."""

_FAR = 60.0
"""Distance in ln s from the curve to the limits of a numerical search or integral."""

_STEP = 1e-4
"""Relative change of ln theta and beta for derivatives, whose truncation error is its square."""


@dataclass(frozen=True, eq=False)
class HazardCurve:
    """Mean annual rates of exceeding intensities.

    Attributes
    ----------
    im, rate : ndarray, shape (n,)
        Intensities in ascending order, and decreasing rates in 1/year; at least two.
    im_name, unit : str
        Intensity measure and unit; empty if the file does not state them.
    source : str
        Name of the file.
    """

    im: Array
    rate: Array
    im_name: str = ""
    unit: str = ""
    source: str = ""

    @property
    def _slopes(self) -> Array:
        """Slope k of each segment, shape (n + 1,): the end slopes continue outside the points."""
        slopes = -np.diff(np.log(self.rate)) / np.diff(np.log(self.im))
        return np.concatenate([slopes[:1], slopes, slopes[-1:]])

    def rates(self, im: Array | float) -> Array:
        """Return the mean annual rates of exceeding intensities, also outside the points."""
        return np.exp(self._ln_rates(np.log(im)))

    def _ln_rates(self, ln_im: Array | float) -> Array:
        """Return the logarithms of the rates at logarithms of intensities."""
        points = np.log(self.im)
        segment = np.searchsorted(points, ln_im)
        start = np.maximum(segment - 1, 0)
        return np.log(self.rate)[start] - self._slopes[segment] * (ln_im - points[start])

    def _ln_contributions(self, theta: float, beta: float, ln_im: float = math.inf) -> float:
        """Return the logarithm of the integral of H dF below an intensity, for a lognormal function
        F; by default that of the frequency."""
        points, slopes = np.log(self.im), self._slopes
        ends = np.minimum(np.concatenate([[-math.inf], points, [math.inf]]), ln_im)
        z = (ends - math.log(theta)) / beta
        low, high = z[:-1] + slopes * beta, z[1:] + slopes * beta
        # Differences of the distribution function in the tail where they are accurate, as
        # logarithms, because exp(k^2 beta^2 / 2) may overflow.
        is_upper = low > 0.0
        low, high = np.where(is_upper, -high, low), np.where(is_upper, -low, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            larger = log_ndtr(high)
            difference = larger + np.log1p(-np.exp(log_ndtr(low) - larger))
        # ln(k0 theta^-k) is the logarithm of the rate of the segment, continued to theta.
        start = np.concatenate([[0], np.arange(points.size)])
        at_theta = np.log(self.rate)[start] - slopes * (math.log(theta) - points[start])
        parts = at_theta + 0.5 * (slopes * beta) ** 2 + difference
        return float(np.logaddexp.reduce(np.where(high > low, parts, -math.inf)))

    def _mixture_contributions(
        self, mixture: CollapseCloud, threshold: float, modeling: float
    ) -> Callable[[float], float]:
        """Return the integral of H dF below an intensity as a function of its logarithm, for a
        cloud with collapses and a modeling dispersion, by the trapezoidal rule.

        AnalysisError is raised if the integral is infinite: the collapse probability decreases as
        s^a1 for small intensities, and the rates increase as s^-k.
        """
        if mixture.a1 <= self._slopes[0]:
            raise AnalysisError(
                f"{self.source}: the frequency is infinite, because the logistic probability of "
                f"collapse (exponent {mixture.a1:.3g}) decreases more slowly toward small "
                f"intensities than the rates increase (exponent {self._slopes[0]:.3g}); use --fit "
                "stripes"
            )
        ends = math.log(self.im[0]) - _FAR, math.log(self.im[-1]) + _FAR
        # With 2e5 intervals, the error is below 1e-6.
        ln_im = np.union1d(np.linspace(*ends, 200_001), np.log(self.im))
        probability = mixture.exceedance(threshold, np.exp(ln_im))
        if modeling:  # interpolated, which takes a tenth of the time of new probabilities
            points = ln_im, probability
            probability = modeling_average(lambda x: np.interp(x, *points), ln_im, modeling)
        rate = np.exp(self._ln_rates(ln_im))
        parts = 0.5 * (rate[1:] + rate[:-1]) * np.diff(probability)
        total = np.concatenate([[0.0], np.cumsum(parts)])
        return lambda limit: float(np.interp(limit, ln_im, total))

    def risk(self, function: Fragility, *, total: bool = False) -> Risk:
        """Return the annual frequency of exceeding the limit of a function.

        Parameters
        ----------
        function : Fragility
            Function with its median in the unit of the curve.
        total : bool
            True to include the modeling dispersion; default False.

        Raises
        ------
        AnalysisError
            The frequency of a cloud with collapses is infinite.
        """
        theta, beta = function.theta, function.beta_total if total else function.beta
        mixture = function.cloud and function.cloud.mixture
        if mixture:
            modeling = function.modeling_dispersion if total else 0.0
            contributions = self._mixture_contributions(mixture, function.threshold, modeling)
        else:

            def contributions(ln_im: float) -> float:
                """Return the integral of H dF below an intensity."""
                return math.exp(self._ln_contributions(theta, beta, ln_im))

        from scipy.optimize import brentq  # imported late: other commands do not need it

        frequency = contributions(math.inf)
        first, last = np.log(self.im[[0, -1]]).tolist()
        # The integral of F |dH| below an intensity is the integral of H dF minus H F.
        exceedance = function.probability(self.im[[0, -1]], total=total) * self.rate[[0, -1]]
        below = contributions(first) - float(exceedance[0])
        above = frequency - contributions(last) + float(exceedance[1])
        median = brentq(
            lambda ln_im: contributions(ln_im) - 0.5 * frequency,
            min(first, math.log(theta)) - float(np.max(self._slopes)) * beta**2 - _FAR,
            max(last, math.log(theta)) + _FAR,
        )
        return Risk(
            frequency,
            frequency * self._relative_error(function, total=total),
            probability_in(YEARS, frequency),
            max(below, 0.0),
            above,
            float(exceedance[1]),
            float(self.rate[-1]),
            math.exp(median),
            *self.risk_target(),
        )

    def _relative_error(self, function: Fragility, *, total: bool) -> float:
        """Return the standard error of ln lambda from the covariance of ln theta and beta. For a
        cloud with collapses, it is the error for the equivalent lognormal function."""
        modeling = function.modeling_dispersion if total else 0.0

        def ln_frequency(factor_of_theta: float, factor_of_beta: float) -> float:
            """Return ln lambda for other values of theta and beta."""
            beta = math.hypot(function.beta * factor_of_beta, modeling)
            return self._ln_contributions(function.theta * factor_of_theta, beta)

        up, down = math.exp(_STEP), math.exp(-_STEP)
        width = 2.0 * _STEP
        by_theta = (ln_frequency(up, 1.0) - ln_frequency(down, 1.0)) / width
        by_beta = (ln_frequency(1.0, up) - ln_frequency(1.0, down)) / (width * function.beta)
        gradient = np.array([by_theta, by_beta])
        return math.sqrt(gradient @ function.covariance @ gradient)

    def risk_target(self) -> tuple[float, float]:
        """Return the median collapse intensity of the risk target, and the intensity with its
        conditional probability of collapse, both in the unit of the curve."""
        from scipy.optimize import brentq

        target = math.log(rate_of(TARGET_PROBABILITY, YEARS))
        ends = math.log(self.im[0]) - _FAR, math.log(self.im[-1]) + _FAR
        ln_theta = brentq(
            lambda value: self._ln_contributions(math.exp(value), TARGET_BETA) - target, *ends
        )
        deviation = float(ndtri(TARGET_PERCENTILE)) * TARGET_BETA
        return math.exp(ln_theta), math.exp(ln_theta + deviation)

    def in_unit(self, function: Fragility) -> HazardCurve:
        """Return the curve in the unit of the intensities of a function.

        Raises
        ------
        ModelError
            Curve and function have different intensity measures or quantities, or only one of them
            states a unit.
        """
        if difference := _difference(self.im_name, function.im):
            raise ModelError(
                f"{self.source}:2: {difference}: the hazard curve is for {self.im_name}, the "
                f"fragility function for {function.im}; use a hazard curve for {function.im}"
            )
        if self.unit == function.unit:
            return self
        for units in GROUND_MOTION.values():
            if self.unit in units and function.unit in units:
                factor = units[self.unit] / units[function.unit]
                return replace(self, im=factor * self.im, unit=function.unit)
        raise ModelError(
            f"{self.source}:2: the unit of the hazard curve is {self.unit or 'not stated'}, the "
            f"unit of the fragility function is {function.unit or 'not stated'}; state units of "
            "the same quantity in a column `unit` of both tables"
        )


def probability_in(years: float, rate: float) -> float:
    """Return the probability of at least one event in a number of years, for a mean annual rate
    (Poisson process)."""
    return -math.expm1(-rate * years)


def rate_of(probability: Array | float, years: Array | float) -> Array:
    """Return the mean annual rate of events from the probability of at least one event in a number
    of years (Poisson process)."""
    return np.asarray(-np.log1p(-np.asarray(probability)) / years)


def _difference(hazard: str, function: str) -> str:
    """Return what differs between two names of intensity measures, such as `rotd50-sa(1.0)`; empty
    if they agree, or if one of them does not state it."""
    if not hazard or not function:
        return ""
    pattern = re.compile(rf"(?:({'|'.join(PAIRS)})-)?([^(]*)(?:\((.*)\))?")
    matches = [pattern.fullmatch(name.lower().replace(" ", "")) for name in (hazard, function)]
    (pair, measure, period), (other_pair, other_measure, other_period) = (
        match.groups(default="") if match else ("", "", "") for match in matches
    )
    if measure != other_measure:
        return "other intensity measure"
    if pair and other_pair and pair != other_pair:
        return "other combination of the components of a pair"
    try:
        same = math.isclose(float(period), float(other_period), rel_tol=_SAME_PERIOD)
    except ValueError:
        same = period == other_period
    return "" if same else "other period"


def read_hazard(source: str) -> HazardCurve:
    """Read a hazard curve from a CSV file.

    The intensities are the column `im`, with their unit in the column `unit`, in the name of the
    column (`im_g`) or in the cells. The rates are the column `rate` (1/year), or follow from the
    columns `probability` and `years`.

    Raises
    ------
    ModelError
        The file is not a hazard curve, with the line.
    """
    table = read_table(source, _NEEDS)
    im_column, im, unit = _intensities(table)
    if table.has("rate") == table.has("probability"):
        raise ModelError(
            f"{source}:{table.header_line}: either the column rate, or the columns probability and "
            f"years are required; {_NEEDS}"
        )
    column = "rate" if table.has("rate") else "probability"
    rate = np.array(table.numbers(column, positive=True))
    if column == "probability":
        table.check(column, rate < 1.0, "must be below 1")
        rate = rate_of(rate, np.array(table.numbers("years", positive=True)))
    if im.size < 2:
        raise ModelError(f"{source}: a hazard curve requires at least two points, got {im.size}")
    table.check(
        im_column, np.diff(im, prepend=0.0) > 0.0, "must be larger than the intensity above it"
    )
    table.check(
        column,
        np.diff(rate, prepend=math.inf) < 0.0,
        "must be smaller than in the row above it, because rates decrease strictly with the "
        "intensity",
    )
    return HazardCurve(im, rate, table.only("im_name"), unit, source)


def _intensities(table: CsvTable) -> tuple[str, Array, str]:
    """Return the name of the column of intensities, the intensities, and their unit."""
    unit_of_suffix = {suffix(unit): unit for units in GROUND_MOTION.values() for unit in units}
    for name in table.header:
        named = re.fullmatch(r"im(_\w+|\s*[(\[].*[)\]])", name)
        unit = named and (unit_of_suffix.get(named[1]) or canonical(named[1]))
        if unit in unit_of_suffix.values():
            return name, np.array(table.numbers(name, positive=True)), str(unit)
    if table.has("unit"):
        unit = canonical(table.only("unit"))
        return "im", np.array(table.numbers("im", positive=True)), unit
    # Cells with units, such as `0.1 g`
    texts = table.texts("im", empty=False)
    if texts and all(re.search(r"[a-zA-Z%]", re.sub(r"[eE][-+]?\d+", "", text)) for text in texts):
        cells = [parse_units(text) for text in texts]
        si_unit = next(iter(GROUND_MOTION[cells[0].quantity]))
        return "im", np.array([cell.scale for cell in cells]), si_unit
    return "im", np.array(table.numbers("im", positive=True)), ""


def at_risk(
    functions: Sequence[Fragility], hazard: HazardCurve, *, allow_outside: bool = False
) -> tuple[list[Fragility], list[str]]:
    """Return functions with their annual frequencies, and warnings.

    Parameters
    ----------
    allow_outside : bool
        True to accept frequencies that other continuations of the curve would change by more than
        10 %; default False.

    Raises
    ------
    ModelError
        Curve and functions have different intensity measures or units.
    AnalysisError
        Other continuations of the curve would change a frequency by more than 10 %.
    """
    results, warnings = list[Fragility](), list[str]()
    measures = [*dict.fromkeys(function.im for function in functions if function.im)]
    if not hazard.im_name and (len(measures) > 1 or any("T1" in name for name in measures)):
        warnings.append(
            f"{hazard.source}: the hazard curve does not state its intensity measure and period "
            f"(column im_name), but the functions are in {abbreviate(measures, 4)}: one curve "
            "cannot be that of all"
        )
    for function in functions:
        curve = hazard.in_unit(function)
        total = curve.risk(function, total=True) if function.modeling_dispersion else None
        risk = curve.risk(function)
        risks = [item for item in (risk, total) if item]
        worst = max(risks, key=lambda item: item.uncertainty_outside)
        if worst.uncertainty_outside > WARNED_UNCERTAINTY:
            name = f"{function.exceeded}: " if function.exceeded else ""
            of_total = " with the modeling dispersion" if worst is total else ""
            text = (
                f"{name}{100.0 * worst.share_outside:.3g} % of the annual frequency{of_total} is "
                f"from intensities outside the points of {hazard.source} ({curve.im[0]:.4g} to "
                f"{curve.im[-1]:.4g} {curve.unit}), where the end slopes of the curve are "
                "continued; another continuation may change the frequency by "
                f"{100.0 * worst.uncertainty_outside:.3g} %"
            )
            if worst.uncertainty_outside > LARGEST_UNCERTAINTY and not allow_outside:
                raise AnalysisError(
                    f"{text}; at most {100.0 * LARGEST_UNCERTAINTY:g} % is allowed: add points to "
                    "the curve, or use --allow-outside"
                )
            warnings.append(text)
        results.append(replace(function, risk=risk, total_risk=total))
    return [replace(item, annual_loss=_annual_loss(item, results)) for item in results], warnings


def _annual_loss(function: Fragility, functions: Sequence[Fragility]) -> float:
    """Return the expected annual loss ratio of the type of a function: the integral of the mean
    loss over the hazard, which is the sum over the damage states of the increment of the loss ratio
    times the annual frequency, with the modeling dispersion if there is one."""
    losses = [
        item.loss_increment * (item.total_risk or item.risk).annual_frequency
        for item in functions
        if item.type == function.type and item.risk
    ]
    return math.fsum(losses) if losses else math.nan
