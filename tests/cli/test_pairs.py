"""Both components of a recording are one motion in every command."""

import numpy as np
import pytest

from csv_rows import rows

MATCH = "match RSN1_EQ_GIL067.AT2 RSN1_EQ_GIL337.AT2 --pairs rotd100"
TARGET = "--target asce7:sds=1,sd1=0.6,tl=8 --range 0.2:0.5"


def write_pair(folder, name="RSN1_EQ_GIL", event="Loma Prieta", seed=0, sizes=(1.0, 0.6)):
    """Write two PEER files: decaying noise of 067 and 337 with these sizes."""
    generator = np.random.default_rng(seed)
    for direction, size in zip(("067", "337"), sizes, strict=True):
        time = np.arange(600) * 0.01
        values = 0.2 * size * generator.standard_normal(600) * np.exp(-((time - 2.0) ** 2))
        lines = [
            "PEER NGA STRONG MOTION DATABASE RECORD",
            f"{event}, 10/18/1989, Gilroy - Gavilan Coll., {int(direction)}",
            "ACCELERATION TIME SERIES IN UNITS OF G",
            "NPTS= 600, DT= .0100 SEC",
            *(f"{value:16.8E}" for value in values),
        ]
        (folder / f"{name}{direction}.AT2").write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.parametrize("kind", ["mseed", "at2", "csv"])
def test_commands_recognize_a_matched_pair(folder, tdint, kind):
    write_pair(folder)
    tdint(*MATCH.split(), *TARGET.split(), "--format", kind, "-o", "m", code=0)
    files = [f"m/RSN1_EQ_GIL{direction}.{kind}" for direction in ("337", "067")]
    rotd = rows(tdint("spectrum", *files, "--rotd", "100", "--period", "0.3", code=0).stdout)
    assert [row["component"] for row in rotd] == ["337+67"]
    assert float(rotd[0]["rotd100_psa_m_s2"]) == pytest.approx(9.80665, rel=0.02)
    scaling = ("scale", "m", "--pairs", "geometric-mean", "--sa", "1g", "--at", "0.3")
    scaled = rows(tdint(*scaling, code=0).stdout)
    assert len(scaled) == 2 and len({row["factor"] for row in scaled}) == 1
    study = "buildings: {models: [shaken.yaml]}\nrecords: {files: [m], pairs: true}\n"
    (folder / "study.yaml").write_text(study + "intensity: {scales: [1]}\n", encoding="utf-8")
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    runs = rows((folder / "out" / "runs.csv").read_text())
    assert [row["component"] for row in runs] == ["337", "67"]


def test_components_of_different_events_are_refused(folder, tdint):
    write_pair(folder, event="Loma Prieta")
    other = (folder / "RSN1_EQ_GIL337.AT2").read_text().replace("Loma Prieta", "Kobe")
    (folder / "RSN1_EQ_GIL337.AT2").write_text(other, encoding="utf-8")
    result = tdint.refused("different events", *MATCH.split(), *TARGET.split(), "-o", "m", code=4)
    assert all(name in result.stderr for name in ("GIL067.AT2", "GIL337.AT2", "Kobe"))
