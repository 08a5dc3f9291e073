"""Two horizontal components are identified by their names; other combinations are refused."""

from pathlib import Path

import numpy as np
import pytest

from facts import each_states
from real_records import real_file
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.horizontals import (
    PairNames,
    SingleHorizontal,
    azimuth,
    combine_single_components,
    files_of_motions,
    find_horizontals,
    is_vertical,
    motion_name,
    with_component,
)
from tdint.ground_motion.reading.read import read_horizontals, read_record, read_records
from tdint.ground_motion.record import Record


def record(component, samples=100, *, dt=0.01, station="N.STA", start="", source="a.x", seed=0):
    values = np.random.default_rng([seed, len(component), *component.encode()]).standard_normal(
        samples
    )
    return Record(values, dt, start, f"{station}..{component}", component, source)


@pytest.mark.parametrize(
    ("name", "degrees"),
    [
        ("000", 0.0), ("67", 67.0), ("337", 337.0), ("360", 360.0), ("N00W", 0.0), ("S16W", 196.0),
        ("S74E", 106.0), ("N45E", 45.0), ("N45W", 315.0), ("NS", 0.0), ("N-S", 0.0), ("EW2", 90.0),
        ("HNN", 0.0), ("hne", 90.0), ("E", 90.0), ("HN1", None), ("1", None), ("2", None),
        ("", None), ("X", None), ("UP", None),
    ],
)  # fmt: skip
def test_azimuth_of_component_name(name, degrees):
    assert azimuth(name) == degrees


def test_vertical_components_are_recognized():
    vertical = [
        "U", "UP", "DOWN", "DWN", "UD", "U-D", "UD2", "HNZ", "BNZ", "BHZ00", "Z", "V", "VERT",
        "vertical",
    ]  # fmt: skip
    assert [
        name
        for name in (*vertical, "HNE", "HN1", "NS", "360", "", "N00W", "X")
        if is_vertical(name)
    ] == vertical


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (("HNE", "HNN", "HNZ"), "HNN+HNE"), (("HN1", "HN2"), "HN1+HN2"),
        (("BHZ00", "BH100", "BH200"), "BH100+BH200"), (("HHE10", "HHN10"), "HHN10+HHE10"),
        (("HNZ", "HN2", "HN1"), "HN2+HN1"), (("EW", "NS", "UD"), "NS+EW"),
        (("67", "UP", "337"), "337+67"), (("360", "90"), "360+90"),
        (("S16W", "S74E"), "S74E+S16W"), (("0", "270"), "270+0"), (("93", "0"), "0+93"),
        (("X", "Y", "Z"), "X+Y"),
    ],
)  # fmt: skip
def test_horizontal_components_are_paired(names, found):
    """The azimuth of the second component is 90 degrees clockwise from the first."""
    pair = find_horizontals([record(name) for name in names])
    assert (pair.component, pair.source, pair.notes) == (found, "a.x", ())


def test_names_without_direction_are_paired_with_note():
    pair = find_horizontals([record("", source="a.txt"), record("", source="b.txt", seed=1)])
    assert (pair.source, pair.component) == ("a.txt+b.txt", "?+?")
    assert each_states(pair.notes, ["names ... assumed ... perpendicular"])


@pytest.mark.parametrize(
    ("records", "message"),
    [
        ([record("HNZ")], "two horizontal components .* 0: none"),
        ([record("HNE"), record("HNN"), record("HN1")], "the source contains 3: HNE, HNN, HN1"),
        ([record("67"), record("90")], "the directions 67 and 90 differ by 23 degrees"),
        ([record("EW"), record("EW", seed=1)], "the directions EW and EW differ by 0 degrees"),
        ([record("H1"), record("H1", seed=1)], "both components are called H1"),
        ([record("HNE"), record("HNN", dt=0.02)], "different sampling intervals, 0.01 and 0.02 s"),
        (
            [record("HNE"), record("HNN", station="N.ELSE")],
            "of different stations, N.STA and N.ELSE",
        ),
        (
            [
                record("HNE", start="2024-01-01T00:00:00.000000Z"),
                record("HNN", start="2024-01-01T00:00:00.250000Z"),
            ],
            "the components start 0.25 s apart",
        ),
        ([record("HNE"), record("HNN", samples=90)], "100 and 90 samples"),
    ],
)
def test_invalid_pairs_are_refused(records, message):
    with pytest.raises(RecordError, match=message):
        find_horizontals(records)


def test_identical_components_are_refused():
    first = record("HNE")
    twice = Record(first.acceleration, first.dt, "", "", "HNN", "b.x")
    with pytest.raises(RecordError, match="both components are identical"):
        find_horizontals([first, twice])


@pytest.mark.parametrize(
    ("samples", "omitted"), [(99, "last sample of HNE"), (97, "last 3 samples of HNE")]
)
def test_longer_component_is_truncated(samples, omitted):
    pair = find_horizontals([record("HNE"), record("HNN", samples=samples)])
    assert pair.first.acceleration.size == pair.second.acceleration.size == samples
    assert pair.notes == (f"{omitted} omitted, because the other component is shorter",)


SAME_MOTION = [
    ("r/AOM0051801241951.EW", "r/AOM0051801241951.NS"),
    ("r/AICH040010061330.EW2", "r/AICH040010061330.NS2"),
    ("r/RSN8547_ARK_BH100.AT2", "r/RSN8547_ARK_BH200.AT2"),
    ("r/RSN8547_ARK_BH100.AT2", "r/RSN8547_ARK_BHZ00.AT2"),
    ("RSN763_LOMAP_GIL067.AT2", "RSN763_LOMAP_GIL337.AT2"),
    ("RSN763_LOMAP_GIL067.AT2", "RSN763_LOMAP_GIL-UP.AT2"),
    ("H-E01140.AT2", "H-E01230.AT2"),
    ("CI.CLC..HNE.mseed", "CI.CLC..HNN.mseed"),
    ("a/site_N.csv", "a/site_E.csv"),
    ("site_EW.txt.gz", "site_NS.txt.gz"),
    ("RSN1-H1.txt", "RSN1-H2.txt"),
    ("RSN1_X000.AT2", "RSN1_X090.AT2"),
    ("GM1_FN.AT2", "GM1_FP.AT2"),
    ("site.N.txt", "site.Z.txt"),
]
OTHER_MOTION = [
    ("a/x.EW", "b/x.NS"), ("x.EW1", "x.NS2"), ("record001.mseed", "record002.mseed"),
    ("A.AT2", "B.AT2"), ("CI.CLC..HNE.mseed", "CI.TOW..HNN.mseed"),
    ("CI.CLC..HNE.mseed", "CI.CLC..BNN.mseed"), ("site_N.csv", "site_E.txt"),
    ("site_N.csv", "site.csv"), ("record_000.csv", "record_090.csv"), ("one.N", "one.E"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("first", "second", "same"),
    [*((*pair, True) for pair in SAME_MOTION), *((*pair, False) for pair in OTHER_MOTION)],
)
def test_files_of_one_motion_are_recognized(first, second, same):
    assert (motion_name(first) == motion_name(second)) == same


def test_pairs_by_file_name_patterns():
    names = PairNames.parse("{}_long.txt, {}_tran.txt")
    files = [
        "r/a_long.txt", "r/b_long.txt", "r/a_tran.txt", "r/b_tran.txt", "s/a_tran.txt",
        "r/a_up.txt",
    ]  # fmt: skip
    motions, others = files_of_motions(files, names)
    assert motions == [
        ("r/a_long.txt", "r/a_tran.txt"),
        ("r/b_long.txt", "r/b_tran.txt"),
        ("s/a_tran.txt",),
    ]
    assert others == ["r/a_up.txt"]
    folders = PairNames.parse("N/{}.txt,E/{}.txt")
    assert files_of_motions(["x/N/1.txt", "x/E/1.txt", "x/N/2.txt"], folders)[0] == [
        ("x/N/1.txt", "x/E/1.txt"),
        ("x/N/2.txt",),
    ]
    with pytest.raises(UsageError, match=r"N/\{\}.txt or E/\{\}.txt; .* a.txt"):
        files_of_motions(["a.txt"], folders)


@pytest.mark.parametrize(
    "text", ["{}_N.txt", "{}_N.txt,{}_N.txt", "{}_N.txt,{}_E.txt,{}_Z.txt", "{}{},{}_E", "a,{}_b"]
)
def test_invalid_file_name_patterns_are_refused(text):
    with pytest.raises(UsageError, match="must be two file name patterns"):
        PairNames.parse(text)


def test_missing_component_is_taken_from_file_name():
    assert with_component(record("", source="a/site_ns.csv")).component == "NS"
    assert with_component(record("HNE", source="a/site_ns.csv")).component == "HNE"
    assert with_component(record("", source="a/site.csv")).component == ""


@pytest.mark.parametrize(
    ("files", "names"),
    [
        (("a1.txt", "a2.txt", "b1.txt", "b2.txt"), "{}1.txt,{}2.txt"),
        (("a_000.csv", "b_000.csv", "a_090.csv", "b_090.csv"), "{}000.csv,{}090.csv"),
        (
            ("lon_kobe.csv", "lon_northridge.csv", "tra_kobe.csv", "tra_northridge.csv"),
            "lon{}.csv,tra{}.csv",
        ),
    ],
)
def test_single_components_are_reported_once_with_remedy(files, names):
    """The proposed patterns are accepted by `PairNames` and give pairs."""
    failures = []
    for file in files:
        with pytest.raises(RecordError) as caught:
            find_horizontals([record("", source=file)])
        failures.append(caught.value)
    (combined,) = combine_single_components(failures)
    assert str(combined).startswith(f"{len(files)} files contain a single horizontal component")
    assert f"--pairs '{names}'" in str(combined)
    assert [len(motion) for motion in files_of_motions(files, PairNames.parse(names))[0]] == [2, 2]
    assert combine_single_components(failures[:1]) == failures[:1]


@pytest.mark.parametrize(
    ("files", "names"),
    [
        # Files in several directories have the same names.
        (("a/r_000.csv", "a/r_090.csv", "b/r_000.csv", "b/r_090.csv"), "{}000.csv,{}090.csv"),
        (("a1.txt", "a10.txt", "b1.txt", "b10.txt"), "{}1.txt,{}10.txt"),
    ],
)
def test_proposed_patterns_are_different_and_keep_numbers(files, names):
    failures = [SingleHorizontal(file, "") for file in files]
    assert f"--pairs '{names}'" in str(combine_single_components(failures)[0])
    assert PairNames.parse(names).motion(files[0]) == PairNames.parse(names).motion(files[1])


def test_different_file_names_give_no_pattern():
    failures = [SingleHorizontal(file, "") for file in ("kobe.txt", "northridge.txt")]
    assert "--pairs" not in str(combine_single_components(failures)[0])


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
def test_real_records_are_paired(names, found):
    paths = [real_file(name) for name in names]
    assert (
        find_horizontals(
            [component for path in paths for component in read_records(path)]
        ).component
        == found
    )


def test_pair_is_read_from_file():
    file = Path(__file__).parents[2] / "records" / "firm-soil.mseed"
    pair = read_horizontals(file, units="m/s^2")
    assert (pair.component, pair.first.pga) == (
        "HN1+HN2",
        read_record(file, units="m/s^2", component="HN1").pga,
    )
