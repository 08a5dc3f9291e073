"""Shear buildings of Hazus types from a few facts, after Lu et al. (2014, 2020).

The rules are those of the shear buildings (MDOF-LU) in SimCenter's regional workflow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tdint.model.damping import rayleigh
from tdint.model.definition import RayleighCoefficients, RayleighRatio
from tdint.model.inventory.facts import BuildingFacts, DerivedBuilding, Scatter
from tdint.model.inventory.hazus import LEVELS, hazus_types
from tdint.model.modes import solve_modes

STRUCTURES = ("W1", "W2", "S1", "S2", "S3", "S4", "S5", "C1", "C2", "C3", "PC1", "PC2", "RM1", "RM2", "URM", "MH")
ZONES = ("Z0", "Z1", "Z2A", "Z2B", "Z3", "Z4")
MOST_STORIES = 50

_NO_HEIGHT_CLASS = ("W1", "W2", "S3", "PC1", "MH")
_HEIGHT_CLASSES = {  # the largest number of stories of each class; the last class has no end
    "RM1": ((3, "L"), (math.inf, "M")),
    "RM2": ((3, "L"), (7, "M"), (math.inf, "H")),
    "URM": ((2, "L"), (math.inf, "M")),
}
_USUAL_CLASSES = ((3, "L"), (7, "M"), (math.inf, "H"))

# Of each zone the levels and the years from which on they hold, the youngest first; what is older is pre
_CODES: Mapping[str, tuple[tuple[int, str], ...]] = {
    "Z4": ((1976, "high"), (1941, "moderate")),
    "Z3": ((1941, "moderate"),),
    "Z2B": ((1976, "moderate"), (1941, "low")),
    "Z2A": ((1941, "low"),),
    "Z1": ((1976, "low"),),
    "Z0": (),
}
_LEAST = {"Z4": "moderate", "Z3": "moderate", "Z2B": "low", "Z2A": "low", "Z1": "low", "Z0": "low"}  # of W1

_FLOOR_MASS = 1000.0  # kg/m^2
_STORY_HEIGHT = 3.6  # m, where the height of the building is not said
_GRAVITY = 9.8  # m/s^2, as the rules have it


def hazus_type(structure: str, stories: int) -> str:
    """The structure type with its class of height."""
    if structure in _NO_HEIGHT_CLASS:
        return structure
    classes = _HEIGHT_CLASSES.get(structure, _USUAL_CLASSES)
    return structure + next(name for most, name in classes if stories <= most)


def design_level(structure: str, year: int, zone: str) -> str:
    """The design level of the code in a zone at a time; light wood frames (W1) are never below a minimum."""
    level = next((name for since, name in _CODES[zone] if year >= since), "pre")
    return max(level, _LEAST[zone], key=LEVELS.index) if structure == "W1" else level


def code_of(facts: BuildingFacts) -> tuple[str, str]:
    """Design level and type of Hazus."""
    level = facts.design_level or design_level(facts.structure, facts.year, facts.zone)
    return level, hazus_type(facts.structure, facts.stories)


def derive(facts: BuildingFacts, scatter: Scatter | None = None) -> DerivedBuilding:
    """The shear building of these facts.

    All floors have the same mass and all stories the same stiffness, so that the fundamental period is that of the
    type; the strength falls with the height like the story shears of a triangular load.
    """
    scatter = scatter or Scatter()
    n = facts.stories
    row = hazus_types()[code_of(facts)]
    mass = _FLOOR_MASS * facts.area
    period = n * row.period_per_story_s
    factor = 0.4053 * n**2 + 0.405 * n + 0.1869
    stiffness = np.full(n, scatter.stiffness * 4.0 * math.pi**2 * factor * mass / period**2)
    below = np.arange(n)
    first_mode = 1.0 if n == 1 else 0.09117 / n**3 - 0.3037 / n**2 + 0.402 / n + 0.8106
    strength = row.yield_acceleration_g * first_mode * mass * _GRAVITY * n * (1.0 - below * (below + 1) / (n * (n + 1)))
    over = row.overstrength - 1.0
    masses = np.full(n, mass)
    modes = solve_modes(masses, stiffness, np.minimum(below, 1.0))
    ratio = (row.damping_ratio if facts.damping_ratio is None else facts.damping_ratio) * scatter.damping
    return DerivedBuilding(
        design_level=row.design_level,
        type=row.type,
        rule_period=period,
        period=float(2.0 * math.pi / modes.omega[0]),
        damping_ratio=ratio,
        mass=masses,
        height=np.full(n, _STORY_HEIGHT if facts.height is None else facts.height / n),
        stiffness=stiffness,
        yield_force=strength,
        ultimate_force=row.overstrength * strength,
        ultimate_drift=strength / stiffness + over * strength / (row.post_yield_ratio * stiffness),
        pinching=row.pinching,
        unloading=row.unloading_exponent,
        damping=_damping(modes.omega, ratio, facts.mass_only),
    )


def _damping(omega: np.ndarray, ratio: float, mass_only: bool) -> RayleighRatio | RayleighCoefficients:
    """Rayleigh damping over modes 1 and 3 (or the last one); of one story half from the mass, half from the
    stiffness."""
    last = min(omega.size, 3)
    if last == 1:
        coefficients = RayleighCoefficients(mass=ratio * float(omega[0]), stiffness=ratio / float(omega[0]))
    else:
        wanted = RayleighRatio((ratio, ratio), (1, last))
        if not mass_only:
            return wanted
        coefficients = rayleigh(wanted, float(omega[0]), float(omega[last - 1]))
    return RayleighCoefficients(coefficients.mass, 0.0) if mass_only else coefficients
