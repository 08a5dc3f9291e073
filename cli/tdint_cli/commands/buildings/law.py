"""`tdint law`: the drift law of one story under imposed cycles of drift."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from tdint_cli import options
from tdint_cli.options.output import Outputs
from tdint_cli.options.values import DriftSizeType, ListOf
from tdint_cli.startup import load_numba
from tdint_cli.terminal.streams import say, say_table

if TYPE_CHECKING:
    from tdint.analysis.run.cyclic import Cycle, CyclicTest
    from tdint.files import Writer
    from tdint.units import DriftSize


@dataclass(frozen=True)
class Request:
    """The command line of `tdint law`."""

    model: str
    story: int
    drifts: tuple[DriftSize, ...]
    cycles: int
    points: int
    output: str | None
    plot: str | None
    overwrite: bool


def _one_after_the_other(
    _: click.Context, __: click.Parameter, lists: tuple[tuple[DriftSize, ...], ...]
) -> tuple[DriftSize, ...]:
    """All amplitudes in the order given; one may come again."""
    return tuple(size for sizes in lists for size in sizes)


@options.command("law")
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
    required=True,
    metavar="DRIFT,...",
    help="Amplitudes, one after the other: drift ratios (0.02 or 2%), lengths with their unit (20mm; m, cm, mm, in, "
    "ft), or multiples of the yield drift (4dy).",
)
@options.option(
    "--cycles",
    type=click.IntRange(min=1),
    default=1,
    metavar="COUNT",
    help="Cycles of each amplitude; 1 by default.",
)
@options.option(
    "--points",
    type=click.IntRange(min=1),
    default=200,
    metavar="COUNT",
    help="Points of each quarter of a cycle; 200 by default.",
)
@options.output.output()
@options.output.picture
@options.output.overwrite
def command(**given: Any) -> None:
    """Cyclic test of one story: its force over imposed cycles of drift.

    MODEL.yaml is a model file, - is standard input. The story starts at rest; each cycle goes to the amplitude, to the
    same drift on the other side, and back to zero, as in a slow test in a laboratory: nothing else of the building and
    no time takes part. CSV in SI units, one row per point: drift; the story's shear as `tdint run` reports it, without
    dashpots, damping and P-delta; the same with the model's P-delta (without p_delta in the model, equal); the law's
    tangent stiffness on the way to the point; the energy that it stores and has dissipated. drift_ratio is empty
    without a height.

    For the last cycle of each amplitude standard error tells the forces at its ends, the slope between these (secant
    stiffness), the energy dissipated, and the equivalent viscous damping ratio, energy / (4 pi secant stiffness drift^2
    / 2).
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    outputs = Outputs.checked(request.output, request.plot, request.overwrite)
    load_numba()
    from tdint.analysis.run.cyclic import cyclic_test
    from tdint.model.config.read import load_model
    from tdint.output.tables.cyclic import cyclic_table

    test = cyclic_test(
        load_model(request.model), request.story, request.drifts, cycles=request.cycles, points=request.points
    )

    def draw(suffix: str) -> Writer:
        from tdint.output.figures.cyclic import cyclic_picture

        return cyclic_picture(test, suffix)

    outputs.deliver(cyclic_table(test), draw)
    say(_paragraph(test))
    say_table([_HEADER, *(_row(test, cycle) for cycle in test.cycles[request.cycles - 1 :: request.cycles])])


_HEADER = (
    "cycle", "drift (m)", "ratio", "ductility", "force + (N)", "force - (N)", "secant (N/m)", "dissipated (J)",
    "damping ratio",
)  # fmt: skip


def _paragraph(test: CyclicTest) -> str:
    """The law and what the model says of it, in a sentence or two."""
    from tdint.model.laws import LAWS

    text = f"{test.model.name}, story {test.story}, {test.law} law: {LAWS[test.law].formula}\n"
    text += f"Initial stiffness {test.initial_stiffness:.4g} N/m"
    if not math.isnan(test.yield_drift):
        text += f", yield drift {test.yield_drift:.4g} m"
    if not math.isnan(test.yield_drift / test.height):
        text += f" (drift ratio {test.yield_drift / test.height:.4g})"
    if test.geometric_stiffness:
        text += f", geometric stiffness of P-delta {test.geometric_stiffness:.4g} N/m"
    return text + "."


def _row(test: CyclicTest, cycle: Cycle) -> tuple[str, ...]:
    numbers = (
        cycle.amplitude,
        cycle.amplitude / test.height,
        cycle.amplitude / test.yield_drift,
        *cycle.shear,
        cycle.secant_stiffness,
        cycle.dissipated,
        cycle.damping_ratio,
    )
    return (str(cycle.number), *("-" if math.isnan(number) else f"{number:.4g}" for number in numbers))
