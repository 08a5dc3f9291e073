"""Whether a store is as it was written: checksums over each chunk and over what the campaign is.

They find damage and rows changed by hand; they are no signature.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterable
from itertools import chain
from typing import Any

from tdint.campaign.store.connection import UntrustedStoreError
from tdint.campaign.store.schema import RUN_COLUMNS, SHOCK_COLUMNS, STORY_COLUMNS, TABLES, VERSION

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
    for kind, (table, columns, key) in enumerate(
        (
            ("run_rows", RUN_COLUMNS, "1, 2, 3, 4"),
            ("story_rows", STORY_COLUMNS, "1, 2, 3, 4, 5"),
            ("shock_rows", SHOCK_COLUMNS, "1, 2, 3, 4, 5"),
        )
    ):
        for *row, number in connection.execute(f"SELECT {', '.join(columns)}, chunk FROM {table} ORDER BY {key}"):
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
