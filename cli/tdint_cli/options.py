"""Options that several commands share, each declared once."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click

from tdint.errors import UsageError
from tdint_cli.errors import Settings

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Command = TypeVar("Command", bound=Callable[..., Any])

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


class GridType(click.ParamType):
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


class Part(click.ParamType):
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


class Numbers(click.ParamType):
    """Numbers of one type, with commas between them, none of them twice."""

    name = "numbers"

    def __init__(self, number: click.ParamType) -> None:
        self.number = number

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Any, ...]:
        if isinstance(value, tuple):
            return value
        numbers = tuple(self.number.convert(part, param, ctx) for part in value.split(","))
        if len(set(numbers)) < len(numbers):
            self.fail(f"{value!r} has a number twice", param, ctx)
        return numbers


damping_ratio = Number(0.0, 1.0, max_open=True)

DT_OVER_T = (1e-6, 1e6)
"""Steps over the period of an oscillator that may be asked for: beyond, rounding is all that is seen."""


def _set_debug(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        ctx.ensure_object(Settings).debug = True


debug = click.option(
    "--debug",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_set_debug,
    help="Show a traceback with an error.",
)
record = click.option(
    "--record",
    metavar="FILE",
    help="Ground motion in place of the model's; the model's units, component, scale and inventory do not apply to it.",
)
units = click.option(
    "--units",
    metavar="UNITS",
    help="Units of the record's samples: m/s^2, cm/s^2, gal, mm/s^2 or g; with a factor the value of one count "
    "('2.38e-6 m/s^2').",
)
component = click.option(
    "--component",
    metavar="NAME",
    help="Component of the record: its channel code (HNE), full id, or the code's last letter (E).",
)
inventory = click.option(
    "--inventory",
    metavar="FILE",
    help="StationXML file by which the instrument's response is removed; not with --units.",
)
_PROCESSING = (
    click.option(
        "--trim",
        metavar="START:END",
        help="Keep this part of the record, seconds from its first sample; an end may be left out.",
    ),
    click.option(
        "--baseline",
        type=click.Choice(["constant", "linear"]),
        help="Remove the mean, or the least-squares line, of the acceleration.",
    ),
    click.option(
        "--pad",
        metavar="SECONDS|BEFORE:AFTER",
        help="Add zeros before and after the record.",
    ),
    click.option(
        "--highpass",
        type=Number(0.0, min_open=True),
        metavar="HZ",
        help="Butterworth filter without shift of phase (forwards and backwards: half the amplitude at the corner).",
    ),
    click.option("--lowpass", type=Number(0.0, min_open=True), metavar="HZ", help="The same from the other side."),
    click.option("--corners", type=click.IntRange(1, 10), metavar="N", help="Order of the filters; 4 by default."),
    click.option(
        "--resample",
        type=Number(0.0, min_open=True),
        metavar="DT",
        help="Change the sampling interval, s: band-limited, with a filter against aliasing if it becomes longer.",
    ),
)


def processing(command: Command) -> Command:
    """The options that change a record; the command gets them together, as `processing`.

    The steps are taken in the order of the options, whatever that of the command line.
    """

    @functools.wraps(command)
    def collected(**given: Any) -> Any:
        from tdint.ground_motion.processing import Processing, parse_pad, parse_trim

        chosen = {field.name: given.pop(field.name) for field in dataclasses.fields(Processing)}
        for name, parse in (("trim", parse_trim), ("pad", parse_pad)):
            if chosen[name] is not None:
                chosen[name] = parse(chosen[name])
        return command(**given, processing=Processing(**chosen))

    decorated: Any = collected
    for option in reversed(_PROCESSING):
        decorated = option(decorated)
    return cast(Command, decorated)


scale = click.option("--scale", type=float, metavar="FACTOR", help="Factor on the ground acceleration, not zero.")
method = click.option(
    "--method",
    metavar="SPEC",
    help="Time-integration method with its parameters, such as newmark:beta=0.25,gamma=0.5; `tdint methods` lists all.",
)
methods = click.option(
    "--method",
    "methods",
    multiple=True,
    metavar="SPEC",
    help="Time-integration method with its parameters, such as newmark:beta=0.25,gamma=0.5, may be repeated; all "
    "methods of `tdint methods` with their defaults if there is none.",
)
dt = click.option(
    "--dt",
    type=float,
    metavar="SECONDS",
    help="Time step; by default the model's, else the record's sampling interval. Under a record it is a whole part "
    "or a whole multiple of that interval.",
)
duration = click.option(
    "--duration", type=float, metavar="SECONDS", help="Time to integrate; by default the model's, else the record's."
)
jobs = click.option(
    "--jobs",
    type=click.IntRange(1, 1024),
    default=1,
    metavar="N",
    help="Processes that share the records; one by default. The output does not depend on it.",
)
overwrite = click.option("--overwrite", is_flag=True, help="Replace existing outputs.")


def output(metavar: str, text: str) -> Callable[[Command], Command]:
    """The option -o; what it names differs between the commands."""
    return click.option("-o", "--output", metavar=metavar, callback=_refuse_empty, help=text)


def _refuse_empty(_: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    """An empty name is a shell variable that was not set, not the working directory."""
    if value == "":
        raise UsageError(f"{parameter.opts[0]} is empty; give a name")
    return value


picture = click.option(
    "--plot", metavar="FILE", callback=_refuse_empty, help="Also draw to this file: .png, .pdf or .svg."
)
