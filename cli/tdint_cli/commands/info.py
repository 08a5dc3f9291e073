"""`tdint info`: what records are and how strong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import TdintError
from tdint_cli import options
from tdint_cli.batch import Task, outcomes
from tdint_cli.errors import Failures
from tdint_cli.laboratory import Outputs
from tdint_cli.sources import records_of, refuse_inputs
from tdint_cli.startup import load_numba
from tdint_cli.terminal import say

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record
    from tdint.output.files import Writer
    from tdint.output.record_tables import RecordInfo
    from tdint.output.tables import Table

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
    jobs: int
    overwrite: bool


@dataclass(frozen=True)
class Product:
    """What becomes of one record: its rows of the table and, where they may be drawn, what stands in them."""

    table: Table
    infos: tuple[RecordInfo, ...]


@click.command("info")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True)
@options.units
@options.component
@options.inventory
@options.output("FILE", "Write the table to this file instead of standard output.")
@options.picture
@options.jobs
@options.overwrite
@options.debug
def command(**given: Any) -> None:
    """What ground-motion records are and how strong.

    RECORD is a file, or a folder for all records in it, - is standard input; all components are taken unless
    --component names one. CSV in SI units, a row each: samples, units and how they are known, peak acceleration,
    velocity and displacement (from rest, nothing corrected), Arias intensity and its significant durations, cumulative
    absolute velocity, Housner's spectrum intensity (5 % damping, 0.1 to 2.5 s), zeros at the ends, and notes on what
    was assumed or looks wrong. The measures are exact for a ground motion that is linear between its samples. The
    picture shows the first components. A record that fails does not keep the others from being done.
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    sources = records_of(request.records)
    outputs = Outputs.checked(request.output, request.plot, request.overwrite)
    refuse_inputs([file for file in (outputs.table, outputs.picture) if file], [*sources.files, request.inventory])
    failures: list[TdintError] = list(sources.failures)
    products: list[Product] = []
    tasks = [Task(file) for file in sources.files]
    work = partial(_work, request)
    with outcomes(work, tasks, jobs=request.jobs, label="records", to_terminal=request.output is None) as results:
        for outcome in results:
            if isinstance(outcome, TdintError):
                failures.append(outcome)
            else:
                products.append(outcome)
    if products:
        _deliver(outputs, products)
    for note in sources.notes:
        say(f"note: {note}")
    if failures:
        raise Failures(failures)


def _deliver(outputs: Outputs, products: Sequence[Product]) -> None:
    rows = [row for product in products for row in product.table.rows]

    def draw(suffix: str) -> Writer:
        from tdint.output.record_plots import info_picture

        return info_picture([info for product in products for info in product.infos], suffix)

    outputs.deliver(replace(products[0].table, rows=rows), draw)


def _work(request: Request, task: Task) -> Product:
    """All components of a record; it may run in another process."""
    load_numba()
    from tdint.ground_motion.measures import measure
    from tdint.ground_motion.read import read_records
    from tdint.output.record_tables import RecordInfo, info_table

    records = read_records(task.source, units=request.units, component=request.component, inventory=request.inventory)
    infos = [RecordInfo(record, measure(record), _housner_intensity(record)) for record in records]
    return Product(info_table(infos), tuple(infos) if request.plot else ())


def _housner_intensity(record: Record) -> float:
    import numpy as np

    from tdint.analysis.spectrum import spectrum
    from tdint.ground_motion.measures import HOUSNER_PERIODS, spectrum_intensity

    periods = np.linspace(*HOUSNER_PERIODS, _PERIODS)
    return spectrum_intensity(periods, spectrum(record, periods, _DAMPING).psv)
