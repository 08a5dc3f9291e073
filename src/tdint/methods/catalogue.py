"""The catalogue of methods: the only list of them. A new family is one file and one line here."""

from __future__ import annotations

import copyreg
from collections.abc import Callable
from functools import cache

from tdint.errors import UsageError, did_you_mean
from tdint.methods import bathe, exact, impulse, impulse4, model_based, moment4, multi_step, runge_kutta, single_step
from tdint.methods.method import Integrator, Method, Parameter

FAMILIES = (impulse, impulse4, moment4, single_step, multi_step, bathe, model_based, runge_kutta, exact)

DEFAULT_METHOD = "impulse4"
"""The method where none is named."""


@cache
def catalogue() -> dict[str, Method]:
    """All methods by name, in the order in which they are listed."""
    return {method.name: method for family in FAMILIES for method in family.METHODS}


def parse(text: str) -> Integrator:
    """Read a specification such as `generalized-alpha` or `newmark:beta=0.25,gamma=0.5`.

    Raises
    ------
    UsageError
        Unknown method or parameter, a value that is no number or out of range. No other method ever takes its place.
    """
    if not isinstance(text, str):
        raise UsageError(f"a method is a text such as 'impulse4', got {text!r}")
    name, _, rest = text.strip().partition(":")
    method = catalogue().get(name)
    if method is None:
        hint = did_you_mean(name, catalogue())
        raise UsageError(f"unknown method {name!r}{hint} (known: {', '.join(catalogue())})")
    given = _given(text, method, rest) if rest or ":" in text else {}
    values: list[float] = []
    for parameter in method.parameters:
        default = parameter.default
        value = given.get(parameter.name, default if isinstance(default, float) else None)
        if value is None:
            assert callable(default)
            value = default(*values)
        if not parameter.allows(value):
            raise UsageError(f"method {text!r}: {parameter.name} must lie in {parameter.range}, got {value!r}")
        values.append(value)
    return Integrator(method, tuple(values))


def _reduce(integrator: Integrator) -> tuple[Callable[[str], Integrator], tuple[str]]:
    """An integrator goes to another process as its specification: compiled functions do not travel."""
    return parse, (integrator.label,)


copyreg.pickle(Integrator, _reduce)


def _given(text: str, method: Method, rest: str) -> dict[str, float]:
    """The parameters that the specification names."""
    allowed = {parameter.name: parameter for parameter in method.parameters}
    given: dict[str, float] = {}
    for item in rest.split(","):
        key, equals, number = (part.strip() for part in item.partition("="))
        if key not in allowed:
            raise UsageError(f"method {text!r}: {method.name} has no parameter {key!r}; {_parameters(method)}")
        if key in given:
            raise UsageError(f"method {text!r}: {key} is given twice")
        given[key] = _number(text, allowed[key], equals, number)
    return given


def _number(text: str, parameter: Parameter, equals: str, number: str) -> float:
    """A number, or a fraction such as 1/144."""
    above, slash, below = number.partition("/")
    try:
        return float(above) / float(below) if slash else float(number)
    except (ValueError, ZeroDivisionError):
        got = f"got {number!r}" if equals else "got nothing"
        raise UsageError(f"method {text!r}: {parameter.name} must be a number in {parameter.range}, {got}") from None


def _parameters(method: Method) -> str:
    if not method.parameters:
        return "it has none"
    return "it has " + ", ".join(f"{parameter.name} in {parameter.range}" for parameter in method.parameters)
