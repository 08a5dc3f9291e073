"""Files of GNS Science, New Zealand (GeoNet): V1A (uncorrected) and V2A (corrected), three
components per file.

Each component consists of 16 lines of text, 40 integers (10I8), 60 reals (10F8.0) and accelerations
in mm/s^2. V2A files also contain velocities in mm/s and displacements in mm. Each line has ten
values (Cousins, GNS accelerogram data files, standard format, 2008).
"""

from __future__ import annotations

from math import inf, isclose

from tdint.arrays import max_absolute
from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import NUMBER, Lines, recognizer
from tdint.ground_motion.formats.series import Header, Series, by_parts, moment

_TEXTS, _INTEGERS, _REALS, _WIDTH = 16, 40, 60, 8
"""Numbers of lines of text, of integers and of reals in the header of a component, and characters
per number."""

_TITLE = r"^\s*(?:un)?corrected accelerogram"
_SITE = r"^\s*Site\s+(\S+)"
_COMPONENT = r"^\s*Component\s+(\S+)"
_ORIGIN = r"^\s*(\d{4}\s+[A-Z]{3,9}\s+\d{1,2}\s+\d\d:\d\d:\d\d)(?:\.\d*)?\s+UTC?\b"
"""Pattern of the origin time of the earthquake, UTC."""
_PEAK = rf"^\s*Acceleration:\s+peak\s+({NUMBER})\s*mm/s/s"
_RAW_UNITS = rf"^\s*Raw readings in units of\s+({NUMBER})\s*mm/s/s"
_INTERVAL = rf"\bat\s+(?:intervals of\s+({NUMBER})\s*s|({NUMBER})\s*s(?:ec)?\s+intervals)"

_YEAR, _MONTH, _DAY, _HOUR, _MINUTE, _MILLISECONDS = 8, 9, 18, 19, 38, 39
"""Indices of the time of the first sample (UTC) in the integers."""

_COUNTS = (33, 34, 35)
"""Indices of the numbers of accelerations, velocities and displacements in the integers."""

_STEP = 25  # index of the sampling interval in the reals of the header
_MILLI = 1e-3  # velocity is in mm/s, displacement in mm


@recognizer
def is_geonet(lines: list[str]) -> object:
    """Return True if a file starts with the title of a GeoNet file and the name of the site."""
    return Header(lines[:1]).match(_TITLE) and Header(lines[1:2]).match(_SITE)


@by_parts
def read_geonet(lines: Lines) -> list[Series]:
    """Read and return the acceleration of the component that starts at the next line, with the
    peaks of its velocity and displacement, in a list of length 1."""
    header = Header(lines.take() for _ in range(_TEXTS))
    if not Header(header[:1]).match(_TITLE):
        raise RecordError(
            f"the header of a component must start in line {lines.number - _TEXTS + 1}"
        )
    integers = lines.numbers(_INTEGERS, _WIDTH).tolist()
    reals = lines.numbers(_REALS, _WIDTH).tolist()
    accelerations, *integrals = (lines.numbers(int(integers[index]), _WIDTH) for index in _COUNTS)
    # The integrals are the velocities and the displacements; V1A files contain neither.
    pgv, pgd = (_MILLI * max_absolute(samples) if samples.size else None for samples in integrals)
    # The header states the sampling interval as a number and in a sentence; both must agree.
    dt = reals[_STEP]
    match = header.match(_INTERVAL)
    in_text = match[1] or match[2] if match else ""
    if in_text and not isclose(float(in_text), dt, rel_tol=1e-3):
        raise RecordError(
            f"the header of the component states the sampling interval as {dt:g} s as a number, "
            f"but as {in_text} s in the text"
        )
    # Samples of volume 1 may be film readings, in a fraction or multiple of the unit.
    factor = header.field(_RAW_UNITS)
    if factor and not 0.0 < float(factor) < inf:
        raise RecordError(
            f"the unit of readings must be positive and finite, but the header states {factor} "
            "mm/s/s"
        )
    units = f"{factor} mm/s^2" if factor and float(factor) != 1.0 else "mm/s^2"
    year, month, day, hour, minute = (
        integers[index] for index in (_YEAR, _MONTH, _DAY, _HOUR, _MINUTE)
    )
    series = Series(
        accelerations,
        dt,
        units,
        channel=header.code(_COMPONENT).upper(),
        station=header.code(_SITE),
        start=moment(year, month, day, hour, minute, integers[_MILLISECONDS] / 1000.0),
        units_from="format",
        event=header.field(_ORIGIN),
        pgv=pgv,
        pgd=pgd,
        peak=header.peak(_PEAK, units, "mm/s^2"),
    )
    return [series]
