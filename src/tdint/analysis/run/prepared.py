"""A building put together once, under its forces and from its initial state, to be integrated any number of times: the
one place that calls the compiled time loop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from tdint.analysis.run.amplification import Instability, find_instability
from tdint.analysis.run.steps import Steps
from tdint.analysis.run.workspace import (
    HALVINGS,
    Workspace,
    check_suited,
    doubled_laws,
    history_width,
    kernels,
    shifts,
    workspace,
)
from tdint.arrays import Array
from tdint.ground_motion.record import Record
from tdint.kernels import layout as at
from tdint.kernels.building.compilable import Variant
from tdint.kernels.building.obtaining import obtain
from tdint.kernels.bundles import Memory, Scene
from tdint.kernels.march.law_energies import begin, raise_shears, take_stock
from tdint.kernels.march.many import END_COLUMNS, many
from tdint.kernels.march.march import march
from tdint.kernels.march.strides import ALLOWED, DRIFTS, FASTEST, PERIOD, march_in_strides
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble, force_table, variant
from tdint.model.definition import Model

_RESOLVED = 2.5  # omega dt of the fastest mode, bounded from above, up to which a step is taken to follow all modes
_PIECE = 0.1  # s
_FIRST_PIECE = 100_000  # steps times stories, and as much for each modally damped mode
_PIECE_BYTES = 2**23  # of a piece of a history
_KEPT = 4  # sets of coefficients that are kept: a run, its two repetitions with smaller steps, one more


Loop = Callable[[Steps, int, int], int]
"""Takes all steps, and from which of them on to go on until which; gives 0 or the code of the step that failed."""


@dataclass(frozen=True)
class Marched:
    """What a march left: its arrays, 0 or the code of the step that failed, and the wall time of the time loop, s."""

    space: Workspace
    code: int
    seconds: float


class Lane(NamedTuple):
    """One of many runs: where in all samples its ground motion begins, how many those are, the factor on them, and its
    steps."""

    start: int
    size: int
    scale: float
    steps: Steps


@dataclass(frozen=True)
class Motions:
    """Ground motions by their numbers, as compiled runs take them.

    Attributes
    ----------
    records : mapping of int to Record
        The motions.
    samples : ndarray
        The accelerations of all, one after the other, m/s^2.
    starts : mapping of int to int
        Where each begins in `samples`.
    """

    records: Mapping[int, Record]
    samples: Array
    starts: Mapping[int, int]

    @classmethod
    def of(cls, records: Mapping[int, Record]) -> Motions:
        """Put some motions one after the other."""
        sizes = [record.acceleration.size for record in records.values()]
        starts = np.concatenate([[0], np.cumsum(sizes)])[:-1].astype(int).tolist()
        samples = np.concatenate([record.acceleration for record in records.values()])
        return cls(records, samples, dict(zip(records, starts, strict=True)))

    def lane(self, number: int, scale: float, steps: Steps) -> Lane:
        """A run under one of them, times a factor."""
        return Lane(self.starts[number], self.records[number].acceleration.size, scale, steps)


@dataclass(frozen=True)
class MarchedRuns:
    """What many marches left; arrays over the runs first.

    Attributes
    ----------
    peaks : ndarray, shape (runs, 2 PEAK_ROWS, n)
        As `Workspace.peaks`.
    drifts : ndarray, shape (runs, n)
        At the end, m.
    totals : ndarray, shape (runs, TOTALS_SIZE)
        As `Workspace.totals`.
    ends : ndarray, shape (runs, END_COLUMNS)
        The columns of `tdint.kernels.march.many`: code, steps taken, whether at rest.
    """

    peaks: Array
    drifts: Array
    totals: Array
    ends: Array

    @classmethod
    def empty(cls, runs: int, stories: int) -> MarchedRuns:
        """Room for so many runs."""
        return cls(
            peaks=np.zeros((runs, 2 * at.PEAK_ROWS, stories)),
            drifts=np.zeros((runs, stories)),
            totals=np.zeros((runs, at.TOTALS_SIZE)),
            ends=np.zeros((runs, END_COLUMNS)),
        )


@dataclass(frozen=True)
class Rest:
    """How long many marches go on after their steps with the ground at rest; not at all by default.

    Attributes
    ----------
    window, windows : int
        Steps of a window, and the most windows.
    quiet : float
        Largest velocity of a floor in a window, over the largest displacement of the run, at which it ends, 1/s.
    """

    window: int = 1
    windows: int = 0
    quiet: float = 0.0


@dataclass(frozen=True)
class PreparedBuilding:
    """A building as arrays, the forces on its floors and its state at t = 0; each march is given the ground's motion.

    What follows from these alone is found once and kept: the modes, the method's coefficients for a step, whether a
    step is stable. One of these serves any number of ground motions, of scales of them, and of threads.

    Attributes
    ----------
    building : Building
        The building.
    forces : ndarray, shape (forces, FORCE_COLUMNS)
        Forces on floors, as `force_table` makes them; none by default.
    displacement, velocity : ndarray, shape (n,)
        At t = 0 relative to the ground, m and m/s; at rest by default.
    """

    building: Building
    forces: Array = field(default_factory=lambda: np.zeros((0, at.FORCE_COLUMNS)))
    displacement: Array | float = 0.0
    velocity: Array | float = 0.0
    _coefficients: dict[tuple[str, float], Array] = field(default_factory=dict, init=False, repr=False, compare=False)
    _instability: dict[tuple[str, float], Instability | None] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @classmethod
    def of(cls, model: Model) -> PreparedBuilding:
        """The building of a model, its forces and its initial state.

        Raises
        ------
        ModelError
            P-delta larger than a story's stiffness.
        """
        return cls(
            assemble(model),
            force_table(model.excitation.forces),
            np.array(model.initial.displacement),
            np.array(model.initial.velocity),
        )

    @cached_property
    def variant(self) -> Variant:
        """What the kernels need for the building."""
        return variant(self.building, self.forces)

    @cached_property
    def period(self) -> float:
        """First period of the initial stiffness, s."""
        return 2.0 * math.pi / self.building.vibration.frequency(1)

    def compile(self, integrators: Iterable[Integrator], progress: Callable[[float], None] = lambda part: None) -> None:
        """Load what marches with these methods call, compiled if it is not yet: before a clock starts.

        Parameters
        ----------
        progress : callable
            Told how much is done, from 0 to 1.
        """
        obtain([one for integrator in integrators for one in kernels(integrator, self.variant)], progress)

    def coefficients(self, integrator: Integrator, h: float) -> Array:
        """Coefficients of the method's step for this building and the step h (s)."""
        key = (integrator.label, h)
        kept = self._coefficients.get(key)
        if kept is None:
            kept = integrator.coefficients(self.building, self.forces, h)
            while len(self._coefficients) >= _KEPT:
                self._coefficients.pop(next(iter(self._coefficients)), None)
            self._coefficients[key] = kept
        return kept

    def instability(self, integrator: Integrator, h: float) -> Instability | None:
        """The stiffest of the modes in the initial state that a step h (s) is too long for, None if it is stable.

        Modes are solved for a method that has a limit, and once.
        """
        if integrator.stability_limit == math.inf:
            return None
        key = (integrator.label, h)
        if key not in self._instability:
            modes = self.building.modes()
            damping = np.diagonal(modes.modal_damping(self.building.damping_matrix())) / (2.0 * modes.omega)
            self._instability[key] = find_instability(integrator, modes.omega, damping, h)
        return self._instability[key]

    def march(
        self,
        integrator: Integrator,
        steps: Steps,
        ground: Array | None = None,
        *,
        rows: int = 0,
        collapse_drift: float = math.inf,
    ) -> Marched:
        """Integrate from the initial state over the steps.

        Parameters
        ----------
        ground : ndarray, shape (samples,), optional
            Ground acceleration at the samples, m/s^2; linear between them and zero after the last one. None is ground
            at rest.
        rows : int
            Steps of the history that is kept, of which `steps` are a whole multiple; 0 for none.
        collapse_drift : float
            Drift ratio beyond which a story has collapsed: when one first is, is noted.

        Raises
        ------
        AnalysisError
            The method does not integrate this building; the memory does not hold the history.
        ValueError
            The steps are no whole multiple of those of the history.
        """
        if rows and steps.count % rows:
            raise ValueError(f"{steps.count} steps do not fit into a history of {rows}")
        space = self._ready(integrator, steps.h, rows + 1 if rows else 0, collapse_drift)
        space.every = steps.count // rows if rows else 1
        if steps.bound:
            obtain([(march_in_strides, self.variant)])
            space.choice = np.zeros(DRIFTS + self.building.stories)
            space.choice[FASTEST] = self.building.fastest * steps.h / _RESOLVED
            space.choice[ALLOWED], space.choice[PERIOD] = steps.bound.allowed, self.period
            space.choice[DRIFTS:] = steps.bound.drifts
        go = self.loop(integrator, steps.h, np.zeros(1) if ground is None else ground, space)
        began = time.perf_counter()
        code = self._in_pieces(go, steps)
        return Marched(space, code, time.perf_counter() - began)

    def march_pieces(
        self, integrator: Integrator, steps: Steps, ground: Array | None, *, every: int
    ) -> Iterator[Workspace]:
        """Integrate as `march` does, and see the history in pieces, a row every so many steps.

        Yields
        ------
        Workspace
            With a history of its own, of which `before` rows stand before; no piece of a run that failed in it.

        Raises
        ------
        AnalysisError
            The method does not integrate this building.
        """
        rows = max(2, _PIECE_BYTES // (8 * history_width(self.building, integrator)))
        space = self._ready(integrator, steps.h, 0, math.inf)
        motion = np.zeros(1) if ground is None else ground
        done, total = 0, steps.count // every + 1
        while done < steps.count:
            before = done // every + 1 if done else 0
            last = min((before + rows) * every - 1, steps.count)
            space.every, space.before = every, before
            space.history = np.zeros((min(rows, total - before), history_width(self.building, integrator)))
            go = self.loop(integrator, steps.h, motion, space)
            if self._in_pieces(go, replace(steps, count=last, done=done)) < 0:
                return
            if len(space.history):
                yield space
            done = last

    def march_parts(
        self, integrator: Integrator, steps: Steps, ground: Array, firsts: Sequence[int]
    ) -> Iterator[Workspace]:
        """Integrate as `march` does, and see the motion in parts, each with its own peaks.

        Parameters
        ----------
        firsts : sequence of int
            After how many steps each part begins; the first one at 0.

        Yields
        ------
        Workspace
            At the end of each part, to be looked at before the next one is asked for; none of a part that failed.

        Raises
        ------
        AnalysisError
            The method does not integrate this building.
        """
        space = self._ready(integrator, steps.h, 0, math.inf)
        go = self.loop(integrator, steps.h, ground, space)
        for done, last in pairwise((*(first for first in firsts if first < steps.count), steps.count)):
            if self._in_pieces(go, replace(steps, count=last, done=done)) < 0:
                return
            yield space
            space.forget_peaks(integrator, len(self.building.modal))

    def march_many(
        self,
        integrator: Integrator,
        h: float,
        samples: Array,
        runs: Sequence[Lane],
        *,
        collapse_drift: float = math.inf,
        rest: Rest | None = None,
    ) -> MarchedRuns:
        """Integrate many runs of one step h (s) in one compiled call; each is the one that `march` makes.

        Parameters
        ----------
        samples : ndarray
            Ground accelerations of all runs, one after the other, m/s^2.
        runs : sequence of Lane
            Where in `samples` a run's motion is, its factor, its steps.

        Raises
        ------
        AnalysisError
            The method does not integrate this building.
        """
        space = self._ready(integrator, h, 0, collapse_drift)
        rest = rest or Rest()
        n = self.building.stories
        marched = MarchedRuns.empty(len(runs), n)
        table = np.array([(*run[:3], run.steps.count, run.steps.per_sample, run.steps.stride) for run in runs], float)
        called = (march, integrator.family.step, begin, take_stock, raise_shears)
        building = self.building
        many.compiled(
            *(one.variant(self.variant) for one in called),
            HALVINGS if integrator.family.halvable else 0,
            h,
            samples,
            table,
            self.coefficients(integrator, h),
            shifts(integrator, h),
            *Scene(building.linear_terms, building.modal, building.law_parameters, self.forces, space.flags),
            *space.memory,
            space.totals,
            *Memory(space.state.copy(), space.springs.copy(), space.work, space.report.copy()),
            np.zeros(at.LOAD_SIZE),
            np.zeros(max(run.size for run in runs)),
            space.watch,
            space.limits,
            np.zeros(n),
            space.history,
            *(rest.window, rest.windows, rest.quiet),
            *(marched.peaks, marched.drifts, marched.totals, marched.ends),
        )
        return marched

    def march_each(
        self,
        integrator: Integrator,
        h: float,
        motions: Sequence[tuple[Array, float, Steps]],
        *,
        every: int,
        see: Callable[[int, Array], None],
        collapse_drift: float = math.inf,
    ) -> MarchedRuns:
        """Integrate many runs of one step h (s), each of which is the one that `march` makes, and see their histories.

        All of them share one set of arrays and one row of arguments: what is done beside a run's compiled call is a
        sixth of a run of a thousand steps of one story.

        Parameters
        ----------
        motions : sequence of (ndarray, float, Steps)
            Ground acceleration of each run, m/s^2, the factor on it, and the steps.
        every : int
            Steps from one row of a history to the next.
        see : callable
            Called with the number of a run and the rows of its history as far as it came; they are written over by the
            next run.

        Raises
        ------
        AnalysisError
            The method does not integrate this building; the memory does not hold the history.
        """
        rows = max(steps.count for _, _, steps in motions) // every + 1
        space = self._ready(integrator, h, rows, collapse_drift)
        begun = [(array, array.copy()) for array in (*space.memory, space.watch, space.peaks, space.totals)]
        ground = np.zeros(max(len(acceleration) for acceleration, _, _ in motions))
        space.every = every
        go = self.loop(integrator, h, ground, space)
        marched = MarchedRuns.empty(len(motions), self.building.stories)
        for r, (acceleration, scale, steps) in enumerate(motions):
            for array, first in begun:
                array[...] = first
            np.multiply(acceleration, scale, out=ground[: len(acceleration)])
            ground[len(acceleration) :] = 0.0
            code = go(steps, 0, steps.count)
            marched.peaks[r], marched.totals[r] = space.peaks, space.totals
            marched.drifts[r] = space.springs[at.DRIFT, : self.building.stories]
            reached = int(space.totals[at.STEPS_REACHED])
            marched.ends[r] = code, reached, 1.0
            see(r, space.history[: reached // every + 1])
        return marched

    def _ready(self, integrator: Integrator, h: float, rows: int, collapse_drift: float) -> Workspace:
        """The arrays of a march with steps h (s) in the initial state, and what it calls loaded."""
        check_suited(integrator, self.building)
        self.compile([integrator])
        space = workspace(self.building, integrator, rows, collapse_drift)
        space.state[at.DISPLACEMENT, :-1] = self.displacement
        space.state[at.VELOCITY, :-1] = self.velocity
        space.flags[at.FAST] = self.building.fastest * h > _RESOLVED
        return space

    def loop(self, integrator: Integrator, h: float, ground: Array, space: Workspace) -> Loop:
        """The compiled time loop with all its arrays, which it finds as they are when it is called."""
        building = self.building
        arrays = (
            *(ground, self.coefficients(integrator, h), shifts(integrator, h)),
            *Scene(building.linear_terms, building.modal, doubled_laws(building, integrator), self.forces, space.flags),
            *space.memory,
            np.zeros(at.LOAD_SIZE),
            *space.seen,
        )
        called = [kernel.variant(self.variant) for kernel in (integrator.family.step, begin, take_stock, raise_shears)]
        halvings = HALVINGS if integrator.family.halvable else 0

        def go(steps: Steps, first: int, last: int) -> int:
            code: int
            if steps.bound:
                units = (steps.count, last, steps.per_sample, steps.stride, h)
                code = march_in_strides.variant(self.variant)(*called, *units, space.choice, *arrays)
                return code
            code = march.variant(self.variant)(
                *called,
                *(steps.count, first, last, space.every, space.before, steps.per_sample, steps.stride, halvings, h),
                *arrays,
            )
            return code

        return go

    def _in_pieces(self, go: Loop, steps: Steps) -> int:
        """March over the steps that are left in pieces that take about `_PIECE`, between which Python can be
        interrupted. 0, or the code of the step that failed."""
        done, size = steps.done, max(_FIRST_PIECE // (self.building.stories * (1 + len(self.building.modal))), 1)
        if steps.bound:
            size *= steps.per_sample
        while True:
            last = min(done + size, steps.count)
            began = time.perf_counter()
            code = go(steps, done, last)
            if code < 0 or last == steps.count:
                return code
            seconds = time.perf_counter() - began
            done, size = last, max(1, min(2 * size, int(size * _PIECE / max(seconds, 1e-6))))
