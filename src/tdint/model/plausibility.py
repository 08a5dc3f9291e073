"""What is unusual for a building, told before it misleads: mostly a unit that was mistaken. It is
never refused."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.record import doubt_of_peak
from tdint.model.building import Building, falling_stories, stiffness_after_yield
from tdint.model.definition import Model
from tdint.units import STANDARD_GRAVITY
from tdint.written_numbers import first_few

_FEW = 3  # stories or motions that a line names
_MANY = 10  # lines on the buildings of a study


@dataclass(frozen=True)
class Usual:
    """What is usual of a number: its name, from where to where, how it is written, and why."""

    name: str
    low: float
    high: float
    form: str
    reason: str

    def text(self, value: float) -> str:
        """The number as people read it."""
        return self.form.format(value)

    def holds(self, value: float) -> bool:
        """Whether a number is usual; one that is not known is."""
        return math.isnan(value) or self.low <= value <= self.high

    def told(self, values: str) -> str:
        """The line on what is not usual: the number and its place in words."""
        ends = f"{self.text(self.low)} to {self.text(self.high)}"
        usual = f"at most {self.text(self.high)}" if self.low <= 0.0 else f"{ends}"
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
    0.0,
    0.20,
    "{:.3g}",
    "buildings have 0.01 to 0.07, with dampers up to 0.2: a percentage is written 5% or 0.05",
)
HEIGHT = Usual(
    "story height",
    1.5,
    15.0,
    _METERS,
    "offices have 3 to 5 m, tall halls 15 m: is the unit of length right?",
)
FLOOR = Usual(
    "mass of a floor", 1e3, 1e8, "{:.3g} kg",
    "that of a garden house has 2000 kg, one of 100 m by 100 m 1e7 kg: is the unit of mass right?",
)  # fmt: skip
STRENGTH = Usual(
    "yield force over the weight above:",
    0.005,
    3.0,
    "{:.3g}",
    "less would yield in wind, codes ask for 0.03 to 0.3, low walls have 2: are the units of force "
    "and mass right?",
)
BASE_STRENGTH = Usual(
    "base shear at yield over the weight",
    0.03,
    3.0,
    "{:.3g}",
    "codes ask for 0.03 to 0.3: do the stiffness and the yield force belong to so many stories?",
)
STEP = Usual(
    "steps in a fundamental period",
    10.0,
    math.inf,
    "{:.3g}",
    "a tenth of the period leaves peaks several percent off: name a smaller analysis.dt",
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
"""All bounds: wide enough that a usual building or record is never told of, narrow enough for a
unit of 1000."""


def doubts(model: Model, building: Building, pga: float = math.nan) -> tuple[str, ...]:
    """What is unusual of a building, and of the ground motion's peak (m/s^2), a line each; and what
    can be said of its stories before it is run: P-delta beyond the stiffness after yield, isolators
    that nothing brings back."""
    told = mistakable(model, building, pga)
    # Such a building may end anywhere: no error of the method.
    loose = [i + 1 for i in building.isolators if stiffness_after_yield(model.stories[i]) <= 0.0]
    if loose:
        told.append(
            f"isolator of story {', '.join(map(str, loose))} has no stiffness after yield: nothing "
            "brings it back to its place, residual drifts are the motion's chance; give it "
            "hardening"
        )
    return (*told, *falling_stories(model))


def mistakable(model: Model, building: Building, pga: float = math.nan) -> list[str]:
    """Return a warning for each unusual value of a building and for an unusual peak ground
    acceleration (m/s^2): most of them are mistaken units."""
    if model.plausibility_off:
        return [*doubt_of_peak(pga)]
    omega, damping = building.first_mode()
    judged = ((PERIOD, 2.0 * math.pi / omega), (DAMPING, damping), (COLLAPSE, model.collapse_drift))
    told = [bound.told(bound.text(value)) for bound, value in judged if not bound.holds(value)]
    told += doubt_of_peak(pga)
    # Strengths over the weight above them, as codes give base shears.
    weight = STANDARD_GRAVITY * np.cumsum(building.mass[::-1])[::-1]
    strength = building.yield_drift * np.array([story.stiffness for story in model.stories])
    told += [
        *unusual_stories(HEIGHT, building.heights),
        *unusual_stories(STRENGTH, strength / weight),
        *_unusual_floors(building),
    ]
    # No code requires a base shear below the bound. Isolators yield early; a base without a height
    # is not part of a building; a strength below the bound of the stories is reported already.
    at_base = float(strength[0] / weight[0])
    judged_at_base = math.isfinite(building.heights[0]) and STRENGTH.holds(at_base)
    if judged_at_base and not BASE_STRENGTH.holds(at_base):
        told.append(BASE_STRENGTH.told(BASE_STRENGTH.text(at_base)))
    return told


def _unusual_floors(building: Building) -> list[str]:
    """Return a warning on floors that are too light or too heavy: with 200 kg instead of 200 t and
    a stiffness in kN/m, the period is usual. Models without story heights may be of a laboratory
    or a textbook."""
    usual = (building.heights >= HEIGHT.low) & PERIOD.holds(
        2.0 * math.pi / building.first_mode()[0]
    )
    return unusual_stories(FLOOR, np.where(usual, building.mass, math.nan))


# Of a record's own interval, on which the motion is straight: the default errs by .05 to .3 % with
# 8 of them in the period of low buildings, by up to 3 % with 6; several samples to a step leave 10
# % and more with 10.
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
    period = 2.0 * math.pi / building.first_mode()[0]
    step = dt or interval
    of_record = interval is not None and step is not None and step <= interval
    if step is None or STEP.holds(period / step) or (of_record and period / step >= _SAMPLES):
        return []
    return [
        f"time step {step:.4g} s: {STEP.text(period / step)} steps in the fundamental period, "
        f"usual: at least {STEP.text(STEP.low)} ({STEP.reason})"
    ]


def on_plausibility(models: Iterable[tuple[Model, Building]]) -> tuple[str, ...]:
    """Return the warnings on the buildings of a study, each with its model file.

    The same warning on several models is one line; of many lines the first ones are returned.

    Parameters
    ----------
    models : iterable of (Model, Building)
        Models, and the same as arrays.
    """
    sources: dict[str, list[str]] = {}
    for model, building in models:
        for text in doubts(model, building):
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
    """A note, where a model says that what is unusual of it is meant so."""
    return (
        [f"plausibility warnings are not shown: {model.plausibility_off}"]
        if model.plausibility_off
        else []
    )


def unusual_stories(bound: Usual, values: Array | Sequence[float]) -> list[str]:
    """A line on the stories whose values are not usual; none if all are."""
    return unusual(
        bound, {f"story {number}": value for number, value in enumerate(values, start=1)}
    )


def unusual(bound: Usual, values: Mapping[str, float]) -> list[str]:
    """A line on the places whose values are not usual, the first few by name; none if all are."""
    places = [
        f"{bound.text(value)} in {place}"
        for place, value in values.items()
        if not bound.holds(value)
    ]
    return [bound.told(first_few(places, _FEW))] if places else []
