"""Load cases of a campaign: forces on floors from one file per load case, the ground at rest."""

import csv
import json
import sqlite3
from contextlib import closing
from hashlib import sha256
from pathlib import Path

import pytest

from tdint import run

MODEL = """\
units: {length: m, mass: t, force: kN}
stories:
  - repeat: 2
    mass: 20
    height: 3
    stiffness: 2.0e+4
    law: {type: bilinear, yield_force: 60, hardening: 0.05}
damping: {modal: 3%}
"""
LOADS = "floors: {roof: roof_kN, 1: 0.6 roof_kN}, start: 0.1, scale: 1.5"
CAMPAIGN = f"""\
buildings: {{models: [m.yaml]}}
forces: {{files: [gust.csv, blast.csv], {LOADS}}}
intensity: {{scales: [1, -2]}}
outputs: {{stories: true}}
"""


def rows_of(file):
    with Path(file).open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def cases(working_directory):
    """A model without a record, two files of forces, and a campaign of them."""
    Path("gust.csv").write_text("time_s,roof_kN\n0,0\n0.2,40\n0.7,-25\n1,0\n")
    Path("blast.csv").write_text("t_ms,roof_kN,other_kN\n0,90,1\n60,0,2\n")
    Path("m.yaml").write_text(MODEL + "analysis: {duration: 1.5}\n")
    Path("c.yaml").write_text(CAMPAIGN)


@pytest.mark.parametrize("analysis", ["", "until_rest: true", "check: true", "dt: 0.013"])
def test_each_run_equals_a_run_of_the_model_with_the_file(cases, tdint, analysis):
    """All stored results are equal, to the bit, to those of `tdint run`."""
    Path("c.yaml").write_text(CAMPAIGN + (f"analysis: {{{analysis}}}\n" if analysis else ""))
    tdint("campaign", "c.yaml", "-o", "out", code=0)
    runs, stories = rows_of("out/runs.csv"), rows_of("out/stories.csv")
    assert len(runs) == 4
    for row in runs:
        assert row["pga_m_s2"] == row["sa_t1_m_s2"] == ""
        scale = 1.5 * float(row["scale"])
        loads = LOADS.replace("scale: 1.5", f"scale: {scale}")
        force = f"excitation: {{forces: [{{file: {row['record']}, {loads}}}]}}\n"
        Path("one.yaml").write_text(Path("m.yaml").read_text() + force)
        options = {
            "until_rest: true": ["--until-rest", "--no-check"],
            "check: true": [],
            "dt: 0.013": ["--dt", "0.013", "--no-check"],
        }.get(analysis, ["--no-check"])
        tdint("run", "one.yaml", *options, "-o", "one", "--overwrite", code=0)
        expected = rows_of("one/stories.csv")
        found = [
            story
            for story in stories
            if (story["record"], story["scale"]) == (row["record"], row["scale"])
        ]
        assert len(found) == len(expected) == 2
        for mine, theirs in zip(found, expected, strict=True):
            names = set(mine) & set(theirs)
            assert {"peak_drift_m", "residual_drift_m", "peak_shear_N"} <= names
            assert {name: mine[name] for name in names} == {name: theirs[name] for name in names}
        assert (float(row["peak_drift_m_error"]) > 0.0) if analysis == "check: true" else True
    assert len({row["peak_drift_m"] for row in runs}) == 4


def test_stored_numbers_equal_those_of_a_run(cases, tdint):
    """The numbers of the store are not rounded: they equal those of a run to the last bit."""
    tdint("campaign", "c.yaml", "-o", "out", code=0)
    query = "SELECT record, scale, peak_drift_m, energy_error FROM run_rows"
    with closing(sqlite3.connect("out/campaign.sqlite")) as store:
        rows = store.execute(query).fetchall()
    assert len(rows) == 4
    for record, scale, peak_drift, energy_error in rows:
        file = ("gust.csv", "blast.csv")[record]
        loads = LOADS.replace("scale: 1.5", f"scale: {1.5 * scale}")
        force = f"excitation: {{forces: [{{file: {file}, {loads}}}]}}\n"
        Path("one.yaml").write_text(Path("m.yaml").read_text() + force)
        response = run("one.yaml")
        assert peak_drift == response.stories.peak_drift.max()
        assert energy_error == response.energy.error


@pytest.mark.long
def test_summary_report_and_status(cases, tdint):
    tdint("campaign", "c.yaml", "-o", "out", "--plot", "--report", "out/report.html", code=0)
    summary = json.loads(Path("out/summary.json").read_text())
    hashes = {item["file"]: item["sha256"] for item in summary["inputs"]}
    assert {"gust.csv", "blast.csv", "m.yaml", "c.yaml"} == set(hashes)
    assert hashes["gust.csv"] == sha256(Path("gust.csv").read_bytes()).hexdigest()
    assert [set(item) for item in summary["records"]] == [{"file", "sha256"}] * 2
    report = Path("out/report.html").read_text()
    assert "Load cases" in report and "Response spectra" not in report
    assert "left,0" in tdint("campaign", "status", "out", code=0).stdout


def test_shards_merge_and_export(cases, tdint):
    tdint("campaign", "c.yaml", "-o", "whole", code=0)
    for number in (1, 2):
        tdint("campaign", "c.yaml", "--shard", f"{number}/2", "-o", f"part{number}", code=0)
    tdint("campaign", "merge", "part1", "part2", "-o", "merged", code=0)
    assert Path("merged/runs.csv").read_bytes() == Path("whole/runs.csv").read_bytes()
    before = Path("whole/runs.csv").read_bytes()
    Path("whole/runs.csv").unlink()
    tdint("campaign", "export", "whole", code=0)
    assert Path("whole/runs.csv").read_bytes() == before


def test_floor_spectra_equal_those_of_a_run(cases, tdint):
    tdint("campaign", "c.yaml", "-o", "out", "--floor-spectra", "roof", code=0)
    loads = LOADS.replace("scale: 1.5", "scale: -3.0")
    force = f"excitation: {{forces: [{{file: blast.csv, {loads}}}]}}\n"
    Path("one.yaml").write_text(Path("m.yaml").read_text() + force)
    tdint("run", "one.yaml", "--no-check", "--floor-spectra", "roof", "-o", "one", code=0)
    expected = rows_of("one/floor-spectra.csv")
    found = [
        row
        for row in rows_of("out/floor-spectra.csv")
        if (row["record"], row["scale"]) == ("blast.csv", "-2")
    ]
    assert [{name: row[name] for name in expected[0]} for row in found] == expected


def test_sweeps_and_their_correlations(cases, tdint):
    Path("c.yaml").write_text(CAMPAIGN + "vary: {stiffness_factor: [0.8, 1, 1.2]}\n")
    tdint("campaign", "c.yaml", "-o", "out", code=0)
    assert len(rows_of("out/runs.csv")) == 12
    assert "stiffness_factor" in tdint("sensitivity", "out", code=0).stdout


def test_changed_keeps_the_other_load_cases(cases, tdint):
    tdint("campaign", "c.yaml", "-o", "out", code=0)
    Path("blast.csv").write_text("t_ms,roof_kN,other_kN\n0,95,1\n60,0,2\n")
    assert "--changed" in tdint("campaign", "c.yaml", "-o", "out", code=6).stderr
    result = tdint("campaign", "c.yaml", "-o", "out", "--changed", code=0)
    assert "the results of 2 of 4 runs are kept" in result.stderr
    tdint("campaign", "c.yaml", "-o", "new", code=0)
    assert Path("out/runs.csv").read_bytes() == Path("new/runs.csv").read_bytes()


def test_a_tolerance_chooses_the_step(cases, tdint):
    Path("c.yaml").write_text(CAMPAIGN + "analysis: {tolerance: 0.01%, method: newmark-average}\n")
    tdint("campaign", "c.yaml", "-o", "out", code=0)
    rows = rows_of("out/runs.csv")
    assert {row["status"] for row in rows} == {"done"}
    # The default step is a fiftieth of the first period, about 6 ms.
    assert all(float(row["dt_s"]) < 3e-3 for row in rows)


def test_a_building_replaces_its_own_tables(cases, tdint):
    tdint("campaign", "c.yaml", "-o", "out", code=0)
    own = "excitation: {forces: [{floor: 1, points: [[0, 50], [1, 0]]}]}\n"
    Path("m.yaml").write_text(Path("m.yaml").read_text() + own)
    tdint("campaign", "c.yaml", "-o", "own", code=0)
    assert Path("own/runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()


@pytest.mark.parametrize(
    ("forces", "message"),
    [
        ("files: [gust.csv], floor: 3", "floor 3 does not exist in m, which has 2 floors"),
        ("files: [gust.csv], floors: {x: roof_kN}", "floors from 1 or roof, got 'x'"),
        ("files: [gust.csv]", "forces.floor: is missing; give the floor"),
        ("files: [], floor: 1", "is empty; give at least one file"),
        ("floor: 1", "forces.files: is missing"),
        ("files: [gust.csv], floor: 1, floors: {1: roof_kN}", "cannot be used with `floors`"),
        ("files: [gust.csv], floor: 1, start: x", "forces.start: must be a number, got 'x'"),
    ],
)
def test_check_refuses_invalid_requests(cases, tdint, forces, message):
    Path("c.yaml").write_text(f"buildings: {{models: [m.yaml]}}\nforces: {{{forces}}}\n")
    assert message in tdint("check", "c.yaml", code=3).stderr
    assert message in tdint("campaign", "c.yaml", "-o", "out", code=3).stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,roof_m\n0,1\n1,2\n", "bad.csv:1: the column roof_m has the unit m"),
        ("time_s,roof_kN\n0,1\n1,2\n0.5,3\n", "bad.csv:4: time_s: times must not decrease"),
        ("roof_kN\n0\n1\n", "bad.csv:1: no column of times"),
        ("time_s,a_kN,b_kN\n0,1,1\n1,2,1\n", "bad.csv: the file has 2 columns of forces"),
        (None, "bad.csv: file not found"),
    ],
)
def test_other_load_cases_are_run_if_a_file_is_bad(cases, tdint, text, message):
    if text is not None:
        Path("bad.csv").write_text(text)
    forces = "forces: {files: [gust.csv, bad.csv], floor: roof}\n"
    Path("c.yaml").write_text(f"buildings: {{models: [m.yaml]}}\n{forces}")
    assert message in tdint("check", "c.yaml", code=4).stderr
    assert message in tdint("campaign", "c.yaml", "-o", "out", code=4).stderr
    assert [row["record"] for row in rows_of("out/runs.csv")] == ["gust.csv"]


def test_a_column_without_a_unit_has_the_unit_of_the_models(cases, tdint):
    """Models in kN and N have no common unit, and rows of an inventory have no unit at all."""
    Path("plain.csv").write_text("time_s,roof\n0,0\n0.2,40\n0.7,-25\n1,0\n")
    forces = "forces: {files: [FILE], floor: roof}\n"
    campaign = "buildings: {models: [m.yaml]}\n" + forces
    for file in ("gust.csv", "plain.csv"):
        Path("c.yaml").write_text(campaign.replace("FILE", file))
        tdint("campaign", "c.yaml", "-o", file.removesuffix(".csv"), code=0)
    gust, plain = Path("gust/runs.csv").read_text(), Path("plain/runs.csv").read_text()
    assert plain == gust.replace("gust.csv", "plain.csv")
    lines = "{length: m, mass: kg, force: N}"
    in_newton = MODEL.replace("{length: m, mass: t, force: kN}", lines)
    Path("n.yaml").write_text(in_newton + "analysis: {duration: 1.5}\n")
    header = "id,StructureType,NumberOfStories,YearBuilt,PlanArea"
    Path("rows.csv").write_text(header + "\na,C1,2,1990,400\n")
    both, rows = "models: [m.yaml, n.yaml]", "inventory: rows.csv, units: {length: m}"
    for buildings, reason in ((both, "different units of force: N, kN"), (rows, "inventory")):
        text = campaign.replace("FILE", "plain.csv").replace("models: [m.yaml]", buildings)
        Path("c.yaml").write_text(text + "analysis: {duration: 1}\n")
        message = (
            "plain.csv:1: the column roof has no unit; add it to the name, for example roof_kN ("
        )
        error = tdint("campaign", "c.yaml", "-o", "no", code=4).stderr
        assert message in error
        assert reason in error


def test_refusals_name_the_remedy(cases, tdint):
    base = "buildings: {models: [m.yaml]}\nforces: {files: [gust.csv], floor: roof}\n"
    levels = "intensity: {measure: pga, levels: [0.1 g]}\n"
    for extra, message in (
        ("records: {files: [motion.csv]}\n", "forces: cannot be used with `records`"),
        (levels, "intensity.measure: cannot be used with `forces`"),
        ("intensity: {factors: f.csv}\n", "intensity.factors: cannot be used with `forces`"),
    ):
        Path("c.yaml").write_text(base + extra)
        assert message in tdint("campaign", "c.yaml", "-o", "out", code=3).stderr
    Path("c.yaml").write_text(base)
    error = tdint("campaign", "c.yaml", "-o", "out", "--im", "pgv", code=2).stderr
    assert "--im cannot be used with `forces`" in error
    tdint("campaign", "c.yaml", "-o", "out", code=0)
    assert "load cases (key `forces` of a campaign) have no" in tdint("fragility", "out").stderr
    Path("m.yaml").write_text(MODEL)
    error = tdint("campaign", "c.yaml", "-o", "other", code=2).stderr
    assert "the duration is required" in error and "`analysis: {duration: SECONDS}`" in error
    force = "excitation: {forces: [{floor: 2, file: gust.csv}]}\n"
    Path("m.yaml").write_text(MODEL + force)
    assert "key `forces` of `tdint campaign`" in tdint("ida", "m.yaml", code=2).stderr
    error = tdint("sensitivity", "m.yaml", "--vary", "damping=2%:5%", code=2).stderr
    assert "key `forces` of `tdint campaign -o DIR`" in error
