"""Functions of the laws that kernels call, with their defaults, and properties of the laws.

`tdint.kernels.laws.law.LawFunctions` describes the functions that a law defines, and
`tdint.kernels.building.compilable.HOOKS` contains their signatures.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline
from tdint.kernels.laws.branch_following import add_work
from tdint.kernels.laws.law import DriftLaw

# Bits of the properties of a law (`properties`)
CURVED = 1
STORES_BRANCH = 2
DISSIPATES = 4
BRANCH_FIRST = 8

_DEFAULT_POINTS = 16.0
"""Number of Gauss points of a path, for laws that do not specify a number; the maximum in a single
part of the path."""


@cache
def properties(law: DriftLaw) -> int:
    """Return the sum of the properties of a law: branches that are curved (CURVED), a branch that
    is stored in every state (STORES_BRANCH), dissipated energy that is accumulated (DISSIPATES),
    and a fast evaluation of paths on one branch (BRANCH_FIRST)."""
    functions = law.functions()
    return (
        CURVED * law.curved
        + STORES_BRANCH * (functions.keep is not None)
        + DISSIPATES * (functions.accumulate_dissipation is not None)
        + BRANCH_FIRST * functions.branch_first
    )


@cache
def hooks_of(law: DriftLaw) -> dict[str, Any]:
    """Return the functions that kernels call by their names: the functions of a law, defaults of
    functions that it does not define, and `commit`, which makes a trial state the committed
    state."""
    functions = law.functions()
    hooks = {name: getattr(functions, name) or default for name, default in _DEFAULTS.items()}
    hooks |= {"force": functions.force, "strain_energy": functions.strain_energy}
    accumulate_dissipation, keep = hooks["accumulate_dissipation"], hooks["keep"]

    @inline
    def commit(law_parameters, law_state, i, previous, trial):
        """Store the dissipated energy, then copy all rows to the committed state."""
        accumulate_dissipation(law_parameters, law_state, i, previous, trial)
        keep(law_parameters, law_state, i, previous, trial)
        for row in range(rows.COMMON_ROWS):
            law_state[row, i] = law_state[trial + row, i]

    return {**hooks, "commit": commit}


@inline
def _stored_dissipation(law_parameters, law_state, i):
    """Return row DISSIPATED of the committed state, J."""
    return law_state[rows.DISSIPATED, i]


@inline
def _copy_dissipation(law_parameters, law_state, i, previous, trial):
    """Copy the dissipated energy, for laws that do not accumulate it."""
    law_state[trial + rows.DISSIPATED, i] = law_state[previous + rows.DISSIPATED, i]


@inline
def _no_rows(law_parameters, law_state, i, previous, trial):
    """Do nothing: for laws whose states consist of the common rows only."""


@inline
def _one_branch(law_parameters, law_state, i):
    """Do nothing: for laws with a single branch."""


@inline
def _no_switch(law_parameters, law_state, i, block, event):
    """Do nothing: for laws with a single branch."""


@inline
def _default_points(law_parameters, law_state, i, drift_change):
    """Return the default number of Gauss points."""
    return _DEFAULT_POINTS


@inline
def _no_kink(law_parameters, law_state, i, block, side):
    """Return infinity, for laws without a kink."""
    return math.inf


_DEFAULTS = {
    "hysteretic_energy": _stored_dissipation,
    "accumulate_dissipation": _copy_dissipation,
    "keep": _no_rows,
    "enter": _one_branch,
    "advance": inline(add_work),
    "switch": _no_switch,
    "points": _default_points,
    "kink": _no_kink,
}
"""Functions of laws that do not define them."""
