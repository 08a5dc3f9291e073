"""HTML report of a campaign: the runs of buildings under a suite of ground motions."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tdint.ground_motion.reading.suites import GroundMotion
from tdint.ground_motion.record import Record
from tdint.items import grouped
from tdint.model.status import DONE, FALLEN
from tdint.number_parsing import number_text, pluralize, quoted_names
from tdint.output import figures, report
from tdint.output.figures.style import FirstPeriods
from tdint.output.page import Chapter, PageText, Part, Picture, once, page, page_units
from tdint.output.spectrum_text import target_text
from tdint.output.tables.loads import LOAD_COLUMNS
from tdint.output.tables.table import TEXT, Cell, Table
from tdint.response.pairs import describe_demand, recordings_of
from tdint.response.runs.batch import Subject
from tdint.response.runs.load_case import LoadCase
from tdint.response.spectra.target import read_target
from tdint.studies.campaign import suite_figures
from tdint.studies.campaign.assigned_motions import FactorTable
from tdint.studies.campaign.campaign_summary import campaign_summary
from tdint.studies.campaign.campaign_tables import (
    profile_error_table,
    profile_table,
)
from tdint.studies.campaign.plan import Plan
from tdint.studies.campaign.story_profiles import (
    FloorSuite,
    Profile,
    at_levels,
    isolated_base,
)
from tdint.studies.fragility.building_damage import has_losses
from tdint.studies.fragility.damage_tables import damage_headlines, loss_table, type_table
from tdint.studies.motions import scaling_figures
from tdint.studies.motions.intensity import GEOMETRIC_MEAN
from tdint.studies.motions.scaling import Scaling
from tdint.studies.store.result_store import Store
from tdint.units import SI, OutputUnits, suffix

_MAX_MODELS = 8
"""Maximum number of buildings that list their stories."""

_MAX_DAMAGE_ROWS = 60
"""Maximum number of rows in tables of damage."""

_SUITE_COLUMNS = (
    "residual_drift",
    "peak_shear",
    "peak_total_shear",
    "peak_absolute_acceleration",
    "peak_damper_force",
)


def suite_page(
    plan: Plan,
    store: Store,
    profiles: Sequence[Profile],
    page_text: PageText,
    *,
    limit: float | None = None,
    ratios: Table | None = None,
    floors: Sequence[FloorSuite] = (),
    units: OutputUnits = SI,
    baseline: str | None = None,
) -> bytes:
    """Return the report of a campaign whose store contains all runs of the plan.

    `profiles` are the statistics over the ground motions, for each building and intensity level.
    `limit` is the limit of the drift ratio, which the figure shows. `ratios` are the responses of
    the buildings divided by those of the building `baseline`.
    """
    content, units = campaign_summary(store), page_units(units)
    has_variants = len({profile.building for profile in profiles}) > 1
    runs = content["runs"]
    status_text = ", ".join(f"{count} {status}" for status, count in runs["by_status"].items())
    limit_text = "" if limit is None else f", limit {100.0 * limit:g} %"
    profile_figure = Picture(
        lambda: suite_figures.profile_picture(profiles, units, limit=limit, title=plan.name),
        f"Drifts, floor accelerations, story shears: ground motions, mean, maximum{limit_text}",
    )
    ratio_figure = []
    if ratios is not None and baseline is not None:
        draw = partial(suite_figures.ratio_picture, profiles, baseline)
        ratio_figure = [Picture(draw, f"Ratios of the means to those of {baseline}")]
    periods = store.first_periods()
    spectra = Picture(
        lambda: suite_figures.floor_suite_picture(floors, units, periods),
        "Floor spectra: mean, envelope",
    )
    # Only the first buildings are described, because the report must remain readable.
    subjects = {building.name: building.subject() for building in plan.buildings[:_MAX_MODELS]}
    base = subjects.get(baseline or "") or next(iter(subjects.values()))
    # Warnings about the scaling and the records are printed at the top. Notes with the same text
    # are omitted.
    scaling_parts, scaling_warnings = _scaling(plan, units, periods)
    record_warnings = [
        f"{item.record.source}: {text}" for item in plan.motions for text in item.record.warnings
    ]
    # `warned` contains the warnings without the file of the record.
    warned = tuple(text.partition(": ")[2] for text in record_warnings)
    notes = [note for note in plan.notes if not note.endswith(warned)]
    chapters = [
        page_text.result(*((profile_figure,) if profiles else ())),
        Chapter("Limits", (page_text.limits,) if page_text.limits else ()),
        Chapter("Ratios to the baseline", (*_ratio_parts(ratios), *ratio_figure)),
        _suite_assumptions(plan, store, [*subjects.values()]),
        Chapter("Notes", (once(notes),)),
        *(
            chapter
            for level in at_levels(profiles)
            for chapter in _statistics(level, units, subjects, has_variants=has_variants)
        ),
        _runs_chapter(store),
        Chapter("Damage", _damage(store)),
        Chapter("Floor spectra", (spectra,) if floors else ()),
        *(
            report.model_chapter(subject.model, units, base=None if subject is base else base.model)
            for subject in subjects.values()
        ),
        _load_case_chapter(plan, units)
        or report.motion_chapter(_motions_of_levels(plan, store), units, scaling_parts, periods),
    ]
    campaign = {"file": "complete campaign (fingerprint)", "sha256": content["fingerprint"]}
    inputs = [*(page_text.inputs or content["inputs"]), campaign]
    page_text = replace(
        page_text,
        warnings=[*plan.warnings, *page_text.warnings, *scaling_warnings, *record_warnings],
        inputs=inputs,
        verdict=[*damage_headlines(store), *(page_text.verdict or _headlines(store, profiles))],
    )
    about = f"{runs['done']} of {pluralize(runs['all'], 'run')}: {status_text}."
    return page(plan.name, about, chapters, page_text)


_MAX_PICTURES = 6
"""Maximum number of load cases with a figure."""


def _load_case_chapter(plan: Plan, units: OutputUnits) -> Chapter | None:
    """Return the chapter of the load cases of a campaign, with the forces on the first building;
    None if the campaign has records instead."""
    load_cases = [motion.record for motion in plan.motions if isinstance(motion.record, LoadCase)]
    if not load_cases:
        return None
    building = plan.buildings[0].subject().model
    loaded = [load_case.on(building) for load_case in load_cases]
    forces = [force for model in loaded for force in model.excitation.tables]
    parts: list[Part] = [
        f"Each load case is a file of forces on floors; the ground is at rest. Forces on "
        f"{building.name}, without the scale factors of the runs:",
        Table.of_results(LOAD_COLUMNS, forces).in_units(units),
    ]
    for load_case, model in list(zip(load_cases, loaded, strict=True))[:_MAX_PICTURES]:
        end = plan.settings.duration or building.analysis.duration or load_case.duration
        parts.append(
            Picture(
                partial(figures.loads.load_picture, model, end, units),
                f"{load_case.source}: forces on floors over time",
            )
        )
    return Chapter("Load cases", parts)


def _suite_assumptions(plan: Plan, store: Store, subjects: Sequence[Subject]) -> Chapter:
    """Return the chapter of the assumptions of a campaign: methods, time steps, errors and rules.

    `store` is the store of the campaign, with the time steps and the estimated errors of all runs.
    """
    methods = ", ".join(dict.fromkeys(report.method_text(subject.method) for subject in subjects))
    low, high, energy, error = store.connection.execute(
        "SELECT min(dt_s), max(dt_s), max(abs(energy_error)), max(peak_drift_m_error / "
        "peak_drift_m) FROM run_rows WHERE status = 'done'"
    ).fetchone()
    steps = f"{low:.6g} s" if low == high else f"{low:.6g} to {high:.6g} s"
    # Energy and error are unknown if no run has a result.
    accuracy = []
    if not store.checked:
        accuracy.append("the error of the time integration was not estimated")
    elif error is not None:
        accuracy.append(
            f"the largest estimated error of a maximum drift is {number_text(100.0 * error, 2)} %"
        )
    if energy is not None:
        accuracy.append(
            f"the largest energy imbalance of a run is {number_text(100.0 * energy, 2)} % of its "
            "input energy"
        )
    clauses = ["; ".join(accuracy)]
    if plan.settings.until_rest:
        clauses.append("runs continue after the end of the record until free vibration has decayed")
    rule = store.pair_rule()
    if rule.pairs:
        clauses.append(describe_demand(rule.demand))
    return report.assumptions(f"{methods}, time steps of {steps}", [*clauses, _SUITE])


def _headlines(store: Store, profiles: Sequence[Profile]) -> list[tuple[bool | None, str]]:
    """Return the headlines of a campaign without limits: lost runs and the largest drift ratio.

    `profiles` contains the statistics over the ground motions; their headlines already state lost
    motions.
    """
    headlines: list[tuple[bool | None, str]] = []
    statuses = store.statuses()
    lost = {status: count for status, count in statuses.items() if status != "done"}
    if lost and not profiles:
        listed = ", ".join(f"{count} {status}" for status, count in lost.items())
        runs = pluralize(sum(statuses.values()), "run")
        headlines.append((False, f"{sum(lost.values())} of {runs} collapsed or failed: {listed}."))
    query = (
        "SELECT b.name, r.name, r.component, u.scale, u.peak_drift_ratio, u.peak_drift_story, "
        "u.status FROM run_rows u JOIN buildings b ON b.id = u.building JOIN records r ON r.id = "
        "u.record WHERE u.peak_drift_ratio IS NOT NULL ORDER BY u.peak_drift_ratio DESC LIMIT 1"
    )
    for building, record, component, scale, ratio, story, status in store.connection.execute(query):
        under = f"{figures.style.record_name(record)} {component}".strip()
        ended = "" if status == "done" else f", status {status}"
        headlines.append(
            (
                None,
                f"Largest drift ratio {number_text(100.0 * ratio)} % ({building}, story {story}, "
                f"{under} times {number_text(scale)}{ended}).",
            )
        )
    return headlines


_VARIANT_QUANTITIES = (
    ("peak_drift_ratio", "%", "Drift ratio"),
    ("residual_drift", "m", "Residual drift"),
    ("peak_total_shear", "N", "Shear with the forces of dashpots and of P-delta"),
    ("peak_absolute_acceleration", "m/s^2", "Absolute acceleration of the floor above the story"),
)
"""Quantities of variants in each story with their units; profiles.csv lists all quantities."""


def _statistics(
    level: Sequence[Profile],
    units: OutputUnits,
    subjects: Mapping[str, Subject],
    *,
    has_variants: bool,
) -> list[Chapter]:
    """Return the chapters of the means over the ground motions at a level.

    Buildings with the same number of stories have a common chapter, with a table for each quantity
    and a column for each building; isolators are below story 1.
    """
    shown = [profile for profile in level if profile.counts.completed]
    bases = [isolated_base(profile.isolators) for profile in shown]
    stories = {
        profile.height.size - base if np.isfinite(profile.height[base:]).all() else 0
        for profile, base in zip(shown, bases, strict=True)
    }
    if not 1 < len(shown) <= _MOST_BUILDING_COLUMNS or len(stories) > 1 or 0 in stories:
        return [
            _statistics_chapter(profile, units, subjects, has_maxima=not has_variants)
            for profile in level
        ]
    parts: list[Part] = [
        f"No mean of {profile.building}: {profile.lost_text}."
        for profile in level
        if not profile.counts.completed
    ]
    for name, unit, noun in _VARIANT_QUANTITIES:
        rows: dict[int, dict[str, float]] = defaultdict(dict)
        for profile, base in zip(shown, bases, strict=True):
            values = profile.completed.peaks[name]
            if name == "peak_total_shear":  # missing in runs without dashpots and P-delta
                values = np.where(np.isnan(values), profile.completed.peaks["peak_shear"], values)
            means = np.mean(100.0 * values if unit == "%" else values, axis=0)
            for index in np.flatnonzero(np.isfinite(means)).tolist():
                rows[index + 1 - base][profile.building] = float(means[index])
        columns = {profile.building: f"{profile.building}{suffix(unit)}" for profile in shown}
        table = Table.of_units(
            {"story": TEXT} | dict.fromkeys(columns.values(), unit),
            [
                (str(number) if number > 0 else "isolator", *map(rows[number].get, columns))
                for number in sorted(rows)
            ],
        )
        parts += [f"{noun}:", table.in_units(units)]
    title = ", ".join(filter(None, ["Means in each story", level[0].level_text]))
    return [Chapter(title, parts)]


def _statistics_chapter(
    profile: Profile, units: OutputUnits, subjects: Mapping[str, Subject], *, has_maxima: bool
) -> Chapter:
    """Return the chapter of means and maxima of a building over the ground motions at a single
    intensity level; estimated errors are added if the runs have error estimates.

    With several buildings, profiles.csv lists the maxima, so that they are comparable on a page.
    Total shears are omitted if the model (`subjects`, by name) has no P-delta and no dashpots.
    """
    subject = subjects.get(profile.building)
    suite_columns: tuple[str, ...] = _SUITE_COLUMNS
    if subject and not (subject.model.has_p_delta or subject.model.has_dashpots):
        suite_columns = tuple(name for name in suite_columns if name != "peak_total_shear")
    has_heights = not np.isnan(profile.height).any()
    # Isolators have no height, so their drifts in length units are listed in addition to the
    # ratios.
    drifts = ("peak_drift_ratio",) if has_heights else ("peak_drift_ratio", "peak_drift")
    shown = ("mean", "max") if has_maxima else ("mean",)
    parts: list[Part] = [profile_table(profile, (*drifts, *suite_columns), units, shown)]
    if not profile.counts.completed:
        parts = [f"No mean: {profile.lost_text}."]
    elif profile.peak_errors:
        parts += [report.ERRORS, profile_error_table(profile, ("peak_drift", *suite_columns))]
    building = ", ".join(filter(None, [profile.building, profile.level_text]))
    return Chapter(f"Statistics over the ground motions: {building}", parts)


def _runs_chapter(store: Store) -> Chapter:
    """Return the chapter that lists the individual runs of a campaign.

    Collapsed and failed runs are first. The completed runs follow in the order of decreasing drift
    ratio, and finally the completed runs without a drift ratio, in the order of decreasing drift.
    The list shows which ground motions dominate the mean and which
    caused collapse.
    """
    # `u.status = 'done'` is 0 or 1, so that the completed runs are last.
    query = (
        "SELECT b.name, r.name, r.component, u.scale, u.peak_drift_ratio, u.peak_drift_m, "
        "u.peak_drift_story, (SELECT max(s.ductility) FROM story_rows s WHERE (s.building, "
        "s.record, s.scale, s.sample) = (u.building, u.record, u.scale, u.sample)), u.status FROM "
        "run_rows u JOIN buildings b ON b.id = u.building JOIN records r ON r.id = u.record ORDER "
        "BY u.status = 'done', u.peak_drift_ratio DESC, u.peak_drift_m DESC"
    )
    rows = store.connection.execute(query).fetchall()
    if parts := _drifts_of_buildings(rows, [name for name, _ in store.buildings().values()]):
        return Chapter("Individual ground motions", parts)
    shown_rows = rows[: report.MAX_MOTIONS]
    numbers = ("factor", "peak_drift_ratio", "peak_drift_m", "story", "largest_ductility")
    units = dict.fromkeys(("building", "record", "component"), TEXT) | dict.fromkeys(numbers, "1")
    table = Table.of_units(units | {"peak_drift_m": "m", "status": TEXT}, shown_rows)
    columns = table.columns
    # The drift ratio is shown if any run has it. The drift is shown as a length only if a run has
    # no drift ratio, because the stories of its building have no heights.
    ratio, length = columns.index("peak_drift_ratio"), columns.index("peak_drift_m")
    omitted = []
    if all(row[ratio] is None for row in shown_rows):
        omitted.append("peak_drift_ratio")
    elif all(row[ratio] is not None or row[length] is None for row in shown_rows):
        omitted.append("peak_drift_m")
    # The name of a single building is omitted.
    if len({row[columns.index("building")] for row in rows}) <= 1:
        omitted.append("building")
    table = table.chosen([name for name in columns if name not in omitted])
    omission = ""
    if len(rows) > report.MAX_MOTIONS:
        omission = f"The first {report.MAX_MOTIONS} of {len(rows)} runs; runs.csv lists all runs."
    return Chapter("Individual ground motions, largest drift first", (table, omission))


def _drifts_of_buildings(
    rows: Sequence[Sequence[Any]], buildings: Iterable[str]
) -> tuple[Part, ...]:
    """Return the drift ratios of the runs with a row for each ground motion and a column for each
    building, from the rows of the query of `_runs_chapter` and the names of the campaign; empty
    unless this table fits a page, all buildings have the same runs, and each completed run has a
    drift ratio."""
    shown = {row[0] for row in rows}
    names = [name for name in buildings if name in shown]
    cells: dict[tuple[Cell, ...], dict[str, Cell]] = defaultdict(dict)
    for building, record, component, factor, ratio, *_, status in rows:
        percent = None if ratio is None else 100.0 * ratio
        cells[record, component, factor][building] = "collapse" if status in FALLEN else percent
        if status == DONE and ratio is None:
            return ()
    is_complete = sum(map(len, cells.values())) == len(rows) == len(cells) * len(names)
    if (
        not 1 < len(names) <= _MOST_BUILDING_COLUMNS
        or len(cells) > report.MAX_MOTIONS
        or not is_complete
    ):
        return ()
    units = {"record": TEXT, "component": TEXT, "factor": "1", **dict.fromkeys(names, "%")}
    table = sorted(_rows_of_cells(cells, names), key=lambda row: row[:3])
    return (
        "Largest drift ratio of a story; runs.csv lists the story:",
        Table.of_units(units, table),
    )


def _rows_of_cells(
    cells: Mapping[tuple[Cell, ...], Mapping[str, Cell]], names: Iterable[str]
) -> list[tuple[Cell, ...]]:
    """Return the rows of a table from the cells of each row by the name of their column: the key of
    the row, then the cells in the order of `names`."""
    return [(*key, *map(by_name.get, names)) for key, by_name in cells.items()]


_MOST_BUILDING_COLUMNS = 6
"""Maximum number of buildings with a column each."""


def _ratio_parts(ratios: Table | None) -> tuple[Part, ...]:
    """Return the ratios of the means to the baseline for a report, with a column for each building;
    with many buildings the rows of ratios.csv without those that have no number."""
    if ratios is None:
        return ()
    first = ratios.columns.index("quantity")
    number = ratios.columns.index("mean_ratio")
    rows = [
        (*row[:first], str(row[first]).replace("_", " "), *row[first + 1 :])
        for row in ratios.rows
        if any(isinstance(cell, float) and cell == cell for cell in row[first + 1 :])
    ]
    names = list(dict.fromkeys(str(row[0]) for row in rows))
    if not rows or len(names) > _MOST_BUILDING_COLUMNS:
        return (ratios._replace(rows=rows),)
    # The columns before the quantity, after the building and the baseline, are the level.
    cells: dict[tuple[Cell, ...], dict[str, Cell]] = defaultdict(dict)
    has_ratios = any(row[first] == "peak drift ratio" for row in rows)
    omitted = _OMITTED_RATIOS if has_ratios else _OMITTED_RATIOS[1:]
    for row in rows:
        if row[first] not in omitted:
            cells[row[2 : first + 1]][str(row[0])] = row[number]
    motions = ratios.columns.index("motions")
    counts = {str(row[0]): row[motions] for row in rows}
    listed = ", ".join(map("{} {}".format, quoted_names(counts), counts.values()))
    units = dict.fromkeys(ratios.columns[2:first], "1") | {"quantity": TEXT}
    table = Table.of_units(units | dict.fromkeys(names, "1"), _rows_of_cells(cells, names))
    text = (
        f"Means divided by those of {rows[0][1]}, over the motions that both complete ({listed}); "
    )
    return f"{text}ratios.csv lists all:", table


_OMITTED_RATIOS = ("peak drift", "peak shear", "peak velocity", "peak damper force")
"""Quantities of ratios.csv that a table with a column for each building omits; the first is only
omitted if there are drift ratios."""


def _damage(store: Store) -> tuple[Part, ...]:
    """Return the tables of damage and loss by building type; empty without damage states."""
    if not store.damage():
        return ()
    # The rule for pairs is one of the assumptions, so its column is omitted. The event is part of
    # the key of a row.
    by = store.grouped_by()
    columns, rows = loss_table(store, by)
    losses = Table.of(columns, rows if has_losses(store) else ())
    names = [name for name in losses.columns if name not in ("pair_demand", by)]
    districts: list[Part] = []
    if by is not None and losses.rows:
        column = losses.columns.index(by)
        of_districts = losses._replace(rows=[row for row in losses.rows if row[column]])
        losses = losses._replace(rows=[row for row in losses.rows if not row[column]])
        shown = [by, *(name for name in names if name not in ("type", "building"))]
        districts = [f"Losses by {by}:", of_districts.chosen(shown)]
    losses = losses.chosen(sorted(names, key=lambda name: name != "event"))
    losses = losses._replace(rows=losses.rows[:_MAX_DAMAGE_ROWS])
    states = _with_state_columns(Table.of(*type_table(store)))
    states = states._replace(rows=states.rows[:_MAX_DAMAGE_ROWS])
    loss_text = ""
    if losses.rows:
        loss_text = (
            "Mean loss ratios with their standard errors, and standard deviations of the loss:"
        )
    omission = ""
    # A table with the maximum number of rows has probably been cut off above.
    if _MAX_DAMAGE_ROWS in (len(states.rows), len(losses.rows)):
        omission = "The first rows; damage-types.csv and losses.csv list all."
    return (
        "Mean probabilities of the damage states, by building type and level:",
        states,
        loss_text,
        losses,
        omission,
        *districts,
    )


def _with_state_columns(table: Table) -> Table:
    """Return the probabilities of damage states with a column per state, from the rows of
    damage-types.csv (one per type, level, event and state).
    """
    keys: list[str] = [name for name in ("type", "level", "event") if name in table.columns]
    indices = [table.columns.index(name) for name in (*keys, "state", "probability")]
    probabilities: dict[tuple[Cell, ...], dict[str, Cell]] = {}
    states: dict[str, None] = {}  # an ordered set
    for row in table.rows:
        *key, state, probability = (row[i] for i in indices)
        states[str(state)] = None
        probabilities.setdefault(tuple(key), {})[str(state)] = probability
    meanings = {name: table.meanings[name] for name in keys}
    meanings |= dict.fromkeys(states, table.meanings["probability"])
    return Table((*keys, *states), _rows_of_cells(probabilities, states), meanings)


def _motions_of_levels(plan: Plan, store: Store) -> list[list[tuple[Record, float]]]:
    """Return for each intensity level its unscaled records with their scale factors, smallest
    factors first. Levels that are equal for several buildings are returned once.
    """
    levels = grouped(
        ((building, level), (record, scale))
        for building, record, scale, _sample, _motion, level, *_ in store.runs()
    )
    ascending = sorted(levels, key=lambda key: (key[0], abs(key[1] or 0.0)))
    return [
        [(plan.motions[motion].record, scale) for motion, scale in level]
        for level in dict.fromkeys(tuple(levels[key]) for key in ascending)
    ]


_RULES = {
    "value": "each ground motion to this value",
    "mean": "least squares of ln Sa, each ground motion separately",
    "asce7": "ASCE 7-16, 16.2.3.2",
    "ec8": "EN 1998-1:2004, 3.2.3.1.2",
    "p695": "FEMA P-695, A.8",
}


def _scaling(
    plan: Plan, units: OutputUnits, periods: FirstPeriods
) -> tuple[tuple[Part, ...], list[str]]:
    """Return the description of the scaling of ground motions in a campaign (sentence and figure;
    none without scale factors), and the warnings of `tdint scale`.

    The data are from the JSON file that `tdint scale` writes next to the scale factors. The figure
    of the scaled spectra, for a target spectrum, marks the first periods of the buildings.
    """
    table = plan.levels
    if not isinstance(table, FactorTable):
        return (), []
    # `settings` contains the target or intensity measure and the rule. The period range, the
    # damping ratio and the treatment of pairs are in the JSON file next to the factors only.
    settings = table.scaled.get("settings", {})
    if not settings:
        return (
            f"Scale factors: {table.source}; the method of scaling is unknown, because the table "
            "has no columns `target` and `rule`.",
        ), []
    parts: list[Part] = [_scaling_text(table, settings)]
    scaling = _scaled_suite(plan, table, settings) if settings.get("periods_s") else None
    if scaling is not None:
        draw = partial(scaling_figures.suite_picture, scaling, units, periods)
        parts.append(
            Picture(
                partial(figures.style.lowered, draw, height=2.8),
                "Scaled ground motions and target spectrum",
            )
        )
    return tuple(parts), [f"{table.source}: {text}" for text in table.scaled.get("warnings", ())]


def _scaling_text(table: FactorTable, settings: Mapping[str, Any]) -> str:
    """Return a sentence on the scaling: rule, target, periods, damping, pairs, minimum ratio. Only
    a table that was not changed is known to be from `tdint scale`."""
    is_unchanged = "schema" in table.scaled
    origin = (
        "computed by tdint scale" if is_unchanged else "with the rule and target of its columns"
    )
    facts = [f"Scale factors: {table.source}, {origin}"]
    if rule := settings.get("rule"):
        facts.append(f"rule {rule} ({_RULES[rule]})" if rule in _RULES else f"rule {rule}")
    if target := target_text(settings):
        facts.append(f"target {target}")
    if settings.get("periods_s"):
        facts.append("compared from {:.4g} to {:.4g} s".format(*settings["periods_s"]))
    if settings.get("damping") is not None:
        facts.append(f"{100.0 * settings['damping']:g} % damping")
    if settings.get("pairs"):
        facts.append(f"pairs represented by {scaling_figures.pair_text(settings['pairs'])}")
    if settings.get("least_average_over_target") is not None:
        ratio = 100.0 * settings["least_average_over_target"]
        facts.append(f"the minimum ratio of average to target is {ratio:.3g} %")
    return f"{'; '.join(facts)}."


def _scaled_suite(plan: Plan, table: FactorTable, settings: Mapping[str, Any]) -> Scaling | None:
    """Return the scaled suite for its figure; None if a ground motion has several factors.

    Several factors define several suites, and the figure shows only one.
    """
    motions = _scaled_motions(plan, table, paired=bool(settings["pairs"]))
    if any(len(factors) > 1 for _, factors in motions):
        return None
    # For rules that check the average, the figure also shows the average and 90 % of the target.
    # The average of pairs is not plotted for single components.
    minimum_ratio = settings["least_average_over_target"]
    if settings["pairs"] and any(isinstance(motion, Record) for motion, _ in motions):
        minimum_ratio = None
    return Scaling(
        tuple(motion for motion, _ in motions),
        np.array([factors[0] for _, factors in motions]),
        settings["rule"],
        settings["pairs"] or GEOMETRIC_MEAN,
        settings["damping"],
        target=read_target(settings["target"]),
        periods=np.geomspace(*settings["periods_s"]),
        least=None if minimum_ratio is None else (minimum_ratio, math.nan),
    )


def _scaled_motions(
    plan: Plan, table: FactorTable, *, paired: bool
) -> list[tuple[GroundMotion, tuple[float, ...]]]:
    """Return the ground motions of a scaled suite, single components or pairs, with their scale
    factors.

    With `paired`, the two components of a recording that were read as single records are joined to
    a pair. Each item of `plan.motions` is a component; its attribute `ground_motion` is the object
    that was read: a single record, or the pair that contains the component.
    """
    found = recordings_of(plan.motions)
    if not paired:
        found = [item.ground_motion for item in plan.motions]
    # The two components of a pair have the same recording. Its identity is the key, so that the
    # result contains each pair a single time.
    motions: dict[int, tuple[GroundMotion, tuple[float, ...]]] = {}
    for index, motion in enumerate(found):
        motions.setdefault(id(motion), (motion, tuple(table.by_motion[index])))
    return list(motions.values())


# Every report of a suite states this assumption.
_SUITE = "means are over the ground motions without collapse"
