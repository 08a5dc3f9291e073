"""The same work on one record after another, in this process or in several; the outcomes come in the order given."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from tdint.errors import AnalysisError, RecordError, TdintError
from tdint.input_bytes import READ, STDIN
from tdint_cli.batch.workers import Lost, Workers
from tdint_cli.terminal.progress import counted

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
            yield from _shared(attempt, rest, stack.enter_context(Workers(attempt, min(jobs, len(rest)))))
            return


def _shared(
    attempt: Callable[[Task], Result | TdintError],
    tasks: Sequence[Task],
    workers: Workers[Task, Result | TdintError],
) -> Iterator[Result | TdintError]:
    """The outcomes of processes in the order of the tasks; a process that is lost costs its own record only."""
    own = [place for place, task in enumerate(tasks) if task.source == STDIN]  # Others have no standard input.
    shared = [place for place in range(len(tasks)) if place not in own]
    come = workers.outcomes([tasks[place] for place in shared])
    done: dict[int, Result | TdintError] = {}
    for place, task in enumerate(tasks):
        if place in own:
            yield attempt(task)
            continue
        while place not in done:
            number, outcome = next(come)
            other = tasks[shared[number]]
            done[shared[number]] = _lost(other) if isinstance(outcome, Lost) else outcome
        yield done.pop(place)


def _lost(task: Task) -> AnalysisError:
    return AnalysisError(
        f"{task.source}: the process that worked on it ended before its time (killed, or is there not enough memory?); "
        "use fewer --jobs"
    )


def _attempt(work: Callable[[Task], Result], task: Task) -> Result | TdintError:
    try:
        return copy_context().run(_unnoted, work, task)
    except RecordError as error:
        return error
    except AnalysisError as error:
        return AnalysisError(f"{task.source}: {error}")


def _unnoted(work: Callable[[Task], Result], task: Task) -> Result:
    """The result as another process makes it: what it reads is told by its records alone."""
    READ.set(None)
    return work(task)
