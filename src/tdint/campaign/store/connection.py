"""Connections to the file of a store: where it may lie, how they wait for others, what SQLite says put in words."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tdint.errors import OutputError
from tdint.files import remove_abandoned
from tdint.input_bytes import is_file
from tdint.system import file_system

_SILENT, _LONGEST = 1000, 9000
"""Milliseconds that a lock of another program is waited for without a word, and with one."""

_log = logging.getLogger(__name__)


class UntrustedStoreError(OutputError):
    """The file of a store is none, or not as it was written."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(
            f"{name}: cannot be trusted: {why}; is it a store of tdint? Give another folder with -o, or "
            "--overwrite to begin anew"
        )


def connect(name: str, *, log: bool = True) -> sqlite3.Connection:
    """A connection that writes safely: a killed process leaves all that was written whole.

    Parameters
    ----------
    log : bool
        Write fast, a log ahead of the file, and let others read meanwhile; not for network file systems. Else the file
        alone is written, each time to the disk.

    Raises
    ------
    OutputError
        It is no file, or another program keeps it locked.
    """
    _refuse_what_is_no_file(name)
    connection = sqlite3.connect(name, isolation_level=None)
    try:
        _guard(connection)
        wait_for(connection, name, f"PRAGMA journal_mode={'WAL' if log else 'DELETE'}")
        connection.execute(f"PRAGMA synchronous={'NORMAL' if log else 'FULL'}")
    except BaseException:
        connection.close()
        raise
    return connection


def connect_to_read(file: Path) -> sqlite3.Connection:
    """A connection that changes nothing and needs no lock that a writer has. Errors are those of `connect`."""
    _refuse_what_is_no_file(str(file))
    connection = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True, isolation_level=None)
    try:
        _guard(connection)
        connection.execute("BEGIN")  # one state of the store for all that is read
        wait_for(connection, str(file), "SELECT count(*) FROM sqlite_master")
    except BaseException:
        connection.close()
        raise
    return connection


def _guard(connection: sqlite3.Connection) -> None:
    """Believe nothing that a damaged or foreign file says of itself."""
    connection.execute("PRAGMA trusted_schema=OFF")
    connection.execute("PRAGMA cell_size_check=ON")


def _refuse_what_is_no_file(name: str) -> None:
    """A named pipe, say, would be waited for without end."""
    if name != ":memory:" and Path(name).exists() and not is_file(name):
        raise OutputError(f"{name}: is not a regular file; remove it, or give another folder with -o")


def wait_for(connection: sqlite3.Connection, name: str, statement: str) -> None:
    """Execute a statement that another program's lock may hold up: that is said after a second, and ends after ten.

    Raises
    ------
    OutputError
        The lock stays.
    """
    try:
        for patience in (_SILENT, _LONGEST):
            connection.execute(f"PRAGMA busy_timeout={patience}")
            try:
                connection.execute(statement)
            except sqlite3.OperationalError as error:
                if "locked" not in str(error):
                    raise
            else:
                return
            if patience == _SILENT:
                _log.info("%s: another program has locked it; waiting for ten seconds at most", name)
    finally:
        connection.execute("PRAGMA busy_timeout=0")
    raise OutputError(f"{name}: another program keeps it locked; end that one, then call again")


@contextmanager
def transaction(connection: sqlite3.Connection, name: str) -> Iterator[None]:
    """All statements or none."""
    wait_for(connection, name, "BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise
    connection.execute("COMMIT")


@contextmanager
def in_words(name: str) -> Iterator[None]:
    """Turn what SQLite says about a file into an OutputError."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if "decode" in str(error):
            raise UntrustedStoreError(name, "text that is no UTF-8") from error
        raise OutputError(f"{name}: cannot be used: {error}") from error
    except (sqlite3.Error, UnicodeDecodeError) as error:  # of what SQLite says of damaged text, too
        raise UntrustedStoreError(name, str(error)) from error


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
    """Be the only one that writes into a folder, made if it is not there; the lock ends with the process, however that
    ends.

    Raises
    ------
    OutputError
        It cannot be made; another process has it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror or error}") from None
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
