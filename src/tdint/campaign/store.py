"""Store the results of a campaign or study in an SQLite file.

A single process writes the file, one chunk of runs after another, so that an interrupted campaign
can continue from its completed chunks. Other processes can read the file at the same time.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

from tdint.analysis.run.load_case import LoadCase
from tdint.arrays import cached_property
from tdint.campaign import store_schema as schema
from tdint.campaign.batch import ChunkResult, RunRow
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
from tdint.campaign.store_differences import ComparedValues, all_differences, differences
from tdint.campaign.store_schema import (
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

# ---- Identity of a store: complete input of its runs


@dataclass(frozen=True)
class Identity:
    """Complete input of the runs in a store, and metadata of the runs.

    Attributes
    ----------
    study_type : str
        Type of study for messages, such as `campaign`.
    settings : dict
        Settings that apply to all runs: JSON texts by name.
    buildings, motions : sequence
        Buildings and ground motions. Their indices are their numbers in the tables of the store.
    chunks, runs : int
        Number of chunks and of runs; 0 runs if the number depends on results.
    size : callable
        Function that returns the number of runs of a chunk; None if the number depends on results.
    unused : sequence of (str, str)
        Inputs that could not be used: the category (`record` or `building`), and the reason.
    units : OutputUnits
        Output units that the models request.
    files : mapping of str to str
        SHA-256 of the model files, or of the files of the inventory, by name.
    rates : mapping of str to float
        Annual rate of each event, 1/year, if specified.
    style : tuple of (str, str)
        Style of the figures, and the directory that relative paths of style sheets refer to.
    pair_demand : str | None
        Rule that combines the demands of the two components of a pair; None: the default.
    building_numbers : sequence of int | None
        Numbers of the buildings that are written to the store, that is, of a shard; None: all.
    scaling : mapping
        File of the scale factors with rule and target; empty without such a file.
    """

    name: str
    study_type: str
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
    building_numbers: Sequence[int] | None = None
    scaling: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan, building_numbers: Sequence[int] | None) -> Identity:
        """Return the identity of the store of a campaign."""
        # Attributes that have the same name and meaning in `Plan` and `Identity`.
        plan_attributes = (
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
            "scaling",
        )
        return cls(
            **{name: getattr(plan, name) for name in plan_attributes},
            name=plan.name,
            study_type="campaign",
            settings=as_json(
                asdict(plan.settings) | plan.levels.description() | plan.assignment.description()
            ),
            units=output_units(plan.buildings),
            building_numbers=building_numbers,
            files=model_files(plan.buildings)
            | {
                entry.file: entry.sha256
                for motion in plan.motions
                if isinstance(motion.record, LoadCase)
                for entry in motion.record.inputs
            }
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
        hasher = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode())
        if self.code:
            hasher.update(json.dumps(["plug-ins", self.code]).encode())
        records = [motion.record.digest for motion in self.motions]
        for table, digests in (("buildings", digests_of(self.buildings)), ("records", records)):
            hasher.update(table.encode())
            for digest in digests:
                hasher.update(digest.encode())
        return hasher.hexdigest()

    @property
    def compared_values(self) -> ComparedValues:
        """Settings, and SHA-256 of buildings, records and plug-in files, by name.
        `all_differences` compares these values with the values of a store."""
        buildings = {stored_text(building.name): building.digest for building in self.buildings}
        records: dict[str, str] = {}
        # Motions with the same name and component, such as the samples of a grid, are
        # distinguished by their numbers, which are added to all names except the first.
        for number, motion in enumerate(self.motions, start=1):
            name = stored_text(f"{motion.name} {motion.component}")
            records[name if name not in records else f"{name} ({number})"] = motion.record.digest
        return self.settings, buildings, records, self.code


def as_json(settings: dict[str, Any]) -> dict[str, str]:
    """Return a dictionary from the name of each setting to its value as JSON text, the form in
    which a store contains settings."""
    return {name: json.dumps(value, sort_keys=True) for name, value in sorted(settings.items())}


# ---- Store

FILE = "campaign.sqlite"
"""File name of the store in the directory of a campaign."""

_SCALING = "scaling"
"""Key of the scaling of the ground motions in the table `meta`."""

_ORIGINS = "origins"
"""Key of the origins of motions in the table `meta`."""

_SETTING = "setting "  # prefix of the keys of settings in the table `meta`


class Store:
    """Open database with the definition and the runs of a campaign or study.

    Runs are written in chunks. As a context manager, the store closes the database.

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
        """Return the open store."""
        return self

    def __exit__(
        self, _: type[BaseException] | None, raised: BaseException | None, *__: object
    ) -> None:
        """Close the store. Unless SQLite failed, first move the write-ahead log into the file, so
        that the store can be read on a read-only medium. `raised` is the exception in the `with`
        block.

        Raises
        ------
        OutputError
            SQLite failed inside the `with` block; the message describes the error.
        """
        try:
            # Raise an error of SQLite again, so that it is converted to an OutputError.
            if isinstance(raised, sqlite3.Error | UnicodeDecodeError):
                with sqlite_errors_reported(self.name):
                    raise raised
            schema.end_log(self.connection)
        finally:
            self.connection.close()

    def meta(self, key: str) -> str:
        """Return the value of a key of the table `meta`, which must exist."""
        query = "SELECT value FROM meta WHERE key = ?"
        (value,) = self.connection.execute(query, (key,)).fetchone()
        return str(value)

    def origins(self) -> dict[str, dict[str, Any]]:
        """Return the origins of the motions that tdint wrote, by the number of the motion; empty
        without such motions."""
        return self._optional_meta(_ORIGINS)

    def scaling(self) -> dict[str, Any]:
        """Return the file of the scale factors with rule and target of `tdint scale`; empty without
        such a file."""
        return self._optional_meta(_SCALING)

    def _optional_meta(self, key: str) -> dict[str, Any]:
        """Return the mapping of a key of the table `meta`; empty if the key does not exist."""
        query = "SELECT value FROM meta WHERE key = ?"
        row = self.connection.execute(query, (key,)).fetchone()
        return dict(json.loads(row[0])) if row else {}

    def settings(self) -> dict[str, str]:
        """Return the settings of all runs as JSON texts by name."""
        rows = self.connection.execute(
            "SELECT key, value FROM meta WHERE key LIKE 'setting %' ORDER BY key"
        )
        return {key.removeprefix(_SETTING): value for key, value in rows}

    def parameters(self) -> dict[str, Any]:
        """Return the decoded settings of all runs by name."""
        return {name: json.loads(value) for name, value in self.settings().items()}

    def varied(self) -> list[dict[str, float]]:
        """Return a list with a single dictionary per building, in the order of the buildings: the
        values of the parameters that a sweep changed, by name. The list is empty without a sweep.
        """
        return list(json.loads(self._meta_or_none("varied") or "[]"))

    @property
    def checked(self) -> bool:
        """True if the campaign estimates the errors of the demands."""
        return self.settings().get("check") == "true"

    def digests(self, table: str) -> dict[str, str]:
        """Return the SHA-256 of the entries of `table` (`buildings` or `records`) by their names.
        The name of a record includes its component."""
        # In SQL, || joins texts.
        name = "name" if table == "buildings" else "name || ' ' || component"
        return dict(self.connection.execute(f"SELECT {name}, sha256 FROM {table} ORDER BY id"))

    def code(self) -> dict[str, str]:
        """Return the SHA-256 of the files of plug-ins that the runs used, by name."""
        return dict(json.loads(self._meta_or_none("code") or "{}"))

    def compared_values(self) -> ComparedValues:
        """Return settings, buildings, records and plug-ins, in the form that `all_differences`
        compares."""
        return self.settings(), self.digests("buildings"), self.digests("records"), self.code()

    def completed_chunks(self) -> set[int]:
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
        """Return the number of runs that meet a condition, an SQL expression of the columns of the
        table `run_rows` such as `status = 'done'`. The query contains it unchanged."""
        query = f"SELECT count(*) FROM run_rows WHERE {condition}"
        (count,) = self.connection.execute(query).fetchone()
        return int(count)

    def add(self, result: ChunkResult) -> None:
        """Write the rows of a chunk and mark the chunk as completed, in a single transaction.

        Raises
        ------
        OutputError
            The disk is full, the file is corrupt, or another process is writing.
        """
        # The fields of `result.rows` are in the order of `ROW_TABLES`. `plain` converts the values
        # to the types of SQLite.
        rows_by_table = [
            table.plain(rows)
            for table, rows in zip(schema.ROW_TABLES, vars(result.rows).values(), strict=True)
        ]
        runs, stories = rows_by_table[:2]
        number, seconds = result.number, float(result.seconds)
        digest = schema.chunk_digest(number, seconds, *rows_by_table)
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            for table, rows in zip(schema.ROW_TABLES, rows_by_table, strict=True):
                table.insert(self.connection, rows, number)
            values = (number, len(runs), len(stories), seconds, digest)
            self.connection.execute("INSERT INTO chunks VALUES(?, ?, ?, ?, ?)", values)

    def remove_invalid_chunks(self, identity: Identity | None = None) -> int:
        """Remove the chunks that are corrupt or do not belong to this campaign, so that they are
        run again.

        Parameters
        ----------
        identity : Identity, optional
            Campaign. Without it, only checksums are verified.

        Raises
        ------
        UntrustedStoreError
            The chunks cannot be removed.
        """
        with sqlite_errors_reported(self.name):
            # Verify the checksums of the rows, because rows may have been edited or be corrupt.
            invalid_chunks = schema.corrupt_chunks(self.connection)
            # Another version of tdint may have divided the campaign into different chunks: the
            # number of the chunk must exist, and the chunk must have the expected number of runs.
            if identity is not None:
                chunks = self.connection.execute("SELECT id, runs FROM chunks")
                for number, run_count in chunks:
                    is_number_valid = 0 <= number < identity.chunks
                    # The expected number of runs is None if it depends on results.
                    if not is_number_valid or identity.size(number) not in (None, run_count):
                        invalid_chunks.add(number)
            if not invalid_chunks:
                return 0
            self.remove(invalid_chunks)
            if schema.corrupt_chunks(self.connection):
                raise UntrustedStoreError(self.name, "corrupt chunks of runs cannot be removed")
            return len(invalid_chunks)

    def remove(self, chunks: Collection[int]) -> None:
        """Remove the chunks with the given numbers and all their rows, so that they are run
        again."""
        # Column with the number of the chunk, by table. Unlike `=`, the operator IS also selects
        # rows with the number NULL, which can result from corruption.
        number_columns = {table.name: "chunk" for table in schema.ROW_TABLES} | {"chunks": "id"}
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            for table, column in number_columns.items():
                statement = f"DELETE FROM {table} WHERE {column} IS ?"
                self.connection.executemany(statement, ((number,) for number in chunks))

    def is_ours(self, file: Path) -> bool:
        """Return True if a file exists, was written from this store, and was not changed
        afterwards."""
        return is_file(file) and (stored_text(file.name), digest_of(file)) in self.written()

    def refuse_foreign(self, files: Iterable[Path]) -> None:
        """Raise OutputError if one of the files exists and was not written from this store."""
        for file in files:
            if is_file(file) and not self.is_ours(file):
                raise foreign_file_error(file)

    def written(self) -> set[tuple[str, str]]:
        """Return the name and the SHA-256 of each file that was written from this store."""
        if is_empty(self):
            return set()
        return set(self.connection.execute("SELECT file, sha256 FROM written"))

    def record_written(self, files: Mapping[Path, str]) -> None:
        """Record that files are written from this store, so that `is_ours` recognizes them.

        The caller records the files before it moves them to their final paths.

        Parameters
        ----------
        files : mapping of Path to str
            SHA-256 of each file.
        """
        entries = {(stored_text(file.name), digest) for file, digest in files.items()}
        new_entries = entries - self.written()
        if new_entries:
            with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
                self.connection.executemany("INSERT INTO written VALUES(?, ?)", sorted(new_entries))

    def unused(self) -> dict[str, list[str]]:
        """Return the reasons for which inputs could not be used. The keys are `record` and
        `building`; each value is a list of reasons."""
        reasons: dict[str, list[str]] = {"record": [], "building": []}
        query = "SELECT kind, reason FROM unused ORDER BY rowid"
        for category, reason in self.connection.execute(query):
            reasons.setdefault(category, []).append(reason)
        return reasons

    def output_units(self) -> OutputUnits:
        """Return the output units that the models request."""
        units = self._meta_or_none("output_units")
        return parse_output_units(units) if units is not None else SI

    def update_metadata(self, identity: Identity) -> None:
        """Store the metadata that do not affect the results of runs, and add buildings that the
        store does not contain yet.

        The metadata are unused inputs, output units, damage states, limits, style of figures, files
        of models, and columns of an inventory. If they are unchanged, the store is not written.

        Raises
        ------
        OutputError
            The store cannot be written.
        """
        values = _metadata(identity)
        stored_unused = [
            (category, reason) for category, reasons in self.unused().items() for reason in reasons
        ]
        is_unchanged = all(self._meta_or_none(key) == value for key, value in values.items())
        query = "SELECT id FROM buildings"
        stored_numbers = {number for (number,) in self.connection.execute(query)}
        required_numbers = identity.building_numbers
        if required_numbers is None:
            required_numbers = range(len(identity.buildings))
        new_numbers = sorted(set(required_numbers) - stored_numbers)
        # Usually the metadata are unchanged. Skip the transaction in this case, because it would
        # block other processes that read the store.
        unused = {(category, stored_text(reason)) for category, reason in identity.unused}
        is_unused_same = sorted(stored_unused) == sorted(unused)
        if is_unchanged and not new_numbers and is_unused_same:
            return
        # The checksum is updated in the same transaction, so that readers see a consistent state.
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            self.connection.execute("DELETE FROM unused")
            self.add_unused(identity.unused)
            self.connection.executemany("INSERT OR REPLACE INTO meta VALUES(?, ?)", values.items())
            if is_unchanged:
                changed_numbers = new_numbers
            else:  # rewrite the data of all buildings, because they may have changed
                changed_numbers = sorted(stored_numbers.union(new_numbers))
                self.connection.execute("DELETE FROM inventory")
                self.connection.execute("DELETE FROM building_types")
            self._insert_buildings(identity, changed_numbers, stored_numbers)
            self.seal()

    def _insert_buildings(
        self, identity: Identity, numbers: Sequence[int], stored_numbers: Collection[int]
    ) -> None:
        """Insert the rows of buildings in the tables `buildings`, `inventory` (cells of the columns
        that are copied to tables) and `building_types`. The caller opens the transaction.

        `stored_numbers` contains the numbers of the buildings that the table `buildings` already
        contains.
        """
        buildings, insert = identity.buildings, self.connection.execute
        has_columns = isinstance(buildings, RowBuildings) and bool(buildings.rows.titles)
        types = identity.damage.buildings if identity.damage else ()
        for number in numbers:
            building = buildings[number]
            if number not in stored_numbers:
                insert(
                    "INSERT INTO buildings VALUES(?, ?, ?, ?, ?)",
                    (
                        number,
                        stored_text(building.name),
                        building.method,
                        building.stories,
                        building.digest,
                    ),
                )
            if has_columns:
                insert("INSERT INTO inventory VALUES(?, ?)", (number, building.cells))
            if types:
                insert("INSERT INTO building_types VALUES(?, ?, ?, ?)", (number, *types[number]))

    def inventory_columns(self) -> tuple[str, ...]:
        """Return the columns of the inventory that are copied to tables, as written in the
        inventory; empty without an inventory."""
        return tuple(json.loads(self.meta("inventory"))["columns"])

    def inventory_files(self) -> list[str]:
        """Return the SHA-256 of the files of the inventory; empty without an inventory."""
        # The key `files` has model files instead if the campaign has no inventory.
        if not json.loads(self._meta_or_none("inventory") or '{"columns": []}')["columns"]:
            return []
        return sorted(json.loads(self._meta_or_none("files") or "{}").values())

    def shards(self) -> list[str]:
        """Return the shards, each as text K/N, that were written to this store; empty if the
        campaign was not divided."""
        return list(json.loads(self._meta_or_none("shards") or "[]"))

    def add_shard(self, text: str) -> None:
        """Record that a shard is written to this store, so that `merge` can report missing shards.
        `text` is the number of the shard and the number of shards, for example `2/5`."""
        if text not in (shards := self.shards()):
            with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
                values = ("shards", json.dumps([*shards, text]))
                self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
                self.seal()

    def time_loops(self) -> str | None:
        """Return how the time loops of the runs were executed: `compiled`, or `interpreted` if this
        applies to some of them; None without runs."""
        return self._meta_or_none("time_loops")

    def record_time_loops(self, execution: str | None) -> None:
        """Record how the time loops of the following runs are executed; see `time_loops`. None
        means that this process executes none."""
        if execution is not None and self.time_loops() not in (execution, "interpreted"):
            with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
                values = ("time_loops", execution)
                self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
                self.seal()

    def events(self) -> list[str]:
        """Return the names of the events of ground motion fields. The sample number of a run is the
        number of its event, from 1. The list is empty without fields."""
        return list(json.loads(self._meta_or_none("setting events") or "[]"))

    def copied_cells(self, building: int) -> list[str]:
        """Return the cells of the row of a building in the columns of the inventory that are copied
        to tables; empty if there are none."""
        row = self.connection.execute(
            "SELECT cells FROM inventory WHERE building = ?", (building,)
        ).fetchone()
        return list(json.loads(row[0])) if row else []

    def _meta_or_none(self, key: str) -> str | None:
        """Return the value of a key of the table `meta`; None if the key does not exist."""
        row = self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return row[0] if row else None

    def files(self) -> dict[str, str]:
        """Return the SHA-256 of the model files, or of the files of the inventory, by name."""
        return dict(json.loads(self._meta_or_none("files") or "{}"))

    def is_requested(self, table: str) -> bool:
        """Return True if a table (`runs`, `damage` or `losses`) must be written. By default all
        tables are written."""
        requested_tables = json.loads(self._meta_or_none("outputs") or "null")
        return requested_tables is None or table in requested_tables

    def style(self) -> tuple[str, str]:
        """Return the style of the figures, empty if not specified, and the base
        directory of relative paths of style sheets."""
        text, folder = json.loads(self._meta_or_none("style") or '["", ""]')
        return text, folder

    def pair_demand(self) -> str:
        """Return the rule that combines the components of pairs, an item of
        `tdint.campaign.pairs.PAIR_DEMANDS`."""
        return self._meta_or_none("pair_demand") or LARGER

    def pair_rule(self) -> PairRule:
        """Return the rule that combines the components of pairs, with the pairs of the store."""
        return PairRule(self.pair_demand(), recording_numbers(self.records()))

    def choose_pair_demand(self, rule: str) -> None:
        """Write the rule that combines the demands of the components of pairs to the store, unless
        the store already has this rule. `rule` is an item of
        `tdint.campaign.pairs.PAIR_DEMANDS`."""
        if rule != self.pair_demand():
            with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
                values = ("pair_demand", rule)
                self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
                self.seal()

    def rates(self) -> dict[str, float]:
        """Return the annual rate of each event; empty if not specified."""
        return dict(json.loads(self._meta_or_none("rates") or "{}"))

    def period(self, building: int) -> float | None:
        """Return the first period of a building, s; None if the store does not contain it.
        `building` is the number of the building."""
        periods = json.loads(self._meta_or_none("periods") or "[]")
        if building < len(periods):
            return float(periods[building])
        # For an inventory, the periods are stored with the building types, if damage was requested.
        query = "SELECT period_s FROM building_types WHERE building = ?"
        row = self.connection.execute(query, (building,)).fetchone()
        return row and float(row[0])

    def limits(self, building: int) -> BuildingLimits:
        """Return the limits and the isolators of the building with this number; empty for an
        inventory."""
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
        """Return the definition of the damage states as JSON text; empty without damage states."""
        return self._meta_or_none("damage") or ""

    def building_type(self, building: int) -> tuple[str, str, float, float]:
        """Return the properties of a building for the computation of its damage.

        Returns
        -------
        tuple of (str, str, float, float)
            Name of the building; name of its type; divisor that converts a peak to the demand of
            the damage states (`BuildingType`); first period, s.
        """
        query = (
            "SELECT b.name, t.type, t.divisor, t.period_s FROM buildings b JOIN building_types t "
            "ON t.building = b.id WHERE b.id = ?"
        )
        name, type_name, divisor, period = self.connection.execute(query, (building,)).fetchone()
        return name, type_name, divisor, period

    def add_unused(self, reasons: Iterable[tuple[str, str]]) -> None:
        """Store inputs that could not be used. Each item is the category of the input (`record` or
        `building`) and the reason. The caller must call `seal` afterwards."""
        rows = ((category, stored_text(reason)) for category, reason in reasons)
        self.connection.executemany("INSERT OR IGNORE INTO unused VALUES(?, ?)", rows)

    def seal(self) -> None:
        """Store the checksum of the campaign definition. Call this method in each transaction that
        changes the definition, otherwise the store is refused as edited."""
        values = (schema.SEAL, schema.seal_of(self.connection))
        self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)

    def runs(self) -> Iterator[tuple[Any, ...]]:
        """Yield one tuple per run, with the values of the columns of `store_schema.RUNS`, in the
        order of its key."""
        yield from self.connection.execute(schema.RUNS.select())

    def runs_of(self, chunk: int) -> list[RunRow]:
        """Return the rows of the runs of the chunk with this number."""
        rows = self.connection.execute(schema.RUNS.select(where="WHERE chunk = ?"), (chunk,))
        return [schema.run_of(row) for row in rows]

    def stories(self) -> Iterator[tuple[Any, ...]]:
        """Yield one tuple per story and run, with the values of the columns of
        `store_schema.STORIES`, in the order of its key."""
        yield from self.connection.execute(schema.STORIES.select())

    def elements(self) -> Iterator[tuple[Any, ...]]:
        """Yield one tuple per element and run, with the values of the columns of
        `store_schema.ELEMENTS`, in the order of its key."""
        yield from self.connection.execute(schema.ELEMENTS.select())

    def shocks(self) -> Iterator[tuple[Any, ...]]:
        """Yield one tuple per event and run under a sequence of earthquakes, with the values of the
        columns of `store_schema.SHOCKS`, in the order of its key."""
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
    folder: Path | None, plan: Plan, building_numbers: Sequence[int] | None = None
) -> tuple[Store, list[str]]:
    """Open or create the store of a campaign.

    Parameters
    ----------
    folder : Path | None
        Directory of the store; None: in memory.
    building_numbers : sequence of int, optional
        Numbers of the buildings of a shard; by default all buildings are in the store.

    Returns
    -------
    Store, list of str
        Store, and messages for the user, for example about chunks that are run again.

    Raises
    ------
    AnotherStudyError
        The directory contains another campaign; the message has one line per difference.
    OutputError
        The store cannot be written.
    """
    return open_or_create(
        None if folder is None else folder / FILE, Identity.of(plan, building_numbers)
    )


def open_or_create(file: Path | None, identity: Identity) -> tuple[Store, list[str]]:
    """Open the store in a file, or create it if the file does not exist.

    Results and errors are those of `open_store`.

    Parameters
    ----------
    file : Path | None
        Path of the store; None: in memory.
    identity : Identity
        Campaign or study that the store must contain.
    """
    name = ":memory:" if file is None else str(file)
    with sqlite_errors_reported(name):
        store = Store(connect(name), name)
    with schema.closed_on_failure(store.connection), sqlite_errors_reported(name):
        # `remarks` is None if the file is new or empty.
        remarks = check_same(store, identity) if _has_contents(store) else None
        if remarks is None:
            _create(store, identity)
        elif removed_count := store.remove_invalid_chunks(identity):
            remarks.append(
                f"{name}: {removed_count} chunks of runs are corrupt or incomplete; they are run "
                "again"
            )
        store.update_metadata(identity)
    return store, remarks or []


def open_existing(folder: Path, *, write: bool = False) -> Store:
    """Open the store of a campaign in a directory. Its chunks are not verified (`check_chunks`).

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
            "that was specified with -o of `tdint campaign`"
        )
    protect_input(folder / FILE)
    if write and not os.access(folder, os.W_OK):
        raise OutputError(
            f"{folder}: no permission to write to the directory; copy it, or call `tdint campaign "
            f"merge {folder} -o DIR`, which writes the tables to another directory"
        )
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
    """Open the store of a study for writing, and verify it.

    Raises
    ------
    OutputError
        The store cannot be used or trusted.
    """
    with sqlite_errors_reported(str(file)):
        store = Store(connect(str(file)), str(file))
    _has_contents(store)  # raises the error of a store with invalid contents
    return store


def _has_contents(store: Store) -> bool:
    """Verify a store, and return True if it has contents. If they are invalid, the store is closed
    and OutputError is raised.
    """
    with schema.closed_on_failure(store.connection), sqlite_errors_reported(store.name):
        has_contents = not is_empty(store)
        if has_contents:
            schema.check_store(store.connection, store.name)
    return has_contents


def check_chunks(store: Store) -> None:
    """Raise OutputError if chunks of runs in a store do not match their checksums."""
    with sqlite_errors_reported(store.name):
        corrupt = schema.corrupt_chunks(store.connection)
    if corrupt:
        raise OutputError(
            f"{store.name}: {len(corrupt)} chunks of runs are corrupt; call `tdint campaign FILE "
            f"-o {Path(store.name).parent}` again, which runs them again"
        )


def check_same(store: Store, identity: Identity) -> list[str]:
    """Check that a store contains the runs of a campaign.

    Returns
    -------
    list of str
        A message if another version of tdint created the store; otherwise empty.

    Raises
    ------
    AnotherStudyError
        The store contains another campaign; the message has one line per difference.
    """
    # An empty list of `inventory_files` represents a store without an inventory.
    if identity.fingerprint != store.meta("fingerprint"):
        differences_text = all_differences(
            store.compared_values(),
            identity.compared_values,
            compared_label=f"this {identity.study_type}",
            are_shards=bool(store.shards()),
            has_new_inventory=store.inventory_files() not in ([], sorted(identity.files.values())),
        )
        changed = ""
        if identity.study_type == "campaign" and not obstacle_to_reuse(store, identity):
            changed = "--changed to keep the results of unchanged records and buildings, "
        raise schema.AnotherStudyError(
            f"{store.name}: contains another {identity.study_type}; specify another directory with "
            f"-o, {changed}or --overwrite to start again\n"
            f"{differences_text}"
        )
    version = store.meta("version")
    if version == __version__:
        return []
    return [f"{store.name}: created by tdint {version}, this is tdint {__version__}"]


def obstacle_to_reuse(store: Store, identity: Identity) -> str:
    """Return the reason for which no result of a store can be used in a campaign with other records
    or buildings; empty if there is none."""
    if identity.building_numbers is not None or store.shards():
        return "the directory contains a part of a campaign (--shard)"
    if store.settings().keys() >= {"tolerance"} and store.parameters()["tolerance"] is not None:
        return "with `tolerance`, the time step of a building depends on all its records"
    if (version := store.meta("version")) != __version__:
        return f"it was created by tdint {version}, this is tdint {__version__}"
    labels = {"stored_label": "the store", "compared_label": "this campaign"}
    lines = differences(store.settings(), identity.settings, entry_type="setting", **labels)
    lines += differences(store.code(), identity.code, entry_type="plug-in", **labels)
    return "; ".join(lines)


def foreign_file_error(file: Path) -> OutputError:
    """Return the error for an existing file that was not written from the store in its
    directory."""
    return OutputError(
        f"{file}: the file exists, but this command did not write it, or it was changed later; "
        "use another directory with -o, or add --overwrite to replace it"
    )


def remove_store(file: Path) -> None:
    """Remove the file of a store and its log files. The caller has locked the directory.

    Raises
    ------
    OutputError
        The store cannot be removed, or is an input of the command.
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
    """Create the tables of an empty store, and write the definition of a campaign or study
    (`identity`), in a single transaction.

    The buildings are written later, by `Store.update_metadata`.
    """
    metadata = {
        "schema": schema.VERSION,
        "version": __version__,
        "name": stored_text(identity.name),
        "fingerprint": identity.fingerprint,
        "runs": str(identity.runs),
        "chunks": str(identity.chunks),
    } | {f"{_SETTING}{name}": value for name, value in identity.settings.items()}
    if identity.code:
        metadata["code"] = json.dumps(identity.code)
    # Few campaigns have motions that tdint wrote. Their origins are the values of a dictionary, in
    # which the keys are the numbers of the motions.
    origins = {
        number: {"origin": motion.record.origin.summary}
        for number, motion in enumerate(identity.motions)
        if motion.record.origin
    }
    if origins:
        metadata[_ORIGINS] = json.dumps(origins)
    if identity.scaling:
        metadata[_SCALING] = json.dumps(identity.scaling)
    # Buildings of an inventory without a sweep have no varied parameters. There may be millions of
    # these buildings, so do not query each building.
    buildings = identity.buildings
    if not isinstance(buildings, RowBuildings) or buildings.rows.is_varied:
        varied_parameters = [dict(building.varied) for building in buildings]
        if any(varied_parameters):
            metadata["varied"] = json.dumps(varied_parameters)
    with transaction(store.connection, store.name):
        for statement in schema.TABLES:
            store.connection.execute(statement)
        store.connection.executemany("INSERT INTO meta VALUES(?, ?)", metadata.items())
        store.connection.executemany(
            "INSERT INTO records VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)", _record_rows(identity.motions)
        )
        store.seal()


def _record_rows(motions: Sequence[SuiteMotion]) -> Iterator[tuple[Any, ...]]:
    """Yield the row of the table `records` for each ground motion: number, name, component,
    direction, sampling interval (s), number of samples, PGA (m/s^2), PGV (m/s) and SHA-256. A load
    case has no samples; its other numbers are 0."""
    for number, motion in enumerate(motions):
        record = motion.record
        names = number, stored_text(motion.name), stored_text(motion.component), motion.direction
        if isinstance(record, LoadCase):
            yield (*names, 0.0, 0, 0.0, 0.0, record.digest)
            continue
        yield (
            *names,
            record.dt,
            record.acceleration.size,
            record.pga,
            measure(record).pgv,
            record.digest,
        )


def _metadata(identity: Identity) -> dict[str, str]:
    """Return the metadata of a campaign or study (`identity`) that do not affect the results of
    runs, as texts by their keys in the table `meta`."""
    buildings = identity.buildings
    rows = buildings.rows if isinstance(buildings, RowBuildings) else None
    # The SHA-256 includes the cells of the columns that are copied to tables.
    columns, inventory_digest = (rows.titles, rows.digest(carried=True)) if rows else ((), "")
    # An inventory has no limits, and its periods are stored with the building types.
    periods = [] if inventory_digest else [building.subject().period for building in buildings]
    return {
        "inventory": json.dumps({"columns": columns, "sha256": inventory_digest}),
        "output_units": str(identity.units),
        "damage": identity.damage.description() if identity.damage else "",
        "files": json.dumps(dict(identity.files)),
        "outputs": json.dumps(identity.outputs),
        "rates": json.dumps(dict(identity.rates)),
        "style": json.dumps(identity.style),
        "pair_demand": identity.pair_demand or LARGER,
        "limits": "" if inventory_digest else limits_text(buildings),
        "periods": json.dumps(periods),
    }


def stored_text(name: str) -> str:
    """Return a name as text that SQLite can store. A file name can contain bytes that are not
    UTF-8, which Python represents by surrogates; they become escape sequences such as \\xff."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
