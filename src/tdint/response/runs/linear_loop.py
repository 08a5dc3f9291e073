"""Response of models of matrices and inerters, instead of the compiled time loop.

The load is linear within each interval, which is a sampling interval of the ground motion or a time
step (the shorter of the two). The modes are therefore integrated exactly (`tdint.methods.exact`)
with any time step. Between the intervals, the response is computed on a grid that resolves the
highest mode, and around each maximum of the grid by a polynomial with the derivatives at both
endpoints of an interval, which the modes determine. The peaks are therefore the peaks of the
continuous response. Models of inerters can also be integrated by the steps of
`tdint.methods.linear_step`, with a time step of at most the sampling interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError, ModelError
from tdint.kernels import layout as rows
from tdint.kernels.time_loop.loop import RUNAWAY
from tdint.methods import workspace
from tdint.methods.exact_step import oscillator, van_loan
from tdint.methods.linear_step import Coefficients, transition
from tdint.model.building import Building
from tdint.model.force_arrays import add_force_history
from tdint.model.linear_system import Lag
from tdint.response.time_steps import Steps

_RESOLVED = 1.0
"""Maximum circular frequency times interval of the grid; a maximum between two points is then at
most 14 % above them."""

_MOST_PARTS = 8
"""Maximum number of intervals of the grid in an interval of the load. Modes that this does not
resolve follow the load almost statically."""

_FINE_PARTS = 16
"""Number of points in an interval of the grid for the evaluation of the polynomial of a maximum. A
parabola through three points then has a relative error of 1e-8."""

_SMALL = 1e-9
"""Dimensionless. Rounding of the maxima that are compared."""

_BLOCK_NUMBERS = 2_000_000
"""Approximate size of the arrays of a block of steps, in numbers: 16 MB."""


_Indices = NDArray[np.intp]


class _Transition:
    """Exact step of the modes over a duration, with the state (displacements, velocities) in the
    last two axes, shape (2, modes).

    Parameters
    ----------
    ratios : ndarray or None
        Damping ratios; None if the damping couples the modes.
    matrices : tuple of ndarray, shapes (modes, modes)
        Modal stiffness matrix, 1/s^2, and damping matrix, 1/s, if the damping couples the modes.
    patterns : ndarray, shape (modes, loads)
        Modal loads per unit of each load.
    coefficients : tuple of float, optional
        Coefficients of the step of a method; default: the exact step.
    """

    def __init__(
        self,
        omega: Array,
        ratios: Array | None,
        matrices: tuple[Array, Array],
        patterns: Array,
        duration: float,
        coefficients: Coefficients | None = None,
    ) -> None:
        h = duration
        self.patterns = patterns
        self.is_coupled = ratios is None or coefficients is not None
        if ratios is None or coefficients is not None:
            step = partial(transition, coefficients=coefficients) if coefficients else None
            self.matrix = van_loan(*matrices, patterns, h, step)
            return
        # Columns of u0, h v0, h^2 p0 and h^2 p1, rows of u1 and h v1
        steps = oscillator(omega * h, ratios) * np.array([1.0, h, h * h, h * h])
        steps[:, 1] /= h
        self.columns = steps.transpose(2, 1, 0)

    def dense(self) -> Array:
        """Return the matrix of the state at the start and of the loads at start and end, shape (2
        modes, 2 modes + 2 loads)."""
        if self.is_coupled:
            return self.matrix
        return np.vstack(
            [
                np.hstack(
                    [
                        *(np.diag(column) for column in self.columns[:2, row]),
                        *(column[:, None] * self.patterns for column in self.columns[2:, row]),
                    ]
                )
                for row in range(2)
            ]
        )

    def forced(self, load_0: Array, load_1: Array) -> Array:
        """Return the part of the state at the end due to the loads, shape (..., loads)."""
        if self.is_coupled:
            loads, n = self.patterns.shape[1], len(self.patterns)
            by_load = self.matrix[:, 2 * n :]
            end = load_0 @ by_load[:, :loads].T + load_1 @ by_load[:, loads:].T
            return np.asarray(end.reshape(*load_0.shape[:-1], 2, n))
        modal_0, modal_1 = (load @ self.patterns.T for load in (load_0, load_1))
        state = np.empty((*modal_0.shape[:-1], 2, modal_0.shape[-1]))
        for row in range(2):
            np.multiply(self.columns[2, row], modal_0, out=state[..., row, :])
            state[..., row, :] += self.columns[3, row] * modal_1
        return state

    def free(self, state: Array) -> Array:
        """Return the part of the state at the end due to the state at the start."""
        if self.is_coupled:
            n = len(self.patterns)
            flat = state.reshape(*state.shape[:-2], 2 * n)
            return np.asarray((flat @ self.matrix[:, : 2 * n].T).reshape(state.shape))
        end = self.columns[0] * state[..., :1, :]
        end += self.columns[1] * state[..., 1:, :]
        return np.asarray(end)


@dataclass
class _Output:
    """Quantity with required peaks: the modal displacements, velocities or accelerations
    (`derivative` 0, 1 or 2) times a matrix, plus the loads times another matrix.

    `peaks` is the array of the results, which is updated in place.
    """

    peaks: Array
    derivative: int
    matrix: Array
    loads: Array


@dataclass
class _Grid:
    """Response at the points of a grid: states, modal accelerations and loads."""

    states: Array
    accelerations: Array
    loads: Array

    def derivative(self, order: int) -> Array:
        """Return the modal displacements (0), velocities (1) or accelerations (2)."""
        return self.accelerations if order == 2 else self.states[..., order, :]


class LinearLoop:
    """Function (steps, first, last) that integrates the steps from `first` to `last` - 1 and
    returns 0, or NOT_FINITE, as the compiled time loop.

    Parameters
    ----------
    loads : tuple of ndarray
        Forces on floors and points of their tables (`load_arrays`).
    ground : ndarray
        Ground acceleration at the samples, m/s^2.
    coefficients : tuple of float, optional
        Coefficients of the step of a method; default: the exact step.
    """

    def __init__(
        self,
        building: Building,
        loads: tuple[Array, Array],
        h: float,
        ground: Array,
        space: workspace.Workspace,
        coefficients: Coefficients | None = None,
    ) -> None:
        assert building.system is not None
        self.building, self.system, self.space = building, building.system, space
        self.h, self.ground, self.loads = h, ground, loads
        self.coefficients = coefficients
        # The array of the workspace when the loop is made, as for a compiled loop
        self.history = space.history
        modes = building.modes()
        self.omega, self.shapes, self.highest = modes.omega, modes.shapes, float(modes.omega[-1])
        self.stiffness = np.diag(self.omega**2)
        self.damping = modes.modal_damping(self.system.damping)
        self.ratios = modes.damping_ratios(self.system.damping)
        self.floors = np.unique(loads[0][:, rows.FLOOR].astype(int))
        n = building.masses
        for floor in self.floors[np.diagonal(self.system.mass)[self.floors] == 0.0]:
            name = self.system.names[floor] if self.system.names else f"floor {floor + 1}"
            raise ModelError(
                f"force on {name}: it has no mass, so that its motion cannot follow a force; apply "
                "the force to a floor or row with mass, or give it a mass"
            )
        # The first load is the ground acceleration, the remaining loads are the forces on floors.
        self.applied = np.zeros((n, 1 + self.floors.size))
        self.applied[:, 0] = -self.system.loaded_mass @ self.system.influence
        self.applied[self.floors, 1 + np.arange(self.floors.size)] = 1.0
        self.patterns = self.driving = self.shapes.T @ self.applied
        # Coordinates with a mass, and largest rates of all coordinates, 1/s
        self.is_moving, self.rates = np.ones(self.omega.size), self.omega
        self.lag = self.system.lag
        if self.lag is not None:
            self._append_lag(self.lag)
        self.dashpots = building.linear_terms[rows.DASHPOT, :-1]
        self.has_dashpots = bool(np.any(self.dashpots))
        self.outputs = self._outputs()

    def _append_lag(self, lag: Lag) -> None:
        """Append the coordinates of rows without mass to the modal coordinates.

        The derivative of their equation, q'' = -E^T w' - q' / tau with the modal accelerations w',
        has the form of the other equations. The velocities q' at the start follow from the equation
        for q'.
        """
        count, modes = lag.rates.size, self.omega.size
        coupling, none = lag.coupling, np.zeros((modes, count))
        stiffness, damping = np.hstack([self.stiffness, none]), np.hstack([self.damping, coupling])
        self.stiffness = np.vstack([stiffness, -coupling.T @ stiffness])
        self.damping = np.vstack([damping, -coupling.T @ damping])
        self.damping[modes:, modes:] += np.diag(lag.rates)
        self.driving = np.vstack([self.patterns, -coupling.T @ self.patterns])
        self.patterns = np.vstack([self.patterns, np.zeros((count, self.patterns.shape[1]))])
        self.shapes, self.ratios = np.hstack([self.shapes, lag.shapes]), None
        self.is_moving = np.append(self.is_moving, np.zeros(count))
        self.rates = np.append(self.omega, lag.rates)
        self.omega = np.append(self.omega, np.sqrt(lag.rates))

    @cached_property
    def _to_modes(self) -> Array:
        """Matrix from the motions of the floors to the modes."""
        return np.asarray(self.system.mass @ self.shapes)

    def _modal_state(self, is_first: bool) -> Array:
        """Return the modal displacements and velocities of the state of the run, shape (2, modes);
        at the start of the run, rows without mass have their static positions."""
        floors = self.space.state[: rows.VELOCITY + 1, : self.building.masses]
        if self.lag is None:
            return floors @ self._to_modes
        modes = self.omega.size - self.lag.rates.size
        state = floors @ self._to_modes
        if not is_first:
            excess = floors[0] - state[0, :modes] @ self.shapes[:, :modes].T
            state[0, modes:] = self.lag.coordinates(self.system.stiffness, excess)
        state[1, modes:] = -state[1, :modes] @ self.lag.coupling
        state[1, modes:] -= self.lag.rates * state[0, modes:]
        return np.asarray(state)

    def __call__(self, steps: Steps, first: int, last: int) -> int:
        interval = self.h / steps.stride
        if self.coefficients and steps.stride > 1:
            raise AnalysisError(
                f"a model with inertance needs a time step of at most the sampling interval, "
                f"{interval:.6g} s, with this method; use a shorter time step, or exact"
            )
        parts = self._parts(interval)
        durations = (interval, interval / parts) if parts > 1 else (interval,)
        transitions = [self._transition(duration) for duration in durations]
        per_step = steps.stride * parts
        block = max(1, _BLOCK_NUMBERS // (2 * self.omega.size * per_step))
        for start in range(first, last, block):
            end = min(start + block, last)
            grid = self._integrate(steps, (start, end), parts, transitions)
            for output in self.outputs:
                self._update_peaks(output, grid, interval / parts)
            self._store(grid, interval / parts, per_step, (start, end))
            if code := self._outcome():
                return code
        return 0

    def _parts(self, interval: float) -> int:
        """Return the number of intervals of the grid in an interval of the load."""
        if self.coefficients:
            return 1
        return min(max(1, int(np.ceil(self.highest * interval / _RESOLVED))), _MOST_PARTS)

    def _transition(self, duration: float) -> _Transition:
        """Return the step of the modes over a duration, s."""
        matrices = self.stiffness, self.damping
        modes = self.omega, self.ratios, matrices, self.driving
        return _Transition(*modes, duration, self.coefficients)

    @cached_property
    def _single(self) -> tuple[Array, Array]:
        """Fractions of a time step at the ends of its parts, shape (parts + 1, 1), and the matrix
        of one part (`_Transition.dense`)."""
        parts = self._parts(self.h)
        share = np.linspace(0.0, 1.0, parts + 1)[:, None]
        return share, self._transition(self.h / parts).dense()

    def step(self, _: Steps, first: int, last: int) -> int:
        """Integrate steps as `__call__`, one by one, without peaks and without a history: the time
        steps of a `Stepper`, whose loads are linear within a step."""
        if last == 0:  # only the results at the start
            self.start_again(0, float(self.ground[0]))
        share, matrix = self._single
        parts, size = len(share) - 1, 2 * self.omega.size
        for number in range(first, last):
            ends = self._loads(np.array([number, number + 1]), 1.0, self.h)
            loads = ends[0] + share * (ends[1] - ends[0])
            states = np.empty((parts + 1, size))
            states[0] = self._modal_state(number == 0).ravel()
            for part in range(parts):
                known = np.concatenate([states[part], loads[part], loads[part + 1]])
                np.dot(matrix, known, out=states[part + 1])
            grid = self._grid(states.reshape(parts + 1, 2, -1), loads)
            self._set_totals(grid, self._energies(grid, self.h / parts)[::parts], number)
            self._set_motion(grid)
        return self._outcome()

    def state_row(self, number: int, ground: float) -> Array:
        """Return the row of a history with the present state after `number` steps, under a ground
        acceleration, m/s^2."""
        grid = self._present(number, ground)
        return self._rows(grid, np.zeros(1, np.intp), self.space.totals[None, : rows.ENERGY_TERMS])

    def start_again(self, number: int, ground: float) -> None:
        """Store the results of other displacements and velocities; arguments as for `state_row`."""
        grid = self._present(number, ground)
        self._set_totals(grid, self._energies(grid, self.h), number)
        self._set_state(grid)

    def _present(self, number: int, ground: float) -> _Grid:
        """Return the present state as a grid of one point; arguments as for `state_row`."""
        loads = self._loads(np.array([number]), 1.0, self.h)
        loads[0, 0] = ground
        return self._grid(self._modal_state(number == 0)[None], loads)

    def _outcome(self) -> int:
        """Return NOT_FINITE if the displacements are beyond all bounds, otherwise 0."""
        largest = np.abs(self.space.state[rows.DISPLACEMENT]).max()
        return 0 if largest < RUNAWAY else rows.NOT_FINITE  # also for nan

    def _loads(self, positions: NDArray[Any], per_sample: float, interval: float) -> Array:
        """Return the ground acceleration and the forces on floors at multiples of `interval` (s),
        of which `per_sample` are in a sampling interval."""
        loads = np.zeros((positions.size, 1 + self.floors.size))
        # The ground acceleration is linear between the samples and 0 after the last sample.
        samples = np.append(self.ground, 0.0) if per_sample != 1.0 else self.ground
        if per_sample == 1.0:
            inside = positions < samples.size
            loads[inside, 0] = samples[positions[inside]]
        else:
            at = positions / per_sample
            loads[:, 0] = np.interp(at, np.arange(samples.size), samples, right=0.0)
        if self.floors.size:
            forces = np.zeros((positions.size, self.building.masses))
            add_force_history(*self.loads, np.asarray(positions * interval, dtype=float), forces)
            loads[:, 1:] = forces[:, self.floors]
        return loads

    def _grid(self, states: Array, loads: Array) -> _Grid:
        """Return a grid with the modal accelerations, which follow from equilibrium."""
        accelerations = loads @ self.driving.T
        accelerations -= self._internal(states[..., 0, :], states[..., 1, :])
        return _Grid(states, accelerations, loads)

    def _integrate(
        self, steps: Steps, span: tuple[int, int], parts: int, transitions: list[_Transition]
    ) -> _Grid:
        """Return the response over the steps of `span` on the grid with `parts` intervals in each
        interval of the load."""
        start, end = span
        count = (end - start) * steps.stride
        positions = start * steps.stride + np.arange(count + 1)
        loads = self._loads(positions, steps.per_sample, self.h / steps.stride)
        state = self._modal_state(start == 0)
        all_states = np.empty((count * parts + 1, 2, self.omega.size))
        states = all_states[:-1].reshape(count, parts, 2, -1)
        coarse, fine = transitions[0], transitions[-1]
        forced = coarse.forced(loads[:-1], loads[1:])
        for at_start, by_loads in zip(states[:, 0], forced, strict=True):
            at_start[:] = state
            state = coarse.free(state)
            state += by_loads
        all_states[-1] = state
        share = np.arange(parts)[:, None] / parts
        between = loads[:-1, None] + share * np.diff(loads, axis=0)[:, None]
        for part in range(1, parts):
            states[:, part] = fine.free(states[:, part - 1]) + fine.forced(
                between[:, part - 1], between[:, part]
            )
        all_loads = np.concatenate([between.reshape(count * parts, -1), loads[-1:]])
        return self._grid(all_states, all_loads)

    def _outputs(self) -> list[_Output]:
        """Return the quantities with peaks in the results of the run."""
        system, peaks, shapes = self.system, self.space.peaks, self.shapes
        n, loads = self.building.masses, self.applied.shape[1]
        none, ground = np.zeros((self.building.stories, loads)), np.zeros((n, loads))
        ground[:, 0] = system.influence
        inertia, drifts = -system.cuts @ system.loaded_mass, system.deformations @ shapes
        total_shear = peaks[rows.PEAK_TOTAL_SHEAR, : len(inertia)]
        outputs = [
            _Output(peaks[rows.PEAK_DRIFT], 0, drifts, none),
            _Output(peaks[rows.PEAK_SHEAR], 0, system.spring_forces @ shapes, none),
            _Output(peaks[rows.PEAK_DISPLACEMENT, :n], 0, shapes, none[:n]),
            _Output(peaks[rows.PEAK_VELOCITY, :n], 1, shapes, none[:n]),
            _Output(peaks[rows.PEAK_ACCELERATION, :n], 2, shapes, ground),
            # `applied` contains the inertia due to the ground acceleration.
            _Output(total_shear, 2, inertia @ shapes, system.cuts @ self.applied),
        ]
        flexure, observed = system.flexure, self.space.observer_state
        if self.has_dashpots:
            damped = np.where(self.dashpots[:, None] != 0.0, drifts, 0.0)
            outputs.append(_Output(peaks[rows.PEAK_DRIFT_RATE], 1, damped, none))
        if len(system.inerters):
            forces = observed[workspace.INERTER_FORCE, :-1]
            outputs.append(_Output(forces, 2, system.inerters @ shapes, none))
        if flexure is None:
            return outputs
        for row, matrix in (
            (workspace.MOMENT, flexure.moment),
            (workspace.ROTATION, flexure.rotation),
            (workspace.UNROTATED_DRIFT, flexure.shear_drift + flexure.bending_drift),
            (workspace.SHEAR_DRIFT, flexure.shear_drift),
            (workspace.BENDING_DRIFT, flexure.bending_drift),
            (workspace.BASE_ROTATION, flexure.base[:1]),
            (workspace.BASE_DISPLACEMENT, flexure.base[1:]),
        ):
            count = len(matrix)
            outputs.append(_Output(observed[row, :count], 0, matrix @ shapes, none[:count]))
        arms = flexure.levels[None]
        outputs.append(
            _Output(
                observed[workspace.TOTAL_BASE_MOMENT, :1],
                2,
                -arms @ system.loaded_mass @ shapes,
                arms @ self.applied,
            )
        )
        return outputs

    def _store(self, grid: _Grid, interval: float, per_step: int, span: tuple[int, int]) -> None:
        """Store state, energies, collapse and history of the steps of `span`."""
        space, (start, end) = self.space, span
        energies = self._energies(grid, interval)[::per_step]
        references = self._set_totals(grid, energies, start)
        self._record_collapse(grid, per_step, start, energies, references)
        self._set_state(grid)
        if len(self.history):
            numbers = np.arange(start, end + 1)
            is_new = (numbers > start) | (numbers == space.rows_before * space.steps_per_row)
            kept = (numbers % space.steps_per_row == 0) & is_new
            points = per_step * np.flatnonzero(kept)
            positions = numbers[kept] // space.steps_per_row - space.rows_before
            self.history[positions] = self._rows(grid, points, energies[kept])

    def _set_totals(self, grid: _Grid, energies: Array, start: int) -> Array:
        """Store the energies after the steps from `start`, and return the reference energies."""
        totals = self.space.totals
        if start == 0:
            displacement, velocity = grid.states[0]
            kinetic = self.is_moving * velocity**2
            initial = 0.5 * float(np.sum((self.omega * displacement) ** 2 + kinetic))
            totals[rows.ENERGY_INITIAL] = totals[rows.ENERGY_REFERENCE] = initial
        reference = totals[rows.ENERGY_INITIAL] + energies[:, rows.ENERGY_INPUT]
        references = np.maximum.accumulate(np.maximum(reference, totals[rows.ENERGY_REFERENCE]))
        totals[: rows.ENERGY_TERMS] = energies[-1]
        totals[rows.ENERGY_REFERENCE] = references[-1]
        totals[rows.STEPS_REACHED] += len(energies) - 1
        totals[rows.ITERATIONS] += len(energies) - 1
        return np.asarray(references)

    def _set_motion(self, grid: _Grid) -> None:
        """Store the displacements and velocities at the end of a grid, the memory of the loop."""
        n = self.building.masses
        self.space.state[: rows.VELOCITY + 1, :n] = grid.states[-1] @ self.shapes.T

    def _set_state(self, grid: _Grid) -> None:
        """Store the state at the end of a grid, also for the results of a run."""
        self._set_motion(grid)
        space, n, count = self.space, self.building.masses, self.building.stories
        drift = self.system.deformations @ space.state[rows.DISPLACEMENT, :n]
        space.observer_state[rows.OBSERVED_ACCELERATION, :n] = self.shapes @ grid.accelerations[-1]
        # The force that only this drift would need, as in `assemble`
        stiffness = self.building.story_laws[rows.STIFFNESS]
        space.law_state[rows.DRIFT, :count] = drift
        space.law_state[rows.FORCE, :count] = stiffness * drift
        space.law_state[rows.SLOPE, :count] = stiffness

    def _rows(self, grid: _Grid, points: _Indices, energies: Array) -> Array:
        """Return the rows of the history at points of a grid."""
        displacement, velocity, acceleration = (
            grid.derivative(order)[points] @ self.shapes.T for order in range(3)
        )
        ground = grid.loads[points, :1]
        of_links = np.zeros((len(points), self.building.stories - self.building.masses))
        return np.hstack(
            [
                ground,
                *(displacement, of_links),  # links have no mass
                *(velocity, of_links),
                *(acceleration + ground * self.system.influence, of_links),
                displacement @ self.system.spring_forces.T,
                energies,
            ]
        )

    def _energies(self, grid: _Grid, interval: float) -> Array:
        """Return the energies at all points of the grid, shape (points, ENERGY_TERMS).

        The powers are integrated by the trapezoidal rule with their rates at the endpoints.
        """
        displacement, velocity = grid.states[:, 0], grid.states[:, 1]
        loads, acceleration = grid.loads, grid.accelerations
        result = np.zeros((len(loads), rows.ENERGY_TERMS))
        result[0] = self.space.totals[: rows.ENERGY_TERMS]
        rate = (loads[1:] - loads[:-1]) / interval
        speed = velocity @ self.patterns
        kink = _dots(speed[:-1] - speed[1:], rate)
        work = _integral(
            _dots(speed, loads), _dots(acceleration @ self.patterns, loads), interval
        ) + (interval**2 / 12.0 * kink)
        result[1:, rows.ENERGY_INPUT] = result[0, rows.ENERGY_INPUT] + work.cumsum()
        # Equilibrium gives the damping forces without another product of matrices.
        inertia, moving = self.is_moving * acceleration, self.is_moving * velocity
        force = loads @ self.patterns.T - inertia - self.omega**2 * displacement
        lost = _integral(_dots(velocity, force), 2.0 * _dots(acceleration, force), interval)
        if self.has_dashpots:
            drifts = self.system.deformations @ self.shapes
            rate, change = (order @ drifts.T for order in (velocity, acceleration))
            spent = _integral(rate**2, 2.0 * rate * change, interval) * self.dashpots
            self.space.observer_state[rows.DASHPOT_WORK, :-1] += spent.sum(axis=0)
            spent = spent.sum(axis=1)
            lost -= spent
            result[1:, rows.ENERGY_DASHPOTS] = result[0, rows.ENERGY_DASHPOTS] + np.cumsum(spent)
        result[1:, rows.ENERGY_VISCOUS] = result[0, rows.ENERGY_VISCOUS] + lost.cumsum()
        result[:, rows.ENERGY_KINETIC] = 0.5 * _dots(velocity, moving)
        stretched = self.omega * displacement
        result[:, rows.ENERGY_STRAIN] = 0.5 * _dots(stretched, stretched)
        return result

    def _record_collapse(
        self, grid: _Grid, per_step: int, start: int, energies: Array, references: Array
    ) -> None:
        """Record the first step where a drift exceeds the collapse drift."""
        totals, limits = self.space.totals, self.space.limits
        limit = limits[rows.LIMIT] * limits[rows.HEIGHT]
        is_new = totals[rows.COLLAPSE_STEP] == rows.NO_COLLAPSE
        if not (is_new and np.any(self.space.peaks[rows.PEAK_DRIFT] > limit)):
            return
        drift = np.abs(grid.derivative(0) @ (self.system.deformations @ self.shapes).T)
        ratio = np.nan_to_num(drift / limit)
        # A peak between two points of the grid can be the first peak.
        point = int(np.argmax(ratio.max(axis=1) > min(1.0, ratio.max() * (1.0 - 1e-12))))
        step = -(-point // per_step)
        totals[rows.COLLAPSE_STEP] = start + step
        totals[rows.COLLAPSE_STORY] = int(np.argmax(ratio[point]))
        stored = totals[rows.COLLAPSE_ENERGIES :]
        stored[: rows.ENERGY_TERMS] = energies[step]
        stored[rows.ENERGY_INITIAL] = totals[rows.ENERGY_INITIAL]
        stored[rows.ENERGY_REFERENCE] = references[step]

    def _update_peaks(self, output: _Output, grid: _Grid, interval: float) -> None:
        """Update the peaks of a quantity with its maximum absolute values on the grid and between
        its points.

        A maximum between two points is at most 1 - cos(omega h / 2) above the larger one, with the
        highest circular frequency omega and the interval h of the grid.
        """
        size = grid.derivative(output.derivative) @ output.matrix.T
        if np.any(output.loads):
            size += grid.loads @ output.loads.T
        np.abs(size, out=size)
        top = np.fmax(size.max(axis=0), output.peaks)
        np.copyto(output.peaks, top, where=~np.isnan(top))
        resolved = min(self.highest * interval, 1.0)
        margin = resolved**2 / 8.0 + _SMALL
        is_large = size >= np.where(top > 0.0, (1.0 - margin) * top, np.inf)
        point, column = np.divmod(np.flatnonzero(is_large), len(top))
        last, reach, tolerance = len(size) - 1, np.full(point.size, np.inf), margin
        if output.derivative < 2 or not self.floors.size:
            # The quantity has no kinks: only maxima of the grid count, and of displacements and
            # velocities only the maxima with a parabola that reaches the largest maximum.
            before, here, after = (
                size[np.clip(point + shift, 0, last), column] for shift in (-1, 0, 1)
            )
            is_inner = (point > 0) & (point < last)
            reach = np.where(is_inner, _vertex(before, here, after), (1.0 + margin) * here)
            tolerance = margin if output.derivative == 2 else resolved**4 / 32.0 + _SMALL
            kept = np.flatnonzero(
                (here >= before) & (here >= after) & (reach >= (1.0 - tolerance) * top[column])
            )
            kept = kept[np.argsort(-reach[kept], kind="stable")]
            point, column, reach = point[kept], column[kept], reach[kept]
        # The largest maximum of each row excludes most of the other maxima.
        first = np.unique(column, return_index=True)[1]
        self._refine(output, grid, interval, point[first], column[first])
        others = reach >= (1.0 - tolerance) * output.peaks[column]
        others[first] = False
        self._refine(output, grid, interval, point[others], column[others])

    def _refine(
        self, output: _Output, grid: _Grid, interval: float, point: _Indices, column: _Indices
    ) -> None:
        """Update the peaks of rows of a quantity (`column`) with the maximum absolute values in the
        intervals before and after points of the grid."""
        last, width = len(grid.loads) - 1, len(output.peaks)
        intervals = np.concatenate([point - 1, point]) * width + np.tile(column, 2)
        intervals = np.unique(intervals[(intervals >= 0) & (intervals < last * width)])
        if intervals.size:
            point, column = np.divmod(intervals, width)
            peaks = self._between(output, grid, interval, point, column)
            np.maximum.at(output.peaks, column, peaks)

    def _between(
        self, output: _Output, grid: _Grid, interval: float, point: _Indices, column: _Indices
    ) -> Array:
        """Return the maximum absolute values of rows of a quantity (`column`) in intervals of the
        grid, which start at `point`: maxima of the polynomial through the values and the first
        three derivatives at the start and end."""
        points, at = np.unique(np.concatenate([point, point + 1]), return_inverse=True)
        columns, at_column = np.unique(column, return_inverse=True)
        load_rate = (grid.loads[point + 1] - grid.loads[point]) / interval
        # Modal displacements, velocities, accelerations and further derivatives: the part that is
        # equal on both sides of a point, and the part per unit of the rate of each load
        orders = [*np.moveaxis(grid.states[points], 1, 0), grid.accelerations[points]]
        by_rate = [np.zeros_like(self.driving.T)] * 3 + [self.driving.T]
        while len(orders) < output.derivative + 4:
            orders.append(-self._internal(orders[-2], orders[-1]))
        while len(by_rate) < len(orders):
            by_rate.append(-self._internal(by_rate[-2], by_rate[-1]))
        # Derivatives of modes that the grid does not resolve would oscillate between its points.
        resolved = output.matrix[columns] * (self.rates * interval <= 1.0)
        data = np.empty((2, 4, point.size))
        for k, order in enumerate(range(output.derivative, output.derivative + 4)):
            matrix = resolved if k else output.matrix[columns]
            rates = matrix @ by_rate[order].T + (output.loads[columns] if k == 1 else 0.0)
            values = orders[order] @ matrix.T
            for end, at_point in enumerate(np.split(at, 2)):
                value = values[at_point, at_column] + _dots(rates[at_column], load_rate)
                if k == 0:
                    value += _dots(output.loads[column], grid.loads[point + end])
                data[end, k] = interval**k * value
        size = np.abs(_HERMITE @ data.reshape(8, -1))
        top, index = size.argmax(axis=0), np.arange(len(point))
        middle = np.clip(top, 1, len(size) - 2)
        # The maximum may be between the first two points, or the last two.
        three = [size[middle + shift, index] for shift in (-1, 0, 1)]
        return np.asarray(np.maximum(size[top, index], _vertex(*three)))

    def _internal(self, displacement: Array, velocity: Array) -> Array:
        """Return the internal modal forces per mass of displacements and velocities, m/s^2."""
        if self.lag is not None:
            return np.asarray(velocity @ self.damping.T + displacement @ self.stiffness.T)
        if self.ratios is None:
            force = velocity @ self.damping
        else:
            force = (2.0 * self.ratios * self.omega) * velocity
        force += self.omega**2 * displacement
        return np.asarray(force)


def _dots(first: Array, second: Array) -> Array:
    """Return the scalar products of the rows of two arrays."""
    products: Array = np.einsum("ij,ij->i", first, second)
    return products


def _hermite(parts: int) -> Array:
    """Return the matrix of the values at equal parts of a unit interval of the polynomial with
    given value and three derivatives at the start, then at the end, shape (parts + 1, 8)."""
    powers = np.arange(8)
    rows_of_ends = []
    for end in (0.0, 1.0):
        factor = np.ones(8)
        for order in range(4):
            exponent = np.maximum(powers - order, 0)
            rows_of_ends.append(np.where(powers >= order, factor * end**exponent, 0.0))
            factor = factor * (powers - order)
    positions = np.linspace(0.0, 1.0, parts + 1)[:, None] ** powers
    return np.asarray(positions @ np.linalg.inv(np.array(rows_of_ends)))


_HERMITE = _hermite(_FINE_PARTS)


def _vertex(before: Array, here: Array, after: Array) -> Array:
    """Return the maximum of the parabola through three equidistant points; the middle point if it
    has no maximum between them."""
    bend, change = 2.0 * here - before - after, after - before
    has_vertex = 2.0 * bend >= np.abs(change)
    rise = np.divide(change**2, 8.0 * bend, out=np.zeros_like(bend), where=has_vertex & (bend > 0))
    return np.asarray(here + rise)


def _integral(values: Array, rates: Array, interval: float) -> Array:
    """Return the integral over each interval of a quantity with known rates at its start and
    end."""
    return np.asarray(
        0.5 * interval * (values[:-1] + values[1:]) + interval**2 / 12.0 * (rates[:-1] - rates[1:])
    )
