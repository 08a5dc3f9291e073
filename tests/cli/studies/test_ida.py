"""`tdint ida`: written files, continuation of interrupted studies, and errors."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from csv_rows import rows
from facts import states
from selection import every
from tdint.studies.campaign.chunks import Batch
from tdint.studies.ida.ida import STORE
from tdint.studies.store.schema import LOCK

CONFIGS = Path(__file__).parents[3] / "configs"
FRAME = CONFIGS / "collapse-prone-frame.yaml"
UNITS = ("--units", "m/s^2")
FEW = (*UNITS, "--max-im", "1.2m/s^2", "--threshold", "0.2%")


@pytest.mark.parametrize(
    "line",
    every(
        3,
        [
            "modes soft.yaml",
            "pushover soft.yaml --drift 2%",
            "ida soft.yaml motion.mseed --units m/s^2 --im pga --max-im 0.1g",
        ],
    ),
)
def test_unusual_buildings_cause_a_warning(folder, tdint, line):
    """A stiffness in kN/m that is read as N/m causes a warning: T = 2 pi sqrt(2e5 / 4e4) = 14 s."""
    (folder / "soft.yaml").write_text("stories: [{mass: 2e5, height: 3, stiffness: 4e4}]")
    messages = tdint(*line.split(), "-q", code=0).stderr
    assert states(messages, "Warning: unusual fundamental period ... 14 s; ")


STUDY = (
    "ida", "--pair-demand", "separate", "shaken.yaml", "motion.mseed", "other.mseed",
    *UNITS, "-o", "out", "--plot",
)  # fmt: skip
TABLES = ("ida.csv", "capacities.csv", "fractiles.csv", "ida.json")


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Return a directory with the files of an incremental dynamic analysis, which the first test
    creates."""
    return {}


@pytest.fixture
def studied(folder, tdint, done):
    """Change to a directory with an incremental dynamic analysis in `out`."""
    if not done:
        tdint(*STUDY, "--jobs", 2, code=0)
        done |= {path.name: path.read_bytes() for path in (folder / "out").iterdir()}
    (folder / "out").mkdir(exist_ok=True)
    for name, data in done.items():
        (folder / "out" / name).write_bytes(data)
    return folder


def sql(*statements):
    with closing(sqlite3.connect(f"out/{STORE}")) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def written(out):
    """Return the tables, which do not depend on the pages of the store and the figure."""
    return {name: (out / name).read_bytes() for name in TABLES}


def test_an_ida_with_the_errors_of_its_runs(folder, tdint):
    """Each demand has an error estimate, also for collapsed runs. The runs and their results are
    unchanged, and the store contains the errors."""
    call = (
        "ida", "shaken.yaml", "motion.mseed", *UNITS, "--component", "HNN", "--method",
        "moment4",
    )  # fmt: skip
    tdint(*call, "-o", "plain", code=0)
    tdint(*call, "--check", "-o", "out", code=0)
    plain, checked = (rows(folder / name / "ida.csv") for name in ("plain", "out"))
    demands = ("peak_drift_ratio", "peak_absolute_acceleration_m_s2", "residual_drift_ratio")
    error_columns = [f"{name}_error" for name in demands]
    assert list(checked[0]) == [*plain[0], *error_columns]
    assert [{name: row[name] for name in plain[0]} for row in checked] == plain
    (row,) = (row for row in checked if row["level"] == "2")
    scales = ("--scale", f"{row['scale']},1e-3", "--check")
    # tests/studies tests the errors of other runs.
    single_run = rows(tdint("run", *call[1:], *scales, code=0).stdout)[1]
    assert [float(row[name]) for name in error_columns] == pytest.approx(
        [float(single_run[name]) for name in error_columns], rel=1e-6
    )
    assert {"done", "collapsed"} <= {row["status"] for row in checked}
    assert (folder / "plain" / "capacities.csv").read_bytes() == (
        folder / "out" / "capacities.csv"
    ).read_bytes()
    about = json.loads((folder / "out" / "ida.json").read_text())
    assert about["settings"]["check"] is True and "peak_drift_ratio_error" in about["columns"]
    again = tdint(*call, "--check", "-o", "out")
    assert "nothing to do" in again.stderr and rows(folder / "out" / "ida.csv") == checked
    tdint(*call, "-o", "out", code=6)  # Without --check, it is another study.


def test_the_collapse_drift_replaces_that_of_the_model(folder, tdint):
    """The capacity of collapse at 0.5 % is that of the threshold 0.5 % of another study, within the
    intervals of both; default thresholds above the collapse drift are omitted."""
    call = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "--component", "HNE")
    tdint(*call, "--collapse-drift", "0.5%", "-o", "a", code=0)
    tdint(*call, "--threshold", "0.5%", "-o", "b", code=0)
    (collapse,) = rows("a/capacities.csv")
    threshold, later_collapse = rows("b/capacities.csv")
    assert float(collapse["threshold"]) == float(threshold["threshold"]) == 0.005
    assert float(collapse["lower"]) <= float(threshold["upper"])
    assert float(threshold["lower"]) <= float(collapse["upper"])
    assert float(later_collapse["capacity"]) > 2.0 * float(collapse["capacity"])
    statuses = [(float(row["scale"]), row["status"]) for row in rows("a/ida.csv")]
    assert "collapsed" in {status for _, status in statuses}


def test_a_study_and_its_files(studied, tdint):
    """The tables contain the levels of each record, and its capacities are between levels. The same
    call again performs no run."""
    out = studied / "out"
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert set(before) == {*TABLES, "ida.png", STORE, LOCK}
    runs, capacities = (rows(out / f"{name}.csv") for name in ("ida", "capacities"))
    records = list(dict.fromkeys((row["record"], row["component"]) for row in runs))
    # Both components of the pair have the levels of the pair, also if they count separately.
    assert records == [("motion.mseed", "HNN"), ("motion.mseed", "HNE"), ("other.mseed", "HNE")]
    assert {row["im_name"].partition("-sa(")[0] for row in runs} == {"geometric-mean"}
    for record in records:
        levels = [row for row in runs if (row["record"], row["component"]) == record]
        assert [int(row["level"]) for row in levels] == list(range(1, len(levels) + 1))
        collapse = min(float(row["im"]) for row in levels if row["status"] == "collapsed")
        below = [row for row in capacities if (row["record"], row["component"]) == record]
        assert [row["threshold"] for row in below] == ["0.01", "0.02", "0.04", "0.1"]
        lower, upper = float(below[-1]["lower"]), float(below[-1]["upper"])
        stable = [float(row["im"]) for row in levels if row["status"] == "done"]
        assert (lower, upper) == (max(im for im in stable if im < collapse), collapse)
        assert upper / lower <= 1.05 + 1e-9
        assert {row["censored"] for row in below} == {"false"}
    # The last points of the fractile curves are the fractiles of the collapse capacities.
    curve = rows(out / "fractiles.csv")
    assert [float(row["drift_ratio"]) for row in curve] == pytest.approx(
        [0.1 * i / 239 for i in range(1, 240)]
    )
    collapses = sorted(float(row["capacity"]) for row in capacities if row["threshold"] == "0.1")
    low, middle, high = collapses
    last = [float(curve[-1][name]) for name in ("p16", "median", "p84")]
    assert last == pytest.approx(
        [low * (middle / low) ** 0.32, middle, middle * (high / middle) ** 0.68], rel=1e-9
    )
    assert {(row["motions"], row["unit"]) for row in curve} == {("3", "m/s^2")}
    summary = json.loads((out / "ida.json").read_text())
    assert summary["settings"]["collapse_drift"] == 0.1
    assert summary["columns"]["capacity"]["unit"] == "m/s^2"
    assert "all records were completed" in tdint(*STUDY, code=0).stderr
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize(
    ("statements", "message"),
    every(
        3,
        [
            (
                ["DELETE FROM run_rows WHERE chunk > 0", "DELETE FROM chunks WHERE id > 0"],
                "1 of 3 records were completed",
            ),
            (["DELETE FROM run_rows WHERE chunk = 1 AND scale > 1"], "they are run again"),
            (["UPDATE run_rows SET status = 'done'"], "they are run again"),
            (["UPDATE run_rows SET scale = 1.001 * scale"], "they are run again"),
            (["UPDATE chunks SET runs = 1e9"], "they are run again"),
        ],
    ),
)
def test_missing_or_corrupt_runs_are_run_again(studied, tdint, statements, message):
    """The study continues as after an interruption, and its files are equal to the last byte."""
    before = written(studied / "out")
    for name in before:
        (studied / "out" / name).unlink()
    sql(*statements)
    assert message in tdint(*STUDY, code=0).stderr
    assert written(studied / "out") == before


@pytest.mark.parametrize(
    "statement", ["DELETE FROM meta WHERE key = 'fingerprint'", "UPDATE records SET sha256 = ''"]
)
def test_an_invalid_study_is_refused_with_a_remedy(studied, tdint, statement):
    before = written(studied / "out")
    sql(statement)
    result = tdint(*STUDY[:-1], code=6)
    assert len(result.stderr.splitlines()) == 1
    assert "not a valid campaign store" in result.stderr and "--overwrite" in result.stderr
    tdint(*STUDY[:-1], "--overwrite", code=0)
    assert written(studied / "out")["ida.csv"] == before["ida.csv"]
    assert written(studied / "out")["capacities.csv"] == before["capacities.csv"]


@pytest.mark.long
def test_a_study_does_not_replace_figures_of_other_commands(studied, tdint, drawn):
    """A figure of another command is not replaced, also in another directory; the figure of the
    study is replaced without --overwrite. tests/cli/test_files.py tests tables."""
    call = (*STUDY[:-1], "--plot=elsewhere.png")
    (studied / "elsewhere.png").write_bytes(b"mine")
    tdint(*call, code=6)
    assert (studied / "elsewhere.png").read_bytes() == b"mine"
    tdint(*call, "--overwrite", code=0)
    tdint(*call, code=0)


def test_a_study_in_other_units_and_back(studied, tdint):
    """The unit of the intensities is in a column, which changes with the values. The store is
    independent of output units."""
    names = ("ida.csv", "capacities.csv")
    si = [rows(studied / "out" / name) for name in names]
    messages = tdint(*STUDY[:-1], "--output-units", "kip,in,g", code=0).stderr
    assert "nothing to do" in messages and " g, 16 and 84 %" in messages and "m/s^2" not in messages
    about = json.loads((studied / "out" / "ida.json").read_text())
    for table, name in zip(si, names, strict=True):
        for row, us in zip(table, rows(studied / "out" / name), strict=True):
            assert (row.pop("unit"), us.pop("unit")) == ("m/s^2", "g")
            for key, cell in us.items():
                if key in ("im", "capacity", "lower", "upper", "peak_absolute_acceleration_g"):
                    other = row[key.replace("_g", "_m_s2")]
                    assert bool(cell) == bool(other)
                    assert not cell or float(cell) * 9.80665 == pytest.approx(
                        float(other), rel=1e-11
                    )
                else:
                    assert cell == row[key]
    columns = about["columns"]
    assert columns["capacity"]["unit"] == columns["peak_absolute_acceleration_g"]["unit"] == "g"
    assert "pga_g" in about["records"][0] and about["settings"]["output_units"] == "kip,in,kg,g"
    assert "m/s^2" in tdint(*STUDY[:-1]).stderr
    assert [rows(studied / "out" / name)[0]["unit"] for name in names] == ["m/s^2"] * 2


def test_another_study_requires_another_directory_or_overwrite(studied, tdint):
    arguments = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "--precision", "20%", "-o", "out")
    arguments += ("--pair-demand", "separate")
    result = tdint.refused("precision: 0.05 ... store, 0.2", *arguments, code=6)
    assert "record other.mseed HNE: only in the store" in result.stderr
    tdint(*arguments, "--overwrite", code=0)
    assert len(rows(studied / "out" / "capacities.csv")) == 8


def test_a_bad_record_is_reported_and_the_others_run(folder, tdint):
    result = tdint(
        "ida", FRAME, "motion.mseed", "none.mseed", "--component", "HNE", *FEW, "-o", "kept", code=4
    )
    (low, collapse) = rows(folder / "kept/capacities.csv")
    assert (low["censored"], collapse["censored"], collapse["capacity"]) == ("false", "true", "1.2")
    assert "none.mseed" in result.stderr and "1 of 1 censored" in result.stderr
    unused = json.loads((folder / "kept/ida.json").read_text())["not_used"]["records"]
    assert unused["count"] == 1 and "none.mseed" in unused["reasons"][0]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--max-im", "3"), 2, "'3' ... unit of"),
        (("--max-im", "30cm/s"), 2, "--max-im 30cm/s: wrong unit for sa("),
        (("--im", "d5-95"), 2, "d5-95: ... levels"),
        (("--im", "pgv", "--max-im", "3g"), 2, "--max-im 3g: wrong unit for pgv"),
        (("--threshold", "20%"), 2, "threshold 0.2: ... collapse drift, 0.1"),
        (("--period", "T2"), 2, "'T2' is not a valid float"),
        (("--method", "central-difference", "--dt", "1"), 5, "unstable"),
        (("--plot",), 2, "--plot without a file name"),
    ],
)
def test_invalid_studies_are_refused(folder, tdint, arguments, code, message):
    tdint.refused(message, "ida", "shaken.yaml", "other.mseed", *UNITS, *arguments, code=code)


def test_runs_without_a_result_are_reported(folder, tdint, monkeypatch):
    """If runs fail near the collapse, they are not used for a capacity, and the imprecise capacity
    is reported."""
    original = Batch.results

    def results(self, runs):
        rows = original(self, runs)
        if rows.runs[0].status == "collapsed" and runs[0].scale < 30.0:
            rows.runs[0] = rows.runs[0].changed(
                status="not-converged", peak_drift_ratio=None, energy_error=None
            )
        return rows

    monkeypatch.setattr(Batch, "results", results)
    result = tdint("ida shaken.yaml motion.mseed --component HNE", *UNITS, "-o", "out", code=0)
    assert "runs have no result" in result.stderr
    assert "1 of 1 capacities" in result.stderr
    found = rows(folder / "out" / "ida.csv")
    assert all(
        (row["status"] == "not-converged") == (row["peak_drift_ratio"] == "") for row in found
    )


def test_pairs(folder, tdint):
    choice = ("--pairs", "rotd50", "--pair-demand", "separate")
    result = tdint("ida", FRAME, "motion.mseed", *FEW, *choice, code=0)
    assert {(row["component"], row["im_name"]) for row in rows(result.stdout)} == {
        (component, "rotd50-sa(1.09504)") for component in ("HNE", "HNN")
    }


def test_collapse_margin(folder, tdint):
    """The margin counts components. It follows from the scale factors at collapse divided by the
    normalization, in the table of the runs."""
    design = "smt=0.05g,ductility=3,sdc=B,dr=good,td=good,mdl=good"
    call = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "--period", 0.5)
    result = tdint(*call, "--p695", design, "-o", "out", "--report", "page.html", code=0)
    (margin,) = rows("out/margin.csv")
    # One pair: the normalization is 1, and value n/2 of two components is the smaller factor.
    factors = []
    for component in ("HNE", "HNN"):
        levels = [row for row in rows("out/ida.csv") if row["component"] == component]
        fell = min(float(row["scale"]) for row in levels if row["status"] == "collapsed")
        stood = [float(row["scale"]) for row in levels if row["status"] == "done"]
        factors.append((fell * max(scale for scale in stood if scale < fell)) ** 0.5)
    assert float(margin["factor"]) == pytest.approx(min(factors), rel=1e-9)
    alone = tdint("spectrum", "motion.mseed", *UNITS, "--period", 0.5, "--damping", "5%", code=0)
    sa = [float(row["psa_m_s2"]) for row in rows(alone.stdout)]
    assert float(margin["s_ct_m_s2"]) == pytest.approx(sum(sa) / 2.0 * min(factors), rel=1e-6)
    assert float(margin["cmr"]) == pytest.approx(
        float(margin["s_ct_m_s2"]) / (0.05 * 9.80665), rel=1e-9
    )
    assert margin["components"] == "2"
    assert "ACMR" in result.stderr and "far-field set has 44" in result.stderr
    assert "CMR is not multiplied by 1.2" in (folder / "page.html").read_text("utf-8")
    refused = tdint(*call, "--component", "HNE", "--p695", design, code=2).stderr
    assert "this component has no partner" in refused
    tdint.refused("without --im sa", *call[:-2], "--im", "pga", "--p695", design)
