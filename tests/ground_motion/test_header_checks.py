"""What a file says of itself is compared with what is read from it, format by format."""

from __future__ import annotations

import re
import struct

import numpy as np
import pytest

from ground_motion.files import START, counts, obspy_data, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.header_checks.mseed import last_samples, most_samples
from tdint.ground_motion.header_checks.statement import Damaged, Statement, check_step, compare
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


def test_the_same_file_gives_the_same_samples(tmp_path):
    path = write(tmp_path / "a", trace(wave(1000), start=START), reclen=512)
    first, second = (read_record(path, units="m/s^2").acceleration.tobytes() for _ in range(2))
    assert first == second


def test_damaged_is_a_record_error():
    assert issubclass(Damaged, RecordError)
