"""Shear buildings of capacity curves: spectral acceleration over spectral displacement, as classes
of buildings have them in global models.

The rules are those of GEM's vulnerability modellers' toolkit (oq-vmtk 1.1): floors of equal mass
but a lighter roof, stiffness that falls every two stories, and the curve brought to the stories by
the first mode. There forces and stiffness are then multiplied by a factor that is to keep the
period and does the contrary; it is left out here unless it is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.csv_table import read_table
from tdint.errors import ModelError, UsageError
from tdint.model.definition import Law, RayleighCoefficients, RayleighRatio, Story, four_points
from tdint.model.modes import solve_modes

GRAVITY = 9.81  # m/s^2: the published curves are made with it, not with 9.80665
DAMPING_RATIO = 0.05  # of the published curves
STORY_HEIGHT = 2.8  # m
UNIT_MASS = 1000.0  # kg

_ROOF = 0.75  # mass over that of another floor
_SOFT = 0.35  # stiffness of a soft ground story over that of an ordinary one
_PINCHING = (0.5, 0.25, 0.05)
_INTACT = (0.0, 0.0, 1.0, 1.0, 0.0) * 3 + (math.inf,)
_DEGRADING = (0.0, 0.1, 0.0, 0.0, 0.2, 0.0, 0.1, 0.0, 0.0, 0.2, 0.0, 0.4, 0.0, 0.4, 0.9, 10.0)


@dataclass(frozen=True)
class CapacityCurve:
    """Two to four points of a capacity curve.

    Attributes
    ----------
    displacement : tuple of float
        Spectral displacements, m, rising.
    acceleration : tuple of float
        Spectral accelerations, g.

    Raises
    ------
    UsageError
        The points do not make a curve.
    """

    displacement: tuple[float, ...]
    acceleration: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 2 <= len(self.displacement) == len(self.acceleration) <= 4:
            raise UsageError(
                f"a capacity curve has two to four points, got {len(self.displacement)}"
            )
        if not all(0.0 < value < math.inf for value in (*self.displacement, *self.acceleration)):
            raise UsageError("the points of a capacity curve are positive")
        if any(
            later <= earlier
            for earlier, later in zip(self.displacement, self.displacement[1:], strict=False)
        ):
            raise UsageError("the displacements of a capacity curve rise from point to point")

    @classmethod
    def of(cls, points: Sequence[tuple[float, float]]) -> CapacityCurve:
        """The curve through points (Sd m, Sa g); one in the origin is left out. Errors are those of
        the class."""
        kept = [point for point in points if point != (0.0, 0.0)]
        return cls(tuple(sd for sd, _ in kept), tuple(sa for _, sa in kept))

    @property
    def period(self) -> float:
        """Period of its first line, s."""
        return 2.0 * math.pi * math.sqrt(self.displacement[0] / (self.acceleration[0] * GRAVITY))

    @property
    def damage_begins(self) -> float:
        """Displacement from which damage is counted, m: of three or four points the second, of two
        the first.

        The stories of a model yield at the first point (`derive_capacity`).
        """
        return self.displacement[0 if len(self.displacement) == 2 else 1]


@dataclass(frozen=True)
class CapacityFacts:
    """What is said of a building that has a capacity curve.

    Attributes
    ----------
    curve : CapacityCurve
        The curve.
    stories : int
        Number of stories.
    height : float or None
        Height of the building, m; None: so many times `STORY_HEIGHT`.
    mass : float
        Of all floors, kg.
    soft_story, degradation : bool
        Whether the ground story is soft, and whether stories lose stiffness and strength.
    damping_ratio : float
        Viscous damping ratio.
    as_published : bool
        Multiply forces and stiffness by the factor of the toolkit's version 1.1.
    name : str
        Of the class.
    """

    curve: CapacityCurve
    stories: int
    height: float | None = None
    mass: float = UNIT_MASS
    soft_story: bool = False
    degradation: bool = False
    damping_ratio: float = DAMPING_RATIO
    as_published: bool = False
    name: str = ""


@dataclass(frozen=True)
class CapacityBuilding:
    """A shear building of a capacity curve; arrays over the stories from the ground up.

    Attributes
    ----------
    name : str
        Of the class.
    curve_period, period : float
        Of the curve's first line and of the building, s.
    participation : float
        Of the first mode for unit roof displacement: roof displacement over Sd.
    mode : ndarray, shape (stories,)
        The first mode, 1 at the roof.
    mass, height : ndarray, shape (stories,)
        kg, m.
    drifts, forces : ndarray, shape (stories, 4)
        Points of each story's backbone, m and N.
    damping_ratio : float
        Viscous damping ratio.
    damping : RayleighRatio or RayleighCoefficients
        Over the first two modes; of one story from the mass alone.
    degradation : bool
        Whether stories lose stiffness and strength.
    """

    name: str
    curve_period: float
    period: float
    participation: float
    mode: Array
    mass: Array
    height: Array
    drifts: Array
    forces: Array
    damping_ratio: float
    damping: RayleighRatio | RayleighCoefficients
    degradation: bool

    @property
    def stories(self) -> tuple[Story, ...]:
        """The stories of a model."""
        losses = _DEGRADING if self.degradation else _INTACT
        stories = []
        rows = zip(
            self.mass.tolist(),
            self.height.tolist(),
            self.drifts.tolist(),
            self.forces.tolist(),
            strict=True,
        )
        for mass, height, drifts, forces in rows:
            # It yields at the first point. Both directions are alike; beyond the last point a story
            # carries nothing.
            side = [number for point in zip(drifts, forces, strict=True) for number in point]
            parameters = (*side, *side, *_PINCHING, *_PINCHING, drifts[-1], *losses)
            stories.append(
                Story(
                    mass,
                    height,
                    forces[0] / drifts[0],
                    Law("multilinear-pinching", parameters),
                    0.0,
                )
            )
        return tuple(stories)


def derive_capacity(facts: CapacityFacts) -> CapacityBuilding:
    """The shear building of a capacity curve."""
    n, curve, ratio = facts.stories, facts.curve, facts.damping_ratio

    # Masses, and stiffnesses that fall with the height, for the shape of the first mode.
    shares = np.ones(n)
    shares[-1] = 1.0 if n == 1 else _ROOF
    shares /= shares.sum()
    relative = np.maximum(1.0 - 0.3 * (2.0 * (np.arange(n) // 2) + 0.5) / max(n - 1, 1), 0.5)
    if facts.soft_story:
        relative[0] *= _SOFT
    links = np.minimum(np.arange(n), 1.0)
    shape = solve_modes(shares, relative, links).shapes[:, 0]
    mode = np.asarray(shape / shape[-1])

    # That mode takes the curve from one oscillator to the stories: drifts by the shape, forces by
    # the shears above.
    weighted = shares * mode
    participation = float(weighted.sum() / (weighted * mode).sum())
    effective = float(weighted.sum() ** 2 / (weighted * mode).sum())
    above = np.cumsum(weighted[::-1])[::-1] / weighted.sum()
    # Four points, which is what the law of the stories has.
    points = np.array(
        four_points(list(zip(curve.displacement, curve.acceleration, strict=True)))
    ).reshape(4, 2)
    drifts = participation * np.outer(np.diff(mode, prepend=0.0), points[:, 0])
    forces = (
        effective * GRAVITY * np.outer(above, points[:, 1])
    )  # as all that follows, per kg of the building
    # The published program brings forces to the period of the curve by one more factor.
    if facts.as_published and n > 1:
        lowest = solve_modes(shares, above, links).omega[0] ** 2
        frequency = 2.0 * math.pi / curve.period
        first = (
            curve.acceleration[0]
            * GRAVITY
            * effective
            / (curve.displacement[0] * participation * mode[0])
        )
        forces *= frequency**2 / lowest / first
    stiffness = forces[:, 0] / drifts[:, 0]
    omega = solve_modes(shares, stiffness, links).omega
    damping: RayleighRatio | RayleighCoefficients = RayleighRatio((ratio, ratio), (1, 2))
    if n == 1:
        damping = RayleighCoefficients(mass=2.0 * ratio * float(omega[0]), stiffness=0.0)
    height = n * STORY_HEIGHT if facts.height is None else facts.height
    return CapacityBuilding(
        name=facts.name,
        curve_period=curve.period,
        period=2.0 * math.pi / float(omega[0]),
        participation=participation,
        mode=mode,
        mass=facts.mass * shares,
        height=np.full(n, height / n),
        drifts=drifts,
        forces=facts.mass * forces,
        damping_ratio=ratio,
        damping=damping,
        degradation=facts.degradation,
    )


@dataclass(frozen=True)
class CapacityClass:
    """A class of buildings: its curve, whether the ground story is soft, whether stories
    degrade."""

    curve: CapacityCurve
    soft_story: bool = False
    degradation: bool = False


def read_curve(source: str) -> CapacityCurve:
    """The capacity curve of a CSV file with the columns sd_m and sa_g.

    Raises
    ------
    ModelError
        It cannot be read, or its points do not make a curve.
    """
    table = read_table(
        source, "a capacity curve is a CSV file with the columns sd_m and sa_g", columns=_POINT
    )
    return _curve(source, list(zip(*(table.numbers(name) for name in _POINT), strict=True)))


def read_classes(source: str) -> dict[str, CapacityClass]:
    """The classes of a CSV file with the columns class, sd_m and sa_g, a row for each point, those
    of a class below each other; soft_story and degradation (true or false) may stand beside.

    Raises
    ------
    ModelError
        It cannot be read, or the points of a class do not make a curve.
    """
    needs = (
        "classes are a CSV file with the columns class, sd_m and sa_g, a row for each point of a "
        "class's curve"
    )
    table = read_table(source, needs, columns=("class", *_POINT, "soft_story", "degradation"))
    table.need("class", *_POINT)
    names = table.texts("class", empty=False)
    points_of: dict[str, list[tuple[float, float]]] = {}
    for name, *point in zip(names, *(table.numbers(column) for column in _POINT), strict=True):
        points_of.setdefault(name, []).append((point[0], point[1]))
    # A flag on one row of a class is one of the class.
    flags = {
        flag: {name for name, true in zip(names, table.truths(flag), strict=True) if true}
        for flag in ("soft_story", "degradation")
    }
    return {
        name: CapacityClass(
            _curve(f"{source}: class {name}", points),
            name in flags["soft_story"],
            name in flags["degradation"],
        )
        for name, points in points_of.items()
    }


_POINT = ("sd_m", "sa_g")


def _curve(source: str, points: list[tuple[float, float]]) -> CapacityCurve:
    try:
        return CapacityCurve.of(points)
    except UsageError as error:
        raise ModelError(f"{source}: {error}") from None
