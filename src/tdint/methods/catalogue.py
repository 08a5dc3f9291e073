"""Catalogue of the time-integration methods.

A new family requires one file, one line in this module and its entries in `publications.bib`.
"""

from __future__ import annotations

import copyreg
import math
import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, wraps
from importlib import import_module
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tdint.errors import UsageError, did_you_mean
from tdint.kernels.laws.law import DriftLaw
from tdint.kernels.stepping import STEP
from tdint.methods.method import Integrator, Method
from tdint.model.plugins import (
    LOG,
    SAVE_IT,
    Origin,
    check_name,
    declared,
    faults_of,
    home_of,
    installed,
    module_of,
    require_version,
    same_file,
)
from tdint.model.story_laws import LAWS, register_law
from tdint.tabular import ResultList

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record
    from tdint.model.definition import Model

FAMILIES = (
    "impulse",
    "impulse4",
    "moment4",
    "single_step",
    "multi_step",
    "bathe",
    "noh_bathe",
    "model_based",
    "runge_kutta",
    "gauss",
    "exact",
)
"""Files of the families in this directory, in the order of the catalogue."""

DEFAULT_METHOD = "impulse4"
"""Default method."""

EXACT = "exact"
"""Only method for models of matrices and flexural stories, and default of linear models with
inerters."""


def method_of(model: Model, requested: str | None = None) -> str:
    """Return the method of a model: the requested method, that of its file, or the default."""
    uses_matrices = model.matrices is not None or (model.has_inertance and model.has_linear_springs)
    return requested or model.analysis.method or (EXACT if uses_matrices else DEFAULT_METHOD)


def _methods_of(family: str) -> tuple[Method, ...]:
    """Return the methods of a family; its file is imported when it is first needed."""
    methods: tuple[Method, ...] = import_module(f"tdint.methods.{family}").METHODS
    return methods


@cache
def _known() -> dict[str, Method]:
    """Return the built-in methods by name; registered methods are added to this dictionary.

    The result is cached, so that all callers use the same dictionary.
    """
    return {method.name: method for family in FAMILIES for method in _methods_of(family)}


@cache
def _built_in(name: str) -> Method | None:
    """Return the built-in method with this name, or None.

    The file with the same name as the method is searched first. A run with the default method
    therefore imports only a single family, which saves start time.
    """
    # False sorts before True: the family with this name is first, the order of the other families
    # remains.
    likely_family = name.replace("-", "_")
    for family in sorted(FAMILIES, key=lambda family: family != likely_family):
        for method in _methods_of(family):
            if method.name == name:
                return method
    return None


@cache
def catalogue() -> dict[str, Method]:
    """Return all methods by name: the built-in methods, then those of plug-ins.

    At the first call, the methods of installed packages (entry points `tdint.methods`) are
    registered. The result is cached, and methods that are registered later are added to the cached
    mapping.
    """

    def register_methods(module: Any, origin: Origin) -> None:
        """Register the methods in the tuple METHODS of a module; `origin` is its plug-in."""
        for method in declared(module, "METHODS", Method, origin.where):
            register_method(method, origin)

    installed("tdint.methods", register_methods)
    return _known()


def is_ours(name: str) -> bool:
    """Return True if the method with the name `name` is built in, not part of a plug-in."""
    return _built_in(name) is not None


def register_method(method: Method, where: str | Origin = "") -> None:
    """Register a method under its name for all commands and functions.

    The name and the step are checked. Properties, coefficients and the number of scratch rows are
    evaluated with the default parameters. The coefficients of a family with `prepare` depend on the
    building and are not evaluated. A method that fails is not registered. For a registered method,
    the SHA-256 of its files is stored for the description of results (`Origin.keep_code`).

    Parameters
    ----------
    method : Method
        Method with a new name. Its family may be a built-in family. The step of a new family must
        be defined in a file, because it is compiled from the file.
    where : str or Origin
        Origin of the method for messages, such as the file; default: its name.

    Returns
    -------
    None

    Raises
    ------
    UsageError
        `method` is not a `Method`; its name, or the name of a new family, is invalid or already
        used; its step does not have the signature STEP; or a property, the coefficients or the
        number of scratch rows cannot be computed with the default parameters.
    """
    if not isinstance(method, Method):
        raise UsageError(
            f"{where or repr(method)}: a method must be a tdint.plugin.Method, not "
            f"{type(method).__name__}"
        )
    origin = where if isinstance(where, Origin) else Origin(where or f"method {method.name!r}")
    where = origin.where
    check_name(method.name, _known(), "method", where)
    # A family is shared by its methods and identified by its object, not by its name.
    families = {id(other.family): other.family for other in _known().values()}
    if id(method.family) not in families:
        check_name(
            method.family.name, [family.name for family in families.values()], "family", where
        )
    if method.family.step.signature != STEP:
        raise UsageError(
            f"{where}: method {method.name!r}: its step must be a kernel with the "
            "signature tdint.plugin.STEP"
        )
    # `parse` requires a registered method. A method that fails is removed after any exception, also
    # after KeyboardInterrupt. Otherwise, a second `load_plugin` would accept it.
    _known()[method.name] = method
    try:
        with faults_of(where):
            _evaluate_with_defaults(method, where)
            # Store the SHA-256 of the files that define the method. This is the last operation,
            # because a rejected method computes no results.
            origin.keep_code("method", method)
    except BaseException:
        del _known()[method.name]
        raise


def _evaluate_with_defaults(method: Method, where: str) -> None:
    """Evaluate all functions of a registered method with its default parameters; raise an error if
    a property does not have the required type.

    The coefficients of a family with `prepare` depend on the building and are not evaluated.
    Exceptions of the functions of the method are not converted.
    """
    integrator = parse(method.name)
    property_types = {"order": int, "implicit": bool, "stability_limit": float, "rho_inf": float}
    for name, property_type in property_types.items():
        value = getattr(integrator, name)
        # True and False are integers in Python.
        allowed_types = (float, int) if property_type is float else property_type
        if not isinstance(value, allowed_types) or (
            isinstance(value, bool) and property_type is not bool
        ):
            raise UsageError(
                f"{where}: {integrator.label}: {name} must be of type "
                f"{property_type.__name__}, got {value!r}"
            )
    if integrator.family.prepare is None:
        np.array(integrator.method.coefficients(*integrator.values), dtype=np.float64)
    integrator.family.scratch_rows(0)  # without modal damping


def load_plugin(file: str | Path) -> tuple[list[Method], list[DriftLaw]]:
    """Load a plug-in: register methods, hysteretic laws and intensity measures of a Python file.

    The file is executed at its first use in the process. It must define at least one tuple:

        METHODS     integration methods (`Method`)
        LAWS        hysteretic laws (`DriftLaw`)
        MEASURES    intensity measures
        PEERS       other programs for comparison in `tdint chart`: pairs of a name and a function

    METHODS, LAWS and MEASURES are registered here; their objects can then be used by name. PEERS is
    accepted, but not read here: `tdint chart` reads it from the module of the file. A file can be
    loaded several times; its objects are registered only at the first time.

    Parameters
    ----------
    file : str or Path
        Python file, NAME.py.

    Returns
    -------
    methods : list of Method
        All methods of the file, including already registered methods.
    laws : list of DriftLaw
        All hysteretic laws of the file, including already registered laws.

    Raises
    ------
    UsageError
        The file does not exist or is invalid. The message is one line with the file and, if known,
        the line number.
    """
    if not isinstance(file, str | os.PathLike):
        raise UsageError(f"load_plugin: a plug-in is a file, got {type(file).__name__}; {SAVE_IT}")
    file = os.fspath(file)
    module = module_of(file)
    if not any(hasattr(module, name) for name in ("METHODS", "LAWS", "PEERS", "MEASURES")):
        raise UsageError(f"{file}: a plug-in must define a tuple METHODS, LAWS, PEERS or MEASURES")
    with faults_of(file):
        laws = list(declared(module, "LAWS", DriftLaw, file))
        methods = list(declared(module, "METHODS", Method, file))
        if hasattr(module, "MEASURES"):
            # `tdint methods` does not need the module.
            from tdint.ground_motion.measures import MEASURES, Measure

            for measure in declared(module, "MEASURES", Measure, file):
                known = MEASURES.get(measure.name)
                if known is None or getattr(known.value, "__wrapped__", None) is not measure.value:
                    check_name(measure.name, {*MEASURES, "sa", "sa-avg", "sdi"}, "measure", file)
                    checked = _checked_value(measure.value, measure.name, file)
                    MEASURES[measure.name] = replace(measure, value=checked)
    # Laws and methods of a file that was loaded before are not registered again. A registered law
    # is a changed copy of the object of the file (`register_law`) with the same attribute
    # `functions`.
    for law in laws:
        if LAWS.get(law.name) is None or LAWS[law.name].functions is not law.functions:
            register_law(law, Origin(file, module.__name__))
    for method in methods:
        if _known().get(method.name) is not method:
            register_method(method, Origin(file, module.__name__))
    return methods, laws


def _checked_value(
    value: Callable[[Record], float], name: str, file: str
) -> Callable[[Record], float]:
    """Return the function of the measure `name` of a plug-in, which raises UsageError with file and
    line instead of any other exception, or if the result is not a number or infinite."""

    @wraps(value)
    def checked(record: Record) -> float:
        with faults_of(file):
            result = value(record)
            if not isinstance(result, Real) or math.isinf(result):
                raise UsageError(
                    f"{file}: measure {name}: the value must be a finite number, or nan if it is "
                    f"undefined, got {result!r:.80} for {record.name}"
                )
            return float(result)

    return checked


def parse(text: str) -> Integrator:
    """Parse a specification such as `generalized-alpha` or `newmark:beta=0.25:gamma=0.5`.

    Commas between parameters are accepted with a warning. Colons are preferred, because a comma
    would start a new cell in a CSV table.

    Parameters
    ----------
    text : str
        Name of a method, then `:name=value` for each specified parameter. A value is a number or a
        fraction such as 1/144. Other parameters have their defaults.

    Raises
    ------
    UsageError
        Unknown method or parameter, or a value that is not a number or is out of range.
    """
    if not isinstance(text, str):
        raise UsageError(f"a method must be a text such as 'impulse4', got {text!r}")
    name, _, parameter_text = text.strip().partition(":")
    # The sources are in the order of their cost. `_built_in` imports only the families that it
    # searches. `_known` imports all families and contains plug-ins that are already registered.
    # `catalogue` registers the methods of installed packages with `register_method`, which calls
    # `parse`; `_known` already contains the new method.
    method = _built_in(name) or _known().get(name) or catalogue().get(name)
    if method is None:
        hint = did_you_mean(name, catalogue())
        raise UsageError(f"unknown method {name!r}{hint} (known: {', '.join(catalogue())})")
    allowed = {parameter.name: parameter for parameter in method.parameters}
    specified: dict[str, float] = {}
    # A colon without a parameter (`newmark:`) gives an empty item, which is reported as an error.
    items = parameter_text.replace(",", ":").split(":") if parameter_text or ":" in text else []
    for item in items:
        key, equals, number = (part.strip() for part in item.partition("="))
        if key not in allowed:
            available = (
                ", ".join(
                    f"{parameter.name} in {parameter.range}" for parameter in method.parameters
                )
                or "none"
            )
            raise UsageError(
                f"method {text!r}: {method.name} has no parameter {key!r}; it has {available}"
            )
        if key in specified:
            raise UsageError(f"method {text!r}: {key} is specified twice; keep one value")
        numerator, slash, denominator = number.partition("/")
        try:
            specified[key] = float(numerator) / float(denominator) if slash else float(number)
        except (ValueError, ZeroDivisionError):
            received = f"got {number!r}" if equals else "got nothing"
            raise UsageError(
                f"method {text!r}: {key} must be a number in {allowed[key].range}, {received}"
            ) from None
    # A default may depend on the preceding values.
    values: list[float] = []
    for parameter in method.parameters:
        default = parameter.default
        value = specified.get(parameter.name, default if isinstance(default, float) else None)
        if value is None:
            assert callable(default)
            value = default(*values)
        if not parameter.allows(value):
            raise UsageError(
                f"method {text!r}: {parameter.name} must be in {parameter.range}, got {value!r}"
            )
        values.append(value)
    # Colons and no white space, for labels and messages
    typed = ":".join([name, *("".join(item.split()) for item in items)])
    if "," in parameter_text:
        _deprecate(text, typed)
    return Integrator(method, tuple(values), typed)


def resolved(specification: str) -> dict[str, float]:
    """Return the values of all parameters of a method specification by name, including defaults.

    For example, `newmark:beta=0.25` gives the values of `beta` and `gamma`. UsageError is raised
    for an invalid specification (`parse`).
    """
    return parse(specification).resolved


@cache
def _deprecate(text: str, typed: str) -> None:
    """Warn that commas between parameters are deprecated, once for each specification.

    `text` is the specification with commas, and `typed` the same specification with colons.
    """
    LOG.warning(
        "method %r: the recommended notation is %s; commas between parameters are still accepted",
        text,
        typed,
    )


def _reduce(integrator: Integrator) -> tuple[Callable[..., Integrator], tuple[str, ...]]:
    """Pickle an integrator as its specification, with the file of its plug-in and its SHA-256 if it
    has one: compiled functions cannot be pickled.
    """
    # None for a built-in method
    name = integrator.method.name
    home = None if is_ours(name) else home_of(_known().get(name), "METHODS")
    return (_parse_again, (integrator.label, *home)) if home else (parse, (integrator.label,))


def _parse_again(text: str, file: str, digest: str) -> Integrator:
    """Create an integrator with a plug-in method again, from its pickled data.

    The integrator may be from another process. If this process has a method with the same name, it
    must be defined by the same version of the plug-in; otherwise the plug-in is loaded, provided
    that its file is unchanged. If this fails, the result contains an `UnavailableMethod`, which
    raises the error when it is used.
    """
    method = catalogue().get(text.partition(":")[0])
    try:
        if method is None:
            load_plugin(same_file(file, digest))
        else:
            require_version(method, "METHODS", file, digest)
    except UsageError as error:
        from tdint.methods.unavailable import UnavailableMethod  # seldom needed

        return Integrator(cast("Method", UnavailableMethod(str(error))))
    return parse(text)


copyreg.pickle(Integrator, _reduce)


def chosen(specifications: str | Iterable[str] | None) -> list[Integrator]:
    """Return the methods of one or several specifications without duplicates.

    Parameters
    ----------
    specifications : str, iterable of str or None
        Names with parameters, such as `hht:alpha=-0.1`. None: all methods of the catalogue with
        default parameters.
    """
    # None requests the complete catalogue.
    requested = [specifications] if isinstance(specifications, str) else specifications
    return list(dict.fromkeys(map(parse, catalogue() if requested is None else requested)))


def list_methods(specifications: str | Iterable[str] | None = None) -> ResultList[Integrator]:
    """List the specified time-integration methods, or all methods with default parameters.

    Parameters
    ----------
    specifications : str or iterable of str, optional
        Names with parameters, such as `hht:alpha=-0.1`; the whole catalogue by default.

    Returns
    -------
    ResultList of Integrator
        `to_dict` returns the data that `tdint methods` prints.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    return ResultList(chosen(specifications))
