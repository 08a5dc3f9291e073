"""A building under a ground motion, integrated with one time step, and the evaluation of its end.

The run is done, collapsed, diverged, not converged, or rejected. This module also contains runs
that continue with the ground at rest until free vibration has decayed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add, sub
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.outcome import (
    DIVERGED,
    ENERGY_TERMS,
    NOT_CONVERGED,
    STORY,
    UNSTABLE,
    Collapse,
    Energy,
    EnergyHistory,
    FailedRun,
    History,
    Response,
    StoryErrors,
    StoryPeaks,
    story_values,
)
from tdint.analysis.run.prepared import (
    BatchResult,
    IntegrationResult,
    PreparedBuilding,
    RestCriterion,
    RunSpec,
)
from tdint.analysis.time_steps import Steps, choose_steps
from tdint.arrays import Array, cached_property
from tdint.errors import UsageError
from tdint.ground_motion.record import Record
from tdint.kernels import layout as rows
from tdint.kernels.time_loop.loop import CODE
from tdint.methods.method import Integrator
from tdint.methods.workspace import HALVINGS, Workspace
from tdint.model.building import Building
from tdint.model.definition import LAWS, Model
from tdint.model.plausibility import (
    DUCTILITY,
    long_step,
    plausibility_warnings,
    suppression_reason,
    unusual_stories,
)
from tdint.number_parsing import pluralize

# ---- Results of a time integration, computed from its arrays

FieldFunction = Callable[[Building, Array, Array, Array], Array]
"""Function that computes a field of the history from the building, the forces on its floors
(`force_table`), the times of the rows, and the rows of the history table.
"""


def story_peaks(building: Building, space: Workspace) -> StoryPeaks:
    """Return the peaks of all stories."""
    return peaks_of(
        building, space.peaks.copy(), space.law_state[rows.DRIFT, : building.stories].copy()
    )


def peaks_of(building: Building, peaks: Array, residual_drift: Array) -> StoryPeaks:
    """Return the peaks of all stories from rows of `Workspace.peaks` and the drifts at the end."""
    return StoryPeaks(height=building.heights, **story_values(building, peaks, residual_drift))


def residual_oscillation(building: Building, space: Workspace) -> Array:
    """Return approximate amplitudes of the drifts about their positions of rest at the end of a
    run.

    At rest, no story has a force. The distance of a story from this position is its force divided
    by its present stiffness. The amplitude of the velocity part is the drift rate times the ratio
    of the maximum displacement to the maximum velocity of the run (s), and increases with the
    square root of initial to present stiffness.

    Returns
    -------
    ndarray, shape (n,)
        Amplitudes, m.
    """
    drift, force, slope = (
        space.law_state[row, : building.stories] for row in (rows.DRIFT, rows.FORCE, rows.SLOPE)
    )
    stiffness = building.initial_stiffness
    # A stiffness that is not positive, or exceeds the initial stiffness, is replaced by the initial
    # stiffness.
    present = np.where((slope > 0.0) & (slope < stiffness), slope, stiffness)
    distance = (force + building.linear_terms[rows.GEOMETRIC, :-1] * drift) / present
    rate = _drift_rates(building, space.state[rows.VELOCITY])
    displacement, velocity = (
        float(space.peaks[row].max()) for row in (rows.PEAK_DISPLACEMENT, rows.PEAK_VELOCITY)
    )
    seconds = displacement / velocity if velocity > 0.0 else 0.0
    return np.asarray(np.hypot(distance, rate * seconds * np.sqrt(stiffness / present)))


def _drift_rates(building: Building, floors: Array) -> Array:
    """Return the rates of the drifts from the rates of the floors (one row of a table)."""
    rates: Array = floors[:-1].copy()
    rates[1:] -= building.linear_terms[rows.LINK, 1:-1] * floors[:-2]
    return rates


def interstep_peak_errors(
    building: Building, space: Workspace, late: float, stories: StoryPeaks
) -> StoryErrors:
    """Return the possible excess of the peaks between time steps that do not resolve the motion.

    For residual drifts, return the approximate change of the drifts since the requested time.

    Parameters
    ----------
    building : Building
        Building.
    space : Workspace
        Arrays after the time integration.
    late : float
        Time from the requested end to the end of the last step, s.
    stories : StoryPeaks
        Peaks of the run.
    """
    drift_change = np.zeros(building.stories)
    if late > 0.0:
        velocity, acceleration = (
            np.abs(_drift_rates(building, row))
            for row in (
                space.state[rows.VELOCITY],
                space.observer_state[rows.OBSERVED_ACCELERATION],
            )
        )
        drift_change = late * velocity + 0.5 * late**2 * acceleration
    reported, bounds = vars(stories), vars(stories)
    # The possible peaks are 0 if the time steps resolve the motion.
    peaks, possible = space.peaks[: rows.PEAK_ROWS], space.peaks[rows.PEAK_ROWS :]
    if possible.any():
        bounds = story_values(building, np.maximum(possible, peaks), drift_change)
    # The difference is nan for quantities that do not exist, such as ratios without a height.
    differences = {
        quantity.name: bounds[quantity.name] - reported[quantity.name] for quantity in STORY
    }
    return StoryErrors(**{**differences, "residual_drift": drift_change})


def energy_errors(totals: Array) -> Array:
    """Return `Energy.error` of each run, shape (runs,), from rows of `Workspace.totals`."""
    terms = dict(zip(ENERGY_TERMS, totals.T[: rows.ENERGY_TERMS], strict=True))
    spent = reduce(add, [term for name, term in terms.items() if name != "input"])
    largest = totals[:, rows.ENERGY_REFERENCE]
    imbalance = totals[:, rows.ENERGY_INITIAL] + terms["input"] - spent
    return np.asarray(
        np.divide(imbalance, largest, out=np.zeros_like(largest), where=largest > 0.0)
    )


def energy_of(numbers: Array) -> Energy:
    """Return the energies at the start of an array in the order of `Workspace.totals`."""
    terms = dict(zip(ENERGY_TERMS, numbers[: rows.ENERGY_TERMS].tolist(), strict=True))
    initial, reference = numbers[rows.ENERGY_INITIAL], numbers[rows.ENERGY_REFERENCE]
    return Energy(**terms, initial=float(initial), reference=float(reference))


def history_of(
    building: Building, forces: Array, space: Workspace, h: float, largest: float | None = None
) -> History:
    """Return the response history of a time integration.

    Parameters
    ----------
    building : Building
        Building.
    forces : ndarray
        Forces on floors (`force_table`).
    space : Workspace
        Arrays after the time integration.
    h : float
        Time step, s.
    largest : float, optional
        Maximum input energy, J; required for a chunk of a history, because it applies to the
        complete run.
    """
    n = building.stories
    table = space.history
    time = h * (
        space.steps_per_row
        * np.arange(space.rows_before, space.rows_before + len(table), dtype=np.float64)
    )
    # In each row, the energies are stored after the motion. The first term is the input energy; the
    # imbalance is the part of the input and the initial energy that no other term contains.
    first_energy = 1 + rows.HISTORY_FIELDS * n
    terms = list(table[:, first_energy : first_energy + rows.ENERGY_TERMS].T)
    initial = space.totals[rows.ENERGY_INITIAL]
    largest = space.totals[rows.ENERGY_REFERENCE] if largest is None else largest
    imbalance = reduce(sub, terms[1:], initial + terms[0])
    relative = imbalance / largest if largest > 0.0 else np.zeros_like(imbalance)
    return History(
        time=time,
        ground_acceleration=table[:, 0],
        energy=EnergyHistory(**dict(zip(ENERGY_TERMS, terms, strict=True)), error=relative),
        **{name: compute(building, forces, time, table) for name, compute in HISTORIES.items()},  # type: ignore[arg-type]
    )


def _field(index: int) -> FieldFunction:
    """Return the function that reads the field with an index from the rows of the history table."""
    return lambda building, forces, time, table: table[
        :, 1 + index * building.stories : 1 + (index + 1) * building.stories
    ]


def _floor_difference(index: int) -> FieldFunction:
    """Return the function that computes the difference of a field between the floors above and
    below.
    """

    def compute(building: Building, forces: Array, time: Array, table: Array) -> Array:
        """Return the differences, shape (rows, n); the ground below the first story is fixed."""
        floors = _field(index)(building, forces, time, table)
        stories = floors.copy()
        stories[:, 1:] -= floors[:, :-1]
        return stories

    return compute


def _total_shear(building: Building, forces: Array, time: Array, table: Array) -> Array:
    """Return the sum over the floors above each story: forces on floors minus mass times
    acceleration.
    """
    floor_forces = -building.linear_terms[rows.MASS, :-1] * _ACCELERATION(
        building, forces, time, table
    )
    for force in forces:
        angle = force[rows.OMEGA] * time
        floor_forces[:, int(force[rows.FLOOR])] += force[rows.COSINE] * np.cos(angle) + force[
            rows.SINE
        ] * np.sin(angle)
    return np.asarray(np.cumsum(floor_forces[:, ::-1], axis=1)[:, ::-1])


_ACCELERATION = _field(2)
_DRIFT_RATE = _floor_difference(1)

HISTORIES: dict[str, FieldFunction] = {
    "displacement": _field(0),
    "velocity": _field(1),
    "acceleration": _ACCELERATION,
    "drift": _floor_difference(0),
    "shear": _field(3),
    "damper_force": lambda building, *table: building.device_force(_DRIFT_RATE(building, *table)),
    "total_shear": _total_shear,
}
"""Functions that compute the fields of `History` for stories and floors, shape (rows, n)."""


# ---- Case

_LARGE_IMBALANCE = 0.01
"""Dimensionless. Energy error above which a run prints a warning."""

_PRODUCED_BY_METHOD = 1.0
"""Dimensionless. Energy produced by the method divided by the input energy. From this value,
exceeding the collapse drift is attributed to the method.
"""

RUNAWAY = 100.0
"""Dimensionless. Energy produced by the method divided by the input energy, from which a run has
diverged. 100 corresponds to ten times the amplitude.
"""

_EXCESS_FRACTION = 0.05
"""Dimensionless. Possible excess between time steps divided by the peak, above which a note is
added.
"""

_VIBRATION_FRACTION = 0.01
"""Dimensionless. Amplitude of a drift at the end divided by the maximum drift, above which a note
is added.
"""

_UNTIL_REST = "--until-rest continues until free vibration has decayed"

_REMEDY = "use a smaller step or another method"


@dataclass(frozen=True)
class Case:
    """Building, ground motion and method of a run, without its time steps.

    The building is prepared one time. Cases with different ground motions, scales or methods share
    it.

    Attributes
    ----------
    model : Model
        Building and its collapse drift; the record of its excitation section is not used.
    prepared : PreparedBuilding
        Assembled building of the model.
    record : Record or None
        Ground motion; None means that the ground is at rest.
    method : Integrator
        Method with its parameters.
    allow_unstable : bool
        Run a method above its stability limit, and accept a response whose energy was produced by
        the method.
    remarks : tuple of str
        Notes on the preparation of the case, one sentence each; they are included in the notes of
        its runs.
    """

    model: Model
    prepared: PreparedBuilding
    record: Record | None
    method: Integrator
    allow_unstable: bool = False
    remarks: tuple[str, ...] = ()

    @property
    def building(self) -> Building:
        """Building as arrays."""
        return self.prepared.building

    @cached_property
    def ground(self) -> Array:
        """Ground acceleration at the samples, m/s^2; a single zero if the ground is at rest."""
        return np.zeros(1) if self.record is None else self.record.acceleration.copy()

    @cached_property
    def plausibility_warnings(self) -> tuple[str, ...]:
        """Warnings on unusual values of the building and the ground motion, as `check` shows."""
        # The warnings of the record are reported when it is read; do not repeat them.
        reported = self.record.warnings if self.record else ()
        pga = self.record.pga if self.record else math.nan
        unusual = plausibility_warnings(
            self.model, self.building, pga, has_motion=self.record is not None
        )
        return tuple(text for text in unusual if text not in reported)

    def _long_step(self, steps: Steps) -> list[str]:
        """Return the warning on the time step of the model or its record.

        There is no warning on a time step that is requested or chosen for a tolerance.
        """
        interval = self.record.dt if self.record else None
        default = self.model.analysis.dt or interval
        if default is None or not math.isclose(steps.h, default, rel_tol=1e-9):
            return []
        return long_step(self.building, steps.h, interval)

    def under(self, record: Record | None) -> Case:
        """Return the same building and method under another ground motion.

        Parameters
        ----------
        record : Record or None
            Ground motion; None for free vibration or forces on floors only.
        """
        return replace(self, record=record)

    def scaled(self, factor: float) -> Case:
        """Return the same case with the ground motion multiplied by a factor other than zero.

        Forces on floors are not changed.

        Parameters
        ----------
        factor : float
            Factor on the ground acceleration.

        Raises
        ------
        UsageError
            There is no ground motion.
        """
        if self.record is None:
            raise UsageError("the case has no ground motion to scale; prepare it with a record")
        return self.under(self.record.scaled(factor))

    def steps(self, dt: float | None = None, duration: float | None = None) -> Steps:
        """Return the time steps for a requested dt and duration (s).

        The defaults are those of the model's analysis section, otherwise those of the record.

        Parameters
        ----------
        dt : float, optional
            Time step, s.
        duration : float, optional
            Duration of the time integration, s.

        Raises
        ------
        UsageError
            The time step is invalid, or it is missing and there is no record.
        """
        dt = self.model.analysis.dt if dt is None else dt
        duration = self.model.analysis.duration if duration is None else duration
        for name, value in (("dt", dt), ("duration", duration)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise UsageError(f"{name} must be a positive number of seconds, got {value!r}")
        record = self.record
        is_loaded = self.model.excitation.forces or any(
            (*self.model.initial.displacement, *self.model.initial.velocity)
        )
        if record is None and not is_loaded and (dt is None or duration is None):
            raise UsageError(
                f"{self.model.name}: the ground motion is missing; add a record (RECORD on the "
                "command line, or `excitation: {record: FILE}` in the model file)"
            )
        return choose_steps(
            dt, duration, record.dt if record else None, record.duration if record else 0.0
        )

    def integrate(self, steps: Steps, history: bool = False) -> Response:
        """Integrate over the time steps.

        Parameters
        ----------
        steps : Steps
            Time steps.
        history : bool, default False
            Keep the response history.

        Raises
        ------
        FailedRun
            The time step is above the stability limit of the method, the run diverged or did not
            converge.
        """
        # Reject a time step above the stability limit of the method for the modes of the initial
        # state.
        instability = (
            None if self.allow_unstable else self.prepared.instability(self.method, steps.h)
        )
        if instability is not None:
            h, stable = steps.h, instability.largest_stable
            omega = self.building.modes().omega[instability.index]
            remedy = (
                f"the largest stable step is {stable:.6g} s"
                if stable > 0.0
                else "no smaller step is stable"
            )
            message = (
                f"{self.method.label} is unstable at dt {h:.6g} s: mode {instability.index + 1} "
                f"(omega {omega:.6g} rad/s, omega dt {omega * h:.6g}) grows; {remedy}, or use "
                "--allow-unstable"
            )
            raise FailedRun(message, UNSTABLE, self.method.label, h, largest_stable_dt=stable)
        result = self._integrate(steps, history)
        collapse = self.judge(steps, result.code, result.space.totals)
        if result.code < 0:
            if collapse is None:
                raise self._failure(steps, result.space, result.code)
            # The run failed after a collapse. Repeat it up to the collapse, which is its result.
            steps = replace(steps, count=round(collapse.time / steps.h))
            result = self._integrate(steps, history)
        error = energy_of(result.space.totals).error
        if not -error < RUNAWAY and not self.allow_unstable:
            reason = f"the final energy is {1.0 - error:.3g} times the input energy"
            raise self._divergence(steps, result.space, reason)
        return self._response(steps, result, collapse)

    def history_chunks(self, steps: Steps, largest: float, every: int = 1) -> Iterator[History]:
        """Yield the history of a completed run in chunks, by repeating the time integration.

        The chunks together equal the history that `integrate` keeps, bit for bit.

        Parameters
        ----------
        steps : Steps
            Time steps of the run.
        largest : float
            Maximum input energy of the run, J.
        every : int, default 1
            Keep every N-th step, from the first.
        """
        for space in self.prepared.integrate_in_chunks(
            self.method, steps, self.ground, every=every
        ):
            yield history_of(self.building, self.prepared.forces, space, steps.h, largest)

    def _integrate(self, steps: Steps, history: bool = False) -> IntegrationResult:
        """Integrate over the time steps and return the arrays."""
        return self.prepared.integrate(
            self.method, steps, self.ground, history_rows=steps.count if history else 0
        )

    def _failure(self, steps: Steps, space: Workspace, code: int) -> FailedRun:
        """Return the exception for the failed step: divergence or missing convergence."""
        if code == rows.NOT_FINITE:
            return self._divergence(steps, space)
        residual = float(space.step_status[rows.RESIDUAL])
        reached = float(space.totals[rows.STEPS_REACHED]) * steps.h
        story = int(space.step_status[rows.WORST_STORY]) + 1
        event = (
            f"did not converge after {reached:.6g} s, with the step halved {HALVINGS} times: the "
            f"residual of story {story} is {residual:.1e} of its forces"
        )
        return self._failed(
            steps, NOT_CONVERGED, event, time=reached, story=story, residual=residual
        )

    def _divergence(self, steps: Steps, space: Workspace, reason: str = "") -> FailedRun:
        """Return the exception for a run that diverged after the last time reached.

        By default, the reason is the drift of the story with the maximum drift.
        """
        # The message states the kinetic energy of the motion relative to the ground if it is
        # finite.
        with np.errstate(over="ignore", invalid="ignore"):
            energy = float(0.5 * np.sum(self.building.mass * space.state[rows.VELOCITY, :-1] ** 2))
        reached, story = float(space.totals[rows.STEPS_REACHED]) * steps.h, _runaway_story(space)
        reason = reason or f"the drift of story {story} grew without bound"
        return self._divergence_error(
            steps, reached, energy if math.isfinite(energy) else None, reason, story
        )

    def _divergence_error(
        self, steps: Steps, reached: float, energy: float | None, reason: str, story: int
    ) -> FailedRun:
        """Return the exception for divergence.

        Parameters
        ----------
        steps : Steps
            Time steps.
        reached : float
            Last time reached, s.
        energy : float or None
            Kinetic energy at that time, J, if it is finite.
        reason : str
            Cause, as shown in the message.
        story : int
            Story, from 1.
        """
        size = "" if energy is None else f", kinetic energy {energy:.3g} J"
        event = f"diverged after {reached:.6g} s: {reason}{size}"
        return self._failed(steps, DIVERGED, event, time=reached, story=story, energy=energy)

    def _failed(self, steps: Steps, status: str, event: str, **facts: Any) -> FailedRun:
        """Return the exception for a run that ended early, with its message and the facts as
        attributes.
        """
        label = self.method.label
        notes = (
            *self.remarks,
            *(self.record.notes if self.record else ()),
            *self._stiffening_note(),
        )
        message = f"{label} with dt {steps.h:.6g} s {event}; {_REMEDY}"
        return FailedRun(message, status, label, steps.h, notes=notes, **facts)

    def judge(self, steps: Steps, code: int, numbers: Array) -> Collapse | None:
        """Return the collapse that a time integration recorded, or None.

        A collapse is the time at which a drift first exceeded the collapse drift or a story failed.
        It is a property of the building if the energy produced by the method up to this time is
        less than the input energy. Otherwise, a run that reached its end has diverged, and the
        result for a failed run is None.

        Parameters
        ----------
        steps : Steps
            Time steps.
        code : int
            0, or the code of the failed step.
        numbers : ndarray
            `Workspace.totals`.

        Raises
        ------
        FailedRun
            The run reached its end, but with energy produced by the method.
        """
        if numbers[rows.COLLAPSE_STEP] == rows.NO_COLLAPSE:
            return None
        collapse_step = int(numbers[rows.COLLAPSE_STEP])
        story, failed = int(numbers[rows.COLLAPSE_STORY]) + 1, bool(numbers[rows.COLLAPSE_FAILED])
        energy = energy_of(numbers[rows.COLLAPSE_ENERGIES :])
        time, produced = collapse_step * steps.h, -energy.error
        is_physical = produced < _PRODUCED_BY_METHOD and collapse_step > 0
        if is_physical or (code == 0 and (collapse_step == 0 or self.allow_unstable)):
            return Collapse(time, story, ended=code < 0, failed=failed)
        if code < 0:
            return None
        event = (
            f"story {story} failed"
            if failed
            else f"the drift ratio of story {story} exceeded the collapse drift"
        )
        reason = f"{event} with {produced:.3g} times the input energy produced by the method"
        raise self._divergence_error(steps, time, energy.kinetic, reason, story)

    def settle(
        self, steps: Steps, batch: BatchResult, i: int, history: bool = False
    ) -> Collapse | Response:
        """Return the result of run `i` of a batch that did not simply reach its end
        (`needs_review`).

        A collapse is evaluated from the results of the batch. Any other run is repeated
        individually, as far as the batch integrated it and through the step in which it failed.

        Parameters
        ----------
        steps : Steps
            Time steps of the run.
        batch : BatchResult
            Results of the batch.
        i : int
            Index of the run in the batch.
        history : bool, default False
            Keep the response history of a repeated run.

        Raises
        ------
        FailedRun
            The run failed.
        """
        code, completed, _ = batch.ends[i].astype(int).tolist()
        totals = batch.totals[i]
        is_complete = code == 0 and -energy_of(totals).error < RUNAWAY
        if is_complete and (collapse := self.judge(steps, code, totals)):
            return collapse
        reached = max(completed, int(totals[rows.STEPS_REACHED]) + 1)
        return self.integrate(replace(steps, count=max(reached, steps.count)), history)

    def failure_in_batch(self, steps: Steps, batch: BatchResult, i: int) -> FailedRun | None:
        """Return the failure of run `i` of a batch with its status only, or None if the run must be
        evaluated by `settle`, because it collapsed or reached its end.

        Parameters
        ----------
        steps : Steps
            Time steps of the run.
        batch : BatchResult
            Results of the batch.
        i : int
            Index of the run in the batch.
        """
        code, totals = int(batch.ends[i, CODE]), batch.totals[i]
        if code == 0:
            has_diverged = not -energy_of(totals).error < RUNAWAY and not self.allow_unstable
            status = DIVERGED if has_diverged else None
        elif self.judge(steps, code, totals) is not None:
            status = None  # a collapse before the failed step
        else:
            status = DIVERGED if code == rows.NOT_FINITE else NOT_CONVERGED
        label = self.method.label
        message = f"{label} with dt {steps.h:.6g} s: {status}"
        return FailedRun(message, status, label, steps.h) if status else None

    def _response(
        self, steps: Steps, result: IntegrationResult, collapse: Collapse | None
    ) -> Response:
        """Return the result of a completed run with its warnings and notes."""
        space = result.space
        energy, stories = energy_of(space.totals), story_peaks(self.building, space)
        # Do not warn of a large ductility of isolators, which are designed for it, and of other
        # stories without height, which do not belong to a frame.
        warnings = []
        if not self.model.plausibility_off and (stories.ductility > DUCTILITY.high).any():
            has_height = np.isfinite(self.building.heights)
            ductility = np.where(has_height, stories.ductility, math.nan)
            warnings = unusual_stories(DUCTILITY, ductility)
        # The warnings of `check` are first, because all results depend on the building.
        unusual = [*self.plausibility_warnings, *self._long_step(steps)]
        if not abs(energy.error) <= _LARGE_IMBALANCE:
            change = "dissipated by" if energy.error > 0.0 else "produced by"
            # This warning follows a warning of an unusual ductility, which may be due to a wrong
            # unit: a smaller step would not correct it.
            warnings.append(
                f"the energy imbalance is {100.0 * abs(energy.error):.2g} % of the input "
                f"energy, {change} the method: use a smaller step or another method",
            )
        history = (
            history_of(self.building, self.prepared.forces, space, steps.h)
            if space.history.size
            else None
        )
        response = Response(
            model=self.model,
            record=self.record,
            status=collapse.status if collapse else "done",
            method=self.method.label,
            dt=steps.h,
            steps=steps.count,
            iterations=int(space.totals[rows.ITERATIONS]),
            substeps=int(space.totals[rows.HALVINGS]),
            branch_changes=int(space.step_status[rows.BRANCH_CHANGES]),
            solver_time=result.seconds,
            stories=stories,
            energy=energy,
            history=history,
            history_chunks=partial(self.history_chunks, steps, energy.reference),
            notes=(),
            interstep_bound=interstep_peak_errors(self.building, space, steps.late, stories),
            residual_oscillation=residual_oscillation(self.building, space),
            collapse=collapse,
            warnings=(*unusual, *warnings),
        )
        return replace(response, notes=self._notes(response))

    def _notes(self, response: Response) -> tuple[str, ...]:
        """Return the notes on a run, which a collapse may have ended early."""
        record, end = self.record, response.steps * response.dt
        amplitude = response.residual_oscillation
        ended = response.collapse is not None and response.collapse.ended
        notes = [*suppression_reason(self.model), *self.remarks, *(record.notes if record else ())]
        if record and end > record.duration * (1.0 + 1e-9):
            notes.append(
                f"the record ends at {record.duration:.6g} s; the ground is at rest after it"
            )
        elif record and not ended and end < record.duration:
            # Imported here, because most runs continue until the end of the record.
            from tdint.ground_motion.measures import cut_off

            notes += cut_off([record], end)
        if self.method.family.linear_only and self.model.excitation.forces:
            notes.append("exact interpolates harmonic forces linearly between time steps")
        notes += self._stiffening_note()
        if response.substeps:
            notes.append(
                "time steps that did not converge were halved "
                f"({pluralize(response.substeps, 'time')} in total)"
            )
        # Name the peaks that may be much larger between the time steps.
        names = {
            "drifts": "peak_drift",
            "displacements": "peak_displacement",
            "velocities": "peak_velocity",
            "accelerations": "peak_absolute_acceleration",
        }
        bound, stories = vars(response.interstep_bound), vars(response.stories)
        unresolved = [
            label
            for label, name in names.items()
            if (bound[name] > _EXCESS_FRACTION * stories[name]).any()
        ]
        if unresolved:
            notes.append(
                "the time step does not resolve the highest modes: between time steps, peak "
                f"{', '.join(unresolved)} may be larger than reported; use a smaller step"
            )
        # If the building still vibrates, the drifts at the end are not residual drifts. Under
        # forces on floors, which do not end, there is no state of rest.
        i = int(amplitude.argmax())
        is_at_rest = amplitude[i] <= _VIBRATION_FRACTION * response.stories.peak_drift.max()
        if record and not (ended or self.model.excitation.forces or is_at_rest):
            length, size = self.model.output_units.unit("m")
            drift = (
                f"{1e3 * amplitude[i]:.2g} mm"
                if length == "m"
                else f"{amplitude[i] / size:.2g} {length}"
            )
            # The period, which takes time to compute, is needed only if the run continued after the
            # record.
            extra = end - record.duration
            reached_limit = extra > 0.0 and extra >= REST_PERIODS * self.prepared.period
            advice = (
                f"--until-rest stops after {REST_PERIODS:g} first periods"
                if reached_limit
                else _UNTIL_REST
            )
            notes.append(
                f"the building still vibrates at the end (drift of story {i + 1} by about "
                f"+-{drift}): "
                f"residual drifts are instantaneous values; {advice}"
            )
        return tuple(notes)

    def _stiffening_note(self) -> tuple[str, ...]:
        """Return a note if the method is unstable for a story that stiffens."""
        if not self.method.family.limited_by_stiffening:
            return ()
        laws = [story.law for story in self.model.stories]
        stories = [
            i for i, law in enumerate(laws, start=1) if LAWS[law.name].stiffens(law.parameters)
        ]
        if not stories:
            return ()
        return (
            f"{self.method.method.name} is stable only for small time steps if a story becomes "
            f"stiffer than initially, which is possible for story {stories[0]}: check with a "
            "smaller step",
        )


def case_of(argument: Case) -> Case:
    """Return the argument, or raise UsageError if it is not a Case."""
    if not isinstance(argument, Case):
        raise UsageError(
            f"case must be a result of prepare(model, record), got {type(argument).__name__}"
        )
    return argument


def needs_review(batch: BatchResult) -> NDArray[np.bool_]:
    """Return True for runs that failed, collapsed, or ended with energy produced by the method.

    The result has the shape (runs,).
    """
    has_diverged = ~(-energy_errors(batch.totals) < RUNAWAY)  # True also for nan
    collapsed = batch.totals[:, rows.COLLAPSE_STEP] != rows.NO_COLLAPSE
    return np.asarray((batch.ends[:, CODE] < 0) | collapsed | has_diverged)


def _runaway_story(space: Workspace) -> int:
    """Return the story (from 1) with the maximum drift, or the first without a finite drift."""
    u = space.state[rows.DISPLACEMENT, :-1]
    finite = np.isfinite(u)
    if not finite.all():
        return int(np.argmin(finite)) + 1
    return int(np.argmax(np.abs(np.diff(u, prepend=0.0)))) + 1


REST_PERIODS = 100.0
"""Maximum duration with the ground at rest, in first periods of the building."""

AT_REST = 1e-3
"""Dimensionless. Amplitude of the remaining motion divided by the maximum displacement, below which
a building is at rest.
"""


def windows(prepared: PreparedBuilding, h: float) -> RestCriterion:
    """Return the criterion for the end of free vibration with time steps of h (s).

    A window is one first period. The run ends after a window with velocities below those of an
    amplitude of `AT_REST` times the maximum displacement, at the latest after `REST_PERIODS`
    windows.
    """
    period = prepared.period
    return RestCriterion(
        math.ceil(period / h), round(REST_PERIODS), AT_REST * 2.0 * math.pi / period
    )


def until_rest(case: Case, steps: Steps) -> tuple[Steps, bool]:
    """Return the time steps of a run until rest, and True if the building comes to rest.

    If the run fails, the steps include the step of the failure.
    """
    criterion, spec = windows(case.prepared, steps.h), RunSpec(0, case.ground.size, 1.0, steps)
    batch = case.prepared.integrate_batch(case.method, steps.h, case.ground, [spec], criterion)
    code, count, at_rest = batch.ends[0].tolist()
    # The number of completed steps is known at the ends of windows only. A failed step is within
    # the next window.
    if code < 0:
        count += criterion.window
    return replace(steps, count=max(int(count), steps.count)), bool(at_rest) and code >= 0
