"""Values of runs, for `Runs.to_dict`, runs.csv and the store of a campaign."""

from operator import attrgetter
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.response.runs.demands import DECLARED, Demands, Largest, demands_of_runs
from tdint.response.runs.outcome import StoryErrors, StoryPeaks
from tdint.units import Quantity, quantities

HIDDEN: tuple[str, ...] = ()
"""Value of `shown` for a quantity that only the store contains."""

Counts = NDArray[np.int64]


class RunValues:
    """Columns of many runs, arrays of shape (runs,), SI units.

    The results of many runs, the rows of a store and its tables use these columns. A field defines
    a column completely. Its `value` is computed from the `Demands` of the runs.
    """

    dt: Annotated[Array, Quantity("s", "time step, after repetitions with finer ones")]
    status: Annotated[NDArray[np.str_], Quantity("text", "how the run ended", value_type=str)]
    collapse_time: Annotated[Array, Quantity("s", "time of the collapse")]
    collapse_story: Annotated[Counts, Quantity("1", "story that collapsed first", value_type=int)]
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
                largest.drift_ratio.location > 0,
                largest.drift_ratio.location,
                largest.drift.location,
            ),
            value_type=int,
        ),
    ]
    peak_drift: Annotated[
        Array,
        Quantity(
            "m", "largest peak drift of a story, without isolators", attrgetter("drift.value")
        ),
    ]
    peak_isolator_displacement: Annotated[
        Array,
        Quantity(
            "m",
            "largest displacement of an isolator; empty without isolators",
            attrgetter("isolator_displacement.value"),
        ),
    ]
    residual_drift_ratio: Annotated[
        Array,
        Quantity(
            "1",
            "largest drift over story height at the end of the run; empty after a collapse",
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
        Counts,
        Quantity("1", "floor that has it", attrgetter("acceleration.location"), value_type=int),
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
    steps: Annotated[Counts, Quantity("1", "time steps", value_type=int)]
    pga: Annotated[Array, Quantity("m/s^2", "peak ground acceleration, scaled")]
    sa_t1: Annotated[
        Array,
        Quantity(
            "m/s^2", "pseudo-acceleration at the building's first period, 5 % damping, scaled"
        ),
    ]
    at_rest: Annotated[
        Counts,
        Quantity(
            "1", "1 if the run came to rest, if this was requested", shown=HIDDEN, value_type=int
        ),
    ]
    repeats: Annotated[
        Counts,
        Quantity(
            "1", "number of repetitions with half the time step", shown=HIDDEN, value_type=int
        ),
    ]


RUN = quantities(RunValues)
"""Quantities of a run, in the order of their columns."""

DEMANDED = tuple(quantity for quantity in RUN if quantity.value)
"""Quantities that are computed from the demands."""

RUN_WITH_ERROR = tuple(quantity for quantity in DEMANDED if quantity.value_type is float)
"""Quantities with error estimates."""


def demand_columns(stories: StoryPeaks) -> dict[str, Array]:
    """Return the columns of `RunValues` that are computed from the demands."""
    largest = demands_of_runs(stories)
    return {quantity.name: quantity.value(largest) for quantity in DEMANDED if quantity.value}


def demand_errors(stories: StoryPeaks, errors: StoryErrors) -> tuple[float, ...]:
    """Return the estimated errors of the demands of a run, in the order of `RUN_WITH_ERROR`.

    Parameters
    ----------
    stories, errors : StoryPeaks, StoryErrors
        Peaks of the run, shape (n,), and their estimated errors.
    """
    # The columns of `RunValues` read their values from demands. Here the demands are their errors.
    largest = Demands(
        **{demand.name: Largest(demand.error(stories, errors), None) for demand in DECLARED}
    )
    return tuple(float(quantity.value(largest)) for quantity in RUN_WITH_ERROR if quantity.value)


def demand_cells(stories: StoryPeaks) -> list[dict[str, Any]]:
    """Return the demands of several runs: one dictionary per run, from the name of a demand, such
    as `peak_drift_ratio`, to its value.

    `stories` contains the peak responses of all stories, in arrays of shape (runs, stories).
    """
    columns = {name: column.tolist() for name, column in demand_columns(stories).items()}
    return [
        dict(zip(columns, run_values, strict=True))
        for run_values in zip(*columns.values(), strict=True)
    ]
