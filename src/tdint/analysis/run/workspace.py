"""The arrays that a march works on, and the march itself: the one place that calls the compiled time loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.steps import Steps
from tdint.errors import AnalysisError
from tdint.kernels.laws.apart import spring_table
from tdint.kernels.layout import (
    ALL_BRANCHES,
    BRANCHES,
    LINEAR,
    LOAD_SIZE,
    MEMO_SIZE,
    NO_BRANCHES,
    OWN_WORK,
    POWER_DAMPERS,
    SOME_BRANCHES,
    STRAIGHTENED,
)
from tdint.kernels.march.march import march
from tdint.kernels.march.observing import (
    AT_STEPS_ONLY,
    BETWEEN_STEPS,
    ENERGY_TERMS,
    HISTORY_FIELDS,
    INTERPOLATED,
    OBSERVED_SIZE,
    OBSERVER_ROWS,
    ON_THE_PATH,
    PEAK_ROWS,
)
from tdint.methods.method import Integrator
from tdint.model.building import Building

Array = NDArray[np.float64]

HALVINGS = 8
"""How often a step that does not converge is halved before the run ends."""


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

    With `between` the peaks of drift and displacement are looked for between the steps, too; so they are where the
    method knows its path there.
    """
    n = building.stories
    modes = building.modal.shape[0]
    family = integrator.family
    memo = np.zeros(MEMO_SIZE)
    memo[LINEAR] = building.linear
    memo[BRANCHES] = _branches(building)
    memo[POWER_DAMPERS] = building.power_damped
    memo[OWN_WORK] = family.own_work
    memo[STRAIGHTENED] = family.straightened
    observed = np.zeros(OBSERVED_SIZE)
    observed[BETWEEN_STEPS] = ON_THE_PATH if family.parabolic else INTERPOLATED if between else AT_STEPS_ONLY
    return Workspace(
        state=np.zeros((family.state_rows, n + 1)),
        springs=spring_table(building.laws),
        work=np.zeros((family.work_rows(modes), max(n, 2 * modes) + 1)),
        memo=memo,
        watch=np.zeros((OBSERVER_ROWS, n + 1)),
        peaks=np.zeros((PEAK_ROWS, n)),
        observed=observed,
        history=np.zeros((steps + 1 if steps else 0, 1 + HISTORY_FIELDS * n + ENERGY_TERMS)),
    )


def _branches(building: Building) -> int:
    if building.piecewise_linear and not building.power_damped:
        return ALL_BRANCHES
    return SOME_BRANCHES if building.kinked else NO_BRANCHES


def compile_all(integrator: Integrator) -> None:
    """Compile, or load from the cache, what `integrate` calls: before a clock starts."""
    _ = march.compiled, integrator.family.step.compiled


def integrate(
    integrator: Integrator,
    coefficients: Array,
    building: Building,
    forces: Array,
    ground: Array,
    steps: Steps,
    space: Workspace,
) -> int:
    """March over the steps from the initial state in `space`; returns 0 or the code of the step that failed.

    `coefficients` are those of the integrator for this building, these forces and this step.

    Raises
    ------
    ValueError
        The steps are no whole multiple of those that the history has room for.
    """
    if len(space.history) > 1 and steps.count % (len(space.history) - 1):
        raise ValueError(f"{steps.count} steps do not fit into a history of {len(space.history) - 1}")
    return int(
        march.compiled(
            integrator.family.step.compiled,
            steps.count,
            steps.per_sample,
            steps.stride,
            HALVINGS if integrator.family.halvable else 0,
            steps.h,
            ground,
            coefficients,
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


def check_suited(integrator: Integrator, building: Building) -> None:
    """Refuse a nonlinear building for a method of linear ones, and power-law dashpots for one that takes none.

    Raises
    ------
    AnalysisError
        The method does not integrate this building.
    """
    if integrator.family.linear_only and not building.linear:
        raise AnalysisError(f"{integrator.label} integrates linear buildings only; this one has nonlinear stories")
    if building.power_damped and not integrator.family.power_dampers:
        raise AnalysisError(f"{integrator.label} takes no power-law dashpots; impulse4 and newmark-average do")
