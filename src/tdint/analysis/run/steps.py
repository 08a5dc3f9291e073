"""Which time steps an analysis may take."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from tdint.arrays import Array
from tdint.errors import UsageError

_SAME = 1e-9  # steps that differ by less than this part are the same


@dataclass(frozen=True, eq=False)
class Bound:
    """What strides are chosen by on the way (`tdint.kernels.march.strides`).

    Attributes
    ----------
    allowed : float
        What a stride may miss; the error of a run goes with it.
    drifts : ndarray, shape (n,)
        What the peak drifts of the stories are taken for at least, m.
    """

    allowed: float
    drifts: Array


@dataclass(frozen=True)
class Steps:
    """Time steps on a ground motion: `per_sample` of them take `stride` sampling intervals.

    They end at the time that was asked for, `end` (s), or less than a step after it. Of all `count` so many may be
    `done`.

    With a `bound` these are units: steps of 1, 2, 4 ... `stride` of them are chosen on the way, and `per_sample` are a
    sampling interval.
    """

    h: float
    count: int
    per_sample: int = 1
    stride: int = 1
    end: float = field(default=math.inf, compare=False)
    done: int = 0
    bound: Bound | None = field(default=None, compare=False)

    @property
    def late(self) -> float:
        """How long after the time that was asked for the last step ends, s."""
        return max(self.count * self.h - self.end, 0.0)


MOST_STEPS = 1_000_000_000
"""Steps that a run may have, some quarter of an hour for a few stories: a slip in dt does not run for years."""


def choose_steps(dt: float | None, duration: float | None, record_dt: float | None, record_duration: float) -> Steps:
    """Time steps for a wished dt (s) and duration (s) under a record, or without one (`record_dt` None).

    A step divides the record's sampling interval or is a whole multiple of it. The last step ends at the duration or
    after.

    Raises
    ------
    UsageError
        No dt or duration where there is no record to take it from; a dt that does not fit the record; too many steps.
    """
    if record_dt is None:
        if dt is None:
            raise UsageError("no time step: without a record, give --dt or analysis.dt in the model file")
        if duration is None:
            raise UsageError("no duration: without a record, give --duration or analysis.duration in the model file")
        return Steps(dt, _count(duration, dt), end=duration)
    if dt is not None and not record_dt / MOST_STEPS <= dt <= record_dt * MOST_STEPS:
        raise UsageError(f"dt {dt:.6g} s is out of all proportion to the record's sampling interval {record_dt:.6g} s")
    duration = record_duration if duration is None else duration
    if dt is None:
        return Steps(record_dt, _count(duration, record_dt), end=duration)
    for ratio, per_sample in ((record_dt / dt, True), (dt / record_dt, False)):
        whole = round(ratio)
        if whole >= 1 and abs(ratio - whole) <= _SAME * whole:
            h = record_dt / whole if per_sample else record_dt * whole
            return Steps(h, _count(duration, h), *((whole, 1) if per_sample else (1, whole)), end=duration)
    below, above = _neighbours(dt, record_dt)
    raise UsageError(
        f"dt {dt:.12g} s does not fit the record's sampling interval {record_dt:.12g} s: "
        f"the nearest steps are {below:.12g} and {above:.12g} s"
    )


def _count(duration: float, h: float) -> int:
    count = duration / h * (1.0 - _SAME)
    if not count <= MOST_STEPS:
        raise UsageError(
            f"{count:.3g} steps of {h:.6g} s for a duration of {duration:.6g} s: at most {MOST_STEPS:.0e} are taken; "
            "use a longer dt or a shorter duration"
        )
    return max(1, math.ceil(count))


def _neighbours(dt: float, record_dt: float) -> tuple[float, float]:
    if dt > record_dt:
        whole = math.floor(dt / record_dt)
        return record_dt * whole, record_dt * (whole + 1)
    whole = math.floor(record_dt / dt)
    return record_dt / (whole + 1), record_dt / whole


def finer(steps: Steps) -> Steps:
    """Half the step over the same time."""
    if steps.per_sample == 1 and steps.stride % 2 == 0:
        return replace(steps, h=steps.h / 2, count=2 * steps.count, stride=steps.stride // 2)
    return replace(steps, h=steps.h / 2, count=2 * steps.count, per_sample=2 * steps.per_sample)
