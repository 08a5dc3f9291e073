"""Paths in a file, which start from its folder."""

from __future__ import annotations

import os
from pathlib import Path


def resolve(file: str, folder: Path) -> str:
    """The path as seen from the working directory, without `folder/..` where that means the same."""
    path = os.fspath(folder / file)
    plain = os.path.normpath(path)
    return plain if os.path.realpath(plain) == os.path.realpath(path) else path


def resolve_or_stdin(file: str, folder: Path) -> str:
    """The same where `-`, standard input, may stand: it stays."""
    return file if file == "-" else resolve(file, folder)
