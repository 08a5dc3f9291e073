"""Where a store may lie: on a disk of this machine, and with one writer at a time."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tdint.errors import OutputError
from tdint.files import is_file, remove_abandoned

LOCK = ".campaign.lock"
"""Held by the one that writes; an empty SQLite file, for its locks end with their process on every system."""

_MOUNTS = Path("/proc/self/mountinfo")
_NETWORK = {
    *("nfs", "nfs4", "cifs", "smb3", "smbfs", "ncpfs", "afs", "9p", "ceph", "lustre", "gpfs", "beegfs", "glusterfs"),
    *("pvfs2", "orangefs", "fuse.sshfs", "fuse.glusterfs", "fuse.ceph", "fuse.s3fs", "fuse.juicefs"),
}


def refuse_network(folder: Path, mounts: Path = _MOUNTS) -> None:
    """Refuse a folder on a network file system: SQLite's log needs memory that all processes share.

    Where the system does not tell (it is no Linux) nothing is refused.

    Raises
    ------
    OutputError
        The folder lies on one.
    """
    kind = _file_system(folder, mounts)
    if kind in _NETWORK:
        raise OutputError(
            f"{folder}: lies on a network file system ({kind}), on which the store is not safe; write to a disk of "
            "this machine (such as /tmp), each shard to its own, and put them together with `tdint campaign merge`"
        )


def _file_system(folder: Path, mounts: Path) -> str:
    """The kind of the file system that a folder lies on, or will; empty where that cannot be told."""
    try:
        lines = mounts.read_text(errors="surrogateescape").splitlines()
    except OSError:
        return ""
    path = os.path.realpath(folder)
    kinds: dict[str, str] = {}
    for line in lines:
        before, _, after = line.partition(" - ")
        words, kind = before.split(), after.split()
        if len(words) > 4 and kind:
            point = words[4].encode("latin-1", "replace").decode("unicode_escape", "replace")
            kinds[point] = kind[0]
    inside = [point for point in kinds if path == point or path.startswith(point.rstrip("/") + "/")]
    return kinds[max(inside, key=len)] if inside else ""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Be the only one that writes into a folder; the lock ends with the process, however that ends.

    Raises
    ------
    OutputError
        Another process has it.
    """
    if (folder / LOCK).exists() and not is_file(folder / LOCK):
        raise OutputError(f"{folder / LOCK}: is not a regular file; remove it, or write elsewhere")
    try:
        connection = sqlite3.connect(folder / LOCK, timeout=0.0, isolation_level=None)
    except sqlite3.Error as error:
        raise OutputError(f"{folder}: cannot be written: {error}") from None
    try:
        try:
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            reason = "another tdint is at work on it" if "locked" in str(error) else str(error)
            raise OutputError(f"{folder}: {reason}; wait for its end, or write elsewhere") from None
        except sqlite3.Error as error:
            raise OutputError(
                f"{folder / LOCK}: is no lock of tdint ({error}); remove it, or write elsewhere"
            ) from None
        remove_abandoned(folder)
        yield
    finally:
        connection.close()
