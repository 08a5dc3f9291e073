"""Table of a cyclic test.

The result of `tdint.analysis.run.cyclic` fits the shapes told here as protocols, because imports run one way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tdint.model.definition import Model
from tdint.output.results import Array
from tdint.output.tables.tables import Cell, Table

CYCLIC_COLUMNS = (
    "story",
    "step",
    "cycle",
    "drift_m",
    "drift_ratio",
    "shear_N",
    "shear_with_p_delta_N",
    "tangent_stiffness_N_m",
    "recoverable_energy_J",
    "dissipated_energy_J",
)


class PathResult(Protocol):
    """A story's law along a path, arrays of shape (points,), SI units."""

    @property
    def drift(self) -> Array: ...
    @property
    def shear(self) -> Array: ...
    @property
    def tangent(self) -> Array: ...
    @property
    def recoverable(self) -> Array: ...
    @property
    def dissipated(self) -> Array: ...


class CycleResult(Protocol):
    """One cycle, SI units; `shear` on the positive and on the negative side."""

    @property
    def number(self) -> int: ...
    @property
    def amplitude(self) -> float: ...
    @property
    def shear(self) -> tuple[float, float]: ...
    @property
    def secant_stiffness(self) -> float: ...
    @property
    def dissipated(self) -> float: ...
    @property
    def damping_ratio(self) -> float: ...


class CyclicResult(Protocol):
    """A cyclic test of one story, SI units; nan where there is no value."""

    @property
    def model(self) -> Model: ...
    @property
    def story(self) -> int: ...
    @property
    def points(self) -> int: ...
    @property
    def law(self) -> str: ...
    @property
    def height(self) -> float: ...
    @property
    def yield_drift(self) -> float: ...
    @property
    def initial_stiffness(self) -> float: ...
    @property
    def geometric_stiffness(self) -> float: ...
    @property
    def path(self) -> PathResult: ...
    @property
    def cycle_numbers(self) -> NDArray[np.int64]: ...
    @property
    def shear_with_p_delta(self) -> Array: ...
    @property
    def cycles(self) -> Sequence[CycleResult]: ...


def cyclic_table(test: CyclicResult) -> Table:
    """One row per point of the path; row 0 is the start at rest."""
    path = test.path
    columns = (
        test.cycle_numbers,
        path.drift,
        path.drift / test.height,
        path.shear,
        test.shear_with_p_delta,
        path.tangent,
        path.recoverable,
        path.dissipated,
    )
    values = zip(*(column.tolist() for column in columns), strict=True)
    rows: list[tuple[Cell, ...]] = [(test.story, step, *row) for step, row in enumerate(values)]
    return Table(CYCLIC_COLUMNS, rows)
