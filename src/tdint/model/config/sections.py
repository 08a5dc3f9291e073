"""Sections of model and campaign files: `units`, `damping`, `damage`."""

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

# ---- The `units` of a model file, and those of the samples of a record that a file names

_WEIGHT = (
    "give the stories `weight` in place of mass, or divide by the acceleration of gravity, mass = "
    "W/g, in kip*s^2/in or kip*s^2/ft"
)

_OPEN = tuple(unit for unit in (*units.LENGTH, *units.FORCE) if unit not in ("m", "N"))
"""Units of length and force that leave open what a mass is in: beside kN it is mostly t, beside mm
anything."""

_MASSES = {"kN": "t", "MN": "t", "lbf": "lb", "kip": "kip*s^2/ft"}
"""The unit in which a mass is told beside a force where the file says none; beside others kg."""

UNITS = Keys(
    (
        Key("length", Choice(tuple(units.LENGTH)), "unit of length; m where it is left out"),
        Key("force", Choice(tuple(units.FORCE)), "unit of force; N where it is left out"),
        Key(
            "mass",
            Choice(tuple(units.MASS)),
            "unit of mass; kg where it is left out, but needed for masses where length is not m or "
            "force not N",
        ),
    )
)


@dataclass(frozen=True)
class ModelUnits:
    """Factors from the file's units to SI, and how results are told in them."""

    length: float
    force: float
    mass: float
    named: units.OutputUnits
    mass_is_open: bool = False
    """Lengths are not in m or forces not in N, and the unit of mass is not said: kg would be a
    guess."""

    def factor(self, force: int = 0, length: float = 0) -> float:
        """The factor of the dimension force^`force` length^`length`, inf beyond double
        precision."""
        try:
            return float(self.force**force * self.length**length)
        except OverflowError:
            return math.inf


def read_units(section: Section) -> ModelUnits:
    """The units of the file, SI where it names none."""

    # A unit of force for a mass is told as such: that it is unknown would not help.
    def named(name: str, factors: Mapping[str, float], usual: str) -> str:
        entry = section.get(name)
        if name == "mass" and entry and any(map(entry.is_word, units.FORCE)):
            entry.fault(f"{entry.node.text} is a unit of force; {_WEIGHT}")  # type: ignore[union-attr]
            return usual
        return (entry.choice(factors, f"{name} unit") if entry else None) or usual

    length, force = named("length", units.LENGTH, "m"), named("force", units.FORCE, "N")
    mass, mass_is_said = named("mass", units.MASS, "kg"), section.mentions("mass")
    beside = "kip*s^2/in" if (force, length) == ("kip", "in") else _MASSES.get(force, "kg")
    # Beside such units a mass is hardly in kg: its unit is asked for where one is used.
    words = [entry for name in ("length", "force") if (entry := section.get(name))]
    foreign = any(word.is_word(unit) for word in words for unit in _OPEN)
    return ModelUnits(
        units.LENGTH[length],
        units.FORCE[force],
        units.MASS[mass],
        units.OutputUnits(length, force, mass if mass_is_said else beside),
        mass_is_open=foreign and not mass_is_said,
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


def read_file_units(value: Value | None) -> SampleUnits | None:
    """Units of several records: of all, by file, or a table of them; the fault of any has its line
    here."""
    if value is None:
        return None

    def checked(text: str) -> SampleUnits:
        said = units_of_text(text, Path(value.faults.folder))
        file_units(said)
        return said

    return value.parsed(checked)


# ---- The `damping` of a model file: its declaration is its reader

_ONE_STORY = (
    "a one-story model has one mode, and the ratio form needs two; write the ratio alone (damping: "
    "5%), {rayleigh: {mass: a0, stiffness: a1}} or {modal: ratio}"
)
_SHORT = "a list must hold at least two damping ratios; write a single one without brackets"
_LAST_MODE = 3
"""Of the two modes with the ratio of `damping: 5%`, the higher one, as far as there are so many."""


def _declared(count: int | None) -> Either:
    """What may stand under `damping` of a building with so many stories."""
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
        make=lambda value, **given: _rayleigh(value, count, **given),
    )
    first = Keys(
        (
            Key("ratio", RATIO, "damping ratio", True),
            Key("modes", mode, "how many modes have it", True, "give the number of modes to damp"),
        ),
        # A single ratio would mean all modes, so a lone first mode is followed by an undamped one.
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
    """The damping; `count` is the number of stories, None where a fault leaves it open."""
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
    """A value for each damage state, by its name, from the lightest."""

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
    "what the states are told by; drift_ratio by default",
)
DISPERSION = Key(
    "dispersion",
    Bounds(0.0, 3.0),
    "standard deviation of the logarithms of the thresholds; 0: exact",
)
_OF_LOSSES = "loss ratio in each state, and if it is another one than in the last, `collapsed`"
DAMAGE = Keys(
    (
        DEMAND,
        Key(
            "thresholds", THRESHOLDS, "median demand of each state, from the lightest", needed=True
        ),
        DISPERSION,
        Key("losses", ByState(LOSS), _OF_LOSSES),
    )
)
"""Of a model file."""


def read_damage(value: Value | None) -> DamageStates | None:
    """The damage states of a model; None without any, or after a fault."""
    section = value.section(DAMAGE) if value else None
    thresholds = section.need("thresholds", "give the demand of each state") if section else None
    if section is None or thresholds is None:
        return None
    return states_of(section, section.read("demand", "drift_ratio") or "", thresholds)


def states_of(section: Section, demand: str, thresholds: Value) -> DamageStates | None:
    """The states that a file names, with their thresholds and losses; None after a fault."""
    values = _by_state(thresholds, "the demand of each state, such as {slight: 0.5%}")
    if values is None or demand not in DEMANDS:
        return None
    medians = tuple(threshold_of(entry, demand) for entry in values.values())
    dispersion = section.need("dispersion", "give 0 for thresholds that are exact")
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
    """A threshold in SI units; nan after a fault."""
    unit = DEMANDS[demand].unit
    if unit == "1":
        return value.number(POSITIVE_RATIO)
    return value.parsed(lambda text: parse_with_unit(text, *_UNITS[unit])) or math.nan


def read_losses(value: Value | None, states: Sequence[str]) -> tuple[float, ...] | None:
    """The loss ratio of each state and of a collapse; nothing without any, None after a fault."""
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
        said = (
            f"no loss ratio of {', '.join(missing)}"
            if missing
            else f"unknown {', '.join(sorted(unknown))}"
        )
        value.fault(f"{said}; the states are {', '.join(states)}, and there may be {COLLAPSE}")
        return None
    losses = {name: entry.number(LOSS) for name, entry in values.items()}
    return None if any(map(math.isnan, losses.values())) else losses_of(losses, states)


def losses_of(losses: Mapping[str, float], states: Sequence[str]) -> tuple[float, ...]:
    """In the order of the states, that of a collapse behind them: that of the last state where it
    is not told."""
    return (*(losses[state] for state in states), losses.get(COLLAPSE, losses[states[-1]]))


def _by_state(value: Value, expected: str) -> dict[str, Value] | None:
    """The entries by the names of states; None after a fault."""
    entries = value.named(expected, f"is empty; give {expected}")
    for name, entry in (entries or {}).items():
        if not is_state(name):
            entry.fault("the name of a state is a word of letters, digits, _ and -")
            return None
    return entries


def is_state(name: str) -> bool:
    """Whether a text may be the name of a damage state."""
    return name.isascii() and name.replace("_", "").replace("-", "").isalnum() and name[0].isalpha()
