"""`tdint run` of a building in two directions: files, figure, history and refusals."""

import json

import numpy as np
import pytest

from csv_rows import rows

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
        (("both.yaml", "--report", "a.html"), "--report requires one direction"),
        (("bare.yaml", "x.csv"), "only one horizontal component"),
        (("bare.yaml",), "the ground motion is missing"),
        (("both.yaml", "--floor-spectra", "1"), "requires one direction"),
    ],
)
def test_what_a_run_in_two_directions_refuses(both, tdint, arguments, message):
    result = tdint("run", *arguments, "-o", "out")
    assert result.exit_code in (2, 3, 4)
    assert message in result.stderr
    assert not (both / "out").exists()


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
