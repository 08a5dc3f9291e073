"""Sources of a kernel: its module and the modules of kernels and methods that it imports.

A change in the file of a single method does not affect the object files of other kernels, and a
change of a docstring or a comment affects no object file. The texts are searched, not parsed,
because parsing the files would require more time than the start of the program. Imports are found
at any indentation (laws import within functions).
"""

from __future__ import annotations

import ast
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator, ValuesView
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from tdint.kernels.building.compilable import LAW_PREFIX
from tdint.public_names import PLUGIN

if TYPE_CHECKING:
    from tdint.kernels.laws.law import DriftLaw

_PACKAGE = Path(__file__).parents[2]
_BUILDING = "tdint.kernels.building."
_COMPILING = tuple(_BUILDING + name for name in ("compiler", "compilable", "target"))
"""Modules of `building` on which an object file depends, independent of the imports."""

FRACTURES = "~"
"""End of the name of a law that can fracture, in the name of its object file."""

OUTSIDE: dict[str, str] = {}
"""Modules of the laws of plug-ins, by the name of the law. The function that registers a law adds
its module."""

CODE: dict[str, dict[str, str]] = {}
"""SHA-256 of the files from which a law or method of a plug-in was executed, by file name, for each
`law NAME` and `method NAME`. The function that registers the law or method adds the entry."""

_PUBLIC = "tdint.plugin"
"""Module from which plug-ins import names that are defined in other modules."""

_LAWS = "tdint.kernels.laws"
_IMPORT = re.compile(rb"from (tdint\.(?:kernels|methods)[\w.]*) import (\([^)]*\)|[^\n]*)")
_NOT_FOLLOWED = {*sys.stdlib_module_names, "numpy", "numba", "scipy"}
_COMMENT = re.compile(rb"#[^\n]*")
_QUOTES = b'"' * 3  # starts and ends a docstring


@cache
def digest(name: str) -> str:
    """Return the hash of the sources of a kernel or law, 12 hexadecimal digits: of its module and
    of all modules that it imports.

    The hash is part of the name of an object file, so that the code is compiled again after a
    change.
    """
    hash_value = hashlib.sha256()
    for module, file in sorted(closure(name).items()):
        hash_value.update(module.encode() + b"\0" + _read(file)[0])
    return hash_value.hexdigest()[:12]


def size(name: str) -> int:
    """Return the size of the sources of a kernel or law in bytes, an estimate of the compile time.

    The sources are its module and all modules of kernels and methods that it imports.
    """
    return sum(file.stat().st_size for file in closure(name).values())


@cache
def digest_of_all() -> str:
    """Return the hash of the sources of all kernels and methods, as 12 hexadecimal digits.

    It identifies the code of results that depend on several kernels. Modules of `building` count if
    object files depend on them. The result is cached.
    """
    hash_value = hashlib.sha256()
    for folder in ("kernels", "methods"):
        for file in sorted((_PACKAGE / folder).rglob("*.py")):
            name = file.relative_to(_PACKAGE).as_posix()
            if file.parent.name == "building" and f"{_BUILDING}{file.stem}" not in _COMPILING:
                continue
            hash_value.update(name.encode() + b"\0" + _read(file)[0])
    return hash_value.hexdigest()[:12]


def closure(compiled: str) -> dict[str, Path]:
    """Return the source files of all modules on which the object file of a kernel or law depends.

    The result contains its module, the modules of kernels and methods that it imports directly or
    indirectly, for a law the modules of its entries and of fracture, and three modules of the
    package `building` (_COMPILING), which affect the object file. Imports of other modules of
    `building` (_BUILDING) are ignored, because a change of these modules does not require a new
    compilation.

    The file of a module of a plug-in is the file that the module was loaded from.
    """
    module, _, attribute = compiled.partition(":")
    queue = [module, *_COMPILING]
    if attribute.startswith(LAW_PREFIX):
        queue.append(f"{_LAWS}.hooks")
        if attribute.endswith(FRACTURES):
            queue.append(f"{_LAWS}.fracture")
    files: dict[str, Path] = {}
    while queue:
        name = queue.pop()
        file = _file(name)
        # A name without a file is a function or constant of a module.
        if name in files or file is None:
            continue
        files[name] = file
        # Imports of a module of tdint are found by a fast search in the text. The files of plug-ins
        # can import in any form and are parsed.
        imports = _read(file)[1] if name.startswith("tdint.") else _imported(file, name)
        queue += [imported for imported in imports if not imported.startswith(_BUILDING)]
    return files


def files_of(modules: Iterable[str], package: str = "") -> dict[str, str]:
    """Return the SHA-256 of the files of external modules and of their imports, by file name.

    External modules are modules of plug-ins. Modules of tdint and modules without a file are
    omitted.

    Parameters
    ----------
    package : str
        Prefix of the file names in the result.

    Returns
    -------
    dict of str to str
        Hexadecimal SHA-256 of each file, sorted by file name.
    """
    digests: dict[str, str] = {}
    seen, queue = set[str](), list(modules)
    while queue:
        name = queue.pop()
        if name in seen or name.partition(".")[0] == "tdint" or (file := _file(name)) is None:
            continue
        seen.add(name)
        # A single file is listed by its name, a file of a package with the name of the package:
        # `helpers/rows.py`.
        depth = name.count(".") + 1 + (file.stem == "__init__")
        digests[package + "/".join(file.parts[-depth:])] = hashlib.sha256(
            file.read_bytes()
        ).hexdigest()
        queue += _imported(file, name)
    return dict(sorted(digests.items()))


def code_of(named: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of the files from which laws and methods were executed.

    Parameters
    ----------
    named : iterable of str
        `law NAME` and `method NAME`. Laws and methods of tdint have no entries.

    Returns
    -------
    dict of str to str
        SHA-256 of each file, sorted by file name.
    """
    return dict(sorted(item for name in set(named) for item in CODE.get(name, {}).items()))


def laws_in(module: ModuleType) -> Iterator[DriftLaw]:
    """Yield the drift laws in the global variables of a module.

    A variable can be a law, or a tuple, list, set or dictionary that contains laws as elements or
    values. The variable LAWS, which lists the laws of a plug-in, is searched first, because another
    variable can contain a law that was changed for LAWS and has the same name.
    """
    from tdint.kernels.laws.law import DriftLaw  # most processes do not need this import

    variables = dict(vars(module))
    for value in (variables.pop("LAWS", None), *variables.values()):
        values = value.values() if isinstance(value, dict) else value
        # Iterators are not searched: this would consume their elements.
        is_searched = isinstance(values, tuple | list | set | frozenset | ValuesView)
        for law in values if is_searched else (value,):
            if isinstance(law, DriftLaw):
                yield law


def module_of_law(law: DriftLaw, modules: Iterable[str]) -> str:
    """Return the name of the first module that contains a law, for the dictionary OUTSIDE.

    `modules` contains the module of the functions of the law, which depends on the fewest other
    modules, and the module of the plug-in that lists the law; names can be empty. If neither
    contains the law, the first name is returned, and the law cannot be compiled.
    """
    first, *others = modules
    for name in (first, *others):
        module = sys.modules.get(name)
        if module and getattr(module, "__file__", None) and law in laws_in(module):
            return name
    return first


@cache
def _read(file: Path) -> tuple[bytes, tuple[str, ...]]:
    """Return the SHA-256 of a source file, and the modules of kernels and methods that it imports.

    Docstrings and comments of tdint are not hashed; the files of plug-ins may contain any string
    and are hashed completely. A name in the result can also be a function or constant of a module,
    because the text of an import does not distinguish them.
    """
    text = file.read_bytes()
    if b"\r" in text:  # a checkout on Windows can contain CR LF
        text = text.replace(b"\r\n", b"\n")
    names: list[str] = []
    for package, imported_names in _IMPORT.findall(text):
        base = package.decode()
        items = _COMMENT.sub(b"", imported_names).strip(b"() \t\r\n").split(b",")
        names.append(base)
        # A name that is imported from a package can be a module.
        if (home := _own_file(base)) and home.name == "__init__.py":
            names += [f"{base}.{item.split()[0].decode()}" for item in items if item.strip()]
    hashed = code_of_text(text) if file.is_relative_to(_PACKAGE) else text
    return hashlib.sha256(hashed).digest(), tuple(names)


def code_of_text(text: bytes) -> bytes:
    """Return the code of a module without docstrings, comments and blank lines.

    A string in triple quotes is a docstring if it starts its line. The text must not contain `#` or
    triple quotes within another string (tests/kernels/test_sources.py checks all modules).
    """
    parts = text.split(_QUOTES)
    kept = [parts[0]]
    for string, following in zip(parts[1::2], parts[2::2], strict=True):
        line_before = kept[-1][kept[-1].rfind(b"\n") + 1 :]
        if line_before.strip():
            kept += [_QUOTES, string, _QUOTES]
        kept.append(following)
    code = _COMMENT.sub(b"", b"".join(kept))
    return b"\n".join([line.rstrip() for line in code.split(b"\n") if line and not line.isspace()])


@cache
def _imported(file: Path, module: str) -> tuple[str, ...]:
    """Return the names of the modules that an external module (a plug-in) imports.

    For `from base import name`, both `base` and `base.name` are returned, because the name can be a
    module. A name of `tdint.plugin` is replaced by the module that defines it.
    """
    if file.suffix != ".py":  # a compiled module has no imports that can be read
        return ()
    package = getattr(sys.modules.get(module), "__package__", None) or ""
    names: list[str] = []
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            # A relative import with a single dot is relative to the package of the module; each
            # further dot removes one level.
            parent = package.rsplit(".", node.level - 1)[0] if node.level else ""
            base = ".".join(filter(None, (parent, node.module)))
            # `import *` of the public module imports all of its names.
            if base != _PUBLIC or any(alias.name == "*" for alias in node.names):
                names.append(base)
            names += [f"{base}.{alias.name}" for alias in node.names]
    resolved = list[str]()
    for name in names:
        base, _, alias = name.rpartition(".")
        if name == _PUBLIC:
            resolved += PLUGIN.values()
        elif base == _PUBLIC:
            resolved.append(PLUGIN.get(alias, name))
        else:
            resolved.append(name)
    return tuple(name for name in resolved if name.partition(".")[0] not in _NOT_FOLLOWED)


def _file(module: str) -> Path | None:
    """Return the source file of a module, of tdint or of another package; None without a file."""
    if module.partition(".")[0] != "tdint":
        loaded_from = getattr(sys.modules.get(module), "__file__", None)
        return Path(loaded_from) if loaded_from else None
    return _own_file(module)


@cache
def _own_file(module: str) -> Path | None:
    """Return the file of a module of this package; None if the name is not a module."""
    _, *subpackages = module.split(".")  # without the first name, `tdint`
    path = _PACKAGE.joinpath(*subpackages)
    return next(
        (file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None
    )
