"""Response history of a building: the work behind `tdint run`."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.amplification import find_instability
from tdint.analysis.stepping import HALVINGS, Steps, Workspace, choose_steps, compile_all, integrate, workspace
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.read import read_record
from tdint.ground_motion.record import Record
from tdint.kernels import layout, observing
from tdint.kernels.layout import NOT_FINITE
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble
from tdint.model.definition import Model
from tdint.model.loads import force_table

Array = NDArray[np.float64]

_LARGE_IMBALANCE = 0.01
"""Energy error above which a run says so."""

_RESOLVED = 2.0
"""omega dt of the fastest mode up to which peaks are looked for between the steps."""


@dataclass(frozen=True)
class StoryPeaks:
    """Peaks of each story, or of the floor above it; arrays of shape (n,).

    Drifts and displacements, and the shears of linear stories, are looked for between the steps too, on the cubic
    Hermite interpolant, where the step resolves all modes (omega dt <= 2 for the fastest); velocities, accelerations
    and other shears are those at the steps.

    Attributes
    ----------
    height : ndarray
        Story height, m; nan where the model gives none.
    peak_drift, residual_drift : ndarray
        Largest absolute drift and drift at the end of the run, m.
    peak_drift_ratio : ndarray
        Peak drift over height; nan without height.
    peak_shear : ndarray
        Largest absolute restoring force of the story, N, without dashpots, damping and P-delta.
    ductility : ndarray
        Peak drift over drift at first yield; nan where the law does not yield.
    peak_displacement, peak_velocity : ndarray
        Of the floor above, relative to the ground, m and m/s.
    peak_acceleration : ndarray
        Of the floor above, absolute, m/s^2, from equilibrium.
    """

    height: Array
    peak_drift: Array
    peak_drift_ratio: Array
    residual_drift: Array
    peak_shear: Array
    ductility: Array
    peak_displacement: Array
    peak_velocity: Array
    peak_acceleration: Array


@dataclass(frozen=True)
class Energy:
    """Energy balance of a run in terms of motion relative to the ground, J (Uang and Bertero 1990, relative energy).

    start + input = kinetic + damping + recoverable + dissipated + imbalance.
    """

    start: float
    input: float
    kinetic: float
    damping: float
    recoverable: float
    dissipated: float
    largest: float

    @property
    def error(self) -> float:
        """Imbalance over the largest energy put in; 0 for a run without energy."""
        parts = self.kinetic + self.damping + self.recoverable + self.dissipated
        return (self.start + self.input - parts) / self.largest if self.largest > 0.0 else 0.0


@dataclass(frozen=True)
class History:
    """Response at all steps: `time` (s) and `ground_acceleration` (m/s^2), shape (steps + 1,); the rest (steps + 1, n).

    Displacement (m) and velocity (m/s) relative to the ground, acceleration absolute (m/s^2), drift (m), shear (N).
    """

    time: Array
    ground_acceleration: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    drift: Array
    shear: Array


@dataclass(frozen=True)
class Response:
    """Result of a run.

    Attributes
    ----------
    status : str
        `done`, or `collapsed` where a drift ratio exceeded the model's collapse drift.
    method : str
        The method with all its parameters.
    dt, steps : float, int
        Time step (s) and number of steps.
    iterations, halvings, events : int
        Solves; steps that were halved to converge; changes of branch that were located.
    march_time : float
        Wall time of the compiled time loop alone, s.
    history : History or None
        Only if it was asked for.
    notes : tuple of str
        What a person should know of the run.
    """

    model: Model
    record: Record | None
    status: str
    method: str
    dt: float
    steps: int
    iterations: int
    halvings: int
    events: int
    march_time: float
    stories: StoryPeaks
    energy: Energy
    history: History | None
    notes: tuple[str, ...]


class FailedRun(AnalysisError):
    """A run that ended before its time.

    Attributes
    ----------
    status : str
        `diverged` or `not-converged`.
    method, dt : str, float
        The method with all its parameters and the time step, s.
    time : float
        Last time reached, s.
    story, residual : int, float, or None
        Where a step did not converge: the story, counted from 1, and what is out of balance over its forces.
    """

    def __init__(
        self,
        reason: str,
        status: str,
        integrator: Integrator,
        dt: float,
        time: float,
        story: int | None = None,
        residual: float | None = None,
    ) -> None:
        super().__init__(f"{integrator.label} with dt {dt:.6g} s {reason}; use a smaller step or another method")
        self.status = status
        self.method = integrator.label
        self.dt = dt
        self.time = time
        self.story = story
        self.residual = residual


def run(
    model: Model,
    record: Record | None = None,
    *,
    method: str | None = None,
    dt: float | None = None,
    duration: float | None = None,
    history: bool = False,
    allow_unstable: bool = False,
) -> Response:
    """Integrate a model in time.

    Parameters
    ----------
    model : Model
        From `load_model`.
    record : Record, optional
        Ground motion in place of the one that the model names.
    method, dt, duration : optional
        In place of what the model's analysis says: a specification such as `hht:alpha=-0.1`, s, s. Without either the
        step and the duration are those of the record.
    history : bool
        Keep the whole response, not the peaks alone.
    allow_unstable : bool
        Run a conditionally stable method beyond its limit.

    Returns
    -------
    Response

    Raises
    ------
    UsageError
        No method, an unknown one, or a step that does not fit.
    RecordError
        The model's record cannot be read.
    AnalysisError
        The step is beyond the method's limit; the run diverged or did not converge (`FailedRun`).
    """
    specification = method or model.analysis.method
    if specification is None:
        raise UsageError("no method: give --method or analysis.method in the model file; `tdint methods` lists them")
    integrator = parse(specification)
    if record is None:
        record = model_record(model)
    dt = model.analysis.dt if dt is None else dt
    duration = model.analysis.duration if duration is None else duration
    for name, value in (("dt", dt), ("duration", duration)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise UsageError(f"{name} must be a positive number of seconds, got {value!r}")
    steps = choose_steps(dt, duration, record.dt if record else None, record.duration if record else 0.0)
    building = assemble(model)
    if not allow_unstable:
        _refuse_unstable(integrator, building, steps.h)
    return _march(model, building, record, integrator, steps, history)


def _refuse_unstable(integrator: Integrator, building: Building, h: float) -> None:
    """Refuse a step beyond the method's limit for the building's modes in its initial state."""
    if integrator.stability_limit == math.inf:
        return
    modes = building.modes()
    damping = np.diagonal(modes.damping_matrix(building)) / (2.0 * modes.omega)
    found = find_instability(integrator, modes.omega, damping, h)
    if found is None:
        return
    omega = modes.omega[found.index]
    stable = found.largest_stable
    cure = f"the largest stable step is {stable:.6g} s" if stable > 0.0 else "no smaller step is stable"
    raise AnalysisError(
        f"{integrator.label} is unstable at dt {h:.6g} s: mode {found.index + 1} (omega {omega:.6g} rad/s, omega dt "
        f"{omega * h:.6g}) grows; {cure}, or use --allow-unstable"
    )


def model_record(model: Model) -> Record | None:
    """The ground motion that the model names, processed and scaled; None if it names none."""
    source = model.excitation.record
    if source is None:
        return None
    record = read_record(source.file, units=source.units, component=source.component, inventory=source.inventory)
    record = source.processing.apply(record)
    return record.scaled(source.scale) if source.scale != 1.0 else record


def _march(
    model: Model, building: Building, record: Record | None, integrator: Integrator, steps: Steps, history: bool
) -> Response:
    # Where a step resolves all modes, the interpolant between its ends is as good as the ends are.
    resolved = building.fastest * steps.h <= _RESOLVED
    space = workspace(building, integrator, steps.count if history else 0, between=resolved)
    space.state[layout.DISPLACEMENT, :-1] = model.initial.displacement
    space.state[layout.VELOCITY, :-1] = model.initial.velocity
    ground = np.zeros(1) if record is None else record.acceleration.copy()
    forces = force_table(model.excitation.forces)
    compile_all(integrator)
    begin = time.perf_counter()
    code = integrate(integrator, building, forces, ground, steps, space)
    march_time = time.perf_counter() - begin
    if code < 0:
        raise _failure(integrator, steps, space, code)
    peaks = _story_peaks(building, space)
    energy = _energy(space.observed)
    collapsed = bool(np.any(peaks.peak_drift_ratio > model.collapse_drift))
    return Response(
        model=model,
        record=record,
        status="collapsed" if collapsed else "done",
        method=integrator.label,
        dt=steps.h,
        steps=steps.count,
        iterations=int(space.observed[observing.ITERATIONS]),
        halvings=int(space.observed[observing.HALVINGS]),
        events=int(space.memo[layout.EVENTS]),
        march_time=march_time,
        stories=peaks,
        energy=energy,
        history=_history(space, building, steps) if history else None,
        notes=_notes(model, steps, record, integrator, energy),
    )


def _failure(integrator: Integrator, steps: Steps, space: Workspace, code: int) -> FailedRun:
    reached = float(space.observed[observing.STEPS_REACHED]) * steps.h
    if code == NOT_FINITE:
        reason = f"diverged after {reached:.6g} s: the response ran away"
        return FailedRun(reason, "diverged", integrator, steps.h, reached)
    story = int(space.memo[layout.WORST_STORY]) + 1
    residual = float(space.memo[layout.RESIDUAL])
    reason = (
        f"did not converge after {reached:.6g} s, with the step halved {HALVINGS} times: story {story} is out of "
        f"balance by {residual:.1e} of its forces"
    )
    return FailedRun(reason, "not-converged", integrator, steps.h, reached, story, residual)


def _story_peaks(building: Building, space: Workspace) -> StoryPeaks:
    peaks = space.peaks
    drift = peaks[observing.PEAK_DRIFT]
    return StoryPeaks(
        height=building.heights,
        peak_drift=drift,
        peak_drift_ratio=drift / building.heights,
        residual_drift=space.springs[layout.DRIFT, :-1].copy(),
        peak_shear=peaks[observing.PEAK_SHEAR],
        ductility=drift / building.yield_drift,
        peak_displacement=peaks[observing.PEAK_DISPLACEMENT],
        peak_velocity=peaks[observing.PEAK_VELOCITY],
        peak_acceleration=peaks[observing.PEAK_ACCELERATION],
    )


def _energy(observed: Array) -> Energy:
    return Energy(
        start=float(observed[observing.ENERGY_START]),
        input=float(observed[observing.ENERGY_INPUT]),
        kinetic=float(observed[observing.ENERGY_KINETIC]),
        damping=float(observed[observing.ENERGY_DAMPED]),
        recoverable=float(observed[observing.ENERGY_RECOVERABLE]),
        dissipated=float(observed[observing.ENERGY_DISSIPATED]),
        largest=float(observed[observing.ENERGY_LARGEST]),
    )


def _history(space: Workspace, building: Building, steps: Steps) -> History:
    n = building.stories
    table = space.history
    displacement, velocity, acceleration, shear = (table[:, 1 + j * n : 1 + (j + 1) * n] for j in range(4))
    below = np.hstack([np.zeros((len(table), 1)), displacement[:, :-1]])
    return History(
        time=steps.h * np.arange(len(table), dtype=np.float64),
        ground_acceleration=table[:, 0],
        displacement=displacement,
        velocity=velocity,
        acceleration=acceleration,
        drift=displacement - below,
        shear=shear,
    )


def _notes(
    model: Model, steps: Steps, record: Record | None, integrator: Integrator, energy: Energy
) -> tuple[str, ...]:
    notes = list(record.notes) if record else []
    if record and steps.stride > 1:
        notes.append(
            f"dt {steps.h:.6g} s is {steps.stride} sampling intervals: samples of the record in between are skipped"
        )
    if record and steps.count * steps.h > record.duration * (1.0 + 1e-9):
        notes.append(f"the record ends at {record.duration:.6g} s; the ground is at rest after it")
    if integrator.family.linear_only and model.excitation.forces:
        notes.append("exact takes harmonic forces as linear between the steps")
    if abs(energy.error) > _LARGE_IMBALANCE:
        notes.append(
            f"the energy balance is off by {100.0 * abs(energy.error):.2g} % of the energy put in: "
            "use a smaller step, or a method that dissipates less"
        )
    return tuple(notes)
