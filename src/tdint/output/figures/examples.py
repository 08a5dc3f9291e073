"""Figures of the paper of 2022: responses and errors of its examples, and the buildings of examples
2 and 3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from tdint.output.figures.assessment import line_styles
from tdint.output.figures.style import NARROW, add_legend, titled

if TYPE_CHECKING:
    from tdint.analysis.assessment.paper_examples import ExampleFigure, ExampleRun
    from tdint.model.definition import Model

_NEAR = 3  # number of time steps on both sides of the peak in a close-up
_SHOWN = 2  # number of masses at each end of a row that is too long to draw
_SIDE = 0.5  # side of a mass divided by the distance between masses


def example_picture(
    about: str, runs: Sequence[ExampleRun], shown: ExampleFigure, exact: str, reference: str
) -> Figure:
    """Draw one figure of the paper: displacement or error of a floor, with a close-up at the peak.

    Parameters
    ----------
    about : str
        Description of the example in one line.
    runs : sequence of ExampleRun
        Runs of one example and one time step, of which at least one is completed. Variants are
        omitted.
    shown : ExampleFigure
        Figure of the paper.
    exact : str
        Label of the exact solution in the legend.
    reference : str
        Key of the exact solution in `tdint.analysis.assessment.paper_examples.REFERENCES`.
    """
    runs = [run for run in runs if run.outcome == "done" and not run.variant]
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    wide, close = figure.subplots(1, 2, width_ratios=(2.6, 1.0))
    time = runs[0].motion.time
    true = runs[0].exact(reference).displacement[:, shown.floor - 1]
    displacements = [run.motion.displacement[:, shown.floor - 1] for run in runs]
    values = (
        [np.abs(motion - true) for motion in displacements] if shown.is_error else displacements
    )
    peak = int(np.argmax(np.max(values, axis=0) if shown.is_error else np.abs(true)))
    near = slice(max(peak - _NEAR, 0), peak + _NEAR + 1)
    labels = [run.method for run in runs]
    styles = line_styles(labels, [0.0] * len(labels))
    lines: dict[str, Any] = {}
    for axes, part in ((wide, slice(None)), (close, near)):
        if not shown.is_error:
            (lines[exact],) = axes.plot(time[part], true[part], color="0.78", linewidth=4.0)
        # Each method has a line with markers at some time steps; in the close-up at every time
        # step.
        for motion, label, style in zip(values, labels, styles, strict=True):
            look = style | {"linewidth": 0.8} | ({"markevery": 1} if axes is close else {})
            (lines[label],) = axes.plot(time[part], motion[part], **look)
        axes.set_xlabel("time (s)")
    quantity = "|u - u_exact|" if shown.is_error else "displacement u"
    wide.set_ylabel(f"{quantity} (m)", parse_math=False)
    wide.set_xlim(time[0], time[-1])
    wide.axvline(time[peak], color="0.3", linewidth=0.8)
    close.set_title(f"close-up at {time[peak]:.4g} s")
    close.xaxis.set_major_locator(MaxNLocator(3))
    if shown.is_error:
        for axes in (wide, close):
            axes.set_ylim(bottom=0.0)
    add_legend(figure, wide, list(lines.values()), list(lines), NARROW)
    beside = f"; u_exact: {exact.removeprefix('exact: ')}" if shown.is_error else ""
    floor = f", floor {shown.floor}" if runs[0].motion.displacement.shape[1] > 1 else ""
    return titled(
        figure, f"Figure {shown.number}: {about}\n{quantity}{floor}, dt {runs[0].dt:g} s{beside}"
    )


# ---- Drawing of a building: masses in a row between springs and dashpots, the first at a wall


def row_picture(title: str, model: Model) -> Figure:
    """Draw a building as a row of masses with a fixed left end; of many masses only the ends."""
    count = len(model.stories)
    is_cut = count > 2 * _SHOWN
    shown = [*range(_SHOWN), *range(count - _SHOWN, count)] if is_cut else list(range(count))
    figure = Figure(figsize=(7.5, 2.9), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(-0.15, len(shown) + is_cut + 0.5), ylim=(-0.85, 0.95), aspect="equal")
    axes.axis("off")
    axes.add_patch(
        Rectangle((-0.12, -0.4), 0.12, 0.8, facecolor="0.85", hatch="////", edgecolor="0.4")
    )
    black: dict[str, Any] = {"color": "black", "linewidth": 0.9}
    for place, index in enumerate(shown):
        left = place + (is_cut and place >= _SHOWN) + 1.0 - _SIDE
        if is_cut and place == _SHOWN:
            axes.text(
                left - 1.0 + 0.5 * _SIDE, 0.0, "· · ·", ha="center", va="center", fontsize=14.0
            )
        # The link to the one before: a spring above a dashpot.
        before = left - (1.0 - _SIDE)
        middle = 0.5 * (before + left)
        teeth = np.array([0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0, 0.0])
        axes.plot(np.linspace(before, left, 9), 0.13 + 0.05 * teeth, **black)
        axes.plot([before, middle], [-0.13, -0.13], **black)
        axes.plot([middle, middle], [-0.18, -0.08], **black)
        cup = [middle - 0.06, middle + 0.06, middle + 0.06, middle - 0.06]
        axes.plot(cup, [-0.2, -0.2, -0.06, -0.06], **black)
        axes.plot([middle + 0.06, left], [-0.13, -0.13], **black)
        axes.add_patch(
            Rectangle((left, -0.5 * _SIDE), _SIDE, _SIDE, facecolor="0.93", edgecolor="black")
        )
        axes.text(
            left + 0.5 * _SIDE,
            0.0,
            f"{model.stories[index].mass:g} kg",
            ha="center",
            va="center",
            fontsize=7.5,
        )
        axes.text(left + 0.5 * _SIDE, -0.4, f"{index + 1}", ha="center", va="center", fontsize=7.5)
        # The force on the floor, a sum of cosines and sines.
        waves = [
            f"{size:g} {wave} {force.omega:g}t"
            for force in model.excitation.forces
            for size, wave in ((force.cosine, "cos"), (force.sine, "sin"))
            if size and force.floor == index + 1
        ]
        if waves:
            text = f"{' + '.join(waves)} N"
            axes.annotate("", (left + _SIDE, 0.45), (left, 0.45), arrowprops={"arrowstyle": "->"})
            axes.text(left + 0.5 * _SIDE, 0.55, text, ha="center", va="bottom", fontsize=7.0)
    # The law of the links, in powers of the drift d, once if all are alike.
    springs: list[str] = []
    for story in model.stories:
        powers = zip(story.law.parameters, ("d", "d²", "d³"), strict=False)
        spring = " + ".join(f"{value:g} {power}" for value, power in powers if value)
        springs.append(f"f = {spring} N, dashpot {story.dashpot:g} N s/m")
    springs = list(dict.fromkeys(springs))
    text = "\n".join(
        springs
        if len(springs) == 1
        else [f"link {i}: {law}" for i, law in enumerate(springs, start=1)]
    )
    axes.text(0.0, -0.6, text, ha="left", va="top", fontsize=7.5)
    return titled(figure, title)
