"""A building under its load, ready to be marched by any method at any step that fits."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.amplification import STABLE, spectral_radius
from tdint.analysis.response import model_record
from tdint.analysis.stepping import Steps, choose_steps, compile_all, integrate, workspace
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.kernels import layout, observing
from tdint.kernels.layout import NOT_FINITE
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble
from tdint.model.definition import Model
from tdint.model.loads import force_table

Array = NDArray[np.float64]

DONE, COLLAPSED, UNSTABLE, DIVERGED, NOT_CONVERGED = "done", "collapsed", "unstable", "diverged", "not-converged"
"""How a march ends; `unstable`: it was not begun, the step is beyond the method's limit."""

RESOLVED = 2.0
"""omega dt of the fastest mode up to which peaks are looked for between the steps, as in `tdint run`."""


@dataclass(frozen=True)
class Motion:
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

    def every(self, stride: int, rows: int) -> Motion:
        """The first `rows` rows of this motion `stride` samples apart."""
        part = slice(0, (rows - 1) * stride + 1, stride)
        return Motion(stride, self.displacement[part], self.velocity[part], self.acceleration[part], self.peak_drift)


@dataclass(frozen=True)
class March:
    """How a march ended: its outcome, its solves, the wall time of the compiled loop (s), the motion if kept."""

    outcome: str
    iterations: int
    seconds: float
    motion: Motion | None


@dataclass(frozen=True)
class Problem:
    """A building, its load and its start.

    Attributes
    ----------
    ground : ndarray, shape (k,)
        Ground acceleration at the samples, m/s^2; a zero without a record.
    forces : ndarray
        Forces on floors as `tdint.model.loads.force_table` makes them.
    displacement, velocity : ndarray, shape (n,)
        At t = 0 relative to the ground, m and m/s.
    interval : float
        Time between two samples, s: those of the record, or without one those of the step that others divide.
    samples : int
        Intervals to be integrated.
    collapse_drift : float
        Drift ratio above which a march is called collapsed.
    recorded : bool
        Whether there is a record.
    """

    building: Building
    ground: Array
    forces: Array
    displacement: Array
    velocity: Array
    interval: float
    samples: int
    collapse_drift: float
    recorded: bool

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
            if self.recorded:
                raise
            raise UsageError(str(error).replace("record's sampling interval", "model's own step")) from None

    def stable(self, integrator: Integrator, h: float) -> bool:
        """Whether a step h (s) is within the method's limit for all modes of the building in its initial state."""
        if integrator.stability_limit == math.inf:
            return True
        modes = self.building.modes()
        damping = np.diagonal(modes.damping_matrix(self.building)) / (2.0 * modes.omega)
        return bool(np.all(spectral_radius(integrator, modes.omega, damping, h) <= 1.0 + STABLE))

    def march(self, integrator: Integrator, steps: Steps, *, keep: bool = False) -> March:
        """Integrate; with `keep` the motion at the samples (or at the steps, if these are longer) is kept.

        The time is that of the loop as `tdint run` without --history has it: with peaks and energies. It is of no use
        with `keep`.
        """
        rows = steps.count // steps.per_sample if keep else 0
        space = workspace(self.building, integrator, rows, between=self.building.fastest * steps.h <= RESOLVED)
        space.state[layout.DISPLACEMENT, :-1] = self.displacement
        space.state[layout.VELOCITY, :-1] = self.velocity
        compile_all(integrator)
        begin = time.perf_counter()
        code = integrate(integrator, self.building, self.forces, self.ground, steps, space)
        seconds = time.perf_counter() - begin
        iterations = int(space.observed[observing.ITERATIONS])
        if code < 0:
            return March(DIVERGED if code == NOT_FINITE else NOT_CONVERGED, iterations, seconds, None)
        peaks = space.peaks[observing.PEAK_DRIFT]
        collapsed = bool(np.any(peaks / self.building.heights > self.collapse_drift))
        motion = None
        if keep:
            n = self.building.stories
            u, v, a = (space.history[:, 1 + j * n : 1 + (j + 1) * n].copy() for j in range(3))
            motion = Motion(steps.stride, u, v, a, peaks)
        return March(COLLAPSED if collapsed else DONE, iterations, seconds, motion)


def pose(
    model: Model, record: Record | None = None, *, duration: float | None = None, dts: tuple[float, ...] = ()
) -> Problem:
    """The problem that a model is under a record, by default its own, for steps `dts` (s) if they are known.

    It lasts until the last of the steps reaches or passes the duration (s), by default the model's, else the record's.

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
    ground = np.zeros(1) if record is None else record.acceleration.copy()
    forces = force_table(model.excitation.forces)
    displacement, velocity = np.array(model.initial.displacement), np.array(model.initial.velocity)
    if not any(np.any(cause) for cause in (ground, forces[:, 1:3], displacement, velocity)):
        raise AnalysisError(f"{model.name}: nothing moves this building: no ground motion, no force, no initial state")
    problem = Problem(
        assemble(model), ground, forces, displacement, velocity, whole.h, whole.count, model.collapse_drift,
        record is not None,
    )  # fmt: skip
    return problem


def reached(problem: Problem, all_steps: tuple[Steps, ...]) -> int:
    """Samples that the longest of some marches reaches."""
    return max((steps.count * steps.stride // steps.per_sample for steps in all_steps), default=problem.samples)
