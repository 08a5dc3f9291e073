"""Forces on floors from files on the command line: outputs, inputs, sequences, campaigns."""

import csv
import json

import pytest
from click.testing import CliRunner

from tdint_cli.main import cli

MODEL = """\
name: two floors
units: {length: m, force: kN, mass: t}
stories: [{mass: 60, height: 3, stiffness: 3.0e+4}, {mass: 50, height: 3, stiffness: 2.5e+4}]
damping: {modal: 2%}
excitation: {forces: [{file: blast.csv, floors: {2: roof_kN, 1: 0.5 roof_kN}}]}
"""


def run(*arguments):
    result = CliRunner().invoke(cli, list(map(str, arguments)))
    return result.exit_code, result.output


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blast.csv").write_text("time_s,roof_kN\n0,200\n0.1,0\n0.3,20\n")
    (tmp_path / "model.yaml").write_text(MODEL)
    (tmp_path / "rest.csv").write_text("a\n0\n0\n0\n")
    (tmp_path / "motion.csv").write_text("a\n" + "0.5\n-1\n0.7\n-0.2\n" * 10)
    return tmp_path


@pytest.mark.long
def test_summary_and_report(folder):
    """The summary lists the forces and both files."""
    options = ("--duration", "1", "-o", "out", "--report", "out/report.html", "--history")
    code, output = run("run", "model.yaml", *options)
    assert code == 0, output
    summary = json.loads((folder / "out" / "summary.json").read_text())
    roof, first = summary["forces"]
    assert (roof["floor"], roof["table"], roof["column"]) == (2, "blast.csv", "roof_kN")
    assert (roof["peak_load_N"], first["peak_load_N"]) == (2e5, 1e5)
    assert roof["impulse_Ns"] == pytest.approx(1e4 + 2e3)
    assert [item["file"] for item in summary["inputs"]] == ["model.yaml", "blast.csv"]
    assert any("at 0.3 s, is not zero" in note for note in summary["notes"])
    assert "Forces on floors" in (folder / "out" / "report.html").read_text()


def test_check_reports_errors_of_both_files(folder):
    assert run("check", "model.yaml")[0] == 0
    (folder / "blast.csv").write_text("time_s,roof_kN\n0,x\n0.1,0\n")
    code, output = run("check", "model.yaml")
    assert code == 3
    assert "model.yaml:5:" in output and "blast.csv:2: roof_kN must be a number, got 'x'" in output


def test_forces_without_duration(folder):
    code, output = run("run", "model.yaml")
    assert code == 2 and "the duration is required" in output


def test_sequence_and_rest(folder):
    """Times of tables count from the start of a sequence; rest is after the end of the table."""
    motion = ("--units", "m/s^2", "--step", "0.02", "--no-check")
    code, output = run(
        "run", "model.yaml", "motion.csv", "motion.csv", "--sequence", *motion, "-o", "sequence"
    )
    assert code == 0, output
    text = MODEL.replace("0.5 roof_kN}", "0.5 roof_kN}, start: 7")
    (folder / "late.yaml").write_text(text)
    code, output = run("run", "late.yaml", "rest.csv", *motion, "--until-rest", "-o", "rest")
    assert code == 0, output
    summary = json.loads((folder / "rest" / "summary.json").read_text())
    assert summary["at_end"]["time_at_rest_s"] > 7.3
    assert summary["energy"]["input_J"] > 0.0


def test_campaign_with_a_model_for_each_load_case(folder):
    (folder / "half.yaml").write_text(
        MODEL.replace("two floors", "half").replace("0.5 roof_kN}", "0.5 roof_kN}, scale: 0.5")
    )
    (folder / "campaign.yaml").write_text(
        "buildings: {models: [model.yaml, half.yaml]}\n"
        "records: {files: [rest.csv], units: m/s^2, step: 0.02}\nanalysis: {duration: 1}\n"
    )
    code, output = run("campaign", "campaign.yaml", "-o", "cases")
    assert code == 0, output
    with (folder / "cases" / "runs.csv").open() as file:
        full, half = [float(row["peak_drift_m"]) for row in csv.DictReader(file)]
    assert half == pytest.approx(0.5 * full, rel=1e-9)
    files = [
        item["file"] for item in json.loads((folder / "cases/summary.json").read_text())["inputs"]
    ]
    assert "blast.csv" in files
    # A changed table is another campaign.
    (folder / "blast.csv").write_text("time_s,roof_kN\n0,100\n0.1,0\n")
    assert run("campaign", "campaign.yaml", "-o", "cases")[0] != 0
