"""Axes as several figures have them: plain numbers, also on logarithmic scales, and a height's percents on top."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.ticker import FuncFormatter, LogLocator


def plain_numbers(axis: Any) -> None:
    """Numbers as they are read aloud: 0.2, not a power of ten."""
    axis.set_major_formatter(FuncFormatter(_plain))


def plain_minor_numbers(axis: Any, *, every: bool = False) -> None:
    """The same between the powers of ten: at 2 and 5, or at all ticks."""
    axis.set_minor_formatter(FuncFormatter(lambda value, at: _plain(value, at) if every or _leads(value, "25") else ""))


def plain_logarithmic(axes: Any) -> None:
    """Both axes logarithmic with plain numbers, ticks at each digit."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        plain_numbers(axis)
        minor_ticks(axis)


def minor_ticks(axis: Any) -> None:
    """Ticks of a logarithmic axis at each digit, numbers at 2 and 5."""
    axis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=50))
    plain_minor_numbers(axis)


def _plain(value: float, _: Any) -> str:
    return f"{value:g}"


def _leads(value: float, digits: str) -> bool:
    """Whether the first digit of a positive number is one of `digits`."""
    return value > 0.0 and f"{value / 10.0 ** math.floor(math.log10(value) + 1e-9):.0f}" in digits


def add_ratio_axis(axes: Any, height: float, label: str) -> None:
    """On top of an axis of displacements their ratios to a height (of the same unit), in percent; none without one."""
    if math.isnan(height):
        return
    percent = axes.secondary_xaxis(
        "top", functions=(lambda length: 100.0 * length / height, lambda ratio: 0.01 * ratio * height)
    )
    percent.set_xlabel(label)
