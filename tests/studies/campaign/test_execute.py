"""Remaining chunks and progress of campaigns are counted, without time integration."""

from collections.abc import Iterator, Sequence
from types import SimpleNamespace

import pytest

from tdint.errors import UsageError
from tdint.studies.campaign import execute as module
from tdint.studies.campaign.execute import Advance, Shard, execute_plan, threads

CHUNKS = 9


def size(number: int) -> int:
    return 3 + number


class Kept:
    name, connection = "", None

    def __init__(self, *ready: int) -> None:
        self.ready, self.added = set(ready), list[int]()

    def completed_chunks(self) -> set[int]:
        return self.ready

    def add_shards(self, shard_runs: dict[str, int]) -> None:
        """Ignore the shard, because no test merges it."""

    def record_time_loops(self, kind: str) -> None:
        """Ignore the kind of the time loops, because no test writes a summary."""

    def started_chunks(self) -> dict[int, object]:
        return {}

    def add(self, done: SimpleNamespace, *, is_part: bool, replaces_part: bool) -> None:
        assert not replaces_part
        assert is_part == (len(done.rows.runs) < size(done.number))
        self.added.append(done.number)


def engine(plan: SimpleNamespace, numbers: Sequence[int]) -> Iterator[SimpleNamespace]:
    for number in numbers:
        count = plan.most.get(number, size(number))
        yield SimpleNamespace(number=number, rows=SimpleNamespace(runs=[None] * count))


@pytest.fixture(autouse=True)
def no_compilation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "compile_for", lambda plan: None)
    monkeypatch.setattr(module.schema, "start_log", lambda connection, name: None)


@pytest.mark.parametrize("shard", [None, Shard(1, 3), Shard(2, 3), Shard(3, 3)])
@pytest.mark.parametrize("ready", [(), (0, 1, 5), tuple(range(CHUNKS))])
@pytest.mark.parametrize("max_runs", [None, 1, 9])
def test_remaining_chunks_are_executed_in_order(
    shard: Shard | None, ready: tuple[int, ...], max_runs: int | None
) -> None:
    shard_chunks = [
        number for number in range(CHUNKS) if shard is None or number % 3 + 1 == shard.number
    ]
    requested: list[int] = []
    for number in shard_chunks:
        if number not in ready and (max_runs is None or sum(map(size, requested)) < max_runs):
            requested.append(number)
    total = sum(map(size, requested))
    total = total if max_runs is None else min(total, max_runs)
    before = sum(size(number) for number in shard_chunks if number in ready)
    store, reported = Kept(*ready), list[Advance]()
    last = execute_plan(
        SimpleNamespace(chunks=CHUNKS, size=size, kept={}, most={}),
        store,
        engine,
        shard=shard,
        max_runs=max_runs,
        on_chunk=reported.append,
    )
    assert store.added == requested
    assert [advance.done for advance in reported] == [
        before + min(sum(map(size, requested[: i + 1])), total) for i in range(len(requested))
    ]
    for advance in (*reported, last):
        assert (advance.runs, advance.before) == (before + total, before)
        assert 0.0 <= advance.seconds < 60.0
    assert last.done == last.runs and (requested or last.seconds == 0.0)


def test_at_least_one_job_is_required() -> None:
    threads(1)
    with pytest.raises(UsageError, match=r"jobs .*at least 1, got 0"):
        threads(0)
