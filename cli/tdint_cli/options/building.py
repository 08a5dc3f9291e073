"""The building of a command line, and its ground motion: the model and the options of the record together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError

if TYPE_CHECKING:
    from tdint.ground_motion.processing import Processing
    from tdint.model.definition import Model, RecordSource


model = click.argument("model", metavar="MODEL.yaml")


@dataclass(frozen=True)
class BuildingRequest:
    """What the command lines have in common that take a model and the options of a record."""

    model: str
    record: str | None
    units: str | None
    component: str | None
    inventory: str | None
    scale: float | None
    processing: Processing
    duration: float | None


def check_motion(request: BuildingRequest) -> None:
    """Refuse, before any work, what can be seen to fail.

    Raises
    ------
    UsageError
        A scale that is zero or no number; a model and a record that both are standard input.
    """
    if request.scale is not None and not (request.scale and abs(request.scale) < float("inf")):
        raise UsageError(f"--scale must be a number other than zero, got {request.scale}")
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
        scale = 1.0 if request.scale is None else request.scale
        return RecordSource(
            request.record, request.units, request.component, scale, request.inventory, request.processing
        )
    source = model.excitation.record
    given = {
        name: value
        for name in ("units", "component", "inventory", "scale")
        if (value := getattr(request, name)) is not None
    }
    if source is None:
        if given or request.processing:
            name = f"--{next(iter(given))}" if given else "processing"
            raise UsageError(f"{name} needs a record, the model has none: add --record FILE")
        return None
    if "units" in given or "inventory" in given:
        # Each of the two excludes the other: who names one on the command line does without the model's other one.
        source = replace(source, units=None, inventory=None)
    return replace(source, **given, processing=request.processing.over(source.processing))
