"""Changes to a record that may be asked for; `tdint.ground_motion.processing_steps` makes them.

The steps are always taken in this order: trim, baseline, pad, filters, resample. So the mean is that of the part which
is used, the filters see the record between zeros, and the zeros of a pad take up what a filter spreads beyond the ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from tdint.errors import UsageError
from tdint.ground_motion.text_layout import AS_STATED, TextLayout

BASELINES = ("constant", "linear")
CORNERS = 4  # of the filter where none are given: 24 dB an octave
MOST_CORNERS = 10  # steeper than any practice asks for


@dataclass(frozen=True)
class Processing:
    """What is to be done to records; None everywhere does nothing.

    Attributes
    ----------
    trim : tuple of two floats or None
        The part to keep, s from the first sample; None for one of them leaves that end.
    baseline : str or None
        What is removed from the acceleration: `constant`, its mean, or `linear`, its least-squares line.
    pad : tuple of two floats or None
        Zeros before and after, s.
    highpass, lowpass : float or None
        Corner frequencies, Hz, of Butterworth filters that are run forwards and backwards: no shift of phase, and half
        the amplitude at the corner.
    corners : int or None
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
    corners: int | None = None
    resample: float | None = None

    def __post_init__(self) -> None:
        for problem in _problems(self):
            raise UsageError(problem)

    def __bool__(self) -> bool:
        return any(getattr(self, field.name) is not None for field in fields(self))

    def over(self, other: Processing) -> Processing:
        """These settings, and those of another one for what is not set here."""
        given = {field.name: value for field in fields(self) if (value := getattr(self, field.name)) is not None}
        return replace(other, **given)


@dataclass(frozen=True)
class RecordChoice:
    """What is taken of a file, as for `tdint.read_record`, and what is done to it."""

    units: str | Mapping[str, str] | None = None
    component: str | None = None
    inventory: str | None = None
    processing: Processing = field(default_factory=Processing)
    layout: TextLayout = AS_STATED

    @property
    def reading(self) -> dict[str, Any]:
        """What `tdint.read_record` is told."""
        return {"units": self.units, "component": self.component, "inventory": self.inventory, "layout": self.layout}


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
    if steps.corners is not None and steps.corners not in range(1, MOST_CORNERS + 1):
        yield f"corners must be a whole number from 1 to {MOST_CORNERS}, got {steps.corners}"
    if steps.corners is not None and steps.highpass is None and steps.lowpass is None:
        yield "corners are those of a filter: give highpass or lowpass, too"
    if steps.highpass is not None and steps.lowpass is not None and steps.highpass >= steps.lowpass:
        yield f"highpass ({steps.highpass:g} Hz) must be below lowpass ({steps.lowpass:g} Hz): nothing would be left"
