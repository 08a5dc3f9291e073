"""README.md says what the code does: its generated parts, its scripts and its examples."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import readme
from tdint.analysis.assessment.order import observed_order, order_problem
from tdint.analysis.assessment.stability import critical_step
from tdint.methods import single_step
from tdint.methods.method import Integrator
from tdint_cli.main import COMMANDS

TEXT = readme.README.read_text()


@pytest.fixture
def checkout(tmp_path):
    """A folder that looks like a checkout to the examples, with tdint of this environment on the path."""
    for name in ("configs", "records"):
        (tmp_path / name).symlink_to(readme.ROOT / name)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return tmp_path, {**os.environ, "PATH": path}


def test_generated_parts_are_up_to_date():
    assert readme.generated(TEXT) == TEXT, "run: python tests/readme.py"


def test_every_command_stands_in_the_readme():
    assert all(f"### tdint {name}\n" in TEXT for name in COMMANDS)


def test_the_ci_script_runs_the_readmes_test_command():
    commands = re.findall(r"^\$ (.*\.\[test\].*)$", TEXT, re.MULTILINE)
    assert len(commands) == 1
    assert commands[0].endswith("-m pytest")
    assert "README.md" in (readme.ROOT / ".ci" / "run").read_text()


def test_the_shell_script(checkout):
    folder, environment = checkout
    result = subprocess.run(
        ["bash", "-eu", "-c", readme.block("shell")], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    rows = list(csv.DictReader(result.stdout.splitlines()))
    assert len(rows) == 6
    assert all(0.001 < float(row["largest_drift_ratio"]) < 0.1 for row in rows)
    assert len(list((folder / "out").glob("*/summary.json"))) == 6


def test_the_loops_of_a_law(checkout):
    folder, environment = checkout
    result = subprocess.run(
        ["bash", "-eu", "-c", readme.block("law")], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert (result.returncode, result.stdout) == (0, ""), result.stderr
    drifts = [float(row["drift_ratio"]) for row in csv.DictReader((folder / "loops.csv").read_text().splitlines())]
    assert (max(drifts), min(drifts), len(drifts)) == (0.03, -0.03, 1 + 6 * 800)
    assert (folder / "loops.png").exists()


def test_the_elastic_spectra(checkout):
    folder, environment = checkout
    result = subprocess.run(
        ["bash", "-eu", "-c", readme.block("elastic")], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    assert {row["maxima"] for row in csv.DictReader(result.stdout.splitlines())} == {"peer"}
    rotated = list(csv.DictReader((folder / "rotd.csv").read_text().splitlines()))
    values = [[float(row[f"rotd{name}_psa_m_s2"]) for name in ("00", "50", "100")] for row in rotated]
    assert len(values) == 200
    assert all(least < middle < most for least, middle, most in values)
    assert (folder / "spectra.png").is_file()


def test_the_inelastic_spectra(checkout):
    folder, environment = checkout
    result = subprocess.run(
        ["bash", "-eu", "-c", readme.block("inelastic")], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert (result.returncode, result.stdout) == (0, ""), result.stderr
    found, given = (
        list(csv.DictReader((folder / name).read_text().splitlines())) for name in ("ductilities.csv", "strengths.csv")
    )
    assert all(float(row["ductility"]) == pytest.approx(float(row["target_ductility"]), rel=1e-8) for row in found)
    assert {row["yield_strength_ratio"] for row in given} == {"0.1", "0.2"}
    columns = re.findall(r"`(\w+)`", TEXT.partition("| column | meaning |")[2].partition("There is no error")[0])
    assert set(columns) <= set(found[0])
    assert (folder / "ductilities.png").exists()


def test_the_batches(checkout):
    folder, environment = checkout
    result = subprocess.run(
        ["bash", "-eu", "-c", readme.block("batch")], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    assert "note: records/: not taken for records: README.md, make_records.py\n" in result.stderr
    assert {path.stem for path in (folder / "spectra").iterdir()} == {"firm-soil", "near-fault", "soft-soil"}
    (east, _) = json.loads((folder / "filtered.json").read_text())["records"]
    assert [step.split(":")[0] for step in east["processing"][1:]] == ["highpass 0.1 Hz", "lowpass 25 Hz"]
    assert len(json.loads((folder / "records.json").read_text())["records"]) == 6
    assert (folder / "records.png").exists()


def test_the_drift_spectra(checkout):
    folder, environment = checkout
    result = subprocess.run(
        ["bash", "-eu", "-c", readme.block("drift")], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert (result.returncode, result.stdout) == (0, ""), result.stderr
    buildings, beams = (
        list(csv.DictReader((folder / name).read_text().splitlines())) for name in ("drifts.csv", "beam.csv")
    )
    assert [row["period_s"] for row in buildings] == [row["period_s"] for row in beams]
    assert max(float(row["peak_drift_ratio"]) for row in buildings) == pytest.approx(0.024, rel=0.02)
    assert (folder / "drifts.png").exists()


def test_the_python_example(checkout):
    folder, environment = checkout
    result = subprocess.run(
        [sys.executable, "-c", readme.block("python")], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    drift_ratio = float(result.stdout.split()[0])
    assert 0.001 < drift_ratio < 0.1


def test_one_more_method_is_one_line():
    member = eval(readme.block("member"), vars(single_step))
    integrator = Integrator(member)
    observed = observed_order(integrator, order_problem("harmonic", "linear"))
    assert observed.order("displacement") == pytest.approx(integrator.order, abs=0.1)
    assert np.isinf(critical_step(integrator))


def test_relative_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", TEXT):
        assert (readme.ROOT / target).exists(), target
    headings = {
        re.sub(r"[^\w\- ]", "", line.lstrip("# ").lower()).replace(" ", "-")
        for line in TEXT.splitlines()
        if line.startswith("#")
    }
    for anchor in re.findall(r"\]\(#([^)]+)\)", TEXT):
        assert anchor in headings, anchor
