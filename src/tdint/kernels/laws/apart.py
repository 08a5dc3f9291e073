"""Laws that stand apart: compiled on their own, once a model has them, and called at their address.

They may be long without making the loops, which all models share, compile longer. A call at an address costs some 10 ns
more than one that the compiler sees.
"""

from __future__ import annotations

import types as python_types
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from tdint.kernels.compiling import F8, I8, TABLE, Kernel, inlined
from tdint.kernels.laws import LAWS
from tdint.kernels.layout import ADDRESS, CODE, FURTHER, SPRING_BLOCKS

_SIGNATURE = F8(I8, TABLE, TABLE, I8, I8, I8, F8)  # hook, laws, springs, i, past or block, trial, drift or event
_FORCE = 0
_RECOVERABLE = 1
_DISSIPATED = 2
_KEEP = 3
_ENTER = 4
_SWITCH = 5


@intrinsic
def _call(typing_context, address, hook, laws, springs, i, past, trial, x):
    """Call a compiled function of `_SIGNATURE` at an address that a float64 holds (exactly: addresses have 48 bits)."""

    def generate(context, builder, _, arguments):
        inner = ir.FunctionType(
            context.get_value_type(_SIGNATURE.return_type), [context.get_value_type(one) for one in _SIGNATURE.args]
        )
        pointer = builder.inttoptr(builder.fptoui(arguments[0], cgutils.intp_t), inner.as_pointer())
        return context.call_function_pointer(builder, pointer, arguments[1:])

    return F8(types.float64, *_SIGNATURE.args), generate


@inlined
def _force(laws, springs, i, past, trial, drift):
    return _call(springs[ADDRESS, i], _FORCE, laws, springs, i, past, trial, drift)


@inlined
def _recoverable(laws, springs, i):
    return _call(springs[ADDRESS, i], _RECOVERABLE, laws, springs, i, 0, 0, 0.0)


@inlined
def _dissipated(laws, springs, i):
    return _call(springs[ADDRESS, i], _DISSIPATED, laws, springs, i, 0, 0, 0.0)


@inlined
def _keep(laws, springs, i, past, trial):
    _call(springs[ADDRESS, i], _KEEP, laws, springs, i, past, trial, 0.0)


@inlined
def _enter(laws, springs, i):
    _call(springs[ADDRESS, i], _ENTER, laws, springs, i, 0, 0, 0.0)


@inlined
def _switch(laws, springs, i, block, event):
    _call(springs[ADDRESS, i], _SWITCH, laws, springs, i, block, 0, event)


HOOKS = {
    "force": _force,
    "recoverable": _recoverable,
    "dissipated": _dissipated,
    "keep": _keep,
    "enter": _enter,
    "switch": _switch,
}
"""The functions of `LawFunctions` that a law that stands apart has, all of them; these call its own."""


# The functions of one law, put in by `_kernel`
force: Any = None
recoverable: Any = None
dissipated: Any = None
keep: Any = None
enter: Any = None
switch: Any = None


def _all_hooks(hook, laws, springs, i, past, trial, x):
    """The functions of one law as one."""
    if hook == _FORCE:
        return force(laws, springs, i, past, trial, x)
    if hook == _RECOVERABLE:
        return recoverable(laws, springs, i)
    if hook == _DISSIPATED:
        return dissipated(laws, springs, i)
    if hook == _KEEP:
        keep(laws, springs, i, past, trial)
    elif hook == _ENTER:
        enter(laws, springs, i)
    else:
        switch(laws, springs, i, past, x)
    return 0.0


@cache
def _kernel(code: int) -> Kernel:
    """`_all_hooks` of one law. By globals, not by a closure: that could not be found again in the cache of numba, which
    tells functions apart by their name."""
    functions = LAWS[code].functions()
    names = globals() | {hook: getattr(functions, hook) for hook in HOOKS}
    own = python_types.FunctionType(_all_hooks.__code__, names, f"law_{code}")
    own.__qualname__ = own.__name__
    own.__module__ = __name__
    return Kernel(own, _SIGNATURE, allocates=False)


@cache
def _address(code: int) -> float:
    compiled = _kernel(code).compiled
    result = compiled.overloads[_SIGNATURE.args]
    return float(result.library.get_pointer_to_function(result.fndesc.llvm_cfunc_wrapper_name))


def spring_table(laws: NDArray[np.float64]) -> NDArray[np.float64]:
    """A fresh table of the state of drift laws (`tdint.kernels.layout`); what they need is compiled."""
    codes = laws[CODE, :-1].astype(int)
    kinds = np.unique(codes).tolist()
    further = max((LAWS[code].further for code in kinds), default=0)
    springs = np.zeros((FURTHER + SPRING_BLOCKS * further, laws.shape[1]))
    for code in kinds:
        if LAWS[code].apart:
            springs[ADDRESS, :-1][codes == code] = _address(code)
    return springs
