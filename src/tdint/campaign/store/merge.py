"""Shards of a campaign put together in one store."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tdint.campaign.store.connection import connect, in_words, transaction
from tdint.campaign.store.identity import all_differences
from tdint.campaign.store.schema import ROW_TABLES, TABLES, check_store, damaged_chunks
from tdint.campaign.store.store import FILE, Store, is_empty, open_existing
from tdint.errors import UsageError

_TABLES = ("buildings", "records", "inventory", "building_types")
_ROWS = {**{one.name: -1 for one in ROW_TABLES}, "chunks": 0}
"""Tables, and where in their rows the number of the chunk stands."""

_log = logging.getLogger(__name__)


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
            if is_empty(store):
                with transaction(store.connection, name):
                    for statement in TABLES:
                        store.connection.execute(statement)
                    for table in ("meta", *_TABLES):
                        _copy(sources[0], store, table)
                    store.seal()
            check_store(store.connection, name)
        _check_same(store, sources[0])
        _tell(store, store.heal())
        for source in sources:
            with in_words(source.name):
                bad = damaged_chunks(source.connection)
            _tell(source, len(bad))
            with in_words(name):
                _take_chunks(source, store, bad)
        failed.pop_all()  # whoever asked closes it
    return store


def _check_same(one: Store, other: Store) -> None:
    if one.meta("fingerprint") == other.meta("fingerprint") and one.meta("chunks") == other.meta("chunks"):
        return
    parts = [(side.settings(), side.digests("buildings"), side.digests("records")) for side in (one, other)]
    lines = all_differences(*parts, known=one.name, given=other.name)
    raise UsageError(f"{one.name} and {other.name} are of different campaigns\n{lines}")


def _tell(store: Store, damaged: int) -> None:
    if damaged:
        _log.warning("%s: %d chunks of runs are not as they were written and are left out", store.name, damaged)


def _copy(source: Store, target: Store, table: str, wanted: Callable[[Any], bool] = lambda row: True) -> None:
    rows = source.connection.execute(f"SELECT * FROM {table}")
    marks = ", ".join("?" * len(rows.description))
    target.connection.executemany(f"INSERT OR IGNORE INTO {table} VALUES({marks})", filter(wanted, rows))


def _take_chunks(source: Store, target: Store, bad: set[int]) -> None:
    """Take the chunks that a source has alone: of one that both have, the rows are not mixed."""
    new = source.done() - bad - target.done()
    with transaction(target.connection, target.name):
        for table, place in _ROWS.items():
            _copy(source, target, table, lambda row, place=place: row[place] in new)  # type: ignore[misc]
        target.add_unused((kind, reason) for kind, reasons in source.unused().items() for reason in reasons)
        target.seal()
