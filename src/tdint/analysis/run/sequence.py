"""Shocks one after the other on one building, which keeps what each has left: the work behind
`tdint run --sequence`.

The shocks are joined to one record, and its run is that of any record: peaks over all, energies,
history, errors. Peaks of each shock come from the same steps once more, in parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tdint.analysis.given import number_of
from tdint.analysis.run import case as run_totals
from tdint.analysis.run.case import REST_PERIODS, Case, case_of, until_rest
from tdint.analysis.run.error_estimate import reference, story_errors
from tdint.analysis.run.outcome import Response, Shock
from tdint.analysis.run.run import run_case
from tdint.analysis.run.workspace import Steps, choose_steps, finer
from tdint.errors import UsageError
from tdint.ground_motion.record import Record, at_one_interval, one_after_another, samples_of


@dataclass(frozen=True)
class ShockSequence:
    """Ground motions one after the other.

    Attributes
    ----------
    records : tuple of Record
        The shocks, of one sampling interval.
    starts : tuple of int
        The sample of the whole at which each begins.
    restless : tuple of int
        The shocks, from 1, after which the building did not come to rest.
    """

    records: tuple[Record, ...]
    starts: tuple[int, ...]
    restless: tuple[int, ...] = ()

    @property
    def whole(self) -> Record:
        """All of them as one record."""
        return one_after_another(self.records, self.starts)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of the rests."""
        return tuple(
            f"after shock {number} the building still moved after {REST_PERIODS:g} first periods "
            "with the ground at rest: the next one begins there"
            for number in self.restless
        )


def sequence_of(
    case: Case, records: Sequence[Record], *, rest: float | None = None, dt: float | None = None
) -> ShockSequence:
    """Put shocks on a building one after the other.

    Parameters
    ----------
    case : Case
        The building and its method; its own record is not asked.
    records : sequence of Record
        The shocks, scaled.
    rest : float, optional
        Time from the last sample of one to the first of the next, s, rounded up to whole samples
        and steps; by default until the building is at rest (`tdint.analysis.run.case`).
    dt : float, optional
        Step of the runs that find that, s; by default the model's, else that of the records.

    Raises
    ------
    UsageError
        No record; sampling intervals that do not fit each other; a rest or a step that is none.
    """
    if not records:
        raise UsageError("a sequence needs a record at least")
    shocks, starts, restless = at_one_interval(records), [0], []
    steps = _steps(case, shocks[0], dt)
    for number, shock in enumerate(shocks[:-1], start=1):
        last = starts[-1] + shock.acceleration.size - 1
        if rest is not None:
            begin = last + samples_of(rest, shock.dt)
        else:
            before = one_after_another(shocks[:number], starts)
            quiet, at_rest = until_rest(case.under(before), _steps(case, before, dt))
            begin = (
                max(math.ceil(quiet.count * quiet.stride / quiet.per_sample), last) + 1
            )  # a sample leads to it
            restless += [] if at_rest else [number]
        starts.append(math.ceil(begin / steps.stride) * steps.stride)  # a shock begins with a step
    return ShockSequence(tuple(shocks), tuple(starts), tuple(restless))


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
    """Integrate a building under shocks one after the other.

    Parameters
    ----------
    case : Case
        From `tdint.prepare`; its own record is not asked.
    records : sequence of Record
        The shocks, scaled.
    rest : float, optional
        Time from the last sample of one to the first of the next, s; by default until the building
        is at rest.
    dt, history, check, tolerance, until_rest : optional
        As for `tdint.run`, of the whole sequence.

    Returns
    -------
    Response
        That of all shocks as one record, and what each did in `Response.events`.

    Raises
    ------
    UsageError
        As by `sequence_of`.
    FailedRun
        As by `tdint.run`.
    """
    sequence = sequence_of(
        case_of(case), records, rest=number_of(rest, "rest"), dt=number_of(dt, "dt")
    )
    whole = sequence.whole
    joined, duration = (
        replace(case.under(whole), remarks=(*case.remarks, *sequence.notes)),
        whole.duration,
    )
    response = run_case(
        joined,
        dt=dt,
        duration=duration,
        history=history,
        check=check,
        tolerance=tolerance,
        until_rest=until_rest,
    )
    # Each shock's peaks come from one more march, with the steps that were taken.
    steps = replace(joined.steps(response.dt, duration), count=response.steps)
    return replace(
        response, events=shocks_of(joined, sequence, steps, check=response.check is not None)
    )


def shocks_of(
    joined: Case, sequence: ShockSequence, steps: Steps, *, check: bool = False
) -> tuple[Shock, ...]:
    """What each shock of a sequence did, as far as the steps of the `joined` case go; with errors
    by one more run."""
    shocks = _parts(joined, sequence, steps)
    if not check:
        return shocks
    others = _parts(reference(joined), sequence, finer(steps))
    return tuple(
        replace(shock, errors=story_errors(shock, other))
        for shock, other in zip(shocks, others, strict=False)  # the finer run may end earlier
    )


def _parts(joined: Case, sequence: ShockSequence, steps: Steps) -> tuple[Shock, ...]:
    # The ground moves from the sample before on.
    firsts = [max(start - 1, 0) * steps.per_sample // steps.stride for start in sequence.starts]
    building, dt = joined.building, sequence.records[0].dt
    parts = joined.prepared.march_parts(joined.method, steps, joined.ground, firsts)
    return tuple(
        Shock(
            record,
            start * dt,
            run_totals.story_peaks(building, space),
            run_totals.interstep_peak_errors(building, space, 0.0),
        )
        for record, start, space in zip(sequence.records, sequence.starts, parts, strict=False)
    )


def _steps(case: Case, record: Record, dt: float | None) -> Steps:
    """Steps over a whole record: the duration of the model's own analysis is not that of a
    sequence."""
    return choose_steps(
        case.model.analysis.dt if dt is None else dt, None, record.dt, record.duration
    )
