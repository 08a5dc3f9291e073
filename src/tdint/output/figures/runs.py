"""Figures of runs: response histories, energies, profiles over the height, one hysteresis loop, and
the drifts of two directions in plan.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.arrays import Array, max_absolute
from tdint.ground_motion.record import Record
from tdint.model.story import is_linear
from tdint.number_parsing import table_number
from tdint.output.figures.loads import active_interval, draw_loads
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    INK,
    LIGHT,
    MARK,
    ZERO,
    Style,
    changed,
    drift_scale,
    line_style,
    motion_name,
    new_axes,
    new_panels,
    over_stories,
    scaled_unit,
    story_ticks,
    titled,
    write_note,
)
from tdint.response.runs.history import History
from tdint.response.runs.outcome import Response
from tdint.units import SI, OutputUnits

# Parts that would be too small to be visible are omitted from the figures.
_MIN_COLLAPSE_FRACTION = 0.8
"""Minimum peak drift, as a fraction of the collapse drift, of a figure with the collapse drift. For
smaller drifts, the axis would have to be extended, which reduces the profile."""
_MIN_ERROR = 0.002  # minimum estimated error that is shown, as a fraction of the maximum drift
_MIN_BAND = 0.01
"""Minimum estimated error that is shown as a band, as a fraction of the maximum displacement."""
_MIN_RESIDUAL = 0.05  # minimum residual drift that is shown, as a fraction of the peak drift
_MIN_ENERGY = 1e-4  # minimum energy that is shown, as a fraction of the maximum input energy
_ROUNDING = 1e-9  # maximum relative difference of times or accelerations that count as equal
_MAX_NAMED = 3  # maximum number of events that the title names
_MAX_DEVICES = 4  # maximum number of attachments and of links in a figure
_SEPARATE_BAR = 1.25
"""Length of the hatched bar of an isolator or of a story without a height, divided by the longest
bar of the other stories. Its drift is written as text, because it is not to the scale of the axis.
"""


def run_picture(response: Response, units: OutputUnits = SI) -> Figure:
    """Plot the response of a building to a ground motion or to initial conditions.

    The figure shows the ground motion, the forces from tables, the roof displacement and energies
    over time; strokes of attachments over time and loops of links; drifts, floor accelerations and
    shears over the height; and the hysteresis loop of a story.

    Parameters
    ----------
    response : Response
        Result of the run. Without a response history, only the quantities over the height are
        shown.
    """
    units, history, model = units.in_figures, response.history, response.model
    title = f"{model.name}\n{response.method}, dt {response.dt:.4g} s"
    if history is None:
        figure, (profiles,) = new_panels(7.0, (4.2, (1, 1, 1)))
        draw_profiles(profiles, response, units)
        return titled(figure, title)
    # The first rows contain the ground motion and the forces.
    has_loads = bool(model.excitation.tables)
    upper_count = (response.record is not None) + has_loads
    rows: list[tuple[float, tuple[int, ...]]] = [(1.4, (1,))] * upper_count
    rows += [(1.5 if upper_count else 2.7, (1,)), (1.7, (1,))]
    if history.devices is not None:
        rows.append((1.9, (1,) * (bool(model.attachments) + bool(model.links))))
    # The loop of a linear law is a straight line.
    has_loop = model.matrices is not None or not all(map(is_linear, model.stories))
    figure, panels = new_panels(8.0, *rows, (3.4, (5, 5, 5, 6) if has_loop else (1, 1, 1)))
    upper = [axes for (axes,) in panels[:upper_count]]
    (roof,), (energies,) = panels[upper_count : upper_count + 2]
    if response.record is not None:
        _draw_ground(upper[0], response.record, history.time[-1], units)
    if has_loads:
        draw_loads(upper[-1], model.excitation, history.time[-1], units)
    for panel in upper:
        # A short pulse has a separate time axis.
        if panel.get_xlim() == (0.0, history.time[-1]):
            panel.sharex(roof)
            panel.tick_params(labelbottom=False)
    _draw_roof(roof, response, history, units)
    energies.sharex(roof)
    _draw_energies(energies, response, history, units)
    if history.devices is not None:
        _draw_devices(panels[-2], response, history, units)
    draw_profiles(panels[-1][:3], response, units)
    for loop in panels[-1][3:]:
        story, reason = loop_story(response, units)
        _draw_loop(loop, response, history, story, units)
        loop.set_title(f"Story {story + 1}, {reason}", fontsize=8.5)
    _mark_events([*upper, roof], response)
    if response.record is not None and response.record.pga > 0.0:
        _show_strong_motion(roof, energies, response.record, history)
    return titled(figure, title + _run_subject(response))


def _show_strong_motion(roof: Any, energies: Any, record: Record, history: History) -> None:
    """Limit the common time axis to the strong motion, if this is much shorter than the run: from
    the first to the last time where the ground acceleration, or the distance of the roof from
    its final position, is at least `_STRONG` times its peak.
    """
    ground = np.interp(history.time, record.time, record.acceleration, right=0.0)
    displacement = history.displacement[:, -1]
    firsts, lasts = [], []
    for values, rest in ((ground, 0.0), (displacement, displacement[-1])):
        limit = _STRONG * (max_absolute(values) or math.inf)
        firsts += history.time[np.abs(values - values[0]) >= limit][:1].tolist()
        lasts += history.time[np.abs(values - rest) >= limit][-1:].tolist()
    start, end = history.time[0], history.time[-1]
    first, last = min(firsts, default=start), max(lasts, default=end)
    if last - first < _MAX_STRONG * (end - start):
        margin = 0.02 * (last - first)
        roof.set_xlim(max(first - margin, start), min(last + margin, end))
        energies.set_xlabel("time (s), strong motion only")


_STRONG, _MAX_STRONG = 0.05, 0.8
"""Minimum fraction of the peak in strong motion, and the largest duration of the strong motion
divided by the duration of the run for which the time axis is limited."""


def _draw_ground(axes: Any, record: Record, end: float, units: OutputUnits) -> None:
    """Plot the ground acceleration up to the end of the run, s, and mark its peak.

    All samples are shown, independently of the time steps of the run.
    """
    motion, unit = units.of(record.acceleration, "m/s^2"), units.label("m/s^2")
    time = record.time
    if end > time[-1]:
        # The ground acceleration returns to zero within one sampling interval after the record.
        time = np.append(time, [time[-1] + record.dt, end])
        motion = np.append(motion, [0.0, 0.0])
    shown = time <= end * (1.0 + _ROUNDING)
    time, motion = time[shown], motion[shown]
    axes.plot(time, motion, color=LIGHT, linewidth=0.8)
    axes.set(ylabel=f"ground ({unit})", xlim=active_interval([(time, motion)], end))
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    # After a collapse, the run ends before the record, and the peak ground acceleration can be
    # later than the end of the figure.
    pga = units.of(record.pga, "m/s^2")
    shown_peak = max_absolute(motion)
    later = f", PGA {_short(pga)} {unit} later" if pga > shown_peak * (1.0 + _ROUNDING) else ""
    _mark_peak(axes, time, motion, shown_peak, unit, later)


def _mark_events(panels: Sequence[Any], response: Response) -> None:
    """Mark the start of each event of a sequence of ground motions by a vertical line, with the
    number of the event in the first panel.
    """
    for axes in panels:
        for event in response.events[1:]:
            axes.axvline(event.start, color=MARK, linewidth=0.8, linestyle=DASHES[1])
    position: Style = {
        "xycoords": ("data", "axes fraction"),
        "textcoords": "offset points",
        "xytext": (3, 2),
        "annotation_clip": False,
    }
    for number, event in enumerate(response.events, start=1):
        panels[0].annotate(
            f"shock {number}", (event.start, 0.0), fontsize=8.0, color=MARK, **position
        )


def _run_subject(response: Response) -> str:
    """Return the names of the ground motions and the time of collapse of a run, for its title.

    The text starts with a comma, or is empty for a run without ground motion and collapse.
    """
    text = ""
    records = [event.record for event in response.events]
    if not records and response.record:
        records = [response.record]
    if records:
        names = [motion_name(record) for record in records]
        text += f", {', then '.join(names[:_MAX_NAMED])}"
        if len(names) > _MAX_NAMED:
            text += f" and {len(names) - _MAX_NAMED} more"
        text += changed(records)
    if (collapse := response.collapse) is not None:
        verb = "failed" if collapse.failed else "collapsed"
        text += f"; story {collapse.story} {verb} at {collapse.time:.4g} s"
    return text


def _draw_roof(axes: Any, response: Response, history: History, units: OutputUnits) -> None:
    """Plot the roof displacement over the time, its estimated error as a band, and a collapse.

    The band is omitted if it would be too narrow to be visible. The peak may occur between the
    points of the history.
    """
    peak = response.stories.peak_displacement[-1]
    roof, unit = units.of(history.displacement[:, -1], "m"), units.label("m")
    axes.plot(history.time, roof, color=INK, linewidth=1.0)
    if history.error is not None:
        error = np.abs(units.of(history.error.displacement[:, -1], "m"))
        if np.any(error > _MIN_BAND * max_absolute(roof)):
            band = {"color": MARK, "alpha": 0.35, "linewidth": 0.0, "label": "estimated error"}
            axes.fill_between(history.time, roof - error, roof + error, **band)
    if (collapse := response.collapse) is not None:
        at_collapse = np.interp(collapse.time, history.time, roof)
        mark = {"color": MARK, "markersize": 7, "linestyle": "none", "zorder": 4}
        axes.plot(collapse.time, at_collapse, "x", label="collapse", clip_on=False, **mark)
    axes.set(ylabel=f"roof displacement\n({unit})", xlim=(history.time[0], history.time[-1]))
    axes.tick_params(labelbottom=False)
    _mark_peak(axes, history.time, roof, units.of(peak, "m"), unit)


def _draw_energies(axes: Any, response: Response, history: History, units: OutputUnits) -> None:
    """Plot dissipated, viscous, strain and kinetic energy as layers below the input energy, and
    state the error of the energy balance. Layers that are too thin to be visible are omitted.
    """
    energy = history.energy
    total_input = response.energy.initial + energy.input
    factor, unit = scaled_unit(max_absolute(total_input), "J", units)
    layers = (
        (energy.hysteretic, "hysteretic", "0.35", None),
        (energy.viscous, "damping", "0.62", None),
        (energy.dampers, "dashpots", "0.74", "...."),
        (energy.strain, "stored", "0.85", None),
        (energy.braces, "braces", "0.92", "...."),
        (energy.kinetic, "kinetic", "1.0", "//////"),
    )
    bottom = np.zeros(len(total_input))
    for values, label, gray, hatch in layers:
        if max_absolute(values) <= _MIN_ENERGY * max_absolute(total_input):
            continue
        top = bottom + factor * values
        axes.fill_between(
            history.time,
            bottom,
            top,
            facecolor=gray,
            edgecolor="0.5",
            hatch=hatch,
            linewidth=0.0,
            label=label,
        )
        bottom = top
    axes.plot(history.time, factor * total_input, color=INK, linewidth=1.2, label="input")
    axes.set(ylabel=f"energy ({unit})", xlabel="time (s)", xlim=(history.time[0], history.time[-1]))
    axes.legend(reverse=True)
    # The number of ticks must not depend on the width, which depends on their labels.
    axes.xaxis.set_major_locator(MaxNLocator(8))
    if np.any(total_input):
        percent = float(f"{100.0 * abs(response.energy.error):.1g}")
        error = f"energy balance error {table_number(percent)} %"
        axes.set_title(error, loc="right", fontsize=8.0)


def _draw_devices(
    panels: Sequence[Any], response: Response, history: History, units: OutputUnits
) -> None:
    """Plot the strokes of attachments over time, and the forces of links (spring and dashpot) over
    their deformations, in one panel each.

    Of many attachments or links, only the devices with the largest values are shown.
    """
    devices, peaks, model = history.devices, response.devices, response.model
    assert devices is not None and peaks is not None
    count, names = len(model.attachments), [item.name for item in model.devices]
    deformation, unit = units.of(devices.drift, "m"), units.label("m")
    if model.attachments:
        axes = panels[0]
        strokes = peaks.stories.peak_drift[:count]
        for number, i in enumerate(np.argsort(-strokes)[:_MAX_DEVICES].tolist()):
            label = f"{names[i]}, {_short(units.of(float(strokes[i]), 'm'))} {unit}"
            _draw_line(axes, history.time, deformation[:, i], number, label)
        axes.set(xlabel="time (s)", ylabel=f"stroke ({unit})")
        axes.set_xlim(history.time[0], history.time[-1])
    if model.links:
        axes = panels[-1]
        forces = devices.shear + devices.damper_force
        largest = np.abs(forces[:, count:]).max(axis=0)
        factor, force_unit = scaled_unit(float(largest.max()), "N", units)
        for number, i in enumerate(np.argsort(-largest)[:_MAX_DEVICES].tolist()):
            column = count + i
            _draw_line(
                axes, deformation[:, column], factor * forces[:, column], number, names[column]
            )
        axes.set(xlabel=f"deformation of link ({unit})", ylabel=f"force of link ({force_unit})")
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))


def _draw_line(axes: Any, x: Array, y: Array, number: int, label: str) -> None:
    """Plot the line of an attachment or link."""
    axes.plot(x, y, linewidth=0.8, label=label, zorder=3 - 0.1 * number, **line_style(number))


def _short(value: float) -> str:
    """Return a value as text with three digits, or with all digits before the decimal point, such
    as 51.3 or 1060."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _mark_peak(
    axes: Any, time: Array, values: Array, peak: float, unit: str, more: str = ""
) -> None:
    """Mark the maximum absolute value and write the peak above the panel.

    The peak may occur between the points. Its text has the sign of the marked point. A quantity
    that is zero is not marked.

    `more` is the text after the peak; empty by default.
    """
    if not np.any(values):
        return
    i = int(np.argmax(np.abs(values)))
    axes.plot(time[i], values[i], "o", color=MARK, markersize=4)
    axes.margins(y=0.12)
    peak = math.copysign(peak, values[i])
    write_note(axes, f"peak {_short(peak)} {unit} at {time[i]:.4g} s{more}")


def loop_picture(response: Response, story: int, units: OutputUnits = SI) -> Figure:
    """Plot the hysteresis loop of a story in a separate figure.

    Parameters
    ----------
    response : Response
        Result of the run, with its response history.
    story : int
        Story, from 1.
    """
    history, units = response.history, units.in_figures
    assert history is not None
    figure, axes = new_axes(8.0, 3.4)
    _draw_loop(axes, response, history, story - 1, units)
    drift = units.text(float(response.stories.peak_drift[story - 1]), "m")
    return titled(figure, f"{response.model.name}: story {story}, maximum drift {drift}")


def loop_story(response: Response, units: OutputUnits = SI) -> tuple[int, str]:
    """Select the story of the hysteresis loop in the figure of a run.

    It is the isolator with the maximum drift, or the story with the maximum ductility. If no law
    has a yield drift, it is the story with the maximum drift ratio or, if no story has a height,
    with the maximum drift.

    Returns
    -------
    story : int
        Index of the story, from 0.
    reason : str
        Reason for the selection, such as "ductility 3.2".
    """
    stories = response.stories
    story, reason = 0, "no drift"
    isolators = [item.isolator for item in response.model.stories]
    for values, name, factor, unit in (
        (
            units.of(np.where(isolators, stories.peak_drift, math.nan), "m"),
            "isolator",
            1.0,
            f" {units.label('m')}",
        ),
        (stories.ductility, "ductility", 1.0, ""),
        (stories.peak_drift_ratio, "drift", 100.0, " %"),
        (units.of(stories.peak_drift, "m"), "drift", 1.0, f" {units.label('m')}"),
    ):
        if np.any(np.isfinite(values)):
            story = int(np.nanargmax(values))
            reason = f"{name} {factor * values[story]:.3g}{unit}"
            break
    return story, reason


def _draw_loop(
    axes: Any, response: Response, history: History, story: int, units: OutputUnits
) -> None:
    """Plot the shear of a story over its drift.

    `story` is the story, from 0.
    """
    stories = response.stories
    drift, shear = units.of(history.drift[:, story], "m"), history.shear[:, story]
    # In models of matrices, the force of a story also depends on the drifts of other stories.
    if np.isnan(stories.ductility[story]) and response.model.matrices is None:
        # The force of a law without yielding is a function of the drift. Points in the order of
        # their drifts show this curve; in the order of time, long lines would connect them.
        order = np.argsort(drift)
        drift, shear = drift[order], shear[order]
    factor, unit = scaled_unit(max_absolute(history.shear), "N", units)
    axes.plot(drift, shear * factor, color=INK, linewidth=0.8, zorder=3)
    # The loops of all other stories are behind the loop of this story.
    others = np.arange(stories.ductility.size) != story
    if others.any():
        behind: Style = {"color": LIGHT, "linewidth": 0.3, "zorder": -1}
        x, y = units.of(history.drift[:, others], "m"), factor * history.shear[:, others]
        axes.plot(x, y, **behind)[0].set_label("other stories")
    # The forces of the elements of the story are plotted below its loop.
    elements, element_force = response.elements, history.element_force
    if elements is not None and element_force is not None:
        drift = units.of(history.drift[:, story], "m")
        for number, column in enumerate(np.flatnonzero(elements.story == story + 1).tolist()):
            axes.plot(
                drift,
                factor * element_force[:, column],
                **line_style(1 + number % (len(COLORS) - 1)),  # the first is that of the story
                linewidth=0.6,
                zorder=0,
                label=elements.element[column],
            )
    axes.axhline(0.0, **ZERO)
    axes.axvline(0.0, **ZERO)
    axes.set(xlabel=f"drift ({units.label('m')})", ylabel=f"story shear ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))


def draw_drifts(axes: Any, response: Response, units: OutputUnits) -> None:
    """Plot the peak drifts of a run over the stories in a panel with limits, ticks and labels.

    Parameters
    ----------
    units : OutputUnits
        Unit of the drifts, if they are lengths.
    """
    _draw_drifts(axes, response, units)
    _frame_profile(axes, response)
    axes.set_ylabel("story")


def _frame_profile(axes: Any, response: Response) -> None:
    """Set the limits and ticks of a panel with values of the stories over the height."""
    axes.set_ylim(0.5, response.stories.peak_drift.size + 0.5)
    story_ticks(axes)
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlim(left=0.0)


def draw_profiles(panels: Sequence[Any], response: Response, units: OutputUnits) -> None:
    """Plot peak drifts, absolute floor accelerations and shears over the height of a building."""
    drifts, accelerations, shears = panels
    stories = response.stories
    _draw_drifts(drifts, response, units)
    # On the axis, story i extends from i - 0.5 to i + 0.5. Its floor is a point at the upper end;
    # the ground is a point at 0.5.
    floors = units.of(stories.peak_absolute_acceleration, "m/s^2")
    ground = 0.0
    if response.record is not None:
        # After a collapse, the run ends before the record.
        count = math.ceil(response.steps * response.dt / response.record.dt) + 1
        samples = response.record.acceleration[:count]
        ground = units.of(max_absolute(samples), "m/s^2")
    plot_style = {
        "color": INK,
        "linewidth": 1.2,
        "marker": "o" if floors.size <= 20 else None,
        "markersize": 3.0,
    }
    accelerations.plot(
        [ground, *floors], np.arange(floors.size + 1) + 0.5, **plot_style, clip_on=False
    )
    if max(ground, np.max(floors)) > 0.0:
        accelerations.set_xlim(right=1.08 * max(ground, float(np.max(floors))))
    accelerations.set_xlabel(f"absolute floor\nacceleration ({units.label('m/s^2')})")
    # With dashpots or P-delta, the total shears are shown in addition to the restoring forces, with
    # dashpots also their forces.
    lines = []
    if response.model.has_dashpots or response.model.has_p_delta:
        label = f"with {response.model.forces_of_total_shear}"
        lines.append((stories.peak_total_shear, DASHES[1], label))
    if np.any(stories.peak_damper_force):
        lines.append((stories.peak_damper_force, DASHES[2], "dashpots"))
    largest = max(
        float(np.max(force)) for force in (stories.peak_shear, *(row[0] for row in lines))
    )
    factor, unit = scaled_unit(largest, "N", units)
    over_stories(shears, factor * stories.peak_shear, fill=True, color=INK, alpha=0.18)
    over_stories(shears, factor * stories.peak_shear, color=INK, linewidth=1.4)
    for force, dashes, label in lines:
        over_stories(
            shears, factor * force, color=INK, linewidth=1.0, linestyle=dashes, label=label
        )
    shears.set_xlabel(f"story shear ({unit})")
    for axes in panels:
        _frame_profile(axes, response)
        is_first = axes.get_subplotspec().is_first_col()
        axes.tick_params(labelleft=is_first)
        axes.set_ylabel("story" if is_first else "")
    # Numbers of four digits would touch each other at more than three ticks.
    shears.xaxis.set_major_locator(MaxNLocator(2, steps=[1, 2, 4, 5, 10]))


def _draw_drifts(axes: Any, response: Response, units: OutputUnits) -> None:
    """Plot peak drifts in percent of the story height, or as lengths if no story has a height. The
    panel also shows residual drifts, estimated errors, the collapse drift and the drifts of the
    events of a sequence, up to the number of colors.

    Isolators and, if drifts are in percent, stories without a height are separate: they have a
    hatched bar with the drift as text. Isolators have larger drifts than stories, and the drift of
    a story without a height cannot be expressed in percent. If all stories are isolators, no story
    is separate.
    """
    stories = response.stories
    # The height of an isolator is nan, also if the model specifies a height. `scale` converts
    # drifts (m) to the unit of the axis.
    has_height = np.isfinite(stories.height)
    in_percent = bool(has_height.any())
    if in_percent:
        scale = 100.0 / np.where(has_height, stories.height, 1.0)
    else:
        scale = np.full_like(stories.height, 1.0 / units.unit("m")[1])
    is_isolator = np.array([story.isolator for story in response.model.stories])
    is_separate = is_isolator | (in_percent & ~has_height)
    is_separate &= not is_separate.all()
    peaks = scale * stories.peak_drift
    shown_peaks = np.nan_to_num(np.where(is_separate, np.nan, peaks))
    maximum = float(np.max(peaks[~is_separate], initial=0.0))
    over_stories(axes, shown_peaks, fill=True, color=INK, alpha=0.18)
    label = {"label": "all events"} if response.events else {}
    over_stories(axes, shown_peaks, color=INK, linewidth=1.4, **label)
    # The factors convert drifts (m) to the unit of the axis; the factor of a story without drift is
    # zero.
    drifts = stories.peak_drift
    factors = np.divide(peaks, drifts, out=np.zeros_like(drifts), where=drifts > 0.0)
    for number, (event, color) in enumerate(
        zip(response.events, COLORS[1:], strict=False), start=1
    ):
        values = np.where(is_separate, 0.0, factors * event.stories.peak_drift)
        over_stories(
            axes, values, color=color, linewidth=1.0, linestyle=DASHES[1], label=f"event {number}"
        )
    residual = np.where(is_separate, 0.0, scale * np.abs(stories.residual_drift))
    if np.any(residual > _MIN_RESIDUAL * maximum):
        over_stories(axes, residual, color=MARK, linestyle=DASHES[2], label="residual drift")
    if response.check is not None:
        errors = np.where(is_separate, np.nan, scale * response.check.errors.peak_drift)
        if np.any(errors > _MIN_ERROR * maximum):
            axes.errorbar(
                np.where(is_separate, np.nan, peaks),
                np.arange(1, peaks.size + 1),
                xerr=errors,
                fmt="none",
                ecolor=INK,
                capsize=2.0,
                label="estimated error",
            )
    limit = 100.0 * response.model.collapse_drift
    if in_percent and maximum > _MIN_COLLAPSE_FRACTION * limit:
        axes.axvline(limit, color=MARK, linestyle=DASHES[1], label=f"collapse drift {limit:g} %")
    end = _SEPARATE_BAR * maximum or 1.0
    for index in np.flatnonzero(is_separate):
        _draw_separate_story(axes, int(index), drifts[index], end, units)
    if is_separate.any():
        axes.set_xlim(right=end)
    axes.set_xlabel("drift (% of height)" if in_percent else f"drift ({units.label('m')})")


def _draw_separate_story(
    axes: Any, index: int, drift: float, end: float, units: OutputUnits
) -> None:
    """Plot a hatched bar over the complete width of the panel, with the drift as text.

    `index` is the index of the story, from 0. `drift` is the peak drift, m. `end` is the end of the
    bar, in units of the axis.
    """
    axes.barh(
        index + 1, end, height=1.0, facecolor="none", edgecolor=LIGHT, hatch="////", linewidth=0.0
    )
    axes.text(
        0.5 * end,
        index + 1,
        f"{_short(units.of(drift, 'm'))} {units.label('m')}",
        ha="center",
        va="center",
        fontsize=8.0,
        color=MARK,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
    )


# ---- Sensitivity

QUANTITY_LABELS = {
    "peak_drift_ratio": "drift ratio",
    "peak_absolute_acceleration": "floor acceleration",
    "peak_roof_displacement": "roof displacement",
    "peak_base_shear": "base shear",
}


_LIMIT = 1.12  # limit of the axes in plan, divided by the resultant


def plan_picture(response: Response, units: OutputUnits = SI) -> Figure:
    """Plot the path of the story with the largest drift in plan, the roof displacements over time,
    and the peak drifts over the height.

    Parameters
    ----------
    response : Response
        Result of a run in two directions with its histories.
    """
    units = units.in_figures
    figure, ((path, drifts), (roofs,)) = new_panels(8.0, (3.4, (1, 1)), (1.6, (1,)))
    stories = response.stories
    ratios = stories.peak_drift_ratio
    story = int(np.argmax(stories.peak_drift if np.isnan(ratios).any() else ratios))
    _draw_path(path, response, story, units)
    _draw_two_roofs(roofs, response, units)
    _draw_two_drifts(drifts, response, units)
    title = f"{response.model.name}\n{response.method}, dt {response.dt:.4g} s"
    if response.record is not None:
        title += f", {motion_name(response.record)}"
    if (collapse := response.collapse) is not None:
        title += f"; collapsed at {collapse.time:.4g} s"
    return titled(figure, title)


def _draw_path(axes: Any, response: Response, story: int, units: OutputUnits) -> None:
    """Plot the drift in y against the drift in x of a story, and its largest resultant."""
    assert response.resultants is not None
    x, y = (units.of(history.drift[:, story], "m") for history in _histories(response))
    peak = response.resultants.drift
    radius = float(units.of(peak.value[story], "m"))
    angle = np.radians(peak.direction[story])
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), color=LIGHT, linewidth=0.8)
    axes.plot(x, y, color=INK, linewidth=0.8)
    end = radius * np.cos(angle), radius * np.sin(angle)
    axes.plot((0.0, end[0]), (0.0, end[1]), color=MARK, linewidth=1.0)
    axes.plot(*end, "o", color=MARK, markersize=4.0)
    axes.set(
        xlim=(-_LIMIT * radius, _LIMIT * radius) if radius else (-1.0, 1.0),
        ylim=(-_LIMIT * radius, _LIMIT * radius) if radius else (-1.0, 1.0),
        aspect="equal",
        xlabel=f"drift in x ({units.label('m')})",
        ylabel=f"drift in y ({units.label('m')})",
    )
    unit = units.label("m")
    axes.set_title(
        f"Story {story + 1}: {radius:.4g} {unit} at {peak.time[story]:.4g} s,\n"
        f"{peak.direction[story]:.3g}° from x",
        fontsize=8.5,
    )


def _histories(response: Response) -> list[History]:
    """Return the kept histories along x and y."""
    return [run.history for run in response.directions if run.history]


def _draw_two_roofs(axes: Any, response: Response, units: OutputUnits) -> None:
    """Plot the roof displacements in both directions over time."""
    for number, history in enumerate(_histories(response)):
        roof = units.of(history.displacement[:, -1], "m")
        axes.plot(history.time, roof, label="xy"[number], **_line(number))
    axes.set(xlabel="time (s)", ylabel=f"roof displacement\n({units.label('m')})")


def _draw_two_drifts(axes: Any, response: Response, units: OutputUnits) -> None:
    """Plot the peak drifts in both directions and their resultants over the height."""
    scale, label = drift_scale(response.stories.height, units)
    for number, part in enumerate(response.directions):
        over_stories(axes, scale * part.stories.peak_drift, label="xy"[number], **_line(number))
    drift = scale * response.stories.peak_drift
    style = {"color": MARK, "linewidth": 1.4, "linestyle": DASHES[1]}
    over_stories(axes, drift, label="resultant", **style)
    axes.set(xlabel=label, ylabel="story", ylim=(0.5, drift.size + 0.5), xlim=(0.0, None))
    axes.yaxis.get_major_locator().set_params(integer=True)


def _line(number: int) -> Style:
    """Return the style of the line of a direction."""
    return line_style(number, 2 * number) | {"linewidth": 1.0}
