"""Runs of a case of the grid, compared with the reference peaks.

A value is beyond its estimate if its error exceeds twice the error estimate of the run and
`RESOLUTION` times the largest value of the quantity. A reported force of a law must be a force of
the law at some drift up to the peak drift.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from grid.solver import sizes_of, springs_of
from tdint import load_model, make_record, run
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.methods.catalogue import catalogue, parse
from tdint.response.runs.outcome import FailedRun

STEPS = (0.5, 1.0, 2.0, 5.0)
"""Time steps, sampling intervals."""

RESOLUTION = 4e-6
"""Twice the uncertainty of the references (`grid.covering`)."""

_ROUNDING = 1e-9
"""Excess of a force that is regarded as rounding, divided by the peak force of the story."""

DONE, REFUSED, COLLAPSED, FAILED = "done", "refused", "collapsed", "failed"
"""Outcomes of a run: with peaks, refused for the building or step, collapsed, without result."""


def method_labels():
    """Return the specifications of all methods of the catalogue: with default parameters, and with
    the ends and the middle of the range of the first parameter if the method is as stable there."""
    labels = []
    for name, method in catalogue().items():
        labels.append(name)
        default = parse(name)
        for parameter in method.parameters[:1]:
            for number in (parameter.low, 0.5 * (parameter.low + parameter.high), parameter.high):
                label = f"{name}:{parameter.name}={number:.6g}"
                if not parameter.allows(float(f"{number:.6g}")) or number == default.values[0]:
                    continue
                if parse(label).stability_limit >= default.stability_limit:
                    labels.append(label)
    return labels


@dataclass
class Excess:
    """Value whose error is beyond twice its estimate, divided by the largest value."""

    quantity: str
    story: int
    error: float
    estimate: float

    @property
    def ratio(self):
        """Error divided by its estimate."""
        return self.error / max(self.estimate, 1e-300)


@dataclass
class Verdict:
    """Comparison of a run with the reference.

    Attributes
    ----------
    method, samples
        Method and time step of the run.
    outcome : str
        Outcome of the run; the other attributes are empty unless it is `DONE`.
    message : str
        Error message of a run without result.
    values : int
        Number of compared values.
    beyond : list of Excess
        Values beyond twice their estimate.
    above_strength : list of (int, float)
        Story and relative excess of forces that the law does not reach.
    """

    method: str
    samples: float
    outcome: str
    message: str = ""
    values: int = 0
    beyond: list = field(default_factory=list)
    above_strength: list = field(default_factory=list)

    def ratios(self):
        """Yield quantity and ratio of each value that is beyond, and `strength` with the relative
        excess of each force above a strength."""
        yield from ((excess.quantity, excess.ratio) for excess in self.beyond)
        yield from (("strength", excess) for _, excess in self.above_strength)


def model_of(case):
    """Return the model of a case; None if it is refused: tangent damping and a law that falls."""
    try:
        return load_model(case.model)
    except ModelError:
        if case.row["damping"] != "tangent":
            raise
        return None


def motion_of(case):
    """Return the ground motion of a case, or None."""
    if not case.ground.size:
        return None
    return make_record(case.ground, dt=case.interval, units="m/s^2")


def attempt(model, record, method, dt, duration, **options):
    """Return the response of a run, or the reason why it has none as (outcome, message)."""
    try:
        response = run(model, record, method=method, dt=dt, duration=duration, **options)
    except FailedRun as failure:
        return FAILED, failure.status
    except (AnalysisError, UsageError) as error:
        return REFUSED, str(error)
    return response if response.status == DONE else (COLLAPSED, response.status)


def judge(case, peaks, method, samples, model=None, factor=2.0):
    """Return the verdict on a run of a case.

    Parameters
    ----------
    case : Case
        Case of the grid.
    peaks : dict of str to ndarray
        Reference peaks.
    method : str
        Specification of a method.
    samples : float
        Time step, sampling intervals.
    model : Model, optional
        Loaded model of the case.
    factor : float
        Error divided by its estimate from which a value is beyond.
    """
    model = model or model_of(case)
    if model is None:
        return Verdict(method, samples, REFUSED, "the model is refused")
    step, record = samples * case.interval, motion_of(case)
    response = attempt(model, record, method, step, case.duration)
    if isinstance(response, tuple):
        return Verdict(method, samples, *response)
    verdict = Verdict(method, samples, DONE)
    devices, sizes = response.devices, sizes_of(peaks, case.n)
    for name, true in peaks.items():
        reported = getattr(response.stories, name)
        estimate = getattr(response.check.errors, name)
        if devices is not None:
            reported = np.append(reported, getattr(devices.stories, name))
            estimate = np.append(estimate, getattr(devices.errors, name))
        size = sizes[name]
        error = np.abs(np.abs(reported) - np.abs(true))
        if name == "residual_drift":
            error = np.abs(reported - true)
        is_compared = np.isfinite(true)
        assert np.all(np.isfinite(reported[is_compared])), (name, reported)
        has_estimate = np.isfinite(estimate) & is_compared
        verdict.values += int(has_estimate.sum())
        excess = has_estimate & (error > factor * estimate + RESOLUTION * size)
        verdict.beyond += [
            Excess(name, int(i), float(error[i] / size[i]), float(estimate[i] / size[i]))
            for i in np.flatnonzero(excess)
        ]
    verdict.above_strength = above_strength(case, response)
    return verdict


def above_strength(case, response):
    """Return story and relative excess of reported forces of stories and elements that the laws do
    not reach at drifts up to the reported peak drift.

    If the time step does not resolve the motion, the drift at an inner point of the step, to which
    the law has followed it, is not a peak drift, but it is within the possible excess and the error
    estimate that the run states.
    """
    drifts = response.stories.peak_drift + response.interstep_bound.peak_drift
    drifts = drifts + np.nan_to_num(response.check.errors.peak_drift)
    largest = largest_forces(case, drifts)
    forces = [
        *zip(range(len(largest)), response.stories.peak_shear, map(sum, largest), strict=True)
    ]
    if response.elements is not None:
        of_elements = [
            strength
            for story, strengths in zip(case.model["stories"], largest, strict=True)
            for strength in strengths
            if "elements" in story
        ]
        elements = response.elements
        forces += zip(elements.story - 1, elements.peak_force, of_elements, strict=True)
    return [
        # An element that is not reached at the reported peak drift has no strength.
        (int(i), float(force / strength - 1.0) if strength > 0.0 else math.inf)
        for i, force, strength in forces
        if force > strength + _ROUNDING * response.stories.peak_shear[int(i)]
    ]


def largest_forces(case, drifts):
    """Return the largest force that each spring of each story reaches up to a drift, N."""
    return [
        [spring.largest(float(drift)) for spring in springs_of(story)]
        for story, drift in zip(case.model["stories"], drifts, strict=True)
    ]
