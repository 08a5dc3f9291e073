"""Volumes 1 and 2 of the University of Southern California (USC), Los Angeles Strong Motion
Network, with a single component per file.

Volume 1 contains lines of text, 100 integers (16I5), 50 reals (8F10.3) and pairs of time and
acceleration, 10F7.3, in seconds and g/10. Volume 2 contains the acceleration, velocity and
displacement at equal steps, 8F10.3, each after a line that states their number and the step. The
line of the acceleration may be above the integers and reals of the header. `UNITS ARE SEC AND G/10`
in volume 2 describes volume 1: the samples are in the units of the peak in the header.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.formats import csmip
from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, last_decimal, recognizer
from tdint.ground_motion.formats.series import Header, Series, largest_value, reader

_TITLE = r"^\s*FILE\s+\d+ OF UNCORRECTED ACCELEROGRAM DATA OF VOLUME I\b"
_TITLE_2 = r"\bCORRECTED ACCELEROGRAM\b|\bVOLUME\s+(?:II|2)\b|\bSTATION USC#"
"""Pattern of a line in the header of volume 2, which has no fixed title."""
_STATION = r"^\s*STATION USC#\s*(\w+)"
_COMPONENT = r"^\s*COMP\s+(\w+)"
_EARTHQUAKE = (
    r"^(.*\bEARTHQUAKE\s+[A-Z]{3,9}\.?\s+\d{1,2},?\s+\d{4}(?:[\s,-]+\d{4}\s+(?:GMT|UTC))?)"
)
"""Pattern of name, date and time of the earthquake, which are on one line."""

_BLOCK = (
    rf"^\s*({COUNT})\s+POINTS OF\s+(ACC|VEL|DIS)\w*\.?\s+DATA EQUALLY[ -]SPACED "
    rf"AT\s+({NUMBER})\s*SEC"
)
"""Pattern of the line that states the number of samples, the quantity (ACC, VEL or DIS) and the
sampling interval (s) of a block of volume 2."""

_PEAKS = {
    word: rf"\bPEAK {quantity}\w*\s*=\s*({NUMBER})\s*([A-Z/^0-9]+)"
    for word, quantity in (("ACC", "ACC"), ("VEL", "VEL"), ("DIS", "DISP"))
}
"""Patterns of the peak of each block and its units."""

_QUANTITIES = {"VEL": "velocity", "DIS": "displacement"}

_HEADER_ROWS = (7, 13, 14, 20)
"""Numbers of rows of numbers in a header: 100 integers (7 rows), 50 or 100 reals (7 or 13 rows), or
both."""

_HEADER_TEXT = 60  # maximum number of lines that contain the text of a header


@recognizer
def is_usc(lines: list[str]) -> object:
    """Return True if the first line is the title of volume 1, or if the first lines name volume 2
    and state the number of accelerations, and no line names a channel as in CSMIP files."""
    header = Header(lines[:_HEADER_TEXT])
    is_volume_2 = header.match(_TITLE_2) and header.match(_BLOCK)
    return Header(lines[:1]).match(_TITLE) or (is_volume_2 and not header.match(csmip.CHANNEL))


@reader
def read_usc(lines: Lines) -> list[Series]:
    """Read a USC file, and return its only component, an acceleration.

    Raises
    ------
    RecordError
        The file is cut off, its times are not in equal steps, or the samples of volume 2 do not
        match the header.
    """
    if Header([lines.peek() or ""]).match(_TITLE):
        header = csmip.text_header(lines)
        lines.numbers(csmip.REALS, csmip.REAL_WIDTH)  # the real numbers of the header are not used
        series = csmip.read_pairs(lines, header)
        # Text may follow the last point.
        lines.expect_no_numbers(int(header.field(csmip.POINTS)))
    else:
        series, header = _volume_2(lines)
    station, component = header.code(_STATION), header.field(_COMPONENT)
    event = " ".join(header.field(_EARTHQUAKE).split())
    return [replace(series, station=station, channel=component.upper(), event=event)]


def _volume_2(lines: Lines) -> tuple[Series, Header]:
    """Read the acceleration of volume 2 and the peaks of velocity and displacement; return also the
    lines of text.

    RecordError is raised if the number of samples of a block differs from the stated number, a
    block contains no acceleration, or the peak in the header is not the peak of the samples.
    """
    header = Header()
    blocks: dict[str, Array] = {}
    block, dt = None, 0.0
    while lines.peek() is not None:
        if not lines.at_numbers():
            header.append(lines.take())
            block = Header(header[-1:]).match(_BLOCK) or block
            continue
        first = lines.number + 1
        rows = lines.following_rows(csmip.REAL_WIDTH)
        if block is None and not blocks and len(rows) in _HEADER_ROWS:
            continue  # the integers and reals of the header are not used
        if block is None:
            raise RecordError(
                f"no line above line {first} states the number of the values that follow; complete "
                "or correct the file"
            )
        word = block[2].upper()
        # The integers and reals of the header may precede the values of the first block.
        count, sizes = int(block[1]), [0, *accumulate(map(len, rows))]
        starts = [0, *(() if blocks else _HEADER_ROWS)]
        counted = (s for s in starts if s < len(rows) and sizes[-1] - sizes[s] == count)
        if (start := next(counted, None)) is None:
            raise RecordError(
                f"the header states {count} values, but {sizes[-1]} values follow from line "
                f"{first} to line {first + len(rows) - 1}; complete the file, or correct the number"
            )
        blocks[word] = np.array([value for row in rows[start:] for value in row])
        dt = float(block[3]) if word == "ACC" else dt
        block = None
    if block or "ACC" not in blocks:
        word = block[2].upper() if block else "ACC"
        raise RecordError(f"the file is cut off: no values of {word} after its last line of text")

    # The units of the samples are the units of the peak, if the values are equal.
    samples = blocks["ACC"]
    peak = header.peak(_PEAKS["ACC"], "cm/s^2")
    if peak:
        peak = replace(peak, factor=1.0, rounding=peak.rounding + last_decimal(samples))
    pgv, pgd = (_peak(blocks, word, header) for word in ("VEL", "DIS"))
    return Series(samples, dt, peak.units if peak else "", peak=peak, pgv=pgv, pgd=pgd), header


def _peak(blocks: dict[str, Array], word: str, header: Header) -> float | None:
    """Return the maximum absolute velocity (m/s) or displacement (m) of a block; None without the
    block, or if the header does not state the peak with its units."""
    stated = header.match(_PEAKS[word])
    if word not in blocks or stated is None:
        return None
    return largest_value(blocks[word], stated[2], _QUANTITIES[word])
