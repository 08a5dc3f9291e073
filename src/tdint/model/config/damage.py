"""Read the section `damage` of a model file: damage states, their thresholds and their losses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from tdint.errors import UsageError
from tdint.model.config.keys import keys
from tdint.model.damage_states import DEMANDS, DamageStates
from tdint.model.keys import fields
from tdint.units import parse_with_unit

LOSS = fields.Bounds(0.0, 1.0, ratio=True)
COLLAPSE = "collapsed"
_STATE_NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"
_THRESHOLD_UNITS = {"m/s^2": ("acceleration", "0.3 g"), "m": ("displacement", "12 mm")}
"""Quantity of a threshold and an example for messages, by the SI unit of the demand."""


_COLUMN_NAME = "peak_absolute_acceleration"
"""Name of the demand `acceleration` in tables, which is accepted also."""


def by_state(value_type: fields.ValueType) -> fields.NamedEntries:
    """Return the type of a mapping from damage states, from the lightest, to values."""
    return fields.NamedEntries(value_type, _STATE_NAME)


THRESHOLDS = by_state(fields.Either((fields.DRIFT_BOUNDS, fields.TextLine())))
DAMAGE = fields.Keys(
    keys(
        "damage",
        demand=fields.Choice((*DEMANDS, _COLUMN_NAME), "demand"),
        thresholds=THRESHOLDS,
        dispersion=fields.Bounds(0.0, 3.0),
        losses=by_state(LOSS),
    )
)
"""Keys of the section `damage` of a model file."""
DEMAND, _, DISPERSION, _ = DAMAGE.declared


def read_damage(value: fields.Value) -> DamageStates | None:
    """Return the damage states of the section `damage`; None after reporting an error."""
    section = value.section(DAMAGE)
    thresholds = section.need("thresholds", "give the demand of each state") if section else None
    if section is None or thresholds is None:
        return None
    demand = section.read("demand", "drift_ratio") or ""
    demand = "acceleration" if demand == _COLUMN_NAME else demand
    return read_damage_states(section, demand, thresholds)


def read_damage_states(
    section: fields.Section, demand: str, thresholds: fields.Value
) -> DamageStates | None:
    """Return the damage states of a file; None after reporting an error.

    Parameters
    ----------
    section : Section
        Section with the keys `dispersion` and `losses`.
    demand : str
        Response quantity, a key of `DEMANDS`.
    """
    entries = _entries_by_state(thresholds, "the demand of each state, such as {slight: 0.5%}")
    if entries is None or demand not in DEMANDS:
        return None
    medians = tuple(read_threshold(entry, demand) for entry in entries.values())
    dispersion_entry = section.need("dispersion", "give 0 for exact thresholds")
    losses = read_losses(section.get("losses"), tuple(entries))
    dispersion = math.nan
    if dispersion_entry:
        dispersion = dispersion_entry.number(DISPERSION.type)  # type: ignore[arg-type]
    if losses is None or any(map(math.isnan, (*medians, dispersion))):
        return None
    try:
        return DamageStates(demand, tuple(entries), medians, dispersion, losses)
    except UsageError as error:
        thresholds.fault(str(error))
        return None


def read_threshold(value: fields.Value, demand: str) -> float:
    """Return a threshold in SI units, or nan after reporting an error."""
    unit = DEMANDS[demand].unit
    if unit == "1":
        return value.number(fields.DRIFT_BOUNDS)
    # A threshold that is not a ratio is a text with a unit, such as 0.3 g.
    return value.parsed(lambda text: parse_with_unit(text, *_THRESHOLD_UNITS[unit])) or math.nan


def read_losses(value: fields.Value | None, states: Sequence[str]) -> tuple[float, ...] | None:
    """Return the loss ratio (loss over replacement cost) of each state and of collapse.

    The ratios are in the order of the states, followed by the ratio of collapse. The result is
    empty without losses, and None after reporting an error.

    Parameters
    ----------
    value : Value | None
        Loss ratio of each state; None without losses.
    """
    if value is None:
        return ()
    entries = _entries_by_state(value, "the loss ratio of each state, such as {slight: 5%}")
    if entries is None:
        return None
    missing = [state for state in states if state not in entries]
    unknown = set(entries) - {*states, COLLAPSE}
    if missing or unknown:
        problem = (
            f"no loss ratio of {', '.join(missing)}"
            if missing
            else f"unknown state {', '.join(sorted(unknown))}"
        )
        value.fault(f"{problem}; the states are {', '.join(states)}, and optionally {COLLAPSE}")
        return None
    losses = {name: entry.number(LOSS) for name, entry in entries.items()}
    return None if any(map(math.isnan, losses.values())) else losses_in_order(losses, states)


def losses_in_order(losses: Mapping[str, float], states: Sequence[str]) -> tuple[float, ...]:
    """Return the loss ratios in the order of the states, followed by the ratio of collapse.

    If `losses` contains no ratio of collapse, the ratio of the last state is used.

    Parameters
    ----------
    losses : mapping of str to float
        Loss ratio of each state and, optionally, of collapse.
    """
    return (*(losses[state] for state in states), losses.get(COLLAPSE, losses[states[-1]]))


def _entries_by_state(value: fields.Value, expected: str) -> dict[str, fields.Value] | None:
    """Return the entry of each damage state by its name; None after reporting an error."""
    entries = value.named(expected, f"is empty; give {expected}")
    for name, entry in (entries or {}).items():
        if not is_state(name):
            entry.fault("the name of a state must consist of letters, digits, _ and -")
            return None
    return entries


def is_state(name: str) -> bool:
    """Return True if a text is a valid name of a damage state.

    A name consists of ASCII letters, digits, _ and -, and starts with a letter.
    """
    return name.isascii() and name.replace("_", "").replace("-", "").isalnum() and name[0].isalpha()
