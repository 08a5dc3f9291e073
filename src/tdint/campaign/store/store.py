"""The store of a campaign or a study: one SQLite file, written by one process, a chunk at a time."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from tdint.campaign.engine.batch import Done
from tdint.campaign.engine.runs import RunRow
from tdint.campaign.plan import Plan
from tdint.campaign.store import schema
from tdint.campaign.store.connection import UntrustedStoreError, connect, connect_to_read, in_words, transaction
from tdint.campaign.store.identity import Identity, all_differences
from tdint.errors import OutputError, UsageError
from tdint.files import digest_of
from tdint.ground_motion.measures import measure
from tdint.input_bytes import is_file
from tdint.output_units import SI, OutputUnits, parse_output_units
from tdint.version import __version__

FILE = "campaign.sqlite"

_SETTING = "setting "


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

    def __exit__(self, error: type[BaseException] | None, what: BaseException | None, *_: object) -> None:
        """Bring all into the one file, unless something failed, and close it.

        Raises
        ------
        OutputError
            SQLite failed at what was within: in words.
        """
        try:
            if isinstance(what, sqlite3.Error | UnicodeDecodeError):
                with in_words(self.name):
                    raise what
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

    def varied(self) -> list[dict[str, float]]:
        """What a sweep changed in each building, by its number; empty without a sweep."""
        return list(json.loads(self._known("varied") or "[]"))

    @property
    def checked(self) -> bool:
        """Whether the errors of the demands are estimated."""
        return self.settings().get("check") == "true"

    @property
    def corrected(self) -> bool:
        """Whether there are demands that are corrected by the error that their run has carried along."""
        query = "SELECT EXISTS(SELECT 1 FROM run_rows WHERE corrected_peak_drift_m IS NOT NULL)"
        return bool(self.connection.execute(query).fetchone()[0])

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
        found: tuple[list[Any], ...] = (done.rows.runs, done.rows.stories, done.rows.shocks)
        rows = [table.plain(own) for table, own in zip(schema.ROW_TABLES, found, strict=True)]
        number, seconds = done.number, float(done.seconds)
        with in_words(self.name), transaction(self.connection, self.name):
            for table, own in zip(schema.ROW_TABLES, rows, strict=True):
                table.insert(self.connection, own, number)
            values = (number, len(rows[0]), len(rows[1]), seconds, schema.chunk_digest(number, seconds, *rows))
            self.connection.execute("INSERT INTO chunks VALUES(?, ?, ?, ?, ?)", values)

    def heal(self, identity: Identity | None = None) -> int:
        """Take out the chunks that are not as they were written, or not of this campaign: they are left to be done.

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
            bad = schema.damaged_chunks(self.connection)
            if identity is not None:
                chunks = self.connection.execute("SELECT id, runs FROM chunks")
                bad |= {
                    one
                    for one, runs in chunks
                    if not (0 <= one < identity.chunks and identity.size(one) in (None, runs))
                }
            if not bad:
                return 0
            self.remove(bad)
            if schema.damaged_chunks(self.connection):
                raise UntrustedStoreError(self.name, "chunks that are not as they were written cannot be taken out")
            return len(bad)

    def remove(self, chunks: Collection[int]) -> None:
        """Take out chunks: they are left to be done."""
        with in_words(self.name), transaction(self.connection, self.name):
            for table, column in (*((one.name, "chunk") for one in schema.ROW_TABLES), ("chunks", "id")):
                self.connection.executemany(f"DELETE FROM {table} WHERE {column} IS ?", ((one,) for one in chunks))

    def is_ours(self, file: Path) -> bool:
        """Whether a file is there and as it was made of this store."""
        return is_file(file) and (file.name, digest_of(file)) in self.written()

    def refuse_foreign(self, files: Iterable[Path]) -> None:
        """Raise OutputError if one of some files is there and was not made of this store."""
        for file in files:
            if is_file(file) and not self.is_ours(file):
                raise foreign(file)

    def written(self) -> set[tuple[str, str]]:
        """Name and SHA-256 of the files that were made of this store."""
        return set() if is_empty(self) else set(self.connection.execute("SELECT file, sha256 FROM written"))

    def will_write(self, files: Mapping[Path, str]) -> None:
        """Keep the names and SHA-256 of files that are about to take their places."""
        new = {(file.name, digest) for file, digest in files.items()} - self.written()
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
        found = self._known("output_units")
        return parse_output_units(found) if found is not None else SI

    def tell(self, identity: Identity) -> None:
        """Keep what is known beside what the runs depend on: inputs that could not be used, units, damage states, files
        of models, and columns of an inventory."""
        self._tell_inventory(identity)
        values = {
            "output_units": str(identity.units),
            "damage": identity.damage.description() if identity.damage else "",
            "files": json.dumps(dict(identity.files)),
        }
        before = [(kind, reason) for kind, reasons in self.unused().items() for reason in reasons]
        same = all(self._known(key) == value for key, value in values.items())
        if same and sorted(before) == sorted(dict.fromkeys(identity.unused)):
            return
        with in_words(self.name), transaction(self.connection, self.name):
            self.connection.execute("DELETE FROM unused")
            self.add_unused(identity.unused)
            self.connection.executemany("INSERT OR REPLACE INTO meta VALUES(?, ?)", values.items())
            self.connection.execute("DELETE FROM building_types")
            of_buildings = identity.damage.buildings if identity.damage else ()
            rows = ((number, *one) for number, one in enumerate(of_buildings))
            self.connection.executemany("INSERT INTO building_types VALUES(?, ?, ?, ?)", rows)
            self.seal()

    def _tell_inventory(self, identity: Identity) -> None:
        """Keep the columns of an inventory that are carried along: other ones change no run."""
        columns = identity.buildings[0].columns
        cells = [one.cells for one in identity.buildings] if columns else []
        whole = hashlib.sha256(json.dumps(columns).encode())
        for cell in cells:
            whole.update(cell.encode())
        told = json.dumps({"columns": columns, "sha256": whole.hexdigest()})
        if self._known("inventory") == told:
            return
        with in_words(self.name), transaction(self.connection, self.name):
            self.connection.execute("INSERT OR REPLACE INTO meta VALUES('inventory', ?)", (told,))
            self.connection.execute("DELETE FROM inventory")
            self.connection.executemany("INSERT INTO inventory VALUES(?, ?)", enumerate(cells))
            self.seal()

    def inventory_columns(self) -> tuple[str, ...]:
        """Columns of the inventory that are carried along, as they are written there; none without one."""
        return tuple(json.loads(self.meta("inventory"))["columns"])

    def events(self) -> list[str]:
        """The events of ground motion fields, whose numbers from 1 are those of the draws; none without fields."""
        return list(json.loads(self._known("setting events") or "[]"))

    def carried(self, building: int) -> list[str]:
        """What the inventory says of a building in these columns."""
        found = self.connection.execute("SELECT cells FROM inventory WHERE building = ?", (building,)).fetchone()
        return list(json.loads(found[0])) if found else []

    def _known(self, key: str) -> str | None:
        """A value of the table meta; None where there is none."""
        found = self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return found[0] if found else None

    def files(self) -> dict[str, str]:
        """SHA-256 of the model files or of those of the inventory, by name."""
        return dict(json.loads(self._known("files") or "{}"))

    def damage(self) -> str:
        """What `tdint.campaign.fragility.type_states.Damage.description` tells; nothing where damage is not told."""
        return self._known("damage") or ""

    def building_type(self, building: int) -> tuple[str, str, float, float]:
        """The name of a building, and what `tdint.campaign.fragility.type_states.BuildingType` has of it."""
        query = (
            "SELECT b.name, t.type, t.divisor, t.period_s FROM buildings b JOIN building_types t ON t.building = b.id "
            "WHERE b.id = ?"
        )
        name, of_type, divisor, period = self.connection.execute(query, (building,)).fetchone()
        return name, of_type, divisor, period

    def add_unused(self, found: Iterable[tuple[str, str]]) -> None:
        """Add inputs that could not be used; `seal` follows."""
        self.connection.executemany("INSERT OR IGNORE INTO unused VALUES(?, ?)", found)

    def seal(self) -> None:
        """Keep the checksum over what the campaign is, in the transaction that changes it."""
        values = (schema.SEAL, schema.seal_of(self.connection))
        self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)

    def runs(self) -> Iterator[tuple[Any, ...]]:
        """All runs: the columns of `RUNS`, in the order of their key."""
        yield from self.connection.execute(schema.RUNS.select())

    def runs_of(self, chunk: int) -> list[RunRow]:
        """The runs of a chunk."""
        rows = self.connection.execute(schema.RUNS.select(where="WHERE chunk = ?"), (chunk,))
        return [schema.run_of(row) for row in rows]

    def stories(self) -> Iterator[tuple[Any, ...]]:
        """The stories of all runs: the columns of `STORIES`, in the order of their key."""
        yield from self.connection.execute(schema.STORIES.select())

    def shocks(self) -> Iterator[tuple[Any, ...]]:
        """The shocks of all runs of several: the columns of `SHOCKS`, in the order of their key."""
        yield from self.connection.execute(schema.SHOCKS.select())

    def buildings(self) -> Mapping[int, tuple[str, str]]:
        """Name and method of each building by its number."""
        rows = self.connection.execute("SELECT id, name, method FROM buildings")
        return {number: (name, method) for number, name, method in rows}

    def records(self) -> Mapping[int, tuple[str, str, int]]:
        """Name, component and direction of each motion by its number."""
        rows = self.connection.execute("SELECT id, name, component, direction FROM records")
        return {number: (name, component, direction) for number, name, component, direction in rows}


def open_store(folder: Path | None, plan: Plan) -> tuple[Store, list[str]]:
    """The store of a campaign in a folder, in memory without one; results and errors are those of `open_or_begin`."""
    return open_or_begin(None if folder is None else folder / FILE, Identity.of(plan))


def open_or_begin(file: Path | None, identity: Identity, *, log: bool = True) -> tuple[Store, list[str]]:
    """The store in a file, made where there is none; in memory without a file.

    Parameters
    ----------
    log : bool
        Whether others shall read while it is written (`connect`).

    Returns
    -------
    Store, list of str
        The store, and what to say of it.

    Raises
    ------
    UsageError
        The file is of another campaign: what differs, one line each.
    OutputError
        It cannot be written.
    """
    name = ":memory:" if file is None else str(file)
    with in_words(name):
        store = Store(connect(name, log=log), name)
    try:
        with in_words(name):
            if is_empty(store):
                _create(store, identity)
                store.tell(identity)
                return store, []
            schema.check_store(store.connection, name)
        remarks = check_same(store, identity)
        if healed := store.heal(identity):
            remarks.append(f"{name}: {healed} chunks of runs are not as they were written; they are done again")
        store.tell(identity)
        return store, remarks
    except BaseException:
        store.connection.close()
        raise


def open_existing(folder: Path, *, write: bool = False) -> Store:
    """The store of a campaign in a folder, to be read, or written, too; chunks in it may be damaged (`check_chunks`).

    Raises
    ------
    UsageError
        There is none.
    OutputError
        It cannot be used, or not be trusted.
    """
    if not (folder / FILE).exists():
        raise UsageError(f"{folder}: holds no campaign ({FILE}); give the folder of -o of `tdint campaign`")
    name = str(folder / FILE)
    with in_words(name):
        store = Store(connect(name) if write else connect_to_read(folder / FILE), name)
    if not _checked(store):
        store.connection.close()
        raise UsageError(f"{folder}: the campaign in it has not begun; call `tdint campaign` again")
    return store


def open_written(file: Path) -> Store:
    """The store in a file that is written without a log, as it is. Errors are those of `open_existing`."""
    with in_words(str(file)):
        store = Store(connect(str(file), log=False), str(file))
    _checked(store)
    return store


def _checked(store: Store) -> bool:
    """Whether there is something in a store, which is whole then; else it is closed."""
    try:
        with in_words(store.name):
            begun = not is_empty(store)
            if begun:
                schema.check_store(store.connection, store.name)
    except BaseException:
        store.connection.close()
        raise
    return begun


def check_chunks(store: Store) -> None:
    """Raise OutputError if runs of a store are not as they were written."""
    with in_words(store.name):
        bad = schema.damaged_chunks(store.connection)
    if bad:
        raise OutputError(
            f"{store.name}: {len(bad)} chunks of runs are not as they were written; call `tdint campaign FILE -o "
            f"{Path(store.name).parent}` again, which does them anew"
        )


def check_same(store: Store, identity: Identity) -> list[str]:
    """Whether a store is of these runs.

    Returns
    -------
    list of str
        What to say of it.

    Raises
    ------
    UsageError
        It is of others: what differs, one line each.
    """
    if identity.fingerprint != store.meta("fingerprint"):
        lines = all_differences(
            (store.settings(), store.digests("buildings"), store.digests("records")),
            (identity.settings, identity.building_digests(), identity.record_digests()),
            given=f"this {identity.kind}",
        )
        raise UsageError(
            f"{store.name}: holds another {identity.kind}; give another folder with -o, or --overwrite to begin anew\n"
            f"{lines}"
        )
    version = store.meta("version")
    return [] if version == __version__ else [f"{store.name}: begun with tdint {version}, this is {__version__}"]


def foreign(file: Path) -> OutputError:
    """That a file was not made of a store beside it."""
    return OutputError(
        f"{file}: exists already, and is not as this command wrote it; give another folder with -o, or --overwrite to "
        "replace it"
    )


def forget(file: Path) -> None:
    """Remove a store from a folder that is locked.

    Raises
    ------
    OutputError
        It cannot be removed.
    """
    for end in ("", "-wal", "-shm", "-journal"):
        remove(file.with_name(file.name + end))


def remove(file: Path) -> None:
    """Remove a file if it is there.

    Raises
    ------
    OutputError
        It cannot be removed.
    """
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{file}: cannot be removed: {error.strerror or error}") from None


def is_empty(store: Store) -> bool:
    """Whether nothing is in it yet."""
    found = store.connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    return int(found[0]) == 0


def _create(store: Store, identity: Identity) -> None:
    """Make the tables and say in them what the runs are, all or nothing."""
    about = {
        "schema": schema.VERSION, "version": __version__, "name": identity.name, "fingerprint": identity.fingerprint,
        "runs": str(identity.runs), "chunks": str(identity.chunks),
    } | {f"{_SETTING}{name}": value for name, value in identity.settings.items()}  # fmt: skip
    if any(varied := [dict(one.varied) for one in identity.buildings]):
        about["varied"] = json.dumps(varied)
    with transaction(store.connection, store.name):
        for statement in schema.TABLES:
            store.connection.execute(statement)
        store.connection.executemany("INSERT INTO meta VALUES(?, ?)", about.items())
        store.connection.executemany(
            "INSERT INTO buildings VALUES(?, ?, ?, ?, ?)",
            (
                (number, one.name, one.method, one.stories, digest)
                for number, (one, digest) in enumerate(zip(identity.buildings, identity.digests, strict=True))
            ),
        )
        store.connection.executemany(
            "INSERT INTO records VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                (
                    number, _text(one.name), _text(one.component), one.direction, one.record.dt,
                    one.record.acceleration.size, one.record.pga, measure(one.record).pgv, one.record.digest,
                )
                for number, one in enumerate(identity.motions)
            ),
        )  # fmt: skip
        store.seal()


def _text(name: str) -> str:
    """A name as a database takes it: bytes of a file's name that are no UTF-8 are written out."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
