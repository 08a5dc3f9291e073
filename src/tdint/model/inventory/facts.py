"""What an inventory says of a building, and the shear building that rules derive from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.model.definition import Law, RayleighCoefficients, RayleighRatio, Story

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BuildingFacts:
    """What an inventory says of one building.

    Attributes
    ----------
    structure : str
        Structure type, such as C1.
    stories, year : int
        Number of stories, year of construction.
    area : float
        Plan area of one floor, m^2.
    height : float or None
        Height of the building, m; None where it is not said.
    zone : str
        Seismic zone of the code: Z0, Z1, Z2A, Z2B, Z3 or Z4.
    design_level : str or None
        pre, low, moderate or high; None where it follows from zone and year.
    damping_ratio : float or None
        Damping ratio; None where it follows from the type.
    mass_only : bool
        Whether the stiffness-proportional part of the damping is left out, as in programs that lose it.
    """

    structure: str
    stories: int
    year: int
    area: float
    height: float | None = None
    zone: str = "Z4"
    design_level: str | None = None
    damping_ratio: float | None = None
    mass_only: bool = False


@dataclass(frozen=True)
class Scatter:
    """Factors that a building differs by from what the rules say: on stiffness, strength unchanged, and on damping."""

    stiffness: float = 1.0
    damping: float = 1.0


@dataclass(frozen=True)
class DerivedBuilding:
    """A shear building by rules; arrays of shape (stories,), from the ground up.

    Attributes
    ----------
    design_level, type : str
        The row of the table that holds its numbers.
    rule_period : float
        Fundamental period that the stiffness is made for, without scatter, s.
    period : float
        Fundamental period of the shear building, s.
    damping_ratio : float
        Damping ratio with scatter.
    mass, height, stiffness, yield_force, ultimate_force, ultimate_drift : ndarray
        Of each story, kg, m, N/m, N, N, m.
    pinching, unloading : float
        As in the trilinear-pinching law.
    damping : RayleighRatio or RayleighCoefficients
        Damping of the building.
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
        """The stories of a model."""
        strengths = self.yield_force, self.ultimate_force, self.ultimate_drift
        columns = (self.mass, self.height, self.stiffness, *strengths)
        return tuple(
            Story(
                mass=mass,
                height=height,
                stiffness=stiffness,
                law=Law("trilinear-pinching", (strength, ultimate, drift, self.pinching, self.unloading)),
                dashpot=0.0,
            )
            for mass, height, stiffness, strength, ultimate, drift in zip(*(c.tolist() for c in columns), strict=True)
        )
