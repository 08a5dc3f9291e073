"""Tests of files that must be refused with a message, without a traceback and without executing any
content."""

import gzip
import io
import os
import pickle
import struct
import sys

import numpy as np
import pytest

from facts import states
from ground_motion.files import START, counts, refused, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.reading.read import make_record, read_record, read_records


class TestNoFile:
    def test_missing_file_and_directory_are_refused(self, tmp_path):
        refused(tmp_path / "none.mseed", "file not found")
        refused(tmp_path, "is a directory")

    def test_empty_file_is_refused(self, tmp_path, monkeypatch):
        (tmp_path / "a").touch()
        refused(tmp_path / "a", "is empty")
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
        refused("-", "is empty")

    @pytest.mark.parametrize("stdin", [None, io.StringIO("text")])
    def test_closed_standard_input_is_refused(self, monkeypatch, stdin):
        monkeypatch.setattr(sys, "stdin", stdin)
        refused("-", "standard input is closed")

    def test_file_without_permission_is_refused(self, tmp_path, monkeypatch):
        """The error is simulated, because the superuser may read every file."""

        def refuse(*_):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("pathlib.Path.open", refuse)
        refused(tmp_path / "a", "no permission")

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("a\0b", "cannot be read"),
            ("a" * 300, "cannot be read"),
            ("http://localhost/a.mseed", "addresses are not fetched"),
            ("file:///etc/hostname", "addresses are not fetched"),
        ],
    )
    def test_impossible_names_and_addresses_are_refused(self, name, message, monkeypatch):
        monkeypatch.setattr("socket.socket.connect", lambda *_: pytest.fail("went to the network"))
        refused(name, message)

    def test_wildcards_are_not_expanded(self, tmp_path):
        write(tmp_path / "a.mseed", trace(wave()))
        with pytest.raises(RecordError, match="wildcards are not expanded"):
            read_record(tmp_path / "*.mseed")

    def test_too_large_file_is_refused(self, tmp_path, monkeypatch):
        monkeypatch.setattr("tdint.ground_motion.reading.contents.MAX_FILE_BYTES", 4096)
        refused(write(tmp_path / "a", trace(wave())), "larger than")

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
    def test_named_pipe_is_refused(self, tmp_path):
        os.mkfifo(tmp_path / "pipe")
        refused(tmp_path / "pipe", "is a named pipe")
        reading, writing = os.pipe()
        try:
            os.write(writing, b"# dt = 1 s, units = g\n0\n1\n")
            os.close(writing)
            assert read_record(f"/dev/fd/{reading}").acceleration.size == 2
        finally:
            os.close(reading)


class TestNoRecord:
    @pytest.mark.parametrize(
        "data",
        [
            b"x", b"name: ten-story office\n", b"\0" * 4096, b"0.1 0.2 0.3\n" * 100,
            bytes(range(256)) * 20, b"D" * 600,
        ],
    )  # fmt: skip
    def test_unknown_format_is_refused(self, data):
        refused(
            data,
            "unknown format; supported formats: MSEED, KNET|select columns by `column`; also",
        )

    def test_compressed_file_is_refused(self):
        refused(gzip.compress(b"words"), r"compressed \(gzip\); uncompress it first")

    def test_pickled_stream_is_refused(self, tmp_path):
        refused(write(tmp_path / "a.mseed", trace(wave()), format="PICKLE"), "may execute code")

    @pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
    @pytest.mark.parametrize("start", [b"", b"obspy.core.stream"])
    def test_pickle_is_not_loaded(self, tmp_path, protocol, start):
        """The read() function of ObsPy loads this file, which creates the directory."""
        trap = tmp_path / "executed"

        class Crafted:
            def __reduce__(self):
                return os.mkdir, (str(trap),)

        refused(pickle.dumps((start, Crafted()), protocol), "unknown format")
        assert not trap.exists()

    def test_file_without_numeric_samples_is_refused(self, tmp_path):
        log = trace(np.frombuffer(b"door opened" * 3, dtype="S1"), channel="LOG")
        refused(write(tmp_path / "a", log), "no samples of ground motion")


class TestSamples:
    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_non_finite_samples_are_refused(self, tmp_path, bad):
        data = wave()
        data[[250, 300]] = bad
        message = (
            r"XX\.ABC\.00\.HNE: 2 of 1000 samples are not finite numbers, the first is "
            r"sample 250 .* at 2\.5 s"
        )
        refused(write(tmp_path / "a", trace(data)), message)

    def test_overflowing_or_single_sample_is_refused(self, tmp_path):
        refused(write(tmp_path / "a", trace([0.0, 1e308])), "not finite", units="1e9 g")
        refused(write(tmp_path / "a", trace([1.0])), "only one sample; a record needs at least two")

    def test_masked_samples_are_refused(self):
        masked = trace(wave())
        masked.data = np.ma.masked_greater(masked.data, 2.5)
        with pytest.raises(RecordError, match=r"samples? marked as missing"):
            make_record(masked)

    @pytest.mark.parametrize("delta", [0.0, np.inf, np.nan])
    def test_invalid_sampling_interval_is_refused(self, delta):
        odd = trace(wave())
        dict.__setitem__(odd.stats.__dict__, "delta", delta)
        with pytest.raises(RecordError, match="sampling interval must be positive"):
            make_record(odd)

    def test_start_time_beyond_calendar_is_refused(self, tmp_path):
        data = bytearray(
            write(tmp_path / "a", trace(wave()), format="SAC", byteorder="<").read_bytes()
        )
        data[20:24] = struct.pack("<f", 1e18)  # B, the time of the first sample
        refused(data, "corrupt")


class TestCutOff:
    @pytest.mark.parametrize("length", [256, 4096])
    def test_miniseed_truncated_within_record_is_refused(self, tmp_path, length):
        complete = write(
            tmp_path / "a", trace(wave(800)), encoding="FLOAT64", reclen=length
        ).read_bytes()
        for size in range(len(complete) - 1, 0, -203):
            if size % length:
                refused(complete[:size], "corrupt|unknown format")
        (tmp_path / "cut").write_bytes(complete[:length])
        assert read_record(tmp_path / "cut").acceleration.size < 800

    @pytest.mark.parametrize("name", ["SAC", "GSE2", "SLIST", "TSPAIR"])
    def test_other_truncated_formats_are_refused(self, tmp_path, name):
        data = counts(300).astype(np.int32 if name == "GSE2" else np.float32)
        complete = write(tmp_path / "a", trace(data), format=name).read_bytes()
        for part in (0.3, 0.6, 0.9, 0.97):
            (tmp_path / "cut").write_bytes(complete[: int(part * len(complete))])
            refused(tmp_path / "cut", "corrupt|unknown format", units="1 gal")

    def test_station_code_with_dot_is_read(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(), station="A.B"), format="SH_ASC")
        assert read_record(path, units="m/s^2").acceleration.size == 1000


class TestFilesCrashingReaders:
    """Tests of files with which the C readers of ObsPy crash or do not return."""

    def test_gse2_with_excessive_samples_is_refused(self, tmp_path):
        data = write(tmp_path / "a", trace(counts()), format="GSE2").read_bytes()
        refused(
            data.replace(b"    1000 ", b"90001000 "),
            "states 90001000 samples, but the section has 1000",
        )

    def test_nothing_reaches_standard_error(self, tmp_path, capfd):
        data = bytearray(write(tmp_path / "a", trace(counts()), reclen=512).read_bytes())
        data[8] = (
            # A station code that is not ASCII causes an error in the callback of ObsPy for
            # messages.
            0xE4
        )
        data[700] ^= 0xFF
        refused(data, "corrupt")
        assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("slip", "noted"), [(0.0, False), (0.0005, False), (0.001, True), (-0.002, True), (0.005, True)]
)
def test_time_gap_below_sampling_interval_is_noted(tmp_path, slip, noted):
    """The sampling rate is 100 Hz, and libmseed joins records with gaps up to half a sampling
    interval. The larger of two gaps is reported."""
    samples = np.sin(0.1 * np.arange(2000)).reshape(4, 500)
    starts = (START, START + 5.0, START + 10.0 + slip, START + 15.0 + 0.4 * slip)
    pieces = [trace(piece, start=start) for piece, start in zip(samples, starts, strict=True)]
    (record,) = read_records(
        write(tmp_path / "x.mseed", *pieces, encoding="FLOAT64"), units="m/s^2"
    )
    assert record.acceleration.size == 2000
    notes = [text for text in record.notes if "overlap" in text]
    assert len(notes) == noted
    if noted:
        count = "1 time gap or overlap" if abs(0.6 * slip) < 0.001 else "2 time gaps or overlaps"
        assert states(notes[0], f"{count} ... XX.ABC.00.HNE, ... (largest: {1e3 * slip:+.3g} ms ")
