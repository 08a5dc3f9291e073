"""Campaign files: YAML to a checked `CampaignFile`, with the same reader as models; nothing else is opened."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

from tdint.campaign.definition import AnalysisWishes, CampaignFile, FactorsFile, InventoryFile, ModelFiles, RecordFiles
from tdint.campaign.engine.runs import RunSettings
from tdint.campaign.fragility.type_states import DAMAGE, read_wishes
from tdint.campaign.motion_reader import MOTIONS, SEED, read_wanted_motions
from tdint.campaign.motions import MeasureLevels, Scales
from tdint.campaign.suites.intensity import GEOMETRIC_MEAN, MEASURES, PAIRS, SPECTRAL, WITHOUT_LEVELS, measure_at
from tdint.campaign.sweep import Varied, read_sweep
from tdint.campaign.sweep import positive as _positive
from tdint.errors import UsageError
from tdint.ground_motion.processing import RecordChoice
from tdint.methods.catalogue import parse as parse_method
from tdint.model.inventory.derive import CAPACITY, RULES
from tdint.model.keys.document import read_document
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import (
    ANY,
    POSITIVE,
    POSITIVE_RATIO,
    RATIO,
    Bounds,
    Choice,
    Either,
    EntriesOf,
    Flag,
    Key,
    Keys,
    Schema,
    Words,
)
from tdint.units import LENGTH, parse_units

_TOLERANCE = Bounds(0.0, 1.0, low_allowed=False, high_allowed=False, ratio=True)
_LEAST_LEVEL, _MOST_LEVEL = 1e-6, 1e6
"""Of an intensity, m/s^2 or m/s: beyond them lies no ground motion."""

_SCATTER = Bounds(0.0, 0.5, ratio=True)
_DAMPING = ("full", "mass-only")
_LENGTH = Choice(("m", "ft"), "length unit of inventories")
_UNITS = Keys((Key("length", _LENGTH, "of the inventory; plan areas are in its square", needed=True),))
_BUILDINGS = Keys(
    (
        Key("models", EntriesOf(Words(), least=1), "model files, relative to this file"),
        Key("inventory", Words(), "CSV file with a building per row, relative to this file"),
        Key("rules", Choice(tuple(RULES), "set of rules"), "by which the buildings follow from their rows"),
        Key("classes", Words(), "CSV file of the classes' capacity curves, for the rules capacity"),
        Key("as_published", Flag(), "multiply forces by the factor of oq-vmtk 1.1, for the rules capacity"),
        Key("units", _UNITS, "units of the inventory"),
        Key("damping", Choice(_DAMPING, "damping"), "mass-only leaves out the stiffness-proportional part"),
        Key("stiffness_scatter", _SCATTER, "standard deviation of a factor on each stiffness"),
        Key("damping_scatter", _SCATTER, "standard deviation of a factor on each damping ratio"),
        Key("seed", SEED, "what the factors are drawn from"),
    ),
    one_of=(("models", "inventory"),),
)

_OF_MEASURES = ("period", "damping", "levels", "pair")
_FIRST = "T1"


_INTENSITY = Keys(
    (
        Key("scales", EntriesOf(ANY, least=1), "factors on all motions"),
        Key("measure", Choice(MEASURES, "measure"), "intensity measure that takes the levels"),
        Key("period", Either((Choice((_FIRST,)), POSITIVE)), "of sa and sa-avg; that of each building by default"),
        Key("damping", RATIO, "damping ratio of sa and sa-avg; 5% by default"),
        Key("levels", EntriesOf(Words(), least=1), "values with their unit: 0.1 g, 0.2 m/s"),
        Key("pair", Choice(tuple(PAIRS), "measure of pairs"), "what stands for the two components of a pair"),
        Key("factors", Words(), "CSV file of `tdint scale`, relative to this file"),
    ),
    one_of=(("scales", "measure", "factors"),),
)

_ANALYSIS = Keys(
    (
        Key("method", Words(), "time-integration method with its parameters, for all buildings"),
        Key("methods", EntriesOf(Words(), least=1), "several methods, each with all the rest"),
        Key(
            "dt",
            Either((POSITIVE, EntriesOf(POSITIVE, least=1))),
            "time step, s, or several, each with all the rest; that of each model, else of each record, without it",
        ),
        Key("duration", POSITIVE, "time to integrate, s"),
        Key("tolerance", _TOLERANCE, "choose the step of each building by the error of its peak drifts"),
        Key("collapse_drift", POSITIVE_RATIO, "drift ratio beyond which a run counts as collapsed"),
        Key("p_delta", Flag(), "whether gravity acts on the displaced buildings"),
        Key("until_rest", Flag(), "go on with the ground at rest until the motion has died"),
        Key("check", Flag(), "estimate the errors of the demands: columns `<name>_error`"),
    )
)
_VARY = Varied()
_OUTPUTS = Keys(
    (
        Key("stories", Flag(), "write the peaks of every story, stories.csv"),
        Key("profiles", Flag(), "write their mean and fractiles over the motions, profiles.csv; false for inventories"),
    )
)
CAMPAIGN = Keys(
    (
        Key("name", Words(), "the campaign's name; that of the file where it is left out"),
        Key("buildings", _BUILDINGS, "model files, or an inventory", needed=True),
        Key("records", MOTIONS, "files and folders, or a grid", needed=True),
        Key("intensity", _INTENSITY, "how strong the motions are made; as they are where it is left out"),
        Key("analysis", _ANALYSIS, "what is the same for all runs"),
        Key("vary", _VARY, "parameters of the buildings, each value with all the others"),
        Key("damage", DAMAGE, "damage states of the buildings, and what they cost"),
        Key("outputs", _OUTPUTS, "what is kept beside a row for each run"),
    )
)
"""The keys of a campaign file, and what may stand under them."""


def campaign_schema() -> Schema:
    """The JSON schema (draft 7) of campaign files, for editors."""
    about = "Runs of buildings under ground motions for tdint"
    draft = "http://json-schema.org/draft-07/schema#"
    return {"$schema": draft, "title": "tdint campaign", "description": about, **CAMPAIGN.schema()}


def load_campaign(source: str | Path) -> CampaignFile:
    """Read a campaign file; the files that it names are not read yet.

    Parameters
    ----------
    source : str or Path
        The YAML file; `-` is standard input. Relative paths in it start from its folder.

    Raises
    ------
    ModelError
        It cannot be read, is not YAML, or has faults: all of them, with line and column.
    """
    origin, root = read_document(source, "campaign file", "`buildings` and `records`")
    section = root.section(CAMPAIGN)
    campaign = _read(section, origin.label, origin.name) if section else None
    root.faults.raise_if_any()
    assert campaign is not None
    return campaign


def _read(section: Section, label: str, name: str) -> CampaignFile:
    buildings = section.need("buildings", "give `models` or an `inventory`")
    records = section.need("records", "give `files` or a `grid`")
    _check_together(section)
    analysis, outputs = section.inner("analysis"), section.inner("outputs")
    dt = analysis.get("dt")
    found = (_read_buildings(buildings) if buildings else None) or ModelFiles(())
    return CampaignFile(
        name=section.text("name") or name,
        source=label,
        buildings=found,
        records=(read_wanted_motions(records) if records else None) or RecordFiles((), RecordChoice()),
        intensity=_read_intensity(section.get("intensity")) or Scales((1.0,)),
        analysis=_read_analysis(analysis),
        settings=RunSettings(
            dt=None if dt is None or dt.is_list else _positive(dt),
            **analysis.given("duration", "tolerance", "until_rest", "check"),
            stories=outputs.read("stories", False),
            profiles=outputs.read("profiles", isinstance(found, ModelFiles)),
        ),
        sweep=read_sweep(section.get("vary"), section.get("analysis"), models=isinstance(found, ModelFiles)),
        damage=read_wishes(section.get("damage"), found.rules if isinstance(found, InventoryFile) else None),
    )


def _check_together(section: Section) -> None:
    """What one part asks for and the motions of another leave without effect."""
    records = section.get("records")

    def said(part: str, name: str) -> Value | None:
        value = section.get(part)
        return value.peek(name) if value else None

    pair, pairs = said("intensity", "pair"), said("records", "pairs")
    if pair and records and not records.peek("grid") and (pairs is None or pairs.is_word("false")):
        pair.fault("has nothing to act on without `pairs: true` of the records")
    if (duration := said("analysis", "duration")) and said("records", "sequences"):
        duration.fault("is not for `sequences`, which have all of each record; `rest` of the records is in between")
    for name in ("measure", "factors"):
        if (entry := said("intensity", name)) and (said("records", "fields") or said("records", "events")):
            entry.fault("has no part in events, whose factors are given; `scales` multiply them")


def _read_analysis(section: Section) -> AnalysisWishes:
    method = section.get("method")
    named = method.parsed(parse_method) if method else None
    if method and section.has("methods"):
        method.fault("stands in place of `methods`; give one of the two")
    return AnalysisWishes(named.label if named else None, **section.given("collapse_drift", "p_delta"))


def _read_buildings(value: Value) -> ModelFiles | InventoryFile | None:
    """Model files or an inventory; None after a fault."""
    section = value.section()
    if section is None:
        return None
    models, inventory = section.get("models"), section.get("inventory")
    if models and inventory:
        inventory.fault("stands in place of `models`; give one of the two")
        return None
    if inventory:
        return _inventory(section, inventory)
    if models is None:
        section.need("models", "give a list of model files, or an inventory in its place")
        return None
    section.refuse(_BUILDINGS[2:], "belongs to an `inventory`")
    items = models.items("a list of model files", "is empty; give at least one model file")
    return ModelFiles(tuple(file for item in items or () if (file := item.file())))


def _inventory(section: Section, inventory: Value) -> InventoryFile | None:
    file = inventory.file()
    name = section.read("rules", next(iter(RULES)))
    units = section.need("units", "give {length: ft} or {length: m}; plan areas are in its square")
    lengths = units.section() if units else None
    length = lengths.need("length", "give ft or m") if lengths else None
    unit = length.read() if length else None
    kind, classes = section.read("damping"), section.file("classes")
    numbers = section.given("stiffness_scatter", "damping_scatter", "seed", "as_published")
    if name == CAPACITY:
        section.need("classes", "give the CSV file of the classes (class, sd_m, sa_g)")
        section.refuse(("damping", "stiffness_scatter", "damping_scatter", "seed"), f"has no part in {CAPACITY}")
    else:
        section.refuse(("classes", "as_published"), f"belongs to the rules {CAPACITY}")
    if file is None or name is None or unit is None:
        return None
    return InventoryFile(file, name, LENGTH[unit], mass_only=kind == "mass-only", classes=classes, **numbers)


def _read_intensity(value: Value | None) -> Scales | MeasureLevels | FactorsFile | None:
    """Factors, levels of a measure, or a file of factors; None without any, or after a fault."""
    section = value.section() if value else None
    if value is None or section is None:
        return None
    ways = [name for name in ("scales", "measure", "factors") if section.has(name)]
    if len(ways) != 1:
        value.fault("give one of scales, measure and factors" + (f", not {' and '.join(ways)}" if ways else ""))
        return None
    if ways == ["measure"]:
        return _levels(section)
    section.refuse(_OF_MEASURES, "belongs to a `measure`")
    if ways == ["factors"]:
        file = section.file("factors")
        return FactorsFile(file) if file else None
    return Scales(_scales(section))


def _scales(section: Section) -> tuple[float, ...]:
    value = section.get("scales")
    items = value.items("a list of factors", "is empty; give at least one factor") if value else None
    found: dict[float, None] = {}
    for item in items or ():
        number = item.number(ANY)
        if number == 0.0:
            item.fault("must not be zero")
        found[number] = None
    return tuple(found)


def _levels(section: Section) -> MeasureLevels | None:
    named = section.get("measure")
    for unlevelled, reason in WITHOUT_LEVELS.items():
        if named and named.is_word(unlevelled):
            named.fault(f"{unlevelled}: {reason}; no level can be asked of it")
            return None
    name, pair = section.read("measure"), section.read("pair", GEOMETRIC_MEAN)
    damping = section.number("damping", default=0.05)
    levels = section.need("levels", "give the values, such as [0.1 g, 0.2 g]")
    empty = "is empty; give at least one value"
    items = levels.items("a list of values with their unit", empty) if levels else None
    if name is None:
        return None
    quantity = "acceleration" if name in ("pga", *SPECTRAL) else "velocity"
    values = tuple(dict.fromkeys(_level(item, quantity) for item in items or ()))
    period = _period(section, name)
    return MeasureLevels(partial(measure_at, name, damping), period, values, pair)


def _period(section: Section, name: str) -> float | None:
    """The period of the measure; None for that of each building."""
    value = section.get("period")
    if name not in SPECTRAL:
        if value:
            value.fault(f"{name} has no period")
        return 1.0
    if value is None or value.is_word(_FIRST):
        return None
    number = value.number(POSITIVE, what=f"{_FIRST} or a positive number of seconds")
    return None if math.isnan(number) else number


def _level(value: Value, quantity: str) -> float:
    """A value with its unit in SI; nan after a fault."""
    text = value.text()
    if text is None:
        return math.nan
    example = "0.1 g" if quantity == "acceleration" else "0.2 m/s"
    try:
        units = parse_units(text)
    except UsageError:
        value.fault(f"must be a positive number with its unit, such as {example}, got {text!r}")
        return math.nan
    if units.quantity != quantity or not units.has_factor:
        value.fault(f"must be a number with a unit of {quantity}, such as {example}, got {text!r}")
        return math.nan
    if not _LEAST_LEVEL <= units.scale <= _MOST_LEVEL:
        value.fault(f"must be from {_LEAST_LEVEL:g} to {_MOST_LEVEL:g} in SI units, got {text!r}")
    return units.scale
