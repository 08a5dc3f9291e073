"""Floor spectra and floor motions of a run: as exact as those of a record, and the same by two
routes."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest

from csv_rows import rows
from tdint.ground_motion.reading.read import read_record
from tdint.ground_motion.record import Record, to_mseed


def written(name):
    return rows(Path("out") / name)


@pytest.fixture
def run(folder, tdint):
    """What runs shaken.yaml into the folder `out`."""
    return functools.partial(tdint, "run", "shaken.yaml", "-o", "out")


def test_floor_spectra_equal_spectra_of_the_exported_motions(run, tdint, drawn):
    """By the file, to 1e-9: the table's digits. A rigid oscillator feels the largest of the
    history's samples (peaks of stories.csv lie between them, too). Stations say the floors."""
    options = ("--floor-damping", "2%,5%", "--floor-period", "0,0.05,0.5")
    run(
        "--floor-spectra",
        "1,roof",
        *options,
        "--export-floors",
        "mseed",
        "--history",
        "--plot",
        code=0,
    )
    assert Path("out/floor-spectra.png").stat().st_size > 10_000
    ours = written("floor-spectra.csv")
    cases = [("1", "0.02"), ("1", "0.05"), ("2", "0.02"), ("2", "0.05")]
    assert [(row["floor"], row["damping"]) for row in ours[::3]] == cases
    exported = tdint(
        "spectrum", "out/floors.mseed", *(word.replace("--floor-", "--") for word in options)
    )
    assert "assumed" not in exported.stderr  # the file says its units
    theirs = rows(exported.stdout)
    assert [row["component"] for row in theirs] == ["F01"] * 6 + ["F02"] * 6 and len(ours) == 12
    for row, other in zip(ours, theirs, strict=True):
        for name in ("damping", "period_s", "sd_m", "psv_m_s", "psa_m_s2", "sv_m_s", "sa_m_s2"):
            assert math.isclose(float(row[name]), float(other[name]), rel_tol=1e-9, abs_tol=1e-12)
    told = rows(tdint("info", "out/floors.mseed").stdout)
    assert [row["id"] for row in told] == [".F01.SI.HNE", ".F02.SI.HNE"]
    history = written("history.csv")
    for floor, rigid, info in ((1, ours[0], told[0]), (2, ours[6], told[1])):
        column = [row[f"floor_{floor}_absolute_acceleration_m_s2"].lstrip("-") for row in history]
        assert rigid["sa_m_s2"] == info["pga_m_s2"] == max(column, key=float)
    (chosen,) = rows(tdint("info", "out/floors.mseed", "--component", "f02").stdout)
    assert chosen["pga_m_s2"] == told[1]["pga_m_s2"]
    tdint("info", "out/floors.mseed", "--units", "g", code=4)


def test_a_sampling_interval_that_miniseed_cannot_store_is_reported(tmp_path):
    samples = np.sin(np.arange(50.0))
    for dt, told in ((0.01, False), (1.0 / 120.0, False), (0.0123456789, True)):
        content, notes = to_mseed([Record(samples, dt, "", ".F01..HNX", "HNX", "floor 1")])
        assert bool(notes) is told
        (tmp_path / "floor.mseed").write_bytes(content)
        record = read_record(tmp_path / "floor.mseed", units="m/s^2")
        np.testing.assert_array_equal(record.acceleration, samples)
        assert record.dt == pytest.approx(dt, rel=1e-7 if told else 1e-12)
        assert record.start == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--floor-spectra", "3", "-o", "out"],
            "floor '3' not found; ... 1 to 2",
        ),
        (["--floor-spectra", "top", "-o", "out"], "floor 'top' not found"),
        (["--floor-spectra", "roof"], "--floor-spectra requires -o DIR"),
        (["--export-floors", "mseed"], "--export-floors requires -o DIR"),
    ],
)
def test_usage_errors(folder, tdint, arguments, message):
    tdint.refused(message, "run", "shaken.yaml", *arguments)


def test_floor_spectra_of_several_runs_have_their_mean_and_envelope(run, tdint, drawn):
    """Each run's spectra are those of a single call; of a pair the larger component counts at each
    period."""
    options = ("--floor-spectra", "1,roof", "--floor-period", "0.05,0.3", "--units", "m/s^2")
    run("other.mseed", "motion.mseed", *options, "--plot", code=0)
    every, means = written("floor-spectra.csv"), written("floor-spectra-mean.csv")
    assert (Path("out") / "floor-spectra.png").stat().st_size > 10_000
    alone = {}
    for record, component in (
        ("motion.mseed", "HNE"),
        ("motion.mseed", "HNN"),
        ("other.mseed", "HNE"),
    ):
        folder = f"{record}-{component}"
        tdint("run", "shaken.yaml", record, "--component", component, *options, "-o", folder)
        ours = [row for row in every if (row["record"], row["component"]) == (record, component)]
        theirs = rows(Path(folder) / "floor-spectra.csv")
        assert [{name: row[name] for name in theirs[0]} for row in ours] == theirs
        alone[record, component] = [float(row["psa_m_s2"]) for row in theirs]
    pair = np.maximum(alone["motion.mseed", "HNE"], alone["motion.mseed", "HNN"])
    other = np.array(alone["other.mseed", "HNE"])
    assert [row["runs"] for row in means] == ["2"] * 4
    assert [float(row["mean_psa_m_s2"]) for row in means] == pytest.approx(
        (pair + other) / 2.0, rel=1e-10
    )
    assert [float(row["max_psa_m_s2"]) for row in means] == pytest.approx(
        np.maximum(pair, other), rel=1e-10
    )
