"""`tdint modes`: the modes of a building as CSV."""

from __future__ import annotations

from tdint_cli import options


@options.command("modes")
@options.building.model
def command(model: str) -> None:
    """Periods, damping ratios and modal masses of a building.

    MODEL.yaml is a model file, - is standard input. CSV on standard output, one row per undamped mode of the initial
    stiffness: period, frequency, damping ratio, participation factor of the shape with unit roof displacement,
    effective modal mass over the total mass, and its sum so far.
    """
    from tdint.model.building import assemble
    from tdint.model.config.read import load_model
    from tdint.output.tables.tables import mode_table
    from tdint_cli.terminal.drawing import emit_table
    from tdint_cli.terminal.streams import note

    building = assemble(load_model(model))
    modes = building.modes()
    damping = modes.damping_ratios(building.damping_matrix())
    emit_table(mode_table(modes, damping))
    if damping is None:
        note("the damping couples the modes; none of them has a damping ratio of its own")
