"""The step of a building by a tolerance: chosen once, under its strongest motions, for all its runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.step_choice import choose_step
from tdint.campaign.engine.runs import Run
from tdint.campaign.engine.settings import RunSettings
from tdint.campaign.engine.subject import Subject
from tdint.ground_motion.record import Record

_TRIED = 4
"""Runs that are tried, from the strongest to the one in the middle: under the strongest the building may collapse,
where nothing says how far off a step is."""


def halvings_within(
    subject: Subject, records: Mapping[int, Record], runs: Sequence[Run], settings: RunSettings, tolerance: float
) -> int | None:
    """How often the steps of a building's runs are halved for the peak drifts to be within a tolerance, by the estimate
    of `tdint.analysis.run.step_choice`; None if it finds no such step.

    Parameters
    ----------
    runs : sequence of Run
        All runs of the building. The strongest is the one with the largest peak ground acceleration.
    """
    ranked = sorted(runs, key=lambda run: -abs(run.scale) * records[run.motion].pga)
    places = dict.fromkeys(round(i * (len(ranked) - 1) / (2 * (_TRIED - 1))) for i in range(_TRIED))
    for run in (ranked[place] for place in places):
        record = records[run.motion].scaled(run.scale)
        case = Case(subject.model, subject.prepared, record, subject.integrator)
        steps = case.steps(settings.dt, settings.duration)
        try:
            response = choose_step(case, tolerance, dt=steps.h, duration=settings.duration)
        except FailedRun:
            continue
        return round(math.log2(steps.h / response.dt))
    return None
