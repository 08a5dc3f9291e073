"""Kinds of values that options take: numbers in a range, lists of them, grids."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    ValueType = click.ParamType[Any]
else:
    ValueType = click.ParamType  # generic for a type checker alone: click before 8.4 knows no brackets

_MOST_POINTS = 100_000


@dataclass(frozen=True)
class Grid:
    """Numbers in equal ratios, both ends included; a single one if `count` is 1."""

    first: float
    last: float
    count: int

    def __str__(self) -> str:
        return f"{self.first:g}:{self.last:g}:{self.count}"

    def values(self) -> NDArray[np.float64]:
        """The numbers, shape (count,)."""
        import numpy as np

        result = np.geomspace(self.first, self.last, self.count)
        result[0], result[-1] = self.first, self.last
        return result


class GridType(ValueType):
    """FIRST:LAST:COUNT, or a single number, within limits."""

    name = "grid"

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = low, high

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Grid:
        if isinstance(value, Grid):
            return value
        first, *more = value.split(":")
        try:
            last, count = more or (first, 1)
            grid = Grid(float(first), float(last), int(count))
        except ValueError:
            self.fail(f"{value!r} is neither FIRST:LAST:COUNT nor a number", param, ctx)
        if more and not (grid.first < grid.last and 2 <= grid.count <= _MOST_POINTS):
            self.fail(f"{value!r}: FIRST must be below LAST, COUNT between 2 and {_MOST_POINTS}", param, ctx)
        if not self.low <= grid.first <= grid.last <= self.high:
            self.fail(f"{value!r} leaves the range {self.low:g} to {self.high:g}", param, ctx)
        return grid


class Number(click.FloatRange):
    """A number in a range; nan and infinity are in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number


class Part(ValueType):
    """A part of a whole between 0 and 1, both left out: 0.01 or 1%."""

    name = "part"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, float):
            return value
        text = value.strip()
        try:
            part = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
        except ValueError:
            self.fail(f"{value!r} is neither a part such as 0.01 nor a percentage such as 1%", param, ctx)
        if not 0.0 < part < 1.0:
            self.fail(f"{value!r} is not between 0 and 1 (100%)", param, ctx)
        return part


class Numbers(ValueType):
    """Numbers of one type, with commas between them, none of them twice."""

    name = "numbers"

    def __init__(self, number: ValueType) -> None:
        self.number = number

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Any, ...]:
        if isinstance(value, tuple):
            return value
        numbers = tuple(self.number.convert(part, param, ctx) for part in value.split(","))
        if len(set(numbers)) < len(numbers):
            self.fail(f"{value!r} has a number twice", param, ctx)
        return numbers
