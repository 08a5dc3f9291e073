"""Figures from Python: a figure of any result, or its main panel on existing axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.errors import UsageError
from tdint.files import write_files
from tdint.output.figures import (
    assessment,
    collapse,
    comparison,
    failure_matrix,
    many_runs,
    mode_shapes,
    runs,
    spectrum_curves,
    suites,
)
from tdint.output.figures.style import picture, style_context
from tdint.output.printed import PRINTED, PrintedAs, figure_width, parse_style
from tdint.output.tables.spectra import RecordInfo, record_info
from tdint.tabular import ResultList
from tdint.units import SI, OutputUnits, parse_output_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Results = Sequence[Any]
_PERIODS = (0.04, 4.0, 100)
"""Range (s) and number of periods of spectra in comparisons with recordings."""


@dataclass(frozen=True)
class _Drawing:
    """Functions that plot results of a type.

    Attributes
    ----------
    picture : callable
        Returns a figure of the results in given units.
    on_axes : callable | None
        Plots the main panel on existing axes; None for results without a main panel.
    alone : bool
        True if a figure shows a single result. The functions then receive this result instead of a
        sequence of results.
    """

    picture: Callable[[Any, OutputUnits], Figure]
    on_axes: Callable[[Any, Any, OutputUnits], None] | None = None
    alone: bool = False


@overload
def plot(
    result: Any,
    ax: None = None,
    units: str = "",
    *,
    file: str | Path | None = None,
    width: float | str | None = None,
    font: str | None = None,
    title: bool = True,
    label: Mapping[str, str] | None = None,
    style: str | Path | None = None,
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
    font: str | None = None,
    title: bool = True,
    label: Mapping[str, str] | None = None,
    style: str | Path | None = None,
) -> Figure | Axes:
    """Plot a result, or several results of the same type in a common figure.

    Parameters
    ----------
    result : object
        Result of `run`, `spectrum`, `stability`, `ida`, `fragility` or another function; a record;
        or a sequence of results that can share a figure, such as spectra or curves of methods.
    ax : matplotlib.axes.Axes, optional
        Axes on which only the main panel is drawn: pseudo-accelerations of spectra, peak drifts of
        a run, the spectral radius of methods, ...
    units : str
        Units instead of SI, such as `kip,in,g`.
    file : str or Path, optional
        File to which the figure is also written: .png, .pdf (with TrueType fonts) or .svg.
    width : float or str, optional
        Printed width in m, or with its unit (`90mm`). Font sizes are 6 to 8 pt and mathematical
        symbols are used.
    font : str, optional
        Name of an installed font.
    title : bool
        True for a figure with a title, the default; figures of papers have captions instead.
    label : mapping of str to str, optional
        Replacements of labels in the figure: `{"moment4": "present method"}`.
    style : str or Path, optional
        A matplotlib style sheet, or all settings as for `--style`: `"90mm,title=no"`.

    Returns
    -------
    matplotlib.figure.Figure or matplotlib.axes.Axes
        The figure, which notebooks show and pyplot does not manage; or the given axes.

    Raises
    ------
    UsageError
        The result has no figure or no main panel, a unit, font or style sheet is unknown, or the
        width is too small for the panels.
    OutputError
        The file format is unknown, or the file cannot be written.
    """
    results = list(result) if isinstance(result, list | tuple | ResultList) else [result]
    drawing = _drawing_of(results)
    shown = results[0] if drawing.alone else results
    output_units = parse_output_units(units) if units else SI
    width_m = figure_width(width, "plot:") if isinstance(width, str) else width
    # A text can contain all settings, as for --style; a path is the name of a style sheet.
    if isinstance(style, str):
        style_settings = parse_style(style, "plot: style")
    else:
        style_settings = PrintedAs(style=str(style or "") or None)
    labels = tuple((label or {}).items())
    printed = PrintedAs(width_m, font, title, labels).over(style_settings)
    if ax is not None:
        # The figure of existing axes determines all settings except line styles.
        if file is not None or printed != PrintedAs():
            raise UsageError(
                "width, font, title, label, style and file cannot be used with ax; set them for "
                "its figure"
            )
        if drawing.on_axes is None:
            raise UsageError(f"a {type(results[0]).__name__} has no main panel; plot it without ax")
        with style_context():
            drawing.on_axes(ax, shown, output_units.in_figures)
        return ax
    # Drawing functions read the settings from a context variable, which is valid for this call.
    before = PRINTED.set(printed)
    try:
        path = Path(file) if file is not None else None
        # The same figure is written to the file and returned, because drawing it needs time.
        suffix = path.suffix if path else ".png"
        writer = picture(suffix, lambda: drawing.picture(shown, output_units))
        figure = writer.figure()
        if path is not None:
            write_files({path: lambda stream: writer.save(figure, stream)}, overwrite=True)
    finally:
        PRINTED.reset(before)
    return figure


def _drawing_of(results: _Results) -> _Drawing:
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
    drawing = _DRAWINGS.get(names)
    if drawing is None:
        raise UsageError(
            f"plot: no figure is available for {names}; available for {', '.join(_DRAWINGS)}"
        )
    if len(results) > 1 and drawing.alone:
        raise UsageError(
            f"plot: the figure of a {names} shows a single result, got {len(results)}; plot each "
            "result separately"
        )
    return drawing


def _compare(results: _Results, units: OutputUnits) -> Figure:
    """Return the figure of comparisons of computed with recorded responses of a building."""
    shortest, longest, count = _PERIODS
    # Periods below two sampling intervals are omitted, because there a spectrum depends on the
    # interpolation between samples.
    shortest = max(shortest, 2.0 * results[0].event.base.dt)
    periods = np.geomspace(shortest, longest, count)
    return comparison.comparison_picture(results, periods, SA_DAMPING, units)


def _info(results: _Results) -> list[RecordInfo]:
    """Return the properties of records; results that already are properties are unchanged."""
    return [result if isinstance(result, RecordInfo) else record_info(result) for result in results]


_INFO = _Drawing(
    lambda results, units: comparison.info_picture(_info(results), units),
    lambda ax, results, units: comparison.draw_acceleration(ax, _info(results)[0].record, units),
)
_DRAWINGS: dict[str, _Drawing] = {
    "Chart": _Drawing(
        lambda result, _: assessment.chart_picture(
            result, name="Work-precision diagram", target="peak-drift"
        ),
        alone=True,
    ),
    "Comparison": _Drawing(_compare),
    "CyclicTest": _Drawing(comparison.cyclic_picture, comparison.draw_loop, alone=True),
    "DriftSpectrum": _Drawing(spectrum_curves.drift_spectrum_picture),
    "FieldChart": _Drawing(
        lambda result, _: comparison.profile_picture(result, target="peak-drift"), alone=True
    ),
    "FloorSpectrum": _Drawing(suites.floor_picture),
    "FourierSpectrum": _Drawing(comparison.fourier_picture, comparison.draw_fourier),
    "Fragility": _Drawing(
        lambda results, _: collapse.fragility_picture(results),
        lambda ax, results, _: collapse.draw_functions(ax, results),
    ),
    "FragilityResult": _Drawing(
        lambda result, _: collapse.fragility_picture(result.functions),
        lambda ax, result, _: collapse.draw_functions(ax, result.functions),
        alone=True,
    ),
    "Gradient": _Drawing(many_runs.gradient_picture, alone=True),
    "IdaStudy": _Drawing(
        lambda result, units: collapse.ida_picture(result.in_units(units)),
        lambda ax, result, units: collapse.draw_ida(ax, result.in_units(units)),
        alone=True,
    ),
    "InelasticSpectrum": _Drawing(spectrum_curves.inelastic_picture),
    "Match": _Drawing(comparison.match_picture, comparison.draw_match, alone=True),
    "ModalResponse": _Drawing(
        mode_shapes.modal_response_picture, mode_shapes.draw_modal_drifts, alone=True
    ),
    "Modes": _Drawing(
        lambda result, _: mode_shapes.mode_picture(result, name="Modes"),
        lambda ax, result, _: mode_shapes.draw_modes(ax, result),
        alone=True,
    ),
    "ObservedOrder": _Drawing(lambda results, _: assessment.order_picture(results)),
    "Overshoot": _Drawing(lambda results, _: assessment.overshoot_picture(results)),
    "Pushover": _Drawing(comparison.pushover_picture, comparison.draw_curve, alone=True),
    "Record": _INFO,
    "RecordInfo": _INFO,
    "Response": _Drawing(runs.run_picture, runs.draw_drifts, alone=True),
    "RotatedSpectrum": _Drawing(spectrum_curves.rotated_picture),
    "Runs": _Drawing(many_runs.runs_picture, many_runs.draw_runs, alone=True),
    "Scaling": _Drawing(collapse.suite_picture, collapse.draw_suite, alone=True),
    "Spectrum": _Drawing(
        lambda results, units: spectrum_curves.spectrum_picture(results, units=units),
        spectrum_curves.draw_accelerations,
    ),
    "StabilityCurve": _Drawing(
        lambda results, _: assessment.stability_picture(results),
        lambda ax, results, _: assessment.draw_radius(ax, results),
    ),
    "ParameterEffect": _Drawing(runs.sensitivity_picture),
    "TargetDisplacement": _Drawing(comparison.target_picture),
    "Trial": _Drawing(lambda results, _: failure_matrix.failure_picture(results)),
}
"""Drawing functions by class name of the results, so that their modules need not be imported."""
