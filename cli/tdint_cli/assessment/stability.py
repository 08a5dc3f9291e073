"""`tdint stability`: stability and accuracy of one time step of a method for an oscillator."""

from __future__ import annotations

from tdint import assessment
from tdint.grids import Grid
from tdint.output import tables
from tdint.response.defaults import BETAS
from tdint_cli import options
from tdint_cli.assessment import method_options
from tdint_cli.options.option_types import ListOf, grid
from tdint_cli.terminal import say_table, warn

_STEPS = Grid(0.001, 1000.0, 400)
_BAND = (3.1, 3.7, 301)  # omega dt: the unstable bands are next to sqrt(12)
_DRAWN = method_options.DRAWN


@options.request
class Request(method_options.OscillatorRequest):
    """The command line of `tdint stability`."""

    dt_over_t: tuple[Grid, ...] = options.option(
        type=ListOf(grid(*method_options.DT_OVER_T)), default=(_STEPS,)
    )
    beta_scan: bool = options.option(
        help=f"Add (without --method: use) impulse with beta {', '.join(BETAS)}, and {_BAND[2]} "
        f"time steps with omega dt from {_BAND[0]:g} to {_BAND[1]:g}, where it is unstable unless "
        "beta is 1/144."
    )


@options.command
@method_options.oscillator_options(_DRAWN)
@options.of(Request)
def command(request: Request) -> None:
    """Compute spectral radius, period error and numerical damping over dt/T.

    The values are measured with the same compiled time loops that integrate buildings, for an
    oscillator without load. CSV: spectral radius of the amplification matrix; period error
    (numerical period divided by exact period, minus 1); numerical damping (damping ratio of the
    numerical oscillation minus the damping ratio of the oscillator; eq. 40 of the paper of 2022
    states half of this value); amplitude decay (fraction of the amplitude that the method removes
    per cycle; eq. 41); spurious radius (largest modulus of the roots other than the principal
    pair, 0 if there are no other roots; eq. 35). Period error, numerical damping and amplitude
    decay are empty if the method does not oscillate, or if the time step exceeds half a period.
    The spurious radius is empty if the principal pair is real. The maximum stable omega dt of each
    method is written to standard error.
    """
    import numpy as np

    from tdint.assessment.stability.stability import LARGEST, critical_step, false_limit, stability

    scan_methods = tuple(f"impulse:beta={beta}" for beta in BETAS) if request.beta_scan else ()
    integrators = method_options.integrators((*request.methods, *scan_methods))
    steps = np.unique(np.concatenate([steps.values() for steps in request.dt_over_t]))
    if request.beta_scan:
        # dt / T is omega dt / (2 pi).
        steps = np.union1d(steps, np.linspace(*_BAND) / (2.0 * np.pi))
    curves = [
        stability(integrator, steps, ratio)
        for integrator in integrators
        for ratio in request.damping
    ]
    shown = curves if scan_methods else request.drawn(curves, _DRAWN)
    request.outputs.deliver(
        tables.table.Table.of_results(assessment.tables.STABILITY, curves),
        lambda: assessment.stability_figures.stability_picture(shown, band=request.beta_scan),
    )
    # Report the maximum stable time steps. The limit without damping is computed also, because
    # methods declare their limit for zero damping: a warning reports a wrong declaration.
    rows = [("method", "damping", "critical omega dt")]
    # Shorten an exponent such as e+03 to e3.
    no_limit = f"none up to omega dt {LARGEST:.0e}".replace("e+0", "e")
    for integrator in integrators:
        limits = {
            damping: critical_step(integrator, damping) for damping in (*request.damping, 0.0)
        }
        if text := false_limit(integrator, limits[0.0]):
            warn(text)
        for damping in request.damping:
            limit = limits[damping]
            limit_text = f"{limit:#.6g}" if limit < float("inf") else no_limit
            rows.append((integrator.label, f"{damping:g}", limit_text))
    say_table(rows)
