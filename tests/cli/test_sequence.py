"""`tdint run --sequence`: sequences of events."""

import json

import pytest

from csv_rows import rows

SHOCKS = ("run", "shaken.yaml", "motion.mseed", "other.mseed", "--sequence", "--component", "HNE")


def test_stories_have_rows_for_each_event_and_for_the_sequence(folder, tdint):
    result = tdint(*SHOCKS, code=0)
    table = rows(result.stdout)
    assert [(row["shock"], row["story"]) for row in table] == [
        (k, i) for k in ("1", "2", "all") for i in ("1", "2")
    ]
    first, second, complete = (table[2 * k] for k in range(3))
    assert complete["peak_drift_m"] in (first["peak_drift_m"], second["peak_drift_m"])
    assert complete["residual_drift_m"] == second["residual_drift_m"]
    single_run = rows(
        tdint("run", "shaken.yaml", "motion.mseed", "--component", "HNE", "--until-rest").stdout
    )
    # The remaining vibration is part of the error of a residual drift at the end of a run, but not
    # between the events of a sequence. Only single runs list energies.
    energies = {"hysteretic_energy_J", "hysteretic_energy_J_error"}
    assert single_run[0].keys() - first.keys() == energies
    assert {key for key in first.keys() & single_run[0] if single_run[0][key] != first[key]} <= {
        "residual_drift_m_error"
    }
    assert "motion.mseed + other.mseed HNE" in result.stderr
    assert "Event 2, from " in result.stderr


def test_the_files_of_a_sequence(folder, tdint):
    tdint(
        *SHOCKS,
        "--rest",
        3,
        "--scale",
        "1.5,0.5",
        "--check",
        "-o",
        "out",
        "--history",
        "--plot",
        code=0,
    )
    names = {"history.csv", "response.png", "stories.csv", "summary.json"}
    assert {file.name for file in (folder / "out").iterdir()} == names
    summary = json.loads((folder / "out/summary.json").read_text())
    first, second = summary["events"]
    assert second["start_s"] == pytest.approx(2.99 + 3.0)
    assert (first["record"]["scale"], second["record"]["scale"]) == (1.5, 0.5)
    assert summary["record"]["file"] == "motion.mseed + other.mseed"
    assert summary["settings"]["rest_s"] == 3.0
    assert {"start_s", "drift_ratio"} <= set(summary["meanings"])
    assert [entry["file"] for entry in summary["inputs"]] == [
        "shaken.yaml",
        "motion.mseed",
        "other.mseed",
    ]
    assert float(rows(folder / "out/history.csv")[-1]["time_s"]) == pytest.approx(2.99 + 3.0 + 2.99)
    assert all(float(row["peak_drift_m_error"]) > 0.0 for row in rows(folder / "out/stories.csv"))


def test_a_single_factor_applies_to_all_events(folder, tdint):
    common, each = (rows(tdint(*SHOCKS, "--scale", scale).stdout) for scale in ("0.5", "0.5,0.5"))
    assert common == each


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("run", "shaken.yaml", "motion.mseed", "--sequence"),
            "requires two or more records, got 1",
        ),
        ((*SHOCKS, "--rest", -1), "-1"),
        ((*SHOCKS, "--scale", "1,2,3"), "for each of 2 events, got 3 factors"),
        (("run", "shaken.yaml", "motion.mseed", "-", "--sequence"), "not standard input"),
    ],
)
def test_refusals_of_a_sequence(folder, tdint, arguments, message):
    tdint.refused(message, *arguments)


def test_an_unreadable_event_is_refused(folder, tdint):
    call = "run shaken.yaml motion.mseed none.mseed --sequence --component HNE -o out"
    tdint.refused("none.mseed", call, code=4)
