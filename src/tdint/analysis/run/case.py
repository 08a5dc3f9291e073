"""A building under a ground motion, integrated with one step, and how that ended: done, collapsed, diverged, not
converged, or refused; and runs that go on with the ground at rest until the building is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run import run_totals
from tdint.analysis.run.outcome import Collapse, Energy, FailedRun, History, Response, StoryErrors, StoryPeaks
from tdint.analysis.run.prepared import Lane, Marched, MarchedRuns, PreparedBuilding, Rest
from tdint.analysis.run.steps import Steps, choose_steps
from tdint.analysis.run.workspace import HALVINGS, Workspace
from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.ground_motion.record import Record
from tdint.kernels import layout as at
from tdint.kernels.march.many import CODE
from tdint.kernels.march.strides import LONGEST, SHORTEST, TAKEN
from tdint.methods.method import Integrator
from tdint.model.building import Building, falling_stories
from tdint.model.definition import Model
from tdint.model.laws import LAWS
from tdint.written_numbers import how_many

_LARGE_IMBALANCE = 0.01
"""Energy error above which a run says so."""

_MADE = 1.0
"""Energy made by the method, over the input energy, from which a drift beyond the collapse drift is its doing."""

RUNAWAY = 100.0
"""Energy made by the method, over the input energy, from which a run has diverged: ten times the amplitude."""

_UNRESOLVED = 0.05
"""Part of a peak that may be hidden between the steps without a note."""

_MOVING = 0.01
"""Part of the largest drift by which one still moves at the end without a note."""

_OVERFLOW = 1e300
"""Residual from which a step that did not converge is one whose numbers ran away."""

_CURE = "use a smaller step or another method"


@dataclass(frozen=True)
class Case:
    """A building, the ground motion that it is under, and the method that integrates it: a run but for its steps.

    The building is prepared once: cases that differ in the motion, its scale or the method share it.

    Attributes
    ----------
    model : Model
        The building and its collapse drift; what it says of a record is not asked.
    prepared : PreparedBuilding
        The model's building, put together.
    record : Record or None
        The ground motion; None is ground at rest.
    integrator : Integrator
        The method.
    allow_unstable : bool
        Run a method beyond its limit, and take a motion on energy that the method made for a result.
    remarks : tuple of str
        What is to be said of how the case came about, one sentence each; they stand among the notes of its runs.
    """

    model: Model
    prepared: PreparedBuilding
    record: Record | None
    integrator: Integrator
    allow_unstable: bool = False
    remarks: tuple[str, ...] = ()

    @property
    def building(self) -> Building:
        """The building as arrays."""
        return self.prepared.building

    @cached_property
    def ground(self) -> Array | None:
        """Ground acceleration at the samples, m/s^2; None for ground at rest."""
        return None if self.record is None else self.record.acceleration.copy()

    def under(self, record: Record | None) -> Case:
        """The same building and method under another ground motion."""
        return replace(self, record=record)

    def scaled(self, factor: float) -> Case:
        """The same case with its ground motion times a factor, not zero; forces on floors stay as they are.

        Raises
        ------
        UsageError
            There is no ground motion.
        """
        if self.record is None:
            raise UsageError("no ground motion to scale: give a record")
        return self.under(self.record.scaled(factor))

    def steps(self, dt: float | None = None, duration: float | None = None) -> Steps:
        """Time steps for a wished dt and duration (s); by default those of the model's analysis, else the record's.

        Raises
        ------
        UsageError
            A step that does not fit, or none where there is no record to take it from.
        """
        dt = self.model.analysis.dt if dt is None else dt
        duration = self.model.analysis.duration if duration is None else duration
        for name, value in (("dt", dt), ("duration", duration)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise UsageError(f"{name} must be a positive number of seconds, got {value!r}")
        record = self.record
        return choose_steps(dt, duration, record.dt if record else None, record.duration if record else 0.0)

    def carrying_error(self) -> tuple[Case | None, str]:
        """The case with the error of its runs carried along; None, and why, where a run cannot.

        Methods that never do need no reason.
        """
        family = self.integrator.family.with_error
        if family is None:
            return None, ""
        if self.integrator.rho_inf != 1.0:
            return None, f"{self.integrator.label} does not carry it along; rho_inf=1 does"
        method = replace(self.integrator.method, family=family)
        return replace(self, integrator=replace(self.integrator, method=method)), ""

    def march(self, steps: Steps, history: bool = False) -> Response:
        """Integrate over the steps.

        Raises
        ------
        FailedRun
            The step is beyond the method's limit; the run diverged or did not converge.
        """
        if not self.allow_unstable:
            self._refuse_unstable(steps.h)
        marched = self._integrate(steps, history)
        collapse = self.judge(steps, marched.code, marched.space.totals)
        if marched.code < 0:
            if collapse is None:
                raise self._failure(steps, marched.space, marched.code)
            steps = replace(steps, count=round(collapse.time / steps.h))
            marched = self._integrate(steps, history)
        error = run_totals.energy_of(marched.space.totals).error
        if not -error < RUNAWAY and not self.allow_unstable:
            reason = f"the motion ends with {1.0 - error:.3g} times the input energy"
            raise self._diverged(steps, *self._reached(steps, marched.space), reason, _runaway_story(marched.space))
        return self._response(steps, marched, collapse)

    def pieces(self, steps: Steps, largest: float, every: int = 1) -> Iterator[History]:
        """The history of a run that came to its end, made again in pieces: of every so many steps, from the first one.

        `largest` is the run's largest energy. Together the pieces are what `march` keeps, bit for bit.
        """
        for space in self.prepared.march_pieces(self.integrator, steps, self.ground, every=every):
            yield run_totals.history(self.building, self.prepared.forces, space, steps.h, largest)

    def _integrate(self, steps: Steps, history: bool = False) -> Marched:
        return self.prepared.march(
            self.integrator,
            steps,
            self.ground,
            rows=steps.count if history else 0,
            collapse_drift=self.model.collapse_drift,
        )

    def _refuse_unstable(self, h: float) -> None:
        """Refuse a step beyond the method's limit for the building's modes in its initial state."""
        found = self.prepared.instability(self.integrator, h)
        if found is None:
            return
        omega = self.building.modes().omega[found.index]
        stable = found.largest_stable
        cure = f"the largest stable step is {stable:.6g} s" if stable > 0.0 else "no smaller step is stable"
        message = (
            f"{self.integrator.label} is unstable at dt {h:.6g} s: mode {found.index + 1} (omega {omega:.6g} rad/s, "
            f"omega dt {omega * h:.6g}) grows; {cure}, or use --allow-unstable"
        )
        raise FailedRun(message, "unstable-step", self.integrator.label, h, largest_stable_dt=stable)

    def _failure(self, steps: Steps, space: Workspace, code: int) -> FailedRun:
        residual = float(space.report[at.RESIDUAL])
        if code == at.NOT_FINITE or not residual < _OVERFLOW:
            story = _runaway_story(space)
            return self._diverged(steps, *self._reached(steps, space), f"the drift of story {story} ran away", story)
        reached = float(space.totals[at.STEPS_REACHED]) * steps.h
        story = int(space.report[at.WORST_STORY]) + 1
        what = (
            f"did not converge after {reached:.6g} s, with the step halved {HALVINGS} times: story {story} is out of "
            f"balance by {residual:.1e} of its forces"
        )
        return self._failed(steps, "not-converged", what, time=reached, story=story, residual=residual)

    def _reached(self, steps: Steps, space: Workspace) -> tuple[float, float | None]:
        """The time up to which the run came, s, and the kinetic energy there, J."""
        return float(space.totals[at.STEPS_REACHED]) * steps.h, _kinetic(self.building, space)

    def _diverged(self, steps: Steps, reached: float, energy: float | None, reason: str, story: int) -> FailedRun:
        size = "" if energy is None else f", kinetic energy {energy:.3g} J"
        what = f"diverged after {reached:.6g} s: {reason}{size}"
        return self._failed(steps, "diverged", what, time=reached, story=story, energy=energy)

    def _failed(self, steps: Steps, status: str, what: str, **told: Any) -> FailedRun:
        """That a run ended before its time: how, in words and in numbers."""
        label = self.integrator.label
        notes = (*self.remarks, *(self.record.notes if self.record else ()), *self._stiffening_note())
        message = f"{label} with dt {steps.h:.6g} s {what}; {_CURE}"
        return FailedRun(message, status, label, steps.h, notes=notes, **told)

    def judge(self, steps: Steps, code: int, numbers: Array) -> Collapse | None:
        """When the drift first exceeded the collapse drift or a story failed, as a march noted it that ended with a
        code and left these `numbers` (`Workspace.totals`).

        It is the building's own if the method has made less energy by then than the input energy. Else a run that came
        to its end has diverged, and of one that failed it is not said.

        Raises
        ------
        FailedRun
            The run came to its end, but on energy that the method made.
        """
        if numbers[at.COLLAPSE_STEP] == at.NO_COLLAPSE:
            return None
        taken, story = int(numbers[at.COLLAPSE_STEP]), int(numbers[at.COLLAPSE_STORY]) + 1
        failed, energy = bool(numbers[at.COLLAPSE_FAILED]), run_totals.energy_of(numbers[at.COLLAPSE_ENERGIES :])
        time, made = taken * steps.h, -energy.error
        own = made < _MADE and taken > 0
        if own or (code == 0 and (taken == 0 or self.allow_unstable)):
            return Collapse(time, story, ended=code < 0, failed=failed)
        if code < 0:
            return None
        what = f"story {story} failed" if failed else f"the drift ratio of story {story} passed the collapse drift"
        reason = f"{what} on {made:.3g} times the input energy"
        raise self._diverged(steps, time, energy.kinetic, reason, story)

    def settle(self, steps: Steps, marched: MarchedRuns, i: int, history: bool = False) -> Collapse | Response:
        """What the i-th run of many is, which is this one, if that is in doubt (`doubtful`): a collapse, or as far as
        the many came, and through the step in which it failed, run by itself.

        Raises
        ------
        FailedRun
            It failed.
        """
        code, taken, _ = marched.ends[i].astype(int).tolist()
        totals = marched.totals[i]
        at_its_end = code == 0 and -run_totals.energy_errors(marched.totals[i : i + 1])[0] < RUNAWAY
        if at_its_end and (collapse := self.judge(steps, code, totals)):
            return collapse
        most = max(taken, int(totals[at.STEPS_REACHED]) + 1)
        return self.march(replace(steps, count=max(most, steps.count)), history)

    def _response(self, steps: Steps, marched: Marched, collapse: Collapse | None) -> Response:
        space = marched.space
        energy = run_totals.energy_of(space.totals)
        stories = run_totals.story_peaks(self.building, space)
        unresolved = run_totals.unresolved(self.building, space, steps.late)
        notes = self._notes(steps, int(space.totals[at.HALVINGS]))
        moving = run_totals.moving_drift(self.building, space)
        kept, carries = space.history.size, self.integrator.family.carries_error
        history = run_totals.history(self.building, self.prepared.forces, space, steps.h) if kept else None
        response = Response(
            model=self.model,
            record=self.record,
            status=collapse.status if collapse else "done",
            method=self.integrator.label,
            dt=steps.h,
            steps=steps.count,
            iterations=int(space.totals[at.ITERATIONS]),
            halvings=int(space.totals[at.HALVINGS]),
            events=int(space.report[at.EVENTS]),
            march_time=marched.seconds,
            stories=stories,
            energy=energy,
            history=history,
            pieces=partial(self.pieces, steps, energy.largest),
            notes=(
                *(*notes, *_unresolved_note(stories, unresolved)),
                *(() if collapse and collapse.ended else self._moving_note(stories, moving)),
            ),
            unresolved=unresolved,
            moving_drift=moving,
            collapse=collapse,
            check=run_totals.carried_error(self.building, space, stories, unresolved) if carries else None,
            warnings=(*_imbalance(energy), *falling_stories(self.model)),
        )
        if space.choice is None:
            return response
        shortest, longest, taken = space.choice[[SHORTEST, LONGEST, TAKEN]].tolist()
        return replace(
            response,
            dt=steps.h * steps.count / taken,
            steps=int(taken),
            step_range=(steps.h * shortest, steps.h * longest),
            pieces=None,
        )

    def _notes(self, steps: Steps, halvings: int) -> tuple[str, ...]:
        record = self.record
        notes = [*self.remarks, *(record.notes if record else ())]
        if record and steps.count * steps.h > record.duration * (1.0 + 1e-9):
            notes.append(f"the record ends at {record.duration:.6g} s; the ground is at rest after it")
        if self.integrator.family.linear_only and self.model.excitation.forces:
            notes.append("exact takes harmonic forces as linear between the steps")
        notes += self._stiffening_note()
        if halvings:
            notes.append(f"steps that did not converge were halved, {how_many(halvings, 'time')} in all")
        return tuple(notes)

    def _moving_note(self, stories: StoryPeaks, moving: Array) -> tuple[str, ...]:
        """That the drifts at the end are not residual ones. Under forces on floors there is no rest."""
        i = int(np.argmax(moving))
        if self.record is None or self.model.excitation.forces or moving[i] <= _MOVING * np.max(stories.peak_drift):
            return ()
        length, size = self.model.output_units.unit("m")
        by = f"{1e3 * moving[i]:.2g} mm" if length == "m" else f"{moving[i] / size:.2g} {length}"
        return (
            f"the building still moves at the end, the drift of story {i + 1} by about {by} to "
            "either side: residual drifts are those of the last moment; --until-rest goes on until it is at rest",
        )

    def _stiffening_note(self) -> tuple[str, ...]:
        if not self.integrator.family.limited_by_stiffening:
            return ()
        laws = [story.law for story in self.model.stories]
        stories = [i for i, law in enumerate(laws, start=1) if LAWS[law.name].stiffens(law.parameters)]
        if not stories:
            return ()
        return (
            f"{self.integrator.method.name} is stable only for small steps where a story becomes stiffer than at rest, "
            f"as story {stories[0]} can: check with a smaller step",
        )


def case_of(given: Case) -> Case:
    """A case; UsageError for what is none."""
    if not isinstance(given, Case):
        raise UsageError(f"a case is what prepare(model, record) gives, got a {type(given).__name__}")
    return given


def doubtful(marched: MarchedRuns) -> NDArray[np.bool_]:
    """Runs that did not come to their end, collapsed, or went on with energy that the method made; shape (runs,)."""
    numbers = marched.totals
    made = ~(-run_totals.energy_errors(numbers) < RUNAWAY)
    collapsed = numbers[:, at.COLLAPSE_STEP] != at.NO_COLLAPSE
    return np.asarray((marched.ends[:, CODE] < 0) | collapsed | made)


def _imbalance(energy: Energy) -> tuple[str, ...]:
    """A warning about a motion that a method has given or taken energy."""
    if abs(energy.error) <= _LARGE_IMBALANCE:
        return ()
    change = "lost to" if energy.error > 0.0 else "made by"
    return (
        f"the energy balance is off by {100.0 * abs(energy.error):.2g} % of the input energy, {change} the "
        "method: use a smaller step or another method",
    )


def _unresolved_note(stories: StoryPeaks, unresolved: StoryErrors) -> tuple[str, ...]:
    """Which peaks the step is too long to tell."""
    kinds = {"drifts": "peak_drift", "displacements": "peak_displacement", "velocities": "peak_velocity"}
    kinds["accelerations"] = "peak_acceleration"
    words = [
        words
        for words, name in kinds.items()
        if np.any(getattr(unresolved, name) > _UNRESOLVED * getattr(stories, name))
    ]
    if not words:
        return ()
    return (
        f"the step is too long for the fastest modes: between the steps, peak {', '.join(words)} may be larger than "
        "those given; use a smaller step",
    )


def _runaway_story(space: Workspace) -> int:
    """The story with the largest drift, from 1; the first one that is no number before all others."""
    u = space.state[at.DISPLACEMENT, :-1]
    finite = np.isfinite(u)
    if not finite.all():
        return int(np.argmin(finite)) + 1
    return int(np.argmax(np.abs(np.diff(u, prepend=0.0)))) + 1


def _kinetic(building: Building, space: Workspace) -> float | None:
    """Kinetic energy of the present motion relative to the ground, J; None if it is no finite number."""
    with np.errstate(over="ignore", invalid="ignore"):
        energy = float(0.5 * np.sum(building.mass * space.state[at.VELOCITY, :-1] ** 2))
    return energy if math.isfinite(energy) else None


REST_PERIODS = 100.0
"""How long a run goes on with the ground at rest, in first periods of the building."""

AT_REST = 1e-3
"""Amplitude of what is left of the motion, over the largest displacement, from which a building is at rest."""


def windows(prepared: PreparedBuilding, h: float) -> Rest:
    """The first periods by which a run of steps h (s) goes on until the velocities in one of them are those of an
    amplitude below `AT_REST` times the largest displacement; `REST_PERIODS` of them at most."""
    period = prepared.period
    return Rest(math.ceil(period / h), round(REST_PERIODS), AT_REST * 2.0 * math.pi / period)


def until_rest(case: Case, steps: Steps) -> tuple[Steps, bool]:
    """The steps of a run that goes on until the building is at rest, and whether it comes to that.

    Where the run fails on the way, the steps are those with which it does.
    """
    ground: NDArray[np.float64] = np.zeros(1) if case.ground is None else case.ground
    marched = case.prepared.march_many(
        case.integrator,
        steps.h,
        ground,
        [Lane(0, ground.size, 1.0, steps)],
        collapse_drift=case.model.collapse_drift,
        rest=windows(case.prepared, steps.h),
    )
    code, count, at_rest = marched.ends[0].tolist()
    if code < 0:
        count += windows(case.prepared, steps.h).window
    return replace(steps, count=max(int(count), steps.count)), bool(at_rest) and code >= 0
