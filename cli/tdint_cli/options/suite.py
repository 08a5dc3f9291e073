"""Options of the commands with runs under a suite of ground motions, and names of their files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from tdint.errors import UsageError
from tdint.units import OutputUnits
from tdint_cli.options import record
from tdint_cli.options.grammar import BESIDE
from tdint_cli.options.output import check_picture
from tdint_cli.options.spectra import FloorRequest

PROFILES, PICTURE, RATIOS = "profiles.csv", "profiles.png", "ratios.csv"
"""Names of files in the directory of -o."""


PAIR_DEMAND = record.option(
    "--pair-demand",
    rare=True,
    type=click.Choice(("larger", "mean", "separate")),
    help="Treatment of the two horizontal components of a recording: one ground motion with the "
    "larger (default) or the mean demand of both, or two separate ground motions.",
)
"""The option --pair-demand."""


@dataclass(frozen=True, kw_only=True)
class SuiteRequest:
    """Common options of the commands with many runs: outputs, number of threads, drift limit,
    baseline, intensity measures of the ground motions."""

    output: str | None
    overwrite: bool
    output_units: OutputUnits | None
    plot: str | None
    report: str | None
    limit: float | str | None
    require: bool
    jobs: int | None
    of_floors: FloorRequest
    baseline: str | None = None
    im: tuple[str, ...] | None = None
    by: str | None = None
    report_head: tuple[tuple[str, str], ...] | None = None
    pair_demand: str | None = None

    def picture(self, folder: Path | None) -> Path | None:
        """Return the file of the figure, or None if no figure is requested.

        Raises
        ------
        UsageError
            The figure has no file name, and no directory is specified.
        """
        if self.plot is None:
            return None
        if self.plot != BESIDE:
            check_picture(Path(self.plot))
            return Path(self.plot)
        if folder is None:
            raise UsageError(
                "--plot without a file name requires -o; add -o DIR, or specify the file: "
                "--plot=FILE.png"
            )
        return folder / PICTURE
