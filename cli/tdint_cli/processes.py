"""Apply a function to each record, in this process or in several; results keep the order of the
tasks.

Reading, tables and figures of records keep the global interpreter lock: two threads needed 1.1 to
1.5 times the time of two processes for elastic spectra of 40 records. Time loops of buildings
release the lock and run on threads (`tdint.system.on_threads`).

A lost process loses only its task. A worker never outlives the process that started it: Linux sends
SIGKILL to the worker, and on other systems a thread of the worker waits for the end of the first
process.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Thread
from traceback import format_exc
from typing import TYPE_CHECKING, Any, TypeVar

from tdint.errors import AnalysisError, RecordError, TdintError
from tdint.files import INPUT_DIGESTS, STDIN
from tdint.system import START_OF_PROCESSES, block_signals, die_with_parent, unblock_signals
from tdint_cli.terminal import ENDING, counted

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


Item = TypeVar("Item")
Result = TypeVar("Result")


def _begin(parent: int) -> None:
    """Prepare a worker process. `parent` is the identifier of the process that has started it."""
    # Ctrl-C reaches all processes of a terminal. The first process reports the interrupt and ends
    # the workers by SIGTERM.
    signal.set_wakeup_fd(-1)  # A forked worker inherits the descriptor of the first process.
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
    unblock_signals(ENDING)
    die_with_parent(parent)
    if sys.platform != "linux":
        Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait until the process that started this worker ends, and end this worker."""
    from multiprocessing import parent_process

    if first := parent_process():
        first.join()
        os._exit(1)


class _Worker:
    """Process that calls functions, one at a time, until the `with` statement ends.

    Each process has its own pipe, which ends with the process, also in the middle of a result. The
    pool of `concurrent.futures` has one pipe for all results and would wait for the rest of the
    result.
    """

    def __init__(self) -> None:
        """Start the process.

        Raises
        ------
        OSError, ImportError, NotImplementedError
            Limits of processes or files, or a system without semaphores.
        """
        # Imported late, because a single record is read in this process.
        from multiprocessing import get_context

        context: Any = get_context(START_OF_PROCESSES)
        self.pipe, end_of_worker = context.Pipe()
        arguments = (end_of_worker, os.getpid())
        self._process = context.Process(target=_serve, args=arguments, daemon=True)
        # A signal raises an exception in this process. In the functions that it calls after a fork,
        # Python would discard this exception, so that the signal would be lost. Signals are
        # therefore blocked until the process has started.
        with end_of_worker, warnings.catch_warnings(), block_signals(ENDING):
            # The only threads are the threads of NumPy, which are safe to fork.
            warnings.filterwarnings("ignore", ".*fork", DeprecationWarning)
            self._process.start()

    def begin(self, function: Callable[[Any], Any], argument: Any) -> None:
        """Start a call. The argument is sent as it is now."""
        with suppress(OSError):  # The process has ended, and has no outcome.
            self.pipe.send((function, argument))

    def outcome(self) -> tuple[Any, Exception | None] | None:
        """Wait for the call; return its result and its exception, or None if the process ended."""
        outcome: tuple[Any, Exception | None] | None = None
        with suppress(EOFError, OSError):
            outcome = self.pipe.recv()
        return outcome

    def __enter__(self) -> _Worker:
        """Return the worker."""
        return self

    def __exit__(self, *exception: object) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join()
        self.pipe.close()


def _serve(pipe: Connection, parent: int) -> None:
    """Call functions in a worker process: receive a function and its argument from `pipe`, send the
    result and None, or None and an exception."""
    _begin(parent)
    while True:
        function, argument = pipe.recv()
        try:
            outcome = pickle.dumps((function(argument), None))
        except Exception as error:
            error.add_note(format_exc())
            outcome = pickle.dumps((None, error))
        pipe.send_bytes(outcome)


def _result(outcome: tuple[Any, Exception | None]) -> Any:
    """Return the result of a call, or raise its exception."""
    result, error = outcome
    if error is not None:
        raise error
    return result


@contextmanager
def worker() -> Iterator[Callable[..., Callable[[], Any]]]:
    """Yield a function that starts the call of a function in a process that ends with the `with`
    statement, and returns a function that waits for the result.

    If the process cannot start or ends unexpectedly, this process calls the function.
    """
    with ExitStack() as stack:

        def begin(function: Callable[[Item], Result], argument: Item) -> Callable[[], Result]:
            """Start the call of `function` with `argument`."""
            process = None
            with suppress(OSError, ImportError, NotImplementedError):
                process = stack.enter_context(_Worker())
                process.begin(function, argument)

            def result() -> Result:
                """Return the result of the call."""
                outcome = process and process.outcome()
                return _result(outcome) if outcome else function(argument)

            return result

        yield begin


@dataclass(frozen=True)
class Task:
    """Record to process.

    Attributes
    ----------
    table : Path | None
        Output table of the record; None for standard output.
    others : tuple of str
        Further files that belong to the same record.
    """

    source: str
    table: Path | None = None
    others: tuple[str, ...] = ()


@contextmanager
def outcomes(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    jobs: int,
    label: str,
    to_terminal: bool,
) -> Iterator[Iterable[Result | TdintError]]:
    """Apply `work` to all tasks; yield an iterator over their results or errors, in their order.

    An error is a RecordError or AnalysisError.

    Parameters
    ----------
    work : callable
        A module-level function, or a `functools.partial` of a module-level function, because
        processes import the function by name.
    label : str
        Label of the progress bar, which is shown if standard error is a terminal.
    to_terminal : bool
        True if the data are written to standard output. If standard output is also a terminal, no
        progress bar is shown.
    """
    attempt = partial(_attempt, work)
    with ExitStack() as stack:

        def results() -> Iterator[Result | TdintError]:
            """Yield the outcomes; start worker processes after the first successful record. The
            workers can then use the modules and compiled loops that the first record has loaded.
            """
            for done, task in enumerate(tasks, start=1):
                outcome = attempt(task)
                yield outcome
                remaining = tasks[done:]
                if jobs > 1 and not isinstance(outcome, TdintError) and len(remaining) > 1:
                    yield from stack.enter_context(closing(_shared(attempt, remaining, jobs)))
                    return

        yield stack.enter_context(counted(results(), len(tasks), label, to_terminal=to_terminal))


def _shared(
    attempt: Callable[[Task], Result | TdintError], tasks: Sequence[Task], jobs: int
) -> Generator[Result | TdintError]:
    """Yield the outcomes of the workers (result, or error of the record) in the order of the tasks.

    A task that reads standard input is executed in this process, because workers have no standard
    input. If a process ends unexpectedly, a new process repeats its task, so that only the record
    of a process that ends again is an error.
    """
    from multiprocessing.connection import wait

    remaining = deque(i for i, task in enumerate(tasks) if task.source != STDIN)
    outcomes_of_tasks: dict[int, Result | TdintError] = {}
    lost: set[int] = set()
    with ExitStack() as stack:
        working: dict[Any, tuple[_Worker, int]] = {}

        def begin(process: _Worker, i: int) -> None:
            """Give task `i` to a process."""
            process.begin(attempt, tasks[i])
            working[process.pipe] = process, i

        def collect() -> None:
            """Wait for a process, keep its outcome, and give it the next task."""
            process, i = working.pop(wait(working)[0])
            outcome = process.outcome()
            if outcome is not None:
                outcomes_of_tasks[i] = _result(outcome)
            elif i in lost:
                outcomes_of_tasks[i] = _lost(tasks[i])
            else:
                lost.add(i)
                remaining.appendleft(i)
            if remaining:
                begin(process if outcome else stack.enter_context(_Worker()), remaining.popleft())

        for _ in range(min(jobs, len(remaining))):
            begin(stack.enter_context(_Worker()), remaining.popleft())
        for i, task in enumerate(tasks):
            if task.source == STDIN:
                outcomes_of_tasks[i] = attempt(task)
            while i not in outcomes_of_tasks:
                collect()
            yield outcomes_of_tasks.pop(i)


def _lost(task: Task) -> AnalysisError:
    """Return the error of a record whose process ended twice."""
    return AnalysisError(
        f"{task.source}: the process for this record ended unexpectedly, because it was "
        "killed or because memory was insufficient; use fewer --jobs"
    )


def _attempt(work: Callable[[Task], Result], task: Task) -> Result | TdintError:
    """Return the result of a task, or its RecordError or AnalysisError; raise other exceptions."""
    try:
        # Files that a worker process reads cannot be registered as inputs in the first process. No
        # process registers them here, so that the list of inputs does not depend on the number of
        # processes; each record reports its files.
        context = copy_context()
        context.run(INPUT_DIGESTS.set, None)
        return context.run(work, task)
    except RecordError as error:
        return error
    except AnalysisError as error:
        return AnalysisError(f"{task.source}: {error}")
