"""`tdint spectrum`: response spectra of records, or a target spectrum alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import click

from tdint.errors import OutputError, TdintError, UsageError
from tdint.files import STDIN, check_outputs, write_files
from tdint.output import figures
from tdint_cli import options
from tdint_cli.commands import spectrum_kinds as kinds
from tdint_cli.commands.spectrum_kinds import AXES, MODES, Kind, SpectrumRequest, TablesRequest
from tdint_cli.drawing import reading_width, table_bytes
from tdint_cli.options.grammar import BESIDE, refuse_idle
from tdint_cli.options.output import SUFFIX, Outputs, beside, check_picture, picture_file
from tdint_cli.options.record import notes_of_components
from tdint_cli.processes import Task, outcomes
from tdint_cli.terminal import Failures, emit, note, warn

# ---- A table over the period of each record: the work, the outputs, and what is said of it


@dataclass(frozen=True)
class RecordTable:
    """What becomes of one record.

    Attributes
    ----------
    text : bytes
        The rows of all its components and damping ratios, after a header: CSV, or drawn for a
        terminal.
    meanings : dict
        What its columns mean, for the JSON file.
    records : tuple of dict
        What each component is, for the JSON file.
    notes : tuple of str
        What there is to say of it.
    interval : float
        Sampling interval, s.
    warnings : tuple of str
        What changes what its numbers mean.
    results : tuple
        Kept only for a picture of several records.
    picture : bytes or None
        The picture of this record, if it has one of its own.
    """

    text: bytes
    meanings: dict[str, dict[str, str]]
    records: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]
    interval: float
    warnings: tuple[str, ...]
    results: tuple[Any, ...] = ()
    picture: bytes | None = None


def make_tables(request: TablesRequest, kind: Kind) -> None:
    """Make the tables of a command line, and say what there is to say; one bad record does not keep
    the others back.

    Raises
    ------
    TdintError
        Wrong arguments or outputs, before any work; Failures of records, after the others are done.
    """
    from tdint.ground_motion.reading.suites import records_of

    kind.check(request)
    if request.is_folder and request.plot not in (None, BESIDE):
        raise UsageError(
            "--plot=FILE is one picture of all records; give -o a file, or --plot alone for one "
            "each"
        )
    sources = records_of(request.records, request.choice)
    # What to do for the files of each record, after it is clear that its outputs can be written
    files_of = kind.gather(request, sources.files)
    output = Path(request.output) if request.output else None
    if output and request.is_folder:
        own_tables: list[Path | None] = [*tables_of([files[0] for files in files_of], output)]
        tables = own_tables
    else:
        own_tables, tables = [None] * len(files_of), [output]
    written = [file for table in tables for file in _outputs(request, table).files]
    check_outputs(written, overwrite=request.overwrite)
    tasks = [
        Task(files[0], table, files[1:]) for files, table in zip(files_of, own_tables, strict=True)
    ]
    notes, warnings = (
        dict.fromkeys(sources.notes),
        dict[str, None](),
    )  # sets in the order of arrival
    failures, longest_interval = list[TdintError](sources.failures), 0.0
    together: list[RecordTable] = []
    to_terminal = request.output is None
    width = reading_width() if to_terminal else None
    header = True
    work = partial(_work, request, kind, width)
    with outcomes(
        work, tasks, jobs=request.jobs, label="spectra", to_terminal=to_terminal
    ) as results:
        for task, outcome in zip(tasks, results, strict=True):
            if isinstance(outcome, TdintError):
                failures.append(outcome)
                continue
            notes |= dict.fromkeys(outcome.notes)
            warnings |= dict.fromkeys(outcome.warnings)
            longest_interval = max(longest_interval, outcome.interval)
            if task.table:
                _write(request, kind, task.table, [outcome])
                continue
            if request.output or request.plot:
                together.append(outcome if request.output else replace(outcome, text=b""))
            if to_terminal:
                emit(outcome.text if header or width else _without_header(outcome.text))
                header = False
    if together:
        _write(request, kind, output, together)
    remark = kind.remark(request, longest_interval)
    warn(*warnings)
    note(*filter(None, (*notes, remark)))
    if failures:
        from tdint.ground_motion.horizontals import told_once

        raise Failures(told_once(failures))


def _outputs(request: TablesRequest, table: Path | None) -> Outputs:
    """The files that are written with a table, or without one."""
    picture = picture_file(request.plot, table) if table or not request.is_folder else None
    if picture:
        check_picture(picture)
    return Outputs(table, picture, beside(table, ".json") if table else None, request.overwrite)


def _work(request: TablesRequest, kind: Kind, width: int | None, task: Task) -> RecordTable:
    """All that becomes of one record; it may run in another process."""
    from tdint.output.summary import record_summary

    records = [record for file in (task.source, *task.others) for record in request.read(file)]
    results = kind.compute(request, records)
    lines = tuple(results.lines)
    table = kind.table(request, lines).in_units(request.shown_units)
    return RecordTable(
        text=table_bytes(table, width),
        meanings=table.meanings,
        records=tuple(map(record_summary, results.records)),
        notes=(*notes_of_components(results.records, lambda record: record.notes), *results.notes),
        interval=max(record.dt for record in results.records),
        warnings=notes_of_components(results.records, lambda record: record.warnings),
        results=() if task.table or not request.plot else lines,
        picture=_picture(request, kind, lines, SUFFIX) if task.table and request.plot else None,
    )


def _picture(request: TablesRequest, kind: Kind, results: Sequence[Any], suffix: str) -> bytes:
    stream = BytesIO()
    figures.style.picture(suffix, lambda: kind.picture(request, results))(stream)
    return stream.getvalue()


def _write(
    request: TablesRequest, kind: Kind, table: Path | None, products: Sequence[RecordTable]
) -> None:
    """Write a table of the records of several files, or of one, with what goes beside it; or a
    picture alone."""
    from tdint.output.summary import table_summary

    outputs = _outputs(request, table)
    contents: dict[Path, bytes] = {}
    if outputs.table and outputs.summary:
        records = [record for product in products for record in product.records]
        summary = table_summary(
            str(click.get_current_context().info_name),
            request.settings(),
            records,
            products[0].meanings,
        )
        rows = [_without_header(product.text) for product in products[1:]]
        contents[outputs.table] = b"".join([products[0].text, *rows])
        # The columns of the table are those of the products, in the units asked for already.
        of_table = {"columns": summary["columns"]}
        contents[outputs.summary] = options.output.summary_bytes(
            summary, request.shown_units, converted=of_table
        )
    if outputs.picture:
        results = [result for product in products for result in product.results]
        contents[outputs.picture] = products[0].picture or _picture(
            request, kind, results, outputs.picture.suffix
        )
    write_files(contents, overwrite=request.overwrite)


def _without_header(csv: bytes) -> bytes:
    return csv.partition(b"\n")[2]


def tables_of(files: Sequence[str], folder: Path) -> list[Path]:
    """The CSV file in `folder` for each record: its name without suffix, or with it where several
    have the same stem.

    Raises
    ------
    OutputError
        Two records would still have the same one.
    """
    stems = ["stdin" if file == STDIN else Path(file).stem for file in files]
    count = Counter(stems)
    tables: dict[Path, str] = {}
    for file, stem in zip(files, stems, strict=True):
        name = stem if count[stem] == 1 or file == STDIN else Path(file).name
        table = folder / f"{name}.csv"
        if table in tables:
            raise OutputError(
                f"{table}: both {tables[table]} and {file} would be written to it; use -o FILE for "
                "all in one file, or one folder each"
            )
        tables[table] = file
    return list(tables)


# ---- Spectrum


@options.command(
    "spectrum",
    "tdint spectrum office-motion.txt --damping 2%,5% -o spectrum.csv --plot",
    "tdint spectrum office-motion.txt --period 0.5,1 --ductility 2,4",
    exits={4: "a record cannot be read; the others are done"},
)
@options.record.of_records_if_any
@options.record.one_scale
@options.spectra.tables_of_records(AXES)
@options.of(SpectrumRequest)
def command(request: SpectrumRequest) -> None:
    """Compute elastic, inelastic or Fourier spectra of ground-motion records.

    RECORD is a file, or a folder for all records in it, - is standard input; all components are
    taken unless
    --component names one. CSV: relative displacement, pseudo-velocity, pseudo-acceleration,
    relative velocity and absolute acceleration, the largest from the first sample to the last,
    between the samples, too. They are exact for a ground motion that is linear between its samples,
    or come from --method with the record's sampling interval as its step. A record that fails does
    not keep the others from being done.

    --ductility and --strength make another table, of oscillators with bilinear hysteresis: yield
    force over weight, ductility, displacement at rest after the record, largest and yield
    displacement, yield force over mass, and largest elastic force over yield force.

    --rotd makes another table, of two horizontal components together: percentiles of the
    pseudo-acceleration over all directions, 180 of them, the geometric mean of both components, and
    the direction of the largest, in degrees from the first named component towards the second. They
    stand in one file, or in two that are named alike (K-NET, PEER, channel codes) or given as the
    only ones.

    --oscillator with --history makes another table, of the motion of oscillators at the record's
    samples: relative displacement and velocity, absolute acceleration.

    --fourier makes another table, of the amplitude of the acceleration's Fourier transform
    (sampling interval times the sum), smoothed over the frequency (Konno and Ohmachi 1998) unless
    --smoothing is none.

    --target without RECORD writes the design spectrum itself: displacement, pseudo-velocity,
    pseudo-acceleration.

    --against makes another table, of one column of a published spectrum and what is computed at its
    periods.
    """
    if not request.records:
        _write_target(request)
        return
    # The first that is asked for; options of the others are refused.
    choices: tuple[tuple[Any, type[Kind]], ...] = (
        (request.fourier, kinds.Fourier),
        (request.against, kinds.Against),
        (request.ductility or request.strength, kinds.Inelastic),
        (request.oscillator, kinds.Histories),
        (request.rotd, kinds.Rotated),
    )
    kind = next((asked_for for is_asked, asked_for in choices if is_asked), kinds.Elastic)()
    refuse_idle(kind.mode, MODES)
    make_tables(request, kind)


def _write_target(request: SpectrumRequest) -> None:
    """Write the table of a target spectrum, and its picture if asked for.

    Raises
    ------
    UsageError
        There is no target either; an option that is for records.
    TdintError
        The target cannot be read, or has no such periods; an output that cannot be written.
    """
    target = request.aim
    if target is None:
        raise UsageError("Missing argument 'RECORD...'. Without one, --target makes a table.")
    refuse_idle(kinds.TARGET, MODES)
    if request.is_folder:
        raise UsageError("-o is the file of one table here, not a folder")
    outputs = Outputs.checked(
        request.output, request.plot, request.overwrite, units=request.output_units
    )
    # Periods that were asked for, else the target's own; a formula has a value at 0, too.
    if request.periods is not None:
        periods = request.chosen_periods()
        if min(periods) <= 0.0 and target.curve is None:
            raise UsageError("--period 0: a target given as a table has positive periods")
        target = replace(target, periods=periods, psa=target.at(periods))
    elif target.curve:
        import numpy as np

        target = replace(
            target,
            periods=np.append(0.0, target.periods),
            psa=np.append(target.at([0.0]), target.psa),
        )
    # A logarithmic axis has no place for the period 0.
    drawn = replace(
        target, periods=target.periods[target.periods > 0.0], psa=target.psa[target.periods > 0.0]
    )
    from tdint.output.summary import table_summary
    from tdint.output.tables.spectra import TARGET
    from tdint.output.tables.table import Table

    table = Table.of_results(TARGET, [target])
    settings = {"target": target.source, "damping": target.damping}
    outputs.deliver(
        table,
        lambda: figures.spectrum_curves.target_picture(drawn, request.shown_units),
        lambda: table_summary("spectrum", settings, [], table.meanings),
    )
