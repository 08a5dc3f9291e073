"""Program that compiles kernels in the background of a first run."""

from __future__ import annotations

import importlib
import json
import sys

from tdint.kernels.building import store
from tdint.kernels.building.compilable import Compilable
from tdint.kernels.building.load_or_compile import BACKGROUND_LOCK, load_missing
from tdint.kernels.laws.compiled import compiled_laws
from tdint.system import lock, processors


def compile_in_background() -> None:
    """Compile the kernels in the argument of the program.

    `tdint.kernels.building.load_or_compile.interpret_while_compiling` starts this program. Its
    argument is a JSON list of pairs of the name of a kernel, or the number of a law, and its form.
    Nothing is done if no directory is writable or if another process is compiling. One processor
    remains free for the run. In addition, each further process would compile shared code again.
    """
    folder = store.writable()
    if folder is None:
        return
    with (folder / BACKGROUND_LOCK).open("a") as stream:
        if lock(stream.fileno()):
            kernels = [(_found(key), form) for key, form in json.loads(sys.argv[1])]
            load_missing(kernels, processes=max(processors() - 1, 1))


def _found(key: str | float) -> Compilable:
    """Return a kernel of tdint by its name, or a law by its number."""
    if isinstance(key, float):
        return compiled_laws([key])[0]
    module, _, attribute = key.partition(":")
    kernel: Compilable = getattr(importlib.import_module(module), attribute)
    return kernel
