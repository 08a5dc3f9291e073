"""Statements in the headers of a MiniSEED file are compared with its samples."""

import struct
from datetime import timedelta

import numpy as np
import pytest

from ground_motion.files import counts, need_obspy_data, refused, refused_by, trace, wave, write
from selection import every
from tdint.ground_motion.miniseed_checks import look_at_mseed, most_samples
from tdint.ground_motion.reading.contents import read_contents

CLOCK = {"year": 2020, "day": 100, "hour": 1, "minute": 2, "second": 3, "fraction": 4}
WIDTHS = {1: 16, 2: 24, 3: 32, 4: 32, 5: 64, 12: 24, 13: 16, 14: 16, 16: 16, 30: 16, 32: 16, 33: 16}


class TestMiniSeed:
    """Tests with records of 512 bytes; the fields of a header are set by their bytes (SEED manual
    2.4, chapter 8)."""

    @pytest.fixture(params=["FLOAT64", "INT32", "INT16", "STEIM1", "STEIM2"])
    def data(self, request, tmp_path):
        values = (
            wave(1000)
            if request.param == "FLOAT64"
            else counts(1000) // (10 if request.param == "INT16" else 1)
        )
        values = values.astype(np.int16) if request.param == "INT16" else values
        path = write(tmp_path / "a", trace(values), reclen=512, encoding=request.param)
        return bytearray(path.read_bytes())

    def test_sound_file_is_compared(self, data):
        assert read_contents(bytes(data), "file").compared == ("number of samples",)

    # Position from the start or end of the file, inserted bytes, and message
    @pytest.mark.parametrize(
        ("position", "content", "message"),
        every(
            3,
            [
                # libmseed would read these samples from the memory after the record, with different
                # values each time.
                (30, b"\x0b\xb8", r"record 1: .*3000 samples, .* \d+"),
                (-512 + 30, b"\x0b\xb8", r"record \d+: .*3000 samples, .* \d+"),
                # libmseed would drop the record without a word.
                (44, b"\0\0", "at byte 0|states byte 0"),
                (44, b"\0\x2f", "at byte 47|states byte 47"),
                (512 + 44, b"\2\0", "at byte 512|states byte 512"),
                (512 + 44, b"\x40\x40", "at byte 16448|states byte 16448"),
                # A record that becomes a control header
                (6, b"T", "at byte 0, where record .* must start|unknown format"),
                (512 + 6, b"T", "at byte 512, where record .* must start|unknown format"),
                (-512 + 6, b"T", r"at byte \d+, where record .* must start|unknown format"),
                # A record of text
                (-512 + 52, b"\0", r"XX.ABC.00.HNE have different encodings, \[0, \d+\]"),
                # The first record under another name; the station's code is padded with blanks.
                (15, b"HNF", "record 2 of XX.ABC.00.HNE continues record 1 of XX.ABC.00.HNF"),
                (11, b"0", r"record 2 of XX\.ABC\.00\.HNE continues record 1 of XX\.ABC0\.00\.HNE"),
                (
                    12,
                    b"0",
                    r"record 2 of XX\.ABC\.00\.HNE continues record 1 of XX\.ABC 0\.00\.HNE",
                ),
                (53, b"\0", "different byte orders"),
                # Positions of blockettes that refer to themselves or to earlier blockettes would
                # cause an endless loop.
                (50, b"\0\x30", "the positions of its blockettes are invalid"),
                (50, b"\0\x2f", "the positions of its blockettes are invalid"),
                (50, b"\0\x14", "the positions of its blockettes are invalid"),
                (39, b"\x02", "states . blockettes, but it has ."),
            ],
        ),
    )
    def test_changed_header_bytes_are_refused(self, data, position, content, message):
        position %= len(data)
        data[position : position + len(content)] = content
        refused(data, message)

    def test_additional_sample_in_header_is_refused(self, data):
        (count,) = struct.unpack_from(">H", data, 30)
        struct.pack_into(">H", data, 30, count + 1)
        refused(data, "corrupt|gap|overlap|Xn")

    def test_too_long_record_is_refused(self, data):
        data[54] = 11
        message = (
            "its header states 2048 bytes, but another record begins after 512|has 1024 of 2048 "
            "bytes"
        )
        refused(data, message)

    def test_fewer_samples_in_last_record_are_reported(self, data):
        """There is no time gap, but the rest of the record is not empty; for compressed samples,
        the stated last sample does not agree."""
        last = len(data) - 512
        (count,) = struct.unpack_from(">H", data, last + 30)
        struct.pack_into(">H", data, last + 30, count - 10)
        if data[52] in (10, 11):
            refused(data, "integrity check|Xn|corrupt")
        else:
            (note,) = read_contents(bytes(data), "file").notes
            assert note.startswith(f"the last record of XX.ABC.00.HNE states {count - 10} samples")

    @pytest.mark.parametrize("multiplier", [-32768, 32767])
    def test_implausible_sampling_interval_is_refused(self, tmp_path, multiplier):
        path = write(tmp_path / "a", trace(wave(50)), reclen=512)
        data = bytearray(path.read_bytes())
        struct.pack_into(">hh", data, 32, 100, multiplier)
        refused(data, "sampling interval of .* s; recorders have")


def seed_record(
    order=">",
    *,
    station=b"ABC  ",
    channel=b"HNE",
    samples=10,
    encoding=3,
    exponent=9,
    factor=100,
    multiplier=1,
    rate=None,
    **clock,
):
    """Return a MiniSEED record with a fixed header, blockette 1000, optionally blockette 100, and
    samples."""
    header = struct.pack(
        f"{order}6scc5s2s3s2sHHBBBxHHhhBBBBiHH",
        *(b"000001", b"D", b" ", station, b"00", channel, b"XX", *(CLOCK | clock).values()),
        *(samples, factor, multiplier, 0, 0, 0, 1 + (rate is not None), 0, 64, 48),
    )
    header += struct.pack(
        f"{order}HHBBBx", 1000, 56 if rate is not None else 0, encoding, order == ">", exponent
    )
    if rate is not None:
        header += struct.pack(f"{order}HHf4x", 100, 0, rate)
    return header.ljust(64, b"\0").ljust(2**exponent, b"\1")


class TestMiniSeedByHand:
    @pytest.mark.parametrize("order", [">", "<"])
    def test_header_fields_are_read(self, order):
        clock = {"year": 2011, "day": 70, "hour": 5, "minute": 46, "second": 24, "fraction": 1234}
        first = seed_record(order, **clock, samples=20, factor=200, rate=200.5)
        later = seed_record(
            order,
            **clock | {"second": 40},
            samples=5,
            encoding=4,
            channel=b"HNZ",
            factor=-4,
            exponent=8,
        )
        first_header, second_header = look_at_mseed(first + later)
        assert (
            first_header.number,
            first_header.id,
            first_header.samples,
            first_header.length,
            first_header.data,
        ) == (1, "XX.ABC.00.HNE", 20, 512, 64)
        assert (
            second_header.number,
            second_header.id,
            second_header.samples,
            second_header.length,
        ) == (2, "XX.ABC.00.HNZ", 5, 256)
        assert (first_header.rate, second_header.rate) == (
            200.5,
            0.25,
        )  # of the first the actual rate of its blockette 100
        assert first_header.start == pytest.approx(
            timedelta(70, 24.1234, hours=5, minutes=46).total_seconds()
        )
        assert first_header.end - first_header.start == pytest.approx(20.0 / 200.5)
        assert second_header.end - first_header.start == pytest.approx(36.0)
        assert (first_header.remaining_bytes, second_header.remaining_bytes) == (
            512 - 64 - 20 * 4,
            256 - 64 - 5 * 4,
        )

    @pytest.mark.parametrize(
        ("field", "least", "most"),
        [
            ("year", 1900, 2100), ("day", 1, 366), ("hour", 0, 23), ("minute", 0, 59), ("second", 0, 60),  # noqa: E501
            ("fraction", 0, 9999),
        ],
    )  # fmt: skip
    @pytest.mark.parametrize("order", [">", "<"])
    def test_bounds_of_time_fields(self, order, field, least, most):
        for value in (least, most):
            assert len(look_at_mseed(seed_record(order, **{field: value}))) == 1
        for value in {least - 1, most + 1} - {-1}:
            refused_by(
                look_at_mseed,
                seed_record(order, **{field: value}),
                "at byte 0, where record 1 must start",
            )

    @pytest.mark.parametrize(
        ("factor", "multiplier", "rate"),
        [(100, 2, 200), (100, -2, 50), (-4, 2, 0.5), (-4, -2, 0.125), (0, 1, 0), (1, 0, 0)],
    )
    def test_sampling_rate_from_factor_and_multiplier(self, factor, multiplier, rate):
        """According to the SEED manual, chapter 8, fields 10 and 11, a positive value is a factor
        and a negative value is a divisor."""
        (record,) = look_at_mseed(seed_record(factor=factor, multiplier=multiplier))
        assert (record.rate, record.end > record.start) == (rate, rate > 0)

    @pytest.mark.parametrize("order", [">", "<"])
    def test_blockette_100_may_differ_by_one_percent(self, order):
        for rate in (99.01, 100.99):
            look_at_mseed(seed_record(order, rate=rate))
        for rate in (98.99, 101.01, float("nan")):
            refused_by(
                look_at_mseed,
                seed_record(order, rate=rate),
                r"its header states 100 and [\d.na]+ samples a second",
            )

    @pytest.mark.parametrize(("encoding", "bits"), WIDTHS.items())
    def test_maximum_number_of_samples_of_encoding(self, encoding, bits):
        """The maximum is the number of samples of each encoding for which the bytes after the
        header have space."""
        room = (512 - 64) * 8 // bits
        (record,) = look_at_mseed(seed_record(encoding=encoding, samples=room))
        assert record.samples * bits // 8 + record.remaining_bytes == 512 - 64
        refused_by(
            look_at_mseed,
            seed_record(encoding=encoding, samples=room + 1),
            f"record 1: its header states {room + 1} samples, but the record has space for {room}",
        )

    @pytest.mark.parametrize("exponent", [7, 20])
    def test_record_lengths(self, exponent):
        (record,) = look_at_mseed(seed_record(exponent=exponent))
        assert record.length == 2**exponent
        wrong = bytearray(seed_record(exponent=exponent))
        wrong[54] = exponent - 1 if exponent == 7 else exponent + 1
        refused_by(
            look_at_mseed, wrong, rf"its header states an invalid length of 2\^{wrong[54]} bytes"
        )

    def test_channel_continuing_other_channel_is_refused(self):
        """The names differ in up to three letters, and the times differ by less than half a
        sampling interval."""
        first = seed_record(samples=50, second=1, fraction=0)
        for channel, fraction in ((b"HNF", 5000), (b"ABC", 5049)):
            second = seed_record(channel=channel, second=1, fraction=fraction)
            refused_by(
                look_at_mseed,
                first + second,
                f"record 2 of XX.ABC.00.{channel.decode()} continues record 1 of XX.ABC.00.HNE",
            )
        look_at_mseed(first + seed_record(channel=b"HNF", second=1, fraction=5051))
        look_at_mseed(
            first + seed_record(channel=b"ABC", station=b"ABD  ", second=1, fraction=5000)
        )
        look_at_mseed(first + seed_record(second=1, fraction=5000, factor=50, channel=b"HNF"))

    def test_blank_space_between_records_is_skipped(self):
        """A file may contain long blank space, in multiples of the shortest record."""
        record = seed_record(exponent=7)
        for blank in (b"\0" * 128, b" " * 1280):
            assert [header.number for header in look_at_mseed(record + blank + record + blank)] == [
                1,
                2,
            ]
        refused_by(
            look_at_mseed, record + record[:40], "the last 40 bytes of the file are not a complete"
        )
        refused_by(
            look_at_mseed, record + record[:100], "the last record of the file has 100 of 128"
        )

    @pytest.mark.parametrize("header_type", [b"005", b"008", b"010", b"011"])
    def test_control_headers_of_volumes_are_skipped(self, header_type):
        """Control headers end after the length that the first one states, or at the next header."""
        for exponent in (8, 12):
            first = (
                b"000001V "
                + header_type
                + (b"009502.4%02d" % exponent if header_type != b"011" else b"")
            )
            volume = first.ljust(2**exponent, b" ") + b"000002S*".ljust(2**exponent, b" ")
            record = seed_record(exponent=9).replace(b"000001D", b"000003D")
            found = look_at_mseed(volume + record + record.replace(b"000003D", b"000004D"))
            assert [(header.number, header.length) for header in found] == [(3, 512), (4, 512)]
            refused_by(
                look_at_mseed,
                volume + b"000003T 050".ljust(99, b"x"),
                f"has 99 of {2**exponent} bytes",
            )
        wrong = (b"000001V " + header_type + b"009502.421").ljust(512, b" ")
        refused_by(
            look_at_mseed,
            wrong,
            "the first control header of the file does not state the length of the records",
        )


@pytest.mark.parametrize("name", ["CDSN", "DWWSSN", "GEOSCOPE16_4", "SRO"])
def test_excessive_samples_of_rare_encodings_are_refused(name):
    data = bytearray(need_obspy_data(f"mseed/tests/data/{name}_encoding.mseed").read_bytes())
    assert read_contents(bytes(data), "file").compared == ("number of samples",)
    struct.pack_into(">H", data, 30, 60000)
    refused(data, "states 60000 samples, but the record has space for")


class TestSteim:
    """Tests with frames that follow the tables of the manual."""

    @staticmethod
    def frames(data_words, codes, first, last):
        control = 0
        for number, code in enumerate(codes, start=3):
            control |= code << (30 - 2 * number)
        return struct.pack(
            ">Iii13I", control, first, last, *(data_words + [0] * (13 - len(data_words)))
        )

    def test_samples_of_steim_1_are_counted(self):
        # The frame has four differences of one byte (the first is ignored), two of 16 bits, and one
        # of 32 bits.
        data_words = [struct.unpack(">I", struct.pack(">4b", 9, 1, -2, 3))[0]]
        data_words.append(struct.unpack(">I", struct.pack(">2h", -300, 500))[0])
        data_words.append(struct.unpack(">I", struct.pack(">i", -100_000))[0])
        frames = self.frames(data_words, [1, 2, 3], 1000, -98_798)
        assert most_samples(frames, 1) == 7

    def test_samples_of_steim_2_are_counted(self):
        def pack(values, bits, code):
            word = code << 30
            for index, value in enumerate(values):
                word |= (value & ((1 << bits) - 1)) << (bits * (len(values) - 1 - index))
            return word

        groups = [
            ([0], 30, 1, 2),
            ([100, -7], 15, 2, 2),
            ([-3, 4, -500], 10, 3, 2),
            ([1, -2, 3, -4, 31], 6, 0, 3),
        ]
        groups += [([-16, 15, 1, 1, 1, 1], 5, 1, 3), ([-8, 7, 0, 0, 0, 0, 1], 4, 2, 3)]
        data_words = [pack(values, bits, code) for values, bits, code, _ in groups]
        differences = [value for values, *_ in groups for value in values]
        frames = self.frames(data_words, [code for *_, code in groups], 50, 0)
        assert most_samples(frames, 2) == len(differences)
