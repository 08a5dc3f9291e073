"""A ground-motion record: acceleration in m/s^2 at equal steps."""

from __future__ import annotations

import hashlib
import io
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, immutable, max_absolute
from tdint.errors import OutputError, RecordError
from tdint.ground_motion.origin import MotionOrigin
from tdint.number_parsing import pluralize
from tdint.tabular import Tabular
from tdint.units import STANDARD_GRAVITY


class Input(NamedTuple):
    """Input file of a result: its name as specified by the user, and the SHA-256 of its content."""

    file: str
    sha256: str


_USUAL_PEAKS = (1e-4, 1.5)
"""Usual range of peak ground accelerations, g. Motions below this range are not perceptible; of the
horizontal motions ever recorded, very few are above it."""
MAX_FLOOR_PEAK = 5.0
"""Maximum usual peak acceleration of a floor, g."""
_MAX_PGV = 4.0
"""Maximum usual peak ground velocity, m/s; the largest recorded one (Chi-Chi 1999) is 3 m/s."""


def peak_warnings(
    peak: float, name: str = "peak ground acceleration", high: float = _USUAL_PEAKS[1]
) -> tuple[str, ...]:
    """Return a warning if a peak acceleration is unusual, because its unit may be wrong.

    Zero, nan and infinite peaks give no warning: they would not be usual with another unit.

    Parameters
    ----------
    name : str
        Name of the peak in the warning. Default: peak ground acceleration.
    high : float
        Maximum usual peak, g.

    Returns
    -------
    tuple of str
        The warning; empty if the peak is in the usual range.
    """
    low = _USUAL_PEAKS[0]
    if not 0.0 < peak < math.inf or low <= peak / STANDARD_GRAVITY <= high:
        return ()
    return (
        f"unusual {name}: {peak / STANDARD_GRAVITY:.3g} g; usual values are {low:g} g to "
        f"{high:g} g (check the units and the scale of the record)",
    )


_MIN_SIGNED = 20
"""Samples; a shorter motion may have a single sign by accident."""


def has_one_sign(samples: NDArray[Any]) -> bool:
    """Return True if at least 20 samples have no value below zero, or no value above. Spectra,
    lists of peaks and resultants have a single sign; zeros do not."""
    if samples.size < _MIN_SIGNED:
        return False
    low, high = float(np.min(samples)), float(np.max(samples))
    return low >= 0.0 < high or low < 0.0 >= high


def velocity_warnings(record: Record) -> tuple[str, ...]:
    """Return a warning if the peak ground velocity is unusual although the peak acceleration is
    not, because the unit or the sampling interval may be wrong.

    A velocity that grows linearly, from an acceleration with a mean value, is subtracted.
    """
    velocity = record.acceleration - record.acceleration.mean()
    np.cumsum(velocity, out=velocity)
    velocity *= record.dt
    pgv = max_absolute(velocity)
    if peak_warnings(record.pga) or not _MAX_PGV < pgv < math.inf:
        return ()
    return (
        f"unusual peak ground velocity: {pgv:.3g} m/s; usual values are at most {_MAX_PGV:g} m/s "
        "(check the units, the sampling interval and the baseline of the record)",
    )


@immutable
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
        Assumptions and changes made by the reader, one sentence for each.
    units : str
        Units of the samples in the file; empty for a record that was not read from a file.
    units_from : str
        Source of the units: `format` (all files of the format have these units), `file`, `given`
        (by the user), `assumed`, or `inventory` (the instrument response was removed from counts).
    quantity : str
        Quantity of the samples in the file: `acceleration`, or the `velocity` or `displacement`
        of a cubic spline.
    warnings : tuple of str
        Assumptions made by the reader that affect the meaning of the values.
    inputs : tuple of Input
        Files that the record was read from, including the inventory if one was used.
    processing : tuple of str
        Requested processing, one sentence per step; these sentences are also part of `notes`.
    peaks : tuple of two floats | None
        Peak velocity (m/s) and displacement (m) in the file; None if the file does not contain
        them, or if the record was processed after reading.
    header_checks : tuple of str
        Header values (number of samples, peak, checksum) that were compared with the samples; empty
        if the header states no such value.
    scale : float
        Total factor applied to the acceleration since reading.
    event : str
        Earthquake named in the file, with its date if the file states it separately; empty if the
        file does not name an earthquake.
    origin : MotionOrigin or None
        Seed, target and changes of a motion that `tdint match` or `tdint info --export` wrote;
        None for other files.
    is_one_of_several : bool
        The file has further channels with the name of the component, or further stations.
    """

    acceleration: Array
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
    origin: MotionOrigin | None = None
    is_one_of_several: bool = False

    def _headline(self) -> str:
        """Return the name, number of samples, sampling interval and peak ground acceleration."""
        return (
            f"{self.name}: {pluralize(self.samples, 'sample')}, dt {self.dt:.6g} s, PGA "
            f"{self.pga:.4g} m/s^2"
        )

    def __post_init__(self) -> None:
        """Validate the samples and the sampling interval, and make the samples read-only.

        Raises
        ------
        RecordError
            The samples or the sampling interval are invalid.
        """
        label = self.source or "record"
        array = np.asanyarray(self.acceleration)
        if masked := masked_samples(array):
            raise RecordError(f"{label}: {pluralize(masked, 'sample')} masked; fill or remove them")
        if array.dtype.kind not in "iuf":  # signed integers, unsigned integers, floats
            raise RecordError(
                f"{label}: the acceleration must be real numbers, got {array.dtype.name}"
            )
        if array.ndim != 1 or array.size < 2:
            raise RecordError(
                f"{label}: the acceleration must be a one-dimensional array of at least two "
                f"samples, got shape {array.shape}"
            )
        samples = np.ascontiguousarray(array, dtype=np.float64)
        if not np.isfinite(samples).all():
            first = int(np.argmin(np.isfinite(samples)))
            raise RecordError(
                f"{label}: samples must be finite, got {samples[first]} for sample {first} "
                "(counted from 0)"
            )
        dt = self.dt
        if (
            isinstance(dt, bool)
            or not isinstance(dt, int | float | np.number)
            or not 0.0 < float(dt) < math.inf
        ):
            raise RecordError(
                f"{label}: the sampling interval must be a positive number of seconds, got {dt!r}"
            )
        # The dataclass is frozen, so its attributes can only be replaced by object.__setattr__.
        object.__setattr__(self, "dt", float(dt))
        # An array that shares memory with an array of the caller is copied, because it must not
        # become read-only for the caller, and the caller must not change it.
        shares_memory = samples is self.acceleration or samples.base is not None
        if shares_memory:
            samples = samples.copy()
        samples.flags.writeable = False
        object.__setattr__(self, "acceleration", samples)

    @property
    def name(self) -> str:
        """File name and component name separated by a space; an unknown name is omitted."""
        return " ".join(filter(None, (self.source, *component_names([self]))))

    @property
    def written_origin(self) -> MotionOrigin:
        """Origin of an output file of this record. A matched motion that is processed further keeps
        its seed and target."""
        first = self.origin or MotionOrigin(self.source, self.component)
        return first._replace(processing=self.processing)

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 checksum of the samples and the sampling interval."""
        return hashlib.sha256(self.acceleration.tobytes() + repr(self.dt).encode()).hexdigest()

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.acceleration.size

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return (self.samples - 1) * self.dt

    @property
    def time(self) -> Array:
        """Times of the samples from 0 at the first sample, s, shape (samples,)."""
        return np.asarray(self.dt * np.arange(self.samples), np.float64)

    @property
    def pga(self) -> float:
        """Peak ground acceleration, m/s^2: the maximum absolute value of the samples."""
        return max_absolute(self.acceleration)

    def scaled(self, factor: float) -> Record:
        """Return a copy of the record with the acceleration multiplied by `factor`.

        The peak velocity and displacement of the file are multiplied by its absolute value.

        Parameters
        ----------
        factor : float
            Factor on the acceleration; may be negative.

        Returns
        -------
        Record
            Scaled record. Its attribute `scale` is the product of all factors since reading.

        Raises
        ------
        RecordError
            A product exceeds the range of floats.
        """
        # Overflow is not reported here: infinite samples are an error in the new record.
        with np.errstate(over="ignore"):
            pgv, pgd = (None if peak is None else peak * abs(factor) for peak in self.peaks)
            return replace(
                self,
                acceleration=self.acceleration * factor,
                scale=self.scale * factor,
                peaks=(pgv, pgd),
            )


def masked_samples(samples: NDArray[Any]) -> int:
    """Return the number of masked samples in a NumPy array, which is 0 for a plain array.

    ObsPy returns traces with gaps as masked arrays.
    """
    # A plain array has no mask. Returning early avoids the import of numpy.ma at startup.
    return 0 if type(samples) is np.ndarray else int(np.sum(np.ma.getmaskarray(samples)))


def component_names(records: Sequence[Record]) -> list[str]:
    """Return a name for each record that distinguishes it from the other channels of its file, also
    from channels that were not read or not selected.

    The name is the component. If several channels of a file have the same component, or the file
    has several stations, the name is the id NET.STA.LOC.CHA, or only the station code for motions
    exported by tdint, where the station is the floor (F04), unless a station has several channels.
    """
    channels = {(record.source, record.id, record.component) for record in records}
    channel_count = Counter((source, component) for source, _, component in channels)
    station_count = Counter((source, station_of(id)) for source, id, _ in channels)
    stations_of_source = Counter(source for source, _ in station_count)
    names = []
    for record in records:
        # The slice is empty for an id without a location code.
        location = record.id.split(".")[2:3]
        station = station_of(record.id)
        is_floor = location == [SI_LOCATION] and station_count[record.source, station] == 1
        unique_name = station if is_floor else record.id
        is_shared = (
            channel_count[record.source, record.component] > 1
            or stations_of_source[record.source] > 1
            or record.is_one_of_several
        )
        names.append(unique_name if is_shared else record.component)
    return names


def named_components(records: Sequence[Record]) -> list[tuple[str, str]]:
    """Return the file of each record and the name of its component (`component_names`)."""
    return [*zip((record.source for record in records), component_names(records), strict=True)]


SI_LOCATION = "SI"
"""Location code of accelerations exported by tdint. It states that the samples are in SI units,
because MiniSEED has no field for units."""

UNITS_BY_LOCATION = {SI_LOCATION: "m/s^2", "SV": "m/s", "SD": "m"}
"""Units of exported channels by location code: acceleration, velocity and displacement."""


def component_of(id: str, code: str) -> str:
    """Return the component of a channel: its code, or empty for the id that tdint exports for a
    motion without codes (.R01.SI.HN1). The file name then states the component, as before the
    export."""
    return "" if re.fullmatch(r"\.R\d+\.(?:SI|SV|SD)\.HN1", id) else code


def station_of(id: str) -> str:
    """Return the station code in a channel id NET.STA.LOC.CHA; empty for an id of another form."""
    parts = id.split(".")
    return parts[1] if len(parts) == 4 else ""


# ---- Sequences: main shock and aftershocks are joined to one record, with rest between them

_REPORTED_INTERVAL_CHANGE = 1e-12
"""Relative change of the sampling interval by the export above which a note is returned. MiniSEED
stores the sampling rate as a ratio of two 16-bit integers or in single precision."""


def to_mseed(motions: Sequence[Record]) -> tuple[bytes, tuple[str, ...]]:
    """Convert records to the content of a MiniSEED file, with samples encoded as FLOAT64.

    A record without a start time starts at 1970-01-01T00:00:00.

    Parameters
    ----------
    motions : sequence of Record
        Records with ids NET.STA.LOC.CHA; each record becomes a channel. Their samples are written
        without conversion of units.

    Returns
    -------
    notes : tuple of str
        Note about the sampling interval if MiniSEED cannot store it exactly; otherwise empty.

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
    except Exception as error:  # ObsPy does not document which exceptions its writer raises
        raise OutputError(
            f"ground motions with a sampling interval of {motions[0].dt:.6g} s cannot be written "
            f"as MiniSEED: {error}"
        ) from error
    dt = motions[0].dt
    stored = float(read(io.BytesIO(content.getvalue()), headonly=True)[0].stats.delta)
    notes = []
    if not math.isclose(stored, dt, rel_tol=_REPORTED_INTERVAL_CHANGE):
        notes.append(f"MiniSEED stores the sampling interval of {dt:.12g} s as {stored:.12g} s")
    return content.getvalue(), tuple(notes)
