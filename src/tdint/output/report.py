"""HTML reports of --report for a run and for a suite, and the chapters that all reports share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.analysis.run.error_estimate import FLOOR
from tdint.analysis.spectra.elastic import spectrum
from tdint.analysis.spectra.target import read_target
from tdint.campaign.intensity import GEOMETRIC_MEAN
from tdint.campaign.motions import MotionFactors
from tdint.campaign.pairs import PairRule, describe_demand
from tdint.campaign.scaling import Scaling
from tdint.errors import RecordError
from tdint.ground_motion.horizontals import Horizontals, find_horizontals
from tdint.ground_motion.origin import match_warnings, matched_text
from tdint.ground_motion.reading.suites import GroundMotion
from tdint.ground_motion.record import Record, component_names
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.definition import ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.number_parsing import number_text, pluralize
from tdint.output import figures
from tdint.output.load_case_report import load_case_chapter
from tdint.output.page import Chapter, PageText, Part, Picture, once, page, page_units
from tdint.output.spectrum_text import spectrum_text
from tdint.output.summary import campaign_summary
from tdint.output.tables import buildings
from tdint.output.tables.campaign import profile_error_table, profile_table
from tdint.output.tables.responses import ELEMENT_COLUMNS, element_table, story_table
from tdint.output.tables.spectra import match_origin_table, motion_table
from tdint.output.tables.table import TEXT, Cell, Table, error_percent
from tdint.units import SI, OutputUnits, suffix

if TYPE_CHECKING:
    from tdint.analysis.run.batch import Subject
    from tdint.analysis.run.outcome import Response, StoryPeaks
    from tdint.analysis.spectra.floors import FloorSpectrum
    from tdint.campaign.plan import Plan
    from tdint.campaign.profiles import FloorSuite, Profile
    from tdint.campaign.store import Store
    from tdint.output.figures.style import FirstPeriods

MODEL_LIMITS = (
    "Each floor is one mass that moves horizontally in one direction. Torsion, floor flexibility, "
    "overturning, axial forces in columns and the soil are not modeled.",
    "Each story is one spring between two floors. Columns, beams and joints are represented only "
    "by the hysteretic law of their story. The two directions of a ground motion act separately.",
    "The hysteretic laws of stories are independent; strength does not depend on axial force.",
)
"""Simplifications of a shear building."""


def model_chapter(
    model: Model, units: OutputUnits = SI, peaks: StoryPeaks | None = None
) -> Chapter:
    """Return the chapter about the building: its properties and the table of its stories.

    Parameters
    ----------
    peaks : StoryPeaks, optional
        Peak responses of a run. If the building has isolators, the chapter also states the period
        with the secant stiffness of the isolators at these peak drifts.
    """
    building = assemble(model)
    damping = building.first_mode()[1]
    p_delta = "with P-delta" if model.p_delta else "without P-delta"
    isolator_note = ""
    if any(story.isolator for story in model.stories):
        secant = (
            f"; {_secant_period(model, peaks):.4g} s with their secant stiffness at the peak drift"
            if peaks
            else ""
        )
        isolator_note = f" (before the isolators yield{secant})"
    facts = (
        f"{pluralize(len(model.stories), 'story')}, first period {building.first_period:.4g} "
        f"s{isolator_note} with {100.0 * damping:.3g} % damping, {p_delta}, "
        f"{damping_text(model)}. "
        f"A drift ratio over {100.0 * model.collapse_drift:g} % counts as collapse."
    )
    return Chapter(f"Building: {model.name}", (facts, buildings.model_table(model, units)))


def first_period(model: Model) -> float:
    """Return the first period of a building, s, with the initial stiffness."""
    return assemble(model).first_period


def _secant_period(model: Model, peaks: StoryPeaks) -> float:
    """Return the first period of a building, s, with the secant stiffness of its isolators.

    `peaks` contains the peak responses of a run. The secant stiffness of an isolator is its peak
    shear divided by its peak drift.
    """
    stories = tuple(
        replace(story, stiffness=shear / drift) if story.isolator and drift > 0.0 else story
        for story, shear, drift in zip(
            model.stories, peaks.peak_shear.tolist(), peaks.peak_drift.tolist(), strict=True
        )
    )
    return assemble(replace(model, stories=stories)).first_period


def damping_text(model: Model) -> str:
    """Return a clause on the damping of a model, such as "Rayleigh damping of 5 % in mode 1".

    Dashpots of stories are not included.
    """
    exception = ""
    # Stories with `rayleigh` False (isolators) do not contribute to the damping matrix.
    if not all(story.rayleigh for story in model.stories):
        exception = ", without the share of the isolators"
    match model.damping:
        case RayleighRatio(ratios, modes, tangent):
            kind = "Rayleigh damping with the tangent stiffness" if tangent else "Rayleigh damping"
            # A dict removes a repeated pair of ratio and mode and keeps the order.
            pairs = dict.fromkeys(zip(ratios, modes, strict=True))
            listed = " and ".join(f"{100.0 * ratio:g} % in mode {mode}" for ratio, mode in pairs)
            return f"{kind} of {listed}{exception}"
        case RayleighCoefficients(mass, stiffness, tangent):
            return (
                f"Rayleigh damping of {mass:.4g} 1/s times mass and {stiffness:.4g} s times "
                f"{'tangent ' if tangent else ''}stiffness{exception}"
            )
        case ModalDamping(ratios):
            listed = ", ".join(f"{100.0 * ratio:g}" for ratio in ratios)
            if 1 < len(ratios) < len(model.stories):
                listed += f" % in modes 1 to {len(ratios)} and of {100.0 * ratios[-1]:g}"
                return f"modal damping of {listed} % in the other modes"
            return f"modal damping of {listed} %"
    return "no damping except dashpots"


# ---- Reports of a run and of a suite

_MAX_MOTIONS = 60
"""Maximum number of ground motions in the table of runs and in the figure of spectra."""

_MAX_LEVELS = 4
"""Maximum number of intensity levels that list their ground motions."""

_MAX_MODELS = 8
"""Maximum number of buildings that list their stories."""

_MAX_DAMAGE_ROWS = 60
"""Maximum number of rows in tables of damage."""

SPECTRUM_PERIODS = (0.05, 5.0, 100)
"""First and last period, s, and number of periods of the spectra in a report."""

_STORY_COLUMNS = (
    "peak_drift_ratio",
    "peak_drift",
    "residual_drift",
    "peak_shear",
    "peak_damper_force",
    "peak_total_shear",
    "ductility",
    "peak_displacement",
    "peak_absolute_acceleration",
)
_SUITE_COLUMNS = (
    "residual_drift",
    "peak_shear",
    "peak_total_shear",
    "peak_absolute_acceleration",
    "peak_damper_force",
)
# This sentence precedes the table of peaks if restoring forces and total shears differ.
_SHEARS = (
    "Peak shears are restoring forces of the stories; peak total shears are the forces on all "
    "floors above, with {}."
)
# This sentence precedes the tables of estimated errors.
_ERRORS = (
    "Estimated errors of the time integration, in percent; the smallest estimate is "
    f"{number_text(100.0 * FLOOR)} %. Errors of residual drifts are in percent of the peak drifts:"
)


def run_page(
    response: Response,
    page_text: PageText,
    *,
    floors: Sequence[FloorSpectrum] = (),
    units: OutputUnits = SI,
) -> bytes:
    """Return the report of a run.

    Parameters
    ----------
    response : Response
        Result of the run, with its response history if the report has its figure.
    floors : sequence of FloorSpectrum
        Requested floor spectra; none by default.
    """
    model, check, units = response.model, response.check, page_units(units)
    table = story_table(response.stories, check.errors if check else None).in_units(units)
    columns = {_quantity(table, name): name for name in table.columns}
    names = [columns[quantity] for quantity in _STORY_COLUMNS if quantity in columns]
    run_figures = []
    if response.history is not None:
        run_figures.append(
            Picture(
                lambda: figures.runs.run_picture(response, units),
                "Response histories, energies, profiles, hysteresis loops",
            )
        )
    spectra = Picture(
        lambda: figures.suites.floor_picture(
            floors, units, title=model.name, period=first_period(model)
        ),
        "Floor spectra",
    )
    chapters = [
        Chapter("Result", (list(page_text.sentences), *run_figures)),
        Chapter("Limits", _limit_parts(response, page_text, units)),
        Chapter(
            "Peaks of the stories",
            (
                _SHEARS.format(model.forces_of_total_shear) if model.forces_of_total_shear else "",
                table.chosen(["story", *names]),
                *_errors_of_run(response, table, names),
            ),
        ),
        Chapter("Elements of the stories", _element_parts(response, units)),
        Chapter("Floor spectra", (spectra,) if floors else ()),
        model_chapter(model, units, response.stories),
        motion_chapter(
            [[(response.record, 1.0)]] if response.record else [],
            units,
            periods=[(model.name, first_period(model))],
        ),
        _load_chapter(model, response.steps * response.dt, units),
        assumptions(
            f"{method_text(response.method)}, {pluralize(response.steps, 'time step')} of "
            f"{response.dt:.6g} s",
            (),
        ),
        Chapter("Notes", (once(response.notes),)),
    ]
    return page(
        model.name,
        f"Time history analysis of {model.name}: status {response.status}.",
        chapters,
        page_text,
    )


def _load_chapter(model: Model, end: float, units: OutputUnits) -> Chapter:
    """Return the chapter on forces from tables until the end of the run (s): their table and
    figure; without content if there are none."""
    if not model.excitation.tables:
        return Chapter("Forces on floors", ())
    # Imported here, because few models have tables of forces.
    from tdint.output.tables.loads import load_table

    picture = Picture(
        lambda: figures.loads.load_picture(model, end, units), "Forces on floors over time"
    )
    return Chapter("Forces on floors", (load_table(model.excitation).in_units(units), picture))


def _element_parts(response: Response, units: OutputUnits) -> tuple[Part, ...]:
    """Return the table of the elements of stories with several elements; empty without them."""
    table = element_table(response)
    if table is None:
        return ()
    names = [column.name for column in ELEMENT_COLUMNS]
    return (table.chosen(names).in_units(units),)


def _limit_parts(response: Response, page_text: PageText, units: OutputUnits) -> list[Part]:
    """Return the content of the chapter on limits: their table and a hysteresis loop.

    The loop is that of the story with the highest ratio of demand to limit. It is omitted if the
    figure of the run already contains it, or if the run has no response history.
    """
    parts: list[Part] = [page_text.limits] if page_text.limits else []
    story = page_text.governing_story
    if story is None or response.history is None:
        return parts
    # The first value of `loop_story` is the index of the story whose loop the figure shows.
    if story != figures.runs.loop_story(response)[0] + 1:
        parts.append(
            Picture(
                lambda: figures.runs.loop_picture(response, story, units),
                f"Hysteresis loop of story {story}, which governs the limits",
            )
        )
    return parts


def method_text(specification: str) -> str:
    """Return the name of a time-integration method and its publication, for reports.

    If a parameter of the specification, such as `newmark:beta=0.3`, differs from its default, the
    complete specification is used as the name.
    """
    chosen = parse(specification)
    is_default = chosen.values == parse(chosen.method.name).values
    return f"{chosen.method.name if is_default else specification} ({chosen.method.source})"


def _quantity(table: Table, name: str) -> str:
    """Return the name of a column of a table without the suffix of its unit: `peak_drift` for
    `peak_drift_m`."""
    return name.removesuffix(suffix(table.meanings[name].get("unit", TEXT)))


def _errors_of_run(response: Response, table: Table, names: Sequence[str]) -> tuple[Part, ...]:
    """Return a sentence and the table of the estimated errors of the peaks of a run, in percent.

    If the errors were not estimated, the result is a sentence that states this.
    """
    check = response.check
    if check is None or check.drift_error is None:
        return ("The error of the time integration was not estimated (--no-check).",)
    cells = {name: [row[i] for row in table.rows] for i, name in enumerate(table.columns)}
    # The relative error of a drift ratio is equal to the relative error of the drift, so that it is
    # not repeated.
    drift = next(name for name in names if _quantity(table, name) == "peak_drift")
    shown, columns = [name for name in names if "_ratio" not in name], [cells["story"]]
    for name in shown:
        # A residual drift can be close to zero, so its error is given relative to the peak drift.
        references = cells[drift if name.startswith("residual") else name]
        errors = cells[f"{name}_error"]
        columns.append(list(map(error_percent, errors, references)))
    labels = [_quantity(table, name) for name in shown]
    meanings = {label: {"meaning": "", "unit": "%"} for label in labels} | {
        "story": table.meanings["story"]
    }
    return _ERRORS, Table(("story", *labels), list(zip(*columns, strict=True)), meanings)


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
) -> bytes:
    """Return the report of a campaign whose store contains all runs of the plan.

    `profiles` are the statistics over the ground motions, for each building and intensity level.
    `limit` is the limit of the drift ratio, which the figure shows. `ratios` are the responses of
    the buildings divided by those of a baseline building.
    """
    content, units = campaign_summary(store), page_units(units)
    runs = content["runs"]
    status_text = ", ".join(f"{count} {status}" for status, count in runs["by_status"].items())
    limit_text = "" if limit is None else f", limit {100.0 * limit:g} %"
    profile_figure = Picture(
        lambda: figures.suites.profile_picture(profiles, units, limit=limit, title=plan.name),
        f"Drifts, floor accelerations, story shears: ground motions, mean, maximum{limit_text}",
    )
    periods = _first_periods(store)
    spectra = Picture(
        lambda: figures.suites.floor_suite_picture(floors, units, periods),
        "Floor spectra: mean, envelope",
    )
    # Only the first buildings are described, because the report must remain readable.
    subjects = {building.name: building.subject() for building in plan.buildings[:_MAX_MODELS]}
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
        Chapter("Result", (list(page_text.sentences), *((profile_figure,) if profiles else ()))),
        Chapter("Limits", (page_text.limits,) if page_text.limits else ()),
        Chapter("Ratios to the baseline", (_ratio_rows(ratios),) if ratios else ()),
        *(_statistics_chapter(profile, units, subjects) for profile in profiles),
        _runs_chapter(store),
        Chapter("Damage", _damage(store)),
        Chapter("Floor spectra", (spectra,) if floors else ()),
        *(model_chapter(subject.model, units) for subject in subjects.values()),
        load_case_chapter(plan, units)
        or motion_chapter(_motions_of_levels(plan, store), units, scaling_parts, periods),
        _suite_assumptions(plan, store, [*subjects.values()]),
        Chapter("Notes", (once(notes),)),
    ]
    campaign = {"file": "complete campaign (fingerprint)", "sha256": content["fingerprint"]}
    inputs = [*(page_text.inputs or content["inputs"]), campaign]
    page_text = replace(
        page_text,
        warnings=[*plan.warnings, *page_text.warnings, *scaling_warnings, *record_warnings],
        inputs=inputs,
        verdict=page_text.verdict or _headlines(store, profiles),
    )
    about = f"{runs['done']} of {pluralize(runs['all'], 'run')}: {status_text}."
    return page(plan.name, about, chapters, page_text)


def _suite_assumptions(plan: Plan, store: Store, subjects: Sequence[Subject]) -> Chapter:
    """Return the chapter of the assumptions of a campaign: methods, time steps, errors and rules.

    `store` is the store of the campaign, with the time steps and the estimated errors of all runs.
    """
    methods = ", ".join(dict.fromkeys(method_text(subject.method) for subject in subjects))
    step, accuracy = _steps_and_errors(store)
    free_vibration = (
        ("runs continue after the end of the record until free vibration has decayed",)
        if plan.settings.until_rest
        else ()
    )
    return assumptions(
        f"{methods}, {step}", [accuracy, *free_vibration, *_pair_rule(store), _SUITE]
    )


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


def _steps_and_errors(store: Store) -> tuple[str, str]:
    """Return two clauses for the assumptions in the report of a campaign: the time steps of the
    runs; the maximum energy imbalance of a run, and the maximum estimated error of the drifts if
    errors were estimated.
    """
    query = "SELECT min(dt_s), max(dt_s), max(abs(energy_error)) FROM run_rows"
    low, high, energy = store.connection.execute(query).fetchone()
    step = (
        f"time steps of {low:.6g} s" if low == high else f"time steps of {low:.6g} to {high:.6g} s"
    )
    imbalance = ""
    if energy is not None:
        imbalance = (
            f"the largest energy imbalance of a run is {number_text(100.0 * energy, 2)} % of its "
            "input energy"
        )
    if not store.checked:
        not_estimated = "the error of the time integration was not estimated (--check)"
        return step, "; ".join(filter(None, (not_estimated, imbalance)))
    query = "SELECT max(peak_drift_m_error / peak_drift_m) FROM run_rows"
    (error,) = store.connection.execute(query).fetchone()
    estimated = ""
    if error is not None:
        estimated = (
            f"the largest estimated error of a maximum drift is {number_text(100.0 * error, 2)} %"
        )
    # Either clause is empty if no run has a result.
    return step, "; ".join(filter(None, (estimated, imbalance)))


def _first_periods(store: Store) -> list[tuple[str, float]]:
    """Return the names and the first periods, s, of the buildings of a campaign."""
    periods = [(name, store.period(number)) for number, (name, _) in store.buildings().items()]
    return [(name, period) for name, period in periods if period is not None]


def _statistics_chapter(
    profile: Profile, units: OutputUnits, subjects: Mapping[str, Subject]
) -> Chapter:
    """Return the chapter of means and maxima of a building over the ground motions at a single
    intensity level; estimated errors are added if the runs have error estimates.

    Total shears are omitted if the model (`subjects`, by name) has neither P-delta nor dashpots.
    """
    subject = subjects.get(profile.building)
    suite_columns: tuple[str, ...] = _SUITE_COLUMNS
    if subject and not (subject.model.p_delta or subject.model.has_dashpots):
        suite_columns = tuple(name for name in suite_columns if name != "peak_total_shear")
    has_heights = not np.isnan(profile.height).any()
    # Isolators have no height, so their drifts in length units are listed in addition to the
    # ratios.
    drifts = ("peak_drift_ratio",) if has_heights else ("peak_drift_ratio", "peak_drift")
    parts: list[Part] = [profile_table(profile, (*drifts, *suite_columns), units)]
    if profile.peak_errors:
        parts += [_ERRORS, profile_error_table(profile, ("peak_drift", *suite_columns))]
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
    numbers = ("factor", "peak_drift_ratio", "peak_drift_m", "story", "largest_ductility")
    columns = ("building", "record", "component", *numbers, "status")
    meanings = {name: {"meaning": "", "unit": "1"} for name in numbers}
    meanings["peak_drift_m"] = {"unit": "m"}
    shown_rows = rows[:_MAX_MOTIONS]
    table = Table(columns, shown_rows, meanings)
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
    if len(rows) > _MAX_MOTIONS:
        omission = f"The first {_MAX_MOTIONS} of {len(rows)} runs; runs.csv lists all runs."
    return Chapter("Individual ground motions, largest drift first", (table, omission))


def _ratio_rows(ratios: Table) -> Table:
    """Return a table of ratios to a baseline building, prepared for a report.

    Rows without any number are omitted, and names of quantities contain spaces instead of
    underscores.
    """
    first_ratio = ratios.columns.index("quantity") + 1
    rows = [
        row
        for row in ratios.rows
        if any(isinstance(cell, float) and not math.isnan(cell) for cell in row[first_ratio:])
    ]
    return replace(ratios, rows=rows).with_values(
        "quantity", lambda quantity: str(quantity).replace("_", " ")
    )


def _damage(store: Store) -> tuple[Part, ...]:
    """Return the tables of damage and loss by building type; empty without damage states."""
    if not store.damage():
        return ()
    from tdint.output.tables.damage_states import loss_table, type_table

    # The rule for pairs is one of the assumptions, so its column is omitted.
    losses = loss_table(store)
    losses = losses.chosen([name for name in losses.columns if name != "pair_demand"])
    losses = replace(losses, rows=losses.rows[:_MAX_DAMAGE_ROWS])
    states = _with_state_columns(type_table(store))
    states = replace(states, rows=states.rows[:_MAX_DAMAGE_ROWS])
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
    rows = [
        (*key, *(by_state.get(state) for state in states))
        for key, by_state in probabilities.items()
    ]
    return Table((*keys, *states), rows, meanings)


def _motions_of_levels(plan: Plan, store: Store) -> list[list[tuple[Record, float]]]:
    """Return for each intensity level its unscaled records with their scale factors, smallest
    factors first. Levels that are equal for several buildings are returned once.
    """
    factors: dict[tuple[int, int, int], list[float]] = {}
    for building, motion, scale, sample, *_ in store.runs():
        factors.setdefault((building, motion, sample), []).append(scale)
    levels: dict[tuple[int, int], list[tuple[int, float]]] = {}
    for (building, motion, _), scales in factors.items():
        # Levels are ranks, because each ground motion can have its own scale factors: the smallest
        # factor of each ground motion belongs to the first level.
        for rank, scale in enumerate(sorted(scales, key=abs)):
            levels.setdefault((building, rank), []).append((motion, scale))
    return [
        [(plan.motions[motion].record, scale) for motion, scale in level]
        for level in dict.fromkeys(map(tuple, levels.values()))
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
    if not plan.factors:
        return (), []
    if not plan.scaled:
        return (
            f"Scale factors: {plan.factors}; the method of scaling is unknown, because there is no "
            "JSON file of `tdint scale` next to the factors.",
        ), []
    # `settings` contains the target or intensity measure, the rule, the period range, the damping
    # ratio and the treatment of pairs.
    settings = plan.scaled["settings"]
    parts: list[Part] = [_scaling_text(plan.factors, settings)]
    if settings["target"] and isinstance(plan.levels, MotionFactors):
        scaling = _scaled_suite(plan, plan.levels, settings)
        if scaling is not None:
            parts.append(
                Picture(
                    partial(figures.collapse.suite_picture, scaling, units, periods),
                    "Scaled ground motions and target spectrum",
                )
            )
    return tuple(parts), [f"{plan.factors}: {text}" for text in plan.scaled.get("warnings", ())]


def _scaling_text(factors: str, settings: Mapping[str, Any]) -> str:
    """Return a sentence on the scaling: rule, target, periods, damping, pairs, minimum ratio."""
    facts = [
        f"Scale factors: {factors}, computed by tdint scale",
        f"rule {settings['rule']} ({_RULES[settings['rule']]})",
    ]
    if settings["target"]:
        facts.append(f"target {spectrum_text(settings['target'])}")
    elif settings["measure"]:
        value = f"{settings['value']:.4g} {settings['unit']}".strip()
        facts.append(f"target {settings['measure']} = {value}")
    if settings["periods_s"]:
        facts.append("compared from {:.4g} to {:.4g} s".format(*settings["periods_s"]))
    facts.append(f"{100.0 * settings['damping']:g} % damping")
    if settings["pairs"]:
        facts.append(f"pairs represented by {figures.collapse.pair_text(settings['pairs'])}")
    if settings["least_average_over_target"] is not None:
        ratio = 100.0 * settings["least_average_over_target"]
        facts.append(f"the minimum ratio of average to target is {ratio:.3g} %")
    return f"{'; '.join(facts)}."


def _scaled_suite(plan: Plan, levels: MotionFactors, settings: Mapping[str, Any]) -> Scaling | None:
    """Return the scaled suite for its figure; None if a ground motion has several factors.

    Several factors define several suites, and the figure shows only one.
    """
    motions = _scaled_motions(plan, levels, paired=bool(settings["pairs"]))
    if any(len(factors) > 1 for _, factors in motions):
        return None
    # For rules that check the average, the figure also shows the average and 90 % of the target.
    # The average of pairs is not drawn for single components.
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
    plan: Plan, levels: MotionFactors, *, paired: bool
) -> list[tuple[GroundMotion, tuple[float, ...]]]:
    """Return the ground motions of a scaled suite, single components or pairs, with their scale
    factors.

    With `paired`, the two components of a recording that were read as single records are joined to
    a pair. Each item of `plan.motions` is a component; its attribute `ground_motion` is the object
    that was read: a single record, or the pair that contains the component.
    """
    # `partners` contains the index of the first component by the index of the second component.
    # None is the default rule for the demands of pairs, which has no effect on the partners.
    partners = PairRule.from_motions(plan.motions, None).partners if paired else {}
    # `pairs` contains the joined pairs by the index of their first component. Components that do
    # not fit together, for example with different sampling intervals, remain single motions.
    pairs: dict[int, Horizontals] = {}
    for second, first in partners.items():
        recorded = [plan.motions[first].ground_motion, plan.motions[second].ground_motion]
        records = [motion for motion in recorded if isinstance(motion, Record)]
        if len(records) == 2:
            with suppress(RecordError):
                pairs[first] = find_horizontals(records)
    # The two components of a pair that was read from one file have the same `ground_motion`. Its
    # identity is the key, so that the result contains each pair a single time.
    motions: dict[int, tuple[GroundMotion, tuple[float, ...]]] = {}
    for index, item in enumerate(plan.motions):
        if partners.get(index) in pairs:
            continue  # the second component of a joined pair
        motion = pairs.get(index, item.ground_motion)
        motions[id(item.ground_motion)] = motion, tuple(levels.by_motion[index])
    return list(motions.values())


def motion_chapter(
    levels: Sequence[Sequence[tuple[Record, float]]],
    units: OutputUnits,
    scaled: Sequence[Part] = (),
    periods: FirstPeriods = (),
    *,
    drawn: bool = False,
) -> Chapter:
    """Return the chapter of the ground motions of each level, with their response spectra.

    Parameters
    ----------
    scaled : sequence of Part
        Description of the scaling. If it contains a figure, the spectra are not drawn again.
    periods : sequence of (str, float)
        Names and first periods of the buildings, s, which the spectra mark; none by default.
    drawn : bool
        True if the report already has the spectra; false by default.
    """
    parts: list[Part] = list(scaled)
    drawn = drawn or any(isinstance(part, Picture) for part in scaled)
    for number, level in enumerate(levels[:_MAX_LEVELS], start=1):
        # A factor that all ground motions share is stated once.
        records = [record.scaled(factor) for record, factor in level]
        factors = {factor for _, factor in level}
        times = f"times {level[0][1]:.4g}" if len(factors) == 1 else "each times its scale factor"
        scaling = "" if factors == {1.0} else f", {times}"
        if len(levels) > 1:
            parts.append(f"Level {number} of {len(levels)}{scaling}:")
        parts.append(motion_table(records, component_names(records)).in_units(units))
        if matched := matched_text(records, spectrum_text):
            parts.append(f"The ground motions are {matched}; change: rms, relative to the seed:")
            parts.append(match_origin_table(records, component_names(records)))
            if warnings := match_warnings(records):
                parts += ["Warnings of the match:", once(warnings)]
        # A figure of more spectra would be a gray area.
        if len(records) <= _MAX_MOTIONS and not drawn:
            grid = np.geomspace(SPECTRUM_PERIODS[0], SPECTRUM_PERIODS[1], int(SPECTRUM_PERIODS[2]))
            spectra = [spectrum(record, grid) for record in records]
            draw = partial(figures.spectrum_curves.low_picture, spectra, units, periods)
            parts.append(Picture(draw, f"Response spectra, 5 % damping{scaling}"))
    return Chapter("Ground motions", parts)


# Every report of a suite states this assumption.
_SUITE = "means are over the ground motions without collapse"


def _pair_rule(store: Store) -> list[str]:
    """Return a clause on the demand of the two components of a pair; empty without pairs."""
    rule = store.pair_rule()
    return [f"{describe_demand(rule.demand)} (pair_demand: {rule.demand})"] if rule.pairs else []


def assumptions(step: str, more: Sequence[str]) -> Chapter:
    """Return the chapter of the assumptions of a report.

    Parameters
    ----------
    more : sequence of str
        Further assumptions of the analysis, without capitals and periods.
    """
    points = (
        f"Time integration: {step}.",
        *(f"{text[0].upper()}{text[1:]}." for text in more),
        *simplifications(),
        "Drifts are relative to the floor below, displacements relative to the ground; "
        "accelerations are absolute.",
    )
    return Chapter("Assumptions", (points,))


def simplifications() -> tuple[str, ...]:
    """Return the simplifications of a shear building; the first text names this type of model."""
    first, *others = MODEL_LIMITS
    return (f"Shear building: {first[0].lower()}{first[1:]}", *others)
