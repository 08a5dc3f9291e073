"""`tdint campaign` and `tdint run` with several records or scales: files, words, exit codes."""

import hashlib
import json
import shutil
import socket
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Command
from csv_rows import rows
from tdint import ida, load_model, read_record, run_many
from tdint.campaign.ida import IdaSettings
from tdint.campaign.intensity import pga
from tdint.campaign.store import FILE
from tdint.campaign.store_schema import locked, seal_of

COLUMNS = (
    "building,record,component,scale,sample,method,dt_s,status,collapse_time_s,collapse_story,peak_drift_ratio,"
    "peak_drift_story,peak_drift_m,residual_drift_ratio,peak_absolute_acceleration_m_s2,peak_acceleration_floor,"
    "peak_roof_displacement_m,peak_base_shear_N,energy_error,steps,pga_m_s2,sa_t1_m_s2"
)
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
RUNS = 2 * 3 * 3  # buildings, components (two of motion, one of other), scales


@pytest.fixture
def study(folder: Path, make_record: Callable[..., None]) -> Path:
    """The working directory with study.yaml: two buildings, three components, three scales; in more than one chunk."""
    make_record(folder / "motion.mseed", "HNE", "HNN", samples=6000)
    make_record(folder / "other.mseed", "HNE", peak=1.0, samples=6000)
    (folder / "study.yaml").write_text(STUDY)
    (folder / "stiff.yaml").write_text(STIFF)
    return folder


def change(file: str, *changes: tuple[str, str]) -> None:
    text = Path(file).read_text()
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    Path(file).write_text(text)


def test_a_check_adds_an_error_beside_each_demand(study: Path, tdint: Command) -> None:
    """Those of `tdint run`, in runs.csv and stories.csv, and said in the summary; several records take it, too."""
    assert tdint("campaign", "study.yaml", "-o", "plain").exit_code == 0
    change("study.yaml", ("method: newmark-average", "method: moment4, check: true"))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    found, plain = rows("out/runs.csv"), rows("plain/runs.csv")
    named = [name for name in COLUMNS.split(",")[10:18] if not name.endswith(("_story", "_floor"))]
    assert list(plain[0]) == COLUMNS.split(",")
    assert list(found[0]) == [*plain[0], *(f"{name}_error" for name in named), *(f"corrected_{name}" for name in named)]
    own = list(rows("plain/stories.csv")[0])
    told = [name for name in own if name not in ("building", "record", "component", "scale", "story", "height_m")]
    assert list(rows("out/stories.csv")[0]) == [
        *own,
        *(f"{name}_error" for name in told),
        *(f"corrected_{name}" for name in told),
    ]
    tdint("run", "shaken.yaml", "motion.mseed", "--units", "m/s^2", "--component", "HNN", "--scale", "0.25",
                  "--method", "moment4", "-o", "alone", code=0)  # fmt: skip
    errors = json.loads(Path("alone/summary.json").read_text())["check"]["errors"]
    one = found[3]
    assert (one["component"], one["scale"]) == ("HNN", "0.25")
    assert float(one["peak_drift_m_error"]) == pytest.approx(errors["drift_m_error"], rel=1e-11)
    assert float(one["peak_base_shear_N_error"]) == pytest.approx(errors["base_shear_N_error"], rel=1e-11)
    stories = [row for row in rows("out/stories.csv") if all(row[name] == one[name] for name in
               ("building", "record", "component", "scale"))]  # fmt: skip
    own = rows("alone/stories.csv")
    for name in ("peak_shear_N_error", "corrected_peak_drift_ratio", "corrected_peak_absolute_acceleration_m_s2"):
        assert [row[name] for row in stories] == [row[name] for row in own] and own[0][name]
    summary = json.loads(Path("out/summary.json").read_text())
    unknown = [row for row in found if row["peak_drift_m"] and not row["peak_drift_m_error"]]
    assert summary["without_an_error"] == len(unknown) and summary["settings"]["check"] is True
    assert "peak_drift_m_error" in summary["columns"]
    many = tdint("run", "shaken.yaml", "motion.mseed", "--units", "m/s^2", "--scale", "0.25,1", "--method", "moment4",
                 "--check", "--component", "HNN")  # fmt: skip
    table = rows(many.stdout)
    assert table[0]["peak_drift_m_error"] == one["peak_drift_m_error"]


def test_corrected_peaks_are_the_same_by_every_route(study: Path, tdint: Command) -> None:
    """`run`, several of them, `run_many`, a campaign and `ida` tell one number, to the last digit that is printed."""
    model, record = load_model("shaken.yaml"), read_record("motion.mseed", component="HNN", units="m/s^2")
    levels = ida(model, [record], pga(), IdaSettings(max_im=2.0 * record.pga, check=True), method="moment4")
    scales = sorted(run.scale for run in levels.curves[0].runs)
    change("study.yaml", ("analysis: {method: newmark-average}", "analysis: {method: moment4, check: true}"),
           ("[0.25, 1, 2.5]", repr(scales)))  # fmt: skip
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    of_campaign = {
        float(row["scale"]): row
        for row in rows("out/runs.csv")
        if (row["building"], row["record"], row["component"]) == ("shaken", "motion.mseed", "HNN")
    }
    many = run_many(model, record, scales=scales, method="moment4", check=True).to_dict()
    of_ida = levels.to_dict()
    pairs = ("peak_drift_ratio", "drift_ratio"), ("peak_absolute_acceleration_m_s2", "floor_absolute_acceleration_m_s2")
    told = 0
    for place, scale in enumerate(scales):
        alone = ("run", "shaken.yaml", "motion.mseed", "--units", "m/s^2", "--component", "HNN", "--method", "moment4",
                 "--scale", repr(scale), "--check", "-o", f"alone-{place}")  # fmt: skip
        assert tdint(*alone).exit_code == 0
        summary = json.loads(Path(f"alone-{place}/summary.json").read_text())
        check, own = summary["check"], summary["peaks"]
        row = of_campaign[float(f"{scale:.12g}")]
        assert bool(check["corrected_peaks"]) == (len(check["dts_s"]) < 2)
        for column, key in pairs:
            name = f"corrected_{column}"
            corrected = check["corrected_peaks"][key] if check["corrected_peaks"] else float("nan")
            words = {f"{value:.12g}" for value in (corrected, many[name][place], of_ida[name][place])}
            assert words == {row[name] or "nan"}
            words = {f"{value[column][place]:.12g}" for value in (many, of_ida)}
            assert words == {row[column], f"{own[key]:.12g}"}  # and what was corrected, as it was
            told += bool(row[name])
    assert told >= 6


def test_the_summary_tells_which_model_files(study: Path, tdint: Command) -> None:
    """Each once, as it was read last: a comment changes a file, not the campaign."""

    def told() -> list[dict[str, str]]:
        return json.loads(Path("out/summary.json").read_text())["inputs"]

    def there() -> list[dict[str, str]]:
        return [{"file": name, "sha256": hashlib.sha256(Path(name).read_bytes()).hexdigest()}
                for name in ("shaken.yaml", "stiff.yaml")]  # fmt: skip

    change("study.yaml", ("outputs:", "vary: {stiffness_factor: [1, 1.1]}\noutputs:"))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    before = told()
    assert before == there()
    Path("stiff.yaml").write_text(STIFF + "# checked\n")
    again = tdint("campaign", "study.yaml", "-o", "out")
    assert "nothing to do" in again.stderr and told() == there() != before
    assert tdint("campaign", "export", "out").exit_code == 0 and told() == there()


def test_levels_of_an_integral_of_the_motion(study: Path, tdint: Command) -> None:
    """Arias intensity goes with the square of the factor; a duration has no levels, and it is said why."""
    change("study.yaml", ("scales: [0.25, 1, 2.5]", "measure: arias, levels: [0.1 m/s, 40 cm/s]"))
    assert tdint("campaign", "study.yaml", "-o", "out", "--im", "arias").exit_code == 0
    assert {row["arias_intensity_m_s"] for row in rows("out/measures.csv")} == {"0.1", "0.4"}
    change("study.yaml", ("measure: arias", "measure: d5-95"))
    tdint.refused(
        "d5-95: a duration does not change with a factor; no level can be asked of it",
        *["campaign", "study.yaml", "-o", "other"],
        code=3,
    )


def test_a_row_for_each_run(study: Path, tdint: Command) -> None:
    """The numbers are those of `tdint run`; buildings, records and scales come in their order."""
    assert f"{RUNS} runs in " in tdint("campaign", "study.yaml", "-o", "out", code=0).stderr
    assert sorted(path.name for path in Path("out").iterdir()) == [
    ".campaign.lock", FILE, "profiles.csv", "runs.csv", "stories.csv", "summary.json",
    ]  # fmt: skip
    assert Path("out/runs.csv").read_text().splitlines()[0] == COLUMNS
    table = rows("out/runs.csv")
    assert [(row["building"], row["record"], row["component"], row["scale"]) for row in table] == [
        (building, record, component, scale)
        for building in ("shaken", "stiff")
        for record, component in (("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE"))
        for scale in ("0.25", "1", "2.5")
    ]
    assert {(row["method"], row["dt_s"], row["status"], row["steps"], row["sample"]) for row in table} == {
        ("newmark-average", "0.01", "done", "5999", "0")
    }
    tdint("run", "shaken.yaml", "--component", "HNN", "--scale", "2.5", "--units", "m/s^2", "-o", "one")
    one, stories = json.loads(Path("one/summary.json").read_text()), rows("one/stories.csv")
    row = table[5]
    assert np.isclose(float(row["sa_t1_m_s2"]), one["building"]["sa_t1_m_s2"], rtol=1e-11)
    assert float(row["peak_drift_ratio"]) == max(float(story["peak_drift_ratio"]) for story in stories)
    kept = [story for story in rows("out/stories.csv") if list(story.values())[:4] == list(row.values())[:4]]
    assert [{name: story[name] for name in stories[0]} for story in kept] == stories


def test_the_same_bytes_whoever_does_the_runs(study: Path, tdint: Command) -> None:
    """One thread, three, and three shards merged in any order."""
    names = ("runs.csv", "stories.csv")
    tdint("campaign", "study.yaml", "-o", "one", "--jobs", "1")
    wanted = [(Path("one") / name).read_bytes() for name in names]
    tdint("campaign", "study.yaml", "-o", "three", "--jobs", "3")
    for shard in ("1/3", "2/3", "3/3"):
        assert tdint("campaign", "study.yaml", "-o", f"part-{shard[0]}", "--shard", shard).exit_code == 0
    parts = ["part-3", "part-1", "part-2"]
    assert sum(len(rows(f"{part}/runs.csv")) for part in parts) == RUNS
    lacking = tdint("-q", "campaign", "merge", *parts[:2], "-o", "half")
    assert (lacking.exit_code, Path("half", FILE).exists()) == (5, False)
    left = len(rows("part-2/runs.csv"))
    assert f"{left} of {RUNS} runs are in none of the folders: missing shard 2/3" in lacking.stderr
    result = tdint("campaign", "merge", *parts[:2], "-o", "half", "--partial")
    assert (result.exit_code, "runs are in none of them" in result.stderr) == (0, True)
    shutil.copytree("half", "added")
    assert tdint("campaign", "merge", "part-2", "-o", "added").exit_code == 0  # with what is there already
    assert tdint("campaign", "merge", *parts, "part-3", "-o", "all").exit_code == 0
    assert tdint("campaign", "study.yaml", "-o", "half").exit_code == 0  # does what the two parts left
    for place in ("three", "all", "added", "half"):
        assert [(Path(place) / name).read_bytes() for name in names] == wanted, place


def test_a_campaign_goes_on_where_it_stopped(study: Path, tdint: Command) -> None:
    tdint("campaign", "study.yaml", "-o", "whole")
    assert tdint("campaign", "study.yaml", "-o", "out", "--max-runs", "4").exit_code == 0
    done = len(rows("out/runs.csv"))
    assert 4 <= done < RUNS
    status = tdint("campaign", "status", "out")
    assert status.stdout == f"status,runs\ndone,{done}\nleft,{RUNS - done}\n"
    assert f"{done} of {RUNS} runs done" in status.stderr
    rest = tdint("campaign", "study.yaml", "-o", "out")
    assert f"{RUNS - done} runs in " in rest.stderr and f"{done} before" in rest.stderr
    assert Path("out/runs.csv").read_bytes() == Path("whole/runs.csv").read_bytes()
    again = tdint("campaign", "study.yaml", "-o", "out")
    assert (again.exit_code, f"{RUNS} runs done before: nothing to do" in again.stderr) == (0, True)


def test_a_folder_holds_one_campaign(study: Path, tdint: Command, make_record: Callable[..., None]) -> None:
    """What differs is told: settings, buildings, records; a new name of the file or another folder is nothing."""
    tdint("campaign", "study.yaml", "-o", "out")
    kept = Path("out/runs.csv").read_bytes()
    change("study.yaml", ("0.25, 1,", "0.5, 1,"), ("newmark-average", "impulse4"))
    change("shaken.yaml", ("8000", "9000"))
    make_record(study / "other.mseed", "HNE", peak=1.5, samples=6000)
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, Path("out/runs.csv").read_bytes()) == (2, kept)
    for line in (
        "holds another campaign; give another folder with -o",
        "setting scales: [0.25, 1.0, 2.5] in the store, [0.5, 1.0, 2.5] in this campaign",
        "building shaken: differs",
        "record other.mseed HNE: differs",
    ):
        assert line in result.stderr
    assert "motion.mseed" not in result.stderr
    change("study.yaml", ("name: study", "name: other"))
    tdint("campaign", "study.yaml", "-o", "new")
    tdint.refused("of different campaigns", "campaign", "merge", "out", "new", "-o", "all")
    assert not Path("all", FILE).exists()


def test_another_version_of_tdint_goes_on_and_is_noted(study: Path, tdint: Command) -> None:
    tdint("campaign", "study.yaml", "-o", "out", "--max-runs", "1")
    connection = sqlite3.connect(f"out/{FILE}")
    with connection:
        connection.execute("UPDATE meta SET value = '0.0' WHERE key = 'version'")
        connection.execute("UPDATE meta SET value = ? WHERE key = 'seal'", (seal_of(connection),))
    connection.close()
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, "begun with tdint 0.0" in result.stderr) == (0, True)


def test_all_faults_of_a_file_are_told_at_once(study: Path, tdint: Command) -> None:
    Path("bad.yaml").write_text(
        "buildings: {models: [shaken.yaml], units: {length: ft}}\n"
        "records: {file: [motion.mseed], pairs: maybe, component: HNE}\n"
        "intensity: {measure: sa, period: -1, levels: [0.1, 0.2 m, 0.3 g]}\n"
        "analysis: {method: newmarck, dt: 0}\n"
        "outputs: {stories: yes}\n"
    )
    result = tdint("campaign", "bad.yaml", "-o", "out")
    assert (result.exit_code, result.stdout, Path("out").exists()) == (3, "", False)
    found = [line.removeprefix("Error: bad.yaml:").split(": ", 2)[:2] for line in result.stderr.splitlines()]
    assert [place for place, _ in found] == sorted((place for place, _ in found), key=lambda text: text.split(":"))
    assert [key for _, key in found] == [
        "buildings.units", "records.file", "records.pairs", "intensity.period", "intensity.levels[1]",
        "intensity.levels[2]", "analysis.method", "analysis.dt", "outputs.stories",
    ]  # fmt: skip
    assert "did you mean 'files'?" in result.stderr and "newmark" in result.stderr


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "the campaign file is empty; it needs at least `buildings` and `records`"),
        ("buildings: {models: []}\nrecords: {files: [motion.mseed]}\n", "is empty; give at least one model file"),
        ("buildings: {models: [a.yaml]}\n", "records: is missing; give `files` or a `grid`"),
        ("buildings: {inventory: a.csv}\nrecords: {files: [b]}\n", "buildings.units: is missing"),
        ("buildings: {models: [nowhere.yaml]}\nrecords: {files: [motion.mseed]}\n", "nowhere.yaml: no such file"),
    ],
)
def test_files_that_say_too_little(study: Path, tdint: Command, content: str, said: str) -> None:
    Path("bad.yaml").write_text(content)
    tdint.refused(said, "campaign", "bad.yaml", "-o", "out", code=3)


def test_records_that_cannot_be_read_are_named_and_the_others_done(study: Path, tdint: Command) -> None:
    """They are listed and counted in summary.json and by `status`, as they are at the last call."""
    Path("broken.mseed").write_bytes(b"no record at all")
    change("study.yaml", ("other.mseed]", "broken.mseed, nowhere.mseed, other.mseed]"))
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, len(rows("out/runs.csv"))) == (4, RUNS)
    errors = [line for line in result.stderr.splitlines() if line.startswith("Error: ")]
    unused = json.loads(Path("out/summary.json").read_text())["not_used"]
    assert (unused["records"]["count"], unused["buildings"]) == (2, {"count": 0, "reasons": []})
    for texts in (errors, unused["records"]["reasons"]):
        assert [name in text for name, text in zip(("broken", "nowhere"), texts, strict=True)] == [True, True]
    told = tdint("campaign", "status", "out")
    assert told.exit_code == 0 and "2 records could not be used" in told.stderr and "nowhere.mseed" in told.stderr
    change("study.yaml", ("broken.mseed, ", ""))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 4
    assert "1 record could not be used" in tdint("campaign", "status", "out").stderr
    tdint("campaign", "merge", "out", "-o", "all")
    assert json.loads(Path("all/summary.json").read_text())["not_used"]["records"]["count"] == 1
    change("study.yaml", ("motion.mseed, nowhere.mseed, other.mseed]", "nowhere.mseed]"))
    nothing = tdint("campaign", "study.yaml", "-o", "empty")
    assert (nothing.exit_code, Path("empty").exists()) == (4, False)
    assert "nowhere.mseed: there is no such file" in nothing.stderr


def test_failed_runs_are_rows_with_their_status(study: Path, tdint: Command) -> None:
    change("study.yaml", ("method: newmark-average", "method: central-difference"))
    change("stiff.yaml", ("80000", "80000000"))
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, "no result of 9 runs: 9 unstable-step" in result.stderr) == (0, True)
    table = rows("out/runs.csv")
    assert [row["status"] for row in table] == 9 * ["done"] + 9 * ["unstable-step"]
    assert all(row["peak_drift_m"] == "" and row["steps"] == "" and row["pga_m_s2"] for row in table[9:])
    assert tdint("campaign", "export", "out", "--output-units", "kN,mm").exit_code == 0
    other = rows("out/runs.csv")
    assert [row["peak_drift_mm"] for row in other[9:]] == 9 * [""]
    assert float(other[0]["peak_drift_mm"]) == pytest.approx(1e3 * float(table[0]["peak_drift_m"]), rel=1e-9)


def test_a_step_that_fits_no_record_is_refused_before_anything_is_made(study: Path, tdint: Command) -> None:
    change("study.yaml", ("method: newmark-average", "dt: 0.007"))
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, Path("out").exists()) == (2, False)
    assert "motion.mseed HNE: dt 0.007 s does not fit" in result.stderr


def test_one_writer_at_a_time(study: Path, tdint: Command) -> None:
    Path("out").mkdir()
    with locked(Path("out")):
        result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, "another tdint is at work on it" in result.stderr) == (6, True)
    assert not Path("out", FILE).exists()


def test_a_file_that_is_no_store_is_not_touched(study: Path, tdint: Command) -> None:
    Path("out").mkdir()
    Path("out", FILE).write_bytes(b"x" * 5000)
    for arguments in (["study.yaml", "-o", "out"], ["status", "out"]):
        tdint.refused("file is not a database", "campaign", *arguments, code=6)
    assert Path("out", FILE).read_bytes() == b"x" * 5000


@pytest.mark.parametrize("port_of", [lambda server: 1, lambda server: server.getsockname()[1]])
def test_a_scheduler_that_does_not_answer(
    study: Path, tdint: Command, monkeypatch: pytest.MonkeyPatch, port_of: Callable[[socket.socket], int]
) -> None:
    """Where nothing listens, and where something does that says nothing."""
    pytest.importorskip("distributed")
    monkeypatch.setattr("tdint.campaign.cluster._PATIENCE", 2.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        result = tdint("campaign", "study.yaml", "-o", "out", "--dask", f"tcp://127.0.0.1:{port_of(server)}")
    assert result.exit_code == 2, result.stderr
    assert "no scheduler answers yet; waiting" in result.stderr
    assert "no scheduler answers: " in result.stderr.splitlines()[-1]
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["study.yaml"], "give -o DIR"),
        (["study.yaml", "shaken.yaml", "-o", "out"], "a campaign is one file, got 2"),
        (["study.yaml", "-o", "out", "--shard", "4/3"], "--shard is K/N"),
        (["study.yaml", "-o", "out", "--simcenter"], "--simcenter has nothing to act on"),
        (["status"], "give one folder"),
        (["status", "nowhere"], "holds no campaign"),
        (["export", "nowhere", "--jobs", "2"], "--jobs has nothing to act on with `tdint campaign export`"),
        (["merge", "-o", "all"], "give the folders to merge"),
        (["study.yaml", "-o", "out", "--dask", "tcp://far.example:8786"], "the connection must be encrypted"),
        (["study.yaml", "-o", "out", "--dask", "tls://far.example:8786"], "give --tls-ca, --tls-cert and --tls-key"),
        (["study.yaml", "-o", "out", "--dask", "far.example"], "is no address of a scheduler"),
        (["study.yaml", "-o", "out", "--dask", "tcp://localhost:8786/../x"], "is no address of a scheduler"),
        (["study.yaml", "-o", "out", "--dask", "tcp://me:secret@localhost:8786"], "is no address of a scheduler"),
        (["study.yaml", "-o", "out", "--tls-ca", "ca.pem"], "--tls-ca has nothing to act on without --dask"),
    ],
)
def test_usage(study: Path, tdint: Command, arguments: list[str], said: str) -> None:
    tdint.refused(said, "campaign", *arguments)
    assert not Path("out").exists()


def test_a_tolerance_chooses_the_step_of_each_building(study: Path, tdint: Command) -> None:
    """One step for all runs of a building; with several jobs, too. `tdint run` chooses no smaller one for a run that
    has been looked at."""
    change("study.yaml", ("method: newmark-average", "method: newmark-average, tolerance: 0.1%"))
    assert tdint("campaign", "study.yaml", "-o", "out", "--jobs", "2").exit_code == 0
    steps = {(row["building"], row["dt_s"]) for row in rows("out/runs.csv")}
    assert len(steps) == 2 and min(float(dt) for _, dt in steps) < 0.01
    tdint("run", "shaken.yaml", "--record", "motion.mseed", "--units", "m/s^2", "--component", "HNN", "--scale",
                "1", "--tolerance", "0.1%", "-o", "one", code=0)  # fmt: skip
    assert float(dict(steps)["shaken"]) <= json.loads(Path("one/summary.json").read_text())["dt_s"]


def test_levels_of_an_intensity_measure(study: Path, tdint: Command) -> None:
    """Sa(T1) of each building takes the levels; of a pair both components have one factor, and the geometric mean of
    their PGA takes them."""
    change("study.yaml", ("scales: [0.25, 1, 2.5]", "measure: sa, period: T1, levels: [0.1 g, 250 cm/s^2]"))
    assert tdint("campaign", "study.yaml", "-o", "sa").exit_code == 0
    table = rows("sa/runs.csv")
    found = np.array([float(row["sa_t1_m_s2"]) for row in table]).reshape(-1, 2)
    np.testing.assert_allclose(np.sort(found, axis=1), np.tile([0.980665, 2.5], (6, 1)), rtol=1e-11)
    change(
        "study.yaml", ("measure: sa, period: T1, levels: [0.1 g, 250 cm/s^2]", "measure: pga, levels: [2 m/s^2]"),
        ("other.mseed], ", "], pairs: true, "), ("motion.mseed, ", "motion.mseed"),
    )  # fmt: skip
    assert tdint("campaign", "study.yaml", "-o", "pga").exit_code == 0
    table = rows("pga/runs.csv")[:2]
    assert table[0]["scale"] == table[1]["scale"]
    assert np.isclose(np.prod([float(row["pga_m_s2"]) for row in table]), 4.0, rtol=1e-11)


def test_factors_of_a_file(study: Path, tdint: Command) -> None:
    Path("factors.csv").write_text(
        "record,component,factor\nmotion.mseed,HNE,2\nmotion.mseed,,0.5\nother.mseed,HNE,3\nother.mseed,HNE,4\n"
    )
    change("study.yaml", ("scales: [0.25, 1, 2.5]", "factors: factors.csv"))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    assert [row["scale"] for row in rows("out/runs.csv")] == 2 * ["2", "0.5", "3", "4"]
    Path("factors.csv").write_text("record,component,factor\nmotion.mseed,,zwei\n")
    tdint.refused("factors.csv:2: factor: must be a number", "campaign", "study.yaml", "-o", "new", code=3)


def test_exports_are_written_anew(study: Path, tdint: Command) -> None:
    """SimCenter's names: floor 0 is the ground, and both directions of a pair stand in one row."""
    change("study.yaml", ("files: [motion.mseed, other.mseed]", "files: [motion.mseed], pairs: true"))
    tdint("campaign", "study.yaml", "-o", "out")
    kept = Path("out/runs.csv").read_bytes()
    Path("out/runs.csv").unlink()
    assert tdint("campaign", "export", "out", "--simcenter").exit_code == 0
    assert Path("out/runs.csv").read_bytes() == kept
    table = rows("out/simcenter.csv")
    assert [(row["building"], row["scale"]) for row in table] == [
        (building, scale) for building in ("shaken", "stiff") for scale in ("0.25", "1", "2.5")
    ]
    first = table[0]
    assert list(first)[4:] == [
        name.replace("DIR", direction)
        for direction in "12"
        for name in ("1-PFA-0-DIR", "1-PFA-1-DIR", "1-PFA-2-DIR", "1-PID-1-DIR", "1-PID-2-DIR", "1-PRD-1-DIR",
                     "1-PFD-1-DIR", "1-PFD-2-DIR")
    ]  # fmt: skip
    runs, stories = rows("out/runs.csv"), rows("out/stories.csv")
    for direction, component in (("1", "HNN"), ("2", "HNE")):
        run = next(row for row in runs if row["component"] == component)
        peaks = [row for row in stories if row["component"] == component and row["scale"] == "0.25"][:2]
        assert first[f"1-PFA-0-{direction}"] == run["pga_m_s2"]
        assert [first[f"1-PID-{i}-{direction}"] for i in (1, 2)] == [row["peak_drift_ratio"] for row in peaks]
        assert [first[f"1-PFD-{i}-{direction}"] for i in (1, 2)] == [row["peak_displacement_m"] for row in peaks]
        assert np.isclose(
            float(first[f"1-PRD-1-{direction}"]), float(peaks[1]["peak_displacement_m"]) / 6.0, rtol=1e-11
        )
    assert table[3]["1-PID-2-1"] == table[3]["1-PFD-2-2"] == ""  # a building of one story


def test_names_of_simcenter_need_the_stories(study: Path, tdint: Command) -> None:
    change("study.yaml", ("outputs: {stories: true}", "outputs: {profiles: false}"))
    tdint("campaign", "study.yaml", "-o", "out")
    tdint.refused("outputs: {stories: true}", "campaign", "export", "out", "--simcenter")
    assert not Path("out/simcenter.csv").exists()


def test_the_store_can_be_asked_in_sql(study: Path, tdint: Command) -> None:
    """The view `runs` has the columns and the rows of runs.csv."""
    tdint("campaign", "study.yaml", "-o", "out")
    connection = sqlite3.connect(f"out/{FILE}")
    found = connection.execute("SELECT * FROM runs WHERE building = 'stiff'")
    names, own = [column[0] for column in found.description], COLUMNS.count(",") + 1
    assert names[:own] == COLUMNS.split(",")
    bare = [name.removesuffix("_error").removeprefix("corrected_") for name in names[own:]]
    assert bare and set(bare) <= set(names[:own])  # empty here
    wanted = [row for row in rows("out/runs.csv") if row["building"] == "stiff"]
    assert [(row[1], row[2], f"{row[10]:.12g}") for row in found] == [
        (row["record"], row["component"], row["peak_drift_ratio"]) for row in wanted
    ]
    connection.close()


def test_run_with_several_records_or_scales(study: Path, tdint: Command) -> None:
    """A small campaign: to standard output nothing is kept, into a folder it is one that goes on."""
    shown = tdint("run", "shaken.yaml", "motion.mseed", "other.mseed", "--units", "m/s^2", "--scale", "0.25,2.5")
    assert (shown.exit_code, shown.stdout.splitlines()[0]) == (0, COLUMNS)
    kept = tdint(
        "run", "shaken.yaml", "motion.mseed", "other.mseed", "--units", "m/s^2", "--scale", "2.5,0.25", "-o", "out"
    )
    assert kept.stdout == shown.stdout == Path("out/runs.csv").read_text()
    tdint("campaign", "study.yaml", "-o", "whole")
    wanted = [row for row in rows("whole/runs.csv") if row["building"] == "shaken" and row["scale"] != "1"]
    assert rows("out/runs.csv") == wanted
    of_model = tdint("run", "shaken.yaml", "--scale", "1,2", "--units", "m/s^2")
    assert [row["component"] for row in rows(of_model.stdout)] == ["HNE", "HNE"]
    tdint("run", "shaken.yaml", "--scale", "1,3", "--units", "m/s^2", "-o", "out", code=2)
    assert tdint("run", "shaken.yaml", "--scale", "1,3", "--units", "m/s^2", "-o", "out", "--overwrite").exit_code == 0
    assert len(rows("out/runs.csv")) == 2
    for option in (["--history"], ["--tolerance", "1%"], ["--export-floors", "mseed", "-o", "out"]):
        tdint.refused("for one record and one scale", "run", "shaken.yaml", "--scale", "1,3", *option, "-o", "new")


def test_the_schema_knows_every_key_of_the_reader(study: Path, tdint: Command) -> None:
    """Keys of the sections, as the message about an unknown one lists them."""
    schema = json.loads(tdint("check", "--schema", "campaign").stdout)
    for name in ("buildings", "records", "intensity", "analysis", "outputs"):
        Path("bad.yaml").write_text(f"{name}: {{qqqqqq: 1}}\n")
        said = tdint("campaign", "bad.yaml", "-o", "out").stderr
        known = said.partition("known: ")[2].partition("\n")[0].split(", ")
        about = schema["properties"][name]  # outputs may be a list, too
        assert known == list(about.get("anyOf", [about])[0]["properties"])


def test_rows_of_an_inventory_that_could_not_be_used_are_counted_by_building(study: Path, tdint: Command) -> None:
    change("study.yaml", ("{models: [shaken.yaml, stiff.yaml]}", "{inventory: rows.csv, units: {length: m}}"))
    Path("rows.csv").write_text(
        "id,NumberOfStories,YearBuilt,StructureType,PlanArea\na,2,1968,C1,900\nb,0,1968,X9,900\nc,2,x,C1,900\n"
    )
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 3
    summary = json.loads(Path("out/summary.json").read_text())
    assert summary["inputs"] == [
        {"file": "rows.csv", "sha256": hashlib.sha256(Path("rows.csv").read_bytes()).hexdigest()}
    ]
    unused = summary["not_used"]
    assert (unused["records"]["count"], unused["buildings"]["count"]) == (0, 2)  # b has two faults, and is one building
    assert "rows.csv:3" in unused["buildings"]["reasons"][0] and "X9" in unused["buildings"]["reasons"][0]


def test_exports_of_an_earlier_state_do_not_stay(study: Path, tdint: Command) -> None:
    assert tdint("campaign", "study.yaml", "-o", "out", "--max-runs", "1").exit_code == 0
    assert tdint("campaign", "export", "out", "--simcenter").exit_code == 0
    before = len(rows("out/simcenter.csv"))
    told = tdint("campaign", "study.yaml", "-o", "out")
    assert "simcenter.csv: written anew" in told.stderr
    exported = Path("out/simcenter.csv").read_bytes()
    assert len(rows("out/simcenter.csv")) == RUNS > before
    tdint("campaign", "export", "out", "--simcenter")
    assert Path("out/simcenter.csv").read_bytes() == exported
    # Components that are no pairs stand in rows of their own.
    names = ("building", "record", "component", "scale", "sample")
    keys = [[tuple(row[name] for name in names) for row in rows(f"out/{file}.csv")] for file in ("simcenter", "runs")]
    assert keys[0] == keys[1] and len(set(keys[0])) == RUNS


def test_a_campaign_writes_in_the_units_of_its_models(study: Path, tdint: Command) -> None:
    """Where all of them want the same ones; also by export and merge, and as --output-units does."""
    tdint("campaign", "study.yaml", "-o", "si", "--output-units", "kip,in,g")
    for model in ("shaken.yaml", "stiff.yaml"):
        Path(model).write_text("output_units: kip, in, g\n" + Path(model).read_text())
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, "different units" in result.stderr) == (0, False)
    for name in ("runs.csv", "stories.csv"):
        assert Path("out", name).read_bytes() == Path("si", name).read_bytes()
    assert "peak_base_shear_kip" in Path("out/runs.csv").read_text()
    tdint("campaign", "export", "out")
    assert Path("out/runs.csv").read_bytes() == Path("si/runs.csv").read_bytes()
    tdint("campaign", "export", "out", "--output-units", "N,m")
    assert Path("out/runs.csv").read_text().splitlines()[0] == COLUMNS
    tdint("campaign", "merge", "out", "-o", "all")
    assert Path("all/runs.csv").read_bytes() == Path("si/runs.csv").read_bytes()
    change("stiff.yaml", ("output_units: kip, in, g", "output_units: kN"))
    mixed = tdint("campaign", "study.yaml", "-o", "out")
    assert "different units" in mixed.stderr
    assert Path("out/runs.csv").read_text().splitlines()[0] == COLUMNS


def test_processor_time_is_that_of_the_processors(study: Path, tdint: Command) -> None:
    """However many threads wait for one processor: the sum over all chunks is less than what the process has used."""
    began = time.process_time()
    tdint("campaign", "study.yaml", "-o", "out", "--jobs", "8")
    used = time.process_time() - began
    assert 0.0 < json.loads(Path("out/summary.json").read_text())["processor_time_s"] <= used
