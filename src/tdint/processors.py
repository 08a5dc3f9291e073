"""Work on the processors of this machine: threads, for compiled loops let Python go on meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

_AHEAD = 2
"""Items that each thread has, the one that it is at among them: none waits for who writes the results."""


def on_threads(work: Callable[[Item], Result], items: Iterable[Item], jobs: int) -> Iterator[Result]:
    """What `work` makes of each item, in the order in which they are done; what it raises is raised here.

    No more than a few items are under way or waiting to be taken.
    """
    from concurrent.futures import (  # not for who asks for their number
        FIRST_COMPLETED,
        Future,
        ThreadPoolExecutor,
        wait,
    )

    waiting = iter(items)
    running: set[Future[Result]] = set()
    pool = ThreadPoolExecutor(jobs)
    try:
        while True:
            while len(running) < _AHEAD * jobs and (item := next(waiting, None)) is not None:
                running.add(pool.submit(work, item))
            if not running:
                return
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for one in finished:
                yield one.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
