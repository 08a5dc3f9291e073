"""Allowed locations of a store, and the division of campaigns into chunks."""

import io
import math
import time
import tracemalloc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdint import spectrum, system
from tdint.errors import OutputError, UsageError
from tdint.ground_motion.reading.suites import suite_motions
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import load_model
from tdint.response.runs.batch import Subject
from tdint.studies.campaign import campaign_tables
from tdint.studies.campaign.assigned_motions import EveryMotion, FactorTable
from tdint.studies.campaign.buildings import digest_of, model_buildings
from tdint.studies.campaign.chunks import CampaignSettings, spectral_accelerations
from tdint.studies.campaign.execute import Advance, execute_plan, merge, threads
from tdint.studies.campaign.plan import Plan
from tdint.studies.store import schema
from tdint.studies.store.opening import open_store
from tdint.studies.store.schema import refuse_network

MOUNTS = """\
22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw
30 22 0:40 / {home} rw,relatime shared:2 - {kind} server:/export rw,vers=4.2
31 30 0:41 / {home}/local rw - xfs /dev/sdb1 rw
"""


@pytest.mark.parametrize("file_system", ["nfs4", "lustre", "cifs", "fuse.sshfs"])
def test_network_file_system_is_refused(
    tmp_path: Path, file_system: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A directory that does not exist yet is refused as well. A local disk that is mounted below it
    and an adjacent directory are accepted."""
    mounts = tmp_path / "mountinfo"
    home = tmp_path / "home"
    mounts.write_text(MOUNTS.format(home=home, kind=file_system))
    monkeypatch.setattr(system, "_MOUNTS", mounts)
    with pytest.raises(OutputError, match=rf"network file system \({file_system}\)"):
        refuse_network(home / "new" / "out")
    refuse_network(home / "local" / "out")
    refuse_network(tmp_path / "home2")
    monkeypatch.setattr(system, "_MOUNTS", tmp_path / "nowhere")
    refuse_network(home)


def plan_of(
    motions: dict[str, Any], factors: Sequence[int], buildings: int = 1, **settings: float
) -> Plan:
    """Return a plan of equal buildings under motions with given samples, each scaled by 1, 2, ...
    up to its number of factors."""
    model = load_model("configs/two-story-polynomial.yaml")
    suite = suite_motions(
        [Record(samples, 0.01, "", "", name, "r") for name, samples in motions.items()]
    )
    by_motion = {
        i: {float(f + 1): math.nan for f in range(factors[i])} for i in range(len(motions))
    }
    levels = FactorTable("factors.csv", {}, by_motion=by_motion)
    plan_buildings = model_buildings([Subject(model, "newmark-average")] * buildings)
    return Plan(
        "", plan_buildings, suite, EveryMotion(len(motions)), levels, CampaignSettings(**settings)
    )


@pytest.mark.long
@settings(max_examples=30)
@given(
    sizes=st.lists(st.integers(2, 4000), min_size=1, max_size=6),
    factors=st.lists(st.integers(1, 40), min_size=6, max_size=6),
    buildings=st.integers(1, 4),
)
def test_chunks_contain_every_run_once_in_order(
    sizes: list[int], factors: list[int], buildings: int
) -> None:
    plan = plan_of({f"c{i}": np.ones(size) for i, size in enumerate(sizes)}, factors, buildings)
    found = [
        (building.number, run)
        for number in range(plan.chunks)
        for building in plan.chunk(number).buildings
        for run in building.runs
    ]
    expected = [
        (b, (m, f, 0))
        for b in range(buildings)
        for m in range(len(sizes))
        for f in range(1, factors[m] + 1)
    ]
    assert found == expected and len(found) == plan.runs
    assert [plan.size(number) for number in range(plan.chunks)] == [
        sum(len(part.runs) for part in plan.chunk(number).buildings)
        for number in range(plan.chunks)
    ]


def test_tables_of_many_runs_need_little_time_and_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows are read from the store in batches. A run of 200 000 has about 300 steps; the time of
    the tables is at most a fifth of the time of the runs."""
    motions = {f"m{i}": np.sin(0.1 * (i + 1) * np.arange(300)) for i in range(40)}
    plan = plan_of(motions, [25] * 40, stories=True)
    store, _ = open_store(None, plan)
    with store:
        execute_plan(plan, store, threads(1))

        def write_tables() -> int:
            """Write the tables and return their size."""
            stream = io.BytesIO()
            for table in (
                campaign_tables.run_table(store),
                campaign_tables.part_table(store, schema.STORIES),
            ):
                table.write(stream)
            return stream.tell()

        start = time.process_time()
        size = write_tables()
        assert time.process_time() - start < 0.2 * store.seconds()
        monkeypatch.setattr(campaign_tables, "_ROWS_AT_ONCE", 20)
        rows = campaign_tables.run_table(store).rows
        tracemalloc.start()
        assert sum(1 for _ in rows) == plan.runs == 1000
        campaign_tables.run_table(store).write(io.BufferedWriter(_Nothing()))
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 0.4 * size


class _Nothing(io.RawIOBase):
    """Stream that forgets what is written."""

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        return len(data)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ({}, {"duration": 0.4}, "setting duration"),
        ({}, {"names": ("b", "a")}, "the order of buildings or records differs"),
        ({}, {"peak": 2.0}, "record"),
    ],
)
def test_parts_of_different_campaigns_are_not_merged(
    tmp_path: Path, first: Any, second: Any, message: str
) -> None:
    """The message states only the difference."""
    for name, changed in (("one", first), ("other", second)):
        (tmp_path / name).mkdir()
        open_store(tmp_path / name, small_plan(**changed))[0].connection.close()
    with pytest.raises(UsageError) as caught:
        merge([tmp_path / "one", tmp_path / "other"], tmp_path)
    _, *lines = str(caught.value).splitlines()
    assert len(lines) == 1 and lines[0].startswith(message)


def test_parts_with_different_chunks_are_not_merged(tmp_path: Path) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        store, _ = open_store(tmp_path / name, small_plan())
        if name == "other":
            store.connection.execute("UPDATE meta SET value = value + 1 WHERE key = 'chunks'")
            store.seal()
        store.connection.close()
    with pytest.raises(UsageError, match="belong to different campaigns"):
        merge([tmp_path / "one", tmp_path / "other"], tmp_path)


def small_plan(
    names: tuple[str, ...] = ("a", "b"), peak: float = 1.0, duration: float = 0.3
) -> Plan:
    """Return a plan of two short motions on one building; `peak` is the peak of the first
    motion."""
    peaks = {"a": peak, "b": 3.0}
    return plan_of({name: np.full(30, peaks[name]) for name in names}, [2, 2], duration=duration)


def test_rate_counts_runs_of_this_call() -> None:
    assert Advance(done=30, runs=40, before=10, seconds=4.0).rate == 5.0
    assert Advance(done=30, runs=40, before=30, seconds=0.0).rate == 0.0


def test_too_short_period_does_not_affect_other_periods() -> None:
    """Sa of several buildings is computed at once, and each value equals the value of a separate
    call."""
    record = Record(np.sin(np.arange(400.0)), 0.01, "", "", "", "r")
    short = 0.01 * record.dt  # oscillators need a twentieth
    periods = [1.0, short, 0.5, short]
    together = spectral_accelerations(record, periods)
    assert together == [spectral_accelerations(record, [period])[0] for period in periods]
    assert [value is None for value in together] == [False, True, False, True]
    assert together[0] == pytest.approx(spectrum(record, np.array([1.0]), 0.05).psa[0], rel=1e-12)


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("fluid-dampers", "fd5d45665596a894"),
        ("oil-dampers", "b4730696705ae164"),
        ("frame-matrix", "db7e9d93f9c62cd3"),
    ],
)
def test_digests_of_buildings_do_not_depend_on_the_classes_of_their_parts(
    name: str, digest: str
) -> None:
    """Stores of earlier versions contain these digests, which identify the buildings."""
    model = load_model(Path(__file__).parents[3] / "configs" / f"{name}.yaml")
    assert digest_of(model, "impulse4").startswith(digest)
