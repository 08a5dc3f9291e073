"""`tdint drift-spectrum`: rows, files, figure, and usage errors."""

import json

import pytest

from csv_rows import rows

PERIODS = ("--period", "0.5", "--period", "2")


def test_building_options_select_stories_height_and_beam(folder, tdint):
    tables = []
    for options in (["--stories", "1"], ["--height-period", "0.1,1"], ["--beam"]):
        arguments = ("--period", "1", *options, "-o", "x.csv", "--plot", "--overwrite")
        tdint("drift-spectrum", "other.mseed", *arguments, code=0)
        tables += rows(folder / "x.csv")
    single, low, beam = tables
    assert single["story"] == "1" and single["peak_drift_ratio"] == single["roof_drift_ratio"]
    assert float(low["height_m"]) == pytest.approx(10.0)
    assert beam["story"] == "" and float(beam["peak_drift_ratio"]) > float(beam["roof_drift_ratio"])
    assert (folder / "x.png").exists()


def test_the_summary_lists_the_settings_and_the_figure_is_written(folder, tdint, drawn):
    tdint("drift-spectrum", "motion.mseed", *PERIODS, "-o", "out/", "--plot", code=0)
    assert (folder / "out" / "motion.png").read_bytes().startswith(b"\x89PNG")
    settings = json.loads((folder / "out" / "motion.json").read_text())["settings"]
    buildings = {
        "stories": None,
        "story_height": 3.5,
        "height_period": "0.0731,0.75",
        "beam": False,
    }
    assert {"damping": [0.05], "periods": [0.5, 2.0], **buildings}.items() <= settings.items()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--periods", "0.1:1"], "neither FIRST:LAST:COUNT"),
        (["--period", "0"], "--period"),
        (["--period", "100"], "stories ... 1 to 1000, got 4339"),
        (["--stories", "0"], "--stories"),
        (["--stories", "1001"], "from 1 to 1000, got 1001"),
        (["--stories", "3", "--story-height", "3"], "--stories cannot be used with --story-height"),
        (["--story-height", "nan"], "--story-height"),
        (["--beam", "--stories", "3"], "--beam has no stories"),
        (["--height-period", "0.07"], "0.0731,0.75, got '0.07'"),
        (["--damping", "1"], "--damping"),
        (["--plot"], "--plot without a file name requires -o; add -o"),
        (["-", "-"], "standard input (-) can be read only once"),
    ],
)
def test_usage_errors(folder, tdint, arguments, message):
    tdint.refused(message, "drift-spectrum", "other.mseed", *arguments)
