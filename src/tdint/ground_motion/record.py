"""A ground-motion record: acceleration in m/s^2 at equal steps."""

from __future__ import annotations

import hashlib
import io
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tdint.errors import OutputError, RecordError, UsageError
from tdint.number_parsing import pluralize
from tdint.tabular import Tabular
from tdint.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class Input:
    """Input file of a result: its name as specified by the user, and the SHA-256 of its content."""

    file: str
    sha256: str


_USUAL = (1e-4, 5.0)
"""Usual range of peak accelerations of grounds and floors, g. Motions below it are not perceptible;
values above it are more than twice the maximum ever recorded."""


def peak_warnings(peak: float, name: str = "peak ground acceleration") -> tuple[str, ...]:
    """Return a warning if a peak acceleration is unusual and a wrong unit may be the reason.

    Parameters
    ----------
    peak : float
        Peak acceleration, m/s^2.
    name : str
        Name of the peak in the warning. Default: peak ground acceleration.

    Returns
    -------
    tuple of str
        The warning; empty if the peak is in the usual range.
    """
    low, high = _USUAL
    if not 0.0 < peak < math.inf or low <= peak / STANDARD_GRAVITY <= high:
        return ()
    usual = f"usual: {low:g} g to {high:g} g"
    return (f"{name} {peak / STANDARD_GRAVITY:.3g} g, {usual}; check the units of the record",)


@dataclass(frozen=True, repr=False)
class Record(Tabular):
    """One component of a ground motion.

    Raises
    ------
    RecordError
        The acceleration is not a one-dimensional array of at least two finite real numbers, or the
        sampling interval is not positive.

    Attributes
    ----------
    acceleration : ndarray, shape (samples,)
        Ground acceleration, m/s^2, read-only float64.
    dt : float
        Sampling interval, s.
    start : str
        Time of the first sample, ISO 8601 (UTC); empty if the file does not state it.
    id : str
        Network, station, location and channel joined by dots; unknown codes are empty.
    component : str
        Name of the component (for MiniSEED the channel code: HNE).
    source : str
        File name as specified by the user; `-` for standard input.
    notes : tuple of str
        Assumptions and changes made by the reader, one sentence each.
    units : str
        Units of the samples in the file; empty for a record that was not read from a file.
    units_from : str
        Source of the units: `format` (all files of the format have these units), `file`, `given`
        (by the user), `assumed`, or `inventory` (the instrument response was removed from counts).
    quantity : str
        Quantity of the samples in the file: `acceleration`, or the `velocity` or `displacement`
        that was differentiated.
    warnings : tuple of str
        Assumptions made by the reader that affect the meaning of the numbers.
    inputs : tuple of Input
        Files from which the record was read, including the inventory if one was used.
    processing : tuple of str
        Requested processing, one sentence per step; these sentences are also part of `notes`.
    peaks : tuple of two floats or None
        Peak velocity (m/s) and displacement (m) in the file; None if the file does not contain
        them, or if the record was processed after reading.
    header_checks : tuple of str
        Header values (number of samples, peak, checksum) that were compared with the samples; empty
        if the header states none of them.
    scale : float
        Total factor applied to the acceleration since reading.
    event : str
        Earthquake named in the file, with its date if the file states it separately; empty if the
        file does not name an earthquake.
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
    header_checks: tuple[str, ...] = ()
    scale: float = 1.0
    peaks: tuple[float | None, float | None] = (None, None)
    event: str = ""

    def _headline(self) -> str:
        return (
            f"{self.name}: {pluralize(self.acceleration.size, 'sample')}, dt {self.dt:.6g} s, PGA "
            f"{self.pga:.4g} m/s^2"
        )

    def __post_init__(self) -> None:
        samples = _checked(self.acceleration, self.source)
        dt = self.dt
        if (
            isinstance(dt, bool)
            or not isinstance(dt, int | float | np.number)
            or not 0.0 < float(dt) < math.inf
        ):
            raise RecordError(
                f"{self.source or 'record'}: the sampling interval must be a positive number, got "
                f"{dt!r}"
            )
        object.__setattr__(self, "dt", float(dt))
        if samples is self.acceleration or samples.base is not None:
            samples = samples.copy()
        samples.flags.writeable = False
        object.__setattr__(self, "acceleration", samples)

    @property
    def name(self) -> str:
        """File and component, if known."""
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
        """Return the record with the acceleration multiplied by `factor`.

        Parameters
        ----------
        factor : float
            Factor on the acceleration.

        Raises
        ------
        RecordError
            A product exceeds the range of floats.
        """
        with np.errstate(over="ignore"):
            pgv, pgd = (None if peak is None else peak * abs(factor) for peak in self.peaks)
            return replace(
                self,
                acceleration=self.acceleration * factor,
                scale=self.scale * factor,
                peaks=(pgv, pgd),
            )


def masked_samples(samples: NDArray[Any]) -> int:
    """Return the number of masked samples. The numpy module for masks is not imported for plain
    arrays."""
    return 0 if type(samples) is np.ndarray else int(np.sum(np.ma.getmaskarray(samples)))


def _checked(acceleration: Any, source: str) -> NDArray[np.float64]:
    """Return the samples as a contiguous float array, without a copy if possible.

    Raises
    ------
    RecordError
        The samples are not a one-dimensional array of at least two finite real numbers.
    """
    label = source or "record"
    array = np.asanyarray(acceleration)
    if masked := masked_samples(array):
        raise RecordError(f"{label}: {pluralize(masked, 'sample')} masked; fill or remove them")
    if array.dtype.kind not in "iuf":
        raise RecordError(f"{label}: the acceleration must be real numbers, got {array.dtype.name}")
    if array.ndim != 1 or array.size < 2:
        raise RecordError(
            f"{label}: the acceleration must be a one-dimensional array of at least two samples, "
            f"got shape {array.shape}"
        )
    samples = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(samples).all():
        first = int(np.argmin(np.isfinite(samples)))
        raise RecordError(
            f"{label}: samples must be finite, got {samples[first]} for sample {first} (counted "
            "from 0)"
        )
    return samples


def component_names(records: Sequence[Record]) -> list[str]:
    """Return a name for each record: its component, or its full id if another record of the same
    file has the same component. Floor motions exported by tdint are named by floor (F04)."""
    components = {(record.source, record.id, record.component) for record in records}
    count = Counter((source, component) for source, _, component in components)
    names = []
    for record in records:
        full = station_of(record.id) if record.id.split(".")[2:3] == [IN_SI] else record.id
        names.append(record.component if count[record.source, record.component] == 1 else full)
    return names


IN_SI = "SI"
"""Location code of ground motions exported by tdint, which identifies SI units, because MiniSEED
has no field for units."""

UNITS_BY_LOCATION = {IN_SI: "m/s^2", "SV": "m/s", "SD": "m"}
"""Units of exported channels by location code: acceleration, velocity and displacement."""


def station_of(id: str) -> str:
    """Return the station in a channel id NET.STA.LOC.CHA; empty for any other id."""
    parts = id.split(".")
    return parts[1] if len(parts) == 4 else ""


# ---- Sequences: the events of a sequence joined to one record, with rest between the events

_SAME = 1e-9  # relative difference up to which sampling intervals are considered equal


def at_one_interval(records: Sequence[Record]) -> list[Record]:
    """Return the records at the shortest of their sampling intervals.

    The samples are interpolated linearly, which does not change motions that are linear between
    samples.

    Raises
    ------
    UsageError
        A sampling interval is not an integer multiple of the shortest.
    """
    shortest = min(record.dt for record in records)
    refined = []
    for record in records:
        # Only integer multiples keep all samples. Linear interpolation then keeps the motion.
        whole = round(record.dt / shortest)
        if abs(record.dt / shortest - whole) > _SAME * whole:
            raise UsageError(
                f"{record.name}: the sampling interval must be an integer multiple of the shortest "
                f"in the sequence, {shortest:.6g} s, got {record.dt:.6g} s; change one of them "
                "with --resample"
            )
        samples = record.acceleration
        if whole > 1:
            size = (samples.size - 1) * whole + 1
            samples = np.interp(np.arange(size) / whole, np.arange(samples.size), samples)
        refined.append(replace(record, acceleration=samples, dt=shortest))
    return refined


def samples_of(rest: float, dt: float) -> int:
    """Return the number of samples from the end of a record to the start of the next, at least 1.

    Parameters
    ----------
    rest : float
        Time of rest between the records, s.
    dt : float
        Sampling interval, s.

    Raises
    ------
    UsageError
        The time of rest is negative or not finite.
    """
    if not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError(
            f"the rest between events must be a non-negative number of seconds, got {rest!r}"
        )
    return max(1, math.ceil(rest / dt * (1.0 - _SAME)))


def one_after_another(records: Sequence[Record], starts: Sequence[int]) -> Record:
    """Join records with the same sampling interval to one record, with zeros between them.

    Attributes that are equal in all records are kept. Different sources and components are joined;
    other different attributes are reset.

    Parameters
    ----------
    records : sequence of Record
        Records in order of time.
    starts : sequence of int
        Index of the first sample of each record.
    """
    samples = np.zeros(starts[-1] + records[-1].acceleration.size)
    for record, start in zip(records, starts, strict=True):
        samples[start : start + record.acceleration.size] = record.acceleration

    taken: dict[str, Any] = {}
    for name in ("notes", "warnings", "inputs", "processing"):
        taken[name] = tuple(
            dict.fromkeys(item for record in records for item in getattr(record, name))
        )
    others = {"id": "", "units": "", "units_from": "", "quantity": "acceleration", "scale": 1.0}
    others["event"] = ""
    for name, other in others.items():
        values = {getattr(record, name) for record in records}
        taken[name] = values.pop() if len(values) == 1 else other
    return replace(
        records[0],
        acceleration=samples,
        component=" + ".join(dict.fromkeys(record.component for record in records)),
        source=" + ".join(record.source for record in records),
        header_checks=tuple(text for record in records for text in record.header_checks),
        peaks=(None, None),
        **taken,
    )


@dataclass(frozen=True, repr=False)
class JoinedRecord(Record):
    """Events of a sequence, with a rest between them that may depend on the building.

    The base record joins the events with the shortest rest. It is used only for intensity measures
    of the sequence; buildings are not analyzed under it.

    Attributes
    ----------
    shocks : tuple of Record
        Ground motions of the events, with the same sampling interval.
    rest : float or None
        Time between events, s; None means until the building is at rest.
    fixed : int
        Number of events at the beginning that are not scaled, for analyses of the response to the
        events that follow.
    """

    shocks: tuple[Record, ...] = ()
    rest: float | None = None
    fixed: int = 0

    @classmethod
    def of(cls, records: Sequence[Record], rest: float | None, fixed: int = 0) -> Self:
        """Create a sequence from its events.

        Parameters
        ----------
        records : sequence of Record
            Ground motions in order of time.
        rest : float or None
            Time between events, s; None means until the building is at rest.
        fixed : int
            Number of events at the beginning that are not scaled. Default 0.

        Raises
        ------
        UsageError
            Raised by `at_one_interval` and `samples_of`.
        """
        shocks, starts = at_one_interval(records), [0]
        for shock in shocks[:-1]:
            starts.append(
                starts[-1] + shock.acceleration.size - 1 + samples_of(rest or 0.0, shock.dt)
            )
        whole = one_after_another(shocks, starts)
        plain = {field.name: getattr(whole, field.name) for field in fields(Record)}
        return cls(**plain, shocks=tuple(shocks), rest=rest, fixed=fixed)

    @property
    def digest(self) -> str:
        parts = [*(shock.digest for shock in self.shocks), repr((self.rest, self.fixed))]
        return hashlib.sha256(" ".join(parts).encode()).hexdigest()

    def scaled(self, factor: float) -> Self:  # fixed events are not scaled
        fixed, others = self.shocks[: self.fixed], self.shocks[self.fixed :]
        return self.of([*fixed, *(shock.scaled(factor) for shock in others)], self.rest, self.fixed)


# ---- Export of ground motions as MiniSEED

_SAME_INTERVAL = 1e-12
"""Relative difference above which a changed sampling interval is reported. MiniSEED stores the rate
as a ratio of two small integers or in single precision."""


def to_mseed(motions: Sequence[Record]) -> tuple[bytes, tuple[str, ...]]:
    """Convert records to MiniSEED with accelerations in m/s^2, encoded as FLOAT64.

    Parameters
    ----------
    motions : sequence of Record
        Records with ids NET.STA.LOC.CHA, which become the channels.

    Returns
    -------
    content : bytes
        Content of the file.
    notes : tuple of str
        Note if MiniSEED stores a different sampling interval.

    Raises
    ------
    OutputError
        MiniSEED cannot represent the records, for example their sampling rate.
    """
    from tdint.ground_motion.messages import quiet_import

    with quiet_import():
        from obspy import Stream, Trace, UTCDateTime, read

    stream = Stream()
    for motion in motions:
        network, station, location, channel = motion.id.split(".")
        header = {"network": network, "station": station, "location": location, "channel": channel}
        trace = Trace(np.array(motion.acceleration), header | {"delta": motion.dt})
        trace.stats.starttime = UTCDateTime(motion.start) if motion.start else UTCDateTime(0)
        stream.append(trace)
    content = io.BytesIO()
    try:
        stream.write(content, format="MSEED", encoding="FLOAT64")
    except Exception as error:  # the writer of ObsPy raises many types of exceptions
        raise OutputError(f"the motions cannot be written as MiniSEED: {error}") from error
    dt = motions[0].dt
    stored = float(read(io.BytesIO(content.getvalue()), headonly=True)[0].stats.delta)
    notes = []
    if not math.isclose(stored, dt, rel_tol=_SAME_INTERVAL):
        notes.append(f"MiniSEED stores the sampling interval of {dt:.12g} s as {stored:.12g} s")
    return content.getvalue(), tuple(notes)
