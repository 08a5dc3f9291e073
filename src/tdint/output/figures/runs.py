"""Figure of a run: histories, energies, profiles over the height (peaks, what is left), and one hysteresis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    INK,
    LIGHT,
    MARK,
    add_title,
    changed,
    record_name,
    scaled_unit,
    write_note,
)
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import History, Response
    from tdint.ground_motion.record import Record


_NEAR = 0.4  # the collapse drift is shown where the peak reaches this part of it
_SEEN = 0.002  # estimated errors are shown where one reaches this part of the largest peak
_WIDE = 0.01  # the band of the error is drawn where it reaches this part of the largest displacement
_VISIBLE = 0.05  # the drift at the end is shown where it reaches this part of the peak
_APART = 8.0  # the first story's drift over the largest of all others, from which it is that of an isolator
_LAYER = 1e-4  # an energy is drawn that reaches this part of the largest input
_SAME = 1e-9  # times that differ by less than this part are the same
_NAMED = 3  # shocks whose records the title names
_BEYOND = 1.25  # where the bar of an isolator ends, over the largest of all others


def run_picture(response: Response, units: OutputUnits = SI) -> Figure:
    """Picture of a run: ground, roof displacement and energies over time; drifts, floor accelerations and shears over
    the height; the hysteresis of one story. Of a response without its history what is over the height.
    """
    draw = _draw_heights if response.history is None else _draw
    return draw(response, units.in_pictures)


def _draw_heights(response: Response, units: OutputUnits) -> Figure:
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    draw_profiles(figure.subplots(1, 3), response, units)
    add_title(figure, f"{response.model.name}\n{response.method}, dt {response.dt:.4g} s")
    return figure


def _draw(response: Response, units: OutputUnits) -> Figure:
    history = response.history
    assert history is not None
    figure = Figure(figsize=(8.0, 9.4), layout="constrained")
    grid = figure.add_gridspec(4, 1, height_ratios=(1.0, 1.6, 1.9, 3.4))
    if response.record is None:
        roof = figure.add_subplot(grid[:2])
    else:
        ground = figure.add_subplot(grid[0])
        _draw_ground(ground, response.record, history.time[-1], units)
        roof = figure.add_subplot(grid[1], sharex=ground)
    _draw_roof(roof, history, response.stories.peak_displacement[-1], units)
    _draw_energies(figure.add_subplot(grid[2], sharex=roof), response, history, units)
    below = grid[3].subgridspec(1, 4, width_ratios=(1.0, 0.8, 0.8, 1.35))
    profiles = [figure.add_subplot(below[i]) for i in range(3)]
    draw_profiles(profiles, response, units)
    _draw_hysteresis(figure.add_subplot(below[3]), response, history, units)
    _mark_shocks(figure.axes[: 2 if response.record is not None else 1], response)
    title = f"{response.model.name}\n{response.method}, dt {response.dt:.4g} s"
    records = [shock.record for shock in response.shocks] or ([response.record] if response.record else [])
    if records:
        named = [f"{record_name(one.source)} {one.component}".rstrip() for one in records]
        title += f", {', then '.join(named[:_NAMED])}{f' and {len(named) - _NAMED} more' * (len(named) > _NAMED)}"
        title += changed(records)
    if (collapse := response.collapse) is not None:
        title += f"; story {collapse.story} {'failed' if collapse.failed else 'collapsed'} at {collapse.time:.4g} s"
    add_title(figure, title)
    return figure


def _draw_ground(axes: Any, record: Record, end: float, units: OutputUnits) -> None:
    """The samples of the record up to the end of the run, s, whatever its steps."""
    ground, unit = units.of(record.acceleration, "m/s^2"), units.label("m/s^2")
    time = record.dt * np.arange(ground.size)
    if end > time[-1]:  # the ground comes to rest within a sample
        time, ground = np.append(time, [time[-1] + record.dt, end]), np.append(ground, [0.0, 0.0])
    shown = time <= end * (1.0 + _SAME)
    time, ground = time[shown], ground[shown]
    axes.plot(time, ground, color=LIGHT, linewidth=0.8)
    axes.set_ylabel(f"ground ({unit})")
    axes.tick_params(labelbottom=False)
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    _mark_peak(axes, time, ground, float(np.max(np.abs(ground))), unit)


def _mark_shocks(panels: Sequence[Any], response: Response) -> None:
    """Where the shocks of a sequence begin, their numbers above."""
    if not response.shocks:
        return
    for axes in panels:
        for shock in response.shocks[1:]:
            axes.axvline(shock.start, color=MARK, linewidth=0.8, linestyle=DASHES[1])
    for number, shock in enumerate(response.shocks, start=1):
        place = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "xytext": (3, 2)}
        panels[0].annotate(f"shock {number}", (shock.start, 1.0), fontsize=8.0, color=MARK, **place)


def _draw_roof(axes: Any, history: History, peak: float, units: OutputUnits) -> None:
    roof, unit = units.of(history.displacement[:, -1], "m"), units.label("m")
    axes.plot(history.time, roof, color=INK, linewidth=1.0)
    if history.error is not None:
        error = np.abs(units.of(history.error.displacement[:, -1], "m"))
        if np.any(error > _WIDE * np.max(np.abs(roof))):
            band = {"color": MARK, "alpha": 0.35, "linewidth": 0.0, "label": "estimated error"}
            axes.fill_between(history.time, roof - error, roof + error, **band)
            axes.legend(loc="lower right", fontsize=7.0, handlelength=1.6)
    axes.set_ylabel(f"roof displacement\n({unit})")
    axes.tick_params(labelbottom=False)
    axes.set_xlim(history.time[0], history.time[-1])
    _mark_peak(axes, history.time, roof, units.of(peak, "m"), unit)


def _draw_energies(axes: Any, response: Response, history: History, units: OutputUnits) -> None:
    """Where the input energy went: layers of dissipated, damped, stored and kinetic energy below it."""
    energy = history.energy
    given = response.energy.start + energy.input
    factor, unit = scaled_unit(float(np.max(np.abs(given))), "J", units)
    layers = (
        (energy.dissipated, "dissipated by stories", "0.35", None),
        (energy.damping, "damping", "0.62", None),
        (energy.devices, "dashpots", "0.74", "...."),
        (energy.recoverable, "stored", "0.85", None),
        (energy.kinetic, "kinetic", "1.0", "//////"),
    )
    below = np.zeros(len(given))
    for values, label, gray, hatch in layers:
        if np.max(np.abs(values)) <= _LAYER * np.max(np.abs(given)):
            continue
        above = below + factor * values
        axes.fill_between(
            history.time, below, above, facecolor=gray, edgecolor="0.5", hatch=hatch, linewidth=0.0, label=label
        )
        below = above
    axes.plot(history.time, factor * given, color=INK, linewidth=1.2, label="input")
    axes.set(ylabel=f"energy ({unit})", xlabel="time (s)", xlim=(history.time[0], history.time[-1]))
    # Above the panel: inside, it would lie over what it names.
    narrow = {"borderaxespad": 0.0, "columnspacing": 1.2, "handlelength": 1.6}
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.99), ncols=5, reverse=True, **narrow)
    if np.any(given):
        error = f"balance off by {100.0 * abs(response.energy.error):.1g} %"
        axes.set_title(error, loc="right", fontsize=8.0)


def _short(value: float) -> str:
    """Three digits, or all before the point: 51.3, 700, 1060."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _mark_peak(axes: Any, time: Array, values: Array, peak: float, unit: str) -> None:
    """A dot at the largest absolute value, the peak, which may lie between the points, in the upper right corner;
    nothing of what is at rest."""
    if not np.any(values):
        return
    i = int(np.argmax(np.abs(values)))
    axes.plot(time[i], values[i], "o", color=MARK, markersize=4)
    axes.margins(y=0.12)
    write_note(axes, f"peak {_short(peak)} {unit} at {time[i]:.4g} s", x=0.995)


def _draw_hysteresis(axes: Any, response: Response, history: History, units: OutputUnits) -> None:
    story, reason = _telling_story(response, units)
    drift, shear = units.of(history.drift[:, story], "m"), history.shear[:, story]
    if np.isnan(response.stories.ductility[story]):
        # The force of a law that does not yield follows from the drift: its curve, not the chords between the steps.
        order = np.argsort(drift)
        drift, shear = drift[order], shear[order]
    factor, unit = scaled_unit(float(np.max(np.abs(shear))), "N", units)
    axes.plot(drift, shear * factor, color=INK, linewidth=0.8)
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.axvline(0.0, color=LIGHT, linewidth=0.6)
    axes.set_title(f"Story {story + 1}: {reason}", fontsize=8.5)
    axes.set(xlabel=f"drift ({units.label('m')})", ylabel=f"story shear ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))


def _telling_story(response: Response, units: OutputUnits) -> tuple[int, str]:
    """The story whose hysteresis says most, from 0: the largest ductility, else drift ratio, else drift."""
    stories = response.stories
    for values, name, factor, unit in (
        (stories.ductility, "largest ductility", 1.0, ""),
        (stories.peak_drift_ratio, "largest drift", 100.0, " %"),
        (units.of(stories.peak_drift, "m"), "largest drift", 1.0, f" {units.label('m')}"),
    ):
        if np.any(np.isfinite(values)):
            story = int(np.nanargmax(values))
            return story, f"{name}, {factor * values[story]:.3g}{unit}"
    return 0, "no drift"


@dataclass(frozen=True)
class _Drifts:
    """Drifts in percent of the height or a unit of length, shape (n,), and the stories that are drawn apart."""

    peak: Array
    residual: Array
    error: Array | None
    unit: str
    apart: NDArray[np.bool_]

    @classmethod
    def of(cls, response: Response, units: OutputUnits) -> _Drifts:
        """By height where there is one: stories without one are apart, and a first story that slides under the rest."""
        stories = response.stories
        tall = np.isfinite(stories.height)
        by_height = bool(tall.any())
        length = np.full_like(stories.height, 1.0 / units.unit("m")[1])
        scale = 100.0 / np.where(tall, stories.height, 1.0) if by_height else length
        peak, residual = scale * stories.peak_drift, scale * np.abs(stories.residual_drift)
        apart = ~tall if by_height else np.zeros(peak.size, dtype=bool)
        if peak.size > 2 and not apart.any():
            apart[0] = peak[0] > _APART * np.max(peak[1:])
        error = None if response.check is None else scale * response.check.errors.peak_drift
        return cls(peak, residual, error, "%" if by_height else units.label("m"), apart)

    @property
    def largest(self) -> float:
        """The largest of those that are not apart."""
        rest = self.peak[~self.apart]
        return float(np.max(rest)) if rest.size else 0.0


def draw_drifts(axes: Any, response: Response, units: OutputUnits) -> None:
    """The peak drifts over the stories."""
    _draw_drifts(axes, response, units)
    _frame_profile(axes, response)
    axes.set_ylabel("story")


def _frame_profile(axes: Any, response: Response) -> None:
    axes.set_ylim(0.5, response.stories.peak_drift.size + 0.5)
    axes.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlim(left=0.0)


def draw_profiles(panels: Sequence[Any], response: Response, units: OutputUnits) -> None:
    """Three panels over the stories: drifts, absolute accelerations of the floors (the ground below them), shears."""
    drifts, accelerations, shears = panels
    _draw_drifts(drifts, response, units)
    _draw_accelerations(accelerations, response, units)
    _draw_shears(shears, response, units)
    for axes in panels:
        _frame_profile(axes, response)
        axes.tick_params(labelleft=axes is drifts)
    drifts.set_ylabel("story")


def _bars(axes: Any, values: Array, **style: Any) -> None:
    axes.stairs(values, np.arange(values.size + 1) + 0.5, orientation="horizontal", **style)


def _draw_drifts(axes: Any, response: Response, units: OutputUnits) -> None:
    drifts = _Drifts.of(response, units)
    values = np.where(drifts.apart, np.nan, drifts.peak)
    filled = np.nan_to_num(values)
    _bars(axes, filled, fill=True, color=INK, alpha=0.18)
    _bars(axes, filled, color=INK, linewidth=1.4, **({"label": "all shocks"} if response.shocks else {}))
    _draw_drifts_of_shocks(axes, response, drifts)
    largest = drifts.largest
    residual = np.where(drifts.apart, 0.0, drifts.residual)
    if np.any(residual > _VISIBLE * largest):
        _bars(axes, residual, color=MARK, linestyle=DASHES[2], label="at the end of the run")
    if drifts.error is not None and np.any(np.where(drifts.apart, 0.0, drifts.error) > _SEEN * largest):
        places = np.arange(1, values.size + 1)
        errors = np.where(drifts.apart, np.nan, drifts.error)
        axes.errorbar(values, places, xerr=errors, fmt="none", ecolor=INK, capsize=2.0, label="estimated error")
    limit = 100.0 * response.model.collapse_drift
    if drifts.unit == "%" and largest > _NEAR * limit:
        axes.axvline(limit, color=MARK, linestyle=DASHES[1], label=f"collapse drift {limit:g} %")
    _mark_apart(axes, units.of(response.stories.peak_drift, "m"), units.label("m"), drifts)
    if axes.get_legend_handles_labels()[0]:
        # Above the panel: inside, it would lie over the bars.
        axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.0), borderaxespad=0.1, fontsize=7.0, handlelength=1.6)
    axes.set_xlabel(f"drift ({drifts.unit}{' of height' if drifts.unit == '%' else ''})")


def _draw_drifts_of_shocks(axes: Any, response: Response, drifts: _Drifts) -> None:
    """The peaks of each shock of a sequence, as far as there are looks for them."""
    whole = response.stories.peak_drift
    scale = np.divide(drifts.peak, whole, out=np.zeros_like(whole), where=whole > 0.0)
    for number, (shock, color) in enumerate(zip(response.shocks, COLORS[1:], strict=False), start=1):
        values = np.where(drifts.apart, 0.0, scale * shock.stories.peak_drift)
        _bars(axes, values, color=color, linewidth=1.0, linestyle=DASHES[1], label=f"shock {number}")


def _mark_apart(axes: Any, peaks: Array, unit: str, drifts: _Drifts) -> None:
    """A bar off the scale with its length in it."""
    end = _BEYOND * drifts.largest or 1.0
    for place in np.flatnonzero(drifts.apart):
        axes.barh(place + 1, end, height=1.0, facecolor="none", edgecolor=LIGHT, hatch="////", linewidth=0.0)
        text = f"{_short(peaks[place])} {unit}"
        white = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        axes.text(0.5 * end, place + 1, text, ha="center", va="center", fontsize=8.0, color=MARK, bbox=white)
    if drifts.apart.any():
        axes.set_xlim(right=end)


def _draw_accelerations(axes: Any, response: Response, units: OutputUnits) -> None:
    """Points at the floors: that of story 1 lies above it; the ground at the bottom."""
    floors = units.of(response.stories.peak_acceleration, "m/s^2")
    places = np.arange(floors.size + 1) + 0.5
    ground = units.of(response.record.pga, "m/s^2") if response.record is not None else 0.0
    marker = "o" if floors.size <= 20 else None
    axes.plot([ground, *floors], places, color=INK, linewidth=1.2, marker=marker, markersize=3.0, clip_on=False)
    if max(ground, np.max(floors)) > 0.0:
        axes.set_xlim(right=1.08 * max(ground, float(np.max(floors))))
    axes.set_xlabel(f"absolute floor\nacceleration ({units.label('m/s^2')})")


def _draw_shears(axes: Any, response: Response, units: OutputUnits) -> None:
    shears, devices = response.stories.peak_shear, response.stories.peak_damper_force
    total = response.stories.peak_total_shear if np.any(devices) else shears
    factor, unit = scaled_unit(float(np.max(total)), "N", units)
    _bars(axes, factor * shears, fill=True, color=INK, alpha=0.18)
    _bars(axes, factor * shears, color=INK, linewidth=1.4)
    if np.any(devices):
        _bars(axes, factor * total, color=INK, linewidth=1.0, linestyle=DASHES[1], label="with viscous forces")
        _bars(axes, factor * devices, color=INK, linewidth=1.0, linestyle=DASHES[2], label="dashpots")
        axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.0), borderaxespad=0.1, fontsize=7.0, handlelength=1.6)
    axes.set_xlabel(f"story shear ({unit})")
