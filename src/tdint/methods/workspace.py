"""Arrays that a time integration reads and writes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.errors import AnalysisError
from tdint.kernels import layout as rows
from tdint.kernels.laws import LAWS
from tdint.kernels.stepping import Memory, Seen
from tdint.kernels.stories.law_tables import law_state_table
from tdint.methods.method import Integrator
from tdint.model.building import Building
from tdint.system import available_memory

HALVINGS = 8
"""Maximum number of times that a step without convergence is halved before the run fails."""

_WITH_RESULTS = 2.5
"""Dimensionless. Memory of a history including its results (drifts and forces), divided by the
memory of its rows.
"""


# Rows of `Workspace.observer_state` in a model of flexural stories, with a loop that is not
# compiled: peaks in the order of `FlexureValues`. The last three have one number, in the first
# column.
MOMENT, ROTATION, UNROTATED_DRIFT, SHEAR_DRIFT, BENDING_DRIFT = range(1, 6)
BASE_ROTATION, BASE_DISPLACEMENT, TOTAL_BASE_MOMENT = range(6, 9)
# Row of `Workspace.observer_state` in a building with inerters: peak forces of inerters, N
INERTER_FORCE = 1


@dataclass
class Workspace:
    """Arrays that a time integration reads and writes.

    The arrays are described in `tdint.kernels.layout`. The tables `state`, `law_state` and
    `observer_state` have one column per floor or story and an additional column, `peaks` and
    `limits` one column per floor or story. `flags`, `step_status` and `totals` are vectors.

    Attributes
    ----------
    history : ndarray
        Response history, one row per stored time; no rows if no history is stored.
    forces : ndarray
        Forces on floors. Rows of tables contain the lines of the current step, so that a run has a
        separate copy.
    steps_per_row : int
        Number of time steps between two rows of the history: 1 to store every step.
    rows_before : int
        Number of rows of the complete history that precede the first row of `history`, if the
        history is written to a file in chunks.
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
    forces: Array
    steps_per_row: int = 1
    rows_before: int = 0

    @property
    def memory(self) -> Memory:
        """Arrays with the state of the method and of the hysteretic laws."""
        return Memory(self.state, self.law_state, self.scratch, self.step_status)

    @property
    def seen(self) -> Seen:
        """Arrays with the observed results."""
        return Seen(self.observer_state, self.peaks, self.limits, self.totals, self.history)


def workspace(
    building: Building,
    integrator: Integrator,
    row_count: int = 0,
    collapse_drift: float = math.inf,
    forces: Array | None = None,
) -> Workspace:
    """Return new arrays for one run: zeros, except for flags, limits, the marks of failed laws and
    the value NO_COLLAPSE in the totals.

    The scratch array has at least one column per floor or story and an additional column.

    Parameters
    ----------
    row_count : int, default 0
        Number of rows of the history; 0 to store no history.
    collapse_drift : float, default infinity
        Drift ratio above which a story has collapsed.

    Raises
    ------
    AnalysisError
        The free memory is too small for the history.
    """
    n = building.stories
    modes = building.modal.shape[0]
    family = integrator.family
    flags = np.zeros(rows.FLAGS_SIZE)
    flags[rows.LINEAR] = building.linear
    # NO_BRANCHES: no branch change is located. SOME_BRANCHES: branch changes are located, but a
    # step without branch changes is nonlinear, because some laws are curved or there are power-law
    # dashpots, braces of dampers or tangent damping. ALL_BRANCHES: a single linear solution is
    # sufficient for a step without branch changes.
    flags[rows.BRANCHES] = rows.SOME_BRANCHES if building.kinked else rows.NO_BRANCHES
    is_smooth = building.power_damped or building.has_damper_state
    if building.piecewise_linear and not is_smooth:
        flags[rows.BRANCHES] = rows.ALL_BRANCHES
    flags[rows.POWER_DAMPERS] = is_smooth or building.inertial
    flags[rows.HAS_BRACES] = building.braced
    flags[rows.HAS_TANGENT_DAMPING] = building.tangent_damped
    flags[rows.HAS_DAMPER_STATE] = building.has_damper_state
    flags[rows.OWN_WORK] = family.own_work
    flags[rows.PARABOLIC] = family.parabolic
    flags[rows.MEAN_WEIGHT], flags[rows.MEAN_DISTANCE] = family.mean_rule
    flags[rows.HAS_DASHPOTS] = building.damped_by_devices
    # The observer evaluates a law at a reversal within a step from the state at the end of the
    # step. A curved hysteretic law reloads on another curve and needs the state at the start.
    follows_branches = building.piecewise_linear and family.step_peaks
    flags[rows.KEEPS_START] = building.kinked and not follows_branches
    if building.can_fracture:
        flags[rows.CAN_FRACTURE] = 1.0 if flags[rows.KEEPS_START] else -1.0
    width = history_width(building)
    if row_count:
        # The complete history and its results are in memory simultaneously.
        needed = _WITH_RESULTS * 8.0 * row_count * width  # bytes; a number has 8 bytes
        free = available_memory()
        if needed > free:
            raise AnalysisError(
                f"a response history of {row_count} rows needs {needed / 1000000000.0:.3g} GB "
                f"of memory, {free / 1000000000.0:.3g} GB are free; use fewer time steps, or "
                "write the history to a file, which needs less memory"
            )
    columns = building.law_parameters.shape[1]
    added_rows = rows.ADDED_STATE_ROWS if building.has_damper_state else 0
    totals = np.zeros(rows.TOTALS_SIZE)
    totals[rows.COLLAPSE_STEP] = rows.NO_COLLAPSE
    return Workspace(
        state=np.zeros((family.state_rows + added_rows, n + 1)),
        law_state=law_state_table(building.law_parameters),
        # The scratch array also contains the small matrix of the Woodbury formula for modal
        # damping. With two unknowns per floor, its order is two times the number of modes. One
        # further column is reserved but not used.
        scratch=np.zeros((family.scratch_rows(modes), max(columns, 2 * modes + 1))),
        flags=flags,
        step_status=np.zeros(rows.STEP_STATUS_SIZE),
        observer_state=np.zeros((rows.OBSERVER_ROWS, n + 1)),
        # Peaks, then possible peaks of unresolved motion
        peaks=np.zeros((2 * rows.PEAK_ROWS, n)),
        limits=collapse_limits(building, collapse_drift),
        totals=totals,
        history=np.zeros((row_count, width)),
        forces=np.zeros((0, rows.FORCE_COLUMNS)) if forces is None else forces.copy(),
    )


def collapse_limits(building: Building, collapse_drift: float) -> Array:
    """Return the table of the collapse limits, shape (LIMIT_ROWS, n).

    Parameters
    ----------
    collapse_drift : float
        Drift ratio above which a story has collapsed.
    """
    limits = np.empty((rows.LIMIT_ROWS, *building.story_laws.shape[1:]))
    limits[rows.LIMIT] = collapse_drift
    limits[rows.HEIGHT] = building.heights
    # INTERNAL of a story with elements is 1 if all elements have failed. All samples have the same
    # laws.
    codes = building.story_laws[rows.CODE].reshape(-1, building.stories)[0].tolist()
    limits[rows.FAILED] = [1.0 if code <= rows.ELEMENTS else LAWS[code].failed for code in codes]
    limits[rows.HIGH_LIMIT], limits[rows.LOW_LIMIT] = building.resistance_limits
    if building.branched:
        # The building does not collapse after an attachment or a link has lost its resistance.
        devices = slice(building.floors, None)
        limits[rows.FAILED, devices] = math.nan
        limits[rows.HIGH_LIMIT, devices], limits[rows.LOW_LIMIT, devices] = math.inf, -math.inf
    # A story without height (nan) has no limit of the drift ratio.
    limits[rows.SMALLEST_LIMIT] = np.fmin(
        limits[rows.LIMIT] * limits[rows.HEIGHT],
        np.minimum(limits[rows.HIGH_LIMIT], -limits[rows.LOW_LIMIT]),
    )
    return limits


def history_width(building: Building) -> int:
    """Return the number of values in a row of the history.

    They are the ground acceleration, HISTORY_FIELDS values of each floor or story of the building,
    the force of each brace in a building with braces, the energies (ENERGY_TERMS values), and the
    forces of the elements.
    """
    fields = rows.HISTORY_FIELDS + building.braced
    return 1 + fields * building.stories + rows.ENERGY_TERMS + building.elements


def state_jumps(integrator: Integrator, h: float) -> Array:
    """Return the change of each row of the state for a unit jump of the floor accelerations:
    `Family.shifts` times h^(2 - k) for a row with the derivative of order k.

    If a time step is longer than the sampling interval of the ground motion, the ground
    acceleration in each step is replaced by a straight line. Successive lines have different values
    at the common endpoint, so that the relative accelerations jump between two steps. Mean
    velocities and accelerations of earlier steps (multi-step methods) change as if the new
    acceleration had already acted in these steps.
    """
    family = integrator.family
    return np.array(family.shifts) * h ** (2.0 - np.array(family.derivatives))
