"""What the uncorrected records (volume 1) of CSMIP and USC have in common: headers, and pairs of time and acceleration.

Both descend from the California Institute of Technology's "Blue Book" tapes (Hudson et al., EERL 69-20, 1969).
"""

from __future__ import annotations

import re
import warnings
from typing import Unpack

import numpy as np

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import COUNT, Lines
from tdint.ground_motion.formats.series import Codes, Series, first_match, required_units
from tdint.ground_motion.formats.steps import equal_steps, finest_step

REAL_WIDTH = 10
REALS = 50

_INTEGERS = re.compile(r"\s*-?\d[-\d\s]{60,}")
_LAST_INTEGERS = re.compile(r"[-\d\s]+")
_POINTS = re.compile(rf"\bNO\. OF POINTS\s*=\s*({COUNT})\b", re.IGNORECASE)
_UNITS = re.compile(r"\bSEC AND\s+([A-Z/^0-9]+)", re.IGNORECASE)
_PAIR_WIDTH = 7

_SLACK = 2e-3
"""Part of the duration by which times on film may be off equal steps: the drive of the film was not even."""


def text_header(lines: Lines) -> list[str]:
    """A channel's lines of text; the integers after them, of which nothing is needed, are passed over."""
    texts = lines.take_until(_INTEGERS.fullmatch, "header of integers")
    while (line := lines.peek()) is not None and _LAST_INTEGERS.fullmatch(line):
        lines.take()
    return texts


def read_pairs(lines: Lines, texts: list[str], **codes: Unpack[Codes]) -> Series:
    """Read the pairs of time and acceleration of a channel.

    At equal steps the samples are kept as they are. Where the times are off equal steps by more than their rounding, as
    those of a film may be, the motion is linear between the file's own times, and sampled so finely that it stays the
    same: at the last decimal of the times, on which all of them lie.

    Raises
    ------
    RecordError
        They are cut off, in no unit of acceleration, or too far from equal steps.
    """
    points, units = first_match(_POINTS, texts), first_match(_UNITS, texts)
    if not points:
        raise RecordError("its header does not give the number of points")
    pairs = lines.numbers(2 * int(points[1]), _PAIR_WIDTH)
    steps = equal_steps(pairs[::2], _SLACK)
    samples, dt = pairs[1::2].copy(), steps.dt
    if steps.departure:
        times = pairs[::2] - pairs[0]
        dt = finest_step(pairs[::2], steps.dt)
        samples = np.interp(dt * np.arange(round(times[-1] / dt) + 1), times, samples)
        warnings.warn(
            f"the times in the file are up to {steps.departure:.2g} s off equal steps of {steps.dt:.6g} s: the motion "
            f"is linear between the file's own times, sampled at {dt:.6g} s",
            stacklevel=2,
        )
    return Series(samples, dt, required_units(units[1]) if units else "", **codes)
