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

from tdint.kernels.compiling import F8, I8, TABLE, VECTOR

STEP = I8(VECTOR, TABLE, TABLE, TABLE, TABLE, F8, VECTOR, TABLE, TABLE, TABLE, VECTOR)

# Newton's iteration, the same for all implicit steps
ITERATIONS = 30
CLOSE = 1e-10  # residual over that of the first guess
SMALL = 1e-14  # correction over the displacement: rounding
SAME_TANGENT = 1e-3  # a tangent that changed by less, over the initial one, is kept in the factorization
