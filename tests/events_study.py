"""How the error of impulse4 falls with the step in one random building after another."""

from dataclasses import dataclass, replace

import numpy as np

from random_buildings import piecewise_building
from tdint import run
from tdint.model.definition import Model

PARTS = (2, 3, 4, 6, 8, 12, 16, 24)
"""Steps per sampling interval."""
_FINE = (48, 64)
_ROUNDING = 1e-11  # over the largest displacement
_CHANGE = 1e-9


@dataclass
class Found:
    """What one building showed.

    Attributes
    ----------
    errors : list of float
        Largest error of a displacement over the largest displacement, at the steps of `PARTS`.
    worst : float
        Largest ratio of an error to the one before.
    growth : float
        By how much a small change of the motion is enlarged.
    """

    building: Model
    errors: list[float]
    worst: float
    growth: float

    @property
    def chaotic(self):
        """Whether the building's course hangs on less than any method gives."""
        return self.growth > 1e4


def study(seed):
    """March one random building with all steps."""
    building, motion = piecewise_building(np.random.default_rng(seed))

    def displacement(parts, record=motion):
        response = run(building, record, method="impulse4", dt=record.dt / parts, history=True)
        return response.history.displacement[::parts]

    exact, other = (displacement(parts) for parts in _FINE)
    size = np.max(np.abs(exact))
    errors = [np.max(np.abs(displacement(parts) - exact)) / size for parts in PARTS]
    changed = displacement(_FINE[0], replace(motion, acceleration=motion.acceleration * (1.0 + _CHANGE)))
    levels = np.maximum([*errors, np.max(np.abs(other - exact)) / size], _ROUNDING)
    growth = np.max(np.abs(changed - exact)) / size / _CHANGE
    return Found(building, errors, float(np.max(levels[1:] / levels[:-1])), float(growth))
