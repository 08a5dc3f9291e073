"""`tdint drift-spectrum`: rows, files, the picture, and what happens to the good records when one is bad."""

import json

import numpy as np
import pytest

from csv_rows import rows
from tdint.analysis.defaults import STORY_HEIGHT
from tdint.analysis.spectra.drift import HeightPeriod, drift_spectrum
from tdint.ground_motion.reading.read import read_record
from tdint.written_numbers import parse_grid

COLUMNS = "record,component,damping,period_s,height_m,peak_drift_ratio,story,roof_drift_ratio"
PERIODS = ("--period", "0.5", "--period", "2")


def test_every_component_damping_and_period_in_order(folder, tdint):
    options = ("--damping", "0.02", "--damping", "0.05", *PERIODS)
    result = tdint("drift-spectrum", "motion.mseed", "other.mseed", *options, code=0)
    assert result.stdout.splitlines()[0] == COLUMNS
    assert [(row["record"], row["component"], row["damping"], row["period_s"]) for row in rows(result.stdout)] == [
        (record, component, damping, period)
        for record, component in (("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE"))
        for damping in ("0.02", "0.05")
        for period in ("0.5", "2")
    ]


def test_the_defaults_are_those_of_the_library(folder, tdint):
    table = rows(tdint("drift-spectrum", "other.mseed").stdout)
    periods = parse_grid("0.2:10:200").values()
    expected = drift_spectrum(
        read_record("other.mseed"), periods, 0.05, story_height=STORY_HEIGHT, height_period=HeightPeriod()
    )
    for column, values in (
        ("period_s", periods), ("height_m", expected.heights), ("peak_drift_ratio", expected.peak_drift_ratio),
        ("story", expected.story), ("roof_drift_ratio", expected.roof_drift_ratio),
    ):  # fmt: skip
        np.testing.assert_allclose([float(row[column]) for row in table], values, rtol=5.1e-12)


def test_the_kind_of_building(folder, tdint):
    one, two, low, beam = (
        rows(tdint("drift-spectrum", "other.mseed", "--period", "1", *options).stdout)[0]
        for options in (["--stories", "1"], ["--stories", "2"], ["--height-period", "0.1,1"], ["--beam"])
    )
    assert one["story"] == "1"
    assert one["peak_drift_ratio"] == one["roof_drift_ratio"]
    assert float(two["peak_drift_ratio"]) > float(two["roof_drift_ratio"])
    assert float(low["height_m"]) == pytest.approx(10.0)
    assert beam["story"] == ""
    assert float(beam["peak_drift_ratio"]) > float(beam["roof_drift_ratio"])


def test_what_a_table_came_from_and_its_picture(folder, tdint):
    assert tdint("drift-spectrum", "motion.mseed", *PERIODS, "-o", "out/", "--plot").exit_code == 0
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["motion.csv", "motion.json", "motion.png"]
    assert (folder / "out" / "motion.png").read_bytes().startswith(b"\x89PNG")
    summary = json.loads((folder / "out" / "motion.json").read_text())
    assert summary["command"] == "drift-spectrum"
    for name, value in {
        "damping": [0.05], "periods": [0.5, 2.0], "stories": None, "story_height": 3.5, "height_period": "0.0731,0.75",
        "beam": False,
    }.items():  # fmt: skip
        assert summary["settings"][name] == value
    assert [record["component"] for record in summary["records"]] == ["HNE", "HNN"]


def test_a_picture_of_one_period(folder, tdint):
    assert tdint("drift-spectrum", "other.mseed", "--period", "1", "--beam", "-o", "x.csv", "--plot").exit_code == 0
    assert (folder / "x.png").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--periods", "0.1:1"], "neither FIRST:LAST:COUNT"),
        (["--periods", "0.1:1:5", "--period", "1"], "--periods and --period are given"),
        (["--period", "0"], "--period"),
        (["--period", "100"], "a building of 4339 stories, 15186 m high, is asked for; 1 to 1000 are taken"),
        (["--stories", "0"], "--stories"),
        (["--stories", "1001"], "a building of 1001 stories"),
        (["--stories", "3", "--story-height", "3"], "--stories and --story-height are given"),
        (["--story-height", "nan"], "--story-height"),
        (["--beam", "--stories", "3"], "--beam has no stories"),
        (["--height-period", "0.07"], "must be two positive numbers, such as 0.0731,0.75, got '0.07'"),
        (["--damping", "1"], "--damping"),
        (["--plot"], "--plot alone puts the picture beside the output: add -o"),
        (["-", "-"], "standard input (-) can be read only once"),
    ],
)
def test_usage_errors(folder, tdint, arguments, message):
    tdint.refused(message, "drift-spectrum", "other.mseed", *arguments)
