"""Decrease of the error of impulse4 with the time step, in random buildings."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from random_buildings import piecewise_building
from step_checks import at_samples
from tdint.ground_motion.record import Record
from tdint.model.definition import Model

PARTS = (2, 3, 4, 6, 8, 12, 16, 24)
"""Steps per sampling interval."""
_FINE = (48, 64)  # steps per sampling interval of the reference runs
_ROUNDING = 1e-11  # smallest error that is compared, divided by the maximum displacement
_CHANGE = 1e-9  # relative change of the ground motion


@dataclass
class StudyResult:
    """Results of a random building.

    Attributes
    ----------
    building : Model
        Building.
    motion : Record
        Ground motion.
    exact : ndarray, shape (samples, stories)
        Displacements of the reference run.
    errors : list of float
        Maximum error of the displacements over the maximum displacement, for the steps of `PARTS`.
    worst : float
        Largest ratio of an error to the error with the next larger step.
    """

    building: Model
    motion: Record
    exact: np.ndarray
    errors: list[float]
    worst: float

    @cached_property
    def growth(self):
        """Factor that amplifies a small change of the motion: relative change of the displacements
        divided by the relative change of the motion."""
        changed = replace(self.motion, acceleration=self.motion.acceleration * (1.0 + _CHANGE))
        _, other = at_samples(self.building, changed, "impulse4", _FINE[0])
        return np.max(np.abs(other - self.exact)) / np.max(np.abs(self.exact)) / _CHANGE

    @property
    def chaotic(self):
        """True if the response depends on changes that are smaller than the error of any method."""
        return self.growth > 1e4


def study(seed):
    """Run the random building of a seed with all time steps and return a `StudyResult`.

    The reference is the run with 48 steps per sampling interval. The difference of the run with 64
    steps follows the errors of `PARTS` in the comparison of successive errors.
    """
    building, motion = piecewise_building(np.random.default_rng(seed))
    building = replace(building, collapse_drift=np.inf)  # the runs have equal lengths
    (_, exact), (_, finest) = (at_samples(building, motion, "impulse4", parts) for parts in _FINE)
    size = np.max(np.abs(exact))

    def error(displacement):
        # Runs of a story that fails end with its step.
        shorter = min(len(displacement), len(exact))
        return np.max(np.abs(displacement[:shorter] - exact[:shorter])) / size

    errors = [error(at_samples(building, motion, "impulse4", parts)[1]) for parts in PARTS]
    levels = np.maximum([*errors, error(finest)], _ROUNDING)
    return StudyResult(building, motion, exact, errors, float(np.max(levels[1:] / levels[:-1])))
