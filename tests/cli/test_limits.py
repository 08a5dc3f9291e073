"""Limits of models on the command line: one comparison for runs, suites, campaigns and reports."""

import json
import re
from pathlib import Path

import pytest

from cli.conftest import Command
from csv_rows import rows
from tdint import campaign

MODEL = """name: isolated
units: {length: m, force: kN, mass: t}
stories:
  - {mass: 300, stiffness: 1e4, law: {type: bilinear, yield_force: 300, hardening: 0.1},
     dashpot: 400, isolator: true}
  - {repeat: 2, mass: 300, height: 3.5, stiffness: 1e6, dashpot: 2435}
"""
MOTIONS = ("motion.mseed", "other.mseed")
UNITS = ("--units", "m/s^2", "--component", "HNE")


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make_record) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, peak in zip(MOTIONS, (3.0, 4.5), strict=True):
        make_record(tmp_path / name, "HNE", peak=peak)
    return tmp_path


def write(limits: str) -> None:
    Path("model.yaml").write_text(MODEL + f"limits: {limits}\n")


def test_limits_apply_to_peaks_of_a_run_and_means_of_a_suite(study: Path, tdint: Command) -> None:
    """`run` of one record compares its peaks, `run` of two records the means; both equal the values
    of the tables, and --require ends with code 5 exactly if a value exceeds its limit."""
    write("{isolator_displacement: 0.5}")
    peaks = {
        name: rows(tdint("run", "model.yaml", name, *UNITS, code=0).stdout) for name in MOTIONS
    }
    moved = [float(peaks[name][0]["peak_drift_m"]) for name in MOTIONS]
    mean = sum(moved) / 2
    top = MOTIONS[moved.index(max(moved))]
    for suite, demand in ((MOTIONS[:1], moved[0]), (MOTIONS, mean)):
        for factor, code in ((1.001, 0), (0.999, 5)):
            write(f"{{isolator_displacement: {factor * demand!r}}}")
            run = ("run", "model.yaml", *suite, *UNITS, "--overwrite", "-o", "out")
            result = tdint(*run, "--require", code=code)
            line = next(x for x in result.stderr.splitlines() if x.startswith("Limits "))
            assert line.startswith("Limits met: " if code == 0 else "Limits exceeded: ")
            place = "(story 1, 2 motions)" if len(suite) > 1 else "(story 1)"
            assert "isolator displacement" in line and place in line
            (entry,) = json.loads(Path("out/summary.json").read_text())["limits"]
            assert entry["isolator_displacement_m"] == pytest.approx(demand, rel=1e-11)
            assert entry["met"] is (code == 0)
            assert entry["limit_ratio"] == pytest.approx(1.0 / factor, rel=1e-9)
            if len(suite) > 1:
                assert f"(story 1, {top})" in line and entry["motion"] == top


def test_the_governing_quantity_is_first_in_terminal_report_and_table(
    study: Path, tdint: Command
) -> None:
    write("{drift_ratio: 90%, isolator_displacement: 1 mm, floor_acceleration: 100 g}")
    run = ("run", "model.yaml", MOTIONS[0], *UNITS, "--report", "page.html")
    line = next(x for x in tdint(*run, code=0).stderr.splitlines() if x.startswith("Limits "))
    assert line.startswith("Limits exceeded: isolator displacement ") and " governs: " in line
    body = Path("page.html").read_text().partition("<body>")[2]
    (verdict,) = re.findall(r'<p class="v broken">(.*?)</p>', body)
    assert verdict.startswith("Limits exceeded: isolator displacement ")
    assert "<h2>Limits</h2>" in body or re.search(r"<h2[^>]*>Limits</h2>", body)
    table = body[body.index(">Limits</h2>") :].partition("</table>")[0]
    assert re.findall(r">(met|exceeded)<", table) == ["exceeded", "met", "met"]


def test_a_level_is_selected_by_its_name(study: Path, tdint: Command) -> None:
    write("{levels: {service: {isolator_displacement: 1 mm}, safety: {isolator_displacement: 9}}}")
    run = ("run", "model.yaml", MOTIONS[0], *UNITS, "--require")
    result = tdint(*run, code=5)
    assert "Limits of service exceeded: " in result.stderr
    assert "Limits of safety met: " in result.stderr
    assert "Limits of service" not in tdint(*run, "--limit", "safety", code=0).stderr
    assert "did you mean 'safety'" in tdint(*run, "--limit", "safty", code=2).stderr
    assert "limit 5 %: met" in tdint(*run, "--limit", "5%", code=0).stderr


def test_a_campaign_and_its_export_check_the_limits(study: Path, tdint: Command) -> None:
    write("{isolator_displacement: 1 mm}")
    Path("study.yaml").write_text(
        "buildings: {models: [model.yaml]}\nrecords: {files: [motion.mseed, other.mseed], units: "
        "m/s^2, component: HNE}\nintensity: {scales: [1]}\n"
    )
    options = ("--require", "--report", "page.html")
    result = tdint("campaign", "study.yaml", "-o", "out", *options, code=5)
    assert "Limits exceeded: mean isolator displacement" in result.stderr
    assert "not met: isolated" in result.stderr
    assert 'class="v broken">Limits exceeded: mean isolator' in Path("page.html").read_text()
    again = tdint("campaign", "export", "out", "--require", code=5)
    assert "Limits exceeded: mean isolator displacement" in again.stderr
    (checks,) = campaign("study.yaml").limit_checks().values()
    (entry,) = json.loads(Path("out/summary.json").read_text())["limits"]
    assert checks[0].demand == pytest.approx(entry["isolator_displacement_m"], rel=1e-11)
    assert (checks[0].motion, checks[0].within) == (entry["motion"], False)
    # Limits do not belong to the runs: the runs of another limit are the same.
    write("{isolator_displacement: 99}")
    done = tdint("campaign", "study.yaml", "-o", "out", "--require", code=0)
    assert "nothing to do" in done.stderr and "Limits met: " in done.stderr


def test_a_collapse_does_not_meet_any_limit(study: Path, tdint: Command) -> None:
    """All quantities are within their limits, but a story exceeds the collapse drift."""
    text = MODEL.replace("name: isolated", "name: isolated\ncollapse_drift: 0.0001%")
    Path("model.yaml").write_text(text + "limits: {isolator_displacement: 99}\n")
    run = ("run", "model.yaml", MOTIONS[0], *UNITS)
    single = tdint(*run, "--require", "--report", "page.html", code=5)
    assert "Limits exceeded, status collapsed: " in single.stderr
    body = Path("page.html").read_text().partition("<body>")[2]
    verdicts = re.findall(r'<p class="v ?(\w*)">(.*?)</p>', body)
    assert verdicts[0][0] == "broken" and "collapsed" in verdicts[0][1]
    assert "Limits" not in verdicts[0][1] and "Limits exceeded" in verdicts[1][1]
    # The table states why a demand below its limit does not meet it.
    (row,) = re.findall(r"<td.*?isolator displacement.*?</tr>", body, re.DOTALL)
    assert "exceeded: status collapsed" in row
    several = tdint("run", "model.yaml", *MOTIONS, *UNITS, "--require", code=5)
    assert "No mean demand (of 2 ground motions, 2 collapsed)" in several.stderr


def test_the_isolator_displacement_is_reported_without_a_limit(study: Path, tdint: Command) -> None:
    Path("model.yaml").write_text(MODEL)
    single = tdint("run", "model.yaml", MOTIONS[0], *UNITS, code=0)
    moved = float(rows(single.stdout)[0]["peak_drift_m"])
    assert f"isolator displacement {moved:.4g} m in story 1" in single.stderr
    tdint("run", "model.yaml", *MOTIONS, *UNITS, "--report", "page.html", code=0)
    body = Path("page.html").read_text().partition("<body>")[2]
    assert '<p class="v">Mean isolator displacement ' in body


def test_require_needs_a_limit(study: Path, tdint: Command) -> None:
    Path("model.yaml").write_text(MODEL)
    for records in (MOTIONS, MOTIONS[:1]):
        refused = tdint("run", "model.yaml", *records, *UNITS, "--require", code=2)
        assert re.search("--require .*--limit .*`limits`", refused.stderr)


@pytest.mark.long
def test_the_report_draws_the_loop_of_the_governing_story(study: Path, tdint: Command) -> None:
    """The figure of the run has the loop of the isolator, which yields. If a drift ratio governs,
    the report has a second figure with the loop of its story."""
    caption = "Hysteresis loop of story 2, which governs the limits"
    run = ("run", "model.yaml", MOTIONS[0], *UNITS, "--report", "page.html", "--overwrite")
    for limits, drawn in (
        ("{drift_ratio: {2: 0.0001%, 3: 9%}, isolator_displacement: 9}", True),
        ("{drift_ratio: 90%, isolator_displacement: 1 mm}", False),
        ("{floor_acceleration: 1 g}", False),
    ):
        write(limits)
        tdint(*run, code=0)
        assert (caption in Path("page.html").read_text()) is drawn
