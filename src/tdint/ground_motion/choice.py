"""What is taken of a file of records, and what is done to it;
`tdint.ground_motion.processing_steps` does it.

The steps are always taken in this order: trim, baseline, pad, filters, resample. So the mean is
that of the part which is used, the filters see the record between zeros, and the zeros of a pad
take up what a filter spreads beyond the ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Self

from tdint.errors import RecordError, UsageError

SAME_STEP = 1e-3
"""Relative difference up to which two statements of the sampling interval agree."""

MOST_LINES = 1_000_000  # of a header: beyond any file, a mistaken number

BASELINES = ("constant", "linear")
CORNERS = 4  # of the filter where none are given: 24 dB an octave
MOST_CORNERS = 10  # steeper than any practice asks for


class _Wishes:
    """A class of data of which each field may be left open, as None or an empty tuple."""

    def _given(self) -> dict[str, Any]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {name: value for name, value in values.items() if value not in (None, ())}

    def __bool__(self) -> bool:
        return bool(self._given())

    def over(self, other: Self) -> Self:
        """These wishes, and those of another one for what is left open here."""
        return replace(other, **self._given())  # type: ignore[type-var]


@dataclass(frozen=True)
class TextLayout(_Wishes):
    """How text tables are to be read, as far as they do not tell; nothing of it overrules a file.

    Attributes
    ----------
    step : float or None
        Sampling interval, s. Other formats, and tables that tell theirs, are compared with it.
    column : tuple of str
        Columns to take, by their number, counted from 1, or their name; empty for the accelerations
        that the table names, or else all columns but that of the time. A single one may be given as
        it is.
    skip_lines : int or None
        Lines before the table, or its names, that are passed over whatever they hold.

    Raises
    ------
    UsageError
        Values that make no sense for any table.
    """

    step: float | None = None
    column: tuple[str, ...] = ()
    skip_lines: int | None = None

    def __post_init__(self) -> None:
        step: Any = self.step
        is_number = isinstance(step, Real) and not isinstance(step, bool)
        if step is not None and not (is_number and math.isfinite(step) and step > 0.0):
            raise UsageError(f"`step`: must be a positive number, got {step!r}")
        given: Any = self.column
        columns = (given,) if isinstance(given, str | int) else given
        if not isinstance(columns, tuple | list) or not all(str(name).strip() for name in columns):
            raise UsageError(f"`column`: give the number or the name of a column, got {given!r}")
        object.__setattr__(self, "column", tuple(str(name).strip() for name in columns))
        skipped: Any = self.skip_lines
        if skipped is not None and not (
            isinstance(skipped, Integral)
            and not isinstance(skipped, bool)
            and 0 <= int(skipped) <= MOST_LINES
        ):
            raise UsageError(
                f"`skip_lines`: must be a whole number from 0 to {MOST_LINES}, got {skipped!r}"
            )

    def check_format(self, name: str) -> None:
        """Raise RecordError for columns or lines of a file that is no table but of the format
        `name`."""
        for option, given in (("column", ", ".join(self.column)), ("skip_lines", self.skip_lines)):
            if given not in (None, ""):
                raise RecordError(
                    f"`{option}={given}` is given, but the file is {name}, which tells itself "
                    "where its samples are; leave it out"
                )

    def check_step(self, dt: float) -> None:
        """Raise RecordError for a sampling interval (s) of a file that is not the one that the user
        gives."""
        if self.step is not None and not math.isclose(dt, self.step, rel_tol=SAME_STEP):
            raise RecordError(
                f"the file's own sampling interval is {dt:.9g} s, `step={self.step:.9g}` "
                "contradicts it; leave it out"
            )


AS_STATED = TextLayout()
"""The user says nothing."""


@dataclass(frozen=True)
class Processing(_Wishes):
    """What is to be done to records; None everywhere does nothing.

    Attributes
    ----------
    trim : tuple of two floats or None
        The part to keep, s from the first sample; None for one of them leaves that end.
    baseline : str or None
        What is removed from the acceleration: `constant`, its mean, or `linear`, its least-squares
        line.
    pad : tuple of two floats or None
        Zeros before and after, s.
    highpass, lowpass : float or None
        Corner frequencies, Hz, of Butterworth filters that are run forwards and backwards: no shift
        of phase, and half the amplitude at the corner.
    filter_order : int or None
        Order of the filters, 4 if None.
    resample : float or None
        New sampling interval, s; band-limited, with a filter against aliasing if it is longer.

    Raises
    ------
    UsageError
        Values that make no sense for any record.
    """

    trim: tuple[float | None, float | None] | None = None
    baseline: str | None = None
    pad: tuple[float, float] | None = None
    highpass: float | None = None
    lowpass: float | None = None
    filter_order: int | None = None
    resample: float | None = None

    def __post_init__(self) -> None:
        for problem in _problems(self):
            raise UsageError(problem)


@dataclass(frozen=True)
class RecordChoice:
    """What is taken of a file, as for `tdint.read_record`, and what is done to it."""

    units: str | Mapping[str, str] | None = None
    component: str | None = None
    inventory: str | Path | None = None
    processing: Processing = field(default_factory=Processing)
    layout: TextLayout = AS_STATED

    @property
    def reading(self) -> dict[str, Any]:
        """What `tdint.read_record` is told."""
        return {
            "units": self.units,
            "component": self.component,
            "inventory": self.inventory,
            "layout": self.layout,
        }


def parse_trim(text: str) -> tuple[float | None, float | None]:
    """Bounds of a trim from `START:END`, seconds, either of which may be left out.

    Raises
    ------
    UsageError
        The text has another form.
    """
    try:
        start, end = (float(part) if part.strip() else None for part in text.split(":"))
    except ValueError:
        raise UsageError(f"trim must be START:END in seconds, got {text!r}") from None
    return start, end


def parse_pad(text: str) -> tuple[float, float]:
    """Zeros before and after from `BEFORE:AFTER`, seconds, or from one number for both.

    Raises
    ------
    UsageError
        The text has another form.
    """
    try:
        before, after = map(float, text.split(":") if ":" in text else (text, text))
    except ValueError:
        raise UsageError(f"pad must be SECONDS or BEFORE:AFTER, got {text!r}") from None
    return before, after


def _problems(steps: Processing) -> Iterator[str]:
    for name in ("highpass", "lowpass", "resample"):
        value = getattr(steps, name)
        if value is not None and not 0.0 < value < math.inf:
            yield f"{name} must be a positive number, got {value}"
    if steps.baseline is not None and steps.baseline not in BASELINES:
        yield f"baseline must be {' or '.join(BASELINES)}, got {steps.baseline!r}"
    for name in ("trim", "pad"):
        pair = getattr(steps, name)
        if pair is not None and not (isinstance(pair, tuple | list) and len(pair) == 2):
            yield f"{name} must be a pair of numbers, got {pair!r}"
            return
    # What is no pair ended above: its values can be looked at now.
    if steps.trim is not None:
        start = 0.0 if steps.trim[0] is None else steps.trim[0]
        end = math.inf if steps.trim[1] is None else steps.trim[1]
        if not 0.0 <= start < end or steps.trim == (None, None):
            yield "trim must be START:END in seconds from the first sample with START below END"
    if steps.pad is not None and not (min(steps.pad) >= 0.0 < sum(steps.pad) < math.inf):
        yield f"pad must be a positive number of seconds, got {steps.pad[0]:g}:{steps.pad[1]:g}"
    if steps.filter_order is not None and steps.filter_order not in range(1, MOST_CORNERS + 1):
        yield (
            f"filter_order must be a whole number from 1 to {MOST_CORNERS}, "
            f"got {steps.filter_order}"
        )
    if steps.filter_order is not None and steps.highpass is None and steps.lowpass is None:
        yield "filter_order is that of a filter: give highpass or lowpass, too"
    if steps.highpass is not None and steps.lowpass is not None and steps.highpass >= steps.lowpass:
        yield (
            f"highpass ({steps.highpass:g} Hz) must be below lowpass ({steps.lowpass:g} Hz): "
            "nothing would be left"
        )
