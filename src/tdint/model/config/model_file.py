"""Model files: YAML to a checked `Model` in SI units. This is the only place that knows the file's keys and units.

`tdint.model.keys` reads text, numbers and words with line and column; the modules around this one read one part of the
file each. The JSON schema for editors is made of the same declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from tdint.errors import UsageError
from tdint.model.config.damage import DAMAGE, read_damage
from tdint.model.config.damping import DAMPING, read_damping
from tdint.model.config.excitation import EXCITATION, read_excitation
from tdint.model.config.stories import STORIES, read_stories
from tdint.model.config.units import UNITS, ModelUnits, read_units
from tdint.model.definition import Analysis, Damping, Initial, Model, Story
from tdint.model.keys.document import SourceText, read_document
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import ANY, POSITIVE, POSITIVE_RATIO, Either, EntriesOf, Flag, Key, Keys, Schema, Words
from tdint.output_units import SI, OutputUnits, parse_output_units

_INITIAL = Keys(
    (
        Key("displacement", EntriesOf(ANY), "of the floors relative to the ground, from the bottom"),
        Key("velocity", EntriesOf(ANY), "of the floors relative to the ground, from the bottom"),
    )
)
_ANALYSIS = Keys(
    (
        Key("method", Words(), "time-integration method with its parameters, such as newmark:beta=0.25,gamma=0.5"),
        Key("dt", POSITIVE, "time step, s"),
        Key("duration", POSITIVE, "time to integrate, s"),
    )
)


def model_keys() -> Keys:
    """The keys of a model file, and what may stand under them."""
    from tdint.model.config.building_facts import BUILDING  # needs numpy, which most models are read without

    kinds = {"building": BUILDING}
    return Keys(tuple(replace(key, kind=kinds.get(key.name, key.kind)) for key in _MODEL.declared), _MODEL.one_of)


_MODEL = Keys(
    (
        Key("name", Words(), "the building's name; that of the file where it is left out"),
        Key("units", UNITS, "units of the numbers in this file; SI where they are left out"),
        Key("stories", STORIES, "the stories, from the ground up; `repeat` for equal ones"),
        Key("building", Keys(()), "a few facts in place of stories, which rules derive from them"),
        Key("damping", DAMPING, "damping besides the dashpots; 5% is Rayleigh damping in modes 1 and 3"),
        Key("p_delta", Flag(), "whether gravity acts on the displaced building"),
        Key("excitation", EXCITATION, "ground motion and forces"),
        Key("initial", _INITIAL, "state at the start; at rest where it is left out"),
        Key("analysis", _ANALYSIS, "method, time step and duration; the command line comes before it"),
        Key("collapse_drift", POSITIVE_RATIO, "drift ratio beyond which a run counts as collapsed; 10% by default"),
        Key("damage", DAMAGE, "damage states of the building"),
        Key("output_units", Either((Words(), EntriesOf(Words(), least=1))), "units of the output: kip, in, g"),
    ),
    one_of=(("stories", "building"),),
)
_DEFAULT_COLLAPSE_DRIFT = 0.10


def load_model(source: str | Path | TextIO | Mapping[str, Any]) -> Model:
    """Read a model file, or a mapping that says the same.

    Parameters
    ----------
    source : str, Path, text stream or mapping
        The YAML file; `-` is standard input. Or its content as Python has it: mappings, lists, arrays, numbers, text.
        Relative paths in the file start from its folder, those of a stream without a file and of a mapping from the
        working directory.

    Returns
    -------
    Model
        All values in SI units.

    Raises
    ------
    ModelError
        If the file cannot be read, is not YAML or has faults; all faults are reported in one error, in file order.
        Its keys count list entries from 1 as they stand in the file: `stories[2]` is the second entry of `stories`,
        whatever `repeat` the first one has.
    """
    return load_judged(source, {})


def model_of(given: Any) -> Model:
    """A model, or that of what `load_model` takes.

    Raises
    ------
    ModelError
        It is neither, or the file has faults.
    """
    return given if isinstance(given, Model) else load_model(given)


def load_judged(
    source: str | Path | TextIO | Mapping[str, Any], judges: Mapping[str, Callable[[str, Path], object]]
) -> Model:
    """Read a model as `load_model` does, and let others judge words in it that mean nothing here.

    Parameters
    ----------
    judges : mapping of str to callable
        By the path of a key (`analysis.method`): takes the text under it and the folder that the file's paths start
        from, and raises UsageError if it is wrong, which becomes a fault at its place.
    """
    origin, root = read_document(source)
    section = root.section(_MODEL)
    model = _read_model(section, origin) if section else None
    for path, judge in judges.items():
        _let_judge(root, path, judge)
    root.faults.raise_if_any()
    assert model is not None
    return model


def _let_judge(root: Value, path: str, judge: Callable[[str, Path], object]) -> None:
    value: Value | None = root
    for name in path.split("."):
        value = value.peek(name) if value else None
    if value is None or value.is_list or value.is_mapping or not (text := value.word):
        return
    try:
        judge(text, root.faults.folder)
    except UsageError as error:
        Value(value.node, path, value.faults).fault(str(error))


def _read_model(section: Section, origin: SourceText) -> Model:
    """The model; faults are noted, and leave nan or None behind."""
    unit = read_units(section.get("units"))
    p_delta = section.read("p_delta", False)
    stories, count, damping = _read_stories(section, unit, p_delta)
    excitation = section.get("excitation")
    model = Model(
        name=section.text("name") or origin.name,
        source=origin.label,
        text=origin.data,
        stories=stories,
        damping=damping,
        p_delta=p_delta,
        excitation=read_excitation(excitation, unit, count),
        initial=_read_initial(section.inner("initial"), unit.length, count),
        analysis=Analysis(*map(section.inner("analysis").read, _ANALYSIS)),
        collapse_drift=section.number("collapse_drift", default=_DEFAULT_COLLAPSE_DRIFT),
        output_units=_read_output_units(section.get("output_units")),
        damage=read_damage(section.get("damage")),
    )
    record = model.excitation.record
    if origin.label == "-" and record and record.file == "-" and excitation:
        excitation.fault("standard input already holds the model; give the record as a file")
    return model


def _read_stories(section: Section, unit: ModelUnits, p_delta: bool) -> tuple[tuple[Story, ...], int | None, Damping]:
    """Stories, their number and the damping: as they are written out, or as rules derive them of a `building`."""
    building, damping = section.get("building"), section.get("damping")
    if building is None:
        advice = "give a list with one entry per story, or a building in its place"
        entries = section.get("stories") if section.mentions("building") else section.need("stories", advice)
        stories, count = read_stories(entries, unit, p_delta)
        return stories, count, read_damping(damping, count)
    from tdint.model.config.building_facts import read_building  # needs numpy, which other models are read without

    derived = read_building(building, unit)
    if section.has("stories"):
        building.fault("stands in place of `stories`; give one of the two")
    if derived is None:
        read_damping(damping, None)
        return (), None, None
    count = len(derived.stories)
    return derived.stories, count, read_damping(damping, count) if damping else derived.damping


def _read_initial(section: Section, length: float, count: int | None) -> Initial:
    def entries(name: str) -> tuple[float, ...]:
        entry = section.get(name)
        if entry is None:
            return (0.0,) * (count or 0)
        items = entry.items("a list with one number per story")
        if items is not None and count is not None and len(items) != count:
            entry.fault(f"must have one number per story ({count}), got {len(items)}")
        return tuple(item.number(scale=length) for item in items or ())

    return Initial(entries("displacement"), entries("velocity"))


def _read_output_units(value: Value | None) -> OutputUnits:
    if value is None:
        return SI
    items = value.items("units") if value.is_list else (value,)
    words = [item.text() for item in items or ()]
    try:
        return parse_output_units(",".join(filter(None, words))) if any(words) else SI
    except UsageError as error:
        value.fault(str(error))
        return SI


def model_schema() -> Schema:
    """The JSON schema (draft 7) of model files.

    What it refuses, the reader refuses, too. The reader refuses more: what several keys say together, such as a list
    with an entry for each story.
    """
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "tdint model",
        "description": "A shear building and its loads for tdint",
        **model_keys().schema(),
    }
