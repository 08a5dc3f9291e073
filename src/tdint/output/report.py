"""The pages of --report: which chapters a run, a suite, a pushover, modes and a comparison have."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tdint.analysis.spectra.elastic import spectrum
from tdint.analysis.spectra.target import read_target
from tdint.campaign.intensity import GEOMETRIC_MEAN
from tdint.campaign.motions import GivenFactors
from tdint.campaign.pairs import PairRule, in_words
from tdint.campaign.scaling import Scaling
from tdint.errors import RecordError
from tdint.ground_motion.horizontals import find_horizontals
from tdint.ground_motion.reading.suites import GroundMotion
from tdint.ground_motion.record import Record, component_names
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.definition import ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.output import figures
from tdint.output.page import Chapter, Part, Picture, Told, once, page, page_units
from tdint.output.summary import campaign_summary
from tdint.output.tables import buildings
from tdint.output.tables.campaign import profile_error_table, profile_table
from tdint.output.tables.responses import story_table
from tdint.output.tables.spectra import motion_table
from tdint.output.tables.table import TEXT, Cell, Table
from tdint.units import SI, OutputUnits, suffix
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.analysis.compare import Comparison
    from tdint.analysis.run.outcome import Response, StoryPeaks
    from tdint.analysis.spectra.floors import FloorSpectrum
    from tdint.analysis.spectra.modal import ModalResponse
    from tdint.analysis.static import Pushover
    from tdint.analysis.target_displacement import TargetDisplacement
    from tdint.campaign.plan import Plan
    from tdint.campaign.profiles import FloorSuite, Profile
    from tdint.campaign.store import Store

LEFT_OUT = (
    "Each floor is one mass that moves sideways in one direction; there is no torsion, no floor "
    "flexibility, no overturning and no axial force in columns, no soil.",
    "Each story is one spring from floor to floor: what columns, beams and joints do apart is in "
    "its law or not at all, and two directions of a motion act one at a time.",
    "Story laws do not know of one another; strength does not depend on axial force.",
)
"""What a shear building leaves out."""


def model_chapter(
    model: Model, units: OutputUnits = SI, peaks: StoryPeaks | None = None
) -> Chapter:
    """The building: its stories from the ground up, period and damping ratio of its first mode,
    P-delta; with the peaks of a run the period of the isolators' secant stiffness there, too."""
    omega, damping = assemble(model).first_mode()
    p_delta = "with P-delta" if model.p_delta else "without P-delta"
    of_isolators = ""
    if any(story.isolator for story in model.stories):
        told = (
            f"; {_period_at(model, peaks):.4g} s with their secant stiffness at the peak drift"
            if peaks
            else ""
        )
        of_isolators = f" (before the isolators yield{told})"
    facts = (
        f"{how_many(len(model.stories), 'story')}, first period {2.0 * math.pi / omega:.4g} "
        f"s{of_isolators} with {100.0 * damping:.3g} % damping, {p_delta}, {damping_words(model)}. "
        f"A drift ratio over {100.0 * model.collapse_drift:g} % counts as collapse."
    )
    return Chapter(f"Building: {model.name}", (facts, buildings.model_table(model, units)))


def _period_at(model: Model, peaks: StoryPeaks) -> float:
    """The first period with the secant stiffness of isolators at their peak drifts, s."""
    stories = tuple(
        replace(story, stiffness=shear / drift) if story.isolator and drift > 0.0 else story
        for story, shear, drift in zip(
            model.stories, peaks.peak_shear.tolist(), peaks.peak_drift.tolist(), strict=True
        )
    )
    return 2.0 * math.pi / assemble(replace(model, stories=stories)).first_mode()[0]


def damping_words(model: Model) -> str:
    """The damping besides dashpots, in a few words."""
    left_out = (
        ""
        if all(story.rayleigh for story in model.stories)
        else ", less what it would be in isolators"
    )
    match model.damping:
        case RayleighRatio(ratios, modes):
            pairs = dict.fromkeys(zip(ratios, modes, strict=True))
            told = " and ".join(f"{100.0 * ratio:g} % in mode {mode}" for ratio, mode in pairs)
            return f"Rayleigh damping of {told}{left_out}"
        case RayleighCoefficients(mass, stiffness):
            return (
                f"Rayleigh damping of {mass:.4g} 1/s times mass and {stiffness:.4g} s times "
                f"stiffness{left_out}"
            )
        case ModalDamping(ratios):
            return f"modal damping of {', '.join(f'{100.0 * ratio:g}' for ratio in ratios)} %"
    return "no damping besides dashpots"


# ---- The pages of a run and of a suite: which chapters they have

_MOST_MOTIONS = 60
"""Motions whose spectra are drawn."""

_NAMED_SPECTRA = 6
"""Spectra of which each has its name in a low picture."""

_MOST_LEVELS = 4
"""Levels of which the motions are listed."""

_MOST_MODELS = 8
"""Buildings whose stories are listed."""

_MOST_DAMAGE = 60
"""Rows of damage that are listed."""

_PERIODS = (0.05, 5.0, 100)
_OF_STORIES = (
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
_OF_SUITE = (
    "residual_drift",
    "peak_total_shear",
    "peak_absolute_acceleration",
    "peak_damper_force",
)
_ERRORS = (
    "Estimated errors of the time integration, in percent; of residual drifts in percent of the "
    "peak drifts:"
)


def run_page(
    response: Response, told: Told, *, floors: Sequence[FloorSpectrum] = (), units: OutputUnits = SI
) -> bytes:
    """The page of a run.

    Parameters
    ----------
    response : Response
        With its history, for the picture.
    floors : sequence of FloorSpectrum
        The spectra of its floors that were asked for.
    """
    model, check, units = response.model, response.check, page_units(units)
    whole = story_table(response.stories, check.errors if check else None).in_units(units)
    # A building with dampers has their forces in place of the restoring ones, a page has no room
    # for both.
    damped = any(response.stories.peak_damper_force)
    places = {_quantity(whole, name): name for name in whole.columns}
    names = [
        places[name]
        for name in _OF_STORIES
        if name in places and not (damped and name == "peak_shear")
    ]
    drawn = [
        Picture(
            lambda: figures.runs.run_picture(response, units),
            "Histories, energies, profiles, hysteresis",
        )
    ]
    spectra = Picture(
        lambda: figures.runs.floor_picture(floors, units, title=model.name), "Floor spectra"
    )
    chapters = [
        Chapter("Result", (list(told.said), *(drawn if response.history is not None else ()))),
        Chapter(
            "Peaks of the stories",
            (whole.chosen(["story", *names]), *_errors_of_run(response, whole, names)),
        ),
        Chapter("Floor spectra", (spectra,) if floors else ()),
        model_chapter(model, units, response.stories),
        _motions([[(response.record, 1.0)]] if response.record else [], units),
        _assumptions(
            f"{method_words(response.method)}, {how_many(response.steps, 'step')} of "
            f"{response.dt:.6g} s",
            (),
        ),
        Chapter("Notes", (once(response.notes),)),
    ]
    return page(
        model.name, f"Response in time of {model.name}: status {response.status}.", chapters, told
    )


def method_words(specification: str) -> str:
    """A method by its name and who published it."""
    chosen = parse(specification)
    usual = chosen.values == parse(chosen.method.name).values
    return f"{chosen.method.name if usual else specification} ({chosen.method.source})"


def _quantity(table: Table, name: str) -> str:
    """The name of a column without its unit."""
    return name.removesuffix(suffix(table.meanings[name].get("unit", TEXT)))


def _errors_of_run(response: Response, whole: Table, names: Sequence[str]) -> tuple[Part, ...]:
    """The errors of these columns in percent."""
    check = response.check
    if check is None or check.drift_error is None:
        return ("The error of the time integration was not told: --no-check leaves it out.",)
    cells = {name: [row[i] for row in whole.rows] for i, name in enumerate(whole.columns)}
    # Ratios have the errors of their drifts, in percent the same ones.
    drift = next(name for name in names if _quantity(whole, name) == "peak_drift")
    shown, columns = [name for name in names if "_ratio" not in name], [cells["story"]]
    for name in shown:
        # A residual drift may be next to nothing, and its error a large part of that.
        over = cells[drift if name.startswith("residual") else name]
        columns.append(
            [
                _percent(error, size)
                for error, size in zip(cells[f"{name}_error"], over, strict=True)
            ]
        )
    labels = [_quantity(whole, name) for name in shown]
    meanings = {label: {"meaning": "", "unit": "%"} for label in labels} | {
        "story": whole.meanings["story"]
    }
    return _ERRORS, Table(("story", *labels), list(zip(*columns, strict=True)), meanings)


def _percent(error: Cell, size: Cell) -> float | None:
    """An error in percent of what it is one of, two digits; none where that is nothing."""
    if (
        not isinstance(error, float)
        or not isinstance(size, float)
        or math.isnan(error)
        or size == 0.0
    ):
        return None
    return float(f"{100.0 * error / abs(size):.2g}")


def suite_page(
    plan: Plan,
    store: Store,
    profiles: Sequence[Profile],
    told: Told,
    *,
    limit: float | None = None,
    ratios: Table | None = None,
    floors: Sequence[FloorSuite] = (),
    units: OutputUnits = SI,
) -> bytes:
    """The page of several runs.

    Parameters
    ----------
    store : Store
        All runs of the plan, done.
    profiles : sequence of Profile
        Of each building and level.
    ratios : Table, optional
        The buildings over a baseline.
    floors : sequence of FloorSuite
        The spectra of floors over the motions that were asked for.
    """
    content, units = campaign_summary(store), page_units(units)
    runs = content["runs"]
    about = ", ".join(f"{count} {status}" for status, count in runs["by_status"].items())
    limits = "" if limit is None else f", limit {100.0 * limit:g} %"
    profile = Picture(
        lambda: figures.runs.profile_picture(profiles, units, limit=limit, title=plan.name),
        f"Drifts, floor accelerations, total shears: motions, mean, largest{limits}",
    )
    spectra = Picture(
        lambda: figures.runs.floor_suite_picture(floors, units), "Floor spectra: mean, envelope"
    )
    # Of many buildings the first ones: a page is read, not searched.
    models = [
        item.subject()
        for item in {item.name: item for item in plan.buildings[:_MOST_MODELS]}.values()
    ]
    methods = ", ".join(dict.fromkeys(method_words(item.method) for item in models))
    step_given = plan.settings.dt
    step = (
        f"{methods}, steps of {step_given:g} s"
        if step_given
        else f"{methods}, steps of the models or the records"
    )
    rest = (
        ("runs go on with the ground at rest until the building is",)
        if plan.settings.until_rest
        else ()
    )
    # What scaling and records leave doubtful stands at the top, as a warning.
    scaled, doubts = _scaling(plan, units)
    of_records = [
        f"{item.record.source}: {text}" for item in plan.motions for text in item.record.warnings
    ]
    warned = [text.partition(": ")[2] for text in of_records]
    chapters = [
        Chapter("Result", (list(told.said), *((profile,) if profiles else ()))),
        Chapter("Ratios to the baseline", (_compared(ratios),) if ratios else ()),
        *(_over_motions(item, units) for item in profiles),
        _one_by_one(store),
        Chapter("Damage", _damage(store)),
        Chapter("Floor spectra", (spectra,) if floors else ()),
        *(model_chapter(item.model, units) for item in models),
        _motions(_as_run(plan, store), units, scaled),
        _assumptions(step, [*rest, *_of_pairs(store), _SUITE]),
        Chapter("Notes", (once(note for note in plan.notes if not note.endswith(tuple(warned))),)),
    ]
    whole = {"file": "the whole campaign, its fingerprint", "sha256": content["fingerprint"]}
    inputs = [*(told.inputs or content["inputs"]), whole]
    told = replace(
        told, warnings=[*plan.warnings, *told.warnings, *doubts, *of_records], inputs=inputs
    )
    return page(
        plan.name, f"{runs['done']} of {how_many(runs['all'], 'run')}: {about}.", chapters, told
    )


def _over_motions(profile: Profile, units: OutputUnits) -> Chapter:
    """Means and largest values of a building, and where they were estimated their errors."""
    has_heights = not np.isnan(profile.height).any()
    # An isolator has no height: its drift stands beside the ratios, which limits are for.
    drifts = ("peak_drift_ratio",) if has_heights else ("peak_drift_ratio", "peak_drift")
    parts: list[Part] = [profile_table(profile, (*drifts, *_OF_SUITE), units)]
    if profile.peak_errors:
        parts += [_ERRORS, profile_error_table(profile, ("peak_drift", *_OF_SUITE))]
    building = ", ".join(filter(None, [profile.building, profile.level_text]))
    return Chapter(f"Over the motions: {building}", parts)


def _one_by_one(store: Store) -> Chapter:
    """A row for each run, the largest drift first: which motions carry the mean, and which brought
    a building down."""
    query = (
        "SELECT b.name, r.name, r.component, u.scale, u.peak_drift_ratio, u.peak_drift_m, "
        "u.peak_drift_story, (SELECT max(s.ductility) FROM story_rows s WHERE (s.building, "
        "s.record, s.scale, s.sample) = (u.building, u.record, u.scale, u.sample)), u.status FROM "
        "run_rows u JOIN buildings b ON b.id = u.building JOIN records r ON r.id = u.record ORDER "
        "BY u.status = 'done', u.peak_drift_ratio DESC, u.peak_drift_m DESC"
    )
    rows = store.connection.execute(query).fetchall()
    several = len({row[0] for row in rows}) > 1
    of_drift = ("peak_drift_ratio", "peak_drift_m")
    numbers = ("factor", *of_drift, "story", "ductility")
    meanings = {name: {"meaning": "", "unit": "1"} for name in numbers} | {
        "peak_drift_m": {"unit": "m"}
    }
    whole = Table(
        ("building", "record", "component", *numbers, "status"), rows[:_MOST_MOTIONS], meanings
    )
    # A drift ratio says more than its length.
    left_out = of_drift[any(row[4] is not None for row in rows)]
    shown = whole.chosen(
        [name for name in whole.columns if name != left_out and (several or name != "building")]
    )
    more = (
        f"The first {_MOST_MOTIONS} of {len(rows)} runs; runs.csv has all."
        if len(rows) > _MOST_MOTIONS
        else ""
    )
    return Chapter("Motions one by one, largest drift first", (shown, more))


def _compared(ratios: Table) -> Table:
    """The ratios that there are, their quantities in words."""
    place = ratios.columns.index("quantity")
    rows = [
        (*row[:place], str(row[place]).replace("_", " "), *row[place + 1 :])
        for row in ratios.rows
        if any(isinstance(cell, float) and not math.isnan(cell) for cell in row[place + 1 :])
    ]
    return replace(ratios, rows=rows)


def _damage(store: Store) -> tuple[Part, ...]:
    """The damage of each type, and what it costs; nothing where it is not told."""
    if not store.damage():
        return ()
    from tdint.output.tables.damage_states import loss_table, type_table

    tables = [type_table(store), loss_table(store)]
    more = any(len(table.rows) > _MOST_DAMAGE for table in tables)
    short = [replace(table, rows=table.rows[:_MOST_DAMAGE]) for table in tables]
    return *short, "The first rows; damage-types.csv and losses.csv have all." if more else ""


def _as_run(plan: Plan, store: Store) -> list[list[tuple[Record, float]]]:
    """The motions with the factors on them, level by level from the smallest; what several
    buildings share once."""
    factors: dict[tuple[int, int, int], list[float]] = {}
    for building, motion, scale, sample, *_ in store.runs():
        factors.setdefault((building, motion, sample), []).append(scale)
    levels: dict[tuple[int, int], list[tuple[int, float]]] = {}
    for (building, motion, _), scales in factors.items():
        # Each motion's smallest factor belongs to the first level, whatever its size.
        for rank, scale in enumerate(sorted(scales, key=abs)):
            levels.setdefault((building, rank), []).append((motion, scale))
    return [
        [(plan.motions[motion].record, scale) for motion, scale in level]
        for level in dict.fromkeys(map(tuple, levels.values()))
    ]


_RULES = {
    "value": "each motion to this value",
    "mean": "least squares of ln Sa, each motion for itself",
    "asce7": "ASCE 7-16, 16.2.3.2",
    "ec8": "EN 1998-1:2004, 3.2.3.1.2",
    "p695": "FEMA P-695, A.8",
}


def _scaling(plan: Plan, units: OutputUnits) -> tuple[tuple[Part, ...], list[str]]:
    """What the factors of a campaign were found for, with a picture where that is a spectrum, and
    what a reviewer would ask about them; as `tdint scale` told it beside them."""
    if not plan.factors:
        return (), []
    if not plan.scaled:
        return (
            f"Factors: {plan.factors}; no file of `tdint scale` beside it says how they came "
            "about.",
        ), []
    # In the words of the command: target or measure, rule, range, damping, pairs.
    settings = plan.scaled["settings"]
    aim = settings["target"] or " ".join(
        f"{settings['measure']} = {settings['value']:.4g} {settings['unit']}".split()
        if settings["measure"]
        else ()
    )
    words = [
        f"Factors: {plan.factors}, found by `tdint scale`",
        f"rule {settings['rule']} ({_RULES[settings['rule']]})",
    ]
    words += [f"target {aim}"] if aim else []
    if settings["periods_s"]:
        words.append("compared from {:.4g} to {:.4g} s".format(*settings["periods_s"]))
    words.append(f"{100.0 * settings['damping']:g} % damping")
    words += [f"pairs by their {settings['pairs']}"] if settings["pairs"] else []
    if settings["least_average_over_target"] is not None:
        words.append(
            f"the average is {100.0 * settings['least_average_over_target']:.3g} % of the target "
            "at the least"
        )
    parts: list[Part] = ["; ".join(words) + "."]
    if settings["target"] and isinstance(plan.levels, GivenFactors):
        wholes = _as_scaled(plan, plan.levels, paired=bool(settings["pairs"]))
        # The average of the text is that of pairs: it is not drawn of single components.
        singles = settings["pairs"] and any(isinstance(whole, Record) for whole, _ in wholes)
        # Several factors for a motion are several suites, which one picture does not show.
        if all(len(factors) == 1 for _, factors in wholes):
            scaling = Scaling(
                tuple(whole for whole, _ in wholes),
                np.array([factors[0] for _, factors in wholes]),
                settings["rule"],
                settings["pairs"] or GEOMETRIC_MEAN,
                settings["damping"],
                target=read_target(settings["target"]),
                periods=np.geomspace(*settings["periods_s"]),
                # Of the rules that check the average: the picture shows it, and 90 % of the target,
                # by this.
                least=None
                if (least := settings["least_average_over_target"]) is None or singles
                else (least, math.nan),
            )
            parts.append(
                Picture(
                    partial(figures.collapse.suite_picture, scaling, units),
                    "The scaled motions and the target",
                )
            )
    return tuple(parts), [f"{plan.factors}: {text}" for text in plan.scaled.get("warnings", ())]


def _as_scaled(
    plan: Plan, levels: GivenFactors, *, paired: bool
) -> list[tuple[GroundMotion, tuple[float, ...]]]:
    """Return the motions as they were scaled, with their factors: pairs if `paired`, also those
    that the runs have as single components."""
    partners = PairRule.of_motions(plan.motions, None).partners if paired else {}
    seconds = {first: second for second, first in partners.items()}
    wholes: dict[int, tuple[GroundMotion, tuple[float, ...]]] = {}
    for number, motion in enumerate(plan.motions):
        whole = motion.whole
        if number in partners and isinstance(whole, Record):
            continue  # it is the second component of a pair that is in the list
        if number in seconds and isinstance(whole, Record):
            both = [whole, plan.motions[seconds[number]].record]
            with suppress(RecordError):  # no pair after all: the component stays alone
                whole = find_horizontals(both)
        wholes[id(motion.whole)] = whole, tuple(levels.by_motion[number])
    return list(wholes.values())


def _motions(
    levels: Sequence[Sequence[tuple[Record, float]]],
    units: OutputUnits,
    scaled: Sequence[Part] = (),
) -> Chapter:
    """The ground motions as they were run, and their spectra, level by level, unless a picture of
    their scaling has these."""
    parts: list[Part] = list(scaled)
    drawn = any(isinstance(part, Picture) for part in scaled)
    for number, level in enumerate(levels[:_MOST_LEVELS], start=1):
        # Factors that are all alike are told once.
        records = [record.scaled(factor) for record, factor in level]
        factors = {factor for _, factor in level}
        times = f"times {level[0][1]:.4g}" if len(factors) == 1 else "each times its factor"
        said = "" if factors == {1.0} else f", {times}"
        parts += [f"Level {number} of {len(levels)}{said}:"] * (len(levels) > 1)
        parts.append(motion_table(records, component_names(records)).in_units(units))
        # More spectra than these in one picture are a gray area.
        if len(records) <= _MOST_MOTIONS and not drawn:
            periods = np.geomspace(_PERIODS[0], _PERIODS[1], int(_PERIODS[2]))
            spectra = [spectrum(record, periods) for record in records]
            draw = partial(figures.spectrum_curves.low_picture, spectra, units)
            if len(spectra) > _NAMED_SPECTRA:
                draw = partial(figures.spectrum_curves.spectrum_picture, spectra, "periods", units)
            parts.append(Picture(draw, f"Response spectra, 5 % damping{said}"))
    return Chapter("Ground motions", parts)


_SUITE = "means are over the motions under which the building stood"


def _of_pairs(store: Store) -> list[str]:
    """How the components of pairs count; nothing without pairs."""
    rule = store.pair_rule()
    return [f"{in_words(rule.demand)} (pair_demand: {rule.demand})"] if rule.pairs else []


def _assumptions(step: str, more: Sequence[str]) -> Chapter:
    points = (
        f"Time integration: {step}.",
        *(f"{text[0].upper()}{text[1:]}." for text in more),
        "A shear building: " + LEFT_OUT[0][0].lower() + LEFT_OUT[0][1:],
        *LEFT_OUT[1:],
        "Drifts and displacements are relative to the floor below and to the ground; accelerations "
        "are absolute.",
    )
    return Chapter("Assumptions", (points,))


# ---- The pages of a pushover, of modal peaks and of a comparison


def pushover_page(
    result: Pushover, targets: Sequence[TargetDisplacement], told: Told, units: OutputUnits = SI
) -> bytes:
    """The page of a pushover, and of where a design spectrum pushes the building to."""
    model, units = result.model, page_units(units)
    drawn = partial(figures.comparison.pushover_picture, result, units)
    # The rows of a curve are for a plot; of a target displacement each story's drift is judged.
    parts: list[Part] = []
    if targets:
        drawn = partial(figures.comparison.target_picture, targets, units)
        parts = [
            _words_of_methods(buildings.target_table(targets)),
            "The equivalent oscillators, and the building where they push it to:",
            _words_of_methods(buildings.target_building_table(targets)).in_units(units),
        ]
    chapters = [
        Chapter("Result", (list(told.said), Picture(drawn, f"Pushover, {result.pattern} pattern"))),
        Chapter("Stories at the target displacement", parts),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_PUSHED, *LEFT_OUT),)),
    ]
    return page(
        model.name, f"Pushover of {model.name}, {result.pattern} pattern of forces.", chapters, told
    )


def _words_of_methods(table: Table) -> Table:
    """The methods in words."""
    place = table.columns.index("method")
    return replace(
        table,
        rows=[(*row[:place], _METHODS[str(row[place])], *row[place + 1 :]) for row in table.rows],
    )


_METHODS = {"n2": "N2, EN 1998-1 annex B", "coefficients": "ASCE 41-17, 7.4.3.3"}
_PUSHED = (
    "The building is pushed slowly by forces of one pattern; without dashpots and damping, with "
    "its P-delta if it has.",
    "A target displacement is an estimate from one curve and an elastic spectrum; time histories "
    "may differ.",
)


def modal_page(result: ModalResponse, told: Told, units: OutputUnits = SI) -> bytes:
    """The page of the peaks of a linear building under a design spectrum."""
    model, units = result.model, page_units(units)
    drawn = partial(figures.comparison.modal_response_picture, result, units)
    # The page has one of both sums, CQC, which holds for close modes, too; the base shear by SRSS
    # stands in its words.
    table = buildings.modal_response_table(result)
    table = table.chosen([name for name in table.columns if name == "story" or "_cqc" in name])
    chapters = [
        Chapter(
            "Result",
            (list(told.said), Picture(drawn, f"Peaks of the stories under {result.target.source}")),
        ),
        Chapter("Peaks of the stories", (table.in_units(units),)),
        Chapter("Modes", (buildings.modal_share_table(result).in_units(units),)),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_MODAL, *LEFT_OUT),)),
    ]
    return page(
        model.name,
        f"Response spectrum analysis of {model.name}: {result.target.source}.",
        chapters,
        told,
    )


_MODAL = (
    "The building is linear with its initial stiffness; peaks of modes are combined by the square "
    "root of the sum of squares (SRSS) and by the complete quadratic combination (CQC), each "
    "response from its own modal peaks.",
    "The target spectrum is that of all modes, whatever damping the model has.",
)


def comparison_page(
    comparisons: Sequence[Comparison],
    draw: Callable[[], Figure],
    told: Told,
    fitted: Table | None,
    units: OutputUnits,
) -> bytes:
    """The page of a building's result beside recordings; `fitted` are the values that were fitted
    to one of them."""
    response, units = comparisons[0].response, page_units(units)
    words = f"{method_words(response.method)}, steps of {response.dt:.6g} s"
    chapters = [
        Chapter("Result", (list(told.said), buildings.comparison_table(comparisons))),
        Chapter(
            "Recorded and computed",
            (Picture(draw, "Recorded and computed histories and spectra of the floors"),),
        ),
        Chapter("Fitted", (fitted,) if fitted else ()),
        model_chapter(response.model, units),
        _assumptions(
            words, ("recording and result are taken to the same band, without shift of phase",)
        ),
    ]
    return page(response.model.name, f"{response.model.name} beside recordings.", chapters, told)
