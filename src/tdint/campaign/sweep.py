"""Sweeps: each building of a campaign varied over grids and samples of its parameters, methods and steps, as the key
`vary` of a campaign file and the lists under `analysis` say.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.errors import UsageError
from tdint.methods.catalogue import parse as parse_method
from tdint.model.definition import PARAMETERS, Model, check_parameter, check_value
from tdint.model.keys.fields import Value
from tdint.model.keys.kinds import ANY, POSITIVE, Bounds, Key, Keys, Schema, Whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tdint.model.inventory.table import InventoryRow


_MOST = 1_000_000
_SHOWN = 6

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
        return np.asarray(self.first * np.exp(deviations) if self.kind == "lognormal" else self.first + deviations)


@dataclass(frozen=True)
class ParameterSweep:
    """What is varied in every building of a campaign.

    Attributes
    ----------
    grids : mapping of str to tuple of float
        Values of parameters (`tdint.model.definition.PARAMETERS`): all combinations.
    random : mapping of str to Distribution
        Random ones, drawn together by a Latin hypercube (McKay, Beckman and Conover 1979), independent of each other.
    samples, seed : int
        Draws, the same in each combination of the others, and what they are drawn from.
    methods : tuple of str
        Methods with their parameters, each with all the rest; none: as without a sweep.
    steps : tuple of float
        Time steps, s, likewise.
    """

    grids: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    random: Mapping[str, Distribution] = field(default_factory=dict)
    samples: int = 0
    seed: int = 0
    methods: tuple[str, ...] = ()
    steps: tuple[float, ...] = ()

    def changes(self) -> list[dict[str, float]]:
        """The values of the parameters in each variation, grids outermost.

        Raises
        ------
        UsageError
            A drawn value is out of range; too many variations.
        """
        count = math.prod(map(len, self.grids.values())) * max(self.samples, 1)
        if count > _MOST:
            raise UsageError(f"the sweep has {count} variations of each building; {_MOST} are the most")
        grid = [dict(zip(self.grids, values, strict=True)) for values in itertools.product(*self.grids.values())]
        return [one | draw for one in grid for draw in self._draws()]

    def _draws(self) -> list[dict[str, float]]:
        if not self.random:
            return [{}]
        from scipy.stats import qmc

        parts = qmc.LatinHypercube(len(self.random), seed=np.random.default_rng(self.seed)).random(self.samples)
        columns = [one.at(parts[:, i]).tolist() for i, one in enumerate(self.random.values())]
        draws = [dict(zip(self.random, values, strict=True)) for values in zip(*columns, strict=True)]
        for draw in draws:
            for name, value in draw.items():
                check_value(name, value)
        return draws

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
                analysis=replace(model.analysis, method=method or model.analysis.method, dt=dt or model.analysis.dt),
                label=self._label(change, number, method, dt),
            )
            for model in models
            for number, change in enumerate(changes, start=1)
            for method in self.methods or (None,)
            for dt in self.steps or (None,)
        )

    def of_rows(self, rows: Sequence[InventoryRow]) -> tuple[InventoryRow, ...]:
        """All variations of the buildings of an inventory: scatter and drawn motions of one are those of the others.

        Raises
        ------
        UsageError
            A drawn value is out of range; too many variations.
        """
        changes = [(tuple(one.items()), self._label(one, i, None, None)) for i, one in enumerate(self.changes(), 1)]
        return tuple(replace(row, changes=change, label=label) for row in rows for change, label in changes)

    def _label(self, change: Mapping[str, float], number: int, method: str | None, dt: float | None) -> str:
        """What tells a variation from the others of its building."""
        parts: list[Any] = [f"{name}={value:.{_SHOWN}g}" for name, value in change.items() if name in self.grids]
        parts += [f"draw {(number - 1) % self.samples + 1}"] if self.random else []
        parts += [method] if method else []
        return ", ".join(parts + ([f"dt={dt:g}"] if dt else []))


_NUMBER = Bounds(ratio=True)
_DRAWS, _SEED = Whole(1, 100_000), Whole(0, 2**31 - 1)
_SAMPLES = (
    Key("samples", _DRAWS, "draws of the random parameters, by a Latin hypercube"),
    Key("seed", _SEED, "what they are drawn from"),
)
_RANDOM = {
    kind: Keys(tuple(Key(name, _NUMBER, needed=True) for name in numbers)) for kind, numbers in DISTRIBUTIONS.items()
}
_WHAT = "a list of values, or a distribution such as {lognormal: {median: 1, beta: 0.2}}"


@dataclass(frozen=True)
class Varied:
    """Parameters with their values or distributions, samples and a seed."""

    def schema(self) -> Schema:
        """The JSON schema; a story's own factor has its number in its name."""
        values = {"type": "array", "items": _NUMBER.schema(), "minItems": 1}
        random = {"type": "object", "properties": {kind: keys.schema() for kind, keys in _RANDOM.items()}}
        either = {"anyOf": [values, random | {"additionalProperties": False, "minProperties": 1, "maxProperties": 1}]}
        named = {name: {"description": meaning, **either} for name, meaning in PARAMETERS.items()}
        pattern = {r"^story [0-9]+\.(mass|stiffness|strength)_factor$": either}
        return {
            "type": "object",
            "properties": named | {key.name: {"description": key.meaning, **key.kind.schema()} for key in _SAMPLES},
            "patternProperties": pattern,
            "additionalProperties": False,
        }


def positive(value: Value) -> float | None:
    """A positive number; None after a fault."""
    number = value.number(POSITIVE)
    return None if math.isnan(number) else number


def read_sweep(vary: Value | None, analysis: Value | None, *, models: bool) -> ParameterSweep | None:
    """The sweep of a campaign; None without any. Faults are noted.

    Parameters
    ----------
    vary, analysis : Value or None
        The values of these keys.
    models : bool
        Whether the buildings are model files.
    """
    methods, dt = (analysis.peek(name) if analysis else None for name in ("methods", "dt"))
    steps = dt if dt and dt.is_list else None
    for value in (methods, steps):
        if value and not models:
            value.fault("lists of methods and steps are of `models`; an inventory has one of each")
            return None
    if not (vary or methods or steps):
        return None
    texts = (methods.items("a list of methods", "is empty; give at least one method") if methods else None) or ()
    numbers = (steps.items("a list of steps", "is empty; give at least one step") if steps else None) or ()
    return replace(
        (_read_vary(vary) if vary else None) or ParameterSweep(),
        methods=tuple(dict.fromkeys(found.label for item in texts if (found := item.parsed(parse_method)))),
        steps=tuple(dict.fromkeys(number for item in numbers if (number := positive(item)))),
    )


def _read_vary(value: Value) -> ParameterSweep | None:
    """Grids and distributions, samples and seed; None after a fault."""
    grids: dict[str, tuple[float, ...]] = {}
    random: dict[str, Distribution] = {}
    names = value.names
    section = value.section([key.name for key in _SAMPLES] + names)
    if section is None:
        return None
    for name in names:
        entry = section.get(name)
        if entry is None or name in ("samples", "seed"):
            continue
        try:
            check_parameter(name)
        except UsageError as error:
            entry.fault(str(error))
            continue
        if entry.is_mapping:
            if found := _distribution(entry):
                random[name] = found
        else:
            grids[name] = _values(entry, name)
    counted, seeded = section.get("samples"), section.get("seed")
    samples = counted.whole(_DRAWS.low, _DRAWS.high) if counted else None
    seed = seeded.whole(_SEED.low, _SEED.high) if seeded else 0
    if random and not counted:
        value.fault("random parameters need `samples`: how many are drawn")
    if counted and not random:
        counted.fault("has nothing to act on without a random parameter")
    return ParameterSweep(grids, random, samples or 0, seed or 0)


def _values(entry: Value, name: str) -> tuple[float, ...]:
    found: dict[float, None] = {}
    for item in entry.items(_WHAT) or ():
        number = item.number(_NUMBER if name == "damping" else ANY)
        try:
            if not math.isnan(number):
                check_value(name, number)
                found[number] = None
        except UsageError as error:
            item.fault(str(error))
    return tuple(found)


def _distribution(entry: Value) -> Distribution | None:
    section = entry.section(list(DISTRIBUTIONS))
    kinds = [kind for kind in DISTRIBUTIONS if section and section.has(kind)]
    if section is None or len(kinds) != 1:
        if section is not None:
            entry.fault(f"must be {_WHAT}")
        return None
    inner = section.get(kinds[0])
    names = DISTRIBUTIONS[kinds[0]]
    numbers = inner.section(names) if inner else None
    if numbers is None or inner is None:
        return None
    first, second = (numbers.number(name, _NUMBER) for name in names)
    if math.isnan(first) or math.isnan(second):
        return None
    try:
        return Distribution(kinds[0], first, second)
    except UsageError as error:
        inner.fault(str(error))
        return None
