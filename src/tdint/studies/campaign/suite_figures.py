"""Figures of suites and of many runs: demands over the height, floor spectra, and derivatives.

A single building has a thin line for each ground motion. Several buildings are plotted next to each
other, each in the color of its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.items import grouped
from tdint.number_parsing import abbreviate, pluralize
from tdint.output.figures.floor_spectra import set_floor_axes
from tdint.output.figures.style import (
    DASHES,
    INK,
    LIGHT,
    MARK,
    FirstPeriods,
    add_legend,
    line_style,
    mark_first_periods,
    new_panels,
    record_name,
    scaled_unit,
    story_ticks,
    titled,
)
from tdint.response.pairs import COMPLETED, MEAN, Run, outcomes_of, suite_text, with_outcomes
from tdint.response.runs.many_results import SCALE, Runs
from tdint.response.runs.outcome import STORY_QUANTITIES, Gradient
from tdint.studies.campaign.story_profiles import (
    DRIFT_RATIO,
    FloorSuite,
    Profile,
    at_levels,
    isolated_base,
    level_text,
    ratios_of,
)
from tdint.studies.motions.scaling_figures import GRAY
from tdint.units import SI, OutputUnits

_MAX_PANELS = 6  # maximum number of panels of floor spectra

_MAX_ROWS = 4
"""Maximum number of levels, which have a row of panels each."""


def profile_picture(
    profiles: Sequence[Profile],
    units: OutputUnits = SI,
    *,
    limit: float | None = None,
    title: str = "",
    member: str = "motion",
) -> Figure:
    """Plot the profiles of buildings, with a row of panels for each level.

    Parameters
    ----------
    limit : float, optional
        Limit of the drift ratio, plotted as a line.
    title : str
        First line of the title for several buildings; the name of a single building replaces it.
    member : str
        Noun for a motion of a profile: `motion` (the default), or `run` for runs that differ in
        other ways.
    """
    units = units.in_figures
    # Each scale factor or level has a row; only the first rows are plotted.
    rows = at_levels(profiles)
    shown = rows[:_MAX_ROWS]
    height = 3.6 if len(shown) == 1 else 2.5
    figure, panels = new_panels(8.0, *[(height, (1, 1, 1))] * len(shown))
    plot_styles = building_styles(profile.building for profile in profiles)
    for axes, row in zip(panels, shown, strict=True):
        by_length = _by_length(row)
        lowest = min(isolated_base(profile.isolators) for profile in row)
        for profile in row:
            base = isolated_base(profile.isolators) - lowest
            peaks = profile.completed.peaks
            drifts = units.of(peaks["peak_drift"], "m") if by_length else 100.0 * peaks[DRIFT_RATIO]
            accelerations = units.of(peaks["peak_absolute_acceleration"], "m/s^2")
            for panel, values in zip(
                axes, (drifts, accelerations, peaks["peak_shear"]), strict=True
            ):
                if len(values):
                    line = partial(_line, panel, by_floor=values is accelerations, base=base)
                    _draw_motions(
                        panel, values, line, plot_styles[profile.building], "largest", member
                    )
        level = row[0].level_text if len(rows) > 1 else ""
        _finish_row(axes, row, units, None if by_length else limit, level)
        if text := _lost_motions_text(row):
            axes[0].set_title(text, loc="left", fontsize=8.0, parse_math=False)
        axes[0].set_xlabel(f"drift ({units.label('m')})" if by_length else "drift (% of height)")
    _add_common_legend(figure, [row[0] for row in panels])
    subject = (
        profiles[0].building if len(plot_styles) == 1 else title or f"{len(plot_styles)} buildings"
    )
    omission = f"; the first {len(shown)} of {len(rows)} levels" if len(rows) > len(shown) else ""
    return titled(figure, f"{subject}\n{_motions_text(shown[0][0], member)}{omission}")


def ratio_picture(profiles: Sequence[Profile], baseline: str) -> Figure:
    """Plot the means of buildings divided by those of a baseline over the stories of the baseline.

    The means are over the motions that both complete (`tdint.studies.campaign.variants.ratios_of`),
    at the first level that has a profile of the baseline.
    """
    level = next(
        level for level in at_levels(profiles) if baseline in [item.building for item in level]
    )
    base = next(profile for profile in level if profile.building == baseline)
    figure, (panels,) = new_panels(8.0, (2.5, (1, 1, 1)), share="y")
    colors = building_styles(profile.building for profile in profiles)
    quantities = (DRIFT_RATIO, "peak_absolute_acceleration", "peak_shear")
    for axes, quantity in zip(panels, quantities, strict=True):
        for profile in level:
            if profile is base:
                continue
            ratios = ratios_of(profile, base, quantity).ratios.mean[1:]
            style = colors[profile.building][0] | {"label": profile.building}
            by_floor = quantity == "peak_absolute_acceleration"
            _line(axes, ratios, by_floor, isolated_base(base.isolators), linewidth=1.9, **style)
        axes.axvline(1.0, color=INK, linewidth=0.8, linestyle=DASHES[1])
        axes.set_xlim(left=0.0)
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    for axes, noun in zip(panels, ("drift", "absolute acceleration", "story shear"), strict=True):
        axes.set_xlabel(f"ratio of {noun}")
    panels[0].set_ylabel("story")
    _add_common_legend(figure, panels[:1])
    level_text = f", {base.level_text}" if len(at_levels(profiles)) > 1 else ""
    common = ", motions that both complete" if _lost_motions_text(level) else ""
    return titled(figure, f"Means divided by those of {baseline}{level_text}{common}")


def _motions_text(profile: Profile, member: str) -> str:
    """Return the numbers of components, recordings and pairs of a profile and the demand of pairs
    for a title."""
    if not profile.pairs:
        text = pluralize(profile.counts.motions, member)
        apart = ", the components of pairs counted separately"
        return f"{text}{apart}" if profile.pair_demand else text
    demand = "mean" if profile.pair_demand == MEAN else "larger"
    return f"{suite_text(profile.motion.tolist())}, {demand} demand of both components"


def _by_length(profiles: Sequence[Profile]) -> bool:
    """Return True if the drift ratios of a building are unknown, because its stories have no
    heights. The figure then shows drifts as lengths."""
    return any(
        profile.counts.completed and np.isnan(profile.completed.peaks[DRIFT_RATIO]).all()
        for profile in profiles
    )


def building_styles(names: Iterable[str]) -> dict[str, tuple[dict[str, Any], str]]:
    """Return the line style and the label of each building, by the name of the building.

    The label is the name with a comma, for the start of a legend entry; empty for a single
    building. The colors follow from the alphabetical order, so that the order of files has no
    effect.
    """
    buildings = sorted(dict.fromkeys(names))
    if len(buildings) == 1:
        return {buildings[0]: ({"color": INK}, "")}
    return {name: (line_style(i), f"{name}, ") for i, name in enumerate(buildings)}


def _add_common_legend(figure: Figure, panels: Iterable[Any]) -> None:
    """Add a legend below all panels that contains each label once."""
    handle_of_label: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        handle_of_label |= dict(zip(labels, handles, strict=True))
    add_legend(figure, list(handle_of_label.values()), list(handle_of_label), least=1)


def _draw_motions(
    axes: Any,
    rows: Array,
    line: Callable[..., Any],
    plot_style: tuple[dict[str, Any], str],
    largest: str,
    member: str = "motion",
) -> None:
    """Plot the values of each ground motion as thin gray lines, and their mean and maximum. For
    several buildings, single ground motions are not plotted.

    `line` plots a row of values with a line style. The plot style is the line style and label of
    the building (`building_styles`); the label of a single building is empty. The label of the
    maximum is `largest` or `envelope`; the noun for a motion is `motion` or `run`.
    """
    style, name = plot_style
    if not name:
        for row in rows:
            line(row, color=GRAY, linewidth=0.7, zorder=1.5)
        noun = "ground motion" if member == "motion" else member
        axes.plot([], [], color=GRAY, linewidth=0.7, label=f"one {noun}")
    line(np.mean(rows, axis=0), linewidth=1.9, label=f"{name}mean", zorder=3, **style)
    # Of several buildings, the thin line has the dashes of the building.
    style = style if name else style | {"linestyle": DASHES[1]}
    line(np.max(rows, axis=0), linewidth=0.9, label=f"{name}{largest}", zorder=2.5, **style)


def _lost_motions_text(profiles: Sequence[Profile]) -> str:
    """Return the text on motions with collapse or without a result, which the lines do not
    contain; empty without such motions."""
    texts = []
    for profile in profiles:
        is_lost = profile.outcome != COMPLETED
        lost = [record_name(profile.motions[index]) for index in np.flatnonzero(is_lost)]
        if lost:
            of = f" of {profile.building}" if len(profiles) > 1 else ""
            names = abbreviate(lost, _MAX_NAMES)
            texts.append(f"{len(lost)} of {len(is_lost)} motions{of} ({names})")
    return f"collapsed or failed, not drawn: {', '.join(texts)}" if texts else ""


_MAX_NAMES = 3  # motions of a building that the title of a row of panels names


def _line(axes: Any, values: Array, by_floor: bool, base: int, **style: Any) -> None:
    """Plot values over the height of a building: values of floors as a line through points, or
    values of stories as steps. `base` isolators that other buildings do not have are below story 1.
    """
    # Story i extends from i - 0.5 to i + 0.5; its floor is at i + 0.5.
    if by_floor:
        axes.plot(values, np.arange(values.size) + 1.5 - base, **style)
        return
    # Each story has two points, at its lower and upper edge.
    # `repeat` doubles all edges of the stories; the outermost edges are needed only one time.
    edges = np.repeat(np.arange(values.size + 1) + 0.5 - base, 2)[1:-1]
    axes.plot(np.repeat(values, 2), edges, **style)


def _finish_row(
    axes: Sequence[Any],
    profiles: Sequence[Profile],
    units: OutputUnits,
    limit: float | None,
    level: str,
) -> None:
    """Add limits, ticks and labels to a row of panels with the lines of all motions (drifts, floor
    accelerations, shears in N).

    `limit` is the marked limit of the drift ratio. `level` is empty if there is a single intensity
    level.
    """
    drifts, accelerations, shears = axes
    if limit is not None:
        drifts.axvline(
            100.0 * limit,
            color=MARK,
            linestyle=DASHES[2],
            label=f"limit {100.0 * limit:g} %",
            zorder=4,
        )
    accelerations.set_xlabel(f"absolute floor acceleration ({units.label('m/s^2')})")
    # The unit of the forces follows from their maximum.
    lines = [line for line in shears.get_lines() if len(line.get_xdata())]
    largest = max((float(np.max(line.get_xdata())) for line in lines), default=0.0)
    factor, unit = scaled_unit(largest, "N", units)
    for line in lines:
        line.set_xdata(np.asarray(line.get_xdata()) * factor)
    shears.relim()
    shears.autoscale_view()
    shears.set_xlabel(f"story shear ({unit})")
    drifts.set_ylabel(f"{level}\nstory" if level else "story")
    bases = [isolated_base(profile.isolators) for profile in profiles]
    low = min(bases) - max(bases)
    max_stories = max(
        profile.height.size - base for profile, base in zip(profiles, bases, strict=True)
    )
    for panel in axes:
        panel.set_ylim(low + 0.5, max_stories + min(bases) + 0.5)
        story_ticks(panel)
        panel.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        panel.set_xlim(left=0.0)
        panel.tick_params(labelleft=panel.get_subplotspec().is_first_col())
        # Panels without lines, because no run has a result, have no axes.
        if not any(profile.counts.completed for profile in profiles):
            panel.set_axis_off()
            if panel is accelerations:
                panel.text(0.5, 0.5, "no complete run", transform=panel.transAxes, ha="center")


def floor_suite_picture(
    suites: Sequence[FloorSuite], units: OutputUnits = SI, periods: FirstPeriods = ()
) -> Figure:
    """Plot the floor spectra of a suite.

    Each floor, scale factor and damping ratio has a panel. A single building has thin gray lines
    for ground motions, and mean and envelope. Several buildings have means and envelopes in their
    colors.

    Parameters
    ----------
    periods : sequence of (str, float)
        Names and first periods of the buildings, s, which are marked; none by default.
    """
    units = units.in_figures
    lowest = min(suite.base for suite in suites)
    # Suites with equal keys have a common panel. An unknown scale factor or level is nan.
    panels = grouped(
        ((suite.place(lowest), repr(suite.scale), repr(suite.level), suite.damping), suite)
        for suite in suites
    )
    shown = list(panels.values())[:_MAX_PANELS]
    height = 3.6 * math.ceil(len(shown) / 2) + 0.8
    figure, (grid,) = new_panels(7.0, (height, (1,) * len(shown)), share="y", columns=2)
    plot_styles = building_styles(suite.building for suite in suites)
    several_scales = len({repr(suite.scale) for suite in suites}) > 1
    for axes, panel_suites in zip(grid, shown, strict=True):
        for suite in panel_suites:
            psa = units.of(suite.psa, "m/s^2")
            line = partial(axes.plot, suite.periods)  # function that plots values over the periods
            _draw_motions(axes, psa, line, plot_styles[suite.building], "envelope")
        set_floor_axes(axes, units)
        mark_first_periods(axes, periods)
        first = panel_suites[0]
        level = level_text(first.scale if several_scales else math.nan, first.level, first.measure)
        damping = f"{100.0 * first.damping:g} % damping"
        axes.set_title(", ".join(filter(None, [first.place(lowest), level, damping])), fontsize=9.0)
    _add_common_legend(figure, grid)
    subject = suites[0].building if len(plot_styles) == 1 else f"{len(plot_styles)} buildings"
    title = f"{subject}, {pluralize(suites[0].counts.motions, 'motion')}\n"
    title += "spectra of absolute floor accelerations"
    if len(panels) > len(shown):
        title += f"; the first {len(shown)} of {len(panels)} panels"
    return titled(figure, title)


# ---- Many runs (peaks over the height), and derivatives of the peak drifts

_MOST_PARAMETERS = 6  # maximum number of panels of derivatives
_MAX_PLAIN_POWER = 3  # power of ten; the axis of smaller values has plain numbers
_COLUMNS = 3  # maximum number of panels in a row


def runs_picture(runs: Runs, units: OutputUnits = SI) -> Figure:
    """Plot the peak responses of many runs over the height, with a row of panels for each scale
    factor.

    Parameters
    ----------
    runs : Runs
        Results of many runs; at least one.
    """
    return profile_picture(run_profiles(runs), units, member="run")


def draw_runs(axes: Any, runs: Runs, units: OutputUnits) -> None:
    """Plot the peak drifts of many runs over the stories.

    Parameters
    ----------
    units : OutputUnits
        Unit of the drifts, if they are lengths.
    """
    profiles = run_profiles(runs)
    by_length = _by_length(profiles)
    plot_styles = building_styles(profile.building for profile in profiles)
    levels = len({profile.level_text for profile in profiles})
    for number, profile in enumerate(profiles):
        peaks = profile.completed.peaks
        drifts = units.of(peaks["peak_drift"], "m") if by_length else 100.0 * peaks[DRIFT_RATIO]
        plot_style = plot_styles[profile.building]
        if levels > 1:
            plot_style = (line_style(number), f"{plot_style[1]}{profile.level_text}, ")
        if len(drifts):
            line = partial(_line, axes, by_floor=False, base=0)
            _draw_motions(axes, drifts, line, plot_style, "largest", "run")
    axes.set_xlabel(f"drift ({units.label('m')})" if by_length else "drift (% of height)")
    axes.set_ylim(0.5, max(profile.height.size for profile in profiles) + 0.5)
    story_ticks(axes)
    axes.set_xlim(left=0.0)
    axes.set_ylabel("story")


def run_profiles(runs: Runs) -> list[Profile]:
    """Return the peak responses of many runs as profiles for figures of suites.

    There is a profile for each building and each scale factor, and each run represents a ground
    motion of the profile. If the scale factor is a sampled parameter, all runs of a building form a
    single profile.

    Raises
    ------
    UsageError
        There are no runs.
    """
    if not len(runs.model):
        raise UsageError("a figure of runs requires at least one run, got none")
    names = [model.name for model in runs.models]
    profiles = []
    is_scale_sampled = SCALE in runs.varied
    scales = [math.nan] if is_scale_sampled else list(dict.fromkeys(runs.scale.tolist()))
    for scale in scales:
        for number, model in enumerate(runs.models):
            # With sampled scale factors, `scale` is nan and all runs are selected.
            has_scale = is_scale_sampled | (runs.scale == scale)
            selected = np.flatnonzero((runs.model == number) & has_scale)
            if not selected.size:
                continue
            outcome = outcomes_of(runs.status[selected])
            n = len(model.stories)
            name = names[number]
            profiles.append(
                Profile(
                    scale,
                    math.nan,
                    # A run is identified by its number in the runs of its building and scale.
                    [Run(index, scale, 0) for index in range(selected.size)],
                    np.arange(selected.size),
                    outcome,
                    outcome,
                    measure=("", ""),
                    pair_demand="",
                    building=name if names.count(name) == 1 else f"{name} ({number + 1})",
                    motions=tuple(runs.records[runs.record[run]].source for run in selected),
                    height=np.array([story.height or math.nan for story in model.stories]),
                    peaks={
                        quantity.name: with_outcomes(
                            getattr(runs.stories, quantity.name)[selected, :n], outcome
                        )
                        for quantity in STORY_QUANTITIES
                    },
                    peak_errors={},
                )
            )
    return profiles


def gradient_picture(gradient: Gradient, units: OutputUnits = SI) -> Figure:
    """Plot the derivatives of the peak drifts over the stories, one panel for each parameter.

    Horizontal lines are estimated errors.

    Parameters
    ----------
    units : OutputUnits
        Must be SI, the default.

    Raises
    ------
    UsageError
        Units other than SI are requested, or the gradient has several runs.
    """
    if units != SI:
        raise UsageError(
            "units cannot be selected for a gradient, because its derivatives are in SI units; "
            "omit units"
        )
    if gradient.peak_drift.ndim > 2:
        raise UsageError(
            "a gradient of many runs has no figure; plot a single run: "
            "gradient.select_run(0).plot()"
        )
    shown = gradient.parameters[:_MOST_PARAMETERS]
    figure, (panels,) = new_panels(7.2, (3.6, (1,) * len(shown)), columns=_COLUMNS)
    errors = gradient.errors.peak_drift if gradient.errors is not None else None
    for number, (axes, name) in enumerate(zip(panels, shown, strict=True)):
        values = gradient.peak_drift[number]
        # Matplotlib writes a power of ten into the corner of a panel, where texts would overlap.
        # The label of the axis contains the power instead.
        largest = float(np.nanmax(np.abs(values), initial=0.0))
        power = math.floor(math.log10(largest)) if largest > 0.0 else 0
        power = 0 if abs(power) <= _MAX_PLAIN_POWER else power
        error = 10.0**-power * errors[number] if errors is not None else None
        values, stories = 10.0**-power * values, np.arange(values.size) + 1.0
        axes.barh(stories, values, height=0.62, color=LIGHT)
        style = {"fmt": "o", "color": INK, "markersize": 3.0, "capsize": 2.0}
        axes.errorbar(values, stories, xerr=error, **style)
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set_ylim(0.5, values.size + 0.5)
        story_ticks(axes)
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        axes.grid(axis="y", visible=False)
        unit = f"1e{power} SI units" if power else "SI units"
        axes.set_xlabel(f"derivative with respect to\n{name} ({unit})")
        axes.set_ylabel("story" if axes.get_subplotspec().is_first_col() else "")
    count = len(gradient.parameters)
    title = f"Derivatives of the peak drifts, {pluralize(count, 'parameter')}\n"
    title += "with estimated errors" if errors is not None else "errors not estimated"
    if len(shown) < count:
        title += f"; the first {len(shown)} of {count} parameters"
    return titled(figure, title)
