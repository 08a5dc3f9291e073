"""Loading of kernels from object files, and compilation of missing kernels.

Kernels are loaded when they are needed. They can also be compiled in advance: for a container
image, a cluster, other processors, or a shared directory.
"""

from __future__ import annotations

import errno
import importlib.util
import json
import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from tdint.errors import AnalysisError, OutputError, UsageError
from tdint.kernels.building.compilable import (
    ANY,
    FULL,
    LAW_PREFIX,
    PLAIN,
    Compilable,
    Variant,
)
from tdint.number_parsing import pluralize
from tdint.system import lock, locked, processors, spawn_detached

if TYPE_CHECKING:
    from tdint.kernels.building.target import Target

LOG = logging.getLogger("tdint")

_SECONDS = {PLAIN: 4.0, FULL: 10.0, ANY: 3.0}
"""Approximate compile time of a kernel or law by its form, s."""


_ONE_AT_A_TIME = threading.Lock()
"""Lock for the loading of objects by LLVM, which must not be used by two threads at the same
time."""
# A process that is forked while a thread owns the lock inherits the locked lock, but not the
# thread that would release it.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_ONE_AT_A_TIME._at_fork_reinit)  # type: ignore[attr-defined]


def load_or_compile(
    pairs: Sequence[tuple[Compilable, Variant]],
    progress: Callable[[float], None] = lambda done: None,
) -> None:
    """Load kernels into this process, and compile those without an object file in parallel
    processes.

    Parameters
    ----------
    progress : callable, optional
        Is called after each compilation with the fraction of the missing kernels that are
        completed; the last value is 1. It is not called if all kernels have an object file.

    Raises
    ------
    AnalysisError
        A kernel cannot be compiled.
    UsageError
        The value of TDINT_KERNELS is invalid.
    """
    needed = required(pair for pair in pairs if not _is_interpreted(*pair))
    if all(kernel.loaded(form) for kernel, form in needed):
        return
    with _ONE_AT_A_TIME:
        load_missing(needed, progress)


def _is_interpreted(kernel: Compilable, variant: Variant) -> bool:
    """Return True if a kernel is installed as a Python function, which needs no compiled laws."""
    return isinstance(kernel._loaded.get(kernel.form(variant)), FunctionType)


def required(pairs: Iterable[tuple[Compilable, Variant]]) -> list[tuple[Compilable, str]]:
    """Return the kernels and the laws that they need, each with its form, without duplicates."""
    result: dict[tuple[Compilable, str], None] = {}
    for kernel, variant in pairs:
        for item in (kernel, *variant.laws):
            result[item, item.form(variant)] = None
    return list(result)


def load_missing(
    needed: Sequence[tuple[Compilable, str]],
    progress: Callable[[float], None] = lambda done: None,
    processes: int | None = None,
) -> None:
    """Load the kernels and laws that are not loaded, and compile those without an object file
    (`load_or_compile`), in a number of parallel processes (`run_all`).

    The caller owns the lock `_ONE_AT_A_TIME`, or is the only thread. The environment variable
    TDINT_KERNELS has these values:

        python     the kernels are installed as Python functions, without compilation
        compile    set by tdint in the processes that compile kernels, not by users
        empty      default: each kernel is compiled
    """
    requested = [(kernel, form) for kernel, form in needed if not kernel.loaded(form)]
    setting = os.environ.get("TDINT_KERNELS", "")
    # The message omits `compile`, which users must not set.
    if setting not in ("", "python", "compile"):
        raise UsageError(f"TDINT_KERNELS={setting} is invalid: set it to python, or unset it")
    if setting == "python":
        for kernel, form in requested:
            kernel.interpret(form, _python_function)
        return
    from tdint.kernels.building import store

    # Another thread can have loaded the kernels in the meantime.
    if not (missing := _load_existing(requested)):
        return
    folder = store.writable()
    # Processes that need the same kernels wait for each other. The lock file is one of 16, selected
    # by a checksum of the missing kernels, so that processes that need other kernels usually do not
    # wait. Without a writable directory, no lock is used.
    kernel_list = "".join(f"{kernel.name} {form}\n" for kernel, form in missing)
    file = folder and folder / f"{store.LOCK_PREFIX}{crc32(kernel_list.encode()) % 16}"
    with locked(
        file, lambda: LOG.info("waiting for another tdint process that compiles time loops")
    ):
        # Another process may have compiled the kernels in the meantime.
        if missing := _load_existing(missing):
            _compile(missing, progress, processes, folder)


def _load_existing(
    requested: Iterable[tuple[Compilable, str]],
) -> list[tuple[Compilable, str]]:
    """Load kernels and laws that have an object file, and return the others."""
    from tdint.kernels.building import store
    from tdint.kernels.building.target import runnable

    missing = []
    for kernel, form in requested:
        # Path, code and description; None without an object file
        stored = store.find_object(kernel.name, form, runnable())
        if not stored or not _load(kernel, form, *stored[1:]):
            missing.append((kernel, form))
    return missing


def _compile(
    missing: Sequence[tuple[Compilable, str]],
    progress: Callable[[float], None],
    processes: int | None,
    folder: Path | None,
) -> None:
    """Compile kernels in parallel processes, save their object files, and load them into this
    process.

    `folder` is the directory of the object files; None if no directory is writable. The kernels are
    then used in this process only.

    Raises
    ------
    AnalysisError
        A kernel cannot be compiled, or TDINT_COMPILE=never forbids it.
    RuntimeError
        A compiled kernel cannot be loaded.
    """
    from tdint.kernels.building import store
    from tdint.kernels.building.loading import unpack
    from tdint.kernels.building.process import compilations, run_all
    from tdint.kernels.building.target import NATIVE

    if os.environ.get("TDINT_COMPILE") == "never":
        names = ", ".join(dict.fromkeys(map(_label, missing)))
        raise AnalysisError(
            "TDINT_COMPILE=never forbids compilation, and these time loops are not compiled: "
            f"{names}; run `tdint compile MODEL.yaml` first"
        )
    destination = f"stored in {folder}" if folder else "not stored: no writable directory"
    count = len(missing)
    LOG.info(
        "compiling %s for this machine (about %d s): %s; %s",
        counted(missing),
        duration(missing),
        ", ".join(dict.fromkeys(map(_label, missing))),
        destination,
    )
    # Each compilation is for this machine only, and therefore has a single object file.
    running = run_all(compilations((*pair, NATIVE) for pair in missing), processes)
    for completed, (compilation, (data,)) in enumerate(running, start=1):
        kernel, form = compilation.kernel, compilation.form
        code, description = unpack(data)
        saved = store.save(data, kernel.name, form, compilation.targets[NATIVE])
        if saved is None and folder:
            LOG.info(
                "%s is not writable: the compiled time loops are only used in this run", folder
            )
        if not _load(kernel, form, code, description):
            raise RuntimeError(f"{kernel.name}: the compiled time loop cannot be loaded")
        progress(completed / count)


def counted(requested: Iterable[tuple[Compilable, str]]) -> str:
    """Return the numbers of time loops and of laws as text, for example `5 time loops and a
    law`."""
    is_law = [LAW_PREFIX in kernel.name for kernel, _ in requested]
    laws, loops = sum(is_law), len(is_law) - sum(is_law)
    parts = [
        pluralize(count, noun) for count, noun in ((loops, "time loop"), (laws, "law")) if count
    ]
    return " and ".join(parts)


def duration(requested: Sequence[tuple[Compilable, str]]) -> int:
    """Return the approximate compile time of kernels and laws, s, measured on processors of 2024.

    It is the larger of the time of the slowest kernel and the sum over all kernels divided by the
    number of processors.
    """
    durations = [_SECONDS[form] for _, form in requested]
    return round(max(max(durations), sum(durations) / processors()))


def _label(pair: tuple[Compilable, str]) -> str:
    """Return the module of a kernel or the name of a law for messages, for example `impulse4`."""
    module, _, name = pair[0].name.partition(":")
    return name.removeprefix(LAW_PREFIX) if LAW_PREFIX in name else module.rpartition(".")[2]


def _load(kernel: Compilable, form: str, code: bytes, description: dict[str, Any]) -> bool:
    """Load an object file into a kernel or law; return False if it cannot be loaded or does not
    contain the function.
    """
    try:
        kernel.load(form, code, description)
    except (RuntimeError, ValueError, KeyError):
        return False
    return True


def _python_function(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a Python function of a kernel that treats divisions by zero as compiled code does.

    The result is infinite or nan, without a warning or an exception. This applies to divisions with
    an element of a NumPy array, because the element is a NumPy number. A division of two Python
    numbers, such as two arguments that are Python numbers, still raises ZeroDivisionError. Array
    arguments must be NumPy arrays.
    """

    def call(*arguments: Any) -> Any:
        """Call the function without NumPy's warnings and exceptions for divisions by zero."""
        with np.errstate(all="ignore"):
            return function(*arguments)

    return call


# ---- First run without compilation

_JOBS = ("CI", "SLURM_JOB_ID", "PBS_JOBID", "LSB_JOBID")
"""Environment variables that are set in continuous integration and by the schedulers of clusters.
In such jobs the kernels are always compiled first."""

BACKGROUND_LOCK = ".lock-beside"
_BACKGROUND_PROGRAM = (
    "from tdint.kernels.building.background import compile_in_background; compile_in_background()"
)


def interpret_while_compiling(
    loop_kernels: Sequence[tuple[Compilable, Variant]],
    other_kernels: Callable[[], Sequence[tuple[Compilable, Variant]]],
) -> bool:
    """Use kernels as Python functions in this run if an object file is missing; return True if they
    are used.

    A separate process with low priority compiles the kernels, and continues after this process has
    ended. A run that still computes when they are compiled continues with them
    (`use_compiled_kernels`). With TDINT_COMPILE=never no process is started.

    The function returns False, and the caller loads or compiles the kernels, if

    - TDINT_COMPILE=wait, or TDINT_KERNELS is set
    - a kernel or a law of the time loop belongs to a plug-in
    - the run is a job of a cluster or of continuous integration (_JOBS), where results are compared
    - numba is not installed
    - all kernels of the time loop have an object file; they are then loaded

    Parameters
    ----------
    loop_kernels : sequence of (Compilable, Variant)
        Kernels that the time loop calls. They are either all compiled or all Python functions.
    other_kernels : callable
        Function without arguments that returns the kernels that the run may use separately. It is
        called if a kernel of the time loop has no object file.

    Raises
    ------
    UsageError
        The value of TDINT_COMPILE is invalid.
    """
    from tdint.kernels.building import store

    setting = os.environ.get("TDINT_COMPILE", "")
    if setting not in ("", "wait", "never"):
        raise UsageError(
            f"TDINT_COMPILE={setting} is invalid: set it to wait or never, or unset it"
        )
    in_loop = required(loop_kernels)
    has_plugins = not all(kernel.name.startswith("tdint.") for kernel, _ in in_loop)
    if setting == "wait" or has_plugins or any(map(os.environ.get, ("TDINT_KERNELS", *_JOBS))):
        return False
    # Without numba the compilation fails, and the caller reports the error.
    if importlib.util.find_spec("numba") is None:
        return False
    # If a kernel of the time loop has no object file, all its kernels are installed as Python
    # functions, with memory views (`as_views`), which are faster.
    with _ONE_AT_A_TIME:
        if not _load_existing(in_loop):
            return False  # all kernels of the time loop have an object file
        others = [item for item in required(other_kernels()) if item not in in_loop]
        for kernel, form in [*in_loop, *_load_existing(others)]:
            kernel.interpret(form, partial(as_views, form=form))
    folder = store.writable() if setting != "never" else None
    background = ""
    if folder:
        try:
            _start_compilation([*in_loop, *others], folder)
        except OSError as error:
            # The limit of processes is reached (ulimit -u, a container), or the directory cannot be
            # written to.
            background = (
                f"; the process that compiles them cannot be started ({error.strerror or error})"
            )
        else:
            _BACKGROUND.update(folder=folder, kernels=[*in_loop, *others], time=time.monotonic())
            background = " while compiled ones are made in the background"
            background += " (TDINT_COMPILE=wait compiles them first)"
    LOG.info("first run: uncompiled time loops are used%s", background)
    return True


_BACKGROUND: dict[str, Any] = {}
"""Compilation in the background for the interpreted kernels of this process, empty without one:
directory of the object files, kernels, and time of the last start."""

_RESTART_SECONDS = 20.0
"""Time after which a compilation in the background is started again, s: another process may have
compiled other kernels before."""


def use_compiled_kernels() -> None:
    """Replace the interpreted kernels of the run by compiled kernels, if another process has
    compiled all of them in the meantime. A time loop calls this function between its calls."""
    if not _BACKGROUND:
        return
    from tdint.kernels.building import store
    from tdint.kernels.building.target import NATIVE, named

    kernels = _BACKGROUND["kernels"]
    if all(store.has(kernel.name, form, named(NATIVE)) for kernel, form in kernels):
        _BACKGROUND.clear()
        with _ONE_AT_A_TIME:
            _load_existing(kernels)
    elif time.monotonic() > _BACKGROUND["time"] + _RESTART_SECONDS:
        _BACKGROUND["time"] = time.monotonic()
        with suppress(OSError):  # the run continues with interpreted kernels
            _start_compilation(kernels, _BACKGROUND["folder"])


def _start_compilation(kernels: Sequence[tuple[Compilable, str]], folder: Path) -> None:
    """Start a process that compiles kernels, unless such a process is already running.

    For each directory of object files, a single process compiles in the background at a time, also
    for different kernels. The process continues after the end of this process. OSError is raised
    if the process cannot be started.
    """
    keys = [(getattr(kernel, "code", kernel.name), form) for kernel, form in kernels]
    file = folder / BACKGROUND_LOCK
    if file.exists() and not file.is_file():  # opening a named pipe would block
        raise FileExistsError(errno.EEXIST, f"{file} is not a file")
    with file.open("a") as stream:
        # The file is locked while a process compiles; `lock` then returns False. Otherwise several
        # models in succession would fill the memory with compilers. Closing the file at the end of
        # this block removes the lock. The new process then locks the file until it has compiled all
        # kernels (`compile_in_background`).
        if lock(stream.fileno()):
            spawn_detached(
                [sys.executable, "-P", "-c", _BACKGROUND_PROGRAM, json.dumps(keys)], folder
            )


def as_views(function: Callable[..., Any], form: str) -> Callable[..., Any]:
    """Return a Python function of a kernel that accesses its arrays through memory views, in a
    form.

    A call requires two thirds of the time of a call with NumPy arrays, because the elements of
    memory views are Python numbers, and again two thirds of it without the tests of the features of
    a building with plain stories. If an operation fails that arrays allow and Python numbers do
    not, such as a division by zero, the arrays are restored and the call is repeated with arrays.
    """
    context = _plain if form == PLAIN else nullcontext
    python_function = _python_function(function)

    def call(*arguments: Any) -> Any:
        """Call the function with memory views; repeat the call with arrays if this fails."""
        arrays = [argument for argument in arguments if isinstance(argument, np.ndarray)]
        if not arrays:  # called by a kernel that already uses memory views
            return function(*arguments)
        # The kernel changes its arrays. The copies restore them if the call fails half-way.
        saved = [array.copy() for array in arrays]
        with context():
            try:
                views = [
                    argument.data if isinstance(argument, np.ndarray) else argument
                    for argument in arguments
                ]
                return function(*views)
            except (ArithmeticError, TypeError, ValueError, NotImplementedError, AttributeError):
                # Python numbers do not allow an operation. Repeat the call with restored arrays.
                for array, values in zip(arrays, saved, strict=True):
                    if array.flags.writeable:
                        array[...] = values
                return python_function(*arguments)

    return call


@contextmanager
def _plain() -> Iterator[None]:
    """Let the Python functions of kernels omit the optional features
    (`tdint.kernels.compiling.FULL`)."""
    modules = [
        module
        for name, module in sys.modules.copy().items()
        if name.startswith(("tdint.kernels.", "tdint.methods."))
        and vars(module).get("FULL") is True
    ]
    for module in modules:
        vars(module)["FULL"] = False
    try:
        yield
    finally:
        for module in modules:
            vars(module)["FULL"] = True


# ---- Compilation in advance


def compile_ahead(
    pairs: Iterable[tuple[Compilable, Variant]],
    targets: Iterable[str],
    folder: Path | None,
    progress: Callable[[float], None],
) -> list[Path]:
    """Compile missing kernels into a directory or into the cache; return the files that were
    written.

    Parameters
    ----------
    targets : iterable of str
        Names of the processors, see `tdint.kernels.building.target.named`.
    folder : Path | None
        Directory for the object files, to be used later as TDINT_KERNELS_DIR; it is created if
        necessary. None for the cache of the user.
    progress : callable
        Is called with the completed fraction, from 0 to 1.

    Raises
    ------
    OutputError
        The files cannot be written.
    """
    from tdint.kernels.building import store
    from tdint.kernels.building.target import named

    requested = [
        (kernel, form, target)
        for target in dict.fromkeys(targets)
        for kernel, form in required(pairs)
        if not store.has(kernel.name, form, named(target), folder)
    ]
    written: list[Path] = []
    for kernel, form, target, data in _objects(requested):
        try:
            path = store.save(data, kernel.name, form, target, folder)
        # `save` raises OSError only for a specified directory. For the cache it returns None.
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
        if path is None:
            raise OutputError("no writable directory for compiled kernels; specify one with -o DIR")
        written.append(path)
        progress(len(written) / len(requested))
    return written


def _objects(
    requested: Iterable[tuple[Compilable, str, str]],
) -> Iterator[tuple[Compilable, str, Target, bytes]]:
    """Yield the kernels with their form, target and object file: first the existing files, then
    the compiled kernels in the order of their completion.
    """
    from tdint.kernels.building import store
    from tdint.kernels.building.process import compilations, run_all
    from tdint.kernels.building.target import named

    missing = []
    for kernel, form, name in requested:
        target = named(name)
        if stored := store.find_object(kernel.name, form, (target,)):
            yield kernel, form, target, stored[0].read_bytes()
        else:
            missing.append((kernel, form, name))
    for compilation, packed in run_all(compilations(missing)):
        for target, data in zip(compilation.targets.values(), packed, strict=True):
            yield compilation.kernel, compilation.form, target, data


def list_objects(pairs: Iterable[tuple[Compilable, Variant]]) -> list[tuple[str, str, str, str]]:
    """Return a table of kernels, their laws and the object files, without duplicates.

    Returns
    -------
    list of tuple of str
        Name of the kernel or law, its form, path of the object file, and its origin: `wheel`,
        `TDINT_KERNELS_DIR` or `cache`. Path and origin are empty without an object file.
    """
    from tdint.kernels.building import store
    from tdint.kernels.building.target import runnable

    entries = []
    for kernel, form in required(pairs):
        stored = store.find_object(kernel.name, form, runnable())
        file, origin = (str(stored[0]), store.origin(stored[0])) if stored else ("", "")
        entries.append((kernel.name, form, file, origin))
    return entries
