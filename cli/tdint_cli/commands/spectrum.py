"""`tdint spectrum`: response spectra of records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

from tdint_cli import inelastic, options, rotation, spectra
from tdint_cli.startup import load_numba

if TYPE_CHECKING:
    from tdint.analysis.spectra.elastic import SpectrumSettings
    from tdint.files import Writer
    from tdint.ground_motion.record import Record
    from tdint.output.tables.tables import Table

_PERIODS = "0.01:10:200"
_SAMPLES_PER_PERIOD = 10


@dataclass(frozen=True)
class Request(spectra.Request):
    """The command line of `tdint spectrum`."""

    method: str | None
    maxima: str | None
    interpolation: str | None
    rotd: tuple[int, ...] | None
    ductility: tuple[float, ...] | None
    strength: tuple[float, ...] | None
    hardening: float | None

    def settings(self, default_periods: str) -> dict[str, Any]:
        """As those of all spectra, with what is chosen where nothing is given."""
        manner = self.manner
        return super().settings(default_periods) | {
            "method": self.method or "exact",
            "hardening": self.inelastic.stiffness_ratio if self.inelastic else None,
            "maxima": manner.maxima.name,
            "interpolation": manner.interpolation.name,
        }

    @property
    def inelastic(self) -> inelastic.Wanted:
        """What is asked of oscillators that yield."""
        return inelastic.Wanted(self.ductility, self.strength, self.hardening)

    @property
    def manner(self) -> SpectrumSettings:
        """How elastic spectra are made."""
        load_numba()
        from tdint.analysis.spectra.elastic import choose_settings

        return choose_settings(self.method, self.maxima, self.interpolation)

    @property
    def stated(self) -> tuple[str, ...]:
        """What was chosen by name and therefore has a column."""
        return tuple(name for name in ("maxima", "interpolation") if getattr(self, name) is not None)


@click.command("spectrum")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True)
@options.units
@options.component
@options.inventory
@options.processing
@spectra.damping
@spectra.periods(_PERIODS, zero=" 0 gives the peak ground acceleration.")
@options.method
@click.option(
    "--maxima",
    type=click.Choice(["exact", "peer", "samples"]),
    help="Where the largest values are looked for: between the samples, too (exact, the default), at ten or more steps "
    "per period (peer, as PEER's own spectra), or at the record's samples (samples, as those of USGS, and with "
    "--method). Adds a column.",
)
@click.option(
    "--interpolation",
    type=click.Choice(["linear", "band-limited"]),
    help="The ground motion between its samples: straight lines (linear, the default), or the motion without "
    "frequencies above half the sampling rate (band-limited). Adds a column.",
)
@rotation.rotd
@inelastic.ductility
@inelastic.strength
@inelastic.hardening
@spectra.output
@spectra.plot
@options.jobs
@options.overwrite
@options.debug
def command(**given: Any) -> None:
    """Response spectra of ground-motion records, elastic and inelastic.

    RECORD is a file, or a folder for all records in it, - is standard input; all components are taken unless
    --component names one. CSV in SI units: relative displacement, pseudo-velocity, pseudo-acceleration, relative
    velocity and absolute acceleration, the largest from the first sample to the last, between the samples, too. They
    are exact for a ground motion that is linear between its samples, or come from --method with the record's sampling
    interval as its step. A record that fails does not keep the others from being done.

    --ductility and --strength make another table, of oscillators with bilinear hysteresis: yield force over weight,
    ductility, displacement at rest after the record, largest and yield displacement, yield force over mass, and largest
    elastic force over yield force.

    --rotd makes another table, of two horizontal components together: percentiles of the pseudo-acceleration over all
    directions, 180 of them, the geometric mean of both components, and the direction of the largest, in degrees from
    the first named component towards the second. They stand in one file, or in two that are named alike (K-NET, PEER,
    channel codes) or given as the only ones.
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    elastic = {"--method": request.method, "--maxima": request.maxima, "--interpolation": request.interpolation}
    request.inelastic.refuse({"--rotd": request.rotd, **elastic})
    if request.rotd:
        rotation.refuse({"--method": request.method, "--component": request.component})
    # What is wrong with these shall be told before any work.
    _ = request.chosen_periods(_PERIODS), request.manner
    making = spectra.Making("spectrum", _PERIODS, _compute, _table, _picture, _remark)
    spectra.make_tables(request, replace(making, gather=rotation.gather) if request.rotd else making)


def _compute(request: Request, records: Sequence[Record]) -> spectra.Results:
    """The spectra of the components of a record: elastic, over all directions, or of oscillators that yield."""
    from tdint.analysis.spectra.elastic import spectrum

    periods = request.chosen_periods(_PERIODS)
    manner = {"maxima": request.maxima, "interpolation": request.interpolation}
    if request.rotd:
        return rotation.compute(records, periods, request.damping, request.rotd, manner)
    if request.inelastic:
        lines = [line for record in records for line in request.inelastic.spectra(record, periods, request.damping)]
        return spectra.Results(lines, records)
    manner |= {"method": request.method}
    results = [spectrum(record, periods, damping, **manner) for record in records for damping in request.damping]
    return spectra.Results(results, records)


def _table(request: Request, results: Sequence[Any]) -> Table:
    from tdint.output.tables.inelastic import inelastic_table
    from tdint.output.tables.tables import rotated_table, spectrum_table

    if request.rotd:
        return rotated_table(results, request.stated)
    return inelastic_table(results) if request.inelastic else spectrum_table(results, request.stated)


def _picture(request: Request, results: Sequence[Any], suffix: str) -> Writer:
    from tdint.output.figures.inelastic import inelastic_picture
    from tdint.output.figures.rotated import rotated_picture
    from tdint.output.figures.spectrum import spectrum_picture

    draw = rotated_picture if request.rotd else inelastic_picture if request.inelastic else spectrum_picture
    return draw(results, suffix)


def _remark(request: Request, interval: float) -> str:
    """On periods at which the ground motion between the samples matters."""
    periods = request.chosen_periods(_PERIODS)
    limit = _SAMPLES_PER_PERIOD * interval
    if not any((periods > 0.0) & (periods < limit * (1.0 - 1e-9))):
        return ""
    manner = request.manner
    return (
        f"below a period of {limit:.6g} s ({_SAMPLES_PER_PERIOD} sampling intervals) the ground motion between its "
        f"samples matters: taken as {manner.interpolation.words}, maxima {manner.maxima.words}"
    )
