"""Options of spectra and of the motions of floors, and the files of floors that `tdint run`
writes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tdint.analysis.defaults import PERIODS
from tdint.errors import UsageError
from tdint.output import figures, tables
from tdint.system import processors
from tdint_cli.options import grammar, output
from tdint_cli.options.analysis import damping_ratio
from tdint_cli.options.grammar import ListOf, Number, grid

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.analysis.run.outcome import Response
    from tdint.analysis.spectra.floors import FloorSpectrum
    from tdint.campaign.plan import Plan
    from tdint.campaign.profiles import FloorSuite
    from tdint.campaign.store import Store
    from tdint.files import Content
    from tdint.units import OutputUnits
    from tdint.written_numbers import Grid

option = partial(grammar.option, heading=grammar.SPECTRUM)


_PER_RECORD = output.output(
    "FILE|DIR",
    "Write to this file instead of standard output; to one file per record in an existing folder "
    "or one that is named with a / at its end. What the records are and how the numbers came about "
    "stands in a JSON file beside each.",
)
_PICTURE = output.plot(
    "Also draw all records, to this file (.png, .pdf, .svg); alone, each CSV file of -o, as PNG "
    "beside it."
)


def tables_of_records(*more: grammar.Declaration) -> Callable[[grammar.Function], grammar.Function]:
    """The options of a command with a table of each record, or of all; `more` of its picture."""
    return grammar.together(
        _PER_RECORD, _PICTURE, *more, output.jobs, output.units, output.overwrite
    )


SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE = (
    "floor-spectra.csv",
    "floor-spectra-mean.csv",
    "floor-spectra.png",
)
MOTIONS = "floors.mseed"
"""The files of floors, in the folder of -o."""


def damping(needs: str = "") -> grammar.Declaration:
    """Declare the option --damping; --floor-damping if it `needs` --floor-spectra."""
    return option(
        "--floor-damping" if needs == _NEEDS else "--damping",
        type=ListOf(damping_ratio),
        default=(0.05,),
        rare=bool(needs),
        needs=needs,
        help="Damping ratios; 0.05 (or 5%) by default.",
    )


class _Periods(Number):
    """A period, or a grid of them."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, str) and ":" in value:
            return grid().read(value)
        return super().convert(value, param, ctx)


def periods(default: str, zero: str = "", needs: str = "") -> grammar.Declaration:
    """Declare the option --period; --floor-period if it `needs` --floor-spectra.

    `zero` states the meaning of a period of 0, if that is allowed.
    """
    prefix = "--floor-" if needs == _NEEDS else "--"
    return option(
        f"{prefix}period",
        f"{prefix}periods",
        type=ListOf(_Periods(0.0, min_open=not zero)),
        rare=bool(needs),
        needs=needs,
        metavar="SECONDS|FIRST:LAST:COUNT,...",
        help=f"Periods, or so many in equal ratios, both ends included; {default} by "
        f"default.{zero}",
    )


def chosen_periods(given: Iterable[float | Grid] | None, default: str) -> NDArray[np.float64]:
    """The periods of --period, or those of the default, s."""
    import numpy as np

    from tdint.written_numbers import parse_grid

    parts = given or [parse_grid(default)]
    return np.hstack([part if isinstance(part, float) else part.values() for part in parts])


def periods_as_given(given: Iterable[float | Grid] | None, default: str) -> list[float | str] | str:
    """The same as text, for a JSON file: a grid as it is written, several periods as a list."""
    parts = [part if isinstance(part, float) else str(part) for part in given or (default,)]
    return parts[0] if len(parts) == 1 and isinstance(parts[0], str) else parts


export_floors = output.option(
    "--export-floors",
    type=click.Choice(["mseed"]),
    rare=True,
    help=f"Also write {MOTIONS}: the absolute accelerations of all floors, m/s^2, as MiniSEED; "
    "stations F01, F02, ...",
)
_NEEDS = "--floor-spectra"


@grammar.request
class FloorRequest:
    """What a command line asks of the spectra of floors."""

    floors: tuple[str, ...] | None = option(
        _NEEDS,
        rare=True,
        type=ListOf(click.STRING),
        metavar="FLOOR,...",
        help=f"Also write {SPECTRA}: elastic response spectra of the absolute accelerations of "
        "these floors (from 1, or roof), exact for motions that are linear between the steps; with "
        f"--plot {SPECTRA_PICTURE}, too. Of several records those of every run, and in "
        f"{SPECTRA_MEAN} their mean and envelope.",
    )
    floor_damping: tuple[float, ...] = damping(_NEEDS)
    floor_periods: tuple[float | Grid, ...] | None = periods(
        PERIODS, " 0 gives the largest acceleration of the floor at the steps.", _NEEDS
    )

    def check(self, folder: str | None, export: str | None = None) -> None:
        """Raise UsageError for files, of spectra or motions, without a folder."""
        if (self.floors or export) and not folder:
            raise UsageError(
                f"{_NEEDS if self.floors else '--export-floors'} writes a file: add -o DIR"
            )

    def chosen_floors(self, stories: int) -> tuple[int, ...]:
        """The floors whose spectra are asked for; UsageError if the building has no such floor."""
        if not self.floors:
            return ()
        from tdint.analysis.spectra.floors import floor_numbers

        return floor_numbers(self.floors, stories)

    def chosen_periods(self) -> NDArray[np.float64]:
        """The periods, s."""
        return chosen_periods(self.floor_periods, PERIODS)

    def of_suite(
        self, plan: Plan, store: Store, jobs: int | None, units: OutputUnits, *, plot: bool
    ) -> tuple[dict[str, Content], Sequence[FloorSuite]]:
        """The files of a suite by their names and what they hold, in these units, with a picture if
        one is wanted, and the spectra over the motions; nothing if no floor is asked for. Every run
        is done once more for them.

        Raises
        ------
        UsageError
            A building has no such floor.
        """
        if not self.floors:
            return {}, ()
        from tdint.campaign.profiles import FloorChoice, floor_suites, run_floors

        # Histories are not kept in a store: the runs are done again for what their floors do.
        choice = FloorChoice(self.floors, self.chosen_periods(), self.floor_damping)
        floors = run_floors(plan, store, choice, jobs or processors())
        suites = list(floor_suites(store, floors))
        contents: dict[str, Content] = {
            SPECTRA: tables.campaign.run_floor_table(store, floors).in_units(units).csv(),
            SPECTRA_MEAN: tables.campaign.floor_suite_table(store, suites).in_units(units).csv(),
        }
        if plot and suites:
            draw = partial(figures.runs.floor_suite_picture, suites, units)
            contents[SPECTRA_PICTURE] = figures.style.picture(".png", draw)
        return contents, suites

    def of_run(self, response: Response) -> Sequence[FloorSpectrum]:
        """The spectra of a run that are asked for."""
        if not self.floors:
            return ()
        from tdint.analysis.spectra.floors import floor_spectra as spectra_of

        floors = self.chosen_floors(len(response.model.stories))
        return spectra_of(response, floors, self.chosen_periods(), self.floor_damping)

    def files(
        self,
        response: Response,
        folder: Path,
        units: OutputUnits,
        *,
        plot: bool = False,
        export: str | None = None,
    ) -> tuple[dict[Path, Content], Sequence[str]]:
        """The files in a folder and what they hold, tables in these units, a picture and motions if
        they are wanted; and notes on them."""
        stories = len(response.model.stories)
        files: dict[Path, Content] = {}
        notes: Sequence[str] = ()
        if spectra := self.of_run(response):
            files[folder / SPECTRA] = (
                tables.spectra.floor_spectrum_table(spectra).in_units(units).csv()
            )
            if plot:
                title = response.model.name
                draw = partial(figures.runs.floor_picture, spectra, units, title=title)
                files[folder / SPECTRA_PICTURE] = figures.style.picture(".png", draw)
        # MiniSEED has a floor a station, whether its spectrum was asked for or not.
        if export:
            from tdint.analysis.spectra.floors import floor_motion
            from tdint.ground_motion.record import to_mseed

            motions = [floor_motion(response, floor) for floor in range(1, stories + 1)]
            files[folder / MOTIONS], notes = to_mseed(motions)
        return files, notes


of_floors = grammar.of(FloorRequest, "of_floors")
