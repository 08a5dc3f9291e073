"""`tdint pushover`: static pushover curve and target displacement of a building."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import AnalysisError
from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.option_types import Count, Number
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import note, say, warn

if TYPE_CHECKING:
    from tdint.response.static.pushover import Pushover
    from tdint.response.static.target_displacement import TargetDisplacement
    from tdint.units import DriftSize, OutputUnits

_MAX_EVENTS = 12  # changes of stiffness of elements that are printed; the JSON file lists all


@options.command
@options.analysis.model
@options.analysis.changes
@options.option("--pattern", default="first-mode")
@options.option("--drift", default="4%")
@options.option("--points", type=Count(1, 100_000), default=200)
@options.spectra.target(
    "Write the target displacement for a design spectrum instead of the pushover curve"
)
@options.option(
    "--site-class",
    type=click.Choice(("A", "B", "C", "D", "E", "F"), case_sensitive=False),
    default="D",
)
@options.option("--mass-factor", type=Number(0.0, 1.0, min_open=True), default=1.0)
@options.output.to_files(picture=True, page=True)
def command(
    model: str,
    changes: dict[str, str],
    pattern: str,
    drift: DriftSize,
    points: int,
    target: str | None,
    site_class: str,
    mass_factor: float,
    outputs: Outputs,
) -> None:
    """Run a static pushover analysis: applied force over roof displacement.

    The analysis is displacement-controlled: the roof displacement increases to --drift under floor
    forces with a fixed pattern, past their maximum and along descending branches; it stops if the
    forces fall to zero. P-delta of the model is included; dashpots and damping are not.
    MODEL.yaml is a model file, - is standard input. CSV, one row per step: roof displacement and
    its ratio to the height, base shear (restoring force of the first story), sum of the applied
    forces, story drifts. With --target, one row per method and story: the drift at the target
    displacement, by the N2 method (EN 1998-1, annex B) and by the coefficient method (ASCE 41-17).
    Roof displacement, base shear and equivalent oscillator are reported on standard error and in
    the JSON file next to -o.
    """
    from tdint.model.config.model_file import load_model
    from tdint.response.static.pushover import pushover

    loaded = options.analysis.changed(load_model(model), changes)
    page_units = outputs.units or loaded.page_units
    outputs = outputs.else_in(loaded.output_units)
    loaded = replace(loaded, output_units=outputs.shown_units)
    result = pushover(loaded, drift, pattern=pattern, points=points)
    options.analysis.warn_of(loaded)
    if loaded.has_p_delta:
        note(
            "since version 0.2.0, base_shear_N is the restoring force of the first story; the sum "
            "of the applied forces, which is smaller with P-delta, is applied_force_N"
        )
    if loaded.attachments:
        note("the pushover is without the attachments, their masses and their weights")
    units = outputs.shown_units
    # With a target the table lists target displacements; the curve is only in the figure. If the
    # target is after the end of the curve, the curve is the result, and the error follows.
    targets: tuple[TargetDisplacement, ...] = ()
    beyond: AnalysisError | None = None
    if target is not None:
        from tdint.response.static.target_displacement import target_displacements

        try:
            targets = tuple(
                target_displacements(result, target, site_class=site_class, mass_factor=mass_factor)
            )
        except AnalysisError as error:
            beyond = error
    if not targets:
        outputs.deliver(
            tables.buildings.pushover_table(result),
            lambda: figures.static_curves.pushover_picture(result, units),
            lambda: _events(result, units),
            page=lambda: _page(result, (), page_units),
        )
        say(_result_text(result, units))
        if beyond is not None:
            note("the output is the pushover curve, because there is no target displacement")
            raise beyond
        return
    building_table = tables.table.Table.of_results(
        tables.buildings.TARGET_OF_BUILDING, targets
    ).in_units(units)
    events = _events(result, units)
    outputs.deliver(
        tables.table.Table.of_results(tables.buildings.TARGET_DISPLACEMENT, targets),
        lambda: figures.static_curves.target_picture(targets, units),
        lambda: {**events, **building_table.as_summary("targets")},
        lambda: _page(result, targets, page_units),
    )
    say(_result_text(result, units))
    for displacement in targets:
        say(_target_sentence(displacement, units))
    warn(*(note for displacement in targets for note in displacement.notes))


def _events(result: Pushover, units: OutputUnits) -> dict[str, Any]:
    """Return the changes of stiffness of elements for the JSON file; empty without elements."""
    if not result.events:
        return {}
    table = tables.table.Table.of_results(tables.buildings.ELEMENT_EVENTS, result.events).in_units(
        units
    )
    return {"element_events": table.as_summary("events")}


def _page(result: Pushover, targets: Sequence[TargetDisplacement], units: OutputUnits) -> bytes:
    """Return the HTML page of --report.

    The verdict at its top lists the target displacements. If a target displacement is not valid,
    its line in the verdict contains the reasons.

    `targets` contains the target displacements; empty without --target.
    """
    from tdint.output.page import PageText, page_units
    from tdint.output.report import METHOD_NAMES, pushover_page

    shown_units = page_units(units)
    verdict: list[tuple[bool | None, str]] = []
    for target in targets:
        roof = (
            f"{METHOD_NAMES[target.method]}: target displacement of the roof "
            f"{shown_units.text(target.roof_displacement, 'm')}"
        )
        # A note starts with the method, which the sentence already contains. A target displacement
        # with a note is not valid.
        reasons = (note.partition(": ")[2] for note in target.notes)
        sentences = [roof, *(f"{reason[:1].upper()}{reason[1:]}" for reason in reasons)]
        verdict.append((False if target.notes else None, f"{'. '.join(sentences)}."))
    lines = _result_text(result, shown_units).splitlines()
    page_text = PageText(lines, (), result.model.page_head, verdict=verdict)
    return pushover_page(result, targets, page_text, units)


def _target_sentence(target: TargetDisplacement, units: OutputUnits) -> str:
    """Return a sentence on the target displacement of a method and the equivalent oscillator.

    `target` contains the target displacement and the properties of the equivalent oscillator.
    """
    if target.method == "n2":
        factors = (
            f"participation factor {target.participation:.4g}, displacement amplification "
            f"{target.factors[0]:.4g}"
        )
    else:
        c1, c2 = target.factors
        factors = (
            f"C0 {target.participation:.4g}, C1 {c1:.4g}, C2 {c2:.4g}, C_m {target.mass_factor:g}, "
            f"site class {target.site_class} (a {target.site_factor:g})"
        )
        if math.isfinite(target.largest_ratio):
            factors += f", mu_max {target.largest_ratio:.3g}"
    return (
        f"{target.method}: roof displacement {units.text(target.roof_displacement, 'm')}, "
        f"applied force {units.text(target.applied_force, 'N')}; T {target.period:.4g} s, Sa "
        f"{units.text(target.spectral_acceleration, 'm/s^2')}, mass "
        f"{units.text(target.mass, 'kg')}, idealized yield {units.text(target.yield_force, 'N')} "
        f"at {units.text(target.yield_displacement, 'm')}, strength ratio "
        f"{target.strength_ratio:.3g}, {factors}; maximum drift "
        f"{units.text(float(target.drift.max()), 'm')} in story {int(target.drift.argmax()) + 1}."
    )


def _result_text(result: Pushover, units: OutputUnits) -> str:
    """Return a sentence on the maximum of the applied force and a sentence on the last step."""
    last = -1
    text = f"{result.model.name}, {result.pattern} pattern: maximum applied force "
    text += f"{units.text(result.largest_applied_force, 'N')} at a roof displacement of "
    text += units.text(result.roof_at_largest, "m")
    if not math.isnan(result.height):
        text += f" ({100.0 * result.roof_at_largest / result.height:.3g} % of the height)"
    story = int(result.drift[last].argmax())
    last_force = result.applied_force[last]
    force_text = units.text(last_force, "N") if last_force else "0"
    text += f".\nAt the last step: applied force {force_text}; maximum drift "
    text += f"{units.text(result.drift[last, story], 'm')} in story {story + 1}."
    if result.ended:
        text += f" Stopped: {result.ended}."
    for event in result.events[:_MAX_EVENTS]:
        stiffnesses = [
            units.text(stiffness, "N/m") if stiffness else "0"
            for stiffness in (event.stiffness_before, event.stiffness_after)
        ]
        text += (
            f"\nStory {event.story}, {event.element}: stiffness {' to '.join(stiffnesses)} at a "
            f"drift of {units.text(event.drift, 'm')}, applied force "
            f"{units.text(event.applied_force, 'N')}."
        )
    if len(result.events) > _MAX_EVENTS:
        text += f"\n{len(result.events) - _MAX_EVENTS} further changes of stiffness of elements."
    return text
