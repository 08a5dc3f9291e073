"""Read the sections `units` and `damping` of model and campaign files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from tdint import units
from tdint.ground_motion.reading.sample_units import SampleUnits, file_units, units_of_text
from tdint.model.config.keys import keys
from tdint.model.definition import Damping, ModalDamping, RayleighCoefficients, RayleighRatio
from tdint.model.keys import fields

# ---- The section `units` of a model file, and the units of the samples of a record

_MASS_ADVICE = (
    "give the `weight` of the stories instead of the mass, or divide by the acceleration of "
    "gravity, mass = W/g, in kip*s^2/in, kgf*s^2/m or another unit of mass"
)

_UNITS_WITHOUT_MASS = tuple(
    unit for unit in (*units.LENGTH, *units.FORCE) if unit not in ("m", "N")
)
"""Units of length and force that do not determine the unit of mass: with kN it is usually t, with
mm it can be any unit."""

UNITS = fields.Keys(
    keys(
        "units",
        length=fields.Choice(tuple(units.LENGTH)),
        force=fields.Choice(tuple(units.FORCE)),
        mass=fields.Choice(tuple(units.MASS)),
    )
)


class ModelUnits(NamedTuple):
    """Factors from the units of the file to SI units, and the names of these units.

    Attributes
    ----------
    length, force, mass : float
        Factors to m, N and kg.
    named : OutputUnits
        Names of the units of the file. They are the default units of reports.
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
        """Return the factor to SI units for a quantity with the unit force^`force` length^`length`.

        A stiffness, for example, has force=1 and length=-1. The factor is inf on overflow.
        """
        try:
            return float(self.force**force * self.length**length)
        except OverflowError:
            return math.inf


def read_units(section: fields.Section) -> ModelUnits:
    """Return the units of the file. Default: m, N and kg.

    Parameters
    ----------
    section : Section
        Section with the keys of `UNITS`; empty if the file does not contain them.
    """

    def read_unit(name: str, factors: Mapping[str, float], default: str) -> str:
        """Return the unit at the key `name`, or `default` if it is missing or invalid; the keys of
        `factors` are the allowed units."""
        entry = section.get(name)
        # A unit of force for a mass has a separate message that explains the conversion.
        if name == "mass" and entry and any(map(entry.is_word, units.FORCE)):
            entry.fault(f"{entry.node.text} is a unit of force; {_MASS_ADVICE}")  # type: ignore[union-attr]
            return default
        if not entry:
            return default
        chosen = entry.choice(
            factors, f"{name} unit", lambda text: units.unit_advice(text, factors)
        )
        return chosen or default

    length, force = read_unit("length", units.LENGTH, "m"), read_unit("force", units.FORCE, "N")
    mass, has_mass_unit = read_unit("mass", units.MASS, "kg"), section.mentions("mass")
    # If the file uses other units than m and N, its masses are rarely in kg. The reader of the
    # stories then requires the unit of mass.
    entries = [entry for name in ("length", "force") if (entry := section.get(name))]
    is_mass_ambiguous = any(
        entry.is_word(unit) for entry in entries for unit in _UNITS_WITHOUT_MASS
    )
    return ModelUnits(
        units.LENGTH[length],
        units.FORCE[force],
        units.MASS[mass],
        units.OutputUnits(
            length, force, mass if has_mass_unit else units.matching_mass_unit(force, length)
        ),
        mass_is_open=is_mass_ambiguous and not has_mass_unit,
    )


def read_inertia(
    section: fields.Section, unit: ModelUnits, name: str = "inertance", length: int = 0
) -> float:
    """Return the inertance (kg), or another inertia of an entry in kg m^`length`; 0 without the
    key."""
    value = section.get(name)
    if value and unit.mass_is_open:
        value.fault("the unit of mass is required: add mass to `units`")
    return value.number(scale=unit.mass * unit.factor(length=length)) if value else 0.0


def read_sample_units(value: fields.Value | None, quantity: str | None = None) -> str | None:
    """Return the units of samples as text; None if they are missing or invalid. Units of another
    quantity than the required are reported and returned.

    Parameters
    ----------
    value : Value | None
        Value of the key `units`; None if it is missing.
    quantity : str, optional
        Required quantity of the units, for example `acceleration`, if another key of the file
        specifies it. Default: any quantity of ground motion.
    """
    parsed = value.parsed(units.parse_units) if value else None
    if value is None or parsed is None:
        return None
    if quantity and parsed.quantity != quantity:
        allowed = ", ".join(units.GROUND_MOTION[quantity])
        value.fault(
            f"units of {parsed.quantity} do not fit the quantity {quantity}; give one of {allowed}"
        )
    return value.word


def read_file_units(value: fields.Value | None) -> SampleUnits | None:
    """Return the units of several records: one unit, units by file, or a table of units.

    None is the result if the value is missing, or after reporting an error with its line.
    """
    if value is None:
        return None

    def parse_file_units(text: str) -> SampleUnits:
        """Parse and check the units; a table of units is relative to the directory of the file."""
        sample_units = units_of_text(text, Path(value.faults.folder))
        file_units(sample_units)  # raises UsageError for invalid units
        return sample_units

    return value.parsed(parse_file_units)


# ---- The section `damping` of a model file. The declared types also convert the values (`make`).

_ONE_STORY_ERROR = (
    "a one-story model has one mode; write damping: 5%, {rayleigh: {ratio: 5%, modes: [1]}} "
    "(proportional to the stiffness), {rayleigh: {mass: a0, stiffness: a1}} or {modal: ratio}"
)
_SHORT_LIST_ERROR = (
    "a list must contain at least two damping ratios; write a single ratio without brackets"
)
_SECOND_MODE = 3
"""Second mode with the damping ratio of `damping: 5%`, if the building has at least three modes."""


def _damping_type(count: int | None) -> fields.Either:
    """Return the description of the key `damping` in a model file: the allowed forms of the value,
    and functions `make` that convert a checked value to damping ratios or coefficients.

    The number of stories limits the modes; None if it is unknown.
    """
    # The value of `rayleigh` is {ratio: ..., modes: ...} or {mass: ..., stiffness: ...}.
    mode = fields.numbered(count)
    two_ratios = fields.EntriesOf(
        fields.RATIO, 2, 2, "one damping ratio or a list of two", _SHORT_LIST_ERROR
    )
    modes = fields.EntriesOf(
        mode,
        1,
        2,
        "a list of two modes, or of one mode for damping proportional to the stiffness",
        distinct="" if count == 1 else "two different modes",
    )
    rayleigh = fields.Keys(
        keys("rayleigh", ratio=fields.Either((fields.RATIO, two_ratios)), modes=modes),
        alternative_groups=(("ratio", "modes"), ("mass", "stiffness")),
        description="{ratio: ..., modes: ...} or {mass: ..., stiffness: ...}",
        make=lambda value, **entries: _rayleigh(value, count, **entries),
    )
    # The value of `modal` is a ratio for all modes, a list of ratios, or {ratio: ..., modes: ...}
    # for the first modes.
    list_text = f"a list of at most {count} damping ratios (one per mode)"
    ratio_list = fields.EntriesOf(fields.RATIO, 2, count, list_text, _SHORT_LIST_ERROR)
    first_modes = fields.Keys(
        keys("modal", ratio=fields.Either((fields.RATIO, ratio_list)), modes=mode),
        make=lambda value, ratio, modes, p_delta: _modal(value, count, ratio, modes, p_delta),
    )
    modal = fields.Either((fields.RATIO, ratio_list, first_modes))
    # A mapping contains exactly one of the keys `rayleigh` and `modal`. A list of ratios has been
    # converted to a tuple.
    forms = fields.Keys(
        keys("damping", rayleigh=rayleigh, modal=modal),
        one_of=(("rayleigh", "modal"),),
        alternative_groups=(("rayleigh",), ("modal",)),
        description="none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}",
        make=lambda value, rayleigh, modal: (
            rayleigh
            or (
                modal
                if isinstance(modal, ModalDamping)
                else _modal(value, count, modal, None, None)
            )
        ),
    )
    return fields.Either((fields.Choice(("none",)), fields.RATIO, forms), forms.description)


def _modal(
    value: fields.Value, count: int | None, ratio: Any, modes: int | None, p_delta: bool | None
) -> ModalDamping:
    """Return modal damping with one ratio, or with a tuple of ratios of the first modes."""
    ratios = ratio if isinstance(ratio, tuple) else (ratio,)
    if modes is not None and len(ratios) > 1:
        value.fault("give either a list of ratios, or one ratio and `modes`, not both")
    elif modes is not None:
        # `ModalDamping` applies the last ratio to all further modes; here it is 0.
        ratios = ratios * modes + (0.0,) * (modes != count)
    return ModalDamping(ratios, p_delta is not False)


def _rayleigh(
    value: fields.Value,
    count: int | None,
    ratio: Any,
    modes: Any,
    mass: Any,
    stiffness: Any,
    tangent: bool | None,
) -> Damping:
    """Return the Rayleigh damping of the key `rayleigh`. Ratio and modes (from 1) are an error for
    one story; `count` is `None` if unknown.

    `mass` and `stiffness` are the coefficients of the mass and stiffness matrix, 1/s and s; None if
    ratio and modes are given.
    """
    if mass is not None:
        return RayleighCoefficients(mass, stiffness, bool(tangent))
    if count == 1 and len(modes) > 1:
        value.fault(_ONE_STORY_ERROR)
    ratios = ratio if isinstance(ratio, tuple) else (ratio,) * len(modes)
    if len(ratios) > len(modes):
        value.fault("two damping ratios require two modes; give one ratio for one mode")
        return None
    return RayleighRatio(ratios, modes, bool(tangent))


DAMPING = _damping_type(None)


def read_damping(value: fields.Value | None, count: int | None) -> Damping:
    """Return the damping of a building; None without damping or after reporting an error.

    A single ratio is Rayleigh damping in modes 1 and 3, or in modes 1 and `count` for fewer than
    three stories.

    Parameters
    ----------
    count : int | None
        Number of stories; None if it is unknown after an error.
    """
    damping = value._replace(type=_damping_type(count)).read() if value else None
    if isinstance(damping, float):
        return RayleighRatio((damping, damping), (1, min(count or 1, _SECOND_MODE)))
    return None if damping == "none" else damping
