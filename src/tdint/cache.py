"""What is kept between runs, in one folder of the user: compiled kernels, reference solutions."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

from tdint.system import is_own


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
    return folder if os.access(folder, os.W_OK) and is_own(home, folder) else None


def remove_unused(pattern: str, days: float, *, keep: Path) -> None:
    """Remove files or folders beside `keep` by a pattern of their names that were not used for some days."""
    import shutil

    limit = time.time() - days * 86400.0
    for one in keep.parent.glob(pattern):
        with suppress(OSError):
            if one == keep or one.stat().st_mtime >= limit:
                continue
            if one.is_dir():
                shutil.rmtree(one, ignore_errors=True)
            else:
                one.unlink()
