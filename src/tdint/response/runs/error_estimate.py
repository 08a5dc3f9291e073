"""Error estimates of the peaks of a run.

By default, the errors of a run are estimated by an additional run (`reference`) with shorter time
steps (`reference_steps`). With the peaks P of the run and the peaks P1 of the additional run, the
estimated error of each P is the maximum of

    f |P - P1|
    the smaller of  COMMON P rms(f |P - P1| / P)  and  _MOST |P - P1|
    FLOOR P
    |P2 - P|                                if the building moves at the start
    the smaller of  B  and  P1 + B1 - P

The factor f depends on the order of the method (`factors`). rms is the root mean square over the
stories. `start_peaks` computes P2. B and B1 are the possible excesses of the peaks between
time steps which do not resolve the motion (`Response.interstep_bound`), of the run and of the
additional run. P1 + B1 is the largest peak that the additional run does not exclude.

The errors of residual drifts have additional terms (`story_errors`, `run_until_rest`).

The estimate is not a bound: the section "Reliability of error estimates" of tests/MEASUREMENTS.md
reports how often it is too small.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tdint.arrays import Array, each_array, join_arrays
from tdint.methods.catalogue import DEFAULT_METHOD, EXACT, parse
from tdint.methods.method import Integrator
from tdint.response.runs.case import Case, extend_to_rest
from tdint.response.runs.compiled_steps import unsupported_reason
from tdint.response.runs.loop_results import all_peaks, columns, with_growth
from tdint.response.runs.outcome import (
    ErrorEstimate,
    EventResponse,
    FailedRun,
    Response,
    StoryErrors,
    StoryPeaks,
)
from tdint.response.time_steps import Steps, finer

if TYPE_CHECKING:
    from tdint.response.runs.contacts import LinkContact
    from tdint.response.runs.elements import ElementValues
    from tdint.response.runs.flexure import FlexureValues

REFERENCE = parse(DEFAULT_METHOD)
"""Method of the additional run that estimates the errors of most methods."""

_MIN_ORDER = 4
"""Minimum order of a method that estimates its own errors. The rates were measured only for
`moment4` without numerical dissipation, which has order 4.
"""

DIFFERENCE_FACTOR = 4.0 / 3.0
"""Dimensionless. Factor f at second order: error of a run divided by its difference from a run with
half the time step, by Richardson extrapolation 1 / (1 - 2^-2). The additional run is far more
accurate than such a run.
"""

COMMON = 0.2
"""Dimensionless. Minimum relative error of a story divided by the root mean square of the relative
errors of all stories. The minimum covers a story where both runs agree by accident. With a value
of 0.5, 7 % of the estimates of accelerations and total shears by methods of order 3 and more are
more than ten times too large (325 random buildings).
"""

_MOST = 8.0
"""Dimensionless. Maximum of the error by `COMMON` divided by the difference of the peaks. The
difference of a story that yields or is protected by other stories is small without an accident, and
its error is small as well. Without this limit, 3 to 6 % of the estimates per column are more than
ten times the true error (104 random buildings).
"""


class EstimateFactors(NamedTuple):
    """Factors of the error estimate, dimensionless.

    Attributes
    ----------
    difference : float
        Factor f of the module docstring.
    most : float
        Maximum as `_MOST`; by default no maximum.
    derivative_common : float
        Factor that replaces `COMMON` in the error estimate of derivatives, which does not use
        `most`.
    """

    difference: float
    most: float = math.inf
    derivative_common: float = COMMON


_LOW_ORDER = EstimateFactors(DIFFERENCE_FACTOR, _MOST)
"""Factors for methods of order 1 and 2."""

_HIGH_ORDER = EstimateFactors(3.0, _MOST, derivative_common=0.5)
"""Factors for methods of at least order 3. The error of both runs depends on the branch changes,
reversals and contacts in their steps. At these, `impulse4` may gain no more than a factor of two by
half the step, so that the difference can be a third of the error. With `_LOW_ORDER`, 0.6 % of the
true errors of `impulse4` and `moment4` exceed twice the estimate, with these factors 0.3 % (104
random buildings).
"""

_MIN_HIGH_ORDER = 3
"""Minimum order of a method with the factors `_HIGH_ORDER`."""

FLOOR = 1e-5
"""Dimensionless. Minimum error estimate divided by the peak. Smaller errors include the tolerances
of iterations and the errors between time steps that both runs have in common.
"""

_LONG_STEP = 5
"""Minimum number of sampling intervals in a time step if the additional run uses the sampling
interval as its time step instead of half the step. With half of such a step, both runs can miss the
same contact, reversal or branch change; the difference of their peaks is then small although both
are wrong. The additional run has half the steps of the additional run of a run with the sampling
interval as its time step.
"""

_PARTS_WITH_STOPS = 3
"""Number of steps of the additional run in a step of a run with stops. The rest of a step after the
closing of a stop has a large error. After a closing in the last half of the step, the additional
run with half the step has the same rest with the same error. With a third of the step, only a
closing in the last third has the same rest, and the other errors differ more. With 2, 3 and 4
parts, .42, .05 and .03 % of the true errors exceed twice the estimate (34 722 values of 293 random
buildings with stops without dashpots), for 1, 1.17 and 1.33 times the processor time of a run with
its estimate. In buildings without stops, no true error of 3688 exceeds twice the estimate with 2
parts.
"""

_LONG_OF_PERIOD, _SHORT_OF_PERIOD, _MOST_PARTS = 20, 50, 50
"""Time steps of the additional run without a record. If the first period contains fewer than
`_LONG_OF_PERIOD` steps of the run, the additional run has about `_SHORT_OF_PERIOD` steps in the
first period, but at most `_MOST_PARTS` in a step of the run. With half of the step instead, 5 % of
the true errors of `impulse4` in free vibration exceed twice the estimate if the step is a fifth or
a tenth of the period (59 random buildings).
"""

_LONGER = 1.5
"""Duration of the run that measures the motion after a run until rest, divided by its duration."""

_SAME = 1e-9
"""Dimensionless. Maximum relative difference of time steps that are considered equal."""

_START, _START_HALVINGS = 2, 4
"""Number of time steps at the start of a building in motion that are repeated with shorter steps,
and number of times that the step of the additional run is halved for this. Two steps detect the
same number of errors as sixteen steps (325 random buildings).
"""

_LATER_FACTOR = 2.0
"""Dimensionless. Error of the run with the shorter steps in `_later_peaks`, divided by the
difference of its two runs. The error of the run with the longer steps is f times the difference
(`_HIGH_ORDER`). The error with the shorter steps is smaller by one difference: f - 1.
"""

_NEAR_START = 0.7
"""Dimensionless. If all later peaks are at most this part of the peaks at the start, `_later_peaks`
omits its second run, because the peaks at the start remain the maxima.
"""

_SLOW_RUN = 2.0
"""Processor time of the time loops, s, above which a note states how to omit the second run."""


def run_with_error_estimate(
    case: Case,
    steps: Steps,
    history: bool = False,
    *,
    history_errors: bool = False,
    begin: Callable[..., Callable[[], Any]] | None = None,
) -> Response:
    """Integrate a case over `steps` and estimate the errors of its peaks.

    Parameters
    ----------
    begin : callable, optional
        Function that starts a call in another process, `begin(function, argument)`, and returns a
        function that waits for its result. The additional run is then simultaneous with the run.
    """
    # Compile the kernels of both methods here, in parallel if both are missing in the cache.
    case.prepared.compile([case.method, reference_method(case)])
    expected = reference_steps(case, replace(steps, continues=False))
    begun = begin(partial(attempt, reference(case)), expected) if begin else None

    def additional(shorter: Steps) -> Response | FailedRun:
        """Return the additional run, unless the run ended at another time than expected."""
        if begun and shorter == expected:
            result: Response | FailedRun = begun()
            return result
        return attempt(reference(case), shorter, history and history_errors)

    response = case.integrate(steps, history)
    return with_error_estimate(
        case,
        steps,
        response,
        history_errors=history_errors,
        growth=response.growth,
        additional=additional,
    )


def reference(case: Case) -> Case:
    """Return the case of the additional run that estimates the errors of `case`."""
    return replace(case.integrated_by(reference_method(case)), runs_on=True)


def reference_method(case: Case) -> Integrator:
    """Return the method of the run that estimates the errors of a case.

    For `moment4` in a building with power-law dashpots or curved laws, the method is `moment4` with
    a larger tolerance of the residuals. In these buildings `moment4` is about as accurate as
    `impulse4` with half the time step, so that a difference between these two methods is the error
    of either method. With `impulse4`, 5.9 % of the estimates of `moment4` are more than ten times
    too large, and 0.5 % of the true errors exceed twice the estimate; with `moment4`, 1.8 and 0.1 %
    (40 random buildings, true values of a separate solver). Curved hysteretic laws are an
    exception: the peak shears of `moment4` at reversals are too small by the same amount with both
    time steps.

    For `impulse4` in a building with power-law dashpots, braces of dampers or tangent damping, the
    method is `moment4` with a quarter of the step. Two runs of `impulse4` can have the same error
    there by accident, because the forces change abruptly within the steps; and the error of
    `moment4` with half the step is often the error of `impulse4`, as both methods are then equally
    accurate. Of 23 046 true errors (600 random buildings, steps of .5 to 2 samples; `python
    tests/grid/additional_runs.py --seed 5 --cases 600`) exceed twice and ten times the estimate:

    - 108 and 8 with `impulse4` and half the step, 17 and 2 with a quarter of the step
    - 70 and 9 with `moment4` and half the step, 3 and 0 with a quarter of the step

    12, 11, 19 and 19 % of the estimates are more than ten times too large, and a run with its
    estimate requires 1, 1.22, 1.34 and 1.75 times the processor time.

    In all other cases, it is the `default_reference_method`. A further run by newmark-average for
    laws that remember from rest would detect one of three errors above twice the estimate in 4500
    values, for 1.7 to 2 times the processor time (MEASUREMENTS, "Reliability of error estimates").
    """
    method, building = case.method.method, case.building
    if other := _other_method(case):
        return other
    is_curved = building.power_damped or building.braced or not building.piecewise_linear
    if (
        method.estimating_coefficients is not None
        and case.method.order >= _MIN_ORDER
        and is_curved
        and not building.curved_hysteresis
    ):
        estimating = replace(method, coefficients=method.estimating_coefficients)
        return replace(case.method, method=estimating)
    return default_reference_method(case)


def _other_method(case: Case) -> Integrator | None:
    """Return the method for error estimates that the method of the case declares for buildings with
    abrupt changes of forces; None for other buildings and methods."""
    declared, building = case.method.method.estimated_by, case.building
    has_abrupt_forces = building.power_damped or building.braced or building.tangent_damped
    other = parse(declared) if declared and has_abrupt_forces else None
    return None if other and unsupported_reason(other, building) else other


def default_reference_method(case: Case) -> Integrator:
    """Return the method that estimates the errors of most methods.

    This method is `impulse4`, or `exact` if the method of the case is `exact` and there are no
    forces on floors. The errors of `exact` are then the errors of the peaks between time steps.
    """
    is_own_reference = case.building.uses_matrices or (
        case.method.label == EXACT and not case.model.excitation.forces
    )
    return parse(EXACT) if is_own_reference else REFERENCE


def reference_steps(case: Case, steps: Steps) -> Steps:
    """Return the time steps of the run that estimates the errors of a run over `steps`.

    They have half the length (`shorter_steps`), or a quarter if another method estimates the errors
    (`reference_method`), or if a method of order 3 and more integrates braces of dampers or tangent
    damping: where their forces have a kink within a step, both steps can miss the same part of a
    total shear. In other buildings with stops they have a third (`_PARTS_WITH_STOPS`). Without a
    record the steps are shorter if the step is long in relation to the first period
    (`_LONG_OF_PERIOD`).
    """
    shorter = (
        shorter_steps(steps) if case.record is not None else _steps_without_record(case, steps)
    )
    has_kinks = case.method.order >= _MIN_HIGH_ORDER and (
        case.building.braced or case.building.tangent_damped
    )
    if has_kinks or _other_method(case):
        return finer(shorter)
    if case.building.has_stops and shorter == finer(steps):
        return finer(steps, _PARTS_WITH_STOPS if steps.stride % 2 else 4)
    return shorter


def _steps_without_record(case: Case, steps: Steps) -> Steps:
    """Return the shorter time steps of a run without a record."""
    periods = steps.h * case.building.vibration.frequency(1) / (2.0 * math.pi)  # h / T1
    if periods <= (1.0 + _SAME) / _LONG_OF_PERIOD:
        return finer(steps)
    parts = min(math.ceil(_SHORT_OF_PERIOD * periods), _MOST_PARTS)
    return finer(steps, parts)


def shorter_steps(steps: Steps) -> Steps:
    """Return the time steps of the run that estimates the errors of a run under a record.

    Their length is half the length of `steps`, or a sampling interval if a step covers at least
    `_LONG_STEP` sampling intervals.
    """
    is_long = steps.per_sample == 1 and steps.stride >= _LONG_STEP
    return finer(steps, steps.stride if is_long else 2)


def with_error_estimate(
    case: Case,
    steps: Steps,
    response: Response,
    *,
    history_errors: bool = False,
    growth: float = 0.0,
    additional: Callable[[Steps], Response | FailedRun] | None = None,
) -> Response:
    """Return a response to `steps` with error estimates from one additional run. The errors of the
    peaks are at least `growth` times the peaks (`Response.growth`).

    `additional` is the function that integrates the `reference` over time steps.

    If the additional run fails or ends earlier by a collapse, the errors are nan and a note states
    the reason. If the run ended by a collapse, both runs are compared up to this end.

    Returns
    -------
    Response
        Response with the error estimate in `check`, and further notes.
    """
    steps = replace(steps, count=response.steps, continues=False)
    shorter = reference_steps(case, steps)
    if response.substeps:
        # Half of a step is a step of the additional run, which would have the same error at this
        # point.
        shorter = finer(shorter)
    other = (additional or partial(attempt, reference(case)))(shorter)
    if isinstance(other, FailedRun):
        return _unknown(response, f"the run with dt {other.dt:.6g} s failed ({other.status})")
    # The additional run covers the time up to the end of the run. It ends at the same time, except
    # for rounding, unless it collapses at least one of its steps earlier.
    if abs(other.steps * other.dt - response.steps * response.dt) > 0.5 * other.dt:
        return _unknown(response, f"the run with dt {other.dt:.6g} s ends at another time")
    start = start_peaks(case, steps)
    errors = story_errors(
        _with_devices(response),
        _with_devices(other),
        factors(case.method),
        start=start,
        stories=len(response.stories.peak_drift) + len(response.model.attachments),
    )
    if response.devices is not None and other.devices is not None:
        count = len(response.model.stories)
        device_errors = columns(errors, slice(count, None))
        errors = columns(errors, slice(count))
        more: dict[str, Any] = {}
        for name in ("dissipated_energy", "inerter_force"):
            own, finer_value = getattr(response.devices, name), getattr(other.devices, name)
            if own is not None:
                error = extrapolated(own, finer_value, np.abs(own), factors(case.method))
                more[f"{name}_error"] = error
        devices = replace(response.devices, errors=device_errors, **more)
        response = replace(response, devices=devices)
    errors = with_growth(errors, response.stories, growth) if growth else errors
    if response.flexure is not None and other.flexure is not None:
        flexure = flexure_errors(response.flexure, other.flexure, growth)
        response = replace(response, flexure=replace(response.flexure, errors=flexure))
    check = ErrorEstimate.of(
        response.stories,
        errors,
        elements=element_errors(response, other, factors(case.method), errors, start),
        hysteretic_energy=extrapolated(
            response.hysteretic_energy,
            other.hysteretic_energy,
            response.hysteretic_energy,
            factors(case.method),
        ),
        time_steps=(other.dt,),
        method=other.method,
        corrected=other.stories,
        of_contacts=partial(contact_errors, replace(other, history=None), factors(case.method))
        if case.building.has_stops
        else None,
    )
    # At a collapse the peaks grow rapidly within one step, so that the peaks of the additional run
    # are not more accurate values of the same peaks.
    if response.collapse is not None and response.collapse.ended:
        note = (
            f"the run ends at {response.collapse.time:.6g} s with the step in which it collapses: "
            "error estimates exclude the growth of the peaks in this step"
        )
        response = replace(response, notes=(*response.notes, note))
        check = replace(check, corrected=None)
    if response.solver_time + other.solver_time > _SLOW_RUN:
        note = "a second run estimates the errors, with most of the time; --no-check omits it"
        response = replace(response, notes=(*response.notes, note))
    if history_errors and response.history_chunks is not None and other.history_chunks is not None:
        from tdint.response.runs.history import History, chunks_with_error, with_error

        ratio = round(response.dt / other.dt)
        history = response.history and with_error(
            response.history,
            other.history.every(ratio)
            if other.history
            else History.joined(other.history_chunks(ratio)),
        )
        chunks = partial(chunks_with_error, response.history_chunks, other.history_chunks, ratio)
        response = replace(response, history=history, history_chunks=chunks)
        check = replace(check, history=other.history)
    return replace(response, check=check)


def _with_devices(response: Response) -> Response:
    """Return a response with its attachments and links, if there are any, as further stories.

    The minima of the errors are common to all these peaks.
    """
    devices = response.devices
    if devices is None:
        return response
    assert devices.interstep_bound is not None
    return replace(
        response,
        stories=each_array(join_arrays, response.stories, devices.stories),
        interstep_bound=each_array(join_arrays, response.interstep_bound, devices.interstep_bound),
    )


def factors(method: Integrator) -> EstimateFactors:
    """Return the factors of the error estimate for a method."""
    return _HIGH_ORDER if method.order >= _MIN_HIGH_ORDER else _LOW_ORDER


def start_peaks(case: Case, steps: Steps, last: int | None = None) -> StoryPeaks | None:
    """Return the peaks P2 of a building that moves at the start, which two runs can both miss.

    P2 is the larger of two values: the peak in the first `_START` steps, by a short run with much
    shorter steps, and the estimate of the later peak by `_later_peaks`. The short run is necessary
    because an initial motion starts with all modes simultaneously, also with the modes that the
    step does not resolve. An acceleration can have its maximum between the start and the end of the
    first step. Both runs then report the value at the start, and their difference is zero.

    Parameters
    ----------
    last : int, optional
        Number of steps of the first event of a sequence; the default is the complete run.

    Returns
    -------
    StoryPeaks | None
        None if the building is at rest at the start, or if this short run fails.
    """
    if not case.model.initial.moves:
        return None
    short = reference_steps(case, replace(steps, count=min(_START, steps.count)))
    for _ in range(_START_HALVINGS):
        short = finer(short)
    start = attempt(reference(case), short)
    if isinstance(start, FailedRun):
        return None
    first = _with_devices(start).stories
    later = _later_peaks(case, replace(steps, count=last or steps.count), first)
    if later is None:
        return first
    names = [field.name for field in fields(StoryErrors)]
    return replace(
        first, **{name: np.maximum(getattr(first, name), getattr(later, name)) for name in names}
    )


def _later_peaks(case: Case, steps: Steps, start: StoryPeaks) -> StoryErrors | None:
    """Return upper estimates of the peaks after the first step; None if all are far below the peaks
    `start` (`_NEAR_START`), or a run fails or has only the first step.

    A maximum at the start is exact in all runs and hides a later maximum that is too small in both
    runs. Two runs by the method of the additional run, with the time steps of the run and of the
    additional run, therefore omit the first step. The estimate is the peak of the second run plus
    its error (`_LATER_FACTOR`).
    """
    names = [field.name for field in fields(StoryErrors) if field.name != "residual_drift"]
    other, shorter = reference(case), reference_steps(case, steps)
    coarse = _peaks_after(other, steps, 1)
    if coarse is None or not any(
        np.any(getattr(coarse, name) > _NEAR_START * getattr(start, name)) for name in names
    ):
        return None
    fine = _peaks_after(other, shorter, round(steps.h / shorter.h))
    if fine is None:
        return None
    by = EstimateFactors(_LATER_FACTOR, _MOST)
    peaks = {name: (getattr(fine, name), getattr(coarse, name)) for name in names}
    later = {name: f + extrapolated(f, c, f, by) for name, (f, c) in peaks.items()}
    return StoryErrors(**later, residual_drift=np.zeros_like(start.residual_drift))


def _peaks_after(case: Case, steps: Steps, first: int) -> StoryPeaks | None:
    """Return the peaks after step number `first`; None if the run ends before."""
    parts = case.prepared.integrate_in_parts(case.method, steps, case.ground, [0, first])
    reported = slice(case.building.device_columns.stop)
    peaks = [columns(all_peaks(case.building, space), reported) for space in parts]
    return peaks[1] if len(peaks) == 2 else None


def story_errors(
    response: Response | EventResponse,
    other: Response | EventResponse,
    by: EstimateFactors = _LOW_ORDER,
    *,
    start: StoryPeaks | None = None,
    stories: int | None = None,
    other_is_finer: bool = True,
) -> StoryErrors:
    """Estimate the errors of the peaks of a run, or of an event of a sequence, from another run.

    Parameters
    ----------
    other : Response or EventResponse
        Result of the additional run for the same time.
    start : StoryPeaks, optional
        Peaks in the first steps of a building that moves at the start (`start_peaks`); None if the
        building is at rest at the start.
    stories : int, optional
        Number of the first columns that are stories and attachments; links follow. By default all.
    other_is_finer : bool, default True
        True if the additional run has shorter time steps, so that it limits the possible excess of
        the peaks between time steps.

    Returns
    -------
    StoryErrors
        Estimated absolute errors of all peaks, shape (n,), in the units of the peaks.
    """

    def errors(name: str) -> Array:
        """Return the errors of a quantity in each story by the formula of the module docstring."""
        # Errors of residual drifts are related to peak drifts, because residual drifts can be 0.
        size = getattr(response.stories, "peak_drift" if name == "residual_drift" else name)
        error = extrapolated(
            getattr(response.stories, name), getattr(other.stories, name), size, by, stories
        )
        # For residual drifts, the bound is the change of the drift after the requested time
        # (usually the end of the record), because a run with long time steps ends later.
        if name == "residual_drift":
            settled = (response.stories.residual_drift == 0.0) & (other.stories.residual_drift == 0)
            return np.where(settled, 0.0, error + response.interstep_bound.residual_drift)
        finer_run = other if other_is_finer else None
        return np.maximum(error, _missed_excess(response, finer_run, start, name))

    return StoryErrors(**{field.name: errors(field.name) for field in fields(StoryErrors)})


def _missed_excess(
    response: Response | EventResponse,
    finer_run: Response | EventResponse | None,
    start: StoryPeaks | None,
    name: str,
) -> Array:
    """Return the errors of the peaks of a quantity that both runs can have in common: between time
    steps an excess of the true peaks (limited by a run with shorter steps; it can be negative), and
    at the start an excess or a lack. A peak above P2 belongs to the first steps, where a step with
    an abrupt force can have the same error as its half."""
    size: Array = getattr(response.stories, name)
    excess: Array = getattr(response.interstep_bound, name)
    if finer_run is not None:
        possible = getattr(finer_run.stories, name) + getattr(finer_run.interstep_bound, name)
        excess = np.minimum(excess, possible - size)
    if start is not None:  # of all springs; the stories are the first
        excess = np.maximum(excess, np.abs(getattr(start, name)[: size.size] - size))
    return excess


def element_errors(
    response: Response,
    other: Response,
    by: EstimateFactors,
    errors: StoryErrors,
    start: StoryPeaks | None = None,
) -> ElementValues | None:
    """Return the estimated errors of the elements, by the rules of `story_errors`.

    An excess of the peak drift of the story that both runs can miss increases the force of the
    element in proportion. The error of a ductility is the error of the peak drift of the story
    divided by the yield drift.
    """
    elements, others = response.elements, other.elements
    if elements is None or others is None:
        return None
    from tdint.response.runs.elements import ElementValues

    drift, story = response.stories.peak_drift, elements.story - 1
    excess = _missed_excess(response, other, start, "peak_drift")
    relative = np.divide(excess, drift, out=np.zeros_like(drift), where=drift > 0.0)
    force_error = extrapolated(elements.peak_force, others.peak_force, elements.peak_force, by)
    return ElementValues(
        peak_force=np.maximum(force_error, relative[story] * elements.peak_force),
        dissipated_energy=extrapolated(
            elements.dissipated_energy,
            others.dissipated_energy,
            np.abs(elements.dissipated_energy),
            by,
        ),
        ductility=errors.peak_drift[elements.story - 1] / elements.yield_drift,
    )


def flexure_errors(peaks: FlexureValues, others: FlexureValues, growth: float) -> FlexureValues:
    """Return the estimated errors of flexural stories, at least `growth` times the peaks."""
    from tdint.response.runs.flexure import FLEXURE_QUANTITIES, FlexureValues

    values: dict[str, Any] = {}
    for quantity in FLEXURE_QUANTITIES:
        value, other = (np.atleast_1d(getattr(item, quantity.name)) for item in (peaks, others))
        error = np.maximum(extrapolated(value, other, value, _LOW_ORDER), growth * value)
        is_scalar = isinstance(getattr(peaks, quantity.name), float)
        values[quantity.name] = float(error[0]) if is_scalar else error
    return FlexureValues(**values)


def contact_errors(
    other: Response, by: EstimateFactors, contacts: tuple[LinkContact, ...]
) -> tuple[LinkContact, ...]:
    """Return the contacts of a run with estimated errors, from those of the additional run."""
    # Imported here, because few models have stops.
    from tdint.response.runs.contacts import with_errors

    return with_errors(contacts, other.contacts, partial(extrapolated, by=by))


def extrapolated(
    values: Array, others: Array, size: Array, by: EstimateFactors, stories: int | None = None
) -> Array:
    """Return errors from the difference to a more accurate run, with minima relative to `size`;
    `stories` as in `common`."""
    difference = np.abs(values - others)
    error = by.difference * difference
    minimum = COMMON * common(error, size, stories)
    if by.most < math.inf:
        minimum = np.minimum(minimum, by.most * difference)
    return np.asarray(np.maximum(error, np.maximum(minimum, FLOOR * size)))


def common(errors: Array, size: Array, stories: int | None = None) -> Array:
    """Return `size` times the root mean square over stories and attachments of `errors` / `size`.

    This is the error of each story if all stories have the same relative error. Only the first
    `stories` columns (by default all) contribute, so that links that carry nothing change no error
    of a story.
    """
    # A story that did not move (size 0) does not contribute.
    has_moved = size > 0.0
    relative = np.divide(errors, size, out=np.zeros_like(errors), where=has_moved)[:stories]
    count = max(np.count_nonzero(has_moved[:stories]), 1)
    return np.asarray(np.sqrt(np.sum(relative**2) / count) * size)


def run_until_rest(case: Case, steps: Steps, run: Callable[[float], Response]) -> Response:
    """Integrate a case until free vibration has decayed, and add the amplitude of the remaining
    motion to the estimated errors of the residual drifts.

    `steps` contains the time steps of the run without its free vibration. `run` is the function
    that integrates the case for a duration (s).

    A run until rest reports the drifts at its end as residual drifts. The true residual drifts, at
    rest, differ from these by up to the amplitude of the remaining motion. The amplitude of a story
    is approximate and can be too small by accident. It is therefore increased to at least `COMMON`
    times the amplitude that the story would have if the ratio of amplitude to peak drift were the
    same in all stories (`common`).
    """
    # First determine the time when free vibration has decayed, by a run without history. Then
    # run again up to this time, so that a time step for a tolerance is chosen over the complete
    # duration.
    steps, is_at_rest = extend_to_rest(case, steps)
    response = run(steps.count * steps.h)
    if is_at_rest and not (response.collapse and response.collapse.ended):
        steps_at_rest = case.prepared.completed + response.steps
        response = replace(response, time_at_rest=steps_at_rest * response.dt)
    if response.check is None:
        return response
    amplitude = _remaining_motion(case, response)
    remaining_motion = np.maximum(
        amplitude, COMMON * common(amplitude, response.stories.peak_drift)
    )
    errors = response.check.errors
    remaining_motion = np.where(response.stories.residual_drift == 0.0, 0.0, remaining_motion)
    errors = replace(errors, residual_drift=errors.residual_drift + remaining_motion)
    return replace(response, check=replace(response.check, errors=errors))


def _remaining_motion(case: Case, response: Response) -> Array:
    """Return the amplitudes of the drifts that remain at the end of a run until rest, m.

    The stiffness at the end, used for `residual_oscillation`, is too large if a story
    continues to a softer branch after its force has changed its sign, or if a damper keeps a force.
    The drifts of a building that is not linear are therefore compared with the drifts of a run that
    is longer by half.
    """
    amplitude = response.residual_oscillation
    # The drifts of a collapsed building grow without bound, so that a longer run measures no motion
    # about a position of rest.
    if case.building.linear or case.model.excitation.forces or response.collapse:
        return amplitude
    longer = attempt(case, case.steps(response.dt, _LONGER * response.steps * response.dt))
    if isinstance(longer, FailedRun):
        return amplitude
    change = np.abs(longer.stories.residual_drift - response.stories.residual_drift)
    return np.maximum(amplitude, change + longer.residual_oscillation)


def attempt(case: Case, steps: Steps, history: bool = False) -> Response | FailedRun:
    """Integrate a case over `steps`, and return the response or, if the run fails, its failure.

    With `history`, the response history is kept.
    """
    try:
        return case.integrate(steps, history)
    except FailedRun as failure:
        return failure


def without_additional_history(response: Response) -> Response:
    """Return a response without the history of its additional run, which only the resultants of two
    directions need."""
    if response.check is None or response.check.history is None:
        return response
    return replace(response, check=replace(response.check, history=None))


def _unknown(response: Response, reason: str) -> Response:
    """Return a response with errors of nan, and a note on the reason why they are unknown."""
    unknown = np.full_like(response.stories.peak_drift, np.nan)
    errors = StoryErrors(*(unknown for _ in fields(StoryErrors)))
    notes = (*response.notes, f"no error estimate: {reason}")
    return replace(response, check=ErrorEstimate(errors, (), None, None), notes=notes)
