"""Program that compiles kernels in the background of a first run."""

from __future__ import annotations

import importlib
import json
import sys

from tdint.kernels.building import store
from tdint.kernels.building.compilable import LAW_PREFIX, Compilable
from tdint.kernels.building.load_or_compile import BACKGROUND_LOCK, load_or_compile_objects
from tdint.kernels.building.sources import FRACTURES
from tdint.kernels.laws import NAMES
from tdint.kernels.laws.compiled import compiled_laws
from tdint.kernels.laws.fracture import FRACTURING
from tdint.system import lock


def compile_in_background() -> None:
    """Compile the groups of kernels in the arguments of the program, one group after the other.

    `tdint.kernels.building.load_or_compile.interpret_while_compiling` starts this program. Its
    first argument is a JSON list of groups; each group is a list of pairs of the name of a kernel
    or law and its form. Nothing is done if no directory is writable or if another process is
    compiling.
    """
    folder = store.writable()
    if folder is None:
        return
    with (folder / BACKGROUND_LOCK).open("a") as stream:
        if lock(stream.fileno()):
            for group in json.loads(sys.argv[1]):
                load_or_compile_objects([(_named(name), form) for name, form in group])


def _named(name: str) -> Compilable:
    """Return a kernel or law of tdint by its name."""
    module, _, attribute = name.partition(":")
    if not attribute.startswith(LAW_PREFIX):
        kernel: Compilable = getattr(importlib.import_module(module), attribute)
        return kernel
    law = attribute.removeprefix(LAW_PREFIX)
    code = NAMES.index(law.removesuffix(FRACTURES)) + FRACTURING * law.endswith(FRACTURES)
    return compiled_laws([code])[0]
