"""Kinds of values that options take: numbers in a range, ratios, lists of them, grids, names that complete."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from tdint.errors import UsageError
from tdint.output_units import OutputUnits, parse_output_units
from tdint.units import ACCELERATION, FORCE, LENGTH, MASS, Units, parse_drift, parse_units
from tdint.written_numbers import LARGEST, SMALLEST, Grid, parse_grid, parse_ratio

if TYPE_CHECKING:
    from tdint.ground_motion.pairing import PairNames

    ValueType = click.ParamType[Any]
else:
    ValueType = click.ParamType  # generic for a type checker alone: click before 8.4 knows no brackets


class Number(click.FloatRange):
    """A number in a range; nan, infinity and what cannot be computed with are in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        if number != 0.0 and not SMALLEST <= abs(number) <= LARGEST:
            self.fail(f"{value}: its size must lie between {SMALLEST:g} and {LARGEST:g}", param, ctx)
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
            if 1.0 <= ratio < 100.0 and "%" not in value:
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


class OutputUnitsType(ValueType):
    """Units of the output, with commas between them."""

    name = "units"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> OutputUnits:
        return parse_output_units(value) if isinstance(value, str) else value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Complete what stands after the last comma."""
        head, comma, last = incomplete.rpartition(",")
        names = (*FORCE, *LENGTH, *MASS, *ACCELERATION)
        return [CompletionItem(f"{head}{comma}{name}") for name in names if name.startswith(last)]


class Written(ValueType):
    """What people write in a form of its own, such as 0.2:2:50, as `read` understands it.

    Parameters
    ----------
    name : str
        What it is.
    read : callable
        Gives the value of a text; click.BadParameter, or UsageError, for one that is none.
    """

    def __init__(self, name: str, read: Callable[[str], Any]) -> None:
        self.name = name
        self.read = read

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return self.read(value) if isinstance(value, str) else value


def grid(low: float = 0.0, high: float = math.inf) -> Written:
    """FIRST:LAST:COUNT, or a single number, within limits."""

    def read(text: str) -> Grid:
        try:
            found = parse_grid(text)
        except UsageError as error:
            raise click.BadParameter(str(error)) from None
        if not low <= found.first <= found.last <= high:
            raise click.BadParameter(f"{text!r} leaves the range {low:g} to {high:g}")
        return found

    return Written("grid", read)


def span_at(count: int) -> Written:
    """FIRST:LAST, at so many numbers in equal ratios, or FIRST:LAST:COUNT."""

    def read(text: str) -> Any:
        if ":" not in text:
            raise click.BadParameter(f"{text!r} is no range; write FIRST:LAST, such as 0.2:2")
        return grid().read(f"{text}:{count}" if text.count(":") == 1 else text)

    return Written("range", read)


def _span(text: str) -> tuple[float, float]:
    try:
        low, high = (part.strip() for part in text.split(":"))
        both = (parse_ratio(low) if low else 0.0, parse_ratio(high) if high else math.inf)
    except (ValueError, UsageError):
        raise click.BadParameter(f"{text!r} is not LOW:HIGH, such as 0.001:0.1") from None
    if not 0.0 <= both[0] < both[1]:
        raise click.BadParameter(f"{text!r}: LOW must be below HIGH, and not negative")
    return both


def _period(text: str) -> float | None:
    if text.strip().upper() == "T1":
        return None
    return float(Number(0.0, min_open=True).convert(text, None, None))


span = Written("span", _span)
"""LOW:HIGH, two numbers or ratios; without one of them 0 or infinity."""

period = Written("period", _period)
"""A period in s, or T1 for None: the first one of the building."""

drift_size = Written("drift", parse_drift)
"""A drift: a ratio, a length with its unit, or a multiple of the yield drift."""


def intensity(*quantities: str) -> Written:
    """A peak or a pseudo-acceleration with its unit: 0.6g, '5.9 m/s^2', 40cm/s."""
    example = "40cm/s" if quantities == ("velocity",) else "0.6g or '5.9 m/s^2'"

    def read(text: str) -> Units:
        try:
            units = parse_units(text)
        except UsageError:
            units = None
        if units is None or not units.has_factor or units.quantity not in quantities:
            raise click.BadParameter(f"{text!r}: write a number with its unit, such as {example}")
        return units

    return Written("intensity", read)


def _pair_names(text: str) -> PairNames:
    from tdint.ground_motion.pairing import PairNames

    return PairNames.parse(text)


pair_names = Written("names", _pair_names)
"""How the files of a pair are named: two names with {}."""


class PairsType(ValueType):
    """What stands for a pair of components, how their files are named ({}_N.AT2,{}_E.AT2), or both."""

    name = "pairs"

    def __init__(self, measures: Sequence[str]) -> None:
        self.measures = click.Choice(measures)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from tdint.ground_motion.pairing import USUAL, PairNames

        if not isinstance(value, str):
            return value
        measures = [part for part in value.split(",") if "{}" not in part]
        if len(measures) > 1:
            self.fail(f"{value!r}: one of {', '.join(self.measures.choices)}, and two names with {{}}", param, ctx)
        measure = str(self.measures.convert(measures[0], param, ctx)) if measures else None
        names = PairNames.parse(",".join(part for part in value.split(",") if "{}" in part)) if "{}" in value else USUAL
        return PairWish(measure, names)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Complete what stands for a pair."""
        return self.measures.shell_complete(ctx, param, incomplete)


@dataclass(frozen=True)
class PairWish:
    """What stands for a pair of components, None where nobody said, and how their files are named."""

    measure: str | None
    names: PairNames


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
