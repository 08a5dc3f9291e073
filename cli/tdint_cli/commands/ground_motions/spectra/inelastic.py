"""Inelastic spectra: oscillators with bilinear hysteresis, of given ductility or of given strength."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.errors import UsageError
from tdint_cli.commands.ground_motions.spectra.elastic import remark
from tdint_cli.commands.ground_motions.spectra.kind import Kind, Results
from tdint_cli.options.spectra import option
from tdint_cli.options.values import Number, Ratio

if TYPE_CHECKING:
    from tdint.analysis.spectra.inelastic import InelasticSpectrum
    from tdint.files import Writer
    from tdint.ground_motion.record import Record
    from tdint.output.tables.table import Table
    from tdint_cli.commands.ground_motions.spectra.request import SpectrumRequest

from tdint.analysis.spectra.defaults import MOST_DUCTILE, PERIODS

ductility = option(
    "--ductility",
    type=Number(1.0, MOST_DUCTILE),
    many=True,
    metavar="MU,...",
    help="Inelastic spectra instead: the yield strength for each of these ratios of largest to yield displacement (the "
    "largest strength if there are several).",
)
strength = option(
    "--strength",
    type=Ratio(0.0, min_open=True),
    many=True,
    metavar="RATIO,...",
    help="Inelastic spectra instead: the response for each of these ratios of yield force to weight.",
)
hardening = option(
    "--hardening",
    needs="--ductility or --strength",
    type=Ratio(0.0, 1.0, max_open=True),
    metavar="RATIO",
    help="With --ductility or --strength: stiffness after yielding over the initial one; 0 by default (elastoplastic).",
)


def check(request: SpectrumRequest) -> None:
    """Refuse, before any work, what makes no sense together."""
    if request.ductility and request.strength:
        raise UsageError("--ductility and --strength are given; leave one of them out")
    elastic = ("axes", "rotd", "method", "maxima", "interpolation")
    request.refuse(elastic, "is for elastic spectra; leave it out with --ductility and --strength")


def compute(request: SpectrumRequest, records: Sequence[Record]) -> Results:
    """The spectra of each component with each damping ratio, and ductility or strength."""
    from tdint.analysis.spectra.inelastic import constant_ductility, constant_strength

    periods = request.chosen_periods(PERIODS)
    hardening = request.hardening or 0.0
    lines: list[InelasticSpectrum] = []
    for record in records:
        for damping in request.damping:
            if request.ductility:
                lines += constant_ductility(record, periods, request.ductility, damping, hardening=hardening)
            else:
                lines += constant_strength(record, periods, request.strength or (), damping, hardening=hardening)
    return Results(lines, records)


def table(_: SpectrumRequest, lines: Sequence[InelasticSpectrum]) -> Table:
    """A row for each spectrum and period."""
    from tdint.output.tables.spectra import inelastic_table

    return inelastic_table(lines)


def picture(request: SpectrumRequest, lines: Sequence[InelasticSpectrum], suffix: str) -> Writer:
    """A line for each spectrum."""
    from tdint.output.figures.spectra.inelastic import inelastic_picture

    return inelastic_picture(lines, suffix, request.shown_units)


KIND = Kind("spectrum", PERIODS, check, compute, table, picture, remark)
