"""The catalogue of methods: the only list of them. A new family is one file and one line here."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numpy as np

from tdint.errors import UsageError, did_you_mean
from tdint.kernels.laws.law import DriftLaw
from tdint.kernels.stepping import STEP
from tdint.methods import bathe, exact, impulse, impulse4, model_based, moment4, multi_step, runge_kutta, single_step
from tdint.methods.method import Integrator, Method, Parameter
from tdint.model.laws import LAWS, register_law
from tdint.model.plugins import check_name, declared, faults_of, installed, module_of
from tdint.tabular import Several

FAMILIES = (impulse, impulse4, moment4, single_step, multi_step, bathe, model_based, runge_kutta, exact)

DEFAULT_METHOD = "impulse4"
"""The method where none is named."""


@cache
def _known() -> dict[str, Method]:
    """Our methods, and behind them those that are registered."""
    return {method.name: method for family in FAMILIES for method in family.METHODS}


@cache
def catalogue() -> dict[str, Method]:
    """All methods by name, in the order in which they are listed: ours, then those of plug-ins, those of installed
    packages (entry points `tdint.methods`) among them."""

    def take(found: Any, where: str) -> None:
        for method in declared(found, "METHODS", Method, where):
            register_method(method, where)

    installed("tdint.methods", take)
    return _known()


def register_method(method: Method, where: str = "") -> None:
    """Make a method known by its name, to everything that takes methods.

    Parameters
    ----------
    method : Method
        See `tdint.methods.method`. Its family's step stands in a module with a file; it may be a family of ours.
    where : str
        Where it is from, for messages; by default its name.

    Raises
    ------
    UsageError
        No method; a name that is taken or is none; a family of another step under a name of ours; a declaration that
        cannot be called with the defaults.
    """
    if not isinstance(method, Method):
        raise UsageError(f"{where or repr(method)}: a method is a tdint.Method, not {type(method).__name__}")
    where = where or f"method {method.name!r}"
    check_name(method.name, _known(), "method", where)
    families = {id(one.family): one.family for one in _known().values()}
    if id(method.family) not in families:
        check_name(method.family.name, [one.name for one in families.values()], "family", where)
    if method.family.step.signature != STEP:
        raise UsageError(f"{where}: method {method.name!r}: its step is no kernel of the signature tdint.kernels.STEP")
    _known()[method.name] = method
    try:
        with faults_of(where):
            _check_declaration(parse(method.name), where)
    except UsageError:
        del _known()[method.name]
        raise


def _check_declaration(integrator: Integrator, where: str) -> None:
    """Raise UsageError where what a method declares is not what it should be, with its defaults."""
    kinds = {"order": int, "implicit": bool, "stability_limit": float, "rho_inf": float}
    for name, kind in kinds.items():
        found = getattr(integrator, name)
        if not isinstance(found, kind) and not (kind is float and isinstance(found, int)):
            raise UsageError(f"{where}: {integrator.label}: {name} gives {found!r}, no {kind.__name__}")
    if integrator.family.prepare is None:
        np.array(integrator.method.coefficients(*integrator.values), dtype=np.float64)
    integrator.family.work_rows(0)


def load_plugin(file: str) -> tuple[list[Method], list[DriftLaw]]:
    """The methods and laws of a Python file, registered: what its tuples METHODS and LAWS have.

    Raises
    ------
    UsageError
        No such file, or it is faulty: one line with the file and, where that is known, its line.
    """
    module = module_of(file)
    if not hasattr(module, "METHODS") and not hasattr(module, "LAWS"):
        raise UsageError(f"{file}: a plug-in has a tuple METHODS or LAWS; this one has neither")
    with faults_of(file):
        found = list(declared(module, "LAWS", DriftLaw, file)), list(declared(module, "METHODS", Method, file))
    for law in found[0]:
        if LAWS.get(law.name) is None or LAWS[law.name].functions is not law.functions:
            register_law(law, file)
    for method in found[1]:
        if _known().get(method.name) is not method:
            register_method(method, file)
    return found[1], found[0]


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
    method = _known().get(name) or catalogue().get(name)
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


def chosen(specifications: str | Iterable[str] | None) -> list[Integrator]:
    """The methods of one or several specifications, each once; all of the catalogue at their defaults if none is given.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    given = [specifications] if isinstance(specifications, str) else list(specifications or catalogue())
    return list(dict.fromkeys(map(parse, given)))


def list_methods(specifications: str | Iterable[str] | None = None) -> Several[Integrator]:
    """The time-integration methods with these parameters, or all at their defaults; `to_dict` has what
    `tdint methods` tells of them. Errors are those of `chosen`."""
    return Several(chosen(specifications))
