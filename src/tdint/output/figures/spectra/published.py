"""Figure of computed spectra beside a published one, and their difference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from tdint.files import Writer
from tdint.output.figures.spectra.over_periods import Panel, draw_over_periods, line_labels, over_periods_title
from tdint.output.figures.style import IN_G, LIGHT, add_title, picture, record_name

if TYPE_CHECKING:
    from tdint.analysis.spectra.published import SpectrumDifference

_NAMES = {
    "sd": ("displacement SD (m)", 1.0),
    "psv": ("pseudo-velocity PSV (m/s)", 1.0),
    "psa": ("pseudo-acceleration PSA (g)", IN_G),
    "sv": ("velocity SV (m/s)", 1.0),
    "sa": ("absolute acceleration SA (g)", IN_G),
}
"""By quantity its label, and the factor from SI units."""


_POINTS: dict[str, Any] = {"color": "0.25", "markersize": 3.0, "markerfacecolor": "none"}


def difference_picture(lines: Sequence[SpectrumDifference], suffix: str) -> Writer:
    """Picture of spectra, the published values as points, and of the differences below.

    Parameters, return value and errors are those of `tdint.output.figures.style.picture`.
    """
    return picture(suffix, lambda: _draw(lines))


def _draw(lines: Sequence[SpectrumDifference]) -> Figure:
    label, factor = _NAMES[lines[0].published.quantity]
    panels: list[Panel[SpectrumDifference]] = [
        (label, lambda line: factor * line.computed),
        ("computed over published, less 1 (%)", lambda line: 100.0 * line.relative_difference),
    ]
    figure = draw_over_periods(lines, panels, line_labels(lines))
    upper, lower = figure.axes
    for line in {id(line.published): line for line in lines}.values():
        upper.plot(line.periods, factor * line.expected, "o", **_POINTS, zorder=3)
    upper.plot([], [], "o", **_POINTS, label="published")
    upper.legend(loc="best")
    lower.autoscale(axis="y")
    lower.axhline(0.0, color=LIGHT, linewidth=0.8, zorder=1.5)
    title = over_periods_title(
        "Spectrum", "Spectra", lines, f"beside {record_name(lines[0].published.source)} (points)"
    )
    add_title(figure, title)
    return figure
