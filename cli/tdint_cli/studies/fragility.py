"""`tdint fragility`: lognormal fragility functions fitted to a table of observations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tdint import studies
from tdint.errors import UsageError
from tdint.files import check_outputs, is_file, write_files
from tdint.number_parsing import pluralize
from tdint_cli import options
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import FileName, Number
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import Failures, note, say, warn

if TYPE_CHECKING:
    from tdint.output.figures.style import Figure
    from tdint.studies.fragility.fit_table import FragilityResult
    from tdint.studies.fragility.fragility_function import Fragility
    from tdint.units import Units


_OPENQUAKE_OPTIONS = (
    options.option("--openquake"),
    options.option("--states"),
)


@options.request
class Request:
    """The command line of `tdint fragility`."""

    openquake: str | None
    states: tuple[str, ...] | None
    outputs: Outputs
    table: str | None = options.argument("[TABLE.csv|DIR]", type=FileName(), required=False)
    fit: str | None = options.option()
    threshold: tuple[float, ...] | None = options.option()
    by: str | None = options.option()
    edp_range: tuple[float, float] | None = options.option()
    im: tuple[str, ...] | None = options.option()
    pair_demand: str | None = options.option()
    modeling_dispersion: float = options.option(type=Number(0.0, 10.0), default=0.0)
    theta: Units | None = options.option()
    beta: float | None = options.option()
    hazard: str | None = options.option()
    allow_outside: bool = options.option()


@options.command
@options.output.to_files(picture=True, page=True, more=_OPENQUAKE_OPTIONS)
@options.of(Request)
def command(request: Request) -> None:
    """Fit fragility functions: probability of exceedance over intensity.

    TABLE.csv (- is standard input) has the columns im,collapses,records (stripes),
    capacity[,censored] (ida) or im,edp[,censored] (cloud), and optionally threshold, im_name and
    unit. DIR is a directory written by `tdint ida` or `tdint campaign`. With --by type, one
    function is fitted for each building type and damage state of a campaign.

    CSV, one row per threshold: median theta and dispersion beta of a lognormal distribution, and
    the standard errors of ln theta and beta. The standard errors are jackknife estimates over
    ground motions, or over events if the events are known. If the table names neither, the errors
    are computed from the information matrix. With -o FILE.csv, the counts in bins of the intensity
    are written to FILE-bins.csv. The figure shows 95 % confidence bands (delta method).

    With several measures of --im, the measures are compared and no function is fitted. CSV, one row
    per measure, the best measure first: the regression line of ln drift over ln IM, the standard
    deviation beta about this line (efficiency), and beta divided by the slope
    (proficiency). Collapsed and failed runs are excluded.
    """
    several = bool(request.im and len(request.im) > 1)
    refuse_idle("given" if request.theta else "compare" if several else "fit")
    if request.theta is not None:
        _given(request, request.theta)
        return
    if request.table is None:
        raise UsageError("TABLE.csv or DIR is required, or --theta and --beta with --hazard")
    if is_file(Path(request.table) / "campaign.sqlite"):
        from tdint.studies.store.opening import open_existing
        from tdint_cli.studies.campaign_files import warn_unfinished

        with open_existing(Path(request.table)) as store:
            warn_unfinished(store)
    if several:
        _compare(request)
    else:
        _fit(request)


def _given(request: Request, theta: Units) -> None:
    """Write the annual frequency of a function with a given median and dispersion."""
    import numpy as np

    from tdint.studies.fragility.fragility_function import GIVEN, Fragility
    from tdint.studies.fragility.hazard import at_risk, read_hazard
    from tdint.units import GROUND_MOTION

    if request.beta is None or request.hazard is None:
        raise UsageError("--theta requires --beta and --hazard")
    unit = next(name for name, size in GROUND_MOTION[theta.quantity].items() if size == 1.0)
    function = Fragility(
        GIVEN,
        theta.scale,
        request.beta,
        np.full((2, 2), math.nan),
        0,
        im=request.im[0] if request.im else "",
        unit=unit,
        modeling_dispersion=request.modeling_dispersion,
    )
    if request.outputs.units:
        function = function.in_units(request.outputs.units)
    functions, warnings = at_risk(
        [function], read_hazard(request.hazard), allow_outside=request.allow_outside
    )
    warn(*warnings)
    table = studies.fragility_tables.fragility_table(
        functions, total=request.modeling_dispersion > 0.0
    )
    replace(request.outputs, units=None).deliver(table)
    say(*map(_function_text, functions))


def _compare(request: Request) -> None:
    """Compare intensity measures, write the table and report the most efficient measure."""
    from tdint.studies.fragility.measures import compare_measures

    fits = compare_measures(request.table or "", request.im or (), request.pair_demand)
    rule = fits[0].rule
    note(*([rule.note()] if rule.pairs and not request.pair_demand else ()))
    request.outputs.deliver(studies.fragility_tables.comparison_of_measures(fits))
    best = fits[0]
    say(
        f"{best.im} predicts the drift best: standard deviation of ln drift about the "
        f"regression line {best.beta:.3g} (beta), from {pluralize(best.runs, 'motion')}; "
        f"{best.left_out} excluded."
    )


def _check_options(request: Request) -> None:
    """Raise UsageError for options of a fit that exclude or require each other."""
    by = request.by
    if by == "type" and request.states and not request.threshold:
        raise UsageError(
            "--states cannot be used with --by type, because the campaign defines the names of "
            "the states; omit --states"
        )
    if by and request.states and not request.threshold:
        raise UsageError(
            "--states with --by building requires --threshold; add --threshold, or omit "
            "--states to use the states of the campaign"
        )
    if request.edp_range is not None and request.fit not in (None, "cloud"):
        raise UsageError("--edp-range can only be used with --fit cloud; omit --edp-range")


def _fit(request: Request) -> None:
    """Fit fragility functions, write their table and the other requested files, and report them.
    Failures is raised if no function could be fitted.
    """
    from tdint.studies.fragility.fit_table import (
        EVERY_DEMAND,
        FragilityRequest,
        fit_table,
        fit_types,
        study_summary,
    )
    from tdint.studies.fragility.hazard import at_risk, read_hazard

    outputs, by, source = request.outputs, request.by, request.table or ""
    _check_options(request)
    openquake_files = _openquake_files(request)
    bins = [outputs.table.with_name(f"{outputs.table.stem}-bins.csv")] if outputs.table else []
    check_outputs([*openquake_files, *bins], overwrite=outputs.overwrite)
    fit_request = FragilityRequest(
        fit=request.fit,
        thresholds=request.threshold or (),
        edp_range=request.edp_range or EVERY_DEMAND,
        modeling_dispersion=request.modeling_dispersion,
        measure=request.im[0] if request.im else None,
        states=(request.states or ()) if by else (),
        pair_demand=request.pair_demand,
    )
    result = fit_types(Path(source), fit_request, by) if by else fit_table(source, fit_request)
    note(*result.notes)
    warn(*result.warnings, *result.disagreements)
    if not result.functions:
        raise Failures(list(result.failures))
    units = outputs.units
    functions = [function.in_units(units) if units else function for function in result.functions]
    # A table of `tdint ida` or `tdint campaign` has a JSON file, and its thresholds are drift
    # ratios. A table of another program can have any demand.
    if not by and study_summary(Path(source)):
        functions = [replace(function, is_drift_ratio=True) for function in functions]
    curve = read_hazard(request.hazard) if request.hazard else None
    if curve:
        functions, outside = at_risk(functions, curve, allow_outside=request.allow_outside)
        warn(*outside)
    if openquake_files:
        # OpenQuake files do not use --output-units: write the functions in SI units.
        _write_openquake(request, result.functions, openquake_files)

    def draw(functions: Sequence[Fragility]) -> Figure:
        """Return the figure of the functions: with --by, a panel for each type."""
        # The first use of the module of figures imports matplotlib, which is not needed earlier.
        module = studies.fragility_figures
        functions = module.in_figure_units(functions, outputs.shown_units)
        if by:
            return module.types_picture(functions)
        return module.fragility_picture(functions, curve)

    tables = studies.fragility_tables
    states = tables.FRAGILITY_BUILDING if by == "building" else tables.FRAGILITY_STATES
    counts = tables.counts_table(functions, states)
    # The functions are already in the output units; without units, they are not converted again.
    replace(outputs, units=None).deliver(
        tables.fragility_table(functions, total=request.modeling_dispersion > 0.0, states=states),
        lambda: draw(functions),
        page=lambda: _page(request, result, functions, draw),
        more={file: counts.csv() for file in bins if counts.rows},
    )
    # Report the number of functions of a campaign, but each function of a single table.
    if by:
        types = dict.fromkeys(function.type for function in functions)
        fits = " and ".join(dict.fromkeys(function.fit for function in functions))
        say(f"{pluralize(len(functions), 'function')} of {pluralize(len(types), by)}: {fits}.")
        say(*(f"{f.type}, {f.state}: {f.draws_text}." for f in functions if f.draws_text))
    else:
        say(*map(_function_text, functions))
    if functions[0].risk:
        say(functions[0].risk.target_text(functions[0].unit))
    warn(*map(str, result.failures))


def _openquake_files(request: Request) -> list[Path]:
    """Return the path of the fragility model of OpenQuake, and of its vulnerability model.

    The list is empty without --openquake. A vulnerability model is written only with --by type, and
    if the damage states have loss ratios.
    """
    if not request.openquake:
        return []
    file = Path(request.openquake)
    if request.by == "type" and _losses(Path(request.table or "")):
        return [file, file.with_name(f"{file.stem}-vulnerability.xml")]
    return [file]


def _write_openquake(
    request: Request, functions: Sequence[Fragility], files: Sequence[Path]
) -> None:
    """Write the fragility model and, if there are two files, the vulnerability model.

    The models contain only types with a function for every damage state.

    `files` contains the paths of the fragility model and of the vulnerability model.
    """
    from tdint.studies.campaign import exports

    file = files[0]
    if functions[0].im.startswith("sdi"):
        warn(f"{file}: {exports.STRENGTH}")
    incomplete: Sequence[str] = ()
    if functions[0].type:
        functions, incomplete = exports.whole_types(functions)
    for name in incomplete:
        warn(f"{file}: {name} is omitted, because some of its damage states have no function")
    contents = {file: exports.fragility_model(functions, file.stem, request.states or ())}
    if len(files) > 1:
        losses = _losses(Path(request.table or ""))
        contents[files[1]] = exports.vulnerability_model(functions, losses, file.stem)
    write_files(contents, overwrite=request.outputs.overwrite)


def _page(
    request: Request,
    result: FragilityResult,
    functions: Sequence[Fragility],
    draw: Callable[[Sequence[Fragility]], Figure],
) -> bytes:
    """Return the HTML page of --report."""
    from tdint.output.page import PageText
    from tdint.studies.fragility.fragility_report import fragility_page

    # Page and figure have one unit: an acceleration is in g unless a unit was requested.
    functions = studies.fragility_figures.in_figure_units(functions, request.outputs.shown_units)
    page_text = PageText(
        sentences=[f"{text[0].upper()}{text[1:]}." for text in result.notes],
        warnings=[*result.warnings, *result.disagreements, *map(str, result.failures)],
    )
    return fragility_page(functions, draw, request.table or "", page_text)


def _losses(folder: Path) -> dict[str, tuple[float, ...]]:
    """Return the loss ratios of the damage states by building type, from the store of a campaign.

    Types without loss ratios are omitted.
    """
    from tdint.studies.fragility.building_damage import stored_states
    from tdint.studies.store.opening import open_existing

    with open_existing(folder) as store:
        return {
            name: states.losses for name, states in stored_states(store).items() if states.losses
        }


def _function_text(function: Fragility) -> str:
    """Return a sentence with the median and the dispersion and their 95 % confidence intervals.

    Values that the function does not have are NaN and are omitted.
    """
    text = ""
    if not math.isnan(function.threshold):
        demand = "Drift ratio" if function.is_drift_ratio else "Threshold"
        text = f"{demand} {function.threshold_text}: "
    if function.initial_damage:
        text += f"{function.initial_damage}, "
    unit = f" {function.unit}" if function.unit else ""
    text += f"{function.fit}, median {function.im or 'im'} {function.theta:.4g}{unit}"
    if not math.isnan(function.theta_error):
        low, high = function.theta_interval
        text += f" (95 %: {low:.4g} to {high:.4g})"
    elif function.extrapolated:
        text += " (extrapolated)"
    elif function.fit != "given":
        text += " (no confidence interval: it requires at least three ground motions)"
    text += f", beta {function.beta:.3f}"
    if not math.isnan(function.beta_error):
        low, high = function.beta_interval
        text += f" (95 %: {low:.3f} to {high:.3f})"
    if function.modeling_dispersion:
        text += f", total beta {function.beta_total:.3f}"
    if function.draws_text:
        text += f", {function.draws_text}"
    if function.censored:
        text += f"; {function.censored} of {function.runs} censored"
    if function.risk:
        text += f"; {function.risk.text(function.unit)}"
    if function.total_risk:
        text += f"; with the modeling dispersion {function.total_risk.text(function.unit)}"
    return f"{text}."
