"""`tdint ida`: incremental dynamic analysis of a building under many records."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint import studies
from tdint.errors import UsageError
from tdint.files import Content, check_outputs, is_there, settle, write_files
from tdint.number_parsing import pluralize
from tdint.output import figures
from tdint.system import processors
from tdint.tabular import on_use
from tdint.units import GROUND_MOTION, OutputUnits, Units
from tdint_cli import options
from tdint_cli.drawing import emit_table
from tdint_cli.options.option_types import (
    PairWish,
    Ratio,
    Written,
)
from tdint_cli.options.output import picture_file
from tdint_cli.options.record import RecordsRequest
from tdint_cli.studies import options as study_options
from tdint_cli.studies.options import pair_measure, read_suite, read_table_of_factors
from tdint_cli.terminal import Failures, note, progress_bar, say, warn

if TYPE_CHECKING:
    from tdint.arrays import Array
    from tdint.model.definition import Model
    from tdint.studies.ida.collapse_margin import Acceptance, CollapseMargin
    from tdint.studies.ida.ida import IdaSettings, IdaStudy
    from tdint.studies.ida.ida_curve import Mainshock
    from tdint.studies.motions.intensity import IntensityMeasure

MARGIN = "margin.csv"
RUNS, CAPACITIES, FRACTILES = "ida.csv", "capacities.csv", "fractiles.csv"
SUMMARY = "ida.json"
_MAX_ENERGY_ERROR = 0.01
"""Energy error of a run divided by its input energy. A warning lists runs with larger errors, as
their drifts are not reliable."""


def _measure(name: str) -> str:
    """Return the name of an intensity measure, also of a plug-in; raise BadParameter if it is
    unknown, or if ground motions cannot be scaled to its levels."""
    from tdint.studies.motions.intensity import scaling_obstacle

    if reason := scaling_obstacle(name):
        raise click.BadParameter(
            f"{name}: ground motions cannot be scaled to levels of this measure, because "
            f"{reason}; use one of {', '.join(_measures())}"
        )
    return str(click.Choice(_measures()).convert(name, None, None))


# Names of the intensity measures for the scaling of ground motions
_measures = on_use("tdint.studies.motions.intensity").scalable_measures


@options.request
class IdaRequest(RecordsRequest):
    """The command line of `tdint ida`."""

    model: str
    im: str = options.option(type=Written("name", _measure, _measures), default="sa")
    period: float | None = options.option()
    pairs: PairWish | None = study_options.pairs
    factors: str | None = options.option()
    pair_demand: str | None = options.option()
    damping: float = options.option(default=0.05)
    max_im: Units | None = options.option()
    precision: float = options.option(type=Ratio(0.0, 0.5, min_open=True), default=0.05)
    collapse_drift: float | None = options.option()
    threshold: tuple[float, ...] | None = options.option()
    p695: Acceptance | None = options.option(
        type=Written("design", on_use("tdint.studies.ida.collapse_margin").Acceptance.parse)
    )
    after: str | None = options.option()
    damage: tuple[float, ...] | None = options.option()
    method: str | None = options.analysis.method
    dt: float | None = options.option()
    duration: float | None = options.option()
    until_rest: bool = options.option()
    check: bool = options.option()
    output: str | None = options.output.output
    plot: str | None = options.output.plot
    report: str | None = options.output.report
    output_units: OutputUnits | None = options.option()
    overwrite: bool = options.option()
    jobs: int | None = options.option()

    @property
    def picture(self) -> Path | None:
        """Path of the figure, or None if no figure is requested."""
        return picture_file(self.plot, Path(self.output) / RUNS if self.output else None)


@options.command
@options.analysis.model
@options.record.optional_plain_record_options
@options.of(IdaRequest)
def command(request: IdaRequest) -> None:
    """Run incremental dynamic analyses: story drift over intensity, up to collapse.

    MODEL.yaml is a model file. RECORD is a file, or a directory (all records in it). The two
    horizontal components of a recording are one ground motion (--pair-demand).

    Each ground motion is scaled up in steps of 1.5 until the building collapses. The collapse
    capacity is then bracketed to --precision, and levels are added wherever the drift changes by
    more than 20 %. Two levels above the collapse are also run, because some buildings survive a
    higher intensity than the intensity of their first collapse (resurrection). A run that does not
    converge is repeated with half the time step, up to three times. If it still has no result, it
    counts neither as survival nor as collapse.

    With --after RECORD and --damage, a mainshock first damages the building: it is scaled such that
    the building reaches each drift ratio of --damage. The ground motions are then aftershocks. The
    tables have a column damage, which is 0 for the intact building; `tdint fragility` fits a
    function for each value. Drifts are the maximum drifts during the aftershock, measured from the
    undeformed building.

    CSV of the capacities on standard output, or with -o in a directory: one row per record and
    drift threshold; the collapse drift is the last threshold. If the model limits attachments or
    links, rows of these limits follow. With -o, the same call continues an interrupted analysis;
    --overwrite starts again.
    """
    from tdint.ground_motion.measures import cut_off
    from tdint.model.config.model_file import load_model
    from tdint.response.runs.settings import settings_from
    from tdint.studies.ida.collapse_margin import FAR_FIELD, check_motions, collapse_margin
    from tdint.studies.ida.ida import IdaSettings, ida

    folder = _folder(request)
    model = load_model(request.model)
    units = request.output_units or model.output_units
    measure = _intensity_measure(request, model)
    settings = settings_from(
        request,
        IdaSettings,
        max_im=request.max_im.scale if request.max_im else math.inf,
        thresholds=request.threshold or None,
    )
    if not request.records and request.factors is None and model.excitation.has_forces:
        raise UsageError(
            "RECORD is required: the levels are intensities of ground motions; for forces alone, "
            "run load cases at several scales (key `forces` of `tdint campaign`)"
        )
    suite, _ = read_table_of_factors(
        request.records, request.factors, request.choice, request.pairs
    )
    if request.p695:
        check_motions(suite.motions, request.pair_demand)
    note(*cut_off(suite.records, request.duration or model.analysis.duration or math.inf))
    mainshock = _read_mainshock(request)
    with progress_bar(request.output is None) as show_progress:
        study = ida(
            model,
            suite.motions,
            measure,
            settings,
            method=request.method,
            pair=pair_measure(request.pairs),
            jobs=request.jobs or processors(),
            folder=folder,
            overwrite=request.overwrite,
            progress=lambda done, count: show_progress(f"records {done}/{count}", done / count),
            mainshock=mainshock,
            pair_demand=request.pair_demand,
        )
    _report_pairs(request, study)
    shown_study = study.in_units(units)
    if folder is None:
        emit_table(studies.ida_tables.capacity_table(shown_study))
    unused = [str(error) for error in suite.failures]
    margin = collapse_margin(study, request.p695) if request.p695 else None
    _write(request, study, shown_study, settings, units, unused, margin)
    _report(shown_study, request.precision)
    if margin:
        say(*margin.sentences)
        if margin.components < FAR_FIELD:
            note(f"p695: {margin.components} components; the far-field set has {FAR_FIELD}")
    if suite.failures:
        raise Failures(suite.failures)


def _intensity_measure(request: IdaRequest, model: Model) -> IntensityMeasure:
    """Return the intensity measure of --im, with --period (by default the first period of the
    model) and --damping for spectral measures. UsageError is raised if the unit of --max-im is not
    a unit of the measure.
    """
    from tdint.model.building import assemble
    from tdint.response.spectra.elastic import first_mode
    from tdint.studies.motions.intensity import SPECTRAL, measure_at

    period = math.nan  # measures such as PGA have no period
    if request.im in SPECTRAL:
        period = request.period or first_mode(None, *map(assemble, model.directions)).period
    measure = measure_at(request.im, request.damping, period)
    # --max-im has the quantity of the measure (such as acceleration) if the SI unit of the measure
    # is one of the units of this quantity, with factor 1.
    max_im = request.max_im
    if max_im and GROUND_MOTION[max_im.quantity].get(measure.unit) != 1.0:
        raise UsageError(
            f"--max-im {max_im.text}: wrong unit for {measure.name}; specify the maximum in "
            f"{measure.unit}"
        )
    return measure


def _read_mainshock(request: IdaRequest) -> Mainshock | None:
    """Return the main shock of --after with the drift ratios of --damage; None without --after."""
    from tdint.studies.ida.ida_curve import Mainshock

    if request.after is None or not request.damage:
        return None
    suite = read_suite([request.after], request.choice, None)
    if suite.failures:
        raise suite.failures[0]
    return Mainshock(tuple(suite.records), request.damage)


def _folder(request: IdaRequest) -> Path | None:
    """Check the files in the directory of the study. The result is `None` if the results are not
    written to a directory.

    OutputError is raised if a file exists that no earlier call of the study has written and
    --overwrite is not specified, or the store cannot be used.
    """
    from tdint.studies.ida.ida import STORE
    from tdint.studies.store.opening import open_written

    folder = Path(request.output) if request.output else None
    picture = request.picture
    names = (RUNS, CAPACITIES, FRACTILES, SUMMARY, *((MARGIN,) if request.p695 else ()))
    files = [folder / name for name in names] if folder else []
    pages = [Path(request.report)] if request.report else []
    outputs = list(dict.fromkeys([*files, *([picture] if picture else []), *pages]))
    # Files that an earlier call of the study has written may be replaced.
    if folder:
        settle(folder)
    store_file = folder / STORE if folder and is_there(folder / STORE) else None
    check_outputs(outputs, overwrite=request.overwrite or store_file is not None)
    if store_file and not request.overwrite:
        with open_written(store_file) as store:
            # Other existing files must not be replaced.
            store.refuse_foreign(outputs)
    return folder


def _write(
    request: IdaRequest,
    study: IdaStudy,
    shown: IdaStudy,
    settings: IdaSettings,
    units: OutputUnits,
    unused: list[str],
    margin: CollapseMargin | None,
) -> None:
    """Write the tables, the summary and the figure of the study.

    `shown` is the study with intensities in the output units, for the tables and the figure.
    `unused` contains the error messages of the records that could not be read.
    """
    from tdint.methods.catalogue import resolved
    from tdint.output.summary import inputs_summary, model_input, record_summary, table_summary
    from tdint.output.tables.table import Table
    from tdint.response.runs.settings import RunSettings, settings_from
    from tdint.studies.ida.ida import STORE
    from tdint.studies.store.opening import open_written, replacement_of, write_from_store

    files: dict[Path, Content] = {}
    if request.output:
        tables = {
            RUNS: studies.ida_tables.ida_table(shown),
            CAPACITIES: studies.ida_tables.capacity_table(shown),
            FRACTILES: studies.ida_tables.fractile_table(shown),
        }
        if margin:
            tables[MARGIN] = Table.of_results(studies.ida_tables.MARGIN, [margin])
        for name, table in tables.items():
            files[Path(request.output) / name] = table.in_units(units).csv()
        summary_settings = {
            "model": inputs_summary([model_input(study.model)])[0],
            "method": study.method,
            "method_parameters": resolved(study.method),
            "intensity_measure": asdict(study.measure),
            "pairs": study.pair,
            **({"pair_demand": study.pair_demand} if study.partners else {}),
            "precision": settings.precision,
            "collapse_drift": study.model.collapse_drift,
            # The last threshold is the collapse drift.
            "thresholds": list(study.thresholds[:-1]),
            "max_im": settings.max_im,
            **asdict(settings_from(settings, RunSettings)),
            **({"after": request.after, "damage": list(request.damage)} if request.damage else {}),
            **({"mainshock_factors": study.mainshocks} if study.mainshocks else {}),
        }
        records = [record_summary(curve.record) for curve in study.states[0].curves]
        meanings = {key: text for table in tables.values() for key, text in table.meanings.items()}
        content = table_summary("ida", summary_settings, records, meanings)
        content |= {"not_used": {"records": {"count": len(unused), "reasons": unused}}}
        files[Path(request.output) / SUMMARY] = options.output.summary_bytes(content, units)
    if picture := request.picture:
        files[picture] = figures.style.picture(
            picture.suffix,
            lambda: studies.ida_figures.ida_picture(study.in_units(units.in_figures)),
        )
    if request.report:
        files[Path(request.report)] = _page(request, study, settings, unused, margin)
    # Without a directory, no store lists the files of earlier calls.
    if not request.output:
        write_files(files, overwrite=request.overwrite)
        return
    file = Path(request.output) / STORE
    with open_written(replacement_of(file) if request.overwrite else file) as store:
        if not request.overwrite:
            store.refuse_foreign(files)
        write_from_store(store, files, file, {})


def _page(
    request: IdaRequest,
    study: IdaStudy,
    settings: IdaSettings,
    unused: list[str],
    margin: CollapseMargin | None,
) -> bytes:
    """Return the HTML page of --report.

    `unused` contains the error messages of the records that could not be read.
    """
    from tdint.output.page import PageText, page_units
    from tdint.studies.ida.ida_report import ida_page

    units = page_units(request.output_units or study.model.page_units)
    records = [curve.record for curve in study.states[0].curves]
    warnings = [f"{record.source}: {text}" for record in records for text in record.warnings]
    page_text = PageText(
        warnings=[*unused, *warnings, *_reliability_warnings(study, request.precision)],
        head=study.model.page_head,
        sentences=margin.sentences if margin else (),
    )
    return ida_page(study.in_units(units), settings, page_text, units, damping=request.damping)


def _report_pairs(request: IdaRequest, study: IdaStudy) -> None:
    """Report the pairs of components and their treatment."""
    from tdint.response.pairs import PairRule

    if study.partners:
        files = [curve.record.source for curve in study.states[0].curves]
        recordings = {record: study.partners.get(record, record) for record in range(len(files))}
        rule = PairRule(study.pair_demand, recordings)
        note(rule.note(files, is_default=request.pair_demand is None))


def _report(study: IdaStudy, precision: float) -> None:
    """Report the results, and warn of conditions that affect their meaning.

    `precision` is the maximum ratio of the upper to the lower limit of a capacity, minus 1, without
    a warning.
    """
    runs = [run for curve in study.curves for run in curve.runs]
    if study.resumed == len(study.curves):
        note("all records were completed by an earlier call; nothing to do")
    elif study.resumed:
        note(f"{study.resumed} of {len(study.curves)} records were completed by an earlier call")
    options.analysis.warn_of(study.model)
    note(*study.remarks)
    say(
        f"{study.model.name}: {study.motions_text}, {pluralize(len(runs), 'run')} with "
        f"{study.method}.",
        *_medians(study),
    )
    repeated = sum(run.finer > 0 and (run.stable or run.collapsed) for run in runs)
    if repeated:
        note(
            f"{pluralize(repeated, 'run')} repeated with a smaller time step, because the first "
            "time step gave no result"
        )
    curves = study.motion_curves
    resurrections = sum(curve.resurrection for curve in curves)
    if resurrections:
        note(
            f"for {resurrections} of {pluralize(len(curves), 'motion')} the building survives an "
            "intensity above its lowest collapse intensity (resurrection)"
        )
    warn(*_reliability_warnings(study, precision))


def _reliability_warnings(study: IdaStudy, precision: float) -> list[str]:
    """Return warnings about conditions that make the capacities less reliable.

    `precision` is the maximum ratio of the upper to the lower limit of a capacity, minus 1, without
    a warning.
    """
    from tdint.fractiles import small_sample_warning

    runs = [run for curve in study.curves for run in curve.runs]
    warnings = [*filter(None, [small_sample_warning(len(study.states[0].motion_curves))])]
    without_result = sum(not (run.stable or run.collapsed) for run in runs)
    if without_result:
        warnings.append(
            f"{without_result} of {len(runs)} runs have no result, not even with a smaller time "
            "step; they count neither as survival nor as collapse"
        )
    capacities = [curve.collapse for curve in study.curves if not curve.collapse.censored]
    # The last factor allows for rounding. With a limit that is NaN the comparison is false, so that
    # the capacity also counts as imprecise.
    imprecise = sum(
        not capacity.upper <= capacity.lower * (1.0 + precision) * (1.0 + 1e-9)
        for capacity in capacities
    )
    if imprecise:
        warnings.append(
            f"{imprecise} of {len(capacities)} capacities are known less precisely than "
            f"{100.0 * precision:g} % (--precision)"
        )
    # The energy error of a stable run is finite: a run with a nan has the status "diverged".
    unbalanced = sum(abs(run.energy_error) > _MAX_ENERGY_ERROR for run in runs if run.stable)
    if unbalanced:
        warnings.append(
            f"the energy balance error of {unbalanced} of {len(runs)} runs exceeds "
            f"{100.0 * _MAX_ENERGY_ERROR:g} %; use a smaller time step (--dt)"
        )
    return warnings


def _medians(study: IdaStudy) -> Iterator[str]:
    """Yield a sentence with the factor of each mainshock, with the median collapse capacity for
    each initial damage, and with the median capacity for each limit of attachments and links."""
    import numpy as np

    from tdint.fractiles import fractiles
    from tdint.studies.ida.ida_curve import capacity_fractiles

    for name, drift, factor in study.mainshocks:
        yield f"Mainshock {name} times {factor:.4g}: drift ratio {100.0 * drift:g} %."
    for state in study.states:
        curves = state.motion_curves
        damage, collapse_drift = curves[0].damage, np.array([study.model.collapse_drift])
        text = "Median collapse capacity"
        if damage:
            text += f" of the building damaged to a drift ratio of {100.0 * damage:g} %"
        censored = sum(curve.collapse.censored for curve in curves)
        values = capacity_fractiles(curves, collapse_drift)[:, 0]
        yield _median_text(text, study, values, len(curves), censored)
    if not study.limits:
        return
    curves = study.states[0].motion_curves
    capacities = [
        studies.ida_tables.limit_capacities(study, curve) for curve in curves if curve.stable
    ]
    for of_limit in zip(*capacities, strict=True):
        text = f"Median capacity, limit {of_limit[0].limit}"
        values = fractiles(np.array([item.intensity for item in of_limit]))
        censored = sum(item.censored for item in of_limit)
        yield _median_text(text, study, values, len(curves), censored)


def _median_text(text: str, study: IdaStudy, values: Array, count: int, censored: int) -> str:
    """Return a sentence with the median capacity and, for several motions, two fractiles.

    `values` are the three fractiles in ascending order; a fractile above the maximum intensity is
    infinite. `count` and `censored` are the numbers of all and of censored capacities.
    """
    low, median, high = values.tolist()
    unit = study.measure.unit
    text += ": "
    if not math.isfinite(median):
        text += "above the maximum intensity"
    else:
        text += f"{study.im_name} = {median:.4g} {unit}"
    if count > 1 and math.isfinite(low) and math.isfinite(high):
        text += (
            f", 16 and 84 % fractiles {low:.4g} and {high:.4g} (sorted capacities; the median of "
            "`tdint fragility` is their geometric mean)"
        )
    if censored:
        text += f"; {censored} of {count} censored"
    return f"{text}."
