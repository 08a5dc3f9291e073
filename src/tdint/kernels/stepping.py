"""The signature of every compiled step:

    step(coefficients, chain, modal, laws, forces, h, load, state, springs, work, memo) -> iterations, or a negative
    code

1. coefficients: the method's numbers, with the step's own where they depend on the building (`exact`).
2. chain, modal, laws, forces: the building and the forces on its floors, never written (`tdint.kernels.layout`).
3. load: time at the step's start and the ground acceleration at both ends, linear in between.
4. state, springs: the whole memory of the method and of the drift laws, before and after. A step that returns
   NOT_CONVERGED leaves both as they were; after NOT_FINITE the march ends.
5. work, memo: scratch and kept factorizations. A step gives the same result from fresh ones with the same
   `memo[STEPS_DONE]`, but for rounding.
6. State row ACCELERATION is what the method itself uses next; nothing that is reported is fed back.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, called_at, inlined

STEP = I8(VECTOR, TABLE, TABLE, TABLE, TABLE, F8, VECTOR, TABLE, TABLE, TABLE, VECTOR)

call_step = called_at(STEP)
"""(step, its arguments): take a step by the kernel that a march was given."""

# Newton's iteration, the same for all implicit steps
ITERATIONS = 30
PATIENCE = 6  # corrections after which one that does not bring the step closer to balance is halved: kinks make cycles
LEAST = 1e-3  # part of a correction that is tried
CLOSE = 1e-11  # out of balance over the sum of the sizes of the terms
SMALL = 1e-14  # correction over the displacement: rounding
NOTHING = 1e-250  # N; far ahead of a wave forces are so small that their products underflow
SAME_TANGENT = 1e-3  # a tangent that changed by less, over the initial one, is kept in the factorization


@inlined
def balanced(noting, close, memo, i, residual, scale):
    """Whether the terms of an equation, whose sizes add up to `scale`, balance; with `noting` memo keeps the worst of
    those that do not."""
    small = abs(residual) <= close * scale + NOTHING
    if noting and not small and not abs(residual) / scale <= memo[at.RESIDUAL]:
        memo[at.RESIDUAL] = abs(residual) / scale
        memo[at.WORST_STORY] = i
    return small
