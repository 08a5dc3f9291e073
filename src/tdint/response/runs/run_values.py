"""Values of runs, for `Runs.to_dict`, runs.csv and the store of a campaign."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tdint.arrays import Array
from tdint.files import declared_rows
from tdint.response.runs.demands import DECLARED, Demands, Largest, demands_of_runs
from tdint.response.runs.outcome import StoryErrors, StoryPeaks
from tdint.units import Quantity

HIDDEN: tuple[str, ...] = ()
"""Value of `shown` for a quantity that only the store contains."""


def _drift_story(largest: Demands[Any]) -> Any:
    """Return the story of the largest drift ratio, or without heights of the largest drift."""
    ratio, drift = largest.drift_ratio.location, largest.drift.location
    return np.where(ratio > 0, ratio, drift)


_VALUES: dict[str, Callable[[Demands[Any]], Any]] = {
    "peak_drift_ratio": lambda largest: largest.drift_ratio.value,
    "peak_drift_story": _drift_story,
    "peak_drift": lambda largest: largest.drift.value,
    "peak_isolator_displacement": lambda largest: largest.isolator_displacement.value,
    "residual_drift_ratio": lambda largest: largest.residual_drift_ratio.value,
    "peak_absolute_acceleration": lambda largest: largest.peak_absolute_acceleration.value,
    "peak_acceleration_floor": lambda largest: largest.peak_absolute_acceleration.location,
    "peak_roof_displacement": lambda largest: largest.roof_displacement.value,
    "peak_base_shear": lambda largest: largest.base_shear.value,
}
"""Values of the quantities that are computed from the demands."""


def _quantity(row: dict[str, str]) -> Quantity:
    """Return the quantity of a row of `run_values.csv`."""
    return Quantity(
        row["unit"],
        row["meaning"],
        _VALUES.get(row["name"]),
        shown=HIDDEN if row["hidden"] else Quantity.shown,
        name=row["name"],
        value_type={"float": float, "int": int, "str": str}[row["type"]],
    )


RUN = tuple(map(_quantity, declared_rows(__file__)))
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
