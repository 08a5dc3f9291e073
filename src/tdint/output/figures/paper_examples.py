"""Figures of the paper's examples: histories and errors of several methods, readable in black and white."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.files import Writer
from tdint.output.figures.assessment import line_styles, short_labels
from tdint.output.figures.style import add_legend, add_title, picture

if TYPE_CHECKING:
    from tdint.analysis.assessment.paper_examples import ExampleRun

_UNITS = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}
_NARROW = 31  # labels that fit into three columns
_NEAR = 3  # steps on both sides of the peak that a close-up shows
_ROUNDING = 1e-16  # no error below it is shown


def example_picture(
    title: str, runs: Sequence[ExampleRun], floor: int, quantities: Sequence[str], what: str, suffix: str
) -> Writer:
    """Figure of one example: motion of a floor by several methods.

    Return value and errors are those of `tdint.output.figures.style.picture`.

    Parameters
    ----------
    title : str
        Its first line.
    runs : sequence of ExampleRun
        Of one example and one step; at least one of them ended.
    floor : int
        Counted from 1.
    quantities : sequence of str
        `displacement`, `velocity`, `acceleration`; a row of panels each.
    what : str
        `history`, with a close-up at the peak; `error`, the largest one up to each time; or `both`.
    """
    ended = [run for run in runs if run.outcome == "done"]
    return picture(suffix, lambda: _draw(title, ended, floor - 1, quantities, what))


def _draw(title: str, runs: Sequence[ExampleRun], floor: int, quantities: Sequence[str], what: str) -> Figure:
    rows = [(quantity, kind) for quantity in quantities for kind in ("history", "error") if what in (kind, "both")]
    figure = Figure(figsize=(7.5, 1.2 + 2.4 * len(rows)), layout="constrained")
    grid = figure.add_gridspec(len(rows), 2, width_ratios=(2.6, 1.0))
    styles = line_styles([_label(run) for run in runs], [0.0] * len(runs))
    lines: dict[str, Any] = {}
    for row, (quantity, kind) in enumerate(rows):
        if kind == "history":
            wide, close = (figure.add_subplot(grid[row, column]) for column in (0, 1))
            lines |= _draw_history(wide, close, runs, styles, floor, quantity)
        else:
            lines |= _draw_errors(figure.add_subplot(grid[row, :]), runs, styles, floor, quantity)
    add_legend(figure, figure.axes[0], list(lines.values()), list(lines), _NARROW)
    add_title(figure, f"{title}\ndt {runs[0].dt:g} s, floor {floor + 1}")
    return figure


def _label(run: ExampleRun) -> str:
    method = short_labels([run.method])[run.method]
    return f"{method}, {run.variant}" if run.variant else method


def _draw_history(
    wide: Any, close: Any, runs: Sequence[ExampleRun], styles: Sequence[dict[str, Any]], floor: int, quantity: str
) -> dict[str, Any]:
    """The methods as they are, without variants, over the exact motion; lines by label."""
    time = runs[0].motion.time
    exact = getattr(runs[0].reference, quantity)[:, floor]
    peak = int(np.argmax(np.abs(exact)))
    near = slice(max(peak - _NEAR, 0), peak + _NEAR + 1)
    lines = {}
    for axes, part in ((wide, slice(None)), (close, near)):
        (lines["exact"],) = axes.plot(time[part], exact[part], color="0.78", linewidth=4.0)
        for run, style in zip(runs, styles, strict=True):
            if not run.variant:
                marks = {"markevery": 1} if axes is close else {"marker": ""}
                values = getattr(run.motion, quantity)[part, floor]
                (lines[_label(run)],) = axes.plot(time[part], values, **{**style, **marks}, linewidth=0.8)
    wide.set_ylabel(f"{quantity} ({_UNITS[quantity]})")
    wide.set_xlim(time[0], time[-1])
    wide.axvline(time[peak], color="0.3", linewidth=0.8)
    close.set_title(f"close-up at {time[peak]:.4g} s")
    close.xaxis.set_major_locator(MaxNLocator(3))
    for axes in (wide, close):
        axes.set_xlabel("time (s)")
    return lines


def _draw_errors(
    axes: Any, runs: Sequence[ExampleRun], styles: Sequence[dict[str, Any]], floor: int, quantity: str
) -> dict[str, Any]:
    """The largest error up to each time, variants as well; lines by label."""
    lines = {}
    for run, style in zip(runs, styles, strict=True):
        error = np.abs(getattr(run.motion, quantity) - getattr(run.reference, quantity))[:, floor]
        (lines[_label(run)],) = axes.plot(run.motion.time[1:], np.maximum.accumulate(error)[1:], **style)
    least = min(float(line.get_ydata()[-1]) for line in lines.values())
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.2 * max(least, _ROUNDING))
    axes.set_xlim(0.0, runs[0].motion.time[-1])
    axes.set_ylabel(f"largest error of the\n{quantity} so far ({_UNITS[quantity]})")
    axes.set_xlabel("time (s)")
    return lines
