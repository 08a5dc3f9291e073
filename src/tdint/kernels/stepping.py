"""The signature of every compiled step:

    step(coefficients, chain, modal, laws, forces, flags, h, load, state, springs, work, report) -> iterations, or a
    negative code

1. coefficients: the method's numbers, with the step's own where they depend on the building (`exact`).
2. chain, modal, laws, forces, flags: the `Scene`, never written (`tdint.kernels.bundles`, `tdint.kernels.layout`).
3. load: time at the step's start and the ground acceleration at both ends, linear in between.
4. state, springs: the whole memory of the method and of the drift laws, before and after. A step that returns
   NOT_CONVERGED leaves both as they were; after NOT_FINITE the march ends.
5. work, report: scratch and kept factorizations, and what a step leaves for the next one. It gives the same result from
   fresh ones with the same `report[STEPS_DONE]`, but for rounding.
6. State row ACCELERATION is what the method itself uses next; nothing that is reported is fed back.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.bundles import MEMORY, SCENE
from tdint.kernels.compiling import F8, I8, VECTOR, called_at, inlined

STEP = I8(VECTOR, *SCENE, F8, VECTOR, *MEMORY)

_call_step = called_at(STEP)


@inlined
def take_step(step, coefficients, scene, h, load, memory):
    """Take a step by the kernel that a march was given."""
    chain, modal, laws, forces, flags = scene
    state, springs, work, report = memory
    return _call_step(step, coefficients, chain, modal, laws, forces, flags, h, load, state, springs, work, report)


# Newton's iteration, the same for all implicit steps
ITERATIONS = 30
PATIENCE = 6  # corrections after which one that does not bring the step closer to balance is halved: kinks make cycles
LEAST = 1e-3  # part of a correction that is tried
CLOSE = 1e-11  # out of balance over the sum of the sizes of the terms
SMALL = 1e-14  # correction over the displacement: rounding
NOTHING = 1e-250  # N; far ahead of a wave forces are so small that their products underflow
SAME_TANGENT = 1e-3  # a tangent that changed by less, over the initial one, is kept in the factorization


@inlined
def balanced(noting, close, report, i, residual, scale):
    """Whether the terms of an equation, whose sizes add up to `scale`, balance; with `noting` the report keeps the
    worst of those that do not."""
    small = abs(residual) <= close * scale + NOTHING
    if noting and not small and not abs(residual) / scale <= report[at.RESIDUAL]:
        report[at.RESIDUAL] = abs(residual) / scale
        report[at.WORST_STORY] = i
    return small
