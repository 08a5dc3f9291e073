"""Figure of the failures of methods on test problems: a matrix of methods and problems, readable in
black and white."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tdint.errors import UsageError
from tdint.output.figures import style
from tdint.output.figures.style import Style, new_figure
from tdint.output.printed import PRINTED

if TYPE_CHECKING:
    from tdint.assessment.failures.failures import Trial

_CELL = (0.46, 0.25)  # inches
_MIN_WIDTH, _MIN_WIDTH_VERTICAL = 0.28, 0.13
"""Minimum widths of a printed cell for five 6 pt digits, inches: horizontal and vertical text."""
_HEIGHT_VERTICAL = 0.34  # inches; height of a cell with vertical text
_LETTER_WIDTH = 0.06  # inches; width of an 8 pt character
_LINE = 0.15  # inches; height of a line
_MAX_LETTERS = 5  # maximum number of characters of a printed number
_MAX_PANELS = 3  # maximum number of panels below each other


class _Mark(NamedTuple):
    """Style of a cell: color of the area, hatching, color of the text."""

    face: str
    hatch: str = ""
    ink: str = "black"


_MARKS = {
    "pass": _Mark("white", ink="0.45"),
    "loses energy": _Mark("#dbe7f3", hatch="/////"),
    "gains energy": _Mark("#d1782c", hatch="\\\\\\"),
    "blows up": _Mark("black", ink="white"),
    "does not converge": _Mark("0.35", hatch="....", ink="white"),
    "refused": _Mark("white", ink="0.45"),
    "": _Mark("0.82"),
}
"""Style of each verdict; the last style is for all other verdicts."""

_LEGEND = {
    "passes": "pass",
    "loses energy": "loses energy",
    "rings, overshoots, grows, inaccurate": "",
    "gains energy": "gains energy",
    "does not converge": "does not converge",
    "blows up": "blows up",
}
_EXPLANATION = (
    "Numbers: for hardening and softening the energy ratio farthest from 1, otherwise the assessed "
    "error.\n"
    "After a failure: completed time steps. - : the method does not apply to this building."
)


def failure_picture(trials: Sequence[Trial]) -> Figure:
    """Plot the results of methods on test problems as a matrix: a row per method, a column per
    problem and time step.
    """
    methods = list(dict.fromkeys(trial.method for trial in trials))
    columns = list(dict.fromkeys((trial.problem, trial.dt) for trial in trials))
    headings = [f"{name}, dt {dt:.4g}" for name, dt in columns]
    size = _matrix_size(methods, len(columns))
    # Each panel has a part of the columns.
    panel_headings = [
        headings[first : first + size.columns] for first in range(0, len(headings), size.columns)
    ]
    height = 0.0
    for part in panel_headings:
        height += _LINE + _LETTER_WIDTH * max(map(len, part)) + size.row_height * len(methods)
    height += 1.13  # title and legend
    figure = new_figure(size.width, height)
    panels = figure.subplots(len(panel_headings), 1, squeeze=False)[:, 0]
    # Each trial has a cell; text in a hatched cell has a plain background.
    text_style: Style = {
        "fontsize": 6.0 if PRINTED.get().width else 6.8,
        "rotation": 90.0 if size.is_vertical else 0.0,
    }
    for trial in trials:
        # The quotient is the number of the panel, the remainder is the column in this panel.
        panel, x = divmod(columns.index((trial.problem, trial.dt)), size.columns)
        y, mark = methods.index(trial.method), _MARKS.get(trial.verdict, _MARKS[""])
        panels[panel].add_patch(_patch(x, y, mark))
        box = {"facecolor": mark.face, "edgecolor": "none", "pad": 0.8} if mark.hatch else None
        panels[panel].text(
            x,
            y,
            _cell_text(trial),
            ha="center",
            va="center",
            color=mark.ink,
            bbox=box,
            **text_style,
        )
    # Problems are at the top, methods at the side; lines separate problems.
    for panel, (axes, part) in enumerate(zip(panels, panel_headings, strict=True)):
        first = panel * size.columns
        axes.set(xlim=(-0.5, size.columns - 0.5), ylim=(len(methods) - 0.5, -0.5))
        axes.grid(False)
        axes.tick_params(length=0.0)
        axes.xaxis.tick_top()
        rotation = {"rotation": 90.0} if size.is_vertical else {"rotation": 60.0, "ha": "left"}
        axes.set_xticks(range(len(part)), part, **rotation)
        axes.set_yticks(range(len(methods)), methods, parse_math=False)
        for x in range(1, len(part)):
            problem, previous_problem = columns[first + x][0], columns[first + x - 1][0]
            if problem != previous_problem:
                axes.axvline(x - 0.5, color="black", linewidth=1.2)
    handles = [_patch(0.0, 0.0, _MARKS[name]) for name in _LEGEND.values()]
    style.add_legend(figure, handles, list(_LEGEND), title=_EXPLANATION, handleheight=1.4)
    return style.titled(figure, "Problems on which methods fail")


class _MatrixSize(NamedTuple):
    """Size of the matrix of failures.

    Attributes
    ----------
    width : float
        Width of the figure, inches.
    row_height : float
        Height of a row, inches.
    is_vertical : bool
        True if the text in the cells is vertical.
    """

    width: float
    columns: int
    row_height: float
    is_vertical: bool


def _matrix_size(methods: Sequence[str], count: int) -> _MatrixSize:
    """Return the size of a matrix of methods and problems.

    On a screen, the figure has a single panel, which is as wide as necessary. In print, the width
    is specified (UsageError if it is too small), and the columns are divided into the minimum
    number of panels below each other.
    """
    name_width = _LINE + _LETTER_WIDTH * max(map(len, methods))
    printed_width = PRINTED.get().width
    if not printed_width:
        width = max(_CELL[0] * count + max(2.2, 1.2 * name_width), 7.5)
        return _MatrixSize(width, count, _CELL[1], is_vertical=False)
    width = printed_width / style.INCH
    for panels in range(1, _MAX_PANELS + 1):
        columns = math.ceil(count / panels)
        cell_width = (width - name_width) / columns
        if cell_width >= _MIN_WIDTH:
            return _MatrixSize(width, columns, _CELL[1], is_vertical=False)
        if cell_width >= _MIN_WIDTH_VERTICAL:
            return _MatrixSize(width, columns, _HEIGHT_VERTICAL, is_vertical=True)
    min_width = math.ceil(1e3 * style.INCH * (name_width + _MIN_WIDTH_VERTICAL * columns))
    raise UsageError(
        f"the names of these methods and their numbers require a width of at least {min_width} mm; "
        "specify a larger width, or fewer methods and problems"
    )


def _patch(x: float, y: float, mark: _Mark) -> Rectangle:
    """Return the rectangle of a cell of the matrix, with a width and a height of 1.

    `x` and `y` are the center of the cell: its column and its row.
    """
    return Rectangle(
        (x - 0.5, y - 0.5),
        1.0,
        1.0,
        facecolor=mark.face,
        hatch=mark.hatch,
        edgecolor="0.4",
        linewidth=0.5,
    )


def _cell_text(trial: Trial) -> str:
    """Return the text of the cell of a trial, in print at most five characters: the assessed
    measure (energy ratio or error) with three digits, the number of completed time steps before a
    failure, or a dash if the method does not apply to the building.
    """
    if math.isnan(trial.measure):
        return "-" if trial.outcome == "refused" else str(trial.steps)
    text = _measure_text(trial.measure, 3)
    if PRINTED.get().width is not None and len(text) > _MAX_LETTERS:
        return _measure_text(trial.measure, 2)
    return text


def _measure_text(measure: float, digits: int) -> str:
    """Return a measure with 2 or 3 significant digits, or as a short power of ten: 1.2e-5."""
    if 0.01 <= measure < 1000.0 or measure == 0.0:
        return f"{measure:.{digits}g}"
    # Very small measures are rounding errors: one digit is sufficient.
    decimals = 1 if digits > 2 and measure > 1e-9 else 0
    mantissa, power = f"{measure:.{decimals}e}".split("e")
    return f"{float(mantissa):g}e{int(power)}"
