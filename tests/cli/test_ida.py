"""`tdint ida`: what it writes, how it goes on, what it refuses."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from csv_rows import rows
from tdint.campaign.batch import Batch
from tdint.campaign.ida import STORE
from tdint.campaign.store_schema import LOCK

CONFIGS = Path(__file__).parents[2] / "configs"
FRAME = CONFIGS / "collapse-prone-frame.yaml"
UNITS = ("--units", "m/s^2")
FEW = (*UNITS, "--max-im", "1.2m/s^2", "--threshold", "0.2%")


_STUDIES: list[dict[str, bytes]] = []


STUDY = ("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out", "--plot")


@pytest.fixture
def studied(folder, tdint):
    """The folder with an incremental dynamic analysis in `out`, made for the first test that asks for it."""
    if not _STUDIES:
        tdint(*STUDY, "--jobs", 2, code=0)
        _STUDIES.append({path.name: path.read_bytes() for path in (folder / "out").iterdir()})
    (folder / "out").mkdir(exist_ok=True)
    for name, data in _STUDIES[0].items():
        (folder / "out" / name).write_bytes(data)
    return folder


def test_an_ida_with_the_errors_of_its_runs(folder, tdint):
    """Beside each demand, of a collapse, too; the runs, and what follows, are the same. The errors are kept, too."""
    call = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "--component", "HNN", "--method", "moment4")
    plain, checked = tdint(*call, "-o", "plain"), tdint(*call, "--check", "-o", "out")
    assert plain.exit_code == checked.exit_code == 0, checked.output
    one, other = (rows(folder / name / "ida.csv") for name in ("plain", "out"))
    demands = ("peak_drift_ratio", "peak_absolute_acceleration_m_s2", "residual_drift_ratio")
    assert list(other[0]) == [*one[0], *(f"{name}_error" for name in demands), *(f"corrected_{one}" for one in demands)]
    assert [{name: row[name] for name in one[0]} for row in other] == one
    for row in other:
        assert all(float(row[f"{name}_error"]) >= 0.0 for name in demands)
    assert {"done", "collapsed"} <= {row["status"] for row in other}
    assert (folder / "plain" / "capacities.csv").read_bytes() == (folder / "out" / "capacities.csv").read_bytes()
    about = json.loads((folder / "out" / "ida.json").read_text())
    assert about["settings"]["check"] is True and "peak_drift_ratio_error" in about["columns"]
    again = tdint(*call, "--check", "-o", "out")
    assert "nothing to do" in again.stderr and rows(folder / "out" / "ida.csv") == other
    assert tdint(*call, "-o", "out").exit_code == 2  # another study


def test_a_study_and_its_files(studied):
    names = {"ida.csv", "capacities.csv", "ida.json", "ida.png", STORE, LOCK}
    assert {path.name for path in (studied / "out").iterdir()} == names
    runs, capacities = (rows(studied / "out" / f"{name}.csv") for name in ("ida", "capacities"))
    names = list(dict.fromkeys((row["record"], row["component"]) for row in runs))
    assert names == [("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE")]
    for name in names:
        own = [row for row in runs if (row["record"], row["component"]) == name]
        assert [int(row["level"]) for row in own] == list(range(1, len(own) + 1))
        stable = [float(row["im"]) for row in own if row["status"] == "done"]
        collapsed = [float(row["im"]) for row in own if row["status"] == "collapsed"]
        found = [row for row in capacities if (row["record"], row["component"]) == name]
        assert [row["threshold"] for row in found] == ["0.01", "0.02", "0.04", "0.1"]
        assert float(found[-1]["upper"]) == min(collapsed)
        assert float(found[-1]["lower"]) == max(im for im in stable if im < min(collapsed))
        assert float(found[-1]["upper"]) / float(found[-1]["lower"]) <= 1.05 + 1e-9
        assert {row["censored"] for row in found} == {"false"}
    summary = json.loads((studied / "out" / "ida.json").read_text())
    assert summary["settings"]["collapse_drift"] == 0.1
    assert summary["columns"]["capacity"]["unit"] == "m/s^2"


def test_the_same_call_again_has_nothing_to_do(studied, tdint):
    before = {path: path.read_bytes() for path in (studied / "out").iterdir()}
    result = tdint(*STUDY, code=0)
    assert "nothing to do: all records were done" in result.stderr
    assert {path: path.read_bytes() for path in (studied / "out").iterdir()} == before


def test_an_interrupted_study_gives_the_same_bytes(studied, tdint):
    out = studied / "out"
    before = {name: (out / name).read_bytes() for name in ("ida.csv", "capacities.csv", "ida.json")}
    for name in before:
        (out / name).unlink()
    sql("DELETE FROM run_rows WHERE chunk > 0", "DELETE FROM chunks WHERE id > 0")
    result = tdint(*STUDY)
    assert "1 of 3 records were done before" in result.stderr
    assert {name: (out / name).read_bytes() for name in before} == before


def sql(*statements):
    with closing(sqlite3.connect(f"out/{STORE}")) as connection, connection:
        for statement in statements:
            connection.execute(statement)


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM run_rows WHERE chunk = 1 AND scale > 1",
        "UPDATE run_rows SET status = 'done'",
        "UPDATE run_rows SET scale = 1.001 * scale",
        "UPDATE chunks SET runs = 1e9",
    ],
)
def test_runs_of_a_study_that_are_not_as_they_were_written_are_done_again(studied, tdint, statement):
    before = {path.name: path.read_bytes() for path in (studied / "out").iterdir() if path.suffix != ".sqlite"}
    sql(statement)
    result = tdint(*STUDY)
    assert (result.exit_code, "they are done again" in result.stderr) == (0, True), result.stderr
    assert {name: (studied / "out" / name).read_bytes() for name in before} == before


@pytest.mark.parametrize("statement", ["DELETE FROM meta WHERE key = 'fingerprint'", "UPDATE records SET sha256 = ''"])
def test_a_study_that_cannot_be_trusted_is_refused_with_a_way_out(studied, tdint, statement):
    tables = [studied / "out" / name for name in ("ida.csv", "capacities.csv")]
    before = [file.read_bytes() for file in tables]
    sql(statement)
    call = ("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out")
    result = tdint(*call)
    assert (result.exit_code, len(result.stderr.splitlines())) == (6, 1), result.stderr
    assert "cannot be trusted" in result.stderr and "--overwrite" in result.stderr
    assert tdint(*call, "--overwrite").exit_code == 0
    assert [file.read_bytes() for file in tables] == before


def test_a_study_replaces_no_picture_of_others(studied, tdint):
    """Nor one that lies elsewhere; its own it replaces without being told. Tables: tests/cli/test_files.py."""
    call = ("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out", "--plot=elsewhere.png")
    (studied / "elsewhere.png").write_bytes(b"mine")
    result = tdint(*call)
    assert (result.exit_code, (studied / "elsewhere.png").read_bytes()) == (6, b"mine"), result.stderr
    assert tdint(*call, "--overwrite").exit_code == 0
    assert tdint(*call).exit_code == 0


def test_a_study_in_other_units_and_back(folder, tdint):
    """The units of intensities stand in a column: it changes with the numbers; the store knows nothing of them."""
    study = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "-o", "out", "--jobs", 1)
    first = tdint(*study, "--output-units", "kip,in,g", code=0)
    names = ("ida.csv", "capacities.csv")
    us = [rows(folder / "out" / name) for name in names]
    told = json.loads((folder / "out" / "ida.json").read_text())
    fitted = rows(tdint("fragility", "out").stdout)
    again = tdint(*study)
    assert "nothing to do" in again.stderr and "m/s^2" in again.stderr
    assert " g, 16 and 84 %" in first.stderr and "m/s^2" not in first.stderr
    for table, name in zip(us, names, strict=True):
        for row, si in zip(table, rows(folder / "out" / name), strict=True):
            assert (row.pop("unit"), si.pop("unit")) == ("g", "m/s^2")
            for key, cell in row.items():
                if key in ("im", "capacity", "lower", "upper", "peak_absolute_acceleration_g"):
                    other = si[key.replace("_g", "_m_s2")]
                    assert bool(cell) == bool(other)
                    assert not cell or float(cell) * 9.80665 == pytest.approx(float(other), rel=1e-11)
                else:
                    assert cell == si[key]
    assert told["columns"]["capacity"]["unit"] == told["columns"]["peak_absolute_acceleration_g"]["unit"] == "g"
    assert "pga_g" in told["records"][0] and told["settings"]["output_units"] == "kip,in,kg,g"
    assert all(row["unit"] == "g" for row in fitted)


def test_another_study_needs_another_folder_or_overwrite(studied, tdint):
    arguments = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "--precision", "20%", "-o", "out")
    result = tdint.refused("setting precision: 0.05 in the store, 0.2 in this study", *arguments)
    assert "record other.mseed HNE: in the store alone" in result.stderr
    assert tdint(*arguments, "--overwrite").exit_code == 0
    assert len(rows(studied / "out" / "capacities.csv")) == 8


def test_a_bad_record_is_named_and_the_others_are_done(folder, tdint):
    result = tdint("ida", FRAME, "motion.mseed", "none.mseed", "--component", "HNE", *FEW, code=4)
    (low, collapse) = rows(result.stdout)
    assert (low["censored"], collapse["censored"], collapse["capacity"]) == ("false", "true", "1.2")
    assert "none.mseed" in result.stderr
    assert "1 of 1 censored" in result.stderr
    tdint("ida", FRAME, "motion.mseed", "none.mseed", "--component", "HNE", *FEW, "-o", "kept", code=4)
    unused = json.loads((folder / "kept/ida.json").read_text())["not_used"]["records"]
    assert unused["count"] == 1 and "none.mseed" in unused["reasons"][0]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--im", "pga", "--period", 1), 2, "--period has nothing to act on without --im sa or sa-avg"),
        (("--average", "0.2:3:5"), 2, "--average has nothing to act on without --im sa-avg"),
        (("--max-im", "3"), 2, "'3': write a number with its unit"),
        (("--max-im", "30cm/s"), 2, "--max-im 30cm/s: sa("),
        (("--im", "d5-95"), 2, "d5-95: a duration does not change with a factor; there are no levels of it"),
        (("--im", "pgv", "--max-im", "3g"), 2, "--max-im 3g: pgv is in m/s"),
        (("--threshold", "20%"), 2, "threshold 0.2: a drift ratio above 0 and at most the collapse drift, 0.1"),
        (("--period", "T2"), 2, "'T2' is not a valid float"),
        (("--method", "central-difference", "--dt", "1"), 5, "unstable"),
        (("--plot",), 2, "--plot alone"),
    ],
)
def test_studies_that_are_refused(folder, tdint, arguments, code, message):
    tdint.refused(message, "ida", "shaken.yaml", "other.mseed", *UNITS, *arguments, code=code)


def test_what_has_no_result_is_told(folder, tdint, monkeypatch):
    """Runs that fail around the collapse: no number is made of them, and the wide bracket is told."""
    original = Batch.results

    def results(self, runs):
        rows = original(self, runs)
        if rows.runs[0].status == "collapsed" and runs[0].scale < 30.0:
            rows.runs[0] = rows.runs[0].but(status="not-converged", peak_drift_ratio=None, energy_error=None)
        return rows

    monkeypatch.setattr(Batch, "results", results)
    result = tdint("ida", "shaken.yaml", "motion.mseed", "--component", "HNE", *UNITS, "-o", "out", code=0)
    assert "runs have no result, also with a finer step; they count neither way" in result.stderr
    assert "1 of 1 capacities are bracketed less closely than 5 %" in result.stderr
    found = rows(folder / "out" / "ida.csv")
    assert all((row["status"] == "not-converged") == (row["peak_drift_ratio"] == "") for row in found)


def test_a_model_without_heights(folder, tdint):
    tdint.refused("give story 1 a height", "ida", CONFIGS / "stiff-soft-node.yaml", "other.mseed", *UNITS, code=3)


def test_every_measure(folder, tdint):
    """Levels go with a power of the factor; where the building collapses is the same in all of them."""
    fell = []
    for im, power in {"pga": 1, "pgv": 1, "sa-avg": 1, "arias": 2, "cav": 1}.items():
        call = ("ida", FRAME, "other.mseed", *UNITS, "--im", im, "--precision", "20%", "--threshold", "5%")
        tdint(*call, "-o", im, code=0)
        found = rows(folder / im / "ida.csv")
        assert found[0]["im_name"].startswith(im)
        ratios = [float(row["im"]) / float(row["scale"]) ** power for row in found]
        assert ratios == pytest.approx([ratios[0]] * len(found), rel=1e-10)
        fell.append(min(float(row["scale"]) for row in found if row["status"] == "collapsed"))
    assert fell == pytest.approx([fell[0]] * 5, rel=0.2)


def test_pairs(folder, tdint):
    result = tdint("ida", FRAME, "motion.mseed", *FEW, "--pairs", "rotd50", code=0)
    assert {(row["component"], row["im_name"]) for row in rows(result.stdout)} == {
        ("HNE", "rotd50-sa(1.09504)"),
        ("HNN", "rotd50-sa(1.09504)"),
    }
