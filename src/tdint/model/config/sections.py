"""Read the sections `units` and `damping` of model and campaign files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tdint import units
from tdint.ground_motion.reading.sample_units import SampleUnits, file_units, units_of_text
from tdint.model.definition import Damping, ModalDamping, RayleighCoefficients, RayleighRatio
from tdint.model.keys.fields import (
    NOT_NEGATIVE,
    RATIO,
    Choice,
    Either,
    EntriesOf,
    Key,
    Keys,
    Section,
    Value,
    numbered,
)

# ---- The section `units` of a model file, and the units of the samples of a record

_WEIGHT = (
    "give the `weight` of the stories instead of the mass, or divide by the acceleration of "
    "gravity, mass = W/g, in kip*s^2/in or kip*s^2/ft"
)

_OPEN = tuple(unit for unit in (*units.LENGTH, *units.FORCE) if unit not in ("m", "N"))
"""Units of length and force that do not determine the unit of mass: with kN it is usually t, with
mm it can be any unit."""

UNITS = Keys(
    (
        Key("length", Choice(tuple(units.LENGTH)), "unit of length; default: m"),
        Key("force", Choice(tuple(units.FORCE)), "unit of force; default: N"),
        Key(
            "mass",
            Choice(tuple(units.MASS)),
            "unit of mass; default: kg; required for masses if length is not m or force is not N",
        ),
    )
)


@dataclass(frozen=True)
class ModelUnits:
    """Factors from the units of the file to SI units, and the units of reports.

    Attributes
    ----------
    length, force, mass : float
        Factors to m, N and kg.
    named : OutputUnits
        Units of reports.
    mass_is_open : bool
        True if lengths are not in m or forces are not in N, and the unit of mass is not specified:
        kg would be a guess.
    """

    length: float
    force: float
    mass: float
    named: units.OutputUnits
    mass_is_open: bool = False

    def factor(self, force: int = 0, length: float = 0) -> float:
        """Return the factor of the dimension force^`force` length^`length`; inf on overflow."""
        try:
            return float(self.force**force * self.length**length)
        except OverflowError:
            return math.inf


def read_units(section: Section) -> ModelUnits:
    """Return the units of the file. Default: SI units."""

    # A unit of force for a mass gets its own message, which explains the conversion.
    def named(name: str, factors: Mapping[str, float], usual: str) -> str:
        entry = section.get(name)
        if name == "mass" and entry and any(map(entry.is_word, units.FORCE)):
            entry.fault(f"{entry.node.text} is a unit of force; {_WEIGHT}")  # type: ignore[union-attr]
            return usual
        return (entry.choice(factors, f"{name} unit") if entry else None) or usual

    length, force = named("length", units.LENGTH, "m"), named("force", units.FORCE, "N")
    mass, mass_is_said = named("mass", units.MASS, "kg"), section.mentions("mass")
    # With other units than m and N a mass is rarely in kg, so its unit is required.
    entries = [entry for name in ("length", "force") if (entry := section.get(name))]
    foreign = any(entry.is_word(unit) for entry in entries for unit in _OPEN)
    return ModelUnits(
        units.LENGTH[length],
        units.FORCE[force],
        units.MASS[mass],
        units.OutputUnits(
            length, force, mass if mass_is_said else units.matching_mass_unit(force, length)
        ),
        mass_is_open=foreign and not mass_is_said,
    )


def read_sample_units(value: Value | None, quantity: str | None = None) -> str | None:
    """Return the units of samples as text, or None after reporting an error with its line.

    `quantity` is the required quantity if the file specifies it elsewhere.
    """
    parsed = value.parsed(units.parse_units) if value else None
    if value is None or parsed is None:
        return None
    if quantity and parsed.quantity != quantity:
        fitting = ", ".join(units.GROUND_MOTION[quantity])
        value.fault(
            f"units of {parsed.quantity} do not fit the quantity {quantity}; give one of {fitting}"
        )
    return value.word


def read_file_units(value: Value | None) -> SampleUnits | None:
    """Return the units of several records: one unit, units by file, or a table of units.

    An error is reported with the line of the value.
    """
    if value is None:
        return None

    def checked(text: str) -> SampleUnits:
        sample_units = units_of_text(text, Path(value.faults.folder))
        file_units(sample_units)
        return sample_units

    return value.parsed(checked)


# ---- The section `damping` of a model file. The declaration also reads the values.

_ONE_STORY = (
    "a one-story model has one mode, and the form with ratio and modes requires two; write "
    "damping: 5%, {rayleigh: {mass: a0, stiffness: a1}} or {modal: ratio}"
)
_SHORT = "a list must contain at least two damping ratios; write a single ratio without brackets"
_LAST_MODE = 3
"""Second mode with the damping ratio of `damping: 5%`, if the building has three modes."""


def _declared(count: int | None) -> Either:
    """Return the declaration of `damping` for a building with `count` stories."""
    mode = numbered(count)
    two = EntriesOf(RATIO, 2, 2, "one damping ratio or a list of two", _SHORT)
    modes = EntriesOf(
        mode, 2, 2, "a list of two modes", distinct="" if count == 1 else "two different modes"
    )
    rayleigh = Keys(
        (
            Key(
                "ratio",
                Either((RATIO, two)),
                "damping ratio in both modes, or in each",
                advice=f"give {two.what}",
            ),
            Key(
                "modes",
                modes,
                "two modes, from 1 at the longest period",
                advice=f"give {modes.what}",
            ),
            Key("mass", NOT_NEGATIVE, "coefficient of the mass matrix, 1/s"),
            Key("stiffness", NOT_NEGATIVE, "coefficient of the initial stiffness matrix, s"),
        ),
        ways=(("ratio", "modes"), ("mass", "stiffness")),
        what="{ratio: ..., modes: ...} or {mass: ..., stiffness: ...}",
        make=lambda value, **entries: _rayleigh(value, count, **entries),
    )
    first = Keys(
        (
            Key("ratio", RATIO, "damping ratio", True),
            Key("modes", mode, "number of modes", True, "give the number of damped modes"),
        ),
        # A tuple with one ratio means all modes. If only the first mode is damped, the tuple also
        # contains the zero ratio of the second mode.
        make=lambda _, ratio, modes: (
            (ratio, 0.0) if modes == 1 and count != 1 else (ratio,) * modes
        ),
    )
    many = f"a list of at most {count} damping ratios (one per mode)"
    ratios = Either((RATIO, EntriesOf(RATIO, 2, count, many, _SHORT), first))
    both = Keys(
        (
            Key(
                "rayleigh",
                rayleigh,
                "C = a0 M + a1 K, through the damping ratios of two modes or by coefficients",
            ),
            Key("modal", ratios, "damping ratios of modes"),
        ),
        one_of=(("rayleigh", "modal"),),
        ways=(("rayleigh",), ("modal",)),
        what="none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}",
        make=lambda _, rayleigh, modal: (
            rayleigh or ModalDamping(modal if isinstance(modal, tuple) else (modal,))
        ),
    )
    return Either((Choice(("none",)), RATIO, both), both.what)


def _rayleigh(
    value: Value, count: int | None, ratio: Any, modes: Any, mass: Any, stiffness: Any
) -> Damping:
    if mass is not None:
        return RayleighCoefficients(mass, stiffness)
    if count == 1:
        value.fault(_ONE_STORY)
    return RayleighRatio(ratio if isinstance(ratio, tuple) else (ratio, ratio), modes)


DAMPING = _declared(None)


def read_damping(value: Value | None, count: int | None) -> Damping:
    """Return the damping. `count` is the number of stories, None if unknown after an error."""
    damping = replace(value, type=_declared(count)).read() if value else None
    if isinstance(damping, float):
        return RayleighRatio((damping, damping), (1, min(count or 1, _LAST_MODE)))
    return None if damping == "none" else damping
