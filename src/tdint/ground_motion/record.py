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
from tdint.tabular import Tabular
from tdint.units import STANDARD_GRAVITY
from tdint.written_numbers import how_many


@dataclass(frozen=True)
class Input:
    """A file that a result depends on, as the user named it, and the SHA-256 of the bytes that were
    read from it."""

    file: str
    sha256: str


_USUAL = (1e-4, 5.0)
"""Peak accelerations of grounds and floors, g: below nobody feels it, above it is twice the largest
ever recorded."""


def doubt_of_peak(peak: float, name: str = "peak ground acceleration") -> tuple[str, ...]:
    """What is to be said of a peak acceleration, m/s^2, that a wrong unit would explain; nothing of
    a usual one."""
    low, high = _USUAL
    if not 0.0 < peak < math.inf or low <= peak / STANDARD_GRAVITY <= high:
        return ()
    usual = f"usual: {low:g} g to {high:g} g"
    return (f"{name} {peak / STANDARD_GRAVITY:.3g} g, {usual}: are the units of the record right?",)


@dataclass(frozen=True, repr=False)
class Record(Tabular):
    """One component of a ground motion.

    Raises
    ------
    RecordError
        The acceleration is no row of at least two finite real numbers, or the sampling interval is
        not positive.

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
        How they are known: `format` (all its files have them), `file`, `given` (by the user),
        `assumed`, or `inventory` (counts whose instrument's response was removed).
    quantity : str
        What the file's samples are: `acceleration`, or the `velocity` or `displacement` that was
        differentiated.
    warnings : tuple of str
        What the reader assumed that changes what the numbers mean: a person must see it.
    inputs : tuple of Input
        The files that it was read from: its own, and the inventory if there was one.
    processing : tuple of str
        What was done to it on request, one sentence a step; they stand among the notes, too.
    peaks : tuple of two floats or None
        Peak velocity (m/s) and displacement (m) that the file itself has beside the acceleration;
        None where it has none, or the record was processed since.
    header_checks : tuple of str
        What its file states of itself (number of samples, peak, checksum) and was compared with the
        samples; empty if the file states nothing.
    scale : float
        What the acceleration has been multiplied by since it was read.
    event : str
        The earthquake as its file names it, with the date if the file states one beside the name;
        empty if the file names none.
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
            f"{self.name}: {how_many(self.acceleration.size, 'sample')}, dt {self.dt:.6g} s, PGA "
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
            pgv, pgd = (None if peak is None else peak * abs(factor) for peak in self.peaks)
            return replace(
                self,
                acceleration=self.acceleration * factor,
                scale=self.scale * factor,
                peaks=(pgv, pgd),
            )


def masked_samples(samples: NDArray[Any]) -> int:
    """How many samples are marked as missing. numpy's masks are not imported for an array that has
    none."""
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
        raise RecordError(
            f"{whose}: the acceleration must be a row of two samples at least, got shape "
            f"{given.shape}"
        )
    samples = np.ascontiguousarray(given, dtype=np.float64)
    if not np.isfinite(samples).all():
        first = int(np.argmin(np.isfinite(samples)))
        raise RecordError(
            f"{whose}: sample {first} (counted from 0) is {samples[first]}, no finite number"
        )
    return samples


def component_names(records: Sequence[Record]) -> list[str]:
    """The component of each record; its full id where others of the same file have the same
    component, and of floors that tdint exported their names, F04."""
    components = {(record.source, record.id, record.component) for record in records}
    count = Counter((source, component) for source, _, component in components)
    names = []
    for record in records:
        full = station_of(record.id) if record.id.split(".")[2:3] == [IN_SI] else record.id
        names.append(record.component if count[record.source, record.component] == 1 else full)
    return names


IN_SI = "SI"
"""Location code with which tdint exports motions, whose samples are in SI units: MiniSEED has no
place for a unit."""

UNITS_BY_LOCATION = {IN_SI: "m/s^2", "SV": "m/s", "SD": "m"}
"""Units of what tdint exports: acceleration, and beside it under the same code velocity and
displacement."""


def station_of(id: str) -> str:
    """The station of a channel's id NET.STA.LOC.CHA; nothing of another id."""
    parts = id.split(".")
    return parts[1] if len(parts) == 4 else ""


# ---- Records one after the other as one record: shocks of a sequence, with the ground at rest in
# between

_SAME = 1e-9  # sampling intervals that differ by less than this part are the same


def at_one_interval(records: Sequence[Record]) -> list[Record]:
    """The records at the shortest of their sampling intervals: linear between their samples, they
    stay as they are.

    Raises
    ------
    UsageError
        An interval is no whole multiple of the shortest.
    """
    shortest = min(record.dt for record in records)
    refined = []
    for record in records:
        # Only whole multiples keep each sample, and with straight lines in between the motion
        # itself.
        whole = round(record.dt / shortest)
        if abs(record.dt / shortest - whole) > _SAME * whole:
            raise UsageError(
                f"{record.name}: its sampling interval, {record.dt:.6g} s, is no whole multiple of "
                f"the shortest of the sequence, {shortest:.6g} s: change one with --resample"
            )
        samples = record.acceleration
        if whole > 1:
            size = (samples.size - 1) * whole + 1
            samples = np.interp(np.arange(size) / whole, np.arange(samples.size), samples)
        refined.append(replace(record, acceleration=samples, dt=shortest))
    return refined


def samples_of(rest: float, dt: float) -> int:
    """How many samples after the last of a record the next one begins, for `rest` seconds in
    between; at least 1.

    Raises
    ------
    UsageError
        The rest is no time.
    """
    if not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError(f"the rest between shocks must be a number of seconds, got {rest!r}")
    return max(1, math.ceil(rest / dt * (1.0 - _SAME)))


def one_after_another(records: Sequence[Record], starts: Sequence[int]) -> Record:
    """The records, of one sampling interval, as one: each begins at its sample, and zero stands in
    between.

    What the records have in common is that of the whole; of what differs only the sources and
    components are told.
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
    """Shocks of which each building makes a record of its own, for it rests between them as long as
    it moves.

    As a record it is that of the shortest rest: what measures them all is taken of it, and nothing
    is run under it.

    Attributes
    ----------
    shocks : tuple of Record
        The motions, of one sampling interval.
    rest : float or None
        Seconds between them; None: until the building is at rest.
    fixed : int
        So many of the first shocks stay as they are where the record is scaled: what is asked is
        what those after them do.
    """

    shocks: tuple[Record, ...] = ()
    rest: float | None = None
    fixed: int = 0

    @classmethod
    def of(cls, records: Sequence[Record], rest: float | None, fixed: int = 0) -> Self:
        """The shocks as they are to follow each other. Errors are those of `at_one_interval` and
        `samples_of`."""
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

    def scaled(self, factor: float) -> Self:  # fixed shocks stay as they are
        fixed, others = self.shocks[: self.fixed], self.shocks[self.fixed :]
        return self.of([*fixed, *(shock.scaled(factor) for shock in others)], self.rest, self.fixed)


# ---- Motions as MiniSEED, as other programs and tdint itself read them

_SAME_INTERVAL = 1e-12
"""Relative difference up to which MiniSEED keeps a sampling interval: it stores a rate as a ratio
of two small whole numbers, or in single precision."""


def to_mseed(motions: Sequence[Record]) -> tuple[bytes, tuple[str, ...]]:
    """Accelerations in m/s^2 as MiniSEED: FLOAT64, a channel of each record's id (NET.STA.LOC.CHA),
    its start if known; and what there is to say of the file.

    Raises
    ------
    OutputError
        A sampling rate that MiniSEED cannot say.
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
    except Exception as error:  # ObsPy's writer raises of many kinds
        raise OutputError(f"the motions cannot be written as MiniSEED: {error}") from error
    dt = motions[0].dt
    stored = float(read(io.BytesIO(content.getvalue()), headonly=True)[0].stats.delta)
    notes = []
    if not math.isclose(stored, dt, rel_tol=_SAME_INTERVAL):
        notes.append(f"MiniSEED has a sampling interval of {stored:.12g} s for {dt:.12g} s")
    return content.getvalue(), tuple(notes)
