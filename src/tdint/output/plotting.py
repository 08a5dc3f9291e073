"""Figures from Python: a figure of any result, or its main panel on existing axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from tdint.errors import UsageError
from tdint.files import write_files
from tdint.output.figures.style import picture, style_context
from tdint.output.presentation import Presentation, presentations
from tdint.output.printed import PRINTED, PrintedAs, figure_width
from tdint.tabular import ResultList
from tdint.units import SI, parse_output_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@overload
def plot(
    result: Any,
    ax: None = None,
    units: str = "",
    *,
    file: str | Path | None = None,
    width: float | str | None = None,
    title: bool = True,
) -> Figure: ...


@overload
def plot(result: Any, ax: Axes, units: str = "") -> Axes: ...


def plot(
    result: Any,
    ax: Axes | None = None,
    units: str = "",
    *,
    file: str | Path | None = None,
    width: float | str | None = None,
    title: bool = True,
) -> Figure | Axes:
    """Plot a result, or several results of the same type in a common figure.

    Parameters
    ----------
    result : object
        Result of `run`, `spectrum`, `stability`, `ida`, `fragility` or another function; a record;
        or a sequence of results that can share a figure, such as spectra or curves of methods.
    ax : matplotlib.axes.Axes, optional
        Axes for the main panel only: pseudo-accelerations of spectra, peak drifts of a run, the
        spectral radius of methods, ...
    units : str
        Units instead of SI, such as `kip,in,g`.
    file : str or Path, optional
        The figure is also written to this file: .png, .pdf (with TrueType fonts) or .svg.
    width : float or str, optional
        Printed width in m, or with its unit (`90mm`). Font sizes are 6 to 8 pt and mathematical
        symbols are used.
    title : bool
        True for a figure with a title, the default; figures of papers have captions instead.

    Returns
    -------
    matplotlib.figure.Figure or matplotlib.axes.Axes
        The figure, which notebooks show and pyplot does not manage; or the given axes.

    Raises
    ------
    UsageError
        The result has no figure or no main panel, a unit is unknown, or the width is
        too small for the panels.
    OutputError
        The file format is unknown, or the file cannot be written.
    """
    results = list(result) if isinstance(result, list | tuple | ResultList) else [result]
    drawing = _drawing_of(results)
    make_figure = drawing.picture
    assert make_figure is not None
    shown = results[0] if drawing.alone else results
    output_units = parse_output_units(units) if units else SI
    width_m = figure_width(width, "plot:") if isinstance(width, str) else width
    printed = PrintedAs(width_m, title)
    if ax is not None:
        # The figure of existing axes determines all settings except line styles.
        if file is not None or printed != PrintedAs():
            raise UsageError(
                "width, title and file cannot be used with ax; set them for its figure"
            )
        if drawing.on_axes is None:
            raise UsageError(f"a {type(results[0]).__name__} has no main panel; plot it without ax")
        with style_context():
            drawing.on_axes(ax, shown, output_units.in_figures)
            if ax.get_legend_handles_labels()[1]:
                ax.legend()
        return ax
    # Drawing functions read the settings from a context variable, which is valid for this call.
    before = PRINTED.set(printed)
    try:
        path = Path(file) if file is not None else None
        # The same figure is written to the file and returned, because drawing it needs time.
        suffix = path.suffix if path else ".png"
        writer = picture(suffix, lambda: make_figure(shown, output_units))
        figure = writer.figure()
        if path is not None:
            write_files({path: lambda stream: writer.save(figure, stream)}, overwrite=True)
    finally:
        PRINTED.reset(before)
    return figure


def _drawing_of(results: Sequence[Any]) -> Presentation:
    """Return the functions that plot results, by the class of the results. UsageError is raised if
    there are no results, their types differ, their type has no figure, or a figure of their type
    shows only a single result.
    """
    types = {type(result) for result in results}
    if not types:
        raise UsageError("plot: the sequence of results is empty; pass at least one result")
    names = " and ".join(sorted(result_type.__name__ for result_type in types))
    if len(types) > 1:
        raise UsageError(f"plot: {names} cannot share a figure; plot each type separately")
    drawing = presentations().get(names)
    if drawing is None or drawing.picture is None:
        available = [name for name, known in presentations().items() if known.picture]
        raise UsageError(
            f"plot: no figure is available for {names}; available for {', '.join(available)}"
        )
    if len(results) > 1 and drawing.alone:
        raise UsageError(
            f"plot: the figure of a {names} shows a single result, got {len(results)}; plot each "
            "result separately"
        )
    return drawing
