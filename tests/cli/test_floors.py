"""Floor spectra of a run equal the spectra of its exported floor motions."""

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
    """Return a function that runs shaken.yaml with the output directory `out`."""
    return functools.partial(tdint, "run", "shaken.yaml", "-o", "out")


@pytest.mark.long
def test_floor_spectra_equal_spectra_of_the_exported_motions(run, tdint, drawn):
    """The spectra agree within 1e-9, the digits of the tables. The spectral acceleration at the
    period 0 is the maximum sample of the history; the peaks in stories.csv include values between
    the samples. Station codes of the exported file contain the floor."""
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
    floor_rows = written("floor-spectra.csv")
    cases = [("1", "0.02"), ("1", "0.05"), ("2", "0.02"), ("2", "0.05")]
    assert [(row["floor"], row["damping"]) for row in floor_rows[::3]] == cases
    exported = tdint(
        "spectrum out/floors.mseed", *(word.replace("--floor-", "--") for word in options)
    )
    assert "assumed" not in exported.stderr  # The exported file contains its units.
    exported_rows = rows(exported.stdout)
    assert [row["component"] for row in exported_rows] == ["F01"] * 6 + ["F02"] * 6 and len(
        floor_rows
    ) == 12
    for row, other in zip(floor_rows, exported_rows, strict=True):
        for name in ("damping", "period_s", "sd_m", "psv_m_s", "psa_m_s2", "sv_m_s", "sa_m_s2"):
            assert math.isclose(float(row[name]), float(other[name]), rel_tol=1e-9, abs_tol=1e-12)
    floor_motions = rows(tdint("info", "out/floors.mseed").stdout)
    assert [row["id"] for row in floor_motions] == [".F01.SI.HNE", ".F02.SI.HNE"]
    history = written("history.csv")
    for floor, rigid, info in (
        (1, floor_rows[0], floor_motions[0]),
        (2, floor_rows[6], floor_motions[1]),
    ):
        column = [row[f"floor_{floor}_absolute_acceleration_m_s2"].lstrip("-") for row in history]
        assert rigid["sa_m_s2"] == info["pga_m_s2"] == max(column, key=float)
    (chosen,) = rows(tdint("info", "out/floors.mseed", "--component", "f02").stdout)
    assert chosen["pga_m_s2"] == floor_motions[1]["pga_m_s2"]
    tdint("info", "out/floors.mseed", "--units", "g", code=4)


def test_a_sampling_interval_that_miniseed_cannot_store_is_reported(tmp_path):
    samples = np.sin(np.arange(50.0))
    for dt, is_rounded in ((0.01, False), (1.0 / 120.0, False), (0.0123456789, True)):
        content, notes = to_mseed([Record(samples, dt, "", ".F01..HNX", "HNX", "floor 1")])
        assert bool(notes) is is_rounded
        (tmp_path / "floor.mseed").write_bytes(content)
        record = read_record(tmp_path / "floor.mseed", units="m/s^2")
        np.testing.assert_array_equal(record.acceleration, samples)
        assert record.dt == pytest.approx(dt, rel=1e-7 if is_rounded else 1e-12)
        assert record.start == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--floor-spectra", "3", "-o", "out"], "floor '3' not found; ... 1 to 2"),
        (["--floor-spectra", "top", "-o", "out"], "floor 'top' not found"),
        (["--floor-spectra", "roof"], "--floor-spectra requires -o DIR"),
        (["--export-floors", "mseed"], "--export-floors requires -o DIR"),
    ],
)
def test_usage_errors(folder, tdint, arguments, message):
    tdint.refused(message, "run", "shaken.yaml", *arguments)


@pytest.mark.long
def test_floor_spectra_of_several_runs_have_their_mean_and_envelope(run, tdint, drawn):
    """The spectra of each run equal the spectra of a separate call. For a pair, the larger
    component is used at each period."""
    options = ("--floor-spectra", "1,roof", "--floor-period", "0.05,0.3", "--units", "m/s^2")
    run("other.mseed", "motion.mseed", *options, "--plot", code=0)
    run_rows, means = written("floor-spectra.csv"), written("floor-spectra-mean.csv")
    assert (Path("out") / "floor-spectra.png").stat().st_size > 10_000
    single_runs = {}
    for record, component in (
        ("motion.mseed", "HNE"),
        ("motion.mseed", "HNN"),
        ("other.mseed", "HNE"),
    ):
        folder = f"{record}-{component}"
        tdint("run", "shaken.yaml", record, "--component", component, *options, "-o", folder)
        campaign_rows = [
            row for row in run_rows if (row["record"], row["component"]) == (record, component)
        ]
        single_rows = rows(Path(folder) / "floor-spectra.csv")
        assert [
            {name: row[name] for name in single_rows[0]} for row in campaign_rows
        ] == single_rows
        single_runs[record, component] = [float(row["psa_m_s2"]) for row in single_rows]
    pair = np.maximum(single_runs["motion.mseed", "HNE"], single_runs["motion.mseed", "HNN"])
    other = np.array(single_runs["other.mseed", "HNE"])
    assert [row["runs"] for row in means] == ["2"] * 4
    assert [float(row["mean_psa_m_s2"]) for row in means] == pytest.approx(
        (pair + other) / 2.0, rel=1e-10
    )
    assert [float(row["max_psa_m_s2"]) for row in means] == pytest.approx(
        np.maximum(pair, other), rel=1e-10
    )
