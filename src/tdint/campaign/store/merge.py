"""Shards of a campaign put together in one store."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from tdint.campaign.store.schema import TABLES, UNUSED
from tdint.campaign.store.store import FILE, Store, connect, differences, in_words, open_existing, transaction
from tdint.errors import UsageError

_TABLES = ("buildings", "records")
_ROWS = ("run_rows", "story_rows", "chunks")


def merge(folders: Sequence[Path], target: Path) -> Store:
    """Put the stores of several folders, which are all of one campaign, into the one in `target`; what several have is
    taken once.

    Raises
    ------
    UsageError
        A folder holds no campaign, or they hold different ones: what differs, one line each.
    OutputError
        The store cannot be written.
    """
    with ExitStack() as opened:
        sources = []
        for folder in folders:
            sources.append(open_existing(folder))
            opened.callback(sources[-1].connection.close)
        for source in sources[1:]:
            _check_same(sources[0], source)
        name = str(target / FILE)
        with in_words(name):
            store = Store(connect(name), name)
        failed = opened.enter_context(ExitStack())
        failed.callback(store.connection.close)
        with in_words(name):
            if not store.connection.execute("SELECT count(*) FROM sqlite_master WHERE name = 'meta'").fetchone()[0]:
                with transaction(store.connection):
                    for statement in TABLES:
                        store.connection.execute(statement)
                    _copy(sources[0], store, ("meta", *_TABLES))
        _check_same(store, sources[0])
        for source in sources:
            with in_words(name):
                _take_chunks(source, store)
                _take_unused(source, store)
        failed.pop_all()  # whoever asked closes it
    return store


def _check_same(one: Store, other: Store) -> None:
    if one.meta("fingerprint") == other.meta("fingerprint") and one.meta("chunks") == other.meta("chunks"):
        return
    sides = {"known": one.name, "given": other.name}
    found = [
        *differences(one.settings(), other.settings(), kind="setting", **sides),
        *differences(one.digests("buildings"), other.digests("buildings"), kind="building", **sides),
        *differences(one.digests("records"), other.digests("records"), kind="record", **sides),
    ] or ["the order of buildings or records: differs"]
    lines = "\n".join(found)
    raise UsageError(f"{one.name} and {other.name} are of different campaigns\n{lines}")


def _copy(source: Store, target: Store, tables: Sequence[str]) -> None:
    for table in tables:
        rows = source.connection.execute(f"SELECT * FROM {table}")
        marks = ", ".join("?" * len(rows.description))
        target.connection.executemany(f"INSERT OR IGNORE INTO {table} VALUES({marks})", rows)


def _take_chunks(source: Store, target: Store) -> None:
    with transaction(target.connection):
        _copy(source, target, _ROWS)


def _take_unused(source: Store, target: Store) -> None:
    rows = [(kind, reason) for kind, reasons in source.unused().items() for reason in reasons]
    with transaction(target.connection):
        target.connection.execute(UNUSED)
        target.connection.executemany("INSERT OR IGNORE INTO unused VALUES(?, ?)", rows)
