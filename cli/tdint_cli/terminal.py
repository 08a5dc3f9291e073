"""What a person at a terminal sees beside data: words, progress; and what holds for a whole command
line."""

from __future__ import annotations

import errno
import logging
import os
import re
import shlex
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import click

from tdint.errors import ModelError, OutputError, TdintError, UsageError, abridged
from tdint.system import do_not_wait


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
    arguments : tuple of str
        The command line behind `tdint`, as it was typed, without what no output depends on.
    """

    debug: bool = False
    quiet: bool = False
    bar: bool = False
    options: frozenset[str] = frozenset()
    arguments: tuple[str, ...] = ()


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

    A reader that has gone (`| head`) has what it wanted: the rest is dropped without a word, and
    the command goes on.

    Raises
    ------
    OutputError
        Standard output is closed, or the disk behind it is full.
    """
    if sys.stdout is None:
        raise OutputError("standard output is closed")
    try:
        sys.stdout.flush()
        # Without a buffer (PYTHONUNBUFFERED) `write` may take a part and say so only by a number.
        rest = memoryview(data)
        while rest:
            written = sys.stdout.buffer.write(rest)
            if not written:
                raise OSError(errno.ENOSPC, "nothing more goes out")
            rest = rest[written:]
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        _discard_from_now_on()
    except OSError as error:
        _discard_from_now_on()
        raise OutputError(
            f"standard output: cannot be written: {error.strerror or error}"
        ) from error


def say(*lines: str) -> None:
    """Write lines to standard error, unless the command is asked to be quiet."""
    if not is_quiet():
        for line in lines:
            complain(line)


def note(*texts: str) -> None:
    """Say what is good to know."""
    say(*(f"note: {text}" for text in _of_a_kind(texts)))


def warn(*texts: str) -> None:
    """Say what changes what a number means; nothing silences it."""
    for text in texts:
        complain(f"Warning: {text}")


_FEW = 2  # files of which each has a line, where the same is said of several


def _of_a_kind(texts: Sequence[str]) -> list[str]:
    """What is said of many files (`FILE: WORDS`) in one line behind what is said of single ones."""
    files: dict[str, list[str]] = {}
    for text in texts:
        file, _, words = text.rpartition(": ")
        files.setdefault(words, []).append(file)
    many = {words: named for words, named in files.items() if len(named) > _FEW and all(named)}
    single = [text for text in texts if text.rpartition(": ")[2] not in many]
    return single + [
        f"{named[0]} and {len(named) - 1} more: {words}" for words, named in many.items()
    ]


def complain(text: str, settings: Settings | None = None) -> None:
    """Write a line to standard error whatever was asked; without one there is nobody to tell.

    What the library calls `skip_lines=1` is --skip-lines 1 where the command has that option, else
    a key of a file.
    """
    if sys.stderr is None:
        return
    settings = settings or current()

    def in_words_of_the_command(match: re.Match[str]) -> str:
        name, value = match.groups()
        option = f"--{name.replace('_', '-')}"
        if option not in settings.options:
            return f"`{name}: {value}`" if value else match[0]
        return f"{option} {shlex.quote(value)}" if value else option

    text = abridged(_SETTING.sub(in_words_of_the_command, text))
    # What would steer a terminal, as a file's name or header may, is shown as text.
    text = _CONTROL.sub(lambda match: repr(match[0])[1:-1], text)
    try:
        over_the_bar = _EMPTY_LINE if settings.bar else ""
        sys.stderr.write(f"{over_the_bar}{text}\n")
        sys.stderr.flush()
    except OSError:
        pass


def say_table(rows: Sequence[Sequence[str]]) -> None:
    """Rows of words on standard error, in columns; the first row is the header."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _discard_from_now_on() -> None:
    """Let standard output lead nowhere, so that what is left in its buffer raises nothing when
    Python ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


_PARTS = 1000  # of a bar: a tenth of a percent each

Item = TypeVar("Item")

Progress = Callable[[str, float], None]
"""To be told what is being done and how much of it is done, from 0 to 1."""


@contextmanager
def progress_bar(to_terminal: bool) -> Iterator[Progress]:
    """A bar that is told of the progress.

    No bar is drawn if standard error is no terminal, nor into data that go to one (`to_terminal`),
    nor with `--quiet`.
    """
    if is_quiet() or not is_terminal(sys.stderr) or (to_terminal and is_terminal(sys.stdout)):
        yield lambda label, part: None
        return
    # Who works tells which part of the whole is done, from 0 to 1: the bar counts thousandths of
    # it.
    with click.progressbar(length=_PARTS, file=sys.stderr) as bar:

        def tell(label: str, part: float) -> None:
            bar.label = f"{label:<12}"
            bar.update(max(0, round(part * _PARTS) - bar.pos))

        settings = current()
        settings.bar = True
        try:
            yield tell
        finally:
            settings.bar = False


@contextmanager
def counted(
    items: Iterable[Item], count: int, label: str, *, to_terminal: bool
) -> Iterator[Iterable[Item]]:
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
    """What tells of a part of the work, from `start` to `end` of the whole, with a name before what
    is done."""
    return lambda label, part: progress(f"{name}{label}", start + (end - start) * part)


def is_terminal(stream: object) -> bool:
    """Whether a person sees what is written there."""
    isatty = getattr(stream, "isatty", None)
    return bool(isatty and isatty())


# ---- From what goes wrong to one line per problem on standard error and an exit code; Ctrl-C,
# SIGTERM and their like end in time
#
# Python sees a signal between two of its own instructions only, and an exception is made of it
# there. Where a library works on for longer, a thread that the system tells of the signal ends the
# process: without a temporary file, and without processes left behind.

BUG = 1
_PACKAGES = {"yaml": "pyyaml"} | {
    name: name
    for name in ("llvmlite", "matplotlib", "numba", "numpy", "obspy", "platformdirs", "scipy")
}
"""What tdint imports and pip calls so: an installation without dependencies has left one out."""

OUT_OF_MEMORY = 5
ENDING = tuple(
    signal.Signals[name]
    for name in (
        "SIGINT",
        "SIGTERM",
        "SIGHUP",
        "SIGXCPU",
        "SIGQUIT",
        "SIGALRM",
        "SIGUSR1",
        "SIGUSR2",
    )
    if name in signal.Signals.__members__
)
"""Signals that end a command: Ctrl-C, `kill`, a terminal that is closed, processor time that is
used up, what a scheduler announces its end by. The exit code is what a shell reports of them,
`AFTER_SIGNAL` and their number."""

AFTER_SIGNAL = 128  # POSIX shells: 128 and the signal's number
INTERRUPTED = AFTER_SIGNAL + signal.SIGINT

_NO_MEMORY = re.compile(
    r"failed to map segment|annot allocate memory|can't start new thread|out of memory"
)
"""What loaders, threads and SQLite say where Python itself would raise MemoryError."""


class Ended(BaseException):
    """The process was asked to end by a signal: raised wherever it is, so that no half-written file
    stays."""


class Failures(TdintError):
    """Inputs of one command that failed, after the others were done; the exit code is the smallest
    of theirs."""

    def __init__(self, errors: Sequence[TdintError]) -> None:
        super().__init__("\n".join(map(str, errors)))
        self.exit_code = min(error.exit_code for error in errors)


def exit_code_of(command: Callable[[], Any], settings: Settings) -> int:
    """Run a command and tell its exit code; whatever it raises is reported, after a signal the
    signal alone."""
    came: list[int] = []
    try:
        with _signals_as_an_exception(came), _warnings_as_lines(), _notes_of_the_library():
            code = command()
            code = code if isinstance(code, int) else 0
    except BaseException as error:  # What loads may make any error of the signal's
        code = 0 if came else _reported(error, settings)
    if not came:
        return code
    complain(_word_of(came[0]))
    return AFTER_SIGNAL + came[0]


def _word_of(number: int) -> str:
    return "Interrupted" if number == signal.SIGINT else "Terminated"


def _reported(error: BaseException, settings: Settings) -> int:
    """Say what is wrong, and tell the exit code."""
    try:
        raise error
    except getattr(
        click.exceptions, "NoArgsIsHelpError", ()
    ) as error:  # `tdint` alone, since click 8.2
        error.show()
        return int(error.exit_code)
    except click.ClickException as error:
        context = error.ctx if isinstance(error, click.UsageError) else None
        hint = f" (see {context.command_path} --help)" if context else ""
        complain(f"Error: {' '.join(error.format_message().split())}{hint}")
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        complain(_word_of(signal.SIGINT))
        return INTERRUPTED
    except Exception as error:
        if settings.debug:
            complain(traceback.format_exc().rstrip())
        # Ours, or one of which a user can do something, or a bug
        if isinstance(error, TdintError):
            lines, code = str(error).splitlines() or [type(error).__name__], error.exit_code
        elif _lacks_memory(error):
            lines = [
                "not enough memory; leave out --history and --plot, or take fewer steps, stories "
                "or periods"
            ]
            code = OUT_OF_MEMORY
        elif (
            isinstance(error, OSError) and error.errno == errno.ENOSPC
        ):  # of what click writes itself
            lines, code = (
                [f"standard output: cannot be written: {error.strerror}"],
                OutputError.exit_code,
            )
        elif isinstance(error, ModuleNotFoundError) and error.name in _PACKAGES:
            lines = [
                f"{error.name} is not installed, and this needs it: pip install "
                f"{_PACKAGES[error.name]}"
            ]
            code = UsageError.exit_code
        else:
            text = " ".join(f"{type(error).__name__}: {error}".split())
            lines, code = [f"internal error (a bug): {text}; run again with --debug"], BUG
        # What is wrong with a file is said in the words of the file.
        said_by = Settings() if code == ModelError.exit_code else settings
        for line in lines:
            complain(f"Error: {line}", said_by)
        return code


def _lacks_memory(error: BaseException | None) -> bool:
    """Whether memory is what an error, or one that it was made of, is about."""
    while error is not None:
        if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
            return True
        if isinstance(error, ImportError | OSError | RuntimeError) and _NO_MEMORY.search(
            str(error)
        ):
            return True
        error = error.__cause__ or error.__context__
    return False


@contextmanager
def _signals_as_an_exception(came: list[int]) -> Iterator[None]:
    """Signals end the command by an exception, and are noted; asking again changes nothing while it
    cleans up."""

    def end(number: int, _: Any) -> None:
        came.append(number)
        sys.unraisablehook = lambda _: (
            None
        )  # Where nothing can be raised the watch ends the process, without a word.
        for ending in handled:
            signal.signal(ending, signal.SIG_IGN)
        raise Ended

    handled: dict[signal.Signals, Any] = {}
    hook = sys.unraisablehook
    if threading.current_thread() is threading.main_thread():  # Elsewhere Python sets no handlers.
        handled = {
            ending: signal.getsignal(ending)
            for ending in ENDING
            if signal.getsignal(ending) in _NOBODY_S
        }
    for ending in handled:
        signal.signal(ending, end)
    try:
        yield
    finally:
        for ending, before in handled.items():
            signal.signal(ending, before)
        sys.unraisablehook = hook


@contextmanager
def _warnings_as_lines() -> Iterator[None]:
    """Show Python's warnings as one line without file and source."""

    def show(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        warn(" ".join(str(message).split()))

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


class _Notes(logging.Handler):
    """Shows what the library logs as `note: ...`."""

    def emit(self, record: logging.LogRecord) -> None:
        (warn if record.levelno >= logging.WARNING else note)(record.getMessage())


@contextmanager
def _notes_of_the_library() -> Iterator[None]:
    logger, handler = logging.getLogger("tdint"), _Notes(logging.INFO)
    if any(
        isinstance(other, _Notes) for other in logger.handlers
    ):  # of a command around this one: all would come twice
        yield
        return
    before, propagates = logger.level, logger.propagate
    # The assumptions of a record come with it, from other processes, too, and are told by the
    # command.
    handler.addFilter(lambda record: record.name != "tdint.assumptions")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)
        logger.propagate = propagates


_PATIENCE = 0.3
"""How long the command may take to end on its own, s."""


def end_in_time() -> Callable[..., None]:
    """Watch for the signals until this process ends. What comes back is to be called with the exit
    code when the command has ended and said so: threads may be waited for then, which another
    signal ends without a word; after a signal nothing is waited for or taken apart, which a library
    that was left in the middle of its work may not survive."""
    if threading.current_thread() is not threading.main_thread():
        return lambda code=None: None
    said = threading.Event()
    source, told = os.pipe()
    do_not_wait(told)

    def watch() -> None:
        # A signal that is ignored is not told; the first one counts.
        while data := os.read(source, 1):
            if data[0] in ENDING:
                threading.Event().wait(_PATIENCE)
                _end(data[0], said)

    def ended(code: object = None) -> None:
        said.set()
        if code in [AFTER_SIGNAL + number for number in ENDING]:
            _end(int(str(code)) - AFTER_SIGNAL, said)

    try:
        threading.Thread(target=watch, daemon=True).start()
    except RuntimeError:
        # No thread is left (ulimit -u, a container's limit): Python's own handlers remain.
        os.close(source)
        os.close(told)
        return lambda code=None: None
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    # Python's own handlers would show a traceback, once the command has ended; others were meant.
    for number in ENDING:
        handler = signal.getsignal(number)
        if (
            handler in _NOBODY_S or getattr(handler, "__module__", "") == "tdint_cli"
        ):  # that of `tdint_cli.start`
            signal.signal(number, _left_to_the_watch)
    return ended


def _left_to_the_watch(*_: Any) -> None:
    """Outside of the command, where Python itself would show a traceback, or be ended in the middle
    of its end."""


_NOBODY_S = (signal.SIG_DFL, signal.default_int_handler, _left_to_the_watch)
"""Handlers that nobody has set: another one, or SIG_IGN (`nohup`), was meant."""


def _end(number: int, said: threading.Event) -> None:
    import multiprocessing

    from tdint.files import remove_unfinished

    with suppress(Exception):
        # Neither processes nor files that are half written stay behind.
        for process in multiprocessing.active_children():
            process.kill()
        remove_unfinished()
        if not said.is_set():
            complain(_word_of(number))
    os._exit(AFTER_SIGNAL + number)
