"""`tdint examples`: the examples of the paper of 2022, its methods and their errors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import click

from tdint_cli import options
from tdint_cli.options.values import Number
from tdint_cli.terminal.drawing import emit_table
from tdint_cli.terminal.streams import say, say_table

if TYPE_CHECKING:
    from tdint.analysis.assessment.paper_examples import Example, ExampleRun
    from tdint.files import Writer

_CONFIRMS = "gauss4"
_WIDTH = 100


@dataclass(frozen=True)
class Request:
    """The command line of `tdint examples`."""

    numbers: tuple[str, ...]
    methods: tuple[str, ...]
    dts: tuple[float, ...] | None
    output: str | None
    overwrite: bool


@options.command("examples")
@click.argument("numbers", nargs=-1, type=click.Choice(["1", "2", "3"]), metavar="[1|2|3]...")
@options.analysis.methods("the paper's seven, impulse4 and moment4")
@options.analysis.option(
    "--dt",
    "dts",
    type=Number(1e-3, 0.1),
    many=True,
    metavar="SECONDS,...",
    help="Time steps; 0.02, 0.04 and 0.01 if there is none. The figures show the first one.",
)
@options.output.output("DIR", "Also write the tables and figures into this folder.")
@options.output.overwrite
def command(**given: Any) -> None:
    """The examples of the paper of 2022: errors of its methods, and its figures.

    Example 1 is one mass on a quadratic spring, 2 a building of two stories (with values of our own: the paper's were
    not at hand), 3 a chain of 150 masses. All three if none is named. CSV: the largest errors of displacement,
    velocity and acceleration over all floors and steps against rk5 with steps 8 times finer; the rank by displacement.

    The methods are the paper's: impulse, average and linear acceleration, central difference, Wilson, RK5, and chang
    (2002) for the Chang (2007) that we did not find; impulse4 and moment4 stand beside them. RK5 is also fed with the
    load's samples, linear between the steps and held over each step, and the central difference started with u(-dt) =
    0: what probably stands behind the paper's ranking. The reasons go to standard error.

    With -o: example-1-errors.csv and so on, and figures named by the numbers of the paper's figures 7 and 8 (example 1:
    histories and errors), 10 to 12 and 14 to 16 (examples 2 and 3: displacement, velocity, acceleration, each with its
    errors, at the last floor). The paper's own were not at hand: what each shows is our reading of its text.
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    from tdint.analysis.assessment.paper_examples import DTS, default_integrators, examples, run_example
    from tdint.files import check_outputs, write_files
    from tdint.output.tables.methods import example_table

    wanted = [examples()[int(number)] for number in dict.fromkeys(sorted(request.numbers)) or map(str, examples())]
    folder = Path(request.output) if request.output else None
    if folder:
        outputs = [folder / name for example in wanted for name in _names(example)]
        check_outputs(outputs, overwrite=request.overwrite)
    integrators = options.analysis.integrators(request.methods) if request.methods else default_integrators()
    dts = request.dts or DTS
    runs = {example: [run for dt in dts for run in run_example(example, dt, integrators)] for example in wanted}
    if folder:
        files = {folder / name: writer for example in wanted for name, writer in _files(example, runs[example]).items()}
        stale = [file for file in outputs if file not in files]
        write_files(files, overwrite=request.overwrite, stale=stale)
    emit_table(example_table([run for example in wanted for run in runs[example]]))
    usual = not request.methods and dts[0] == DTS[0]
    for example in wanted:
        _say_example(example, [run for run in runs[example] if run.dt == dts[0]], remark=usual)


def _names(example: Example) -> list[str]:
    return [f"example-{example.number}-errors.csv", *(f"figure-{number:02d}.png" for number, _, _ in example.figures)]


def _files(example: Example, runs: list[ExampleRun]) -> dict[str, Writer]:
    """The files of one example and what writes each; no figures where no run came to its end."""
    from tdint.output.figures.paper_examples import example_picture
    from tdint.output.tables.methods import example_table

    table = example_table(runs).csv()
    first = [run for run in runs if run.dt == runs[0].dt]
    writers: list[Writer] = [lambda stream: stream.write(table)]
    if any(run.outcome == "done" for run in first):
        writers += [
            example_picture(
                f"Figure {number}, example {example.number}: {example.about}",
                first,
                example.floor,
                quantities,
                what,
                ".png",
            )
            for number, quantities, what in example.figures
        ]
    return dict(zip(_names(example), writers, strict=False))


def _say_example(example: Example, runs: list[ExampleRun], remark: bool) -> None:
    """What the example is, how good its reference, the methods by rank, and how the paper's ranking comes about."""
    from tdint.analysis.assessment.paper_examples import FINER, gap

    dt = runs[0].dt
    say(f"Example {example.number}: {example.about}")
    other = gap(example, dt, _CONFIRMS)
    say(f"Reference: rk5 with steps {FINER} times finer; {_CONFIRMS} with as many differs from it by {other:.1e} m.")
    say(f"Largest errors of the displacement at dt {dt:g} s:")
    ended = sorted((run for run in runs if run.outcome == "done"), key=lambda run: run.error("displacement"))
    say_table([(f"  {run.error('displacement'):.2e} m", run.method, run.variant) for run in ended])
    for run in runs:
        if run.outcome != "done":
            say(f"  {run.method} has no result: {run.outcome}")
    if remark:
        say(fill(example.remark, _WIDTH))
