"""A building under a ground motion, integrated with one step, and how that ended: done, collapsed,
diverged, not converged, or refused; and runs that go on with the ground at rest until the building
is.
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
from tdint.analysis.run.prepared import Lane, Marched, MarchedRuns, PreparedBuilding, Rest
from tdint.analysis.run.workspace import HALVINGS, Steps, Workspace, choose_steps
from tdint.arrays import Array, cached_property
from tdint.errors import UsageError
from tdint.ground_motion.measures import cut_off
from tdint.ground_motion.record import Record
from tdint.kernels import layout as rows
from tdint.kernels.time_loop.loop import CODE
from tdint.methods.method import Integrator
from tdint.model.building import Building
from tdint.model.definition import LAWS, Model
from tdint.model.plausibility import (
    DUCTILITY,
    doubts,
    long_step,
    suppression_reason,
    unusual_stories,
)
from tdint.written_numbers import how_many

# ---- What a march left in its arrays, as results

Telling = Callable[[Building, Array, Array, Array], Array]
"""Of the rows of a history, from the building, the forces on its floors (`force_table`) and the
times of the rows."""


def story_peaks(building: Building, space: Workspace) -> StoryPeaks:
    """The peaks of all stories."""
    return peaks_of(
        building, space.peaks.copy(), space.law_state[rows.DRIFT, : building.stories].copy()
    )


def peaks_of(building: Building, peaks: Array, residual_drift: Array) -> StoryPeaks:
    """The peaks of all stories from the rows of `Workspace.peaks` and the drifts at the end."""
    return StoryPeaks(height=building.heights, **story_values(building, peaks, residual_drift))


def residual_oscillation(building: Building, space: Workspace) -> Array:
    """Amplitudes with which the drifts move about their rest at the end of a march, about, m; shape
    (n,).

    At rest no story has a force. One is as far from that as the force it has takes by its present
    stiffness, and moves with the largest displacement of the run over the largest velocity (s),
    longer as it is softer than at first.
    """
    drift, force, slope = (
        space.law_state[row, : building.stories] for row in (rows.DRIFT, rows.FORCE, rows.SLOPE)
    )
    stiffness = building.initial_stiffness
    softer = np.where((slope > 0.0) & (slope < stiffness), slope, stiffness)
    away = (force + building.linear_terms[rows.GEOMETRIC, :-1] * drift) / softer
    rate = _of_drifts(building, space.state[rows.VELOCITY])
    displacement, velocity = (
        np.max(space.peaks[row]) for row in (rows.PEAK_DISPLACEMENT, rows.PEAK_VELOCITY)
    )
    swing = displacement / velocity if velocity > 0.0 else 0.0
    return np.asarray(np.hypot(away, rate * swing * np.sqrt(stiffness / softer)))


def _of_drifts(building: Building, floors: Array) -> Array:
    """Rates of the drifts from those of the floors, a row of a table."""
    return np.asarray(floors[:-1] - building.linear_terms[rows.LINK, :-1] * np.roll(floors, 1)[:-1])


def interstep_peak_errors(building: Building, space: Workspace, late: float) -> StoryErrors:
    """How much larger the peaks may be between steps that do not resolve the motion; and by how
    much, about, the drifts have changed since the time that was asked for, which was `late` (s)
    before the end."""
    peaks, rest = space.peaks[: rows.PEAK_ROWS], np.zeros(building.stories)
    rate, bend = (
        _of_drifts(building, row)
        for row in (space.state[rows.VELOCITY], space.observer_state[rows.OBSERVED_ACCELERATION])
    )
    changed = late * np.abs(rate) + 0.5 * late**2 * np.abs(bend)
    told = story_values(building, peaks, rest)
    doubt = story_values(building, np.maximum(space.peaks[rows.PEAK_ROWS :], peaks), changed)
    return StoryErrors(**{name: doubt[name] - values for name, values in told.items()})


def energy_errors(totals: Array) -> Array:
    """`Energy.error` at the end of each run, from rows of `Workspace.totals`; shape (runs,)."""
    terms = dict(zip(ENERGY_TERMS, totals.T[: rows.ENERGY_TERMS], strict=True))
    spent = reduce(add, [term for name, term in terms.items() if name != "input"])
    largest = totals[:, rows.ENERGY_REFERENCE]
    imbalance = totals[:, rows.ENERGY_INITIAL] + terms["input"] - spent
    return np.asarray(
        np.divide(imbalance, largest, out=np.zeros_like(largest), where=largest > 0.0)
    )


def energy_of(numbers: Array) -> Energy:
    """The energies that stand at the beginning of some numbers."""
    terms = dict(zip(ENERGY_TERMS, numbers[: rows.ENERGY_TERMS].tolist(), strict=True))
    start, largest = float(numbers[rows.ENERGY_INITIAL]), float(numbers[rows.ENERGY_REFERENCE])
    return Energy(**terms, initial=start, reference=largest)


def history_of(
    building: Building, forces: Array, space: Workspace, h: float, largest: float | None = None
) -> History:
    """The history of a march with steps h (s) under forces on floors (`force_table`); of a piece of
    it the largest energy of the whole must be told."""
    n = building.stories
    table = space.history
    time = h * (space.every * np.arange(space.before, space.before + len(table), dtype=np.float64))
    # Energies stand behind the motion: what is put in is somewhere, or missing.
    behind = 1 + rows.HISTORY_FIELDS * n
    terms = list(table[:, behind : behind + rows.ENERGY_TERMS].T)
    start, largest = (
        space.totals[rows.ENERGY_INITIAL],
        space.totals[rows.ENERGY_REFERENCE] if largest is None else largest,
    )
    imbalance = reduce(sub, terms[1:], start + terms[0])
    missing = imbalance / largest if largest > 0.0 else np.zeros_like(imbalance)
    return History(
        time=time,
        ground_acceleration=table[:, 0],
        energy=EnergyHistory(**dict(zip(ENERGY_TERMS, terms, strict=True)), error=missing),
        **{name: told(building, forces, time, table) for name, told in HISTORIES.items()},  # type: ignore[arg-type]
    )


def _field(place: int) -> Telling:
    """What rows of a history hold themselves."""
    return lambda building, forces, time, table: table[
        :, 1 + place * building.stories : 1 + (place + 1) * building.stories
    ]


def _over_story(place: int) -> Telling:
    """What of such a field lies between the floors above and below a story."""

    def told(building: Building, forces: Array, time: Array, table: Array) -> Array:
        floors = _field(place)(building, forces, time, table)
        stories = floors.copy()
        stories[:, 1:] -= floors[:, :-1]
        return stories

    return told


def _total_shear(building: Building, forces: Array, time: Array, table: Array) -> Array:
    """What moves the floors above each story: forces on them less masses times absolute
    accelerations."""
    moved = -building.linear_terms[rows.MASS, :-1] * _ACCELERATION(building, forces, time, table)
    for force in forces:
        angle = force[rows.OMEGA] * time
        moved[:, int(force[rows.FLOOR])] += force[rows.COSINE] * np.cos(angle) + force[
            rows.SINE
        ] * np.sin(angle)
    return np.asarray(np.cumsum(moved[:, ::-1], axis=1)[:, ::-1])


_ACCELERATION = _field(2)
_DRIFT_RATE = _over_story(1)

HISTORIES: dict[str, Telling] = {
    "displacement": _field(0),
    "velocity": _field(1),
    "acceleration": _ACCELERATION,
    "drift": _over_story(0),
    "shear": _field(3),
    "damper_force": lambda building, *told: building.device_force(_DRIFT_RATE(building, *told)),
    "total_shear": _total_shear,
}
"""What gives each field of `History` that stories and floors have, shape (rows, n)."""


# ---- Case

_LARGE_IMBALANCE = 0.01
"""Energy error above which a run says so."""

_MADE = 1.0
"""Energy made by the method, over the input energy, from which a drift beyond the collapse drift is
its doing."""

RUNAWAY = 100.0
"""Energy made by the method, over the input energy, from which a run has diverged: ten times the
amplitude."""

_UNRESOLVED = 0.05
"""Part of a peak that may be hidden between the steps without a note."""

_MOVING = 0.01
"""Part of the largest drift by which one still moves at the end without a note."""

_UNTIL_REST = "--until-rest goes on until it is at rest"

_OVERFLOW = 1e300
"""Residual from which a step that did not converge is one whose numbers ran away."""

_CURE = "use a smaller step or another method"


@dataclass(frozen=True)
class Case:
    """A building, the ground motion that it is under, and the method that integrates it: a run but
    for its steps.

    The building is prepared once: cases that differ in the motion, its scale or the method share
    it.

    Attributes
    ----------
    model : Model
        The building and its collapse drift; what it says of a record is not asked.
    prepared : PreparedBuilding
        The model's building, put together.
    record : Record or None
        The ground motion; None is ground at rest.
    method : Integrator
        The method with its parameters.
    allow_unstable : bool
        Run a method beyond its limit, and take a motion on energy that the method made for a
        result.
    remarks : tuple of str
        What is to be said of how the case came about, one sentence each; they stand among the notes
        of its runs.
    """

    model: Model
    prepared: PreparedBuilding
    record: Record | None
    method: Integrator
    allow_unstable: bool = False
    remarks: tuple[str, ...] = ()

    @property
    def building(self) -> Building:
        """The building as arrays."""
        return self.prepared.building

    @cached_property
    def ground(self) -> Array:
        """Ground acceleration at the samples, m/s^2; a zero for ground at rest."""
        return np.zeros(1) if self.record is None else self.record.acceleration.copy()

    @cached_property
    def plausibility_warnings(self) -> tuple[str, ...]:
        """Warnings on unusual values of the building and the ground motion, as `check` shows."""
        # A warning of the record itself is not repeated.
        told = self.record.warnings if self.record else ()
        pga = self.record.pga if self.record else math.nan
        unusual = doubts(self.model, self.building, pga)
        return tuple(text for text in unusual if text not in told)

    def _long_step(self, steps: Steps) -> list[str]:
        """Return the warning on the step that the model or its record implies; a step that is
        requested, or found for a tolerance, is the choice of its user."""
        interval = self.record.dt if self.record else None
        implied = self.model.analysis.dt or interval
        if implied is None or not math.isclose(steps.h, implied, rel_tol=1e-9):
            return []
        return long_step(self.building, steps.h, interval)

    def under(self, record: Record | None) -> Case:
        """The same building and method under another ground motion."""
        return replace(self, record=record)

    def scaled(self, factor: float) -> Case:
        """The same case with its ground motion times a factor, not zero; forces on floors stay as
        they are.

        Raises
        ------
        UsageError
            There is no ground motion.
        """
        if self.record is None:
            raise UsageError("no ground motion to scale: give a record")
        return self.under(self.record.scaled(factor))

    def steps(self, dt: float | None = None, duration: float | None = None) -> Steps:
        """Time steps for a wished dt and duration (s); by default those of the model's analysis,
        else the record's.

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
        return choose_steps(
            dt, duration, record.dt if record else None, record.duration if record else 0.0
        )

    def march(self, steps: Steps, history: bool = False) -> Response:
        """Integrate over the steps.

        Raises
        ------
        FailedRun
            The step is beyond the method's limit; the run diverged or did not converge.
        """
        # A step beyond the method's limit for the building's modes in its initial state is refused.
        instability = (
            None if self.allow_unstable else self.prepared.instability(self.method, steps.h)
        )
        if instability is not None:
            h, omega, stable = (
                steps.h,
                self.building.modes().omega[instability.index],
                instability.largest_stable,
            )
            cure = (
                f"the largest stable step is {stable:.6g} s"
                if stable > 0.0
                else "no smaller step is stable"
            )
            message = (
                f"{self.method.label} is unstable at dt {h:.6g} s: mode {instability.index + 1} "
                f"(omega {omega:.6g} rad/s, omega dt {omega * h:.6g}) grows; {cure}, or use "
                "--allow-unstable"
            )
            raise FailedRun(message, UNSTABLE, self.method.label, h, largest_stable_dt=stable)
        # A run that fails after a collapse is made again up to that.
        marched = self._integrate(steps, history)
        collapse = self.judge(steps, marched.code, marched.space.totals)
        if marched.code < 0:
            if collapse is None:
                raise self._failure(steps, marched.space, marched.code)
            steps = replace(steps, count=round(collapse.time / steps.h))
            marched = self._integrate(steps, history)
        error = energy_of(marched.space.totals).error
        if not -error < RUNAWAY and not self.allow_unstable:
            reason = f"the motion ends with {1.0 - error:.3g} times the input energy"
            raise self._ran_away(steps, marched.space, reason)
        return self._response(steps, marched, collapse)

    def history_chunks(self, steps: Steps, largest: float, every: int = 1) -> Iterator[History]:
        """The history of a run that came to its end, made again in pieces: of every so many steps,
        from the first one.

        `largest` is the run's largest energy. Together the pieces are what `march` keeps, bit for
        bit.
        """
        for space in self.prepared.march_pieces(self.method, steps, self.ground, every=every):
            yield history_of(self.building, self.prepared.forces, space, steps.h, largest)

    def _integrate(self, steps: Steps, history: bool = False) -> Marched:
        return self.prepared.march(
            self.method, steps, self.ground, history_rows=steps.count if history else 0
        )

    def _failure(self, steps: Steps, space: Workspace, code: int) -> FailedRun:
        residual = float(space.step_status[rows.RESIDUAL])
        if code == rows.NOT_FINITE or not residual < _OVERFLOW:
            return self._ran_away(steps, space)
        reached = float(space.totals[rows.STEPS_REACHED]) * steps.h
        story = int(space.step_status[rows.WORST_STORY]) + 1
        event = (
            f"did not converge after {reached:.6g} s, with the step halved {HALVINGS} times: story "
            f"{story} is out of balance by {residual:.1e} of its forces"
        )
        return self._failed(
            steps, NOT_CONVERGED, event, time=reached, story=story, residual=residual
        )

    def _ran_away(self, steps: Steps, space: Workspace, reason: str = "") -> FailedRun:
        """That a run diverged up to where it came; by default for the story whose drift is the
        largest."""
        # The kinetic energy of the motion relative to the ground, if it is a finite number
        with np.errstate(over="ignore", invalid="ignore"):
            energy = float(0.5 * np.sum(self.building.mass * space.state[rows.VELOCITY, :-1] ** 2))
        reached, story = float(space.totals[rows.STEPS_REACHED]) * steps.h, _runaway_story(space)
        reason = reason or f"the drift of story {story} ran away"
        return self._diverged(
            steps, reached, energy if math.isfinite(energy) else None, reason, story
        )

    def _diverged(
        self, steps: Steps, reached: float, energy: float | None, reason: str, story: int
    ) -> FailedRun:
        size = "" if energy is None else f", kinetic energy {energy:.3g} J"
        event = f"diverged after {reached:.6g} s: {reason}{size}"
        return self._failed(steps, DIVERGED, event, time=reached, story=story, energy=energy)

    def _failed(self, steps: Steps, status: str, event: str, **told: Any) -> FailedRun:
        """That a run ended before its time: how, in words and in numbers."""
        label = self.method.label
        notes = (
            *self.remarks,
            *(self.record.notes if self.record else ()),
            *self._stiffening_note(),
        )
        message = f"{label} with dt {steps.h:.6g} s {event}; {_CURE}"
        return FailedRun(message, status, label, steps.h, notes=notes, **told)

    def judge(self, steps: Steps, code: int, numbers: Array) -> Collapse | None:
        """When the drift first exceeded the collapse drift or a story failed, as a march noted it
        that ended with a code and left these `numbers` (`Workspace.totals`).

        It is the building's own if the method has made less energy by then than the input energy.
        Else a run that came to its end has diverged, and of one that failed it is not said.

        Raises
        ------
        FailedRun
            The run came to its end, but on energy that the method made.
        """
        if numbers[rows.COLLAPSE_STEP] == rows.NO_COLLAPSE:
            return None
        taken, story = int(numbers[rows.COLLAPSE_STEP]), int(numbers[rows.COLLAPSE_STORY]) + 1
        failed, energy = (
            bool(numbers[rows.COLLAPSE_FAILED]),
            energy_of(numbers[rows.COLLAPSE_ENERGIES :]),
        )
        time, made = taken * steps.h, -energy.error
        its_own = made < _MADE and taken > 0
        if its_own or (code == 0 and (taken == 0 or self.allow_unstable)):
            return Collapse(time, story, ended=code < 0, failed=failed)
        if code < 0:
            return None
        event = (
            f"story {story} failed"
            if failed
            else f"the drift ratio of story {story} passed the collapse drift"
        )
        reason = f"{event} on {made:.3g} times the input energy"
        raise self._diverged(steps, time, energy.kinetic, reason, story)

    def settle(
        self, steps: Steps, marched: MarchedRuns, i: int, history: bool = False
    ) -> Collapse | Response:
        """This run, which is the i-th of many that were marched together, where its end is in doubt
        (`doubtful`).

        A collapse is judged from what the many left. Else the run is made again by itself: as far
        as the many came, and through the step in which it failed.

        Raises
        ------
        FailedRun
            It failed.
        """
        code, taken, _ = marched.ends[i].astype(int).tolist()
        totals = marched.totals[i]
        at_its_end = code == 0 and -energy_of(totals).error < RUNAWAY
        if at_its_end and (collapse := self.judge(steps, code, totals)):
            return collapse
        reached = max(taken, int(totals[rows.STEPS_REACHED]) + 1)
        return self.march(replace(steps, count=max(reached, steps.count)), history)

    def _response(self, steps: Steps, marched: Marched, collapse: Collapse | None) -> Response:
        space = marched.space
        energy, stories = energy_of(space.totals), story_peaks(self.building, space)
        # Isolators are made for it, and what has no height is no story of a frame.
        usual = np.isfinite(self.building.heights) & (not self.model.plausibility_off)
        ductility = np.where(usual, stories.ductility, math.nan)
        # First the warnings of `check`: all other numbers follow from the building.
        unusual = [*self.plausibility_warnings, *self._long_step(steps)]
        warnings = unusual_stories(DUCTILITY, ductility)
        if not abs(energy.error) <= _LARGE_IMBALANCE:
            change = "lost to" if energy.error > 0.0 else "made by"
            warnings.insert(
                0,
                f"the energy balance is off by {100.0 * abs(energy.error):.2g} % of the input "
                f"energy, {change} the method: use a smaller step or another method",
            )
        kept = space.history.size
        history = history_of(self.building, self.prepared.forces, space, steps.h) if kept else None
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
            solver_time=marched.seconds,
            stories=stories,
            energy=energy,
            history=history,
            history_chunks=partial(self.history_chunks, steps, energy.reference),
            notes=(),
            interstep_bound=interstep_peak_errors(self.building, space, steps.late),
            residual_oscillation=residual_oscillation(self.building, space),
            collapse=collapse,
            warnings=(*unusual, *warnings),
        )
        return replace(response, notes=self._notes(response))

    def _notes(self, response: Response) -> tuple[str, ...]:
        """What there is to say of a run, which a collapse may have ended before its time."""
        record, end, moving = (
            self.record,
            response.steps * response.dt,
            response.residual_oscillation,
        )
        ended = response.collapse is not None and response.collapse.ended
        notes = [*suppression_reason(self.model), *self.remarks, *(record.notes if record else ())]
        if record and end > record.duration * (1.0 + 1e-9):
            notes.append(
                f"the record ends at {record.duration:.6g} s; the ground is at rest after it"
            )
        elif record and not ended:
            notes += cut_off([record], end)
        if self.method.family.linear_only and self.model.excitation.forces:
            notes.append("exact takes harmonic forces as linear between the steps")
        notes += self._stiffening_note()
        if response.substeps:
            notes.append(
                f"steps that did not converge were halved, {how_many(response.substeps, 'time')} "
                "in all"
            )
        # Peaks that the step is too long to tell.
        kinds = {
            "drifts": "peak_drift",
            "displacements": "peak_displacement",
            "velocities": "peak_velocity",
        }
        kinds["accelerations"] = "peak_absolute_acceleration"
        hidden = [
            words
            for words, name in kinds.items()
            if np.any(
                getattr(response.interstep_bound, name)
                > _UNRESOLVED * getattr(response.stories, name)
            )
        ]
        if hidden:
            notes.append(
                "the step is too long for the fastest modes: between the steps, peak "
                f"{', '.join(hidden)} may be larger than those given; use a smaller step"
            )
        # Drifts at the end that are not residual ones; under forces on floors there is no rest.
        i = int(np.argmax(moving))
        still = moving[i] <= _MOVING * np.max(response.stories.peak_drift)
        if record and not (ended or self.model.excitation.forces or still):
            length, size = self.model.output_units.unit("m")
            by = (
                f"{1e3 * moving[i]:.2g} mm" if length == "m" else f"{moving[i] / size:.2g} {length}"
            )
            beyond = end - record.duration  # the period is looked for where it is asked for alone
            waited = beyond > 0.0 and beyond >= REST_PERIODS * self.prepared.period
            until = (
                f"--until-rest waits for {REST_PERIODS:g} first periods" if waited else _UNTIL_REST
            )
            notes.append(
                f"the building still moves at the end, the drift of story {i + 1} by about {by} to "
                f"either side: residual drifts are those of the last moment; {until}"
            )
        return tuple(notes)

    def _stiffening_note(self) -> tuple[str, ...]:
        if not self.method.family.limited_by_stiffening:
            return ()
        laws = [story.law for story in self.model.stories]
        stories = [
            i for i, law in enumerate(laws, start=1) if LAWS[law.name].stiffens(law.parameters)
        ]
        if not stories:
            return ()
        return (
            f"{self.method.method.name} is stable only for small steps where a story becomes "
            f"stiffer than at rest, as story {stories[0]} can: check with a smaller step",
        )


def case_of(given: Case) -> Case:
    """A case; UsageError for what is none."""
    if not isinstance(given, Case):
        raise UsageError(
            f"a case is what prepare(model, record) gives, got a {type(given).__name__}"
        )
    return given


def doubtful(marched: MarchedRuns) -> NDArray[np.bool_]:
    """Runs that did not come to their end, collapsed, or went on with energy that the method made;
    shape (runs,)."""
    numbers = marched.totals
    made = ~(-energy_errors(numbers) < RUNAWAY)
    collapsed = numbers[:, rows.COLLAPSE_STEP] != rows.NO_COLLAPSE
    return np.asarray((marched.ends[:, CODE] < 0) | collapsed | made)


def _runaway_story(space: Workspace) -> int:
    """The story with the largest drift, from 1; the first one that is no number before all
    others."""
    u = space.state[rows.DISPLACEMENT, :-1]
    finite = np.isfinite(u)
    if not finite.all():
        return int(np.argmin(finite)) + 1
    return int(np.argmax(np.abs(np.diff(u, prepend=0.0)))) + 1


REST_PERIODS = 100.0
"""How long a run goes on with the ground at rest, in first periods of the building."""

AT_REST = 1e-3
"""Amplitude of what is left of the motion, over the largest displacement, from which a building is
at rest."""


def windows(prepared: PreparedBuilding, h: float) -> Rest:
    """The first periods by which a run of steps h (s) goes on until the velocities in one of them
    are those of an amplitude below `AT_REST` times the largest displacement; `REST_PERIODS` of them
    at most."""
    period = prepared.period
    return Rest(math.ceil(period / h), round(REST_PERIODS), AT_REST * 2.0 * math.pi / period)


def until_rest(case: Case, steps: Steps) -> tuple[Steps, bool]:
    """The steps of a run that goes on until the building is at rest, and whether it comes to that.

    Where the run fails on the way, the steps are those with which it does.
    """
    rest, lane = windows(case.prepared, steps.h), Lane(0, case.ground.size, 1.0, steps)
    marched = case.prepared.march_many(case.method, steps.h, case.ground, [lane], rest)
    code, count, at_rest = marched.ends[0].tolist()
    if code < 0:
        count += rest.window
    return replace(steps, count=max(int(count), steps.count)), bool(at_rest) and code >= 0
