"""Read model files: convert YAML to a validated `Model` in SI units.

The keys of a model file and their units are declared in this package only. `tdint.model.keys` reads
text and numbers with line and column; each other module of the package reads one section of the
file. The JSON schema for editors is generated from the same declarations. `count` is the number of
stories, which is the highest floor; None if it is unknown after an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from tdint.errors import UsageError
from tdint.ground_motion.choice import (
    BASELINES,
    MAX_FILTER_ORDER,
    MAX_SKIPPED_LINES,
    Processing,
    RecordChoice,
    TextLayout,
    parse_pad,
    parse_trim,
)
from tdint.model.config import directions
from tdint.model.config.devices import ATTACHMENTS, LINKS, read_devices
from tdint.model.config.keys import keys
from tdint.model.config.matrix_keys import BASE, MATRICES, MATRIX
from tdint.model.config.sections import (
    DAMPING,
    UNITS,
    ModelUnits,
    read_damping,
    read_file_units,
    read_sample_units,
    read_units,
)
from tdint.model.config.stories import STORIES, read_stories
from tdint.model.definition import (
    Analysis,
    Attachment,
    Damping,
    Excitation,
    Force,
    Initial,
    Matrices,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
    RecordSource,
    TableForce,
)
from tdint.model.keys.document import SourceText, read_document
from tdint.model.keys.fields import (
    ANY,
    Choice,
    Either,
    EntriesOf,
    Integer,
    Key,
    Keys,
    NamedEntries,
    Schema,
    Section,
    TextLine,
    Value,
)
from tdint.model.story import MAX_STORIES, Story
from tdint.number_parsing import parse_head
from tdint.units import SI, STANDARD_GRAVITY, OutputUnits, parse_output_units

if TYPE_CHECKING:
    from tdint.model.damage_states import DamageStates
    from tdint.model.limits import Limit

# ---- The section `excitation` of a model file: forces, or a record with the layout of its text
# table and its processing. Keys of `excitation.record` have the names of the command-line options.

PROCESSING = keys(
    "processing",
    trim=TextLine(parse_trim, "START:END in s, such as 0:10"),
    baseline=Choice(tuple(BASELINES), "baseline"),
    pad=TextLine(parse_pad, "SECONDS or BEFORE:AFTER, such as 2:5"),
    filter_order=Integer(1, MAX_FILTER_ORDER),
)

LAYOUT = keys("layout", skip_lines=Integer(0, MAX_SKIPPED_LINES))


def read_choice(section: Section, *, stdin: bool, many: bool = False) -> RecordChoice:
    """Return the options for reading and processing a record from the entries of a section.

    Parameters
    ----------
    section : Section
        Section with the keys of `PROCESSING` and `LAYOUT`, units, component and inventory.
    stdin : bool
        Station metadata may be read from standard input.
    many : bool
        The section describes several files.

    Returns
    -------
    RecordChoice
        The layout is the default if an entry of the layout is invalid. The same applies to the
        processing.
    """
    layout = _read_part(section, LAYOUT, TextLayout)
    processing = _read_part(section, PROCESSING, Processing)
    return RecordChoice(
        units=(read_file_units if many else read_sample_units)(section.get("units")),
        component=section.read("component"),
        inventory=section.file("inventory", stdin=stdin),
        processing=processing,
        layout=layout,
    )


_PartT = TypeVar("_PartT", TextLayout, Processing)


def _read_part(section: Section, keys: tuple[Key, ...], part: type[_PartT]) -> _PartT:
    """Return the layout or the processing from the entries of some keys; the default after
    reporting an error."""
    entries = section.read_present(*(key.name for key in keys))
    # An invalid entry has the value None. The error has been reported.
    if None not in entries.values():
        try:
            return part(**entries)
        except UsageError as error:
            section.value.fault(str(error))
    return part()


_RECORD = Keys((*keys("record"), *LAYOUT, *PROCESSING))
_FLOOR = Either((Integer(1, MAX_STORIES), TextLine()))
_PHASE = Either((Choice(("cos", "sin")), ANY))
_FORCE = Keys(keys("force", floor=_FLOOR, phase=_PHASE))
_TABLE_FORCE = Keys(
    keys(
        "table force",
        floor=_FLOOR,
        floors=NamedEntries(TextLine(), description="a mapping of floors to columns"),
        points=EntriesOf(
            EntriesOf(ANY, least=2, most=2, description="a point [time in s, force]"),
            least=2,
            description="a list of at least two points [time in s, force]",
        ),
    )
)
MOTION_KEYS = {"record": "", "displacement": "displacement", "velocity": "velocity"}
"""Keys of `excitation` with a ground motion, and the quantity that its file must contain; empty for
an acceleration, or the quantity that the file states."""

_MOTION = Either((TextLine(), _RECORD))
_FORCES = EntriesOf(Either((_FORCE, _TABLE_FORCE)), or_one=True)
_OF_DIRECTION = keys("excitation", forces=_FORCES, **dict.fromkeys(MOTION_KEYS, _MOTION))
EXCITATION = Keys(
    (*directions.with_directions(_OF_DIRECTION, directions.OF_EXCITATION), *keys("azimuth"))
)


def read_excitation(
    value: Value | None, unit: ModelUnits, count: int | None, names: Sequence[str]
) -> Excitation:
    """Return the ground motion and the forces of the section `excitation`, which can be missing.

    `names` are the names of rows that are not floors, and of attachments (`Value.floor`).
    """
    section = value.section(EXCITATION) if value else None
    if section is None:
        return Excitation(None)
    motions = [name for name in MOTION_KEYS if section.has(name)]
    for name in motions[1:]:
        section.value.fault(f"give either `{motions[0]}` or `{name}`, not both; remove one")
    record = section.get(motions[0]) if motions else None
    forces = section.get("forces")
    # A building may have both a record and forces.
    items = (forces.items("a list of forces") if forces else None) or ()
    # The keys of an entry determine its type. `floor` belongs to both types.
    of_tables = [item for item in items if {*item.names} & {*_TABLE_FORCE} - {"floor"}]
    tables: tuple[TableForce, ...] = ()
    if of_tables:
        # Imported here because it loads numpy, which is not needed to read other models.
        from tdint.model.config.load_tables import read_table_forces

        sections = [item.section(_TABLE_FORCE) for item in of_tables]
        present = [item for item in sections if item is not None]
        tables = read_table_forces(present, unit, count, names)
    return Excitation(
        record_from_value(record, MOTION_KEYS[motions[0]]) if record else None,
        tuple(_read_force(item, unit, count, names) for item in items if item not in of_tables),
        tables,
    )


def record_from_value(value: Value, quantity: str = "") -> RecordSource | None:
    """Return the ground motion of `excitation: record`; None after reporting an error.

    The value is the path of the file, or a mapping with the key `file` and options. `quantity` is
    `displacement` or `velocity` for a file that must contain it.
    """
    if not value.is_list and not value.is_mapping:
        file = value.file(stdin=True)
        return RecordSource(file, RecordChoice(quantity=quantity)) if file else None
    section = value.section(_RECORD, "a file or a mapping with the key file")
    if section is None:
        return None
    section.need("file", "give the record's file")
    factor = section.get("scale")
    scale = factor.number() if factor else 1.0
    if factor and scale == 0.0:
        factor.fault("must not be zero; omit the record to run without ground motion")
    choice = replace(read_choice(section, stdin=True), quantity=quantity)
    if quantity:
        read_sample_units(section.get("units"), quantity)
    return RecordSource(section.file("file", stdin=True) or "", choice, scale)


def _read_force(value: Value, unit: ModelUnits, count: int | None, names: Sequence[str]) -> Force:
    """Return the force amplitude * cos(omega t + phi); `phase` is phi, `cos` or `sin`.

    Invalid values are reported and replaced by nan or 0.
    """
    section = value.section(_FORCE)
    if section is None:
        return Force(0, math.nan, math.nan, math.nan)
    floor = section.need("floor", "give the floor, counted from 1 at the bottom")
    amplitude = section.number("amplitude", scale=unit.force)

    # Coefficients of cos(omega t) and sin(omega t) for a unit amplitude. For an angle phi they
    # follow from cos(omega t + phi) = cos(phi) cos(omega t) - sin(phi) sin(omega t).
    cosine, sine = 1.0, 0.0
    phase = section.get("phase")
    if phase and phase.is_word("sin"):
        cosine, sine = 0.0, 1.0
    elif phase and not phase.is_word("cos"):
        angle = phase.number(expected="cos, sin or an angle in radians")
        cosine, sine = math.cos(angle), -math.sin(angle)
    return Force(
        floor=floor.floor(count, names) if floor else 0,
        cosine=amplitude * cosine,
        sine=amplitude * sine,
        omega=section.number("omega"),
    )


# ---- Model file

_OF_ATTACHMENT = Keys(keys("attachment state"))
_INITIAL = Keys(
    keys(
        "initial",
        displacement=EntriesOf(ANY),
        velocity=EntriesOf(ANY),
        attachments=NamedEntries(_OF_ATTACHMENT, least=1),
    )
)
_ANALYSIS = Keys(keys("analysis"))


def _suppression_reason(text: str) -> str:
    """Return the reason in the value of `plausibility`, such as `off, test rig in the laboratory`.
    UsageError is raised if the text does not start with `off,`, or contains no reason.
    """
    state, _, reason = text.partition(",")
    if state.strip() != "off" or not reason.strip():
        raise UsageError(
            "must be `off`, a comma and the reason, such as `off, test rig in the laboratory`"
        )
    return reason.strip()


_REPORT_HEAD = Either(
    (
        TextLine(parse_head),
        NamedEntries(
            TextLine(may_be_empty=True),
            description="NAME: TEXT",
            empty_message="must contain at least one line",
        ),
    ),
    "a text or a mapping of lines",
)


def model_keys() -> Keys:
    """Return the keys of a model file with the types of their values.

    In `_MODEL` the types of `building`, `damage` and `limits` are placeholders.
    """
    # Imported here because it loads numpy, which is not needed to read most models.
    from tdint.model.config.building_facts import BUILDING
    from tdint.model.config.damage import DAMAGE
    from tdint.model.config.limit_keys import LIMITS

    types = {"building": BUILDING, "damage": DAMAGE, "limits": LIMITS}
    return Keys(
        tuple(key._replace(type=types.get(key.name, key.type)) for key in _MODEL.declared),
        _MODEL.one_of,
        other_names=_MODEL.other_names,
    )


_JOINTS = (
    "a frame whose joints rotate is written as the `stiffness_matrix` of its floors, without the "
    "rotations r: K = Kff - Kfr Krr^-1 Krf"
)
_CONTROL = (
    "control forces depend on the response, which forces of a model file cannot; for a linear "
    "building, integrate the state space of `tdint.matrices` in Python"
)
_CONTACT = (
    "write the second building as `attachments` with `floor: ground`, and the contact as a link "
    "with the law gap"
)
_CAMPAIGN = (
    "a campaign file is no model: run it with `tdint campaign`, and check it and its models with "
    "`tdint check`"
)
_MODEL = Keys(
    directions.with_directions(
        keys(
            "model",
            units=UNITS,
            stories=STORIES,
            building=Keys(()),
            stiffness_matrix=MATRIX,
            matrices=MATRICES,
            base=BASE,
            attachments=ATTACHMENTS,
            links=LINKS,
            damping=DAMPING,
            excitation=EXCITATION,
            initial=_INITIAL,
            analysis=_ANALYSIS,
            plausibility=TextLine(_suppression_reason),
            damage=Keys(()),
            limits=Keys(()),
            report=_REPORT_HEAD,
        ),
        directions.OF_FILE,
    ),
    one_of=(("stories", "building", "matrices"),),
    other_names=(
        *((name, "attachments") for name in ("absorbers", "absorber", "tmd", "tmds", "equipment")),
        *((name, "links") for name in ("link", "dampers", "dashpots", "braces", "springs")),
        *((name, _JOINTS) for name in ("beams", "columns", "members", "nodes", "joints", "frame")),
        *((name, _CONTROL) for name in ("control", "controller", "actuators", "actuator")),
        *((name, _CONTACT) for name in ("contacts", "contact", "pounding", "buildings")),
    ),
)
_DEFAULT_COLLAPSE_DRIFT = 0.10
"""Drift ratio. Codes and incremental dynamic analyses use it as collapse criterion of frames."""


def load_model(source: str | Path | TextIO | Mapping[str, Any]) -> Model:
    """Read a model file, or a mapping with the same content.

    Parameters
    ----------
    source : str, Path, text stream or mapping
        YAML file; `-` is standard input. Alternatively its content as Python objects: mappings,
        lists, arrays, numbers and text. Relative paths refer to the directory of the file; for
        streams and mappings they refer to the working directory.

    Returns
    -------
    Model
        All values in SI units.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML, or contains errors. One exception reports all errors
        in the order of the file. Keys in messages count list entries of the file from 1:
        `stories[2]` is the second entry of `stories`, regardless of `repeat` in the first entry.
    """
    return load_with_checks(source, {})


def load_with_checks(
    source: str | Path | TextIO | Mapping[str, Any],
    checks: Mapping[str, Callable[[str, Path], object]],
) -> Model:
    """Read a model like `load_model`, with additional checks of texts by the caller.

    Parameters
    ----------
    source : str, Path, text stream or mapping
        As for `load_model`.
    checks : mapping of str to callable
        Checks by the full key of a value (`analysis.method`). Each receives the text and the
        directory of the file, and raises UsageError if the text is invalid. The error is reported
        with the line and column of the value.
    """
    origin, root = read_document(source)
    if root.is_mapping and "buildings" in root.names and {"records", "forces"} & {*root.names}:
        root.fault(_CAMPAIGN)
        raise root.faults.error()
    model = model_from_mapping(root, origin)
    # This layer cannot check texts such as the name of a method; the caller provides the check.
    for full_key, check in checks.items():
        # Search the nested mappings for the key; None if a mapping does not contain the name.
        value: Value | None = root
        for name in full_key.split("."):
            value = value.peek(name) if value else None
        # Values that are not text have already been reported.
        if value is None or value.is_list or value.is_mapping or not value.word:
            continue
        try:
            check(value.word, root.faults.folder)
        except UsageError as error:
            Value(value.node, full_key, value.faults).fault(str(error))
    root.faults.raise_if_any()
    assert model is not None
    return model


def model_from_mapping(value: Value, origin: SourceText) -> Model | None:
    """Return the model that a mapping defines; None after reporting an error.

    The mapping is the content of a model file, or a part of a file of another type.
    """
    if directions.has_directions(value):
        return _read_directions(value, origin)
    section = value.section(_MODEL)
    return _read_model(section, origin) if section else None


def _read_directions(value: Value, origin: SourceText) -> Model | None:
    """Return the model of a file with two directions (`Model.across`)."""
    sections = [document.section(_MODEL) for document in directions.documents_of(value)]
    models = [_read_model(section, origin) for section in sections if section]
    if len(models) < len(sections):
        return None
    x, y = models
    for model in models:
        directions.check_isolators(value, model.stories)
    if y.excitation.record and not x.excitation.record:
        value.fault("excitation.x: the ground motion is missing; give that of both directions")
    azimuth = directions.read_azimuth(value, has_pair=not y.excitation.record)
    return replace(x, across=y, axis_azimuth=azimuth, document=value.node)


def _read_model(section: Section, origin: SourceText) -> Model:
    """Return the model. Invalid values are reported and replaced by nan or None."""
    unit = read_units(section.inner("units"))
    p_delta = section.read("p_delta", False)
    matrices: Matrices | None = None
    if value := section.get("matrices"):
        # Imported here, because few models have matrices.
        from tdint.model.config.matrices import read_matrices

        matrices, stories = read_matrices(section, value, unit)
        count = len(stories) or None
        damping = _damping_of(section.get("damping"), stories, count)
    else:
        stories, count, damping = _read_stories(section, unit, p_delta)
        if section.has("stiffness_matrix", "base") or any(story.flexural for story in stories):
            from tdint.model.config.matrices import read_linear_stories

            matrices, stories = read_linear_stories(section, unit, stories, p_delta=p_delta)
    if matrices and getattr(damping, "tangent", False):
        section.value.fault("damping.rayleigh.tangent: a linear model has no tangent; omit it")
    excitation = section.get("excitation")
    names = matrices.names if matrices else ()
    floor_mass = sum(story.mass for story in stories)
    attachments, links = read_devices(section, unit, (count, names), floor_mass)
    if matrices and (attachments or links):
        from tdint.model.config.matrices import check_devices

        check_devices(section.value, (*attachments, *links))

    # Imported here, because most models have no damage states and no limits.
    damage: DamageStates | None = None
    if value := section.get("damage"):
        from tdint.model.config.damage import read_damage

        damage = read_damage(value)
    limits: tuple[Limit, ...] = ()
    if value := section.get("limits"):
        from tdint.model.config.limit_keys import read_limits

        limits = read_limits(value, unit, stories, attachments, links)
    output_units, page_units = _read_output_units(section.get("output_units"), unit)
    rows = names or ("",) * (count or 0)
    loaded = (*rows, *(item.name for item in attachments))
    # The keys of `_ANALYSIS` have the order of the attributes of `Analysis`.
    model = Model(
        name=section.read("name") or origin.name,
        source=origin.label,
        text=origin.data,
        stories=stories,
        damping=damping,
        p_delta=p_delta,
        excitation=read_excitation(excitation, unit, count, loaded),
        initial=_read_initial(section.inner("initial"), unit, count, attachments),
        analysis=Analysis(*map(section.inner("analysis").read, _ANALYSIS)),
        collapse_drift=section.number("collapse_drift", default=_DEFAULT_COLLAPSE_DRIFT),
        output_units=output_units,
        page_units=page_units,
        page_head=_read_report_head(section),
        damage=damage,
        limits=limits,
        plausibility_off=section.read("plausibility") or "",
        weight_factor=_weight_factor(section, unit) if stories else 1.0,
        units=unit.named,
        attachments=attachments,
        links=links,
        matrices=matrices,
        document=section.value.node,
    )
    # Standard input can be read only one time: it cannot contain both the model and the record.
    record = model.excitation.record
    if origin.label == "-" and record and record.file == "-" and excitation:
        excitation.fault("standard input already contains the model; give the record as a file")
    return model


def _read_report_head(section: Section) -> tuple[tuple[str, str], ...]:
    """Return the names and texts of the lines at the top of a report."""
    head = section.read("report") or ()
    if isinstance(head, dict):
        return tuple((name, (text or "").strip()) for name, (_, text) in head.items())
    return tuple(head)


def _read_output_units(value: Value | None, unit: ModelUnits) -> tuple[OutputUnits, OutputUnits]:
    """Return the units of tables and summaries, and the units of reports and figures, from the key
    `output_units`: one text or a list of texts.

    Without the key, tables are in SI units, and reports in the units of the file.
    """
    if value is None:
        return SI, unit.named
    items = value.items("units") if value.is_list else (value,)
    text = ",".join(filter(None, (item.text() for item in items or ())))
    if text:
        try:
            return parse_output_units(text), parse_output_units(text, unit.named)
        except UsageError as error:
            value.fault(str(error))
    return SI, unit.named


def _read_initial(
    section: Section, unit: ModelUnits, count: int | None, attachments: Sequence[Attachment]
) -> Initial:
    """Return the initial state of the floors and attachments, m and m/s; zero by default."""
    states: list[tuple[float, ...]] = []
    for name in ("displacement", "velocity"):
        entry = section.get(name)
        items = entry.items("a list with one number per story") if entry else None
        if entry and items is not None and count is not None and len(items) != count:
            entry.fault(f"must have one number per story ({count}), got {len(items)}")
        values = tuple(item.number(scale=unit.length) for item in items or ())
        states.append(values if entry else (0.0,) * (count or 0))
    form = "a mapping of attachments to displacement and velocity"
    entry = section.get("attachments")
    entries = (entry.named(form, f"is empty; give {form}") if entry else None) or {}
    names = [item.name for item in attachments]
    for name in entries.keys() - {*names}:
        known = f" (known: {', '.join(names)})" if names else "; the model has no attachments"
        entries[name].fault(f"attachment {name!r} not found{known}")
    parts = [entries[name].section(_OF_ATTACHMENT) if name in entries else None for name in names]
    of_attachments = tuple(
        (
            part.number("displacement", scale=unit.length, default=math.nan) if part else math.nan,
            part.number("velocity", scale=unit.length, default=math.nan) if part else math.nan,
        )
        for part in parts
    )
    displacement, velocity = states
    return Initial(displacement, velocity, of_attachments if entries else ())


def _read_stories(
    section: Section, unit: ModelUnits, p_delta: bool
) -> tuple[tuple[Story, ...], int | None, Damping]:
    """Return stories, number of stories and damping, from `stories` or derived from `building`.

    The number of stories is `None` after an error.
    """
    building, damping = section.get("building"), section.get("damping")
    if building is None:
        advice = "give a list with one entry per story, or `building` instead"
        # If the key `building` is misspelled, missing `stories` are not another error.
        if section.mentions("building", "matrices"):
            entries = section.get("stories")
        else:
            entries = section.need("stories", advice)
        stories, count = read_stories(entries, unit, p_delta, section.has("stiffness_matrix"))
        # The inertias of a base add modes.
        base = section.get("base")
        further = sum(bool(base and base.peek(name)) for name in ("rotary_inertia", "mass"))
        read = _damping_of(damping, stories, count and count + further)
        if entries and isinstance(read, ModalDamping):
            for entry in entries.items("stories") or ():
                switch = entry.peek("rayleigh")
                if switch and not switch.boolean():
                    switch.fault("modal damping acts on all stories; use damping.rayleigh")
        return stories, count, read
    # Imported here because it loads numpy, which is not needed to read other models.
    from tdint.model.config.building_facts import read_building

    # The rules also determine the damping, unless the file contains the key `damping`.
    derived = read_building(building, unit)
    if section.has("stories"):
        building.fault("cannot be used with `stories`; give one of the two")
    # Damping is read even if the building is invalid, so that errors in the damping are reported.
    if derived is None:
        read_damping(damping, None)
        return (), None, None
    count = len(derived.stories)
    stories = derived.stories
    return stories, count, _damping_of(damping, stories, count) if damping else derived.damping


def _weight_factor(section: Section, unit: ModelUnits) -> float:
    """Return `Model.weight_factor` of a file with valid stories."""
    entries = section.get("stories")
    if not entries or any(entry.peek("weight") for entry in entries.items("stories") or ()):
        return 1.0
    return unit.mass * STANDARD_GRAVITY / unit.force


def _damping_of(value: Value | None, stories: Sequence[Story], count: int | None) -> Damping:
    """Return the damping of a building; report a tangent stiffness that can be negative."""
    # Each floor with rotary inertia adds a mode.
    damping = read_damping(value, count and count + sum(s.rotary_inertia > 0.0 for s in stories))
    if value and isinstance(damping, RayleighRatio | RayleighCoefficients) and damping.tangent:
        # Imported here, because other models are read without modes and arrays.
        from tdint.model.damping import falling_message, falling_spring

        for number, story in enumerate(stories, start=1):
            if spring := falling_spring(story):
                value.fault(falling_message(spring.law.name, number))
                break
    return damping


def model_schema() -> Schema:
    """Return the JSON schema (draft 7) of model files.

    The reader refuses everything that the schema refuses. In addition, it checks combinations of
    keys, for example that a list has an entry per story.
    """
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "tdint model",
        "description": "A shear building and its loads for tdint",
        **model_keys().schema(),
    }
