"""Options under the heading Analysis: the method, its step, and how long."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import click

from tdint.errors import UsageError
from tdint_cli.options import grammar
from tdint_cli.options.grammar import FileName, ListOf, Name, Ratio
from tdint_cli.options.output import PICTURE, Outputs, to_files
from tdint_cli.options.record import RecordRequest
from tdint_cli.terminal import note, warn

if TYPE_CHECKING:
    from tdint.methods.method import Integrator
    from tdint.model.definition import Model, RecordSource


class OfMethod(Protocol):
    """A result of one method; `method` is its label."""

    @property
    def method(self) -> str: ...


Result = TypeVar("Result", bound=OfMethod)

DT_OVER_T = (1e-6, 1e6)
"""Steps over the period of an oscillator that may be asked for: beyond, rounding is all that is
seen."""

option = partial(grammar.option, heading=grammar.ANALYSIS)


def _methods() -> list[str]:
    from tdint.methods.catalogue import catalogue

    return list(catalogue())


method_name = Name(_methods)
damping_ratio = Ratio(0.0, 1.0, max_open=True)


def damping_of(what: str, **settings: Any) -> grammar.Declaration:
    """The option --damping with a single ratio, of what it is."""
    told = f"Damping ratio of {what}; 0.05 (or 5%) by default."
    return grammar.option("--damping", type=damping_ratio, default=0.05, help=told, **settings)


def _load(_: click.Context, __: click.Parameter, files: tuple[str, ...]) -> tuple[str, ...]:
    if files:
        from tdint.files import note_input
        from tdint.methods.catalogue import load_plugin

        for file in files:
            load_plugin(file)
            note_input(file, Path(file).read_bytes())
    return files


def plugins(text: str = "", exposed: bool = True) -> grammar.Declaration:
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
        rare=True,
        help="A Python file with methods or drift laws of your own, its tuples METHODS and LAWS, "
        "or with programs for "
        "`tdint chart`, its tuple PEERS; it is executed." + text,
    )


plugin = plugins(exposed=False)


def method_of(needs: str) -> grammar.Declaration:
    """The option --method, of what it `needs`."""
    return option(
        "--method",
        type=method_name,
        needs=needs,
        metavar="SPEC",
        help="Time-integration method with its parameters, such as newmark:beta=0.25:gamma=0.5; "
        "`tdint methods` lists all.",
    )


method = method_of("")


def methods(text: str) -> grammar.Declaration:
    """The option --method of commands that take several; `text` says which if there is none."""
    return option(
        "--method",
        "methods",
        type=method_name,
        multiple=True,
        callback=_specifications,
        metavar="SPEC,...",
        help="Time-integration methods with their parameters, such as "
        f"newmark:beta=0.25:gamma=0.5; {text} if there is none.",
    )


def _specifications(
    _: click.Context, __: click.Parameter, texts: tuple[str, ...]
) -> tuple[str, ...]:
    """Take lists apart at the commas between methods; `beta=...` behind a comma belongs to the
    method before it."""
    specifications: list[str] = []
    for text in texts:
        start = len(specifications)
        for part in text.split(","):
            if (
                len(specifications) > start
                and ":" in specifications[-1]
                and "=" in part
                and ":" not in part
            ):
                specifications[-1] += f",{part}"
            else:
                specifications.append(part.strip())
    return tuple(specifications)


all_methods = methods("all methods of `tdint methods` with their defaults")
dt = option(
    "--dt",
    type=float,
    metavar="SECONDS",
    help="Time step; by default the model's, else the record's sampling interval. Under a record "
    "it is a whole part or a whole multiple of that interval.",
)
duration = option(
    "--duration",
    type=float,
    metavar="SECONDS",
    rare=True,
    help="Time to integrate; by default the model's, else the record's.",
)

until_rest = option(
    "--until-rest",
    is_flag=True,
    help="Go on after the record with the ground at rest until the building is, too: residual "
    "drifts are at rest then.",
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
"""Methods of a picture of all: what people compare with, and what is ours; more lines are not told
apart."""


def draw_all(names: Sequence[str]) -> grammar.Declaration:
    """The option --all of a picture that has these methods without it."""
    return grammar.option(
        "--all",
        "draw_all",
        heading=grammar.OUTPUT,
        needs="--plot",
        is_flag=True,
        rare=True,
        help=f"Draw all methods; without --method the picture has {', '.join(names)}. The table "
        "always has all.",
    )


@dataclass(frozen=True, kw_only=True)
class OscillatorRequest:
    """What the command lines have in common that measure methods on an oscillator: `of_oscillator`
    gives it."""

    methods: tuple[str, ...]
    damping: tuple[float, ...]
    draw_all: bool
    outputs: Outputs

    def drawn(self, results: Sequence[Result], names: Sequence[str]) -> Sequence[Result]:
        """What the picture has: all that was asked for, else those of these names."""
        if self.draw_all or self.methods:
            return results
        return [result for result in results if result.method.partition(":")[0] in names]


def of_oscillator(names: Sequence[str]) -> Callable[[grammar.Function], grammar.Function]:
    """The options of an `OscillatorRequest`; pictures have these methods where none is named."""
    damping = option(
        "--damping",
        type=ListOf(Ratio(0.0)),
        default=(0.0,),
        help="Damping ratios of the oscillator, also of 1 and more; 0 by default.",
    )
    files = to_files(picture=PICTURE, more=[draw_all(names)], in_units=False)
    return grammar.together(plugin, all_methods, damping, files)


def integrators(specifications: Sequence[str]) -> list[Integrator]:
    """The methods that are asked for, each once; all of the catalogue at their defaults if none is.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    from tdint.methods.catalogue import chosen

    return chosen(specifications or None)


def for_nonlinear(integrators: list[Integrator], law: str) -> list[Integrator]:
    """Those of the methods that integrate a nonlinear law; a note on the others.

    Raises
    ------
    UsageError
        There is none.
    """
    suited = [integrator for integrator in integrators if not integrator.family.linear_only]
    if not suited:
        raise UsageError(
            f"{integrators[0].label} integrates linear buildings only; not with --law {law}"
        )
    for integrator in integrators:
        if integrator not in suited:
            note(f"{integrator.label} is left out: it integrates linear buildings only")
    return suited


# ---- The building of a command line, and its ground motion: the model and the options of the
# record together

model = grammar.together(plugin, click.argument("model", metavar="MODEL.yaml", type=FileName()))
"""The model, and the plug-ins with methods and laws that it may have."""


@dataclass(frozen=True)
class BuildingRequest(RecordRequest):
    """What the command lines have in common that take a model and the options of a record."""

    model: str
    record: str | None
    scale: tuple[float, ...] | None
    duration: float | None


def warn_of(model: Model) -> None:
    """What is unusual of a building, mostly a unit that was mistaken: its periods and forces are
    believed, too."""
    from tdint.model.building import assemble
    from tdint.model.plausibility import mistakable

    warn(*mistakable(model, assemble(model)))


def check_motion(request: BuildingRequest) -> None:
    """Refuse, before any work, what can be seen to fail.

    Raises
    ------
    UsageError
        Several scales; a model and a record that both are standard input.
    """
    if len(set(request.scale or ())) > 1:
        raise UsageError("--scale: this command takes one factor; call it once for each")
    if request.model == "-" and request.record == "-":
        raise UsageError("standard input already holds the model; give the record as a file")


def with_motion(model: Model, request: BuildingRequest) -> Model:
    """The model with the ground motion that the command line asks for.

    Raises
    ------
    UsageError
        Options of a record where there is none.
    """
    return replace(model, excitation=replace(model.excitation, record=_motion(request, model)))


def _motion(request: BuildingRequest, model: Model) -> RecordSource | None:
    from tdint.model.definition import RecordSource

    if request.record is not None:
        return RecordSource(
            request.record, request.choice, request.scale[0] if request.scale else 1.0
        )
    source = model.excitation.record
    given: dict[str, Any] = {
        name: value
        for name in ("units", "component", "inventory")
        if (value := getattr(request, name)) is not None
    }
    if source is None:
        options = [*given, *["scale"] * bool(request.scale)]
        if options or request.layout or request.processing:
            name = (
                f"--{options[0]}"
                if options
                else "the layout of a table"
                if request.layout
                else "processing"
            )
            raise UsageError(f"{name} needs a record, the model has none: add --record FILE")
        return None
    choice = source.choice
    if "units" in given or "inventory" in given:
        # Each of the two excludes the other: who names one on the command line does without the
        # model's other one.
        choice = replace(choice, units=None, inventory=None)
    processing, layout = (
        request.processing.over(choice.processing),
        request.layout.over(choice.layout),
    )
    choice = replace(choice, **given, processing=processing, layout=layout)
    return RecordSource(source.file, choice, request.scale[0] if request.scale else source.scale)
