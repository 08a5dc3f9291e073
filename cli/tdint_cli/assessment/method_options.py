"""Options of the commands that compare methods: all methods, and the methods in a figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import UsageError
from tdint_cli.options import grammar
from tdint_cli.options.analysis import method_name, plugin
from tdint_cli.options.output import Outputs, to_files
from tdint_cli.terminal import note

if TYPE_CHECKING:
    from tdint.methods.method import Integrator


DT_OVER_T = (1e-6, 1e6)
"""Allowed range of the time step divided by the period of an oscillator. Outside this range the
results consist of rounding errors."""


def methods(text: str) -> grammar.Declaration:
    """Declare the option --method of commands that accept several methods; `text` describes the
    default."""
    return grammar.option(
        "--method",
        "methods",
        type=method_name,
        multiple=True,
        callback=_specifications,
        help="Time-integration methods with their parameters, such as "
        f"newmark:beta=0.25:gamma=0.5; {text} by default.",
    )


def _specifications(
    _: click.Context, __: click.Parameter, texts: tuple[str, ...]
) -> tuple[str, ...]:
    """Split comma-separated lists of methods into single methods (callback of --method). A comma
    also separates the parameters of a method: `newmark:beta=0.25,gamma=0.5` is one method.
    """
    specifications: list[str] = []
    for text in texts:
        start = len(specifications)
        for part in text.split(","):
            # `a:x=1,y=2,b:z=3`: the part `y=2` is a parameter of the preceding method `a`.
            is_parameter = "=" in part and ":" not in part
            if len(specifications) > start and ":" in specifications[-1] and is_parameter:
                specifications[-1] += f",{part}"
            else:
                specifications.append(part.strip())
    return tuple(specifications)


all_methods = methods("all methods of `tdint methods` with their default parameters")

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
"""Methods that are plotted by default: the methods commonly used for comparison, and the methods
developed with tdint. More lines could not be distinguished in a figure."""


def draw_all(names: Sequence[str]) -> grammar.Declaration:
    """Declare the option --all of a figure that shows only the methods `names` by default."""
    return grammar.option(
        "--all",
        "draw_all",
        is_flag=True,
        help=f"Plot all methods; by default, without --method, the figure shows "
        f"{', '.join(names)}. The table always includes all methods.",
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class OscillatorRequest:
    """Common options of the commands that test methods on an oscillator; see `oscillator_options`.

    Attributes
    ----------
    methods : tuple of str
        Methods with their parameters; all methods of the catalogue if empty.
    draw_all : bool
        Plot all methods in the figure, not only the methods that are plotted by default.
    """

    methods: tuple[str, ...]
    damping: tuple[float, ...]
    draw_all: bool
    outputs: Outputs

    def drawn(self, results: Sequence[Any], names: Sequence[str]) -> Sequence[Any]:
        """Return the results to be plotted.

        These are all results if --method or --all is specified, otherwise the results of the
        methods with the names `names`.
        """
        if self.draw_all or self.methods:
            return results
        return [result for result in results if result.method.partition(":")[0] in names]


def oscillator_options(names: Sequence[str]) -> Callable[[grammar.Function], grammar.Function]:
    """Declare the options of an `OscillatorRequest`; `names` are the methods plotted by default."""
    damping = grammar.option("--damping", default=(0.0,))
    files = to_files(picture=True, more=[draw_all(names)], in_units=False)
    return grammar.together(plugin, all_methods, damping, files)


def integrators(specifications: Sequence[str]) -> list[Integrator]:
    """Return the requested methods without duplicates, or all methods of the catalogue.

    Parameters
    ----------
    specifications : sequence of str
        Methods with their parameters, such as 'newmark:beta=0.25'. If empty, all methods of the
        catalogue are returned, with their default parameters.

    Raises
    ------
    UsageError
        A method or a parameter is unknown, or a value is out of range.
    """
    from tdint.methods.catalogue import chosen

    return chosen(specifications or None)


def for_nonlinear(integrators: list[Integrator], law: str) -> list[Integrator]:
    """Return the methods that support a nonlinear law; write a note on omitted methods.

    Parameters
    ----------
    law : str
        Value of --law, for the error message.

    Raises
    ------
    UsageError
        No method supports nonlinear laws.
    """
    suited = [integrator for integrator in integrators if not integrator.family.linear_only]
    if not suited:
        raise UsageError(
            f"{integrators[0].label} supports linear buildings only and cannot be used with "
            f"--law {law}"
        )
    omitted = [integrator.label for integrator in integrators if integrator not in suited]
    note(*(f"{label}: omitted, because it supports linear buildings only" for label in omitted))
    return suited
