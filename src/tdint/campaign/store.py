"""Store of a campaign or study: one SQLite file, to which one process writes chunk by chunk."""

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
    NO_LIMITS,
    BuildingLimits,
    Buildings,
    RowBuildings,
    digests_of,
    limits_of_text,
    limits_text,
    model_files,
    output_units,
    plugin_files,
)
from tdint.campaign.fragility.type_states import Damage
from tdint.campaign.pairs import LARGER, PairRule, recording_numbers
from tdint.campaign.plan import Plan
from tdint.campaign.store_schema import (
    CLOSE_WAIT,
    UntrustedStoreError,
    connect,
    connect_to_read,
    sqlite_errors_reported,
    transaction,
)
from tdint.errors import OutputError, UsageError
from tdint.files import digest_of, is_file, is_there, protect_input, refuse_protected
from tdint.ground_motion.measures import measure
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.system import __version__
from tdint.units import SI, OutputUnits, parse_output_units

# ---- Identity of a store: everything that its runs depend on, and the differences between two

_MAX_LISTED_DIFFERENCES = 8  # lines of a message; users do not read longer lists


@dataclass(frozen=True)
class Identity:
    """Identity and metadata of the runs in a store.

    Attributes
    ----------
    name : str
        Name of the campaign or study.
    kind : str
        Type of study for messages, such as `campaign`.
    settings : dict
        Settings that apply to all runs: JSON texts by name.
    buildings, motions : sequence
        Buildings and ground motions; the index is the number in the store.
    chunks, runs : int
        Number of chunks and of runs; 0 runs if the number depends on results.
    size : callable
        Function that returns the number of runs of a chunk, or None if the number depends on
        results.
    unused : sequence of tuple
        Inputs that could not be used: `record` or `building`, and the reason.
    units : OutputUnits
        Output units that the models request.
    damage : Damage or None
        Definition of the damage states.
    files : mapping of str to str
        SHA-256 of the model files, or of the files of the inventory, by name.
    outputs : sequence of str or None
        Tables to write; None: all tables.
    rates : mapping of str to float
        Annual rate of each event, 1/year, if specified.
    style : tuple of (str, str)
        Style of the figures, and the directory that relative paths of style sheets refer to.
    pair_demand : str or None
        Rule that combines the demands of the two components of a pair; None: the default.
    kept : sequence of int or None
        Numbers of the buildings of a shard, which are the only buildings in the store; None: all.
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
        """Return the identity of the store of a campaign.

        Parameters
        ----------
        plan : Plan
            Campaign.
        kept : sequence of int or None
            Numbers of the buildings in the store; None: all.
        """
        copied = (
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
            **{name: getattr(plan, name) for name in copied},
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
        """SHA-256 of the settings, the files of plug-ins if there are any, and the digests of all
        buildings and records in order. Stores with the same fingerprint contain the same runs."""
        digest_of_all = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode())
        if self.code:
            digest_of_all.update(json.dumps(["plug-ins", self.code]).encode())
        records = [motion.record.digest for motion in self.motions]
        for label, digests in (("buildings", digests_of(self.buildings)), ("records", records)):
            digest_of_all.update(label.encode())
            for digest in digests:
                digest_of_all.update(digest.encode())
        return digest_of_all.hexdigest()

    @property
    def sides(self) -> Sides:
        """Quantities that `all_differences` compares."""
        buildings = {building.name: building.digest for building in self.buildings}
        records: dict[str, str] = {}
        # Motions with the same name and component, such as the samples of a grid, are
        # distinguished by their numbers.
        for number, motion in enumerate(self.motions, start=1):
            name = f"{motion.name} {motion.component}"
            records[name if name not in records else f"{name} ({number})"] = motion.record.digest
        return self.settings, buildings, records, self.code


def as_json(settings: dict[str, Any]) -> dict[str, str]:
    """Return settings as JSON texts by name, as a store contains them."""
    return {name: json.dumps(value, sort_keys=True) for name, value in sorted(settings.items())}


def differences(
    before: dict[str, str], now: dict[str, str], *, kind: str, store: str, given: str
) -> list[str]:
    """List the differences between two mappings, one sentence each.

    Parameters
    ----------
    before, now : dict of str to str
        Values, or SHA-256, by name.
    kind : str
        Type of the entries: `setting`, `building`, `record` or `plug-in`. Only the values of
        settings are shown.
    store, given : str
        Labels of `before` and `now` in the sentences.
    """
    lines = []
    for name in dict.fromkeys([*before, *now]):
        if name not in now:
            lines.append(f"{kind} {name}: only in {store}")
        elif name not in before:
            lines.append(f"{kind} {name}: only in {given}")
        elif before[name] != now[name]:
            difference = (
                "differs"
                if kind != "setting"
                else f"{before[name]} in {store}, {now[name]} in {given}"
            )
            lines.append(f"{kind} {name}: {difference}")
    if len(lines) > _MAX_LISTED_DIFFERENCES:
        lines[_MAX_LISTED_DIFFERENCES:] = [
            f"and {len(lines) - _MAX_LISTED_DIFFERENCES} more differences of type {kind}"
        ]
    return lines


Sides = Sequence[Mapping[str, str]]
"""Settings, buildings, records and files of plug-ins: values or SHA-256 by name."""


INVENTORY_CHANGED = (
    "buildings: the inventory has changed between the calls for the shards; call `tdint campaign` "
    "for every shard with the same inventory"
)
"""Difference between two shards of a campaign."""


def all_differences(
    before: Sides,
    now: Sides,
    *,
    store: str = "the store",
    given: str,
    parts: bool = False,
    has_new_inventory: bool = False,
) -> str:
    """Return the differences between two stores or campaigns, one line each.

    Parameters
    ----------
    before, now : Sides
        Settings, buildings, records and plug-ins of the two sides.
    store, given : str
        Labels of `before` and `now` in the lines.
    parts : bool
        True if a side is a shard: only buildings that both sides contain are compared.
    has_new_inventory : bool
        True if the files of the inventory differ.
    """
    kinds = ("setting", "building", "record", "plug-in")
    lines = [INVENTORY_CHANGED] if parts and has_new_inventory else []
    for kind, stored, other in zip(kinds, before, now, strict=True):
        both = (
            stored.keys() & other.keys()
            if parts and kind == "building"
            else stored.keys() | other.keys()
        )
        sides = ({name: side[name] for name in side if name in both} for side in (stored, other))
        lines += differences(*sides, kind=kind, store=store, given=given)
    # If the fingerprints differ, but all listed quantities are equal, these are the remaining
    # reasons.
    other_reason = "the order of buildings or records differs"
    return "\n".join(lines or [INVENTORY_CHANGED if parts else other_reason])


# ---- Store

FILE = "campaign.sqlite"

_SETTING = "setting "  # prefix of the keys of settings in the table `meta`


class Store:
    """Open store.

    Attributes
    ----------
    connection : sqlite3.Connection
        Connection for queries that this class does not provide.
    name : str
        Path of the file, for messages.
    """

    def __init__(self, connection: sqlite3.Connection, name: str) -> None:
        self.connection = connection
        self.name = name

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, error: type[BaseException] | None, raised: BaseException | None, *_: object
    ) -> None:
        """Move the log of the database into the file, unless an error occurred, and close the
        store.

        Raises
        ------
        OutputError
            SQLite failed inside the `with` block; the message describes the error.
        """
        try:
            if isinstance(raised, sqlite3.Error | UnicodeDecodeError):
                with sqlite_errors_reported(self.name):
                    raise raised
            if error is None:
                # While another program reads the file, the log cannot be moved into it. The log
                # file is then kept next to the store.
                with sqlite_errors_reported(self.name), suppress(sqlite3.OperationalError):
                    self.connection.executescript(
                        f"PRAGMA busy_timeout={CLOSE_WAIT}; PRAGMA wal_checkpoint(TRUNCATE)"
                    )
        finally:
            self.connection.close()

    def meta(self, key: str) -> str:
        """Return a value of the table `meta`."""
        return str(
            self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()[0]
        )

    def settings(self) -> dict[str, str]:
        """Return the settings that apply to all runs, as JSON texts by name."""
        rows = self.connection.execute(
            "SELECT key, value FROM meta WHERE key LIKE 'setting %' ORDER BY key"
        )
        return {key.removeprefix(_SETTING): value for key, value in rows}

    def parameters(self) -> dict[str, Any]:
        """Return the settings that apply to all runs, as values by name."""
        return {name: json.loads(value) for name, value in self.settings().items()}

    def varied(self) -> list[dict[str, float]]:
        """Return the parameters that a sweep changed, for each building by its number. The list is
        empty without a sweep."""
        return list(json.loads(self._meta_or_none("varied") or "[]"))

    @property
    def checked(self) -> bool:
        """True if the errors of the demands are estimated."""
        return self.settings().get("check") == "true"

    def digests(self, table: str) -> dict[str, str]:
        """Return the SHA-256 of all buildings or all records by name."""
        name = "name" if table == "buildings" else "name || ' ' || component"
        return dict(self.connection.execute(f"SELECT {name}, sha256 FROM {table} ORDER BY id"))

    def code(self) -> dict[str, str]:
        """Return the SHA-256 of the files of plug-ins that the runs used, by name."""
        return dict(json.loads(self._meta_or_none("code") or "{}"))

    def sides(self) -> Sides:
        """Return the quantities that `all_differences` compares."""
        return self.settings(), self.digests("buildings"), self.digests("records"), self.code()

    def done(self) -> set[int]:
        """Return the numbers of the completed chunks."""
        return {number for (number,) in self.connection.execute("SELECT id FROM chunks")}

    def seconds(self) -> float:
        """Return the processor time of the completed chunks, s."""
        return float(self.connection.execute("SELECT total(seconds) FROM chunks").fetchone()[0])

    def statuses(self) -> dict[str, int]:
        """Return the number of runs of each status."""
        return dict(
            self.connection.execute(
                "SELECT status, count(*) FROM run_rows GROUP BY status ORDER BY status"
            )
        )

    def count(self, condition: str) -> int:
        """Return the number of runs that meet a condition on the columns of `run_rows`."""
        return int(
            self.connection.execute(f"SELECT count(*) FROM run_rows WHERE {condition}").fetchone()[
                0
            ]
        )

    def add(self, done: Done) -> None:
        """Write the rows of a chunk and mark the chunk as completed, in one transaction.

        Raises
        ------
        OutputError
            The disk is full, the file is corrupt, or another process is writing.
        """
        # The fields of `done.rows` are in the order of `ROW_TABLES`: runs, stories and events of
        # sequences. `plain` converts the values to the types of SQLite.
        by_table = zip(schema.ROW_TABLES, vars(done.rows).values(), strict=True)
        rows = [table.plain(table_rows) for table, table_rows in by_table]
        run_count, story_count = len(rows[0]), len(rows[1])
        number, seconds = done.number, float(done.seconds)
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            for table, table_rows in zip(schema.ROW_TABLES, rows, strict=True):
                table.insert(self.connection, table_rows, number)
            values = (
                number,
                run_count,
                story_count,
                seconds,
                schema.chunk_digest(number, seconds, *rows),
            )
            self.connection.execute("INSERT INTO chunks VALUES(?, ?, ?, ?, ?)", values)

    def heal(self, identity: Identity | None = None) -> int:
        """Remove the chunks that are corrupt or do not belong to this campaign, so that they are
        run again.

        Parameters
        ----------
        identity : Identity, optional
            Campaign. Without it, only checksums are verified.

        Returns
        -------
        int
            Number of chunks removed.

        Raises
        ------
        UntrustedStoreError
            The chunks cannot be removed.
        """
        with sqlite_errors_reported(self.name):
            # Compare the checksums of the stored rows, because rows may have been edited.
            bad = schema.damaged_chunks(self.connection)
            # A version of tdint that divides campaigns differently has stored chunks with other
            # runs.
            if identity is not None:
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
                raise UntrustedStoreError(self.name, "corrupt chunks of runs cannot be removed")
            return len(bad)

    def remove(self, chunks: Collection[int]) -> None:
        """Remove chunks, so that they are run again."""
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            for table, column in (
                *((item.name, "chunk") for item in schema.ROW_TABLES),
                ("chunks", "id"),
            ):
                self.connection.executemany(
                    f"DELETE FROM {table} WHERE {column} IS ?", ((item,) for item in chunks)
                )

    def is_ours(self, file: Path) -> bool:
        """Return True if a file exists and is unchanged since it was written from this store."""
        return is_file(file) and (file.name, digest_of(file)) in self.written()

    def refuse_foreign(self, files: Iterable[Path]) -> None:
        """Raise OutputError if one of the files exists and was not written from this store."""
        for file in files:
            if is_file(file) and not self.is_ours(file):
                raise foreign(file)

    def written(self) -> set[tuple[str, str]]:
        """Return name and SHA-256 of the files that were written from this store."""
        return (
            set()
            if is_empty(self)
            else set(self.connection.execute("SELECT file, sha256 FROM written"))
        )

    def will_write(self, files: Mapping[Path, str]) -> None:
        """Record names and SHA-256 of files before they are moved to their final paths."""
        new = {(file.name, digest) for file, digest in files.items()} - self.written()
        if new:
            with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
                self.connection.executemany("INSERT INTO written VALUES(?, ?)", sorted(new))

    def unused(self) -> dict[str, list[str]]:
        """Return the reasons for which records and buildings could not be used, one line each, in
        the entries `record` and `building`."""
        reasons: dict[str, list[str]] = {"record": [], "building": []}
        for kind, reason in self.connection.execute(
            "SELECT kind, reason FROM unused ORDER BY rowid"
        ):
            reasons.setdefault(kind, []).append(reason)
        return reasons

    def output_units(self) -> OutputUnits:
        """Return the output units that the models request."""
        units = self._meta_or_none("output_units")
        return parse_output_units(units) if units is not None else SI

    def update_metadata(self, identity: Identity) -> None:
        """Store metadata that the results of runs do not depend on: unused inputs, output units,
        damage states, limits, style of figures, files of models, and columns of an inventory."""
        buildings = identity.buildings
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
            "limits": "" if carried else limits_text(buildings),
            "periods": json.dumps(
                [] if carried else [building.subject().period for building in buildings]
            ),
        }
        # Usually the metadata are unchanged. Skip the transaction in this case, because it would
        # block other processes that read the store.
        stored_unused = [
            (kind, reason) for kind, reasons in self.unused().items() for reason in reasons
        ]
        is_same = all(self._meta_or_none(key) == value for key, value in values.items())
        stored_numbers = {
            number for (number,) in self.connection.execute("SELECT id FROM buildings")
        }
        new = sorted(
            set(range(len(buildings)) if identity.kept is None else identity.kept) - stored_numbers
        )
        if is_same and not new and sorted(stored_unused) == sorted(dict.fromkeys(identity.unused)):
            return
        types = identity.damage.buildings if identity.damage else ()
        # The checksum is updated in the same transaction, so that readers see a consistent state.
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            self.connection.execute("DELETE FROM unused")
            self.add_unused(identity.unused)
            self.connection.executemany("INSERT OR REPLACE INTO meta VALUES(?, ?)", values.items())
            # Rewrite the data of stored buildings that may have changed.
            add = self.connection.execute
            for table in () if is_same else ("inventory", "building_types"):
                add(f"DELETE FROM {table}")
            for number in new if is_same else sorted(stored_numbers.union(new)):
                item = buildings[number]
                if number not in stored_numbers:
                    about = (number, item.name, item.method, item.stories, item.digest)
                    add("INSERT INTO buildings VALUES(?, ?, ?, ?, ?)", about)
                if columns:
                    add("INSERT INTO inventory VALUES(?, ?)", (number, item.cells))
                if types:
                    add("INSERT INTO building_types VALUES(?, ?, ?, ?)", (number, *types[number]))
            self.seal()

    def inventory_columns(self) -> tuple[str, ...]:
        """Return the columns of the inventory that are copied to tables, as written in the
        inventory; empty without an inventory."""
        return tuple(json.loads(self.meta("inventory"))["columns"])

    def inventory_files(self) -> list[str]:
        """Return the SHA-256 of the files of the inventory; empty without an inventory."""
        if not json.loads(self._meta_or_none("inventory") or '{"columns": []}')["columns"]:
            return []
        return sorted(json.loads(self._meta_or_none("files") or "{}").values())

    def shards(self) -> list[str]:
        """Return the shards, as K/N, that were requested of this store."""
        return list(json.loads(self._meta_or_none("shards") or "[]"))

    def add_shard(self, text: str) -> None:
        """Record that a shard was requested, so that `merge` can report missing shards."""
        if text not in (shards := self.shards()):
            with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
                values = ("shards", json.dumps([*shards, text]))
                self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
                self.seal()

    def events(self) -> list[str]:
        """Return the events of ground motion fields. The numbers of samples count them from 1. The
        list is empty without fields."""
        return list(json.loads(self._meta_or_none("setting events") or "[]"))

    def carried(self, building: int) -> list[str]:
        """Return the cells of a building in the columns of the inventory that are copied to
        tables."""
        row = self.connection.execute(
            "SELECT cells FROM inventory WHERE building = ?", (building,)
        ).fetchone()
        return list(json.loads(row[0])) if row else []

    def _meta_or_none(self, key: str) -> str | None:
        """Return a value of the table `meta`, or None if the key does not exist."""
        row = self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return row[0] if row else None

    def files(self) -> dict[str, str]:
        """Return the SHA-256 of the model files, or of the files of the inventory, by name."""
        return dict(json.loads(self._meta_or_none("files") or "{}"))

    def writes(self, table: str) -> bool:
        """Return True if a table (`runs`, `damage` or `losses`) is to be written."""
        chosen = json.loads(self._meta_or_none("outputs") or "null")
        return chosen is None or table in chosen

    def style(self) -> tuple[str, str]:
        """Return the style of the figures, empty if not specified, and the directory that relative
        paths of style sheets refer to."""
        text, folder = json.loads(self._meta_or_none("style") or '["", ""]')
        return text, folder

    def pair_demand(self) -> str:
        """Return the rule that combines the components of pairs, an item of
        `tdint.campaign.pairs.PAIR_DEMANDS`."""
        return self._meta_or_none("pair_demand") or LARGER

    def pair_rule(self) -> PairRule:
        """Return the rule that combines the components of pairs, with the pairs of this store."""
        return PairRule(self.pair_demand(), recording_numbers(self.records()))

    def choose_pair_demand(self, demand: str) -> None:
        """Store the rule that combines the components of pairs."""
        if demand != self.pair_demand():
            with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
                values = ("pair_demand", demand)
                self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
                self.seal()

    def rates(self) -> dict[str, float]:
        """Return the annual rate of each event; empty if not specified."""
        return dict(json.loads(self._meta_or_none("rates") or "{}"))

    def period(self, building: int) -> float | None:
        """Return the first period of a building, s, or None if the store does not contain it."""
        periods = json.loads(self._meta_or_none("periods") or "[]")
        if building < len(periods):
            return float(periods[building])
        query = "SELECT period_s FROM building_types WHERE building = ?"
        row = self.connection.execute(query, (building,)).fetchone()
        return row and float(row[0])

    def limits(self, building: int) -> BuildingLimits:
        """Return the limits and the isolators of a building; empty for an inventory."""
        stored = self._limits
        return stored[building] if building < len(stored) else NO_LIMITS

    @property
    def has_limits(self) -> bool:
        """True if the model of a building has limits."""
        return any(building.limits for building in self._limits)

    @cached_property
    def _limits(self) -> list[BuildingLimits]:
        """Limits and isolators of each building by its number."""
        return limits_of_text(self._meta_or_none("limits") or "")

    def damage(self) -> str:
        """Return the text of `tdint.campaign.fragility.type_states.Damage.description`; empty
        without damage states."""
        return self._meta_or_none("damage") or ""

    def building_type(self, building: int) -> tuple[str, str, float, float]:
        """Return the name of a building and the values of its
        `tdint.campaign.fragility.type_states.BuildingType`."""
        query = (
            "SELECT b.name, t.type, t.divisor, t.period_s FROM buildings b JOIN building_types t "
            "ON t.building = b.id WHERE b.id = ?"
        )
        name, type_name, divisor, period = self.connection.execute(query, (building,)).fetchone()
        return name, type_name, divisor, period

    def add_unused(self, reasons: Iterable[tuple[str, str]]) -> None:
        """Add inputs that could not be used. The caller must call `seal` afterwards."""
        self.connection.executemany("INSERT OR IGNORE INTO unused VALUES(?, ?)", reasons)

    def seal(self) -> None:
        """Store the checksum of the campaign definition. Call this in the transaction that changes
        it."""
        values = (schema.SEAL, schema.seal_of(self.connection))
        self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)

    def runs(self) -> Iterator[tuple[Any, ...]]:
        """Yield the columns of `RUNS` for all runs, in the order of the key."""
        yield from self.connection.execute(schema.RUNS.select())

    def runs_of(self, chunk: int) -> list[RunRow]:
        """Return the runs of a chunk."""
        rows = self.connection.execute(schema.RUNS.select(where="WHERE chunk = ?"), (chunk,))
        return [schema.run_of(row) for row in rows]

    def stories(self) -> Iterator[tuple[Any, ...]]:
        """Yield the columns of `STORIES` for the stories of all runs, in the order of the key."""
        yield from self.connection.execute(schema.STORIES.select())

    def shocks(self) -> Iterator[tuple[Any, ...]]:
        """Yield the columns of `SHOCKS` for the events of all runs of sequences, in the order of
        the key."""
        yield from self.connection.execute(schema.SHOCKS.select())

    def buildings(self) -> Mapping[int, tuple[str, str]]:
        """Return name and method of each building by its number."""
        rows = self.connection.execute("SELECT id, name, method FROM buildings")
        return {number: (name, method) for number, name, method in rows}

    def records(self) -> Mapping[int, tuple[str, str, int]]:
        """Return name, component and direction of each ground motion by its number."""
        rows = self.connection.execute("SELECT id, name, component, direction FROM records")
        return {number: (name, component, direction) for number, name, component, direction in rows}


def open_store(
    folder: Path | None, plan: Plan, kept: Sequence[int] | None = None
) -> tuple[Store, list[str]]:
    """Open or create the store of a campaign. Errors are those of `open_or_begin`.

    Parameters
    ----------
    folder : Path or None
        Directory of the store; None: in memory.
    plan : Plan
        Campaign.
    kept : sequence of int, optional
        Numbers of the buildings of a shard; by default all buildings are in the store.

    Returns
    -------
    Store, list of str
        Store, and messages about it.
    """
    return open_or_begin(None if folder is None else folder / FILE, Identity.of(plan, kept))


def open_or_begin(
    file: Path | None, identity: Identity, *, log: bool = True
) -> tuple[Store, list[str]]:
    """Open the store in a file, or create it if the file does not exist.

    Parameters
    ----------
    file : Path or None
        Path of the store; None: in memory.
    identity : Identity
        Campaign or study that the store must contain.
    log : bool
        True if other processes read while the store is written (`connect`).

    Returns
    -------
    Store, list of str
        Store, and messages about it.

    Raises
    ------
    UsageError
        The file contains another campaign; the message lists the differences, one line each.
    OutputError
        The file cannot be written.
    """
    name = ":memory:" if file is None else str(file)
    with sqlite_errors_reported(name):
        store = Store(connect(name, log=log), name)
    with schema.closed_on_failure(store.connection):
        remarks = check_same(store, identity) if _has_contents(store) else None
        if remarks is None:
            with sqlite_errors_reported(name):
                _create(store, identity)
        elif healed := store.heal(identity):
            remarks.append(
                f"{name}: {healed} chunks of runs are corrupt or incomplete; they are run again"
            )
        store.update_metadata(identity)
    return store, remarks or []


def open_existing(folder: Path, *, write: bool = False) -> Store:
    """Open the store of a campaign in a directory. Its chunks are not verified (`check_chunks`).

    Parameters
    ----------
    folder : Path
        Directory of the campaign.
    write : bool
        True to open the store for writing.

    Raises
    ------
    UsageError
        The directory contains no campaign.
    OutputError
        The store cannot be used or trusted.
    """
    if not is_there(folder / FILE):
        raise UsageError(
            f"{folder}: no campaign in this directory ({FILE} not found); specify the directory "
            "that "
            "was the option -o of `tdint campaign`"
        )
    protect_input(folder / FILE)
    name = str(folder / FILE)
    with sqlite_errors_reported(name):
        store = Store(connect(name) if write else connect_to_read(folder / FILE), name)
    if not _has_contents(store):
        store.connection.close()
        raise UsageError(
            f"{folder}: the campaign in this directory has not started; call `tdint campaign` again"
        )
    return store


def open_written(file: Path) -> Store:
    """Open the store in a file that is written without a log, without changing it. Errors are those
    of `open_existing`."""
    with sqlite_errors_reported(str(file)):
        store = Store(connect(str(file), log=False), str(file))
    _has_contents(store)
    return store


def _has_contents(store: Store) -> bool:
    """Return True if a store has contents, which are then verified; close the store if they are
    invalid."""
    with schema.closed_on_failure(store.connection), sqlite_errors_reported(store.name):
        has_contents = not is_empty(store)
        if has_contents:
            schema.check_store(store.connection, store.name)
    return has_contents


def check_chunks(store: Store) -> None:
    """Raise OutputError if runs of a store are corrupt."""
    with sqlite_errors_reported(store.name):
        bad = schema.damaged_chunks(store.connection)
    if bad:
        raise OutputError(
            f"{store.name}: {len(bad)} chunks of runs are corrupt; call `tdint campaign FILE -o "
            f"{Path(store.name).parent}` again, which runs them again"
        )


def check_same(store: Store, identity: Identity) -> list[str]:
    """Check that a store contains the runs of a campaign.

    Parameters
    ----------
    store : Store
        Open store.
    identity : Identity
        Campaign that the store must contain.

    Returns
    -------
    list of str
        Messages about the store.

    Raises
    ------
    UsageError
        The store contains another campaign; the message lists the differences, one line each.
    """
    if identity.fingerprint != store.meta("fingerprint"):
        lines = all_differences(
            store.sides(),
            identity.sides,
            given=f"this {identity.kind}",
            parts=bool(store.shards()),
            has_new_inventory=store.inventory_files() not in ([], sorted(identity.files.values())),
        )
        raise UsageError(
            f"{store.name}: contains another {identity.kind}; give another directory with -o, or "
            "--overwrite to start again\n"
            f"{lines}"
        )
    version = store.meta("version")
    return (
        []
        if version == __version__
        else [f"{store.name}: created by tdint {version}, this is tdint {__version__}"]
    )


def foreign(file: Path) -> OutputError:
    """Return the error for an existing file that was not written from the store in its
    directory."""
    return OutputError(
        f"{file}: the file exists, but this command did not write it, or it was changed later; "
        "use another directory with -o, or add --overwrite to replace it"
    )


def forget(file: Path) -> None:
    """Remove a store from a locked directory.

    Raises
    ------
    OutputError
        The store cannot be removed, or is an input of this command.
    """
    refuse_protected([file])
    # SQLite creates files with these suffixes next to a database.
    for suffix in ("", "-wal", "-shm", "-journal"):
        remove(file.with_name(file.name + suffix))


def remove(file: Path) -> None:
    """Remove a file if it exists.

    Raises
    ------
    OutputError
        The file cannot be removed.
    """
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{file}: cannot remove the file: {error.strerror or error}") from None


def is_empty(store: Store) -> bool:
    """Return True if a store has no tables."""
    return not store.connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]


def _create(store: Store, identity: Identity) -> None:
    """Create the tables and store the definition of the runs, in one transaction."""
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
    # Buildings of an inventory without a sweep have no varied parameters. There may be millions of
    # these buildings, so do not query each of them.
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
    """Return a name as UTF-8 text; bytes of a file name that are not UTF-8 become escape
    sequences."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
