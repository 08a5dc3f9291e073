"""Time steps of an analysis: length and number of the time steps for a requested dt, duration and
record."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tdint.errors import UsageError

if TYPE_CHECKING:
    from tdint.model.definition import Model

# Dimensionless. Relative difference below which time steps are considered equal
_STEP_TOLERANCE = 1e-9


def moves_without_record(model: Model) -> bool:
    """Return True if a building moves without a ground motion: forces, or initial values."""
    return model.excitation.has_forces or model.initial.moves


@dataclass(frozen=True)
class Steps:
    """Time steps under a ground motion.

    Attributes
    ----------
    per_sample, stride : int
        `per_sample` time steps cover `stride` sampling intervals.
    end : float
        Requested end, s. The last step ends at this time or less than one step after it.
    continues : bool
        True if the run continues after its end while a peak could still be exceeded; False if
        the user has requested the end.
    note : str
        Reason of a time step that was not determined by the user or by a record; otherwise empty.
    """

    h: float
    count: int
    per_sample: int = 1
    stride: int = 1
    end: float = field(default=math.inf, compare=False)
    continues: bool = field(default=False, compare=False)
    note: str = field(default="", compare=False)

    @property
    def late(self) -> float:
        """Time from the requested end to the end of the last step, s."""
        return max(self.count * self.h - self.end, 0.0)


MAX_STEPS = 1_000_000_000
"""Maximum number of time steps of a run, about 15 minutes for a few stories. A mistake in dt does
not cause a run of years.
"""


def choose_steps(
    dt: float | None,
    duration: float | None,
    record_dt: float | None,
    record_duration: float,
    interval_name: str = "sampling interval of the record",
) -> Steps:
    """Return the time steps for a requested dt and duration.

    A time step divides the sampling interval of the record or is an integer multiple of the
    interval. The last step ends at the duration or after it. Without a requested duration, a run
    continues after the record if necessary.

    Parameters
    ----------
    dt, duration : float | None
        Requested time step and duration, s; by default the values of the record.
    record_dt : float | None
        Sampling interval of the record, s; None without a record.
    interval_name : str
        Name of the quantity `record_dt` in messages.

    Raises
    ------
    UsageError
        dt or duration is missing and there is no record, dt is not compatible with the record, or
        there are too many steps.
    """
    if record_dt is None:
        if dt is None:
            raise UsageError(
                "the time step is required, because the analysis has no record; specify --dt, or "
                "analysis.dt in the model file"
            )
        if duration is None:
            raise UsageError(
                "the duration is required, because the analysis has no record; specify --duration, "
                "or analysis.duration in the model file"
            )
        return Steps(dt, _count(duration, dt), end=duration)
    if dt is not None and not record_dt / MAX_STEPS <= dt <= record_dt * MAX_STEPS:
        raise UsageError(
            f"dt must be the {interval_name}, {record_dt:.6g} s, multiplied or divided by an "
            f"integer up to {MAX_STEPS:.0e}, got {dt:.6g} s"
        )
    continues = duration is None
    duration = record_duration if duration is None else duration
    if dt is None:
        count = _count(duration, record_dt)
        return Steps(record_dt, count, end=duration, continues=continues)
    # If the time step divides the sampling interval or is a multiple of the interval, except for
    # rounding, the time step is computed from the sampling interval, so that steps and samples
    # coincide exactly.
    for ratio, divides in ((record_dt / dt, True), (dt / record_dt, False)):
        factor = round(ratio)
        if factor >= 1 and abs(ratio - factor) <= _STEP_TOLERANCE * factor:
            h = record_dt / factor if divides else record_dt * factor
            per_sample, stride = (factor, 1) if divides else (1, factor)
            count = _count(duration, h)
            return Steps(h, count, per_sample, stride, end=duration, continues=continues)
    # Otherwise, report the next smaller and the next larger compatible time step.
    factor = math.floor(dt / record_dt if dt > record_dt else record_dt / dt)
    if dt > record_dt:
        smaller, larger = record_dt * factor, record_dt * (factor + 1)
    else:
        smaller, larger = record_dt / (factor + 1), record_dt / factor
    raise UsageError(
        f"dt must be the {interval_name}, {record_dt:.12g} s, multiplied or "
        f"divided by an integer, got {dt:.12g} s; the nearest time steps are {smaller:.12g} and "
        f"{larger:.12g} s"
    )


def record_steps(steps: Steps, duration: float | None) -> int:
    """Return the number of steps up to the last sample of a record of a duration (s), or to a
    requested end before it; all steps without a record (None)."""
    if duration is None:
        return steps.count
    return min(steps.count, math.floor(duration / steps.h * (1.0 + _STEP_TOLERANCE)))


def _count(duration: float, h: float) -> int:
    """Return the number of time steps of length h (s) in a duration (s), rounded up.

    A remainder within the rounding errors does not count as a further step.

    Raises
    ------
    UsageError
        There are more than `MAX_STEPS` steps.
    """
    count = duration / h * (1.0 - _STEP_TOLERANCE)
    if not count <= MAX_STEPS:
        raise UsageError(
            f"a duration of {duration:.6g} s has {count:.3g} steps of {h:.6g} s, but at most "
            f"{MAX_STEPS:.0e} steps are allowed; use a longer dt or a shorter duration"
        )
    return max(1, math.ceil(count))


def finer(steps: Steps, parts: int = 2) -> Steps:
    """Return time steps that are a part of the given steps, by default the half, over the same
    duration."""
    steps = replace(steps, h=steps.h / parts, count=parts * steps.count)
    if steps.per_sample == 1 and steps.stride % parts == 0:
        return replace(steps, stride=steps.stride // parts)
    return replace(steps, per_sample=parts * steps.per_sample)
