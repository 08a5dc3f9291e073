"""`tdint info --export`: processed motions as files. Reading these files gives the same motions."""

import json
from pathlib import Path

import numpy as np
import pytest

import tdint as library
from csv_rows import rows
from tdint.ground_motion.choice import Processing
from tdint.ground_motion.measures import integrate
from tdint.ground_motion.processing_steps import processed
from tdint.ground_motion.reading.scale import moved

UNITS = ("--units", "m/s^2")
DONE = ("--baseline", "linear", "--pad", "1", "--highpass", "0.2")
DONE_HERE = Processing(baseline="linear", pad=(1.0, 1.0), highpass=0.2)


def motion(component: str) -> library.Record:
    return processed(
        library.read_record("motion.mseed", units="m/s^2", component=component), DONE_HERE
    )


def test_miniseed_equals_the_motion_to_the_bit(folder, tdint) -> None:
    table = tdint("info", "motion.mseed", *UNITS, *DONE, "--export", "new/out.mseed", code=0)
    assert rows(table.stdout) == rows(tdint("info", "motion.mseed", *UNITS, *DONE).stdout)
    about = json.loads((folder / "new" / "out.json").read_text())
    for component, summary in zip(("HNE", "HNN"), about["records"], strict=True):
        record, expected = (
            library.read_record("new/out.mseed", component=component),
            motion(component),
        )
        assert record.acceleration.tobytes() == expected.acceleration.tobytes()
        assert (record.dt, record.start) == (expected.dt, expected.start)
        assert (record.units, record.units_from, record.warnings) == ("m/s^2", "file", ())
        assert summary["processing"] == list(expected.processing)
        assert summary["exported_as"] == record.id
        assert summary["inputs"][0]["file"] == "motion.mseed"
    assert [row["component"] for row in rows(tdint("info", "new/out.mseed").stdout)] == [
        "HNE",
        "HNN",
    ]


def test_velocity_and_displacement_are_separate_channels(folder, tdint) -> None:
    """Velocity and displacement are separate channels that other programs can read."""
    from obspy import read

    assert tdint("info", "motion.mseed", *UNITS, *DONE, "--export", "out.mseed").exit_code == 0
    expected = integrate(motion("HNE"))
    first = motion("HNE").id.split(".")
    traces = {trace.id: trace.data for trace in read("out.mseed", format="MSEED")}
    assert len(traces) == 6
    for location, samples in (("SV", expected.velocity), ("SD", expected.displacement)):
        assert traces[f"{first[0]}.{first[1]}.{location}.HNE"].tobytes() == samples.tobytes()
    velocity = library.read_record("out.mseed", component=f"{first[0]}.{first[1]}.SV.HNE")
    assert (velocity.quantity, velocity.units) == ("velocity", "m/s")
    moving = moved(expected.velocity, velocity.dt, "velocity")
    np.testing.assert_allclose(velocity.acceleration, moving.acceleration, atol=1e-12)


@pytest.mark.parametrize(("units", "names"), [((), "m_s2"), (("--output-units", "cm,g"), "g")])
def test_csv_equals_the_motion_to_its_digits(folder, tdint, units, names) -> None:
    call = (
        "info", "motion.mseed", *UNITS, "--component", "HNN", *DONE, *units, "--export",
        "out.csv",
    )  # fmt: skip
    assert tdint(*call).exit_code == 0
    table, expected = rows(folder / "out.csv"), motion("HNN")
    assert f"acceleration_{names}" in table[0]
    record = library.read_record("out.csv")
    assert record.dt == pytest.approx(expected.dt, rel=1e-12)
    np.testing.assert_allclose(record.acceleration, expected.acceleration, rtol=1e-11, atol=1e-15)
    about = json.loads((folder / "out.json").read_text())
    assert set(about["columns"]) == set(table[0])
    if not units:
        last = integrate(expected)
        assert float(table[-1]["velocity_m_s"]) == pytest.approx(last.velocity[-1], rel=1e-11)
        assert float(table[-1]["displacement_m"]) == pytest.approx(last.displacement[-1], rel=1e-11)


def test_records_with_equal_codes_become_stations(folder, tdint) -> None:
    for name in ("a", "b"):
        (folder / f"{name}.txt").write_text(
            f"# dt = 0.02 s, units = g\n0\n0.{'ab'.index(name) + 1}\n0\n"
        )
    assert tdint("info", "a.txt", "b.txt", "--export", "out.mseed").exit_code == 0
    exported = json.loads((folder / "out.json").read_text())["records"]
    assert [(entry["file"], entry["exported_as"]) for entry in exported] == [
        ("a.txt", ".R01.SI.HN1"),
        ("b.txt", ".R02.SI.HN1"),
    ]
    assert library.read_record("out.mseed", component="R02").pga == pytest.approx(0.2 * 9.80665)


MODEL = """\
name: one
stories: [{mass: 100, height: 3, stiffness: 4.0e3}]
damping: 5%
analysis: {method: newmark-average}
"""
CAMPAIGN = """\
name: study
buildings: {models: [one.yaml]}
records: {files: [moved/out.mseed, moved/one.csv]}
analysis: {method: newmark-average}
"""


def test_runs_and_campaigns_read_the_origin_next_to_an_exported_motion(folder, tdint) -> None:
    """MiniSEED and CSV have no place for the origin: it is in the JSON file of the same name, which
    may be moved together with the motion. A motion alone has no origin."""
    Path("one.yaml").write_text(MODEL)
    call = ("info", "motion.mseed", *UNITS, *DONE, "--component", "HNE", "--export")
    Path("moved").mkdir()
    for name in ("out.mseed", "one.csv"):
        tdint(*call, name, code=0)
        for file in (Path(name), Path(name).with_suffix(".json")):
            file.rename(Path("moved") / file)
        result = tdint("run", "one.yaml", f"moved/{name}", "-o", name[:3], code=0)
        summary = json.loads(Path(name[:3], "summary.json").read_text())
        origin = summary["record"]["origin"]
        assert (origin["seed"], origin["seed_component"]) == ("motion.mseed", "HNE")
        assert origin["processing"] == list(motion("HNE").processing)
        assert all(step in result.stderr for step in origin["processing"])
        assert f"moved/{Path(name).stem}.json" in {item["file"] for item in summary["inputs"]}
    Path("study.yaml").write_text(CAMPAIGN)
    tdint("campaign", "study.yaml", "-o", "study", code=0)
    stored = json.loads(Path("study/summary.json").read_text())["records"]
    assert [entry["origin"] for entry in stored] == [origin, origin]
    for name in ("out.mseed", "one.csv"):
        (Path("moved") / name).with_suffix(".json").unlink()
        assert library.read_record(f"moved/{name}").origin is None


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("motion.mseed", "--export", "out.csv"), 2, "one component, got 2; select one"),
        (("motion.mseed", "--export", "out.txt"), 2, "use the suffix .mseed, .csv or .yaml"),
        (("motion.mseed", "--export", "motion.mseed"), 6, "motion.mseed"),
        (
            ("motion.mseed", "--export", "out.mseed", "-o", "out.csv"),
            6,
            "two outputs have this file name",
        ),
        (("motion.mseed", "slow.txt", "--export", "out.mseed"), 2, "different sampling intervals"),
    ],
)
def test_invalid_exports_are_refused(folder, tdint, arguments, code, message) -> None:
    (folder / "slow.txt").write_text("# dt = 0.02 s\n0\n0.1\n0\n")
    tdint.refused(message, "info", *UNITS, *arguments, code=code)
