"""Loading of kernels from object files, and compilation of missing kernels.

Kernels are loaded when they are needed. They can also be compiled in advance: for a container
image, a cluster, other processors, or a shared directory.
"""

from __future__ import annotations

import errno
import importlib
import importlib.util
import json
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from tdint.errors import AnalysisError, OutputError, UsageError
from tdint.kernels.building.compilable import (
    EVERYTHING,
    FEATURES,
    FRACTURES,
    Compilable,
    Variant,
    parse,
)
from tdint.system import lock, locked, processors, spawn_detached

if TYPE_CHECKING:
    from tdint.kernels.building.target import Target

LOG = logging.getLogger("tdint")

# Approximate compile time of a kernel in s, by its number of laws. The key 3 is used for three and
# more laws.
_SECONDS = {1: 5.0, 2: 9.0, 3: 15.0}


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
    if all(kernel.loaded(variant) for kernel, variant in pairs):
        return
    with _ONE_AT_A_TIME:
        _load_missing(pairs, progress)


def _load_missing(
    pairs: Sequence[tuple[Compilable, Variant]],
    progress: Callable[[float], None],
) -> None:
    """Load the kernels that are not loaded, and compile kernels without an object file
    (`load_or_compile`).

    The caller owns the lock `_ONE_AT_A_TIME`. The environment variable TDINT_KERNELS has these
    values:

        python     the kernels are installed as Python functions, without compilation
        whole      one variant with all features is used for all buildings; the method
                   `Compilable.required_variant` evaluates this setting
        compile    set by tdint in the processes that compile kernels, not by users
        empty      default: each kernel is compiled for the features that it must support
    """
    requested = [
        (kernel, kernel.required_variant(variant))
        for kernel, variant in pairs
        if not kernel.loaded(variant)
    ]
    setting = os.environ.get("TDINT_KERNELS", "")
    # The message omits `compile`, which users must not set.
    if setting not in ("", "python", "whole", "compile"):
        raise UsageError(
            f"TDINT_KERNELS={setting} is invalid: set it to python or whole, or unset it"
        )
    if setting == "python":
        for kernel, variant in requested:
            kernel.install(variant, _python_function(kernel.function), interpreted=True)
        return
    if not requested:  # another thread has loaded the kernels in the meantime
        return
    from tdint.kernels.building import store

    if not (missing := _load_existing(dict.fromkeys(requested))):
        return
    folder = store.writable()
    # Processes that need the same kernels wait for each other. The lock file is one of 16, selected
    # by a checksum of the missing kernels, so that processes that need other kernels usually do not
    # wait. Without a writable directory, no lock is used.
    kernel_list = "".join(f"{kernel.name} {variant.text}\n" for kernel, variant in missing)
    file = folder and folder / f"{store.LOCK_PREFIX}{crc32(kernel_list.encode()) % 16}"
    with locked(
        file, lambda: LOG.info("waiting for another tdint process that compiles time loops")
    ):
        # Another process may have compiled the kernels in the meantime.
        if missing := _load_existing(missing):
            _compile(missing, progress, folder)


def _usable_variants(variant: Variant) -> tuple[Variant, ...]:
    """Return the variants that can be used for a kernel, in order of preference: its variant and
    the variant with all features, which contains no laws of plug-ins and no laws that can fracture.
    """
    is_apart = variant.outside or any(law.endswith(FRACTURES) for law in variant.laws)
    return (variant,) if is_apart else (variant, EVERYTHING)


def _load_existing(
    pairs: Iterable[tuple[Compilable, Variant]],
) -> list[tuple[Compilable, Variant]]:
    """Load kernels that have an object file, and return the remaining kernels."""
    from tdint.kernels.building import store
    from tdint.kernels.building.target import runnable

    missing = []
    for kernel, variant in pairs:
        for usable in _usable_variants(variant):
            stored = store.find_object(kernel.name, usable.text, runnable())
            # Path, code and name of the function; None without an object file
            if stored and _load(kernel, variant, *stored[1:]):
                break
        else:
            missing.append((kernel, variant))
    return missing


def _compile(
    missing: Sequence[tuple[Compilable, Variant]],
    progress: Callable[[float], None],
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
    loops = "loop" if count == 1 else "loops"
    names = ", ".join(dict.fromkeys(map(_label, missing)))
    LOG.info(
        "compiling %d time %s for this machine (about %d s): %s; %s",
        count,
        loops,
        duration(missing),
        names,
        destination,
    )
    # Each compilation is for this machine only, and therefore has a single object file.
    running = run_all(compilations((*pair, NATIVE) for pair in missing))
    for completed, (compilation, (data,)) in enumerate(running, start=1):
        kernel, variant = compilation.kernel, compilation.variant
        code, description = unpack(data)
        saved = store.save(data, kernel.name, variant.text, compilation.targets[NATIVE])
        if saved is None and folder:
            LOG.info(
                "%s is not writable: the compiled time loops are only used in this run", folder
            )
        if not _load(kernel, variant, code, description["symbol"]):
            raise RuntimeError(f"{kernel.name}: the compiled time loop cannot be loaded")
        progress(completed / count)


def duration(pairs: Sequence[tuple[Compilable, Variant]]) -> int:
    """Return the approximate compile time of kernels, s, measured on processors of 2024.

    It is the larger of the time of the slowest kernel and the sum over all kernels divided by the
    number of processors. A kernel that does not depend on the laws is compiled as fast as a kernel
    with a single law.
    """
    # A variant without names of laws contains all laws of tdint, more than three.
    durations = [
        _SECONDS[min(len(variant.laws) or 3, 3) if "laws" in kernel.parts else 1]
        for kernel, variant in pairs
    ]
    return round(max(max(durations), sum(durations) / processors()))


def _label(pair: tuple[Compilable, Variant]) -> str:
    """Return the module of a kernel and its laws for messages, for example `impulse4 (linear)`."""
    kernel, variant = pair
    laws = f" ({', '.join(variant.laws) or 'all laws'})" if "laws" in kernel.parts else ""
    return kernel.name.partition(":")[0].rpartition(".")[2] + laws


def _load(kernel: Compilable, variant: Variant, code: bytes, symbol: str) -> bool:
    """Load an object file, without its description, into a kernel; return False if it cannot be
    loaded or does not contain the function.
    """
    from tdint.kernels.building.loading import Loaded

    try:
        kernel.install(variant, Loaded(code, symbol, kernel.signature))
    except (RuntimeError, ValueError):
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

_BACKGROUND_LOCK = ".lock-beside"
_BACKGROUND_PROGRAM = (
    "from tdint.kernels.building.load_or_compile import compile_in_background; "
    "compile_in_background()"
)


def interpret_while_compiling(
    loop_kernels: Sequence[tuple[Compilable, Variant]],
    other_kernels: Callable[[], Sequence[tuple[Compilable, Variant]]],
) -> bool:
    """Use kernels as Python functions in this run if an object file is missing; return True if they
    are used.

    A separate process with low priority compiles the kernels for the next run, and continues after
    this process has ended. With TDINT_COMPILE=never no process is started. The caller calls this
    function only for a short run, because Python functions are slow.

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
    has_plugins = any(
        variant.outside or not kernel.name.startswith("tdint.") for kernel, variant in loop_kernels
    )
    if setting == "wait" or has_plugins or any(map(os.environ.get, ("TDINT_KERNELS", *_JOBS))):
        return False
    # Without numba the compilation fails, and the caller reports the error.
    if importlib.util.find_spec("numba") is None:
        return False
    # If a kernel of the time loop has no object file, all its kernels are installed as Python
    # functions, with memory views (`as_views`), which are faster.
    with _ONE_AT_A_TIME:
        in_loop = [(kernel, kernel.required_variant(variant)) for kernel, variant in loop_kernels]
        if not _load_existing(in_loop):
            return False  # all kernels of the time loop have an object file
        others = [(kernel, kernel.required_variant(variant)) for kernel, variant in other_kernels()]
        for kernel, variant in [*in_loop, *_load_existing(others)]:
            kernel.install(variant, as_views(kernel.function, variant), interpreted=True)
    folder = store.writable() if setting != "never" else None
    background = ""
    if folder:
        try:
            _start_compilation([in_loop, others], folder)
        except OSError as error:
            # The limit of processes is reached (ulimit -u, a container), or the directory cannot be
            # written to.
            background = (
                f"; the process that compiles them cannot be started ({error.strerror or error})"
            )
        else:
            background = ", and the time loops are compiled in the background for the next runs"
            background += " (TDINT_COMPILE=wait compiles them first)"
    LOG.info("first run: uncompiled time loops are used%s", background)
    return True


def _start_compilation(
    groups: Sequence[Sequence[tuple[Compilable, Variant]]], folder: Path
) -> None:
    """Start a process that compiles groups of kernels, unless such a process is already running.

    For each directory of object files, a single process compiles in the background at a time, also
    for different kernels. The process continues after the end of the process. The last group is
    compiled first. OSError is raised if the process cannot be started.
    """
    # The kernels that the time loop calls, the first group, are compiled last. If their object
    # files exist, the object files of the other kernels also exist.
    names = [
        [(kernel.name, variant.text) for kernel, variant in group] for group in reversed(groups)
    ]
    file = folder / _BACKGROUND_LOCK
    if file.exists() and not file.is_file():  # opening a named pipe would block
        raise FileExistsError(errno.EEXIST, f"{file} is not a file")
    with file.open("a") as stream:
        # The file is locked while a process compiles; `lock` then returns False. Otherwise several
        # models in succession would fill the memory with compilers. Closing the file at the end of
        # this block removes the lock. The new process then locks the file until it has compiled all
        # groups (`compile_in_background`).
        if lock(stream.fileno()):
            spawn_detached(
                [sys.executable, "-P", "-c", _BACKGROUND_PROGRAM, json.dumps(names)], folder
            )


def compile_in_background() -> None:
    """Compile the groups of kernels in the arguments of the program, one group after the other.

    `interpret_while_compiling` starts this program. Its first argument is a JSON list of groups;
    each group is a list of pairs of kernel name and text of the variant. Nothing is done if no
    directory is writable or if another process is compiling.
    """
    from tdint.kernels.building import store

    folder = store.writable()
    if folder is None:
        return
    with (folder / _BACKGROUND_LOCK).open("a") as stream:
        if lock(stream.fileno()):
            for group in json.loads(sys.argv[1]):
                pairs = []
                for kernel_name, variant_text in group:
                    module, function = kernel_name.split(":")
                    kernel = getattr(importlib.import_module(module), function)
                    pairs.append((kernel, parse(variant_text)))
                load_or_compile(pairs)


def as_views(function: Callable[..., Any], variant: Variant) -> Callable[..., Any]:
    """Return a Python function of a kernel that accesses its arrays through memory views, without
    the features that `variant` omits.

    A call requires two thirds of the time of a call with NumPy arrays, because the elements of
    memory views are Python numbers, and again two thirds of it without the tests of the features of
    a building with plain stories. If an operation fails that arrays allow and Python numbers do
    not, such as a division by zero, the arrays are restored and the call is repeated with arrays.
    """
    python_function = _python_function(function)

    def call(*arguments: Any) -> Any:
        """Call the function with memory views; repeat the call with arrays if this fails."""
        arrays = [argument for argument in arguments if isinstance(argument, np.ndarray)]
        if not arrays:  # called by a kernel that already uses memory views
            return function(*arguments)
        # The kernel changes its arrays. The copies restore them if the call fails half-way.
        saved = [array.copy() for array in arrays]
        with _only_features_of(variant):
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
def _only_features_of(variant: Variant) -> Iterator[None]:
    """Let the Python functions of kernels omit the features that a variant does not have.

    Modules of kernels state each feature by a constant with its name, such as `TREE`, `_TREE` or
    `HAS_ELEMENTS`, which is True in a process that does not compile (`tdint.kernels.compiling`).
    """
    omitted = [feature.upper() for feature in FEATURES if not getattr(variant, feature)]
    constants = [
        (module, name)
        for module in [*sys.modules.values()]
        if getattr(module, "__name__", "").startswith(("tdint.kernels.", "tdint.methods."))
        for name in (prefix + feature for feature in omitted for prefix in ("", "_", "HAS_"))
        if vars(module).get(name) is True
    ]
    for module, name in constants:
        setattr(module, name, False)
    try:
        yield
    finally:
        for module, name in constants:
            setattr(module, name, True)


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

    # Runs load the same variants: with TDINT_KERNELS=whole the variant with all features.
    kernels = dict.fromkeys((kernel, kernel.required_variant(variant)) for kernel, variant in pairs)
    requested = [
        (kernel, variant, target)
        for target in dict.fromkeys(targets)
        for kernel, variant in kernels
        if not store.has(kernel.name, variant.text, named(target), folder)
    ]
    written: list[Path] = []
    if folder is not None:
        with suppress(OSError):  # the error is reported when a file is saved
            folder.mkdir(parents=True, exist_ok=True)
    for kernel, variant, target, data in _objects(requested):
        try:
            path = store.save(data, kernel.name, variant.text, target, folder)
        # `save` raises OSError only for a specified directory. For the cache it returns None.
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
        if path is None:
            raise OutputError("no writable directory for compiled kernels; specify one with -o DIR")
        written.append(path)
        progress(len(written) / len(requested))
    return written


def _objects(
    requested: Iterable[tuple[Compilable, Variant, str]],
) -> Iterator[tuple[Compilable, Variant, Target, bytes]]:
    """Yield the kernels with their variant, target and object file: first the existing files, then
    the compiled kernels in the order of their completion.
    """
    from tdint.kernels.building import store
    from tdint.kernels.building.process import compilations, run_all
    from tdint.kernels.building.target import named

    missing = []
    for kernel, variant, name in requested:
        target = named(name)
        if stored := store.find_object(kernel.name, variant.text, (target,)):
            yield kernel, variant, target, stored[0].read_bytes()
        else:
            missing.append((kernel, variant, name))
    for compilation, packed in run_all(compilations(missing)):
        for target, data in zip(compilation.targets.values(), packed, strict=True):
            yield compilation.kernel, compilation.variant, target, data


def list_objects(pairs: Iterable[tuple[Compilable, Variant]]) -> list[tuple[str, str, str, str]]:
    """Return a table of kernels and their object files, one row per kernel without duplicates.

    Returns
    -------
    list of tuple of str
        Name of the kernel, text of its variant with spaces instead of commas, path of the object
        file, and its origin: `wheel`, `TDINT_KERNELS_DIR` or `cache`. Path and origin are empty for
        a kernel without object file.
    """
    from tdint.kernels.building import store
    from tdint.kernels.building.target import runnable

    entries = []
    for kernel, variant in dict.fromkeys(
        (kernel, kernel.required_variant(variant)) for kernel, variant in pairs
    ):
        candidates = (
            store.find_object(kernel.name, usable.text, runnable())
            for usable in _usable_variants(variant)
        )
        stored = next(filter(None, candidates), None)  # path, code and name of the function
        file, origin = (str(stored[0]), store.origin(stored[0])) if stored else ("", "")
        entries.append((kernel.name, variant.text.replace(",", " "), file, origin))
    return entries
