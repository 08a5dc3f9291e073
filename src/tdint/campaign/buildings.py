"""The buildings of a campaign: model files, or the rows of an inventory, each made when its runs begin."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Protocol

from tdint.campaign.engine.task import Source, Subject
from tdint.model.definition import Analysis, Excitation, Initial, Model
from tdint.model.inventory.derive import derive_row
from tdint.model.inventory.table import InventoryRow
from tdint.model.variation import varied
from tdint.output_units import SI, OutputUnits


class Buildings(Protocol):
    """Buildings by their numbers from 0."""

    def __len__(self) -> int: ...

    def name(self, number: int) -> str:
        """The building's name in tables."""

    def stories(self, number: int) -> int:
        """How many stories it has."""

    def method(self, number: int) -> str:
        """The method that integrates it, with its parameters."""

    def digest(self, number: int) -> str:
        """SHA-256 of all that its response depends on, the ground motion apart."""

    def source(self, number: int) -> Source:
        """What makes it."""

    def wishes(self, number: int) -> tuple[float | None, float | None]:
        """The time step and the duration that its model asks for, s."""

    def varied(self, number: int) -> Mapping[str, float]:
        """What a sweep changed in it, by name."""

    def cells(self, number: int) -> str:
        """What its inventory says of it in the columns that are carried along, a JSON list of texts."""

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of the inventory that are carried along into tables."""

    @property
    def files(self) -> Mapping[str, str]:
        """SHA-256 of the model files that they come from, by name."""

    @property
    def output_units(self) -> OutputUnits:
        """The units in which all of their models want results; SI where they do not agree."""


@dataclass(frozen=True)
class GivenBuilding:
    """A building of a model file, the same for all its runs."""

    made: Subject

    def subject(self) -> Subject:
        """The building."""
        return self.made


@dataclass(frozen=True)
class GivenBuildings:
    """Buildings of model files.

    Attributes
    ----------
    names : tuple of str
        Their names, each its own.
    sources : tuple of GivenBuilding
        The buildings.
    """

    names: tuple[str, ...]
    sources: tuple[GivenBuilding, ...]

    @classmethod
    def of(cls, subjects: Sequence[Subject]) -> GivenBuildings:
        """Under their models' names; those that share one, under their files'."""
        sources: dict[str, set[str]] = {}
        for subject in subjects:
            sources.setdefault(subject.model.name, set()).add(subject.model.source)
        models = [subject.model for subject in subjects]
        names = [one.name if len(sources[one.name]) == 1 else one.source for one in models]
        unique = [f"{name}: {one.label}" if one.label else name for name, one in zip(names, models, strict=True)]
        return cls(tuple(unique), tuple(GivenBuilding(subject) for subject in subjects))

    def __len__(self) -> int:
        return len(self.sources)

    def name(self, number: int) -> str:
        return self.names[number]

    def stories(self, number: int) -> int:
        return len(self.sources[number].made.model.stories)

    def method(self, number: int) -> str:
        return self.sources[number].made.integrator.label

    def digest(self, number: int) -> str:
        subject = self.sources[number].made
        return digest_of(subject.model, subject.integrator.label)

    def source(self, number: int) -> Source:
        return self.sources[number]

    def wishes(self, number: int) -> tuple[float | None, float | None]:
        analysis = self.sources[number].made.model.analysis
        return analysis.dt, analysis.duration

    def varied(self, number: int) -> Mapping[str, float]:
        return dict(self.sources[number].made.model.varied)

    def cells(self, number: int) -> str:
        return "[]"

    @property
    def columns(self) -> tuple[str, ...]:
        return ()

    @property
    def files(self) -> Mapping[str, str]:
        texts = {source.made.model.source: source.made.model.text for source in self.sources}
        return {file: hashlib.sha256(text).hexdigest() for file, text in texts.items()}

    @property
    def output_units(self) -> OutputUnits:
        wanted = {source.made.model.output_units for source in self.sources}
        return wanted.pop() if len(wanted) == 1 else SI


def digest_of(model: Model, method: str) -> str:
    """SHA-256 of what a model says of its building and its steps, and of the method."""
    content = asdict(model)
    for name in ("name", "source", "text", "output_units", "varied", "label", "damage"):
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
        Scatter, as `tdint.model.inventory.derive.derive_all` has it.
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


@dataclass(frozen=True)
class RowBuilding:
    """A building of an inventory, made anew for its runs."""

    row: InventoryRow
    rules: Rules

    def subject(self) -> Subject:
        """The building by the rules."""
        rules = self.rules
        derived = derive_row(self.row, rules.name, stiffness=rules.stiffness, damping=rules.damping, seed=rules.seed)
        rest = (0.0,) * self.row.facts.stories
        model = Model(
            name=self.row.id,
            source="",
            text=b"",
            stories=derived.stories,
            damping=derived.damping,
            p_delta=rules.p_delta,
            excitation=Excitation(None, ()),
            initial=Initial(rest, rest),
            analysis=Analysis(None, None, None),
            collapse_drift=rules.collapse_drift,
        )
        return Subject(varied(model, dict(self.row.changes)) if self.row.changes else model, rules.method)


@dataclass(frozen=True)
class InventoryBuildings:
    """Buildings of an inventory."""

    rows: Sequence[InventoryRow] = field(repr=False)
    rules: Rules

    def __len__(self) -> int:
        return len(self.rows)

    def check_changes(self) -> None:
        """Refuse, before any run, what a sweep cannot change: in the first building of each number of stories.

        Raises
        ------
        UsageError
            What is varied is not there, or goes out of range.
        """
        firsts: dict[int, str] = {}
        for row in self.rows:
            if row.changes and firsts.setdefault(row.facts.stories, row.id) == row.id:
                RowBuilding(row, self.rules).subject()

    def name(self, number: int) -> str:
        row = self.rows[number]
        return f"{row.id}: {row.label}" if row.label else row.id

    def stories(self, number: int) -> int:
        return self.rows[number].facts.stories

    def method(self, number: int) -> str:
        return self.rules.method

    def digest(self, number: int) -> str:
        row = self.rows[number]
        own = (row.id, row.facts, self.rules, *((row.changes,) if row.changes else ()))
        return hashlib.sha256(repr(own).encode()).hexdigest()

    def source(self, number: int) -> Source:
        return RowBuilding(self.rows[number], self.rules)

    def wishes(self, number: int) -> tuple[float | None, float | None]:
        return None, None

    def varied(self, number: int) -> Mapping[str, float]:
        return dict(self.rows[number].changes)

    def cells(self, number: int) -> str:
        return self.rows[number].cells

    @property
    def columns(self) -> tuple[str, ...]:
        return self.rows[0].columns

    @property
    def files(self) -> Mapping[str, str]:
        return {}

    @property
    def output_units(self) -> OutputUnits:
        return SI
