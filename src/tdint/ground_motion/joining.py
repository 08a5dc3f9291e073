"""Records one after the other as one record: shocks of a sequence, with the ground at rest in between."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from tdint.errors import UsageError
from tdint.ground_motion.record import Record

_SAME = 1e-9  # sampling intervals that differ by less than this part are the same


def at_one_interval(records: Sequence[Record]) -> list[Record]:
    """The records at the shortest of their sampling intervals: linear between their samples, they stay as they are.

    Raises
    ------
    UsageError
        An interval is no whole multiple of the shortest.
    """
    shortest = min(record.dt for record in records)
    return [_refined(record, shortest) for record in records]


def _refined(record: Record, dt: float) -> Record:
    whole = round(record.dt / dt)
    if abs(record.dt / dt - whole) > _SAME * whole:
        raise UsageError(
            f"{record.name}: its sampling interval, {record.dt:.6g} s, is no whole multiple of the shortest of the "
            f"sequence, {dt:.6g} s: change one with --resample"
        )
    if whole == 1:
        return replace(record, dt=dt)
    size = (record.acceleration.size - 1) * whole + 1
    samples = np.interp(np.arange(size) / whole, np.arange(record.acceleration.size), record.acceleration)
    return replace(record, acceleration=samples, dt=dt)


def samples_of(rest: float, dt: float) -> int:
    """How many samples after the last of a record the next one begins, for `rest` seconds in between; at least 1.

    Raises
    ------
    UsageError
        The rest is no time.
    """
    if not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError(f"the rest between shocks must be a number of seconds, got {rest!r}")
    return max(1, math.ceil(rest / dt * (1.0 - _SAME)))


def one_after_another(records: Sequence[Record], starts: Sequence[int]) -> Record:
    """The records, of one sampling interval, as one: each begins at its sample, and zero stands in between.

    What the records have in common is that of the whole; of what differs only the sources and components are told.
    """
    samples = np.zeros(starts[-1] + records[-1].acceleration.size)
    for record, start in zip(records, starts, strict=True):
        samples[start : start + record.acceleration.size] = record.acceleration
    return replace(
        records[0],
        acceleration=samples,
        id=_common([record.id for record in records], ""),
        component=" + ".join(dict.fromkeys(record.component for record in records)),
        source=" + ".join(record.source for record in records),
        notes=tuple(dict.fromkeys(note for record in records for note in record.notes)),
        warnings=tuple(dict.fromkeys(text for record in records for text in record.warnings)),
        inputs=tuple(dict.fromkeys(one for record in records for one in record.inputs)),
        units=_common([record.units for record in records], ""),
        units_from=_common([record.units_from for record in records], ""),
        quantity=_common([record.quantity for record in records], "acceleration"),
        processing=tuple(dict.fromkeys(step for record in records for step in record.processing)),
        compared=tuple(text for record in records for text in record.compared),
        scale=records[0].scale if len({record.scale for record in records}) == 1 else 1.0,
        peaks=(None, None),
    )


def _common(values: Sequence[str], other: str) -> str:
    return values[0] if len(set(values)) == 1 else other


@dataclass(frozen=True, repr=False)
class JoinedRecord(Record):
    """Shocks of which each building makes a record of its own, for it rests between them as long as it moves.

    As a record it is that of the shortest rest: what measures them all is taken of it, and nothing is run under it.

    Attributes
    ----------
    shocks : tuple of Record
        The motions, of one sampling interval.
    rest : float or None
        Seconds between them; None: until the building is at rest.
    fixed : int
        So many of the first shocks stay as they are where the record is scaled: what is asked is what those after them
        do.
    """

    shocks: tuple[Record, ...] = ()
    rest: float | None = None
    fixed: int = 0

    @classmethod
    def of(cls, records: Sequence[Record], rest: float | None, fixed: int = 0) -> Self:
        """The shocks as they are to follow each other. Errors are those of `at_one_interval` and `samples_of`."""
        shocks, starts = at_one_interval(records), [0]
        for shock in shocks[:-1]:
            starts.append(starts[-1] + shock.acceleration.size - 1 + samples_of(rest or 0.0, shock.dt))
        whole = one_after_another(shocks, starts)
        plain = {one.name: getattr(whole, one.name) for one in fields(Record)}
        return cls(**plain, shocks=tuple(shocks), rest=rest, fixed=fixed)

    @property
    def digest(self) -> str:
        parts = [*(shock.digest for shock in self.shocks), repr((self.rest, self.fixed))]
        return hashlib.sha256(" ".join(parts).encode()).hexdigest()

    def _times(self, factor: float) -> Self:
        fixed, others = self.shocks[: self.fixed], self.shocks[self.fixed :]
        return self.of([*fixed, *(shock.scaled(factor) for shock in others)], self.rest, self.fixed)
