"""`tdint info`: what records are and how strong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from tdint.errors import TdintError
from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.batch.processes import Task, outcomes
from tdint_cli.options.output import Outputs
from tdint_cli.options.record import RecordsRequest, notes_of_components
from tdint_cli.terminal import Failures, note, warn

if TYPE_CHECKING:
    from tdint.output.tables.spectra import RecordInfo
    from tdint.output.tables.table import Table


@options.request
class Request(RecordsRequest):
    """The command line of `tdint info`."""

    jobs: int = options.output.jobs
    outputs: Outputs

    @property
    def settings(self) -> dict[str, Any]:
        """How the records were read, for the JSON file."""
        names = ("units", "component", "inventory", "layout", "processing")
        return {name: value for name, value in asdict(self).items() if name in names}


@dataclass(frozen=True)
class Product:
    """What becomes of one record.

    Attributes
    ----------
    table : Table
        A row per component.
    records : tuple of dict
        What each component is, for the JSON file.
    infos : tuple of RecordInfo
        What stands in the rows, kept only where it may be drawn.
    changes : tuple of str
        What was done to the record on request.
    warnings : tuple of str
        What changes what its numbers mean.
    """

    table: Table
    records: tuple[dict[str, Any], ...]
    infos: tuple[RecordInfo, ...]
    changes: tuple[str, ...]
    warnings: tuple[str, ...]


@options.command(
    "info",
    "tdint info office-motion.txt",
    "tdint info office-motion.txt -o info.csv --plot",
    exits={4: "a record cannot be read; the others are done"},
)
@options.record.of_records
@options.output.to_files(
    "Write the table to this file instead of standard output, and what the records are to a JSON file beside it.",
    picture=options.output.PICTURE,
)
@options.of(Request)
def command(request: Request) -> None:
    """What ground-motion records are and how strong.

    RECORD is a file, or a folder for all records in it, - is standard input; all components are taken unless
    --component names one. CSV, a row each: samples, units and how they are known, peak acceleration,
    velocity and displacement (from rest, nothing corrected), Arias intensity and its significant durations, cumulative
    absolute velocity, Housner's spectrum intensity (5 % damping, 0.1 to 2.5 s), zeros at the ends, and notes on what
    was assumed or looks wrong. The measures are exact for a ground motion that is linear between its samples. The
    picture shows the first components. A record that fails does not keep the others from being done.
    """
    from tdint.ground_motion.reading.suites import records_of

    sources = records_of(request.records, request.layout)
    outputs = request.outputs
    notes = dict.fromkeys(sources.notes)  # a set in the order of arrival
    warnings: dict[str, None] = {}
    failures: list[TdintError] = list(sources.failures)
    products: list[Product] = []
    tasks = [Task(file) for file in sources.files]
    work = partial(_work, request)
    with outcomes(work, tasks, jobs=request.jobs, label="records", to_terminal=outputs.table is None) as results:
        for outcome in results:
            if isinstance(outcome, TdintError):
                failures.append(outcome)
            else:
                products.append(outcome)
                notes |= dict.fromkeys(outcome.changes)
                warnings |= dict.fromkeys(outcome.warnings)
    if products:
        _deliver(request, products)
    warn(*warnings)
    if outputs.picture and (left_out := _undrawn(products)):
        note(f"the picture shows the first components and leaves out {left_out} more")
    note(*notes)
    if failures:
        raise Failures(failures)


def _undrawn(products: Sequence[Product]) -> int:
    """How many components the picture has no room for."""
    return max(0, sum(len(product.infos) for product in products) - figures.comparison.MOST_RECORDS)


def _deliver(request: Request, products: Sequence[Product]) -> None:
    from tdint.output.summary import table_summary

    rows = [row for product in products for row in product.table.rows]
    records = [record for product in products for record in product.records]

    infos = [info for product in products for info in product.infos]
    table = replace(products[0].table, rows=rows)
    request.outputs.deliver(
        table,
        lambda: figures.comparison.info_picture(infos, request.outputs.shown_units),
        lambda: table_summary("info", request.settings, records, table.meanings),
    )


def _work(request: Request, task: Task) -> Product:
    """All components of a record; it may run in another process."""
    from tdint.output.summary import record_summary

    records = request.read(task.source)
    infos = list(map(tables.spectra.record_info, records))
    return Product(
        table=tables.spectra.info_table(infos),
        records=tuple(map(record_summary, records)),
        infos=tuple(infos) if request.outputs.picture else (),
        changes=notes_of_components(records, lambda record: record.processing),
        warnings=notes_of_components(records, lambda record: record.warnings),
    )
