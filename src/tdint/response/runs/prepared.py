"""Prepared building: assembled one time and integrated any number of times.

This is the only module that calls the compiled time loop.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint import system
from tdint.arrays import Array, cached_property, immutable
from tdint.errors import AnalysisError
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import Compilable, Variant, bind
from tdint.kernels.building.load_or_compile import (
    load_or_compile,
    use_compiled_kernels,
)
from tdint.kernels.laws import OURS
from tdint.kernels.stepping import Scene
from tdint.kernels.time_loop.ground import ground_at
from tdint.kernels.time_loop.loop import integrate
from tdint.methods.method import Integrator
from tdint.methods.workspace import (
    HALVINGS,
    Workspace,
    history_width,
    state_jumps,
    workspace,
)
from tdint.model.building import Building, assemble, period, variant
from tdint.model.definition import Model
from tdint.model.force_arrays import load_arrays
from tdint.response.runs.compiled_steps import (
    LOOP_KERNELS,
    kernels,
    unsupported_reason,
)
from tdint.response.runs.run_state import RunState, copy_of, restart, restore, store_first_row
from tdint.response.time_steps import Steps

if TYPE_CHECKING:
    from tdint.response.runs.measured_stability import Instability

# Dimensionless. Upper bound of omega dt of the highest mode: up to this bound, the time step is
# considered to resolve all modes.
MAX_RESOLVED_OMEGA_DT = 2.5
_CALL_SECONDS = 0.1  # s; approximate duration of a single call of the time loop
# Work of the first call of the time loop: number of steps times number of stories times (1 + number
# of modally damped modes). The following calls are adapted to `_CALL_SECONDS`
_FIRST_CALL_SIZE = 100_000
_CHUNK_BYTES = 2**23  # maximum size of a chunk of a response history in memory, bytes
# Number of sets of coefficients in memory: two for a run and its error estimate, and two for the
# next time step of a search.
_MAX_COEFFICIENT_SETS = 4


def _verify_laws(law_parameters: Array) -> None:
    """Verify the laws of plug-ins in a table of law parameters (`law_checks.verify_laws`)."""
    if np.any(law_parameters[..., rows.CODE, :] >= OURS):
        # Imported here, because only buildings with laws of plug-ins need the checks.
        from tdint.model.law_checks import verify_laws

        verify_laws(law_parameters)


Loop = Callable[[Steps, int, int], int]
"""Function that receives all time steps and the first and last step to integrate, and returns 0 or
the code of the failed step.
"""


class IntegrationResult(NamedTuple):
    """Result of a time integration.

    Attributes
    ----------
    space : Workspace
        Arrays at the end of the time integration or after the failed step.
    completed : int
        Number of steps of the run, with those after the requested end.
    code : int
        0, or the negative code of the step that failed.
    seconds, wall : float
        Duration of the time loop, s, by `tdint.system.clock` and by the wall clock.
    ground : float
        Ground acceleration after the last step, m/s^2.
    """

    space: Workspace
    completed: int
    code: int
    seconds: float
    wall: float
    ground: float


class RunSpec(NamedTuple):
    """One run of a batch.

    Attributes
    ----------
    ground : ndarray
        Ground acceleration at the samples, m/s^2.
    scale : float
        Factor on the ground acceleration.
    """

    ground: Array
    scale: float
    steps: Steps


# Columns of `BatchResult.ends`
CODE, STEPS_COMPLETED, AT_REST = range(3)


class BatchResult(NamedTuple):
    """Results of many runs. The first axis of each array is the run.

    Attributes
    ----------
    peaks : ndarray, shape (runs, 2 PEAK_ROWS, n)
        Peaks of the stories in the rows of `Workspace.peaks`.
    drifts : ndarray, shape (runs, n)
        Drifts at the end, m.
    totals : ndarray, shape (runs, TOTALS_SIZE)
        Energies and counts in the order of `Workspace.totals`.
    ends : ndarray, shape (runs, 3)
        Columns CODE: 0 or the negative code of the failed step; STEPS_COMPLETED: number of steps
        until the end of the ground motion or of the last complete window of free vibration, 0 for
        a failure during the ground motion; AT_REST: 1 if the building is at rest, or if this is not
        requested.
    elements : ndarray, shape (runs, 2, elements)
        Maximum absolute force (N) and dissipated energy (J) of the elements of stories with several
        elements.
    devices : ndarray, shape (runs, 3, devices)
        `device_results` of attachments and links.
    """

    peaks: Array
    drifts: Array
    totals: Array
    ends: Array
    elements: Array
    devices: Array

    @classmethod
    def empty(cls, runs: int, building: Building) -> BatchResult:
        """Return results of zeros for a number of runs of a building."""
        n, devices = building.stories, len(building.attachments) + len(building.links)
        shapes = (2 * rows.PEAK_ROWS, n), (n,), (rows.TOTALS_SIZE,), (3,)
        springs = (4, building.elements), (3, devices)
        return cls(*(np.zeros((runs, *shape)) for shape in (*shapes, *springs)))


def element_results(law_state: Array, stories: int) -> Array:
    """Return the maximum absolute force (N), the dissipated energy (J), the time of the fracture
    (s) and the peak drift until then (m; 0 without a fracture) of the elements of stories with
    several elements at the end of a run, shape (4, elements).

    `law_state` contains the law states of a building with `stories` stories.
    """
    results = [rows.PEAK_FORCE, rows.ENERGY_SPENT, rows.FRACTURE_TIME, rows.FRACTURE_DRIFT]
    return law_state[results, stories + 1 :]


def device_results(building: Building, space: Workspace) -> Array:
    """Return the energies dissipated by attachments and links since the start of a run (J), the
    times of their fractures (s) and the peak deformations up to these (m; 0 without a fracture),
    shape (3, devices)."""
    part = building.device_columns
    dissipated = space.observer_state[rows.DASHPOT_WORK, part].copy()
    dissipated += space.law_state[rows.ENERGY_SPENT, part]
    if np.any(building.linear_terms[rows.BRACE]):
        dissipated += space.state[rows.BRACE_DISSIPATED, part]
    if building.tangent_damped:  # of a contact
        dissipated += space.state[rows.DAMPING_WORK, part]
    return np.stack([dissipated, *space.law_state[[rows.FRACTURE_TIME, rows.FRACTURE_DRIFT], part]])


class SampleTables(NamedTuple):
    """Tables of a building with other numbers in each run of a batch.

    Attributes
    ----------
    building : Building
        Building of many samples (`tdint.model.building.assemble`), one for each run.
    limits : ndarray, shape (LIMIT_ROWS, runs, n)
        Limits of the samples (`tdint.methods.workspace.collapse_limits`).
    subject_of : callable
        Function of the index of a run that returns its building (`Subject`).
    """

    building: Building
    limits: Array
    subject_of: Callable[[int], Any]

    def write(self, run: int, building: Building, space: Workspace, h: float) -> None:
        """Write the tables of a run to the arrays of a building and of a time integration."""
        many = self.building
        building.linear_terms[:] = many.linear_terms[:, run]
        building.law_parameters[:] = many.law_parameters[:, run]
        building.modal[:] = many.modal[:, run]
        space.limits[:] = self.limits[:, run]
        space.flags[rows.UNRESOLVED_MODES] = many.fastest[run] * h > MAX_RESOLVED_OMEGA_DT


class RestCriterion(NamedTuple):
    """Criterion for continuing runs with the ground at rest; by default, runs are not continued.

    Attributes
    ----------
    window, windows : int
        Number of steps of a window, and maximum number of windows.
    quiet : float
        Maximum velocity of a floor in a window divided by the maximum displacement of the run, at
        which the run ends, 1/s.
    """

    window: int = 1
    windows: int = 0
    quiet: float = 0.0


NO_FREE_VIBRATION = RestCriterion()


def _integrate_to_rest(
    loop: Loop, steps: Steps, criterion: RestCriterion, integrator: Integrator, space: Workspace
) -> tuple[int, int, bool]:
    """Continue a run of `steps` in windows of free vibration until the building is at rest.

    Returns
    -------
    code : int
        0 or the negative code of the failed step.
    completed : int
        Number of steps of the run and of all complete windows.
    at_rest : bool
        True if the building is at rest at the end of a window.
    """
    completed = steps.count
    velocity = space.peaks[rows.PEAK_VELOCITY]
    for _ in range(criterion.windows):
        peaks_of_run = velocity.copy()
        _reset_peaks(integrator, space, rows.PEAK_VELOCITY)
        last = completed + criterion.window
        code = loop(replace(steps, count=last), completed, last)
        max_velocity = velocity.max()
        np.maximum(peaks_of_run, velocity, out=velocity)
        if code < 0:
            return code, completed, False
        completed = last
        if max_velocity <= criterion.quiet * space.peaks[rows.PEAK_DISPLACEMENT].max():
            return code, completed, True
    return 0, completed, False


_MOST_WINDOWS = 100
"""Maximum number of periods for which a run continues while peaks grow. In an undamped building the
energy does not decrease.
"""

_QUIET_WINDOWS = 2
"""Number of successive windows without growth after which a run ends. The period of a building that
has become softer can be up to four times the period of the window, as half a period contains all
extrema.
"""

_GROWTH = 1e-6
"""Dimensionless. Relative growth of a peak in a window that counts; the minimum error estimate is
1e-5."""

_PART_OF_TRIANGLE = 0.5
"""Dimensionless. Energy for a drift of a story, divided by the triangle of `_may_grow`, if a law of
the building is not concave. The path of a law with pinching is below the triangle.
"""


def _may_grow(building: Building, space: Workspace) -> bool:
    """Return True if the energy of a building at the end of a ground motion could raise the peak
    drift of a story.

    A story reaches its peak drift again from its position of rest. The work is at least the
    triangle of peak force and change of drift, if the path is a line or above it. The kinetic
    energy and the work to the positions of rest of all stories must supply it. The energies of
    velocities and accelerations are in the same proportion; they are included while a drift can
    grow.
    """
    totals, peaks = space.totals, space.peaks
    if totals[rows.COLLAPSE_STEP] != rows.NO_COLLAPSE:
        return False
    if building.uses_matrices:
        needed = 0.5 * building.initial_stiffness * peaks[rows.PEAK_DRIFT] ** 2
        stored = totals[rows.ENERGY_KINETIC] + totals[rows.ENERGY_STRAIN]
        return bool(stored > needed.min(initial=math.inf, where=needed > 0.0))
    distance, stiffness = building.rest_distance(space.law_state)
    energy = totals[rows.ENERGY_KINETIC] + totals[rows.ENERGY_BRACES]
    energy += 0.5 * np.dot(stiffness, distance**2)
    at_rest = np.abs(space.law_state[rows.DRIFT, : building.stories] - distance)
    triangle = 0.5 * peaks[rows.PEAK_SHEAR] * (peaks[rows.PEAK_DRIFT] - at_rest)
    # A story without a force, such as a gap that does not close, does not need energy.
    least = triangle.min(initial=math.inf, where=peaks[rows.PEAK_SHEAR] > 0.0)
    return bool(energy > least * (1.0 if building.concave else _PART_OF_TRIANGLE))


def _reset_peaks(integrator: Integrator, space: Workspace, row: int | slice) -> None:
    """Set a row of the peaks of a run to zero, or all rows, also in the copy that the step of the
    method keeps in its scratch rows."""
    space.peaks[row] = 0.0
    if first := integrator.family.step_peaks:
        space.scratch[first : first + 2 * rows.PEAK_ROWS][row] = 0.0


@immutable
class PreparedBuilding:
    """A building as arrays, the forces on its floors and its state at t = 0.

    Properties that depend only on these data are computed one time and cached: the modes, the
    coefficients of a method for a time step, and the stability of a time step. One instance serves
    any number of ground motions, scale factors and threads. Integrations raise AnalysisError if the
    method does not support the building, or if the memory is too small for the history.

    Attributes
    ----------
    forces : ndarray, shape (forces, FORCE_COLUMNS)
        Forces on floors from `force_table`; no forces by default.
    displacement, velocity : ndarray, shape (n,)
        Initial values relative to the ground, m and m/s; 0 by default.
    collapse_drift : float
        Drift ratio above which a story has collapsed. Time integrations record the first such
        story.
    points : ndarray
        Points of the tables in `forces`, which all runs share; empty by default.
    initial : RunState or None
        State at the end of another run that all runs continue. Numbers of steps are counted from
        this state; times include the time before.
    """

    building: Building
    forces: Array = field(default_factory=lambda: np.zeros((0, rows.FORCE_COLUMNS)))
    displacement: Array | float = 0.0
    velocity: Array | float = 0.0
    collapse_drift: float = math.inf
    points: Array = field(default_factory=lambda: np.zeros(0))
    initial: RunState | None = None
    _coefficients: dict[tuple[str, bool, float], Array] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    _instability: dict[tuple[str, float], Instability | None] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @classmethod
    def of(cls, model: Model) -> PreparedBuilding:
        """Return the building of a model with its forces and initial state.

        Raises
        ------
        ModelError
            P-delta exceeds the stiffness of a story.
        """
        forces, points = load_arrays(model.excitation)
        building, start = assemble(model), model.initial
        return cls(
            building,
            forces,
            building.initial_values(start.displacement, [u for u, _ in start.attachments]),
            building.initial_values(start.velocity, [v for _, v in start.attachments]),
            model.collapse_drift,
            points,
        )

    def settled(self, model: Model, times: Array) -> NDArray[np.bool_]:
        """Return True for each end of a run (s) after which all drifts of the building are zero at
        rest: it rests at zero, and no force of the model acts at the end."""
        if not self.building.rests_at_zero:
            return np.zeros(times.shape, bool)
        return np.array([model.excitation.is_zero_at(time) for time in times.tolist()], bool)

    def continued_from(self, state: RunState, integrator: Integrator) -> PreparedBuilding:
        """Return the building with runs that start from the state at the end of another run.

        Raises
        ------
        UsageError
            The state belongs to another building or method.
        """
        state.require_same(self.building, self.loads, integrator)
        if state.steps:
            return replace(self, initial=state)
        displacement, velocity = state.space.state[: rows.VELOCITY + 1, :-1]
        return replace(self, displacement=displacement, velocity=velocity)

    @property
    def completed(self) -> int:
        """Number of time steps before the start of the runs."""
        return self.initial.steps if self.initial else 0

    def _from_first_run(self, ground: Array, steps: Steps) -> tuple[Array, Steps]:
        """Return a ground motion and its time steps with samples of zero for the steps before the
        start of the runs.

        The time loop counts steps, and therefore samples, from the start of the first run. The
        ground acceleration of the state replaces the first sample, so that it is continuous.
        """
        if self.initial is None:
            return ground, steps
        ground = np.append(self.initial.ground_acceleration, ground[1:])
        samples, part = divmod(self.completed * steps.stride, steps.per_sample)
        if part:  # the start is between two samples: one sample per step
            samples = self.completed
            position = np.arange(ground.size * steps.per_sample) / steps.per_sample
            ground = np.interp(position, np.arange(ground.size + 1), np.append(ground, 0.0))
            steps = replace(steps, per_sample=1)
        return np.append(np.zeros(samples), ground), steps

    @cached_property
    def variant(self) -> Variant:
        """Variant of the compiled kernels that contains the laws, damping and loads of the
        building.
        """
        return variant(self.building, self.forces)

    @property
    def loads(self) -> tuple[Array, Array]:
        """Forces on floors and points of their tables (`load_arrays`)."""
        return self.forces, self.points

    @cached_property
    def period(self) -> float:
        """First period of the initial stiffness, s; infinite without initial stiffness."""
        return period(self.building.vibration.frequency(1))

    def compile(
        self,
        integrators: Iterable[Integrator],
        progress: Callable[[float], None] = lambda part: None,
        others: Iterable[tuple[Compilable, Variant]] = (),
    ) -> None:
        """Load or compile the kernels for some methods, and other kernels, before a timer starts.

        Parameters
        ----------
        progress : callable
            Function that receives the completed fraction, from 0 to 1; by default no function.

        Raises
        ------
        AnalysisError
            A law of a plug-in contradicts its declaration.
        """
        if self.building.uses_matrices:
            return  # models of matrices need no kernels
        _verify_laws(self.building.law_parameters)
        load_or_compile(
            [*(item for method in integrators for item in kernels(method, self.variant)), *others],
            progress,
        )

    def coefficients(self, integrator: Integrator, h: float) -> Array:
        """Return the coefficients of the method for this building and the time step h (s).

        The coefficients of the last `_MAX_COEFFICIENT_SETS` methods and time steps are cached.
        """
        # A run that estimates errors can have the same label and other coefficients.
        method = integrator.method
        is_estimating = method.coefficients is method.estimating_coefficients
        key = (integrator.label, is_estimating, h)
        coefficients = self._coefficients.get(key)
        if coefficients is None:
            coefficients = integrator.coefficients(self.building, self.forces, h)
            # Remove the oldest coefficients first, because a search for a time step rarely needs
            # them again.
            while len(self._coefficients) >= _MAX_COEFFICIENT_SETS:
                self._coefficients.pop(next(iter(self._coefficients)), None)
            self._coefficients[key] = coefficients
        return coefficients

    def instability(self, integrator: Integrator, h: float) -> Instability | None:
        """Return the stiffest mode for which the time step h (s) is above the stability limit of
        the method; None if there is no such mode. The modes include the braces of dampers and stops
        in contact (`Building.stiffest_modes`).

        Only methods that declare a finite stability limit are measured (`find_instability`); the
        measurement is cached. For all other methods the result is `None`. Tests confirm the
        unconditional stability of built-in methods, and `tdint check --plugin` that of plug-ins.
        """
        if integrator.stability_limit == math.inf:
            return None
        key = (integrator.label, h)
        if key not in self._instability:
            modes = self.building.stiffest_modes
            damping = np.diagonal(modes.modal_damping(self.building.damping_matrix())) / (
                2.0 * modes.omega
            )
            # Imported here, because most methods have no stability limit.
            from tdint.response.runs.measured_stability import find_instability

            self._instability[key] = find_instability(integrator, modes.omega, damping, h)
        return self._instability[key]

    def integrate(
        self,
        integrator: Integrator,
        steps: Steps,
        ground: Array | None = None,
        *,
        history_rows: int = 0,
    ) -> IntegrationResult:
        """Integrate from the initial state over the time steps.

        Parameters
        ----------
        ground : ndarray, shape (samples,), optional
            Ground acceleration at the samples, m/s^2; linear between samples and zero after the
            last sample. None means that the ground is at rest.
        history_rows : int, default 0
            Number of rows of the history after the row of t = 0. It must divide the number of
            steps: with all steps every step is stored, with 0 no history.
        """
        ground, steps = self._from_first_run(np.zeros(1) if ground is None else ground, steps)
        space = self.loaded_arrays(integrator, steps.h, history_rows + 1 if history_rows else 0)
        space.steps_per_row = steps.count // history_rows if history_rows else 1
        loop = self.loop(integrator, steps.h, ground, space)
        began, wall = system.seconds(), time.perf_counter()
        code, completed = self._integrate_interruptibly(loop, steps), steps.count
        if code == 0 and steps.continues:
            code, completed = self._continue_while_growing(loop, integrator, steps, ground, space)
        seconds, wall = system.seconds() - began, time.perf_counter() - wall
        last = self.completed + completed
        at_end = float(ground_at(ground, last, steps.per_sample, steps.stride))
        return IntegrationResult(space, completed, code, seconds, wall, at_end)

    def integrate_in_chunks(
        self, integrator: Integrator, steps: Steps, ground: Array, *, every: int
    ) -> Iterator[Workspace]:
        """Integrate like `integrate` and yield the history in chunks.

        Parameters
        ----------
        every : int
            Number of steps between two rows of the history.

        Yields
        ------
        Workspace
            The same workspace for each chunk, with a new history array. Its `rows_before` is the
            number of rows of the previous chunks. The chunk of a failure is not yielded.
        """
        ground, steps = self._from_first_run(ground, steps)
        width = history_width(self.building)
        row_count = max(2, _CHUNK_BYTES // (8 * width))  # 8 bytes for each value
        space = self.loaded_arrays(integrator, steps.h)
        # The first row of the history is the initial state, before the first step.
        done, total_rows = 0, steps.count // every + 1
        while done < steps.count:
            # `first_row` is the number of rows in the previous chunks. The chunk ends with the last
            # step before the first row of the next chunk.
            first_row = done // every + 1 if done else 0
            last = min((first_row + row_count) * every - 1, steps.count)
            space.steps_per_row, space.rows_before = every, self.completed + first_row
            space.history = np.zeros((min(row_count, total_rows - first_row), width))
            if self.initial and not done:
                store_first_row(space, self.initial.ground_acceleration)
            loop = self.loop(integrator, steps.h, ground, space)
            if self._integrate_interruptibly(loop, replace(steps, count=last), done) < 0:
                return
            if len(space.history):
                yield space
            done = last

    def integrate_in_parts(
        self, integrator: Integrator, steps: Steps, ground: Array, firsts: Sequence[int]
    ) -> Iterator[Workspace]:
        """Integrate like `integrate` and yield parts of the run, each with separate peaks.

        Parameters
        ----------
        firsts : sequence of int
            Number of steps before each part, increasing from 0. Parts that would start at or after
            the end of the run (`steps.count`) are omitted.

        Yields
        ------
        Workspace
            Arrays at the end of each part, to be read before the next part is requested. A part
            that fails is not yielded.
        """
        ground, steps = self._from_first_run(ground, steps)
        space = self.loaded_arrays(integrator, steps.h)
        loop = self.loop(integrator, steps.h, ground, space)
        for done, last in pairwise(
            (*(first for first in firsts if first < steps.count), steps.count)
        ):
            if self._integrate_interruptibly(loop, replace(steps, count=last), done) < 0:
                return
            yield space
            _reset_peaks(integrator, space, slice(None))

    def integrate_batch(
        self,
        integrator: Integrator,
        h: float,
        runs: Sequence[RunSpec],
        criterion: RestCriterion = NO_FREE_VIBRATION,
        *,
        every: int = 1,
        on_history: Callable[[int, Array], None] | None = None,
        samples: SampleTables | None = None,
    ) -> BatchResult:
        """Integrate many runs with one time step. Each run equals that of `integrate`.

        All runs share one set of arrays and a single list of arguments of the compiled loop.

        Parameters
        ----------
        every : int
            Number of steps between two rows of a history.
        on_history : callable, optional
            Function that receives the index of a run and the completed rows of its history (view,
            shape (rows, width)), to the end of the continued motion. The next run overwrites these
            rows. By default, histories are not kept.
        samples : SampleTables, optional
            Tables of the building of each run, which are written to the arrays of the building.
        """
        if self.initial:
            starts = [self._from_first_run(run.ground, run.steps) for run in runs]
            runs = [RunSpec(a, run.scale, b) for run, (a, b) in zip(runs, starts, strict=True)]
        row_count = max(run.steps.count for run in runs) // every + 1 if on_history else 0
        space = self.loaded_arrays(integrator, h, row_count)
        space.steps_per_row = every
        initial = copy_of(space)
        ground = np.zeros(max(run.ground.size for run in runs))
        loop = self.loop(integrator, h, ground, space)
        result, n = BatchResult.empty(len(runs), self.building), self.building.stories
        for i, run in enumerate(runs):
            restore(space, initial)
            if samples:
                samples.write(i, self.building, space, h)
            np.multiply(run.ground, run.scale, out=ground[: len(run.ground)])
            ground[len(run.ground) :] = 0.0
            # The run is integrated in a single call, because it is short.
            code = loop(run.steps, 0, run.steps.count)
            completed, at_rest = 0 if code < 0 else run.steps.count, not criterion.windows
            if code == 0 and criterion.windows:
                code, completed, at_rest = _integrate_to_rest(
                    loop, run.steps, criterion, integrator, space
                )
            elif code == 0 and run.steps.continues:
                code, completed = self._continue_while_growing(
                    loop, integrator, run.steps, ground, space
                )
            result.peaks[i], result.totals[i] = space.peaks, space.totals
            result.drifts[i] = space.law_state[rows.DRIFT, :n]
            result.ends[i] = code, completed, at_rest
            if self.building.elements:
                result.elements[i] = element_results(space.law_state, n)
            if self.building.branched:
                result.devices[i] = device_results(self.building, space)
            if on_history:
                reached = int(space.totals[rows.STEPS_REACHED]) - self.completed
                result.ends[i, STEPS_COMPLETED] = reached
                kept = space.history[: reached // every + 1]
                if code == 0 and reached > run.steps.count:
                    # The number of steps is known now: integrate again with all rows.
                    longer = self.loaded_arrays(integrator, h, reached // every + 1)
                    longer.flags[:], longer.limits[:] = space.flags, space.limits
                    longer.steps_per_row = every
                    steps = replace(run.steps, count=reached)
                    self.loop(integrator, h, ground, longer)(steps, 0, reached)
                    kept = longer.history
                on_history(i, kept)
        return result

    def _continue_while_growing(
        self, loop: Loop, integrator: Integrator, steps: Steps, ground: Array, space: Workspace
    ) -> tuple[int, int]:
        """Continue a completed run with the ground at rest as long as a peak could be exceeded, and
        return 0 or the code of the failed step, and the number of steps.

        The run continues in windows of a period until the energy is too small (`_may_grow`), or
        until no peak grows in `_QUIET_WINDOWS` windows. If no peak has grown at all, the results at
        the end of `steps` are restored. The history ends with `steps`.
        """
        if self.forces.size or not _may_grow(self.building, space):
            return 0, steps.count
        at_end = copy_of(space)
        if space.history.size:  # a loop without the history
            history, space.history = space.history, space.history[:0]
            loop = self.loop(integrator, steps.h, ground, space)
            space.history = history
        completed, quiet, has_grown = steps.count, 0, False
        for _ in range(_MOST_WINDOWS):
            before = space.peaks[: rows.PEAK_ROWS].copy()
            # As in a free vibration, the period is 2 pi over the ratio of the largest velocity to
            # the largest displacement.
            fastest = space.peaks[rows.PEAK_VELOCITY].max()
            ratio = space.peaks[rows.PEAK_DISPLACEMENT].max() / fastest if fastest else 0.0
            last = completed + max(1, math.ceil(2.0 * math.pi * ratio / steps.h))
            code = loop(replace(steps, count=last), completed, last)
            if code < 0:
                return code, completed
            completed = last
            grows = bool(np.any(space.peaks[: rows.PEAK_ROWS] > (1.0 + _GROWTH) * before))
            has_grown |= grows
            quiet = 0 if grows else quiet + 1
            if quiet == _QUIET_WINDOWS or not _may_grow(self.building, space):
                break
        if has_grown:
            return 0, completed
        restore(space, at_end)
        return 0, steps.count

    def loaded_arrays(self, integrator: Integrator, h: float, row_count: int = 0) -> Workspace:
        """Check that the method supports the building, load the kernels, and return the arrays of a
        time integration in the initial state.

        Parameters
        ----------
        row_count : int
            Number of rows of the history; by default no history.

        Raises
        ------
        AnalysisError
            The method does not support the building, or a law or the method of a plug-in is
            invalid.
        """
        if reason := unsupported_reason(integrator, self.building):
            raise AnalysisError(reason)
        self.compile([integrator])
        moments = integrator.family.moments
        columns = moments(self.building, h) if moments and self.points.size else 0
        # The kernels continue from these arrays, so that each run has a separate copy of the
        # forces.
        forces = np.pad(self.forces, ((0, 0), (0, columns))) if columns else self.forces
        space = workspace(self.building, integrator, row_count, self.collapse_drift, forces)
        space.state[rows.DISPLACEMENT, :-1] = self.displacement
        space.state[rows.VELOCITY, :-1] = self.velocity
        space.flags[rows.UNRESOLVED_MODES] = self.building.fastest * h > MAX_RESOLVED_OMEGA_DT
        if self.initial:
            restore(space, self.initial.space)
            restart(space, self.building)
            if first := integrator.family.step_peaks:
                space.scratch[first : first + 2 * rows.PEAK_ROWS, : self.building.stories] = (
                    space.peaks
                )
            space.rows_before = self.completed
            if row_count:
                store_first_row(space, self.initial.ground_acceleration)
        return space

    def loop(
        self,
        integrator: Integrator,
        h: float,
        ground: Array,
        space: Workspace,
        *,
        is_stepped: bool = False,
    ) -> Loop:
        """Return a function (steps, first, last) that integrates the steps from `first` to `last` -
        1 by the compiled time loop, and returns 0 or the negative code of a step that fails.

        All arguments of the compiled loop except the steps are fixed. The function continues from
        the state of the arrays in `space` at the time of its call, and changes them. With
        `is_stepped`, for a `Stepper`, the loop of matrices does not update peaks and histories.
        """
        building, before = self.building, self.completed
        if building.uses_matrices:
            # Imported here, because few models have matrices.
            from tdint.methods.linear_step import step_coefficients
            from tdint.response.runs.linear_loop import LinearLoop

            coefficients = step_coefficients(integrator)
            # As in a compiled loop, the rows of forces are those of the workspace.
            loads = space.forces[:, : rows.FORCE_COLUMNS], self.points
            linear = LinearLoop(building, loads, h, ground, space, coefficients)
            call_linear = linear.step if is_stepped else linear
            return lambda steps, first, last: call_linear(steps, before + first, before + last)
        if building.inertial and self.points.size:
            raise AnalysisError(
                "a model with inertance and a law that is not linear has no forces from tables, "
                "pulses or files; use harmonic forces, or linear laws with the method exact"
            )
        fixed = (
            space.steps_per_row,
            space.rows_before,
            HALVINGS if integrator.family.halvable else 0,
            h,
            ground,
            self.points,
            self.coefficients(integrator, h),
            state_jumps(integrator, h),
            *Scene(
                building.linear_terms,
                building.modal,
                building.law_parameters,
                space.forces,
                space.flags,
            ),
            *space.memory,
            np.zeros(rows.LOAD_SIZE),
            *space.seen,
        )

        def bound() -> tuple[Any, Any]:
            """Return the time loop, and the time loop with the constant arguments."""
            step, *others = (
                kernel.variant(self.variant) for kernel in (integrator.family.step, *LOOP_KERNELS)
            )
            function = integrate.variant(self.variant)
            return function, bind(function, step, *others, *fixed)

        function, call = bound()

        def integrate_steps(steps: Steps, first: int, last: int) -> int:
            """Integrate the steps from `first` to `last` - 1 of `steps`."""
            nonlocal function, call
            use_compiled_kernels()
            if building.inertial and steps.stride > 1:
                raise AnalysisError(
                    "a model with inertance needs a time step of at most the sampling interval, "
                    f"{h / steps.stride:.6g} s; use a shorter time step"
                )
            if integrate.variant(self.variant) is not function:  # compiled in the meantime
                function, call = bound()
            code: int = call(
                before + steps.count, before + first, before + last, steps.per_sample, steps.stride
            )
            return code

        return integrate_steps

    def _integrate_interruptibly(self, loop: Loop, steps: Steps, done: int = 0) -> int:
        """Integrate the steps after the first `done` in calls of about `_CALL_SECONDS` seconds.

        Python handles an interrupt (Ctrl-C) only between two calls. The result is 0 or the negative
        code of the failed step.
        """
        size = max(_FIRST_CALL_SIZE // (self.building.stories * (1 + len(self.building.modal))), 1)
        if self.building.uses_matrices:
            size = steps.count  # the loop in Python can be interrupted at any time
        # The number of steps of the first call is a guess. The number of steps of each following
        # call is adapted to the measured speed, and is at most doubled.
        while True:
            last = min(done + size, steps.count)
            began = time.perf_counter()
            code = loop(steps, done, last)
            if code < 0 or last == steps.count:
                return code
            seconds = time.perf_counter() - began
            done, size = last, max(1, min(2 * size, int(size * _CALL_SECONDS / max(seconds, 1e-6))))
