"""Campaigns of sequences of events; the rows are compared with single runs of the sequences."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import tdint as library
from cli.conftest import Command, change, copy_of, made_once, write_folder
from csv_rows import rows
from tdint.response.runs.demands import demands
from tdint.response.runs.sequence import run_sequence

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


FRAME = """\
name: frame
stories:
  - {repeat: 2, mass: 10, height: 3, stiffness: 8000, law: {type: bilinear, yield_force: 50, hardening: 0.1}}
damping: {rayleigh: {ratio: 0.05, modes: [1, 2]}}
analysis: {method: newmark-average}
"""  # noqa: E501
RECORDS = (
    "ida", "frame.yaml", "motion.mseed", "other.mseed", "--units", "m/s^2",
    "--precision", "10%", "--pair-demand", "separate",
)  # fmt: skip
AFTERSHOCKS = (*RECORDS, "--after", "other.mseed")


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Directory `out` of the completed campaign study.yaml, with sequences of two and three events,
    and a frame without a ground motion."""

    def make(folder):
        write_folder(folder)
        files = {"study.yaml": CAMPAIGN, "pairs.csv": PAIRS, "frame.yaml": FRAME}
        for name, text in files.items():
            Path(name).write_text(text)
        Command()("campaign", "study.yaml", "-o", "out", code=0)

    return made_once(tmp_path_factory, make)


study = copy_of("done")


@pytest.mark.usefixtures("study")
def test_rows_equal_single_runs_of_the_sequence():
    runs, shocks = rows("out/runs.csv"), rows("out/shocks.csv")
    assert [row["record"] for row in runs] == ["once more", "once more", "three", "three"]
    assert [row["shock"] for row in shocks] == ["1", "2"] * 2 + ["1", "2", "3"] * 2
    model = library.load_model("shaken.yaml")
    other, north = (
        library.read_record(f"{name}.mseed", component=component, units="m/s^2")
        for name, component in (("other", "HNE"), ("motion", "HNN"))
    )
    three = [other, north.scaled(1.5), other.scaled(-1)]
    case = library.prepare(model, three[0], method="newmark-average")
    for row, scale in zip(runs[2:], (0.5, 1.5), strict=True):
        found = run_sequence(case, [record.scaled(scale) for record in three])
        peaks = demands(found.stories)
        assert float(row["scale"]) == scale
        assert float(row["peak_drift_m"]) == pytest.approx(peaks.drift.value, rel=1e-11)
        assert float(row["residual_drift_ratio"]) == pytest.approx(
            peaks.residual_drift_ratio.value, rel=1e-11
        )
        assert float(row["pga_m_s2"]) == pytest.approx(
            max(shock.record.pga for shock in found.events)
        )
        parts = [
            part for part in shocks if part["record"] == "three" and float(part["scale"]) == scale
        ]
        for part, shock in zip(parts, found.events, strict=True):
            assert float(part["start_s"]) == pytest.approx(shock.start)
            assert float(part["pga_m_s2"]) == pytest.approx(shock.record.pga)
            assert float(part["peak_drift_m"]) == pytest.approx(
                demands(shock.stories).drift.value, rel=1e-11
            )


def test_specified_rest_and_levels_of_the_first_event(study, tdint):
    change(
        "study.yaml",
        ("pairs.csv,", "pairs.csv, rest: 7,"),
        ("scales: [0.5, 1.5]", "measure: pga, levels: [2 m/s^2]"),
    )
    tdint("campaign", "study.yaml", "-o", "new", code=0)
    shocks = rows("new/shocks.csv")
    assert [float(row["start_s"]) for row in shocks if row["record"] == "three"] == pytest.approx(
        [0.0, 9.99, 19.98]
    )
    assert [float(row["pga_m_s2"]) for row in shocks if row["shock"] == "1"] == pytest.approx(
        [2.0, 2.0]
    )


def test_a_changed_event_in_the_store_is_run_again(study, tdint):
    before = Path("out/shocks.csv").read_bytes()
    with closing(sqlite3.connect("out/campaign.sqlite")) as connection, connection:
        connection.execute("UPDATE shock_rows SET peak_drift_m = 1 WHERE shock = 2")
    assert "run again" in tdint("campaign", "study.yaml", "-o", "out", code=0).stderr
    assert Path("out/shocks.csv").read_bytes() == before


def test_an_unreadable_sequence_is_reported_and_the_others_run(study, tdint):
    change("pairs.csv", ("three,motion.mseed,HNN", "three,none.mseed,HNN"))
    result = tdint("campaign", "study.yaml", "-o", "new", code=4)
    assert "sequence three" in result.stderr and "none.mseed" in result.stderr
    assert {row["record"] for row in rows("new/runs.csv")} == {"once more"}


@pytest.mark.parametrize(
    ("file", "before", "after", "text"),
    [
        ("study.yaml", "pairs.csv,", "pairs.csv, pairs: true,",
         "pairs: cannot be used with `sequences`"),
        ("study.yaml", "pairs.csv,", "pairs.csv, neighbors: 4,",
         "neighbors: can only be used with a `grid`"),
        ("study.yaml", "sequences: pairs.csv", "files: [motion.mseed], rest: 3",
         "rest: can only be used with `sequences`"),
        ("study.yaml", "pairs.csv,", "pairs.csv, rest: -1,", "rest"),
        ("study.yaml", "newmark-average", "newmark-average, duration: 3",
         "duration: cannot be used with `sequences`"),
        ("pairs.csv", "HNE,0.5", "HNE,0", "pairs.csv:3: factor"),
        ("pairs.csv", "HNE,0.5", "HNE,much", "pairs.csv:3: factor"),
        ("pairs.csv", "sequence,record", "sequence,file", "no column record"),
        ("pairs.csv", "once more,other", ",other", "sequence is missing"),
    ],
)  # fmt: skip
def test_errors_of_the_files_are_reported(study, tdint, file, before, after, text):
    change(file, (before, after))
    tdint.refused(text, "campaign", "study.yaml", "-o", "new", code=3)


def test_without_a_component_each_common_component_is_a_ground_motion(study, tdint):
    (study / "pairs.csv").write_text("sequence,record\ntwice,motion.mseed\ntwice,motion.mseed\n")
    tdint("campaign", "study.yaml", "-o", "new", code=0)
    assert [row["component"] for row in rows("new/runs.csv")] == ["HNE", "HNE", "HNN", "HNN"]
    assert all(float(row["peak_drift_m"]) > 0.0 for row in rows("new/shocks.csv"))
    (study / "pairs.csv").write_text("sequence,record\nodd,motion.mseed\nodd,other.mseed\n")
    assert "different components" in tdint("campaign", "study.yaml", "-o", "other", code=4).stderr


@pytest.mark.usefixtures("study")
@pytest.mark.long
def test_aftershocks_start_from_the_building_damaged_by_the_main_shock(tdint):
    tdint(*AFTERSHOCKS, "--damage", "2%", "-o", "ida", "--threshold", "0.1%,5%", "--plot", code=0)
    table, intact = rows("ida/capacities.csv"), rows("ida/capacities.csv")[:9]
    assert [row["damage"] for row in table] == ["0"] * 9 + ["0.02"] * 9
    tdint(*RECORDS, "-o", "alone", "--threshold", "0.1%,5%", code=0)
    plain = [{key: row[key] for key in row if key != "damage"} for row in intact]
    assert plain == rows("alone/capacities.csv")
    # A damaged building reaches a drift sooner.
    sooner = [
        float(later["capacity"]) < float(row["capacity"])
        for row, later in zip(intact, table[9:], strict=True)
        if row["threshold"] == "0.001"
    ]
    assert sooner == [True] * 3

    # The results of a level equal a run of the sequence with separately computed scale factors.
    level = next(
        row for row in rows("ida/ida.csv") if row["damage"] == "0.02" and row["status"] == "done"
    )
    model = library.load_model("frame.yaml")
    main = library.read_record("other.mseed", component="HNE", units="m/s^2")
    record = library.read_record(level["record"], component=level["component"], units="m/s^2")
    case = library.prepare(model, main, method="newmark-average")

    def reached(factor: float) -> float:
        return demands(
            library.run(model, main.scaled(factor), method="newmark-average").stories
        ).drift_ratio.value

    low, high = 0.0, 1.0
    while reached(high) < 0.02:
        high *= 1.1
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reached(middle) < 0.02 else (low, middle)
    found = run_sequence(case, [main.scaled(high), record.scaled(float(level["scale"]))])
    assert demands(found.events[0].stories).drift_ratio.value == pytest.approx(0.02, rel=2e-4)
    drift = demands(found.events[1].stories).drift_ratio.value
    # The scale factor has a tolerance of 1e-4.
    assert float(level["peak_drift_ratio"]) == pytest.approx(drift, rel=1e-3)

    again = tdint(
        *AFTERSHOCKS, "--damage", "2%", "-o", "ida", "--threshold", "0.1%,5%", "--plot", code=0
    )
    assert "nothing to do" in again.stderr
    tdint(*AFTERSHOCKS, "--damage", "1%", "-o", "ida", "--threshold", "0.1%,5%", code=6)


def test_each_damage_level_has_its_own_fragility(folder, tdint):
    capacities = {"0": [1.0, 1.2, 1.5], "0.02": [0.5, 0.7, 0.8]}
    table = [
        f"{state},0.1,{capacity}" for state, values in capacities.items() for capacity in values
    ]
    Path("c.csv").write_text("\n".join(["damage,threshold,capacity", *table, "0.02,0.1,"]))
    result = tdint("fragility", "c.csv", "-o", "f.csv", "--plot", code=0)
    fitted = rows("f.csv")
    assert [row["damage"] for row in fitted] == ["0", "0.02"]
    for row, values in zip(fitted, capacities.values(), strict=True):
        assert float(row["theta"]) == pytest.approx(np.exp(np.mean(np.log(values))))
        assert float(row["beta"]) == pytest.approx(np.std(np.log(values), ddof=1))
    assert "damaged to 2 %, ida, median" in result.stderr


IMK = (
    "imk, yield_force: 50, plastic_drift: 0.05, post_capping_drift: 0.1, ultimate_drift: 0.06, "
    "capping_ratio: 1.1, residual_ratio: 0.1"
)


@pytest.mark.parametrize(
    ("law", "options", "code", "text"),
    [
        (
            "bilinear, yield_force: 50, hardening: 0.1",
            ("--damage", "20%"),
            2,
            "below the collapse drift",
        ),
        (IMK, ("--damage", "3%"), 5, "3 % without collapse"),
    ],
    ids=["collapse", "no damage"],
)
def test_refusals_of_aftershocks(study, tdint, law, options, code, text):
    change("frame.yaml", ("bilinear, yield_force: 50, hardening: 0.1", law))
    assert text in tdint(*AFTERSHOCKS, *options, code=code).stderr


def test_units_of_each_event(study, tdint):
    """The column `units` of the table replaces the key `units` for its rows."""
    change(
        "pairs.csv",
        ("factor\n", "factor,units\n"),
        ("HNE,0.5", "HNE,0.5,100 cm/s^2"),
        ("HNE,1\n", "HNE,1,m/s^2\n"),
    )
    tdint("campaign", "study.yaml", "-o", "rows", code=0)
    assert rows("rows/runs.csv") == rows("out/runs.csv")
    change("pairs.csv", ("100 cm/s^2", "cm/s^2"))
    tdint("campaign", "study.yaml", "-o", "small", code=0)
    small, plain = rows("small/runs.csv"), rows("out/runs.csv")
    assert small[0] != plain[0] and small[2:] == plain[2:]
