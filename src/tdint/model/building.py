"""Buildings as arrays: the tables that kernels read, the damping, and properties of the linear
system."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property
from tdint.errors import ModelError, UsageError
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import Variant
from tdint.kernels.laws import LAWS as NUMBERED_LAWS
from tdint.kernels.laws import OURS
from tdint.model.definition import (
    CODES,
    DASHPOT,
    HEIGHT,
    LAWS,
    MASS,
    OF_LAW,
    POWER,
    STIFFNESS,
    Force,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
    Story,
    changes_of,
    damped_by,
    story_numbers,
)
from tdint.model.modes import FreeVibration, Modes
from tdint.number_parsing import abbreviate
from tdint.system import memory
from tdint.units import STANDARD_GRAVITY

_TURNS = 5  # iterations towards the fastest mode
_MAX_NAMED = 5  # maximum number of stories named in a message
_POSITIVE = 1e-9  # replaces zero ordinates of a mode; its largest ordinate is 1


@dataclass(frozen=True)
class Building:
    """A chain of n stories, or n oscillators side by side.

    Attributes
    ----------
    linear_terms, law_parameters : ndarray, shapes (LINEAR_TERM_ROWS, n + 1) and (rows, n + 1)
        The tables of `tdint.kernels.layout`; the last column is zero.
    modal : ndarray, shape (modes, n + 1)
        Rows w of the modal damping C = sum of w w^T; no rows without modal damping.
    heights : ndarray, shape (n,)
        Story heights for drift ratios, m; nan for stories without a height and for isolators.
    yield_drift : ndarray, shape (n,)
        Drift at first yield, m; nan for stories that do not yield.
    vibration : FreeVibration
        The undamped vibration of the initial stiffness.
    isolators : tuple of int
        Indices of the isolator stories, counted from 0.
    """

    linear_terms: Array
    law_parameters: Array
    modal: Array
    heights: Array
    yield_drift: Array
    vibration: FreeVibration
    isolators: tuple[int, ...] = ()

    @property
    def rises(self) -> Array:
        """Contribution of each story to the height of the building, m, shape (n,); zero for
        isolators."""
        rises = self.heights.copy()
        rises[list(self.isolators)] = 0.0
        return rises

    @property
    def stories(self) -> int:
        """Number of stories n."""
        return int(self.linear_terms.shape[1]) - 1

    @property
    def mass(self) -> Array:
        """Masses of the floors, kg, shape (n,)."""
        return self.linear_terms[rows.MASS, ..., :-1]

    @property
    def initial_stiffness(self) -> Array:
        """Initial stiffness of the stories, P-delta included, N/m, shape (n,)."""
        return self.law_parameters[rows.STIFFNESS, :-1] + self.linear_terms[rows.GEOMETRIC, :-1]

    @cached_property
    def linear(self) -> bool:
        """True if every story has a linear law and no story has a power-law dashpot."""
        return not self.power_damped and bool(
            np.all(self.law_parameters[rows.CODE, :-1] == CODES["linear"])
        )

    @cached_property
    def power_damped(self) -> bool:
        """True if any story has a power-law dashpot."""
        return bool(np.any(self.linear_terms[rows.POWER_DAMPER, ..., :-1] != 0.0))

    @cached_property
    def damped_by_devices(self) -> bool:
        """True if any story has a dashpot."""
        return self.power_damped or bool(np.any(self.linear_terms[rows.DASHPOT, ..., :-1] != 0.0))

    def device_force(self, rate: Array) -> Array:
        """Return the dashpot forces (N) of the stories at drift rates (m/s), shape (..., n)."""
        if not self.damped_by_devices:
            return np.zeros_like(rate)
        secant = self.linear_terms[rows.DASHPOT, ..., :-1] * np.ones_like(rate)
        size = rate**2 + self.linear_terms[rows.THRESHOLD, ..., :-1]
        power = self.linear_terms[rows.POWER, ..., :-1] * np.ones_like(rate)
        moving = (size > 0.0) & (self.linear_terms[rows.POWER_DAMPER, ..., :-1] != 0.0)
        grown = np.power(size, power, out=np.zeros_like(size), where=moving)
        return np.asarray((secant + self.linear_terms[rows.POWER_DAMPER, ..., :-1] * grown) * rate)

    @cached_property
    def _law_codes(self) -> set[float]:
        """Codes of the laws of all stories."""
        return set(self.law_parameters[rows.CODE, :-1].ravel().tolist())

    @cached_property
    def piecewise_linear(self) -> bool:
        """True if every story has a piecewise linear law."""
        return not any(NUMBERED_LAWS[int(code)].curved for code in self._law_codes)

    @cached_property
    def kinked(self) -> bool:
        """True if any story has a law with a discontinuous tangent."""
        return any(NUMBERED_LAWS[int(code)].kinked for code in self._law_codes)

    @cached_property
    def fastest(self) -> float:
        """Upper bound of the circular frequencies of the initial stiffness, rad/s, within one to
        two percent.

        The stiffness matrix with positive signs throughout has no negative elements and the same
        frequencies. For any positive x the largest eigenvalue is at most the largest
        (M^-1 K x) / x (Collatz 1942), and the bound becomes closer as x approaches the mode.
        """
        return float(_fastest(self.initial_stiffness, self.linear_terms[rows.LINK], self.mass))

    def is_faster_than(self, limit: float, h: float) -> bool:
        """Return True if `fastest` times the time step h (s) exceeds a limit.

        The bound of the first iteration, which only decreases, is sufficient for most buildings.
        """
        return not self._first_bound * h <= limit and self.fastest * h > limit

    @cached_property
    def _first_bound(self) -> float:
        """Result of the first iteration of `fastest`, rad/s."""
        link = self.linear_terms[rows.LINK]
        return float(_fastest(self.initial_stiffness, link, self.mass, 1))

    def stiffness_matrix(self) -> Array:
        """Return the initial stiffness matrix, N/m, shape (n, n)."""
        return _tridiagonal(self.initial_stiffness, self.linear_terms[rows.LINK, :-1])

    def damping_matrix(self) -> Array:
        """Return the damping matrix without power-law dashpots, N s/m, shape (n, n)."""
        stories = _tridiagonal(
            self.linear_terms[rows.STORY_DAMPER, :-1], self.linear_terms[rows.LINK, :-1]
        )
        return (
            stories
            + np.diag(self.linear_terms[rows.FLOOR_DAMPER, :-1])
            + self.modal[:, :-1].T @ self.modal[:, :-1]
        )

    def first_mode(self) -> tuple[float, float]:
        """Return the circular frequency (rad/s) and the damping ratio of the first mode, without
        power-law dashpots.

        The damping ratio is computed from the diagonal of the modal damping matrix.
        """
        return self._first_mode

    @property
    def first_period(self) -> float:
        """Period of the first mode, s."""
        return 2.0 * math.pi / self.first_mode()[0]

    @cached_property
    def _first_mode(self) -> tuple[float, float]:
        """Result of `first_mode`."""
        omega, shape = self.vibration.first
        drift = np.diff(shape, prepend=0.0)
        work = np.sum(self.linear_terms[rows.STORY_DAMPER, :-1] * drift**2) + np.sum(
            self.linear_terms[rows.FLOOR_DAMPER, :-1] * shape**2
        )
        work += np.sum((self.modal[:, :-1] @ shape) ** 2)
        return omega, float(work / (2.0 * omega))

    def modes(self) -> Modes:
        """Return the undamped modes of the initial stiffness; they are computed at the first
        call."""
        return self.vibration.modes


def _fastest(stiffness: Array, link: Array, mass: Array, turns: int = _TURNS) -> Array:
    """Return `Building.fastest` of one or more buildings, shape (..., n); `link` has an additional
    column.

    Parameters
    ----------
    stiffness : array, shape (..., n)
        Story stiffness, N/m; its absolute value is used.
    link : array, shape (n + 1,)
        1 for a story on the floor below, 0 for a story on the ground, and an additional last
        element.
    mass : array, shape (..., n)
        Mass of each floor, kg.
    turns : int
        Number of iterations.
    """
    springs = np.concatenate([np.abs(stiffness), np.zeros((*stiffness.shape[:-1], 1))], axis=-1)
    below, above = link[:-1] * springs[..., :-1], link[1:] * springs[..., 1:]
    shape = np.ones(stiffness.shape)
    bound = np.full(stiffness.shape[:-1], math.inf)
    for _ in range(turns):
        turned = (springs[..., :-1] + above) * shape
        turned[..., 1:] += below[..., 1:] * shape[..., :-1]
        turned[..., :-1] += above[..., :-1] * shape[..., 1:]
        turned /= mass
        bound = np.minimum(bound, np.max(turned / shape, axis=-1))
        shape = turned / np.max(turned, axis=-1, keepdims=True) + _POSITIVE
    return np.asarray(np.sqrt(bound))


def _tridiagonal(springs: Array, link: Array) -> Array:
    """Return the matrix of springs between neighboring floors; spring i connects floors i and
    i - 1 (the ground if link is 0)."""
    coupling = -(springs * link)[1:]
    diagonal = springs.copy()
    diagonal[:-1] -= coupling
    return np.diag(diagonal) + np.diag(coupling, 1) + np.diag(coupling, -1)


def assemble(model: Model) -> Building:
    """Assemble the arrays of the building of a model.

    Raises
    ------
    ModelError
        P-delta exceeds the stiffness of a story.
    """
    stories = model.stories
    n = len(stories)
    # The last column belongs to a fictitious story above the roof and remains zero.
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, n + 1))
    linear_terms[rows.MASS, :n] = [story.mass for story in stories]
    linear_terms[rows.INVERSE_MASS, :n] = 1.0 / linear_terms[rows.MASS, :n]
    linear_terms[rows.STORY_DAMPER, :n] = linear_terms[rows.DASHPOT, :n] = [
        story.dashpot for story in stories
    ]
    for i, story in enumerate(stories):
        # Dashpot force c v (v^2 + v0^2)^POWER with the drift rate v: the power applies to a squared
        # rate, which is never negative, so POWER is half of the exponent minus 1.
        if (dashpot := story.power_dashpot) is not None:
            linear_terms[rows.POWER_DAMPER, i] = dashpot.coefficient
            linear_terms[rows.POWER, i] = 0.5 * (dashpot.exponent - 1.0)
            linear_terms[rows.THRESHOLD, i] = dashpot.linear_below**2
    # The first story is on the ground: its force acts on no floor below.
    linear_terms[rows.LINK, 1:n] = 1.0
    heights = np.array(
        [math.nan if story.drift_height is None else story.drift_height for story in stories]
    )
    if model.p_delta:
        linear_terms[rows.GEOMETRIC, :n] = -weight_over_height(model)
    # The law with the most parameters determines the number of rows.
    table_rows = max(len(story.law.parameters) for story in stories)
    law_parameters = np.zeros((rows.FIRST_PARAMETER + table_rows, n + 1))
    yield_drift = np.empty(n)
    for i, story in enumerate(stories):
        values = story.law.parameters
        law = LAWS[story.law.name]
        law_parameters[rows.CODE, i] = CODES[story.law.name]
        law_parameters[rows.STIFFNESS, i] = story.stiffness
        law_parameters[rows.FIRST_PARAMETER : rows.FIRST_PARAMETER + len(values), i] = values
        yield_drift[i] = law.yield_drift(story.stiffness, values)
    # The vibration includes P-delta, which reduces the stiffness.
    vibration = FreeVibration(
        linear_terms[rows.MASS, :n],
        law_parameters[rows.STIFFNESS, :n] + linear_terms[rows.GEOMETRIC, :n],
        linear_terms[rows.LINK, :n],
        linear_terms[rows.GEOMETRIC, :n],
    )
    isolators = tuple(i for i, story in enumerate(stories) if story.isolator)
    modal = add_damping(linear_terms, law_parameters[rows.STIFFNESS, :n], model, vibration)
    return Building(linear_terms, law_parameters, modal, heights, yield_drift, vibration, isolators)


@dataclass(frozen=True)
class DrawnBuildings:
    """Random samples of a building that differ in numbers only, as arrays with the samples on the
    first axis.

    Attributes
    ----------
    base : Building
        The building that was varied.
    linear_terms, law_parameters : ndarray, shape (draws, rows, n + 1)
        Tables of each sample, as in `Building`.
    modal : sequence of ndarray
        Rows of the modal damping of each sample, as in `Building`.
    heights, yield_drift : ndarray, shape (draws, n)
        Story heights and yield drifts of each sample, as in `Building`.
    """

    base: Building
    linear_terms: Array
    law_parameters: Array
    modal: Sequence[Array]
    heights: Array
    yield_drift: Array

    @property
    def mass(self) -> Array:
        """Masses of the floors, kg, shape (draws, n)."""
        return self.linear_terms[:, rows.MASS, :-1]

    @property
    def fastest(self) -> Array:
        """`Building.fastest` of each sample, shape (draws,)."""
        stiffness = (
            self.law_parameters[:, rows.STIFFNESS, :-1] + self.linear_terms[:, rows.GEOMETRIC, :-1]
        )
        return _fastest(stiffness, self.base.linear_terms[rows.LINK], self.mass)

    def of_runs(self, draws: Sequence[int]) -> Building:
        """Return the building arrays of runs, selected by the sample of each run.

        The shape of the linear terms and law parameters is (rows, runs, n + 1); heights and yield
        drifts have the shape (runs, n).
        """
        return replace(
            self.base,
            linear_terms=np.moveaxis(self.linear_terms[draws], 0, 1),
            law_parameters=np.moveaxis(self.law_parameters[draws], 0, 1),
            heights=self.heights[draws],
            yield_drift=self.yield_drift[draws],
        )

    @property
    def with_devices(self) -> NDArray[np.bool_]:
        """`Building.damped_by_devices` of each sample, shape (draws,)."""
        both = self.linear_terms[:, [rows.DASHPOT, rows.POWER_DAMPER], :-1]
        return np.asarray(np.any(both != 0.0, axis=(1, 2)))


def draw_buildings(model: Model, base: Building, values: Mapping[str, Array]) -> DrawnBuildings:
    """Assemble the buildings of all samples at once, bitwise equal to those of `Model.changed`.

    Parameters
    ----------
    model : Model
        The model that is varied.
    base : Building
        The building of the unchanged model.
    values : mapping of str to ndarray, shape (draws,)
        Values of parameters by name (`Model.replace`); nan if a sample does not change the
        parameter.

    Raises
    ------
    UsageError
        A value is out of range, or the parameters of a story are invalid with the value.
    ModelError
        P-delta exceeds the stiffness of a story.
    """
    draws, n = len(next(iter(values.values()))), base.stories
    # Store the changed numbers by story and column; all other columns are those of the base.
    numbers = [list(story_numbers(story)) for story in model.stories]
    drawn: dict[tuple[int, int], Array] = {}
    set_laws = set()
    for name, given in values.items():
        for change in changes_of(model, name):
            place = change.story, change.column
            before = drawn.get(place, numbers[change.story][change.column])
            # nan marks samples that do not change the number.
            drawn[place] = np.where(
                np.isnan(given), before, before * given if change.factor else given
            )
            set_laws |= {change.story} if change.of_law else set()
    # Some laws define the initial stiffness by their parameters: compute it again.
    for i in set_laws:
        if stiffness_of := LAWS[model.stories[i].law.name].initial_stiffness:
            columns = [drawn.get((i, c), numbers[i][c]) for c in range(OF_LAW, len(numbers[i]))]
            table_rows = np.stack([np.broadcast_to(column, draws) for column in columns], axis=1)
            drawn[i, STIFFNESS] = np.array([stiffness_of(row) for row in table_rows.tolist()])

    # Copy the tables of the base and insert the changed numbers.
    linear_terms = np.repeat(base.linear_terms[None], draws, axis=0)
    law_parameters = np.repeat(base.law_parameters[None], draws, axis=0)
    heights = np.repeat(base.heights[None], draws, axis=0)
    yield_drift = np.repeat(base.yield_drift[None], draws, axis=0)
    for (i, column), row in drawn.items():
        if column >= OF_LAW:
            law_parameters[:, rows.FIRST_PARAMETER + column - OF_LAW, i] = row
        elif column == STIFFNESS:
            law_parameters[:, rows.STIFFNESS, i] = row
        elif column == HEIGHT and not model.stories[i].isolator:
            heights[:, i] = row
        elif column in _TERMS:
            linear_terms[:, _TERMS[column], i] = row
        elif column == POWER.start + 1:
            linear_terms[:, rows.POWER, i] = 0.5 * (row - 1.0)
        elif column == POWER.start + 2:
            linear_terms[:, rows.THRESHOLD, i] = [
                speed**2 for speed in row.tolist()
            ]  # the square of NumPy can differ in the last bit
    linear_terms[:, rows.INVERSE_MASS, :n] = 1.0 / linear_terms[:, rows.MASS, :n]
    linear_terms[:, rows.STORY_DAMPER, :n] = linear_terms[:, rows.DASHPOT, :n]
    linear_terms[:, rows.FLOOR_DAMPER, :n] = 0.0
    if model.p_delta:
        tall = [
            np.broadcast_to(drawn.get((i, HEIGHT), numbers[i][HEIGHT]), draws) for i in range(n)
        ]
        weight = (
            STANDARD_GRAVITY * np.cumsum(linear_terms[:, rows.MASS, :n][:, ::-1], axis=1)[:, ::-1]
        )
        linear_terms[:, rows.GEOMETRIC, :n] = -(weight / np.stack(tall, axis=1))
    for i in {i for i, column in drawn if column == STIFFNESS or column >= OF_LAW}:
        law, parameters = LAWS[model.stories[i].law.name], len(model.stories[i].law.parameters)
        table_rows = law_parameters[
            :, [rows.STIFFNESS, *range(rows.FIRST_PARAMETER, rows.FIRST_PARAMETER + parameters)], i
        ]
        for d, (stiffness, *of_law) in enumerate(table_rows.tolist()):
            if fault := law.fault(stiffness, of_law):
                raise UsageError(
                    f"{model.name}: invalid variation of story {i + 1}: {fault} (draw {d + 1})"
                )
            yield_drift[d, i] = law.yield_drift(stiffness, of_law)

    # Damping depends on masses and stiffnesses; if neither changes, the vibration of the base
    # applies.
    moved = any(
        column in (MASS, STIFFNESS) or (column == HEIGHT and model.p_delta) for _, column in drawn
    )
    damped = [model.damping] * draws
    if "damping" in values:
        ratios = values["damping"].tolist()
        damped = [
            model.damping if math.isnan(ratio) else damped_by(model, ratio) for ratio in ratios
        ]
    modal, vibration = [], base.vibration
    for d in range(draws):
        if moved:
            springs = law_parameters[d, rows.STIFFNESS, :n] + linear_terms[d, rows.GEOMETRIC, :n]
            vibration = FreeVibration(
                linear_terms[d, rows.MASS, :n], springs, linear_terms[d, rows.LINK, :n]
            )
        stiffness = law_parameters[d, rows.STIFFNESS, :n]
        of_draw = replace(model, damping=damped[d]) if "damping" in values else model
        modal.append(add_damping(linear_terms[d], stiffness, of_draw, vibration))
    return DrawnBuildings(base, linear_terms, law_parameters, modal, heights, yield_drift)


_TERMS = {MASS: rows.MASS, DASHPOT: rows.DASHPOT, POWER.start: rows.POWER_DAMPER}
"""Rows of the linear terms by column of the story numbers."""


def weight_over_height(model: Model) -> Array:
    """Return the weight above each story divided by its height, N/m, shape (n,).

    P-delta reduces the stiffness by this value.
    """
    mass = np.array([story.mass for story in model.stories])
    heights = np.array(
        [math.nan if story.height is None else story.height for story in model.stories]
    )
    return np.asarray(STANDARD_GRAVITY * np.cumsum(mass[::-1])[::-1] / heights)


def falling_stories(model: Model) -> tuple[str, ...]:
    """Return the message on stories that P-delta makes unstable after yield.

    The weight over height of such a story exceeds the post-yield stiffness of its law.
    """
    if not model.p_delta:
        return ()
    # Story stiffnesses are easiest to read in MN/m.
    unit, size = model.output_units.unit("N/m")
    unit, size = ("MN/m", 1e6) if unit == "N/m" else (unit, size)
    places = []
    for i, (story, taken) in enumerate(
        zip(model.stories, weight_over_height(model), strict=True), start=1
    ):
        left = stiffness_after_yield(story)
        if taken > left:
            places.append(f"story {i}: {taken / size:.4g} of {left / size:.4g}")
    if not places:
        return ()
    return (
        "P-delta reduces the stiffness after yield below zero, so that a story that yields may "
        f"collapse; weight over height, and stiffness after yield, {unit}: "
        f"{abbreviate(places, _MAX_NAMED)}",
    )


def stiffness_after_yield(story: Story) -> float:
    """Return the post-yield stiffness of a story before softening, N/m; infinite for a law that
    does not yield."""
    rule = _AFTER_YIELD.get(story.law.name)
    if rule is None:
        return math.inf
    names = [parameter.name for parameter in LAWS[story.law.name].parameters]
    return rule(story.stiffness, dict(zip(names, story.law.parameters, strict=True)))


def _hardening(stiffness: float, law: Mapping[str, float]) -> float:
    return law["hardening"] * stiffness


def _to_ultimate(stiffness: float, law: Mapping[str, float]) -> float:
    rise, way = (
        law["ultimate_force"] - law["yield_force"],
        law["ultimate_drift"] - law["yield_force"] / stiffness,
    )
    return rise / way if way > 0.0 else 0.0


def _to_capping(stiffness: float, law: Mapping[str, float]) -> float:
    return (law["capping_ratio"] - 1.0) * law["yield_force"] / law["plastic_drift"]


_AFTER_YIELD: dict[str, Callable[[float, Mapping[str, float]], float]] = {
    "bilinear": _hardening,
    "bouc-wen": _hardening,
    "peak-oriented": _hardening,
    "trilinear-pinching": _to_ultimate,
    "imk": _to_capping,
    "tanh": lambda stiffness, law: 0.0,
}


def oscillators(omega: Array, damping: Array) -> Building:
    """Assemble independent linear oscillators of unit mass, u'' + 2 xi omega u' + omega^2 u = p.

    Parameters
    ----------
    omega, damping : ndarray, shape (k,)
        Circular frequencies (rad/s) and damping ratios.
    """
    omega, damping = np.broadcast_arrays(np.asarray(omega, float), np.asarray(damping, float))
    k = omega.size
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, k + 1))
    linear_terms[rows.MASS, :k] = 1.0
    linear_terms[rows.INVERSE_MASS, :k] = 1.0
    linear_terms[rows.STORY_DAMPER, :k] = 2.0 * damping * omega
    law_parameters = np.zeros((rows.FIRST_PARAMETER, k + 1))
    law_parameters[rows.CODE, :k] = CODES["linear"]
    law_parameters[rows.STIFFNESS, :k] = omega**2
    unknown = np.full(k, math.nan)
    vibration = FreeVibration(
        linear_terms[rows.MASS, :k], law_parameters[rows.STIFFNESS, :k], linear_terms[rows.LINK, :k]
    )
    return Building(linear_terms, law_parameters, np.zeros((0, k + 1)), unknown, unknown, vibration)


def force_table(forces: Sequence[Force]) -> NDArray[np.float64]:
    """Return a table with a row per force: floor (counted from 0), cosine and sine amplitude (N),
    omega (rad/s)."""
    table = np.zeros((len(forces), rows.FORCE_COLUMNS))
    for row, force in zip(table, forces, strict=True):
        row[:] = force.floor - 1, force.cosine, force.sine, force.omega
    return table


def variant(building: Building, forces: Array | None = None) -> Variant:
    """Return the kernel variant for a building; `forces` is the force table, default no forces."""
    codes = {CODES["linear"], *building.law_parameters[rows.CODE, :-1].tolist()}
    names = (
        name if code < OURS else f"{name}@{code}" for name, code in CODES.items() if code in codes
    )
    return Variant(
        laws=tuple(names),
        modal=len(building.modal) > 0,
        forces=forces is not None and len(forces) > 0,
        dashpots=building.damped_by_devices,
    )


_TABLES = 4  # matrices of shape (stories, stories) in memory during the solution for all modes


def add_damping(
    linear_terms: Array, stiffness: Array, model: Model, vibration: FreeVibration
) -> Array:
    """Add the damping of the model to `linear_terms`; return the rows of the modal damping, shape
    (modes, n + 1).

    Rayleigh damping is C = a0 M + a1 K with the initial stiffness K without P-delta: a damper from
    each floor to the ground and a damper parallel to each story. Modal damping is
    C = sum 2 xi omega (M phi)(M phi)^T over mass-normalized modes phi.

    Parameters
    ----------
    linear_terms : ndarray, shape (LINEAR_TERM_ROWS, n + 1)
        Table of linear terms; the damper rows are modified.
    stiffness : ndarray, shape (n,)
        Initial stiffness of the stories without P-delta, N/m.
    model : Model
        The model that specifies the damping.
    vibration : FreeVibration
        Undamped vibration of the building.

    Raises
    ------
    ModelError
        Modal damping of the stories requires more memory than is available.
    """
    n = linear_terms.shape[1] - 1
    damping = model.damping
    if isinstance(damping, ModalDamping):
        # All modes are computed at once; check that the memory is sufficient.
        needed, available = _TABLES * 8 * n**2, memory()
        if available is not None and needed > available:
            raise ModelError(
                f"modal damping of {n} stories requires {needed / 2**30:.0f} GiB of memory, "
                f"and this machine has {available / 2**30:.0f} GiB; use damping.rayleigh"
            )
        modes, ratios = vibration.modes, np.array(damping.ratios)
        # Rows sqrt(2 xi omega) M phi; a single ratio applies to all modes, several ratios to the
        # first modes.
        if ratios.size == 1:
            ratios = np.full(n, ratios[0])
        damped = np.flatnonzero(ratios)
        factors = np.sqrt(2.0 * ratios[damped] * modes.omega[damped])
        table_rows = np.zeros((damped.size, n + 1))
        table_rows[:, :-1] = (
            linear_terms[rows.MASS, :n, None] * modes.shapes[:, damped] * factors
        ).T
        return table_rows
    # Convert ratios to coefficients with the frequencies of this building.
    if isinstance(damping, RayleighRatio):
        damping = rayleigh(damping, *(vibration.frequency(mode) for mode in damping.modes))
    if damping is not None and not all(story.rayleigh for story in model.stories):
        return _without_isolators(linear_terms, stiffness, model, damping)
    if damping is not None:
        linear_terms[rows.FLOOR_DAMPER, :n] += damping.mass * linear_terms[rows.MASS, :n]
        linear_terms[rows.STORY_DAMPER, :n] += damping.stiffness * stiffness
    return np.zeros((0, n + 1))


def _without_isolators(
    linear_terms: Array, stiffness: Array, model: Model, damping: RayleighCoefficients
) -> Array:
    """Add Rayleigh damping that excludes isolators; return the rows w of C = sum w w^T, shape
    (rows, n + 1).

    Stiffness-proportional dampers act only in the other stories. Mass-proportional dampers act on
    the motion relative to the floor on top of the isolator below. Dampers to the ground would also
    damp the isolators.

    Parameters
    ----------
    linear_terms : array, shape (rows, n + 1)
        Linear terms of the building; its dampers are changed by this function.
    stiffness : array, shape (n,)
        Initial stiffness of each story, N/m.
    model : Model
        Model, which specifies the stories with Rayleigh damping.
    damping : RayleighCoefficients
        Coefficients of the mass and of the stiffness.
    """
    n = linear_terms.shape[1] - 1
    reached = np.array([story.rayleigh for story in model.stories])
    linear_terms[rows.STORY_DAMPER, :n] += np.where(reached, damping.stiffness * stiffness, 0.0)
    mass = linear_terms[rows.MASS, :n]
    on_ground = np.cumsum(~reached) == 0
    linear_terms[rows.FLOOR_DAMPER, :n] += np.where(on_ground, damping.mass * mass, 0.0)
    table_rows = []
    base = 0
    for floor in range(n):
        if not reached[floor]:
            base = floor
        elif not on_ground[floor] and damping.mass > 0.0:
            row = np.zeros(n + 1)
            row[floor], row[base] = 1.0, -1.0
            table_rows.append(np.sqrt(damping.mass * mass[floor]) * row)
    return np.array(table_rows).reshape(len(table_rows), n + 1)


def rayleigh(ratio: RayleighRatio, omega_1: float, omega_2: float) -> RayleighCoefficients:
    """Compute the coefficients from two ratios: xi = a0 / (2 omega) + a1 omega / 2 (Chopra 2012,
    eq. 11.4.8).

    For a single mode, mass and stiffness contribute half of the damping each. This is the limit of
    equal ratios as the frequencies of the two modes approach each other.

    Parameters
    ----------
    ratio : RayleighRatio
        Damping ratios and numbers of the two modes.
    omega_1, omega_2 : float
        Circular frequencies of the two modes, rad/s.
    """
    xi_1, xi_2 = ratio.ratios
    if ratio.modes[0] == ratio.modes[1]:
        return RayleighCoefficients(mass=xi_1 * omega_1, stiffness=xi_1 / omega_1)
    difference = omega_2**2 - omega_1**2
    if not 0.0 < abs(difference) < math.inf:
        raise ModelError(
            "damping: the frequencies of two modes cannot be computed: masses or stiffnesses "
            "differ by too many orders of magnitude; check their units"
        )
    return RayleighCoefficients(
        mass=2.0 * omega_1 * omega_2 * (xi_1 * omega_2 - xi_2 * omega_1) / difference,
        stiffness=2.0 * (xi_2 * omega_2 - xi_1 * omega_1) / difference,
    )
