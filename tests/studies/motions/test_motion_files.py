"""Ground motions written as files: pairs are recognized again when they are read."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import tdint
from selection import every
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import Horizontals, PairNames, motion_names
from tdint.ground_motion.origin import MotionOrigin
from tdint.ground_motion.reading.read import read_horizontals, read_record, read_records
from tdint.ground_motion.reading.suites import read_suite
from tdint.ground_motion.record import Record
from tdint.studies.motions.motion_files import motion_contents, motion_file_names

FORMATS = ("mseed", "at2", "csv")

PEER = "PEER NGA STRONG MOTION DATABASE RECORD\n{}\nACCELERATION TIME SERIES IN UNITS OF G\n{}"

# Sources of two components: files, ids (network, station, location, channel), event and start, and
# the station (at most five characters) and channels in MiniSEED.
CONVENTIONS = {
    "peer": (
        ("RSN763_LOMAP_GIL067.AT2", "RSN763_LOMAP_GIL337.AT2"),
        (".Gilroy-Gavilan-Coll..67", ".Gilroy-Gavilan-Coll..337"),
        ("Loma Prieta 10/18/1989", ""),
        ("Gilro", "67", "337"),
    ),
    "peer, suffix apart": (
        ("A-067.AT2", "A-337.AT2"),
        (".GIL..067", ".GIL..337"),
        ("", ""),
        ("GIL", "067", "337"),
    ),
    "k-net": (
        ("AOM0051801241951.NS", "AOM0051801241951.EW"),
        ("BO.AOM005..NS", "BO.AOM005..EW"),
        ("", "2018-01-24T10:51:25.000000Z"),
        ("AOM00", "NS", "EW"),
    ),
    "kik-net": (
        ("AICH040010061330.NS2", "AICH040010061330.EW2"),
        ("BO.AICH04..NS2", "BO.AICH04..EW2"),
        ("", "2000-10-06T04:31:09.000000Z"),
        ("AICH0", "NS2", "EW2"),
    ),
    "network": (
        ("CI.CLC..HNE.mseed", "CI.CLC..HNN.mseed"),
        ("CI.CLC..HNE", "CI.CLC..HNN"),
        ("", "2019-07-06T03:19:53.040000Z"),
        ("CLC", "HNE", "HNN"),
    ),
    "one file": (
        ("20180212_WPWS_20.V2A", "20180212_WPWS_20.V2A"),
        (".WPWS..S16W", ".WPWS..S74E"),
        ("", "2018-02-12T21:15:17.000000Z"),
        ("WPWS", "196", "106"),
    ),
    "one file of channels": (
        ("CE89146.V1", "CE89146.V1"),
        (".89146.1.360", ".89146.3.90"),
        ("Lytle Creek", "2012-02-13T21:06:45.000000Z"),
        ("89146", "360", "90"),
    ),
    "letters": (("yard_X.txt", "yard_Y.txt"), ("...X", "...Y"), ("", ""), ("", "X", "Y")),
    "fault": (
        ("site-FN.txt", "site-FP.txt"),
        (".S..FN", ".S..FP"),
        ("Kocaeli", ""),
        ("S", "FN", "FP"),
    ),
    "no names": (("left.txt", "right.txt"), ("...", "..."), ("", ""), ("", "H1", "H2")),
    "long and transverse": (
        ("a_long.txt", "a_trans.txt"),
        (".S..LONG", ".S..TRANS"),
        ("", ""),
        ("S", "HN1", "HN2"),
    ),
}


def components(convention, seed=0):
    files, ids, (event, start), _ = CONVENTIONS[convention]
    samples = np.random.default_rng(seed).standard_normal((2, 400))
    return tuple(
        Record(row, 0.01, start, id, id.split(".")[-1], f"in/{file}", event=event)
        for row, id, file in zip(samples, ids, files, strict=True)
    )


def write(folder: Path, motions, suffix):
    names = motion_file_names(motions, suffix)
    contents, notes = motion_contents(motions, suffix)
    for name, content in zip(names, contents, strict=True):
        (folder / name).write_bytes(content)
    return names, notes


TARGET = "ec8:type=1,soil=B,ag=0.25g"
ORIGINS = {
    "matched": MotionOrigin(
        "in/ünit, cm; dt = 0.02, NPTS= 5, DT= 0.5.mseed",
        "HNE",
        ("matched to " + TARGET,),
        TARGET,
        1.23456789012345678,
        0.51,
        0.04,
        0.01,
        ("velocity time series in units of cm/s # start = 2000-01-01", '"quoted"'),
    ),
    "processed": MotionOrigin("a.mseed", "HNN", ("highpass 0.2 Hz: Butterworth filter",)),
    "long steps": MotionOrigin("a.mseed", "1", ("x" * 2000,), TARGET, 2.0, 0.1, 0.1, 0.1),
    "long warnings": MotionOrigin("a", "1", (), TARGET, 2.0, 0.1, 0.1, 0.1, ("y" * 600,) * 2),
    "long name": MotionOrigin("a" * 2000, "1", (), TARGET, 2.0, 0.1, 0.1, 0.1),
}


@pytest.mark.parametrize("suffix", ["at2", "csv"])
@pytest.mark.parametrize("name", ORIGINS)
def test_a_header_states_the_origin_and_nothing_else(name, suffix, tmp_path):
    """The origin is read again with 12 digits from one line, and the rest of the file and of the
    record is the same as without it."""
    origin, (source, _) = ORIGINS[name], components("peer")
    (plain,), _ = motion_contents([source], suffix)
    (content,), _ = motion_contents([source], suffix, [origin])
    records = []
    for file, data in (("plain", plain), ("stated", content)):
        (tmp_path / f"{file}.{suffix}").write_bytes(data)
        records.append(read_record(tmp_path / f"{file}.{suffix}"))
    without, record = records
    assert np.array_equal(without.acceleration, record.acceleration)
    for attribute in ("dt", "start", "id", "event", "units", "quantity", "warnings"):
        assert getattr(without, attribute) == getattr(record, attribute)
    assert without.origin is None
    # One line differs, and a fixed-length reader has the lines of a file of PEER.
    changed = set(content.splitlines()) - set(plain.splitlines())
    if name == "long name":
        assert content == plain and record.origin is None
        return
    (line,) = changed
    assert len(line) < 1000 and line.isascii()
    if suffix == "at2":
        assert content.splitlines()[1:] == plain.splitlines()[1:]
        assert line.startswith(b"PEER ")
    expected = {
        "long steps": origin._replace(processing=()),
        "long warnings": origin._replace(warnings=("2 warnings stated by tdint match",)),
    }.get(name, origin._replace(factor=float(f"{origin.factor:.12g}")))
    assert expected._replace(**numbers(record.origin)) == record.origin
    assert numbers(record.origin) == pytest.approx(numbers(expected), nan_ok=True)
    assert record.processing == expected.processing
    assert (record.origin.text in record.notes) == bool(origin.target)
    # Changed samples are no longer the motion of the statement; another statement is the user's.
    (other,), _ = motion_contents([source.scaled(1.001)], suffix)
    edited = b"\n".join([line, *other.splitlines()[suffix == "at2" :]]) + b"\n"
    (tmp_path / f"edited.{suffix}").write_bytes(edited)
    assert read_record(tmp_path / f"edited.{suffix}").origin is None
    broken = content.replace(b'"seed"', b'"sead"').replace(b'{"', b'["', 1)
    (tmp_path / f"broken.{suffix}").write_bytes(broken)
    assert read_record(tmp_path / f"broken.{suffix}").origin is None


def numbers(origin):
    return {name: getattr(origin, name) for name in ("change", "largest_misfit", "mean_misfit")}


def station(record):
    return record.id.split(".")[1]


@pytest.mark.parametrize(("convention", "suffix"), every(4, product(CONVENTIONS, FORMATS)))
def test_a_written_pair_is_recognized_as_a_pair(convention, suffix, tmp_path):
    """The pair is recognized from the file names, from the directory and from both files, with
    station, component and event."""
    first, second = components(convention)
    names, _ = write(tmp_path, [Horizontals(first, second)], suffix)
    assert len(set(names)) == 2 and len(set(motion_names(names))) == 1
    folder = read_suite([str(tmp_path)], RecordChoice(), PairNames())
    assert not folder.failures and len(folder.motions) == 1
    for pair in (folder.motions[0], read_horizontals(*(tmp_path / name for name in names))):
        assert isinstance(pair, Horizontals)
        assert sum(np.ptp(record.acceleration) for record in (pair.first, pair.second)) == (
            pytest.approx(np.ptp(first.acceleration) + np.ptp(second.acceleration), rel=1e-6)
        )
    short, *channels = CONVENTIONS[convention][3]
    for name, source, channel in zip(names, (first, second), channels, strict=True):
        (record,) = read_records(tmp_path / name)
        assert np.allclose(record.acceleration, source.acceleration, rtol=1e-8, atol=1e-8)
        assert record.start == source.start
        if suffix == "mseed":
            assert (station(record), record.component) == (short, channel)
        else:
            assert station(record) == station(source)
            assert record.component == (source.component or f"H{(source is second) + 1}")
            assert record.event == source.event
    # The file names contain the stem of the source, and therefore the event of PEER files.
    if convention in ("no names", "long and transverse"):
        common = "left" if convention == "no names" else "a"
        assert names == [f"{common}-H1.{suffix}", f"{common}-H2.{suffix}"]
    elif not convention.startswith(("k", "one")):
        assert names == [f"{Path(record.source).stem}.{suffix}" for record in (first, second)]
    else:
        ends = [
            f"{record.component:0>3}" if record.component.isdecimal() else record.component
            for record in (first, second)
        ]
        stem = Path(first.source).stem
        assert names == [f"{stem}-{end}.{suffix}" for end in ends]


@pytest.mark.parametrize("suffix", every(3, FORMATS))
def test_pairs_of_a_suite_remain_separate(suffix, tmp_path):
    """Pairs with equal names, and stations with five equal first characters, remain separate."""
    motions = []
    for number, convention in enumerate((*CONVENTIONS, "peer", "network")):
        first, second = components(convention, number)
        motions.append(Horizontals(first, second))
    last = [
        replace(r, id=f".Gilroy-Array-{r.component}.", source=f"in/B{r.component}.AT2")
        for r in components("peer", 99)
    ]
    last = [replace(record, id=f".Gilroy-Array-1..{record.component}") for record in last]
    motions.append(Horizontals(*last))
    names, notes = write(tmp_path, motions, suffix)
    assert len(set(names)) == 2 * len(motions)
    suite = read_suite([str(tmp_path)], RecordChoice(), PairNames())
    assert not suite.failures
    written = {
        tuple(sorted(np.round(np.ptp(record.acceleration), 6) for record in (m.first, m.second)))
        for m in motions
    }
    read = {
        tuple(sorted(np.round(np.ptp(record.acceleration), 6) for record in (m.first, m.second)))
        for m in suite.motions
    }
    assert read == written
    if suffix == "mseed":
        assert "Gilroy-Array-1 is written as Gilr2" in " ".join(notes)
    else:
        assert not notes


@pytest.mark.parametrize("suffix", FORMATS)
def test_single_components_are_later_recognized_as_pairs(suffix, tmp_path):
    records = [
        record for name in ("peer", "k-net", "network", "one file") for record in components(name)
    ]
    names, _ = write(tmp_path, records, suffix)
    assert len(set(names)) == len(records)
    suite = read_suite([str(tmp_path)], RecordChoice(), PairNames())
    assert len(suite.motions) == 4 and not suite.failures


def test_directions_pair_only_two_files_at_right_angles():
    """Numbers of ground motions in file names are not directions."""
    pair = ["x/GIL067.mseed", "x/GIL337.mseed"]
    assert motion_names(pair) == ["x/GIL?.mseed"] * 2
    assert motion_names(["x_S16W.csv", "x_S74E.csv"]) == ["x?.csv"] * 2
    for files in (["R010.csv", "R020.csv"], ["R000.csv", "R045.csv", "R090.csv"], ["R067.csv"]):
        assert motion_names(files) == files
    assert motion_names([*pair, pair[0]]) == ["x/GIL?.mseed"] * 3


def test_components_of_different_events_are_no_pair(tmp_path):
    for name, line in (
        ("A067.AT2", "Loma Prieta, 10/18/1989, GIL, 67"),
        ("A337.AT2", "Kobe, 1/16/1995, GIL, 337"),
    ):
        values = " ".join(
            f"{value:.6E}" for value in np.random.default_rng(len(line)).normal(size=50)
        )
        (tmp_path / name).write_text(PEER.format(line, f"NPTS= 50, DT= .01 SEC\n{values}\n"))
    suite = read_suite([str(tmp_path)], RecordChoice(), PairNames())
    assert read_record(tmp_path / "A067.AT2").event == "Loma Prieta 10/18/1989"
    (failure,) = suite.failures
    for part in ("A067.AT2", "A337.AT2", "different events", "Loma Prieta 10/18/1989", "Kobe 1/16"):
        assert part in str(failure)


def test_stations_and_channels_in_mseed_are_ascii(tmp_path):
    """MiniSEED permits only ASCII. The note names the station of the source."""
    samples = np.random.default_rng(0).standard_normal((3, 100))
    motions = [
        Record(row, 0.01, "", f".{name}..Ö", "Ö", f"in/{number}.txt")
        for number, (row, name) in enumerate(zip(samples, ("Düzce", "Duzce", "東京"), strict=True))
    ]
    names, notes = write(tmp_path, motions, "mseed")
    records = [read_records(tmp_path / name)[0] for name in names]
    assert [station(record) for record in records] == ["Duzce", "Duzc2", ""]
    assert [note.split(": ")[1].split()[0] for note in notes] == ["Düzce", "Duzce", "東京"]


def test_names_of_several_stations_of_a_file_keep_pairs(short_matching):
    """Single components of two stations are written with the station in the names of their files;
    with numbers in place of stations, they were no pairs."""
    motions = [
        Record(
            np.sin(np.arange(400.0) ** 1.2) * np.hanning(400),
            0.01,
            "",
            f"NZ.{station}..{code}",
            code,
            "a.mseed",
        )
        for station, code in (("S1", "HNE"), ("S1", "HNN"), ("S2", "HN1"), ("S2", "HN2"))
    ]
    motions = [replace(motion, is_one_of_several=True) for motion in motions]
    assert motion_file_names(motions, "at2") == [
        "a-NZ-S1-HNE.at2",
        "a-NZ-S1-HNN.at2",
        "a-NZ-S2-HN1.at2",
        "a-NZ-S2-HN2.at2",
    ]
    assert len(set(motion_names(motion_file_names(motions, "at2")))) == 2
    matched = tdint.match(motions[0], TARGET, periods=(0.1, 0.3))
    assert repr(matched).startswith("<Match of a.mseed NZ.S1..HNE: ")
