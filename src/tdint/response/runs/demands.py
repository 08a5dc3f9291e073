"""Engineering demand parameters of runs (demands), and the columns of many runs.

A demand is the maximum over the stories or floors, with the story or floor of the maximum.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, immutable
from tdint.response.runs.outcome import STORY_QUANTITIES, StoryErrors, StoryPeaks, StoryValues
from tdint.units import Quantity, quantities


class Largest(NamedTuple):
    """Maximum (`value`) and its story or floor, from 1 (`location`); nan and None if no story has a
    value.
    """

    value: float
    location: int | None


class LargestOfRuns(NamedTuple):
    """Maxima of many runs (`value`) and their stories or floors, from 1 (`location`).

    The shape of both is (runs,). They are nan and 0 if no story of a run has a value.
    """

    value: Array
    location: NDArray[np.int64]


@dataclass(frozen=True)
class Demand(Quantity):
    """Definition of a demand: how it is computed from the peaks of the stories.

    If the attribute `value` of the base class is a function, it computes the values of the stories
    from their values (peaks, or errors of peaks) and the peaks, which contain heights and
    isolators.

    Attributes
    ----------
    story : int | None
        Index of the story of the demand, from 0, or -1 for the roof; None for the maximum of all
        stories.
    location : str
        Type of location: "story" or "floor".
    story_attribute : str
        Attribute of `StoryPeaks` that is used if there is no `value`; by default the name of the
        demand.
    """

    story: int | None = None
    location: str = "story"
    story_attribute: str = ""

    @property
    def location_column(self) -> str:
        """Name of the column of the location, without unit."""
        return f"{self.called or self.name}_{self.location}"

    def of(self, stories: StoryPeaks) -> LargestOfRuns:
        """Compute the demand of each run and its location.

        Returns
        -------
        LargestOfRuns
            Demand in SI units, and story or floor from 1, shape (runs,).
        """
        values = np.atleast_2d(self._story_values(stories, stories))
        if self.story is not None:
            value = values[:, self.story]
            # The remainder converts the index -1 of the roof to n - 1.
            return LargestOfRuns(
                value, np.where(np.isnan(value), 0, self.story % values.shape[1] + 1)
            )
        # All values are positive or 0, so that -1 instead of nan is never the maximum.
        index = np.where(np.isnan(values), -1.0, values).argmax(axis=1)
        value = values[np.arange(len(values)), index]
        return LargestOfRuns(value, np.where(np.isnan(value), 0, index + 1))

    def error(self, stories: StoryPeaks, errors: StoryErrors) -> float:
        """Return the estimated error of the demand of one run, in the unit of the demand.

        With errors, the maximum may be in any story if its value plus its error is at least the
        maximum. The result is the largest error of these stories; nan if no error is known.
        """
        values, errors_of_stories = (
            self._story_values(source, stories) for source in (stories, errors)
        )
        if self.story is not None:
            return float(errors_of_stories[self.story])
        finite = np.isfinite(values) & np.isfinite(errors_of_stories)
        if not finite.any():
            return math.nan
        values, errors_of_stories = values[finite], errors_of_stories[finite]
        can_be_maximum = values + errors_of_stories >= np.max(values)
        return float(np.max(errors_of_stories[can_be_maximum]))

    def _story_values(self, source: StoryValues, stories: StoryPeaks) -> Array:
        """Return the values of the stories from peaks or their errors, shape (..., n)."""
        return np.asarray(
            self.value(source, stories)
            if self.value
            else getattr(source, self.story_attribute or self.name)
        )


MaximumT = TypeVar("MaximumT")


@immutable
class Demands(Generic[MaximumT]):
    """Demands of a run (`Largest`) or of many runs (`LargestOfRuns`), SI units."""

    roof_displacement: Annotated[
        MaximumT,
        Demand(
            "m",
            "maximum absolute displacement of the roof, relative to the ground",
            story_attribute="peak_displacement",
            story=-1,
        ),
    ]
    base_shear: Annotated[
        MaximumT,
        Demand(
            "N",
            "maximum absolute restoring force of the first story, without viscous forces",
            story_attribute="peak_shear",
            story=0,
        ),
    ]
    total_base_shear: Annotated[
        MaximumT,
        Demand(
            "N",
            "maximum absolute force between building and ground: restoring, P-delta and all "
            "viscous forces",
            story_attribute="peak_total_shear",
            story=0,
        ),
    ]
    drift: Annotated[
        MaximumT,
        Demand(
            "m",
            "largest drift of a story, relative to the floor below, without isolators",
            lambda values, stories: np.where(stories.isolator > 0.0, np.nan, values.peak_drift),
            story_attribute="peak_drift",
        ),
    ]
    isolator_displacement: Annotated[
        MaximumT,
        Demand(
            "m",
            "largest displacement of an isolator, relative to the floor below",
            lambda values, stories: np.where(stories.isolator > 0.0, values.peak_drift, np.nan),
        ),
    ]
    drift_ratio: Annotated[
        MaximumT, Demand("1", "largest drift over story height", story_attribute="peak_drift_ratio")
    ]
    residual_drift: Annotated[
        MaximumT,
        Demand(
            "m",
            "largest absolute drift at the end of the run, without isolators; empty after a "
            "collapse",
            lambda values, stories: np.where(
                stories.isolator > 0.0, np.nan, np.abs(values.residual_drift)
            ),
        ),
    ]
    residual_drift_ratio: Annotated[
        MaximumT,
        Demand(
            "1",
            "largest absolute drift at the end over story height; empty after a collapse",
            lambda values, stories: np.abs(values.residual_drift) / stories.height,
        ),
    ]
    ductility: Annotated[
        MaximumT,
        Demand("1", "largest drift over drift at first yield", story_attribute="ductility"),
    ]
    peak_absolute_acceleration: Annotated[
        MaximumT,
        Demand("m/s^2", "largest absolute acceleration of a floor", location="floor"),
    ]


DECLARED: tuple[Demand, ...] = tuple(
    demand for demand in quantities(Demands) if isinstance(demand, Demand)
)
"""Demands that are fields of `Demands`."""

_COVERED = {"peak_velocity", *(demand.story_attribute or demand.name for demand in DECLARED)}
"""Story quantities without a maximum in a summary, or included in the demands above."""

DEMANDS: tuple[Demand, ...] = (
    *DECLARED,
    *(
        Demand(quantity.unit, f"{quantity.meaning}; of all stories", name=quantity.name)
        for quantity in STORY_QUANTITIES
        if quantity.name not in _COVERED
    ),
)
"""Demands of a summary in its order: the demands above, and the maxima of the other story
quantities.
"""


def demands(stories: StoryPeaks) -> Demands[Largest]:
    """Return the demands of a single run from its peaks, shape (n,)."""
    return Demands(**{demand.name: only(demand.of(stories)) for demand in DECLARED})


def demands_of_runs(stories: StoryPeaks) -> Demands[LargestOfRuns]:
    """Return the demands of many runs of a building from peaks of shape (runs, n)."""
    return Demands(**{demand.name: demand.of(stories) for demand in DECLARED})


def only(demand: Any) -> Largest:
    """Return the only item of a `LargestOfRuns` as `Largest`; its location is `None` if it is 0."""
    return Largest(float(demand.value[0]), int(demand.location[0]) or None)
