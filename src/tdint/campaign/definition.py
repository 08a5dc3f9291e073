"""What a campaign file says, as typed values in SI units; nothing here reads the files that it
names."""

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


# ---- Sweeps: each building of a campaign varied over grids and samples of its parameters, methods
# and steps, as the key `vary` of a campaign file and the lists under `analysis` say

_MOST = 1_000_000  # variations of a building: they are held in memory
_SHOWN = 6  # digits in a label

DISTRIBUTIONS: Mapping[str, tuple[str, str]] = {
    "lognormal": ("median", "beta"),
    "normal": ("mean", "sd"),
    "uniform": ("low", "high"),
}
"""The kinds of random parameters, and the two numbers of each."""


@dataclass(frozen=True)
class Distribution:
    """Of a random parameter: one of `DISTRIBUTIONS` with its two numbers."""

    kind: str
    first: float
    second: float

    def __post_init__(self) -> None:
        """Raise UsageError for numbers that are none of such a distribution."""
        first, second = DISTRIBUTIONS[self.kind]
        if self.kind == "uniform" and not self.first < self.second:
            raise UsageError(f"uniform: {first} must be less than {second}")
        if self.kind != "uniform" and not self.second > 0.0:
            raise UsageError(f"{self.kind}: {second} must be positive")
        if self.kind == "lognormal" and not self.first > 0.0:
            raise UsageError(f"lognormal: {first} must be positive")

    def at(self, part: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values that parts (0 to 1) of all lie below."""
        from scipy.special import ndtri

        if self.kind == "uniform":
            return self.first + part * (self.second - self.first)
        deviations = self.second * ndtri(part)
        return np.asarray(
            self.first * np.exp(deviations) if self.kind == "lognormal" else self.first + deviations
        )


@dataclass(frozen=True)
class ParameterSweep:
    """What is varied in every building of a campaign.

    Attributes
    ----------
    grids : mapping of str to tuple of float
        Values of parameters (`tdint.model.definition.PARAMETERS`): all combinations.
    random : mapping of str to Distribution
        Random ones, drawn together by a Latin hypercube (McKay, Beckman and Conover 1979),
        independent of each other.
    samples, seed : int
        Draws, the same in each combination of the others, and what they are drawn from.
    methods : tuple of str
        Methods with their parameters, each with all the rest; none: as without a sweep.
    steps : tuple of float
        Time steps, s, likewise.
    place : ModelFault, optional
        Where a campaign file says it.
    """

    grids: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    random: Mapping[str, Distribution] = field(default_factory=dict)
    samples: int = 0
    seed: int = 0
    methods: tuple[str, ...] = ()
    steps: tuple[float, ...] = ()
    place: ModelFault | None = field(default=None, compare=False)

    @contextmanager
    def told_at_its_place(self) -> Iterator[None]:
        """What a variation cannot be, which its building tells (UsageError), is a fault of the file
        (ModelError)."""
        try:
            yield
        except UsageError as error:
            if self.place is None:
                raise
            raise ModelError([replace(self.place, message=str(error))]) from None

    def changes(self) -> list[dict[str, float]]:
        """The values of the parameters in each variation, grids outermost.

        Raises
        ------
        UsageError
            A drawn value is out of range; too many variations.
        """
        # Refused before any of them is made: a typing error in a grid can mean millions.
        count = math.prod(map(len, self.grids.values())) * max(self.samples, 1)
        if count > _MOST:
            raise UsageError(
                f"the sweep has {count} variations of each building; {_MOST} are the most"
            )
        grid = [
            dict(zip(self.grids, values, strict=True))
            for values in itertools.product(*self.grids.values())
        ]
        if not self.random:
            return grid

        # Draws of a Latin hypercube: each parameter's range is covered, however few there are.
        from scipy.stats import qmc

        parts = qmc.LatinHypercube(len(self.random), seed=np.random.default_rng(self.seed)).random(
            self.samples
        )
        columns = [
            distribution.at(parts[:, i]).tolist()
            for i, distribution in enumerate(self.random.values())
        ]
        draws = [
            dict(zip(self.random, values, strict=True)) for values in zip(*columns, strict=True)
        ]
        for draw in draws:
            for name, value in draw.items():
                check_value(name, value)
        return [point | draw for point in grid for draw in draws]

    def of(self, models: Sequence[Model]) -> tuple[Model, ...]:
        """All variations of some models, those of one after those of the other.

        Raises
        ------
        UsageError
            What is varied is not there, or goes out of range.
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
        """All variations of the buildings of an inventory: scatter and drawn motions of one are
        those of the others.

        Raises
        ------
        UsageError
            A drawn value is out of range; too many variations.
        """
        draws = enumerate(self.changes(), start=1)
        return replace(
            rows,
            changes=[(tuple(draw.items()), self._label(draw, i, None, None)) for i, draw in draws],
        )

    def _label(
        self, change: Mapping[str, float], number: int, method: str | None, dt: float | None
    ) -> str:
        """What tells a variation from the others of its building."""
        parts: list[Any] = [
            f"{name}={value:.{_SHOWN}g}" for name, value in change.items() if name in self.grids
        ]
        parts += [f"draw {(number - 1) % self.samples + 1}"] if self.random else []
        parts += [method] if method else []
        return ", ".join(parts + ([f"dt={dt:g}"] if dt else []))


_NUMBER = Bounds(ratio=True)
_SAMPLES = (
    Key("samples", Whole(1, 100_000), "draws of the random parameters, by a Latin hypercube"),
    Key("seed", Whole(0, 2**31 - 1), "what they are drawn from"),
)
_WHAT = "a list of values, or a distribution such as {lognormal: {median: 1, beta: 0.2}}"


def _distribution(value: Value, kind: str, **numbers: float) -> Distribution | None:
    """What its numbers may be together the distribution knows itself."""
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
                tuple(Key(name, _NUMBER, needed=True) for name in two),
                make=partial(_distribution, kind=kind),
            ),
        )
        for kind, two in DISTRIBUTIONS.items()
    ),
    # Exactly one kind, so that none is silently taken before another.
    ways=tuple((kind,) for kind in DISTRIBUTIONS),
    what=_WHAT,
    make=lambda _, **kinds: next(filter(None, kinds.values())),
)


@dataclass(frozen=True)
class Varied:
    """Parameters with their values or distributions, samples and a seed."""

    def schema(self) -> Schema:
        """The JSON schema; numbers of stories are named as `Model.replace` has them."""
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
    """The sweep of a campaign; None without any. Faults are noted.

    Parameters
    ----------
    vary, methods, steps : Value or None
        The values of these keys, lists of methods and time steps.
    models : bool
        Whether the buildings are model files.
    """
    for value in (methods, steps):
        if value and not models:
            value.fault("lists of methods and steps are of `models`; an inventory has one of each")
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
    """Grids and distributions, samples and seed; None after a fault."""
    grids: dict[str, tuple[float, ...]] = {}
    random: dict[str, Distribution] = {}
    names = value.names
    # Names are not declared: any number of a model's stories may be one.
    section = value.section(
        Keys((*_SAMPLES, *(Key(name, ANY) for name in names if name not in ("samples", "seed"))))
    )
    if section is None:
        return None
    for name in names:
        entry = section.get(name)
        if entry is None or name in ("samples", "seed"):
            continue
        # That a name cannot be a parameter shows without the models, which are not read yet.
        try:
            check_parameter(name)
        except UsageError as error:
            entry.fault(str(error))
            continue
        if entry.is_mapping:
            if drawn := replace(entry, kind=_RANDOM).read():
                random[name] = drawn
        else:
            grids[name] = _values(entry, name)
    # Samples without something random, or the other way round, are an oversight.
    counted = section.get("samples")
    if random and not counted:
        value.fault("random parameters need `samples`: how many are drawn")
    if counted and not random:
        counted.fault("has nothing to act on without a random parameter")
    return ParameterSweep(grids, random, section.read("samples") or 0, section.read("seed") or 0)


def _values(entry: Value, name: str) -> tuple[float, ...]:
    numbers: dict[float, None] = {}
    # A value twice would be the same building twice: it counts once.
    for item in entry.items(_WHAT) or ():
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
    """Buildings of model files, by their paths as seen from the working directory."""

    files: tuple[str, ...]


@dataclass(frozen=True)
class InventoryFile:
    """Buildings of an inventory by rules.

    Attributes
    ----------
    file : str
        The CSV file.
    rules : str
        The set of rules.
    length : float
        The unit of the file's lengths, m.
    classes : str or None
        The CSV file of the classes, for rules that have some.
    as_published : bool
        As of `tdint.model.capacity.CapacityFacts`.
    mass_only : bool
        Leave out the stiffness-proportional damping.
    stiffness_scatter, damping_scatter : float
        Standard deviations of factors on stiffness and damping ratio.
    seed : int
        What the factors are drawn from.
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

    @property
    def files(self) -> tuple[str, ...]:
        """What is read of it."""
        return (self.file, *([self.classes] if self.classes else []))


@dataclass(frozen=True)
class RecordFiles:
    """Records by files and folders; `pairs`: how the two horizontals of each motion are named that
    are taken together."""

    files: tuple[str, ...]
    choice: RecordChoice
    pairs: PairNames | None = None


@dataclass(frozen=True)
class SequenceFile:
    """Shocks one after the other, by a CSV file of their records; `rest` seconds between them,
    None: until the building is at rest."""

    file: str
    choice: RecordChoice
    rest: float | None


@dataclass(frozen=True)
class FieldFile:
    """Ground motion fields: what each event does at each site.

    Attributes
    ----------
    file : str
        The CSV file of events, sites, records and factors.
    choice : RecordChoice
        How the records are read.
    pairs : bool
        Take the two horizontals of a record together.
    sites : str or None
        The CSV file of the sites' places; None: the inventory names the site of each building.
    distance : str
        As of `tdint.campaign.motions.COORDINATES`: by which the nearest site is found.
    max_distance : float
        Buildings whose nearest site is farther away are left out, m.
    rates : str or None
        The CSV file of the events' yearly rates.
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
    """Factors of each motion from a CSV file, as `tdint scale` writes it."""

    file: str


@dataclass(frozen=True)
class AnalysisWishes:
    """What is the same for all buildings; None leaves it to each model.

    Attributes
    ----------
    method : str or None
        Method with its parameters.
    collapse_drift : float or None
        Drift ratio over which a run is flagged as collapsed.
    p_delta : bool or None
        Whether gravity acts on the displaced buildings.
    """

    method: str | None = None
    collapse_drift: float | None = None
    p_delta: bool | None = None


@dataclass(frozen=True)
class CampaignFile:
    """A campaign file, checked.

    Attributes
    ----------
    name, source : str
        The campaign's name (the file's, where it gives none), and the file as the user named it.
    settings : RunSettings
        How all runs are integrated, and what is kept of them.
    sweep : ParameterSweep or None
        What is varied in every building.
    damage : DamageWishes or None
        How damage is told; None: as the models say.
    outputs : tuple of str or None
        The tables that are written; None: all that there are.
    style : str
        Looks of the pictures, as they are written; the runs do not depend on it.
    pair_demand : str or None
        How the components of pairs count (`tdint.campaign.pairs`); None: the default. The runs do
        not depend on it.
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
