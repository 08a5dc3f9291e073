"""Read the sections `units`, `damping` and `damage` of model and campaign files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tdint import units
from tdint.errors import UsageError
from tdint.ground_motion.reading.sample_units import SampleUnits, file_units, units_of_text
from tdint.model.damage_states import DEMANDS, DamageStates
from tdint.model.definition import Damping, ModalDamping, RayleighCoefficients, RayleighRatio
from tdint.model.keys.fields import (
    NOT_NEGATIVE,
    POSITIVE_RATIO,
    RATIO,
    Bounds,
    Choice,
    Either,
    EntriesOf,
    Key,
    Keys,
    Schema,
    Section,
    Value,
    ValueKind,
    Words,
    numbered,
)
from tdint.units import parse_with_unit

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
    damping = replace(value, kind=_declared(count)).read() if value else None
    if isinstance(damping, float):
        return RayleighRatio((damping, damping), (1, min(count or 1, _LAST_MODE)))
    return None if damping == "none" else damping


# ---- Damage

LOSS = Bounds(0.0, 1.0, ratio=True)
COLLAPSE = "collapsed"
_STATE = r"^[A-Za-z][A-Za-z0-9_-]*$"
_UNITS = {"m/s^2": ("acceleration", "0.3 g"), "m": ("displacement", "12 mm")}


@dataclass(frozen=True)
class ByState:
    """Mapping from the names of damage states, from the lightest, to values."""

    kind: ValueKind

    def schema(self) -> Schema:
        return {
            "type": "object",
            "patternProperties": {_STATE: self.kind.schema()},
            "additionalProperties": False,
        }


THRESHOLDS = ByState(Either((POSITIVE_RATIO, Words())))
DEMAND = Key(
    "demand",
    Choice(tuple(DEMANDS), "demand"),
    "response quantity that determines the state; default: drift_ratio",
)
DISPERSION = Key(
    "dispersion",
    Bounds(0.0, 3.0),
    "standard deviation of the logarithms of the thresholds; 0: exact",
)
_LOSSES_MEANING = "loss ratio in each state; `collapsed` if it differs from the last state"
DAMAGE = Keys(
    (
        DEMAND,
        Key(
            "thresholds", THRESHOLDS, "median demand of each state, from the lightest", needed=True
        ),
        DISPERSION,
        Key("losses", ByState(LOSS), _LOSSES_MEANING),
    )
)
"""Keys of the section `damage` of a model file."""


def read_damage(value: Value | None) -> DamageStates | None:
    """Return the damage states of a model; None without damage states or after an error."""
    section = value.section(DAMAGE) if value else None
    thresholds = section.need("thresholds", "give the demand of each state") if section else None
    if section is None or thresholds is None:
        return None
    return states_of(section, section.read("demand", "drift_ratio") or "", thresholds)


def states_of(section: Section, demand: str, thresholds: Value) -> DamageStates | None:
    """Return the damage states of a file, or None after reporting an error.

    Parameters
    ----------
    section : Section
        Section with the keys `dispersion` and `losses`.
    demand : str
        Response quantity, a key of `DEMANDS`.
    thresholds : Value
        Median demand of each state.
    """
    values = _by_state(thresholds, "the demand of each state, such as {slight: 0.5%}")
    if values is None or demand not in DEMANDS:
        return None
    medians = tuple(threshold_of(entry, demand) for entry in values.values())
    dispersion = section.need("dispersion", "give 0 for exact thresholds")
    losses = read_losses(section.get("losses"), tuple(values))
    beta = dispersion.number(DISPERSION.kind) if dispersion else math.nan  # type: ignore[arg-type]
    if losses is None or any(map(math.isnan, (*medians, beta))):
        return None
    try:
        return DamageStates(demand, tuple(values), medians, beta, losses)
    except UsageError as error:
        thresholds.fault(str(error))
        return None


def threshold_of(value: Value, demand: str) -> float:
    """Return a threshold in SI units, or nan after reporting an error.

    Parameters
    ----------
    value : Value
        Threshold in the file.
    demand : str
        Response quantity, a key of `DEMANDS`.
    """
    unit = DEMANDS[demand].unit
    if unit == "1":
        return value.number(POSITIVE_RATIO)
    return value.parsed(lambda text: parse_with_unit(text, *_UNITS[unit])) or math.nan


def read_losses(value: Value | None, states: Sequence[str]) -> tuple[float, ...] | None:
    """Return the loss ratios of all states and of collapse.

    The result is empty without losses, and None after reporting an error.

    Parameters
    ----------
    value : Value or None
        Loss ratio of each state; None without losses.
    states : sequence of str
        Names of the damage states.
    """
    if value is None:
        return ()
    values = _by_state(value, "the loss ratio of each state, such as {slight: 5%}")
    if values is None:
        return None
    missing, unknown = (
        [state for state in states if state not in values],
        set(values) - {*states, COLLAPSE},
    )
    if missing or unknown:
        problem = (
            f"no loss ratio of {', '.join(missing)}"
            if missing
            else f"unknown state {', '.join(sorted(unknown))}"
        )
        value.fault(f"{problem}; the states are {', '.join(states)}, and optionally {COLLAPSE}")
        return None
    losses = {name: entry.number(LOSS) for name, entry in values.items()}
    return None if any(map(math.isnan, losses.values())) else losses_of(losses, states)


def losses_of(losses: Mapping[str, float], states: Sequence[str]) -> tuple[float, ...]:
    """Return the loss ratios in the order of the states, followed by the ratio of collapse.

    The default for collapse is the loss ratio of the last state.

    Parameters
    ----------
    losses : mapping of str to float
        Loss ratio of each state and, optionally, of collapse.
    states : sequence of str
        Names of the damage states.
    """
    return (*(losses[state] for state in states), losses.get(COLLAPSE, losses[states[-1]]))


def _by_state(value: Value, expected: str) -> dict[str, Value] | None:
    """Return the entries by the names of states, or None after reporting an error.

    Parameters
    ----------
    value : Value
        Mapping with one entry for each state.
    expected : str
        Description of the mapping, for messages.
    """
    entries = value.named(expected, f"is empty; give {expected}")
    for name, entry in (entries or {}).items():
        if not is_state(name):
            entry.fault("the name of a state must consist of letters, digits, _ and -")
            return None
    return entries


def is_state(name: str) -> bool:
    """Return True if a text is a valid name of a damage state."""
    return name.isascii() and name.replace("_", "").replace("-", "").isalnum() and name[0].isalpha()
