"""Storage of compiled kernels.

Object files are stored in a directory with a name that contains a hash of the versions of the
compiler and of Python. The name of each file contains the kernel or law, its form, the processor
and a hash of the sources (see `tdint.kernels.building.sources`), so that an outdated file is never
used. The file contains the same information, which is hashed together with the code. The
directories are searched in this order:

1. TDINT_KERNELS_DIR, a shared directory created by `tdint compile -o`, which is never written to;
2. TDINT_CACHE_DIR if it is set, otherwise the cache of the user. New object files are written to
  this directory. Files that were not loaded for a month are removed;
3. the directory of the package, for any version of Python and of the compiler.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from tdint.errors import UsageError
from tdint.kernels.building.loading import unpack
from tdint.kernels.building.sources import digest
from tdint.kernels.building.target import Target
from tdint.system import cache_home, cache_subfolder, is_trusted, lock, remove_unused

LOCK_PREFIX = ".lock-"
"""Beginning of the names of the lock files in a directory of object files."""

_DAYS_KEPT = 30  # days after which an unused object file is removed from the cache
_DAYS_OF_PART = 1.0  # days; an object file is written within a second
_PART = ".part"
_DAY = 86400.0  # s
_PACKAGE = Path(__file__).parents[2]
_PREBUILT = _PACKAGE / "kernels" / "prebuilt"
_CONVENTION = "numba 3"
"""Calling convention of `tdint.kernels.building.loading` and contents of the description. A change
requires a new number."""


def identity(name: str, form: str, target: Target) -> dict[str, str]:
    """Return the properties that identify an object file, by their names in its description.

    They are kernel, form, platform, processor, hash of the sources and calling convention.

    Parameters
    ----------
    form : str
        Form of the code, of `tdint.kernels.building.compilable`.
    """
    return {
        "kernel": name,
        "form": form,
        "platform": target.platform,
        "target": target.text,
        "sources": digest(name),
        "convention": _CONVENTION,
    }


def find_object(
    name: str, form: str, targets: tuple[Target, ...]
) -> tuple[Path, bytes, dict[str, Any]] | None:
    """Return the path of the object file of a kernel, its code, and its description; None without
    an object file.

    The first directory with a valid object file for a target is used, and in this directory the
    first of the targets, which are processors of a single platform in order of preference. Corrupt
    files are ignored. In the cache, files of other users are also ignored, except files of the
    owner of the package.
    """
    directories = _search_path(targets[0].platform)
    return next(
        filter(None, (_find_in(*directory, name, form, targets) for directory in directories)),
        None,
    )


def origin(file: Path) -> str:
    """Return the origin of an object file: `wheel` (part of the package), `TDINT_KERNELS_DIR` or
    `cache`."""
    # The paths are compared without resolving symbolic links: `find_object` builds the path of the
    # file from the same directories.
    if file.is_relative_to(_PREBUILT):
        return "wheel"
    shared = os.environ.get("TDINT_KERNELS_DIR")
    return "TDINT_KERNELS_DIR" if shared and file.is_relative_to(shared) else "cache"


def has(name: str, form: str, target: Target, directory: Path | None = None) -> bool:
    """Return True if a directory (default: the cache of the user) contains a valid object file of a
    kernel.

    A file that is found in the cache is regarded as used: its modification time is updated, at most
    once a day.
    """
    root = directory or cache_home()
    if root is None:
        return False
    # True for the cache: files of other users are ignored.
    return bool(
        _find_in(root / folder_name(target.platform), directory is None, name, form, (target,))
    )


def _search_path(platform: str) -> Iterator[tuple[Path, bool]]:
    """Yield the directories that are searched for object files, in order, each with True if files
    of other users are ignored in it (the cache).

    Raises
    ------
    UsageError
        The shared directory does not exist.
    """
    if shared := os.environ.get("TDINT_KERNELS_DIR"):
        if not Path(shared).is_dir():
            raise UsageError(
                f"TDINT_KERNELS_DIR={shared}: directory not found; create it with "
                "`tdint compile -o`"
            )
        yield Path(shared) / folder_name(platform), False
    if root := cache_home():
        yield root / folder_name(platform), True
    yield _PREBUILT / platform, False


def _find_in(
    directory: Path, check: bool, name: str, form: str, targets: tuple[Target, ...]
) -> tuple[Path, bytes, dict[str, Any]] | None:
    """Return path, code and description of the object file of a kernel in a directory, or None.

    The directory does not have to exist. If `check` is True (the cache), files of other users are
    ignored.
    """
    for target in targets:
        path = directory / file_name(name, form, target)
        try:
            if not path.is_file():
                continue
            with path.open("rb") as stream:
                file = os.fstat(stream.fileno())
                if check and not is_trusted(file, _PACKAGE.stat().st_uid):
                    continue
                code, description = unpack(stream.read())
        except (OSError, ValueError, RecursionError):
            continue
        # Files that are not used for a month are removed; the modification time is updated at most
        # once a day.
        if description.items() >= identity(name, form, target).items():
            if check and file.st_mtime < time.time() - _DAY:
                with suppress(OSError):
                    os.utime(path)
            return path, code, description
    return None


def save(
    data: bytes, name: str, form: str, target: Target, directory: Path | None = None
) -> Path | None:
    """Write an object file atomically and return its path; None if it cannot be written to the
    cache of the user.

    After a file has been written to the cache, files and directories of the cache that have not
    been used for _DAYS_KEPT days are removed, and partial files of killed processes after
    _DAYS_OF_PART days. A shared directory (`directory`) is never cleaned.

    Raises
    ------
    OSError
        `directory` is specified and cannot be written to.
    """
    if directory is not None:
        objects = directory / folder_name(target.platform)
        _make_readable_directory(objects)
        return _write(data, objects / file_name(name, form, target))
    if cached := cache_subfolder(folder_name(target.platform)):
        with suppress(OSError):
            path = _write(data, cached / file_name(name, form, target))
            # Unused kernels of the current versions of compiler and Python, then unused directories
            # of other versions
            remove_unused("*.object", _DAYS_KEPT, keep=path)
            remove_unused(f".*{_PART}", _DAYS_OF_PART, keep=path)
            remove_unused("kernels-*", _DAYS_KEPT, keep=path.parent)
            return path
    return None


def writable() -> Path | None:
    """Return the directory for new object files; None if no directory is writable."""
    return cache_subfolder(folder_name())


def clean() -> int:
    """Remove all object files from the cache of the user and return the number of removed files.

    Object files for other versions of Python and of the compiler are included, and files that
    earlier versions of tdint have left in the installed package. A file that cannot be removed
    remains without a message and is not counted. The locks of processes that are compiling remain,
    so that no other process compiles the same kernels.
    """
    homes = [_PACKAGE / "kernels" / "__pycache__", *filter(None, [cache_home()])]
    stores = (store for root in homes for store in root.glob("kernels-*"))
    folders = [store for store in stores if store.is_dir() and not store.is_symlink()]
    removed = 0
    for path in (path for directory in folders for path in directory.iterdir()):
        # Files of another user remain, or on Windows files that a process has opened.
        with suppress(OSError):
            if path.name.startswith(LOCK_PREFIX):
                _remove_lock(path)
            elif path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()
                removed += path.suffix == ".object"
    for directory in folders:
        with suppress(OSError):  # files remain in the directory
            directory.rmdir()
    return removed


def _remove_lock(file: Path) -> None:
    """Remove a lock file, unless another process has locked it. Processes that wait for the lock
    then lock the new file of this name (`tdint.system.locked`)."""
    with file.open("ab") as stream:
        if lock(stream.fileno()):
            file.unlink()


def _make_readable_directory(directory: Path) -> None:
    """Create a directory that other users can read, independent of the umask."""
    if not directory.exists():
        _make_readable_directory(directory.parent)
        directory.mkdir(exist_ok=True)
        directory.chmod(0o755)


def file_name(name: str, form: str, target: Target) -> str:
    """Return the file name of a compiled kernel.

    Parameters
    ----------
    name : str
        Name of the kernel, `package.module:function`.
    form : str
        Form of the code, of `tdint.kernels.building.compilable`.

    Returns
    -------
    str
        Four parts, separated by hyphens, with the suffix `.object`: kernel name (without `tdint.`,
        with a dot instead of the colon), form, target, and hash of the sources.
    """
    sources = digest(name)
    return f"{name.removeprefix('tdint.').replace(':', '.')}-{form}-{target.text}-{sources}.object"


def _write(data: bytes, path: Path) -> Path:
    """Write a file atomically, readable by all users, and return its path.

    OSError is raised if the directory cannot be created or written to.
    """
    import tempfile

    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=_PART)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path


@cache
def folder_name(platform: str = sys.platform) -> str:
    """Return the name of the directory of object files: `kernels-` and a hash.

    The hash depends on the versions of Python and of the compiler (numba, llvmlite), on the calling
    convention and on the platform, a value of `sys.platform`. Object files of other versions are in
    other directories and therefore never used. The result is cached.
    """
    versions = hashlib.sha256(repr((sys.version_info[:2], platform, _CONVENTION)).encode())
    for package in ("numba", "llvmlite"):
        # The packages are not imported, because this would require more time than all other
        # operations.
        specification = importlib.util.find_spec(package)
        if specification and specification.origin:
            versions.update((Path(specification.origin).parent / "_version.py").read_bytes())
    return f"kernels-{versions.hexdigest()[:16]}"
