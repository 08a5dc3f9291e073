"""Chunks on the processors of this machine: threads, for compiled loops let Python go on meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from tdint.campaign.engine.chunk import Done

_AHEAD = 2
"""Chunks that each thread has, the one that it is at among them: none waits for who writes the rows."""


def on_threads(work: Callable[[int], Done], numbers: Sequence[int], jobs: int) -> Iterator[Done]:
    """What `work` makes of each chunk, in the order in which they are done; what it raises is raised here.

    No more than a few chunks are under way or waiting to be taken.
    """
    waiting = iter(numbers)
    running: set[Future[Done]] = set()
    pool = ThreadPoolExecutor(jobs)
    try:
        while True:
            while len(running) < _AHEAD * jobs and (number := next(waiting, None)) is not None:
                running.add(pool.submit(work, number))
            if not running:
                return
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for one in finished:
                yield one.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
