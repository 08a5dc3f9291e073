"""A unit is stated by the format, the file or the user; the one assumption is said, and refused where numbers speak
against it."""

import numpy as np
import pytest

from ground_motion.files import counts, trace, wave, write
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.reading.read import read_record
from tdint.ground_motion.reading.scale import differentiated
from tdint.units import STANDARD_GRAVITY, parse_units


class TestAssumption:
    @pytest.mark.parametrize("code", ["HNE", "BN1", "ENZ", "HN2"])
    def test_an_accelerometer_in_miniseed(self, tmp_path, code, caplog):
        record = read_record(write(tmp_path / "a", trace(wave(), channel=code)))
        assert (record.units, record.units_from) == ("m/s^2", "assumed")
        assert record.pga == 3.0
        assert "is assumed" in record.warnings[0]
        assert "is assumed" in caplog.text

    @pytest.mark.parametrize("code", ["EHZ", "BHE", "HHN", "HGZ", "", "N", "X"])
    def test_another_channel(self, tmp_path, code):
        path = write(tmp_path / "a", trace(wave(), channel=code))
        with pytest.raises(RecordError, match="is no accelerometer's channel"):
            read_record(path)
        assert read_record(path, units="m/s^2").units_from == "given"

    @pytest.mark.parametrize(
        ("samples", "doubt"),
        [
            (wave(peak=29.5), "over 3 g"),
            (wave(peak=0.2) + 1.0027, "gravity in g by its look"),
            (wave(peak=2.0) - 9.79, "gravity by its look"),
            (np.round(wave(peak=20.0)), "all are whole numbers"),
        ],
    )
    def test_numbers_that_speak_against_it(self, tmp_path, samples, doubt):
        path = write(tmp_path / "a", trace(samples))
        with pytest.raises(RecordError, match=doubt):
            read_record(path)
        assert read_record(path, units="m/s^2").pga == np.max(np.abs(samples))

    def test_small_offsets_and_zeros_do_not(self, tmp_path):
        for samples in (wave(peak=29.0), wave(peak=0.2) + 0.05, np.zeros(10)):
            assert read_record(write(tmp_path / "a", trace(samples))).units_from == "assumed"

    @pytest.mark.parametrize("format", ["SAC", "SLIST", "TSPAIR", "SH_ASC"])
    def test_other_formats_are_refused_like_counts(self, tmp_path, format):
        samples = wave().astype(np.float32) if format == "SAC" else wave()
        write(tmp_path / "a", trace(samples), format=format)
        with pytest.raises(RecordError, match="does not tell the units of its samples; say what"):
            read_record(tmp_path / "a")
        assert read_record(tmp_path / "a", units="g").pga == pytest.approx(3.0 * STANDARD_GRAVITY)

    def test_counts_stay_refused(self, tmp_path):
        with pytest.raises(RecordError, match="counts of a recorder"):
            read_record(write(tmp_path / "a", trace(counts())))


def test_units_that_cannot_be_right(tmp_path):
    path = write(tmp_path / "a", trace(wave()))
    with pytest.raises(
        RecordError, match=r"the largest acceleration would be 3e\+20 m/s\^2; the units cannot be right"
    ):
        read_record(path, units="1e20 m/s^2")


class TestOtherUnits:
    @pytest.mark.parametrize(
        ("text", "scale", "quantity"),
        [
            ("in/s^2", 0.0254, "acceleration"), ("ft/sec2", 0.3048, "acceleration"), ("cm/s", 0.01, "velocity"),
            ("1e-3 in/s", 2.54e-5, "velocity"), ("mm", 1e-3, "displacement"),
        ],
    )  # fmt: skip
    def test_quantity(self, text, scale, quantity):
        units = parse_units(text)
        assert (units.scale, units.quantity) == (pytest.approx(scale, rel=1e-15), quantity)

    @pytest.mark.parametrize("text", ["kg", "V", "counts", "%g"])
    def test_no_guess_at_another_dimension(self, text):
        with pytest.raises(UsageError) as caught:
            parse_units(text)
        assert "did you mean" not in str(caught.value)

    def test_the_message_does_not_repeat_a_long_text(self):
        with pytest.raises(UsageError) as caught:
            parse_units("x" * 100_000)
        assert len(str(caught.value)) < 300


class TestDifferentiation:
    """Against a sine, whose central differences are its derivatives times sin(x) / x and (sin(x / 2) / (x / 2))^2."""

    dt, omega = 0.01, 2.0 * np.pi * 3.0

    @pytest.mark.parametrize("quantity", ["velocity", "displacement"])
    def test_a_sine(self, quantity):
        t = np.arange(400) * self.dt
        x = self.omega * self.dt
        samples = np.sin(self.omega * t)
        if quantity == "velocity":
            expected = self.omega * np.cos(self.omega * t) * np.sin(x) / x
        else:
            expected = -(self.omega**2) * samples * (np.sin(x / 2.0) / (x / 2.0)) ** 2
        found = differentiated(samples, self.dt, quantity)
        np.testing.assert_allclose(found[1:-1], expected[1:-1], rtol=1e-9, atol=1e-9 * self.omega**2)
        assert (found[0], found[-1]) == (found[1], found[-2])

    def test_of_a_file(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(peak=0.5), ascii={"unit": "CM/S"}), format="SLIST")
        record = read_record(path)
        assert (record.quantity, record.units, record.units_from) == ("velocity", "CM/S", "file")
        assert record.notes[0].startswith("the velocity of the file is differentiated")
        assert record.pga == pytest.approx(0.005 * 2.0 * np.pi * 1.3, rel=5e-3)
        with pytest.raises(RecordError, match="contradicts"):
            read_record(path, units="cm/s^2")

    def test_too_few_samples(self, tmp_path):
        with pytest.raises(RecordError, match="too few to be differentiated"):
            read_record(write(tmp_path / "a", trace([0.0, 1.0])), units="cm/s")
