"""What a chart is made of: a building under its load over some time, for any method at any step that fits."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.run import model_record
from tdint.analysis.run.steps import Steps, choose_steps
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.kernels import layout as at
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble
from tdint.model.definition import Initial, ModalDamping, Model, RayleighCoefficients, RayleighRatio


@dataclass(frozen=True)
class FloorMotion:
    """A motion at every `stride`-th sample and its peaks.

    Attributes
    ----------
    displacement, velocity, acceleration : ndarray, shape (rows, n)
        Of the floors: m and m/s relative to the ground, m/s^2 absolute, from equilibrium.
    peak_drift : ndarray, shape (n,)
        Largest absolute drift of each story, m.
    """

    stride: int
    displacement: Array
    velocity: Array
    acceleration: Array
    peak_drift: Array

    @property
    def drift(self) -> Array:
        """Drifts of the stories, m, shape (rows, n)."""
        return np.diff(self.displacement, axis=1, prepend=0.0)

    def every(self, stride: int, rows: int) -> FloorMotion:
        """The first `rows` rows of this motion `stride` samples apart."""
        part = slice(0, (rows - 1) * stride + 1, stride)
        return FloorMotion(
            stride, self.displacement[part], self.velocity[part], self.acceleration[part], self.peak_drift
        )


@dataclass(frozen=True)
class March:
    """What a march costs, solves and s of wall time in the compiled loop, and its motion if it was kept."""

    iterations: int
    seconds: float
    motion: FloorMotion | None


@dataclass(frozen=True)
class Problem:
    """A building, its load, and the time over which it is integrated.

    Attributes
    ----------
    interval : float
        Time between two samples, s: those of the record, or without one those of the step that others divide.
    samples : int
        Intervals to be integrated.
    """

    model: Model
    record: Record | None
    interval: float
    samples: int

    @cached_property
    def prepared(self) -> PreparedBuilding:
        """The building, its forces and its initial state."""
        return PreparedBuilding.of(self.model)

    @property
    def building(self) -> Building:
        """The building as arrays."""
        return self.prepared.building

    @cached_property
    def ground(self) -> Array:
        """Ground acceleration at the samples, m/s^2; a zero without a record."""
        return np.zeros(1) if self.record is None else self.record.acceleration.copy()

    @property
    def forces(self) -> Array:
        """Forces on floors, as `force_table` makes them."""
        return self.prepared.forces

    @property
    def displacement(self) -> Array:
        """At t = 0 relative to the ground, m, shape (n,)."""
        return np.asarray(self.prepared.displacement)

    @property
    def velocity(self) -> Array:
        """At t = 0 relative to the ground, m/s, shape (n,)."""
        return np.asarray(self.prepared.velocity)

    def steps(self, dt: float) -> Steps:
        """Time steps of about dt (s) over all samples; the last one may end after them.

        Raises
        ------
        UsageError
            A step that is neither a whole part nor a whole multiple of the interval.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise UsageError(f"dt must be a positive number of seconds, got {dt!r}")
        try:
            return choose_steps(dt, self.samples * self.interval, self.interval, 0.0)
        except UsageError as error:
            if self.record:
                raise
            raise UsageError(str(error).replace("record's sampling interval", "model's own step")) from None

    def outcome(self, integrator: Integrator, steps: Steps) -> str:
        """How `tdint run` ends with this method and these steps: its status."""
        try:
            return Case(self.model, self.prepared, self.record, integrator).march(steps).status
        except FailedRun as failure:
            return failure.status

    def march(self, integrator: Integrator, steps: Steps, *, keep: bool = False) -> March:
        """Integrate; with `keep` the motion at the samples (or at the steps, if these are longer) is kept.

        The time is that of the loop as `tdint run` without --history has it: with peaks and energies. It is of no use
        with `keep`. There is no motion where the march does not reach its end.
        """
        rows = steps.count // steps.per_sample if keep else 0
        marched = self.prepared.march(integrator, steps, self.ground, rows=rows)
        space = marched.space
        motion = None
        if keep and marched.code == 0:
            n = self.building.stories
            u, v, a = (space.history[:, 1 + j * n : 1 + (j + 1) * n].copy() for j in range(3))
            motion = FloorMotion(steps.stride, u, v, a, space.peaks[at.PEAK_DRIFT])
        return March(int(space.totals[at.ITERATIONS]), marched.seconds, motion)


def pose(
    model: Model, record: Record | None = None, *, duration: float | None = None, dts: tuple[float, ...] = ()
) -> Problem:
    """The problem that a model is under a record, by default its own.

    The interval is the record's; without a record the model's step, else the largest of `dts` (s). The duration (s) is
    by default the model's, else the record's.

    Raises
    ------
    UsageError
        No duration, or no step, where there is no record to take it from; a step that does not fit.
    AnalysisError
        Nothing moves the building.
    """
    record = model_record(model) if record is None else record
    duration = model.analysis.duration if duration is None else duration
    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise UsageError(f"duration must be a positive number of seconds, got {duration!r}")
    own = record.dt if record else model.analysis.dt or max(dts, default=None)
    whole = choose_steps(own, duration, record.dt if record else None, record.duration if record else 0.0)
    problem = Problem(model, record, whole.h, whole.count)
    causes = (problem.ground[: problem.samples + 1], problem.forces[:, 1:3], problem.displacement, problem.velocity)
    if not any(np.any(cause) for cause in causes):
        raise AnalysisError(f"{model.name}: nothing moves this building: no ground motion, no force, no initial state")
    return problem


def ending_together(problem: Problem, dts: Iterable[float]) -> Problem:
    """The problem, longer by as many samples as it takes for all steps (s) to end at one time.

    A motion that goes on has larger peaks: those of two durations are no measure of an error. Steps whose common
    multiple is longer than the motion stay as they are.
    """
    common = math.lcm(*(problem.steps(dt).stride for dt in dts))
    if common > problem.samples:
        return problem
    return replace(problem, samples=-(-problem.samples // common) * common)


def reached(problem: Problem, all_steps: tuple[Steps, ...]) -> int:
    """Samples that the longest of some marches reaches."""
    return max((steps.count * steps.stride // steps.per_sample for steps in all_steps), default=problem.samples)


def stretched(model: Model, count: int) -> Model:
    """The model with `count` stories: its own ones, each repeated (or left out) so that their pattern stays.

    Rayleigh damping keeps its coefficients. Of modal damping of the first modes those remain that there are. Forces
    and the initial state move with their floors.
    """
    own = len(model.stories)
    if count == own:
        return model
    floors = [i * own // count for i in range(count)]
    damping = model.damping
    if isinstance(damping, RayleighRatio):
        building = assemble(model)
        first = model.stories[0]
        damping = RayleighCoefficients(
            mass=float(building.linear_terms[at.FLOOR_DAMPER, 0] / building.linear_terms[at.MASS, 0]),
            stiffness=float((building.linear_terms[at.STORY_DAMPER, 0] - first.dashpot) / first.stiffness),
        )
    elif isinstance(damping, ModalDamping):
        damping = ModalDamping(damping.ratios[:count])
    forces = tuple(
        replace(force, floor=max(1, math.ceil(force.floor * count / own))) for force in model.excitation.forces
    )
    return replace(
        model,
        stories=tuple(model.stories[i] for i in floors),
        damping=damping,
        excitation=replace(model.excitation, forces=forces),
        initial=Initial(
            tuple(model.initial.displacement[i] for i in floors), tuple(model.initial.velocity[i] for i in floors)
        ),
    )
