"""What a process that only runs tdint sets before it imports anything large."""

from __future__ import annotations

import os


def use_one_thread() -> None:
    """Let linear algebra use one thread, unless the environment says how many.

    Its matrices are small: the threads take longer to start than they save, and in a busy machine they wait for each
    other.
    """
    for library in ("OPENBLAS", "OMP", "MKL", "VECLIB", "BLIS"):
        name = "VECLIB_MAXIMUM_THREADS" if library == "VECLIB" else f"{library}_NUM_THREADS"
        os.environ.setdefault(name, "1")
