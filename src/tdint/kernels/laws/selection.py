"""Compiled functions that select the drift law of a story by its number.

`select_function` builds a chain of conditions that calls the function of the law of each story. The
constants of this module state which features the laws of the compiled variant have; the compiler
omits code for other features.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from functools import cache
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.compiling import COMPILES, VARIANT, inline, specialized
from tdint.kernels.laws import LAWS
from tdint.kernels.laws.compiled_separately import SEPARATE_LAW_FUNCTIONS
from tdint.kernels.laws.law import DriftLaw, LawFunctions


@cache
def _functions(law: DriftLaw) -> LawFunctions:
    """Return the functions of a law; of a separately compiled law, the functions that call it."""
    return SEPARATE_LAW_FUNCTIONS if law.compiled_separately else law.functions()


class _Codes:
    """Numbers of the laws with a property, if kernels run as Python functions.

    The property is evaluated on each test, because plug-ins can register laws later.
    """

    def __init__(self, has: Callable[[DriftLaw], bool]) -> None:
        """Store the property `has`."""
        self.has = has

    def __contains__(self, code: Any) -> bool:
        """Return True if the law with number `code` has the property."""
        return self.has(LAWS[int(code)])


def _codes(has: Callable[[DriftLaw], bool]) -> Container[float]:
    """Return a container of the numbers of the laws for which `has` is True, for tests with
    `in`."""
    return (
        tuple(float(code) for code, law in enumerate(LAWS) if has(law)) if COMPILES else _Codes(has)
    )


_NAMED = {name.partition("@")[0] for name in VARIANT.laws}

COMPILED = tuple(code for code, law in enumerate(LAWS) if not _NAMED or law.name in _NAMED)
"""Numbers of the laws for which the kernels are compiled."""

CURVED_LAWS = _codes(lambda law: law.curved)

HAS_CURVED_LAW = any(LAWS[code].curved for code in COMPILED)
"""True if a law of the variant is curved."""

HAS_CURVED_FORCE = VARIANT.dashpots or HAS_CURVED_LAW
"""True if a story can have a force that is not piecewise linear: a curved law or a power-law
dashpot."""

HAS_NONLINEAR_FORCE = HAS_CURVED_FORCE or any(LAWS[code].kinked for code in COMPILED)
"""True if a story can have a force that is not linear in its motion."""

HAS_SEPARATE_LAW = any(LAWS[code].compiled_separately for code in COMPILED)
"""True if a law of the variant is compiled separately. The stiffness of its branches can depend on
the response history."""

# The first laws are inlined wherever a law is selected, as is the common part of all separately
# compiled laws (a test of the branch, then a call by address). The other laws are compiled once,
# together, and called, because compiling the time loops takes several seconds.
_FREQUENT = 2
"""Number of laws that are inlined: linear and bilinear."""

_SEPARATE = -1
"""Number that represents all separately compiled laws in the order of selection."""

# Numbers of the laws that store their branch in every state.
BRANCH_STORING_LAWS = _codes(lambda law: _functions(law).keep is not None)

# Numbers of the laws that accumulate their dissipated energy.
DISSIPATING_LAWS = _codes(lambda law: _functions(law).accumulate_dissipation is not None)


def select_function(
    hook: str, case: Callable[[Any, int, Any, Any], Any], otherwise: Any = None
) -> Any:
    """Return the compiled function that calls the function `hook` of the law of a story.

    The call is omitted for a frequent law and for a separately compiled law without this function.

    Parameters
    ----------
    hook : str
        Name of an attribute of `LawFunctions`.
    case : callable
        Function that combines the function of one law with the function of the remaining laws:
        `case_with_3_arguments` to `case_with_6_arguments`, by the number of arguments.
    otherwise : function, optional
        Function for laws whose attribute is None.

    Returns
    -------
    function
        (law_parameters, law_state, i, ...), as the selected functions.
    """
    if not COMPILES:
        return lambda law_parameters, law_state, i, *more: (
            getattr(_functions(LAWS[int(law_parameters[rows.CODE, i])]), hook) or otherwise
        )(law_parameters, law_state, i, *more)
    order = _selection_order()
    candidates = [
        (
            code,
            getattr(SEPARATE_LAW_FUNCTIONS if code == _SEPARATE else _functions(LAWS[code]), hook),
        )
        for code in order
    ]
    implementations = [
        (code, implementation or (otherwise if code < _FREQUENT else None))
        for code, implementation in candidates
    ]
    implementations = [
        (code, implementation)
        for code, implementation in implementations
        if implementation is not None
    ]
    first_rare = next((code for code, _ in implementations if code >= _FREQUENT), None)
    # If each law has a function, the function of the last law is also used for any other number,
    # which does not occur.
    function = otherwise if len(implementations) < len(candidates) or not implementations else None
    for code, implementation in reversed(implementations):
        decorate = specialized if code == first_rare else inline
        function = (
            implementation
            if function is None
            else case(decorate, _test(code), implementation, function)
        )
    return function


def _selection_order() -> list[int]:
    """Return the numbers of the compiled laws in the order of the tests, with `_SEPARATE` after the
    frequent laws."""
    separate = [_SEPARATE] if HAS_SEPARATE_LAW else []
    remaining = [code for code in COMPILED if not LAWS[code].compiled_separately]
    frequent = [code for code in remaining if code < _FREQUENT]
    return [*frequent, *separate, *remaining[len(frequent) :]]


@inline
def _is_separate(law_parameters, law_state, i):
    """Return True if the law of story `i` is compiled separately."""
    return law_state[rows.ADDRESS, i] != 0.0


def _test(code: int) -> Any:
    """Return a function (law_parameters, law_state, i) that returns True if the story has the law
    `code`, or a separately compiled law for `_SEPARATE`."""
    if code == _SEPARATE:
        return _is_separate

    @inline
    def has(law_parameters, law_state, i):
        return law_parameters[rows.CODE, i] == code

    return has


def case_with_3_arguments(decorate: Any, has: Any, implementation: Any, other: Any) -> Any:
    """Return a function that calls `implementation` if `has` returns True, and otherwise `other`.

    Parameters
    ----------
    decorate : callable
        Decorator of the result: `inline` or `specialized`.
    has : function
        (law_parameters, law_state, i) -> bool.
    implementation, other : function
        Functions of three arguments (law_parameters, law_state, i).
    """

    @decorate
    def choose(law_parameters, law_state, i):
        if has(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i)
        return other(law_parameters, law_state, i)

    return choose


def case_with_4_arguments(decorate: Any, has: Any, implementation: Any, other: Any) -> Any:
    """Return the function of `case_with_3_arguments` for functions of four arguments."""

    @decorate
    def choose(law_parameters, law_state, i, more):
        if has(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i, more)
        return other(law_parameters, law_state, i, more)

    return choose


def case_with_5_arguments(decorate: Any, has: Any, implementation: Any, other: Any) -> Any:
    """Return the function of `case_with_3_arguments` for functions of five arguments."""

    @decorate
    def choose(law_parameters, law_state, i, block, more):
        if has(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i, block, more)
        return other(law_parameters, law_state, i, block, more)

    return choose


def case_with_6_arguments(decorate: Any, has: Any, implementation: Any, other: Any) -> Any:
    """Return the function of `case_with_3_arguments` for functions of six arguments."""

    @decorate
    def choose(law_parameters, law_state, i, block, more, last):
        if has(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i, block, more, last)
        return other(law_parameters, law_state, i, block, more, last)

    return choose
