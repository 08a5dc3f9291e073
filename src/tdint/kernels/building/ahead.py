"""Kernels compiled ahead: for an image, a cluster, other processors, a folder that many read."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from tdint.errors import OutputError
from tdint.kernels.building import store
from tdint.kernels.building.compilable import EVERYTHING, Compilable, Variant
from tdint.kernels.building.process import compilations, run_all
from tdint.kernels.building.target import Target, named, runnable


def compile_ahead(
    wanted: Iterable[tuple[Compilable, Variant]],
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
    pairs = dict.fromkeys((kernel, variant.only(kernel.parts)) for kernel, variant in wanted)
    missing = [
        (kernel, variant, target)
        for target in dict.fromkeys(targets)
        for kernel, variant in pairs
        if not store.has(kernel.name, variant.text, named(target), folder)
    ]
    written: list[Path] = []
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


def _made(missing: Iterable[tuple[Compilable, Variant, str]]) -> Iterator[tuple[Compilable, Variant, Target, bytes]]:
    """The objects of kernels for targets, by name: copies where a store has them, else compiled."""
    absent = []
    for kernel, variant, name in missing:
        target = named(name)
        if found := target.platform == sys.platform and store.look_up(kernel.name, variant.text, (target,)):
            yield kernel, variant, target, found[0].read_bytes()
        else:
            absent.append((kernel, variant, name))
    for one, packed in run_all(compilations(absent)):
        for target, data in zip(one.targets.values(), packed, strict=True):
            yield one.kernel, one.variant, target, data


def shown(wanted: Iterable[tuple[Compilable, Variant]]) -> list[tuple[str, str, str]]:
    """Each kernel, its variant, and the file that is loaded for it: empty for one to be compiled."""
    rows = []
    for kernel, variant in dict.fromkeys((kernel, kernel.needs(variant)) for kernel, variant in wanted):
        tried = (
            store.look_up(kernel.name, one.text, runnable())
            for one in dict.fromkeys((variant, variant if variant.outside else EVERYTHING))
        )
        found = next(filter(None, tried), None)
        rows.append((kernel.name, variant.text.replace(",", " "), str(found[0]) if found else ""))
    return rows
