"""The sources that a kernel is compiled from: its module, and what that imports of kernels and
methods.

An edit of one method's file leaves the objects of all other kernels as they are. Imports are found
by a pattern over the text, at any depth of indentation (laws import in their functions): to parse
the files takes longer than to start.
"""

from __future__ import annotations

import ast
import hashlib
import re
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from tdint.kernels.building.compilable import Variant

_PACKAGE = Path(__file__).parents[2]
_BUILDING = "tdint.kernels.building."
_COMPILING = tuple(_BUILDING + name for name in ("compiler", "compilable", "target"))
"""What of `building` an object depends on, whatever imports it."""

OUTSIDE: dict[str, str] = {}
"""The modules of the laws of plug-ins, by the law's name: told by who makes a law known."""

CODE: dict[str, dict[str, str]] = {}
"""SHA-256 of the files that a plug-in's law or method was executed from, by the file's name, of
each `law NAME` and `method NAME`: told by who makes it known."""

_PUBLIC = "tdint.plugin"
"""What plug-ins import: names of other modules."""

_LAWS = "tdint.kernels.laws"
_IMPORT = re.compile(
    rb"^[ \t]*from (tdint\.(?:kernels|methods)[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE
)
_NOT_FOLLOWED = {*sys.stdlib_module_names, "numpy", "numba", "scipy"}
_COMMENT = re.compile(rb"#[^\n]*")


@cache
def digest(kernel: str, laws: tuple[str, ...] = ()) -> str:
    """Hash of the sources of a kernel, `package.module:function`.

    Parameters
    ----------
    laws : tuple of str
        The drift laws that the kernel is compiled for, by name; those left out do not count. Empty
        for all.
    """
    whole = hashlib.sha256()
    for name, file in sorted(closure(kernel.partition(":")[0], laws).items()):
        whole.update(name.encode() + b"\0" + _read(file)[0])
    return whole.hexdigest()[:12]


def size(kernel: str) -> int:
    """Bytes of the sources of a kernel: the more there are, the longer it compiles."""
    return sum(file.stat().st_size for file in closure(kernel.partition(":")[0]).values())


@cache
def digest_of_all() -> str:
    """Hash of the sources of all kernels and methods, for what is computed by several of them."""
    whole = hashlib.sha256()
    for folder in ("kernels", "methods"):
        for file in sorted((_PACKAGE / folder).rglob("*.py")):
            whole.update(
                file.relative_to(_PACKAGE).as_posix().encode() + b"\0" + file.read_bytes() + b"\0"
            )
    return whole.hexdigest()[:12]


def closure(module: str, laws: tuple[str, ...] = ()) -> dict[str, Path]:
    """The modules that a kernel's module is compiled with, by name, itself among them; `laws` as in
    `digest`.

    A module that is not the package's counts by the file it was loaded from, and so does what it
    imports. A law's module has the law's name.
    """
    law_modules = {"law", *(name.replace("-", "_") for name in laws)}
    files: dict[str, Path] = {}
    new = [module, *_COMPILING, *(OUTSIDE[name] for name in Variant(laws).outside)]
    while new:
        name = new.pop()
        file = _file(name)
        if name in files or file is None:
            continue
        files[name] = file
        new += [
            imported
            for imported in (_read(file)[1] if name.startswith("tdint.") else _imported(file, name))
            if not imported.startswith(_BUILDING)
            and not (laws and name == _LAWS and imported.rpartition(".")[2] not in law_modules)
        ]
    return files


def files_of(modules: Iterable[str], package: str = "") -> dict[str, str]:
    """SHA-256 of the files of modules from outside and of what they import, by their names;
    `package` stands before."""
    digests: dict[str, str] = {}
    seen, new = set[str](), list(modules)
    while new:
        name = new.pop()
        if name in seen or name.partition(".")[0] == "tdint" or (file := _file(name)) is None:
            continue
        seen.add(name)
        # A file of its own by its name, one of a package with the package's: `helpers/rows.py`.
        depth = name.count(".") + 1 + (file.stem == "__init__")
        digests[package + "/".join(file.parts[-depth:])] = hashlib.sha256(
            file.read_bytes()
        ).hexdigest()
        new += _imported(file, name)
    return dict(sorted(digests.items()))


def code_of(named: Iterable[str]) -> dict[str, str]:
    """SHA-256 of the files that these laws and methods were executed from, `law NAME` and `method
    NAME`; ours have none."""
    return dict(sorted(item for name in set(named) for item in CODE.get(name, {}).items()))


@cache
def _read(file: Path) -> tuple[bytes, tuple[str, ...]]:
    """Hash of a file, and what it imports of kernels and methods; each may be a module, or a name
    in one."""
    text = file.read_bytes().replace(b"\r\n", b"\n")  # as a checkout on Windows may have it
    names: list[str] = []
    for package, words in _IMPORT.findall(text):
        base = package.decode()
        one_by_one = _COMMENT.sub(b"", words).strip(b"() \t\r\n").split(b",")
        names += [
            base,
            *(f"{base}.{word.split()[0].decode()}" for word in one_by_one if word.strip()),
        ]
    return hashlib.sha256(text).digest(), tuple(names)


@cache
def _imported(file: Path, module: str) -> tuple[str, ...]:
    """What a module from outside imports of anything but the standard library and the compiler, at
    any depth."""
    if file.suffix != ".py":  # compiled: it counts as it is
        return ()
    package = getattr(sys.modules.get(module), "__package__", None) or ""
    names: list[str] = []
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.rsplit(".", node.level - 1)[0] if node.level else ""
            base = ".".join(filter(None, (above, node.module)))
            names += [base] * (base != _PUBLIC) + [f"{base}.{alias.name}" for alias in node.names]
    # A public name counts by the module in which it stands, all of them where the whole of them is
    # imported.
    homes, found = getattr(sys.modules.get(_PUBLIC), "HOMES", {}), list[str]()
    for name in names:
        base, _, alias = name.rpartition(".")
        found += (
            homes.values()
            if name == _PUBLIC
            else [homes.get(alias, name) if base == _PUBLIC else name]
        )
    return tuple(name for name in found if name.partition(".")[0] not in _NOT_FOLLOWED)


def _file(module: str) -> Path | None:
    """The source of a module; None for what is none."""
    if module.partition(".")[0] != "tdint":
        loaded_from = getattr(sys.modules.get(module), "__file__", None)
        return Path(loaded_from) if loaded_from else None
    return _own_file(module)


@cache
def _own_file(module: str) -> Path | None:
    _, *rest = module.split(".")
    path = _PACKAGE.joinpath(*rest)
    return next(
        (file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None
    )
