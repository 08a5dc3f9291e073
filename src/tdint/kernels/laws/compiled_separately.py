"""Laws that stand apart: compiled on their own, once a model has them, and called at their address.

They may be long without making the loops, which all models share, compile longer. A call at an
address costs some 10 ns more than one that the compiler sees; it is made where a way leaves its
branch (`branch_first`).
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

_SIGNATURE = F8(
    I8, TABLE, TABLE, I8, I8, I8, F8
)  # hook, laws, springs, i, past or block, trial, drift or event

# The functions of a law by number, as `_HOOKS` lists them
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
        """Call a kernel of `_SIGNATURE` at an address that a float64 holds (exactly: addresses have
        48 bits)."""
        return _call_at(int(address), hook, law_parameters, law_state, i, previous, trial, x)

else:

    def _call(address, hook, law_parameters, law_state, i, previous, trial, x):
        """Where nothing is compiled no address is needed."""
        return _kernel(int(law_parameters[rows.CODE, i])).function(
            hook, law_parameters, law_state, i, previous, trial, x
        )


@inline
def _force(law_parameters, law_state, i, previous, trial, drift):
    return _call(
        law_state[rows.ADDRESS, i], _FORCE, law_parameters, law_state, i, previous, trial, drift
    )


@inline
def _strain_energy(law_parameters, law_state, i):
    return _call(
        law_state[rows.ADDRESS, i], _STRAIN_ENERGY, law_parameters, law_state, i, 0, 0, 0.0
    )


@inline
def _hysteretic_energy(law_parameters, law_state, i):
    return _call(
        law_state[rows.ADDRESS, i], _HYSTERETIC_ENERGY, law_parameters, law_state, i, 0, 0, 0.0
    )


@inline
def _keep(law_parameters, law_state, i, previous, trial):
    _call(law_state[rows.ADDRESS, i], _KEEP, law_parameters, law_state, i, previous, trial, 0.0)


@inline
def _enter(law_parameters, law_state, i):
    _call(law_state[rows.ADDRESS, i], _ENTER, law_parameters, law_state, i, 0, 0, 0.0)


@inline
def _switch(law_parameters, law_state, i, block, event):
    _call(law_state[rows.ADDRESS, i], _SWITCH, law_parameters, law_state, i, block, 0, event)


_HOOKS = ("force", "strain_energy", "hysteretic_energy", "keep", "enter", "switch")
"""The functions of `LawFunctions` that a law that stands apart has, all of them, by their
number."""

CALLING = branch_first(
    LawFunctions(
        force=_force,
        strain_energy=_strain_energy,
        hysteretic_energy=_hysteretic_energy,
        keep=_keep,
        enter=_enter,
        switch=_switch,
    )
)
"""Functions that call those of a law that stands apart; not where a way keeps to its branch, which
needs no law."""


# The functions of one law, put in by `_kernel`
force: Any = None
strain_energy: Any = None
hysteretic_energy: Any = None
keep: Any = None
enter: Any = None
switch: Any = None


def _all_hooks(hook, law_parameters, law_state, i, previous, trial, x):
    """The functions of one law as one."""
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
    """`_all_hooks` of one law."""
    functions = LAWS[code].functions()
    names = globals() | {hook: getattr(functions, hook) for hook in _HOOKS}
    hooks = python_types.FunctionType(_all_hooks.__code__, names, LAWS[code].name)
    hooks.__qualname__ = hooks.__name__
    hooks.__module__ = __name__
    return Kernel(hooks, _SIGNATURE, ())


def __getattr__(name: str) -> Kernel:
    """The kernel of the law called `name`, for the process that compiles it."""
    for code, law in enumerate(LAWS):
        if law.apart and law.name == name:
            return _kernel(code)
    raise AttributeError(name)


def kernels_apart(law_parameters: NDArray[np.float64] | None = None) -> list[Kernel]:
    """The kernels of the laws that stand apart: those in a table of laws, or all."""
    codes = (
        range(len(LAWS))
        if law_parameters is None
        else sorted(set(law_parameters[rows.CODE, :-1].astype(int).tolist()))
    )
    return [_kernel(code) for code in codes if LAWS[code].apart]


@cache
def _address(code: int) -> float:
    return float(getattr(_kernel(code).compiled, "address", 0))


def spring_table(law_parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """A fresh table of the state of drift laws (`tdint.kernels.layout`); what they need is
    compiled."""
    codes = law_parameters[rows.CODE, :-1].astype(int)
    kinds = sorted(set(codes.tolist()))
    extra_rows = max((LAWS[code].extra_rows for code in kinds), default=0)
    law_state = np.zeros(
        (rows.EXTRA_ROWS + rows.LAW_STATE_BLOCKS * extra_rows, law_parameters.shape[1])
    )
    for code in kinds:
        if LAWS[code].apart:
            law_state[rows.ADDRESS, :-1][codes == code] = _address(code)
    return law_state
