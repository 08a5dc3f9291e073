"""Two horizontal components by their names; what is no pair is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from real_records import real_file
from tdint.errors import RecordError
from tdint.ground_motion.horizontals import azimuth, find_horizontals, is_vertical, motion_name
from tdint.ground_motion.reading.read import read_horizontals, read_record, read_records
from tdint.ground_motion.record import Record


def record(component, samples=100, *, dt=0.01, station="N.STA", start="", source="a.x", seed=0):
    values = np.random.default_rng([seed, len(component), *component.encode()]).standard_normal(samples)
    return Record(values, dt, start, f"{station}..{component}", component, source)


@pytest.mark.parametrize(
    ("name", "degrees"),
    [
        ("000", 0.0), ("67", 67.0), ("337", 337.0), ("360", 360.0), ("N00W", 0.0), ("S16W", 196.0), ("S74E", 106.0),
        ("N45E", 45.0), ("N45W", 315.0), ("NS", 0.0), ("N-S", 0.0), ("EW2", 90.0), ("HNN", 0.0), ("hne", 90.0),
        ("E", 90.0), ("HN1", None), ("1", None), ("2", None), ("", None), ("X", None), ("UP", None),
    ],
)  # fmt: skip
def test_azimuths(name, degrees):
    assert azimuth(name) == degrees


@pytest.mark.parametrize(
    "name", ["U", "UP", "DOWN", "DWN", "UD", "U-D", "UD2", "HNZ", "BNZ", "Z", "V", "VERT", "vertical"]
)
def test_vertical_components(name):
    assert is_vertical(name)


@pytest.mark.parametrize("name", ["HNE", "HN1", "NS", "360", "", "N00W", "X"])
def test_components_that_are_not_vertical(name):
    assert not is_vertical(name)


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (("HNE", "HNN", "HNZ"), "HNN+HNE"),
        (("HN1", "HN2"), "HN1+HN2"),
        (("HNZ", "HN2", "HN1"), "HN2+HN1"),
        (("EW", "NS", "UD"), "NS+EW"),
        (("67", "UP", "337"), "337+67"),
        (("360", "90"), "360+90"),
        (("S16W", "S74E"), "S74E+S16W"),
        (("0", "270"), "270+0"),
        (("93", "0"), "0+93"),
        (("X", "Y", "Z"), "X+Y"),
    ],
)
def test_pairs(names, found):
    """By azimuth the second component lies 90 degrees clockwise of the first."""
    pair = find_horizontals([record(name) for name in names])
    assert (pair.component, pair.source, pair.notes) == (found, "a.x", ())


def test_names_that_tell_no_direction_are_taken_with_a_note():
    pair = find_horizontals([record("", source="a.txt"), record("", source="b.txt", seed=1)])
    assert (pair.source, pair.component) == ("a.txt+b.txt", "?+?")
    assert pair.notes == (
        "directions unknown from the names: one and the other are taken as two horizontals at right angles",
    )


@pytest.mark.parametrize(
    ("records", "message"),
    [
        ([record("HNE"), record("HNZ")], "a.x: has a single horizontal component, HNE; name the file of the other"),
        ([record("HNZ")], "two horizontal components are needed, there are 0: none"),
        ([record("HNE"), record("HNN"), record("HN1")], "there are 3: HNE, HNN, HN1"),
        ([record("67"), record("90")], "67 and 90 are 23 degrees apart, not at right angles"),
        ([record("EW"), record("EW", seed=1)], "EW and EW are 0 degrees apart"),
        ([record("H1"), record("H1", seed=1)], "both components are called H1"),
        ([record("HNE"), record("HNN", dt=0.02)], "sampled at 0.01 and 0.02 s"),
        ([record("HNE"), record("HNN", station="N.ELSE")], "of different stations, N.STA and N.ELSE"),
        (
            [record("HNE", start="2024-01-01T00:00:00.000000Z"), record("HNN", start="2024-01-01T00:00:00.250000Z")],
            "the components begin 0.25 s apart",
        ),
        ([record("HNE"), record("HNN", samples=90)], "have 100 and 90 samples; cut them to equal length"),
    ],
)
def test_what_is_no_pair(records, message):
    with pytest.raises(RecordError, match=message):
        find_horizontals(records)


def test_the_same_motion_twice():
    one = record("HNE")
    twice = Record(one.acceleration, one.dt, "", "", "HNN", "b.x")
    with pytest.raises(RecordError, match="both components are the same"):
        find_horizontals([one, twice])


@pytest.mark.parametrize(("samples", "words"), [(99, "the last sample of HNE"), (97, "the last 3 samples of HNE")])
def test_the_end_that_one_alone_has_is_left_out(samples, words):
    pair = find_horizontals([record("HNE"), record("HNN", samples=samples)])
    assert pair.first.acceleration.size == pair.second.acceleration.size == samples
    assert pair.notes == (f"{words} left out: the other component is shorter",)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("r/AOM0051801241951.EW", "r/AOM0051801241951.NS"),
        ("r/AICH040010061330.EW2", "r/AICH040010061330.NS2"),
        ("RSN763_LOMAP_GIL067.AT2", "RSN763_LOMAP_GIL337.AT2"),
        ("RSN763_LOMAP_GIL067.AT2", "RSN763_LOMAP_GIL-UP.AT2"),
        ("H-E01140.AT2", "H-E01230.AT2"),
        ("CI.CLC..HNE.mseed", "CI.CLC..HNN.mseed"),
    ],
)
def test_files_of_one_motion(one, other):
    assert motion_name(one) == motion_name(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("a/x.EW", "b/x.NS"),
        ("x.EW1", "x.NS2"),
        ("record001.mseed", "record002.mseed"),
        ("A.AT2", "B.AT2"),
        ("CI.CLC..HNE.mseed", "CI.TOW..HNN.mseed"),
        ("CI.CLC..HNE.mseed", "CI.CLC..BNN.mseed"),
    ],
)
def test_files_of_different_motions(one, other):
    assert motion_name(one) != motion_name(other)


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (("RSN763_LOMAP_GIL067.AT2", "RSN763_LOMAP_GIL337.AT2"), "337+67"),
        (("AOM0051801241951.EW", "AOM0051801241951.NS"), "NS+EW"),
        (("CE89146.V1",), "360+90"),
        (("ce36456p_CE36456.V2",), "0+90"),
        (("20180212_211557_WPWS_20.V2A",), "S74E+S16W"),
    ],
)
def test_real_records(names, found):
    paths = [real_file(name) for name in names]
    assert find_horizontals([one for path in paths for one in read_records(path)]).component == found


def test_read_from_a_file():
    file = Path(__file__).parents[2] / "records" / "firm-soil.mseed"
    pair = read_horizontals(file, units="m/s^2")
    assert (pair.component, pair.first.pga) == ("HN1+HN2", read_record(file, units="m/s^2", component="HN1").pga)
