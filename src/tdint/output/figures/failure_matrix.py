"""Figure of the problems on which methods fail: a matrix of methods and problems, readable in black and white."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tdint.output.figures.assessment import short_labels
from tdint.output.figures.style import add_title

if TYPE_CHECKING:
    from tdint.analysis.assessment.failures import Trial

_CELL = (0.46, 0.25)  # inches


class _Mark(NamedTuple):
    """How a cell looks: filling, hatching, ink; verdicts that are not listed look like the last entry."""

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
_LEGEND = (
    ("pass", "passes"),
    ("loses energy", "loses energy"),
    ("", "rings, overshoots, grows, inaccurate"),
    ("gains energy", "gains energy"),
    ("does not converge", "does not converge"),
    ("blows up", "blows up"),
)
_EXPLANATION = (
    "Numbers: hardening and softening, the energy ratio that is farthest from 1; otherwise the error that is judged.\n"
    "After a failure: the steps done until then. - : the method is not for this building."
)


def failure_picture(trials: Sequence[Trial]) -> Figure:
    """Picture of who fails where: a row per method, a column per problem and step.

    Parameters
    ----------
    trials : sequence of Trial
        A cell each.
    """
    methods = list(dict.fromkeys(trial.method for trial in trials))
    columns = list(dict.fromkeys((trial.problem, trial.dt) for trial in trials))
    width, height = _CELL[0] * len(columns), _CELL[1] * len(methods)
    figure = Figure(figsize=(max(width + 2.2, 7.5), height + 3.2), layout="constrained")
    axes = figure.subplots()
    for trial in trials:
        _draw_cell(axes, columns.index((trial.problem, trial.dt)), methods.index(trial.method), trial)
    _frame(axes, columns, methods)
    for first in range(1, len(columns)):
        if columns[first][0] != columns[first - 1][0]:
            axes.axvline(first - 0.5, color="black", linewidth=1.2)
    handles = [_patch(0.0, 0.0, _MARKS[name]) for name, _ in _LEGEND]
    size = {"ncols": 3, "handlelength": 2.4, "handleheight": 1.4, "title_fontsize": 7.5}
    texts = [text for _, text in _LEGEND]
    legend = figure.legend(handles, texts, loc="outside lower center", title=_EXPLANATION, **size)
    legend.get_title().set_multialignment("center")
    add_title(figure, "Problems on which methods fail")
    return figure


def _frame(axes: Any, columns: Sequence[tuple[str, float]], methods: Sequence[str]) -> None:
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(methods) - 0.5, -0.5))
    axes.grid(False)
    axes.tick_params(length=0.0)
    axes.xaxis.tick_top()
    short = short_labels(methods)
    axes.set_xticks(range(len(columns)), [f"{name}, dt {dt:.4g}" for name, dt in columns], rotation=60.0, ha="left")
    axes.set_yticks(range(len(methods)), [short[method] for method in methods], parse_math=False)


def _patch(x: float, y: float, mark: _Mark) -> Rectangle:
    return Rectangle(
        (x - 0.5, y - 0.5), 1.0, 1.0, facecolor=mark.face, hatch=mark.hatch, edgecolor="0.4", linewidth=0.5
    )


def _draw_cell(axes: Any, x: int, y: int, trial: Trial) -> None:
    mark = _MARKS.get(trial.verdict, _MARKS[""])
    axes.add_patch(_patch(x, y, mark))
    behind = {"facecolor": mark.face, "edgecolor": "none", "pad": 0.8} if mark.hatch else None
    axes.text(x, y, _words(trial), ha="center", va="center", fontsize=6.8, color=mark.ink, bbox=behind)


def _words(trial: Trial) -> str:
    """Three digits of what is judged, the steps done before a failure, or a dash."""
    if math.isnan(trial.measure):
        return "-" if trial.outcome == "refused" else str(trial.steps)
    if 0.01 <= trial.measure < 1000.0 or trial.measure == 0.0:
        return f"{trial.measure:.3g}"
    digits, power = f"{trial.measure:.{int(trial.measure > 1e-9)}e}".split("e")
    return f"{float(digits):g}e{int(power)}"
