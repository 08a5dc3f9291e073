"""Target displacement under a design spectrum, from an equivalent oscillator of a pushover curve.

Two published methods are used. N2 (EN 1998-1:2004, annex B; Fajfar 2000) computes the elastic
demand of the oscillator, increased by a rule for short periods. The coefficient method (ASCE 41-17,
7.4.3.3) multiplies the elastic demand at an effective period by factors. Both idealize the curve up
to the displacement that they compute. The result is therefore the first displacement on the curve
that reproduces itself. For a displacement on the first straight line of the curve, the idealized
curve is this line. For a displacement above the maximum base shear, the curve up to the maximum is
idealized.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tdint.analysis.spectra.target import TargetSpectrum, read_target
from tdint.analysis.static import Pushover, pushover
from tdint.arrays import Array, halved
from tdint.errors import AnalysisError, UsageError
from tdint.model.building import Building, assemble
from tdint.tabular import ResultList, Tabular
from tdint.units import STANDARD_GRAVITY, DriftSize

SITE_FACTORS = {"A": 130.0, "B": 130.0, "C": 90.0, "D": 60.0, "E": 60.0, "F": 60.0}
"""Factor a of C1 by site class (ASCE 41-17, 7.4.3.3.2)."""

_MAX_DISPLACEMENT_RATIO = 3.0  # maximum ratio to the elastic displacement (EN 1998-1, B.5)
# Fraction of the yield force at which the effective stiffness intersects the curve (ASCE 41-17,
# 7.4.3.2.4)
_SECANT = 0.6
_STRONG_AT_1_S = 0.6  # g; larger values occur at near-fault sites (ASCE 41-17, 7.4.3.3.2)
# Required range of the curve over the target displacement (EN 1998-1, 4.3.3.4.2.3)
_REQUIRED_RANGE = 1.5
# Relative change of force that counts as yield. Residuals of equilibrium are a millionth of it, the
# first yield is a thousand times larger
_YIELD_TOLERANCE = 1e-6
_ROUNDING = 1e-9  # relative difference of forces; residuals of the curve are a hundredth of it
_MAX_BISECTIONS = 100  # maximum number of bisections; more than the number of digits of a float


@dataclass(frozen=True, repr=False)
class TargetDisplacement(Tabular):
    """Target displacement of a building under a design spectrum, by one method.

    Attributes
    ----------
    pushed, target : Pushover, TargetSpectrum
        Pushover curve and elastic design spectrum.
    method : str
        `n2` or `coefficients`.
    participation : float
        Participation factor: of the shape of the pushover (`n2`), or of the first mode
        (`coefficients`, C0).
    mass : float
        Mass of the equivalent oscillator (`n2`) or of the building (`coefficients`), kg.
    period : float
        Period T* or Te, s.
    yield_force, yield_displacement : float
        Idealized curve of the building: base shear, N, and roof displacement, m, at yield.
    spectral_acceleration : float
        Spectral acceleration of the target at this period, m/s^2.
    strength_ratio : float
        Elastic force over yield force: R, q_u, mu_strength.
    factors : tuple of float
        C1 and C2 for `coefficients`; for `n2` the ratio to the elastic displacement, and 1.
    roof_displacement : float
        Target displacement, m.
    base_shear : float
        Base shear at the target displacement, N.
    drift, drift_ratio, ductility : ndarray, shape (n,)
        Drifts of the stories at the target displacement, m; divided by the height (nan without
        height); divided by the yield drift (nan for a law that does not yield).
    notes : tuple of str
        Conditions that are outside the range of the method.
    """

    pushed: Pushover
    target: TargetSpectrum
    method: str
    participation: float
    mass: float
    period: float
    yield_force: float
    yield_displacement: float
    spectral_acceleration: float
    strength_ratio: float
    factors: tuple[float, float]
    roof_displacement: float
    base_shear: float
    drift: Array
    drift_ratio: Array
    ductility: Array
    notes: tuple[str, ...] = ()

    def _headline(self) -> str:
        return (
            f"by {self.method}: roof displacement {self.roof_displacement:.4g} m, T "
            f"{self.period:.4g} s"
        )


class TargetDisplacements(ResultList[TargetDisplacement]):
    """Target displacements of both methods."""


@dataclass(frozen=True)
class _PushoverCurve:
    """Pushover curve for increasing roof displacement.

    Attributes
    ----------
    pushed : Pushover
        Complete pushover.
    roof, shear, work : ndarray, shape (points,)
        Roof displacement, m; base shear, N; area below the curve up to each point, J.
    drift : ndarray, shape (points, n)
        Drifts of the stories, m.
    """

    pushed: Pushover
    roof: Array
    shear: Array
    work: Array
    drift: Array

    @classmethod
    def of(cls, pushed: Pushover) -> _PushoverCurve:
        """Select the states in which the roof displacement exceeds all previous values."""
        drift, shear = pushed.way
        roof = drift.sum(axis=1)
        is_increasing = roof > np.maximum.accumulate(np.concatenate(([-math.inf], roof[:-1])))
        roof, shear, drift = roof[is_increasing], shear[is_increasing], drift[is_increasing]
        work = np.concatenate(([0.0], np.cumsum(np.diff(roof) * (shear[:-1] + shear[1:]) / 2.0)))
        return cls(pushed, roof, shear, work, drift)

    def idealized_to(self, displacement: float) -> float:
        """Return the displacement up to which the curve is idealized.

        It is at least the end of the first straight line, and at most the peak.
        """
        is_elastic = (
            self.shear[1:]
            >= (1.0 - _YIELD_TOLERANCE) * self.shear[1] / self.roof[1] * self.roof[1:]
        )
        last_elastic = is_elastic.size if is_elastic.all() else int(np.argmin(is_elastic))
        return float(np.clip(displacement, self.roof[last_elastic], self.roof[self.peak]))

    @property
    def peak(self) -> int:
        """Index of the last point with the maximum base shear, which may be a plateau."""
        return int(np.flatnonzero(self.shear >= (1.0 - _ROUNDING) * np.max(self.shear))[-1])

    def at(self, displacement: float) -> tuple[float, float]:
        """Return base shear and area at a roof displacement."""
        shear = float(np.interp(displacement, self.roof, self.shear))
        i = max(int(np.searchsorted(self.roof, displacement)) - 1, 0)
        return shear, float(
            self.work[i] + (displacement - self.roof[i]) * (self.shear[i] + shear) / 2.0
        )

    def strongest(self, displacement: float) -> float:
        """Return the maximum base shear up to a roof displacement."""
        return max(
            float(np.max(self.shear[self.roof <= displacement], initial=0.0)),
            self.at(displacement)[0],
        )


@dataclass(frozen=True)
class _Idealized:
    """Idealized curve up to a roof displacement, and the displacement that the method computes.

    The attributes are attributes of `TargetDisplacement`.
    """

    period: float
    yield_force: float
    yield_displacement: float
    spectral_acceleration: float
    strength_ratio: float
    factors: tuple[float, float]
    roof_displacement: float


def target_displacements(
    pushed: Pushover,
    target: TargetSpectrum | str,
    *,
    site_class: str = "D",
    mass_factor: float = 1.0,
) -> TargetDisplacements:
    """Compute the target displacements by N2 and by the coefficient method.

    Parameters
    ----------
    pushed : Pushover
        Pushover curve. The shape of the equivalent oscillator is its forces over the masses.
    target : TargetSpectrum or str
        Elastic design spectrum: the name of a code with parameters, or a file.
    site_class : str
        Site class A to F for C1; default D, for unknown sites.
    mass_factor : float
        Factor C_m, the effective mass of the first mode in the strength ratio; default 1. Table 7-4
        permits smaller values for some buildings.

    Returns
    -------
    TargetDisplacements
        Target displacement of each method, with intermediate results.

    Raises
    ------
    UsageError
        The site class is unknown, or the target does not contain these periods.
    AnalysisError
        The target displacement exceeds the range of the curve.
    """
    if site_class.upper() not in SITE_FACTORS:
        raise UsageError(f"site_class must be one of {', '.join(SITE_FACTORS)}, got {site_class!r}")
    if not 0.0 < mass_factor <= 1.0:
        raise UsageError(f"mass_factor must be above 0 and at most 1, got {mass_factor!r}")
    demand = read_target(target) if isinstance(target, str) else target
    building, curve = assemble(replace(pushed.model, damping=None)), _PushoverCurve.of(pushed)
    shape = pushed.forces / building.mass
    shape /= shape[-1]
    mass = float(building.mass @ shape)
    participation = mass / float(building.mass @ shape**2)
    n2 = _solve("n2", curve, partial(_n2, curve, demand, mass, participation))
    site = SITE_FACTORS[site_class.upper()]
    effective = partial(_coefficients, curve, demand, building, site, mass_factor)
    coefficients = _solve("coefficients", curve, effective)
    notes = _strength_note(curve, building, coefficients, demand)
    c0 = float(building.modes().participation[0])
    return TargetDisplacements(
        [
            _result("n2", curve, demand, building, n2, participation, mass),
            _result(
                "coefficients",
                curve,
                demand,
                building,
                coefficients,
                c0,
                float(building.mass.sum()),
                notes,
            ),
        ]
    )


def _n2(
    curve: _PushoverCurve, demand: TargetSpectrum, mass: float, participation: float, roof: float
) -> _Idealized:
    """Apply N2 (EN 1998-1:2004, annex B) to the curve up to a roof displacement.

    The idealized curve is elastic and perfectly plastic, with equal strength and area.

    Parameters
    ----------
    curve : _PushoverCurve
        Pushover curve.
    demand : TargetSpectrum
        Elastic design spectrum.
    mass, participation : float
        Mass of the equivalent oscillator, kg, and participation factor.
    roof : float
        Roof displacement, m.
    """
    roof = curve.idealized_to(roof)
    strength = curve.strongest(roof) / participation
    oscillator_displacement = roof / participation
    area = curve.at(roof)[1] / participation**2
    yield_displacement = 2.0 * (oscillator_displacement - area / strength)  # (B.6)
    period = 2.0 * math.pi * math.sqrt(mass * yield_displacement / strength)  # (B.7)
    acceleration = float(demand.at(np.array([period]))[0])
    elastic = acceleration * (period / (2.0 * math.pi)) ** 2  # (B.8)
    ratio = acceleration * mass / strength
    increase = 1.0
    if period < demand.corner and ratio > 1.0:  # (B.10)
        increase = min(
            max((1.0 + (ratio - 1.0) * demand.corner / period) / ratio, 1.0),
            _MAX_DISPLACEMENT_RATIO,
        )
    displacement = participation * increase * elastic
    yield_point = strength * participation, yield_displacement * participation
    return _Idealized(period, *yield_point, acceleration, ratio, (increase, 1.0), displacement)


def _coefficients(
    curve: _PushoverCurve,
    demand: TargetSpectrum,
    building: Building,
    site: float,
    mass_factor: float,
    roof: float,
) -> _Idealized:
    """Apply the coefficient method (ASCE 41-17, 7.4.3.3) to the curve up to a roof displacement.

    The idealized curve consists of two lines with equal area. The first line intersects the curve
    at 0.6 of the yield force.

    Parameters
    ----------
    curve : _PushoverCurve
        Pushover curve.
    demand : TargetSpectrum
        Elastic design spectrum.
    building : Building
        Building without damping.
    site : float
        Site factor a.
    mass_factor : float
        Factor C_m.
    roof : float
        Roof displacement, m.
    """
    roof = curve.idealized_to(roof)
    modes = building.modes()
    strength, yield_displacement = _two_lines(curve, roof)
    initial = float(curve.shear[1] / curve.roof[1])
    stiffness = min(strength / yield_displacement, initial)
    period = 2.0 * math.pi / float(modes.omega[0]) * math.sqrt(initial / stiffness)
    acceleration = float(demand.at(np.array([period]))[0])
    ratio = acceleration * mass_factor * float(building.mass.sum()) / strength
    excess = max(ratio - 1.0, 0.0)
    c1 = 1.0 if period > 1.0 else 1.0 + excess / (site * max(period, 0.2) ** 2)  # (7-29)
    c2 = 1.0 if period > 0.7 else 1.0 + (excess / period) ** 2 / 800.0  # (7-30)
    displacement = (
        float(modes.participation[0]) * c1 * c2 * acceleration * (period / (2.0 * math.pi)) ** 2
    )  # (7-28)
    return _Idealized(
        period, strength, yield_displacement, acceleration, ratio, (c1, c2), displacement
    )


def _two_lines(curve: _PushoverCurve, roof: float) -> tuple[float, float]:
    """Return force and displacement at the intersection of two lines with the area of the curve.

    The smallest such force is returned. If the curve hardens after a yield at 0.6 of a force, the
    secant becomes flatter, and the areas can be equal again at a larger force.
    """
    end, area = curve.at(roof)
    largest = curve.strongest(roof)
    # For each force, the secant intersects the curve at 0.6 of the force. While this intersection
    # moves along a straight part of the curve, the difference of the areas is a linear function of
    # the force. The difference is therefore computed at both ends of each straight part, and
    # interpolated. Flat and decreasing parts are skipped, because they contain no new intersection.
    maximum_before = np.maximum.accumulate(curve.shear)
    rising = np.flatnonzero(curve.shear[1:] > maximum_before[:-1]) + 1
    rising = rising[maximum_before[rising - 1] < _SECANT * largest]
    ends = np.minimum(
        np.array([maximum_before[rising - 1], maximum_before[rising]]), _SECANT * largest
    )
    flexibility = (curve.roof[rising] - curve.roof[rising - 1]) / (
        curve.shear[rising] - curve.shear[rising - 1]
    )
    forces = ends / _SECANT
    yields = (curve.roof[rising] - flexibility * (curve.shear[rising] - ends)) / _SECANT
    low, high = (forces * roof + end * (roof - yields)) / 2.0 - area
    crossed = np.flatnonzero((low < 0.0) & (high >= 0.0))
    if crossed.size and area > (1.0 + _YIELD_TOLERANCE) * end * roof / 2.0:
        i = crossed[0]
        fraction = -low[i] / (high[i] - low[i])
        force = forces[0, i] + fraction * np.ptp(forces[:, i])
        return float(force), float(yields[0, i] + fraction * np.ptp(yields[:, i]))
    # A curve that does not yield is idealized by its first line, through the first point that
    # reaches the force of the secant.
    secant, i = _SECANT * largest, int(np.argmax(curve.shear >= _SECANT * largest))
    (start, stop), (low_force, high_force) = curve.roof[i - 1 : i + 1], curve.shear[i - 1 : i + 1]
    return largest, float(
        (start + (stop - start) * (secant - low_force) / (high_force - low_force)) / _SECANT
    )


def _solve(
    method: str, curve: _PushoverCurve, idealize: Callable[[float], _Idealized]
) -> _Idealized:
    """Return the idealization for the first displacement on the curve that reproduces itself.

    Parameters
    ----------
    method : str
        Name of the method in messages.
    curve : _PushoverCurve
        Pushover curve.
    idealize : callable
        Idealization up to a roof displacement.
    """
    rows = curve.roof[1:]
    previous = rows[0]
    for roof in rows.tolist():
        if idealize(roof).roof_displacement <= roof:
            break
        previous = roof
    else:
        displacement = idealize(previous).roof_displacement
        reason = (
            f"; the curve ends there: {curve.pushed.ended}"
            if curve.pushed.ended
            else "; push further"
        )
        raise AnalysisError(
            f"the target displacement ({method}) exceeds the curve: about {displacement:.4g} m at "
            f"the roof, but the curve reaches {previous:.4g} m{reason}"
        )
    root = previous
    if previous != roof:
        _, root = halved(
            lambda x: x < idealize(x).roof_displacement, previous, roof, _MAX_BISECTIONS
        )
    return idealize(root)


def _strength_note(
    curve: _PushoverCurve, building: Building, idealized: _Idealized, demand: TargetSpectrum
) -> tuple[str, ...]:
    """Return a note if the strength ratio exceeds the limit of the coefficient method.

    The limit is given in ASCE 41-17, 7.4.3.3.2 and equation 7-32.

    Parameters
    ----------
    curve : _PushoverCurve
        Pushover curve.
    building : Building
        Building without damping.
    idealized : _Idealized
        Result of the coefficient method.
    demand : TargetSpectrum
        Elastic design spectrum.
    """
    peak = curve.peak
    below = np.flatnonzero(curve.shear[peak:] <= _SECANT * idealized.yield_force)
    last = peak + int(below[0]) if below.size else curve.shear.size - 1
    span = float(curve.roof[last] - curve.roof[peak])
    if last == peak or span <= 0.0 or curve.shear[last] >= curve.shear[peak]:
        # The roof displacement decreases after the peak, so that the curve has no slope there. If
        # the building cannot be pushed further, the slope is considered infinite.
        if curve.pushed.ended and last == peak:
            slope = geometric = -math.inf
        else:
            return ()
    else:
        stiffness = idealized.yield_force / idealized.yield_displacement
        slope = float(curve.shear[last] - curve.shear[peak]) / span / stiffness
        # Compute the contribution of P-delta to the slope by a second pushover without P-delta.
        geometric, pushed = 0.0, curve.pushed
        if pushed.model.p_delta:
            high = float(curve.roof[last])
            without_p_delta = replace(pushed.model, p_delta=False)
            size = DriftSize(f"{high:.6g}m", high, "length")
            points = max(pushed.base_shear.size - 1, 1)
            other = _PushoverCurve.of(
                pushover(without_p_delta, size, pattern=pushed.pattern, points=points)
            )
            geometric = (
                slope
                - (other.at(high)[0] - other.at(float(curve.roof[peak]))[0]) / span / stiffness
            )
    is_near_fault = float(demand.at(np.array([1.0]))[0]) >= _STRONG_AT_1_S * STANDARD_GRAVITY
    effective = (
        geometric + (0.8 if is_near_fault else 0.2) * (slope - geometric)
        if math.isfinite(slope)
        else -math.inf
    )
    largest = (
        min(idealized.roof_displacement, float(curve.roof[peak])) / idealized.yield_displacement
    )
    if effective < 0.0 and math.isfinite(effective):
        largest += abs(effective) ** -(1.0 + 0.15 * math.log(idealized.period)) / 4.0
    # The limit does not apply to a building that remains elastic (strength ratio up to 1).
    if idealized.strength_ratio <= max(largest, 1.0):
        return ()
    return (
        f"coefficients: the strength ratio {idealized.strength_ratio:.3g} exceeds {largest:.3g}, "
        "the "
        "limit of the method for a building that loses strength (ASCE 41-17, 7.4.3.3.2): do not "
        "use its displacement, run time history analyses",
    )


def _result(
    method: str,
    curve: _PushoverCurve,
    target: TargetSpectrum,
    building: Building,
    idealized: _Idealized,
    participation: float,
    mass: float,
    notes: tuple[str, ...] = (),
) -> TargetDisplacement:
    """Return the result of a method with the response at its target displacement.

    Parameters
    ----------
    method : str
        `n2` or `coefficients`.
    curve : _PushoverCurve
        Pushover curve.
    target : TargetSpectrum
        Elastic design spectrum.
    building : Building
        Building without damping.
    idealized : _Idealized
        Idealized curve.
    participation, mass : float
        As in `TargetDisplacement`.
    notes : tuple of str
        Notes of the method.
    """
    drift = np.array(
        [np.interp(idealized.roof_displacement, curve.roof, column) for column in curve.drift.T]
    )
    end = float(np.max(curve.roof))
    if end < _REQUIRED_RANGE * idealized.roof_displacement and not notes and method == "n2":
        ended = curve.pushed.ended
        text = f"n2: the curve {'ends at' if ended else 'reaches'} "
        text += f"{end / idealized.roof_displacement:.3g} times the target displacement"
        required = f"{_REQUIRED_RANGE:g} are required (EN 1998-1, 4.3.3.4.2.3)"
        # If the building cannot be pushed further, the requirement of the standard cannot be met.
        refused = (
            f" ({ended}), {required} and cannot be met: do not use its displacement, run time "
            "history analyses"
        )
        notes = (text + (refused if ended else f", {required}: push further"),)
    yields = np.where(np.isfinite(building.yield_drift), building.yield_drift, np.nan)
    return TargetDisplacement(
        pushed=curve.pushed,
        target=target,
        method=method,
        participation=participation,
        mass=mass,
        **vars(idealized),
        base_shear=curve.at(idealized.roof_displacement)[0],
        drift=drift,
        drift_ratio=drift / building.rises,
        ductility=drift / yields,
        notes=notes,
    )
