"""`tdint overshoot`: the first steps of a method under a large step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from tdint.output import figures, tables
from tdint_cli import options
from tdint_cli.options.grammar import Count, Number
from tdint_cli.terminal import say, say_table

if TYPE_CHECKING:
    from tdint.analysis.assessment.stability import Overshoot

_MOST_STEPS = 100_000  # rows of a history that can still be opened
_DRAWN = tuple(name for name in options.analysis.DRAWN if name != "central-difference")
"""A large step is far beyond that one's limit."""


@options.request
class Request(options.analysis.OscillatorRequest):
    """The command line of `tdint overshoot`."""

    dt_over_t: float = options.analysis.option(
        type=Number(*options.analysis.DT_OVER_T),
        default=10.0,
        metavar="RATIO",
        help="Step over the undamped period; 10 by default.",
    )
    steps: int = options.analysis.option(
        type=Count(1, _MOST_STEPS), default=10, help="Steps to take; 10 by default."
    )
    law: str = options.analysis.option(
        type=click.Choice(["linear", "hardening", "softening"]),
        default="linear",
        help="Restoring force: linear (default), or that of the problem of this name in `tdint "
        "failures`.",
    )


@options.command(
    "overshoot",
    "tdint overshoot --method wilson,hht --steps 20 --plot=overshoot.png",
    "tdint overshoot --method newmark-average,moment4 --law softening",
)
@options.analysis.of_oscillator(_DRAWN)
@options.of(Request)
def command(request: Request) -> None:
    """Measure the overshoot of methods at large time steps.

    An oscillator without load starts from a displacement (u, v) = (1, 0), then from a velocity (0,
    1). CSV: u / U and v / (omega U) at the steps, with the amplitude U of the exact undamped
    motion: 1 for the first start, 1 / omega for the second. The exact motion stays within -1 and 1;
    what lies outside is overshoot. The cells are empty after a motion that ran away.

    The powers p tell how the first step grows, u ~ (omega dt)^p and dt v ~ (omega dt)^p as omega dt
    goes to infinity, from u = 1 and from dt v = 1. They go to standard error, too, with those of
    the exact motion: a method overshoots where its power is larger. houbolt and park start with
    average acceleration; theirs are the powers of that start.

    With --law hardening or softening the oscillator starts with the energy of the problem of that
    name, all of it in the spring, then all of it in the mass. The columns are over the largest
    displacement and velocity of the exact motion, T is the period of small vibrations. There are no
    powers; what the steps pass goes to standard error.
    """
    from tdint.analysis.assessment.stability import STARTS, overshoot, verdict

    integrators = options.analysis.integrators(request.methods)
    if request.law != "linear":
        integrators = options.analysis.for_nonlinear(integrators, request.law)
    pairs = {
        (integrator, ratio): [
            overshoot(integrator, start, request.dt_over_t, request.steps, ratio, request.law)
            for start in STARTS
        ]
        for integrator in integrators
        for ratio in request.damping
    }
    motions = [motion for pair in pairs.values() for motion in pair]
    shown = request.drawn(motions, _DRAWN)
    request.outputs.deliver(
        tables.methods.overshoot_table(motions), lambda: figures.assessment.overshoot_picture(shown)
    )
    several = len(request.damping) > 1
    named = {
        integrator.label + f", damping {ratio:g}" * several: pair
        for (integrator, ratio), pair in pairs.items()
    }
    if request.law != "linear":
        _say_largest(named)
    else:
        _say_powers(named, [verdict(integrator, pair) for (integrator, _), pair in pairs.items()])


def _say_powers(pairs: dict[str, list[Overshoot]], verdicts: list[str]) -> None:
    from tdint.analysis.assessment.stability import EXACT_POWERS

    rows = [
        ("method", "u from u0", "dt v from u0", "u from dt v0", "dt v from dt v0", "overshoots"),
        (
            "exact motion",
            *(_power(power) for powers in EXACT_POWERS.values() for power in powers),
            "",
        ),
    ]
    for (name, pair), words in zip(pairs.items(), verdicts, strict=True):
        powers = (
            _power(power)
            for motion in pair
            for power in (motion.displacement_power, motion.velocity_power)
        )
        rows.append((name, *powers, words))
    say("Powers of omega dt in the first step, as omega dt goes to infinity:")
    say_table(rows)


def _say_largest(pairs: dict[str, list[Overshoot]]) -> None:
    from tdint.analysis.assessment.stability import BEYOND

    rows: list[tuple[str, ...]] = [
        ("method", "u from u0", "v from u0", "u from v0", "v from v0", "overshoots")
    ]
    for name, pair in pairs.items():
        largest = [motion.largest for motion in pair]
        beyond = {
            quantity: max(values) > 1.0 + BEYOND
            for quantity, values in zip(
                ("displacement", "velocity"), zip(*largest, strict=True), strict=True
            )
        }
        words = " and ".join(quantity for quantity, passes in beyond.items() if passes) or "none"
        first, second = (
            ["runs away" if math.isinf(value) else f"{value:.3g}" for value in both]
            for both in largest
        )
        rows.append((name, *first, *second, words))
    say("Largest displacement and velocity of the steps, over those of the exact motion:")
    say_table(rows)


def _power(value: float) -> str:
    return "nothing" if value == -math.inf else f"{value + 0.0:.1f}".replace("-0.0", "0.0")
