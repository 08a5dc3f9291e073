"""What a model file asks to be done to its record: keys of `excitation.record` named like the command's options."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

from tdint.errors import UsageError
from tdint.ground_motion.processing import BASELINES, MOST_CORNERS, Processing, parse_pad, parse_trim
from tdint.model.config.fields import POSITIVE, Section, Value

Parsed = TypeVar("Parsed")

PROCESSING_KEYS = ("trim", "baseline", "pad", "highpass", "lowpass", "corners", "resample")


def read_processing(section: Section) -> Processing:
    """The processing that the entries of a section ask for; none of it if one of them is faulty."""
    readers: dict[str, Callable[[Value], object]] = {
        "trim": lambda value: _parsed(value, parse_trim),
        "baseline": lambda value: value.choice(BASELINES, "baseline"),
        "pad": lambda value: _parsed(value, parse_pad),
        "highpass": _positive,
        "lowpass": _positive,
        "corners": lambda value: value.whole(1, MOST_CORNERS),
        "resample": _positive,
    }
    values = {name: readers[name](value) for name in PROCESSING_KEYS if (value := section.get(name))}
    if None in values.values():
        return Processing()
    try:
        return Processing(**values)  # type: ignore[arg-type]
    except UsageError as error:
        section.value.fault(str(error))
        return Processing()


def _positive(value: Value) -> float | None:
    number = value.number(POSITIVE)
    return None if math.isnan(number) else number


def _parsed(value: Value, parse: Callable[[str], Parsed]) -> Parsed | None:
    """What is made of a text; a fault at `value` where that is refused."""
    text = value.text()
    if text is None:
        return None
    try:
        return parse(text)
    except UsageError as error:
        value.fault(str(error))
        return None
