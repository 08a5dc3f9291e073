"""Pictures from Python: the figure of any result, or its main panel on axes of the caller."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.errors import UsageError
from tdint.files import write_files
from tdint.output.figures import assessment, collapse, comparison, runs, spectrum_curves
from tdint.output.figures.style import picture, style_context
from tdint.output.printed import PRINTED, PrintedAs, figure_width, parse_style
from tdint.output.tables.spectra import RecordInfo, record_info
from tdint.tabular import ResultList
from tdint.units import SI, OutputUnits, parse_output_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Shown = Sequence[Any]
_PERIODS = (0.04, 4.0, 100)
"""Of the spectra beside recordings, s."""


@dataclass(frozen=True)
class _Look:
    """How results of a kind are drawn: as a picture, and on axes where one panel says what they
    are; `alone`: a picture shows one of them, which is then what these functions take in place of
    all."""

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
    """Draw a result, or several of one kind in one picture.

    Parameters
    ----------
    result : object
        What `run`, `spectrum`, `stability`, `ida`, `fragility`, ... give; a record; or a sequence
        of those that share a picture: spectra, curves of methods.
    ax : matplotlib.axes.Axes, optional
        Draw the main panel alone on these axes: pseudo-accelerations of spectra, peak drifts of a
        run, the spectral radius of methods, ...
    units : str
        Units in place of SI, such as `kip,in,g`.
    file : str or Path, optional
        Also write the figure: .png, .pdf (with TrueType letters) or .svg.
    width : float or str, optional
        Of print, m, or with its unit, `90mm`: letters have 6 to 8 points then, symbols are those of
        the field.
    font : str, optional
        Name of a font of this machine.
    title : bool
        Whether the figure has a title; papers have captions.
    label : mapping of str to str, optional
        Words in the picture and what shall stand for them: `{"moment4": "present method"}`.
    style : str or Path, optional
        A style sheet of matplotlib, or all looks as `--style` has them: `"90mm,title=no"`.

    Returns
    -------
    matplotlib.figure.Figure or matplotlib.axes.Axes
        The figure, of this call alone: a notebook shows it, pyplot does not know it; or the axes
        given.

    Raises
    ------
    UsageError
        The result has no picture, or no main panel; a unit, font or style sheet is unknown; panels
        find no room.
    OutputError
        The file is of another kind, or cannot be written.
    """
    several = list(result) if isinstance(result, list | tuple | ResultList) else [result]
    kind = _kind_of(several)
    shown = several[0] if kind.alone else several
    output_units = parse_output_units(units) if units else SI
    wide = figure_width(width, "plot:") if isinstance(width, str) else width
    written = (
        parse_style(style, "plot: style")
        if isinstance(style, str)
        else PrintedAs(style=str(style or "") or None)
    )
    printed = PrintedAs(wide, font, title, tuple((label or {}).items())).over(written)
    if ax is not None:
        # Axes of others: their figure decides on all but the lines.
        if file is not None or printed != PrintedAs():
            raise UsageError(
                "on axes that are there, size, letters and file are those of their figure"
            )
        if kind.on_axes is None:
            raise UsageError(
                f"a {type(several[0]).__name__} has no single panel: plot it without axes"
            )
        with style_context():
            kind.on_axes(ax, shown, output_units.in_pictures)
        return ax
    # What draws asks for the looks where it stands, deep inside; they hold for this call alone.
    before = PRINTED.set(printed)
    try:
        path = Path(file) if file is not None else None
        # Drawn once, for the file as for the notebook.
        made = picture(path.suffix if path else ".png", lambda: kind.picture(shown, output_units))
        figure = made.figure()
        if path is not None:
            write_files({path: lambda stream: made.save(figure, stream)}, overwrite=True)
    finally:
        PRINTED.reset(before)
    return figure


def _kind_of(results: _Shown) -> _Look:
    # A picture of several shows one kind, side by side or in one panel.
    kinds = {type(result) for result in results}
    looks = _LOOKS.get(next(iter(kinds)).__name__) if len(kinds) == 1 else None
    if looks and (len(results) == 1 or not looks.alone):
        return looks
    kinds_named = " and ".join(sorted(result.__name__ for result in kinds)) or "nothing"
    raise UsageError(
        f"{'several of ' * (len(results) > 1)}{kinds_named}: there is no picture of it"
    )


def _compared(results: _Shown, units: OutputUnits) -> Figure:
    least, most, count = _PERIODS
    # Below two sampling intervals a spectrum shows how samples are joined.
    periods = np.geomspace(max(least, 2.0 * results[0].event.base.dt), most, count)
    return comparison.comparison_picture(results, periods, SA_DAMPING, units)


def _info(results: _Shown) -> list[RecordInfo]:
    return [result if isinstance(result, RecordInfo) else record_info(result) for result in results]


_INFO = _Look(
    lambda results, units: comparison.info_picture(_info(results), units),
    lambda ax, results, units: comparison.draw_acceleration(ax, _info(results)[0].record, units),
)
_LOOKS: dict[str, _Look] = {
    "Chart": _Look(
        lambda result, _: assessment.chart_picture(
            result, name="Time against accuracy", target="peak-drift"
        ),
        alone=True,
    ),
    "Comparison": _Look(_compared),
    "CyclicTest": _Look(comparison.cyclic_picture, comparison.draw_loop, alone=True),
    "DriftSpectrum": _Look(spectrum_curves.drift_spectrum_picture),
    "FieldChart": _Look(
        lambda result, _: comparison.profile_picture(result, target="peak-drift"), alone=True
    ),
    "FloorSpectrum": _Look(runs.floor_picture),
    "FourierSpectrum": _Look(comparison.fourier_picture, comparison.draw_fourier),
    "Fragility": _Look(
        lambda results, _: collapse.fragility_picture(results),
        lambda ax, results, _: collapse.draw_functions(ax, results),
    ),
    "FragilityResult": _Look(
        lambda result, _: collapse.fragility_picture(result.functions),
        lambda ax, result, _: collapse.draw_functions(ax, result.functions),
        alone=True,
    ),
    "IdaStudy": _Look(
        lambda result, units: collapse.ida_picture(result.in_units(units)),
        lambda ax, result, units: collapse.draw_ida(ax, result.in_units(units)),
        alone=True,
    ),
    "InelasticSpectrum": _Look(spectrum_curves.inelastic_picture),
    "Match": _Look(comparison.match_picture, comparison.draw_match, alone=True),
    "ModalResponse": _Look(
        comparison.modal_response_picture, comparison.draw_modal_drifts, alone=True
    ),
    "Modes": _Look(
        lambda result, _: comparison.mode_picture(result, name="Modes"),
        lambda ax, result, _: comparison.draw_modes(ax, result),
        alone=True,
    ),
    "ObservedOrder": _Look(lambda results, _: assessment.order_picture(results)),
    "Overshoot": _Look(lambda results, _: assessment.overshoot_picture(results)),
    "Pushover": _Look(comparison.pushover_picture, comparison.draw_curve, alone=True),
    "Record": _INFO,
    "RecordInfo": _INFO,
    "Response": _Look(runs.run_picture, runs.draw_drifts, alone=True),
    "RotatedSpectrum": _Look(spectrum_curves.rotated_picture),
    "Scaling": _Look(collapse.suite_picture, collapse.draw_suite, alone=True),
    "Spectrum": _Look(
        lambda results, units: spectrum_curves.spectrum_picture(results, units=units),
        spectrum_curves.draw_accelerations,
    ),
    "StabilityCurve": _Look(
        lambda results, _: assessment.stability_picture(results),
        lambda ax, results, _: assessment.draw_radius(ax, results),
    ),
    "ParameterEffect": _Look(runs.sensitivity_picture),
    "TargetDisplacement": _Look(comparison.target_picture),
    "Trial": _Look(lambda results, _: assessment.failure_picture(results)),
}
"""By the names of the results' classes, whose modules are not loaded for it."""
