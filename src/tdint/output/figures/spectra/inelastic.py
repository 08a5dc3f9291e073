"""Figure of inelastic spectra: strength or ductility, and displacement, over the period."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from tdint.files import Writer
from tdint.ground_motion.record import component_names
from tdint.output.figures.axes import plain_numbers
from tdint.output.figures.spectra.over_periods import Panel, draw_over_periods, line_labels, over_periods_title
from tdint.output.figures.style import LIGHT, add_title, picture, record_name
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.spectra.inelastic import InelasticSpectrum


_MOST = 4  # components that have panels of their own


def inelastic_picture(spectra: Sequence[InelasticSpectrum], suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of inelastic spectra: a line per component, damping ratio, and ductility or strength.

    Return value and errors are those of `tdint.output.figures.style.picture`.

    Parameters
    ----------
    spectra : sequence of InelasticSpectrum
        One at least; all for ductilities or all for strengths.
    """
    return picture(suffix, lambda: _draw(spectra, units))


def _draw(spectra: Sequence[InelasticSpectrum], units: OutputUnits) -> Figure:
    panels: list[Panel[InelasticSpectrum]] = [
        ("yield strength over weight", lambda spectrum: spectrum.yield_strength_ratio)
        if spectra[0].target is not None
        else ("ductility", lambda spectrum: spectrum.ductility),
        (f"largest displacement ({units.label('m')})", lambda spectrum: units.of(spectrum.sd, "m")),
    ]
    given = [_given(spectrum) for spectrum in spectra]
    several = len(set(given)) > 1
    components = _components(spectra)
    apart = 1 < len(set(components)) <= _MOST
    ratios = len({spectrum.damping for spectrum in spectra}) > 1
    labels = [
        ", ".join(
            filter(
                None,
                (
                    (f"{100.0 * spectrum.damping:g} %" if ratios else "") if apart else label,
                    what if several else "",
                ),
            )
        )
        for spectrum, label, what in zip(spectra, line_labels(spectra), given, strict=True)
    ]
    variants = [(spectrum.damping, what) for spectrum, what in zip(spectra, given, strict=True)]
    figure = draw_over_periods(spectra, panels, labels, variants, columns=components if apart else None)
    if spectra[0].target is None:
        _show_ductility(figure.axes[0], spectra)
    more = ("" if several else f"{given[0]}, ") + f"bilinear, hardening {spectra[0].hardening:g}"
    add_title(figure, over_periods_title("Inelastic spectrum", "Inelastic spectra", spectra, more))
    return figure


def _components(spectra: Sequence[InelasticSpectrum]) -> list[str]:
    """What each spectrum is of; the file, too, where there are several."""
    several = len({spectrum.record.source for spectrum in spectra}) > 1
    names = component_names([spectrum.record for spectrum in spectra])
    return [
        f"{record_name(spectrum.record.source)} {name}".rstrip() if several else name
        for spectrum, name in zip(spectra, names, strict=True)
    ]


def _show_ductility(axes: Any, spectra: Sequence[InelasticSpectrum]) -> None:
    """On a logarithmic axis, with a line at first yielding."""
    if not any(np.any(spectrum.ductility > 0.0) for spectrum in spectra):
        return
    axes.set_yscale("log")
    axes.autoscale(axis="y")
    axes.axhline(1.0, color=LIGHT, linewidth=0.8)
    plain_numbers(axes.yaxis)


def _given(spectrum: InelasticSpectrum) -> str:
    """What was asked for: a ductility, or a strength, which is the same at all periods."""
    if spectrum.target is not None:
        return f"ductility {spectrum.target:g}"
    return f"strength {spectrum.yield_strength_ratio[0]:.4g}"
