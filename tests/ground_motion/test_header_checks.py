"""What a file says of itself is compared with what is read from it, format by format."""

from __future__ import annotations

import re
import struct
from contextlib import nullcontext
from datetime import timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from ground_motion.files import START, counts, obspy_data, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.header_checks.exchange import (
    gse_statements,
    knet_statements,
    look_at_gse,
    look_at_sac,
    look_at_timeseries,
    sac_statements,
    timeseries_statements,
)
from tdint.ground_motion.header_checks.mseed import last_samples, look_at_mseed, most_samples
from tdint.ground_motion.header_checks.recorders import (
    evt_statements,
    gcf_statements,
    look_at_evt,
    look_at_gcf,
    look_at_reftek,
    reftek_statements,
)
from tdint.ground_motion.header_checks.statement import (
    Damaged,
    Statement,
    check_step,
    compare,
    last_place,
)
from tdint.ground_motion.reading.contents import read_contents
from tdint.ground_motion.reading.read import read_record


def refused(data, match):
    with pytest.raises(RecordError, match=match):
        read_contents(bytes(data), "file")


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


class TestMiniSeed:
    """Records of 512 bytes; a header's fields by their bytes (SEED manual 2.4, chapter 8)."""

    @pytest.fixture(params=["FLOAT64", "INT32", "INT16", "STEIM1", "STEIM2"])
    def data(self, request, tmp_path):
        values = wave(1000) if request.param == "FLOAT64" else counts(1000) // (10 if request.param == "INT16" else 1)
        values = values.astype(np.int16) if request.param == "INT16" else values
        path = write(tmp_path / "a", trace(values), reclen=512, encoding=request.param)
        return bytearray(path.read_bytes())

    def test_sound(self, data):
        assert read_contents(bytes(data), "file").compared == ("number of samples",)

    def test_more_samples_than_there_is_room_for(self, data):
        """libmseed would read them from the memory behind the record, other ones each time."""
        for record in (0, len(data) - 512):
            wrong = data.copy()
            struct.pack_into(">H", wrong, record + 30, 3000)
            refused(wrong, r"record \d+: its header states 3000 samples, it has room for \d+")

    def test_one_sample_more(self, data):
        wrong = data.copy()
        (count,) = struct.unpack_from(">H", wrong, 30)
        struct.pack_into(">H", wrong, 30, count + 1)
        refused(wrong, "damaged|gap|overlap|Xn")

    @pytest.mark.parametrize("place", [0, 47, 512, 16448])
    def test_data_elsewhere(self, data, place):
        """libmseed would drop the record without a word."""
        for record in (0, 512):
            wrong = data.copy()
            struct.pack_into(">H", wrong, record + 44, place)
            refused(wrong, f"its header places (the|compressed) data at byte {place}")

    def test_a_record_that_becomes_a_control_header(self, data):
        for record in (0, 512, len(data) - 512):
            wrong = data.copy()
            wrong[record + 6] = ord("T")
            refused(wrong, f"at byte {record}, where record .* should begin, there is no header|unknown format")

    def test_a_record_of_text(self, data):
        wrong = data.copy()
        wrong[-512 + 52] = 0
        refused(wrong, r"XX.ABC.00.HNE have different encodings, \[0, \d+\]")

    def test_the_first_record_under_another_name(self, data):
        wrong = data.copy()
        wrong[15:18] = b"HNF"
        refused(wrong, "record 2 of XX.ABC.00.HNE continues record 1 of XX.ABC.00.HNF")

    @pytest.mark.parametrize("place", [11, 12])
    def test_the_first_record_with_a_letter_more(self, data, place):
        """The station's code is padded with blanks: ABC and ABC0 differ in one place."""
        wrong = data.copy()
        wrong[place] = ord("0")
        refused(wrong, r"record 2 of XX\.ABC\.00\.HNE continues record 1 of XX\.ABC ?0\.00\.HNE")

    def test_a_record_that_swallows_others(self, data):
        wrong = data[: 4 * 512]
        if len(wrong) < 4 * 512:
            pytest.skip("too short")
        wrong[54] = 11
        refused(wrong, "its header states 2048 bytes, but another record begins after 512")

    def test_fewer_samples_in_the_last_record(self, data):
        """No gap tells it, but the rest of the record is not empty; compressed samples miss the last one stated."""
        last = len(data) - 512
        (count,) = struct.unpack_from(">H", data, last + 30)
        wrong = data.copy()
        struct.pack_into(">H", wrong, last + 30, count - 10)
        if data[52] in (10, 11):
            refused(wrong, "integrity check|Xn|damaged")
        else:
            (note,) = read_contents(bytes(wrong), "file").notes
            assert note.startswith(f"after the {count - 10} samples that the last record of XX.ABC.00.HNE states")

    def test_another_byte_order(self, data):
        wrong = data.copy()
        wrong[53] = 0
        refused(wrong, "different byte orders")

    @pytest.mark.parametrize("following", [48, 47, 20])
    def test_a_blockette_that_leads_back(self, data, following):
        """To itself, or to before itself: whoever follows it never ends."""
        wrong = data.copy()
        (first,) = struct.unpack_from(">H", wrong, 46)
        assert first == 48
        struct.pack_into(">H", wrong, first + 2, following)
        refused(wrong, "the places of its blockettes are wrong")

    def test_more_blockettes_than_stated(self, data):
        wrong = data.copy()
        wrong[39] += 1
        refused(wrong, "states . blockettes, there are .")

    @pytest.mark.parametrize("multiplier", [-32768, 32767])
    def test_a_step_that_no_recorder_has(self, tmp_path, multiplier):
        path = write(tmp_path / "a", trace(wave(50)), reclen=512)
        data = bytearray(path.read_bytes())
        struct.pack_into(">hh", data, 32, 100, multiplier)
        refused(data, "sampling interval of .* s; recorders have")


CLOCK = {"year": 2020, "day": 100, "hour": 1, "minute": 2, "second": 3, "fraction": 4}
WIDTHS = {1: 16, 2: 24, 3: 32, 4: 32, 5: 64, 12: 24, 13: 16, 14: 16, 16: 16, 30: 16, 32: 16, 33: 16}


def seed_record(
    order=">", *, station=b"ABC  ", channel=b"HNE", samples=10, encoding=3, exponent=9, factor=100, multiplier=1,
    rate=None, **clock,
):  # fmt: skip
    """A record of MiniSEED put together by hand: a fixed header, blockette 1000, perhaps 100, and samples."""
    header = struct.pack(
        f"{order}6scc5s2s3s2sHHBBBxHHhhBBBBiHH",
        *(b"000001", b"D", b" ", station, b"00", channel, b"XX", *(CLOCK | clock).values()),
        *(samples, factor, multiplier, 0, 0, 0, 1 + (rate is not None), 0, 64, 48),
    )
    header += struct.pack(f"{order}HHBBBx", 1000, 56 if rate is not None else 0, encoding, order == ">", exponent)
    if rate is not None:
        header += struct.pack(f"{order}HHf4x", 100, 0, rate)
    return header.ljust(64, b"\0").ljust(2**exponent, b"\1")


class TestMiniSeedByHand:
    @pytest.mark.parametrize("order", [">", "<"])
    def test_what_a_header_says(self, order):
        clock = {"year": 2011, "day": 70, "hour": 5, "minute": 46, "second": 24, "fraction": 1234}
        first = seed_record(order, **clock, samples=20, factor=200, rate=200.5)
        later = seed_record(
            order, **clock | {"second": 40}, samples=5, encoding=4, channel=b"HNZ", factor=-4, exponent=8
        )
        one, other = look_at_mseed(first + later)
        assert (one.number, one.id, one.samples, one.length, one.data) == (1, "XX.ABC.00.HNE", 20, 512, 64)
        assert (other.number, other.id, other.samples, other.length) == (2, "XX.ABC.00.HNZ", 5, 256)
        assert (one.rate, other.rate) == (200.0, 0.25)
        assert one.start == pytest.approx(timedelta(70, 24.1234, hours=5, minutes=46).total_seconds())
        assert one.end - one.start == pytest.approx(0.1)
        assert other.end - one.start == pytest.approx(36.0)
        assert (one.rest, other.rest) == (512 - 64 - 20 * 4, 256 - 64 - 5 * 4)

    @pytest.mark.parametrize(
        ("field", "least", "most"),
        [
            ("year", 1900, 2100),
            ("day", 1, 366),
            ("hour", 0, 23),
            ("minute", 0, 59),
            ("second", 0, 60),
            ("fraction", 0, 9999),
        ],
    )
    @pytest.mark.parametrize("order", [">", "<"])
    def test_times_that_there_are(self, order, field, least, most):
        for value in (least, most):
            assert len(look_at_mseed(seed_record(order, **{field: value}))) == 1
        for value in {least - 1, most + 1} - {-1}:
            with pytest.raises(Damaged, match="at byte 0, where record 1 should begin, there is no header"):
                look_at_mseed(seed_record(order, **{field: value}))

    @pytest.mark.parametrize(
        ("factor", "multiplier", "rate"),
        [(100, 2, 200), (100, -2, 50), (-4, 2, 0.5), (-4, -2, 0.125), (0, 1, 0), (1, 0, 0)],
    )
    def test_rates(self, factor, multiplier, rate):
        """SEED manual, chapter 8, fields 10 and 11: each of them positive for a factor, negative for a divisor."""
        (record,) = look_at_mseed(seed_record(factor=factor, multiplier=multiplier))
        assert (record.rate, record.end > record.start) == (rate, rate > 0)

    @pytest.mark.parametrize("order", [">", "<"])
    def test_blockette_100_corrects_by_a_hundredth(self, order):
        for rate in (99.01, 100.99):
            look_at_mseed(seed_record(order, rate=rate))
        for rate in (98.99, 101.01, float("nan")):
            with pytest.raises(Damaged, match=r"its header states 100 and [\d.na]+ samples a second"):
                look_at_mseed(seed_record(order, rate=rate))

    @pytest.mark.parametrize(("encoding", "bits"), WIDTHS.items())
    def test_room(self, encoding, bits):
        """As many samples of each encoding as the bytes behind the header hold, and none more."""
        room = (512 - 64) * 8 // bits
        (record,) = look_at_mseed(seed_record(encoding=encoding, samples=room))
        assert record.samples * bits // 8 + record.rest == 512 - 64
        with pytest.raises(Damaged, match=f"record 1: its header states {room + 1} samples, it has room for {room}"):
            look_at_mseed(seed_record(encoding=encoding, samples=room + 1))

    @pytest.mark.parametrize("exponent", [7, 20])
    def test_lengths(self, exponent):
        (record,) = look_at_mseed(seed_record(exponent=exponent))
        assert record.length == 2**exponent
        wrong = bytearray(seed_record(exponent=exponent))
        wrong[54] = exponent - 1 if exponent == 7 else exponent + 1
        refused_by(look_at_mseed, wrong, rf"its header gives a length of 2\^{wrong[54]} bytes")

    def test_channels_that_continue_others(self):
        """In up to three letters another name, less than half a sample off."""
        first = seed_record(samples=50, second=1, fraction=0)
        for channel, fraction in ((b"HNF", 5000), (b"ABC", 5049)):
            second = seed_record(channel=channel, second=1, fraction=fraction)
            refused_by(
                look_at_mseed,
                first + second,
                f"record 2 of XX.ABC.00.{channel.decode()} continues record 1 of XX.ABC.00.HNE",
            )
        look_at_mseed(first + seed_record(channel=b"HNF", second=1, fraction=5051))
        look_at_mseed(first + seed_record(channel=b"ABC", station=b"ABD  ", second=1, fraction=5000))
        look_at_mseed(first + seed_record(second=1, fraction=5000, factor=50, channel=b"HNF"))

    def test_blank_space_between_records(self):
        """A file may be blank for long, in steps of the shortest record."""
        record = seed_record(exponent=7)
        for blank in (b"\0" * 128, b" " * 1280):
            assert [one.number for one in look_at_mseed(record + blank + record + blank)] == [1, 2]
        refused_by(look_at_mseed, record + record[:40], "its last 40 bytes are no whole record")
        refused_by(look_at_mseed, record + record[:100], "its last record has 100 of 128 bytes")

    @pytest.mark.parametrize("kind", [b"005", b"008", b"010", b"011"])
    def test_volumes_with_control_headers(self, kind):
        """Of the length that the first one tells, or up to the next header."""
        for exponent in (8, 12):
            first = b"000001V " + kind + (b"009502.4%02d" % exponent if kind != b"011" else b"")
            volume = first.ljust(2**exponent, b" ") + b"000002S*".ljust(2**exponent, b" ")
            record = seed_record(exponent=9).replace(b"000001D", b"000003D")
            found = look_at_mseed(volume + record + record.replace(b"000003D", b"000004D"))
            assert [(one.number, one.length) for one in found] == [(3, 512), (4, 512)]
            refused_by(look_at_mseed, volume + b"000003T 050".ljust(99, b"x"), f"has 99 of {2**exponent} bytes")
        wrong = (b"000001V " + kind + b"009502.421").ljust(512, b" ")
        refused_by(look_at_mseed, wrong, "its first control header does not tell the records' length")


def refused_by(look, data, match):
    with pytest.raises(Damaged, match=match):
        look(bytes(data))


@pytest.mark.parametrize("name", ["CDSN", "DWWSSN", "GEOSCOPE16_4", "SRO"])
def test_rare_encodings_have_no_more_samples_than_room(name):
    path = obspy_data(f"mseed/tests/data/{name}_encoding.mseed")
    if path is None:
        pytest.skip("this installation of obspy has no test data")
    data = bytearray(path.read_bytes())
    assert read_contents(bytes(data), "file").compared == ("number of samples",)
    struct.pack_into(">H", data, 30, 60000)
    refused(data, "states 60000 samples, it has room for")


class TestSteim:
    """Frames put together by hand from the manual's tables."""

    @staticmethod
    def frames(words, codes, first, last):
        control = 0
        for place, code in enumerate(codes, start=3):
            control |= code << (30 - 2 * place)
        return struct.pack(">Iii13I", control, first, last, *(words + [0] * (13 - len(words))))

    def test_steim_1(self):
        # Four differences of a byte (the first one is passed over), two of 16 bits, one of 32.
        words = [struct.unpack(">I", struct.pack(">4b", 9, 1, -2, 3))[0]]
        words.append(struct.unpack(">I", struct.pack(">2h", -300, 500))[0])
        words.append(struct.unpack(">I", struct.pack(">i", -100_000))[0])
        frames = self.frames(words, [1, 2, 3], 1000, -98_798)
        assert most_samples(frames, 1) == 7
        assert last_samples(frames, 1, 7) == (-98_798, 1000 + 1 - 2 + 3 - 300 + 500 - 100_000)
        assert last_samples(frames, 1, 4)[1] == 1002

    def test_steim_2(self):
        def pack(values, bits, code):
            word = code << 30
            for place, value in enumerate(values):
                word |= (value & ((1 << bits) - 1)) << (bits * (len(values) - 1 - place))
            return word

        groups = [([0], 30, 1, 2), ([100, -7], 15, 2, 2), ([-3, 4, -500], 10, 3, 2), ([1, -2, 3, -4, 31], 6, 0, 3)]
        groups += [([-16, 15, 1, 1, 1, 1], 5, 1, 3), ([-8, 7, 0, 0, 0, 0, 1], 4, 2, 3)]
        words = [pack(values, bits, code) for values, bits, code, _ in groups]
        differences = [value for values, *_ in groups for value in values]
        frames = self.frames(words, [code for *_, code in groups], 50, 0)
        assert most_samples(frames, 2) == len(differences)
        for size in (1, 2, 7, len(differences)):
            assert last_samples(frames, 2, size)[1] == 50 + sum(differences[1:size])


class TestSac:
    @pytest.fixture
    def data(self, tmp_path):
        return bytearray(write(tmp_path / "a", trace(wave().astype(np.float32)), format="SAC").read_bytes())

    def test_sound(self, data):
        compared = read_contents(bytes(data), "file").compared
        assert set(compared) == {
            "number of samples",
            "length (time of the last sample)",
            "peak (smallest sample)",
            "peak (largest sample)",
            "mean",
        }

    @pytest.mark.parametrize(
        ("word", "value", "match"),
        [
            (0, 0.02, r"time of the last sample\) of 9.98\d* s, what was read has 19.9"),
            (6, 5.0, "time of the last sample"),
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


class TestRecorders:
    @staticmethod
    def of_obspy(name):
        path = obspy_data(name)
        if path is None:
            pytest.skip("this installation of obspy has no test data")
        return bytearray(path.read_bytes())

    def test_evt_frames_have_a_checksum(self):
        data = self.of_obspy("kinemetrics/tests/data/BI008_MEMA-04823.evt")
        assert "checksum" in read_contents(bytes(data), "file").compared
        data[30_000] ^= 4
        refused(data, r"frame \d+ states a checksum of \d+, its bytes have \d+")

    def test_gcf_blocks(self):
        data = self.of_obspy("gcf/tests/data/20160603_1955n.gcf")
        assert "number of samples" in read_contents(bytes(data), "file").compared
        for place, value in ((15, 251), (15, 199), (14, 3), (1024 + 15, 99)):
            wrong = data.copy()
            wrong[place] = value
            refused(wrong, "damaged|unknown format")
        wrong = data.copy()
        wrong[1024 + 7] ^= 1  # another stream, that begins where the first block ends
        refused(wrong, "one stream of its blocks continues another one")

    @pytest.mark.parametrize("name", ["225051000_00008656", "104800000_000093F8", "065520000_013EE8A0.rt130"])
    def test_reftek_packets(self, name):
        data = self.of_obspy(f"reftek/tests/data/{name}")
        assert read_contents(bytes(data), "file").compared == ("number of samples",)
        refused(data[:1024] + data[2048:], "packet 2 follows packet 0")
        wrong = data.copy()
        wrong[1024 + 20 : 1024 + 22] = b"\x03\x01"
        refused(wrong, r"packet 1")

    def test_reftek_differences_lead_to_the_last_sample(self):
        data = self.of_obspy("reftek/tests/data/225051000_00008656")
        data[1024 + 64 + 100] ^= 64
        refused(data, r"packet 1: it states a last sample of -?\d+, its differences lead to")


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

    @pytest.mark.parametrize("wrong", [{"records": 251}, {"compression": 3}, {"compression": 0}])
    def test_gcf_announces_no_samples_that_it_can_have(self, wrong):
        refused_by(look_at_gcf, self.block() + self.block(**wrong), "block 1 announces no samples that it can have")

    @pytest.mark.parametrize("wrong", [{"records": 0}, {"compression": 2}])
    def test_gcf_has_neither_samples_nor_words(self, wrong):
        refused_by(look_at_gcf, self.block(rate=0, **wrong), "block 0 is neither one of samples nor one of words")

    @pytest.mark.parametrize(("day", "second", "same"), [(3, 50, True), (3, 51, False), (4, 50, False)])
    def test_gcf_streams_that_continue_one_another(self, day, second, same):
        """1000 samples at 100 Hz end 10 s later."""
        both = self.block() + self.block(stream=8, clock=(day << 17) + second)
        if same:
            refused_by(look_at_gcf, both, "one stream of its blocks continues another one")
        else:
            assert look_at_gcf(both) == 2000

    def test_gcf_streams_across_midnight(self):
        both = self.block(clock=(3 << 17) + 86_395) + self.block(stream=8, clock=(4 << 17) + 5)
        refused_by(look_at_gcf, both, "one stream of its blocks continues another one")

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


def test_the_same_file_gives_the_same_samples(tmp_path):
    path = write(tmp_path / "a", trace(wave(1000), start=START), reclen=512)
    first, second = (read_record(path, units="m/s^2").acceleration.tobytes() for _ in range(2))
    assert first == second


def test_damaged_is_a_record_error():
    assert issubclass(Damaged, RecordError)


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
