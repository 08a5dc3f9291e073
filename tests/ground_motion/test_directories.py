"""Directories, archives and patterns: each motion once, and no file lost without a message."""

import io
import zipfile
from pathlib import Path

import pytest
from tests.ground_motion.free_tables import accelerogram, column
from tests.peer_files import write_at2

from tdint.errors import RecordError
from tdint.ground_motion.choice import Processing, RecordChoice, TextLayout
from tdint.ground_motion.reading.contents import other_content, read_all_contents
from tdint.ground_motion.reading.other_files import repeated_motions
from tdint.ground_motion.reading.suites import read_suite, records_of

NUMBERS = column(accelerogram(400, 0.3))
WITHOUT_HEADER = f"Run 5\nstarted at noon\n{NUMBERS}"
SEARCH = (
    '"PEER Ground Motion Database -- NGA-West2"\n\n-- Scaled Spectra used in Search & Scaling --\n'
    "Period (sec), Target pSa (g)\n0.01, 0.5\n0.02, 0.6\n0.03, 0.7\n"
)
OTHER_FILES = {
    "README.txt": ("document", "1 2\n3 4\n5 6\n"),
    "notes.txt": ("no numbers", "Records of a station\n"),
    "report.pdf": ("document", "%PDF-1.4\n1 2\n3 4\n"),
    "_SearchResults.csv": ("table of a search", SEARCH),
    "flat.csv": ("table of a search", "Record Sequence Number,Mw\n1,7\n2,7\n"),
    "factors.csv": ("description or list of records", "record,component,factor\na.AT2,000,1\n"),
    "a.json": ("description or list of records", '{"schema": {"name": "tdint info"},\n1,\n2\n}'),
    "set.yaml": ("document", "files:\n  - a.txt\n"),
    "a.v3": ("spectrum", f"RESPONSE SPECTRA OF A RECORD\n{NUMBERS}"),
}
UNREADABLE = {
    "a.txt": WITHOUT_HEADER,
    "b.csv": "Run 5 of the table\nstarted 10:00\na b c\n" + "0.1 0.2 0.3\n" * 30,
    "c.AT2": "cut off",
    "d.mseed": "cut off",
    "e.xlsx": "PK\x03\x04",
    "f.gz": "\x1f\x8b",
    "g": NUMBERS,
}


def peer_folder(folder: Path) -> list[str]:
    """Write two recordings as PEER delivers them; return the names of the horizontals."""
    folder.mkdir()
    for number, station in ((1, "AAA"), (2, "BBB")):
        for seed, component in enumerate(("000", "090", "-UP")):
            for quantity in "ACCELERATION", "VELOCITY", "DISPLACEMENT":
                file = folder / f"RSN{number}_TEST_{station}{component}.{quantity[0]}T2"
                values = accelerogram(200, 0.2, 10 * number + seed)
                write_at2(file, f"Test, 1/2/1999, {station}, {component.strip('-')}", values)
                units = {"A": "G", "V": "CM/S", "D": "CM"}[quantity[0]]
                text = file.read_text().replace("ACCELERATION", quantity)
                file.write_text(text.replace("UNITS OF G", f"UNITS OF {units}"))
    (folder / "_SearchResults.csv").write_text(SEARCH)
    return [
        str(folder / f"RSN{number}_TEST_{station}{component}.AT2")
        for number, station in ((1, "AAA"), (2, "BBB"))
        for component in ("000", "090")
    ]


@pytest.mark.parametrize("name", OTHER_FILES)
def test_other_files_are_listed(tmp_path, name):
    content, text = OTHER_FILES[name]
    (tmp_path / name).write_text(text)
    (tmp_path / "motion.txt").write_text(f"# dt = 0.01 s, units = g\n{NUMBERS}")
    suite = read_suite([str(tmp_path)], RecordChoice())
    assert len(suite.records) == 1
    assert not suite.failures
    assert f"{tmp_path}: not used: {name} ({content})" in suite.notes
    assert "1 of 2 files used" in suite.notes


@pytest.mark.parametrize("name", UNREADABLE)
def test_unreadable_data_are_errors(tmp_path, name):
    """A file with numbers, or with a suffix of data, is an error as if it were named."""
    (tmp_path / name).write_text(UNREADABLE[name], "latin-1")
    (tmp_path / "motion.txt").write_text(f"# dt = 0.01 s, units = g\n{NUMBERS}")
    suite = read_suite([str(tmp_path)], RecordChoice())
    assert len(suite.records) == 1
    (failure,) = suite.failures
    assert str(tmp_path / name) in str(failure)
    with pytest.raises(RecordError):
        read_all_contents((tmp_path / name).read_bytes(), name)
    assert "1 of 2 files used" in suite.notes


def test_folder_of_peer(tmp_path):
    """The three files of a component are one motion, in a directory, by a pattern, by their names
    and in an archive."""
    names = peer_folder(tmp_path / "peer")
    files = sorted(map(str, (tmp_path / "peer").glob("*.?T2")))
    for arguments in ([str(tmp_path / "peer")], [str(tmp_path / "peer" / "*T2")], files):
        suite = read_suite(arguments, RecordChoice())
        assert [record.source for record in suite.records] == names
        assert not suite.failures
        assert any("-UP.AT2: not used: vertical component" in note for note in suite.notes)
        assert any("RSN1_TEST_AAA000.VT2" in note for note in suite.notes)
    found = {
        tuple(suite.notes)[-1] for suite in [read_suite([str(tmp_path / "peer")], RecordChoice())]
    }
    assert found == {"4 of 19 files used"}

    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for file in (tmp_path / "peer").iterdir():
            archive.write(file, file.name)
    parts = read_all_contents(stream.getvalue(), "peer.zip")
    assert {Path(name).suffix for name, _ in parts} == {".AT2"}
    assert len(parts) == 6
    assert "_SearchResults.csv (table of a search)" in parts[0][1].notes[0]


def test_vertical_alone_is_an_error(tmp_path):
    write_at2(tmp_path / "A-UP.AT2", "Test, 1/2/1999, AAA, UP", accelerogram(200, 0.2))
    suite = read_suite([str(tmp_path)], RecordChoice())
    assert "no horizontal component" in str(suite.failures[0])


@pytest.mark.parametrize(
    ("names", "repeated"),
    [
        (("a.AT2", "a.VT2", "a.DT2"), {"a.VT2": "velocity", "a.DT2": "displacement"}),
        (("a.VT2", "a.DT2"), {"a.DT2": "displacement"}),
        (("a.VT2",), {}),
        (("x/a.AT2", "y/a.VT2"), {}),
        (("a.AT2", "b.VT2"), {}),
        (
            ("I.S..HNE.D.E.C.ACC.ASC", "I.S..HNE.D.E.C.VEL.ASC"),
            {"I.S..HNE.D.E.C.VEL.ASC": "velocity"},
        ),
        (("s_acc.txt", "s_disp.txt"), {"s_disp.txt": "displacement"}),
        (("s.acc", "s.vel", "s.dis"), {"s.vel": "velocity", "s.dis": "displacement"}),
        (("s.V1", "s.V2"), {"s.V1": "uncorrected acceleration"}),
        (("accent.txt", "velent.txt"), {}),
    ],
)
def test_quantities_of_one_motion(names, repeated):
    assert repeated_motions(names) == repeated


def test_pattern(tmp_path):
    for name in ("b.txt", "a.txt"):
        (tmp_path / name).write_text(f"# dt = 0.01 s, units = g\n{NUMBERS}")
    pattern = str(tmp_path / "*.txt")
    assert records_of([pattern], RecordChoice()).files == tuple(
        str(tmp_path / name) for name in ("a.txt", "b.txt")
    )
    (failure,) = records_of([str(tmp_path / "*.AT2")], RecordChoice()).failures
    assert "no file matches this pattern" in str(failure)
    # A name with brackets is a file, not a pattern.
    (tmp_path / "c[1].txt").write_text(f"# dt = 0.01 s, units = g\n{NUMBERS}")
    assert records_of([str(tmp_path / "c[1].txt")], RecordChoice()).files


def test_options_of_a_description(tmp_path):
    """Each file is read with the options of the description that contains it."""
    folder = tmp_path / "columns"
    folder.mkdir()
    (folder / "a.dat").write_text(NUMBERS)
    (tmp_path / "b.txt").write_text(NUMBERS)
    described = (
        (str(folder), RecordChoice(units="g", layout=TextLayout(step=0.01))),
        (
            str(tmp_path / "*.txt"),
            RecordChoice(
                units="gal", layout=TextLayout(step=0.02), processing=Processing(trim=(None, 1.0))
            ),
        ),
    )
    suite = read_suite([str(folder), str(tmp_path / "b.txt")], RecordChoice(described=described))
    first, second = suite.records
    assert (first.dt, second.dt) == (0.01, 0.02)
    assert first.pga == pytest.approx(0.3 * 9.80665, rel=1e-5)
    assert second.acceleration.size == 51


def test_other_content_of_a_file_that_cannot_be_read(tmp_path):
    assert other_content(tmp_path / "missing") == ""
