"""Straight ways over the branches of a law."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined, specialized
from tdint.kernels.laws.law import LawFunctions

_MOST = 16
"""Branches that a straight way may go over; no law has as many."""


@inlined
def nothing(law_parameters, springs, i, block, step, mean_force):
    """An `advance` of a law of which drift and force alone change on the way."""


def add_work(law_parameters, springs, i, block, step, mean_force):
    """An `advance` of a law of which drift, force and the work done change on the way."""
    springs[block + at.WORK, i] += mean_force * step


@inlined
def extra_rows(springs, block):
    """First of the further rows that belong to a block."""
    return at.EXTRA_ROWS + block // at.SPRING_ROWS * (
        (springs.shape[0] - at.EXTRA_ROWS) // at.SPRING_BLOCKS
    )


@inlined
def copy_extra_rows(springs, i, past, trial):
    """Copy the further rows of story `i` between two blocks, where there are any."""
    for row in range((springs.shape[0] - at.EXTRA_ROWS) // at.SPRING_BLOCKS):
        springs[extra_rows(springs, trial) + row, i] = springs[extra_rows(springs, past) + row, i]


@inlined
def put_on_branch(springs, i, block, slope, lower, upper, turn):
    """Put the state in `block` on a branch: all that a `switch` sets, but for FORCE and INTERNAL
    where these change.

    It has the stiffness `slope` (infinite: curved) between the drifts `lower` and `upper`
    (infinite: without end), and ends where the drift turns against the sign of `turn` (0: it does
    not).
    """
    springs[block + at.SLOPE, i] = slope
    springs[block + at.LOWER, i] = lower
    springs[block + at.UPPER, i] = upper
    springs[block + at.TURN, i] = turn


@inlined
def fail(springs, i, block, failed):
    """Let story `i` carry nothing any more; INTERNAL is `failed` from then on."""
    springs[block + at.INTERNAL, i] = failed
    springs[block + at.FORCE, i] = 0.0
    put_on_branch(springs, i, block, 0.0, -math.inf, math.inf, 0.0)


@inlined
def lender(springs, i, block):
    """The block that holds the branch of the state in `block`: itself, or the one that it borrows
    from."""
    return block if block == at.COMMITTED else block + int(springs[block + at.BORROWED, i])


@called
def copy_borrowed(springs, i, block):
    """Copy to `block` what its state borrows, so that it can leave the branch."""
    if springs[block + at.BORROWED, i] != 0.0:
        holder = lender(springs, i, block)
        springs[block + at.INTERNAL, i] = springs[holder + at.INTERNAL, i]
        for row in range(at.PLAIN_ROWS, at.WORK):
            springs[block + row, i] = springs[holder + row, i]
        copy_extra_rows(springs, i, holder, block)
        springs[block + at.BORROWED, i] = 0.0


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
        With a `keep`, without a `settle`; all blocks that `force` writes hold SLOPE, UPPER, LOWER,
        TURN and WORK.
    """
    walk, keep = functions.force, functions.keep

    @inlined
    def force(law_parameters, springs, i, past, trial, drift):
        holder = lender(springs, i, past)
        slope = springs[holder + at.SLOPE, i]
        step = drift - springs[past + at.DRIFT, i]
        within = (drift <= springs[holder + at.UPPER, i]) & (drift >= springs[holder + at.LOWER, i])
        if within & (springs[holder + at.TURN, i] * step >= 0.0) & (slope < math.inf):
            before = springs[past + at.FORCE, i]
            after = before + slope * step
            springs[trial + at.FORCE, i] = after
            springs[trial + at.WORK, i] = springs[past + at.WORK, i] + 0.5 * (before + after) * step
            springs[trial + at.BORROWED, i] = float(holder - trial)
            return slope
        if past != at.COMMITTED:
            copy_borrowed(springs, i, past)
        springs[trial + at.BORROWED, i] = 0.0
        return walk(law_parameters, springs, i, past, trial, drift)

    @inlined
    def keep_what_changed(law_parameters, springs, i, past, trial):
        if springs[trial + at.BORROWED, i] == float(at.COMMITTED - trial):
            # On the committed branch all the way: `commit` copies INTERNAL back with the plain
            # rows.
            springs[trial + at.INTERNAL, i] = springs[at.INTERNAL, i]
            springs[at.WORK, i] = springs[trial + at.WORK, i]
        else:
            copy_borrowed(springs, i, trial)
            keep(law_parameters, springs, i, past, trial)

    return replace(functions, force=force, keep=keep_what_changed)


def advancing(move: Any) -> Any:
    """A function that goes to a drift on the present branch of the state in a block; `move` is
    `DriftLaw.advance`."""

    @inlined
    def advance(law_parameters, springs, i, block, drift):
        step = drift - springs[block + at.DRIFT, i]
        force = springs[block + at.FORCE, i]
        new = force + springs[block + at.SLOPE, i] * step
        springs[block + at.DRIFT, i] = drift
        springs[block + at.FORCE, i] = new
        move(law_parameters, springs, i, block, step, 0.5 * (force + new))

    return advance


def walker(switch: Any, move: Any = None) -> Any:
    """A `DriftLaw.force` that goes straight from the state in `past` to `drift`, over as many
    branches as lie on the way."""
    advance = advancing(move or inlined(add_work))

    @specialized
    def walk(law_parameters, springs, i, past, trial, drift):
        for row in range(at.SPRING_ROWS):
            springs[trial + row, i] = springs[past + row, i]
        copy_extra_rows(springs, i, past, trial)
        if springs[trial + at.TURN, i] * (drift - springs[trial + at.DRIFT, i]) < 0.0:
            switch(law_parameters, springs, i, trial, at.TURNED)
        for _ in range(_MOST):
            if drift > springs[trial + at.UPPER, i]:
                advance(law_parameters, springs, i, trial, springs[trial + at.UPPER, i])
                switch(law_parameters, springs, i, trial, at.ABOVE)
            elif drift < springs[trial + at.LOWER, i]:
                advance(law_parameters, springs, i, trial, springs[trial + at.LOWER, i])
                switch(law_parameters, springs, i, trial, at.BELOW)
            else:
                break
        advance(law_parameters, springs, i, trial, drift)
        return springs[trial + at.SLOPE, i]

    return walk


def walking(switch: Any, recoverable: Any, enter: Any) -> LawFunctions:
    """The functions of a law that is linear branch by branch and remembers its branch: it
    dissipates what was done on it and cannot be recovered."""

    @inlined
    def dissipated(law_parameters, springs, i):
        return springs[at.WORK, i] - recoverable(law_parameters, springs, i)

    @inlined
    def keep(law_parameters, springs, i, past, trial):
        for row in range(at.PLAIN_ROWS, at.SPRING_ROWS):
            springs[row, i] = springs[trial + row, i]
        copy_extra_rows(springs, i, trial, 0)

    return LawFunctions(
        force=walker(switch),
        recoverable=recoverable,
        dissipated=dissipated,
        keep=keep,
        enter=enter,
        switch=switch,
    )
