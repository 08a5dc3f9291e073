"""Inelastic response spectra of bilinear oscillators for constant strength or constant
ductility."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from tdint.arrays import Array, Numbers, cached_property, immutable
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.kernels.oscillators import bilinear as inelastic
from tdint.response.arguments import AnyRecord, damping_of, record_of
from tdint.response.defaults import MOST_DUCTILE
from tdint.response.spectra.elastic import (
    DampingRatio,
    RecordSpectrum,
    check_shortest,
    checked_periods,
)
from tdint.units import STANDARD_GRAVITY, Quantity

SHORTEST = 1e-3
"""Smallest ratio of period to sampling interval; shorter periods need too many time steps."""

# Allowed ratios of yield force to weight; structures are far within these limits.
_MIN_STRENGTH, _MAX_STRENGTH = 1e-9, 1e6
# The largest strength that leads to a ductility (the target) is searched downward from the elastic
# strength.
_STRENGTH_STEP = 0.97  # ratio of successive strengths in the search
_MIN_RATIO = 1e-9  # fraction of the elastic strength where the search ends without a result
# The search determines two strengths with ductilities below and above the target. The interval
# between these strengths is divided into _PARTS parts. The part where the ductility reaches the
# target is divided again, until the ductility at its lower end is at most _MAX_OVERSHOOT times the
# target.
_PARTS = 6
_MAX_OVERSHOOT = 1.15
# Fraction of the target. A local maximum of the ductility above it is computed by an optimization,
# because it may reach the target between two strengths
_REFINED_FRACTION = 0.8
_MAXIMUM_TOLERANCE = 1e-4  # tolerance of the strength at this maximum, relative to the strength
_DUCTILITY_TOLERANCE = 1e-9  # tolerance of ln(ductility / target) of the result


@immutable
class InelasticSpectrum(RecordSpectrum):
    """Response of bilinear oscillators to a single record, for a single damping ratio and a single
    ductility or strength; arrays of shape (k,).

    `target` is `None` for spectra of constant strength. `elastic_sd` is the maximum displacement of
    the elastic oscillator, m. Without damping, `residual` is the center of the free vibration after
    the record.

    Attributes
    ----------
    record : Record
        Ground motion.
    damping : float
        Damping ratio.
    hardening : float
        Stiffness after yielding divided by the initial stiffness.
    target : float | None
        Requested ductility.
    periods : ndarray
        Natural periods of the initial stiffness, s.
    yield_displacement : ndarray
        Displacements at first yield, m.
    sd : ndarray
        Maximum displacements relative to the ground, m.
    elastic_sd : ndarray
        Maximum displacements of the elastic oscillator, m.
    residual : ndarray
        Displacements at rest after the record, with sign, m.
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

    @property
    def prescribed(self) -> str:
        """Value that is the same at all periods, for labels: ductility, strength or its
        reduction."""
        if self.target is not None:
            return f"ductility {self.target:g}"
        strength = self.yield_strength_ratio
        if np.allclose(strength, strength[0], rtol=1e-9):  # equal except for rounding
            return f"strength {strength[0]:.4g}"
        return f"strength reduced by {self.reduction_factor[0]:.4g}"

    @property
    def ductility(self) -> Annotated[Array, Quantity("1", "largest over yield displacement")]:
        """Ductility: below 1 if the oscillator does not yield, nan if its strength is zero."""
        return _quotient(self.sd, self.yield_displacement)

    @property
    def yield_acceleration(
        self,
    ) -> Annotated[Array, Quantity("m/s^2", "yield force over mass", called="yield_psa")]:
        """Yield acceleration: omega^2 times the yield displacement, m/s^2."""
        return np.asarray((2.0 * math.pi / self.periods) ** 2 * self.yield_displacement)

    @property
    def yield_strength_ratio(self) -> Annotated[Array, Quantity("1", "yield force over weight")]:
        """Yield acceleration divided by standard gravity."""
        return self.yield_acceleration / STANDARD_GRAVITY

    @property
    def reduction_factor(
        self,
    ) -> Annotated[Array, Quantity("1", "largest elastic force over yield force")]:
        """Elastic displacement divided by yield displacement; nan if the strength is zero."""
        return _quotient(self.elastic_sd, self.yield_displacement)


def _quotient(above: Array, below: Array) -> Array:
    """Return `above / below`, with nan where `below` is zero."""
    return np.asarray(
        np.divide(above, below, out=np.full(above.shape, math.nan), where=below > 0.0)
    )


def constant_ductility(
    record: AnyRecord,
    periods: Numbers,
    ductilities: Numbers,
    damping: float | str = 0.05,
    *,
    hardening: float = 0.0,
) -> list[InelasticSpectrum]:
    """Compute inelastic spectra of constant ductility.

    If several strengths lead to the same ductility, the largest strength is used (Chopra, Dynamics
    of Structures, 7.5). Ductility 1 gives the elastic spectrum.

    Parameters
    ----------
    record : Record, str, Path or ObsPy trace
        Ground motion, linear between its samples. The oscillators are at rest at the first sample.
    periods : ndarray, shape (k,)
        Periods of the initial stiffness, s, positive.
    ductilities : sequence of float
        Ratios of maximum displacement to yield displacement, from 1 to MOST_DUCTILE.
    damping : float
        Damping ratio for the initial stiffness, in [0, 1). The damping coefficient does not change
        when the oscillator yields. The default is 0.05.
    hardening : float
        Ratio of the stiffness after yielding to the initial stiffness, in [0, 1), with kinematic
        hardening. The default is 0.

    Returns
    -------
    list of InelasticSpectrum
        One spectrum per ductility.

    Raises
    ------
    UsageError
        A parameter is out of range.
    RecordError
        The record is invalid or cannot be read.
    AnalysisError
        No strength leads to a ductility, or a period is too short for the sampling interval of the
        record.
    """
    arguments, oscillators = _oscillators(record, periods, damping, hardening)
    if not all(1.0 <= ductility <= MOST_DUCTILE for ductility in ductilities):
        raise UsageError(
            f"ductilities must be numbers from 1 to {MOST_DUCTILE:g}, got {ductilities!r:.60}"
        )
    # Columns of the results: yield displacement, maximum displacement and residual displacement, m.
    results = {target: np.zeros((len(oscillators), 3)) for target in sorted(set(ductilities))}
    for i, oscillator in enumerate(oscillators):
        ratio = 1.0
        # Without an elastic displacement, all results remain 0.
        for target, result in results.items() if oscillator.elastic > 0.0 else ():
            # The ductility is a continuous function of the strength ratio, and is 1 at the ratio 1.
            # With decreasing ratio it therefore reaches the smaller targets first. Each search
            # starts at the result of the preceding target.
            ratio = largest_ratio(oscillator.ductility, target, ratio)
            strength = ratio * oscillator.elastic
            result[i] = (
                (strength, *oscillator.response(strength))
                if target > 1.0
                else (strength, strength, 0.0)
            )
    return [_spectrum(arguments, oscillators, target, results[target]) for target in ductilities]


def constant_strength(
    record: AnyRecord,
    periods: Numbers,
    strengths: Numbers,
    damping: float | str = 0.05,
    *,
    hardening: float = 0.0,
    relative_to: str = "weight",
) -> list[InelasticSpectrum]:
    """Compute inelastic spectra of constant strength.

    Parameters
    ----------
    record, periods, damping, hardening
        The same as in `constant_ductility`.
    strengths : sequence of float
        Yield strength ratios (yield force divided by weight), positive.
    relative_to : str
        `weight`, the default, or `elastic`: the strengths are then the yield forces divided by the
        maximum elastic forces, 1 / R for the reduction factor R.

    Returns
    -------
    list of InelasticSpectrum
        One spectrum per strength ratio.

    Raises
    ------
    UsageError
        A parameter is out of range.
    RecordError
        The record is invalid or cannot be read.
    AnalysisError
        A period is too short for the sampling interval of the record.
    """
    arguments, oscillators = _oscillators(record, periods, damping, hardening)
    if not all(_MIN_STRENGTH <= strength <= _MAX_STRENGTH for strength in strengths):
        raise UsageError(
            f"yield strength ratios must be numbers from {_MIN_STRENGTH:g} to {_MAX_STRENGTH:g}, "
            f"got {strengths!r:.60}"
        )
    if relative_to not in ("weight", "elastic"):
        raise UsageError(f"relative_to must be weight or elastic, got {relative_to!r}")
    results = np.zeros((len(strengths), len(oscillators), 3))
    for i, oscillator in enumerate(oscillators):
        unit = STANDARD_GRAVITY / oscillator.omega**2
        if relative_to == "elastic":
            unit = oscillator.elastic
        for result, strength in zip(results, strengths, strict=True):
            # Without an elastic displacement, all results remain 0.
            if unit > 0.0:
                yield_displacement = strength * unit
                result[i] = yield_displacement, *oscillator.response(yield_displacement)
    return [_spectrum(arguments, oscillators, None, result) for result in results]


def _oscillators(
    record: AnyRecord, periods: Numbers, damping: float | str, hardening: float
) -> tuple[dict[str, Any], list[_Oscillator]]:
    """Check the arguments of `constant_ductility` and `constant_strength`. Return them by name of
    the field of `InelasticSpectrum`, and the oscillator of each period.
    """
    record, damping = record_of(record), damping_of(damping)
    periods = checked_periods(periods, zero=False)
    if not 0.0 <= hardening < 1.0:
        raise UsageError(f"hardening must be a ratio in [0, 1), got {hardening!r}")
    check_shortest(periods, record.dt, SHORTEST)
    ground = record.acceleration.copy()
    omegas = [2.0 * math.pi / period for period in periods.tolist()]
    oscillators = [_Oscillator(ground, record.dt, omega, damping, hardening) for omega in omegas]
    return {
        "record": record,
        "damping": damping,
        "hardening": hardening,
        "periods": periods,
    }, oscillators


def _spectrum(
    arguments: dict[str, Any],
    oscillators: Sequence[_Oscillator],
    target: float | None,
    result: Array,
) -> InelasticSpectrum:
    """Build a spectrum from the checked arguments (`_oscillators`) and the yield displacement,
    maximum displacement and residual displacement of each oscillator, m. `target` is the requested
    ductility; None for a spectrum of constant strength.
    """
    yield_displacement, sd, residual = result.T
    return InelasticSpectrum(
        **arguments,
        target=target,
        elastic_sd=np.array([oscillator.elastic for oscillator in oscillators]),
        yield_displacement=yield_displacement,
        sd=sd,
        residual=residual,
    )


@dataclass(frozen=True)
class _Oscillator:
    """Bilinear oscillator of unspecified strength under a ground motion.

    Attributes
    ----------
    omega : float
        Natural circular frequency of the initial stiffness, rad/s.
    damping, hardening : float
        Damping ratio, and ratio of the stiffness after yielding to the initial stiffness.
    """

    ground: Array
    dt: float
    omega: float
    damping: float
    hardening: float

    def response(self, yield_displacement: float) -> tuple[float, float]:
        """Return the maximum absolute displacement and the residual displacement for a yield
        displacement (m; inf for elastic response). AnalysisError is raised if the motion changes
        too often between elastic and plastic.
        """
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
                f"the oscillator with the period {2.0 * math.pi / self.omega:.6g} s and the yield "
                f"displacement {yield_displacement:.6g} m has too many changes between elastic and "
                "plastic motion; use longer periods or a larger strength"
            )
        return float(results[inelastic.LARGEST]), float(results[inelastic.RESIDUAL])

    @cached_property
    def elastic(self) -> float:
        """Maximum displacement of the elastic oscillator, m."""
        return self.response(math.inf)[0]

    def ductility(self, ratio: float) -> float:
        """Return the ductility for a strength of `ratio` times the elastic strength.

        Strengths are proportional to yield displacements, because the stiffness is the same.
        """
        return self.response(ratio * self.elastic)[0] / (ratio * self.elastic)


def largest_ratio(ductility: Callable[[float], float], target: float, start: float = 1.0) -> float:
    """Return the largest strength ratio, at most `start`, that leads to the ductility `target` (at
    least 1); AnalysisError if no ratio above 1e-9 does.

    A strength ratio is the strength divided by the elastic strength. The ductility is a continuous
    function of the ratio. It does not exceed the target at `start` and grows without bound as the
    ratio approaches zero. The function is not monotone, so the search descends from `start` in
    small steps to the first ratio that reaches the target. The steps are refined where the
    ductility rises steeply. If the ductility approaches the target and decreases again, the search
    computes its maximum.
    """
    if target == 1.0:
        return start
    from scipy.optimize import brentq

    # It is applied to the logarithms of ratio and ductility, because their relation is nearly
    # linear.
    low, high = _bracket(ductility, target, start)
    values = {math.log(ratio): value for ratio, value in (low, high)}

    def excess(x: float) -> float:
        """Return ln(ductility / target) for a logarithm of the ratio; 0, which ends the search, if
        it is within the tolerance."""
        value = values[x] if x in values else ductility(math.exp(x))
        log = math.log(max(value, 0.1) / target)  # the maximum avoids the logarithm of 0
        return 0.0 if abs(log) <= _DUCTILITY_TOLERANCE else log

    ends = sorted(values)
    if excess(ends[0]) == 0.0:
        return low[0]
    return math.exp(brentq(excess, *ends, xtol=1e-15, rtol=1e-15))


Point = tuple[float, float]
"""Strength ratio and its ductility."""


def _bracket(
    ductility: Callable[[float], float], target: float, start: float
) -> tuple[Point, Point]:
    """Search downward from the strength ratio `start` for two points (strength ratio, ductility):
    the first point that reaches the target, and a point with a larger ratio and a ductility below
    the target. AnalysisError is raised if no ratio above `_MIN_RATIO` reaches the target.
    """
    # The last three points of the search, in the order of increasing ratio, are `low`, `high` and
    # `previous`. Rounding errors must not let the first point exceed the target.
    previous = high = (start, min(ductility(start), target))
    while high[1] < target:
        low = (high[0] * _STRENGTH_STEP, ductility(high[0] * _STRENGTH_STEP))
        if low[0] < _MIN_RATIO:
            raise AnalysisError(
                f"no strength leads to the ductility {target:.6g}; request a smaller ductility"
            )
        # The ductility has a maximum between the points that may reach the target: compute it.
        if low[1] < target and high[1] > max(_REFINED_FRACTION * target, previous[1], low[1]):
            maximum = _maximum(ductility, target, low[0], previous[0])
            if maximum[1] >= target:
                low, high = maximum, previous
        if low[1] >= target:
            while True:
                for ratio in np.linspace(high[0], low[0], _PARTS + 1)[1:-1].tolist():
                    point = (ratio, ductility(ratio))
                    if point[1] >= target:
                        low = point
                        break
                    high = point
                if low[1] <= _MAX_OVERSHOOT * target or high[0] - low[0] <= 1e-13 * high[0]:
                    return low, high
        previous, high = high, low
    return high, high


class _Reached(Exception):
    """Exception with the point where a search has reached the target."""

    def __init__(self, point: Point) -> None:
        super().__init__(point)
        self.point = point


def _maximum(ductility: Callable[[float], float], target: float, low: float, high: float) -> Point:
    """Search for the maximum ductility between two strength ratios by Brent's bounded minimization.

    The search ends early at the first point that reaches the target.

    `ductility` is the function that receives a strength ratio and returns the ductility.
    """
    from scipy.optimize import minimize_scalar

    def negative_ductility(ratio: float) -> float:
        """Return the function to minimize; raise _Reached if the target is reached."""
        value = ductility(ratio)
        if value >= target:
            raise _Reached((ratio, value))
        return -value

    try:
        minimum = minimize_scalar(
            negative_ductility,
            bounds=(low, high),
            method="bounded",
            options={"xatol": _MAXIMUM_TOLERANCE * high},
        )
    except _Reached as reached:
        return reached.point
    return float(minimum.x), -float(minimum.fun)
