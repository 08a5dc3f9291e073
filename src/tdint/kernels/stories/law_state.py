"""Hysteresis models of stories: forces, tangents, energies, and committed and trial states.

The hysteresis models (drift laws) are in `tdint.kernels.laws`, one file for each law. The functions
of the module call the law of each story.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import (
    FULL,
    I8,
    TABLE,
    VECTOR,
    copy_rows_within,
    inline,
    kernel,
    outlined,
)
from tdint.kernels.laws.branch_following import (
    branch_follower,
    branch_owner,
    copy_state,
    extra_rows,
)
from tdint.kernels.laws.fracture import AT_LIMIT, FRACTURING
from tdint.kernels.laws.selection import (
    accumulate_dissipation_of_law,
    advance_rows,
    commit_law,
    elements_of,
    force_of_law,
    hysteretic_energy_of_law,
    keep_rows,
    stores_branch,
    strain_energy_of_law,
)
from tdint.kernels.stories.branches import enter, sum_branches, switch, synchronize

# Change of drift that determines the tangent in the direction of the motion, divided by the drift
_DRIFT_OF_TANGENT = 1e-7


@outlined
def _advance_rows_outlined(law_parameters, law_state, i, block, step, mean_force):
    """Update the rows of the law in column `i` (`advance_rows`), for a caller with several
    calls."""
    advance_rows(law_parameters, law_state, i, block, step, mean_force)


# Force of an element that follows its branches, in every state. The slope of the branch is the
# tangent.
_follow_branches = branch_follower(switch, _advance_rows_outlined)


@inline
def strain_energy(law_parameters, law_state, i):
    """Return the strain energy that the law of story `i` stores in its committed state, J.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.

    Returns
    -------
    float
        Strain energy, J.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        synchronize(law_parameters, law_state, i, 0)
        energy = 0.0
        for element in elements_of(law_parameters, i):
            energy += strain_energy_of_law(law_parameters, law_state, element)
        return energy
    return strain_energy_of_law(law_parameters, law_state, i)


@inline
def hysteretic_energy(law_parameters, law_state, i):
    """Return the energy that the law of story `i` dissipated until the committed state.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.

    Returns
    -------
    float
        Dissipated energy, J.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        return _energy_of_elements(law_parameters, law_state, i)
    return hysteretic_energy_of_law(law_parameters, law_state, i)


@outlined
def _energy_of_elements(law_parameters, law_state, i):
    """Return the energy that the elements of story `i` dissipated until the committed state, J.

    ENERGY_SPENT of each element receives its part, without the energy up to the initial drift.
    """
    synchronize(law_parameters, law_state, i, 0)
    energy = 0.0
    for element in elements_of(law_parameters, i):
        spent = hysteretic_energy_of_law(law_parameters, law_state, element)
        law_state[rows.ENERGY_SPENT, element] = spent - law_state[rows.INITIAL_SPENT, element]
        energy += spent
    return energy


@inline
def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
    """Store the energy that story `i` has dissipated until state `trial`.

    The law computes DISSIPATED(trial) = DISSIPATED(previous) + dissipated energy of the path (J).
    The previous value of DISSIPATED(trial) is overwritten.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.
    previous : int
        Block of the state at the start of the path. Its dissipated energy is not changed.
    trial : int
        Block of the state at the end of the path, with the result (J) in row DISSIPATED.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        # Elements that follow their branches accumulate their energies along the path.
        if law_parameters[rows.CODE, i] < rows.ELEMENTS:
            for element in elements_of(law_parameters, i):
                accumulate_dissipation_of_law(law_parameters, law_state, element, previous, trial)
    else:
        accumulate_dissipation_of_law(law_parameters, law_state, i, previous, trial)


@inline
def restoring_force(law_parameters, law_state, i, previous, trial, drift):
    """Compute the restoring force of story `i` at a drift and store the trial state.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.
    previous : int
        First row of the state at the start of the path, which is not changed.
    trial : int
        First row of the block that receives the state at the end of the path.
    drift : float
        Drift at the end of the path, m.

    Returns
    -------
    float
        Tangent stiffness at the end of the path, N/m.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        return _force_of_sum(law_parameters, law_state, i, previous, trial, drift)
    law_state[trial + rows.DRIFT, i] = drift
    return force_of_law(law_parameters, law_state, i, previous, trial, drift)


@inline
def _force_of_sum(law_parameters, law_state, i, previous, trial, drift):
    """Compute the force of story `i` with several elements; return the tangent, N/m.

    If all elements are piecewise linear and the path remains on the linear branch of the story, the
    elements are not evaluated (as a law in `branch_first`).
    """
    law_state[trial + rows.DRIFT, i] = drift
    if law_parameters[rows.CODE, i] < rows.ELEMENTS:
        return _force_of_elements(law_parameters, law_state, i, previous, trial, drift, False)
    branch_block = branch_owner(law_state, i, previous)  # block that contains the branch
    drift_change = drift - law_state[previous + rows.DRIFT, i]
    is_within = (drift <= law_state[branch_block + rows.UPPER, i]) & (
        drift >= law_state[branch_block + rows.LOWER, i]
    )
    if is_within & (law_state[branch_block + rows.RATE_SIGN, i] * drift_change >= 0.0):
        slope = law_state[branch_block + rows.SLOPE, i]
        law_state[trial + rows.FORCE, i] = (
            law_state[previous + rows.FORCE, i] + slope * drift_change
        )
        law_state[trial + rows.BRANCH_OFFSET, i] = float(branch_block - trial)
        return slope
    return _follow_elements(law_parameters, law_state, i, previous, trial, drift)


@outlined
def _follow_elements(law_parameters, law_state, i, previous, trial, drift):
    """Move the piecewise-linear elements of story `i` along their branches; return the tangent."""
    copy_branches_of_elements(law_parameters, law_state, i, previous)
    synchronize(law_parameters, law_state, i, previous)
    for element in elements_of(law_parameters, i):
        _follow_branches(law_parameters, law_state, element, previous, trial, drift)
    sum_branches(law_parameters, law_state, i, trial)
    return law_state[trial + rows.SLOPE, i]


@outlined
def copy_branches_of_elements(law_parameters, law_state, i, block):
    """Copy the branch of story `i` and the states of its elements to a block that refers to the
    branch in another block, so that the other block can be overwritten.
    """
    owner = branch_owner(law_state, i, block)
    if owner != block:
        for element in elements_of(law_parameters, i):
            copy_state(law_state, element, owner, block)
        law_state[block + rows.INTERNAL, i] = law_state[owner + rows.INTERNAL, i]
        for row in range(rows.SLOPE, rows.RATE_SIGN + 1):
            law_state[block + row, i] = law_state[owner + row, i]
        law_state[block + rows.BRANCH_OFFSET, i] = 0.0


@outlined
def _force_of_elements(law_parameters, law_state, i, previous, trial, drift, on_branches):
    """Compute the force of story `i` as the sum over its elements; return the tangent, N/m.

    With `on_branches`, an element on a linear branch stays there.
    """
    force = 0.0
    tangent = 0.0
    for element in elements_of(law_parameters, i):
        law_state[trial + rows.DRIFT, element] = drift
        slope = law_state[rows.SLOPE, element]
        if on_branches and slope < math.inf:
            law_state[trial + rows.FORCE, element] = law_state[rows.FORCE, element] + slope * (
                drift - law_state[rows.DRIFT, element]
            )
        else:
            slope = force_of_law(law_parameters, law_state, element, previous, trial, drift)
        tangent += slope
        force += law_state[trial + rows.FORCE, element]
    law_state[trial + rows.DRIFT, i] = drift
    law_state[trial + rows.FORCE, i] = force
    law_state[trial + rows.BRANCH_OFFSET, i] = 0.0
    return tangent


@outlined
def restoring_force_on_branches(law_parameters, law_state, i, previous, trial, drift):
    """Compute the force of story `i` without changes of linear branches; return the tangent, N/m.

    An element that is on a linear branch in the committed state remains on this branch, even if the
    drift is outside its limits. A step that locates changes of branch iterates with this force,
    because an element must not change its branch before the change is located. Other laws follow
    their path as in `restoring_force`.
    """
    if not (FULL and law_parameters[rows.CODE, i] < rows.ELEMENTS):
        return restoring_force(law_parameters, law_state, i, previous, trial, drift)
    return _force_of_elements(law_parameters, law_state, i, previous, trial, drift, True)


@outlined
def restoring_force_outlined(law_parameters, law_state, i, previous, trial, drift):
    """Compute the restoring force of story `i` at a drift and store the trial state.

    The function calls `restoring_force`. It is compiled as a separate function, for callers with
    several calls.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.
    previous : int
        First row of the block of `law_state` with the state at the start of the path.
    trial : int
        First row of the block of `law_state` with the state at the end of the path.
    drift : float
        Drift, m.

    Returns
    -------
    float
        Tangent stiffness, N/m.
    """
    return restoring_force(law_parameters, law_state, i, previous, trial, drift)


@outlined
def tangent_in_motion(law_parameters, law_state, i, rate):
    """Return the tangent stiffness of story `i` in the direction of its drift rate, N/m.

    The direction can be opposite to that of the path to the present drift. A curved branch has no
    slope in its state: the law is evaluated at a slightly different drift (in FIRST_TRIAL).
    """
    drift = law_state[rows.DRIFT, i]
    drift += math.copysign(_DRIFT_OF_TANGENT * drift, rate)
    return restoring_force(law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift)


@inline
def commit(law_parameters, law_state, i, previous, trial):
    """Make a trial state of story `i` the committed state.

    First, the dissipated energy of the trial state is stored: the energy of block `previous` plus
    the energy dissipated on the path between both states. Then the common rows and the further rows
    of the law (`keep_rows`) are copied to the committed block, which starts at row 0.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.
    previous : int
        First row of the block with the state at the start of the path; usually 0.
    trial : int
        First row of the block with the trial state.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        # If the path has remained on the committed branch, the elements are not moved.
        if law_state[trial + rows.BRANCH_OFFSET, i] != float(rows.COMMITTED - trial):
            _commit_elements(law_parameters, law_state, i, previous, trial)
        law_state[rows.DRIFT, i] = law_state[trial + rows.DRIFT, i]
        law_state[rows.FORCE, i] = law_state[trial + rows.FORCE, i]
    else:
        commit_law(law_parameters, law_state, i, previous, trial)


@outlined
def _commit_elements(law_parameters, law_state, i, previous, trial):
    """Commit the elements of story `i`, and the branch of the story if all are piecewise linear.

    INTERNAL is 1 if all elements have failed. The branch of a story with a curved element is not
    summed, because most methods do not use it (`sum_branches`).
    """
    follows_branches = law_parameters[rows.CODE, i] == rows.ELEMENTS
    if follows_branches:
        copy_branches_of_elements(law_parameters, law_state, i, trial)
    failed = 1.0
    for element in elements_of(law_parameters, i):
        if follows_branches:
            copy_state(law_state, element, trial, rows.COMMITTED)
        else:
            commit_law(law_parameters, law_state, element, previous, trial)
        if law_state[rows.INTERNAL, element] != law_state[rows.FAILED_INTERNAL, element]:
            failed = 0.0
    law_state[rows.INTERNAL, i] = failed
    if follows_branches:
        for row in range(rows.SLOPE, rows.RATE_SIGN + 1):
            law_state[row, i] = law_state[trial + row, i]


@inline
def commit_without_dissipation(law_parameters, law_state, i, trial):
    """Make a trial state of story `i` the committed state; its dissipated energy is already
    accumulated.

    The common rows and the further rows of the law (`keep_rows`) are copied from the trial block to
    the committed block, which starts at row 0.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.
    trial : int
        First row of the block with the trial state.
    """
    # `keep_rows` copies from block `trial` to the committed block. Its argument 0 (`previous`) is
    # the committed state, the start of the path. Some laws need its drift. Therefore, `keep_rows`
    # is called before the loop, which replaces this drift.
    keep_rows(law_parameters, law_state, i, 0, trial)
    for row in range(rows.COMMON_ROWS):
        law_state[row, i] = law_state[trial + row, i]


@inline
def store_step_start(flags, law_state):
    """Copy the committed states of all stories to block STEP_START, if flags[KEEPS_START] is 1.

    The observer evaluates a law at a reversal within a step. A curved hysteretic law unloads and
    reloads on different curves, so that its force at the reversal follows only from the state at
    the start of the step.
    """
    if flags[rows.KEEPS_START] != 0.0:
        copy_step_start(law_state)


@outlined
def copy_step_start(law_state):
    """Copy the committed states of all stories to block STEP_START.

    Compiled into the time loop, this function would increase the time of all runs by 5 %.
    """
    copy_rows_within(law_state, rows.COMMITTED, rows.STEP_START, rows.LAW_STATE_ROWS)
    if law_state.shape[0] > rows.EXTRA_ROWS:
        first, start = extra_rows(law_state, rows.COMMITTED), extra_rows(law_state, rows.STEP_START)
        count = (law_state.shape[0] - rows.EXTRA_ROWS) // rows.LAW_STATE_BLOCKS
        copy_rows_within(law_state, first, start, count)


@inline
def step_start(flags, follows_reversal=False):
    """Return the first row of the block from which a law moves to a reversal within the last step.

    It is STEP_START, if the state at the start of the step is kept, by flags[KEEPS_START] or
    because the law has followed a reversal within the step (`follows_reversal`). Otherwise it is
    the committed state at the end of the step: a piecewise-linear law reloads on the branch on
    which it unloads, so that the path back to the reversal ends at the force of the reversal. If
    the law has unloaded within the step, this is only valid for the drift of the reversal of the
    law.
    """
    if follows_reversal or flags[rows.KEEPS_START] != 0.0:
        return rows.STEP_START
    return rows.COMMITTED


@inline
def columns_of_story(law_parameters, i):
    """Return the columns of the laws of story `i`, one for each element."""
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        return elements_of(law_parameters, i)
    return range(i, i + 1)


@outlined
def drift_of_fracture(law_parameters, law_state, column):
    """Return the drift at which the law in a column has fractured in the last step, m; 0 if it has
    not. Block STEP_START must contain the state at the start of the step.

    A law that can also fail otherwise has not reached the drift of its fracture if it does so.
    """
    failed = law_state[rows.FAILED_INTERNAL, column]
    start, drift = law_state[rows.STEP_START + rows.INTERNAL, column], law_state[rows.DRIFT, column]
    if law_parameters[rows.CODE, column] % 1.0 != FRACTURING or start == failed:
        return 0.0
    row = rows.FRACTURE_HIGH if drift > 0.0 else rows.FRACTURE_LOW
    limit = law_parameters[row, column]
    is_at_limit = law_state[rows.INTERNAL, column] == failed and abs(drift) >= abs(limit)
    return limit if is_at_limit else 0.0


@outlined
def has_fractured(law_parameters, law_state):
    """Return True if a law has fractured in the last step; flags[CAN_FRACTURE] must be 1."""
    for column in range(law_parameters.shape[1]):
        if drift_of_fracture(law_parameters, law_state, column) != 0.0:
            return True
    return False


@outlined
def is_new_fracture(law_parameters, law_state, i, column):
    """Return True if the law in a column of story `i` has fractured and its fracture is not stored
    yet."""
    drift = law_state[rows.DRIFT, i]
    row = rows.FRACTURE_HIGH if drift > 0.0 else rows.FRACTURE_LOW
    return (
        law_parameters[rows.CODE, column] % 1.0 == FRACTURING
        and law_state[rows.INTERNAL, column] == law_state[rows.FAILED_INTERNAL, column]
        and law_state[rows.FRACTURE_DRIFT, column] == 0.0
        and abs(drift) >= (1.0 - 2.0 * AT_LIMIT) * abs(law_parameters[row, column])
    )


@inline
def resume(law_parameters, law_state, i):
    """Determine the branch of story `i` from its state at the end of the last step.

    A step that does not follow branches (for example because its division at branch changes has
    failed) commits drift and force, but not the rows of the branch: stiffness, limits and
    direction. The step must therefore call this function at its end, before another step follows
    the branches. For laws that store their branch in every state, the branch is already correct and
    is not changed.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        # Piecewise-linear elements without curved elements store their branches.
        if law_parameters[rows.CODE, i] < rows.ELEMENTS:
            for element in elements_of(law_parameters, i):
                if not stores_branch(law_parameters, element):
                    enter(law_parameters, law_state, element)
            sum_branches(law_parameters, law_state, i, 0)
    elif not stores_branch(law_parameters, i):
        enter(law_parameters, law_state, i)


@inline
def start(law_parameters, law_state, i, drift):
    """Move story `i` from zero drift to its initial drift at the start of a run and commit the
    state.

    The branch of the unloaded state is set first, and the branch at the initial drift last.
    """
    enter(law_parameters, law_state, i)
    restoring_force(law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift)
    commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
    resume(law_parameters, law_state, i)
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        synchronize(law_parameters, law_state, i, 0)
        for element in elements_of(law_parameters, i):
            law_state[rows.INITIAL_SPENT, element] = hysteretic_energy_of_law(
                law_parameters, law_state, element
            )
            law_state[rows.PEAK_FORCE, element] = abs(law_state[rows.FORCE, element])


@outlined
def raise_element_peaks(law_parameters, law_state, i, block, excess):
    """Raise the peak forces of the elements of story `i` by their forces in a block.

    `excess` is 0, or the distance (m) from the limit of a branch to a committed drift outside the
    branch. The forces are then evaluated at the limit, on the present branches.
    """
    owner = branch_owner(law_state, i, block)
    drift = law_state[block + rows.DRIFT, i] - excess
    for element in elements_of(law_parameters, i):
        force = law_state[owner + rows.FORCE, element]
        step = drift - law_state[owner + rows.DRIFT, element]
        if step != 0.0 and law_state[owner + rows.SLOPE, element] < math.inf:
            force += law_state[owner + rows.SLOPE, element] * step
        law_state[rows.PEAK_FORCE, element] = max(law_state[rows.PEAK_FORCE, element], abs(force))


# ---- One story along a specified path of drifts, without mass and time: a cyclic test

# Columns of the result of `follow`: force (N), tangent stiffness (N/m), stored energy (J) and
# dissipated energy (J).
SHEAR = 0
TANGENT = 1
STRAIN_ENERGY = 2
HYSTERETIC_ENERGY = 3
RESULT_COLUMNS = 4


@kernel(I8(TABLE, I8, VECTOR, TABLE, TABLE))
def follow(law_parameters, i, drifts, law_state, result):
    """Compute forces and energies of story `i` along a path of drifts, for example a cyclic test.

    The story starts at zero drift and moves to the first drift of the path. Each drift is
    committed, as a time step commits the drift at its end. Columns of the result: SHEAR (force, N),
    TANGENT (N/m), STRAIN_ENERGY and HYSTERETIC_ENERGY (stored and dissipated, J).

    Returns
    -------
    int
        Always 0, because a path of drifts cannot fail.
    """
    start(law_parameters, law_state, i, 0.0)
    for row in range(drifts.size):
        result[row, TANGENT] = restoring_force(
            law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, drifts[row]
        )
        commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        result[row, SHEAR] = law_state[rows.FORCE, i]
        result[row, STRAIN_ENERGY] = strain_energy(law_parameters, law_state, i)
        result[row, HYSTERETIC_ENERGY] = hysteretic_energy(law_parameters, law_state, i)
    return 0
