"""`tdint modes`: the modes of a building as CSV, and their shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.grammar import Mode, refuse_idle
from tdint_cli.terminal import note, say, warn

if TYPE_CHECKING:
    from tdint.model.definition import Model
    from tdint_cli.options.output import Outputs


MODES = (_OF_BUILDING := Mode("without --target", frozenset({"shapes"})), _PEAKS := Mode("with --target"))


@options.command(
    "modes",
    "tdint modes office.yaml",
    "tdint modes office.yaml --target ec8:type=1,soil=B,ag=0.25g",
)
@options.analysis.model
@options.option(
    "--shapes",
    type=click.Choice(["roof", "participation"]),
    common=True,
    help="Also a column for each floor with its ordinate: 1 at the roof, or such that the participation factor is 1 "
    "(the sum over all modes is 1 at each floor then).",
)
@options.studies.target("The peaks of the stories under a design spectrum, by modes, in place of the modes")
@options.output.to_files(
    picture="Also draw the shapes of the first modes, or the peaks of the stories, to this file (.png, .pdf, .svg) or "
    "beside -o."
)
def command(model: str, shapes: str | None, target: str | None, outputs: Outputs) -> None:
    """Periods, damping ratios, modal masses and shapes of a building.

    CSV, one row per undamped mode of the initial stiffness: period, frequency, damping ratio, participation factor of
    the shape with unit roof displacement, effective modal mass over the total mass, and its sum so far. MODEL.yaml is a
    model file, - is standard input. With --target one row per story: drifts, shears and displacements of the linear
    building under a design spectrum, modal peaks combined by SRSS and CQC.
    """
    refuse_idle(_OF_BUILDING if target is None else _PEAKS, MODES)
    from tdint.model.building import assemble
    from tdint.model.config.model_file import load_model

    loaded = load_model(model)
    outputs = outputs.else_in(loaded.output_units)
    options.analysis.warn_of(loaded)
    if target is not None:
        _peaks(loaded, target, outputs)
        return
    building = assemble(loaded)
    modes = building.modes()
    matrix = building.damping_matrix()
    outputs.deliver(
        tables.buildings.mode_table(modes, modes.own_damping(matrix), shapes),
        lambda: figures.comparison.mode_picture(modes, name=loaded.name, norm=shapes or "roof"),
    )
    if modes.damping_ratios(matrix) is None:
        note("the damping couples the modes; each ratio is that of the mode moving alone")


def _peaks(model: Model, target: str, outputs: Outputs) -> None:
    """The peaks of the stories under a design spectrum."""
    from tdint.analysis.spectra.modal import modal_response

    result, units = modal_response(model, target), outputs.shown_units
    outputs.deliver(
        tables.buildings.modal_response_table(result), lambda: figures.comparison.modal_response_picture(result, units)
    )
    # Both sums are told: modes that lie close to each other differ by them.
    cqc, srss = (units.text(float(shear[0]), "N") for shear in (result.shear_cqc, result.shear_srss))
    roof = units.text(float(result.displacement_cqc[-1]), "m")
    say(
        f"{model.name}, linear with its initial stiffness, under {result.target.source}: base shear {cqc} by CQC, "
        f"{srss} by SRSS, roof {roof}." + (" All modes are in it: no mass is missing." if not result.left_out else "")
    )
    damping = result.target.damping
    note(f"the target is taken for all modes{f', for {100.0 * damping:g} % of damping' if damping else ''}")
    for count, text in (
        (result.rigid, "move with the ground: the target's value at 0 s is taken"),
        (result.left_out, "are left out: the target has no value at 0 s"),
    ):
        if count:
            mass = 100.0 * float(result.mass_ratio[-count:].sum())
            warn(f"{count} modes shorter than the target, {mass:.3g} % of the mass, {text}")
