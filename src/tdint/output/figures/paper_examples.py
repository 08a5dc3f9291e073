"""The paper's figures of its examples, by number: displacements and errors, readable in black and white."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.output.figures.assessment import line_styles, short_labels
from tdint.output.figures.style import add_legend, add_title

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tdint.analysis.assessment.paper_examples import ExampleFigure, ExampleRun

_NARROW = 31  # labels that fit into three columns
_NEAR = 3  # steps on both sides of the peak that a close-up shows


def example_picture(about: str, runs: Sequence[ExampleRun], shown: ExampleFigure, exact: str, reference: str) -> Figure:
    """One figure of the paper: displacement or error of a floor by several methods, with a close-up at the peak.

    Parameters
    ----------
    about : str
        What the example is, in a line.
    runs : sequence of ExampleRun
        Of one example and one step; at least one of them ended. Variants are left out.
    shown : ExampleFigure
        Which one.
    exact : str
        What is called exact: its name in the legend.
    reference : str
        Which one of `tdint.analysis.assessment.paper_examples.REFERENCES` that is.
    """
    runs = [run for run in runs if run.outcome == "done" and not run.variant]
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    wide, close = figure.subplots(1, 2, width_ratios=(2.6, 1.0))
    time = runs[0].motion.time
    true = runs[0].exact(reference).displacement[:, shown.floor - 1]
    found = [run.motion.displacement[:, shown.floor - 1] for run in runs]
    values = [np.abs(one - true) for one in found] if shown.is_error else found
    peak = int(np.argmax(np.max(values, axis=0) if shown.is_error else np.abs(true)))
    near = slice(max(peak - _NEAR, 0), peak + _NEAR + 1)
    labels = list(short_labels([run.method for run in runs]).values())
    lines: dict[str, Any] = {}
    for axes, part in ((wide, slice(None)), (close, near)):
        if not shown.is_error:
            (lines[exact],) = axes.plot(time[part], true[part], color="0.78", linewidth=4.0)
        lines |= _draw_lines(axes, time[part], [one[part] for one in values], labels, marked=axes is close)
    what = "|u - u_exact|" if shown.is_error else "displacement u"
    wide.set_ylabel(f"{what} (m)", parse_math=False)
    wide.set_xlim(time[0], time[-1])
    wide.axvline(time[peak], color="0.3", linewidth=0.8)
    close.set_title(f"close-up at {time[peak]:.4g} s")
    close.xaxis.set_major_locator(MaxNLocator(3))
    if shown.is_error:
        for axes in (wide, close):
            axes.set_ylim(bottom=0.0)
    add_legend(figure, wide, list(lines.values()), list(lines), _NARROW)
    beside = f"; u_exact: {exact.removeprefix('exact: ')}" if shown.is_error else ""
    floor = f", floor {shown.floor}" if runs[0].motion.displacement.shape[1] > 1 else ""
    add_title(figure, f"Figure {shown.number}: {about}\n{what}{floor}, dt {runs[0].dt:g} s{beside}")
    return figure


def _draw_lines(
    axes: Any, time: NDArray[np.float64], values: Sequence[Any], labels: Sequence[str], marked: bool
) -> dict[str, Any]:
    """A line for each method; with markers at every step, or at some. Lines by label."""
    lines = {}
    for one, label, style in zip(values, labels, line_styles(labels, [0.0] * len(labels)), strict=True):
        marks = {"markevery": 1} if marked else {}
        (line,) = axes.plot(time, one, **{**style, **marks}, linewidth=0.8)
        lines[label] = line
    axes.set_xlabel("time (s)")
    return lines
