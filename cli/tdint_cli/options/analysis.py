"""Options under the heading Analysis: the method, its step, and how long."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

import click

from tdint_cli.options import headings
from tdint_cli.options.values import FileName, Name, Ratio

if TYPE_CHECKING:
    from tdint.methods.method import Integrator


class OfMethod(Protocol):
    """A result of one method; `method` is its label."""

    @property
    def method(self) -> str: ...


Result = TypeVar("Result", bound=OfMethod)

DT_OVER_T = (1e-6, 1e6)
"""Steps over the period of an oscillator that may be asked for: beyond, rounding is all that is seen."""

option = partial(headings.option, heading=headings.ANALYSIS)


def _methods() -> list[str]:
    from tdint.methods.catalogue import catalogue

    return list(catalogue())


method_name = Name(_methods)
damping_ratio = Ratio(0.0, 1.0, max_open=True)


def _load(_: click.Context, __: click.Parameter, files: tuple[str, ...]) -> tuple[str, ...]:
    if files:
        from tdint.input_bytes import note_input
        from tdint.methods.catalogue import load_plugin
        from tdint_cli.options.output import note_inputs

        note_inputs()
        for file in files:
            load_plugin(file)
            note_input(file, Path(file).read_bytes())
    return files


def plugins(text: str = "", exposed: bool = True) -> headings.Declaration:
    """The option --plugin; `text` says what a command does with them but know them."""
    return option(
        "--plugin",
        "plugins",
        type=FileName(),
        multiple=True,
        is_eager=True,
        expose_value=exposed,
        callback=_load,
        metavar="FILE.py",
        help="A Python file with methods or drift laws of your own, its tuples METHODS and LAWS; it is executed."
        + text,
    )


plugin = plugins(exposed=False)


def method_of(needs: str) -> headings.Declaration:
    """The option --method, of what it `needs`."""
    return option(
        "--method",
        type=method_name,
        needs=needs,
        metavar="SPEC",
        help="Time-integration method with its parameters, such as newmark:beta=0.25,gamma=0.5; `tdint methods` lists "
        "all.",
    )


method = method_of("")


def methods(text: str) -> headings.Declaration:
    """The option --method of commands that take several; `text` says which if there is none."""
    return option(
        "--method",
        "methods",
        type=method_name,
        multiple=True,
        callback=_specifications,
        metavar="SPEC,...",
        help=f"Time-integration methods with their parameters, such as newmark:beta=0.25,gamma=0.5; {text} if there is "
        "none.",
    )


def _specifications(_: click.Context, __: click.Parameter, texts: tuple[str, ...]) -> tuple[str, ...]:
    """Take lists apart at the commas between methods; `beta=...` behind a comma belongs to the method before it."""
    found: list[str] = []
    for text in texts:
        start = len(found)
        for part in text.split(","):
            if len(found) > start and ":" in found[-1] and "=" in part and ":" not in part:
                found[-1] += f",{part}"
            else:
                found.append(part.strip())
    return tuple(found)


all_methods = methods("all methods of `tdint methods` with their defaults")
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

until_rest = option(
    "--until-rest",
    is_flag=True,
    help="Go on after that with the ground at rest until the building is: residual drifts are at rest then.",
)


DRAWN = (
    "newmark-average",
    "central-difference",
    "hht",
    "generalized-alpha",
    "bathe",
    "impulse",
    "impulse4",
    "moment4",
)
"""Methods of a picture of all: what people compare with, and what is ours; more lines are not told apart."""


def draw_all(names: Sequence[str]) -> headings.Declaration:
    """The option --all of a picture that has these methods without it."""
    return headings.option(
        "--all",
        "draw_all",
        heading=headings.OUTPUT,
        needs="--plot",
        is_flag=True,
        help=f"Draw all methods; without --method the picture has {', '.join(names)}. The table always has all.",
    )


def drawn(results: Sequence[Result], names: Sequence[str]) -> list[Result]:
    """Those of the results that are of methods of these names."""
    return [one for one in results if one.method.partition(":")[0] in names]


def integrators(specifications: Sequence[str]) -> list[Integrator]:
    """The methods that are asked for, each once; all of the catalogue at their defaults if none is.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    from tdint.methods.catalogue import chosen

    return chosen(specifications)
