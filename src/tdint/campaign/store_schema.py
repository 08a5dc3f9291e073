"""The tables of a store, and whether they are as they were written.

Numbers stand for buildings and records; the views `runs` and `stories` show their names, under the
columns of the CSV files. Checksums over each chunk and over what the campaign is find damage and
rows changed by hand; they are no signature.
"""

from __future__ import annotations

import hashlib
import logging
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from itertools import accumulate, chain
from pathlib import Path
from typing import Any

from tdint.analysis.run.demands import DEMANDED, HIDDEN, RUN, RUN_WITH_ERROR
from tdint.analysis.run.outcome import STORY
from tdint.campaign.batch import RunRow
from tdint.errors import OutputError
from tdint.files import is_file, is_there, remove_abandoned
from tdint.system import file_system
from tdint.units import Quantity

# ---- Connections to the file of a store: where it may lie, how they wait for others, what SQLite
# says put in words

SILENT, _LONGEST = 1000, 9000
"""Milliseconds that a lock of another program is waited for without a word, and with one."""

_log = logging.getLogger(__name__)


class UntrustedStoreError(OutputError):
    """The file of a store is none, or not as it was written."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(
            f"{name}: cannot be trusted: {why}; is it a store of tdint? Give another folder with "
            "-o, or --overwrite to begin anew"
        )


def connect(name: str, *, log: bool = True) -> sqlite3.Connection:
    """A connection that writes safely: a killed process leaves all that was written whole.

    Parameters
    ----------
    log : bool
        Write fast, a log ahead of the file, and let others read meanwhile; not for network file
        systems. Else the file alone is written, each time to the disk.

    Raises
    ------
    OutputError
        It is no file, or another program keeps it locked.
    """
    _refuse_what_is_no_file(name)
    connection = sqlite3.connect(name, isolation_level=None)
    with closed_on_failure(connection):
        _guard(connection)
        wait_for(connection, name, f"PRAGMA journal_mode={'WAL' if log else 'DELETE'}")
        connection.execute(f"PRAGMA synchronous={'NORMAL' if log else 'FULL'}")
    return connection


def connect_to_read(file: Path) -> sqlite3.Connection:
    """A connection that changes nothing and needs no lock that a writer has. Errors are those of
    `connect`."""
    _refuse_what_is_no_file(str(file))
    connection = sqlite3.connect(
        f"{file.absolute().as_uri()}?mode=ro", uri=True, isolation_level=None
    )
    with closed_on_failure(connection):
        _guard(connection)
        connection.execute("BEGIN")  # one state of the store for all that is read
        wait_for(connection, str(file), "SELECT count(*) FROM sqlite_master")
    return connection


@contextmanager
def closed_on_failure(connection: sqlite3.Connection) -> Iterator[None]:
    """Close a connection if what is within fails."""
    try:
        yield
    except BaseException:
        connection.close()
        raise


def _guard(connection: sqlite3.Connection) -> None:
    """Believe nothing that a damaged or foreign file says of itself."""
    connection.execute("PRAGMA trusted_schema=OFF")
    connection.execute("PRAGMA cell_size_check=ON")


def _refuse_what_is_no_file(name: str) -> None:
    """A named pipe, say, would be waited for without end."""
    if name != ":memory:" and is_there(name) and not is_file(name):
        raise OutputError(
            f"{name}: is not a regular file; remove it, or give another folder with -o"
        )


def wait_for(connection: sqlite3.Connection, name: str, statement: str) -> None:
    """Execute a statement that another program's lock may hold up: that is said after a second, and
    ends after ten.

    Raises
    ------
    OutputError
        The lock stays.
    """
    try:
        # Twice: a short while without a word, then what keeps it is told.
        for patience in (SILENT, _LONGEST):
            connection.execute(f"PRAGMA busy_timeout={patience}")
            try:
                connection.execute(statement)
            except sqlite3.OperationalError as error:
                if "locked" not in str(error):
                    raise
            else:
                return
            if patience == SILENT:
                _log.info(
                    "%s: another program has locked it; waiting for ten seconds at most", name
                )
    finally:
        # Who reads a store holds it for a moment, too, while the log is opened, say: what follows
        # waits without a word.
        connection.execute(f"PRAGMA busy_timeout={_LONGEST}")
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
"""Held by the one that writes; an empty SQLite file, for its locks end with their process on every
system."""

_NETWORK = {
    *(
        "nfs",
        "nfs4",
        "cifs",
        "smb3",
        "smbfs",
        "ncpfs",
        "afs",
        "9p",
        "ceph",
        "lustre",
        "gpfs",
        "beegfs",
        "glusterfs",
    ),
    *(
        "pvfs2",
        "orangefs",
        "fuse.sshfs",
        "fuse.glusterfs",
        "fuse.ceph",
        "fuse.s3fs",
        "fuse.juicefs",
    ),
    *("webdav", "afpfs", "network drive"),
}


def refuse_network(folder: Path) -> None:
    """Refuse a folder on a network file system: SQLite's log needs memory that all processes share.

    Where the system does not tell nothing is refused.

    Raises
    ------
    OutputError
        The folder lies on one, or can be none.
    """
    if "\0" in str(folder):
        raise OutputError(f"{folder!s:.40}: a file name has no null character")
    kind = file_system(folder)
    if kind in _NETWORK:
        raise OutputError(
            f"{folder}: lies on a network file system ({kind}), on which the store is not safe; "
            "write to a disk of this machine (such as /tmp), each shard to its own, and put them "
            "together with `tdint campaign merge`"
        )


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Be the only one that writes into a folder, made if it is not there (and gone again if nothing
    was written); the lock ends with the process, however that ends.

    Raises
    ------
    OutputError
        It cannot be made; another process has it.
    """
    is_new = not is_there(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror or error}") from None
    # A named pipe in its place would be waited for without end.
    if is_there(folder / LOCK) and not is_file(folder / LOCK):
        raise OutputError(f"{folder / LOCK}: is not a regular file; remove it, or write elsewhere")
    try:
        connection = sqlite3.connect(folder / LOCK, timeout=0.0, isolation_level=None)
    except sqlite3.Error as error:
        raise OutputError(f"{folder}: cannot be written: {error}") from None
    with closing(connection):
        try:
            connection.execute("PRAGMA journal_mode=MEMORY")  # nothing lies beside the lock
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            reason = "another tdint is at work on it" if "locked" in str(error) else str(error)
            raise OutputError(f"{folder}: {reason}; wait for its end, or write elsewhere") from None
        except sqlite3.Error as error:
            raise OutputError(
                f"{folder / LOCK}: is no lock of tdint ({error}); remove it, or write elsewhere"
            ) from None
        # Only who has the lock knows that unfinished files belong to nobody.
        remove_abandoned(folder)
        try:
            yield
        finally:
            # While the lock is held: nobody else's goes.
            with suppress(OSError):
                if is_new and [file.name for file in folder.iterdir()] == [LOCK]:
                    (folder / LOCK).unlink()
                    folder.rmdir()


# ---- Schema

VERSION = "9"
"""Of the layout; another one is not read."""

_KEY = {"building": int, "record": int, "scale": float, "sample": int}

_TYPES = {int: "INTEGER", str: "TEXT NOT NULL"}


@dataclass(frozen=True)
class RowTable:
    """A table of the rows that chunks leave.

    Attributes
    ----------
    name : str
        Of the table.
    key, others : dict of str to type
        The columns that tell rows apart, and those behind them, in the order of a row's fields
        (`RunRow`, `StoryRow`, `ShockRow`).
    view, hidden : str, tuple of str
        The name of its view, and what that does not show.
    """

    name: str
    key: dict[str, type]
    others: dict[str, type]
    view: str
    hidden: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """All of them, but for the number of the chunk, which stands last."""
        return *self.key, *self.others

    @property
    def create(self) -> str:
        """What makes it."""
        columns = ", ".join(
            f"{name} {_TYPES.get(kind, 'REAL')}" for name, kind in (self.key | self.others).items()
        )
        key = ", ".join(self.key)
        return (
            f"CREATE TABLE {self.name}({columns}, chunk INTEGER NOT NULL, PRIMARY KEY({key})) "
            "WITHOUT ROWID"
        )

    @property
    def create_view(self) -> str:
        """What makes its view."""
        # For people who look with SQLite: names in place of numbers, first who and how, then
        # results.
        shown = [column for column in self.columns if column not in (*_KEY, "dt_s", *self.hidden)]
        method = ["b.method AS method", f"{self.name}.dt_s"] if "dt_s" in self.others else []
        named = ["b.name AS building", "m.name AS record", "m.component AS component"]
        scale, sample, *others = (f"{self.name}.{column}" for column in ("scale", "sample", *shown))
        columns = ", ".join([*named, scale, sample, *method, *others])
        return (
            f"CREATE VIEW {self.view} AS SELECT {columns} FROM {self.name} JOIN buildings b ON "
            f"b.id = {self.name}.building JOIN records m ON m.id = {self.name}.record ORDER BY "
            f"{', '.join(f'{self.name}.{column}' for column in self.key)}"
        )

    def select(self, more: str = "", where: str = "") -> str:
        """What reads its columns, and more, in the order of the key."""
        return (
            f"SELECT {', '.join(self.columns)}{more} FROM {self.name} {where} ORDER BY "
            f"{', '.join(self.key)}"
        )

    def insert(
        self, connection: sqlite3.Connection, rows: Iterable[tuple[Any, ...]], chunk: int
    ) -> None:
        """Write plain rows of a chunk."""
        marks = ", ".join("?" * (len(self.columns) + 1))
        connection.executemany(
            f"INSERT INTO {self.name} VALUES({marks})", ((*row, chunk) for row in rows)
        )

    def plain(self, rows: Iterable[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
        """Rows as SQLite gives them back, in the order of the key: nan is nothing there, a column
        has one type, and values without errors are followed by nothing."""
        kinds = (self.key | self.others).values()
        result = []
        for row in rows:
            cells = [
                cell for value in row for cell in (value if isinstance(value, tuple) else (value,))
            ]
            cells += [None] * (len(kinds) - len(cells))
            typed = zip(kinds, cells, strict=True)
            result.append(
                tuple(None if cell is None or cell != cell else kind(cell) for kind, cell in typed)
            )
        return sorted(result, key=lambda row: row[: len(self.key)])


def _kinds(quantities: Iterable[Quantity], behind: str = "") -> dict[str, type]:
    """Columns of some quantities, or of numbers that are told beside them, with `behind` behind the
    names."""
    return {quantity.column + behind: float if behind else quantity.kind for quantity in quantities}


_HIDDEN = tuple(one.column for one in RUN if one.shown == HIDDEN)
RUNS = RowTable("run_rows", _KEY, _kinds(RUN) | _kinds(RUN_WITH_ERROR, "_error"), "runs", _HIDDEN)
_OF_STORY = {"height_m": float} | _kinds(STORY) | _kinds(STORY, "_error")
STORIES = RowTable("story_rows", _KEY | {"story": int}, _OF_STORY, "stories")
_OF_SHOCK = {"start_s": float, "pga_m_s2": float} | _kinds(DEMANDED)
SHOCKS = RowTable("shock_rows", _KEY | {"shock": int}, _OF_SHOCK, "shocks")
ROW_TABLES = (RUNS, STORIES, SHOCKS)
"""In the order of the fields of `tdint.campaign.batch.Rows`."""


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
    *(one.create for one in ROW_TABLES),
    "CREATE TABLE inventory(building INTEGER PRIMARY KEY, cells TEXT NOT NULL)",
    "CREATE TABLE building_types(building INTEGER PRIMARY KEY, type TEXT NOT NULL, divisor REAL "
    "NOT NULL, period_s REAL NOT NULL)",
    "CREATE TABLE unused(kind TEXT NOT NULL, reason TEXT NOT NULL, PRIMARY KEY(kind, reason))",
    "CREATE TABLE written(file TEXT NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY(file, sha256))",
    *(one.create_view for one in ROW_TABLES),
)
"""What makes an empty store."""


def run_of(row: Sequence[Any]) -> RunRow:
    """The run whose plain values these are."""
    key, values = accumulate(map(len, (_KEY, RUN)))
    return RunRow(*row[:key], *map(tuple, (row[key:values], row[values:])))


SEAL = "seal"
"""Key of the checksum over what the campaign is, in the table meta."""

_SEALED = (
    "SELECT key, value FROM meta WHERE key <> 'seal' ORDER BY key",
    "SELECT * FROM buildings ORDER BY id",
    "SELECT * FROM records ORDER BY id",
    "SELECT * FROM inventory ORDER BY building",
    "SELECT * FROM building_types ORDER BY building",
    "SELECT kind, reason FROM unused ORDER BY rowid",
)


def chunk_digest(number: int, seconds: float, *tables: Iterable[tuple[Any, ...]]) -> str:
    """SHA-256 over a chunk, from its runs, stories and shocks in the order of their keys, as SQLite
    gives them back."""
    whole = hashlib.sha256(repr((number, seconds)).encode())
    for row in chain(*tables):
        whole.update(repr(row).encode())
    return whole.hexdigest()


def damaged_chunks(connection: sqlite3.Connection) -> set[int]:
    """The numbers of the chunks whose rows, or whose counts of them, are not as they were written;
    of rows that belong to no chunk, too."""
    stated = {
        number: rest
        for number, *rest in connection.execute(
            "SELECT id, runs, stories, seconds, sha256 FROM chunks"
        )
    }
    # All tables are read once, and each row goes into the digest of its chunk.
    digests = {
        number: hashlib.sha256(repr((number, rest[2])).encode()) for number, rest in stated.items()
    }
    counts = {number: [0, 0, 0] for number in stated}
    lost: set[int] = set()
    for kind, table in enumerate(ROW_TABLES):
        for *row, number in connection.execute(table.select(", chunk")):
            if number in digests:
                digests[number].update(repr(tuple(row)).encode())
                counts[number][kind] += 1
            else:
                lost.add(number)
    return lost | {
        number
        for number, (runs, stories, _, sha256) in stated.items()
        if counts[number][:2] != [runs, stories] or digests[number].hexdigest() != sha256
    }


def seal_of(connection: sqlite3.Connection) -> str:
    """SHA-256 over what the campaign is and which inputs could not be used."""
    whole = hashlib.sha256()
    for statement in _SEALED:
        whole.update(statement.encode())
        for row in connection.execute(statement):
            whole.update(repr(row).encode())
    return whole.hexdigest()


def check_store(connection: sqlite3.Connection, name: str) -> None:
    """Make sure that a file is a whole store of this layout; its chunks are another question
    (`damaged_chunks`).

    Raises
    ------
    UntrustedStoreError
        It is not.
    """
    # The file first, then its layout, then what it says of its campaign: each makes sense only
    # after the one before.
    (verdict,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if verdict != "ok":
        raise UntrustedStoreError(name, f"SQLite says: {' '.join(verdict.split())}")
    stated = {
        sql
        for (sql,) in connection.execute("SELECT sql FROM sqlite_master WHERE type <> 'trigger'")
    }
    if TABLES[0] in stated:
        version = connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone()
        if version is not None and version[0] != VERSION:
            raise UntrustedStoreError(
                name, f"its layout is {version[0]!r:.20}, that of this tdint is {VERSION!r}"
            )
    # A trigger would run when tables are written: a store has none.
    triggers = connection.execute(
        "SELECT count(*) FROM sqlite_master WHERE type = 'trigger'"
    ).fetchone()[0]
    if triggers or not stated.issuperset(TABLES):
        raise UntrustedStoreError(name, "its tables are not those of a campaign")
    seal = connection.execute("SELECT value FROM meta WHERE key = ?", (SEAL,)).fetchone()
    if seal is None or seal[0] != seal_of(connection):
        raise UntrustedStoreError(name, "what it says of its campaign does not fit the checksum")
