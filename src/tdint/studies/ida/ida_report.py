"""HTML report of an incremental dynamic analysis."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tdint.errors import AnalysisError
from tdint.number_parsing import number_text, pluralize
from tdint.output import report
from tdint.output.page import Chapter, PageText, Part, Picture, page, page_units
from tdint.output.tables.table import TEXT, Cell, Table
from tdint.response.pairs import describe_demand
from tdint.studies.fragility import fragility_report
from tdint.studies.fragility.fits import fit_capacities
from tdint.studies.fragility.fragility_function import IDA, Fragility, initial_damage
from tdint.studies.fragility.fragility_tables import fit_table_of
from tdint.studies.ida import ida_figures
from tdint.studies.ida.ida import IdaSettings, IdaStudy
from tdint.studies.ida.ida_curve import IdaCurve, PairCurve, capacity_fractiles
from tdint.studies.ida.ida_tables import curve_rows, limit_capacities
from tdint.studies.motions.scaling_figures import measure_words
from tdint.units import OutputUnits

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
    motions = study.motions_text
    fits: list[Part] = []
    if functions:
        fits = [
            f"{fragility_report.LOGNORMAL} {fragility_report.RANK_AND_FIT}",
            fit_table_of(functions, damaged=len(states) > 1),
            *failures,
        ]
    capacities, remark = _capacities(study)
    chapters = [
        Chapter(
            "Result",
            (
                [_curves_text(study), *page_text.sentences],
                Picture(
                    lambda: ida_figures.ida_picture(study),
                    f"Maximum drift ratio over {measure}: curves, fractiles, capacities",
                ),
            ),
        ),
        Chapter("Fractiles of the capacities over the ground motions", (_fractile_table(study),)),
        Chapter("Fitted fragility functions", fits),
        Chapter(f"Capacities of the ground motions, {measure} ({unit})", (capacities, remark)),
        report.model_chapter(study.model, units),
        report.unscaled_motions([curve.record for curve in states[0].curves], study.model, units),
        Chapter("Methods and assumptions", (_ida_points(study, settings, damping),)),
    ]
    about = (
        f"Incremental dynamic analysis of {study.model.name}: {motions}, {pluralize(runs, 'run')}."
    )
    verdict = [(None, text) for text in _medians(study)]
    return page(study.model.name, about, chapters, replace(page_text, verdict=verdict))


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
        # Fractiles above the maximum intensity are infinite.
        drifts = np.array([study.model.collapse_drift])
        low, median, high = capacity_fractiles(curves, drifts)[:, 0].tolist()
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
    """Return the table of the fractiles of the capacities over the ground motions, with a row for
    each threshold and each tenth of the collapse drift, and for each damage of the building before
    the ground motions."""
    units = {"drift_ratio": "1"}
    units |= dict.fromkeys(("fractile_16", "median", "fractile_84"), study.measure.unit)
    units |= {"motions": "1", "censored": "1"}
    rows: list[tuple[Cell, ...]] = []
    for state in study.states:
        curves = state.motion_curves
        tenths = np.linspace(0.0, study.model.collapse_drift, 11)[1:].round(12)
        drifts = np.union1d(tenths, study.thresholds)
        values = capacity_fractiles(curves, drifts).T.tolist()
        for threshold, row in zip(drifts.tolist(), values, strict=True):
            censored = sum(curve.capacity(threshold).censored for curve in curves)
            rows.append((initial_damage(curves[0].damage), threshold, *row, len(curves), censored))
    return _with_states(study, units, rows)


def _with_states(study: IdaStudy, units: dict[str, str], rows: list[tuple[Cell, ...]]) -> Table:
    """Return a table whose first column is the damage of the building before the ground motions. It
    has this column only if the study has several states of damage."""
    shown = units if len(study.states) == 1 else ("state", *units)
    return Table.of_units({"state": TEXT} | units, rows).chosen(shown)


def _capacities(study: IdaStudy) -> tuple[Table, str]:
    """Return the table of the capacities of each ground motion, and a remark for the report.

    The table has columns for the largest drift ratios of the study, and for the limits of
    attachments and links. The remark states if capacities are censored or if rows are omitted; it
    is empty otherwise.
    """
    # The last threshold is the collapse drift.
    thresholds = study.thresholds[-fragility_report.MOST_THRESHOLDS :]
    names = [f"at_{100.0 * threshold:g}_%" for threshold in thresholds[:-1]] + ["collapse"]
    limits = [item.limit for item in limit_capacities(study, study.states[0].motion_curves[0])]
    units = {"record": TEXT, "component": TEXT}
    units |= dict.fromkeys((*names, *limits), study.measure.unit)
    units |= {"collapse_factor": "1", "status": TEXT}
    rows: list[tuple[Cell, ...]] = []
    for row in curve_rows(study, study.motion_curves):
        curve = row.curve
        capacities = [curve.capacity(threshold) for threshold in thresholds]
        status = "censored" if capacities[-1].censored else "collapsed"
        values = [capacity.capacity for capacity in capacities]
        limited = [item.capacity for item in limit_capacities(study, curve)]
        values += limited or [math.nan] * len(limits)
        factor = _factor(curve, capacities[-1].capacity)
        names_of_row = (initial_damage(curve.damage), row.record, row.component)
        rows.append((*names_of_row, *values, factor, status))
    most = fragility_report.MOST_CAPACITIES
    table = _with_states(study, units, rows[:most])
    remarks = []
    if any(row[-1] == "censored" for row in rows):
        remarks.append("A censored capacity is the largest level that was run.")
    if len(rows) > most:
        remarks.append(f"The first {most} of {len(rows)}; capacities.csv lists all.")
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
        f"Time integration: {report.method_text(study.method)}, {step}; a run without a result is "
        "repeated with half the time step, up to three times.",
        "Fractiles are computed by rank over the ground motions for each drift ratio.",
        f"Fit of {fragility_report.SOURCES[IDA]}.",
        fragility_report.INTERVALS,
    ]
    if study.partners:
        points.append(f"Pairs of horizontal components: {describe_demand(study.pair_demand)}.")
    if not settings.check:
        points.append(
            "The error of the time integration was not estimated; the energy balance of "
            "each run was checked."
        )
    if any(curve.damage for curve in study.curves):
        points.append(
            "The building is damaged by a main shock and at rest before each motion; drifts are "
            "relative to the undeformed position."
        )
    return [*points, *report.simplifications()]
