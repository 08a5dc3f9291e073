"""HTML report of fragility functions."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.errors import TdintError
from tdint.model.config.model_file import load_model
from tdint.number_parsing import number_text, pluralize
from tdint.output import report
from tdint.output.page import Chapter, PageText, Part, Picture, page
from tdint.output.tables.table import TEXT, Cell, Table
from tdint.response.pairs import describe_demand
from tdint.studies.fragility.fit_table import study_summary
from tdint.studies.fragility.fragility_function import CLOUD, IDA, STRIPES, Fragility
from tdint.studies.fragility.fragility_tables import fit_table_of, risk_table_of
from tdint.studies.motions.scaling_figures import measure_words
from tdint.units import SI

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SOURCES = {
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

LOGNORMAL = (
    "A fragility function is the probability of exceedance over the intensity: the lognormal "
    "distribution function with the median theta and the standard deviation beta of the logarithm."
)
RANK_AND_FIT = (
    "Theta follows from all capacities (their geometric mean, if none is censored), so that it "
    "differs from the median by rank."
)
INTERVALS = (
    "Intervals contain 95 %: theta times exp(-1.96 e) to exp(1.96 e) with the standard error e of "
    "ln theta (for capacities without censored ones the value of Student's distribution in place "
    "of 1.96), and beta plus or minus 1.96 standard errors. Standard errors are computed by "
    "omitting ground motions in turn (jackknife) if the table states the ground motions of several "
    "runs; otherwise they follow from the information matrix."
)


# ---- Fragility functions


MOST_CAPACITIES = 60
"""Maximum number of motions in the table of capacities; capacities.csv lists all."""
MOST_THRESHOLDS = 4
"""Maximum number of drift ratios in the table of capacities, so that the table fits the page."""


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
    counted = f" Pairs: {describe_demand(pairs)}." if pairs else ""
    # The headline states the functions, unless there are too many for a headline.
    verdict: list[tuple[bool | None, str]] = []
    if len(functions) <= MOST_THRESHOLDS:
        verdict = [(None, _median_text(function)) for function in functions]
    elif functions[0].risk:
        frequencies = [item.risk.annual_frequency for item in functions if item.risk]
        low, high = number_text(min(frequencies), 4), number_text(max(frequencies), 4)
        verdict = [(None, f"Annual frequencies of exceedance from {low} to {high}.")]
    losses = dict.fromkeys(
        (item.type, item.annual_loss) for item in functions if item.annual_loss >= 0.0
    )
    verdict += [
        (None, f"{name}: expected annual loss {number_text(100.0 * loss, 3)} % of the value.")
        for name, loss in [*losses][:MOST_THRESHOLDS]
    ]
    # The damage of functions without initial damage is nan.
    damages = {function.damage for function in functions if function.damage >= 0.0}
    fitted = fit_table_of(functions, damaged=len(damages) > 1)
    chapters = [
        page_text.result(
            Picture(partial(draw, functions), f"Probability of exceedance over {measure}")
        ),
        Chapter("Fitted parameters", (LOGNORMAL, fitted)),
        Chapter("Mean annual frequency of exceedance", _risk_parts(functions)),
        Chapter("Fractions of exceedances and fitted function", _count_table(functions)),
        Chapter("Observations", (*_observations(functions), *_study_parts(source, study))),
        Chapter(
            "Methods and assumptions",
            (
                [
                    *(f"Fit of {SOURCES[fit]}." for fit in fits),
                    INTERVALS,
                    f"Intensity measure: {stated_measure or f'not stated in {source}'}.{counted}",
                    *_dispersion(functions),
                    *(report.simplifications() if study else ()),
                ],
            ),
        ),
    ]
    about = f"Fragility functions fitted to {source}: {pluralize(len(functions), 'function')}."
    return page("Fragility functions", about, chapters, replace(page_text, verdict=verdict))


def _median_text(function: Fragility) -> str:
    """Return a sentence on the median and the dispersion of a fragility function, with the 95 %
    interval of the median if its standard error is known."""
    parts = [f"{function.type}, {function.state}"] if function.type else []
    if math.isfinite(function.threshold):
        demand = "drift ratio" if function.is_drift_ratio else "threshold"
        parts.append(f"{demand} {function.threshold_text}")
    if function.initial_damage:
        parts.append(function.initial_damage)
    name = f"{', '.join(parts)}: " if parts else ""
    unit = f" {function.unit}" if function.unit else ""
    text = f"{name}median {measure_words(function.im) or 'intensity'} "
    text += f"{number_text(function.theta)}{unit}"
    if math.isfinite(function.theta_error):
        low, high = map(number_text, function.theta_interval)
        text += f" (95 %: {low} to {high}{unit})"
    elif function.extrapolated:
        text += " (extrapolated)"
    text = f"{text}, beta {number_text(function.beta, 3)}"
    for risk, name in ((function.risk, ""), (function.total_risk, " with the modeling dispersion")):
        if risk is not None:
            text += f"; annual frequency{name} {number_text(risk.annual_frequency, 4)}"
    text = f"{text}."
    return f"{text[0].upper()}{text[1:]}"


def _risk_parts(functions: Sequence[Fragility]) -> tuple[Part, ...]:
    """Return sentences and a table on the annual frequencies; empty without a hazard curve."""
    risk = functions[0].risk
    if risk is None:
        return ()
    texts = [
        "The frequency is the integral of the fragility function over the rates of the hazard "
        "curve. ln rate is linear in ln intensity between its points, and the end slopes continue "
        "outside; the frequency from outside is a separate column.",
        risk.target_text(functions[0].unit),
    ]
    return texts, risk_table_of(functions)


def _dispersion(functions: Sequence[Fragility]) -> list[str]:
    """Return a statement on the dispersion due to the uncertainty of the model."""
    modeling = functions[0].modeling_dispersion
    texts = []
    if any(function.draws_text for function in functions):
        texts = [
            "beta is the dispersion over ground motions and draws of the properties together; "
            "beta_within is that of one draw, beta_between that of the medians of the draws."
        ]
    elif not modeling:
        texts = [
            "beta is the record-to-record dispersion; the uncertainty of the model is not included."
        ]
    if modeling:
        texts.append(
            f"total beta includes a modeling dispersion of {number_text(modeling, 3)}: the root of "
            "the sum of squares."
        )
    return texts


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
    if not rows:
        return ()
    units = {"function": TEXT, "intensity": functions[0].unit or "1"}
    units |= dict.fromkeys(("runs", "counted", "fitted"), "1")
    text = (
        "Fractions of the runs in ranges of the intensity that exceed the limit, and the values of "
        "the function at the geometric mean of the intensities of these runs:"
    )
    return text, Table.of_units(units, rows[:MOST_CAPACITIES])


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
        facts.append(f"Time integration: {report.method_text(method)}.")
    facts.append(
        "The errors of the time integration were estimated."
        if settings.get("check")
        else "The error of the time integration was not estimated."
    )
    if scales := settings.get("scales"):
        facts.append(f"Scale factors: {', '.join(f'{scale:g}' for scale in scales)}.")
    else:
        facts.append("Each record was scaled to the levels of its runs by one factor per level.")
    units = {"component": TEXT, "dt_s": "s", "samples": "1", "pga_m_s2": "m/s^2"}
    rows = [tuple(record[key] for key in ("file", *units)) for record in content["records"]]
    table = Table.of_units({"record": TEXT} | units, rows[:_MOST_RECORDS]).in_units(SI.in_figures)
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
                f"{number_text(report.first_period(building))} s, {file.name}"
            )
    return str(model["file"])


def _observations(functions: Sequence[Fragility]) -> tuple[Part, ...]:
    """Return sentences on the number of observations of each fit, and on runs without a result."""
    points = []
    # Functions with the same observations are listed one time.
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
