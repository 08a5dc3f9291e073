"""`tdint campaign`, and `tdint run` with several records or scales: files, messages, exit codes."""

import hashlib
import json
import math
import re
import shutil
import socket
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from cli.conftest import Command, change, copy_of, made_once, write_folder, write_record
from csv_rows import rows
from tdint.studies.campaign import campaign_tables as campaign
from tdint.studies.store.result_store import FILE
from tdint.studies.store.schema import locked

COLUMNS = [column.name for column in campaign.RUNS]
STUDY = """\
name: study
buildings: {models: [shaken.yaml, stiff.yaml]}
records: {files: [motion.mseed, other.mseed], units: m/s^2}
intensity: {scales: [0.25, 1, 2.5]}
analysis: {method: newmark-average}
outputs: {stories: true}
"""
STIFF = """\
name: stiff
stories:
  - {mass: 10, height: 3, stiffness: 80000}
damping: {rayleigh: {mass: 0.5, stiffness: 0.001}}
"""
RUNS = 2 * 3 * 3  # buildings, components (two in motion.mseed, one in other.mseed), scales


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory `out` of the completed campaign study.yaml (two buildings, three components, three
    scales) with several chunks."""

    def make(folder: Path) -> None:
        write_folder(folder)
        write_record(folder / "motion.mseed", "HNE", "HNN", samples=2400)
        write_record(folder / "other.mseed", "HNE", peak=1.0, samples=2400)
        (folder / "study.yaml").write_text(STUDY)
        (folder / "stiff.yaml").write_text(STIFF)
        Command()("campaign", "study.yaml", "-o", "out", code=0)

    return made_once(tmp_path_factory, make)


study = copy_of("done")


def test_check_adds_an_error_column_for_each_demand(study: Path, tdint: Command) -> None:
    """With `check`, runs.csv and stories.csv contain the estimated errors of `tdint run`, and the
    summary reports them. `tdint run` with several records also supports --check."""
    change("study.yaml", ("method: newmark-average", "method: moment4, check: true"))
    tdint("campaign", "study.yaml", "-o", "checked", code=0)
    found, plain = rows("checked/runs.csv"), rows("out/runs.csv")
    named = [name for name in COLUMNS[12:21] if not name.endswith(("_story", "_floor"))]
    assert list(plain[0]) == COLUMNS
    assert list(found[0]) == [*plain[0], *(f"{name}_error" for name in named)]
    own = list(rows("out/stories.csv")[0])
    quantities = [
        name
        for name in own
        if name not in ("building", "record", "component", "scale", "story", "height_m")
    ]
    assert list(rows("checked/stories.csv")[0]) == [*own, *(f"{name}_error" for name in quantities)]
    single_run = "run shaken.yaml motion.mseed --units m/s^2 --component HNN --method moment4"
    tdint(single_run, "--scale", "0.25", "-o", "alone", code=0)
    errors = json.loads(Path("alone/summary.json").read_text())["check"]["errors"]
    run = found[3]
    assert (run["component"], run["scale"]) == ("HNN", "0.25")
    assert float(run["peak_drift_m_error"]) == pytest.approx(errors["drift_m_error"], rel=1e-11)
    assert float(run["peak_base_shear_N_error"]) == pytest.approx(
        errors["base_shear_N_error"], rel=1e-11
    )
    stories = [
        row
        for row in rows("checked/stories.csv")
        if list(row.values())[:4] == list(run.values())[:4]
    ]
    single_stories = rows("alone/stories.csv")
    for name in ("peak_shear_N_error", "peak_drift_ratio_error"):
        assert [row[name] for row in stories] == [
            row[name] for row in single_stories
        ] and single_stories[0][name]
    summary = json.loads(Path("checked/summary.json").read_text())
    unknown = [row for row in found if row["peak_drift_m"] and not row["peak_drift_m_error"]]
    assert summary["without_an_error"] == len(unknown) and summary["settings"]["check"] is True
    assert "peak_drift_m_error" in summary["columns"]
    several = rows(tdint(single_run, "--scale", "0.25,1", "--check").stdout)
    assert several[0]["peak_drift_m_error"] == run["peak_drift_m_error"]


def test_the_summary_lists_the_model_files_of_the_last_call(study: Path, tdint: Command) -> None:
    """The summary lists each input file with its digest of the last call. A changed comment changes
    the file but not the campaign."""
    files = ("shaken.yaml", "stiff.yaml", "study.yaml", "motion.mseed", "other.mseed")

    def recorded_digests() -> dict[str, str]:
        inputs = json.loads(Path("varied/summary.json").read_text())["inputs"]
        return {entry["file"]: entry["sha256"] for entry in inputs}

    def file_digests() -> dict[str, str]:
        return {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in files}

    change(
        "study.yaml",
        ("outputs:", "vary: {stiffness_factor: [1, 1.1]}\noutputs:"),
        ("0.25, 1, 2.5", "1"),
    )
    tdint("campaign", "study.yaml", "-o", "varied", code=0)
    before = recorded_digests()
    assert before == file_digests()
    Path("stiff.yaml").write_text(STIFF + "# checked\n")
    again = tdint("campaign", "study.yaml", "-o", "varied")
    assert "nothing to do" in again.stderr and recorded_digests() == file_digests() != before
    tdint("campaign", "export", "varied", code=0)
    assert recorded_digests() == file_digests()


def test_each_run_has_a_row(study: Path, tdint: Command) -> None:
    """The values equal the results of `tdint run`. Buildings, records and scales keep their
    order."""
    assert sorted(path.name for path in Path("out").iterdir()) == [
    ".campaign.lock", FILE, "profiles.csv", "runs.csv", "stories.csv", "summary.json",
    ]  # fmt: skip
    table = rows("out/runs.csv")
    assert [(row["building"], row["record"], row["component"], row["scale"]) for row in table] == [
        (building, record, component, scale)
        for building in ("shaken", "stiff")
        for record, component in (
            ("motion.mseed", "HNE"),
            ("motion.mseed", "HNN"),
            ("other.mseed", "HNE"),
        )
        for scale in ("0.25", "1", "2.5")
    ]
    assert {
        (row["method"], row["dt_s"], row["status"], row["steps"], row["sample"]) for row in table
    } == {("newmark-average", "0.01", "done", "2399", "0")}
    tdint("run shaken.yaml --component HNN --scale 2.5 --units m/s^2 --no-check -o one")
    summary, stories = json.loads(Path("one/summary.json").read_text()), rows("one/stories.csv")
    row = table[5]
    assert np.isclose(float(row["sa_t1_m_s2"]), summary["building"]["sa_t1_m_s2"], rtol=1e-11)
    assert float(row["peak_drift_ratio"]) == max(
        float(story["peak_drift_ratio"]) for story in stories
    )
    campaign_stories = [
        story
        for story in rows("out/stories.csv")
        if list(story.values())[:4] == list(row.values())[:4]
    ]
    # Campaigns do not store hysteretic energies.
    for story in stories:
        del story["hysteretic_energy_J"]
    assert [{name: story[name] for name in stories[0]} for story in campaign_stories] == stories


@pytest.mark.long
def test_results_do_not_depend_on_threads_and_shards(study: Path, tdint: Command) -> None:
    """One thread, three threads, and three shards merged in any order give equal files."""
    names = ("runs.csv", "stories.csv")
    expected = [(Path("out") / name).read_bytes() for name in names]
    for directory, jobs in (("one", "1"), ("three", "3")):
        tdint("campaign", "study.yaml", "-o", directory, "--jobs", jobs)
    for shard in ("1/3", "2/3", "3/3"):
        tdint("campaign", "study.yaml", "-o", f"part-{shard[0]}", "--shard", shard, code=0)
    parts = ["part-3", "part-1", "part-2"]
    assert sum(len(rows(f"{part}/runs.csv")) for part in parts) == RUNS
    incomplete = tdint("-q", "campaign", "merge", *parts[:2], "-o", "half", code=5)
    assert not Path("half", FILE).exists()
    missing = len(rows("part-2/runs.csv"))
    assert re.search(rf"\b{missing} of {RUNS} runs .*shard 2/3", incomplete.stderr)
    result = tdint("campaign", "merge", *parts[:2], "-o", "half", "--partial", code=0)
    assert re.search(rf"\b{missing}\b.* runs .*missing", result.stderr)
    shutil.copytree("half", "added")
    # The merge adds runs to an existing store.
    assert tdint("campaign", "merge", "part-2", "-o", "added").exit_code == 0
    assert tdint("campaign", "merge", *parts, "part-3", "-o", "all").exit_code == 0
    # The campaign performs the runs that are missing in the merged shards.
    assert tdint("campaign", "study.yaml", "-o", "half").exit_code == 0
    for directory in ("one", "three", "all", "added", "half"):
        assert [(Path(directory) / name).read_bytes() for name in names] == expected, directory


@pytest.mark.long
def test_shards_of_elements_attachments_and_links_merge(folder: Path, tdint: Command) -> None:
    """All tables of the merged shards have the bytes of one campaign."""
    Path("attached.yaml").write_text(
        "stories:\n"
        "  - {mass: 10, height: 3, elements: [{name: a, type: bilinear, stiffness: 5000, "
        "yield_force: 20, hardening: 0.1}, {name: b, type: linear, stiffness: 3000}]}\n"
        "  - {mass: 10, height: 3, stiffness: 8000}\n"
        "damping: 5%\n"
        "attachments: [{name: tank, floor: 1, mass: 0.5, stiffness: 200}]\n"
        "links: [{name: tie, from: tank, to: 2, stiffness: 50}]\n"
    )
    Path("study.yaml").write_text(
        "buildings: {models: [attached.yaml, shaken.yaml]}\n"
        "records: {files: [motion.mseed, other.mseed], units: m/s^2, component: HNE}\n"
        "intensity: {scales: [0.5, 1]}\n"
        "outputs: {stories: true, profiles: true}\n"
    )
    tdint("campaign", "study.yaml", "-o", "one", code=0)
    for shard in ("1/2", "2/2"):
        tdint("campaign", "study.yaml", "-o", f"part-{shard[0]}", "--shard", shard, code=0)
    tdint("campaign", "merge", "part-2", "part-1", "-o", "all", code=0)
    tables = {file.name: file.read_bytes() for file in Path("one").glob("*.csv")}
    assert {"runs.csv", "stories.csv", "elements.csv"} <= tables.keys()
    assert {file.name: file.read_bytes() for file in Path("all").glob("*.csv")} == tables


def test_an_interrupted_campaign_continues(study: Path, tdint: Command) -> None:
    """An interrupted campaign continues. All commands that use its runs report the missing runs."""
    first = tdint("campaign", "study.yaml", "-o", "part", "--max-runs", "4", code=0)
    done = len(rows("part/runs.csv"))
    assert done == 4
    message, commands = (
        f"{done} of {RUNS} runs are done",
        (["campaign", "export"], ["fragility"], ["sensitivity"]),
    )
    assert message in first.stderr and all(
        message in tdint(*command, "part").stderr for command in commands
    )
    status = tdint("campaign", "status", "part")
    assert status.stdout == f"status,runs\ndone,{done}\nleft,{RUNS - done}\n"
    assert f"{done} of {RUNS} runs completed" in status.stderr
    continued = tdint("campaign", "study.yaml", "-o", "part")
    assert f"{RUNS - done} runs, {done} before.\n" in continued.stderr
    assert not any("runs are done" in tdint(*command, "part").stderr for command in commands)
    assert Path("part/runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()
    again = tdint("campaign", "study.yaml", "-o", "part", code=0)
    assert re.search(rf"\bruns \({RUNS}\) .*nothing", again.stderr)


def test_a_limit_of_runs_is_exact_within_a_chunk(study: Path, tdint: Command) -> None:
    """The next call continues in the chunk. A merge copies complete chunks only, also into the
    directory with a part of a chunk."""
    for limit, total in ((1, 1), (2, 3), (1, 4)):
        tdint("campaign", "study.yaml", "-o", "part", "--max-runs", f"{limit}", code=0)
        assert len(rows("part/runs.csv")) == total
    tdint("campaign", "merge", "out", "part", "-o", "merged", code=0)
    tdint("campaign", "merge", "part", "out", "-o", "part", code=0)
    for folder in ("merged", "part"):
        assert Path(folder, "runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()
        again = tdint("campaign", "study.yaml", "-o", folder, code=0)
        assert re.search(rf"\bruns \({RUNS}\) .*nothing", again.stderr)
    # A part of a chunk that was edited is run again.
    tdint("campaign", "study.yaml", "-o", "edited", "--max-runs", "1", code=0)
    with sqlite3.connect("edited/campaign.sqlite") as store:
        (number,) = store.execute("SELECT id FROM chunks").fetchone()
        assert number < 0
        store.execute("UPDATE chunks SET seconds = 7")
    store.close()
    message = "1 chunks of runs are corrupt or incomplete"
    assert message in tdint("campaign", "study.yaml", "-o", "edited", code=0).stderr
    assert Path("edited/runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()


def test_a_directory_contains_only_one_campaign(study: Path, tdint: Command) -> None:
    """The error names the difference: settings, buildings or records. A new file name or another
    directory is not a difference."""
    before = Path("out/runs.csv").read_bytes()
    change("study.yaml", ("0.25, 1,", "0.5, 1,"), ("newmark-average", "impulse4"))
    change("shaken.yaml", ("8000", "9000"))
    write_record(study / "other.mseed", "HNE", peak=1.5, samples=2400)
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, Path("out/runs.csv").read_bytes()) == (6, before)
    for line in (
        "contains another campaign; specify another directory with -o",
        "setting scales: [0.25, 1.0, 2.5] in the store, [0.5, 1.0, 2.5] in this campaign",
        "building shaken: differs",
        "record other.mseed HNE: differs",
    ):
        assert line in result.stderr
    assert "record motion.mseed" not in result.stderr
    change("study.yaml", ("name: study", "name: other"))
    tdint("campaign", "study.yaml", "-o", "new")
    assert (
        "to different campaigns"
        in tdint("campaign", "merge", "out", "new", "-o", "all", code=2).stderr
    )
    assert not Path("all", FILE).exists()


def test_all_errors_of_a_campaign_file_are_reported_at_once(study: Path, tdint: Command) -> None:
    Path("bad.yaml").write_text(
        "buildings: {models: [shaken.yaml], units: {length: ft}}\n"
        "records: {file: [motion.mseed], pairs: maybe, component: HNE}\n"
        "intensity: {measure: sa, period: -1, levels: [0.1, 0.2 m, 0.3 g]}\n"
        "analysis: {method: newmarck, dt: 0}\n"
        "outputs: {stories: yes}\n"
    )
    result = tdint.refused("did you mean 'files'?", "campaign", "bad.yaml", "-o", "new", code=3)
    assert "newmark" in result.stderr
    found = [
        line.removeprefix("Error: bad.yaml:").split(": ", 2)[:2]
        for line in result.stderr.splitlines()
    ]
    assert [position for position, _ in found] == sorted(
        (position for position, _ in found), key=lambda text: text.split(":")
    )
    assert [key for _, key in found] == [
        "buildings.units", "records.file", "records.pairs", "intensity.period",
        "intensity.levels[1]", "intensity.levels[2]", "analysis.method", "analysis.dt",
        "outputs.stories",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "empty; ... `buildings` and `records`"),
        ("buildings: {models: []}\nrecords: {files: [motion.mseed]}\n", "is empty; ... model file"),
        ("buildings: {models: [a.yaml]}\n", "records: is missing; give `files` or a `grid`"),
        ("buildings: {inventory: a.csv}\nrecords: {files: [b]}\n", "buildings.units: is missing"),
        ("buildings: {models: [nowhere.yaml]}\nrecords: {files: [motion.mseed]}\n",
         "nowhere.yaml: file not found"),
        (STUDY.replace("scales: [0.25, 1, 2.5]", "measure: d5-95, levels: [0.1 m/s]"),
         "d5-95 ... levels: "),
        (STUDY.replace("scales: [0.25, 1, 2.5]", "factors: bad.csv"),
         "bad.csv:2: factor must be a number"),
    ],
)  # fmt: skip
def test_invalid_campaign_files_are_refused(
    study: Path, tdint: Command, content: str, message: str
) -> None:
    Path("bad.yaml").write_text(content)
    Path("bad.csv").write_text("record,component,factor\nmotion.mseed,,zwei\n")
    tdint.refused(message, "campaign", "bad.yaml", "-o", "new", code=3)


def test_unreadable_records_are_reported_and_the_others_run(study: Path, tdint: Command) -> None:
    """summary.json and `status` list and count the unreadable records of the last call."""
    Path("broken.mseed").write_bytes(b"no record at all")
    change("study.yaml", ("other.mseed]", "broken.mseed, nowhere.mseed, other.mseed]"))
    result = tdint("campaign", "study.yaml", "-o", "lost", code=4)
    assert len(rows("lost/runs.csv")) == RUNS
    errors = [line for line in result.stderr.splitlines() if line.startswith("Error: ")]
    unused = json.loads(Path("lost/summary.json").read_text())["not_used"]
    assert (unused["records"]["count"], unused["buildings"]) == (2, {"count": 0, "reasons": []})
    for broken, nowhere in (errors, unused["records"]["reasons"]):
        assert "broken.mseed" in broken and "nowhere.mseed: file not found" in nowhere
    messages = tdint("campaign", "status", "lost", code=0).stderr
    assert "2 records could not be used" in messages and "nowhere.mseed" in messages
    change("study.yaml", ("broken.mseed, ", ""))
    tdint("campaign", "study.yaml", "-o", "lost", code=4)
    assert "1 record could not be used" in tdint("campaign", "status", "lost").stderr
    tdint("campaign", "merge", "lost", "-o", "all")
    assert json.loads(Path("all/summary.json").read_text())["not_used"]["records"]["count"] == 1
    change("study.yaml", ("motion.mseed, nowhere.mseed, other.mseed]", "nowhere.mseed]"))
    tdint("campaign", "study.yaml", "-o", "empty", code=4)
    assert not Path("empty").exists()


def test_failed_runs_are_rows_with_their_status(study: Path, tdint: Command) -> None:
    change("study.yaml", ("method: newmark-average", "method: central-difference"))
    change("stiff.yaml", ("80000", "80000000"))
    result = tdint("campaign", "study.yaml", "-o", "failed", code=0)
    assert "9 runs without a result (9 unstable-step)" in result.stderr
    table = rows("failed/runs.csv")
    assert [row["status"] for row in table] == 9 * ["done"] + 9 * ["unstable-step"]
    assert all(
        row["peak_drift_m"] == "" and row["steps"] == "" and row["pga_m_s2"] for row in table[9:]
    )
    tdint("campaign", "export", "failed", "--output-units", "kN,mm", code=0)
    assert [row["peak_drift_mm"] for row in rows("failed/runs.csv")[9:]] == 9 * [""]


def test_a_time_step_that_fits_no_record_is_refused_before_files_are_written(
    study: Path, tdint: Command
) -> None:
    change("study.yaml", ("method: newmark-average", "dt: 0.007"))
    tdint.refused("motion.mseed HNE: dt ... 0.01 s", "campaign", "study.yaml", "-o", "new")


def test_a_second_writer_is_refused(study: Path, tdint: Command) -> None:
    Path("new").mkdir()
    with locked(Path("new")):
        tdint.refused("in use by another tdint process", "campaign study.yaml -o new", code=6)
    assert not Path("new", FILE).exists()


@pytest.mark.parametrize("port_of", [lambda server: 1, lambda server: server.getsockname()[1]])
def test_an_unresponsive_scheduler_is_reported(
    study: Path,
    tdint: Command,
    monkeypatch: pytest.MonkeyPatch,
    port_of: Callable[[socket.socket], int],
) -> None:
    """The error is the same if no program listens at the port, and if a program listens without
    responding."""
    pytest.importorskip("distributed")
    monkeypatch.setattr("tdint.studies.campaign.cluster._NOTICE_AFTER", 0.1)
    monkeypatch.setattr("tdint.studies.campaign.cluster._TIMEOUT", 0.6)
    with socket.create_server(("127.0.0.1", 0)) as server:
        result = tdint(
            "campaign study.yaml -o new --dask", f"tcp://127.0.0.1:{port_of(server)}", code=2
        )
    assert "no response from the scheduler yet; waiting" in result.stderr
    assert "no scheduler responds (" in result.stderr.splitlines()[-1]
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["study.yaml"], "-o DIR is required"),
        (["study.yaml", "shaken.yaml", "-o", "new"], "one campaign file is required, got 2"),
        (["study.yaml", "-o", "new", "--shard", "4/3"], "--shard must be K/N"),
        (["status"], "exactly one directory is required"),
        (["status", "nowhere"], "no campaign in this directory"),
        (["study.yaml", "-o", "new", "--baseline", "shakn"], "building 'shakn' not found"),
        (["merge", "-o", "all"], "directories to merge and -o DIR are required"),
        (["merge", "nowhere", "-o", "all"], "no campaign in this directory"),
        (["study.yaml", "-o", "new", "--dask", "tcp://far.example:8786"], "must be encrypted"),
        (["study.yaml", "-o", "new", "--dask", "far.example"], "invalid scheduler address"),
        (
            ["study.yaml", "-o", "new", "--dask", "tcp://localhost:8786/../x"],
            "invalid scheduler address",
        ),
        (
            ["study.yaml", "-o", "new", "--dask", "tcp://me:secret@localhost:8786"],
            "invalid scheduler address",
        ),
    ],
)
def test_usage_errors(study: Path, tdint: Command, arguments: list[str], message: str) -> None:
    tdint.refused(message, "campaign", *arguments)


def test_a_tolerance_selects_the_time_step_of_each_building(study: Path, tdint: Command) -> None:
    """All runs of a building have the same time step, also with several jobs. For the runs that
    were used for the choice, `tdint run` chooses no smaller step."""
    change(
        "study.yaml",
        ("method: newmark-average", "method: newmark-average, tolerance: 0.1%"),
        ("0.25, 1, 2.5", "1"),
    )
    tdint("campaign", "study.yaml", "-o", "steps", "--jobs", "2", code=0)
    steps = {(row["building"], row["dt_s"]) for row in rows("steps/runs.csv")}
    assert len(steps) == 2 and min(float(dt) for _, dt in steps) < 0.01
    run = "run shaken.yaml --record motion.mseed --units m/s^2 --component HNN --scale 1"
    tdint(run, "--tolerance", "0.1%", "-o", "one", code=0)
    assert float(dict(steps)["shaken"]) <= json.loads(Path("one/summary.json").read_text())["dt_s"]


def test_intensity_levels_of_a_measure(study: Path, tdint: Command) -> None:
    """The motions of each building have the requested Sa(T1). Both components of a pair have one
    factor, also without `pairs`, and the geometric mean of their Sa(T1) or PGA has the requested
    value."""
    change(
        "study.yaml",
        ("scales: [0.25, 1, 2.5]", "measure: sa, period: T1, levels: [0.1 g, 250 cm/s^2]"),
    )
    tdint("campaign", "study.yaml", "-o", "sa", code=0)
    motions: dict[tuple[str, ...], list[dict[str, str]]] = {}
    for row in rows("sa/runs.csv"):
        motions.setdefault((row["building"], row["motion"], row["level"]), []).append(row)
    assert [len(components) for components in motions.values()].count(2) == 2 * 2
    for (_, _, level), components in motions.items():
        assert len({row["scale"] for row in components}) == 1
        found = math.prod(float(row["sa_t1_m_s2"]) for row in components) ** (1 / len(components))
        assert found == pytest.approx(float(level), rel=1e-11)
    assert {float(level) for _, _, level in motions} == {0.980665, 2.5} and len(
        motions
    ) == 2 * 2 * 2
    change(
        "study.yaml",
        ("measure: sa, period: T1, levels: [0.1 g, 250 cm/s^2]", "measure: pga, levels: [2 m/s^2]"),
    )
    change("study.yaml", ("[motion.mseed, other.mseed], ", "[motion.mseed], pairs: true, "))
    tdint("campaign", "study.yaml", "-o", "pga", code=0)
    first, second = rows("pga/runs.csv")[:2]
    assert first["scale"] == second["scale"]
    assert np.isclose(float(first["pga_m_s2"]) * float(second["pga_m_s2"]), 4.0, rtol=1e-11)


def test_correlations_of_a_sweep_at_levels_of_a_measure(study: Path, tdint: Command) -> None:
    """The scale factors of a level depend on the motion and on the building: the motions of a level
    are combined, and the variations are compared at the same level."""
    change("study.yaml", ("scales: [0.25, 1, 2.5]", "measure: sa, levels: [0.1 g, 250 cm/s^2]"))
    with Path("study.yaml").open("a") as file:
        file.write("vary: {stiffness_factor: [0.7, 0.9, 1.2, 1.5]}\n")
    tdint("campaign", "study.yaml", "-o", "sa", code=0)
    tdint("sensitivity", "sa", "-o", "correlations.csv", code=0)
    runs = rows("sa/runs.csv")
    drifts = [row for row in rows("correlations.csv") if row["quantity"] == "peak_drift_ratio"]
    assert len(drifts) == 2 * 2
    for row in drifts:
        medians: dict[float, list[float]] = {}
        for run in runs:
            is_at_level = np.isclose(float(run["sa_t1_m_s2"]), float(row["level"]))
            if run["building"].startswith(f"{row['building']}: ") and is_at_level:
                peaks = medians.setdefault(float(run["stiffness_factor"]), [])
                peaks.append(float(run["peak_drift_ratio"]))
        expected = spearmanr(list(medians), [np.median(item) for item in medians.values()])
        assert (row["scale"], row["draws"]) == ("", "4")
        assert float(row["rank_correlation"]) == pytest.approx(expected.statistic)


def test_an_effect_on_a_peak_of_zero_is_unknown(study: Path, tdint: Command) -> None:
    Path("still.csv").write_text("time_s,a_m_s2\n" + "".join(f"{t / 100},0\n" for t in range(100)))
    end = "3 runs. No effect on the peak drift ratio is known, because peaks are zero or missing.\n"
    said = tdint("sensitivity", "stiff.yaml", "still.csv", "--vary", "mass_factor=1:2", code=0)
    assert said.stderr.endswith(end)


def test_factors_from_a_file(study: Path, tdint: Command) -> None:
    Path("factors.csv").write_text(
        "record,component,factor\nmotion.mseed,HNE,2\nmotion.mseed,,0.5\nother.mseed,HNE,3\nother.mseed,HNE,4\n"
    )
    change("study.yaml", ("scales: [0.25, 1, 2.5]", "factors: factors.csv"))
    tdint("campaign", "study.yaml", "-o", "new", code=0)
    assert [row["scale"] for row in rows("new/runs.csv")] == 2 * ["2", "0.5", "3", "4"]


def test_export_writes_the_tables_again(study: Path, tdint: Command) -> None:
    """The export has SimCenter names: floor 0 is the ground, and both directions of a pair are in
    one row."""
    change(
        "study.yaml", ("files: [motion.mseed, other.mseed]", "files: [motion.mseed], pairs: true")
    )
    tdint("campaign", "study.yaml", "-o", "pairs")
    before = Path("pairs/runs.csv").read_bytes()
    Path("pairs/runs.csv").unlink()
    tdint("campaign", "export", "pairs", "--simcenter", code=0)
    assert Path("pairs/runs.csv").read_bytes() == before
    table = rows("pairs/simcenter.csv")
    assert [(row["building"], row["scale"]) for row in table] == [
        (building, scale) for building in ("shaken", "stiff") for scale in ("0.25", "1", "2.5")
    ]
    first = table[0]
    names = ("PFA-0", "PFA-1", "PFA-2", "PID-1", "PID-2", "PRD-1", "PFD-1", "PFD-2")
    assert list(first)[4:] == [f"1-{name}-{direction}" for direction in "12" for name in names]
    runs, stories = rows("pairs/runs.csv"), rows("pairs/stories.csv")
    for direction, component in (("1", "HNN"), ("2", "HNE")):
        run = next(row for row in runs if row["component"] == component)
        peaks = [
            row for row in stories if row["component"] == component and row["scale"] == "0.25"
        ][:2]
        assert first[f"1-PFA-0-{direction}"] == run["pga_m_s2"]
        assert [first[f"1-PID-{i}-{direction}"] for i in (1, 2)] == [
            row["peak_drift_ratio"] for row in peaks
        ]
        assert [first[f"1-PFD-{i}-{direction}"] for i in (1, 2)] == [
            row["peak_displacement_m"] for row in peaks
        ]
        roof = float(peaks[1]["peak_displacement_m"]) / 6.0
        assert np.isclose(float(first[f"1-PRD-1-{direction}"]), roof, rtol=1e-11)
    # A single story has no second drift.
    assert table[3]["1-PID-2-1"] == table[3]["1-PFD-2-2"] == ""
    change("study.yaml", ("outputs: {stories: true}", "outputs: {profiles: false}"))
    tdint("campaign", "study.yaml", "-o", "bare")
    tdint.refused("outputs: {stories: true}", "campaign", "export", "bare", "--simcenter")
    assert not Path("bare/simcenter.csv").exists()


@pytest.mark.usefixtures("study")
def test_the_store_can_be_queried_with_sql() -> None:
    """The view `runs` of the database has the columns and the rows of runs.csv."""
    with closing(sqlite3.connect(f"out/{FILE}")) as connection:
        found = connection.execute("SELECT * FROM runs WHERE building = 'stiff'")
        names, own = [column[0] for column in found.description], len(COLUMNS)
        drift = names.index("peak_drift_ratio")
        stiff = [(row[1], row[2], f"{row[drift]:.12g}") for row in found]
    assert names[:own] == COLUMNS
    bare = [name.removesuffix("_error") for name in names[own:]]
    assert bare and set(bare) <= set(names[:own])  # The error columns are empty.
    table = [row for row in rows("out/runs.csv") if row["building"] == "stiff"]
    assert stiff == [(row["record"], row["component"], row["peak_drift_ratio"]) for row in table]


def test_run_with_several_records_or_scales(study: Path, tdint: Command) -> None:
    """`tdint run` with several records is a small campaign. With standard output no store is
    written; with -o the campaign can be continued."""
    several = ("run", "shaken.yaml", "motion.mseed", "other.mseed", "--units", "m/s^2")
    shown = tdint(*several, "--scale", "0.25,2.5", code=0)
    assert list(rows(shown.stdout)[0]) == COLUMNS
    kept = tdint(*several, "--scale", "2.5,0.25", "-o", "kept")
    assert kept.stdout == shown.stdout == Path("kept/runs.csv").read_text()
    campaign_rows = [
        row for row in rows("out/runs.csv") if row["building"] == "shaken" and row["scale"] != "1"
    ]
    assert rows("kept/runs.csv") == campaign_rows
    model_record = ("run", "shaken.yaml", "--units", "m/s^2", "--scale", "1,3")
    assert [row["component"] for row in rows(tdint(*model_record).stdout)] == ["HNE", "HNE"]
    tdint(*model_record, "-o", "kept", code=6)
    tdint(*model_record, "-o", "kept", "--overwrite", code=0)
    assert len(rows("kept/runs.csv")) == 2
    for option in (["--history"], ["--tolerance", "1%"], ["--export-floors", "mseed"]):
        tdint.refused("one record and one scale", *model_record, *option, "-o", "new")


def test_invalid_rows_of_an_inventory_are_counted_by_building(study: Path, tdint: Command) -> None:
    change(
        "study.yaml",
        ("{models: [shaken.yaml, stiff.yaml]}", "{inventory: rows.csv, units: {length: m}}"),
    )
    Path("rows.csv").write_text(
        "id,NumberOfStories,YearBuilt,StructureType,PlanArea\na,2,1968,C1,900\nb,0,1968,X9,900\nc,2,x,C1,900\n"
    )
    tdint("campaign", "study.yaml", "-o", "new", code=3)
    summary = json.loads(Path("new/summary.json").read_text())
    assert [entry["file"] for entry in summary["inputs"]] == [
        "motion.mseed", "other.mseed", "rows.csv", "study.yaml",
    ]  # fmt: skip
    unused = summary["not_used"]
    # Building b has two errors, but is counted once.
    assert (unused["records"]["count"], unused["buildings"]["count"]) == (0, 2)
    assert (
        "rows.csv:3" in unused["buildings"]["reasons"][0]
        and "X9" in unused["buildings"]["reasons"][0]
    )


def test_exports_of_an_earlier_state_are_updated(study: Path, tdint: Command) -> None:
    tdint("campaign", "study.yaml", "-o", "part", "--max-runs", "1", code=0)
    tdint("campaign", "export", "part", "--simcenter", code=0)
    before = len(rows("part/simcenter.csv"))
    assert "simcenter.csv: updated" in tdint("campaign", "study.yaml", "-o", "part").stderr
    exported = Path("part/simcenter.csv").read_bytes()
    # The components of motion.mseed are in one row.
    assert len(rows("part/simcenter.csv")) == RUNS * 2 // 3 > before
    tdint("campaign", "export", "part", "--simcenter")
    assert Path("part/simcenter.csv").read_bytes() == exported
    names = ("building", "record", "scale", "sample")
    rows_of, runs = (
        [tuple(row[name] for name in names) for row in rows(f"part/{file}.csv")]
        for file in ("simcenter", "runs")
    )
    assert rows_of == list(dict.fromkeys(runs)) and len(runs) == RUNS
    # A recording without a second component has empty cells of the second direction.
    second = {row["record"]: bool(row["1-PID-1-2"]) for row in rows("part/simcenter.csv")}
    assert second == {"motion.mseed": True, "other.mseed": False}


def test_a_campaign_uses_the_output_units_of_its_models(study: Path, tdint: Command) -> None:
    """If all models have the same output units, the campaign, its export and merge use them, with
    the same result as --output-units."""
    tdint("campaign", "export", "out", "--output-units", "kip,in,g")
    kips = {name: Path("out", name).read_bytes() for name in ("runs.csv", "stories.csv")}
    assert b"peak_base_shear_kip" in kips["runs.csv"]
    for model in ("shaken.yaml", "stiff.yaml"):
        Path(model).write_text("output_units: kip, in, g\n" + Path(model).read_text())
    result = tdint("campaign", "study.yaml", "-o", "new", code=0)
    assert "different output units" not in result.stderr
    assert {name: Path("new", name).read_bytes() for name in kips} == kips
    tdint("campaign", "export", "new", "--output-units", "N,m")
    assert list(rows("new/runs.csv")[0]) == COLUMNS
    tdint("campaign", "export", "new")
    tdint("campaign", "merge", "new", "-o", "all")
    assert (
        Path("all/runs.csv").read_bytes() == Path("new/runs.csv").read_bytes() == kips["runs.csv"]
    )
    change("stiff.yaml", ("output_units: kip, in, g", "output_units: kN"))
    assert "different output units" in tdint("campaign", "study.yaml", "-o", "new").stderr
    assert list(rows("new/runs.csv")[0]) == COLUMNS


REGION_STUDY = """\
buildings: {inventory: region.csv, units: {length: m}}
records: {files: [motion.mseed], component: HNE, units: m/s^2}
intensity: {scales: [1]}
analysis: {method: newmark-average}
"""
REGION = """\
id,StructureType,NumberOfStories,YearBuilt,PlanArea
1,C1,3,1990,500
2,C1,4,1990,500
ROW
4,W1,2,1990,500
"""


@pytest.fixture
def shards(folder: Path, tdint: Command) -> Callable[..., None]:
    """Run the shards of a region with a specified third row of the inventory for each shard, and
    check their exit code."""
    (folder / "region.yaml").write_text(REGION_STUDY)

    def run(*rows_of_shards: str, code: int) -> None:
        for number, row in enumerate(rows_of_shards, start=1):
            (folder / "region.csv").write_text(REGION.replace("ROW", row))
            shard = ["-o", f"p{number}", "--shard", f"{number}/2"]
            tdint("campaign", "region.yaml", *shard, code=code)

    return run


def test_shards_of_an_inventory_with_a_duplicate_id_merge_with_exit_code_3(
    shards: Callable[..., None], tdint: Command
) -> None:
    """An id that occurs in two rows causes the error exit code in every call, for shards and for
    merge."""
    shards("2,C1,5,1990,500", "2,C1,5,1990,500", code=3)
    merged = tdint("campaign", "merge", "p1", "p2", "-o", "all", code=3)
    assert re.search(r"\b1 building .*region\.csv:4:1: id: '2'", merged.stderr)
    tdint("campaign", "region.yaml", "-o", "whole", code=3)
    assert Path("all/runs.csv").read_bytes() == Path("whole/runs.csv").read_bytes()


def test_shards_of_a_changed_inventory_are_not_merged(
    shards: Callable[..., None], tdint: Command
) -> None:
    """The changed row belongs to a single shard, so that the shards have no common building to
    compare."""
    shards("3,C1,5,1990,500", "3,C1,5,1990,600", code=0)
    refused = tdint("campaign", "merge", "p1", "p2", "-o", "all", code=2).stderr
    assert "inventory has changed" in refused


@pytest.mark.parametrize("number", [1, 2])
def test_shards_are_not_merged_if_only_one_skipped_a_duplicate_id(
    shards: Callable[..., None], tdint: Command, number: int
) -> None:
    """The valid rows and their runs are equal, but the directories are not merged, because one call
    skipped a row and the other call did not."""
    doubled = "2,C1,5,1990,500"
    for shard in (1, 2):
        text = REGION.replace("ROW", doubled if shard == number else "")
        Path("region.csv").write_text(text)
        code = 3 if shard == number else 0
        tdint("campaign", "region.yaml", "-o", f"p{shard}", "--shard", f"{shard}/2", code=code)
    refused = tdint("campaign", "merge", "p1", "p2", "-o", "all", code=2).stderr
    assert "inventory has changed" in refused
    assert not Path("all", FILE).exists()
    # The remedy of the message: the call with the corrected inventory keeps its runs.
    Path("region.csv").write_text(REGION.replace("ROW", ""))
    for shard in (1, 2):
        again = tdint(
            "campaign region.yaml -o", f"p{shard}", "--shard", f"{shard}/2", code=0
        ).stderr
        assert "nothing to do" in again
    tdint("campaign", "merge", "p1", "p2", "-o", "all", code=0)
