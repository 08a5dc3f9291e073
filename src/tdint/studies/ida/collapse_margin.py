"""Collapse margin of a building under a set of ground motions, by FEMA P-695.

Single components count as motions. The pairs are normalized by their peak velocities, and one
factor then scales all of them. S_CT is the median Sa(T) of the normalized components times the
factor where half of the components cause collapse, and the collapse margin ratio CMR is S_CT
over the intensity S_MT of the maximum considered earthquake. The spectral shape factor SSF corrects
it for the shape of rare spectra: ACMR = SSF CMR.

The scale factor where a component causes collapse does not depend on the measure of the levels,
so that it follows from the curves of an incremental dynamic analysis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.special import ndtr

from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError, did_you_mean
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.suites import GroundMotion
from tdint.number_parsing import number_or_nan, parse_named
from tdint.response.pairs import SEPARATE, join_pairs
from tdint.studies.ida.ida import IdaStudy
from tdint.studies.motions.intensity import MotionIntensity, SpectralIntensity
from tdint.studies.motions.scaling import normalization
from tdint.units import STANDARD_GRAVITY, parse_with_unit

TARGET_EPSILON = {"B": 1.0, "C": 1.0, "Dmin": 1.0, "Dmax": 1.5}
"""Target epsilon of the spectral shape factor by seismic design category (FEMA P-695, B.3)."""

RATINGS = {"superior": 0.10, "good": 0.20, "fair": 0.35, "poor": 0.50}
"""Dispersion by quality rating (FEMA P-695, tables 3-1, 3-2 and 5-3)."""

FAR_FIELD = 44
"""Number of components of the far-field set."""

_QUANTILE_10, _QUANTILE_20 = 1.2815515655446004, 0.8416212335729143
"""Standardized normal values with a probability of exceedance of 10 % and 20 %."""

_LARGEST_DUCTILITY = 8.0
"""Period-based ductility from which the spectral shape factor is constant."""

_EXAMPLE = "smt=1.5g,ductility=4,sdc=Dmax,dr=good,td=good,mdl=fair"
_PARAMETERS = dict.fromkeys(("smt", "ductility", "sdc", "dr", "td", "mdl"), True)


def collapse_factor(factors: Array) -> float:
    """Return the factor where half of the components cause collapse: value n / 2 in ascending
    order (for odd n, the median)."""
    return float(np.sort(factors)[(len(factors) - 1) // 2])


def spectral_shape_factor(ductility: float, period: float, target_epsilon: float) -> float:
    """Return the spectral shape factor (FEMA P-695, appendix B).

    Parameters
    ----------
    ductility : float
        Period-based ductility mu_T.
    period : float
        Fundamental period T, s.
    target_epsilon : float
        Target epsilon of the seismic design category (`TARGET_EPSILON`).
    """
    slope = 0.14 * (min(ductility, _LARGEST_DUCTILITY) - 1.0) ** 0.42
    epsilon = min(max(0.6 * (1.5 - period), 0.0), 0.6)
    return math.exp(slope * (target_epsilon - epsilon))


def effective_yield_displacement(
    c0: float, shear_over_weight: float, period: float, first_period: float
) -> float:
    """Return the effective yield displacement of the roof, m (FEMA P-695, 6.3).

    Parameters
    ----------
    c0 : float
        Roof displacement over displacement of the oscillator.
    shear_over_weight : float
        Maximum base shear over weight.
    period, first_period : float
        Code period T = C_u T_a and first period of the model, s.
    """
    longer = max(period, first_period)
    return c0 * shear_over_weight * STANDARD_GRAVITY * (longer / (2.0 * math.pi)) ** 2


def record_dispersion(ductility: float) -> float:
    """Return the record-to-record dispersion of the collapse intensity from the period-based
    ductility (FEMA P-695, 7.3.4)."""
    return min(max(0.1 + 0.1 * ductility, 0.2), 0.4)


@dataclass(frozen=True)
class Acceptance:
    """Design of a group of buildings for the acceptance of its collapse margins.

    Attributes
    ----------
    s_mt : float
        Intensity of the maximum considered earthquake at the period T, m/s^2.
    ductility : float
        Period-based ductility mu_T: ultimate roof displacement, where the base shear has decreased
        to 80 % of its maximum, over `effective_yield_displacement`.
    target_epsilon : float
        Of the seismic design category (`TARGET_EPSILON`).
    dispersions : tuple of float
        Dispersions of design requirements, test data and modeling (`RATINGS`).
    """

    s_mt: float
    ductility: float
    target_epsilon: float
    dispersions: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Raise UsageError for values outside their ranges."""
        if not self.s_mt > 0.0:
            raise UsageError(f"smt must be positive, got {self.s_mt:g}")
        if not 1.0 <= self.ductility < math.inf:
            raise UsageError(f"ductility must be at least 1, got {self.ductility:g}")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the design from a text such as
        `smt=1.5g,ductility=4,sdc=Dmax,dr=good,td=good,mdl=fair`.

        Raises
        ------
        UsageError
            A value is missing, unknown or outside its range.
        """
        values = parse_named("--p695", text, _PARAMETERS, _EXAMPLE)
        return cls(
            parse_with_unit(values["smt"], "acceleration", "1.5g", "smt"),
            number_or_nan(values["ductility"]),
            _choice("sdc", values["sdc"], TARGET_EPSILON),
            (
                _choice("dr", values["dr"], RATINGS),
                _choice("td", values["td"], RATINGS),
                _choice("mdl", values["mdl"], RATINGS),
            ),
        )

    @property
    def beta_rtr(self) -> float:
        """Record-to-record dispersion."""
        return record_dispersion(self.ductility)

    @property
    def beta_total(self) -> float:
        """Total dispersion of the collapse intensity."""
        return math.hypot(self.beta_rtr, *self.dispersions)

    @property
    def acmr_10(self) -> float:
        """Acceptable mean ACMR of a group: collapse probability 10 %."""
        return math.exp(_QUANTILE_10 * self.beta_total)

    @property
    def acmr_20(self) -> float:
        """Acceptable ACMR of each building: collapse probability 20 %."""
        return math.exp(_QUANTILE_20 * self.beta_total)


def _choice(key: str, text: str, values: Mapping[str, float]) -> float:
    """Return the value of a name in any case; raise UsageError if it is unknown."""
    by_name = {name.lower(): value for name, value in values.items()}
    if text.lower() not in by_name:
        raise UsageError(
            f"{key} must be one of {', '.join(values)}, got {text[:40]!r}"
            f"{did_you_mean(text, values)}"
        )
    return by_name[text.lower()]


@dataclass(frozen=True)
class CollapseMargin:
    """Collapse margin of a building.

    Attributes
    ----------
    design : Acceptance
        Intensity of the maximum considered earthquake, ductility and dispersions.
    components, censored : int
        Number of components, and of components that cause no collapse up to the largest level.
    period : float
        Fundamental period T of Sa and of the spectral shape factor, s.
    median_sa : float
        Median Sa(T) of the components of the normalized set, m/s^2.
    factor : float
        Factor on the normalized set at which half of the components cause collapse.
    """

    design: Acceptance
    components: int
    censored: int
    period: float
    median_sa: float
    factor: float

    @classmethod
    def of(
        cls, pgv: Array, sa: Array, collapse_factors: Array, design: Acceptance, *, period: float
    ) -> Self:
        """Return the margin from values of the normalized set.

        Parameters
        ----------
        pgv : ndarray, shape (n,)
            Peak ground velocity of each pair, in any unit.
        sa : ndarray, shape (n, 2)
            Sa(T) of the components, m/s^2.
        collapse_factors : ndarray, shape (n, 2)
            Factor on the normalized set at which each component causes collapse; infinite if it
            causes none.

        Raises
        ------
        AnalysisError
            Fewer than half of the components cause collapse.
        """
        factor = collapse_factor(collapse_factors.ravel())
        censored = int(np.sum(np.isinf(collapse_factors)))
        if math.isinf(factor):
            raise AnalysisError(
                f"p695: {collapse_factors.size - censored} of {collapse_factors.size} components "
                "cause collapse, and the collapse margin requires half of them; increase --max-im"
            )
        median = float(np.median(normalization(pgv)[:, np.newaxis] * sa))
        return cls(design, collapse_factors.size, censored, period, median, factor)

    @property
    def s_ct(self) -> float:
        """Median collapse intensity, m/s^2."""
        return self.median_sa * self.factor

    @property
    def cmr(self) -> float:
        """Collapse margin ratio."""
        return self.s_ct / self.design.s_mt

    @property
    def ssf(self) -> float:
        """Spectral shape factor."""
        return spectral_shape_factor(self.design.ductility, self.period, self.design.target_epsilon)

    @property
    def acmr(self) -> float:
        """Adjusted collapse margin ratio."""
        return self.ssf * self.cmr

    @property
    def sentences(self) -> list[str]:
        """Results and assumptions as sentences, with intensities in g."""
        design = self.design
        s_ct, s_mt = (value / STANDARD_GRAVITY for value in (self.s_ct, design.s_mt))
        each, group = (
            "met" if self.acmr >= limit else "not met" for limit in (design.acmr_20, design.acmr_10)
        )
        return [
            f"FEMA P-695, T {self.period:.4g} s: S_CT {s_ct:.4g} g (value n/2 of "
            f"{self.components} components, factor {self.factor:.4g} on the normalized set), S_MT "
            f"{s_mt:.4g} g, CMR {self.cmr:.4g}, SSF {self.ssf:.4g}, ACMR {self.acmr:.4g}.",
            f"Acceptance with beta_total {design.beta_total:.4g} (record-to-record "
            f"{design.beta_rtr:.3g}): ACMR of each building at least {design.acmr_20:.4g}: {each}; "
            f"mean ACMR of its group at least {design.acmr_10:.4g}: {group} by this building "
            f"alone. Probability of collapse at S_MT {100.0 * self.collapse_probability:.3g} %.",
            "Peak velocities are geometric means of the components of the records, not published "
            "values; the building moves in one direction, so that CMR is not multiplied by 1.2.",
        ]

    @property
    def collapse_probability(self) -> float:
        """Probability of collapse at the intensity of the maximum considered earthquake."""
        return float(ndtr(-math.log(self.acmr) / self.design.beta_total))


def check_motions(motions: Sequence[GroundMotion], pair_demand: str | None) -> None:
    """Raise UsageError if ground motions do not permit a collapse margin.

    Parameters
    ----------
    pair_demand : str | None
        Rule that combines the demands of the components of pairs.
    """
    if pair_demand == SEPARATE:
        raise UsageError("--p695 counts components itself; omit --pair-demand separate")
    for motion in join_pairs(motions):
        if not isinstance(motion, Horizontals):
            raise UsageError(
                f"{motion.source} {motion.component}: --p695 normalizes pairs of horizontal "
                "components, and this component has no partner; add the other component, or omit "
                "the record"
            )


def collapse_margin(study: IdaStudy, design: Acceptance) -> CollapseMargin:
    """Return the collapse margin from the curves of a study of pairs at levels of Sa at one
    period."""
    curves = study.states[0].curves
    assert isinstance(study.measure, SpectralIntensity)
    pairs = [(first, second) for second, first in sorted(study.partners.items())]
    # The peak velocity of a pair is the geometric mean of its components.
    velocity = [MotionIntensity("pgv").of(curve.record) for curve in curves]
    pgv = np.array([math.sqrt(velocity[first] * velocity[second]) for first, second in pairs])
    values = np.array(
        [[study.measure.of(curves[index].record) for index in pair] for pair in pairs]
    )
    # Scale factors of the records as they are, to which their intensities are proportional
    factors = np.full(values.shape, math.inf)
    for row, pair in enumerate(pairs):
        for column, index in enumerate(pair):
            curve = curves[index]
            if not curve.collapse.censored:
                scale = curve.runs[0].scale / curve.runs[0].im
                factors[row, column] = curve.collapse.capacity * scale
    normalized = factors / normalization(pgv)[:, np.newaxis]
    return CollapseMargin.of(pgv, values, normalized, design, period=study.measure.periods[0])
