"""`tdint failures`: results of methods on problems that are difficult to integrate."""

from __future__ import annotations

from collections import Counter

from tdint import assessment
from tdint.output import tables
from tdint.tabular import on_use
from tdint_cli import options
from tdint_cli.assessment import method_options
from tdint_cli.options.option_types import ListOf, Written
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say, say_table

_PROBLEM = Written("name", names=on_use("tdint.assessment.failures.failures").problems)


@options.command
@options.analysis.plugin
@method_options.all_methods
@options.option("--problem", "problems", type=ListOf(_PROBLEM))
@options.output.to_files(picture=True, in_units=False)
def command(methods: tuple[str, ...], problems: tuple[str, ...] | None, outputs: Outputs) -> None:
    """Run methods on hard problems with known solutions and report failures.

    The problems are hardening and softening stories, stiff next to soft components, time steps at
    stability limits, and large first time steps. The default methods also include impulse4 and
    moment4 with rho_inf=0.5 and rho_inf=0, and wilson:theta=1.3; newmark is omitted, because it is
    equal to newmark-average. src/tdint/methods/README.md describes the problems and the criteria.

    CSV: minimum and maximum energy divided by the maximum energy of the exact solution (the initial
    energy in free vibration); the error, and its definition in the last column; the outcome, which
    is the status of `tdint run`, or `refused` for nonlinear stories with a method for linear
    buildings (the remaining cells are results with --allow-unstable); the verdict: pass, loses
    energy, gains energy, rings, inaccurate, grows, overshoots, blows up, does not converge; the
    time reached. The number of each verdict is written to standard error. The exit code is 0 also
    if a method fails.
    """
    from tdint.assessment.failures.failures import failures

    trials = list(failures(methods or None, problems or ()))
    outputs.deliver(
        tables.table.Table.of_results(assessment.tables.FAILURE, trials),
        lambda: assessment.failure_figures.failure_picture(trials),
    )
    # Count the verdicts of each method. The first column is `pass`, the other columns follow in the
    # order of occurrence.
    verdicts = sorted(
        dict.fromkeys(trial.verdict for trial in trials), key=lambda verdict: verdict != "pass"
    )
    rows = [("method", *verdicts)]
    for method in dict.fromkeys(trial.method for trial in trials):
        count = Counter(trial.verdict for trial in trials if trial.method == method)
        rows.append((method, *(str(count[verdict] or "") for verdict in verdicts)))
    say("Number of verdicts, over problems and time steps:")
    say_table(rows)
