"""Drift laws branch by branch.

On a branch the force is linear in the drift, or curved. It ends where the drift leaves (LOWER, UPPER), or where the
drift rate turns against TURN; `switch` tells what follows.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.laws.choosing import CURVED, case_of_3, case_of_5, case_of_6, chosen
from tdint.kernels.laws.walking import add_work, advancing, nothing

advance = advancing(chosen("advance", case_of_6, nothing, rarely=add_work))
"""(laws, springs, i, block, drift): go to `drift` on the present linear branch of the state in `block`."""


@called
def go_along(laws, springs, i, block, drift):
    """`advance` for where it is one of few calls."""
    advance(laws, springs, i, block, drift)


@inlined
def _without_end(laws, springs, i):
    pass


@inlined
def _without_branches(laws, springs, i, block, event):
    pass


_enter = chosen("enter", case_of_3, _without_end)
_switch = chosen("switch", case_of_5, _without_branches)


@called
def enter(laws, springs, i):
    """Put the committed state of story `i` on the branch that it implies."""
    springs[at.SLOPE, i] = math.inf if laws[at.CODE, i] in CURVED else laws[at.STIFFNESS, i]
    springs[at.TURN, i] = 0.0
    springs[at.UPPER, i] = math.inf
    springs[at.LOWER, i] = -math.inf
    _enter(laws, springs, i)


@called
def switch(laws, springs, i, block, event):
    """Change to the branch that follows the present one in `block` after it ended by `event`."""
    _switch(laws, springs, i, block, event)
