"""The `intensity` of a campaign file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from tdint.campaign.file.definition import FactorsFile
from tdint.campaign.levels import MeasureLevels, Scales
from tdint.campaign.studies.intensity import GEOMETRIC_MEAN, PAIRS, IntensityMeasure, PeakVelocity, pga, sa, sa_average
from tdint.errors import UsageError
from tdint.model.keys.document import resolve
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import ANY, POSITIVE, RATIO, Choice, Either, EntriesOf, Key, Keys, Words
from tdint.units import parse_units

_OF_MEASURES = ("period", "damping", "levels", "pair")
_FIRST = "T1"

_MEASURES: Mapping[str, tuple[str, Callable[[float, float], IntensityMeasure]]] = {
    "pga": ("acceleration", lambda period, damping: pga()),
    "pgv": ("velocity", lambda period, damping: PeakVelocity()),
    "sa": ("acceleration", sa),
    "sa-avg": ("acceleration", sa_average),
}
"""Of each measure the quantity of its levels, and (period, damping) -> measure."""

_WITHOUT_PERIOD = ("pga", "pgv")

INTENSITY = Keys(
    (
        Key("scales", EntriesOf(ANY, least=1), "factors on all motions"),
        Key("measure", Choice(tuple(_MEASURES)), "intensity measure that takes the levels"),
        Key("period", Either((Choice((_FIRST,)), POSITIVE)), "of sa and sa-avg; that of each building by default"),
        Key("damping", RATIO, "damping ratio of sa and sa-avg; 5% by default"),
        Key("levels", EntriesOf(Words(), least=1), "values with their unit: 0.1 g, 0.2 m/s"),
        Key("pair", Choice(tuple(PAIRS)), "what stands for the two components of a pair"),
        Key("factors", Words(), "CSV file of `tdint scale`, relative to this file"),
    ),
    one_of=(("scales", "measure", "factors"),),
)


def read_intensity(value: Value | None, folder: Path) -> Scales | MeasureLevels | FactorsFile | None:
    """Factors, levels of a measure, or a file of factors; None without any, or after a fault."""
    section = value.section(INTENSITY) if value else None
    if value is None or section is None:
        return None
    ways = [name for name in ("scales", "measure", "factors") if section.has(name)]
    if len(ways) != 1:
        value.fault("give one of scales, measure and factors" + (f", not {' and '.join(ways)}" if ways else ""))
        return None
    if ways != ["measure"]:
        for name in _OF_MEASURES:
            if entry := section.get(name):
                entry.fault("belongs to a `measure`")
    if ways == ["measure"]:
        return _levels(section)
    if ways == ["factors"]:
        file = section.text("factors")
        return FactorsFile(resolve(file, folder)) if file else None
    return Scales(_scales(section))


def _scales(section: Section) -> tuple[float, ...]:
    value = section.get("scales")
    items = value.items("a list of factors") if value else None
    if value and items is not None and not items:
        value.fault("is empty; give at least one factor")
    found: dict[float, None] = {}
    for item in items or ():
        number = item.number(ANY)
        if number == 0.0:
            item.fault("must not be zero")
        found[number] = None
    return tuple(found)


def _levels(section: Section) -> MeasureLevels | None:
    named = section.get("measure")
    name = named.choice(_MEASURES, "measure") if named else None
    pair = section.get("pair")
    whole = pair.choice(PAIRS, "measure of pairs") if pair else GEOMETRIC_MEAN
    damping = section.number("damping", default=0.05)
    levels = section.need("levels", "give the values, such as [0.1 g, 0.2 g]")
    items = levels.items("a list of values with their unit") if levels else None
    if name is None:
        return None
    quantity = _MEASURES[name][0]
    values = tuple(dict.fromkeys(_level(item, quantity) for item in items or ()))
    period = _period(section, name)
    return MeasureLevels(partial(_measure, name, damping), period, values, whole or GEOMETRIC_MEAN)


def _measure(name: str, damping: float, period: float) -> IntensityMeasure:
    return _MEASURES[name][1](period, damping)


def _period(section: Section, name: str) -> float | None:
    """The period of the measure; None for that of each building."""
    value = section.get("period")
    if name in _WITHOUT_PERIOD:
        if value:
            value.fault(f"{name} has no period")
        return 1.0
    if value is None or value.is_word(_FIRST):
        return None
    number = value.number(POSITIVE, what=f"{_FIRST} or a positive number of seconds")
    return None if math.isnan(number) else number


def _level(value: Value, quantity: str) -> float:
    """A value with its unit in SI; nan after a fault."""
    text = value.text()
    if text is None:
        return math.nan
    example = "0.1 g" if quantity == "acceleration" else "0.2 m/s"
    try:
        units = parse_units(text)
    except UsageError:
        value.fault(f"must be a positive number with its unit, such as {example}, got {text!r}")
        return math.nan
    if units.quantity != quantity or not units.has_factor:
        value.fault(f"must be a number with a unit of {quantity}, such as {example}, got {text!r}")
        return math.nan
    return units.scale
