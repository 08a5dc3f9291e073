"""Kinds of values that options take: numbers in a range, ratios, lists of them, grids, names that complete."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from tdint.errors import UsageError
from tdint.quantities import Grid, parse_grid, parse_ratio
from tdint.units import DriftSize, parse_drift

if TYPE_CHECKING:
    ValueType = click.ParamType[Any]
else:
    ValueType = click.ParamType  # generic for a type checker alone: click before 8.4 knows no brackets


class Number(click.FloatRange):
    """A number in a range; nan and infinity are in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number


class Ratio(Number):
    """A ratio in a range: 0.05 or 5%."""

    name = "ratio"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        try:
            ratio = parse_ratio(value)
        except UsageError as error:
            self.fail(str(error), param, ctx)
        try:
            return super().convert(ratio, param, ctx)
        except click.BadParameter as error:
            if ratio >= 1.0 and "%" not in value:
                self.fail(f"{error.message.rstrip('.')}; did you mean {value}%?", param, ctx)
            raise


class Nonzero(Number):
    """A number other than zero."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if number == 0.0:
            self.fail("must be a number other than zero", param, ctx)
        return number


class ListOf(ValueType):
    """Values of one type with commas between them."""

    def __init__(self, one: ValueType) -> None:
        self.one = one
        self.name = one.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Any, ...]:
        if isinstance(value, tuple):
            return value
        parts = value.split(",") if isinstance(value, str) else [value]
        return tuple(self.one.convert(part.strip() if isinstance(part, str) else part, param, ctx) for part in parts)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Complete what stands after the last comma."""
        head, comma, last = incomplete.rpartition(",")
        items = self.one.shell_complete(ctx, param, last)
        return [CompletionItem(head + comma + item.value, type=item.type, help=item.help) for item in items]


class GridType(ValueType):
    """FIRST:LAST:COUNT, or a single number, within limits."""

    name = "grid"

    def __init__(self, low: float = 0.0, high: float = math.inf) -> None:
        self.low, self.high = low, high

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Grid:
        if isinstance(value, Grid):
            return value
        try:
            grid = parse_grid(value)
        except UsageError as error:
            self.fail(str(error), param, ctx)
        if not self.low <= grid.first <= grid.last <= self.high:
            self.fail(f"{value!r} leaves the range {self.low:g} to {self.high:g}", param, ctx)
        return grid


class DriftSizeType(ValueType):
    """A drift: a ratio, a length with its unit, or a multiple of the yield drift."""

    name = "drift"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> DriftSize:
        return parse_drift(value) if isinstance(value, str) else value


class Name(ValueType):
    """A text, and the names that it completes to; they are asked for only then, and may take a while to load."""

    name = "text"

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self.names = names

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The names that begin so."""
        return [CompletionItem(name) for name in self.names() if name.startswith(incomplete)]


class FileName(ValueType):
    """The name of a file or, if `folder`, of a folder: a text that completes to what is there."""

    name = "file"

    def __init__(self, *, folder: bool = False) -> None:
        self.kind = "dir" if folder else "file"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Leave it to the shell."""
        return [CompletionItem(incomplete, type=self.kind)]
