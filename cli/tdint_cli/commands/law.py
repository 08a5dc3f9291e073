"""`tdint law`: the hysteretic law of one story under imposed drift cycles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError
from tdint.number_parsing import pluralize
from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import FileName, ListOf, drift_size
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say, say_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tdint.model.story_laws import Law
    from tdint.response.static.cyclic import Cycle, CyclicTest
    from tdint.units import DriftSize, OutputUnits

_POINTS = 200  # points per quarter cycle, so that loops are smooth in print


@options.request
class Request:
    """The command line of `tdint law`."""

    outputs: Outputs
    model: str | None = options.argument("[MODEL.yaml]", default=None, type=FileName())
    listing: bool = options.option("--list")
    story: int = options.option(type=click.IntRange(min=1), default=1)
    element: str | None = options.option()
    drifts: tuple[DriftSize, ...] | None = options.option(
        "--drift", type=ListOf(drift_size, once=False)
    )
    cycles: int | None = options.option()
    points: int | None = options.option()
    path: str | None = options.option()
    units: str | None = options.option()


@options.command
@options.analysis.plugin
@options.output.to_files(picture=True)
@options.of(Request)
def command(request: Request) -> None:
    """Test one story under imposed drift cycles and write its hysteresis loop.

    The story starts at zero drift. Each cycle imposes the amplitude, the same drift with opposite
    sign, and zero, as in a quasi-static laboratory test. The remaining stories and rate effects are
    not included. MODEL.yaml is a model file; - is standard input. With --path the drifts of a file
    are imposed directly, one row per drift. CSV, one row per point: drift; story shear as in `tdint
    run`, without dashpots, damping and P-delta; story shear with the P-delta of the model (equal
    without p_delta in the model); tangent stiffness of the law on the branch that leads to the
    point; strain energy and dissipated energy. drift_ratio is empty without a story height.

    For the last cycle of each amplitude, standard error reports the forces at the two amplitudes,
    the slope between them (secant stiffness), the dissipated energy, and the equivalent viscous
    damping ratio, energy / (4 pi secant stiffness drift^2 / 2).
    """
    refuse_idle("list" if request.listing else "cycles" if request.path is None else "path")
    if request.listing:
        from tdint.output.tables.laws import law_table

        request.outputs.deliver(law_table())
        return
    if request.model is None:
        raise UsageError("no model file is specified; add MODEL.yaml, or --list for all laws")
    if request.path is None and not request.drifts:
        raise UsageError("the imposed drifts are required; add --drift or --path")
    if request.path == request.model == "-":
        raise UsageError("MODEL.yaml and --path cannot both be standard input; use a file for one")
    from tdint.model.config.model_file import load_model
    from tdint.response.static.cyclic import cyclic_test, law_path, read_drift_path

    cycles_per_amplitude = request.cycles or 1
    imposed_drifts = None if request.path is None else read_drift_path(request.path)
    building = load_model(request.model)
    last_cycles: Sequence[Cycle] = ()
    if imposed_drifts is None:
        test = cyclic_test(
            building,
            request.story,
            request.drifts or (),
            cycles=cycles_per_amplitude,
            points=request.points or _POINTS,
            element=request.element,
        )
        # Report only the last cycle of each amplitude.
        last_cycles = test.cycles[cycles_per_amplitude - 1 :: cycles_per_amplitude]
    else:
        test = law_path(
            building,
            request.story,
            imposed_drifts,
            in_yield_drifts=request.units == "dy",
            element=request.element,
        )
    outputs = request.outputs.else_in(building.output_units)
    units = outputs.shown_units
    outputs.deliver(
        tables.table.Table.of_results(tables.buildings.CYCLIC, [test]),
        lambda: figures.static_curves.cyclic_picture(test, units),
    )
    _report(test, request.element, last_cycles, units)


def _formula(law: Law) -> str:
    """Return the formula of a law, with the parameters of the story that are names, such as the
    rule of `multilinear`, unless they are the default."""
    from tdint.model.story_laws import LAWS, named_parameters

    formula = LAWS[law.name].formula
    names = [
        f"{name} {parameter.choices[int(value)]}"
        for (name, _, _, parameter), value in zip(
            named_parameters(law), law.parameters, strict=True
        )
        if parameter.choices and parameter.choices[int(value)] != parameter.default
    ]
    return f"{formula} ({', '.join(names)})" if names else formula


def _report(
    test: CyclicTest, element: str | None, cycles: Sequence[Cycle], units: OutputUnits
) -> None:
    """Print the tested law and a table of cycles, or without cycles the extremes of the path.

    `cycles` is the last cycle of each amplitude; empty with --path.
    """
    springs = test.model.stories[test.story - 1].springs
    formulas = "; ".join(_formula(spring.law) for spring in springs)
    subject = f"element {element}, " if element else ""
    text = f"{test.model.name}, story {test.story}, {subject}{test.law} law: {formulas}\n"
    text += f"Initial stiffness {units.text(test.initial_stiffness, 'N/m')}"
    if not math.isnan(test.yield_drift):
        text += f", yield drift {units.text(test.yield_drift, 'm')}"
    if not math.isnan(test.yield_drift / test.height):
        text += f" (drift ratio {test.yield_drift / test.height:.4g})"
    if test.geometric_stiffness:
        text += f", geometric stiffness of P-delta {units.text(test.geometric_stiffness, 'N/m')}"
    say(f"{text}.")
    # A path has no cycles: report its extremes.
    if not cycles:
        path = test.path
        say(
            f"{pluralize(path.drift.size, 'drift')} from {units.of(path.drift.min(), 'm'):.4g} to "
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
        values = (
            units.of(cycle.amplitude, "m"),
            cycle.amplitude / test.height,
            cycle.amplitude / test.yield_drift,
            *(units.of(shear, "N") for shear in cycle.shear),
            units.of(cycle.secant_stiffness, "N/m"),
            units.of(cycle.hysteretic_energy, "J"),
            cycle.damping_ratio,
        )
        rows.append(
            (str(cycle.number), *("-" if math.isnan(value) else f"{value:.4g}" for value in values))
        )
    say_table(rows)
