"""`tdint compare`: a building's result beside what was recorded in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import AnalysisError, UsageError
from tdint.files import check_outputs, write_files
from tdint.output import figures
from tdint.written_numbers import first_few, how_many
from tdint_cli import options
from tdint_cli.drawing import emit_table
from tdint_cli.options.grammar import FileName, ListOf, Written
from tdint_cli.options.output import check_picture, picture_file
from tdint_cli.terminal import note, say, warn

if TYPE_CHECKING:
    from tdint.analysis.compare import Comparison
    from tdint.analysis.fit import Fit
    from tdint.arrays import Array
    from tdint.files import Content
    from tdint.model.definition import Model
    from tdint.units import OutputUnits
    from tdint.written_numbers import Grid

TABLE, SPECTRA, FIT, SUMMARY = "comparison.csv", "spectra.csv", "fit.csv", "summary.json"
FITTED = "fitted.yaml"
"""The files of a comparison."""

PERIODS = "0.04:4:100"
"""Of the spectra, s, where none are asked for."""

_FEW = 8  # fitted values that are said; all are written


def _requirement(text: str) -> tuple[str, float]:
    """NAME=NUMBER: what the comparison of every floor must come to."""
    from tdint.analysis.compare import parse_requirement

    try:
        return parse_requirement(text)
    except UsageError as error:
        raise click.BadParameter(str(error)) from None


@options.request
class Request:
    """The command line of `tdint compare`."""

    model: str
    recorded: str = options.option(
        type=FileName(),
        required=True,
        help="What was recorded in the building, and where: a YAML file with the keys base, "
        "floors, band, window, shift.",
    )
    fit: tuple[str, ...] | None = options.option(
        type=ListOf(click.Choice(["stiffness", "stiffness-factor", "damping"])),
        metavar="stiffness|stiffness-factor,damping",
        help="First fit the stiffnesses of the stories, or one factor on all of them, which is "
        "what a single sensor can tell, or the damping to the recording: stiffnesses from a tenth "
        "to ten times, ratios from 0.01 to 50 %, Rayleigh's coefficients from a thousandth to a "
        "thousand times the model's.",
    )
    blind: tuple[str, ...] | None = options.option(
        needs="--fit",
        type=ListOf(FileName()),
        help="Compare other recordings, too, with the fitted values; adds the column recorded.",
    )
    require: tuple[tuple[str, float], ...] | None = options.option(
        type=ListOf(Written("NAME=NUMBER", _requirement)),
        help="End with exit code 5 unless every floor has a correlation of at least this, a "
        "peak_ratio between this and its inverse, or an rms_difference of at most this.",
    )
    method: str | None = options.analysis.method
    dt: float | None = options.analysis.option(
        type=float,
        metavar="SECONDS",
        rare=True,
        help="Time step: the recording's sampling interval or a whole part of it; by default "
        "short enough that the method's error is not seen.",
    )
    damping: float = options.analysis.damping_of(
        "the floors' spectra", heading=options.grammar.SPECTRUM, needs="-o or --plot"
    )
    periods: tuple[float | Grid, ...] | None = options.spectra.periods(
        PERIODS, needs="-o or --plot"
    )
    output: str | None = options.output.output(
        "DIR|FILE.csv",
        f"Write {TABLE}, {SPECTRA} and {SUMMARY} into this folder, with --fit {FIT} and the fitted "
        f"model {FITTED}, too; or the table to this file and the others beside it, their names "
        "behind its name.",
    )
    plot: str | None = options.output.picture
    report: str | None = options.output.report
    output_units: OutputUnits | None = options.output.units
    overwrite: bool = options.output.overwrite

    def file(self, name: str) -> Path:
        """The file of this name: in the folder of -o, or beside the table that -o names
        (`NAME.csv`: `NAME-name`)."""
        output = Path(self.output or "")
        if output.suffix.lower() != ".csv":
            return output / name
        return output if name == TABLE else output.with_name(f"{output.stem}-{name}")

    @property
    def picture(self) -> Path | None:
        """The file of the picture, if one is asked for."""
        return picture_file(self.plot, self.file(TABLE) if self.output else None)

    @property
    def outputs(self) -> list[Path]:
        """All files that are written."""
        names = (
            (TABLE, SPECTRA, *((FIT, FITTED) if self.fit else ()), SUMMARY) if self.output else ()
        )
        return [
            *map(self.file, names),
            *filter(None, (self.picture, Path(self.report) if self.report else None)),
        ]


@options.command(
    "compare",
    "tdint compare office.yaml --recorded recorded.yaml",
    "tdint compare office.yaml --recorded recorded.yaml --fit damping -o fitted",
    exits={5: "--require is not met"},
)
@options.analysis.model
@options.of(Request)
def command(request: Request) -> None:
    """Compare the computed response of a building with its recorded response.

    MODEL.yaml is a model file; the mean of the base's recordings drives it, in place of the record
    that it names. Several sensors of a floor are averaged. Each recording loses its offset (an
    acceleration its median, a displacement, which may remain, what it is before the shaking), and
    the same filters without shift of phase, forwards and backwards, take recording and result to
    the band. CSV, a row per floor: correlation, largest value computed over that recorded, rms of
    the difference over that of the recording. With -o also the spectra of the floors' absolute
    accelerations.
    """
    from tdint.analysis.compare import Event, compare, unmet
    from tdint.analysis.fit import fit
    from tdint.model.config.model_file import load_model
    from tdint.model.recorded import load_recording
    from tdint.output.tables.buildings import comparison_table

    # What can be seen to fail is refused before any work.
    if request.model == "-" and request.recorded == "-":
        raise UsageError("standard input is used for the model; specify the recordings as a file")
    if request.picture:
        check_picture(request.picture)
    check_outputs(request.outputs, overwrite=request.overwrite)
    model = load_model(request.model)
    units = request.output_units or model.output_units
    model = replace(model, output_units=units)
    files = [request.recorded, *(request.blind or ())]
    recordings = [load_recording(file, len(model.stories)) for file in files]
    events = [Event.of(recording) for recording in recordings]
    fitted = fit(model, events[0], request.fit) if request.fit else None
    best = fitted.model if fitted else model
    comparisons = [compare(best, event, method=request.method, dt=request.dt) for event in events]
    if not request.output:
        emit_table(comparison_table(comparisons))
    _write(request, model, comparisons, fitted, units)
    _remark(comparisons, fitted, units)
    # All is written before what does not come up to the requirements is an error.
    if faults := [
        fault for comparison in comparisons for fault in unmet(comparison, request.require or ())
    ]:
        raise AnalysisError("; ".join(faults))


def _write(
    request: Request,
    model: Model,
    comparisons: Sequence[Comparison],
    fitted: Fit | None,
    units: OutputUnits,
) -> None:
    from tdint.model.config.model_file import rewritten
    from tdint.output.summary import comparison_summary
    from tdint.output.tables.buildings import (
        comparison_spectra_table,
        comparison_table,
        fitted_table,
    )

    # The periods of the spectra: those asked for, or of `PERIODS` those that the recording's
    # interval and band leave
    periods = options.spectra.chosen_periods(request.periods, PERIODS)
    if request.periods is None:
        event, every = comparisons[0].event, periods
        low, high = event.recording.band or (0.0, float("inf"))
        periods = every[
            (every * high >= 1.0) & (every * low <= 1.0) & (every >= 2.0 * event.base.dt)
        ]
        periods = periods if periods.size else every[-1:]
    files: dict[Path, Content] = {}
    if request.output:
        files[request.file(TABLE)] = comparison_table(comparisons).csv()
        spectra = comparison_spectra_table(comparisons, periods, request.damping)
        files[request.file(SPECTRA)] = spectra.in_units(units).csv()
        if fitted:
            if text := rewritten(model, fitted.model, request.file(FITTED)):
                recorded = comparisons[0].event.recording.source
                origin = f"{model.source} with {','.join(request.fit or ())} fitted to {recorded}"
                files[request.file(FITTED)] = f"# {' '.join(origin.split())}\n{text}".encode()
            else:
                note(
                    f"{model.source}: cannot be written with other numbers; the fitted values are "
                    f"in {FIT} alone"
                )
            files[request.file(FIT)] = fitted_table(fitted.values, units).csv()
    if picture := request.picture:
        draw = partial(
            figures.comparison.comparison_picture, comparisons, periods, request.damping, units
        )
        files[picture] = figures.style.picture(picture.suffix, draw)
    if request.report:
        files[Path(request.report)] = _page(request, comparisons, fitted, periods)
    if request.output:
        settings = {
            "method": request.method,
            "dt_s": request.dt,
            "fit": list(request.fit or ()),
            "blind": list(request.blind or ()),
            "require": dict(request.require or ()),
            "damping": request.damping,
            "periods": options.spectra.periods_as_given(request.periods, PERIODS)
            if request.periods
            else None,
        }
        summary = comparison_summary(model, comparisons, fitted, settings, units)
        files[request.file(SUMMARY)] = options.output.summary_bytes(summary, units)
    write_files(files, overwrite=request.overwrite)


def _page(
    request: Request, comparisons: Sequence[Comparison], fitted: Fit | None, periods: Array
) -> bytes:
    """The page of --report: what was required of every floor is its verdict."""
    from tdint.analysis.compare import absolute_displacements, unmet
    from tdint.output.page import Told, page_units
    from tdint.output.report import comparison_page
    from tdint.output.summary import files_read
    from tdint.output.tables.buildings import fitted_table

    model = comparisons[0].response.model
    units = page_units(request.output_units or model.page_units)
    verdict: list[tuple[bool | None, str]] = []
    if required := request.require:
        faults = [fault for item in comparisons for fault in unmet(item, required)]
        asked = ", ".join(f"{name} {value:g}" for name, value in required)
        verdict = [(not faults, f"Required of every floor: {asked}. {'; '.join(faults) or 'Met'}.")]
    said = [_driven(item, units) for item in comparisons]
    warnings = [
        text
        for item in comparisons
        for text in (*item.event.warnings, *item.response.warnings, *absolute_displacements(item))
    ]
    told = Told(said, warnings, model.page_head, files_read(), verdict)
    draw = partial(
        figures.comparison.comparison_picture, comparisons, periods, request.damping, units
    )
    return comparison_page(
        comparisons, draw, told, fitted_table(fitted.values, units) if fitted else None, units
    )


def _driven(item: Comparison, units: OutputUnits) -> str:
    """What drove the building, in a sentence."""
    event, run, (acceleration, g) = item.event, item.response, units.unit("m/s^2")
    band = event.recording.band
    return (
        f"{run.model.name} beside {event.recording.source}: {event.count} samples of "
        f"{event.base.dt:.6g} s, "
        + (f"{band[0]:g} to {band[1]:g} Hz, " if band else "unfiltered, ")
        + f"PGA {event.base.pga / g:.3g} {acceleration}; {run.method}, dt {run.dt:.6g} s"
        + (f"; recordings shifted by {item.shift:.6g} s." if item.shift else ".")
    )


def _remark(comparisons: Sequence[Comparison], fitted: Fit | None, units: OutputUnits) -> None:
    """What was done, in a few sentences; then warnings and notes."""
    from tdint.analysis.compare import absolute_displacements
    from tdint.output.tables.buildings import fitted_in

    for item in comparisons:
        say(_driven(item, units))
        warn(*item.event.warnings, *item.response.warnings, *absolute_displacements(item))
    # The first values alone: a building of many stories would fill the screen.
    if fitted:
        values = [fitted_in(item, units) for item in fitted.values]
        changes = [
            f"{item.name}{f' {item.place}' if item.place else ''} {item.value:.5g}"
            for item in values
        ]
        source = comparisons[0].event.recording.source
        say(f"Fitted to {source} in {how_many(fitted.runs, 'run')}: {first_few(changes, _FEW)}.")
    note(
        *dict.fromkeys(
            text for item in comparisons for text in (*item.event.notes, *item.response.notes)
        )
    )
    note(*(fitted.notes if fitted else ()))
