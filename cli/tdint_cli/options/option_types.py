"""Types of option values: numbers in a range, ratios, lists, grids, units, names with completion,
and files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from tdint.errors import UsageError
from tdint.files import protect_input
from tdint.number_parsing import LARGEST, SMALLEST, number_or_nan, parse_ratio
from tdint.tabular import on_use
from tdint.units import (
    ACCELERATION,
    FORCE,
    LENGTH,
    MASS,
    VELOCITY,
    OutputUnits,
    Units,
    parse_drift,
    parse_output_units,
    parse_units,
)

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from tdint.grids import Grid
    from tdint.ground_motion.horizontals import PairNames

    ValueType = click.ParamType[Any]
else:
    # Generic only for type checkers: click before 8.4 does not support brackets.
    ValueType = click.ParamType


class Number(click.FloatRange):
    """Option type of a finite number in a range.

    Numbers other than 0 must have an absolute value between SMALLEST and LARGEST, so that products
    of values do not overflow or become 0.
    """

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number that a text represents; click reports invalid values as errors."""
        number = super().convert(value, param, ctx) or number_or_nan(str(value))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number; specify a finite number", param, ctx)
        if number != 0.0 and not SMALLEST <= abs(number) <= LARGEST:
            self.fail(
                f"{value}: its absolute value must be between {SMALLEST:g} and {LARGEST:g}",
                param,
                ctx,
            )
        return number


class Ratio(Number):
    """Option type of a ratio in a range, written as a number or in percent: 0.05 or 5%."""

    name = "ratio"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the ratio that a text represents as a number, 0.05 for 5%.

        A number from 1 to 100 that is too large was probably meant in percent, so that the message
        suggests the percent sign.
        """
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


drift_ratio = Ratio(0.0, 1.0, min_open=True)
"""Option type of a drift ratio. A drift above the story height is a percentage without its sign."""


damping_ratio = Ratio(0.0, 1.0, max_open=True)


class Nonzero(Number):
    """Option type of a number other than zero."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number that a text represents; click reports zero as an error."""
        number = super().convert(value, param, ctx)
        if number == 0.0:
            self.fail("must not be zero; specify a positive or a negative number", param, ctx)
        return number

    def _describe_range(self) -> str:
        """Return the range for the help, which click would write as x<=None."""
        return "x!=0"


class Count(click.IntRange):
    """Option type of a number of items: an integer in a range, with the name COUNT in the help."""

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Return the name of the value in the help."""
        return "COUNT"


class ListOf(ValueType):
    """Option type of comma-separated values of the same type.

    An option of the type may be repeated. The command receives a tuple of all values; None if no
    value is specified.

    Parameters
    ----------
    once : bool
        True (the default) to remove duplicate values.
    """

    def __init__(self, member: ValueType, once: bool = True) -> None:
        self.item = member
        self.name = f"{member.name},..."
        self.once = once

    def joined(
        self, _: click.Context, __: click.Parameter, tuples: tuple[tuple[Any, ...], ...]
    ) -> tuple[Any, ...] | None:
        """Join the values of a repeated option (callback of an option of the type), without
        duplicates if the type requests this; None for no value.
        """
        values = list(chain.from_iterable(tuples))
        return tuple(dict.fromkeys(values) if self.once else values) or None

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a tuple of the values between the commas of a text, each converted to its type."""
        if isinstance(value, tuple):
            return value
        parts = self.members(value) if isinstance(value, str) else [value]
        return tuple(self.item.convert(part, param, ctx) for part in parts)

    @staticmethod
    def members(text: str) -> list[str]:
        """Return the texts between the commas of a text, without blanks around them."""
        return [part.strip() for part in text.split(",")]

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the text after the last comma."""
        from click.shell_completion import CompletionItem

        first_values, comma, last_value = incomplete.rpartition(",")
        items = self.item.shell_complete(ctx, param, last_value)
        return [
            CompletionItem(first_values + comma + item.value, type=item.type, help=item.help)
            for item in items
        ]


class OutputUnitsType(ListOf):
    """Option type of comma-separated units of the output, such as kN,mm."""

    def __init__(self) -> None:
        units = (*FORCE, *LENGTH, *MASS, *VELOCITY, *ACCELERATION)
        super().__init__(Written("unit", names=lambda: units))

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> OutputUnits:
        """Return the units that a text names; unknown units raise UsageError."""
        return parse_output_units(value) if isinstance(value, str) else value


class Written(ValueType):
    """Option type of a text, such as a name, or a value with a special notation, such as 0.2:2:50.

    Parameters
    ----------
    name : str
        Name of the value in the help (in capitals).
    read : callable
        Converts the text to the value; raises click.BadParameter or UsageError for an invalid text.
        By default, the text is the value.
    names : callable
        Returns the names that the shell completes. It is called only for completion, because
        loading can be slow. By default there are no names.
    """

    def __init__(
        self,
        name: str,
        read: Callable[[str], Any] = str,
        names: Callable[[], Iterable[str]] = tuple,
    ) -> None:
        self.name = name
        self.read = read
        self.names = names

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the value of a text; a value that is not a text, such as a default, is returned
        unchanged."""
        return self.read(value) if isinstance(value, str) else value

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the names that start with the incomplete text."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(name) for name in self.names() if name.startswith(incomplete)]


def grid(low: float = 0.0, high: float = math.inf) -> Written:
    """Return the option type of a grid FIRST:LAST:COUNT, or of a single number.

    All values must be between `low` and `high`.
    """

    def read(text: str) -> Grid:
        """Return the grid that a text represents; raise BadParameter for values out of range."""
        from tdint.grids import parse_grid

        try:
            values = parse_grid(text)
        except UsageError as error:
            raise click.BadParameter(str(error)) from None
        if not low <= values.first <= values.last <= high:
            raise click.BadParameter(f"{text!r} is outside the range {low:g} to {high:g}")
        return values

    return Written("grid", read)


def span_at(count: int) -> Written:
    """Return the option type of a range FIRST:LAST or FIRST:LAST:COUNT.

    Its value is a grid of logarithmically spaced numbers; without COUNT it has `count` numbers.
    """

    def read(text: str) -> Any:
        """Return the values of a range; raise BadParameter for a single number."""
        if ":" not in text:
            raise click.BadParameter(f"{text!r} must be a range FIRST:LAST, such as 0.2:2")
        return grid().read(f"{text}:{count}" if text.count(":") == 1 else text)

    return Written("FIRST:LAST", read)


def _span(text: str) -> tuple[float, float]:
    """Return the ends of a range LOW:HIGH; an omitted LOW is 0, an omitted HIGH is infinity.
    BadParameter is raised for another form, or if LOW is negative or not less than HIGH.
    """
    try:
        low_text, high_text = (part.strip() for part in text.split(":"))
        low = parse_ratio(low_text) if low_text else 0.0
        high = parse_ratio(high_text) if high_text else math.inf
    except (ValueError, UsageError):
        raise click.BadParameter(f"{text!r} must be LOW:HIGH, such as 0.001:0.1") from None
    if not 0.0 <= low < high:
        raise click.BadParameter(f"{text!r}: LOW must be less than HIGH, and must not be negative")
    return low, high


def _period(text: str) -> float | None:
    """Return a period in s; None for T1, the first period of the building."""
    if text.strip().upper() == "T1":
        return None
    return float(Number(0.0, min_open=True).convert(text, None, None))


class _Periods(Number):
    """Option type of a period in s, or of a grid of periods FIRST:LAST:COUNT."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a number, or a grid for a text with a colon."""
        if isinstance(value, str) and ":" in value:
            return grid().read(value)
        return super().convert(value, param, ctx)


span = Written("LOW:HIGH", _span)
"""LOW:HIGH, two numbers or ratios; an omitted LOW is 0, an omitted HIGH is infinity."""

period = Written("T1|SECONDS", _period)
"""A period in s, or T1 (value None) for the first period of the building."""

drift_size = Written("drift", parse_drift)
"""A drift: a ratio, a length with its unit, or a multiple of the yield drift."""


def _intensity(text: str) -> Units:
    """Return an intensity and its unit; raise BadParameter for a text without such a unit."""
    quantities = ("acceleration", "velocity", "displacement")
    try:
        units = parse_units(text)
    except UsageError:
        units = None
    if units is None or not units.has_factor or units.quantity not in quantities:
        raise click.BadParameter(
            f"{text!r} must be a number with a unit of {' or '.join(quantities)}, such as "
            "0.6g or '5.9 m/s^2'"
        )
    return units


intensity = Written("value", _intensity)
"""A peak value or pseudo-acceleration with its unit, such as 0.6g."""


pair_names = Written("names", on_use("tdint.ground_motion.horizontals").PairNames.parse)
"""Patterns for the file names of a pair: two names with {}, such as {}_N.AT2,{}_E.AT2."""


def pairs_of(measures: Sequence[str]) -> Written:
    """Return the option type of pairs of components: a measure, patterns of file names, or both.

    Its value is a `PairWish`. Two patterns such as {}_N.AT2,{}_E.AT2 identify the files of a pair.
    Without patterns, the usual names of components identify the pairs. `measures` are the allowed
    measures of a pair, such as rotd100.
    """

    def read(text: str) -> PairWish:
        """Return the measure and the patterns; raise BadParameter for several measures."""
        from tdint.ground_motion.horizontals import USUAL, PairNames

        # Patterns of file names contain {}; the other part, if any, is the measure.
        parts = text.split(",")
        named = [part for part in parts if "{}" not in part]
        patterns = [part for part in parts if "{}" in part]
        if len(named) > 1:
            raise click.BadParameter(
                f"{text!r} must be one of {', '.join(measures)}, two names with {{}}, or both"
            )
        measure = str(click.Choice(measures).convert(named[0], None, None)) if named else None
        names = PairNames.parse(",".join(patterns)) if patterns else USUAL
        return PairWish(measure, names)

    return Written(PAIRS, read, lambda: measures)


PAIRS = "pairs"
"""Name of the option type of pairs of components."""


class PairWish(NamedTuple):
    """Requested treatment of pairs of components.

    Attributes
    ----------
    measure : str | None
        Measure of a pair, such as rotd100; None if no measure is specified.
    """

    measure: str | None
    names: PairNames


def argument_name(parameter: click.Parameter) -> str:
    """Return the first word of the metavar of a parameter without brackets and dots: RECORD."""
    return (parameter.metavar or "").partition(" ")[0].strip("[].")


class FileName(ValueType):
    """Option type of a file name, with completion by the shell.

    Parameters
    ----------
    written : bool
        True for an output. By default the file is an input, which the command never replaces.
    check : callable, optional
        (name, parameter) -> value of the option. Raises UsageError for a name that the option does
        not accept.
    """

    name = "file"

    def __init__(
        self,
        *,
        written: bool = False,
        check: Callable[[str, Any], str | None] | None = None,
    ) -> None:
        self.written = written
        self.check = check

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path of the file, or the value that `check` returns.

        An input file is protected, so that no output of the command replaces it. UsageError is
        raised for an empty name, which is usually an unset shell variable.
        """
        if value == "" and param is not None:
            name = param.opts[0] if isinstance(param, click.Option) else argument_name(param)
            remedy = "" if param.required else ", or omit it"
            raise UsageError(f"{name} must not be empty; specify a name{remedy}")
        if not self.written:
            protect_input(value)
        return self.check(value, param) if self.check else value

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return an item that requests completion of paths by the shell."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="dir" if param.metavar == "DIR" else "file")]


BESIDE = "\0"
"""Value of --plot or --history without a file name, for a default name next to the table. It is a
null character, which no file name can contain."""


_NAMED_TYPES: dict[str, Any] = {
    "count": Count(1),
    "damping": damping_ratio,
    "drift": drift_size,
    "drift ratio": drift_ratio,
    "file": FileName(),
    "fraction": Ratio(0.0, 1.0, min_open=True, max_open=True),
    "intensity": intensity,
    "name": Written("name"),
    "new file": FileName(written=True),
    "nonzero": Nonzero(),
    "number": float,
    "pair names": pair_names,
    "period": period,
    "periods": _Periods(0.0),
    "periods except 0": _Periods(0.0, min_open=True),
    "positive": Number(0.0, min_open=True),
    "ratio": Ratio(0.0),
    "span": span,
    "text": click.STRING,
    "threads": click.IntRange(1, 1024),
    "units": OutputUnitsType(),
}


def named_type(name: str) -> Any:
    """Return the option type with a name in `options.csv`. `NAME,...` is a list of values of a
    type, and `a|b|c` is one of these words."""
    if name.endswith(",..."):
        return ListOf(named_type(name.removesuffix(",...")))
    return click.Choice(name.split("|")) if "|" in name else _NAMED_TYPES[name]
