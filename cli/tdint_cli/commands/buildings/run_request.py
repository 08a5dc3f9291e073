"""The command line of `tdint run`, of one record and of several."""

from __future__ import annotations

import click

from tdint.errors import UsageError
from tdint.output_units import OutputUnits
from tdint_cli import options
from tdint_cli.batch.profiles import REQUIRE, SuiteRequest, drift_limit
from tdint_cli.options.building import BuildingRequest
from tdint_cli.options.values import FileName, Number, Ratio

STORIES, HISTORY, PICTURE, SUMMARY = "stories.csv", "history.csv", "response.png", "summary.json"


@options.request
class Request(BuildingRequest, SuiteRequest):
    """The command line of `tdint run`."""

    shocks: tuple[str, ...] = ()
    """The records of a sequence; none for a run of one."""

    records: tuple[str, ...] = options.argument("[RECORD]...", nargs=-1, type=FileName())
    factors: str | None = options.record.option(
        type=FileName(),
        metavar="FILE",
        help="Run the records with the factors that `tdint scale -o` wrote, in place of --scale.",
    )
    sequence: bool = options.record.option(
        is_flag=True,
        help="Run the records one after the other on one building, which keeps what each has left: peaks of each shock "
        "and over all. --scale takes one factor for all, or one for each.",
    )
    rest: float | None = options.record.option(
        needs="--sequence",
        type=Number(0.0),
        metavar="SECONDS",
        help="Time from the end of a record to the begin of the next; until the building is at rest by default.",
    )
    method: str | None = options.analysis.method
    dt: float | None = options.analysis.dt
    duration: float | None = options.analysis.duration
    until_rest: bool = options.analysis.until_rest
    output: str | None = options.output.output(
        "DIR", f"Write {STORIES} and {SUMMARY} into this folder, which is made if it is missing."
    )
    history: str | None = options.output.option(
        type=FileName(),
        metavar="[FILE]",
        callback=options.output.refuse_empty,
        help=f"Also write every floor and story and the energies at every step: to this file (.csv, .csv.gz), or alone "
        f"as {HISTORY} into the folder of -o.",
    )
    every: int = options.output.option(
        needs="--history",
        type=click.IntRange(1),
        default=1,
        metavar="COUNT",
        help="Every so many steps of --history, from the first one; every step by default.",
    )
    export_floors: str | None = options.spectra.export_floors
    plot: str | None = options.output.plot(
        f"Also draw roof displacement, energies, drifts, one hysteresis; of several records the profiles of all and "
        f"their mean: to this file (.png, .pdf, .svg), or alone as {PICTURE} or profiles.png into the folder of -o."
    )
    report: str | None = options.output.report
    output_units: OutputUnits | None = options.output.units
    overwrite: bool = options.output.overwrite
    check: bool | None = options.analysis.option(
        "--check/--no-check",
        default=None,
        help="Columns <name>_error with estimated errors. moment4 carries them along in the run and shows them "
        "unasked, asked also in --history; with another method the run is repeated with a half and a quarter of the "
        "step.",
    )
    tolerance: float | None = options.analysis.option(
        type=Ratio(0.0, 1.0, min_open=True, max_open=True),
        metavar="1%",
        help="Take the largest step with which the estimated error of every peak drift is within this part of it: "
        "from several sampling intervals of the record, or from --dt, down to a 256th. moment4 chooses its steps on "
        "the way. The columns of --check are there, too.",
    )
    drift_limit: float | None = drift_limit("--limit")
    require: bool = REQUIRE
    allow_unstable: bool = options.analysis.option(is_flag=True, help="Run a method beyond its largest stable step.")
    jobs: int | None = options.option(
        type=click.IntRange(1, 1024),
        metavar="N",
        help="Threads for several records or scales; one for each processor by default. The output does not depend on "
        "it.",
    )

    def refuse_of_one(self) -> None:
        """Raise UsageError for options of a single run.

        Raises
        ------
        UsageError
            One of them is given.
        """
        for name in ("history", "tolerance", "allow_unstable", "export_floors"):
            if getattr(self, name):
                raise UsageError(f"--{name.replace('_', '-')} is for one record and one scale; call it once for each")
        if self.every > 1:
            raise UsageError("--every is for one record and one scale; call it once for each")
        self.of_floors.check(self.output)
