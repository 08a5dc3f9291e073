"""Load plug-ins: a file that the user names, or an installed package.

The working directory is not searched, and model files cannot name plug-ins.
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
from tdint.tabular import declared_homes

LOG = logging.getLogger("tdint")

NAME = re.compile(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*")
"""Allowed names of methods and laws, which are used in specifications, labels and file names."""


_PREFIX = "tdint_plugin_"


@dataclass(frozen=True)
class Origin:
    """Origin of a law or a method.

    Attributes
    ----------
    where : str
        Description for messages.
    module : str
        Module that lists it, in addition to the modules of its functions.
    package : str
        Name and version of the installed distribution, if any.
    """

    where: str
    module: str = ""
    package: str = ""

    def keep_code(self, kind: str, of: Any) -> None:
        """Store the digests of the files of a law or method as executed (`sources.CODE`)."""
        # Imported here, because most commands do not need the digests.
        from tdint.kernels.building.sources import CODE, files_of

        package = f"{self.package}: " if self.package else ""
        CODE[f"{kind} {of.name}"] = files_of([self.module, *_modules(of)], package)


def _modules(of: Any) -> Iterator[str]:
    """Yield the modules of the functions in a dataclass and in the dataclasses that it contains."""
    for field in fields(of):
        value = getattr(of, field.name)
        if is_dataclass(value):
            yield from _modules(value)
        elif callable(value := getattr(value, "function", value)):
            yield getattr(value, "__module__", None) or ""


def _module_name(path: Path) -> str:
    """Return the name in `sys.modules` of the module of a plug-in."""
    return _PREFIX + re.sub(r"\W", "_", path.stem)


def module_of(file: str) -> ModuleType:
    """Execute a plug-in once and return its module, `tdint_plugin_` and the name of the file.

    Raises
    ------
    UsageError
        The file does not exist or cannot be executed (the message states error and line), or
        another plug-in has the same file name.
    """
    path = Path(file)
    if path.suffix != ".py" or not is_file(path):
        raise UsageError(f"{file}: file not found; a plug-in is a Python file, NAME.py")
    name = _module_name(path)
    # A process executes a plug-in once. A second version of it would give inconsistent results.
    loaded = sys.modules.get(name)
    if loaded is not None:
        if loaded.__file__ != str(path.resolve()):
            raise UsageError(
                f"{file}: {loaded.__file__} has the same name; rename one of the two plug-ins"
            )
        if vars(loaded)["__digest__"] != digest_of(path):
            raise UsageError(
                f"{file}: the file has changed since this process executed it; restart Python"
            )
        return loaded
    specification = importlib.util.spec_from_file_location(name, path.resolve())
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    # The module is in `sys.modules` before it is executed, as in Python's own import, and is
    # removed if it fails.
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
    """Return a message for each import of a plug-in from a private module of tdint.

    Each message states the line and the import to write instead.
    """
    # The source is read, because the module imports from layers above this one.
    public_names = {"rows", *declared_homes(str(Path(__file__).parents[1] / "plugin.py"))}
    messages = []
    for node in ast.walk(ast.parse(Path(file).read_bytes())):
        module = getattr(node, "module", None) or ""
        if (
            isinstance(node, ast.ImportFrom)
            and module.startswith("tdint.")
            and module != "tdint.plugin"
        ):
            names = ["rows" if alias.name == "layout" else alias.name for alias in node.names]
            public = ", ".join(name for name in names if name in public_names)
            write = (
                f"write from tdint.plugin import {public}"
                if public
                else "see the names of tdint.plugin"
            )
            messages.append(f"{file}:{node.lineno}: {module} may change without notice; {write}")
    return messages


def home_of(name: str, attribute: str) -> tuple[str, str] | None:
    """Return path and SHA-256 of the plug-in that lists a method or law, or None.

    `attribute` is the tuple of the plug-in to search, for example `LAWS`.
    """
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
    """Return the path of a plug-in that another process used, if the file is unchanged.

    Raises
    ------
    UsageError
        The file is missing or has changed.
    """
    try:
        if digest_of(Path(file)) == digest:
            return file
        reason = "which has changed"
    except TdintError:
        reason = "which does not exist"
    raise UsageError(
        f"the object requires the plug-in {file}, {reason}: load the original version with "
        "tdint.load_plugin first"
    )


def files_to_send() -> tuple[tuple[str, bytes], ...]:
    """Return names and contents of the executed plug-ins, for processes that cannot read them."""
    files = [module.__file__ for name, module in sys.modules.items() if name.startswith(_PREFIX)]
    return tuple((Path(file).name, Path(file).read_bytes()) for file in files if file)


def files_received(sent: Iterable[tuple[str, bytes]]) -> list[str]:
    """Return the paths of plug-ins that another process sent.

    A plug-in that this process has executed keeps its path. Others are written to a temporary
    directory.

    Raises
    ------
    UsageError
        This process has executed a different file with this name.
    """
    files = []
    for name, content in sent:
        loaded = getattr(sys.modules.get(_module_name(Path(name))), "__file__", None)
        file = Path(loaded) if loaded else _folder() / name
        if not loaded:
            file.write_bytes(content)
        elif file.read_bytes() != content:
            raise UsageError(
                f"{name}: a worker has executed another version of this plug-in; restart them"
            )
        files.append(str(file))
    return files


def peers() -> list[tuple[str, str, Callable[[Any], Any]]]:
    """Return the reference programs of plug-ins for work-precision diagrams (their tuples PEERS).

    Returns
    -------
    list of (str, str, callable)
        Name of the plug-in, name of the program, and a function of the problem.

    Raises
    ------
    UsageError
        PEERS contains other objects.
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
                    f"{module.__file__}: PEERS must contain pairs of a name and a function, not "
                    f"{peer!r}"
                )
            check_name(peer[0].partition(":")[0], (), "peer", str(module.__file__))
            peers_of.append((Path(str(module.__file__)).stem, *peer))
    return peers_of


@cache
def _folder() -> Path:
    """Return the temporary directory of plug-ins that this process received."""
    from tempfile import mkdtemp

    return Path(mkdtemp(prefix="tdint-plugins-"))


@contextmanager
def faults_of(where: str) -> Iterator[None]:
    """Convert any exception to a one-line UsageError that starts with `where` and the line."""
    try:
        yield
    except (TdintError, KeyboardInterrupt):
        raise
    except BaseException as error:  # code of other people may raise any exception
        file = Path(where).name
        lines = [
            frame.lineno
            for frame in traceback.extract_tb(error.__traceback__)
            if Path(frame.filename).name == file
        ]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        try:
            text = " ".join((error.msg if isinstance(error, SyntaxError) else str(error)).split())
        except Exception:  # also in its method __str__
            text = "without a readable message"
        place = f"{where}:{line}" if line else where
        raise UsageError(f"{place}: {type(error).__name__}: {text}") from None


def installed(group: str, take: Callable[[Any, Origin], object]) -> None:
    """Pass the objects of all entry points of a group to a function.

    An invalid entry point causes a warning and is skipped.

    Parameters
    ----------
    group : str
        Group of entry points.
    take : callable
        Receives the object and its `Origin`; raises UsageError if the object is invalid.
    """
    from importlib.metadata import entry_points  # imported here, because it takes 20 ms

    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        package = f"{point.dist.name} {point.dist.version}" if point.dist else ""
        place = f"entry point {point.name} of {point.group} ({point.value})"
        origin = Origin(", ".join(filter(None, (package, place))), point.module, package)
        try:
            with faults_of(origin.where):
                take(point.load(), origin)
        except TdintError as error:
            LOG.warning("plug-in skipped: %s", error)


def declared(plugin: Any, attribute: str, kind: type, where: str) -> Iterator[Any]:
    """Yield the objects of a type that an entry point or a file provides.

    Parameters
    ----------
    plugin : object
        Object of the entry point: an object of the type, several, or a module.
    attribute : str
        Name of the tuple in a module.
    kind : type
        Type of the objects.
    where : str
        Origin for messages.
    """
    listed = getattr(plugin, attribute, ()) if isinstance(plugin, ModuleType) else plugin
    for item in (listed,) if isinstance(listed, kind) else listed:
        if not isinstance(item, kind):
            raise UsageError(
                f"{where}: {attribute} must contain {kind.__name__} objects, not "
                f"{type(item).__name__}"
            )
        yield item


def check_name(name: str, names: Any, kind: str, where: str) -> None:
    """Raise UsageError if a name is invalid or in use.

    Built-in names cannot be hidden, and plug-ins cannot hide each other.

    Parameters
    ----------
    name : str
        Name of the law, method or reference program.
    names : collection of str
        Names in use.
    kind : str
        Noun for messages.
    where : str
        Origin for messages.

    Raises
    ------
    UsageError
        The name is invalid or in use.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise UsageError(f"{where}: invalid name of a {kind}: {name!r}; use a-z, 0-9 and hyphens")
    if name in names:
        raise UsageError(f"{where}: a {kind} {name!r} already exists; choose another name")
