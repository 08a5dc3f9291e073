"""`tdint campaign --im`, and the use of its measures by `tdint fragility --im`."""

import json
from pathlib import Path

import pytest

from cli.conftest import STUDY
from csv_rows import rows


@pytest.fixture
def study(folder):
    (folder / "study.yaml").write_text(STUDY.replace("0.5, 1]", "0.5, 1.5]"))
    return folder


def test_measures_of_runs_and_their_comparison(study, tdint):
    """The measures can be added to a completed campaign and equal the values of `tdint info`."""
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    assert not (study / "out/measures.csv").exists()
    tdint("campaign", "study.yaml", "-o", "out", "--im", "pgv,arias,cav5,sa:0.5,sdi:T1:5%", code=0)
    measures, runs = rows("out/measures.csv"), rows("out/runs.csv")
    keys = ("building", "record", "component", "scale", "sample")
    assert [[row[key] for key in keys] for row in measures] == [
        [row[key] for key in keys] for row in runs
    ]
    assert list(measures[0])[5:] == [
        "pgv_m_s", "arias_intensity_m_s", "cav5_m_s", "sa_0p5_m_s2", "sdi_t1_0p05_m",
    ]  # fmt: skip
    (info,) = rows(tdint("info", "motion.mseed", "--units", "m/s^2", "--component", "HNE").stdout)
    motion = ("motion.mseed", "HNE", "1.5")
    (row,) = (row for row in measures if (row["record"], row["component"], row["scale"]) == motion)
    for name, power in (("pgv_m_s", 1), ("arias_intensity_m_s", 2)):
        assert float(row[name]) == pytest.approx(1.5**power * float(info[name]), rel=1e-9)
    result = tdint("fragility", "out", "--im", "sa,pgv,sdi:T1:5%", "-o", "best.csv", code=0)
    table = rows("best.csv")
    assert {row["im"] for row in table} == {"pgv", "sa", "sdi:T1:5%"}
    assert [float(row["beta"]) for row in table] == sorted(float(row["beta"]) for row in table)
    assert f"{table[0]['im']} predicts the drift best" in result.stderr
    inputs = json.loads(Path("best.json").read_text())["inputs"]
    assert [Path(read["file"]).name for read in inputs] == ["measures.csv", "runs.csv"]
    single = tdint("fragility out --im pgv --fit cloud --threshold 0.1%", code=0)
    assert ",geometric-mean-pgv,m/s," in single.stdout


def test_units_of_the_measures(study, tdint):
    tdint("campaign", "study.yaml", "-o", "out", "--im", "pgv", "--output-units", "in,g", code=0)
    assert "pgv_in_s" in (study / "out/measures.csv").read_text()
    units = {
        row["im"]: row["unit"]
        for row in rows(tdint("fragility", "out", "--im", "sa,pga,pgv", code=0).stdout)
    }
    assert units == {"sa": "g", "pga": "g", "pgv": "in/s"}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (("campaign", "study.yaml", "-o", "new", "--im", "pgx"), "unknown intensity measure 'pgx'"),
        (
            ("campaign", "export", "out", "--im", "pga"),
            "with `tdint campaign export`; it requires the models",
        ),
        (("fragility", "out", "--im", "sa,cav"), "the runs have no measure cav"),
    ],
)
def test_invalid_measures_are_refused(study, tdint, call, message):
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    tdint.refused(message, *call)
