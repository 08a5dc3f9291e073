"""Where compiled kernels are kept.

Objects lie in a folder that is named by a hash of the kernel sources and versions, so a stale one cannot be found; in
it, each is named by kernel, variant and processor. Folders are looked through in this order:

1. TDINT_KERNELS_DIR, which is never written: a shared one, made by `tdint compile`;
2. TDINT_CACHE_DIR if that is set, else `__pycache__` beside the kernels of the installed package (an image, or a
   cluster's shared installation, compiles once), then the user's cache.

The first of the second kind that can be written takes new objects.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from tdint.cache import cache_home, cache_subfolder, remove_unused
from tdint.kernels.building.objects import unpack
from tdint.kernels.building.target import Target

_DAYS_KEPT = 30
_COMPILING = ("compiler", "objects", "signature")  # what of `building` the objects depend on
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
    folder = home / _fingerprinted()
    for target in targets:
        try:
            with (folder / file_name(name, variant, target)).open("rb") as stream:
                if check and not _trusted(os.fstat(stream.fileno())):
                    continue
                code, about = unpack(stream.read())
        except (OSError, ValueError):
            continue
        if about.get("kernel") == name:
            return code, about["symbol"]
    return None


def keep(data: bytes, name: str, variant: str, target: Target, folder: Path | None = None) -> Path | None:
    """Write a packed object, whole or not at all; where it is, None if nowhere can be written.

    Goes into `folder` (as TDINT_KERNELS_DIR will name it) if one is given, and an OSError is raised then.
    """
    if folder is not None:
        return _write(data, folder / _fingerprinted() / file_name(name, variant, target))
    for goal in _goals():
        with suppress(OSError):
            path = _write(data, goal / file_name(name, variant, target))
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
        yield _beside() / _fingerprinted()
    if folder := cache_subfolder(_fingerprinted()):
        yield folder


def file_name(name: str, variant: str, target: Target) -> str:
    """The file of a kernel."""
    return f"{name.removeprefix('tdint.').replace(':', '.')}-{variant}-{target.text}.object"


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


def _fingerprinted() -> str:
    return f"kernels-{fingerprint()}"


@cache
def fingerprint() -> str:
    """Hash of all that a compiled kernel depends on but for the processor: kernel sources and versions."""
    digest = hashlib.sha256()
    for source in sorted([*_PACKAGE.glob("kernels/**/*.py"), *_PACKAGE.glob("methods/**/*.py")]):
        if source.parent.name == "building" and source.stem not in _COMPILING:
            continue
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    for package in ("numba", "llvmlite"):
        # Not imported: that would take longer than all the rest.
        found = importlib.util.find_spec(package)
        if found and found.origin:
            digest.update((Path(found.origin).parent / "_version.py").read_bytes())
    digest.update(repr((sys.version_info[:2], sys.platform)).encode())
    return digest.hexdigest()[:16]
