"""HTML reports of --report for incremental dynamic analyses and fragility functions."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.errors import AnalysisError, TdintError
from tdint.model.config.model_file import load_model
from tdint.number_parsing import number_text, pluralize
from tdint.output.page import Chapter, PageText, Part, Picture, page, page_units
from tdint.output.report import (
    first_period,
    method_text,
    model_chapter,
    motion_chapter,
    simplifications,
)
from tdint.output.tables.table import TEXT, Cell, Table
from tdint.studies import figures as studies_figures
from tdint.studies.figures.collapse import measure_words
from tdint.studies.fragility.fits import fit_capacities
from tdint.studies.fragility.fragility_function import CLOUD, IDA, STRIPES, Fragility
from tdint.studies.ida_curve import IdaCurve, PairCurve, fractiles
from tdint.studies.output.study_summary import study_summary
from tdint.studies.pairs import SEPARATE, describe_demand, motions_text
from tdint.studies.tables.studies import motion_rows
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.studies.ida import IdaSettings, IdaStudy

_FRACTILES = (0.16, 0.5, 0.84)
"""Fractions of the fractiles in the table of capacities."""

_TWO_SIDED = 1.96  # standard errors of a two-sided 95 % interval of a normal distribution

_MOST_CAPACITIES = 60
"""Maximum number of motions in the table of capacities; capacities.csv lists all."""

_MOST_THRESHOLDS = 4
"""Maximum number of drift ratios in the table of capacities, so that the table fits the page."""

_SOURCES = {
    IDA: "capacities: mean and standard deviation of the logarithms of the capacities, maximum "
    "likelihood with censored capacities (Baker 2015, Earthquake Spectra 31, 579-599)",
    STRIPES: "stripes: maximum likelihood of the numbers of exceedances at each intensity level "
    "(Baker 2015, Earthquake Spectra 31, 579-599)",
    CLOUD: "cloud: linear regression of ln demand on ln intensity with constant scatter, maximum "
    "likelihood with censored demands (Jalayer and Cornell 2009, Earthquake Engineering and "
    "Structural Dynamics 38, 951-972)",
}
"""Descriptions of the fits with their publications."""

_NAMES = {IDA: "capacities"}
"""Names of fits in sentences, if they differ from the key."""

_LOGNORMAL = (
    "A fragility function is the probability of exceedance over the intensity: the lognormal "
    "distribution function with the median theta and the standard deviation beta of the logarithm."
)
_RANK_AND_FIT = (
    "Theta follows from all capacities (their geometric mean, if none is censored), so that it "
    "differs from the median by rank."
)
_INTERVALS = (
    "Intervals contain 95 %: theta times exp(-1.96 e) to exp(1.96 e) with the standard error e of "
    "ln theta, and beta plus or minus 1.96 standard errors. Standard errors are computed by "
    "omitting ground motions in turn (jackknife) if the table states the ground motions of several "
    "runs; otherwise they follow from the information matrix."
)


# ---- Incremental dynamic analysis


def ida_page(
    study: IdaStudy,
    settings: IdaSettings,
    page_text: PageText,
    units: OutputUnits,
    *,
    damping: float,
) -> bytes:
    """Return the report of an incremental dynamic analysis.

    Parameters
    ----------
    study : IdaStudy
        Curves of the building, in the units of the report (`IdaStudy.in_units`).
    """
    units = page_units(units)
    measure, unit = measure_words(study.im_name), study.measure.unit
    runs = sum(len(curve.runs) for curve in study.curves)
    functions, failures = _fits(study)
    states = study.states
    motions = _motion_count(study)
    fits: list[Part] = []
    if functions:
        fits = [
            f"{_LOGNORMAL} {_RANK_AND_FIT}",
            fit_table_of(functions, damaged=len(states) > 1),
            *failures,
        ]
    capacities, remark = _capacities(study)
    chapters = [
        Chapter(
            "Result",
            (
                [_curves_text(study)],
                Picture(
                    lambda: studies_figures.collapse.ida_picture(study),
                    f"Maximum drift ratio over {measure}: curves, fractiles, capacities",
                ),
            ),
        ),
        Chapter("Fractiles of the capacities over the ground motions", (_fractile_table(study),)),
        Chapter("Fitted fragility functions", fits),
        Chapter(f"Capacities of the ground motions, {measure} ({unit})", (capacities, remark)),
        model_chapter(study.model, units),
        motion_chapter(
            [[(curve.record, 1.0) for curve in states[0].curves]],
            units,
            periods=[(study.model.name, first_period(study.model))],
        ),
        Chapter("Methods and assumptions", (_ida_points(study, settings, damping),)),
    ]
    about = (
        f"Incremental dynamic analysis of {study.model.name}: {motions}, {pluralize(runs, 'run')}."
    )
    verdict = [(None, text) for text in _medians(study)]
    return page(study.model.name, about, chapters, replace(page_text, verdict=verdict))


def _motion_count(study: IdaStudy) -> str:
    """Return the number of ground motions of a study as text; a pair counts as a single motion
    unless its components count separately."""
    paired = 0 if study.pair_demand == SEPARATE else len(study.states[0].partners)
    return motions_text(len(study.states[0].curves), paired)


def _curves_text(study: IdaStudy) -> str:
    """Return a sentence with the number of ground motions that cause collapse.

    A building may survive a level above its first collapse (resurrection). The sentence also states
    the number of ground motions with a resurrection, if there are any.
    """
    collapses = sum(not curve.collapse.censored for curve in study.motion_curves)
    text = (
        f"The building collapses under {collapses} of "
        f"{pluralize(len(study.motion_curves), 'motion')} (a drift ratio above "
        f"{100.0 * study.model.collapse_drift:g} %, or loss of resistance)"
    )
    resurrections = sum(curve.resurrection for curve in study.motion_curves)
    if resurrections:
        text += f"; under {resurrections}, it does not collapse at a level above its first collapse"
    return f"{text}."


def _medians(study: IdaStudy) -> list[str]:
    """Return sentences on the median capacity against collapse, one for each damage that the
    building had before the ground motions."""
    texts, unit = [], study.measure.unit
    for state in study.states:
        curves = state.motion_curves
        # Fractiles above the maximum intensity are NaN.
        low, median, high = fractiles(curves, np.array([study.model.collapse_drift]))[:, 0].tolist()
        damage = curves[0].damage
        name = f", damaged to {100.0 * damage:g} %" if damage else ""
        text = f"Median capacity against collapse{name}: "
        if math.isfinite(median):
            text += f"{measure_words(study.im_name)} = {number_text(median)} {unit}"
        else:
            text += "above the largest intensity"
        if len(curves) > 1 and math.isfinite(low) and math.isfinite(high):
            text += f"; 16 % and 84 % fractiles {number_text(low)} and {number_text(high)} {unit}"
        texts.append(f"{text}.")
    return texts


def _fractile_table(study: IdaStudy) -> Table:
    """Return the table of the fractiles of the capacities over the ground motions, with one row for
    each drift ratio and each damage of the building before the ground motions."""
    # The state of damage is a column only if the study has several.
    unit, has_states = study.measure.unit, len(study.states) > 1
    intensities = ("fractile_16", "median", "fractile_84")
    columns = ("drift_ratio", *intensities, "motions", "censored")
    rows: list[tuple[Cell, ...]] = []
    for state in study.states:
        curves = state.motion_curves
        values = fractiles(curves, np.array(study.thresholds), _FRACTILES).T.tolist()
        for threshold, row in zip(study.thresholds, values, strict=True):
            censored = sum(curve.capacity(threshold).censored for curve in curves)
            cells: tuple[Cell, ...] = (threshold, *row, len(curves), censored)
            rows.append((_state(curves[0].damage), *cells) if has_states else cells)
    meanings = {
        name: {"meaning": "", "unit": unit if name in intensities else "1"} for name in columns
    }
    return Table(("state", *columns) if has_states else columns, rows, meanings)


def _state(damage: float) -> str:
    """Return the text for the state of a building before a ground motion, such as `damaged to 2 %`.

    `damage` is the drift ratio of the damage by a main shock; 0 results in `intact`.
    """
    return f"damaged to {100.0 * damage:g} %" if damage else "intact"


def _capacities(study: IdaStudy) -> tuple[Table, str]:
    """Return the table of the capacities of each ground motion, and a remark for the report.

    The table has columns for the largest drift ratios of the study. The remark states if capacities
    are censored or if rows are omitted; it is empty otherwise.
    """
    has_states, unit = len(study.states) > 1, study.measure.unit
    # The last threshold is the collapse drift.
    thresholds = study.thresholds[-_MOST_THRESHOLDS:]
    names = [f"at_{100.0 * threshold:g}_%" for threshold in thresholds[:-1]] + ["collapse"]
    columns = ("record", "component", *names, "collapse_factor", "status")
    rows: list[tuple[Cell, ...]] = []
    for source, component, curve in motion_rows(study):
        capacities = [curve.capacity(threshold) for threshold in thresholds]
        status = "censored" if capacities[-1].censored else "collapsed"
        values = [capacity.capacity for capacity in capacities]
        cells: tuple[Cell, ...] = (source, component, *values, _factor(curve, values[-1]), status)
        rows.append((_state(curve.damage), *cells) if has_states else cells)
    meanings = {name: {"meaning": "", "unit": unit} for name in names}
    meanings["collapse_factor"] = {"meaning": "", "unit": "1"}
    if has_states:
        columns = ("state", *columns)
    table = Table(columns, rows[:_MOST_CAPACITIES], meanings)
    remarks = []
    if any(row[-1] == "censored" for row in rows):
        remarks.append("A censored capacity is the largest level that was run.")
    if len(rows) > _MOST_CAPACITIES:
        remarks.append(f"The first {_MOST_CAPACITIES} of {len(rows)}; capacities.csv lists all.")
    return table, " ".join(remarks)


def _factor(curve: IdaCurve, capacity: float) -> float:
    """Return the scale factor of the record of a curve at an intensity.

    The factor is on a straight line through the lowest and the highest level on logarithmic axes,
    because intensity measures are powers of the factor.

    Returns
    -------
    float
        Scale factor; nan if the capacity or all factors are not finite.
    """
    # Both components of a pair have the same factors.
    runs = curve.parts[0].runs if isinstance(curve, PairCurve) and curve.parts else curve.runs
    points = sorted({(run.im, run.scale) for run in runs if math.isfinite(run.scale)})
    if not points or not math.isfinite(capacity):
        return math.nan
    im, scale = np.log(np.array(points)).T
    if im.size == 1:
        return float(np.exp(scale[0]))
    slope = (scale[-1] - scale[0]) / (im[-1] - im[0])
    return float(np.exp(scale[0] + slope * (math.log(capacity) - im[0])))


def _fits(study: IdaStudy) -> tuple[list[Fragility], list[str]]:
    """Fit fragility functions to the capacities of a study.

    Returns
    -------
    list of Fragility
        Function of each drift threshold and each damage of the building before the ground motions.
    """
    functions, failures = [], []
    for state in study.states:
        curves = state.motion_curves
        for threshold in study.thresholds:
            capacities = [curve.capacity(threshold) for curve in curves]
            # Capacities that are not positive and finite are unknown and omitted from the fit.
            known = [item for item in capacities if 0.0 < item.capacity < math.inf]
            try:
                fitted = fit_capacities(
                    [item.capacity for item in known], [item.censored for item in known]
                )
            except AnalysisError as error:
                failures.append(f"Drift ratio {100.0 * threshold:g} %: {error}.")
                continue
            named = fitted.named(threshold, study.im_name, study.measure.unit)
            functions.append(replace(named, damage=curves[0].damage, is_drift_ratio=True))
    return functions, failures


def _ida_points(study: IdaStudy, settings: IdaSettings, damping: float) -> list[str]:
    """Return the sentences of the report on the methods and assumptions of a study.

    `damping` is the damping ratio of the intensity measure, which is stated for spectral measures
    only.
    """
    step = (
        f"time step {settings.dt:g} s" if settings.dt else "time steps of the model or the records"
    )
    damping_text = ""
    # An intensity measure in units of acceleration is taken as a spectral acceleration.
    if study.measure.unit in ("m/s^2", "g", "cm/s^2", "in/s^2", "ft/s^2"):
        damping_text = f", {100.0 * damping:g} % damping"
    points = [
        "Levels (Vamvatsikos and Cornell 2002, Earthquake Engineering and Structural Dynamics 31, "
        "491-514): each record is scaled up until the building collapses, the collapse capacity is "
        f"bracketed within {100.0 * settings.precision:g} %, and the curve is filled between the "
        "levels.",
        f"Intensity measure: {measure_words(study.im_name)}{damping_text}; each ground motion is "
        "scaled by one factor.",
        f"Time integration: {method_text(study.method)}, {step}; a run without a result is "
        "repeated with half the time step, up to three times.",
        "Fractiles are computed by rank over the ground motions for each drift ratio.",
        f"Fit of {_SOURCES[IDA]}.",
        _INTERVALS,
    ]
    if study.partners:
        points.append(
            f"Pairs of horizontal components: {describe_demand(study.pair_demand)} (pair_demand: "
            f"{study.pair_demand})."
        )
    if not settings.check:
        points.append(
            "The error of the time integration was not estimated (--check); the energy balance of "
            "each run was checked."
        )
    if any(curve.damage for curve in study.curves):
        points.append(
            "The building is damaged by a main shock and at rest before each motion; drifts are "
            "relative to the undeformed position."
        )
    return [*points, *simplifications()]


# ---- Fragility functions


def fit_table_of(functions: Sequence[Fragility], *, damaged: bool = False) -> Table:
    """Return the fitted parameters of fragility functions with their 95 % intervals.

    Parameters
    ----------
    functions : sequence of Fragility
        Functions; their thresholds are drift ratios or other demands.
    damaged : bool
        True to list the state of the building before the motion.
    """
    unit = functions[0].unit or "1"
    # In `columns` and `rows`, a tuple times a flag is the tuple if the flag is True, and an empty
    # tuple (no column, no cell) if it is False.
    has_total_beta = any(function.modeling_dispersion for function in functions)
    has_types = any(function.type for function in functions)
    # The number of runs is a column only if ground motions have several runs.
    has_several_runs = any(
        function.motions and function.runs != function.motions for function in functions
    )
    parameters = ("theta", "theta_low", "theta_high", "beta", "beta_low", "beta_high")
    columns = (
        *(("type", "damage_state") * has_types),
        *(("state",) * damaged),
        "threshold",
        *parameters,
        *(("total_beta",) * has_total_beta),
        "motions",
        *(("runs",) * has_several_runs),
        "censored",
    )
    rows: list[tuple[Cell, ...]] = []
    for function in functions:
        factor = math.exp(_TWO_SIDED * function.theta_error)
        half_width = _TWO_SIDED * function.beta_error
        rows.append(
            (
                *((function.type, function.state) * has_types),
                *((_state(function.damage),) * damaged),
                function.threshold_text,
                function.theta,
                function.theta / factor,
                function.theta * factor,
                function.beta,
                max(function.beta - half_width, 0.0),
                function.beta + half_width,
                *((function.beta_total,) * has_total_beta),
                function.motions or function.runs,
                *((function.runs,) * has_several_runs),
                function.censored,
            )
        )
    meanings = {name: {"meaning": "", "unit": unit} for name in parameters[:3]}
    dimensionless = (*parameters[3:], "total_beta", "motions", "runs", "censored")
    meanings |= {name: {"meaning": "", "unit": "1"} for name in dimensionless}
    return Table(columns, rows, meanings)


def fragility_page(
    functions: Sequence[Fragility],
    draw: Callable[[Sequence[Fragility]], Figure],
    source: str,
    page_text: PageText,
) -> bytes:
    """Return the report of fragility functions.

    Parameters
    ----------
    functions : sequence of Fragility
        Functions of a single fit; at least one.
    source : str
        Table or directory with the observations.
    page_text : PageText
        Warnings, notes (`sentences`), inputs and head of the report.
    """
    study = study_summary(Path(source))
    # The thresholds of a study are drift ratios; a table from elsewhere can have any demand.
    functions = [replace(function, is_drift_ratio=bool(study)) for function in functions]
    stated_measure = measure_words(functions[0].im)
    measure = stated_measure or "intensity measure"
    fits = list(dict.fromkeys(function.fit for function in functions))
    pairs = functions[0].pair_demand
    counted = f" Pairs: {describe_demand(pairs)} (pair_demand: {pairs})." if pairs else ""
    # The headline states the functions, unless there are too many for a headline.
    verdict: list[tuple[bool | None, str]] = []
    if len(functions) <= _MOST_THRESHOLDS:
        verdict = [(None, _median_text(function)) for function in functions]
    fitted = fit_table_of(functions, damaged=_damaged(functions))
    chapters = [
        Chapter(
            "Result",
            (
                list(page_text.sentences),
                Picture(partial(draw, functions), f"Probability of exceedance over {measure}"),
            ),
        ),
        Chapter("Fitted parameters", (_LOGNORMAL, fitted)),
        Chapter("Fractions of exceedances and fitted function", _count_table(functions)),
        Chapter("Observations", (*_observations(functions), *_study_parts(source, study))),
        Chapter(
            "Methods and assumptions",
            (
                [
                    *(f"Fit of {_SOURCES[fit]}." for fit in fits),
                    _INTERVALS,
                    f"Intensity measure: {stated_measure or f'not stated in {source}'}.{counted}",
                    *_dispersion(functions),
                    *(simplifications() if study else ()),
                ],
            ),
        ),
    ]
    about = f"Fragility functions fitted to {source}: {pluralize(len(functions), 'function')}."
    return page("Fragility functions", about, chapters, replace(page_text, verdict=verdict))


def _damaged(functions: Sequence[Fragility]) -> bool:
    """Return True if the fragility functions are for several initial damages of the building.

    The damage of functions without initial damage is nan.
    """
    return len({function.damage for function in functions if function.damage >= 0.0}) > 1


def _median_text(function: Fragility) -> str:
    """Return a sentence on the median and the dispersion of a fragility function, with the 95 %
    interval of the median if its standard error is known."""
    parts = [f"{function.type}, {function.state}"] if function.type else []
    if math.isfinite(function.threshold):
        demand = "drift ratio" if function.is_drift_ratio else "threshold"
        parts.append(f"{demand} {function.threshold_text}")
    if function.damage >= 0.0:
        parts.append(_state(function.damage))
    name = f"{', '.join(parts)}: " if parts else ""
    unit = f" {function.unit}" if function.unit else ""
    text = f"{name}median {measure_words(function.im) or 'intensity'} "
    text += f"{number_text(function.theta)}{unit}"
    if math.isfinite(function.theta_error):
        factor = math.exp(_TWO_SIDED * function.theta_error)
        ends = (number_text(function.theta / factor), number_text(function.theta * factor))
        text += f" (95 %: {ends[0]} to {ends[1]}{unit})"
    elif function.extrapolated:
        text += " (extrapolated)"
    text = f"{text}, beta {number_text(function.beta, 3)}."
    return f"{text[0].upper()}{text[1:]}"


def _dispersion(functions: Sequence[Fragility]) -> list[str]:
    """Return a statement on the dispersion due to the uncertainty of the model."""
    modeling = functions[0].modeling_dispersion
    if not modeling:
        return [
            "beta is the record-to-record dispersion; the uncertainty of the model is not included."
        ]
    return [
        f"total beta includes a modeling dispersion of {number_text(modeling, 3)}: the root of the "
        "sum of squares."
    ]


def _count_table(functions: Sequence[Fragility]) -> tuple[Part, ...]:
    """Return a sentence and a table that compares each fragility function with the runs in bins of
    the intensity.

    For each bin, the column `counted` is the fraction of the runs that exceed the limit, and the
    column `fitted` is the value of the function. Without counted runs, the result is empty.
    """
    rows: list[tuple[Cell, ...]] = []
    for function in functions:
        if counted := function.counted:
            for i in range(len(counted.im)):
                values = (counted.im[i], counted.runs[i], counted.fraction[i], counted.fitted[i])
                rows.append((function.exceeded, *map(float, values)))
    columns = ("function", "intensity", "runs", "counted", "fitted")
    unit = functions[0].unit or "1"
    meanings = {name: {"meaning": "", "unit": "1"} for name in columns[2:]}
    meanings |= {"intensity": {"meaning": "", "unit": unit}, "function": {"unit": TEXT}}
    if not rows:
        return ()
    text = (
        "Fractions of the runs in ranges of the intensity that exceed the limit, and the values of "
        "the function at the geometric mean of the intensities of these runs:"
    )
    return text, Table(columns, rows[:_MOST_CAPACITIES], meanings)


_MOST_RECORDS = 60
"""Maximum number of records in the table of a study."""


def _study_parts(source: str, content: dict[str, Any]) -> tuple[Part, ...]:
    """Return the part of the report on the study that the observations are from: building, method,
    errors and records.

    `content` is the JSON summary of the study; empty for a table that tdint has not written.
    """
    if not content:
        return (
            [
                f"{source} is not a table of a study of tdint: building, ground motions, scale "
                "factors, method of the analyses and their errors are not known to this report."
            ],
        )
    settings = content.get("settings", {})
    facts = []
    if isinstance(model := settings.get("model"), dict):
        facts.append(f"Building: {_building(model)} (SHA-256 {model['sha256'][:16]}...).")
    elif content.get("name"):
        facts.append(f"Campaign: {content['name']}.")
    if isinstance(method := settings.get("method"), str):
        facts.append(f"Time integration: {method_text(method)}.")
    facts.append(
        "The errors of the time integration were estimated."
        if settings.get("check")
        else "The error of the time integration was not estimated (--check)."
    )
    if scales := settings.get("scales"):
        facts.append(f"Scale factors: {', '.join(f'{scale:g}' for scale in scales)}.")
    else:
        facts.append("Each record was scaled to the levels of its runs by one factor per level.")
    columns = ("record", "component", "dt_s", "samples", "pga_m_s2")
    keys = ("file", *columns[1:])
    rows = [tuple(record[key] for key in keys) for record in content["records"]]
    units = {"dt_s": "s", "samples": "1", "pga_m_s2": "m/s^2"}
    meanings = {name: {"meaning": "", "unit": unit} for name, unit in units.items()}
    table = Table(columns, rows[:_MOST_RECORDS], meanings).in_units(SI.in_figures)
    omission = ""
    if len(rows) > _MOST_RECORDS:
        omission = f"The first {_MOST_RECORDS} of {len(rows)} records."
    return (facts, "Records of the study, unscaled:", table, omission)


def _building(model: Mapping[str, Any]) -> str:
    """Return a clause with the name, the file and the first period of the building of a study.

    A model file that changed since the study, or that is missing, is stated by its name only.
    `model` contains the name (`file`) and the SHA-256 (`sha256`) of the file from the JSON summary.
    """
    file = Path(model["file"])
    with suppress(OSError, TdintError):
        if hashlib.sha256(file.read_bytes()).hexdigest() == model["sha256"]:
            building = load_model(file)
            return (
                f"{building.name}, {pluralize(len(building.stories), 'story')}, first period "
                f"{number_text(first_period(building))} s, {file.name}"
            )
    return str(model["file"])


def _observations(functions: Sequence[Fragility]) -> tuple[Part, ...]:
    """Return sentences on the number of observations of each fit, and on runs without a result."""
    points = []
    # Functions with the same observations are listed once.
    for fit, runs, motions, censored in dict.fromkeys(
        (function.fit, function.runs, function.motions, function.censored) for function in functions
    ):
        motions_text = f" under {pluralize(motions, 'ground motion')}" if motions else ""
        points.append(
            f"{_NAMES.get(fit, fit)}: {pluralize(runs, 'observation')}{motions_text}, "
            f"{censored} censored"
        )
    failed = max(function.failed for function in functions)
    if failed:
        points.append(f"{pluralize(failed, 'run')} without a result are omitted")
    return ([f"{text[0].upper()}{text[1:]}." for text in points],)
