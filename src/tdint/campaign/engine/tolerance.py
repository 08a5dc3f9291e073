"""The step of a building by a tolerance: chosen once, under some of its runs, for all of them.

What a step errs by hangs on the motion as much as on the building: one motion, be it the strongest, tells little of the
others. So the runs that are looked at are spread over motions and scales, and the smallest of their steps is taken.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, islice, zip_longest
from typing import TypeVar

from tdint.analysis.run.error_estimate import attempt
from tdint.analysis.run.outcome import FailedRun, Response
from tdint.analysis.run.run import Subject
from tdint.analysis.run.step_choice import step_within
from tdint.analysis.sequence import sequence_of
from tdint.campaign.engine.task import Run, RunSettings
from tdint.ground_motion.joining import JoinedRecord
from tdint.ground_motion.record import Record

Item = TypeVar("Item")

_FEWEST, _MOST = 4, 8
"""Runs whose errors are looked at: a quarter of them, within these bounds."""

_TRIED = 24
"""Runs that are tried for that: where the building collapses nothing says how far off a step is."""


def building_step(
    subject: Subject, records: Mapping[int, Record], runs: Sequence[Run], settings: RunSettings, tolerance: float
) -> float | None:
    """The largest step (s) with which the peak drifts of a building are within a tolerance under some of its runs, by
    the estimate of `tdint.analysis.run.step_choice`; None if there is none.

    Parameters
    ----------
    runs : sequence of Run
        All runs of the building.
    """
    step, looked_at = math.inf, 0
    enough = min(max(_FEWEST, len(runs) // 4), _MOST)
    for run in islice(_spread_runs(records, runs), _TRIED):
        record = records[run.motion].scaled(run.scale)
        case = subject.case(record)
        if isinstance(record, JoinedRecord):
            case = case.under(sequence_of(case, record.shocks, rest=record.rest, dt=settings.dt).whole)
        first = attempt(case, case.steps(settings.dt, settings.duration))
        if isinstance(first, Response) and first.collapse:
            continue
        try:
            step = step_within(case, tolerance, dt=settings.dt, duration=settings.duration, largest=step)
        except FailedRun:
            continue
        looked_at += 1
        if looked_at == enough:
            break
    return step if looked_at else None


def _spread_runs(records: Mapping[int, Record], runs: Sequence[Run]) -> Iterator[Run]:
    """All runs, of any beginning of them as many as can be under motions of their own, at scales in the middle."""
    of_motion: dict[int, list[Run]] = {}
    for run in sorted(runs, key=lambda run: abs(run.scale)):
        of_motion.setdefault(run.motion, []).append(run)
    ranked = sorted(of_motion, key=lambda motion: abs(of_motion[motion][-1].scale) * records[motion].pga)
    rounds = zip_longest(*(_spread(of_motion[motion]) for motion in _spread(ranked)))
    return (run for run in chain.from_iterable(rounds) if run is not None)


def _spread(items: Sequence[Item]) -> Iterator[Item]:
    """The item in the middle, those in the middle of either half, and so on."""
    parts = deque([items])
    while parts:
        part = parts.popleft()
        if part:
            middle = len(part) // 2
            yield part[middle]
            parts += [part[:middle], part[middle + 1 :]]
