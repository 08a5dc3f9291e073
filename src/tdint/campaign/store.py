"""The store of a campaign or a study: one SQLite file, written by one process, a chunk at a
time."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

from tdint.arrays import cached_property
from tdint.campaign import store_schema as schema
from tdint.campaign.batch import Done, RunRow
from tdint.campaign.buildings import (
    Buildings,
    RowBuildings,
    digests_of,
    model_files,
    output_units,
    plugin_files,
)
from tdint.campaign.fragility.type_states import Damage
from tdint.campaign.pairs import LARGER, PairRule, recording_numbers
from tdint.campaign.plan import Plan
from tdint.campaign.store_schema import (
    SILENT,
    UntrustedStoreError,
    connect,
    connect_to_read,
    in_words,
    transaction,
)
from tdint.errors import OutputError, UsageError
from tdint.files import digest_of, is_file, is_there, keep_input, refuse_kept
from tdint.ground_motion.measures import measure
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.system import __version__
from tdint.units import SI, OutputUnits, parse_output_units

# ---- What a store is of: all that its runs depend on, and in words how two of them differ

_MOST_DIFFERENCES = 8  # lines of a message that are still read


@dataclass(frozen=True)
class Identity:
    """What is kept in a store.

    Attributes
    ----------
    name : str
        Of the campaign or the study.
    kind : str
        What it is called in messages.
    settings : dict
        What is the same for all runs, JSON by name.
    buildings, motions : sequence
        By their numbers.
    chunks, runs : int
        How many there are; 0 runs where their number follows from what comes out.
    size : callable
        How many runs a chunk has; None where that follows from what comes out.
    unused : sequence of tuple
        Inputs that could not be used: `record` or `building`, and why.
    units : OutputUnits
        The units in which the models want their results.
    damage : Damage or None
        How damage is told.
    files : mapping of str to str
        SHA-256 of the model files or of those of the inventory, by name.
    outputs : sequence of str or None
        The tables that are written; None: all that there are.
    rates : mapping of str to float
        How often events come in a year, as far as it is told.
    style : tuple of (str, str)
        Looks of the pictures, and the folder that a style sheet in them is relative to.
    pair_demand : str or None
        How the components of pairs count; None: the default.
    kept : sequence of int or None
        The buildings that the store tells of: those of a shard; None: all.
    """

    name: str
    kind: str
    settings: dict[str, str]
    buildings: Buildings
    motions: Sequence[SuiteMotion]
    chunks: int
    runs: int = 0
    size: Callable[[int], int | None] = lambda chunk: None
    unused: Sequence[tuple[str, str]] = ()
    units: OutputUnits = SI
    damage: Damage | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    outputs: Sequence[str] | None = None
    rates: Mapping[str, float] = field(default_factory=dict)
    style: tuple[str, str] = ("", "")
    pair_demand: str | None = None
    kept: Sequence[int] | None = None

    @classmethod
    def of(cls, plan: Plan, kept: Sequence[int] | None) -> Identity:
        """What the store of a campaign is of, or of a part of its buildings."""
        same = (
            "buildings",
            "motions",
            "chunks",
            "runs",
            "size",
            "unused",
            "damage",
            "outputs",
            "rates",
            "style",
            "pair_demand",
        )
        return cls(
            **{name: getattr(plan, name) for name in same},
            name=plan.name,
            kind="campaign",
            settings=as_json(
                asdict(plan.settings) | plan.levels.description() | plan.assignment.description()
            ),
            units=output_units(plan.buildings),
            kept=kept,
            files=model_files(plan.buildings)
            | {file: digest_of(Path(file)) for file in plan.inventory},
        )

    @cached_property
    def code(self) -> dict[str, str]:
        """SHA-256 of the files of plug-ins that the runs depend on, by name."""
        return plugin_files(self.buildings)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 over the settings, the files of plug-ins if there are any, and the SHA-256 of all
        buildings and records in order."""
        whole = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode())
        if self.code:
            whole.update(json.dumps(["plug-ins", self.code]).encode())
        records = [motion.record.digest for motion in self.motions]
        for kind, digests in (("buildings", digests_of(self.buildings)), ("records", records)):
            whole.update(kind.encode())
            for digest in digests:
                whole.update(digest.encode())
        return whole.hexdigest()

    @property
    def sides(self) -> Sides:
        """What `all_differences` compares."""
        named = {building.name: building.digest for building in self.buildings}
        records: dict[str, str] = {}
        # Motions that share name and component, as draws of a grid do, are told apart by their
        # numbers.
        for number, motion in enumerate(self.motions, start=1):
            name = f"{motion.name} {motion.component}"
            records[name if name not in records else f"{name} ({number})"] = motion.record.digest
        return self.settings, named, records, self.code


def as_json(settings: dict[str, Any]) -> dict[str, str]:
    """Settings as a store has them."""
    return {name: json.dumps(value, sort_keys=True) for name, value in sorted(settings.items())}


def differences(
    before: dict[str, str], now: dict[str, str], *, kind: str, store: str, given: str
) -> list[str]:
    """What differs between two sides, one sentence each: from names to values, or to SHA-256 (kind
    `building`)."""
    lines = []
    for name in dict.fromkeys([*before, *now]):
        if name not in now:
            lines.append(f"{kind} {name}: in {store} alone")
        elif name not in before:
            lines.append(f"{kind} {name}: in {given} alone")
        elif before[name] != now[name]:
            difference = (
                "differs"
                if kind != "setting"
                else f"{before[name]} in {store}, {now[name]} in {given}"
            )
            lines.append(f"{kind} {name}: {difference}")
    if len(lines) > _MOST_DIFFERENCES:
        lines[_MOST_DIFFERENCES:] = [f"and {len(lines) - _MOST_DIFFERENCES} more of kind {kind}"]
    return lines


Sides = Sequence[Mapping[str, str]]
"""Settings, buildings, records, files of plug-ins, from names to values or to SHA-256."""


def all_differences(
    before: Sides, now: Sides, *, store: str = "the store", given: str, parts: bool = False
) -> str:
    """What differs of two sides, a line each. Of parts of a campaign each tells of its own
    buildings alone."""
    kinds = ("setting", "building", "record", "plug-in")
    lines = []
    for kind, stored, other in zip(kinds, before, now, strict=True):
        both = (
            stored.keys() & other.keys()
            if parts and kind == "building"
            else stored.keys() | other.keys()
        )
        sides = ({name: side[name] for name in side if name in both} for side in (stored, other))
        lines += differences(*sides, kind=kind, store=store, given=given)
    rest = (
        "buildings: the inventory has changed between the calls for the shards; call `tdint "
        "campaign` for every shard with the same inventory"
        if parts
        else "the order of buildings or records: differs"
    )
    return "\n".join(lines or [rest])


# ---- Store

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

    def __exit__(
        self, error: type[BaseException] | None, raised: BaseException | None, *_: object
    ) -> None:
        """Bring all into the one file, unless something failed, and close it.

        Raises
        ------
        OutputError
            SQLite failed at what was within: in words.
        """
        try:
            if isinstance(raised, sqlite3.Error | UnicodeDecodeError):
                with in_words(self.name):
                    raise raised
            if error is None:
                with (
                    in_words(self.name),
                    suppress(sqlite3.OperationalError),
                ):  # another program may read it
                    self.connection.executescript(
                        f"PRAGMA busy_timeout={SILENT}; PRAGMA wal_checkpoint(TRUNCATE)"
                    )
        finally:
            self.connection.close()

    def meta(self, key: str) -> str:
        """A value of the table meta."""
        return str(
            self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()[0]
        )

    def settings(self) -> dict[str, str]:
        """What is the same for all runs."""
        rows = self.connection.execute(
            "SELECT key, value FROM meta WHERE key LIKE 'setting %' ORDER BY key"
        )
        return {key.removeprefix(_SETTING): value for key, value in rows}

    def parameters(self) -> dict[str, Any]:
        """The same as values."""
        return {name: json.loads(value) for name, value in self.settings().items()}

    def varied(self) -> list[dict[str, float]]:
        """What a sweep changed in each building, by its number; empty without a sweep."""
        return list(json.loads(self._known("varied") or "[]"))

    @property
    def checked(self) -> bool:
        """Whether the errors of the demands are estimated."""
        return self.settings().get("check") == "true"

    def digests(self, table: str) -> dict[str, str]:
        """SHA-256 of the buildings or the records by their names."""
        name = "name" if table == "buildings" else "name || ' ' || component"
        return dict(self.connection.execute(f"SELECT {name}, sha256 FROM {table} ORDER BY id"))

    def code(self) -> dict[str, str]:
        """SHA-256 of the files of plug-ins that its runs were made with, by name."""
        return dict(json.loads(self._known("code") or "{}"))

    def sides(self) -> Sides:
        """What `all_differences` compares."""
        return self.settings(), self.digests("buildings"), self.digests("records"), self.code()

    def done(self) -> set[int]:
        """The chunks that are done."""
        return {number for (number,) in self.connection.execute("SELECT id FROM chunks")}

    def seconds(self) -> float:
        """The processor time of the chunks that are done, s."""
        return float(self.connection.execute("SELECT total(seconds) FROM chunks").fetchone()[0])

    def statuses(self) -> dict[str, int]:
        """How many runs ended how."""
        return dict(
            self.connection.execute(
                "SELECT status, count(*) FROM run_rows GROUP BY status ORDER BY status"
            )
        )

    def count(self, condition: str) -> int:
        """How many runs meet a condition on the columns of run_rows."""
        return int(
            self.connection.execute(f"SELECT count(*) FROM run_rows WHERE {condition}").fetchone()[
                0
            ]
        )

    def add(self, done: Done) -> None:
        """Write the rows of a chunk and that it is done: both or neither.

        Raises
        ------
        OutputError
            The disk is full, the file is damaged, somebody else writes.
        """
        by_table = zip(schema.ROW_TABLES, vars(done.rows).values(), strict=True)
        rows = [table.plain(of_table) for table, of_table in by_table]
        number, seconds = done.number, float(done.seconds)
        with in_words(self.name), transaction(self.connection, self.name):
            for table, of_table in zip(schema.ROW_TABLES, rows, strict=True):
                table.insert(self.connection, of_table, number)
            values = (
                number,
                len(rows[0]),
                len(rows[1]),
                seconds,
                schema.chunk_digest(number, seconds, *rows),
            )
            self.connection.execute("INSERT INTO chunks VALUES(?, ?, ?, ?, ?)", values)

    def heal(self, identity: Identity | None = None) -> int:
        """Take out the chunks that are not as they were written, or not of this campaign: they are
        left to be done.

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
            # By checksums of the rows themselves, not by what the store says of them.
            bad = schema.damaged_chunks(self.connection)
            if identity is not None:  # A chunk cut otherwise has other runs, whole as it may be.
                chunks = self.connection.execute("SELECT id, runs FROM chunks")
                bad |= {
                    i
                    for i, runs in chunks
                    if not (0 <= i < identity.chunks and identity.size(i) in (None, runs))
                }
            if not bad:
                return 0
            self.remove(bad)
            if schema.damaged_chunks(self.connection):
                raise UntrustedStoreError(
                    self.name, "chunks that are not as they were written cannot be taken out"
                )
            return len(bad)

    def remove(self, chunks: Collection[int]) -> None:
        """Take out chunks: they are left to be done."""
        with in_words(self.name), transaction(self.connection, self.name):
            for table, column in (
                *((item.name, "chunk") for item in schema.ROW_TABLES),
                ("chunks", "id"),
            ):
                self.connection.executemany(
                    f"DELETE FROM {table} WHERE {column} IS ?", ((item,) for item in chunks)
                )

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
        return (
            set()
            if is_empty(self)
            else set(self.connection.execute("SELECT file, sha256 FROM written"))
        )

    def will_write(self, files: Mapping[Path, str]) -> None:
        """Keep the names and SHA-256 of files that are about to take their places."""
        new = {(file.name, digest) for file, digest in files.items()} - self.written()
        if new:
            with in_words(self.name), transaction(self.connection, self.name):
                self.connection.executemany("INSERT INTO written VALUES(?, ?)", sorted(new))

    def unused(self) -> dict[str, list[str]]:
        """Why records and buildings could not be used, a line for each, by `record` and
        `building`."""
        reasons: dict[str, list[str]] = {"record": [], "building": []}
        for kind, reason in self.connection.execute(
            "SELECT kind, reason FROM unused ORDER BY rowid"
        ):
            reasons.setdefault(kind, []).append(reason)
        return reasons

    def output_units(self) -> OutputUnits:
        """The units in which the models want their results."""
        units = self._known("output_units")
        return parse_output_units(units) if units is not None else SI

    def tell(self, identity: Identity) -> None:
        """Keep what is known beside what the runs depend on: inputs that could not be used, units,
        damage states, looks of pictures, files of models, and columns of an inventory."""
        buildings, every = identity.buildings, len(identity.buildings)
        rows = buildings.rows if isinstance(buildings, RowBuildings) else None
        columns, carried = (rows.titles, rows.digest(carried=True)) if rows else ((), "")
        values = {
            "inventory": json.dumps({"columns": columns, "sha256": carried}),
            "output_units": str(identity.units),
            "damage": identity.damage.description() if identity.damage else "",
            "files": json.dumps(dict(identity.files)),
            "outputs": json.dumps(identity.outputs),
            "rates": json.dumps(dict(identity.rates)),
            "style": json.dumps(identity.style),
            "pair_demand": identity.pair_demand or LARGER,
            "periods": json.dumps(
                [] if carried else [building.subject().period for building in buildings]
            ),
        }
        # Most calls say what is there already: nothing is written then, and others can read on.
        before = [(kind, reason) for kind, reasons in self.unused().items() for reason in reasons]
        same = all(self._known(key) == value for key, value in values.items())
        held = {number for (number,) in self.connection.execute("SELECT id FROM buildings")}
        new = sorted(set(range(every) if identity.kept is None else identity.kept) - held)
        if same and not new and sorted(before) == sorted(dict.fromkeys(identity.unused)):
            return
        types = identity.damage.buildings if identity.damage else ()
        # All or nothing, sealed in the same transaction, so that no reader finds half of it.
        with in_words(self.name), transaction(self.connection, self.name):
            self.connection.execute("DELETE FROM unused")
            self.add_unused(identity.unused)
            self.connection.executemany("INSERT OR REPLACE INTO meta VALUES(?, ?)", values.items())
            # Of buildings that are there already what may have changed is told anew.
            add = self.connection.execute
            for table in () if same else ("inventory", "building_types"):
                add(f"DELETE FROM {table}")
            for number in new if same else sorted(held.union(new)):
                item = buildings[number]
                if number not in held:
                    about = (number, item.name, item.method, item.stories, item.digest)
                    add("INSERT INTO buildings VALUES(?, ?, ?, ?, ?)", about)
                if columns:
                    add("INSERT INTO inventory VALUES(?, ?)", (number, item.cells))
                if types:
                    add("INSERT INTO building_types VALUES(?, ?, ?, ?)", (number, *types[number]))
            self.seal()

    def inventory_columns(self) -> tuple[str, ...]:
        """Columns of the inventory that are carried along, as they are written there; none without
        one."""
        return tuple(json.loads(self.meta("inventory"))["columns"])

    def shards(self) -> list[str]:
        """The shards, K/N, that were asked of it."""
        return list(json.loads(self._known("shards") or "[]"))

    def add_shard(self, text: str) -> None:
        """Keep that a shard was asked of it: who merges is told which ones are missing."""
        if text not in (before := self.shards()):
            with in_words(self.name), transaction(self.connection, self.name):
                values = ("shards", json.dumps([*before, text]))
                self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
                self.seal()

    def events(self) -> list[str]:
        """The events of ground motion fields, whose numbers from 1 are those of the draws; none
        without fields."""
        return list(json.loads(self._known("setting events") or "[]"))

    def carried(self, building: int) -> list[str]:
        """What the inventory says of a building in these columns."""
        row = self.connection.execute(
            "SELECT cells FROM inventory WHERE building = ?", (building,)
        ).fetchone()
        return list(json.loads(row[0])) if row else []

    def _known(self, key: str) -> str | None:
        """A value of the table meta; None where there is none."""
        row = self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return row[0] if row else None

    def files(self) -> dict[str, str]:
        """SHA-256 of the model files or of those of the inventory, by name."""
        return dict(json.loads(self._known("files") or "{}"))

    def writes(self, table: str) -> bool:
        """Whether a table is written: `runs`, `damage` or `losses`."""
        chosen = json.loads(self._known("outputs") or "null")
        return chosen is None or table in chosen

    def style(self) -> tuple[str, str]:
        """Looks of the pictures, empty where none are told, and the folder that a style sheet is
        relative to."""
        text, folder = json.loads(self._known("style") or '["", ""]')
        return text, folder

    def pair_demand(self) -> str:
        """How the components of pairs count: one of `tdint.campaign.pairs.PAIR_DEMANDS`."""
        return self._known("pair_demand") or LARGER

    def pair_rule(self) -> PairRule:
        """How the components of its pairs count."""
        return PairRule(self.pair_demand(), recording_numbers(self.records()))

    def choose_pair_demand(self, demand: str) -> None:
        """Store how the components of pairs count."""
        if demand != self.pair_demand():
            with in_words(self.name), transaction(self.connection, self.name):
                values = ("pair_demand", demand)
                self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
                self.seal()

    def rates(self) -> dict[str, float]:
        """How often each event comes in a year; empty where it is not told."""
        return dict(json.loads(self._known("rates") or "{}"))

    def period(self, building: int) -> float | None:
        """The first period of a building, s; None where the store does not have it."""
        periods = json.loads(self._known("periods") or "[]")
        if building < len(periods):
            return float(periods[building])
        query = "SELECT period_s FROM building_types WHERE building = ?"
        row = self.connection.execute(query, (building,)).fetchone()
        return row and float(row[0])

    def damage(self) -> str:
        """What `tdint.campaign.fragility.type_states.Damage.description` tells; nothing where
        damage is not told."""
        return self._known("damage") or ""

    def building_type(self, building: int) -> tuple[str, str, float, float]:
        """The name of a building, and what `tdint.campaign.fragility.type_states.BuildingType` has
        of it."""
        query = (
            "SELECT b.name, t.type, t.divisor, t.period_s FROM buildings b JOIN building_types t "
            "ON t.building = b.id WHERE b.id = ?"
        )
        name, of_type, divisor, period = self.connection.execute(query, (building,)).fetchone()
        return name, of_type, divisor, period

    def add_unused(self, reasons: Iterable[tuple[str, str]]) -> None:
        """Add inputs that could not be used; `seal` follows."""
        self.connection.executemany("INSERT OR IGNORE INTO unused VALUES(?, ?)", reasons)

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


def open_store(
    folder: Path | None, plan: Plan, kept: Sequence[int] | None = None
) -> tuple[Store, list[str]]:
    """The store of a campaign in a folder, in memory without one, which tells of all buildings or
    of those of a shard; results and errors are those of `open_or_begin`."""
    return open_or_begin(None if folder is None else folder / FILE, Identity.of(plan, kept))


def open_or_begin(
    file: Path | None, identity: Identity, *, log: bool = True
) -> tuple[Store, list[str]]:
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
    with schema.closed_on_failure(store.connection):
        remarks = check_same(store, identity) if _begun(store) else None
        if remarks is None:
            with in_words(name):
                _create(store, identity)
        elif healed := store.heal(identity):
            remarks.append(
                f"{name}: {healed} chunks of runs are not as they were written; they are done again"
            )
        store.tell(identity)
    return store, remarks or []


def open_existing(folder: Path, *, write: bool = False) -> Store:
    """The store of a campaign in a folder, to be read, or written, too; chunks in it may be damaged
    (`check_chunks`).

    Raises
    ------
    UsageError
        There is none.
    OutputError
        It cannot be used, or not be trusted.
    """
    if not is_there(folder / FILE):
        raise UsageError(
            f"{folder}: holds no campaign ({FILE}); give the folder of -o of `tdint campaign`"
        )
    keep_input(folder / FILE)
    name = str(folder / FILE)
    with in_words(name):
        store = Store(connect(name) if write else connect_to_read(folder / FILE), name)
    if not _begun(store):
        store.connection.close()
        raise UsageError(f"{folder}: the campaign in it has not begun; call `tdint campaign` again")
    return store


def open_written(file: Path) -> Store:
    """The store in a file that is written without a log, as it is. Errors are those of
    `open_existing`."""
    with in_words(str(file)):
        store = Store(connect(str(file), log=False), str(file))
    _begun(store)
    return store


def _begun(store: Store) -> bool:
    """Whether there is something in a store, which is whole then; else it is closed."""
    with schema.closed_on_failure(store.connection), in_words(store.name):
        begun = not is_empty(store)
        if begun:
            schema.check_store(store.connection, store.name)
    return begun


def check_chunks(store: Store) -> None:
    """Raise OutputError if runs of a store are not as they were written."""
    with in_words(store.name):
        bad = schema.damaged_chunks(store.connection)
    if bad:
        raise OutputError(
            f"{store.name}: {len(bad)} chunks of runs are not as they were written; call `tdint "
            f"campaign FILE -o {Path(store.name).parent}` again, which does them anew"
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
            store.sides(), identity.sides, given=f"this {identity.kind}", parts=bool(store.shards())
        )
        raise UsageError(
            f"{store.name}: holds another {identity.kind}; give another folder with -o, or "
            "--overwrite to begin anew\n"
            f"{lines}"
        )
    version = store.meta("version")
    return (
        []
        if version == __version__
        else [f"{store.name}: begun with tdint {version}, this is {__version__}"]
    )


def foreign(file: Path) -> OutputError:
    """That a file was not made of a store beside it."""
    return OutputError(
        f"{file}: exists already, and is not as this command wrote it; give another folder with "
        "-o, or --overwrite to replace it"
    )


def forget(file: Path) -> None:
    """Remove a store from a folder that is locked.

    Raises
    ------
    OutputError
        It cannot be removed, or is read by this command.
    """
    refuse_kept([file])
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
    return not store.connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]


def _create(store: Store, identity: Identity) -> None:
    """Make the tables and say in them what the runs are, all or nothing."""
    about = {
        "schema": schema.VERSION,
        "version": __version__,
        "name": identity.name,
        "fingerprint": identity.fingerprint,
        "runs": str(identity.runs),
        "chunks": str(identity.chunks),
    } | {f"{_SETTING}{name}": value for name, value in identity.settings.items()}
    if identity.code:
        about["code"] = json.dumps(identity.code)
    # Of an inventory without a sweep there is nothing to be looked for in a million buildings.
    buildings = identity.buildings
    is_varied = not isinstance(buildings, RowBuildings) or buildings.rows.is_varied
    if any(varied := [dict(building.varied) for building in buildings] if is_varied else []):
        about["varied"] = json.dumps(varied)
    records = (
        (
            number,
            _text(motion.name),
            _text(motion.component),
            motion.direction,
            (record := motion.record).dt,
            record.acceleration.size,
            record.pga,
            measure(record).pgv,
            record.digest,
        )
        for number, motion in enumerate(identity.motions)
    )
    with transaction(store.connection, store.name):
        for statement in schema.TABLES:
            store.connection.execute(statement)
        store.connection.executemany("INSERT INTO meta VALUES(?, ?)", about.items())
        store.connection.executemany(
            "INSERT INTO records VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)", records
        )
        store.seal()


def _text(name: str) -> str:
    """A name as a database takes it: bytes of a file's name that are no UTF-8 are written out."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
