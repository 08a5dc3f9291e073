"""`tdint fragility`: lognormal fragility functions fitted to a table of observations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError
from tdint.files import check_outputs, is_file, write_files
from tdint.number_parsing import pluralize
from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.grammar import FileName, ListOf, Mode, Name, Number, refuse_idle, span
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import Failures, note, say, warn

if TYPE_CHECKING:
    from tdint.campaign.fragility.fit_table import FragilityResult
    from tdint.campaign.fragility.fits import Fragility
    from tdint.output.figures.style import Figure

_FITS = ("stripes", "ida", "cloud")
_FIT = Mode(
    "with a single measure",
    frozenset(
        (
            "fit",
            "threshold",
            "by",
            "edp_range",
            "modeling_dispersion",
            "openquake",
            "plot",
            "report",
            "output_units",
            "pair_demand",
        )
    ),
    {"sufficiency": "it compares measures: give several with --im"},
)
_COMPARE = Mode("with several measures (--im), which are compared", frozenset({"sufficiency"}))
MODES = (_FIT, _COMPARE)

SIGNIFICANT = 0.05
"""P-value below which a slope is reported as significant."""


_OF_OPENQUAKE = (
    options.output.option(
        "--openquake",
        type=FileName(written=True),
        metavar="FILE.xml",
        help="Also write the functions as OpenQuake reads them (NRML 0.5), under the file's name "
        "as their id, or those of types under their names; of types with losses also "
        "FILE-vulnerability.xml, for its scenario_risk.",
    ),
    options.output.option(
        "--states",
        type=ListOf(Name()),
        needs="--openquake",
        help="Names of its limit states, by rising thresholds; ds1, ds2, ... by default.",
    ),
)


@options.request
class Request:
    """The command line of `tdint fragility`."""

    openquake: str | None
    states: tuple[str, ...] | None
    outputs: Outputs
    table: str = options.argument("TABLE.csv|DIR", type=FileName())
    fit: str | None = options.option(
        type=click.Choice(_FITS),
        help="stripes: maximum likelihood of numbers of exceedances; ida: moments of capacities, "
        "maximum likelihood if some are censored; cloud: a line through ln EDP over ln IM. By "
        "default what the table's columns are for.",
    )
    threshold: tuple[float, ...] | None = options.studies.threshold(
        help="Drift ratios, or other demands, whose exceedance is meant; by default those of the "
        "table."
    )
    by: str | None = options.option(
        type=click.Choice(["type", "building"]),
        help="A function for each type (class) of buildings of a campaign, or for each building, "
        "and each of its damage states: DIR is the folder of a campaign with `damage`; of "
        "buildings --threshold may be given instead.",
    )
    edp_range: tuple[float, float] | None = options.option(
        type=span,
        help="Of a cloud: demands below LOW are left out, those above HIGH known only to be above "
        "it. One may be left out.",
    )
    im: tuple[str, ...] | None = options.option(
        type=ListOf(Name()),
        help="Intensity of a campaign's runs: sa, at the first period (by default), pga, or what "
        "`tdint campaign --im` has found (pgv, sa:0.6, ...); of pairs the geometric mean of both "
        "components. Several are compared, by how well they tell the largest drift: another table.",
    )
    sufficiency: str | None = options.option(
        needs="--im",
        type=FileName(),
        metavar="FILE.csv",
        rare=True,
        help="With several: characteristics of the motions (record,magnitude,...), on which what "
        "a measure leaves should not depend. Runs under one motion count as alike, or those of one "
        "event with a column `event`.",
    )
    pair_demand: str | None = options.option(
        "--pair-demand",
        type=click.Choice(("larger", "mean", "separate")),
        rare=True,
        help="How the two horizontal components of a recording count: as one motion with their "
        "larger or their mean demand, or separately; by default as in the study.",
    )
    modeling_dispersion: float = options.option(
        type=Number(0.0, 10.0),
        default=0.0,
        metavar="BETA",
        rare=True,
        help="Standard deviation (of the logarithm) of what is not known of the model: adds the "
        "column beta_total, the root of the sum of squares.",
    )


@options.command(
    "fragility",
    "tdint fragility stripes.csv",
    "tdint fragility stripes.csv -o curve.csv --plot",
)
@options.output.to_files(
    picture="Also draw functions, observations and confidence bands, to this file (.png, .pdf, "
    ".svg) or beside -o under its name.",
    page=True,
    more=_OF_OPENQUAKE,
)
@options.of(Request)
def command(request: Request) -> None:
    """Fit fragility functions: probability of exceedance over intensity.

    TABLE.csv has the columns im,collapses,records (stripes), capacity[,censored] (ida) or
    im,edp[,censored] (cloud). It may have threshold, im_name, unit; - is standard input. DIR is a
    folder of `tdint ida` or `tdint campaign`; --by type fits the types of buildings of a campaign's
    damage states. CSV: median theta and dispersion beta of a lognormal distribution for each
    threshold, with the standard errors of ln theta and beta: by leaving out ground motions, or
    events where these are known; of tables that tell neither from the information matrix. The
    picture has 95 % confidence bands by the delta method.

    With several measures of --im no function is fitted: CSV, from the best on, the line of ln drift
    over ln IM of the runs that ended, beta about it (efficiency), beta over the slope
    (proficiency), and for each characteristic the slope of what is left with its p-value
    (sufficiency).
    """
    several = bool(request.im and len(request.im) > 1)
    refuse_idle(_COMPARE if several else _FIT, MODES)
    if is_file(Path(request.table) / "campaign.sqlite"):
        from tdint.campaign.store import open_existing
        from tdint_cli.campaigns import warn_unfinished

        with open_existing(Path(request.table)) as store:
            warn_unfinished(store)
    (_compare if several else _fragility)(request)


def _compare(request: Request) -> None:
    from tdint.campaign.fragility.measures import compare_measures

    fits = compare_measures(request.table, request.im or (), request.sufficiency)
    request.outputs.deliver(tables.studies.comparison_of_measures(fits))
    best = fits[0]
    say(
        f"{best.im} leaves the least: beta {best.beta:.3g} about its line, "
        f"{pluralize(best.runs, 'run')}; {best.left_out} left out."
    )
    for slope in best.dependences:
        if slope.p_value < SIGNIFICANT:
            say(
                f"What it leaves depends on {slope.characteristic}: slope {slope.slope:.3g}, p "
                f"{slope.p_value:.2g}."
            )


def _fragility(request: Request) -> None:
    from tdint.campaign.fragility.fit_table import (
        EVERY_DEMAND,
        FragilityRequest,
        fit_table,
        fit_types,
    )

    outputs, by = request.outputs, request.by
    if by == "type" and request.states:
        raise UsageError("--states is not for --by type: the states are those of the campaign")
    if by and request.states and not request.threshold:
        raise UsageError(
            "--states names thresholds: give --threshold, or leave it out for the states of the "
            "campaign"
        )
    if request.edp_range is not None and request.fit not in (None, "cloud"):
        raise UsageError("--edp-range is for --fit cloud")
    model = [Path(request.openquake)] if request.openquake else []
    # If the damage states have loss ratios, a vulnerability model is written next to the functions.
    losses = _losses(Path(request.table)) if by == "type" and model else {}
    beside = [file.with_name(f"{file.stem}-vulnerability.xml") for file in model if losses]
    check_outputs([*model, *beside], overwrite=outputs.overwrite)
    asked = FragilityRequest(
        fit=request.fit,
        thresholds=request.threshold or (),
        edp_range=request.edp_range or EVERY_DEMAND,
        modeling_dispersion=request.modeling_dispersion,
        measure=request.im[0] if request.im else None,
        states=(request.states or ()) if by else (),
        pair_demand=request.pair_demand,
    )
    result = fit_types(Path(request.table), asked, by) if by else fit_table(request.table, asked)
    note(*result.notes)
    warn(*result.warnings, *result.disagreements)
    if not result.functions:
        raise Failures(list(result.failures))
    units = outputs.units
    functions = [function.in_units(units) if units else function for function in result.functions]
    # Write the OpenQuake files. They contain only types with a function for every damage state.
    for file in model:
        from tdint.output.tables.exports import (
            STRENGTH,
            fragility_model,
            vulnerability_model,
            whole_types,
        )

        if functions[0].im.startswith("sdi"):
            warn(f"{file}: {STRENGTH}")
        whole, partial = (
            whole_types(result.functions) if result.functions[0].type else (result.functions, [])
        )
        warn(*(f"{file}: without {name}, which has no function of some states" for name in partial))
        written = {file: fragility_model(whole, file.stem, request.states or ())}
        written |= {other: vulnerability_model(whole, losses, file.stem) for other in beside}
        write_files(written, overwrite=outputs.overwrite)

    def draw(functions: Sequence[Fragility]) -> Figure:
        # The figures are imported here, because matplotlib is not needed without a figure.
        collapse = figures.collapse
        return collapse.types_picture(functions) if by else collapse.fragility_picture(functions)

    replace(outputs, units=None).deliver(
        tables.studies.fragility_table(
            functions,
            total=request.modeling_dispersion > 0.0,
            states=tables.studies.FRAGILITY_BUILDING
            if by == "building"
            else tables.studies.FRAGILITY_STATES,
        ),
        lambda: draw(functions),
        page=lambda: _page(request, result, functions, draw),
    )
    # Report the number of functions of a campaign, but each function of a single table.
    if by:
        types = dict.fromkeys(function.type for function in functions)
        fits = " and ".join(dict.fromkeys(function.fit for function in functions))
        say(f"{pluralize(len(functions), 'function')} of {pluralize(len(types), by)}: {fits}.")
    else:
        say(*map(_words, functions))
    warn(*map(str, result.failures))


def _page(
    request: Request,
    result: FragilityResult,
    functions: Sequence[Fragility],
    draw: Callable[[Sequence[Fragility]], Figure],
) -> bytes:
    """Return the page of --report.

    Parameters
    ----------
    request : Request
        The command line.
    result : FragilityResult
        Result of the fits, with its messages.
    functions : sequence of Fragility
        Functions in the units of the output.
    draw : callable
        Function that draws the figure of functions.
    """
    from tdint.output.page import Told
    from tdint.output.study_report import fragility_page
    from tdint.output.summary import files_read

    # Page and figure have one unit: an acceleration is in g unless a unit was requested.
    if request.outputs.units is None:
        functions = [_in_g(function) for function in functions]
    told = Told(
        said=[f"{text[0].upper()}{text[1:]}." for text in result.notes],
        warnings=[*result.warnings, *result.disagreements, *map(str, result.failures)],
        inputs=files_read(),
    )
    return fragility_page(functions, draw, request.table, told)


def _in_g(function: Fragility) -> Fragility:
    """Return a function with its intensity in g if it is an acceleration in m/s^2."""
    from tdint.units import SI

    return function.in_units(SI.in_figures) if function.unit == "m/s^2" else function


def _losses(folder: Path) -> dict[str, tuple[float, ...]]:
    """Return the loss ratios of the damage states of each type that specifies loss ratios."""
    from tdint.campaign.fragility.runs import stored_states
    from tdint.campaign.store import open_existing

    with open_existing(folder) as store:
        return {
            name: states.losses for name, states in stored_states(store).items() if states.losses
        }


def _words(function: Fragility) -> str:
    """Return a sentence with the median and the dispersion and their 95 % confidence intervals."""
    name = f"{function.im or 'im'}"
    words = "" if math.isnan(function.threshold) else f"Threshold {function.threshold:g}: "
    if function.damage == function.damage:
        words += f"damaged to {100.0 * function.damage:g} %, " if function.damage else "intact, "
    unit = f" {function.unit}" if function.unit else ""
    text = f"{words}{function.fit}, median {name} {function.theta:.4g}{unit}"
    if function.theta_error == function.theta_error:
        factor = math.exp(1.96 * function.theta_error)
        text += f" (95 %: {function.theta / factor:.4g} to {function.theta * factor:.4g})"
    else:
        text += (
            " (extrapolated)"
            if function.extrapolated
            else " (no interval: less than three motions tell it)"
        )
    text += f", beta {function.beta:.3f}"
    if function.beta_error == function.beta_error:
        text += f" +- {1.96 * function.beta_error:.3f}"
    if function.modeling_dispersion:
        text += f", total beta {function.beta_total:.3f}"
    return text + (
        f"; {function.censored} of {function.runs} censored." if function.censored else "."
    )
