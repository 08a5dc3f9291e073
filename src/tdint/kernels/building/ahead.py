"""Kernels compiled ahead: for an image, a cluster, other processors, a folder that many read."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from tdint.errors import OutputError
from tdint.kernels.building import store
from tdint.kernels.building.compilable import Compilable
from tdint.kernels.building.process import Compilation, run_all
from tdint.kernels.building.target import Target, named, runnable
from tdint.kernels.building.variant import EVERYTHING, Variant


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
        `native` or levels of the x86-64 psABI.
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
    chosen = [named(target) for target in targets]
    pairs = dict.fromkeys((kernel, variant.only(kernel.parts)) for kernel, variant in wanted)
    missing = [
        Compilation(kernel, variant, target)
        for target in chosen
        for kernel, variant in pairs
        if not _there(kernel, variant, target, folder)
    ]
    written: list[Path] = []
    for one, data in run_all(missing):
        try:
            path = store.keep(data, one.kernel.name, one.variant.text, one.target, folder)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
        if path is None:
            raise OutputError("no folder for compiled kernels can be written; give -o DIR")
        written.append(path)
        progress(len(written) / len(missing))
    return written


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


def _there(kernel: Compilable, variant: Variant, target: Target, folder: Path | None) -> bool:
    if folder is None:
        return store.is_kept(kernel.name, variant.text, target)
    return store.is_in(folder, kernel.name, variant.text, target)
