"""`tdint stability`: what one step of a method does to an oscillator."""

from __future__ import annotations

from tdint.analysis.defaults import BETAS
from tdint.output import figures, tables
from tdint.written_numbers import Grid
from tdint_cli import options
from tdint_cli.options.grammar import grid
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say_table, warn

_STEPS = Grid(0.001, 1000.0, 400)
_BAND = (3.1, 3.7, 301)  # omega dt: the unstable bands lie beside sqrt(12)


_DRAWN = options.analysis.DRAWN


@options.request
class Request:
    """The command line of `tdint stability`."""

    draw_all: bool
    outputs: Outputs
    methods: tuple[str, ...] = options.analysis.all_methods
    damping: tuple[float, ...] = options.analysis.option(
        type=options.analysis.damping_ratio,
        many=True,
        default=(0.0,),
        metavar="RATIO,...",
        common=True,
        help="Damping ratios of the oscillator; 0 by default.",
    )
    dt_over_t: Grid = options.analysis.option(
        type=grid(*options.analysis.DT_OVER_T),
        default=_STEPS,
        metavar="FIRST:LAST:COUNT",
        common=True,
        help=f"Steps over the undamped period in equal ratios, both ends included, or a single one; {_STEPS} by "
        "default.",
    )
    beta_scan: bool = options.option(
        is_flag=True,
        common=True,
        help=f"Add (without --method: take) impulse with beta {', '.join(BETAS)}, and {_BAND[2]} steps with omega "
        f"dt in {_BAND[0]:g}..{_BAND[1]:g}: off 1/144 it is unstable there.",
    )


@options.command(
    "stability",
    "tdint stability --method impulse4,hht --plot=stability.png",
    "tdint stability --method newmark:beta=0.25:gamma=0.5 --dt-over-t 0.1 --damping 5%",
)
@options.analysis.plugin
@options.output.to_files(picture=options.output.PICTURE, more=[options.analysis.draw_all(_DRAWN)], in_units=False)
@options.of(Request)
def command(request: Request) -> None:
    """Spectral radius, period error and numerical damping of methods over dt/T.

    Measured on the compiled steps that integrate buildings, for an oscillator without load. CSV: spectral radius of the
    amplification matrix; period error (numerical over exact period, minus 1), numerical damping (damping ratio of the
    numerical oscillation minus that of the oscillator) and amplitude decay (the part of the amplitude that the method
    takes in one cycle), empty where the method does not oscillate and beyond half a period. The largest stable omega dt
    of each method goes to standard error.
    """
    import numpy as np

    from tdint.analysis.assessment.stability import LARGEST, critical_step, false_limit, stability

    scanned = tuple(f"impulse:beta={beta}" for beta in BETAS) if request.beta_scan else ()
    integrators = options.analysis.integrators((*request.methods, *scanned))
    steps = request.dt_over_t.values()
    if request.beta_scan:
        steps = np.union1d(steps, np.linspace(*_BAND) / (2.0 * np.pi))
    curves = [stability(integrator, steps, ratio) for integrator in integrators for ratio in request.damping]
    shown = curves if request.draw_all or request.methods or scanned else options.analysis.drawn(curves, _DRAWN)
    request.outputs.deliver(
        tables.methods.stability_table(curves),
        lambda: figures.assessment.stability_picture(shown, band=request.beta_scan),
    )
    # The largest stable steps; what a method declares is without damping.
    rows = [("method", "damping", "critical omega dt")]
    none = f"none up to omega dt {LARGEST:.0e}".replace("e+0", "e")
    for integrator in integrators:
        limits = {damping: critical_step(integrator, damping) for damping in (*request.damping, 0.0)}
        if text := false_limit(integrator, limits[0.0]):
            warn(text)
        for damping in request.damping:
            limit = limits[damping]
            rows.append((integrator.label, f"{damping:g}", f"{limit:#.6g}" if limit < float("inf") else none))
    say_table(rows)
