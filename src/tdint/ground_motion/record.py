"""A ground-motion record: acceleration in m/s^2 at equal steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Input:
    """A file that a result depends on, as the user named it, and the SHA-256 of the bytes that were read from it."""

    file: str
    sha256: str


@dataclass(frozen=True)
class Record:
    """One component of a ground motion.

    Attributes
    ----------
    acceleration : ndarray, shape (samples,)
        Ground acceleration, m/s^2, read-only float64.
    dt : float
        Sampling interval, s.
    start : str
        Time of the first sample, ISO 8601 (UTC), empty if the file does not tell.
    id : str
        Network, station, location and channel joined by dots, as far as known.
    component : str
        The component's name (the channel code for MiniSEED: HNE).
    source : str
        The file as the user named it; `-` for standard input.
    notes : tuple of str
        What the reader assumed or did, one sentence each, for a person to see.
    units : str
        Units of the file's samples; empty for a record that comes from no file.
    units_from : str
        How they are known: `format` (all its files have them), `file`, `given` (by the user), `assumed`, or
        `inventory` (counts whose instrument's response was removed).
    quantity : str
        What the file's samples are: `acceleration`, or the `velocity` or `displacement` that was differentiated.
    warnings : tuple of str
        What the reader assumed that changes what the numbers mean: a person must see it.
    inputs : tuple of Input
        The files that it was read from: its own, and the inventory if there was one.
    processing : tuple of str
        What was done to it on request, one sentence a step; they stand among the notes, too.
    compared : tuple of str
        What its file states of itself (number of samples, peak, checksum) and was compared with the samples; empty if
        the file states nothing.
    scale : float
        What the acceleration has been multiplied by since it was read.
    """

    acceleration: NDArray[np.float64]
    dt: float
    start: str
    id: str
    component: str
    source: str
    notes: tuple[str, ...] = ()
    units: str = ""
    units_from: str = ""
    quantity: str = "acceleration"
    warnings: tuple[str, ...] = ()
    inputs: tuple[Input, ...] = ()
    processing: tuple[str, ...] = ()
    compared: tuple[str, ...] = ()
    scale: float = 1.0

    def __post_init__(self) -> None:
        samples = np.ascontiguousarray(self.acceleration, dtype=np.float64)
        if samples is self.acceleration or samples.base is not None:
            samples = samples.copy()
        samples.flags.writeable = False
        object.__setattr__(self, "acceleration", samples)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return (self.acceleration.size - 1) * self.dt

    @property
    def pga(self) -> float:
        """Peak ground acceleration at the samples, m/s^2."""
        return float(np.max(np.abs(self.acceleration)))

    def scaled(self, factor: float) -> Record:
        """The same record with its acceleration multiplied by `factor`."""
        return replace(self, acceleration=self.acceleration * factor, scale=self.scale * factor)
