"""What is kept between runs, in one folder of the user: compiled kernels, reference solutions."""

from __future__ import annotations

import os
import shutil
import stat
import time
from contextlib import suppress
from pathlib import Path


def cache_home() -> Path | None:
    """TDINT_CACHE_DIR, else the platform's folder for caches; None for a user without a home."""
    if chosen := os.environ.get("TDINT_CACHE_DIR"):
        return Path(chosen)
    import platformdirs

    home = platformdirs.user_cache_path("tdint", appauthor=False)
    return home if home.is_absolute() else None


def cache_subfolder(name: str) -> Path | None:
    """A folder in the cache, made if it is missing and marked as used now; None if it cannot be written.

    What is loaded from it is run: a folder that belongs to another user, or that others may write to, is not used.
    """
    home = cache_home()
    if home is None:
        return None
    folder = home / name
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        os.utime(folder)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) and _is_safe(home, folder) else None


def _is_safe(home: Path, folder: Path) -> bool:
    """Whether nobody else may put anything into a folder or, by renaming it within its home, in its place.

    The folder must be this user's and closed to others. Its home may be root's, and open if it is sticky, as /tmp.
    """
    if not hasattr(os, "getuid"):  # Windows keeps a user's folders by other means.
        return True
    try:
        own, above = folder.lstat(), home.stat()
    except OSError:
        return False
    closed = stat.S_ISDIR(own.st_mode) and not own.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    kept = not above.st_mode & stat.S_IWOTH or bool(above.st_mode & stat.S_ISVTX)
    return own.st_uid == os.getuid() and closed and above.st_uid in (os.getuid(), 0) and kept


def remove_unused(pattern: str, days: float, *, keep: Path) -> None:
    """Remove files or folders beside `keep` by a pattern of their names that were not used for some days."""
    limit = time.time() - days * 86400.0
    for one in keep.parent.glob(pattern):
        with suppress(OSError):
            if one == keep or one.stat().st_mtime >= limit:
                continue
            if one.is_dir():
                shutil.rmtree(one, ignore_errors=True)
            else:
                one.unlink()
