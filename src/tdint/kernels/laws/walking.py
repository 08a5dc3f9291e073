"""Straight ways over the branches of a law."""

from __future__ import annotations

from typing import Any

from tdint.kernels import layout as at
from tdint.kernels.compiling import inlined, specialized
from tdint.kernels.laws.law import LawFunctions

_MOST = 16
"""Branches that a straight way may go over; no law has as many."""


@inlined
def nothing(laws, springs, i, block, step, mean_force):
    """An `advance` of a law of which drift and force alone change on the way."""


def add_work(laws, springs, i, block, step, mean_force):
    """An `advance` of a law of which drift, force and the work done change on the way."""
    springs[block + at.WORK, i] += mean_force * step


@inlined
def further(springs, block):
    """First of the further rows that belong to a block."""
    return at.FURTHER + block // at.SPRING_ROWS * ((springs.shape[0] - at.FURTHER) // at.SPRING_BLOCKS)


@inlined
def copy_further(springs, i, past, trial):
    """Copy the further rows of story `i` between two blocks, where there are any."""
    for row in range((springs.shape[0] - at.FURTHER) // at.SPRING_BLOCKS):
        springs[further(springs, trial) + row, i] = springs[further(springs, past) + row, i]


def advancing(own: Any) -> Any:
    """A function that goes to a drift on the present branch of the state in a block; `own` is `DriftLaw.advance`."""

    @inlined
    def advance(laws, springs, i, block, drift):
        step = drift - springs[block + at.DRIFT, i]
        force = springs[block + at.FORCE, i]
        new = force + springs[block + at.SLOPE, i] * step
        springs[block + at.DRIFT, i] = drift
        springs[block + at.FORCE, i] = new
        own(laws, springs, i, block, step, 0.5 * (force + new))

    return advance


def walker(switch: Any, own: Any = None) -> Any:
    """A `DriftLaw.force` that goes straight from the state in `past` to `drift`, over as many branches as lie on the
    way."""
    advance = advancing(own or inlined(add_work))

    @specialized
    def walk(laws, springs, i, past, trial, drift):
        for row in range(at.SPRING_ROWS):
            springs[trial + row, i] = springs[past + row, i]
        copy_further(springs, i, past, trial)
        if springs[trial + at.TURN, i] * (drift - springs[trial + at.DRIFT, i]) < 0.0:
            switch(laws, springs, i, trial, at.TURNED)
        for _ in range(_MOST):
            if drift > springs[trial + at.UPPER, i]:
                advance(laws, springs, i, trial, springs[trial + at.UPPER, i])
                switch(laws, springs, i, trial, at.ABOVE)
            elif drift < springs[trial + at.LOWER, i]:
                advance(laws, springs, i, trial, springs[trial + at.LOWER, i])
                switch(laws, springs, i, trial, at.BELOW)
            else:
                break
        advance(laws, springs, i, trial, drift)
        return springs[trial + at.SLOPE, i]

    return walk


def walking(switch: Any, recoverable: Any, enter: Any) -> LawFunctions:
    """The functions of a law that is linear branch by branch and remembers its branch: it dissipates what was done on
    it and cannot be recovered."""

    @inlined
    def dissipated(laws, springs, i):
        return springs[at.WORK, i] - recoverable(laws, springs, i)

    @inlined
    def keep(laws, springs, i, past, trial):
        for row in range(at.PLAIN_ROWS, at.SPRING_ROWS):
            springs[row, i] = springs[trial + row, i]
        copy_further(springs, i, trial, 0)

    return LawFunctions(
        force=walker(switch), recoverable=recoverable, dissipated=dissipated, keep=keep, enter=enter, switch=switch
    )
