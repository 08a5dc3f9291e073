"""Comparison of the buildings of a campaign under the same suite, the first part of its report: the
answer in one sentence, and one table with a row for each building."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.items import grouped
from tdint.number_parsing import number_text, pluralize, quoted_names
from tdint.output.page import Part
from tdint.output.tables.table import Table
from tdint.response.pairs import Run
from tdint.studies.campaign.campaign_tables import variant_columns
from tdint.studies.campaign.plan import Plan
from tdint.studies.campaign.story_profiles import (
    MIN_COMMON,
    Profile,
    Statistics,
    at_levels,
    ratios_of,
    story_pairs,
)
from tdint.studies.store.result_store import Store
from tdint.studies.store.schema import ELEMENTS
from tdint.units import OutputUnits

_MAX_VARIANT_ROWS = 40
"""Maximum number of rows of the table; profiles.csv lists all buildings and levels."""

_MAX_SENTENCES = 3  # maximum number of levels with a separate sentence


_DRAW = re.compile(r"(?:, )?draw \d+")
"""Part of the label of a building that states the sample of a sweep."""


def pooled(plan: Plan, profiles: Sequence[Profile]) -> list[Profile]:
    """Return the profiles with all draws of a building at a level as one profile, whose motions are
    the motions of each draw."""
    labels = {building.name: building.label for building in plan.buildings}
    groups: dict[tuple[str, ...], list[Profile]] = defaultdict(list)
    for profile in profiles:
        label = labels[profile.building]
        base = profile.building.removesuffix(label).removesuffix(": ")
        rest = _DRAW.sub("", label).removeprefix(", ")
        name = f"{base}: {rest}" if rest else base
        groups[name, repr(profile.scale), repr(profile.level)].append(profile)
    return [
        items[0] if len(items) == 1 else _joined(name, items)
        for (name, *_), items in groups.items()
    ]


def _joined(name: str, profiles: Sequence[Profile]) -> Profile:
    """Return the profile of a building with the motions of several profiles."""
    starts = np.cumsum([0, *(profile.outcome.size for profile in profiles)])

    def joined(arrays: Iterable[Any]) -> Any:
        """Return the arrays of all profiles as one array."""
        return np.concatenate([*arrays])

    return replace(
        profiles[0],
        building=name,
        runs=[run for profile in profiles for run in profile.runs],
        motion=joined(item.motion + start for item, start in zip(profiles, starts, strict=False)),
        motions=tuple(motion for profile in profiles for motion in profile.motions),
        outcome=joined(profile.outcome for profile in profiles),
        run_outcome=joined(profile.run_outcome for profile in profiles),
        peaks={
            quantity: joined(profile.peaks[quantity] for profile in profiles)
            for quantity in profiles[0].peaks
        },
        peak_errors={
            quantity: joined(profile.peak_errors[quantity] for profile in profiles)
            for quantity in profiles[0].peak_errors
        },
    )


class _Variant(NamedTuple):
    """Row of the table: a building at a level. Means are over its completed motions, in the story
    or floor with the largest mean; `ratio` is the ratio of the mean drifts to the baseline
    (`ratios_of`); median and fractiles are over all motions. The last two values are the mean peak
    force, N, and the mean stroke, m, of the devices in the story where each is largest; nan
    without devices. The stroke is the drift of the story."""

    profile: Profile
    mean_drift: float = math.nan
    largest_drift: float = math.nan
    median: float = math.nan
    p16: float = math.nan
    p84: float = math.nan
    ratio: float = math.nan
    acceleration: float = math.nan
    residual_drift: float = math.nan
    base_shear: float = math.nan
    device_force: float = math.nan
    device_stroke: float = math.nan

    @property
    def collapses(self) -> str:
        """Number of motions with collapse, and without a result, as text."""
        counts = self.profile.counts
        count = f"{counts.collapsed} of {counts.motions}"
        return f"{count}, {counts.failed} failed" if counts.failed else count


def comparison_parts(
    plan: Plan, store: Store, profiles: Sequence[Profile], baseline: str | None, units: OutputUnits
) -> tuple[list[str], list[Part]]:
    """Return the sentences on the comparison of the buildings, and the table of all buildings with
    the sentences on its motions; both empty if there is only one building.

    Models are compared with a baseline, which names the best one. Variations of a model are not
    compared: draws have pooled statistics, bounds the larger value, and methods and time steps
    their difference, which is an error.

    Parameters
    ----------
    profiles : sequence of Profile
        Profiles with pooled draws.
    baseline : str | None
        Reference building of the drifts; None for no comparison.
    """
    labels = [building.label for building in plan.buildings]
    is_pooled = any(map(_DRAW.search, labels))
    if len({profile.building for profile in profiles}) < 2 and not is_pooled:
        return [], []
    baseline = None if any(labels) else baseline
    shown = (profile for profile in profiles if profile.counts.completed)
    by_length = all(np.isnan(profile.height).all() for profile in shown)
    sentences, rows, notes = [], [], []
    levels = at_levels(profiles)
    for level in levels:
        variants = _variants(plan, store, level, baseline, by_length=by_length)
        rows += variants
        if baseline is not None:
            sentences.append(_best_text(variants, baseline, units, by_length=by_length))
        elif is_pooled:
            sentences += [_pooled_text(item, units, by_length=by_length) for item in variants]
        elif any(labels):
            sentences += _variations_text(plan, variants, units, by_length=by_length)
    if len(rows) > _MAX_VARIANT_ROWS:
        notes.append(f"The first {_MAX_VARIANT_ROWS} of {len(rows)} rows; profiles.csv lists all.")
    omitted = {"times_baseline"} if baseline is None else set[str]()
    if is_pooled:
        omitted |= {"device_force_N", "device_stroke_m"}
    else:
        omitted |= {"median", "p16", "p84"}
    columns = variant_columns(has_levels=len(levels) > 1, by_length=by_length)
    columns = [column for column in columns if not {column.name, str(column.value)} & omitted]
    table = Table.of_results(columns, rows[:_MAX_VARIANT_ROWS])
    explanation = (
        "Means are over the motions that each building completes, in the story or "
        "floor with the largest mean. "
    )
    devices = "Devices are dampers and isolators"
    if baseline is not None:
        explanation += (
            "Times baseline compares the mean drifts over the motions that the building and the "
            "baseline both complete, if nothing collapses or these are at least "
            f"{MIN_COMMON}. "
        )
        devices = "Devices are dampers, isolators and elements that the baseline does not have"
    if is_pooled:
        explanation += "Motions are those of all draws; in the median a collapse is the largest."
    else:
        explanation += f"{devices}; their stroke is the drift of the story."
    return sentences[:_MAX_SENTENCES], [table.in_units(units), " ".join([*notes, explanation])]


def _variants(
    plan: Plan, store: Store, level: Sequence[Profile], baseline: str | None, *, by_length: bool
) -> list[_Variant]:
    """Return the rows of the buildings at a level; numbers of a building that completes no motion
    are nan."""
    drift = "peak_drift" if by_length else "peak_drift_ratio"
    base = next((profile for profile in level if profile.building == baseline), None)
    names = {building.name for building in plan.buildings}
    rows = []
    for profile in level:
        completed, is_single = profile.completed, profile.building in names
        if not completed.counts.completed:
            rows.append(_Variant(profile))
            continue
        drifts = _drifts(completed, drift)
        median, p16, p84 = map(_largest, Statistics.of(_drifts(profile, drift))[1:4])
        residual = _drifts(completed, "residual_drift")
        if not by_length:
            residual = residual / completed.height
        rows.append(
            _Variant(
                profile,
                _largest_mean(drifts),
                _largest(drifts),
                *(median, p16, p84),
                float(ratios_of(profile, base, drift).ratios.mean[0]) if base else math.nan,
                _largest_mean(completed.peaks["peak_absolute_acceleration"]),
                _largest_mean(residual),
                float(np.mean(completed.peaks["peak_shear"][:, 0])),
                *(_device(plan, store, completed, base) if is_single else (math.nan, math.nan)),
            )
        )
    return rows


def _drifts(profile: Profile, quantity: str) -> Array:
    """Return a quantity of the stories of a building, shape (motions, stories); nan for isolators,
    because their drifts are strokes."""
    values = profile.peaks[quantity].copy()
    values[:, [number - 1 for number in profile.isolators]] = math.nan
    return values


def _largest(values: Array) -> float:
    """Return the maximum of numbers of which some are missing."""
    return float(np.nanmax(values, initial=-math.inf))


def _largest_mean(values: Array) -> float:
    """Return the maximum over the stories of the mean over the motions; nan without any value."""
    means = np.mean(values, axis=0)
    means = means[np.isfinite(means)]
    return float(np.max(means)) if means.size else math.nan


def _device(
    plan: Plan, store: Store, profile: Profile, base: Profile | None
) -> tuple[float, float]:
    """Return force and stroke of the devices of a building under its completed motions."""
    numbers = {name: number for number, (name, _) in store.buildings().items()}
    number = numbers[profile.building]
    model = plan.buildings[number].subject().model
    laws_of_base: dict[int, set[str]] = defaultdict(set)
    if base is not None:
        base_model = plan.buildings[numbers[base.building]].subject().model
        for index, base_index in story_pairs(profile, base):
            laws_of_base[index] = {item.law.name for item in base_model.stories[base_index].springs}
    forces, strokes = [], []
    # Mean peak force, N, of each element by its story (from 1) and name, over the motions
    columns = "story, element, peak_force_N"
    values: dict[tuple[int, str], dict[Run, float]] = defaultdict(dict)
    for run, story, element, force in store.rows_of_runs(ELEMENTS, columns, number):
        values[story, element][run] = force
    element_forces = {key: float(np.mean(profile.demands(runs))) for key, runs in values.items()}
    for index, story in enumerate(model.stories):
        has_dashpot = bool(story.dashpot or story.power_dashpot)
        added = [
            element_forces[index + 1, spring.name]
            for spring in story.elements
            if base is not None
            and spring.law.name not in laws_of_base[index]
            and (index + 1, spring.name) in element_forces
        ]
        if not (has_dashpot or added or story.isolator):
            continue
        strokes.append(float(np.mean(profile.peaks["peak_drift"][:, index])))
        forces += added if not story.isolator else []
        names = [*(("peak_damper_force",) * has_dashpot), *(("peak_shear",) * story.isolator)]
        forces += [float(np.mean(profile.peaks[name][:, index])) for name in names]
    return max(forces, default=math.nan), max(strokes, default=math.nan)


def _drift_text(value: float, units: OutputUnits, *, by_length: bool) -> str:
    """Return a drift or a drift ratio as text; an infinite one is a collapse."""
    if math.isinf(value):
        return "collapse"
    return units.text(value, "m") if by_length else f"{number_text(100.0 * value, 3)} %"


def _pooled_text(variant: _Variant, units: OutputUnits, *, by_length: bool) -> str:
    """Return the sentence on the pooled draws of a building."""
    profile = variant.profile
    median, p16, p84, mean = (
        _drift_text(value, units, by_length=by_length)
        for value in (variant.median, variant.p16, variant.p84, variant.mean_drift)
    )
    name = ", ".join(filter(None, [profile.building, profile.level_text]))
    return (
        f"{name}: median drift {median} (16 to 84 %: {p16} to {p84}), mean {mean}, over "
        f"{pluralize(profile.counts.motions, 'motion')} of all draws, "
        f"{profile.counts.collapsed} with collapse."
    )


def _variations_text(
    plan: Plan, variants: Sequence[_Variant], units: OutputUnits, *, by_length: bool
) -> list[str]:
    """Return the sentences on variations at a level: the larger value over the bounds of a
    property, and the difference between methods and time steps, for each model."""
    varied = {building.name: bool(building.varied) for building in plan.buildings}
    bases = {
        building.name: building.name.removesuffix(building.label).removesuffix(": ")
        for building in plan.buildings
    }
    groups = grouped((bases[variant.profile.building], variant) for variant in variants)
    sentences = []
    for name, group in groups.items():
        known = [variant for variant in group if variant.mean_drift > 0.0]
        if not known:
            continue
        largest = max(known, key=lambda variant: variant.mean_drift)
        text = _drift_text(largest.mean_drift, units, by_length=by_length)
        level = ", ".join(filter(None, [name, largest.profile.level_text]))
        if varied[largest.profile.building]:
            sentences.append(
                f"{level}: the largest mean drift of the variations is {text} "
                f"({largest.profile.building})."
            )
        else:
            smallest = min(variant.mean_drift for variant in known)
            difference = 100.0 * (largest.mean_drift / smallest - 1.0)
            sentences.append(
                f"{level}: the mean drifts by these methods and time steps differ by at most "
                f"{number_text(difference, 2)} %, which are errors of the time integration."
            )
    return sentences


def _best_text(
    variants: Sequence[_Variant], baseline: str, units: OutputUnits, *, by_length: bool
) -> str:
    """Return the sentence on the best building: the smallest ratio to the baseline of the buildings
    that collapse under no more motions than the baseline."""
    names = [variant.profile.building for variant in variants]
    base = variants[names.index(baseline)]
    allowed = base.profile.counts.collapsed
    candidates = [variant for variant in variants if variant.profile.counts.collapsed <= allowed]

    def rank(variant: _Variant) -> tuple[float, int, float]:
        """Return the sort key of a building: its ratio, its lost motions, then its mean drift."""
        ratio = math.inf if math.isnan(variant.ratio) else variant.ratio
        drift = math.inf if math.isnan(variant.mean_drift) else variant.mean_drift
        return ratio, variant.profile.counts.lost, drift

    best = min(candidates, key=rank)
    profile = best.profile
    level = f" at {profile.level_text}" if profile.level_text else ""
    text = f"Best{level}: {profile.building}"
    if any(variant.profile.counts.lost for variant in variants):
        others = [variant for variant in variants if variant is not best][:_MAX_VARIANT_ROWS]
        names = quoted_names(other.profile.building for other in others)
        listed = ", ".join(
            f"{name} {other.profile.counts.lost}" for name, other in zip(names, others, strict=True)
        )
        text += (
            f", with collapse or failure under {profile.counts.lost} of {profile.counts.motions} "
            f"motions ({listed})"
        )
    if math.isnan(best.mean_drift):
        return f"{text}; no motion is completed."
    drift = _drift_text(best.mean_drift, units, by_length=by_length)
    text += f"; mean drift {drift} under {pluralize(profile.counts.completed, 'motion')}"
    if math.isnan(best.ratio):
        text += ", not compared: too few motions are common with the baseline"
    elif best is not base:
        text += f", {number_text(best.ratio, 2)} times the baseline"
    if not math.isnan(best.device_force):
        text += f"; device force {units.text(best.device_force, 'N')}"
    if not math.isnan(best.device_stroke):
        text += f", stroke {units.text(best.device_stroke, 'm')}"
    return f"{text}."
