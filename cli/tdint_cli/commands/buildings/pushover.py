"""`tdint pushover`: the base shear of a building over its roof displacement."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.output import Outputs
from tdint_cli.options.values import drift_size
from tdint_cli.terminal import say

if TYPE_CHECKING:
    from tdint.analysis.static.pushover import Pushover
    from tdint.output_units import OutputUnits
    from tdint.units import DriftSize

PATTERNS = ("first-mode", "uniform", "triangular")


@options.command("pushover")
@options.building.model
@options.option(
    "--pattern",
    type=click.Choice(PATTERNS),
    default=PATTERNS[0],
    help="Forces on the floors: the masses times the first mode (by default), times 1, or times the height.",
)
@options.option(
    "--drift",
    type=drift_size,
    default="4%",
    metavar="DRIFT",
    help="How far the roof is pushed: a ratio of the building's height (0.04 or 4%, by default) or a length (200mm).",
)
@options.option(
    "--points",
    type=click.IntRange(1, 100_000),
    default=200,
    metavar="COUNT",
    help="Steps of the roof displacement; 200 by default.",
)
@options.output.to_files()
def command(model: str, pattern: str, drift: DriftSize, points: int, outputs: Outputs) -> None:
    """Base shear of a building over its roof displacement, pushed slowly.

    MODEL.yaml is a model file, - is standard input. Forces of one pattern on the floors grow until the first story
    gives way, and fall as it does, to zero at the most: the roof's displacement is led, through peaks and down falling
    branches, with the model's P-delta, without dashpots and damping. CSV, one row per step: displacement of
    the roof and its ratio to the height, base shear, drifts of the stories.
    """
    from tdint.analysis.static.pushover import pushover
    from tdint.model.config.model_file import load_model

    loaded = load_model(model)
    result = pushover(loaded, drift, pattern=pattern, points=points)
    outputs = outputs.else_in(loaded.output_units)
    units = outputs.shown_units
    outputs.deliver(tables.buildings.pushover_table(result), lambda: figures.statics.pushover_picture(result, units))
    say(_words(result, units))


def _words(result: Pushover, units: OutputUnits) -> str:
    """Peak and end in a sentence each."""
    last = -1
    text = f"{result.model.name}, {result.pattern} pattern: largest base shear "
    text += f"{units.text(result.largest_base_shear, 'N')} at a roof displacement of "
    text += units.text(result.roof_at_largest, "m")
    if not math.isnan(result.height):
        text += f" ({100.0 * result.roof_at_largest / result.height:.3g} % of the height)"
    most = int(result.drift[last].argmax())
    text += f".\nAt the end {units.text(result.base_shear[last], 'N')}; story {most + 1} has the largest drift, "
    text += f"{units.text(result.drift[last, most], 'm')}."
    return text + (" It ends there: the building carries nothing any more." if result.falls else "")
