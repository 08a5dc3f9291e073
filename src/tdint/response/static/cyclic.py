"""Cyclic test of a story: its hysteretic law along cycles of specified amplitudes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers
from tdint.csv_table import read_table
from tdint.errors import AnalysisError, UsageError, did_you_mean
from tdint.kernels import layout as rows
from tdint.kernels.stories.law_state import (
    HYSTERETIC_ENERGY,
    RESULT_COLUMNS,
    SHEAR,
    STRAIN_ENERGY,
    TANGENT,
    follow,
)
from tdint.kernels.stories.law_tables import law_state_table
from tdint.model.building import (
    Building,
    assemble,
    variant,
)
from tdint.model.definition import Model
from tdint.number_parsing import pluralize
from tdint.response.arguments import AnyModel, drift_of, finite_numbers, model_of, one_line
from tdint.tabular import Tabular
from tdint.units import DriftSize

MAX_CYCLE_POINTS = 2_000_000
"""Maximum number of points of a test, because a typing error in the number of cycles could fill the
memory."""

SAME_STIFFNESS = 1e-9
"""Dimensionless. Change of a tangent relative to the largest tangent of the path, below which it is
a rounding error."""

_ROUNDING = 1e-13
"""Dimensionless. Dissipated energy of a cycle divided by its maximum stored energy, below which the
dissipated energy is a rounding error and reported as 0."""


@dataclass(frozen=True, eq=False)
class LawPath:
    """Response of a story's law along a path of drifts; arrays of shape (points,).

    Attributes
    ----------
    drift, shear : ndarray
        Drift, m, and restoring force of the story, N, without dashpots, damping and P-delta.
    tangent : ndarray
        Tangent stiffness of the law at the arrival at each point, N/m.
    strain_energy, hysteretic_energy : ndarray
        Energy that the law stores, and energy that it has dissipated, J.
    """

    drift: Array
    shear: Array
    tangent: Array
    strain_energy: Array
    hysteretic_energy: Array


@dataclass(frozen=True)
class Cycle:
    """Result of a single cycle of a test.

    Attributes
    ----------
    amplitude : float
        Maximum drift on either side, m.
    shear : tuple of float
        Restoring force at the maximum drift on the positive and on the negative side, N.
    hysteretic_energy : float
        Energy dissipated in the cycle, J.
    """

    number: int
    amplitude: float
    shear: tuple[float, float]
    hysteretic_energy: float

    @property
    def secant_stiffness(self) -> float:
        """Slope between the two points of maximum drift, N/m.

        This is the effective stiffness of ASCE 7-16, equation 17.2-3.
        """
        return (self.shear[0] - self.shear[1]) / (2.0 * self.amplitude)

    @property
    def damping_ratio(self) -> float:
        """Equivalent viscous damping ratio E_D / (4 pi E_S0); nan without positive stiffness.

        E_D is the energy dissipated in the cycle, and E_S0 the strain energy at the amplitude,
        secant stiffness times amplitude^2 / 2 (Chopra 2012, section 3.9).
        """
        strain_energy = 0.5 * self.secant_stiffness * self.amplitude**2
        return (
            self.hysteretic_energy / (4.0 * math.pi * strain_energy)
            if strain_energy > 0.0
            else math.nan
        )


@dataclass(frozen=True, repr=False)
class CyclicTest(Tabular):
    """Result of a cyclic test.

    Attributes
    ----------
    model : Model
        Model of the building.
    story : int
        Number of the story, from 1.
    points : int | None
        Number of points in a quarter of a cycle; None for a path without cycles.
    initial_stiffness, geometric_stiffness : float
        Initial stiffness of the law, and geometric stiffness of P-delta (negative, 0 without
        P-delta), N/m.
    yield_drift : float
        Drift at first yield, m; nan for a law that does not yield.
    path : LawPath
        Path from rest through all cycles (see `cycle_numbers`), or the specified path.
    """

    model: Model
    story: int
    points: int | None
    initial_stiffness: float
    geometric_stiffness: float
    yield_drift: float
    path: LawPath

    def _headline(self) -> str:
        return (
            f"of {self.model.name!r}, story {self.story}, {self.law} law, "
            f"{pluralize(self.path.drift.size, 'point')}"
        )

    @property
    def height(self) -> float:
        """Story height, m; nan if the model does not specify it."""
        height = self.model.stories[self.story - 1].drift_height
        return math.nan if height is None else height

    @property
    def law(self) -> str:
        """Name of the drift law."""
        return self.model.stories[self.story - 1].law_text

    @property
    def cycle_numbers(self) -> NDArray[np.int64] | None:
        """Number of the cycle of each point, from 1; 0 at the start. None without cycles."""
        if self.points is None:
            return None
        # Round up: the last point of a cycle belongs to this cycle.
        return -(-np.arange(self.path.drift.size) // (4 * self.points))

    @property
    def shear_with_p_delta(self) -> Array:
        """Restoring force with the geometric stiffness, N: the horizontal force in equilibrium."""
        return self.path.shear + self.geometric_stiffness * self.path.drift

    @property
    def cycles(self) -> tuple[Cycle, ...]:
        """Results of all cycles of the test, in order; empty for a path without cycles."""
        if self.points is None:
            return ()
        path, points = self.path, self.points
        cycles: list[Cycle] = []
        for first_point in range(0, path.drift.size - 1, 4 * points):
            # The maximum drifts are at a quarter and at three quarters of the cycle.
            positive_peak = first_point + points
            negative_peak = first_point + 3 * points
            last_point = first_point + 4 * points
            dissipated = float(
                path.hysteretic_energy[last_point] - path.hysteretic_energy[first_point]
            )
            stored = float(np.max(np.abs(path.strain_energy[first_point : last_point + 1])))
            cycles.append(
                Cycle(
                    number=len(cycles) + 1,
                    amplitude=float(path.drift[positive_peak]),
                    shear=(float(path.shear[positive_peak]), float(path.shear[negative_peak])),
                    hysteretic_energy=dissipated if abs(dissipated) > _ROUNDING * stored else 0.0,
                )
            )
        return tuple(cycles)


def cyclic_test(
    model: AnyModel,
    story: int,
    sizes: Sequence[DriftSize | str | float],
    *,
    cycles: int = 1,
    points: int = 200,
    element: str | None = None,
) -> CyclicTest:
    """Impose cycles of drift on the law of one story, as in a quasi-static laboratory test.

    A cycle consists of straight lines from 0 to the amplitude, to 0, to the negative amplitude and
    to 0. Each amplitude is repeated `cycles` times, in the specified order.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model, as in `run`.
    story : int
        Number of the story, from 1.
    sizes : sequence of DriftSize, str or float
        Amplitudes, such as `0.02`, `2%`, `20mm` or `4dy`. A number is a drift ratio.
    cycles, points : int
        Number of cycles of each amplitude (default 1), and number of points in a quarter of a cycle
        (default 200).
    element : str, optional
        Name of an element of the story, which is tested without the rest of the story and without
        P-delta. Default: the complete story.

    Returns
    -------
    CyclicTest
        Drifts and forces along the path, and energy of each cycle.

    Raises
    ------
    UsageError
        The story does not exist, the unit of an amplitude is not available for this story, or there
        are too many points.
    ModelError
        The model is invalid.
    AnalysisError
        The law has no finite force along the path.
    """
    if isinstance(sizes, str) or not len(sizes) or min(cycles, points) < 1:
        raise UsageError(
            "sizes must be a sequence of amplitudes, such as ['1%', '20mm', '4dy'], cycles and "
            f"points at least 1, got {one_line(sizes)}, {cycles} and {points}"
        )
    model = _with_tested_element(model_of(model), story, element)
    if len(sizes) * cycles * 4 * points > MAX_CYCLE_POINTS:
        raise UsageError(
            f"{len(sizes) * cycles} cycles of {4 * points} points exceed the maximum of "
            f"{MAX_CYCLE_POINTS:,} points; reduce the cycles or the points"
        )
    # Omit damping, because a quasi-static test has no velocities. Damping coefficients could not be
    # computed anyway if P-delta reduces the stiffness to zero.
    building = assemble(replace(model, damping=None))
    amplitudes = [amplitude(drift_of(size), building, story) for size in sizes]
    return _test(model, building, story, cyclic_path(amplitudes, cycles, points), points)


def law_path(
    model: AnyModel,
    story: int,
    drifts: Numbers,
    *,
    in_yield_drifts: bool = False,
    element: str | None = None,
) -> CyclicTest:
    """Impose any path of drifts on the law of one story, such as the protocol of a test, with
    straight lines from rest.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model, as in `run`.
    story : int
        Number of the story, from 1.
    drifts : sequence of float, shape (points,)
        Drifts, m, or multiples of the yield drift.
    in_yield_drifts : bool
        True if the drifts are multiples of the yield drift; default False.
    element : str, optional
        Name of an element of the story, which is tested without the rest of the story and without
        P-delta. Default: the complete story.

    Returns
    -------
    CyclicTest
        `path` contains drifts and forces; there are no cycles.

    Raises
    ------
    UsageError
        The story does not exist, its law does not yield, the drifts are not finite numbers, or
        there are too many.
    ModelError
        The model is invalid.
    AnalysisError
        The law has no finite force along the path.
    """
    model = _with_tested_element(model_of(model), story, element)
    path = finite_numbers(drifts)
    if path is None or path.ndim != 1 or not 1 <= path.size <= MAX_CYCLE_POINTS:
        raise UsageError(
            f"drifts must be a sequence of 1 to {MAX_CYCLE_POINTS:,} finite numbers, got "
            f"{drifts!r:.60}"
        )
    building = assemble(replace(model, damping=None))
    unit = float(building.yield_drift[story - 1]) if in_yield_drifts else 1.0
    # The yield drift of a law that does not yield is nan.
    if math.isnan(unit):
        raise UsageError(
            f"drifts cannot be multiples of the yield drift, because the law of story {story} does "
            "not yield; specify drifts in m"
        )
    return _test(model, building, story, unit * path, None)


def _test(
    model: Model, building: Building, story: int, drifts: Array, points: int | None
) -> CyclicTest:
    """Impose a path of drifts on the law of one story, and return the result of the test.

    `points` is the number of points in a quarter of a cycle; None for a path without cycles.
    """
    return CyclicTest(
        model=model,
        story=story,
        points=points,
        initial_stiffness=float(building.law_parameters[rows.STIFFNESS, story - 1]),
        geometric_stiffness=float(building.linear_terms[rows.GEOMETRIC, story - 1]),
        yield_drift=float(building.yield_drift[story - 1]),
        path=follow_path(building, story, drifts),
    )


def _with_tested_element(model: Model, story: int, element: str | None) -> Model:
    """Return the model, with a tested story of a single element and without P-delta, if
    the name of an element is given.

    UsageError is raised if the story or the element does not exist.
    """
    model.require_springs("the test of a law")
    if not 1 <= story <= len(model.stories):
        raise UsageError(
            f"story {story} not found: the model has {pluralize(len(model.stories), 'story')}, "
            "numbered from 1 at the bottom"
        )
    if element is None:
        return model
    tested = model.stories[story - 1]
    names = [spring.name for spring in tested.elements]
    if element not in names:
        advice = (
            f"use one of {', '.join(names)}{did_you_mean(element, names)}"
            if names
            else "the story has one law and no elements; omit the element"
        )
        raise UsageError(f"element {element!r} of story {story} not found; {advice}")
    spring = tested.elements[names.index(element)]
    stories = list(model.stories)
    stories[story - 1] = replace(tested, stiffness=spring.stiffness, law=spring.law, elements=())
    return replace(model, stories=tuple(stories)).without_p_delta()


def amplitude(size: DriftSize, building: Building, story: int) -> float:
    """Convert a drift of one story to m.

    Parameters
    ----------
    size : DriftSize
        Length, drift ratio (multiple of the story height) or multiple of the yield drift.

    Raises
    ------
    UsageError
        The size is a drift ratio and the story has no height, or it is a multiple of the yield
        drift and the law does not yield.
    """
    unit_in_m = {
        "length": 1.0,
        "ratio": building.heights[story - 1],
        "yield drift": building.yield_drift[story - 1],
    }
    if math.isnan(unit_in_m[size.quantity]):
        reason = {
            "ratio": f"is a drift ratio, and story {story} has no height",
            "yield drift": f"is a multiple of the yield drift, and the law of story {story} does "
            "not yield",
        }
        raise UsageError(
            f"drift {size.text} {reason[size.quantity]}; specify a length, such as 20mm"
        )
    return size.value * float(unit_in_m[size.quantity])


def cyclic_path(amplitudes: Sequence[float], cycles: int, points: int) -> Array:
    """Return the drifts of a cyclic test, shape (1 + len(amplitudes) cycles 4 points,).

    The first point is 0. Each cycle has four straight quarters: to the amplitude, to 0, to the
    negative amplitude and to 0.

    Parameters
    ----------
    amplitudes : sequence of float
        Amplitudes, in m or in another unit; the drifts have the same unit.
    """
    rising_quarter = np.arange(1, points + 1) / points
    falling_quarter = np.arange(points - 1, -1, -1) / points
    cycle = np.concatenate([rising_quarter, falling_quarter, -rising_quarter, -falling_quarter])
    return np.concatenate(
        [[0.0], *(amplitude * np.tile(cycle, cycles) for amplitude in amplitudes)]
    )


def follow_path(building: Building, story: int, drifts: Array) -> LawPath:
    """Compute the forces of the law of one story along a path of drifts that starts at rest.

    Parameters
    ----------
    story : int
        Number of the story, from 1; for an element, 1 plus its column in the table of the laws.
    drifts : ndarray, shape (points,)
        Drifts, m. The path between two drifts is a straight line.

    Raises
    ------
    AnalysisError
        The law has no finite force at some point of the path.
    """
    law_state = law_state_table(building.law_parameters)
    result = np.empty((drifts.size, RESULT_COLUMNS))
    follow.variant(variant(building))(building.law_parameters, story - 1, drifts, law_state, result)
    not_finite = np.flatnonzero(~np.all(np.isfinite(result), axis=1))
    if not_finite.size:
        raise AnalysisError(
            f"story {story}: force or energy of the law is not finite at the drift "
            f"{drifts[not_finite[0]]:.6g} m; use smaller drifts or other parameters of the law"
        )
    return LawPath(
        drifts,
        result[:, SHEAR],
        result[:, TANGENT],
        result[:, STRAIN_ENERGY],
        result[:, HYSTERETIC_ENERGY],
    )


COLUMN = "drift_m"


def read_drift_path(source: str) -> list[float]:
    """Read the drifts (m) in the column `drift_m` of a CSV file; other columns are ignored.

    Parameters
    ----------
    source : str
        File; `-` is standard input.

    Raises
    ------
    UsageError
        The file cannot be read, has no such column, or a cell is not a finite number.
    """
    table = read_table(
        source,
        f"specify a CSV file with a column {COLUMN}",
        columns=(COLUMN,),
        error=UsageError,
    )
    if not table.has(COLUMN):
        raise UsageError(f"{source}: column {COLUMN} not found in the first line")
    if not table.rows:
        raise UsageError(f"{source}: the column {COLUMN} contains no drift; add at least one row")
    return table.numbers(COLUMN)
