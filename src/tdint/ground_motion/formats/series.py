"""From what a reader found in a file to ObsPy's traces, with the checks that all formats share."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import wraps
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.formats.lines import NUMBER, Lines, read_lines
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.miniseed_checks import (
    PEAK,
    SAMPLES,
    Statement,
    check_step,
    compare,
    last_place,
)
from tdint.units import GROUND_MOTION, parse_units

with quiet_import():
    from obspy import Stream, Trace, UTCDateTime


CLOCK = r"(?P<hour>\d+):(?P<minute>\d+):(?P<second>\d+(?:\.\d*)?)"
"""Pattern of a time of the day, for `moment_in`."""


@dataclass(frozen=True)
class StatedPeak:
    """The largest absolute acceleration that a header states.

    Attributes
    ----------
    value, rounding : float
        In `units`.
    units : str
        Those of the header.
    factor : float
        From the units of the samples to these.
    """

    value: float
    rounding: float
    units: str
    factor: float = 1.0


@dataclass(frozen=True)
class Series:
    """One component as it stands in a file.

    Attributes
    ----------
    samples : ndarray, shape (samples,)
        In `units`.
    dt : float
        Sampling interval, s.
    units : str or None
        Text for `parse_units`; empty if the file does not tell, None for counts of a recorder.
    channel, station, location, network : str
        As the file names them; `channel` is the component.
    start : datetime or None
        Time of the first sample, UTC.
    peak : StatedPeak or None
        None if the header does not state it.
    units_from : str
        `format` where all files of the format have these units, else `file`.
    pgv, pgd : float or None
        Peaks of the velocity (m/s) and the displacement (m) that the file has beside the
        acceleration.
    compared : tuple of str
        What the reader has compared with the header beside the peak.
    quantity : str
        What the header calls the samples (`velocity`); empty if it does not tell.
    event : str
        The earthquake as the header names it, on one line; empty if it names none.
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
    compared: tuple[str, ...] = (SAMPLES,)
    units_from: str = "file"
    pgv: float | None = None
    pgd: float | None = None
    quantity: str = ""
    event: str = ""

    @property
    def id(self) -> str:
        """The codes joined by dots."""
        return ".".join((self.network, self.station, self.location, self.channel))


def to_stream(series: Sequence[Series], *, headonly: bool = False) -> Stream:
    """ObsPy's stream of the components of a file.

    Parameters
    ----------
    series : sequence of Series
        In the order of the file.
    headonly : bool
        Leave the samples out.

    Raises
    ------
    RecordError
        There is no component, or one with an impossible sampling interval, or the peak in the
        header is not that of the samples.
    """
    if not series:
        raise RecordError("the file holds no acceleration")
    stream = Stream()
    count = Counter(part.id for part in series)
    for number, channel in enumerate(series, start=1):
        # Components that share an id are told apart by their number in the file, as location code.
        is_alone = count[channel.id] == 1
        part = channel if is_alone else replace(channel, location=f"{channel.location}{number}")
        check_step(part.dt)
        statements = []
        if part.peak is not None and part.samples.size:
            peak = float(np.max(np.abs(part.samples))) * part.peak.factor
            rounding = part.peak.rounding + 1e-9 * peak
            stated = abs(part.peak.value)
            statements.append(
                Statement(
                    PEAK, stated, peak, rounding, part.peak.units, part.channel, measured=True
                )
            )
        stream.append(_trace(part, (*part.compared, *compare(statements)), headonly))
    return stream


def reader(read: Callable[[Lines], Sequence[Series]]) -> Callable[..., Stream]:
    """The function `read_<format>(file, headonly=False)` of a format, of what reads the components
    from its lines."""

    @wraps(read)
    def read_file(file: Any, headonly: bool = False, **_: Any) -> Stream:
        return to_stream(read(read_lines(file)), headonly=headonly)

    return read_file


def by_parts(read: Callable[[Lines], Sequence[Series]]) -> Callable[..., Stream]:
    """The same of a format whose files are made of one part after another, each read to its end by
    `read`."""

    def read_all(lines: Lines) -> list[Series]:
        series: list[Series] = []
        while lines.peek() is not None:
            series += read(lines)
        return series

    return reader(wraps(read)(read_all))


def _trace(part: Series, compared: tuple[str, ...], headonly: bool) -> Trace:
    codes = {name: getattr(part, name) for name in ("network", "station", "location", "channel")}
    header: dict[str, Any] = codes | {
        "delta": part.dt,
        "npts": part.samples.size,
        "tdint_compared": compared,
        "tdint_peaks": (part.pgv, part.pgd),
        "tdint_quantity": part.quantity,
        "tdint_event": part.event,
    }
    if part.start is not None:
        header["starttime"] = UTCDateTime(part.start)
    if part.units is not None:
        header["tdint_units"] = part.units
        header["tdint_units_from"] = part.units_from
    return Trace(header=header) if headonly else Trace(part.samples, header=header)


def motion_units(text: str) -> str | None:
    """Units of a ground motion in tdint's spelling from those of a file's header; None if they are
    none.

    `CM/SEC/SEC` are cm/s^2, `G'S` g, `CM/SEC` cm/s, and `G/10` is a tenth of g: `0.1 g`.
    """
    words = text.strip().strip(".,;:()[]").removesuffix("'S").removesuffix("'s").strip()
    tenth = re.fullmatch(r"(.*\S)\s*/\s*10", words)
    try:
        units = parse_units(tenth[1] if tenth else words)
    except UsageError:
        return None
    if tenth and (units.has_factor or units.quantity != "acceleration"):
        return None
    scales = GROUND_MOTION[units.quantity]
    name = next((name for name, scale in scales.items() if scale == units.scale), units.text)
    return f"0.1 {name}" if tenth else name


def required_units(text: str, quantity: str = "acceleration") -> str:
    """The units of a block of samples that must be those of this quantity.

    Raises
    ------
    RecordError
        They are something else's.
    """
    units = motion_units(text)
    if units is None or parse_units(units).quantity != quantity:
        raise RecordError(
            f"its header gives the samples in {text.strip()[:40]!r}, which is no unit of {quantity}"
        )
    return units


def motion_scale(text: str, quantity: str) -> float | None:
    """Value in SI units of the unit of a velocity or a displacement; None if it is something
    else's."""
    motion = motion_units(text)
    units = parse_units(motion) if motion else None
    return units.scale if units and units.quantity == quantity else None


def stated_peak(number: str, units: str, of_samples: str) -> StatedPeak | None:
    """A peak as a header states it, in the units of the samples; None if units are missing or no
    acceleration's.

    Parameters
    ----------
    number : str
        As it is written.
    units, of_samples : str
        Those of the peak, and of the samples (`Series.units`).
    """
    stated = motion_units(units)
    if not (stated and of_samples and re.fullmatch(NUMBER, number)):
        return None
    of_header, of_series = parse_units(stated), parse_units(of_samples)
    if of_header.quantity != of_series.quantity:
        return None
    factor = of_series.scale / of_header.scale
    return StatedPeak(float(number), last_place(number), stated, factor)


def first_match(pattern: re.Pattern[str], texts: Sequence[str]) -> re.Match[str] | None:
    """Where a pattern is found first in lines of text."""
    return next(filter(None, map(pattern.search, texts)), None)


def header_field(pattern: re.Pattern[str], texts: Sequence[str]) -> str:
    """What a pattern's group finds in the first line of text that fits, empty if none does."""
    match = first_match(pattern, texts)
    return match[1] if match else ""


def moment(
    year: float,
    month: float,
    day: float,
    hour: float,
    minute: float,
    second: float,
    zone: float = 0.0,
) -> datetime | None:
    """A time in UTC from its numbers and the zone's hours east of it; None if they are no date."""
    try:
        start = datetime(int(year), int(month), int(day), int(hour), int(minute))
        return start + timedelta(seconds=float(second), hours=-zone)
    except (ValueError, OverflowError):
        return None


def moment_in(pattern: re.Pattern[str], texts: Sequence[str]) -> datetime | None:
    """The time where a pattern is found first, whose groups are named as the numbers of `moment`;
    None for none."""
    match = first_match(pattern, texts)
    return (
        moment(**{name: float(number) for name, number in match.groupdict().items()})
        if match
        else None
    )


def code(name: str) -> str:
    """A name as a code: what is neither letter nor digit becomes a hyphen, so that dots can divide
    codes."""
    return re.sub(r"[\W_]+", "-", name).strip("-")
