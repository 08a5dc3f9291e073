"""Other programs in the same chart: OpenSeesPy, where it is installed, and SciPy's solve_ivp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tdint.analysis.chart.opensees import openseespy_points
from tdint.analysis.chart.problem import Problem
from tdint.analysis.chart.solve_ivp import solve_ivp_points
from tdint.analysis.chart.work_precision import Chart, Progress, silent


def with_peers(
    problem: Problem, chart: Chart, dts: Sequence[float], *, repeats: int, progress: Progress = silent
) -> tuple[Chart, list[str]]:
    """The chart with the points of other programs behind its own, and what of them is left out, a sentence each.

    Their errors are against the same reference; their times are those of their analysis loops alone.
    """
    progress("openseespy", 0.0)
    own, notes = openseespy_points(problem, sorted(set(dts), reverse=True), chart.reference, repeats=repeats)
    progress("scipy", 0.5)
    others, more = solve_ivp_points(problem, chart.reference)
    return replace(chart, points=(*chart.points, *own, *others)), [*notes, *more]
