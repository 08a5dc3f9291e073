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

from tdint.kernels import layout as at
from tdint.kernels.compiling import COMPILES, F8, I8, TABLE, Kernel, called_at, inlined
from tdint.kernels.laws import LAWS
from tdint.kernels.laws.law import LawFunctions
from tdint.kernels.laws.walking import branch_first

_SIGNATURE = F8(
    I8, TABLE, TABLE, I8, I8, I8, F8
)  # hook, laws, springs, i, past or block, trial, drift or event

# The functions of a law by number, as `_HOOKS` lists them
_FORCE = 0
_RECOVERABLE = 1
_DISSIPATED = 2
_KEEP = 3
_ENTER = 4
_SWITCH = 5


if COMPILES:
    _call_at = called_at(_SIGNATURE)

    @inlined
    def _call(address, hook, law_parameters, springs, i, past, trial, x):
        """Call a kernel of `_SIGNATURE` at an address that a float64 holds (exactly: addresses have
        48 bits)."""
        return _call_at(int(address), hook, law_parameters, springs, i, past, trial, x)

else:

    def _call(address, hook, law_parameters, springs, i, past, trial, x):
        """Where nothing is compiled no address is needed."""
        return _kernel(int(law_parameters[at.CODE, i])).function(
            hook, law_parameters, springs, i, past, trial, x
        )


@inlined
def _force(law_parameters, springs, i, past, trial, drift):
    return _call(springs[at.ADDRESS, i], _FORCE, law_parameters, springs, i, past, trial, drift)


@inlined
def _recoverable(law_parameters, springs, i):
    return _call(springs[at.ADDRESS, i], _RECOVERABLE, law_parameters, springs, i, 0, 0, 0.0)


@inlined
def _dissipated(law_parameters, springs, i):
    return _call(springs[at.ADDRESS, i], _DISSIPATED, law_parameters, springs, i, 0, 0, 0.0)


@inlined
def _keep(law_parameters, springs, i, past, trial):
    _call(springs[at.ADDRESS, i], _KEEP, law_parameters, springs, i, past, trial, 0.0)


@inlined
def _enter(law_parameters, springs, i):
    _call(springs[at.ADDRESS, i], _ENTER, law_parameters, springs, i, 0, 0, 0.0)


@inlined
def _switch(law_parameters, springs, i, block, event):
    _call(springs[at.ADDRESS, i], _SWITCH, law_parameters, springs, i, block, 0, event)


_HOOKS = ("force", "recoverable", "dissipated", "keep", "enter", "switch")
"""The functions of `LawFunctions` that a law that stands apart has, all of them, by their
number."""

CALLING = branch_first(
    LawFunctions(
        force=_force,
        recoverable=_recoverable,
        dissipated=_dissipated,
        keep=_keep,
        enter=_enter,
        switch=_switch,
    )
)
"""Functions that call those of a law that stands apart; not where a way keeps to its branch, which
needs no law."""


# The functions of one law, put in by `_kernel`
force: Any = None
recoverable: Any = None
dissipated: Any = None
keep: Any = None
enter: Any = None
switch: Any = None


def _all_hooks(hook, law_parameters, springs, i, past, trial, x):
    """The functions of one law as one."""
    if hook == _FORCE:
        return force(law_parameters, springs, i, past, trial, x)
    if hook == _RECOVERABLE:
        return recoverable(law_parameters, springs, i)
    if hook == _DISSIPATED:
        return dissipated(law_parameters, springs, i)
    if hook == _KEEP:
        keep(law_parameters, springs, i, past, trial)
    elif hook == _ENTER:
        enter(law_parameters, springs, i)
    else:
        switch(law_parameters, springs, i, past, x)
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
        else sorted(set(law_parameters[at.CODE, :-1].astype(int).tolist()))
    )
    return [_kernel(code) for code in codes if LAWS[code].apart]


@cache
def _address(code: int) -> float:
    return float(getattr(_kernel(code).compiled, "address", 0))


def spring_table(law_parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """A fresh table of the state of drift laws (`tdint.kernels.layout`); what they need is
    compiled."""
    codes = law_parameters[at.CODE, :-1].astype(int)
    kinds = sorted(set(codes.tolist()))
    extra_rows = max((LAWS[code].extra_rows for code in kinds), default=0)
    springs = np.zeros((at.EXTRA_ROWS + at.SPRING_BLOCKS * extra_rows, law_parameters.shape[1]))
    for code in kinds:
        if LAWS[code].apart:
            springs[at.ADDRESS, :-1][codes == code] = _address(code)
    return springs
