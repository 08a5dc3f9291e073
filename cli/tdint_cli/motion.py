"""Where the ground motion of a building comes from: its model and the options of the command line together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from tdint.errors import UsageError

if TYPE_CHECKING:
    from tdint.ground_motion.processing import Processing
    from tdint.model.definition import Model, RecordSource


class Wishes(Protocol):
    """A command line with a model and the options of a record."""

    @property
    def model(self) -> str: ...
    @property
    def record(self) -> str | None: ...
    @property
    def units(self) -> str | None: ...
    @property
    def component(self) -> str | None: ...
    @property
    def inventory(self) -> str | None: ...
    @property
    def scale(self) -> float | None: ...
    @property
    def processing(self) -> Processing: ...


def check_motion(request: Wishes) -> None:
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


def with_motion(model: Model, request: Wishes) -> Model:
    """The model with the ground motion that the command line wants.

    Raises
    ------
    UsageError
        Options of a record where there is none.
    """
    return replace(model, excitation=replace(model.excitation, record=_motion(request, model)))


def _motion(request: Wishes, model: Model) -> RecordSource | None:
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
