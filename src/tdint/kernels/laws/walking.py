"""Straight ways over the branches of a law."""

from __future__ import annotations

import math
from typing import Any

from tdint.kernels import layout as at
from tdint.kernels.compiling import inlined, specialized
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
    return at.EXTRA_ROWS + block // at.SPRING_ROWS * ((springs.shape[0] - at.EXTRA_ROWS) // at.SPRING_BLOCKS)


@inlined
def copy_extra_rows(springs, i, past, trial):
    """Copy the further rows of story `i` between two blocks, where there are any."""
    for row in range((springs.shape[0] - at.EXTRA_ROWS) // at.SPRING_BLOCKS):
        springs[extra_rows(springs, trial) + row, i] = springs[extra_rows(springs, past) + row, i]


@inlined
def fail(springs, i, block, failed):
    """Let story `i` carry nothing any more; INTERNAL is `failed` from then on."""
    springs[block + at.INTERNAL, i] = failed
    springs[block + at.FORCE, i] = 0.0
    springs[block + at.SLOPE, i] = 0.0
    springs[block + at.TURN, i] = 0.0
    springs[block + at.UPPER, i] = math.inf
    springs[block + at.LOWER, i] = -math.inf


def advancing(own: Any) -> Any:
    """A function that goes to a drift on the present branch of the state in a block; `own` is `DriftLaw.advance`."""

    @inlined
    def advance(law_parameters, springs, i, block, drift):
        step = drift - springs[block + at.DRIFT, i]
        force = springs[block + at.FORCE, i]
        new = force + springs[block + at.SLOPE, i] * step
        springs[block + at.DRIFT, i] = drift
        springs[block + at.FORCE, i] = new
        own(law_parameters, springs, i, block, step, 0.5 * (force + new))

    return advance


def walker(switch: Any, own: Any = None) -> Any:
    """A `DriftLaw.force` that goes straight from the state in `past` to `drift`, over as many branches as lie on the
    way."""
    advance = advancing(own or inlined(add_work))

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
    """The functions of a law that is linear branch by branch and remembers its branch: it dissipates what was done on
    it and cannot be recovered."""

    @inlined
    def dissipated(law_parameters, springs, i):
        return springs[at.WORK, i] - recoverable(law_parameters, springs, i)

    @inlined
    def keep(law_parameters, springs, i, past, trial):
        for row in range(at.PLAIN_ROWS, at.SPRING_ROWS):
            springs[row, i] = springs[trial + row, i]
        copy_extra_rows(springs, i, trial, 0)

    return LawFunctions(
        force=walker(switch), recoverable=recoverable, dissipated=dissipated, keep=keep, enter=enter, switch=switch
    )
