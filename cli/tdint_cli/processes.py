"""Apply a function to each record, in this process or in several; results keep the order of the
tasks.

Reading, tables and figures of records keep the global interpreter lock: two threads needed 1.1 to
1.5 times the time of two processes for elastic spectra of 40 records. Time loops of buildings
release the lock and run on threads (`tdint.system.on_threads`).

Each worker process handles one task at a time, so a lost process loses only this task. A worker
never outlives the process that started it: Linux sends SIGKILL to the worker, and on other systems
a thread of the worker waits for the end of the first process.
"""

from __future__ import annotations

import os
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
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from tdint.errors import AnalysisError, RecordError, TdintError
from tdint.files import INPUT_DIGESTS, STDIN
from tdint.system import START_OF_PROCESSES, block_signals, die_with_parent, unblock_signals
from tdint_cli.terminal import ENDING, counted

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess


Result = TypeVar("Result")

_GRACE = 5.0
"""Time in seconds that a worker has to end before it is killed."""


class Lost(Exception):
    """Outcome of a task whose process ended before the task was finished."""


class Workers(Generic[Result]):
    """Worker processes that apply a function to tasks, until `end` is called.

    Parameters
    ----------
    function : callable
        A module-level function, or a `functools.partial` of a module-level function, because new
        processes import the function by name. Its exceptions are raised in this process.
    """

    def __init__(self, function: Callable[[Task], Result], count: int) -> None:
        # Imported late, because a single record is read in this process.
        from multiprocessing import get_context

        self._context: Any = get_context(START_OF_PROCESSES)
        self._function = function
        self._count = count
        self._workers: list[_Worker] = []

    def end(self) -> None:
        """End all worker processes."""
        for worker in self._workers:
            worker.end()

    def outcomes(self, tasks: Sequence[Task]) -> Iterator[tuple[int, Result | Lost]]:
        """Yield the index and the outcome of each task, in the order of completion.

        Raises
        ------
        Exception
            Any exception that the function raises for a task. A process that ends without an
            outcome does not raise; its task has the outcome `Lost`.
        """
        from multiprocessing import connection

        waiting = deque(enumerate(tasks))
        while waiting or any(worker.task_index is not None for worker in self._workers):
            # If tasks remain, at least one worker is busy after this call. The call raises an
            # exception if no process can be started.
            self._hand_out(waiting)
            busy = [worker for worker in self._workers if worker.task_index is not None]
            # Wait until a worker sends an outcome, or ends: its sentinel is then ready.
            ready = connection.wait(
                [handle for worker in busy for handle in (worker.pipe, worker.process.sentinel)]
            )
            for worker in busy:
                if worker.pipe not in ready and worker.process.sentinel not in ready:
                    continue
                assert worker.task_index is not None
                task_index = worker.task_index
                try:
                    succeeded, outcome = worker.pipe.recv()
                except (EOFError, OSError):  # The worker ended, and its task is lost.
                    self._remove(worker)
                    yield task_index, Lost()
                    continue
                worker.task_index = None
                if not succeeded:
                    raise outcome
                yield task_index, outcome

    def _hand_out(self, waiting: deque[tuple[int, Task]]) -> None:
        """Assign waiting tasks to idle workers; start new workers up to the requested number."""
        while waiting:
            idle = next((worker for worker in self._workers if worker.task_index is None), None)
            if idle is None:
                if len(self._workers) == self._count:
                    return
                idle = self._start()
            try:
                idle.pipe.send(waiting[0][1])
                idle.task_index, _ = waiting.popleft()
            except OSError:  # The worker ended while it was idle.
                self._remove(idle)

    def _start(self) -> _Worker:
        """Start a worker process that waits for tasks, and return it with its pipe."""
        local_end, worker_end = self._context.Pipe()
        with warnings.catch_warnings():
            # The only threads are the threads of NumPy, which are safe to fork.
            warnings.filterwarnings("ignore", ".*fork", DeprecationWarning)
            process = self._context.Process(
                target=_work, args=(self._function, worker_end, os.getpid()), daemon=True
            )
            worker = _Worker(process, local_end)
            # A signal raises an exception in this process. In the functions that it calls after a
            # fork, Python would discard this exception, so that the signal would be lost. Signals
            # are therefore blocked until the process has started.
            with block_signals(ENDING):
                self._workers.append(worker)
                process.start()
        worker_end.close()
        return worker

    def _remove(self, worker: _Worker) -> None:
        """End a worker and remove it from the list of workers."""
        self._workers.remove(worker)
        worker.end()


class _Worker:
    """Worker process that this process has started, with the pipe between them.

    Attributes
    ----------
    pipe : Connection
        End of the pipe of this process, which sends tasks and receives outcomes.
    task_index : int | None
        Index of the task that the worker executes; None if it is idle.
    """

    def __init__(self, process: BaseProcess, pipe: Connection) -> None:
        self.process = process
        self.pipe = pipe
        self.task_index: int | None = None

    def end(self) -> None:
        """Terminate the process, kill it if necessary, and wait until it has ended."""
        self.pipe.close()
        if self.process.pid is None:
            return
        self.process.terminate()
        self.process.join(_GRACE)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def _work(function: Callable[[Any], Any], pipe: Connection, parent: int) -> None:
    """Process tasks until the pipe is closed.

    `pipe` is the pipe that receives the tasks and sends their outcomes: True and the result, or
    False and the exception.
    """
    # Ctrl-C reaches all processes of a terminal. The first process reports the interrupt and ends
    # the workers by SIGTERM.
    signal.set_wakeup_fd(-1)  # A forked worker inherits the descriptor of the first process.
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
    unblock_signals(ENDING)
    die_with_parent(parent)
    if sys.platform != "linux":
        Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        while True:
            item = pipe.recv()
            try:
                answer = True, function(item)
            except Exception as error:
                answer = False, error
            pipe.send(answer)


def _end_with_parent() -> None:
    """Wait until the process that started this worker ends, and end this worker."""
    from multiprocessing import parent_process

    if first := parent_process():
        first.join()
        os._exit(1)


@dataclass(frozen=True)
class Task:
    """Record to process.

    Attributes
    ----------
    table : Path | None
        Output table of the record. None if several records share a table.
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
    with ExitStack() as stack:
        results = _outcomes(partial(_attempt, work), tasks, jobs, stack)
        yield stack.enter_context(counted(results, len(tasks), label, to_terminal=to_terminal))


def _outcomes(
    attempt: Callable[[Task], Result | TdintError],
    tasks: Sequence[Task],
    jobs: int,
    stack: ExitStack,
) -> Iterator[Result | TdintError]:
    """Yield the outcomes; start worker processes after the first successful record.

    The workers can then use the modules and compiled loops that the first record has loaded.

    `attempt` is the function of a task that returns its result, or the error of its record.
    """
    for done, task in enumerate(tasks, start=1):
        outcome = attempt(task)
        yield outcome
        remaining_tasks = tasks[done:]
        if jobs > 1 and not isinstance(outcome, TdintError) and len(remaining_tasks) > 1:
            workers = Workers(attempt, min(jobs, len(remaining_tasks)))
            stack.callback(workers.end)
            yield from _shared(attempt, remaining_tasks, workers)
            return


def _shared(
    attempt: Callable[[Task], Result | TdintError],
    tasks: Sequence[Task],
    workers: Workers[Result | TdintError],
) -> Iterator[Result | TdintError]:
    """Yield the outcomes of the workers (result, or error of the record) in the order of the tasks.

    If a process ends unexpectedly, only the outcome of its record is an error. A task that reads
    standard input is executed in this process.
    """
    stdin_tasks = [
        task_index for task_index, task in enumerate(tasks) if task.source == STDIN
    ]  # Worker processes have no standard input.
    worker_tasks = [task_index for task_index in range(len(tasks)) if task_index not in stdin_tasks]
    worker_outcomes = workers.outcomes([tasks[task_index] for task_index in worker_tasks])
    done: dict[int, Result | TdintError] = {}
    for task_index, task in enumerate(tasks):
        if task_index in stdin_tasks:
            yield attempt(task)
            continue
        while task_index not in done:
            worker_index, outcome = next(worker_outcomes)
            if isinstance(outcome, Lost):
                source = tasks[worker_tasks[worker_index]].source
                outcome = AnalysisError(
                    f"{source}: the process for this record ended unexpectedly, because it was "
                    "killed or because memory was insufficient; use fewer --jobs"
                )
            done[worker_tasks[worker_index]] = outcome
        yield done.pop(task_index)


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
