"""Ground motions that are joined to one record: main shocks and aftershocks."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, Self

import numpy as np

from tdint.arrays import immutable
from tdint.errors import UsageError
from tdint.ground_motion.processing_steps import MOST_SAMPLES
from tdint.ground_motion.record import Record

_INTERVAL_TOLERANCE = 1e-9
"""Relative difference below which two sampling intervals are considered equal; it exceeds the
rounding errors of intervals computed from sampling rates."""


def at_one_interval(records: Sequence[Record]) -> list[Record]:
    """Return records interpolated to the shortest of their sampling intervals.

    Linear interpolation does not change the ground motion, which tdint assumes to be linear between
    samples.

    Returns
    -------
    list of Record
        Records in the same order, all with the shortest sampling interval.

    Raises
    ------
    UsageError
        A sampling interval is not an integer multiple of the shortest.
    """
    shortest = min(record.dt for record in records)
    refined = []
    for record in records:
        # With an integer ratio, each original sample is also a sample of the refined record: the
        # refined record is the same motion.
        ratio = round(record.dt / shortest)
        if abs(record.dt / shortest - ratio) > _INTERVAL_TOLERANCE * ratio:
            raise UsageError(
                f"{record.name}: the sampling interval must be an integer multiple of the shortest "
                f"in the sequence, {shortest:.6g} s, got {record.dt:.6g} s; change one of them "
                "with --resample"
            )
        samples = record.acceleration
        if ratio > 1:
            size = (samples.size - 1) * ratio + 1
            samples = np.interp(np.arange(size) / ratio, np.arange(samples.size), samples)
        refined.append(replace(record, acceleration=samples, dt=shortest))
    return refined


def rest_intervals(rest: float, dt: float) -> int:
    """Return the number of sampling intervals between the last sample of a record and the first
    sample of the next record: at least 1, and at least the rest between the records.

    Raises
    ------
    UsageError
        The duration is negative, not finite, or has more than `MOST_SAMPLES` samples.
    """
    if not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError(
            f"the rest between events must be a non-negative number of seconds, got {rest!r}"
        )
    if rest / dt > MOST_SAMPLES:
        raise UsageError(
            f"rest: the pause between events must have at most {MOST_SAMPLES} samples, got "
            f"{rest / dt:.4g} ({rest:g} s with a sampling interval of {dt:g} s); reduce rest"
        )
    # The tolerance prevents an additional interval if rest / dt is an integer except for rounding.
    return max(1, math.ceil(rest / dt * (1.0 - _INTERVAL_TOLERANCE)))


def join_records(records: Sequence[Record], starts: Sequence[int]) -> Record:
    """Join records with the same sampling interval to a single record, with zeros between them.

    Attributes that are equal in all records are kept. Sources, components, notes, warnings, inputs,
    processing and header checks are combined. Other attributes that differ get their default.

    Parameters
    ----------
    records : sequence of Record
        Records in order of time, which must not overlap.
    starts : sequence of int
        Index in the joined record of the first sample of each record.

    Returns
    -------
    Record
        Joined record. It starts at the first sample of the first record and ends at the last sample
        of the last record.
    """
    samples = np.zeros(starts[-1] + records[-1].acceleration.size)
    for record, start in zip(records, starts, strict=True):
        samples[start : start + record.acceleration.size] = record.acceleration

    merged: dict[str, Any] = {}
    for name in ("notes", "warnings", "inputs", "processing"):
        # dict.fromkeys removes repeated items and keeps their order.
        merged[name] = tuple(
            dict.fromkeys(item for record in records for item in getattr(record, name))
        )
    for name in ("id", "units", "units_from", "quantity", "scale", "event"):
        values = {getattr(record, name) for record in records}
        # The defaults of a dataclass are attributes of the class; an id has no default.
        merged[name] = values.pop() if len(values) == 1 else getattr(Record, name, "")
    return replace(
        records[0],
        acceleration=samples,
        component=" + ".join(filter(None, dict.fromkeys(r.component for r in records))),
        source=" + ".join(record.source for record in records),
        header_checks=tuple(text for record in records for text in record.header_checks),
        peaks=(None, None),
        **merged,
    )


@immutable
class JoinedRecord(Record):
    """Ground motions of a main shock and its aftershocks, which an analysis applies in order.

    The attributes of `Record` describe the events joined with the specified rest, or without rest
    if `rest` is `None`. They are used only for intensity measures of the sequence. An analysis
    applies `events`, because the rest between them may depend on the building.

    Attributes
    ----------
    events : tuple of Record
        Ground motions of the events, with the same sampling interval.
    rest : float | None
        Time between events, s; None means until the building is at rest.
    fixed : int
        Number of events at the beginning that `scaled` does not change, for analyses that vary only
        the intensity of the later events.
    """

    events: tuple[Record, ...] = ()
    rest: float | None = None
    fixed: int = 0

    @classmethod
    def of(cls, records: Sequence[Record], rest: float | None, fixed: int = 0) -> Self:
        """Create a sequence from its events.

        Parameters
        ----------
        records : sequence of Record
            Ground motions in order of time.

        Raises
        ------
        UsageError
            A sampling interval is not an integer multiple of the shortest, or `rest` is negative or
            not finite.
        """
        events, starts = at_one_interval(records), [0]
        for event in events[:-1]:
            last_sample = starts[-1] + event.acceleration.size - 1
            starts.append(last_sample + rest_intervals(rest or 0.0, event.dt))
        joined = join_records(events, starts)
        attributes = {field.name: getattr(joined, field.name) for field in fields(Record)}
        return cls(**attributes, events=tuple(events), rest=rest, fixed=fixed)

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 checksum of the events, the rest between them and the number of
        events that are not scaled."""
        parts = [*(event.digest for event in self.events), repr((self.rest, self.fixed))]
        return hashlib.sha256(" ".join(parts).encode()).hexdigest()

    def scaled(self, factor: float) -> Self:
        """Return a copy of the sequence, with the accelerations of all events except the first
        `fixed` events multiplied by `factor`."""
        unscaled_events, other_events = self.events[: self.fixed], self.events[self.fixed :]
        scaled_events = [event.scaled(factor) for event in other_events]
        return self.of([*unscaled_events, *scaled_events], self.rest, self.fixed)


# ---- Export of ground motions as MiniSEED
