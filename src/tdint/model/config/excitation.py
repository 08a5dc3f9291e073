"""The `excitation` of a model file: forces, or a record, what of a text table it is, and what is done to it.

Keys of `excitation.record` are named like the command's options.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from tdint.errors import UsageError
from tdint.ground_motion.processing import BASELINES, MOST_CORNERS, Processing, RecordChoice, parse_pad, parse_trim
from tdint.ground_motion.text_layout import AS_STATED, MOST_LINES, TextLayout
from tdint.model.config.units import ModelUnits, read_sample_units
from tdint.model.definition import MAX_STORIES, Excitation, Force, RecordSource
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import ANY, NOT_NEGATIVE, POSITIVE, Choice, Either, EntriesOf, Key, Keys, Whole, Words

PROCESSING = (
    Key("trim", Words(), "START:END in s from the first sample"),
    Key("baseline", Choice(tuple(BASELINES), "baseline"), "what is taken off the acceleration"),
    Key("pad", Words(), "zeros before and after: SECONDS or BEFORE:AFTER"),
    Key("highpass", POSITIVE, "corner frequency, Hz"),
    Key("lowpass", POSITIVE, "corner frequency, Hz"),
    Key("corners", Whole(1, MOST_CORNERS), "order of the filters"),
    Key("resample", POSITIVE, "sampling interval, s"),
)
PROCESSING_KEYS = tuple(key.name for key in PROCESSING)


def read_processing(section: Section) -> Processing:
    """The processing that the entries of a section ask for; none of it if one of them is faulty."""
    parsers: dict[str, Callable[[str], object]] = {"trim": parse_trim, "pad": parse_pad}
    there = {name: value for name in PROCESSING_KEYS if (value := section.get(name))}
    values = {name: value.parsed(parsers[name]) if name in parsers else value.read() for name, value in there.items()}
    if None in values.values():
        return Processing()
    try:
        return Processing(**values)  # type: ignore[arg-type]
    except UsageError as error:
        section.value.fault(str(error))
        return Processing()


LAYOUT = (
    Key("step", POSITIVE, "sampling interval of a text table that does not tell it, s"),
    Key("column", Words(), "column of a text table: its name, or its number from 1"),
    Key("skip_lines", Whole(0, MOST_LINES), "lines before the numbers"),
)


def read_layout(section: Section) -> TextLayout:
    """What the entries of a section say; nothing if one of them is faulty."""
    step, column, lines = values = [section.read(key.name) for key in LAYOUT]
    if any(section.has(key.name) and value is None for key, value in zip(LAYOUT, values, strict=True)):
        return AS_STATED
    return TextLayout(step, (column,) if column else (), lines)


def read_choice(section: Section, *, stdin: bool) -> RecordChoice:
    """What the entries of a section say of a file of records; its station metadata may come from standard input."""
    return RecordChoice(
        units=read_sample_units(section.get("units")),
        component=section.text("component"),
        inventory=section.file("inventory", stdin=stdin),
        processing=read_processing(section),
        layout=read_layout(section),
    )


_RECORD = Keys(
    (
        Key("file", Words(), "the record's file, relative to the model file", needed=True),
        Key("units", Words(), "units of its samples, where it does not say them: m/s^2, g, ..."),
        Key("component", Words(), "component, where the file holds several"),
        Key("scale", ANY, "factor on the acceleration, not zero"),
        Key("inventory", Words(), "station metadata, to remove the instrument's response"),
        *LAYOUT,
        *PROCESSING,
    )
)
_FORCE = Keys(
    (
        Key("floor", Whole(1, MAX_STORIES), "floor, from 1 at the bottom", needed=True),
        Key("amplitude", ANY, "largest force", needed=True),
        Key("omega", NOT_NEGATIVE, "circular frequency, rad/s", needed=True),
        Key("phase", Either((Choice(("cos", "sin")), ANY)), "cos, sin or phi in cos(omega t + phi), rad"),
    )
)
EXCITATION = Keys(
    (
        Key("record", Either((Words(), _RECORD)), "ground motion: a file, or what to take of it"),
        Key("forces", EntriesOf(_FORCE), "harmonic forces on floors"),
    )
)


def read_excitation(value: Value | None, unit: ModelUnits, count: int | None) -> Excitation:
    """Record and forces; `count` is the number of stories."""
    section = value.section(EXCITATION) if value else None
    if section is None:
        return Excitation(None, ())
    record, forces = section.get("record"), section.get("forces")
    items = forces.items("a list of forces") if forces else None
    return Excitation(
        _read_record(record) if record else None,
        tuple(_read_force(item, unit, count) for item in items or ()),
    )


def _read_record(value: Value) -> RecordSource | None:
    if not value.is_list and not value.is_mapping:
        file = value.file(stdin=True)
        return RecordSource(file) if file else None
    section = value.section(_RECORD, "a file or a mapping with the key file")
    if section is None:
        return None
    section.need("file", "give the record's file")
    return RecordSource(section.file("file", stdin=True) or "", read_choice(section, stdin=True), _read_scale(section))


def _read_scale(section: Section) -> float:
    value = section.get("scale")
    scale = value.number() if value else 1.0
    if value and scale == 0.0:
        value.fault("must not be zero; leave the record out for no ground motion")
    return scale


def _read_force(value: Value, unit: ModelUnits, count: int | None) -> Force:
    section = value.section(_FORCE)
    if section is None:
        return Force(0, math.nan, math.nan, math.nan)
    floor = section.need("floor", "give the floor, counted from 1 at the bottom")
    amplitude = section.number("amplitude", scale=unit.force)
    cosine, sine = _read_phase(section.get("phase"))
    return Force(
        floor=(floor.counted(count) if floor else None) or 0,
        cosine=amplitude * cosine,
        sine=amplitude * sine,
        omega=section.number("omega"),
    )


def _read_phase(value: Value | None) -> tuple[float, float]:
    """Shares of cos(omega t) and sin(omega t): `cos`, `sin` or phi in cos(omega t + phi), rad."""
    if value is None or value.is_word("cos"):
        return 1.0, 0.0
    if value.is_word("sin"):
        return 0.0, 1.0
    phase = value.number(what="cos, sin or an angle in radians")
    return math.cos(phase), -math.sin(phase)
