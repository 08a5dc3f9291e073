"""A table over the period of each record: the work, the outputs, and what is said of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

from tdint.errors import OutputError, TdintError
from tdint.files import check_outputs, write_files
from tdint.input_bytes import STDIN
from tdint.output import figures
from tdint_cli.batch.processes import Task, outcomes
from tdint_cli.commands.ground_motions.spectrum_request import Kind, TablesRequest
from tdint_cli.drawing import reading_width, table_bytes
from tdint_cli.errors import Failures
from tdint_cli.options.output import SUFFIX, Outputs, beside, check_picture, picture_file, refuse_inputs
from tdint_cli.options.record import notes_of_components
from tdint_cli.terminal import emit, note, warn


@dataclass(frozen=True)
class RecordTable:
    """What becomes of one record.

    Attributes
    ----------
    text : bytes
        The rows of all its components and damping ratios, after a header: CSV, or drawn for a terminal.
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


@dataclass
class _Messages:
    """What there is to say at the end."""

    notes: dict[str, None] = field(default_factory=dict)  # a set in the order of arrival
    failures: list[TdintError] = field(default_factory=list)
    warnings: dict[str, None] = field(default_factory=dict)
    longest_interval: float = 0.0

    def take(self, product: RecordTable) -> None:
        """Take up what is to be said of one record."""
        self.notes |= dict.fromkeys(product.notes)
        self.warnings |= dict.fromkeys(product.warnings)
        self.longest_interval = max(self.longest_interval, product.interval)


def make_tables(request: TablesRequest, kind: Kind) -> None:
    """Make the tables of a command line, and say what there is to say; one bad record does not keep the others back.

    Raises
    ------
    TdintError
        Wrong arguments or outputs, before any work; Failures of records, after the others are done.
    """
    from tdint.ground_motion.reading.suites import records_of

    kind.check(request)
    request.check_plot()
    _ = request.chosen_periods(kind.default_periods)  # What is wrong with them is told before any work.
    sources = records_of(request.records, request.layout)
    tasks = _tasks(request, kind.gather(request, sources.files))
    messages = _Messages(dict.fromkeys(sources.notes), list(sources.failures))
    together: list[RecordTable] = []
    to_terminal = request.output is None
    width = reading_width() if to_terminal else None
    header = True
    work = partial(_work, request, kind, width)
    with outcomes(work, tasks, jobs=request.jobs, label="spectra", to_terminal=to_terminal) as results:
        for task, outcome in zip(tasks, results, strict=True):
            if isinstance(outcome, TdintError):
                messages.failures.append(outcome)
                continue
            messages.take(outcome)
            if task.table:
                _write(request, kind, task.table, [outcome])
                continue
            if request.output or request.plot:
                together.append(outcome if request.output else replace(outcome, text=b""))
            if to_terminal:
                emit(outcome.text if header or width else _without_header(outcome.text))
                header = False
    if together:
        _write(request, kind, Path(request.output) if request.output else None, together)
    remark = kind.remark(request, messages.longest_interval)
    warn(*messages.warnings)
    note(*filter(None, (*messages.notes, remark)))
    if messages.failures:
        from tdint.ground_motion.pairing import told_once

        raise Failures(told_once(messages.failures))


def _tasks(request: TablesRequest, records: Sequence[tuple[str, ...]]) -> list[Task]:
    """What to do for the files of each record, after it is clear that its outputs can be written."""
    output = Path(request.output) if request.output else None
    tables = tables_of([files[0] for files in records], output) if output and request.is_folder else [output]
    own = tables if request.is_folder else [None] * len(records)
    files = [file for table in tables for file in _outputs(request, table).files]
    refuse_inputs(files, [*(file for files in records for file in files), request.inventory])
    check_outputs(files, overwrite=request.overwrite)
    return [Task(files[0], table, files[1:]) for files, table in zip(records, own, strict=True)]


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


def _write(request: TablesRequest, kind: Kind, table: Path | None, products: Sequence[RecordTable]) -> None:
    """Write a table of the records of several files, or of one, with what goes beside it; or a picture alone."""
    from tdint.output.summary import in_units, json_bytes, table_summary

    outputs = _outputs(request, table)
    contents: dict[Path, bytes] = {}
    if outputs.table and outputs.summary:
        records = [record for product in products for record in product.records]
        summary = table_summary(kind.command, request.settings(kind.default_periods), records, products[0].meanings)
        rows = [_without_header(product.text) for product in products[1:]]
        contents[outputs.table] = b"".join([products[0].text, *rows])
        # The columns of the table are those of the products, in the units asked for already.
        own = {"columns": summary["columns"]}
        contents[outputs.summary] = json_bytes(in_units(summary, request.shown_units) | own)
    if outputs.picture:
        results = [result for product in products for result in product.results]
        contents[outputs.picture] = products[0].picture or _picture(request, kind, results, outputs.picture.suffix)
    if contents:
        write_files(contents, overwrite=request.overwrite)


def _without_header(csv: bytes) -> bytes:
    return csv.partition(b"\n")[2]


def tables_of(files: Sequence[str], folder: Path) -> list[Path]:
    """The CSV file in `folder` for each record: its name without suffix, or with it where several have the same stem.

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
                f"{table}: both {tables[table]} and {file} would be written to it; use -o FILE for all in one file, "
                "or one folder each"
            )
        tables[table] = file
    return list(tables)
