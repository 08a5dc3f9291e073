"""Time integration that is driven from outside, one step at a time: `tdint.Stepper`."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tdint.arrays import Array, Numbers
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as rows
from tdint.methods.workspace import Workspace
from tdint.response.arguments import AnyModel, finite_numbers, number_of, one_line
from tdint.response.runs.prepared import Loop
from tdint.response.runs.run import prepare
from tdint.response.runs.run_state import RunState, copy_of, restore, values_of_floors
from tdint.response.time_steps import Steps
from tdint.tabular import Described

_FIRST_SAMPLES = 1024
"""Steps for which the arrays of a new stepper have space; the arrays then double."""


class Stepper(Described):
    """Building whose ground motion and floor forces are specified step by step: for control,
    filters, hybrid simulation and reinforcement learning.

    Each step is the compiled step of the method, so that the response equals that of `run` under
    the same ground motion, bit for bit. The record of the model is not used; its forces on floors
    act, and its initial motion is the state at the start.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Argument that `run` accepts.
    method : str, optional
        Method specification; default as for `run`.
    dt : float, optional
        Time step, s; by default that of the model's `analysis` section.

    Raises
    ------
    UsageError
        The method is unknown, or the time step is missing or not positive.
    ModelError
        The model is invalid.
    AnalysisError
        The method does not support the building, or the time step is above its stability limit.

    Examples
    --------
    >>> import tdint
    >>> building = {"stories": [{"mass": 1e5, "stiffness": 4e7}]}
    >>> stepper = tdint.Stepper(building, "impulse4", 0.01)
    >>> for acceleration in (0.5, 1.0):
    ...     stepper.step(acceleration)
    >>> stepper.state.displacement.shape
    (1,)
    """

    def __init__(self, model: AnyModel, method: str | None = None, dt: float | None = None) -> None:
        case = prepare(model, method=method).under(None)
        if case.across is not None:
            raise UsageError("Stepper: the model has two directions; use a model for each of them")
        h = number_of(case.model.analysis.dt if dt is None else dt, "dt")
        if h is None:
            raise UsageError("Stepper: dt is missing; specify the time step in s")
        case.require_stability(h)
        self._case, self._steps = case, replace(case.steps(h, h), count=0)
        self.reset()

    def _headline(self) -> str:
        return f"of {self._case.model.name!r} at {self.time:.6g} s, {self._case.method.label}"

    @property
    def time(self) -> float:
        """Time after the last step, s."""
        return self._count * self._steps.h

    @property
    def state(self) -> RunState:
        """State after the last step; later steps do not change it."""
        space = copy_of(self._space)
        if not self._count:  # a call without steps computes the accelerations at the start
            self._loop_of(space)(self._steps, 0, 0)
        forces = self._prepared.forces.copy()
        forces[:, rows.POINTS] = space.forces[:, rows.POINTS]
        case = replace(self._case, prepared=replace(self._prepared, forces=forces))
        return case.state(space, self._steps.h, self._count, float(self._ground[self._count]))

    def reset(self, state: RunState | None = None) -> None:
        """Continue from a state, or from the initial motion of the model, with the ground at rest
        and without floor forces.

        Parameters
        ----------
        state : RunState, optional
            State of this building, method and time step, also after steps with floor forces.

        Raises
        ------
        UsageError
            The state is of another building, method or time step.
        """
        prepared = self._case.prepared
        if state is not None:
            forces, points = state.loads
            own = forces[: len(prepared.forces)], points[: prepared.points.size]
            replace(state, loads=own).require_same(
                prepared.building, prepared.loads, self._case.method
            )
            if state.dt != self._steps.h:
                raise UsageError(
                    f"reset: the state has dt {state.dt:.6g} s, the stepper {self._steps.h:.6g} s; "
                    "use equal time steps"
                )
            first = state.space.state[: rows.VELOCITY + 1, :-1]
            prepared = replace(
                prepared, displacement=first[0], velocity=first[1], forces=forces, points=points
            )
        self._prepared = prepared
        self._table: Array | None = None
        self._space = prepared.loaded_arrays(self._case.method, self._steps.h)
        self._count = state.steps if state else 0
        self._ground = np.zeros(self._count + _FIRST_SAMPLES)
        if state and self._count:
            restore(self._space, state.space)
            self._ground[self._count] = state.ground_acceleration
        if prepared.points.size > self._case.prepared.points.size:
            self._extend_table(0)
        self._bind()

    def copy(self) -> Stepper:
        """Return an independent stepper in the same state."""
        other = object.__new__(Stepper)
        other.__setstate__(self.__getstate__())
        return other

    __copy__ = copy

    def __deepcopy__(self, _: dict[int, object]) -> Stepper:
        """Return an independent stepper, as `copy`."""
        return self.copy()

    def __getstate__(self) -> dict[str, object]:
        """Return the attributes with copies of all arrays that steps change, without the time
        loop."""
        state = {name: value for name, value in vars(self).items() if name != "_loop"}
        return state | {"_space": copy_of(self._space), "_ground": self._ground.copy()}

    def __setstate__(self, state: dict[str, object]) -> None:
        """Set the attributes, and bind the time loop to the arrays."""
        vars(self).update(state)
        if self._table is not None:
            self._extend_table(0)
        self._bind()

    def step(
        self, ground_acceleration: float | Numbers, floor_forces: Numbers | None = None
    ) -> None:
        """Integrate one time step.

        Ground acceleration and forces are linear within the step, from the values of the previous
        step; both start at zero.

        Parameters
        ----------
        ground_acceleration : float
            Ground acceleration at the end of the step, m/s^2; also an array with one number.
        floor_forces : sequence of float, optional
            Force on each floor, or on each floor and then on each attachment, at the end of the
            step, N; by default zero.

        Raises
        ------
        UsageError
            A value is not a finite number, or the number of forces is not that of the floors.
        FailedRun, AnalysisError
            The step diverged or did not converge, or a story has no resistance left. `reset`
            returns to the start.
        """
        # An ordinary number needs no array, which would take a fourth of the time of a step.
        if type(ground_acceleration) is float and math.isfinite(ground_acceleration):
            acceleration = ground_acceleration
        else:
            given = finite_numbers(ground_acceleration)
            if given is None or given.size != 1:
                raise UsageError(
                    "step: ground_acceleration must be a finite number, got "
                    f"{one_line(ground_acceleration)}"
                )
            acceleration = given.item()
        if floor_forces is not None or self._table is not None:
            self._set_forces(floor_forces)
        end = self._count + 1
        if end == self._ground.size:
            self._ground = np.append(self._ground, np.zeros(end))
            self._bind()
        self._ground[end] = acceleration
        # As in a run with a history, the energies of the laws are updated after each step.
        code = self._loop(Steps(self._steps.h, end), self._count, end)
        self._count = end
        if code < 0:
            raise self._case.failure(self._steps, self._space, code)
        if self._space.totals[rows.COLLAPSE_FAILED] == rows.NO_RESISTANCE:
            story = int(self._space.totals[rows.COLLAPSE_STORY]) + 1
            raise AnalysisError(
                f"step: story {story} has no resistance left at {self.time:.6g} s; use reset to "
                "return to the start"
            )

    def _bind(self) -> None:
        """Bind the time loop to the present arrays."""
        self._loop = self._loop_of(self._space)

    def _loop_of(self, space: Workspace) -> Loop:
        """Return the time loop for the arrays of a time integration."""
        method, h = self._case.method, self._steps.h
        return self._prepared.loop(method, h, self._ground, space, is_stepped=True)

    def _set_forces(self, floor_forces: Numbers | None) -> None:
        """Append the forces at the end of the next step to the table of the floors."""
        building = self._prepared.building
        values = np.zeros(building.floors + len(building.attachments))
        if floor_forces is not None:
            given = values_of_floors("step: floor_forces", floor_forces, building)
            values[: given.size] = given
        if self._table is None:
            self._add_table(values.size)
        assert self._table is not None
        forces = self._space.forces[-values.size :]
        point = int(forces[0, rows.POINTS])
        if point == len(self._table):
            self._extend_table(point)
            self._bind()
        self._table[point, 0] = (self._count + 1) * self._steps.h
        self._table[point, 1:] = values
        forces[:, rows.POINTS] = point + 1

    def _add_table(self, floors: int) -> None:
        """Add a table of forces with a column for each floor and attachment (`floors` columns),
        which starts at the present time."""
        prepared, old = self._case.prepared, self._space
        forces = np.zeros((floors, rows.FORCE_COLUMNS))
        forces[:, rows.FLOOR] = np.arange(floors)
        forces[:, rows.TIMES] = prepared.points.size
        forces[:, rows.VALUES] = prepared.points.size + 1 + np.arange(floors)
        forces[:, rows.STRIDE] = floors + 1
        forces[:, [rows.POINTS, rows.FACTOR]] = 1.0
        forces[0, rows.NEW_TIMES] = 1.0
        forces[:, rows.LINE_TIME] = self.time
        points = np.append(prepared.points, np.zeros(_FIRST_SAMPLES * (floors + 1)))
        points[prepared.points.size] = self.time
        self._prepared = replace(
            prepared, forces=np.concatenate([prepared.forces, forces]), points=points
        )
        space = self._prepared.loaded_arrays(self._case.method, self._steps.h)
        space.forces[: len(old.forces), : old.forces.shape[1]] = old.forces
        self._space = replace(old, forces=space.forces)
        self._extend_table(0)
        self._bind()

    def _extend_table(self, more: int) -> None:
        """Copy the points of all tables of forces, with space for more points of the floors."""
        building = self._prepared.building
        width = building.floors + len(building.attachments) + 1
        points = np.append(self._prepared.points, np.zeros(more * width))
        self._prepared = replace(self._prepared, points=points)
        self._table = points[self._case.prepared.points.size :].reshape(-1, width)
