"""Factors that scale a suite of ground motions: to a value, to a target spectrum, by ASCE 7, EN
1998-1, FEMA P-695.

One factor for both components of a pair.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tdint.analysis.given import AnyMotion, motion_of, numbers_of
from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.analysis.spectra.target import TargetSpectrum, read_target
from tdint.arrays import Array
from tdint.campaign.intensity import (
    GEOMETRIC_MEAN,
    IntensityMeasure,
    MotionIntensity,
    SpectralIntensity,
    factor_to,
    measure_of,
    pga,
    pseudo_accelerations,
    sa,
)
from tdint.errors import UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.suites import GroundMotion, components
from tdint.tabular import Tabular
from tdint.written_numbers import how_many

LEAST_PAIRS = 11
"""Ground motions that ASCE 7-16 asks for (16.2.2)."""

_CLOSE, _MOST = 1e-6, 20_000
"""By what part the least average may be lower than it is told, and at how many periods it is looked
for at the most: motions that match their target are low everywhere."""

LEAST_PART = 0.9
"""Part of the target below which the average may nowhere fall (ASCE 7-16, 16.2.3.2; EN 1998-1:2004,
3.2.3.1.2(4))."""

FEW = 3
"""Motions below which a mean of them is hardly one."""

BOUNDS = (0.25, 4.0)
"""Factors beyond which a motion is asked for what it was not: bounds of common practice, of no
code."""

_AT_LIMIT = 1e-6
"""Relative difference up to which a factor is at a limit: the least average is known to this."""

POSSIBLE = (0.05, 20.0)
"""Factors beyond which the units of a motion are more likely mistaken than meant."""

MAXIMUM_DIRECTION = "rotd100"


@dataclass(frozen=True, repr=False)
class Scaling(Tabular):
    """The factors of a suite, and by which rule.

    Attributes
    ----------
    motions : tuple of Record or of Horizontals
        The suite, as it was read.
    factors : ndarray, shape (n,)
        One for each motion.
    rule : str
        `value`, `mean`, `asce7`, `ec8` or `p695`.
    pair : str
        What stands for a pair of components: a name of `PAIRS`.
    damping : float
        Damping ratio of spectra.
    measure : IntensityMeasure or None, value : float or None
        What the motions were scaled to, if it is a value (SI units).
    target : TargetSpectrum or None
        What they were scaled to, if it is a spectrum.
    periods : ndarray, shape (k,)
        Where the target was compared, s; none without a target.
    least : tuple of two floats or None
        Of the rules asce7 and ec8: the least average over the target, and its period, s.
    chosen : tuple of int
        Of a selection the places of the motions among those that it was made from (`tdint.select`).
    left_out : mapping of str to int
        Of a selection how many motions were not taken, by the reason.
    events : tuple of str
        Of a selection with a maximum per event the event of each motion.
    limits : tuple of two floats or None
        Of a selection the smallest and the largest factor.
    others_at_limit : int
        Of a selection the number of motions that were not selected and would have a factor at a
        limit.
    rest : ndarray, shape (m, k), or None
        Of a selection the scaled spectra of the others at `periods`, m/s^2.
    """

    motions: tuple[GroundMotion, ...]
    factors: Array
    rule: str
    pair: str
    damping: float
    measure: IntensityMeasure | None = None
    value: float | None = None
    target: TargetSpectrum | None = None
    periods: Array | None = None
    least: tuple[float, float] | None = None
    chosen: tuple[int, ...] = ()
    left_out: dict[str, int] = field(default_factory=dict)
    rest: Array | None = None
    events: tuple[str, ...] = ()
    limits: tuple[float, float] | None = None
    others_at_limit: int = 0

    def _headline(self) -> str:
        low, high = np.min(self.factors), np.max(self.factors)
        return (
            f"of {how_many(len(self.motions), 'motion')} by the rule {self.rule}, factors "
            f"{low:.4g} to {high:.4g}"
        )

    def beyond(self, low: float, high: float) -> list[tuple[str, float]]:
        """The motions whose factors lie outside these, and the factors."""
        return [
            (f"{components(motion)[0].source} {motion.component}".rstrip(), float(factor))
            for motion, factor in zip(self.motions, self.factors, strict=True)
            if not low <= abs(factor) <= high
        ]

    @property
    def at_limit(self) -> list[tuple[str, float]]:
        """The motions of a selection whose factors are at a limit, and the factors."""
        if self.limits is None:
            return []
        low, high = self.limits
        return self.beyond(low * (1.0 + _AT_LIMIT), high * (1.0 - _AT_LIMIT))

    def spectra(self, periods: Array) -> Array:
        """Pseudo-accelerations of the scaled motions, m/s^2, shape (n, k)."""
        return self.factors[:, None] * suite_spectra(self.motions, periods, self.damping, self.pair)


def suite_spectra(
    motions: Sequence[GroundMotion], periods: Array, damping: float, pair: str
) -> Array:
    """Pseudo-accelerations of motions at periods (s), m/s^2, shape (n, k)."""
    return np.array([pseudo_accelerations(motion, periods, damping, pair) for motion in motions])


def suite_peaks(motions: Sequence[GroundMotion], pair: str) -> Array:
    """Return the peak ground accelerations of motions, m/s^2, shape (n,)."""
    return np.array([pga().of(motion, pair) for motion in motions])


def scale_to_value(
    motions: Sequence[GroundMotion],
    measure: IntensityMeasure,
    value: float,
    pair: str = GEOMETRIC_MEAN,
) -> Scaling:
    """Scale each motion to a value of an intensity measure (SI units).

    Raises
    ------
    UsageError
        The value is not positive.
    RecordError
        A motion is zero.
    """
    if not (math.isfinite(value) and value > 0.0):
        raise UsageError(f"{measure.name}: the value must be positive, got {value:g}")
    factors = np.array([factor_to(value, measure, measure.of(motion, pair)) for motion in motions])
    damping = getattr(measure, "damping", SA_DAMPING)
    return Scaling(tuple(motions), factors, "value", pair, damping, measure, value)


def scale_to_target(
    motions: Sequence[GroundMotion],
    target: TargetSpectrum,
    periods: Array,
    *,
    damping: float = SA_DAMPING,
    pair: str = GEOMETRIC_MEAN,
) -> Scaling:
    """Scale each motion to a target spectrum: least squares of ln Sa over the periods, each with
    the same weight.

    The factor is exp(mean(ln target - ln Sa)).

    Parameters
    ----------
    periods : ndarray, shape (k,)
        Periods, s, within those of the target.

    Raises
    ------
    UsageError
        A period is outside the target's.
    """
    aim = target.at(periods)
    spectra = suite_spectra(motions, periods, damping, pair)
    factors = np.exp(np.mean(np.log(aim) - np.log(spectra), axis=1))
    return Scaling(tuple(motions), factors, "mean", pair, damping, target=target, periods=periods)


def scale_asce7(
    pairs: Sequence[GroundMotion],
    target: TargetSpectrum,
    periods: Array,
    *,
    damping: float = SA_DAMPING,
    pair: str = MAXIMUM_DIRECTION,
) -> Scaling:
    """Scale pairs as ASCE 7-16 asks (16.2.3.2): the average of maximum-direction spectra is nowhere
    in the range below 90 % of the target.

    Each pair is fitted to the target by `scale_to_target`; where the average then falls below 90 %
    of it, all are raised by one more factor, so that it just does not. What stands for a pair the
    rule says, whatever `pair` is.

    Raises
    ------
    UsageError
        Fewer than 11 pairs; single components; a period outside the target's.
    """
    check_rule("asce7", pairs, len(pairs), target)
    fitted = scale_to_target(pairs, target, periods, damping=damping, pair=MAXIMUM_DIRECTION)
    return raise_to_rule(fitted, "asce7")


def scale_ec8(
    motions: Sequence[GroundMotion],
    target: TargetSpectrum,
    periods: Array,
    *,
    damping: float = SA_DAMPING,
    pair: str = GEOMETRIC_MEAN,
) -> Scaling:
    """Scale motions as EN 1998-1:2004 asks (3.2.3.1.2(4)): the mean spectrum is nowhere in the
    range below 90 % of the target, and the mean of the peak ground accelerations not below the
    target at the period 0, which is ag S.

    Each motion is fitted to the target by `scale_to_target`; where the mean then falls short, all
    are raised by one more factor, so that it just does not.

    Raises
    ------
    UsageError
        A period outside the target's; a target without a value at the period 0.
    """
    check_rule("ec8", motions, len(motions), target)
    fitted = scale_to_target(motions, target, periods, damping=damping, pair=pair)
    return raise_to_rule(fitted, "ec8")


def check_rule(
    rule: str, motions: Sequence[GroundMotion], count: int, target: TargetSpectrum
) -> None:
    """Refuse ground motions or a target to which a rule cannot be applied.

    Parameters
    ----------
    rule : str
        `mean`, `asce7` or `ec8`.
    motions : sequence of Record or Horizontals
        The motions.
    count : int
        Number of motions to which the rule applies.
    target : TargetSpectrum
        The target spectrum.

    Raises
    ------
    UsageError
        Single components or fewer than 11 pairs for asce7; a target without a value at the period
        0 for ec8; an unknown rule.
    """
    by_rule(rule)
    if rule == "asce7":
        _check_pairs(motions, rule)
        if count < LEAST_PAIRS:
            raise UsageError(
                f"the rule asce7 needs {LEAST_PAIRS} pairs of components at least (16.2.2), got "
                f"{count}"
            )
    if rule == "ec8" and target.zero is None:
        raise UsageError(
            f"{target.source}: the rule ec8 compares at the period 0, too, which the table does "
            "not have"
        )


def raise_to_rule(fitted: Scaling, rule: str) -> Scaling:
    """Return a fitted suite with all factors multiplied by the common factor of a rule.

    Parameters
    ----------
    fitted : Scaling
        The suite with the factor of each motion.
    rule : str
        `mean` (without a common factor), `asce7` or `ec8`; `check_rule` has accepted the suite.
    """
    if rule == "mean":
        return fitted
    at_least = 1.0
    if rule == "ec8":
        assert fitted.target is not None
        assert fitted.target.zero is not None
        peaks = fitted.factors * suite_peaks(fitted.motions, fitted.pair)
        at_least = fitted.target.zero / float(np.mean(peaks))
    average, period = _least(fitted)
    raised = max(1.0, at_least, LEAST_PART / average)
    return replace(
        fitted, factors=raised * fitted.factors, rule=rule, least=(raised * average, period)
    )


def _least(fitted: Scaling) -> tuple[float, float]:
    """The least average spectrum over the target in the whole range of the periods, and its period,
    s.

    Between two periods it cannot be lower than its slope on logarithmic axes allows (Piyavskii
    1972; Shubert 1972): intervals in which it may be are halved. The slope of a spectrum is at most
    about that of an oscillator's resonance curve, 1 / (2 damping), that of a code's branches is 2
    at most.
    """
    target, periods = fitted.target, fitted.periods
    assert target is not None
    assert periods is not None
    slope = 0.5 / fitted.damping + 2.0
    low, high = float(np.min(periods)), float(np.max(periods))
    inside = target.periods[
        (target.periods > low) & (target.periods < high)
    ]  # its corners among them
    # Halve intervals until none can hide anything lower than the lowest found.
    x, y = np.empty(0), np.empty(0)
    new = np.log(np.unique([*periods, *inside]))
    while new.size and x.size < _MOST:
        at = np.exp(new).clip(low, high)
        average = np.log(np.mean(fitted.spectra(at), axis=0) / target.at(at))
        order = np.argsort(np.concatenate([x, new]))
        x, y = np.concatenate([x, new])[order], np.concatenate([y, average])[order]
        bound = 0.5 * (y[1:] + y[:-1] - slope * np.diff(x))
        new = 0.5 * (x[1:] + x[:-1])[bound < np.min(y) - _CLOSE]
    place = int(np.argmin(y))
    return float(np.exp(y[place])), float(np.exp(x[place]))


def scale_p695(
    pairs: Sequence[GroundMotion],
    period: float | None = None,
    value: float | None = None,
    *,
    damping: float = SA_DAMPING,
) -> Scaling:
    """Normalize pairs by their peak velocities, and scale the set, as FEMA P-695 does (A.8).

    The factor of a pair is median(PGV) / PGV, with PGV the geometric mean of its components; with a
    period and a value all get one more factor, by which the median Sa of all components at that
    period is the value.

    Parameters
    ----------
    period, value : float, optional
        Period, s, and pseudo-acceleration, m/s^2; both or none.

    Raises
    ------
    UsageError
        Single components; a value without a period, or one that is not positive.
    RecordError
        A motion is zero.
    """
    _check_pairs(pairs, "p695")
    if (period is None) != (value is None):
        raise UsageError("a set is scaled to a pseudo-acceleration at a period: give both or none")
    # Normalized by the peak velocities first: what motions differ by in magnitude and distance
    # goes.
    velocities = np.array([MotionIntensity("pgv").of(pair) for pair in pairs])
    factors = np.median(velocities) / velocities
    if period is None or value is None:
        return Scaling(tuple(pairs), factors, "p695", GEOMETRIC_MEAN, damping)
    if not (math.isfinite(value) and value > 0.0):
        raise UsageError(f"Sa({period:g} s): the value must be positive, got {value:g}")
    measure = sa(period, damping)
    # Then one factor for the whole set, so that differences between the motions stay.
    values = [
        factor * measure.of(record)
        for pair, factor in zip(pairs, factors, strict=True)
        for record in components(pair)
    ]
    factors = factors * (value / float(np.median(values)))
    return Scaling(tuple(pairs), factors, "p695", GEOMETRIC_MEAN, damping, measure, value)


def scale(
    motions: Sequence[AnyMotion],
    measure: IntensityMeasure | str | None = None,
    value: float | None = None,
    *,
    target: TargetSpectrum | str | None = None,
    rule: str = "mean",
    periods: Sequence[float] | Array | None = None,
    damping: float = SA_DAMPING,
    pair: str = GEOMETRIC_MEAN,
) -> Scaling:
    """Factors that scale ground motions to a value of an intensity measure, or to a target
    spectrum.

    Parameters
    ----------
    motions : sequence
        Records, paths or traces; a tuple of two, or what `read_horizontals` gives, is a pair with
        one factor.
    measure : IntensityMeasure or str
        `pga`, `pgv`, `arias`, `cav`, `sa(1.0)` or `sa-avg(1.0)` with the period in s.
    value : float
        Its value, m/s^2 or m/s.
    target : TargetSpectrum or str
        Instead: a file of a spectrum, or the text of a design spectrum
        (`tdint.analysis.spectra.target.read_target`).
    rule : str
        For a target: `mean` (each motion by least squares of ln Sa), `asce7` or `ec8`; for pairs
        without a target also `p695`, which takes a measure `sa(T)` and its value or none.
    periods : sequence of float, optional
        Where the target is met, s; by default 100 in equal ratios over all of it.
    damping : float
        Damping ratio of the spectra.
    pair : str
        What stands for a pair: a name of `tdint.campaign.intensity.PAIRS`.

    Returns
    -------
    Scaling
        A factor for each motion, and what it does to it.

    Raises
    ------
    UsageError
        Neither a value nor a target, or both; an unknown measure or rule; periods beyond the
        target.
    RecordError
        A motion is none, or zero.
    """
    suite = [motion_of(motion) for motion in motions]
    chosen = measure_of(measure, damping) if isinstance(measure, str) else measure
    if target is not None:
        if chosen is not None or value is not None:
            raise UsageError("a target and a value are given; motions are scaled to one of them")
        spectrum, places = target_at(target, periods)
        return by_rule(rule)(suite, spectrum, places, damping=damping, pair=pair)
    if rule == "p695":
        of = chosen.periods if isinstance(chosen, SpectralIntensity) else ()
        if chosen is not None and (len(of) != 1 or of == (0.0,)):
            raise UsageError(
                f"the rule p695 scales a set on to a value of sa(T), got {chosen.name}"
            )
        return scale_p695(suite, of[0] if of else None, value, damping=damping)
    if chosen is None or value is None:
        raise UsageError("nothing to scale to: give a measure and its value, or a target")
    return scale_to_value(suite, chosen, value, pair)


_PLACES = 100  # periods of a comparison: 30 or more a decade
_RULES: dict[str, Callable[..., Scaling]] = {
    "mean": scale_to_target,
    "asce7": scale_asce7,
    "ec8": scale_ec8,
}


def target_at(
    target: TargetSpectrum | str, periods: Sequence[float] | Array | None
) -> tuple[TargetSpectrum, Array]:
    """A target, and the periods at which it is met: those given, or some over all of it."""
    aim = read_target(target) if isinstance(target, str) else target
    ends = float(aim.periods[0]), float(aim.periods[-1])
    return aim, np.geomspace(*ends, _PLACES) if periods is None else numbers_of(periods, "periods")


def by_rule(rule: str) -> Callable[..., Scaling]:
    """What scales motions to a target by a rule: (motions, target, periods, damping=, pair=) ->
    Scaling.

    Raises
    ------
    UsageError
        There is no such rule.
    """
    if rule not in _RULES:
        raise UsageError(f"unknown rule {rule!r:.60}; known for a target: {', '.join(_RULES)}")
    return _RULES[rule]


def _check_pairs(pairs: Sequence[GroundMotion], rule: str) -> None:
    if not all(isinstance(pair, Horizontals) for pair in pairs):
        raise UsageError(f"the rule {rule} is for pairs of horizontal components")
