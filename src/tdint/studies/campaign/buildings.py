"""Buildings of a campaign: model files, or rows of an inventory, which are created when their runs
start."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from tdint.items import LazySequence
from tdint.kernels.building.sources import CODE, code_of
from tdint.model.definition import Excitation, Model, simple_model
from tdint.model.limits import Limit
from tdint.response.runs.batch import Subject
from tdint.studies.regions.inventory import InventoryRow, InventoryRows, derive_row
from tdint.units import SI, OutputUnits


def output_units(buildings: Buildings) -> OutputUnits:
    """Return the output units that all models of the buildings request. The result is SI if the
    models request different units, or if the buildings are from an inventory."""
    units = {model.output_units for model in models_of(buildings)}
    return units.pop() if len(units) == 1 else SI


def models_of(buildings: Buildings) -> list[Model]:
    """Return the models of the buildings; an empty list if the buildings are from an inventory."""
    # `with_all_methods` returns a single building of an inventory instead of millions; it is not a
    # `ModelBuilding`.
    return [
        building.made.model
        for building in with_all_methods(buildings)
        if isinstance(building, ModelBuilding)
    ]


def model_files(buildings: Buildings) -> dict[str, str]:
    """Return a dictionary from the path of each model file, and of each table of forces that it
    reads, to the SHA-256 of its content."""
    models = models_of(buildings)
    files = {model.source: hashlib.sha256(model.text).hexdigest() for model in models}
    tables = [force.table for model in models for force in model.excitation.tables]
    return files | {table.source: table.sha256 for table in tables if table.source}


def plugin_files(buildings: Buildings) -> dict[str, str]:
    """Return a dictionary from each plug-in file, which defines a method or a hysteretic law of the
    buildings, to the SHA-256 of its content."""
    if not CODE:  # no plug-in is loaded
        return {}
    # `code_of` identifies code by `method NAME` and `law NAME`. The name of a method ends at the
    # colon that precedes its parameters.
    methods = {
        f"method {building.method.partition(':')[0]}" for building in with_all_methods(buildings)
    }
    laws = {
        f"law {spring.law.name}"
        for model in models_of(buildings)
        for story in (*model.stories, *(device.spring for device in model.devices))
        for spring in story.springs
    }
    return code_of(methods | laws)


@dataclass(frozen=True)
class ModelBuilding:
    """Building of a model file. All runs use the same object.

    Attributes
    ----------
    name : str
        Unique name in tables.
    """

    name: str
    made: Subject

    def subject(self) -> Subject:
        """Return the building."""
        return self.made

    @property
    def label(self) -> str:
        """Name of the variation of a sweep; empty without a sweep."""
        return self.made.model.label

    @property
    def stories(self) -> int:
        """Number of stories."""
        return len(self.made.model.stories)

    @property
    def method(self) -> str:
        """Method with its parameters."""
        return self.made.integrator.label

    @property
    def digest(self) -> str:
        """SHA-256 of the complete input of the response, except the ground motion."""
        return digest_of(self.made.model, self.method)

    @property
    def varied(self) -> Mapping[str, float]:
        """Parameters that a sweep changed, with their values."""
        return dict(self.made.model.varied_parameters)


def model_buildings(subjects: Sequence[Subject]) -> tuple[ModelBuilding, ...]:
    """Return the buildings of model files, each with a unique name for the tables.

    The name of a building is the name of its model. If several files contain models with the same
    name, it is the path of the file. A variation of a sweep adds its label:
    `frame: damping=0.05`.

    Parameters
    ----------
    subjects : sequence of Subject
        The buildings with their methods, including the variations of a sweep.
    """
    models_with_files = {(subject.model.name, subject.model.source) for subject in subjects}
    file_count = Counter(model_name for model_name, _ in models_with_files)
    result = []
    for subject in subjects:
        model = subject.model
        name = model.name if file_count[model.name] == 1 else model.source
        result.append(ModelBuilding(f"{name}: {model.label}" if model.label else name, subject))
    return tuple(result)


_LATER_NUMBERS = ("inertance", "rotary_inertia", "base_dashpots", "base_inertia")


def digest_of(model: Model, method: str) -> str:
    """Return the SHA-256 of a model and a method. Two models with the same SHA-256 have the same
    response to each ground motion."""
    if model.across is not None:
        digests = [digest_of(part, method) for part in model.directions]
        text = " ".join([*digests, repr(model.axis_azimuth)])
        return hashlib.sha256(text.encode()).hexdigest()
    # Remove everything that does not change the response, such as names and units of the output.
    # The ground motion of the model is not used in a campaign.
    unexcited = replace(model, excitation=Excitation(None, model.excitation.forces))
    # The ratio of a fracture drift only determines variations of the model. Stores of earlier
    # versions contain digests without `_LATER_NUMBERS` and initial attachments.
    content = asdict(
        unexcited,
        dict_factory=lambda items: {
            key: value
            for key, value in items
            if key != "fracture_ratio" and (key not in _LATER_NUMBERS or np.any(value))
        },
    )
    if not content["initial"]["attachments"]:
        del content["initial"]["attachments"]
    for name in (
        "name",
        "source",
        "document",
        "text",
        "output_units",
        "page_units",
        "page_head",
        "varied_parameters",
        "label",
        "damage",
        "limits",
        "weight_factor",
        "units",
        "across",
        "axis_azimuth",
    ):
        del content[name]
    # A table is identified by the digest of its numbers.
    content["excitation"] = {
        "forces": content["excitation"]["forces"],
        "tables": [
            (force.floor, force.table.digest, force.column, force.factor, force.start)
            for force in model.excitation.tables
        ],
    }
    # Matrices are arrays; JSON writes them as lists.
    text = json.dumps([content, method], sort_keys=True, default=lambda matrix: matrix.tolist())
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Rules:
    """Rules that derive the buildings of an inventory from their rows, and common settings.

    Attributes
    ----------
    stiffness, damping : float
        Standard deviations of the random factors (mean 1) on stiffness and damping ratio of each
        building; 0: no factors.
    collapse_drift : float
        Drift ratio above which a run counts as collapsed.
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
    """Building of an inventory. Only its row is stored; `subject` derives the building for each
    use."""

    row: InventoryRow
    rules: Rules

    def subject(self) -> Subject:
        """Return the building of the inventory row, with its time-integration method.

        The rules (`Rules`) derive stories and damping from the facts in the row, such as structural
        type and year. If the row belongs to a parameter sweep, `row.changes` contains the values of
        the varied parameters, which then replace the derived values.
        """
        rules = self.rules
        derived = derive_row(
            self.row, rules.name, stiffness=rules.stiffness, damping=rules.damping, seed=rules.seed
        )
        model = replace(
            simple_model(self.row.id, derived.stories),
            source="",  # the building was not read from a model file
            damping=derived.damping,
            p_delta=rules.p_delta,
            collapse_drift=rules.collapse_drift,
        )
        return Subject(
            model.changed(dict(self.row.changes)) if self.row.changes else model, rules.method
        )

    @property
    def name(self) -> str:
        """Identifier of the row, with the label of its variation."""
        return f"{self.row.id}: {self.row.label}" if self.row.label else self.row.id

    @property
    def label(self) -> str:
        """Name of the variation of a sweep; empty without a sweep."""
        return self.row.label

    @property
    def stories(self) -> int:
        """Number of stories."""
        return self.row.facts.stories

    @property
    def method(self) -> str:
        """Method with its parameters."""
        return self.rules.method

    @property
    def digest(self) -> str:
        """SHA-256 of the row and the rules, which determine the building."""
        row = self.row
        # Rows without a variation keep the digest that they had before sweeps existed.
        contents = (row.id, row.facts, self.rules, *((row.changes,) if row.changes else ()))
        return hashlib.sha256(repr(contents).encode()).hexdigest()

    @property
    def varied(self) -> Mapping[str, float]:
        """Parameters that a sweep changed, with their values."""
        return dict(self.row.changes)


class RowBuildings(LazySequence[RowBuilding]):
    """Buildings of an inventory, each created on access.

    A sweep is checked immediately: all its variations are applied to the first building of each
    number of stories, because parameters such as `story 3.mass` require a number of stories.

    Raises
    ------
    UsageError
        A varied parameter does not exist, or a value is out of range.
    """

    def __init__(self, rows: InventoryRows, rules: Rules) -> None:
        """Store the rows of the inventory and the rules that derive buildings, and check the
        variations of a sweep. Errors are described in the class."""
        self.rows, self.rules = rows, rules
        if rows.is_varied:
            # Building `first` is the first building with its number of stories; its variations
            # have consecutive numbers. `subject` applies the variation, or raises the error.
            first_numbers = np.unique(rows.stories, return_index=True)[1].tolist()
            for first in sorted(first_numbers):
                for building in self[first : first + len(rows.changes)]:
                    building.subject()

    def __len__(self) -> int:
        return len(self.rows)

    def make(self, number: int) -> RowBuilding:
        return RowBuilding(self.rows.make(number), self.rules)


Buildings = Sequence[ModelBuilding] | RowBuildings
"""Buildings; the index is the number of the building."""


def with_all_methods(buildings: Buildings) -> Sequence[ModelBuilding | RowBuilding]:
    """Return a sufficient set of buildings to determine the methods of all buildings: all buildings
    of model files, but only the first building of an inventory, because all its rows have the same
    method."""
    return buildings[:1] if isinstance(buildings, RowBuildings) else buildings


def digests_of(buildings: Buildings) -> list[str]:
    """Return SHA-256 values that identify the response of the buildings: one value per building of
    model files; for an inventory, the value of its rules and the value of its table. Columns of the
    inventory that are only copied to results (`carried`) are not included."""
    if not isinstance(buildings, RowBuildings):
        return [building.digest for building in buildings]
    return [
        hashlib.sha256(repr(buildings.rules).encode()).hexdigest(),
        buildings.rows.digest(carried=False),
    ]


# ---- Limits of the buildings as text, which is written to the store of a campaign


@dataclass(frozen=True)
class BuildingLimits:
    """Limits of a building, and its isolators.

    Attributes
    ----------
    isolators : tuple of int
        Numbers of the stories with isolators, from 1.
    """

    limits: tuple[Limit, ...] = ()
    isolators: tuple[int, ...] = ()


NO_LIMITS = BuildingLimits()


def limits_text(buildings: Buildings) -> str:
    """Return the limits and isolators of all buildings as JSON text; an empty text if no building
    has limits or isolators.

    The key `sets` lists the distinct pairs of limits and isolators. The key `of` contains, for each
    building, the index of its pair in this list. Variations of a model have the same index.
    """
    index_of_set: dict[str, int] = {}  # index in `sets` by the JSON text of the item
    set_of_building = []
    for building in buildings:
        model = building.subject().model
        isolators = [i for i, story in enumerate(model.stories, start=1) if story.isolator]
        text = json.dumps([[limit.as_json() for limit in model.limits], isolators])
        set_of_building.append(index_of_set.setdefault(text, len(index_of_set)))
    # Without buildings there is no pair; without limits and isolators there is only the empty pair.
    has_no_limits = list(index_of_set) in ([], [json.dumps([[], []])])
    if has_no_limits:
        return ""
    return json.dumps({"sets": [json.loads(text) for text in index_of_set], "of": set_of_building})


def limits_of_text(text: str) -> list[BuildingLimits]:
    """Return the limits and isolators of each building, in the order of the buildings, from the
    JSON text of `limits_text`. The list is empty if the text is empty."""
    stored = json.loads(text or '{"sets": [], "of": []}')
    sets = [
        BuildingLimits(tuple(map(Limit.from_json, limits)), tuple(isolators))
        for limits, isolators in stored["sets"]
    ]
    return [sets[number] for number in stored["of"]]
