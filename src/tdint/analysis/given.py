"""What callers give in the place of a model, a record or a number: taken as it is meant, or refused
in words."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.record import Record
from tdint.model.definition import Model
from tdint.units import DriftSize, parse_drift
from tdint.written_numbers import parse_ratio

if TYPE_CHECKING:
    from tdint.ground_motion.horizontals import Horizontals


class AnyTrace(Protocol):
    """A Trace of ObsPy."""

    stats: Any


class AnyStream(Protocol):
    """A Stream of ObsPy."""

    traces: Any


AnyModel: TypeAlias = "Model | str | Path | TextIO | Mapping[str, Any]"
"""A building: what `load_model` gives, or what that takes."""

AnyRecord: TypeAlias = Record | str | Path | AnyTrace | AnyStream
"""A ground motion: what `read_record` gives, a file that tells its units and has one component, or
a trace."""

AnyMotion: TypeAlias = "AnyRecord | Horizontals | tuple[AnyRecord, AnyRecord]"
"""A record, or a pair of components."""


def model_of(given: Any) -> Model:
    """A model, or that of what `load_model` takes.

    Raises
    ------
    ModelError
        It is neither, or the file has faults.
    """
    if isinstance(given, Model):
        return given
    from tdint.model.config.model_file import (
        load_model,
    )  # YAML, which a model of Python does without

    return load_model(given)


def record_of(given: Any) -> Record:
    """A record, or that of a file or of an ObsPy Trace or Stream.

    Raises
    ------
    RecordError
        It is none of these, or cannot be read.
    UsageError
        Its units are unknown.
    """
    if isinstance(given, Record):
        return given
    from tdint.ground_motion.reading.read import (
        make_record,
        read_record,
    )  # not where only drifts are given

    if isinstance(given, str | os.PathLike):
        return read_record(Path(given) if given != "-" else given)
    if hasattr(given, "stats") or hasattr(given, "traces"):
        return make_record(given)
    raise RecordError(
        f"a record is what read_record gives, a path or a trace, got {_kind(given)}; of samples "
        "make_record(samples, dt=0.01, units='m/s^2') makes one"
    )


def model_record(model: Model) -> Record | None:
    """The ground motion that the model names, processed and scaled; None if it names none."""
    source = model.excitation.record
    if source is None:
        return None
    from tdint.ground_motion.processing_steps import processed
    from tdint.ground_motion.reading.read import read_record

    if isinstance(source.choice.units, Mapping):  # by file: they must fit it
        from tdint.ground_motion.reading.suites import records_of

        records_of([source.file], source.choice)
    record = processed(read_record(source.file, **source.choice.reading), source.choice.processing)
    return record.scaled(source.scale) if source.scale != 1.0 else record


def horizontals_of(given: Any) -> Horizontals:
    """A pair of components, or that of a sequence of two records or paths. Errors are those of
    `record_of`, and of `find_horizontals`."""
    from tdint.ground_motion.horizontals import Horizontals, find_horizontals

    if isinstance(given, Horizontals):
        return given
    if isinstance(given, tuple | list):
        return find_horizontals([record_of(motion) for motion in given])
    raise RecordError(f"a pair is what read_horizontals gives, or two records, got {_kind(given)}")


def motion_of(given: Any) -> Record | Horizontals:
    """A record, or the pair of two. Errors are those of `record_of` and `horizontals_of`."""
    from tdint.ground_motion.horizontals import Horizontals

    return (
        horizontals_of(given) if isinstance(given, tuple | list | Horizontals) else record_of(given)
    )


def number_of(given: Any, name: str) -> float | None:
    """A number, or nothing.

    Raises
    ------
    UsageError
        It is neither.
    """
    if given is None:
        return None
    try:
        number = float(given)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if math.isnan(number) or isinstance(given, str | bytes):
        raise UsageError(f"{name} must be a number, got {given!r:.60}")
    return number


def between(
    given: Any, name: str, low: float = 0.0, high: float = math.inf, *, above: bool = False
) -> float:
    """A finite number from `low` (with `above`, larger than it) to `high`. UsageError as
    `number_of`."""
    number = number_of(given, name)
    if (
        number is None
        or not low <= number <= high
        or math.isinf(number)
        or (above and number == low)
    ):
        most = f" to {high:g}" if math.isfinite(high) else ""
        raise UsageError(
            f"{name} must be a number {'above' if above else 'from'} {low:g}{most}, got "
            f"{given!r:.60}"
        )
    return number


def ratio_of(given: Any, name: str) -> float | None:
    """A number or a text such as `0.1%`, or nothing. UsageError as `number_of`."""
    return parse_ratio(given) if isinstance(given, str) else number_of(given, name)


def numbers_of(given: Any, name: str) -> NDArray[np.float64]:
    """Numbers as an array of one axis. UsageError as `number_of`."""
    try:
        masked = np.any(getattr(given, "mask", False))  # what is masked stands for no number
        numbers = np.empty((0, 0)) if masked else np.atleast_1d(np.asarray(given, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty((0, 0))
    if numbers.ndim != 1:
        raise UsageError(
            f"{name} must be numbers in a row, got {' '.join(repr(given).split()):.60}"
        )
    return numbers


def damping_of(given: Any) -> float:
    """A damping ratio in [0, 1). UsageError as `number_of`."""
    ratio = ratio_of(given, "damping")
    if ratio is None or not 0.0 <= ratio < 1.0:
        raise UsageError(f"damping must be a ratio in [0, 1), got {given!r:.60}")
    return ratio


def drift_of(given: Any) -> DriftSize:
    """A drift, of a text as `parse_drift` has it, or of a number, a drift ratio. UsageError as by
    both."""
    if isinstance(given, DriftSize):
        return given
    return parse_drift(given if isinstance(given, str) else str(number_of(given, "drift")))


def _kind(given: Any) -> str:
    return "nothing" if given is None else f"a {type(given).__name__}"
