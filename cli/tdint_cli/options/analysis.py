"""Options under the heading Analysis: the method, its time step, and the duration."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError
from tdint.number_parsing import number_or_nan
from tdint.tabular import on_use
from tdint_cli.options import grammar
from tdint_cli.options.option_types import FileName, ListOf, Written
from tdint_cli.options.record import RecordRequest
from tdint_cli.terminal import warn

if TYPE_CHECKING:
    from tdint.model.definition import Model, RecordSource


method_name = Written("name", names=on_use("tdint.methods.catalogue").catalogue)


def _load(
    context: click.Context, option: click.Parameter, lists: tuple[tuple[str, ...], ...]
) -> tuple[str, ...]:
    """Execute the plug-in files of --plugin and record their SHA-256 (callback of the option)."""
    assert isinstance(option.type, ListOf)
    files = option.type.joined(context, option, lists) or ()
    if files:
        from tdint.files import record_digest
        from tdint.methods.catalogue import load_plugin

        for file in files:
            load_plugin(file)
            record_digest(file, Path(file).read_bytes())
    return files


plugins = grammar.option("--plugin", "plugins", is_eager=True, callback=_load)
plugin = grammar.option("--plugin", "plugins", is_eager=True, callback=_load, expose_value=False)
"""The option --plugin; a command with `plugins` receives the files as an argument."""

method = grammar.option("--method", type=method_name)


# ---- Changed parameters of the model


def assignments(texts: Iterable[str], error: Callable[[str], UsageError]) -> dict[str, str]:
    """Return the values by name of texts NAME=VALUE, separated by commas; the last value of a name
    applies. `error` returns the error of a text in another form."""
    values: dict[str, str] = {}
    for text in chain.from_iterable(text.split(",") for text in texts):
        name, equals, value = map(str.strip, text.partition("="))
        if not (name and equals and value):
            raise error(text)
        values[name] = value
    return values


def _changes(
    context: click.Context, option: click.Parameter, texts: tuple[str, ...]
) -> dict[str, str]:
    """Split the values of --set (callback of the option)."""
    return assignments(
        texts,
        lambda text: UsageError(
            f"--set {text!r} must be KEY=VALUE, such as damping=2% or "
            "stories[1].stiffness='300 kN/mm'"
        ),
    )


changes = grammar.option("--set", "changes", multiple=True, callback=_changes)


def changed(model: Model, changes: Mapping[str, str]) -> Model:
    """Return the model with the values of --set, and warn of the units of its numbers."""
    result = model.changed({name: model.file_value(name, changes[name]) for name in changes})
    for name, text in changes.items():
        warn_of_unit(model, "--set", name, (text,))
    return result


def warn_of_unit(model: Model, option: str, name: str, texts: Iterable[str]) -> None:
    """Warn of numbers without a unit in the values of a parameter if the unit of the model is not
    an SI unit."""
    unit, factor = model.unit_of(name)
    if factor != 1.0 and any(math.isfinite(number_or_nan(text)) for text in texts):
        warn(f"{option} {name}: numbers are in {unit}, units of {model.source}")


# ---- This part combines the model and the options of the record: the building of a command line
# and its ground motion.

model = grammar.together(plugin, click.argument("model", metavar="MODEL.yaml", type=FileName()))
"""The model argument, and the option for plug-ins with methods and laws that the model uses."""


@dataclass(frozen=True, eq=False, repr=False)
class BuildingRequest(RecordRequest):
    """Common options of the commands that accept a model and the options of a record.

    Attributes
    ----------
    record : str | None
        Record file; None for the record of the model.
    scale : tuple of float | None
        Scale factors of the ground motion; None for the factor of the model.
    duration : float | None
        Duration of the analysis, s; None for the duration of the model or of the record.
    """

    model: str
    record: str | None
    scale: tuple[float, ...] | None
    duration: float | None


def warn_of(model: Model) -> None:
    """Print warnings about unusual values of a building, such as its period; the most common cause
    is a wrong unit.
    """
    from tdint.model.building import assemble
    from tdint.model.plausibility import unusual_values

    for part in model.directions:
        warn(*unusual_values(part, assemble(part)))


def check_motion(request: BuildingRequest) -> None:
    """Check the ground-motion options before any computation.

    Raises
    ------
    UsageError
        Several scale factors are given, or both model and record are standard input.
    """
    if len(set(request.scale or ())) > 1:
        raise UsageError(
            "--scale: this command accepts one factor; run it separately for each factor"
        )
    if request.model == "-" and request.record == "-":
        raise UsageError("standard input is used for the model; specify the record as a file")


def with_motion(model: Model, request: BuildingRequest) -> Model:
    """Return the model with the ground motion that the command line specifies.

    Raises
    ------
    UsageError
        Record options are given, but the command line and the model specify no record.
    """
    across = model.across
    # A record of the command line has both components.
    if across is not None and request.record is not None:
        across = replace(across, excitation=replace(across.excitation, record=None))
    elif across is not None and across.excitation.record is not None:
        across = with_motion(across, request)
    record = _motion(request, model)
    return replace(model, excitation=replace(model.excitation, record=record), across=across)


def _motion(request: BuildingRequest, model: Model) -> RecordSource | None:
    """Return the record of the command line, or the record of the model with changed options; None
    without a record. UsageError is raised if record options are given without a record.
    """
    from tdint.model.definition import RecordSource

    factor = request.scale[0] if request.scale else 1.0
    if request.record is not None:
        return RecordSource(request.record, request.choice.of(request.record), factor)
    source, given = model.excitation.record, request.choice
    if source is None:
        specified = {
            "units": given.units,
            "component": given.component,
            "inventory": given.inventory,
            "scale": request.scale or None,
        }
        subject = ""
        if names := [name for name, value in specified.items() if value is not None]:
            subject = f"--{names[0]}"
        elif given.layout:
            subject = "the layout of a table"
        elif given.processing:
            subject = "processing"
        if subject:
            raise UsageError(
                f"{subject} requires a record, but the model specifies no record; add --record FILE"
            )
        return None
    choice = source.choice
    if given.units is not None or given.inventory is not None:
        # `units` and `inventory` exclude each other: if the command line specifies one value, the
        # other value of the model does not apply.
        choice = replace(choice, units=None, inventory=None)
    # The factor of the model belongs to its file; a factor of the command line multiplies it.
    return RecordSource(source.file, given.over(choice), source.scale * factor)
