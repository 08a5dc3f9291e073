"""SAC (SAC manual, data format): a header of 158 words, in which much is stated that the samples tell as well."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from tdint.ground_motion.header_checks.statement import LENGTH, PEAK, SAMPLES, Damaged, Statement

_DELTA, _SMALLEST, _LARGEST, _BEGIN, _END, _MEAN = 0, 1, 2, 5, 6, 56
_VERSION, _COUNT = 76, 79
_LONGITUDES = (32, 36)
"""Places of words."""

_UNKNOWN = -12345.0
_SINGLE = 2.0**-22
"""Relative rounding of a sum of two single-precision numbers."""

_EXTREME, _AVERAGE = 1e-5, 1e-3
"""Parts of the peak by which programs round the smallest and largest sample, and the mean, which they sum in single
precision."""


@dataclass(frozen=True)
class SacHeader:
    """What the header says: numbers as they stand in it, `count` as an integer."""

    delta: float
    begin: float
    end: float
    smallest: float
    largest: float
    mean: float
    count: int


def look_at_sac(data: bytes) -> SacHeader:
    """Understand the header.

    Raises
    ------
    Damaged
        A longitude is out of all bounds: ObsPy turns it into -180..180 degrees one turn at a time, for ever from 1e30.
    """
    order = "<" if 0 <= struct.unpack_from("<i", data, 4 * _VERSION)[0] <= 20 else ">"
    words = struct.unpack_from(f"{order}70f", data)
    for place in _LONGITUDES:
        if not abs(words[place]) <= -_UNKNOWN:
            raise Damaged(f"its header gives a longitude of {words[place]:g}")
    (count,) = struct.unpack_from(f"{order}i", data, 4 * _COUNT)
    places = (_DELTA, _BEGIN, _END, _SMALLEST, _LARGEST, _MEAN)
    delta, begin, end, smallest, largest, mean = (words[place] for place in places)
    return SacHeader(delta, begin, end, smallest, largest, mean, count)


def sac_statements(header: SacHeader, traces: list[Any]) -> list[Statement]:
    """Number of samples, time of the last one, and the smallest, largest and mean sample."""
    (trace,) = traces
    size = len(trace.data)
    statements = [Statement(SAMPLES, header.count, size)]
    if _UNKNOWN not in (header.begin, header.end):
        # Some programs write the time of the sample that would follow.
        rounding = 1.01 * abs(header.delta) + _SINGLE * (abs(header.end) + abs(header.begin))
        last = header.begin + (size - 1) * header.delta
        statements.append(Statement(f"{LENGTH} (time of the last sample)", header.end, last, rounding, "s"))
    stated = (header.smallest, header.largest, header.mean)
    # Three zeros are placeholders of programs that do not fill them in.
    if size and any(stated) and trace.data.dtype.kind in "iuf":
        samples = np.asarray(trace.data, dtype=np.float64)
        found = (float(samples.min()), float(samples.max()), float(samples.mean()))
        peak = max(map(abs, found[:2]))
        parts = (_EXTREME, _EXTREME, _AVERAGE)
        names = (f"{PEAK} (smallest sample)", f"{PEAK} (largest sample)", "mean")
        statements += [
            Statement(name, number, value, part * peak)
            for name, number, value, part in zip(names, stated, found, parts, strict=True)
            if number != _UNKNOWN
        ]
    return statements
