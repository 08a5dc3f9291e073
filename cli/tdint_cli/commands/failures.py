"""`tdint failures`: the problems on which methods fail."""

from __future__ import annotations

from collections import Counter

from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.grammar import ListOf, Name
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say, say_table


def _problems() -> list[str]:
    from tdint.analysis.assessment.failures import problems

    return list(problems())


@options.command(
    "failures",
    "tdint failures --problem large-step",
    "tdint failures --method impulse4,hht --problem large-step --plot=failures.png",
)
@options.analysis.plugin
@options.analysis.all_methods
@options.option(
    "--problem",
    "problems",
    type=ListOf(Name(_problems)),
    help="Problems to take: hardening, softening, stiff-node, soft-node, stiff-pair, limit-2, "
    "limit-sqrt-6, limit-sqrt-12, sqrt-12, large-step, overshoot-displacement, overshoot-velocity; "
    "all if there is none.",
)
@options.output.to_files(picture=options.output.PICTURE, in_units=False)
def command(methods: tuple[str, ...], problems: tuple[str, ...] | None, outputs: Outputs) -> None:
    """Run methods on hard problems with known solutions and report failures.

    Stories that harden and soften, stiff parts beside soft ones, steps at the limits of stability,
    large first steps. Without --method also impulse4 and moment4 with rho_inf=0.5 and rho_inf=0,
    and wilson:theta=1.3, without newmark, which is newmark-average. src/tdint/methods/README.md
    lists the problems and what a method must keep to.

    CSV: least and largest energy over the largest of the exact motion (the initial one in free
    vibration); the error, and in the last column what it is; the outcome, which is the status of
    `tdint run` while the rest of the row is what
    --allow-unstable gives, or `refused` for nonlinear stories with a method for linear ones; the
    verdict: pass, loses energy, gains energy, rings, inaccurate, grows, overshoots, blows up, does
    not converge; the time reached. The counts of the verdicts go to standard error. A method that
    fails is a result: exit code 0.
    """
    from tdint.analysis.assessment.failures import (
        attempt,
        compile_for,
        find_problems,
        usual_methods,
    )

    integrators = options.analysis.integrators(methods) if methods else usual_methods()
    named_problems = find_problems(problems or ())
    compile_for(integrators, named_problems)
    trials = [
        trial
        for problem in named_problems
        for integrator in integrators
        for trial in attempt(integrator, problem)
    ]
    outputs.deliver(
        tables.methods.failure_table(trials), lambda: figures.assessment.failure_picture(trials)
    )
    # How often each method got each verdict; the columns in the order in which verdicts were met,
    # `pass` first
    verdicts = sorted(
        dict.fromkeys(trial.verdict for trial in trials), key=lambda verdict: verdict != "pass"
    )
    rows = [("method", *verdicts)]
    for method in dict.fromkeys(trial.method for trial in trials):
        count = Counter(trial.verdict for trial in trials if trial.method == method)
        rows.append((method, *(str(count[verdict] or "") for verdict in verdicts)))
    say("Verdicts, over problems and steps:")
    say_table(rows)
