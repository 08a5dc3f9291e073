"""Demand parameters of a run: the largest of each kind in the building, and the story or floor that has it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.outcome import StoryErrors, StoryPeaks

Array = NDArray[np.float64]


class Largest(NamedTuple):
    """A largest value, and its story or floor from 1; nan and None where no story has one."""

    value: float
    place: int | None

    @classmethod
    def of(cls, values: Array) -> Largest:
        """The largest of some values over the stories, shape (n,); nan is passed over."""
        if np.all(np.isnan(values)):
            return cls(math.nan, None)
        i = int(np.nanargmax(values))
        return cls(float(values[i]), i + 1)


@dataclass(frozen=True)
class Demands:
    """The largest demands of a run, SI units.

    Attributes
    ----------
    roof_displacement : Largest
        Of the roof relative to the ground, m.
    base_shear : Largest
        Restoring force of the first story, N.
    drift, drift_ratio : Largest
        Peak drift, m, and over the story's height.
    residual_drift, residual_drift_ratio : Largest
        Absolute drift at the end of the run, m, and over the story's height.
    ductility : Largest
        Peak drift over drift at first yield.
    acceleration : Largest
        Absolute acceleration of a floor, m/s^2.
    """

    roof_displacement: Largest
    base_shear: Largest
    drift: Largest
    drift_ratio: Largest
    residual_drift: Largest
    residual_drift_ratio: Largest
    ductility: Largest
    acceleration: Largest


DEMANDS = tuple(field.name for field in fields(Demands))


def demands(stories: StoryPeaks) -> Demands:
    """The largest demands in the building."""
    residual = np.abs(stories.residual_drift)
    return Demands(
        roof_displacement=Largest(float(stories.peak_displacement[-1]), stories.peak_displacement.size),
        base_shear=Largest(float(stories.peak_shear[0]), 1),
        drift=Largest.of(stories.peak_drift),
        drift_ratio=Largest.of(stories.peak_drift_ratio),
        residual_drift=Largest.of(residual),
        residual_drift_ratio=Largest.of(residual / stories.height),
        ductility=Largest.of(stories.ductility),
        acceleration=Largest.of(stories.peak_acceleration),
    )


def demand_errors(stories: StoryPeaks, errors: StoryErrors) -> dict[str, float]:
    """Estimated errors of the demands, by their names, in their units; nan where there is none.

    Any story may have the largest value that could with its error: the largest error among those.
    """
    residual = np.abs(stories.residual_drift)
    return {
        "roof_displacement": float(errors.peak_displacement[-1]),
        "base_shear": float(errors.peak_shear[0]),
        "drift": _error_of_largest(stories.peak_drift, errors.peak_drift),
        "drift_ratio": _error_of_largest(stories.peak_drift_ratio, errors.peak_drift_ratio),
        "residual_drift": _error_of_largest(residual, errors.residual_drift),
        "residual_drift_ratio": _error_of_largest(residual / stories.height, errors.residual_drift / stories.height),
        "ductility": _error_of_largest(stories.ductility, errors.ductility),
        "acceleration": _error_of_largest(stories.peak_acceleration, errors.peak_acceleration),
    }


def _error_of_largest(values: Array, errors: Array) -> float:
    known = np.isfinite(values) & np.isfinite(errors)
    if not known.any():
        return math.nan
    values, errors = values[known], errors[known]
    return float(np.max(errors[values + errors >= np.max(values)]))
