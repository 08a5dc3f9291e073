"""Drift laws that are compiled separately and called by address.

Such a law is compiled only if a model uses it. It can be long without increasing the compile time
of the time loops, which all models share. A call by address takes about 10 ns longer than a call
that the compiler can inline. It is necessary only if a path leaves its branch (see `branch_first`).
"""

from __future__ import annotations

import types as python_types
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.kernels import layout as rows
from tdint.kernels.compiling import COMPILES, F8, I8, TABLE, Kernel, indirect_caller, inline
from tdint.kernels.laws import LAWS
from tdint.kernels.laws.branch_following import branch_first
from tdint.kernels.laws.law import LawFunctions

# Signature of the kernel of a law, a copy of `_all_hooks`: the result and the arguments in order
_SIGNATURE = F8(
    I8,  # number of the function
    TABLE,  # law_parameters
    TABLE,  # law_state
    I8,  # i, index of the story
    I8,  # previous, or block
    I8,  # trial
    F8,  # drift, or event
)

# Numbers of the functions of a law, in the order of `_HOOKS`.
_FORCE = 0
_STRAIN_ENERGY = 1
_HYSTERETIC_ENERGY = 2
_KEEP = 3
_ENTER = 4
_SWITCH = 5


if COMPILES:
    _call_at = indirect_caller(_SIGNATURE)

    @inline
    def _call(address, hook, law_parameters, law_state, i, previous, trial, x):
        """Call the function with the number `hook` of a law (`_all_hooks`) at the address of its
        kernel.

        The address is stored as a float64 in the table of law states. This is exact because
        addresses have at most 48 bits.
        """
        return _call_at(int(address), hook, law_parameters, law_state, i, previous, trial, x)

else:

    def _call(address, hook, law_parameters, law_state, i, previous, trial, x):
        """Execute a function of a law in plain Python, if kernels are not compiled.

        The law is identified by its number in `law_parameters`. The address is not used.

        `address` is the address of the kernel; not used. `x` is the last argument of the function:
        drift (m) for `force`, event for `switch`, otherwise 0.

        Returns
        -------
        float
            Result of the function: the tangent stiffness (N/m) for `force`, the energy (J) for
            `strain_energy` and `hysteretic_energy`, and 0 for `keep`, `enter` and `switch`, which
            only change `law_state`.
        """
        return _kernel(int(law_parameters[rows.CODE, i])).function(
            hook, law_parameters, law_state, i, previous, trial, x
        )


@inline
def _force(law_parameters, law_state, i, previous, trial, drift):
    """Compute the force of a separately compiled law at a drift; return the tangent stiffness,
    N/m.
    """
    return _call(
        law_state[rows.ADDRESS, i], _FORCE, law_parameters, law_state, i, previous, trial, drift
    )


@inline
def _strain_energy(law_parameters, law_state, i):
    """Return the strain energy of the separately compiled law of story `i`, J."""
    return _call(
        law_state[rows.ADDRESS, i], _STRAIN_ENERGY, law_parameters, law_state, i, 0, 0, 0.0
    )


@inline
def _hysteretic_energy(law_parameters, law_state, i):
    """Return the dissipated energy of the separately compiled law of story `i`, J."""
    return _call(
        law_state[rows.ADDRESS, i], _HYSTERETIC_ENERGY, law_parameters, law_state, i, 0, 0, 0.0
    )


@inline
def _keep(law_parameters, law_state, i, previous, trial):
    """Commit the rows of a trial state that are specific to a separately compiled law."""
    _call(law_state[rows.ADDRESS, i], _KEEP, law_parameters, law_state, i, previous, trial, 0.0)


@inline
def _enter(law_parameters, law_state, i):
    """Set the first branch of story `i` with a separately compiled law."""
    _call(law_state[rows.ADDRESS, i], _ENTER, law_parameters, law_state, i, 0, 0, 0.0)


@inline
def _switch(law_parameters, law_state, i, block, event):
    """Set the branch that follows the current branch, for a separately compiled law."""
    _call(law_state[rows.ADDRESS, i], _SWITCH, law_parameters, law_state, i, block, 0, event)


_HOOKS = ("force", "strain_energy", "hysteretic_energy", "keep", "enter", "switch")
"""Names of the `LawFunctions` that a separately compiled law must have, in the order of their
numbers."""

SEPARATE_LAW_FUNCTIONS = branch_first(
    LawFunctions(
        force=_force,
        strain_energy=_strain_energy,
        hysteretic_energy=_hysteretic_energy,
        keep=_keep,
        enter=_enter,
        switch=_switch,
    )
)
"""Functions that call a separately compiled law. A path that remains on its branch requires no
call."""


# Placeholders for the functions of a single law. For each law, `_kernel` creates a copy of
# `_all_hooks` with these names replaced by the functions of the law.
force: Any = None
strain_energy: Any = None
hysteretic_energy: Any = None
keep: Any = None
enter: Any = None
switch: Any = None


def _all_hooks(hook, law_parameters, law_state, i, previous, trial, x):
    """Execute one function of a law, selected by its number; return the tangent stiffness (N/m) or
    the energy (J), 0 for functions without a result.

    This is the only kernel of a separately compiled law, so that one address per law is sufficient.
    `x` is the drift (m) for `force`, the event for `switch`, otherwise 0. For `switch`, `previous`
    is the block with the state that changes its branch.
    """
    if hook == _FORCE:
        return force(law_parameters, law_state, i, previous, trial, x)
    if hook == _STRAIN_ENERGY:
        return strain_energy(law_parameters, law_state, i)
    if hook == _HYSTERETIC_ENERGY:
        return hysteretic_energy(law_parameters, law_state, i)
    if hook == _KEEP:
        keep(law_parameters, law_state, i, previous, trial)
    elif hook == _ENTER:
        enter(law_parameters, law_state, i)
    else:
        switch(law_parameters, law_state, i, previous, x)
    return 0.0


@cache
def _kernel(code: int) -> Kernel:
    """Return the kernel with all functions of the law with number `code`: a copy of `_all_hooks`
    whose namespace defines the placeholders. Each law has one kernel per process.
    """
    functions = LAWS[code].functions()
    namespace = globals() | {hook: getattr(functions, hook) for hook in _HOOKS}
    function = python_types.FunctionType(_all_hooks.__code__, namespace, LAWS[code].name)
    function.__qualname__ = function.__name__
    function.__module__ = __name__
    return Kernel(function, _SIGNATURE, ())


def __getattr__(name: str) -> Kernel:
    """Return the kernel of the separately compiled law with this name.

    Python calls this function for a name that is not defined in this module. The process that
    compiles kernels thus finds the kernel of a law as an attribute of the module. AttributeError is
    raised if no separately compiled law has the name.
    """
    for code, law_name in enumerate(LAWS.names()):
        if law_name == name and LAWS[code].compiled_separately:
            return _kernel(code)
    raise AttributeError(name)


def separate_kernels(law_parameters: NDArray[np.float64] | None = None) -> list[Kernel]:
    """Return the kernels of the separately compiled laws."""
    codes = range(len(LAWS)) if law_parameters is None else _used_codes(law_parameters)
    return [_kernel(code) for code in codes if LAWS[code].compiled_separately]


@cache
def _address(code: int) -> float:
    """Return the address of the compiled code of the law with number `code`, as a float.

    The law is compiled if necessary. The result is 0 if kernels run in plain Python. It is cached.
    """
    return float(getattr(_kernel(code).compiled, "address", 0))


def _used_codes(law_parameters: NDArray[np.float64]) -> list[int]:
    """Return the numbers of the laws in a table, in ascending order.

    The column of zeros counts as the linear law; stories with elements have no law.
    """
    return sorted(
        set(law_parameters[rows.CODE].astype(int).tolist())
        - {int(code) for code in (rows.ELEMENTS, rows.CURVED_ELEMENTS)}
    )


def law_state_table(law_parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a new table of law states filled with zeros, except for the addresses of separately
    compiled laws and the values that mark a failed law.

    The function compiles the laws that are not yet compiled. After EXTRA_ROWS rows, the table has
    further rows for each block, the maximum of `DriftLaw.extra_rows` of the laws.
    """
    codes = law_parameters[rows.CODE].astype(int)
    used_codes = _used_codes(law_parameters)
    extra_rows = max((LAWS[code].extra_rows for code in used_codes), default=0)
    law_state = np.zeros(
        (rows.EXTRA_ROWS + rows.LAW_STATE_BLOCKS * extra_rows, law_parameters.shape[1])
    )
    # The row is a view of the table.
    for code in used_codes:
        if LAWS[code].compiled_separately:
            law_state[rows.ADDRESS][codes == code] = _address(code)
    if np.any(codes <= int(rows.ELEMENTS)):
        for code in used_codes:
            law_state[rows.FAILED_INTERNAL][codes == code] = LAWS[code].failed
    return law_state
