"""Continuation after a change of records or buildings: --changed of `tdint run` and of `tdint
campaign` keeps the results of all other runs."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from selection import every
from tdint.studies.campaign import chunks as batch
from tdint.studies.campaign import plan

MODEL = """
units: {{force: kN, mass: t}}
stories:
  - mass: 200
    height: 3
    elements:
      - {{type: bilinear, stiffness: {stiffness}, yield_force: 200, hardening: 0.1}}
      - {{type: linear, stiffness: 1.0e+5}}
  - {{mass: 200, height: 3, stiffness: 3.0e+5}}
damping: {{modal: 5%}}
analysis: {{method: newmark-average}}
"""
CAMPAIGN = """
buildings: {models: [a.yaml, b.yaml]}
records: {files: [records], units: m/s^2}
intensity: {scales: [1, 2]}
outputs: {stories: true}
"""


def write_record(number, amplitude=1.0):
    t = 0.02 * np.arange(60)
    rows = "".join(f"{x:.2f},{amplitude * np.sin((3 + number) * x):.6f}\n" for x in t)
    Path(f"records/r{number}.csv").write_text(f"time_s,a_m_s2\n{rows}")


@pytest.fixture(params=every(2, ["parts of a chunk", "one run per chunk"]))
def integrated(request, folder, monkeypatch):
    """Files of a campaign; yields the list of the integrated runs."""
    if request.param == "one run per chunk":
        monkeypatch.setattr(plan, "_MIN_CHUNK_TIME", 1e-9)
    Path("a.yaml").write_text(MODEL.format(stiffness="2.0e+5"))
    Path("b.yaml").write_text(MODEL.format(stiffness="1.0e+5"))
    Path("study.yaml").write_text(CAMPAIGN)
    Path("records").mkdir()
    for number in range(4):
        write_record(number)
    runs = []
    unchanged = batch.run_batch

    def counted(subject, runs_of_chunk, **options):
        runs.extend(runs_of_chunk)
        return unchanged(subject, runs_of_chunk, **options)

    monkeypatch.setattr(batch, "run_batch", counted)
    return runs


def assert_same_tables(first, second):
    names = {file.name for file in Path(second).glob("*.csv")}
    assert names == {file.name for file in Path(first).glob("*.csv")}
    assert {"runs.csv", "profiles.csv", "elements.csv"} <= names
    for name in names:
        assert Path(first, name).read_bytes() == Path(second, name).read_bytes(), name


def test_a_repaired_record_is_added(integrated, tdint):
    broken = Path("records/r1.csv").read_text()
    first, *lines = broken.splitlines(keepends=True)
    Path("records/r1.csv").write_text(
        first + "".join(lines[:50]) + "oops,1\n" + "".join(lines[50:])
    )
    tdint("run", "a.yaml", "records", "--scale", "1,2", "-o", "out", code=4)
    Path("records/r1.csv").write_text(broken)
    command = ("run", "a.yaml", "records", "--scale", "1,2", "-o")
    error = tdint(*command, "out", code=6).stderr
    assert "--changed to keep the results of unchanged records and buildings" in error
    integrated.clear()
    result = tdint(*command, "out", "--changed", code=0)
    assert "the results of 6 of 8 runs are kept" in result.stderr
    assert len(integrated) == 2
    tdint(*command, "new", code=0)
    assert_same_tables("out", "new")
    # The same call continues: nothing is left to do, and no note is repeated.
    integrated.clear()
    assert "are kept" not in tdint(*command, "out", "--changed", code=0).stderr
    assert not integrated


@pytest.mark.long
def test_a_changed_record_and_a_changed_building_of_a_campaign(integrated, tdint):
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    write_record(0, amplitude=1.5)
    integrated.clear()
    result = tdint("campaign", "study.yaml", "-o", "out", "--changed", code=0)
    assert "the results of 12 of 16 runs are kept" in result.stderr
    assert len(integrated) == 4
    Path("b.yaml").write_text(MODEL.format(stiffness="1.5e+5"))
    integrated.clear()
    result = tdint("campaign", "study.yaml", "-o", "out", "--changed", code=0)
    assert "the results of 8 of 16 runs are kept" in result.stderr
    assert len(integrated) == 8
    tdint("campaign", "study.yaml", "-o", "new", code=0)
    assert_same_tables("out", "new")


def test_an_interrupted_campaign_keeps_its_completed_runs(integrated, tdint):
    tdint("campaign", "study.yaml", "-o", "out", "--max-runs", "1", code=0)
    count = len(integrated)
    Path("records/r3.csv").unlink()
    integrated.clear()
    tdint("campaign", "study.yaml", "-o", "out", "--changed", code=0)
    tdint("campaign", "study.yaml", "-o", "new", code=0)
    assert_same_tables("out", "new")
    assert len(integrated) == 12 + 12 - (12 if count == 16 else count)


def test_an_interrupted_change_keeps_the_earlier_campaign(integrated, tdint):
    """Store and tables remain those of the earlier campaign until all runs of the changed one are
    completed, and the next call continues."""
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    earlier = {file: file.read_bytes() for file in Path("out").iterdir() if file.suffix != ".lock"}
    Path("b.yaml").write_text(MODEL.format(stiffness="1.5e+5"))
    call = ("campaign", "study.yaml", "-o", "out", "--changed")
    integrated.clear()
    error = tdint(*call, "--max-runs", "1", code=0).stderr
    if len(integrated) < 8:  # otherwise the first chunk has all runs
        assert "the earlier campaign remains" in error
        assert {file: file.read_bytes() for file in earlier} == earlier
        tdint(*call, code=0)
    assert len(integrated) == 8
    assert not Path("out/campaign.sqlite.new").exists()
    tdint("campaign", "study.yaml", "-o", "new", code=0)
    assert_same_tables("out", "new")


def test_corrupt_results_are_not_kept(integrated, tdint):
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    with closing(sqlite3.connect("out/campaign.sqlite")) as store, store:
        store.execute("UPDATE run_rows SET peak_drift_m = 1 WHERE building = 0 AND record = 0")
    write_record(3, amplitude=1.5)
    tdint("campaign", "study.yaml", "-o", "out", "--changed", code=0)
    tdint("campaign", "study.yaml", "-o", "new", code=0)
    assert_same_tables("out", "new")


def test_other_settings_are_refused_and_the_results_remain(integrated, tdint):
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    before = Path("out/runs.csv").read_bytes()
    Path("study.yaml").write_text(CAMPAIGN.replace("[1, 2]", "[1, 3]"))
    error = tdint("campaign", "study.yaml", "-o", "out", "--changed", code=6).stderr
    assert "setting scales: [1.0, 2.0] in the store, [1.0, 3.0] in this campaign" in error
    assert "--changed to keep" not in tdint("campaign", "study.yaml", "-o", "out", code=6).stderr
    Path("study.yaml").write_text(CAMPAIGN)
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    assert Path("out/runs.csv").read_bytes() == before


def test_a_time_step_by_tolerance_and_parts_are_refused(integrated, tdint):
    tolerant = CAMPAIGN + "analysis: {tolerance: 5%}\n"
    Path("study.yaml").write_text(tolerant)
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    write_record(0, amplitude=1.5)
    error = tdint("campaign", "study.yaml", "-o", "out", "--changed", code=6).stderr
    assert "the time step of a building depends on all its records" in error
    Path("study.yaml").write_text(CAMPAIGN)
    tdint("campaign", "study.yaml", "-o", "part", "--shard", "1/2", code=0)
    write_record(0, amplitude=1.7)
    error = tdint("campaign", "study.yaml", "-o", "part", "--changed", code=6).stderr
    assert "the directory contains a part of a campaign (--shard)" in error


def test_changed_requires_a_directory(integrated, tdint):
    error = tdint("run", "a.yaml", "records", "--changed", code=2).stderr
    assert "--changed has no effect without -o" in error
