"""The same work on one record after another, in this process or in several; the outcomes come in the order given."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from tdint.errors import AnalysisError, RecordError, TdintError
from tdint_cli.batch.sources import STDIN
from tdint_cli.errors import INTERRUPTED, Terminated
from tdint_cli.terminal.progress import counted

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

Result = TypeVar("Result")


@dataclass(frozen=True)
class Task:
    """A record to work on, and the table to make of it; None if it goes into a table with others.

    `others` are files that belong to the same record.
    """

    source: str
    table: Path | None = None
    others: tuple[str, ...] = ()


@contextmanager
def outcomes(
    work: Callable[[Task], Result], tasks: Sequence[Task], *, jobs: int, label: str, to_terminal: bool
) -> Iterator[Iterable[Result | TdintError]]:
    """Do the work on all tasks: of each its result, or why it failed (RecordError, AnalysisError).

    Parameters
    ----------
    work : callable
        A function of a module, or a `functools.partial` of one: processes find it by its name.
    tasks : sequence of Task
        What to do.
    jobs : int
        Number of processes at most.
    label : str
        What the progress bar is called that is shown if standard error is a terminal.
    to_terminal : bool
        Whether the data go to standard output; if that is a terminal, too, no bar is drawn into them.
    """
    with ExitStack() as stack:
        results = _outcomes(partial(_attempt, work), tasks, jobs, stack)
        yield stack.enter_context(counted(results, len(tasks), label, to_terminal=to_terminal))


def _outcomes(
    attempt: Callable[[Task], Result | TdintError], tasks: Sequence[Task], jobs: int, stack: ExitStack
) -> Iterator[Result | TdintError]:
    """In this process up to the first record that is done: what it loads or compiles is then there for the others."""
    for done, task in enumerate(tasks, start=1):
        outcome = attempt(task)
        yield outcome
        rest = tasks[done:]
        if jobs > 1 and not isinstance(outcome, TdintError) and len(rest) > 1:
            yield from _shared(attempt, rest, stack.enter_context(_processes(min(jobs, len(rest)))))
            return


def _shared(
    attempt: Callable[[Task], Result | TdintError], tasks: Sequence[Task], executor: Executor
) -> Iterator[Result | TdintError]:
    from concurrent.futures.process import BrokenProcessPool

    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    try:
        with _interrupts_held_back(), warnings.catch_warnings():
            # numpy's threads, which know how to be forked, are all there are.
            warnings.filterwarnings("ignore", ".*fork", DeprecationWarning)
            # Other processes have no standard input.
            futures: list[Future[Result | TdintError] | None] = [
                None if task.source == STDIN else executor.submit(_interruptible, ignored, attempt, task)
                for task in tasks
            ]
        for task, future in zip(tasks, futures, strict=True):
            yield future.result() if future else attempt(task)
    except BrokenProcessPool:
        raise AnalysisError("a process ended before its time (is there enough memory?); use fewer --jobs") from None


@contextmanager
def _processes(count: int) -> Iterator[Executor]:
    """Processes that inherit what this one has loaded, where forking is safe; else new ones, which load from the cache.

    At the end they finish the tasks that they were handed and get no more; at Ctrl-C they leave these as well.
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    executor = ProcessPoolExecutor(count, context, initializer=_leave_signals_to_the_first)
    try:
        yield executor
    except Terminated:
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _leave_signals_to_the_first() -> None:
    """A process that shares the work ends at once at SIGTERM, which the first one sends."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _ignore_interrupts()


def _ignore_interrupts() -> None:
    """Ctrl-C reaches all processes of a terminal: one that ends while it hands over a result would hold up the rest."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C waits until all processes are there: half of them could not be ended."""
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if came and before is not signal.SIG_IGN:
        raise KeyboardInterrupt


def _interruptible(ignored: bool, attempt: Callable[[Task], Result | TdintError], task: Task) -> Result | TdintError:
    """Do a task; at Ctrl-C, unless the first process ignores it, this one ends without a word: the first one speaks."""
    if not ignored:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return attempt(task)
    except KeyboardInterrupt:
        os._exit(INTERRUPTED)
    finally:
        _ignore_interrupts()


def _attempt(work: Callable[[Task], Result], task: Task) -> Result | TdintError:
    try:
        return work(task)
    except RecordError as error:
        return error
    except AnalysisError as error:
        return AnalysisError(f"{task.source}: {error}")
