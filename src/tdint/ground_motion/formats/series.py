"""Conversion of the components of a file to ObsPy traces, with the checks for all formats."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import wraps
from typing import Any

from numpy.typing import NDArray

from tdint.arrays import max_absolute
from tdint.errors import RecordError, UsageError
from tdint.ground_motion import miniseed_checks
from tdint.ground_motion.formats.lines import NUMBER, Lines, read_lines
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.origin import MotionOrigin
from tdint.units import GROUND_MOTION, parse_units

with quiet_import():
    from obspy import Stream, Trace, UTCDateTime


CLOCK = r"(?P<hour>\d+):(?P<minute>\d+):(?P<second>\d+(?:\.\d*)?)"
"""Pattern of a time of day, for `Header.moment`."""


@dataclass(frozen=True)
class StatedPeak:
    """Maximum absolute acceleration stated in a header.

    Attributes
    ----------
    value, rounding : float
        Stated value and value of its last decimal, in `units`.
    factor : float
        Factor from the units of the samples to `units`.
    """

    value: float
    rounding: float
    units: str
    factor: float = 1.0


@dataclass(frozen=True)
class Series:
    """One component of a file.

    Attributes
    ----------
    samples : ndarray, shape (samples,)
        Samples in `units`.
    dt : float
        Sampling interval, s.
    units : str | None
        Text for `parse_units`; empty if the file does not state the units, None for counts of a
        recorder.
    channel, station, location, network : str
        Codes in the file; `channel` is the component.
    start : datetime | None
        Time of the first sample, UTC.
    peak : StatedPeak | None
        Peak acceleration in the header; None if the header does not state it.
    units_from : str
        `format` if all files of the format have these units, otherwise `file`.
    pgv, pgd : float | None
        Peaks of the velocity (m/s) and the displacement (m) if the file also contains these.
    compared : tuple of str
        Quantities, other than the peak, that the reader has compared with the header.
    quantity : str
        Quantity of the samples stated in the header (`velocity`); empty if it is not stated.
    event : str
        Earthquake named in the header, on one line; empty if it is not named.
    origin : MotionOrigin | None
        Origin stated in the header of a motion that tdint wrote.
    """

    samples: NDArray[Any]
    dt: float
    units: str | None
    channel: str = ""
    station: str = ""
    location: str = ""
    network: str = ""
    start: datetime | None = None
    peak: StatedPeak | None = None
    compared: tuple[str, ...] = (miniseed_checks.SAMPLES,)
    units_from: str = "file"
    pgv: float | None = None
    pgd: float | None = None
    quantity: str = ""
    event: str = ""
    origin: MotionOrigin | None = None

    @property
    def id(self) -> str:
        """Codes joined by dots."""
        return ".".join((self.network, self.station, self.location, self.channel))


def to_stream(series: Sequence[Series], *, headonly: bool = False) -> Stream:
    """Convert the components of a file to an ObsPy stream.

    Parameters
    ----------
    series : sequence of Series
        Components in the order of the file.

    Raises
    ------
    RecordError
        The file has no component, a component has an invalid sampling interval, or the peak in the
        header differs from the peak of the samples.
    """
    if not series:
        raise RecordError("the file contains no acceleration")
    stream = Stream()
    count = Counter(component.id for component in series)
    for number, component in enumerate(series, start=1):
        # Components with the same id are distinguished by their number in the file, which is
        # appended to the location code.
        if count[component.id] > 1:
            component = replace(component, location=f"{component.location}{number}")
        miniseed_checks.check_step(component.dt)
        statements = []
        stated = component.peak
        if stated is not None and component.samples.size:
            peak = max_absolute(component.samples) * stated.factor
            # The second term allows for the rounding errors of the conversion between units.
            rounding = stated.rounding + 1e-9 * peak
            statements.append(
                miniseed_checks.Statement(
                    miniseed_checks.PEAK,
                    abs(stated.value),
                    peak,
                    rounding,
                    stated.units,
                    component.channel,
                    measured=True,
                )
            )
        # The header of a trace also contains the attributes of tdint.
        codes = ("network", "station", "location", "channel")
        header: dict[str, Any] = {name: getattr(component, name) for name in codes} | {
            "delta": component.dt,
            "npts": component.samples.size,
            "tdint_compared": (*component.compared, *miniseed_checks.compare(statements)),
            "tdint_peaks": (component.pgv, component.pgd),
            "tdint_quantity": component.quantity,
            "tdint_event": component.event,
            "tdint_origin": component.origin,
        }
        if component.start is not None:
            header["starttime"] = UTCDateTime(component.start)
        if component.units is not None:
            header["tdint_units"] = component.units
            header["tdint_units_from"] = component.units_from
        samples = () if headonly else (component.samples,)
        stream.append(Trace(*samples, header=header))
    return stream


def reader(read: Callable[[Lines], Sequence[Series]]) -> Callable[..., Stream]:
    """Decorate a function that reads components from lines; return the function
    `read_<format>(file, headonly=False)` of the format.

    Parameters
    ----------
    read : callable
        Function that returns the components of a file from its lines. It raises RecordError if the
        file is cut off, or if its content does not match its header.
    """

    @wraps(read)
    def read_file(file: Any, headonly: bool = False, **_: Any) -> Stream:
        """Read the components of a file and convert them to a stream."""
        return to_stream(read(read_lines(file)), headonly=headonly)

    return read_file


def by_parts(read: Callable[[Lines], Sequence[Series]]) -> Callable[..., Stream]:
    """Decorate a function that reads the next part of a file; return the function
    `read_<format>(file, headonly=False)`, which reads all parts.

    Parameters
    ----------
    read : callable
        Function that returns the components of the next part from the lines of the file. It is
        called until no line remains.
    """

    def read_all(lines: Lines) -> list[Series]:
        """Read all parts of a file."""
        series: list[Series] = []
        while lines.peek() is not None:
            series += read(lines)
        return series

    return reader(wraps(read)(read_all))


def motion_units(text: str) -> str | None:
    """Convert the units in a file header to the spelling of tdint; None if the text is not a unit
    of ground motion.

    `CM/SEC/SEC` and `CMS/SEC/SEC` give cm/s^2, `G'S` gives g, `CM/SEC` gives cm/s, and `G/10` gives
    `0.1 g`.

    Parameters
    ----------
    text : str
        Units in the file header.
    """
    stripped = text.strip().strip(".,;:()[]").strip()
    # A second spelling may follow in brackets: gal (cm/s/s).
    stripped = re.sub(r"^([^(]+\S)\s*\(.*\)?$", r"\1", stripped)
    # The unit G/10 is a tenth of g.
    tenth = re.fullmatch(r"(.*\S)\s*/\s*10", stripped)
    try:
        units = parse_units(tenth[1] if tenth else stripped)
    except UsageError:
        return None
    if tenth and (units.has_factor or units.quantity != "acceleration"):
        return None
    # A unit may have several spellings; the first name with the same value is used.
    scales = GROUND_MOTION[units.quantity]
    name = next((name for name, scale in scales.items() if scale == units.scale), units.text)
    return f"0.1 {name}" if tenth else name


def required_units(text: str, quantity: str = "acceleration") -> str:
    """Return the units of samples, which must be units of `quantity`.

    Parameters
    ----------
    text : str
        Units in the header.
    quantity : str
        `acceleration` (default), `velocity` or `displacement`; empty for any ground motion.

    Raises
    ------
    RecordError
        The text is not a unit of the quantity.
    """
    units = motion_units(text)
    if units is None or quantity not in ("", parse_units(units).quantity):
        raise RecordError(
            f"the units of the samples must be a unit of {quantity or 'acceleration'}, but the "
            f"header states {text.strip()[:40]!r}"
        )
    return units


def largest_value(samples: NDArray[Any], units: str, quantity: str) -> float | None:
    """Return the maximum absolute velocity or displacement, m/s or m; None if `units` is not a unit
    of `quantity`."""
    motion = motion_units(units)
    parsed = parse_units(motion) if motion else None
    if parsed is None or parsed.quantity != quantity:
        return None
    return parsed.scale * max_absolute(samples)


def stated_peak(number: str, units: str, sample_units: str) -> StatedPeak | None:
    """Return the peak stated in a header; None if it cannot be compared with the samples.

    A comparison is impossible if the text is not a number, if the units of the peak or of the
    samples are unknown, or if they are units of different quantities.

    Parameters
    ----------
    number : str
        Peak in the spelling of the header.
    units, sample_units : str
        Units of the peak and of the samples (`Series.units`).
    """
    header_units = motion_units(units)
    if not (header_units and sample_units and re.fullmatch(NUMBER, number)):
        return None
    peak_unit, sample_unit = parse_units(header_units), parse_units(sample_units)
    if peak_unit.quantity != sample_unit.quantity:
        return None
    factor = sample_unit.scale / peak_unit.scale
    return StatedPeak(float(number), miniseed_checks.last_place(number), header_units, factor)


def moment(
    year: float,
    month: float,
    day: float,
    hour: float,
    minute: float,
    second: float,
    zone: float = 0.0,
) -> datetime | None:
    """Return a time in UTC; None if the date, the hour or the minute is not valid.

    Parameters
    ----------
    year, month, day, hour, minute, second : float
        Local time. Fractions of all numbers except the second are omitted. The second may be any
        number, also 60 and above; it is added to the time.
    zone : float
        Offset of the local time from UTC, hours, positive to the east. Default 0.
    """
    try:
        start = datetime(int(year), int(month), int(day), int(hour), int(minute))
        return start + timedelta(seconds=float(second), hours=-zone)
    except (ValueError, OverflowError):
        return None


def code(name: str) -> str:
    """Convert a name to a code: replace all characters except letters and digits by hyphens, so
    that codes can be joined by dots."""
    return re.sub(r"[\W_]+", "-", name).strip("-")


class Header(list[str]):
    """Lines of text at the start of a file or of a part, with fields that are searched by patterns.

    Patterns do not distinguish upper and lower case. The first matching line is used.
    """

    def match(self, pattern: str) -> re.Match[str] | None:
        """Return the match of a pattern in the first matching line; None if no line matches."""
        matches = (re.search(pattern, line, re.IGNORECASE) for line in self)
        return next(filter(None, matches), None)

    def field(self, pattern: str) -> str:
        """Return group 1 of a pattern; empty if no line matches."""
        match = self.match(pattern)
        return match[1] if match else ""

    def code(self, pattern: str) -> str:
        """Return group 1 of a pattern as a code (`code`); empty if no line matches."""
        return code(self.field(pattern))

    def moment(self, pattern: str) -> datetime | None:
        """Return a time (UTC) by a pattern with groups named after the parameters of `moment`; None
        if no line matches or the numbers are not a valid date."""
        match = self.match(pattern)
        if match is None:
            return None
        return moment(**{name: float(number) for name, number in match.groupdict().items()})

    def peak(self, pattern: str, sample_units: str | None, units: str = "") -> StatedPeak | None:
        """Return the peak by a pattern with the number in group 1, and its units in group 2 if they
        are not specified; None if no line matches or if `stated_peak` cannot compare the peak."""
        match = self.match(pattern)
        return stated_peak(match[1], units or match[2], sample_units or "") if match else None
