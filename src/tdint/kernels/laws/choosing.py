"""Compiled functions that go by the law of a story."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tdint.kernels import layout as at
from tdint.kernels.compiling import VARIANT, called, inlined, specialized
from tdint.kernels.laws import LAWS
from tdint.kernels.laws.compiled_separately import HOOKS
from tdint.kernels.laws.law import LawFunctions

FUNCTIONS = tuple(LawFunctions(**HOOKS) if law.apart else law.functions() for law in LAWS)

_NAMED = {name.partition("@")[0] for name in VARIANT.laws}

COMPILED = tuple(code for code, law in enumerate(LAWS) if not _NAMED or law.name in _NAMED)
"""The laws that the kernels are compiled for."""

CURVED = tuple(float(code) for code, law in enumerate(LAWS) if law.curved)

CURVES = any(LAWS[code].curved for code in COMPILED)
"""Whether a law may be curved."""

CURVING = VARIANT.dashpots or CURVES
"""Whether a story may have a force that is not linear branch by branch."""

BENDING = CURVING or any(LAWS[code].kinked for code in COMPILED)
"""Whether a story may have a force that is not linear in its motion."""

# The first laws are put into each place that goes by the law; the others are compiled once, together, and called:
# compiling the loops takes long enough. The functions of laws that stand apart only call those at their address.
_FREQUENT = 2

# Laws that know their branch at any time
KNOWING = tuple(float(code) for code, functions in enumerate(FUNCTIONS) if functions.keep is not None)

# Laws with a memory
DISSIPATING = tuple(float(code) for code, functions in enumerate(FUNCTIONS) if functions.settle is not None)


def chosen(hook: str, case: Callable[[Any, int, Any, Any], Any], otherwise: Any = None, rarely: Any = None) -> Any:
    """The compiled function that calls that of a story's own law; `otherwise` for laws without one, or, if it is given,
    `rarely` for those of them that are not put into each place.

    `hook` is a name in `LawFunctions`. `case` links one law's function with the others': `case_of_3`, and so on by the
    number of arguments. No call is made for a frequent law, whether it has a function or not.
    """
    owns = [(code, getattr(FUNCTIONS[code], hook)) for code in COMPILED]
    owns = [(code, own or (otherwise if code < _FREQUENT else None)) for code, own in owns]
    owns = [(code, own) for code, own in owns if own is not None]
    rare = min((code for code, _ in owns if code >= _FREQUENT), default=None)
    function = otherwise if rarely is None or max(COMPILED) < _FREQUENT else called(rarely)
    for code, own in reversed(owns):
        function = own if function is None else case(specialized if code == rare else inlined, code, own, function)
    return function


def case_of_3(decorate: Any, code: int, own: Any, other: Any) -> Any:
    """`own` where the story has the law `code`, else `other`: functions of (law_parameters, springs, i)."""

    @decorate
    def choose(law_parameters, springs, i):
        if law_parameters[at.CODE, i] == code:
            return own(law_parameters, springs, i)
        return other(law_parameters, springs, i)

    return choose


def case_of_4(decorate: Any, code: int, own: Any, other: Any) -> Any:
    """The same for functions of four arguments."""

    @decorate
    def choose(law_parameters, springs, i, more):
        if law_parameters[at.CODE, i] == code:
            return own(law_parameters, springs, i, more)
        return other(law_parameters, springs, i, more)

    return choose


def case_of_5(decorate: Any, code: int, own: Any, other: Any) -> Any:
    """The same for functions of five arguments."""

    @decorate
    def choose(law_parameters, springs, i, block, more):
        if law_parameters[at.CODE, i] == code:
            return own(law_parameters, springs, i, block, more)
        return other(law_parameters, springs, i, block, more)

    return choose


def case_of_6(decorate: Any, code: int, own: Any, other: Any) -> Any:
    """The same for functions of six arguments."""

    @decorate
    def choose(law_parameters, springs, i, block, more, last):
        if law_parameters[at.CODE, i] == code:
            return own(law_parameters, springs, i, block, more, last)
        return other(law_parameters, springs, i, block, more, last)

    return choose
