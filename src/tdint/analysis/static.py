"""Static analyses: cyclic test of a story, and pushover of a building.

A pushover computes the base shear of a building that is pushed slowly, over its roof displacement.
The forces on the floors have a constant pattern and one common factor. In a chain, this factor
determines the shears of all stories. The analysis is therefore controlled by the drift of the
softest story at the time. Each other story has the drift at which it carries its share of the
shear: it is loaded while the factor increases, and unloaded while the factor decreases. This
control passes through peaks and softening branches and does not need a matrix. If one story
softens and the other stories unload by more than its increment, the roof displacement decreases
(snap-back). The curve is thus a path and not a function of the roof displacement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.arguments import AnyModel, drift_of, model_of
from tdint.arrays import Array, bisect_interval
from tdint.csv_table import read_table
from tdint.errors import AnalysisError, UsageError, did_you_mean
from tdint.kernels import layout as rows
from tdint.kernels.laws.compiled_separately import law_state_table
from tdint.kernels.stories.law_state import (
    HYSTERETIC_ENERGY,
    RESULT_COLUMNS,
    SHEAR,
    STRAIN_ENERGY,
    TANGENT,
    follow,
)
from tdint.model.building import (
    Building,
    assemble,
    element_yield_drifts,
    law_columns,
    variant,
)
from tdint.model.definition import LAWS, Model
from tdint.number_parsing import pluralize
from tdint.tabular import Tabular
from tdint.units import DriftSize

# ---- Cyclic test of a story: its hysteretic law along cycles of specified amplitudes (command
# `tdint law`)

MAX_CYCLE_POINTS = 2_000_000
"""Maximum number of points of a test, because a typing error in the number of cycles could fill the
memory."""

_SAME_STIFFNESS = 1e-9
"""Dimensionless. Change of a tangent relative to the largest tangent of the path, below which it is
a rounding error."""

_ROUNDING = 1e-13
"""Dimensionless. Dissipated energy of a cycle divided by its maximum stored energy, below which the
dissipated energy is a rounding error and reported as 0."""


@dataclass(frozen=True)
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
    number : int
        Number of the cycle in the test, from 1.
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
        """Return the description of the result in one line, without the class name."""
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
            positive_peak, negative_peak, last_point = (
                first_point + points,
                first_point + 3 * points,
                first_point + 4 * points,
            )
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
        Name of an element of the story, which is tested alone and without P-delta. Default: the
        complete story.

    Returns
    -------
    CyclicTest
        Drifts and forces along the path, and energy of each cycle.

    Raises
    ------
    UsageError
        The story does not exist, the unit of an amplitude is not available for it, or there are too
        many points.
    AnalysisError
        The law has no finite force along the path.
    """
    model = model_of(model)
    _check_story(model, story)
    model = _with_element_only(model, story, element)
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


def path_test(
    model: Model,
    story: int,
    drifts: Sequence[float],
    *,
    in_yield_drifts: bool = False,
    element: str | None = None,
) -> CyclicTest:
    """Impose any path of drifts on the law of one story, with straight lines from rest.

    Parameters
    ----------
    story : int
        Number of the story, from 1.
    drifts : sequence of float
        Drifts, m, or multiples of the yield drift.
    in_yield_drifts : bool
        True if the drifts are multiples of the yield drift; default False.
    element : str, optional
        Name of an element of the story, which is tested alone and without P-delta. Default: the
        complete story.

    Raises
    ------
    UsageError
        The story does not exist, its law does not yield, or there are too many drifts.
    AnalysisError
        The law has no finite force along the path.
    """
    _check_story(model, story)
    model = _with_element_only(model, story, element)
    if not 1 <= len(drifts) <= MAX_CYCLE_POINTS:
        raise UsageError(
            f"a path must have from 1 to {MAX_CYCLE_POINTS:,} drifts, got {len(drifts):,}"
        )
    building = assemble(replace(model, damping=None))
    unit = float(building.yield_drift[story - 1]) if in_yield_drifts else 1.0
    # The yield drift of a law that does not yield is nan.
    if math.isnan(unit):
        raise UsageError(
            f"drifts cannot be multiples of the yield drift, because the law of story {story} does "
            "not yield; specify drifts in m"
        )
    return _test(model, building, story, unit * np.asarray(drifts, float), None)


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


def _check_story(model: Model, story: int) -> None:
    """Raise UsageError if the model does not have the story."""
    if not 1 <= story <= len(model.stories):
        raise UsageError(
            f"story {story} not found: the model has {pluralize(len(model.stories), 'story')}, "
            "numbered from 1 at the bottom"
        )


def _with_element_only(model: Model, story: int, element: str | None) -> Model:
    """Return the model with an element as the only spring of a story, and without P-delta.

    P-delta is a property of the story. Without `element`, the model is not changed.
    """
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
    return replace(model, stories=tuple(stories), p_delta=False)


def amplitude(size: DriftSize, building: Building, story: int) -> float:
    """Convert a drift of one story to m.

    Parameters
    ----------
    size : DriftSize
        Length, drift ratio (multiple of the story height) or multiple of the yield drift.
    story : int
        Number of the story, from 1.

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


# ---- Pushover

MAX_PUSHOVER_POINTS = 100_000  # maximum number of rows; larger tables are hard to open
_FORCE_TOLERANCE = 1e-11  # tolerance of a force, divided by the maximum force of the story so far
# Maximum number of iterations. Newton's method needs up to ten, and 60 bisections of an interval
# reach the rounding errors
_MAX_ITERATIONS = 60
# The usual drift step of the controlling story is the difference of the roof displacement between
# two rows, divided by this number
_STEPS_PER_ROW = 8
# Maximum number of steps per row. Without it, the path would not end if the roof displacement is
# constant, because the other stories unload as fast as the controlling story is loaded
_MAX_STEPS_PER_ROW = 4000
# Maximum error of the area below the curve in one step, over the area of a rectangle that encloses
# the curve; a curve with ten yield points then has seven correct digits
_AREA_TOLERANCE = 1e-8
# Minimum drift step divided by the usual step, which limits halving at kinks of a law and reversals
_MIN_STEP_FRACTION = 1e-5
# Maximum number of rows divided by the number of requested points. A path with snap-back has more
# rows than requested, and may never reach the target
_MAX_ROWS_PER_POINT = 20
# Decrease of the roof displacement divided by its maximum, from which it is a snap-back and not a
# rounding error
_SNAP_BACK = 1e-9


Excess = Callable[[Array, float], float]
"""Function of the story drifts (m) and the base shear (N) of a state. It returns the excess of a
quantity, such as the roof displacement, over a required value, relative to this value."""


@dataclass(frozen=True)
class ElementEvent:
    """Change of stiffness of an element in a pushover: it yields, or a gap closes.

    Attributes
    ----------
    story : int
        Number of the story, from 1.
    element, law : str
        Name of the element and of its law.
    roof_displacement, base_shear : float
        Roof displacement, m, and base shear, N, of the state.
    stiffness_before, stiffness_after : float
        Tangent stiffness of the element, N/m. For a curved law, which has no kinks, they are the
        tangents of the states before and after the yield drift.
    """

    story: int
    element: str
    law: str
    drift: float
    roof_displacement: float
    base_shear: float
    stiffness_before: float
    stiffness_after: float


@dataclass(frozen=True, repr=False)
class Pushover(Tabular):
    """Result of a pushover; row 0 is the initial state at rest.

    Attributes
    ----------
    model : Model
        Model of the building.
    pattern : str
        Name of the pattern of forces.
    forces : ndarray, shape (n,)
        Pattern, with the sum 1.
    drift : ndarray, shape (rows, n)
        Drifts of the stories, m.
    base_shear : ndarray, shape (rows,)
        Sum of the forces, N.
    largest_base_shear : float
        Maximum base shear of the complete path, including states between the rows, N.
    drift_at_largest : ndarray, shape (n,)
        Drifts of the stories at the maximum base shear, m.
    ended : str
        Reason why the path ends before the requested displacement; empty if it does not.
    way : tuple of ndarray
        Complete path, including states between the rows: drifts, m, shape (points, n), and base
        shears, N, shape (points,).
    events : tuple of ElementEvent
        Changes of stiffness of the elements of stories with several elements, in order.
    """

    model: Model
    pattern: str
    forces: Array
    drift: Array
    base_shear: Array
    largest_base_shear: float
    drift_at_largest: Array
    ended: str
    way: tuple[Array, Array]
    events: tuple[ElementEvent, ...] = ()

    def _headline(self) -> str:
        """Return the description of the result in one line, without the class name."""
        return (
            f"of {self.model.name!r}, {self.pattern} pattern, largest base shear "
            f"{self.largest_base_shear:.4g} N"
        )

    @property
    def roof_displacement(self) -> Array:
        """Displacement of the roof relative to the ground, m, shape (rows,)."""
        return np.asarray(self.drift.sum(axis=1))

    @property
    def height(self) -> float:
        """Height of the building, m; nan if a story has no height or all stories are isolators."""
        height = math.fsum(
            story.drift_height or (0.0 if story.isolator else math.nan)
            for story in self.model.stories
        )
        return height or math.nan

    @property
    def roof_drift_ratio(self) -> Array:
        """Roof displacement over the height of the building; nan without heights."""
        return self.roof_displacement / self.height

    @property
    def roof_at_largest(self) -> float:
        """Roof displacement at the maximum base shear, m."""
        return float(self.drift_at_largest.sum())


def _triangular(building: Building) -> Array:
    """Return the triangular pattern of forces, mass times height of the floor above the ground (kg
    m); raise UsageError if a story has no height.
    """
    if np.isnan(building.height_contributions).any():
        raise UsageError(
            "the triangular pattern requires the height of every story; add heights or use another "
            "--pattern"
        )
    return building.mass * np.cumsum(building.height_contributions)


PATTERNS: Mapping[str, Callable[[Building], Array]] = {
    "first-mode": lambda building: building.mass * building.modes().shapes[:, 0],
    "uniform": lambda building: building.mass.copy(),
    "triangular": _triangular,
}
"""Functions that return the forces on the floors of a building, without normalization, by name of
the pattern: mass times first mode shape, mass, or mass times height above the ground."""


def pushover(
    model: AnyModel,
    size: DriftSize | str | float,
    *,
    pattern: str = "first-mode",
    points: int = 200,
) -> Pushover:
    """Push a building to a roof displacement.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model, as in `run`.
    size : DriftSize, str or float
        Roof displacement, as a length, or as a ratio to the height of the building (also a number).
    pattern : str
        Key of `PATTERNS`; default `first-mode`.
    points : int
        Number of rows after the start, at equal steps of the roof displacement; default 200. If the
        roof displacement decreases, rows are added at equal steps of the summed changes of all
        story drifts. The rows end if the base shear has decreased to zero, where the building would
        collapse without forces, or if no equilibrium is found (`ended`).

    Returns
    -------
    Pushover
        Roof displacement, base shear, and drifts and shears of the stories at each step.

    Raises
    ------
    UsageError
        The size is a drift ratio or the pattern is triangular, and heights are missing; the size is
        a multiple of a yield drift; or the pattern is unknown.
    AnalysisError
        No equilibrium is found in the first step.
    """
    if pattern not in PATTERNS:
        raise UsageError(f"unknown pattern {pattern!r}; known: {', '.join(PATTERNS)}")
    if not 1 <= points <= MAX_PUSHOVER_POINTS:
        raise UsageError(f"points must be from 1 to {MAX_PUSHOVER_POINTS}, got {points}")
    model = model_of(model)
    building = assemble(replace(model, damping=None))
    target = _target(drift_of(size), building)
    forces = PATTERNS[pattern](building)
    forces /= forces.sum()
    chain = _Chain(building, forces)
    # The first row is the initial state.
    drift_rows, base_shears, ended = [np.zeros(building.stories)], [0.0], ""
    reached_points = 0  # number of the requested points that the roof displacement has reached
    while reached_points < points and not ended:
        ended = chain.push(target * (reached_points + 1) / points, target / points)
        # If the path ends between two rows, its last state is the last row.
        if not np.array_equal(chain.drift, drift_rows[-1]):
            drift_rows.append(chain.drift.copy())
            base_shears.append(chain.base_shear)
        reached_points = max(reached_points, math.floor(chain.drift.sum() / target * points + 1e-6))
        if not ended and len(drift_rows) > _MAX_ROWS_PER_POINT * points:
            ended = "the roof displacement decreases and does not reach the target"
    if len(drift_rows) == 1:
        raise AnalysisError(f"the pushover stops at the first step: {ended}")
    return Pushover(
        model,
        pattern,
        forces,
        np.array(drift_rows),
        np.array(base_shears),
        *chain.largest,
        ended,
        chain.path,
        _element_events(model, building, *chain.path),
    )


def _element_events(
    model: Model, building: Building, drifts: Array, base_shears: Array
) -> tuple[ElementEvent, ...]:
    """Return the changes of stiffness of all elements along the states of a pushover.

    Between two states, the force of a law with linear branches has one kink, at the intersection of
    both branches. A curved law has an event at its yield drift.
    """
    roofs = drifts.sum(axis=1)
    found: list[tuple[float, ElementEvent]] = []
    columns = law_columns(model.stories)
    for i, story in enumerate(model.stories):
        yield_drifts = element_yield_drifts(story)
        for column, element, yield_drift in zip(
            columns[i], story.elements, yield_drifts, strict=False
        ):
            path = follow_path(building, column + 1, drifts[:, i])
            tangents = path.tangent
            if LAWS[element.law.name].curved:
                is_beyond = np.abs(path.drift) >= yield_drift  # False for nan
                states = np.flatnonzero(np.diff(is_beyond.astype(int)) > 0)
            else:
                change = np.abs(np.diff(tangents))
                states = np.flatnonzero(change > _SAME_STIFFNESS * np.max(np.abs(tangents)))
            for k in states.tolist():
                step = path.drift[k + 1] - path.drift[k]
                if LAWS[element.law.name].curved:
                    distance = math.copysign(yield_drift, path.drift[k + 1]) - path.drift[k]
                else:
                    excess = path.shear[k + 1] - path.shear[k] - tangents[k + 1] * step
                    distance = excess / (tangents[k] - tangents[k + 1])
                fraction = min(max(distance / step, 0.0), 1.0) if step else 1.0
                event = ElementEvent(
                    story=i + 1,
                    element=element.name,
                    law=element.law.name,
                    drift=float(path.drift[k] + fraction * step),
                    roof_displacement=float(roofs[k] + fraction * (roofs[k + 1] - roofs[k])),
                    base_shear=float(
                        base_shears[k] + fraction * (base_shears[k + 1] - base_shears[k])
                    ),
                    stiffness_before=float(tangents[k]),
                    stiffness_after=float(tangents[k + 1]),
                )
                found.append((k + fraction, event))
    return tuple(event for _, event in sorted(found, key=lambda item: item[0]))


def _target(size: DriftSize, building: Building) -> float:
    """Return the target roof displacement in m for a size, a length or a drift ratio; raise
    UsageError for another size or a missing height.
    """
    unit_in_m = {"length": 1.0, "ratio": float(building.height_contributions.sum())}
    if size.quantity not in unit_in_m:
        raise UsageError(
            f"drift {size.text}: the roof has no yield drift; specify a drift ratio or a length"
        )
    if math.isnan(unit_in_m[size.quantity]):
        raise UsageError(
            f"drift {size.text} is a drift ratio, and a story has no height; specify a length, "
            "such as 200mm"
        )
    return size.value * unit_in_m[size.quantity]


class _Chain:
    """State of all stories along the path of a pushover; `push` advances it.

    Parameters
    ----------
    forces : ndarray, shape (n,)
        Pattern of the lateral forces on the floors from the bottom, with the sum 1, dimensionless.

    Attributes
    ----------
    shear_fraction : ndarray, shape (n,)
        Shear of each story over the base shear; it follows from the pattern of forces.
    largest : tuple of (float, ndarray)
        Maximum base shear of the path so far, N, and the drifts at this base shear.
    """

    def __init__(self, building: Building, forces: Array) -> None:
        # The shear of a story is the sum of the forces above, from the roof down.
        self.shear_fraction = np.cumsum(forces[::-1])[::-1]
        self.stories = [_Story(building, i) for i in range(building.stories)]
        self.drift = np.zeros(building.stories)
        self.base_shear = 0.0
        self.maximum_roof_displacement = 0.0
        # The path starts at rest. The states of the path are (drifts, base shear).
        self.largest = (0.0, self.drift)
        self._states = [(self.drift, 0.0)]

    @property
    def path(self) -> tuple[Array, Array]:
        """Path so far: drifts, m, shape (points, n), and base shears, N, shape (points,)."""
        return np.array([drift for drift, _ in self._states]), np.array(
            [base_shear for _, base_shear in self._states]
        )

    def push(self, displacement: float, step: float) -> str:
        """Advance to the next row of the result; return the reason if the path ends before it,
        otherwise an empty text.

        A row is reached at a roof `displacement`. If the roof displacement decreases, a row is
        reached if the absolute changes of all story drifts add up to a `step`.
        """
        default_step, path_length = step / _STEPS_PER_ROW, 0.0
        drift_step = default_step
        for _ in range(_MAX_STEPS_PER_ROW):
            # The controlling story is the softest relative to its shear: its drift increases most
            # with the base shear, or it softens. If another story cannot resist its shear, each
            # other story is tried as the controlling story.
            tangents = np.array([story.tangent for story in self.stories])
            story_indices = np.arange(tangents.size)
            softest = int(np.argmin(tangents / self.shear_fraction))
            for controlling in (softest, *np.delete(story_indices, softest).tolist()):
                if (new_state := self._trial(controlling, drift_step)) is not None:
                    break
            else:
                return "no further equilibrium state was found"
            drift, base_shear = new_state
            # Halve the step if the path bends within it, because the area below the curve would be
            # wrong at a yield point.
            if drift_step > _MIN_STEP_FRACTION * default_step:
                maximum_shear = max(self.largest[0], base_shear)
                area_error = self._area_error(controlling, tangents, drift, base_shear)
                if area_error > _AREA_TOLERANCE * maximum_shear * drift.sum():
                    drift_step *= 0.5
                    continue
            # A negative base shear is not meaningful: the path ends at the state in which the base
            # shear is zero.
            if base_shear <= 0.0:
                drift, _ = self._find_state(
                    lambda _, base_shear: -base_shear / self.largest[0],
                    controlling,
                    drift_step,
                    drift,
                    base_shear,
                )
                self._accept(controlling, drift, 0.0)
                return "no remaining lateral resistance"
            # With increasing roof displacement, a row is complete at its displacement.
            if drift.sum() >= displacement:
                self._accept(
                    controlling,
                    *self._find_state(
                        lambda drift, _: drift.sum() / displacement - 1.0,
                        controlling,
                        drift_step,
                        drift,
                        base_shear,
                    ),
                )
                return ""
            path_length += float(np.abs(drift - self.drift).sum())
            self._accept(controlling, drift, base_shear)
            self.maximum_roof_displacement = max(self.maximum_roof_displacement, float(drift.sum()))
            drift_step = min(2.0 * drift_step, default_step)
            # With decreasing roof displacement, a row is complete after a certain length of the
            # path.
            if path_length >= step and drift.sum() < self.maximum_roof_displacement * (
                1.0 - _SNAP_BACK
            ):
                return ""
        return (
            f"the remaining stories unload as fast as story {controlling + 1} deforms; more points "
            "may continue the curve"
        )

    def _area_error(
        self, controlling: int, tangents: Array, drift: Array, base_shear: float
    ) -> float:
        """Return an estimate of the error of the area below the curve if a step is a straight
        line.
        """
        drift_change, shear_change = drift - self.drift, base_shear - self.base_shear
        # Error of the base shear times change of the roof displacement, plus error of the roof
        # displacement times change of the base shear.
        predicted_shear_change = (
            tangents[controlling] * drift_change[controlling] / self.shear_fraction[controlling]
        )
        area_error = abs(shear_change - predicted_shear_change) * abs(drift_change.sum())
        others = (np.arange(tangents.size) != controlling) & (tangents > 0.0)
        predicted_drifts = shear_change * self.shear_fraction[others] / tangents[others]
        area_error += abs(drift_change[others].sum() - predicted_drifts.sum()) * abs(shear_change)
        return float(area_error)

    def _find_state(
        self, excess: Excess, controlling: int, drift_step: float, drift: Array, base_shear: float
    ) -> tuple[Array, float]:
        """Find the drifts and the base shear within a step where a quantity has its required value.

        The Illinois algorithm is used (Dowell and Jarratt 1971). The excess is negative at the
        present state and positive at the end of the step.
        """
        lower, upper = 0.0, drift_step
        lower_excess, upper_excess = excess(self.drift, self.base_shear), excess(drift, base_shear)
        for _ in range(_MAX_ITERATIONS):
            if abs(excess(drift, base_shear)) <= _FORCE_TOLERANCE:
                break
            # Compute the zero of the secant between both endpoints. After each iteration, the value
            # at the endpoint that is retained is halved. Otherwise the same endpoint could be
            # retained in all iterations, which converges slowly.
            middle = lower + (upper - lower) * lower_excess / (lower_excess - upper_excess)
            trial = self._trial(controlling, middle)
            if trial is None or not lower < middle < upper:
                break
            drift, base_shear = trial
            trial_excess = excess(drift, base_shear)
            if trial_excess > 0.0:
                upper, upper_excess, lower_excess = middle, trial_excess, 0.5 * lower_excess
            else:
                lower, lower_excess, upper_excess = middle, trial_excess, 0.5 * upper_excess
        return drift, base_shear

    def _trial(self, controlling: int, drift_step: float) -> tuple[Array, float] | None:
        """Compute the drifts and the base shear in equilibrium after a drift step of one story,
        without accepting the state; None if another story cannot resist its shear.
        """
        force, _ = self.stories[controlling].response_at(self.drift[controlling] + drift_step)
        base_shear = force / self.shear_fraction[controlling]
        drift = self.drift.copy()
        drift[controlling] += drift_step
        for i, story in enumerate(self.stories):
            if i != controlling:
                story_drift = story.drift_at_force(base_shear * self.shear_fraction[i])
                if story_drift is None:
                    return None
                drift[i] = story_drift
        return drift, base_shear

    def _accept(self, controlling: int, drift: Array, base_shear: float) -> None:
        """Advance all stories to a new state, and update the path and the maximum base shear."""
        # The maximum base shear of the step is at its end, or at the maximum force of the
        # controlling story. If the tangent of this story changes its sign within the step, its
        # maximum force is found by bisection. Item 1 of the result of `response_at` is the tangent.
        story = self.stories[controlling]
        step_to_maximum = float(drift[controlling] - self.drift[controlling])
        maximum_state = (base_shear, drift)
        if story.tangent > 0.0 and story.response_at(float(drift[controlling]))[1] <= 0.0:
            start = self.drift[controlling]
            _, step_to_maximum = bisect_interval(
                lambda step: story.response_at(start + step)[1] > 0.0,
                0.0,
                step_to_maximum,
                _MAX_ITERATIONS,
            )
            state_at_maximum = self._trial(controlling, step_to_maximum)
            if state_at_maximum and state_at_maximum[1] >= base_shear:
                maximum_state = (state_at_maximum[1], state_at_maximum[0])
        self.largest = max(self.largest, maximum_state, key=lambda state: state[0])
        for story, new_drift in zip(self.stories, drift, strict=True):
            story.advance(float(new_drift))
        self.drift, self.base_shear = drift, base_shear
        self._states.append((drift, base_shear))


class _Story:
    """One story with P-delta, with the reversals of its drift from rest to the present state.

    Attributes
    ----------
    drift, force : float
        Present drift, m, and force including P-delta, N.
    tangent, initial_tangent : float
        Present and initial stiffness including P-delta, N/m.
    """

    def __init__(self, building: Building, i: int) -> None:
        self._building, self._number = building, i + 1
        self._geometric = float(building.linear_terms[rows.GEOMETRIC, i])
        self._reversals: list[float] = [0.0]
        self.drift = 0.0
        self.force = 0.0
        self.initial_tangent = self.tangent = float(building.initial_stiffness[i])
        self._maximum_force = 0.0

    def response_at(self, drift: float) -> tuple[float, float]:
        """Return force (N) and tangent (N/m), with P-delta, at a drift (m).

        The story moves from rest through its reversals to the present drift, and from there in a
        straight line to the given drift. The state of the story is not changed.
        """
        path = follow_path(
            self._building, self._number, np.array([*self._reversals, self.drift, drift])
        )
        force = float(path.shear[-1]) + self._geometric * drift
        return force, float(path.tangent[-1]) + self._geometric

    def advance(self, drift: float) -> None:
        """Advance to a drift (m), and store the present drift if it is a reversal."""
        if drift == self.drift:
            return
        self.force, self.tangent = self.response_at(drift)
        self._maximum_force = max(self._maximum_force, abs(self.force))
        # The present drift is a reversal if the story now moves in the opposite direction.
        if (drift - self.drift) * (self.drift - self._reversals[-1]) < 0.0:
            self._reversals.append(self.drift)
        self.drift = drift

    def drift_at_force(self, force: float) -> float | None:
        """Return the next drift (m) where the story has a force (N); None if it cannot reach it.

        The drift increases for a larger force than the present force, and decreases for a smaller
        force.
        """
        force_change = force - self.force
        tolerance = _FORCE_TOLERANCE * max(self._maximum_force, abs(force))
        if abs(force_change) <= tolerance:
            return self.drift
        is_loading = force_change > 0.0
        # Newton's method, bracketed by a drift with a smaller force (`near_drift`) and a drift with
        # a larger force (`far_drift`). A story that softens before it reaches the force cannot
        # reach it.
        near_drift, far_drift = self.drift, None
        stiffness = self.tangent if self.tangent > 0.0 and is_loading else self.initial_tangent
        drift = near_drift + force_change / stiffness
        for _ in range(_MAX_ITERATIONS):
            trial_force, tangent = self.response_at(drift)
            residual = force - trial_force
            if abs(residual) <= tolerance:
                return drift
            # The condition is true if the force is not reached yet, in the direction of motion.
            if (residual > 0.0) == is_loading:
                if tangent <= 0.0:
                    return None
                near_drift = drift
            else:
                far_drift = drift
            next_drift = drift + residual / tangent if tangent > 0.0 else near_drift
            if far_drift is not None and not min(near_drift, far_drift) < next_drift < max(
                near_drift, far_drift
            ):
                next_drift = 0.5 * (near_drift + far_drift)
            if next_drift == drift:
                return drift
            drift = next_drift
        return None
