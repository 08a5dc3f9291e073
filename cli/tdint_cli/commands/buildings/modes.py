"""`tdint modes`: the modes of a building as CSV."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tdint_cli import options
from tdint_cli.options.output import Outputs

if TYPE_CHECKING:
    from tdint.output_units import OutputUnits


@options.command("modes")
@options.analysis.plugin
@options.building.model
@options.output.output()
@options.output.units
@options.output.overwrite
def command(model: str, output: str | None, output_units: OutputUnits | None, overwrite: bool) -> None:
    """Periods, damping ratios and modal masses of a building.

    MODEL.yaml is a model file, - is standard input. CSV, one row per undamped mode of the initial
    stiffness: period, frequency, damping ratio, participation factor of the shape with unit roof displacement,
    effective modal mass over the total mass, and its sum so far.
    """
    from tdint.model.building import assemble
    from tdint.model.config.model_file import load_model
    from tdint.output.tables.buildings import mode_table
    from tdint_cli.terminal.streams import note

    outputs = Outputs.checked(output, None, overwrite, units=output_units)
    loaded = load_model(model)
    building = assemble(loaded)
    modes = building.modes()
    damping = modes.damping_ratios(building.damping_matrix())
    outputs.else_in(loaded.output_units).deliver(mode_table(modes, damping))
    if damping is None:
        note("the damping couples the modes; none of them has a damping ratio of its own")
