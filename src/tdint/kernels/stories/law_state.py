"""Drift laws of stories: force and tangent, energies, committed and trial states.

The laws themselves stand in `tdint.kernels.laws`, one file each.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import I8, TABLE, VECTOR, inline, kernel, outlined
from tdint.kernels.laws.choosing import KNOWING, case_of_3, case_of_5, case_of_6, chosen
from tdint.kernels.stories.branches import enter

_force = chosen("force", case_of_6)

strain_energy = chosen("strain_energy", case_of_3)
"""(law_parameters, law_state, i) -> energy stored in the law's committed state, J."""


@inline
def _hysteretic_energy(law_parameters, law_state, i):
    return law_state[rows.DISSIPATED, i]


hysteretic_energy = chosen("hysteretic_energy", case_of_3, _hysteretic_energy)
"""(law_parameters, law_state, i) -> energy that the law has dissipated until its committed state,
J."""


@inline
def _elastic(law_parameters, law_state, i, previous, trial):
    law_state[trial + rows.DISSIPATED, i] = law_state[previous + rows.DISSIPATED, i]


@inline
def _nothing_more(law_parameters, law_state, i, previous, trial):
    pass


accumulate_dissipation = chosen("accumulate_dissipation", case_of_5, _elastic)
"""(law_parameters, law_state, i, previous, trial): adds up the energy dissipated on the way
between the
two blocks."""

_keep = chosen("keep", case_of_5, _nothing_more)


@inline
def restoring_force(law_parameters, law_state, i, previous, trial, drift):
    """Force of story `i` at `drift`, reached from the state in block `previous`; written to block
    `trial`.

    Returns the tangent stiffness, N/m.
    """
    law_state[trial + rows.DRIFT, i] = drift
    return _force(law_parameters, law_state, i, previous, trial, drift)


@outlined
def restoring_force_outlined(law_parameters, law_state, i, previous, trial, drift):
    """`restoring_force` for where it is one of many calls."""
    return restoring_force(law_parameters, law_state, i, previous, trial, drift)


@inline
def commit(law_parameters, law_state, i, previous, trial):
    """Make the trial state of story `i` the committed one; `previous` is the block that it was
    reached
    from."""
    accumulate_dissipation(law_parameters, law_state, i, previous, trial)
    _keep(law_parameters, law_state, i, previous, trial)
    for row in range(rows.COMMON_ROWS):
        law_state[row, i] = law_state[trial + row, i]


@inline
def commit_without_dissipation(law_parameters, law_state, i, trial):
    """Make the trial state of story `i` the committed one; what it dissipated is settled."""
    _keep(law_parameters, law_state, i, 0, trial)
    for row in range(rows.COMMON_ROWS):
        law_state[row, i] = law_state[trial + row, i]


@inline
def resume(law_parameters, law_state, i):
    """Put story `i` on the branch that its committed state implies, after a step that does not
    follow branches."""
    if law_parameters[rows.CODE, i] not in KNOWING:
        enter(law_parameters, law_state, i)


@inline
def start(law_parameters, law_state, i, drift):
    """Bring story `i` from rest to its initial drift."""
    enter(law_parameters, law_state, i)
    restoring_force(law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift)
    commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
    resume(law_parameters, law_state, i)


# ---- One story along a given path of drifts, without mass and time: a cyclic test

# Columns of the result
SHEAR = 0
TANGENT = 1
STRAIN_ENERGY = 2
HYSTERETIC_ENERGY = 3
RESULT_COLUMNS = 4


@kernel(I8(TABLE, I8, VECTOR, TABLE, TABLE), parts=("laws",))
def follow(law_parameters, i, drifts, law_state, result):
    """Bring story `i` from rest to the first drift and then from one to the next; one row of result
    for each.

    Each drift is committed, as a time step commits the one at its end. Shear N, tangent N/m,
    energies J.
    """
    start(law_parameters, law_state, i, drifts[0])
    for s in range(drifts.size):
        result[s, TANGENT] = restoring_force(
            law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, drifts[s]
        )
        commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        result[s, SHEAR] = law_state[rows.FORCE, i]
        result[s, STRAIN_ENERGY] = strain_energy(law_parameters, law_state, i)
        result[s, HYSTERETIC_ENERGY] = hysteretic_energy(law_parameters, law_state, i)
    return 0
