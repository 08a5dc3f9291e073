"""Compiled functions that select the drift law of a story by its number.

`select_function` returns a function that calls the function of the law of each story. The constants
of the module state which features the laws of the compiled variant have; the compiler omits code
for other features.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container
from functools import cache
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import FRACTURES
from tdint.kernels.compiling import SPECIFIC, VARIANT, inline, outlined
from tdint.kernels.laws import LAWS
from tdint.kernels.laws.fracture import FRACTURING
from tdint.kernels.laws.law import DriftLaw, LawFunctions

_VARIANT_LAWS = {re.sub(r"@\d+", "", name) for name in VARIANT.laws}

COMPILED: tuple[float, ...] = (
    *(code for code, name in enumerate(LAWS.names()) if not _VARIANT_LAWS or name in _VARIANT_LAWS),
    *(
        code + FRACTURING
        for code, name in enumerate(LAWS.names())
        if name + FRACTURES in _VARIANT_LAWS
    ),
)
"""Numbers of the laws for which the kernels are compiled."""


@cache
def _functions(law: DriftLaw) -> LawFunctions:
    """Return the functions of a law; cached, because `law.functions` creates them at each call."""
    return law.functions()


class _Codes:
    """Container of the numbers of all laws with a property, for kernels that run in plain Python.

    The property is evaluated for each test with `in`, because plug-ins can register laws later.
    """

    def __init__(self, has_property: Callable[[DriftLaw], bool]) -> None:
        """Store the function `has_property`, which returns True for a law with the property."""
        self.has_property = has_property

    def __contains__(self, code: Any) -> bool:
        """Return True if the law with number `code` has the property."""
        return self.has_property(LAWS[code])


def _codes(has_property: Callable[[DriftLaw], bool]) -> Container[float]:
    """Return a container of the numbers of all laws with a property.

    Compiled kernels need a tuple of constants. Kernels in plain Python use a `_Codes` instead,
    because a tuple would not contain the laws that plug-ins register later.
    """
    if not SPECIFIC:
        return _Codes(has_property)
    return tuple(float(code) for code in COMPILED if has_property(LAWS[code]))


CURVED_LAWS = _codes(lambda law: law.curved)
"""Numbers of the laws with curved branches."""


# Kernels that run in plain Python contain all laws.
HAS_CURVED_LAW = not SPECIFIC or any(LAWS[code].curved for code in COMPILED)
"""True if a law of the variant is curved."""

HAS_CURVED_FORCE = (
    VARIANT.power_dampers or VARIANT.braces or VARIANT.tangent_damping or HAS_CURVED_LAW
)
"""True if a story can have a force that is not piecewise linear in its drift and velocity: a curved
law, a power-law dashpot, a damper with a brace or tangent damping."""

HAS_NONLINEAR_FORCE = HAS_CURVED_FORCE or any(LAWS[code].kinked for code in COMPILED)
"""True if a story can have a force that is not linear in its motion."""

HAS_FRACTURE = not SPECIFIC or any(code % 1.0 == FRACTURING for code in COMPILED)
"""True if a law of the variant can fracture."""

HAS_ELEMENTS = VARIANT.elements
"""True if a story can have several elements (`tdint.kernels.layout.ELEMENTS`)."""

_FREQUENT = 2
"""Number of laws whose selection is inlined: linear and bilinear. The selection among the other
laws is compiled once and called, which reduces the compile times."""


@inline
def elements_of(law_parameters, i):
    """Return the columns of the elements of story `i`, which must have elements."""
    return range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    )


BRANCH_STORING_LAWS = _codes(lambda law: _functions(law).keep is not None)

DISSIPATING_LAWS = _codes(lambda law: _functions(law).accumulate_dissipation is not None)


def select_function(hook: str, otherwise: Any = None) -> Any:
    """Return a compiled function that calls the function `hook` (an attribute of `LawFunctions`) of
    the law of a story.

    Laws without this function use `otherwise`, which is required unless every law has the function.
    """
    if not SPECIFIC:

        def call(law_parameters, law_state, i, *arguments):
            """Call the function `hook` of the law of story `i`, or `otherwise`."""
            functions = _functions(LAWS[law_parameters[rows.CODE, i]])
            function = getattr(functions, hook) or otherwise
            return function(law_parameters, law_state, i, *arguments)

        return call
    cases: dict[float, Any] = {code: getattr(_functions(LAWS[code]), hook) for code in COMPILED}
    rest = None if all(cases.values()) else otherwise
    # A frequent law without the function has a case, which avoids the call for the other laws.
    frequent = {code: case or otherwise for code, case in cases.items() if code < _FREQUENT}
    others = {code: case for code, case in cases.items() if case and code >= _FREQUENT}
    return _choice(inline, frequent, _choice(outlined, others, rest))


def _choice(decorate: Any, cases: dict[float, Any], rest: Any) -> Any:
    """Return a compiled function that calls the function in `cases` for the number of the law of
    story `i`, and `rest` for other laws. Without `rest`, the last case has no condition.

    The function is generated as text, because compiled functions cannot have a variable number of
    arguments.
    """
    codes = list(cases)
    if rest is None and codes:
        rest = cases[codes.pop()]
    if not codes:
        return rest
    body = getattr(rest, "py_func", rest).__code__
    arguments = ", ".join(body.co_varnames[: body.co_argcount])
    lines = [
        f"    if law_parameters[{rows.CODE}, i] == {code}:\n        return law_{j}({arguments})"
        for j, code in enumerate(codes)
    ]
    text = "\n".join((f"def choose({arguments}):", *lines, f"    return rest({arguments})"))
    names = {f"law_{j}": cases[code] for j, code in enumerate(codes)} | {"rest": rest}
    exec(text, names)  # the text contains only names and numbers of this module
    return decorate(names["choose"])
