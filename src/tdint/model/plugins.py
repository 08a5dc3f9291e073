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
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from tdint.errors import TdintError, UsageError
from tdint.files import digest_of, is_file
from tdint.public_names import PLUGIN

LOG = logging.getLogger("tdint")

SAVE_IT = (
    "save the definition to a file (in a notebook, `%%writefile my_law.py` as the first line of "
    'its cell, with LAWS = (LAW,) at its end), load it with tdint.load_plugin("my_law.py"), and '
    "use its name"
)
"""Remedy for a law or a method that a notebook defines: compiled loops are built from files."""

NAME = r"[a-z][a-z0-9]*([-_][a-z0-9]+)*"
"""Allowed names of methods and laws. They are used in specifications, labels and file names."""

_PREFIX = "tdint_plugin_"
"""Prefix of the names of plug-in modules in `sys.modules`."""


class Origin(NamedTuple):
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

    def keep_code(self, noun: str, registered: Any) -> None:
        """Store the SHA-256 of all files that define a law or method, in `sources.CODE`, for the
        description of the code that computed a result.

        Modules without a file are omitted. Examples are modules of a zip archive, and code from
        standard input, for which Python states the file name `<stdin>`.

        Parameters
        ----------
        noun : str
            `law` or `method`.
        """
        # Imported here, because most commands do not need the digests.
        from tdint.kernels.building.sources import CODE, files_of

        package = f"{self.package}: " if self.package else ""
        modules = [name for name in (self.module, *_modules(registered)) if _has_file(name)]
        CODE[f"{noun} {registered.name}"] = files_of(modules, package)


def _modules(registered: Any) -> Iterator[str]:
    """Yield the name of the module of each function in a dataclass and its inner dataclasses."""
    for field in fields(registered):
        attribute = getattr(registered, field.name)
        if is_dataclass(attribute):
            yield from _modules(attribute)
        # Some attributes are wrappers; their attribute `function` is the function of the plug-in.
        elif callable(attribute := getattr(attribute, "function", attribute)):
            yield getattr(attribute, "__module__", None) or ""


def _has_file(module: str) -> bool:
    """Return True if an imported module has a source file that exists."""
    return is_file(getattr(sys.modules.get(module), "__file__", None) or "")


def _module_name(path: Path) -> str:
    """Return the name in `sys.modules` of the module of a plug-in."""
    return _PREFIX + re.sub(r"\W", "_", path.stem)


def module_of(file: str) -> ModuleType:
    """Return the module of a plug-in, which is executed once per process.

    The module contains its executed source in `__source__` and its SHA-256 in `__digest__`. In
    `sys.modules`, the name of the module is `tdint_plugin_` followed by the name of the file
    without `.py`. Characters that are not allowed in Python names are replaced by `_`.

    Raises
    ------
    UsageError
        The file does not exist or cannot be executed (the message states error and line), or
        another plug-in has the same file name.
    """
    # Commands without plug-ins do not load this module.
    import hashlib

    path = Path(file)
    if path.suffix != ".py" or not is_file(path):
        raise UsageError(f"{file}: file not found; a plug-in is a Python file, NAME.py")
    name = _module_name(path)
    # A process executes a plug-in one time. A second version of the plug-in would give inconsistent
    # results.
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
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    # The file is read only one time, so that the stored source is the executed source. Python's own
    # import would read the file again, or execute the cached bytecode of an earlier version that
    # has the same size and was written in the same second.
    with faults_of(file):
        source = path.read_bytes()
    vars(module)["__source__"] = source
    vars(module)["__digest__"] = hashlib.sha256(source).hexdigest()
    # The module is in `sys.modules` before it is executed, as in Python's own import, and is
    # removed if it fails.
    sys.modules[name] = module
    try:
        with faults_of(file):
            exec(compile(source, path.resolve(), "exec", dont_inherit=True), vars(module))
    except BaseException as error:
        del sys.modules[name]
        location, _, reason = str(error).partition(": ")
        # If the import of a private module of tdint failed, add the public import as a remedy.
        if reason.startswith(("ModuleNotFoundError: ", "ImportError: ")):
            for message in private_imports(file):
                if message.startswith(f"{location}: "):
                    hint = message.removeprefix(f"{location}: ")
                    raise UsageError(f"{error}; {hint}") from None
        raise
    return module


def private_imports(file: str) -> list[str]:
    """Return a message for each import of a plug-in from a private module of tdint.

    Each message states the line and the import to write instead.
    """
    messages = []
    for node in ast.walk(ast.parse(Path(file).read_bytes())):
        if not isinstance(node, ast.ImportFrom):
            continue
        module_name = node.module or ""
        if module_name.startswith("tdint.") and module_name != "tdint.plugin":
            # The public name of the module `layout` is `rows`.
            names = ["rows" if alias.name == "layout" else alias.name for alias in node.names]
            public = ", ".join(name for name in names if name in PLUGIN)
            advice = (
                f"write from tdint.plugin import {public}"
                if public
                else "see the names of tdint.plugin"
            )
            messages.append(
                f"{file}:{node.lineno}: {module_name} may change without notice; {advice}"
            )
    return messages


def home_of(registered: Any, attribute: str) -> tuple[str, str] | None:
    """Return path and SHA-256 of the plug-in file that defines a method or law.

    The hash is the hash of the executed source. The file may have been edited after its execution.

    Parameters
    ----------
    attribute : str
        Name of the variable of plug-ins that lists these objects, `METHODS` or `LAWS`.

    Returns
    -------
    tuple of (str, str) or None
        None if the object is not defined by a plug-in file, or if `registered` is `None`.
    """
    if registered is None:
        return None
    for module_name, module in list(sys.modules.items()):
        if not (module_name.startswith(_PREFIX) and module.__file__):
            continue
        # A plug-in may list its objects in a tuple, or contain a single object. A plug-in that was
        # refused may list another object with the same name. A registered law is a changed copy of
        # the object in the plug-in (`register_law`) with the same attribute `functions`.
        listed = getattr(module, attribute, ())
        for method_or_law in listed if isinstance(listed, Iterable) else (listed,):
            if getattr(method_or_law, "name", None) == registered.name and (
                getattr(method_or_law, "functions", method_or_law)
                is getattr(registered, "functions", registered)
            ):
                return module.__file__, vars(module)["__digest__"]
    return None


def require_version(registered: Any, attribute: str, file: str, digest: str) -> None:
    """Raise UsageError if a method or law differs from the version that another process used.

    Parameters
    ----------
    file, digest : str
        Path and SHA-256 of the plug-in in the other process. The path may differ in this process.
    """
    home = home_of(registered, attribute)
    if home is None or home[1] != digest:
        used = f"{home[0]} with SHA-256 {home[1][:12]}" if home else "other code"
        raise UsageError(
            f"the object requires the plug-in {file} with SHA-256 {digest[:12]}, but this process "
            f"uses {registered.name!r} of {used}; restart Python, and first load the original "
            "version with tdint.load_plugin"
        )


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
        reason = "has changed"
    except TdintError:
        reason = "does not exist"
    raise UsageError(
        f"the object requires the plug-in {file}, which {reason}; first load the original version "
        "with tdint.load_plugin"
    )


def files_to_send() -> tuple[tuple[str, bytes], ...]:
    """Return file name and executed source of each plug-in, for processes without these files."""
    modules = [module for name, module in sys.modules.copy().items() if name.startswith(_PREFIX)]
    return tuple(
        (Path(module.__file__).name, vars(module)["__source__"])
        for module in modules
        if module.__file__
    )


def files_received(sent: Iterable[tuple[str, bytes]]) -> list[str]:
    """Return the paths of plug-ins that another process sent.

    A plug-in that this process has executed keeps its path. Other plug-ins are written to a
    temporary directory.

    Raises
    ------
    UsageError
        This process has executed a different file with this name.
    """
    files = []
    for name, content in sent:
        loaded = sys.modules.get(_module_name(Path(name)))
        file = Path(loaded.__file__) if loaded and loaded.__file__ else _folder() / name
        if loaded is None:
            file.write_bytes(content)
        elif vars(loaded)["__source__"] != content:
            raise UsageError(
                f"{name}: a worker executed another version of this plug-in; restart the workers"
            )
        files.append(str(file))
    return files


def peers() -> list[tuple[str, str, Callable[[Any], Any]]]:
    """Return the reference programs of plug-ins for work-precision diagrams (their tuples PEERS).

    Returns
    -------
    list of (str, str, callable)
        Name of the plug-in, name of the program, and a function that solves a problem.

    Raises
    ------
    UsageError
        PEERS contains other objects.
    """
    programs = []
    for module in [
        module for name, module in sys.modules.copy().items() if name.startswith(_PREFIX)
    ]:
        for program in getattr(module, "PEERS", ()):
            if not (
                isinstance(program, tuple)
                and len(program) == 2
                and isinstance(program[0], str)
                and callable(program[1])
            ):
                raise UsageError(
                    f"{module.__file__}: PEERS must contain pairs of a name and a function, not "
                    f"{program!r}"
                )
            check_name(program[0].partition(":")[0], (), "peer", str(module.__file__))
            programs.append((Path(str(module.__file__)).stem, *program))
    return programs


@cache
def _folder() -> Path:
    """Return the temporary directory of plug-ins that this process received."""
    from tempfile import mkdtemp

    return Path(mkdtemp(prefix="tdint-plugins-"))


@contextmanager
def faults_of(where: str) -> Iterator[None]:
    """Convert any exception to a UsageError of one line, which starts with `where`.

    If `where` is a path, the line of the exception in this file follows. Errors of tdint are not
    converted.
    """
    try:
        yield
    except (TdintError, KeyboardInterrupt):
        raise
    except BaseException as error:  # the code of a plug-in may raise any exception
        file_name = Path(where).name
        lines_in_plugin = [
            frame.lineno
            for frame in traceback.extract_tb(error.__traceback__)
            if Path(frame.filename).name == file_name
        ]
        line = lines_in_plugin[-1] if lines_in_plugin else None
        if isinstance(error, SyntaxError):
            line = error.lineno
        try:
            text = error.msg if isinstance(error, SyntaxError) else str(error)
            message = " ".join(text.split())
        except Exception:  # the method __str__ of the exception may also fail
            message = "without a readable message"
        location = f"{where}:{line}" if line else where
        raise UsageError(f"{location}: {type(error).__name__}: {message}") from None


def installed(group: str, register: Callable[[Any, Origin], object]) -> None:
    """Pass the objects of all entry points of a group to a function.

    An invalid entry point causes a warning and is skipped.

    Parameters
    ----------
    register : callable
        Receives the object and its `Origin`; raises UsageError if the object is invalid.
    """
    from importlib.metadata import entry_points  # imported here, because the import requires 20 ms

    for entry_point in sorted(entry_points(group=group), key=lambda entry_point: entry_point.name):
        package = f"{entry_point.dist.name} {entry_point.dist.version}" if entry_point.dist else ""
        description = f"entry point {entry_point.name} of {entry_point.group} ({entry_point.value})"
        origin = Origin(
            ", ".join(filter(None, (package, description))), entry_point.module, package
        )
        try:
            with faults_of(origin.where):
                register(entry_point.load(), origin)
        except TdintError as error:
            LOG.warning("plug-in skipped: %s", error)


def declared(plugin: Any, attribute: str, expected_type: type, where: str) -> Iterator[Any]:
    """Yield the laws, methods or measures of a plug-in.

    Parameters
    ----------
    plugin : object
        Module of a file, or the object of an entry point: a module, a single law, method or
        measure, or a sequence.
    attribute : str
        Name of the variable in a module: `LAWS`, `METHODS` or `MEASURES`.
    where : str
        Origin for messages.

    Raises
    ------
    UsageError
        An object does not have the required type.
    """
    objects = getattr(plugin, attribute, ()) if isinstance(plugin, ModuleType) else plugin
    for listed in (objects,) if isinstance(objects, expected_type) else objects:
        if not isinstance(listed, expected_type):
            raise UsageError(
                f"{where}: {attribute} must contain {expected_type.__name__} objects, not "
                f"{type(listed).__name__}"
            )
        yield listed


def check_name(name: str, names: Any, noun: str, where: str) -> None:
    """Raise UsageError if a name is invalid or in use.

    Names must be unique in the built-in objects and all plug-ins.

    Parameters
    ----------
    name : str
        Name of the law, method or reference program.

    Raises
    ------
    UsageError
        The name is invalid or in use.
    """
    if not isinstance(name, str) or not re.fullmatch(NAME, name):
        raise UsageError(f"{where}: invalid name of a {noun}: {name!r}; use a-z, 0-9 and hyphens")
    if name in names:
        raise UsageError(f"{where}: a {noun} {name!r} already exists; choose another name")
