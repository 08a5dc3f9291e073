"""Plausibility warnings for buildings and ground motions, most of which are caused by wrong units.

Unusual buildings are never refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.record import peak_warnings
from tdint.model.building import Building, stiffness_after_yield, unstable_after_yield
from tdint.model.definition import Model
from tdint.number_parsing import abbreviate
from tdint.units import STANDARD_GRAVITY

_MAX_LISTED = 3  # maximum number of stories or ground motions that one warning lists
_MANY = 10  # maximum number of warnings on the buildings of a study


@dataclass(frozen=True)
class Usual:
    """Usual range of a number.

    Attributes
    ----------
    name : str
        Name of the number in warnings.
    low, high : float
        Usual range.
    form : str
        Format with the unit.
    reason : str
        Examples and a question that help to find the error.
    """

    name: str
    low: float
    high: float
    form: str
    reason: str

    def text(self, value: float) -> str:
        """Return a number with its unit."""
        return self.form.format(value)

    def contains(self, value: float) -> bool:
        """Return True if a number is usual or nan."""
        return math.isnan(value) or self.low <= value <= self.high

    def warning(self, values: str) -> str:
        """Return the warning for unusual numbers; `values` lists them with their stories."""
        limits = f"{self.text(self.low)} to {self.text(self.high)}"
        usual = f"at most {self.text(self.high)}" if self.low <= 0.0 else limits
        return f"{self.name} {values}, usual: {usual} ({self.reason})"


_SECONDS, _METERS = "{:.3g} s", "{:.3g} m"

PERIOD = Usual(
    "fundamental period",
    0.03,
    12.0,
    _SECONDS,
    "a one-story masonry house has 0.05 s, the tallest towers 10 s: are the units of mass and "
    "stiffness right?",
)
DAMPING = Usual(
    "damping ratio of the first mode",
    0.005,
    0.20,
    "{:.3g}",
    "buildings have 0.01 to 0.07, with dampers up to 0.2: a percentage is written 5% or 0.05; does "
    "the damping include the mode of the isolators?",
)
"""The lower bound is the smallest ratio that is measured in buildings, steel towers in weak wind.
It detects damping that does not reach the first mode, such as a percentage of a percentage, or
dashpots of the superstructure only under a building on isolators."""

HEIGHT = Usual(
    "story height",
    1.5,
    15.0,
    _METERS,
    "offices have 3 to 5 m, tall halls 15 m: is the unit of length right?",
)
FLOOR = Usual(
    "mass of a floor", 1e3, 1e8, "{:.3g} kg",
    "a garden house has 2000 kg, a floor of 100 m by 100 m has 1e7 kg: is the unit of mass right?",
)  # fmt: skip
STRENGTH = Usual(
    "yield force over the weight above:",
    0.005,
    3.0,
    "{:.3g}",
    "smaller values would yield in wind, codes require 0.03 to 0.3, low walls have 2: are the "
    "units of force and mass right?",
)
BASE_STRENGTH = Usual(
    "base shear at yield over the weight",
    0.03,
    3.0,
    "{:.3g}",
    "codes require 0.03 to 0.3: do the stiffness and the yield force fit this number of stories?",
)
STEP = Usual(
    "steps in a fundamental period",
    10.0,
    math.inf,
    "{:.3g}",
    "with a tenth of the period, peaks have errors of several percent: use a smaller analysis.dt",
)
COLLAPSE = Usual(
    "collapse_drift",
    0.0,
    0.20,
    "{:.3g}",
    "tests of stories end at 0.03 to 0.15: a percentage is written 10% or 0.1",
)
DUCTILITY = Usual(
    "ductility", 0.0, 50.0, "{:.3g}",
    "tests end below 20: is the yield force, or the unit of the record, right?",
)  # fmt: skip
"""The ranges are wide enough for usual buildings and records, and narrow enough to detect a unit
that is wrong by a factor of 1000."""


UNDAMPED = (
    "the first mode is undamped: its response to a ground motion grows with the duration, and the "
    "vibration does not decay after yield; add `damping` or dashpots, or give the reason with "
    "`plausibility: off, REASON`"
)


def plausibility_warnings(
    model: Model, building: Building, pga: float = math.nan, *, has_motion: bool = False
) -> tuple[str, ...]:
    """Return all warnings on a building, and on the peak ground acceleration.

    In addition to unusual values, these are stories with P-delta larger than the stiffness after
    yield, isolators without restoring stiffness, and an undamped model under a ground motion.

    Parameters
    ----------
    model : Model
        The building.
    building : Building
        The same as arrays.
    pga : float
        Peak ground acceleration, m/s^2; nan by default, if unknown.
    has_motion : bool
        True if the building is under a ground motion. Free vibration and forces on floors are
        often studied without damping.
    """
    warnings = unusual_values(model, building, pga)
    if has_motion and not model.plausibility_off and building.approximate_first_mode[1] <= 0.0:
        warnings.append(UNDAMPED)
    # The residual drift of an isolator without restoring stiffness is arbitrary.
    unrestored = [
        i + 1 for i in building.isolators if stiffness_after_yield(model.stories[i]) <= 0.0
    ]
    if unrestored:
        warnings.append(
            f"isolator of story {', '.join(map(str, unrestored))} has no stiffness after yield: no "
            "force moves it back, so residual drifts are arbitrary; add hardening"
        )
    return (*warnings, *unstable_after_yield(model))


def unusual_values(model: Model, building: Building, pga: float = math.nan) -> list[str]:
    """Return a warning for each unusual value of a building.

    `pga` is the peak ground acceleration, m/s^2; nan if unknown.
    """
    if model.plausibility_off:
        return [*peak_warnings(pga)]
    omega, damping = building.approximate_first_mode
    period = 2.0 * math.pi / omega
    # A model without any damping is a choice: textbook examples and free vibration are undamped. A
    # small ratio is damping that does not reach the first mode.
    checked_damping = damping if damping > 0.0 else math.nan
    checked_values = (
        (PERIOD, period),
        (DAMPING, checked_damping),
        (COLLAPSE, model.collapse_drift),
    )
    warnings = [
        bound.warning(bound.text(value))
        for bound, value in checked_values
        if not bound.contains(value)
    ]
    warnings += peak_warnings(pga)
    # Strength divided by the weight of the floors above, as codes specify base shears.
    weight = STANDARD_GRAVITY * np.cumsum(building.mass[::-1])[::-1]
    strength = building.yield_drift * np.array([story.stiffness for story in model.stories])
    warnings += [
        *unusual_stories(HEIGHT, building.heights),
        *unusual_stories(STRENGTH, strength / weight),
        *_unusual_floors(building, period),
    ]
    # No code requires a base shear below the bound. Isolators yield early; a base without a height
    # is not part of a building; a strength below the bound of the stories is reported already.
    base_strength_ratio = float(strength[0] / weight[0])
    is_base_checked = math.isfinite(building.heights[0]) and STRENGTH.contains(base_strength_ratio)
    if is_base_checked and not BASE_STRENGTH.contains(base_strength_ratio):
        warnings.append(BASE_STRENGTH.warning(BASE_STRENGTH.text(base_strength_ratio)))
    return warnings


def _unusual_floors(building: Building, period: float) -> list[str]:
    """Return a warning on floors that are unusually light or heavy; `period` is the first period.

    With 200 kg instead of 200 t and a stiffness in kN/m, the period is usual, so the period does
    not reveal this error. Models without story heights are skipped, because they may represent a
    laboratory test or a textbook example.
    """
    if not PERIOD.contains(period):
        return []
    usual = building.heights >= HEIGHT.low
    return unusual_stories(FLOOR, np.where(usual, building.mass, math.nan))


# Minimum number of time steps in the fundamental period if the time step is the sampling interval
# of the record. The default method has errors of 0.05 to 0.3 % with 8 steps and of up to 3 % with
# 6. With several samples per step, errors are 10 % or more with 10 steps, so `STEP` applies.
_SAMPLES = 7.0


def long_step(building: Building, dt: float | None, interval: float | None) -> list[str]:
    """Return a warning on a time step that is long compared with the fundamental period.

    Parameters
    ----------
    building : Building
        The building.
    dt : float or None
        Time step, s; None is the sampling interval of the record.
    interval : float or None
        Sampling interval of the record, s; None without a record.
    """
    period = 2.0 * math.pi / building.approximate_first_mode[0]
    step = dt or interval
    if step is None or STEP.contains(period / step):
        return []
    # Time steps up to the sampling interval need fewer steps in the period.
    if interval is not None and step <= interval and period / step >= _SAMPLES:
        return []
    return [
        f"time step {step:.4g} s: {STEP.text(period / step)} steps in the fundamental period, "
        f"usual: at least {STEP.text(STEP.low)} ({STEP.reason})"
    ]


def study_plausibility_warnings(models: Iterable[tuple[Model, Building]]) -> tuple[str, ...]:
    """Return the warnings on the buildings of a study, each with its model file.

    The same warning on several models is one line; of many lines the first ones are returned.

    Parameters
    ----------
    models : iterable of (Model, Building)
        Models, and the same as arrays.
    """
    sources: dict[str, list[str]] = {}
    for model, building in models:
        for text in plausibility_warnings(model, building, has_motion=True):
            sources.setdefault(text, []).append(model.source)
    lines = []
    for text, named in sources.items():
        # Variations of one model have the same file.
        files = list(dict.fromkeys(named))
        more = f" and {len(files) - 1} more" if len(files) > 1 else ""
        lines.append(f"{files[0]}{more}: {text}")
    if len(lines) > _MANY:
        more = f"{len(lines) - _MANY} more warnings on the buildings; `tdint check` lists all"
        lines = [*lines[:_MANY], more]
    return tuple(lines)


def suppression_reason(model: Model) -> list[str]:
    """Return a note if the model suppresses plausibility warnings, with the reason."""
    return (
        [f"plausibility warnings are not shown: {model.plausibility_off}"]
        if model.plausibility_off
        else []
    )


def unusual_stories(bound: Usual, values: Array | Sequence[float]) -> list[str]:
    """Return a warning on the stories with unusual values; empty if all values are usual."""
    numbers = np.asarray(values, dtype=float).tolist()
    if all(map(bound.contains, numbers)):
        return []
    return unusual(bound, {f"story {number}": value for number, value in enumerate(numbers, 1)})


def unusual(bound: Usual, values: Mapping[str, float]) -> list[str]:
    """Return a warning that lists the first unusual values; empty if all values are usual.

    `values` contains the values by the name of the story or ground motion.
    """
    listed = [
        f"{bound.text(value)} in {name}"
        for name, value in values.items()
        if not bound.contains(value)
    ]
    return [bound.warning(abbreviate(listed, _MAX_LISTED))] if listed else []
