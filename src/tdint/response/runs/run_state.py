"""State of a time integration between two steps: copy, restoration, and continuation of a run.

The arrays of a workspace that a run changes contain its whole state: the rows of the method, the
states of laws, dampers and fractures, and the memory of the observer. A run that continues from
copies of these arrays, with the same number of completed steps, equals an uninterrupted run.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tdint.arrays import Array, Numbers, cached_property, immutable
from tdint.errors import UsageError
from tdint.kernels import layout as rows
from tdint.kernels.stepping import Scene, Span
from tdint.kernels.stories.impact import damping_slope
from tdint.kernels.stories.law_state import (
    commit,
    restoring_force,
    resume,
    store_step_start,
    tangent_in_motion,
)
from tdint.kernels.stories.law_tables import law_state_table
from tdint.kernels.time_loop.observer import (
    initialize_laws,
    observe,
    store,
    store_previous,
    sum_law_energies,
)
from tdint.methods.method import Integrator
from tdint.methods.workspace import MOMENT, TOTAL_BASE_MOMENT, Workspace, history_width
from tdint.model.building import Building
from tdint.response.arguments import finite_numbers, one_line
from tdint.tabular import Described

if TYPE_CHECKING:
    from tdint.response.runs.history import History
    from tdint.response.runs.linear_loop import LinearLoop

_CHANGED = (
    "state",
    "law_state",
    "scratch",
    "step_status",
    "observer_state",
    "peaks",
    "totals",
    "forces",
)
"""Arrays of a workspace that a run changes, without the history."""


def copy_of(space: Workspace) -> Workspace:
    """Return a workspace with copies of the arrays that a run changes, and without a history."""
    copies = {name: getattr(space, name).copy() for name in _CHANGED}
    return replace(space, history=space.history[:0].copy(), rows_before=0, **copies)


def restore(space: Workspace, saved: Workspace) -> None:
    """Set the arrays that a run changes to the values of a copy."""
    for name in _CHANGED:
        getattr(space, name)[...] = getattr(saved, name)


@immutable
class RunState(Described):
    """State of a building between two steps of a time integration: `Response.final_state`,
    `Stepper.state`.

    `run(model, record, initial=state)` continues from the state. All values refer to the time
    `time`; the arrays have an element for each floor or story, in SI units.

    Attributes
    ----------
    dt : float
        Time step, s.
    steps : int
        Number of completed time steps.
    ground_acceleration : float
        Ground acceleration, m/s^2.
    method : Integrator
        Method of the time integration.
    building : Building
        Building as arrays.
    loads : tuple of ndarray
        Forces on floors and points of their tables (`load_arrays`).
    space : Workspace
        Arrays of the time integration.
    """

    dt: float
    steps: int
    ground_acceleration: float
    method: Integrator
    building: Building
    loads: tuple[Array, Array]
    space: Workspace

    def _headline(self) -> str:
        return f"of {self.building.floors} floors at {self.time:.6g} s, {self.method.label}"

    @property
    def time(self) -> float:
        """Time since the start of the first run, s."""
        return self.steps * self.dt

    @property
    def displacement(self) -> Array:
        """Displacements of the floors relative to the ground, m; read-only."""
        return self._row(rows.DISPLACEMENT)

    @property
    def velocity(self) -> Array:
        """Velocities of the floors relative to the ground, m/s; read-only."""
        return self._row(rows.VELOCITY)

    def _row(self, row: int) -> Array:
        """Return a row of the state of the floors. A change of the array raises ValueError."""
        return _read_only(self.space.state[row, : self.building.floors])

    @property
    def laws(self) -> Array:
        """Variables of the hysteresis models, read-only: a column for each story, attachment and
        link, a column of zeros, and columns of elements.

        The first rows are drift (m), force (N), the internal variable (the force z of `bilinear`
        and `bouc-wen`, N) and dissipated energy (J). `tdint.kernels.layout` describes the others,
        which belong to laws with branches.
        """
        return _read_only(self.space.law_state[:])

    def replace(
        self,
        displacement: Numbers | None = None,
        velocity: Numbers | None = None,
        laws: Numbers | None = None,
    ) -> RunState:
        """Return the state with other displacements, velocities or variables of the laws, such as a
        particle or a corrected estimate of a filter.

        Each law moves on a straight line from the drift of its variables to its new drift, as in a
        time step. Accelerations follow from equilibrium. Energies and peaks start anew, and forces
        of braces remain.

        Parameters
        ----------
        displacement, velocity : sequence of float, optional
            Values relative to the ground of each floor, or of each floor and then each attachment,
            m and m/s; by default unchanged.
        laws : array of float, optional
            Variables in the form of the attribute `laws`. The force is computed again if drift and
            internal variable determine it. By default, the present variables.

        Raises
        ------
        UsageError
            A value is not a finite number, a shape differs, or the variables contradict a law.
        """
        building, space = self.building, copy_of(self.space)
        motions = {"displacement": displacement, "velocity": velocity}
        for row, (name, replaced) in enumerate(motions.items()):  # DISPLACEMENT, VELOCITY
            if replaced is not None:
                given, floors = values_of_floors(name, replaced, building), building.floors
                loaded = floors + len(building.attachments)
                values = [*given, *space.state[row, given.size : loaded]]
                space.state[row, :-1] = building.initial_values(values[:floors], values[floors:])
        if laws is not None:
            self._set_laws(space, laws)
        if building.uses_matrices:
            self._linear_loop(space).start_again(self.steps, self.ground_acceleration)
        else:
            self._start_again(space)
        restart(space, building)
        return replace(self, space=space)

    def _set_laws(self, space: Workspace, laws: Numbers) -> None:
        """Set the variables of the laws, and check that each law keeps its internal variable at its
        drift."""
        given, state = np.asarray(laws), space.law_state
        if self.building.uses_matrices or not self.steps or given.shape != state.shape:
            raise UsageError(
                f"laws must contain numbers in the shape {state.shape} of the attribute laws, "
                f"after the first step of a model without matrices, got {one_line(laws)}"
            )
        state[...] = given
        for story, drift in enumerate(state[rows.DRIFT, : self.building.stories].tolist()):
            move_law(self.building.law_parameters, state, story, drift)
        found, expected = state[rows.INTERNAL], given[rows.INTERNAL]
        is_kept = np.isclose(found, expected, rtol=1e-9, atol=0.0)
        is_kept &= np.isfinite(state[rows.FORCE])
        if not is_kept.all():
            column = int(is_kept.argmin())
            raise UsageError(
                f"laws: the variables of column {column + 1} contradict its law, which changes the "
                f"internal variable {expected[column]:.6g} to {found[column]:.6g}"
            )

    @np.errstate(all="ignore")  # as in a compiled kernel
    def _start_again(self, space: Workspace) -> None:
        """Compute the laws, accelerations and energies of other displacements and velocities, at
        the start from rest. The functions of the kernels run in Python."""
        building, ground = self.building, self.ground_acceleration
        parameters, law_state, state = building.law_parameters, space.law_state, space.state
        scene = Scene(building.linear_terms, building.modal, parameters, space.forces, space.flags)
        if not self.steps:
            law_state[...] = law_state_table(parameters)
            space.totals[rows.INITIAL_DISSIPATION] = 0.0
            initialize_laws.function(*scene, *space.memory)
        for story, (drift, rate) in enumerate(building.drifts(state[:2]).T.tolist()):
            move_law(parameters, law_state, story, drift)
            if coefficient := building.linear_terms[rows.TANGENT_DAMPING, story]:
                slope = tangent_in_motion(parameters, law_state, story, rate)
                slope = damping_slope(parameters, law_state, story, rows.COMMITTED, slope)
                state[[rows.DAMPING_FORCE, rows.DAMPING_STATE], story] = coefficient * slope * rate
        span = Span(self.time, 0.0, ground, ground, False, False, False, False)
        observe(scene, span, 0.0, space.memory, space.seen)
        store_previous(state, space.observer_state, building.stories)
        store_step_start(space.flags, law_state)
        state[rows.ACCELERATION] = space.observer_state[rows.OBSERVED_ACCELERATION]
        # Methods of several steps start again.
        space.step_status[:] = 0.0
        space.step_status[rows.STATE_GROUND] = ground
        sum_law_energies.function(*scene, *space.memory, *space.seen)

    def _linear_loop(self, space: Workspace) -> LinearLoop:
        """Return the loop of matrices for a single state."""
        from tdint.response.runs.linear_loop import LinearLoop  # few models have matrices

        return LinearLoop(self.building, self.loads, self.dt, np.zeros(1), space)

    @cached_property
    def history(self) -> History:
        """All quantities, also of attachments and links, as a history with a single row."""
        from tdint.response.runs.history import named_history  # not needed by most runs

        space = replace(self.space, history=np.zeros((1, history_width(self.building))))
        space.rows_before = self.steps
        if self.building.uses_matrices:
            loop = self._linear_loop(space)
            space.history[0] = loop.state_row(self.steps, self.ground_acceleration)
        else:
            store_first_row(space, self.ground_acceleration)
        return named_history(self.building, self.loads, space, self.dt)

    def require_same(
        self, building: Building, loads: tuple[Array, Array], method: Integrator
    ) -> None:
        """Check that the state is of the same building, forces and method.

        Parameters
        ----------
        building : Building
            Building as arrays.
        loads : tuple of ndarray
            Forces on floors and points of their tables, as the attribute.
        method : Integrator
            Method of the time integration.

        Raises
        ------
        UsageError
            The building, the forces or the method differ, as the message states.
        """
        own, system, other = self.building, self.building.system, building.system
        pairs = [
            (own.linear_terms, building.linear_terms),
            (own.law_parameters, building.law_parameters),
            (own.modal, building.modal),
            *zip(self.loads, loads, strict=True),
        ]
        is_same = (system is None) == (other is None)
        if system is not None and other is not None:
            pairs += [(getattr(system, name), getattr(other, name)) for name in _MATRICES]
        if not (is_same and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)):
            raise UsageError(
                "initial is the state of another building: stories, attachments, links, damping "
                "and forces must be those of the run that ended in this state"
            )
        if method != self.method:
            raise UsageError(
                f"initial is the state of a run by {self.method.label}, and cannot be continued by "
                f"{method.label}; omit the method, or start from displacements and velocities "
                "(`initial` in the model)"
            )


_MATRICES = ("mass", "stiffness", "damping", "loaded_mass", "influence")


def _read_only(values: Array) -> Array:
    """Return an array whose change raises ValueError."""
    values.flags.writeable = False
    return values


def values_of_floors(name: str, values: object, building: Building) -> Array:
    """Return finite numbers, one for each floor, or for each floor and then each attachment; raise
    UsageError otherwise."""
    floors, masses = building.floors, building.floors + len(building.attachments)
    given = finite_numbers(values)
    if given is None or given.shape not in ((floors,), (masses,)):
        more = f", or {masses}, also for each attachment" if masses > floors else ""
        raise UsageError(
            f"{name} must contain {floors} finite numbers, one for each floor{more}, got "
            f"{one_line(values)}"
        )
    return given


def move_law(law_parameters: Array, law_state: Array, story: int, drift: float) -> None:
    """Move the law of a story on a straight line to a drift, m."""
    restoring_force(law_parameters, law_state, story, rows.COMMITTED, rows.FIRST_TRIAL, drift)
    commit(law_parameters, law_state, story, rows.COMMITTED, rows.FIRST_TRIAL)
    resume(law_parameters, law_state, story)


def store_first_row(space: Workspace, ground: float) -> None:
    """Write the state to the first row of the history, under the ground acceleration (m/s^2)."""
    # The accelerations are in equilibrium with STATE_GROUND, the end of the line over the last
    # step.
    store(ground, space.step_status[rows.STATE_GROUND], space.memory, space.seen, 0)


def restart(space: Workspace, building: Building) -> None:
    """Prepare the arrays at the end of a run for a further run: its energies and counts start at
    zero, and its peaks at the values of the state."""
    totals, n = space.totals, building.stories
    law_state, observed = space.law_state, space.observer_state
    spent = [rows.ENERGY_INPUT, rows.ENERGY_VISCOUS, rows.ENERGY_DASHPOTS, rows.ENERGY_HYSTERETIC]
    totals[rows.INITIAL_DISSIPATION] += totals[rows.ENERGY_HYSTERETIC]
    totals[spent] = 0.0
    totals[[rows.ITERATIONS, rows.HALVINGS, rows.BRACED_DISSIPATION, rows.TANGENT_WORK]] = 0.0
    stored = [rows.ENERGY_KINETIC, rows.ENERGY_STRAIN, rows.ENERGY_BRACES]
    totals[[rows.ENERGY_INITIAL, rows.ENERGY_REFERENCE]] = totals[stored].sum()
    totals[rows.COLLAPSE_STEP] = rows.NO_COLLAPSE
    totals[[rows.COLLAPSE_STORY, rows.COLLAPSE_FAILED]] = 0.0
    space.step_status[rows.BRANCH_CHANGES] = 0.0
    law_state[rows.INITIAL_SPENT] += law_state[rows.ENERGY_SPENT]
    law_state[rows.ENERGY_SPENT] = 0.0
    law_state[rows.PEAK_FORCE] = 0.0
    observed[rows.DASHPOT_WORK] = 0.0
    space.peaks[:] = 0.0
    if building.uses_matrices:  # its loop includes the state in the peaks
        observed[MOMENT : TOTAL_BASE_MOMENT + 1] = 0.0
        return
    acceleration = observed[rows.OBSERVED_ACCELERATION] + observed[rows.ACCELERATION_DEVIATION]
    for row, values in (
        (rows.PEAK_DRIFT, law_state[rows.DRIFT]),
        (rows.PEAK_SHEAR, law_state[rows.FORCE]),
        (rows.PEAK_DISPLACEMENT, space.state[rows.DISPLACEMENT]),
        (rows.PEAK_VELOCITY, space.state[rows.VELOCITY]),
        (rows.PEAK_ACCELERATION, acceleration + space.step_status[rows.STATE_GROUND]),
        (rows.PEAK_TOTAL_SHEAR, observed[rows.TOTAL_SHEAR]),
    ):
        space.peaks[row] = np.abs(values[:n])
    if building.damped_by_devices:
        space.peaks[rows.PEAK_DRIFT_RATE] = np.abs(building.drifts(space.state[rows.VELOCITY]))
    if building.inertial and building.system is not None:
        forces = building.system.inerters @ observed[rows.OBSERVED_ACCELERATION, : building.masses]
        space.peaks[rows.PEAK_INERTER_FORCE] = np.abs(forces)
    if building.elements:
        law_state[rows.PEAK_FORCE, n + 1 :] = np.abs(law_state[rows.FORCE, n + 1 :])
    if building.has_damper_state:
        space.state[[rows.BRACE_DISSIPATED, rows.DAMPING_WORK]] = 0.0
        space.peaks[rows.PEAK_BRACE_FORCE] = np.abs(space.state[rows.BRACE_REPORTED, :n])
