"""Compiled functions that go by the law of a story."""

from __future__ import annotations

from collections.abc import Callable, Container
from functools import cache
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.compiling import COMPILES, VARIANT, inline, specialized
from tdint.kernels.laws import LAWS
from tdint.kernels.laws.compiled_separately import CALLING
from tdint.kernels.laws.law import DriftLaw, LawFunctions


@cache
def _functions(law: DriftLaw) -> LawFunctions:
    return CALLING if law.apart else law.functions()


class _Codes:
    """The numbers of laws where nothing is compiled: laws of plug-ins come later than this is
    imported."""

    def __init__(self, has: Callable[[DriftLaw], bool]) -> None:
        self.has = has

    def __contains__(self, code: Any) -> bool:
        return self.has(LAWS[int(code)])


def _codes(has: Callable[[DriftLaw], bool]) -> Container[float]:
    return (
        tuple(float(code) for code, law in enumerate(LAWS) if has(law)) if COMPILES else _Codes(has)
    )


_NAMED = {name.partition("@")[0] for name in VARIANT.laws}

COMPILED = tuple(code for code, law in enumerate(LAWS) if not _NAMED or law.name in _NAMED)
"""The laws that the kernels are compiled for."""

CURVED = _codes(lambda law: law.curved)

CURVES = any(LAWS[code].curved for code in COMPILED)
"""Whether a law may be curved."""

CURVING = VARIANT.dashpots or CURVES
"""Whether a story may have a force that is not linear branch by branch."""

BENDING = CURVING or any(LAWS[code].kinked for code in COMPILED)
"""Whether a story may have a force that is not linear in its motion."""

ANY_APART = any(LAWS[code].apart for code in COMPILED)
"""Whether a law may stand apart: the stiffness of such a one's branches may hang on what the story
has done before."""

# The first laws are put into each place that goes by the law, and so is what laws that stand apart
# have in common: a look at the branch, then a call at the law's address. The others are compiled
# once, together, and called: compiling the loops takes long enough.
_FREQUENT = 2

_APART = -1
"""Stands for all laws that stand apart, where those of the others are numbers."""

# Laws that know their branch at any time
KNOWING = _codes(lambda law: _functions(law).keep is not None)

# Laws with a memory
DISSIPATING = _codes(lambda law: _functions(law).accumulate_dissipation is not None)


def chosen(hook: str, case: Callable[[Any, int, Any, Any], Any], otherwise: Any = None) -> Any:
    """The compiled function that calls that of a story's own law; `otherwise` for laws without one.

    `hook` is a name in `LawFunctions`. `case` links one law's function with the others':
    `case_of_3`, and so on by the number of arguments. No call is made for a frequent law or one
    that stands apart, whether it has a function or not.
    """
    if not COMPILES:
        return lambda law_parameters, law_state, i, *more: (
            getattr(_functions(LAWS[int(law_parameters[rows.CODE, i])]), hook) or otherwise
        )(law_parameters, law_state, i, *more)
    places = _places()
    all_of_them = [
        (code, getattr(CALLING if code == _APART else _functions(LAWS[code]), hook))
        for code in places
    ]
    owns = [(code, own or (otherwise if code < _FREQUENT else None)) for code, own in all_of_them]
    owns = [(code, own) for code, own in owns if own is not None]
    rare = next((code for code, _ in owns if code >= _FREQUENT), None)
    # Where each has its own the last one is taken for any other number: there is none.
    function = otherwise if len(owns) < len(all_of_them) or not owns else None
    for code, own in reversed(owns):
        decorate = specialized if code == rare else inline
        function = own if function is None else case(decorate, _test(code), own, function)
    return function


def _places() -> list[int]:
    """The numbers of the compiled laws in the order in which a story's own is looked for, `_APART`
    behind the frequent ones."""
    apart = [_APART] if ANY_APART else []
    others = [code for code in COMPILED if not LAWS[code].apart]
    frequent = [code for code in others if code < _FREQUENT]
    return [*frequent, *apart, *others[len(frequent) :]]


@inline
def _stands_apart(law_parameters, law_state, i):
    return law_state[rows.ADDRESS, i] != 0.0


def _test(code: int) -> Any:
    """A function of (law_parameters, law_state, i): whether the story has the law, or one that
    stands
    apart."""
    if code == _APART:
        return _stands_apart

    @inline
    def has(law_parameters, law_state, i):
        return law_parameters[rows.CODE, i] == code

    return has


def case_of_3(decorate: Any, has: Any, own: Any, other: Any) -> Any:
    """`own` where `has` says so, else `other`: functions of (law_parameters, law_state, i)."""

    @decorate
    def choose(law_parameters, law_state, i):
        if has(law_parameters, law_state, i):
            return own(law_parameters, law_state, i)
        return other(law_parameters, law_state, i)

    return choose


def case_of_4(decorate: Any, has: Any, own: Any, other: Any) -> Any:
    """The same for functions of four arguments."""

    @decorate
    def choose(law_parameters, law_state, i, more):
        if has(law_parameters, law_state, i):
            return own(law_parameters, law_state, i, more)
        return other(law_parameters, law_state, i, more)

    return choose


def case_of_5(decorate: Any, has: Any, own: Any, other: Any) -> Any:
    """The same for functions of five arguments."""

    @decorate
    def choose(law_parameters, law_state, i, block, more):
        if has(law_parameters, law_state, i):
            return own(law_parameters, law_state, i, block, more)
        return other(law_parameters, law_state, i, block, more)

    return choose


def case_of_6(decorate: Any, has: Any, own: Any, other: Any) -> Any:
    """The same for functions of six arguments."""

    @decorate
    def choose(law_parameters, law_state, i, block, more, last):
        if has(law_parameters, law_state, i):
            return own(law_parameters, law_state, i, block, more, last)
        return other(law_parameters, law_state, i, block, more, last)

    return choose
