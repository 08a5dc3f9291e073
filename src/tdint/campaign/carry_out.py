"""A campaign from its plan to its store: which chunks are left, who does them, and who is told. And
the stores of its shards put together in one."""

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
from typing import Any

from tdint.analysis.run.workspace import kernels
from tdint.campaign import store_schema as schema
from tdint.campaign.batch import Done, do, spectral_accelerations
from tdint.campaign.cluster import Cluster, on_cluster
from tdint.campaign.inputs import read_inputs
from tdint.campaign.plan import Plan, make_plan
from tdint.campaign.reader import load_campaign
from tdint.campaign.store import FILE, Store, all_differences, is_empty, open_existing, open_store
from tdint.errors import AnalysisError, TdintError, UsageError
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.building.load_or_compile import load_or_compile
from tdint.kernels.time_loop.loop import integrate_many
from tdint.system import on_threads, processors
from tdint.tabular import Progress, Tabular, told_progress
from tdint.written_numbers import how_many, warned_first

Engine = Callable[[Plan, Sequence[int]], Iterator[Done]]
"""Who does chunks: threads here, or workers elsewhere."""


@dataclass(frozen=True)
class Shard:
    """Every `of`-th chunk, from the `number`-th one, counted from 1."""

    number: int
    of: int

    def chunks(self, plan: Plan) -> range:
        """The chunks that belong to it."""
        return range(self.number - 1, plan.chunks, self.of)

    @property
    def text(self) -> str:
        """As the command line has it, K/N."""
        return f"{self.number}/{self.of}"


@dataclass(frozen=True)
class Advance:
    """How far a campaign has come in one call.

    Attributes
    ----------
    done, runs : int
        Runs that are done, and all that this call was asked for.
    before : int
        Those of them that were done before.
    seconds : float
        Since the call began, s.
    """

    done: int
    runs: int
    before: int
    seconds: float

    @property
    def rate(self) -> float:
        """Runs in a second."""
        return (self.done - self.before) / self.seconds if self.seconds > 0.0 else 0.0


def carry_out(
    plan: Plan,
    store: Store,
    engine: Engine,
    *,
    shard: Shard | None = None,
    max_runs: int | None = None,
    tell: Callable[[Advance], None] = lambda advance: None,
) -> Advance:
    """Do what is left of a campaign, or of a shard of it, and keep every chunk as soon as it is
    done.

    Parameters
    ----------
    max_runs : int, optional
        Stop after the chunk in which this many more runs are done.
    tell : callable
        Told of every chunk.

    Raises
    ------
    AnalysisError
        A method does not integrate a building.
    OutputError
        The store cannot be written.
    """
    # Chunks that are kept from a call before count as done.
    numbers = range(plan.chunks) if shard is None else shard.chunks(plan)
    left = sorted(set(numbers) - store.done())
    before = sum(plan.size(number) for number in numbers) - sum(
        plan.size(number) for number in left
    )
    # The chunk in which the limit is reached is done to its end: a part of one is never kept.
    if max_runs is not None:
        totals = list(accumulate(plan.size(number) for number in left))
        left = left[: sum(total < max_runs for total in totals) + 1]
    advance = Advance(before, before + sum(plan.size(number) for number in left), before, 0.0)
    if shard is not None:
        store.add_shard(shard.text)
    # Compiling takes its time once and is no part of the time for a run that is told.
    if left:
        compile_for(plan)
    began = time.perf_counter()
    # Kept at once: whatever ends the process, what is done stays.
    for done in engine(plan, left):
        store.add(done)
        advance = Advance(
            advance.done + len(done.rows.runs), advance.runs, before, time.perf_counter() - began
        )
        tell(advance)
    return advance


def threads(jobs: int) -> Engine:
    """So many threads of this process."""
    if jobs < 1:
        raise UsageError(f"the number of jobs must be at least 1, got {jobs}")
    return lambda plan, numbers: on_threads(lambda number: do(plan.chunk(number)), numbers, jobs)


def cluster(of: Cluster) -> Engine:
    """The workers of a Dask cluster."""
    return lambda plan, numbers: on_cluster(of, plan.chunk, numbers)


def compile_for(plan: Plan) -> None:
    """Load the time loops of the buildings, compiled if they are not yet: before threads ask for
    them all at once."""
    variants = {(integrate_many, EVERYTHING): None}
    for building in plan.buildings[:_LOOKED_AT]:
        subject = building.subject()
        variants |= dict.fromkeys(kernels(subject.integrator, subject.prepared.variant))
    load_or_compile(list(variants))
    spectral_accelerations(plan.motions[0].record, [1.0])


_LOOKED_AT = 1000
"""Buildings whose time loops are compiled ahead: those of an inventory need the same ones."""


@dataclass(frozen=True, repr=False)
class CampaignRuns(Tabular):
    """The runs of a campaign that are done, as its store has them.

    Attributes
    ----------
    name : str
        The campaign's.
    asked : int
        All runs that the campaign has.
    statuses : mapping of str to int
        How many runs ended how.
    failures : tuple of TdintError
        Records and buildings that could not be used.
    checked : bool
        Whether the errors of the demands were estimated.
    warnings : tuple of str
        Unusual values of the buildings, each with its model file, as `check` shows them.
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
        """What is in a store, as it is now: it is closed, or written on, when this is asked for."""
        told = (
            store.meta("name"),
            int(store.meta("runs")),
            store.statuses(),
            failures,
            store.checked,
        )
        return cls(*told, store.connection.serialize(), warnings)

    @property
    def store(self) -> Store:
        """A store of the same content, in memory, for a `with` that closes it."""
        connection = sqlite3.connect(":memory:")
        # There is no log ahead of it in memory: bytes 18 and 19 of SQLite's format tell that.
        connection.deserialize(self._content[:18] + b"\1\1" + self._content[20:])
        return Store(connection, self.name)

    def _headline(self) -> str:
        ended = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        return (
            f"of {self.name!r}: {sum(self.statuses.values())} of {how_many(self.asked, 'run')} "
            f"({ended}){warned_first(self.warnings)}"
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
    """Do the runs of a campaign file.

    Parameters
    ----------
    source : str or Path
        The YAML file.
    folder : str or Path, optional
        Where the runs are kept as they are done, and found again by the next call; `tdint campaign
        export FOLDER` writes the tables of it. In memory by default.
    jobs : int, optional
        Threads; one for each processor by default. The result does not depend on it.
    max_runs : int, optional
        Stop after about so many runs.
    progress : bool or callable
        A bar on a terminal or in a notebook, by tqdm, or what is told how much is done, of how
        much.
    partial : bool
        Of an interrupt (Ctrl-C) give the runs that are done.

    Returns
    -------
    CampaignRuns
        `to_dict` has the columns of runs.csv.

    Raises
    ------
    ModelError
        The campaign file or a model has faults.
    UsageError
        A step that does not fit; the folder holds another campaign.
    RecordError
        No record can be read.
    OutputError
        The folder cannot be written, or another process is at it.
    """
    definition = load_campaign(source)
    plan = make_plan(definition, read_inputs(definition))
    with ExitStack() as stack:
        # One process writes into a folder; on a network disk that could not be held to.
        if folder is not None:
            schema.refuse_network(Path(folder))
            stack.enter_context(schema.locked(Path(folder)))
        store = stack.enter_context(open_store(None if folder is None else Path(folder), plan)[0])
        engine = threads(processors() if jobs is None else jobs)
        # An interrupt loses the chunks under way; the others are kept, and given if that is wished.
        try:
            with told_progress(progress, sum(map(plan.size, range(plan.chunks))), "run") as told:
                carry_out(
                    plan,
                    store,
                    engine,
                    max_runs=max_runs,
                    tell=lambda now: told(now.done, now.runs),
                )
        except KeyboardInterrupt:
            if not partial:
                raise
        return CampaignRuns.of(store, plan.failures, plan.warnings)


_OF_BUILDINGS = ("buildings", "inventory", "building_types")
_ROWS = {**{table.name: -1 for table in schema.ROW_TABLES}, "chunks": 0}
"""Tables, and where in their rows the number of the chunk stands."""

_log = logging.getLogger(__name__)


def merge(folders: Sequence[Path], target: Path, *, partial: bool = False) -> Store:
    """Put the stores of several folders, which are all of one campaign, into the one in `target`;
    what several have is taken once.

    Parameters
    ----------
    partial : bool
        Whether runs may be in none of them.

    Raises
    ------
    UsageError
        A folder holds no campaign, or they hold different ones: what differs, one line each.
    AnalysisError
        Runs are in none of them: how many, and of which shards.
    OutputError
        The store cannot be written.
    """
    # One after the other: of a thousand shards not all files could be open at once.
    parts: list[_Part] = []
    for folder in folders:
        with open_existing(folder) as source:
            parts.append(_part(folder, source))
        _check_same(parts[0], parts[-1])
    # What the target has from an earlier call counts when missing runs are told.
    merged = list(parts)
    with (
        suppress(UsageError),
        open_existing(target) as before,
    ):  # none is there, or nothing is in it yet
        merged.append(_part(target, before))
    if (left := _told_left(merged)) and not partial:
        raise AnalysisError(f"{left}; add their folders, or accept that with --partial")
    name = str(target / FILE)
    with schema.sqlite_errors_reported(name):
        store = Store(schema.connect(name), name)
    with schema.closed_on_failure(store.connection):
        with schema.sqlite_errors_reported(name):
            if not is_empty(store):
                schema.check_store(store.connection, name)
                _check_same(merged[-1], parts[0])
            _take_buildings(parts, store)
        # Chunks that are damaged stay out, of the target and of the sources, and are told.
        if healed := store.heal():
            _tell(replace(merged[-1], name=name, damaged=healed))
        for part in parts:
            _tell(part)
            with _reopened(part) as source, schema.sqlite_errors_reported(name):
                _take_chunks(source, store, set(part.chunks))
    return store


@dataclass(frozen=True)
class _Part:
    """What a store of a part of a campaign has."""

    folder: Path
    name: str
    about: dict[str, str]
    runs: int
    shards: list[str]
    chunks: dict[int, int]
    damaged: int


def _part(folder: Path, store: Store) -> _Part:
    with schema.sqlite_errors_reported(store.name):
        damaged = schema.damaged_chunks(store.connection)
        chunks = dict(store.connection.execute("SELECT id, runs FROM chunks"))
        about = {key: store.meta(key) for key in ("fingerprint", "chunks", "inventory", "damage")}
        runs = int(store.meta("runs"))
    # Damaged chunks count as missing: they will not be taken.
    sound = {number: count for number, count in chunks.items() if number not in damaged}
    return _Part(folder, store.name, about, runs, store.shards(), sound, len(damaged))


def _reopened(part: _Part) -> Store:
    """The store of a part, which was looked at before."""
    return Store(schema.connect_to_read(part.folder / FILE), part.name)


def _check_same(part: _Part, other: _Part) -> None:
    if part.about == other.about:
        return
    if (
        part.about["fingerprint"] == other.about["fingerprint"]
        and part.about["chunks"] == other.about["chunks"]
    ):
        lines = (
            "what the inventory carries along, or damage: differs; call `tdint campaign` for each "
            "of them again"
        )
    else:
        with _reopened(part) as one, _reopened(other) as another:
            sides = one.sides(), another.sides()
            lines = all_differences(
                *sides, store=part.name, given=other.name, parts=bool(part.shards)
            )
    raise UsageError(f"{part.name} and {other.name} are of different campaigns\n{lines}")


def _told_left(parts: Sequence[_Part]) -> str:
    """How many runs are in none of some stores of one campaign, and the shards that they belong to;
    nothing if none."""
    held = {number: runs for part in parts for number, runs in part.chunks.items()}
    missing = sorted(set(range(int(parts[0].about["chunks"]))) - set(held))
    if not missing:
        return ""
    every = parts[0].runs
    told = f"{every - sum(held.values())} of {how_many(every, 'run')} are in none of the folders"
    # Shards of one division alone tell which are missing: that is the usual case.
    given = {text for part in parts for text in part.shards}
    if len(divisions := {int(text.partition("/")[2]) for text in given}) != 1:
        return told
    (of,) = divisions
    # A shard that was given may still lack chunks: it was not run to its end.
    lacking = [Shard(number, of).text for number in sorted({chunk % of + 1 for chunk in missing})]
    words = [f"{text} (not complete)" if text in given else text for text in lacking]
    return f"{told}: missing {'shard' if len(words) == 1 else 'shards'} {', '.join(words)}"


def _tell(part: _Part) -> None:
    if part.damaged:
        _log.warning(
            "%s: %d chunks of runs are not as they were written and are left out",
            part.name,
            part.damaged,
        )


def _copy(
    source: Store, target: Store, table: str, accept: Callable[[Any], bool] = lambda row: True
) -> None:
    rows = source.connection.execute(f"SELECT * FROM {table}")
    marks = ", ".join("?" * len(rows.description))
    target.connection.executemany(
        f"INSERT OR IGNORE INTO {table} VALUES({marks})", filter(accept, rows)
    )


def _take_buildings(parts: Sequence[_Part], target: Store) -> None:
    """Take what the campaign is, the first time, and the buildings of all parts: all of it or
    nothing."""
    with schema.transaction(target.connection, target.name):
        begins = is_empty(target)
        for statement in schema.TABLES if begins else ():
            target.connection.execute(statement)
        for number, part in enumerate(parts):
            with _reopened(part) as source:
                for table in (
                    *(("meta", "records") if begins and not number else ()),
                    *_OF_BUILDINGS,
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


def _take_chunks(source: Store, target: Store, sound: set[int]) -> None:
    """Take the chunks that a source has alone: of one that both have, the rows are not mixed."""
    new = sound - target.done()
    with schema.transaction(target.connection, target.name):
        for table, place in _ROWS.items():
            _copy(source, target, table, lambda row, place=place: row[place] in new)  # type: ignore[misc]
