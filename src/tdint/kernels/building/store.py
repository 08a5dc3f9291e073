"""Where compiled kernels are kept.

Objects lie in a folder that is named by a hash of the compiler's and Python's versions; in it, each
is named by kernel, variant, processor and a hash of the sources that it is compiled from
(`sources`), so a stale one cannot be found. The same stands inside and is hashed with the code.
Folders are looked through in this order:

1. TDINT_KERNELS_DIR, which is never written: a shared one, made by `tdint compile -o`;
2. TDINT_CACHE_DIR if that is set, else the user's cache, which takes new objects; what is not
  loaded for a month is
   removed from it;
3. those that came with the package, for any version of Python and the compiler.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from tdint.errors import UsageError
from tdint.kernels.building.compilable import parse
from tdint.kernels.building.loading import unpack
from tdint.kernels.building.sources import digest
from tdint.kernels.building.target import Target
from tdint.system import cache_home, cache_subfolder, is_trusted, remove_unused

_DAYS_KEPT = 30
_DAY = 86400.0
_PACKAGE = Path(__file__).parents[2]
_PREBUILT = _PACKAGE / "kernels" / "prebuilt"
_CONVENTION = "numba 1"
"""How `loading` calls an object, and what a header says: another one is another number."""


def identity(name: str, variant: str, target: Target) -> dict[str, str]:
    """What an object is: of which kernel, variant and processor, from which sources, and how it is
    called."""
    return {
        "kernel": name,
        "variant": variant,
        "platform": target.platform,
        "target": target.text,
        "sources": digest(name, parse(variant).laws),
        "convention": _CONVENTION,
    }


def look_up(name: str, variant: str, targets: tuple[Target, ...]) -> tuple[Path, bytes, str] | None:
    """File, object and symbol of a kernel for the first of the targets, all of one platform, that
    has one; or None.

    What is damaged, or belongs to someone else who is not the package's owner, does not count.
    """
    places = _places(targets[0].platform)
    return next(
        filter(None, (_look_up_in(*place, name, variant, targets) for place in places)), None
    )


def origin(file: Path) -> str:
    """Where an object that was found comes from: `wheel` (it came with the package),
    `TDINT_KERNELS_DIR` or `cache`."""
    if file.is_relative_to(_PREBUILT):
        return "wheel"
    shared = os.environ.get("TDINT_KERNELS_DIR")
    return "TDINT_KERNELS_DIR" if shared and file.is_relative_to(shared) else "cache"


def has(name: str, variant: str, target: Target, folder: Path | None = None) -> bool:
    """Whether a folder (as TDINT_KERNELS_DIR names it), by default this user's store, has a kernel,
    whatever else could serve."""
    home = folder or cache_home()
    if home is None:
        return False
    return bool(
        _look_up_in(home / folder_name(target.platform), folder is None, name, variant, (target,))
    )


def _places(platform: str) -> Iterator[tuple[Path, bool]]:
    """Folders of objects, and whether what belongs to others does not count there."""
    if shared := os.environ.get("TDINT_KERNELS_DIR"):
        if not Path(shared).is_dir():
            raise UsageError(
                f"TDINT_KERNELS_DIR={shared}: there is no such folder; `tdint compile -o` makes it"
            )
        yield Path(shared) / folder_name(platform), False
    if home := cache_home():
        yield home / folder_name(platform), True
    yield _PREBUILT / platform, False


def _look_up_in(
    folder: Path, check: bool, name: str, variant: str, targets: tuple[Target, ...]
) -> tuple[Path, bytes, str] | None:
    for target in targets:
        path = folder / file_name(name, variant, target)
        try:
            if not path.is_file():
                continue
            with path.open("rb") as stream:
                file = os.fstat(stream.fileno())
                if check and not is_trusted(file, _PACKAGE.stat().st_uid):
                    continue
                code, about = unpack(stream.read())
        except (OSError, ValueError):
            continue
        if about.items() >= identity(name, variant, target).items():
            if check and file.st_mtime < time.time() - _DAY:
                with suppress(OSError):
                    os.utime(path)
            return path, code, about["symbol"]
    return None


def keep(
    data: bytes, name: str, variant: str, target: Target, folder: Path | None = None
) -> Path | None:
    """Write a packed object, whole or not at all; where it is, None if nowhere can be written.

    Goes into `folder` (as TDINT_KERNELS_DIR will name it) if one is given, and an OSError is raised
    then.
    """
    if folder is not None:
        place = folder / folder_name(target.platform)
        _make_for_all(place)
        return _write(data, place / file_name(name, variant, target))
    if goal := cache_subfolder(folder_name(target.platform)):
        with suppress(OSError):
            path = _write(data, goal / file_name(name, variant, target))
            remove_unused("*.object", _DAYS_KEPT, keep=path)
            remove_unused("kernels-*", _DAYS_KEPT, keep=path.parent)
            return path
    return None


def writable() -> Path | None:
    """The folder that new objects go to, None if there is none."""
    return cache_subfolder(folder_name())


def clean() -> int:
    """Remove all objects from this user's store, those of other versions, too; how many there were.

    Also those that earlier versions left in the installed package.
    """
    import shutil

    homes = [_PACKAGE / "kernels" / "__pycache__", *filter(None, [cache_home()])]
    stores = (store for home in homes for store in home.glob("kernels-*"))
    folders = [store for store in stores if store.is_dir() and not store.is_symlink()]
    count = sum(1 for folder in folders for _ in folder.glob("*.object"))
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    return count


def _make_for_all(folder: Path) -> None:
    """Make a folder that others can read, whatever this user lets them otherwise."""
    if not folder.exists():
        _make_for_all(folder.parent)
        folder.mkdir(exist_ok=True)
        folder.chmod(0o755)


def file_name(name: str, variant: str, target: Target) -> str:
    """The file of a kernel."""
    sources = digest(name, parse(variant).laws)
    return (
        f"{name.removeprefix('tdint.').replace(':', '.')}-{variant}-{target.text}-{sources}.object"
    )


def _write(data: bytes, path: Path) -> Path:
    import tempfile

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


@cache
def folder_name(platform: str = sys.platform) -> str:
    """The folder of the objects that these versions of compiler and Python make for a platform."""
    versions = hashlib.sha256(repr((sys.version_info[:2], platform, _CONVENTION)).encode())
    for package in ("numba", "llvmlite"):
        # Not imported: that would take longer than all the rest.
        specification = importlib.util.find_spec(package)
        if specification and specification.origin:
            versions.update((Path(specification.origin).parent / "_version.py").read_bytes())
    return f"kernels-{versions.hexdigest()[:16]}"
