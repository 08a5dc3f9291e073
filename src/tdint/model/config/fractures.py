"""Read the key `fracture_drift` of a hysteretic law or an element."""

from __future__ import annotations

import math
from dataclasses import replace

from tdint.model.config.sections import ModelUnits
from tdint.model.keys.fields import DRIFT_BOUNDS, POSITIVE, Either, Key, Keys, Value
from tdint.model.story_laws import LAWS, Law

_SIDES = ("positive", "negative")
_DRIFT = Either((POSITIVE, DRIFT_BOUNDS))
FRACTURE = Key(
    "fracture_drift",
    Either((_DRIFT, Keys(tuple(Key(name, _DRIFT) for name in _SIDES)))),
    "drift at which the force is lost permanently; with %: a ratio of the story height",
)
"""Key of every law and element."""


def read_fracture(
    value: Value, law: Law, stiffness: float, unit: ModelUnits, height: float | None
) -> Law:
    """Return a law with the drifts of its fracture: one drift for both sides, or a mapping of the
    sides.

    Parameters
    ----------
    value : Value
        Mapping of the law or of the element.
    stiffness : float
        Initial stiffness, N/m.
    height : float | None
        Height of the story, m.
    """
    entry = value.peek(FRACTURE.name)
    if entry is None:
        return law
    if not entry.is_mapping:
        sides: list[Value | None] = [entry, entry]
    elif section := entry.section(list(_SIDES)):
        sides = [section.get(name) for name in _SIDES]
    else:
        return law
    drifts = [side and _read_drift(side, law, stiffness, unit, height) for side in sides]
    (positive, ratio), (negative, negative_ratio) = (drift or (0.0, 0.0) for drift in drifts)
    if math.isnan(positive + negative):
        return law
    return replace(law, fracture=(positive, -negative), fracture_ratio=(ratio, -negative_ratio))


def _read_drift(
    entry: Value, law: Law, stiffness: float, unit: ModelUnits, height: float | None
) -> tuple[float, float]:
    """Return a drift, m (nan after an error), and its ratio to the height, 0 for a length."""
    ratio = 0.0
    if not entry.is_percentage:
        drift = entry.number(POSITIVE, unit.length)
    elif height is None:
        entry.fault("needs the height of the story, or give a drift in the unit of length")
        return math.nan, ratio
    else:
        # A story height is not divided by the cosine of an inclined element.
        ratio = entry.number(DRIFT_BOUNDS)
        drift = ratio * height
    first_yield = LAWS[law.name].yield_drift(stiffness, law.parameters)
    if drift < first_yield:
        entry.fault(
            f"must be at least the yield drift {first_yield / unit.length:.6g}, got "
            f"{drift / unit.length:.6g}"
        )
    return drift, ratio
