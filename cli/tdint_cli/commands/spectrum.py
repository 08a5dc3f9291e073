"""`tdint spectrum`: response spectra of records, or the table of a target spectrum."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from itertools import cycle
from pathlib import Path
from typing import Any

import click

from tdint.errors import OutputError, TdintError, UsageError
from tdint.files import STDIN, check_outputs, write_files
from tdint.output import figures
from tdint_cli import options
from tdint_cli.commands import spectrum_kinds as kinds
from tdint_cli.commands.spectrum_kinds import AXES, MODES, SpectrumRequest, TablesRequest, TableType
from tdint_cli.drawing import reading_width, table_bytes
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import BESIDE
from tdint_cli.options.output import SUFFIX, Outputs, beside, picture_file
from tdint_cli.options.record import notes_of_components
from tdint_cli.processes import Task, outcomes
from tdint_cli.terminal import Failures, emit, note, warn

# ---- A table over the period for each record: computation, outputs and messages


@dataclass(frozen=True, eq=False)
class RecordTable:
    """The table, the messages and the figure of a single record.

    Attributes
    ----------
    text : bytes
        Header and rows of all components and damping ratios: CSV, or formatted for a terminal.
    meanings : dict
        Descriptions of the columns, for the JSON file.
    interval : float
        Maximum sampling interval of the components, s.
    results : tuple
        Result objects; kept only for a figure of several records.
    picture : bytes | None
        The figure of the record, if each record has a separate figure.
    """

    text: bytes
    meanings: dict[str, dict[str, str]]
    records: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]
    interval: float
    warnings: tuple[str, ...]
    results: tuple[Any, ...] = ()
    picture: bytes | None = None


def make_tables(request: TablesRequest, table_type: TableType) -> None:
    """Compute and write a table over the period for each record, and print notes and warnings.

    The tables are written to separate files in a directory, or joined in a file or on standard
    output. A record that fails does not prevent the processing of the remaining records.

    Raises
    ------
    UsageError, OutputError
        Options cannot be used together, or an output cannot be written; raised before any
        computation.
    Failures
        Some records failed; raised after the remaining records are written.
    """
    from tdint.ground_motion.reading.suites import records_of

    table_type.check(request)
    if request.is_folder and request.plot not in (None, BESIDE):
        raise UsageError(
            "--plot=FILE is one figure of all records and cannot be used with -o DIR; use -o FILE, "
            "or --plot without a file for one figure per record"
        )
    sources = records_of(request.records, request.choice)
    # All outputs are checked before the computation, so that no result is lost.
    files_of_records = table_type.gather(request, sources.files)
    output = Path(request.output) if request.output else None
    # In a directory each record has a table. Otherwise all records share the table `output` (None
    # for standard output).
    tables: list[Path | None] = [output]
    if output and request.is_folder:
        tables = [*tables_of([files[0] for files in files_of_records], output)]
    output_files = [file for table in tables for file in _outputs(request, table).files]
    check_outputs(output_files, overwrite=request.overwrite)
    tasks = [
        Task(files[0], table, files[1:]) for files, table in zip(files_of_records, cycle(tables))
    ]
    # Dictionaries without values are used as sets that keep the order of insertion.
    notes, warnings = dict.fromkeys(sources.notes), dict[str, None]()
    failures, longest_interval, used = list[TdintError](sources.failures), 0.0, 0
    products: list[RecordTable] = []
    to_terminal = request.output is None
    width = reading_width() if to_terminal else None
    work = partial(_work, request, table_type, width)
    with outcomes(
        work, tasks, jobs=request.jobs, label="spectra", to_terminal=to_terminal
    ) as results:
        for task, outcome in zip(tasks, results, strict=True):
            if isinstance(outcome, TdintError):
                failures.append(outcome)
                continue
            used += 1 + len(task.others)
            notes |= dict.fromkeys(outcome.notes)
            warnings |= dict.fromkeys(outcome.warnings)
            longest_interval = max(longest_interval, outcome.interval)
            if request.is_folder:
                _write(request, table_type, task.table, [outcome])
                continue
            if to_terminal:
                # Text for a terminal has a header for each record, CSV a single header.
                emit(_without_header(outcome.text) if products and not width else outcome.text)
                outcome = replace(outcome, text=b"")
            products.append(outcome)
    if products:
        _write(request, table_type, output, products)
    last_note = table_type.remark(request, longest_interval)
    warn(*warnings)
    note(*filter(None, (*notes, last_note)), *sources.count_notes(used))
    if failures:
        from tdint.ground_motion.horizontals import combine_single_components

        raise Failures(combine_single_components(failures))


def _outputs(request: TablesRequest, table: Path | None) -> Outputs:
    """Return the paths of a table, its figure and its JSON file. `table` is `None` without -o."""
    picture = picture_file(request.plot, table)
    return Outputs(table, picture, beside(table, ".json") if table else None, request.overwrite)


def _work(
    request: TablesRequest, table_type: TableType, width: int | None, task: Task
) -> RecordTable:
    """Read a record and compute its table, and its figure if each record has a separate figure.

    This function may run in a worker process.

    `width` is the width of the terminal in characters; None for CSV.
    """
    from tdint.output.summary import record_summary

    records = [record for file in (task.source, *task.others) for record in request.read(file)]
    results = table_type.compute(request, records)
    lines = tuple(results.lines)
    table = table_type.table(request, lines).in_units(request.shown_units)
    return RecordTable(
        text=table_bytes(table, width),
        meanings=table.meanings,
        records=tuple(map(record_summary, results.records)),
        notes=(*notes_of_components(results.records, lambda record: record.notes), *results.notes),
        interval=max(record.dt for record in results.records),
        warnings=notes_of_components(results.records, lambda record: record.warnings),
        results=() if request.is_folder or not request.plot else lines,
        picture=_picture(request, table_type, lines, SUFFIX)
        if request.is_folder and request.plot
        else None,
    )


def _picture(
    request: TablesRequest, table_type: TableType, results: Sequence[Any], suffix: str
) -> bytes:
    """Return the figure of some results as bytes, in the format of a file name suffix."""
    stream = BytesIO()
    figures.style.picture(suffix, lambda: table_type.picture(request, results))(stream)
    return stream.getvalue()


def _write(
    request: TablesRequest,
    table_type: TableType,
    table: Path | None,
    products: Sequence[RecordTable],
) -> None:
    """Write a table with the rows of several records, its JSON file and its figure.

    `table` is the file of the table; None to write only the figure.
    """
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
        # The descriptions of the columns are already in the requested units, and are not converted
        # again.
        converted = {"columns": summary["columns"]}
        contents[outputs.summary] = options.output.summary_bytes(
            summary, request.shown_units, converted=converted
        )
    if outputs.picture:
        results = [result for product in products for result in product.results]
        # A product contains a figure only with -o DIR. It is then the only product of its table.
        # Otherwise one figure shows the results of all records.
        contents[outputs.picture] = products[0].picture or _picture(
            request, table_type, results, outputs.picture.suffix
        )
    write_files(contents, overwrite=request.overwrite)


def _without_header(csv: bytes) -> bytes:
    """Return CSV text without its first line."""
    return csv.partition(b"\n")[2]


def tables_of(
    files: Sequence[str],
    folder: Path,
    suffix: str = ".csv",
    one_file: str = "-o FILE for one table",
) -> list[Path]:
    """Return the output file in a directory for each record; `one_file` is the remedy in the error.

    The name of the file is the name of the record without its suffix, or with its suffix if
    several records have the same stem.

    Raises
    ------
    OutputError
        Two records would be written to the same file.
    """
    stems = ["stdin" if file == STDIN else Path(file).stem for file in files]
    count = Counter(stems)
    record_of_table: dict[Path, str] = {}
    for file, stem in zip(files, stems, strict=True):
        name = stem if count[stem] == 1 or file == STDIN else Path(file).name
        table = folder / f"{name}{suffix}"
        if table in record_of_table:
            raise OutputError(
                f"{table}: both {record_of_table[table]} and {file} would be written to this file; "
                f"use {one_file} of all records, or separate calls with separate directories"
            )
        record_of_table[table] = file
    return list(record_of_table)


# ---- Spectrum


@options.command(
    "spectrum",
    "tdint spectrum office-motion.txt --damping 2%,5% -o spectrum.csv --plot",
    "tdint spectrum office-motion.txt --period 0.5,1 --ductility 2,4",
    exits={4: "a record cannot be read; the remaining records are processed"},
)
@options.record.optional_record_options
@options.record.one_scale
@options.spectra.tables_of_records(AXES)
@options.of(SpectrumRequest)
def command(request: SpectrumRequest) -> None:
    """Compute elastic, inelastic or Fourier spectra of ground-motion records.

    RECORD is a file, a directory (all records in it), or - for standard input. All components are
    used unless --component selects one. CSV: relative displacement, pseudo-velocity,
    pseudo-acceleration, relative velocity and absolute acceleration: maxima also between the
    samples and in the free vibration after the last sample. The values are exact for a ground
    motion that is linear between its samples and at rest after them; with --method they are
    integrated with the sampling interval as time step. If a record fails, the remaining records are
    processed.

    --ductility, --strength and --reduction write a different table, for oscillators with bilinear
    hysteresis: yield force divided by weight, ductility, residual displacement, maximum and yield
    displacement, yield force divided by mass, and maximum elastic force divided by yield force.

    --rotd writes a different table, for two horizontal components: percentiles of the
    pseudo-acceleration over 180 directions, the geometric mean of both components, and the
    direction of the maximum, in degrees from the first named component towards the second. The
    components are in one file, in two files with matching names (K-NET, PEER, channel codes), or
    in the only two files given.

    --oscillator with --history writes a different table: relative displacement, relative velocity
    and absolute acceleration of oscillators at the samples of the record.

    --fourier writes a different table: the amplitude of the Fourier transform of the acceleration
    (sampling interval times the sum), smoothed over the frequency (Konno and Ohmachi 1998) unless
    --smoothing is none.

    --target without RECORD writes a table of the design spectrum: displacement, pseudo-velocity,
    pseudo-acceleration.

    --against writes a different table: one column of a published spectrum, and the computed values
    at its periods.
    """
    if not request.records:
        _write_target(request)
        return
    # Use the first type of table that is requested; the options of the other types are refused.
    table_type: TableType = kinds.Elastic()
    choices: tuple[tuple[Any, type[TableType]], ...] = (
        (request.fourier, kinds.Fourier),
        (request.against, kinds.Against),
        (request.ductility or request.strength or request.reduction, kinds.Inelastic),
        (request.oscillator, kinds.Histories),
        (request.rotd, kinds.Rotated),
    )
    for option_value, requested_type in choices:
        if option_value:
            table_type = requested_type()
            break
    refuse_idle(table_type.mode, MODES)
    make_tables(request, table_type)


def _write_target(request: SpectrumRequest) -> None:
    """Write the table of a target spectrum, and its figure if requested. UsageError is raised if
    neither RECORD nor --target is given, or an option requires records.
    """
    target = request.target_spectrum
    if target is None:
        raise UsageError(
            "Missing argument 'RECORD...'. Add record files, or --target SPECTRUM to write the "
            "table of a target spectrum."
        )
    refuse_idle(kinds.TARGET, MODES)
    if request.is_folder:
        raise UsageError(
            f"-o {request.output}: must be a file, because --target without RECORD writes one table"
        )
    outputs = Outputs.checked(
        request.output, request.plot, request.overwrite, units=request.output_units
    )
    # Use the requested periods, otherwise the periods of the target. A formula also has a value at
    # the period 0.
    if request.periods is not None:
        periods = request.chosen_periods()
        if min(periods) <= 0.0 and target.curve is None:
            raise UsageError(
                "--period 0: the periods of a target given as a table must be positive; remove 0"
            )
        target = replace(target, periods=periods, psa=target.at(periods))
    elif target.curve:
        import numpy as np

        target = replace(
            target,
            periods=np.append(0.0, target.periods),
            psa=np.append(target.at([0.0]), target.psa),
        )
    # A logarithmic axis cannot show the period 0.
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
