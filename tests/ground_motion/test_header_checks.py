"""What a file says of itself is compared with what is read from it, format by format."""

import re
import struct
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from ground_motion.files import counts, need_obspy_data, refused, refused_by, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.header_checks import (
    evt_statements,
    gcf_statements,
    gse_statements,
    knet_statements,
    look_at_evt,
    look_at_gcf,
    look_at_gse,
    look_at_reftek,
    look_at_sac,
    look_at_timeseries,
    reftek_statements,
    sac_statements,
    timeseries_statements,
)
from tdint.ground_motion.miniseed_checks import Damaged, Statement, check_step, compare, last_place
from tdint.ground_motion.reading.contents import read_contents


class TestComparison:
    def test_names_what_was_compared_once(self):
        statements = [Statement("peak", 1.0, 1.0), Statement("step", 0.01, 0.0101, 2e-4), Statement("peak", 2.0, 2.0)]
        assert compare(statements) == ("peak", "step")
        assert compare([]) == ()

    @pytest.mark.parametrize("stated", [1.1, -1.0, float("nan"), float("inf")])
    def test_another_number(self, stated):
        with pytest.raises(RecordError, match=r"states a peak of .* g, what was read has 1 g"):
            compare([Statement("peak", stated, 1.0, 0.01, "g")])

    def test_a_measured_value_may_be_off_by_a_hundredth_with_a_word(self):
        with pytest.warns(UserWarning, match=r"states a peak of 1\.009"):
            compare([Statement("peak", 1.009, 1.0, measured=True)])
        with pytest.raises(RecordError):
            compare([Statement("peak", float("inf"), 1.0, measured=True)])


@pytest.mark.parametrize("dt", [1e-6, 0.005, 10.0])
def test_sampling_intervals_that_recorders_have(dt):
    check_step(dt)
    for other in (0.0, -dt, 0.99e-6, 10.01, float("nan"), float("inf")):
        with pytest.raises(RecordError, match="recorders have 1e-06 to 10 s"):
            check_step(other)


class TestSac:
    @pytest.fixture
    def data(self, tmp_path):
        return bytearray(write(tmp_path / "a", trace(wave().astype(np.float32)), format="SAC").read_bytes())

    def test_sound(self, data):
        compared = read_contents(bytes(data), "file").compared
        assert set(compared) == {
            "number of samples", "length (time of the last sample)", "peak (smallest sample)", "peak (largest sample)",
            "mean",
        }  # fmt: skip

    @pytest.mark.parametrize(
        ("word", "value", "match"),
        [
            (0, 0.02, r"time of the last sample\) of 9.98\d* s, what was read has 19.9"),
            (2, 9.81 * 3.0, r"largest sample\) of 29.4\d*, what was read has 3"),
            (1, -3.1, "smallest sample"),
            (56, 1.0, "mean of 1, what was read has"),
        ],
    )
    def test_another_number(self, data, word, value, match):
        struct.pack_into("<f", data, 4 * word, value)
        refused(data, match)

    def test_numbers_that_are_not_known(self, data):
        for word in (1, 2, 6, 56):
            struct.pack_into("<f", data, 4 * word, -12345.0)
        assert read_contents(bytes(data), "file").compared == ("number of samples",)

    @pytest.mark.parametrize("peak", [1e-4, 1e4])
    def test_a_peak_is_compared_with_the_peak(self, tmp_path, peak):
        """Whatever the units: a ten-thousandth of it is another number, a millionth is rounding."""
        samples = (wave() * peak / np.max(np.abs(wave()))).astype(np.float32)
        data = bytearray(write(tmp_path / "a", trace(samples), format="SAC").read_bytes())
        struct.pack_into("<f", data, 4 * 2, float(samples.max()) * (1.0 + 1e-6))
        assert "peak (largest sample)" in read_contents(bytes(data), "file").compared
        struct.pack_into("<f", data, 4 * 2, float(samples.max()) * (1.0 + 1e-4))
        refused(data, "largest sample")


class TestTimeSeries:
    @pytest.mark.parametrize("format", ["SLIST", "TSPAIR"])
    def test_more_or_fewer_samples(self, tmp_path, format):
        data = write(tmp_path / "a", trace(wave(300)), format=format).read_bytes()
        assert read_contents(data, "file").compared[0] == "number of samples"
        for stated in (b"294", b"306"):
            refused(data.replace(b"300 samples", stated + b" samples"), f"{stated.decode()}, what was read has 300")
        *lines, last = data.rstrip().split(b"\n")
        refused(b"\n".join([*lines, last, last, b""]), "what was read has 30")

    def test_times_beside_the_samples(self, tmp_path):
        data = write(tmp_path / "a", trace(wave(300)), format="TSPAIR").read_bytes()
        refused(re.sub(rb"100(\.0)? sps", b"50 sps", data), r"length of 2.99 s, what was read has 5.98 s")


@pytest.mark.parametrize(
    ("file", "compared", "place", "change", "message"),
    [
        (
            "kinemetrics/tests/data/BI008_MEMA-04823.evt", "checksum", 30_000, 4,
            r"frame \d+ states a checksum of \d+, its bytes have \d+",
        ),
        # Another stream, that begins where the first block ends
        (
            "gcf/tests/data/20160603_1955n.gcf", "number of samples", 1024 + 7, 1,
            "one stream of its blocks continues another one",
        ),
        *(
            (f"reftek/tests/data/{name}", "number of samples", 1024 + 21, 7, "packet 1|a packet's header")
            for name in ("225051000_00008656", "104800000_000093F8", "065520000_013EE8A0.rt130")
        ),
        (
            "reftek/tests/data/225051000_00008656", "number of samples", 1024 + 64 + 100, 64,
            r"packet 1: it states a last sample of -?\d+, its differences lead to",
        ),
    ],
)  # fmt: skip
def test_files_of_recorders(file, compared, place, change, message):
    """Sound ones, and with one byte changed; what else there is stands below, put together by hand."""
    data = bytearray(need_obspy_data(file).read_bytes())
    assert compared in read_contents(bytes(data), "file").compared
    data[place] ^= change
    refused(data, message)


class TestRecordersByHand:
    """Blocks and packets put together by hand; the readers of ObsPy do not come into it."""

    @staticmethod
    def block(records=250, compression=4, rate=100, clock=(3 << 17) + 40, stream=7):
        return struct.pack(">IIIBBBB", 1, stream, clock, 0, rate, compression, records).ljust(1024, b"\0")

    def test_gcf_counts_what_its_blocks_announce(self):
        assert [look_at_gcf(self.block(compression=code)) for code in (1, 2, 4)] == [250, 500, 1000]
        # Other bits of the same byte belong to the time; blocks of words have no rate and no samples.
        assert look_at_gcf(self.block(compression=8 + 2) + self.block(rate=0)) == 500
        (count, last) = gcf_statements(1000, [trace(counts(600)), trace(counts(400))])
        assert count.stated == count.found == 1000
        assert last.difference == 0.0

    @pytest.mark.parametrize(
        ("rate", "wrong", "message"),
        [
            *((100, wrong, "block 1 announces no samples") for wrong in ({"records": 251}, {"compression": 3})),
            (100, {"compression": 0}, "block 1 announces no samples that it can have"),
            *((0, wrong, "neither one of samples nor one of words") for wrong in ({"records": 0}, {"compression": 2})),
        ],
    )
    def test_gcf_blocks_that_there_are_not(self, rate, wrong, message):
        refused_by(look_at_gcf, self.block() + self.block(rate=rate, **wrong), message)

    @pytest.mark.parametrize(
        ("second", "day", "later", "same"),
        [(40, 3, 50, True), (40, 3, 51, False), (40, 4, 50, False), (86_395, 4, 5, True)],
    )
    def test_gcf_streams_that_continue_one_another(self, second, day, later, same):
        """1000 samples at 100 Hz end 10 s later, across midnight, too."""
        both = self.block(clock=(3 << 17) + second) + self.block(stream=8, clock=(day << 17) + later)
        if same:
            refused_by(look_at_gcf, both, "one stream of its blocks continues another one")
        else:
            assert look_at_gcf(both) == 2000

    @staticmethod
    def packet(number, *, kind=b"DT", channel=2, samples=100, width=2, code=0x16, stated=None):
        def decimal(value, size):
            return bytes.fromhex(f"{value:0{2 * size}d}")

        head = kind + bytes(10) + decimal(24 + samples * width if stated is None else stated, 2) + decimal(number, 2)
        head += bytes(3) + decimal(channel, 1) + decimal(samples, 2) + bytes([0, code])
        return head.ljust(1024, b"\1")

    def test_reftek_counts_by_channel(self):
        packets = [self.packet(9999), self.packet(0, samples=50, width=4, code=0x32), self.packet(1, channel=3)]
        assert look_at_reftek(b"".join([*packets, self.packet(2, kind=b"EH", code=0x99)])) == {2: 150, 3: 100}
        traces = [trace(counts(150)), trace(counts(60)), trace(counts(40))]
        for one, channel in zip(traces, (2, 3, 3), strict=True):
            one.stats.reftek130 = {"channel_number": channel}
        statements = reftek_statements(look_at_reftek(b"".join(packets)), traces)
        assert [(one.where, one.difference) for one in statements] == [("channel 2", 0.0), ("channel 3", 0.0)]

    @pytest.mark.parametrize(
        ("wrong", "match"),
        [
            ({"stated": 225}, "packet 1: its header states 100 samples and 225 bytes"),
            ({"code": 0x32}, "packet 1: its header states 100 samples and 224 bytes"),
            ({"code": 0x99}, "packet 1: its header gives an unknown format of its samples"),
            ({"samples": 0, "code": 0x99}, "packet 1: its header gives an unknown format of its samples"),
            ({"samples": 241, "code": 0xC0}, "packet 1: its header states 241 samples, it has room for 240"),
            ({"samples": 240, "code": 0xC0}, "packet 1: it states a last sample of 16843009, its differences lead to"),
            ({"number": 3}, "packet 3 follows packet 0"),
        ],
    )
    def test_reftek_contradicts_itself(self, wrong, match):
        refused_by(look_at_reftek, self.packet(0) + self.packet(**{"number": 1} | wrong), match)

    @pytest.mark.parametrize("order", [">", "<"])
    def test_evt_frames(self, order):
        """A tag: K, the order of the bytes, lengths of header and samples, the sum of all bytes of both."""

        def frame(size, more, wrong=0):
            content = bytes(i % 251 for i in range(size + more))
            return (
                struct.pack(
                    f"{order}cBBBLHHHH", b"K", order == ">", 0, 0, 0, size, more, 0, sum(content) % 2**16 + wrong
                )
                + content
            )

        whole = frame(2040, 0) + frame(32, 900) + frame(32, 900)
        assert look_at_evt(whole + b"\0" * 5) == 3
        checksum, count = evt_statements(3, [trace(counts(40), dt=0.005)])
        assert checksum.difference == count.difference == 0.0
        refused_by(look_at_evt, whole[:-1], "frame 2 has 931 of 932 bytes")
        refused_by(look_at_evt, whole + frame(32, 9, 1), r"frame 3 states a checksum of (\d+), its bytes have \d+")
        for rest in (b"\0x", b"K", b"K" * 15, b"x" * 99):
            refused_by(look_at_evt, whole + rest, f"at byte {len(whole)}, after frame 2, there is no other frame")


class TestText:
    @pytest.mark.parametrize("version", ["1", "2"])
    def test_gse_sections(self, version):
        """The number of samples stands in columns of the first line that each version has of its own."""

        def section(count, *lines, end="CHK{}  12"):
            head = (
                f"WID{version}".ljust(27) + f"{count:>8}"
                if version == "1"
                else f"WID{version}".ljust(48) + f"{count:>8}"
            )
            head = head.ljust(74) + "CMP6" if version == "1" else head[:44] + "CM6 " + head[48:]
            return "\n".join([head, "STA2 other line", f"DAT{version}", *lines, end.format(version), ""]).encode()

        # Of the characters of a sample those of 6 bits lead on, A to T and -0..9 end one.
        assert look_at_gse(section(3, "kA", "U1T") + section(2, "+-")) == [3, 2]
        refused_by(look_at_gse, section(4, "kA", "U1T"), "its header states 4 samples, there are 3")
        refused_by(look_at_gse, section("x", "kA"), "a section does not tell its number of samples")
        refused_by(look_at_gse, section(1, "A", end="END"), f"a section without DAT{version}, CHK{version}")
        refused_by(
            look_at_gse, section(1, "A").replace(b"DAT", b"dat"), f"a section without DAT{version}, CHK{version}"
        )
        refused_by(look_at_gse, section(1, "A*"), "a character among the data is none of the compression's")
        assert look_at_gse(section(81, "1" * 81)) == [81]
        refused_by(look_at_gse, section(82, "1" * 82), "a line of data is longer than 81 characters")
        assert all(one.difference == 0.0 for one in gse_statements([3, 2], [trace(counts(3)), trace(counts(2))]))
        with pytest.raises(Damaged, match="it has 1 sections, 2 could be read"):
            gse_statements([3], [trace(counts(3)), trace(counts(2))])

    def test_times_of_a_series(self):
        """The length is from the first to the last sample, to a tenth of the step."""
        text = "TIMESERIES XX_ABC, 3 samples, 100 sps, {}, TSPAIR\n{}  1\n{} 2\n{}  3\n"
        times = [f"2020-01-02T03:04:05.{part}" for part in ("000000", "000000", "010000", "020000")]
        sections = look_at_timeseries((text.format(*times) * 2).encode())
        assert sections == [(3, pytest.approx(0.02))] * 2
        statements = timeseries_statements(sections, [trace(wave(3))] * 2)
        assert [one.what for one in statements] == ["number of samples", "length"] * 2
        assert compare(statements) == ("number of samples", "length")
        for late, wrong in (("020900", False), ("021100", True), ("018900", True)):
            times[3] = f"2020-01-02T03:04:05.{late}"
            _, length = timeseries_statements(look_at_timeseries(text.format(*times).encode()), [trace(wave(3))])
            assert (length.difference > 0.0) == wrong
        refused_by(look_at_timeseries, b"TIMESERIES XX_ABC, 3 samples\n1 2 3\n", "does not tell samples, rate and time")

    def test_the_last_place_of_a_number(self):
        assert [last_place(text) for text in ("12", "1.50", "2.5E-3", "-1e2")] == [1.0, 0.01, 1e-4, 100.0]

    @pytest.mark.parametrize("longitude", [12345.0, -12345.0])
    def test_longitudes_of_sac(self, tmp_path, longitude):
        data = bytearray(write(tmp_path / "a", trace(wave().astype(np.float32)), format="SAC").read_bytes())
        for word in (32, 36):
            for value in (longitude, 1.001 * longitude, float("nan")):
                wrong = data.copy()
                struct.pack_into("<f", wrong, 4 * word, value)
                if value == longitude:
                    assert look_at_sac(wrong).count == 1000
                else:
                    refused_by(look_at_sac, wrong, "its header gives a longitude of")

    def test_lengths_of_sac(self, tmp_path):
        """The time of the last sample, or of that which would follow; not two of them."""
        data = bytearray(write(tmp_path / "a", trace(wave().astype(np.float32)), format="SAC").read_bytes())
        for shift, sound in ((0.0, True), (0.01, True), (-0.01, True), (0.0103, False), (-0.0103, False)):
            struct.pack_into("<ff", data, 4 * 5, 2.0, 2.0 + 9.99 + shift)
            (length,) = (one for one in sac_statements(look_at_sac(data), [trace(wave(1000))]) if "time" in one.what)
            assert (length.difference <= 0.0) == sound, shift
        struct.pack_into("<f", data, 4 * 5, -12345.0)
        assert not any("time" in one.what for one in sac_statements(look_at_sac(data), [trace(wave(1000))]))


@pytest.mark.parametrize(("off", "remarked"), [(0.0, False), (0.9e-3, False), (-0.9e-3, False), (1.2e-3, True)])
def test_peaks_of_knet_are_without_the_offset(off, remarked):
    """In gal, to a thousandth beside what another offset makes of it; samples are counts of `calib` m/s^2."""
    samples = counts(1000) + 777
    one = trace(samples, calib=2e-5)
    peak = np.max(np.abs(samples - samples.mean())) * 2e-5 * 100.0
    one.stats.knet = SimpleNamespace(duration=10.0, accmax=peak * (1.0 + off))
    number, found = knet_statements(None, [one])
    assert (number.stated, number.found) == (1000, 1000)
    assert found.found == pytest.approx(peak)
    with pytest.warns(UserWarning, match="states a peak of") if remarked else nullcontext():
        assert compare([number, found]) == ("number of samples", "peak")
    for length in (0.0, float("nan"), -1.0):
        one.stats.knet.duration = length
        with pytest.raises(Damaged, match="its header gives no length that a record can have"):
            knet_statements(None, [one])
    del one.stats["knet"]
    with pytest.raises(Damaged, match="its header has no end"):
        knet_statements(None, [one])
