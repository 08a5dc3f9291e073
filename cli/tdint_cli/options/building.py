"""The building of a command line, and its ground motion: the model and the options of the record together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tdint.errors import UsageError
from tdint_cli.options import analysis, headings
from tdint_cli.options.record import RecordRequest
from tdint_cli.options.values import FileName

if TYPE_CHECKING:
    from tdint.model.definition import Model, RecordSource

Function = TypeVar("Function", bound=Callable[..., Any])


_MODEL = click.argument("model", metavar="MODEL.yaml", type=FileName())


def model(command: Function) -> Function:
    """The model, and the plug-ins with methods and laws that it may have."""
    return headings.with_options((analysis.plugin, _MODEL), command)


@dataclass(frozen=True)
class BuildingRequest(RecordRequest):
    """What the command lines have in common that take a model and the options of a record."""

    model: str
    record: str | None
    scale: tuple[float, ...] | None
    duration: float | None


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
        return RecordSource(request.record, request.choice, request.scale[0] if request.scale else 1.0)
    source = model.excitation.record
    given: dict[str, Any] = {
        name: value for name in ("units", "component", "inventory") if (value := getattr(request, name)) is not None
    }
    if source is None:
        options = [*given, *["scale"] * bool(request.scale)]
        if options or request.layout or request.processing:
            name = f"--{options[0]}" if options else "the layout of a table" if request.layout else "processing"
            raise UsageError(f"{name} needs a record, the model has none: add --record FILE")
        return None
    choice = source.choice
    if "units" in given or "inventory" in given:
        # Each of the two excludes the other: who names one on the command line does without the model's other one.
        choice = replace(choice, units=None, inventory=None)
    processing, layout = request.processing.over(choice.processing), request.layout.over(choice.layout)
    choice = replace(choice, **given, processing=processing, layout=layout)
    return RecordSource(source.file, choice, request.scale[0] if request.scale else source.scale)
