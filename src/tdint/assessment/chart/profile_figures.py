"""Figures of performance profiles of methods."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter

from tdint.assessment.chart.chart_notes import conditions, programs
from tdint.number_parsing import abbreviate, pluralize
from tdint.output.figures.legends import add_legend
from tdint.output.figures.style import (
    LIGHT,
    NARROW,
    is_narrow,
    method_styles,
    plain_numbers,
    titled,
)
from tdint.output.tables.methods import PEER
from tdint.response.defaults import PEAKS

if TYPE_CHECKING:
    from tdint.assessment.chart.performance_profiles import FieldChart
    from tdint.assessment.chart.work_precision import PerformanceProfile
from tdint.output.figures.static_curves import NARROW_FOOT, PROFILE_FOOT

_MAX_COST_RATIO = 30.0  # end of the axis of cost ratios; slower methods are not of interest

_MAX_UNSOLVED = 3  # problems that are named below a figure; the command prints all

_BOLD = {"impulse4": 2.4, "moment4": 2.4, "newmark-average": 2.0}
"""Line widths (points) of emphasized methods: the methods that tdint recommends, and the method
that most programs use."""


def profile_picture(chart: FieldChart, *, target: str, highlight: str = "") -> Figure:
    """Plot performance profiles (Dolan and More 2002), with a panel for each tolerance.

    A profile is the fraction of problems that a method solves within a factor of the minimum cost.

    Parameters
    ----------
    target : str
        Quantity of the error, a key of `PEAKS`.
    highlight : str
        Method that has a thick line in front of the other lines; empty by default, which emphasizes
        the methods in `_BOLD`.
    """
    quantity = target.replace("-", "_")
    profiles = [profile for profile in chart.profiles if profile.quantity == quantity]
    tolerances = sorted({profile.tolerance for profile in profiles}, reverse=True)
    narrow = is_narrow()
    figure = Figure(figsize=(7.5, 9.0 if narrow else 5.4), layout="constrained")
    panels = figure.subplots(*(3, 2) if narrow else (2, 3), sharex=True, sharey=True)
    plot_styles = method_styles(chart.lines, highlight)
    handles: dict[str, Any] = {}
    for axes, tolerance in zip(panels.flat, tolerances, strict=False):
        shown = [profile for profile in profiles if profile.tolerance == tolerance]
        handles |= _plot_profiles(axes, shown, plot_styles)
        count = max(profile.problems for profile in shown)
        axes.set_title(f"error within {100.0 * tolerance:g} % ({pluralize(count, 'problem')})")
    for axes in panels.flat[len(tolerances) :]:
        axes.set_axis_off()
    for axes in panels[:, 0]:
        axes.set_ylabel("fraction of problems solved")
    for axes in panels[-1]:
        axes.set_xlabel("time divided by minimum time")
    shown_lines = [line for line in chart.lines if line in handles]
    add_legend(
        figure,
        panels[0, 0],
        [handles[line] for line in shown_lines],
        [
            # The second text is empty (times False) if the method was run for all problems.
            chart.named(line)
            + ", partly not run" * any(p.not_run for p in profiles if p.method == line)
            for line in shown_lines
        ],
        NARROW,
    )
    # The conditions of the measurement are the title of the legend, because the layout reserves
    # space for a legend. A figure of a single method has no legend and no such text.
    text = (
        "Each method has the cheapest time step that is within the tolerance together with all "
        "smaller time steps; lines end at the fraction solved within "
        f"{_MAX_COST_RATIO:g} times the minimum cost. Times: "
        f"{conditions(chart.timing)}; {programs(chart.peers)}"
    )
    if unsolved := chart.unsolved():
        text += f". Not solved within 10 %: {abbreviate(unsolved, _MAX_UNSOLVED)}"
    for legend in figure.legends:
        footnote = wrap(text, NARROW_FOOT if narrow else PROFILE_FOOT)
        figure.set_figheight(figure.get_figheight() + (0.3 if narrow else 0.14) * len(footnote))
        legend.set_title("\n".join(footnote), prop={"size": 7.5})  # type: ignore[arg-type]
        legend.get_title().set_multialignment("center")
    return titled(
        figure,
        f"Performance profiles over {pluralize(len(chart.measured), 'problem')}\n{PEAKS[target]}",
    )


def _plot_profiles(
    axes: Any, profiles: Sequence[PerformanceProfile], plot_styles: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    """Plot the performance profiles of all methods for a single tolerance, over the cost divided by
    the minimum cost.

    If a line style (`method_styles`) has a line width, its method is emphasized instead of the
    methods in `_BOLD`.
    """
    line_widths = {
        method: plot_style["linewidth"]
        for method, plot_style in plot_styles.items()
        if "linewidth" in plot_style
    } or _BOLD
    lines: dict[str, Any] = {}
    # Emphasized methods are plotted last, so that their lines are in front.
    for profile in sorted(profiles, key=lambda profile: line_widths.get(profile.method, 0.0)):
        # The profile rises by a single problem at each cost ratio. At the end of the panel it
        # reaches the fraction of problems that the method solves within the maximum cost ratio.
        ratios = [ratio for ratio in profile.ratios if ratio <= _MAX_COST_RATIO]
        solved_fractions = np.arange(len(ratios) + 1) / max(profile.problems, 1)
        x, y = [1.0, *ratios, _MAX_COST_RATIO], [*solved_fractions, solved_fractions[-1]]
        plot_style = plot_styles[profile.method] | {"markersize": 3.5, "markevery": 0.2}
        plot_style |= {"linewidth": line_widths.get(profile.method, 1.0)}
        # Methods of other programs have hollow markers.
        plot_style |= {"markerfacecolor": "white"} if PEER in profile.method else {}
        (lines[profile.method],) = axes.step(x, y, where="post", **plot_style)
    axes.set(xscale="log", xlim=(1.0, _MAX_COST_RATIO), ylim=(0.0, 1.03))
    axes.xaxis.set_major_locator(FixedLocator([1.0, 2.0, 5.0, 10.0, 30.0]))
    axes.xaxis.set_minor_formatter(NullFormatter())
    plain_numbers(axes.xaxis)
    axes.axvline(2.0, color=LIGHT, linewidth=0.6)
    return lines
