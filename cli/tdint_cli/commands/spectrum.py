"""`tdint spectrum`: response spectra of records."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from io import BytesIO
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import TdintError, UsageError
from tdint_cli import inelastic, options
from tdint_cli.batch import Task, outcomes
from tdint_cli.errors import Failures
from tdint_cli.sources import records_of, refuse_inputs, sayings, tables_of
from tdint_cli.startup import load_numba
from tdint_cli.terminal import emit, say

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.analysis.spectrum import Manner
    from tdint.ground_motion.processing import Processing
    from tdint.ground_motion.record import Record
    from tdint.output.files import Writer

_SAMPLES_PER_PERIOD = 10


@dataclass(frozen=True)
class Request:
    """The command line of `tdint spectrum`."""

    records: tuple[str, ...]
    units: str | None
    component: str | None
    inventory: str | None
    processing: Processing
    damping: tuple[float, ...]
    periods: str | None
    period: tuple[float, ...]
    method: str | None
    maxima: str | None
    interpolation: str | None
    ductility: tuple[float, ...] | None
    strength: tuple[float, ...] | None
    hardening: float | None
    output: str | None
    plot: bool
    jobs: int
    overwrite: bool

    @property
    def is_folder(self) -> bool:
        """Whether -o names a folder: one that exists, or by a separator at its end."""
        output = self.output
        return output is not None and (output.endswith(("/", os.sep)) or Path(output).is_dir())

    @property
    def settings(self) -> dict[str, Any]:
        """All that the numbers depend on beside the records, for the JSON file."""
        from tdint.analysis.spectrum import DEFAULT_PERIODS, choose_manner

        manner = choose_manner(self.method, self.maxima, self.interpolation)
        settings = asdict(self)
        for name in ("records", "output", "plot", "jobs", "overwrite", "period"):
            del settings[name]
        settings["periods"] = list(self.period) or self.periods or DEFAULT_PERIODS
        settings["method"] = self.method or "exact"
        settings["hardening"] = self.inelastic.stiffness_ratio if self.inelastic else None
        settings |= {"maxima": manner.maxima.name, "interpolation": manner.interpolation.name}
        return settings

    @property
    def inelastic(self) -> inelastic.Wanted:
        """What is asked of oscillators that yield."""
        return inelastic.Wanted(self.ductility, self.strength, self.hardening)

    @property
    def stated(self) -> tuple[str, ...]:
        """What was chosen by name and therefore has a column."""
        return tuple(name for name in ("maxima", "interpolation") if getattr(self, name) is not None)


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
    spectra : tuple
        Kept only for a picture of several records.
    picture : bytes or None
        The picture of this record, if it has one of its own.
    """

    csv: bytes
    records: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]
    interval: float
    spectra: tuple[Any, ...] = ()
    picture: bytes | None = None


@dataclass
class Findings:
    """What there is to say at the end."""

    notes: dict[str, None] = field(default_factory=dict)  # a set in the order of arrival
    failures: list[TdintError] = field(default_factory=list)
    longest_interval: float = 0.0

    def take(self, product: Product) -> None:
        """Take up what is to be said of one record."""
        self.notes |= dict.fromkeys(product.notes)
        self.longest_interval = max(self.longest_interval, product.interval)


@click.command("spectrum")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True)
@options.units
@options.component
@options.inventory
@options.processing
@click.option(
    "--damping",
    type=click.FloatRange(0.0, 1.0, max_open=True),
    multiple=True,
    default=(0.05,),
    metavar="RATIO",
    help="Damping ratio, may be repeated; 0.05 by default.",
)
@click.option(
    "--periods",
    metavar="FIRST:LAST:COUNT",
    help="Periods in equal ratios, s; 0.01:10:200 by default, both ends included.",
)
@click.option(
    "--period",
    type=click.FloatRange(0.0),
    multiple=True,
    metavar="SECONDS",
    help="A single period, may be repeated; in place of --periods. 0 gives the peak ground acceleration.",
)
@options.method
@click.option(
    "--maxima",
    type=click.Choice(["exact", "peer", "samples"]),
    help="Where the largest values are looked for: between the samples, too (exact, the default), at ten or more steps "
    "per period (peer, as PEER's own spectra), or at the record's samples (samples, as those of USGS, and with "
    "--method). Adds a column.",
)
@click.option(
    "--interpolation",
    type=click.Choice(["linear", "band-limited"]),
    help="The ground motion between its samples: straight lines (linear, the default), or the motion without "
    "frequencies above half the sampling rate (band-limited). Adds a column.",
)
@inelastic.ductility
@inelastic.strength
@inelastic.hardening
@options.output(
    "FILE|DIR",
    "Write to this file instead of standard output; to one file per record in an existing folder or one that is named "
    "with a / at its end. What the records are and how the numbers came about stands in a JSON file beside each.",
)
@click.option("--plot", is_flag=True, help="Also draw each CSV file of -o, as PNG beside it.")
@options.jobs
@options.overwrite
@options.debug
def command(**given: Any) -> None:
    """Response spectra of ground-motion records, elastic and inelastic.

    RECORD is a file, or a folder for all records in it, - is standard input; all components are taken unless
    --component names one. CSV in SI units: relative displacement, pseudo-velocity, pseudo-acceleration, relative
    velocity and absolute acceleration, the largest from the first sample to the last, between the samples, too. They
    are exact for a ground motion that is linear between its samples, or come from --method with the record's sampling
    interval as its step. A record that fails does not keep the others from being done.

    --ductility and --strength make another table, of oscillators with bilinear hysteresis: yield force over weight,
    ductility, displacement at rest after the record, largest and yield displacement, yield force over mass, and largest
    elastic force over yield force.
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    _check(request)
    sources = records_of(request.records)
    tasks = _tasks(request, sources.files)
    manner = _manner(request)
    periods = _periods(request)
    findings = Findings(dict.fromkeys(sources.notes), list(sources.failures))
    together: list[Product] = []
    header = True
    work = partial(_work, request)
    with outcomes(work, tasks, jobs=request.jobs, label="spectra", to_terminal=request.output is None) as results:
        for task, outcome in zip(tasks, results, strict=True):
            if isinstance(outcome, TdintError):
                findings.failures.append(outcome)
                continue
            findings.take(outcome)
            if task.table:
                _write(request, task.table, [outcome])
            elif request.output:
                together.append(outcome)
            else:
                emit(outcome.csv if header else _without_header(outcome.csv))
                header = False
    if together:
        _write(request, Path(request.output or ""), together)
    _say_notes(findings, float(periods[periods > 0.0].min(initial=inf)), manner)
    if findings.failures:
        raise Failures(findings.failures)


def _check(request: Request) -> None:
    if request.periods is not None and request.period:
        raise UsageError("--periods and --period are given; leave one of them out")
    if request.plot and request.output is None:
        raise UsageError("--plot writes a file: add -o FILE or -o DIR")
    request.inelastic.refuse(
        {"--method": request.method, "--maxima": request.maxima, "--interpolation": request.interpolation}
    )


def _tasks(request: Request, files: Sequence[str]) -> list[Task]:
    """What to do, after it is clear that its outputs can be written."""
    from tdint.output.files import check_outputs

    folder = Path(request.output) if request.output and request.is_folder else None
    tables = tables_of(files, folder) if folder else [Path(request.output)] if request.output else []
    outputs = [file for table in tables for file in _files_of(request, table)]
    refuse_inputs(outputs, [*files, request.inventory])
    check_outputs(outputs, overwrite=request.overwrite, new_folder=request.is_folder)
    if folder is None:
        return [Task(file) for file in files]
    return [Task(file, table) for file, table in zip(files, tables, strict=True)]


def _files_of(request: Request, table: Path) -> list[Path]:
    """The files that are written with a table."""
    return [table, table.with_suffix(".json"), *([table.with_suffix(".png")] if request.plot else [])]


def _periods(request: Request) -> NDArray[np.float64]:
    load_numba()
    import numpy as np

    from tdint.analysis.spectrum import DEFAULT_PERIODS, parse_periods

    return np.array(request.period) if request.period else parse_periods(request.periods or DEFAULT_PERIODS)


def _manner(request: Request) -> Manner:
    load_numba()
    from tdint.analysis.spectrum import choose_manner

    return choose_manner(request.method, request.maxima, request.interpolation)


def _work(request: Request, task: Task) -> Product:
    """All that becomes of one record; it may run in another process."""
    from tdint.ground_motion.read import read_records
    from tdint.output.inelastic_tables import inelastic_table
    from tdint.output.summary import record_summary
    from tdint.output.tables import spectrum_table

    records = read_records(task.source, units=request.units, component=request.component, inventory=request.inventory)
    records = tuple(map(request.processing.apply, records))
    spectra = tuple(spectrum for record in records for spectrum in _spectra(request, record))
    table = inelastic_table(spectra) if request.inelastic else spectrum_table(spectra, request.stated)
    return Product(
        csv=table.csv(),
        records=tuple(map(record_summary, records)),
        notes=sayings(records, lambda record: record.notes),
        interval=records[0].dt,
        spectra=() if task.table or not request.plot else spectra,
        picture=_picture(request, spectra) if task.table and request.plot else None,
    )


def _spectra(request: Request, record: Record) -> Sequence[Any]:
    """The spectra of a record, elastic or of oscillators that yield, for each damping ratio."""
    from tdint.analysis.spectrum import spectrum

    periods = _periods(request)
    if request.inelastic:
        return request.inelastic.spectra(record, periods, request.damping)
    manner = {"method": request.method, "maxima": request.maxima, "interpolation": request.interpolation}
    return [spectrum(record, periods, damping, **manner) for damping in request.damping]


def _picture(request: Request, spectra: Sequence[Any]) -> bytes:
    from tdint.output.inelastic_plots import inelastic_picture
    from tdint.output.spectrum_plots import spectrum_picture

    stream = BytesIO()
    draw = inelastic_picture if request.inelastic else spectrum_picture
    draw(spectra, ".png")(stream)
    return stream.getvalue()


def _write(request: Request, table: Path, products: Sequence[Product]) -> None:
    """Write a table of the records of several files, or of one, with what goes beside it."""
    from tdint.output.files import write_files
    from tdint.output.summary import json_bytes, table_summary

    records = [record for product in products for record in product.records]
    contents = [
        b"".join([products[0].csv, *(_without_header(product.csv) for product in products[1:])]),
        json_bytes(table_summary("spectrum", request.settings, records)),
    ]
    if request.plot:
        spectra = [spectrum for product in products for spectrum in product.spectra]
        contents.append(products[0].picture or _picture(request, spectra))
    writers = {file: _writer(content) for file, content in zip(_files_of(request, table), contents, strict=True)}
    write_files(writers, overwrite=request.overwrite, new_folder=request.is_folder)


def _writer(content: bytes) -> Writer:
    return lambda stream: stream.write(content)


def _without_header(csv: bytes) -> bytes:
    return csv.partition(b"\n")[2]


def _say_notes(findings: Findings, shortest: float, manner: Manner) -> None:
    for note in findings.notes:
        say(f"note: {note}")
    limit = _SAMPLES_PER_PERIOD * findings.longest_interval
    if shortest < limit * (1.0 - 1e-9):
        say(
            f"note: below a period of {limit:.6g} s ({_SAMPLES_PER_PERIOD} sampling intervals) the ground motion "
            f"between its samples matters: taken as {manner.interpolation.words}, maxima {manner.maxima.words}"
        )
