"""Sequential reading of lines and numbers from a text file, and the sampling interval of printed
times."""

from __future__ import annotations

import os
import re
import warnings
from array import array
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from functools import wraps
from itertools import chain
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, max_absolute
from tdint.errors import RecordError

_UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Byte-order marks of UTF-16 text, which some spreadsheets write."""

_HEAD = 8192  # bytes at the start of a file that are read to identify its format
_LARGEST = 2**26  # bytes; maximum size of a file
_LONGEST_LINE = 2**22  # characters; maximum length of a row of numbers
_LONGEST_WORD = 1000  # characters; maximum length of a number
_HEADER_LINE = 1000
"""Characters; maximum part of a header line that is searched, because patterns are slow in very
long lines."""

_MIN_ROWS, _MAX_ROWS = 5, 50
"""Minimum and maximum number of rows used to check the decimals of the last number in a file."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[Ee][-+]?\d+)?"
"""Pattern of a number in a header."""

COUNT = r"\d{1,12}"
"""Pattern of a number of samples in a header."""

ROW = re.compile(r"[-+.,;\dEeDd\s]*\d[-+.,;\dEeDd\s]*")
"""Pattern of a line that contains only characters of numbers and separators."""

_NUMBER = NUMBER.replace("Ee", "EeDd")  # D is the exponent of double precision in Fortran
_SINGLE_NUMBER = re.compile(_NUMBER)
_GLUED = re.compile(rf"{_NUMBER}(?:(?=[-+]){_NUMBER})*")
"""Pattern of numbers separated only by signs, as in Fortran output that fills its columns."""

_PLAIN = re.compile(r"[-+.\dEe\s]*")
"""Characters of numbers that float() converts; without this check it would also accept nan and
1_000."""

_MOST_DECIMALS = 9  # decimals; maximum considered in printed times
_MOST_SAMPLES = 10_000_000  # maximum number of samples of an interpolated motion
_FINEST = 40
"""Maximum number of substeps between two printed times."""

_SHORTEST, _LATEST = 1e-6, 1e9  # s; minimum sampling interval, maximum absolute time
_BLOCK = 2**14  # times that are examined together, which limits the memory
_SLIP = 0.02
"""Fraction of the sampling interval; permitted deviation of a time in addition to its rounding."""


_PART = 2**18  # bytes of a text that are examined together, which limits the memory


class TextLines(Sequence[str]):
    """Lines of a text. A line is decoded when it is used, because separate texts of the lines of a
    long record need several times the memory of its samples.

    Parameters
    ----------
    data : bytes
        Text with LF as line ends, UTF-8.
    ends : ndarray, optional
        Positions of the ends of the preceding line (-1 before the first) and of all lines of this
        sequence. Default: all lines of `data`.
    """

    def __init__(self, data: bytes, ends: NDArray[np.int32] | None = None) -> None:
        """Find the line ends of a text."""
        self._data = data
        if ends is None:
            codes = np.frombuffer(data, np.uint8)
            found = [
                (np.flatnonzero(codes[start : start + _PART] == ord("\n")) + start).astype(np.int32)
                for start in range(0, codes.size, _PART)
            ]
            first, last = np.array([[-1], [len(data)]], dtype=np.int32)
            ends = np.concatenate([first, *found, last])
        self._ends = ends

    def __len__(self) -> int:
        """Return the number of lines."""
        return self._ends.size - 1

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> TextLines: ...

    def __getitem__(self, index: int | slice) -> str | TextLines:
        """Return a line, or the successive lines of a slice."""
        if isinstance(index, slice):
            start, stop, _ = index.indices(len(self))
            return TextLines(self._data, self._ends[start : max(start, stop) + 1])
        index = range(len(self))[index]
        return self._data[self._ends[index] + 1 : self._ends[index + 1]].decode()

    def __iter__(self) -> Iterator[str]:
        """Yield the lines."""
        for text in self.parts():
            yield from text.decode().split("\n")

    def parts(self) -> Iterator[bytes]:
        """Yield the text, UTF-8, in parts of complete lines without the last line end."""
        start, last = 0, len(self)
        while start < last:
            stop = int(np.searchsorted(self._ends, self._ends[start] + _PART, side="right")) - 1
            stop = min(max(stop, start + 1), last)
            yield self._data[self._ends[start] + 1 : self._ends[stop]]
            start = stop


class Lines:
    """Lines of a text file, read sequentially.

    Parameters
    ----------
    text : str or bytes
        Content of the file; bytes are UTF-8 with LF as line ends.
    """

    def __init__(self, text: str | bytes) -> None:
        """Find the lines of a file."""
        self._lines = TextLines(text.encode() if isinstance(text, str) else text)
        # If the text ends with a newline, the text after it is empty and not a line.
        self._ends_with_newline = not self._lines[-1]
        if self._ends_with_newline:
            self._lines = self._lines[:-1]
        self._next = 0  # index of the next line, which is also the number of the last line read

    @property
    def number(self) -> int:
        """Number of the last line read, counted from 1."""
        return self._next

    def without_prefix(self, prefix: str) -> Lines:
        """Return the unread lines without a text at their start; the lines keep their numbers.

        Parameters
        ----------
        prefix : str
            Text at the start of a line; lines without this prefix are unchanged.
        """
        lines = copy(self)
        texts = [line.removeprefix(prefix) for line in self._lines]
        lines._lines = TextLines("\n".join(texts).encode())
        return lines

    def skip(self, count: int) -> None:
        """Skip `count` lines.

        Parameters
        ----------
        count : int
            Number of lines.

        Raises
        ------
        RecordError
            The file has fewer lines.
        """
        if self._next + count > len(self._lines):
            raise RecordError(
                f"the file has {len(self._lines)} lines, fewer than the {count} to skip"
            )
        self._next += count

    def back_to(self, number: int) -> None:
        """Continue after a line that has been read before.

        Parameters
        ----------
        number : int
            Number of the line, counted from 1.
        """
        self._next = number

    def peek(self) -> str | None:
        """Return the start of the next non-blank line without reading it; None at the end of the
        file. Blank lines before it are skipped."""
        while self._next < len(self._lines):
            line = self._lines[self._next]
            if line and not line.isspace():
                return _beginning(line)
            self._next += 1
        return None

    def remaining(self) -> TextLines:
        """Read all lines up to the end of the file, also blank lines and lines of any length."""
        start, self._next = self._next, len(self._lines)
        return self._lines[start:]

    def at_numbers(self) -> bool:
        """Return True if the next non-blank line contains only numbers."""
        return is_row_of_numbers(self.peek())

    def take(self) -> str:
        """Read the next line, including a blank line; return only the start of a very long line.

        Raises
        ------
        RecordError
            The file has no further line.
        """
        return _beginning(self._take())

    def _take(self) -> str:
        """Read and return the complete next line; raise RecordError at the end of the file."""
        if self._next >= len(self._lines):
            raise RecordError(f"the file is cut off: it ends with line {self._next}")
        self._next += 1
        return self._lines[self._next - 1]

    def take_until(self, accept: Callable[[str], object], expected: str) -> list[str]:
        """Read the lines before the next line for which `accept` returns a true value.

        The accepted line is read by the next call.

        Parameters
        ----------
        accept : callable
            Function of the start of a line.
        expected : str
            Description of the accepted line, for the error message.

        Returns
        -------
        list of str
            Lines before the accepted line; very long lines are cut off.

        Raises
        ------
        RecordError
            No line is accepted.
        """
        start = self._next
        for index in range(start, len(self._lines)):
            if accept(_beginning(self._lines[index])):
                self._next = index
                return list(map(_beginning, self._lines[start:index]))
        raise RecordError(f"the file is cut off or corrupt: no {expected} found after line {start}")

    def numbers(self, count: int, width: int | None = None) -> Array:
        """Read `count` numbers, which must end at the end of a line.

        Parameters
        ----------
        count : int
            Number of values stated in the header.
        width : int, optional
            Characters per number in formats with fixed columns, for numbers that are not separated
            by a blank or a sign. None: all numbers must be separated.

        Returns
        -------
        ndarray, shape (count,)
            Numbers in the order of the file.

        Raises
        ------
        RecordError
            The file has fewer or more numbers, a line contains other text, or the last number is
            cut off.
        """
        values = array("d")
        first = self._next
        while len(values) < count:
            if self.peek() is None:
                raise RecordError(
                    f"the file is cut off: the header states {count} values after line {first}, "
                    f"the file has {len(values)}"
                )
            values.extend(self._row(width))
        if 0 < count < len(values) and not any(values[count:]):
            warnings.warn(
                f"{len(values) - count} zeros after the {count} stated samples omitted",
                stacklevel=2,
            )
            del values[count:]
        if len(values) > count:
            raise RecordError(
                f"more than the {count} values stated in the header follow line {first}"
            )
        return self.checked(values, first)

    def table(self, rows: int, columns: int) -> Array:
        """Read `rows` rows with `columns` numbers per row; return shape (columns, rows).

        Parameters
        ----------
        rows, columns : int
            Size of the table in the file.

        Raises
        ------
        RecordError
            The file has fewer rows, a row has more or fewer numbers, or the last number is cut off.
        """
        values = array("d")
        first = self._next
        while len(values) < rows * columns:
            if self.peek() is None:
                count = len(values) // columns
                raise RecordError(
                    f"the file is cut off: the header states {rows} rows after line {first}, the "
                    f"file has {count}"
                )
            values.extend(self._row_of(columns))
        return self.checked(values, first).reshape(-1, columns).T.copy()

    def remaining_rows(self, columns: int) -> Array:
        """Read all rows to the end of the file, with `columns` numbers per row; return shape
        (columns, rows).

        Parameters
        ----------
        columns : int
            Number of values in each row.

        Raises
        ------
        RecordError
            A row has more or fewer numbers, or the last number is cut off.
        """
        values = array("d")
        first = self._next
        while self.peek() is not None:
            values.extend(self._row_of(columns))
        return self.checked(values, first).reshape(-1, columns).T.copy()

    def following_rows(self, width: int | None = None) -> list[list[float]]:
        """Read the successive rows of numbers, and return the numbers of each row.

        Parameters
        ----------
        width : int, optional
            Number of characters per number, as for `numbers`.

        Raises
        ------
        RecordError
            The last number is cut off.
        """
        rows = []
        first = self._next
        while (line := self.peek()) is not None and is_row_of_numbers(line, width):
            rows.append(self._row(width))
        self.checked(array("d", chain.from_iterable(rows)), first)
        return rows

    def expect_no_numbers(self, count: float) -> None:
        """Skip the text to the end of the file.

        Parameters
        ----------
        count : float
            Number of values that the header states.

        Raises
        ------
        RecordError
            A row of numbers follows.
        """
        while self.peek() is not None:
            if self.at_numbers():
                raise RecordError(
                    f"line {self._next + 1} follows the {count:g} values stated in the header, but "
                    "contains values; correct the number in the header, or remove the line"
                )
            self.take()

    def expect_aligned_end(self, width: int) -> None:
        """Raise RecordError if the file is cut off within its last number.

        The numbers of a row are right-aligned in fields of `width` characters, so that the last row
        ends at the end of a number of the row before it. A file that ends with a newline is
        complete.

        Parameters
        ----------
        width : int
            Number of characters of a number.
        """
        if self._ends_with_newline or self._next < len(self._lines) or self._next < 2:
            return
        before, last = self._lines[-2:]
        if (len(before.rstrip()) - len(last.rstrip())) % width:
            raise RecordError("the file is cut off within its last number")

    def expect_end(self) -> None:
        """Raise RecordError if a non-blank line remains in the file."""
        if self.peek() is not None:
            raise RecordError(
                f"line {self._next + 1} follows the last row stated in the header; the file must "
                "end before this line"
            )

    def _row_of(self, columns: int) -> list[float]:
        """Read the next line and return its numbers; raise RecordError unless it contains exactly
        `columns` numbers."""
        row = self._row(None)
        if len(row) != columns:
            raise RecordError(f"line {self._next} must contain {columns} numbers, got {len(row)}")
        return row

    def _row(self, width: int | None) -> list[float]:
        """Read the next line and return its numbers; raise RecordError if it has other text.
        `width` is the number of characters of a number in a format with fixed columns.
        """
        line = self._take()
        try:
            return row_of_numbers(line, width)
        except ValueError:
            raise RecordError(
                f"line {self._next} must contain numbers, got {line.strip()[:60]!r}"
            ) from None

    def checked(self, values: array[float] | Array, first: int) -> Array:
        """Return the values of rows as an array, shape (values,), after checks.

        The rows are the lines from index `first` to the last line that has been read. If the file
        ends with the last row and without a newline, its last number may be cut off. It is then
        refused if it has fewer decimals than the last numbers of the preceding rows, and all of
        these have the same number of decimals. A final 0 is accepted if another row also ends with
        0.

        Parameters
        ----------
        values : array of float, or ndarray
            Values of all rows.
        first : int
            Index of the first row, counted from 0. It is also the number, counted from 1, of the
            line before the first row, which messages state.

        Raises
        ------
        RecordError
            A value is too large for a float, or the last number is cut off.
        """
        numbers = np.asarray(values, dtype=np.float64)
        if not np.all(np.isfinite(numbers)):
            raise RecordError(f"a value after line {first} exceeds 1.8e308")
        # The last number can be cut off only if it is the end of the file.
        has_later_lines = self._next < len(self._lines)
        if self._ends_with_newline or has_later_lines or not ROW.fullmatch(self._lines[-1]):
            return numbers

        # Some programs write zero as 0, without decimals. A final 0 is therefore accepted if
        # another row also ends with 0.
        if _ends_with_zero(self._lines[-1]) and any(map(_ends_with_zero, self._lines[first:-1])):
            return numbers

        # A number that is cut off has fewer decimals than the last numbers of the preceding rows.
        # If the file has only a few long rows, the other numbers of the last row are compared.
        last = _decimals(self._lines[-1])
        rows = self._lines[max(first, len(self._lines) - _MAX_ROWS) : -1]
        before = (
            [decimals[-1] for decimals in map(_decimals, rows) if decimals]
            if len(rows) >= _MIN_ROWS
            else last[:-1]
        )
        if len(before) >= _MIN_ROWS and len(set(before)) == 1 and last[-1] < before[0]:
            raise RecordError("the file is cut off within its last number")
        return numbers


def row_of_numbers(line: str, width: int | None = None) -> list[float]:
    """Return the numbers in a line, separated by blanks, signs or, if necessary, fixed columns.

    Parameters
    ----------
    width : int, optional
        Characters per number, for lines without separators. Default: the numbers must be separated
        by blanks or signs.

    Raises
    ------
    ValueError
        The line contains other text.
    """
    if len(line) > _LONGEST_LINE:
        raise ValueError(f"a row of numbers must have at most {_LONGEST_LINE} characters")
    words = line.split()
    if len(line) > _LONGEST_WORD and max(map(len, words), default=0) > _LONGEST_WORD:
        raise ValueError(f"a number must have at most {_LONGEST_WORD} characters")
    # Most lines need only float(), which is fast.
    if _PLAIN.fullmatch(line):
        try:
            return list(map(float, words))
        except ValueError:
            pass
    if all(map(_GLUED.fullmatch, words)):
        return [_to_float(number) for word in words for number in _SINGLE_NUMBER.findall(word)]
    if width is None:
        raise ValueError("a row of numbers must not contain other text")
    # Numbers are right-aligned in their fields. The fields are therefore counted from the end of
    # the last number, and only blanks may remain before the first field.
    end = len(line.rstrip())
    start = end % width
    fields = [line[i : i + width].strip() for i in range(start, end, width)]
    if line[:start].strip() or not all(map(_SINGLE_NUMBER.fullmatch, fields)):
        raise ValueError(f"a row of numbers must have fields of {width} characters")
    return [_to_float(field) for field in fields]


def is_row_of_numbers(line: str | None, width: int | None = None) -> bool:
    """Return True if a line contains at least one number and no other text; `width` is the number
    of characters per number, as for `row_of_numbers`."""
    try:
        return bool(line and row_of_numbers(line, width))
    except ValueError:
        return False


def read_lines(file: Any, *, text_only: bool = False) -> Lines:
    """Read all lines of a file.

    Parameters
    ----------
    text_only : bool
        Raise RecordError if the file starts with binary data. Default False.

    Raises
    ------
    RecordError
        The file is larger than 64 MiB, or it is binary and `text_only` is set.
    """
    data = _read(file, _LARGEST + 1)
    if len(data) > _LARGEST:
        raise RecordError("the file must not exceed 64 MiB; extract the event from it first")
    if text_only and _is_binary(data[:_HEAD]):
        raise RecordError("this is not a text file")
    # Most files need no other encoding and no other line ends. The text is then not copied.
    is_plain = data.isascii() and not any(mark in data for mark in (b"\r", b"\x1a", b"\0"))
    return Lines(data if is_plain else _decode(data))


def recognizes(file: Any, check: Callable[[list[str]], object]) -> bool:
    """Return True if a check accepts the first complete lines of a file; False after any exception.

    Parameters
    ----------
    file : str, Path or object open for reading bytes
        File to check; its position is kept.
    check : callable
        Function of a list of lines; returns a true value if the lines have the format.
    """
    try:
        position = file.tell() if hasattr(file, "read") else None
        data = _read(file, _HEAD)
        if position is not None:
            file.seek(position)
        if _is_binary(data):
            return False
        *lines, last = _decode(data).split("\n")
        # The first bytes of a larger file usually end within a line. This incomplete line is
        # omitted, unless it is very long: some files contain all values in a single line.
        if len(data) < _HEAD or len(last) > _HEADER_LINE:
            lines.append(last)
        return bool(check(list(map(_beginning, lines))))
    except Exception:  # A check that fails on the bytes of another format has not recognized them.
        return False


def recognizer(check: Callable[[list[str]], object]) -> Callable[..., bool]:
    """Decorate a check of the first complete lines of a file; return the function
    `is_<format>(file)` of the format, which accepts the arguments of ObsPy (`recognizes`)."""
    return wraps(check)(lambda file, **_: recognizes(file, check))


def _is_binary(data: bytes) -> bool:
    """Return True if the data contain a zero byte and are not UTF-16 text."""
    return b"\0" in data and data[:2] not in _UTF_16_MARKS


def _beginning(line: str) -> str:
    """Return a line, or the start of a very long line up to a blank."""
    if len(line) <= _HEADER_LINE:
        return line
    return line[:_HEADER_LINE].rpartition(" ")[0] or line[:_HEADER_LINE]


def _read(file: Any, size: int) -> bytes:
    """Read up to `size` bytes from a file name or an open file."""
    if not hasattr(file, "read"):
        with Path(os.fspath(file)).open("rb") as stream:
            return stream.read(size)
    data = file.read(size)
    return data if isinstance(data, bytes) else bytes(data)


def _decode(data: bytes) -> str:
    """Decode the bytes of a text file and replace its line ends by LF."""
    try:
        text = data.decode("utf-16" if data[:2] in _UTF_16_MARKS else "utf-8-sig")
    except UnicodeDecodeError:
        # Only station names have other characters, in any encoding. Latin-1 decodes all bytes, and
        # numbers have the same bytes in all these encodings.
        text = data.decode("latin-1")
    # DOS programs mark the end of a text with Ctrl-Z, and some editors add a line end to this
    # character.
    tail = text[len(text.rstrip("\x1a\0 \t\r\n")) :]
    marks = [tail.index(mark) for mark in "\x1a\0" if mark in tail]
    if marks:
        text = text[: len(text) - len(tail) + min(marks)]
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _to_float(number: str) -> float:
    """Convert a number that may have a Fortran exponent (D)."""
    return float(number.replace("D", "E").replace("d", "e"))


def _ends_with_zero(line: str) -> bool:
    """Return True if the last number of a line is a zero without a decimal point."""
    return line.split()[-1:] == ["0"]


def _decimals(line: str) -> list[int]:
    """Return the number of characters after the decimal point of each number in a line."""
    return [len(number.partition(".")[2]) for number in _SINGLE_NUMBER.findall(line)]


def equal_steps(times: Array, slack: float = 0.0) -> tuple[float, float]:
    """Return the sampling interval of times in a file, which are rounded to their last decimal, and
    the departure of the times from equal steps.

    Parameters
    ----------
    times : ndarray, shape (samples,)
        Times, s, rounded to a decimal.
    slack : float
        Permitted departure as a fraction of the duration, for records on film with an uneven drive.
        Default 0.

    Returns
    -------
    tuple of float
        Sampling interval, s; maximum departure from equal steps, s. The departure is 0 if it can
        result from the rounding of the times, or if it is at most 2 % of the interval.

    Raises
    ------
    RecordError
        The times do not increase, or the steps are not equal.
    """
    if times.size < 2:
        raise RecordError("the file has only one sample; a record needs at least two")
    if (latest := max_absolute(times)) > _LATEST:
        raise RecordError(f"times must be at most {_LATEST:g} s, got {latest:g} s")
    increases = times[1:] > times[:-1]
    if not np.all(increases):
        index = int(np.argmin(increases))
        raise RecordError(
            f"times must increase, but do not after sample {index} (counted from 0) at "
            f"{times[index]:g} s; remove a repeated row, or split the file if another record starts"
        )
    dt, departure = _mean_step(times)
    if not departure:
        return dt, 0.0
    # The limit also applies to each interval. The caller reports the departure.
    if departure <= slack * float(times[-1] - times[0]):
        return dt, departure
    intervals = np.diff(times)
    # Some programs write the end of an analysis as the last row, between two steps.
    if times.size > _MIN_ROWS:
        step, departure_before_last = _mean_step(times[:-1])
        if not departure_before_last:
            raise RecordError(
                f"the last interval of the times is {intervals[-1]:.6g} s, but all other intervals "
                f"are {step:.6g} s; remove the last row"
            )
    index = int(np.argmax(np.abs(intervals - dt)))
    off_grid = np.abs(times - times[0] - dt * np.arange(times.size))
    raise RecordError(
        f"the samples are not at equal steps of {dt:.6g} s: the interval after {times[index]:g} s "
        f"is {intervals[index]:.6g} s, and the maximum departure is {np.max(off_grid):.3g} s; "
        f"specify `resample={dt:.3g}` for a table, or interpolate by "
        "numpy.interp"
    )


def _mean_step(times: Array) -> tuple[float, float]:
    """Return the mean interval of increasing printed times, s, and the maximum departure of a time
    or an interval, s; the departure is 0 if it can result from the rounding of the times.
    """
    rounding = last_decimal(times)
    dt = float(times[-1] - times[0]) / (times.size - 1)
    # Use an integer number of samples per second if it agrees with the times within their rounding.
    # In short tables several do; the usual rates are multiples of 50.
    rates = [base * round(1.0 / dt / base) for base in (50, 1)] if dt > _SHORTEST else []
    agreeing = (rate for rate in rates if rate and agrees_with_times(1.0 / rate, times, rounding))
    rate = next(agreeing, None)
    dt = 1.0 / rate if rate else float(f"{dt:.12g}")
    # Rounding of two times changes their interval by up to a single unit of the last decimal, plus
    # a margin of half a unit. Times with few decimals may depart by at most half of the interval. A
    # departure of `_SLIP` (2 % of the interval) is always accepted.
    allowed = max(min(1.5 * rounding, 0.5 * dt), _SLIP * dt)
    departure = 0.0
    for start in range(0, times.size, _BLOCK):
        part = times[start : start + _BLOCK + 1]
        off_interval = np.diff(part) - dt
        off_grid = part - times[0] - dt * np.arange(start, start + part.size)
        departure = max(departure, max_absolute(off_interval), max_absolute(off_grid))
    return dt, 0.0 if departure <= allowed * (1.0 + 1e-6) else departure


def agrees_with_times(dt: float, times: Array, rounding: float) -> bool:
    """Return True if the mean interval of printed times differs from `dt`, s, by no more than the
    rounding of the first and of the last time, s."""
    intervals = times.size - 1
    return abs(dt - float(times[-1] - times[0]) / intervals) <= rounding / intervals


def at_equal_steps(times: Array, samples: Array, slack: float) -> tuple[Array, float]:
    """Return the samples at equal steps of a motion with printed times, and the step, s.

    Samples at equal steps are used unchanged. Otherwise the motion is interpolated linearly between
    its times, and a warning states the departure. The step is the last decimal of the times, so
    that all times are samples and the motion does not change. It is at least a fraction (`_FINEST`)
    of the mean interval, or the shortest interval if that is less; each time is then rounded to a
    multiple of the step, so that no peak is lost.

    Parameters
    ----------
    slack : float
        Permitted departure from equal steps as a fraction of the duration; infinite for a format
        with samples at unequal times.
    """
    mean, departure = equal_steps(times, slack)
    if not departure:
        return samples.copy(), mean
    shortest = float(np.min(np.diff(times)))
    dt = max(last_decimal(times), min(mean / _FINEST, shortest))
    count = round(float(times[-1] - times[0]) / dt) + 1
    if count > _MOST_SAMPLES:
        raise RecordError(
            f"the shortest interval of the times, {shortest:.3g} s, is too short for equal steps "
            f"over {times[-1] - times[0]:.6g} s; resample the record to equal steps first"
        )
    positions = times - times[0]
    multiples = dt * np.round(positions / dt)
    if max_absolute(positions - multiples) > _SLIP * dt:
        positions = multiples
    warnings.warn(
        f"the times in the file depart by up to {departure:.2g} s from equal steps of {mean:.6g} "
        "s: the ground motion is interpolated linearly between these times and sampled at "
        f"{dt:.6g} s",
        stacklevel=2,
    )
    return np.interp(dt * np.arange(count), positions, samples), dt


def last_decimal(values: Array) -> float:
    """Return the value of the last decimal of printed numbers."""
    scale = max_absolute(values)
    for decimals in range(_MOST_DECIMALS):
        parts = (values[start : start + _BLOCK] for start in range(0, values.size, _BLOCK))
        if all(max_absolute(p - np.round(p, decimals)) <= 1e-14 * scale for p in parts):
            return float(10.0**-decimals)
    return float(10.0**-_MOST_DECIMALS)
