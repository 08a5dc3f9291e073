"""Figures of the paper of 2022: responses and errors of its examples, and the buildings of examples
2 and 3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from tdint.assessment.stability.stability_figures import line_styles
from tdint.output.figures.legends import add_legend
from tdint.output.figures.style import NARROW, titled

if TYPE_CHECKING:
    from tdint.assessment.examples.paper_examples import ExampleFigure, ExampleRun
    from tdint.model.definition import Model

_NEAR = 3  # number of time steps on both sides of the peak in a close-up
_SHOWN = 2  # number of masses at each end of a long row
_SIDE = 0.5  # side of a mass divided by the distance between masses


def example_picture(
    about: str, runs: Sequence[ExampleRun], shown: ExampleFigure, exact: str, reference: str
) -> Figure:
    """Plot the displacement of a floor in an example of the paper, or its error, over the time.

    A second panel is a close-up at the peak.

    Parameters
    ----------
    runs : sequence of ExampleRun
        Runs of a single example and one time step; at least one run is completed. Variants are
        omitted.
    exact : str
        Label of the exact solution in the legend.
    reference : str
        Key of the exact solution in `tdint.assessment.examples.paper_examples.REFERENCES`.
    """
    runs = [run for run in runs if run.outcome == "done" and not run.variant]
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    history_axes, close_up_axes = figure.subplots(1, 2, width_ratios=(2.6, 1.0))
    time = runs[0].motion.time
    exact_displacement = runs[0].exact(reference).displacement[:, shown.floor - 1]
    displacements = [run.motion.displacement[:, shown.floor - 1] for run in runs]
    # The plotted values of each run are absolute errors or displacements.
    values = displacements
    if shown.is_error:
        values = [np.abs(motion - exact_displacement) for motion in displacements]
    # The close-up is at the largest error of any run, or at the peak of the exact solution. `peak`
    # is the index of the time step.
    peak = int(np.argmax(np.max(values, axis=0) if shown.is_error else np.abs(exact_displacement)))
    close_up = slice(max(peak - _NEAR, 0), peak + _NEAR + 1)
    labels = [run.method for run in runs]
    styles = line_styles(labels, [0.0] * len(labels))
    lines: dict[str, Any] = {}
    for axes, samples in ((history_axes, slice(None)), (close_up_axes, close_up)):
        if not shown.is_error:
            (lines[exact],) = axes.plot(
                time[samples], exact_displacement[samples], color="0.78", linewidth=4.0
            )
        # Each method has a line with markers at some time steps; in the close-up at every time
        # step.
        for motion, label, style in zip(values, labels, styles, strict=True):
            plot_style = (
                style | {"linewidth": 0.8} | ({"markevery": 1} if axes is close_up_axes else {})
            )
            (lines[label],) = axes.plot(time[samples], motion[samples], **plot_style)
        axes.set_xlabel("time (s)")
    quantity = "|u - u_exact|" if shown.is_error else "displacement u"
    history_axes.set_ylabel(f"{quantity} (m)", parse_math=False)
    history_axes.set_xlim(time[0], time[-1])
    history_axes.axvline(time[peak], color="0.3", linewidth=0.8)
    close_up_axes.set_title(f"close-up at {time[peak]:.4g} s")
    close_up_axes.xaxis.set_major_locator(MaxNLocator(3))
    if shown.is_error:
        for axes in (history_axes, close_up_axes):
            axes.set_ylim(bottom=0.0)
    add_legend(figure, history_axes, list(lines.values()), list(lines), NARROW)
    reference_text = f"; u_exact: {exact.removeprefix('exact: ')}" if shown.is_error else ""
    floor = f", floor {shown.floor}" if runs[0].motion.displacement.shape[1] > 1 else ""
    return titled(
        figure,
        f"Figure {shown.number}: {about}\n{quantity}{floor}, dt {runs[0].dt:g} s{reference_text}",
    )


# ---- Drawing of a building: masses in a row between springs and dashpots, the first at a wall


def row_picture(title: str, model: Model) -> Figure:
    """Plot a building as a row of masses, springs and dashpots between a wall and a free end.

    Only the first and the last masses of a long row are plotted, with three dots between them. In
    the coordinates of the figure, the distance between masses is 1 and the row is at the height 0.

    Parameters
    ----------
    model : Model
        Building with polynomial laws and linear dashpots. Forces on its floors are written above
        the masses.
    """
    count = len(model.stories)
    is_cut = count > 2 * _SHOWN
    shown = [*range(_SHOWN), *range(count - _SHOWN, count)] if is_cut else list(range(count))
    figure = Figure(figsize=(7.5, 2.9), layout="constrained")
    axes = figure.subplots()
    # Three dots have the width of a mass. `is_cut` (True) counts as 1.
    axes.set(xlim=(-0.15, len(shown) + is_cut + 0.5), ylim=(-0.85, 0.95), aspect="equal")
    axes.axis("off")
    axes.add_patch(
        Rectangle((-0.12, -0.4), 0.12, 0.8, facecolor="0.85", hatch="////", edgecolor="0.4")
    )
    for position, index in enumerate(shown):
        left = position + 1.0 - _SIDE  # left side of the mass
        if is_cut and position >= _SHOWN:  # the mass is to the right of the three dots
            left += 1.0
        if is_cut and position == _SHOWN:
            axes.text(
                left - 1.0 + 0.5 * _SIDE, 0.0, "· · ·", ha="center", va="center", fontsize=14.0
            )
        _draw_link(axes, left - (1.0 - _SIDE), left)
        _draw_mass(axes, model, index, left)
    # The hysteretic laws are polynomials of the drift d. A law that all links have is written one
    # time, without the number of a link.
    laws: list[str] = []
    for story in model.stories:
        powers = zip(story.law.parameters, ("d", "d²", "d³"), strict=False)
        spring = " + ".join(f"{value:g} {power}" for value, power in powers if value)
        laws.append(f"f = {spring} N, dashpot {story.dashpot:g} N s/m")
    laws = list(dict.fromkeys(laws))
    if len(laws) > 1:
        laws = [f"link {i}: {law}" for i, law in enumerate(laws, start=1)]
    axes.text(0.0, -0.6, "\n".join(laws), ha="left", va="top", fontsize=7.5)
    return titled(figure, title)


def _draw_link(axes: Any, start: float, end: float) -> None:
    """Plot a spring and a dashpot below the spring, from the abscissa `start` to `end`."""
    black: dict[str, Any] = {"color": "black", "linewidth": 0.9}
    middle = 0.5 * (start + end)
    # The spring is a zigzag line between two straight parts.
    teeth = np.array([0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0, 0.0])
    axes.plot(np.linspace(start, end, 9), 0.13 + 0.05 * teeth, **black)
    # The lines of the dashpot are the rod, the piston, the cylinder and its connection.
    axes.plot([start, middle], [-0.13, -0.13], **black)
    axes.plot([middle, middle], [-0.18, -0.08], **black)
    cylinder = [middle - 0.06, middle + 0.06, middle + 0.06, middle - 0.06]
    axes.plot(cylinder, [-0.2, -0.2, -0.06, -0.06], **black)
    axes.plot([middle + 0.06, end], [-0.13, -0.13], **black)


def _draw_mass(axes: Any, model: Model, index: int, left: float) -> None:
    """Plot the mass of a floor with its number and its force.

    `index` is the index of the floor, from 0.
    """
    axes.add_patch(
        Rectangle((left, -0.5 * _SIDE), _SIDE, _SIDE, facecolor="0.93", edgecolor="black")
    )
    center = left + 0.5 * _SIDE
    mass = f"{model.stories[index].mass:g} kg"
    axes.text(center, 0.0, mass, ha="center", va="center", fontsize=7.5)
    axes.text(center, -0.4, f"{index + 1}", ha="center", va="center", fontsize=7.5)
    # The force on the floor is a sum of cosines and sines of the time t.
    terms: list[str] = []
    for force in model.excitation.forces:
        if force.floor == index + 1:
            for amplitude, function in ((force.cosine, "cos"), (force.sine, "sin")):
                if amplitude:
                    terms.append(f"{amplitude:g} {function} {force.omega:g}t")
    if terms:
        axes.annotate("", (left + _SIDE, 0.45), (left, 0.45), arrowprops={"arrowstyle": "->"})
        text = f"{' + '.join(terms)} N"
        axes.text(center, 0.55, text, ha="center", va="bottom", fontsize=7.0)
