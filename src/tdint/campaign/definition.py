"""Contents of a campaign file as typed values in SI units. The files that it names are not read
here."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.campaign.batch import RunSettings
from tdint.campaign.fragility.type_states import DamageWishes
from tdint.campaign.motions import MAX_DISTANCE, GridFile, MeasureLevels, Scales
from tdint.errors import ModelError, ModelFault, UsageError
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import PairNames
from tdint.methods.catalogue import parse as parse_method
from tdint.model.definition import PARAMETERS, Model, check_parameter, check_value
from tdint.model.keys.fields import ANY, Bounds, Key, Keys, Schema, Value, Whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tdint.model.inventory import InventoryRows


# ---- Sweeps: variations of each building of a campaign over grids and samples of its parameters,
# methods and time steps (key `vary` of a campaign file and lists under `analysis`)

_MAX_VARIATIONS = (
    1_000_000  # maximum number of variations of a building, which are stored in memory
)
_LABEL_DIGITS = 6  # significant digits of the values in the labels of variations

DISTRIBUTIONS: Mapping[str, tuple[str, str]] = {
    "lognormal": ("median", "beta"),
    "normal": ("mean", "sd"),
    "uniform": ("low", "high"),
}
"""Distributions of random parameters, and the names of their two parameters."""


@dataclass(frozen=True)
class Distribution:
    """Distribution of a random parameter: an item of `DISTRIBUTIONS` with its two parameters."""

    kind: str
    first: float
    second: float

    def __post_init__(self) -> None:
        """Raise UsageError for invalid parameters."""
        first, second = DISTRIBUTIONS[self.kind]
        if self.kind == "uniform" and not self.first < self.second:
            raise UsageError(
                f"uniform: {first} must be less than {second}, got {self.first:g} and "
                f"{self.second:g}"
            )
        if self.kind != "uniform" and not self.second > 0.0:
            raise UsageError(f"{self.kind}: {second} must be positive, got {self.second:g}")
        if self.kind == "lognormal" and not self.first > 0.0:
            raise UsageError(f"lognormal: {first} must be positive, got {self.first:g}")

    def at(self, probability: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the quantiles for probabilities (0 to 1)."""
        from scipy.special import ndtri

        if self.kind == "uniform":
            return self.first + probability * (self.second - self.first)
        deviations = self.second * ndtri(probability)
        return np.asarray(
            self.first * np.exp(deviations) if self.kind == "lognormal" else self.first + deviations
        )


@dataclass(frozen=True)
class ParameterSweep:
    """Variations of every building of a campaign.

    Attributes
    ----------
    grids : mapping of str to tuple of float
        Values of parameters (`tdint.model.definition.PARAMETERS`), in all combinations.
    random : mapping of str to Distribution
        Independent random parameters, sampled by a Latin hypercube (McKay, Beckman and Conover
        1979).
    samples, seed : int
        Number of samples, which are the same in each combination of the other values, and random
        seed.
    methods : tuple of str
        Methods with their parameters, in all combinations with the other values; empty: no
        variation.
    steps : tuple of float
        Time steps, s, in all combinations with the other values; empty: no variation.
    place : ModelFault, optional
        Position of the sweep in the campaign file.
    """

    grids: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    random: Mapping[str, Distribution] = field(default_factory=dict)
    samples: int = 0
    seed: int = 0
    methods: tuple[str, ...] = ()
    steps: tuple[float, ...] = ()
    place: ModelFault | None = field(default=None, compare=False)

    @contextmanager
    def reported_at_key(self) -> Iterator[None]:
        """Convert errors of buildings with invalid variations (UsageError) to errors of the
        campaign file (ModelError)."""
        try:
            yield
        except UsageError as error:
            if self.place is None:
                raise
            raise ModelError([replace(self.place, message=str(error))]) from None

    def changes(self) -> list[dict[str, float]]:
        """Return the values of the parameters in each variation; grids are the outermost loops.

        Raises
        ------
        UsageError
            A sampled value is out of range; there are too many variations.
        """
        # Check the number of variations before they are created, because a typing error can lead to
        # millions of them, which do not fit in memory.
        count = math.prod(map(len, self.grids.values())) * max(self.samples, 1)
        if count > _MAX_VARIATIONS:
            raise UsageError(
                f"the sweep has {count} variations of each building; at most "
                f"{_MAX_VARIATIONS} are allowed"
            )
        grid = [
            dict(zip(self.grids, values, strict=True))
            for values in itertools.product(*self.grids.values())
        ]
        if not self.random:
            return grid

        # A Latin hypercube covers the range of each parameter even with few samples.
        from scipy.stats import qmc

        sampler = qmc.LatinHypercube(len(self.random), seed=np.random.default_rng(self.seed))
        probabilities = sampler.random(self.samples)  # shape (samples, parameters)
        columns = [
            distribution.at(probabilities[:, i]).tolist()
            for i, distribution in enumerate(self.random.values())
        ]
        samples = [
            dict(zip(self.random, values, strict=True)) for values in zip(*columns, strict=True)
        ]
        for sample in samples:
            for name, value in sample.items():
                check_value(name, value)
        return [point | sample for point in grid for sample in samples]

    def of(self, models: Sequence[Model]) -> tuple[Model, ...]:
        """Return all variations of models, model by model.

        Raises
        ------
        UsageError
            A varied parameter does not exist, or a value is out of range.
        """
        changes = self.changes()
        return tuple(
            replace(
                model.changed(change),
                analysis=replace(
                    model.analysis,
                    method=method or model.analysis.method,
                    dt=dt or model.analysis.dt,
                ),
                label=self._label(change, number, method, dt),
            )
            for model in models
            for number, change in enumerate(changes, start=1)
            for method in self.methods or (None,)
            for dt in self.steps or (None,)
        )

    def of_rows(self, rows: InventoryRows) -> InventoryRows:
        """Return all variations of the buildings of an inventory. All variations of a building have
        the same random factors and sampled motions.

        Raises
        ------
        UsageError
            A sampled value is out of range; there are too many variations.
        """
        return replace(
            rows,
            changes=[
                (tuple(change.items()), self._label(change, number, None, None))
                for number, change in enumerate(self.changes(), start=1)
            ],
        )

    def _label(
        self, change: Mapping[str, float], number: int, method: str | None, dt: float | None
    ) -> str:
        """Return the label of a variation.

        Parameters
        ----------
        change : mapping of str to float
            Values of the parameters.
        number : int
            Number of the variation, from 1.
        method : str or None
            Method, if varied.
        dt : float or None
            Time step, s, if varied.
        """
        parts: list[Any] = [
            f"{name}={value:.{_LABEL_DIGITS}g}"
            for name, value in change.items()
            if name in self.grids
        ]
        parts += [f"draw {(number - 1) % self.samples + 1}"] if self.random else []
        parts += [method] if method else []
        return ", ".join(parts + ([f"dt={dt:g}"] if dt else []))


_NUMBER = Bounds(ratio=True)
_SAMPLES = (
    Key("samples", Whole(1, 100_000), "number of samples of random parameters (Latin hypercube)"),
    Key("seed", Whole(0, 2**31 - 1), "random seed"),
)
_VALUES_TEXT = "a list of values, or a distribution such as {lognormal: {median: 1, beta: 0.2}}"


def _distribution(value: Value, kind: str, **numbers: float) -> Distribution | None:
    """Return the distribution of a key; None after an error."""
    try:
        return Distribution(kind, *numbers.values())
    except UsageError as error:
        value.fault(str(error))
        return None


_RANDOM = Keys(
    tuple(
        Key(
            kind,
            Keys(
                tuple(Key(name, _NUMBER, needed=True) for name in parameters),
                make=partial(_distribution, kind=kind),
            ),
        )
        for kind, parameters in DISTRIBUTIONS.items()
    ),
    # Exactly one distribution is allowed, so that no other is silently ignored.
    ways=tuple((kind,) for kind in DISTRIBUTIONS),
    what=_VALUES_TEXT,
    make=lambda _, **distributions: next(filter(None, distributions.values())),
)


@dataclass(frozen=True)
class Varied:
    """Parameters with their values or distributions, number of samples and seed."""

    def schema(self) -> Schema:
        """Return the JSON schema. Names of story parameters are those of `Model.replace`."""
        values = {"type": "array", "items": _NUMBER.schema(), "minItems": 1}
        either = {"anyOf": [values, _RANDOM.schema() | {"minProperties": 1, "maxProperties": 1}]}
        named = {name: {"description": meaning, **either} for name, meaning in PARAMETERS.items()}
        pattern = {r"^(stories(\[[0-9]+\])?|story [0-9]+)\..+$": either}
        return {
            "type": "object",
            "properties": named
            | {key.name: {"description": key.meaning, **key.kind.schema()} for key in _SAMPLES},
            "patternProperties": pattern,
            "additionalProperties": False,
        }


def read_sweep(
    vary: Value | None, methods: Value | None, steps: Value | None, *, models: bool
) -> ParameterSweep | None:
    """Return the sweep of a campaign; None without a sweep. Errors are recorded in the document.

    Parameters
    ----------
    vary, methods, steps : Value or None
        Values of the keys `vary`, `methods` and of a list of time steps.
    models : bool
        True if the buildings are model files.
    """
    for value in (methods, steps):
        if value and not models:
            value.fault(
                "lists of methods and time steps require `models`; use a single value with an "
                "inventory"
            )
            return None
    if not (vary or methods or steps):
        return None
    texts = (
        methods.items("a list of methods", "is empty; give at least one method")
        if methods
        else None
    ) or ()
    return replace(
        (_read_vary(vary) if vary else None) or ParameterSweep(),
        place=vary.place if vary else None,
        methods=tuple(
            method.label
            for method in dict.fromkeys(item.parsed(parse_method) for item in texts)
            if method
        ),
        steps=tuple(dict.fromkeys((steps.read() if steps else None) or ())),
    )


def _read_vary(value: Value) -> ParameterSweep | None:
    """Read grids and distributions, samples and seed; None after an error."""
    grids: dict[str, tuple[float, ...]] = {}
    random: dict[str, Distribution] = {}
    names = value.names
    # Names cannot be declared, because they include the stories of the models.
    section = value.section(
        Keys((*_SAMPLES, *(Key(name, ANY) for name in names if name not in ("samples", "seed"))))
    )
    if section is None:
        return None
    for name in names:
        entry = section.get(name)
        if entry is None or name in ("samples", "seed"):
            continue
        # Check the form of the name; the models are not read yet.
        try:
            check_parameter(name)
        except UsageError as error:
            entry.fault(str(error))
            continue
        if entry.is_mapping:
            if distribution := replace(entry, kind=_RANDOM).read():
                random[name] = distribution
        else:
            grids[name] = _values(entry, name)
    # The number of samples and random parameters require each other.
    samples = section.get("samples")
    if random and not samples:
        value.fault("random parameters require `samples`; add the number of samples")
    if samples and not random:
        samples.fault("can only be used with a random parameter; remove it")
    return ParameterSweep(grids, random, section.read("samples") or 0, section.read("seed") or 0)


def _values(entry: Value, name: str) -> tuple[float, ...]:
    """Return the values of a parameter."""
    numbers: dict[float, None] = {}
    # Ignore duplicate values, because they would repeat the same building.
    for item in entry.items(_VALUES_TEXT) or ():
        number = item.number(_NUMBER if name == "damping" else ANY)
        try:
            if not math.isnan(number):
                check_value(name, number)
                numbers[number] = None
        except UsageError as error:
            item.fault(str(error))
    return tuple(numbers)


# ---- Definition


@dataclass(frozen=True)
class ModelFiles:
    """Buildings of model files, by their paths relative to the working directory."""

    files: tuple[str, ...]


@dataclass(frozen=True)
class InventoryFile:
    """Buildings of an inventory, derived by rules.

    Attributes
    ----------
    file : str
        CSV file, or exposure model of OpenQuake.
    rules : str
        Name of the set of rules.
    length : float
        Length unit of the file, m.
    classes : str or None
        CSV file of the classes, for rules that require it.
    as_published : bool
        As for `tdint.model.capacity.CapacityFacts`.
    mapping : str or None
        CSV file with the columns of an inventory for each taxonomy of an exposure model.
    mass_only : bool
        Omit the stiffness-proportional damping.
    stiffness_scatter, damping_scatter : float
        Standard deviations of random factors of stiffness and damping ratio.
    seed : int
        Random seed of the factors.
    """

    file: str
    rules: str
    length: float
    mass_only: bool = False
    stiffness_scatter: float = 0.0
    damping_scatter: float = 0.0
    seed: int = 0
    classes: str | None = None
    as_published: bool = False
    mapping: str | None = None

    @property
    def files(self) -> tuple[str, ...]:
        """Files of the inventory."""
        return tuple(filter(None, (self.file, self.classes, self.mapping)))


@dataclass(frozen=True)
class RecordFiles:
    """Records in files and directories.

    Attributes
    ----------
    files : tuple of str
        Paths.
    choice : RecordChoice
        Selection of components and processing.
    pairs : PairNames or None
        Naming scheme of the two components of a motion; None: components are separate motions.
    """

    files: tuple[str, ...]
    choice: RecordChoice
    pairs: PairNames | None = None


@dataclass(frozen=True)
class SequenceFile:
    """Sequences of events in a CSV file.

    Attributes
    ----------
    file : str
        Path of the file.
    choice : RecordChoice
        Selection of components and processing of the records.
    rest : float or None
        Time between events, s; None: until free vibration has decayed.
    """

    file: str
    choice: RecordChoice
    rest: float | None


@dataclass(frozen=True)
class FieldFile:
    """Ground motion fields: the motion of each event at each site.

    Attributes
    ----------
    file : str
        CSV file of events, sites, records and factors.
    choice : RecordChoice
        Selection of components and processing of the records.
    pairs : bool
        Combine the two horizontal components of a record.
    sites : str or None
        CSV file with the locations of the sites; None: the inventory names the site of each
        building.
    distance : str
        Unit of the distance to the nearest site: a key of `tdint.campaign.motions.COORDINATES`.
    max_distance : float
        Buildings at a larger distance from the nearest site are omitted, m.
    rates : str or None
        CSV file with the annual rates of the events.
    """

    file: str
    choice: RecordChoice
    pairs: bool = False
    sites: str | None = None
    distance: str = "km"
    max_distance: float = MAX_DISTANCE
    rates: str | None = None


@dataclass(frozen=True)
class FactorsFile:
    """Factors of each motion in a CSV file of `tdint scale`."""

    file: str


@dataclass(frozen=True)
class AnalysisWishes:
    """Settings for all buildings; None: the setting of each model.

    Attributes
    ----------
    method : str or None
        Method with its parameters.
    collapse_drift : float or None
        Drift ratio above which a run counts as collapsed.
    p_delta : bool or None
        Include P-delta effects.
    """

    method: str | None = None
    collapse_drift: float | None = None
    p_delta: bool | None = None


@dataclass(frozen=True)
class CampaignFile:
    """Checked campaign file.

    Attributes
    ----------
    name, source : str
        Name of the campaign (by default the name of the file), and path of the file.
    buildings : ModelFiles or InventoryFile
        Buildings.
    records : RecordFiles, SequenceFile, GridFile or FieldFile
        Ground motions.
    intensity : Scales, MeasureLevels or FactorsFile
        Scale factors.
    analysis : AnalysisWishes
        Settings for all buildings.
    settings : RunSettings
        Settings of the runs and of the results to store.
    sweep : ParameterSweep or None
        Variations of every building.
    damage : DamageWishes or None
        Definition of the damage states; None: as in the models.
    outputs : tuple of str or None
        Tables to write; None: all tables.
    style : str
        Style of the figures, as in the file. Runs do not depend on it.
    pair_demand : str or None
        Rule that combines the components of pairs (`tdint.campaign.pairs`); None: the default. Runs
        do not depend on it.
    """

    name: str
    source: str
    buildings: ModelFiles | InventoryFile
    records: RecordFiles | SequenceFile | GridFile | FieldFile
    intensity: Scales | MeasureLevels | FactorsFile
    analysis: AnalysisWishes
    settings: RunSettings
    sweep: ParameterSweep | None = None
    damage: DamageWishes | None = None
    outputs: tuple[str, ...] | None = None
    style: str = ""
    pair_demand: str | None = None
