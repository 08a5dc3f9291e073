"""Runs of the stored cases with all methods: errors are within twice their estimates and forces
below strengths, or the value is a listed exception with its cause; errors decrease at the declared
order.
"""

from functools import cache

import numpy as np
import pytest

from grid.axes import AXES, build
from grid.covering import read
from grid.exceptions import listed
from grid.judge import DONE, STEPS, attempt, judge, method_labels, model_of, motion_of
from grid.solver import solve
from selection import every
from tdint.methods.catalogue import parse

CASES = read()
LABELS = method_labels()
EXCEPTIONS = listed()

_LEAST_ERROR = 2e-8  # smallest error divided by the peak drift from which an order is observed
_FAST = 3  # methods of a case in the fast tests, in addition to the default method


def assert_within_estimates(number, runs):
    """Assert that a stored case with these methods and steps has no unlisted exception."""
    row, seed, digest, peaks = CASES[number]
    case = build(row, seed)
    assert case.digest == digest, "changed case: run `python tests/grid/covering.py`"
    model, faults, outcomes = model_of(case), [], set()
    if model is None:
        return
    for method, samples in runs:
        verdict = judge(case, peaks, method, samples, model)
        outcomes.add(verdict.outcome)
        for quantity, ratio in verdict.ratios():
            if ratio > EXCEPTIONS.get((digest, method, samples, quantity), 0.0):
                faults.append((digest, method, samples, quantity, ratio))
    assert not faults, "\n".join(map(str, faults))
    assert DONE in outcomes


def fast_runs(number):
    """Return some methods of a case with their time steps: the default method and others, so that
    all steps occur with each method."""
    methods = [
        *((_FAST * number + j) % len(LABELS) for j in range(_FAST)),
        LABELS.index("impulse4"),
    ]
    return [(LABELS[i], STEPS[(number + i) % len(STEPS)]) for i in methods]


@pytest.mark.parametrize("number", every(8, range(len(CASES))))
def test_errors_are_within_twice_their_estimates(number):
    assert_within_estimates(number, fast_runs(number))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(CASES)))
def test_all_methods(number):
    """Each method runs with one of the four steps, another one in each case."""
    runs = ((label, STEPS[(number + i + 2) % len(STEPS)]) for i, label in enumerate(LABELS))
    assert_within_estimates(number, runs)


# ---- Orders


SMOOTH = {axis: next(iter(values)) for axis, values in AXES.items()}
"""Row of the first values of all axes: a linear building and a record."""


@cache
def smooth_cases():
    """Return buildings with smooth motions between the samples, and their final drifts: laws
    without branch changes, linear dashpots, and no forces with jumps or kinks."""
    cases = []
    for law, stories, damper in (("smooth", "2", "none"), ("smooth", "3", "linear")):
        case = build(SMOOTH | {"law": law, "stories": stories, "damper": damper}, 1)
        cases.append((case, solve(case.model, case.ground, case.interval, case.duration)))
    return cases


def errors_of_drift(case, peaks, method):
    """Return the errors of the final drift with halved time steps, divided by the peak drift, down
    to `_LEAST_ERROR`."""
    model, errors = model_of(case), []
    for parts in (1, 2, 4, 8, 16):
        step = case.interval / parts
        response = attempt(model, motion_of(case), method, step, case.duration, check=False)
        if isinstance(response, tuple):
            continue
        difference = response.stories.residual_drift - peaks["residual_drift"]
        errors.append(np.max(np.abs(difference)) / np.max(peaks["peak_drift"]))
        if errors[-1] < _LEAST_ERROR:
            return errors[:-1]
    return errors


@pytest.mark.parametrize("name", sorted({label for label in LABELS if ":" not in label}))
def test_errors_decrease_at_the_declared_order(name):
    """The median over the cases of the order over the last two refinements is at least the declared
    order, less a half. `exact` has no errors without forces on floors."""
    integrator = parse(name)
    errors = [errors_of_drift(case, peaks, name) for case, peaks in smooth_cases()]
    last = [e[-3:] for e in errors if len(e) > 1]
    orders = [np.log2(e[0] / e[-1]) / (len(e) - 1) for e in last]
    assert orders or integrator.family.linear_only
    assert not orders or np.median(orders) > integrator.order - 0.5
