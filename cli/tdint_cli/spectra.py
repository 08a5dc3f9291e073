"""What the commands share that make a table over the period of each record: options, outputs, the work itself."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tdint.errors import TdintError, UsageError
from tdint_cli import options
from tdint_cli.batch import Task, outcomes
from tdint_cli.errors import Failures
from tdint_cli.sources import records_of, refuse_inputs, sayings, tables_of
from tdint_cli.startup import load_numba
from tdint_cli.terminal import emit, say

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.files import Writer
    from tdint.ground_motion.processing import Processing
    from tdint.ground_motion.record import Record
    from tdint.output.tables.tables import Table

Command = TypeVar("Command", bound=Callable[..., Any])

_NOT_SETTINGS = ("records", "output", "plot", "jobs", "overwrite", "period")

damping = click.option(
    "--damping",
    type=options.damping_ratio,
    multiple=True,
    default=(0.05,),
    metavar="RATIO",
    help="Damping ratio, may be repeated; 0.05 by default.",
)
plot = click.option("--plot", is_flag=True, help="Also draw each CSV file of -o, as PNG beside it.")
output = options.output(
    "FILE|DIR",
    "Write to this file instead of standard output; to one file per record in an existing folder or one that is named "
    "with a / at its end. What the records are and how the numbers came about stands in a JSON file beside each.",
)


def periods(default: str, zero: str = "") -> Callable[[Command], Command]:
    """The options --periods and --period; `zero` says what a period of 0 gives, if it may be asked for."""
    several = click.option(
        "--periods",
        metavar="FIRST:LAST:COUNT",
        help=f"Periods in equal ratios, s; {default} by default, both ends included.",
    )
    single = click.option(
        "--period",
        type=click.FloatRange(0.0, min_open=not zero),
        multiple=True,
        metavar="SECONDS",
        help=f"A single period, may be repeated; in place of --periods.{zero}",
    )
    return lambda command: several(single(command))


@dataclass(frozen=True)
class Request:
    """What the command lines have in common."""

    records: tuple[str, ...]
    units: str | None
    component: str | None
    inventory: str | None
    processing: Processing
    damping: tuple[float, ...]
    periods: str | None
    period: tuple[float, ...]
    output: str | None
    plot: bool
    jobs: int
    overwrite: bool

    @property
    def is_folder(self) -> bool:
        """Whether -o names a folder: one that exists, or by a separator at its end."""
        output = self.output
        return output is not None and (output.endswith(("/", os.sep)) or Path(output).is_dir())

    def settings(self, default_periods: str) -> dict[str, Any]:
        """All that the numbers depend on beside the records, for the JSON file."""
        settings = {name: value for name, value in asdict(self).items() if name not in _NOT_SETTINGS}
        return settings | {"periods": list(self.period) or self.periods or default_periods}

    def chosen_periods(self, default: str) -> NDArray[np.float64]:
        """The periods, s.

        Raises
        ------
        UsageError
            They are given in two ways, or their text is wrong.
        """
        load_numba()
        import numpy as np

        from tdint.analysis.spectra.elastic import parse_periods

        if self.periods is not None and self.period:
            raise UsageError("--periods and --period are given; leave one of them out")
        return np.array(self.period) if self.period else parse_periods(self.periods or default)


@dataclass(frozen=True)
class Results:
    """What a command makes of one record.

    Attributes
    ----------
    lines : sequence
        Its results, one per line of a picture.
    records : sequence of Record
        The components that they are of.
    notes : sequence of str
        What there is to say beside the notes of the components.
    """

    lines: Sequence[Any]
    records: Sequence[Record]
    notes: Sequence[str] = ()


def _one_by_one(request: Any, files: Sequence[str]) -> list[tuple[str, ...]]:
    return [(file,) for file in files]


def _no_remark(request: Any, interval: float) -> str:
    return ""


@dataclass(frozen=True)
class Making:
    """What a command makes of records. All are functions of a module: other processes find them by name.

    Attributes
    ----------
    command : str
        The command's name.
    default_periods : str
        Where none are asked for.
    compute : callable
        From the request and the components of a record its results.
    table : callable
        From the request and results their table.
    picture : callable
        From the request, results and a suffix what draws them.
    remark : callable
        From the request and the longest sampling interval of all records (s) what is to be said at the end; empty for
        nothing.
    gather : callable
        From the request and all files the files of each record; by default each is a record by itself.
    """

    command: str
    default_periods: str
    compute: Callable[[Any, Sequence[Record]], Results]
    table: Callable[[Any, Sequence[Any]], Table]
    picture: Callable[[Any, Sequence[Any], str], Writer]
    remark: Callable[[Any, float], str] = _no_remark
    gather: Callable[[Any, Sequence[str]], list[tuple[str, ...]]] = _one_by_one


@dataclass(frozen=True)
class Product:
    """What becomes of one record.

    Attributes
    ----------
    csv : bytes
        The rows of all its components and damping ratios, after a header.
    records : tuple of dict
        What each component is, for the JSON file.
    notes : tuple of str
        What there is to say of it.
    interval : float
        Sampling interval, s.
    results : tuple
        Kept only for a picture of several records.
    picture : bytes or None
        The picture of this record, if it has one of its own.
    """

    csv: bytes
    records: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]
    interval: float
    results: tuple[Any, ...] = ()
    picture: bytes | None = None


@dataclass
class _Findings:
    """What there is to say at the end."""

    notes: dict[str, None] = field(default_factory=dict)  # a set in the order of arrival
    failures: list[TdintError] = field(default_factory=list)
    longest_interval: float = 0.0

    def take(self, product: Product) -> None:
        """Take up what is to be said of one record."""
        self.notes |= dict.fromkeys(product.notes)
        self.longest_interval = max(self.longest_interval, product.interval)


def make_tables(request: Request, making: Making) -> None:
    """Make the tables of a command line, and say what there is to say; one bad record does not keep the others back.

    Raises
    ------
    TdintError
        Wrong arguments or outputs, before any work; Failures of records, after the others are done.
    """
    if request.plot and request.output is None:
        raise UsageError("--plot writes a file: add -o FILE or -o DIR")
    sources = records_of(request.records)
    tasks = _tasks(request, making.gather(request, sources.files))
    findings = _Findings(dict.fromkeys(sources.notes), list(sources.failures))
    together: list[Product] = []
    header = True
    work = partial(_work, request, making)
    with outcomes(work, tasks, jobs=request.jobs, label="spectra", to_terminal=request.output is None) as results:
        for task, outcome in zip(tasks, results, strict=True):
            if isinstance(outcome, TdintError):
                findings.failures.append(outcome)
                continue
            findings.take(outcome)
            if task.table:
                _write(request, making, task.table, [outcome])
            elif request.output:
                together.append(outcome)
            else:
                emit(outcome.csv if header else _without_header(outcome.csv))
                header = False
    if together:
        _write(request, making, Path(request.output or ""), together)
    remark = making.remark(request, findings.longest_interval)
    for note in filter(None, (*findings.notes, remark)):
        say(f"note: {note}")
    if findings.failures:
        raise Failures(findings.failures)


def _tasks(request: Request, records: Sequence[tuple[str, ...]]) -> list[Task]:
    """What to do for the files of each record, after it is clear that its outputs can be written."""
    from tdint.files import check_outputs

    firsts = [files[0] for files in records]
    folder = Path(request.output) if request.output and request.is_folder else None
    tables = tables_of(firsts, folder) if folder else [Path(request.output)] if request.output else []
    outputs = [file for table in tables for file in _files_of(request, table)]
    refuse_inputs(outputs, [*(file for files in records for file in files), request.inventory])
    check_outputs(outputs, overwrite=request.overwrite, new_folder=request.is_folder)
    own = tables if folder else [None] * len(records)
    return [Task(files[0], table, files[1:]) for files, table in zip(records, own, strict=True)]


def _files_of(request: Request, table: Path) -> list[Path]:
    """The files that are written with a table."""
    return [table, table.with_suffix(".json"), *([table.with_suffix(".png")] if request.plot else [])]


def _work(request: Request, making: Making, task: Task) -> Product:
    """All that becomes of one record; it may run in another process."""
    load_numba()
    from tdint.ground_motion.reading.read import read_records
    from tdint.output.summaries.summary import record_summary

    read = partial(read_records, units=request.units, component=request.component, inventory=request.inventory)
    records = [request.processing.apply(record) for file in (task.source, *task.others) for record in read(file)]
    results = making.compute(request, records)
    lines = tuple(results.lines)
    return Product(
        csv=making.table(request, lines).csv(),
        records=tuple(map(record_summary, results.records)),
        notes=(*sayings(results.records, lambda record: record.notes), *results.notes),
        interval=max(record.dt for record in results.records),
        results=() if task.table or not request.plot else lines,
        picture=_picture(request, making, lines) if task.table and request.plot else None,
    )


def _picture(request: Request, making: Making, results: Sequence[Any]) -> bytes:
    stream = BytesIO()
    making.picture(request, results, ".png")(stream)
    return stream.getvalue()


def _write(request: Request, making: Making, table: Path, products: Sequence[Product]) -> None:
    """Write a table of the records of several files, or of one, with what goes beside it."""
    from tdint.files import write_files
    from tdint.output.summaries.summary import json_bytes, table_summary

    records = [record for product in products for record in product.records]
    settings = request.settings(making.default_periods)
    contents = [
        b"".join([products[0].csv, *(_without_header(product.csv) for product in products[1:])]),
        json_bytes(table_summary(making.command, settings, records)),
    ]
    if request.plot:
        results = [result for product in products for result in product.results]
        contents.append(products[0].picture or _picture(request, making, results))
    writers = {file: _writer(content) for file, content in zip(_files_of(request, table), contents, strict=True)}
    write_files(writers, overwrite=request.overwrite, new_folder=request.is_folder)


def _writer(content: bytes) -> Writer:
    return lambda stream: stream.write(content)


def _without_header(csv: bytes) -> bytes:
    return csv.partition(b"\n")[2]
