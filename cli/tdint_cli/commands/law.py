"""`tdint law`: the drift law of one story under imposed cycles of drift."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError
from tdint.output import figures, tables
from tdint.written_numbers import how_many
from tdint_cli import options
from tdint_cli.options.grammar import Count, FileName, ListOf, Mode, drift_size, refuse_idle
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say, say_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tdint.analysis.static import Cycle, CyclicTest
    from tdint.units import DriftSize, OutputUnits

_CYCLES = Mode("without --path", frozenset(("drifts", "cycles", "points")))
_PATH = Mode("with --path, which has every drift")
MODES = (_CYCLES, _PATH)
_POINTS = 200  # of an excursion: loops are smooth in print


@options.request
class Request:
    """The command line of `tdint law`."""

    model: str
    outputs: Outputs
    story: int = options.option(
        type=click.IntRange(min=1),
        default=1,
        metavar="NUMBER",
        help="The story to test, counted from the ground; 1 by default.",
    )
    drifts: tuple[DriftSize, ...] | None = options.option(
        "--drift",
        type=ListOf(drift_size, once=False),
        help="Amplitudes, one after the other: drift ratios (0.02 or 2%), lengths with their unit "
        "(20mm; m, cm, mm, in, ft), or multiples of the yield drift (4dy).",
    )
    cycles: int | None = options.option(
        type=Count(min=1), help="Cycles of each amplitude; 1 by default."
    )
    points: int | None = options.option(
        type=Count(min=1), help="Points of each quarter of a cycle; 200 by default."
    )
    path: str | None = options.option(
        type=FileName(),
        help="Any path of drifts in place of --drift, --cycles and --points: a CSV file with a "
        "column drift_m, - is standard input.",
    )
    units: str | None = options.option(
        needs="--path",
        type=click.Choice(["m", "dy"]),
        help="What the numbers of --path are: m by default, or multiples of the yield drift (dy).",
    )


@options.command(
    "law",
    "tdint law office.yaml --story 1 --drift 1%,2%",
    "tdint law office.yaml --drift 2% -o loop.csv --plot",
)
@options.analysis.model
@options.output.to_files(picture=options.output.PICTURE)
@options.of(Request)
def command(request: Request) -> None:
    """Test one story under imposed drift cycles and write its hysteresis loop.

    The story starts at rest; each cycle goes to the amplitude, to the same drift on the other side,
    and back to zero, as in a slow test in a laboratory. Nothing else of the building and no time
    takes part. MODEL.yaml is a model file,
    - is standard input. With --path it goes straight to each drift of a file, one row for each.
      CSV, one row per point: drift; the story's shear as `tdint run` reports it, without dashpots,
      damping and P-delta; the same with the model's P-delta (without p_delta in the model, equal);
      the law's tangent stiffness on the way to the point; the energy that it stores and has
      dissipated. drift_ratio is empty without a height.

    For the last cycle of each amplitude standard error tells the forces at its ends, the slope
    between these (secant stiffness), the energy dissipated, and the equivalent viscous damping
    ratio, energy / (4 pi secant stiffness drift^2 / 2).
    """
    if request.path is None and not request.drifts:
        raise UsageError("no drift: give --drift, or a path of drifts by --path")
    refuse_idle(_CYCLES if request.path is None else _PATH, MODES)
    if request.path == request.model == "-":
        raise UsageError("standard input is used for the model; specify the path as a file")
    from tdint.analysis.static import cyclic_test, path_test, read_drift_path
    from tdint.model.config.model_file import load_model

    each = request.cycles or 1
    imposed = None if request.path is None else read_drift_path(request.path)
    building = load_model(request.model)
    if imposed is None:
        test = cyclic_test(
            building,
            request.story,
            request.drifts or (),
            cycles=each,
            points=request.points or _POINTS,
        )
    else:
        test = path_test(building, request.story, imposed, in_yield_drifts=request.units == "dy")
    outputs = request.outputs.else_in(building.output_units)
    shown = outputs.shown_units
    outputs.deliver(
        tables.buildings.cyclic_table(test), lambda: figures.comparison.cyclic_picture(test, shown)
    )
    _report(test, test.cycles[each - 1 :: each] if request.path is None else (), shown)


def _report(test: CyclicTest, cycles: Sequence[Cycle], units: OutputUnits) -> None:
    """Say what was tested, and what came of these cycles, or without any of the path."""
    from tdint.model.definition import LAWS

    # The law and what the model says of it
    text = f"{test.model.name}, story {test.story}, {test.law} law: {LAWS[test.law].formula}\n"
    text += f"Initial stiffness {units.text(test.initial_stiffness, 'N/m')}"
    if not math.isnan(test.yield_drift):
        text += f", yield drift {units.text(test.yield_drift, 'm')}"
    if not math.isnan(test.yield_drift / test.height):
        text += f" (drift ratio {test.yield_drift / test.height:.4g})"
    if test.geometric_stiffness:
        text += f", geometric stiffness of P-delta {units.text(test.geometric_stiffness, 'N/m')}"
    say(f"{text}.")
    # A path has no cycles: its extremes
    if not cycles:
        path = test.path
        say(
            f"{how_many(path.drift.size, 'drift')} from {units.of(path.drift.min(), 'm'):.4g} to "
            f"{units.text(path.drift.max(), 'm')}, forces from "
            f"{units.of(path.shear.min(), 'N'):.4g} to {units.text(path.shear.max(), 'N')}, "
            f"{units.text(path.hysteretic_energy[-1], 'J')} dissipated."
        )
        return
    length, force, slope, energy = (units.unit(si)[0] for si in ("m", "N", "N/m", "J"))
    header = (
        f"cycle,drift ({length}),ratio,ductility,force + ({force}),force - ({force}),secant "
        f"({slope}),dissipated ({energy}),damping ratio"
    )
    rows = [tuple(header.split(","))]
    for cycle in cycles:
        numbers = (
            units.of(cycle.amplitude, "m"),
            cycle.amplitude / test.height,
            cycle.amplitude / test.yield_drift,
            *(units.of(shear, "N") for shear in cycle.shear),
            units.of(cycle.secant_stiffness, "N/m"),
            units.of(cycle.hysteretic_energy, "J"),
            cycle.damping_ratio,
        )
        rows.append(
            (
                str(cycle.number),
                *("-" if math.isnan(number) else f"{number:.4g}" for number in numbers),
            )
        )
    say_table(rows)
