"""`tdint order`: the order of a method as its errors show it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from tdint.errors import AnalysisError, TdintError
from tdint.output import figures, tables
from tdint.written_numbers import Grid
from tdint_cli import options
from tdint_cli.options.grammar import Count, grid
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import Failures, note

if TYPE_CHECKING:
    from tdint.analysis.assessment.order import ObservedOrder

_RATIOS = Grid(0.2, 5.0, 15)


@options.command(
    "order",
    "tdint order --method impulse4,hht --load free",
    "tdint order --method hht --load harmonic --frequency-ratio 0.5",
)
@options.analysis.plugin
@options.analysis.all_methods
@options.option(
    "--load",
    type=click.Choice(["free", "harmonic", "record"]),
    default="harmonic",
    help="Free vibration, a harmonic force (default), or a ground motion that is linear between "
    "its samples.",
)
@options.option(
    "--law",
    type=click.Choice(["linear", "polynomial"]),
    default="linear",
    help="Restoring force over stiffness: u (default), or u + u^3 / 2.",
)
@options.option(
    "--frequency-ratio",
    needs="--load harmonic",
    type=grid(0.01, 10.0),  # with 10 there are five coarsest steps to a period of the load
    metavar="FIRST:LAST:COUNT",
    help="Frequency of the harmonic force over the natural frequency in equal ratios, both ends "
    f"included, or a single ratio; {_RATIOS} by default.",
)
@options.option(
    "--stride",
    needs="--load record",
    type=Count(1, 1024),
    default=1,
    help="Samples of the record in the coarsest step, a power of 2: 1 by default, so that no step "
    "is longer than a sampling interval.",
)
@options.output.to_files(picture=options.output.PICTURE, in_units=False)
def command(
    methods: tuple[str, ...],
    load: str,
    law: str,
    frequency_ratio: Grid | None,
    stride: int,
    outputs: Outputs,
) -> None:
    """Measure the order of convergence of methods from errors at halved time steps.

    An oscillator of period T = 1 s and damping ratio 0.02 starts from a displacement and a velocity
    and is integrated over 4 s with the steps 0.02, 0.01, 0.005, 0.0025 and 0.00125 s. The samples
    of the record are 0.02 s apart, or with
    --stride so many times closer: noise up to 10 Hz, of which a step takes the impulse and the
    first moment. The errors are the largest ones at every 0.02 s over the largest value, against
    the exact motion or SciPy's DOP853 at a tolerance of 1e-13. CSV: the slopes of the errors over
    the step, by regression over the finest three that are not rounding (empty if there are not
    two), and the displacement's error with the finest step, 0.00125 s.

    The acceleration is that of equilibrium, as `tdint run` reports it. The own acceleration is what
    a method carries from step to step, empty for one that carries none and with --stride. Without a
    frequency of the load there is one row per method.
    """
    from tdint.analysis.assessment.order import observed_order, order_problem

    ratios = (
        [float(ratio) for ratio in (frequency_ratio or _RATIOS).values()]
        if load == "harmonic"
        else [math.nan]
    )
    integrators = options.analysis.integrators(methods)
    problems = [order_problem(load, law, ratio, stride) for ratio in ratios]
    if not problems[0].building.linear:
        integrators = options.analysis.for_nonlinear(integrators, law)
    # A method that fails does not keep the others from being measured.
    measured: list[ObservedOrder] = []
    failures: list[TdintError] = []
    for integrator in integrators:
        try:
            measured += [observed_order(integrator, problem) for problem in problems]
        except AnalysisError as error:
            failures.append(error)
    if measured:
        outputs.deliver(
            tables.methods.order_table(measured), lambda: figures.assessment.order_picture(measured)
        )
        exact = dict.fromkeys(
            order.method for order in measured if math.isnan(order.order("displacement"))
        )
        note(*(f"{method} has no order here: its errors are rounding" for method in exact))
    if failures:
        raise Failures(failures)
