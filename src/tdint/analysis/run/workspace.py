"""Arrays of a time integration, kernels that it calls, stability of methods, and time steps."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property, halved
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import Variant
from tdint.kernels.building.sources import digest
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws.compiled_separately import law_state_table
from tdint.kernels.stepping import Memory, Scene, Seen
from tdint.kernels.time_loop.loop import integrate
from tdint.kernels.time_loop.observer import initialize_laws, sum_law_energies, update_shear_peaks
from tdint.methods.method import Integrator
from tdint.model.building import Building, oscillators
from tdint.model.definition import CODES, LAWS
from tdint.system import available_memory, cache_subfolder

HALVINGS = 8
"""Maximum number of times that a step without convergence is halved before the run fails."""

_WITH_RESULTS = 2.5
"""Dimensionless. Memory of a history including its results (drifts and forces), divided by the
memory of its rows.
"""


@dataclass
class Workspace:
    """Arrays that a time integration reads and writes.

    Each table has one column per story and an additional column of zeros. The history contains
    every `every`-th step; `before` is the number of rows before its first row.
    """

    state: Array
    law_state: Array
    scratch: Array
    flags: Array
    step_status: Array
    observer_state: Array
    peaks: Array
    limits: Array
    totals: Array
    history: Array
    every: int = 1
    before: int = 0

    @property
    def memory(self) -> Memory:
        """Arrays with the state of the method and of the hysteretic laws."""
        return Memory(self.state, self.law_state, self.scratch, self.step_status)

    @property
    def seen(self) -> Seen:
        """Arrays with the observed results."""
        return Seen(self.observer_state, self.peaks, self.limits, self.totals, self.history)


def workspace(
    building: Building, integrator: Integrator, row_count: int = 0, collapse_drift: float = math.inf
) -> Workspace:
    """Return new arrays for one run.

    Parameters
    ----------
    building : Building
        Building.
    integrator : Integrator
        Method.
    row_count : int, default 0
        Number of rows of the history.
    collapse_drift : float, default infinity
        Drift ratio above which a story has collapsed.

    Raises
    ------
    AnalysisError
        The free memory is too small, or the method of a plug-in is invalid.
    """
    validate_plugin_step(integrator)
    n = building.stories
    modes = building.modal.shape[0]
    family = integrator.family
    flags = np.zeros(rows.FLAGS_SIZE)
    flags[rows.LINEAR] = building.linear
    # With power-law dashpots, a step is not linear on the branches.
    flags[rows.BRANCHES] = rows.SOME_BRANCHES if building.kinked else rows.NO_BRANCHES
    if building.piecewise_linear and not building.power_damped:
        flags[rows.BRANCHES] = rows.ALL_BRANCHES
    flags[rows.POWER_DAMPERS] = building.power_damped
    flags[rows.OWN_WORK] = family.own_work
    flags[rows.PARABOLIC] = family.parabolic
    flags[rows.HAS_DASHPOTS] = building.damped_by_devices
    width = history_width(building)
    if row_count:
        # The complete history and its results are in memory simultaneously.
        needed, free = _WITH_RESULTS * 8.0 * row_count * width, available_memory()
        if needed > free:
            raise AnalysisError(
                f"a history of {row_count} rows needs {needed / 1e9:.3g} GB of memory, "
                f"{free / 1e9:.3g} GB are free; use fewer steps, or write the history to a "
                "file, which is done in chunks"
            )
    # Value of row INTERNAL of a story that has failed; nan for laws that do not fail.
    failed = np.full(max(CODES.values()) + 1, math.nan)
    for name, code in CODES.items():
        failed[code] = LAWS[name].failed
    failed = failed[building.law_parameters[rows.CODE, :-1].astype(int)]
    totals = np.zeros(rows.TOTALS_SIZE)
    totals[rows.COLLAPSE_STEP] = rows.NO_COLLAPSE
    return Workspace(
        state=np.zeros((family.state_rows, n + 1)),
        law_state=law_state_table(building.law_parameters),
        scratch=np.zeros((family.scratch_rows(modes), max(n + 1, 2 * modes + 1))),
        flags=flags,
        step_status=np.zeros(rows.STEP_STATUS_SIZE),
        observer_state=np.zeros((rows.OBSERVER_ROWS, n + 1)),
        peaks=np.zeros((2 * rows.PEAK_ROWS, n)),
        limits=np.array([np.full(n, collapse_drift), building.heights, failed]),
        totals=totals,
        history=np.zeros((row_count, width)),
    )


def history_width(building: Building) -> int:
    """Return the number of values in a row of the history."""
    return 1 + rows.HISTORY_FIELDS * building.stories + rows.ENERGY_TERMS


VALIDATED_STEPS: set[Kernel] = set()
"""Steps of plug-ins that this process has executed in plain Python, or that are being executed."""

_ONE_AT_A_TIME = threading.RLock()
if hasattr(os, "register_at_fork"):  # the thread that holds the lock does not exist in the child
    os.register_at_fork(after_in_child=_ONE_AT_A_TIME._at_fork_reinit)  # type: ignore[attr-defined]


def validate_plugin_step(integrator: Integrator) -> None:
    """Execute the step of a plug-in in plain Python before its first compiled run.

    An invalid compiled step could write outside its arrays or lose the state of a story without an
    error. The check is done one time for each version of its sources; the kernel cache records it.

    Raises
    ------
    AnalysisError
        The step is invalid.
    """
    step = integrator.family.step
    if step.function.__module__.startswith("tdint.") or os.environ.get("TDINT_KERNELS") == "python":
        return
    with _ONE_AT_A_TIME:
        if step in VALIDATED_STEPS:
            return
        folder = cache_subfolder("plugins")
        file = folder and folder / f"{digest(step.name)}-{integrator.method.name}"
        if file is None or not file.exists():
            # Imported at this point, because the assessment integrates with the declarations of
            # this module.
            faults_of_step = import_module("tdint.analysis.assessment.order").faults_of_step
            VALIDATED_STEPS.add(step)
            if faults := faults_of_step(integrator):
                VALIDATED_STEPS.remove(step)
                raise AnalysisError(
                    f"{'; '.join(faults)} (`tdint check --plugin` checks all declarations)"
                )
            if file is not None:
                with suppress(OSError):
                    file.touch()
        VALIDATED_STEPS.add(step)


def kernels(integrator: Integrator, variant: Variant) -> list[tuple[Kernel, Variant]]:
    """Return the kernels of a time integration, those with the longest compilation first.

    Errors are those of `validate_plugin_step`.
    """
    validate_plugin_step(integrator)
    return [
        (kernel, variant)
        for kernel in (
            integrator.family.step,
            integrate,
            initialize_laws,
            sum_law_energies,
            update_shear_peaks,
        )
    ]


def shifts(integrator: Integrator, h: float) -> Array:
    """Return the change of each row of the state at a jump of the ground acceleration between two
    time steps of h (s).
    """
    family = integrator.family
    return np.array(family.shifts) * h ** (2.0 - np.array(family.derivatives))


def unsupported_reason(integrator: Integrator, building: Building) -> str:
    """Return the reason why a method does not support a building: nonlinear stories or power-law
    dashpots.

    The result is empty if the method supports the building.
    """
    if integrator.family.linear_only and not building.linear:
        return (
            f"{integrator.label} supports only linear buildings; this building has nonlinear "
            "stories"
        )
    if building.power_damped and not integrator.family.power_dampers:
        return (
            f"{integrator.label} does not support power-law dashpots; use impulse4 or "
            "newmark-average"
        )
    return ""


# ---- Amplification matrices measured on the compiled steps, and the stability that follows from
# them

LINEAR_OSCILLATORS = Variant(laws=("linear",), modal=False, forces=False, dashpots=False)
"""Variant of the kernels for linear oscillators."""

STABLE = 1e-9
"""Dimensionless. Excess of a spectral radius above 1 that is attributed to rounding."""

_SETTLED = 100.0  # completed steps for a multi-step method: its start procedure has ended

# Maximum number of oscillators in one building if the coefficients of the step belong to the
# complete building. Its matrix is dense, and LAPACK mixes the modes of uncoupled oscillators from
# 26 oscillators.
_TOGETHER = 16


def amplification(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Return amplification matrices of free oscillators over one time step.

    Each matrix is measured by one step from a unit value in each row of the memory of the method.

    Parameters
    ----------
    integrator : Integrator
        Method.
    omega, damping : ndarray, shape (k,)
        Circular frequencies (rad/s) and damping ratios.
    h : float
        Time step, s.

    Returns
    -------
    ndarray, shape (k, m, m)
        Matrices; m is the number of memory rows of the method family. Units are those of the state.
    """
    omega, damping = np.broadcast_arrays(np.asarray(omega, float), np.asarray(damping, float))
    if integrator.family.prepare is not None:
        starts = range(0, max(omega.size, 1), _TOGETHER)
        groups = [oscillators(omega[j : j + _TOGETHER], damping[j : j + _TOGETHER]) for j in starts]
        return np.concatenate([_amplification(integrator, group, h) for group in groups])
    return _amplification(integrator, oscillators(omega, damping), h)


def _amplification(integrator: Integrator, building: Building, h: float) -> Array:
    """Return the amplification matrices of the uncoupled oscillators of one building."""
    memory = integrator.family.memory
    k = building.stories
    forces = np.zeros((0, 4))
    coefficients = integrator.coefficients(building, forces, h)
    step = integrator.family.step.variant(LINEAR_OSCILLATORS)
    space = workspace(building, integrator)
    scene = Scene(
        building.linear_terms, building.modal, building.law_parameters, forces, space.flags
    )
    result = np.empty((k, len(memory), len(memory)))
    state, law_state, stiffness = space.state, space.law_state, building.initial_stiffness
    for column, row in enumerate(memory):
        state[:], law_state[:] = 0.0, 0.0
        state[row, :k] = 1.0
        # Committed states of the springs. The acceleration follows from equilibrium if the method
        # does not store its own acceleration.
        u, v = state[rows.DISPLACEMENT, :-1], state[rows.VELOCITY, :-1]
        law_state[rows.DRIFT, :-1], law_state[rows.FORCE, :-1], law_state[rows.SLOPE, :-1] = (
            u,
            stiffness * u,
            stiffness,
        )
        law_state[rows.UPPER, :-1], law_state[rows.LOWER, :-1] = math.inf, -math.inf
        if rows.ACCELERATION not in memory:
            state[rows.ACCELERATION, :-1] = (
                -stiffness * u - building.linear_terms[rows.STORY_DAMPER, :-1] * v
            )
        space.step_status[rows.STEPS_DONE] = _SETTLED
        code = step(coefficients, *scene, h, np.zeros(rows.LOAD_SIZE), *space.memory)
        if code < 0:
            raise AnalysisError(f"{integrator.label}: a step of an oscillator failed")
        result[:, :, column] = state[list(memory), :k].T
    return result


def spectral_radius(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Return the spectral radii of the measured amplification matrices, shape (k,)."""
    matrices = amplification(integrator, omega, damping, h)
    # Balance the rows: the state mixes m, m/s and m/s^2.
    family = integrator.family
    scale = np.array([h ** family.derivatives[row] for row in family.memory])
    matrices = matrices * scale[:, None] / scale
    return np.asarray(np.max(np.abs(np.linalg.eigvals(matrices)), axis=1))


@dataclass(frozen=True)
class Instability:
    """Unstable oscillator for a time step h (s).

    Attributes
    ----------
    index : int
        Index of the oscillator.
    h : float
        Time step, s.
    stable : callable
        Returns True if all oscillators are stable with another time step.
    """

    index: int
    h: float
    stable: Callable[[float], bool] = field(compare=False)

    @cached_property
    def largest_stable(self) -> float:
        """Largest stable time step below h, s; 0 if there is none.

        It is computed on first access with about 150 measurements.
        """
        return largest_stable(self.stable, self.h)


def find_instability(
    integrator: Integrator, omega: Array, damping: Array, h: float
) -> Instability | None:
    """Return the stiffest oscillator for which a time step is above the stability limit, or None.

    An unconditionally stable method is not measured.

    Parameters
    ----------
    integrator : Integrator
        Method.
    omega, damping : ndarray, shape (k,)
        Circular frequencies (rad/s) and damping ratios.
    h : float
        Time step, s.
    """
    if integrator.stability_limit == math.inf:
        return None

    def unstable(step: float) -> NDArray[np.bool_]:
        return spectral_radius(integrator, omega, damping, step) > 1.0 + STABLE

    grows = np.flatnonzero(unstable(h))
    if not grows.size:
        return None
    stiffest = grows[np.argmax(omega[grows])]
    return Instability(int(stiffest), h, lambda step: not unstable(step).any())


def largest_stable(stable: Callable[[float], bool], h: float) -> float:
    """Return the end of the first interval of stable time steps in (0, h], rounded down, s.

    The interval is searched upward from 0 and bisected. The result is 0 if no step is stable.
    """
    low, high = 0.0, h
    # Steps of h / 200 find the first interval if a method is unstable at intermediate steps and
    # stable above them.
    for part in range(1, 201):
        candidate = h * part / 200
        if not stable(candidate):
            high = candidate
            break
        low = candidate
    # 2^-40 of h / 200 is more precise than any written time step.
    low, _ = halved(stable, low, high, 40)
    return low if low > 1e-9 * h else 0.0


# ---- Which time steps an analysis may take

_SAME = 1e-9  # dimensionless; relative difference below which time steps are considered equal


@dataclass(frozen=True)
class Steps:
    """Time steps under a ground motion.

    Attributes
    ----------
    h : float
        Time step, s.
    count : int
        Number of time steps.
    per_sample, stride : int
        `per_sample` time steps cover `stride` sampling intervals.
    end : float
        Requested end, s. The last step ends at this time or less than one step after it.
    done : int
        Number of steps that are already completed.
    """

    h: float
    count: int
    per_sample: int = 1
    stride: int = 1
    end: float = field(default=math.inf, compare=False)
    done: int = 0

    @property
    def late(self) -> float:
        """Time from the requested end to the end of the last step, s."""
        return max(self.count * self.h - self.end, 0.0)


MOST_STEPS = 1_000_000_000
"""Maximum number of time steps of a run, about 15 minutes for a few stories. A mistake in dt does
not cause a run of years.
"""


def choose_steps(
    dt: float | None, duration: float | None, record_dt: float | None, record_duration: float
) -> Steps:
    """Return the time steps for a requested dt and duration.

    A time step divides the sampling interval of the record or is an integer multiple of it. The
    last step ends at the duration or after it.

    Parameters
    ----------
    dt, duration : float or None
        Requested time step and duration, s; by default those of the record.
    record_dt : float or None
        Sampling interval of the record, s; None without a record.
    record_duration : float
        Duration of the record, s.

    Raises
    ------
    UsageError
        dt or duration is missing and there is no record, dt is not compatible with the record, or
        there are too many steps.
    """
    if record_dt is None:
        if dt is None:
            raise UsageError(
                "no time step: without a record, specify --dt or analysis.dt in the model file"
            )
        if duration is None:
            raise UsageError(
                "no duration: without a record, specify --duration or analysis.duration in the "
                "model file"
            )
        return Steps(dt, _count(duration, dt), end=duration)
    if dt is not None and not record_dt / MOST_STEPS <= dt <= record_dt * MOST_STEPS:
        raise UsageError(
            f"dt must be comparable to the sampling interval of the record, {record_dt:.6g} s; "
            f"got {dt:.6g} s"
        )
    duration = record_duration if duration is None else duration
    if dt is None:
        return Steps(record_dt, _count(duration, record_dt), end=duration)
    # The time step divides the sampling interval or is a multiple of it, except for rounding: the
    # result is computed from the sampling interval.
    for ratio, per_sample in ((record_dt / dt, True), (dt / record_dt, False)):
        whole = round(ratio)
        if whole >= 1 and abs(ratio - whole) <= _SAME * whole:
            h = record_dt / whole if per_sample else record_dt * whole
            return Steps(
                h, _count(duration, h), *((whole, 1) if per_sample else (1, whole)), end=duration
            )
    # Next larger and next smaller compatible time step
    whole = math.floor(dt / record_dt if dt > record_dt else record_dt / dt)
    if dt > record_dt:
        below, above = record_dt * whole, record_dt * (whole + 1)
    else:
        below, above = record_dt / (whole + 1), record_dt / whole
    raise UsageError(
        f"dt {dt:.12g} s does not fit the record's sampling interval {record_dt:.12g} s: the "
        f"nearest steps are {below:.12g} and {above:.12g} s"
    )


def _count(duration: float, h: float) -> int:
    """Return the number of steps for a duration; UsageError if there are too many."""
    count = duration / h * (1.0 - _SAME)
    if not count <= MOST_STEPS:
        raise UsageError(
            f"{count:.3g} steps of {h:.6g} s for a duration of {duration:.6g} s: at most "
            f"{MOST_STEPS:.0e} are allowed; use a longer dt or a shorter duration"
        )
    return max(1, math.ceil(count))


def finer(steps: Steps) -> Steps:
    """Return half the time step over the same duration."""
    if steps.per_sample == 1 and steps.stride % 2 == 0:
        return replace(steps, h=steps.h / 2, count=2 * steps.count, stride=steps.stride // 2)
    return replace(steps, h=steps.h / 2, count=2 * steps.count, per_sample=2 * steps.per_sample)
