"""The `units` of a model file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tdint import units
from tdint.model.config.fields import Value


@dataclass(frozen=True)
class ModelUnits:
    """Factors from the file's units to SI."""

    length: float
    force: float
    mass: float

    def factor(self, force: int = 0, length: float = 0) -> float:
        """The factor of the dimension force^`force` length^`length`, inf beyond double precision."""
        try:
            return float(self.force**force * self.length**length)
        except OverflowError:
            return math.inf


def read_units(value: Value | None) -> ModelUnits:
    """The units of the file, SI where it names none."""
    section = value.section(("length", "force", "mass")) if value else None

    def factor(name: str, known: Mapping[str, float]) -> float:
        entry = section.get(name) if section else None
        unit = entry.choice(known, f"{name} unit") if entry else None
        return known[unit] if unit else 1.0

    return ModelUnits(factor("length", units.LENGTH), factor("force", units.FORCE), factor("mass", units.MASS))
