"""Exceptions of tdint.

The message of each exception states the error, its location and the remedy. The class determines
the exit code of the command.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Self

_MAX_LINE_LENGTH, _HEAD_LENGTH, _TAIL_LENGTH = 1000, 700, 250
"""Maximum number of characters of a line of a message, and numbers of characters that are kept at
the start and at the end of a longer line. Lines are long if they quote a long input. 1000
characters are about ten lines on a terminal.
"""

_CONTROL = (
    "[\\x00-\\x1f\\x7f-\\x9f\\xad\\u061c\\u115f\\u1160\\u17b4\\u17b5\\u180b-\\u180f\\u200b"
    "\\u200e\\u200f\\u2028-\\u202e\\u2060-\\u206f\\u3164\\ufe00-\\ufe0f\\ufeff\\uffa0\\ufff0-\\ufffb"
    "\\ud800-\\udc7f\\udd00-\\udfff\\U0001bca0-\\U0001bca3\\U0001d173-\\U0001d17a"
    "\\U000e0000-\\U000e0fff]"
)
"""Characters that terminals execute, that break lines or change the direction of the text, or that
are invisible (Default_Ignorable_Code_Point of Unicode 16 except the joiners U+200C and U+200D,
which words of Persian and Hindi need) and could hide a part, and unpaired surrogates. Surrogates
U+DC80 to U+DCFF, which represent bytes that Python could not decode, are not included."""


def write_out_controls(text: str, *, keep: str = "") -> str:
    """Return a text from a file for any output, with its control characters written out as escape
    sequences such as \\x1b, except the characters in `keep`."""
    return re.sub(
        _CONTROL,
        lambda match: match[0] if match[0] in keep else match[0].encode("unicode_escape").decode(),
        text,
    )


class TdintError(Exception):
    """Base class of all errors that a user can cause and correct.

    The middle of long lines of the message, which may quote the input, is omitted.

    Attributes
    ----------
    exit_code : int
        Exit code of the command.
    """

    exit_code = 1

    def __init__(self, message: str = "") -> None:
        super().__init__(abridged(message))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the function, the arguments and the state that pickle needs to restore the
        error."""
        # By default, unpickling calls `__init__` with the message. This fails for subclasses with
        # other arguments, and a process pool would wait forever for such an error. Therefore
        # `_unpickle` does not call `__init__`.
        return _unpickle, (type(self), self.args), vars(self)


def _unpickle(error_type: type[TdintError], arguments: tuple[Any, ...]) -> TdintError:
    """Create an exception from its `args` for pickle, without calling its `__init__`."""
    return error_type.__new__(error_type, *arguments)


class UsageError(TdintError):
    """Invalid argument: an unknown method, a parameter out of range, an invalid time step."""

    exit_code = 2


class ModelFault(NamedTuple):
    """Error in a model file.

    Attributes
    ----------
    source : str
        Name of the file.
    line, column : int
        Position, starting from 1; both are 0 for a model without a file.
    key : str
        Key of the model with the error, such as `stories[2].mass`.
    message : str
        Description of the error.
    """

    source: str
    line: int
    column: int
    key: str
    message: str

    def __str__(self) -> str:
        location = f"{self.source}:{self.line}:{self.column}: " if self.line else f"{self.source}: "
        return location + (f"{self.key}: {self.message}" if self.key else self.message)


MAX_LISTED_FAULTS = 100
"""Maximum number of errors in the message of a file. A file of another type can have an error in
each of its lines."""


class ModelError(TdintError):
    """Invalid model file.

    Attributes
    ----------
    faults : tuple of ModelFault
        All errors of the file, in the order of their position.
    """

    exit_code = 3

    def __init__(self, faults: Sequence[ModelFault] | str) -> None:
        self.faults: tuple[ModelFault, ...] = () if isinstance(faults, str) else tuple(faults)
        if isinstance(faults, str):
            super().__init__(faults)
            return
        lines = list(map(str, self.faults[:MAX_LISTED_FAULTS]))
        if omitted := len(self.faults) - len(lines):
            lines.append(
                f"{self.faults[0].source}: {omitted} more errors, {len(self.faults)} in total"
            )
        super().__init__("\n".join(lines))


class RecordError(TdintError):
    """Ground-motion record that is invalid or incomplete."""

    exit_code = 4

    def located(self, place: str) -> Self:
        """Return the error with the place before its message; class and attributes are kept.

        Parameters
        ----------
        place : str
            Place of the error, such as the name of the file.
        """
        error = type(self).__new__(type(self), abridged(f"{place}: {self}"))
        vars(error).update(vars(self))
        return error


class AnalysisError(TdintError):
    """Analysis without a result: not converged, diverged, or with a time step above the stability
    limit.
    """

    exit_code = 5


class OutputError(TdintError):
    """Output that cannot be written."""

    exit_code = 6


def abridged(text: str) -> str:
    """Return a text without the middle part of each line above 1000 characters.

    Such a line keeps its first 700 and its last 250 characters, with ` ... ` between them.
    """
    if len(text) <= _MAX_LINE_LENGTH:
        return text
    return "\n".join(
        line
        if len(line) <= _MAX_LINE_LENGTH
        else f"{line[:_HEAD_LENGTH]} ... {line[-_TAIL_LENGTH:]}"
        for line in text.split("\n")
    )


def nearest(name: str, names: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Return the valid name that is most similar to an unknown name; None if no name is similar.

    Parameters
    ----------
    name : str
        The unknown name. Upper and lower case are equivalent.
    cutoff : float
        Minimum similarity, between 0 and 1, of `difflib.get_close_matches`.
    """
    from difflib import get_close_matches

    # The time of the comparison is quadratic in the length of the name, which may be a complete
    # sentence by mistake. Therefore compare only the first 100 characters.
    names_by_lower_case = {candidate.lower(): candidate for candidate in names}
    similar_names = get_close_matches(name[:100].lower(), names_by_lower_case, n=1, cutoff=cutoff)
    return names_by_lower_case[similar_names[0]] if similar_names else None


def did_you_mean(name: str, names: Iterable[str], cutoff: float = 0.6) -> str:
    """Return the end of a message about an unknown name, such as `; did you mean 'mass'?`.

    Parameters
    ----------
    names : iterable of str
        The valid names.
    cutoff : float
        Minimum similarity, between 0 and 1, as in `nearest`. Without a name this similar, the
        result is empty.
    """
    similar = nearest(name, names, cutoff)
    return f"; did you mean {similar!r}?" if similar else ""
