"""Modules from outside the package that add to it: a file that the user names, or an installed
package.

Nothing is looked for in the working folder, and nothing is named by a model file.
"""

from __future__ import annotations

import ast
import importlib.util
import logging
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from tdint.errors import TdintError, UsageError
from tdint.files import digest_of, is_file

LOG = logging.getLogger("tdint")

NAME = re.compile(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*")
"""Names of methods and laws: they stand in specifications, in labels and in names of files."""


_PREFIX = "tdint_plugin_"


@dataclass(frozen=True)
class Origin:
    """Where a law or a method is from.

    Attributes
    ----------
    where : str
        In words, for messages.
    module : str
        The module that lists it, beside those that its functions stand in.
    package : str
        The distribution with its version, of an installed one.
    """

    where: str
    module: str = ""
    package: str = ""

    def keep_code(self, kind: str, of: Any) -> None:
        """Keep what the files of a law or a method are while they are as they were executed
        (`sources.CODE`)."""
        from tdint.kernels.building.sources import (
            CODE,
            files_of,
        )  # hashes, which most commands do without

        package = f"{self.package}: " if self.package else ""
        CODE[f"{kind} {of.name}"] = files_of([self.module, *_modules(of)], package)


def _modules(of: Any) -> Iterator[str]:
    """The modules of the functions in a dataclass, and in those that it has."""
    for field in fields(of):
        value = getattr(of, field.name)
        if is_dataclass(value):
            yield from _modules(value)
        elif callable(value := getattr(value, "function", value)):
            yield getattr(value, "__module__", None) or ""


def _module_name(path: Path) -> str:
    return _PREFIX + re.sub(r"\W", "_", path.stem)


def module_of(file: str) -> ModuleType:
    """The module in a file, executed once, as `tdint_plugin_` and the file's name.

    Raises
    ------
    UsageError
        No such file, or it cannot be executed: what is wrong and in which line. Two files of one
        name.
    """
    path = Path(file)
    if path.suffix != ".py" or not is_file(path):
        raise UsageError(f"{file}: a plug-in is a Python file, NAME.py; there is none of this name")
    name = _module_name(path)
    # Executed once in a process: another file, or another state of it, would be a second truth.
    loaded = sys.modules.get(name)
    if loaded is not None:
        if loaded.__file__ != str(path.resolve()):
            raise UsageError(
                f"{file}: {loaded.__file__} has the same name; rename one of the two plug-ins"
            )
        if vars(loaded)["__digest__"] != digest_of(path):
            raise UsageError(
                f"{file}: has changed since this process executed it; start Python anew"
            )
        return loaded
    specification = importlib.util.spec_from_file_location(name, path.resolve())
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    # Known before it runs, as Python's own import has it; taken out again if it fails.
    sys.modules[name] = module
    vars(module)["__digest__"] = digest_of(path)
    try:
        with faults_of(file):
            specification.loader.exec_module(module)
    except TdintError as error:
        del sys.modules[name]
        place, _, reason = str(error).partition(": ")
        if reason.startswith(("ModuleNotFoundError: ", "ImportError: ")):
            hint = next(
                (text for text in private_imports(file) if text.startswith(f"{place}: ")), ""
            )
            raise UsageError(str(error) + hint.replace(place, "").replace(":", ";", 1)) from None
        raise
    return module


def private_imports(file: str) -> list[str]:
    """What a plug-in imports of modules that promise nothing, a line for each: where, and what to
    write instead."""
    from tdint.plugin import HOMES

    told = []
    for node in ast.walk(ast.parse(Path(file).read_bytes())):
        module = getattr(node, "module", None) or ""
        if (
            isinstance(node, ast.ImportFrom)
            and module.startswith("tdint.")
            and module != "tdint.plugin"
        ):
            names = ["rows" if alias.name == "layout" else alias.name for alias in node.names]
            public = ", ".join(name for name in names if name in HOMES)
            write = (
                f"write from tdint.plugin import {public}"
                if public
                else "see the names of tdint.plugin"
            )
            told.append(f"{file}:{node.lineno}: {module} may change without notice; {write}")
    return told


def home_of(name: str, attribute: str) -> tuple[str, str] | None:
    """File and SHA-256 of the plug-in whose tuple `attribute` has a method or a law of this name;
    None without one."""
    for module_name, module in list(sys.modules.items()):
        if module_name.startswith(_PREFIX) and module.__file__:
            listed = getattr(module, attribute, ())
            if name in [
                getattr(item, "name", None)
                for item in (listed if isinstance(listed, Iterable) else (listed,))
            ]:
                return module.__file__, digest_of(Path(module.__file__))
    return None


def same_file(file: str, digest: str) -> str:
    """The plug-in of what comes from another process, if it is still what it was there.

    Raises
    ------
    UsageError
        It is not: what to load.
    """
    try:
        if digest_of(Path(file)) == digest:
            return file
        why = "which is another one by now"
    except TdintError:
        why = "which is not there"
    raise UsageError(
        f"this is of the plug-in {file}, {why}: load the one it was made with by tdint.load_plugin "
        "first"
    )


def files_to_send() -> tuple[tuple[str, bytes], ...]:
    """Names and contents of the files that were executed, in that order, for processes that cannot
    read them."""
    files = [module.__file__ for name, module in sys.modules.items() if name.startswith(_PREFIX)]
    return tuple((Path(file).name, Path(file).read_bytes()) for file in files if file)


def files_received(sent: Iterable[tuple[str, bytes]]) -> list[str]:
    """The paths of files that another process sent: where this one has them already, or in a folder
    of its own.

    Raises
    ------
    UsageError
        This process has executed another file of this name.
    """
    files = []
    for name, content in sent:
        loaded = getattr(sys.modules.get(_module_name(Path(name))), "__file__", None)
        file = Path(loaded) if loaded else _folder() / name
        if not loaded:
            file.write_bytes(content)
        elif file.read_bytes() != content:
            raise UsageError(
                f"{name}: a worker has executed another version of this plug-in; start the workers "
                "anew"
            )
        files.append(str(file))
    return files


def peers() -> list[tuple[str, str, Callable[[Any], Any]]]:
    """What plug-ins bring to charts, their tuples PEERS: the plug-in's name, a name, and a function
    of the problem.

    Raises
    ------
    UsageError
        PEERS holds something else.
    """
    peers_of = []
    for module in [module for name, module in sys.modules.items() if name.startswith(_PREFIX)]:
        for peer in getattr(module, "PEERS", ()):
            if not (
                isinstance(peer, tuple)
                and len(peer) == 2
                and isinstance(peer[0], str)
                and callable(peer[1])
            ):
                raise UsageError(
                    f"{module.__file__}: PEERS holds pairs of a name and a function, not {peer!r}"
                )
            check_name(peer[0].partition(":")[0], (), "peer", str(module.__file__))
            peers_of.append((Path(str(module.__file__)).stem, *peer))
    return peers_of


@cache
def _folder() -> Path:
    """Of the files that this process was sent."""
    from tempfile import mkdtemp

    return Path(mkdtemp(prefix="tdint-plugins-"))


@contextmanager
def faults_of(where: str) -> Iterator[None]:
    """Whatever is raised becomes one line that begins with `where`, a file with its line."""
    try:
        yield
    except (TdintError, KeyboardInterrupt):
        raise
    except BaseException as error:  # code of others, whatever it raises
        file = Path(where).name
        lines = [
            frame.lineno
            for frame in traceback.extract_tb(error.__traceback__)
            if Path(frame.filename).name == file
        ]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        try:
            text = " ".join((error.msg if isinstance(error, SyntaxError) else str(error)).split())
        except Exception:  # its own words, too
            text = "without a word that can be read"
        place = f"{where}:{line}" if line else where
        raise UsageError(f"{place}: {type(error).__name__}: {text}") from None


def installed(group: str, take: Callable[[Any, Origin], object]) -> None:
    """Have what the entry points of a group name taken; a faulty one is warned of and left out.

    Parameters
    ----------
    take : callable
        (object, where it is from) -> None, an `Origin`; raises UsageError for what it cannot take.
    """
    from importlib.metadata import entry_points  # 20 ms, and asked for seldom

    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        package = f"{point.dist.name} {point.dist.version}" if point.dist else ""
        place = f"entry point {point.name} of {point.group} ({point.value})"
        origin = Origin(", ".join(filter(None, (package, place))), point.module, package)
        try:
            with faults_of(origin.where):
                take(point.load(), origin)
        except TdintError as error:
            LOG.warning("a plug-in is left out: %s", error)


def declared(plugin: Any, attribute: str, kind: type, where: str) -> Iterator[Any]:
    """The objects of a kind in what an entry point or a file names: itself, or what its tuple
    `attribute` has."""
    listed = getattr(plugin, attribute, ()) if isinstance(plugin, ModuleType) else plugin
    for item in (listed,) if isinstance(listed, kind) else listed:
        if not isinstance(item, kind):
            raise UsageError(
                f"{where}: {attribute} holds {kind.__name__} objects, not {type(item).__name__}"
            )
        yield item


def check_name(name: str, names: Any, kind: str, where: str) -> None:
    """Refuse a name that is none, or is taken: ours are never hidden, nor one plug-in's by another.

    Raises
    ------
    UsageError
        See above.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise UsageError(
            f"{where}: {name!r} is no name of a {kind}; write small letters, digits and hyphens"
        )
    if name in names:
        raise UsageError(f"{where}: there is a {kind} {name!r} already; give yours another name")
