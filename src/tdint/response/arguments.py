"""Conversion of arguments to models, records and numbers, with an error for invalid arguments."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.record import Record
from tdint.number_parsing import parse_ratio
from tdint.tabular import ResultList
from tdint.units import DriftSize, parse_drift

if TYPE_CHECKING:
    from tdint.ground_motion.axes import PairRecord
    from tdint.ground_motion.choice import RecordChoice
    from tdint.ground_motion.horizontals import Horizontals
    from tdint.model.definition import Model


class AnyTrace(Protocol):
    """Trace of ObsPy, or an object with the same attribute."""

    stats: Any


class AnyStream(Protocol):
    """Stream of ObsPy, or an object with the same attribute."""

    traces: Any


AnyModel: TypeAlias = "Model | str | Path | TextIO | Mapping[str, Any]"
"""Building: a result of `load_model`, or an argument of `load_model`."""

AnyRecord: TypeAlias = Record | str | Path | AnyTrace | AnyStream
"""Ground motion: a result of `read_record`, a file with units and a single component, or a
trace."""

AnyMotion: TypeAlias = "AnyRecord | Horizontals | tuple[AnyRecord, AnyRecord]"
"""Record, or pair of components."""


def model_of(argument: Any) -> Model:
    """Return a model, or load it from an argument of `load_model`.

    Raises
    ------
    ModelError
        The argument is invalid, or the file contains errors.
    """
    from tdint.model.definition import Model  # spectra of records do not need this import

    if isinstance(argument, Model):
        return argument
    # Imported here, because loading YAML needs time and is not needed for an existing model.
    from tdint.model.config.model_file import load_model

    return load_model(argument)


def record_of(argument: Any) -> Record:
    """Return a record, or read it from a file or an ObsPy Trace or Stream.

    Raises
    ------
    RecordError
        The argument is invalid, or the record cannot be read.
    UsageError
        The units of the record are unknown.
    """
    if isinstance(argument, Record):
        return argument
    # Imported here, because loading ObsPy needs time and is not needed for an existing record.
    from tdint.ground_motion.reading.read import make_record, read_record

    if isinstance(argument, str | os.PathLike):
        return read_record(Path(argument) if argument != "-" else argument)
    if hasattr(argument, "stats") or hasattr(argument, "traces"):
        return make_record(argument)
    raise RecordError(
        f"a record must be a result of read_record, a path or a trace, got {_type_name(argument)}; "
        "make_record(samples, dt=0.01, units='m/s^2') creates a record from samples"
    )


def model_record(model: Model) -> Record | None:
    """Read, process and scale the ground motion that a model specifies, of both directions of a
    model with two (`PairRecord`); None without a record.

    Raises
    ------
    RecordError
        The record cannot be read.
    UsageError
        Its units or processing steps are invalid.
    """
    if model.across is not None:
        return pair_of(model, None)
    source = model.excitation.record
    if source is None:
        return None
    from tdint.ground_motion.reading.read import channel_records

    # If the model maps file names to units, `records_of` raises an error unless the mapping applies
    # to this file.
    if isinstance(source.choice.units, Mapping):
        from tdint.ground_motion.reading.suites import records_of

        records_of([source.file], source.choice)
    (record,) = channel_records(source.file, source.choice, single=True)
    if source.choice.processing:
        from tdint.ground_motion.processing_steps import processed

        record = processed(record, source.choice.processing)
    return record.scaled(source.scale) if source.scale != 1.0 else record


def pair_of(model: Model, motion: Any) -> PairRecord | None:
    """Return the ground motion of a model along its axes: that of its file if `motion` is `None`.

    Raises
    ------
    RecordError
        The motion has a single component, or its components are not a pair.
    UsageError
        The factors of the components in the file differ.
    """
    # Imported here, because most models have one direction.
    from tdint.ground_motion.axes import PairRecord, along_axes

    if isinstance(motion, PairRecord):
        return motion
    if motion is not None:
        return along_axes(_read_horizontals(motion), model.axis_azimuth)
    x, y = (part.excitation.record for part in model.directions)
    if x is None:
        return None
    if y is not None:
        if x.scale != y.scale:
            raise UsageError(
                f"{model.name}: the components of a ground motion need the same factor, got scale "
                f"{x.scale:g} for x and {y.scale:g} for y; scale the samples of one file instead"
            )
        records = [model_record(part) for part in model.directions]
        return PairRecord(*(record for record in records if record is not None))
    return pair_of_files(model, [x.file], x.choice).scaled(x.scale)


def pair_of_files(model: Model, files: Sequence[str], choice: RecordChoice) -> PairRecord:
    """Return the ground motion in one or two files along the axes of a model.

    Raises
    ------
    RecordError
        The files do not contain the two horizontal components of a ground motion.
    """
    # Imported here, because other runs do not read several components.
    from tdint.ground_motion.axes import along_axes
    from tdint.ground_motion.horizontals import find_horizontals, with_component
    from tdint.ground_motion.reading.suites import read_chosen

    records = [record for file in files for record in read_chosen(file, choice)]
    named = [with_component(record, in_degrees=True) for record in records]
    return along_axes(find_horizontals(named), model.axis_azimuth)


def _read_horizontals(motion: Any) -> Horizontals:
    """Return the pair of components of an argument of Python: a pair, or one or two files or
    records."""
    from tdint.ground_motion.horizontals import Horizontals, find_horizontals, with_component

    if isinstance(motion, Horizontals):
        return motion
    items = motion if isinstance(motion, tuple | list) else (motion,)
    if all(isinstance(item, str | Path) for item in items):
        from tdint.ground_motion.reading.read import read_horizontals

        return read_horizontals(*items)
    return find_horizontals([with_component(record_of(item), in_degrees=True) for item in items])


def horizontals_of(argument: Any) -> Horizontals:
    """Return a pair of components, or combine a sequence of two records or paths.

    Raises
    ------
    RecordError
        The argument is invalid, a record cannot be read, or the records are not a horizontal pair.
    UsageError
        The units of a record are unknown.
    """
    from tdint.ground_motion.horizontals import Horizontals, find_horizontals

    if isinstance(argument, Horizontals):
        return argument
    if isinstance(argument, tuple | list):
        return find_horizontals([record_of(motion) for motion in argument])
    raise RecordError(
        f"a pair must be a result of read_horizontals, or two records, got {_type_name(argument)}"
    )


def motion_of(argument: Any) -> Record | Horizontals:
    """Return a record, or a pair of components for a sequence of two records."""
    from tdint.ground_motion.horizontals import Horizontals

    return (
        horizontals_of(argument)
        if isinstance(argument, tuple | list | Horizontals)
        else record_of(argument)
    )


def number_of(argument: Any, name: str) -> float | None:
    """Convert an argument to a float; None is returned unchanged.

    Raises
    ------
    UsageError
        The argument is not a number and not None; texts of numbers are not accepted.
    """
    if argument is None:
        return None
    try:
        number = float(argument)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if math.isnan(number) or isinstance(argument, str | bytes):
        raise UsageError(f"{name} must be a number, got {argument!r:.60}")
    return number


def finite_numbers(values: object) -> Array | None:
    """Return values as an array of finite numbers; None if they are something else, such as texts
    or complex numbers."""
    try:
        array = np.asarray(values)
        array = array.astype(float) if array.dtype.kind in "fiuO" else np.full(1, math.nan)
    except (TypeError, ValueError, OverflowError):
        return None
    return array if np.isfinite(array).all() else None


def one_line(value: object) -> str:
    """Return the start of a value as text for messages, also of arrays, in one line."""
    return " ".join(repr(value).split())[:60]


def between(
    argument: Any, name: str, low: float = 0.0, high: float = math.inf, *, above: bool = False
) -> float:
    """Return the argument as a finite number, which must be between limits.

    Parameters
    ----------
    low, high : float
        Limits; default 0 and infinity.
    above : bool
        True if the number must be larger than `low`; default False.

    Raises
    ------
    UsageError
        The argument is not a number between the limits.
    """
    number = number_of(argument, name)
    if (
        number is None
        or not low <= number <= high
        or math.isinf(number)
        or (above and number == low)
    ):
        maximum_text = f" to {high:g}" if math.isfinite(high) else ""
        raise UsageError(
            f"{name} must be a number {'above' if above else 'from'} {low:g}{maximum_text}, got "
            f"{argument!r:.60}"
        )
    return number


def ratio_of(argument: Any, name: str) -> float | None:
    """Convert a number or a text such as `0.1%` to a float; None is returned unchanged.

    Raises
    ------
    UsageError
        The argument is not a number, a ratio or None.
    """
    return parse_ratio(argument) if isinstance(argument, str) else number_of(argument, name)


def numbers_of(argument: Any, name: str) -> NDArray[np.float64]:
    """Convert a number or a sequence of numbers to an array with a single axis.

    The values are not checked: nan and infinite numbers are accepted.

    Raises
    ------
    UsageError
        The argument contains an item that is not a number or is masked, or it has several axes.
    """
    # Invalid arguments become an array with two axes, which is rejected below.
    try:
        has_masked_entry = np.any(getattr(argument, "mask", False))
        numbers = (
            np.empty((0, 0))
            if has_masked_entry
            else np.atleast_1d(np.asarray(argument, dtype=np.float64))
        )
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty((0, 0))
    if numbers.ndim != 1:
        raise UsageError(
            f"{name} must be a sequence of numbers, got {' '.join(repr(argument).split()):.60}"
        )
    return numbers


def damping_of(argument: Any) -> float:
    """Convert a number or a text such as `5%` to a damping ratio from 0 to less than 1.

    Raises
    ------
    UsageError
        The argument is not such a ratio.
    """
    ratio = ratio_of(argument, "damping")
    if ratio is None or not 0.0 <= ratio < 1.0:
        raise UsageError(f"damping must be a ratio in [0, 1), got {argument!r:.60}")
    return ratio


def drift_of(argument: Any) -> DriftSize:
    """Convert a text such as `2%`, `20mm` or `4dy` (yield drifts), or a drift ratio, to a drift.

    Raises
    ------
    UsageError
        The argument is not such a text and not a number.
    """
    if isinstance(argument, DriftSize):
        return argument
    return parse_drift(argument if isinstance(argument, str) else str(number_of(argument, "drift")))


def is_list(argument: Any) -> bool:
    """Return True for a list, a tuple or an array with at least one axis."""
    return isinstance(argument, list | tuple) or getattr(argument, "ndim", 0) > 0


def for_each_method(function: Callable[..., Any], arguments: dict[str, Any]) -> ResultList[Any]:
    """Return the results of a function for each method with each time step.

    Parameters
    ----------
    arguments : dict
        Arguments of the function. One of `method` and `dt`, or both, are a list.
    """
    method, dt = arguments.pop("method"), arguments.pop("dt")
    methods = method if isinstance(method, list | tuple) else (method,)
    steps = numbers_of(dt, "dt").tolist() if is_list(dt) else (dt,)
    return ResultList(function(**arguments, method=name, dt=h) for name in methods for h in steps)


def _type_name(argument: Any) -> str:
    """Return the type of an argument for messages, such as `None` or `a list`."""
    return "None" if argument is None else f"a {type(argument).__name__}"


@contextmanager
def named_sample(numbers: list[float], value: float, samples: Sequence[int]) -> Iterator[None]:
    """Return a context for the check of a value. The message of a UsageError of the check gets the
    number of the first sample with this value.

    Parameters
    ----------
    value : float
        Item of `numbers` that the body of the context checks. The items are checked in order, so
        that no item before it is an invalid nan.
    samples : sequence of int
        Numbers of the samples, from 0; `samples[i]` has the value `numbers[i]`.
    """
    try:
        yield
    except UsageError as error:
        # nan differs from nan, so the second condition detects an invalid nan. Every nan is
        # invalid, and the first nan in `numbers` fails before any later value is checked.
        position = next(
            i
            for i, checked_value in enumerate(numbers)
            if checked_value == value or math.isnan(checked_value)
        )
        raise UsageError(f"{error} (sample {samples[position]}, counted from 0)") from None


def as_sequence(argument: Any, name: str) -> Sequence[Any]:
    """Return a list or tuple as a list, and any other argument as a list with a single item.

    Raises
    ------
    UsageError
        The list is empty.
    """
    items = list(argument) if isinstance(argument, list | tuple) else [argument]
    if not items:
        raise UsageError(f"{name} must contain at least one item, got an empty sequence")
    return items
