"""What operating systems do in different ways."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def lock(descriptor: int) -> bool:
    """Lock an open file for this process, until it is closed; False if another process has it.

    True on a file system without locks.
    """
    try:
        import fcntl
    except ImportError:
        return _lock_on_windows(descriptor)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def _lock_on_windows(descriptor: int) -> bool:
    try:
        import msvcrt
    except ImportError:
        return True
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError:
        return False
    return True


def available_memory() -> float:
    """Bytes of memory that this process may still take, as far as the system tells; inf if it does not."""
    limits = []
    try:
        with Path("/proc/meminfo").open() as lines:
            limits += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable")]
    except (OSError, ValueError, IndexError):
        pass
    try:
        import resource
    except ImportError:
        return min(limits, default=math.inf)
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return min([*limits, *([float(soft)] if soft != resource.RLIM_INFINITY else [])], default=math.inf)


@contextmanager
def locked(file: Path | None, waiting: Callable[[], object]) -> Iterator[None]:
    """Hold the lock of a file, which is made; `waiting` is called once if another process has it.

    Nothing is locked where there is no file or it cannot be made.
    """
    try:
        # A named pipe in its place would be waited for.
        stream = file.open("a") if file and (file.is_file() or not file.exists()) else None
    except OSError:
        stream = None
    if stream is None:
        yield
        return
    with stream:
        told = False
        while not lock(stream.fileno()):
            if not told:
                waiting()
                told = True
            time.sleep(0.05)
        yield
