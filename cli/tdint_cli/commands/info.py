"""`tdint info`: what records are and how strong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import RecordError, TdintError, UsageError
from tdint_cli import options
from tdint_cli.errors import Failures
from tdint_cli.laboratory import Outputs

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record
    from tdint.output.files import Writer
    from tdint.output.record_tables import RecordInfo

_DAMPING = 0.05
_PERIODS = 481
"""Periods of the spectrum whose integral is the Housner intensity: 0.005 s apart."""


@dataclass(frozen=True)
class Request:
    """The command line of `tdint info`."""

    records: tuple[str, ...]
    units: str | None
    component: str | None
    inventory: str | None
    output: str | None
    plot: str | None
    overwrite: bool


@click.command("info")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True)
@options.units
@options.component
@options.inventory
@options.output("FILE", "Write the table to this file instead of standard output.")
@options.picture
@options.overwrite
@options.debug
def command(**given: Any) -> None:
    """What ground-motion records are and how strong.

    RECORD is a file, - is standard input; all its components are taken unless --component names one. CSV in SI units,
    a row each: samples, units and how they are known, peak acceleration, velocity and displacement (from rest, nothing
    corrected), Arias intensity and its significant durations, cumulative absolute velocity, Housner's spectrum
    intensity (5 % damping, 0.1 to 2.5 s), zeros at the ends, and notes on what was assumed or looks wrong. The measures
    are exact for a ground motion that is linear between its samples. The picture shows the first components. A record
    that fails does not keep the others from being done.
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    from tdint.output.record_tables import info_table

    if request.records.count("-") > 1:
        raise UsageError("standard input (-) can be read only once")
    outputs = Outputs.checked(request.output, request.plot, request.overwrite)
    failures: list[TdintError] = []
    infos = [info for source in request.records for info in _infos(source, request, failures)]

    def draw(suffix: str) -> Writer:
        from tdint.output.record_plots import info_picture

        return info_picture(infos, suffix)

    if infos:
        outputs.deliver(info_table(infos), draw)
    if failures:
        raise Failures(failures)


def _infos(source: str, request: Request, failures: list[TdintError]) -> Iterator[RecordInfo]:
    """All components of a record; none, and a failure noted, if it cannot be read."""
    from tdint.ground_motion.measures import measure
    from tdint.ground_motion.read import read_records
    from tdint.output.record_tables import RecordInfo

    try:
        records = read_records(source, units=request.units, component=request.component, inventory=request.inventory)
    except RecordError as error:
        failures.append(error)
        return
    for record in records:
        yield RecordInfo(record, measure(record), _housner_intensity(record))


def _housner_intensity(record: Record) -> float:
    import numpy as np

    from tdint.analysis.spectrum import spectrum
    from tdint.ground_motion.measures import HOUSNER_PERIODS, spectrum_intensity

    periods = np.linspace(*HOUSNER_PERIODS, _PERIODS)
    return spectrum_intensity(periods, spectrum(record, periods, _DAMPING).psv)
