"""Volume 1 files of the University of Southern California (Los Angeles Strong Motion Network): one component a file.

Lines of text, 100 integers (16I5), 50 reals (8F10.3) and pairs of time and acceleration, 10F7.3, in seconds and g/10.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import read_lines, recognizes
from tdint.ground_motion.formats.series import code, first_match, to_stream
from tdint.ground_motion.formats.volume1 import REAL_WIDTH, REALS, read_pairs, text_header

if TYPE_CHECKING:
    from obspy import Stream

_TITLE = re.compile(r"\s*FILE\s+\d+ OF UNCORRECTED ACCELEROGRAM DATA OF VOLUME I\b", re.IGNORECASE)
_STATION = re.compile(r"^\s*STATION USC#\s*(\w+)", re.IGNORECASE)
_COMPONENT = re.compile(r"^\s*COMP\s+(\w+)", re.IGNORECASE)


def is_usc(file: Any, **_: Any) -> bool:
    """Whether the first line is the title of this format."""
    return recognizes(file, lambda lines: _TITLE.match(lines[0]))


def read_usc(file: Any, headonly: bool = False, **_: Any) -> Stream:
    """Read a USC file; see `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        It is cut off, or its times are not in equal steps.
    """
    lines = read_lines(file)
    texts = text_header(lines)
    lines.numbers(REALS, REAL_WIDTH)
    station, component = first_match(_STATION, texts), first_match(_COMPONENT, texts)
    series = read_pairs(
        lines, texts, station=code(station[1]) if station else "", channel=component[1].upper() if component else ""
    )
    if lines.peek() is not None:
        raise RecordError(f"line {lines.number + 1} stands after the last point that the header announces")
    return to_stream([series], headonly=headonly)
