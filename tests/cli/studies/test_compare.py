"""`tdint compare` with a recording that consists of computed responses with added noise."""

import json
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Command, made_once
from csv_rows import rows

MODEL = """\
name: frame
stories:
  - {mass: 1.0, stiffness: 900}
  - {mass: 1.0, stiffness: 700}
damping: {modal: [0.02, 0.03]}
excitation: {record: {file: base.txt}}
"""
RECORDED = """\
base: {file: recorded.csv, column: ground_acceleration_m_s2}
floors:
  1: {file: recorded.csv, column: floor_1_displacement_m, quantity: displacement}
  roof: {file: recorded.csv, column: floor_2_absolute_acceleration_m_s2, quantity: acceleration}
band: [0.4, 15]
"""
SAMPLES = 500


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Directory with a model, a base motion, and a response history of the model with noise in the
    roof acceleration."""
    return made_once(tmp_path_factory, write_recorded)


def write_recorded(folder):
    generator = np.random.default_rng(4)
    base = generator.normal(size=SAMPLES) * np.hanning(SAMPLES)
    np.savetxt("base.txt", base, header="dt = 0.02 s, units = m/s^2")
    Path("model.yaml").write_text(MODEL)
    Path("recorded.yaml").write_text(RECORDED)
    Command()("run", "model.yaml", "--method", "exact", "--history", "-o", "out", code=0)
    names = Path("out/history.csv").read_text().partition("\n")[0].split(",")
    table = np.loadtxt("out/history.csv", delimiter=",", skiprows=1)
    roof = names.index("floor_2_absolute_acceleration_m_s2")
    table[:, roof] += 0.5 + 0.2 * np.std(table[:, roof]) * generator.normal(size=SAMPLES)
    np.savetxt("recorded.csv", table, "%.12g", ",", header=",".join(names), comments="")


@pytest.mark.long
def test_table_files_and_requirements(recorded, tdint, tmp_path, drawn):
    out = tmp_path / "deep" / "out"
    files = (recorded / "model.yaml", "--recorded", recorded / "recorded.yaml")
    tdint(
        "compare",
        *files,
        "-o",
        out,
        "--plot",
        "--require",
        "correlation=0.95,peak_ratio=0.8",
        code=0,
    )
    names = ["comparison.csv", "comparison.png", "spectra.csv", "summary.json"]
    assert sorted(file.name for file in out.iterdir()) == names
    first, roof = rows(out / "comparison.csv")
    assert list(first) == ["floor", "quantity", "correlation", "peak_ratio", "rms_difference"]
    assert (first["quantity"], roof["floor"], roof["quantity"]) == (
        "displacement",
        "2",
        "acceleration",
    )
    assert float(first["correlation"]) > 0.999 > float(roof["correlation"]) > 0.95
    assert list(rows(out / "spectra.csv")[0]) == [
        "floor", "period_s", "computed_sa_m_s2", "recorded_sa_m_s2",
    ]  # fmt: skip
    summary = json.loads((out / "summary.json").read_text())
    assert summary["schema"] == {"name": "tdint compare", "version": 2}
    assert summary["events"][0]["floors"][1]["correlation"] == pytest.approx(
        float(roof["correlation"])
    )
    inputs = [str(recorded / name) for name in ("model.yaml", "recorded.yaml", "recorded.csv")]
    assert [entry["file"] for entry in summary["inputs"]] == inputs
    again = tdint("compare", *files, "--require", "correlation=0.999", code=5)
    shown = f"{float(roof['correlation']):.4g}"
    assert f"floor 2: correlation is {shown}, required is at least 0.999" in again.stderr
    assert again.stdout == (out / "comparison.csv").read_text()


def test_all_errors_of_a_recording_file_are_reported_at_once(recorded, tdint):
    (recorded / "bad.yaml").write_text(
        "bas: x\n"
        "base: {file: a, column: b, component: c, quantity: displacment}\n"
        "floors:\n"
        "  2: {file: a, sign: 2}\n"
        "  roof: {fil: a}\n"
        "  7: {file: b, units: cm, quantity: acceleration}\n"
        "band: [25, 0.5]\n"
        "window: [2]\n"
        "shift: soon\n"
    )
    result = tdint("compare", recorded / "model.yaml", "--recorded", recorded / "bad.yaml", code=3)
    faults = [line.partition("bad.yaml:")[2].split(": ")[:2] for line in result.stderr.splitlines()]
    assert [" ".join(fault) for fault in faults] == [
        "1:1 bas", "2:25 base.column", "2:52 base.quantity", "4:22 floors.2.sign",
        "5:9 floors.roof", "5:10 floors.roof.fil", "6:6 floors.7", "6:23 floors.7.units",
        "7:7 band", "8:9 window", "9:8 shift",
    ]  # fmt: skip
    for message in (
        "did you mean 'base'?",
        "did you mean 'displacement'?",
        "floor 2 is specified twice",
        "from 1 to 2",
    ):
        assert message in result.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--require", "corelation=1"], 2, "did you mean 'correlation'?"),
        (["--require", "correlation=much"], 2, "correlation must be a positive number"),
        (["--plot"], 2, "--plot without a file name requires -o"),
        (["-o", "{folder}/recorded.csv"], 6, "recorded.csv"),
        (["--dt", "0.04"], 2, "sampling interval of the recording"),
    ],
)
def test_invalid_arguments_are_refused(recorded, tdint, arguments, code, message):
    filled = [argument.format(folder=recorded) for argument in arguments]
    call = (recorded / "model.yaml", "--recorded", recorded / "recorded.yaml", *filled)
    assert message in tdint("compare", *call, code=code).stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty; ... `base` and `floors`"),
        ("base: x.csv\n", "floors: is missing; specify the floors"),
        ("base: []\nfloors: {}\n", "base: must name at least one file"),
        ("base: x.csv\nfloors: [x.csv]\n", "floors: ... mapping ... roof"),
        (None, "file not found; ... (YAML)"),
    ],
)
def test_files_without_recordings_are_refused(recorded, tdint, tmp_path, text, message):
    if text is not None:
        (tmp_path / "other.yaml").write_text(text)
    tdint.refused(
        message, "compare", recorded / "model.yaml", "--recorded", tmp_path / "other.yaml", code=3
    )
