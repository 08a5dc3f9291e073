"""Scale a suite of ground motions to a value, to a target spectrum, or by ASCE 7, EN 1998-1 or FEMA
P-695.

Both components of a pair have the same factor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from tdint.arrays import Array, Numbers, immutable
from tdint.errors import UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.suites import GroundMotion, components
from tdint.ground_motion.record import Record
from tdint.response.arguments import AnyMotion, motion_of, numbers_of
from tdint.response.pairs import join_pairs, suite_text
from tdint.response.spectra.elastic import SA_DAMPING, checked_periods
from tdint.response.spectra.target import TargetSpectrum, read_targets
from tdint.studies.motions import intensity
from tdint.tabular import Tabular

RULES = ("mean", "asce7", "ec8")
"""Rules for a target spectrum."""

MIN_MOTIONS = {
    "asce7": (11, "pairs of components", "ASCE 7-16, 16.2.2"),
    "ec8": (3, "ground motions", "EN 1998-1:2004, 3.2.3.1.2(4)"),
}
"""Minimum number of ground motions of a rule, what is counted, and source."""

_MIN_TOLERANCE, _MAX_PERIODS = 1e-6, 20_000
"""Relative tolerance of the minimum of the average spectrum divided by the target, and maximum
number of periods where the average is computed. If motions match their target closely, the
average is close to the minimum at many periods."""

_MIN_DAMPING = 1e-4
"""Damping ratio below which the slope of a spectrum no longer increases: within the 800 periods in
which the amplitude would decay to 60 %, a ground motion ends."""

MIN_AVERAGE_RATIO = 0.9
"""Minimum of the average divided by the target (ASCE 7-16, 16.2.3.2; EN 1998-1:2004,
3.2.3.1.2(4))."""

BOUNDS = (0.25, 4.0)
"""Minimum and maximum factor in common practice, not from a code. A motion with a factor outside of
this range does not represent its earthquake."""

_LIMIT_TOLERANCE = 1e-6
"""Relative difference up to which a factor is at a limit; equal to the tolerance of the minimum
average."""

POSSIBLE = (0.05, 20.0)
"""Range of factors outside which wrong units of a motion are likely."""

MAXIMUM_DIRECTION = "rotd100"
"""Spectrum of a pair that ASCE 7 prescribes: maximum over all horizontal directions."""


@immutable
class Scaling(Tabular):
    """Scale factors of a suite.

    Attributes
    ----------
    motions : tuple of Record or of Horizontals
        The unscaled suite.
    factors : ndarray, shape (n,)
        Factor of each motion.
    rule : str
        `value`, `mean`, `asce7`, `ec8` or `p695`.
    pair : str
        Spectrum that represents a pair of components: a name of `PAIRS`.
    damping : float
        Damping ratio of spectra.
    measure : IntensityMeasure | None
        Intensity measure to which the motions were scaled.
    value : float | None
        Value of the intensity measure (SI units).
    target : TargetSpectrum | None
        Target spectrum to which the motions were scaled.
    periods : ndarray, shape (k,)
        Periods of the comparison with the target, s; None without a target.
    least : tuple of two floats | None
        For the rules asce7 and ec8: minimum over the periods of the average spectrum divided by the
        target, and the period of this minimum, s.
    chosen : tuple of int
        For a selection: indices of the selected motions in the candidates (`tdint.select`).
    left_out : mapping of str to int
        For a selection: number of motions that were not considered, by reason.
    events : tuple of str
        For a selection with a maximum per event: event of each motion.
    limits : tuple of two floats
        For a selection: minimum and maximum factor.
    others_at_limit : int
        For a selection: number of motions that were not selected and would have a factor at a
        limit.
    unselected_spectra : ndarray, shape (m, k), or None
        For a selection: scaled spectra at `periods` of the motions that were not selected, m/s^2.
    target_std : ndarray, shape (k,), or None
        For a selection: target standard deviation of ln Sa at `periods`.
    """

    motions: tuple[GroundMotion, ...]
    factors: Array
    rule: str
    pair: str
    damping: float
    measure: intensity.IntensityMeasure | None = None
    value: float | None = None
    target: TargetSpectrum | None = None
    periods: Array | None = None
    least: tuple[float, float] | None = None
    chosen: tuple[int, ...] = ()
    left_out: dict[str, int] = field(default_factory=dict)
    unselected_spectra: Array | None = None
    events: tuple[str, ...] = ()
    limits: tuple[float, float] = (0.0, math.inf)
    others_at_limit: int = 0
    target_std: Array | None = None

    def _headline(self) -> str:
        """Return the number of motions, the rule, and the range of the factors."""
        low, high = np.min(self.factors), np.max(self.factors)
        return f"of {self.suite} by the rule {self.rule}, factors {low:.4g} to {high:.4g}"

    @property
    def suite(self) -> str:
        """Numbers of components, recordings and pairs (`suite_text`)."""
        return suite_text([i for i, motion in enumerate(self.motions) for _ in components(motion)])

    @property
    def noun(self) -> str:
        """Noun for one of the motions: record, pair, or recording if there are both."""
        nouns = {"record" if isinstance(item, Record) else "pair" for item in self.motions}
        return nouns.pop() if len(nouns) == 1 else "recording"

    @property
    def target_text(self) -> str:
        """Target as text: the spectrum as on the command line, or the intensity measure and its
        value, such as `sa(0.5) = 2.942 m/s^2`; empty for a suite that was only normalized."""
        if self.target is not None:
            return self.target.source
        if self.measure is None or self.value is None:
            return ""
        return f"{self.measure.name} = {self.value:.4g} {self.measure.unit}"

    def beyond(self, low: float, high: float) -> list[tuple[str, float]]:
        """Return the motions with an absolute scale factor outside a range.

        Parameters
        ----------
        low, high : float
            Minimum and maximum of the range.

        Returns
        -------
        list of (str, float)
            File and component of each motion outside the range, and its factor.
        """
        return [
            (motion.name, float(factor))
            for motion, factor in zip(self.motions, self.factors, strict=True)
            if not low <= abs(factor) <= high
        ]

    @property
    def at_limit(self) -> list[tuple[str, float]]:
        """Motions of a selection with a factor at one of the limits, as file and component, and
        their factors; empty if the selection has no limits."""
        # A factor that equals a limit except for rounding is outside the slightly reduced range.
        low, high = self.limits
        return self.beyond(low * (1.0 + _LIMIT_TOLERANCE), high * (1.0 - _LIMIT_TOLERANCE))

    def spectra(self, periods: Array) -> Array:
        """Return the pseudo-accelerations of the n scaled motions, m/s^2, shape (n, k).

        Parameters
        ----------
        periods : ndarray, shape (k,)
            Periods, s.
        """
        return self.factors[:, None] * suite_spectra(self.motions, periods, self.damping, self.pair)


def suite_spectra(
    motions: Sequence[GroundMotion], periods: Array, damping: float, pair: str
) -> Array:
    """Return the pseudo-accelerations of n motions at k periods, m/s^2, shape (n, k)."""
    return np.array(
        [intensity.pseudo_accelerations(motion, periods, damping, pair) for motion in motions]
    )


def _check_value(measure: intensity.IntensityMeasure, value: float) -> None:
    """Raise UsageError if a value of an intensity measure is not a positive number."""
    if not (math.isfinite(value) and value > 0.0):
        raise UsageError(f"{measure.name}: the value must be positive, got {value:g}")


def pair_of_rule(rule: str, pair: str) -> str:
    """Return the spectrum that represents a pair with a rule: `pair`, unless the rule prescribes
    it."""
    return MAXIMUM_DIRECTION if rule == "asce7" else pair


def check_rule(rule: str, motions: Sequence[GroundMotion], target: TargetSpectrum) -> None:
    """Raise UsageError if a scaling rule cannot be applied to ground motions and a target.

    Parameters
    ----------
    rule : str
        `mean`, `asce7` or `ec8`.

    Raises
    ------
    UsageError
        Single components are used with asce7, or a target without a value at the period 0 with ec8;
        the rule is unknown.
    """
    if rule not in RULES:
        raise UsageError(
            f"unknown rule {rule!r:.60}; the rules for a target are {', '.join(RULES)}"
        )
    if rule == "asce7":
        _check_pairs(motions, rule)
    if rule == "ec8" and target.zero is None:
        raise UsageError(
            f"{target.source}: the rule ec8 requires the target at the period 0; add it to the "
            "table"
        )


def missing_motions(rule: str, count: int) -> str:
    """Return a text if a rule requires more ground motions than `count`; otherwise ""."""
    needed, motions, source = MIN_MOTIONS.get(rule, (0, "", ""))
    if count >= needed:
        return ""
    return f"the rule {rule} requires at least {needed} {motions} ({source}), got {count}"


def raise_to_rule(fitted: Scaling, rule: str) -> Scaling:
    """Multiply all factors of a suite by the smallest common factor that satisfies a rule, and
    return the scaled suite.

    Parameters
    ----------
    fitted : Scaling
        The suite with the factor of each motion.
    rule : str
        `mean` (without a common factor), `asce7` or `ec8`; `check_rule` has accepted the suite.

    Returns
    -------
    Scaling
        The suite with the increased factors, and the resulting minimum average (`least`).
    """
    if rule == "mean":
        return fitted
    target, periods = fitted.target, fitted.periods
    assert target is not None
    assert periods is not None
    peak_factor = 1.0
    if rule == "ec8":
        assert target.zero is not None
        peaks = [intensity.pga().of(motion, fitted.pair) for motion in fitted.motions]
        peak_factor = target.zero / float(np.mean(fitted.factors * np.array(peaks)))
    # The minimum of the average spectrum divided by the target may be between the specified
    # periods. A lower bound between two periods follows from the maximum slope on logarithmic axes
    # (Piyavskii 1972; Shubert 1972). Intervals with a bound below the current minimum are halved.
    # The slope of a spectrum is at most about 1 / (2 damping), as in the resonance curve of an
    # oscillator; the slope of the branches of a code spectrum is at most 2.
    max_slope = 0.5 / max(fitted.damping, _MIN_DAMPING) + 2.0
    positive_periods = checked_periods(periods, zero=False)  # for logarithms
    first_period, last_period = float(np.min(positive_periods)), float(np.max(positive_periods))
    # The first periods are the specified periods and the periods of the target, which may be
    # corners of its spectrum.
    corner_periods = target.periods[
        (target.periods > first_period) & (target.periods < last_period)
    ]
    # `ln_period` and `ln_ratio` are the sorted logarithms of the evaluated periods and of the
    # average divided by the target. Each pass evaluates the new periods, and halves the intervals
    # that may contain a ratio below the current minimum. The loop ends without such an interval, or
    # at the maximum number of periods; the intervals are then too short for a relevant change.
    ln_period, ln_ratio = np.empty(0), np.empty(0)
    new_ln_periods = np.log(np.unique([*periods, *corner_periods]))
    while new_ln_periods.size and ln_period.size < _MAX_PERIODS:
        new_periods = np.exp(new_ln_periods).clip(first_period, last_period)
        new_ln_ratios = np.log(
            np.mean(fitted.spectra(new_periods), axis=0) / target.at(new_periods)
        )
        order = np.argsort(np.concatenate([ln_period, new_ln_periods]))
        ln_period = np.concatenate([ln_period, new_ln_periods])[order]
        ln_ratio = np.concatenate([ln_ratio, new_ln_ratios])[order]
        # The two lines with the maximum slope through the ends of an interval intersect at its
        # lower bound.
        lower_bound = 0.5 * (ln_ratio[1:] + ln_ratio[:-1] - max_slope * np.diff(ln_period))
        can_be_lower = lower_bound < np.min(ln_ratio) - _MIN_TOLERANCE
        new_ln_periods = 0.5 * (ln_period[1:] + ln_period[:-1])[can_be_lower]
    minimum_ratio, period = (
        float(np.exp(values[np.argmin(ln_ratio)])) for values in (ln_ratio, ln_period)
    )
    common_factor = max(1.0, peak_factor, MIN_AVERAGE_RATIO / minimum_ratio)
    return replace(
        fitted,
        factors=common_factor * fitted.factors,
        rule=rule,
        least=(common_factor * minimum_ratio, period),
    )


def normalization(velocities: Array) -> Array:
    """Return the normalization factors of pairs from their peak velocities (FEMA P-695, A.8). The
    medians of this rule are means of the two middle values."""
    return np.asarray(np.median(velocities) / velocities)


def scale_p695(
    pairs: Sequence[GroundMotion],
    measure: intensity.IntensityMeasure | None = None,
    value: float | None = None,
    *,
    damping: float = SA_DAMPING,
) -> Scaling:
    """Normalize pairs by their peak velocities and scale the set, as in FEMA P-695 (A.8).

    The factor of a pair is median(PGV) / PGV, where PGV is the geometric mean of its components. If
    a measure `sa(T)` and a value (pseudo-acceleration, m/s^2) are specified, all factors are
    multiplied by a common factor, so that the median Sa of all components at the period T equals
    the value.

    Raises
    ------
    UsageError
        The motions are single components; the measure is not Sa at one period; a value is specified
        without a measure, or is not positive.
    RecordError
        A motion is zero.
    """
    periods = measure.periods if isinstance(measure, intensity.SpectralIntensity) else ()
    # The rule requires Sa at a single period; the period (0.0,) is PGA.
    if measure is not None and (len(periods) != 1 or periods == (0.0,)):
        raise UsageError(
            "the rule p695 scales a set to a value of sa(T) at one period T, got "
            f"{measure.name}; specify, for example, sa(1) for a period of 1 s, or omit measure and "
            "value"
        )
    _check_pairs(pairs, "p695")
    if (measure is None) != (value is None):
        raise UsageError(
            "scaling of a set by the rule p695 requires both sa(T) and a pseudo-acceleration, or "
            f"neither; got {measure.name if measure else None} and value {value}"
        )
    # According to FEMA P-695, this removes the variation of the pairs due to magnitude and
    # distance.
    velocities = np.array([intensity.MotionIntensity("pgv").of(pair) for pair in pairs])
    factors = normalization(velocities)
    if measure is None or value is None:
        return Scaling(tuple(pairs), factors, "p695", intensity.GEOMETRIC_MEAN, damping)
    _check_value(measure, value)
    measure = intensity.sa(periods[0], damping)
    # Multiply all normalized factors by a common factor, so that the median Sa of all components
    # equals the value. This preserves the differences between the motions.
    values = [
        factor * measure.of(record)
        for pair, factor in zip(pairs, factors, strict=True)
        for record in components(pair)
    ]
    factors = factors * (value / float(np.median(values)))
    return Scaling(tuple(pairs), factors, "p695", intensity.GEOMETRIC_MEAN, damping, measure, value)


def scale(
    motions: Sequence[AnyMotion],
    measure: intensity.IntensityMeasure | str | None = None,
    value: float | None = None,
    *,
    target: TargetSpectrum | str | None = None,
    rule: str = "mean",
    periods: Numbers | None = None,
    damping: float = SA_DAMPING,
    pair: str = intensity.GEOMETRIC_MEAN,
) -> Scaling:
    """Compute factors that scale ground motions to a value of an intensity measure or to a target
    spectrum.

    Parameters
    ----------
    motions : sequence
        Records, paths or traces. A tuple of two, or a result of `read_horizontals`, is a pair with
        the same factor, as are two records whose names differ only in the component.
    measure : IntensityMeasure or str
        `pga`, `pgv`, `pgd`, `arias`, `cav`, a measure of a plug-in, `sa(1.0)` or
        `sa-avg(1.0)` with the period in s.
    value : float
        Value of the measure, m/s^2 or m/s.
    target : TargetSpectrum or str
        Alternative to a value: a file with a spectrum, or the text of a design spectrum
        (`tdint.response.spectra.target.read_target`).
    rule : str
        Rule for a target. `mean` (default): each motion is fitted by least squares of ln Sa; its
        factor is exp(mean(ln target - ln Sa)). `asce7` and `ec8`: all factors are also multiplied
        by the smallest common factor that satisfies the rule. `asce7`: ASCE 7-16 (16.2.3.2), at
        least 11 pairs; the average of the maximum-direction spectra is at least 90 % of the target
        at all periods between the first and the last of `periods`. `ec8`: EN 1998-1:2004
        (3.2.3.1.2(4)), at least 3 motions; the mean spectrum is at least 90 % of the target at
        these periods, and the mean of the peak ground accelerations is not less than the target at
        the period 0, which is ag S. For pairs without a target: `p695`, with an optional measure
        `sa(T)` and value.
    periods : sequence of float, optional
        Periods of the comparison with the target, s; by default 100 logarithmically spaced periods
        over the range of the target.
    damping : float
        Damping ratio of the spectra; default 0.05.
    pair : str, default "geometric-mean"
        Spectrum that represents a pair: `geometric-mean`, `rotd50`, `rotd100`, `larger` or `srss`.
        `asce7` prescribes maximum-direction spectra.

    Returns
    -------
    Scaling
        Factors and their effects.

    Raises
    ------
    UsageError
        No value and no target are given, or both; the value is not positive; the measure or rule is
        unknown; the rule requires a target, more motions, pairs, or a target with a value at the
        period 0; periods are outside the range of the target, or not positive for asce7 and ec8.
    ModelError
        The target spectrum cannot be read.
    AnalysisError
        A period is too short for a motion.
    RecordError
        A motion is invalid or zero.
    """
    suite = join_pairs([motion_of(motion) for motion in motions])
    if not suite:
        raise UsageError("scale requires at least one ground motion")
    intensity_measure = (
        intensity.measure_of(measure, damping) if isinstance(measure, str) else measure
    )
    if target is not None:
        if intensity_measure is not None or value is not None:
            raise UsageError("a target and a value cannot be used together; remove one of them")
        spectrum, compared_periods = target_at(target, periods, damping)
        check_rule(rule, suite, spectrum)
        if text := missing_motions(rule, len(suite)):
            raise UsageError(f"{text}; add ground motions, or use the rule mean")
        pair = pair_of_rule(rule, pair)
        target_psa = spectrum.at(compared_periods)
        psa = suite_spectra(suite, compared_periods, damping, pair)
        for motion, values in zip(suite, psa, strict=True):
            intensity.positive(float(np.min(values)), "Sa", motion)
        # Least squares of ln Sa, with equal weights of all periods
        factors = np.exp(np.mean(np.log(target_psa) - np.log(psa), axis=1))
        fitted = Scaling(
            tuple(suite), factors, "mean", pair, damping, target=spectrum, periods=compared_periods
        )
        return raise_to_rule(fitted, rule)
    if rule == "p695":
        return scale_p695(suite, intensity_measure, value, damping=damping)
    if rule != "mean":
        raise UsageError(f"the rule {rule!r:.60} requires a target spectrum")
    if intensity_measure is None or value is None:
        raise UsageError("scale requires an intensity measure with a value, or a target spectrum")
    _check_value(intensity_measure, value)
    intensities = [intensity_measure.of(motion, pair) for motion in suite]
    factors = np.array(
        [intensity.factor_to(value, intensity_measure, item) for item in intensities]
    )
    damping = getattr(intensity_measure, "damping", SA_DAMPING)
    return Scaling(tuple(suite), factors, "value", pair, damping, intensity_measure, value)


_PERIOD_COUNT = 100  # number of periods of a comparison, at least 30 per decade for typical targets


def target_at(
    target: TargetSpectrum | str, periods: Numbers | None, damping: float
) -> tuple[TargetSpectrum, Array]:
    """Return a target spectrum and the periods of the comparison of motions with this target.

    Parameters
    ----------
    target : TargetSpectrum or str
        Target spectrum, or the text that specifies it (`read_target`), for example a file.
    periods : sequence of float | None
        Periods, s; None: 100 logarithmically spaced periods over the range of the target.
    damping : float
        Damping ratio of the spectra of the motions, which a target must have if it states a ratio.
    """
    target_spectrum = read_targets(target, (damping,))[0] if isinstance(target, str) else target
    target_spectrum.check_damping(damping, "of the motions")
    if periods is not None:
        return target_spectrum, numbers_of(periods, "periods")
    first, last = float(target_spectrum.periods[0]), float(target_spectrum.periods[-1])
    return target_spectrum, np.geomspace(first, last, _PERIOD_COUNT)


def _check_pairs(pairs: Sequence[GroundMotion], rule: str) -> None:
    """Raise UsageError if a motion is a single component. `rule` is the name of the rule that
    requires pairs, for the message."""
    if not all(isinstance(pair, Horizontals) for pair in pairs):
        raise UsageError(
            f"the rule {rule} requires pairs of horizontal components, but a motion is a single "
            "component; use pairs, or another rule"
        )
