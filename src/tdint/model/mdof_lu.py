"""Derive shear buildings of Hazus types from a few properties: the rules MDOF-LU of SimCenter.

SimCenter uses these rules, after Lu et al. (2014, 2020), in its regional workflow. The table
`hazus_types.csv` contains capacity, hysteresis, period and damping by design level and type. The
values are from Hazus-MH 2.1 (FEMA, Technical Manual, chapter 5) in the form that Lu, Lu,
Guan and Ye (Earthquake Spectra 30, 2014) and SimCenter use for shear buildings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tdint.arrays import Array
from tdint.files import declared_rows
from tdint.model.damping import rayleigh
from tdint.model.definition import RayleighCoefficients, RayleighRatio
from tdint.model.modes import solve_modes
from tdint.model.story import Story
from tdint.model.story_laws import Law


@dataclass(frozen=True, slots=True)
class BuildingFacts:
    """Data of a building in an inventory.

    Attributes
    ----------
    structure : str
        Structure type, such as C1.
    stories : int
        Number of stories.
    year : int | None
        Year of construction; None if `design_level` is specified.
    area : float
        Plan area of a single floor, m^2.
    height : float | None
        Height of the building, m; None if unknown.
    zone : str
        Seismic zone of the code: Z0, Z1, Z2A, Z2B, Z3 or Z4.
    design_level : str | None
        pre, low, moderate or high; None if zone and year determine the level.
    damping_ratio : float | None
        Damping ratio; None if the type determines the ratio.
    mass_only : bool
        True to omit the stiffness-proportional part of the damping, in order to reproduce the
        results of programs without this part.
    """

    structure: str
    stories: int
    year: int | None
    area: float
    height: float | None = None
    zone: str = "Z4"
    design_level: str | None = None
    damping_ratio: float | None = None
    mass_only: bool = False


@dataclass(frozen=True)
class Scatter:
    """Random factors on the stiffness and the damping ratio of a building; 1 for no change.

    The strength does not change with the stiffness.
    """

    stiffness: float = 1.0
    damping: float = 1.0


@dataclass(frozen=True)
class DerivedBuilding:
    """Shear building derived by the rules; arrays of shape (stories,), from the ground up.

    Attributes
    ----------
    design_level, type : str
        Design level and type of the table row with the parameters.
    rule_period : float
        Target fundamental period of the stiffness, without scatter, s.
    damping_ratio : float
        Damping ratio with scatter.
    mass, height, stiffness, yield_force, ultimate_force, ultimate_drift : ndarray
        Values of each story, kg, m, N/m, N, N, m.
    """

    design_level: str
    type: str
    rule_period: float
    period: float
    damping_ratio: float
    mass: Array
    height: Array
    stiffness: Array
    yield_force: Array
    ultimate_force: Array
    ultimate_drift: Array
    pinching: float
    unloading: float
    damping: RayleighRatio | RayleighCoefficients

    @property
    def yield_drift(self) -> Array:
        """Drift at first yield, m."""
        return np.asarray(self.yield_force / self.stiffness)

    @property
    def stories(self) -> tuple[Story, ...]:
        """Stories of a model, from the ground up."""
        backbone = self.yield_force, self.ultimate_force, self.ultimate_drift
        columns = (self.mass, self.height, self.stiffness, *backbone)
        stories = []
        for mass, height, stiffness, *parameters in zip(
            *(column.tolist() for column in columns), strict=True
        ):
            law = Law("trilinear-pinching", (*parameters, self.pinching, self.unloading))
            stories.append(Story(mass, height, stiffness, law, dashpot=0.0))
        return tuple(stories)


LEVELS = ("pre", "low", "moderate", "high")
"""Design levels from the weakest to the strongest."""


@cache
def hazus_types() -> Mapping[tuple[str, str], SimpleNamespace]:
    """Return the rows of the table of building types by design level and type.

    Attributes of a row
    -------------------
    design_level, type : str
        Item of `LEVELS`; type with its height class, such as C1M.
    min_stories, max_stories : float
        Range of the number of stories for the row.
    yield_acceleration_g : float
        Yield force of the building over its weight, without the factor for the effective mass of
        the first mode.
    overstrength : float
        Ultimate force over yield force.
    post_yield_ratio : float
        Post-yield stiffness over initial stiffness.
    pinching, unloading_exponent : float
        Parameters of the trilinear-pinching law.
    period_per_story_s : float
        Fundamental period over number of stories, s.
    damping_ratio : float
        Viscous damping ratio.
    slight_drift_ratio, moderate_drift_ratio, extensive_drift_ratio, complete_drift_ratio : float
        Median drift ratios of the damage states.
    """
    keys = ("design_level", "type")
    rows = (
        SimpleNamespace(
            **{name: cell if name in keys else float(cell) for name, cell in row.items()}
        )
        for row in declared_rows(str(Path(__file__).with_name("hazus_types.csv")))
    )
    return {(row.design_level, row.type): row for row in rows}


ZONES = ("Z0", "Z1", "Z2A", "Z2B", "Z3", "Z4")
USUAL_STORIES = {
    "W1": (1, 2),
    "W2": (1, 6),
    "S3": (1, 2),
    "PC1": (1, 3),
    "RM1": (1, 7),
    "URM": (1, 7),
    "MH": (1, 1),
}
"""Usual numbers of stories of the types that are not built in every height: table 5.1 of the Hazus
manual (W1 one or two stories, RM1 and URM low and mid rise, MH one story); for W2, S3 and PC1, of
which the manual states typical numbers only (2, 1 and 1), the highest usual buildings."""
MOST_STORIES = 50  # maximum number of stories; the rules are for regular buildings, not for towers
YEARS = (1000, 2200)  # allowed years of construction

_TYPES_WITHOUT_HEIGHT_CLASS = ("W1", "W2", "S3", "PC1", "MH")
# The last letter of the other types in the table is the height class.
STRUCTURES = tuple(
    dict.fromkeys(
        name if name in _TYPES_WITHOUT_HEIGHT_CLASS else name[:-1] for _, name in hazus_types()
    )
)
"""Structure types without height classes, in the order of the table."""
# Height classes of a structure type: maximum number of stories and name. The last class has no
# maximum.
_HEIGHT_CLASSES = {
    "RM1": ((3, "L"), (math.inf, "M")),
    "RM2": ((3, "L"), (7, "M"), (math.inf, "H")),
    "URM": ((2, "L"), (math.inf, "M")),
}
_DEFAULT_HEIGHT_CLASSES = ((3, "L"), (7, "M"), (math.inf, "H"))

# For each seismic zone, the design levels with their first year, the latest first.
# Older buildings have the level "pre".
_FIRST_YEARS: Mapping[str, tuple[tuple[int, str], ...]] = {
    "Z4": ((1976, "high"), (1941, "moderate")),
    "Z3": ((1941, "moderate"),),
    "Z2B": ((1976, "moderate"), (1941, "low")),
    "Z2A": ((1941, "low"),),
    "Z1": ((1976, "low"),),
    "Z0": (),
}
_MINIMUM_LEVEL = {
    "Z4": "moderate",
    "Z3": "moderate",
    "Z2B": "low",
    "Z2A": "low",
    "Z1": "low",
    "Z0": "low",
}
"""Minimum design level of light wood frames (W1) for each zone."""

_FLOOR_MASS = 1000.0  # kg/m^2
_STORY_HEIGHT = 3.6  # m; used if the height of the building is unknown
_GRAVITY = 9.8  # m/s^2; value of the rules


def hazus_type(structure: str, stories: int) -> str:
    """Return the structure type with its height class, for example C1M for C1 with five stories.

    Types without height classes are returned unchanged.
    """
    if structure in _TYPES_WITHOUT_HEIGHT_CLASS:
        return structure
    classes = _HEIGHT_CLASSES.get(structure, _DEFAULT_HEIGHT_CLASSES)
    return structure + next(name for maximum, name in classes if stories <= maximum)


def design_level(structure: str, year: int, zone: str) -> str:
    """Return the design level that the code of a zone requires for a year of construction.

    Light wood frames (W1) have at least the level of `_MINIMUM_LEVEL`.

    Parameters
    ----------
    structure : str
        Structure type, one of `STRUCTURES`.
    zone : str
        Seismic zone, one of `ZONES`.

    Returns
    -------
    str
        One of `LEVELS`.
    """
    # The latest year is first, so the first match is the valid code.
    level = next((name for first_year, name in _FIRST_YEARS[zone] if year >= first_year), "pre")
    if structure == "W1":
        return max(level, _MINIMUM_LEVEL[zone], key=LEVELS.index)
    return level


def code_of(facts: BuildingFacts) -> tuple[str, str]:
    """Return the design level and the Hazus type of a building."""
    level = facts.design_level
    if not level:
        assert facts.year is not None  # required without a design level
        level = design_level(facts.structure, facts.year, facts.zone)
    return level, hazus_type(facts.structure, facts.stories)


def derive(facts: BuildingFacts, scatter: Scatter | None = None) -> DerivedBuilding:
    """Derive the shear building from the data of a building.

    All floors have the same mass and all stories the same stiffness. The stiffness is chosen for
    the fundamental period of the type. The strength decreases with the height in proportion to the
    story shears of a triangular load.

    Parameters
    ----------
    scatter : Scatter, optional
        Random factors on stiffness and damping; default 1.
    """
    scatter = scatter or Scatter()
    n = facts.stories
    row = hazus_types()[code_of(facts)]
    # Compute the stiffness from the period of the type. In a chain of n equal floors and stories
    # it is `stiffness_factor` times the mass of a floor times the squared circular frequency. The
    # polynomial of the rules approximates the exact factor (0.997 instead of 1 for one story).
    mass = _FLOOR_MASS * facts.area
    period = n * row.period_per_story_s
    stiffness_factor = 0.4053 * n**2 + 0.405 * n + 0.1869
    stiffness = np.full(
        n, scatter.stiffness * 4.0 * math.pi**2 * stiffness_factor * mass / period**2
    )
    # Compute the strength from the yield acceleration of the type and the effective mass of the
    # first mode, which a polynomial approximates for n equal floors. It decreases with the number
    # of stories below, like the story shear of a triangular load.
    stories_below = np.arange(n)
    effective_mass_ratio = 1.0 if n == 1 else 0.09117 / n**3 - 0.3037 / n**2 + 0.402 / n + 0.8106
    strength = (
        row.yield_acceleration_g
        * effective_mass_ratio
        * mass
        * _GRAVITY
        * n
        * (1.0 - stories_below * (stories_below + 1) / (n * (n + 1)))
    )
    force_after_yield = (row.overstrength - 1.0) * strength
    masses = np.full(n, mass)
    modes = solve_modes(masses, stiffness)
    damping_ratio = row.damping_ratio if facts.damping_ratio is None else facts.damping_ratio
    damping_ratio *= scatter.damping
    return DerivedBuilding(
        design_level=row.design_level,
        type=row.type,
        rule_period=period,
        period=float(2.0 * math.pi / modes.omega[0]),
        damping_ratio=damping_ratio,
        mass=masses,
        height=np.full(n, _STORY_HEIGHT if facts.height is None else facts.height / n),
        stiffness=stiffness,
        yield_force=strength,
        ultimate_force=row.overstrength * strength,
        ultimate_drift=strength / stiffness
        + force_after_yield / (row.post_yield_ratio * stiffness),
        pinching=row.pinching,
        unloading=row.unloading_exponent,
        damping=_rayleigh_damping(modes.omega, damping_ratio, facts.mass_only),
    )


def _rayleigh_damping(
    omega: np.ndarray, ratio: float, mass_only: bool
) -> RayleighRatio | RayleighCoefficients:
    """Return Rayleigh damping with the same ratio in modes 1 and 3. A building of two stories has
    the ratio in modes 1 and 2. In a building of one story, mass and stiffness each contribute half
    of the damping.
    """
    second_mode = min(omega.size, 3)
    rayleigh_ratio = RayleighRatio((ratio, ratio), (1, second_mode))
    if second_mode > 1 and not mass_only:
        return rayleigh_ratio
    coefficients = rayleigh(rayleigh_ratio, float(omega[0]), float(omega[second_mode - 1]))
    return coefficients._replace(stiffness=0.0) if mass_only else coefficients
