"""Options of the commands with runs under a suite of ground motions: names of files, and limits of
the demands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from tdint.units import OutputUnits
from tdint_cli.options import grammar
from tdint_cli.options.option_types import Ratio
from tdint_cli.options.output import picture_file
from tdint_cli.options.spectra import FloorRequest

PROFILES, PICTURE, RATIOS = "profiles.csv", "profiles.png", "ratios.csv"
"""Names of files in the directory of -o."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SuiteRequest:
    """Common options of the commands with many runs under a suite of ground motions.

    Attributes
    ----------
    output : str | None
        Directory of the results (-o); None without -o.
    output_units : OutputUnits | None
        Units of the files; None for the units of the models.
    plot, report : str | None
        Files of the figure and of the HTML report; None if not requested. `plot` is `BESIDE` for a
        figure in the directory of -o.
    limit : float, str or None
        Drift limit, or name of a performance level of the models; None for the limits of the
        models.
    changed : bool
        Keep the results of unchanged records and buildings in the directory of -o.
    require : bool
        Exit with code 5 if a limit is exceeded.
    jobs : int | None
        Number of threads; None: one thread per processor.
    baseline : str | None
        Reference building: ratios of the demands of the other buildings to its demands are written.
        None for no ratios.
    im : tuple of str | None
        Intensity measures of the runs for measures.csv; None for no such file.
    by : str | None
        Column of the inventory: losses are also reported for each of its values. None for no such
        rows.
    report_head : tuple of (str, str) or None
        Names and values at the top of the report; None for the head of the models.
    pair_demand : str | None
        Treatment of the two components of a recording: larger, mean or separate; None for the
        default.
    geojson : bool
        Write the GeoJSON map of the buildings and, with `by`, the map of the districts.
    event : tuple of str | None
        Events on the maps; None for all.
    polygons : str | None
        GeoJSON file with the polygons of the districts; by default their buildings are points.
    risk_category : str | None
        Risk category of ASCE 7, which may accept an unacceptable response; None: none is accepted.
    """

    output: str | None
    overwrite: bool
    output_units: OutputUnits | None
    plot: str | None
    report: str | None
    limit: float | str | None
    require: bool
    changed: bool
    jobs: int | None
    floor_request: FloorRequest
    baseline: str | None = None
    im: tuple[str, ...] | None = None
    by: str | None = None
    report_head: tuple[tuple[str, str], ...] | None = None
    pair_demand: str | None = None
    geojson: bool = False
    event: tuple[str, ...] | None = None
    polygons: str | None = None
    risk_category: str | None = None

    def picture(self, folder: Path | None) -> Path | None:
        """Return the file of the figure; None if no figure is requested.

        Parameters
        ----------
        folder : Path | None
            Directory of the results, for a figure without a file name; None without -o.

        Raises
        ------
        UsageError
            The figure has no file name, and no directory is specified.
        """
        return picture_file(self.plot, folder / PICTURE if folder else None)


# ---- Limits of demands: --limit and --require


class _DriftLimit(Ratio):
    """Option type of a drift ratio below 1, or of the name of a performance level of the model.

    `tdint campaign` refuses an integer with a hint to --max-runs, because --limit was the number of
    runs in earlier versions.
    """

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the drift ratio as a number, or the name of the performance level."""
        # Names of levels start with a letter; nan and inf are numbers.
        if isinstance(value, str) and value[:1].isalpha() and value.lower() not in _NOT_LEVELS:
            return value
        if isinstance(value, str) and value.isdecimal() and ctx and ctx.command.name == "campaign":
            self.fail(
                f"{value} is not a drift limit; specify a ratio below 1, such as 2%, or the name "
                f"of a performance level. For the number of runs, specify --max-runs {value}",
                param,
                ctx,
            )
        return super().convert(value, param, ctx)


_NOT_LEVELS = ("nan", "inf", "infinity")

LIMIT = grammar.option(type=_DriftLimit(0.0, 1.0, min_open=True, max_open=True))
"""The option --limit."""
