"""Statements in the header of a file are compared with the samples, for each format."""

import struct
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from ground_motion.files import counts, refused, refused_by, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.header_checks import (
    gse_statements,
    knet_statements,
    look_at_gse,
    look_at_sac,
    sac_statements,
)
from tdint.ground_motion.miniseed_checks import Damaged, Statement, check_step, compare
from tdint.ground_motion.reading.contents import read_contents


class TestComparison:
    @pytest.mark.parametrize("stated", [1.1, -1.0, float("nan"), float("inf")])
    def test_wrong_value_is_refused(self, stated):
        with pytest.raises(RecordError, match=r"peak of .* g, .* 1 g"):
            compare([Statement("peak", stated, 1.0, 0.01, "g")])

    def test_measured_value_may_differ_by_one_percent_with_warning(self):
        with pytest.warns(UserWarning, match=r"states a peak of 1\.009"):
            compare([Statement("peak", 1.009, 1.0, measured=True)])
        with pytest.raises(RecordError):
            compare([Statement("peak", float("inf"), 1.0, measured=True)])


@pytest.mark.parametrize("dt", [1e-6, 0.005, 10.0])
def test_implausible_sampling_intervals_are_refused(dt):
    check_step(dt)
    for other in (0.0, -dt, 0.99e-6, 10.01, float("nan"), float("inf")):
        with pytest.raises(RecordError, match="recorders have 1e-06 to 10 s"):
            check_step(other)


class TestSac:
    @pytest.fixture
    def data(self, tmp_path):
        return bytearray(
            write(tmp_path / "a", trace(wave().astype(np.float32)), format="SAC").read_bytes()
        )

    def test_sound_header_is_compared(self, data):
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
            (0, 0.02, r"time of the last sample\) of 9.98\d* s, .* 19.9"),
            (2, 9.81 * 3.0, r"largest sample\) of 29.4\d*, .* 3"),
            (1, -3.1, "smallest sample"),
            (56, 1.0, "mean of 1, "),
        ],
    )
    def test_wrong_header_value_is_refused(self, data, word, value, match):
        struct.pack_into("<f", data, 4 * word, value)
        refused(data, match)

    @pytest.mark.parametrize("peak", [1e-4, 1e4])
    def test_peak_tolerance_is_relative(self, tmp_path, peak):
        """In any units, a difference of 1e-4 is refused, and a difference of 1e-6 is rounding."""
        samples = (wave() * peak / np.max(np.abs(wave()))).astype(np.float32)
        data = bytearray(write(tmp_path / "a", trace(samples), format="SAC").read_bytes())
        struct.pack_into("<f", data, 4 * 2, float(samples.max()) * (1.0 + 1e-6))
        assert "peak (largest sample)" in read_contents(bytes(data), "file").compared
        struct.pack_into("<f", data, 4 * 2, float(samples.max()) * (1.0 + 1e-4))
        refused(data, "largest sample")


class TestText:
    @pytest.mark.parametrize("format", ["SLIST", "TSPAIR"])
    def test_wrong_number_of_samples_is_refused(self, tmp_path, format):
        data = write(tmp_path / "a", trace(wave(300)), format=format).read_bytes()
        assert read_contents(data, "file").compared == ("number of samples",)
        for stated in (b"294", b"306"):
            refused(
                data.replace(b"300 samples", stated + b" samples"),
                f"{stated.decode()}, but the data that were read have 300",
            )
        *lines, last = data.rstrip().split(b"\n")
        refused(b"\n".join([*lines, last, last, b""]), "but the data that were read have 30")

    @pytest.mark.parametrize("version", ["1", "2"])
    def test_sections_of_gse_are_counted(self, version):
        """The number of samples is in different columns of the first line in each version."""

        def section(count, *lines, end="CHK{}  12"):
            head = (
                f"WID{version}".ljust(27) + f"{count:>8}"
                if version == "1"
                else f"WID{version}".ljust(48) + f"{count:>8}"
            )
            head = head.ljust(74) + "CMP6" if version == "1" else head[:44] + "CM6 " + head[48:]
            return "\n".join(
                [head, "STA2 other line", f"DAT{version}", *lines, end.format(version), ""]
            ).encode()

        # Each character contains 6 bits: some characters continue a sample, and A to T, - and 0 to
        # 9 end it.
        assert look_at_gse(section(3, "kA", "U1T") + section(2, "+-")) == [3, 2]
        refused_by(look_at_gse, section(4, "kA", "U1T"), "states 4 samples, but the section has 3")
        refused_by(
            look_at_gse,
            section("x", "kA"),
            "the header of a section does not state its number of samples",
        )
        refused_by(
            look_at_gse,
            section(1, "A", end="END"),
            f"a section has no data between the lines DAT{version} and CHK{version}",
        )
        refused_by(
            look_at_gse,
            section(1, "A").replace(b"DAT", b"dat"),
            f"a section has no data between the lines DAT{version} and CHK{version}",
        )
        refused_by(
            look_at_gse, section(1, "A*"), "the compressed data contain an invalid character"
        )
        assert look_at_gse(section(81, "1" * 81)) == [81]
        refused_by(
            look_at_gse, section(82, "1" * 82), "a line of data is longer than 81 characters"
        )
        assert all(
            statement.difference == 0.0
            for statement in gse_statements([3, 2], [trace(counts(3)), trace(counts(2))])
        )
        with pytest.raises(Damaged, match=r"1 sections, .*2"):
            gse_statements([3], [trace(counts(3)), trace(counts(2))])

    @pytest.mark.parametrize("order", ["<", ">"])
    def test_invalid_longitudes_of_sac_are_refused(self, tmp_path, order):
        """Longitudes of station and event are checked; 12345 with either sign represents an unknown
        value."""
        path = write(
            tmp_path / "a", trace(wave().astype(np.float32)), format="SAC", byteorder=order
        )
        for word in (32, 36):
            for value in (12345.0, -12345.0, 12357.0, -12357.0, 1e30, float("nan")):
                data = bytearray(path.read_bytes())
                struct.pack_into(f"{order}f", data, 4 * word, value)
                if abs(value) == 12345.0:
                    assert look_at_sac(data)[0] == 1000
                else:
                    refused(data, "header states an invalid longitude")

    def test_length_of_sac_record_is_compared(self, tmp_path):
        """The header may state the time of the last sample or of the following sample, but not a
        time in between."""
        data = bytearray(
            write(tmp_path / "a", trace(wave().astype(np.float32)), format="SAC").read_bytes()
        )
        for shift, sound in (
            (0.0, True),
            (0.01, True),
            (-0.01, True),
            (0.0103, False),
            (-0.0103, False),
        ):
            struct.pack_into("<ff", data, 4 * 5, 2.0, 2.0 + 9.99 + shift)
            (length,) = (
                statement
                for statement in sac_statements(look_at_sac(data), [trace(wave(1000))])
                if "time" in statement.header_quantity
            )
            assert (length.difference <= 0.0) == sound, shift
        struct.pack_into("<f", data, 4 * 5, -12345.0)
        assert not any(
            "time" in statement.header_quantity
            for statement in sac_statements(look_at_sac(data), [trace(wave(1000))])
        )


@pytest.mark.parametrize(
    ("deviation", "has_note"), [(0.0, False), (0.9e-3, False), (-0.9e-3, False), (1.2e-3, True)]
)
def test_knet_peaks_are_compared_without_offset(deviation, has_note):
    """Peaks are in gal, and may differ by a thousandth because of another offset; samples are
    counts of `calib` m/s^2."""
    samples = counts(1000) + 777
    component = trace(samples, calib=2e-5)
    peak = np.max(np.abs(samples - samples.mean())) * 2e-5 * 100.0
    component.stats.knet = SimpleNamespace(duration=10.0, accmax=peak * (1.0 + deviation))
    number, found = knet_statements(None, [component])
    assert (number.stated, number.computed) == (1000, 1000)
    assert found.computed == pytest.approx(peak)
    with pytest.warns(UserWarning, match="states a peak of") if has_note else nullcontext():
        assert compare([number, found]) == ("number of samples", "peak")
    for length in (0.0, float("nan"), -1.0):
        component.stats.knet.duration = length
        with pytest.raises(Damaged, match="invalid number of samples"):
            knet_statements(None, [component])
    del component.stats["knet"]
    with pytest.raises(Damaged, match="header is incomplete"):
        knet_statements(None, [component])
