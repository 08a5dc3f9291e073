"""`tdint modes`: the modes of a building as CSV, and their shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError
from tdint.output import figures, tables
from tdint.output.spectrum_text import spectrum_text
from tdint_cli import options
from tdint_cli.options.grammar import Mode, refuse_idle
from tdint_cli.terminal import note, say, warn

if TYPE_CHECKING:
    from tdint.analysis.spectra.modal import ModalResponse
    from tdint.model.definition import Model
    from tdint.units import OutputUnits
    from tdint_cli.options.output import Outputs


MODES = (
    _OF_BUILDING := Mode("without --target", frozenset({"shapes"})),
    _PEAKS := Mode("with --target"),
)


@options.command(
    "modes",
    "tdint modes office.yaml",
    "tdint modes office.yaml --target ec8:type=1,soil=B,ag=0.25g",
)
@options.analysis.model
@options.option(
    "--shapes",
    type=click.Choice(["roof", "participation"]),
    help="Also a column for each floor with its ordinate: 1 at the roof, or such that the "
    "participation factor is 1 (the sum over all modes is 1 at each floor then).",
)
@options.studies.target(
    "The peaks of the stories under a design spectrum, by modes, in place of the modes"
)
@options.output.to_files(
    picture="Also draw the shapes of the first modes, or the peaks of the stories, to this file "
    "(.png, .pdf, .svg) or beside -o.",
    page=True,
)
def command(model: str, shapes: str | None, target: str | None, outputs: Outputs) -> None:
    """Compute natural periods, damping ratios, modal masses and shapes of a building.

    CSV, one row per undamped mode of the initial stiffness: period, frequency, damping ratio,
    participation factor of the shape with unit roof displacement, effective modal mass over the
    total mass, and its sum so far. MODEL.yaml is a model file, - is standard input. With --target
    one row per story: drifts, shears and displacements of the linear building under a design
    spectrum, modal peaks combined by SRSS and CQC; accelerations of and forces on the floors,
    overturning moments; the JSON beside -o has the share of each mode.
    """
    refuse_idle(_OF_BUILDING if target is None else _PEAKS, MODES)
    if outputs.report and target is None:
        raise UsageError("--report is the page of the peaks under a design spectrum: add --target")
    from tdint.model.building import assemble
    from tdint.model.config.model_file import load_model

    loaded = load_model(model)
    options.analysis.warn_of(loaded)
    if target is not None:
        _peaks(loaded, target, outputs)
        return
    outputs = outputs.else_in(loaded.output_units)
    building = assemble(loaded)
    modes = building.modes()
    matrix = building.damping_matrix()
    outputs.deliver(
        tables.buildings.mode_table(modes, modes.own_damping(matrix), shapes),
        lambda: figures.comparison.mode_picture(modes, name=loaded.name, norm=shapes or "roof"),
    )
    if modes.damping_ratios(matrix) is None:
        note("the damping couples the modes; each ratio is that of the mode moving alone")
    if building.isolators:
        note(
            "these are before the isolators yield; `tdint run --report` has the period at their "
            "peak drift"
        )


def _peaks(model: Model, target: str, outputs: Outputs) -> None:
    """The peaks of the stories under a design spectrum."""
    from tdint.analysis.spectra.modal import response_spectrum_analysis
    from tdint.model.building import assemble

    of_page, outputs = outputs.units or model.page_units, outputs.else_in(model.output_units)
    result, units = response_spectrum_analysis(model, target), outputs.shown_units
    warnings = []
    for count, text in (
        (result.rigid, "move with the ground: the target's value at 0 s is taken"),
        (result.left_out, "are left out: the target has no value at 0 s"),
    ):
        if count:
            mass = 100.0 * float(result.mass_ratio[-count:].sum())
            warnings.append(
                f"{count} modes shorter than the target, {mass:.3g} % of the mass, {text}"
            )
    # Which damping stands in the numbers, and which of the model does not.
    damping, ratio = result.target.damping, assemble(model).first_mode()[1]
    noted = (
        "the target spectrum stands for every "
        f"mode{f', at {100.0 * damping:g} % damping' if damping else ''}; "
    )
    noted += f"the model's own damping, {100.0 * ratio:.3g} % in the first mode, is ignored"

    def page() -> bytes:
        from tdint.output.page import Told, page_units
        from tdint.output.report import modal_page
        from tdint.output.summary import files_read

        said = [_peak_words(result, page_units(of_page)), f"{noted[0].upper()}{noted[1:]}."]
        return modal_page(result, Told(said, warnings, model.page_head, files_read()), of_page)

    modes = tables.buildings.modal_share_table(result).in_units(units)
    outputs.deliver(
        tables.buildings.modal_response_table(result),
        lambda: figures.comparison.modal_response_picture(result, units),
        lambda: {
            "modes": [dict(zip(modes.columns, row, strict=True)) for row in modes.rows],
            "meanings": modes.meanings,
        },
        page,
    )
    say(_peak_words(result, units))
    note(noted)
    warn(*warnings)


def _peak_words(result: ModalResponse, units: OutputUnits) -> str:
    """The base shear and the roof in a sentence."""
    # Both sums are told: modes that lie close to each other differ by them.
    cqc, srss = (
        units.text(float(shear[0]), "N") for shear in (result.shear_cqc, result.shear_srss)
    )
    roof = units.text(float(result.displacement_cqc[-1]), "m")
    share = 100.0 * result.base_shear[0] ** 2 / float((result.base_shear**2).sum())
    return (
        f"{result.model.name}, linear with its initial stiffness, under "
        f"{spectrum_text(result.target.source)}: "
        f"base shear {cqc} by CQC, {srss} by SRSS, {share:.3g} % of its square from the first "
        f"mode; roof {roof}."
        + (" All modes are in it: no mass is missing." if not result.left_out else "")
    )
