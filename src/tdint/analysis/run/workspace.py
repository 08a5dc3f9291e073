"""The arrays that a march works on, and the kernels that it calls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.errors import AnalysisError
from tdint.kernels import layout as at
from tdint.kernels.building.compilable import Variant
from tdint.kernels.bundles import Memory, Seen
from tdint.kernels.compiling import Kernel
from tdint.kernels.equations.carried.rows import error_peaks
from tdint.kernels.laws.compiled_separately import spring_table
from tdint.kernels.march.law_energies import begin, raise_shears, take_stock
from tdint.kernels.march.march import march
from tdint.methods.method import Integrator
from tdint.model.building import Building
from tdint.model.laws import CODES, LAWS
from tdint.system import available_memory

HALVINGS = 8
"""How often a step that does not converge is halved before the run ends."""

_WITH_RESULTS = 2.5
"""Memory of a history as results, with drifts and forces, over that of its rows."""


@dataclass
class Workspace:
    """What a march reads and writes; all tables have one column per story and one that stays zero.

    Of the history every so many steps have a row, and some rows stand before those that are there. `choice` is what
    strides are chosen by on the way, if they are.
    """

    state: Array
    springs: Array
    work: Array
    flags: Array
    report: Array
    watch: Array
    peaks: Array
    limits: Array
    totals: Array
    history: Array
    every: int = 1
    before: int = 0
    choice: Array | None = None

    def forget_peaks(self, integrator: Integrator, modes: int) -> None:
        """Look for peaks anew, also where the method keeps some of its own."""
        self.peaks[:] = 0.0
        firsts = [int(self.report[at.OWN_PEAKS])] if self.report[at.OWN_PEAKS] else []
        if integrator.family.carries_error:
            firsts.append(error_peaks(modes))
        for first in firsts:
            self.work[first : first + 2 * at.PEAK_ROWS] = 0.0

    @property
    def memory(self) -> Memory:
        """What method and drift laws remember."""
        return Memory(self.state, self.springs, self.work, self.report)

    @property
    def seen(self) -> Seen:
        """What is seen of the motion."""
        return Seen(self.watch, self.peaks, self.limits, self.totals, self.history)


def workspace(
    building: Building,
    integrator: Integrator,
    rows: int = 0,
    collapse_drift: float = math.inf,
) -> Workspace:
    """Fresh arrays for one run, with so many rows of its history.

    Raises
    ------
    AnalysisError
        The memory that is free does not hold them.
    """
    n = building.stories
    modes = building.modal.shape[0]
    family = integrator.family
    flags = np.zeros(at.FLAGS_SIZE)
    flags[at.LINEAR] = building.linear
    flags[at.BRANCHES] = _branches(building)
    flags[at.POWER_DAMPERS] = building.power_damped
    flags[at.OWN_WORK] = family.own_work
    flags[at.ON_PATH] = family.parabolic
    flags[at.CARRIES_ERROR] = family.carries_error
    flags[at.DEVICES] = building.damped_by_devices
    width = history_width(building, integrator)
    if rows:
        _check_room(rows, width)
    totals = np.zeros(at.TOTALS_SIZE)
    totals[at.COLLAPSE_STEP] = at.NO_COLLAPSE
    return Workspace(
        state=np.zeros((family.state_rows, n + 1)),
        springs=spring_table(doubled_laws(building, integrator)),
        work=np.zeros((family.work_rows(modes), max((2 if family.carries_error else 1) * (n + 1), 2 * modes + 1))),
        flags=flags,
        report=np.zeros(at.REPORT_SIZE),
        watch=np.zeros((at.WATCH_ROWS, n + 1)),
        peaks=np.zeros((2 * at.PEAK_ROWS, n)),
        limits=np.array([np.full(n, collapse_drift), building.heights, _failed(building)]),
        totals=totals,
        history=np.zeros((rows, width)),
    )


def history_width(building: Building, integrator: Integrator) -> int:
    """Numbers in a row of the history."""
    fields = at.HISTORY_FIELDS + (at.ERROR_FIELDS if integrator.family.carries_error else 0)
    return 1 + fields * building.stories + at.ENERGY_TERMS


def _check_room(rows: int, width: int) -> None:
    wanted, free = _WITH_RESULTS * 8.0 * rows * width, available_memory()
    if wanted > free:
        raise AnalysisError(
            f"a history of {rows} rows takes {wanted / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB are free; take fewer "
            "steps, or write the history to a file, which takes it in pieces"
        )


def doubled_laws(building: Building, integrator: Integrator) -> Array:
    """The laws; twice where the error is carried along."""
    return (
        np.hstack([building.law_parameters, building.law_parameters])
        if integrator.family.carries_error
        else building.law_parameters
    )


def _failed(building: Building) -> Array:
    """What row INTERNAL is in the stories that have failed."""
    failed = np.full(max(CODES.values()) + 1, math.nan)
    for name, code in CODES.items():
        failed[code] = LAWS[name].failed
    return np.asarray(failed[building.law_parameters[at.CODE, :-1].astype(int)])


def _branches(building: Building) -> int:
    if building.piecewise_linear and not building.power_damped:
        return at.ALL_BRANCHES
    return at.SOME_BRANCHES if building.kinked else at.NO_BRANCHES


def kernels(integrator: Integrator, wanted: Variant) -> list[tuple[Kernel, Variant]]:
    """The kernels that a march calls, those first that take the longest to compile."""
    return [(kernel, wanted) for kernel in (integrator.family.step, march, begin, take_stock, raise_shears)]


def shifts(integrator: Integrator, h: float) -> Array:
    """What each row of the state takes of a jump of the ground acceleration between two steps h (s)."""
    family = integrator.family
    return np.array(family.shifts) * h ** (2.0 - np.array(family.derivatives))


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
