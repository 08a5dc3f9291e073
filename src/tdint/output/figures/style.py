"""What all figures share: readable in black and white, PNG, PDF or SVG, in the units of the output.

Only the modules of figures import matplotlib, and by its objects: no window system, no state shared
between figures.
"""

from __future__ import annotations

import hashlib
import io
import itertools
import math
import shutil
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten, wrap
from typing import Any, BinaryIO

import numpy as np

from tdint.errors import OutputError, UsageError, did_you_mean
from tdint.files import read_whole

try:
    import matplotlib as mpl
except ValueError as error:  # of a variable that we do not need
    raise UsageError(f"matplotlib cannot be loaded, is MPLBACKEND right? {error}") from None
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Figure
from matplotlib.font_manager import get_font_names
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from tdint.arrays import Array
from tdint.ground_motion.record import Record
from tdint.output.printed import ON_SCREEN, PRINTED, TRUSTED, PrintedAs, in_print
from tdint.units import OutputUnits

mpl.rcdefaults()

_TITLE = 10.5  # height of its letters

_STYLE = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.88",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "agg.path.chunksize": 20_000,  # a long hysteresis is more than Agg draws in one piece
    "pdf.fonttype": 42,  # TrueType, which editors and publishers take
    "ps.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "tdint",
}
_LATEX = ("latex", "dvipng")
"""Programs that matplotlib starts for text.usetex."""

_PRINT = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "grid.linewidth": 0.4,
    "lines.linewidth": 1.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "font.family": "sans-serif",
    "font.sans-serif": ["Arial", "Helvetica", "Liberation Sans", "DejaVu Sans"],
    "mathtext.fontset": "stixsans",
}
_LAID_OUT_HERE = {"figure.autolayout": False, "figure.constrained_layout.use": False}
_SMALLEST, _LARGEST = 6.0, 8.0
INCH = 0.0254  # m
_RESOLUTION = {True: 600, False: 160}
_ON_PAGE = 100  # of a notebook, which shows a pixel as one; matplotlib's own
_MAX_SHEET = 1_000_000  # bytes; a style sheet that sets every parameter of matplotlib has 40 kB
INK = "#1f4e79"
LIGHT = "0.55"
MARK = "#b03a2e"
"""Colors of a single line, of what is beside it, and of what is marked."""

# A copy in black and white keeps dashes and markers.
COLORS = ("#1f4e79", "#d1782c", "#4a9a62", "#8e2f6d", "#7d7d7d", "#2aa1b3")
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
"""At least 13.7 apart (CIEDE2000) for readers who see no green, or no red, and 3.05 from white in
contrast."""
_METHOD_MARKERS = ("o", "s", "^", "D", "v", "P", "x", "*", "<", ">", "h")
_PLACES = (
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
"""Lines that stand in one picture most often: a color each for our methods."""
_FRONT_WIDTH = 3.0  # points, of the line that is highlighted
NARROW = 31
"""Characters of a label up to which those of methods stand in three columns."""

_IN_LEGEND = 24  # lines beyond these are drawn, and counted in the legend

_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": "tdint"},
    "pdf": {"Creator": "tdint", "CreationDate": None},
    "svg": {"Creator": "tdint", "Date": None},
}


_LONG = 1e5
"""A number from which a unit other than N and J gets a power of ten before it."""

_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_LABEL_SIZE = 6.5  # points
_LETTER = 0.6  # of a character, over its height
_COLUMN = 0.12
"""Width in m below which a figure is one of the two columns of a page: these have 80 to 95 mm, a
page 160 to 190 mm."""
_MARKER = 3.5  # half the size of a marker, points
_LABEL_PLACES = (
    (8, 0, "left", "center"),
    (0, 7, "center", "bottom"),
    (0, -7, "center", "top"),
    (-8, 0, "right", "center"),
)
_LABEL_PARTS = {"left": 0.0, "center": 0.5, "right": 1.0, "bottom": 0.0, "top": 1.0}
Box = tuple[float, float, float, float]


def is_narrow() -> bool:
    """Whether the picture is printed in one column of a journal, where panels stand below each
    other."""
    return 0.0 < (PRINTED.get().width or 0.0) < _COLUMN


def line_look(number: int, dash: int | None = None) -> dict[str, Any]:
    """Color and dashes of a line by its number, to be told apart without color; another number for
    the dashes."""
    dash = number if dash is None else dash
    return {"color": COLORS[number % len(COLORS)], "linestyle": DASHES[dash % len(DASHES)]}


def method_looks(methods: Iterable[str], highlight: str = "") -> dict[str, dict[str, Any]]:
    """Color, dashes and marker of each method, by its name in all pictures: those of the catalogue
    and other programs' at a place of their own, plug-ins behind them; of what has parameters those
    that are left, in their order. The one to highlight, or else the only one of a plug-in, has a
    width and stands in front."""
    from tdint.methods.catalogue import catalogue, is_ours

    lines = dict.fromkeys(methods)
    named = list(dict.fromkeys((*_PLACES, *catalogue())))
    mine = [line for line in lines if line in named and not is_ours(line)]
    front = highlight or (mine[0] if len(mine) == 1 else "")
    looks: dict[str, dict[str, Any]] = {}
    for place, method in enumerate((*named, *(line for line in lines if line not in named))):
        # Twelve colors and eleven markers: no pair of them comes twice among 132.
        color, marker = (
            METHOD_COLORS[place % len(METHOD_COLORS)],
            _METHOD_MARKERS[place % len(_METHOD_MARKERS)],
        )
        looks[method] = {"color": color, "linestyle": DASHES[place % len(DASHES)], "marker": marker}
        if method == front:
            looks[method] |= {"linewidth": _FRONT_WIDTH, "zorder": 4}
    return looks


def picture_format(suffix: str) -> str:
    """The format that a suffix stands for; OutputError for one that no picture has."""
    kind = suffix.lower().lstrip(".")
    if kind not in _METADATA:
        raise OutputError(
            f"a picture is written as .png, .pdf or .svg, not {suffix or 'without a suffix'}"
        )
    return kind


def picture(suffix: str, draw: Callable[[], Figure]) -> Picture:
    """What draws a figure and writes it to a binary stream.

    Parameters
    ----------
    suffix : str
        .png, .pdf or .svg.
    draw : callable
        Makes the figure, by a function `..._picture` of the modules of figures; it is called when
        the picture is written.

    Raises
    ------
    OutputError
        Another suffix.
    """
    kind = picture_format(suffix)
    check_print(PRINTED.get())
    return Picture(kind, draw)


class ShownFigure(Figure):
    """A figure that shows itself where it is the last line of a notebook's cell, without pyplot.

    Attributes
    ----------
    printed : PrintedAs
        What it was drawn with.
    """

    printed: PrintedAs

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        settings = _settings(self.printed) | _LAID_OUT_HERE
        with (
            mpl.rc_context(settings),
            _quiet(),
            _room(self.printed.width),
            _laid_out(self, _ON_PAGE),
        ):
            self.savefig(stream, format="png", dpi=_ON_PAGE)
        return stream.getvalue()


@dataclass(frozen=True)
class Picture:
    """A figure that is drawn when it is asked for, or written to a binary stream."""

    kind: str
    draw: Callable[[], Figure]

    def figure(self) -> Figure:
        """The figure, by itself: matplotlib's pyplot does not know it, a notebook shows it."""
        printed = PRINTED.get()
        with mpl.rc_context(_settings(printed)), _quiet():
            figure = self.draw()
            FigureCanvasAgg(figure)
            figure.__class__ = ShownFigure
            assert isinstance(figure, ShownFigure)
            figure.printed = printed
            if printed != ON_SCREEN:
                with _room(printed.width):
                    _print(figure, printed)
        return figure

    def __call__(self, stream: BinaryIO) -> None:
        self.save(self.figure(), stream)

    def save(self, figure: Figure, stream: BinaryIO) -> None:
        """Write a figure that was drawn."""
        printed = PRINTED.get()
        dpi, metadata = _RESOLUTION[bool(printed.width)], _METADATA[self.kind]
        # In other formats letters are as wide as their renderers find them.
        placed = _laid_out(figure, dpi) if self.kind == "png" else nullcontext()
        with (
            mpl.rc_context(_settings(printed) | _LAID_OUT_HERE),
            _quiet(),
            _room(printed.width),
            placed,
        ):
            figure.savefig(stream, format=self.kind, dpi=dpi, metadata=metadata)


@contextmanager
def _laid_out(figure: Figure, dpi: float) -> Iterator[None]:
    """A figure whose parts have found their places: to save it, matplotlib draws all of it twice to
    let them do so."""
    engine, before = figure.get_layout_engine(), figure.dpi
    figure.dpi = dpi
    try:
        if engine:
            engine.execute(figure)
        figure.set_layout_engine(None)
        yield
    finally:
        figure.set_layout_engine(engine)
        figure.dpi = before


@contextmanager
def _quiet() -> Iterator[None]:
    """A name in a script that the font does not have is drawn with boxes; that is no reason to
    fail. Where LaTeX fails, which a style sheet may ask for: UsageError."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        try:
            yield
        except RuntimeError as error:
            if not mpl.rcParams["text.usetex"]:
                raise
            raise UsageError(
                f"text.usetex of the style sheet: {str(error).strip().splitlines()[0]}"
            ) from None


@contextmanager
def _room(width: float | None) -> Iterator[None]:
    """Raise UsageError where panels find no room at a width."""
    warnings.filterwarnings("error", message="constrained_layout not applied")
    try:
        yield
    except UserWarning:
        asked = f"{1e3 * (width or 0.0):.0f} mm"
        raise UsageError(
            f"the panels of this picture find no room at {asked}; it takes a larger width"
        ) from None


def _settings(printed: PrintedAs) -> dict[str, Any]:
    """matplotlib's settings; a style sheet goes over ours, a font over both."""
    settings = _STYLE | (_PRINT if printed.width else {})
    if printed.style:
        settings = settings | dict(
            mpl.rc_params_from_file(printed.style, use_default_template=False)
        )
    return settings | ({"font.family": printed.font} if printed.font else {})


def style_context() -> AbstractContextManager[None]:
    """Our settings of lines, for what is drawn on axes of others: sizes of letters and grids are
    theirs."""
    return mpl.rc_context(
        {name: _STYLE[name] for name in ("lines.linewidth", "legend.frameon", "agg.path.chunksize")}
    )


def check_print(printed: PrintedAs) -> None:
    """Raise UsageError for a font or a style sheet that is not there, or that starts what is not or
    is not trusted."""
    if printed.font and printed.font not in get_font_names():
        hint = did_you_mean(printed.font, get_font_names())
        raise UsageError(f"font {printed.font!r}: this machine has no such font{hint}")
    if printed.style:
        # A pipe may never end, and a large file would fill the memory: the readers of records and
        # models refuse both in the same way.
        large = f"is larger than {_MAX_SHEET // 1_000_000} MB, and no style sheet of matplotlib"
        try:
            text = read_whole(printed.style, UsageError, {}, large, _MAX_SHEET)
        except UsageError as error:
            raise UsageError(f"style sheet {error}") from None
        # matplotlib evaluates lists of colors and starts LaTeX, so a style sheet is code.
        if not TRUSTED.get():
            digest = hashlib.sha256(text).hexdigest()
            raise UsageError(
                f"style sheet {printed.style} (SHA-256 {digest}): may start programs; read it, "
                "then give --trust"
            )
        try:
            sheet = mpl.rc_params_from_file(printed.style, use_default_template=False)
        except (OSError, ValueError) as error:
            raise UsageError(f"style sheet {printed.style}: {error}") from None
        if sheet.get("text.usetex") and not all(map(shutil.which, _LATEX)):
            raise UsageError(
                f"style sheet {printed.style}: text.usetex needs {' and '.join(_LATEX)}, not found "
                "here"
            )


def _print(figure: Figure, printed: PrintedAs) -> None:
    """Bring a figure to its width, its letters to the sizes of print, its words to those of the
    paper."""
    width, height = figure.get_size_inches()
    if printed.width:
        narrow = printed.width / INCH / width
        figure.set_size_inches(width * narrow, height * math.sqrt(narrow))
        width *= narrow
    title = figure.get_suptitle()
    if title:
        room = int(width * 72.0 / (_LARGEST * _LETTER))
        lines = (
            part for line in title.splitlines() for part in wrap(line, room, break_on_hyphens=False)
        )
        figure.suptitle("\n".join(lines) if printed.title else "")
    engine = figure.get_layout_engine()
    figure.set_layout_engine("none")
    figure.draw_without_rendering()  # numbers at ticks are made now, wherever the panels are
    figure.set_layout_engine(engine)
    before: set[str] = set()
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        words = [text.get_text() for text in axis.get_ticklabels()]
        if isinstance(axis.get_major_locator(), FixedLocator) and any(
            words
        ):  # each drawing writes them anew
            before.update(words)
            axis.set_ticklabels([in_print(word, printed) for word in words])
    for text in figure.findobj(Text):
        before.add(text.get_text().strip())
        text.set_text(in_print(text.get_text(), printed))
        if printed.width:
            text.set_fontsize(min(max(text.get_fontsize(), _SMALLEST), _LARGEST))
    if printed.width:
        _fit(figure)
    for label, _ in printed.labels:
        if not any(text == label or text.startswith(label + ":") for text in before):
            raise UsageError(f"label {label!r}: nothing in the picture is called so")


_MOST_THINNINGS = 3
"""So often an axis gets half of its ticks: of eight one is left, and more drawings would change
nothing."""


def _fit(figure: Figure) -> None:
    """Bring the words of a narrow figure to their room: labels and titles go on in another line,
    and axes have fewer ticks, until no number stands over another."""
    FigureCanvasAgg(figure)
    page = figure.bbox
    for axes in figure.axes:
        # Before the layout: the share of the page that the panel and its own labels have.
        part = (
            spec.get_position(figure) if (spec := axes.get_subplotspec()) else axes.get_position()
        )
        wide, high = page.width * part.width, page.height * part.height
        told = [
            child
            for child in axes.get_children()
            if isinstance(child, Text) and child not in axes.texts and child.get_text()
        ]
        for title in told:
            _wrap(title, _SHARE * wide / len(told))
        for panel in (axes, *axes.child_axes):
            _wrap(panel.xaxis.label, _SHARE * wide)
            _wrap(panel.yaxis.label, _SHARE * high)
        legend = axes.get_legend()
        for text in (*axes.texts, *(legend.get_texts() if legend else ())):
            _wrap(text, _SHARE * wide)
    for text in figure.texts:
        _wrap(text, page.width)
    panels = [panel for axes in figure.axes for panel in (axes, *axes.child_axes)]
    every = [axis for panel in panels for axis in (panel.xaxis, panel.yaxis)]
    counted = [
        axis for axis in every if not isinstance(axis.get_major_locator(), FixedLocator)
    ]  # no names
    for _ in range(_MOST_THINNINGS):
        _grow(figure)
        changed = [_thin(axis) for axis in counted]
        # Now the panels have their places, and what is below or above has taken some of their
        # height.
        changed += [_wrap(panel.xaxis.label, 1.2 * panel.bbox.width) for panel in panels]
        changed += [_wrap(panel.yaxis.label, 1.1 * panel.bbox.height) for panel in panels]
        if not any(changed):
            break
    for axes in figure.axes:
        points = [text for text in axes.texts if text.get_gid() == _OF_POINT]
        frame = axes.get_window_extent()
        boxes: list[Any] = []
        for text in points:
            box = text.get_window_extent()
            # A narrower panel has its points, and their labels, nearer to the numbers of its axes.
            within = (
                frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1
            )
            shown = bool(within) and not any(box.overlaps(other) for other in boxes)
            text.set_visible(shown)
            boxes += [box] * shown


_OF_POINT = "point"
"""Marks labels of points, which are left out where they find no room."""

_TALLEST = 2.0
"""So much taller a figure may get for the lines that its words take: beyond, its panels are too
narrow, not too low."""


def _grow(figure: Figure) -> None:
    """Draw a figure, as much taller as its layout needs.

    Raises
    ------
    UserWarning
        No height gives its panels room.
    """
    width, height = figure.get_size_inches()
    for taller in (1.0, 1.15, 1.3, 1.5, 1.75, _TALLEST):
        figure.set_size_inches(width, taller * height)
        try:
            figure.draw_without_rendering()
            return
        except UserWarning:
            if taller == _TALLEST:
                raise


_SHARE = 0.8
"""Of a panel's part of the page: what its title and labels may take; the rest are the numbers of
the other axis."""


def _wrap(text: Text, room: float) -> bool:
    """Break the lines of a text that are longer than their room, pixels; whether they were."""
    box = text.get_window_extent()
    long = max(box.width, box.height)
    lines = text.get_text().splitlines()
    if lines and long > room:
        letters = max(8, int(max(map(len, lines)) * room / long))
        text.set_text(
            "\n".join(
                part for line in lines for part in wrap(line, letters, break_long_words=False)
            )
        )
    return text.get_text().splitlines() != lines


def _thin(axis: Any) -> bool:
    """Leave half of an axis's ticks away if a number stands over another; whether that was so."""
    boxes = [
        label.get_window_extent()
        for tick in axis._update_ticks()
        for label in (tick.label1, tick.label2)
        if label.get_visible() and label.get_text()
    ]
    along = [(box.x0, box.x1) if axis.axis_name == "x" else (box.y0, box.y1) for box in boxes]
    along.sort()
    if all(before[1] + 1.0 <= after[0] for before, after in itertools.pairwise(along)):
        return False
    if any(label.get_text() for label in axis.get_minorticklabels()):
        axis.set_minor_formatter(NullFormatter())
    else:
        axis.set_major_locator(FixedLocator(axis.get_majorticklocs()[::2]))
    return True


def titled(figure: Figure, title: str) -> Figure:
    """The figure with a title of one or more lines above its panels, as it is: no formulas. A line
    that is wider than the figure goes on in another one, as far as that."""
    room = int(figure.get_size_inches()[0] * 72.0 / (_TITLE * _LETTER))
    told = (shorten(line, 2 * room, placeholder=" ...") for line in title.splitlines())
    lines = (part for line in told for part in _evenly(line, room))
    figure.suptitle("\n".join(lines), fontsize=_TITLE, parse_math=False)
    return figure


def _evenly(line: str, room: int) -> list[str]:
    """A line in as few lines of at most so many letters as it takes, as even as they come: no word
    is left alone."""
    few = len(wrap(line, room, break_on_hyphens=False))
    parts = (
        wrap(line, width, break_on_hyphens=False)
        for width in range(max(len(line) // max(few, 1), 1), room + 1)
    )
    return next(lines for lines in parts if len(lines) <= few)


def write_note(axes: Any, text: str, x: float = 0.99, y: float = 0.95) -> None:
    """Numbers in the upper right of a panel, the corner of the text at x and y of the axes, from 0
    to 1."""
    white = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
    place = {"transform": axes.transAxes, "ha": "right", "va": "top"}
    axes.text(x, y, text, **place, fontsize=8.0, color=MARK, bbox=white)


def legend_columns(labels: Sequence[str], most: int, width: float | None = None) -> int:
    """Columns of a legend below the panels: as many as stand beside each other within a width,
    inches, or that given for print."""
    columns = max(1, min(len(labels), most))
    printed = PRINTED.get().width
    if labels and (inches := printed / INCH if printed else width):
        letters = inches * 72.0 / ((7.0 if printed else 8.0) * _LETTER)
        columns = max(1, min(columns, int(letters / (max(map(len, labels)) + 11))))
    return columns


def add_legend(
    figure: Figure, axes: Any, lines: list[Any], labels: list[str], narrow: int = 24
) -> None:
    """A legend below the panels, for which the figure grows; none for a single line.

    Labels of up to `narrow` characters stand in three columns.
    """
    if len(lines) == 1:
        return
    if len(labels) > _IN_LEGEND:
        labels = [*labels[: _IN_LEGEND - 1], f"... and {len(labels) - _IN_LEGEND + 1} more"]
        lines = [*lines[: _IN_LEGEND - 1], axes.plot([], [], linestyle="none")[0]]
    columns = legend_columns(labels, 2 if max(map(len, labels)) > narrow else 3)
    figure.set_figheight(figure.get_figheight() + 0.17 * math.ceil(len(labels) / columns))
    labels = [" " + label for label in labels]  # a label that begins with _ would be left out
    legend = figure.legend(
        lines, labels, loc="outside lower center", ncols=columns, handlelength=3.6
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def scaled_unit(largest: float, si: str, units: OutputUnits) -> tuple[float, str]:
    """The factor from an SI unit to the unit that stands for it, and that one's label.

    N and J, which no building has few of, have M, k or nothing before them, so that the largest
    number is 1 at least.
    """
    if units.unit(si)[0] != si:
        factor, label = 1.0 / units.unit(si)[1], units.label(si)
        power = (
            3 * math.floor(math.log10(largest * factor) / 3.0) if largest * factor >= _LONG else 0
        )
        return (
            factor / 10.0**power,
            f"10{str(power).translate(_RAISED)} {label}" if power else label,
        )
    for factor, prefix in ((1e-6, "M"), (1e-3, "k")):
        if largest * factor >= 1.0:
            return factor, prefix + si
    return 1.0, si


def changed(records: Iterable[Record]) -> str:
    """` (processed)` behind the name of records of which some were changed on request, ` x 1.7`
    where all were scaled by that, else nothing."""
    changed_records = list(records)
    scales = {record.scale for record in changed_records}
    scaled = f" x {next(iter(scales)):.4g}" if len(scales) == 1 and scales != {1.0} else ""
    return scaled + (" (processed)" if any(record.processing for record in changed_records) else "")


def record_name(source: str) -> str:
    """What a picture calls a record; bytes of a file name that are no UTF-8 have no letters to be
    drawn with."""
    name = "standard input" if source == "-" else Path(source).name
    return name.encode("utf-8", "replace").decode("utf-8")


def record_names(sources: Iterable[str]) -> dict[str, str]:
    """What a picture calls each of several records: its file, with as many folders as tell it from
    others."""
    names = {source: record_name(source) for source in sources}
    named: dict[str, list[str]] = {}
    for source, name in names.items():
        named.setdefault(name, []).append(source)
    for alike in named.values():
        for source in alike if len(alike) > 1 else ():
            parts = Path(source).parts
            others = [Path(other).parts for other in alike if other != source]
            folders = range(1, len(parts))
            count = next(
                (n for n in folders if all(other[-n:] != parts[-n:] for other in others)),
                len(parts),
            )
            names[source] = "/".join(parts[-count:]).encode("utf-8", "replace").decode("utf-8")
    return names


def over_stories(axes: Any, values: Array, **style: Any) -> None:
    """Values of the stories over the height, a step for each."""
    axes.stairs(values, np.arange(values.size + 1) + 0.5, orientation="horizontal", **style)


def plain_numbers(axis: Any) -> None:
    """Numbers as they are read aloud: 0.2, not a power of ten."""
    axis.set_major_formatter(FuncFormatter(_plain))


def plain_minor_numbers(axis: Any, *, every: bool = False) -> None:
    """The same between the powers of ten: at 2 and 5, or at all ticks."""

    def written(value: float, at: Any) -> str:
        decade = (
            math.floor(math.log10(value) + 1e-9) if value > 0.0 else 0
        )  # 1e-9: the rounding of a logarithm
        return _plain(value, at) if every or f"{value / 10.0**decade:.0f}" in "25" else ""

    axis.set_minor_formatter(FuncFormatter(written))


def plain_logarithmic(axes: Any) -> None:
    """Both axes logarithmic with plain numbers, ticks at each digit."""
    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        plain_numbers(axis)
        minor_ticks(axis)


def minor_ticks(axis: Any) -> None:
    """Ticks of a logarithmic axis at each digit, numbers at 2 and 5."""
    axis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=50))
    plain_minor_numbers(axis)


def _plain(value: float, _: Any) -> str:
    return f"{value:g}"


def add_ratio_axis(axes: Any, height: float, label: str) -> None:
    """On top of an axis of displacements their ratios to a height (of the same unit), in percent;
    none without one."""
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
    """Write each label (x, y, text) beside its point, the first ones first, where it covers no mark
    and no other label.

    Labels that find no room are left out. Call this when everything else of the figure is in its
    place.

    Parameters
    ----------
    marks : sequence of (x, y)
        Points that no label may cover.
    """
    figure.draw_without_rendering()
    unit = figure.dpi / 72.0
    frame = axes.get_window_extent()
    taken: list[Box] = []
    if len(marks):
        half = _MARKER * unit
        taken = [
            (x - half, y - half, x + half, y + half) for x, y in axes.transData.transform(marks)
        ]
    for x, y, text in labels:
        across, along = axes.transData.transform((x, y))
        for dx, dy, horizontal, vertical in _LABEL_PLACES:
            width, height = _LETTER * _LABEL_SIZE * unit * len(text), _LABEL_SIZE * unit
            left = across + dx * unit - _LABEL_PARTS[horizontal] * width
            low = along + dy * unit - _LABEL_PARTS[vertical] * height
            box = (left, low, left + width, low + height)
            inside = frame.x0 < left and box[2] < frame.x1 and frame.y0 < low and box[3] < frame.y1
            free = all(
                box[2] <= x0 or x1 <= left or box[3] <= y0 or y1 <= low for x0, y0, x1, y1 in taken
            )
            if inside and free:
                taken.append(box)
                place = {"gid": _OF_POINT, "xytext": (dx, dy), "textcoords": "offset points"}
                place |= {"ha": horizontal, "va": vertical}
                axes.annotate(text, (x, y), **place, fontsize=_LABEL_SIZE, color="0.25")
                break
