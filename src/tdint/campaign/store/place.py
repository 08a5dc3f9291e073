"""Where a store may lie: on a disk of this machine, and with one writer at a time."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tdint.errors import OutputError
from tdint.files import is_file, remove_abandoned
from tdint.system import file_system

LOCK = ".campaign.lock"
"""Held by the one that writes; an empty SQLite file, for its locks end with their process on every system."""

_NETWORK = {
    *("nfs", "nfs4", "cifs", "smb3", "smbfs", "ncpfs", "afs", "9p", "ceph", "lustre", "gpfs", "beegfs", "glusterfs"),
    *("pvfs2", "orangefs", "fuse.sshfs", "fuse.glusterfs", "fuse.ceph", "fuse.s3fs", "fuse.juicefs"),
    *("webdav", "afpfs", "network drive"),
}


def refuse_network(folder: Path) -> None:
    """Refuse a folder on a network file system: SQLite's log needs memory that all processes share.

    Where the system does not tell nothing is refused.

    Raises
    ------
    OutputError
        The folder lies on one.
    """
    kind = file_system(folder)
    if kind in _NETWORK:
        raise OutputError(
            f"{folder}: lies on a network file system ({kind}), on which the store is not safe; write to a disk of "
            "this machine (such as /tmp), each shard to its own, and put them together with `tdint campaign merge`"
        )


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
