"""Where compiled kernels are kept.

Objects lie in a folder that is named by a hash of the compiler's and Python's versions; in it, each is named by kernel,
variant, processor and a hash of the sources that it is compiled from (`sources`), so a stale one cannot be found.
Folders are looked through in this order:

1. TDINT_KERNELS_DIR, which is never written: a shared one, made by `tdint compile`;
2. TDINT_CACHE_DIR if that is set, else `__pycache__` beside the kernels of the installed package (an image, or a
   cluster's shared installation, compiles once), then the user's cache.

The first of the second kind that can be written takes new objects. What is not loaded for a month is removed from it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from tdint.cache import cache_home, cache_subfolder, remove_unused
from tdint.kernels.building.loading import unpack
from tdint.kernels.building.sources import digest
from tdint.kernels.building.target import Target
from tdint.kernels.building.variant import parse

_DAYS_KEPT = 30
_DAY = 86400.0
_PACKAGE = Path(__file__).parents[2]


def find(name: str, variant: str, targets: tuple[Target, ...]) -> tuple[bytes, str] | None:
    """Object and symbol of a kernel for the first of the targets that has one; None if there is none.

    What is damaged, or belongs to someone else who is not the package's owner, does not count.
    """
    shared = _shared()
    if shared and (found := find_in(shared, name, variant, targets, check=False)):
        return found
    return next(filter(None, (find_in(home, name, variant, targets, check=True) for home in _homes())), None)


def find_in(
    home: Path, name: str, variant: str, targets: tuple[Target, ...], *, check: bool
) -> tuple[bytes, str] | None:
    """`find` in one folder; with `check` what belongs to others does not count."""
    for target in targets:
        path = home / folder_name() / file_name(name, variant, target)
        try:
            with path.open("rb") as stream:
                file = os.fstat(stream.fileno())
                if check and not _trusted(file):
                    continue
                code, about = unpack(stream.read())
        except (OSError, ValueError):
            continue
        if about.get("kernel") == name:
            if check and file.st_mtime < time.time() - _DAY:
                with suppress(OSError):
                    os.utime(path)
            return code, about["symbol"]
    return None


def keep(data: bytes, name: str, variant: str, target: Target, folder: Path | None = None) -> Path | None:
    """Write a packed object, whole or not at all; where it is, None if nowhere can be written.

    Goes into `folder` (as TDINT_KERNELS_DIR will name it) if one is given, and an OSError is raised then.
    """
    if folder is not None:
        return _write(data, folder / folder_name() / file_name(name, variant, target))
    for goal in _goals():
        with suppress(OSError):
            path = _write(data, goal / file_name(name, variant, target))
            remove_unused("*.object", _DAYS_KEPT, keep=path)
            remove_unused("kernels-*", _DAYS_KEPT, keep=path.parent)
            return path
    return None


def writable() -> Path | None:
    """The folder that new objects go to, None if there is none."""
    for goal in _goals():
        with suppress(OSError):
            goal.mkdir(parents=True, exist_ok=True)
            if os.access(goal, os.W_OK):
                return goal
    return None


def _goals() -> Iterator[Path]:
    """Folders for new objects; one that others may write to is none."""
    if not os.environ.get("TDINT_CACHE_DIR"):
        yield _beside() / folder_name()
    if folder := cache_subfolder(folder_name()):
        yield folder


def file_name(name: str, variant: str, target: Target) -> str:
    """The file of a kernel."""
    sources = digest(name, parse(variant).laws)
    return f"{name.removeprefix('tdint.').replace(':', '.')}-{variant}-{target.text}-{sources}.object"


def _write(data: bytes, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path


def _trusted(file: os.stat_result) -> bool:
    """Whether a file belongs to the user, to root or to whom the package belongs to, and others cannot write it."""
    if not hasattr(os, "geteuid"):
        return True
    owners = {os.geteuid(), 0, _PACKAGE.stat().st_uid}
    return file.st_uid in owners and not file.st_mode & 0o022


def _shared() -> Path | None:
    named = os.environ.get("TDINT_KERNELS_DIR")
    return Path(named) if named else None


def _homes() -> Iterator[Path]:
    """Where objects may be kept, the first that can be written before the others."""
    if not os.environ.get("TDINT_CACHE_DIR"):
        yield _beside()
    if home := cache_home():
        yield home


def _beside() -> Path:
    return _PACKAGE / "kernels" / "__pycache__"


@cache
def folder_name() -> str:
    """The folder of the objects that these versions of compiler and Python make."""
    versions = hashlib.sha256(repr((sys.version_info[:2], sys.platform)).encode())
    for package in ("numba", "llvmlite"):
        # Not imported: that would take longer than all the rest.
        found = importlib.util.find_spec(package)
        if found and found.origin:
            versions.update((Path(found.origin).parent / "_version.py").read_bytes())
    return f"kernels-{versions.hexdigest()[:16]}"
