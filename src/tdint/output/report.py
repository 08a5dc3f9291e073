"""HTML reports of --report for a run and for analyses of a building (pushover, response spectrum
analysis, natural modes, transfer functions), and the chapters that all reports share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.origin import matched_clause
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.definition import ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.number_parsing import number_text, pluralize
from tdint.output import figures
from tdint.output.page import Chapter, PageText, Part, Picture, once, page, page_units
from tdint.output.spectrum_text import spectrum_text
from tdint.output.tables import buildings, transfer
from tdint.output.tables.elements import ELEMENT_COLUMNS, element_table
from tdint.output.tables.responses import story_table
from tdint.output.tables.spectra import match_origin_table, motion_table
from tdint.output.tables.table import TEXT, Cell, Table, error_percent
from tdint.response.runs.error_estimate import FLOOR
from tdint.response.spectra.elastic import spectrum
from tdint.units import SI, OutputUnits, suffix

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.output.figures.style import FirstPeriods
    from tdint.response.runs.outcome import Response, StoryPeaks
    from tdint.response.spectra.floor_motions import FloorSpectrum
    from tdint.response.spectra.modal import ModalResponse
    from tdint.response.spectra.transfer import TransferFunction
    from tdint.response.static.pushover import Pushover
    from tdint.response.static.target_displacement import TargetDisplacement


MODEL_LIMITS = (
    "Each floor is one mass that moves horizontally; the two directions of a ground motion act "
    "separately. Torsion, floor flexibility, overturning, axial forces in columns and the soil are "
    "not modeled.",
    "Each story is one spring between two floors. Columns, beams and joints are represented only "
    "by the hysteretic law of their story.",
    "The hysteretic laws of stories are independent; strength does not depend on axial force.",
)
"""Simplifications of a shear building."""


def model_chapter(
    model: Model,
    units: OutputUnits = SI,
    peaks: StoryPeaks | None = None,
    base: Model | None = None,
) -> Chapter:
    """Return the chapter about the building: its properties and the table of its stories.

    Parameters
    ----------
    base : Model, optional
        Another building of the report. If it has the same number of stories, only properties of the
        stories that differ from its stories are listed.
    peaks : StoryPeaks, optional
        Peak responses of a run. If the building has isolators, the chapter also states the period
        with the secant stiffness of the isolators at these peak drifts.
    """
    if model.across is not None:
        bases = base.directions if base else (None, None)
        chapters = [
            model_chapter(part, units, peaks, of_base)
            for part, of_base in zip(model.directions, bases, strict=True)
        ]
        along = zip("xy", chapters, strict=True)
        by_direction = [(f"Direction {axis}:", *chapter.parts) for axis, chapter in along]
        return Chapter(chapters[0].title, [part for parts in by_direction for part in parts])
    building = assemble(model)
    damping = building.first_mode()[1]
    p_delta = "with P-delta" if model.has_p_delta else "without P-delta"
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
    if model.varied_parameters:
        changed = (
            f"{name} {value:.6g} {model.unit_of(name, SI)[0]}".rstrip()
            for name, value in model.varied_parameters
        )
        facts += f" Values instead of those of the model file: {', '.join(changed)}."
    devices = buildings.device_model_table(model, units)
    text, stories = _story_parts(model, units, base)
    parts: list[Part] = [f"{facts} {text}".rstrip(), *stories]
    if devices:
        parts.append(devices)
    return Chapter(f"Building: {model.name}", parts)


def _story_parts(model: Model, units: OutputUnits, base: Model | None) -> tuple[str, list[Table]]:
    """Return the properties of the stories: sentences on properties that equal the properties of
    another building or their multiples, a table of the properties that differ between the stories,
    and a table of the others, with ranges of stories.

    Additional stories, such as isolators, are below the stories of the other building.
    """
    table = buildings.model_table(model, units)
    added = 0 if base is None else len(model.stories) - len(base.stories)
    texts, names = [], list(table.columns)
    if base is not None and added >= 0:
        other = buildings.model_table(base, units)
        stories = f"stories {added + 1} to {len(model.stories)}" if added else "stories"
        texts.append(f"{stories} as of {base.name}")
        names = ["story"]
        for name in dict.fromkeys((*table.columns[1:], *other.columns[1:])):
            own, of_base = _cells(table, name)[added:], _cells(other, name)
            if own and of_base and (factor := _common_factor(own, of_base)):
                texts.append(f"{_label(table, name)} {factor} times")
            elif not any(own) and any(of_base):
                texts.append(f"without {_label(other, name)}")
            elif own != (of_base or [""] * len(own)):
                names.append(name)
        if added and names == ["story"]:
            names, table = list(table.columns), table._replace(rows=table.rows[:added])
            texts.append("story 1" if added == 1 else f"stories 1 to {added}")
        elif len(names) > 1:
            texts[0] += f", except {', '.join(_label(table, name) for name in names[1:])}"
    names = [name for name in names[1:] if any(_cells(table, name))]
    common = [name for name in names if _is_common(table, name)]
    differing = [name for name in names if name not in common]
    tables = [table.chosen(["story", *differing])] if differing else []
    if common:
        tables.append(_with_ranges(table.chosen(["story", *common])))
    text = "; ".join(texts) + (":" if tables else ".") if texts else ""
    return text[:1].upper() + text[1:], tables


def _label(table: Table, name: str) -> str:
    """Return the name of a column in a sentence, without its unit."""
    return _quantity(table, name).replace("_", " ")


def _cells(table: Table, name: str) -> list[Cell]:
    """Return the cells of a column, with an empty text for missing values; empty without the
    column."""
    if name not in table.columns:
        return []
    index = table.columns.index(name)
    # A missing number is nan, for which != is true.
    return [
        "" if row[index] in (None, "") or row[index] != row[index] else row[index]
        for row in table.rows
    ]


def _common_factor(cells: Sequence[Cell], of_base: Sequence[Cell]) -> str:
    """Return the common ratio of two columns of numbers as text; empty if the columns are equal
    or have no common ratio in the digits of a report."""
    own, base = (
        [cell for cell in column if isinstance(cell, float) and cell] for column in (cells, of_base)
    )
    if cells == of_base or not len(own) == len(base) == len(cells):
        return ""
    ratios = {number_text(value / other, 3) for value, other in zip(own, base, strict=True)}
    return ratios.pop() if len(ratios) == 1 else ""


def _is_common(table: Table, name: str) -> bool:
    """Return True if all stories have the same value of a property, or two ranges of stories have
    the same text; False for a single story."""
    unit = table.meanings.get(name, {}).get("unit", TEXT)
    ranges = len([*groupby(_cells(table, name))])
    return len(table.rows) > 1 and ranges <= 1 + (unit == TEXT)


def _with_ranges(table: Table) -> Table:
    """Return a table in which consecutive stories with equal properties have a common row."""
    cells = zip(*(_cells(table, name) for name in table.columns), strict=True)
    rows = []
    for properties, group in groupby(cells, key=itemgetter(slice(1, None))):
        first, *others = (str(row[0]) for row in group)
        rows.append((f"{first} to {others[-1]}" if others else first, *properties))
    return table._replace(rows=rows)


def first_period(model: Model) -> float:
    """Return the first period of a building, s, with the initial stiffness."""
    return max(assemble(part).first_period for part in model.directions)


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
            if len(modes) == 1:
                kind = f"damping proportional to the {'tangent ' if tangent else ''}stiffness"
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


# ---- Report of a run

MAX_MOTIONS = 60
"""Maximum number of ground motions in the table of runs and in the figure of spectra."""

_MAX_LEVELS = 4
"""Maximum number of intensity levels that list their ground motions."""


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
# This sentence precedes the table of peaks if restoring forces and total shears differ.
_SHEARS = (
    "Peak shears are restoring forces of the stories; peak total shears are the forces on all "
    "floors above, with {}."
)
# This sentence precedes the tables of estimated errors.
ERRORS = (
    "Estimated errors of the time integration, in percent; the smallest estimate is "
    f"{number_text(100.0 * FLOOR)} %. Errors of residual drifts are in percent of the peak drifts:"
)


def run_page(
    response: Response,
    page_text: PageText,
    *,
    floors: Sequence[Sequence[FloorSpectrum]] = (),
    units: OutputUnits = SI,
) -> bytes:
    """Return the report of a run.

    Parameters
    ----------
    response : Response
        Result of the run, with its response history if the report has its figure.
    floors : sequence of sequences of FloorSpectrum
        Requested floor spectra of the run, or of both directions; none by default.
    """
    model, units = response.model, page_units(units)
    picture, caption = figures.runs.run_picture, "energies, profiles, hysteresis loops"
    parts: dict[str, Response] = {"": response}
    if response.directions:
        picture, caption = figures.runs.plan_picture, "drifts in plan, profiles"
        names = (", direction x", ", direction y", ", both directions")
        parts = dict(zip(names, (*response.directions, response), strict=True))
    histories = Picture(partial(picture, response, units), f"Response histories, {caption}")
    has_histories = response.history is not None or response.directions
    records = [part.record for part in response.directions or (response,)]
    chapters = [
        page_text.result(*([histories] if has_histories else [])),
        Chapter("Limits", _limit_parts(response, page_text, units)),
        Chapter("Base shear and pushover", _pushover_parts(response, units)),
        assumptions(
            f"{method_text(response.method)}, {pluralize(response.steps, 'time step')} of "
            f"{response.dt:.6g} s",
            (),
        ),
        Chapter("Notes", (once(response.notes),)),
    ]
    spectra = dict(zip(parts, floors, strict=False))
    for name, part in parts.items():
        chapters += _chapters_of_peaks(part, name, spectra.get(name, ()), units)
    chapters += [
        model_chapter(model, units, response.stories),
        unscaled_motions([record for record in records if record], model, units),
        _load_chapter(model, response.steps * response.dt, units),
    ]
    return page(
        model.name,
        f"Time history analysis of {model.name}: status {response.status}.",
        chapters,
        page_text,
    )


def _chapters_of_peaks(
    response: Response, name: str, floors: Sequence[FloorSpectrum], units: OutputUnits
) -> list[Chapter]:
    """Return the chapters of the peaks of a run: of stories, elements, attachments and links, and
    floors. `name` is the end of their titles, such as `, direction x`."""
    model, check = response.model, response.check
    table = story_table(response.stories, check.errors if check else None).in_units(units)
    columns = {_quantity(table, column): column for column in table.columns}
    names = [columns[quantity] for quantity in _STORY_COLUMNS if quantity in columns]
    elements: list[Part] = []
    if all_elements := element_table(response):
        element_names = [column.name for column in ELEMENT_COLUMNS]
        elements.append(all_elements.chosen(element_names).in_units(units))
    spectra = Picture(
        lambda: figures.floor_spectra.floor_picture(
            floors, units, title=model.name, period=first_period(model)
        ),
        f"Floor spectra{name}",
    )
    forces = model.forces_of_total_shear
    peaks = (
        _SHEARS.format(forces) if forces else "",
        table.chosen(["story", *names]),
        *_errors_of_run(response, table, names),
    )
    return [
        Chapter(f"Peaks of the stories{name}", peaks),
        Chapter(f"Elements of the stories{name}", elements),
        Chapter(f"Attachments and links{name}", _device_parts(response, units)),
        Chapter(f"Floor spectra{name}", (spectra,) if floors else ()),
    ]


def _load_chapter(model: Model, end: float, units: OutputUnits) -> Chapter:
    """Return the chapter on forces from tables until the end of the run (s): their table and
    figure; without content if the model has no tables."""
    if not model.excitation.tables:
        return Chapter("Forces on floors", ())
    # Imported here, because few models have tables of forces.
    from tdint.output.tables.loads import load_table

    picture = Picture(
        lambda: figures.loads.load_picture(model, end, units), "Forces on floors over time"
    )
    return Chapter("Forces on floors", (load_table(model.excitation).in_units(units), picture))


def _device_parts(response: Response, units: OutputUnits) -> tuple[Part, ...]:
    """Return the tables of attachments and links, without errors; empty without devices."""
    if response.devices is None:
        return ()
    # Imported here, because few models have attachments or links.
    from tdint.output.tables.devices import device_tables

    return tuple(
        table.chosen([name for name in table.columns if not name.endswith("_error")]).in_units(
            units
        )
        for table in device_tables(response)
        if table is not None
    )


def _limit_parts(response: Response, page_text: PageText, units: OutputUnits) -> list[Part]:
    """Return the content of the chapter on limits: their table and a hysteresis loop.

    The loop is the loop of the story with the highest ratio of demand to limit. It is omitted if
    the figure of the run already contains it, or if the run has no response history.
    """
    parts: list[Part] = [page_text.limits] if page_text.limits else []
    story = page_text.governing_story
    if story is None or response.history is None:
        return parts
    # The first value of `loop_story` is the index of the story with the loop that the figure shows.
    if story != figures.runs.loop_story(response)[0] + 1:
        parts.append(
            Picture(
                lambda: figures.runs.loop_picture(response, story, units),
                f"Hysteresis loop of story {story}, which governs the limits",
            )
        )
    return parts


def _pushover_parts(response: Response, units: OutputUnits) -> tuple[Part, ...]:
    """Return the figure of the base shear over the roof drift of a run with the pushover of the
    building; empty if no story has yielded, without a response history, and for buildings that
    cannot be pushed."""
    model, history, stories = response.model, response.history, response.stories
    has_yielded = bool(np.any(np.nan_to_num(stories.ductility) > 1.0))
    if history is None or not has_yielded or any(story.isolator for story in model.stories):
        return ()
    # Imported here, because most reports need no pushover.
    from tdint.response.static.pushover import pushover

    try:
        pushed = pushover(model, f"{stories.peak_displacement[-1]:.6g}m")
    except (UsageError, AnalysisError):
        return ()
    return (
        Picture(
            lambda: figures.static_curves.run_and_pushover_picture(history, pushed, units),
            "Base shear over roof drift, without dashpots: run and pushover",
        ),
    )


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
    return name.removesuffix(suffix(table.meanings.get(name, {}).get("unit", TEXT)))


def _errors_of_run(response: Response, table: Table, names: Sequence[str]) -> tuple[Part, ...]:
    """Return a sentence and the table of the estimated errors of the peaks of a run, in percent.

    If the errors were not estimated, the result is a sentence that states this.
    """
    check = response.check
    if check is None or check.drift_error is None:
        return ("The error of the time integration was not estimated.",)
    cells = {name: [row[i] for row in table.rows] for i, name in enumerate(table.columns)}
    # The relative error of a drift ratio is equal to the relative error of the drift, so that it is
    # not repeated.
    drift = next(name for name in names if _quantity(table, name) == "peak_drift")
    shown, columns = [name for name in names if "_ratio" not in name], [cells["story"]]
    for name in shown:
        # A residual drift can be close to zero, so its error is given relative to the peak drift.
        references = cells[drift if name.startswith("residual") else name]
        columns.append(list(map(error_percent, cells[f"{name}_error"], references)))
    labels = [_quantity(table, name) for name in shown]
    meanings = {label: {"meaning": "", "unit": "%"} for label in labels} | {
        "story": table.meanings["story"]
    }
    return ERRORS, Table(("story", *labels), list(zip(*columns, strict=True)), meanings)


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
        Description of the scaling. If it contains a figure, the spectra are not plotted again.
    periods : sequence of (str, float)
        Names and first periods of the buildings, s, which the spectra mark; none by default.
    drawn : bool
        True if the report already has the spectra; false by default.
    """
    parts: list[Part] = list(scaled)
    drawn = drawn or any(isinstance(part, Picture) for part in scaled)
    for number, pairs in enumerate(levels[:_MAX_LEVELS], start=1):
        # A motion along two axes is shown as its components.
        level = [
            (component, factor)
            for record, factor in pairs
            for component in getattr(record, "components", (record,))
        ]
        # A factor that all ground motions share is stated only one time.
        records = [record.scaled(factor) for record, factor in level]
        factors = {factor for _, factor in level}
        times = f"times {level[0][1]:.4g}" if len(factors) == 1 else "each times its scale factor"
        scaling = "" if factors == {1.0} else f", {times}"
        if len(levels) > 1:
            parts.append(f"Level {number} of {len(levels)}{scaling}:")
        # A figure of more spectra would be a gray area.
        if len(records) <= MAX_MOTIONS and not drawn:
            grid = np.geomspace(SPECTRUM_PERIODS[0], SPECTRUM_PERIODS[1], int(SPECTRUM_PERIODS[2]))
            spectra = [spectrum(record, grid) for record in records]
            draw = partial(figures.spectrum_curves.low_picture, spectra, units, periods)
            parts.append(Picture(draw, f"Response spectra, 5 % damping{scaling}"))
            drawn = len(factors) == 1  # the spectra of another common factor are a multiple
        parts.append(motion_table(records).in_units(units))
        origins = [record.origin for record in records]
        if matched := matched_clause(origins, len(origins), spectrum_text):
            parts.append(f"The ground motions are {matched}; change: rms, relative to the seed:")
            parts.append(match_origin_table(records))
            if warnings := [
                f"{record.name}: {text}"
                for record in records
                for text in (record.origin.warnings if record.origin else ())
            ]:
                parts += ["Warnings of the match:", once(warnings)]
    return Chapter("Ground motions", parts)


def unscaled_motions(records: Sequence[Record], model: Model, units: OutputUnits) -> Chapter:
    """Return the chapter of ground motions that are not scaled, with the first period of a building
    in their spectra; without content if there are no ground motions."""
    levels = [[(record, 1.0) for record in records]] if records else []
    names = [model.name] if model.across is None else [f"{model.name}, {axis}" for axis in "xy"]
    periods = zip(names, map(first_period, model.directions), strict=True)
    return motion_chapter(levels, units, periods=[*periods])


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


def pushover_page(
    result: Pushover,
    targets: Sequence[TargetDisplacement],
    page_text: PageText,
    units: OutputUnits = SI,
) -> bytes:
    """Return the report of a pushover analysis and of its target displacements.

    Parameters
    ----------
    targets : sequence of TargetDisplacement
        Target displacements under a design spectrum; may be empty.
    """
    model, units = result.model, page_units(units)
    draw = partial(figures.static_curves.pushover_picture, result, units)
    # The figure shows the curve; the tables list the story drifts at the target displacements.
    parts: list[Part] = []
    if targets:
        draw = partial(figures.static_curves.target_picture, targets, units)
        parts = [
            _with_method_names(Table.of_results(buildings.TARGET_DISPLACEMENT, targets)),
            "The equivalent oscillators, and the building at the target displacement:",
            _with_method_names(Table.of_results(buildings.TARGET_OF_BUILDING, targets)).in_units(
                units
            ),
        ]
    chapters = [
        page_text.result(Picture(draw, f"Pushover, {result.pattern} pattern")),
        Chapter("Stories at the target displacement", parts),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_PUSHOVER_ASSUMPTIONS, *MODEL_LIMITS),)),
    ]
    target = f", target spectrum {spectrum_text(targets[0].target.source)}" if targets else ""
    about = f"Pushover of {model.name}, {result.pattern} force pattern{target}."
    return page(model.name, about, chapters, page_text)


def _with_method_names(table: Table) -> Table:
    """Replace the keys of the methods for target displacements in a table by their names."""
    return table.with_values("method", lambda key: METHOD_NAMES[str(key)])


METHOD_NAMES = {"n2": "N2, EN 1998-1 annex B", "coefficients": "ASCE 41-17, 7.4.3.3"}
"""Name of each method for target displacements and its clause in the building code."""
_PUSHOVER_ASSUMPTIONS = (
    "The building is pushed slowly by forces of one pattern, without dashpots and damping; P-delta "
    "effects are included if the model has them.",
    "A target displacement is an estimate from one curve and an elastic spectrum; time history "
    "analyses may give other results.",
)


def modal_page(result: ModalResponse, page_text: PageText, units: OutputUnits = SI) -> bytes:
    """Return the report of a response spectrum analysis."""
    model, units = result.model, page_units(units)
    draw = partial(figures.mode_shapes.modal_response_picture, result, units)
    # The table has only the CQC values, which are also valid for close modes. The text states the
    # base shear by SRSS.
    table = Table.of_results(buildings.MODAL_RESPONSE, [result])
    table = table.chosen([name for name in table.columns if name == "story" or "_cqc" in name])
    target = spectrum_text(result.target.source)
    chapters = [
        page_text.result(Picture(draw, f"Peaks of the stories under {target}")),
        Chapter("Peaks of the stories", (table.in_units(units),)),
        Chapter(
            "Modes",
            (
                Table.of_results(buildings.MODAL_SHARE, [result]).in_units(units),
                Picture(
                    partial(_modes_on_target, result, units),
                    "Target spectrum with the modes, and effective modal masses",
                ),
            ),
        ),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_MODAL_ASSUMPTIONS, *MODEL_LIMITS),)),
    ]
    return page(
        model.name, f"Response spectrum analysis of {model.name}: {target}.", chapters, page_text
    )


def transfer_page(result: TransferFunction, page_text: PageText, units: OutputUnits = SI) -> bytes:
    """Return the report of the transfer functions of a building."""
    model, units = result.model, page_units(units)
    draw = partial(figures.mode_shapes.transfer_picture, result, units)
    chapters = [
        page_text.result(Picture(draw, "Amplitudes and phases over the frequency")),
        Chapter("Maximum of each floor", (transfer.resonance_table(result).in_units(units),)),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_TRANSFER_ASSUMPTIONS, *MODEL_LIMITS),)),
    ]
    return page(model.name, f"Transfer functions of {model.name}.", chapters, page_text)


_TRANSFER_ASSUMPTIONS = (
    "Harmonic steady-state response of the building with its initial stiffness: no story yields.",
    "Damping of the model, linear dashpots and braced dampers are included exactly, by the complex "
    "dynamic stiffness at each frequency.",
)


def _modes_on_target(result: ModalResponse, units: OutputUnits) -> Figure:
    """Return the figure of the target spectrum with marks at the modes of the building."""
    # Show the usual periods of a report, extended to include all modes. `result.period` is in
    # descending order.
    target = result.target
    shortest = min(SPECTRUM_PERIODS[0], 0.9 * float(result.period[-1]))
    longest = max(SPECTRUM_PERIODS[1], 1.3 * float(result.period[0]))
    shown = (target.periods >= shortest) & (target.periods <= longest)
    # Omitted modes have no spectral acceleration.
    values = np.where(result.spectral_acceleration > 0.0, result.spectral_acceleration, math.nan)
    curve = figures.mode_shapes.SpectrumAtModes(
        spectrum_text(target.source), target.periods[shown], target.psa[shown], values
    )
    return figures.mode_shapes.mode_spectrum_picture(result.period, result.mass_ratio, curve, units)


_MOST_MODES = 20
"""Maximum number of modes in a report; the table of the command lists all."""

_ENOUGH_MASS = 0.9
"""Fraction of the mass that the modes of an analysis must contain (EN 1998-1, 4.3.3.3.1)."""


def mode_page(
    model: Model,
    table: Table,
    draw: Callable[[], Figure],
    page_text: PageText,
    units: OutputUnits = SI,
    record: Record | None = None,
) -> bytes:
    """Return the report of the natural modes of a building.

    Parameters
    ----------
    table : Table
        Modes, longest period first (`mode_table`).
    record : Record, optional
        Ground motion of the model; its response spectrum shows the modes.
    """
    units = page_units(units)
    modes = {column.name: values for column, values in table.by_column()}
    # The modes of stories without initial stiffness are not in the figure.
    is_finite = np.isfinite(modes["period_s"])
    periods, mass_ratios = modes["period_s"][is_finite], modes["mass_ratio"][is_finite]
    # Damping ratios are in percent, as in the sentences of the report.
    meanings = {**table.meanings, "damping": {**table.meanings["damping"], "unit": "%"}}
    shown_table = table._replace(rows=table.rows[:_MOST_MODES], meanings=meanings)
    shown_table = shown_table.with_values("damping", lambda ratio: 100.0 * float(ratio or 0.0))
    omission = f"The first {_MOST_MODES} of {pluralize(len(table.rows), 'mode')}."
    curve, caption = None, "Effective modal masses"
    if record is not None and periods.size:
        curve = _spectrum_at_modes(record, periods)
        caption = f"Response spectrum of {curve.label}, 5 % damping, and effective modal masses"
    shapes = Picture(partial(figures.style.lowered, draw), "Shapes of the first modes")
    chapters = [
        Chapter("Modes", (list(page_text.sentences), shown_table)),
        Chapter("Further modes", (omission,) if len(table.rows) > _MOST_MODES else ()),
        Chapter(
            "Modes and spectrum",
            (
                Picture(
                    lambda: figures.mode_shapes.mode_spectrum_picture(
                        periods, mass_ratios, curve, units
                    ),
                    caption,
                ),
            )
            if periods.size
            else (),
        ),
        Chapter("Shapes", (shapes,)),
        model_chapter(model, units),
        *([motion_chapter([[(record, 1.0)]], units, drawn=True)] if record is not None else []),
        Chapter(
            "Assumptions",
            (
                (
                    "Undamped modes with the initial stiffness; damping ratios without the "
                    "coupling of modes.",
                    *simplifications(),
                ),
            ),
        ),
    ]
    verdict = _mode_verdict(model, modes["mass_ratio"], modes["cumulative_mass_ratio"])
    page_text = replace(page_text, verdict=[(None, verdict)])
    return page(model.name, f"Natural modes of {model.name}.", chapters, page_text)


def _spectrum_at_modes(record: Record, periods: Array) -> figures.mode_shapes.SpectrumAtModes:
    """Return the response spectrum of a record with 5 % damping, and its values at the modes.

    `periods` contains the periods of the modes, s; the spectrum continues to 1.3 times the maximum.
    """
    longest = max(SPECTRUM_PERIODS[1], 1.3 * float(periods.max(initial=0.0)))
    grid = np.geomspace(SPECTRUM_PERIODS[0], longest, int(SPECTRUM_PERIODS[2]))
    name = figures.style.motion_name(record)
    values = spectrum(record, grid).psa, spectrum(record, periods).psa
    return figures.mode_shapes.SpectrumAtModes(name, grid, *values)


def _mode_verdict(model: Model, mass_ratios: Array, cumulative_mass_ratios: Array) -> str:
    """Return the headline of a report of modes: first period, damping ratio and modal masses.

    `cumulative_mass_ratios` contains the sums of `mass_ratios` from the first mode to each mode.
    """
    building = assemble(model)
    period, damping = building.first_period, building.first_mode()[1]
    # For an array of Booleans, `argmax` returns the index of the first True: the first mode at
    # which the cumulative mass reaches the required fraction.
    count = int(np.argmax(cumulative_mass_ratios >= _ENOUGH_MASS)) + 1
    return (
        f"First period {number_text(period)} s with {number_text(100.0 * damping, 3)} % damping, "
        f"{number_text(100.0 * float(mass_ratios[0]))} % of the mass; {pluralize(count, 'mode')} "
        f"{'contains' if count == 1 else 'contain'} "
        f"{number_text(100.0 * float(cumulative_mass_ratios[count - 1]))} % of the mass."
    )


_MODAL_ASSUMPTIONS = (
    "The building is linear with its initial stiffness. The modal peaks of each response are "
    "combined by the square root of the sum of squares (SRSS) and by the complete quadratic "
    "combination (CQC).",
    "The same target spectrum applies to all modes, independently of the damping of the model.",
)
