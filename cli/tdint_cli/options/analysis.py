"""Options under the heading Analysis: the method, its step, and how long."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from tdint_cli.options import headings
from tdint_cli.options.values import Number

if TYPE_CHECKING:
    from tdint.methods.method import Integrator

DT_OVER_T = (1e-6, 1e6)
"""Steps over the period of an oscillator that may be asked for: beyond, rounding is all that is seen."""

option = partial(headings.option, heading=headings.ANALYSIS)

damping_ratio = Number(0.0, 1.0, max_open=True)

method = option(
    "--method",
    metavar="SPEC",
    help="Time-integration method with its parameters, such as newmark:beta=0.25,gamma=0.5; `tdint methods` lists all.",
)
methods = option(
    "--method",
    "methods",
    multiple=True,
    metavar="SPEC",
    help="Time-integration method with its parameters, such as newmark:beta=0.25,gamma=0.5, may be repeated; all "
    "methods of `tdint methods` with their defaults if there is none.",
)
dt = option(
    "--dt",
    type=float,
    metavar="SECONDS",
    help="Time step; by default the model's, else the record's sampling interval. Under a record it is a whole part "
    "or a whole multiple of that interval.",
)
duration = option(
    "--duration", type=float, metavar="SECONDS", help="Time to integrate; by default the model's, else the record's."
)


def integrators(specifications: Sequence[str]) -> list[Integrator]:
    """The methods that are asked for, each once; all of the catalogue at their defaults if none is.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    from tdint.methods.catalogue import catalogue, parse

    return list(dict.fromkeys(parse(text) for text in specifications or catalogue()))
