"""Figures of runs and spectra for reports: SI units, readable in black and white, PNG, PDF or SVG.

Only the modules of plots import matplotlib, and by its objects: no window system, no state shared between figures.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from textwrap import shorten
from typing import Any, BinaryIO, Protocol, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

from tdint.errors import OutputError
from tdint.ground_motion.record import Record
from tdint.output.files import Writer, write_file
from tdint.output.results import Array, RunResult, SpectrumResult
from tdint.output.tables import component_names

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
_VISIBLE = 0.05  # the drift at the end is shown where it reaches this part of the peak

# A copy in black and white keeps dashes and markers.
COLORS = ("#1f4e79", "#d1782c", "#4a9a62", "#8e2f6d", "#7d7d7d", "#2aa1b3")
DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (2, 1.5)), (0, (7, 2, 1.5, 2)), (0, (4, 1.5, 1, 1.5, 1, 1.5)))
MARKERS = ("o", "s", "^", "D", "v", "P", "x")
_FEW = 8  # periods: with fewer every one is marked
_IN_LEGEND = 24  # lines beyond these are drawn, and counted in the legend

_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": "tdint"},
    "pdf": {"Creator": "tdint", "CreationDate": None},
    "svg": {"Creator": "tdint", "Date": None},
}


def plot_run(response: RunResult, file: Path, *, overwrite: bool = False) -> None:
    """Draw a run to a file, by its suffix PNG, PDF or SVG; see `run_picture`."""
    write_file(file, run_picture(response, file.suffix), overwrite=overwrite)


def plot_spectrum(spectra: Sequence[SpectrumResult], file: Path, *, overwrite: bool = False) -> None:
    """Draw spectra to a file, by its suffix PNG, PDF or SVG; see `spectrum_picture`."""
    write_file(file, spectrum_picture(spectra, file.suffix), overwrite=overwrite)


def run_picture(response: RunResult, suffix: str) -> Writer:
    """Picture of a run: ground acceleration and roof displacement over time, the stories' drifts, one hysteresis.

    Parameters
    ----------
    response : RunResult
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


def spectrum_picture(spectra: Sequence[SpectrumResult], suffix: str) -> Writer:
    """Picture of spectra: pseudo-acceleration and displacement over period, a line per component and damping ratio.

    Parameters, return value and errors are those of `run_picture`.
    """
    return picture(suffix, lambda: _draw_spectra(spectra))


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


def _draw_run(response: RunResult) -> Figure:
    figure = Figure(figsize=(7.5, 7.2), layout="constrained")
    grid = figure.add_gridspec(3, 2, height_ratios=(1.0, 2.0, 3.6))
    if response.record is None:
        _draw_roof(figure.add_subplot(grid[:2, :]), response)
    else:
        ground = figure.add_subplot(grid[0, :])
        _draw_ground(ground, response)
        _draw_roof(figure.add_subplot(grid[1, :], sharex=ground), response)
    _draw_drifts(figure.add_subplot(grid[2, 0]), response)
    _draw_hysteresis(figure.add_subplot(grid[2, 1]), response)
    title = f"{response.model.name}\n{response.method}, dt {response.dt:.4g} s"
    if response.record is not None:
        title += f", {_record_name(response.record.source)} {response.record.component}".rstrip()
    add_title(figure, title)
    return figure


def add_title(figure: Figure, title: str) -> None:
    """A title of one or more lines above the panels, as it is: no formulas."""
    lines = [shorten(line, _TITLE_LENGTH, placeholder=" ...") for line in title.splitlines()]
    figure.suptitle("\n".join(lines), fontsize=10.5, parse_math=False)


def _draw_ground(axes: Any, response: RunResult) -> None:
    history = response.history
    assert history is not None
    axes.plot(history.time, history.ground_acceleration, color=_LIGHT, linewidth=0.8)
    axes.set_ylabel("ground\n(m/s²)")
    axes.tick_params(labelbottom=False)
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    _mark_peak(axes, history.time, history.ground_acceleration, "m/s²")


def _draw_roof(axes: Any, response: RunResult) -> None:
    history = response.history
    assert history is not None
    roof = history.displacement[:, -1]
    axes.plot(history.time, roof, color=_INK, linewidth=1.0)
    axes.set_ylabel("roof displacement (m)")
    axes.set_xlabel("time (s)")
    axes.set_xlim(history.time[0], history.time[-1])
    _mark_peak(axes, history.time, roof, "m")


def _mark_peak(axes: Any, time: Array, values: Array, unit: str) -> None:
    """A dot at the largest absolute value, the value in the upper right corner."""
    i = int(np.argmax(np.abs(values)))
    axes.plot(time[i], values[i], "o", color=_MARK, markersize=4)
    axes.margins(y=0.12)
    axes.text(
        0.995, 0.95, f"peak {abs(values[i]):.3g} {unit} at {time[i]:.4g} s", transform=axes.transAxes, ha="right",
        va="top", fontsize=8.0, color=_MARK, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )  # fmt: skip


def _draw_drifts(axes: Any, response: RunResult) -> None:
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


def _draw_hysteresis(axes: Any, response: RunResult) -> None:
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


def _telling_story(response: RunResult) -> tuple[int, str]:
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


def _draw_spectra(spectra: Sequence[SpectrumResult]) -> Figure:
    panels: list[Panel[SpectrumResult]] = [
        ("pseudo-acceleration PSA (m/s²)", lambda spectrum: spectrum.psa),
        ("displacement SD (m)", lambda spectrum: spectrum.sd),
    ]
    figure = draw_over_periods(spectra, panels, line_labels(spectra))
    add_title(figure, _spectra_title(spectra))
    return figure


class OverPeriods(Protocol):
    """What a line over the period needs; `periods` (s) of shape (k,)."""

    @property
    def record(self) -> Record: ...
    @property
    def damping(self) -> float: ...
    @property
    def periods(self) -> Array: ...


Line = TypeVar("Line", bound=OverPeriods)
Panel = tuple[str, Callable[[Line], Array]]
"""Label of the values, and the values of a line, shape (k,)."""


def draw_over_periods(results: Sequence[Line], panels: Sequence[Panel[Line]], labels: Sequence[str]) -> Figure:
    """Two panels one above the other, with a line for each result over its periods; no title yet."""
    figure = Figure(figsize=(7.5, 7.8), layout="constrained")
    both = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1.0))
    lines = []
    for result, style in zip(results, _line_styles(results), strict=True):
        order = _shown(result.periods)
        period = result.periods[order]
        if period.size < _FEW:
            style = {"marker": "o", **style, "markevery": 1}
        for axes, (_, values) in zip(both, panels, strict=True):
            lines += axes.plot(period, values(result)[order], markersize=4, **style)
    for axes, (label, _) in zip(both, panels, strict=True):
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
    both[1].set_xlabel("period (s)")
    _log_periods(both[1], results)
    add_legend(figure, both[0], lines[::2], list(labels))  # a single line has its name in the title
    return figure


def _line_styles(spectra: Sequence[OverPeriods]) -> list[dict[str, Any]]:
    """Lines to be told apart without color: dashes per component, or per damping ratio and markers per component."""
    names = component_names([spectrum.record for spectrum in spectra])
    motions = [(spectrum.record.source, name) for spectrum, name in zip(spectra, names, strict=True)]
    number = {motion: i for i, motion in enumerate(dict.fromkeys(motions))}
    ratios = {ratio: i for i, ratio in enumerate(dict.fromkeys(spectrum.damping for spectrum in spectra))}
    marked = len(number) > len(DASHES) or (len(number) > 1 and len(ratios) > 1)
    styles = []
    for spectrum, motion in zip(spectra, motions, strict=True):
        i = number[motion]
        dash = ratios[spectrum.damping] if len(ratios) > 1 else i
        style = {"color": COLORS[i % len(COLORS)], "linestyle": DASHES[dash % len(DASHES)]}
        if marked:
            style |= {"marker": MARKERS[i % len(MARKERS)], "markevery": (0.03 * (i % 6), 0.18)}
        styles.append(style)
    return styles


def _shown(periods: Array) -> NDArray[np.intp]:
    """Places of the periods that are drawn, in rising order: period 0 has none on a logarithmic axis."""
    order = np.argsort(periods, kind="stable")
    positive = order[periods[order] > 0.0]
    return positive if positive.size else order


def _log_periods(axes: Any, results: Sequence[OverPeriods]) -> None:
    shown = np.concatenate([result.periods[_shown(result.periods)] for result in results])
    low, high = float(np.min(shown)), float(np.max(shown))
    if not low > 0.0:
        return
    axes.set_xscale("log")
    if low < high:
        axes.set_xlim(low, high)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(
        FuncFormatter(lambda value, _: f"{value:g}" if high < 12.0 * low or _leads(value, "25") else "")
    )


def _leads(value: float, digits: str) -> bool:
    """Whether the first digit of `value` is one of `digits`."""
    return f"{value / 10.0 ** math.floor(math.log10(value) + 1e-9):.0f}" in digits


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


def line_labels(spectra: Sequence[OverPeriods]) -> list[str]:
    """What tells the lines apart: the record if there are several, the component, the damping if there are several."""
    names = component_names([spectrum.record for spectrum in spectra])
    several_files = len({spectrum.record.source for spectrum in spectra}) > 1
    several_ratios = len({spectrum.damping for spectrum in spectra}) > 1
    labels = []
    for spectrum, name in zip(spectra, names, strict=True):
        file = _record_name(spectrum.record.source) if several_files or not name else ""
        ratio = f"{100.0 * spectrum.damping:g} %" if several_ratios else ""
        labels.append(", ".join(filter(None, (file, name, ratio))))
    return labels


def _spectra_title(spectra: Sequence[SpectrumResult]) -> str:
    return over_periods_title("Elastic response spectrum", "Elastic response spectra", spectra, _how(spectra[0]))


def over_periods_title(one: str, several: str, results: Sequence[OverPeriods], more: str) -> str:
    """`ONE of FILE COMPONENT`, or `SEVERAL of ...`; below it the damping and what more there is to say."""
    sources = list(dict.fromkeys(result.record.source for result in results))
    ratios = list(dict.fromkeys(result.damping for result in results))
    what = _record_name(sources[0]) if len(sources) == 1 else f"{len(sources)} records"
    damping = ", ".join(f"{100.0 * ratio:g} %" for ratio in ratios)
    if len(results) == 1:
        return f"{one} of {what} {results[0].record.component}\n{damping} damping, {more}"
    return f"{several} of {what}\n{damping} damping, {more}"


def _how(spectrum: SpectrumResult) -> str:
    """The method, and what was chosen beside it."""
    words = ["exact solution" if spectrum.method == "exact" else spectrum.method]
    if spectrum.method == "exact" and spectrum.maxima != "exact":
        words.append(f"maxima: {spectrum.maxima}")
    if spectrum.interpolation != "linear":
        words.append(f"{spectrum.interpolation} motion")
    return ", ".join(words)


def _record_name(source: str) -> str:
    return "standard input" if source == "-" else Path(source).name
