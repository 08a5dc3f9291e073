"""Inelastic spectra: bilinear oscillators of given strength, or of the strength that leads to a
given ductility."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from tdint.analysis.defaults import MOST_DUCTILE
from tdint.analysis.given import AnyRecord, damping_of, numbers_of, record_of
from tdint.analysis.spectra.elastic import DampingRatio, check_shortest, checked_periods
from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.kernels.oscillators import bilinear as inelastic
from tdint.tabular import Tabular
from tdint.units import STANDARD_GRAVITY, Quantity
from tdint.written_numbers import how_many

SHORTEST = 1e-3
"""The shortest period over the sampling interval: shorter ones take too many steps."""

_WEAKEST, _STRONGEST = 1e-9, 1e6  # yield force over weight: far beyond what any structure has
_RATIO = 0.97  # of neighboring strengths where the largest one with a ductility is looked for
_LEAST = 1e-9  # of the elastic strength: where the search ends
_PARTS = 6  # into which an interval in which the target is reached is divided, again and again ...
_STEEP = 1.15  # ... until the ductility at its lower end is not beyond the target by more than this
_NEAR = 0.8  # of the target: a maximum of the ductility is looked at more closely from there on
_SUMMIT = 1e-4  # of the strength: how closely
_CLOSE = 1e-9  # of the target: where the search has found it


@dataclass(frozen=True, repr=False)
class InelasticSpectrum(Tabular):
    """Response of bilinear oscillators to one record, for one damping ratio and one ductility or
    strength; arrays of shape (k,).

    `target` is None for given strengths; `elastic_sd` is the largest displacement of the oscillator
    that stays elastic, m; without damping `residual` is the center of the vibration that remains.
    """

    record: Record
    damping: DampingRatio
    hardening: Annotated[float, Quantity("1", "stiffness after yielding over the initial one")]
    target: Annotated[float | None, Quantity("1", "ductility asked for", called="target_ductility")]
    periods: Annotated[
        Array, Quantity("s", "natural period of the initial stiffness", called="period")
    ]
    yield_displacement: Annotated[
        Array, Quantity("m", "displacement at first yield", called="yield_sd")
    ]
    sd: Annotated[Array, Quantity("m", "largest displacement relative to the ground")]
    elastic_sd: Array
    residual: Annotated[
        Array, Quantity("m", "displacement at rest after the record, with its sign")
    ]

    columns: ClassVar = (
        *(
            "damping",
            "hardening",
            "target",
            "periods",
            "yield_strength_ratio",
            "ductility",
            "residual",
            "sd",
        ),
        *("yield_displacement", "yield_acceleration", "reduction_factor"),
    )

    def _headline(self) -> str:
        return (
            f"of {self.record.name or 'a record'}, damping {self.damping:g}, "
            f"{how_many(self.periods.size, 'period')}"
        )

    @property
    def ductility(self) -> Annotated[Array, Quantity("1", "largest over yield displacement")]:
        """Below 1 for an oscillator that does not yield, nan without strength."""
        return _quotient(self.sd, self.yield_displacement)

    @property
    def yield_acceleration(
        self,
    ) -> Annotated[Array, Quantity("m/s^2", "yield force over mass", called="yield_psa")]:
        """Omega^2 times the yield displacement, m/s^2."""
        return np.asarray((2.0 * math.pi / self.periods) ** 2 * self.yield_displacement)

    @property
    def yield_strength_ratio(self) -> Annotated[Array, Quantity("1", "yield force over weight")]:
        """By the standard gravity."""
        return self.yield_acceleration / STANDARD_GRAVITY

    @property
    def reduction_factor(
        self,
    ) -> Annotated[Array, Quantity("1", "largest elastic force over yield force")]:
        """Nan without strength."""
        return _quotient(self.elastic_sd, self.yield_displacement)


def _quotient(above: Array, below: Array) -> Array:
    """Nan where `below` is zero."""
    return np.asarray(
        np.divide(above, below, out=np.full(above.shape, math.nan), where=below > 0.0)
    )


def constant_ductility(
    record: AnyRecord,
    periods: Array,
    ductilities: Sequence[float],
    damping: float = 0.05,
    *,
    hardening: float = 0.0,
) -> list[InelasticSpectrum]:
    """Spectra of the strengths that lead to given ductilities.

    Where several strengths lead to the same ductility the largest one is taken (Chopra, Dynamics of
    Structures, 7.5). Ductility 1 is the elastic spectrum.

    Parameters
    ----------
    record : Record, str, Path or ObsPy trace
        Ground motion; linear between its samples, the oscillators at rest at its first one.
    periods : ndarray, shape (k,)
        Periods of the initial stiffness, s, positive.
    ductilities : sequence of float
        Largest over yield displacement, from 1 to MOST_DUCTILE.
    damping : float
        Damping ratio of the initial stiffness, in [0, 1); the dashpot stays as it is when the
        oscillator yields.
    hardening : float
        Stiffness after yielding over the initial one, in [0, 1): kinematic hardening.

    Returns
    -------
    list of InelasticSpectrum
        One per ductility.

    Raises
    ------
    UsageError
        A number that is out of range.
    AnalysisError
        No strength leads to a ductility, or a period is too short for the record's sampling
        interval.
    """
    given, oscillators = _oscillators(record, periods, damping, hardening)
    if not all(1.0 <= ductility <= MOST_DUCTILE for ductility in ductilities):
        raise UsageError(f"ductilities must be numbers from 1 to {MOST_DUCTILE:g}")
    results = {target: np.zeros((len(oscillators), 3)) for target in sorted(set(ductilities))}
    for i, oscillator in enumerate(oscillators):
        ratio = 1.0
        for target, result in results.items() if oscillator.elastic > 0.0 else ():
            # A continuous function that starts at 1 reaches the smaller ductilities first.
            ratio = largest_ratio(oscillator.ductility, target, ratio)
            strength = ratio * oscillator.elastic
            result[i] = (
                (strength, *oscillator.response(strength))
                if target > 1.0
                else (strength, strength, 0.0)
            )
    return [_spectrum(given, oscillators, target, results[target]) for target in ductilities]


def constant_strength(
    record: AnyRecord,
    periods: Array,
    strengths: Sequence[float],
    damping: float = 0.05,
    *,
    hardening: float = 0.0,
) -> list[InelasticSpectrum]:
    """Spectra of oscillators of given strengths.

    Parameters
    ----------
    record, periods, damping, hardening
        As of `constant_ductility`.
    strengths : sequence of float
        Yield strength ratios, the yield force over the weight, positive.

    Returns
    -------
    list of InelasticSpectrum
        One per ratio.

    Raises
    ------
    UsageError
        A number that is out of range.
    AnalysisError
        A period is too short for the record's sampling interval.
    """
    given, oscillators = _oscillators(record, periods, damping, hardening)
    if not all(_WEAKEST <= strength <= _STRONGEST for strength in strengths):
        raise UsageError(
            f"yield strength ratios must be positive numbers from {_WEAKEST:g} to {_STRONGEST:g}"
        )
    results = np.zeros((len(strengths), len(oscillators), 3))
    for i, oscillator in enumerate(oscillators):
        for result, strength in zip(results, strengths, strict=True):
            yield_displacement = strength * STANDARD_GRAVITY / oscillator.omega**2
            result[i] = yield_displacement, *oscillator.response(yield_displacement)
    return [_spectrum(given, oscillators, None, result) for result in results]


def _oscillators(
    record: AnyRecord, periods: Array, damping: float, hardening: float
) -> tuple[dict[str, Any], list[_Oscillator]]:
    """What is given, checked, by the fields of a spectrum; and the oscillators."""
    record, damping = record_of(record), damping_of(damping)
    periods = numbers_of(periods, "periods")
    if periods.size == 0 or not np.all(np.isfinite(periods) & (periods > 0.0)):
        raise UsageError("periods of inelastic spectra must be positive numbers of seconds")
    periods = checked_periods(periods)
    if not 0.0 <= hardening < 1.0:
        raise UsageError(f"hardening must be a ratio in [0, 1), got {hardening!r}")
    check_shortest(periods, record.dt, SHORTEST)
    ground, omegas = (
        record.acceleration.copy(),
        [2.0 * math.pi / period for period in periods.tolist()],
    )
    oscillators = [_Oscillator(ground, record.dt, omega, damping, hardening) for omega in omegas]
    return {
        "record": record,
        "damping": damping,
        "hardening": hardening,
        "periods": periods,
    }, oscillators


def _spectrum(
    given: dict[str, Any], oscillators: Sequence[_Oscillator], target: float | None, result: Array
) -> InelasticSpectrum:
    """Of the yield displacement, the largest one and the one at rest of each oscillator, a row
    each."""
    names, elastic = (
        ("yield_displacement", "sd", "residual"),
        np.array([one.elastic for one in oscillators]),
    )
    return InelasticSpectrum(
        **given, target=target, elastic_sd=elastic, **dict(zip(names, result.T, strict=True))
    )


@dataclass(frozen=True)
class _Oscillator:
    """A bilinear oscillator under a ground motion, without its strength."""

    ground: Array
    dt: float
    omega: float
    damping: float
    hardening: float

    def response(self, yield_displacement: float) -> tuple[float, float]:
        """Largest displacement and displacement at rest afterwards, m."""
        results = np.empty(inelastic.RESULTS)
        code = inelastic.bilinear_response.compiled(
            self.ground,
            self.dt,
            self.omega,
            self.damping,
            self.hardening,
            yield_displacement,
            results,
        )
        if code < 0:
            raise AnalysisError(
                f"the branches of the oscillator with the period {2.0 * math.pi / self.omega:.6g} "
                f"s and the yield displacement {yield_displacement:.6g} m change without end"
            )
        return float(results[inelastic.LARGEST]), float(results[inelastic.RESIDUAL])

    @cached_property
    def elastic(self) -> float:
        """Largest displacement of the oscillator that does not yield, m."""
        return self.response(math.inf)[0]

    def ductility(self, ratio: float) -> float:
        """Ductility for a strength over that which stays elastic."""
        return self.response(ratio * self.elastic)[0] / (ratio * self.elastic)


# The search for a strength


def largest_ratio(ductility: Callable[[float], float], target: float, start: float = 1.0) -> float:
    """The largest ratio not above `start` whose ductility is the target.

    The ductility is a continuous function of the ratio, not above the target at `start`, and grows
    without bound towards zero. It is not monotone: all of it is gone through from `start` down to
    the first ratio that reaches the target. Where it rises steeply the steps are made smaller, and
    where it comes near the target and falls again its maximum is looked for.

    Raises
    ------
    AnalysisError
        No ratio down to a billionth reaches it.
    """
    if target == 1.0:
        return start
    from scipy.optimize import brentq

    # By Brent's method on the logarithms, which lie nearly on a line
    low, high = _bracket(ductility, target, start)
    values = {math.log(ratio): value for ratio, value in (low, high)}

    def excess(x: float) -> float:
        value = values[x] if x in values else ductility(math.exp(x))
        log = math.log(max(value, 0.1) / target)
        return 0.0 if abs(log) <= _CLOSE else log  # Zero ends the search.

    ends = sorted(values)
    if excess(ends[0]) == 0.0:
        return low[0]
    return math.exp(brentq(excess, *ends, xtol=1e-15, rtol=1e-15))


Point = tuple[float, float]
"""A ratio and its ductility."""


def _bracket(
    ductility: Callable[[float], float], target: float, start: float
) -> tuple[Point, Point]:
    """The first ratio from above that reaches the target, and one above it that does not."""
    before = high = (start, min(ductility(start), target))
    while high[1] < target:
        low = (high[0] * _RATIO, ductility(high[0] * _RATIO))
        if low[0] < _LEAST:
            raise AnalysisError(f"no strength leads to the ductility {target:.6g}")
        if low[1] < target and high[1] > max(_NEAR * target, before[1], low[1]):
            summit = _summit(ductility, target, low[0], before[0])
            if summit[1] >= target:
                low, high = summit, before
        if low[1] >= target:
            # The uppermost part of a bracket in which the target is reached, and not far exceeded.
            while True:
                for ratio in np.linspace(high[0], low[0], _PARTS + 1)[1:-1].tolist():
                    point = (ratio, ductility(ratio))
                    if point[1] >= target:
                        low = point
                        break
                    high = point
                if low[1] <= _STEEP * target or high[0] - low[0] <= 1e-13 * high[0]:
                    return low, high
        before, high = high, low
    return high, high


class _Reached(Exception):
    """The point at which a search has reached the target."""

    def __init__(self, point: Point) -> None:
        super().__init__(point)
        self.point = point


def _summit(ductility: Callable[[float], float], target: float, low: float, high: float) -> Point:
    """The maximum between two ratios, or a point that reaches the target: Brent's parabolas and
    golden section."""
    from scipy.optimize import minimize_scalar

    def depth(ratio: float) -> float:
        value = ductility(ratio)
        if value >= target:
            raise _Reached((ratio, value))
        return -value

    try:
        minimum = minimize_scalar(
            depth, bounds=(low, high), method="bounded", options={"xatol": _SUMMIT * high}
        )
    except _Reached as reached:
        return reached.point
    return float(minimum.x), -float(minimum.fun)
