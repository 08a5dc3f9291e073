"""Join the traces of one channel and check its samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isclose, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.record import masked_samples
from tdint.written_numbers import how_many

_IMPLAUSIBLE = 100.0
"""Ten times gravity, m/s^2: four times the largest ground acceleration ever recorded."""

_IMPOSSIBLE = 1e6
"""m/s^2; from here on the units are wrong, whatever they are: squares and integrals would leave what floats hold."""

_OFFSET = 0.02


@dataclass(frozen=True)
class Channel:
    """The traces of a file that share one id, in file order."""

    id: str
    code: str
    traces: tuple[Any, ...]


def group_channels(traces: Sequence[Any]) -> list[Channel]:
    """Gather the traces of each channel, in the order in which the channels appear in the file."""
    groups: dict[str, list[Any]] = {}
    for trace in traces:
        groups.setdefault(trace.id, []).append(trace)
    return [Channel(name, str(members[0].stats.channel), tuple(members)) for name, members in groups.items()]


def join(channel: Channel, label: str) -> Any:
    """Join a channel's traces, which a file may hold in pieces, to one without gaps.

    Returns
    -------
    obspy.Trace
        At least two finite samples at a positive sampling interval; the type of the numbers is the file's.

    Raises
    ------
    RecordError
        A gap, an overlap, a change of the sampling interval, or samples that are missing or not finite.
    """
    pieces = sorted((t for t in channel.traces if len(t.data)), key=lambda trace: trace.stats.starttime)
    if not pieces:
        raise RecordError(f"{label}: the channel has no samples")
    for piece in pieces:
        _check_clock(piece, label)
        _check_unmasked(piece, label)
    for before, after in pairwise(pieces):
        _check_adjacent(before, after, label)
    whole = pieces[0]
    if len(pieces) > 1:
        whole = whole.copy()
        whole.data = np.concatenate([piece.data for piece in pieces])
    if len(whole.data) < 2:
        raise RecordError(f"{label}: one sample only; a record needs two at least")
    check_finite(whole.data, float(whole.stats.delta), label)
    return whole


def check_equal_sampling(intervals: Sequence[tuple[str, float]], source: str) -> None:
    """Raise RecordError unless all channels (id, interval in s) have the same sampling interval."""
    for name, dt in intervals:
        if not isclose(dt, intervals[0][1], rel_tol=1e-6):
            raise RecordError(
                f"{source}: {name} is sampled at {dt:g} s and {intervals[0][0]} at {intervals[0][1]:g} s; "
                "choose one component"
            )


def doubts(acceleration: NDArray[np.float64]) -> tuple[str, ...]:
    """Notes about an acceleration (m/s^2, shape (samples,)) that can hardly be a ground motion as it stands."""
    peak, mean = float(np.max(np.abs(acceleration))), float(np.mean(acceleration))
    notes = []
    if peak > _IMPLAUSIBLE:
        notes.append(f"the largest acceleration is {peak:.4g} m/s^2; are the units right?")
    if peak == 0.0:
        notes.append("all samples are zero")
    elif abs(mean) > _OFFSET * peak:
        notes.append(f"the mean is {mean:.3g} m/s^2, {abs(mean) / peak:.0%} of the peak: a zero offset is left in?")
    return tuple(notes)


def check_finite(samples: NDArray[Any], dt: float, label: str) -> None:
    """Raise RecordError with the number and the first place of samples that are no finite numbers."""
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        first = int(bad[0])
        raise RecordError(
            f"{label}: {bad.size} of {samples.size} samples are not finite numbers, the first is sample {first} "
            f"(counted from 0) at {first * dt:g} s; repair or cut the record"
        )


def check_possible(acceleration: NDArray[np.float64], label: str) -> None:
    """Raise RecordError for an acceleration (m/s^2) that nothing on this planet has."""
    peak = float(np.max(np.abs(acceleration)))
    if peak > _IMPOSSIBLE:
        raise RecordError(f"{label}: the largest acceleration would be {peak:.4g} m/s^2; the units cannot be right")


def _check_clock(trace: Any, label: str) -> None:
    dt = float(trace.stats.delta)
    if not (isfinite(dt) and dt > 0.0):
        raise RecordError(f"{label}: the sampling interval is {dt:g} s; it must be positive")
    try:
        str(trace.stats.starttime), str(trace.stats.endtime)
    except Exception:  # Python's and ObsPy's calendars raise different kinds beyond their last year.
        raise RecordError(f"{label}: the time of the record is beyond the calendar; its header is damaged") from None


def _check_adjacent(before: Any, after: Any, label: str) -> None:
    """The second trace must begin one sampling interval after the end of the first, to half an interval."""
    dt = float(before.stats.delta)
    if not isclose(dt, after.stats.delta, rel_tol=1e-6):
        raise RecordError(
            f"{label}: the sampling interval changes from {dt:g} s to {after.stats.delta:g} s at "
            f"{after.stats.starttime}; cut the record there"
        )
    if (before.data.dtype.kind == "f") != (after.data.dtype.kind == "f"):
        raise RecordError(f"{label}: the samples before {after.stats.starttime} and after are of different types")
    slip = float(after.stats.starttime - before.stats.endtime) - dt
    if abs(slip) > 0.5 * dt:
        what = f"a gap of {slip:.6g} s" if slip > 0.0 else f"an overlap of {-slip:.6g} s"
        raise RecordError(f"{label}: {what} after {before.stats.endtime}; cut the record to its unbroken part")


def _check_unmasked(trace: Any, label: str) -> None:
    missing = masked_samples(trace.data)
    if missing:
        raise RecordError(
            f"{label}: {how_many(missing, 'sample')} marked as missing; cut the record to its unbroken part"
        )
