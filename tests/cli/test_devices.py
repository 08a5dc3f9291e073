"""Attachments and links on the command line: tables, history, summary, first model."""

import json
import math

import pytest
import yaml

from csv_rows import rows

MODEL = """
units: {length: m, force: kN, mass: t}
stories: [{repeat: 2, mass: 100, height: 3, stiffness: 6.0e4}]
attachments: [{name: water tank, floor: 1, mass: 4, stiffness: 600, dashpot: 3}]
links:
  - {name: cable, from: water tank, to: roof, stiffness: 50}
  - {from: 2, to: ground, dashpot: 90}
initial: {velocity: [0.1, 0.2]}
analysis: {method: newmark-average, dt: 0.02, duration: 0.4}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").write_text(MODEL)
    return tmp_path


def test_tables_of_attachments_and_links(folder, tdint):
    printed = tdint("run", "model.yaml", "-o", "out", "--history", "--plot", code=0)
    (tank,) = rows((folder / "out/attachments.csv").read_text())
    cable, damper = rows((folder / "out/links.csv").read_text())
    stories = rows((folder / "out/stories.csv").read_text())
    history = rows((folder / "out/history.csv").read_text())
    assert len(stories) == 2
    assert tank["attachment"] == "water tank" and tank["floor"] == "1"
    assert (cable["from"], cable["to"]) == ("water tank", "2")
    assert (damper["link"], damper["from"], damper["to"]) == ("link_2", "2", "ground")
    drift = float(tank["peak_drift_m"])
    assert float(tank["peak_shear_N"]) == pytest.approx(6e5 * drift, rel=1e-6)
    assert drift >= 0.999 * max(abs(float(row["water_tank_drift_m"])) for row in history)
    assert float(tank["peak_drift_m_error"]) > 0.0
    force = float(cable["peak_force_N"])
    assert force == pytest.approx(5e4 * float(cable["peak_deformation_m"]), rel=1e-6)
    assert float(damper["peak_force_N"]) == 0.0 < float(damper["peak_damper_force_N"])
    # The deformation of a link to the ground is minus the displacement of the floor.
    last = history[-1]
    assert float(last["link_2_deformation_m"]) == -float(last["floor_2_displacement_m"])
    summary = json.loads((folder / "out/summary.json").read_text())
    assert summary["attachments"][0]["peak_drift_m"] == pytest.approx(drift)
    assert {"peak_deformation_m", "peak_force_N"} <= set(summary["meanings"])
    assert "Attachment water tank on floor 1: stroke" in printed.stderr


def test_modes_are_those_of_the_complete_system(folder, tdint):
    printed = tdint("modes", "model.yaml", code=0)
    assert len(rows(printed.stdout)) == 3
    assert "the damping of the stories uses their modes alone" in printed.stderr.replace("\n", " ")


@pytest.mark.parametrize("units", ["si", "us"])
def test_first_model_with_the_optimum_of_den_hartog(folder, tdint, units):
    """f = 1 / (1 + mu) and zeta = sqrt(3 mu / (8 (1 + mu))) for the modal mass at the roof."""
    options = "--stories", 4, "--period", 0.8, "--tuned-mass-damper", "--units", units
    tdint("init", "a.yaml", *options, code=0)
    model = yaml.safe_load((folder / "a.yaml").read_text())
    (damper,) = model["attachments"]
    gravity = 386.0886 if units == "us" else 1.0  # in/s^2: the file contains weights
    key = "weight" if units == "us" else "mass"
    mass = damper[key] / gravity
    modal = sum(story[key] * (i / 4) ** 2 for i, story in enumerate(model["stories"], start=1))
    mu, omega = 0.05, 2.0 * math.pi / 0.8
    assert damper[key] == pytest.approx(mu * modal, rel=1e-5)
    own = omega / (1.0 + mu)
    assert float(damper["stiffness"]) == pytest.approx(mass * own**2, rel=1e-5)
    ratio = math.sqrt(3.0 * mu / (8.0 * (1.0 + mu)))
    assert float(damper["dashpot"]) == pytest.approx(2.0 * ratio * mass * own, rel=1e-5)
    refused = tdint("init", "b.yaml", "--isolated", "--tuned-mass-damper", code=2)
    assert "tuned to a building on a fixed base" in refused.stderr
