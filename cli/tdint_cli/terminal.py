"""What a person at a terminal sees beside data: words, progress; and what holds for a whole command line."""

from __future__ import annotations

import errno
import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import BinaryIO, TypeVar

import click

from tdint.errors import OutputError, abridged


@dataclass
class Settings:
    """Settings that every click context carries.

    Attributes
    ----------
    debug : bool
        Show a traceback with an error.
    quiet : bool
        Say nothing but warnings and errors.
    bar : bool
        A progress bar is shown.
    options : frozenset of str
        The options of the command that runs, --units and so on.
    """

    debug: bool = False
    quiet: bool = False
    bar: bool = False
    options: frozenset[str] = frozenset()


def current() -> Settings:
    """Settings of the command that runs."""
    context = click.get_current_context(silent=True)
    return (context and context.find_object(Settings)) or Settings()


def is_quiet() -> bool:
    """Whether the command that runs was asked to be quiet."""
    return current().quiet


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


def say(*lines: str) -> None:
    """Write lines to standard error, unless the command is asked to be quiet."""
    if not is_quiet():
        for line in lines:
            complain(line)


def note(*texts: str) -> None:
    """Say what is good to know."""
    say(*(f"note: {text}" for text in texts))


def warn(*texts: str) -> None:
    """Say what changes what a number means; nothing silences it."""
    for text in texts:
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


_PARTS = 1000

Item = TypeVar("Item")

Progress = Callable[[str, float], None]
"""To be told what is being done and how much of it is done, from 0 to 1."""


@contextmanager
def progress_bar(to_terminal: bool) -> Iterator[Progress]:
    """A bar that is told of the progress.

    No bar is drawn if standard error is no terminal, nor into data that go to one (`to_terminal`), nor with `--quiet`.
    """
    if is_quiet() or not is_terminal(sys.stderr) or (to_terminal and is_terminal(sys.stdout)):
        yield lambda what, part: None
        return
    with click.progressbar(length=_PARTS, file=sys.stderr) as bar:

        def tell(what: str, part: float) -> None:
            bar.label = f"{what:<12}"
            bar.update(max(0, round(part * _PARTS) - bar.pos))

        settings = current()
        settings.bar = True
        try:
            yield tell
        finally:
            settings.bar = False


@contextmanager
def counted(items: Iterable[Item], count: int, label: str, *, to_terminal: bool) -> Iterator[Iterable[Item]]:
    """The items, with a bar that counts them if there are several."""
    if count < 2:
        yield items
        return

    def told(progress: Progress) -> Iterator[Item]:
        progress(f"{label} 0/{count}", 0.0)
        for done, item in enumerate(items, start=1):
            yield item
            progress(f"{label} {done}/{count}", done / count)

    with progress_bar(to_terminal) as progress:
        yield told(progress)


def part_of(progress: Progress, start: float, end: float, name: str = "") -> Progress:
    """What tells of a part of the work, from `start` to `end` of the whole, with a name before what is done."""
    return lambda what, part: progress(f"{name}{what}", start + (end - start) * part)


def is_terminal(stream: object) -> bool:
    """Whether a person sees what is written there."""
    isatty = getattr(stream, "isatty", None)
    return bool(isatty and isatty())
