"""Conversion of arguments to models, records and numbers, with an error for invalid arguments."""

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
from tdint.number_parsing import parse_ratio
from tdint.units import DriftSize, parse_drift

if TYPE_CHECKING:
    from tdint.ground_motion.horizontals import Horizontals


class AnyTrace(Protocol):
    """Trace of ObsPy."""

    stats: Any


class AnyStream(Protocol):
    """Stream of ObsPy."""

    traces: Any


AnyModel: TypeAlias = "Model | str | Path | TextIO | Mapping[str, Any]"
"""Building: a result of `load_model`, or an argument of `load_model`."""

AnyRecord: TypeAlias = Record | str | Path | AnyTrace | AnyStream
"""Ground motion: a result of `read_record`, a file with units and one component, or a trace."""

AnyMotion: TypeAlias = "AnyRecord | Horizontals | tuple[AnyRecord, AnyRecord]"
"""Record, or pair of components."""


def model_of(given: Any) -> Model:
    """Return a model, or load it from an argument of `load_model`.

    Raises
    ------
    ModelError
        The argument is invalid, or the file contains errors.
    """
    if isinstance(given, Model):
        return given
    # The import of YAML is not needed for a model that is built in Python.
    from tdint.model.config.model_file import load_model

    return load_model(given)


def record_of(given: Any) -> Record:
    """Return a record, or read it from a file or an ObsPy Trace or Stream.

    Raises
    ------
    RecordError
        The argument is invalid, or the record cannot be read.
    UsageError
        The units of the record are unknown.
    """
    if isinstance(given, Record):
        return given
    # The import is not needed if only drifts are used.
    from tdint.ground_motion.reading.read import make_record, read_record

    if isinstance(given, str | os.PathLike):
        return read_record(Path(given) if given != "-" else given)
    if hasattr(given, "stats") or hasattr(given, "traces"):
        return make_record(given)
    raise RecordError(
        f"a record must be a result of read_record, a path or a trace, got {_type_name(given)}; "
        "make_record(samples, dt=0.01, units='m/s^2') creates a record from samples"
    )


def model_record(model: Model) -> Record | None:
    """Return the processed and scaled ground motion of a model; None if it has no record."""
    source = model.excitation.record
    if source is None:
        return None
    from tdint.ground_motion.reading.read import read_record

    if isinstance(source.choice.units, Mapping):  # units by file, which must match the file
        from tdint.ground_motion.reading.suites import records_of

        records_of([source.file], source.choice)
    record = read_record(source.file, **source.choice.reading)
    if source.choice.processing:
        from tdint.ground_motion.processing_steps import processed

        record = processed(record, source.choice.processing)
    return record.scaled(source.scale) if source.scale != 1.0 else record


def horizontals_of(given: Any) -> Horizontals:
    """Return a pair of components, or combine a sequence of two records or paths.

    Errors are raised as by `record_of` and `find_horizontals`.
    """
    from tdint.ground_motion.horizontals import Horizontals, find_horizontals

    if isinstance(given, Horizontals):
        return given
    if isinstance(given, tuple | list):
        return find_horizontals([record_of(motion) for motion in given])
    raise RecordError(
        f"a pair must be a result of read_horizontals, or two records, got {_type_name(given)}"
    )


def motion_of(given: Any) -> Record | Horizontals:
    """Return a record or a pair of components; errors as by `record_of` and `horizontals_of`."""
    from tdint.ground_motion.horizontals import Horizontals

    return (
        horizontals_of(given) if isinstance(given, tuple | list | Horizontals) else record_of(given)
    )


def number_of(given: Any, name: str) -> float | None:
    """Return a number, or None.

    Raises
    ------
    UsageError
        The argument is neither a number nor None.
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
    """Return a finite number between limits.

    Parameters
    ----------
    given : object
        Argument.
    name : str
        Name of the argument in messages.
    low, high : float
        Limits; default 0 and infinity.
    above : bool
        True if the number must be larger than `low`; default False.

    Raises
    ------
    UsageError
        The argument is not a number between the limits.
    """
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
    """Return a number, a ratio from a text such as `0.1%`, or None; errors as by `number_of`."""
    return parse_ratio(given) if isinstance(given, str) else number_of(given, name)


def numbers_of(given: Any, name: str) -> NDArray[np.float64]:
    """Return numbers as an array with one axis; errors as by `number_of`."""
    try:
        masked = np.any(getattr(given, "mask", False))  # a masked entry is not a number
        numbers = np.empty((0, 0)) if masked else np.atleast_1d(np.asarray(given, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty((0, 0))
    if numbers.ndim != 1:
        raise UsageError(
            f"{name} must be a sequence of numbers, got {' '.join(repr(given).split()):.60}"
        )
    return numbers


def damping_of(given: Any) -> float:
    """Return a damping ratio in [0, 1); errors as by `number_of`."""
    ratio = ratio_of(given, "damping")
    if ratio is None or not 0.0 <= ratio < 1.0:
        raise UsageError(f"damping must be a ratio in [0, 1), got {given!r:.60}")
    return ratio


def drift_of(given: Any) -> DriftSize:
    """Return a drift from a text (see `parse_drift`) or a number (drift ratio).

    Errors are raised as by `parse_drift` and `number_of`.
    """
    if isinstance(given, DriftSize):
        return given
    return parse_drift(given if isinstance(given, str) else str(number_of(given, "drift")))


def is_list(given: Any) -> bool:
    """Return True for a list, a tuple or an array with at least one axis."""
    return isinstance(given, list | tuple) or getattr(given, "ndim", 0) > 0


def _type_name(given: Any) -> str:
    """Return the type of an argument for messages."""
    return "None" if given is None else f"a {type(given).__name__}"
