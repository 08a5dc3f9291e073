"""Figures of observed orders of convergence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from tdint.assessment.stability.stability_figures import line_styles, plot, thinned
from tdint.output.figures.legends import add_legend, legend_columns
from tdint.output.figures.style import (
    COLORS,
    NARROW,
    plain_numbers,
    titled,
)

if TYPE_CHECKING:
    from tdint.assessment.order.order import ObservedOrder


def order_picture(measured: Sequence[ObservedOrder], name: str = "", thin: int = 0) -> Figure:
    """Plot observed orders of convergence.

    The x axis is the frequency ratio if the orders were measured for several frequency ratios of
    the load. Otherwise each method has a row of markers for displacement, velocity and
    acceleration.

    Parameters
    ----------
    measured : sequence of ObservedOrder
        Observed order of each method and frequency ratio, for a single load; at least one.
    name : str
        Text before the title, such as the name of the figure; empty by default.
    """
    first = measured[0]
    has_ratio = not math.isnan(first.frequency_ratio)
    several = len({order.frequency_ratio for order in measured}) > 1
    figure = _draw_orders(measured, thin) if several and has_ratio else _draw_order_chart(measured)
    # The title states the properties that all curves share, so that the legend is short.
    loads = {
        "free": "free vibration",
        "harmonic": "harmonic load",
        "record": "a record that is linear between its samples",
    }
    title = f"Observed order: {loads.get(first.load, first.load)}, {first.law} law"
    if has_ratio and not several:
        title += f", frequency ratio {first.frequency_ratio:g}"
    if len({order.method for order in measured}) == 1:
        title = f"{first.method}\n{title}"
    return titled(figure, name + title)


def _draw_orders(measured: Sequence[ObservedOrder], thin: int) -> Figure:
    """Plot observed order and error at the smallest time step over the frequency ratio."""
    figure = Figure(figsize=(7.5, 6.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    methods = list(dict.fromkeys(order.method for order in measured))
    lines = []
    # All lines have the same damping ratio, 0.0, so that styles differ only by method.
    damping_ratios = [0.0] * len(methods)
    styles = thinned(line_styles(methods, damping_ratios), thin)
    for method, style in zip(methods, styles, strict=True):
        orders = [order for order in measured if order.method == method]
        ratios = np.array([order.frequency_ratio for order in orders])
        lines += plot(
            upper, ratios, np.array([order.order("displacement") for order in orders]), style
        )
        plot(lower, ratios, np.array([order.displacement[-1] for order in orders]), style)
    upper.set_ylabel("observed order of displacement")
    upper.yaxis.set_major_locator(MaxNLocator(integer=True))
    bottom, top = upper.get_ylim()
    upper.set_ylim(min(bottom, 0.5), max(top, 4.5))
    lower.set(ylabel="relative error at the smallest time step", yscale="log", xscale="log")
    lower.set_xlabel("ω₀ / ω, frequency of the load over natural frequency")
    lower.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    plain_numbers(lower.xaxis)
    lower.xaxis.set_minor_formatter(NullFormatter())
    add_legend(figure, upper, lines, methods, NARROW)
    return figure


def _draw_order_chart(measured: Sequence[ObservedOrder]) -> Figure:
    """Plot the observed orders of accuracy as markers, in a row for each method.

    Markers show the orders of displacement, velocity, acceleration and algorithmic acceleration. A
    row without order (the errors are rounding errors) has a text instead.
    """
    figure = Figure(figsize=(7.5, 1.9 + 0.24 * len(measured)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(measured), 0.0, -1.0)
    marks = (
        ("displacement", "o", 8.0, "none"),
        ("velocity", "s", 4.0, COLORS[1]),
        ("acceleration", "x", 6.0, COLORS[0]),
        ("algorithmic_acceleration", "^", 6.0, "none"),
    )
    for quantity, marker, size, fill in marks:
        orders = [order.order(quantity) for order in measured]
        label = "algorithmic acceleration" if quantity == "algorithmic_acceleration" else quantity
        mark: dict[str, Any] = {
            "markersize": size,
            "markerfacecolor": fill,
            "markeredgecolor": COLORS[0],
        }
        axes.plot(orders, rows, marker, **mark, label=label)
    for order, row in zip(measured, rows, strict=True):
        if math.isnan(order.order("displacement")):
            axes.text(
                0.08, row, "errors are rounding errors", va="center", fontsize=8.0, color="0.35"
            )
    axes.set_yticks(rows, [order.method for order in measured], parse_math=False)
    axes.set(ylim=(0.3, len(measured) + 0.7), xlim=(0.0, 5.6), xlabel="observed order")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    labels = axes.get_legend_handles_labels()[1]
    columns = legend_columns(labels, 4)
    figure.set_figheight(figure.get_figheight() + 0.17 * (math.ceil(len(labels) / columns) - 1))
    figure.legend(loc="outside lower center", ncols=columns, handlelength=1.2)
    return figure
