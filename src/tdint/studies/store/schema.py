"""Tables of a store, and checks of their integrity.

The tables refer to buildings and records by number. The views `runs` and `stories` show their
names, with the columns of the CSV files. Checksums of each chunk and of the campaign definition
detect corruption and manual edits; they are not a signature.
"""

from __future__ import annotations

import hashlib
import logging
import math
import os
import re
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tdint.errors import OutputError
from tdint.files import is_there, reason_of, remove_abandoned
from tdint.output.tables.devices import TABLES as DEVICE_TABLES
from tdint.output.tables.elements import ELEMENT_COLUMNS, ELEMENT_ERROR
from tdint.output.tables.responses import STORY_COLUMNS, STORY_ERROR
from tdint.output.tables.runs import SHOCKS as SHOCK_COLUMNS
from tdint.output.tables.table import TEXT, Column
from tdint.response.pairs import Place
from tdint.response.runs.run_values import HIDDEN, RUN, RUN_WITH_ERROR
from tdint.studies.campaign.chunks import RunRow
from tdint.system import file_system, is_special, lock_failure, open_to_lock
from tdint.system import locked as locked_file
from tdint.units import Quantity

# ---- Connections to the file of a store: permitted locations, waiting for locks, errors of SQLite

SHORT_WAIT, _LONG_WAIT = 1000, 9000
"""Times to wait for a lock of another program, ms: before a message is shown, and after it."""

CLOSE_WAIT = 50
"""Time to wait for a reader when a store is closed, ms: several times the duration of a short
query. If a program reads for a longer time, the log is kept next to the file, without loss of
data."""

_log = logging.getLogger(__name__)


class AnotherStudyError(OutputError):
    """The store in a directory contains the runs of another campaign or study."""


class UntrustedStoreError(OutputError):
    """The file is not a store, or was changed since it was written."""

    def __init__(self, name: str, reason: str) -> None:
        """Create the error. `name` is the path of the file; `reason` describes the problem in the
        message, for example "SQLite reports: ..."."""
        super().__init__(
            f"{name}: the file is not a valid campaign store: {reason}; specify another directory "
            "with -o, or --overwrite to replace it"
        )


def connect(name: str) -> sqlite3.Connection:
    """Return a connection for reading and writing with safe transactions: if the process is killed,
    the file remains valid. Each transaction is written to the file; see also `start_log`.

    `name` is the path of the file.

    Raises
    ------
    OutputError
        The path is not a file, or another program keeps it locked.
    """
    _refuse_special_files(name)
    connection = sqlite3.connect(name, timeout=0.0, isolation_level=None)
    with closed_on_failure(connection):
        _protect(connection)
        wait_for(connection, name, "SELECT count(*) FROM sqlite_master", is_first=True)
        connection.execute("PRAGMA synchronous=FULL")
    return connection


def start_log(connection: sqlite3.Connection, name: str) -> None:
    """Write the following transactions to a write-ahead log, which is faster and lets other
    processes read at the same time; not for network file systems.

    `name` is the path of the file, for messages.

    Raises
    ------
    OutputError
        Another program keeps the file locked.
    """
    wait_for(connection, name, "PRAGMA journal_mode=WAL")
    # After a power failure the last transactions may be missing, but the file is valid.
    connection.execute("PRAGMA synchronous=NORMAL")


def end_log(connection: sqlite3.Connection) -> None:
    """Move the write-ahead log into the file and remove it. Without a log, other programs can also
    read the file on a read-only medium.

    While another program reads the file, or the disk is full, the log is kept next to the file,
    without loss of data. In a transaction, which each connection for reading has, the function has
    no effect.
    """
    # A closed connection also raises an error of SQLite.
    with suppress(sqlite3.Error):
        if not connection.in_transaction:
            connection.execute(f"PRAGMA busy_timeout={CLOSE_WAIT}")
            connection.execute("PRAGMA journal_mode=DELETE")


def connect_to_read(file: Path) -> sqlite3.Connection:
    """Return a read-only connection, which can be opened while another process writes. All queries
    read the state of the store at the time of the call.

    The file may be on a read-only medium or belong to another user. No files of the connection
    remain next to the file.

    Raises
    ------
    OutputError
        The path is not a file, cannot be read, or another program keeps it locked.
    """
    name = str(file)
    _refuse_special_files(name, is_read=True)
    # SQLite also follows links, and keeps the log next to the linked file.
    target = Path(os.path.realpath(file))
    if is_there(target) and not os.access(target, os.R_OK):
        raise OutputError(f"{name}: no permission to read the file")
    # A connection that may write removes the log when it is closed, and completes or reverses the
    # last transaction of a killed process. In other cases the file is copied, also without locks,
    # because `_read_copy` notices changes. The target of a link is only read.
    is_writable = os.access(target, os.W_OK) and os.access(target.parent, os.W_OK)
    if is_writable and not file.is_symlink():
        try:
            return _begin_reading(target, name)
        except (sqlite3.OperationalError, OutputError):
            if not lock_failure(target):
                raise
    return _read_copy(target, name)


def _begin_reading(file: Path, name: str) -> sqlite3.Connection:
    """Open a file, which must exist, and begin a transaction for reading. `name` is the path for
    messages."""
    connection = sqlite3.connect(
        f"{file.as_uri()}?mode=rw", timeout=0.0, uri=True, isolation_level=None
    )
    with closed_on_failure(connection):
        _protect(connection)
        connection.execute("PRAGMA query_only=ON")
        connection.execute("BEGIN")  # all queries read the same state of the store
        wait_for(connection, name, "SELECT count(*) FROM sqlite_master", is_first=True)
    return connection


def _read_copy(file: Path, name: str) -> sqlite3.Connection:
    """Return a connection for reading to a copy of a store in memory.

    The store and its logs are first copied to a temporary directory. There SQLite can complete
    or reverse the last transaction.

    Raises
    ------
    OutputError
        The files cannot be copied, or another process changes them.
    """
    logs = (file.with_name(file.name + end) for end in ("-wal", "-journal"))
    files = [file, *filter(is_there, logs)]

    def states() -> list[tuple[int, int]]:
        """Return the modification time, ns, and the size of each file."""
        return [(status.st_mtime_ns, status.st_size) for status in map(Path.stat, files)]

    with TemporaryDirectory(prefix="tdint-store-") as folder:
        try:
            before = states()
            for path in files:
                shutil.copyfile(path, Path(folder, path.name))
            is_changed = states() != before
        except OSError as error:
            raise OutputError(f"{name}: cannot be read: {error.strerror or error}") from None
        if is_changed:
            raise OutputError(f"{name}: another process is changing the file; try again")
        with closing(_begin_reading(Path(folder, file.name), name)) as copied:
            connection = sqlite3.connect(":memory:", isolation_level=None)
            with closed_on_failure(connection):
                copied.backup(connection)
                _protect(connection)
                connection.execute("PRAGMA query_only=ON")
    return connection


@contextmanager
def closed_on_failure(connection: sqlite3.Connection) -> Iterator[None]:
    """Close a connection if an exception, including an interrupt, occurs in the `with` block. The
    exception is raised again."""
    try:
        yield
    except BaseException:
        connection.close()
        raise


def _protect(connection: sqlite3.Connection) -> None:
    """Set options of a connection that protect this process against corrupt or malicious files."""
    connection.execute("PRAGMA trusted_schema=OFF")  # no SQL functions in views or triggers
    connection.execute("PRAGMA cell_size_check=ON")  # detects corrupt pages earlier


_END_OF_LINKED_JOURNAL = bytes.fromhex("d9d505f920a163d7")
"""Last bytes of a journal that names another journal, for transactions in several files."""


def _refuse_special_files(name: str, *, is_read: bool = False) -> None:
    """Raise OutputError if a path is not a regular file, or has a journal that tdint did not write.

    Opening a named pipe, for example, would block. tdint changes one file in a transaction; from a
    journal of several files, SQLite would delete a file of any name. SQLite would write through
    symbolic links; only a store that is read (`is_read`) may be one.
    """
    if name == ":memory:":
        return
    if is_special(name) or (Path(name).is_symlink() and not is_read):
        raise OutputError(
            f"{name}: this path is not a regular file; remove it, or specify another directory "
            "with -o"
        )
    for suffix in ("-wal", "-shm", "-journal"):
        journal = Path(os.path.realpath(name) + suffix)
        if is_special(journal) or journal.is_symlink():
            raise OutputError(f"{journal}: this path is not a regular file; remove it")
    with suppress(OSError), journal.open("rb") as stream:  # usually there is no journal
        length = len(_END_OF_LINKED_JOURNAL)
        stream.seek(-min(length, journal.stat().st_size), os.SEEK_END)
        if stream.read(length) == _END_OF_LINKED_JOURNAL:
            raise UntrustedStoreError(name, f"{journal.name} was not written by tdint")


def wait_for(
    connection: sqlite3.Connection, name: str, statement: str, *, is_first: bool = False
) -> None:
    """Execute a statement that may have to wait for the lock of another program. A message is shown
    after a second; waiting ends after ten seconds.

    Parameters
    ----------
    is_first : bool
        True for the first statement of a connection, which has no locks. Only then it can be tested
        without losing locks if the file system supports them.

    Raises
    ------
    OutputError
        The lock was not released, or the file system does not support locks.
    """
    try:
        # Wait for a short time without a message, then for longer with a message.
        for timeout in (SHORT_WAIT, _LONG_WAIT):
            connection.execute(f"PRAGMA busy_timeout={timeout}")
            try:
                connection.execute(statement)
            except sqlite3.OperationalError as error:
                if "locked" not in str(error):
                    raise
            else:
                return
            # SQLite reports a missing support of locks as a lock of another process.
            if is_first and (reason := lock_failure(Path(name))):
                raise OutputError(
                    f"{name}: its file system does not support locks ({reason}); use a copy on "
                    "another file system"
                )
            if timeout == SHORT_WAIT:
                _log.info("%s: locked by another program; waiting for at most ten seconds", name)
    finally:
        # Readers also lock a store for a moment, for example when they open the log. Later
        # statements wait without a message.
        connection.execute(f"PRAGMA busy_timeout={_LONG_WAIT}")
    raise OutputError(
        f"{name}: the file is locked by another program; end that program and try again"
    )


@contextmanager
def transaction(connection: sqlite3.Connection, name: str) -> Iterator[None]:
    """Execute the statements of a `with` block as a transaction, which is reversed if an error
    occurs.

    Raises
    ------
    OutputError
        Another program keeps the file locked.
    """
    wait_for(connection, name, "BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise
    connection.execute("COMMIT")


@contextmanager
def sqlite_errors_reported(name: str) -> Iterator[None]:
    """Convert errors of SQLite in a `with` block to OutputError, or to UntrustedStoreError if the
    contents of the file are the reason. `name` is the path of the file, for messages."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if "decode" in str(error):
            raise UntrustedStoreError(name, "it contains text that is not UTF-8") from error
        raise OutputError(f"{name}: cannot use the file: {error}") from error
    # If a message of SQLite quotes corrupt text, Python raises UnicodeDecodeError instead.
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise UntrustedStoreError(name, str(error)) from error


LOCK = ".campaign.lock"
"""Lock file of the process that writes."""

_NETWORK_FILE_SYSTEMS = (
    "nfs4?|cifs|smb3|smbfs|ncpfs|afs|9p|ceph|lustre|gpfs|beegfs|glusterfs|pvfs2|orangefs|"
    r"fuse\.(?:sshfs|glusterfs|ceph|s3fs|juicefs)|webdav|afpfs|network drive"
)
"""Pattern of the types of network file systems as reported by Linux, macOS and Windows."""


def refuse_network(folder: Path) -> None:
    """Raise OutputError if a directory is on a network file system, because SQLite's write-ahead
    log needs memory that all processes share. A file system of unknown type is accepted.

    Raises
    ------
    OutputError
        The directory is on a network file system, or its name is invalid.
    """
    if "\0" in str(folder):
        raise OutputError(f"{folder!s:.40}: a file name must not contain a null character")
    file_system_type = file_system(folder)
    if re.fullmatch(_NETWORK_FILE_SYSTEMS, file_system_type):
        raise OutputError(
            f"{folder}: the directory is on a network file system ({file_system_type}), on "
            "which the store is not safe; write to a local disk (such as /tmp), each shard to a "
            "separate directory, and combine them with `tdint campaign merge`"
        )


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock the directory `folder` in the `with` block, so that no other process of tdint writes to
    it. The directory is created if required, and removed again if no file was written. The lock
    ends with the process.

    Raises
    ------
    OutputError
        The directory cannot be created, or another process has locked it.
    """
    is_new = not is_there(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: cannot create the directory: {reason_of(error, folder)}"
        ) from None
    file = folder / LOCK
    _refuse_special_files(str(file))
    try:
        open_to_lock(file).close()
    except OSError as error:
        raise OutputError(
            f"{folder}: cannot write to the directory: {reason_of(error, file)}"
        ) from None
    if reason := lock_failure(file):
        _remove_unused(folder, is_new)
        raise OutputError(
            f"{folder}: the file system of the directory does not support locks ({reason}), which "
            "prevent that two processes write at the same time; write to another file system"
        )
    with locked_file(file, partial(_refuse_second, folder)):
        if not is_there(file):  # another process has just removed the new directory
            _refuse_second(folder)
        # No other process can write to the locked directory. Unfinished files in the directory are
        # therefore from processes that were killed, and can be removed.
        remove_abandoned(folder)
        try:
            yield
        finally:
            # This is done before the lock is released, because the lock file could belong to
            # another process afterwards.
            _remove_unused(folder, is_new)


def _remove_unused(folder: Path, is_new: bool) -> None:
    """Remove a new directory again if no file was written."""
    with suppress(OSError):
        if is_new and [file.name for file in folder.iterdir()] == [LOCK]:
            (folder / LOCK).unlink()
            folder.rmdir()


def _refuse_second(folder: Path) -> None:
    """Raise the error for a directory that another process has locked."""
    raise OutputError(
        f"{folder}: in use by another tdint process; wait until it ends, or write to another "
        "directory"
    )


# ---- Schema

VERSION = "13"
"""Version of the layout; stores with another version are refused."""

# Columns that identify a run, with the type of their values.
_KEY = {"building": int, "record": int, "scale": float, "sample": int}

PLACE = {"motion": str, "level": float}
"""Columns of the ground motion and the level of a run (`tdint.response.pairs.Place`)."""

_SQL_TYPES = {int: "INTEGER", str: "TEXT NOT NULL"}


def _quoted(columns: Iterable[str]) -> str:
    """Return a list of columns in SQL. Quotes allow the names `from` and `to`."""
    return ", ".join(f'"{column}"' for column in columns)


@dataclass(frozen=True)
class RowTable:
    """Table for the result rows of chunks, and the view of the table for users.

    Attributes
    ----------
    key, others : dict of str to type
        Type of each column by its name: the columns of the primary key, and the remaining columns,
        in the order of the fields of a row (`RunRow`, `PartRow`).
    hidden : tuple of str
        Columns that the view does not show.
    shown, errors : tuple of Column
        Columns of the table of a run, and its additional columns with error estimates; empty for
        the table of runs.
    """

    name: str
    key: dict[str, type]
    others: dict[str, type]
    view: str
    hidden: tuple[str, ...] = ()
    shown: tuple[Column, ...] = ()
    errors: tuple[Column, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns except the number of the chunk, which is the last column."""
        return *self.key, *self.others

    @property
    def create(self) -> str:
        """SQL statement that creates the table."""
        columns = ", ".join(
            f'"{name}" {_SQL_TYPES.get(value_type, "REAL")}'
            for name, value_type in (self.key | self.others).items()
        )
        key = _quoted(self.key)
        return (
            f"CREATE TABLE {self.name}({columns}, chunk INTEGER NOT NULL, PRIMARY KEY({key})) "
            "WITHOUT ROWID"
        )

    @property
    def create_view(self) -> str:
        """SQL statement that creates the view."""
        # The view is for users of SQLite. It shows names instead of numbers: first the building,
        # the record and the method, then the results.
        names = ["b.name AS building", "m.name AS record", "m.component AS component"]
        run_columns = [f"{self.name}.scale", f"{self.name}.sample"]
        if "dt_s" in self.others:
            run_columns += [f'{self.name}."{column}"' for column in PLACE]
        method = ["b.method AS method", f"{self.name}.dt_s"] if "dt_s" in self.others else []
        result_columns = [
            f'{self.name}."{column}"'
            for column in self.columns
            if column not in (*_KEY, *PLACE, "dt_s", *self.hidden)
        ]
        columns = ", ".join([*names, *run_columns, *method, *result_columns])
        return (
            f"CREATE VIEW {self.view} AS SELECT {columns} FROM {self.name} JOIN buildings b ON "
            f"b.id = {self.name}.building JOIN records m ON m.id = {self.name}.record ORDER BY "
            f"{', '.join(f'{self.name}.{column}' for column in self.key)}"
        )

    def select(self, more: str = "", where: str = "") -> str:
        """Return the SQL query of all columns except the number of the chunk, with rows in the
        order of the key.

        Parameters
        ----------
        more : str
            Further columns, with a leading comma, such as `, chunk`; by default none.
        where : str
            WHERE clause; by default all rows are selected.
        """
        return (
            f"SELECT {_quoted(self.columns)}{more} FROM {self.name} {where} ORDER BY "
            f"{_quoted(self.key)}"
        )

    def select_named(self, columns: Iterable[str]) -> str:
        """Return the SQL query of the numbers of building and sample, the names of building, record
        and component, the scale, and `columns`, with rows in the order of the key."""
        cells = (f't."{name}"' if name in self.columns else name for name in columns)
        key = ", ".join(f"t.{name}" for name in self.key)
        return (
            "SELECT t.building, t.sample, b.name, m.name, m.component, t.scale, "
            f"{', '.join(cells)} FROM {self.name} t JOIN buildings b ON b.id = t.building JOIN "
            f"records m ON m.id = t.record ORDER BY {key}"
        )

    def insert(
        self, connection: sqlite3.Connection, rows: Iterable[tuple[Any, ...]], chunk: int
    ) -> None:
        """Insert rows of a chunk.

        Parameters
        ----------
        rows : iterable of tuple
            Rows as returned by `plain`.
        """
        placeholders = ", ".join("?" * (len(self.columns) + 1))
        connection.executemany(
            f"INSERT INTO {self.name} VALUES({placeholders})", ((*row, chunk) for row in rows)
        )

    def plain(self, rows: Iterable[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
        """Convert rows to the form that SQLite returns, so that checksums of written and of stored
        rows are equal. The result is sorted by key.

        Nested tuples, such as the values and errors of a run, become separate columns. Each
        cell is converted to the type of its column; NaN and missing errors become None.

        Returns
        -------
        list of tuple
            Cells of each row in the order of `columns`.
        """
        types = (self.key | self.others).values()
        result = []
        for row in rows:
            cells: list[Any] = []
            for value in row:
                cells += value if isinstance(value, tuple) else (value,)
            cells += [None] * (len(types) - len(cells))  # errors that were not estimated
            # The comparison `cell != cell` is true for NaN only.
            result.append(
                tuple(
                    None if cell is None or cell != cell else cell_type(cell)
                    for cell_type, cell in zip(types, cells, strict=True)
                )
            )
        return sorted(result, key=lambda cells: cells[: len(self.key)])


def _column_types(quantities: Iterable[Quantity], suffix: str = "") -> dict[str, type]:
    """Return the types of columns by name.

    `suffix` is the suffix of the names, such as `_error`. Columns with a suffix contain
    floating-point numbers.
    """
    return {
        quantity.column + suffix: float if suffix else quantity.value_type
        for quantity in quantities
    }


_HIDDEN = tuple(item.column for item in RUN if item.shown == HIDDEN)
RUNS = RowTable(
    "run_rows",
    _KEY,
    PLACE | _column_types(RUN) | _column_types(RUN_WITH_ERROR, "_error"),
    "runs",
    _HIDDEN,
)


def _part_table(
    name: str, view: str, columns: tuple[tuple[Column, ...], ...], *, numbered: bool
) -> RowTable:
    """Return the table of the rows of stories, elements, attachments, links or events of all runs,
    with the columns of the table of a run, and its columns with error estimates.

    `numbered` is True if rows start with a hidden number, which identifies the part; otherwise the
    first column identifies it.
    """
    shown, errors = columns
    types: dict[str, type] = {
        column.name: {TEXT: str}.get(column.unit, int if column.name in _NUMBERS else float)
        for column in (*shown, *errors)
    }
    hidden = ("number",) if numbered else ()
    key = _KEY | dict.fromkeys(hidden or (shown[0].name,), int)
    others = {column: value for column, value in types.items() if column not in key}
    return RowTable(name, key, others, view, hidden, shown, errors)


_NUMBERS = {"story", "floor", "shock", *(item.column for item in RUN if item.value_type is int)}
"""Columns of whole numbers in the tables of parts."""
STORIES = _part_table("story_rows", "stories", (STORY_COLUMNS, STORY_ERROR), numbered=False)
ELEMENTS = _part_table("element_rows", "elements", (ELEMENT_COLUMNS, ELEMENT_ERROR), numbered=True)
ATTACHMENTS, LINKS = (
    _part_table(f"{kind}_rows", f"{kind}s", columns, numbered=True)
    for kind, columns in zip(("attachment", "link"), DEVICE_TABLES, strict=True)
)
SHOCKS = _part_table("shock_rows", "shocks", (SHOCK_COLUMNS, ()), numbered=False)
_PARTS = (STORIES, ELEMENTS, ATTACHMENTS, LINKS, SHOCKS)
PART_TABLES = {f"{table.view}.csv": table for table in _PARTS}
"""Tables of parts by the name of their file."""
ROW_TABLES = (RUNS, STORIES, SHOCKS, ELEMENTS, ATTACHMENTS, LINKS)
"""Tables in the order of the fields of `tdint.studies.campaign.chunks.Rows`."""


TABLES = (
    "CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE buildings(id INTEGER PRIMARY KEY, name TEXT NOT NULL, method TEXT NOT NULL, "
    "stories INTEGER NOT NULL, sha256 TEXT NOT NULL)",
    "CREATE INDEX building_names ON buildings(name)",
    "CREATE TABLE records(id INTEGER PRIMARY KEY, name TEXT NOT NULL, component TEXT NOT NULL, "
    "direction INTEGER NOT NULL, dt_s REAL NOT NULL, samples INTEGER NOT NULL, pga_m_s2 REAL NOT "
    "NULL, pgv_m_s REAL NOT NULL, sha256 TEXT NOT NULL)",
    "CREATE TABLE chunks(id INTEGER PRIMARY KEY, runs INTEGER NOT NULL, stories INTEGER NOT NULL, "
    "seconds REAL NOT NULL, sha256 TEXT NOT NULL)",
    *(table.create for table in ROW_TABLES),
    "CREATE TABLE inventory(building INTEGER PRIMARY KEY, cells TEXT NOT NULL)",
    "CREATE TABLE building_types(building INTEGER PRIMARY KEY, type TEXT NOT NULL, divisor REAL "
    "NOT NULL, period_s REAL NOT NULL)",
    "CREATE TABLE unused(kind TEXT NOT NULL, reason TEXT NOT NULL, PRIMARY KEY(kind, reason))",
    "CREATE TABLE written(file TEXT NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY(file, sha256))",
    *(table.create_view for table in ROW_TABLES),
)
"""SQL statements that create an empty store."""


def run_of(row: Sequence[Any]) -> RunRow:
    """Create a run from a row of the query `RUNS.select`, which contains the key of the run
    (building, motion, scale factor, sample), its place, its values, and their errors."""
    values_start = len(_KEY) + len(PLACE)
    errors_start = values_start + len(RUN)
    values, errors = tuple(row[values_start:errors_start]), tuple(row[errors_start:])
    building, motion, scale, sample, name, level = row[:values_start]
    place = Place(name, math.nan if level is None else level)
    return RunRow(building, motion, scale, sample, place, values, errors)


SEAL = "seal"
"""Key of the checksum of the campaign definition in the table `meta`."""

# Queries of the checksum, which includes their results. Their order must not change.
_SEALED_QUERIES = (
    "SELECT key, value FROM meta WHERE key <> 'seal' ORDER BY key",
    "SELECT * FROM buildings ORDER BY id",
    "SELECT * FROM records ORDER BY id",
    "SELECT * FROM inventory ORDER BY building",
    "SELECT * FROM building_types ORDER BY building",
    "SELECT kind, reason FROM unused ORDER BY rowid",
)


def chunk_digest(number: int, seconds: float, *tables: Iterable[tuple[Any, ...]]) -> str:
    """Return the SHA-256 of a chunk.

    Parameters
    ----------
    *tables : iterable of tuple
        Rows of each table of `ROW_TABLES` in the order of their keys, as SQLite returns them.
    """
    digest = hashlib.sha256(repr((number, seconds)).encode())
    for row in chain(*tables):
        digest.update(repr(row).encode())
    return digest.hexdigest()


def corrupt_chunks(connection: sqlite3.Connection) -> set[int]:
    """Return the numbers of the corrupt chunks of a store. `connection` is an open connection to
    the store, which is only read.

    A chunk is corrupt if its rows do not match the checksum or the number of rows in the table
    `chunks`, or if this table does not contain the chunk.
    """
    query = "SELECT id, runs, stories, seconds, sha256 FROM chunks"
    entries = {number: values for number, *values in connection.execute(query)}
    # Compute the digests of all chunks as `chunk_digest` does, but read each table a single time:
    # each row updates the digest of its chunk.
    digests = {
        number: hashlib.sha256(repr((number, seconds)).encode())
        for number, (_, _, seconds, _) in entries.items()
    }
    row_counts = {number: [0] * len(ROW_TABLES) for number in entries}
    corrupt: set[int] = set()
    for index, table in enumerate(ROW_TABLES):
        for *row, number in connection.execute(table.select(", chunk")):
            if number in digests:
                digests[number].update(repr(tuple(row)).encode())
                row_counts[number][index] += 1
            else:
                corrupt.add(number)
    for number, (runs, stories, _, sha256) in entries.items():
        # The first two tables are the runs and the stories.
        if row_counts[number][:2] != [runs, stories] or digests[number].hexdigest() != sha256:
            corrupt.add(number)
    return corrupt


def seal_of(connection: sqlite3.Connection) -> str:
    """Return the SHA-256 of the definition of a campaign in a store: metadata, buildings, records,
    inventory and unused inputs. If it differs from the stored value, the store was edited."""
    digest = hashlib.sha256()
    for statement in _SEALED_QUERIES:
        digest.update(statement.encode())
        for row in connection.execute(statement):
            digest.update(repr(row).encode())
    return digest.hexdigest()


def check_store(connection: sqlite3.Connection, name: str) -> None:
    """Check that a file is a complete store with the current layout. The rows of the chunks are not
    verified.

    Raises
    ------
    UntrustedStoreError
        The file is corrupt, has another layout, or was edited.
    """
    # Check the file, then its layout, then the campaign definition. Each check is possible only if
    # the preceding check succeeded.
    (verdict,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if verdict != "ok":
        raise UntrustedStoreError(name, f"SQLite reports: {' '.join(verdict.split())}")
    statements = {
        sql
        for (sql,) in connection.execute("SELECT sql FROM sqlite_master WHERE type <> 'trigger'")
    }
    # The version of the layout is in the table `meta`, which the first statement creates.
    if TABLES[0] in statements:
        version = connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone()
        if version is not None and version[0] != VERSION:
            raise UntrustedStoreError(
                name,
                f"its layout has the version {version[0]!r:.20}, but this tdint requires "
                f"{VERSION!r}",
            )
    # tdint does not create triggers. A trigger in a malicious file would be executed when tables
    # are written.
    triggers = connection.execute(
        "SELECT count(*) FROM sqlite_master WHERE type = 'trigger'"
    ).fetchone()[0]
    if triggers or not statements.issuperset(TABLES):
        raise UntrustedStoreError(
            name,
            "tables that a store requires are missing or changed, or the file contains triggers",
        )
    seal = connection.execute("SELECT value FROM meta WHERE key = ?", (SEAL,)).fetchone()
    if seal is None or seal[0] != seal_of(connection):
        raise UntrustedStoreError(name, "the campaign definition does not match its checksum")
