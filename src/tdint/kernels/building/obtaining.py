"""Kernels when they are needed, from an object file or compiled into one; and compiled ahead: for
an image, a cluster, other processors, a folder that many read."""

from __future__ import annotations

import importlib
import importlib.util
import json
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from tdint.errors import AnalysisError, OutputError, UsageError
from tdint.kernels.building.compilable import EVERYTHING, Compilable, Variant, parse
from tdint.system import lock, locked, processors, start_apart

if TYPE_CHECKING:
    from tdint.kernels.building.target import Target

LOG = logging.getLogger("tdint")

_SECONDS = {1: 5.0, 2: 9.0, 3: 15.0}  # by the number of laws, 3 for all that are more


_ONE_AT_A_TIME = threading.Lock()
"""LLVM loads objects into a process, and may not be asked to by two threads at once."""
if hasattr(os, "register_at_fork"):  # a child would wait for a thread that it has not
    os.register_at_fork(after_in_child=_ONE_AT_A_TIME._at_fork_reinit)  # type: ignore[attr-defined]


def obtain(
    pairs: Sequence[tuple[Compilable, Variant]],
    progress: Callable[[float], None] = lambda done: None,
    own_loops: bool = False,
) -> None:
    """Load kernels into this process; what no store has is compiled, in processes side by side, and
    kept.

    TDINT_KERNELS=python takes the kernels as they are written, not compiled.

    Parameters
    ----------
    progress : callable
        Told how much is done, from 0 to 1.
    own_loops : bool
        True if a kernel that is compiled for all laws must not serve for the laws of a building.

    Raises
    ------
    AnalysisError
        A kernel cannot be compiled.
    """
    if all(kernel.loaded(variant) for kernel, variant in pairs):
        return
    with _ONE_AT_A_TIME:
        _obtain(pairs, progress, own_loops)


def _obtain(
    pairs: Sequence[tuple[Compilable, Variant]],
    progress: Callable[[float], None],
    own_loops: bool,
) -> None:
    missing = [
        (kernel, kernel.needs(variant)) for kernel, variant in pairs if not kernel.loaded(variant)
    ]
    how = os.environ.get("TDINT_KERNELS", "")
    if how not in ("", "python", "whole", "compile"):
        raise UsageError(f"TDINT_KERNELS={how}: it is python, whole, or not set")
    if how == "python":
        for kernel, variant in missing:
            kernel.take(variant, _plain(kernel.function), interpreted=True)
        return
    if not missing:
        return
    from tdint.kernels.building import store

    if not (absent := _not_found(dict.fromkeys(missing), own_loops)):
        return
    folder = store.writable()
    # Who wants the same waits; who wants something else mostly does not.
    word = "".join(f"{kernel.name} {variant.text}\n" for kernel, variant in absent)
    file = folder and folder / f".lock-{crc32(word.encode()) % 16}"
    with locked(file, lambda: LOG.info("waiting for another tdint that compiles time loops")):
        # What another process has compiled meanwhile is there now.
        if absent := _not_found(absent, own_loops):
            _compile(absent, progress, folder)


def _serving(variant: Variant) -> tuple[Variant, ...]:
    """The variants of a kernel that do: one for everything as well, as `tdint compile --all` makes
    it."""
    return (variant,) if variant.outside else (variant, EVERYTHING)


def _not_found(
    pairs: Iterable[tuple[Compilable, Variant]], own_loops: bool
) -> list[tuple[Compilable, Variant]]:
    """Load what a store has; the rest."""
    from tdint.kernels.building import store
    from tdint.kernels.building.target import runnable

    absent = []
    for kernel, variant in pairs:
        for serving in (variant,) if own_loops else _serving(variant):
            stored = store.look_up(kernel.name, serving.text, runnable())
            if stored and _load(kernel, variant, *stored[1:]):
                break
        else:
            absent.append((kernel, variant))
    return absent


def _compile(
    absent: Sequence[tuple[Compilable, Variant]],
    progress: Callable[[float], None],
    folder: Path | None,
) -> None:
    from tdint.kernels.building import store
    from tdint.kernels.building.loading import unpack
    from tdint.kernels.building.process import compilations, run_all
    from tdint.kernels.building.target import NATIVE

    if os.environ.get("TDINT_COMPILE") == "never":
        names = ", ".join(dict.fromkeys(map(_shown, absent)))
        raise AnalysisError(
            f"TDINT_COMPILE=never, and not compiled yet: {names}; `tdint compile MODEL.yaml` does "
            "it"
        )
    kept = f"kept in {folder}" if folder else "not kept: no folder to write to"
    count = len(absent)
    loops = "loop" if count == 1 else "loops"
    names = ", ".join(dict.fromkeys(map(_shown, absent)))
    LOG.info(
        "compiling %d time %s for this machine, once, about %d s: %s (%s)",
        count,
        loops,
        duration(absent),
        names,
        kept,
    )
    running = run_all(compilations((*pair, NATIVE) for pair in absent))
    for done, (compilation, (data,)) in enumerate(running):
        progress(done / count)
        kernel, variant = compilation.kernel, compilation.variant
        code, about = unpack(data)
        if (
            store.keep(data, kernel.name, variant.text, compilation.targets[NATIVE]) is None
            and folder
        ):
            LOG.info("%s cannot be written: what was compiled serves this run only", folder)
        if not _load(kernel, variant, code, about["symbol"]):
            raise RuntimeError(f"{kernel.name}: the object cannot be loaded")


def duration(pairs: Sequence[tuple[Compilable, Variant]]) -> int:
    """Roughly how long it takes to compile, s, as measured on processors of 2024."""
    each = [
        _SECONDS[min(len(variant.laws) or 3, 3) if "laws" in kernel.parts else 1]
        for kernel, variant in pairs
    ]
    return round(max(max(each), sum(each) / processors()))


def _shown(pair: tuple[Compilable, Variant]) -> str:
    kernel, variant = pair
    laws = f" ({', '.join(variant.laws) or 'all laws'})" if "laws" in kernel.parts else ""
    return kernel.name.partition(":")[0].rpartition(".")[2] + laws


def _load(kernel: Compilable, variant: Variant, code: bytes, symbol: str) -> bool:
    """Whether an object could be loaded."""
    from tdint.kernels.building.loading import Loaded

    try:
        kernel.take(variant, Loaded(code, symbol, kernel.signature))
    except (RuntimeError, ValueError):
        return False
    return True


def _plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel as it is written: dividing by zero gives what it gives in a compiled one."""

    def call(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*arguments)

    return call


# ---- A first run at once

_JOBS = ("CI", "SLURM_JOB_ID", "PBS_JOBID", "LSB_JOBID")
"""What the environment of a job tells: of continuous integration, of clusters."""

_BESIDE = ".lock-beside"
_COMPILE = "from tdint.kernels.building.obtaining import compile_named; compile_named()"


def begin_as_written(
    called: Sequence[tuple[Compilable, Variant]], others: Sequence[tuple[Compilable, Variant]]
) -> bool:
    """Take kernels as they are written for a short run where no store has all that its march calls;
    a process of low priority, which outlives this one, compiles them for the next run.

    Not where TDINT_KERNELS or TDINT_COMPILE=wait say otherwise, in jobs of clusters and of
    continuous integration, whose results are compared, nor for kernels of plug-ins.
    TDINT_COMPILE=never starts no process.

    Parameters
    ----------
    called, others : sequence of (Compilable, Variant)
        What the march calls, all of it taken one way; what else a run may ask for, each by itself.

    Returns
    -------
    bool
        Whether they were taken.
    """
    from tdint.kernels.building import store

    how = os.environ.get("TDINT_COMPILE", "")
    if how not in ("", "wait", "never"):
        raise UsageError(f"TDINT_COMPILE={how}: it is wait, never, or not set")
    outside = any(
        variant.outside or not kernel.name.startswith("tdint.") for kernel, variant in called
    )
    if how == "wait" or outside or any(map(os.environ.get, ("TDINT_KERNELS", *_JOBS))):
        return False
    # What nobody can compile is told by who is asked to.
    if importlib.util.find_spec("numba") is None:
        return False
    with _ONE_AT_A_TIME:
        pairs = [
            [(kernel, kernel.needs(variant)) for kernel, variant in group]
            for group in (called, others)
        ]
        if not _not_found(pairs[0], False):
            return False
        for kernel, variant in [*pairs[0], *_not_found(pairs[1], False)]:
            kernel.take(variant, as_views(kernel.function), interpreted=True)
    folder = store.writable() if how != "never" else None
    beside = ""
    if folder:
        try:
            _compile_beside(pairs, folder)
        except OSError as error:
            # No process is left (ulimit -u, a container's limit), or the folder cannot be written.
            beside = f"; no process can be started that compiles them ({error.strerror or error})"
        else:
            beside = ", and they are compiled beside it for the next ones"
            beside += " (TDINT_COMPILE=wait compiles first)"
    LOG.info("no compiled time loops for this run yet: it goes as they are written%s", beside)
    return True


def _compile_beside(groups: Sequence[Sequence[tuple[Compilable, Variant]]], folder: Path) -> None:
    """Start a process that compiles groups of kernels into a folder and outlives this one, unless
    another process is at that.

    Raises
    ------
    OSError
        The process cannot be started.
    """
    # What a march calls comes last: where it is there, so is the rest.
    names = [
        [(kernel.name, variant.text) for kernel, variant in group] for group in reversed(groups)
    ]
    with (folder / _BESIDE).open("a") as stream:
        # One at a time: several models one after the other would fill the memory with compilers.
        if lock(stream.fileno()):
            start_apart([sys.executable, "-P", "-c", _COMPILE, json.dumps(names)], folder)


def compile_named() -> None:
    """Compile groups of kernels, which JSON in the first argument names, unless another process is
    at that: the program that `begin_as_written` starts."""
    from tdint.kernels.building import store

    folder = store.writable()
    if folder is None:
        return
    with (folder / _BESIDE).open("a") as stream:
        if lock(stream.fileno()):
            for group in json.loads(sys.argv[1]):
                names = ((*name.split(":"), parse(text)) for name, text in group)
                obtain(
                    [
                        (getattr(importlib.import_module(module), name), variant)
                        for module, name, variant in names
                    ]
                )


def as_views(function: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel as it is written, in two thirds of the time: on views, whose numbers are Python's
    own.

    What those refuse and arrays do not, to divide by zero, is done again on arrays as they were
    before.
    """
    plain = _plain(function)

    def call(*arguments: Any) -> Any:
        arrays = [argument for argument in arguments if isinstance(argument, np.ndarray)]
        if not arrays:  # called by a kernel that has views
            return function(*arguments)
        before = [array.copy() for array in arrays]
        try:
            views = [one.data if isinstance(one, np.ndarray) else one for one in arguments]
            return function(*views)
        except (ArithmeticError, TypeError, ValueError, NotImplementedError, AttributeError):
            for array, values in zip(arrays, before, strict=True):
                if array.flags.writeable:
                    array[...] = values
            return plain(*arguments)

    return call


# ---- Ahead


def compile_ahead(
    pairs: Iterable[tuple[Compilable, Variant]],
    targets: Iterable[str],
    folder: Path | None,
    progress: Callable[[float], None],
) -> list[Path]:
    """Compile what is missing into a folder, or where kernels are kept.

    Parameters
    ----------
    targets : iterable of str
        Names as `target.named` knows them.
    folder : Path or None
        As TDINT_KERNELS_DIR will name it; None for where kernels are kept.
    progress : callable
        Told how much is done, from 0 to 1.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    OutputError
        They cannot be written.
    """
    from tdint.kernels.building import store
    from tdint.kernels.building.target import named

    kernels = dict.fromkeys((kernel, variant.only(kernel.parts)) for kernel, variant in pairs)
    missing = [
        (kernel, variant, target)
        for target in dict.fromkeys(targets)
        for kernel, variant in kernels
        if not store.has(kernel.name, variant.text, named(target), folder)
    ]
    written: list[Path] = []
    if folder is not None:
        with suppress(OSError):  # said when something is kept
            folder.mkdir(parents=True, exist_ok=True)
    for kernel, variant, target, data in _made(missing):
        try:
            path = store.keep(data, kernel.name, variant.text, target, folder)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
        if path is None:
            raise OutputError("no folder for compiled kernels can be written; give -o DIR")
        written.append(path)
        progress(len(written) / len(missing))
    return written


def _made(
    missing: Iterable[tuple[Compilable, Variant, str]],
) -> Iterator[tuple[Compilable, Variant, Target, bytes]]:
    """The objects of kernels for targets, by name: copies where a store has them, else compiled."""
    from tdint.kernels.building import store
    from tdint.kernels.building.process import compilations, run_all
    from tdint.kernels.building.target import named

    absent = []
    for kernel, variant, name in missing:
        target = named(name)
        if stored := store.look_up(kernel.name, variant.text, (target,)):
            yield kernel, variant, target, stored[0].read_bytes()
        else:
            absent.append((kernel, variant, name))
    for compilation, packed in run_all(compilations(absent)):
        for target, data in zip(compilation.targets.values(), packed, strict=True):
            yield compilation.kernel, compilation.variant, target, data


def shown(pairs: Iterable[tuple[Compilable, Variant]]) -> list[tuple[str, str, str, str]]:
    """Each kernel, its variant, the file that is loaded for it, and where that comes from; empty
    for one to be compiled."""
    from tdint.kernels.building import store
    from tdint.kernels.building.target import runnable

    rows = []
    for kernel, variant in dict.fromkeys(
        (kernel, kernel.needs(variant)) for kernel, variant in pairs
    ):
        tried = (
            store.look_up(kernel.name, serving.text, runnable()) for serving in _serving(variant)
        )
        stored = next(filter(None, tried), None)
        file, origin = (str(stored[0]), store.origin(stored[0])) if stored else ("", "")
        rows.append((kernel.name, variant.text.replace(",", " "), file, origin))
    return rows
