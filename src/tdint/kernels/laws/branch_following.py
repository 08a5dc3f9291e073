"""Straight ways over the branches of a law."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined, specialized
from tdint.kernels.laws.law import LawFunctions

_MOST = 16
"""Branches that a straight way may go over; no law has as many."""


@inline
def no_operation(law_parameters, law_state, i, block, step, mean_force):
    """An `advance` of a law of which drift and force alone change on the way."""


def add_work(law_parameters, law_state, i, block, step, mean_force):
    """An `advance` of a law of which drift, force and the work done change on the way."""
    law_state[block + rows.WORK, i] += mean_force * step


@inline
def extra_rows(law_state, block):
    """First of the further rows that belong to a block."""
    return rows.EXTRA_ROWS + block // rows.LAW_STATE_ROWS * (
        (law_state.shape[0] - rows.EXTRA_ROWS) // rows.LAW_STATE_BLOCKS
    )


@inline
def copy_extra_rows(law_state, i, previous, trial):
    """Copy the further rows of story `i` between two blocks, where there are any."""
    for row in range((law_state.shape[0] - rows.EXTRA_ROWS) // rows.LAW_STATE_BLOCKS):
        law_state[extra_rows(law_state, trial) + row, i] = law_state[
            extra_rows(law_state, previous) + row, i
        ]


@inline
def set_branch(law_state, i, block, slope, lower, upper, turn):
    """Put the state in `block` on a branch: all that a `switch` sets, but for FORCE and INTERNAL
    where these change.

    It has the stiffness `slope` (infinite: curved) between the drifts `lower` and `upper`
    (infinite: without end), and ends where the drift turns against the sign of `turn` (0: it does
    not).
    """
    law_state[block + rows.SLOPE, i] = slope
    law_state[block + rows.LOWER, i] = lower
    law_state[block + rows.UPPER, i] = upper
    law_state[block + rows.RATE_SIGN, i] = turn


@inline
def fail(law_state, i, block, failed):
    """Let story `i` carry nothing any more; INTERNAL is `failed` from then on."""
    law_state[block + rows.INTERNAL, i] = failed
    law_state[block + rows.FORCE, i] = 0.0
    set_branch(law_state, i, block, 0.0, -math.inf, math.inf, 0.0)


@inline
def lender(law_state, i, block):
    """The block that holds the branch of the state in `block`: itself, or the one that it borrows
    from."""
    return (
        block if block == rows.COMMITTED else block + int(law_state[block + rows.BRANCH_OFFSET, i])
    )


@outlined
def copy_borrowed(law_state, i, block):
    """Copy to `block` what its state borrows, so that it can leave the branch."""
    if law_state[block + rows.BRANCH_OFFSET, i] != 0.0:
        holder = lender(law_state, i, block)
        law_state[block + rows.INTERNAL, i] = law_state[holder + rows.INTERNAL, i]
        for row in range(rows.COMMON_ROWS, rows.WORK):
            law_state[block + row, i] = law_state[holder + row, i]
        copy_extra_rows(law_state, i, holder, block)
        law_state[block + rows.BRANCH_OFFSET, i] = 0.0


def branch_first(functions: LawFunctions) -> LawFunctions:
    """The functions of a law that knows its branch, with a look at that branch before a way is
    walked.

    Most ways end on the linear branch on which they begin. There drift, force and work change, and
    nothing else does: the trial state borrows the rest (`tdint.kernels.layout.BORROWED`), where a
    walk would copy every row of the story, and the commit would copy them back. Forces, tangents
    and work are those of the walk, bit by bit.

    A state that borrows is good as long as the block that it borrows from is not written: trial
    states that follow each other in a chain are found in that order, each time.

    Parameters
    ----------
    functions : LawFunctions
        With a `keep`, without a `accumulate_dissipation`; all blocks that `force` writes hold
        SLOPE, UPPER, LOWER,
        TURN and WORK.
    """
    walk, keep = functions.force, functions.keep

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        holder = lender(law_state, i, previous)
        slope = law_state[holder + rows.SLOPE, i]
        step = drift - law_state[previous + rows.DRIFT, i]
        within = (drift <= law_state[holder + rows.UPPER, i]) & (
            drift >= law_state[holder + rows.LOWER, i]
        )
        if within & (law_state[holder + rows.RATE_SIGN, i] * step >= 0.0) & (slope < math.inf):
            before = law_state[previous + rows.FORCE, i]
            after = before + slope * step
            law_state[trial + rows.FORCE, i] = after
            law_state[trial + rows.WORK, i] = (
                law_state[previous + rows.WORK, i] + 0.5 * (before + after) * step
            )
            law_state[trial + rows.BRANCH_OFFSET, i] = float(holder - trial)
            return slope
        if previous != rows.COMMITTED:
            copy_borrowed(law_state, i, previous)
        law_state[trial + rows.BRANCH_OFFSET, i] = 0.0
        return walk(law_parameters, law_state, i, previous, trial, drift)

    @inline
    def keep_what_changed(law_parameters, law_state, i, previous, trial):
        if law_state[trial + rows.BRANCH_OFFSET, i] == float(rows.COMMITTED - trial):
            # On the committed branch all the way: `commit` copies INTERNAL back with the plain
            # rows.
            law_state[trial + rows.INTERNAL, i] = law_state[rows.INTERNAL, i]
            law_state[rows.WORK, i] = law_state[trial + rows.WORK, i]
        else:
            copy_borrowed(law_state, i, trial)
            keep(law_parameters, law_state, i, previous, trial)

    return replace(functions, force=force, keep=keep_what_changed)


def advancing(move: Any) -> Any:
    """A function that goes to a drift on the present branch of the state in a block; `move` is
    `DriftLaw.advance`."""

    @inline
    def advance(law_parameters, law_state, i, block, drift):
        step = drift - law_state[block + rows.DRIFT, i]
        force = law_state[block + rows.FORCE, i]
        new = force + law_state[block + rows.SLOPE, i] * step
        law_state[block + rows.DRIFT, i] = drift
        law_state[block + rows.FORCE, i] = new
        move(law_parameters, law_state, i, block, step, 0.5 * (force + new))

    return advance


def branch_follower(switch: Any, move: Any = None) -> Any:
    """A `DriftLaw.force` that goes straight from the state in `previous` to `drift`, over as many
    branches as lie on the way."""
    advance = advancing(move or inline(add_work))

    @specialized
    def walk(law_parameters, law_state, i, previous, trial, drift):
        for row in range(rows.LAW_STATE_ROWS):
            law_state[trial + row, i] = law_state[previous + row, i]
        copy_extra_rows(law_state, i, previous, trial)
        if law_state[trial + rows.RATE_SIGN, i] * (drift - law_state[trial + rows.DRIFT, i]) < 0.0:
            switch(law_parameters, law_state, i, trial, rows.REVERSED)
        for _ in range(_MOST):
            if drift > law_state[trial + rows.UPPER, i]:
                advance(law_parameters, law_state, i, trial, law_state[trial + rows.UPPER, i])
                switch(law_parameters, law_state, i, trial, rows.ABOVE)
            elif drift < law_state[trial + rows.LOWER, i]:
                advance(law_parameters, law_state, i, trial, law_state[trial + rows.LOWER, i])
                switch(law_parameters, law_state, i, trial, rows.BELOW)
            else:
                break
        advance(law_parameters, law_state, i, trial, drift)
        return law_state[trial + rows.SLOPE, i]

    return walk


def follow_branches(switch: Any, strain_energy: Any, enter: Any) -> LawFunctions:
    """The functions of a law that is linear branch by branch and remembers its branch: it
    dissipates what was done on it and cannot be recovered."""

    @inline
    def hysteretic_energy(law_parameters, law_state, i):
        return law_state[rows.WORK, i] - strain_energy(law_parameters, law_state, i)

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        for row in range(rows.COMMON_ROWS, rows.LAW_STATE_ROWS):
            law_state[row, i] = law_state[trial + row, i]
        copy_extra_rows(law_state, i, trial, 0)

    return LawFunctions(
        force=branch_follower(switch),
        strain_energy=strain_energy,
        hysteretic_energy=hysteretic_energy,
        keep=keep,
        enter=enter,
        switch=switch,
    )
