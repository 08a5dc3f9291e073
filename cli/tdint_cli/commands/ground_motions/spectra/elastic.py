"""Elastic spectra of single components."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from tdint.analysis.spectra.defaults import PERIODS, STEPS_PER_PERIOD
from tdint_cli.commands.ground_motions.spectra.kind import Kind, Results
from tdint_cli.options import output
from tdint_cli.options.spectra import option

if TYPE_CHECKING:
    from tdint.analysis.spectra.elastic import Spectrum
    from tdint.files import Writer
    from tdint.ground_motion.record import Record
    from tdint.output.tables.table import Table
    from tdint_cli.commands.ground_motions.spectra.request import SpectrumRequest


maxima = option(
    "--maxima",
    type=click.Choice(["exact", "peer", "samples"]),
    help="Where the largest values are looked for: between the samples, too (exact, the default), at ten or more steps "
    "per period (peer, as PEER's own spectra), or at the record's samples (samples, as those of USGS). "
    "Not with --method, whose steps have their own. Adds a column.",
)
interpolation = option(
    "--interpolation",
    type=click.Choice(["linear", "band-limited"]),
    help="The ground motion between its samples: straight lines (linear, the default), or the motion without "
    "frequencies above half the sampling rate (band-limited). Adds a column.",
)


axes = output.option(
    "--axes",
    needs="--plot",
    type=click.Choice(["periods", "tripartite", "adrs"]),
    help="Axes of the picture of elastic spectra: PSA and SD over the period (periods, the default), PSV over it with "
    "scales of the other two (tripartite), or PSA over SD (adrs).",
)


def check(request: SpectrumRequest) -> None:
    """Refuse, before any work, what makes no sense together."""
    _ = request.manner


def compute(request: SpectrumRequest, records: Sequence[Record]) -> Results:
    """The spectra of each component with each damping ratio."""
    from tdint.analysis.spectra.elastic import spectrum

    periods = request.chosen_periods(PERIODS)
    lines = [
        spectrum(
            record,
            periods,
            damping,
            method=request.method,
            maxima=request.maxima,
            interpolation=request.interpolation,
        )
        for record in records
        for damping in request.damping
    ]
    return Results(lines, records)


def table(request: SpectrumRequest, lines: Sequence[Spectrum]) -> Table:
    """A row for each spectrum and period."""
    from tdint.output.tables.spectra import spectrum_table

    return spectrum_table(lines, request.stated)


def picture(request: SpectrumRequest, lines: Sequence[Spectrum], suffix: str) -> Writer:
    """A line for each spectrum."""
    from tdint.output.figures.spectra.spectrum import spectrum_picture

    return spectrum_picture(lines, suffix, request.axes or "periods", request.shown_units)


def remark(request: SpectrumRequest, interval: float) -> str:
    """What a person should know of the periods."""
    return "; ".join(filter(None, (_between_samples(request, interval), _between_periods(request))))


def _between_periods(request: SpectrumRequest) -> str:
    """On a grid that nobody chose and that is coarser than half the width of resonance, which is the damping ratio."""
    if request.period or request.periods is not None:
        return ""
    periods = request.chosen_periods(PERIODS)
    apart, damping = float(periods[1] / periods[0]) - 1.0, min(request.damping)
    if apart <= damping * (1.0 + 1e-9):
        return ""
    return (
        f"the periods are {100.0 * apart:.2g} % apart: with {100.0 * damping:.3g} % damping the spectrum may be higher "
        "between them; --periods takes more"
    )


def _between_samples(request: SpectrumRequest, interval: float) -> str:
    """On periods at which the ground motion between the samples matters."""
    periods = request.chosen_periods(PERIODS)
    limit = STEPS_PER_PERIOD * interval
    if not any((periods > 0.0) & (periods < limit * (1.0 - 1e-9))):
        return ""
    manner = request.manner
    return (
        f"below a period of {limit:.6g} s ({STEPS_PER_PERIOD} sampling intervals) the ground motion between its "
        f"samples matters: taken as {manner.interpolation.words}, maxima {manner.maxima.words}"
    )


KIND = Kind("spectrum", PERIODS, check, compute, table, picture, remark)
