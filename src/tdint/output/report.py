"""A page for a report: one HTML file with tables and pictures in it, which needs no network and prints on A4."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.analysis.spectra.elastic import spectrum
from tdint.analysis.spectra.target import read_target
from tdint.campaign.intensity import GEOMETRIC_MEAN
from tdint.campaign.motions import GivenFactors
from tdint.campaign.scaling import Scaling
from tdint.ground_motion.record import Record, component_names
from tdint.model.building import assemble
from tdint.model.definition import ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.output import figures
from tdint.output.summary import campaign_summary, versions
from tdint.output.tables.campaign import profile_error_table, profile_table
from tdint.output.tables.responses import story_table
from tdint.output.tables.spectra import motion_table
from tdint.output.tables.table import TEXT, Cell, Table, converted
from tdint.units import SI, OutputUnits, suffix
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.analysis.run.outcome import Response
    from tdint.analysis.spectra.floors import FloorSpectrum
    from tdint.campaign.plan import Plan
    from tdint.campaign.profiles import FloorSuite, Profile
    from tdint.campaign.store import Store

MOST_COLUMNS = 9
"""Of a table on a page of A4: numbers of four digits, at 8.5 points, do not break."""

_DIGEST = "SHA-256"
"""Name of the column of digests, which are long."""

_LARGE = 160_000
"""Bytes of a picture as SVG, from which it is put in as PNG: a long history has many points."""

_STYLE = """
@page { size: A4; margin: 15mm }
body { font: 10pt/1.4 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; color: #111; max-width: 180mm;
  margin: 8mm auto; padding: 0 4mm }
h1 { font-size: 16pt; margin: 0 0 2mm } h2 { font-size: 12pt; margin: 7mm 0 2mm; border-bottom: 1px solid #bbb }
table { border-collapse: collapse; font-size: 8.5pt; margin: 2mm 0; width: 100% }
th, td { border-bottom: 1px solid #ddd; padding: 0.6mm 1.2mm; text-align: right; vertical-align: top }
td { white-space: nowrap } td.t { white-space: normal } p.h { margin: 0 0 3mm }
td.d { font: 6.5pt monospace; text-align: left }
th { border-bottom-color: #888; font-weight: 600 } th.t, td.t { text-align: left; overflow-wrap: anywhere }
thead { display: table-header-group } tr, table, figure, p.w { break-inside: avoid } h2, p.k { break-after: avoid }
figure { margin: 3mm 0 } img { max-width: 100%; max-height: 245mm; display: block; margin: 0 auto }
figcaption { font-size: 8.5pt; color: #444 } p.w { border-left: 3px solid #b03a2e; padding-left: 3mm }
code { font-size: 8pt; overflow-wrap: anywhere } ul { margin: 1mm 0; padding-left: 5mm }
@media print { body { margin: 0; padding: 0; max-width: none } img { max-height: 160mm } }
"""

LEFT_OUT = (
    "Each floor is one mass that moves sideways in one direction; there is no torsion, no floor flexibility, no "
    "overturning and no axial force in columns, no soil.",
    "Each story is one spring from floor to floor: what columns, beams and joints do apart is in its law or not at "
    "all, and two directions of a motion act one at a time.",
    "Story laws do not know of one another; strength does not depend on axial force.",
)
"""What a shear building leaves out."""


@dataclass(frozen=True)
class Picture:
    """A picture and what stands below it."""

    draw: Callable[[], Figure]
    caption: str


Part = str | Table | Picture | Sequence[str]
"""A paragraph, a table, a picture, or a list of points."""


@dataclass(frozen=True)
class Chapter:
    """A heading and what stands below it."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Told:
    """What a page says beside the numbers that it is made of.

    Attributes
    ----------
    said : sequence of str
        The result in a few sentences.
    warnings : sequence of str
        What changes the meaning of a number.
    head : sequence of (str, str)
        Names and texts of the lines at its top: project, author, date.
    inputs : sequence of mapping
        The files that were read, with their SHA-256.
    """

    said: Sequence[str] = ()
    warnings: Sequence[str] = ()
    head: Sequence[tuple[str, str]] = ()
    inputs: Sequence[Mapping[str, Any]] = ()


def page(title: str, about: str, chapters: Iterable[Chapter], told: Told) -> bytes:
    """The page, UTF-8: title, head, a sentence about it, warnings, chapters; and the versions that made it."""
    # Sixteen digits of a plug-in's digest tell its versions apart.
    of_all = versions()
    code = {f"plug-in {name}": digest[:16] for name, digest in of_all.pop("plugins", {}).items()}
    made = ", ".join(f"{name} {number}" for name, number in (of_all | code).items() if number)
    body = [f"<h1>{escape(title)}</h1>"]
    if told.head:
        lines = (f"<strong>{escape(name)}:</strong> {escape(text)}" for name, text in told.head)
        body.append(f'<p class="h">{"<br>".join(lines)}</p>')
    body.append(f"<p>{escape(about)}</p>")
    body += [f'<p class="w"><strong>Warning:</strong> {_said(text)}</p>' for text in _once(told.warnings)]
    for chapter in chapters:
        # What there is nothing to say of has no heading.
        if any(_has(part) for part in chapter.parts):
            body += [f"<h2>{escape(chapter.title)}</h2>", *(_part(part) for part in chapter.parts if _has(part))]
    body.append(f"<h2>Versions</h2><p>{escape(made)}</p>")
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n" + "\n".join(body)
    )
    return (text + "\n</body>\n</html>\n").encode("utf-8", "replace")


def _has(part: Part) -> bool:
    return bool(part.rows) if isinstance(part, Table) else bool(part)


def _part(part: Part) -> str:
    if isinstance(part, str):
        kept = ' class="k"' if part.endswith(":") else ""
        return f"<p{kept}>{_said(part)}</p>"
    if isinstance(part, Table):
        return _table(part)
    if not isinstance(part, Picture):
        return "<ul>" + "".join(f"<li>{_said(point)}</li>" for point in part) + "</ul>"
    # Lines of thousands of points make a drawing larger than its pixels.
    kind, content = "svg+xml", _drawn(part, ".svg")
    if len(content) > _LARGE:
        kind, content = "png", _drawn(part, ".png")
    data, caption = base64.b64encode(content).decode("ascii"), escape(part.caption)
    image = f'<img alt="{caption}" src="data:image/{kind};base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def _said(text: str) -> str:
    """Text of files' names and headers, lines kept."""
    return "<br>".join(escape(line) for line in text.splitlines())


def _once(texts: Iterable[str]) -> list[str]:
    """Texts, each once: what is said of several files (`FILE: text`) with their names before it."""
    files: dict[str, dict[str, None]] = {}  # sets in the order of arrival
    for text in texts:
        file, colon, rest = text.partition(": ")
        files.setdefault(rest if colon else text, {})[file if colon else ""] = None
    return [f"{'; '.join(names)}: {text}" if any(names) else text for text, names in files.items()]


def _drawn(picture: Picture, end: str) -> bytes:
    stream = io.BytesIO()
    figures.style.picture(end, picture.draw)(stream)
    return stream.getvalue()


def _table(table: Table) -> str:
    """A table with its units in the heading and drift ratios in percent, columns without any value left out; one that
    is wider than a page goes on below with its first column again."""
    ratios = [name for name in table.columns if "drift_ratio" in name]
    factors = [0.01 if name in ratios else 1.0 for name in table.columns]
    cells = [[_shown(cell) for cell in map(converted, row, factors)] for row in table.rows]
    # A heading is the name of its column in words, the unit in brackets; words and digests stand on the left.
    heads, sides = [], []
    for name in table.columns:
        unit = "%" if name in ratios else table.meanings.get(name, {}).get("unit", TEXT)
        error = " error" * name.endswith("_error")
        bare = name.removesuffix("_error").removesuffix(suffix(unit)).replace("_", " ")
        heads.append(escape(f"{bare}{error}" + ("" if unit in (TEXT, "1") else f" ({unit.replace('^2', '²')})")))
        sides.append(' class="d"' if name == _DIGEST else ' class="t"' if unit == TEXT else "")
    kept = [i for i in range(len(heads)) if any(row[i] for row in cells)]
    # The first column says which row it is, on each width.
    widths = [kept[:MOST_COLUMNS]]
    for first in range(MOST_COLUMNS, len(kept), MOST_COLUMNS - 1):
        widths.append([kept[0], *kept[first : first + MOST_COLUMNS - 1]])
    tables = []
    for columns in widths:
        head = "".join(f"<th{sides[i]}>{heads[i]}</th>" for i in columns)
        rows = ("".join(f"<td{sides[i]}>{escape(row[i])}</td>" for i in columns) for row in cells)
        lines = "\n".join(f"<tr>{row}</tr>" for row in rows)
        tables.append(f"<table><thead><tr>{head}</tr></thead><tbody>\n{lines}\n</tbody></table>")
    return "\n".join(tables)


def _shown(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def model_chapter(model: Model, period: float, damping: float, units: OutputUnits = SI) -> Chapter:
    """The building: its stories from the ground up, period (s) and damping ratio of its first mode, P-delta."""
    from tdint.output.tables.buildings import model_table

    p_delta = "with P-delta" if model.p_delta else "without P-delta"
    facts = (
        f"{how_many(len(model.stories), 'story')}, first period {period:.4g} s with {100.0 * damping:.3g} % damping, "
        f"{p_delta}, {damping_words(model)}. A drift ratio over {100.0 * model.collapse_drift:g} % counts as collapse."
    )
    return Chapter(f"Building: {model.name}", (facts, model_table(model, units)))


def damping_words(model: Model) -> str:
    """The damping besides dashpots, in a few words."""
    left_out = "" if all(story.rayleigh for story in model.stories) else ", less what it would be in isolators"
    match model.damping:
        case RayleighRatio(ratios, modes):
            pairs = dict.fromkeys(zip(ratios, modes, strict=True))
            told = " and ".join(f"{100.0 * ratio:g} % in mode {mode}" for ratio, mode in pairs)
            return f"Rayleigh damping of {told}{left_out}"
        case RayleighCoefficients(mass, stiffness):
            return f"Rayleigh damping of {mass:.4g} 1/s times mass and {stiffness:.4g} s times stiffness{left_out}"
        case ModalDamping(ratios):
            return f"modal damping of {', '.join(f'{100.0 * ratio:g}' for ratio in ratios)} %"
    return "no damping besides dashpots"


def _inputs(inputs: Iterable[Mapping[str, Any]], more: Sequence[tuple[str, str]] = ()) -> Chapter:
    """Files with their SHA-256, each once, and what else has one."""
    rows = dict.fromkeys([*((given["file"], given["sha256"]) for given in inputs), *more])
    return Chapter("Inputs", (Table(("file", _DIGEST), list(rows)),))


# ---- The pages of a run and of a suite: which chapters they have

_MOST_MOTIONS = 60
"""Motions whose spectra are drawn."""

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
_OF_SUITE = ("residual_drift", "peak_total_shear", "peak_absolute_acceleration", "peak_damper_force")
_ERRORS = "Estimated errors of the time integration, in percent; of residual drifts in percent of the peak drifts:"


def run_page(response: Response, told: Told, *, floors: Sequence[FloorSpectrum] = (), units: OutputUnits = SI) -> bytes:
    """The page of a run.

    Parameters
    ----------
    response : Response
        With its history, for the picture.
    floors : sequence of FloorSpectrum
        The spectra of its floors that were asked for.
    """
    model, check = response.model, response.check
    whole = story_table(response.stories, check.errors if check else None).in_units(units)
    # A building with dampers has their forces in place of the restoring ones, a page has no room for both.
    damped = any(response.stories.peak_damper_force)
    places = {_quantity(whole, name): name for name in whole.columns}
    names = [places[name] for name in _OF_STORIES if name in places and not (damped and name == "peak_shear")]
    omega, damping = assemble(model).first_mode()
    drawn = [Picture(lambda: figures.runs.run_picture(response, units), "Histories, energies, profiles, hysteresis")]
    spectra = Picture(lambda: figures.runs.floor_picture(floors, units, title=model.name), "Spectra of floors")
    chapters = [
        Chapter("Result", (list(told.said), *(drawn if response.history is not None else ()))),
        Chapter("Peaks of the stories", (whole.chosen(["story", *names]), *_errors_of_run(response, whole, names))),
        Chapter("Spectra of floors", (spectra,) if floors else ()),
        model_chapter(model, 2.0 * math.pi / omega, damping, units),
        _motions([[(response.record, 1.0)]] if response.record else [], units),
        _assumptions(f"{response.method}, {how_many(response.steps, 'step')} of {response.dt:.6g} s", ()),
        Chapter("Notes", (_once(response.notes),)),
        _inputs(told.inputs),
    ]
    return page(model.name, f"Response in time of {model.name}: status {response.status}.", chapters, told)


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
        columns.append([_percent(error, size) for error, size in zip(cells[f"{name}_error"], over, strict=True)])
    labels = [_quantity(whole, name) for name in shown]
    meanings = {label: {"meaning": "", "unit": "%"} for label in labels} | {"story": whole.meanings["story"]}
    return _ERRORS, Table(("story", *labels), list(zip(*columns, strict=True)), meanings)


def _percent(error: Cell, size: Cell) -> float | None:
    """An error in percent of what it is one of, two digits; none where that is nothing."""
    if not isinstance(error, float) or not isinstance(size, float) or math.isnan(error) or size == 0.0:
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
    content = campaign_summary(store)
    runs = content["runs"]
    about = ", ".join(f"{count} {status}" for status, count in runs["by_status"].items())
    limits = "" if limit is None else f", limit {100.0 * limit:g} %"
    profile = Picture(
        lambda: figures.runs.profile_picture(profiles, units, limit=limit, title=plan.name),
        f"Drifts, floor accelerations, total shears: motions, mean, largest{limits}",
    )
    spectra = Picture(lambda: figures.runs.floor_suite_picture(floors, units), "Spectra of floors: mean, envelope")
    # Of many buildings the first ones: a page is read, not searched.
    models = [item.subject() for item in {item.name: item for item in plan.buildings[:_MOST_MODELS]}.values()]
    methods = ", ".join(dict.fromkeys(item.method for item in models))
    step_given = plan.settings.dt
    step = f"{methods}, steps of {step_given:g} s" if step_given else f"{methods}, steps of the models or the records"
    rest = ("runs go on with the ground at rest until the building is",) if plan.settings.until_rest else ()
    # What scaling and records leave doubtful stands at the top, as a warning.
    scaled, doubts = _scaling(plan, units)
    chapters = [
        Chapter("Result", (list(told.said), *((profile,) if profiles else ()))),
        Chapter("Over the baseline", (_compared(ratios),) if ratios else ()),
        *(_over_motions(item, units) for item in profiles),
        Chapter("Damage", _damage(store)),
        Chapter("Spectra of floors", (spectra,) if floors else ()),
        *(model_chapter(item.model, item.period, assemble(item.model).first_mode()[1], units) for item in models),
        _motions(_as_run(plan, store), units, scaled),
        _assumptions(step, [*rest, _SUITE]),
        Chapter("Notes", (_once(plan.notes),)),
        _inputs(told.inputs or content["inputs"], [("the whole campaign, its fingerprint", content["fingerprint"])]),
    ]
    of_records = [f"{item.record.source}: {text}" for item in plan.motions for text in item.record.warnings]
    told = replace(told, warnings=[*told.warnings, *doubts, *of_records])
    return page(plan.name, f"{runs['done']} of {how_many(runs['all'], 'run')}: {about}.", chapters, told)


def _over_motions(profile: Profile, units: OutputUnits) -> Chapter:
    """Means and largest values of a building, and where they were estimated their errors."""
    has_heights = not np.isnan(profile.height).any()
    parts: list[Part] = [
        profile_table(profile, ("peak_drift_ratio" if has_heights else "peak_drift", *_OF_SUITE), units)
    ]
    if profile.peak_errors:
        parts += [_ERRORS, profile_error_table(profile, ("peak_drift", *_OF_SUITE))]
    building = ", ".join(filter(None, [profile.building, profile.level_text]))
    return Chapter(f"Over the motions: {building}", parts)


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
    """The motions with the factors on them, level by level from the smallest; what several buildings share once."""
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
    """What the factors of a campaign were found for, with a picture where that is a spectrum, and what a reviewer would
    ask about them; as `tdint scale` told it beside them."""
    if not plan.factors:
        return (), []
    if not plan.scaled:
        return (f"Factors: {plan.factors}; no file of `tdint scale` beside it says how they came about.",), []
    # In the words of the command: target or measure, rule, range, damping, pairs.
    settings = plan.scaled["settings"]
    aim = settings["target"] or " ".join(
        f"{settings['measure']} = {settings['value']:.4g} {settings['unit']}".split() if settings["measure"] else ()
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
        words.append(f"the average is {100.0 * settings['least_average_over_target']:.3g} % of the target at the least")
    parts: list[Part] = ["; ".join(words) + "."]
    if settings["target"] and isinstance(plan.levels, GivenFactors):
        wholes = {id(motion.whole): (motion.whole, plan.levels.by_motion[i]) for i, motion in enumerate(plan.motions)}
        # Several factors for a motion are several suites, which one picture does not show.
        if all(len(factors) == 1 for _, factors in wholes.values()):
            scaling = Scaling(
                tuple(whole for whole, _ in wholes.values()),
                np.array([factors[0] for _, factors in wholes.values()]),
                settings["rule"],
                settings["pairs"] or GEOMETRIC_MEAN,
                settings["damping"],
                target=read_target(settings["target"]),
                periods=np.geomspace(*settings["periods_s"]),
            )
            parts.append(
                Picture(partial(figures.collapse.suite_picture, scaling, units), "The scaled motions and the target")
            )
    return tuple(parts), [f"{plan.factors}: {text}" for text in plan.scaled.get("warnings", ())]


def _motions(
    levels: Sequence[Sequence[tuple[Record, float]]], units: OutputUnits, scaled: Sequence[Part] = ()
) -> Chapter:
    """The ground motions as they were run, and their spectra, level by level, unless a picture of their scaling has
    these."""
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
            draw = partial(figures.spectrum_curves.spectrum_picture, spectra, "periods", units)
            parts.append(Picture(draw, f"Response spectra, 5 % damping{said}"))
    return Chapter("Ground motions", parts)


_SUITE = (
    "of pairs of horizontal components the larger value counts; means are over the motions under which the building "
    "stood"
)


def _assumptions(step: str, more: Sequence[str]) -> Chapter:
    points = (
        f"Time integration: {step}.",
        *(f"{text[0].upper()}{text[1:]}." for text in more),
        "A shear building: " + LEFT_OUT[0][0].lower() + LEFT_OUT[0][1:],
        *LEFT_OUT[1:],
        "Drifts and displacements are relative to the floor below and to the ground; accelerations are absolute.",
    )
    return Chapter("Assumptions", (points,))
