"""Which time steps an analysis may take, and the arrays that a march needs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.errors import AnalysisError, UsageError
from tdint.kernels.layout import (
    ALL_BRANCHES,
    BRANCHES,
    LINEAR,
    LOAD_SIZE,
    MEMO_SIZE,
    NO_BRANCHES,
    POWER_DAMPERS,
    SOME_BRANCHES,
    SPRING_BLOCKS,
    SPRING_ROWS,
)
from tdint.kernels.march.march import march
from tdint.kernels.march.observing import (
    BETWEEN_STEPS,
    HISTORY_ENERGIES,
    HISTORY_FIELDS,
    OBSERVED_SIZE,
    OBSERVER_ROWS,
    PEAK_ROWS,
)
from tdint.methods.method import Integrator
from tdint.model.building import Building

Array = NDArray[np.float64]

HALVINGS = 8
"""How often a step that does not converge is halved before the run ends."""

_SAME = 1e-9  # steps that differ by less than this part are the same


@dataclass(frozen=True)
class Steps:
    """Time steps on a ground motion: `per_sample` steps between two samples, or one step over `stride` samples."""

    h: float
    count: int
    per_sample: int = 1
    stride: int = 1


def choose_steps(dt: float | None, duration: float | None, record_dt: float | None, record_duration: float) -> Steps:
    """Time steps for a wished dt (s) and duration (s) under a record, or without one (`record_dt` None).

    A step divides the record's sampling interval or is a whole multiple of it. The last step ends at the duration or
    after.

    Raises
    ------
    UsageError
        No dt or duration where there is no record to take it from; a dt that does not fit the record.
    """
    if record_dt is None:
        if dt is None:
            raise UsageError("no time step: without a record, give --dt or analysis.dt in the model file")
        if duration is None:
            raise UsageError("no duration: without a record, give --duration or analysis.duration in the model file")
        return Steps(dt, _count(duration, dt))
    duration = record_duration if duration is None else duration
    if dt is None:
        return Steps(record_dt, _count(duration, record_dt))
    for ratio, per_sample in ((record_dt / dt, True), (dt / record_dt, False)):
        whole = round(ratio)
        if whole >= 1 and abs(ratio - whole) <= _SAME * whole:
            h = record_dt / whole if per_sample else record_dt * whole
            return Steps(h, _count(duration, h), *((whole, 1) if per_sample else (1, whole)))
    below, above = _neighbours(dt, record_dt)
    raise UsageError(
        f"dt {dt:.12g} s does not fit the record's sampling interval {record_dt:.12g} s: "
        f"the nearest steps are {below:.12g} and {above:.12g} s"
    )


def _count(duration: float, h: float) -> int:
    return max(1, math.ceil(duration / h * (1.0 - _SAME)))


def _neighbours(dt: float, record_dt: float) -> tuple[float, float]:
    if dt > record_dt:
        whole = math.floor(dt / record_dt)
        return record_dt * whole, record_dt * (whole + 1)
    whole = math.floor(record_dt / dt)
    return record_dt / (whole + 1), record_dt / whole


@dataclass
class Workspace:
    """What a march reads and writes; all tables have one column per story and one that stays zero."""

    state: Array
    springs: Array
    work: Array
    memo: Array
    watch: Array
    peaks: Array
    observed: Array
    history: Array


def workspace(building: Building, integrator: Integrator, steps: int = 0, between: bool = False) -> Workspace:
    """Fresh arrays for one run; with room for a history of `steps` steps and the start if it is not 0.

    A march of k times as many steps keeps every k-th.

    With `between` the peaks of drift and displacement are looked for between the steps, too.
    """
    n = building.stories
    modes = building.modal.shape[0]
    family = integrator.family
    memo = np.zeros(MEMO_SIZE)
    memo[LINEAR] = building.linear
    memo[BRANCHES] = _branches(building)
    memo[POWER_DAMPERS] = building.power_damped
    observed = np.zeros(OBSERVED_SIZE)
    observed[BETWEEN_STEPS] = between
    return Workspace(
        state=np.zeros((family.state_rows, n + 1)),
        springs=np.zeros((SPRING_BLOCKS * SPRING_ROWS, n + 1)),
        work=np.zeros((family.work_rows(modes), max(n, 2 * modes) + 1)),
        memo=memo,
        watch=np.zeros((OBSERVER_ROWS, n + 1)),
        peaks=np.zeros((PEAK_ROWS, n)),
        observed=observed,
        history=np.zeros((steps + 1 if steps else 0, 1 + HISTORY_FIELDS * n + HISTORY_ENERGIES)),
    )


def _branches(building: Building) -> int:
    if building.piecewise_linear and not building.power_damped:
        return ALL_BRANCHES
    return SOME_BRANCHES if building.kinked else NO_BRANCHES


def compile_all(integrator: Integrator) -> None:
    """Compile, or load from the cache, what `integrate` calls: before a clock starts."""
    _ = march.compiled, integrator.family.step.compiled


def integrate(
    integrator: Integrator, building: Building, forces: Array, ground: Array, steps: Steps, space: Workspace
) -> int:
    """March over the steps from the initial state in `space`; returns 0 or the code of the step that failed.

    Raises
    ------
    AnalysisError
        A nonlinear building for a method that integrates linear ones only, or power-law dashpots for one that does not
        take them.
    ValueError
        The steps are no whole multiple of those that the history has room for.
    """
    if len(space.history) > 1 and steps.count % (len(space.history) - 1):
        raise ValueError(f"{steps.count} steps do not fit into a history of {len(space.history) - 1}")
    if integrator.family.linear_only and not building.linear:
        raise AnalysisError(f"{integrator.label} integrates linear buildings only; this one has nonlinear stories")
    if building.power_damped and not integrator.family.power_dampers:
        raise AnalysisError(f"{integrator.label} takes no power-law dashpots; impulse4 and newmark-average do")
    return int(
        march.compiled(
            integrator.family.step.compiled,
            steps.count,
            steps.per_sample,
            steps.stride,
            HALVINGS if integrator.family.halvable else 0,
            steps.h,
            ground,
            integrator.coefficients(building, forces, steps.h),
            building.chain,
            building.modal,
            building.laws,
            forces,
            space.state,
            space.springs,
            space.work,
            space.memo,
            np.zeros(LOAD_SIZE),
            space.watch,
            space.peaks,
            space.observed,
            space.history,
        )
    )
