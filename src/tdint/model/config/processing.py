"""What a model file asks to be done to its record: keys of `excitation.record` named like the command's options."""

from __future__ import annotations

from collections.abc import Callable

from tdint.errors import UsageError
from tdint.ground_motion.processing import BASELINES, MOST_CORNERS, Processing, parse_pad, parse_trim
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import POSITIVE, Choice, Key, Whole, Words

PROCESSING = (
    Key("trim", Words(), "START:END in s from the first sample"),
    Key("baseline", Choice(tuple(BASELINES)), "what is taken off the acceleration"),
    Key("pad", Words(), "zeros before and after: SECONDS or BEFORE:AFTER"),
    Key("highpass", POSITIVE, "corner frequency, Hz"),
    Key("lowpass", POSITIVE, "corner frequency, Hz"),
    Key("corners", Whole(1, MOST_CORNERS), "order of the filters"),
    Key("resample", POSITIVE, "sampling interval, s"),
)
PROCESSING_KEYS = tuple(key.name for key in PROCESSING)


def read_processing(section: Section) -> Processing:
    """The processing that the entries of a section ask for; none of it if one of them is faulty."""
    readers: dict[str, Callable[[Value], object]] = {
        "trim": lambda value: value.parsed(parse_trim),
        "baseline": lambda value: value.choice(BASELINES, "baseline"),
        "pad": lambda value: value.parsed(parse_pad),
        "highpass": Value.number_or_none,
        "lowpass": Value.number_or_none,
        "corners": Value.whole,
        "resample": Value.number_or_none,
    }
    values = {name: readers[name](value) for name in PROCESSING_KEYS if (value := section.get(name))}
    if None in values.values():
        return Processing()
    try:
        return Processing(**values)  # type: ignore[arg-type]
    except UsageError as error:
        section.value.fault(str(error))
        return Processing()
