"""Compiled functions that select the drift law of a story by its number.

`select_function` builds a chain of conditions that calls the function of the law of each story. The
constants of the module state which features the laws of the compiled variant have; the compiler
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
    """Return the functions of a law that kernels call; a separately compiled law is called by its
    address.

    The result is cached, because `law.functions` creates new functions at each call.
    """
    return SEPARATE_LAW_FUNCTIONS if law.compiled_separately else law.functions()


class _Codes:
    """Container of the numbers of all laws with a property, for kernels that run in plain Python.

    The property is evaluated for each test with `in`, because plug-ins can register laws later.
    """

    def __init__(self, has_property: Callable[[DriftLaw], bool]) -> None:
        """Store the function `has_property`, which returns True for a law with the property."""
        self.has_property = has_property

    def __contains__(self, code: Any) -> bool:
        """Return True if the law with number `code` has the property."""
        return self.has_property(LAWS[int(code)])


def _codes(has_property: Callable[[DriftLaw], bool]) -> Container[float]:
    """Return a container of the numbers of all laws with a property.

    Compiled kernels need a tuple of constants. Kernels in plain Python use a `_Codes` instead,
    because a tuple would not contain the laws that plug-ins register later.
    """
    if not COMPILES:
        return _Codes(has_property)
    return tuple(float(code) for code, law in enumerate(LAWS) if has_property(law))


_VARIANT_LAWS = {name.partition("@")[0] for name in VARIANT.laws}

COMPILED = tuple(
    code for code, name in enumerate(LAWS.names()) if not _VARIANT_LAWS or name in _VARIANT_LAWS
)
"""Numbers of the laws for which the kernels are compiled."""

CURVED_LAWS = _codes(lambda law: law.curved)
"""Numbers of the laws with curved branches."""


# Kernels that run in plain Python contain all laws.
HAS_CURVED_LAW = not COMPILES or any(LAWS[code].curved for code in COMPILED)
"""True if a law of the variant is curved."""

HAS_CURVED_FORCE = VARIANT.dashpots or VARIANT.tangent_damping or HAS_CURVED_LAW
"""True if a story can have a force that is not piecewise linear: a curved law, a power-law
dashpot or tangent damping."""

HAS_NONLINEAR_FORCE = HAS_CURVED_FORCE or any(LAWS[code].kinked for code in COMPILED)
"""True if a story can have a force that is not linear in its motion."""

HAS_SEPARATE_LAW = not COMPILES or any(LAWS[code].compiled_separately for code in COMPILED)
"""True if a law of the variant is compiled separately. The stiffness of its branches can depend on
the response history."""

MAX_BRANCHES = 100 if not COMPILES else max(LAWS[code].max_branches for code in COMPILED)
"""Maximum number of changes of branch of a story on a monotonic path."""

HAS_ELEMENTS = VARIANT.elements
"""True if a story can have several elements (`tdint.kernels.layout.ELEMENTS`)."""

# The functions of the laws with the smallest numbers, and the common function of all separately
# compiled laws, are inlined at each place where a law is selected. The functions of the other laws
# are compiled only once and are called, because inlining them would increase the compile time of
# the time loops, which is several seconds.
_FREQUENT = 2
"""Number of laws that are inlined: linear and bilinear."""

_SEPARATE = -1
"""Number that represents all separately compiled laws in the result of `_selection_order`."""

BRANCH_STORING_LAWS = _codes(lambda law: _functions(law).keep is not None)

DISSIPATING_LAWS = _codes(lambda law: _functions(law).accumulate_dissipation is not None)


def select_function(
    hook: str, case: Callable[[Any, int, Any, Any], Any], otherwise: Any = None
) -> Any:
    """Return a compiled function that calls the function `hook` of the law of a story.

    Each law has a number (`code`). The result is a chain of conditions on the number, like

        linear law if code == 0, bilinear law if code == 1, ..., otherwise

    The chain tests three groups of laws in this order:

        group       laws                                     code                       condition
        frequent    linear and bilinear                      0 to _FREQUENT - 1         inlined
        separate    all laws that are compiled separately    _SEPARATE (-1) for all     inlined
        rare        all other laws                           _FREQUENT and more         called

    "Inlined" means that the condition and the function behind it become a part of each caller. For
    the separate laws, it is a short function that calls the compiled code of the law by address.
    The conditions and functions of all rare laws are compiled as a single function.

    Laws without the function `hook` use the function `otherwise` instead. A rare law without `hook`
    has no condition. A frequent or separate law without `hook` has one, so that the call of the
    function for the rare laws is avoided.

    Parameters
    ----------
    hook : str
        Name of an attribute of `LawFunctions`.
    case : callable
        Function that combines the function of a single law with the function of the remaining laws:
        `case_with_3_arguments` to `case_with_6_arguments`, by the number of arguments.
    otherwise : function, optional
        Default for laws without this function (their attribute is None). It is required unless
        every law has the function, for example `force` and `strain_energy`.
    """
    if not COMPILES:

        def call(law_parameters, law_state, i, *arguments):
            """Call the function `hook` of the law of story `i`, or `otherwise` if the law has no
            such function.

            `law_parameters` and `law_state` are the tables of the parameters and states of all
            laws; row CODE of the parameters contains the number of the law, which is not negative.
            Further arguments are passed on unchanged.
            """
            functions = _functions(LAWS[int(law_parameters[rows.CODE, i])])
            function = getattr(functions, hook) or otherwise
            return function(law_parameters, law_state, i, *arguments)

        return call
    order = _selection_order()
    # `code < _FREQUENT` is also true for the separate laws, because _SEPARATE is -1.
    implementations = []
    for code in order:
        functions = SEPARATE_LAW_FUNCTIONS if code == _SEPARATE else _functions(LAWS[code])
        implementation = getattr(functions, hook) or (otherwise if code < _FREQUENT else None)
        if implementation is not None:
            implementations.append((code, implementation))
    first_rare = next((code for code, _ in implementations if code >= _FREQUENT), None)
    # The chain is built from its end to its start, because each law calls the remaining chain if
    # its condition is false. There are two cases for the end of the chain:
    # - A law has no condition: the end is `otherwise`.
    # - Each law has a condition: the end is the function of the last law, without its condition,
    #   because no other law remains.
    # Examples for the laws 0, 1, 5 and 6 with the functions f0, f1, f5 and f6, where decorator(5,
    # f5, rest) represents case(decorator, _test(5), f5, rest):
    #     all functions exist        inline(0, f0, inline(1, f1, specialized(5, f5, f6)))
    #     f6 is missing              inline(0, f0, inline(1, f1, specialized(5, f5, otherwise)))
    #     only laws 0, 1 and 5       inline(0, f0, inline(1, f1, f5))
    has_other_laws = len(implementations) < len(order) or not implementations
    function = otherwise if has_other_laws else None
    # Only the condition of the first rare law is compiled as a function that is called
    # (`specialized`); it contains all later conditions.
    for code, implementation in reversed(implementations):
        decorate = specialized if code == first_rare else inline
        if function is None:
            function = implementation
        else:
            function = case(decorate, _test(code), implementation, function)
    return function


def _selection_order() -> list[int]:
    """Return the number of each law of the variant, in the order of the tests in kernels."""
    # COMPILED is sorted by number.
    separate = [_SEPARATE] if HAS_SEPARATE_LAW else []
    remaining = [code for code in COMPILED if not LAWS[code].compiled_separately]
    frequent = [code for code in remaining if code < _FREQUENT]
    return [*frequent, *separate, *remaining[len(frequent) :]]


@inline
def _is_separate(law_parameters, law_state, i):
    """Return True if the law of story `i` is compiled separately.

    The address of its compiled code, row ADDRESS of the table `law_state`, is then not 0. The
    argument `law_parameters` is not used.
    """
    return law_state[rows.ADDRESS, i] != 0.0


def _test(code: int) -> Any:
    """Return a compiled function that tests whether story `i` has the law with number `code`.

    The arguments of the result are (law_parameters, law_state, i). For `_SEPARATE`, it tests
    whether the law of the story is any separately compiled law.
    """
    if code == _SEPARATE:
        return _is_separate

    @inline
    def has_law(law_parameters, law_state, i):
        """Return True if the law of story `i` has the number `code`.

        Row CODE of `law_parameters` contains the numbers of the laws. The argument `law_state` is
        not used.
        """
        return law_parameters[rows.CODE, i] == code

    return has_law


def case_with_3_arguments(decorate: Any, has_law: Any, implementation: Any, other: Any) -> Any:
    """Return a compiled function that calls one of two functions, depending on the law of a story.

    It calls `implementation` if `has_law` returns True for the story, and otherwise `other`.
    The functions have the three arguments (law_parameters, law_state, i).

    Parameters
    ----------
    decorate : callable
        Decorator of the result: `inline` or `specialized`.
    has_law : function
        (law_parameters, law_state, i) -> bool.
    implementation, other : function
        Functions of three arguments (law_parameters, law_state, i).
    """

    @decorate
    def choose(law_parameters, law_state, i):
        """Call `implementation` if story `i` has the law that `has_law` tests, otherwise `other`,
        which continues the chain with the next law.

        `law_parameters` and `law_state` are the tables of the parameters and states of all laws.
        """
        if has_law(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i)
        return other(law_parameters, law_state, i)

    return choose


def case_with_4_arguments(decorate: Any, has_law: Any, implementation: Any, other: Any) -> Any:
    """Return a compiled function with four arguments, as `case_with_3_arguments` does.

    A separate function for each number of arguments is necessary because compiled functions cannot
    have a variable number of arguments.
    """

    @decorate
    def choose(law_parameters, law_state, i, argument):
        """Call `implementation` if story `i` has the law, otherwise `other`, the next condition."""
        if has_law(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i, argument)
        return other(law_parameters, law_state, i, argument)

    return choose


def case_with_5_arguments(decorate: Any, has_law: Any, implementation: Any, other: Any) -> Any:
    """Return a compiled function with five arguments, as `case_with_3_arguments` does."""

    @decorate
    def choose(law_parameters, law_state, i, block, argument):
        """Call `implementation` if story `i` has the law, otherwise `other`, the next condition."""
        if has_law(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i, block, argument)
        return other(law_parameters, law_state, i, block, argument)

    return choose


def case_with_6_arguments(decorate: Any, has_law: Any, implementation: Any, other: Any) -> Any:
    """Return a compiled function with six arguments, as `case_with_3_arguments` does."""

    @decorate
    def choose(law_parameters, law_state, i, block, argument, last):
        """Call `implementation` if story `i` has the law, otherwise `other`, the next condition."""
        if has_law(law_parameters, law_state, i):
            return implementation(law_parameters, law_state, i, block, argument, last)
        return other(law_parameters, law_state, i, block, argument, last)

    return choose
