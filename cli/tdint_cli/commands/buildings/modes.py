"""`tdint modes`: the modes of a building as CSV, and their shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.terminal import note

if TYPE_CHECKING:
    from tdint_cli.options.output import Outputs


@options.command("modes")
@options.building.model
@options.option(
    "--shapes",
    type=click.Choice(["roof", "participation"]),
    help="Also a column for each floor with its ordinate: 1 at the roof, or such that the participation factor is 1 "
    "(the sum over all modes is 1 at each floor then).",
)
@options.output.to_files(
    picture="Also draw the shapes of the first modes, to this file (.png, .pdf, .svg) or beside -o."
)
def command(model: str, shapes: str | None, outputs: Outputs) -> None:
    """Periods, damping ratios, modal masses and shapes of a building.

    MODEL.yaml is a model file, - is standard input. CSV, one row per undamped mode of the initial
    stiffness: period, frequency, damping ratio, participation factor of the shape with unit roof displacement,
    effective modal mass over the total mass, and its sum so far.
    """
    from tdint.model.building import assemble
    from tdint.model.config.model_file import load_model

    loaded = load_model(model)
    building = assemble(loaded)
    modes = building.modes()
    matrix = building.damping_matrix()
    outputs.else_in(loaded.output_units).deliver(
        tables.buildings.mode_table(modes, modes.own_damping(matrix), shapes),
        lambda: figures.statics.mode_picture(modes, name=loaded.name, norm=shapes or "roof"),
    )
    if modes.damping_ratios(matrix) is None:
        note("the damping couples the modes; each ratio is that of the mode moving alone")
