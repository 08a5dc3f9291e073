"""A building put together once, under its forces and from its initial state, to be integrated any
number of times: the one place that calls the compiled time loop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, chain, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tdint import system
from tdint.analysis.given import AnyModel, model_of
from tdint.analysis.run.workspace import (
    HALVINGS,
    LINEAR_OSCILLATORS,
    Instability,
    Steps,
    Workspace,
    find_instability,
    history_width,
    kernels,
    shifts,
    unsuited,
    workspace,
)
from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError
from tdint.ground_motion.record import Record
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import EVERYTHING, Variant
from tdint.kernels.building.load_or_compile import (
    compile_ahead,
    interpret_while_compiling,
    load_or_compile,
)
from tdint.kernels.building.sources import CODE
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws.compiled_separately import separate_kernels
from tdint.kernels.oscillators.elastic import peaks
from tdint.kernels.stepping import Memory, Scene
from tdint.kernels.stories.law_state import follow
from tdint.kernels.time_loop.loop import END_COLUMNS, integrate, integrate_many
from tdint.kernels.time_loop.observer import initialize_laws, sum_law_energies, update_shear_peaks
from tdint.methods.catalogue import DEFAULT_METHOD, catalogue, parse
from tdint.methods.method import Integrator
from tdint.model.building import Building, DrawnBuildings, assemble, force_table, variant
from tdint.model.definition import Model
from tdint.model.law_checks import verify_laws

# omega dt of the fastest mode, bounded from above, up to which a step is taken to follow all modes
_RESOLVED = 2.5
_PIECE = 0.1  # s
_FIRST_PIECE = 100_000  # steps times stories, and as much for each modally damped mode
_PIECE_BYTES = 2**23  # of a piece of a history
_KEPT = 4  # sets of coefficients that are kept: a run, the one that tells its errors, the next pair


Loop = Callable[[Steps, int, int], int]
"""Takes all steps, and from which of them on to go on until which; gives 0 or the code of the step
that failed."""


@dataclass(frozen=True)
class Marched:
    """What a march left: its arrays, 0 or the code of the step that failed, and the time that the
    time loop took, s, by `tdint.system.clock` and on the wall."""

    space: Workspace
    code: int
    seconds: float
    wall: float


class Lane(NamedTuple):
    """One of many runs: where in all samples its ground motion begins, how many those are, the
    factor on them, and its steps."""

    start: int
    size: int
    scale: float
    steps: Steps


@dataclass(frozen=True)
class Motions:
    """Ground motions by their numbers, and as compiled runs take them: one after the other."""

    records: Mapping[int, Record]

    @cached_property
    def samples(self) -> Array:
        """The accelerations of all, m/s^2."""
        return np.concatenate([record.acceleration for record in self.records.values()])

    @cached_property
    def starts(self) -> Mapping[int, int]:
        """Where each begins in `samples`."""
        sizes = [record.acceleration.size for record in self.records.values()]
        return dict(
            zip(self.records, accumulate(sizes, initial=0), strict=False)
        )  # the last is where all end

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
        The columns of `tdint.kernels.time_loop.loop`: code, steps taken, whether at rest.
    """

    peaks: Array
    drifts: Array
    totals: Array
    ends: Array

    def part(self, first: int, last: int) -> MarchedRuns:
        """Some of the runs: the arrays are parts of these."""
        return MarchedRuns(
            *(array[first:last] for array in (self.peaks, self.drifts, self.totals, self.ends))
        )

    @classmethod
    def empty(cls, runs: int, stories: int) -> MarchedRuns:
        """Room for so many runs."""
        shapes = (2 * rows.PEAK_ROWS, stories), (stories,), (rows.TOTALS_SIZE,), (END_COLUMNS,)
        return cls(*(np.zeros((runs, *shape)) for shape in shapes))


@dataclass(frozen=True)
class Rest:
    """How long many marches go on after their steps with the ground at rest; not at all by default.

    Attributes
    ----------
    window, windows : int
        Steps of a window, and the most windows.
    quiet : float
        Largest velocity of a floor in a window, over the largest displacement of the run, at which
        it ends, 1/s.
    """

    window: int = 1
    windows: int = 0
    quiet: float = 0.0


NO_REST = Rest()


@dataclass(frozen=True)
class PreparedBuilding:
    """A building as arrays, the forces on its floors and its state at t = 0; each march is given
    the ground's motion.

    What follows from these alone is found once and kept: the modes, the method's coefficients for a
    step, whether a step is stable. One of these serves any number of ground motions, of scales of
    them, and of threads.

    Attributes
    ----------
    building : Building
        The building.
    forces : ndarray, shape (forces, FORCE_COLUMNS)
        Forces on floors, as `force_table` makes them; none by default.
    displacement, velocity : ndarray, shape (n,)
        At t = 0 relative to the ground, m and m/s; at rest by default.
    collapse_drift : float
        Drift ratio beyond which a story has collapsed: when one first is, marches note.
    """

    building: Building
    forces: Array = field(default_factory=lambda: np.zeros((0, rows.FORCE_COLUMNS)))
    displacement: Array | float = 0.0
    velocity: Array | float = 0.0
    collapse_drift: float = math.inf
    _coefficients: dict[tuple[str, float], Array] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
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
            model.collapse_drift,
        )

    @cached_property
    def variant(self) -> Variant:
        """What the kernels need for the building."""
        return variant(self.building, self.forces)

    @cached_property
    def period(self) -> float:
        """First period of the initial stiffness, s."""
        return 2.0 * math.pi / self.building.vibration.frequency(1)

    def compile(
        self,
        integrators: Iterable[Integrator],
        progress: Callable[[float], None] = lambda part: None,
        own_loops: bool = False,
    ) -> None:
        """Load what marches with these methods call, compiled if it is not yet: before a clock
        starts.

        Parameters
        ----------
        progress : callable
            Told how much is done, from 0 to 1.
        own_loops : bool
            True if loops that are compiled for all laws must not serve: times of methods are
            compared.

        Raises
        ------
        AnalysisError
            A law of a plug-in is not what it declares.
        """
        verify_laws(self.building.law_parameters)
        load_or_compile(
            [kernel for integrator in integrators for kernel in kernels(integrator, self.variant)],
            progress,
            own_loops,
        )

    def coefficients(self, integrator: Integrator, h: float) -> Array:
        """Coefficients of the method's step for this building and the step h (s)."""
        key = (integrator.label, h)
        kept = self._coefficients.get(key)
        if kept is None:
            kept = integrator.coefficients(self.building, self.forces, h)
            # The oldest goes first: a search for a step asks for few of them again.
            while len(self._coefficients) >= _KEPT:
                self._coefficients.pop(next(iter(self._coefficients)), None)
            self._coefficients[key] = kept
        return kept

    def instability(self, integrator: Integrator, h: float) -> Instability | None:
        """The stiffest of the modes in the initial state that a step h (s) is too long for, None if
        it is stable.

        Modes are solved for a method that has a limit, and once. That a method of ours has none is
        tested; of a plug-in's it is measured.
        """
        if (
            integrator.stability_limit == math.inf
            and f"method {integrator.method.name}" not in CODE
        ):
            return None
        key = (integrator.label, h)
        if key not in self._instability:
            modes = self.building.modes()
            damping = np.diagonal(modes.modal_damping(self.building.damping_matrix())) / (
                2.0 * modes.omega
            )
            self._instability[key] = find_instability(integrator, modes.omega, damping, h)
        return self._instability[key]

    def march(
        self,
        integrator: Integrator,
        steps: Steps,
        ground: Array | None = None,
        *,
        history_rows: int = 0,
    ) -> Marched:
        """Integrate from the initial state over the steps.

        Parameters
        ----------
        ground : ndarray, shape (samples,), optional
            Ground acceleration at the samples, m/s^2; linear between them and zero after the last
            one. None is ground at rest.
        history_rows : int
            Steps of the history that is kept, of which `steps` are a whole multiple; 0 for none.

        Raises
        ------
        AnalysisError
            The method does not integrate this building; the memory does not hold the history.
        ValueError
            The steps are no whole multiple of those of the history.
        """
        if history_rows and steps.count % history_rows:
            raise ValueError(f"{steps.count} steps do not fit into a history of {history_rows}")
        space = self._ready(integrator, steps.h, history_rows + 1 if history_rows else 0)
        space.every = steps.count // history_rows if history_rows else 1
        go = self.loop(integrator, steps.h, np.zeros(1) if ground is None else ground, space)
        began, wall = system.seconds(), time.perf_counter()
        code = self._in_pieces(go, steps)
        return Marched(space, code, system.seconds() - began, time.perf_counter() - wall)

    def march_pieces(
        self, integrator: Integrator, steps: Steps, ground: Array, *, every: int
    ) -> Iterator[Workspace]:
        """Integrate as `march` does, and see the history in pieces, a row every so many steps.

        Yields
        ------
        Workspace
            With a history of its own, of which `before` rows stand before; no piece of a run that
            failed in it.

        Raises
        ------
        AnalysisError
            The method does not integrate this building.
        """
        # A piece has as many rows as a bounded memory holds, and begins where the last one ended.
        width = history_width(self.building)
        row_count = max(2, _PIECE_BYTES // (8 * width))
        space = self._ready(integrator, steps.h)
        done, total = 0, steps.count // every + 1
        while done < steps.count:
            before = done // every + 1 if done else 0
            last = min((before + row_count) * every - 1, steps.count)
            space.every, space.before = every, before
            space.history = np.zeros((min(row_count, total - before), width))
            go = self.loop(integrator, steps.h, ground, space)
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
            At the end of each part, to be looked at before the next one is asked for; none of a
            part that failed.

        Raises
        ------
        AnalysisError
            The method does not integrate this building.
        """
        space = self._ready(integrator, steps.h)
        go = self.loop(integrator, steps.h, ground, space)
        for done, last in pairwise(
            (*(first for first in firsts if first < steps.count), steps.count)
        ):
            if self._in_pieces(go, replace(steps, count=last, done=done)) < 0:
                return
            yield space
            # Peaks are looked for anew, also where the method keeps some of its own.
            space.peaks[:] = 0.0
            if own := int(space.step_status[rows.RUN_PEAKS]):
                space.scratch[own : own + 2 * rows.PEAK_ROWS] = 0.0

    def march_many(
        self,
        integrator: Integrator,
        h: float,
        samples: Array,
        runs: Sequence[Lane],
        rest: Rest = NO_REST,
    ) -> MarchedRuns:
        """Integrate many runs of one step h (s) in one compiled call; each is the one that `march`
        makes.

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
        space = self._ready(integrator, h)
        marched = MarchedRuns.empty(len(runs), self.building.stories)
        self._many(integrator, h, samples, runs, space)(runs, marched, rest)
        return marched

    def march_drawn(
        self,
        integrator: Integrator,
        h: float,
        samples: Array,
        runs: Sequence[tuple[int, Lane]],
        drawn: DrawnBuildings,
    ) -> MarchedRuns:
        """Integrate runs of buildings that differ from this one in numbers: each is the one that
        `march` makes of it.

        All of them share one set of arrays, in which the numbers are changed from run to run.

        Parameters
        ----------
        samples : ndarray
            Ground accelerations of all runs, one after the other, m/s^2.
        runs : sequence of (int, Lane)
            The number of each one's building, and its motion, factor and steps.
        drawn : DrawnBuildings
            The buildings; the method's coefficients do not hang on them.

        Raises
        ------
        AnalysisError
            The method does not integrate this building.
        """
        marched = MarchedRuns.empty(len(runs), self.building.stories)
        lanes, drawn_arrays = (
            [lane for _, lane in runs],
            ("linear_terms", "law_parameters", "modal"),
        )
        verify_laws(drawn.law_parameters)
        fast, devices = drawn.fastest * h > _RESOLVED, drawn.with_devices.tolist()
        shared: dict[tuple[bool, int], tuple[PreparedBuilding, Workspace, Callable[..., None]]] = {}
        for r, (d, lane) in enumerate(runs):
            # What is compiled hangs on whether there are dashpots, and arrays on the rows of modal
            # damping.
            kind = devices[d], len(drawn.modal[d])
            if kind not in shared:
                building = replace(
                    self.building, **{name: getattr(drawn, name)[d].copy() for name in drawn_arrays}
                )
                prepared = replace(self, building=building)
                space = prepared._ready(integrator, h)
                shared[kind] = prepared, space, prepared._many(integrator, h, samples, lanes, space)
            prepared, space, go = shared[kind]
            for name in drawn_arrays:
                getattr(prepared.building, name)[...] = getattr(drawn, name)[d]
            space.flags[rows.UNRESOLVED_MODES] = fast[d]
            space.limits[1] = drawn.heights[d]
            go([lane], marched.part(r, r + 1))
        return marched

    def _many(
        self,
        integrator: Integrator,
        h: float,
        samples: Array,
        runs: Sequence[Lane],
        space: Workspace,
    ) -> Callable[..., None]:
        """The compiled loop over some of the runs with all its arrays: takes those, where to leave
        what, and a rest."""
        called = (
            integrate,
            integrator.family.step,
            initialize_laws,
            sum_law_energies,
            update_shear_peaks,
        )
        # A run begins in the arrays as they are now: copies of state and springs are its start.
        before = (
            *(kernel.variant(self.variant) for kernel in called),
            HALVINGS if integrator.family.halvable else 0,
            h,
        )
        building = self.building
        behind = (
            self.coefficients(integrator, h),
            shifts(integrator, h),
            *Scene(
                building.linear_terms,
                building.modal,
                building.law_parameters,
                self.forces,
                space.flags,
            ),
            *space.memory,
            space.totals,
            *Memory(
                space.state.copy(), space.law_state.copy(), space.scratch, space.step_status.copy()
            ),
            np.zeros(rows.LOAD_SIZE),
            np.zeros(max(run.size for run in runs)),
            space.observer_state,
            space.limits,
            np.zeros(building.stories),
            space.history,
        )

        # The loop over the runs is compiled, too: its arguments are put together once for all.
        def go(lanes: Sequence[Lane], marched: MarchedRuns, rest: Rest = NO_REST) -> None:
            table = [
                (*lane[:3], lane.steps.count, lane.steps.per_sample, lane.steps.stride)
                for lane in lanes
            ]
            integrate_many.compiled(
                *(*before, samples, np.array(table, float), *behind),
                *(rest.window, rest.windows, rest.quiet),
                *(marched.peaks, marched.drifts, marched.totals, marched.ends),
            )

        return go

    def march_each(
        self,
        integrator: Integrator,
        h: float,
        motions: Sequence[tuple[Array, float, Steps]],
        *,
        every: int,
        see: Callable[[int, Array], None],
    ) -> MarchedRuns:
        """Integrate many runs of one step h (s), each of which is the one that `march` makes, and
        see their histories.

        All of them share one set of arrays and one row of arguments: what is done beside a run's
        compiled call is a sixth of a run of a thousand steps of one story.

        Parameters
        ----------
        motions : sequence of (ndarray, float, Steps)
            Ground acceleration of each run, m/s^2, the factor on it, and the steps.
        every : int
            Steps from one row of a history to the next.
        see : callable
            Called with the number of a run and the rows of its history as far as it came; they are
            written over by the next run.

        Raises
        ------
        AnalysisError
            The method does not integrate this building; the memory does not hold the history.
        """
        row_count = max(steps.count for _, _, steps in motions) // every + 1
        space = self._ready(integrator, h, row_count)
        # What a run changes is put back before the next one.
        begun = [
            (array, array.copy())
            for array in (*space.memory, space.observer_state, space.peaks, space.totals)
        ]
        ground = np.zeros(max(len(acceleration) for acceleration, _, _ in motions))
        space.every = every
        go = self.loop(integrator, h, ground, space)
        marched = MarchedRuns.empty(len(motions), self.building.stories)
        for r, (acceleration, scale, steps) in enumerate(motions):
            for array, first in begun:
                array[...] = first
            np.multiply(acceleration, scale, out=ground[: len(acceleration)])
            ground[len(acceleration) :] = 0.0
            # In one piece: a run of many is short, and no other thread waits for Python meanwhile.
            code = go(steps, 0, steps.count)
            marched.peaks[r], marched.totals[r] = space.peaks, space.totals
            marched.drifts[r] = space.law_state[rows.DRIFT, : self.building.stories]
            reached = int(space.totals[rows.STEPS_REACHED])
            marched.ends[r] = code, reached, 1.0
            see(r, space.history[: reached // every + 1])
        return marched

    def _ready(self, integrator: Integrator, h: float, row_count: int = 0) -> Workspace:
        """The arrays of a march with steps h (s) in the initial state, and what it calls loaded."""
        if reason := unsuited(integrator, self.building):
            raise AnalysisError(reason)
        self.compile([integrator])
        return self.arrays(integrator, h, row_count)

    def arrays(self, integrator: Integrator, h: float, row_count: int) -> Workspace:
        """The arrays of a march with steps h (s) in the initial state, with so many rows of its
        history."""
        verify_laws(self.building.law_parameters)
        space = workspace(self.building, integrator, row_count, self.collapse_drift)
        space.state[rows.DISPLACEMENT, :-1] = self.displacement
        space.state[rows.VELOCITY, :-1] = self.velocity
        space.flags[rows.UNRESOLVED_MODES] = self.building.fastest * h > _RESOLVED
        return space

    def loop(self, integrator: Integrator, h: float, ground: Array, space: Workspace) -> Loop:
        """The compiled time loop with all its arrays, which it finds as they are when it is
        called."""
        building = self.building
        arrays = (
            *(ground, self.coefficients(integrator, h), shifts(integrator, h)),
            *Scene(
                building.linear_terms,
                building.modal,
                building.law_parameters,
                self.forces,
                space.flags,
            ),
            *space.memory,
            np.zeros(rows.LOAD_SIZE),
            *space.seen,
        )
        called = [
            kernel.variant(self.variant)
            for kernel in (
                integrator.family.step,
                initialize_laws,
                sum_law_energies,
                update_shear_peaks,
            )
        ]
        halvings = HALVINGS if integrator.family.halvable else 0

        def go(steps: Steps, first: int, last: int) -> int:
            code: int
            code = integrate.variant(self.variant)(
                *called,
                *(
                    steps.count,
                    first,
                    last,
                    space.every,
                    space.before,
                    steps.per_sample,
                    steps.stride,
                    halvings,
                    h,
                ),
                *arrays,
            )
            return code

        return go

    def _in_pieces(self, go: Loop, steps: Steps) -> int:
        """March over the steps that are left in pieces that take about `_PIECE`, between which
        Python can be interrupted. 0, or the code of the step that failed."""
        done, size = (
            steps.done,
            max(_FIRST_PIECE // (self.building.stories * (1 + len(self.building.modal))), 1),
        )
        # The first piece is a guess; each next one is as long as the last one's pace allows, at
        # most doubled.
        while True:
            last = min(done + size, steps.count)
            began = time.perf_counter()
            code = go(steps, done, last)
            if code < 0 or last == steps.count:
                return code
            seconds = time.perf_counter() - began
            done, size = last, max(1, min(2 * size, int(size * _PIECE / max(seconds, 1e-6))))


# ---- Which kernels analyses call, to compile them ahead


def of_model(model: Model, integrator: Integrator) -> list[tuple[Kernel, Variant]]:
    """What a run of a model calls with all its tables, and a cyclic test of its stories."""
    return [
        item for group in _of_building(PreparedBuilding.of(model), integrator) for item in group
    ]


def _of_building(
    prepared: PreparedBuilding, integrator: Integrator
) -> tuple[list[tuple[Kernel, Variant]], ...]:
    """What a march calls, and what else a run does."""
    others = (peaks, *separate_kernels(prepared.building.law_parameters))
    of_scene = [(follow, prepared.variant), *((kernel, EVERYTHING) for kernel in others)]
    # Of a method that has a limit, what finds whether a step is beyond it
    if integrator.stability_limit != math.inf:
        of_scene.append((integrator.family.step, LINEAR_OSCILLATORS))
    return kernels(integrator, prepared.variant), of_scene


_SHORT = 180_000
"""Steps times floors, the ground among them, of a run that is sooner done as its loops are written
than these are compiled, which takes 7 to 24 s: 5 s with impulse4 (26 to 28 us each), 10 with the
slowest method (rk5, 55 us)."""


def begin_at_once(prepared: PreparedBuilding, methods: Sequence[Integrator], steps: int) -> bool:
    """Whether a run of so many steps in all, with a method and the one that tells its errors, goes
    as its loops are written, since nobody has compiled them yet; they are compiled beside it
    (`tdint.kernels.building.load_or_compile.begin_as_written`).

    Never with power-law dashpots, whose iterations take fifteen times as long.
    """
    building = prepared.building
    if (
        steps * (building.stories + 1) > _SHORT
        or building.power_damped
        or unsuited(methods[0], building)
    ):
        return False
    called, others = zip(*(_of_building(prepared, method) for method in methods), strict=True)
    return interpret_while_compiling(
        *(list(dict.fromkeys(chain(*groups))) for groups in (called, others))
    )


def of_everything() -> list[tuple[Kernel, Variant]]:
    """All kernels, each for all scenes."""
    # What a run does without
    from tdint.kernels.oscillators.bilinear import bilinear_response
    from tdint.kernels.oscillators.extremes import extremes, radii
    from tdint.kernels.oscillators.modal_sums import largest_drifts
    from tdint.kernels.oscillators.rotated import rotated_peaks

    steps = [item for name in catalogue() for item in kernels(parse(name), EVERYTHING)]
    others = (
        integrate_many,
        follow,
        peaks,
        extremes,
        radii,
        rotated_peaks,
        largest_drifts,
        bilinear_response,
        *separate_kernels(),
    )
    return [*steps, *((kernel, EVERYTHING) for kernel in others)]


def compile_model(model: AnyModel, method: str | None = None) -> list[Path]:
    """Compile the time loops that a run of a model calls, which its first run else does.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes.
    method : str, optional
        In place of the model's.

    Returns
    -------
    list of Path
        The files that were written; none where all of it was compiled already.

    Raises
    ------
    ModelError, UsageError
        The model is none; an unknown method.
    OutputError
        The files cannot be written.
    """
    building = model_of(model)
    integrator = parse(method or building.analysis.method or DEFAULT_METHOD)
    return compile_ahead(of_model(building, integrator), ("native",), None, lambda done: None)
