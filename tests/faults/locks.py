"""Stress of the locks: many processes lock a file or a directory whose lock file is removed
repeatedly, and overlaps of the locked sections are counted.

    python tests/faults/locks.py [--seconds 30] [--processes 6] [--seed 0]
"""

import argparse
import multiprocessing
import random
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from functools import partial
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path

from tdint import system
from tdint.errors import OutputError
from tdint.studies.store import schema as store_schema

Lock = Callable[[Path], AbstractContextManager[None]]


def _file(folder: Path) -> AbstractContextManager[None]:
    return system.locked(folder / "lock", lambda: None)


LOCKS: dict[str, tuple[Lock, str]] = {
    "file": (_file, "lock"),
    "directory": (store_schema.locked, store_schema.LOCK),
}
"""Functions that lock, by name, and the name of the lock file in the directory."""

REMOVED = ("never", "with the lock", "at any time")
"""When a process removes the lock file: with the lock (as `tdint compile --clean`), or at any time.
No lock file can exclude others if it is removed without the lock."""


def _work(
    folder: Path,
    lock: Lock,
    name: str,
    removed: str,
    seed: int,
    end: float,
    counts: tuple["Synchronized[int]", "Synchronized[int]", "Synchronized[int]"],
) -> None:
    source = random.Random(seed)
    inside, sections, overlaps = counts
    file = folder / name

    def remove() -> None:
        if source.random() < 0.5:
            with suppress(OSError):
                file.unlink()

    while time.monotonic() < end:
        if removed == "at any time":
            remove()
        # A directory that is in use is refused; a file is waited for.
        with suppress(OutputError), lock(folder):
            with inside.get_lock():
                inside.value += 1
                overlaps.value += inside.value > 1
            time.sleep(0.001 * source.random())
            with inside.get_lock():
                inside.value -= 1
            if removed == "with the lock":
                remove()
            with sections.get_lock():
                sections.value += 1


def stress(
    name: str, removed: str, *, seconds: float, processes: int = 6, seed: int = 0
) -> tuple[int, int]:
    """Return the number of locked sections, and of sections that overlapped with another."""
    context = multiprocessing.get_context("fork")
    inside, sections, overlaps = (context.Value("q", 0) for _ in range(3))
    lock, lock_file = LOCKS[name]
    with tempfile.TemporaryDirectory() as folder:
        work = partial(_work, Path(folder), lock, lock_file, removed)
        end = time.monotonic() + seconds
        workers = [
            context.Process(target=work, args=(seed + i, end, (inside, sections, overlaps)))
            for i in range(processes)
        ]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        assert not any(worker.exitcode for worker in workers)
    return sections.value, overlaps.value


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--processes", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    wrong = 0
    print("| lock | removed | sections | overlaps |")
    print("|---|---|---:|---:|")
    for name in LOCKS:
        for removed in REMOVED:
            sections, overlaps = stress(name, removed, **vars(arguments))
            print(f"| {name} | {removed} | {sections} | {overlaps} |", flush=True)
            wrong += overlaps * (removed != "at any time")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
