"""The store of a campaign: one SQLite file, written by one process, a chunk at a time."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from tdint.campaign.engine.chunk import Done
from tdint.campaign.plan import Plan
from tdint.campaign.store.checksums import SEAL, check_store, chunk_digest, damaged_chunks, seal_of
from tdint.campaign.store.connection import UntrustedStoreError, connect, connect_to_read, in_words, transaction
from tdint.campaign.store.schema import (
    INSERT_RUN,
    INSERT_STORY,
    RUN_COLUMNS,
    STORY_COLUMNS,
    TABLES,
    VERSION,
    plain_run,
    plain_story,
)
from tdint.errors import OutputError, UsageError
from tdint.ground_motion.measures import measure
from tdint.output_units import SI, OutputUnits, parse_output_units
from tdint.version import __version__

FILE = "campaign.sqlite"

_SETTING = "setting "
_MOST_DIFFERENCES = 8


class Store:
    """An open store.

    Attributes
    ----------
    connection : sqlite3.Connection
        For who reads what is not read here.
    name : str
        The file, for messages.
    """

    def __init__(self, connection: sqlite3.Connection, name: str) -> None:
        self.connection = connection
        self.name = name

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        """Bring all into the one file, unless something failed, and close it."""
        try:
            if error is None:
                with in_words(self.name), suppress(sqlite3.OperationalError):  # another program may read it
                    self.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        finally:
            self.connection.close()

    def meta(self, key: str) -> str:
        """A value of the table meta."""
        return str(self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()[0])

    def settings(self) -> dict[str, str]:
        """What is the same for all runs."""
        rows = self.connection.execute("SELECT key, value FROM meta WHERE key LIKE 'setting %' ORDER BY key")
        return {key.removeprefix(_SETTING): value for key, value in rows}

    def digests(self, table: str) -> dict[str, str]:
        """SHA-256 of the buildings or the records by their names."""
        name = "name" if table == "buildings" else "name || ' ' || component"
        return dict(self.connection.execute(f"SELECT {name}, sha256 FROM {table} ORDER BY id"))

    def done(self) -> set[int]:
        """The chunks that are done."""
        return {number for (number,) in self.connection.execute("SELECT id FROM chunks")}

    def seconds(self) -> float:
        """The processor time of the chunks that are done, s."""
        return float(self.connection.execute("SELECT total(seconds) FROM chunks").fetchone()[0])

    def statuses(self) -> dict[str, int]:
        """How many runs ended how."""
        rows = self.connection.execute("SELECT status, count(*) FROM run_rows GROUP BY status ORDER BY status")
        return dict(rows)

    def count(self, condition: str) -> int:
        """How many runs meet a condition on the columns of run_rows."""
        return int(self.connection.execute(f"SELECT count(*) FROM run_rows WHERE {condition}").fetchone()[0])

    def add(self, done: Done) -> None:
        """Write the rows of a chunk and that it is done: both or neither.

        Raises
        ------
        OutputError
            The disk is full, the file is damaged, somebody else writes.
        """
        runs = sorted(map(plain_run, done.rows.runs), key=lambda row: row[:4])
        stories = sorted((plain_story((*row[:-1], *row.values)) for row in done.rows.stories), key=lambda row: row[:5])
        number, seconds = done.number, float(done.seconds)
        with in_words(self.name), transaction(self.connection, self.name):
            self.connection.executemany(INSERT_RUN, ((*row, number) for row in runs))
            self.connection.executemany(INSERT_STORY, ((*row, number) for row in stories))
            values = (number, len(runs), len(stories), seconds, chunk_digest(number, seconds, runs, stories))
            self.connection.execute("INSERT INTO chunks VALUES(?, ?, ?, ?, ?)", values)

    def heal(self, plan: Plan | None = None) -> int:
        """Take out the chunks that are not as they were written, or not of this plan: they are left to be done.

        Returns
        -------
        int
            How many.

        Raises
        ------
        UntrustedStoreError
            They cannot be taken out.
        """
        with in_words(self.name):
            bad = damaged_chunks(self.connection)
            if plan is not None:
                chunks = self.connection.execute("SELECT id, runs FROM chunks")
                bad |= {one for one, runs in chunks if not (0 <= one < plan.chunks and plan.size(one) == runs)}
            if not bad:
                return 0
            with transaction(self.connection, self.name):
                for table, column in (("run_rows", "chunk"), ("story_rows", "chunk"), ("chunks", "id")):
                    self.connection.executemany(f"DELETE FROM {table} WHERE {column} IS ?", ((one,) for one in bad))
            if damaged_chunks(self.connection):
                raise UntrustedStoreError(self.name, "chunks that are not as they were written cannot be taken out")
            return len(bad)

    def written(self) -> set[tuple[str, str]]:
        """Name and SHA-256 of the files that were made of this store."""
        return set(self.connection.execute("SELECT file, sha256 FROM written"))

    def will_write(self, files: Mapping[str, str]) -> None:
        """Keep the names and SHA-256 of files that are about to take their places."""
        new = set(files.items()) - self.written()
        if new:
            with in_words(self.name), transaction(self.connection, self.name):
                self.connection.executemany("INSERT INTO written VALUES(?, ?)", sorted(new))

    def unused(self) -> dict[str, list[str]]:
        """Why records and buildings could not be used, a line for each, by `record` and `building`."""
        found: dict[str, list[str]] = {"record": [], "building": []}
        for kind, reason in self.connection.execute("SELECT kind, reason FROM unused ORDER BY rowid"):
            found.setdefault(kind, []).append(reason)
        return found

    def output_units(self) -> OutputUnits:
        """The units in which the models want their results."""
        found = self.connection.execute("SELECT value FROM meta WHERE key = 'output_units'").fetchone()
        return parse_output_units(found[0]) if found else SI

    def tell(self, plan: Plan) -> None:
        """Keep what a plan says of itself beside what its runs depend on: inputs that could not be used, units."""
        units = str(plan.buildings.output_units)
        known = self.connection.execute("SELECT value FROM meta WHERE key = 'output_units'").fetchone()
        before = [(kind, reason) for kind, reasons in self.unused().items() for reason in reasons]
        if known == (units,) and sorted(before) == sorted(dict.fromkeys(plan.unused)):
            return
        with in_words(self.name), transaction(self.connection, self.name):
            self.connection.execute("DELETE FROM unused")
            self.add_unused(plan.unused)
            self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", ("output_units", units))
            self.seal()

    def add_unused(self, found: Iterable[tuple[str, str]]) -> None:
        """Add inputs that could not be used; `seal` follows."""
        self.connection.executemany("INSERT OR IGNORE INTO unused VALUES(?, ?)", found)

    def seal(self) -> None:
        """Keep the checksum over what the campaign is, in the transaction that changes it."""
        values = (SEAL, seal_of(self.connection))
        self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)

    def runs(self) -> Iterator[tuple[Any, ...]]:
        """All runs: the columns of `RUN_COLUMNS`, in the order of their key."""
        yield from self.connection.execute(f"SELECT {', '.join(RUN_COLUMNS)} FROM run_rows ORDER BY 1, 2, 3, 4")

    def stories(self) -> Iterator[tuple[Any, ...]]:
        """The stories of all runs: the columns of `STORY_COLUMNS`, in the order of their key."""
        columns = ", ".join(STORY_COLUMNS)
        yield from self.connection.execute(f"SELECT {columns} FROM story_rows ORDER BY 1, 2, 3, 4, 5")

    def buildings(self) -> Mapping[int, tuple[str, str]]:
        """Name and method of each building by its number."""
        rows = self.connection.execute("SELECT id, name, method FROM buildings")
        return {number: (name, method) for number, name, method in rows}

    def records(self) -> Mapping[int, tuple[str, str, int]]:
        """Name, component and direction of each motion by its number."""
        rows = self.connection.execute("SELECT id, name, component, direction FROM records")
        return {number: (name, component, direction) for number, name, component, direction in rows}


def open_store(folder: Path | None, plan: Plan) -> tuple[Store, list[str]]:
    """The store of a campaign in a folder, made where there is none; in memory without a folder.

    Returns
    -------
    Store, list of str
        The store, and what to say of it.

    Raises
    ------
    UsageError
        The folder holds another campaign: what differs, one line each.
    OutputError
        It cannot be written.
    """
    name = ":memory:" if folder is None else str(folder / FILE)
    with in_words(name):
        store = Store(connect(name), name)
    try:
        with in_words(name):
            if is_empty(store):
                _create(store, plan)
                store.tell(plan)
                return store, []
            check_store(store.connection, name)
        remarks = check_same(store, plan)
        if healed := store.heal(plan):
            remarks.append(f"{name}: {healed} chunks of runs are not as they were written; they are done again")
        store.tell(plan)
        return store, remarks
    except BaseException:
        store.connection.close()
        raise


def open_existing(folder: Path, *, write: bool = False) -> Store:
    """The store in a folder, to be read; chunks in it may be damaged (`check_chunks`).

    Parameters
    ----------
    write : bool
        Whether it can be written, too.

    Raises
    ------
    UsageError
        There is none.
    OutputError
        It cannot be used, or not be trusted.
    """
    file = folder / FILE
    if not file.exists():
        raise UsageError(f"{folder}: holds no campaign ({FILE}); give the folder of -o of `tdint campaign`")
    with in_words(str(file)):
        store = Store(connect(str(file)) if write else connect_to_read(file), str(file))
    try:
        with in_words(store.name):
            if is_empty(store):
                raise UsageError(f"{folder}: the campaign in it has not begun; call `tdint campaign` again")
            check_store(store.connection, store.name)
    except BaseException:
        store.connection.close()
        raise
    return store


def check_chunks(store: Store) -> None:
    """Raise OutputError if runs of a store are not as they were written."""
    with in_words(store.name):
        bad = damaged_chunks(store.connection)
    if bad:
        raise OutputError(
            f"{store.name}: {len(bad)} chunks of runs are not as they were written; call `tdint campaign FILE -o "
            f"{Path(store.name).parent}` again, which does them anew"
        )


def check_same(store: Store, plan: Plan) -> list[str]:
    """Whether a store holds this campaign.

    Returns
    -------
    list of str
        What to say of it.

    Raises
    ------
    UsageError
        It holds another one: what differs, one line each.
    """
    settings, buildings, records = settings_of(plan), _building_digests(plan), _record_digests(plan)
    if fingerprint(settings, buildings.values(), records.values()) != store.meta("fingerprint"):
        found = [
            *differences(store.settings(), settings, kind="setting"),
            *differences(store.digests("buildings"), buildings, kind="building"),
            *differences(store.digests("records"), records, kind="record"),
        ] or ["the order of buildings or records: differs"]
        lines = "\n".join(found)
        raise UsageError(f"{store.name}: holds another campaign; give another folder with -o\n{lines}")
    version = store.meta("version")
    return [] if version == __version__ else [f"{store.name}: begun with tdint {version}, this is {__version__}"]


def settings_of(plan: Plan) -> dict[str, str]:
    """What is the same for all runs, by its name."""
    parts = asdict(plan.settings) | plan.levels.description() | plan.assignment.description()
    return {name: json.dumps(value, sort_keys=True) for name, value in sorted(parts.items())}


def fingerprint(settings: dict[str, str], buildings: Iterable[str], records: Iterable[str]) -> str:
    """SHA-256 over the settings and the SHA-256 of all buildings and records in order."""
    whole = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for kind, digests in (("buildings", buildings), ("records", records)):
        whole.update(kind.encode())
        for digest in digests:
            whole.update(digest.encode())
    return whole.hexdigest()


def differences(
    before: dict[str, str], now: dict[str, str], *, kind: str, known: str = "the store", given: str = "this campaign"
) -> list[str]:
    """What differs between two sides, one sentence each: from names to values, or to SHA-256 (kind `building`)."""
    found = []
    for name in dict.fromkeys([*before, *now]):
        if name not in now:
            found.append(f"{kind} {name}: in {known} alone")
        elif name not in before:
            found.append(f"{kind} {name}: in {given} alone")
        elif before[name] != now[name]:
            what = "differs" if kind != "setting" else f"{before[name]} in {known}, {now[name]} in {given}"
            found.append(f"{kind} {name}: {what}")
    if len(found) > _MOST_DIFFERENCES:
        found[_MOST_DIFFERENCES:] = [f"and {len(found) - _MOST_DIFFERENCES} more of kind {kind}"]
    return found


def _building_digests(plan: Plan) -> dict[str, str]:
    return {plan.buildings.name(number): plan.buildings.digest(number) for number in range(len(plan.buildings))}


def _record_digests(plan: Plan) -> dict[str, str]:
    digests: dict[str, str] = {}
    for number, motion in enumerate(plan.motions, start=1):
        name = f"{motion.name} {motion.component}"
        digests[name if name not in digests else f"{name} ({number})"] = motion.record.digest
    return digests


def is_empty(store: Store) -> bool:
    """Whether nothing is in it yet."""
    found = store.connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    return int(found[0]) == 0


def _create(store: Store, plan: Plan) -> None:
    """Make the tables and say in them which campaign it is, all or nothing."""
    settings, digests = settings_of(plan), [plan.buildings.digest(number) for number in range(len(plan.buildings))]
    records = [motion.record.digest for motion in plan.motions]
    whole = fingerprint(settings, digests, records)
    about = {
        "schema": VERSION, "version": __version__, "name": plan.name, "fingerprint": whole,
        "runs": str(plan.runs), "chunks": str(plan.chunks),
    } | {f"{_SETTING}{name}": value for name, value in settings.items()}  # fmt: skip
    buildings = plan.buildings
    with transaction(store.connection, store.name):
        for statement in TABLES:
            store.connection.execute(statement)
        store.connection.executemany("INSERT INTO meta VALUES(?, ?)", about.items())
        store.connection.executemany(
            "INSERT INTO buildings VALUES(?, ?, ?, ?, ?)",
            (
                (number, buildings.name(number), buildings.method(number), buildings.stories(number), digest)
                for number, digest in enumerate(digests)
            ),
        )
        store.connection.executemany(
            "INSERT INTO records VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                (
                    number, _text(motion.name), _text(motion.component), motion.direction, motion.record.dt,
                    motion.record.acceleration.size, motion.record.pga, measure(motion.record).pgv, digest,
                )
                for number, (motion, digest) in enumerate(zip(plan.motions, records, strict=True))
            ),
        )  # fmt: skip
        store.seal()


def _text(name: str) -> str:
    """A name as a database takes it: bytes of a file's name that are no UTF-8 are written out."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
