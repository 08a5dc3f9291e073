"""Files that must be refused: with a message, without a traceback, without running anything."""

import gzip
import io
import os
import pickle
import struct
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ground_motion.files import counts, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.reading.contents import read_contents
from tdint.ground_motion.reading.read import make_record, read_record, read_records


def refused(path, message, **options):
    with pytest.raises(RecordError, match=message) as caught:
        read_record(path, **options)
    assert str(caught.value).startswith(f"{path}: ")
    assert caught.value.exit_code == 4


class TestNoFile:
    def test_missing(self, tmp_path):
        refused(tmp_path / "none.mseed", "no such file")

    def test_directory(self, tmp_path):
        refused(tmp_path, "is a directory")

    def test_empty(self, tmp_path):
        (tmp_path / "a").touch()
        refused(tmp_path / "a", "is empty")

    @pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="the superuser may read everything")
    def test_no_permission(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()))
        path.chmod(0)
        refused(path, "no permission")

    def test_no_permission_whoever_runs_the_tests(self, tmp_path, monkeypatch):
        def refuse(*_):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("pathlib.Path.open", refuse)
        refused(tmp_path / "a", "no permission")

    @pytest.mark.parametrize("name", ["a\0b", "a" * 300])
    def test_impossible_name(self, name):
        refused(name, "cannot be read")

    @pytest.mark.parametrize("name", ["http://localhost/a.mseed", "file:///etc/hostname"])
    def test_addresses_are_not_fetched(self, name, monkeypatch):
        monkeypatch.setattr("socket.socket.connect", lambda *_: pytest.fail("went to the network"))
        refused(name, "addresses are not fetched")

    def test_wildcards_are_not_expanded(self, tmp_path):
        write(tmp_path / "a.mseed", trace(wave()))
        with pytest.raises(RecordError, match="wildcards are not expanded"):
            read_record(tmp_path / "*.mseed")

    def test_too_large(self, tmp_path, monkeypatch):
        monkeypatch.setattr("tdint.ground_motion.reading.contents.LARGEST", 4096)
        refused(write(tmp_path / "a", trace(wave())), "larger than")

    def test_empty_standard_input(self, monkeypatch):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
        refused("-", "is empty")

    @pytest.mark.parametrize("stdin", [None, io.StringIO("text")])
    def test_no_standard_input(self, monkeypatch, stdin):
        monkeypatch.setattr(sys, "stdin", stdin)
        refused("-", "no standard input")


class TestNoRecord:
    @pytest.mark.parametrize(
        "data",
        [b"x", b"name: ten-story office\n", b"\0" * 4096, b"0.1 0.2 0.3\n" * 100, bytes(range(256)) * 20, b"D" * 600],
    )
    def test_unknown_format(self, tmp_path, data):
        (tmp_path / "a.mseed").write_bytes(data)
        refused(tmp_path / "a.mseed", "unknown format.*; those that are read: MSEED, KNET")

    def test_compressed(self, tmp_path):
        path = tmp_path / "a.mseed.gz"
        path.write_bytes(gzip.compress(write(tmp_path / "a", trace(wave())).read_bytes()))
        refused(path, r"compressed \(gzip\); uncompress it first")

    def test_pickled_stream(self, tmp_path):
        refused(write(tmp_path / "a.mseed", trace(wave()), format="PICKLE"), "loading one can run code")

    @pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
    @pytest.mark.parametrize("start", [b"", b"obspy.core.stream"])
    def test_pickle_is_not_loaded(self, tmp_path, protocol, start):
        """ObsPy's own read() loads this file, and so creates the other one."""
        trap = tmp_path / "executed"

        class Crafted:
            def __reduce__(self):
                return os.mkdir, (str(trap),)

        (tmp_path / "a.mseed").write_bytes(pickle.dumps((start, Crafted()), protocol))
        refused(tmp_path / "a.mseed", "unknown format")
        assert not trap.exists()

    def test_no_numbers(self, tmp_path):
        log = trace(np.frombuffer(b"door opened" * 3, dtype="S1"), channel="LOG")
        refused(write(tmp_path / "a", log), "no samples of ground motion")


class TestSamples:
    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_not_finite(self, tmp_path, bad):
        data = wave()
        data[[250, 300]] = bad
        path = write(tmp_path / "a", trace(data))
        refused(
            path, r"XX\.ABC\.00\.HNE: 2 of 1000 samples are not finite numbers, the first is sample 250 .* at 2\.5 s"
        )

    def test_too_large_in_these_units(self, tmp_path):
        refused(write(tmp_path / "a", trace([0.0, 1e308])), "not finite", units="1e9 g")

    def test_one_sample(self, tmp_path):
        refused(write(tmp_path / "a", trace([1.0])), "one sample only")

    def test_masked(self, monkeypatch):
        masked = trace(wave())
        masked.data = np.ma.masked_greater(masked.data, 2.5)
        with pytest.raises(RecordError, match=r"samples? marked as missing"):
            make_record(masked)

    @pytest.mark.parametrize("delta", [0.0, np.inf, np.nan])
    def test_sampling_interval(self, delta):
        odd = trace(wave())
        dict.__setitem__(odd.stats.__dict__, "delta", delta)
        with pytest.raises(RecordError, match="sampling interval is"):
            make_record(odd)

    def test_time_beyond_the_calendar(self, tmp_path):
        data = bytearray(write(tmp_path / "a", trace(wave()), format="SAC", byteorder="<").read_bytes())
        data[20:24] = struct.pack("<f", 1e18)  # B, the time of the first sample
        (tmp_path / "a").write_bytes(data)
        refused(tmp_path / "a", "damaged")


class TestCutOff:
    @pytest.mark.parametrize("length", [256, 4096])
    def test_mseed_anywhere_but_between_records(self, tmp_path, length):
        whole = write(tmp_path / "a", trace(wave(3000)), encoding="FLOAT64", reclen=length).read_bytes()
        for size in range(len(whole) - 1, 0, -101):
            cut = tmp_path / "cut"
            cut.write_bytes(whole[:size])
            if size % length:
                refused(cut, "damaged|unknown format")
            elif size:
                assert read_record(cut).acceleration.size < 3000

    @pytest.mark.parametrize("byteorder", ["<", ">"])
    def test_mseed_by_half_a_record(self, tmp_path, byteorder):
        whole = write(tmp_path / "a", trace(counts()), reclen=512, byteorder=byteorder).read_bytes()
        (tmp_path / "a").write_bytes(whole[:-256])
        refused(tmp_path / "a", "its last record has 256 of 512 bytes; fetch it again", units="1 gal")

    def test_mseed_with_blank_records(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), reclen=512)
        path.write_bytes(path.read_bytes() + b" " * 512)
        assert read_record(path).pga == 3.0

    def test_mseed_with_a_lost_record(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), reclen=512)
        data = path.read_bytes()
        path.write_bytes(data[:1024] + data[1536:])
        refused(path, "a gap of")

    def test_mseed_with_a_spoilt_record(self, tmp_path):
        path = write(tmp_path / "a", trace(counts(5000)), encoding="STEIM2", reclen=512)
        data = bytearray(path.read_bytes())
        data[1024 + 200] ^= 0x55
        path.write_bytes(data)
        refused(path, "damaged", units="1 gal")

    @pytest.mark.parametrize("name", ["SAC", "GSE2", "SLIST", "TSPAIR", "SH_ASC"])
    def test_other_formats(self, tmp_path, name):
        data = counts(300).astype(np.int32 if name == "GSE2" else np.float32)
        whole = write(tmp_path / "a", trace(data), format=name).read_bytes()
        for part in (0.3, 0.6, 0.9, 0.97):
            (tmp_path / "cut").write_bytes(whole[: int(part * len(whole))])
            refused(tmp_path / "cut", "damaged|unknown format", units="1 gal")

    def test_channel_that_obspy_leaves_out(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), trace(wave(), channel="HNN"), format="SH_ASC")
        path.write_bytes(path.read_bytes().rstrip())
        refused(path, "it has 2 headers of channels, 1 could be read", component="HNE")


class TestWhatCrashesTheReaders:
    """Files that end ObsPy's readers in C with a crash, or never."""

    def test_gse2_with_a_long_line(self, tmp_path):
        path = write(tmp_path / "a", trace(counts()), format="GSE2")
        path.write_bytes(path.read_bytes().replace(b"DAT2\n", b"DAT2\n" + b"U" * 100000 + b"\n"))
        refused(path, "longer than 81 characters")

    def test_gse2_with_more_samples_announced(self, tmp_path):
        path = write(tmp_path / "a", trace(counts()), format="GSE2")
        path.write_bytes(path.read_bytes().replace(b"    1000 ", b"90001000 "))
        refused(path, "states 90001000 samples, there are 1000")

    def test_gse2_with_foreign_characters(self, tmp_path):
        path = write(tmp_path / "a", trace(counts()), format="GSE2")
        data = bytearray(path.read_bytes())
        data[data.index(b"DAT2") + 20] = 0xC3
        path.write_bytes(data)
        refused(path, "none of the compression's")

    def test_gse2_without_end(self, tmp_path):
        path = write(tmp_path / "a", trace(counts()), format="GSE2")
        path.write_bytes(path.read_bytes().replace(b"CHK2", b"CHK3"))
        refused(path, "without DAT2, CHK2")

    @pytest.mark.parametrize("order", ["<", ">"])
    def test_sac_with_an_endless_longitude(self, tmp_path, order):
        path = write(tmp_path / "a", trace(wave()), format="SAC", byteorder=order)
        data = bytearray(path.read_bytes())
        data[4 * 31 : 4 * 37] = struct.pack(f"{order}6f", 10.0, 1e30, 0.0, 0.0, 10.0, 10.0)
        path.write_bytes(data)
        refused(path, r"longitude of 1e\+30")

    def test_nothing_reaches_standard_error(self, tmp_path, capfd):
        path = write(tmp_path / "a", trace(counts()), reclen=512)
        data = bytearray(path.read_bytes())
        data[8] = 0xE4  # A station code that is not ASCII, on which ObsPy's callback for messages fails.
        data[700] ^= 0xFF
        path.write_bytes(data)
        with pytest.raises(RecordError):
            read_records(path, units="1 gal")
        assert capfd.readouterr() == ("", "")


def outcome(data):
    """Records, a RecordError, or a failed test."""
    try:
        contents = read_contents(data, "fuzz")
    except RecordError:
        return None
    return contents


@settings(max_examples=150, deadline=None, database=None)
@given(st.one_of(st.binary(min_size=1, max_size=600), st.text(min_size=1, max_size=300).map(str.encode)))
def test_any_bytes_give_an_error(data):
    assert outcome(data) is None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_named_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    refused(tmp_path / "pipe", "is a named pipe")
    reading, writing = os.pipe()
    try:
        os.write(writing, b"# dt = 1 s, units = g\n0\n1\n")
        os.close(writing)
        assert read_record(f"/dev/fd/{reading}").acceleration.size == 2
    finally:
        os.close(reading)


@pytest.mark.parametrize(
    ("slip", "noted"), [(0.0, False), (0.0005, False), (0.001, True), (-0.002, True), (0.005, True)]
)
def test_a_break_of_a_part_of_a_sample_is_told(tmp_path, slip, noted):
    """At 100 Hz; libmseed joins records up to half a sampling interval apart."""
    with quiet_import():
        from obspy import Stream, Trace, UTCDateTime
    stream = Stream()
    for piece in range(3):
        start = UTCDateTime(2020, 1, 1) + 5.0 * piece + (slip if piece == 2 else 0.0)
        samples = np.sin(0.1 * np.arange(500 * piece, 500 * (piece + 1)))
        stream += Trace(samples, {"channel": "HNE", "delta": 0.01, "starttime": start})
    file = tmp_path / "x.mseed"
    stream.write(str(file), format="MSEED", encoding="FLOAT64")
    (record,) = read_records(file, units="m/s^2")
    assert record.acceleration.size == 1500
    told = [text for text in record.notes if "break" in text]
    assert len(told) == noted
    if noted:
        assert "1 break between the records of ...HNE" in told[0] and f"{1e3 * slip:+.3g} ms" in told[0]
