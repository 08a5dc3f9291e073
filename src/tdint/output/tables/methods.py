"""Tables of methods: properties, measured behavior, cost; and table of validation cases."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from tdint.methods.method import Integrator
from tdint.methods.publications import references_of
from tdint.output.tables.columns import declared
from tdint.output.tables.table import cell_text, placeholder


def _without_commas(part: Any) -> Callable[[Any], str]:
    """Return a function of a result, which returns a part of it as text with semicolons instead of
    commas, because commas could be taken for separators of cells."""
    return lambda result: str(part(result)).replace(",", ";")


def _finite_or_nan(value: float) -> float:
    """Return a number; nan (an empty cell) if it is infinite."""
    return value if math.isfinite(value) else math.nan


def _limit_or_none(part: Any) -> Callable[[Any], float | str]:
    """Return a function of a result, which returns a part of it, a limit, or the text `none` if it
    is infinite."""

    def value(result: Any) -> float | str:
        limit: float = part(result)
        return "none" if math.isinf(limit) else limit

    return value


def _parameter_texts(integrator: Integrator) -> str:
    """Return the parameters of a method with their values and ranges, for example `beta=0.25 in [0
    to 1]; theta=1.02 in [1 to 10] computed`. A computed default follows from the parameters before
    it."""
    texts = []
    for parameter, value in zip(integrator.method.parameters, integrator.values, strict=True):
        text = f"{parameter.name}={cell_text(value)} in {parameter.range.replace(',', ' to')}"
        texts.append(f"{text} computed" if callable(parameter.default) else text)
    return "; ".join(texts)


def _publications(name: str) -> Callable[[Integrator], str]:
    """Return a function of a method, which returns the attribute `name` of its publications."""

    def value(integrator: Integrator) -> str:
        texts = [str(getattr(item, name)) for item in references_of(integrator.method)]
        return " | ".join(texts).replace(",", ";")

    return value


_integrator: Integrator = placeholder()
METHOD = declared(
    "methods.method",
    name=_integrator.method.name,
    family=_integrator.family.name,
    parameters=_parameter_texts,
    stability_limit=_limit_or_none(_integrator.stability_limit),
    source=_without_commas(_integrator.method.source),
    reference=_publications("text"),
    doi=_publications("doi"),
)


PEER = "/"
"""Separator in names of methods of other programs: program/method."""
