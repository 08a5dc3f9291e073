"""Kernel that follows several paths from the same state, as moment4 does: the force of a law at
several drifts after a reversal."""

from tdint.kernels import layout as rows
from tdint.kernels.compiling import F8, TABLE, VECTOR, kernel
from tdint.kernels.stories import path


@kernel(F8(TABLE, TABLE, TABLE, VECTOR, TABLE, VECTOR))
def forces_behind(law_parameters, begun, law_state, rises, scratch, forces):
    """Store the force of the first story after each rise of its drift from the state `begun` in
    `forces`; `law_state` contains the last state."""
    for j in range(rises.shape[0]):
        for row in range(law_state.shape[0]):
            law_state[row, 0] = begun[row, 0]
        path.follow(law_parameters, law_state, 0, rises[j], 0.0, False, scratch, 0)
        path.commit_path_end(law_parameters, law_state, 0, rises[j])
        forces[j] = law_state[rows.FORCE, 0]
    return 0.0
