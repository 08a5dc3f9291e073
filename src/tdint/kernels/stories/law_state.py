"""Drift laws of stories: force and tangent, energies, committed and trial states.

The laws themselves stand in `tdint.kernels.laws`, one file each.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import I8, TABLE, VECTOR, called, inlined, kernel
from tdint.kernels.laws.choosing import KNOWING, case_of_3, case_of_5, case_of_6, chosen
from tdint.kernels.stories.branches import enter

_force = chosen("force", case_of_6)

recoverable = chosen("recoverable", case_of_3)
"""(law_parameters, springs, i) -> energy stored in the law's committed state, J."""


@inlined
def _dissipated(law_parameters, springs, i):
    return springs[at.DISSIPATED, i]


dissipated = chosen("dissipated", case_of_3, _dissipated)
"""(law_parameters, springs, i) -> energy that the law has dissipated until its committed state,
J."""


@inlined
def _elastic(law_parameters, springs, i, past, trial):
    springs[trial + at.DISSIPATED, i] = springs[past + at.DISSIPATED, i]


@inlined
def _nothing_more(law_parameters, springs, i, past, trial):
    pass


settle = chosen("settle", case_of_5, _elastic)
"""(law_parameters, springs, i, past, trial): adds up the energy dissipated on the way between the
two blocks."""

_keep = chosen("keep", case_of_5, _nothing_more)


@inlined
def restoring(law_parameters, springs, i, past, trial, drift):
    """Force of story `i` at `drift`, reached from the state in block `past`; written to block
    `trial`.

    Returns the tangent stiffness, N/m.
    """
    springs[trial + at.DRIFT, i] = drift
    return _force(law_parameters, springs, i, past, trial, drift)


@called
def reach(law_parameters, springs, i, past, trial, drift):
    """`restoring` for where it is one of many calls."""
    return restoring(law_parameters, springs, i, past, trial, drift)


@inlined
def commit(law_parameters, springs, i, past, trial):
    """Make the trial state of story `i` the committed one; `past` is the block that it was reached
    from."""
    settle(law_parameters, springs, i, past, trial)
    _keep(law_parameters, springs, i, past, trial)
    for row in range(at.PLAIN_ROWS):
        springs[row, i] = springs[trial + row, i]


@inlined
def adopt(law_parameters, springs, i, trial):
    """Make the trial state of story `i` the committed one; what it dissipated is settled."""
    _keep(law_parameters, springs, i, 0, trial)
    for row in range(at.PLAIN_ROWS):
        springs[row, i] = springs[trial + row, i]


@inlined
def resume(law_parameters, springs, i):
    """Put story `i` on the branch that its committed state implies, after a step that does not
    follow branches."""
    if law_parameters[at.CODE, i] not in KNOWING:
        enter(law_parameters, springs, i)


@inlined
def start(law_parameters, springs, i, drift):
    """Bring story `i` from rest to its initial drift."""
    enter(law_parameters, springs, i)
    restoring(law_parameters, springs, i, 0, at.FIRST_TRIAL, drift)
    commit(law_parameters, springs, i, 0, at.FIRST_TRIAL)
    resume(law_parameters, springs, i)


# ---- One story along a given path of drifts, without mass and time: a cyclic test

# Columns of the result
SHEAR = 0
TANGENT = 1
RECOVERABLE = 2
DISSIPATION = 3
RESULT_COLUMNS = 4


@kernel(I8(TABLE, I8, VECTOR, TABLE, TABLE), parts=("laws",))
def follow(law_parameters, i, drifts, springs, result):
    """Bring story `i` from rest to the first drift and then from one to the next; one row of result
    for each.

    Each drift is committed, as a time step commits the one at its end. Shear N, tangent N/m,
    energies J.
    """
    start(law_parameters, springs, i, drifts[0])
    for s in range(drifts.size):
        result[s, TANGENT] = restoring(
            law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL, drifts[s]
        )
        commit(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL)
        result[s, SHEAR] = springs[at.FORCE, i]
        result[s, RECOVERABLE] = recoverable(law_parameters, springs, i)
        result[s, DISSIPATION] = dissipated(law_parameters, springs, i)
    return 0
