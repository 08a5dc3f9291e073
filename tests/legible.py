"""Checks of every figure that a test creates: page size, font sizes and labels of panels."""

from html import escape
from typing import Any, BinaryIO

from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator


def check(figure: Figure) -> None:
    """Raise AssertionError if a figure does not fit a page, or if font sizes or labels of axes are
    unsuitable."""
    width, height = figure.get_size_inches()
    panels = [
        axes
        for axes in figure.axes
        if axes.get_visible() and axes.axison and axes.get_subplotspec()
    ]
    columns = max((column_span.stop for *_, column_span in map(_place, panels)), default=1)
    assert width <= max(11.0, 5.0 * columns), "the figure is wider than a page in landscape format"
    # Panels with names on the horizontal axis are tables, which may be wider.
    lines = [axes for axes in panels if not _has_names(axes.xaxis)]
    assert all(axes.get_position().width * width <= 6.3 for axes in lines), (
        "a panel is wider than 6.3 inches, which makes lines hard to follow"
    )
    # A4 has a height of 11.69 inches; 10.5 inches leave margins of 15 mm.
    # The figures of reports are 6.8 inches wide.
    fits_a_page = 0.2 * width <= height <= 10.5 / 6.8 * width and height <= 10.5
    assert fits_a_page, f"{width:.2f} by {height:.2f} inches do not fit a page"
    sizes = [
        text.get_fontsize()
        for text in texts(figure)
        if text.get_visible() and text.get_text().strip()
    ]
    sizes += [size for axes in panels for size in _sizes_of_tick_labels(axes)]
    assert min(sizes) >= 6.0 and max(sizes) <= 11.0, (
        "the font sizes are not between 6 and 11 points"
    )
    # The lowest panel of each column must have a label of the horizontal axis, and the first panel
    # of each row a label of the vertical axis.
    for axes in panels:
        grid, rows, columns_of_panel = _place(axes)
        others = [(below, beside) for same, below, beside in map(_place, panels) if same is grid]
        if not any(
            below.start >= rows.stop and set(columns_of_panel) & set(beside)
            for below, beside in others
        ):
            assert axes.get_xlabel() or _has_names(axes.xaxis), "the horizontal axis has no label"
        if not any(
            beside.stop <= columns_of_panel.start and set(rows) & set(below)
            for below, beside in others
        ):
            assert axes.get_ylabel() or axes.get_title() or _has_names(axes.yaxis), (
                "the vertical axis has no label"
            )


BEGINNINGS = {"png": b"\x89PNG\r", "pdf": b"%PDF", "svg": b"<?xml"}
"""First bytes of figure files by format."""


def write_texts(figure: Figure, stream: BinaryIO, *, format: str, **_: object) -> None:
    """Write only the signature of a format and the texts of a figure, in place of
    `Figure.savefig`."""
    check(figure)
    escaped = [escape(text.get_text(), quote=False) for text in texts(figure) if text.get_visible()]
    stream.write(
        BEGINNINGS[format] + "".join(f"<text>{word}</text>\n" for word in escaped).encode()
    )


def children_without_ticks(axis: Axis) -> list[Artist]:
    """Return the parts of an axis in place of `Axis.get_children`, without creating ticks: ticks
    that do not exist yet show only numbers of their locator."""
    kinds = ("majorTicks", "minorTicks")
    existing = [tick for kind in kinds for tick in vars(axis).get(kind, ())]
    return [axis.label, axis.offsetText, *existing]


def texts(figure: Figure) -> list[Text]:
    """Return all texts of a figure except tick labels.

    `Figure.findobj` would also return tick labels, but it creates the ticks of all axes. This is
    slow compared with a figure that is not rendered.
    """
    panels = [panel for axes in figure.axes for panel in (axes, *axes.child_axes)]
    result = [*figure.texts]
    for panel in panels:
        result += [panel.xaxis.label, panel.yaxis.label]
        result += [child for child in panel.get_children() if isinstance(child, Text)]
    for legend in [*figure.legends, *filter(None, (panel.get_legend() for panel in panels))]:
        result += [*legend.get_texts(), legend.get_title()]
    return result


def _sizes_of_tick_labels(axes: Any) -> list[float]:
    """Return the font sizes (points) of the tick labels of an axes, without creating ticks."""
    sizes = []
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_visible():
            default = rcParams[f"{axis.axis_name}tick.labelsize"]
            size = axis.get_tick_params().get("labelsize", default)
            sizes.append(FontProperties(size=size).get_size_in_points())
    return sizes


def _place(axes: Any) -> tuple[Any, range, range]:
    """Return the grid, the rows and the columns of a panel."""
    position = axes.get_subplotspec()
    return position.get_gridspec(), position.rowspan, position.colspan


def _has_names(axis: Any) -> bool:
    """Return True if the tick labels of an axis are names at fixed positions."""
    return isinstance(axis.get_major_locator(), FixedLocator)
