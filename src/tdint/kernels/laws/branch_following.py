"""Force functions of piecewise-linear drift laws, which follow the linear branches of the law.

A block of `law_state` with a trial state on the same branch as an earlier state does not contain
the rows of the branch. Its row BRANCH_OFFSET contains the (signed) number of rows to the block that
contains them; 0 if the state contains its branch. The committed state always contains its branch. A
law with linear branches only defines how branches follow each other (`switch`), its first branch
(`enter`) and its strain energy. `follow_branches` builds the other functions from these.
`branch_first` accelerates the functions for paths that remain on one branch.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.laws.law import LawFunctions

MAX_BRANCHES = 1000
"""Maximum number of changes of branch of a law on a monotonic path. No law of tdint reaches it: a
path along a complete backbone curve passes the points of both sides (`law.MAX_POINTS`). It ends the
endless loop of a plug-in law whose branches do not advance, with the force nan."""

REST = 1e-3
"""Fraction of the yield drift. A law that remembers its reversals counts none of them until the
drift first exceeds this fraction. The drift of an upper story of a building at rest begins with a
high power of the time, and the error of the first steps can have the other sign (measured: up to
5e-6 at the end of steps of 0.02 s, 5e-4 inside them). Forces of this size are negligible in any
response; OpenSees uses 1e-4 for `Pinching4`."""


@inline
def no_operation(law_parameters, law_state, i, block, step, mean_force):
    """Do nothing: function `advance` of a law with a state that consists of drift and force only.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws.
    i : int
        Index of the story.
    block : int
        First row of the state in `law_state`.
    step : float
        Change of drift, m.
    mean_force : float
        Mean force on the path, N.
    """


def add_work(law_parameters, law_state, i, block, step, mean_force):
    """Add the work of a path, mean force times change of drift, to row WORK of a law state, J.

    This is the default function `advance` of a law.

    Parameters
    ----------
    law_parameters : ndarray
        Not used.
    law_state : ndarray
        Row WORK of the block is increased.
    i : int
        Index of the story.
    block : int
        First row of the state in `law_state`.
    step : float
        Change of drift on the path, m.
    mean_force : float
        Mean force on the path, N.
    """
    law_state[block + rows.WORK, i] += mean_force * step


@inline
def extra_rows(law_state, block):
    """Return the first of the extra rows of the table `law_state` that belong to the state in
    `block`.

    A law with more variables than a block has rows uses extra rows. They follow all blocks, in the
    order of the blocks, with equal numbers of rows.

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws.
    block : int
        First row of the state in `law_state`.
    """
    # block // LAW_STATE_ROWS is the index of the state (0 for the committed state). The remaining
    # rows of the table are divided equally between all states.
    return rows.EXTRA_ROWS + block // rows.LAW_STATE_ROWS * (
        (law_state.shape[0] - rows.EXTRA_ROWS) // rows.LAW_STATE_BLOCKS
    )


@inline
def copy_extra_rows(law_state, i, previous, trial):
    """Copy the extra rows of story `i` from block `previous` to block `trial`.

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws.
    i : int
        Index of the story.
    previous : int
        First row of the source block.
    trial : int
        First row of the target block.
    """
    # The rows of the table from row EXTRA_ROWS on are divided equally between the states.
    for row in range((law_state.shape[0] - rows.EXTRA_ROWS) // rows.LAW_STATE_BLOCKS):
        law_state[extra_rows(law_state, trial) + row, i] = law_state[
            extra_rows(law_state, previous) + row, i
        ]


@inline
def is_at_rest(law_state, i, block, yield_drift):
    """Return True if the drift of a state is so small that a first reversal does not count.

    A law calls this function at a reversal if its state contains no earlier one.
    """
    return abs(law_state[block + rows.DRIFT, i]) <= REST * yield_drift


@inline
def copy_state(law_state, i, source, target):
    """Copy the law state of story `i` from block `source` to block `target`, with the extra rows of
    the law."""
    for row in range(rows.LAW_STATE_ROWS):
        law_state[target + row, i] = law_state[source + row, i]
    copy_extra_rows(law_state, i, source, target)


@inline
def set_branch(law_state, i, block, slope, lower, upper, turn):
    """Set the current branch of a law state: stiffness, limits and direction.

    The function `switch` of a law calls this function. It must also set FORCE and INTERNAL if their
    values change.

    Parameters
    ----------
    law_state : ndarray
        Rows SLOPE, LOWER, UPPER and RATE_SIGN of the block are set.
    i : int
        Index of the story.
    block : int
        First row of the state in `law_state`.
    slope : float
        Tangent stiffness of the branch, N/m; infinite for a curved branch.
    lower, upper : float
        Drifts between which the branch is valid, m; infinite if the branch has no limit.
    turn : float
        Value of RATE_SIGN, the sign of the drift rate for which the branch is valid. The branch
        ends at a reversal of the drift. 0 if the branch is valid for both signs and does not end at
        a reversal.
    """
    law_state[block + rows.SLOPE, i] = slope
    law_state[block + rows.LOWER, i] = lower
    law_state[block + rows.UPPER, i] = upper
    law_state[block + rows.RATE_SIGN, i] = turn


@inline
def side_row(side, row):
    """Return the row of a quantity with one row per side; `row` is the row of the positive side,
    two rows before that of the negative side."""
    return row if side > 0.0 else row + 2


@inline
def set_directed(law_state, i, block, side, branch_type, slope, end):
    """Set a branch that is valid for one direction of movement, up to the drift `end` of its side
    (m). Row INTERNAL receives the type with the sign of the side."""
    law_state[block + rows.INTERNAL, i] = side * branch_type
    upper = end if side > 0.0 else math.inf
    lower = -end if side < 0.0 else -math.inf
    set_branch(law_state, i, block, slope, lower, upper, side)


@inline
def fail(law_state, i, block, failed):
    """Remove the strength and stiffness of story `i` permanently.

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws.
    i : int
        Index of the story.
    block : int
        First row of the state in `law_state`.
    failed : float
        Value of INTERNAL after the failure. FORCE is then 0, on a branch with zero slope and
        without limits.
    """
    law_state[block + rows.INTERNAL, i] = failed
    law_state[block + rows.FORCE, i] = 0.0
    set_branch(law_state, i, block, 0.0, -math.inf, math.inf, 0.0)


@inline
def branch_owner(law_state, i, block):
    """Return the first row of the block of `law_state` that contains the branch of the state in
    `block`.
    """
    return (
        block if block == rows.COMMITTED else block + int(law_state[block + rows.BRANCH_OFFSET, i])
    )


@outlined
def copy_branch(law_state, i, block):
    """Copy the branch of another state into the state in `block`, if the state refers to that
    branch.

    The state must contain its branch before it can change the branch.
    """
    if law_state[block + rows.BRANCH_OFFSET, i] != 0.0:
        branch_block = branch_owner(law_state, i, block)
        law_state[block + rows.INTERNAL, i] = law_state[branch_block + rows.INTERNAL, i]
        for row in range(rows.COMMON_ROWS, rows.WORK):
            law_state[block + row, i] = law_state[branch_block + row, i]
        copy_extra_rows(law_state, i, branch_block, block)
        law_state[block + rows.BRANCH_OFFSET, i] = 0.0


@inline
def remains_on_branch(law_state, i, branch_block, previous, drift):
    """Return True if the path from the state in block `previous` to a drift (m) remains on its
    linear branch, which is in `branch_block`."""
    is_within = (drift <= law_state[branch_block + rows.UPPER, i]) & (
        drift >= law_state[branch_block + rows.LOWER, i]
    )
    drift_change = drift - law_state[previous + rows.DRIFT, i]
    return (
        is_within
        & (law_state[branch_block + rows.RATE_SIGN, i] * drift_change >= 0.0)
        & (law_state[branch_block + rows.SLOPE, i] < math.inf)
    )


@inline
def move_on_branch(law_state, i, branch_block, previous, trial, drift):
    """Write the state at a drift (m) on the branch in `branch_block` to block `trial`; return the
    slope of the branch, N/m."""
    slope = law_state[branch_block + rows.SLOPE, i]
    drift_change = drift - law_state[previous + rows.DRIFT, i]
    force_0 = law_state[previous + rows.FORCE, i]
    force_1 = force_0 + slope * drift_change
    law_state[trial + rows.FORCE, i] = force_1
    law_state[trial + rows.WORK, i] = (
        law_state[previous + rows.WORK, i] + 0.5 * (force_0 + force_1) * drift_change
    )
    law_state[trial + rows.BRANCH_OFFSET, i] = float(branch_block - trial)
    return slope


def branch_first(functions: LawFunctions) -> LawFunctions:
    """Return the functions of a law with a fast evaluation of paths that remain on one branch.

    Most paths start and end on the same linear branch. Then only drift, force and work change: the
    caller writes DRIFT to block `trial`, and the new force function writes FORCE, WORK and
    BRANCH_OFFSET. Without this function, each evaluation of the force and each commit copies all
    rows. Forces, tangents and work are bitwise equal.

    A state that refers to the branch in another block is valid only until the other block is
    overwritten. Example: the path to SECOND_TRIAL starts at the state in FIRST_TRIAL. If
    FIRST_TRIAL is computed again, SECOND_TRIAL must be computed again after it.

    Parameters
    ----------
    functions : LawFunctions
        Functions of a law with a `keep` and without an `accumulate_dissipation`. Every block that
        `force` writes contains SLOPE, UPPER, LOWER, RATE_SIGN and WORK.

    Returns
    -------
    LawFunctions
        The functions of the law with a new `force` and a new `keep`.
    """
    follow, keep = functions.force, functions.keep

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force at a drift; return the tangent stiffness, N/m.

        If the path leaves its linear branch, `follow`, the force function of the law, changes the
        branch on the way and writes all rows.
        """
        branch_block = branch_owner(law_state, i, previous)
        if remains_on_branch(law_state, i, branch_block, previous, drift):
            return move_on_branch(law_state, i, branch_block, previous, trial, drift)
        # `follow` requires that the block `previous` contains the branch.
        if previous != rows.COMMITTED:
            copy_branch(law_state, i, previous)
        law_state[trial + rows.BRANCH_OFFSET, i] = 0.0
        return follow(law_parameters, law_state, i, previous, trial, drift)

    @inline
    def commit_changed_rows(law_parameters, law_state, i, previous, trial):
        """Copy the law-specific rows of a trial state to the committed state: only WORK if the
        trial state is still on the committed branch.

        `commit`, the caller, then copies the common rows.
        """
        if law_state[trial + rows.BRANCH_OFFSET, i] == float(rows.COMMITTED - trial):
            # The fast evaluation has not written INTERNAL of block `trial`. The committed value is
            # stored in this row, because `commit` copies all common rows back.
            law_state[trial + rows.INTERNAL, i] = law_state[rows.INTERNAL, i]
            law_state[rows.WORK, i] = law_state[trial + rows.WORK, i]
        else:
            copy_branch(law_state, i, trial)
            keep(law_parameters, law_state, i, previous, trial)

    return replace(functions, force=force, keep=commit_changed_rows, branch_first=True)


def advancing(move: Any) -> Any:
    """Return a compiled function (law_parameters, law_state, i, block, drift) that moves a law
    state to a drift on its current linear branch.

    `move` (law_parameters, law_state, i, block, step, mean_force) updates the other rows, for
    example the work, from the change of drift `step` (m) and the mean force (N) on the path.
    """

    @inline
    def advance(law_parameters, law_state, i, block, drift):
        """Move a law state to a drift on its current linear branch."""
        step = drift - law_state[block + rows.DRIFT, i]
        force = law_state[block + rows.FORCE, i]
        new_force = force + law_state[block + rows.SLOPE, i] * step
        law_state[block + rows.DRIFT, i] = drift
        law_state[block + rows.FORCE, i] = new_force
        move(law_parameters, law_state, i, block, step, 0.5 * (force + new_force))

    return advance


def branch_follower(switch: Any, move: Any = None) -> Any:
    """Return the force function of a piecewise-linear law, which follows the branches of the law.

    Parameters
    ----------
    switch : function
        (law_parameters, law_state, i, block, event). Sets the branch that follows when the current
        branch of the state in `block` ends by `event` (ABOVE, BELOW or REVERSED).
    move : function, optional
        Function `advance` of the law (`LawFunctions`). Default: `add_work`.

    Returns
    -------
    function
        (law_parameters, law_state, i, previous, trial, drift). Copies the state from block
        `previous` to block `trial`, changes the branch at a reversal and at each limit on the path,
        and returns the slope of the last branch, N/m.
    """
    advance = advancing(move or inline(add_work))

    @outlined
    def follow(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force at a drift along the branches of the law; return the stiffness of the
        last branch, N/m.

        If the path has more than `MAX_BRANCHES` changes of branch, force and tangent are nan, so
        that the step fails.
        """
        copy_state(law_state, i, previous, trial)
        # A path against the direction of the branch starts with a reversal.
        if law_state[trial + rows.RATE_SIGN, i] * (drift - law_state[trial + rows.DRIFT, i]) < 0.0:
            switch(law_parameters, law_state, i, trial, rows.REVERSED)
        for _ in range(MAX_BRANCHES + 1):
            if drift > law_state[trial + rows.UPPER, i]:
                advance(law_parameters, law_state, i, trial, law_state[trial + rows.UPPER, i])
                switch(law_parameters, law_state, i, trial, rows.ABOVE)
            elif drift < law_state[trial + rows.LOWER, i]:
                advance(law_parameters, law_state, i, trial, law_state[trial + rows.LOWER, i])
                switch(law_parameters, law_state, i, trial, rows.BELOW)
            else:
                advance(law_parameters, law_state, i, trial, drift)
                return law_state[trial + rows.SLOPE, i]
        law_state[trial + rows.DRIFT, i] = drift
        law_state[trial + rows.FORCE, i] = math.nan
        return math.nan

    return follow


def follow_branches(switch: Any, strain_energy: Any, enter: Any) -> LawFunctions:
    """Return the functions of a piecewise-linear law that stores its branch in its state.

    The dissipated energy is the work done on the story (row WORK) minus the strain energy. It is
    computed only when it is requested (`hysteretic_energy`). Row DISSIPATED is not used by these
    laws and remains 0.

    Parameters
    ----------
    switch : function
        (law_parameters, law_state, i, block, event). Sets the branch that follows when the current
        branch ends by `event` (ABOVE, BELOW or REVERSED). `block` is the first row of the block of
        `law_state` with the state that changes its branch.
    strain_energy : function
        (law_parameters, law_state, i) -> energy stored in the committed state, J.
    enter : function
        (law_parameters, law_state, i). Sets the first branch of the committed state.

    Returns
    -------
    LawFunctions
        The functions `force` (from `branch_follower`), `hysteretic_energy` and `keep`, which are
        built here, and the three arguments.
    """

    @inline
    def hysteretic_energy(law_parameters, law_state, i):
        """Return the dissipated energy of the committed state, J: the work done on the story minus
        the strain energy.

        Column `i` of the tables `law_parameters` and `law_state` contains parameters and states of
        story `i`.
        """
        return law_state[rows.WORK, i] - strain_energy(law_parameters, law_state, i)

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        """Copy the branch and the other law-specific rows of a trial state to the committed state,
        with the extra rows. `commit`, the caller, copies the common rows.
        """
        for row in range(rows.COMMON_ROWS, rows.LAW_STATE_ROWS):
            law_state[row, i] = law_state[trial + row, i]
        copy_extra_rows(law_state, i, trial, 0)

    return branch_first(
        LawFunctions(
            force=branch_follower(switch),
            strain_energy=strain_energy,
            hysteretic_energy=hysteretic_energy,
            keep=keep,
            enter=enter,
            switch=switch,
        )
    )
