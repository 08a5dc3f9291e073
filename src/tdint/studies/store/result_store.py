"""Store the results of a campaign or study in an SQLite file.

A single process writes the file, one chunk of runs after another, so that an interrupted campaign
can continue from its completed chunks. Other processes can read the file at the same time.

Complete input of the runs in a store, which identifies the store, and metadata of the runs.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Self, cast

import numpy as np

from tdint.arrays import Array, cached_property
from tdint.errors import OutputError
from tdint.files import digest_of, is_file
from tdint.ground_motion.axes import intensity_of, pga_of
from tdint.ground_motion.measures import measure
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.items import grouped
from tdint.output.tables.runs import si_units_of
from tdint.output.tables.table import Column, names
from tdint.response.pairs import LARGER, PairRule, Run, recording_numbers
from tdint.response.runs.load_case import LoadCase
from tdint.studies.campaign.buildings import (
    NO_LIMITS,
    BuildingLimits,
    Buildings,
    RowBuilding,
    RowBuildings,
    digests_of,
    limits_of_text,
    limits_text,
    model_files,
    models_of,
    output_units,
    plugin_files,
)
from tdint.studies.campaign.chunks import ChunkResult, Rows, RunRow
from tdint.studies.campaign.plan import Plan
from tdint.studies.fragility.type_states import Damage
from tdint.studies.store import schema
from tdint.studies.store.schema import UntrustedStoreError, sqlite_errors_reported, transaction
from tdint.system import __version__
from tdint.units import SI, OutputUnits, parse_output_units


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
    style : str
        Style of the figures.
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
    style: str = ""
    pair_demand: str | None = None
    building_numbers: Sequence[int] | None = None
    scaling: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan, building_numbers: Sequence[int] | None) -> Identity:
        """Return the identity of the store of a campaign."""
        # Attributes that have the same name and meaning in `Plan` and `Identity`.
        attributes = {
            item.name: getattr(plan, item.name) for item in fields(cls) if hasattr(plan, item.name)
        }
        attributes |= {
            "study_type": "campaign",
            "settings": as_json(
                asdict(plan.settings)
                | plan.levels.description()
                | plan.assignment.description()
                | ({"vary_units": dict(plan.vary_units)} if plan.vary_units else {})
            ),
            "units": output_units(plan.buildings),
            "building_numbers": building_numbers,
            "files": model_files(plan.buildings)
            | {
                entry.file: entry.sha256
                for motion in plan.motions
                if isinstance(motion.record, LoadCase)
                for entry in motion.record.inputs
            }
            | {file: digest_of(Path(file)) for file in plan.inventory},
        }
        return cls(**attributes)

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


def metadata_of(identity: Identity) -> dict[str, str]:
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


_MAX_LISTED_DIFFERENCES = 8
"""Maximum number of differences in a message, for each type of entry, so that the message is
readable."""


def differences(
    stored: Mapping[str, str], compared: Mapping[str, str], entry_type: str, labels: tuple[str, str]
) -> list[str]:
    """Describe the differences between two mappings by at most eight lines, followed by a line
    with the number of further differences if there are more.

    Parameters
    ----------
    stored, compared : mapping of str to str
        The mappings: values, or SHA-256, by name.
    entry_type : str
        Type of the entries: `setting`, `building`, `record` or `plug-in`. Only the values of
        settings are shown.
    labels : tuple of str
        Labels of `stored` and `compared` in the lines, for example `the store`.
    """
    lines = []
    stored_label, compared_label = labels
    # All names of both mappings without duplicates, in the order of `stored`
    for name in dict.fromkeys([*stored, *compared]):
        if name not in compared:
            lines.append(f"{entry_type} {name}: only in {stored_label}")
        elif name not in stored:
            lines.append(f"{entry_type} {name}: only in {compared_label}")
        elif stored[name] != compared[name]:
            difference = "differs"
            if entry_type == "setting":
                difference = (
                    f"{stored[name]} in {stored_label}, {compared[name]} in {compared_label}"
                )
            lines.append(f"{entry_type} {name}: {difference}")
    if len(lines) > _MAX_LISTED_DIFFERENCES:
        lines[_MAX_LISTED_DIFFERENCES:] = [
            f"and {len(lines) - _MAX_LISTED_DIFFERENCES} more differences of type {entry_type}"
        ]
    return lines


ComparedValues = Sequence[Mapping[str, str]]
"""Four mappings by name: values of the settings, and SHA-256 of the buildings, the records and the
files of plug-ins."""


INVENTORY_CHANGED = (
    "buildings: the inventory has changed between the calls for the shards; call `tdint campaign` "
    "for every shard with the same inventory"
)
"""Difference between two shards of a campaign."""


def all_differences(
    stored: ComparedValues,
    compared: ComparedValues,
    labels: tuple[str, str],
    *,
    are_shards: bool = False,
    has_new_inventory: bool = False,
) -> str:
    """Return a text that describes the differences between two stores or campaigns, one per line.

    Parameters
    ----------
    are_shards : bool
        True if `stored` or `compared` is a shard. A shard contains only some of the buildings, so
        only buildings that both contain are compared.
    has_new_inventory : bool
        True if the files of the inventory differ.
    """
    entry_types = ("setting", "building", "record", "plug-in")
    lines = [INVENTORY_CHANGED] if are_shards and has_new_inventory else []
    if (units := compared[0].get("vary_units")) and "vary_units" not in stored[0]:
        lines.append(
            f"numbers of vary are in units of the models, {units}; in the store they are in SI "
            "units (of an earlier version), or it has none"
        )
    for entry_type, first, second in zip(entry_types, stored, compared, strict=True):
        if are_shards and entry_type == "building":
            common_names = first.keys() & second.keys()
            first = {name: first[name] for name in first if name in common_names}
            second = {name: second[name] for name in second if name in common_names}
        lines += differences(first, second, entry_type, labels)
    # This function is called if the fingerprints differ. If all compared values are equal, the
    # reason is the inventory from which the shards are derived, or the order of the entries.
    remaining_reason = (
        INVENTORY_CHANGED if are_shards else "the order of buildings or records differs"
    )
    return "\n".join(lines or [remaining_reason])


FILE = "campaign.sqlite"
"""File name of the store in the directory of a campaign."""


_SETTING = "setting "  # prefix of the keys of settings in the table `meta`


def _stored(key: str, default: Any = None) -> Callable[[Store], Any]:
    """Return a method of `Store` that reads a JSON value of the table `meta`."""
    return lambda store: json.loads(store._meta_or_none(key) or json.dumps(default))


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

    origins = _stored("origins", {})  # of motions, by the number of the record
    scaling = _stored("scaling", {})  # of ground motions by a table of factors
    varied = _stored("varied", [])  # changed parameters of each building of a sweep
    varied_units = _stored("varied_units", {})  # SI units of the changed parameters
    code = _stored("code", {})  # SHA-256 of plug-ins
    files = _stored("files", {})  # SHA-256 of input files
    rates = _stored("rates", {})  # annual rates by event
    events = _stored("setting events", [])
    shards = _stored("shard_runs", {})  # number of runs of each shard in this store, by K/N
    style = _stored("style", "")
    outputs = _stored("outputs")  # requested tables; None for all

    def damage(self) -> str:
        """Return the damage states as JSON; empty without damage states."""
        return self._meta_or_none("damage") or ""

    def pair_demand(self) -> str:
        """Return the rule for the demand of a pair."""
        return self._meta_or_none("pair_demand") or LARGER

    def grouped_by(self) -> str | None:
        """Return the column of the inventory by which losses are grouped; None without groups."""
        return self._meta_or_none("by")

    def time_loops(self) -> str | None:
        """Return how the time loops of the runs were executed: `compiled`, or `interpreted` if this
        applies to some of them; None without runs."""
        return self._meta_or_none("time_loops")

    def value(self, query: str, *arguments: object) -> Any:
        """Return the first value of the first row of a query; None without rows."""
        row = self.connection.execute(query, arguments).fetchone()
        return row and row[0]

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
        """Return a value of the table `meta`, which must have the key."""
        return str(self.value("SELECT value FROM meta WHERE key = ?", key))

    def settings(self) -> dict[str, str]:
        """Return the settings of all runs as JSON texts by name."""
        rows = self.connection.execute(
            "SELECT key, value FROM meta WHERE key LIKE 'setting %' ORDER BY key"
        )
        return {key.removeprefix(_SETTING): value for key, value in rows}

    def parameters(self) -> dict[str, Any]:
        """Return the decoded settings of all runs by name."""
        return {name: json.loads(value) for name, value in self.settings().items()}

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

    def compared_values(self) -> ComparedValues:
        """Return settings, buildings, records and plug-ins, in the form that `all_differences`
        compares."""
        return self.settings(), self.digests("buildings"), self.digests("records"), self.code()

    def completed_chunks(self) -> set[int]:
        """Return the numbers of the completed chunks; part of chunk i has the number -1 - i."""
        return {
            number for (number,) in self.connection.execute("SELECT id FROM chunks WHERE id >= 0")
        }

    def started_chunks(self) -> dict[int, tuple[Rows, float]]:
        """Return the rows and the processor time (s) of chunks of which only some runs are stored,
        by the number of the chunk. The rows are flat tuples, which `add` accepts."""
        parts = {}
        query = "SELECT id, seconds FROM chunks WHERE id < 0"
        for number, seconds in self.connection.execute(query).fetchall():
            rows = [
                self.connection.execute(table.select(where="WHERE chunk = ?"), (number,)).fetchall()
                for table in schema.ROW_TABLES
            ]
            parts[-1 - number] = Rows(*cast("Any", rows)), seconds
        return parts

    def seconds(self) -> float:
        """Return the processor time of the completed chunks, s."""
        return float(self.value("SELECT total(seconds) FROM chunks"))

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
        return int(self.value(f"SELECT count(*) FROM run_rows WHERE {condition}"))

    @property
    def has_stories(self) -> bool:
        """Whether the store contains results of stories."""
        return self.has_rows(schema.STORIES)

    @property
    def has_samples(self) -> bool:
        """Whether ground motions were sampled, so that two runs may have the same motion."""
        return self.count("sample > 0") > 0

    def has_rows(self, table: schema.RowTable) -> bool:
        """Return whether a table of chunks contains rows."""
        return self.value(f"SELECT 1 FROM {table.name} LIMIT 1") is not None

    def smallest_suite(self) -> int:
        """Return the smallest number of motions of a building at a level; 0 without runs."""
        return (
            self.value(
                "SELECT min(motions) FROM (SELECT count(DISTINCT motion) AS motions FROM run_rows "
                "GROUP BY building, level)"
            )
            or 0
        )

    def add(
        self, result: ChunkResult, *, is_part: bool = False, replaces_part: bool = False
    ) -> None:
        """Write the rows of a chunk and mark the chunk as completed, in a single transaction.

        Parameters
        ----------
        is_part : bool
            True if the result contains only some runs of the chunk, which is not completed.
        replaces_part : bool
            True if the store contains a part of the chunk, which the result replaces.

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
        part = -1 - result.number
        number, seconds = part if is_part else result.number, float(result.seconds)
        digest = schema.chunk_digest(number, seconds, *rows_by_table)
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            if replaces_part:
                self._delete([part])
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
            Campaign. Without a campaign, only checksums are verified.

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
                    chunk = number if number >= 0 else -1 - number
                    # The expected number of runs is `None` if it depends on results.
                    size = identity.size(chunk) if chunk < identity.chunks else -1
                    if size is not None and (
                        run_count != size if number >= 0 else run_count >= size
                    ):
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
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            self._delete(chunks)

    def _delete(self, chunks: Collection[int]) -> None:
        """Remove the rows of chunks in an open transaction."""
        # Column with the number of the chunk, by table. Unlike `=`, the operator IS also selects
        # rows with the number NULL, which can result from corruption.
        number_columns = {table.name: "chunk" for table in schema.ROW_TABLES} | {"chunks": "id"}
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
        rows = self.connection.execute("SELECT kind, reason FROM unused ORDER BY rowid")
        return {"record": [], "building": []} | grouped(rows)

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
        values = metadata_of(identity)
        is_unchanged = all(self._meta_or_none(key) == value for key, value in values.items())
        query = "SELECT id FROM buildings"
        stored_numbers = {number for (number,) in self.connection.execute(query)}
        required_numbers = identity.building_numbers
        if required_numbers is None:
            required_numbers = range(len(identity.buildings))
        # Usually the metadata are unchanged. Skip the transaction in this case, because it would
        # block other processes that read the store.
        unused = {(category, stored_text(reason)) for category, reason in identity.unused}
        stored_unused = set(self.connection.execute("SELECT kind, reason FROM unused"))
        is_complete = stored_numbers.issuperset(required_numbers)
        if is_unchanged and is_complete and unused == stored_unused:
            return
        # The checksum is updated in the same transaction, so that readers see a consistent state.
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            self.connection.execute("DELETE FROM unused")
            self.add_unused(identity.unused)
            self.connection.executemany("INSERT OR REPLACE INTO meta VALUES(?, ?)", values.items())
            # The data of all buildings are written again, because they may have changed.
            execute = self.connection.execute
            execute("DELETE FROM inventory")
            execute("DELETE FROM building_types")
            types = identity.damage.buildings if identity.damage else ()
            for number in sorted(stored_numbers.union(required_numbers)):
                building = identity.buildings[number]
                if number not in stored_numbers:
                    name = stored_text(building.name)
                    row = number, name, building.method, building.stories, building.digest
                    execute("INSERT INTO buildings VALUES(?, ?, ?, ?, ?)", row)
                # Cells of the columns that are copied to tables
                if isinstance(building, RowBuilding) and building.row.columns:
                    execute("INSERT INTO inventory VALUES(?, ?)", (number, building.row.cells))
                if types:
                    values_of_type = number, *types[number]
                    execute("INSERT INTO building_types VALUES(?, ?, ?, ?)", values_of_type)
            self.seal()

    def inventory_columns(self) -> tuple[str, ...]:
        """Return the columns of the inventory that are copied to tables, as written in the
        inventory; empty without an inventory."""
        return tuple(json.loads(self.meta("inventory"))["columns"])

    def inventory_files(self) -> list[str]:
        """Return the SHA-256 of the files of the inventory; empty without an inventory."""
        # The key `files` has model files instead if the campaign has no inventory.
        inventory = json.loads(self._meta_or_none("inventory") or "{}")
        return sorted(self.files().values()) if inventory.get("columns") else []

    def add_shards(self, shard_runs: Mapping[str, int]) -> None:
        """Record that shards are written to this store, so that `merge` can report missing shards,
        and `status` the runs of the shards.

        Parameters
        ----------
        shard_runs : mapping of str to int
            Number of runs of each shard, by its number and the number of shards, for example `2/5`.
        """
        if not shard_runs.keys() <= (known := self.shards()).keys():
            self._write_meta("shard_runs", json.dumps(known | dict(shard_runs)))

    def group_by(self, column: str) -> None:
        """Record the column of the inventory by which losses are grouped, for later exports."""
        self._write_meta("by", column)

    def _write_meta(self, key: str, value: str) -> None:
        """Write a value of the table `meta` in a transaction of its own, unless the store already
        has this value."""
        if value == self._meta_or_none(key):
            return
        with sqlite_errors_reported(self.name), transaction(self.connection, self.name):
            self.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", (key, value))
            self.seal()

    def record_time_loops(self, execution: str | None) -> None:
        """Record how the time loops of the following runs are executed; see `time_loops`. None
        means that this process executes none."""
        if execution is not None and self.time_loops() not in (execution, "interpreted"):
            self._write_meta("time_loops", execution)

    def copied_cells(self, building: int) -> list[str]:
        """Return the cells of the inventory row of a building; empty without an inventory."""
        return list(
            json.loads(
                self.value("SELECT cells FROM inventory WHERE building = ?", building) or "[]"
            )
        )

    def _meta_or_none(self, key: str) -> str | None:
        """Return a value of the table `meta`; None if the table does not have the key."""
        value: str | None = self.value("SELECT value FROM meta WHERE key = ?", key)
        return value

    def is_requested(self, table: str) -> bool:
        """Return whether a table is requested, by its name in campaign files."""
        outputs = self.outputs()
        return outputs is None or table in outputs

    @property
    def has_pairs(self) -> bool:
        """True if the intensities of motions are those of pairs: of two components, which have runs
        of their own or are one motion of a building in two directions (`HN1+HN2`)."""
        components = (component for _, component, _ in self.records().values())
        return self.pair_rule().pairs > 0 or any("+" in component for component in components)

    def pair_rule(self) -> PairRule:
        """Return the rule that combines the components of pairs, with the pairs of the store."""
        return PairRule(self.pair_demand(), recording_numbers(self.records()))

    def choose_pair_demand(self, rule: str) -> None:
        """Write the rule that combines the demands of the components of pairs to the store. `rule`
        is an item of `tdint.response.pairs.PAIR_DEMANDS`."""
        self._write_meta("pair_demand", rule)

    def period(self, building: int) -> float | None:
        """Return the first period of a building; None if it is not stored."""
        periods = json.loads(self._meta_or_none("periods") or "[]")
        if building < len(periods):
            return float(periods[building])
        query = "SELECT period_s FROM building_types WHERE building = ?"
        period: float | None = self.value(query, building)
        return period

    def first_periods(self) -> list[tuple[str, float]]:
        """Return the names of the buildings with their first natural periods, s, if known."""
        periods = [(name, self.period(number)) for number, (name, _) in self.buildings().items()]
        return [(name, period) for name, period in periods if period is not None]

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

    def building_type(self, building: int) -> tuple[str, str, float, float]:
        """Return name, type, divisor of the demand and first period of a building with damage."""
        query = (
            "SELECT b.name, t.type, t.divisor, t.period_s FROM buildings b JOIN building_types t "
            "ON t.building = b.id WHERE b.id = ?"
        )
        return tuple(self.connection.execute(query, (building,)).fetchone())

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
        """Yield one tuple per run, with the values of the columns of `schema.RUNS`, in the
        order of its key."""
        yield from self.connection.execute(schema.RUNS.select())

    def runs_of(self, chunk: int) -> list[RunRow]:
        """Return the rows of the runs of the chunk with this number."""
        rows = self.connection.execute(schema.RUNS.select(where="WHERE chunk = ?"), (chunk,))
        return [schema.run_of(row) for row in rows]

    def rows_of_runs(
        self, table: schema.RowTable, columns: str, building: int
    ) -> Iterator[tuple[Any, ...]]:
        """Yield one tuple per row of a building in a table of chunks: the run, and the values of
        `columns` (SQL expressions), in the order of the key."""
        query = f"SELECT record, scale, sample, {columns} FROM {table.name} WHERE building = ?"
        for row in self.connection.execute(f"{query} ORDER BY {', '.join(table.key)}", (building,)):
            yield Run(*row[:3]), *row[3:]

    def values_of_runs(
        self, table: schema.RowTable, columns: str, building: int
    ) -> dict[Run, Array]:
        """Return the numbers in `rows_of_runs` by run, shape (rows of the run, columns)."""
        rows = grouped(
            (run, values) for run, *values in self.rows_of_runs(table, columns, building)
        )
        return {run: np.array(values, float) for run, values in rows.items()}

    def shown(self, table: schema.RowTable, columns: Iterable[Column]) -> Iterator[tuple[Any, ...]]:
        """Yield one tuple per row of a table of chunks: the numbers of its building and its sample,
        the names of building, record and component, the scale, and the cells of `columns`."""
        yield from self.connection.execute(table.select_named(names(columns)))

    def buildings(self) -> Mapping[int, tuple[str, str]]:
        """Return name and method of each building by its number."""
        rows = self.connection.execute("SELECT id, name, method FROM buildings")
        return {number: (name, method) for number, name, method in rows}

    def records(self) -> Mapping[int, tuple[str, str, int]]:
        """Return name, component and direction of each ground motion by its number."""
        rows = self.connection.execute("SELECT id, name, component, direction FROM records")
        return {number: (name, component, direction) for number, name, component, direction in rows}


def foreign_file_error(file: Path) -> OutputError:
    """Return the error for an existing file that was not written from the store in its
    directory."""
    return OutputError(
        f"{file}: the file exists, but this command did not write it, or it was changed later; "
        "use another directory with -o, or add --overwrite to replace it"
    )


def is_empty(store: Store) -> bool:
    """Return whether a store has no tables yet."""
    return not store.value("SELECT count(*) FROM sqlite_master")


def create_tables(store: Store, identity: Identity) -> None:
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
    # Few campaigns have motions that tdint wrote. Their origins are the values of a dictionary, in
    # which the keys are the numbers of the motions.
    origins = {
        number: {"origin": motion.record.origin.summary}
        for number, motion in enumerate(identity.motions)
        if motion.record.origin
    }
    # Buildings of an inventory without a sweep have no varied parameters. There may be millions of
    # these buildings, so do not query each building.
    buildings, varied = identity.buildings, list[dict[str, float]]()
    if not isinstance(buildings, RowBuildings) or buildings.rows.is_varied:
        varied = [dict(building.varied) for building in buildings]
    parameters = dict.fromkeys(name for values in varied for name in values)
    models = models_of(buildings) or [building.subject().model for building in buildings[:1]]
    optional = {
        "code": identity.code,
        "origins": origins,
        "scaling": identity.scaling,
        "varied": varied if any(varied) else None,
        "varied_units": si_units_of(parameters, models) if parameters else None,
    }
    metadata |= {key: json.dumps(value) for key, value in optional.items() if value}
    # Sampling interval (s), number of samples, PGA (m/s^2), PGV (m/s) and SHA-256 of each ground
    # motion. A load case has no samples; its numbers are 0.
    records = []
    for number, motion in enumerate(identity.motions):
        record, values = motion.record, (0.0, 0, 0.0, 0.0)
        if not isinstance(record, LoadCase):
            pgv = float(intensity_of(record, lambda part: measure(part).pgv))
            values = (record.dt, record.samples, pga_of(record), pgv)
        names = stored_text(motion.name), stored_text(motion.component)
        records.append((number, *names, motion.direction, *values, record.digest))
    with transaction(store.connection, store.name):
        for statement in schema.TABLES:
            store.connection.execute(statement)
        store.connection.executemany("INSERT INTO meta VALUES(?, ?)", metadata.items())
        store.connection.executemany(
            "INSERT INTO records VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)", records
        )
        store.seal()
