"""A ground-motion record: acceleration in m/s^2 at equal steps."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.tabular import Tabular
from tdint.written_numbers import how_many


@dataclass(frozen=True)
class Input:
    """A file that a result depends on, as the user named it, and the SHA-256 of the bytes that were read from it."""

    file: str
    sha256: str


@dataclass(frozen=True, repr=False)
class Record(Tabular):
    """One component of a ground motion.

    Raises
    ------
    RecordError
        The acceleration is no row of at least two finite real numbers, or the sampling interval is not positive.

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
    peaks : tuple of two floats or None
        Peak velocity (m/s) and displacement (m) that the file itself has beside the acceleration; None where it has
        none, or the record was processed since.
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
    peaks: tuple[float | None, float | None] = (None, None)

    def _headline(self) -> str:
        return (
            f"{self.name}: {how_many(self.acceleration.size, 'sample')}, dt {self.dt:.6g} s, PGA {self.pga:.4g} m/s^2"
        )

    def __post_init__(self) -> None:
        samples = _checked(self.acceleration, self.source)
        dt = self.dt
        if isinstance(dt, bool) or not isinstance(dt, int | float | np.number) or not 0.0 < float(dt) < math.inf:
            raise RecordError(f"{self.source or 'record'}: the sampling interval must be a positive number, got {dt!r}")
        object.__setattr__(self, "dt", float(dt))
        if samples is self.acceleration or samples.base is not None:
            samples = samples.copy()
        samples.flags.writeable = False
        object.__setattr__(self, "acceleration", samples)

    @property
    def name(self) -> str:
        """File and component, as far as there are any."""
        return " ".join(filter(None, (self.source, self.component)))

    @property
    def digest(self) -> str:
        """SHA-256 of the samples and the sampling interval."""
        return hashlib.sha256(self.acceleration.tobytes() + repr(self.dt).encode()).hexdigest()

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return (self.acceleration.size - 1) * self.dt

    @property
    def pga(self) -> float:
        """Peak ground acceleration at the samples, m/s^2."""
        return float(np.max(np.abs(self.acceleration)))

    def scaled(self, factor: float) -> Record:
        """The same record with its acceleration multiplied by `factor`.

        Raises
        ------
        RecordError
            The product is beyond what floats hold.
        """
        with np.errstate(over="ignore"):
            return self._times(factor)

    def _times(self, factor: float) -> Record:
        pgv, pgd = (None if peak is None else peak * abs(factor) for peak in self.peaks)
        return replace(self, acceleration=self.acceleration * factor, scale=self.scale * factor, peaks=(pgv, pgd))


def masked_samples(samples: NDArray[Any]) -> int:
    """How many samples are marked as missing. numpy's masks are not imported for an array that has none."""
    return 0 if type(samples) is np.ndarray else int(np.sum(np.ma.getmaskarray(samples)))


def _checked(acceleration: Any, source: str) -> NDArray[np.float64]:
    """The samples as contiguous floats, the same array where it is that already.

    Raises
    ------
    RecordError
        They are no row of at least two finite real numbers.
    """
    whose = source or "record"
    given = np.asanyarray(acceleration)
    if masked := masked_samples(given):
        raise RecordError(f"{whose}: {how_many(masked, 'sample')} masked; fill or cut them")
    if given.dtype.kind not in "iuf":
        raise RecordError(f"{whose}: the acceleration must be real numbers, got {given.dtype.name}")
    if given.ndim != 1 or given.size < 2:
        raise RecordError(f"{whose}: the acceleration must be a row of two samples at least, got shape {given.shape}")
    samples = np.ascontiguousarray(given, dtype=np.float64)
    if not np.isfinite(samples).all():
        first = int(np.argmin(np.isfinite(samples)))
        raise RecordError(f"{whose}: sample {first} (counted from 0) is {samples[first]}, no finite number")
    return samples


def component_names(records: Sequence[Record]) -> list[str]:
    """The component of each record; its full id where others of the same file have the same component, and of floors
    that tdint exported their names, F04."""
    components = {(record.source, record.id, record.component) for record in records}
    count = Counter((source, component) for source, _, component in components)
    return [record.component if count[record.source, record.component] == 1 else _full(record.id) for record in records]


IN_SI = "SI"
"""Location code with which tdint exports motions, whose samples are in SI units: MiniSEED has no place for a unit."""


def station_of(id: str) -> str:
    """The station of a channel's id NET.STA.LOC.CHA; nothing of another id."""
    parts = id.split(".")
    return parts[1] if len(parts) == 4 else ""


def _full(id: str) -> str:
    """What tells a channel from those of the same component: a floor is its station, F04."""
    exported = id.split(".")[2:3] == [IN_SI]
    return station_of(id) if exported else id
