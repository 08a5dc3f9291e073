"""Run one building under one ground motion with a fixed time step, and determine how the run ends.

A run ends as done, collapsed, diverged or not converged; an unstable time step is rejected before
the run. A run can continue with the ground at rest until free vibration has decayed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property, immutable
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.axes import components_of
from tdint.ground_motion.measures import baseline_notes, cut_off
from tdint.ground_motion.record import Record, velocity_warnings
from tdint.kernels import layout as rows
from tdint.methods.method import Integrator
from tdint.methods.workspace import HALVINGS, Workspace
from tdint.model.building import Building, stiffens
from tdint.model.definition import Model
from tdint.model.model_notes import model_notes
from tdint.model.plausibility import (
    USUAL,
    long_step,
    negative_damping,
    plausibility_warnings,
    unusual_ductility,
    unusual_stories,
)
from tdint.number_parsing import pluralize
from tdint.response.runs.energy import Energy
from tdint.response.runs.loop_results import (
    device_peaks,
    energy_errors,
    interstep_peak_errors,
    named_energies,
    possible_growth,
    residual_oscillation,
    story_peaks,
)
from tdint.response.runs.outcome import (
    DIVERGED,
    NOT_CONVERGED,
    UNSTABLE,
    Collapse,
    DevicePeaks,
    FailedRun,
    Response,
    StoryPeaks,
)
from tdint.response.runs.prepared import (
    CODE,
    BatchResult,
    IntegrationResult,
    PreparedBuilding,
    RestCriterion,
    RunSpec,
    element_results,
)
from tdint.response.runs.run_state import RunState
from tdint.response.time_steps import Steps, choose_steps, moves_without_record, record_steps
from tdint.tabular import Described

if TYPE_CHECKING:
    from tdint.response.runs.elements import ElementPeaks
    from tdint.response.runs.history import History

_LARGE_IMBALANCE = 0.01
"""Dimensionless. Energy error above which the result of a run includes a warning."""

_PRODUCED_BY_METHOD = 1.0
"""Dimensionless. Energy produced by the method divided by the input energy. If it is larger, a
drift above the collapse drift is attributed to the method, not to the building.
"""

_RUNAWAY = 100.0
"""Dimensionless. Minimum energy produced by the method, divided by the input energy, of a run with
collapse that has diverged. 100 corresponds to ten times the amplitude.
"""

_WRONG_BALANCE = 1.0 + 1e-9
"""Dimensionless. Minimum energy imbalance, divided by the input energy, of a run without collapse
that has diverged: its response is not the response of the building. A method with numerical damping
can dissipate all of the input energy, which is an imbalance of 1 within rounding.
"""

_EXCESS_FRACTION = 0.05
"""Dimensionless. Possible excess of a peak between time steps, divided by the peak, above which a
note is added.
"""

_VIBRATION_FRACTION = 0.01
"""Dimensionless. Amplitude of a drift at the end divided by the maximum drift, above which a note
states that residual drifts are instantaneous values.
"""

_GROWTH = 0.02
"""Dimensionless. Growth of a peak after a requested end of the run, relative to the peak, above
which a warning is added. The amplitude of the free vibration is approximate (about 1 %).
"""

_END_AT_PEAK = 0.95
"""Dimensionless. Minimum drift at the end of a run, divided by its peak, of a story that has not
returned from its peak.
"""

_REMEDY = "use a smaller step or another method"


@immutable
class Case(Described):
    """Building, ground motion and method of a run, without its time steps.

    The building is prepared one time. Cases with different ground motions, scales or methods share
    it.

    Attributes
    ----------
    model : Model
        Building and its collapse drift; the record of its excitation section is not used.
    prepared : PreparedBuilding
        Assembled building of the model.
    record : Record | None
        Ground motion; None means that the ground is at rest.
    method : Integrator
        Method with its parameters.
    allow_unstable : bool
        Run a method above its stability limit, and accept a response with energy that was produced
        by the method.
    remarks : tuple of str
        Notes on the preparation of the case, one sentence per note; they are included in the notes
        of its runs.
    across : Case | None
        Case of direction y of a building in two directions; the case itself is for direction x.
    silent : bool
        Omit all warnings and notes, because nobody reads them: of the runs of a study, which
        reports those on its inputs once, and of additional runs.
    runs_on : bool
        True if a collapse does not end the run: that of an error estimate, up to the end of the
        run that it is compared with.
    """

    model: Model
    prepared: PreparedBuilding
    record: Record | None
    method: Integrator
    allow_unstable: bool = False
    remarks: tuple[str, ...] = ()
    across: Case | None = None
    silent: bool = False
    runs_on: bool = False

    def _headline(self) -> str:
        motion = f"under {self.record.name}" if self.record else "without ground motion"
        return f"of {self.model.name!r} {motion}, {self.method.label}"

    @property
    def building(self) -> Building:
        """Building as arrays."""
        return self.prepared.building

    @property
    def directions(self) -> tuple[Case, ...]:
        """The case, or the cases of x and y of a building in two directions."""
        if self.across is None:
            return (self,)
        return replace(self, record=components_of(self.record)[0], across=None), self.across

    @cached_property
    def ground(self) -> Array:
        """Ground acceleration at the samples, m/s^2; a single zero if the ground is at rest."""
        return np.zeros(1) if self.record is None else self.record.acceleration.copy()

    @cached_property
    def plausibility_warnings(self) -> tuple[str, ...]:
        """Warnings on unusual values of the building and the ground motion, except warnings that
        reading the record has reported. `tdint check` prints the same warnings.
        """
        reported = self.record.warnings if self.record else ()
        pga = self.record.pga if self.record else math.nan
        unusual = plausibility_warnings(
            self.model, self.building, pga, has_motion=self.record is not None
        )
        if self.record:
            unusual += velocity_warnings(self.record)
        return tuple(text for text in unusual if text not in reported)

    @cached_property
    def _baseline_notes(self) -> tuple[str, ...]:
        """Notes on the start and the baseline of the ground motion."""
        return baseline_notes(self.record) if self.record else ()

    def _long_step_warnings(self, steps: Steps) -> list[str]:
        """Return the warning that the time step is long for the building, if this applies.

        A time step that the user requests or that is chosen for a tolerance is intended and not
        checked.
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
        record : Record | None
            Ground motion; None for free vibration or forces on floors only.
        """
        if self.across is None:
            return replace(self, record=record)
        return replace(self, record=record, across=self.across.under(components_of(record)[1]))

    def integrated_by(self, method: Integrator) -> Case:
        """Return the same building and ground motion with another method, as a silent case.

        Parameters
        ----------
        method : Integrator
            Method of the new case.

        Returns
        -------
        Case
        """
        case = replace(self, method=method, silent=True)
        vars(case)["ground"] = self.ground
        return case

    def silenced(self) -> Case:
        """Return the same case without warnings and notes (`silent`)."""
        return replace(self, silent=True, across=self.across and self.across.silenced())

    def throughout(self, record: Record | None) -> Case:
        """Return the same building and method under another ground motion, without the duration in
        the model's `analysis` section.

        Parameters
        ----------
        record : Record
            Ground motion.
        """
        analysis = replace(self.model.analysis, duration=None)
        across = self.across and self.across.throughout(components_of(record)[1])
        model = replace(self.model, analysis=analysis)
        return replace(self, model=model, record=record, across=across)

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
        """Return the time steps of a run.

        Parameters
        ----------
        dt : float, optional
            Time step, s; by default that of the model's `analysis` section, otherwise the sampling
            interval of the record, or with forces from tables only, `default_step`.
        duration : float, optional
            Duration of the time integration, s; by default that of the model's `analysis` section,
            otherwise the duration of the record.

        Returns
        -------
        Steps
            Length and number of the time steps.

        Raises
        ------
        UsageError
            A value is not a positive number, the time step does not fit the record, or there is no
            ground motion and the model has no other load, time step or duration.
        """
        state = self.prepared.initial
        preferred = state.dt if state else self.model.analysis.dt
        dt = preferred if dt is None else dt
        duration = self.model.analysis.duration if duration is None else duration
        for name, value in (("dt", dt), ("duration", duration)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise UsageError(f"{name} must be a positive number of seconds, got {value!r}")
        record = self.record
        if (
            record is None
            and not (state or moves_without_record(self.model))
            and (dt is None or duration is None)
        ):
            raise UsageError(
                f"{self.model.name}: the ground motion is missing; add a record (RECORD on the "
                "command line, the argument record in Python, or `excitation: {record: FILE}` in "
                "the model file)"
            )
        note, tables = "", self.model.excitation.tables
        if dt is None and record is None and tables:
            # Imported here, because few models have tables of forces.
            from tdint.response.runs.load_notes import default_step

            dt, note = default_step(tables, self.prepared.period)
        steps = choose_steps(
            dt, duration, record.dt if record else None, record.duration if record else 0.0
        )
        if state and not math.isclose(steps.h, state.dt, rel_tol=1e-9):
            raise UsageError(
                f"initial is the state of a run with dt {state.dt:.6g} s, and cannot be continued "
                f"with dt {steps.h:.6g} s; omit dt"
            )
        return replace(steps, h=state.dt if state else steps.h, note=note)

    def integrate(self, steps: Steps, history: bool = False) -> Response:
        """Integrate over the time steps, and return the response or raise the reason of a failure.

        Parameters
        ----------
        steps : Steps
            Time steps.
        history : bool, default False
            Keep the response history.

        Returns
        -------
        Response
            Peaks, energies, warnings and notes; its status is "done", or the status of a collapse.

        Raises
        ------
        FailedRun
            The time step is above the stability limit of the method, the run diverged or did not
            converge.
        """
        if not self.allow_unstable:
            self.require_stability(steps.h)
        result = self._integrate(steps, history)
        collapse = self.recorded_collapse(steps, result.code, result.space.totals)
        if result.code < 0 and collapse is None:
            raise self.failure(steps, result.space, result.code)
        if collapse is not None and collapse.ended:
            # Repeat the run up to the collapse, which is its result.
            steps = self._up_to(collapse, steps)
            result = self._integrate(steps, history)
        elif history and result.completed > steps.count:
            # The history in memory includes the motion after the record.
            longer = replace(steps, count=result.completed, continues=False)
            result = self._integrate(longer, history)
        error = named_energies(result.space.totals).error
        if self._has_diverged(error, is_collapse=collapse is not None):
            # The error is 1 minus the ratio of all other energies to the input energy.
            reason = f"the final energy is {1.0 - error:.3g} times the input energy"
            raise self._divergence(steps, result.space, reason)
        return self._response(steps, result, collapse)

    def _up_to(self, collapse: Collapse, steps: Steps) -> Steps:
        """Return the time steps of a run up to a collapse that ends it."""
        count = round(collapse.time / steps.h) - self.prepared.completed
        return replace(steps, count=count, continues=False)

    def _has_diverged(self, error: float, *, is_collapse: bool) -> bool:
        """Return True if the energy imbalance of a run, divided by the input energy, shows that its
        response is wrong. A negative error is energy produced by the method. After a collapse, only
        a large production counts, because the drifts are without limit."""
        # The negated comparisons are also true if the error is nan.
        has_diverged = not (-error < _RUNAWAY if is_collapse else abs(error) < _WRONG_BALANCE)
        return has_diverged and not self.allow_unstable

    def require_stability(self, h: float) -> None:
        """Check that the method is stable for all modes of the building in its initial state.

        Parameters
        ----------
        h : float
            Time step, s.

        Raises
        ------
        FailedRun
            The time step is above the stability limit of the method for a mode.
        """
        instability = self.prepared.instability(self.method, h)
        if instability is None:
            return
        stable = instability.largest_stable
        omega = self.building.stiffest_modes.omega[instability.index]
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

    def history_chunks(
        self, steps: Steps, max_input_energy: float, every: int = 1
    ) -> Iterator[History]:
        """Yield the history of a completed run in chunks, by repeating the time integration.

        The chunks together equal the history that `integrate` keeps, bit for bit.

        Parameters
        ----------
        steps : Steps
            Time steps of the run.
        max_input_energy : float
            Maximum input energy of the run, J, as the reference of energy imbalances.
        every : int, default 1
            Yield only every N-th time step; t = 0 is always the first.

        Yields
        ------
        History
            Next chunk; together the chunks cover the run in order.
        """
        if self.prepared.initial and every > 1:
            # The time loop counts the steps between rows from the start of the first run.
            first, *others = self.history_chunks(steps, max_input_energy)
            yield first.joined([first, *others]).every(every)
            return
        for space in self.prepared.integrate_in_chunks(
            self.method, steps, self.ground, every=every
        ):
            yield self._history(space, steps.h, max_input_energy)

    def _history(
        self, space: Workspace, h: float, max_input_energy: float | None = None
    ) -> History:
        """Return the history that a run stored, complete or a chunk (`named_history`)."""
        from tdint.response.runs.history import named_history  # not needed by most runs

        return named_history(self.building, self.prepared.loads, space, h, max_input_energy)

    def _integrate(self, steps: Steps, history: bool = False) -> IntegrationResult:
        """Integrate over the time steps and return the arrays, with the response at every time step
        if `history`."""
        return self.prepared.integrate(
            self.method, steps, self.ground, history_rows=steps.count if history else 0
        )

    def failure(self, steps: Steps, space: Workspace, code: int) -> FailedRun:
        """Return the exception for a run that failed in a time step.

        Parameters
        ----------
        steps : Steps
            Time steps of the run.
        space : Workspace
            Arrays of the time integration after the failed step.
        code : int
            NOT_FINITE means divergence, any other code that the equilibrium iteration did not
            converge.

        Returns
        -------
        FailedRun
            Status, time and story of the failure.
        """
        if code == rows.NOT_FINITE:
            return self._divergence(steps, space)
        residual = float(space.step_status[rows.RESIDUAL])
        reached = float(space.totals[rows.STEPS_REACHED]) * steps.h
        # The equation of an attachment or a link is reported as the equation of the roof.
        story = min(int(space.step_status[rows.WORST_STORY]), self.building.floors - 1) + 1
        event = (
            f"did not converge after {reached:.6g} s, with the step halved {HALVINGS} times: the "
            f"residual of story {story} is {residual:.1e} of its forces"
        )
        return self._failed(
            steps, NOT_CONVERGED, event, time=reached, story=story, residual=residual
        )

    def _divergence(self, steps: Steps, space: Workspace, reason: str = "") -> FailedRun:
        """Return the exception for a run that diverged; by default the reason is the growth of the
        maximum drift."""
        # Velocities of a diverged run can overflow when they are squared; the message then omits
        # the kinetic energy.
        velocity = space.state[rows.VELOCITY, : self.building.masses]
        with np.errstate(over="ignore", invalid="ignore"):
            energy = float(0.5 * np.sum(self.building.mass * velocity**2))
        reached = float(space.totals[rows.STEPS_REACHED]) * steps.h
        story = _runaway_story(space, self.building.floors)
        reason = reason or f"the drift of story {story} grew without bound"
        return self._divergence_error(
            steps, reached, energy if math.isfinite(energy) else None, reason, story
        )

    def _divergence_error(
        self, steps: Steps, reached: float, energy: float | None, reason: str, story: int
    ) -> FailedRun:
        """Return the exception for divergence at the time `reached` (s), with the kinetic energy
        (J) at that time if it is finite."""
        size = "" if energy is None else f", kinetic energy {energy:.3g} J"
        event = f"diverged after {reached:.6g} s: {reason}{size}"
        return self._failed(steps, DIVERGED, event, time=reached, story=story, energy=energy)

    def _failed(self, steps: Steps, status: str, event: str, **attributes: Any) -> FailedRun:
        """Return the exception for a run that ended early. `event` is the rest of the sentence that
        starts with the method and the time step."""
        label = self.method.label
        notes = (
            *self.remarks,
            *(self.record.notes if self.record else ()),
            *self._stiffening_note(),
        )
        message = f"{label} with dt {steps.h:.6g} s {event}; {self._remedy}"
        return FailedRun(message, status, label, steps.h, notes=notes, **attributes)

    def recorded_collapse(self, steps: Steps, code: int, totals: Array) -> Collapse | None:
        """Return the collapse that a time integration recorded, if any.

        A building collapses when a drift first exceeds the collapse drift or a story fails. The
        collapse is attributed to the building if the energy that the method produced up to this
        time is less than the input energy. Otherwise it is attributed to the method: a run that
        reached its end has then diverged, and the result for a failed run is `None`.

        Parameters
        ----------
        steps : Steps
            Time steps.
        code : int
            0, or the code of the failed step.
        totals : ndarray
            `Workspace.totals`: energies and the step of the collapse.

        Returns
        -------
        Collapse | None
            Time and story of the collapse.

        Raises
        ------
        FailedRun
            The run reached its end, but with energy produced by the method.
        """
        if totals[rows.COLLAPSE_STEP] == rows.NO_COLLAPSE:
            return None
        collapse_step = int(totals[rows.COLLAPSE_STEP])
        story, failed = int(totals[rows.COLLAPSE_STORY]) + 1, bool(totals[rows.COLLAPSE_FAILED])
        energy = named_energies(totals[rows.COLLAPSE_ENERGIES :])
        time, produced = collapse_step * steps.h, -energy.error
        is_physical = produced < _PRODUCED_BY_METHOD and collapse_step > self.prepared.completed
        # A collapse at step 0 is due to the initial drifts. It is reported only for a run that
        # reached its end (code 0). The result of a failed run with a collapse would be a repeated
        # run up to the step of the collapse, and a run of 0 steps has no result.
        if is_physical or (code == 0 and (collapse_step == 0 or self.allow_unstable)):
            # A linear building, and a run that begins beyond the limit, run on.
            ends = is_physical and not (self.building.linear or self.runs_on)
            return Collapse(
                time, story, ended=code < 0 or ends, failed=failed, is_unbounded=code < 0
            )
        if code < 0:
            return None
        event = (
            f"story {story} failed"
            if failed
            else f"the drift ratio of story {story} exceeded the collapse drift"
        )
        reason = f"{event} with {produced:.3g} times the input energy produced by the method"
        raise self._divergence_error(steps, time, energy.kinetic, reason, story)

    def review_batch_run(
        self, steps: Steps, batch: BatchResult, i: int, history: bool = False
    ) -> Collapse | Response:
        """Return the result of a run of a batch that `needs_review` selects.

        The result of a run that collapsed and reached its end follows from the arrays of the batch.
        Any other run is repeated individually, through the step that failed, because the batch does
        not store the facts that the message of a failure states.

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

        Returns
        -------
        Collapse or Response
            The collapse, or the response of the repeated run.

        Raises
        ------
        FailedRun
            The run failed.
        """
        code, completed, _ = batch.ends[i].astype(int).tolist()
        totals = batch.totals[i]
        is_complete = code == 0 and -named_energies(totals).error < _RUNAWAY
        if is_complete and (collapse := self.recorded_collapse(steps, code, totals)):
            if not collapse.ended:
                return collapse
            ended = self._up_to(collapse, steps)
            return self._response(ended, self._integrate(ended, history), collapse)
        # The repeated run must include a failed step. If the batch continued until rest, this step
        # can be after the end of `steps`.
        reached = max(completed, int(totals[rows.STEPS_REACHED]) + (code < 0))
        return self.integrate(replace(steps, count=max(reached, steps.count)), history)

    def failure_in_batch(self, steps: Steps, batch: BatchResult, i: int) -> FailedRun | None:
        """Return the exception for a failed run of a batch without repeating the run.

        The exception has a status and a short message, but no details such as the time of the
        failure. None is the result if the run collapsed or reached its end; `review_batch_run`
        evaluates such a run.

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
        has_collapse = totals[rows.COLLAPSE_STEP] != rows.NO_COLLAPSE
        if code == 0 and has_collapse and not self.building.linear:
            return None  # a collapse may end the run before it diverges
        if code == 0:
            has_diverged = self._has_diverged(
                named_energies(totals).error, is_collapse=bool(has_collapse)
            )
            status = DIVERGED if has_diverged else None
        elif self.recorded_collapse(steps, code, totals) is not None:
            status = None  # a collapse before the failed step
        else:
            status = DIVERGED if code == rows.NOT_FINITE else NOT_CONVERGED
        label = self.method.label
        message = f"{label} with dt {steps.h:.6g} s: {status}"
        return FailedRun(message, status, label, steps.h) if status else None

    def _response(
        self, steps: Steps, result: IntegrationResult, collapse: Collapse | None
    ) -> Response:
        """Return the result of a completed run with its warnings and notes. `steps` ends at the
        collapse if the run failed after it."""
        space = result.space
        energy, stories = named_energies(space.totals), story_peaks(self.building, space)
        warnings: tuple[str, ...] = ()
        if not self.silent:
            # Warnings on the input are first, because all results depend on the input. A warning of
            # an unusual ductility precedes the warning of the energy imbalance, because it may be
            # due to a wrong unit, which a smaller step would not correct.
            warnings = (
                *self.plausibility_warnings,
                *self._long_step_warnings(steps),
                *self._demand_warnings(stories),
                *self._imbalance_warnings(energy),
            )
        growth = 0.0
        is_free = not (steps.continues or self.model.excitation.has_forces)
        if self.record is not None and is_free and not (collapse and collapse.ended):
            is_at_rest = steps.count * steps.h >= self.record.duration
            growth = possible_growth(
                self.building, space, self.prepared.period, is_at_rest=is_at_rest
            )
            growth = growth if growth > _GROWTH else 0.0
            if growth:
                warnings = (
                    *warnings,
                    f"the run ends at {steps.count * steps.h:.6g} s, while peaks still grow: they "
                    f"may become {100.0 * growth:.2g} % larger; use a longer duration, or omit it",
                )
        flexure = elements = None  # their modules are not needed by most buildings
        if self.building.system is not None and self.building.system.flexure is not None:
            from tdint.response.runs.flexure import flexure_peaks

            flexure = flexure_peaks(space, self.building.floors)
        if self.building.elements:
            from tdint.response.runs.elements import element_peaks

            results = element_results(space.law_state, self.building.stories)
            elements = element_peaks(self.model, results, stories.peak_drift)
        late = 0.0 if result.completed > steps.count else steps.late
        devices = device_peaks(self.building, space, steps.late)
        warnings = (*warnings, *_fracture_warnings(self.model, elements, devices))
        is_settled = self.is_settled((self.prepared.completed + result.completed) * steps.h)
        stories = stories.settled(is_settled)
        devices = devices and replace(devices, stories=devices.stories.settled(is_settled))
        if collapse:
            stories = stories.without_residual()
            devices = devices and replace(devices, stories=devices.stories.without_residual())
        bound = interstep_peak_errors(self.building, space, late, slice(self.building.floors))
        oscillation = residual_oscillation(self.building, space)
        response = Response(
            model=self.model,
            record=self.record,
            status=collapse.status if collapse else "done",
            method=self.method.label,
            dt=steps.h,
            steps=result.completed,
            iterations=int(space.totals[rows.ITERATIONS]),
            # Halvings of steps that did not converge
            substeps=int(space.totals[rows.HALVINGS]),
            branch_changes=int(space.step_status[rows.BRANCH_CHANGES]),
            solver_time=result.seconds,
            stories=stories,
            energy=energy,
            history=self._history(space, steps.h) if space.history.size else None,
            # The imbalances in a chunk are relative to the reference energy of the complete run.
            history_chunks=partial(
                self.history_chunks,
                replace(steps, count=result.completed, continues=False),
                energy.reference,
            ),
            record_rows=record_steps(steps, self.record.duration if self.record else None) + 1,
            final_state=self.state(space, steps.h, result.completed, result.ground),
            notes=(),
            interstep_bound=bound,
            devices=devices,
            flexure=flexure,
            residual_oscillation=oscillation[: self.building.floors],
            collapse=collapse,
            warnings=warnings,
            elements=elements,
        )
        if self.silent:
            return replace(response, growth=growth, warnings=())
        return replace(
            response,
            notes=self._notes(response, steps, oscillation),
            warnings=(*warnings, *self._resolution_warnings(response)),
            growth=growth,
        )

    def state(self, space: Workspace, h: float, completed: int, ground: float) -> RunState:
        """Return the state after a number of time steps.

        Parameters
        ----------
        space : Workspace
            Arrays of the time integration after the last step.
        h : float
            Time step, s.
        completed : int
            Number of completed time steps of the run.
        ground : float
            Ground acceleration at the end of the last step, m/s^2.

        Returns
        -------
        RunState
            State for the continuation of a run.
        """
        return RunState(
            h,
            self.prepared.completed + completed,
            ground,
            self.method,
            self.building,
            self.prepared.loads,
            replace(space, history=space.history[:0].copy()),
        )

    def _resolution_warnings(self, response: Response) -> list[str]:
        """Return the warnings that the time step does not resolve the motion, if they apply."""
        warnings = _interstep_warnings(response)
        if self.building.stiffens:
            # Imported here, because few models have such laws.
            from tdint.response.runs.stiff_peaks import stiff_peak_warnings

            warnings += stiff_peak_warnings(self.model, self.building, response)
        return warnings

    def _demand_warnings(self, stories: StoryPeaks) -> list[str]:
        """Return the warnings on unusually large ductilities and drifts of stories, and on drifts
        that end at their peak, if these apply.

        Isolators, which are designed for a large ductility, and other stories without a height,
        which do not belong to a frame, are ignored.
        """
        if self.model.plausibility_off:
            return []
        heights = self.building.heights[: self.building.floors]
        drift_ratio = stories.peak_drift / heights
        drifts_away = abs(stories.residual_drift) > _END_AT_PEAK * stories.peak_drift
        return [
            *unusual_ductility(
                self.model,
                self.building.yield_drift,
                np.where(np.isfinite(heights), stories.ductility, math.nan),
            ),
            *unusual_stories(USUAL["peak_drift"], drift_ratio),
            *unusual_stories(USUAL["residual_drift"], np.where(drifts_away, drift_ratio, math.nan)),
        ]

    def is_settled(self, time: float) -> NDArray[np.bool_]:
        """Return True, in an array without axes, if a run has no residual drifts
        (`PreparedBuilding.settled`).

        Parameters
        ----------
        time : float
            End of the run, s.
        """
        return np.asarray(self.prepared.settled(self.model, np.array([time]))[0])

    @property
    def _remedy(self) -> str:
        """Remedy for a wrong energy balance. The damping is the cause if modes have negative
        damping ratios."""
        return "correct the damping" if negative_damping(self.building) else _REMEDY

    def _imbalance_warnings(self, energy: Energy) -> list[str]:
        """Return the warning on a large energy imbalance at the end of a run, if this applies.
        Modes with negative damping are the cause of an imbalance, and another warning reports them.
        """
        # The negated comparison is also true if the error is nan.
        if abs(energy.error) <= _LARGE_IMBALANCE or negative_damping(self.building):
            return []
        change = "dissipated by" if energy.error > 0.0 else "produced by"
        return [
            f"the energy imbalance is {100.0 * abs(energy.error):.2g} % of the input "
            f"energy, {change} the method: {_REMEDY}"
        ]

    def _notes(self, response: Response, steps: Steps, oscillation: Array) -> tuple[str, ...]:
        """Return the notes on the conditions and the limits of a run.

        `oscillation` contains the amplitudes of the stories and attachments at the end, m.
        """
        record, end = self.record, response.steps * response.dt
        ended_by_collapse = response.collapse is not None and response.collapse.ended
        notes = [*model_notes(self.model), *self.remarks, *(record.notes if record else ())]
        notes += self._baseline_notes
        # The tolerance 1e-9 excludes the rounding of a number of steps times their length.
        if record and steps.continues and response.steps > steps.count:
            notes.append(
                f"the response still grew at the end of the record at {record.duration:.6g} s: the "
                f"run continues to {end:.6g} s with the ground at rest"
            )
        elif record and end > record.duration * (1.0 + 1e-9):
            notes.append(
                f"the record ends at {record.duration:.6g} s; the ground is at rest after it"
            )
        elif record and not ended_by_collapse and end < record.duration:
            notes += cut_off([record], end)
        if self.method.family.linear_only and self.model.excitation.forces:
            notes.append("exact interpolates harmonic forces linearly between time steps")
        notes += [steps.note] if steps.note else []
        if self.model.excitation.tables and not ended_by_collapse:
            # Imported here, because few models have tables of forces.
            from tdint.response.runs.load_notes import table_notes

            before = self.prepared.completed * response.dt
            notes += table_notes(self.model, before + end)
        notes += self._stiffening_note()
        if response.substeps:
            notes.append(
                "time steps that did not converge were halved "
                f"({pluralize(response.substeps, 'time')} in total)"
            )
        if response.elements is not None and np.isfinite(response.elements.ductility).any():
            notes.append(
                "the ductility of a story with elements refers to the element that yields "
                "first; the table of the elements contains the ductility of each"
            )
        # Under forces on floors, which do not end, there is no state of rest.
        is_moving = not (ended_by_collapse or self.model.excitation.has_forces)
        if record and is_moving:
            notes += self._vibration_note(response, oscillation, end - record.duration)
        return tuple(notes)

    def _vibration_note(
        self, response: Response, oscillation: Array, free_vibration: float
    ) -> list[str]:
        """Return the note that the building, or otherwise an attachment, still vibrates at the end,
        if this applies.

        `free_vibration` is the time from the end of the record to the end of the run, s; it may be
        negative.
        """
        amplitude = response.residual_oscillation
        i = int(amplitude.argmax())
        what, where, results = "the building", f"drift of story {i + 1}", "residual drifts"
        if amplitude[i] <= _VIBRATION_FRACTION * response.stories.peak_drift.max():
            if response.devices is None:
                return []
            amplitude = oscillation[self.building.floors :][: len(self.model.attachments)]
            excess = (
                amplitude
                - _VIBRATION_FRACTION * response.devices.stories.peak_drift[: amplitude.size]
            )
            if not np.any(excess > 0.0):
                return []
            i = int(excess.argmax())
            what, where = f"attachment {self.model.attachments[i].name}", "deformation"
            results = "its residual results"
        # Amplitudes are small: mm instead of m.
        unit, metres_per_unit = self.model.output_units.unit("m")
        drift = (
            f"{1e3 * amplitude[i]:.2g} mm"
            if unit == "m"
            else f"{amplitude[i] / metres_per_unit:.2g} {unit}"
        )
        # The first period needs time to compute: evaluated only if the run continued after the
        # record.
        reached_limit = (
            free_vibration > 0.0 and free_vibration >= REST_PERIODS * self.prepared.period
        )
        advice = (
            f"--until-rest stops after {REST_PERIODS:g} first periods"
            if reached_limit
            else "see --until-rest"
        )
        meaning = f": {results} are instantaneous values"
        if self.is_settled(response.steps * response.dt):
            meaning = ""
        return [f"{what} still vibrates at the end ({where} by about +-{drift}){meaning}; {advice}"]

    def _stiffening_note(self) -> tuple[str, ...]:
        """Return a note if stability of the method is limited by stories that become stiffer than
        initially, and the building has such a story.
        """
        if not self.method.family.limited_by_stiffening:
            return ()
        stories = [i for i, story in enumerate(self.model.stories, start=1) if stiffens(story)]
        if not stories:
            return ()
        return (
            f"{self.method.method.name} is stable only for small time steps if a story becomes "
            f"stiffer than initially, which is possible for story {stories[0]}: check with a "
            "smaller step",
        )


def _fracture_warnings(
    model: Model, elements: ElementPeaks | None, devices: DevicePeaks | None
) -> list[str]:
    """Return a warning for each element, attachment or link that has fractured."""
    fractures = []
    if elements is not None:
        for i in np.flatnonzero(elements.fracture_side != ""):
            name = f"story {elements.story[i]}: element {elements.element[i]}"
            fractures.append((name, elements.fracture_time[i], elements.fracture_side[i]))
    if devices is not None and devices.fracture_time is not None:
        assert devices.fracture_drift is not None
        for i in np.flatnonzero(devices.fracture_drift):
            kind = "attachment" if i < len(model.attachments) else "link"
            side = "positive" if devices.fracture_drift[i] > 0.0 else "negative"
            name = f"{kind} {model.devices[i].name}"
            fractures.append((name, devices.fracture_time[i], side))
    return [
        f"{name} fractured at {time:.4g} s on the {side} side; its ductility is that up to the "
        "fracture"
        for name, time, side in fractures
    ]


def _interstep_warnings(response: Response) -> list[str]:
    """Return a warning that lists the peak quantities that may be much larger between time steps
    than at the steps; empty if there are no such quantities.
    """
    quantities = {
        "drifts": "peak_drift",
        "displacements": "peak_displacement",
        "velocities": "peak_velocity",
        "accelerations": "peak_absolute_acceleration",
    }
    bound, stories = vars(response.interstep_bound), vars(response.stories)
    unresolved = [
        label
        for label, name in quantities.items()
        if (bound[name] > _EXCESS_FRACTION * stories[name]).any()
    ]
    if not unresolved:
        return []
    return [
        "the time step does not resolve the highest modes: between time steps, peak "
        f"{', '.join(unresolved)} may be larger than reported; use a smaller step"
    ]


def needs_review(batch: BatchResult) -> NDArray[np.bool_]:
    """Select the runs of a batch that failed, collapsed or diverged (`_WRONG_BALANCE`): their
    results are not simply the peaks at their end."""
    has_diverged = ~(abs(energy_errors(batch.totals)) < _WRONG_BALANCE)  # True also for nan
    collapsed = batch.totals[:, rows.COLLAPSE_STEP] != rows.NO_COLLAPSE
    return np.asarray((batch.ends[:, CODE] < 0) | collapsed | has_diverged)


def _runaway_story(space: Workspace, floors: int) -> int:
    """Return the story, counted from 1, with the maximum drift at the end of a diverged run.

    If a displacement is not finite, return the story below the first such floor.
    """
    displacement = space.state[rows.DISPLACEMENT, :floors]
    is_finite = np.isfinite(displacement)
    if not is_finite.all():
        return int(np.argmin(is_finite)) + 1  # argmin returns the index of the first False
    # The displacement of the ground, below the first story, is 0.
    drift = np.diff(displacement, prepend=0.0)
    return int(np.argmax(np.abs(drift))) + 1


REST_PERIODS = 100.0
"""Maximum duration with the ground at rest, in first periods of the building."""

AT_REST = 1e-3
"""Dimensionless. Amplitude of the remaining motion divided by the maximum displacement, below which
a building is at rest.
"""


def rest_criterion(prepared: PreparedBuilding, h: float) -> RestCriterion:
    """Return the criterion that ends a run with the ground at rest.

    Free vibration is examined in windows of a single first period of the building. The run ends
    after a window with all velocities below `AT_REST` times the maximum displacement times the
    first circular frequency, at the latest after `REST_PERIODS` windows.

    Returns
    -------
    RestCriterion
        Steps per window, maximum number of windows, and limit of the velocities.

    Raises
    ------
    ModelError
        A story has no initial stiffness, so that there is no first period.
    """
    period = prepared.period
    if not math.isfinite(period):
        raise ModelError(
            "free vibration until rest needs a first period, and a story has no initial stiffness; "
            "give a duration instead"
        )
    return RestCriterion(
        window=math.ceil(period / h),
        windows=round(REST_PERIODS),
        quiet=AT_REST * 2.0 * math.pi / period,
    )


def until_forces_end(model: Model, steps: Steps) -> Steps:
    """Return time steps that end after the last force from a table, before which a building is not
    at rest."""
    count = math.ceil(model.excitation.table_end / steps.h * (1.0 - 1e-9))
    return replace(steps, count=max(steps.count, count))


def extend_to_rest(case: Case, steps: Steps) -> tuple[Steps, bool]:
    """Integrate until free vibration has decayed, and return the number of time steps.

    Returns
    -------
    steps : Steps
        Time steps until rest; if the run fails, they include the step of the failure.
    is_at_rest : bool
        True if the building reaches rest before the limit `REST_PERIODS`.
    """
    steps = until_forces_end(case.model, steps)
    criterion = rest_criterion(case.prepared, steps.h)
    spec = RunSpec(case.ground, 1.0, steps)
    batch = case.prepared.integrate_batch(case.method, steps.h, [spec], criterion)
    code, count, at_rest = batch.ends[0].tolist()
    # The number of completed steps is known at the ends of windows only. A failed step is within
    # the next window.
    if code < 0:
        count += criterion.window
    return replace(steps, count=max(int(count), steps.count)), bool(at_rest) and code >= 0
