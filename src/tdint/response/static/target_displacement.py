"""Target displacement under a design spectrum, from an equivalent oscillator of a pushover curve.

Two published methods are used. N2 (EN 1998-1:2004, annex B; Fajfar 2000) computes the elastic
demand of the oscillator, increased by a rule for short periods. The coefficient method (ASCE 41-17,
7.4.3.3) multiplies the elastic demand at an effective period by factors. Both idealize the curve up
to the displacement that they compute. The result is therefore the first displacement on the curve
that the method reproduces. For a displacement on the first straight line of the curve, the
idealized curve is this line. For a displacement above the maximum applied force, the curve up to
the maximum is idealized.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tdint.arrays import Array, bisect_interval, immutable
from tdint.errors import AnalysisError, UsageError
from tdint.model.building import Building, assemble
from tdint.response.spectra.target import TargetSpectrum, read_target
from tdint.response.static.pushover import Pushover, pushover
from tdint.tabular import ResultList, Tabular
from tdint.units import STANDARD_GRAVITY, DriftSize

SITE_FACTORS = {"A": 130.0, "B": 130.0, "C": 90.0, "D": 60.0, "E": 60.0, "F": 60.0}
"""Factor a of C1 by site class (ASCE 41-17, 7.4.3.3.2)."""

# Maximum ratio of the target displacement to the elastic displacement (EN 1998-1, B.5)
_MAX_DISPLACEMENT_RATIO = 3.0
# Fraction of the yield force where the effective stiffness intersects the curve (ASCE 41-17,
# 7.4.3.2.4)
_SECANT = 0.6
# Minimum spectral acceleration of a near-fault site at a period of 1 s, g (ASCE 41-17, 7.4.3.3.2)
_NEAR_FAULT_AT_1_S = 0.6
# Fraction of the slope after the peak that is not due to P-delta in the limit of the strength ratio
_LAMBDA, _LAMBDA_NEAR_FAULT = 0.2, 0.8
# Shortest period with C_m = 1, s (ASCE 41-17, table 7-4)
_LONGEST_PERIOD_OF_C_M = 1.0
# Ratio of the maximum displacement of the curve to the target displacement, required by EN 1998-1,
# 4.3.3.4.2.3
_REQUIRED_RANGE = 1.5
# Minimum relative deviation of the force from the first straight line in a building that yields. It
# is a million times the residuals of equilibrium, and a thousandth of the deviation at first yield.
_YIELD_TOLERANCE = 1e-6
# Maximum relative difference of forces that are considered equal; residuals of equilibrium are a
# hundredth of this maximum
_ROUNDING = 1e-9
_MAX_BISECTIONS = 100  # more than the number of binary digits of a floating-point number


@immutable
class TargetDisplacement(Tabular):
    """Target displacement of a building under a design spectrum, by a single method.

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
        Idealized curve of the building: applied force, N, and roof displacement, m, at yield.
    spectral_acceleration : float
        Spectral acceleration of the target at this period, m/s^2.
    strength_ratio : float
        Elastic force over yield force: R, q_u, mu_strength.
    factors : tuple of float
        C1 and C2 for `coefficients`; for `n2` the ratio to the elastic displacement, and 1.
    roof_displacement : float
        Target displacement, m.
    base_shear, applied_force : float
        Restoring force of the first story and sum of the applied forces at the target displacement,
        N.
    drift, drift_ratio, ductility : ndarray, shape (n,)
        Drifts of the stories at the target displacement, m; divided by the height (nan without
        height); divided by the yield drift (nan for a law that does not yield).
    notes : tuple of str
        Conditions that are outside the range of the method.
    site_class : str
        Site class of the coefficient method; empty for `n2`.
    site_factor, mass_factor : float
        Factors a and C_m of the coefficient method; nan for `n2`.
    largest_ratio : float
        Limit of the strength ratio for a building that loses strength, mu_max; nan for `n2`, and if
        the curve has no slope after its peak.
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
    applied_force: float
    drift: Array
    drift_ratio: Array
    ductility: Array
    notes: tuple[str, ...] = ()
    site_class: str = ""
    site_factor: float = math.nan
    mass_factor: float = math.nan
    largest_ratio: float = math.nan

    def _headline(self) -> str:
        return (
            f"by {self.method}: roof displacement {self.roof_displacement:.4g} m, T "
            f"{self.period:.4g} s"
        )


class TargetDisplacements(ResultList[TargetDisplacement]):
    """Target displacements by N2 (first item) and by the coefficient method (second item)."""


@dataclass(frozen=True)
class _PushoverCurve:
    """Pushover curve for increasing roof displacement.

    Attributes
    ----------
    roof, shear, area : ndarray, shape (points,)
        Roof displacement, m; applied force, N; area below the curve up to each point, J.
    """

    pushed: Pushover
    roof: Array
    shear: Array
    area: Array
    drift: Array

    @classmethod
    def of(cls, pushed: Pushover) -> _PushoverCurve:
        """Return the curve of a pushover without states where the roof displacement does not exceed
        all previous values.
        """
        drift, shear = pushed.way
        roof = drift.sum(axis=1)
        # The applied force is linear between two states, so that the area is a sum of trapezoids.
        is_increasing = roof > np.maximum.accumulate(np.concatenate(([-math.inf], roof[:-1])))
        roof, shear, drift = roof[is_increasing], shear[is_increasing], drift[is_increasing]
        area = np.concatenate(([0.0], np.cumsum(np.diff(roof) * (shear[:-1] + shear[1:]) / 2.0)))
        return cls(pushed, roof, shear, area, drift)

    def idealized_to(self, displacement: float) -> float:
        """Return the last roof displacement (m) of the idealized curve.

        It is the argument `displacement` (m), limited to the range from the end of the first
        straight line to the peak of the curve.
        """
        # True for points on the straight line through the origin and the first point.
        is_elastic = (
            self.shear[1:]
            >= (1.0 - _YIELD_TOLERANCE) * self.shear[1] / self.roof[1] * self.roof[1:]
        )
        # Index of the last point on the first line. `is_elastic` starts at point 1.
        last_elastic = is_elastic.size if is_elastic.all() else int(np.argmin(is_elastic))
        return float(np.clip(displacement, self.roof[last_elastic], self.roof[self.peak]))

    @property
    def peak(self) -> int:
        """Index of the last point with the maximum applied force, which may be a plateau."""
        return int(np.flatnonzero(self.shear >= (1.0 - _ROUNDING) * np.max(self.shear))[-1])

    def response_at(self, displacement: float) -> tuple[float, float]:
        """Return applied force (N), and area below the curve (J) up to a roof displacement (m)."""
        shear = float(np.interp(displacement, self.roof, self.shear))
        before = max(int(np.searchsorted(self.roof, displacement)) - 1, 0)
        return shear, float(
            self.area[before]
            + (displacement - self.roof[before]) * (self.shear[before] + shear) / 2.0
        )

    def maximum_shear(self, displacement: float) -> float:
        """Return the maximum applied force (N) up to a roof displacement (m)."""
        return max(
            float(np.max(self.shear[self.roof <= displacement], initial=0.0)),
            self.response_at(displacement)[0],
        )


@dataclass(frozen=True)
class _IdealizedCurve:
    """Idealized curve up to a roof displacement, with the fields of `TargetDisplacement`;
    `roof_displacement` is the displacement that the method computes for this curve, m.
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
        Factor C_m, the effective mass of the first mode divided by the total mass, in the strength
        ratio; default 1. ASCE 41-17, table 7-4, permits smaller values for some buildings with
        periods up to 1 s; for longer periods, 1 is used.

    Returns
    -------
    TargetDisplacements
        Target displacement of each method, with intermediate results.

    Raises
    ------
    UsageError
        The site class is unknown, or the target does not contain these periods.
    ModelError
        The target spectrum cannot be read.
    AnalysisError
        The target displacement exceeds the range of the curve.
    """
    if site_class.upper() not in SITE_FACTORS:
        raise UsageError(f"site_class must be one of {', '.join(SITE_FACTORS)}, got {site_class!r}")
    if not 0.0 < mass_factor <= 1.0:
        raise UsageError(f"mass_factor must be above 0 and at most 1, got {mass_factor!r}")
    demand = read_target(target) if isinstance(target, str) else target
    # Without attachments and links, like the curve
    model = replace(pushed.model, damping=None, attachments=(), links=())
    building, curve = assemble(model), _PushoverCurve.of(pushed)
    # The displacement shape of the equivalent oscillator is 1 at the roof.
    shape = pushed.forces / building.mass
    shape /= shape[-1]
    mass = float(building.mass @ shape)
    participation = mass / float(building.mass @ shape**2)
    n2 = _solve("n2", curve, partial(_n2, curve, demand, mass, participation))
    site_factor = SITE_FACTORS[site_class.upper()]
    idealize_coefficients = partial(
        _coefficients, curve, demand, building, site_factor, mass_factor
    )
    coefficients = _solve("coefficients", curve, idealize_coefficients)
    largest_ratio = _largest_ratio(curve, coefficients, demand)
    first_participation = float(building.modes().participation[0])
    return TargetDisplacements(
        [
            _result("n2", curve, demand, building, n2, participation, mass),
            _result(
                "coefficients",
                curve,
                demand,
                building,
                coefficients,
                first_participation,
                float(building.mass.sum()),
                _strength_note(coefficients, largest_ratio),
                site_class=site_class.upper(),
                site_factor=site_factor,
                mass_factor=_mass_factor_at(coefficients.period, mass_factor),
                largest_ratio=largest_ratio,
            ),
        ]
    )


def _n2(
    curve: _PushoverCurve, demand: TargetSpectrum, mass: float, participation: float, roof: float
) -> _IdealizedCurve:
    """Apply N2 (EN 1998-1:2004, annex B) to the curve up to a roof displacement.

    The idealized curve is elastic and perfectly plastic, with equal strength and area.
    """
    roof = curve.idealized_to(roof)
    # Forces and displacements of the building are divided by the participation factor to obtain the
    # values of the equivalent oscillator. Equation numbers refer to annex B of EN 1998-1.
    yield_strength = curve.maximum_shear(roof) / participation
    oscillator_displacement = roof / participation
    _, area_of_building = curve.response_at(roof)
    area = area_of_building / participation**2
    yield_displacement = 2.0 * (oscillator_displacement - area / yield_strength)  # eq. B.6
    period = 2.0 * math.pi * math.sqrt(mass * yield_displacement / yield_strength)  # eq. B.7
    acceleration = float(demand.at(np.array([period]))[0])
    elastic_displacement = acceleration * (period / (2.0 * math.pi)) ** 2  # eq. B.8
    strength_ratio = acceleration * mass / yield_strength
    displacement_ratio = 1.0
    if period < demand.corner and strength_ratio > 1.0:  # eq. B.10, for short periods
        displacement_ratio = min(
            max((1.0 + (strength_ratio - 1.0) * demand.corner / period) / strength_ratio, 1.0),
            _MAX_DISPLACEMENT_RATIO,
        )
    displacement = participation * displacement_ratio * elastic_displacement
    yield_point = yield_strength * participation, yield_displacement * participation
    return _IdealizedCurve(
        period, *yield_point, acceleration, strength_ratio, (displacement_ratio, 1.0), displacement
    )


def _coefficients(
    curve: _PushoverCurve,
    demand: TargetSpectrum,
    building: Building,
    site_factor: float,
    mass_factor: float,
    roof: float,
) -> _IdealizedCurve:
    """Apply the coefficient method (ASCE 41-17, 7.4.3.3) to the curve up to a roof displacement.

    The idealized curve consists of two lines with equal area. The first line intersects the curve
    at 0.6 of the yield force.
    """
    roof = curve.idealized_to(roof)
    modes = building.modes()
    strength, yield_displacement = _two_lines(curve, roof)
    initial_stiffness = float(curve.shear[1] / curve.roof[1])
    stiffness = min(strength / yield_displacement, initial_stiffness)
    period = 2.0 * math.pi / float(modes.omega[0]) * math.sqrt(initial_stiffness / stiffness)
    acceleration = float(demand.at(np.array([period]))[0])
    strength_ratio = (
        acceleration * _mass_factor_at(period, mass_factor) * float(building.mass.sum()) / strength
    )
    c1, c2, displacement = coefficient_displacement(
        period, acceleration, strength_ratio, site_factor, float(modes.participation[0])
    )
    return _IdealizedCurve(
        period, strength, yield_displacement, acceleration, strength_ratio, (c1, c2), displacement
    )


def _mass_factor_at(period: float, mass_factor: float) -> float:
    """Return C_m at the effective period (s)."""
    return 1.0 if period > _LONGEST_PERIOD_OF_C_M else mass_factor


def coefficient_displacement(
    period: float, acceleration: float, strength_ratio: float, site_factor: float, c0: float
) -> tuple[float, float, float]:
    """Return C1, C2 and the target displacement (m) of the coefficient method.

    Equations 7-29 (C1), 7-30 (C2) and 7-28 (target displacement) of ASCE 41-17.

    Parameters
    ----------
    period : float
        Effective period Te, s.
    acceleration : float
        Spectral acceleration at Te, m/s^2.
    strength_ratio : float
        mu_strength: acceleration times C_m times mass over yield force.
    site_factor : float
        Factor a (`SITE_FACTORS`).
    c0 : float
        Roof displacement over displacement of the oscillator.
    """
    excess = max(strength_ratio - 1.0, 0.0)
    c1 = 1.0 if period > 1.0 else 1.0 + excess / (site_factor * max(period, 0.2) ** 2)
    c2 = 1.0 if period > 0.7 else 1.0 + (excess / period) ** 2 / 800.0
    return c1, c2, c0 * c1 * c2 * acceleration * (period / (2.0 * math.pi)) ** 2


def largest_strength_ratio(
    ductility: float, slope: float, p_delta_slope: float, factor: float, period: float
) -> float:
    """Return mu_max, the limit of the strength ratio of a building that loses strength.

    ASCE 41-17, 7.4.3.3.2 and equation 7-32: mu_max = Delta_d / Delta_y + |alpha_e|^-h / 4, with
    h = 1 + 0.15 ln Te and the effective slope after the peak
    alpha_e = alpha_P-Delta + lambda (alpha_2 - alpha_P-Delta).

    Parameters
    ----------
    ductility : float
        Delta_d / Delta_y: displacement over displacement at yield.
    slope, p_delta_slope : float
        alpha_2 and alpha_P-Delta, relative to the effective stiffness; negative if strength is
        lost.
    factor : float
        lambda: 0.8 for near-fault sites, otherwise 0.2.
    period : float
        Te, s.
    """
    effective = p_delta_slope + factor * (slope - p_delta_slope)
    if effective >= 0.0:
        return ductility
    return float(ductility + abs(effective) ** -(1.0 + 0.15 * math.log(period)) / 4.0)


def _two_lines(curve: _PushoverCurve, roof: float) -> tuple[float, float]:
    """Idealize a pushover curve by two lines, and return force (N) and roof displacement (m) of the
    point where the lines meet (yield).

    The first line is a secant from the origin, which intersects the curve at 0.6 of the yield
    force. The second line ends on the curve at the displacement `roof`. The area below the two
    lines equals the area below the curve. If several yield forces satisfy this condition, the
    smallest is returned. (If the curve hardens after a yield, the secant becomes flatter, and the
    areas can be equal again at a larger force.)
    """
    end_shear, area = curve.response_at(roof)
    maximum_shear = curve.maximum_shear(roof)
    # The intersection of the secant at 0.6 times the yield force moves along a straight part of the
    # curve: the displacement at yield, and therefore the area below the two lines, are linear
    # functions of the yield force. The difference of the areas is computed only at both endpoints
    # of each straight part, and interpolated. Flat and decreasing parts contain no new
    # intersection.
    maximum_before = np.maximum.accumulate(curve.shear)
    rising = np.flatnonzero(curve.shear[1:] > maximum_before[:-1]) + 1
    rising = rising[maximum_before[rising - 1] < _SECANT * maximum_shear]
    intersection_shears = np.minimum(
        np.array([maximum_before[rising - 1], maximum_before[rising]]), _SECANT * maximum_shear
    )
    flexibility = (curve.roof[rising] - curve.roof[rising - 1]) / (
        curve.shear[rising] - curve.shear[rising - 1]
    )
    forces = intersection_shears / _SECANT
    yield_displacements = (
        curve.roof[rising] - flexibility * (curve.shear[rising] - intersection_shears)
    ) / _SECANT
    # Difference of the areas (two lines minus curve) at both endpoints of each straight part.
    area_at_start, area_at_end = (
        forces * roof + end_shear * (roof - yield_displacements)
    ) / 2.0 - area
    sign_changes = np.flatnonzero((area_at_start < 0.0) & (area_at_end >= 0.0))
    # The curve yields only if its area exceeds that of the triangle below a straight line.
    if sign_changes.size and area > (1.0 + _YIELD_TOLERANCE) * end_shear * roof / 2.0:
        crossing = sign_changes[0]
        fraction = -area_at_start[crossing] / (area_at_end[crossing] - area_at_start[crossing])
        force = forces[0, crossing] + fraction * np.ptp(forces[:, crossing])
        return float(force), float(
            yield_displacements[0, crossing] + fraction * np.ptp(yield_displacements[:, crossing])
        )
    # A curve that does not yield has no such point. It is idealized by the secant through the first
    # point at 0.6 of the maximum applied force, up to this shear.
    secant = _SECANT * maximum_shear
    crossing = int(np.argmax(curve.shear >= secant))
    start_roof, stop_roof = curve.roof[crossing - 1 : crossing + 1]
    low_force, high_force = curve.shear[crossing - 1 : crossing + 1]
    return maximum_shear, float(
        (start_roof + (stop_roof - start_roof) * (secant - low_force) / (high_force - low_force))
        / _SECANT
    )


def _solve(
    method: str, curve: _PushoverCurve, idealize: Callable[[float], _IdealizedCurve]
) -> _IdealizedCurve:
    """Return the idealization for the smallest roof displacement that its idealization reproduces;
    raise AnalysisError if it exceeds the range of the curve.
    """
    roof_displacements = curve.roof[1:]
    previous = roof_displacements[0]
    for roof in roof_displacements.tolist():
        if idealize(roof).roof_displacement <= roof:
            break
        previous = roof
    else:
        text = curve.pushed.model.output_units.text
        displacement = idealize(previous).roof_displacement
        reason = (
            f"; the curve ends there: {curve.pushed.ended}"
            if curve.pushed.ended
            else "; continue the pushover to a larger displacement"
        )
        raise AnalysisError(
            f"the target displacement of the roof ({method}) is about {text(displacement, 'm')}, "
            f"which exceeds the end of the pushover curve at {text(previous, 'm')}{reason}"
        )
    # `previous` equals `roof` if the first point of the curve already exceeds the result.
    root = previous
    if previous != roof:
        _, root = bisect_interval(
            lambda x: x < idealize(x).roof_displacement, previous, roof, _MAX_BISECTIONS
        )
    return idealize(root)


def _strength_note(idealized: _IdealizedCurve, largest_ratio: float) -> tuple[str, ...]:
    """Return a note if the strength ratio exceeds the limit of the coefficient method (nan: no
    limit); empty if the limit is met."""
    # The limit does not apply to a building that remains elastic (strength ratio up to 1).
    if not idealized.strength_ratio > max(largest_ratio, 1.0):
        return ()
    return (
        f"coefficients: the strength ratio {idealized.strength_ratio:.3g} exceeds "
        f"{largest_ratio:.3g}, the limit of the method for a building that loses strength (ASCE "
        "41-17, 7.4.3.3.2); do not use the computed displacement, run time history analyses "
        "instead",
    )


def _largest_ratio(
    curve: _PushoverCurve, idealized: _IdealizedCurve, demand: TargetSpectrum
) -> float:
    """Return the limit of the strength ratio of the coefficient method; nan if the curve has no
    slope after its peak, so that the building does not lose strength."""
    peak = curve.peak
    # The slope after the peak is measured up to the point at 0.6 of the yield force, or to the end.
    below_secant = np.flatnonzero(curve.shear[peak:] <= _SECANT * idealized.yield_force)
    end_point = peak + int(below_secant[0]) if below_secant.size else curve.shear.size - 1
    roof_range = float(curve.roof[end_point] - curve.roof[peak])
    if end_point == peak or roof_range <= 0.0 or curve.shear[end_point] >= curve.shear[peak]:
        # The roof displacement decreases after the peak, so that the curve has no slope at this
        # point. If the building cannot be pushed further, the slope is considered infinite.
        if curve.pushed.ended and end_point == peak:
            slope = p_delta_slope = -math.inf
        else:
            return math.nan
    else:
        stiffness = idealized.yield_force / idealized.yield_displacement
        slope = float(curve.shear[end_point] - curve.shear[peak]) / roof_range / stiffness
        # Compute the contribution of P-delta to the slope by a second pushover without P-delta.
        p_delta_slope, pushed = 0.0, curve.pushed
        if pushed.model.has_p_delta:
            end_roof = float(curve.roof[end_point])
            without_p_delta = pushed.model.without_p_delta()
            size = DriftSize(f"{end_roof:.6g}m", end_roof, "length")
            points = max(pushed.applied_force.size - 1, 1)
            curve_without_p_delta = _PushoverCurve.of(
                pushover(without_p_delta, size, pattern=pushed.pattern, points=points)
            )
            p_delta_slope = (
                slope
                - (
                    curve_without_p_delta.response_at(end_roof)[0]
                    - curve_without_p_delta.response_at(float(curve.roof[peak]))[0]
                )
                / roof_range
                / stiffness
            )
    is_near_fault = float(demand.at(np.array([1.0]))[0]) >= _NEAR_FAULT_AT_1_S * STANDARD_GRAVITY
    ductility = (
        min(idealized.roof_displacement, float(curve.roof[peak])) / idealized.yield_displacement
    )
    if not math.isfinite(slope):
        return ductility
    factor = _LAMBDA_NEAR_FAULT if is_near_fault else _LAMBDA
    return largest_strength_ratio(ductility, slope, p_delta_slope, factor, idealized.period)


def _result(
    method: str,
    curve: _PushoverCurve,
    target: TargetSpectrum,
    building: Building,
    idealized: _IdealizedCurve,
    participation: float,
    mass: float,
    notes: tuple[str, ...] = (),
    **coefficients: Any,
) -> TargetDisplacement:
    """Return the result of a method with the response at its target displacement.

    `building` is the building without damping. `participation` and `mass` are the participation
    factor, and mass of the equivalent oscillator or of the building, kg. `coefficients` are
    attributes of the coefficient method.
    """
    drift = np.array(
        [np.interp(idealized.roof_displacement, curve.roof, column) for column in curve.drift.T]
    )
    curve_end = float(np.max(curve.roof))
    if curve_end < _REQUIRED_RANGE * idealized.roof_displacement and not notes and method == "n2":
        ended = curve.pushed.ended
        range_text = f"n2: the curve {'ends at' if ended else 'reaches'} "
        range_text += f"{curve_end / idealized.roof_displacement:.3g} times the target displacement"
        requirement = f"{_REQUIRED_RANGE:g} are required (EN 1998-1, 4.3.3.4.2.3)"
        # If the building cannot be pushed further, the requirement of the standard cannot be met.
        consequence = (
            f" ({ended}), {requirement} and cannot be met; do not use the computed displacement, "
            "run time history analyses instead"
        )
        remedy = "continue the pushover to a larger displacement"
        notes = (range_text + (consequence if ended else f", {requirement}; {remedy}"),)
    applied = curve.response_at(idealized.roof_displacement)[0]
    yield_drift = np.where(np.isfinite(building.yield_drift), building.yield_drift, np.nan)
    return TargetDisplacement(
        pushed=curve.pushed,
        target=target,
        method=method,
        participation=participation,
        mass=mass,
        **vars(idealized),
        base_shear=applied - curve.pushed.geometric_stiffness * float(drift[0]),
        applied_force=applied,
        drift=drift,
        drift_ratio=drift / building.heights,
        ductility=drift / yield_drift,
        notes=notes,
        **coefficients,
    )
