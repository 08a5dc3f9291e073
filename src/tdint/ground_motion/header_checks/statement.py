"""A statement of a file about its own samples, and its comparison with the samples that were read."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite

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
