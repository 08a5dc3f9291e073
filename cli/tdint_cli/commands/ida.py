"""`tdint ida`: incremental dynamic analysis of a building under many records."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import UsageError
from tdint.files import check_outputs, is_there, write_files
from tdint.number_parsing import pluralize
from tdint.output import figures, tables
from tdint.system import processors
from tdint.units import GROUND_MOTION
from tdint_cli import options
from tdint_cli.drawing import emit_table
from tdint_cli.options.grammar import FileName, ListOf, Name, PairWish, Ratio, intensity, period
from tdint_cli.options.output import check_picture, picture_file
from tdint_cli.options.record import RecordsRequest
from tdint_cli.options.studies import pair_measure, read_suite, read_table_of_factors
from tdint_cli.terminal import Failures, note, progress_bar, say, warn

if TYPE_CHECKING:
    from tdint.campaign.ida import IdaSettings, IdaStudy
    from tdint.files import Content
    from tdint.units import OutputUnits, Units

RUNS, CAPACITIES, SUMMARY = "ida.csv", "capacities.csv", "ida.json"
_OFF_BALANCE = 0.01  # energy error above which a run is reported, relative to the input energy


class _Measure(Name):
    """Intensity measure with levels, also of plug-ins; other measures are refused with a reason."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from tdint.campaign.intensity import without_levels

        if reason := without_levels(value):
            self.fail(f"{value}: {reason}; there are no levels of it", param, ctx)
        return click.Choice(list(self.names())).convert(value, param, ctx)


def _measures() -> tuple[str, ...]:
    from tdint.campaign.intensity import levelled

    return levelled()


@options.request
class IdaRequest(RecordsRequest):
    """The command line of `tdint ida`."""

    model: str
    im: str = options.studies.option(
        type=_Measure(_measures),
        default="sa",
        help="Intensity measure: Sa at a period (by default), PGA, PGV, Sa_avg, the geometric "
        "mean of Sa about a period, Arias intensity or CAV.",
    )
    period: float | None = options.studies.option(
        needs="--im sa or sa-avg",
        type=period,
        help="Period of sa and sa-avg; by default T1, the first one of the building.",
    )
    pairs: PairWish | None = options.studies.pairs(
        "Take the two horizontal components of a motion together: both are run, at levels of this "
        "measure."
    )
    factors: str | None = options.studies.factors(
        "The records replace RECORD. The analysis scales each record itself and does not use the "
        "factors."
    )
    pair_demand: str | None = options.studies.option(
        "--pair-demand",
        type=click.Choice(("larger", "mean", "separate")),
        rare=True,
        help="How the two horizontal components of a recording count: as one motion with their "
        "larger demand (by default) or their mean demand, or separately, as two motions.",
    )
    damping: float = options.studies.damping("--im sa or sa-avg")
    max_im: Units | None = options.studies.option(
        rare=True,
        type=intensity("acceleration", "velocity", "displacement"),
        help="The largest intensity, with its unit (3g): capacities above it are censored.",
    )
    precision: float = options.analysis.option(
        type=Ratio(0.0, 0.5, min_open=True),
        default=0.05,
        metavar="5%",
        help="Bracket of the capacity against collapse; 5% by default.",
    )
    collapse_drift: float | None = options.analysis.option(
        type=Ratio(0.0, min_open=True),
        metavar="10%",
        help="Drift ratio over which the building has collapsed; by default the model's.",
    )
    threshold: tuple[float, ...] | None = options.studies.threshold(
        help="Drift ratios whose capacities are told beside that of collapse; by default the "
        "medians of the model's damage states by drift_ratio, else 1%,2%,4%."
    )
    after: str | None = options.option(
        needs="--damage",
        type=FileName(),
        metavar="MAIN",
        rare=True,
        help="Do the same once more for the building that this mainshock has damaged: each RECORD "
        "is an aftershock, which finds it at rest.",
    )
    damage: tuple[float, ...] | None = options.option(
        needs="--after",
        type=ListOf(Ratio(0.0, min_open=True)),
        metavar="2%,...",
        rare=True,
        help="Drift ratios to which the mainshock is scaled; a study for each.",
    )
    method: str | None = options.analysis.method
    dt: float | None = options.analysis.dt
    duration: float | None = options.analysis.duration
    until_rest: bool = options.analysis.until_rest
    check: bool = options.analysis.option(
        rare=True,
        help=f"Columns <name>_error in {RUNS} with the estimated errors, as `tdint run` has them.",
    )
    output: str | None = options.output.output(
        "DIR",
        f"Write {RUNS}, {CAPACITIES} and {SUMMARY} into this folder, and go on there with what an "
        "interrupted call of the same kind left.",
    )
    plot: str | None = options.output.plot(
        "Also draw all curves with fractiles and capacities, to this file (.png, .pdf, .svg), or "
        "alone as ida.png into the folder of -o."
    )
    report: str | None = options.output.report
    output_units: OutputUnits | None = options.output.units
    overwrite: bool = options.output.overwrite
    jobs: int | None = options.output.threads(
        "Threads that share the records; as many as processors", options.grammar.GENERAL
    )

    @property
    def picture(self) -> Path | None:
        """Path of the figure, or None if no figure is requested."""
        return picture_file(self.plot, Path(self.output) / RUNS if self.output else None)


@options.command(
    "ida",
    "tdint ida office.yaml office-motion.txt",
    "tdint ida office.yaml office-motion.txt --threshold 2% -o study --plot",
)
@options.analysis.model
@options.record.of_records_if_any
@options.of(IdaRequest)
def command(request: IdaRequest) -> None:
    """Run incremental dynamic analyses: story drift over intensity, up to collapse.

    MODEL.yaml is a model file, RECORD a file, or a folder for all records in it; all horizontal
    components are taken, each for itself, unless --component names one. Every record is scaled up
    by 1.5 until the building collapses, its capacity bracketed, the curve filled where the drift
    changes by more than 20 %, and two levels tried above the collapse, where a building may stand
    again (resurrection). A run that does not converge or diverges is repeated with half the step,
    up to three times, and counts neither as standing nor as collapse if that does not help.

    With --after and --damage the tables have a column damage, 0 for the intact building; `tdint
    fragility` fits each state for itself. Drifts are then the largest in the aftershock, counted
    from where the building stood at first.

    CSV of the capacities on standard output, or with -o a folder: one row per record and drift
    threshold, the collapse drift last. The same call again goes on where it was interrupted;
    --overwrite begins anew.
    """
    from tdint.analysis.spectra.elastic import first_mode
    from tdint.campaign.ida import IdaSettings, ida
    from tdint.campaign.ida_curve import Mainshock
    from tdint.campaign.intensity import SPECTRAL, measure_at
    from tdint.campaign.pairs import LARGER
    from tdint.ground_motion.measures import cut_off
    from tdint.model.building import assemble
    from tdint.model.config.model_file import load_model

    folder = _folder(request)
    model = load_model(request.model)
    units = request.output_units or model.output_units
    # A spectral intensity measure requires a period. The default is the first period of the
    # building.
    is_spectral = request.im in SPECTRAL
    period = (
        (request.period or first_mode(assemble(model), None).period) if is_spectral else math.nan
    )
    measure = measure_at(request.im, request.damping, period)
    largest = request.max_im
    if largest and GROUND_MOTION[largest.quantity].get(measure.unit) != 1.0:
        raise UsageError(f"--max-im {largest.text}: {measure.name} is in {measure.unit}")
    settings = IdaSettings(
        precision=request.precision,
        collapse_drift=request.collapse_drift,
        max_im=largest.scale if largest else math.inf,
        dt=request.dt,
        duration=request.duration,
        until_rest=request.until_rest,
        check=request.check,
        thresholds=request.threshold or None,
    )
    suite, _ = read_table_of_factors(
        request.records, request.factors, request.choice, request.pairs
    )
    note(*cut_off(suite.records, request.duration or model.analysis.duration or math.inf))
    # Read the mainshock that damages the building before the study, if it is specified.
    mainshock = None
    if request.after is not None and request.damage:
        before = read_suite([request.after], request.choice, None)
        if before.failures:
            raise before.failures[0]
        mainshock = Mainshock(tuple(before.records), request.damage)
    with progress_bar(request.output is None) as tell:
        study = ida(
            model,
            suite.motions,
            measure,
            settings,
            method=request.method,
            pair=pair_measure(request.pairs),
            jobs=request.jobs or processors(),
            folder=folder,
            progress=lambda done, of: tell(f"records {done}/{of}", done / of),
            mainshock=mainshock,
            pair_demand=request.pair_demand or LARGER,
        )
    _report_pairs(request, study)
    shown = study.in_units(units)
    if folder is None:
        emit_table(tables.studies.capacity_table(shown))
    _write(request, study, shown, settings, units, [str(error) for error in suite.failures])
    _report(shown, request.precision)
    if suite.failures:
        raise Failures(suite.failures)


def _folder(request: IdaRequest) -> Path | None:
    """Return the directory of the study after a check that its files can be written.

    Parameters
    ----------
    request : IdaRequest
        Options of the command line.

    Raises
    ------
    OutputError
        An existing file was not written from the store of the study, or the store is not trusted.
    """
    from tdint.campaign.ida import STORE
    from tdint.campaign.store import forget, open_written
    from tdint.campaign.store_schema import locked

    folder = Path(request.output) if request.output else None
    picture = request.picture
    if picture:
        check_picture(picture)
    files = [folder / name for name in (RUNS, CAPACITIES, SUMMARY)] if folder else []
    pages = [Path(request.report)] if request.report else []
    outputs = list(dict.fromkeys([*files, *([picture] if picture else []), *pages]))
    # Files that an earlier call of this study has written may be replaced.
    begun = folder / STORE if folder and is_there(folder / STORE) else None
    check_outputs(outputs, overwrite=request.overwrite or begun is not None)
    if begun and request.overwrite:
        with locked(begun.parent):
            forget(begun)
    elif begun:
        with open_written(begun) as store:
            store.refuse_foreign(outputs)
    return folder


def _write(
    request: IdaRequest,
    study: IdaStudy,
    shown: IdaStudy,
    settings: IdaSettings,
    units: OutputUnits,
    unused: list[str],
) -> None:
    """Write the tables, the summary and the figure of the study.

    Parameters
    ----------
    request : IdaRequest
        Options of the command line.
    study : IdaStudy
        Study in SI units, for the summary.
    shown : IdaStudy
        Study with intensities in the output units, for the tables and the figure.
    settings : IdaSettings
        Settings of the study.
    units : OutputUnits
        Units of the files.
    unused : list of str
        Error messages of the records that could not be read.
    """
    from tdint.campaign.ida import STORE
    from tdint.campaign.store import open_written
    from tdint.methods.catalogue import resolved
    from tdint.output.summary import inputs_summary, model_input, record_summary, table_summary

    files: dict[Path, Content] = {}
    if request.output:
        written = {
            RUNS: tables.studies.ida_table(shown),
            CAPACITIES: tables.studies.capacity_table(shown),
        }
        for name, table in written.items():
            files[Path(request.output) / name] = table.in_units(units).csv()
        said = {
            "model": inputs_summary([model_input(study.model)])[0],
            "method": study.method,
            "method_parameters": resolved(study.method),
            "intensity_measure": asdict(study.measure),
            "pairs": study.pair,
            **({"pair_demand": study.pair_demand} if study.partners else {}),
            **asdict(settings),
            "thresholds": list(study.thresholds[:-1]),
            **({"after": request.after, "damage": list(request.damage)} if request.damage else {}),
            "collapse_drift": study.model.collapse_drift,
        }
        records = [record_summary(curve.record) for curve in study.states[0].curves]
        meanings = {**written[RUNS].meanings, **written[CAPACITIES].meanings}
        content = table_summary("ida", said, records, meanings)
        content |= {"not_used": {"records": {"count": len(unused), "reasons": unused}}}
        files[Path(request.output) / SUMMARY] = options.output.summary_bytes(content, units)
    if picture := request.picture:
        files[picture] = figures.style.picture(
            picture.suffix, lambda: figures.collapse.ida_picture(shown)
        )
    if request.report:
        files[Path(request.report)] = _page(request, study, settings, unused)
    # Without a directory, no store lists the files of earlier calls.
    if not request.output:
        write_files(files, overwrite=request.overwrite)
        return
    with open_written(Path(request.output) / STORE) as store:
        if not request.overwrite:
            store.refuse_foreign(files)
        write_files(files, overwrite=True, on_written=store.will_write)


def _page(request: IdaRequest, study: IdaStudy, settings: IdaSettings, unused: list[str]) -> bytes:
    """Return the page of --report.

    Parameters
    ----------
    request : IdaRequest
        Options of the command line.
    study : IdaStudy
        Study in SI units.
    settings : IdaSettings
        Settings of the study.
    unused : list of str
        Error messages of the records that could not be read.
    """
    from tdint.output.page import Told, page_units
    from tdint.output.study_report import ida_page
    from tdint.output.summary import files_read

    units = page_units(request.output_units or study.model.page_units)
    records = [curve.record for curve in study.states[0].curves]
    warnings = [f"{record.source}: {text}" for record in records for text in record.warnings]
    told = Told(
        warnings=[*unused, *warnings, *_doubts(study, request.precision)],
        head=study.model.page_head,
        inputs=files_read(),
    )
    return ida_page(study.in_units(units), settings, told, units, damping=request.damping)


def _report_pairs(request: IdaRequest, study: IdaStudy) -> None:
    """Report the default treatment of component pairs, unless the user has selected a treatment.

    Parameters
    ----------
    request : IdaRequest
        Options of the command line.
    study : IdaStudy
        Results of the study.
    """
    from tdint.campaign.pairs import note as note_of_pairs

    if study.partners and request.pair_demand is None:
        note(note_of_pairs(len(study.partners), study.pair_demand))


def _report(study: IdaStudy, precision: float) -> None:
    """Report the results, and warn of conditions that affect their meaning.

    Parameters
    ----------
    study : IdaStudy
        Results of the study.
    precision : float
        Maximum ratio of the upper to the lower limit of a capacity, minus 1, without a warning.
    """
    from tdint.campaign.pairs import SEPARATE, motions_text

    runs = [run for curve in study.curves for run in curve.runs]
    if study.resumed == len(study.curves):
        note("nothing to do: all records were done")
    elif study.resumed:
        note(f"{study.resumed} of {len(study.curves)} records were done before")
    options.analysis.warn_of(study.model)
    note(*study.remarks)
    paired = 0 if study.pair_demand == SEPARATE else len(study.states[0].partners)
    records = motions_text(len(study.states[0].curves), paired)
    say(
        f"{study.model.name}: {records}, {pluralize(len(runs), 'run')} with {study.method}.",
        *map(_median, study.states),
    )
    # Report runs that required a smaller time step, and resurrections above the first collapse.
    finer = sum(run.finer > 0 and (run.stable or run.collapsed) for run in runs)
    if finer:
        note(
            f"{pluralize(finer, 'run')} repeated with a finer step, for want of a result with the "
            "first one"
        )
    again = sum(curve.resurrection for curve in study.curves)
    if again:
        note(
            f"the building stands again at a level tried above its first collapse under {again} of "
            f"{len(study.curves)} records"
        )
    warn(*_doubts(study, precision))


def _doubts(study: IdaStudy, precision: float) -> list[str]:
    """Return warnings about conditions that make the capacities less reliable.

    Parameters
    ----------
    study : IdaStudy
        Results of the study.
    precision : float
        Maximum ratio of the upper to the lower limit of a capacity, minus 1, without a warning.
    """
    runs, doubts = [run for curve in study.curves for run in curve.runs], []
    lost = sum(not (run.stable or run.collapsed) for run in runs)
    if lost:
        doubts.append(
            f"{lost} of {len(runs)} runs have no result, also with a finer step; they count "
            "neither way"
        )
    capacities = [curve.collapse for curve in study.curves if not curve.collapse.censored]
    wide = sum(
        not capacity.upper <= capacity.lower * (1.0 + precision) * (1.0 + 1e-9)
        for capacity in capacities
    )
    if wide:
        doubts.append(
            f"{wide} of {len(capacities)} capacities are bracketed less closely than "
            f"{100.0 * precision:g} %"
        )
    off = sum(abs(run.energy_error) > _OFF_BALANCE for run in runs if run.stable)
    if off:
        doubts.append(
            f"the energy balance of {off} of {len(runs)} runs is off by more than 1 %: use a "
            "smaller step"
        )
    return doubts


def _median(study: IdaStudy) -> str:
    """Return a sentence with the median collapse capacity for one initial damage.

    Parameters
    ----------
    study : IdaStudy
        Results for one initial damage.
    """
    import numpy as np

    from tdint.campaign.ida_curve import fractiles

    curves = study.motion_curves
    count, unit, damage = len(curves), study.measure.unit, curves[0].damage
    # A fractile above the largest intensity is NaN, which is not equal to itself.
    low, middle, high = fractiles(curves, np.array([study.model.collapse_drift]))[:, 0].tolist()
    censored = sum(curve.collapse.censored for curve in curves)
    capacity = (
        f"{study.im_name} = {middle:.4g} {unit}"
        if middle == middle
        else "above the largest intensity"
    )
    state = f", damaged to {100.0 * damage:g} %" if damage else ""
    text = f"Median capacity against collapse{state}: {capacity}"
    if count > 1 and low == low and high == high:
        text += (
            f", 16 and 84 %: {low:.4g} and {high:.4g} (by rank; the median of `tdint fragility` is "
            "a geometric mean)"
        )
    return text + (f"; {censored} of {count} censored." if censored else ".")
