"""Figure of computed spectra beside a published one, and their difference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from tdint.files import Writer
from tdint.output.figures.spectra.over_periods import Panel, draw_over_periods, line_labels, over_periods_title
from tdint.output.figures.style import LIGHT, add_title, picture, record_name
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.spectra.published import SpectrumDifference

_NAMES = {
    "sd": ("displacement SD", "m"),
    "psv": ("pseudo-velocity PSV", "m/s"),
    "psa": ("pseudo-acceleration PSA", "m/s^2"),
    "sv": ("velocity SV", "m/s"),
    "sa": ("absolute acceleration SA", "m/s^2"),
}
"""By quantity its name and SI unit."""


_POINTS: dict[str, Any] = {"color": "0.25", "markersize": 3.0, "markerfacecolor": "none"}


def difference_picture(lines: Sequence[SpectrumDifference], suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of spectra, the published values as points, and of the differences below.

    Parameters, return value and errors are those of `tdint.output.figures.style.picture`.
    """
    return picture(suffix, lambda: _draw(lines, units.in_pictures))


def _draw(lines: Sequence[SpectrumDifference], units: OutputUnits) -> Figure:
    name, si = _NAMES[lines[0].published.quantity]
    panels: list[Panel[SpectrumDifference]] = [
        (f"{name} ({units.label(si)})", lambda line: units.of(line.computed, si)),
        ("computed over published, less 1 (%)", lambda line: 100.0 * line.relative_difference),
    ]
    figure = draw_over_periods(lines, panels, line_labels(lines))
    upper, lower = figure.axes
    for line in {id(line.published): line for line in lines}.values():
        upper.plot(line.periods, units.of(line.expected, si), "o", **_POINTS, zorder=3)
    upper.plot([], [], "o", **_POINTS, label="published")
    upper.legend(loc="best")
    lower.autoscale(axis="y")
    lower.axhline(0.0, color=LIGHT, linewidth=0.8, zorder=1.5)
    title = over_periods_title(
        "Spectrum", "Spectra", lines, f"beside {record_name(lines[0].published.source)} (points)"
    )
    add_title(figure, title)
    return figure
