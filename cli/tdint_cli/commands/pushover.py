"""`tdint pushover`: the base shear of a building over its roof displacement."""

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
    help="Forces on the floors: the masses times the first mode (by default), times 1, or times "
    "the height.",
)
@options.option(
    "--drift",
    type=drift_size,
    default="4%",
    help="How far the roof is pushed: a ratio of the building's height (0.04 or 4%, by default) "
    "or a length (200mm).",
)
@options.option(
    "--points",
    type=Count(1, 100_000),
    default=200,
    help="Steps of the roof displacement; 200 by default.",
)
@options.studies.target(
    "The displacement to which a design spectrum pushes the building, in place of the curve"
)
@options.output.to_files(picture=options.output.PICTURE, page=True)
def command(
    model: str, pattern: str, drift: DriftSize, points: int, target: str | None, outputs: Outputs
) -> None:
    """Run a static pushover analysis: base shear over roof displacement.

    Forces of one pattern on the floors grow until the first story gives way, and fall as it does,
    to zero at the most. The roof's displacement is led, through peaks and down falling branches,
    with the model's P-delta, without dashpots and damping. MODEL.yaml is a model file, - is
    standard input. CSV, one row per step: displacement of the roof and its ratio to the height,
    base shear, drifts of the stories. With --target one row per method and story: its drift where a
    design spectrum pushes the building to, by the N2 method (EN 1998-1, annex B) and by the
    coefficient method (ASCE 41-17, site class D, C_m 1); roof, base shear and oscillator stand on
    stderr and in the JSON beside -o.
    """
    from tdint.analysis.static import pushover
    from tdint.model.config.model_file import load_model

    loaded = load_model(model)
    result = pushover(loaded, drift, pattern=pattern, points=points)
    of_page = outputs.units or loaded.page_units
    outputs = outputs.else_in(loaded.output_units)
    options.analysis.warn_of(loaded)
    units = outputs.shown_units
    # With a target the table is that of its displacements; the curve goes into the picture alone.
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
    """The page of --report: what is refused of a target displacement is its verdict."""
    from tdint.output.page import Told, page_units
    from tdint.output.report import pushover_page
    from tdint.output.summary import files_read

    shown = page_units(units)
    verdict: list[tuple[bool | None, str]] = []
    for made in reached:
        roof = (
            f"{made.method}: target displacement {shown.text(made.roof_displacement, 'm')} of the "
            "roof"
        )
        verdict.append(
            (
                False if made.notes else None,
                ". ".join([roof, *(note.partition(": ")[2] for note in made.notes)]),
            )
        )
    said = [*_words(result, shown).splitlines(), *(_reached(made, shown) for made in reached)]
    told = Told(said, (), result.model.page_head, files_read(), verdict)
    return pushover_page(result, reached, told, units)


def _reached(made: TargetDisplacement, units: OutputUnits) -> str:
    """Where a method pushes the building to, and by which oscillator, in a sentence."""
    factors = "C0 {:.4g}, C1 {:.4g}, C2 {:.4g}".format(made.participation, *made.factors)
    if made.method == "n2":
        factors = (
            f"participation factor {made.participation:.4g}, over the elastic displacement "
            f"{made.factors[0]:.4g}"
        )
    return (
        f"{made.method}: the roof at {units.text(made.roof_displacement, 'm')}, base shear "
        f"{units.text(made.base_shear, 'N')}; T {made.period:.4g} s, Sa "
        f"{units.text(made.spectral_acceleration, 'm/s^2')}, mass {units.text(made.mass, 'kg')}, "
        f"idealized yield {units.text(made.yield_force, 'N')} at "
        f"{units.text(made.yield_displacement, 'm')}, strength ratio {made.strength_ratio:.3g}, "
        f"{factors}; largest drift in story {int(made.drift.argmax()) + 1}, "
        f"{units.text(float(made.drift.max()), 'm')}."
    )


def _words(result: Pushover, units: OutputUnits) -> str:
    """Peak and end in a sentence each."""
    last = -1
    text = f"{result.model.name}, {result.pattern} pattern: largest base shear "
    text += f"{units.text(result.largest_base_shear, 'N')} at a roof displacement of "
    text += units.text(result.roof_at_largest, "m")
    if not math.isnan(result.height):
        text += f" ({100.0 * result.roof_at_largest / result.height:.3g} % of the height)"
    most = int(result.drift[last].argmax())
    held = (
        f"At the end {units.text(result.base_shear[last], 'N')}"
        if result.base_shear[last]
        else "At the end nothing"
    )
    text += f".\n{held}; story {most + 1} has the largest drift, "
    text += f"{units.text(result.drift[last, most], 'm')}."
    return text + (f" It ends there: {result.ended}." if result.ended else "")
