"""The store of a campaign: one SQLite file, written by one process, a chunk at a time."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from tdint.campaign.engine.chunk import Done
from tdint.campaign.plan import Plan
from tdint.campaign.store.schema import INSERT_RUN, INSERT_STORY, RUN_COLUMNS, STORY_COLUMNS, TABLES, UNUSED, VERSION
from tdint.errors import OutputError, UsageError
from tdint.files import is_file
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
                with in_words(self.name):
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
        with in_words(self.name), transaction(self.connection):
            self.connection.executemany(INSERT_RUN, done.rows.runs)
            self.connection.executemany(INSERT_STORY, ((*row[:-1], *row.values) for row in done.rows.stories))
            values = (done.number, "done", len(done.rows.runs), done.seconds)
            self.connection.execute("INSERT INTO chunks VALUES(?, ?, ?, ?)", values)

    def unused(self) -> dict[str, list[str]]:
        """Why records and buildings could not be used, a line for each, by `record` and `building`."""
        found: dict[str, list[str]] = {"record": [], "building": []}
        if self.connection.execute("SELECT count(*) FROM sqlite_master WHERE name = 'unused'").fetchone()[0]:
            for kind, reason in self.connection.execute("SELECT kind, reason FROM unused ORDER BY rowid"):
                found[kind].append(reason)
        return found

    def output_units(self) -> OutputUnits:
        """The units in which the models want their results."""
        found = self.connection.execute("SELECT value FROM meta WHERE key = 'output_units'").fetchone()
        return parse_output_units(found[0]) if found else SI

    def tell(self, plan: Plan) -> None:
        """Keep what a plan says of itself beside what its runs depend on: inputs that could not be used, units."""
        with in_words(self.name), transaction(self.connection):
            self.connection.execute(UNUSED)
            self.connection.execute("DELETE FROM unused")
            self.connection.executemany("INSERT OR IGNORE INTO unused VALUES(?, ?)", plan.unused)
            units = ("output_units", str(plan.buildings.output_units))
            self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", units)

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
            if _is_empty(store):
                _create(store, plan)
                store.tell(plan)
                return store, []
            check_columns(store)
        remarks = check_same(store, plan)
        store.tell(plan)
        return store, remarks
    except BaseException:
        store.connection.close()
        raise


def open_existing(folder: Path) -> Store:
    """The store in a folder, to be read.

    Raises
    ------
    UsageError
        There is none.
    """
    file = folder / FILE
    if not is_file(file):
        raise UsageError(f"{folder}: holds no campaign ({FILE}); give the folder of -o of `tdint campaign`")
    with in_words(str(file)):
        store = Store(connect(str(file)), str(file))
        if _is_empty(store):
            store.connection.close()
            raise UsageError(f"{folder}: the campaign in it has not begun; call `tdint campaign` again")
        check_columns(store)
    return store


def check_columns(store: Store) -> None:
    """Refuse a store whose tables have other columns than those of today.

    Raises
    ------
    UsageError
        It has.
    """
    for table, columns in (("run_rows", RUN_COLUMNS), ("story_rows", STORY_COLUMNS)):
        found = tuple(row[1] for row in store.connection.execute(f"PRAGMA table_info({table})"))
        if found != columns:
            raise UsageError(
                f"{store.name}: begun with tdint {store.meta('version')}, whose runs have other columns than those of "
                f"{__version__}; go on with that version, or give another folder with -o"
            )


def connect(name: str) -> sqlite3.Connection:
    """A connection that writes safely and fast: a log ahead of the file, which a killed process leaves whole."""
    connection = sqlite3.connect(name, isolation_level=None, timeout=30.0)
    try:
        connection.execute("PRAGMA journal_mode=WAL")
        connection.execute("PRAGMA synchronous=NORMAL")
    except sqlite3.Error:
        connection.close()
        raise
    return connection


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


def _is_empty(store: Store) -> bool:
    found = store.connection.execute("SELECT count(*) FROM sqlite_master WHERE name = 'meta'").fetchone()
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
    with transaction(store.connection):
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


def _text(name: str) -> str:
    """A name as a database takes it: bytes of a file's name that are no UTF-8 are written out."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """All statements or none."""
    connection.execute("BEGIN IMMEDIATE")
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
    except sqlite3.Error as error:
        hint = "; is it the file of a campaign?" if "not a database" in str(error) else ""
        raise OutputError(f"{name}: cannot be used: {error}{hint}") from error
