"""A statement of a file about its own samples, and its comparison with the samples that were read.

Also the statements of the text formats whose header says how many samples follow: SLIST and TSPAIR, Seismic Handler's
ASCII, K-NET.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from math import isfinite
from typing import Any

import numpy as np

from tdint.errors import RecordError

SAMPLES = "number of samples"
STEP = "sampling interval"
LENGTH = "length"
PEAK = "peak"
CHECKSUM = "checksum"

SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
"""Sampling intervals beyond which no recorder of ground motion goes, s."""

_NEAR = 0.01
"""Part of a stated measured value (a peak) within which another one is remarked only: rounding, another offset."""


class Damaged(RecordError):
    """A file that contradicts itself; the message says what is wrong in it."""


@dataclass(frozen=True)
class Statement:
    """A number that a file states, and the same number of what was read.

    Attributes
    ----------
    what : str
        What it is: `SAMPLES`, `PEAK`, ...
    stated, found : float
        The two numbers, in the same unit.
    rounding : float
        Difference that the way of writing the stated number explains.
    unit : str
        For messages.
    where : str
        The part of the file, for messages; empty for all of it.
    measured : bool
        Whether the number comes from the samples' values, so that a difference up to 1 % is remarked, not refused.
    """

    what: str
    stated: float
    found: float
    rounding: float = 0.0
    unit: str = ""
    where: str = ""
    measured: bool = False

    @property
    def difference(self) -> float:
        """What the rounding does not explain; nan where a number is none."""
        return abs(self.stated - self.found) - self.rounding

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{place}the file states a {self.what} of {self.stated:.9g}{unit}, what was read has {self.found:.9g}{unit}"
        )


def compare(statements: Iterable[Statement]) -> tuple[str, ...]:
    """Compare what a file states with what was read.

    Small differences of measured values are warned about.

    Returns
    -------
    tuple of str
        What was compared, each kind once; empty if the file states nothing.

    Raises
    ------
    RecordError
        Two numbers differ; the message names both.
    """
    compared: dict[str, None] = {}  # a set in the order of arrival
    for one in statements:
        if not one.difference <= 0.0:
            near = _NEAR * max(abs(one.stated), abs(one.found))
            if not (one.measured and isfinite(near) and one.difference <= near):
                raise RecordError(f"the file is damaged, or its header is wrong: {one}")
            warnings.warn(str(one), stacklevel=2)
        compared[one.what] = None
    return tuple(compared)


def check_step(dt: float) -> None:
    """Raise Damaged for a sampling interval, s, that no recorder has."""
    if not SHORTEST_STEP <= dt <= LONGEST_STEP:
        raise Damaged(
            f"its header gives a sampling interval of {dt:g} s; recorders have {SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
        )


def last_place(number: str) -> float:
    """Value of the last digit of a number as it is written."""
    mantissa, _, exponent = number.upper().partition("E")
    return float(f"1e{int(exponent or 0) - len(mantissa.partition('.')[2])}")


_TIMESERIES = re.compile(rb"^TIMESERIES[^,\n]*,\s*(\d+) samples,\s*([^,\s]+) sps,\s*([^,\s]+)", re.MULTILINE)
_HANDLER = re.compile(rb"^LENGTH:\s*(\d+)", re.MULTILINE)
_PAIR = re.compile(rb"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d{1,6})?)\s+\S+\s*\Z")

_GAL = 0.01
_PRINTED = 0.0006
"""Rounding of K-NET's peak, printed to a thousandth of a gal, beside that of the zero offset."""

_OFFSET = 1e-3
"""Part of the peak by which another way to find the zero offset may change it."""


def look_at_timeseries(data: bytes) -> list[tuple[int, float]]:
    """Number of samples and time between the first and the last one (s, nan if not printed) of each section."""
    sections = []
    for section in re.split(rb"^(?=TIMESERIES)", data, flags=re.MULTILINE)[1:]:
        header, last = _TIMESERIES.match(section), _PAIR.search(section[-200:])
        if not header:
            raise Damaged("a header TIMESERIES does not tell samples, rate and time")
        sections.append((int(header[1]), _between(header[3], last[1]) if last else math.nan))
    return sections


def timeseries_statements(sections: list[tuple[int, float]], traces: list[Any]) -> list[Statement]:
    """Number of samples, and the time of the last one where times are printed."""
    _same_number(len(sections), len(traces))
    statements = []
    for (count, length), trace in zip(sections, traces, strict=True):
        statements.append(Statement(SAMPLES, count, len(trace.data), where=trace.id))
        if not math.isnan(length):
            dt = float(trace.stats.delta)
            statements.append(Statement(LENGTH, length, (len(trace.data) - 1) * dt, 0.1 * dt, "s", trace.id))
    return statements


def look_at_handler(data: bytes) -> list[int]:
    """Number of samples of each section of a file of Seismic Handler."""
    return [int(count) for count in _HANDLER.findall(data)]


def handler_statements(counts: list[int], traces: list[Any]) -> list[Statement]:
    """Number of samples, where the header has it."""
    if counts:
        _same_number(len(counts), len(traces))
    return [
        Statement(SAMPLES, count, len(trace.data), where=trace.id) for count, trace in zip(counts, traces, strict=False)
    ]


def knet_statements(_: None, traces: list[Any]) -> list[Statement]:
    """Number of samples, by duration and rate, and the peak without the zero offset, gal."""
    statements = []
    for trace in traces:
        header = trace.stats.get("knet")
        if header is None:
            raise Damaged("its header has no end")
        length = header.duration * trace.stats.sampling_rate
        if not (math.isfinite(length) and length > 0.0):
            raise Damaged("its header gives no length that a record can have")
        statements.append(Statement(SAMPLES, round(length), len(trace.data)))
        if len(trace.data):
            samples = np.asarray(trace.data, dtype=np.float64)
            peak = float(np.max(np.abs(samples - samples.mean()))) * trace.stats.calib / _GAL
            rounding = _PRINTED + _OFFSET * peak
            statements.append(Statement(PEAK, header.accmax, peak, rounding, "gal", measured=True))
    return statements


def _between(first: bytes, last: bytes) -> float:
    """Seconds from one printed time to another; nan if one is none."""
    try:
        start, end = (datetime.fromisoformat(text.decode("ascii")) for text in (first, last))
        return (end - start).total_seconds()
    except (ValueError, TypeError):
        return math.nan


def _same_number(stated: int, found: int) -> None:
    if stated != found:
        raise Damaged(f"it has {stated} headers of channels, {found} could be read")
