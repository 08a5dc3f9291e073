"""Plausibility warnings about unusual values of buildings and ground motions.

Most unusual values are caused by wrong units. Unusual buildings cause warnings but no errors.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.record import peak_warnings
from tdint.items import grouped
from tdint.kernels import layout as rows
from tdint.model.building import (
    Building,
    assemble,
    period,
    stiffness_after_yield,
    unstable_after_yield,
    yield_strength,
)
from tdint.model.definition import Model, RayleighCoefficients, RayleighRatio
from tdint.model.story import Story
from tdint.model.story_laws import LAWS
from tdint.number_parsing import abbreviate, pluralize
from tdint.units import STANDARD_GRAVITY

_MAX_LISTED = 3
"""Maximum number of stories or ground motions that a warning lists, so that it is short."""

_MAX_STUDY_WARNINGS = 10
"""Maximum number of warnings about the buildings of a study; further warnings are counted."""


class UsualRange(NamedTuple):
    """Range of the usual values of a property of buildings, and the warning about other values.

    Attributes
    ----------
    name : str
        Name of the property in warnings.
    low, high : float
        Minimum and maximum usual value, SI units.
    reason : str
        Examples of values, and the items that the user should check.
    form : str
        Format string for a value with its unit.
    """

    name: str
    low: float
    high: float
    reason: str
    form: str = "{:.3g}"

    def text(self, value: float) -> str:
        """Return a value as text with its unit."""
        return self.form.format(value)

    def contains(self, value: float) -> bool:
        """Return True if a value is in the range, or nan (unknown)."""
        return math.isnan(value) or self.low <= value <= self.high

    def warning(self, values: str) -> str:
        """Return the warning about unusual values. `values` is a text that lists the values, for
        example with their stories."""
        limits = f"{self.text(self.low)} to {self.text(self.high)}"
        usual = f"at most {self.text(self.high)}" if self.low <= 0.0 else limits
        return f"unusual {self.name}: {values}; usual values are {usual} ({self.reason})"


USUAL = {
    key: UsualRange(**values)
    for key, values in tomllib.loads(
        Path(__file__).with_name("usual_values.toml").read_text(encoding="utf-8")
    ).items()
}
"""Usual values of each property, from the table `usual_values.toml`."""

_MIN_PERIOD_PER_STORY = 1.0 / 60.0  # s; stiff wall buildings have a period of n / 25 to n / 20
_MAX_HEIGHT_PER_PERIOD = 200.0  # m/s; stiff wall buildings have 70 to 150 m/s
_MAX_PERIOD_AT_GROUND = 0.42  # s
_MAX_PERIOD_PER_HEIGHT = 0.092  # s/m
_MAX_PERIOD_OF_LOW_BUILDINGS = 1.2  # s, up to 8 m: flexible halls, tanks and textbook frames
"""Line above the periods of flexible buildings: Chopra's five-story frame with 2.00 s at 18.3 m,
the SAC steel frames of Los Angeles and Seattle with 1.03 and 1.36 s at 11.9 m and 3.98 s at 80.8 m.
A period of 1.5 s at 11 m is above the line."""

_MAX_STORY_HEIGHT = 6.0
"""Story height, m, for the maximum period if no heights are specified."""


_MIN_TOWER_MASS = 0.16
"""Minimum mass per story height over the square of the height of the building, kg/m^3: a building
with 100 kg/m^3 and a height of 25 times its width. The most slender towers have a height of 24
times their width."""


_REFERENCE_DRIFT = 0.01
"""Amplitude of the drift ratio in comparisons of a power-law damper with a linear damper."""
_ISOLATOR_DRIFT = 0.2
"""The same amplitude of an isolator, m."""


UNDAMPED = (
    "the first mode is undamped: its response to a ground motion grows with the duration, and the "
    "vibration does not decay after yield; add `damping` or dashpots, or give the reason with "
    "`plausibility: off, REASON`"
)


def negative_damping(building: Building) -> list[str]:
    """Return a warning about modes with a negative damping ratio; empty if there are no such modes.

    Rayleigh damping with two specified ratios that differ much has a negative coefficient of the
    mass or of the stiffness. Other modes can then have negative ratios.
    """
    dampers = building.linear_terms[[rows.STORY_DAMPER, rows.FLOOR_DAMPER]]
    # Without negative dampers no ratio is negative, and the modes are not computed.
    if not (dampers < 0.0).any():
        return []
    ratios = building.modes().own_damping(building.damping_matrix())
    modes = (np.flatnonzero(ratios < 0.0) + 1).tolist()
    if not modes:
        return []
    text = abbreviate(list(map(str, modes)), _MAX_LISTED)
    return [
        f"negative damping ratio of mode {text} (minimum {ratios.min():.3g}): the vibration of "
        "these modes grows; choose damping ratios of the two modes of `damping` that differ less, "
        "or other modes"
    ]


def plausibility_warnings(
    model: Model, building: Building, pga: float = math.nan, *, has_motion: bool = False
) -> tuple[str, ...]:
    """Return all warnings about a building and about the peak ground acceleration.

    The warnings report unusual values, stories with a P-delta effect above the stiffness after
    yield, isolators without restoring stiffness, modes with negative damping, and an undamped model
    under a ground motion.

    Parameters
    ----------
    pga : float
        Peak ground acceleration, m/s^2; nan by default, if unknown.
    has_motion : bool
        True if the building is under a ground motion. Free vibration and forces on floors are
        often studied without damping.
    """
    complete_model = model
    model, building = _without_devices(model, building)
    warnings = unusual_values(model, building, pga)
    if complete_model.devices and not model.plausibility_off:
        warnings += _unusual_attached(complete_model, building.first_mode()[0])
    warnings += _damped_attached_stories(model)
    if has_motion and not model.plausibility_off and building.first_mode()[1] <= 0.0:
        warnings.append(UNDAMPED)
    if not model.plausibility_off:
        warnings += negative_damping(building)
    # `building.isolators` contains indices from 0; stories are numbered from 1.
    isolators_without_stiffness = [
        index + 1
        for index in building.isolators
        if stiffness_after_yield(model.stories[index]) <= 0.0
    ]
    if isolators_without_stiffness:
        numbers = ", ".join(map(str, isolators_without_stiffness))
        warnings.append(
            f"isolator of story {numbers} has no stiffness after yield: no force moves it back, so "
            "residual drifts are arbitrary; add hardening"
        )
    return (*warnings, *_law_warnings(model), *unstable_after_yield(model))


_LIGHT_STORY = 0.2
"""Maximum mass of a top story with a dashpot, over the mass of the story below, that is reported as
a possible absorber: absorbers have 0.01 to 0.1 of the mass of a building, a penthouse has 0.3 of
the mass of a floor or more."""


def _damped_attached_stories(model: Model) -> list[str]:
    """Return a warning about stories with a dashpot that are probably no stories, but have Rayleigh
    damping: a light top story (an absorber), and stories without a height in a building with
    heights (soil springs, equipment)."""
    stories = model.stories
    if model.plausibility_off or not isinstance(
        model.damping, RayleighRatio | RayleighCoefficients
    ):
        return []
    has_heights = any(story.height for story in stories)
    attached = []
    for i, story in enumerate(stories):
        is_light = 0 < i == len(stories) - 1 and story.mass <= _LIGHT_STORY * stories[i - 1].mass
        has_dashpot = story.dashpot > 0.0 or story.power_dashpot is not None
        is_story = story.height is not None or not has_heights
        if has_dashpot and story.rayleigh and not story.isolator and (is_light or not is_story):
            attached.append(str(i + 1))
    if not attached:
        return []
    return [
        f"Rayleigh damping acts on {_listed(attached)} in addition to the dashpot; an absorber or "
        "equipment on a floor belongs in `attachments`, and a soil spring needs `rayleigh: false`"
    ]


def _law_warnings(model: Model) -> list[str]:
    """Return the warnings of the hysteretic laws, each with the stories that have the law."""
    stories = grouped(
        (warning, str(number))
        for number, story in enumerate(model.stories, start=1)
        for spring in story.springs
        if (warning := LAWS[spring.law.name].warning(spring.stiffness, spring.law.parameters))
    )
    return [f"{_listed(numbers)}: {warning}" for warning, numbers in stories.items()]


def _listed(numbers: Sequence[str]) -> str:
    """Return story numbers as text, such as `stories 1, 2, 3 and 4 more`."""
    return f"{'story' if len(numbers) == 1 else 'stories'} {abbreviate(numbers, _MAX_LISTED)}"


def _without_devices(model: Model, building: Building) -> tuple[Model, Building]:
    """Return the building without attachments and links, and without the columns of further rows:
    usual values refer to stories."""
    if model.devices:
        model = replace(model, attachments=(), links=(), across=None)  # of one direction
        building = assemble(model)
    columns = [*range(len(model.stories)), -1]
    if model.matrices is not None and building.stories >= len(columns):
        building = replace(
            building,
            linear_terms=building.linear_terms[:, columns],
            law_parameters=building.law_parameters[:, columns],
            heights=building.heights[: len(model.stories)],
            yield_drift=building.yield_drift[: len(model.stories)],
        )
    return model, building


def unusual_values(model: Model, building: Building, pga: float = math.nan) -> list[str]:
    """Return warnings about unusual values of a building and of the ground acceleration.

    If the model switches plausibility warnings off, only the ground acceleration is checked.
    """
    if model.plausibility_off:
        return [*peak_warnings(pga)]
    initial_warnings = _unusual_initial(model)
    model, building = _without_devices(model, building)
    omega, damping = building.first_mode()
    if model.rows:  # rows that are not floors can be any structure
        ratios = {model.rows[0]: damping} if damping > 0.0 else {}
        return [*unusual(USUAL["damping"], ratios), *peak_warnings(pga), *initial_warnings]
    # Without initial stiffness of a story, period and damping ratio are infinite by intention.
    first_period, damping = (period(omega), damping) if omega else (math.nan, math.nan)
    # A ratio of 0 is not checked: the user intends it, for example for textbook examples. A small
    # positive ratio indicates damping that does not act on the first mode.
    checked_damping = damping if damping > 0.0 else math.nan
    period_range = _period_range(building)
    checked_values = (
        (period_range, first_period),
        (USUAL["damping"], checked_damping),
        (USUAL["collapse"], model.collapse_drift),
        (USUAL["building_height"], _usual_height(building)),
    )
    warnings = [
        usual_range.warning(usual_range.text(value))
        for usual_range, value in checked_values
        if not usual_range.contains(value)
    ]
    cause = _weights_as_masses(model, building, first_period, period_range)
    is_period_unusual = not period_range.contains(first_period)
    if is_period_unusual:
        warnings[0] += cause
    warnings += peak_warnings(pga)
    # The strength is divided by the weight of the floors above, because codes specify base shears
    # in this form.
    weight = STANDARD_GRAVITY * np.cumsum(building.mass[::-1])[::-1]
    strength = np.array([yield_strength(story) for story in model.stories])
    # A light mass without a height is an oscillator of a textbook, such as a mass of 1 kg.
    is_oscillator = np.isnan(building.heights) & (building.mass < USUAL["floor"].low)
    is_isolator = [story.isolator for story in model.stories]
    unusual_strengths = unusual_stories(
        USUAL["strength"], np.where(is_oscillator | is_isolator, math.nan, strength / weight)
    )
    # Check the base shear at yield, because no code requires less than the minimum of its usual
    # range. It is not checked if the first story has no height (an isolator, or a model that is not
    # a building), or if a warning about the strength of the story exists.
    ratio, usual = float(strength[0] / weight[0]), USUAL["base_strength"]
    is_base_checked = math.isfinite(building.heights[0]) and USUAL["strength"].contains(ratio)
    if is_base_checked and not usual.contains(ratio):
        unusual_strengths.append(usual.warning(usual.text(ratio)))
    # Weights as masses make the ratio too small by the same factor as the masses are too large.
    is_corrected = not usual.contains(ratio) and usual.contains(ratio * model.weight_factor)
    if unusual_strengths and is_corrected and not is_period_unusual:
        unusual_strengths[-1] += cause
    return [
        *warnings,
        *unusual_stories(USUAL["height"], building.heights),
        *([] if is_period_unusual and cause else _unusual_floors(building, first_period)),
        *unusual_strengths,
        *_unusual_neighbors(building),
        *_unusual_drifts(model, building),
        *_unusual_devices(model, building, omega, damping),
        *_unusual_drift_ratios(model),
        *_unusual_flexure(model),
        *initial_warnings,
    ]


def _unusual_initial(model: Model) -> list[str]:
    """Return warnings about unusual initial displacements and velocities. The displacements of
    floors with heights are compared as drift ratios."""
    displacement = np.array(model.initial.displacement)
    velocity = np.array(model.initial.velocity)
    if not (displacement.any() or velocity.any()):
        return []
    names = model.rows or [f"floor {number}" for number in range(1, len(model.stories) + 1)]
    heights = np.array([story.drift_height or math.nan for story in model.stories])
    is_length = np.isnan(heights)
    ratios = np.abs(np.diff(displacement, prepend=0.0)) / heights
    return [
        *unusual_stories(USUAL["peak_drift"]._replace(name="initial drift ratio"), ratios),
        *unusual(
            USUAL["initial_displacement"],
            dict(zip(names, np.where(is_length, displacement, math.nan).tolist(), strict=True)),
        ),
        *unusual(USUAL["initial_velocity"], dict(zip(names, velocity.tolist(), strict=True))),
    ]


def _unusual_flexure(model: Model) -> list[str]:
    """Return a warning about flexural stories where bending or shear has no effect."""
    height = sum(story.height or 0.0 for story in model.stories)
    parts = np.full(len(model.stories), math.nan)
    for i, story in enumerate(model.stories):
        if story.flexural is not None and max(story.flexural) < math.inf:
            bending, shear = height**2 / (3.0 * story.flexural[0]), 1.0 / story.flexural[1]
            parts[i] = bending / (bending + shear)
    return unusual_stories(USUAL["bending"], parts)


def _usual_height(building: Building) -> float:
    """Return the height of a building above its isolators, m.

    It is nan if a story has no height or an unusual height: the model may then represent a
    laboratory test or a textbook example, or another warning reports the height.
    """
    heights, usual = np.delete(building.heights, building.isolators), USUAL["height"]
    is_usual = len(heights) > 0 and all(usual.low <= height <= usual.high for height in heights)
    return float(heights.sum()) if is_usual else math.nan


def period_range(count: int, height: float = math.nan) -> UsualRange:
    """Return the usual range of the fundamental period of a building.

    Parameters
    ----------
    height : float
        Height of the building, m; nan if unknown. The range then follows from the number of
        stories.
    """
    low = _MIN_PERIOD_PER_STORY * count
    if math.isnan(height):
        text, max_height = pluralize(count, "story"), _MAX_STORY_HEIGHT * count
    else:
        low = min(low, height / _MAX_HEIGHT_PER_PERIOD)
        text, max_height = f"{pluralize(count, 'story')} and {height:.4g} m", height
    if low > USUAL["period"].high:  # taller than any building
        return USUAL["period"]
    high = max(
        _MAX_PERIOD_OF_LOW_BUILDINGS, _MAX_PERIOD_AT_GROUND + _MAX_PERIOD_PER_HEIGHT * max_height
    )
    return USUAL["period"]._replace(
        name=f"fundamental period of {text}",
        low=max(USUAL["period"].low, low),
        high=min(USUAL["period"].high, high),
        reason="check the units of mass and stiffness",
    )


def _period_range(building: Building) -> UsualRange:
    """Return the usual range of the fundamental period for the height and the number of stories.

    Without heights, the range follows from the number of stories if there are several and their
    floors have usual masses; otherwise the model does not have to be a building, and the range is
    `USUAL`, period. Isolators lengthen the period.
    """
    count, height = building.stories - len(building.isolators), _usual_height(building)
    if math.isnan(height):
        has_heights = np.isfinite(building.heights).any()
        if has_heights or count < 2 or unusual_stories(USUAL["floor"], building.mass):
            return USUAL["period"]
    usual_range = period_range(count, height)
    return usual_range._replace(high=USUAL["period"].high) if building.isolators else usual_range


def _weights_as_masses(
    model: Model, building: Building, period: float, period_range: UsualRange
) -> str:
    """Return the end of a warning: the probable cause, if the values of `mass` are weights.

    The text is empty if the file specifies weights, or if the corrected masses would be unusual as
    well: too light for floors or for the strength, or with an unusual period (s).
    """
    factor = model.weight_factor
    corrected_period = period / math.sqrt(factor)
    # Without height and number of stories, the range is too wide for a conclusion. A factor of 1
    # results from kgf, which have the same numbers as kg.
    is_cause = period_range is not USUAL["period"] and not math.isclose(factor, 1.0, rel_tol=1e-3)
    if not is_cause or not period_range.contains(corrected_period):
        return ""
    corrected_mass = building.mass / factor
    base_strength_ratio = yield_strength(model.stories[0]) / (
        STANDARD_GRAVITY * float(corrected_mass.sum())
    )
    if (
        unusual_stories(USUAL["floor"], corrected_mass)
        or base_strength_ratio > USUAL["base_strength"].high
    ):
        return ""
    size = (
        f"{factor:.4g} times too large" if factor > 1.0 else f"{1.0 / factor:.4g} times too small"
    )
    mass = model.page_units.text(model.stories[0].mass / factor, "kg")
    return (
        f"; probable cause: weights were entered as masses, which are then {size}; with `weight` "
        f"instead of `mass`, the mass of floor 1 would be {mass} and the period "
        f"{period_range.text(corrected_period)}"
    )


def _unusual_floors(building: Building, period: float) -> list[str]:
    """Return a warning about floors that are unusually light or heavy, also for their height.

    If mass and stiffness have wrong units of the same factor, for example kg instead of t and N/m
    instead of kN/m, the period is usual, so only the mass reveals this error. Stories without a
    usual height are skipped, because the model may represent a laboratory test or a textbook
    example.

    `period` is the first natural period, s. If it is unusual for any building, another warning
    reports this, and the floors are not checked.
    """
    if not USUAL["period"].contains(period):
        return []
    # A floor of a matrix can have no mass.
    has_usual_height = (building.heights >= USUAL["height"].low) & (building.mass > 0.0)
    if warnings := unusual_stories(
        USUAL["floor"], np.where(has_usual_height, building.mass, math.nan)
    ):
        return warnings
    height = _usual_height(building)
    if math.isnan(height):
        return []
    low = max(USUAL["mass_per_height"].low, _MIN_TOWER_MASS * height**2)
    return unusual_stories(
        USUAL["mass_per_height"]._replace(low=low),
        np.where(has_usual_height, building.mass / building.heights, math.nan),
    )


def _unusual_neighbors(building: Building) -> list[str]:
    """Return a warning about stories that are much stiffer or softer than the story below.

    Isolators and stories without a height are not compared.
    """
    is_compared = building.heights >= USUAL["height"].low
    stiffness = np.where(is_compared, building.story_laws[rows.STIFFNESS], 0.0).tolist()
    ratios = {
        f"stories {number} and {number + 1}": max(pair) / min(pair)
        for number, pair in enumerate(pairwise(stiffness), start=1)
        if min(pair) > 0.0
    }
    return unusual(USUAL["stiffness_ratio"], ratios)


def _unusual_drifts(model: Model, building: Building) -> list[str]:
    """Return warnings about unusual lengths in hysteretic laws: yield drifts and ultimate drifts
    over the story height, and the lengths of deterioration over the plastic drift."""
    ultimate_drift, deterioration = np.full((2, building.stories), math.nan)
    for i, story in enumerate(model.stories):
        for spring in story.springs:
            # Only laws with these keys have such lengths. An infinite length is a default.
            values = {name: value for name, value in spring.law.values.items() if value < math.inf}
            for name, value in values.items():
                if name.endswith("ultimate_drift"):
                    ultimate_drift[i] = np.fmax(ultimate_drift[i], value)
                elif name.startswith("deterioration.") and "plastic_drift" in values:
                    ratio = value / values["plastic_drift"]
                    # The unusual one of several lengths is reported.
                    if math.isnan(deterioration[i]) or not USUAL["deterioration"].contains(ratio):
                        deterioration[i] = ratio
    return [
        *unusual_stories(USUAL["yield_drift"], building.yield_drift / building.heights),
        *unusual_stories(USUAL["ultimate_drift"], ultimate_drift / building.heights),
        *unusual_stories(USUAL["deterioration"], deterioration),
    ]


def _unusual_devices(model: Model, building: Building, omega: float, damping: float) -> list[str]:
    """Return warnings about devices that would have no effect, or an excessive effect.

    A device is compared with its purpose in a vibration with the first circular frequency `omega`
    (rad/s), or of an isolator with the frequency of the rigid building above. `damping` is the
    damping ratio of the first mode.
    """
    values = {name: np.full(building.stories, math.nan) for name in USUAL}
    weight_above = STANDARD_GRAVITY * np.cumsum(building.mass[::-1])[::-1]
    for i, story in enumerate(model.stories):
        stiffness, rate_of_drift = story.stiffness, omega
        if story.isolator:
            after_yield = stiffness_after_yield(story)
            if 0.0 < after_yield < math.inf:
                stiffness = after_yield
            rate_of_drift = math.sqrt(stiffness * STANDARD_GRAVITY / weight_above[i])
            strength = yield_strength(story)
            values["isolator_strength"][i] = strength / weight_above[i]
            if strength == strength:  # not nan
                values["isolator_period"][i] = period(rate_of_drift)
        height = story.drift_height or math.nan
        drift = _ISOLATOR_DRIFT if story.isolator else _REFERENCE_DRIFT * height
        coefficient = _linear_coefficient(story, rate_of_drift * drift)
        # The frequency of a building on isolators is not that of the dampers above them. Linear
        # dashpots without effect are the cause of an unusual damping ratio, which is reported.
        is_reported = not story.power_dashpot and damping < USUAL["damping"].low
        is_compared = bool(building.isolators) == story.isolator and not is_reported
        if coefficient > 0.0 and stiffness > 0.0 and is_compared:
            values["damper"][i] = coefficient * rate_of_drift / (2.0 * stiffness)
        if story.power_dashpot and story.power_dashpot.brace:
            brace = story.power_dashpot.brace * story.damper_factor**2
            values["brace"][i] = 1.0 / math.hypot(1.0, coefficient * rate_of_drift / brace)
        for factor in (story.damper_factor, *(element.factor for element in story.elements)):
            angle = math.degrees(math.acos(factor)) if factor < 1.0 else math.nan
            if not USUAL["angle"].contains(angle):
                values["angle"][i] = angle
        for spring in story.springs:
            # A gap is the only parameter with the name of its law.
            gap = spring.law.values.get(spring.law.name, math.nan)
            values["clearance"][i] = gap if math.isnan(height) else math.nan
            values["wide_gap"][i] = gap / height
            stiffest = spring.law.values.get("stop_stiffness", spring.stiffness)
            if story.elements and 0.0 < stiffest < USUAL["element"].low * story.stiffness:
                values["element"][i] = stiffest / story.stiffness
    return [
        warning
        for name, values_of_stories in values.items()
        for warning in unusual_stories(USUAL[name], values_of_stories)
    ]


def _unusual_attached(model: Model, omega: float) -> list[str]:
    """Return warnings about attachments and links that would have no effect, or an excessive
    effect.

    Links are compared with the stories between the endpoints of the link in a vibration with the
    first circular frequency of the building, `omega`, rad/s.
    """
    masses, periods, dampers, shares = (dict[str, float]() for _ in range(4))
    for attachment in model.attachments:
        name, spring = attachment.name, attachment.spring
        # A mass on the ground is a part of another building.
        floor = model.stories[attachment.floor - 1] if attachment.floor else spring
        masses[name] = spring.mass / floor.mass if spring.mass else math.nan
        inertia = spring.mass + spring.inertance
        # Without inertia of its own, the mass is a node that the inerter of a link holds.
        frequency = math.sqrt(spring.stiffness / inertia) if inertia else 0.0
        if frequency > 0.0:
            periods[name] = 2.0 * math.pi / frequency
            dampers[name] = spring.dashpot / (2.0 * inertia * frequency) or math.nan
    count = len(model.stories)
    for link in model.links:
        first, last = sorted(link.ends)
        # Springs between the ends; of an attachment, the spring of the attachment.
        ends = [model.attachments[end - count - 1] for end in (first, last) if end > count]
        stiffnesses = [end.spring.stiffness for end in ends]
        stiffnesses = stiffnesses or [story.stiffness for story in model.stories[first:last]]
        if min(stiffnesses) > 0.0:
            stiffness = 1.0 / sum(1.0 / stiffness for stiffness in stiffnesses)
            shares[link.name] = link.spring.stiffness / stiffness or math.nan
            if not ends:
                dampers[link.name] = link.spring.dashpot * omega / (2.0 * stiffness) or math.nan
    return [
        *unusual(USUAL["attached_mass"], masses),
        *unusual(USUAL["attached_period"], periods),
        *unusual(USUAL["damper"], dampers),
        *unusual(USUAL["link"], shares),
    ]


def _unusual_drift_ratios(model: Model) -> list[str]:
    """Return a warning about unusual drift ratios of limits and damage states."""
    if not (model.limits or model.damage):
        return []
    # Imported here, because most models have neither.
    from tdint.model.damage_states import DEMANDS
    from tdint.model.limits import DRIFT_RATIO, RESIDUAL

    ratios = {
        f"limits{f'.levels.{limit.level}' if limit.level else ''}.{limit.quantity}": float(
            np.nanmax(limit.values)
        )
        for limit in model.limits
        if limit.quantity in (DRIFT_RATIO, RESIDUAL)
    }
    if model.damage and DEMANDS[model.damage.demand].unit == "1":
        names = [f"damage.thresholds.{state}" for state in model.damage.states]
        ratios |= dict(zip(names, model.damage.medians, strict=True))
    return unusual(USUAL["collapse"]._replace(name="drift ratio"), ratios)


def _linear_coefficient(story: Story, rate: float) -> float:
    """Return the coefficient (N s/m) of the linear damper between the floors with the force of the
    dashpot of a story at a drift rate (m/s); nan for a power law without a rate."""
    coefficient = story.dashpot * story.damper_factor**2
    if damper := story.power_dashpot:
        power = damper.coefficient * story.damper_factor ** (1.0 + damper.exponent)
        coefficient += power * (rate ** (damper.exponent - 1.0) if damper.exponent != 1.0 else 1.0)
    return coefficient


_MIN_SAMPLES = 7.0
"""Minimum number of time steps in the fundamental period if the time step is at most the sampling
interval of the record. The default method has errors of 0.05 to 0.3 % with 8 steps and of up to 3 %
with 6 steps. With several samples per step, errors are 10 % or more with 10 steps, so this limit
applies."""


def long_step(building: Building, dt: float | None, interval: float | None) -> list[str]:
    """Return a warning if a fundamental period has too few time steps.

    Parameters
    ----------
    dt : float | None
        Time step, s; None: the sampling interval of the record is the time step.
    interval : float | None
        Sampling interval of the record, s; None without a record.

    Returns
    -------
    list of str
        The warning; empty if the time step is short enough, or unknown.
    """
    first_period = period(building.first_mode()[0])
    step, usual_steps = dt or interval, USUAL["step"]
    if step is None or usual_steps.contains(first_period / step):
        return []
    if interval is not None and step <= interval and first_period / step >= _MIN_SAMPLES:
        return []
    return [
        f"the time step {step:.4g} s is long: {usual_steps.text(first_period / step)} steps in the "
        f"fundamental period; use at least {usual_steps.text(usual_steps.low)} "
        f"({usual_steps.reason})"
    ]


def study_plausibility_warnings(models: Iterable[tuple[Model, Building]]) -> tuple[str, ...]:
    """Return warnings about the buildings of a study, each preceded by the model file.

    A warning about several models is returned a single time, with the number of models. The result
    contains at most ten warnings, and the number of further warnings.
    """
    files_by_warning: dict[str, list[str]] = {}
    unvaried: set[str] = set()  # warnings that do not follow from values of `vary`
    for model, building in models:
        for warning in plausibility_warnings(model, building, has_motion=True):
            files_by_warning.setdefault(warning, []).append(model.source)
            unvaried |= set() if model.varied_parameters else {warning}
    lines = []
    for warning, files in files_by_warning.items():
        # Variations of a model have the same file.
        first_file, *more_files = dict.fromkeys(files)
        more_text = f" and {len(more_files)} more" if more_files else ""
        varied = "" if warning in unvaried else " with values of `vary`"
        lines.append(f"{first_file}{more_text}{varied}: {warning}")
    if len(lines) > _MAX_STUDY_WARNINGS:
        omitted_count = len(lines) - _MAX_STUDY_WARNINGS
        lines[_MAX_STUDY_WARNINGS:] = [
            f"{omitted_count} more warnings on the buildings; `tdint check` lists all"
        ]
    return tuple(lines)


def unusual_stories(usual_range: UsualRange, values: Array | Sequence[float]) -> list[str]:
    """Return a warning about the stories with unusual values; empty if all values are usual.

    Parameters
    ----------
    values : array, shape (n,)
        Value of each story from the ground up, SI units; nan if unknown.
    """
    values_by_story = np.asarray(values, dtype=float).tolist()
    # Buildings of a campaign usually have usual values. Skip the dictionary in this case.
    if all(map(usual_range.contains, values_by_story)):
        return []
    return unusual(
        usual_range,
        {f"story {number}": value for number, value in enumerate(values_by_story, start=1)},
    )


def unusual_ductility(model: Model, yield_drift: Array, ductility: Array) -> list[str]:
    """Return a warning about the stories with an unusual ductility; empty if all are usual.

    The first point of a backbone can be the crack. The ductility of such a story is therefore
    judged by its yield point: strength over secant stiffness at 60 % of it (ASCE 41-17,
    7.4.3.2.4).

    Parameters
    ----------
    yield_drift : array, shape (n,)
        Drift to which the ductility of each story refers, m.
    ductility : array, shape (n,)
        Ductility of each story; nan if it is not judged.
    """
    usual_range, judged = USUAL["ductility"], []
    if all(map(usual_range.contains, ductility.tolist())):  # usual, in most runs of a campaign
        return []
    for story, first, value in zip(model.stories, yield_drift, ductility, strict=False):
        points = (_yield_point(spring.law.values) for spring in story.springs)
        yield_point = max(first, min(filter(None, points), default=first))
        judged.append(math.nan if usual_range.contains(value * first / yield_point) else value)
    return unusual_stories(usual_range, judged)


def _yield_point(values: Mapping[str, float]) -> float:
    """Return the drift of the yield point of a backbone of points, m, from the parameters of the
    law by name; 0 for another law."""
    points = [value for name, value in values.items() if name.startswith("backbone[")]
    drifts, forces = [0.0, *points[::2]], [0.0, *points[1::2]]
    last = forces.index(max(forces)) + 1
    secant_force = _SECANT * max(forces)
    return float(np.interp(secant_force, forces[:last], drifts[:last])) / _SECANT


_SECANT = 0.6
"""Force at which the secant of a backbone determines its yield point, over the strength."""


def unusual(usual_range: UsualRange, values: Mapping[str, float]) -> list[str]:
    """Return a warning about unusual values; empty if all values are usual. The warning lists the
    first three unusual values.

    Parameters
    ----------
    values : mapping of str to float
        Values, SI units, by the name of the story or ground motion.
    """
    unusual_texts = [
        f"{usual_range.text(value)} in {name}"
        for name, value in values.items()
        if not usual_range.contains(value)
    ]
    if not unusual_texts:
        return []
    return [usual_range.warning(abbreviate(unusual_texts, _MAX_LISTED))]
