"""The `units` of a model file, and those of the samples of a record that a file names."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tdint import units
from tdint.model.keys.fields import Value
from tdint.model.keys.kinds import Choice, Key, Keys

_WEIGHT = (
    "give the stories `weight` in place of mass, or divide by the acceleration of gravity, mass = W/g, in kip*s^2/in "
    "or kip*s^2/ft"
)

_NOT_SI = ("in", "ft", "lbf", "kip")
"""Units of length and force that leave open what a mass is in."""

UNITS = Keys(
    (
        Key("length", Choice(tuple(units.LENGTH)), "unit of length; m where it is left out"),
        Key("force", Choice(tuple(units.FORCE)), "unit of force; N where it is left out"),
        Key(
            "mass",
            Choice(tuple(units.MASS)),
            "unit of mass; kg where it is left out, but needed for masses beside in, ft, lbf or kip",
        ),
    )
)


@dataclass(frozen=True)
class ModelUnits:
    """Factors from the file's units to SI."""

    length: float
    force: float
    mass: float
    mass_is_open: bool = False
    """Lengths or forces are in units that are not SI, and that of mass is not said: kg would be a guess."""

    def factor(self, force: int = 0, length: float = 0) -> float:
        """The factor of the dimension force^`force` length^`length`, inf beyond double precision."""
        try:
            return float(self.force**force * self.length**length)
        except OverflowError:
            return math.inf


def read_units(value: Value | None) -> ModelUnits:
    """The units of the file, SI where it names none."""
    section = value.section(UNITS) if value else None

    def factor(name: str, known: Mapping[str, float]) -> float:
        entry = section.get(name) if section else None
        if name == "mass" and entry and any(map(entry.is_word, units.FORCE)):
            entry.fault(f"{entry.node.text} is a unit of force; {_WEIGHT}")  # type: ignore[union-attr]
            return 1.0
        unit = entry.choice(known, f"{name} unit") if entry else None
        return known[unit] if unit else 1.0

    words = [entry for name in ("length", "force") if section and (entry := section.get(name))]
    foreign = any(word.is_word(unit) for word in words for unit in _NOT_SI)
    return ModelUnits(
        factor("length", units.LENGTH),
        factor("force", units.FORCE),
        factor("mass", units.MASS),
        mass_is_open=foreign and not (section and section.mentions("mass")),
    )


def read_sample_units(value: Value | None, quantity: str | None = None) -> str | None:
    """Units as the reader of records understands them, judged here so that the fault has its line.

    `quantity` is what they must be units of, where the file says that elsewhere.
    """
    parsed = value.parsed(units.parse_units) if value else None
    if value is None or parsed is None:
        return None
    if quantity and parsed.quantity != quantity:
        fitting = ", ".join(units.GROUND_MOTION[quantity])
        value.fault(f"say {parsed.quantity}, the quantity says {quantity}; give one of {fitting}")
    return value.word
