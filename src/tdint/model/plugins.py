"""Modules from outside the package that add to it: a file that the user names, or an installed package.

Nothing is looked for in the working folder, and nothing is named by a model file.
"""

from __future__ import annotations

import importlib.util
import logging
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from tdint.errors import TdintError, UsageError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

LOG = logging.getLogger("tdint")

NAME = re.compile(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*")
"""Names of methods and laws: they stand in specifications, in labels and in names of files."""


_PREFIX = "tdint_plugin_"


def _module_name(path: Path) -> str:
    return _PREFIX + re.sub(r"\W", "_", path.stem)


def module_of(file: str) -> ModuleType:
    """The module in a file, executed once, as `tdint_plugin_` and the file's name.

    Raises
    ------
    UsageError
        No such file, or it cannot be executed: what is wrong and in which line. Two files of one name.
    """
    path = Path(file)
    if path.suffix != ".py" or not path.is_file():
        raise UsageError(f"{file}: a plug-in is a Python file, NAME.py; there is none of this name")
    name = _module_name(path)
    known = sys.modules.get(name)
    if known is not None:
        if known.__file__ != str(path.resolve()):
            raise UsageError(f"{file}: {known.__file__} has the same name; rename one of the two plug-ins")
        return known
    specification = importlib.util.spec_from_file_location(name, path.resolve())
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module
    try:
        with faults_of(file):
            specification.loader.exec_module(module)
    except TdintError:
        del sys.modules[name]
        raise
    return module


def files_to_send() -> tuple[tuple[str, bytes], ...]:
    """Names and contents of the files that were executed, in that order, for processes that cannot read them."""
    found = [module.__file__ for name, module in sys.modules.items() if name.startswith(_PREFIX)]
    return tuple((Path(file).name, Path(file).read_bytes()) for file in found if file)


def files_received(sent: Iterable[tuple[str, bytes]]) -> list[str]:
    """The paths of files that another process sent: where this one has them already, or in a folder of its own.

    Raises
    ------
    UsageError
        This process has executed another file of this name.
    """
    found = []
    for name, content in sent:
        known = getattr(sys.modules.get(_module_name(Path(name))), "__file__", None)
        file = Path(known) if known else _folder() / name
        if not known:
            file.write_bytes(content)
        elif file.read_bytes() != content:
            raise UsageError(f"{name}: a worker has executed another version of this plug-in; start the workers anew")
        found.append(str(file))
    return found


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
    except TdintError:
        raise
    except (Exception, SystemExit) as error:
        own = Path(where).name
        lines = [one.lineno for one in traceback.extract_tb(error.__traceback__) if Path(one.filename).name == own]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        text = " ".join((error.msg if isinstance(error, SyntaxError) else str(error)).split())
        place = f"{where}:{line}" if line else where
        raise UsageError(f"{place}: {type(error).__name__}: {text}") from None


def installed(group: str, take: Callable[[Any, str], object]) -> None:
    """Have what the entry points of a group name taken; a faulty one is warned of and left out.

    Parameters
    ----------
    take : callable
        (object, where it is from) -> None; raises UsageError for what it cannot take.
    """
    from importlib.metadata import entry_points  # 20 ms, and asked for seldom

    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        where = _place(point)
        try:
            with faults_of(where):
                take(point.load(), where)
        except TdintError as error:
            LOG.warning("a plug-in is left out: %s", error)


def _place(point: EntryPoint) -> str:
    package = f"{point.dist.name} {point.dist.version}, " if point.dist else ""
    return f"{package}entry point {point.name} of {point.group} ({point.value})"


def declared(found: Any, attribute: str, kind: type, where: str) -> Iterator[Any]:
    """The objects of a kind in what an entry point or a file names: itself, or what its tuple `attribute` has."""
    listed = getattr(found, attribute, ()) if isinstance(found, ModuleType) else found
    for one in (listed,) if isinstance(listed, kind) else listed:
        if not isinstance(one, kind):
            raise UsageError(f"{where}: {attribute} holds {kind.__name__} objects, not {type(one).__name__}")
        yield one


def check_name(name: str, known: Any, what: str, where: str) -> None:
    """Refuse a name that is none, or is taken: ours are never hidden, nor one plug-in's by another.

    Raises
    ------
    UsageError
        See above.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise UsageError(f"{where}: {name!r} is no name of a {what}; write small letters, digits and hyphens")
    if name in known:
        raise UsageError(f"{where}: there is a {what} {name!r} already; give yours another name")
