"""From what goes wrong to one line per problem on standard error and an exit code; Ctrl-C and SIGTERM end in time.

Python sees a signal between two of its own instructions only, and an exception is made of it there. Where a library
works on for longer, a thread that the system tells of the signal ends the process: without a temporary file, and
without processes left behind.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

import click

from tdint.errors import ModelError, TdintError
from tdint.system import do_not_wait
from tdint_cli.terminal import Settings, complain, note, warn

BUG = 1
OUT_OF_MEMORY = 5
INTERRUPTED, TERMINATED = 130, 143
"""What a shell reports for a program ended by Ctrl-C (SIGINT), or by SIGTERM."""


class Terminated(BaseException):
    """The process was asked to end (SIGTERM): raised wherever it is, so that no half-written file stays."""


class Failures(TdintError):
    """Inputs of one command that failed, after the others were done; the exit code is the smallest of theirs."""

    def __init__(self, errors: Sequence[TdintError]) -> None:
        super().__init__("\n".join(map(str, errors)))
        self.exit_code = min(error.exit_code for error in errors)


def exit_code_of(command: Callable[[], Any], settings: Settings) -> int:
    """Run a command and tell its exit code; whatever it raises is reported."""
    try:
        with _termination_as_an_exception(), _warnings_as_lines(), _notes_of_the_library():
            code = command()
            return code if isinstance(code, int) else 0
    except click.ClickException as error:
        _show(error)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        complain("Interrupted")
        return INTERRUPTED
    except Terminated:
        complain("Terminated")
        return TERMINATED
    except Exception as error:
        if settings.debug:
            complain(traceback.format_exc().rstrip())
        lines, code = _report(error)
        # What is wrong with a file is said in the words of the file.
        said_by = Settings() if code == ModelError.exit_code else settings
        for line in lines:
            complain(f"Error: {line}", said_by)
        return code


def _show(error: click.ClickException) -> None:
    """What click says of a command line, on one line; `tdint` without anything shows its help."""
    if isinstance(error, getattr(click.exceptions, "NoArgsIsHelpError", ())):
        error.show()
        return
    context = error.ctx if isinstance(error, click.UsageError) else None
    hint = f" (see {context.command_path} --help)" if context else ""
    complain(f"Error: {' '.join(error.format_message().split())}{hint}")


def _report(error: Exception) -> tuple[list[str], int]:
    """What to say about an error, and its exit code."""
    if isinstance(error, TdintError):
        return str(error).splitlines() or [type(error).__name__], error.exit_code
    if isinstance(error, MemoryError):
        reason = "not enough memory; leave out --history and --plot, or take fewer steps, stories or periods"
        return [reason], OUT_OF_MEMORY
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return [f"internal error (a bug): {text}; run again with --debug"], BUG


@contextmanager
def _termination_as_an_exception() -> Iterator[None]:
    """SIGTERM ends the command as Ctrl-C does; asking again changes nothing while it cleans up."""

    def end(*_: Any) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise Terminated

    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield  # Elsewhere Python sets no handlers, and one that is there, or SIG_IGN, was meant.
        return
    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


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
    before, propagates = logger.level, logger.propagate
    # The assumptions of a record come with it, from other processes, too, and are told by the command.
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


def end_in_time() -> Callable[[], None]:
    """Watch for both signals until this process ends. What comes back is to be called when the command has ended and
    said so: threads may be waited for then, which another signal ends without a word."""
    if threading.current_thread() is not threading.main_thread():
        return lambda: None
    said = threading.Event()
    source, told = os.pipe()
    do_not_wait(told)
    threading.Thread(target=_watch, args=(source, said), daemon=True).start()
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    return partial(_leave_to_the_watch, said)


def _leave_to_the_watch(said: threading.Event) -> None:
    said.set()
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: None)  # Python itself would show a traceback.


def _watch(source: int, said: threading.Event) -> None:
    # A signal that is ignored is not told; the first one counts.
    while data := os.read(source, 1):
        if data[0] in (signal.SIGINT, signal.SIGTERM):
            threading.Event().wait(_PATIENCE)
            _end(data[0], said)


def _end(number: int, said: threading.Event) -> None:
    import multiprocessing

    from tdint.files import remove_unfinished

    with suppress(Exception):
        for process in multiprocessing.active_children():
            process.kill()
        remove_unfinished()
        if not said.is_set():
            complain("Interrupted" if number == signal.SIGINT else "Terminated")
    os._exit(INTERRUPTED if number == signal.SIGINT else TERMINATED)
