"""Engineering demand parameters of a run, demands for short: the largest of each kind, and the story or floor of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.outcome import STORY, StoryErrors, StoryPeaks, StoryValues
from tdint.arrays import Array
from tdint.quantity import Quantity, quantities


class Largest(NamedTuple):
    """A largest value, and its story or floor from 1; nan and None where no story has one."""

    value: float
    place: int | None


class LargestOfRuns(NamedTuple):
    """Largest values of many runs and their stories or floors from 1, shape (runs,); nan and 0 where there is none."""

    value: Array
    place: NDArray[np.int64]


@dataclass(frozen=True)
class Demand(Quantity):
    """A demand, as the annotation of its field; `value` gives the numbers of the stories from their values and heights.

    Attributes
    ----------
    story : int or None
        The one whose number is meant, as an index; None for the largest of all.
    place : str
        What a place is: story or floor.
    of_stories : str
        In place of a `value`: the quantity of the stories that it is the largest of; its own name by default.
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
        values = np.atleast_2d(self.values(stories))
        if self.story is not None:
            value = values[:, self.story]
            return LargestOfRuns(value, np.where(np.isnan(value), 0, self.story % values.shape[1] + 1))
        place = np.where(np.isnan(values), -1.0, values).argmax(axis=1)
        value = values[np.arange(len(values)), place]
        return LargestOfRuns(value, np.where(np.isnan(value), 0, place + 1))

    def error(self, stories: StoryPeaks, errors: StoryErrors) -> float:
        """Its estimated error in a run; nan where there is none.

        Any story may have the largest value that could with its error: the largest error among those.
        """
        values, own = self.values(stories), self._of(errors, stories.height)
        if self.story is not None:
            return float(own[self.story])
        known = np.isfinite(values) & np.isfinite(own)
        if not known.any():
            return math.nan
        values, own = values[known], own[known]
        return float(np.max(own[values + own >= np.max(values)]))

    def values(self, stories: StoryPeaks) -> Array:
        """The numbers of the stories, shape (..., n)."""
        return self._of(stories, stories.height)

    def _of(self, given: StoryValues, height: Array) -> Array:
        return np.asarray(self.value(given, height) if self.value else getattr(given, self.of_stories or self.name))


Found = TypeVar("Found")


@dataclass(frozen=True)
class Demands(Generic[Found]):
    """The largest demands of a run (`Largest`), or of many (`LargestOfRuns`), SI units."""

    roof_displacement: Annotated[
        Found,
        Demand(
            "m", "largest displacement of the roof, relative to the ground", of_stories="peak_displacement", story=-1
        ),
    ]
    base_shear: Annotated[
        Found,
        Demand(
            "N", "largest restoring force of the first story, without viscous forces", of_stories="peak_shear", story=0
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
        Found, Demand("m", "largest drift of a story, relative to the floor below", of_stories="peak_drift")
    ]
    drift_ratio: Annotated[Found, Demand("1", "largest drift over story height", of_stories="peak_drift_ratio")]
    residual_drift: Annotated[
        Found,
        Demand(
            "m", "largest absolute drift at the end of the run", lambda stories, height: np.abs(stories.residual_drift)
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
    ductility: Annotated[Found, Demand("1", "largest drift over drift at first yield", of_stories="ductility")]
    acceleration: Annotated[
        Found,
        Demand(
            "m/s^2",
            "largest absolute acceleration of a floor",
            of_stories="peak_acceleration",
            called="floor_absolute_acceleration",
            place="floor",
        ),
    ]


DECLARED: tuple[Demand, ...] = tuple(one for one in quantities(Demands) if isinstance(one, Demand))
"""The demands of `Demands`."""


def _further() -> Iterator[Demand]:
    """The largest of what stories have and no demand above is made of."""
    for one in STORY:
        if "summary" in one.shown:
            yield Demand(one.unit, f"{one.meaning}; of all stories", called=one.called, name=one.name)


DEMANDS: tuple[Demand, ...] = (*DECLARED, *_further())
"""What a summary tells of a run, in its order."""


def demands(stories: StoryPeaks) -> Demands[Largest]:
    """The largest demands in the building."""
    return Demands(**{one.name: only(one.of(stories)) for one in DECLARED})


class DemandsOfRuns:
    """`Demands` of many runs of a building, peaks of shape (runs, n): each is found when it is asked for."""

    def __init__(self, stories: StoryPeaks) -> None:
        self._stories = stories

    def __getattr__(self, name: str) -> LargestOfRuns:
        for one in DECLARED:
            if one.name == name:
                setattr(self, name, found := one.of(self._stories))
                return found
        raise AttributeError(name)


def only(found: Any) -> Largest:
    """The one run's."""
    return Largest(float(found.value[0]), int(found.place[0]) or None)
