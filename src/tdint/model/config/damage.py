"""The section `damage` of model and campaign files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tdint.errors import UsageError
from tdint.model.damage_states import DEMANDS, DamageStates
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import POSITIVE_RATIO, Bounds, Choice, Either, Key, Keys, Schema, ValueKind, Words
from tdint.units import parse_units

LOSS = Bounds(0.0, 1.0, ratio=True)
COLLAPSE = "collapsed"
_STATE = r"^[A-Za-z][A-Za-z0-9_-]*$"
_UNITS = {"m/s^2": ("acceleration", "0.3 g"), "m": ("displacement", "12 mm")}


@dataclass(frozen=True)
class ByState:
    """A value for each damage state, by its name, from the lightest."""

    kind: ValueKind

    def schema(self) -> Schema:
        return {"type": "object", "patternProperties": {_STATE: self.kind.schema()}, "additionalProperties": False}


THRESHOLDS = ByState(Either((POSITIVE_RATIO, Words())))
DEMAND = Key("demand", Choice(tuple(DEMANDS), "demand"), "what the states are told by; drift_ratio by default")
DISPERSION = Key("dispersion", Bounds(0.0, 3.0), "standard deviation of the logarithms of the thresholds; 0: exact")
_OF_LOSSES = "loss ratio in each state, and if it is another one than in the last, `collapsed`"
DAMAGE = Keys(
    (
        DEMAND,
        Key("thresholds", THRESHOLDS, "median demand of each state, from the lightest", needed=True),
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
    return value.parsed(lambda text: threshold_in(text, demand)) or math.nan


def threshold_in(text: str, demand: str) -> float:
    """A number with its unit as a threshold in SI units.

    Raises
    ------
    UsageError
        It is none.
    """
    quantity, example = _UNITS[DEMANDS[demand].unit]
    try:
        units = parse_units(text)
    except UsageError:
        units = None
    if units is None or not units.has_factor or units.quantity != quantity:
        raise UsageError(f"must be a number with its unit, such as {example}, got {text[:40]!r}")
    return units.scale


def read_losses(value: Value | None, states: Sequence[str]) -> tuple[float, ...] | None:
    """The loss ratio of each state and of a collapse; nothing without any, None after a fault."""
    if value is None:
        return ()
    values = _by_state(value, "the loss ratio of each state, such as {slight: 5%}")
    if values is None:
        return None
    missing, unknown = [one for one in states if one not in values], set(values) - {*states, COLLAPSE}
    if missing or unknown:
        said = f"no loss ratio of {', '.join(missing)}" if missing else f"unknown {', '.join(sorted(unknown))}"
        value.fault(f"{said}; the states are {', '.join(states)}, and there may be {COLLAPSE}")
        return None
    found = {name: entry.number(LOSS) for name, entry in values.items()}
    return None if any(map(math.isnan, found.values())) else losses_of(found, states)


def losses_of(found: Mapping[str, float], states: Sequence[str]) -> tuple[float, ...]:
    """In the order of the states, that of a collapse behind them: that of the last state where it is not told."""
    return (*(found[one] for one in states), found.get(COLLAPSE, found[states[-1]]))


def _by_state(value: Value, what: str) -> dict[str, Value] | None:
    """The entries by the names of states; None after a fault."""
    section = value.section(value.names, what)
    if section is None:
        return None
    if not value.names:
        value.fault(f"is empty; give {what}")
        return None
    found = {name: entry for name in value.names if (entry := section.get(name))}
    for name, entry in found.items():
        if not is_state(name):
            entry.fault("the name of a state is a word of letters, digits, _ and -")
            return None
    return found


def is_state(name: str) -> bool:
    """Whether a text may be the name of a damage state."""
    return name.isascii() and name.replace("_", "").replace("-", "").isalnum() and name[0].isalpha()
