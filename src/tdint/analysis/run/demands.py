"""Engineering demand parameters of runs, demands for short: the largest of each kind, and the story
or floor of it; and the values of many runs, of which columns are made."""

from __future__ import annotations

import math
from dataclasses import dataclass
from operator import attrgetter
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.outcome import STORY, StoryErrors, StoryPeaks, StoryValues
from tdint.arrays import Array
from tdint.units import Quantity, quantities


class Largest(NamedTuple):
    """A largest value, and its story or floor from 1; nan and None where no story has one."""

    value: float
    place: int | None


class LargestOfRuns(NamedTuple):
    """Largest values of many runs and their stories or floors from 1, shape (runs,); nan and 0
    where there is none."""

    value: Array
    place: NDArray[np.int64]


@dataclass(frozen=True)
class Demand(Quantity):
    """A demand, as the annotation of its field; `value` gives the numbers of the stories from their
    values and heights.

    Attributes
    ----------
    story : int or None
        The one whose number is meant, as an index; None for the largest of all.
    place : str
        What a place is: story or floor.
    of_stories : str
        In place of a `value`: the quantity of the stories that it is the largest of; its own name
        by default.
    """

    story: int | None = None
    place: str = "story"
    of_stories: str = ""

    @property
    def of_place(self) -> str:
        """The name of its place: that of the number, without its unit."""
        return f"{self.called or self.name}_{self.place}"

    def of(self, stories: StoryPeaks) -> LargestOfRuns:
        """The largest of each run, from peaks of shape (runs, n) or (n,); nan is passed over."""
        values = np.atleast_2d(self._of(stories, stories.height))
        if self.story is not None:
            value = values[:, self.story]
            return LargestOfRuns(
                value, np.where(np.isnan(value), 0, self.story % values.shape[1] + 1)
            )
        place = np.where(np.isnan(values), -1.0, values).argmax(axis=1)
        value = values[np.arange(len(values)), place]
        return LargestOfRuns(value, np.where(np.isnan(value), 0, place + 1))

    def error(self, stories: StoryPeaks, errors: StoryErrors) -> float:
        """Its estimated error in a run; nan where there is none.

        Any story may have the largest value that could with its error: the largest error among
        those.
        """
        values, off = (self._of(given, stories.height) for given in (stories, errors))
        if self.story is not None:
            return float(off[self.story])
        finite = np.isfinite(values) & np.isfinite(off)
        if not finite.any():
            return math.nan
        values, off = values[finite], off[finite]
        return float(np.max(off[values + off >= np.max(values)]))

    def _of(self, given: StoryValues, height: Array) -> Array:
        """The numbers of the stories, shape (..., n)."""
        return np.asarray(
            self.value(given, height)
            if self.value
            else getattr(given, self.of_stories or self.name)
        )


Found = TypeVar("Found")


@dataclass(frozen=True)
class Demands(Generic[Found]):
    """The largest demands of a run (`Largest`), or of many (`LargestOfRuns`), SI units."""

    roof_displacement: Annotated[
        Found,
        Demand(
            "m",
            "largest displacement of the roof, relative to the ground",
            of_stories="peak_displacement",
            story=-1,
        ),
    ]
    base_shear: Annotated[
        Found,
        Demand(
            "N",
            "largest restoring force of the first story, without viscous forces",
            of_stories="peak_shear",
            story=0,
        ),
    ]
    total_base_shear: Annotated[
        Found,
        Demand(
            "N",
            "largest force between building and ground: restoring, P-delta and all viscous forces",
            of_stories="peak_total_shear",
            story=0,
        ),
    ]
    drift: Annotated[
        Found,
        Demand(
            "m", "largest drift of a story, relative to the floor below", of_stories="peak_drift"
        ),
    ]
    drift_ratio: Annotated[
        Found, Demand("1", "largest drift over story height", of_stories="peak_drift_ratio")
    ]
    residual_drift: Annotated[
        Found,
        Demand(
            "m",
            "largest absolute drift at the end of the run",
            lambda stories, height: np.abs(stories.residual_drift),
        ),
    ]
    residual_drift_ratio: Annotated[
        Found,
        Demand(
            "1",
            "largest absolute drift at the end over story height",
            lambda stories, height: np.abs(stories.residual_drift) / height,
        ),
    ]
    ductility: Annotated[
        Found, Demand("1", "largest drift over drift at first yield", of_stories="ductility")
    ]
    acceleration: Annotated[
        Found,
        Demand(
            "m/s^2",
            "largest absolute acceleration of a floor",
            of_stories="peak_absolute_acceleration",
            called="floor_absolute_acceleration",
            place="floor",
        ),
    ]


DECLARED: tuple[Demand, ...] = tuple(
    demand for demand in quantities(Demands) if isinstance(demand, Demand)
)
"""The demands of `Demands`."""

_SAID = frozenset(
    (
        "peak_drift",
        "peak_drift_ratio",
        "residual_drift",
        "peak_shear",
        "peak_total_shear",
        "ductility",
        "peak_displacement",
        "peak_velocity",
        "peak_absolute_acceleration",
    )
)
"""Quantities of a story that the demands above are made of, or say better."""

DEMANDS: tuple[Demand, ...] = (
    *DECLARED,
    *(
        Demand(quantity.unit, f"{quantity.meaning}; of all stories", name=quantity.name)
        for quantity in STORY
        if quantity.name not in _SAID
    ),
)
"""What a summary tells of a run, in its order: the demands above, and the largest of what they are
not made of."""


def demands(stories: StoryPeaks) -> Demands[Largest]:
    """The largest demands in the building."""
    return Demands(**{demand.name: only(demand.of(stories)) for demand in DECLARED})


def demands_of_runs(stories: StoryPeaks) -> Demands[LargestOfRuns]:
    """The largest demands of many runs of a building, peaks of shape (runs, n)."""
    return Demands(**{demand.name: demand.of(stories) for demand in DECLARED})


def only(demand: Any) -> Largest:
    """The one run's."""
    return Largest(float(demand.value[0]), int(demand.place[0]) or None)


# ---- Values of runs, as `Runs.to_dict`, runs.csv and the store of a campaign have them

HIDDEN: tuple[str, ...] = ()
"""Where a quantity of a run appears that only the store has."""

Counts = NDArray[np.int64]


@dataclass(frozen=True)
class RunValues:
    """What runs come to, arrays of shape (runs,), SI units: the columns of which a result of many
    runs, a row of a store and its tables have theirs.

    A field is all there is to a column. Its `value` follows from the `Demands` of the runs.
    """

    dt: Annotated[Array, Quantity("s", "time step, after repetitions with finer ones")]
    status: Annotated[NDArray[np.str_], Quantity("text", "how the run ended", kind=str)]
    collapse_time: Annotated[Array, Quantity("s", "time of the collapse")]
    collapse_story: Annotated[Counts, Quantity("1", "story that collapsed first", kind=int)]
    peak_drift_ratio: Annotated[
        Array,
        Quantity("1", "largest peak drift over story height", attrgetter("drift_ratio.value")),
    ]
    peak_drift_story: Annotated[
        Counts,
        Quantity(
            "1",
            "story that has it; without heights that of the largest drift",
            lambda largest: np.where(
                largest.drift_ratio.place > 0, largest.drift_ratio.place, largest.drift.place
            ),
            kind=int,
        ),
    ]
    peak_drift: Annotated[
        Array, Quantity("m", "largest peak drift, of any story", attrgetter("drift.value"))
    ]
    residual_drift_ratio: Annotated[
        Array,
        Quantity(
            "1",
            "largest drift over story height at the end of the run",
            attrgetter("residual_drift_ratio.value"),
        ),
    ]
    peak_absolute_acceleration: Annotated[
        Array,
        Quantity(
            "m/s^2",
            "largest absolute acceleration of a floor",
            attrgetter("acceleration.value"),
        ),
    ]
    peak_acceleration_floor: Annotated[
        Counts, Quantity("1", "floor that has it", attrgetter("acceleration.place"), kind=int)
    ]
    peak_roof_displacement: Annotated[
        Array,
        Quantity("m", "largest displacement of the roof", attrgetter("roof_displacement.value")),
    ]
    peak_base_shear: Annotated[
        Array,
        Quantity("N", "largest restoring force of the first story", attrgetter("base_shear.value")),
    ]
    energy_error: Annotated[Array, Quantity("1", "imbalance over the largest input energy")]
    steps: Annotated[Counts, Quantity("1", "time steps", kind=int)]
    pga: Annotated[Array, Quantity("m/s^2", "peak ground acceleration, scaled")]
    sa_t1: Annotated[
        Array,
        Quantity(
            "m/s^2", "pseudo-acceleration at the building's first period, 5 % damping, scaled"
        ),
    ]
    at_rest: Annotated[
        Counts,
        Quantity("1", "whether it came to rest, where that was waited for", shown=HIDDEN, kind=int),
    ]
    repeats: Annotated[
        Counts,
        Quantity("1", "how often it was repeated with half of the step", shown=HIDDEN, kind=int),
    ]


RUN = quantities(RunValues)
"""The quantities of a run, in the order of their columns."""

DEMANDED = tuple(quantity for quantity in RUN if quantity.value)
"""Those of them that follow from its demands."""

RUN_WITH_ERROR = tuple(quantity for quantity in DEMANDED if quantity.kind is float)
"""Those of them whose errors can be estimated."""


def demand_columns(stories: StoryPeaks) -> dict[str, Array]:
    """The fields of `RunValues` that follow from the demands of runs with these peaks, shape (runs,
    n)."""
    largest = demands_of_runs(stories)
    return {quantity.name: quantity.value(largest) for quantity in DEMANDED if quantity.value}


def demand_errors(stories: StoryPeaks, errors: StoryErrors) -> tuple[float, ...]:
    """The estimated errors of the demands of a run, in the order of `RUN_WITH_ERROR`."""
    largest = Demands(
        **{demand.name: Largest(demand.error(stories, errors), None) for demand in DECLARED}
    )
    return tuple(float(quantity.value(largest)) for quantity in RUN_WITH_ERROR if quantity.value)
