"""Methods compiled side by side: where several are not in the cache yet, a second process takes its share."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tdint.analysis.run.workspace import compile_all
from tdint.kernels.compiling import Kernel, cache_folder
from tdint.methods.method import Integrator

_CODE = """
import sys
from tdint.analysis.run.workspace import compile_all
from tdint.methods.catalogue import parse
for text in sys.argv[1:]:
    compile_all(parse(text))
"""


def compile_methods(integrators: Sequence[Integrator], progress: Callable[[float], None]) -> None:
    """Compile methods, or load them from the cache: what this process leaves to another one it then loads.

    Parameters
    ----------
    progress : callable
        Told how much is done, from 0 to 1.
    """
    missing = list({one.family: one for one in integrators if not _is_cached(one.family.step)}.values())
    helper = _start(missing[1:]) if len(missing) > 1 and cache_folder() and (os.cpu_count() or 1) > 1 else None
    try:
        if helper:
            progress(0.0)
            compile_all(missing[0])
            helper.wait()
        for done, integrator in enumerate(integrators):
            progress(done / len(integrators))
            compile_all(integrator)
    finally:
        if helper:
            helper.kill()
            helper.wait()


def _start(integrators: Sequence[Integrator]) -> subprocess.Popen[bytes] | None:
    """A process that compiles into the cache; None where it cannot be started. What it fails at is compiled here."""
    command = [sys.executable, "-P", "-c", _CODE, *(one.label for one in integrators)]
    quiet = subprocess.DEVNULL
    try:
        return subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)
    except OSError:
        return None


def _is_cached(kernel: Kernel) -> bool:
    """Whether the cache has the compiled function, by the name that numba gives its index."""
    folder = cache_folder()
    code = kernel.function.__code__
    name = f"{Path(code.co_filename).stem}.{kernel.function.__qualname__}-{code.co_firstlineno}.*.nbi"
    return folder is not None and any(folder.glob(f"*/{name}"))
