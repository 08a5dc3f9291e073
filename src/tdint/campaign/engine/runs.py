"""A run of a campaign: which ground motion, how strong; and all ground motions of a chunk in one row of samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.ground_motion.record import Record

Array = NDArray[np.float64]


class Run(NamedTuple):
    """A ground motion by its number, the factor on it, and which of a building's draws it is (0: none was drawn)."""

    motion: int
    scale: float
    sample: int = 0


@dataclass(frozen=True)
class Motions:
    """Ground motions by their numbers, as compiled runs take them.

    Attributes
    ----------
    records : mapping of int to Record
        The motions.
    samples : ndarray
        The accelerations of all, one after the other, m/s^2.
    starts : mapping of int to int
        Where each begins in `samples`.
    """

    records: Mapping[int, Record]
    samples: Array
    starts: Mapping[int, int]

    @classmethod
    def of(cls, records: Mapping[int, Record]) -> Motions:
        """Put some motions one after the other."""
        sizes = [record.acceleration.size for record in records.values()]
        starts = np.concatenate([[0], np.cumsum(sizes)])[:-1].astype(int).tolist()
        samples = np.concatenate([record.acceleration for record in records.values()])
        return cls(records, samples, dict(zip(records, starts, strict=True)))
