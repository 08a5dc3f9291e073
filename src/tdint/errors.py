"""The errors of tdint. Each says what, where and what to do, and carries the exit code of its
kind."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

_LONGEST, _HEAD, _TAIL = 1000, 700, 250
"""Characters of a line of a message, and what is kept of the beginning and the end of a longer
one."""


class TdintError(Exception):
    """Base of all errors that a user can cause and mend. `exit_code` is the command's exit code.

    A message may quote what the user wrote; of lines that grow too long by it the middle is left
    out.
    """

    exit_code = 1

    def __init__(self, message: str = "") -> None:
        super().__init__(abridged(message))

    def __reduce__(self) -> tuple[Any, ...]:
        # Not by `__init__`, which may take something else: where an error cannot be read a pool
        # waits for ever.
        return _again, (type(self), self.args), vars(self)


def _again(kind: type[TdintError], arguments: tuple[Any, ...]) -> TdintError:
    return kind.__new__(kind, *arguments)


class UsageError(TdintError):
    """A wrong argument: an unknown method, a parameter out of range, a step that does not fit."""

    exit_code = 2


@dataclass(frozen=True)
class ModelFault:
    """One fault of a model file: where it stands and what is wrong with it.

    Line and column count from 1; both are 0 in a model that has no file.
    """

    source: str
    line: int
    column: int
    key: str
    message: str

    def __str__(self) -> str:
        place = f"{self.source}:{self.line}:{self.column}: " if self.line else f"{self.source}: "
        return place + (f"{self.key}: {self.message}" if self.key else self.message)


class ModelError(TdintError):
    """A model file that cannot be used; `faults` holds all faults that were found, in file
    order."""

    exit_code = 3

    def __init__(self, faults: Sequence[ModelFault] | str) -> None:
        self.faults: tuple[ModelFault, ...] = () if isinstance(faults, str) else tuple(faults)
        super().__init__(faults if isinstance(faults, str) else "\n".join(map(str, faults)))


class RecordError(TdintError):
    """A ground-motion record that cannot be used as it is."""

    exit_code = 4


class AnalysisError(TdintError):
    """An analysis without a result: not converged, diverged, or a step beyond the method's
    limit."""

    exit_code = 5


class OutputError(TdintError):
    """An output that cannot be written."""

    exit_code = 6


def abridged(text: str) -> str:
    """Text whose long lines have lost their middle."""
    if len(text) <= _LONGEST:
        return text
    return "\n".join(
        line if len(line) <= _LONGEST else f"{line[:_HEAD]} ... {line[-_TAIL:]}"
        for line in text.split("\n")
    )


def nearest(name: str, names: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known name that someone may have meant, whatever its case; None if none is as alike as
    `cutoff` (of 1)."""
    from difflib import get_close_matches

    # Of a long text the first letters: the search takes the square of its length.
    by_lower = {candidate.lower(): candidate for candidate in names}
    return next(
        (
            by_lower[match]
            for match in get_close_matches(name[:100].lower(), by_lower, n=1, cutoff=cutoff)
        ),
        None,
    )


def did_you_mean(name: str, names: Iterable[str], cutoff: float = 0.6) -> str:
    """The end of a message about an unknown name: the nearest one, or nothing."""
    near = nearest(name, names, cutoff)
    return f"; did you mean {near!r}?" if near else ""
