"""The buildings of a campaign: model files, or the rows of an inventory, each made when its runs begin."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import ClassVar

from tdint.analysis.run.together import Subject
from tdint.kernels.building.sources import CODE, code_of
from tdint.model.definition import Model, simple_model
from tdint.model.inventory import InventoryRow, derive_row
from tdint.units import SI, OutputUnits


def output_units(buildings: Buildings) -> OutputUnits:
    """The units in which all of their models want results; SI where they do not agree."""
    units = {building.output_units for building in buildings}
    return units.pop() if len(units) == 1 else SI


def model_files(buildings: Buildings) -> dict[str, str]:
    """SHA-256 of the model files that they come from, by name."""
    texts = {given.made.model.source: given.made.model.text for given in buildings if isinstance(given, GivenBuilding)}
    return {file: hashlib.sha256(text).hexdigest() for file, text in texts.items()}


def plugin_files(buildings: Buildings) -> dict[str, str]:
    """SHA-256 of the files of plug-ins that their methods and drift laws are from, by name."""
    if not CODE:
        return {}
    methods = {f"method {building.method.partition(':')[0]}" for building in buildings}
    given = [building.made.model for building in buildings if isinstance(building, GivenBuilding)]
    return code_of(methods | {f"law {story.law.name}" for model in given for story in model.stories})


@dataclass(frozen=True)
class GivenBuilding:
    """A building of a model file, the same for all its runs.

    Attributes
    ----------
    name : str
        Its name in tables, its own.
    made : Subject
        The building.
    columns : tuple of str
        The columns of its inventory that are carried along into tables.
    cells : str
        What stands there, a JSON list of texts.
    """

    name: str
    made: Subject
    columns: tuple[str, ...] = field(default=(), init=False)
    cells: str = field(default="[]", init=False)
    is_model: ClassVar[bool] = True

    def subject(self) -> Subject:
        """The building."""
        return self.made

    @property
    def stories(self) -> int:
        """How many stories it has."""
        return len(self.made.model.stories)

    @property
    def method(self) -> str:
        """The method that integrates it, with its parameters."""
        return self.made.integrator.label

    @property
    def digest(self) -> str:
        """SHA-256 of all that its response depends on, the ground motion apart."""
        return digest_of(self.made.model, self.method)

    @property
    def wishes(self) -> tuple[float | None, float | None]:
        """The time step and the duration that its model asks for, s."""
        return self.made.model.analysis.dt, self.made.model.analysis.duration

    @property
    def varied(self) -> Mapping[str, float]:
        """What a sweep changed in it, by name."""
        return dict(self.made.model.varied)

    @property
    def output_units(self) -> OutputUnits:
        """The units in which its model wants results."""
        return self.made.model.output_units


def given_buildings(subjects: Sequence[Subject]) -> tuple[GivenBuilding, ...]:
    """Under their models' names; those that share one, under their files'."""
    sources: dict[str, set[str]] = {}
    for subject in subjects:
        sources.setdefault(subject.model.name, set()).add(subject.model.source)
    result = []
    for subject in subjects:
        model = subject.model
        name = model.name if len(sources[model.name]) == 1 else model.source
        result.append(GivenBuilding(f"{name}: {model.label}" if model.label else name, subject))
    return tuple(result)


def digest_of(model: Model, method: str) -> str:
    """SHA-256 of what a model says of its building and its steps, and of the method."""
    content = asdict(model)
    for name in ("name", "source", "text", "output_units", "page_units", "page_head", "varied", "label", "damage"):
        del content[name]
    del content["excitation"]["record"]
    return hashlib.sha256(json.dumps([content, method], sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Rules:
    """How the buildings of an inventory follow from their rows, and what is the same for all.

    Attributes
    ----------
    name : str
        The set of rules.
    stiffness, damping, seed : float, float, int
        Scatter, as `tdint.model.inventory.derive_all` has it.
    method : str
        The method that integrates them.
    collapse_drift : float
        Drift ratio over which a run is flagged as collapsed.
    p_delta : bool
        Whether gravity acts on the displaced building.
    """

    name: str
    stiffness: float
    damping: float
    seed: int
    method: str
    collapse_drift: float
    p_delta: bool = False


@dataclass(frozen=True, slots=True)
class RowBuilding:
    """A building of an inventory, made anew for its runs; it tells what a `GivenBuilding` does."""

    row: InventoryRow
    rules: Rules
    is_model: ClassVar[bool] = False

    def subject(self) -> Subject:
        """The building by the rules."""
        rules = self.rules
        derived = derive_row(self.row, rules.name, stiffness=rules.stiffness, damping=rules.damping, seed=rules.seed)
        bare = simple_model(self.row.id, derived.stories)
        model = replace(
            bare, source="", damping=derived.damping, p_delta=rules.p_delta, collapse_drift=rules.collapse_drift
        )
        return Subject(model.changed(dict(self.row.changes)) if self.row.changes else model, rules.method)

    @property
    def name(self) -> str:
        return f"{self.row.id}: {self.row.label}" if self.row.label else self.row.id

    @property
    def stories(self) -> int:
        return self.row.facts.stories

    @property
    def method(self) -> str:
        return self.rules.method

    @property
    def digest(self) -> str:
        row = self.row
        contents = (row.id, row.facts, self.rules, *((row.changes,) if row.changes else ()))
        return hashlib.sha256(repr(contents).encode()).hexdigest()

    @property
    def wishes(self) -> tuple[float | None, float | None]:
        return None, None

    @property
    def varied(self) -> Mapping[str, float]:
        return dict(self.row.changes)

    @property
    def output_units(self) -> OutputUnits:
        return SI

    @property
    def columns(self) -> tuple[str, ...]:
        return self.row.columns

    @property
    def cells(self) -> str:
        return self.row.cells


Buildings = Sequence[GivenBuilding | RowBuilding]
"""By their numbers from 0."""


def inventory_buildings(rows: Sequence[InventoryRow], rules: Rules) -> tuple[RowBuilding, ...]:
    """Those of an inventory. What a sweep cannot change is refused before any run, in the first building of each number
    of stories.

    Raises
    ------
    UsageError
        What is varied is not there, or goes out of range.
    """
    buildings = tuple(RowBuilding(row, rules) for row in rows)
    firsts: dict[int, str] = {}
    for building in buildings:
        if building.row.changes and firsts.setdefault(building.stories, building.row.id) == building.row.id:
            building.subject()
    return buildings
