"""The signature of every compiled step:

    step(coefficients, linear_terms, modal, law_parameters, forces, flags, h, load, state, springs, work, report)
    -> iterations, or a negative code

1. coefficients: the method's numbers, with the step's own where they depend on the building (`exact`).
2. linear_terms, modal, law_parameters, forces, flags: the `Scene`, never written (`tdint.kernels.bundles`,
   `tdint.kernels.layout`).
3. load: time at the step's start and the ground acceleration at both ends, linear in between.
4. state, springs: the whole memory of the method and of the drift laws, before and after. A step that returns
   NOT_CONVERGED leaves both as they were; after NOT_FINITE the march ends.
5. work, report: scratch and kept factorizations, and what a step leaves for the next one. It gives the same result from
   fresh ones with the same `report[STEPS_DONE]`, but for rounding.
6. State row ACCELERATION is what the method itself uses next; nothing that is reported is fed back.
"""

from __future__ import annotations

from tdint.kernels.bundles import MEMORY, SCENE
from tdint.kernels.compiling import F8, I8, VECTOR, called_at, inlined

STEP = I8(VECTOR, *SCENE, F8, VECTOR, *MEMORY)

_call_step = called_at(STEP)


@inlined
def take_step(step, coefficients, scene, h, load, memory):
    """Take a step by the kernel that a march was given."""
    linear_terms, modal, law_parameters, forces, flags = scene
    state, springs, work, report = memory
    return _call_step(
        step, coefficients, linear_terms, modal, law_parameters, forces, flags, h, load, state, springs, work, report
    )
