"""Modules that define the public names of `tdint` and `tdint.plugin`, read from their stubs.

Type checkers read the same files, `__init__.pyi` and `plugin.pyi`.
"""

from __future__ import annotations

from pathlib import Path


def _read_stub(file: str) -> tuple[dict[str, str], dict[str, str]]:
    """Return the module of each name in a stub, and the names that differ in their module.

    A line is `from MODULE import NAME as NAME`, which type checkers treat as public. A name that
    differs has the lines `from MODULE import DEFINED` and `NAME = DEFINED`.
    """
    modules, defined_as = dict[str, str](), dict[str, str]()
    for line in Path(__file__).with_name(file).read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words[:1] == ["from"]:
            modules[words[-1]] = words[1]
        elif words[1:2] == ["="]:
            modules[words[0]] = modules.pop(words[2])
            defined_as[words[0]] = words[2]
    return modules, defined_as


PUBLIC, DEFINED_AS = _read_stub("__init__.pyi")
"""Module that defines each public name of `tdint`, and the names that differ in their module."""
del PUBLIC["__version__"]  # a number, imported with `tdint`

PLUGIN, _ = _read_stub("plugin.pyi")
"""Module that defines each name of `tdint.plugin`; `rows` is the name of a module."""
PLUGIN["rows"] += ".layout"
