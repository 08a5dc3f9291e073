"""`tdint overshoot`: overshoot of methods at large time steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tdint import assessment
from tdint.output import tables
from tdint_cli import options
from tdint_cli.assessment import method_options
from tdint_cli.options.option_types import Count, Number
from tdint_cli.terminal import say, say_table

if TYPE_CHECKING:
    from tdint.assessment.stability.stability import Overshoot

_MAX_STEPS = 100_000  # maximum number of steps; a table with more rows is difficult to open
_DRAWN = tuple(name for name in method_options.DRAWN if name != "central-difference")
"""Methods in the figure. A large time step exceeds the stability limit of central-difference."""


@options.request
class Request(method_options.OscillatorRequest):
    """The command line of `tdint overshoot`."""

    dt_over_t: float = options.option(type=Number(*method_options.DT_OVER_T), default=10.0)
    steps: int = options.option(type=Count(1, _MAX_STEPS), default=10)
    law: str = options.option(default="linear")


@options.command
@method_options.oscillator_options(_DRAWN)
@options.of(Request)
def command(request: Request) -> None:
    """Measure the overshoot of methods at large time steps.

    An oscillator without load is integrated from an initial displacement (u, v) = (1, 0), and from
    an initial velocity (0, 1). CSV: u / U and v / (omega U) at the time steps, with the amplitude U
    of the exact undamped motion: 1 for the initial displacement, 1 / omega for the initial
    velocity. The exact motion is between -1 and 1; values outside this range are overshoot. The
    cells are empty after the motion has grown without bound.

    The powers p describe the growth of the first time step, u ~ (omega dt)^p and dt v ~ (omega
    dt)^p for omega dt to infinity, from u = 1 and from dt v = 1. They are also written to standard
    error, with the powers of the exact motion: a method overshoots if its power is larger. houbolt
    and park start with average acceleration; their powers are the powers of this starting method.

    With --law hardening or softening the initial energy is the energy of the problem with this name
    in `tdint failures`, first as strain energy, then as kinetic energy. The columns are divided by
    the maximum displacement and velocity of the exact motion; T is the period of small vibrations.
    There are no powers; the maximum ratios are written to standard error.
    """
    from tdint.assessment.stability.stability import STARTS, overshoot, verdict

    integrators = method_options.integrators(request.methods)
    if request.law != "linear":
        integrators = method_options.for_nonlinear(integrators, request.law)
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
        tables.table.Table.of_results(assessment.tables.OVERSHOOT, motions),
        lambda: assessment.stability_figures.overshoot_picture(shown),
    )
    named_pairs = {}
    for (integrator, ratio), pair in pairs.items():
        damping_text = f", damping {ratio:g}" if len(request.damping) > 1 else ""
        named_pairs[f"{integrator.label}{damping_text}"] = pair
    if request.law != "linear":
        _report_maxima(named_pairs)
    else:
        verdicts = [verdict(integrator, pair) for (integrator, _), pair in pairs.items()]
        _report_powers(named_pairs, verdicts)


def _report_powers(pairs: dict[str, list[Overshoot]], verdicts: list[str]) -> None:
    """Print the powers of omega dt in the first time step for each method and damping ratio, for
    the motions from an initial displacement and from an initial velocity. The verdicts are the last
    column.
    """
    from tdint.assessment.stability.stability import EXACT_POWERS

    rows = [
        ("method", "u from u0", "dt v from u0", "u from dt v0", "dt v from dt v0", "overshoots"),
        (
            "exact motion",
            *(_power(power) for powers in EXACT_POWERS.values() for power in powers),
            "",
        ),
    ]
    for (name, pair), verdict in zip(pairs.items(), verdicts, strict=True):
        powers = (
            _power(power)
            for motion in pair
            for power in (motion.displacement_power, motion.velocity_power)
        )
        rows.append((name, *powers, verdict))
    say("Powers of omega dt in the first time step, for omega dt to infinity:")
    say_table(rows)


def _report_maxima(pairs: dict[str, list[Overshoot]]) -> None:
    """Print the maximum ratios of displacement and velocity to the exact motion.

    `pairs` contains the motions from an initial displacement and from an initial velocity, for each
    method and damping ratio.
    """
    from tdint.assessment.stability.stability import BEYOND

    rows: list[tuple[str, ...]] = [
        ("method", "u from u0", "v from u0", "u from v0", "v from v0", "overshoots")
    ]
    for name, pair in pairs.items():
        # Each item of `maxima` contains the ratios of displacement and velocity of a motion.
        maxima = [motion.largest for motion in pair]
        overshooting = []
        for i, quantity in enumerate(("displacement", "velocity")):
            # An excess over the exact maximum of at most BEYOND does not count as overshoot.
            if max(ratios[i] for ratios in maxima) > 1.0 + BEYOND:
                overshooting.append(quantity)
        texts = [
            "unbounded" if math.isinf(ratio) else f"{ratio:.3g}"
            for ratios in maxima
            for ratio in ratios
        ]
        rows.append((name, *texts, " and ".join(overshooting) or "none"))
    say("Maximum displacement and velocity, divided by the maxima of the exact motion:")
    say_table(rows)


def _power(value: float) -> str:
    """Return the text of a power; 'zero' for the power -infinity of a quantity that is zero."""
    # A power that is rounded to zero is printed without a minus sign.
    return "zero" if value == -math.inf else f"{value + 0.0:.1f}".replace("-0.0", "0.0")
