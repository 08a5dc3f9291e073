"""Options for reading and processing records; `tdint.ground_motion.processing_steps` applies them.

The processing steps are always applied in this order: trim, baseline, pad, filters, resample,
time_scale. Therefore the mean is computed for the trimmed record, the filters are applied to a
record between zeros, and the padding contains the signal that a filter spreads outside the ends of
the record. Without `pad`, filters add the padding that they need.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from fnmatch import fnmatchcase
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ClassVar, Self

from tdint.errors import RecordError, UsageError
from tdint.files import pattern_of

SAME_STEP = 1e-3
"""Maximum relative difference of two statements of the sampling interval that agree."""

MAX_SKIPPED_LINES = 1_000_000  # lines; maximum to skip, a larger number is an input error

BASELINES = ("constant", "linear", "quadratic")
DEFAULT_FILTER_ORDER = 4  # default order of the filters: 24 dB per octave in each of two passes
MAX_FILTER_ORDER = 10  # maximum order of the filters; steeper than required in practice


class _OptionalFields:
    """Base of data classes with optional fields; a field is not set if it is `None`, empty or
    False."""

    def set_fields(self) -> dict[str, Any]:
        """Return names and values of the fields that are set."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {
            name: value
            for name, value in values.items()
            if value not in (None, ()) and value is not False
        }

    def __bool__(self) -> bool:
        """Return True if at least one field is set."""
        return bool(self.set_fields())

    def over(self, other: Self) -> Self:
        """Return a copy of `other` with the fields that are set in this object.

        Parameters
        ----------
        other : object of the same class
            Source of the fields that are not set here.
        """
        return replace(other, **self.set_fields())  # type: ignore[type-var]


@dataclass(frozen=True)
class TextLayout(_OptionalFields):
    """Layout of text tables, for properties that the files do not state; a contradiction between
    the layout and a file is an error.

    Attributes
    ----------
    step : float | None
        Sampling interval, s. If a file states a sampling interval, the two are compared.
    column : tuple of str
        Columns to read, as numbers counted from 1 or as names; a single column may be specified
        without a tuple. If empty, the columns named as acceleration are read. If no column is named
        as acceleration, all columns except the time are read.
    skip_lines : int | None
        Number of lines to ignore before the table or its line of column names.
    rows : bool
        The values of a line are successive samples of a single ground motion, which the next line
        continues. Default False: the file shows it, or the columns are separate ground motions.
    one_sided : bool
        The samples are a pulse of one sign, in any format. Default False: a motion with samples of
        one sign has a warning, and a table without names or a column without a header is refused,
        because spectra, lists of peaks and resultants are also of one sign.

    Raises
    ------
    UsageError
        A value is invalid for any table.
    """

    step: float | None = None
    column: tuple[str, ...] = ()
    skip_lines: int | None = None
    rows: bool = False
    one_sided: bool = False
    is_resampled: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Validate the values, and convert the columns to a tuple of texts."""
        # In Python, True and False are also numbers; they are not accepted here.
        step: Any = self.step
        is_number = isinstance(step, Real) and not isinstance(step, bool)
        if step is not None and not (is_number and math.isfinite(step) and step > 0.0):
            raise UsageError(f"`step`: must be a positive number, got {step!r}")
        requested: Any = self.column
        columns = (requested,) if isinstance(requested, str | int) else requested
        if not isinstance(columns, tuple | list) or not all(str(name).strip() for name in columns):
            raise UsageError(
                f"`column`: must be the number or the name of a column, got {requested!r}"
            )
        object.__setattr__(self, "column", tuple(str(name).strip() for name in columns))
        skipped: Any = self.skip_lines
        if skipped is not None and not (
            isinstance(skipped, Integral)
            and not isinstance(skipped, bool)
            and 0 <= int(skipped) <= MAX_SKIPPED_LINES
        ):
            raise UsageError(
                f"`skip_lines`: must be a whole number from 0 to {MAX_SKIPPED_LINES}, got "
                f"{skipped!r}"
            )
        for name in ("rows", "one_sided"):
            if not isinstance(value := getattr(self, name), bool):
                raise UsageError(f"`{name}`: must be true or false, got {value!r}")
        if self.rows and self.column:
            raise UsageError(
                "`rows` and `column` cannot be combined: either the lines continue one ground "
                "motion, or its samples are in a column; remove one"
            )

    def check_format(self, name: str) -> None:
        """Raise RecordError if the layout specifies rows, columns or lines to skip, because a file
        of the format `name` is not a text table.

        Parameters
        ----------
        name : str
            Name of the file format.
        """
        options = {
            f"column={', '.join(self.column)}": bool(self.column),
            f"skip_lines={self.skip_lines}": self.skip_lines is not None,
            "rows": self.rows,
        }
        if option := next((option for option, is_set in options.items() if is_set), ""):
            raise RecordError(
                f"`{option}` cannot be used with the file format {name}; it applies only to text "
                "tables, remove it"
            )

    def has_step(self, dt: float) -> bool:
        """Return True if `step` is specified and equal to a sampling interval.

        Parameters
        ----------
        dt : float
            Sampling interval, s.
        """
        return self.step is not None and math.isclose(dt, self.step, rel_tol=SAME_STEP)

    def check_step(self, dt: float) -> None:
        """Raise RecordError if the sampling interval `dt` (s) of a file differs from `step`.

        Parameters
        ----------
        dt : float
            Sampling interval in the file, s.
        """
        if self.step is not None and not self.has_step(dt):
            raise RecordError(
                f"the sampling interval in the file is {dt:.9g} s, which contradicts "
                f"`step={self.step:.9g}`; remove it, or compress the time by "
                f"`time_scale={self.step / dt:.6g}`"
            )


class ResampledLayout(TextLayout):
    """Layout of a record that is resampled: samples at unequal times are interpolated."""

    is_resampled = True


AS_STATED = TextLayout()
"""Layout without any user-specified property."""


@dataclass(frozen=True)
class Processing(_OptionalFields):
    """Processing steps for records; a step is omitted if its value is `None`.

    Attributes
    ----------
    trim : tuple of two floats | None
        Start and end of the part to keep, s from the first sample. None as the start keeps the
        beginning of the record, None as the end keeps its end.
    baseline : str | None
        Baseline that is subtracted from the acceleration: `constant` (mean), `linear`
        (least-squares line) or `quadratic` (least-squares parabola).
    pad : tuple of two floats | None
        Durations of zeros added before and after the record, s. If None, filters add zeros until
        their transients have decayed.
    highpass, lowpass : float | None
        Corner frequencies, Hz, of zero-phase Butterworth filters, which are applied forwards and
        backwards and therefore halve the amplitude at the corner frequency.
    filter_order : int | None
        Order of the filters; 4 if None.
    resample : float | None
        New sampling interval, s, of the band-limited motion. An anti-aliasing filter is applied if
        the new interval is longer. Samples of a table at unequal times are first interpolated.
    time_scale : float | None
        Factor on the times of the processed record, such as 0.2 for a model on a shake table at a
        length scale of 1:25. Accelerations do not change.

    Raises
    ------
    UsageError
        A value is invalid for any record.
    """

    trim: tuple[float | None, float | None] | None = None
    baseline: str | None = None
    pad: tuple[float, float] | None = None
    highpass: float | None = None
    lowpass: float | None = None
    filter_order: int | None = None
    resample: float | None = None
    time_scale: float | None = None

    def __post_init__(self) -> None:
        for problem in _problems(self):
            raise UsageError(problem)


@dataclass(frozen=True)
class RecordChoice:
    """Options of `tdint.read_record` for a file, and the processing steps.

    Attributes
    ----------
    described : tuple of (str, RecordChoice)
        Files, patterns and directories with separate options, from descriptions of records.
    quantity : str
        Quantity that the samples must have, `displacement` or `velocity`. The acceleration is then
        linear between the samples and has exactly this motion. Empty for any quantity.
    """

    units: str | Mapping[str, str] | None = None
    component: str | None = None
    inventory: str | Path | None = None
    processing: Processing = field(default_factory=Processing)
    layout: TextLayout = AS_STATED
    described: tuple[tuple[str, RecordChoice], ...] = ()
    quantity: str = ""

    def of(self, file: str) -> RecordChoice:
        """Return the options for a file, from the first description that contains it, its
        directory or a pattern of its name; otherwise these options."""
        for source, choice in self.described:
            if (
                file == source
                or fnmatchcase(file, pattern_of(source))
                or file.startswith(f"{source.rstrip('/')}/")
            ):
                return choice
        return self

    def over(self, other: RecordChoice) -> RecordChoice:
        """Return a copy of `other` with the options that are set in this object."""
        specified = {
            name: value
            for name in ("units", "component", "inventory")
            if (value := getattr(self, name)) is not None
        }
        processing, layout = self.processing.over(other.processing), self.layout.over(other.layout)
        return replace(other, **specified, processing=processing, layout=layout)


def parse_trim(text: str) -> tuple[float | None, float | None]:
    """Parse the bounds of a trim from `START:END`, s; either bound may be omitted.

    Returns
    -------
    tuple of two (float or None)
        Start and end, s from the first sample; None for an omitted bound.

    Raises
    ------
    UsageError
        The text has another form.
    """
    # A text with another number of parts also raises ValueError, because it cannot be unpacked.
    try:
        start, end = (float(part) if part.strip() else None for part in text.split(":"))
    except ValueError:
        raise UsageError(f"trim must be START:END in seconds, got {text!r}") from None
    return start, end


def parse_pad(text: str) -> tuple[float, float]:
    """Parse the durations of zeros before and after a record from `BEFORE:AFTER`, s, or from one
    number for both.

    Raises
    ------
    UsageError
        The text has another form.
    """
    try:
        before, after = map(float, text.split(":") if ":" in text else (text, text))
    except ValueError:
        raise UsageError(f"pad must be SECONDS or BEFORE:AFTER, got {text!r}") from None
    return before, after


def _problems(steps: Processing) -> Iterator[str]:
    """Yield an error message for each invalid value or combination of values; none after a trim or
    pad that is not a pair."""
    for name in ("highpass", "lowpass", "resample", "time_scale"):
        value = getattr(steps, name)
        if value is not None and not 0.0 < value < math.inf:
            yield f"{name} must be a positive number, got {value}"
    if steps.baseline is not None and steps.baseline not in BASELINES:
        names = f"{', '.join(BASELINES[:-1])} or {BASELINES[-1]}"
        yield f"baseline must be {names}, got {steps.baseline!r}"
    for name in ("trim", "pad"):
        pair = getattr(steps, name)
        if pair is not None and not (isinstance(pair, tuple | list) and len(pair) == 2):
            yield f"{name} must be a pair of numbers, got {pair!r}"
            return
    # Both values are pairs here, because the loop above returns otherwise.
    if steps.trim is not None:
        start = 0.0 if steps.trim[0] is None else steps.trim[0]
        end = math.inf if steps.trim[1] is None else steps.trim[1]
        if not 0.0 <= start < end or tuple(steps.trim) == (None, None):
            yield "trim must be START:END in seconds from the first sample with START below END"
    # One of the two durations may be zero, but not both.
    if steps.pad is not None and not (min(steps.pad) >= 0.0 < sum(steps.pad) < math.inf):
        yield f"pad must be a positive number of seconds, got {steps.pad[0]:g}:{steps.pad[1]:g}"
    if steps.filter_order is not None and steps.filter_order not in range(1, MAX_FILTER_ORDER + 1):
        yield (
            f"filter_order must be a whole number from 1 to {MAX_FILTER_ORDER}, got "
            f"{steps.filter_order}"
        )
    if steps.filter_order is not None and steps.highpass is None and steps.lowpass is None:
        yield "filter_order requires highpass or lowpass; specify one of them"
    if steps.highpass is not None and steps.lowpass is not None and steps.highpass >= steps.lowpass:
        yield (
            f"highpass ({steps.highpass:g} Hz) must be below lowpass ({steps.lowpass:g} Hz), "
            "otherwise the filters remove the entire motion"
        )
