"""The buildings of a campaign: model files, or the rows of an inventory, each made when its runs
begin."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from tdint.analysis.run.together import Subject
from tdint.kernels.building.sources import CODE, code_of
from tdint.model.definition import Model, simple_model
from tdint.model.inventory import InventoryRow, InventoryRows, Made, derive_row
from tdint.units import SI, OutputUnits


def output_units(buildings: Buildings) -> OutputUnits:
    """The units in which all of their models want results; SI where they do not agree."""
    units = {model.output_units for model in models_of(buildings)}
    return units.pop() if len(units) == 1 else SI


def models_of(buildings: Buildings) -> list[Model]:
    """The models of those that come from files; none of an inventory."""
    return [given.made.model for given in different(buildings) if isinstance(given, GivenBuilding)]


def model_files(buildings: Buildings) -> dict[str, str]:
    """SHA-256 of the model files that they come from, by name."""
    texts = {model.source: model.text for model in models_of(buildings)}
    return {file: hashlib.sha256(text).hexdigest() for file, text in texts.items()}


def plugin_files(buildings: Buildings) -> dict[str, str]:
    """SHA-256 of the files of plug-ins that their methods and drift laws are from, by name."""
    if not CODE:
        return {}
    methods = {f"method {building.method.partition(':')[0]}" for building in different(buildings)}
    return code_of(
        methods
        | {f"law {story.law.name}" for model in models_of(buildings) for story in model.stories}
    )


@dataclass(frozen=True)
class GivenBuilding:
    """A building of a model file, the same for all its runs.

    Attributes
    ----------
    name : str
        Its name in tables, its own.
    made : Subject
        The building.
    cells : str
        What stands in the columns of its inventory that are carried along into tables, a JSON list
        of texts.
    """

    name: str
    made: Subject
    cells: str = field(default="[]", init=False)

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
    def varied(self) -> Mapping[str, float]:
        """What a sweep changed in it, by name."""
        return dict(self.made.model.varied_parameters)


def given_buildings(subjects: Sequence[Subject]) -> tuple[GivenBuilding, ...]:
    """Under their models' names; those that share one, under their files'."""
    files = Counter(
        name for name, _ in {(subject.model.name, subject.model.source) for subject in subjects}
    )
    result = []
    for subject in subjects:
        model = subject.model
        name = model.name if files[model.name] == 1 else model.source
        result.append(GivenBuilding(f"{name}: {model.label}" if model.label else name, subject))
    return tuple(result)


def digest_of(model: Model, method: str) -> str:
    """SHA-256 of what a model says of its building and its steps, and of the method."""
    content = asdict(model)
    for name in (
        "name",
        "source",
        "text",
        "output_units",
        "page_units",
        "page_head",
        "varied_parameters",
        "label",
        "damage",
    ):
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

    def subject(self) -> Subject:
        """The building by the rules."""
        rules = self.rules
        derived = derive_row(
            self.row, rules.name, stiffness=rules.stiffness, damping=rules.damping, seed=rules.seed
        )
        bare = simple_model(self.row.id, derived.stories)
        model = replace(
            bare,
            source="",
            damping=derived.damping,
            p_delta=rules.p_delta,
            collapse_drift=rules.collapse_drift,
        )
        return Subject(
            model.changed(dict(self.row.changes)) if self.row.changes else model, rules.method
        )

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
    def varied(self) -> Mapping[str, float]:
        return dict(self.row.changes)

    @property
    def cells(self) -> str:
        return self.row.cells


class RowBuildings(Made[RowBuilding]):
    """Those of an inventory, each made when it is asked for. What a sweep cannot change is refused
    at once, in the first building of each number of stories.

    Raises
    ------
    UsageError
        What is varied is not there, or goes out of range.
    """

    def __init__(self, rows: InventoryRows, rules: Rules) -> None:
        self.rows, self.rules = rows, rules
        if rows.is_varied:
            for first in sorted(np.unique(rows.stories, return_index=True)[1].tolist()):
                for building in self[first : first + len(rows.changes)]:
                    building.subject()

    def __len__(self) -> int:
        return len(self.rows)

    def make(self, number: int) -> RowBuilding:
        return RowBuilding(self.rows.make(number), self.rules)


Buildings = Sequence[GivenBuilding] | RowBuildings
"""By their numbers from 0."""


def different(buildings: Buildings) -> Sequence[GivenBuilding | RowBuilding]:
    """Those that may differ in their methods: of an inventory the first stands for all."""
    return buildings[:1] if isinstance(buildings, RowBuildings) else buildings


def digests_of(buildings: Buildings) -> list[str]:
    """SHA-256 of each; of an inventory one of its table, by the same rules for all."""
    if not isinstance(buildings, RowBuildings):
        return [building.digest for building in buildings]
    return [
        hashlib.sha256(repr(buildings.rules).encode()).hexdigest(),
        buildings.rows.digest(carried=False),
    ]
