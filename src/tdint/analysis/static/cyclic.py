"""Cyclic test of a story: its drift law along cycles of given amplitudes. The work behind `tdint law`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import drift_of
from tdint.arrays import Array
from tdint.csv_table import read_table
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as at
from tdint.kernels.laws.compiled_separately import spring_table
from tdint.kernels.stories.cyclic import DISSIPATION, RECOVERABLE, RESULT_COLUMNS, SHEAR, TANGENT, follow
from tdint.model.building import Building, assemble, variant
from tdint.model.config.model_file import model_of
from tdint.model.definition import Model
from tdint.tabular import Tabular
from tdint.units import DriftSize
from tdint.written_numbers import how_many

MOST_POINTS = 2_000_000
"""Points that a test may have; it keeps a slip in the number of cycles from filling the memory."""

_ROUNDING = 1e-13
"""Energy of an elastic cycle over the energy stored in it."""


@dataclass(frozen=True)
class LawPath:
    """A story's law along a path of drifts; arrays of shape (points,).

    Attributes
    ----------
    drift, shear : ndarray
        Drift, m, and restoring force of the story, N, without dashpots, damping and P-delta.
    tangent : ndarray
        Tangent stiffness of the law on the way to the point, N/m.
    recoverable, dissipated : ndarray
        Energy that the law stores, and that it has dissipated so far, J.
    """

    drift: Array
    shear: Array
    tangent: Array
    recoverable: Array
    dissipated: Array


@dataclass(frozen=True)
class Cycle:
    """One cycle of a test.

    Attributes
    ----------
    number : int
        Counted from 1 over the whole test.
    amplitude : float
        Largest drift on either side, m.
    shear : tuple of float
        Restoring force at the largest drift on the positive and on the negative side, N.
    dissipated : float
        Energy dissipated in the cycle, J.
    """

    number: int
    amplitude: float
    shear: tuple[float, float]
    dissipated: float

    @property
    def secant_stiffness(self) -> float:
        """Slope between the two points of largest drift, N/m (the effective stiffness of ASCE 7-16, 17.2-3)."""
        return (self.shear[0] - self.shear[1]) / (2.0 * self.amplitude)

    @property
    def damping_ratio(self) -> float:
        """Equivalent viscous damping ratio E_D / (4 pi E_S0), E_S0 = secant stiffness amplitude^2 / 2 (Chopra 2012,
        section 3.9); nan without a positive secant stiffness."""
        strain = 0.5 * self.secant_stiffness * self.amplitude**2
        return self.dissipated / (4.0 * math.pi * strain) if strain > 0.0 else math.nan


@dataclass(frozen=True, repr=False)
class CyclicTest(Tabular):
    """Result of a cyclic test.

    Attributes
    ----------
    model : Model
        The building.
    story : int
        The story, counted from 1.
    points : int or None
        Points of a quarter of a cycle; None for a path that is not made of cycles.
    initial_stiffness, geometric_stiffness : float
        Of the law, and of P-delta (0 without, else negative), N/m.
    yield_drift : float
        Drift at first yield, m; nan for a law that does not yield.
    path : LawPath
        From rest through all cycles, of which `cycle_numbers` tells that of each point; or the path given.
    """

    model: Model
    story: int
    points: int | None
    initial_stiffness: float
    geometric_stiffness: float
    yield_drift: float
    path: LawPath

    def _headline(self) -> str:
        return f"of {self.model.name!r}, story {self.story}, {self.law} law, {how_many(self.path.drift.size, 'point')}"

    @property
    def height(self) -> float:
        """Story height, m; nan where the model gives none."""
        height = self.model.stories[self.story - 1].drift_height
        return math.nan if height is None else height

    @property
    def law(self) -> str:
        """Name of the drift law."""
        return self.model.stories[self.story - 1].law.name

    @property
    def cycle_numbers(self) -> NDArray[np.int64] | None:
        """Cycle of each point, from 1; 0 for the start. None for a path that is not made of cycles."""
        if self.points is None:
            return None
        return -(-np.arange(self.path.drift.size) // (4 * self.points))

    @property
    def shear_with_p_delta(self) -> Array:
        """Restoring force with the geometric stiffness, N: what holds the story against a horizontal force."""
        return self.path.shear + self.geometric_stiffness * self.path.drift

    @property
    def cycles(self) -> tuple[Cycle, ...]:
        """The cycles one by one."""
        if self.points is None:
            return ()
        length = 4 * self.points
        return tuple(self._cycle(first, length) for first in range(0, self.path.drift.size - 1, length))

    def _cycle(self, first: int, length: int) -> Cycle:
        high, low, last = first + length // 4, first + 3 * length // 4, first + length
        path = self.path
        dissipated = float(path.dissipated[last] - path.dissipated[first])
        stored = float(np.max(np.abs(path.recoverable[first : last + 1])))
        return Cycle(
            number=last // length,
            amplitude=float(path.drift[high]),
            shear=(float(path.shear[high]), float(path.shear[low])),
            dissipated=dissipated if abs(dissipated) > _ROUNDING * stored else 0.0,
        )


def cyclic_test(
    model: Model, story: int, sizes: Sequence[DriftSize | str | float], *, cycles: int = 1, points: int = 200
) -> CyclicTest:
    """Impose cycles of drift on the law of one story, as in a slow test in a laboratory.

    A cycle goes 0, amplitude, 0, -amplitude, 0 in straight lines. There are `cycles` of each amplitude, in the order
    given.

    Parameters
    ----------
    story : int
        Counted from 1.
    sizes : sequence of DriftSize, str or float
        Amplitudes, such as `0.02`, `2%`, `20mm` or `4dy`; of a number, a drift ratio.
    cycles, points : int
        Cycles of each amplitude; points of a quarter of a cycle.

    Raises
    ------
    UsageError
        The story does not exist, an amplitude needs what it does not have, or there are too many points.
    AnalysisError
        The law has no finite force along the path.
    """
    model = model_of(model)
    _check_story(model, story)
    if len(sizes) * cycles * 4 * points > MOST_POINTS:
        raise UsageError(f"{len(sizes) * cycles} cycles of {4 * points} points are more than {MOST_POINTS:,} points")
    # Damping has no part in a slow test, and may be impossible where P-delta takes all stiffness.
    building = assemble(replace(model, damping=None))
    amplitudes = [amplitude(drift_of(size), building, story) for size in sizes]
    return _test(model, building, story, cyclic_path(amplitudes, cycles, points), points)


def path_test(model: Model, story: int, drifts: Sequence[float], *, in_yield_drifts: bool = False) -> CyclicTest:
    """Impose any path of drifts on the law of one story (from 1), straight from rest to the first and on to each next.

    Parameters
    ----------
    drifts : sequence of float
        The drifts, m, or multiples of the yield drift.

    Raises
    ------
    UsageError
        The story does not exist, its law does not yield, or there are too many drifts.
    AnalysisError
        The law has no finite force along the path.
    """
    _check_story(model, story)
    if not 1 <= len(drifts) <= MOST_POINTS:
        raise UsageError(f"a path has from 1 to {MOST_POINTS:,} drifts, got {len(drifts):,}")
    building = assemble(replace(model, damping=None))
    unit = float(building.yield_drift[story - 1]) if in_yield_drifts else 1.0
    if math.isnan(unit):
        raise UsageError(f"multiples of the yield drift: the law of story {story} does not yield; give drifts in m")
    return _test(model, building, story, unit * np.asarray(drifts, float), None)


def _test(model: Model, building: Building, story: int, drifts: Array, points: int | None) -> CyclicTest:
    return CyclicTest(
        model=model,
        story=story,
        points=points,
        initial_stiffness=float(building.law_parameters[at.STIFFNESS, story - 1]),
        geometric_stiffness=float(building.linear_terms[at.GEOMETRIC, story - 1]),
        yield_drift=float(building.yield_drift[story - 1]),
        path=follow_path(building, story, drifts),
    )


def _check_story(model: Model, story: int) -> None:
    if not 1 <= story <= len(model.stories):
        raise UsageError(
            f"story {story}: the model has {how_many(len(model.stories), 'story')}, counted from 1 at the bottom"
        )


def amplitude(size: DriftSize, building: Building, story: int) -> float:
    """A drift of one story (from 1) in m.

    Raises
    ------
    UsageError
        A drift ratio without a height, or a multiple of the yield drift of a law that does not yield.
    """
    scales = {"length": 1.0, "ratio": building.heights[story - 1], "yield drift": building.yield_drift[story - 1]}
    if math.isnan(scales[size.kind]):
        missing = {
            "ratio": f"is a drift ratio, and story {story} has no height",
            "yield drift": f"is a multiple of the yield drift, and the law of story {story} does not yield",
        }
        raise UsageError(f"drift {size.text} {missing[size.kind]}; give a length, such as 20mm")
    return size.value * float(scales[size.kind])


def cyclic_path(amplitudes: Sequence[float], cycles: int, points: int) -> Array:
    """Drifts of `cycles` cycles of each amplitude with `points` points in each quarter, from 0 to 0, shape
    (1 + len(amplitudes) cycles 4 points,)."""
    up = np.arange(1, points + 1) / points
    down = np.arange(points - 1, -1, -1) / points
    cycle = np.concatenate([up, down, -up, -down])
    return np.concatenate([[0.0], *(size * np.tile(cycle, cycles) for size in amplitudes)])


def follow_path(building: Building, story: int, drifts: Array) -> LawPath:
    """A story's law (from 1) from rest to the first of some drifts (m) and from each to the next.

    Raises
    ------
    AnalysisError
        The law has no finite force somewhere on the way.
    """
    springs = spring_table(building.law_parameters)
    result = np.empty((drifts.size, RESULT_COLUMNS))
    follow.variant(variant(building))(building.law_parameters, story - 1, drifts, springs, result)
    wrong = np.flatnonzero(~np.all(np.isfinite(result), axis=1))
    if wrong.size:
        raise AnalysisError(f"story {story}: its law has no finite force and energy at drift {drifts[wrong[0]]:.6g} m")
    return LawPath(drifts, result[:, SHEAR], result[:, TANGENT], result[:, RECOVERABLE], result[:, DISSIPATION])


COLUMN = "drift_m"


def read_drift_path(source: str) -> list[float]:
    """The numbers in the column `drift_m` of a CSV file; `-` is standard input, other columns are not read.

    Raises
    ------
    UsageError
        The file cannot be read, has no such column, or a cell of it is no finite number.
    """
    table = read_table(source, f"give a CSV file with a column {COLUMN}", columns=(COLUMN,), error=UsageError)
    if not table.has(COLUMN):
        raise UsageError(f"{source}: the first line names no column {COLUMN}")
    if not table.rows:
        raise UsageError(f"{source}: holds no drift under {COLUMN}")
    return table.numbers(COLUMN)
