"""Spectra of two horizontal components together, over all directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from tdint.analysis.spectra.defaults import PERIODS
from tdint.errors import RecordError
from tdint_cli.batch.sources import STDIN
from tdint_cli.commands.ground_motions.spectra.elastic import remark
from tdint_cli.commands.ground_motions.spectra.kind import Kind, Results
from tdint_cli.options.spectra import option

if TYPE_CHECKING:
    from tdint.analysis.spectra.rotated import RotatedSpectrum
    from tdint.files import Writer
    from tdint.ground_motion.record import Record
    from tdint.output.tables.table import Table
    from tdint_cli.commands.ground_motions.spectra.request import SpectrumRequest

rotd = option(
    "--rotd",
    type=click.IntRange(0, 100),
    many=True,
    metavar="P,...",
    help="Spectra of two horizontal components instead: these percentiles of the pseudo-acceleration over all "
    "directions, such as 0,50,100 (RotD00, RotD50, RotD100).",
)


def check(request: SpectrumRequest) -> None:
    """Refuse, before any work, what makes no sense together."""
    request.refuse(("axes", "method", "component"), "is for single components; leave it out with --rotd")
    _ = request.manner


def gather(request: SpectrumRequest, files: Sequence[str]) -> list[tuple[str, ...]]:
    """The files of each motion: those that are named alike but for the component, in the order of the first ones.

    Two files of a single horizontal component each are one motion, too, whatever their names are.
    """
    from tdint.ground_motion.horizontals import motion_name

    motions: dict[str, list[str]] = {}
    for file in files:
        motions.setdefault(file if file == STDIN else motion_name(file), []).append(file)
    result = [tuple(members) for members in motions.values()]
    if len(files) == len(result) == 2 and STDIN not in files and all(_is_single(request, file) for file in files):
        return [tuple(files)]
    return result


def _is_single(request: SpectrumRequest, file: str) -> bool:
    from tdint.ground_motion.horizontals import is_vertical
    from tdint.ground_motion.reading.read import read_records

    try:
        records = read_records(file, units=request.units, inventory=request.inventory, layout=request.layout)
    except RecordError:
        return False  # It will be told when its turn comes.
    return sum(not is_vertical(record.component) for record in records) == 1


def compute(request: SpectrumRequest, records: Sequence[Record]) -> Results:
    """The spectra of the two horizontals among the components of a motion, for each damping ratio."""
    from tdint.analysis.spectra.rotated import rotated_spectrum
    from tdint.ground_motion.horizontals import find_horizontals

    motion = find_horizontals(records)
    periods = request.chosen_periods(PERIODS)
    lines = [
        rotated_spectrum(
            motion,
            periods,
            damping,
            request.rotd or (),
            maxima=request.maxima,
            interpolation=request.interpolation,
        )
        for damping in request.damping
    ]
    return Results(lines, (motion.first, motion.second), [f"{motion.source}: {note}" for note in motion.notes])


def table(request: SpectrumRequest, lines: Sequence[RotatedSpectrum]) -> Table:
    """A row for each damping ratio and period."""
    from tdint.output.tables.spectra import rotated_table

    return rotated_table(lines, request.stated)


def picture(request: SpectrumRequest, lines: Sequence[RotatedSpectrum], suffix: str) -> Writer:
    """A line for each percentile."""
    from tdint.output.figures.spectra.rotated import rotated_picture

    return rotated_picture(lines, suffix, request.shown_units)


KIND = Kind("spectrum", PERIODS, check, compute, table, picture, remark, gather)
