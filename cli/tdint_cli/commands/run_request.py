"""The command line of `tdint run`, for one record and for several records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from tdint.errors import UsageError
from tdint.files import check_outputs
from tdint.units import SI, OutputUnits
from tdint_cli import options
from tdint_cli.options.analysis import BuildingRequest, check_motion
from tdint_cli.options.option_types import BESIDE, FileName, Number
from tdint_cli.options.output import picture_file
from tdint_cli.options.spectra import MOTIONS, SPECTRA, SPECTRA_PICTURE
from tdint_cli.options.suite import LIMIT, SuiteRequest

STORIES, HISTORY, PICTURE, SUMMARY = "stories.csv", "history.csv", "response.png", "summary.json"
ELEMENTS = "elements.csv"
ATTACHMENTS, LINKS, CONTACTS = "attachments.csv", "links.csv", "contacts.csv"
ROWS = "rows.csv"
RESULTANTS = "resultants.csv"
_OF_DIRECTIONS = (ELEMENTS, ATTACHMENTS, LINKS, CONTACTS, SPECTRA, SPECTRA_PICTURE, MOTIONS)
ALL_FILES = (
    *(STORIES, RESULTANTS, ROWS),
    *(f"{direction}{name}" for direction in ("", "x-", "y-") for name in _OF_DIRECTIONS),
    *(HISTORY, PICTURE, SUMMARY),
)
"""All files that a single run or a sequence can write to the directory of -o. The summary is
written last: if its status is `done`, all files are complete."""


@options.request
class Request(BuildingRequest, SuiteRequest):
    """The command line of `tdint run`."""

    shocks: tuple[str, ...] = ()
    """The record files of a sequence; empty for a run under one record."""

    records: tuple[str, ...] = options.argument("[RECORD]...", nargs=-1, type=FileName())
    factors: str | None = options.option()
    sequence: bool = options.option()
    rest: float | None = options.option(type=Number(0.0))
    method: str | None = options.analysis.method
    dt: float | None = options.option()
    duration: float | None = options.option()
    until_rest: bool = options.option()
    output: str | None = options.output.output
    history: str | None = options.option(is_flag=False, flag_value=BESIDE)
    history_every: int = options.option(default=1)
    export_floors: str | None = options.option(type=click.Choice(["mseed"]))
    plot: str | None = options.output.plot
    report: str | None = options.output.report
    output_units: OutputUnits | None = options.option()
    overwrite: bool = options.option()
    changed: bool = options.option()
    check: bool | None = options.option("--check/--no-check", default=None)
    tolerance: float | None = options.option()
    limit: float | str | None = LIMIT
    require: bool = options.option()
    pair_demand: str | None = options.option()
    allow_unstable: bool = options.option()
    jobs: int | None = options.option()
    changes: dict[str, str] = options.analysis.changes

    def check_sequence(self) -> None:
        """Raise UsageError if the records or the factors of --sequence are invalid.

        A sequence requires at least two files, and one factor for all events or a factor per event.
        """
        count, factors = len(self.shocks), len(self.scale or (1.0,))
        if count < 2:
            raise UsageError(
                f"--sequence requires two or more records, got {count}; list them after the model"
            )
        if "-" in self.shocks:
            raise UsageError("the records of a sequence must be files, not standard input")
        if factors not in (1, count):
            raise UsageError(
                f"--scale must have one factor for all events, or one factor for each of {count} "
                f"events, got {factors} factors"
            )

    def check_files(self) -> None:
        """Check the options of the outputs and of the ground motion before any computation.

        Raises
        ------
        UsageError
            Options cannot be used together.
        OutputError
            An output file exists without --overwrite, or cannot be written.
        """
        history = self.history_file
        self.floor_request.check(self.output, self.export_floors)
        # `check_motion` refuses different scale factors, which the events of a sequence may have.
        # `check_sequence` has already checked their number.
        check_motion(replace(self, scale=None) if self.sequence else self)
        picture = self.picture_file
        report = Path(self.report) if self.report else None
        # Check all possible files, not only the files that this run writes. Otherwise files of an
        # earlier run, such as its history, would remain next to results that do not match them.
        # `check_outputs` refuses a file that is named twice. The files of --history and --plot
        # replace their names in `ALL_FILES`, which are the defaults of these options.
        names = [name for name in ALL_FILES if name not in (HISTORY, PICTURE)]
        defaults = self.in_folder((HISTORY, PICTURE))
        others = [file for file in defaults if file not in (picture, history)]
        outputs = [*self.in_folder(names), *others, *filter(None, (picture, history, report))]
        check_outputs(outputs, overwrite=self.overwrite)

    def in_folder(self, names: Sequence[str]) -> list[Path]:
        """Return the paths of files in the directory of -o; an empty list without -o."""
        return [Path(self.output) / name for name in names] if self.output else []

    @property
    def picture_file(self) -> Path | None:
        """The file of the figure; None if it is not requested."""
        return picture_file(self.plot, Path(self.output) / PICTURE if self.output else None)

    @property
    def history_file(self) -> Path | None:
        """The file of the response history; None if it is not requested.

        Raises
        ------
        UsageError
            No file and no directory are given, or the suffix is not .csv or .csv.gz.
        """
        if self.history is None:
            return None
        if self.history != BESIDE:
            file = Path(self.history)
            if not file.name.lower().endswith((".csv", ".csv.gz")):
                raise UsageError(
                    f"--history {file}: the file of a response history must end in .csv or .csv.gz"
                )
            return file
        if self.output is None:
            raise UsageError(
                "--history without a file writes to the directory of -o: add -o DIR, or use "
                "--history=FILE.csv"
            )
        return Path(self.output) / HISTORY

    @property
    def units_shown(self) -> OutputUnits:
        """The units of all outputs."""
        return self.output_units or SI

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the analysis on the command line; None or absent if not specified."""
        return {
            "method": self.method,
            "dt_s": self.dt,
            "duration_s": self.duration,
            "until_rest": self.until_rest or None,
            "check": self.check,
            "tolerance": self.tolerance,
            "allow_unstable": self.allow_unstable or None,
            **({"sequence": True, "rest_s": self.rest} if self.sequence else {}),
            "floor_spectra": list(self.floor_request.floors or ()),
            "changes": self.changes or None,
        }
