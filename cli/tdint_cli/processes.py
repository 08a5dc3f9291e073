"""The same work on one record after another, in this process or in several; the outcomes come in
the order given.

A process does each task by itself: one that is lost takes no other's work with it. It never
outlives the process that started it, however that one ends: Linux sends it SIGKILL then, and
everywhere it ends when the pipe to the first process is gone.
"""

from __future__ import annotations

import os
import signal
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from multiprocessing import connection, get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from tdint.errors import AnalysisError, RecordError, TdintError
from tdint.files import READ, STDIN
from tdint.system import START_OF_PROCESSES, end_with, held_back, let_through
from tdint_cli.terminal import ENDING, counted

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess


Result = TypeVar("Result")

_GRACE = 5.0
"""Seconds that a worker has to end before it is killed."""


class Lost(Exception):
    """The process that had a task ended before it was done."""


class Workers(Generic[Result]):
    """Processes that apply a function to tasks, until they are ended.

    Parameters
    ----------
    function : callable
        A function of a module, or a `functools.partial` of one: new processes find it by its name.
        What it raises is raised here.
    count : int
        Number of processes.
    """

    def __init__(self, function: Callable[[Task], Result], count: int) -> None:
        self._context: Any = get_context(START_OF_PROCESSES)
        self._function = function
        self._count = count
        self._workers: list[_Worker] = []

    def end(self) -> None:
        """Leave none of them."""
        for worker in self._workers:
            worker.end()

    def outcomes(self, tasks: Sequence[Task]) -> Iterator[tuple[int, Result | Lost]]:
        """The outcome of each task with its place, in the order in which they come."""
        waiting = deque(enumerate(tasks))
        while waiting or any(worker.place is not None for worker in self._workers):
            self._hand_out(waiting)
            busy = [worker for worker in self._workers if worker.place is not None]
            ready = connection.wait(
                [end for worker in busy for end in (worker.pipe, worker.process.sentinel)]
            )
            for worker in busy:
                if worker.pipe not in ready and worker.process.sentinel not in ready:
                    continue
                assert worker.place is not None
                place = worker.place
                try:
                    succeeded, outcome = worker.pipe.recv()
                except (EOFError, OSError):  # It has ended, and its task is lost.
                    self._remove(worker)
                    yield place, Lost()
                    continue
                worker.place = None
                if not succeeded:
                    raise outcome
                yield place, outcome

    def _hand_out(self, waiting: deque[tuple[int, Task]]) -> None:
        """Give every process that has nothing to do a task, as long as there are any; start those
        that are missing."""
        while waiting:
            idle = next((worker for worker in self._workers if worker.place is None), None)
            if idle is None:
                if len(self._workers) == self._count:
                    return
                idle = self._start()
            try:
                idle.pipe.send(waiting[0][1])
                idle.place, _ = waiting.popleft()
            except OSError:  # It has ended while it had nothing to do.
                self._remove(idle)

    def _start(self) -> _Worker:
        ours, theirs = self._context.Pipe()
        with warnings.catch_warnings():
            # numpy's threads, which know how to be forked, are all there are.
            warnings.filterwarnings("ignore", ".*fork", DeprecationWarning)
            process = self._context.Process(
                target=_work, args=(self._function, theirs, os.getpid()), daemon=True
            )
            worker = _Worker(process, ours)
            # An exception in what Python does after a fork would be lost, and the signal with it.
            with held_back(ENDING):
                self._workers.append(worker)
                process.start()
        theirs.close()
        return worker

    def _remove(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.end()


class _Worker:
    """A process, this side of the pipe to it, and the place of the task that it has; None for
    nothing."""

    def __init__(self, process: BaseProcess, pipe: Connection) -> None:
        self.process = process
        self.pipe = pipe
        self.place: int | None = None

    def end(self) -> None:
        """End the process, whatever it does, and wait for it."""
        self.pipe.close()
        if self.process.pid is None:
            return
        self.process.terminate()
        self.process.join(_GRACE)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def _work(function: Callable[[Any], Any], pipe: Connection, parent: int) -> None:
    """Do tasks until the pipe ends."""
    # Ctrl-C reaches all processes of a terminal: the first one speaks and ends the others by
    # SIGTERM.
    signal.set_wakeup_fd(-1)  # that of the first process, where they are forked
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
    let_through(ENDING)
    end_with(parent)
    with suppress(EOFError, OSError):
        while True:
            item = pipe.recv()
            try:
                answer = True, function(item)
            except Exception as error:
                answer = False, error
            pipe.send(answer)


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
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    jobs: int,
    label: str,
    to_terminal: bool,
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
        Whether the data go to standard output; if that is a terminal, too, no bar is drawn into
        them.
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
    """In this process up to the first record that is done: what it loads or compiles is then there
    for the others."""
    for done, task in enumerate(tasks, start=1):
        outcome = attempt(task)
        yield outcome
        rest = tasks[done:]
        if jobs > 1 and not isinstance(outcome, TdintError) and len(rest) > 1:
            workers = Workers(attempt, min(jobs, len(rest)))
            stack.callback(workers.end)
            yield from _shared(attempt, rest, workers)
            return


def _shared(
    attempt: Callable[[Task], Result | TdintError],
    tasks: Sequence[Task],
    workers: Workers[Result | TdintError],
) -> Iterator[Result | TdintError]:
    """The outcomes of processes in the order of the tasks; a process that is lost costs its own
    record only."""
    from_stdin = [
        place for place, task in enumerate(tasks) if task.source == STDIN
    ]  # Others have no standard input.
    shared = [place for place in range(len(tasks)) if place not in from_stdin]
    come = workers.outcomes([tasks[place] for place in shared])
    done: dict[int, Result | TdintError] = {}
    for place, task in enumerate(tasks):
        if place in from_stdin:
            yield attempt(task)
            continue
        while place not in done:
            number, outcome = next(come)
            if isinstance(outcome, Lost):
                source = tasks[shared[number]].source
                outcome = AnalysisError(
                    f"{source}: the process that worked on it ended before its time (killed, or is "
                    "there not enough memory?); use fewer --jobs"
                )
            done[shared[number]] = outcome
        yield done.pop(place)


def _attempt(work: Callable[[Task], Result], task: Task) -> Result | TdintError:
    try:
        # As another process makes it: what it reads is told by its records alone.
        context = copy_context()
        context.run(READ.set, None)
        return context.run(work, task)
    except RecordError as error:
        return error
    except AnalysisError as error:
        return AnalysisError(f"{task.source}: {error}")
