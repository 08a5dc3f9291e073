"""Run of a building in two directions: a run for each direction, and the resultants of both.

Both runs have the same method, time step and end. The resultant of a quantity at a time is the
length of the vector (x, y) in plan. Its peak is located between time steps: within a step,
displacements and drifts are the quintics of `tdint.kernels.step_interpolant`, accelerations their
deviations from a straight line, and shears change by the deviation of the drift times the slope of
the force over the drift near the step, or by two slopes if the story yields or unloads in the step
(`_corners`). The convex hull of the Bezier points of a vector
with polynomial components contains its curve, so that only steps with a Bezier point outside of the
largest circle at the time steps are searched.

The resultant is at least the larger of the peaks x and y of the separate runs, and at most their
SRSS. Its estimated error is the larger of the error from the difference to the resultant of the
additional runs, and the SRSS of the errors of x and y. The error of x or y is the larger of the
error of the peak and the error of the history at the time of the resultant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from operator import add
from typing import Any

import numpy as np

from tdint.arrays import Array, each_array
from tdint.errors import UsageError
from tdint.ground_motion.axes import PairRecord
from tdint.methods.catalogue import parse
from tdint.response.runs import outcome
from tdint.response.runs.case import Case
from tdint.response.runs.error_estimate import (
    extrapolated,
    factors,
    without_additional_history,
)
from tdint.response.runs.history import History
from tdint.response.runs.settings import RunSettings

LIMITS_OF_METHOD = (
    "the directions are uncoupled: torsion, biaxial yield surfaces, axial interaction and dampers "
    "that act in both directions are not included"
)


# ---- Peak of a vector with polynomial components


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


def lines(values: Array, terms: int = 2) -> Array:
    """Return coefficients of straight lines between values at time steps; further terms are 0."""
    coefficients = np.zeros((terms, len(values) - 1, *values.shape[1:]))
    coefficients[:2] = values[:-1], np.diff(values, axis=0)
    return coefficients


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
    start, rise = lines(history.absolute_acceleration)
    return np.stack((start, rise + bulge + tilt, -bulge - 3.0 * tilt, 2.0 * tilt))


def _shears(history: History, drifts: Array) -> Array:
    """Return the coefficients of the forces of the stories from the coefficients of the drifts."""
    rise, change = np.diff(history.shear, axis=0), np.diff(history.drift, axis=0)
    # The slope of the step with the largest change of the drift, of the step and its neighbors, has
    # no cancellation at reversals. In a linear story it is the stiffness.
    padded = np.pad(np.abs(change), ((1, 1), (0, 0)))
    nearest = np.argmax(np.stack((padded[1:-1], padded[:-2], padded[2:])), axis=0)
    offset = np.array([0, -1, 1])[nearest]
    step = np.arange(len(change))[:, np.newaxis] + offset
    story = np.arange(change.shape[1])
    slope = np.divide(
        rise[step, story],
        change[step, story],
        out=np.zeros_like(rise),
        where=change[step, story] != 0.0,
    )
    deviation = drifts.copy()
    deviation[0] = history.shear[:-1]
    deviation[1] = rise + slope * (drifts[1] - change)
    deviation[2:] *= slope
    return deviation


_CORNER = 0.05
"""Dimensionless. Change of the slope of a force over the drift from the step before to the step
after a step, relative to the larger slope, above which the step has a corner. Curved laws change
their slope gradually; a single slope is then as accurate."""


def _corners(history: History) -> tuple[Array, Array, Array]:
    """Return the slopes of the forces before and after a corner in each step, N/m, and the drifts
    at the corners, m, shapes (steps, n); nan without a corner.

    The slopes are those of the step before and of the step after. The corner is the intersection
    of the line with the first slope through the start and of the line with the second slope
    through the end, both for a story that yields and at a reversal. A gap of the history has no
    corner.
    """
    drift, force, interval = history.drift, history.shear, np.diff(history.time)
    change, rise = np.diff(drift, axis=0), np.diff(force, axis=0)
    is_step = (interval < 1.5 * interval.min())[:, np.newaxis]
    moves = is_step & (change != 0.0)
    slope = np.divide(rise, change, out=np.full_like(rise, np.nan), where=moves)
    padded = np.pad(slope, ((1, 1), (0, 0)), constant_values=np.nan)
    before, after = padded[:-2], padded[2:]
    difference = before - after
    has_corner = np.abs(difference) > _CORNER * np.maximum(np.abs(before), np.abs(after))
    has_corner &= is_step
    corner = np.divide(
        rise + before * drift[:-1] - after * drift[1:],
        difference,
        out=np.full_like(rise, np.nan),
        where=has_corner,
    )
    return before, after, corner


def _parts_of_step(
    history: History, polynomials: dict[str, Array], corners: tuple[Array, Array, Array], i: Any
) -> list[tuple[float, float, Array]]:
    """Return the parts of the step and story `i` (indices) without a corner of the force: start,
    end and coefficients of the force."""
    step, story = i
    drifts, shears = (polynomials[name][:, step, story] for name in ("drift", "shear"))
    before, after, corner = (values[i] for values in corners)
    if np.isfinite(corner):
        offset = drifts.copy()
        offset[0] -= corner
        roots = np.roots(offset[::-1])
        # At a reversal the polynomial of the drift touches the corner, within the error of both.
        extrema = np.roots(np.polyder(offset[::-1]))
        for found in (roots, extrema):
            s = found.real[(np.abs(found.imag) < 1e-9) & (found.real > 0.0) & (found.real < 1.0)]
            if s.size:
                first, second = before * drifts, after * drifts
                first[0] = history.shear[i]
                second[0] = history.shear[step + 1, story] - second[1:].sum()
                return [(0.0, float(s[0]), first), (float(s[0]), 1.0, second)]
    return [(0.0, 1.0, shears)]


def _peaks_of_shears(
    histories: Sequence[History], polynomials: Sequence[dict[str, Array]]
) -> tuple[Array, Array, Array, Array]:
    """Return the peaks of the resultant shears as `peak_of_vector`, with the corners of the forces
    in the steps."""
    x, y = (terms["shear"] for terms in polynomials)
    corners = [_corners(history) for history in histories]
    largest = []  # absolute values of the components at both ends and at the corner of each step
    for history, (before, _, corner) in zip(histories, corners, strict=True):
        force = np.abs(history.shear)
        at_corner = history.shear[:-1] + before * (corner - history.drift[:-1])
        largest.append(np.fmax(np.fmax(force[:-1], force[1:]), np.abs(at_corner)))
    bounds = np.hypot(*largest)
    has_corner = np.isfinite(corners[0][2]) | np.isfinite(corners[1][2])
    # A step with a corner is a straight line here: its ends count, and not its polynomials.
    smooth = (
        np.where(has_corner, lines(history.shear, len(terms)), terms)
        for terms, history in zip((x, y), histories, strict=True)
    )
    peaks = np.array(peak_of_vector(*smooth))
    near = np.argwhere(has_corner & (bounds > peaks[0]))
    for step, story in near[np.argsort(-bounds[tuple(near.T)])].tolist():
        if bounds[step, story] > peaks[0, story]:
            parts = [
                _parts_of_step(*item, (step, story))
                for item in zip(histories, polynomials, corners, strict=True)
            ]
            for (a, b, x_terms), (c, d, y_terms) in product(*parts):
                part = max(a, c), min(b, d)
                if part[0] < part[1]:
                    found = _peak_in_step(x_terms, y_terms, step, part)
                    peaks[:, story] = max(tuple(peaks[:, story]), found)
    return tuple(peaks)


def peak_of_vector(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """Return the peaks of the length of vectors with polynomial components.

    Parameters
    ----------
    x, y : ndarray, shape (terms, steps, n)
        Coefficients of the components within each step, as from `quintics`.

    Returns
    -------
    tuple of ndarray, shape (n,)
        Length at the peak, its time in steps, and both components.
    """
    terms = len(x)
    # Row i of the matrix is the Bezier point i as a combination of the coefficients.
    bezier = np.array(
        [[math.comb(i, k) / math.comb(terms - 1, k) for k in range(terms)] for i in range(terms)]
    )
    peaks = []
    for x_terms, y_terms in zip(np.moveaxis(x, 2, 0), np.moveaxis(y, 2, 0), strict=True):
        squares = (bezier @ x_terms) ** 2 + (bezier @ y_terms) ** 2
        # The first and the last Bezier points are the values at the time steps.
        step = int(np.argmax(squares[-1]))
        x_end, y_end = x_terms[:, step].sum(), y_terms[:, step].sum()
        best = np.hypot(x_end, y_end), step + 1.0, x_end, y_end
        if squares[0, 0] > squares[-1, step]:
            best = np.hypot(x_terms[0, 0], y_terms[0, 0]), 0.0, x_terms[0, 0], y_terms[0, 0]
        bounds = squares.max(axis=0)
        near = np.flatnonzero(bounds > best[0] ** 2)
        for step in near[np.argsort(-bounds[near])].tolist():
            if bounds[step] > best[0] ** 2:
                best = max(best, _peak_in_step(x_terms[:, step], y_terms[:, step], step))
        peaks.append(best)
    length, time, x_peak, y_peak = np.array(peaks, dtype=np.float64).T
    return length, time, x_peak, y_peak


def _peak_in_step(
    x: Array, y: Array, step: int, part: tuple[float, float] = (0.0, 1.0)
) -> tuple[float, float, float, float]:
    """Return the peak within a part of a step as length, time in steps, and both components."""
    # Half the derivative of the squared length, from the highest power
    order = np.arange(1.0, len(x))
    rate = (np.convolve(x, order * x[1:]) + np.convolve(y, order * y[1:]))[::-1]
    s = np.append(np.clip(np.roots(rate).real, *part), part)
    components = np.polyval(x[::-1], s), np.polyval(y[::-1], s)
    lengths = np.hypot(*components)
    best = int(np.argmax(lengths))
    return lengths[best], step + s[best], components[0][best], components[1][best]


# ---- Resultants of two runs

_OF_HISTORY = ("displacement", "drift", "absolute_acceleration", "shear")
"""Quantities with a resultant between time steps; the names of their peaks begin with `peak_`."""

_NEAR_PEAK = 0.9
"""Dimensionless. Resultants of additional runs are located near the time steps with a resultant of
at least this part of its maximum."""


def _polynomials(history: History, h: float) -> dict[str, Array]:
    """Return the coefficients of the quantities in `_OF_HISTORY` within each step."""
    relative = history.absolute_acceleration - history.ground_acceleration[:, np.newaxis]
    displacements = quintics(history.displacement, history.velocity, relative, h)
    drifts = np.diff(displacements, axis=2, prepend=0.0)
    return {
        "displacement": displacements,
        "drift": drifts,
        "absolute_acceleration": _accelerations(history, displacements, h),
        "shear": _shears(history, drifts),
    }


def resultants_of(responses: Sequence[outcome.Response], rows: int) -> outcome.Resultants:
    """Return the resultants of the quantities in `_OF_HISTORY` up to a row of the histories.

    Parameters
    ----------
    responses : sequence of Response
        Runs along x and y with equal time steps and histories.
    rows : int
        Number of rows of the histories. The peaks in x and y are the peaks of the runs, unless the
        resultants end before a run.
    """
    h = responses[0].dt
    histories = [_history(run, rows) for run in responses]
    polynomials = [_polynomials(history, h) for history in histories]
    others, by = _of_additional_runs(responses, rows), factors(parse(responses[0].method))
    result = {}
    for name in _OF_HISTORY:
        peak = f"peak_{name}"
        length, steps, x, y = _peaks(name, histories, polynomials)
        peaks = [
            getattr(run.stories, peak)
            if rows == len(_history(run).time)
            else peak_of_vector(terms[name], np.zeros_like(terms[name]))[0]
            for run, terms in zip(responses, polynomials, strict=True)
        ]
        value = np.clip(length, np.maximum(*peaks), np.hypot(*peaks))
        of_peaks = [
            np.asarray(getattr(run.check.errors, peak)) if run.check else np.nan * length
            for run in responses
        ]
        # Errors at the time of the resultant, if the histories have errors
        row = np.rint(steps).astype(np.int64), np.arange(len(steps))
        at_time = [getattr(history.error, name, None) for history in histories]
        error = np.hypot(
            *(
                of_peak if errors is None else np.maximum(of_peak, np.abs(errors[row]))
                for of_peak, errors in zip(of_peaks, at_time, strict=True)
            )
        )
        if name in others:
            error = np.maximum(error, extrapolated(value, others[name], value, by))
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


def _peaks(
    name: str, histories: Sequence[History], polynomials: Sequence[dict[str, Array]]
) -> tuple[Array, Array, Array, Array]:
    """Return the peaks of the resultant of a quantity in `_OF_HISTORY` (`peak_of_vector`)."""
    if name == "shear":
        return _peaks_of_shears(histories, polynomials)
    return peak_of_vector(*(terms[name] for terms in polynomials))


def _of_additional_runs(responses: Sequence[outcome.Response], rows: int) -> dict[str, Array]:
    """Return the peaks of the resultants of the additional runs up to a row of the histories, by
    the names of the quantities; empty without the histories of these runs."""
    histories = [run.check.history if run.check else None for run in responses]
    steps = [run.check.time_steps[0] for run in responses if run.check and run.check.time_steps]
    if None in histories or len(steps) < 2:
        return {}
    h = max(steps)
    count = (rows - 1) * round(responses[0].dt / h) + 1
    parts = [
        each_array(lambda array: array[:count], history.every(round(h / step)))
        for history, step in zip(histories, steps, strict=True)
        if history is not None
    ]
    if any(len(history.time) < count for history in parts):
        return {}
    # The peaks are near large values at the time steps. Slopes of forces need two more steps.
    is_large = np.zeros(count, dtype=bool)
    for name in _OF_HISTORY:
        ends = np.hypot(*(getattr(history, name) for history in parts))
        is_large |= np.any(ends >= _NEAR_PEAK * ends.max(axis=0), axis=1)
    kept = np.flatnonzero(np.convolve(is_large, np.ones(5), "same"))
    parts = [each_array(lambda array: array[kept], history) for history in parts]
    polynomials = [_polynomials(history, h) for history in parts]
    gaps = np.diff(kept) > 1
    for history, terms in zip(parts, polynomials, strict=True):
        for name, values in terms.items():  # a straight line is nowhere larger than at its ends
            values[:, gaps] = lines(getattr(history, name), len(values))[:, gaps]
    return {name: _peaks(name, parts, polynomials)[0] for name in _OF_HISTORY}


def histories_of(response: outcome.Response) -> list[History]:
    """Return the kept histories along x and y, up to the end of the combined run."""
    return [_history(run, response.steps + 1) for run in response.directions]


def _history(response: outcome.Response, rows: int | None = None) -> History:
    """Return the first rows of the kept history of a run."""
    assert response.history is not None
    history: History = each_array(lambda array: array[:rows], response.history)
    return history


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
    rows = min(len(_history(run).time) for run in responses)
    resultants = resultants_of(responses, rows)
    heights = x.stories.height
    values = {f"peak_{name}": getattr(resultants, name).value for name in _OF_HISTORY}
    for name in ("velocity", "total_shear"):
        peak = f"peak_{name}"
        at_steps = (getattr(_history(run, rows), name) for run in responses)
        values[peak] = np.hypot(*at_steps).max(axis=0)
        if rows == len(_history(x).time):
            larger = np.maximum(*(getattr(run.stories, peak) for run in responses))
            values[peak] = np.maximum(values[peak], larger)
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
        steps=rows - 1,
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
        devices=_larger_devices(x.devices, y.devices),
        elements=None,
        flexure=None,
        directions=(x, y),
        resultants=resultants,
    )


_ENERGIES = ("dissipated_energy", "dissipated_energy_error")
"""Quantities of attachments and links that are sums over both directions."""


def _larger_devices(
    x: outcome.DevicePeaks | None, y: outcome.DevicePeaks | None
) -> outcome.DevicePeaks | None:
    """Return the larger peaks of attachments and links, which act in both directions separately,
    and the sums of their energies; None unless both directions have the same ones."""
    if x is None or y is None or (x.attachments, x.links) != (y.attachments, y.links):
        return None
    # A fracture is reported with its direction; errors can be unknown in one direction.
    larger: outcome.DevicePeaks = each_array(lambda *values: np.fmax(*np.abs(values)), x, y)
    sums = {name: each_array(add, getattr(x, name), getattr(y, name)) for name in _ENERGIES}
    return replace(larger, fracture_time=None, fracture_drift=None, **sums)


def _texts(x: Sequence[str], y: Sequence[str]) -> tuple[str, ...]:
    """Return texts on both directions: common texts one time, other texts with their direction."""
    common = [text for text in x if text in y]
    return (
        *common,
        *(f"x: {text}" for text in x if text not in common),
        *(f"y: {text}" for text in y if text not in common),
    )


# ---- Runs


def integrate_directions(
    case: Case,
    settings: RunSettings,
    integrate: Callable[..., outcome.Response],
    *,
    tolerance: float | None = None,
    keep: bool = True,
) -> outcome.Response:
    """Integrate a case in both directions and return the combined response (`combined`).

    `integrate` is the function that integrates a case in a direction, with the arguments of
    `tdint.response.runs.run.integrate_case`.

    With a tolerance, both directions have the smaller of their time steps. A run with another end
    is repeated up to the common end. The histories of the directions are kept if `keep`.

    Raises
    ------
    FailedRun
        A direction failed.
    """
    _check_durations(case, settings)
    run = partial(integrate, history=True, history_errors=settings.check)
    responses = [run(part, settings, tolerance=tolerance) for part in case.directions]
    # The building is at rest if both directions are; the second may be run again below.
    rests = [response.time_at_rest for response in responses]

    def completed(
        settings: RunSettings, is_right: Callable[[outcome.Response], bool]
    ) -> list[outcome.Response]:
        """Return the runs, of which those that are not right are repeated with the settings."""
        return [
            response if is_right(response) else run(part, settings)
            for part, response in zip(case.directions, responses, strict=True)
        ]

    h = min(response.dt for response in responses)
    note: tuple[str, ...] = ()
    if any(response.dt != h for response in responses):
        note = (f"both directions have the time step {h:.6g} s, the smaller of their steps",)
    settings = replace(settings, dt=h)
    responses = completed(settings, lambda response: response.dt == h)
    # Both directions end together: at the first collapse that ends a run, or at the later end.
    ended = [item.steps for item in responses if item.collapse and item.collapse.ended]
    steps = min(ended) if ended else max(response.steps for response in responses)
    end = replace(settings, duration=steps * h, until_rest=False)
    responses = completed(end, lambda response: response.steps == steps)
    record = case.record if isinstance(case.record, PairRecord) else None
    response = combined(responses, record)
    responses = [without_additional_history(part) for part in responses]
    if not keep:
        responses = [replace(part, history=None, history_chunks=None) for part in responses]
    at_rest = None if None in rests else max(time for time in rests if time is not None)
    return replace(
        response,
        directions=tuple(responses),
        time_at_rest=None if response.collapse else at_rest,
        notes=(*response.notes, *note, LIMITS_OF_METHOD),
    )


def _check_durations(case: Case, settings: RunSettings) -> None:
    """Raise UsageError if the components have different durations, and the run does not end before
    both."""
    record = case.record
    if not isinstance(record, PairRecord):
        return
    durations = [component.duration for component in record.components]
    end = settings.duration or case.model.analysis.duration or math.inf
    if abs(durations[0] - durations[1]) > 0.5 * record.dt and end > min(durations):
        raise UsageError(
            f"{record.source}: the components of x and y last {durations[0]:.6g} and "
            f"{durations[1]:.6g} s; trim or pad them to the same duration, or end the run before "
            "both with a duration"
        )
