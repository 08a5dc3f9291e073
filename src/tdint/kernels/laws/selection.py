"""Calls of the functions of drift laws.

Each law is compiled to its own object file. A kernel finds the functions of the law of a story by
its number in the table of laws (`tdint.kernels.building.compilable.LAWS_SYMBOL`). The functions of
the linear and the bilinear law that steps call often are part of the kernels, and so is the path of
any other law on its present linear branch.
"""

from __future__ import annotations

from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import HOOKS
from tdint.kernels.compiling import COMPILES, inline
from tdint.kernels.laws import LAWS, bilinear, linear
from tdint.kernels.laws.branch_following import (
    branch_owner,
    move_on_branch,
    remains_on_branch,
)
from tdint.kernels.laws.hooks import (
    BRANCH_FIRST,
    CURVED,
    DISSIPATES,
    STORES_BRANCH,
    hooks_of,
    properties,
)

_PROPERTIES = len(HOOKS)  # position of the properties in a row of the table of laws

if COMPILES:
    from tdint.kernels.building.compiler import law_entry, law_function

    def law_caller(hook: str) -> Any:
        slot, call = list(HOOKS).index(hook), law_function(HOOKS[hook])

        @inline
        def call_law(*arguments):
            """Call the function of the law of the story."""
            return call(law_entry(arguments[0][rows.CODE, arguments[2]], slot), arguments)

        return call_law

    @inline
    def law_properties(law_parameters, i):
        return law_entry(law_parameters[rows.CODE, i], _PROPERTIES)

else:

    def law_caller(hook: str) -> Any:
        """Return a function that calls a function of the law of a story with its arguments: table
        `law_parameters`, table `law_state`, number of the story, and the others.

        Parameters
        ----------
        hook : str
            Name of the function (`tdint.kernels.building.compilable.HOOKS`).
        """

        def call(*arguments: Any) -> Any:
            """Call the function of the law of the story."""
            law = LAWS[arguments[0][rows.CODE, arguments[2]]]
            return hooks_of(law)[hook](*arguments)

        return call

    def law_properties(law_parameters: Any, i: int) -> int:
        """Return the properties of the law of a story (`tdint.kernels.laws.hooks.properties`)."""
        return properties(LAWS[law_parameters[rows.CODE, i]])


_LINEAR, _BILINEAR = 0.0, 1.0  # numbers of the laws
_linear, _bilinear = hooks_of(linear.LAW), hooks_of(bilinear.LAW)
_linear_force, _bilinear_force = _linear["force"], _bilinear["force"]
_linear_advance, _bilinear_advance = _linear["advance"], _bilinear["advance"]
_force = law_caller("force")
strain_energy_of_law = law_caller("strain_energy")
hysteretic_energy_of_law = law_caller("hysteretic_energy")
enter_branch = law_caller("enter")
_advance = law_caller("advance")
switch_branch = law_caller("switch")
points_on_path = law_caller("points")
distance_to_kink = law_caller("kink")


@inline
def elements_of(law_parameters, i):
    """Return the columns of the elements of story `i`, which must have elements."""
    return range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    )


@inline
def is_curved(law_parameters, i):
    """Return True if branches of the law in column `i` are curved."""
    return (law_properties(law_parameters, i) & CURVED) != 0


@inline
def stores_branch(law_parameters, i):
    """Return True if every state of the law in column `i` contains its branch."""
    return (law_properties(law_parameters, i) & STORES_BRANCH) != 0


@inline
def dissipates(law_parameters, i):
    """Return True if the law in column `i` accumulates its dissipated energy."""
    return (law_properties(law_parameters, i) & DISSIPATES) != 0


@inline
def force_of_law(law_parameters, law_state, i, previous, trial, drift):
    """Compute the force of the law in column `i`; return the tangent stiffness, N/m."""
    code = law_parameters[rows.CODE, i]
    if code == _LINEAR:
        return _linear_force(law_parameters, law_state, i, previous, trial, drift)
    if code == _BILINEAR:
        return _bilinear_force(law_parameters, law_state, i, previous, trial, drift)
    if (law_properties(law_parameters, i) & BRANCH_FIRST) != 0:
        branch_block = branch_owner(law_state, i, previous)
        if remains_on_branch(law_state, i, branch_block, previous, drift):
            return move_on_branch(law_state, i, branch_block, previous, trial, drift)
    return _force(law_parameters, law_state, i, previous, trial, drift)


@inline
def advance_rows(law_parameters, law_state, i, block, step, mean_force):
    """Update the rows of the law in column `i` after a movement along a linear branch."""
    code = law_parameters[rows.CODE, i]
    if code == _LINEAR:
        _linear_advance(law_parameters, law_state, i, block, step, mean_force)
    elif code == _BILINEAR:
        _bilinear_advance(law_parameters, law_state, i, block, step, mean_force)
    else:
        _advance(law_parameters, law_state, i, block, step, mean_force)


def _selected(hook: str) -> Any:
    """Return a function (law_parameters, law_state, i, previous, trial) that calls a function of
    the law in column `i`; those of the linear and the bilinear law are part of it."""
    of_linear, of_bilinear, of_other = _linear[hook], _bilinear[hook], law_caller(hook)

    @inline
    def call(law_parameters, law_state, i, previous, trial):
        """Call the function of the law."""
        code = law_parameters[rows.CODE, i]
        if code == _LINEAR:
            of_linear(law_parameters, law_state, i, previous, trial)
        elif code == _BILINEAR:
            of_bilinear(law_parameters, law_state, i, previous, trial)
        else:
            of_other(law_parameters, law_state, i, previous, trial)

    return call


accumulate_dissipation_of_law = _selected("accumulate_dissipation")
"""Store the energy that the law of a column has dissipated until state `trial`."""

keep_rows = _selected("keep")
"""Copy the rows of the law of a column that are not common rows to the committed state."""

commit_law = _selected("commit")
"""Make a trial state of the law of a column, a story with a single element or an element, the
committed state."""
