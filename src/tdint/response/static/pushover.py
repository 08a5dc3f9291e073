"""Pushover of a building.

A pushover computes the force that pushes a building slowly, over its roof displacement.
The forces on the floors have a constant pattern and a common factor. In a chain, this factor
determines the shears of all stories. The analysis is therefore controlled by the drift of the
softest story at the time. Each other story has the drift where it resists its share of the shear:
it is loaded while the factor increases, and unloaded while the factor decreases. This control
passes through peaks and softening branches and does not need a matrix. If one story softens and the
other stories unload by more than its increment, the roof displacement decreases (snap-back). The
curve is therefore a path and not a function of the roof displacement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tdint.arrays import Array, bisect_interval, immutable
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as rows
from tdint.model.building import (
    Building,
    assemble,
    element_yield_drifts,
    law_columns,
)
from tdint.model.definition import Model
from tdint.model.story_laws import LAWS
from tdint.number_parsing import number_or_nan
from tdint.response.arguments import AnyModel, drift_of, model_of
from tdint.response.static.cyclic import SAME_STIFFNESS, follow_path
from tdint.tabular import Tabular
from tdint.units import DriftSize

MAX_PUSHOVER_POINTS = 100_000  # maximum number of rows; larger tables are hard to open
_FORCE_TOLERANCE = 1e-11  # tolerance of a force, divided by the previous maximum force of the story
# Maximum number of iterations. Newton's method needs up to ten, and 60 bisections of an interval
# reach the rounding errors
_MAX_ITERATIONS = 60
# The usual drift step of the controlling story is the difference of the roof displacement between
# two rows, divided by this number
_STEPS_PER_ROW = 8
# Maximum number of steps per row. Without this maximum, the path would not end if the roof
# displacement is constant, because the other stories unload as fast as the controlling story is
# loaded
_MAX_STEPS_PER_ROW = 4000
# Maximum error of the area below the curve in one step, over the area of a rectangle that encloses
# the curve; a curve with ten yield points then has seven correct digits
_AREA_TOLERANCE = 1e-8
# Minimum drift step divided by the usual step, which limits halving at kinks of a law and reversals
_MIN_STEP_FRACTION = 1e-5
# Maximum number of rows divided by the number of requested points. A path with snap-back has more
# rows than requested, and may never reach the target
_MAX_ROWS_PER_POINT = 20
# Minimum decrease of the roof displacement, divided by its maximum, that is a snap-back and not a
# rounding error
_SNAP_BACK = 1e-9


Excess = Callable[[Array, float], float]
"""Function of the story drifts (m) and the applied force (N) of a state. It returns the excess of a
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
    roof_displacement, base_shear, applied_force : float
        Roof displacement, m, restoring force of the first story and sum of the applied forces, N,
        of the state.
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
    applied_force: float
    stiffness_before: float
    stiffness_after: float


@immutable
class Pushover(Tabular):
    """Result of a pushover; row 0 is the initial state at rest.

    Attributes
    ----------
    model : Model
        Model of the building.
    pattern : str
        Name of the pattern of forces, or its numbers.
    forces : ndarray, shape (n,)
        Pattern, with the sum 1.
    drift : ndarray, shape (rows, n)
        Drifts of the stories, m.
    applied_force : ndarray, shape (rows,)
        Sum of the forces on the floors, N.
    geometric_stiffness : float
        Geometric stiffness of the first story (P-delta), N/m, negative or 0.
    largest_applied_force : float
        Maximum applied force of the complete path, including states between the rows, N.
    drift_at_largest : ndarray, shape (n,)
        Drifts of the stories at the maximum applied force, m.
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
    applied_force: Array
    geometric_stiffness: float
    largest_applied_force: float
    drift_at_largest: Array
    ended: str
    way: tuple[Array, Array]
    events: tuple[ElementEvent, ...] = ()

    def _headline(self) -> str:
        return (
            f"of {self.model.name!r}, {self.pattern} pattern, largest applied force "
            f"{self.largest_applied_force:.4g} N"
        )

    @property
    def base_shear(self) -> Array:
        """Base shear, the restoring force of the first story, N, shape (rows,). It exceeds the
        applied force by the force of P-delta."""
        return np.asarray(self.applied_force - self.geometric_stiffness * self.drift[:, 0])

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
        """Roof displacement at the maximum applied force, m."""
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


def _forces(building: Building, pattern: str) -> Array:
    """Return the forces on the floors for the name of a pattern or numbers for the floors, without
    normalization; raise UsageError if the pattern is neither.
    """
    if pattern in PATTERNS:
        return PATTERNS[pattern](building)
    numbers = np.array([number_or_nan(part) for part in pattern.split(",")])
    if np.isnan(numbers).any():
        raise UsageError(
            f"unknown pattern {pattern!r:.60}; known: {', '.join(PATTERNS)}, or the forces on the "
            "floors from the lowest to the roof, such as 0.2,0.6,1"
        )
    if numbers.size != building.stories:
        raise UsageError(
            f"the pattern must have a force for each of the {building.stories} floors, got "
            f"{numbers.size}"
        )
    if not (numbers.min() >= 0.0 and numbers[-1] > 0.0 and numbers.max() < math.inf):
        raise UsageError(
            "the forces of the pattern must be zero or positive numbers, and positive at the roof, "
            f"got {pattern:.60}"
        )
    return numbers


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
    pattern : str, default "first-mode"
        `first-mode`, `triangular` or `uniform`; or the forces on the floors from the lowest to the
        roof, separated by commas; only their ratios are used.
    points : int
        Number of rows after the start, at equal steps of the roof displacement; default 200. If the
        roof displacement decreases, rows are added at equal steps of the summed changes of all
        story drifts. The rows end if the applied force has decreased to zero, where the building
        would collapse without forces, or if no equilibrium is found (`ended`).

    Returns
    -------
    Pushover
        Roof displacement, applied force, and drifts and shears of the stories at each step.

    Raises
    ------
    UsageError
        The size is a drift ratio or the pattern is triangular, and heights are missing; the size is
        a multiple of a yield drift; or the pattern is unknown.
    ModelError
        The model is invalid.
    AnalysisError
        No equilibrium is found in the first step.
    """
    if not 1 <= points <= MAX_PUSHOVER_POINTS:
        raise UsageError(f"points must be from 1 to {MAX_PUSHOVER_POINTS}, got {points}")
    model = model_of(model)
    model.require_springs("pushover")
    if springs := [link.name for link in model.links if link.spring.stiffness]:
        raise UsageError(
            f"pushover does not support springs between floors ({', '.join(springs)}); use time "
            "histories, or omit these links"
        )
    # Attached masses and dashpots have no static forces; the loads are the loads of the stories.
    building = assemble(replace(model, damping=None, attachments=(), links=()))
    target = _target(drift_of(size), building)
    forces = _forces(building, pattern)
    forces /= forces.sum()
    chain = _Chain(building, forces)
    # The first row is the initial state.
    drift_rows, applied_forces, ended = [np.zeros(building.stories)], [0.0], ""
    reached_points = 0  # number of the requested points that the roof displacement has reached
    while reached_points < points and not ended:
        ended = chain.push(target * (reached_points + 1) / points, target / points)
        # If the path ends between two rows, its last state is the last row.
        if not np.array_equal(chain.drift, drift_rows[-1]):
            drift_rows.append(chain.drift.copy())
            applied_forces.append(chain.applied_force)
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
        np.array(applied_forces),
        float(building.linear_terms[rows.GEOMETRIC, 0]),
        *chain.largest,
        ended,
        chain.path,
        _element_events(model, building, *chain.path),
    )


def _element_events(
    model: Model, building: Building, drifts: Array, applied_forces: Array
) -> tuple[ElementEvent, ...]:
    """Return the changes of stiffness of all elements along the states of a pushover.

    Between two states, the force of a law with linear branches has one kink, at the intersection of
    both branches. A curved law has an event at its yield drift.
    """
    roofs = drifts.sum(axis=1)
    base_shears = applied_forces - building.linear_terms[rows.GEOMETRIC, 0] * drifts[:, 0]
    found: list[tuple[float, ElementEvent]] = []
    columns = law_columns(model.stories)
    for i, story in enumerate(model.stories):
        yield_drifts = element_yield_drifts(story)
        for column, element, yield_drift in zip(
            columns[i], story.elements, yield_drifts, strict=False
        ):
            # A copy, because kernels need contiguous arrays.
            path = follow_path(building, column + 1, drifts[:, i].copy())
            tangents = path.tangent
            if LAWS[element.law.name].curved:
                is_beyond = np.abs(path.drift) >= yield_drift  # False for nan
                states = np.flatnonzero(np.diff(is_beyond.astype(int)) > 0)
            else:
                change = np.abs(np.diff(tangents))
                states = np.flatnonzero(change > SAME_STIFFNESS * np.max(np.abs(tangents)))
            for k in states.tolist():
                step = path.drift[k + 1] - path.drift[k]
                if LAWS[element.law.name].curved:
                    distance = math.copysign(yield_drift, path.drift[k + 1]) - path.drift[k]
                else:
                    excess = path.shear[k + 1] - path.shear[k] - tangents[k + 1] * step
                    distance = excess / (tangents[k] - tangents[k + 1])
                fraction = min(max(distance / step, 0.0), 1.0) if step else 1.0
                drift, roof, shear, applied = (
                    float(values[k] + fraction * (values[k + 1] - values[k]))
                    for values in (path.drift, roofs, base_shears, applied_forces)
                )
                event = ElementEvent(
                    story=i + 1,
                    element=element.name,
                    law=element.law.name,
                    drift=drift,
                    roof_displacement=roof,
                    base_shear=shear,
                    applied_force=applied,
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
        Shear of each story over the applied force; it follows from the pattern of forces.
    largest : tuple of (float, ndarray)
        Maximum applied force of the path up to now, N, and the drifts at this applied force.
    """

    def __init__(self, building: Building, forces: Array) -> None:
        # The shear of a story is the sum of the forces above, from the roof down.
        self.shear_fraction = np.cumsum(forces[::-1])[::-1]
        self.stories = [_Story(building, i) for i in range(building.stories)]
        self.drift = np.zeros(building.stories)
        self.applied_force = 0.0
        self.maximum_roof_displacement = 0.0
        # The path starts at rest. The states of the path are (drifts, applied force).
        self.largest = (0.0, self.drift)
        self._states = [(self.drift, 0.0)]

    @property
    def path(self) -> tuple[Array, Array]:
        """Completed path: drifts, m, shape (points, n), and applied forces, N, shape (points,)."""
        return np.array([drift for drift, _ in self._states]), np.array(
            [applied_force for _, applied_force in self._states]
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
            # with the applied force, or it softens. If another story cannot resist its shear, each
            # other story is tried as the controlling story.
            tangents = np.array([story.tangent for story in self.stories])
            story_indices = np.arange(tangents.size)
            softest = int(np.argmin(tangents / self.shear_fraction))
            for controlling in (softest, *np.delete(story_indices, softest).tolist()):
                if (new_state := self._trial(controlling, drift_step)) is not None:
                    break
            else:
                return "no further equilibrium state was found"
            drift, applied_force = new_state
            # Halve the step if the path bends within it, because the area below the curve would be
            # wrong at a yield point.
            if drift_step > _MIN_STEP_FRACTION * default_step:
                maximum_shear = max(self.largest[0], applied_force)
                area_error = self._area_error(controlling, tangents, drift, applied_force)
                if area_error > _AREA_TOLERANCE * maximum_shear * drift.sum():
                    drift_step *= 0.5
                    continue
            # A negative applied force is not meaningful: the path ends at the state where the base
            # shear is zero.
            if applied_force <= 0.0:
                drift, _ = self._find_state(
                    lambda _, applied_force: -applied_force / self.largest[0],
                    controlling,
                    drift_step,
                    drift,
                    applied_force,
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
                        applied_force,
                    ),
                )
                return ""
            path_length += float(np.abs(drift - self.drift).sum())
            self._accept(controlling, drift, applied_force)
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
        self, controlling: int, tangents: Array, drift: Array, applied_force: float
    ) -> float:
        """Return an estimate of the error of the area below the curve if a step is a straight
        line.
        """
        drift_change, shear_change = drift - self.drift, applied_force - self.applied_force
        # Error of the applied force times change of the roof displacement, plus error of the roof
        # displacement times change of the applied force.
        predicted_shear_change = (
            tangents[controlling] * drift_change[controlling] / self.shear_fraction[controlling]
        )
        area_error = abs(shear_change - predicted_shear_change) * abs(drift_change.sum())
        others = (np.arange(tangents.size) != controlling) & (tangents > 0.0)
        predicted_drifts = shear_change * self.shear_fraction[others] / tangents[others]
        area_error += abs(drift_change[others].sum() - predicted_drifts.sum()) * abs(shear_change)
        return float(area_error)

    def _find_state(
        self,
        excess: Excess,
        controlling: int,
        drift_step: float,
        drift: Array,
        applied_force: float,
    ) -> tuple[Array, float]:
        """Return the drifts and the applied force within a step where a quantity has its value.

        The Illinois algorithm is used (Dowell and Jarratt 1971). The excess is negative at the
        present state and positive at the end of the step.
        """
        lower, upper = 0.0, drift_step
        lower_excess, upper_excess = (
            excess(self.drift, self.applied_force),
            excess(drift, applied_force),
        )
        for _ in range(_MAX_ITERATIONS):
            if abs(excess(drift, applied_force)) <= _FORCE_TOLERANCE:
                break
            # Compute the zero of the secant between both endpoints. After each iteration, the value
            # at the endpoint that is retained is halved. Otherwise the same endpoint could be
            # retained in all iterations, which converges slowly.
            middle = lower + (upper - lower) * lower_excess / (lower_excess - upper_excess)
            trial = self._trial(controlling, middle)
            if trial is None or not lower < middle < upper:
                break
            drift, applied_force = trial
            trial_excess = excess(drift, applied_force)
            if trial_excess > 0.0:
                upper, upper_excess, lower_excess = middle, trial_excess, 0.5 * lower_excess
            else:
                lower, lower_excess, upper_excess = middle, trial_excess, 0.5 * upper_excess
        return drift, applied_force

    def _trial(self, controlling: int, drift_step: float) -> tuple[Array, float] | None:
        """Compute the drifts and the applied force in equilibrium after a drift step of one story,
        without accepting the state; None if another story cannot resist its shear.
        """
        force, _ = self.stories[controlling].response_at(self.drift[controlling] + drift_step)
        applied_force = force / self.shear_fraction[controlling]
        drift = self.drift.copy()
        drift[controlling] += drift_step
        for i, story in enumerate(self.stories):
            if i != controlling:
                story_drift = story.drift_at_force(applied_force * self.shear_fraction[i])
                if story_drift is None:
                    return None
                drift[i] = story_drift
        return drift, applied_force

    def _accept(self, controlling: int, drift: Array, applied_force: float) -> None:
        """Advance all stories to a new state, and update the path and the maximum applied force."""
        # The maximum applied force of the step is at its end, or at the maximum force of the
        # controlling story. If the tangent of the controlling story changes its sign within the
        # step, its maximum force is found by bisection. Item 1 of the result of `response_at` is
        # the tangent.
        story = self.stories[controlling]
        step_to_maximum = float(drift[controlling] - self.drift[controlling])
        maximum_state = (applied_force, drift)
        if story.tangent > 0.0 and story.response_at(float(drift[controlling]))[1] <= 0.0:
            start = self.drift[controlling]
            _, step_to_maximum = bisect_interval(
                lambda step: story.response_at(start + step)[1] > 0.0,
                0.0,
                step_to_maximum,
                _MAX_ITERATIONS,
            )
            state_at_maximum = self._trial(controlling, step_to_maximum)
            if state_at_maximum and state_at_maximum[1] >= applied_force:
                maximum_state = (state_at_maximum[1], state_at_maximum[0])
        self.largest = max(self.largest, maximum_state, key=lambda state: state[0])
        for story, new_drift in zip(self.stories, drift, strict=True):
            story.advance(float(new_drift))
        self.drift, self.applied_force = drift, applied_force
        self._states.append((drift, applied_force))


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
