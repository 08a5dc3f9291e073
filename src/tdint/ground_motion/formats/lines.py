"""The lines of a text file and the numbers in them, read one after another; the interval of the
times among them."""

from __future__ import annotations

import os
import re
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.written_numbers import how_many

_WIDE = (b"\xff\xfe", b"\xfe\xff")
"""Byte-order marks of text in UTF-16, as spreadsheets save it."""

_HEAD = 8192
_LARGEST = 2**26
_LONGEST_LINE = 2**22
_LONGEST_WORD = 1000
_HEADER_LINE = 1000
"""Characters of a line of words that are looked at: patterns take their time with endless ones."""

_FEW, _ROWS = 5, 50
"""Rows by which a last number that is cut off is known."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[Ee][-+]?\d+)?"
"""Pattern of a number in a header."""

COUNT = r"\d{1,12}"
"""Pattern of a number of samples in a header."""

ROW = re.compile(r"[-+.,;\dEeDd\s]*\d[-+.,;\dEeDd\s]*")
"""Lines made of the characters of numbers and of what may stand between them."""

_NUMBER = NUMBER.replace("Ee", "EeDd")
_ONE = re.compile(_NUMBER)
_GLUED = re.compile(rf"{_NUMBER}(?:(?=[-+]){_NUMBER})*")
"""Numbers that a sign alone divides, as Fortran writes them where they fill their columns."""

_PLAIN = re.compile(r"[-+.\dEe\s]*")
"""Characters of the numbers that float() may read; it would take nan and 1_000 as well."""

_MOST_DECIMALS = 9
_FINEST = 40
"""Parts that an interval between printed times is divided into at most."""

_SHORTEST, _LATEST = 1e-6, 1e9
_SLIP = 0.02
"""Part of an interval by which a time may be off, beside its rounding."""


class Lines:
    """The lines of a text file, read one after another.

    Parameters
    ----------
    text : str
        The whole file.
    """

    def __init__(self, text: str) -> None:
        self._lines = text.split("\n")
        self._is_whole = not self._lines[-1]
        if self._is_whole:
            self._lines.pop()
        self._next = 0

    @property
    def number(self) -> int:
        """The line read last, counted from 1."""
        return self._next

    def skip(self, count: int) -> None:
        """Pass over so many lines.

        Raises
        ------
        RecordError
            There are fewer.
        """
        if self._next + count > len(self._lines):
            raise RecordError(f"there are {len(self._lines)} lines, fewer than the {count} to skip")
        self._next += count

    def peek(self) -> str | None:
        """The beginning of the next line that is not blank, None at the end; what is before it is
        passed over."""
        while self._next < len(self._lines):
            line = self._lines[self._next]
            if line and not line.isspace():
                return _beginning(line)
            self._next += 1
        return None

    def at_numbers(self) -> bool:
        """Whether the next line that is not blank holds numbers and nothing else."""
        return is_row_of_numbers(self.peek())

    def take(self) -> str:
        """The next line, blank or not; of an endless one the beginning.

        Raises
        ------
        RecordError
            There is none.
        """
        return _beginning(self._take())

    def _take(self) -> str:
        if self._next >= len(self._lines):
            raise RecordError(f"the file is cut off: it ends with line {self._next}")
        self._next += 1
        return self._lines[self._next - 1]

    def take_until(self, accept: Callable[[str], object], expected: str) -> list[str]:
        """The lines before the next one that `accept` takes; that one is left to be read.

        Raises
        ------
        RecordError
            No line is accepted; `expected` names it.
        """
        start = self._next
        for place in range(start, len(self._lines)):
            if accept(_beginning(self._lines[place])):
                self._next = place
                return list(map(_beginning, self._lines[start:place]))
        raise RecordError(
            f"the file is cut off or damaged: after line {start} there is no {expected}"
        )

    def numbers(self, count: int, width: int | None = None) -> NDArray[np.float64]:
        """So many numbers, to the end of a line; shape (count,).

        Parameters
        ----------
        count : int
            What the header announces.
        width : int, optional
            Columns of a number where the format fixes them, for numbers without a blank or a sign
            between them.

        Raises
        ------
        RecordError
            There are fewer or more, something else stands among them, or the last one is cut off.
        """
        values = array("d")
        first = self._next
        while len(values) < count:
            if self.peek() is None:
                raise RecordError(
                    f"the file is cut off: {count} values are announced after line {first}, there "
                    f"are {len(values)}"
                )
            values.extend(self._row(width))
        if len(values) > count:
            raise RecordError(
                f"more than the {count} values that are announced stand after line {first}"
            )
        return self.checked(values, first)

    def table(self, rows: int, columns: int) -> NDArray[np.float64]:
        """So many rows of so many numbers; shape (columns, rows).

        Raises
        ------
        RecordError
            There are fewer, a row has more or fewer numbers, or the last one is cut off.
        """
        values = array("d")
        first = self._next
        while len(values) < rows * columns:
            if self.peek() is None:
                count = len(values) // columns
                raise RecordError(
                    f"the file is cut off: {rows} rows are announced after line {first}, there are "
                    f"{count}"
                )
            values.extend(self._row_of(columns))
        return self.checked(values, first).reshape(-1, columns).T.copy()

    def rest(self, columns: int) -> NDArray[np.float64]:
        """All rows to the end of the file, each of so many numbers; shape (columns, rows)."""
        values = array("d")
        first = self._next
        while self.peek() is not None:
            values.extend(self._row_of(columns))
        return self.checked(values, first).reshape(-1, columns).T.copy()

    def expect_end(self) -> None:
        """Raise RecordError if anything but blank lines is left."""
        if self.peek() is not None:
            raise RecordError(
                f"line {self._next + 1} stands after the last row that the header announces"
            )

    def _row_of(self, columns: int) -> list[float]:
        row = self._row(None)
        if len(row) != columns:
            raise RecordError(
                f"line {self._next} holds {how_many(len(row), 'number')}, not {columns}"
            )
        return row

    def _row(self, width: int | None) -> list[float]:
        line = self._take()
        try:
            return row_of_numbers(line, width)
        except ValueError:
            raise RecordError(
                f"line {self._next}: {line.strip()[:60]!r} stands where numbers should"
            ) from None

    def checked(self, values: array[float], first: int) -> NDArray[np.float64]:
        """The values of the rows after line `first`, up to the last line taken; shape (values,).

        Where the file ends without an end of line, its last number must have as many places after
        the point as the last numbers of the rows before it, if these all have the same.

        Raises
        ------
        RecordError
            A value is too large for a float, or the last one is cut off.
        """
        numbers = np.array(values, dtype=np.float64)
        if not np.all(np.isfinite(numbers)):
            raise RecordError(f"a value after line {first} is beyond 1.8e308")
        if self._is_whole or self._next < len(self._lines) or not ROW.fullmatch(self._lines[-1]):
            return numbers

        # Zeros written without a point tell nothing in a file that has several of them.
        if _ends_with_zero(self._lines[-1]) and any(map(_ends_with_zero, self._lines[first:-1])):
            return numbers

        # Places of the last numbers of the rows before; in a file of few long rows, of the numbers
        # of the last one.
        last = _places(self._lines[-1])
        rows = self._lines[max(first, len(self._lines) - _ROWS) : -1]
        before = (
            [places[-1] for places in map(_places, rows) if places]
            if len(rows) >= _FEW
            else last[:-1]
        )
        if len(before) >= _FEW and len(set(before)) == 1 and last[-1] < before[0]:
            raise RecordError("the file is cut off within its last number")
        return numbers


def row_of_numbers(line: str, width: int | None = None) -> list[float]:
    """The numbers in a line, at blanks, signs or, if need be, fixed columns.

    Raises
    ------
    ValueError
        The line holds something else.
    """
    if len(line) > _LONGEST_LINE:
        raise ValueError("no row of numbers")
    words = line.split()
    if len(line) > _LONGEST_WORD and max(map(len, words), default=0) > _LONGEST_WORD:
        raise ValueError("no row of numbers")
    if _PLAIN.fullmatch(line):
        try:
            return list(map(float, words))
        except ValueError:
            pass
    if all(map(_GLUED.fullmatch, words)):
        return [_to_float(part) for word in words for part in _ONE.findall(word)]
    if width is None:
        raise ValueError("no row of numbers")
    end = len(line.rstrip())  # that of the last field: numbers stand at the right of theirs
    fields = [line[i : i + width].strip() for i in range(end % width, end, width)]
    if line[: end % width].strip() or not all(map(_ONE.fullmatch, fields)):
        raise ValueError("no row of numbers in fixed columns")
    return [_to_float(field) for field in fields]


def is_row_of_numbers(line: str | None) -> bool:
    """Whether a line holds numbers, one at least, and nothing else."""
    try:
        return bool(line and row_of_numbers(line))
    except ValueError:
        return False


def read_lines(file: Any, *, text_only: bool = False) -> Lines:
    """All lines of a file (name, path, or object open for reading bytes).

    Raises
    ------
    RecordError
        The file is larger than 64 MiB, or with `text_only` begins with bytes that no text has.
    """
    data = _read(file, _LARGEST + 1)
    if len(data) > _LARGEST:
        raise RecordError("the file is larger than 64 MiB; cut the event out of it first")
    if text_only and _is_binary(data[:_HEAD]):
        raise RecordError("this is no text")
    return Lines(_decode(data))


def recognizes(file: Any, check: Callable[[list[str]], object]) -> bool:
    """Whether a check accepts the first whole lines of a file; False whatever goes wrong.

    Parameters
    ----------
    file : str, Path or object open for reading bytes
        Left at its position.
    check : callable
        Takes a list of lines.
    """
    try:
        position = file.tell() if hasattr(file, "read") else None
        data = _read(file, _HEAD)
        if position is not None:
            file.seek(position)
        if _is_binary(data):
            return False
        *lines, last = _decode(data).split("\n")
        # A last line that is cut off counts only if a long line of values begins in it.
        if len(data) < _HEAD or len(last) > _HEADER_LINE:
            lines.append(last)
        return bool(check(list(map(_beginning, lines))))
    except Exception:  # A check that stumbles over foreign bytes has not recognized them.
        return False


def _is_binary(data: bytes) -> bool:
    return b"\0" in data and data[:2] not in _WIDE


def _beginning(line: str) -> str:
    """As much of a line as words or the first numbers of a long row take, to a blank."""
    if len(line) <= _HEADER_LINE:
        return line
    return line[:_HEADER_LINE].rpartition(" ")[0] or line[:_HEADER_LINE]


def _read(file: Any, size: int) -> bytes:
    if not hasattr(file, "read"):
        with Path(os.fspath(file)).open("rb") as stream:
            return stream.read(size)
    data = file.read(size)
    return data if isinstance(data, bytes) else bytes(data)


def _decode(data: bytes) -> str:
    """Text with LF ends; names of stations may be in any encoding, numbers are the same in all."""
    try:
        text = data.decode("utf-16" if data[:2] in _WIDE else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    # DOS marked the end of a text with Ctrl-Z.
    return text.rstrip("\x1a\0").replace("\r\n", "\n").replace("\r", "\n")


def _to_float(number: str) -> float:
    return float(number.replace("D", "E").replace("d", "e"))


def _ends_with_zero(line: str) -> bool:
    return line.split()[-1:] == ["0"]


def _places(line: str) -> list[int]:
    """The number of characters after the point of each number in a line."""
    return [len(number.partition(".")[2]) for number in _ONE.findall(line)]


def equal_steps(times: NDArray[np.float64], slack: float = 0.0) -> tuple[float, float]:
    """Sampling interval of printed times, s, and how far they are from equal steps, s; 0 if
    rounding explains it.

    Parameters
    ----------
    times : ndarray, shape (samples,)
        s, rounded to some decimal.
    slack : float
        Part of the duration by which a time may depart from equal steps: film turned unevenly.

    Raises
    ------
    RecordError
        The times do not grow, or not in equal steps.
    """
    if times.size < 2:
        raise RecordError("one sample only; a record needs two at least")
    if np.max(np.abs(times)) > _LATEST:
        raise RecordError(f"the times go up to {np.max(np.abs(times)):g} s")
    intervals = np.diff(times)
    if not np.all(intervals > 0.0):
        place = int(np.argmin(intervals > 0.0))
        raise RecordError(
            f"the times do not grow after sample {place} (counted from 0) at {times[place]:g} s"
        )
    duration = float(times[-1] - times[0])
    rounding = _rounding(times)
    dt = duration / (times.size - 1)
    # A whole number of samples per second, if there is one within the rounding of the times.
    rate = round(1.0 / dt) if dt > _SHORTEST else 0
    is_whole = rate and abs(1.0 / rate - dt) <= rounding / (times.size - 1)
    dt = 1.0 / rate if is_whole else float(f"{dt:.12g}")
    allowed = max(min(1.5 * rounding, 0.5 * dt), _SLIP * dt)
    off_interval = np.abs(intervals - dt)
    off_grid = np.abs(times - times[0] - dt * np.arange(times.size))
    departure = float(max(np.max(off_grid), np.max(off_interval)))
    if departure <= allowed * (1.0 + 1e-6):
        return dt, 0.0
    if departure <= slack * duration:
        return dt, departure
    place = int(np.argmax(off_interval))
    raise RecordError(
        f"the samples are not at equal steps of {dt:.6g} s: they are {intervals[place]:.6g} s "
        f"apart after {times[place]:g} s, and up to {np.max(off_grid):.3g} s off; resample the "
        "record to equal steps first"
    )


def finest_step(times: NDArray[np.float64], mean: float) -> float:
    """A step on which all of printed times lie, s: their last decimal, or a small part of their
    mean interval."""
    return max(_rounding(times), mean / _FINEST)


def _rounding(times: NDArray[np.float64]) -> float:
    """Value of the last decimal that the times need, s."""
    scale = float(np.max(np.abs(times)))
    for decimals in range(_MOST_DECIMALS):
        if np.max(np.abs(times - np.round(times, decimals))) <= 1e-14 * scale:
            return float(10.0**-decimals)
    return float(10.0**-_MOST_DECIMALS)
