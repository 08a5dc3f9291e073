"""The tables of a store, and whether they are as they were written.

Numbers stand for buildings and records; the views `runs` and `stories` show their names, under the columns of the CSV
files. Checksums over each chunk and over what the campaign is find damage and rows changed by hand; they are no
signature.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from tdint.analysis.run.outcome import STORY
from tdint.campaign.engine.runs import DEMANDED, HIDDEN, RUN, RUN_WITH_ERROR, RunRow
from tdint.campaign.store.connection import UntrustedStoreError
from tdint.quantity import Quantity

VERSION = "6"
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
        The columns that tell rows apart, and those behind them, in the order of a row's fields (`RunRow`, `StoryRow`,
        `ShockRow`).
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
        columns = ", ".join(f"{name} {_TYPES.get(kind, 'REAL')}" for name, kind in (self.key | self.others).items())
        key = ", ".join(self.key)
        return f"CREATE TABLE {self.name}({columns}, chunk INTEGER NOT NULL, PRIMARY KEY({key})) WITHOUT ROWID"

    @property
    def create_view(self) -> str:
        """What makes its view."""
        shown = [one for one in self.columns if one not in (*_KEY, "dt_s", *self.hidden)]
        method = ["b.method AS method", f"{self.name}.dt_s"] if "dt_s" in self.others else []
        named = ["b.name AS building", "m.name AS record", "m.component AS component"]
        own = [f"{self.name}.{one}" for one in ("scale", "sample")] + method + [f"{self.name}.{one}" for one in shown]
        return (
            f"CREATE VIEW {self.view} AS SELECT {', '.join(named + own)} FROM {self.name} "
            f"JOIN buildings b ON b.id = {self.name}.building JOIN records m ON m.id = {self.name}.record "
            f"ORDER BY {', '.join(f'{self.name}.{one}' for one in self.key)}"
        )

    def select(self, more: str = "", where: str = "") -> str:
        """What reads its columns, and more, in the order of the key."""
        return f"SELECT {', '.join(self.columns)}{more} FROM {self.name} {where} ORDER BY {', '.join(self.key)}"

    def insert(self, connection: sqlite3.Connection, rows: Iterable[tuple[Any, ...]], chunk: int) -> None:
        """Write plain rows of a chunk."""
        marks = ", ".join("?" * (len(self.columns) + 1))
        connection.executemany(f"INSERT INTO {self.name} VALUES({marks})", ((*row, chunk) for row in rows))

    def plain(self, rows: Iterable[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
        """Rows as SQLite gives them back, in the order of the key: nan is nothing there, a column has one type, and
        values without errors are followed by nothing."""
        kinds = (self.key | self.others).values()
        found = []
        for row in rows:
            cells = [cell for one in row for cell in (one if isinstance(one, tuple) else (one,))]
            cells += [None] * (len(kinds) - len(cells))
            typed = zip(kinds, cells, strict=True)
            found.append(tuple(None if cell is None or cell != cell else kind(cell) for kind, cell in typed))
        return sorted(found, key=lambda row: row[: len(self.key)])


def _kinds(quantities: Iterable[Quantity], name: str) -> dict[str, type]:
    """Columns of what is told beside some quantities."""
    return {name.format(one.column): float for one in quantities}


_OF_RUN = {one.column: one.kind for one in RUN}
RUNS = RowTable(
    "run_rows",
    _KEY,
    _OF_RUN | _kinds(RUN_WITH_ERROR, "{}_error") | _kinds(RUN_WITH_ERROR, "corrected_{}"),
    "runs",
    tuple(one.column for one in RUN if one.shown == HIDDEN),
)
STORIES = RowTable(
    "story_rows",
    _KEY | {"story": int},
    {"height_m": float}
    | {one.column: one.kind for one in STORY}
    | _kinds(STORY, "{}_error")
    | _kinds(STORY, "corrected_{}"),
    "stories",
)
SHOCKS = RowTable(
    "shock_rows",
    _KEY | {"shock": int},
    {"start_s": float, "pga_m_s2": float} | {one.column: one.kind for one in DEMANDED},
    "shocks",
)
ROW_TABLES = (RUNS, STORIES, SHOCKS)
"""In the order of the fields of `tdint.campaign.engine.runs.Rows`."""


TABLES = (
    "CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE buildings(id INTEGER PRIMARY KEY, name TEXT NOT NULL, method TEXT NOT NULL, stories INTEGER NOT NULL,"
    " sha256 TEXT NOT NULL)",
    "CREATE INDEX building_names ON buildings(name)",
    "CREATE TABLE records(id INTEGER PRIMARY KEY, name TEXT NOT NULL, component TEXT NOT NULL, direction INTEGER NOT"
    " NULL, dt_s REAL NOT NULL, samples INTEGER NOT NULL, pga_m_s2 REAL NOT NULL, pgv_m_s REAL NOT NULL, sha256 TEXT"
    " NOT NULL)",
    "CREATE TABLE chunks(id INTEGER PRIMARY KEY, runs INTEGER NOT NULL, stories INTEGER NOT NULL, seconds REAL NOT"
    " NULL, sha256 TEXT NOT NULL)",
    *(one.create for one in ROW_TABLES),
    "CREATE TABLE inventory(building INTEGER PRIMARY KEY, cells TEXT NOT NULL)",
    "CREATE TABLE building_types(building INTEGER PRIMARY KEY, type TEXT NOT NULL, divisor REAL NOT NULL, period_s REAL"
    " NOT NULL)",
    "CREATE TABLE unused(kind TEXT NOT NULL, reason TEXT NOT NULL, PRIMARY KEY(kind, reason))",
    "CREATE TABLE written(file TEXT NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY(file, sha256))",
    *(one.create_view for one in ROW_TABLES),
)
"""What makes an empty store."""


def run_of(row: Sequence[Any]) -> RunRow:
    """The run whose plain values these are."""
    own, told = len(_KEY) + len(_OF_RUN), len(RUN_WITH_ERROR)
    return RunRow(*row[:own])._replace(errors=tuple(row[own : own + told]), corrected=tuple(row[own + told :]))


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
    """SHA-256 over a chunk, from its runs, stories and shocks in the order of their keys, as SQLite gives them back."""
    whole = hashlib.sha256(repr((number, seconds)).encode())
    for row in chain(*tables):
        whole.update(repr(row).encode())
    return whole.hexdigest()


def damaged_chunks(connection: sqlite3.Connection) -> set[int]:
    """The numbers of the chunks whose rows, or whose counts of them, are not as they were written; of rows that belong
    to no chunk, too."""
    stated = {
        number: rest for number, *rest in connection.execute("SELECT id, runs, stories, seconds, sha256 FROM chunks")
    }
    digests = {number: hashlib.sha256(repr((number, rest[2])).encode()) for number, rest in stated.items()}
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
    """Make sure that a file is a whole store of this layout; its chunks are another question (`damaged_chunks`).

    Raises
    ------
    UntrustedStoreError
        It is not.
    """
    (found,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        raise UntrustedStoreError(name, f"SQLite says: {' '.join(found.split())}")
    stated = {sql for (sql,) in connection.execute("SELECT sql FROM sqlite_master WHERE type <> 'trigger'")}
    if TABLES[0] in stated:
        version = connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone()
        if version is not None and version[0] != VERSION:
            raise UntrustedStoreError(name, f"its layout is {version[0]!r:.20}, that of this tdint is {VERSION!r}")
    triggers = connection.execute("SELECT count(*) FROM sqlite_master WHERE type = 'trigger'").fetchone()[0]
    if triggers or not stated.issuperset(TABLES):
        raise UntrustedStoreError(name, "its tables are not those of a campaign")
    seal = connection.execute("SELECT value FROM meta WHERE key = ?", (SEAL,)).fetchone()
    if seal is None or seal[0] != seal_of(connection):
        raise UntrustedStoreError(name, "what it says of its campaign does not fit the checksum")
