"""`tdint compare`: computed and recorded response of a building."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint import studies
from tdint.errors import AnalysisError, UsageError
from tdint.files import STDIN, Content, check_outputs
from tdint.number_parsing import number_text
from tdint_cli import options
from tdint_cli.options.option_types import ListOf, Written
from tdint_cli.options.output import Outputs, picture_file
from tdint_cli.terminal import note, say, warn

if TYPE_CHECKING:
    from tdint.arrays import Array
    from tdint.grids import Grid
    from tdint.model.definition import Model
    from tdint.output.figures.style import Figure
    from tdint.studies.recordings.compare import Comparison
    from tdint.units import OutputUnits

TABLE, SPECTRA, SUMMARY = "comparison.csv", "spectra.csv", "summary.json"
"""The files of a comparison."""

PERIODS = "0.04:4:100"
"""Default periods of the spectra, s."""


def _requirement(text: str) -> tuple[str, float]:
    """Return the name and the value of a requirement NAME=NUMBER for every floor; BadParameter for
    another form or an unknown name.
    """
    from tdint.studies.recordings.compare import parse_requirement

    try:
        return parse_requirement(text)
    except UsageError as error:
        raise click.BadParameter(str(error)) from None


@options.request
class Request:
    """The command line of `tdint compare`."""

    model: str
    recorded: str = options.option(required=True)
    require: tuple[tuple[str, float], ...] | None = options.option(
        type=ListOf(Written("NAME=NUMBER", _requirement))
    )
    method: str | None = options.analysis.method
    dt: float | None = options.option()
    damping: float = options.option(default=0.05)
    periods: tuple[float | Grid, ...] | None = options.spectra.periods
    output: str | None = options.output.output
    plot: str | None = options.output.plot
    report: str | None = options.output.report
    output_units: OutputUnits | None = options.option()
    overwrite: bool = options.option()

    def file(self, name: str) -> Path:
        """Return the path of the output file `name`.

        If -o is a directory, the file is in this directory. If -o is a table such as `OUT.csv`, the
        file is next to this table and is named `OUT-name`; the table has the name of -o.
        """
        output = Path(self.output or "")
        if output.suffix.lower() != ".csv":
            return output / name
        return output if name == TABLE else output.with_name(f"{output.stem}-{name}")

    def checked_outputs(self) -> Outputs:
        """Return the outputs; OutputError or UsageError if a file cannot be written."""
        table, summary = (self.file(TABLE), self.file(SUMMARY)) if self.output else (None, None)
        report = Path(self.report) if self.report else None
        picture = picture_file(self.plot, table)
        outputs = Outputs(table, picture, summary, self.overwrite, self.output_units, report)
        more = [self.file(SPECTRA)] if self.output else []
        check_outputs([*outputs.files, *more], overwrite=self.overwrite)
        return outputs


@options.command
@options.analysis.model
@options.of(Request)
def command(request: Request) -> None:
    """Compare the computed response of a building with its recorded response.

    MODEL.yaml is a model file. Its record is replaced by the mean of the recordings at the base.
    Several sensors of a floor are averaged. The offset of each recording is removed (of an
    acceleration its median, of a displacement its value before the shaking). The same zero-phase
    filters limit recorded and computed response to the band. CSV, one row per floor: correlation,
    computed maximum divided by recorded maximum, rms difference divided by the rms of the
    recording. -o also writes spectra of the absolute floor accelerations.
    """
    from tdint.model.config.model_file import load_model
    from tdint.studies.recordings.compare import Event, compare, unmet
    from tdint.studies.recordings.recording_file import load_recording

    if request.model == request.recorded == STDIN:
        raise UsageError(
            f"standard input ({STDIN}) can be only one of MODEL.yaml and --recorded; specify the "
            "other input as a file"
        )
    outputs = request.checked_outputs()
    model = load_model(request.model)
    outputs = outputs.else_in(model.output_units)
    units = outputs.shown_units
    model = replace(model, output_units=units)
    event = Event(load_recording(request.recorded, len(model.stories)))
    comparison = compare(model, event, method=request.method, dt=request.dt)
    _write(request, outputs, model, comparison)
    _report(comparison, units)
    # Unmet requirements are an error only after all files are written.
    if failures := unmet(comparison, request.require or ()):
        raise AnalysisError("; ".join(failures))


def _write(
    request: Request,
    outputs: Outputs,
    model: Model,
    comparison: Comparison,
) -> None:
    """Write the files of a comparison, or the table to standard output."""
    from tdint.studies.recordings.comparison_tables import (
        comparison_spectra_table,
        comparison_summary,
        comparison_table,
    )

    periods, units = _spectrum_periods(request, comparison), outputs.shown_units
    files: dict[Path, Content] = {}
    if request.output:
        spectra = comparison_spectra_table(comparison, periods, request.damping)
        files[request.file(SPECTRA)] = spectra.in_units(units).csv()

    def draw(units: OutputUnits) -> Figure:
        """Return the figure of the comparisons; its first use imports matplotlib."""
        return studies.comparison_figures.comparison_picture(
            [comparison], periods, request.damping, units
        )

    settings = {
        "method": request.method,
        "dt_s": request.dt,
        "require": dict(request.require or ()),
        "damping": request.damping,
        "periods": options.spectra.periods_as_given(request.periods, PERIODS)
        if request.periods
        else None,
    }
    outputs.deliver(
        comparison_table(comparison),
        lambda: draw(units),
        lambda: comparison_summary(model, comparison, settings),
        lambda: _page(request, comparison, draw),
        files,
    )


def _spectrum_periods(request: Request, comparison: Comparison) -> Array:
    """Return the periods of the response spectra, s, by default the periods of `PERIODS` that are
    within the frequency band of the first recording and not shorter than two sampling intervals; if
    no period remains, the longest period of `PERIODS`.
    """
    all_periods = options.spectra.chosen_periods(request.periods, PERIODS)
    if request.periods is not None:
        return all_periods
    event = comparison.event
    low, high = event.recording.band or (0.0, float("inf"))
    # A period T is within the band of the frequencies low to high, Hz, if 1/high <= T <= 1/low.
    periods = all_periods[
        (all_periods * high >= 1.0)
        & (all_periods * low <= 1.0)
        & (all_periods >= 2.0 * event.base.dt)
    ]
    return periods if periods.size else all_periods[-1:]


def _page(request: Request, comparison: Comparison, draw: Callable[[OutputUnits], Figure]) -> bytes:
    """Return the HTML page of --report; the verdict at its top is the result of --require."""
    from tdint.output.page import PageText, page_units
    from tdint.studies.recordings.compare import unmet
    from tdint.studies.recordings.comparison_report import comparison_page

    model = comparison.response.model
    units = page_units(request.output_units or model.page_units)
    verdict: list[tuple[bool | None, str]] = []
    if requirements := request.require:
        failures = unmet(comparison, requirements)
        limits = ", ".join(f"{name} {value:g}" for name, value in requirements)
        verdict = [
            (not failures, f"Required of every floor: {limits}. {'; '.join(failures) or 'Met'}.")
        ]
    verdict.append((None, _least_agreement(comparison)))
    sentences = [_motion_sentence(comparison, units)]
    # The report repeats the notes of the terminal, such as removed offsets and disabled checks.
    sentences += [f"Note: {text}." for text in dict.fromkeys(comparison.notes)]
    page_text = PageText(sentences, list(comparison.warnings), model.page_head, verdict=verdict)
    return comparison_page([comparison], partial(draw, units), page_text, units)


def _least_agreement(comparison: Comparison) -> str:
    """Return a sentence on the floors with the least agreement."""
    floors = comparison.floors
    lowest = min(floors, key=lambda floor: floor.correlation)
    # With the logarithm, the ratios 0.5 and 2 are equally far from 1.
    farthest_peak = max(floors, key=lambda floor: abs(math.log(abs(floor.peak_ratio))))
    largest_difference = max(floors, key=lambda floor: floor.rms_difference)
    clauses = [
        f"lowest correlation {number_text(lowest.correlation)} (floor {lowest.floor})",
        f"peak ratio farthest from 1: {number_text(farthest_peak.peak_ratio)} "
        f"(floor {farthest_peak.floor})",
        f"largest rms difference {number_text(largest_difference.rms_difference)} "
        f"(floor {largest_difference.floor})",
    ]
    sentence = ", ".join(clauses)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _motion_sentence(item: Comparison, units: OutputUnits) -> str:
    """Return a sentence about the ground motion and the method of a comparison."""
    event, run, band = item.event, item.response, item.event.recording.band
    band_text = f"{band[0]:g} to {band[1]:g} Hz" if band else "unfiltered"
    pga, pga_unit = units.of(event.base.pga, "m/s^2"), units.unit("m/s^2")[0]
    text = (
        f"{run.model.name} compared with {event.recording.source}: {event.count} samples at "
        f"{event.base.dt:.6g} s, {band_text}, PGA {pga:.3g} {pga_unit}; {run.method}, dt "
        f"{run.dt:.6g} s"
    )
    if item.shift:
        text += f"; recordings shifted by {item.shift:.6g} s"
    return f"{text}."


def _report(comparison: Comparison, units: OutputUnits) -> None:
    """Write the comparison to the terminal, then warnings and notes."""
    say(_motion_sentence(comparison, units))
    warn(*comparison.warnings)
    note(*dict.fromkeys(comparison.notes))
