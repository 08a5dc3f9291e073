"""`tdint spectrum`: elastic response spectra of records."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import AnalysisError, OutputError, RecordError, TdintError, UsageError
from tdint_cli import options
from tdint_cli.errors import Failures
from tdint_cli.startup import load_numba
from tdint_cli.terminal import emit, say

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.analysis.spectrum import Spectrum
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
    damping: tuple[float, ...]
    periods: str | None
    period: tuple[float, ...]
    method: str | None
    output: str | None
    plot: bool
    overwrite: bool


@dataclass(frozen=True)
class Job:
    """Records whose spectra go to one place: a CSV file (standard output if None) and, if asked for, a picture."""

    records: tuple[str, ...]
    csv: Path | None = None
    picture: Path | None = None

    @property
    def files(self) -> list[Path]:
        """The files that it writes."""
        return [file for file in (self.csv, self.picture) if file is not None]


@dataclass
class Findings:
    """What there is to say at the end."""

    notes: dict[str, None] = field(default_factory=dict)  # a set in the order of arrival
    failures: list[TdintError] = field(default_factory=list)
    longest_interval: float = 0.0

    def take(self, records: Sequence[Record]) -> None:
        """Take up what is to be said of the components of one file; what holds for all of them is said once."""
        for record in records:
            for note in record.notes:
                common = all(note in other.notes for other in records)
                whose = record.source if common else f"{record.source}: {record.component or record.id}"
                self.notes[f"{whose}: {note}"] = None
            self.longest_interval = max(self.longest_interval, record.dt)


@click.command("spectrum")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True)
@options.units
@options.component
@options.inventory
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
    type=click.FloatRange(0.0, min_open=True),
    multiple=True,
    metavar="SECONDS",
    help="A single period, may be repeated; in place of --periods.",
)
@options.method
@options.output(
    "FILE|DIR",
    "Write to this file instead of standard output; to one file per record in an existing folder or one that is named "
    "with a / at its end.",
)
@click.option("--plot", is_flag=True, help="Also draw each CSV file of -o, as PNG beside it.")
@options.overwrite
@options.debug
def command(**given: Any) -> None:
    """Elastic response spectra of ground-motion records.

    RECORD is a file, - is standard input; all its components are taken unless --component names one. CSV in SI units:
    relative displacement, pseudo-velocity, pseudo-acceleration, relative velocity and absolute acceleration, the
    largest at the samples. They are exact for a ground motion that is linear between its samples, or come from
    --method with the record's sampling interval as its step. A record that fails does not keep the others from
    being done.
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    from tdint.methods.catalogue import parse
    from tdint.output.files import check_outputs

    _check(request)
    jobs = _jobs(request)
    check_outputs(
        (file for job in jobs for file in job.files), overwrite=request.overwrite, new_folder=_is_folder(request)
    )
    if request.method is not None:
        parse(request.method)
    periods = _periods(request)
    findings = Findings()
    header = True
    for job in jobs:
        spectra = [spectrum for source in job.records for spectrum in _spectra(source, request, periods, findings)]
        if spectra:
            _write(job, spectra, request, header)
            header = False
    _say_notes(findings, float(periods.min()))
    if findings.failures:
        raise Failures(findings.failures)


def _check(request: Request) -> None:
    if request.periods is not None and request.period:
        raise UsageError("--periods and --period are given; leave one of them out")
    if request.plot and request.output is None:
        raise UsageError("--plot writes a file: add -o FILE or -o DIR")
    if request.records.count("-") > 1:
        raise UsageError("standard input (-) can be read only once")


def _is_folder(request: Request) -> bool:
    """Whether -o names a folder: one that exists, or by a separator at its end."""
    output = request.output
    return output is not None and (output.endswith(("/", os.sep)) or Path(output).is_dir())


def _jobs(request: Request) -> list[Job]:
    if request.output is None:
        return [Job((source,)) for source in request.records]
    if not _is_folder(request):
        return [_job(request, request.records, Path(request.output))]
    folder = Path(request.output)
    jobs: dict[str, Job] = {}
    for source in request.records:
        stem = "stdin" if source == "-" else Path(source).stem
        if stem in jobs:
            raise OutputError(
                f"{folder / stem}.csv: both {jobs[stem].records[0]} and {source} would be written to it; "
                "use -o FILE for all in one file, or one folder each"
            )
        jobs[stem] = _job(request, (source,), folder / f"{stem}.csv")
    return list(jobs.values())


def _job(request: Request, records: tuple[str, ...], csv: Path) -> Job:
    return Job(records, csv, csv.with_suffix(".png") if request.plot else None)


def _periods(request: Request) -> NDArray[np.float64]:
    load_numba()
    import numpy as np

    from tdint.analysis.spectrum import DEFAULT_PERIODS, parse_periods

    return np.array(request.period) if request.period else parse_periods(request.periods or DEFAULT_PERIODS)


def _spectra(source: str, request: Request, periods: NDArray[np.float64], findings: Findings) -> Iterator[Spectrum]:
    """Spectra of all components of a record and damping ratios; none, and a failure noted, if one cannot be had."""
    from tdint.analysis.spectrum import spectrum
    from tdint.ground_motion.read import read_records

    try:
        records = read_records(source, units=request.units, component=request.component, inventory=request.inventory)
        spectra = [
            spectrum(record, periods, damping, method=request.method)
            for record in records
            for damping in request.damping
        ]
    except RecordError as error:
        findings.failures.append(error)
        return
    except AnalysisError as error:
        findings.failures.append(AnalysisError(f"{source}: {error}"))
        return
    findings.take(records)
    yield from spectra


def _write(job: Job, spectra: list[Spectrum], request: Request, header: bool) -> None:
    from tdint.output.files import write_files
    from tdint.output.tables import spectrum_table

    table = spectrum_table(spectra)
    if job.csv is None:
        emit(table.csv(header=header))
        return
    files: dict[Path, Writer] = {job.csv: lambda stream: stream.write(table.csv())}
    if job.picture is not None:
        from tdint.output.plots import spectrum_picture

        files[job.picture] = spectrum_picture(spectra, job.picture.suffix)
    write_files(files, overwrite=request.overwrite, new_folder=_is_folder(request))


def _say_notes(findings: Findings, shortest: float) -> None:
    for note in findings.notes:
        say(f"note: {note}")
    limit = _SAMPLES_PER_PERIOD * findings.longest_interval
    if shortest < limit * (1.0 - 1e-9):
        say(
            f"note: below a period of {limit:.6g} s ({_SAMPLES_PER_PERIOD} sampling intervals) the ground motion "
            "between samples matters more than the method"
        )
