"""Legends below the panels of figures, which fit the width of their figure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from matplotlib.backends.backend_agg import FigureCanvasAgg

from tdint.output.figures.style import INCH, LETTER
from tdint.output.printed import PRINTED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAX_ENTRIES = 24  # maximum number of entries of a legend


def legend_columns(labels: Sequence[str], most: int, width: float | None = None) -> int:
    """Return the number of columns of a legend below the panels.

    Parameters
    ----------
    width : float, optional
        Available width, inches; the printed width has precedence.
    """
    columns = max(1, min(len(labels), most))
    font_size = 8.0  # points
    if printed_width := PRINTED.get().width:
        width, font_size = printed_width / INCH, 7.0
    if labels and width:
        # The line in front of a label needs the space of about 11 characters.
        letters = width * 72.0 / (font_size * LETTER)
        columns = max(1, min(columns, int(letters / (max(map(len, labels)) + 11))))
    return columns


def add_legend(
    figure: Figure, axes: Any, lines: list[Any], labels: list[str], narrow: int = 24
) -> None:
    """Add a legend below the panels, and increase the height of the figure accordingly.

    A figure with a single line has no legend. If there are more than `_MAX_ENTRIES` lines, the last
    entry states the number of lines without an entry.

    Parameters
    ----------
    narrow : int
        Maximum number of characters of the labels for three columns; otherwise there are two. The
        available width can require fewer columns.
    """
    if len(lines) == 1:
        return
    if len(labels) > _MAX_ENTRIES:
        labels = [*labels[: _MAX_ENTRIES - 1], f"... and {len(labels) - _MAX_ENTRIES + 1} more"]
        lines = [*lines[: _MAX_ENTRIES - 1], axes.plot([], [], linestyle="none")[0]]
    columns = legend_columns(labels, 2 if max(map(len, labels)) > narrow else 3)
    labels = [" " + label for label in labels]  # matplotlib ignores labels that start with _
    legend = _legend_below(figure, lines, labels, columns)
    # A legend that is wider than the figure is cut off at both sides.
    unbroken, longest = labels, max(map(len, labels))
    while (excess := _extent(figure, legend)[0]) > 1.0 and max(columns - 1, longest - narrow) > 0:
        legend.remove()
        if columns == 1:
            longest = min(int(longest / excess), longest - 1)
            labels = [" " + "\n ".join(wrap(label.strip(), longest)) for label in unbroken]
        columns = max(columns - 1, 1)
        legend = _legend_below(figure, lines, labels, columns)
    # A row of the legend is 0.17 inches high, if its labels are not broken.
    is_broken = labels is not unbroken
    height = _extent(figure, legend)[1] if is_broken else 0.17 * math.ceil(len(labels) / columns)
    figure.set_figheight(figure.get_figheight() + height)


def _legend_below(figure: Figure, lines: list[Any], labels: list[str], columns: int) -> Any:
    """Add a legend below the panels of a figure and return it; labels are no formulas."""
    place = {"loc": "outside lower center", "ncols": columns, "handlelength": 3.6}
    legend = figure.legend(lines, labels, **place)
    for text in legend.get_texts():
        text.set_parse_math(False)
    return legend


def _extent(figure: Figure, legend: Any) -> tuple[float, float]:
    """Return the width of a legend divided by the width of its figure, and its height in inches;
    zeros for a printed width, because `legend_columns` then determines the number of columns."""
    if PRINTED.get().width:
        return 0.0, 0.0
    extent = legend.get_window_extent(FigureCanvasAgg(figure).get_renderer())
    return float(extent.width / figure.bbox.width), float(extent.height / figure.dpi)
