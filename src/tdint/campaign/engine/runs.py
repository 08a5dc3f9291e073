"""What is run, a building with its method under ground motions, and what is kept of it: a row of numbers for each run,
and one for each story if that is asked for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from typing import Annotated, Any, NamedTuple, Protocol

import numpy as np

from tdint.analysis.run.demands import DECLARED, Demands, DemandsOfRuns, Largest
from tdint.analysis.run.outcome import STORY, ErrorEstimate, Shock, StoryErrors, StoryPeaks, StoryValues
from tdint.analysis.run.run import Subject
from tdint.quantity import Quantity, quantities

REPEATS = 3
"""How often a run that failed is repeated, each time with half of the step before."""


@dataclass(frozen=True)
class RunSettings:
    """What is the same for all runs of a campaign.

    Attributes
    ----------
    dt, duration : float or None
        Time step and duration, s; None: those of the building's model, else those of the record.
    until_rest : bool
        Go on after that with the ground at rest until the building is (`tdint.analysis.run.case`).
    stories, profiles : bool
        Keep the peaks of every story, too: to write them, or what they are over the motions.
    check : bool
        Estimate the errors of the demands of each run, as `tdint.run` does.
    tolerance : float or None
        The step of a building is such that the estimated errors of its peak drifts are within this part of them.
    """

    dt: float | None = None
    duration: float | None = None
    until_rest: bool = False
    stories: bool = False
    tolerance: float | None = None
    profiles: bool = False
    check: bool = False

    @property
    def keeps_stories(self) -> bool:
        """Whether the peaks of stories are kept."""
        return self.stories or self.profiles


class Source(Protocol):
    """What makes a building: the building itself, or a row of an inventory with its rules."""

    def subject(self) -> Subject:
        """The building."""


class Run(NamedTuple):
    """A ground motion by its number, the factor on it, and which of a building's draws it is (0: none was drawn)."""

    motion: int
    scale: float
    sample: int = 0


class BuildingRuns(NamedTuple):
    """Runs of one building.

    Attributes
    ----------
    number : int
        Of the building in its campaign.
    source : Source
        What makes it.
    runs : tuple of Run
        The runs.
    largest : float or None
        Their largest step for a tolerance, s; None if no step is within it.
    """

    number: int
    source: Source
    runs: tuple[Run, ...]
    largest: float | None = math.inf


HIDDEN: tuple[str, ...] = ()
"""Where a quantity appears that only the store has."""


class RunRow(NamedTuple):
    """A run and its demands, SI units; None or nan where there is none.

    A field after the first four, which tell runs apart, is all there is to a column: in the store, runs.csv,
    runs.parquet. `value` takes `Demands` of many runs.
    """

    building: int
    motion: int
    scale: float
    sample: int
    dt: Annotated[float, Quantity("s", "time step, after repetitions with finer ones")]
    status: Annotated[str, Quantity("text", "how the run ended")]
    collapse_time: Annotated[float | None, Quantity("s", "time of the collapse")] = None
    collapse_story: Annotated[int | None, Quantity("1", "story that collapsed first")] = None
    peak_drift_ratio: Annotated[
        float | None, Quantity("1", "largest peak drift over story height", lambda found: found.drift_ratio.value)
    ] = None
    peak_drift_story: Annotated[
        int | None,
        Quantity(
            "1",
            "story that has it; without heights that of the largest drift",
            lambda found: np.where(found.drift_ratio.place > 0, found.drift_ratio.place, found.drift.place),
        ),
    ] = None
    peak_drift: Annotated[
        float | None, Quantity("m", "largest peak drift, of any story", lambda found: found.drift.value)
    ] = None
    residual_drift_ratio: Annotated[
        float | None,
        Quantity(
            "1",
            "largest drift over story height at the end of the run",
            lambda found: found.residual_drift_ratio.value,
        ),
    ] = None
    peak_acceleration: Annotated[
        float | None,
        Quantity(
            "m/s^2",
            "largest absolute acceleration of a floor",
            lambda found: found.acceleration.value,
            called="peak_absolute_acceleration",
        ),
    ] = None
    peak_acceleration_floor: Annotated[
        int | None, Quantity("1", "floor that has it", lambda found: found.acceleration.place)
    ] = None
    peak_roof_displacement: Annotated[
        float | None, Quantity("m", "largest displacement of the roof", lambda found: found.roof_displacement.value)
    ] = None
    peak_base_shear: Annotated[
        float | None, Quantity("N", "largest restoring force of the first story", lambda found: found.base_shear.value)
    ] = None
    energy_error: Annotated[float | None, Quantity("1", "imbalance over the largest input energy")] = None
    steps: Annotated[int | None, Quantity("1", "time steps")] = None
    pga: Annotated[float | None, Quantity("m/s^2", "peak ground acceleration, scaled")] = None
    sa_t1: Annotated[
        float | None,
        Quantity("m/s^2", "pseudo-acceleration at the building's first period, 5 % damping, scaled"),
    ] = None
    at_rest: Annotated[int | None, Quantity("1", "whether it came to rest before its last time", shown=HIDDEN)] = None
    repeats: Annotated[int, Quantity("1", "how often it was repeated with half of the step", shown=HIDDEN)] = 0
    errors: tuple[float | None, ...] = ()
    corrected: tuple[float | None, ...] = ()


RUN = quantities(RunRow)
"""The quantities of a run, in the order of their columns."""


DEMANDED = tuple(one for one in RUN if one.value)
"""Those of them that follow from its demands."""

RUN_WITH_ERROR = tuple(one for one in DEMANDED if one.kind is float)
"""Those whose errors `RunRow.errors` are, where these were estimated; `RunRow.corrected` are they themselves, corrected
by the error that the run has carried along."""


class ShockRow(NamedTuple):
    """The values of a shock in a run of several, those of `DEMANDED` in their order; from 1, with the time (s) of its
    first sample and its peak ground acceleration (m/s^2)."""

    building: int
    motion: int
    scale: float
    sample: int
    shock: int
    start: float
    pga: float
    values: tuple[Any, ...]


class StoryRow(NamedTuple):
    """The values of a story in a run, those of `STORY` in their order, their errors where these were estimated, and
    the corrected ones where there are such."""

    building: int
    motion: int
    scale: float
    sample: int
    story: int
    height: float
    values: tuple[float, ...]
    errors: tuple[float, ...] = ()
    corrected: tuple[float, ...] = ()

    def of(self, name: str) -> float:
        """The value of a quantity."""
        return self.values[[one.name for one in STORY].index(name)]


@dataclass
class Rows:
    """The rows of some runs; those of stories only if they are asked for."""

    runs: list[RunRow] = field(default_factory=list)
    stories: list[StoryRow] = field(default_factory=list)
    shocks: list[ShockRow] = field(default_factory=list)

    def extend(self, others: Rows) -> None:
        """Take in other rows."""
        self.runs += others.runs
        self.stories += others.stories
        self.shocks += others.shocks


def demand_cells(stories: StoryPeaks) -> list[dict[str, Any]]:
    """Of each run, whose peaks have the shape (runs, n), the fields of `RunRow` that follow from its demands."""
    found = DemandsOfRuns(stories)
    columns = {one.name: one.value(found).tolist() for one in DEMANDED if one.value}
    return [dict(zip(columns, cells, strict=True)) for cells in zip(*columns.values(), strict=True)]


def demand_errors(stories: StoryPeaks, errors: StoryErrors) -> tuple[float, ...]:
    """The estimated errors of the demands of a run, in the order of `RUN_WITH_ERROR`."""
    found = Demands(**{one.name: Largest(one.error(stories, errors), None) for one in DECLARED})
    return tuple(float(one.value(found)) for one in RUN_WITH_ERROR if one.value)


def demand_values(stories: StoryPeaks) -> tuple[float, ...]:
    """The demands of a run that have errors, in the order of `RUN_WITH_ERROR`."""
    (cells,) = demand_cells(stories)
    return tuple(cells[one.name] for one in RUN_WITH_ERROR)


def story_rows(building: int, run: Run, stories: StoryPeaks, check: ErrorEstimate | None = None) -> list[StoryRow]:
    """The rows of the stories of a run, from the ground up."""
    told = (check.errors, check.corrected) if check else (None, None)
    cells = zip(stories.height.tolist(), *map(_by_story, (stories, *told)), strict=False)
    return [StoryRow(building, *run, story, *row) for story, row in enumerate(cells, start=1)]


def _by_story(found: StoryValues | None) -> Iterable[tuple[float, ...]]:
    return zip(*(getattr(found, one.name).tolist() for one in STORY), strict=True) if found else repeat(())


def shock_rows(building: int, run: Run, shocks: Sequence[Shock]) -> list[ShockRow]:
    """The rows of the shocks of a run, in their order."""
    return [
        ShockRow(building, *run, number, shock.start, shock.record.pga, tuple(cells.values()))
        for number, shock in enumerate(shocks, start=1)
        for cells in demand_cells(shock.stories)
    ]
