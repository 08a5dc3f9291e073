"""ASCII files of the Engineering Strong Motion database and of ITACA (header format DYNA).

Header lines `KEY: value` are followed by a single value per line (ESM, Luzi et al. 2016; keys of
DYNA 1.0 to 1.2).
"""

from __future__ import annotations

import re

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import NUMBER, Lines, is_row_of_numbers, recognizer
from tdint.ground_motion.formats.series import Header, Series, reader, required_units, stated_peak

_COUNT, _STEP, _UNITS = "NDATA", "SAMPLING_INTERVAL_S", "UNITS"
_START = "DATE_TIME_FIRST_SAMPLE_YYYYMMDD_HHMMSS"
_PEAKS = {
    "acceleration": re.compile(r"PGA_(.+)"),
    "velocity": re.compile(r"PGV_(.+)"),
    "displacement": re.compile(r"PGD_(.+)"),
}
_TIME = (
    r"^(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)_(?P<hour>\d\d)(?P<minute>\d\d)"
    r"(?P<second>\d\d(?:\.\d+)?)$"
)


@recognizer
def is_esm(lines: list[str]) -> object:
    """Return True if a file starts with the header of an ESM file: an event name, and later the
    sampling interval."""
    has_step = any(line.startswith(f"{_STEP}:") for line in lines)
    return lines[0].startswith("EVENT_NAME:") and has_step


@reader
def read_esm(lines: Lines) -> list[Series]:
    """Read an ESM file, and return its only component: an acceleration, a velocity or
    a displacement.

    Raises
    ------
    RecordError
        The file is cut off, has more values than its header states, or contains no ground motion.
    """
    header = {}
    for line in lines.take_until(is_row_of_numbers, "value"):
        key, _colon, value = line.partition(":")
        header[key.strip()] = value.strip()
    quantity = header.get("DATA_TYPE", "ACCELERATION").lower()
    if quantity not in _PEAKS:
        raise RecordError(
            f"the file must contain a ground motion, got {quantity[:40]!r} as DATA_TYPE; allowed "
            f"are {', '.join(_PEAKS)}"
        )
    try:
        count, dt = int(header[_COUNT]), float(header[_STEP])
    except (KeyError, ValueError):
        raise RecordError(
            f"the header of the file must state {_COUNT} and {_STEP} as numbers"
        ) from None
    units = required_units(header[_UNITS], quantity) if header.get(_UNITS) else ""
    # The key of the peak ends with its unit, for example PGA_CM/S^2, which is group 1 of the match.
    key_matches = ((_PEAKS[quantity].fullmatch(key), value) for key, value in header.items())
    peaks = (
        stated_peak(value, match[1], units)
        for match, value in key_matches
        if match and re.fullmatch(NUMBER, value)
    )
    # Date and origin time (UTC) of the event
    date = re.fullmatch(r"(\d{4})(\d\d)(\d\d)", header.get("EVENT_DATE_YYYYMMDD", ""))
    clock = re.match(r"(\d\d)(\d\d)(\d\d)", header.get("EVENT_TIME_HHMMSS", ""))
    moment = [] if date is None else ["-".join(date.groups())]
    if date is not None and clock is not None:
        moment.append(":".join(clock.groups()))
    series = Series(
        lines.numbers(count),
        dt,
        units,
        channel=header.get("STREAM", ""),
        station=header.get("STATION_CODE", ""),
        location=header.get("LOCATION", ""),
        network=header.get("NETWORK", ""),
        event=" ".join([*header.get("EVENT_NAME", "").replace("_", " ").split(), *moment]),
        start=Header([header.get(_START, "")]).moment(_TIME),
        peak=next(peaks, None),
    )
    lines.expect_end()
    return [series]
