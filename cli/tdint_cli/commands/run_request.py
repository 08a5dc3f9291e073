"""The command line of `tdint run`, of one record and of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tdint.errors import UsageError
from tdint.files import check_outputs
from tdint.units import SI, OutputUnits
from tdint_cli import options
from tdint_cli.campaigns import LIMIT, PAIR_DEMAND, REQUIRE, SuiteRequest
from tdint_cli.options.analysis import BuildingRequest, check_motion
from tdint_cli.options.grammar import BESIDE, Count, FileName, Mode, Number, Ratio
from tdint_cli.options.output import check_picture, picture_file
from tdint_cli.options.spectra import MOTIONS, SPECTRA, SPECTRA_PICTURE

STORIES, HISTORY, PICTURE, SUMMARY = "stories.csv", "history.csv", "response.png", "summary.json"
ALL_FILES = (STORIES, HISTORY, SPECTRA, SPECTRA_PICTURE, MOTIONS, PICTURE, SUMMARY)
"""The files of a run. The summary is written last: where it says `done`, all is there."""

_OF_ONE = ("history", "history_every", "tolerance", "allow_unstable", "export_floors")
SINGLE = Mode("with a single run", frozenset((*_OF_ONE, "duration", "limit")))
SEQUENCE = Mode(
    "with --sequence",
    frozenset(_OF_ONE),
    {
        "duration": "it has all of each record, and --rest is the time between",
        "factors": "give them by --scale",
    },
)
SEVERAL = Mode(
    "with several runs",
    frozenset(("duration", "limit", "factors", "pair_demand")),
    dict.fromkeys(_OF_ONE, "it is for one record and one scale: call it once for each"),
)
MODES = (SINGLE, SEQUENCE, SEVERAL)


@options.request
class Request(BuildingRequest, SuiteRequest):
    """The command line of `tdint run`."""

    shocks: tuple[str, ...] = ()
    """The records of a sequence; none for a run of one."""

    records: tuple[str, ...] = options.argument("[RECORD]...", nargs=-1, type=FileName())
    factors: str | None = options.record.option(
        type=FileName(),
        rare=True,
        help="Run the records with the factors that `tdint scale -o` wrote, in place of --scale. "
        "If no RECORD is named, the records are those of the table.",
    )
    sequence: bool = options.record.option(
        rare=True,
        help="Run the records one after the other on one building, which keeps what each has "
        "left: peaks of each shock and over all. --scale takes one factor for all, or one for "
        "each.",
    )
    rest: float | None = options.record.option(
        needs="--sequence",
        type=Number(0.0),
        metavar="SECONDS",
        rare=True,
        help="Time from the end of a record to the begin of the next; until the building is at "
        "rest by default.",
    )
    method: str | None = options.analysis.method
    dt: float | None = options.analysis.dt
    duration: float | None = options.analysis.duration
    until_rest: bool = options.analysis.until_rest
    output: str | None = options.output.output(
        "DIR", f"Write {STORIES} and {SUMMARY} into this folder, which is made if it is missing."
    )
    history: str | None = options.output.option(
        type=FileName(written=True),
        metavar="[FILE]",
        callback=options.output.refuse_empty,
        help="Also write every floor and story and the energies at every step: to this file "
        f"(.csv, .csv.gz), or alone as {HISTORY} into the folder of -o.",
    )
    history_every: int = options.output.option(
        needs="--history",
        type=Count(1),
        default=1,
        rare=True,
        help="Every so many steps of --history, from the first one; every step by default.",
    )
    export_floors: str | None = options.spectra.export_floors
    plot: str | None = options.output.plot(
        "Also draw roof displacement, energies, drifts, the hysteresis of the worst story (drifts "
        "and shears of the others are columns of --history); of several records the profiles of "
        f"all and their mean: to this file (.png, .pdf, .svg), or alone as {PICTURE} or "
        "profiles.png into the folder of -o."
    )
    report: str | None = options.output.report
    output_units: OutputUnits | None = options.output.units
    overwrite: bool = options.output.overwrite
    check: bool | None = options.analysis.option(
        "--check/--no-check",
        default=None,
        help="Columns <name>_error with estimated errors, by one more run of impulse4 with half "
        "of the step. One run has them unless --no-check leaves them out; --check also in "
        "--history, and of several runs.",
    )
    tolerance: float | None = options.analysis.option(
        type=Ratio(0.0, 1.0, min_open=True, max_open=True),
        metavar="1%",
        help="Take the largest step with which the estimated error of every peak drift is within "
        "this part of it: from four sampling intervals of the record, or from --dt, down to a "
        "256th.",
    )
    limit: float | None = LIMIT
    require: bool = REQUIRE
    pair_demand: str | None = PAIR_DEMAND
    allow_unstable: bool = options.analysis.option(
        rare=True, help="Run a method beyond its largest stable step."
    )
    jobs: int | None = options.output.threads(
        "Threads for several records or scales; one for each processor"
    )

    def check_sequence(self) -> None:
        """Refuse what a sequence cannot have."""
        count, factors = len(self.shocks), len(self.scale or (1.0,))
        if count < 2:
            raise UsageError(
                "--sequence takes two records or more, one after the other: name them behind the "
                "model"
            )
        if "-" in self.shocks:
            raise UsageError("the records of a sequence are files, not standard input")
        if factors not in (1, count):
            raise UsageError(
                f"--scale: {factors} factors for {count} shocks: give one, or one for each"
            )

    def check_files(self) -> None:
        """Refuse, before any work, what can be seen to fail."""
        history = self.history_file
        self.of_floors.check(self.output, self.export_floors)
        check_motion(replace(self, scale=None) if self.sequence else self)
        picture = self.picture_file
        if picture:
            check_picture(picture)
        report = Path(self.report) if self.report else None
        outputs = [*self.in_folder(ALL_FILES), *filter(None, (picture, history, report))]
        check_outputs(dict.fromkeys(outputs), overwrite=self.overwrite)

    def in_folder(self, names: Sequence[str]) -> list[Path]:
        """Files in the folder of -o, none without one."""
        return [Path(self.output) / name for name in names] if self.output else []

    @property
    def picture_file(self) -> Path | None:
        """The file of the picture, if one is asked for."""
        return picture_file(self.plot, Path(self.output) / PICTURE if self.output else None)

    @property
    def history_file(self) -> Path | None:
        """The file of the history, if one is asked for.

        Raises
        ------
        UsageError
            It has no name and there is no folder, or its name says another format.
        """
        if self.history is None:
            return None
        if self.history != BESIDE:
            file = Path(self.history)
            if not file.name.lower().endswith((".csv", ".csv.gz")):
                raise UsageError(f"--history {file}: a history is a table; name it .csv or .csv.gz")
            return file
        if self.output is None:
            raise UsageError(
                "--history alone writes into the folder of -o: add -o DIR, or name it: "
                "--history=FILE.csv"
            )
        return Path(self.output) / HISTORY

    @property
    def units_shown(self) -> OutputUnits:
        """The units of all that is written."""
        return self.output_units or SI

    @property
    def settings(self) -> dict[str, Any]:
        """What the command line asked of the analysis; None, or nothing, where it did not ask."""
        return {
            "method": self.method,
            "dt_s": self.dt,
            "duration_s": self.duration,
            "until_rest": self.until_rest or None,
            "check": self.check,
            "tolerance": self.tolerance,
            "allow_unstable": self.allow_unstable or None,
            **({"sequence": True, "rest_s": self.rest} if self.sequence else {}),
            "floor_spectra": list(self.of_floors.floors or ()),
        }
