"""How kernels are compiled and cached.

A kernel has one explicit signature and is compiled, or loaded from the cache, before it is first called. Functions that
it calls are compiled into it. numba looks only at the file of the kernel itself when it decides whether a cached one is
stale; here the cache folder is named by a hash of all kernel sources and versions, so a stale one cannot be found.
"""

from __future__ import annotations

import hashlib
import logging
import platform
import sys
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import event, types

from tdint.cache import cache_subfolder, remove_unused

LOG = logging.getLogger("tdint")

F8 = types.float64
I8 = types.int64
VECTOR = types.Array(types.float64, 1, "C")
TABLE = types.Array(types.float64, 2, "C")

# Without reference counts (the arrays outlive the call; kernels allocate none) a step costs a third: counting is
# atomic.
_OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True, "_nrt": False}
_DAYS_KEPT = 30


def inlined(function: Callable[..., Any]) -> Any:
    """Mark a function of the inner loops: its code is put into each place that calls it."""
    return numba.njit(inline="always", **_OPTIONS)(function)


def called(function: Callable[..., Any]) -> Any:
    """Mark a function that kernels call now and then: it is compiled once and called, which keeps compiling short."""
    return numba.njit(**_OPTIONS)(function)


class Kernel:
    """A function that is compiled for one signature, or loaded from the cache, when `compiled` is first asked for."""

    def __init__(self, function: Callable[..., Any], signature: Any, allocates: bool) -> None:
        self.function = function
        self.signature = signature
        self.options = _OPTIONS | {"_nrt": allocates}
        self.__doc__ = function.__doc__

    @cached_property
    def compiled(self) -> Any:
        """The compiled function."""
        folder = cache_folder()
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder or "")
        try:
            with event.install_listener("numba:compile", _Announcer()):
                return numba.njit(self.signature, cache=folder is not None, **self.options)(self.function)
        finally:
            numba.config.CACHE_DIR = before


def kernel(signature: Any, allocates: bool = False) -> Callable[[Callable[..., Any]], Kernel]:
    """Make a `Kernel` of a function; one that allocates arrays must say so."""
    return lambda function: Kernel(function, signature, allocates)


class _Announcer(event.Listener):  # type: ignore[misc]
    """Says once per process that something is being compiled."""

    def on_start(self, event: Any) -> None:
        _announce()

    def on_end(self, event: Any) -> None:
        pass


@cache
def _announce() -> None:
    where = cache_folder()
    kept = f"kept in {where.parent}" if where else "not kept: no folder to write to"
    LOG.info("compiling the time loops for this machine, once (%s)", kept)


@cache
def cache_folder() -> Path | None:
    """The folder of compiled kernels for exactly these sources, versions and this processor; None if none can be
    written.

    It lies in TDINT_CACHE_DIR, else in the user's cache folder. Folders of other versions that have not been used for
    thirty days are removed.
    """
    folder = cache_subfolder(f"kernels-{_fingerprint()}")
    if folder is not None:
        remove_unused("kernels-*", _DAYS_KEPT, keep=folder)
    return folder


def _fingerprint() -> str:
    """Hash of all that a compiled kernel depends on: kernel sources, versions, processor."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for source in sorted([*package.glob("kernels/**/*.py"), *package.glob("methods/**/*.py")]):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    versions = (numba.__version__, llvmlite.__version__, np.__version__, sys.version, platform.machine(), str(package))
    digest.update(repr(versions).encode())
    return digest.hexdigest()[:16]
