"""Data to standard output, words to standard error."""

from __future__ import annotations

import errno
import os
import re
import shlex
import sys
from collections.abc import Sequence
from typing import BinaryIO

from tdint.errors import OutputError, abridged
from tdint_cli.settings import Settings, current, is_quiet

_EMPTY_LINE = "\r\x1b[K"  # in place of the line on which the terminal's cursor is
_SETTING = re.compile(r"`(units|component|inventory|step|column|skip_lines)(?:=([^`]*))?`")
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")


def emit(data: bytes) -> None:
    """Write data to standard output, now.

    A reader that has gone (`| head`) has what it wanted: the rest is dropped without a word, and the command goes on.

    Raises
    ------
    OutputError
        Standard output is closed, or the disk behind it is full.
    """
    if sys.stdout is None:
        raise OutputError("standard output is closed")
    try:
        sys.stdout.flush()
        _write_all(sys.stdout.buffer, data)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        _discard_from_now_on()
    except OSError as error:
        _discard_from_now_on()
        raise OutputError(f"standard output: cannot be written: {error.strerror or error}") from error


def _write_all(stream: BinaryIO, data: bytes) -> None:
    """Write until all is out: without a buffer (PYTHONUNBUFFERED) `write` may take a part and say so only by a number.

    Raises
    ------
    OSError
        Nothing more goes out.
    """
    rest = memoryview(data)
    while rest:
        written = stream.write(rest)
        if not written:
            raise OSError(errno.ENOSPC, "nothing more goes out")
        rest = rest[written:]


def say(text: str) -> None:
    """Write a line to standard error, unless the command is asked to be quiet."""
    if not is_quiet():
        complain(text)


def note(text: str) -> None:
    """Say something that is good to know."""
    say(f"note: {text}")


def warn(text: str) -> None:
    """Say something that changes what a number means; nothing silences it."""
    complain(f"Warning: {text}")


def complain(text: str, settings: Settings | None = None) -> None:
    """Write a line to standard error whatever was asked; without one there is nobody to tell.

    What the library calls `skip_lines=1` is --skip-lines 1 where the command has that option, else a key of a file.
    """
    if sys.stderr is None:
        return
    settings = settings or current()
    text = _SETTING.sub(lambda match: _option(match, settings.options), text)
    try:
        over_the_bar = _EMPTY_LINE if settings.bar else ""
        sys.stderr.write(f"{over_the_bar}{_CONTROL.sub(_escaped, abridged(text))}\n")
        sys.stderr.flush()
    except OSError:
        pass


def _option(match: re.Match[str], options: frozenset[str]) -> str:
    name, value = match.groups()
    option = f"--{name.replace('_', '-')}"
    if option not in options:
        return f"`{name}: {value}`" if value else match[0]
    return f"{option} {shlex.quote(value)}" if value else option


def say_table(rows: Sequence[Sequence[str]]) -> None:
    """Rows of words on standard error, in columns; the first row is the header."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _escaped(match: re.Match[str]) -> str:
    """What would steer a terminal (a file's name or header may hold it), as text."""
    return repr(match[0])[1:-1]


def _discard_from_now_on() -> None:
    """Let standard output lead nowhere, so that what is left in its buffer raises nothing when Python ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
