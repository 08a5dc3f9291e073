"""Execute the plan of a campaign: run the missing chunks, store their results, and report progress.
Also merge the stores of shards (parts of a campaign that run on different machines), and keep the
results of unchanged runs."""

from __future__ import annotations

import json
import logging
import sqlite3
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from typing import Any, cast

from tdint.errors import AnalysisError, TdintError, UsageError
from tdint.files import is_there
from tdint.kernels.building.compilable import Variant, time_loops
from tdint.kernels.building.load_or_compile import load_or_compile
from tdint.kernels.compiling import Kernel
from tdint.model.limits import LimitCheck
from tdint.number_parsing import first_warning, pluralize
from tdint.response.pairs import Place, Run
from tdint.response.runs.compiled_steps import kernels
from tdint.studies.campaign.chunks import ChunkResult, Rows, run_chunk, spectral_accelerations
from tdint.studies.campaign.cluster import check_address, on_cluster
from tdint.studies.campaign.inputs import read_inputs
from tdint.studies.campaign.plan import Plan, make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint.studies.campaign.story_profiles import profiles
from tdint.studies.store import opening, schema
from tdint.studies.store.result_store import (
    FILE,
    INVENTORY_CHANGED,
    Identity,
    Store,
    all_differences,
    is_empty,
    stored_text,
)
from tdint.system import on_threads, processors
from tdint.tabular import Progress, Tabular, progress_reporter

Engine = Callable[[Plan, Sequence[int]], Iterator[ChunkResult]]
"""Function that runs the chunks of a plan with the given numbers, on threads of this process or on
workers of a cluster, and yields their results in order of completion."""


@dataclass(frozen=True)
class Shard:
    """Part K/N of a campaign, which one of several machines runs: every N-th chunk, starting with
    the K-th chunk.

    Attributes
    ----------
    number, count : int
        K, from 1, and the number of shards N.
    """

    number: int
    count: int

    def chunks(self, plan: Plan) -> range:
        """Return the numbers of the chunks of the shard, counted from 0."""
        return range(self.number - 1, plan.chunks, self.count)

    @property
    def text(self) -> str:
        """Text of the shard on the command line, K/N."""
        return f"{self.number}/{self.count}"


@dataclass(frozen=True)
class Advance:
    """Progress of a campaign, or of a shard, in a single call.

    Attributes
    ----------
    done, runs : int
        Number of completed runs now, and at the end of the call. Both include the runs of earlier
        calls.
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
        """Number of runs per second since the start of the call; 0 before the first chunk."""
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
    shard : Shard, optional
        Shard to run; by default the complete campaign.
    max_runs : int, optional
        Maximum number of additional runs.
    on_chunk : callable
        Called with the progress after each completed chunk.

    Raises
    ------
    AnalysisError
        A method does not integrate a building.
    OutputError
        The store cannot be written.
    """
    # Chunks that were stored by a previous call count as completed.
    chunks = range(plan.chunks) if shard is None else shard.chunks(plan)
    missing = sorted(set(chunks) - store.completed_chunks())
    # A part of a chunk contains the results that `reuse_results` kept.
    parts = {number: part for number, part in store.started_chunks().items() if number in missing}
    plan.kept.update((number, rows) for number, (rows, _) in parts.items())
    left = {
        number: plan.size(number) - len(plan.kept[number].runs if number in plan.kept else ())
        for number in missing
    }
    runs_before = sum(map(plan.size, chunks)) - sum(left.values())
    if max_runs is not None:
        after = dict(zip(missing, accumulate(left.values()), strict=True))
        missing = [number for number in missing if after[number] - left[number] < max_runs]
        plan.most.update(
            (number, max_runs - after[number] + left[number])
            for number in missing
            if after[number] > max_runs
        )
    runs_after = runs_before + sum(min(left[i], plan.most.get(i, left[i])) for i in missing)
    advance = Advance(runs_before, runs_after, runs_before, 0.0)
    if shard is not None:
        store.add_shards({shard.text: sum(map(plan.size, chunks))})
    # Compile before the clock starts: compilation is not part of the reported time per run.
    if missing:
        compile_for(plan)
        store.record_time_loops(time_loops())
        # Other processes can read the store while chunks are written to a log.
        with schema.sqlite_errors_reported(store.name):
            schema.start_log(store.connection, store.name)
    start_time = time.perf_counter()
    # Store each chunk immediately, so that completed chunks remain if the process is killed.
    for result in engine(plan, missing):
        number, completed_runs = result.number, advance.done + len(result.rows.runs)
        if number in plan.kept:
            result.rows.extend(plan.kept.pop(number))
        if number in parts:
            result = replace(result, seconds=result.seconds + parts[number][1])
        store.add(result, is_part=number in plan.most, replaces_part=number in parts)
        seconds = time.perf_counter() - start_time
        advance = Advance(completed_runs, runs_after, runs_before, seconds)
        on_chunk(advance)
    return advance


def threads(jobs: int) -> Engine:
    """Return an engine that uses threads of the process.

    Raises
    ------
    UsageError
        The number of threads is less than 1.
    """
    if jobs < 1:
        raise UsageError(f"the number of jobs (threads) must be at least 1, got {jobs}")
    return lambda plan, numbers: on_threads(
        lambda number: run_chunk(plan.chunk(number)), numbers, jobs
    )


def cluster(address: str) -> Engine:
    """Return an engine that uses the workers of a Dask cluster. UsageError is raised if the address
    of the scheduler is invalid (`check_address`)."""
    check_address(address)
    return lambda plan, numbers: on_cluster(address, plan.chunk, numbers)


def compile_for(plan: Plan) -> None:
    """Load the time loops for the buildings of a plan, and compile them if necessary, before
    several threads request them at the same time."""
    variants: dict[tuple[Kernel, Variant], None] = {}
    for building in plan.buildings[:_MAX_COMPILED_FOR]:
        subject = building.subject()
        # Forces of a load case belong to the building.
        variant = subject.case(plan.motions[0].record).prepared.variant
        variants |= dict.fromkeys(kernels(subject.integrator, variant))
    load_or_compile(list(variants))
    # The kernel of response spectra, which computes Sa(T1), is loaded by its first call. The record
    # and the period of the call are arbitrary; its result is not used.
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

    @property
    def store(self) -> Store:
        """Store with the same contents in memory, for a `with` statement that closes it."""
        connection = sqlite3.connect(":memory:")
        # A database in memory cannot use a write-ahead log. In the file format of SQLite, bytes 18
        # and 19 state the type of the journal: 2 is a write-ahead log, 1 is a rollback journal.
        connection.deserialize(self._content[:18] + b"\1\1" + self._content[20:])
        return Store(connection, self.name)

    def limit_checks(
        self, limit: float | str | None = None
    ) -> dict[tuple[str, str], tuple[LimitCheck, ...]]:
        """Compare the mean demands over the ground motions with limits.

        Parameters
        ----------
        limit : float or str, optional
            Limit of the drift ratio (dimensionless) that is used instead of the limits of the
            models, or the name of a performance level of the models. By default, all limits of the
            models.

        Returns
        -------
        dict of tuple of str to tuple of LimitCheck
            Comparisons by the name of the building and the text of the intensity level. A tuple is
            empty if no run at the level is completed. The dictionary is empty if the store contains
            no peaks of stories.

        Raises
        ------
        UsageError
            A building has no story with a height, or no such performance level.
        """
        with self.store as store:
            return {
                (profile.building, profile.level_text): profile.limit_checks(limit)
                for profile in profiles(store)
            }

    def _headline(self) -> str:
        """Return the name of the campaign, the number of runs of each status, and the first
        warning."""
        counts_by_status = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        completed = sum(self.statuses.values())
        return (
            f"of {self.name!r}: {completed} of {pluralize(self.asked, 'run')} "
            f"({counts_by_status}){first_warning(self.warnings)}"
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
        Directory where completed runs are stored. The next call continues from these runs, and
        `tdint campaign export FOLDER` writes their tables. By default runs are stored in memory.
    jobs : int, optional
        Number of threads; the default is the number of processors. Results do not depend on this
        number.
    max_runs : int, optional
        Maximum number of additional runs.
    progress : bool or callable, default False
        True for a progress bar by tqdm on a terminal or in a notebook, or a function that is called
        with the number of completed runs and of all runs.
    partial : bool, default False
        True to return the completed runs after an interrupt (Ctrl-C).

    Returns
    -------
    CampaignRuns
        Completed runs. Its method `to_dict` returns the columns of runs.csv.

    Raises
    ------
    ModelError
        The campaign file or a model has errors.
    UsageError
        A time step does not fit a record.
    RecordError
        No record can be read.
    OutputError
        The directory contains another campaign, cannot be written, or another process uses it.
    """
    definition = load_campaign(source)
    plan = make_plan(definition, read_inputs(definition))
    with ExitStack() as stack:
        # Only one process may write to a directory, which is ensured by a lock. Network disks do
        # not support locks reliably, and are refused.
        if folder is not None:
            schema.refuse_network(Path(folder))
            stack.enter_context(schema.locked(Path(folder)))
        opened_store, _ = opening.open_store(None if folder is None else Path(folder), plan)
        store = stack.enter_context(opened_store)
        engine = threads(processors() if jobs is None else jobs)
        # After an interrupt only chunks in progress are lost; completed runs are returned if
        # `partial` is true.
        try:
            with progress_reporter(progress, plan.runs, "run") as report_progress:
                execute_plan(
                    plan,
                    store,
                    engine,
                    max_runs=max_runs,
                    on_chunk=lambda advance: report_progress(advance.done, advance.runs),
                )
        except KeyboardInterrupt:
            if not partial:
                raise
        # The contents are copied, because the store is closed.
        return CampaignRuns(
            store.meta("name"),
            int(store.meta("runs")),
            store.statuses(),
            plan.failures,
            store.checked,
            store.connection.serialize(),
            plan.warnings,
        )


_BUILDING_TABLES = ("buildings", "inventory", "building_types")
_CHUNK_COLUMNS = {**{table.name: -1 for table in schema.ROW_TABLES}, "chunks": 0}
"""Index of the column with the number of the chunk, by table: the last column of tables of rows,
the first column of the table of chunks."""

_log = logging.getLogger(__name__)


def merge(
    folders: Sequence[Path], target: Path, *, partial: bool = False, overwrite: bool = False
) -> Store:
    """Merge the stores of shards of a single campaign into the store in `target`. Chunks that
    several stores contain are copied once.

    Parameters
    ----------
    partial : bool
        True to accept missing runs.
    overwrite : bool
        True to replace another campaign in `target`: the merged store then has the name that
        `replacement_of` returns.

    Raises
    ------
    UsageError
        A directory contains no campaign, or the campaigns differ; the message has a line per
        difference.
    AnalysisError
        Runs are missing from all stores; the message has their number and their shards.
    OutputError
        The store cannot be written.
    """
    # Open the stores sequentially: the files of a thousand shards cannot all be open at a time.
    parts: list[_Part] = []
    for directory in folders:
        with opening.open_existing(directory) as source:
            parts.append(_read_part(directory, source))
        _check_same_campaign(parts[0], parts[-1])
    # Chunks that an earlier call has copied to the target are not missing.
    file, earlier = _read_target(target, parts[0], overwrite)
    missing_text = _describe_missing([*parts, *earlier])
    if missing_text and not partial:
        raise AnalysisError(f"{missing_text}; add their directories, or use --partial")
    # The target can be one of the directories; its store contains its own runs already.
    sources = [part for part in parts if not (is_there(file) and file.samefile(part.folder / FILE))]
    store, name = opening.open_written(file), str(file)
    with schema.closed_on_failure(store.connection), schema.sqlite_errors_reported(name):
        _copy_buildings(sources, store)
        # Corrupt chunks of the target and of the sources are omitted and reported.
        _warn_of_corrupt_chunks(name, store.remove_invalid_chunks())
        store.remove([-1 - number for number in store.started_chunks()])
        for part in sources:
            _warn_of_corrupt_chunks(part.name, part.corrupt_count)
            store.record_time_loops(part.time_loops)
            new_chunks = set(part.chunks) - store.completed_chunks()
            with (
                part.open() as source,
                schema.sqlite_errors_reported(name),  # not as errors of the source
                schema.transaction(store.connection, name),
            ):
                for table, index in _CHUNK_COLUMNS.items():
                    _copy(source, store, table, index, new_chunks)
    return store


def _read_target(target: Path, first: _Part, overwrite: bool) -> tuple[Path, list[_Part]]:
    """Return the file of the merged store, and the part of the campaign that the target contains:
    an empty list if it contains no campaign, or with `overwrite` another one.

    `first` is a part of the campaign. Without `overwrite`, another campaign or a store that cannot
    be used raises OutputError.
    """
    file, earlier = target / FILE, list[_Part]()
    try:
        # UsageError: the directory does not exist, or contains no campaign.
        with suppress(UsageError), opening.open_existing(target) as store:
            earlier.append(_read_part(target, store))
        for part in earlier:
            _check_same_campaign(part, first)
    except (UsageError, schema.UntrustedStoreError) as error:
        if not overwrite and isinstance(error, UsageError):
            raise schema.AnotherStudyError(
                f"{file}: contains another campaign; specify another directory with -o, or "
                f"--overwrite to replace it\n{error}"
            ) from None
        if not overwrite:
            raise
        opening.remove_store(opening.replacement_of(file))
        return opening.replacement_of(file), []
    return file, earlier


@dataclass(frozen=True)
class _Part:
    """Contents of the store of a part of a campaign: a directory with some of its runs, such as a
    shard.

    Attributes
    ----------
    identity : dict of str to str
        Values that must be equal in all parts of a campaign, by name.
    runs : int
        Number of runs of the complete campaign.
    shards : dict of str to int
        Number of runs of each shard, K/N, in the store.
    chunks : dict of int to int
        Number of runs of each chunk that is complete and not corrupt, by the number of the chunk.
    time_loops : str or None
        Execution of the time loops (`Store.time_loops`).
    """

    folder: Path
    identity: dict[str, str]
    runs: int
    shards: dict[str, int]
    chunks: dict[int, int]
    corrupt_count: int
    time_loops: str | None

    @property
    def name(self) -> str:
        """Path of the store, for messages."""
        return str(self.folder / FILE)

    def open(self) -> Store:
        """Open the store for reading."""
        with schema.sqlite_errors_reported(self.name):
            return Store(schema.connect_to_read(self.folder / FILE), self.name)


def _read_part(folder: Path, store: Store) -> _Part:
    """Read the identity, shards and chunks of a part of a campaign, such as a shard."""
    with schema.sqlite_errors_reported(store.name):
        corrupt = schema.corrupt_chunks(store.connection)
        chunks = dict(store.connection.execute("SELECT id, runs FROM chunks WHERE id >= 0"))
        identity = {
            key: store.meta(key) for key in ("fingerprint", "chunks", "inventory", "damage")
        }
        identity["inventory files"] = json.dumps(store.inventory_files())
        runs = int(store.meta("runs"))
    # Corrupt chunks count as missing, because they are not copied.
    intact = {number: count for number, count in chunks.items() if number not in corrupt}
    shards, time_loops = store.shards(), store.time_loops()
    return _Part(folder, identity, runs, shards, intact, len(corrupt), time_loops)


def _check_same_campaign(first: _Part, second: _Part) -> None:
    """Raise UsageError if the two parts `first` and `second` belong to different campaigns. The
    message lists the differences."""
    if first.identity == second.identity:
        return
    differing_keys = {key for key, value in first.identity.items() if second.identity[key] != value}
    has_new_inventory = "inventory files" in differing_keys
    if not differing_keys & {"fingerprint", "chunks"}:
        # The runs are the same. The parts still cannot be merged, because the tables depend on the
        # inventory and on the section damage, and these differ.
        reasons = []
        if differing_keys & {"inventory", "damage"}:
            reasons.append(
                "the columns of the inventory or the section damage differ; run `tdint campaign` "
                "again for each shard"
            )
        if has_new_inventory:
            reasons.append(INVENTORY_CHANGED)
        differences_text = "\n".join(reasons)
    else:
        with first.open() as first_store, second.open() as second_store:
            differences_text = all_differences(
                first_store.compared_values(),
                second_store.compared_values(),
                (first.name, second.name),
                are_shards=bool(first.shards),
                has_new_inventory=has_new_inventory,
            )
    raise UsageError(
        f"{first.name} and {second.name} belong to different campaigns, and only parts of one "
        f"campaign can be merged; the differences are:\n{differences_text}"
    )


def _describe_missing(parts: Sequence[_Part]) -> str:
    """Return the number of runs that no part of a campaign contains, and the shards to which they
    belong, if known; an empty text if no runs are missing.
    """
    stored_runs = {number: runs for part in parts for number, runs in part.chunks.items()}
    missing_chunks = set(range(int(parts[0].identity["chunks"]))) - set(stored_runs)
    if not missing_chunks:
        return ""
    total = parts[0].runs
    missing_count = total - sum(stored_runs.values())
    message = f"{missing_count} of {pluralize(total, 'run')} are not in any directory"
    # Missing shards can be named if all shards have the same N of K/N, the usual case.
    started_shards = {text for part in parts for text in part.shards}
    shard_counts = {int(text.partition("/")[2]) for text in started_shards}
    if len(shard_counts) != 1:
        return message
    (shard_count,) = shard_counts
    # Chunk i, counted from 0, belongs to shard i % N + 1 of N (`Shard.chunks`).
    missing_numbers = sorted({chunk % shard_count + 1 for chunk in missing_chunks})
    missing_shards = [Shard(number, shard_count).text for number in missing_numbers]
    # A shard with a directory can also lack chunks, if it was not completed.
    names = [
        f"{text} (not complete)" if text in started_shards else text for text in missing_shards
    ]
    return f"{message}: missing {'shard' if len(names) == 1 else 'shards'} {', '.join(names)}"


def _warn_of_corrupt_chunks(name: str, count: int) -> None:
    """Log a warning if the number of corrupt chunks (`count`) of the store with the path `name` is
    not zero."""
    if count:
        _log.warning(
            "%s: %d corrupt chunks of runs are omitted; `tdint campaign` runs them again",
            name,
            count,
        )


def _copy(
    source: Store,
    target: Store,
    table: str,
    index: int = 0,
    accepted: Collection[int] | None = None,
) -> None:
    """Copy rows of a table from a store to another store: all rows, or the rows with an `accepted`
    number in the column `index`."""
    rows = source.connection.execute(f"SELECT * FROM {table}")
    placeholders = ", ".join("?" * len(rows.description))
    target.connection.executemany(
        f"INSERT OR IGNORE INTO {table} VALUES({placeholders})",
        (row for row in rows if accepted is None or row[index] in accepted),
    )


def _copy_buildings(parts: Sequence[_Part], target: Store) -> None:
    """Copy the buildings of all parts of a campaign to a store, in a single transaction. If the
    store is empty, also create its tables and copy the definition of the campaign.
    """
    with schema.transaction(target.connection, target.name):
        is_new = is_empty(target)
        for statement in schema.TABLES if is_new else ():
            target.connection.execute(statement)
        for index, part in enumerate(parts):
            with part.open() as source:
                # Settings and records are the same in all parts: copy them from the first part.
                if is_new and index == 0:
                    _copy(source, target, "meta")
                    _copy(source, target, "records")
                for table in _BUILDING_TABLES:
                    _copy(source, target, table)
                # `category` is `building` or `record`.
                for category, reasons in source.unused().items():
                    target.add_unused((category, reason) for reason in reasons)
        target.seal()
    target.add_shards({text: runs for part in parts for text, runs in part.shards.items()})


# ---- Continuation of a campaign after a change of its records or buildings. The results of the
# runs with unchanged record and building are copied from the earlier store, so that only the other
# runs are integrated. A run does not depend on the other runs of the campaign, therefore the tables
# equal the tables of a new campaign to the last byte.


def reuse_results(folder: Path, plan: Plan) -> str:
    """Create the store of a changed campaign that will replace the store in a directory
    (`open_replacement`), with the results of the unchanged runs. The caller has locked the
    directory.

    Rows of chunks with some unchanged runs are kept in `plan.kept`, until the other runs of the
    chunk are integrated.

    Parameters
    ----------
    folder : Path
        Directory of the campaign. Without a store, or with a store of the same campaign, the
        function has no effect.

    Returns
    -------
    str
        Note with the number of runs with kept results; empty if the function has no effect.

    Raises
    ------
    AnotherStudyError
        Differences other than records and buildings prevent the use of the results.
    OutputError
        The store cannot be used or written.
    """
    file = folder / FILE
    if not is_there(file):
        return ""
    identity = Identity.of(plan, None)
    with opening.open_written(file) as old:
        if is_empty(old) or identity.fingerprint == old.meta("fingerprint"):
            return ""
        if obstacle := opening.obstacle_to_reuse(old, identity):
            raise schema.AnotherStudyError(
                f"{old.name}: --changed cannot keep results: {obstacle}; specify another directory "
                "with -o, or --overwrite to start again"
            )
        old.remove_invalid_chunks()
        new, _ = opening.open_replacement(file, identity)
        with new:
            kept = _copy_results(old, new, plan, identity)
            written = sorted(old.written())
            with schema.transaction(new.connection, new.name):
                new.connection.executemany("INSERT OR IGNORE INTO written VALUES(?, ?)", written)
    return (
        f"{file}: the results of {kept} of {pluralize(plan.runs, 'run')} are kept, because their "
        "record and building are unchanged"
    )


def _copy_results(old: Store, new: Store, plan: Plan, identity: Identity) -> int:
    """Copy the rows of unchanged runs to the new store (complete chunks) or to `plan.kept` (parts
    of chunks), and return the number of these runs.
    """
    buildings = _common_numbers(
        old.connection.execute("SELECT id, name, sha256 FROM buildings"),
        ((stored_text(building.name), building.digest) for building in identity.buildings),
    )
    motions = _common_numbers(
        old.connection.execute("SELECT id, name, component, sha256 FROM records"),
        (
            (stored_text(motion.name), stored_text(motion.component), motion.record.digest)
            for motion in identity.motions
        ),
    )
    # An interrupted call can have completed further chunks.
    count, completed = 0, new.completed_chunks()
    for number in range(plan.chunks):
        rows = Rows()
        for part in plan.chunk(number).buildings:
            for run, place in part.runs.items():
                if part.number in buildings and run.motion in motions:
                    old_key = (buildings[part.number], motions[run.motion], run.scale, run.sample)
                    rows.extend(_rows_of(old, old_key, part.number, run, place))
        count += len(rows.runs)
        if number in completed:
            continue
        if len(rows.runs) == plan.size(number):
            new.add(ChunkResult(number, rows, 0.0))
        elif rows.runs:
            plan.kept[number] = rows
    return count


def _common_numbers(
    stored: Iterable[tuple[Any, ...]], entries: Iterable[tuple[str, ...]]
) -> dict[int, int]:
    """Return the number in the earlier store of each entry that is unchanged, by its new number.

    `stored` has the number of an entry, its names and its SHA-256; `entries` the names and the
    SHA-256 in the order of the new numbers.
    """
    old_numbers = {identity: number for number, *names in stored for identity in [tuple(names)]}
    return {
        number: old_numbers[entry] for number, entry in enumerate(entries) if entry in old_numbers
    }


def _rows_of(old: Store, old_key: tuple[Any, ...], building: int, run: Run, place: Place) -> Rows:
    """Return the stored rows of a run with its new numbers; without rows if the run is not stored.

    The rows are flat tuples, which the store accepts like the named tuples of new results.
    """
    where = "WHERE building = ? AND record = ? AND scale = ? AND sample = ?"
    key = (building, run.motion, run.scale, run.sample)
    tables = [
        [
            new_key + row[len(new_key) :]
            for new_key in [(*key, *place) if table is schema.RUNS else key]
            for row in old.connection.execute(table.select(where=where), old_key)
        ]
        for table in schema.ROW_TABLES
    ]
    return Rows(*cast("Any", tables))
