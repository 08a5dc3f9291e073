"""Paths in a campaign file, as those in a model file."""

from __future__ import annotations

import os
from pathlib import Path


def resolved(file: str, folder: Path) -> str:
    """A path as seen from the working directory, without `folder/..` where that means the same."""
    path = os.fspath(folder / file)
    plain = os.path.normpath(path)
    return plain if os.path.realpath(plain) == os.path.realpath(path) else path
