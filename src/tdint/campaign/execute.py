"""Execute the plan of a campaign: run the missing chunks, store their results, and report progress.
Merge the stores of shards."""

from __future__ import annotations

import json
import logging
import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.analysis.run.compiled_steps import kernels
from tdint.campaign import store_schema as schema
from tdint.campaign.batch import Done, do, spectral_accelerations
from tdint.campaign.cluster import Cluster, on_cluster
from tdint.campaign.inputs import read_inputs
from tdint.campaign.plan import Plan, make_plan
from tdint.campaign.reader import load_campaign
from tdint.campaign.store import (
    FILE,
    INVENTORY_CHANGED,
    Store,
    all_differences,
    is_empty,
    open_existing,
    open_store,
)
from tdint.errors import AnalysisError, TdintError, UsageError
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.building.load_or_compile import load_or_compile
from tdint.kernels.time_loop.loop import integrate_many
from tdint.number_parsing import first_warning, pluralize
from tdint.system import on_threads, processors
from tdint.tabular import Progress, Tabular, progress_reporter

if TYPE_CHECKING:
    from tdint.model.limits import LimitCheck

Engine = Callable[[Plan, Sequence[int]], Iterator[Done]]
"""Function that runs chunks: threads of this process, or workers of a cluster."""


@dataclass(frozen=True)
class Shard:
    """Every `of`-th chunk of a campaign, starting with chunk `number`, counted from 1."""

    number: int
    of: int

    def chunks(self, plan: Plan) -> range:
        """Return the chunks of the shard."""
        return range(self.number - 1, plan.chunks, self.of)

    @property
    def text(self) -> str:
        """Text of the shard on the command line, K/N."""
        return f"{self.number}/{self.of}"


@dataclass(frozen=True)
class Advance:
    """Progress of a campaign in one call.

    Attributes
    ----------
    done, runs : int
        Number of completed runs, and number of runs when the call is complete.
    before : int
        Number of runs that were completed before the call.
    seconds : float
        Time since the start of the call, s.
    """

    done: int
    runs: int
    before: int
    seconds: float

    @property
    def rate(self) -> float:
        """Number of runs per second."""
        return (self.done - self.before) / self.seconds if self.seconds > 0.0 else 0.0


def execute_plan(
    plan: Plan,
    store: Store,
    engine: Engine,
    *,
    shard: Shard | None = None,
    max_runs: int | None = None,
    on_chunk: Callable[[Advance], None] = lambda advance: None,
) -> Advance:
    """Run the missing chunks of a campaign or shard, and store each chunk when it is completed.

    Parameters
    ----------
    plan : Plan
        Plan of the campaign.
    store : Store
        Store of the campaign.
    engine : callable
        Function that runs the chunks.
    shard : Shard, optional
        Shard to run; by default the complete campaign.
    max_runs : int, optional
        Stop after the chunk in which this number of additional runs is reached.
    on_chunk : callable
        Called with the progress after each completed chunk.

    Returns
    -------
    Advance
        Progress at the end.

    Raises
    ------
    AnalysisError
        A method does not integrate a building.
    OutputError
        The store cannot be written.
    """
    # Chunks that were stored by a previous call count as completed.
    numbers = range(plan.chunks) if shard is None else shard.chunks(plan)
    remaining = sorted(set(numbers) - store.done())
    runs_before = sum(plan.size(number) for number in numbers) - sum(
        plan.size(number) for number in remaining
    )
    # Complete the chunk in which the limit is reached: incomplete chunks are never stored.
    if max_runs is not None:
        totals = list(accumulate(plan.size(number) for number in remaining))
        remaining = remaining[: sum(total < max_runs for total in totals) + 1]
    runs_after = runs_before + sum(plan.size(number) for number in remaining)
    advance = Advance(runs_before, runs_after, runs_before, 0.0)
    if shard is not None:
        store.add_shard(shard.text)
    # Compile before the clock starts: compilation is not part of the reported time per run.
    if remaining:
        compile_for(plan)
    began = time.perf_counter()
    # Store each chunk immediately, so that completed chunks remain if the process is killed.
    for done in engine(plan, remaining):
        store.add(done)
        advance = Advance(
            advance.done + len(done.rows.runs), runs_after, runs_before, time.perf_counter() - began
        )
        on_chunk(advance)
    return advance


def threads(jobs: int) -> Engine:
    """Return an engine that uses threads of this process.

    Parameters
    ----------
    jobs : int
        Number of threads.
    """
    if jobs < 1:
        raise UsageError(f"the number of jobs must be at least 1, got {jobs}")
    return lambda plan, numbers: on_threads(lambda number: do(plan.chunk(number)), numbers, jobs)


def cluster(scheduler: Cluster) -> Engine:
    """Return an engine that uses the workers of a Dask cluster."""
    return lambda plan, numbers: on_cluster(scheduler, plan.chunk, numbers)


def compile_for(plan: Plan) -> None:
    """Load the time loops of the buildings, and compile them if necessary, before threads request
    them simultaneously."""
    # Keys of the dictionary are the loops without duplicates; `integrate_many` computes spectra.
    variants = {(integrate_many, EVERYTHING): None}
    for building in plan.buildings[:_MAX_COMPILED_FOR]:
        subject = building.subject()
        variants |= dict.fromkeys(kernels(subject.integrator, subject.prepared.variant))
    load_or_compile(list(variants))
    # A first call loads the kernel of spectra, which is needed for Sa(T1).
    spectral_accelerations(plan.motions[0].record, [1.0])


_MAX_COMPILED_FOR = 1000
"""Number of buildings whose time loops are compiled in advance. All buildings of an inventory use
the same loops."""


@dataclass(frozen=True, repr=False)
class CampaignRuns(Tabular):
    """Completed runs of a campaign.

    Attributes
    ----------
    name : str
        Name of the campaign.
    asked : int
        Number of all runs of the campaign.
    statuses : mapping of str to int
        Number of runs of each status.
    failures : tuple of TdintError
        Errors of records and buildings that could not be used.
    checked : bool
        True if the errors of the demands were estimated.
    warnings : tuple of str
        Unusual values of the buildings, each with its model file, as shown by `check`.
    """

    name: str
    asked: int
    statuses: dict[str, int]
    failures: tuple[TdintError, ...]
    checked: bool
    _content: bytes
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, store: Store, failures: tuple[TdintError, ...], warnings: tuple[str, ...] = ()
    ) -> CampaignRuns:
        """Copy the contents of a store, which may be closed or changed afterwards.

        Parameters
        ----------
        store : Store
            Open store.
        failures : tuple of TdintError
            Errors of inputs that could not be used.
        warnings : tuple of str
            Unusual values of the buildings.
        """
        values = (
            store.meta("name"),
            int(store.meta("runs")),
            store.statuses(),
            failures,
            store.checked,
        )
        return cls(*values, store.connection.serialize(), warnings)

    @property
    def store(self) -> Store:
        """Store with the same contents in memory, for a `with` statement that closes it."""
        connection = sqlite3.connect(":memory:")
        # A database in memory has no write-ahead log: bytes 18 and 19 of SQLite's format state 1.
        connection.deserialize(self._content[:18] + b"\1\1" + self._content[20:])
        return Store(connection, self.name)

    def limit_checks(
        self, limit: float | str | None = None
    ) -> dict[tuple[str, str], tuple[LimitCheck, ...]]:
        """Compare the mean demands over the ground motions with limits.

        Parameters
        ----------
        limit : float or str, optional
            Drift limit that is used instead of the limits of the models, or the name of a
            performance level of the models. By default, all limits of the models.

        Returns
        -------
        dict of tuple of str to tuple of LimitCheck
            Comparisons by the name of the building and the text of the intensity level; without
            completed runs, or without stored peaks of stories, there are no comparisons.

        Raises
        ------
        UsageError
            A building has no story with a height, or no such performance level.
        """
        from tdint.campaign.profiles import profiles

        with self.store as store:
            return {
                (profile.building, profile.level_text): profile.limit_checks(limit)
                for profile in profiles(store)
            }

    def _headline(self) -> str:
        ended = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        return (
            f"of {self.name!r}: {sum(self.statuses.values())} of {pluralize(self.asked, 'run')} "
            f"({ended}){first_warning(self.warnings)}"
        )


def campaign(
    source: str | Path,
    folder: str | Path | None = None,
    *,
    jobs: int | None = None,
    max_runs: int | None = None,
    progress: bool | Progress = False,
    partial: bool = False,
) -> CampaignRuns:
    """Execute the runs of a campaign file.

    Parameters
    ----------
    source : str or Path
        YAML file of the campaign.
    folder : str or Path, optional
        Directory in which completed runs are stored. The next call continues from these runs, and
        `tdint campaign export FOLDER` writes their tables. By default runs are stored in memory.
    jobs : int, optional
        Number of threads; the default is the number of processors. Results do not depend on it.
    max_runs : int, optional
        Stop after about this number of runs.
    progress : bool or callable
        True for a progress bar by tqdm on a terminal or in a notebook, or a function that is called
        with the number of completed runs and of all runs.
    partial : bool
        True to return the completed runs after an interrupt (Ctrl-C).

    Returns
    -------
    CampaignRuns
        `to_dict` has the columns of runs.csv.

    Raises
    ------
    ModelError
        The campaign file or a model has errors.
    UsageError
        A time step does not fit a record; the directory contains another campaign.
    RecordError
        No record can be read.
    OutputError
        The directory cannot be written, or another process uses it.
    """
    definition = load_campaign(source)
    plan = make_plan(definition, read_inputs(definition))
    with ExitStack() as stack:
        # Only one process may write to a directory, which is ensured by a lock. Network disks do
        # not support locks reliably, and are refused.
        if folder is not None:
            schema.refuse_network(Path(folder))
            stack.enter_context(schema.locked(Path(folder)))
        store = stack.enter_context(open_store(None if folder is None else Path(folder), plan)[0])
        engine = threads(processors() if jobs is None else jobs)
        # After an interrupt only chunks in progress are lost; completed runs are returned if
        # `partial` is true.
        try:
            with progress_reporter(
                progress, sum(map(plan.size, range(plan.chunks))), "run"
            ) as report_progress:
                execute_plan(
                    plan,
                    store,
                    engine,
                    max_runs=max_runs,
                    on_chunk=lambda now: report_progress(now.done, now.runs),
                )
        except KeyboardInterrupt:
            if not partial:
                raise
        return CampaignRuns.of(store, plan.failures, plan.warnings)


_BUILDING_TABLES = ("buildings", "inventory", "building_types")
_CHUNK_COLUMNS = {**{table.name: -1 for table in schema.ROW_TABLES}, "chunks": 0}
"""Index of the column with the number of the chunk, by table."""

_log = logging.getLogger(__name__)


def merge(folders: Sequence[Path], target: Path, *, partial: bool = False) -> Store:
    """Merge the stores of shards of one campaign into the store in `target`. Chunks that several
    stores contain are copied once.

    Parameters
    ----------
    folders : sequence of Path
        Directories of the shards.
    target : Path
        Directory of the merged campaign.
    partial : bool
        True to accept missing runs.

    Returns
    -------
    Store
        Open store of the merged campaign.

    Raises
    ------
    UsageError
        A directory contains no campaign, or the campaigns differ; the message lists the
        differences, one line each.
    AnalysisError
        Runs are missing from all stores; the message has their number and their shards.
    OutputError
        The store cannot be written.
    """
    # Open the stores sequentially: the files of a thousand shards cannot all be open at a time.
    parts: list[_Part] = []
    for folder in folders:
        with open_existing(folder) as source:
            parts.append(_part(folder, source))
        _check_same(parts[0], parts[-1])
    # Chunks in the target from an earlier call are not missing. The target may not exist, or may be
    # empty.
    merged = list(parts)
    with suppress(UsageError), open_existing(target) as existing:
        merged.append(_part(target, existing))
    if (missing := _describe_missing(merged)) and not partial:
        raise AnalysisError(f"{missing}; add their directories, or use --partial")
    name = str(target / FILE)
    with schema.sqlite_errors_reported(name):
        store = Store(schema.connect(name), name)
    with schema.closed_on_failure(store.connection):
        with schema.sqlite_errors_reported(name):
            if not is_empty(store):
                schema.check_store(store.connection, name)
                _check_same(merged[-1], parts[0])
            _copy_buildings(parts, store)
        # Corrupt chunks of the target and of the sources are omitted and reported.
        if healed := store.heal():
            _warn_of_corrupt_chunks(replace(merged[-1], name=name, damaged=healed))
        for part in parts:
            _warn_of_corrupt_chunks(part)
            with _reopened(part) as source, schema.sqlite_errors_reported(name):
                _copy_chunks(source, store, set(part.chunks))
    return store


@dataclass(frozen=True)
class _Part:
    """Contents of the store of a part of a campaign: a directory with some of its runs, such as a
    shard.

    `identity` contains the values that must be equal in all parts of a campaign.
    """

    folder: Path
    name: str
    identity: dict[str, str]
    runs: int
    shards: list[str]
    chunks: dict[int, int]
    damaged: int


def _part(folder: Path, store: Store) -> _Part:
    """Read the contents of the store of a part of a campaign."""
    with schema.sqlite_errors_reported(store.name):
        damaged = schema.damaged_chunks(store.connection)
        chunks = dict(store.connection.execute("SELECT id, runs FROM chunks"))
        identity = {
            key: store.meta(key) for key in ("fingerprint", "chunks", "inventory", "damage")
        }
        identity["inventory files"] = json.dumps(store.inventory_files())
        runs = int(store.meta("runs"))
    # Corrupt chunks count as missing, because they are not copied.
    sound = {number: count for number, count in chunks.items() if number not in damaged}
    return _Part(folder, store.name, identity, runs, store.shards(), sound, len(damaged))


def _reopened(part: _Part) -> Store:
    """Open the store of a part again for reading."""
    return Store(schema.connect_to_read(part.folder / FILE), part.name)


def _check_same(part: _Part, other: _Part) -> None:
    """Raise UsageError, with the differences, if two parts belong to different campaigns."""
    if part.identity == other.identity:
        return
    has_new_inventory = part.identity["inventory files"] != other.identity["inventory files"]
    if all(part.identity[key] == other.identity[key] for key in ("fingerprint", "chunks")):
        # The runs are the same. The parts still cannot be merged, because the tables depend on the
        # inventory and on the section damage, and these differ.
        lines = "\n".join([INVENTORY_CHANGED] * has_new_inventory)
        if any(part.identity[key] != other.identity[key] for key in ("inventory", "damage")):
            lines = (
                "the columns of the inventory or the section damage differ; run `tdint campaign` "
                f"again for each shard\n{lines}"
            ).rstrip()
    else:
        with _reopened(part) as first, _reopened(other) as second:
            sides = first.sides(), second.sides()
            lines = all_differences(
                *sides,
                store=part.name,
                given=other.name,
                parts=bool(part.shards),
                has_new_inventory=has_new_inventory,
            )
    raise UsageError(f"{part.name} and {other.name} belong to different campaigns\n{lines}")


def _describe_missing(parts: Sequence[_Part]) -> str:
    """Return the number of runs that are missing from all stores of a campaign, and their shards;
    an empty text if no runs are missing."""
    stored = {number: runs for part in parts for number, runs in part.chunks.items()}
    missing = sorted(set(range(int(parts[0].identity["chunks"]))) - set(stored))
    if not missing:
        return ""
    total = parts[0].runs
    message = (
        f"{total - sum(stored.values())} of {pluralize(total, 'run')} are not in any directory"
    )
    # Missing shards can be named if all shards have the same N of K/N, the usual case.
    requested = {text for part in parts for text in part.shards}
    if len(divisions := {int(text.partition("/")[2]) for text in requested}) != 1:
        return message
    (shard_count,) = divisions
    # A shard with a directory can also lack chunks, if it was not completed.
    incomplete = [
        Shard(number, shard_count).text
        for number in sorted({chunk % shard_count + 1 for chunk in missing})
    ]
    names = [f"{text} (not complete)" if text in requested else text for text in incomplete]
    return f"{message}: missing {'shard' if len(names) == 1 else 'shards'} {', '.join(names)}"


def _warn_of_corrupt_chunks(part: _Part) -> None:
    """Log a warning if a part has corrupt chunks."""
    if part.damaged:
        _log.warning(
            "%s: %d corrupt chunks of runs are omitted",
            part.name,
            part.damaged,
        )


def _copy(
    source: Store, target: Store, table: str, accept: Callable[[Any], bool] = lambda row: True
) -> None:
    """Copy the rows of a table that a function accepts. Rows that exist in the target are kept."""
    rows = source.connection.execute(f"SELECT * FROM {table}")
    placeholders = ", ".join("?" * len(rows.description))
    target.connection.executemany(
        f"INSERT OR IGNORE INTO {table} VALUES({placeholders})", filter(accept, rows)
    )


def _copy_buildings(parts: Sequence[_Part], target: Store) -> None:
    """Copy the campaign definition, if the target is empty, and the buildings of all parts, in one
    transaction."""
    with schema.transaction(target.connection, target.name):
        is_new = is_empty(target)
        for statement in schema.TABLES if is_new else ():
            target.connection.execute(statement)
        for number, part in enumerate(parts):
            with _reopened(part) as source:
                for table in (
                    *(("meta", "records") if is_new and not number else ()),
                    *_BUILDING_TABLES,
                ):
                    _copy(source, target, table)
                target.add_unused(
                    (kind, reason)
                    for kind, reasons in source.unused().items()
                    for reason in reasons
                )
        if shards := list(
            dict.fromkeys([*target.shards(), *(text for part in parts for text in part.shards)])
        ):
            values = ("shards", json.dumps(shards))
            target.connection.execute("INSERT OR REPLACE INTO meta VALUES(?, ?)", values)
        target.seal()


def _copy_chunks(source: Store, target: Store, sound: set[int]) -> None:
    """Copy the chunks that only the source contains. Chunks in both stores are not mixed."""
    new = sound - target.done()
    with schema.transaction(target.connection, target.name):
        for table, index in _CHUNK_COLUMNS.items():
            _copy(source, target, table, lambda row, index=index: row[index] in new)  # type: ignore[misc]
