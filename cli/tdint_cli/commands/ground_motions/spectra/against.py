"""Elastic spectra beside a published one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from tdint.analysis.spectra.defaults import PERIODS
from tdint_cli.commands.ground_motions.spectra import elastic
from tdint_cli.commands.ground_motions.spectra.kind import Kind, Results
from tdint_cli.options.spectra import option
from tdint_cli.options.values import FileName

if TYPE_CHECKING:
    from tdint.analysis.spectra.published import SpectrumDifference
    from tdint.files import Writer
    from tdint.ground_motion.record import Record
    from tdint.output.tables.table import Table
    from tdint_cli.commands.ground_motions.spectra.request import SpectrumRequest

against = option(
    "--against",
    type=FileName(),
    metavar="FILE",
    help="Difference to a published spectrum instead: CSV with names in its first line that say quantity and units "
    "(period_s, psa_g; T (s), SD (cm)); at its periods, unless others are given.",
)
column = option(
    "--against-column",
    needs="--against",
    metavar="NAME",
    help="Which column of the published spectrum, if it has several.",
)
interpolation = option(
    "--against-interpolation",
    needs="--against",
    type=click.Choice(["log-log"]),
    help="Take the published spectrum between its periods on straight lines in logarithms.",
)


def check(request: SpectrumRequest) -> None:
    """Refuse, before any work, what makes no sense together."""
    elastic.check(request)
    request.refuse(
        ("axes", "rotd", "ductility", "strength"), "has no published spectrum beside it; leave --against out"
    )
    for ratio in request.damping:
        request.published(ratio)


def compute(request: SpectrumRequest, records: Sequence[Record]) -> Results:
    """The spectra of each component with each damping ratio, and the published values."""
    from tdint.analysis.spectra.published import differences

    log_log = request.against_interpolation is not None
    own = request.periods is not None or bool(request.period)
    lines: list[SpectrumDifference] = []
    for ratio in request.damping:
        published = request.published(ratio)
        of_ratio = replace(request, damping=(ratio,))
        if not own:
            of_ratio = replace(of_ratio, period=tuple(published.periods.tolist()))
        lines += differences(elastic.compute(of_ratio, records).lines, published, log_log)
    return Results(lines, records, [_largest(line) for line in lines])


def _largest(line: SpectrumDifference) -> str:
    where = line.record.name
    if line.largest is None:
        return f"{where}: the published spectrum is zero"
    difference, period = line.largest
    return (
        f"{where}, damping {line.damping:g}: largest difference of {line.published.quantity} to "
        f"{line.published.source} {100.0 * difference:+.3g} % at {period:.4g} s"
    )


def table(request: SpectrumRequest, lines: Sequence[SpectrumDifference]) -> Table:
    """A row for each spectrum and period."""
    from tdint.output.tables.spectra import difference_table

    return difference_table(lines)


def picture(request: SpectrumRequest, lines: Sequence[SpectrumDifference], suffix: str) -> Writer:
    """Both spectra, and their difference."""
    from tdint.output.figures.spectra.published import difference_picture

    return difference_picture(lines, suffix, request.shown_units)


KIND = Kind("spectrum", PERIODS, check, compute, table, picture)
