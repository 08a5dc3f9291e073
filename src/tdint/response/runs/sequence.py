"""Sequences of earthquakes on one building that keeps its damage, for `tdint run --sequence`.

The events of a sequence (main shock and aftershocks) are joined to a single record and integrated
as one run, with its peaks, energies, history and errors. The peaks of each event are computed by
repeating the same time steps in parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypedDict, Unpack, overload

import numpy as np

from tdint.arrays import each_array
from tdint.errors import UsageError
from tdint.ground_motion.joined import at_one_interval, join_records, rest_intervals
from tdint.ground_motion.record import Record
from tdint.response.arguments import number_of, ratio_of
from tdint.response.runs import loop_results
from tdint.response.runs.case import REST_PERIODS, Case, extend_to_rest
from tdint.response.runs.error_estimate import (
    factors,
    reference,
    reference_steps,
    start_peaks,
    story_errors,
)
from tdint.response.runs.outcome import EventResponse, Response, ResponseWithHistory
from tdint.response.runs.run import run_case
from tdint.response.time_steps import Steps


@dataclass(frozen=True)
class EventSequence:
    """Ground motions of a sequence with their start times.

    Attributes
    ----------
    records : tuple of Record
        Ground motions of the events, all with the same sampling interval.
    starts : tuple of int
        Sample of the joined record where each event starts.
    restless : tuple of int
        Numbers, from 1, of the events after which the building did not reach rest.
    """

    records: tuple[Record, ...]
    starts: tuple[int, ...]
    restless: tuple[int, ...] = ()

    @property
    def joined(self) -> Record:
        """All events as one record."""
        return join_records(self.records, self.starts)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the events with free vibration that did not decay."""
        return tuple(
            f"the building still vibrated {REST_PERIODS:g} first periods after the end of event "
            f"{number}: the next event starts at this time"
            for number in self.restless
        )


def sequence_of(
    case: Case, records: Sequence[Record], *, rest: float | None = None, dt: float | None = None
) -> EventSequence:
    """Join ground motions to a sequence with times of rest in between.

    Parameters
    ----------
    records : sequence of Record
        Scaled ground motions of the events.
    rest : float, optional
        Time from the last sample of an event to the first sample of the next event, s, rounded up
        to whole samples and time steps. By default, until the building is at rest
        (`tdint.response.runs.case`).
    dt : float, optional
        Time step of the runs that determine the time of rest, s; by default that of the model,
        otherwise the sampling interval.

    Raises
    ------
    UsageError
        There is no record, the sampling intervals are not compatible, or `rest` or `dt` is invalid.
    """
    if not records:
        raise UsageError("a sequence must contain at least one record")
    events, starts, restless = at_one_interval(records), [0], []
    # Only the number of samples in a step is used. The duration in the analysis section of the
    # model does not apply to a sequence.
    steps = case.throughout(events[0]).steps(dt)
    for number, event in enumerate(events[:-1], start=1):
        last = starts[-1] + event.acceleration.size - 1
        if rest is not None:
            begin = last + rest_intervals(rest, event.dt)
        else:
            preceding = case.throughout(join_records(events[:number], starts))
            steps_to_rest, at_rest = extend_to_rest(preceding, preceding.steps(dt))
            # Convert time steps to samples. If a step is shorter than the sampling interval, an
            # interval has `per_sample` steps and `stride` is 1; if it is longer, a step covers
            # `stride` samples and `per_sample` is 1.
            samples = math.ceil(
                steps_to_rest.count * steps_to_rest.stride / steps_to_rest.per_sample
            )
            # Start one sample later, because the ground acceleration already changes in the
            # interval before the first sample.
            begin = max(samples, last) + 1
            restless += [] if at_rest else [number]
        # Each event starts at the start of a time step.
        starts.append(math.ceil(begin / steps.stride) * steps.stride)
    return EventSequence(tuple(events), tuple(starts), tuple(restless))


class _Options(TypedDict, total=False):
    """Arguments of `run_sequence` with the same types in both overloads."""

    rest: float | None
    dt: float | None
    check: bool | None
    tolerance: float | str | None
    until_rest: bool


@overload
def run_sequence(
    case: Case, records: Sequence[Record], *, history: Literal[True], **options: Unpack[_Options]
) -> ResponseWithHistory: ...


@overload
def run_sequence(
    case: Case, records: Sequence[Record], *, history: bool = False, **options: Unpack[_Options]
) -> Response: ...


def run_sequence(
    case: Case,
    records: Sequence[Record],
    *,
    rest: float | None = None,
    dt: float | None = None,
    history: bool = False,
    check: bool | None = None,
    tolerance: float | str | None = None,
    until_rest: bool = False,
) -> Response:
    """Integrate a building under a sequence of earthquakes.

    Parameters
    ----------
    case : Case
        From `tdint.prepare`; its ground motion is not used.
    records : sequence of Record
        Scaled ground motions of the events.
    rest : float, optional
        Time from the last sample of an event to the first sample of the next event, s. By default,
        until the building is at rest.
    dt, history, check, tolerance, until_rest : optional
        As for `tdint.run`, for the complete sequence.

    Returns
    -------
    Response
        Response to all events as one record; `Response.events` contains the response to each event.

    Raises
    ------
    UsageError
        As by `sequence_of`.
    FailedRun
        As by `tdint.run`.
    """
    if case.across is not None:
        raise UsageError("a sequence requires one direction; use a model for each direction")
    dt, rest = number_of(dt, "dt"), number_of(rest, "rest")
    tolerance = ratio_of(tolerance, "tolerance")
    sequence = sequence_of(case, records, rest=rest, dt=dt)
    joined = replace(case.throughout(sequence.joined), remarks=(*case.remarks, *sequence.notes))
    response = run_case(
        joined,
        dt=dt,
        history=history,
        check=check,
        tolerance=tolerance,
        until_rest=until_rest,
    )
    steps = replace(joined.steps(response.dt), count=response.steps)
    collapse_time = response.collapse.time if response.collapse else math.inf
    events = event_responses(
        joined, sequence, steps, check=response.check is not None, collapse_time=collapse_time
    )
    return replace(response, events=events)


def event_responses(
    joined: Case,
    sequence: EventSequence,
    steps: Steps,
    *,
    check: bool = False,
    collapse_time: float = math.inf,
) -> tuple[EventResponse, ...]:
    """Integrate a sequence again, and return the peaks of each event that starts before its end.

    Events that end after a collapse (`collapse_time`, s) have no residual drifts.
    """
    events = _parts(joined, sequence, steps)
    ends = (*(event.start for event in events[1:]), math.inf)
    events = tuple(
        replace(event, stories=event.stories.without_residual()) if end > collapse_time else event
        for event, end in zip(events, ends, strict=True)
    )
    # Events after a collapse that ends the run are listed without values.
    starts = zip(sequence.records[len(events) :], sequence.starts[len(events) :], strict=True)
    lost = tuple(
        _without_values(events[0], record, start * record.dt, check=check)
        for record, start in starts
        if math.isfinite(collapse_time)
    )
    if not check:
        return (*events, *lost)
    others = _parts(reference(joined), sequence, reference_steps(joined, steps))
    # A motion of the building at the start affects the error estimate of the first event only.
    end_of_first = (*_first_steps(sequence, steps), steps.count)[1]
    start = start_peaks(joined, steps, min(end_of_first, steps.count))
    at_start = (start, *(None for _ in events[1:]))
    # The additional run may end earlier and contain fewer events (`strict=False`).
    estimated = (
        replace(event, errors=story_errors(event, other, factors(joined.method), start=start))
        for event, other, start in zip(events, others, at_start, strict=False)
    )
    return (*estimated, *lost)


def _without_values(
    event: EventResponse, record: Record, start: float, *, check: bool
) -> EventResponse:
    """Return an event that a run did not reach: all values of `event` are nan."""
    heights = {name: getattr(event.stories, name) for name in ("height", "isolator")}
    unknown = each_array(lambda array: np.full_like(array, np.nan), event.interstep_bound)
    stories = each_array(lambda array: np.full_like(array, np.nan), event.stories)
    return EventResponse(
        record, start, replace(stories, **heights), unknown, unknown if check else None
    )


def _parts(joined: Case, sequence: EventSequence, steps: Steps) -> tuple[EventResponse, ...]:
    """Integrate a sequence in parts, one for each event, and return the peaks of each part.

    `steps` contains the time steps of the complete run. Events that start after its end are
    omitted.
    """
    firsts = _first_steps(sequence, steps)
    building, dt = joined.building, sequence.records[0].dt
    parts = joined.prepared.integrate_in_parts(joined.method, steps, joined.ground, firsts)
    events = []
    ends = (*firsts[1:], steps.count)
    for record, start, end, space in zip(
        sequence.records, sequence.starts, ends, parts, strict=False
    ):
        is_settled = joined.is_settled(end * steps.h)
        stories = loop_results.story_peaks(building, space).settled(is_settled)
        # Residual drifts are read at the end of the part, so that the last step is 0 s late.
        bound = loop_results.interstep_peak_errors(building, space, 0.0, slice(building.floors))
        events.append(EventResponse(record, start * dt, stories, bound))
    return tuple(events)


def _first_steps(sequence: EventSequence, steps: Steps) -> list[int]:
    """Return the number of steps before each event.

    The ground acceleration of an event starts to change at the sample before its first sample.
    """
    return [max(start - 1, 0) * steps.per_sample // steps.stride for start in sequence.starts]
