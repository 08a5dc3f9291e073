"""`tdint order`: observed order of convergence of methods."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tdint import assessment
from tdint.errors import AnalysisError, TdintError
from tdint.grids import Grid
from tdint.output import tables
from tdint_cli import options
from tdint_cli.assessment import method_options
from tdint_cli.options.option_types import Count, grid
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import Failures, note, say_table

if TYPE_CHECKING:
    from tdint.assessment.order.order import ObservedOrder

_RATIOS = Grid(0.2, 5.0, 15)


@options.command
@options.analysis.plugin
@method_options.all_methods
@options.option("--load", default="harmonic")
@options.option("--law", default="linear")
# At a ratio of 10, a period of the load has five of the coarsest time steps.
@options.option("--frequency-ratio", type=grid(0.01, 10.0))
@options.option("--stride", type=Count(1, 1024), default=1)
@options.output.to_files(picture=True, in_units=False)
def command(
    methods: tuple[str, ...],
    load: str,
    law: str,
    frequency_ratio: Grid | None,
    stride: int,
    outputs: Outputs,
) -> None:
    """Measure the order of convergence of methods from errors at halved time steps.

    An oscillator with period T = 1 s and damping ratio 0.02 has an initial displacement and
    velocity and is integrated over 4 s with the time steps 0.02, 0.01, 0.005, 0.0025 and 0.00125 s.
    The record is noise up to 10 Hz with a sampling interval of 0.02 s, divided by --stride; a time
    step uses its impulse and first moment. An error is the maximum at multiples of 0.02 s, divided
    by the maximum value; the reference is the exact solution or DOP853 of SciPy with a tolerance of
    1e-13. CSV: the order, which is the slope of log error over log time step by regression over the
    three finest time steps with errors above rounding (empty if there are fewer than two); and the
    displacement error at the finest time step, 0.00125 s.

    The laws are smooth. Stories that yield have kinks inside the steps, which reduce the order of
    gauss4 and rk5 to 1 to 2.

    The acceleration follows from equilibrium, as in `tdint run`. The algorithmic acceleration is
    the state variable of the method; it is empty if the method has none, and with --stride. There
    is one row per method and frequency ratio, or one row per method if --load is not harmonic. A
    summary with a line per method, the range of its orders, is written to standard error.
    """
    from tdint.assessment.order.order import observed_order, order_problem

    ratios = [math.nan]
    if load == "harmonic":
        ratios = [float(ratio) for ratio in (frequency_ratio or _RATIOS).values()]
    integrators = method_options.integrators(methods)
    problems = [order_problem(load, law, ratio, stride) for ratio in ratios]
    if not problems[0].building.linear:
        integrators = method_options.for_nonlinear(integrators, law)
    # If a method fails, the remaining methods are still measured.
    measured: list[ObservedOrder] = []
    failures: list[TdintError] = []
    for integrator in integrators:
        try:
            measured += [observed_order(integrator, problem) for problem in problems]
        except AnalysisError as error:
            failures.append(error)
    if measured:
        outputs.deliver(
            tables.table.Table.of_results(assessment.tables.ORDER, measured),
            lambda: assessment.stability_figures.order_picture(measured),
        )
        say_table(_summary(measured))
        # The order is NaN if too few errors exceed the rounding errors, because the method is exact
        # for this load.
        exact = dict.fromkeys(
            order.method for order in measured if math.isnan(order.order("displacement"))
        )
        note(*(f"{method}: no order, because its errors are rounding errors" for method in exact))
    if failures:
        raise Failures(failures)


_QUANTITIES = {
    "displacement": "displacement",
    "velocity": "velocity",
    "acceleration": "acceleration",
    "algorithmic_acceleration": "algorithmic acceleration",
}
"""Labels of the quantities in the summary by their names in `ObservedOrder`."""


def _summary(measured: list[ObservedOrder]) -> list[tuple[str, ...]]:
    """Return the rows of the summary below a header: for each method the range of the orders over
    the frequency ratios, and - for a quantity without an order."""
    rows = [("order of method", *_QUANTITIES.values())]
    for method in dict.fromkeys(order.method for order in measured):
        results = [order for order in measured if order.method == method]
        cells = []
        for quantity in _QUANTITIES:
            orders = [order.order(quantity) for order in results]
            texts = [f"{value:.2f}" for value in sorted(orders) if not math.isnan(value)]
            cells.append(" to ".join(dict.fromkeys([*texts[:1], *texts[-1:]])) or "-")
        rows.append((method, *cells))
    return rows
