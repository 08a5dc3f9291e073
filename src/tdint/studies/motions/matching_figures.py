"""Figures of matched ground motions."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.output.figures.static_curves import MATCHED, MOTION
from tdint.output.figures.style import (
    COLORS,
    motion_name,
    new_panels,
    plain_logarithmic,
    psa_label,
    record_name,
    titled,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.studies.motions.matching import Match
from tdint.units import SI, OutputUnits


def match_picture(matched: Match, units: OutputUnits = SI) -> Figure:
    """Plot a spectrally matched ground motion and the scaled record from which it was computed.

    The upper panel shows the response spectra with the target spectrum. The panels below show
    acceleration, velocity, displacement and Arias intensity of each component over the time.
    """
    from tdint.response.spectra.target import source_of

    units = units.in_figures
    parts = matched.parts
    rows = [(1.7, (1,) * len(parts))] * 4
    figure, ((upper,), *grid) = new_panels(7.5, (3.2, (1,)), *rows)
    draw_match(upper, matched, units)
    for column, part in enumerate(parts):
        panels = [row[column] for row in grid]
        # The seed is plotted first, so that the matched ground motion is in front. The first item
        # of `motions` is the matched ground motion, the first style of `MATCHED` is for the seed.
        for record, motion, plot_style in zip(
            (part.before, part.after), part.motions[::-1], MATCHED.values(), strict=True
        ):
            energy = np.cumsum(record.acceleration**2)
            time = record.time
            motions = (record.acceleration, motion.velocity, motion.displacement)
            for axes, values, si in zip(panels, motions, MOTION.values(), strict=False):
                axes.plot(time, units.of(values, si), **plot_style)
            panels[3].plot(time, 100.0 * (energy / energy[-1]), **plot_style)
        panels[3].set_xlabel("time (s)")
        if column == 0:
            for axes, (name, si) in zip(panels, MOTION.items(), strict=False):
                axes.set_ylabel(f"{name} ({units.label(si)})")
            panels[3].set_ylabel("Arias intensity (%)")
        if len(parts) > 1:
            panels[0].set_title(part.after.component, fontsize="medium")
    subject = motion_name(matched.seed)
    source = source_of([spectrum.target for spectrum in matched.by_damping])
    target = spectrum_text(source) if matched.target.curve else record_name(source)
    pair_text = ", RotD100" if len(parts) > 1 else ""
    ratios = ", ".join(f"{100.0 * spectrum.damping:g}" for spectrum in matched.by_damping)
    return titled(figure, f"{subject} matched to {target}\n{ratios} % damping{pair_text}")


def draw_match(axes: Any, matched: Match, units: OutputUnits) -> None:
    """Plot the response spectra of a matched ground motion and of its scaled seed, and the target.

    The axes contain the spectra for each damping ratio; the legend has a single entry for all
    ratios. Periods outside of the matched range have a gray background.

    Parameters
    ----------
    matched : Match
        Result of the matching. For a pair, the spectra of both components are plotted also.
    """
    shortest, longest = float(matched.periods[0]), float(matched.periods[-1])
    periods = matched.shown_periods
    for number, spectrum in enumerate(matched.by_damping):
        # matplotlib omits labels with a leading underscore from the legend.
        hidden = "_" if number else ""
        target = spectrum.target
        inside = (periods >= target.periods[0]) & (periods <= target.periods[-1])
        values = units.of(target.at(periods[inside]), "m/s^2")
        axes.plot(periods[inside], values, color=COLORS[1], linewidth=2.2, label=f"{hidden}target")
        # The first item of `spectra` is the demand that was matched. For a pair, the spectra of the
        # two components follow. Each item contains the matched ground motion and the seed.
        spectra = spectrum.spectra_at(periods)
        for psa, (name, plot_style) in zip(spectra[0][::-1], MATCHED.items(), strict=True):
            axes.plot(periods, units.of(psa, "m/s^2"), label=f"{hidden}{name}", **plot_style)
        for part, (after, _), style in zip(spectrum.parts, spectra[1:], (":", "--"), strict=False):
            name = f"{hidden}matched, {part.after.component or 'component'}"
            plot_style = MATCHED["matched"] | {"linestyle": style}
            axes.plot(periods, units.of(after, "m/s^2"), label=name, **plot_style)
    # The gray background marks the periods outside of the matched range.
    for first, last in ((periods[0], shortest), (longest, periods[-1])):
        if first < last:
            axes.axvspan(first, last, color="0.92", zorder=0)
    axes.set(xscale="log", yscale="log", xlabel="period (s)", xlim=(periods[0], periods[-1]))
    axes.set_ylabel(psa_label(units))
    plain_logarithmic(axes)
