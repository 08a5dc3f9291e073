"""Options under the heading Spectrum: damping ratios and periods."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from tdint_cli.options import headings, output
from tdint_cli.options.analysis import damping_ratio
from tdint_cli.options.values import GridType, Number

Function = TypeVar("Function", bound=Callable[..., Any])

option = partial(headings.option, heading=headings.SPECTRUM)


def damping(needs: str = "") -> Callable[[Function], Function]:
    """The option --damping, of what it `needs`."""
    return option(
        "--damping",
        type=damping_ratio,
        many=True,
        default=(0.05,),
        needs=needs,
        metavar="RATIO,...",
        help="Damping ratios; 0.05 (or 5%) by default.",
    )


tables = output.output(
    "FILE|DIR",
    "Write to this file instead of standard output; to one file per record in an existing folder or one that is named "
    "with a / at its end. What the records are and how the numbers came about stands in a JSON file beside each.",
)


picture = output.plot(
    "Also draw all records, to this file (.png, .pdf, .svg); alone, each CSV file of -o, as PNG beside it."
)


def periods(default: str, zero: str = "", needs: str = "") -> Callable[[Function], Function]:
    """The options --periods and --period; `zero` says what a period of 0 gives, if it may be asked for."""
    several = option(
        "--periods",
        type=GridType(),
        needs=needs,
        metavar="FIRST:LAST:COUNT",
        help=f"Periods in equal ratios, s; {default} by default, both ends included.",
    )
    single = option(
        "--period",
        type=Number(0.0, min_open=not zero),
        many=True,
        needs=needs,
        metavar="SECONDS,...",
        help=f"Single periods; in place of --periods.{zero}",
    )
    return lambda command: several(single(command))
