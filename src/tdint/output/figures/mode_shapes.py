"""Figures of natural modes and of response spectrum analyses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from tdint.arrays import Array
from tdint.model.building import period
from tdint.output.figures.spectrum_curves import log_periods
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    LIGHT,
    MARK,
    MARKERS,
    drift_scale,
    line_style,
    mark_first_periods,
    new_axes,
    new_panels,
    over_stories,
    plain_numbers,
    psa_label,
    scaled_unit,
    story_ticks,
    titled,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.model.modes import Modes
    from tdint.response.spectra.modal import ModalResponse
    from tdint.response.spectra.transfer import TransferFunction


_MAX_MODES = 4  # maximum number of modes, because higher modes make the figure crowded
_MAX_MARKED_FLOORS = 20  # maximum number of floors with markers


def mode_picture(modes: Modes, *, name: str, norm: str = "roof") -> Figure:
    """Plot the shapes of the first modes of a building over the floors, without attachments.

    Parameters
    ----------
    modes : Modes
        Modes of the building; at most `_MAX_MODES` are shown.
    norm : str
        Normalization of the shapes: `roof` (1 at the roof, the default), or `participation` (a
        participation factor of 1).
    """
    figure, axes = new_axes(5.4, 5.6)
    draw_modes(axes, modes, norm)
    return titled(figure, name)


def draw_modes(axes: Any, modes: Modes, norm: str = "roof") -> None:
    """Plot the shapes of the first modes over the floors, with their periods in the legend;
    arguments as for `mode_picture`."""
    # The row of the roof is the last row, or is followed by attachments.
    shapes = modes.normalized(norm)[: modes.roof + 1 or None]
    floors = np.arange(len(shapes) + 1)
    axes.axvline(0.0, color=LIGHT, linewidth=0.8)
    for mode in range(min(_MAX_MODES, len(floors) - 1)):
        label = f"mode {mode + 1}, {period(modes.omega[mode]):.4g} s"
        marker = MARKERS[mode] if len(shapes) <= _MAX_MARKED_FLOORS else None
        plot_style = line_style(mode) | {"marker": marker, "markersize": 4.0}
        axes.plot([0.0, *shapes[:, mode]], floors, label=label, clip_on=False, **plot_style)
    story_ticks(axes)
    label = "shape, 1 at the roof" if norm == "roof" else "shape, with a participation factor of 1"
    axes.set(ylim=(0.0, floors[-1]), ylabel="floor", xlabel=label)


class SpectrumAtModes(NamedTuple):
    """Acceleration spectrum with its values at the periods of modes.

    Attributes
    ----------
    periods, psa : ndarray, shape (k,)
        Periods, s, and pseudo-accelerations, m/s^2.
    at_modes : ndarray, shape (n,)
        Pseudo-accelerations at the periods of the modes, m/s^2; nan outside of the spectrum.
    """

    label: str
    periods: Array
    psa: Array
    at_modes: Array


def mode_spectrum_picture(
    periods: Array, mass_ratio: Array, spectrum: SpectrumAtModes | None, units: OutputUnits = SI
) -> Figure:
    """Plot the effective modal masses over the periods, below a spectrum that marks the modes.

    Parameters
    ----------
    periods : ndarray, shape (n,)
        Periods of the modes, s, longest first.
    mass_ratio : ndarray, shape (n,)
        Effective modal masses divided by the total mass.
    spectrum : SpectrumAtModes | None
        Spectrum in the upper panel; None for the masses only.
    """
    units = units.in_figures
    heights = (2.4,) if spectrum is None else (2.4, 1.6)
    figure, panels = new_panels(8.0, *((height, (1,)) for height in heights), share="x")
    mass_axes = panels[-1][0]
    mass_axes.vlines(periods, 0.0, 100.0 * mass_ratio, color=COLORS[0], linewidth=1.6)
    mass_axes.plot(periods, 100.0 * mass_ratio, "o", color=COLORS[0], markersize=3.5)
    mass_axes.set(ylabel="effective modal\nmass (%)", ylim=(0.0, 115.0), xlabel="period (s)")
    shown_periods = [periods[-1], 1.3 * periods[0], *(() if spectrum is None else spectrum.periods)]
    log_periods(mass_axes, np.array([0.9 * min(shown_periods), max(shown_periods)]))
    # Modes with similar periods are not all numbered, because their numbers would overlap. Modes
    # are in the order of decreasing periods.
    last_numbered = math.inf
    for mode, (mode_period, mass) in enumerate(zip(periods, mass_ratio, strict=True), start=1):
        if mode <= _MAX_NUMBERED and math.log(last_numbered / mode_period) > _MIN_DISTANCE:
            position = {"textcoords": "offset points", "xytext": (0.0, 4.0), "ha": "center"}
            name = f"mode {mode}" if mode == 1 else str(mode)
            point = mode_period, 100.0 * mass
            mass_axes.annotate(name, point, **position, fontsize=8.0, color=MARK)
            last_numbered = mode_period
    if spectrum is not None:
        spectrum_axes = panels[0][0]
        spectrum_axes.plot(
            spectrum.periods, units.of(spectrum.psa, "m/s^2"), label=spectrum.label, **line_style(0)
        )
        values = units.of(spectrum.at_modes, "m/s^2")
        spectrum_axes.plot(
            periods, values, "o", color=MARK, markersize=4.0, label="modes", zorder=4
        )
        mark_first_periods(spectrum_axes, [("", float(periods[0]))])
        spectrum_axes.set(ylim=(0.0, None), ylabel=psa_label(units))
    return figure


_MAX_NUMBERED = 6  # maximum number of modes with a number in the figure
_MIN_DISTANCE = 0.2  # minimum difference of ln period between numbered modes


def transfer_picture(result: TransferFunction, units: OutputUnits = SI) -> Figure:
    """Plot amplitudes and phases over the frequency: of the attachments, and of floors, at most
    `_MAX_LINES` in total, but always of the roof."""
    figure, ((amplitude,), (phase,)) = new_panels(7.5, (3.7, (1,)), (1.9, (1,)), share="x")
    floors, devices = len(result.model.stories), len(result.model.attachments)
    # The roof is first, further floors are evenly spaced below it, and attachments follow.
    count = max(1, min(floors, _MAX_LINES - devices))
    of_floors = np.unique(np.rint(np.linspace(floors, 1, count)).astype(int))[::-1] - 1
    shown = [*of_floors.tolist(), *range(floors, floors + min(devices, _MAX_LINES - 1))]
    unit = "1" if result.source == "ground" else "m/N"
    values = units.of(result.amplitude, unit)
    for number, i in enumerate(shown):
        label = "roof" if i == floors - 1 else result.labels[i]
        style = line_style(number)
        text = label if isinstance(label, str) else f"floor {label}"
        amplitude.plot(result.frequency, values[:, i], label=text, **style)
        # A jump from -180 to 180 degrees is not plotted as a line.
        degrees = result.phase[:, i].copy()
        degrees[1:][np.abs(np.diff(degrees)) > 180.0] = math.nan
        phase.plot(result.frequency, degrees, **style)
    text = "floor acceleration / ground acceleration"
    if result.source != "ground":
        text = f"displacement / force on floor {result.source} ({units.label(unit)})"
    amplitude.set(xscale="log", yscale="log", ylabel=text)
    amplitude.set_ylim(max(_MIN_AMPLITUDE * values.max(), values.min()), None)
    phase.set(xlabel="frequency (Hz)", ylabel="phase (degrees)", ylim=(-190.0, 190.0))
    phase.set_xlim(result.frequency[0], result.frequency[-1])
    phase.set_yticks([-180.0, -90.0, 0.0, 90.0, 180.0])
    plain_numbers(phase.xaxis)
    return titled(figure, f"{result.model.name}\nTransfer functions, initial stiffness")


_MAX_LINES = 4  # maximum number of floors and attachments with a line
_MIN_AMPLITUDE = 1e-5  # minimum amplitude in the figure divided by the maximum


def modal_response_picture(result: ModalResponse, units: OutputUnits = SI) -> Figure:
    """Plot the peaks of a response spectrum analysis over the height: drifts, shears and
    displacements, each by SRSS and by CQC.
    """
    figure, ((drift, shear, displacement),) = new_panels(8.8, (4.6, (1, 1, 1)))
    draw_modal_drifts(drift, result, units)
    factor, unit = scaled_unit(float(np.max(result.shear_srss)), "N", units)
    _over_height(
        shear,
        {"SRSS": result.shear_srss * factor, "CQC": result.shear_cqc * factor},
        f"story shear ({unit})",
    )
    displacements = {"SRSS": result.displacement_srss, "CQC": result.displacement_cqc}
    for number, (rule, values) in enumerate(displacements.items()):
        with_ground = np.concatenate(([0.0], units.of(values, "m")))
        floors = np.arange(with_ground.size)
        displacement.plot(with_ground, floors, label=rule, **line_style(number))
    displacement.set(xlim=(0.0, None), ylim=(0, result.period.size), ylabel="floor")
    displacement.set_xlabel(f"displacement ({units.label('m')})")
    displacement.yaxis.get_major_locator().set_params(integer=True)
    return titled(
        figure,
        f"{result.model.name}\nModal peaks under {spectrum_text(result.target.source)}, combined",
    )


def draw_modal_drifts(axes: Any, result: ModalResponse, units: OutputUnits) -> None:
    """Plot story drifts by both combination rules; drift ratios if all stories have heights.

    Parameters
    ----------
    units : OutputUnits
        Unit of the drifts, if they are lengths.
    """
    scale, label = drift_scale(result.height, units)
    _over_height(axes, {"SRSS": result.drift_srss * scale, "CQC": result.drift_cqc * scale}, label)


def _over_height(axes: Any, rows: dict[str, Array], label: str) -> None:
    """Plot values of the stories as steps, and set limits and labels of the panel.

    `rows` contains the values in the unit of the axis, by the combination rule, which is the label
    of the line. `label` is the label of the x axis.
    """
    for number, (rule, values) in enumerate(rows.items()):
        over_stories(
            axes, values, baseline=None, label=rule, linestyle=DASHES[number], color=COLORS[number]
        )
    axes.set(ylim=(0.5, values.size + 0.5), xlim=(0.0, None), ylabel="story", xlabel=label)
    axes.yaxis.get_major_locator().set_params(integer=True)
