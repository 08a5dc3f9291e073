"""`tdint spectrum --rotd`: the option, the files of two horizontal components, and what becomes of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from tdint.errors import RecordError, UsageError
from tdint_cli import options, spectra
from tdint_cli.sources import STDIN

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.ground_motion.record import Record

rotd = click.option(
    "--rotd",
    type=options.Numbers(click.IntRange(0, 100)),
    metavar="P[,P...]",
    help="Spectra of two horizontal components instead: these percentiles of the pseudo-acceleration over all "
    "directions, such as 0,50,100 (RotD00, RotD50, RotD100).",
)


def refuse(others: dict[str, object]) -> None:
    """Raise UsageError for an option, by its name, that has no meaning for two components together."""
    for option, value in others.items():
        if value is not None:
            raise UsageError(f"{option} is for single components; leave it out with --rotd")


def gather(request: spectra.Request, files: Sequence[str]) -> list[tuple[str, ...]]:
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


def _is_single(request: spectra.Request, file: str) -> bool:
    from tdint.ground_motion.horizontals import is_vertical
    from tdint.ground_motion.reading.read import read_records

    try:
        records = read_records(file, units=request.units, inventory=request.inventory)
    except RecordError:
        return False  # It will be told when its turn comes.
    return sum(not is_vertical(record.component) for record in records) == 1


def compute(
    records: Sequence[Record],
    periods: NDArray[np.float64],
    dampings: Sequence[float],
    percentiles: Sequence[int],
    manner: dict[str, str | None],
) -> spectra.Results:
    """The spectra of the two horizontals among the components of a motion."""
    from tdint.analysis.spectra.rotated import rotated_spectrum
    from tdint.ground_motion.horizontals import find_horizontals

    motion = find_horizontals(records)
    lines = [rotated_spectrum(motion, periods, damping, percentiles, **manner) for damping in dampings]
    return spectra.Results(lines, (motion.first, motion.second), [f"{motion.source}: {note}" for note in motion.notes])
