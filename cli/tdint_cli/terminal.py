"""Messages and progress on the terminal, error reports, exit codes and signals of a command."""

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
from tdint.system import set_nonblocking


@dataclass
class Settings:
    """Settings that every click context carries.

    Attributes
    ----------
    debug : bool
        Show a traceback with an error.
    quiet : bool
        Print only warnings and errors.
    bar : bool
        True while a progress bar is shown.
    options : frozenset of str
        Names of the options of the running command, such as --units.
    arguments : tuple of str
        Arguments of `tdint` as typed, without the options that do not affect the output.
    """

    debug: bool = False
    quiet: bool = False
    bar: bool = False
    options: frozenset[str] = frozenset()
    arguments: tuple[str, ...] = ()


def current() -> Settings:
    """Return the settings of the running command."""
    context = click.get_current_context(silent=True)
    return (context and context.find_object(Settings)) or Settings()


def is_quiet() -> bool:
    """Return True if the running command has the option --quiet."""
    return current().quiet


_EMPTY_LINE = "\r\x1b[K"  # Clears the line of the terminal that contains the cursor.
_SETTING = re.compile(r"`(units|component|inventory|step|column|skip_lines)(?:=([^`]*))?`")
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")


def emit(data: bytes) -> None:
    """Write data to standard output without delay.

    If the reader has closed the pipe (`| head`), the remaining data are discarded without a
    message, and the command continues.

    Raises
    ------
    OutputError
        Standard output is closed, or its disk is full.
    """
    if sys.stdout is None:
        raise OutputError("standard output is closed")
    try:
        sys.stdout.flush()
        # Without a buffer (PYTHONUNBUFFERED), `write` may write only a part of the data. The return
        # value is then the number of written bytes.
        rest = memoryview(data)
        while rest:
            written = sys.stdout.buffer.write(rest)
            if not written:
                raise OSError(errno.ENOSPC, "no further output")
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
    """Write lines to standard error, unless the command has the option --quiet."""
    if not is_quiet():
        for line in lines:
            complain(line)


def note(*texts: str) -> None:
    """Print notes, which do not affect the meaning of the results."""
    say(*(f"note: {text}" for text in _of_a_kind(texts)))


def warn(*texts: str) -> None:
    """Print warnings that affect the meaning of the results; --quiet does not suppress them."""
    for text in texts:
        complain(f"Warning: {text}")


_SINGLE = 2  # maximum number of files with the same message that are listed on separate lines


def _of_a_kind(texts: Sequence[str]) -> list[str]:
    """Combine equal messages (`FILE: MESSAGE`) about many files; put the combined lines last."""
    files: dict[str, list[str]] = {}
    for text in texts:
        file, _, words = text.rpartition(": ")
        files.setdefault(words, []).append(file)
    many = {words: named for words, named in files.items() if len(named) > _SINGLE and all(named)}
    single = [text for text in texts if text.rpartition(": ")[2] not in many]
    return single + [
        f"{named[0]} and {len(named) - 1} more: {words}" for words, named in many.items()
    ]


def complain(text: str, settings: Settings | None = None) -> None:
    """Write a line to standard error, also with --quiet.

    The line is discarded if standard error is closed. A library argument such as `skip_lines=1` is
    shown as --skip-lines 1 if the command has this option. Otherwise it is shown as a key of a
    file.

    Parameters
    ----------
    text : str
        Line to write.
    settings : Settings, optional
        Settings of the command. By default, the settings of the running command.
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
    # File names and headers may contain terminal control characters. Show these as text.
    text = _CONTROL.sub(lambda match: repr(match[0])[1:-1], text)
    try:
        over_the_bar = _EMPTY_LINE if settings.bar else ""
        sys.stderr.write(f"{over_the_bar}{text}\n")
        sys.stderr.flush()
    except OSError:
        pass


def say_table(rows: Sequence[Sequence[str]]) -> None:
    """Write rows of text to standard error in aligned columns; the first row is the header."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _discard_from_now_on() -> None:
    """Redirect standard output to the null device.

    Data that remain in the buffer then raise no error when Python exits.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


_PARTS = 1000  # Number of steps of a progress bar; each step is 0.1 percent.

Item = TypeVar("Item")

Progress = Callable[[str, float], None]
"""Callback that receives the label of the current work and the completed fraction, 0 to 1."""


@contextmanager
def progress_bar(to_terminal: bool) -> Iterator[Progress]:
    """Show a progress bar; yield the callback that updates the bar.

    No bar is shown with `--quiet`, or if standard error is not a terminal.

    Parameters
    ----------
    to_terminal : bool
        True if the data are written to standard output. If standard output is also a terminal, no
        bar is shown.
    """
    if is_quiet() or not is_terminal(sys.stderr) or (to_terminal and is_terminal(sys.stdout)):
        yield lambda label, part: None
        return
    # The callback receives the completed fraction, 0 to 1. The bar counts thousandths.
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
    """Yield the items with a progress bar that counts the items if there are several.

    Parameters
    ----------
    items : iterable
        Items to process.
    count : int
        Number of items.
    label : str
        Label of the progress bar.
    to_terminal : bool
        True if the data are written to standard output.
    """
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
    """Return a progress callback for a part of the work.

    Parameters
    ----------
    progress : Progress
        Callback of the complete work.
    start, end : float
        Fractions of the complete work at the start and the end of the part, 0 to 1.
    name : str
        Prefix of the labels. The default is empty.
    """
    return lambda label, part: progress(f"{name}{label}", start + (end - start) * part)


def is_terminal(stream: object) -> bool:
    """Return True if the stream is a terminal."""
    isatty = getattr(stream, "isatty", None)
    return bool(isatty and isatty())


# ---- This part converts errors to one line per problem on standard error and an exit code, and
# ends the command without delay after Ctrl-C, SIGTERM and similar signals.
#
# Python handles a signal only between two of its own instructions; the handler raises an exception.
# If a library call takes longer, a thread that the system notifies of the signal ends the process.
# The thread removes temporary files and ends the worker processes.

BUG = 1
_PACKAGES = {"yaml": "pyyaml"} | {
    name: name
    for name in ("llvmlite", "matplotlib", "numba", "numpy", "obspy", "platformdirs", "scipy")
}
"""Import name and pip name of each dependency, for the message about a missing package."""

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
"""Signals that end a command: Ctrl-C, `kill`, a closed terminal, exceeded processor time, and the
signals by which a scheduler announces the end of a job. The exit code follows the convention of
shells: `AFTER_SIGNAL` plus the signal number."""

AFTER_SIGNAL = 128  # POSIX shells report 128 plus the signal number.
INTERRUPTED = AFTER_SIGNAL + signal.SIGINT

_NO_MEMORY = re.compile(
    r"failed to map segment|annot allocate memory|can't start new thread|out of memory"
)
"""Messages of loaders, threads and SQLite for insufficient memory (no MemoryError is raised)."""


class Ended(BaseException):
    """Exception raised by a signal that ends the process; partially written files are removed."""


class Failures(TdintError):
    """Errors of the inputs that failed, raised after all other inputs are processed.

    The exit code is the smallest exit code of the errors.
    """

    def __init__(self, errors: Sequence[TdintError]) -> None:
        super().__init__("\n".join(map(str, errors)))
        self.exit_code = min(error.exit_code for error in errors)


def exit_code_of(command: Callable[[], Any], settings: Settings) -> int:
    """Run a command, report its error, if any, and return the exit code.

    After a signal, only the signal is reported.

    Parameters
    ----------
    command : callable
        Command to run. An integer result is the exit code.
    settings : Settings
        Settings of the command.
    """
    came: list[int] = []
    try:
        with _signals_as_an_exception(came), _warnings_as_lines(), _notes_of_the_library():
            code = command()
            code = code if isinstance(code, int) else 0
    except BaseException as error:  # An import may convert the exception of the signal.
        code = 0 if came else _reported(error, settings)
    if not came:
        return code
    complain(_word_of(came[0]))
    return AFTER_SIGNAL + came[0]


def _word_of(number: int) -> str:
    return "Interrupted" if number == signal.SIGINT else "Terminated"


def _reported(error: BaseException, settings: Settings) -> int:
    """Print the error message and return the exit code."""
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
        # Distinguish errors of tdint, errors that the user can correct, and bugs.
        if isinstance(error, TdintError):
            lines, code = str(error).splitlines() or [type(error).__name__], error.exit_code
        elif _lacks_memory(error):
            lines = [
                "not enough memory; omit --history and --plot, or use fewer time steps, stories "
                "or periods"
            ]
            code = OUT_OF_MEMORY
        elif (
            isinstance(error, OSError) and error.errno == errno.ENOSPC
        ):  # Click itself raises this error.
            lines, code = (
                [f"standard output: cannot be written: {error.strerror}"],
                OutputError.exit_code,
            )
        elif isinstance(error, ModuleNotFoundError) and error.name in _PACKAGES:
            lines = [
                f"this command requires {error.name}, which is not installed; install it with: "
                f"pip install {_PACKAGES[error.name]}"
            ]
            code = UsageError.exit_code
        else:
            text = " ".join(f"{type(error).__name__}: {error}".split())
            lines, code = [f"internal error (a bug): {text}; run again with --debug"], BUG
        # A message about a model file uses the keys of the file instead of the option names.
        said_by = Settings() if code == ModelError.exit_code else settings
        for line in lines:
            complain(f"Error: {line}", said_by)
        return code


def _lacks_memory(error: BaseException | None) -> bool:
    """Return True if an error or one of its causes reports insufficient memory."""
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
    """Raise `Ended` for a signal and append the signal number to `came`.

    Further signals are ignored while the command cleans up.
    """

    def end(number: int, _: Any) -> None:
        came.append(number)
        sys.unraisablehook = lambda _: (
            None
        )  # If no exception can be raised, the watch thread ends the process.
        for ending in handled:
            signal.signal(ending, signal.SIG_IGN)
        raise Ended

    handled: dict[signal.Signals, Any] = {}
    hook = sys.unraisablehook
    if threading.current_thread() is threading.main_thread():  # Python allows handlers only there.
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
    """Log handler that prints the messages of the library as notes and warnings."""

    def emit(self, record: logging.LogRecord) -> None:
        (warn if record.levelno >= logging.WARNING else note)(record.getMessage())


@contextmanager
def _notes_of_the_library() -> Iterator[None]:
    logger, handler = logging.getLogger("tdint"), _Notes(logging.INFO)
    if any(
        isinstance(other, _Notes) for other in logger.handlers
    ):  # The handler of an outer command is active. A second handler would print messages twice.
        yield
        return
    before, propagates = logger.level, logger.propagate
    # Each record contains its assumptions, also if a worker process reads the record. The command
    # reports the assumptions.
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
"""Time in seconds that the command has to end by itself after a signal."""


def end_in_time() -> Callable[..., None]:
    """Watch for signals until this process ends.

    Returns
    -------
    callable
        Function to call with the exit code after the command has ended and reported its result.
        Python may then still wait for threads; a further signal ends this wait without a message.
        After a signal, the function ends the process at once, without waiting and without cleanup
        of libraries. An interrupted library may fail during its cleanup.
    """
    if threading.current_thread() is not threading.main_thread():
        return lambda code=None: None
    said = threading.Event()
    source, told = os.pipe()
    set_nonblocking(told)

    def watch() -> None:
        # Python does not report ignored signals. The first reported signal ends the process.
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
        # The thread limit is reached (ulimit -u, container). The handlers of Python remain active.
        os.close(source)
        os.close(told)
        return lambda code=None: None
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    # The handlers of Python would show a traceback after the end of the command. Replace only these
    # handlers, because other handlers were set on purpose.
    for number in ENDING:
        handler = signal.getsignal(number)
        if (
            handler in _NOBODY_S or getattr(handler, "__module__", "") == "tdint_cli"
        ):  # The handler of `tdint_cli.start` is replaced, too.
            signal.signal(number, _left_to_the_watch)
    return ended


def _left_to_the_watch(*_: Any) -> None:
    """Ignore a signal outside of the command; the watch thread ends the process.

    Otherwise Python would show a traceback or would be interrupted during its exit.
    """


_NOBODY_S = (signal.SIG_DFL, signal.default_int_handler, _left_to_the_watch)
"""Default handlers. Any other handler, or SIG_IGN (`nohup`), was set on purpose."""


def _end(number: int, said: threading.Event) -> None:
    import multiprocessing

    from tdint.files import remove_unfinished

    with suppress(Exception):
        # Kill all worker processes and remove partially written files.
        for process in multiprocessing.active_children():
            process.kill()
        remove_unfinished()
        if not said.is_set():
            complain(_word_of(number))
    os._exit(AFTER_SIGNAL + number)
