"""`tdint spectrum --rotd`: pairs in one or two files, table, figure, and errors."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from csv_rows import rows
from ground_motion import format_files
from ground_motion.files import trace, write
from tdint.ground_motion.reading.read import read_horizontals

ROTD = ("spectrum", "--rotd", "0,50,100", "--period", "0.2", "--period", "1")


def write_at2(file: Path, component: str, seed: int, samples: int = 200):
    """Write a PEER file with noise."""
    values = np.random.default_rng(seed).standard_normal(samples) * 0.1
    file.write_text(format_files.at2(values).replace(", 067", f", {component}"), encoding="utf-8")


def test_two_components_of_a_file(folder, tdint):
    result = tdint(*ROTD, "motion.mseed", "--damping", "0.02", "--damping", "0.05", code=0)
    table = rows(result.stdout)
    assert [(row["component"], row["damping"], row["period_s"]) for row in table] == [
        ("HNN+HNE", damping, period) for damping in ("0.02", "0.05") for period in ("0.2", "1")
    ]
    # Both components of motion.mseed are the same sine, with amplitudes 1 (HNE) and 2 (HNN), so
    # that the motion is along a line.
    assert {row["rotd100_angle_deg"] for row in table} == {"27"}


@pytest.mark.parametrize(
    "names",
    [
        ("RSN1_X_ABC000.AT2", "RSN1_X_ABC090.AT2"),
        ("RSN1_X_ABC090.AT2", "RSN1_X_ABC-UP.AT2", "RSN1_X_ABC000.AT2"),
        ("one.AT2", "other.AT2"),
    ],
)
def test_components_in_separate_files(folder, tdint, names):
    components = {"000": "0", "090": "90", "-UP": "UP"}
    for seed, name in enumerate(names):
        write_at2(folder / name, components.get(name[-7:-4], f"{90 * seed}"), seed)
    pair = "+".join(sorted(name for name in names if "UP" not in name))
    table = rows(tdint(*ROTD, *names, code=0).stdout)
    assert {(row["record"], row["component"]) for row in table} == {(pair, "0+90")}


def write_noise(file: Path, seed: int) -> None:
    """Write a text table without names of components, which does not state its component."""
    values = np.random.default_rng(seed).standard_normal(200) * np.hanning(200)
    file.write_text("# dt = 0.01 s, units = m/s^2\n" + "\n".join(f"{v:.6f}" for v in values))


def test_directions_in_file_names_order_the_components(folder, tdint):
    """The names were said to state no directions, so that the angle was that from S16W."""
    for seed, name in enumerate(("x_S16W.txt", "x_S74E.txt")):
        write_noise(folder / name, seed)
    result = tdint(*ROTD, "x_S16W.txt", "x_S74E.txt", code=0)
    assert {row["component"] for row in rows(result.stdout)} == {"S74E+S16W"}
    assert "directions" not in result.stderr
    files = [folder / name for name in ("x_S16W.txt", "x_S74E.txt")]
    assert read_horizontals(*files).component == "S74E+S16W"


def test_several_recordings_in_a_file(folder, tdint):
    """Stations in a MiniSEED file and files in an archive are recordings of their own."""
    names = [f"{event}_{code}.txt" for event in "ab" for code in "NEZ"]
    for seed, name in enumerate(names):
        write_noise(folder / name, seed)
    with zipfile.ZipFile(folder / "all.zip", "w") as archive:
        for name in names:
            archive.write(folder / name, name)
    channels = {}
    for seed, (station, code) in enumerate((s, c) for s in "AB" for c in ("HNN", "HNE", "HNZ")):
        samples = np.random.default_rng(seed).standard_normal(200) * np.hanning(200)
        channels[station, code] = trace(samples, channel=code, station=station)
    write(folder / "all.mseed", *channels.values())
    for station in "AB":
        write(folder / f"{station}.mseed", *(t for (s, _), t in channels.items() if s == station))

    def found(*files):
        """Return the spectra and the factors of the pairs."""
        spectra = rows(tdint(*ROTD, *files, "--units", "m/s^2", code=0).stdout)
        scaling = ("--units", "m/s^2", "--pairs", "rotd50", "--to", "sa=1g", "--at", "0.2")
        factors = rows(tdint("scale", *files, *scaling, code=0).stdout)
        return [row["rotd50_psa_m_s2"] for row in spectra], [row["factor"] for row in factors]

    assert found("all.zip") == found(*names)
    assert found("all.mseed") == found("A.mseed", "B.mseed")


def test_a_vertical_component_is_recognized_by_its_file_name(folder, tdint):
    """It was a third motion in all means, and the other two components were no pair."""
    for seed, code in enumerate("NEZ"):
        write_noise(folder / f"a_{code}.txt", seed)
    result = tdint("run", "shaken.yaml", *(f"a_{code}.txt" for code in "NEZ"), "-o", "o", code=0)
    assert [row["record"] for row in rows(folder / "o" / "runs.csv")] == ["a_N.txt", "a_E.txt"]
    assert "a_Z.txt: not used: vertical component" in result.stderr
    assert "2 components, 1 recording, 1 pair (" in result.stderr


@pytest.mark.long
def test_several_motions_have_separate_output_files(folder, tdint):
    files = [f"{motion}{component}.AT2" for component in ("000", "090") for motion in "AB"]
    for seed, name in enumerate(files):
        write_at2(folder / name, str(int(name[1:4])), seed)
    tdint(*ROTD, *files, "motion.mseed", "-o", "out/", "--plot", code=0)
    stems = ("A000+090", "B000+090", "motion")
    assert {path.name for path in (folder / "out").iterdir()} == {
        f"{stem}.{suffix}" for stem in stems for suffix in ("csv", "json", "png")
    }
    assert {row["record"] for row in rows(folder / "out" / "B000+090.csv")} == {"B000.AT2+B090.AT2"}
    about = json.loads((folder / "out" / "A000+090.json").read_text())
    assert about["settings"]["rotd"] == [0, 50, 100]
    assert [record["component"] for record in about["records"]] == ["0", "90"]
    parts = [row for stem in stems for row in rows(folder / "out" / f"{stem}.csv")]
    assert rows(tdint(*ROTD, *files, "motion.mseed", "--jobs", "2").stdout) == parts


def test_components_of_unequal_length_are_cut_with_a_note(folder, tdint):
    write_at2(folder / "A000.AT2", "0", 1)
    write_at2(folder / "A090.AT2", "90", 2, samples=199)
    result = tdint(*ROTD, "A000.AT2", "A090.AT2", code=0)
    note = "last sample of 0 omitted, because the other component is shorter"
    assert note in result.stderr


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("other.mseed",), "one horizontal component, HNE; "),
        (("A000.AT2", "A030.AT2"), "the directions 0 and 30 differ by 30 degrees"),
        (("A000.AT2", "missing.AT2"), "A000.AT2: the file has only one horizontal component, 0"),
    ],
)
def test_records_without_a_pair_are_refused(folder, tdint, names, message):
    write_at2(folder / "A000.AT2", "0", 1)
    write_at2(folder / "A030.AT2", "30", 2)
    tdint.refused(message, *ROTD, *names, code=4)
