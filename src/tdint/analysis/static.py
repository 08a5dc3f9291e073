"""Pushover: the base shear of a building that is pushed slowly, over the displacement of its roof.

The forces on the floors keep one pattern and grow and fall together, by one factor. In a chain the
shears of all stories follow from that factor; so a building is led along by the drift of one story,
the softest at the time, and each other story takes the drift at which it carries its share:
forwards while the factor grows, backwards while it falls. That goes through peaks and down falling
branches, and needs no matrix. Where one story falls and the others spring back by more than it goes
on, the roof comes back: the curve is a path, not a function of the roof's displacement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import AnyModel, drift_of, model_of
from tdint.arrays import Array, halved
from tdint.csv_table import read_table
from tdint.errors import AnalysisError, UsageError
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
from tdint.model.building import Building, assemble, variant
from tdint.model.definition import Model
from tdint.tabular import Tabular
from tdint.units import DriftSize
from tdint.written_numbers import how_many

# ---- Cyclic test of a story: its drift law along cycles of given amplitudes. The work behind
# `tdint law`.

MOST_OF_CYCLES = 2_000_000
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
    strain_energy, hysteretic_energy : ndarray
        Energy that the law stores, and that it has dissipated so far, J.
    """

    drift: Array
    shear: Array
    tangent: Array
    strain_energy: Array
    hysteretic_energy: Array


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
    hysteretic_energy : float
        Energy dissipated in the cycle, J.
    """

    number: int
    amplitude: float
    shear: tuple[float, float]
    hysteretic_energy: float

    @property
    def secant_stiffness(self) -> float:
        """Slope between the two points of largest drift, N/m (the effective stiffness of ASCE 7-16,
        17.2-3)."""
        return (self.shear[0] - self.shear[1]) / (2.0 * self.amplitude)

    @property
    def damping_ratio(self) -> float:
        """Equivalent viscous damping ratio E_D / (4 pi E_S0), E_S0 = secant stiffness amplitude^2 /
        2 (Chopra 2012, section 3.9); nan without a positive secant stiffness."""
        strain = 0.5 * self.secant_stiffness * self.amplitude**2
        return self.hysteretic_energy / (4.0 * math.pi * strain) if strain > 0.0 else math.nan


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
        From rest through all cycles, of which `cycle_numbers` tells that of each point; or the path
        given.
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
            f"{how_many(self.path.drift.size, 'point')}"
        )

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
        """Cycle of each point, from 1; 0 for the start. None for a path that is not made of
        cycles."""
        if self.points is None:
            return None
        return -(-np.arange(self.path.drift.size) // (4 * self.points))

    @property
    def shear_with_p_delta(self) -> Array:
        """Restoring force with the geometric stiffness, N: what holds the story against a
        horizontal force."""
        return self.path.shear + self.geometric_stiffness * self.path.drift

    @property
    def cycles(self) -> tuple[Cycle, ...]:
        """The cycles one by one."""
        if self.points is None:
            return ()
        path, points = self.path, self.points
        cycles: list[Cycle] = []
        for first in range(0, path.drift.size - 1, 4 * points):
            # Its largest drifts are at a quarter and at three quarters.
            high, low, last = first + points, first + 3 * points, first + 4 * points
            dissipated = float(path.hysteretic_energy[last] - path.hysteretic_energy[first])
            stored = float(np.max(np.abs(path.strain_energy[first : last + 1])))
            cycles.append(
                Cycle(
                    number=len(cycles) + 1,
                    amplitude=float(path.drift[high]),
                    shear=(float(path.shear[high]), float(path.shear[low])),
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
) -> CyclicTest:
    """Impose cycles of drift on the law of one story, as in a slow test in a laboratory.

    A cycle goes 0, amplitude, 0, -amplitude, 0 in straight lines. There are `cycles` of each
    amplitude, in the order given.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes.
    story : int
        Counted from 1.
    sizes : sequence of DriftSize, str or float
        Amplitudes, such as `0.02`, `2%`, `20mm` or `4dy`; of a number, a drift ratio.
    cycles, points : int
        Cycles of each amplitude; points of a quarter of a cycle.

    Returns
    -------
    CyclicTest
        Drifts and forces along the path, and the energy of each cycle.

    Raises
    ------
    UsageError
        The story does not exist, an amplitude needs what it does not have, or there are too many
        points.
    AnalysisError
        The law has no finite force along the path.
    """
    model = model_of(model)
    _check_story(model, story)
    if len(sizes) * cycles * 4 * points > MOST_OF_CYCLES:
        raise UsageError(
            f"{len(sizes) * cycles} cycles of {4 * points} points are more than {MOST_OF_CYCLES:,} "
            "points"
        )
    # Damping has no part in a slow test, and may be impossible where P-delta takes all stiffness.
    building = assemble(replace(model, damping=None))
    amplitudes = [amplitude(drift_of(size), building, story) for size in sizes]
    return _test(model, building, story, cyclic_path(amplitudes, cycles, points), points)


def path_test(
    model: Model, story: int, drifts: Sequence[float], *, in_yield_drifts: bool = False
) -> CyclicTest:
    """Impose any path of drifts on the law of one story (from 1), straight from rest to the first
    and on to each next.

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
    if not 1 <= len(drifts) <= MOST_OF_CYCLES:
        raise UsageError(f"a path has from 1 to {MOST_OF_CYCLES:,} drifts, got {len(drifts):,}")
    building = assemble(replace(model, damping=None))
    unit = float(building.yield_drift[story - 1]) if in_yield_drifts else 1.0
    if math.isnan(unit):
        raise UsageError(
            f"multiples of the yield drift: the law of story {story} does not yield; give drifts "
            "in m"
        )
    return _test(model, building, story, unit * np.asarray(drifts, float), None)


def _test(
    model: Model, building: Building, story: int, drifts: Array, points: int | None
) -> CyclicTest:
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
    if not 1 <= story <= len(model.stories):
        raise UsageError(
            f"story {story}: the model has {how_many(len(model.stories), 'story')}, counted from 1 "
            "at the bottom"
        )


def amplitude(size: DriftSize, building: Building, story: int) -> float:
    """A drift of one story (from 1) in m.

    Raises
    ------
    UsageError
        A drift ratio without a height, or a multiple of the yield drift of a law that does not
        yield.
    """
    scales = {
        "length": 1.0,
        "ratio": building.heights[story - 1],
        "yield drift": building.yield_drift[story - 1],
    }
    if math.isnan(scales[size.kind]):
        missing = {
            "ratio": f"is a drift ratio, and story {story} has no height",
            "yield drift": f"is a multiple of the yield drift, and the law of story {story} does "
            "not yield",
        }
        raise UsageError(f"drift {size.text} {missing[size.kind]}; give a length, such as 20mm")
    return size.value * float(scales[size.kind])


def cyclic_path(amplitudes: Sequence[float], cycles: int, points: int) -> Array:
    """Drifts of `cycles` cycles of each amplitude with `points` points in each quarter, from 0 to
    0, shape (1 + len(amplitudes) cycles 4 points,)."""
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
    springs = law_state_table(building.law_parameters)
    result = np.empty((drifts.size, RESULT_COLUMNS))
    follow.variant(variant(building))(building.law_parameters, story - 1, drifts, springs, result)
    wrong = np.flatnonzero(~np.all(np.isfinite(result), axis=1))
    if wrong.size:
        raise AnalysisError(
            f"story {story}: its law has no finite force and energy at drift "
            f"{drifts[wrong[0]]:.6g} m"
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
    """The numbers in the column `drift_m` of a CSV file; `-` is standard input, other columns are
    not read.

    Raises
    ------
    UsageError
        The file cannot be read, has no such column, or a cell of it is no finite number.
    """
    table = read_table(
        source, f"give a CSV file with a column {COLUMN}", columns=(COLUMN,), error=UsageError
    )
    if not table.has(COLUMN):
        raise UsageError(f"{source}: the first line names no column {COLUMN}")
    if not table.rows:
        raise UsageError(f"{source}: holds no drift under {COLUMN}")
    return table.numbers(COLUMN)


# ---- Pushover

MOST_PUSHOVER_POINTS = 100_000  # rows of a table that can still be opened
_CLOSE = 1e-11  # of a force over the story's largest one so far: it carries its share
_ITERATIONS = 60  # Newton needs up to ten; halving 60 times leaves rounding alone
_PARTS = 8  # steps of the leading story in a step of the roof
# of them for a row: the roof hardly moves where the others come back as fast as one story goes on
_MOST_PARTS = 4000
_CUT = 1e-8  # of an area, at each yield point: ten of them leave seven digits of it
_LEAST_PART = 1e-5  # of a usual one: the law's own corner, or a story that turns
_MOST_ROWS = 20  # times the points that were asked for, of a path on which the roof comes back
_BACK = 1e-9  # of the roof's largest displacement so far: by more than that it has come back


Miss = Callable[[Array, float], float]
"""How far drifts (m) and a base shear (N) are beyond what is looked for, over its size."""


@dataclass(frozen=True, repr=False)
class Pushover(Tabular):
    """Result of a pushover; row 0 is the start at rest.

    Attributes
    ----------
    model : Model
        The building.
    pattern : str
        Name of the pattern of forces.
    forces : ndarray, shape (n,)
        The pattern, with sum 1.
    drift : ndarray, shape (rows, n)
        Drifts of the stories, m.
    base_shear : ndarray, shape (rows,)
        Sum of the forces, N.
    largest_base_shear : float
        The largest of the whole path, between the rows, too, N.
    drift_at_largest : ndarray, shape (n,)
        Drifts of the stories there, m.
    ended : str
        Why it ends before the displacement that was asked for; empty where it does not.
    way : tuple of ndarray
        The way between the rows: drifts, m, shape (points, n), and base shears, N, shape (points,).
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

    def _headline(self) -> str:
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
        """Height of the building, m; nan where a story has none."""
        return math.fsum(
            story.drift_height or (0.0 if story.isolator else math.nan)
            for story in self.model.stories
        )

    @property
    def roof_drift_ratio(self) -> Array:
        """Roof displacement over the height; nan without heights."""
        return self.roof_displacement / self.height

    @property
    def roof_at_largest(self) -> float:
        """Displacement of the roof at the largest base shear, m."""
        return float(self.drift_at_largest.sum())


def _triangular(building: Building) -> Array:
    if np.isnan(building.rises).any():
        raise UsageError(
            "the triangular pattern needs the height of every story; give heights or another "
            "--pattern"
        )
    return building.mass * np.cumsum(building.rises)


PATTERNS: Mapping[str, Callable[[Building], Array]] = {
    "first-mode": lambda building: building.mass * building.modes().shapes[:, 0],
    "uniform": lambda building: building.mass.copy(),
    "triangular": _triangular,
}
"""Forces on the floors, up to a factor: the masses times first mode, 1, or height above the
ground."""


def pushover(
    model: AnyModel,
    size: DriftSize | str | float,
    *,
    pattern: str = "first-mode",
    points: int = 200,
) -> Pushover:
    """Push a building until its roof has moved by a displacement.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes.
    size : DriftSize, str or float
        Displacement of the roof, as a length or, also as a number, over the building's height.
    pattern : str
        A key of `PATTERNS`.
    points : int
        Rows after the start, at equal steps of the roof displacement, and as many more where the
        roof comes back: there at such steps of the way that all stories go together. They end where
        the base shear has fallen to zero, beyond which the building would fall by itself, or where
        no equilibrium is found (`ended`).

    Returns
    -------
    Pushover
        Roof displacement, base shear and the stories' drifts and shears at each step.

    Raises
    ------
    UsageError
        A drift ratio or the triangular pattern without heights; a multiple of a yield drift; an
        unknown pattern.
    AnalysisError
        No equilibrium is found after the start.
    """
    if pattern not in PATTERNS:
        raise UsageError(f"unknown pattern {pattern!r}; known: {', '.join(PATTERNS)}")
    if not 1 <= points <= MOST_PUSHOVER_POINTS:
        raise UsageError(f"points must be from 1 to {MOST_PUSHOVER_POINTS}, got {points}")
    model = model_of(model)
    building = assemble(replace(model, damping=None))
    target = _target(drift_of(size), building)
    forces = PATTERNS[pattern](building)
    forces /= forces.sum()
    chain = _Chain(building, forces)
    drifts, shears, ended, reached = [np.zeros(building.stories)], [0.0], "", 0
    while reached < points and not ended:
        ended = chain.push(target * (reached + 1) / points, target / points)
        # A way that ends between two rows ends with what was reached.
        if not np.array_equal(chain.drift, drifts[-1]):
            drifts.append(chain.drift.copy())
            shears.append(chain.factor)
        reached = max(reached, math.floor(chain.drift.sum() / target * points + 1e-6))
        if not ended and len(drifts) > _MOST_ROWS * points:
            ended = "the roof displacement decreases and does not reach the target"
    if len(drifts) == 1:
        raise AnalysisError(f"the pushover stops at the first step: {ended}")
    return Pushover(
        model,
        pattern,
        forces,
        np.array(drifts),
        np.array(shears),
        *chain.largest,
        ended,
        chain.passed,
    )


def _target(size: DriftSize, building: Building) -> float:
    scales = {"length": 1.0, "ratio": float(building.rises.sum())}
    if size.kind not in scales:
        raise UsageError(
            f"drift {size.text}: the roof has no yield drift; give a drift ratio or a length"
        )
    if math.isnan(scales[size.kind]):
        raise UsageError(
            f"drift {size.text} is a drift ratio, and a story has no height; give a length, such "
            "as 200mm"
        )
    return size.value * scales[size.kind]


class _Chain:
    """The stories on their way.

    Attributes
    ----------
    drift : ndarray, shape (n,)
        Present drifts, m.
    factor : float
        Present base shear, N.
    furthest : float
        The largest displacement of the roof so far, m.
    largest : tuple of (float, ndarray)
        The largest base shear of the way so far, N, and the drifts there.
    """

    def __init__(self, building: Building, forces: Array) -> None:
        self.share = np.cumsum(forces[::-1])[::-1]
        self.stories = [_Story(building, i) for i in range(building.stories)]
        self.drift = np.zeros(building.stories)
        self.factor = 0.0
        self.furthest = 0.0
        self.largest = (0.0, self.drift)
        self._way = [(self.drift, 0.0)]

    @property
    def passed(self) -> tuple[Array, Array]:
        """The way so far: drifts, m, shape (points, n), and base shears, N, shape (points,)."""
        return np.array([drift for drift, _ in self._way]), np.array(
            [factor for _, factor in self._way]
        )

    def push(self, displacement: float, step: float) -> str:
        """On to the next row; the reason if the way ends before that.

        A row is where the roof has moved by a displacement, or, once it comes back, where the
        stories' ways on and back add up to a step.
        """
        usual, way = step / _PARTS, 0.0
        size = usual
        for _ in range(_MOST_PARTS):
            # A step of the story that moves most as the factor changes, and of one that falls
            # before all others; of another one where that cannot carry its share.
            tangents = np.array([story.tangent for story in self.stories])
            order = np.arange(tangents.size)
            softest = int(np.argmin(tangents / self.share))
            for lead in (softest, *np.delete(order, softest).tolist()):
                if (state := self._trial(lead, size)) is not None:
                    break
            else:
                return "no further equilibrium state was found"
            drift, factor = state
            # Half of it, where the way bends within it: at a yield point the area below the curve
            # would be cut. How much a straight line leaves out or adds follows from how far the
            # state is from where the tangents lead.
            if size > _LEAST_PART * usual:
                moved, grown = drift - self.drift, factor - self.factor
                bent = abs(grown - tangents[lead] * moved[lead] / self.share[lead]) * abs(
                    moved.sum()
                )
                others = (order != lead) & (tangents > 0.0)
                straight = grown * self.share[others] / tangents[others]
                bent += abs(moved[others].sum() - straight.sum()) * abs(grown)
                if bent > _CUT * max(self.largest[0], factor) * drift.sum():
                    size *= 0.5
                    continue
            # The end of the way: exactly where the building carries nothing any more.
            if factor <= 0.0:
                drift, _ = self._meet(
                    lambda _, factor: -factor / self.largest[0], lead, size, drift, factor
                )
                self._keep(lead, drift, 0.0)
                return "no remaining lateral resistance"
            # The next row of a roof that goes on.
            if drift.sum() >= displacement:
                self._keep(
                    lead,
                    *self._meet(
                        lambda drift, _: drift.sum() / displacement - 1.0, lead, size, drift, factor
                    ),
                )
                return ""
            way += float(np.abs(drift - self.drift).sum())
            self._keep(lead, drift, factor)
            self.furthest = max(self.furthest, float(drift.sum()))
            size = min(2.0 * size, usual)
            # The next row of one that comes back.
            if way >= step and drift.sum() < self.furthest * (1.0 - _BACK):
                return ""
        return (
            f"the remaining stories unload as fast as story {lead + 1} deforms; more points may "
            "continue the curve"
        )

    def _meet(
        self, miss: Miss, lead: int, size: float, drift: Array, factor: float
    ) -> tuple[Array, float]:
        """Between here and a step of the leading story with these results, the state that misses
        nothing: by the Illinois algorithm (Dowell and Jarratt 1971). Here a state misses less than
        nothing, there more."""
        low, high = 0.0, size
        below, above = miss(self.drift, self.factor), miss(drift, factor)
        for _ in range(_ITERATIONS):
            if abs(miss(drift, factor)) <= _CLOSE:
                break
            # The secant's point; the end that stays is halved, so that it does not stay for ever.
            middle = low + (high - low) * below / (below - above)
            trial = self._trial(lead, middle)
            if trial is None or not low < middle < high:
                break
            drift, factor = trial
            left = miss(drift, factor)
            if left > 0.0:
                high, above, below = middle, left, 0.5 * below
            else:
                low, below, above = middle, left, 0.5 * above
        return drift, factor

    def _trial(self, lead: int, size: float) -> tuple[Array, float] | None:
        """Drifts and factor after a step of one story; None if another story cannot carry its
        share."""
        force, _ = self.stories[lead].at(self.drift[lead] + size)
        factor = force / self.share[lead]
        drift = self.drift.copy()
        drift[lead] += size
        for i, story in enumerate(self.stories):
            if i != lead:
                carried = story.carrying(factor * self.share[i])
                if carried is None:
                    return None
                drift[i] = carried
        return drift, factor

    def _keep(self, lead: int, drift: Array, factor: float) -> None:
        """Go to these drifts, and note the largest base shear on the way."""
        # It is at the end, or where the leading story stops to rise: the factor follows from its
        # force alone.
        story, high = self.stories[lead], float(drift[lead] - self.drift[lead])
        largest = (factor, drift)
        if story.tangent > 0.0 and story.at(float(drift[lead]))[1] <= 0.0:
            here = self.drift[lead]
            _, high = halved(lambda step: story.at(here + step)[1] > 0.0, 0.0, high, _ITERATIONS)
            top = self._trial(lead, high)
            if top and top[1] >= factor:
                largest = (top[1], top[0])
        self.largest = max(self.largest, largest, key=lambda state: state[0])
        for story, new in zip(self.stories, drift, strict=True):
            story.go(float(new))
        self.drift, self.factor = drift, factor
        self._way.append((drift, factor))


class _Story:
    """One story with P-delta, from rest over the turns of its way to where it stands."""

    def __init__(self, building: Building, i: int) -> None:
        self._building, self._number = building, i + 1
        self._geometric = float(building.linear_terms[rows.GEOMETRIC, i])
        self._turns: list[float] = [0.0]
        self.drift = 0.0
        self.force = 0.0
        self.initial = self.tangent = float(building.initial_stiffness[i])
        self._largest = 0.0

    def at(self, drift: float) -> tuple[float, float]:
        """Force and tangent at a drift, reached straight from here."""
        path = follow_path(
            self._building, self._number, np.array([*self._turns, self.drift, drift])
        )
        return float(path.shear[-1]) + self._geometric * drift, float(
            path.tangent[-1]
        ) + self._geometric

    def go(self, drift: float) -> None:
        """Go to a drift."""
        if drift == self.drift:
            return
        self.force, self.tangent = self.at(drift)
        self._largest = max(self._largest, abs(self.force))
        if (drift - self.drift) * (self.drift - self._turns[-1]) < 0.0:
            self._turns.append(self.drift)
        self.drift = drift

    def carrying(self, force: float) -> float | None:
        """The next drift with this force: forwards for more than now, backwards for less; None if
        there is none."""
        missing = force - self.force
        close = _CLOSE * max(self._largest, abs(force))
        if abs(missing) <= close:
            return self.drift
        forwards = missing > 0.0
        # Newton's method, kept between a drift that carries too little and one that carries too
        # much.
        near, far = self.drift, None
        stiffness = self.tangent if self.tangent > 0.0 and forwards else self.initial
        drift = near + missing / stiffness
        for _ in range(_ITERATIONS):
            here, tangent = self.at(drift)
            left = force - here
            if abs(left) <= close:
                return drift
            if (left > 0.0) == forwards:
                if tangent <= 0.0:
                    return None
                near = drift
            else:
                far = drift
            new = drift + left / tangent if tangent > 0.0 else near
            if far is not None and not min(near, far) < new < max(near, far):
                new = 0.5 * (near + far)
            if new == drift:
                return drift
            drift = new
        return None
