"""What `tdint spectrum --target` makes without records: the table and the picture of the target alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import click

from tdint.analysis.defaults import PERIODS
from tdint.errors import UsageError
from tdint.output import figures
from tdint_cli.batch.sources import refuse_inputs
from tdint_cli.commands.ground_motions.spectrum_request import SpectrumRequest
from tdint_cli.options.output import Outputs

_NOT = ("method", "maxima", "interpolation", "rotd", "ductility", "strength", "axes", "against", "component", "units")


def write_target(request: SpectrumRequest) -> None:
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
    from tdint.output.summaries.summary import table_summary
    from tdint.output.tables.spectra import TARGET
    from tdint.output.tables.table import Table

    table = Table.of_results(TARGET, [target])

    def summarize() -> dict[str, Any]:
        settings = {"target": target.source, "damping": target.damping}
        return table_summary("spectrum", settings, [], table.meanings)

    outputs.deliver(table, lambda: figures.spectrum_curves.target_picture(target, request.shown_units), summarize)
