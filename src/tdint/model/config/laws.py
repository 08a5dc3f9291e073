"""The `law` of a story: a name, or a mapping with `type` and the parameters that `tdint.model.laws` lists for it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tdint.model.config.fields import Bounds, Section, Value
from tdint.model.config.units import ModelUnits
from tdint.model.definition import Law
from tdint.model.laws import LAWS, DriftLaw

LINEAR = Law("linear", ())
_LIST = "a list of numbers"


def read_law(value: Value | None, unit: ModelUnits) -> tuple[Law, float | None]:
    """The law and its own initial stiffness, N/m: None where the story gives it, nan where a fault leaves it open."""
    if value is None:
        return LINEAR, None
    law, section = _read_type(value)
    if law is None:
        return LINEAR, math.nan
    parameters = _read_parameters(section, law, unit) if section else ()
    return Law(law.name, parameters), _own_stiffness(value, law, parameters, unit)


def _read_type(value: Value) -> tuple[DriftLaw | None, Section | None]:
    """The law, None after a fault, and the section that holds its parameters, None if it was only named."""
    if not value.is_mapping:
        name = value.choice(LAWS, "law")
        if name and LAWS[name].parameters:
            names = ", ".join(f"{parameter.name}: ..." for parameter in LAWS[name].parameters)
            value.fault(f"the {name} law needs its parameters; write {{type: {name}, {names}}}")
        return (LAWS[name] if name else None), None
    kind = value.peek("type")
    name = kind.choice(LAWS, "law") if kind else None
    laws = [LAWS[name]] if name else LAWS.values()
    known = dict.fromkeys(["type", *(parameter.name for law in laws for parameter in law.parameters)])
    section = value.section(list(known))
    if section:
        section.need("type", f"give one of {', '.join(LAWS)}")
    return (LAWS[name] if name else None), section


def _read_parameters(section: Section, law: DriftLaw, unit: ModelUnits) -> tuple[float, ...]:
    """The parameters in SI in the order of the law, lists flattened."""
    values: list[float] = []
    for parameter in law.parameters:
        bounds = Bounds(parameter.low, parameter.high, parameter.low_allowed, parameter.high_allowed)
        if parameter.many:
            entry = section.need(parameter.name, f"give {_LIST}")
            values += _read_list(entry, bounds, unit) if entry else (math.nan,)
        else:
            values.append(section.number(parameter.name, bounds, unit.factor(parameter.force, parameter.length)))
    return tuple(values)


def _read_list(value: Value, bounds: Bounds, unit: ModelUnits) -> tuple[float, ...]:
    """The numbers of a `many` parameter in SI: the j-th is force length^-j."""
    items = value.items(_LIST)
    if items is not None and not items:
        value.fault("must hold at least one number")
    if not items:
        return (math.nan,)
    return tuple(item.number(bounds, unit.factor(force=1, length=-j)) for j, item in enumerate(items, start=1))


def _own_stiffness(value: Value, law: DriftLaw, parameters: Sequence[float], unit: ModelUnits) -> float | None:
    """The initial stiffness that follows from the law's parameters, checked to be positive."""
    if law.initial_stiffness is None:
        return None
    stiffness = law.initial_stiffness(parameters) if parameters else math.nan
    if stiffness <= 0.0 or stiffness == math.inf:
        shown = f"{stiffness / unit.factor(force=1, length=-1):.10g}"
        value.fault(f"the initial stiffness of the {law.name} law must be a positive number, got {shown}")
        return math.nan
    return stiffness
