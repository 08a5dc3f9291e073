"""Model files: YAML to a checked `Model` in SI units. This is the only place that knows the file's
keys and units.

`tdint.model.keys` reads text, numbers and words with line and column; the modules around this one
read one part of the file each. The JSON schema for editors is made of the same declarations.
"""

from __future__ import annotations

import io
import itertools
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextvars import copy_context
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any, TextIO

from tdint.errors import ModelError, UsageError
from tdint.files import READ, STDIN
from tdint.ground_motion.choice import (
    AS_STATED,
    BASELINES,
    MOST_CORNERS,
    MOST_LINES,
    Processing,
    RecordChoice,
    TextLayout,
    parse_pad,
    parse_trim,
)
from tdint.model.config.sections import (
    DAMAGE,
    DAMPING,
    UNITS,
    ModelUnits,
    read_damage,
    read_damping,
    read_file_units,
    read_sample_units,
    read_units,
)
from tdint.model.config.stories import STORIES, read_stories
from tdint.model.definition import (
    MAX_STORIES,
    Analysis,
    Damping,
    Excitation,
    Force,
    Initial,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
    RecordSource,
    Story,
)
from tdint.model.keys.document import SourceText, composed, decode, read_document
from tdint.model.keys.fields import (
    ANY,
    NOT_NEGATIVE,
    POSITIVE,
    POSITIVE_RATIO,
    Choice,
    Either,
    EntriesOf,
    Flag,
    Key,
    Keys,
    Schema,
    Section,
    Value,
    Whole,
    Words,
    numbered,
)
from tdint.model.keys.nodes import Faults
from tdint.units import SI, parse_output_units
from tdint.written_numbers import parse_head

# ---- The `excitation` of a model file: forces, or a record, what of a text table it is, and what
# is done to it
#
# Keys of `excitation.record` are named like the command's options.

PROCESSING = (
    Key("trim", Words(parse_trim), "START:END in s from the first sample"),
    Key("baseline", Choice(tuple(BASELINES), "baseline"), "what is taken off the acceleration"),
    Key("pad", Words(parse_pad), "zeros before and after: SECONDS or BEFORE:AFTER"),
    Key("highpass", POSITIVE, "corner frequency, Hz"),
    Key("lowpass", POSITIVE, "corner frequency, Hz"),
    Key("filter_order", Whole(1, MOST_CORNERS), "order of the filters"),
    Key("resample", POSITIVE, "sampling interval, s"),
)

LAYOUT = (
    Key("step", POSITIVE, "sampling interval of a text table that does not tell it, s"),
    Key("column", Words(), "column of a text table: its name, or its number from 1"),
    Key("skip_lines", Whole(0, MOST_LINES), "lines before the numbers"),
)


def read_choice(section: Section, *, stdin: bool, many: bool = False) -> RecordChoice:
    """What the entries of a section say of a file of records, or of `many`; station metadata may
    come from standard input. Of the layout, and of the processing, there is nothing if one of its
    entries is faulty."""
    layout, steps = (section.given(*(key.name for key in keys)) for keys in (LAYOUT, PROCESSING))
    processing = Processing()
    if None not in steps.values():
        try:
            processing = Processing(**steps)
        except UsageError as error:
            section.value.fault(str(error))
    return RecordChoice(
        units=(read_file_units if many else read_sample_units)(section.get("units")),
        component=section.read("component"),
        inventory=section.file("inventory", stdin=stdin),
        processing=processing,
        layout=AS_STATED if None in layout.values() else TextLayout(**layout),
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
        Key(
            "phase",
            Either((Choice(("cos", "sin")), ANY)),
            "cos, sin or phi in cos(omega t + phi), rad",
        ),
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
    # Forces are read beside a record: a building may have both.
    items = forces.items("a list of forces") if forces else None
    return Excitation(
        record_within(record) if record else None,
        tuple(_read_force(item, unit, count) for item in items or ()),
    )


def record_within(value: Value) -> RecordSource | None:
    """A ground motion, as `excitation: record` of a model or another file says it; None after a
    fault."""
    if not value.is_list and not value.is_mapping:
        file = value.file(stdin=True)
        return RecordSource(file) if file else None
    section = value.section(_RECORD, "a file or a mapping with the key file")
    if section is None:
        return None
    section.need("file", "give the record's file")
    factor = section.get("scale")
    scale = factor.number() if factor else 1.0
    if factor and scale == 0.0:
        factor.fault("must not be zero; leave the record out for no ground motion")
    return RecordSource(
        section.file("file", stdin=True) or "", read_choice(section, stdin=True), scale
    )


def _read_force(value: Value, unit: ModelUnits, count: int | None) -> Force:
    section = value.section(_FORCE)
    if section is None:
        return Force(0, math.nan, math.nan, math.nan)
    floor = section.need("floor", "give the floor, counted from 1 at the bottom")
    amplitude = section.number("amplitude", scale=unit.force)

    # Shares of cos(omega t) and sin(omega t): one of them alone, or both by phi in cos(omega t +
    # phi).
    cosine, sine = 1.0, 0.0
    phase = section.get("phase")
    if phase and phase.is_word("sin"):
        cosine, sine = 0.0, 1.0
    elif phase and not phase.is_word("cos"):
        angle = phase.number(expected="cos, sin or an angle in radians")
        cosine, sine = math.cos(angle), -math.sin(angle)
    return Force(
        floor=(floor.whole(numbered(count)) if floor else None) or 0,
        cosine=amplitude * cosine,
        sine=amplitude * sine,
        omega=section.number("omega"),
    )


# ---- Model file

_INITIAL = Keys(
    (
        Key(
            "displacement", EntriesOf(ANY), "of the floors relative to the ground, from the bottom"
        ),
        Key("velocity", EntriesOf(ANY), "of the floors relative to the ground, from the bottom"),
    )
)
_ANALYSIS = Keys(
    (
        Key(
            "method",
            Words(),
            "time-integration method with its parameters, such as newmark:beta=0.25:gamma=0.5",
        ),
        Key("dt", POSITIVE, "time step, s"),
        Key("duration", POSITIVE, "time to integrate, s"),
    )
)


def _as_meant(text: str) -> str:
    """The reason in `off, a rig of the laboratory`."""
    word, _, reason = text.partition(",")
    if word.strip() != "off" or not reason.strip():
        raise UsageError("must be off and the reason, such as `off, a rig of the laboratory`")
    return reason.strip()


_OFF, _HEAD = Words(_as_meant), Words(parse_head)


def model_keys() -> Keys:
    """The keys of a model file, and what may stand under them."""
    from tdint.model.config.building_facts import (
        BUILDING,
    )  # needs numpy, which most models are read without

    kinds = {"building": BUILDING}
    return Keys(
        tuple(replace(key, kind=kinds.get(key.name, key.kind)) for key in _MODEL.declared),
        _MODEL.one_of,
    )


_MODEL = Keys(
    (
        Key("name", Words(), "the building's name; that of the file where it is left out"),
        Key("units", UNITS, "units of the numbers in this file; SI where they are left out"),
        Key("stories", STORIES, "the stories, from the ground up; `repeat` for equal ones"),
        Key("building", Keys(()), "a few facts in place of stories, which rules derive from them"),
        Key(
            "damping",
            DAMPING,
            "damping besides the dashpots; 5% is Rayleigh damping in modes 1 and 3",
        ),
        Key("p_delta", Flag(), "whether gravity acts on the displaced building"),
        Key("excitation", EXCITATION, "ground motion and forces"),
        Key("initial", _INITIAL, "state at the start; at rest where it is left out"),
        Key(
            "analysis",
            _ANALYSIS,
            "method, time step and duration; the command line comes before it",
        ),
        Key(
            "collapse_drift",
            POSITIVE_RATIO,
            "drift ratio beyond which a run counts as collapsed; 10% by default",
        ),
        Key(
            "plausibility",
            _OFF,
            "`off, REASON`: what is unusual of the building is not told, but the reason is",
        ),
        Key("damage", DAMAGE, "damage states of the building"),
        Key(
            "output_units",
            Either((Words(), EntriesOf(Words(), least=1))),
            "units of the output: kip, in, g",
        ),
        Key(
            "report",
            _HEAD,
            "lines at the top of its report: 'Project: Bridge 7; Author: A. B.; Date: 2026-01-31'",
        ),
    ),
    one_of=(("stories", "building"),),
)
_DEFAULT_COLLAPSE_DRIFT = (
    0.10  # drift ratio at which codes and IDA studies take a frame for collapsed
)


def load_model(source: str | Path | TextIO | Mapping[str, Any]) -> Model:
    """Read a model file, or a mapping that says the same.

    Parameters
    ----------
    source : str, Path, text stream or mapping
        The YAML file; `-` is standard input. Or its content as Python has it: mappings, lists,
        arrays, numbers, text. Relative paths in the file start from its folder, those of a stream
        without a file and of a mapping from the working directory.

    Returns
    -------
    Model
        All values in SI units.

    Raises
    ------
    ModelError
        If the file cannot be read, is not YAML or has faults; all faults are reported in one error,
        in file order. Its keys count list entries from 1 as they stand in the file: `stories[2]` is
        the second entry of `stories`, whatever `repeat` the first one has.
    """
    return load_judged(source, {})


def load_judged(
    source: str | Path | TextIO | Mapping[str, Any],
    judges: Mapping[str, Callable[[str, Path], object]],
) -> Model:
    """Read a model as `load_model` does, and let others judge words in it that mean nothing here.

    Parameters
    ----------
    judges : mapping of str to callable
        By the path of a key (`analysis.method`): takes the text under it and the folder that the
        file's paths start from, and raises UsageError if it is wrong, which becomes a fault at its
        place.
    """
    origin, root = read_document(source)
    model = model_within(root, origin)
    # Words such as a method mean nothing here: who knows them judges, at their place.
    for path, judge in judges.items():
        value: Value | None = root
        for name in path.split("."):
            value = value.peek(name) if value else None
        # What is no word at all the reader has told already.
        if value is None or value.is_list or value.is_mapping or not value.word:
            continue
        try:
            judge(value.word, root.faults.folder)
        except UsageError as error:
            Value(value.node, path, value.faults).fault(str(error))
    root.faults.raise_if_any()
    assert model is not None
    return model


def model_within(value: Value, origin: SourceText) -> Model | None:
    """The model that a mapping says, all of a file or a part of another one, with its `origin`;
    None after a fault."""
    section = value.section(_MODEL)
    return _read_model(section, origin) if section else None


def _read_model(section: Section, origin: SourceText) -> Model:
    """The model; faults are noted, and leave nan or None behind."""
    unit = read_units(section.inner("units"))
    p_delta = section.read("p_delta", False)
    stories, count, damping = _read_stories(section, unit, p_delta)
    excitation = section.get("excitation")

    # Units of tables, and those of pages for people: of the file where it names none for the
    # output.
    output_units, page_units = SI, unit.named
    stated = section.get("output_units")
    items = () if stated is None else stated.items("units") if stated.is_list else (stated,)
    text = ",".join(filter(None, (item.text() for item in items or ())))
    if stated and text:
        try:
            output_units, page_units = (
                parse_output_units(text),
                parse_output_units(text, unit.named),
            )
        except UsageError as error:
            stated.fault(str(error))

    # The state at the start: a number for each story, zeros where nothing is said.
    initial, states = section.inner("initial"), []
    for name in _INITIAL:
        entry = initial.get(name)
        items = entry.items("a list with one number per story") if entry else None
        if entry and items is not None and count is not None and len(items) != count:
            entry.fault(f"must have one number per story ({count}), got {len(items)}")
        given = tuple(item.number(scale=unit.length) for item in items or ())
        states.append(given if entry else (0.0,) * (count or 0))
    model = Model(
        name=section.read("name") or origin.name,
        source=origin.label,
        text=origin.data,
        stories=stories,
        damping=damping,
        p_delta=p_delta,
        excitation=read_excitation(excitation, unit, count),
        initial=Initial(*states),
        analysis=Analysis(*map(section.inner("analysis").read, _ANALYSIS)),
        collapse_drift=section.number("collapse_drift", default=_DEFAULT_COLLAPSE_DRIFT),
        output_units=output_units,
        page_units=page_units,
        page_head=section.read("report") or (),
        damage=read_damage(section.get("damage")),
        plausibility_off=section.read("plausibility") or "",
    )
    # A stream can be read once.
    record = model.excitation.record
    if origin.label == "-" and record and record.file == "-" and excitation:
        excitation.fault("standard input already holds the model; give the record as a file")
    return model


def _read_stories(
    section: Section, unit: ModelUnits, p_delta: bool
) -> tuple[tuple[Story, ...], int | None, Damping]:
    """Stories, their number and the damping: as they are written out, or as rules derive them of a
    `building`."""
    building, damping = section.get("building"), section.get("damping")
    if building is None:
        advice = "give a list with one entry per story, or a building in its place"
        entries = (
            section.get("stories")
            if section.mentions("building")
            else section.need("stories", advice)
        )
        stories, count = read_stories(entries, unit, p_delta)
        return stories, count, read_damping(damping, count)
    from tdint.model.config.building_facts import (
        read_building,
    )  # needs numpy, which other models are read without

    # Rules bring their own damping, which the file may replace.
    derived = read_building(building, unit)
    if section.has("stories"):
        building.fault("stands in place of `stories`; give one of the two")
    # Damping is looked at all the same, for its own faults.
    if derived is None:
        read_damping(damping, None)
        return (), None, None
    count = len(derived.stories)
    return derived.stories, count, read_damping(damping, count) if damping else derived.damping


def model_schema() -> Schema:
    """The JSON schema (draft 7) of model files.

    What it refuses, the reader refuses, too. The reader refuses more: what several keys say
    together, such as a list with an entry for each story.
    """
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "tdint model",
        "description": "A shear building and its loads for tdint",
        **model_keys().schema(),
    }


# ---- A model file with other stiffnesses and damping, comments kept


def rewritten(before: Model, after: Model, place: Path) -> str | None:
    """The text of a model's file with the stiffnesses and the damping of another model, for a file
    at `place`.

    All else stays as it is written, comments, too; entries with `repeat` are written out where
    their stories differ, and paths lead where they led. None where that text would not say what it
    should, as of a file with aliases.
    """
    faults = Faults(before.source)
    text = decode(before.text, faults)
    root = composed(text)
    stories, damping = _entry(root, "stories"), _entry(root, "damping")
    edits: list[tuple[int, int, str]] = []
    if stories is None:
        return None
    # Entries stand for several stories: each is written out if its stories differ by now.
    first = 0
    for entry in stories.value:
        count = int(repeat.value) if (repeat := _entry(entry, "repeat")) else 1
        pairs = list(zip(before.stories, after.stories, strict=True))[first : first + count]
        first += count
        edits.append(
            _with_stiffnesses(
                text, entry, [new.stiffness / old.stiffness for old, new in pairs], stories
            )
        )
    if damping is not None and after.damping != before.damping:
        edits.append((damping.start_mark.index, _end(damping), _damping_words(after.damping)))
    # Paths in the file start from its folder, which is another one now.
    record = _entry(_entry(root, "excitation"), "record")
    source = after.excitation.record
    if record is not None and source is not None:
        of_station = _entry(record, "inventory")
        for node, file in (
            (_entry(record, "file") or record, source.file),
            (of_station, source.choice.inventory),
        ):
            if (
                node is not None
                and file not in (None, STDIN)
                and not Path(node.value).is_absolute()
            ):
                path = os.path.relpath(str(file), place.parent)
                edits.append(
                    (node.start_mark.index, _end(node), json.dumps(path, ensure_ascii=False))
                )
    # The new text is read as any file: what it does not say so, nobody should get.
    text = _edited(text, edits)
    apart = copy_context()  # it is no input of the command
    apart.run(READ.set, None)
    try:
        said = apart.run(load_model, io.StringIO(text))
    except ModelError:
        return None

    # The text must say what it should: stiffnesses, and the numbers of the damping one after the
    # other.
    numbers = []
    for model in (said, after):
        damping_numbers = astuple(model.damping) if model.damping is not None else ()
        listed = [value if isinstance(value, tuple) else (value,) for value in damping_numbers]
        numbers.append(
            [*(story.stiffness for story in model.stories), *itertools.chain.from_iterable(listed)]
        )
    same = len(numbers[0]) == len(numbers[1]) and all(
        math.isclose(value, other, rel_tol=_WRITTEN) for value, other in zip(*numbers, strict=True)
    )
    return text if same and type(said.damping) is type(after.damping) else None


_WRITTEN = 1e-11
"""To which numbers of twelve digits are what they were."""


def _entry(node: Any, name: str) -> Any:
    """The node under a key of a mapping; None where there is none."""
    pairs = node.value if node is not None and isinstance(node.value, list) else ()
    return next(
        (pair[1] for pair in pairs if isinstance(pair, tuple) and pair[0].value == name), None
    )


def _end(node: Any) -> int:
    """Where a node ends: that of a block collection with its last scalar, before what stands behind
    it."""
    if isinstance(node.value, str) or node.flow_style:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end(last[1] if isinstance(last, tuple) else last)


def _edited(text: str, edits: Sequence[tuple[int, int, str]], first: int = 0) -> str:
    """A text with some parts of it replaced; their places count from `first`."""
    for start, end, words in sorted(edits, reverse=True):
        text = text[: start - first] + words + text[end - first :]
    return text


def _with_stiffnesses(
    text: str, entry: Any, factors: Sequence[float], stories: Any
) -> tuple[int, int, str]:
    """An entry of `stories` with its stiffness times factors: once where all are the same, else
    once for each."""
    start, end = entry.start_mark.index, _end(entry)
    alike = all(factor == factors[0] for factor in factors)
    stiffness, repeat = _entry(entry, "stiffness"), _entry(entry, "repeat")
    copies = []
    # Where all stories change alike, the entry and its `repeat` stay as they are.
    for factor in factors[:1] if alike else factors:
        edits = []
        if stiffness is not None and factor != 1.0:
            number = f"{float(stiffness.value) * factor:.12g}"
            edits.append((stiffness.start_mark.index, stiffness.end_mark.index, number))
        if not alike:
            edits.append((repeat.start_mark.index, repeat.end_mark.index, "1"))
        copies.append(_edited(text[start:end], edits, start))
    # Lists in brackets or with dashes: copies stand as the entry does.
    between = ", " if stories.flow_style else "\n" + " " * stories.start_mark.column + "- "
    return start, end, between.join(copies)


def _damping_words(damping: Damping) -> str:
    """The value of `damping` in a model file."""

    def numbers(values: Sequence[float]) -> str:
        return (
            f"[{', '.join(f'{value:.12g}' for value in values)}]"
            if len(values) > 1
            else f"{values[0]:.12g}"
        )

    match damping:
        case RayleighRatio(ratios, modes):
            return f"{{rayleigh: {{ratio: {numbers(ratios)}, modes: {numbers(modes)}}}}}"
        case RayleighCoefficients(mass, stiffness):
            return f"{{rayleigh: {{mass: {mass:.12g}, stiffness: {stiffness:.12g}}}}}"
        case ModalDamping(ratios):
            return f"{{modal: {numbers(ratios)}}}"
    return "none"
