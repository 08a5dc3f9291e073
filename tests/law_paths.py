"""A story's law on its own: its table, and the force along a path of the drift."""

from __future__ import annotations

import numpy as np

from tdint.kernels import layout
from tdint.kernels import layout as at
from tdint.kernels.laws.compiled_separately import spring_table
from tdint.kernels.stories.law_state import commit, dissipated, recoverable, restoring, start
from tdint.model.laws import CODES

K, FY, HARDENING = 1000.0, 20.0, 0.05
CYCLE = np.concatenate([np.linspace(a, b, 40)[1:] for a, b in ((0, 0.06), (0.06, -0.09), (-0.09, 0.05), (0.05, 0.1))])


def law_table(name, *parameters):
    table = np.zeros((layout.FIRST_PARAMETER + len(parameters), 2))
    table[layout.CODE, 0] = CODES[name]
    table[layout.STIFFNESS, 0] = K
    table[layout.FIRST_PARAMETER :, 0] = parameters
    return table


def follow(law_parameters, path):
    """Force along a path, and what is stored and dissipated at its end."""
    state = spring_table(law_parameters)
    start(law_parameters, state, 0, 0.0)
    forces = []
    for drift in path:
        restoring(law_parameters, state, 0, 0, at.FIRST_TRIAL, drift)
        commit(law_parameters, state, 0, 0, at.FIRST_TRIAL)
        forces.append(state[layout.FORCE, 0])
    return np.array(forces), recoverable(law_parameters, state, 0), dissipated(law_parameters, state, 0)
