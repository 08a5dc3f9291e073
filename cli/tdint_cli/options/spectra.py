"""Options of spectra and floor motions, and the floor files that `tdint run` writes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from tdint.errors import UsageError
from tdint.output import figures, tables
from tdint.response.defaults import PERIODS
from tdint_cli.options import grammar, output

if TYPE_CHECKING:
    from tdint.arrays import Array
    from tdint.files import Content
    from tdint.grids import Grid
    from tdint.model.definition import Model
    from tdint.response.runs.outcome import Response
    from tdint.response.spectra.floor_motions import FloorSpectrum
    from tdint.units import OutputUnits


def tables_of_records(*more: grammar.Declaration) -> Callable[[grammar.Function], grammar.Function]:
    """Declare the options of a command with a single table per record, or one table of all records;
    `more` are options of its figure.
    """
    return grammar.together(
        output.output, output.plot, *more, output.jobs, output.units, output.overwrite
    )


SPECTRA = "floor-spectra.csv"
SPECTRA_MEAN = "floor-spectra-mean.csv"
SPECTRA_PICTURE = "floor-spectra.png"
MOTIONS = "floors.mseed"
"""Names of the floor files in the directory of -o."""


damping = grammar.option("--damping", default=(0.05,))
periods = grammar.option("--period", "--periods")


def chosen_periods(requested: Iterable[float | Grid] | None, default: str) -> Array:
    """Return the periods of --period, s, as an array.

    Parameters
    ----------
    requested : iterable of float or Grid, or None
        Values of --period: single periods and grids of periods; None if it is not specified.
    default : str
        Periods without --period, as FIRST:LAST:COUNT.
    """
    import numpy as np

    from tdint.grids import parse_grid

    items = requested or [parse_grid(default)]
    return np.hstack([item if isinstance(item, float) else item.values() for item in items])


def periods_as_given(
    requested: Iterable[float | Grid] | None, default: str
) -> list[float | str] | str:
    """Return the periods of --period for a JSON file, in the notation of the command line.

    A single grid is returned as its text FIRST:LAST:COUNT. Otherwise the result is a list of
    numbers and of texts of grids. `chosen_periods` describes the parameters.
    """
    items = [item if isinstance(item, float) else str(item) for item in requested or (default,)]
    if len(items) == 1 and isinstance(items[0], str):
        return items[0]
    return items


def target(text: str) -> grammar.Declaration:
    """Declare the option --target; `text` describes its use in the command, for the help."""
    spectra = (
        "asce7:sds=1.0,sd1=0.6,tl=8 (mcer: 1.5 times), asce7-22:FILE or mcer-22:FILE (JSON file of "
        "USGS), ec8:type=1,soil=B,ag=0.25g[,damping=5%][,q=3], or a CSV "
        "file with the columns period_s and sa_g or sa_m_s2."
    )
    return grammar.option("--target", help=f"{text}: {spectra}")


@grammar.request
class FloorRequest:
    """Options of the command line for floor spectra."""

    floors: tuple[str, ...] | None = grammar.option("--floor-spectra")
    floor_damping: tuple[float, ...] = grammar.option(default=(0.05,))
    floor_periods: tuple[float | Grid, ...] | None = grammar.option(
        "--floor-period", "--floor-periods"
    )

    def check(self, folder: str | None, export: str | None = None) -> None:
        """Raise UsageError if floor spectra or motions are requested without a directory."""
        if (self.floors or export) and not folder:
            name = "--floor-spectra" if self.floors else "--export-floors"
            raise UsageError(f"{name} requires -o DIR, because it writes a file; add -o DIR")

    def chosen_floors(self, model: Model) -> tuple[int | str, ...]:
        """Return the floors of the requested spectra; raise UsageError if the building has no such
        floor."""
        if not self.floors:
            return ()
        from tdint.response.spectra.floor_motions import floors_of

        return floors_of(self.floors, model)

    def chosen_periods(self) -> Array:
        """Return the periods of the floor spectra, s."""
        return chosen_periods(self.floor_periods, PERIODS)

    def run_spectra(self, response: Response) -> Sequence[FloorSpectrum]:
        """Return the requested floor spectra of a run; empty without --floor-spectra."""
        if not self.floors:
            return ()
        from tdint.response.spectra.floor_motions import floor_spectra as spectra_of

        floors = self.chosen_floors(response.model)
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
        """Return the floor files of a run by path, and the notes about them.

        Parameters
        ----------
        export : str, optional
            Format of the exported floor motions; None for no export.
        """
        stories = len(response.model.stories)
        files: dict[Path, Content] = {}
        notes: Sequence[str] = ()
        if spectra := self.run_spectra(response):
            files[folder / SPECTRA] = (
                tables.spectra.floor_spectrum_table(spectra).in_units(units).csv()
            )
            if plot:
                from tdint.model.building import assemble

                title = response.model.name
                draw = partial(
                    figures.floor_spectra.floor_picture,
                    spectra,
                    units,
                    title=title,
                    period=assemble(response.model).first_period,
                )
                files[folder / SPECTRA_PICTURE] = figures.style.picture(".png", draw)
        # The MiniSEED file contains all floors as stations, regardless of the requested spectra.
        if export:
            from tdint.ground_motion.record import to_mseed
            from tdint.response.spectra.floor_motions import floor_motion

            motions = [floor_motion(response, floor) for floor in range(1, stories + 1)]
            files[folder / MOTIONS], notes = to_mseed(motions)
        return files, notes


floor_request = grammar.of(FloorRequest, "floor_request")
