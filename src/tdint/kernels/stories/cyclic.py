"""One story along a given path of drifts, without mass and time: a cyclic test."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import I8, TABLE, VECTOR, kernel
from tdint.kernels.stories.law_state import commit, dissipated, recoverable, restoring, start

# Columns of the result
SHEAR = 0
TANGENT = 1
RECOVERABLE = 2
DISSIPATION = 3
RESULT_COLUMNS = 4


@kernel(I8(TABLE, I8, VECTOR, TABLE, TABLE), parts=("laws",))
def follow(law_parameters, i, drifts, springs, result):
    """Bring story `i` from rest to the first drift and then from one to the next; one row of result for each.

    Each drift is committed, as a time step commits the one at its end. Shear N, tangent N/m, energies J.
    """
    start(law_parameters, springs, i, drifts[0])
    for s in range(drifts.size):
        result[s, TANGENT] = restoring(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL, drifts[s])
        commit(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL)
        result[s, SHEAR] = springs[at.FORCE, i]
        result[s, RECOVERABLE] = recoverable(law_parameters, springs, i)
        result[s, DISSIPATION] = dissipated(law_parameters, springs, i)
    return 0
