"""Each name has one meaning in tables and messages: isolators and stories, residual drifts after a
collapse, counts of components and motions, digits beside a limit, provenance of scale factors."""

import json
import math
import re
import shutil
from pathlib import Path

import pytest

from cli.conftest import Command
from csv_rows import rows

FRAME = """\
units: {length: m, force: kN, mass: t}
stories:
  - {mass: 100, height: 3, stiffness: 30000}
  - {mass: 90, height: 3, stiffness: 32000}
damping: 5%
analysis: {method: exact}
"""
ISOLATED = """\
units: {length: m, force: kN, mass: t}
stories:
  - {mass: 110, stiffness: 5000, isolator: rayleigh}
  - {mass: 100, height: 3.2, stiffness: 90000}
  - {mass: 90, height: 3.2, stiffness: 70000}
damping: 5%
analysis: {method: exact}
"""
SOFTENING = """\
units: {length: m, force: kN, mass: t}
stories:
  - mass: 100
    height: 3
    stiffness: 16000
    law: {type: bilinear, yield_force: 700, hardening: -0.2}
  - {mass: 90, height: 3, stiffness: 18000}
damping: 5%
p_delta: true
collapse_drift: 5%
"""


def write_motion(name: str, peak: float, period: float = 0.8) -> None:
    """Write a record of three periods of a sine, m/s^2, with a quiet end."""
    samples = [
        peak * math.sin(2.0 * math.pi * 0.01 * i / period) if 0.01 * i < 3.0 * period else 0.0
        for i in range(501)
    ]
    lines = [f"{0.01 * i:.2f},{value:.6f}" for i, value in enumerate(samples)]
    Path(name).write_text("\n".join(["Time (s),Acceleration (m/s^2)", *lines]) + "\n")


STUDY = """\
name: study
buildings: {models: [model.yaml]}
records: {files: [a.csv, b.csv]}
outputs: {stories: true}
"""


def write_pair(name: str, peaks: tuple[float, float]) -> None:
    """Write the two components of a recording in two files in the format of PEER."""
    for direction, peak in zip(("000", "090"), peaks, strict=True):
        values = [peak / 9.80665 * math.sin(2.0 * math.pi * 0.01 * i / 0.6) for i in range(300)]
        numbers = "\n".join(
            "".join(f"{value:15.7E}" for value in values[i : i + 5]) for i in range(0, 300, 5)
        )
        Path("set", f"{name}{direction}.AT2").write_text(
            "PEER NGA STRONG MOTION DATABASE RECORD\nTest, 1/1/2000, Station, "
            f"{direction}\nACCELERATION TIME SERIES IN UNITS OF G\n"
            f"NPTS=    300, DT=   .0100 SEC,\n{numbers}\n"
        )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change to an empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_isolators_and_stories_have_separate_columns(folder: Path, tdint: Command) -> None:
    Path("model.yaml").write_text(ISOLATED)
    for name, peak in (("a.csv", 1.0), ("b.csv", 2.0)):
        write_motion(name, peak)
    Path("study.yaml").write_text(STUDY)
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    for run in rows("out/runs.csv"):
        isolator, *stories = [
            float(row["peak_drift_m"])
            for row in rows(Path("out/stories.csv"))
            if row["record"] == run["record"]
        ]
        assert isolator > 5.0 * max(stories)
        assert float(run["peak_drift_m"]) == max(stories)
        assert float(run["peak_isolator_displacement_m"]) == isolator
        assert float(run["peak_drift_ratio"]) == pytest.approx(max(stories) / 3.2)
        assert int(run["peak_drift_story"]) == 2 + stories.index(max(stories))
    single = tdint("run", "model.yaml", "a.csv", "-o", "one", code=0)
    summary = json.loads(Path("one/summary.json").read_text())
    run = rows("out/runs.csv")[0]
    assert summary["peaks"]["drift_m"] == pytest.approx(float(run["peak_drift_m"]), rel=1e-11)
    assert summary["peaks"]["isolator_displacement_story"] == 1
    assert "isolator displacement" in single.stderr and "in story 1" in single.stderr


def test_residual_drifts_of_collapsed_runs_are_empty(folder: Path, tdint: Command) -> None:
    Path("model.yaml").write_text(SOFTENING)
    for name, peak in (("a.csv", 0.5), ("b.csv", 12.0)):
        write_motion(name, peak)
    Path("study.yaml").write_text(STUDY)
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    done, collapsed = rows("out/runs.csv")
    assert (done["status"], collapsed["status"]) == ("done", "collapsed")
    assert float(done["residual_drift_ratio"]) > 0.0
    assert collapsed["residual_drift_ratio"] == "" and float(collapsed["peak_drift_ratio"]) > 0.05
    assert [row["residual_drift_m"] == "" for row in rows(Path("out/stories.csv"))] == [
        False, False, True, True,
    ]  # fmt: skip
    # The events of a sequence before the collapse have residual drifts.
    sequence = ("run", "model.yaml", "a.csv", "b.csv", "--sequence", "-o", "sequence")
    result = tdint(*sequence, code=0)
    before, last = json.loads(Path("sequence/summary.json").read_text())["events"]
    assert before["peaks"]["residual_drift_m"] > 0.0 and last["peaks"]["residual_drift_m"] is None
    assert [", residual" in line for line in result.stderr.splitlines() if "Event" in line] == [
        True, False,
    ]  # fmt: skip


def test_message_states_that_one_component_collapsed(folder: Path, tdint: Command) -> None:
    Path("set").mkdir()
    write_pair("RSN1_A", (0.5, 6.0))
    write_pair("RSN2_B", (6.0, 0.4))
    Path("model.yaml").write_text(FRAME.replace("analysis", "collapse_drift: 0.8%\nanalysis"))
    Path("study.yaml").write_text(STUDY.replace("[a.csv, b.csv]", "[set/], pairs: true"))
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    assert [row["status"] for row in rows("out/runs.csv")].count("done") == 2
    result = tdint("campaign", "export", "out", "--limit", "2%", code=0)
    text = "of 2 ground motions, 2 collapsed under a component, 2 of 4 components completed"
    assert f"{text}; no mean can be computed" in result.stderr
    assert f"No mean demand ({text}), limit 2 %: exceeded" in result.stderr


def test_digits_beside_a_limit_show_the_side(folder: Path, tdint: Command) -> None:
    """The response is linear, so that a factor gives a chosen maximum."""
    Path("model.yaml").write_text(FRAME)
    for name, peak in (("a.csv", 1.0), ("b.csv", 0.9)):
        write_motion(name, peak)
    motions = ("run", "model.yaml", "a.csv", "b.csv")
    tdint(*motions, "-o", "out", code=0)
    ratios = [float(row["peak_drift_ratio"]) for row in rows("out/runs.csv")]
    for largest, printed in ((0.0200340, "largest 2.003 %"), (0.0199980, "largest 1.9998 %")):
        factor = largest / max(ratios)
        mean = 100.0 * factor * sum(ratios) / 2.0
        result = tdint(*motions, "--scale", repr(factor), "--limit", "2%", code=0)
        line = next(line for line in result.stderr.splitlines() if line.startswith("Mean drift"))
        assert printed in line
        assert re.match(rf"Mean drift {mean:.3g} % \(story \d, 2 motions\), limit 2 %: met", line)


def test_copied_factors_state_target_and_rule(folder: Path, tdint: Command) -> None:
    Path("model.yaml").write_text(FRAME)
    for name, peak in (("a.csv", 1.0), ("b.csv", 2.0)):
        write_motion(name, peak)
    Path("site.csv").write_text(
        "period_s,psa_m_s2\n" + "".join(f"{0.1 * i:.1f},{4.0 / i:.4f}\n" for i in range(1, 30))
    )
    scale = ("scale", "a.csv", "b.csv")
    target = ("--target", "site.csv", "--range", "0.2:1.5", "-o", "factors.csv")
    tdint(*scale, *target, code=0)
    table = rows("factors.csv")
    assert list(table[0]) == ["record", "component", "factor", "target", "rule", "version"]
    version = tdint("--version", code=0).stdout.split()[-1]
    assert {(row["target"], row["rule"], row["version"]) for row in table} == {
        ("site.csv", "mean", version)
    }
    shutil.copy("factors.csv", "copied.csv")
    result = tdint("run", "model.yaml", "--factors", "copied.csv", "-o", "out", code=0)
    assert "Ground motions scaled to site.csv (rule mean, factors" in result.stderr
    scaling = json.loads(Path("out/summary.json").read_text())["scaling"]
    assert scaling == {"file": "copied.csv", "rule": "mean", "target": "site.csv"}
    tdint("run", "model.yaml", "--factors", "copied.csv", "--report", "page.html", code=0)
    page = Path("page.html").read_text()
    assert "rule mean (least squares of ln Sa" in page and "target site.csv" in page
    # The table of an intensity measure, and a table without provenance
    tdint(*scale, "--to", "pga=0.3g", "-o", "pga.csv", code=0)
    assert {row["target"] for row in rows("pga.csv")} == {"pga = 2.942 m/s^2"}
    Path("plain.csv").write_text("record,component,factor\na.csv,,2\nb.csv,,3\n")
    tdint("run", "model.yaml", "--factors", "plain.csv", "-o", "plain", code=0)
    assert json.loads(Path("plain/summary.json").read_text())["scaling"] == {"file": "plain.csv"}


def test_check_states_that_power_law_dampers_are_omitted(folder: Path, tdint: Command) -> None:
    damper = "dashpot: {coefficient: 300, exponent: 0.4, linear_below: 0.001}"
    for name, more in (("power", damper), ("linear", "dashpot: 200")):
        Path(f"{name}.yaml").write_text(
            FRAME.replace("stiffness: 32000", f"stiffness: 32000, {more}")
        )
    result = tdint("check", "power.yaml", "linear.yaml", code=0)
    (line,) = (line for line in result.stderr.splitlines() if "power-law dampers" in line)
    assert "power.yaml: damping ratios: power-law dampers are omitted" in line
    modes = tdint("modes", "power.yaml", code=0)
    assert "power-law dampers are omitted" in modes.stderr
