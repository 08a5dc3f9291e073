"""Figures of many runs (peaks over the height) and of derivatives of the peak drifts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.errors import UsageError
from tdint.model.status import DONE, FALLEN
from tdint.number_parsing import pluralize
from tdint.output.figures.style import INK, LIGHT, titled
from tdint.response.runs.many_results import SCALE, Runs
from tdint.response.runs.outcome import STORY_QUANTITIES, Gradient
from tdint.studies.campaign.chunks import Run
from tdint.studies.campaign.story_profiles import Profile
from tdint.studies.campaign.suite_figures import draw_drift_profiles, profile_picture
from tdint.units import SI, OutputUnits

_MOST_PARAMETERS = 6  # maximum number of panels of derivatives
_MAX_PLAIN_POWER = 3  # power of ten up to which the axis has plain numbers
_COLUMNS = 3  # maximum number of panels in a row


def runs_picture(runs: Runs, units: OutputUnits = SI) -> Figure:
    """Plot the peak responses of many runs over the height, with one row of panels for each scale
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
    draw_drift_profiles(axes, run_profiles(runs), units, member="run")
    axes.set_ylabel("story")
    axes.legend(fontsize=7.0, loc="best")


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
            status = runs.status[selected]
            done = selected[status == DONE]
            collapsed = int(np.count_nonzero(np.isin(status, FALLEN)))
            n = len(model.stories)
            name = names[number]
            profiles.append(
                Profile(
                    scale,
                    math.nan,
                    # A run is identified by its number in the runs of its building and scale.
                    [[Run(int(index), scale, 0)] for index in np.flatnonzero(status == DONE)],
                    collapsed,
                    pairs=0,
                    failed=selected.size - done.size - collapsed,
                    measure=("", ""),
                    pair_demand="",
                    building=name if names.count(name) == 1 else f"{name} ({number + 1})",
                    motions=tuple(runs.records[runs.record[run]].source for run in done),
                    height=np.array([story.height or math.nan for story in model.stories]),
                    peaks={
                        quantity.name: getattr(runs.stories, quantity.name)[done, :n]
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
    columns = min(len(shown), _COLUMNS)
    rows = math.ceil(len(shown) / columns)
    figure = Figure(figsize=(1.2 + 2.6 * columns, 1.0 + 3.0 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    errors = gradient.errors.peak_drift if gradient.errors is not None else None
    for number, (axes, name) in enumerate(zip(panels, shown, strict=False)):
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
        axes.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        axes.grid(axis="y", visible=False)
        unit = f"1e{power} SI units" if power else "SI units"
        axes.set_xlabel(f"derivative with respect to\n{name} ({unit})")
        axes.set_ylabel("story" if number % columns == 0 else "")
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    count = len(gradient.parameters)
    title = f"Derivatives of the peak drifts, {pluralize(count, 'parameter')}\n"
    title += "with estimated errors" if errors is not None else "errors not estimated"
    if len(shown) < count:
        title += f"; the first {len(shown)} of {count} parameters"
    return titled(figure, title)
