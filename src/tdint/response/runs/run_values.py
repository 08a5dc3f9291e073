"""Values of runs, for `Runs.to_dict`, runs.csv and the store of a campaign."""

from operator import attrgetter
from typing import Any

import numpy as np

from tdint.arrays import Array
from tdint.response.runs.demands import DECLARED, Demands, Largest, demands_of_runs
from tdint.response.runs.outcome import StoryErrors, StoryPeaks
from tdint.units import Quantity

HIDDEN: tuple[str, ...] = ()
"""Value of `shown` for a quantity that only the store contains."""

RUN = (
    Quantity("s", "time step, after repetitions with finer ones", name="dt"),
    Quantity("text", "how the run ended", name="status", value_type=str),
    Quantity("s", "time of the collapse", name="collapse_time"),
    Quantity("1", "story that collapsed first", name="collapse_story", value_type=int),
    Quantity(
        *("1", "largest peak drift over story height", attrgetter("drift_ratio.value")),
        name="peak_drift_ratio",
    ),
    Quantity(
        "1",
        "story that has it; without heights that of the largest drift",
        lambda largest: np.where(
            largest.drift_ratio.location > 0, largest.drift_ratio.location, largest.drift.location
        ),
        name="peak_drift_story",
        value_type=int,
    ),
    Quantity(
        *("m", "largest peak drift of a story, without isolators", attrgetter("drift.value")),
        name="peak_drift",
    ),
    Quantity(
        "m",
        "largest displacement of an isolator; empty without isolators",
        attrgetter("isolator_displacement.value"),
        name="peak_isolator_displacement",
    ),
    Quantity(
        "1",
        "largest drift over story height at the end of the run; empty after a collapse",
        attrgetter("residual_drift_ratio.value"),
        name="residual_drift_ratio",
    ),
    Quantity(
        *("m/s^2", "largest absolute acceleration of a floor", attrgetter("acceleration.value")),
        name="peak_absolute_acceleration",
    ),
    Quantity(
        *("1", "floor that has it", attrgetter("acceleration.location")),
        name="peak_acceleration_floor",
        value_type=int,
    ),
    Quantity(
        *("m", "largest displacement of the roof", attrgetter("roof_displacement.value")),
        name="peak_roof_displacement",
    ),
    Quantity(
        *("N", "largest restoring force of the first story", attrgetter("base_shear.value")),
        name="peak_base_shear",
    ),
    Quantity("1", "imbalance over the largest input energy", name="energy_error"),
    Quantity("1", "time steps", name="steps", value_type=int),
    Quantity("m/s^2", "peak ground acceleration, scaled", name="pga"),
    Quantity(
        "m/s^2",
        "pseudo-acceleration at the building's first period, 5 % damping, scaled",
        name="sa_t1",
    ),
    Quantity(
        "1",
        "1 if the run came to rest, if this was requested",
        shown=HIDDEN,
        name="at_rest",
        value_type=int,
    ),
    Quantity(
        "1",
        "number of repetitions with half the time step",
        shown=HIDDEN,
        name="repeats",
        value_type=int,
    ),
)
"""Quantities of a run in the order of their columns, arrays of shape (runs,), SI units: results of
many runs, the rows of a store and its tables. A `value` is computed from the `Demands` of the
runs."""

DEMANDED = tuple(quantity for quantity in RUN if quantity.value)
"""Quantities that are computed from the demands."""

RUN_WITH_ERROR = tuple(quantity for quantity in DEMANDED if quantity.value_type is float)
"""Quantities with error estimates."""


def demand_columns(stories: StoryPeaks) -> dict[str, Array]:
    """Return the columns of `RUN` that are computed from the demands."""
    largest = demands_of_runs(stories)
    return {quantity.name: quantity.value(largest) for quantity in DEMANDED if quantity.value}


def demand_errors(stories: StoryPeaks, errors: StoryErrors) -> tuple[float, ...]:
    """Return the estimated errors of the demands of a run, in the order of `RUN_WITH_ERROR`.

    Parameters
    ----------
    stories, errors : StoryPeaks, StoryErrors
        Peaks of the run, shape (n,), and their estimated errors.
    """
    # The columns of `RUN` read their values from demands. Here the demands are their errors.
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
