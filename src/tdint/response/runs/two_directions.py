"""Run of a building in two directions: a run for each direction, and the resultants of both.

Both runs have the same method, time step and end. The resultant of a quantity at a time is the
length of the vector (x, y) in plan. Its peak is located between time steps: within a step,
displacements and drifts are the quintics of `tdint.kernels.step_interpolant`, accelerations their
deviations from a straight line, and the base shear changes by the deviation of the drift times the
slope of the force over the drift near the step. The convex hull of the Bezier points of a vector
with polynomial components contains its curve, so that only steps with a Bezier point outside of the
largest circle at the time steps are searched.

The resultant is at least the larger of the peaks x and y of the separate runs, and at most their
SRSS. Its estimated error is the SRSS of the errors of x and y. The error of x or y is the larger of
the error of the peak and the error of the history at the time of the resultant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from operator import add
from typing import Any

import numpy as np

from tdint.arrays import Array, each_array
from tdint.errors import UsageError
from tdint.ground_motion.axes import PairRecord
from tdint.response.runs import outcome
from tdint.response.runs.case import Case
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


def lines(values: Array) -> Array:
    """Return the coefficients of straight lines between values at time steps."""
    return np.stack((values[:-1], values[1:] - values[:-1]))


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
        points = np.hypot(bezier @ x_terms, bezier @ y_terms)
        # The first and the last Bezier points are the values at the time steps.
        step = int(np.argmax(points[-1]))
        best = points[-1, step], step + 1.0, x_terms[:, step].sum(), y_terms[:, step].sum()
        if points[0, 0] > best[0]:
            best = points[0, 0], 0.0, x_terms[0, 0], y_terms[0, 0]
        bounds = points.max(axis=0)
        for step in np.flatnonzero(bounds > best[0]).tolist():
            if bounds[step] > best[0]:
                best = max(best, _peak_in_step(x_terms[:, step], y_terms[:, step], step))
        peaks.append(best)
    length, time, x_peak, y_peak = np.array(peaks, dtype=np.float64).T
    return length, time, x_peak, y_peak


def _peak_in_step(x: Array, y: Array, step: int) -> tuple[float, float, float, float]:
    """Return the peak within a step as length, time in steps, and both components."""
    from numpy.polynomial import polynomial

    # Half the derivative of the squared length
    rate = polynomial.polyadd(
        *(polynomial.polymul(values, polynomial.polyder(values)) for values in (x, y))
    )
    roots = polynomial.polyroots(np.trim_zeros(rate, "b")) if rate.any() else np.empty(0)
    s = np.clip(roots.real, 0.0, 1.0)
    s = s if s.size else np.zeros(1)
    components = polynomial.polyval(s, np.column_stack((x, y)))
    lengths = np.hypot(*components)
    best = int(np.argmax(lengths))
    return lengths[best], step + s[best], components[0, best], components[1, best]


# ---- Resultants of two runs

_OF_HISTORY = {
    "displacement": "peak_displacement",
    "drift": "peak_drift",
    "absolute_acceleration": "peak_absolute_acceleration",
    "shear": "peak_shear",
}
"""Quantities with a resultant between time steps, and the names of their peaks."""


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
    histories = [each_array(lambda array: array[:rows], _history(run)) for run in responses]
    polynomials = [_polynomials(history, h) for history in histories]
    result = {}
    for name, peak_name in _OF_HISTORY.items():
        along, across = (terms[name] for terms in polynomials)
        length, steps, x, y = peak_of_vector(along, across)
        peaks = [
            getattr(run.stories, peak_name)
            if rows == len(_history(run).time)
            else peak_of_vector(terms[name], np.zeros_like(terms[name]))[0]
            for run, terms in zip(responses, polynomials, strict=True)
        ]
        row = np.rint(steps).astype(np.int64)
        errors = [_error(run, name, peak_name, row) for run in responses]
        result[name] = outcome.Resultant(
            np.clip(length, np.maximum(*peaks), np.hypot(*peaks)),
            h * steps,
            np.degrees(np.arctan2(y, x)) % 360.0,
            x=peaks[0],
            y=peaks[1],
            error=np.hypot(*errors),
        )
    return outcome.Resultants(**result)


def histories_of(response: outcome.Response) -> list[History]:
    """Return the kept histories along x and y, up to the end of the combined run."""
    rows = response.steps + 1
    return [each_array(lambda array: array[:rows], _history(run)) for run in response.directions]


def _history(response: outcome.Response) -> History:
    """Return the kept history of a run."""
    assert response.history is not None
    return response.history


def _error(response: outcome.Response, name: str, peak_name: str, row: Any) -> Array:
    """Return the estimated errors of a quantity in a direction near the rows of the histories."""
    peaks = getattr(response.stories, peak_name)
    if response.check is None:
        return np.full_like(peaks, np.nan)
    errors = np.asarray(getattr(response.check.errors, peak_name))
    of_history = getattr(_history(response).error, name, None)
    if of_history is not None:
        errors = np.maximum(errors, np.abs(of_history[row, np.arange(len(errors))]))
    return errors


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
    # The resultants end at a collapse, and the run has the status of the first collapse.
    collapses = [run.collapse for run in responses if run.collapse]
    collapse = min(collapses, key=lambda item: item.time, default=None)
    rows = min(len(_history(run).time) for run in responses)
    if collapse is not None:
        rows = min(rows, round(collapse.time / x.dt) + 1)
    resultants = resultants_of(responses, rows)
    heights = x.stories.height
    values = {peak: getattr(resultants, name).value for name, peak in _OF_HISTORY.items()}
    for name, of_history in (("peak_velocity", "velocity"), ("peak_total_shear", "total_shear")):
        x_values, y_values = (getattr(_history(run), of_history)[:rows] for run in responses)
        values[name] = np.hypot(x_values, y_values).max(axis=0)
        if rows == len(_history(x).time):
            larger = np.maximum(*(getattr(run.stories, name) for run in responses))
            values[name] = np.maximum(values[name], larger)
    if collapse is not None:
        drifts = [_history(run).drift[rows - 1] for run in responses]
        values["residual_drift"] = np.hypot(*drifts)
    larger = record is not None and record.larger
    values = _combined(x.stories, y.stories, values, heights, larger)
    stories = replace(x.stories, **values)
    check = None
    if x.check and y.check:
        errors = {peak: getattr(resultants, name).error for name, peak in _OF_HISTORY.items()}
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
        energy=type(x.energy)(
            **{
                field.name: add(*(getattr(run.energy, field.name) for run in responses))
                for field in fields(x.energy)
            }
        ),
        history=None,
        history_chunks=None,
        notes=_texts(x.notes, y.notes),
        warnings=_texts(x.warnings, y.warnings),
        interstep_bound=each_array(np.hypot, x.interstep_bound, y.interstep_bound),
        residual_oscillation=np.hypot(x.residual_oscillation, y.residual_oscillation),
        collapse=collapse,
        check=check,
        growth=max(x.growth, y.growth),
        devices=None,
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

    With a tolerance, both directions have the smaller of their time steps. A run that ends before
    the other run is repeated up to the same end, unless a run has collapsed. The histories of
    the directions are kept if `keep`.

    Raises
    ------
    FailedRun
        A direction failed.
    """
    assert case.across is not None
    cases = [replace(case, across=None), case.across]
    _check_durations(case, settings)
    run = partial(integrate, history=True, history_errors=settings.check)
    responses = [run(part, settings, tolerance=tolerance) for part in cases]
    note: tuple[str, ...] = ()
    if responses[0].dt != responses[1].dt:
        h = min(response.dt for response in responses)
        note = (f"both directions have the time step {h:.6g} s, the smaller of their steps",)
        settings = replace(settings, dt=h)
        responses = [
            response if response.dt == h else run(part, settings)
            for part, response in zip(cases, responses, strict=True)
        ]
    steps = max(response.steps for response in responses)
    if not any(response.collapse for response in responses):
        end = replace(settings, duration=steps * responses[0].dt, until_rest=False)
        end = replace(end, dt=responses[0].dt)
        responses = [
            response if response.steps == steps else run(part, end)
            for part, response in zip(cases, responses, strict=True)
        ]
    record = case.record if isinstance(case.record, PairRecord) else None
    response = combined(responses, record)
    if not keep:
        without = [replace(part, history=None, history_chunks=None) for part in responses]
        response = replace(response, directions=tuple(without))
    return replace(response, notes=(*response.notes, *note, LIMITS_OF_METHOD))


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
