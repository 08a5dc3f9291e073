"""Tests of zip files of records, which are read in memory and with limits."""

import io
import zipfile

import numpy as np
import pytest

from ground_motion import format_files as files
from ground_motion.files import refused, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.reading import contents
from tdint.ground_motion.reading.contents import other_content
from tdint.ground_motion.reading.read import read_record, read_records


def packed(members, compression=zipfile.ZIP_DEFLATED):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


@pytest.fixture
def path(tmp_path):
    mseed = write(tmp_path / "m", trace(wave(), channel="HNZ")).read_bytes()
    inner = packed(
        {"deep/b.csv": "time_s,HNE_gal\n" + "".join(f"{i * 0.02:.2f},{i}\n" for i in range(50))}
    )
    members = {
        "a.AT2": files.at2(),
        "z/m.mseed": mseed,
        "README.txt": "words\n",
        "inner.zip": inner,
        ".x": "1\n2\n",
    }
    path = tmp_path / "event.zip"
    path.write_bytes(packed(members))
    return path


def test_all_members_of_known_formats_are_read(path):
    records = read_records(path)
    assert [(record.source.removeprefix(str(path)), record.component) for record in records] == [
        ("/a.AT2", "067"),
        ("/z/m.mseed", "HNZ"),
        ("/inner.zip/deep/b.csv", "HNE"),
    ]
    assert [record.dt for record in records] == [0.005, 0.01, 0.02]
    np.testing.assert_array_equal(records[1].acceleration, wave())
    assert all(
        record.inputs == records[0].inputs and record.inputs[0].file == str(path)
        for record in records
    )


def test_a_member_outside_the_archive_is_read_as_if_it_were_inside(tmp_path):
    """Nothing is written, so the member is a record like any other, and no name leaves the file."""
    (tmp_path / "a.zip").write_bytes(packed({"../../up/./a.AT2": files.at2()}))
    (record,) = read_records(tmp_path / "a.zip")
    assert record.source == f"{tmp_path / 'a.zip'}/up/a.AT2"


def test_single_member_is_selected_by_component(path):
    assert read_record(path, component="067").pga == pytest.approx(1.5 * 9.80665)
    refused(path, "choose one by `component`: 067, HNZ, HNE")
    refused(path, "component 'X' not found", component="X")


def test_members_without_different_codes_are_selected_by_the_names_in_the_message(tmp_path):
    """The message listed names that could not be selected, also one name for several columns."""
    step = "".join(f"{i * 0.02:.2f},{i},-{i}\n" for i in range(50))
    members = {
        f"r{scale}.csv": f"time_s,N_{unit},E_{unit}\n{step}"
        for scale, unit in ((1, "gal"), (2, "g"))
    }
    path = tmp_path / "a.zip"
    path.write_bytes(packed(members))
    with pytest.raises(RecordError, match="choose one by `component`: ") as error:
        read_record(path)
    names = str(error.value).partition("`component`: ")[2].split(", ")
    chosen = [read_record(path, component=name) for name in names]
    assert [record.digest for record in chosen] == [record.digest for record in read_records(path)]
    assert len({record.name for record in chosen}) == 4


def test_archive_without_records_is_refused(tmp_path):
    (tmp_path / "a.zip").write_bytes(packed({"a.txt": "words\n"}))
    refused(tmp_path / "a.zip", r"contains no record of a supported format; it contains a\.txt")


def test_corrupt_archive_is_detected_by_checksum(tmp_path, path):
    data = bytearray(packed({"a.AT2": files.at2()}, zipfile.ZIP_STORED))
    data[data.index(b"DT= .00500") + 6] = ord("9")
    complete = path.read_bytes()
    damaged = tmp_path / "b.zip"
    for content, message in (
        (data, "Bad CRC"),
        *((complete[:size], "corrupt") for size in (10, 100, len(complete) - 30)),
    ):
        damaged.write_bytes(content)
        refused(damaged, message)


def test_decompression_bomb_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(contents, "MAX_FILE_BYTES", 2**20)
    (tmp_path / "a.zip").write_bytes(packed({"a": bytes(2**19), "b": bytes(2**21)}))
    with pytest.raises(RecordError, match="larger than 256 MiB uncompressed"):
        read_records(tmp_path / "a.zip")


def test_only_zip_archives_count_as_records_of_directory(tmp_path, path):
    (tmp_path / "table.docx").write_bytes(path.read_bytes())
    assert other_content(path) == ""
    assert other_content(tmp_path / "table.docx") == "document"
