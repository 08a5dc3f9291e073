"""Units are stated by the format, the file or the user. The only assumption is noted, and it is
refused for implausible samples."""

import re

import numpy as np
import pytest

from ground_motion.files import counts, refused, trace, wave, write
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.reading.read import read_record
from tdint.ground_motion.reading.scale import moved
from tdint.units import STANDARD_GRAVITY, parse_units


class TestTexts:
    @pytest.mark.parametrize(
        ("text", "scale"),
        [
            ("m/s^2", 1.0), ("m/s2", 1.0), ("m/s**2", 1.0), ("M/S**2", 1.0), ("m/s/s", 1.0),
            ("m/sec^2", 1.0), ("m/s²", 1.0), ("cm/s^2", 0.01), ("CM/SEC/SEC", 0.01), ("gal", 0.01),
            ("Gal", 0.01), ("gals", 0.01), ("mm/s2", 0.001), ("g", STANDARD_GRAVITY),
            ("G", STANDARD_GRAVITY), ("2.38e-6 m/s^2", 2.38e-6), ("2.38E-6m/s2", 2.38e-6),
            (" .5 g ", 0.5 * STANDARD_GRAVITY), ("1. gal", 0.01), ("3*mm/s^2", 0.003),
            ("in/s^2", 0.0254), ("ft/sec2", 0.3048),
        ],
    )  # fmt: skip
    def test_spellings_of_acceleration_units(self, text, scale):
        units = parse_units(text)
        assert (units.scale, units.quantity) == (pytest.approx(scale, rel=1e-15), "acceleration")
        assert units.has_factor == any(c in text for c in ".3")

    @pytest.mark.parametrize(
        ("text", "scale", "quantity"),
        [
            ("cm/s", 0.01, "velocity"),
            ("1e-3 in/s", 2.54e-5, "velocity"),
            ("mm", 1e-3, "displacement"),
        ],
    )
    def test_units_of_velocity_and_displacement(self, text, scale, quantity):
        units = parse_units(text)
        assert (units.scale, units.quantity) == (pytest.approx(scale, rel=1e-15), quantity)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            *(
                (text, r"use one of m/s\^2, cm/s\^2, gal, mm/s\^2, g")
                for text in ("", "m/s^", "dm", "2.38e-6", "m/s^3", "1 2 gal", "gal gal")
            ),
            ("gall", "did you mean 'gal'"),
            *((text, "positive") for text in ("0 gal", "-1 m/s^2", "1e999 g")),
            # No guess at another dimension
            *((text, "^(?!.*did you mean).*use one of") for text in ("kg", "V", "counts", "%")),
            # A long text is not repeated.
            ("x" * 100_000, r"^.{0,300}$"),
        ],
    )
    def test_unknown_units_are_refused(self, text, message):
        with pytest.raises(UsageError, match=message):
            parse_units(text)


class TestAssumption:
    @pytest.mark.parametrize("code", ["HNE", "BN1", "ENZ", "HN2"])
    def test_units_of_accelerometer_in_miniseed_are_assumed(self, tmp_path, code, caplog):
        record = read_record(write(tmp_path / "a", trace(wave(), channel=code)))
        assert (record.units, record.units_from, record.pga) == ("m/s^2", "assumed", 3.0)
        assert "is assumed" in record.warnings[0]
        assert "is assumed" in caplog.text

    @pytest.mark.parametrize("code", ["EHZ", "BHE", "HHN", "HGZ", "", "N", "X"])
    def test_units_of_other_channels_are_not_assumed(self, tmp_path, code):
        path = write(tmp_path / "a", trace(wave(), channel=code))
        refused(path, "is assumed only for accelerometer channels")
        assert read_record(path, units="m/s^2").units_from == "given"

    @pytest.mark.parametrize(
        ("samples", "doubt"),
        [
            (wave(peak=29.5), "over 3 g"),
            (wave(peak=0.2) + 1.0027, "probably gravity in g"),
            (wave(peak=2.0) - 9.79, "probably gravity"),
            (np.round(wave(peak=20.0)), "all samples are whole numbers"),
        ],
    )
    def test_implausible_samples_prevent_assumption(self, tmp_path, samples, doubt):
        path = write(tmp_path / "a", trace(samples))
        refused(path, doubt)
        assert read_record(path, units="m/s^2").pga == np.max(np.abs(samples))

    def test_small_offsets_and_zeros_do_not_prevent_assumption(self, tmp_path):
        for samples in (wave(peak=29.0), wave(peak=0.2) + 0.05, np.zeros(10)):
            assert read_record(write(tmp_path / "a", trace(samples))).units_from == "assumed"

    @pytest.mark.parametrize("format", ["SAC", "SLIST", "TSPAIR", "SH_ASC"])
    def test_units_of_other_formats_are_not_assumed(self, tmp_path, format):
        samples = wave().astype(np.float32) if format == "SAC" else wave()
        path = write(tmp_path / "a", trace(samples), format=format)
        refused(path, "does not state the units of its samples; specify")
        record = read_record(path, units="g")
        assert record.pga == pytest.approx(3.0 * STANDARD_GRAVITY)
        assert (record.units, record.units_from) == ("g", "given")


class TestCounts:
    def test_counts_require_value_of_count(self, tmp_path):
        path = write(tmp_path / "a", trace(counts()))
        refused(path, r"counts of a recorder.*value of one count.*StationXML")
        refused(path, 'write "1 gal" if one count is 1 gal', units="gal")
        assert read_record(path, units="1 gal").pga == 1000.0

    def test_calibration_factor_without_unit_is_not_applied(self, tmp_path):
        path = write(tmp_path / "a", trace(counts(), calib=0.25), format="GSE2")
        refused(path, r"calibration factor 0\.25 has no unit")
        record = read_record(path, units="1e-5 m/s^2")
        assert record.pga == pytest.approx(1.0)
        assert any("0.25 is not applied" in note for note in record.notes)


class TestHeaders:
    @pytest.mark.parametrize(
        ("stated", "specified", "message"),
        [
            ("COUNTS", None, "counts of a recorder"),
            ("CM/S**2", "g", r"states its units \(CM/S\*\*2\), but g is specified"),
            ("V", "m/s^2", "not units of a ground motion"),
            ("CM/S", "cm/s^2", "is specified"),
        ],
    )
    def test_contradicting_units_are_refused(self, tmp_path, stated, specified, message):
        refused(
            write(tmp_path / "a", trace(wave(), ascii={"unit": stated}), format="SLIST"),
            message,
            units=specified,
        )

    @pytest.mark.parametrize(
        ("stated", "specified", "pga"), [("COUNTS", "1 m/s^2", 3.0), ("CM/S**2", "gal", 0.03)]
    )
    def test_agreeing_units_are_accepted(self, tmp_path, stated, specified, pga):
        path = write(tmp_path / "a", trace(wave(), ascii={"unit": stated}), format="SLIST")
        assert read_record(path, units=specified).pga == pytest.approx(pga)

    # LEVEN is false, or IFTYPE is a spectrum; ObsPy does not write these header words.
    @pytest.mark.parametrize(
        ("header", "header_words", "message"),
        [
            ({"idep": 7}, {}, "a velocity, not an acceleration; .*`units=cm/s`"),
            ({"idep": 6}, {}, "a displacement, not an acceleration; .*`units=cm`"),
            ({}, {105: 0}, "not an evenly sampled"),
            ({}, {85: 2}, "not an evenly sampled"),
        ],
    )
    def test_sac_of_other_quantity_is_refused(self, tmp_path, header, header_words, message):
        path = write(tmp_path / "a", trace(wave(), sac=header), format="SAC", byteorder="<")
        data = bytearray(path.read_bytes())
        for word, value in header_words.items():
            data[4 * word : 4 * word + 4] = value.to_bytes(4, "little")
        path.write_bytes(data)
        refused(path, message)

    def test_units_and_inventory_exclude_each_other(self, tmp_path):
        with pytest.raises(UsageError, match="remove the units or the inventory"):
            read_record(write(tmp_path / "a", trace(wave())), units="g", inventory="station.xml")


def test_units_with_impossible_peak_are_refused(tmp_path):
    path = write(tmp_path / "a", trace(wave()))
    refused(
        path,
        r"the peak acceleration must be at most .*, got 3e\+20 m/s\^2; correct the units",
        units="1e20 m/s^2",
    )


class TestDifferentiation:
    """Tests with a sine, for which central differences are the derivatives times sin(x) / x and
    (sin(x / 2) / (x / 2))^2."""

    dt, omega = 0.01, 2.0 * np.pi * 3.0

    @pytest.mark.parametrize("quantity", ["velocity", "displacement"])
    def test_acceleration_of_sine(self, quantity):
        """The error of a cubic spline through the displacements of a sine, in closed form."""
        t = np.arange(400) * self.dt
        x = self.omega * self.dt
        shape = 6.0 * (1.0 - np.cos(x)) / ((2.0 + np.cos(x)) * x)
        if quantity == "velocity":
            shape *= 0.5 / np.tan(x / 2.0) + 0.25 * np.sin(x) / (2.0 + np.cos(x))
            expected = self.omega * np.cos(self.omega * t) * shape
        else:
            expected = -(self.omega**2) * np.sin(self.omega * t) * shape / x
        found = moved(np.sin(self.omega * t), self.dt, quantity)
        inner = slice(40, -40)
        np.testing.assert_allclose(
            found.acceleration[inner], expected[inner], rtol=1e-9, atol=1e-9 * self.omega**2
        )
        assert found.warnings == []

    @pytest.mark.parametrize(("quantity", "unit"), [("displacement", 1e-4), ("velocity", 1e-2)])
    def test_rounding_of_samples_is_reported_with_its_contribution(self, quantity, unit):
        t = np.arange(400) * self.dt
        samples = 0.02 * np.sin(1.03 * self.omega * t)
        exact, found = (
            moved(s, self.dt, quantity) for s in (samples, unit * np.rint(samples / unit))
        )
        (text,) = found.warnings
        (contribution,) = map(float, re.findall(r"contributes up to (\S+) m/s\^2", text))
        error = np.max(np.abs(found.acceleration - exact.acceleration)[20:-20])
        assert 0.25 * contribution < error < 1.02 * contribution
        assert f"rounded to {unit:.2g} m" in text and exact.warnings == []

    def test_velocity_of_file_becomes_an_acceleration(self, tmp_path):
        record = read_record(
            write(tmp_path / "a", trace(wave(peak=0.5), ascii={"unit": "CM/S"}), format="SLIST")
        )
        assert (record.quantity, record.units, record.units_from) == ("velocity", "CM/S", "file")
        assert record.notes[0].startswith("the velocity of the file is the motion of the ground")
        assert record.pga == pytest.approx(0.005 * 2.0 * np.pi * 1.3, rel=5e-3)

    def test_a_velocity_requires_four_samples(self, tmp_path):
        with pytest.raises(RecordError, match="at least 4 samples"):
            read_record(write(tmp_path / "a", trace([0.0, 1.0, 0.0])), units="cm/s")
