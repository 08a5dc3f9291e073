"""Run of a building in two directions: a run for each direction, and the resultants of both.

Both runs have the same method, time step and end. The resultant of a quantity at a time is the
length of the vector (x, y) in plan. Its peak is located between time steps: within a step,
displacements and drifts are the quintics of `tdint.kernels.step_interpolant`, accelerations their
deviations from a straight line, and shears change by the deviation of the drift times the slope of
the force over the drift near the step, or by two slopes if the story yields or unloads in the step
(`_corners`).

The resultant is at least the larger of the peaks x and y of the separate runs, and at most their
SRSS. Its estimated error is the larger of the error from the difference to the resultant of the
additional runs, and the SRSS of the errors of x and y.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import add
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, each_array
from tdint.ground_motion.axes import PairRecord
from tdint.methods.catalogue import parse
from tdint.response.runs import outcome
from tdint.response.runs.error_estimate import extrapolated, factors
from tdint.response.runs.history import History

_Component = Callable[[NDArray[np.intp], Any], Array]
"""Quantity of one direction at fractions of steps, with the arguments of `polynomial`."""

# ---- Peak of a vector


def quintics(u: Array, v: Array, a: Array, h: float) -> Array:
    """Return the coefficients of the quintics through displacements, velocities and accelerations
    at time steps.

    Parameters
    ----------
    u, v, a : ndarray, shape (rows, n)
        Values at the time steps.

    Returns
    -------
    ndarray, shape (6, rows - 1, n)
        Coefficients of s^0 to s^5, with s from 0 to 1 within each step.
    """
    slope, curvature = h * v, 0.5 * h * h * a
    value = u[1:] - u[:-1] - slope[:-1] - curvature[:-1]
    rise = slope[1:] - slope[:-1] - 2.0 * curvature[:-1]
    bend = curvature[1:] - curvature[:-1]
    return np.stack(
        (
            u[:-1],
            slope[:-1],
            curvature[:-1],
            10.0 * value - 4.0 * rise + bend,
            -15.0 * value + 7.0 * rise - 2.0 * bend,
            6.0 * value - 3.0 * rise + bend,
        )
    )


def polynomial(coefficients: Array, step: NDArray[np.intp], s: Any) -> Array:
    """Return values at fractions `s` of steps, from coefficients as of `quintics`. The last
    dimension of `step` and of the values is that of the stories."""
    terms = coefficients[:, step, np.arange(coefficients.shape[2])]
    value = np.asarray(terms[-1])
    for term in terms[-2::-1]:
        value = value * s + term
    return value


def _accelerations(history: History, displacements: Array, h: float) -> Array:
    """Return the coefficients of the absolute accelerations of the floors within each step, from
    the coefficients of the displacements.

    In the notation of `tdint.kernels.step_interpolant`, the deviation from the straight line is
    w s (1 - s) (B + D (1 - 2 s)).
    """
    tilt = 10.0 / h**2 * displacements[5]
    bulge = -12.0 / h**2 * displacements[4] - 3.0 * tilt
    unlimited = np.full_like(tilt, np.inf)
    ratio = np.divide(np.abs(tilt), np.abs(bulge), out=unlimited, where=bulge != 0.0)
    weight = np.clip(2.0 - ratio, 0.0, 1.0)
    bulge, tilt = weight * bulge, weight * tilt
    start, rise = history.absolute_acceleration[:-1], np.diff(history.absolute_acceleration, axis=0)
    return np.stack((start, rise + bulge + tilt, -bulge - 3.0 * tilt, 2.0 * tilt))


_CORNER = 0.05
"""Dimensionless. Change of the slope of a force over the drift from the step before to the step
after a step, relative to the larger slope, above which the step has a corner. Curved laws change
their slope gradually; a single slope is then as accurate."""


def _corners(history: History) -> tuple[Array, Array, Array, Array]:
    """Return the slopes of the forces before and after a corner in each step, N/m, the drifts at
    the corners, m, nan without a corner, and the slopes in steps without a corner, N/m; shapes
    (steps, n).

    The first two slopes are those of the step before and of the step after. The corner is the
    intersection of the line with the first slope through the start and of the line with the second
    slope through the end, both for a story that yields and at a reversal. A gap of the history has
    no corner. The last slope is that of the step with the largest change of the drift, of the step
    and its neighbors, which has no cancellation at reversals: in a linear story the stiffness.
    """
    drift, force, interval = history.drift, history.shear, np.diff(history.time)
    is_step = (interval < 1.5 * interval.min())[:, np.newaxis]
    change, rise = np.where(is_step, np.diff(drift, axis=0), 0.0), np.diff(force, axis=0)
    slope = np.divide(rise, change, out=np.full_like(rise, np.nan), where=change != 0.0)
    padded = np.pad(slope, ((1, 1), (0, 0)), constant_values=np.nan)
    sizes = np.pad(np.abs(change), ((1, 1), (0, 0)))
    slopes, sizes = (
        np.stack((values[1:-1], values[:-2], values[2:])) for values in (padded, sizes)
    )
    largest = np.take_along_axis(slopes, sizes.argmax(axis=0)[np.newaxis], axis=0)[0]
    _, before, after = slopes
    difference = before - after
    has_corner = np.abs(difference) > _CORNER * np.maximum(np.abs(before), np.abs(after))
    corner = np.divide(
        rise + before * drift[:-1] - after * drift[1:],
        difference,
        out=np.full_like(rise, np.nan),
        where=has_corner & is_step,
    )
    return before, after, corner, np.nan_to_num(largest * is_step)


def _shear(history: History, drifts: Array) -> _Component:
    """Return the function of the forces of the stories from the coefficients of the drifts.

    The force deviates from a straight line by the deviation of the drift times a slope. A step with
    a corner has the first slope as long as the drift moves in the direction of its start and has
    not passed the drift of the corner. A step that ends before has no corner.
    """
    before, after, corner, slope = _corners(history)
    rates = np.arange(1.0, len(drifts))[:, np.newaxis, np.newaxis] * drifts[1:]
    is_passed = (history.drift[1:] - corner) * (history.drift[:-1] - corner) <= 0.0
    corner = np.where(is_passed | (rates[0] * rates.sum(axis=0) <= 0.0), corner, np.nan)

    def force(step: NDArray[np.intp], s: Any) -> Array:
        """Return the forces at fractions of steps, N."""
        i, end = (step, np.arange(drifts.shape[2])), (step + 1, np.arange(drifts.shape[2]))
        start, change = history.drift[i], history.drift[end] - history.drift[i]
        moved = polynomial(drifts, step, s) - start
        line = history.shear[i] + s * (history.shear[end] - history.shear[i])
        moves_on = polynomial(rates, step, s) * rates[0][i] > 0.0
        is_first = moves_on & ((start + moved - corner[i]) * (start - corner[i]) > 0.0)
        first = history.shear[i] + before[i] * moved
        second = history.shear[end] + after[i] * (moved - change)
        curved = line + slope[i] * (moved - s * change)
        return np.where(np.isnan(corner[i]), curved, np.where(is_first, first, second))

    return force


_PARTS, _CANDIDATES, _ZOOMS = 4, 4, 7
"""Parts of each step at which a vector is evaluated, number of steps that are searched for its
peak, and of repeated searches, each in a fourteenth of the part before."""
_PARTS_OF_STEP = np.linspace(0.0, 1.0, _PARTS + 1)[:, np.newaxis, np.newaxis]
_PARTS_OF_RANGE = np.linspace(-1.0, 1.0, 33)[:, np.newaxis, np.newaxis]


def peak_of_vector(
    x: _Component, y: _Component, shape: tuple[int, ...]
) -> tuple[Array, Array, Array, Array]:
    """Return the peaks of the length of vectors.

    Parameters
    ----------
    x, y : callable
        Components at fractions of steps, with the arguments of `polynomial`.
    shape : tuple of int
        Numbers of steps and of stories.

    Returns
    -------
    tuple of ndarray, shape (n,)
        Length at the peak, its time in steps, and both components.
    """
    story = np.arange(shape[1])
    step = np.broadcast_to(np.arange(shape[0])[:, np.newaxis], shape)
    lengths = np.hypot(*(part(step, _PARTS_OF_STEP) for part in (x, y)))
    order = np.argsort(-lengths.max(axis=0), axis=0, kind="stable")[:_CANDIDATES]
    s = np.take_along_axis(lengths.argmax(axis=0), order, axis=0) / _PARTS
    for zoom in range(_ZOOMS):
        points = np.clip(s + 14.0**-zoom / _PARTS * _PARTS_OF_RANGE, 0.0, 1.0)
        lengths = np.hypot(x(order, points), y(order, points))
        s = np.take_along_axis(points, lengths.argmax(axis=0)[np.newaxis], axis=0)[0]
    best = lengths.max(axis=0).argmax(axis=0), story
    found = order[best], s[best]
    return lengths.max(axis=0)[best], found[0] + found[1], x(*found), y(*found)


# ---- Resultants of two runs

_OF_HISTORY = ("displacement", "drift", "absolute_acceleration", "shear")
"""Quantities with a resultant between time steps; the names of their peaks begin with `peak_`."""

_NEAR_PEAK = 0.7
"""Dimensionless. Resultants are located near the time steps with a resultant of at least this part
of its maximum: the ends of a step of a quarter of a period are at least .71 of the peak."""


def _components(history: History, h: float) -> dict[str, _Component]:
    """Return the quantities in `_OF_HISTORY` as functions of step and fraction. Gaps of the history
    are straight lines."""
    relative = history.absolute_acceleration - history.ground_acceleration[:, np.newaxis]
    displacements = quintics(history.displacement, history.velocity, relative, h)
    gaps = np.diff(history.time) > 1.5 * h
    displacements[1:, gaps] = 0.0
    displacements[1, gaps] = np.diff(history.displacement, axis=0)[gaps]
    drifts = np.diff(displacements, axis=2, prepend=0.0)
    return {
        "displacement": partial(polynomial, displacements),
        "drift": partial(polynomial, drifts),
        "absolute_acceleration": partial(polynomial, _accelerations(history, displacements, h)),
        "shear": _shear(history, drifts),
    }


def _peaks(histories: Sequence[History], h: float) -> dict[str, tuple[Array, ...]]:
    """Return the peaks of the resultants of the quantities in `_OF_HISTORY` (`peak_of_vector`)."""
    # Slopes of forces need two more steps.
    is_large = np.zeros(len(histories[0].time), dtype=bool)
    for name in _OF_HISTORY:
        ends = np.hypot(*(getattr(history, name) for history in histories))
        is_large |= np.any(ends >= _NEAR_PEAK * ends.max(axis=0), axis=1)
    kept = np.flatnonzero(np.convolve(is_large, np.ones(5), "same"))
    parts = [each_array(lambda array: array[kept], history) for history in histories]
    components = [_components(history, h) for history in parts]
    peaks = {}
    for name in _OF_HISTORY:
        x, y = (part[name] for part in components)
        length, steps, *both = peak_of_vector(x, y, parts[0].drift[1:].shape)
        peaks[name] = length, np.interp(steps, np.arange(len(kept)), kept), *both
    return peaks


def resultants_of(
    responses: Sequence[outcome.Response], histories: Sequence[History]
) -> outcome.Resultants:
    """Return the resultants of the quantities in `_OF_HISTORY`.

    Parameters
    ----------
    responses : sequence of Response
        Runs along x and y with equal time steps and the same end.
    histories : sequence of History
        Their histories.
    """
    h = responses[0].dt
    others, by = _of_additional_runs(responses), factors(parse(responses[0].method))
    result = {}
    for name, (length, steps, x, y) in _peaks(histories, h).items():
        peaks = [getattr(run.stories, f"peak_{name}") for run in responses]
        value = np.clip(length, np.maximum(*peaks), np.hypot(*peaks))
        of_peaks = [
            np.asarray(getattr(run.check.errors, f"peak_{name}")) if run.check else np.nan * length
            for run in responses
        ]
        error = np.hypot(*of_peaks)
        if name in others:
            error = np.maximum(error, extrapolated(value, others[name][0], value, by))
        # A resultant that is the peak of one direction has the error of this peak: a component at
        # right angles that is zero changes the length in the second order only.
        of_larger = np.where(peaks[0] >= peaks[1], *of_peaks)
        result[name] = outcome.Resultant(
            value,
            h * steps,
            np.degrees(np.arctan2(y, x)) % 360.0,
            x=peaks[0],
            y=peaks[1],
            error=np.where(value > np.maximum(*peaks), error, of_larger),
        )
    return outcome.Resultants(**result)


def _of_additional_runs(responses: Sequence[outcome.Response]) -> dict[str, tuple[Array, ...]]:
    """Return the peaks of the resultants of the additional runs up to the end of the runs
    (`_peaks`); empty without the histories of these runs."""
    runs = [
        (run.check.history, run.check.time_steps[0])
        for run in responses
        if run.check and run.check.history and run.check.time_steps
    ]
    if len(runs) < 2:
        return {}
    h = max(step for _, step in runs)
    count = responses[0].steps * round(responses[0].dt / h) + 1
    parts = [
        each_array(lambda array: array[:count], history.every(round(h / step)))
        for history, step in runs
    ]
    return _peaks(parts, h) if all(len(history.time) == count for history in parts) else {}


def _combined(
    x: Any, y: Any, resultants: Mapping[str, Array], heights: Array, larger: bool
) -> dict[str, Array]:
    """Return peaks, or errors of peaks, of both directions by the names of the quantities.

    `resultants` has the values of the quantities with a resultant. Ductilities and damper forces
    are the larger of both directions, and the other quantities the SRSS of both. With `larger`, all
    values are the larger of both directions.
    """
    values = {}
    for name in (quantity.name for quantity in outcome.STORY_QUANTITIES):
        pair = np.abs(getattr(x, name)), np.abs(getattr(y, name))
        is_larger = larger or name in ("ductility", "peak_damper_force")
        values[name] = np.fmax(*pair) if is_larger else np.hypot(*pair)
    if not larger:
        values |= resultants
        values["peak_drift_ratio"] = values["peak_drift"] / heights
    return values


def combined(responses: Sequence[outcome.Response], record: PairRecord | None) -> outcome.Response:
    """Return the response of a building from its runs along x and y, which have kept histories.

    Its peaks are resultants: velocities and total shears at the time steps, residual drifts at the
    end, and the other quantities as in `Resultant`. Ductilities and damper forces are the larger of
    both directions. Energies are sums.
    """
    x, y = responses
    # Both runs end at a collapse that ends a run; the status is that of the first collapse.
    collapses = [run.collapse for run in responses if run.collapse]
    collapse = min(collapses, key=lambda item: item.time, default=None)
    histories = [run.history for run in responses if run.history]
    resultants = resultants_of(responses, histories)
    heights = x.stories.height
    values = {f"peak_{name}": getattr(resultants, name).value for name in _OF_HISTORY}
    for name in ("velocity", "total_shear"):
        peak = f"peak_{name}"
        at_steps = np.hypot(*(getattr(history, name) for history in histories)).max(axis=0)
        values[peak] = np.maximum.reduce(
            [at_steps, *(getattr(run.stories, peak) for run in responses)]
        )
    larger = record is not None and record.larger
    values = _combined(x.stories, y.stories, values, heights, larger)
    stories = replace(x.stories, **values)
    if collapse is not None:
        stories = stories.without_residual()
    check = None
    if x.check and y.check:
        errors = {f"peak_{name}": getattr(resultants, name).error for name in _OF_HISTORY}
        errors = _combined(x.check.errors, y.check.errors, errors, heights, larger)
        check = outcome.ErrorEstimate.of(
            stories,
            outcome.StoryErrors(**errors),
            time_steps=x.check.time_steps or y.check.time_steps,
            method=x.check.method,
            hysteretic_energy=each_array(add, x.check.hysteretic_energy, y.check.hysteretic_energy),
        )
    return replace(
        x,
        record=record,
        status=collapse.status if collapse else "done",
        **{
            name: getattr(x, name) + getattr(y, name)
            for name in ("iterations", "substeps", "branch_changes", "solver_time")
        },
        stories=stories,
        energy=each_array(add, x.energy, y.energy),
        history=None,
        history_chunks=None,
        notes=_texts(x.notes, y.notes),
        warnings=_texts(x.warnings, y.warnings),
        interstep_bound=each_array(np.hypot, x.interstep_bound, y.interstep_bound),
        residual_oscillation=np.hypot(x.residual_oscillation, y.residual_oscillation),
        collapse=collapse,
        check=check,
        growth=max(x.growth, y.growth),
        devices=x.devices and x.devices.larger(y.devices),
        elements=None,
        flexure=None,
        directions=(x, y),
        resultants=resultants,
    )


def _texts(x: Sequence[str], y: Sequence[str]) -> tuple[str, ...]:
    """Return texts on both directions: common texts one time, other texts with their direction."""
    common = [text for text in x if text in y]
    return (
        *common,
        *(f"x: {text}" for text in x if text not in common),
        *(f"y: {text}" for text in y if text not in common),
    )
