"""Straight ways over the branches of a law."""

from __future__ import annotations

from typing import Any

from tdint.kernels.compiling import called, inlined
from tdint.kernels.layout import ABOVE, BELOW, DRIFT, FORCE, LOWER, SLOPE, SPRING_ROWS, TURN, TURNED, UPPER


@inlined
def nothing(laws, springs, i, block, step, mean_force):
    """An `advance` of a law of which only drift and force change on the way."""


def advancing(own: Any) -> Any:
    """A function that goes to a drift on the present branch of the state in a block; `own` is `DriftLaw.advance`."""

    @inlined
    def advance(laws, springs, i, block, drift):
        step = drift - springs[block + DRIFT, i]
        force = springs[block + FORCE, i]
        new = force + springs[block + SLOPE, i] * step
        springs[block + DRIFT, i] = drift
        springs[block + FORCE, i] = new
        own(laws, springs, i, block, step, 0.5 * (force + new))

    return advance


def walker(switch: Any, own: Any = nothing) -> Any:
    """A `DriftLaw.force` that goes straight from the state in `past` to `drift`, over as many branches as lie on the
    way."""
    advance = advancing(own)

    @called
    def walk(laws, springs, i, past, trial, drift):
        for row in range(SPRING_ROWS):
            springs[trial + row, i] = springs[past + row, i]
        if springs[trial + TURN, i] * (drift - springs[trial + DRIFT, i]) < 0.0:
            switch(laws, springs, i, trial, TURNED)
        for _ in range(8):
            if drift > springs[trial + UPPER, i]:
                advance(laws, springs, i, trial, springs[trial + UPPER, i])
                switch(laws, springs, i, trial, ABOVE)
            elif drift < springs[trial + LOWER, i]:
                advance(laws, springs, i, trial, springs[trial + LOWER, i])
                switch(laws, springs, i, trial, BELOW)
            else:
                break
        advance(laws, springs, i, trial, drift)
        return springs[trial + SLOPE, i]

    return walk
