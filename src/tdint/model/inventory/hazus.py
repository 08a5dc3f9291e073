"""The building types of Hazus: capacity, hysteresis, period and damping by design level and type.

The table `hazus_types.csv` holds the numbers of Hazus-MH 2.1 (FEMA, Technical Manual, chapter 5) in the form that Lu,
Lu, Guan and Ye (Earthquake Spectra 30, 2014) and SimCenter's regional workflow use for shear buildings.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files

LEVELS = ("pre", "low", "moderate", "high")
"""Design levels from the weakest to the strongest."""


@dataclass(frozen=True)
class HazusType:
    """A row of the table.

    Attributes
    ----------
    design_level, type : str
        One of `LEVELS`; a type with its class of height, such as C1M.
    min_stories, max_stories : float
        Stories that the row is made for.
    yield_acceleration_g : float
        Yield force of the building over its weight, but for the share of mass that the first mode moves.
    overstrength : float
        Ultimate over yield force.
    post_yield_ratio : float
        Stiffness after yielding over the initial one.
    pinching, unloading_exponent : float
        As in the trilinear-pinching law.
    period_per_story_s : float
        Fundamental period over number of stories, s.
    damping_ratio : float
        Viscous damping ratio.
    slight_drift_ratio, moderate_drift_ratio, extensive_drift_ratio, complete_drift_ratio : float
        Median drift ratios of the damage states.
    """

    design_level: str
    type: str
    min_stories: float
    max_stories: float
    yield_acceleration_g: float
    overstrength: float
    post_yield_ratio: float
    pinching: float
    unloading_exponent: float
    period_per_story_s: float
    damping_ratio: float
    slight_drift_ratio: float
    moderate_drift_ratio: float
    extensive_drift_ratio: float
    complete_drift_ratio: float


@cache
def hazus_types() -> Mapping[tuple[str, str], HazusType]:
    """The table by design level and type."""
    text = (files("tdint.model.inventory") / "hazus_types.csv").read_text(encoding="utf-8")
    words = ("design_level", "type")
    names = [field.name for field in fields(HazusType)]
    rows = (
        HazusType(*(row[name] if name in words else float(row[name]) for name in names))  # type: ignore[arg-type]
        for row in csv.DictReader(text.splitlines())
    )
    return {(row.design_level, row.type): row for row in rows}
