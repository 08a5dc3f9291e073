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
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, TypeVar

import click

from tdint.errors import ModelError, OutputError, TdintError, abridged, write_out_controls
from tdint.files import is_file, is_folder
from tdint.ground_motion.missing import IncompleteRecord, Missing
from tdint.items import grouped
from tdint.number_parsing import abbreviate
from tdint.response.defaults import NO_METHOD
from tdint.system import set_nonblocking


@dataclass(eq=False, repr=False)
class Settings:
    """Settings that every click context carries.

    Attributes
    ----------
    debug : bool
        Show a traceback with an error, and details of a run that do not affect its results.
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
    """Return the settings of the running command; default settings outside of a command."""
    context = click.get_current_context(silent=True)
    return (context and context.find_object(Settings)) or Settings()


def is_quiet() -> bool:
    """Return True if the running command has the option --quiet."""
    return current().quiet


def is_debug() -> bool:
    """Return True if the running command has the option --debug."""
    return current().debug


_EMPTY_LINE = "\r\x1b[K"  # control characters that clear the line of the cursor on a terminal
# A library argument in backticks, with or without its value, such as `skip_lines=1`. The groups are
# its name and its value.
_SETTING = (
    r"`(units|component|inventory|step|column|skip_lines|rows|one_sided|resample)(?:=([^`]*))?`"
)


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
        remaining = memoryview(data)
        while remaining:
            written = sys.stdout.buffer.write(remaining)
            if not written:
                raise OSError(errno.ENOSPC, "no further output")
            remaining = remaining[written:]
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        _discard_further_output()
    except OSError as error:
        _discard_further_output()
        raise OutputError(
            f"standard output: cannot be written: {error.strerror or error}"
        ) from error


def say(*lines: str) -> None:
    """Write lines to standard error, unless the command has the option --quiet."""
    if not is_quiet():
        for line in lines:
            complain(line)


def note(*texts: str) -> None:
    """Print notes, which do not affect the meaning of the results, unless --quiet is set."""
    say(*(f"note: {text}" for text in _combine_equal(texts)))


def note_of_runs(*texts: str) -> None:
    """Print the notes of runs. The note on the default method requires --debug."""
    note(*(text for text in texts if is_debug() or NO_METHOD not in text))


def warn(*texts: str) -> None:
    """Print warnings that affect the meaning of the results; --quiet does not suppress them."""
    for text in _combine_equal(texts):
        complain(f"Warning: {text}")


_NAMED = 2  # maximum number of files that a common message names


def _combine_equal(texts: Sequence[str]) -> list[str]:
    """Combine equal messages about several files to one line.

    Each text is `FILE: MESSAGE`, or a message without a file, which is not combined. The combined
    lines, `FILE, FILE and N more: MESSAGE`, follow after the other texts.
    """
    files_of_message = grouped(_file_and_message(text)[::-1] for text in texts)
    # A message without a file has an empty file name and is not combined.
    common_messages = {
        message: files
        for message, files in files_of_message.items()
        if len(files) > 1 and all(files)
    }
    single_lines = [text for text in texts if _file_and_message(text)[1] not in common_messages]
    return single_lines + [
        f"{abbreviate(files, _NAMED)}: {message}" for message, files in common_messages.items()
    ]


def _file_and_message(text: str) -> tuple[str, str]:
    """Return the file and the message of a text `FILE: MESSAGE`; the message may contain colons.
    The file is empty if the text names none."""
    file, separator, message = text.partition(": ")
    return (file, message) if separator else ("", text)


def complain(text: str, settings: Settings | None = None) -> None:
    """Write a line to standard error, also with --quiet.

    The line is discarded if standard error is closed. Messages of the library contain arguments in
    backticks, such as `skip_lines=1`. If the command has the corresponding option, the line shows
    the option, --skip-lines 1. Otherwise it shows the key of a model or campaign file,
    `skip_lines: 1`.

    Parameters
    ----------
    settings : Settings, optional
        Settings of the command. By default, the settings of the running command.
    """
    if sys.stderr is None:
        return
    settings = settings or current()

    def setting_of_command(match: re.Match[str]) -> str:
        """Return the option, or the key of a file, for a library argument in backticks."""
        name, value = match.groups()
        option = f"--{name.replace('_', '-')}"
        if option not in settings.options:
            # A switch has no value in a message, and the value true in a file.
            value = value or ("true" if name in ("rows", "one_sided") else None)
            return f"`{name}: {value}`" if value else match[0]
        return f"{option} {shlex.quote(value)}" if value else option

    text = abridged(re.sub(_SETTING, setting_of_command, text))
    # File names and headers may contain terminal control characters.
    text = write_out_controls(text, keep="\n")
    try:
        clear_progress_bar = _EMPTY_LINE if settings.bar else ""
        sys.stderr.write(f"{clear_progress_bar}{text}\n")
        sys.stderr.flush()
    except OSError:
        pass


def say_table(rows: Sequence[Sequence[str]]) -> None:
    """Write rows of text to standard error in aligned columns; the first row is the header."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _discard_further_output() -> None:
    """Redirect standard output to the null device, so that all further output is discarded.

    Python writes the data that remain in its buffer when it exits. Without the redirection, this
    would raise an error.
    """
    null_device = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null_device, sys.stdout.fileno())
    os.close(null_device)


_BAR_STEPS = 1000  # number of steps of a progress bar; each step is 0.1 percent

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
        yield lambda label, fraction: None
        return
    with click.progressbar(length=_BAR_STEPS, file=sys.stderr) as bar:

        def update_bar(label: str, fraction: float) -> None:
            """Show the label and the completed fraction of the work."""
            bar.label = f"{label:<12}"
            # `update` receives the number of additional steps. The bar never moves back.
            bar.update(max(0, round(fraction * _BAR_STEPS) - bar.pos))

        settings = current()
        settings.bar = True
        try:
            yield update_bar
        finally:
            settings.bar = False


@contextmanager
def counted(
    items: Iterable[Item], count: int, label: str, *, to_terminal: bool
) -> Iterator[Iterable[Item]]:
    """Yield the items; if there are at least two, show a progress bar with the number of done
    items."""
    if count < 2:
        yield items
        return

    def items_with_progress(progress: Progress) -> Iterator[Item]:
        """Yield the items, and update the progress bar after each item."""
        progress(f"{label} 0/{count}", 0.0)
        for done, item in enumerate(items, start=1):
            yield item
            progress(f"{label} {done}/{count}", done / count)

    with progress_bar(to_terminal) as progress:
        yield items_with_progress(progress)


def part_of(progress: Progress, start: float, end: float, name: str = "") -> Progress:
    """Return a progress callback for a part of the work.

    Parameters
    ----------
    start, end : float
        Fractions of the complete work at the start and the end of the part, 0 to 1.
    name : str
        Prefix of the labels. The default is empty.
    """
    return lambda label, fraction: progress(f"{name}{label}", start + (end - start) * fraction)


def is_terminal(stream: object) -> bool:
    """Return True if the stream is a terminal."""
    isatty = getattr(stream, "isatty", None)
    return bool(isatty and isatty())


# ---- This part converts errors to one line per problem on standard error and an exit code, and
# ends the command without delay after Ctrl-C, SIGTERM and similar signals.
#
# Python handles a signal only between two Python instructions; the handler raises an exception.
# If a library call lasts longer, a thread that the system notifies of the signal ends the process.
# The thread removes temporary files and ends the worker processes.

BUG = 1
OUT_OF_RESOURCES = 5
"""Exit code if the system has not enough memory, or allows no further threads or processes."""

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

_NO_MEMORY = r"failed to map segment|annot allocate memory|out of memory"
"""Messages of loaders and SQLite for insufficient memory (no MemoryError is raised)."""

_NO_THREAD = "can't start new thread"
"""Message of Python if the limit of threads and processes is reached."""


class Ended(BaseException):
    """Exception raised by a signal that ends the process; partially written files are removed."""


class Failures(TdintError):
    """Errors of the inputs that failed, raised after all other inputs are processed.

    The exit code is the smallest exit code of the errors.
    """

    def __init__(self, errors: Sequence[TdintError]) -> None:
        super().__init__("\n".join(_lines_of_errors(errors)))
        self.exit_code = min(error.exit_code for error in errors)


def _lines_of_errors(errors: Sequence[TdintError]) -> list[str]:
    """Return the messages of errors. Records that lack the same properties have one message, which
    ends with a command line that specifies all of them."""
    lines = [str(error) for error in errors if not isinstance(error, IncompleteRecord)]
    incomplete: dict[tuple[str, Missing], list[tuple[str, Missing]]] = {}
    for error in errors:
        if isinstance(error, IncompleteRecord):
            file, message = _file_and_message(str(error))
            # Files with different likely units have a common message.
            key = message, error.missing._replace(units="")
            incomplete.setdefault(key, []).append((file, error.missing))
    for (message, _), found in incomplete.items():
        files = [file for file, _ in found]
        line = _line_with(found[0][1], files)
        lines.append(f"{abbreviate(files, _NAMED_IN_ERRORS)}: {message}{line}")
    return lines


_NAMED_IN_ERRORS = 10  # maximum number of files that a common error names


def _line_with(missing: Missing, files: Sequence[str]) -> str:
    """Return the end of a message: an example of a command line that specifies all properties that
    records lack; empty if no property is missing."""
    settings = current()
    arguments, words = list(settings.arguments), list[str]()
    has_units = any(word.partition("=")[0] == "--units" for word in arguments)
    words += ["--step", "0.01"] if missing.step else []
    if missing.units and not has_units:
        words += ["--units", _units_of(missing.units, files, arguments)]
    words += ["--column", missing.columns[0]] if missing.columns else []
    words += ["--skip-lines", str(missing.skip_lines)] if missing.skip_lines else []
    if not (words and arguments):
        return ""
    if all(word in settings.options for word in words if word.startswith("--")):
        line = shlex.join(["tdint", *arguments, *words])
    else:
        # The command reads the properties from a description of the records.
        named = [word for word in arguments[1:] if word in files or is_folder(word)] or files[:1]
        first = arguments.index(named[0]) if named[0] in arguments else len(arguments)
        rest = [word for word in arguments if word not in named]
        rest.insert(first, "records.yaml")
        line = shlex.join(["tdint", "info", *named, *words, "--export", "records.yaml"])
        line += f", then {shlex.join(['tdint', *rest])}"
    rows = " (or --rows in place of --column)" if missing.rows and missing.columns else ""
    return f". For example: {line}{rows}"


_FILES_WITH_UNITS = 3  # files that an example names; more files are named by their suffixes


def _units_of(units: str, files: Sequence[str], arguments: Sequence[str]) -> str:
    """Return the value of --units of an example: the units of all files, or by file if the command
    also reads other files, which may state their units."""
    models = (".yaml", ".yml")
    others = [w for w in arguments if w not in files and is_file(w) and not w.endswith(models)]
    if not others and all(file in arguments for file in files):
        return units
    names = [PurePath(file).name for file in files]
    if len(files) > _FILES_WITH_UNITS:
        names = sorted({f"*{PurePath(file).suffix or PurePath(file).name}" for file in files})
    return ",".join(f"{name}={units}" for name in names)


def exit_code_of(command: Callable[[], Any], settings: Settings) -> int:
    """Run a command, report its error, if any, and return the exit code.

    After a signal, only the signal is reported, and the exit code is 128 plus its number.

    Parameters
    ----------
    command : callable
        Function without arguments that runs the command. An integer result is the exit code; any
        other result means success (0).
    """
    received: list[int] = []  # numbers of the received signals
    try:
        with _signals_as_exception(received), _warnings_as_lines(), _notes_of_library():
            code = command()
            code = code if isinstance(code, int) else 0
    except BaseException as error:
        # Do not rely on the class `Ended`: a signal during an import can raise another exception.
        code = 0 if received else _report_error(error, settings)
    if not received:
        return code
    complain(_signal_word(received[0]))
    return AFTER_SIGNAL + received[0]


def _signal_word(number: int) -> str:
    """Return the message about a signal that ended the command."""
    return "Interrupted" if number == signal.SIGINT else "Terminated"


def _report_error(error: BaseException, settings: Settings) -> int:
    """Print the message of an exception that ended a command, and return the exit code.

    Errors of click and of tdint, insufficient memory, a limit of threads and a full disk have
    separate messages. Any other exception is reported as a bug, with exit code 1.
    """
    # The exception is raised again, so that its type selects one of the following clauses.
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
        complain(_signal_word(signal.SIGINT))
        return INTERRUPTED
    except Exception as error:
        if settings.debug:
            complain(traceback.format_exc().rstrip())
        if few_files := _few_files(error):
            lines, code = [few_files], OUT_OF_RESOURCES
        elif isinstance(error, TdintError):
            text = _lines_of_errors([error])[0]
            lines, code = text.splitlines() or [type(error).__name__], error.exit_code
        elif resource := _missing_resource(error, settings.options):
            lines, code = [resource], OUT_OF_RESOURCES
        # Click raises OSError if it writes to a full disk; `emit` raises OutputError.
        elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
            lines = [f"standard output: cannot be written: {error.strerror}"]
            code = OutputError.exit_code
        else:
            text = " ".join(f"{type(error).__name__}: {error}".split())
            lines, code = [f"internal error (a bug): {text}; run again with --debug"], BUG
        # A message about a model file uses the keys of the file instead of the option names.
        line_settings = Settings() if code == ModelError.exit_code else settings
        for line in lines:
            complain(f"Error: {line}", line_settings)
        return code


def _few_files(error: BaseException | None) -> str:
    """Return a message if an error or one of its causes reports that no further file can be opened;
    otherwise an empty text. Python reports modules that it cannot open as missing."""
    while error is not None:
        number = getattr(error, "errno", None)
        if isinstance(error, ImportError):
            try:
                os.close(os.open(os.devnull, os.O_RDONLY))
            except OSError as failure:
                number = failure.errno
        if number in (errno.EMFILE, errno.ENFILE):
            return (
                "no further file can be opened; raise the limit on open files (ulimit -n), or end "
                "other programs"
            )
        error = error.__cause__ or error.__context__
    return ""


def _missing_resource(error: BaseException | None, options: Collection[str]) -> str:
    """Return a message if an error or one of its causes reports insufficient memory, or a limit of
    threads and processes; otherwise an empty text. `options` are those of the command."""
    fewer = "use a smaller --jobs, or " if "--jobs" in options else ""
    while error is not None:
        number = getattr(error, "errno", None)
        text = str(error) if isinstance(error, ImportError | OSError | RuntimeError) else ""
        if isinstance(error, MemoryError) or number == errno.ENOMEM or re.search(_NO_MEMORY, text):
            return f"not enough memory; {fewer}use a smaller model or record"
        # The system refuses to start a process with EAGAIN.
        if number == errno.EAGAIN or _NO_THREAD in text:
            return (
                f"no process or thread can be started; {fewer}raise the limit on processes (ulimit "
                "-u, pids of a container), or end other programs"
            )
        error = error.__cause__ or error.__context__
    return ""


@contextmanager
def _signals_as_exception(received: list[int]) -> Iterator[None]:
    """Raise `Ended` for a signal and append the signal number to `received`.

    Further signals are ignored while the command cleans up.
    """

    def end(number: int, _: Any) -> None:
        """Handle a signal: store its number, ignore further signals and raise `Ended`."""
        received.append(number)
        # In a finalizer, Python prints the exception `Ended` instead of raising it. Print no
        # message: the thread that `end_in_time` has started ends the process.
        sys.unraisablehook = lambda _: None
        for ending in handled:
            signal.signal(ending, signal.SIG_IGN)
        raise Ended

    handled: dict[signal.Signals, Any] = {}
    hook = sys.unraisablehook
    # Python allows signal handlers only in the main thread.
    if threading.current_thread() is threading.main_thread():
        handled = {
            ending: signal.getsignal(ending)
            for ending in ENDING
            if signal.getsignal(ending) in _DEFAULT_HANDLERS
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
        """Print a warning of Python; `warnings.showwarning` defines the arguments."""
        warn(" ".join(str(message).split()))

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


class _Notes(logging.Handler):
    """Log handler that prints the messages of the library as notes and warnings.

    An equal note is printed once: several loops of a plug-in can have the same description.
    """

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self._printed: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a log message: as a warning from the level WARNING, otherwise as a note."""
        message = record.getMessage()
        if record.levelno >= logging.WARNING:
            warn(message)
        elif message not in self._printed:
            self._printed.add(message)
            note(message)


@contextmanager
def _notes_of_library() -> Iterator[None]:
    """Print the log messages of the library `tdint` on standard error."""
    logger, handler = logging.getLogger("tdint"), _Notes(logging.INFO)
    # If the handler of an outer command is active, a second handler would print messages twice.
    if any(isinstance(other, _Notes) for other in logger.handlers):
        yield
        return
    before, propagates = logger.level, logger.propagate
    # Omit the assumptions that are made when a record is read. The command reports them from the
    # record, because the log messages of a worker process do not reach this process.
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
    """Start a thread that ends this process after a signal, and return without waiting.

    Returns
    -------
    callable
        Function to call with the exit code after the command has ended and reported its result.
        After a signal, the function ends the process immediately, without cleanup of libraries,
        because an interrupted library may fail during its cleanup. Otherwise it returns. Python may
        then still wait for threads; a signal ends this wait without a message.
    """
    if threading.current_thread() is not threading.main_thread():
        return lambda code=None: None
    is_reported = threading.Event()  # set after the result is reported; signals are then silent
    read_end, write_end = os.pipe()  # Python writes the numbers of received signals to this pipe.
    set_nonblocking(write_end)

    def watch() -> None:
        """Wait for a signal that ends the process, give the command time to clean up, and end."""
        # Python writes the number of each handled signal to the pipe; ignored signals are not
        # written. The first signal in the pipe ends the process.
        while data := os.read(read_end, 1):
            if data[0] in ENDING:
                threading.Event().wait(_PATIENCE)
                _end(data[0], is_reported)

    def ended(code: object = None) -> None:
        """Record that the command has ended; end the process at once if a signal ended it."""
        is_reported.set()
        if code in [AFTER_SIGNAL + number for number in ENDING]:
            _end(int(str(code)) - AFTER_SIGNAL, is_reported)

    try:
        threading.Thread(target=watch, daemon=True).start()
    except RuntimeError:
        # The thread limit is reached (ulimit -u, container). The handlers of Python remain active.
        os.close(read_end)
        os.close(write_end)
        return lambda code=None: None
    signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    # The handlers of Python would show a traceback after the end of the command. Replace only these
    # handlers and the handler of `tdint_cli.start`, because other handlers were set on purpose.
    for number in ENDING:
        handler = signal.getsignal(number)
        if handler in _DEFAULT_HANDLERS or getattr(handler, "__module__", "") == "tdint_cli":
            signal.signal(number, _leave_to_watch_thread)
    return ended


def _leave_to_watch_thread(*_: Any) -> None:
    """Ignore a signal outside of the command; the watch thread ends the process.

    Otherwise Python would show a traceback or would be interrupted during its exit.
    """


_DEFAULT_HANDLERS = (signal.SIG_DFL, signal.default_int_handler, _leave_to_watch_thread)
"""Default handlers. Any other handler, or SIG_IGN (`nohup`), was set on purpose."""


def _end(number: int, is_reported: threading.Event) -> None:
    """End the process immediately with the exit code of a signal.

    `is_reported` is the set after the command has reported its result; the signal is then not
    reported.
    """
    import multiprocessing

    from tdint.files import remove_unfinished

    with suppress(Exception):
        # Kill all worker processes and remove partially written files.
        for process in multiprocessing.active_children():
            process.kill()
        remove_unfinished()
        if not is_reported.is_set():
            complain(_signal_word(number))
    os._exit(AFTER_SIGNAL + number)
