"""`tdint run` of a building in two directions: files, figure, history and refusals."""

import json

import numpy as np
import pytest

from csv_rows import rows
from peer_files import write_at2

MODEL = """
stories:
  - {mass: 100000, height: 3, x: {stiffness: 4e+07}, y: {stiffness: 2.2e+07}}
  - {mass: 90000, height: 3, x: {stiffness: 3e+07}, y: {stiffness: 2e+07}}
damping: 5%
"""
BOTH = "excitation:\n  x: {record: {file: x.csv}}\n  y: {record: {file: y.csv}}\n"


@pytest.fixture
def both(folder):
    """Write models with and without records, and records of two directions."""
    time = np.arange(0.0, 4.0, 0.01)
    motions = {
        "x": 0.1 * np.sin(6.0 * time) * time,
        "y": 0.1 * np.cos(9.0 * time) * (4.0 - time) * time,
    }
    for name, motion in motions.items():
        lines = [f"{t:.2f},{a:.9g}" for t, a in zip(time, motion, strict=True)]
        (folder / f"{name}.csv").write_text("Time (s),Acceleration (m/s^2)\n" + "\n".join(lines))
    for name, file in (("x", "pair000.csv"), ("y", "pair090.csv")):
        (folder / file).write_text((folder / f"{name}.csv").read_text())
    (folder / "both.yaml").write_text(MODEL + BOTH)
    (folder / "bare.yaml").write_text(MODEL)
    return folder


def test_files_of_a_run_in_two_directions(both, tdint):
    result = tdint(
        "run", "both.yaml", "-o", "out", "--history", "--history-every", 2, "--plot", code=0
    )
    table = rows(result.stdout)
    assert [(row["direction"], row["story"]) for row in table] == [
        (name, story) for name in ("x", "y", "resultant") for story in ("1", "2")
    ]
    names = {"history.csv", "response.png", "resultants.csv", "stories.csv", "summary.json"}
    assert {file.name for file in (both / "out").iterdir()} == names
    resultants = rows((both / "out/resultants.csv").read_text())
    history = np.genfromtxt(both / "out/history.csv", delimiter=",", names=True)
    for story, (row, x, y, total) in enumerate(
        zip(resultants, table[:2], table[2:4], table[4:], strict=True), start=1
    ):
        value = float(row["drift_resultant_m"])
        assert float(total["peak_drift_m"]) == value
        assert float(row["drift_x_m"]) == float(x["peak_drift_m"])
        assert float(row["drift_y_m"]) == float(y["peak_drift_m"])
        drifts = [history[f"{name}_story_{story}_drift_m"] for name in "xy"]
        assert np.hypot(*drifts).max() == pytest.approx(value, rel=1e-2)
        assert float(row["drift_resultant_m_error"]) < 1e-3 * value
    assert history["time_s"][1] == pytest.approx(0.02)
    summary = json.loads((both / "out/summary.json").read_text())
    assert summary["directions"]["y"]["peaks"]["drift_m"] == pytest.approx(
        max(float(row["peak_drift_m"]) for row in table[2:4])
    )
    assert summary["peaks"]["drift_m"] > summary["directions"]["y"]["peaks"]["drift_m"]
    assert {entry["file"] for entry in summary["inputs"]} == {"both.yaml", "x.csv", "y.csv"}
    assert "degrees from x" in result.stderr
    assert "torsion" in result.stderr


def test_two_records_of_the_command_line_are_the_components(both, tdint):
    options = ("--duration", 3.9, "-q")
    expected = tdint("run", "both.yaml", *options, code=0).stdout
    assert (
        tdint("run", "bare.yaml", "pair000.csv", "pair090.csv", *options, code=0).stdout == expected
    )
    # Both components have the factor of --scale.
    double = rows(
        tdint(
            "run", "bare.yaml", "pair000.csv", "pair090.csv", *options, "--scale", 2, code=0
        ).stdout
    )
    assert float(double[-1]["peak_drift_m"]) == pytest.approx(
        2.0 * float(rows(expected)[-1]["peak_drift_m"]), rel=1e-6
    )
    scaled = rows(tdint("run", "both.yaml", *options, "--scale", 2, code=0).stdout)
    assert scaled[-1]["peak_drift_m"] == double[-1]["peak_drift_m"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("bare.yaml", "x.csv", "y.csv", "--sequence"), "--sequence requires one direction"),
        (("bare.yaml", "x.csv"), "only one horizontal component"),
        (("bare.yaml",), "the ground motion is missing"),
    ],
)
def test_what_a_run_in_two_directions_refuses(both, tdint, arguments, message):
    result = tdint("run", *arguments, "-o", "out")
    assert result.exit_code in (2, 3, 4)
    assert message in result.stderr
    assert not (both / "out").exists()


def test_floor_spectra_and_report_of_two_directions(both, tdint):
    """Floor spectra and the chapters of the report are those of each direction, as of a model with
    one direction."""
    floors = ("--floor-spectra", "1,roof", "--floor-period", "0.1,0.3", "--export-floors", "mseed")
    tdint("run", "both.yaml", "-o", "out", *floors, "--report", "page.html", "-q", code=0)
    for name in "xy":
        (both / f"{name}.yaml").write_text(_one_direction(name))
        tdint(f"run {name}.yaml {name}.csv --units m/s^2 -q -o one-{name}", *floors, code=0)
        of_direction, alone = (
            rows((both / f"{path}floor-spectra.csv").read_text())
            for path in (f"out/{name}-", f"one-{name}/")
        )
        assert len(of_direction) == 4
        for row, other in zip(of_direction, alone, strict=True):
            assert float(row["psa_m_s2"]) == pytest.approx(float(other["psa_m_s2"]), rel=1e-9)
        assert (both / f"out/{name}-floors.mseed").stat().st_size > 0
    page = (both / "page.html").read_text("utf-8")
    for title in ("direction x", "direction y", "both directions"):
        assert f"Peaks of the stories, {title}" in page
    assert "Floor spectra, direction y" in page and "drifts in plan" in page
    text = "buildings: {models: [bare.yaml]}\nrecords: {files: [pair000.csv, pair090.csv]}\n"
    (both / "study.yaml").write_text(text)
    tdint.refused("use `tdint run` for each", "campaign study.yaml -o c --floor-spectra 1")


def _one_direction(name):
    """Return the model with the stiffnesses of one direction."""
    model = MODEL
    for x, y in (("4e+07", "2.2e+07"), ("3e+07", "2e+07")):
        both = f"x: {{stiffness: {x}}}, y: {{stiffness: {y}}}"
        model = model.replace(both, f"stiffness: {x if name == 'x' else y}")
    return model


def test_components_with_different_factors_are_refused(both, tdint):
    (both / "both.yaml").write_text(
        (both / "both.yaml").read_text().replace("y.csv}", "y.csv, scale: -0.7}")
    )
    result = tdint("run", "both.yaml")
    assert "need the same factor, got scale 1 for x and -0.7 for y" in result.stderr
    assert "Traceback" not in result.stderr


def test_other_commands_refuse_two_directions(both, tdint):
    result = tdint("modes", "both.yaml")
    assert "the model has two directions" in result.stderr
    # `tdint check` reports the direction with the longer period.
    (checked,) = rows(tdint("check", "both.yaml", code=0).stdout)
    softer = (both / "bare.yaml").read_text().replace("x: {stiffness: 4e+07}, y: ", "")
    softer = softer.replace("x: {stiffness: 3e+07}, y: ", "").replace(
        "{stiffness: 2", "stiffness: 2"
    )
    (both / "softer.yaml").write_text(softer.replace("}}", "}"))
    (alone,) = rows(tdint("check", "softer.yaml", code=0).stdout)
    assert checked["t1_s"] == alone["t1_s"]
    (both / "y.csv").unlink()
    assert "y.csv not found" in tdint("check", "both.yaml").stderr


@pytest.fixture
def pairs(folder):
    """Write a model of two directions, and five pairs of records."""
    (folder / "both.yaml").write_text("name: both\n" + MODEL.replace("e+07", "e+06"))
    time = np.arange(300) * 0.01
    files = []
    for number in range(5):
        for component, omega in (("000", 3.0 + number), ("090", 8.5 - 1.1 * number)):
            values = 0.05 * np.sin(omega * time) * np.exp(-((time - 1.5) ** 2))
            files.append(f"RSN{number}_A{component}.AT2")
            write_at2(folder / files[-1], f"RSN{number}_A, {component}", values)
    return files


def _largest_drift_ratio(tdint, files, scale, larger=False):
    """Return the largest drift ratio of a run under a pair: the resultant, or with `larger` the
    larger of both directions."""
    run = tdint("run", "both.yaml", *files, "--scale", scale, "-q", "--no-check", code=0)
    drifts = [
        float(row["peak_drift_ratio"])
        for row in rows(run.stdout)
        if (row["direction"] == "resultant") is not larger
    ]
    return max(drifts)


@pytest.mark.parametrize("larger", [False, True])
def test_a_pair_is_one_motion_of_a_campaign(folder, tdint, pairs, larger):
    """The demand is the resultant, or the larger of both directions; the fragility has the number
    of pairs, and the counts of the runs."""
    (folder / "study.yaml").write_text(
        "buildings: {models: [both.yaml]}\n"
        f"records: {{files: [{', '.join(pairs)}]{', pair_demand: larger' if larger else ''}}}\n"
        "intensity: {measure: pga, levels: [0.04 g, 0.045 g, 0.05 g, 0.056 g]}\n"
    )
    result = tdint("campaign study.yaml -o out --report page.html", code=0)
    assert "5 pairs of horizontal components: each pair is one motion" in result.stderr
    runs = rows((folder / "out/runs.csv").read_text())
    assert len(runs) == 5 * 4 and {run["component"] for run in runs} == {"000+090"}
    for run in runs[::7]:
        drift = _largest_drift_ratio(tdint, run["record"].split("+"), run["scale"], larger)
        assert float(run["peak_drift_ratio"]) == pytest.approx(drift, rel=1e-6)
    profiles = [
        row for row in rows((folder / "out/profiles.csv").read_text())
        if row["quantity"] == "peak_drift_ratio" and row["story"] == "1"
    ]  # fmt: skip
    assert [row["runs"] for row in profiles] == ["5"] * 4
    limit = sorted(float(run["peak_drift_ratio"]) for run in runs)[11]
    tdint("fragility out -o f.csv --threshold", f"{limit:.6g}", code=0)
    (row,) = rows((folder / "f.csv").read_text())
    assert (row["motions"], row["runs"], row["fit"]) == ("5", "20", "stripes")
    counts = [
        sum(float(run["peak_drift_ratio"]) > float(f"{limit:.6g}") for run in runs
            if float(run["level"]) == level)
        for level in sorted({float(run["level"]) for run in runs})
    ]  # fmt: skip
    shares = [float(row["bin_share"]) for row in rows((folder / "f-bins.csv").read_text())]
    assert shares == pytest.approx([count / 5 for count in counts])
    page = (folder / "page.html").read_text("utf-8")
    assert "Direction x:" in page and "Direction y:" in page


def test_a_pair_is_one_motion_of_ida(folder, tdint, pairs):
    """The resultant drift at each capacity is the threshold."""
    result = tdint(
        "ida", "both.yaml", *pairs[:6], "--threshold", "1%", "-o", "out", "--report", "page.html",
        code=0,
    )  # fmt: skip
    assert "6 components, 3 recordings, 3 pairs" in result.stderr
    capacities = [
        row for row in rows((folder / "out/capacities.csv").read_text()) if row["threshold"]
    ]
    found = [row for row in capacities if float(row["threshold"]) == 0.01]
    assert len(found) == 3
    levels = rows((folder / "out/ida.csv").read_text())
    for row in levels[:: len(levels) // 4]:
        drift = _largest_drift_ratio(tdint, row["record"].split("+"), row["scale"])
        assert float(row["peak_drift_ratio"]) == pytest.approx(drift, rel=1e-6)
    (function,) = rows(tdint("fragility out --threshold 1%", code=0).stdout)
    assert function["motions"] == "3"
    logarithms = [np.log(float(row["capacity"])) for row in found]
    assert float(function["theta"]) == pytest.approx(np.exp(np.mean(logarithms)), rel=1e-6)
    assert "Direction y:" in (folder / "page.html").read_text("utf-8")


def test_factors_of_a_table_apply_to_pairs(folder, tdint, pairs):
    """`tdint scale` lists both components of a pair, with one factor for both."""
    tdint("scale", *pairs, "--to", "pga=0.05g", "-o", "factors.csv", code=0)
    listed = rows((folder / "factors.csv").read_text())
    factors = {row["record"]: row["factor"] for row in listed}
    runs = rows(tdint("run both.yaml --factors factors.csv", code=0).stdout)
    assert len(listed) == 10 and len(runs) == 5
    for run in runs:
        components = run["record"].split("+")
        assert [factors[name] for name in components] == [run["scale"]] * 2
    drift = _largest_drift_ratio(tdint, pairs[2:4], runs[1]["scale"])
    assert float(runs[1]["peak_drift_ratio"]) == pytest.approx(drift, rel=1e-6)
    # The rows of a building with one direction are the same.
    (folder / "one.yaml").write_text(
        "stories: [{mass: 100000, height: 3, stiffness: 4e+6}]\ndamping: 5%\n"
    )
    assert len(rows(tdint("run one.yaml --factors factors.csv", code=0).stdout)) == 10
    text = (folder / "factors.csv").read_text()
    (folder / "other.csv").write_text(text.replace(listed[3]["factor"], "9", 1))
    result = tdint("run both.yaml --factors other.csv")
    assert result.exit_code == 3
    assert "RSN1_A000.AT2+RSN1_A090.AT2 have the factors" in result.stderr


def test_sequences_of_two_directions_are_refused(folder, tdint, pairs):
    (folder / "pairs.csv").write_text(f"sequence,record\na,{pairs[0]}\na,{pairs[2]}\n")
    (folder / "study.yaml").write_text(
        "buildings: {models: [both.yaml]}\nrecords: {sequences: pairs.csv}\n"
    )
    tdint.refused("two directions cannot have sequences ... one direction",
                  "campaign study.yaml -o out")  # fmt: skip


def test_intensities_of_a_pair_are_geometric_means(folder, tdint, pairs):
    """Every intensity of a motion in two directions is that of the pair, at every place; exchanging
    x and y of the building and of the records changes nothing."""
    text = f"buildings: {{models: [both.yaml]}}\nrecords: {{files: [{', '.join(pairs)}]}}\n"
    (folder / "plain.yaml").write_text(text + "intensity: {scales: [0.2, 0.5]}\n")
    tdint("campaign plain.yaml -o plain --im pga,pgv,sa:0.5,sa", code=0)
    runs, measures = (rows((folder / "plain" / f"{name}.csv").read_text()) for name in (
        "runs", "measures",
    ))  # fmt: skip
    for run, row in zip(runs, measures, strict=True):
        files = run["record"].split("+")
        parts = rows(tdint("info", *files, code=0).stdout)
        for name in ("pga_m_s2", "pgv_m_s"):
            both = np.prod([float(part[name]) for part in parts])
            assert float(row[name]) == pytest.approx(float(run["scale"]) * np.sqrt(both), rel=1e-6)
        assert float(run["sa_t1_m_s2"]) == pytest.approx(float(row["sa_t1_m_s2"]), rel=1e-9)
        spectra = rows(tdint("spectrum", *files, "--period", "0.5", code=0).stdout)
        both = np.prod([float(part["psa_m_s2"]) for part in spectra])
        assert float(row["sa_0p5_m_s2"]) == pytest.approx(
            float(run["scale"]) * np.sqrt(both), rel=1e-6
        )
    (fit,) = rows(tdint("fragility plain --fit cloud --threshold 0.1% --im pgv", code=0).stdout)
    assert fit["im"] == "geometric-mean-pgv"


def test_rest_and_period_of_two_directions(both, tdint):
    """At rest is the later direction; T1 is the longer period in every command."""
    tdint("run both.yaml --until-rest -o out -q", code=0)
    content = json.loads((both / "out/summary.json").read_text())
    times = []
    for name in "xy":
        (both / "one.yaml").write_text(_one_direction(name))
        tdint(f"run one.yaml {name}.csv --until-rest -o {name} -q --units m/s^2", code=0)
        times.append(json.loads((both / f"{name}/summary.json").read_text()))
    rest = [item["at_end"]["time_at_rest_s"] for item in times]
    assert content["at_end"]["time_at_rest_s"] == pytest.approx(max(rest), abs=0.02)
    longer = max(item["building"]["t1_s"] for item in times)
    assert content["building"]["t1_s"] == pytest.approx(longer)
    (checked,) = rows(tdint("check both.yaml", code=0).stdout)
    assert float(checked["t1_s"]) == pytest.approx(longer)


def test_strokes_of_two_directions_are_the_larger_ones(folder, tdint, pairs):
    """In a run, a campaign and `ida`; limits apply to them."""
    devices = "attachments: [{name: tmd, floor: 2, mass: 3000, stiffness: 1e6, dashpot: 2e4}]\n"
    limits = "limits: {attachment_stroke: 0.001}\n"
    (folder / "tmd.yaml").write_text(MODEL + devices + limits)
    (folder / "study.yaml").write_text(
        "buildings: {models: [tmd.yaml]}\n"
        f"records: {{files: [{', '.join(pairs[:2])}]}}\nintensity: {{scales: [1.0]}}\n"
    )
    alone = tdint("run", "tmd.yaml", *pairs[:2], "-o", "out", code=0)
    strokes = [
        float(rows((folder / f"out/{name}-attachments.csv").read_text())[0]["peak_drift_m"])
        for name in "xy"
    ]
    assert strokes[0] != strokes[1]
    result = tdint("campaign study.yaml -o study", code=0)
    (row,) = rows((folder / "study/attachments.csv").read_text())
    assert float(row["peak_drift_m"]) == pytest.approx(max(strokes), rel=1e-9)
    for text in (alone.stderr, result.stderr):
        assert f"attachment stroke {max(strokes):.4g} m (attachment tmd" in text
