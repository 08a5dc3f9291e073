"""What the pictures of studies share: gray of single records, axes of intensity, names of intensity measures."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from tdint.campaign.suites.intensity import GEOMETRIC_MEAN, PAIRS
from tdint.output.figures.axes import minor_ticks, plain_numbers
from tdint.output.figures.style import COLORS
from tdint.units import ACCELERATION, STANDARD_GRAVITY

GRAY = "0.72"
"""Of what is one record among many."""

_PAIRS = {GEOMETRIC_MEAN: "geometric mean ", "rotd50": "RotD50 ", "rotd100": "RotD100 "}
_WORDS = {"sa": "Sa", "sa-avg": "Sa_avg", "pga": "PGA", "pgv": "PGV"}


def single_look(several: bool) -> dict[str, Any]:
    """How a line of a single record is drawn: light among several, plain alone."""
    return {"color": GRAY, "linewidth": 0.8} if several else {"color": COLORS[0], "linewidth": 1.6}


def measure_words(name: str) -> str:
    """An intensity measure as a paper writes it: Sa(1.095 s) of `sa(1.09504)`."""
    pair = next((pair for pair in PAIRS if name.startswith(f"{pair}-")), "")
    kind, _, rest = name.removeprefix(f"{pair}-").partition("(")
    period = rest.removesuffix(")")
    with suppress(ValueError):
        period = f"{float(period):.4g} s"
    return _PAIRS.get(pair, "") + _WORDS.get(kind, kind) + (f"({period})" if period else "")


def measure_label(name: str, unit: str) -> str:
    """An axis of intensity: its measure, and its unit as far as known."""
    text = measure_words(name) or "intensity measure"
    return f"{text} ({unit.replace('^2', '²')})" if unit else text


def add_gravity_axis(axes: Any, unit: str, *, horizontal: bool = False) -> None:
    """A second axis, in g, on the other side of one in another unit of acceleration; none beside other units."""
    if unit == "g" or unit not in ACCELERATION:
        return
    g = STANDARD_GRAVITY / ACCELERATION[unit]
    both = (lambda value: value / g, lambda value: value * g)
    second = (
        axes.secondary_xaxis("top", functions=both) if horizontal else axes.secondary_yaxis("right", functions=both)
    )
    axis = second.xaxis if horizontal else second.yaxis
    plain_numbers(axis)
    if (axes.get_xscale() if horizontal else axes.get_yscale()) == "log":
        minor_ticks(axis)
    axis.set_label_text("(g)")
