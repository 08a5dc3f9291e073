"""Directories without write permission, as on a read-only medium or of another user."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Make a directory read-only in a `with` block.

    Permissions do not restrict the user root, for whom the directory is mounted as read-only.
    """
    if os.geteuid() == 0:
        mount = ["mount", "--bind", "-o", "ro", str(folder.absolute()), str(folder.absolute())]
        if subprocess.run(mount, capture_output=True, check=False).returncode:
            pytest.skip("the user root cannot mount directories in this container")
        try:
            yield
        finally:
            subprocess.run(["umount", str(folder.absolute())], check=True)
        return
    paths = [folder, *folder.rglob("*")]
    modes = {path: path.stat().st_mode for path in paths}
    for path in paths:
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        yield
    finally:
        for path, mode in modes.items():
            path.chmod(mode)
