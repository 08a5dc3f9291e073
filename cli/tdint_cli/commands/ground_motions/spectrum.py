"""`tdint spectrum`: response spectra of records, or a target spectrum alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import click

from tdint.analysis.defaults import PERIODS
from tdint.errors import UsageError
from tdint.output import figures
from tdint_cli import options
from tdint_cli.commands.ground_motions import spectrum_kinds as kinds
from tdint_cli.commands.ground_motions.spectrum_request import AXES, Kind, SpectrumRequest
from tdint_cli.commands.ground_motions.spectrum_tables import make_tables
from tdint_cli.options.output import Outputs, refuse_inputs

_NOT = ("method", "maxima", "interpolation", "rotd", "ductility", "strength", "axes", "against", "component", "units")
"""Options that a target alone does not take."""


@options.command("spectrum")
@options.record.of_records_if_any
@options.record.one_scale
@options.spectra.tables_of_records(AXES)
@options.of(SpectrumRequest)
def command(request: SpectrumRequest) -> None:
    """Response spectra of ground-motion records, elastic and inelastic.

    RECORD is a file, or a folder for all records in it, - is standard input; all components are taken unless
    --component names one. CSV: relative displacement, pseudo-velocity, pseudo-acceleration, relative
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

    --oscillator with --history makes another table, of the motion of oscillators at the record's samples: relative
    displacement and velocity, absolute acceleration.

    --target without RECORD writes the design spectrum itself: displacement, pseudo-velocity, pseudo-acceleration.

    --against makes another table, of one column of a published spectrum and what is computed at its periods.
    """
    if not request.records:
        _write_target(request)
        return
    make_tables(request, _kind(request))


def _kind(request: SpectrumRequest) -> Kind:
    """The kind of spectra that is asked for."""
    if request.against:
        return kinds.Against()
    if request.ductility or request.strength:
        return kinds.Inelastic()
    if request.oscillator:
        return kinds.Histories()
    return kinds.Rotated() if request.rotd else kinds.Elastic()


def _write_target(request: SpectrumRequest) -> None:
    """Write the table of a target spectrum, and its picture if asked for.

    Raises
    ------
    UsageError
        There is no target either; an option that is for records.
    TdintError
        The target cannot be read, or has no such periods; an output that cannot be written.
    """
    target = request.aim
    if target is None:
        raise UsageError("Missing argument 'RECORD...'. Without one, --target makes a table.")
    request.refuse((*_NOT, "inventory"), "is for records, and there is none")
    if click.get_current_context().get_parameter_source("damping") == click.core.ParameterSource.COMMANDLINE:
        raise UsageError("--damping is for records; a design spectrum takes it by name: ec8:...,damping=2%")
    if request.is_folder:
        raise UsageError("-o is the file of one table here, not a folder")
    outputs = Outputs.checked(request.output, request.plot, request.overwrite, units=request.output_units)
    refuse_inputs(outputs.files, [request.target])
    if request.period or request.periods is not None:
        periods = request.chosen_periods(PERIODS)
        if min(periods) <= 0.0:
            raise UsageError("--period 0: a target has positive periods")
        target = replace(target, periods=periods, psa=target.at(periods))
    from tdint.output.summary import table_summary
    from tdint.output.tables.spectra import TARGET
    from tdint.output.tables.table import Table

    table = Table.of_results(TARGET, [target])

    def summarize() -> dict[str, Any]:
        settings = {"target": target.source, "damping": target.damping}
        return table_summary("spectrum", settings, [], table.meanings)

    outputs.deliver(table, lambda: figures.spectrum_curves.target_picture(target, request.shown_units), summarize)
