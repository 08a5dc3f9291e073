"""`tdint law`: the drift law of one story under imposed cycles of drift."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import UsageError
from tdint_cli import options
from tdint_cli.options.output import Outputs
from tdint_cli.options.values import DriftSizeType, FileName, ListOf
from tdint_cli.terminal.streams import say, say_table

if TYPE_CHECKING:
    from tdint.analysis.static.cyclic import Cycle, CyclicTest
    from tdint.files import Writer
    from tdint.output_units import OutputUnits
    from tdint.units import DriftSize


_POINTS = 200


@dataclass(frozen=True)
class Request:
    """The command line of `tdint law`."""

    model: str
    story: int
    drifts: tuple[DriftSize, ...]
    cycles: int | None
    points: int | None
    path: str | None
    units: str | None
    output: str | None
    plot: str | None
    output_units: OutputUnits | None
    overwrite: bool


def _one_after_the_other(
    _: click.Context, __: click.Parameter, lists: tuple[tuple[DriftSize, ...], ...]
) -> tuple[DriftSize, ...]:
    """All amplitudes in the order given; one may come again."""
    return tuple(size for sizes in lists for size in sizes)


@options.command("law")
@options.analysis.plugin
@options.building.model
@options.option(
    "--story",
    type=click.IntRange(min=1),
    default=1,
    metavar="NUMBER",
    help="The story to test, counted from the ground; 1 by default.",
)
@options.option(
    "--drift",
    "drifts",
    type=ListOf(DriftSizeType()),
    multiple=True,
    callback=_one_after_the_other,
    metavar="DRIFT,...",
    help="Amplitudes, one after the other: drift ratios (0.02 or 2%), lengths with their unit (20mm; m, cm, mm, in, "
    "ft), or multiples of the yield drift (4dy).",
)
@options.option(
    "--cycles",
    type=click.IntRange(min=1),
    metavar="COUNT",
    help="Cycles of each amplitude; 1 by default.",
)
@options.option(
    "--points",
    type=click.IntRange(min=1),
    metavar="COUNT",
    help="Points of each quarter of a cycle; 200 by default.",
)
@options.option(
    "--path",
    type=FileName(),
    metavar="FILE",
    help="Any path of drifts in place of --drift, --cycles and --points: a CSV file with a column drift_m, - is "
    "standard input.",
)
@options.option(
    "--units",
    needs="--path",
    type=click.Choice(["m", "dy"]),
    help="What the numbers of --path are: m by default, or multiples of the yield drift (dy).",
)
@options.output.output()
@options.output.picture
@options.output.units
@options.output.overwrite
def command(**given: Any) -> None:
    """Cyclic test of one story: its force over imposed cycles of drift.

    MODEL.yaml is a model file, - is standard input. The story starts at rest; each cycle goes to the amplitude, to the
    same drift on the other side, and back to zero, as in a slow test in a laboratory: nothing else of the building and
    no time takes part. With --path it goes straight to each drift of a file, one row for each. CSV, one row
    per point: drift; the story's shear as `tdint run` reports it, without dashpots, damping and P-delta; the same with
    the model's P-delta (without p_delta in the model, equal); the law's tangent stiffness on the way to the point; the
    energy that it stores and has dissipated. drift_ratio is empty without a height.

    For the last cycle of each amplitude standard error tells the forces at its ends, the slope between these (secant
    stiffness), the energy dissipated, and the equivalent viscous damping ratio, energy / (4 pi secant stiffness drift^2
    / 2).
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    outputs = Outputs.checked(request.output, request.plot, request.overwrite, units=request.output_units)
    cycles = request.cycles or 1
    drifts = _path(request)
    from tdint.analysis.static.cyclic import cyclic_test, path_test
    from tdint.model.config.model_file import load_model
    from tdint.output.tables.buildings import cyclic_table

    model = load_model(request.model)
    if drifts is None:
        test = cyclic_test(model, request.story, request.drifts, cycles=cycles, points=request.points or _POINTS)
    else:
        test = path_test(model, request.story, drifts, in_yield_drifts=request.units == "dy")

    def draw(suffix: str) -> Writer:
        from tdint.output.figures.statics import cyclic_picture

        return cyclic_picture(test, suffix, units)

    outputs = outputs.else_in(model.output_units)
    units = outputs.units or model.output_units
    outputs.deliver(cyclic_table(test), draw)
    say(_paragraph(test, units))
    if drifts is None:
        say_table([_header(units), *(_row(test, cycle, units) for cycle in test.cycles[cycles - 1 :: cycles])])
    else:
        say(_ends(test, units))


def _path(request: Request) -> list[float] | None:
    """The drifts of --path; None if cycles are asked for.

    Raises
    ------
    UsageError
        Neither or both of them, or a file that cannot be read.
    """
    if request.path is None:
        if not request.drifts:
            raise UsageError("no drift: give --drift, or a path of drifts by --path")
        return None
    for name, given in (("--drift", request.drifts), ("--cycles", request.cycles), ("--points", request.points)):
        if given:
            raise UsageError(f"{name} and --path exclude each other: a path tells every drift")
    if request.path == "-" and request.model == "-":
        raise UsageError("standard input already holds the model; give the path as a file")
    from tdint.analysis.static.cyclic import read_drift_path

    return read_drift_path(request.path)


def _ends(test: CyclicTest, units: OutputUnits) -> str:
    """Extremes of a path in a line."""
    path = test.path
    return (
        f"{path.drift.size} drifts from {units.of(path.drift.min(), 'm'):.4g} to {units.text(path.drift.max(), 'm')}, "
        f"forces from {units.of(path.shear.min(), 'N'):.4g} to {units.text(path.shear.max(), 'N')}, "
        f"{units.text(path.dissipated[-1], 'J')} dissipated."
    )


def _header(units: OutputUnits) -> tuple[str, ...]:
    length, force, slope, energy = (units.unit(si)[0] for si in ("m", "N", "N/m", "J"))
    return (
        "cycle", f"drift ({length})", "ratio", "ductility", f"force + ({force})", f"force - ({force})",
        f"secant ({slope})", f"dissipated ({energy})", "damping ratio",
    )  # fmt: skip


def _paragraph(test: CyclicTest, units: OutputUnits) -> str:
    """The law and what the model says of it, in a sentence or two."""
    from tdint.model.laws import LAWS

    text = f"{test.model.name}, story {test.story}, {test.law} law: {LAWS[test.law].formula}\n"
    text += f"Initial stiffness {units.text(test.initial_stiffness, 'N/m')}"
    if not math.isnan(test.yield_drift):
        text += f", yield drift {units.text(test.yield_drift, 'm')}"
    if not math.isnan(test.yield_drift / test.height):
        text += f" (drift ratio {test.yield_drift / test.height:.4g})"
    if test.geometric_stiffness:
        text += f", geometric stiffness of P-delta {units.text(test.geometric_stiffness, 'N/m')}"
    return text + "."


def _row(test: CyclicTest, cycle: Cycle, units: OutputUnits) -> tuple[str, ...]:
    numbers = (
        units.of(cycle.amplitude, "m"),
        cycle.amplitude / test.height,
        cycle.amplitude / test.yield_drift,
        *(units.of(shear, "N") for shear in cycle.shear),
        units.of(cycle.secant_stiffness, "N/m"),
        units.of(cycle.dissipated, "J"),
        cycle.damping_ratio,
    )
    return (str(cycle.number), *("-" if math.isnan(number) else f"{number:.4g}" for number in numbers))
