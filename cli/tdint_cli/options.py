"""Options that several commands share, each declared once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from tdint.errors import UsageError
from tdint_cli.errors import Settings

Command = TypeVar("Command", bound=Callable[..., Any])


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
scale = click.option("--scale", type=float, metavar="FACTOR", help="Factor on the ground acceleration, not zero.")
method = click.option(
    "--method",
    metavar="SPEC",
    help="Time-integration method with its parameters, such as newmark:beta=0.25,gamma=0.5; `tdint methods` lists all.",
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
overwrite = click.option("--overwrite", is_flag=True, help="Replace existing outputs.")


def output(metavar: str, text: str) -> Callable[[Command], Command]:
    """The option -o; what it names differs between the commands."""
    return click.option("-o", "--output", metavar=metavar, callback=_refuse_empty, help=text)


def _refuse_empty(_: click.Context, __: click.Parameter, value: str | None) -> str | None:
    """An empty name is a shell variable that was not set, not the working directory."""
    if value == "":
        raise UsageError("-o is empty; give a name")
    return value
