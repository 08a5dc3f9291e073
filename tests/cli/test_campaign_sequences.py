"""Campaigns of shocks one after the other: the rows are those of single runs of the sequences."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import tdint as library
from csv_rows import rows
from tdint.analysis.run.demands import demands
from tdint.analysis.run.sequence import run_sequence

CAMPAIGN = """\
name: study
buildings: {models: [shaken.yaml]}
records: {sequences: pairs.csv, units: m/s^2}
intensity: {scales: [0.5, 1.5]}
analysis: {method: newmark-average}
"""
PAIRS = """\
sequence,record,component,factor
once more,motion.mseed,HNE,1
once more,other.mseed,HNE,0.5
three,other.mseed,,
three,motion.mseed,HNN,1.5
three,other.mseed,HNE,-1
"""


@pytest.fixture
def study(folder):
    (folder / "study.yaml").write_text(CAMPAIGN)
    (folder / "pairs.csv").write_text(PAIRS)
    return folder


def test_rows_are_those_of_single_runs(study, tdint):
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    runs, shocks = rows("out/runs.csv"), rows("out/shocks.csv")
    assert [row["record"] for row in runs] == ["once more", "once more", "three", "three"]
    assert [row["shock"] for row in shocks] == ["1", "2"] * 2 + ["1", "2", "3"] * 2
    model = library.load_model("shaken.yaml")

    def read(name, component, factor):
        return library.read_record(name, component=component, units="m/s^2").scaled(factor)

    of_three = [("other.mseed", "HNE", 1.0), ("motion.mseed", "HNN", 1.5), ("other.mseed", "HNE", -1.0)]
    for row, scale in zip(runs[2:], (0.5, 1.5), strict=True):
        case = library.prepare(model, read(*of_three[0]), method="newmark-average")
        found = run_sequence(case, [read(*one).scaled(scale) for one in of_three])
        assert float(row["scale"]) == scale
        assert float(row["peak_drift_m"]) == pytest.approx(demands(found.stories).drift.value, rel=1e-11)
        assert float(row["residual_drift_ratio"]) == pytest.approx(
            demands(found.stories).residual_drift_ratio.value, rel=1e-11
        )
        parts = [one for one in shocks if one["record"] == "three" and float(one["scale"]) == scale]
        for part, shock in zip(parts, found.shocks, strict=True):
            assert float(part["start_s"]) == pytest.approx(shock.start)
            assert float(part["pga_m_s2"]) == pytest.approx(shock.record.pga)
            assert float(part["peak_drift_m"]) == pytest.approx(demands(shock.stories).drift.value, rel=1e-11)
        assert float(row["pga_m_s2"]) == pytest.approx(max(shock.record.pga for shock in found.shocks))


def test_the_same_bytes_for_any_threads_and_shards(study, tdint):
    for where, options in (("one", ()), ("two", ("--jobs", 2)), ("a", ("--shard", "1/2")), ("b", ("--shard", "2/2"))):
        assert tdint("campaign", "study.yaml", "-o", where, *options).exit_code == 0
    assert tdint("campaign", "merge", "a", "b", "-o", "both").exit_code == 0
    for name in ("runs.csv", "shocks.csv"):
        assert len({Path(where, name).read_bytes() for where in ("one", "two", "both")}) == 1
    assert "nothing to do" in tdint("campaign", "study.yaml", "-o", "one").stderr


def test_a_given_rest(study, tdint):
    (study / "study.yaml").write_text(CAMPAIGN.replace("pairs.csv,", "pairs.csv, rest: 7,"))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    starts = [float(row["start_s"]) for row in rows("out/shocks.csv") if row["record"] == "three"]
    assert starts == pytest.approx([0.0, 9.99, 19.98] * 2)


def test_levels_are_those_of_the_first_shock(study, tdint):
    text = CAMPAIGN.replace("{scales: [0.5, 1.5]}", "{measure: pga, levels: [2 m/s^2]}")
    (study / "study.yaml").write_text(text)
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    first = [float(row["pga_m_s2"]) for row in rows("out/shocks.csv") if row["shock"] == "1"]
    assert first == pytest.approx([2.0, 2.0])


def test_a_shock_that_was_changed_in_the_store_is_done_again(study, tdint):
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    before = Path("out/shocks.csv").read_bytes()
    with closing(sqlite3.connect("out/campaign.sqlite")) as connection, connection:
        connection.execute("UPDATE shock_rows SET peak_drift_m = 1 WHERE shock = 2")
    again = tdint("campaign", "study.yaml", "-o", "out")
    assert again.exit_code == 0 and "done again" in again.stderr
    assert Path("out/shocks.csv").read_bytes() == before


def test_a_sequence_that_cannot_be_read_leaves_the_others(study, tdint):
    (study / "pairs.csv").write_text(PAIRS.replace("three,motion.mseed,HNN", "three,none.mseed,HNN"))
    result = tdint("campaign", "study.yaml", "-o", "out", code=4)
    assert "sequence three" in result.stderr and "none.mseed" in result.stderr
    assert {row["record"] for row in rows("out/runs.csv")} == {"once more"}


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("pairs.csv,", "pairs.csv, pairs: true,"), "pairs: has no part in `sequences`"),
        (("pairs.csv,", "pairs.csv, neighbors: 4,"), "neighbors: belongs to a `grid`"),
        (("sequences: pairs.csv", "files: [motion.mseed], rest: 3"), "rest: belongs to `sequences`"),
        (("pairs.csv,", "pairs.csv, rest: -1,"), "rest"),
        (("newmark-average", "newmark-average, duration: 3"), "duration: is not for `sequences`"),
    ],
)
def test_faults_of_the_campaign_file(study, tdint, change, text):
    (study / "study.yaml").write_text(CAMPAIGN.replace(*change))
    tdint.refused(text, "campaign", "study.yaml", "-o", "out", code=3)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("HNE,0.5", "HNE,0"), "pairs.csv:3: factor"),
        (("HNE,0.5", "HNE,much"), "pairs.csv:3: factor"),
        (("sequence,record", "sequence,file"), "no column record"),
        (("once more,other", ",other"), "sequence is missing"),
    ],
)
def test_faults_of_the_file_of_sequences(study, tdint, change, text):
    (study / "pairs.csv").write_text(PAIRS.replace(*change))
    tdint.refused(text, "campaign", "study.yaml", "-o", "out", code=3)


def test_without_component_each_common_one_is_a_motion(study, tdint):
    (study / "pairs.csv").write_text("sequence,record\ntwice,motion.mseed\ntwice,motion.mseed\n")
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    assert [row["component"] for row in rows("out/runs.csv")] == ["HNE", "HNE", "HNN", "HNN"]
    drifts = [float(row["peak_drift_m"]) for row in rows("out/shocks.csv")]
    assert np.all(np.array(drifts) > 0.0)
    (study / "pairs.csv").write_text("sequence,record\nodd,motion.mseed\nodd,other.mseed\n")
    result = tdint("campaign", "study.yaml", "-o", "other")
    assert result.exit_code == 4 and "different components" in result.stderr


FRAME = """\
name: frame
stories:
  - {repeat: 2, mass: 10, height: 3, stiffness: 8000, law: {type: bilinear, yield_force: 50, hardening: 0.1}}
damping: {rayleigh: {ratio: 0.05, modes: [1, 2]}}
analysis: {method: newmark-average}
"""
AFTERSHOCKS = ("ida", "frame.yaml", "motion.mseed", "other.mseed", "--after", "other.mseed", "--units", "m/s^2")


def test_aftershocks_find_the_building_that_the_mainshock_has_damaged(study, tdint):
    (study / "frame.yaml").write_text(FRAME)
    tdint(*AFTERSHOCKS, "--damage", "2%", "-o", "out", "--threshold", "0.1%,5%", "--plot", code=0)
    table, intact = rows("out/capacities.csv"), rows("out/capacities.csv")[:9]
    assert [row["damage"] for row in table] == ["0"] * 9 + ["0.02"] * 9
    tdint(*AFTERSHOCKS[:4], *AFTERSHOCKS[6:], "-o", "alone", "--threshold", "0.1%,5%", code=0)
    plain = [{key: row[key] for key in row if key != "damage"} for row in intact]
    assert plain == rows("alone/capacities.csv")
    # A damaged building reaches a drift sooner.
    sooner = [
        float(later["capacity"]) < float(row["capacity"])
        for row, later in zip(intact, table[9:], strict=True)
        if row["threshold"] == "0.001"
    ]
    assert sooner == [True] * 3

    # A level is the run of the sequence put together by hand.
    level = next(row for row in rows("out/ida.csv") if row["damage"] == "0.02" and row["status"] == "done")
    model = library.load_model("frame.yaml")
    main, record = (
        library.read_record(name, component="HNE", units="m/s^2") for name in ("other.mseed", "motion.mseed")
    )
    case = library.prepare(model, main, method="newmark-average")

    def reached(factor: float) -> float:
        return demands(library.run(model, main.scaled(factor), method="newmark-average").stories).drift_ratio.value

    low, high = 0.0, 1.0
    while reached(high) < 0.02:
        high *= 1.1
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reached(middle) < 0.02 else (low, middle)
    found = run_sequence(case, [main.scaled(high), record.scaled(float(level["scale"]))])
    assert demands(found.shocks[0].stories).drift_ratio.value == pytest.approx(0.02, rel=2e-4)
    drift = demands(found.shocks[1].stories).drift_ratio.value
    assert float(level["peak_drift_ratio"]) == pytest.approx(drift, rel=1e-2)  # the scale is found to 1e-4

    again = tdint(*AFTERSHOCKS, "--damage", "2%", "-o", "out", "--threshold", "0.1%,5%", "--plot")
    assert again.exit_code == 0 and "nothing to do" in again.stderr
    tdint(*AFTERSHOCKS, "--damage", "1%", "-o", "out", "--threshold", "0.1%,5%", code=2)


def test_each_state_has_its_fragility(folder, tdint):
    of_state = {"0": [1.0, 1.2, 1.5], "0.02": [0.5, 0.7, 0.8]}
    table = [f"{state},0.1,{capacity}" for state, values in of_state.items() for capacity in values]
    Path("c.csv").write_text("\n".join(["damage,threshold,capacity", *table, "0.02,0.1,"]))
    result = tdint("fragility", "c.csv", "-o", "f.csv", "--plot", code=0)
    fitted = rows("f.csv")
    assert [row["damage"] for row in fitted] == ["0", "0.02"]
    for row, values in zip(fitted, of_state.values(), strict=True):
        assert float(row["theta"]) == pytest.approx(np.exp(np.mean(np.log(values))))
        assert float(row["beta"]) == pytest.approx(np.std(np.log(values), ddof=1))
    assert "damaged to 2 %, ida, median" in result.stderr


@pytest.mark.parametrize(
    ("options", "code", "text"),
    [(("--damage", "20%"), 2, "below the collapse drift"), ((), 2, "--after has nothing to act on without --damage")],
)
def test_refusals_of_aftershocks(study, tdint, options, code, text):
    (study / "frame.yaml").write_text(FRAME)
    result = tdint(*AFTERSHOCKS, *options, code=code)
    assert text in result.stderr


def test_a_mainshock_that_cannot_bring_the_damage(study, tdint):
    imk = "imk, yield_force: 50, plastic_drift: 0.05, post_capping_drift: 0.1, ultimate_drift: 0.06"
    imk += ", capping_ratio: 1.1, residual_ratio: 0.1"
    text = FRAME.replace("bilinear, yield_force: 50, hardening: 0.1", imk)
    (study / "frame.yaml").write_text(text)
    result = tdint(*AFTERSHOCKS, "--damage", "3%", code=5)
    assert "does not reach a drift of 3 %" in result.stderr


def test_units_of_each_shock(study, tdint):
    """A column of the table, for some rows alone, does what the key does for all."""
    assert tdint("campaign", "study.yaml", "-o", "all").exit_code == 0
    of_rows = PAIRS.replace("factor\n", "factor,units\n").replace("HNE,0.5", "HNE,0.5,100 cm/s^2")
    of_rows = of_rows.replace("HNE,1\n", "HNE,1,m/s^2\n")
    (study / "pairs.csv").write_text(of_rows)
    assert tdint("campaign", "study.yaml", "-o", "rows").exit_code == 0
    assert rows("rows/runs.csv") == rows("all/runs.csv")
    (study / "pairs.csv").write_text(of_rows.replace("100 cm/s^2", "cm/s^2"))
    assert tdint("campaign", "study.yaml", "-o", "small").exit_code == 0
    assert rows("small/runs.csv")[0] != rows("all/runs.csv")[0]
    assert rows("small/runs.csv")[2:] == rows("all/runs.csv")[2:]
