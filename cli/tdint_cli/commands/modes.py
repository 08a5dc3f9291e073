"""`tdint modes`: natural modes of a building, and response spectrum analysis."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from tdint.errors import TdintError
from tdint.output import figures, tables
from tdint.output.spectrum_text import spectrum_text
from tdint_cli import options
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.terminal import note, say, warn

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record
    from tdint.model.building import Building
    from tdint.model.definition import Model
    from tdint.output.figures.style import Figure
    from tdint.response.spectra.modal import ModalResponse
    from tdint.response.spectra.transfer import TransferFunction
    from tdint.units import OutputUnits
    from tdint_cli.options.output import Outputs


_MAX_BARE = 6  # maximum number of periods of the stories alone in a note
_GROUND = "ground"  # source of the motion for --transfer, as in `analysis.spectra.transfer`


@options.command
@options.analysis.model
@options.analysis.changes
@options.option("--shapes", is_flag=False, flag_value="roof")
@options.option("--transfer", is_flag=False, flag_value=_GROUND)
@options.spectra.target(
    "Run a response spectrum analysis and write the peak responses of the stories instead of the "
    "modes"
)
@options.output.to_files(picture=True, page=True)
def command(
    model: str,
    changes: dict[str, str],
    shapes: str | None,
    transfer: str | None,
    target: str | None,
    outputs: Outputs,
) -> None:
    """Compute natural periods, damping ratios, modal masses and shapes of a building.

    CSV, one row per undamped mode with initial stiffness: period, frequency, damping ratio,
    participation factor of the shape with unit roof displacement, effective modal mass divided by
    the total mass, and cumulative effective modal mass; with dampers, also the period and damping
    ratio of the damped (complex) modes. MODEL.yaml is a model file, - is standard
    input. With --target, one row per story: drifts, shears and displacements of the linear building
    under a design spectrum, with modal peaks combined by SRSS and CQC; floor accelerations, floor
    forces and overturning moments. The JSON file next to -o contains the contribution of each mode.

    With --transfer, one row per frequency, denser at resonances: amplitude and phase of each floor
    in the harmonic steady state, with the initial stiffness. The damping of the model, dashpots
    and braced dampers are included exactly; power-law dashpots are refused.
    """
    table_name = "modes" if target is None else "peaks"
    refuse_idle("transfer" if transfer is not None else table_name)
    from tdint.model.building import assemble
    from tdint.model.config.model_file import load_model

    loaded = options.analysis.changed(load_model(model), changes)
    options.analysis.warn_of(loaded)
    page_units, outputs = outputs.units or loaded.page_units, outputs.else_in(loaded.output_units)
    if transfer is not None:
        _transfer(loaded, transfer, outputs, page_units)
        return
    if target is not None:
        _peaks(loaded, target, outputs, page_units)
        return
    building = assemble(loaded)
    modes = building.modes()
    matrix = building.damping_matrix()
    ratios = modes.own_damping(matrix)
    complex_modes = building.complex_modes() if loaded.has_dashpots else None
    floors = [f"floor {floor}" for floor in range(1, building.floors + 1)]
    names = (*(loaded.rows or floors), *(attachment.name for attachment in loaded.attachments))
    table = tables.buildings.mode_table(
        modes, ratios, shapes, names=names, complex_modes=complex_modes
    )
    notes = []
    if complex_modes is not None:
        notes.append(_complex_note(building))
    # `damping_ratios` also returns None for a negative ratio, which `warn_of` has reported.
    if modes.damping_ratios(matrix) is None and ratios.min() >= 0.0:
        notes.append(
            f"damping couples the modes because of {_coupling_cause(loaded)}; each damping ratio "
            "is for the mode without the coupling terms"
        )
    if loaded.devices:
        bare = assemble(replace(loaded, attachments=(), links=())).modes().omega
        periods = ", ".join(f"{2.0 * math.pi / omega:.4g}" for omega in bare[:_MAX_BARE].tolist())
        more = ", ..." if bare.size > _MAX_BARE else ""
        notes.append(
            "the modes are those of the complete system with attachments and links; the damping of "
            f"the stories uses their modes alone, with the periods {periods}{more} s"
        )
    if building.isolators:
        notes.append(
            "the modes are for the initial stiffness of the isolators; `tdint run --report` states "
            "the period at their peak drift"
        )

    def draw() -> Figure:
        """Return the figure of the shapes of the first modes."""
        return figures.mode_shapes.mode_picture(modes, name=loaded.name, norm=shapes or "roof")

    def page() -> bytes:
        """Return the HTML report of the modes, with the notes as sentences."""
        from tdint.output.page import PageText
        from tdint.output.report import mode_page

        record, record_notes = _record(loaded)
        sentences = [f"{text[0].upper()}{text[1:]}." for text in (*notes, *record_notes)]
        page_text = PageText(sentences=sentences, head=loaded.page_head)
        # The shapes are in the figure: omit their columns.
        page_table = tables.buildings.mode_table(modes, ratios, complex_modes=complex_modes)
        return mode_page(loaded, page_table, draw, page_text, page_units, record)

    outputs.deliver(table, draw, page=page)
    note(*notes)


def _transfer(model: Model, source: str, outputs: Outputs, units_of_page: OutputUnits) -> None:
    """Compute transfer functions, write their outputs and print the maximum of the roof."""
    from tdint.model.building import assemble
    from tdint.response.spectra.transfer import transfer_function

    result = transfer_function(model, source=int(source) if source.isdecimal() else source)
    warnings = []
    if not result.is_damped:
        warnings.append(
            "a mode is undamped: the amplitude at its frequency is unbounded, and the amplitudes "
            "near it depend on the frequencies of the table"
        )
    notes = []
    if not assemble(model).has_linear_laws:
        notes.append("the transfer functions are for the initial stiffness: no story yields")

    def page() -> bytes:
        """Return the HTML report of the transfer functions."""
        from tdint.output.page import PageText, page_units
        from tdint.output.report import transfer_page

        verdict = [(None, _transfer_sentence(result, page_units(units_of_page)))]
        sentences = [f"{text[0].upper()}{text[1:]}." for text in notes]
        page_text = PageText(sentences, warnings, model.page_head, verdict=verdict)
        return transfer_page(result, page_text, units_of_page)

    units = outputs.shown_units
    maxima = tables.transfer.resonance_table(result).in_units(units)
    outputs.deliver(
        tables.transfer.transfer_table(result),
        lambda: figures.mode_shapes.transfer_picture(result, units),
        lambda: maxima.as_summary("maxima"),
        page,
    )
    say(_transfer_sentence(result, units))
    note(*notes)
    warn(*warnings)


def _transfer_sentence(result: TransferFunction, units: OutputUnits) -> str:
    """Return a sentence on the maximum amplitude of the roof and its frequency."""
    roof = result.roof
    if result.source == _GROUND:
        amplitude = f"roof acceleration {roof.amplitude:.4g} times the ground acceleration"
    else:
        amplitude = (
            f"roof displacement {units.text(roof.amplitude, 'm/N')} per force on floor "
            f"{result.source}"
        )
    # The first period is the period of the undamped building without the braces of dampers.
    from tdint.model.building import assemble

    frequency = 1.0 / assemble(result.model).first_period
    return (
        f"{result.model.name}: maximum {amplitude}, at {roof.frequency:.4g} Hz; first natural "
        f"frequency {frequency:.4g} Hz."
    )


def _complex_note(building: Building) -> str:
    """Return the note on the modes with and without dampers."""
    from tdint.model.model_notes import POWER_LAW_OMITTED

    omitted = f"; {POWER_LAW_OMITTED}" if building.has_power_law_dampers else ""
    return (
        "period and damping are those of the undamped modes, without the braces of dampers; the "
        "columns complex_period_s, damped_period_s and complex_damping include the dampers"
        f"{omitted}"
    )


def _coupling_cause(model: Model) -> str:
    """Return the parts of a model whose damping is not proportional to its mass and stiffness."""
    causes = {
        "dashpots": model.has_dashpots,
        "isolators": any(story.isolator and not story.rayleigh for story in model.stories),
        "stories without Rayleigh damping": any(
            not (story.isolator or story.rayleigh) for story in model.stories
        ),
        "attachments and links": bool(model.devices),
        "P-delta, which reduces the stiffness but not the damping": model.has_p_delta,
    }
    present = [cause for cause, is_present in causes.items() if is_present]
    return " and ".join(present) or "the damping coefficients of the stories"


def _record(model: Model) -> tuple[Record | None, list[str]]:
    """Return the ground motion of a model for its spectrum in the report of `tdint modes`; None if
    the model has no record, reads it from standard input (`-`), or if the record cannot be read.

    The vibration modes of the building do not depend on the ground motion. If the record cannot be
    read, the command therefore continues without the spectrum, and the note states the reason.
    """
    from tdint.response.arguments import model_record

    source = model.excitation.record
    if source is None or source.file == "-":
        return None, []
    try:
        return model_record(model), []
    except TdintError as error:
        return None, [f"the spectrum of the ground motion is not drawn: {error}"]


def _peaks(model: Model, target: str, outputs: Outputs, units_of_page: OutputUnits) -> None:
    """Run a response spectrum analysis, write its outputs and print its summary."""
    from tdint.model.building import assemble
    from tdint.response.spectra.modal import response_spectrum_analysis

    result, units = response_spectrum_analysis(model, target), outputs.shown_units
    warnings = []
    # The modes outside of the target spectrum have the shortest periods. They are the last modes,
    # because the modes are sorted by decreasing period.
    for count, text in (
        (result.rigid, "are rigid: the value of the target at 0 s is used"),
        (result.left_out, "are ignored: the target has no value at 0 s"),
    ):
        if count:
            mass = 100.0 * float(result.mass_ratio[-count:].sum())
            warnings.append(
                f"{count} modes with periods below the range of the target, {mass:.3g} % of the "
                f"mass, {text}"
            )
    damping, model_damping = result.target.damping, assemble(model).first_mode()[1]
    damping_text = f", with {100.0 * damping:g} % damping" if damping else ""
    damping_note = (
        f"the target spectrum is used for all modes{damping_text}; the damping of the model, "
        f"{100.0 * model_damping:.3g} % in the first mode, is ignored"
    )
    if model.devices:
        strokes = ", ".join(
            f"{device.name} {units.text(float(value), 'm')}"
            for device, value in zip(model.devices, result.device_deformation_cqc, strict=True)
        )
        damping_note += f", as are dashpots of devices; their deformations by CQC: {strokes}"

    def page() -> bytes:
        """Return the HTML report of the response spectrum analysis."""
        from tdint.output.page import PageText, page_units
        from tdint.output.report import modal_page

        verdict = [(None, _peak_sentence(result, page_units(units_of_page)))]
        sentences = [f"{damping_note[0].upper()}{damping_note[1:]}."]
        page_text = PageText(sentences, warnings, model.page_head, verdict=verdict)
        return modal_page(result, page_text, units_of_page)

    modes = tables.table.Table.of_results(tables.buildings.MODAL_SHARE, [result]).in_units(units)
    outputs.deliver(
        tables.table.Table.of_results(tables.buildings.MODAL_RESPONSE, [result]),
        lambda: figures.mode_shapes.modal_response_picture(result, units),
        lambda: modes.as_summary("modes"),
        page,
    )
    say(_peak_sentence(result, units))
    note(damping_note)
    warn(*warnings)


def _peak_sentence(result: ModalResponse, units: OutputUnits) -> str:
    """Return a sentence on the base shear and the roof displacement; if all modes are included, a
    second sentence states this.
    """
    # Report the combinations of the modal peaks by CQC and by SRSS, because they differ for closely
    # spaced modes.
    cqc, srss = (
        units.text(float(shear[0]), "N") for shear in (result.shear_cqc, result.shear_srss)
    )
    roof = units.text(float(result.displacement_cqc[-1]), "m")
    # `base_shear` contains the base shear of each mode.
    share = 100.0 * result.base_shear[0] ** 2 / float((result.base_shear**2).sum())
    text = (
        f"{result.model.name}, linear with its initial stiffness, under "
        f"{spectrum_text(result.target.source)}: base shear {cqc} by CQC, {srss} by SRSS; mode 1 "
        f"contributes {share:.3g} % of the SRSS sum of squares; roof displacement {roof}."
    )
    if not result.left_out:
        text += " All modes are included (100 % of the mass)."
    return text
