"""First part of the report of several buildings under the same suite: the answer in one sentence,
and one table with a row for each building."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.number_parsing import number_text
from tdint.output.page import Part
from tdint.output.tables.table import Table
from tdint.studies.campaign.campaign_tables import variant_columns
from tdint.studies.campaign.chunks import Run
from tdint.studies.campaign.plan import Plan
from tdint.studies.campaign.story_profiles import Profile
from tdint.studies.campaign.variants import Comparison, comparisons, story_pairs
from tdint.studies.store.result_store import Store
from tdint.units import OutputUnits

_MAX_ROWS = 40
"""Maximum number of rows of the table; profiles.csv lists all buildings and levels."""

_MAX_SENTENCES = 3  # maximum number of levels with a separate sentence


class _Variant(NamedTuple):
    """Row of the table: a building at a level. Means are over the common motions, in the story or
    floor with the largest mean; `ratio` is the mean drift divided by that of the baseline. The last
    two values are the mean peak force, N, and the mean stroke, m, of the devices in the story where
    each is largest; nan without devices. The stroke is the drift of the story."""

    profile: Profile
    mean_drift: float = math.nan
    largest_drift: float = math.nan
    ratio: float = math.nan
    acceleration: float = math.nan
    residual_drift: float = math.nan
    base_shear: float = math.nan
    device_force: float = math.nan
    device_stroke: float = math.nan

    @property
    def collapses(self) -> str:
        """Number of motions with collapse, and without a result, as text."""
        count = f"{self.profile.collapsed} of {self.profile.runs}"
        return f"{count}, {self.profile.failed} failed" if self.profile.failed else count


def comparison_parts(
    plan: Plan, store: Store, profiles: Sequence[Profile], baseline: str | None, units: OutputUnits
) -> tuple[list[str], list[Part]]:
    """Return the sentences that answer which building is best, and the table of all buildings with
    the sentences on its motions; both empty if there is only one building.

    Parameters
    ----------
    baseline : str | None
        Reference building of the drifts; None for the first building.
    """
    if len({profile.building for profile in profiles}) < 2:
        return [], []
    by_length = all(np.isnan(profile.height).all() for profile in profiles if profile.motions)
    sentences, rows, notes = [], [], []
    levels = comparisons(profiles)
    for comparison in levels:
        variants = _variants(plan, store, comparison, baseline, by_length=by_length)
        rows += variants
        sentences.append(_best_text(variants, comparison, units, by_length=by_length))
        if comparison.note:
            notes.append(f"{comparison.note[0].upper()}{comparison.note[1:]}.")
    if len(rows) > _MAX_ROWS:
        notes.append(f"The first {_MAX_ROWS} of {len(rows)} rows; profiles.csv lists all.")
    columns = variant_columns(has_levels=len(levels) > 1, by_length=by_length)
    table = Table.of_results(columns, rows[:_MAX_ROWS])
    explanation = (
        "Means are over the motions that all buildings survive, in the story or floor with the "
        "largest mean; devices are dampers, isolators and elements that the "
        f"{'baseline' if baseline else 'first building'} does not have, their stroke is the drift "
        "of the story."
    )
    return sentences[:_MAX_SENTENCES], [table.in_units(units), " ".join([*notes, explanation])]


def _variants(
    plan: Plan, store: Store, comparison: Comparison, baseline: str | None, *, by_length: bool
) -> list[_Variant]:
    """Return the rows of the buildings at a level; their numbers are nan without common motions."""
    names = [profile.building for profile in comparison.profiles]
    reference = names.index(baseline) if baseline in names else 0
    if not comparison.common:
        return [_Variant(profile) for profile in comparison.profiles]
    drift = "peak_drift" if by_length else "peak_drift_ratio"
    base = comparison.common[reference]
    base_drift = _largest_mean(_drifts(base, drift))
    rows = []
    for profile, common in zip(comparison.profiles, comparison.common, strict=True):
        drifts = _drifts(common, drift)
        residual = _drifts(common, "residual_drift")
        if not by_length:
            residual = residual / common.height
        # The total shear includes the forces of dampers; it is missing in runs without dampers.
        shear = common.peaks["peak_total_shear"][:, 0]
        shear = np.where(np.isnan(shear), common.peaks["peak_shear"][:, 0], shear)
        mean = _largest_mean(drifts)
        rows.append(
            _Variant(
                profile,
                mean,
                float(np.nanmax(drifts, initial=-math.inf)),
                mean / base_drift if base_drift > 0.0 else math.nan,
                _largest_mean(common.peaks["peak_absolute_acceleration"]),
                _largest_mean(residual),
                float(np.mean(shear)),
                *_device(plan, store, common, base),
            )
        )
    return rows


def _drifts(profile: Profile, quantity: str) -> Array:
    """Return a quantity of the stories of a building, shape (motions, stories); nan for isolators,
    whose drifts are strokes."""
    values = profile.peaks[quantity].copy()
    values[:, [number - 1 for number in profile.isolators]] = math.nan
    return values


def _largest_mean(values: Array) -> float:
    """Return the maximum over the stories of the mean over the motions; nan without any value."""
    means = np.mean(values, axis=0)
    means = means[np.isfinite(means)]
    return float(np.max(means)) if means.size else math.nan


def _device(plan: Plan, store: Store, profile: Profile, base: Profile) -> tuple[float, float]:
    """Return force and stroke of the devices of a building under its completed motions."""
    numbers = {name: number for number, (name, _) in store.buildings().items()}
    number = numbers[profile.building]
    model = plan.buildings[number].subject().model
    base_model = plan.buildings[numbers[base.building]].subject().model
    laws_of_base: dict[int, set[str]] = defaultdict(set)
    for index, base_index in story_pairs(profile, base):
        laws_of_base[index] = {item.law.name for item in base_model.stories[base_index].springs}
    forces, strokes = [], []
    # Mean peak force, N, of each element by its story (from 1) and name, over the motions
    columns = "story, element, peak_force_N"
    values: dict[tuple[int, str], dict[Run, float]] = defaultdict(dict)
    for run, story, element, force in store.values_of_runs("element_rows", columns, number):
        values[story, element][run] = force
    element_forces = {key: float(np.mean(profile.demands(runs))) for key, runs in values.items()}
    for index, story in enumerate(model.stories):
        has_dashpot = bool(story.dashpot or story.power_dashpot)
        added = [
            element_forces[index + 1, spring.name]
            for spring in story.elements
            if spring.law.name not in laws_of_base[index]
            and (index + 1, spring.name) in element_forces
        ]
        if not (has_dashpot or added or story.isolator):
            continue
        strokes.append(float(np.mean(profile.peaks["peak_drift"][:, index])))
        forces += added if not story.isolator else []
        names = [*(("peak_damper_force",) * has_dashpot), *(("peak_shear",) * story.isolator)]
        forces += [float(np.mean(profile.peaks[name][:, index])) for name in names]
    return max(forces, default=math.nan), max(strokes, default=math.nan)


def _best_text(
    variants: Sequence[_Variant], comparison: Comparison, units: OutputUnits, *, by_length: bool
) -> str:
    """Return the sentence on the building with the fewest collapses and, among several, with the
    smallest mean drift."""

    def rank(variant: _Variant) -> tuple[int, float]:
        """Return the sort key of a building: its collapses and failures, then its mean drift."""
        profile, drift = variant.profile, variant.mean_drift
        return profile.lost, math.inf if math.isnan(drift) else drift

    best, *others = sorted(variants, key=rank)
    profile = best.profile
    level = f" at {profile.level_text}" if profile.level_text else ""
    text = f"Best{level}: {profile.building}"
    if any(variant.profile.lost for variant in variants):
        listed = ", ".join(
            f"{other.profile.building} {other.profile.lost}" for other in others[:_MAX_ROWS]
        )
        text += (
            f", with collapse or failure under {profile.lost} of {profile.runs} motions ({listed})"
        )
    if not comparison.common:
        return f"{text}; means are not compared, because {comparison.motions} motions are common."
    drift = (
        units.text(best.mean_drift, "m")
        if by_length
        else f"{number_text(100.0 * best.mean_drift, 3)} %"
    )
    text += f"; mean drift {drift} under {comparison.motions} common motions"
    if not math.isnan(best.ratio) and best.ratio != 1.0:
        text += f", {number_text(best.ratio, 2)} times the baseline"
    if not math.isnan(best.device_force):
        text += f"; device force {units.text(best.device_force, 'N')}"
    if not math.isnan(best.device_stroke):
        text += f", stroke {units.text(best.device_stroke, 'm')}"
    return f"{text}."
