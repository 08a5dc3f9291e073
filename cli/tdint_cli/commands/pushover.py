"""`tdint pushover`: static pushover curve and target displacement of a building."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.grammar import Count, drift_size
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say, warn

if TYPE_CHECKING:
    from tdint.analysis.static import Pushover
    from tdint.analysis.target_displacement import TargetDisplacement
    from tdint.units import DriftSize, OutputUnits

PATTERNS = ("first-mode", "uniform", "triangular")


@options.command(
    "pushover",
    "tdint pushover office.yaml --drift 3% --plot=pushover.png",
    "tdint pushover office.yaml --target asce7:sds=1.0,sd1=0.6,tl=8",
)
@options.analysis.model
@options.option(
    "--pattern",
    type=click.Choice(PATTERNS),
    default=PATTERNS[0],
    help="Pattern of the floor forces: masses times the first mode shape (first-mode, default), "
    "times 1 (uniform), or times the height (triangular).",
)
@options.option(
    "--drift",
    type=drift_size,
    default="4%",
    help="Maximum roof displacement: a ratio of the building height (0.04 or 4%; 4% is the "
    "default) or a length (200mm).",
)
@options.option(
    "--points",
    type=Count(1, 100_000),
    default=200,
    help="Number of steps of the roof displacement; 200 by default.",
)
@options.studies.target(
    "Write the target displacement for a design spectrum instead of the pushover curve"
)
@options.output.to_files(picture=options.output.PICTURE, page=True)
def command(
    model: str, pattern: str, drift: DriftSize, points: int, target: str | None, outputs: Outputs
) -> None:
    """Run a static pushover analysis: base shear over roof displacement.

    The analysis is displacement-controlled: the roof displacement increases to --drift under floor
    forces with a fixed pattern, past the maximum base shear and along descending branches; it stops
    if the base shear falls to zero. P-delta of the model is included; dashpots and damping are not.
    MODEL.yaml is a model file, - is standard input. CSV, one row per step: roof displacement and
    its ratio to the height, base shear, story drifts. With --target, one row per method and story:
    the drift at the target displacement, by the N2 method (EN 1998-1, annex B) and by the
    coefficient method (ASCE 41-17, site class D, C_m 1). Roof displacement, base shear and
    equivalent oscillator are reported on standard error and in the JSON file next to -o.
    """
    from tdint.analysis.static import pushover
    from tdint.model.config.model_file import load_model

    loaded = load_model(model)
    result = pushover(loaded, drift, pattern=pattern, points=points)
    of_page = outputs.units or loaded.page_units
    outputs = outputs.else_in(loaded.output_units)
    options.analysis.warn_of(loaded)
    units = outputs.shown_units
    # With a target the table lists target displacements; the curve is only in the figure.
    if target is None:
        outputs.deliver(
            tables.buildings.pushover_table(result),
            lambda: figures.comparison.pushover_picture(result, units),
            page=lambda: _page(result, (), of_page),
        )
        say(_words(result, units))
        return
    from tdint.analysis.target_displacement import target_displacements

    reached = tuple(target_displacements(result, target))
    of_building = tables.buildings.target_building_table(reached).in_units(units)
    outputs.deliver(
        tables.buildings.target_table(reached),
        lambda: figures.comparison.target_picture(reached, units),
        lambda: of_building.as_summary("targets"),
        lambda: _page(result, reached, of_page),
    )
    say(_words(result, units))
    for made in reached:
        say(_reached(made, units))
    warn(*(note for made in reached for note in made.notes))


def _page(result: Pushover, reached: Sequence[TargetDisplacement], units: OutputUnits) -> bytes:
    """Return the page of --report.

    The verdict lists the target displacements and the reasons for which one is not valid.

    Parameters
    ----------
    result : Pushover
        The pushover curve.
    reached : sequence of TargetDisplacement
        The target displacements; empty without --target.
    units : OutputUnits
        The units of the values.
    """
    from tdint.output.building_report import method_name, pushover_page
    from tdint.output.page import Told, page_units
    from tdint.output.summary import files_read

    shown = page_units(units)
    verdict: list[tuple[bool | None, str]] = []
    for made in reached:
        roof = (
            f"{method_name(made.method)}: target displacement of the roof "
            f"{shown.text(made.roof_displacement, 'm')}"
        )
        reasons = (note.partition(": ")[2] for note in made.notes)
        parts = [roof, *(f"{reason[:1].upper()}{reason[1:]}" for reason in reasons)]
        verdict.append((False if made.notes else None, f"{'. '.join(parts)}."))
    said = [*_words(result, shown).splitlines(), *(_reached(made, shown) for made in reached)]
    told = Told(said, (), result.model.page_head, files_read(), verdict)
    return pushover_page(result, reached, told, units)


def _reached(made: TargetDisplacement, units: OutputUnits) -> str:
    """Return a sentence on the target displacement of a method and the equivalent oscillator.

    Parameters
    ----------
    made : TargetDisplacement
        Target displacement and the properties of the equivalent oscillator.
    units : OutputUnits
        Units of the values in the text.
    """
    factors = "C0 {:.4g}, C1 {:.4g}, C2 {:.4g}".format(made.participation, *made.factors)
    if made.method == "n2":
        factors = (
            f"participation factor {made.participation:.4g}, displacement amplification "
            f"{made.factors[0]:.4g}"
        )
    return (
        f"{made.method}: roof displacement {units.text(made.roof_displacement, 'm')}, base shear "
        f"{units.text(made.base_shear, 'N')}; T {made.period:.4g} s, Sa "
        f"{units.text(made.spectral_acceleration, 'm/s^2')}, mass {units.text(made.mass, 'kg')}, "
        f"idealized yield {units.text(made.yield_force, 'N')} at "
        f"{units.text(made.yield_displacement, 'm')}, strength ratio {made.strength_ratio:.3g}, "
        f"{factors}; maximum drift {units.text(float(made.drift.max()), 'm')} in story "
        f"{int(made.drift.argmax()) + 1}."
    )


def _words(result: Pushover, units: OutputUnits) -> str:
    """Return a sentence on the maximum base shear and a sentence on the last step.

    Parameters
    ----------
    result : Pushover
        Result of the pushover analysis.
    units : OutputUnits
        Units of the values in the text.
    """
    last = -1
    text = f"{result.model.name}, {result.pattern} pattern: maximum base shear "
    text += f"{units.text(result.largest_base_shear, 'N')} at a roof displacement of "
    text += units.text(result.roof_at_largest, "m")
    if not math.isnan(result.height):
        text += f" ({100.0 * result.roof_at_largest / result.height:.3g} % of the height)"
    most = int(result.drift[last].argmax())
    held = (
        f"At the last step: base shear {units.text(result.base_shear[last], 'N')}"
        if result.base_shear[last]
        else "At the last step: base shear 0"
    )
    text += f".\n{held}; maximum drift {units.text(result.drift[last, most], 'm')} in story "
    text += f"{most + 1}."
    return text + (f" Stopped: {result.ended}." if result.ended else "")
