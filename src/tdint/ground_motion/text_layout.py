"""What a user says of a text table that does not say it itself: its step, its columns, the lines before it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import isclose, isfinite
from numbers import Integral, Real
from typing import Any

from tdint.errors import RecordError, UsageError

SAME_STEP = 1e-3
"""Relative difference up to which two statements of the sampling interval agree."""

MOST_LINES = 1_000_000  # of a header: beyond any file, a mistaken number


@dataclass(frozen=True)
class TextLayout:
    """How text tables are to be read, as far as they do not tell; nothing of it overrules a file.

    Attributes
    ----------
    step : float or None
        Sampling interval, s. Other formats, and tables that tell theirs, are compared with it.
    column : tuple of str
        Columns to take, by their number, counted from 1, or their name; empty for the accelerations that the table
        names, or else all columns but that of the time. A single one may be given as it is.
    skip_lines : int or None
        Lines before the table, or its names, that are passed over whatever they hold.

    Raises
    ------
    UsageError
        Values that make no sense for any table.
    """

    step: float | None = None
    column: tuple[str, ...] = ()
    skip_lines: int | None = None

    def __post_init__(self) -> None:
        step: Any = self.step
        is_number = isinstance(step, Real) and not isinstance(step, bool)
        if step is not None and not (is_number and isfinite(step) and step > 0.0):
            raise UsageError(f"`step`: must be a positive number, got {step!r}")
        given: Any = self.column
        columns = (given,) if isinstance(given, str | int) else given
        if not isinstance(columns, tuple | list) or not all(str(name).strip() for name in columns):
            raise UsageError(f"`column`: give the number or the name of a column, got {given!r}")
        object.__setattr__(self, "column", tuple(str(name).strip() for name in columns))
        skipped: Any = self.skip_lines
        if skipped is not None and not (
            isinstance(skipped, Integral) and not isinstance(skipped, bool) and 0 <= int(skipped) <= MOST_LINES
        ):
            raise UsageError(f"`skip_lines`: must be a whole number from 0 to {MOST_LINES}, got {skipped!r}")

    def __bool__(self) -> bool:
        return any(getattr(self, field.name) not in (None, ()) for field in fields(self))

    def over(self, other: TextLayout) -> TextLayout:
        """These statements, and those of another one for what is not stated here."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(other, **{name: value for name, value in given.items() if value not in (None, ())})

    def check_format(self, name: str) -> None:
        """Raise RecordError for columns or lines of a file that is no table but of the format `name`."""
        for option, given in (("column", ", ".join(self.column)), ("skip_lines", self.skip_lines)):
            if given not in (None, ""):
                raise RecordError(
                    f"`{option}={given}` is given, but the file is {name}, which tells itself where its samples are; "
                    f"leave it out"
                )

    def check_step(self, dt: float) -> None:
        """Raise RecordError for a sampling interval (s) of a file that is not the one that the user gives."""
        if self.step is not None and not isclose(dt, self.step, rel_tol=SAME_STEP):
            raise RecordError(
                f"the file's own sampling interval is {dt:.9g} s, `step={self.step:.9g}` contradicts it; leave it out"
            )


AS_STATED = TextLayout()
"""The user says nothing."""
