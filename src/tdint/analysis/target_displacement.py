"""How far a design spectrum pushes a building: an equivalent oscillator of its pushover, and two
published methods.

N2 (EN 1998-1:2004, annex B; Fajfar 2000) takes the oscillator's elastic demand, larger by a rule
where it is stiff; the coefficient method (ASCE 41-17, 7.4.3.3) multiplies the elastic demand of an
effective period. Both idealize the curve up to the displacement that they give, so it is searched
for: the first one on the curve that is the answer to itself. A displacement within the curve's
first straight line leaves the idealized curve that line, and one beyond its largest base shear what
it is up to there.
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
"""The factor a of C1 by site class (ASCE 41-17, 7.4.3.3.2)."""

_MOST_OF_ELASTIC = 3.0  # no displacement beyond so many times the elastic one (EN 1998-1, B.5)
_SECANT = (
    0.6  # of the yield force: where the effective stiffness meets the curve (ASCE 41-17, 7.4.3.2.4)
)
_STRONG_AT_1_S = 0.6  # g: sites near faults have more (ASCE 41-17, 7.4.3.3.2)
_ENOUGH = 1.5  # times the target displacement: so far a curve is to reach (EN 1998-1, 4.3.3.4.2.3)
# of the force: what equilibrium leaves is a millionth of that, the first yield a thousand times
# more
_STRAIGHT = 1e-6
_ROUNDING = 1e-9  # of a force: equilibrium of the curve is a hundredth of that
_HALVINGS = 100  # of an interval: more than a float has digits


@dataclass(frozen=True, repr=False)
class TargetDisplacement(Tabular):
    """Where a design spectrum pushes a building to, by one method.

    Attributes
    ----------
    pushed, target : Pushover, TargetSpectrum
        The curve and the elastic design spectrum.
    method : str
        `n2` or `coefficients`.
    participation : float
        Participation factor of the shape that is pushed (`n2`), of the first mode (`coefficients`,
        C0).
    mass : float
        Of the equivalent oscillator, kg; of the building with `coefficients`.
    period : float
        T* or Te, s.
    yield_force, yield_displacement : float
        Of the idealized curve of the building: base shear, N, and roof displacement, m.
    spectral_acceleration : float
        Of the target at that period, m/s^2.
    strength_ratio : float
        Elastic force over yield force: R, q_u, mu_strength.
    factors : tuple of float
        C1 and C2 of `coefficients`; the ratio to the elastic displacement and 1 of `n2`.
    roof_displacement : float
        The target displacement, m.
    base_shear : float
        There, N.
    drift, drift_ratio, ductility : ndarray, shape (n,)
        Of the stories there: m, over the height (nan without one), over the yield drift (nan of a
        law without).
    notes : tuple of str
        What takes the value away from what the method is for.
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
    """Target displacements by both methods."""


@dataclass(frozen=True)
class _Pushed:
    """A pushover as far as its roof goes on, over the displacement of the roof.

    Attributes
    ----------
    pushed : Pushover
        All of it.
    roof, shear, work : ndarray, shape (points,)
        Displacement of the roof, m, base shear, N, area below the curve so far, J.
    drift : ndarray, shape (points, n)
        Drifts of the stories, m.
    """

    pushed: Pushover
    roof: Array
    shear: Array
    work: Array
    drift: Array

    @classmethod
    def of(cls, pushed: Pushover) -> _Pushed:
        drift, shear = pushed.way
        roof = drift.sum(axis=1)
        on = roof > np.maximum.accumulate(np.concatenate(([-math.inf], roof[:-1])))
        roof, shear, drift = roof[on], shear[on], drift[on]
        work = np.concatenate(([0.0], np.cumsum(np.diff(roof) * (shear[:-1] + shear[1:]) / 2.0)))
        return cls(pushed, roof, shear, work, drift)

    def idealized_to(self, displacement: float) -> float:
        """As far as it is idealized for a displacement: at least its first straight line, and not
        beyond its peak."""
        line = self.shear[1:] >= (1.0 - _STRAIGHT) * self.shear[1] / self.roof[1] * self.roof[1:]
        straight = line.size if line.all() else int(np.argmin(line))
        return float(np.clip(displacement, self.roof[straight], self.roof[self.peak]))

    @property
    def peak(self) -> int:
        """The last point at its largest base shear, which may be a plateau."""
        return int(np.flatnonzero(self.shear >= (1.0 - _ROUNDING) * np.max(self.shear))[-1])

    def at(self, displacement: float) -> tuple[float, float]:
        """Base shear and area at a displacement of the roof."""
        shear = float(np.interp(displacement, self.roof, self.shear))
        i = max(int(np.searchsorted(self.roof, displacement)) - 1, 0)
        return shear, float(
            self.work[i] + (displacement - self.roof[i]) * (self.shear[i] + shear) / 2.0
        )

    def strongest(self, displacement: float) -> float:
        """The largest base shear up to a displacement of the roof."""
        return max(
            float(np.max(self.shear[self.roof <= displacement], initial=0.0)),
            self.at(displacement)[0],
        )


@dataclass(frozen=True)
class _Idealized:
    """What a method makes of the curve up to a displacement of the roof, and the displacement that
    it answers with: fields of `TargetDisplacement`."""

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
    """The displacements to which a design spectrum pushes a building, by N2 and by the coefficient
    method.

    Parameters
    ----------
    pushed : Pushover
        The curve; the shape of the equivalent oscillator is its forces over the masses.
    target : TargetSpectrum or str
        The elastic design spectrum: a code's name with parameters, or a file.
    site_class : str
        A to F, of C1; D where nothing is known of the site.
    mass_factor : float
        C_m, the effective mass of the first mode in the strength ratio: 1 unless table 7-4 has less
        for the building.

    Returns
    -------
    TargetDisplacements
        Of each procedure the displacement of the roof and how it came about.

    Raises
    ------
    UsageError
        An unknown site class; a target without these periods.
    AnalysisError
        The target displacement lies beyond the curve.
    """
    if site_class.upper() not in SITE_FACTORS:
        raise UsageError(f"site_class must be one of {', '.join(SITE_FACTORS)}, got {site_class!r}")
    if not 0.0 < mass_factor <= 1.0:
        raise UsageError(f"mass_factor must be above 0 and at most 1, got {mass_factor!r}")
    demand = read_target(target) if isinstance(target, str) else target
    building, curve = assemble(replace(pushed.model, damping=None)), _Pushed.of(pushed)
    shape = pushed.forces / building.mass
    shape /= shape[-1]
    mass = float(building.mass @ shape)
    participation = mass / float(building.mass @ shape**2)
    n2 = _solve("n2", curve, partial(_n2, curve, demand, mass, participation))
    site = SITE_FACTORS[site_class.upper()]
    effective = partial(_coefficients, curve, demand, building, site, mass_factor)
    coefficients = _solve("coefficients", curve, effective)
    notes = _beyond_strength(curve, building, coefficients, demand)
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
    curve: _Pushed, demand: TargetSpectrum, mass: float, participation: float, roof: float
) -> _Idealized:
    """EN 1998-1:2004, annex B: elastic and perfectly plastic, of the strength and the area up to a
    displacement."""
    roof = curve.idealized_to(roof)
    strength = curve.strongest(roof) / participation
    reached, area = roof / participation, curve.at(roof)[1] / participation**2
    yielding = 2.0 * (reached - area / strength)  # (B.6)
    period = 2.0 * math.pi * math.sqrt(mass * yielding / strength)  # (B.7)
    acceleration = float(demand.at(np.array([period]))[0])
    elastic = acceleration * (period / (2.0 * math.pi)) ** 2  # (B.8)
    ratio = acceleration * mass / strength
    larger = 1.0
    if period < demand.corner and ratio > 1.0:  # (B.10)
        larger = min(
            max((1.0 + (ratio - 1.0) * demand.corner / period) / ratio, 1.0), _MOST_OF_ELASTIC
        )
    answer = participation * larger * elastic
    yields = strength * participation, yielding * participation
    return _Idealized(period, *yields, acceleration, ratio, (larger, 1.0), answer)


def _coefficients(
    curve: _Pushed,
    demand: TargetSpectrum,
    building: Building,
    site: float,
    mass_factor: float,
    roof: float,
) -> _Idealized:
    """ASCE 41-17, 7.4.3.3: two lines of the curve's area, the first through its point at 0.6 of the
    yield force."""
    roof = curve.idealized_to(roof)
    modes = building.modes()
    strength, yields = _two_lines(curve, roof)
    initial = float(curve.shear[1] / curve.roof[1])
    stiffness = min(strength / yields, initial)
    period = 2.0 * math.pi / float(modes.omega[0]) * math.sqrt(initial / stiffness)
    acceleration = float(demand.at(np.array([period]))[0])
    ratio = acceleration * mass_factor * float(building.mass.sum()) / strength
    beyond = max(ratio - 1.0, 0.0)
    c1 = 1.0 if period > 1.0 else 1.0 + beyond / (site * max(period, 0.2) ** 2)  # (7-29)
    c2 = 1.0 if period > 0.7 else 1.0 + (beyond / period) ** 2 / 800.0  # (7-30)
    answer = (
        float(modes.participation[0]) * c1 * c2 * acceleration * (period / (2.0 * math.pi)) ** 2
    )  # (7-28)
    return _Idealized(period, strength, yields, acceleration, ratio, (c1, c2), answer)


def _two_lines(curve: _Pushed, roof: float) -> tuple[float, float]:
    """Force and displacement at which two lines of the curve's area up to a displacement of the
    roof meet: the smallest force, for where a curve hardens beyond a yield at 0.6 of it, the secant
    flattens and balances the areas again."""
    end, area = curve.at(roof)
    largest = curve.strongest(roof)
    # Between the corners of the curve below 0.6 of it the secant's point moves on a straight line,
    # and so does what the lines enclose beyond the curve: a corner is told from both sides, as the
    # curve may dip or be flat before it.
    before = np.maximum.accumulate(curve.shear)
    rising = np.flatnonzero(curve.shear[1:] > before[:-1]) + 1
    rising = rising[before[rising - 1] < _SECANT * largest]
    ends = np.minimum(np.array([before[rising - 1], before[rising]]), _SECANT * largest)
    along = (curve.roof[rising] - curve.roof[rising - 1]) / (
        curve.shear[rising] - curve.shear[rising - 1]
    )
    forces = ends / _SECANT
    yields = (curve.roof[rising] - along * (curve.shear[rising] - ends)) / _SECANT
    low, high = (forces * roof + end * (roof - yields)) / 2.0 - area
    crossed = np.flatnonzero((low < 0.0) & (high >= 0.0))
    if crossed.size and area > (1.0 + _STRAIGHT) * end * roof / 2.0:
        i = crossed[0]
        part = -low[i] / (high[i] - low[i])
        return float(forces[0, i] + part * np.ptp(forces[:, i])), float(
            yields[0, i] + part * np.ptp(yields[:, i])
        )
    # A curve that never yields is its first line, through the first point at which the secant's
    # force is reached.
    secant, i = _SECANT * largest, int(np.argmax(curve.shear >= _SECANT * largest))
    (start, stop), (low_force, high_force) = curve.roof[i - 1 : i + 1], curve.shear[i - 1 : i + 1]
    return largest, float(
        (start + (stop - start) * (secant - low_force) / (high_force - low_force)) / _SECANT
    )


def _solve(method: str, curve: _Pushed, idealize: Callable[[float], _Idealized]) -> _Idealized:
    """The first displacement on the curve that is the answer to itself."""
    rows = curve.roof[1:]
    before = rows[0]
    for roof in rows.tolist():
        if idealize(roof).roof_displacement <= roof:
            break
        before = roof
    else:
        answer = idealize(before).roof_displacement
        why = (
            f"; the curve ends there: {curve.pushed.ended}"
            if curve.pushed.ended
            else ": push further"
        )
        raise AnalysisError(
            f"the target displacement ({method}) is beyond the curve, some {answer:.4g} m of the "
            f"roof where it reaches {before:.4g} m{why}"
        )
    root = before
    if before != roof:
        _, root = halved(lambda x: x < idealize(x).roof_displacement, before, roof, _HALVINGS)
    return idealize(root)


def _beyond_strength(
    curve: _Pushed, building: Building, made: _Idealized, demand: TargetSpectrum
) -> tuple[str, ...]:
    """Whether the strength ratio is beyond what the coefficient method is for (ASCE 41-17,
    7.4.3.3.2 and 7-32)."""
    peak = curve.peak
    below = np.flatnonzero(curve.shear[peak:] <= _SECANT * made.yield_force)
    last = peak + int(below[0]) if below.size else curve.shear.size - 1
    span = float(curve.roof[last] - curve.roof[peak])
    if last == peak or span <= 0.0 or curve.shear[last] >= curve.shear[peak]:
        if (
            curve.pushed.ended and last == peak
        ):  # it comes back from its peak: no slope, and no ductility beyond it
            slope = geometric = -math.inf
        else:
            return ()
    else:
        stiffness = made.yield_force / made.yield_displacement
        slope = float(curve.shear[last] - curve.shear[peak]) / span / stiffness
        # The part of the slope that P-delta has: without it the curve is pushed once more.
        geometric, pushed = 0.0, curve.pushed
        if pushed.model.p_delta:
            high = float(curve.roof[last])
            bare = replace(pushed.model, p_delta=False)
            size = DriftSize(f"{high:.6g}m", high, "length")
            points = max(pushed.base_shear.size - 1, 1)
            other = _Pushed.of(pushover(bare, size, pattern=pushed.pattern, points=points))
            geometric = (
                slope
                - (other.at(high)[0] - other.at(float(curve.roof[peak]))[0]) / span / stiffness
            )
    near = float(demand.at(np.array([1.0]))[0]) >= _STRONG_AT_1_S * STANDARD_GRAVITY
    effective = (
        geometric + (0.8 if near else 0.2) * (slope - geometric)
        if math.isfinite(slope)
        else -math.inf
    )
    largest = min(made.roof_displacement, float(curve.roof[peak])) / made.yield_displacement
    if effective < 0.0 and math.isfinite(effective):
        largest += abs(effective) ** -(1.0 + 0.15 * math.log(made.period)) / 4.0
    if made.strength_ratio <= max(largest, 1.0):  # what stays elastic loses no strength
        return ()
    return (
        f"coefficients: the strength ratio {made.strength_ratio:.3g} is beyond {largest:.3g}, up "
        "to which the method holds for a building that loses strength (ASCE 41-17, 7.4.3.3.2): do "
        "not use its displacement, run time histories",
    )


def _result(
    method: str,
    curve: _Pushed,
    target: TargetSpectrum,
    building: Building,
    made: _Idealized,
    participation: float,
    mass: float,
    notes: tuple[str, ...] = (),
) -> TargetDisplacement:
    drift = np.array(
        [np.interp(made.roof_displacement, curve.roof, column) for column in curve.drift.T]
    )
    most = float(np.max(curve.roof))
    if most < _ENOUGH * made.roof_displacement and not notes and method == "n2":
        ended = curve.pushed.ended
        text = f"n2: the curve {'ends' if ended else 'reaches'} {'at ' * bool(ended)}"
        text += f"{most / made.roof_displacement:.3g} times the target displacement"
        asked = f"{_ENOUGH:g} are asked for (EN 1998-1, 4.3.3.4.2.3)"
        # Where the building itself ends, no further push meets what the standard asks for.
        refused = (
            f" ({ended}), {asked} and are not met: do not use its displacement, run time histories"
        )
        notes = (text + (refused if ended else f", {asked}: push further"),)
    yields = np.where(np.isfinite(building.yield_drift), building.yield_drift, np.nan)
    return TargetDisplacement(
        pushed=curve.pushed,
        target=target,
        method=method,
        participation=participation,
        mass=mass,
        **vars(made),
        base_shear=curve.at(made.roof_displacement)[0],
        drift=drift,
        drift_ratio=drift / building.rises,
        ductility=drift / yields,
        notes=notes,
    )
