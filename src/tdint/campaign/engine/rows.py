"""What is kept of a run: a row of numbers, and one for each story if that is asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.demands import demands
from tdint.analysis.run.outcome import Collapse, Response, StoryPeaks
from tdint.campaign.engine.task import Run

Array = NDArray[np.float64]


class RunRow(NamedTuple):
    """A run and its demands, SI units; None or nan where there is none. In the order of the store's columns."""

    building: int
    motion: int
    scale: float
    sample: int
    dt: float
    status: str
    collapse_time: float | None = None
    collapse_story: int | None = None
    peak_drift_ratio: float | None = None
    peak_drift_story: int | None = None
    peak_drift: float | None = None
    residual_drift_ratio: float | None = None
    peak_acceleration: float | None = None
    peak_acceleration_floor: int | None = None
    peak_roof_displacement: float | None = None
    peak_base_shear: float | None = None
    energy_error: float | None = None
    steps: int | None = None
    pga: float | None = None
    sa_t1: float | None = None
    at_rest: int | None = None
    repeats: int = 0


class StoryRow(NamedTuple):
    """The peaks of a story in a run, in the order of the store's columns."""

    building: int
    motion: int
    scale: float
    sample: int
    story: int
    height: float
    peak_drift: float
    peak_drift_ratio: float
    residual_drift: float
    peak_shear: float
    ductility: float
    peak_displacement: float
    peak_velocity: float
    peak_acceleration: float


@dataclass(frozen=True)
class Intensity:
    """How strong a run's ground motion is: PGA and Sa(T1), m/s^2; None where there is no Sa(T1)."""

    pga: float
    sa_t1: float | None


@dataclass(frozen=True)
class Extremes:
    """Extremes values over the stories of many runs, shape (runs,), and their places from 1; nan and 0 for none."""

    value: Array
    place: NDArray[np.int64]

    @classmethod
    def of(cls, values: Array) -> Extremes:
        """Over the second axis; nan is passed over."""
        bare = np.where(np.isnan(values), -1.0, values)
        place = np.argmax(bare, axis=1)
        value = values[np.arange(len(values)), place]
        return cls(value, np.where(np.isnan(value), 0, place + 1))


def row_of_failure(building: int, run: Run, dt: float, status: str, measures: Intensity, repeats: int) -> RunRow:
    """The row of a run without a result."""
    return RunRow(
        building, run.motion, run.scale, run.sample, dt, status,
        pga=measures.pga, sa_t1=measures.sa_t1, repeats=repeats,
    )  # fmt: skip


def row_of_response(building: int, run: Run, response: Response, measures: Intensity, repeats: int) -> RunRow:
    """The row of a run by itself, such as one that ended with a collapse."""
    found = demands(response.stories)
    return RunRow(
        building, run.motion, run.scale, run.sample, response.dt, response.status,
        *_of_collapse(response.collapse),
        _number(found.drift_ratio.value), found.drift_ratio.place or found.drift.place, found.drift.value,
        _number(found.residual_drift_ratio.value), found.acceleration.value, found.acceleration.place,
        found.roof_displacement.value, found.base_shear.value,
        response.energy.error, response.steps, measures.pga, measures.sa_t1, None, repeats,
    )  # fmt: skip


def story_rows(building: int, run: Run, peaks: StoryPeaks) -> list[StoryRow]:
    """The rows of the stories of a run, from the ground up."""
    columns = (
        peaks.height, peaks.peak_drift, peaks.peak_drift_ratio, peaks.residual_drift, peaks.peak_shear, peaks.ductility,
        peaks.peak_displacement, peaks.peak_velocity, peaks.peak_acceleration,
    )  # fmt: skip
    cells = zip(*(column.tolist() for column in columns), strict=True)
    return [StoryRow(building, *run_key(run), story, *row) for story, row in enumerate(cells, start=1)]


def run_key(run: Run) -> tuple[int, float, int]:
    """What tells a run from the others of its building."""
    return run.motion, run.scale, run.sample


def _of_collapse(collapse: Collapse | None) -> tuple[float | None, int | None]:
    return (collapse.time, collapse.story) if collapse else (None, None)


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
