"""Shear buildings from capacity curves (spectral acceleration over spectral displacement), which
global models provide for classes of buildings.

The rules agree with the vulnerability modellers' toolkit of GEM (oq-vmtk 1.1). The floors have
equal masses, except for a lighter roof. The stiffness decreases after every two stories. The curves
of the stories are derived from the capacity curve with the first mode. The toolkit also multiplies
forces and stiffness by a factor that is intended to keep the period, but changes it. This factor is
omitted here unless requested.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.csv_table import read_table
from tdint.errors import ModelError, UsageError
from tdint.items import grouped
from tdint.model.definition import RayleighCoefficients, RayleighRatio
from tdint.model.modes import solve_modes
from tdint.model.story import Story
from tdint.model.story_laws import Law, four_points

GRAVITY = 9.81  # m/s^2; the published curves use this value, not 9.80665
DAMPING_RATIO = 0.05  # damping ratio of the published curves
STORY_HEIGHT = 2.8  # m
UNIT_MASS = 1000.0  # kg

_ROOF_MASS_RATIO = 0.75  # mass of the roof over the mass of another floor
_SOFT_STORY_RATIO = (
    0.35  # stiffness of a soft ground story over the stiffness of an ordinary ground story
)
# Parameters of the law multilinear-pinching, with the values of the toolkit. Pinching of a single
# direction: drift, force, unloading. Degradation: five values each for stiffness, drift and
# strength, followed by the energy capacity.
_PINCHING = (0.5, 0.25, 0.05)
_WITHOUT_DEGRADATION = (0.0, 0.0, 1.0, 1.0, 0.0) * 3 + (math.inf,)
_WITH_DEGRADATION = (0.0, 0.1, 0.0, 0.0, 0.2) * 2 + (0.0, 0.4, 0.0, 0.4, 0.9) + (10.0,)


@dataclass(frozen=True)
class CapacityCurve:
    """Capacity curve with two to four points.

    Attributes
    ----------
    displacement : tuple of float
        Spectral displacements, m, increasing.
    acceleration : tuple of float
        Spectral accelerations, g.

    Raises
    ------
    UsageError
        The points do not form a valid curve.
    """

    displacement: tuple[float, ...]
    acceleration: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the number of points and their values."""
        if not 2 <= len(self.displacement) == len(self.acceleration) <= 4:
            raise UsageError(
                f"a capacity curve must have two to four points, got {len(self.displacement)}"
            )
        if not all(0.0 < value < math.inf for value in (*self.displacement, *self.acceleration)):
            raise UsageError(
                "the displacements and accelerations of a capacity curve must be positive and "
                "finite; correct the values, or omit a point at the origin, where each curve starts"
            )
        if any(
            later <= earlier
            for earlier, later in zip(self.displacement, self.displacement[1:], strict=False)
        ):
            raise UsageError(
                "the displacements of a capacity curve must increase from point to point"
            )

    @classmethod
    def of(cls, points: Sequence[tuple[float, float]]) -> CapacityCurve:
        """Create the curve through points; a point at the origin is omitted.

        Parameters
        ----------
        points : sequence of (float, float)
            Spectral displacement (m) and spectral acceleration (g) of each point.
        """
        nonzero_points = [point for point in points if point != (0.0, 0.0)]
        return cls(tuple(sd for sd, _ in nonzero_points), tuple(sa for _, sa in nonzero_points))

    @property
    def period(self) -> float:
        """Period of the first segment of the curve, s."""
        return 2.0 * math.pi * math.sqrt(self.displacement[0] / (self.acceleration[0] * GRAVITY))

    @property
    def damage_begins(self) -> float:
        """Spectral displacement at the onset of damage, m.

        It is the displacement of the second point of a curve with three or four points, and of the
        first point of a curve with two points. The stories of a model yield at the first point.
        """
        return self.displacement[0 if len(self.displacement) == 2 else 1]


@dataclass(frozen=True)
class CapacityFacts:
    """Data of a building with a capacity curve.

    Attributes
    ----------
    height : float | None
        Height of the building, m; None: number of stories times `STORY_HEIGHT`.
    mass : float
        Total mass of all floors, kg.
    soft_story, degradation : bool
        True for a soft ground story; True if stories lose stiffness and strength.
    as_published : bool
        Multiply forces and stiffness by the factor of version 1.1 of the toolkit.
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
    """Shear building derived from a capacity curve; arrays over the stories from the ground up.

    Attributes
    ----------
    curve_period, period : float
        Period of the first segment of the curve, and of the building, s.
    participation : float
        Participation factor of the first mode for unit roof displacement: roof displacement over
        Sd.
    mode : ndarray, shape (stories,)
        Shape of the first mode, 1 at the roof.
    mass, height : ndarray, shape (stories,)
        Floor masses, kg, and story heights, m.
    drifts, forces : ndarray, shape (stories, 4)
        Points of the backbone curve of each story, m and N.
    damping : RayleighRatio or RayleighCoefficients
        Damping of the first two modes; mass-proportional for one story.
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
        """Stories of a model, from the ground up."""
        degradation = _WITH_DEGRADATION if self.degradation else _WITHOUT_DEGRADATION
        stories = []
        rows = zip(
            self.mass.tolist(),
            self.height.tolist(),
            self.drifts.tolist(),
            self.forces.tolist(),
            strict=True,
        )
        for mass, height, drifts, forces in rows:
            # The parameters are the points of each direction, the pinching of each direction, the
            # drift above which the force is zero (the last point), and the degradation. Both
            # directions are equal. The story yields at the first point.
            backbone = [number for point in zip(drifts, forces, strict=True) for number in point]
            parameters = (*backbone, *backbone, *_PINCHING, *_PINCHING, drifts[-1], *degradation)
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
    """Derive the shear building from a capacity curve and the data of the building.

    The first mode of a building with relative masses and stiffnesses converts the curve, which
    describes an oscillator, to backbone curves of the stories.
    """
    n, curve, ratio = facts.stories, facts.curve, facts.damping_ratio

    # Compute the shape of the first mode from the masses (as fractions of the mass of the building)
    # and from relative stiffnesses, which decrease with the height in the same way for all curves.
    mass_fractions = np.ones(n)
    mass_fractions[-1] = 1.0 if n == 1 else _ROOF_MASS_RATIO
    mass_fractions /= mass_fractions.sum()
    story_index = np.arange(n)
    # Rule of the toolkit: the stiffness decreases after every two stories, by up to about 30 %.
    relative_stiffness = np.maximum(
        1.0 - 0.3 * (2.0 * (story_index // 2) + 0.5) / max(n - 1, 1), 0.5
    )
    if facts.soft_story:
        relative_stiffness[0] *= _SOFT_STORY_RATIO
    shape = solve_modes(mass_fractions, relative_stiffness).shapes[:, 0]
    mode = np.asarray(shape / shape[-1])

    # The first mode converts the curve of the oscillator to the stories: its shape determines the
    # drifts, and the inertia forces of the floors above a story determine the story force.
    mass_times_mode = mass_fractions * mode
    participation = float(mass_times_mode.sum() / (mass_times_mode * mode).sum())
    effective_mass_ratio = float(mass_times_mode.sum() ** 2 / (mass_times_mode * mode).sum())
    shear_over_base_shear = np.cumsum(mass_times_mode[::-1])[::-1] / mass_times_mode.sum()
    # The law of the stories requires four points; `points` has the columns Sd and Sa.
    points = np.array(
        four_points(list(zip(curve.displacement, curve.acceleration, strict=True)))
    ).reshape(4, 2)
    drifts = participation * np.outer(np.diff(mode, prepend=0.0), points[:, 0])
    # In the following, forces and stiffnesses are divided by the mass of the building.
    forces = effective_mass_ratio * GRAVITY * np.outer(shear_over_base_shear, points[:, 1])
    # The published program multiplies the forces by an additional factor: the squared frequency of
    # the curve over the squared frequency of a building with story stiffnesses that are
    # proportional to the story forces.
    if facts.as_published and n > 1:
        unscaled_omega_squared = solve_modes(mass_fractions, shear_over_base_shear).omega[0] ** 2
        curve_omega = 2.0 * math.pi / curve.period
        ground_story_stiffness = (
            curve.acceleration[0]
            * GRAVITY
            * effective_mass_ratio
            / (curve.displacement[0] * participation * mode[0])
        )
        forces *= curve_omega**2 / unscaled_omega_squared / ground_story_stiffness
    stiffness = forces[:, 0] / drifts[:, 0]
    omega = solve_modes(mass_fractions, stiffness).omega
    damping: RayleighRatio | RayleighCoefficients = RayleighRatio((ratio, ratio), (1, 2))
    # A single story has no second mode. Its damping is proportional to the mass, a0 = 2 xi omega.
    if n == 1:
        damping = RayleighCoefficients(mass=2.0 * ratio * float(omega[0]), stiffness=0.0)
    height = n * STORY_HEIGHT if facts.height is None else facts.height
    return CapacityBuilding(
        name=facts.name,
        curve_period=curve.period,
        period=2.0 * math.pi / float(omega[0]),
        participation=participation,
        mode=mode,
        mass=facts.mass * mass_fractions,
        height=np.full(n, height / n),
        drifts=drifts,
        forces=facts.mass * forces,
        damping_ratio=ratio,
        damping=damping,
        degradation=facts.degradation,
    )


@dataclass(frozen=True)
class CapacityClass:
    """Class of buildings with a common capacity curve."""

    curve: CapacityCurve
    soft_story: bool = False
    degradation: bool = False


def read_curve(source: str) -> CapacityCurve:
    """Read the capacity curve from a CSV file with the columns sd_m and sa_g.

    Raises
    ------
    ModelError
        The file cannot be read, or the points do not form a valid curve.
    """
    table = read_table(
        source,
        "a capacity curve must be a CSV file with the columns sd_m and sa_g",
        columns=_COORDINATE_COLUMNS,
    )
    return _curve(
        source, list(zip(*(table.numbers(name) for name in _COORDINATE_COLUMNS), strict=True))
    )


def read_classes(source: str) -> dict[str, CapacityClass]:
    """Read classes of buildings from a CSV file, and return the classes by name.

    The file has the columns class, sd_m and sa_g, and one row for each point of a capacity curve,
    in the order of the curve. The columns soft_story and degradation (true or false) are optional.

    Raises
    ------
    ModelError
        The file cannot be read, or the points of a class do not form a valid curve.
    """
    requirements = (
        "classes must be a CSV file with the columns class, sd_m and sa_g, and one row for each "
        "point of the capacity curve of a class"
    )
    table = read_table(
        source, requirements, columns=("class", *_COORDINATE_COLUMNS, "soft_story", "degradation")
    )
    table.need("class", *_COORDINATE_COLUMNS)
    names = table.texts("class", empty=False)
    coordinates = (table.numbers(column) for column in _COORDINATE_COLUMNS)
    points_by_class = grouped(zip(names, zip(*coordinates, strict=True), strict=True))
    # A flag in any row of a class applies to the class.
    classes_with_flag = {
        flag: {name for name, is_set in zip(names, table.truths(flag), strict=True) if is_set}
        for flag in ("soft_story", "degradation")
    }
    return {
        name: CapacityClass(
            _curve(f"{source}: class {name}", points),
            name in classes_with_flag["soft_story"],
            name in classes_with_flag["degradation"],
        )
        for name, points in points_by_class.items()
    }


_COORDINATE_COLUMNS = ("sd_m", "sa_g")
"""Columns with the coordinates of a point of a capacity curve."""


def _curve(source: str, points: list[tuple[float, float]]) -> CapacityCurve:
    """Return the capacity curve through points: spectral displacement (m) and spectral acceleration
    (g).

    `source` is the start of the error message of an invalid curve: the file, and the class if the
    file contains several.
    """
    try:
        return CapacityCurve.of(points)
    except UsageError as error:
        raise ModelError(f"{source}: {error}") from None
