"""Figures of runs for reports, and what all figures share: SI units, readable in black and white, PNG, PDF or SVG.

Only the modules of plots import matplotlib, and by its objects: no window system, no state shared between figures.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tdint.errors import OutputError
from tdint.files import Writer
from tdint.ground_motion.record import Record

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import Response

Array = NDArray[np.float64]

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
    "svg.fonttype": "none",
    "svg.hashsalt": "tdint",
}
_INK = "#1f4e79"
_LIGHT = "0.55"
_MARK = "#b03a2e"
_NEAR = 0.4  # the collapse drift is shown where the peak reaches this part of it
_TITLE_LENGTH = 95
_SEEN = 0.002  # estimated errors are shown where one reaches this part of the largest peak
_VISIBLE = 0.05  # the drift at the end is shown where it reaches this part of the peak

# A copy in black and white keeps dashes and markers.
COLORS = ("#1f4e79", "#d1782c", "#4a9a62", "#8e2f6d", "#7d7d7d", "#2aa1b3")
DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (2, 1.5)), (0, (7, 2, 1.5, 2)), (0, (4, 1.5, 1, 1.5, 1, 1.5)))
MARKERS = ("o", "s", "^", "D", "v", "P", "x")
_IN_LEGEND = 24  # lines beyond these are drawn, and counted in the legend

_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": "tdint"},
    "pdf": {"Creator": "tdint", "CreationDate": None},
    "svg": {"Creator": "tdint", "Date": None},
}


def run_picture(response: Response, suffix: str) -> Writer:
    """Picture of a run: ground, roof displacement and energies over time, the stories' drifts, one hysteresis.

    Parameters
    ----------
    response : Response
        With its history.
    suffix : str
        .png, .pdf or .svg.

    Returns
    -------
    callable
        Draws and writes the picture to a binary stream.

    Raises
    ------
    OutputError
        Another suffix.
    ValueError
        The run kept no history.
    """
    if response.history is None:
        raise ValueError("a picture of a run needs its history: run(..., history=True)")
    return picture(suffix, lambda: _draw_run(response))


def picture_format(suffix: str) -> str:
    """The format that a suffix stands for; OutputError for one that no picture has."""
    kind = suffix.lower().lstrip(".")
    if kind not in _METADATA:
        raise OutputError(f"a picture is written as .png, .pdf or .svg, not {suffix or 'without a suffix'}")
    return kind


def picture(suffix: str, draw: Callable[[], Figure]) -> Writer:
    """What draws a figure and writes it to a binary stream; see `run_picture`."""
    kind = picture_format(suffix)

    def write(stream: BinaryIO) -> None:
        with mpl.rc_context(_STYLE), warnings.catch_warnings():
            # A name in a script that the font does not have is drawn with boxes; that is no reason to fail.
            warnings.filterwarnings("ignore", message="Glyph .* missing from")
            figure = draw()
            FigureCanvasAgg(figure)
            figure.savefig(stream, format=kind, dpi=160, metadata=_METADATA[kind])

    return write


def _draw_run(response: Response) -> Figure:
    figure = Figure(figsize=(7.5, 9.0), layout="constrained")
    grid = figure.add_gridspec(4, 2, height_ratios=(1.0, 2.0, 1.9, 3.6))
    if response.record is None:
        roof = figure.add_subplot(grid[:2, :])
    else:
        ground = figure.add_subplot(grid[0, :])
        _draw_ground(ground, response)
        roof = figure.add_subplot(grid[1, :], sharex=ground)
    _draw_roof(roof, response)
    _draw_energies(figure.add_subplot(grid[2, :], sharex=roof), response)
    _draw_drifts(figure.add_subplot(grid[3, 0]), response)
    _draw_hysteresis(figure.add_subplot(grid[3, 1]), response)
    title = f"{response.model.name}\n{response.method}, dt {response.dt:.4g} s"
    if response.record is not None:
        title += f", {record_name(response.record.source)} {response.record.component}".rstrip()
        title += changed([response.record])
    add_title(figure, title)
    return figure


def add_title(figure: Figure, title: str) -> None:
    """A title of one or more lines above the panels, as it is: no formulas."""
    lines = [shorten(line, _TITLE_LENGTH, placeholder=" ...") for line in title.splitlines()]
    figure.suptitle("\n".join(lines), fontsize=10.5, parse_math=False)


def _draw_ground(axes: Any, response: Response) -> None:
    history = response.history
    assert history is not None
    axes.plot(history.time, history.ground_acceleration, color=_LIGHT, linewidth=0.8)
    axes.set_ylabel("ground\n(m/s²)")
    axes.tick_params(labelbottom=False)
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    _mark_peak(axes, history.time, history.ground_acceleration, "m/s²")


def _draw_roof(axes: Any, response: Response) -> None:
    history = response.history
    assert history is not None
    roof = history.displacement[:, -1]
    axes.plot(history.time, roof, color=_INK, linewidth=1.0)
    axes.set_ylabel("roof displacement\n(m)")
    axes.tick_params(labelbottom=False)
    axes.set_xlim(history.time[0], history.time[-1])
    _mark_peak(axes, history.time, roof, "m")


def _draw_energies(axes: Any, response: Response) -> None:
    """Where the input energy went: layers of dissipated, damped, stored and kinetic energy below it."""
    history = response.history
    assert history is not None
    energy = history.energy
    given = response.energy.start + energy.input
    factor, unit = scaled_unit(float(np.max(np.abs(given))), "J")
    layers = (
        (energy.dissipated, "dissipated by the stories", "0.35", None),
        (energy.damping, "damping", "0.62", None),
        (energy.recoverable, "stored in the stories", "0.85", None),
        (energy.kinetic, "kinetic", "1.0", "//////"),
    )
    below = np.zeros(len(given))
    for values, label, gray, hatch in layers:
        if not np.any(values):
            continue
        above = below + factor * values
        axes.fill_between(
            history.time, below, above, facecolor=gray, edgecolor="0.5", hatch=hatch, linewidth=0.0, label=label
        )
        below = above
    axes.plot(history.time, factor * given, color=_INK, linewidth=1.2, label="input")
    axes.set_ylabel(f"energy ({unit})")
    axes.set_xlabel("time (s)")
    axes.set_xlim(history.time[0], history.time[-1])
    axes.legend(loc="best", frameon=True, framealpha=0.85, edgecolor="none", reverse=True)  # as the layers lie
    axes.set_title(f"balance off by {100.0 * abs(response.energy.error):.1g} % at the end", loc="right", fontsize=8.0)


def _mark_peak(axes: Any, time: Array, values: Array, unit: str) -> None:
    """A dot at the largest absolute value, the value in the upper right corner."""
    i = int(np.argmax(np.abs(values)))
    axes.plot(time[i], values[i], "o", color=_MARK, markersize=4)
    axes.margins(y=0.12)
    axes.text(
        0.995, 0.95, f"peak {abs(values[i]):.3g} {unit} at {time[i]:.4g} s", transform=axes.transAxes, ha="right",
        va="top", fontsize=8.0, color=_MARK, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )  # fmt: skip


def _draw_drifts(axes: Any, response: Response) -> None:
    """Largest drift of each story as a profile; in percent of the height where all stories have one."""
    stories = response.stories
    by_height = bool(np.all(np.isfinite(stories.peak_drift_ratio)))
    values = 100.0 * stories.peak_drift_ratio if by_height else stories.peak_drift
    edges = np.arange(values.size + 1) + 0.5
    axes.stairs(values, edges, orientation="horizontal", fill=True, color=_INK, alpha=0.18)
    axes.stairs(values, edges, orientation="horizontal", color=_INK, linewidth=1.4)
    residual = np.abs(stories.residual_drift) / (stories.height / 100.0 if by_height else 1.0)
    if np.any(residual > _VISIBLE * np.max(values)):
        axes.stairs(
            residual, edges, orientation="horizontal", color=_MARK, linestyle=DASHES[2], label="at the end of the run"
        )
    if response.check is not None:
        errors = response.check.errors
        whiskers = 100.0 * errors.peak_drift_ratio if by_height else errors.peak_drift
        if np.any(whiskers > _SEEN * np.max(values)):
            axes.errorbar(
                values, edges[1:] - 0.5, xerr=whiskers, fmt="none", ecolor=_INK, capsize=2.5, label="estimated error"
            )
    limit = 100.0 * response.model.collapse_drift
    if by_height and np.max(values) > _NEAR * limit:
        axes.axvline(limit, color=_MARK, linestyle=DASHES[1], label=f"collapse drift {limit:g} %")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")
    axes.set_title("Largest drift of each story")
    axes.set_xlabel("peak drift ratio (%)" if by_height else "peak drift (m)")
    axes.set_ylabel("story")
    axes.set_xlim(left=0.0)
    axes.set_ylim(edges[0], edges[-1])
    axes.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))


def _draw_hysteresis(axes: Any, response: Response) -> None:
    history = response.history
    assert history is not None
    story, reason = _telling_story(response)
    factor, unit = scaled_unit(float(np.max(np.abs(history.shear[:, story]))), "N")
    axes.plot(history.drift[:, story], history.shear[:, story] * factor, color=_INK, linewidth=0.8)
    axes.axhline(0.0, color=_LIGHT, linewidth=0.6)
    axes.axvline(0.0, color=_LIGHT, linewidth=0.6)
    axes.set_title(f"Story {story + 1}: {reason}")
    axes.set_xlabel("drift (m)")
    axes.set_ylabel(f"story shear ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))


def _telling_story(response: Response) -> tuple[int, str]:
    """The story whose hysteresis says most, from 0: the largest ductility, else drift ratio, else drift."""
    stories = response.stories
    for values, name, factor, unit in (
        (stories.ductility, "ductility", 1.0, ""),
        (stories.peak_drift_ratio, "drift ratio", 100.0, " %"),
        (stories.peak_drift, "drift", 1.0, " m"),
    ):
        if np.any(np.isfinite(values)):
            story = int(np.nanargmax(values))
            return story, f"largest {name}, {factor * values[story]:.3g}{unit}"
    return 0, "no drift"


def scaled_unit(largest: float, unit: str) -> tuple[float, str]:
    """The unit with M, k or nothing before it in which the largest number is 1 at least, and the factor to it."""
    for factor, prefix in ((1e-6, "M"), (1e-3, "k")):
        if largest * factor >= 1.0:
            return factor, prefix + unit
    return 1.0, unit


def add_legend(figure: Figure, axes: Any, lines: list[Any], labels: list[str], narrow: int = 24) -> None:
    """A legend below the panels, for which the figure grows; none for a single line.

    Labels of up to `narrow` characters stand in three columns.
    """
    if len(lines) == 1:
        return
    if len(labels) > _IN_LEGEND:
        labels = [*labels[: _IN_LEGEND - 1], f"... and {len(labels) - _IN_LEGEND + 1} more"]
        lines = [*lines[: _IN_LEGEND - 1], axes.plot([], [], linestyle="none")[0]]
    columns = min(len(labels), 2 if max(map(len, labels)) > narrow else 3)
    figure.set_figheight(figure.get_figheight() + 0.17 * math.ceil(len(labels) / columns))
    labels = [" " + label for label in labels]  # a label that begins with _ would be left out
    legend = figure.legend(lines, labels, loc="outside lower center", ncols=columns, handlelength=3.6)
    for text in legend.get_texts():
        text.set_parse_math(False)


def changed(records: Iterable[Record]) -> str:
    """` (processed)` behind the name of records of which some were changed on request, else nothing."""
    return " (processed)" if any(record.processing for record in records) else ""


def record_name(source: str) -> str:
    """What a picture calls a record; bytes of a file name that are no UTF-8 have no letters to be drawn with."""
    name = "standard input" if source == "-" else Path(source).name
    return name.encode("utf-8", "replace").decode("utf-8")
