"""The arrays that a march works on, and the kernels that it calls."""

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
"""How often a step that does not converge is halved before the run ends."""

_WITH_RESULTS = 2.5
"""Memory of a history as results, with drifts and forces, over that of its rows."""


@dataclass
class Workspace:
    """What a march reads and writes; all tables have one column per story and one that stays zero.

    Of the history every so many steps have a row, and some rows stand before those that are there.
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
        """What method and drift laws remember."""
        return Memory(self.state, self.law_state, self.scratch, self.step_status)

    @property
    def seen(self) -> Seen:
        """What is seen of the motion."""
        return Seen(self.observer_state, self.peaks, self.limits, self.totals, self.history)


def workspace(
    building: Building, integrator: Integrator, row_count: int = 0, collapse_drift: float = math.inf
) -> Workspace:
    """Fresh arrays for one run, with so many rows of its history.

    Raises
    ------
    AnalysisError
        The memory that is free does not hold them; a plug-in's method that is found to be wrong.
    """
    look_at_once(integrator)
    n = building.stories
    modes = building.modal.shape[0]
    family = integrator.family
    flags = np.zeros(rows.FLAGS_SIZE)
    flags[rows.LINEAR] = building.linear
    # With dashpots of powers no step is linear branch by branch.
    flags[rows.BRANCHES] = rows.SOME_BRANCHES if building.kinked else rows.NO_BRANCHES
    if building.piecewise_linear and not building.power_damped:
        flags[rows.BRANCHES] = rows.ALL_BRANCHES
    flags[rows.POWER_DAMPERS] = building.power_damped
    flags[rows.OWN_WORK] = family.own_work
    flags[rows.PARABOLIC] = family.parabolic
    flags[rows.HAS_DASHPOTS] = building.damped_by_devices
    width = history_width(building)
    if row_count:
        # All of it is held in memory, and its results beside it.
        needed, free = _WITH_RESULTS * 8.0 * row_count * width, available_memory()
        if needed > free:
            raise AnalysisError(
                f"a history of {row_count} rows takes {needed / 1e9:.3g} GB of memory, "
                f"{free / 1e9:.3g} GB are free; take fewer steps, or write the history to a "
                "file, which takes it in pieces"
            )
    # What a story's row INTERNAL is once it has failed: nan of laws that do not fail.
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
    """Numbers in a row of the history."""
    return 1 + rows.HISTORY_FIELDS * building.stories + rows.ENERGY_TERMS


LOOKED_AT: set[Kernel] = set()
"""Steps of plug-ins that this process has executed in plain Python, or need not, for somebody does
it now."""

_ONE_AT_A_TIME = threading.RLock()
if hasattr(os, "register_at_fork"):  # a child would wait for a thread that it has not
    os.register_at_fork(after_in_child=_ONE_AT_A_TIME._at_fork_reinit)  # type: ignore[attr-defined]


def look_at_once(integrator: Integrator) -> None:
    """Execute the step of a plug-in in plain Python before its first compiled run, which would
    write beyond the ends of arrays or forget a story's state in silence: once for each state of its
    sources, which the cache of kernels keeps.

    Raises
    ------
    AnalysisError
        What is wrong with it.
    """
    step = integrator.family.step
    if step.function.__module__.startswith("tdint.") or os.environ.get("TDINT_KERNELS") == "python":
        return
    with _ONE_AT_A_TIME:
        if step in LOOKED_AT:
            return
        folder = cache_subfolder("plugins")
        file = folder and folder / f"{digest(step.name)}-{integrator.method.name}"
        if file is None or not file.exists():
            # Found by name when it is needed: it marches with what is declared here.
            faults_of_step = import_module("tdint.analysis.assessment.order").faults_of_step
            LOOKED_AT.add(step)
            if faults := faults_of_step(integrator):
                LOOKED_AT.remove(step)
                raise AnalysisError(
                    f"{'; '.join(faults)} (`tdint check --plugin` looks at all that it declares)"
                )
            if file is not None:
                with suppress(OSError):
                    file.touch()
        LOOKED_AT.add(step)


def kernels(integrator: Integrator, variant: Variant) -> list[tuple[Kernel, Variant]]:
    """The kernels that a march calls, those first that take the longest to compile. Errors are
    `look_at_once`'s."""
    look_at_once(integrator)
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
    """What each row of the state takes of a jump of the ground acceleration between two steps h
    (s)."""
    family = integrator.family
    return np.array(family.shifts) * h ** (2.0 - np.array(family.derivatives))


def unsuited(integrator: Integrator, building: Building) -> str:
    """Why a method does not integrate a building: nonlinear stories, power-law dashpots; empty if
    it does."""
    if integrator.family.linear_only and not building.linear:
        return (
            f"{integrator.label} integrates linear buildings only; this one has nonlinear stories"
        )
    if building.power_damped and not integrator.family.power_dampers:
        return f"{integrator.label} takes no power-law dashpots; impulse4 and newmark-average do"
    return ""


# ---- Amplification matrices measured on the compiled steps, and the stability that follows from
# them

LINEAR_OSCILLATORS = Variant(laws=("linear",), modal=False, forces=False, dashpots=False)
"""What the kernels need for them."""

STABLE = 1e-9
"""A spectral radius above 1 by less than this counts as 1: rounding."""

_SETTLED = 100.0  # steps done as a multi-step method sees it: past its start

# Oscillators in one building where the step's coefficients belong to the whole building: their
# matrix is dense, and LAPACK mixes the modes of uncoupled oscillators from 26 on.
_TOGETHER = 16


def amplification(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Amplification matrices of undriven oscillators over one step h (s), by stepping each row of
    the method's memory.

    Parameters
    ----------
    omega, damping : ndarray, shape (k,)
        Circular frequencies (rad/s) and damping ratios.

    Returns
    -------
    ndarray, shape (k, m, m)
        m is the number of memory rows of the family; units as in the state.
    """
    omega, damping = np.broadcast_arrays(np.asarray(omega, float), np.asarray(damping, float))
    if integrator.family.prepare is not None:
        starts = range(0, max(omega.size, 1), _TOGETHER)
        groups = [oscillators(omega[j : j + _TOGETHER], damping[j : j + _TOGETHER]) for j in starts]
        return np.concatenate([_amplification(integrator, group, h) for group in groups])
    return _amplification(integrator, oscillators(omega, damping), h)


def _amplification(integrator: Integrator, building: Building, h: float) -> Array:
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
        # Committed springs, and the acceleration of equilibrium where the method does not carry its
        # own.
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
    """Spectral radii of the measured amplification matrices, shape (k,)."""
    matrices = amplification(integrator, omega, damping, h)
    # Balance the rows: the state mixes m, m/s and m/s^2.
    family = integrator.family
    scale = np.array([h ** family.derivatives[row] for row in family.memory])
    matrices = matrices * scale[:, None] / scale
    return np.asarray(np.max(np.abs(np.linalg.eigvals(matrices)), axis=1))


@dataclass(frozen=True)
class Instability:
    """An oscillator that grows with a step h (s): its index, and whether all are stable with
    another step."""

    index: int
    h: float
    stable: Callable[[float], bool] = field(compare=False)

    @cached_property
    def largest_stable(self) -> float:
        """The largest stable step below h (0: none), s: some 150 measurements, made for who
        asks."""
        return largest_stable(self.stable, self.h)


def find_instability(
    integrator: Integrator, omega: Array, damping: Array, h: float
) -> Instability | None:
    """Whether a step h (s) is beyond the method's limit for one of some oscillators; the stiffest
    such one.

    A method that is unconditionally stable is not measured.
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
    """End of the first range of stable steps, searched upward in (0, h] and bisected, rounded down;
    0 for none, s."""
    low, high = 0.0, h
    # By 200ths: of a method that is unstable in between and stable beyond, the first range is
    # found.
    for part in range(1, 201):
        candidate = h * part / 200
        if not stable(candidate):
            high = candidate
            break
        low = candidate
    # 2^-40 of a 200th of h: beyond what a step is ever written with.
    low, _ = halved(stable, low, high, 40)
    return low if low > 1e-9 * h else 0.0


# ---- Which time steps an analysis may take

_SAME = 1e-9  # steps that differ by less than this part are the same


@dataclass(frozen=True)
class Steps:
    """Time steps on a ground motion: `per_sample` of them take `stride` sampling intervals.

    They end at the time that was asked for, `end` (s), or less than a step after it. Of all `count`
    so many may be `done`.
    """

    h: float
    count: int
    per_sample: int = 1
    stride: int = 1
    end: float = field(default=math.inf, compare=False)
    done: int = 0

    @property
    def late(self) -> float:
        """How long after the time that was asked for the last step ends, s."""
        return max(self.count * self.h - self.end, 0.0)


MOST_STEPS = 1_000_000_000
"""Steps that a run may have, some quarter of an hour for a few stories: a slip in dt does not run
for years."""


def choose_steps(
    dt: float | None, duration: float | None, record_dt: float | None, record_duration: float
) -> Steps:
    """Time steps for a wished dt (s) and duration (s) under a record, or without one (`record_dt`
    None).

    A step divides the record's sampling interval or is a whole multiple of it. The last step ends
    at the duration or after.

    Raises
    ------
    UsageError
        No dt or duration where there is no record to take it from; a dt that does not fit the
        record; too many steps.
    """
    if record_dt is None:
        if dt is None:
            raise UsageError(
                "no time step: without a record, give --dt or analysis.dt in the model file"
            )
        if duration is None:
            raise UsageError(
                "no duration: without a record, give --duration or analysis.duration in the model "
                "file"
            )
        return Steps(dt, _count(duration, dt), end=duration)
    if dt is not None and not record_dt / MOST_STEPS <= dt <= record_dt * MOST_STEPS:
        raise UsageError(
            f"dt {dt:.6g} s is out of all proportion to the record's sampling interval "
            f"{record_dt:.6g} s"
        )
    duration = record_duration if duration is None else duration
    if dt is None:
        return Steps(record_dt, _count(duration, record_dt), end=duration)
    # A part of the sampling interval, or a multiple of it, but for rounding: the record's own
    # number is taken.
    for ratio, per_sample in ((record_dt / dt, True), (dt / record_dt, False)):
        whole = round(ratio)
        if whole >= 1 and abs(ratio - whole) <= _SAME * whole:
            h = record_dt / whole if per_sample else record_dt * whole
            return Steps(
                h, _count(duration, h), *((whole, 1) if per_sample else (1, whole)), end=duration
            )
    # The next larger and the next smaller step that would fit.
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
    count = duration / h * (1.0 - _SAME)
    if not count <= MOST_STEPS:
        raise UsageError(
            f"{count:.3g} steps of {h:.6g} s for a duration of {duration:.6g} s: at most "
            f"{MOST_STEPS:.0e} are taken; use a longer dt or a shorter duration"
        )
    return max(1, math.ceil(count))


def finer(steps: Steps) -> Steps:
    """Half the step over the same time."""
    if steps.per_sample == 1 and steps.stride % 2 == 0:
        return replace(steps, h=steps.h / 2, count=2 * steps.count, stride=steps.stride // 2)
    return replace(steps, h=steps.h / 2, count=2 * steps.count, per_sample=2 * steps.per_sample)
