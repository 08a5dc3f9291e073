"""The catalogue of methods: the only list of them, and where they were published, as
`publications.bib` has it.

A new family is one file, one line here, and its entries there.
"""

from __future__ import annotations

import copyreg
import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from tdint.errors import UsageError, did_you_mean
from tdint.kernels.laws.law import DriftLaw
from tdint.kernels.stepping import STEP
from tdint.methods import (
    bathe,
    exact,
    impulse,
    impulse4,
    model_based,
    moment4,
    multi_step,
    noh_bathe,
    runge_kutta,
    single_step,
)
from tdint.methods.method import Integrator, Method
from tdint.model.definition import LAWS, register_law
from tdint.model.plugins import (
    LOG,
    Origin,
    check_name,
    declared,
    faults_of,
    home_of,
    installed,
    module_of,
    same_file,
)
from tdint.tabular import ResultList

FAMILIES = (
    impulse,
    impulse4,
    moment4,
    single_step,
    multi_step,
    bathe,
    noh_bathe,
    model_based,
    runge_kutta,
    exact,
)

DEFAULT_METHOD = "impulse4"
"""The method where none is named."""

_FIELD = re.compile(r"  (\w+) = \{+(.*?)\}+,\n")
_KEYWORDS = re.compile(r"  keywords = .*\n")


@cache
def _known() -> dict[str, Method]:
    """Our methods, and behind them those that are registered."""
    return {method.name: method for family in FAMILIES for method in family.METHODS}


@cache
def catalogue() -> dict[str, Method]:
    """All methods by name, in the order in which they are listed: ours, then those of plug-ins,
    those of installed packages (entry points `tdint.methods`) among them."""

    def take(module: Any, origin: Origin) -> None:
        for method in declared(module, "METHODS", Method, origin.where):
            register_method(method, origin)

    installed("tdint.methods", take)
    return _known()


def is_ours(name: str) -> bool:
    """Whether a method is none of a plug-in."""
    return any(method.name == name for family in FAMILIES for method in family.METHODS)


def register_method(method: Method, where: str | Origin = "") -> None:
    """Make a method known by its name, to everything that takes methods.

    Parameters
    ----------
    method : Method
        See `tdint.methods.method`. Its family's step stands in a module with a file; it may be a
        family of ours.
    where : str or Origin
        Where it is from, for messages; by default its name.

    Returns
    -------
    None

    Raises
    ------
    UsageError
        No method; a name that is taken or is none; a family of another step under a name of ours; a
        declaration that cannot be called with the defaults.
    """
    if not isinstance(method, Method):
        raise UsageError(
            f"{where or repr(method)}: a method is a tdint.plugin.Method, not "
            f"{type(method).__name__}"
        )
    origin = where if isinstance(where, Origin) else Origin(where or f"method {method.name!r}")
    where = origin.where
    check_name(method.name, _known(), "method", where)
    families = {id(other.family): other.family for other in _known().values()}
    if id(method.family) not in families:
        check_name(
            method.family.name, [family.name for family in families.values()], "family", where
        )
    if method.family.step.signature != STEP:
        raise UsageError(
            f"{where}: method {method.name!r}: its step is no kernel of the signature "
            "tdint.plugin.STEP"
        )
    # What it declares is asked for with its defaults, as it will be; a method that fails there is
    # not kept.
    kinds = {"order": int, "implicit": bool, "stability_limit": float, "rho_inf": float}
    _known()[method.name] = method
    try:
        with faults_of(where):
            integrator = parse(method.name)
            for name, kind in kinds.items():
                declaration = getattr(integrator, name)
                if not isinstance(declaration, kind) and not (
                    kind is float and isinstance(declaration, int)
                ):
                    raise UsageError(
                        f"{where}: {integrator.label}: {name} gives {declaration!r}, no "
                        f"{kind.__name__}"
                    )
            if integrator.family.prepare is None:
                np.array(integrator.method.coefficients(*integrator.values), dtype=np.float64)
            integrator.family.scratch_rows(0)
    except UsageError:
        del _known()[method.name]
        raise
    origin.keep_code("method", method)


def load_plugin(file: str | Path) -> tuple[list[Method], list[DriftLaw]]:
    """Register the methods and drift laws of a Python file, and its measures of motions: what its
    tuples METHODS, LAWS and MEASURES have.

    Parameters
    ----------
    file : str or Path
        NAME.py; it is executed.

    Returns
    -------
    tuple of list of Method and list of DriftLaw

    Raises
    ------
    UsageError
        No such file, or it is faulty: one line with the file and, where that is known, its line.
    """
    file = os.fspath(file)
    module = module_of(file)
    if not any(hasattr(module, name) for name in ("METHODS", "LAWS", "PEERS", "MEASURES")):
        raise UsageError(
            f"{file}: a plug-in has a tuple METHODS, LAWS, PEERS or MEASURES; this one has none"
        )
    with faults_of(file):
        laws, methods = (
            list(declared(module, "LAWS", DriftLaw, file)),
            list(declared(module, "METHODS", Method, file)),
        )
        if hasattr(module, "MEASURES"):
            from tdint.ground_motion.measures import (
                MEASURES,
                Measure,
            )  # `tdint methods` does without

            for measure in declared(module, "MEASURES", Measure, file):
                if MEASURES.get(measure.name) is not measure:
                    check_name(measure.name, {*MEASURES, "sa", "sa-avg", "sdi"}, "measure", file)
                    MEASURES[measure.name] = measure
    for law in laws:
        if LAWS.get(law.name) is None or LAWS[law.name].functions is not law.functions:
            register_law(law, Origin(file, module.__name__))
    for method in methods:
        if _known().get(method.name) is not method:
            register_method(method, Origin(file, module.__name__))
    return methods, laws


def parse(text: str) -> Integrator:
    """Read a specification such as `generalized-alpha` or `newmark:beta=0.25:gamma=0.5`. Commas in
    place of the further colons are read with a line that says so: they would part the cells of a
    table.

    Raises
    ------
    UsageError
        Unknown method or parameter, a value that is no number or out of range. No other method ever
        takes its place.
    """
    if not isinstance(text, str):
        raise UsageError(f"a method is a text such as 'impulse4', got {text!r}")
    name, _, rest = text.strip().partition(":")
    method = _known().get(name) or catalogue().get(name)
    if method is None:
        hint = did_you_mean(name, catalogue())
        raise UsageError(f"unknown method {name!r}{hint} (known: {', '.join(catalogue())})")
    # The parameters that the specification names: numbers, or fractions such as 1/144.
    allowed = {parameter.name: parameter for parameter in method.parameters}
    given: dict[str, float] = {}
    items = rest.replace(",", ":").split(":") if rest or ":" in text else []
    for item in items:
        key, equals, number = (part.strip() for part in item.partition("="))
        if key not in allowed:
            has = (
                ", ".join(
                    f"{parameter.name} in {parameter.range}" for parameter in method.parameters
                )
                or "none"
            )
            raise UsageError(
                f"method {text!r}: {method.name} has no parameter {key!r}; it has {has}"
            )
        if key in given:
            raise UsageError(f"method {text!r}: {key} is given twice")
        above, slash, below = number.partition("/")
        try:
            given[key] = float(above) / float(below) if slash else float(number)
        except (ValueError, ZeroDivisionError):
            got = f"got {number!r}" if equals else "got nothing"
            raise UsageError(
                f"method {text!r}: {key} must be a number in {allowed[key].range}, {got}"
            ) from None
    # All of them, in their order: a default may follow from those before it.
    values: list[float] = []
    for parameter in method.parameters:
        default = parameter.default
        value = given.get(parameter.name, default if isinstance(default, float) else None)
        if value is None:
            assert callable(default)
            value = default(*values)
        if not parameter.allows(value):
            raise UsageError(
                f"method {text!r}: {parameter.name} must lie in {parameter.range}, got {value!r}"
            )
        values.append(value)
    typed = ":".join([name, *("".join(item.split()) for item in items)])
    if "," in rest:
        _deprecate(text, typed)
    return Integrator(method, tuple(values), typed)


def resolved(specification: str) -> dict[str, float]:
    """The value of each parameter of a method, given or by default."""
    return parse(specification).resolved


@cache
def _deprecate(text: str, typed: str) -> None:
    """Once for each text, however often it is read."""
    LOG.warning("method %r: write %s; commas between parameters are still read", text, typed)


def _reduce(integrator: Integrator) -> tuple[Callable[..., Integrator], tuple[str, ...]]:
    """An integrator goes to another process as its specification, that of a plug-in with its file:
    compiled functions do not travel."""
    home = home_of(integrator.method.name, "METHODS")
    return (_parse_again, (integrator.label, *home)) if home else (parse, (integrator.label,))


def _parse_again(text: str, file: str, digest: str) -> Integrator:
    """A method of a plug-in, which is loaded if this process does not know it yet."""
    if text.partition(":")[0] not in catalogue():
        try:
            load_plugin(same_file(file, digest))
        except UsageError as error:
            return Integrator(cast(Method, _Unknown(text, file, digest, str(error))))
    return parse(text)


@dataclass(frozen=True)
class _Unknown:
    """A method whose plug-in could not be loaded: whoever asks anything of it is told so. A pool
    would wait for ever for a result that cannot be read."""

    text: str
    file: str
    digest: str
    why: str

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise UsageError(self.why)


copyreg.pickle(Integrator, _reduce)


def chosen(specifications: str | Iterable[str] | None) -> list[Integrator]:
    """The methods of one or several specifications, each once; all of the catalogue at their
    defaults if none is given.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    given = [specifications] if isinstance(specifications, str) else specifications
    return list(dict.fromkeys(map(parse, catalogue() if given is None else given)))


def list_methods(specifications: str | Iterable[str] | None = None) -> ResultList[Integrator]:
    """The time-integration methods with these parameters, or all at their defaults.

    Parameters
    ----------
    specifications : str or iterable of str, optional
        Names with parameters, such as `hht:alpha=-0.1`; the whole catalogue by default.

    Returns
    -------
    ResultList of Integrator
        `to_dict` has what `tdint methods` tells of them.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    return ResultList(chosen(specifications))


@dataclass(frozen=True)
class Publication:
    """A publication.

    Attributes
    ----------
    bibtex : str
        Its entry of BibTeX.
    author : str
        As BibTeX takes them, `and` between them; empty where they are not known.
    howpublished : str
        Journal with volume, number and pages, or the report.
    doi : str
        Empty where it is not known for sure.
    """

    bibtex: str
    year: str
    title: str
    howpublished: str
    author: str = ""
    doi: str = ""

    @property
    def text(self) -> str:
        """In one line."""
        authors = self.author.replace(" and ", "; ")
        head = (
            f"{authors} ({self.year}). {self.title}" if authors else f"{self.title} ({self.year})"
        )
        return f"{head}. {self.howpublished}." + (f" doi:{self.doi}" if self.doi else "")


@cache
def references() -> dict[str, tuple[Publication, ...]]:
    """The publications of each method of ours, which an entry of the file names among its
    keywords."""
    from importlib.resources import files  # which takes longer to load than a run's first step

    publications: dict[str, tuple[Publication, ...]] = {}
    _, *entries = (
        (files("tdint.methods") / "publications.bib").read_text(encoding="utf-8").split("\n\n")
    )
    for entry in entries:
        fields = dict(_FIELD.findall(entry))
        methods = fields.pop("keywords").split(", ")
        publication = Publication(_KEYWORDS.sub("", entry).rstrip() + "\n", **fields)
        publications |= {method: (*publications.get(method, ()), publication) for method in methods}
    return publications


def references_of(method: Method) -> tuple[Publication, ...]:
    """The publications of a method; none for one of a plug-in, which has its `source` alone."""
    return references().get(method.name, ())
