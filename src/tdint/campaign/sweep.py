"""Sweeps: each building of a campaign varied over grids and samples of its parameters, methods and steps."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.errors import UsageError
from tdint.model.definition import Model
from tdint.model.variation import check_value, varied

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
        Values of parameters (`tdint.model.variation.PARAMETERS`): all combinations.
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
                varied(model, change),
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
