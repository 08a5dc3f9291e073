"""`tdint examples`: examples of the paper that proposed `impulse` and errors of its methods."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import click

from tdint import assessment
from tdint.files import Content, check_outputs, is_there, write_files
from tdint.grids import Grid
from tdint.output import figures
from tdint.response.defaults import BETAS
from tdint.units import SI
from tdint_cli import options
from tdint_cli.assessment import method_options
from tdint_cli.drawing import emit_table
from tdint_cli.options.option_types import ListOf, Number
from tdint_cli.terminal import note, say, say_table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tdint.assessment.examples.paper_examples import Example, ExampleRun

_CHECK_METHOD = "gauss4"
"""Method whose solution is compared with the finer reference solution."""

_WIDTH = 100  # characters per line of text

_OSCILLATOR_FIGURES = {
    1: ("spectral_radius", 0.0, "spectral radii, damping ratio 0"),
    2: ("spectral_radius", 0.05, "spectral radii, damping ratio 5 %"),
    3: ("period_error", 0.0, "period elongations, damping ratio 0"),
    4: ("numerical_damping", 0.0, "numerical damping, damping ratio 0 (eq. 40 prints half of it)"),
    5: ("amplitude_decay", 0.0, "amplitude decay, damping ratio 0"),
}
"""Quantity, damping ratio and title of figures 1 to 5 of the paper."""

_ORDER_FIGURE = 6  # number of the paper's figure of the order of accuracy
_BETA_SCAN = "beta-scan"
_THIN_METHODS = ("impulse4", "moment4")
"""Methods that are plotted as thin lines next to the five methods of the paper."""

_STEPS = Grid(0.01, 100.0, 600)  # dt/T
_RATIOS = Grid(0.2, 5.0, 15)
"""Ratio of the load frequency to the natural frequency, as in `tdint order`."""


@options.request
class Request:
    """The command line of `tdint examples`."""

    numbers: tuple[str, ...] = options.argument(
        "[1|2|3]...", nargs=-1, type=click.Choice(["1", "2", "3"])
    )
    methods: tuple[str, ...] = method_options.methods("the seven methods of the paper")
    dts: tuple[float, ...] | None = options.option("--dt", type=ListOf(Number(1e-3, 0.1)))
    reference: str = options.option(default="paper")
    output: str | None = options.output.output
    picture_format: str = options.option("--format", default="png")
    all_figures: bool = options.option("--figures")
    overwrite: bool = options.option()


@options.command
@options.analysis.plugin
@options.output.style
@options.of(Request)
def command(request: Request) -> None:
    """Reproduce the examples and figures of the paper that proposed impulse.

    Example 1 is a mass on a quadratic spring, 2 a building of two stories, 3 a chain of 150 masses;
    by default all three are run. The paper gives the data of example 2 in a drawing that is not
    available: its building has assumed values. CSV: the maximum errors over all floors and time
    steps; the rank by the displacement error.

    The paper: "An Implicit Unconditionally Stable Integration Method for Nonlinear Structural
    Dynamics and Earthquake Engineering Problems", published online 15 March 2022.

    The methods are the methods of the paper: the proposed method (impulse), Newmark's average and
    linear acceleration, central difference, Wilson, U0-V0 and RK5, with a time step of 0.02 s. The
    table adds RK5 with the samples of the load, linear between time steps and constant in each time
    step, and central difference started with u(-dt) = 0. These variants probably explain the
    ranking in the paper; the reasons are written to standard error.

    -o writes example-1-errors.csv etc. and the figures, numbered as in the paper: 7 displacement of
    example 1, 8 its errors |u - u_exact|; 10 and 11 displacements of floors 1 and 2 of example 2,
    12 the errors of floor 2; 14 and 15 displacements of masses 1 and 150 of example 3, 16 the
    errors of mass 1. --figures adds 1 and 2 spectral radii without damping and with 5 %, 3 period
    elongations, 4 numerical damping, 5 amplitude decay, 6 order of accuracy over the frequency of
    the load, with impulse4 and moment4 as thin lines; 9 and 13 the buildings, redrawn; and
    beta-scan, which is not in the paper: impulse with other values of beta.
    """
    from tdint.assessment.examples.paper_examples import DT, METHODS, examples, run_example

    requested = [
        examples()[int(number)]
        for number in dict.fromkeys(sorted(request.numbers)) or map(str, examples())
    ]
    folder = Path(request.output) if request.output else None
    # Check the file names before the runs, which need some time.
    if folder:
        suffix = f".{request.picture_format}"
        general_figures = _general_figures(requested, suffix) if request.all_figures else {}
        outputs = [folder / name for example in requested for name in _names(example, suffix)]
        outputs += [folder / name for name in general_figures]
        check_outputs(outputs, overwrite=request.overwrite)
    integrators = method_options.integrators(request.methods or METHODS)
    steps = request.dts or (DT,)
    runs = {
        example: [run for dt in steps for run in run_example(example, dt, integrators)]
        for example in requested
    }
    if folder:
        files = {
            folder / name: writer
            for example in requested
            for name, writer in _files(example, runs[example], request.reference, suffix)
        }
        files |= {folder / name: writer for name, writer in general_figures.items()}
        write_files(files, overwrite=request.overwrite)
        note(
            *(
                f"{file}: written by an earlier call, unchanged"
                for file in outputs
                if file not in files and is_there(file)
            )
        )
    emit_table(
        assessment.tables.example_table(
            [run for example in requested for run in runs[example]], request.reference
        )
    )
    # The remark explains the ranking of the paper, so it applies only to its methods and time step.
    has_default_settings = not request.methods and steps[0] == DT
    for example in requested:
        _report_example(
            example,
            [run for run in runs[example] if run.dt == steps[0]],
            request.reference,
            remark=has_default_settings,
        )


def _names(example: Example, suffix: str) -> list[str]:
    """Return the names of the files of an example: table, JSON file, figures."""
    errors = f"example-{example.number}-errors"
    return [
        f"{errors}.csv",
        f"{errors}.json",
        *(f"figure-{figure.number:02d}{suffix}" for figure in example.figures),
    ]


def _files(
    example: Example, runs: list[ExampleRun], reference: str, suffix: str
) -> list[tuple[str, Content]]:
    """Return the file names and contents of a single example; no figures without a completed run
    of a method with the first time step.

    The table contains the runs with all time steps, the figures only the runs with the first time
    step.
    """
    table = assessment.tables.example_table(runs, reference)
    first_runs = [run for run in runs if run.dt == runs[0].dt]
    contents: list[Content] = [table.csv(), options.output.provenance(table.meanings, SI)]
    if any(run.outcome == "done" and not run.variant for run in first_runs):
        title = f"example {example.number}, {example.about}"
        exact = f"exact: {_exact(example, runs[0].dt, reference)}"
        draw = partial(
            assessment.stability_figures.example_picture,
            title,
            first_runs,
            exact=exact,
            reference=reference,
        )
        contents += [
            figures.style.picture(suffix, partial(draw, figure)) for figure in example.figures
        ]
    # Without figures, their names have no contents: `zip` omits them.
    return list(zip(_names(example, suffix), contents, strict=False))


def _general_figures(examples: Sequence[Example], suffix: str) -> dict[str, Content]:
    """Return the names and contents of the figures that do not show the runs of the examples.

    These are the figures of the paper with methods on an oscillator, the figures of the buildings,
    and the figure of other values of beta, which is not in the paper.
    """
    numbers = [*_OSCILLATOR_FIGURES, _ORDER_FIGURE]
    draw_functions: dict[str, Callable[[], Any]] = {
        _name(number): partial(_draw_oscillator_figure, number) for number in numbers
    }
    for example in examples:
        if example.drawn_as:
            title = f"Figure {example.drawn_as}, redrawn: example {example.number}, {example.about}"
            draw_functions[_name(example.drawn_as)] = partial(
                assessment.stability_figures.row_picture, title, example.model
            )
    draw_functions[_BETA_SCAN] = _draw_beta_scan
    return {
        f"{name}{suffix}": figures.style.picture(suffix, draw)
        for name, draw in draw_functions.items()
    }


def _name(number: int) -> str:
    """Return the file name of a figure of the paper, without suffix."""
    return f"figure-{number:02d}"


def _draw_oscillator_figure(number: int) -> Any:
    """Return a figure (1 to 6) of the accuracy of methods for an oscillator, as in the paper.

    Figures 1 to 5 show oscillators without load, figure 6 the order of accuracy under a harmonic
    load. The methods are the five methods of the paper and, as thin lines, impulse4 and moment4.
    """
    from tdint.assessment.examples.paper_examples import FIVE
    from tdint.assessment.order.order import observed_order, order_problem
    from tdint.assessment.stability.stability import stability

    integrators = method_options.integrators((*FIVE, *_THIN_METHODS))
    if number == _ORDER_FIGURE:
        problems = [order_problem("harmonic", "linear", ratio, 1) for ratio in _RATIOS.values()]
        measured = [
            observed_order(method, problem) for method in integrators for problem in problems
        ]
        return assessment.stability_figures.order_picture(
            measured, f"Figure {number}: order of accuracy over ω₀ / ω\n", thin=len(_THIN_METHODS)
        )
    quantity, damping, title = _OSCILLATOR_FIGURES[number]
    curves = [stability(method, _STEPS.values(), damping) for method in integrators]
    return assessment.stability_figures.accuracy_picture(
        curves, quantity, f"Figure {number}: {title}", thin=len(_THIN_METHODS)
    )


def _draw_beta_scan() -> Any:
    """Return the figure of the spectral radius of impulse for several values of its parameter
    beta."""
    from tdint.assessment.stability.stability import stability

    integrators = method_options.integrators([f"impulse:beta={beta}" for beta in BETAS])
    curves = [stability(method, _STEPS.values()) for method in integrators]
    title = (
        "Not in the paper: spectral radius of impulse with other values of beta, damping ratio 0"
    )
    return assessment.stability_figures.accuracy_picture(curves, "spectral_radius", title)


def _exact(example: Example, dt: float, reference: str) -> str:
    """Return the method and the time step of the reference solution as text.

    `dt` is the time step of the methods, s, which the reference solution divides. `reference` is
    `paper` for the reference solution of the paper, `finer` for the more accurate one.
    """
    from tdint.assessment.examples.paper_examples import EXACT, FINER, exact_steps

    if reference == "paper":
        method, substeps = EXACT, exact_steps(example, dt)
    else:
        method, substeps = "rk5", FINER
    return f"{method}, dt {dt / substeps:.4g} s"


def _report_example(example: Example, runs: list[ExampleRun], reference: str, remark: bool) -> None:
    """Report an example: its reference solutions, the ranking of the methods, and a remark."""
    from tdint.assessment.examples.paper_examples import (
        EQUAL_ERRORS,
        EXACT,
        NORMS,
        exact_steps,
        gap,
        ordered_methods,
    )

    dt = runs[0].dt
    say(f"Example {example.number}: {example.about}")
    # Both gaps are maximum differences from the finer reference solution, m: of the reference
    # solution of the paper, and of a third method, which confirms the finer reference solution.
    paper_gap = gap(example, dt, EXACT, exact_steps(example, dt))
    check_gap = gap(example, dt, _CHECK_METHOD)
    say(
        f"The reference solution of the paper ({_exact(example, dt, 'paper')}) differs by "
        f"{paper_gap:.1e} m from"
    )
    say(
        f"{_exact(example, dt, 'finer')}; {_CHECK_METHOD} with the same time step differs from the "
        f"latter by {check_gap:.1e} m."
    )
    floors = runs[0].motion.displacement.shape[1]
    over = "all time steps" if floors == 1 else f"all {floors} floors and time steps"
    say(
        f"Displacement errors with dt {dt:g} s over {over}, m, relative to "
        f"{_exact(example, dt, reference)}:"
    )
    # The paper shows the error of one floor, which may be small where other errors are large.
    (drawn_floor,) = (figure.floor for figure in example.figures if figure.is_error)
    norms: list[tuple[str, str, int | None]] = [(norm, norm, None) for norm in NORMS]
    if floors > 1:
        norms.append((f"maximum, floor {drawn_floor}", "maximum", drawn_floor))
    completed = sorted(
        (run for run in runs if run.outcome == "done"),
        key=lambda run: run.error("displacement", reference),
    )
    rows = [
        [
            *(
                f"{run.error('displacement', reference, norm, floor):.2e}"
                for _, norm, floor in norms
            ),
            run.method,
            run.variant,
        ]
        for run in completed
    ]
    head = [*(name for name, _, _ in norms), "method", ""]
    say_table([[f"  {row[0]}", *row[1:]] for row in (head, *rows)])
    if len(completed) > 1:
        say(f"Order by error, = within {100.0 * EQUAL_ERRORS:g} %:")
        for name, norm, floor in norms:
            groups = ordered_methods(runs, reference, norm, floor)
            say(f"  {name}: {' < '.join(' = '.join(group) for group in groups)}")
    for run in runs:
        if run.outcome != "done":
            say(f"  {run.method} has no result: {run.outcome}")
    if remark:
        say(fill(example.remark, _WIDTH))
