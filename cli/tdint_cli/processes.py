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
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from tdint.errors import AnalysisError, RecordError, TdintError
from tdint.files import INPUT_DIGESTS, STDIN
from tdint.system import START_OF_PROCESSES, block_signals, die_with_parent, unblock_signals
from tdint_cli.terminal import ENDING, counted

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor


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


@contextmanager
def _workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of worker processes, which end with the `with` statement."""
    # Imported late, because a single record is read in this process.
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import active_children, get_context

    context = get_context(START_OF_PROCESSES)
    pool = ProcessPoolExecutor(count, context, _begin, (os.getpid(),))
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in active_children():
            worker.terminate()


def _submit(
    pool: ProcessPoolExecutor, function: Callable[[Item], Result], tasks: Iterable[Item]
) -> deque[Future[Result]]:
    """Submit tasks to a pool, which starts its processes for the first task."""
    # A signal raises an exception in this process. In the functions that it calls after a fork,
    # Python would discard this exception, so that the signal would be lost. Signals are therefore
    # blocked until the processes have started.
    with warnings.catch_warnings(), block_signals(ENDING):
        # The only threads are the threads of NumPy, which are safe to fork.
        warnings.filterwarnings("ignore", ".*fork", DeprecationWarning)
        return deque(_submitted(pool, function, task) for task in tasks)


def _submitted(
    pool: ProcessPoolExecutor, function: Callable[[Item], Result], task: Item
) -> Future[Result]:
    """Submit a task. If a process of the pool has already ended, the pool accepts no task, and the
    task has its exception as the outcome."""
    from concurrent.futures import Future
    from concurrent.futures.process import BrokenProcessPool

    # The pool would pickle the task on another thread, while this thread already changes objects of
    # it: a case stores values that it has computed.
    pickled = pickle.dumps((function, task))
    try:
        return pool.submit(_call, pickled)
    except BrokenProcessPool as error:
        outcome: Future[Result] = Future()
        outcome.set_exception(error)
        return outcome


def _call(pickled: bytes) -> Any:
    """Call a pickled function with its task, in a worker."""
    function, task = pickle.loads(pickled)
    return function(task)


@contextmanager
def worker() -> Iterator[Callable[..., Callable[[], Any]]]:
    """Yield a function that starts the call of a function in a process that ends with the `with`
    statement, and returns a function that waits for the result.

    If the process cannot start or ends unexpectedly, this process calls the function.
    """
    from concurrent.futures.process import BrokenProcessPool

    with ExitStack() as stack:

        def begin(function: Callable[[Item], Result], argument: Item) -> Callable[[], Result]:
            """Start the call of `function` with `argument`."""
            outcomes: deque[Future[Result]] = deque()
            # Limits of processes or files, or a system without semaphores
            with suppress(OSError, ImportError, NotImplementedError):
                outcomes = _submit(stack.enter_context(_workers(1)), function, [argument])

            def result() -> Result:
                """Return the result of the call."""
                with suppress(BrokenProcessPool, IndexError):
                    return outcomes[0].result()
                return function(argument)

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
                    pool = stack.enter_context(_workers(min(jobs, len(remaining))))
                    yield from _shared(attempt, remaining, pool)
                    return

        yield stack.enter_context(counted(results(), len(tasks), label, to_terminal=to_terminal))


def _shared(
    attempt: Callable[[Task], Result | TdintError], tasks: Sequence[Task], pool: ProcessPoolExecutor
) -> Iterator[Result | TdintError]:
    """Yield the outcomes of the workers (result, or error of the record) in the order of the tasks.

    A task that reads standard input is executed in this process, because workers have no standard
    input. If a process ends unexpectedly, the pool is lost. Each of the tasks without an outcome
    then has a separate process, so that only the record of a process that ends again is an error.
    """
    from concurrent.futures.process import BrokenProcessPool

    outcomes_of_pool = _submit(pool, attempt, [task for task in tasks if task.source != STDIN])
    for task in tasks:
        if task.source == STDIN:
            yield attempt(task)
            continue
        outcome = outcomes_of_pool.popleft()
        if isinstance(outcome.exception(), BrokenProcessPool):
            with _workers(1) as single:
                (outcome,) = _submit(single, attempt, [task])
                outcome.exception()  # wait for the end of the task
        if isinstance(outcome.exception(), BrokenProcessPool):
            yield AnalysisError(
                f"{task.source}: the process for this record ended unexpectedly, because it was "
                "killed or because memory was insufficient; use fewer --jobs"
            )
        else:
            yield outcome.result()


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
