"""Runs that go on with the ground at rest until the building is, and how far from rest one is at its end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.case import Case
from tdint.analysis.run.prepared import Lane, PreparedBuilding, Rest
from tdint.analysis.run.steps import Steps

REST_PERIODS = 100.0
"""How long a run goes on with the ground at rest, in first periods of the building."""

AT_REST = 1e-3
"""Amplitude of what is left of the motion, over the largest displacement, from which a building is at rest."""


def windows(prepared: PreparedBuilding, h: float) -> Rest:
    """The first periods by which a run of steps h (s) goes on until the velocities in one of them are those of an
    amplitude below `AT_REST` times the largest displacement; `REST_PERIODS` of them at most."""
    period = prepared.period
    return Rest(math.ceil(period / h), round(REST_PERIODS), AT_REST * 2.0 * math.pi / period)


def until_rest(case: Case, steps: Steps) -> tuple[Steps, bool]:
    """The steps of a run that goes on until the building is at rest, and whether it comes to that.

    Where the run fails on the way, the steps are those with which it does.
    """
    ground: NDArray[np.float64] = np.zeros(1) if case.ground is None else case.ground
    marched = case.prepared.march_many(
        case.integrator,
        steps.h,
        ground,
        [Lane(0, ground.size, 1.0, steps)],
        collapse_drift=case.model.collapse_drift,
        rest=windows(case.prepared, steps.h),
    )
    code, count, at_rest = marched.ends[0].tolist()
    if code < 0:
        count += windows(case.prepared, steps.h).window
    return replace(steps, count=max(int(count), steps.count)), bool(at_rest) and code >= 0
