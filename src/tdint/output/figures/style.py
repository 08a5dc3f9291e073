"""Style shared by all figures: readable in black and white, as PNG, PDF or SVG.

They use its classes instead of pyplot, so that no window system is needed and figures do not share
a state.
"""

from __future__ import annotations

import io
import itertools
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten, wrap
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tdint.errors import OutputError, UsageError, write_out_controls
from tdint.items import grouped

if TYPE_CHECKING:
    from tdint.ground_motion.reading.suites import GroundMotion

try:
    import matplotlib as mpl
except ValueError as error:  # the variable of a notebook, whose backend is not installed here
    raise UsageError(
        f"matplotlib cannot be loaded: {error}; correct or unset the environment variable "
        "MPLBACKEND"
    ) from None
from matplotlib.axis import Tick
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from tdint.arrays import Array
from tdint.ground_motion.record import Record
from tdint.number_parsing import number_text, pluralize
from tdint.output.printed import ON_SCREEN, PRINTED, PrintedAs, in_print
from tdint.units import OutputUnits

mpl.rcdefaults()

_TITLE = 10.5  # font size of titles, points

_STYLE, _PRINT = (
    mpl.rc_params_from_file(Path(__file__).with_name(name), use_default_template=False)
    for name in ("screen.mplstyle", "print.mplstyle")
)
"""Settings of all figures, and additional settings of figures with a printed width."""

_LAID_OUT_HERE = {"figure.autolayout": False, "figure.constrained_layout.use": False}
"""Settings while a figure is saved: its layout is already complete, and no style sheet may change
it."""

_MIN_FONT_SIZE, _MAX_FONT_SIZE = 6.0, 8.0  # points; the range that journals require in print
INCH = 0.0254  # m
MAX_HEIGHT = 10.5  # inches; A4 with margins of 15 mm
_PRINT_DPI, _SCREEN_DPI = 600, 160  # with and without a printed width
_NOTEBOOK_DPI = 100  # the default of matplotlib
INK = "#1f4e79"
LIGHT = "0.55"
MARK = "#b03a2e"
"""Colors of a single line, of secondary lines, and of highlighted parts."""
Style = dict[str, Any]
"""Settings of lines, markers or texts: keyword arguments of matplotlib."""
ZERO: Style = {"color": LIGHT, "linewidth": 0.6}
"""Style of the lines through zero."""

COLORS = ("#1f4e79", "#d1782c", "#8e2f6d", "#4a9a62", "#4d4d4d", "#2aa1b3")
"""Dark and light in turn: neighbors differ by at least 20 L* (CIELAB) in gray. As dashes repeat
after five lines, the lines with equal dashes differ in lightness."""
DASHES: tuple[Any, ...] = (
    "-",
    (0, (6, 2)),
    (0, (2, 1.5)),
    (0, (7, 2, 1.5, 2)),
    (0, (4, 1.5, 1, 1.5, 1, 1.5)),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "x")
METHOD_COLORS = (
    *("#1f4e79", "#d1782c", "#000000", "#26664d", "#d90059", "#9980ff"),
    *("#59261a", "#7373a6", "#0000f2", "#660040", "#8c400d", "#7d7d7d"),
)
"""Color differences are at least 13.7 (CIEDE2000) for readers with red-green color blindness, and
the contrast with white is at least 3.05."""
_METHOD_MARKERS = ("o", "s", "^", "D", "v", "P", "x", "*", "<", ">", "h")
_METHODS = (
    *(
        "impulse4",
        "moment4",
        "newmark-average",
        "gauss4",
        "newmark-linear",
        "central-difference",
        "hht",
    ),
    *("generalized-alpha", "wilson", "bathe", "impulse", "exact"),
    *(f"openseespy/{name}" for name in ("newmark-average", "hht", "generalized-alpha")),
    *(f"scipy/{name}" for name in ("RK45", "Radau", "LSODA")),
    *("moment4 by tolerance", "impulse4 by tolerance"),
)
"""Methods that are often plotted together, in the order of their colors and markers. Each method of
tdint in this list has a separate color."""
_HIGHLIGHT_RATIO = 1.8  # width of the highlighted line divided by the width of the other lines
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": "tdint"},
    "pdf": {"Creator": "tdint", "CreationDate": None},
    "svg": {"Creator": "tdint", "Date": None},
}
"""Metadata of each file format. They contain no date, so that equal figures are equal files."""

_MAX_PLAIN_NUMBER = 1e5
"""Value above which the label of an axis in units other than N and J contains a power of ten."""

_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_LABEL_SIZE = 6.5  # points
LETTER = 0.6  # estimated width of a character divided by the font size
_MARKER = 3.5  # half the size of a marker, points
_LABEL_POSITIONS = (
    (8, 0, "left", "center"),
    (0, 7, "center", "bottom"),
    (0, -7, "center", "top"),
    (-8, 0, "right", "center"),
)
"""Offset of a label from its point, points, with its horizontal and vertical alignment; in the
order where the positions are tried."""
_ALIGNMENT = {"left": 0.0, "center": 0.5, "right": 1.0, "bottom": 0.0, "top": 1.0}
"""Fraction of the width or height of a text to the left of or below its position."""
Box = tuple[float, float, float, float]


def line_style(number: int, dash: int | None = None) -> Style:
    """Return color and dashes of a line as keyword arguments of matplotlib.

    Parameters
    ----------
    number : int
        Number of the color, from 0. After the last color, the colors start again with the first.
    dash : int, optional
        Number of the dashes; equal to `number` by default, so that lines are distinguishable
        without color.
    """
    dash = number if dash is None else dash
    return {"color": COLORS[number % len(COLORS)], "linestyle": DASHES[dash % len(DASHES)]}


def method_styles(methods: Iterable[str], highlight: str = "") -> dict[str, Style]:
    """Return color, dashes and marker of each method, which are the same in all figures.

    Methods of the catalogue and of other programs have fixed styles. Plug-ins and methods with
    parameters use the remaining styles in their order. The method to highlight, or all plug-ins
    without a method to highlight, have a wider line in front of the remaining lines.

    Parameters
    ----------
    highlight : str
        Method to highlight; empty by default.

    Returns
    -------
    dict
        For each method, keyword arguments of matplotlib for its line.
    """
    from tdint.methods.catalogue import catalogue, is_ours

    lines = dict.fromkeys(methods)
    fixed = list(dict.fromkeys((*_METHODS, *catalogue())))
    others = [line for line in lines if line not in fixed]
    plugins = [line for line in lines if line in catalogue() and not is_ours(line)]
    highlighted = [highlight] if highlight else plugins
    plot_styles: dict[str, Style] = {}
    for number, method in enumerate((*fixed, *others)):
        # With twelve colors and eleven markers, the first 132 combinations differ.
        plot_styles[method] = {
            "color": METHOD_COLORS[number % len(METHOD_COLORS)],
            "linestyle": DASHES[number % len(DASHES)],
            "marker": _METHOD_MARKERS[number % len(_METHOD_MARKERS)],
        }
        if method in highlighted:
            plot_styles[method] |= {
                "linewidth": _HIGHLIGHT_RATIO * mpl.rcParams["lines.linewidth"],
                "zorder": 4,
            }
    return plot_styles


def picture_format(suffix: str) -> str:
    """Return the format of a figure, `png`, `pdf` or `svg`, for a file suffix such as `.png`.

    Raises
    ------
    OutputError
        The suffix is not one of the three.
    """
    file_format = suffix.lower().lstrip(".")
    if file_format not in _METADATA:
        raise OutputError(
            f"a figure must be written as .png, .pdf or .svg, got {suffix or 'no suffix'}"
        )
    return file_format


def picture(suffix: str, draw: Callable[[], Figure]) -> Picture:
    """Return an object that creates a figure and writes it to a binary stream.

    The print settings of the command are checked now, before the figure is plotted.

    Parameters
    ----------
    suffix : str
        .png, .pdf or .svg.
    draw : callable
        Function without arguments that returns the figure. It is called when the figure is written.

    Raises
    ------
    OutputError
        The suffix is unknown.
    """
    return Picture(picture_format(suffix), draw)


class ShownFigure(Figure):
    """Figure that is shown as the result of a notebook cell, without pyplot."""

    printed: PrintedAs

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG; notebooks call this method."""
        stream = io.BytesIO()
        _save(self, stream, self.printed, _NOTEBOOK_DPI, format="png")
        return stream.getvalue()


_FORMULA = r"\$\\(?:theta|beta(?:_\{\w+\})?|pm\\sigma)\$"
"""Formulas in the texts of figures. Any other dollar sign is part of a name."""


_MINUS = r"(?<![^\s(=])-(?=\d)"
"""Hyphen of a negative number."""


def _show_names_as_written(figure: Figure) -> None:
    """Write minus signs, show the names of links, elements, files, ... in a figure as text, not as
    formulas, and write out their control characters, which a browser obeys in SVG."""
    labels = {label for tick in figure.findobj(Tick) for label in (tick.label1, tick.label2)}
    for text in figure.findobj(Text):
        content = text.get_text()
        if "$" in re.sub(_FORMULA, "", content) and text not in labels:
            text.set_parse_math(False)
        text.set_text(write_out_controls(re.sub(_MINUS, "\N{MINUS SIGN}", content), keep="\n"))


def _save(figure: Figure, stream: BinaryIO, printed: PrintedAs, dpi: int, **saved: Any) -> None:
    """Write a figure to a stream with a resolution, pixels per inch; `saved` are the format and the
    metadata of the file."""
    # Only for PNG, the layout can be computed before the file is written: in vector formats, the
    # viewer determines the widths of characters, which differ from widths in pixels.
    layout_context = _fixed_layout(figure, dpi) if saved["format"] == "png" else nullcontext()
    _show_names_as_written(figure)
    with (
        mpl.rc_context(_settings(printed) | _LAID_OUT_HERE),
        _missing_glyphs_ignored(),
        _panels_must_fit(printed.width),
        layout_context,
    ):
        figure.savefig(stream, dpi=dpi, **saved)


@dataclass(frozen=True)
class Picture:
    """Figure that is created when it is requested or when it is written to a binary stream.

    Attributes
    ----------
    format : str
        File format: png, pdf or svg.
    """

    format: str
    draw: Callable[[], Figure]

    def figure(self) -> Figure:
        """Create the figure with the print settings of the command, and return it.

        Notebooks show the returned figure as the result of a cell; pyplot does not manage it.
        """
        printed = PRINTED.get()
        with mpl.rc_context(_settings(printed)), _missing_glyphs_ignored():
            figure = self.draw()
            # A canvas is required for the sizes of texts; creating it attaches it to the figure.
            FigureCanvasAgg(figure)
            # The drawing functions create plain figures. `ShownFigure` adds their display in
            # notebooks.
            figure.__class__ = ShownFigure
            assert isinstance(figure, ShownFigure)
            figure.printed = printed
            with _panels_must_fit(printed.width):
                add_legends(figure)
                _show_names_as_written(figure)
                if printed != ON_SCREEN:
                    _apply_print_settings(figure, printed)
                _place_legends(figure, _MAX_PAGE / INCH if printed.width else MAX_HEIGHT)
                if printed.width:
                    _grow(figure)
                _hide_point_labels(figure)
        return figure

    def __call__(self, stream: BinaryIO) -> None:
        """Create the figure and write it to a stream."""
        self.save(self.figure(), stream)

    def save(self, figure: Figure, stream: BinaryIO) -> None:
        """Write a figure that the method `figure` has returned to a stream, in the file format."""
        printed = PRINTED.get()
        dpi = _PRINT_DPI if printed.width else _SCREEN_DPI
        metadata = _METADATA[self.format]
        _save(figure, stream, printed, dpi, format=self.format, metadata=metadata)


@contextmanager
def _fixed_layout(figure: Figure, dpi: float) -> Iterator[None]:
    """Compute the layout of a figure for a resolution (pixels per inch), and keep this layout
    during the `with` statement. With an active layout engine, matplotlib would draw all parts twice
    to save the figure.
    """
    engine, before = figure.get_layout_engine(), figure.dpi
    figure.dpi = dpi
    try:
        # Ticks depend on the size of the panels, which depends on the labels of the ticks.
        if engine:
            for _ in range(2):
                engine.execute(figure)
        figure.set_layout_engine(None)
        yield
    finally:
        figure.set_layout_engine(engine)
        figure.dpi = before


@contextmanager
def _missing_glyphs_ignored() -> Iterator[None]:
    """Suppress warnings about glyphs that the font does not contain; matplotlib draws a box."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


@contextmanager
def _panels_must_fit(width: float | None) -> Iterator[None]:
    """Convert the warning of matplotlib that panels do not fit into the figure to UsageError.

    `width` is the requested width of the figure, m, for the message.
    """
    warnings.filterwarnings("error", message="constrained_layout not applied")
    try:
        yield
    except UserWarning:
        requested = f"{1e3 * (width or 0.0):.0f} mm"
        raise UsageError(
            f"the panels of this figure do not fit into a width of {requested}; specify a larger "
            "width"
        ) from None


def _settings(printed: PrintedAs) -> dict[str, Any]:
    """Return the matplotlib parameters (rcParams) for the print settings of a figure."""
    return _STYLE | (_PRINT if printed.width else {})


def style_context() -> AbstractContextManager[None]:
    """Return a context manager that sets the line settings of tdint, to plot on axes of the user.

    The figure of the user determines all other settings, such as font sizes and grids.
    """
    return mpl.rc_context(
        {name: _STYLE[name] for name in ("lines.linewidth", "legend.frameon", "agg.path.chunksize")}
    )


def _apply_print_settings(figure: Figure, printed: PrintedAs) -> None:
    """Set the symbols and the font sizes of a figure for print, and omit its title if requested."""
    if not printed.title:
        figure.suptitle("")
    # ASCII words are replaced by symbols. Tick labels exist only after the figure has been plotted.
    # They do not depend on the layout, which would need time.
    engine = figure.get_layout_engine()
    figure.set_layout_engine("none")
    figure.draw_without_rendering()
    figure.set_layout_engine(engine)
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        tick_labels = [text.get_text() for text in axis.get_ticklabels()]
        if isinstance(axis.get_major_locator(), FixedLocator) and any(tick_labels):
            # Matplotlib restores fixed tick labels every time it plots the figure, so that they
            # must be replaced in the axis.
            axis.set_ticklabels(list(map(in_print, tick_labels)))
    for text in figure.findobj(Text):
        text.set_text(in_print(text.get_text()))
        if printed.width:
            text.set_fontsize(min(max(text.get_fontsize(), _MIN_FONT_SIZE), _MAX_FONT_SIZE))
    if printed.width:
        _fit(figure)


def add_legends(figure: Figure) -> None:
    """Add a legend to each panel with labels that no legend of the figure contains."""
    common = {text.get_text().strip() for legend in figure.legends for text in legend.get_texts()}
    for axes in figure.axes:
        labels = axes.get_legend_handles_labels()[1]
        if not common.issuperset(labels):
            # The layout of the panels does not depend on a legend that will be moved.
            (axes.get_legend() or axes.legend()).set_in_layout(False)


def _place_legends(figure: Figure, max_height: float) -> None:
    """Arrange the legends below the panels in as many columns as fit, and move each legend that
    covers a curve, an area, a point or a text, or is wider than its panel, above its panel and its
    texts. The figure grows by their heights, up to `max_height`, inches."""
    for legend in figure.legends:
        place = {"loc": "outside lower center", "handlelength": 3.2}
        _rearrange(figure, legend, figure, figure.bbox.width, max_height, place)
    figure.draw_without_rendering()
    panels: list[Any] = [*figure.axes]
    for axes in panels:
        legend, frame = axes.get_legend(), axes.get_window_extent()
        if not legend:
            continue
        box = legend.get_window_extent()
        if box.width > frame.width or box.height > frame.height or _covers(box, axes):
            space = axes.get_tightbbox(call_axes_locator=False)
            corner = axes.transAxes.inverted().transform((space.x0, space.y1))
            place = {"loc": "lower left", "bbox_to_anchor": corner, "borderaxespad": 0.2}
            _rearrange(axes, legend, figure, space.width, max_height, place | {"handlelength": 2.0})
            figure.draw_without_rendering()


def _covers(box: Any, axes: Any) -> bool:
    """Return True if a box, pixels, covers a curve, an area, a point or a text of a panel."""
    for artist in (*axes.lines, *axes.patches):
        path = artist.get_path().transformed(artist.get_transform())
        if path.intersects_bbox(box, filled=False):
            return True
    for area in axes.collections:
        points = area.get_offset_transform().transform(area.get_offsets())
        paths = [path.transformed(area.get_transform()) for path in area.get_paths()]
        if len(points) < 2 and any(path.intersects_bbox(box) for path in paths):
            return True
        if any(box.contains(*point) for point in points):
            return True
    return any(box.overlaps(text.get_window_extent()) for text in axes.texts if text.get_visible())


def _rearrange(
    owner: Any, legend: Any, figure: Figure, width: float, max_height: float, place: dict[str, Any]
) -> None:
    """Replace a legend of a panel or figure by a legend with columns within `width`, pixels."""
    texts, handles, title = legend.get_texts(), legend.legend_handles, legend.get_title()
    size = texts[0].get_fontsize()
    handle = (place["handlelength"] + 2.0) * size * figure.dpi / 72.0  # with the distances
    for text, length in (*((text, width - handle) for text in texts), (title, 0.95 * width)):
        _wrap(text, length)
    entry = max(text.get_window_extent().width for text in texts) + handle
    columns = min(max(int(width // entry), 1), len(texts))
    legend.remove()
    labels = [text.get_text() for text in texts]
    place = place | {"ncols": columns, "columnspacing": 1.0, "fontsize": size}
    place |= {"handleheight": legend.handleheight, "title": title.get_text() or None}
    legend = owner.legend(handles, labels, title_fontsize=title.get_fontsize(), **place)
    legend.get_title().set_multialignment("center")
    for old, new in zip((title, *texts), (legend.get_title(), *legend.get_texts()), strict=True):
        new.set_parse_math(old.get_parse_math())
    added = legend.get_window_extent().height / figure.dpi
    height = figure.get_figheight()
    figure.set_figheight(max(height, min(height + added, max_height)))


_MAX_ENTRIES = 24  # maximum number of entries of a legend


def add_legend(
    figure: Figure,
    lines: Sequence[Any],
    labels: Sequence[str],
    least: int = 2,
    *,
    title: str = "",
    handleheight: float | None = None,
) -> None:
    """Add a legend of `least` or more lines below the panels, with a text above them. If there are
    more than `_MAX_ENTRIES` lines, the last entry states the number of lines without an entry."""
    if len(lines) < least:
        return
    if len(labels) > _MAX_ENTRIES:
        labels = [*labels[: _MAX_ENTRIES - 1], f"... and {len(labels) - _MAX_ENTRIES + 1} more"]
        lines = [*lines[: _MAX_ENTRIES - 1], Line2D([], [], linestyle="none")]
    # Matplotlib ignores labels that start with _. `_place_legends` determines the columns.
    names = [f" {label}" if label.startswith("_") else label for label in labels]
    place = {"loc": "outside lower center", "handleheight": handleheight}
    legend = figure.legend(lines, names, title=title or None, title_fontsize=7.5, **place)
    for text in legend.get_texts():
        text.set_parse_math(False)


_MAX_THINNINGS = 3
"""Maximum number of times that the ticks of an axis are halved: a single tick of eight remains."""


def _fit(figure: Figure) -> None:
    """Fit the texts of a narrow figure into the available space.

    Labels and titles are wrapped, and axes get fewer ticks, until tick labels do not overlap. The
    height of the figure is increased if the panels do not fit.
    """
    FigureCanvasAgg(figure)
    for axes in figure.axes:
        _wrap_texts(figure, axes)
    for text in figure.texts:
        _wrap(text, figure.bbox.width)
    panels = [panel for axes in figure.axes for panel in (axes, *axes.child_axes)]
    every_axis = [axis for panel in panels for axis in (panel.xaxis, panel.yaxis)]
    # Axes with fixed ticks show names, which must all remain.
    number_axes = [
        axis for axis in every_axis if not isinstance(axis.get_major_locator(), FixedLocator)
    ]
    for _ in range(_MAX_THINNINGS):
        _grow(figure)
        changed = [_thin(axis) for axis in number_axes]
        # `_grow` has performed the layout, which reduces the panels by the space of all other
        # parts. Labels are therefore wrapped to the actual size of their panel. A label may be
        # slightly longer than the panel, because tick labels extend over the panel also.
        changed += [_wrap(panel.xaxis.label, 1.2 * panel.bbox.width) for panel in panels]
        changed += [_wrap(panel.yaxis.label, 1.1 * panel.bbox.height) for panel in panels]
        if not any(changed):
            break


def _wrap_texts(figure: Figure, axes: Any) -> None:
    """Wrap the title, the axis labels and the texts of a panel to its size."""
    # Before the layout is computed, the space of a panel with its labels follows from its position
    # in the grid of panels.
    grid_position = axes.get_subplotspec()
    panel_box = grid_position.get_position(figure) if grid_position else axes.get_position()
    width = _TEXT_FRACTION * (figure.bbox.width * panel_box.width)
    height = _TEXT_FRACTION * (figure.bbox.height * panel_box.height)
    # A panel can have titles at the left, in the center and at the right.
    titles = [
        child
        for child in axes.get_children()
        if isinstance(child, Text) and child not in axes.texts and child.get_text()
    ]
    for title in titles:
        _wrap(title, width / len(titles))
    for panel in (axes, *axes.child_axes):
        _wrap(panel.xaxis.label, width)
        _wrap(panel.yaxis.label, height)
    for text in axes.texts:
        _wrap(text, width)


def _hide_point_labels(figure: Figure) -> None:
    """Hide the labels of points that are not inside of the panel or cover a previous label in the
    final layout."""
    labels: list[Any] = figure.findobj(lambda artist: artist.get_gid() == _POINT_LABEL)
    if labels:
        figure.draw_without_rendering()
    visible_boxes: list[Any] = []
    for text in labels:
        box, frame = text.get_window_extent(), text.axes.get_window_extent()
        is_inside = (
            frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1
        )
        is_visible = bool(is_inside) and not any(box.overlaps(other) for other in visible_boxes)
        text.set_visible(is_visible)
        if is_visible:
            visible_boxes.append(box)


_POINT_LABEL = "point"
"""Identifier of point labels, which are omitted if there is no space."""

_MIN_PANEL, _MAX_PAGE = 0.022, 0.24  # m; minimum height of a panel, maximum height of a figure
_GROWTHS = 8  # maximum number of changes of the height of a figure


def _grow(figure: Figure) -> None:
    """Increase the height of a figure, up to a page, and the heights of rows with low panels, until
    all panels fit and are high enough; UserWarning if they never fit. Higher figures are reduced.

    Matplotlib warns if the panels do not fit. The caller has set the filter for the warning to
    "error", so that Matplotlib raises an exception instead.
    """
    least, largest = _MIN_PANEL / INCH, _MAX_PAGE / INCH  # inches
    figure.set_figheight(min(figure.get_figheight(), largest))
    panels: list[Any] = figure.axes
    outer = panels[0].get_subplotspec().get_topmost_subplotspec().get_gridspec()
    for attempt in range(_GROWTHS):
        heights = np.array(outer.get_height_ratios(), float)
        heights *= figure.get_figheight() / heights.sum()
        # The missing height of each row of each grid, and of the rows of the figure
        lacks: dict[Any, tuple[int, Array]] = {outer: (0, np.zeros(outer.nrows))}
        added = lacks[outer][1]
        try:
            figure.draw_without_rendering()
            for axes in panels:
                place = axes.get_subplotspec()
                cell, line = place.get_topmost_subplotspec().rowspan.start, place.rowspan.start
                grid = place.get_gridspec()
                lack = lacks.setdefault(grid, (cell, np.zeros(grid.nrows)))[1]
                lack[line] = max(lack[line], least - axes.bbox.height / figure.dpi)
        except UserWarning:
            if attempt == _GROWTHS - 1:
                raise
            # Texts need most of the space of low rows.
            added += 0.45 * heights.mean() - 0.3 * heights
        for grid, (cell, lack) in list(lacks.items())[1:]:
            ratios = np.array(grid.get_height_ratios(), float)
            grid.set_height_ratios(ratios * heights[cell] / ratios.sum() + lack)
            added[cell] += lack.sum()
        if np.all(added < 0.01):
            return
        outer.set_height_ratios(heights + added)
        figure.set_figheight(min(float((heights + added).sum()), largest))
    figure.draw_without_rendering()


_TEXT_FRACTION = 0.8
"""Fraction of the space of a panel for its title and labels; the rest is for tick labels."""


def _wrap(text: Text, max_length: float) -> bool:
    """Wrap the lines of a text of a figure that are longer than `max_length`, in pixels.

    Lines keep at least eight characters. Return True if the text has changed.
    """
    # The text may be vertical, so its length is the larger dimension of its box.
    box = text.get_window_extent()
    length = max(box.width, box.height)
    lines = text.get_text().splitlines()
    if lines and length > max_length:
        max_letters = max(8, int(max(map(len, lines)) * max_length / length))
        wrapped: list[str] = []
        for line in lines:
            wrapped += wrap(line, max_letters, break_long_words=False)
        text.set_text("\n".join(wrapped))
    return text.get_text().splitlines() != lines


def _thin(axis: Any) -> bool:
    """Remove half of the ticks of an axis if tick labels overlap; return True if they did."""
    boxes = [
        label.get_window_extent()
        for tick in axis._update_ticks()
        for label in (tick.label1, tick.label2)
        if label.get_visible() and label.get_text()
    ]
    # A span is the start and the end of a label along the axis, pixels. Labels are distinguishable
    # if their distance is at least a pixel.
    spans = [(box.x0, box.x1) if axis.axis_name == "x" else (box.y0, box.y1) for box in boxes]
    spans.sort()
    if all(end + 1.0 <= start for (_, end), (start, _) in itertools.pairwise(spans)):
        return False
    # Labels of minor ticks are less important, so that they are omitted first.
    if any(label.get_text() for label in axis.get_minorticklabels()):
        axis.set_minor_formatter(NullFormatter())
    else:
        axis.set_major_locator(FixedLocator(axis.get_majorticklocs()[::2]))
    return True


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure whose panels do not overlap, with a size on a screen, inches.

    A printed figure has its final width from the start. Texts need more height in a narrower
    figure, so that the height is reduced less.
    """
    if printed := PRINTED.get().width:
        height *= math.sqrt(printed / INCH / width)
        width = printed / INCH
    return Figure(figsize=(width, height), layout="constrained")


def new_axes(width: float, height: float) -> tuple[Figure, Any]:
    """Return a figure (`new_figure`) and its only panel."""
    figure = new_figure(width, height)
    return figure, figure.subplots()


_MIN_WIDTH = 0.045  # m; minimum width of a panel with its labels


def new_panels(
    width: float, *rows: tuple[float, Sequence[int]], share: str = "", columns: int = 4
) -> tuple[Figure, list[list[Any]]]:
    """Return a figure (`new_figure`) and its panels, a list for each row.

    A row with more panels than fit next to each other, or than `columns`, continues below with
    panels of equal widths.

    Parameters
    ----------
    rows : tuples of float and sequence of int
        Height on a screen, inches, and relative widths of the panels of each row.
    share : str
        Axes in common: `x` of all panels, `y` of the panels of a row; empty by default for none.
    """
    figure = new_figure(width, sum(height for height, _ in rows))
    most = max(min(columns, int(figure.get_figwidth() * INCH / _MIN_WIDTH)), 1)
    # Each line of panels has the number of its row, its height and the widths of its panels.
    lines: list[tuple[int, float, Any]] = []
    for number, (height, widths) in enumerate(rows):
        count = math.ceil(len(widths) / most)
        equal = np.ones_like(widths) if count > 1 else np.array(widths)
        lines += [(number, height, part) for part in np.array_split(equal, count)[::-1]]
    ratio = sum(height for _, height, _ in lines) / sum(height for height, _ in rows)
    figure.set_figheight(min(ratio * figure.get_figheight(), MAX_HEIGHT))
    # Lines with panels of equal widths have a common grid, which aligns their panels.
    blocks = [list(block) for _, block in itertools.groupby(lines, lambda line: tuple(line[2]))]
    outer: Any = figure.add_gridspec(
        len(blocks), 1, height_ratios=[sum(height for _, height, _ in block) for block in blocks]
    )
    panels: list[list[Any]] = [[] for _ in rows]
    for cell, block in zip(outer, blocks, strict=True):
        widths, heights = block[0][2], [height for _, height, _ in block]
        grid = cell.subgridspec(len(block), len(widths), width_ratios=widths, height_ratios=heights)
        for line, (number, _, _) in enumerate(block):
            for column in range(len(widths)):
                axes = figure.add_subplot(
                    grid[line, column],
                    sharex=figure.axes[0] if "x" in share and figure.axes else None,
                    sharey=panels[number][0] if "y" in share and panels[number] else None,
                )
                if "x" in share and len(blocks) == 1:
                    axes.tick_params(labelbottom=line == len(block) - 1)
                if "y" in share:
                    axes.tick_params(labelleft=column == 0)
                panels[number].append(axes)
    return figure, panels


def titled(figure: Figure, title: str) -> Figure:
    """Add a title above the panels and return the figure.

    The title has one or more lines and no formulas. A line that is wider than the figure is
    wrapped; a line of more than three times the width is shortened.
    """
    # The number of characters is the width of the figure in points (72 per inch) divided by the
    # width of a character.
    size = _MAX_FONT_SIZE if PRINTED.get().width else _TITLE
    max_letters = int(figure.get_size_inches()[0] * 72.0 / (size * LETTER))
    lines: list[str] = []
    for title_line in title.splitlines():
        line = shorten(title_line, 3 * max_letters, placeholder=" ...")
        # A line does not break between a symbol, its value and its unit.
        line = _QUANTITY.sub(lambda match: match[0].replace(" ", NO_BREAK_SPACE), line)
        # The smallest width with the minimum number of lines gives lines of similar length.
        least = len(wrap(line, max_letters, break_on_hyphens=False))
        width = max(len(line) // max(least, 1), 1)
        while len(parts := wrap(line, width, break_on_hyphens=False)) > least:
            width += 1
        lines += [part.replace(NO_BREAK_SPACE, " ") for part in parts]
    figure.suptitle("\n".join(lines), fontsize=size, parse_math=False)
    return figure


NO_BREAK_SPACE = "\u2060"
"""Placeholder of a space where `titled` does not break a line; `shorten` replaces U+00A0."""

_QUANTITY = re.compile(r"\w+ = [\d.]+(?: (?:g|s|m|%))?|[\d.]+ (?:g|s|m|%)(?![\w.])")


def lowered(draw: Callable[[], Figure], height: float = 2.4) -> Figure:
    """Create a figure for a report with a reduced height, inches."""
    figure = draw()
    figure.set_size_inches(7.0, height)
    return figure


def write_note(axes: Any, text: str) -> None:
    """Write a text at the right above a panel, where it covers no curve."""
    place: Style = {"va": "bottom", "ha": "right", "fontsize": 8.0, "color": MARK}
    axes.annotate(text, (1.0, 1.0), (0.0, 2.0), "axes fraction", "offset points", **place)


FirstPeriods = Sequence[tuple[str, float]]
"""Names of buildings and their first periods, s."""

_MAX_PERIODS = 3  # maximum number of separate lines for first periods; more periods have a band
_MAX_NAME = 28  # maximum length of the name of a building in a legend


def mark_first_periods(axes: Any, periods: FirstPeriods, color: str = MARK) -> None:
    """Mark the first periods of buildings in a panel over the period; the legend states them.

    Up to `_MAX_PERIODS` distinct periods are marked by lines, more periods by a band from the
    shortest to the longest period. The periods are in the legend, because a label at a line could
    cover other text.

    Parameters
    ----------
    periods : sequence of (str, float)
        Names and first periods, s. Periods outside of the axis are omitted.
    """
    low, high = axes.get_xlim()
    # Buildings have a common line if their periods are printed as the same number.
    groups = grouped(
        (number_text(period), (name, period)) for name, period in periods if low <= period <= high
    )
    if len(groups) > _MAX_PERIODS:
        values = [period for group in groups.values() for _, period in group]
        ends = f"{number_text(min(values))} to {number_text(max(values))} s"
        label = f"T1 of {pluralize(len(values), 'building')}: {ends}"
        axes.axvspan(min(values), max(values), color=color, alpha=0.12, zorder=0.5, label=label)
        return
    for number, (text, group) in enumerate(groups.items(), start=1):
        names = list(dict.fromkeys(name for name, _ in group))
        label = "T1"
        # The name of a single building is in the title of the figure.
        if len(periods) > 1 and names[0].strip():
            label += f" of {shorten(names[0], _MAX_NAME, placeholder=' ...')}"
        if len(names) > 1:
            label += f" and {len(names) - 1} more"
        plot_style = {"color": color, "linewidth": 0.8, "linestyle": DASHES[number % len(DASHES)]}
        axes.axvline(group[0][1], label=f"{label} = {text} s", **plot_style)


def scaled_unit(largest: float, si: str, units: OutputUnits) -> tuple[float, str]:
    """Return the factor from an SI unit to the unit of an axis with the maximum absolute value
    `largest` (SI), and its label, such as `kN` or `10³ kip`.

    N and J get the prefix M or k if the maximum value is then at least 1. An output unit that is
    not the SI unit gets a power of ten if the maximum value is at least `_MAX_PLAIN_NUMBER`.
    """
    if units.unit(si)[0] != si:
        factor, label = 1.0 / units.unit(si)[1], units.label(si)
        if largest * factor < _MAX_PLAIN_NUMBER:
            return factor, label
        # As for the prefixes of SI units, the power of ten is a multiple of three.
        power = 3 * math.floor(math.log10(largest * factor) / 3.0)
        return factor / 10.0**power, f"10{str(power).translate(_SUPERSCRIPTS)} {label}"
    for factor, prefix in ((1e-6, "M"), (1e-3, "k")):
        if largest * factor >= 1.0:
            return factor, prefix + si
    return 1.0, si


def changed(records: Iterable[Record]) -> str:
    """Return a suffix for the name of records in a title.

    The suffix is ` x 1.7` if all records are scaled by this factor, followed by ` (processed)` if a
    record is processed; it is empty for unchanged records.
    """
    record_list = list(records)
    scales = {record.scale for record in record_list}
    text = ""
    if len(scales) == 1 and scales != {1.0}:
        text += f" x {next(iter(scales)):.4g}"
    if any(record.processing for record in record_list):
        text += " (processed)"
    return text


def record_name(source: str) -> str:
    """Return the name of a record in figures: its file name, or `standard input` for `-`.

    Bytes of a file name that are not valid UTF-8 are replaced, because no font contains them.
    """
    name = "standard input" if source == "-" else Path(source).name
    return name.encode("utf-8", "replace").decode("utf-8")


def motion_name(motion: GroundMotion) -> str:
    """Return the name of a ground motion in figures: its file name and component."""
    return f"{record_name(motion.source)}{motion.name.removeprefix(motion.source)}"


def record_names(sources: Iterable[str]) -> dict[str, str]:
    """Return the name of each record in figures.

    The name is the file name. Records with equal file names also have the last directories of their
    paths, so many that the names differ.
    """
    names = {source: record_name(source) for source in sources}
    sources_of_name = grouped((name, source) for source, name in names.items())
    for group in sources_of_name.values():
        for source in group if len(group) > 1 else ():
            # `count` increases until the last parts of the path differ from the last parts of
            # every other path with the same file name.
            parts = Path(source).parts
            others = [Path(other).parts for other in group if other != source]
            count = 1
            while count < len(parts) and any(other[-count:] == parts[-count:] for other in others):
                count += 1
            names[source] = "/".join(parts[-count:]).encode("utf-8", "replace").decode("utf-8")
    return names


def psa_label(units: OutputUnits) -> str:
    """Return the label of an axis of pseudo-accelerations."""
    return f"pseudo-acceleration PSA ({units.label('m/s^2')})"


def over_stories(axes: Any, values: Array, **style: Any) -> None:
    """Plot a value of each story as a stepped line, with the value on the x axis and the story on
    the y axis.

    Parameters
    ----------
    values : ndarray, shape (stories,)
        Values, from the first story.
    """
    # Story i extends from i - 0.5 to i + 0.5 on the y axis.
    axes.stairs(values, np.arange(values.size + 1) + 0.5, orientation="horizontal", **style)


def drift_scale(heights: Array, units: OutputUnits) -> tuple[Any, str]:
    """Return the factors that convert story drifts, m, to the unit of an axis, and the label of the
    axis: drift ratios in percent if the heights of all stories, m, are known, otherwise lengths."""
    if np.isnan(heights).any():
        return 1.0 / units.unit("m")[1], f"drift ({units.label('m')})"
    return 100.0 / heights, "drift ratio (%)"


def story_ticks(axes: Any) -> None:
    """Label whole numbers of stories or floors on the vertical axis."""
    axes.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))


def plain_numbers(axis: Any) -> None:
    """Write tick labels as decimal numbers (0.2) instead of powers of ten."""
    axis.set_major_formatter(FuncFormatter(_plain))


def plain_minor_numbers(axis: Any, *, every: bool = False) -> None:
    """Label minor ticks of a logarithmic axis with decimal numbers.

    Parameters
    ----------
    every : bool
        True to label all minor ticks; by default, only ticks with the first digit 2 or 5 have
        labels.
    """

    def label(value: float, position: Any) -> str:
        """Return the label of a tick; matplotlib calls this function with value and position."""
        # The logarithm of a power of ten can be rounded down, which 1e-9 compensates.
        decade = math.floor(math.log10(value) + 1e-9) if value > 0.0 else 0
        first_digit = f"{value / 10.0**decade:.0f}"
        return _plain(value, position) if every or first_digit in "25" else ""

    axis.set_minor_formatter(FuncFormatter(label))
    # Labels of the shorter minor ticks have the distance from the axis of the other labels.
    side = f"{axis.axis_name}tick"
    major, minor = (
        sum(mpl.rcParams[f"{side}.{kind}.{name}"] for name in ("size", "pad"))
        for kind in ("major", "minor")
    )
    axis.set_tick_params(which="minor", pad=mpl.rcParams[f"{side}.minor.pad"] + major - minor)


def plain_logarithmic(axes: Any) -> None:
    """Make both axes logarithmic with decimal tick labels and ticks at each digit."""
    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        plain_numbers(axis)
        minor_ticks(axis)


def minor_ticks(axis: Any) -> None:
    """Set minor ticks of a logarithmic axis at each digit, with labels at 2 and 5."""
    axis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=50))
    plain_minor_numbers(axis)


def _plain(value: float, _: Any) -> str:
    """Return the label of a tick; matplotlib passes its value and its position."""
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


def add_ratio_axis(axes: Any, height: float, label: str) -> None:
    """Add an axis of displacements divided by a height, percent, on top of a panel.

    Parameters
    ----------
    height : float
        Height in the unit of the displacements. If it is nan (unknown), no axis is added.
    """
    if math.isnan(height):
        return
    percent = axes.secondary_xaxis(
        "top",
        functions=(lambda length: 100.0 * length / height, lambda ratio: 0.01 * ratio * height),
    )
    percent.set_xlabel(label)


def write_labels(
    figure: Any,
    axes: Any,
    labels: Iterable[tuple[float, float, str]],
    marks: Sequence[tuple[float, float]],
) -> None:
    """Write labels next to their points so that no label covers a mark or another label.

    Four positions around each point are tried, and a label is omitted if no position is free. The
    first labels have priority. A label that has no space in the final layout, after the legend is
    arranged, is hidden (`_hide_point_labels`).

    Parameters
    ----------
    marks : sequence of (x, y)
        Points that no label may cover.
    """
    figure.draw_without_rendering()
    point = figure.dpi / 72.0  # pixels
    frame = axes.get_window_extent()
    # Each box is the left, bottom, right and top end of a mark or label, pixels.
    occupied: list[Box] = []
    if len(marks):
        half = _MARKER * point
        occupied = [
            (x - half, y - half, x + half, y + half) for x, y in axes.transData.transform(marks)
        ]
    for x, y, text in labels:
        x_pixel, y_pixel = axes.transData.transform((x, y))
        width, height = LETTER * _LABEL_SIZE * point * len(text), _LABEL_SIZE * point
        for dx, dy, horizontal, vertical in _LABEL_POSITIONS:
            left = x_pixel + dx * point - _ALIGNMENT[horizontal] * width
            bottom = y_pixel + dy * point - _ALIGNMENT[vertical] * height
            right, top = left + width, bottom + height
            is_inside = (
                frame.x0 < left and right < frame.x1 and frame.y0 < bottom and top < frame.y1
            )
            is_free = all(
                right <= x0 or x1 <= left or top <= y0 or y1 <= bottom
                for x0, y0, x1, y1 in occupied
            )
            if is_inside and is_free:
                occupied.append((left, bottom, right, top))
                axes.annotate(
                    text,
                    (x, y),
                    gid=_POINT_LABEL,
                    xytext=(dx, dy),
                    textcoords="offset points",
                    ha=horizontal,
                    va=vertical,
                    fontsize=_LABEL_SIZE,
                    color="0.25",
                )
                break
