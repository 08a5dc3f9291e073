"""Tests of the text formats of strong-motion networks: samples, interval, units, names and
times."""

import re
from datetime import datetime

import numpy as np
import pytest

from facts import states
from ground_motion import format_files as files
from ground_motion.files import refused as refused_record
from ground_motion.format_files import motion
from tdint.ground_motion.formats import usgs
from tdint.ground_motion.measures import measure
from tdint.ground_motion.processing_steps import process
from tdint.ground_motion.reading.contents import read_contents
from tdint.ground_motion.reading.read import read_record, read_records
from tdint.ground_motion.reading.scale import moved
from tdint.units import STANDARD_GRAVITY


def contents(text):
    return read_contents(text.encode(), "file")


def only(text):
    """Return the only trace of a file's text."""
    (trace,) = contents(text).traces
    return trace


def refused(source, message, **options):
    """Check that a text or a file is refused with a message."""
    refused_record(source.encode() if isinstance(source, str) else source, message, **options)


class TestAt2:
    def test_header_of_peer(self, tmp_path):
        (tmp_path / "a.AT2").write_text(files.at2())
        record = read_record(tmp_path / "a.AT2")
        np.testing.assert_allclose(record.acceleration, motion() * STANDARD_GRAVITY, rtol=1e-15)
        assert (record.dt, record.id, record.component) == (0.005, ".Far-Hill-Coll-2..067", "067")
        assert (record.start, record.units, record.units_from, record.notes) == (
            "",
            "g",
            "file",
            (),
        )

    @pytest.mark.parametrize(
        "step",
        [
            "NPTS=  {n}, DT= .00500 SEC", "NPTS=   {n}, DT=   .0050 SEC,        ", "NPTS= {n} DT= 5.0E-3",  # noqa: E501
            "npts: {n}; dt: 0.005", "  {n}    0.0050    NPTS, DT", "{n}, .005 NPTS, DT",
            "NPT = {n} , DT = .005 SEC, , SCALED FACTOR = 2",
        ],
    )  # fmt: skip
    @pytest.mark.parametrize("each", [1, 5, 8, 1000])
    def test_spellings_of_step_and_values_per_line(self, step, each):
        trace = only(files.at2(step=step, each=each))
        np.testing.assert_array_equal(trace.data, motion())
        assert trace.stats.delta == 0.005

    def test_dos_line_ends_and_missing_final_newline(self):
        text = files.at2().rstrip().replace("\n", "\r\n")
        np.testing.assert_array_equal(only(text).data, motion())
        np.testing.assert_array_equal(only(text + "\r\n\x1a\x1a").data, motion())

    def test_header_with_free_text_is_read(self):
        trace = only(files.free_at2())
        np.testing.assert_array_equal(trace.data, motion())
        assert (trace.stats.delta, trace.stats.tdint_units, trace.id) == (0.02, "g", "...")

    @pytest.mark.parametrize(
        ("stated", "expected"),
        [
            ("IN UNITS OF CM/S/S", "cm/s^2"), ("IN UNITS OF G'S.", "g"), ("IN UNITS OF (CM/SEC2)", "cm/s^2"),  # noqa: E501
            ("IN UNITS OF M/S^2", "m/s^2"), ("IN G", "g"),
        ],
    )  # fmt: skip
    def test_units_in_header(self, stated, expected):
        assert only(files.at2().replace("IN UNITS OF G", stated)).stats.tdint_units == expected

    def test_missing_units_must_be_specified(self, tmp_path):
        path = tmp_path / "a.at2"
        path.write_text(files.free_at2().replace("The units are (g)\n", ""))
        refused(path, "does not state the units of its samples; specify")
        record = read_record(path, units="gal")
        assert record.pga == pytest.approx(0.015)
        assert (record.units, record.units_from) == ("gal", "given")

    def test_units_of_other_quantity_are_refused(self):
        for units in ("CM/S", "CM", "IN/SEC"):
            refused(
                files.at2(units=units),
                f"must be a unit of acceleration, but the header states '{units}'",
            )
        refused(
            files.at2().replace("ACCELERATION", "VELOCITY"),
            "must be a unit of velocity, but the header states 'G'",
        )

    def test_velocity_and_displacement_are_read(self, tmp_path):
        (tmp_path / "a.VT2").write_text(files.at2(units="CM/S").replace("ACCELERATION", "VELOCITY"))
        record = read_record(tmp_path / "a.VT2")
        assert (record.quantity, record.units, record.units_from) == ("velocity", "cm/s", "file")
        expected = moved(0.01 * motion(), record.dt, "velocity").acceleration
        np.testing.assert_allclose(record.acceleration, expected, rtol=1e-12, atol=1e-12)
        (tmp_path / "a.DT2").write_text(
            files.at2(units="CM").replace("ACCELERATION", "DISPLACEMENT")
        )
        assert read_record(tmp_path / "a.DT2").quantity == "displacement"

    def test_wrong_number_of_values_is_refused(self):
        refused(
            files.at2(npts=121),
            "cut off: the header states 121 values after line 4, the file has 120",
        )
        refused(files.at2(npts=119), "more than the 119 values")
        refused(files.at2(npts=115), "follows the 115 values stated in the header")

    def test_values_without_blanks_are_separated(self):
        trace = only("NPTS= 4, DT= .01\n-1.5E-01-2.5E+00 1.D-2\n-.125\n")
        np.testing.assert_array_equal(trace.data, [-0.15, -2.5, 0.01, -0.125])


class TestCosmos:
    def test_seed_codes_are_read(self):
        trace = only(files.cosmos())
        np.testing.assert_array_equal(trace.data, motion())
        assert trace.id == "XX.FAR.10.HNE"
        assert (trace.stats.delta, trace.stats.tdint_units) == (0.01, "cm/s^2")
        assert str(trace.stats.starttime) == "2005-06-16T20:53:04.400000Z"

    def test_station_codes_without_start_time(self):
        text = files.cosmos(codes=False).replace("    2005\n     167", "    -999\n     167")
        trace = only(text)
        assert trace.id == "CE.J2236.1.340"
        assert trace.stats.starttime.timestamp == 0

    @pytest.mark.parametrize(
        ("units", "expected"),
        [("g (2)", "g"), ("cm/s^2", "cm/s^2"), ("in/sec2(07)", "in/s^2"), ("?(02)", "g")],
    )
    def test_units_in_header(self, units, expected):
        assert only(files.cosmos(units=units)).stats.tdint_units == expected

    @pytest.mark.parametrize("quantity_name", ["raw acceleration", "raw accel."])
    def test_counts_require_value_of_count(self, tmp_path, quantity_name):
        path = tmp_path / "a.v0"
        path.write_text(
            files.cosmos(np.arange(1, 121), units="counts (50)", quantity=quantity_name)
        )
        refused(path, "counts of a recorder")
        assert read_record(path, units="0.01 gal").pga == pytest.approx(0.012)

    def test_several_channels_and_blocks_are_read(self):
        blocks = [("velocity", motion(peak=3.0)), ("displacement", motion(peak=4.0))]
        second = files.cosmos(motion(peak=-2.25), codes=False, channel="2: Up", blocks=blocks)
        traces = contents(files.cosmos(codes=False, blocks=blocks) + second).traces
        assert [trace.id for trace in traces] == ["CE.J2236.1.340", "CE.J2236.2.UP"]
        assert [np.abs(trace.data).max() for trace in traces] == [1.5, 2.25]

    def test_channels_with_equal_names_are_numbered(self):
        traces = contents(files.cosmos() + files.cosmos()).traces
        assert [trace.id for trace in traces] == ["XX.FAR.101.HNE", "XX.FAR.102.HNE"]

    def test_invalid_files_are_refused(self):
        refused(
            files.cosmos(quantity="velocity"), "unit of velocity, but the header states 'cm/sec2'"
        )
        assert (
            only(files.cosmos(quantity="velocity", units="cm/sec(05)")).stats.tdint_units == "cm/s"
        )
        refused(
            files.cosmos(units="volts(51)"), "unit of acceleration, but the header states 'volts'"
        )
        refused(
            files.cosmos().replace("    10.000000", "  -999.000000"),
            "does not state the sampling interval",
        )
        refused(
            files.cosmos(np.where(motion() == 1.5, -999.0, motion())), "1 sample marked as unknown"
        )
        refused(files.cosmos().replace("/& ", "// "), "end-of-data line not found")
        refused(
            files.cosmos().replace("approx   1 secs", "approx  90 secs"),
            "120 samples at the interval of 0.01 s",
        )

    def test_fixed_columns_without_blanks_are_read(self):
        values = np.array([1.5, -999.25, 1234.25, 9999.5, -2.0, 0.25] * 20)
        text = files.cosmos(values)
        assert "-999.250001234.250009999.50000" in text
        np.testing.assert_array_equal(only(text).data, values)


class TestCsmip:
    def test_volume_2_is_read(self):
        traces = contents(files.csmip_v2()).traces
        assert [trace.id for trace in traces] == [".36456.1.90", ".36456.2.UP"]
        for trace, peak in zip(traces, (150.5, -75.25), strict=True):
            np.testing.assert_array_equal(trace.data, motion(peak=peak))
            assert (trace.stats.delta, trace.stats.tdint_units) == (0.02, "cm/s^2")
            assert str(trace.stats.starttime) == "1983-05-02T23:42:48.200000Z"

        data = "{n} points of {kind} data equally spaced at  .005 sec, in {units}. (8f10.3)"
        assert contents(files.csmip_v2(data=data)).traces[0].stats.delta == 0.005

    @pytest.mark.parametrize(
        "line",
        [None, " 120 POINTS OF ACCEL DATA EQUALLY SPACED AT .005 SEC.  (UNITS: G)"],
        ids=["by rate", "by step"],
    )
    def test_volume_1_is_read(self, line):
        text = files.csmip_v1()
        traces = contents(
            re.sub(r"(?m)^ 120 Accelerogram points.*$", line, text) if line else text
        ).traces
        assert [trace.id for trace in traces] == [".36456.1.360", ".36456.2.UP"]
        for trace, peak in zip(traces, (0.125, -0.5), strict=True):
            np.testing.assert_array_equal(trace.data, motion(peak=peak))
            assert (trace.stats.delta, trace.stats.tdint_units) == (0.005, "g")

    @pytest.mark.parametrize(
        ("line", "code"),
        [
            ("360 DEG  (STA CHN:  8)     LOCATION: DECK: NEAR NORTH ABUTMENT", "360"),
            (" 90 DEG     LOCATION: GROUND FLOOR", "90"),
            ("EW       (STA CHN:  1)", "EW"),
            ("UP", "UP"),
            ("N65W DEGREES", "N65W"),
        ],
    )
    def test_azimuth_is_read_from_channel_line(self, line, code):
        trace = next(iter(contents(files.csmip_v2({line: 10.0})).traces))
        assert trace.stats.channel == code

    def test_peaks_of_velocity_and_displacement_in_file_are_used(self, tmp_path):
        path = tmp_path / "a.v2"
        path.write_text(files.csmip_v2({" 90 DEG": 150.5}))
        record = read_record(path)
        assert record.peaks == (pytest.approx(0.7525), pytest.approx(0.7525))
        measures = measure(record)
        assert (measures.pgv, measures.pgd) == record.peaks
        assert "the peak velocity is from the velocity in the file" in measures.notes[0]
        assert measure(record.scaled(-2.0)).pgv == pytest.approx(1.505)
        changed = process(record, baseline="constant")
        assert changed.peaks == (None, None)
        assert measure(changed).pgv != measures.pgv

    def test_wrong_peak_velocity_is_refused(self):
        text = files.csmip_v2({" 90 DEG": 150.5})
        line = "PEAK ACCELERATION =  150.500    CM/SEC/SEC  AT   10.940   SEC.\n"
        more = "PEAK   VELOCITY   =   {}      CM/SEC    AT    5.080   SEC.\n"
        assert contents(text.replace(line, line + more.format("-75.250"))).notes == ()
        refused(
            text.replace(line, line + more.format("-82.912")),
            "peak velocity of 82.912 CM/SEC, but the data that were read have 75.25",
        )

    def test_channel_is_selected_by_component(self, tmp_path):
        path = tmp_path / "a.v2"
        path.write_text(files.csmip_v2({"  0 DEG": 10.0, " 90 DEG": 20.0, "90 DEG": 30.0}))
        assert [record.pga for record in read_records(path)] == pytest.approx([0.1, 0.2, 0.3])
        assert read_record(path, component="0").pga == pytest.approx(0.1)
        refused(
            path,
            r"several components match '90', choose one: .36456.2.90, .36456.3.90",
            component="90",
        )

    @pytest.mark.parametrize("write", [files.csmip_pairs, files.usc])
    @pytest.mark.parametrize("first", [0.0, 99.0])
    def test_pairs_of_time_and_acceleration_are_read(self, write, first):
        """From 100 s on there are no blanks between the pairs."""
        trace = only(write(motion(400), times=first + np.arange(400) * 0.005))
        np.testing.assert_array_equal(trace.data, motion(400))
        assert (trace.stats.delta, trace.stats.tdint_units) == (0.005, "0.1 g")

    def test_uneven_film_times_are_noted(self):
        times = np.arange(4000) * 0.00425 + 0.008 * np.sin(np.arange(4000) / 600)
        found = contents(files.usc(motion(4000), times=times))
        (trace,) = found.traces
        assert trace.stats.delta == 0.001
        printed = np.round(times, 3)
        grid = np.round((printed - printed[0]) / 0.001).astype(int)
        np.testing.assert_allclose(trace.data[grid], motion(4000), atol=1e-12)
        between = np.interp(np.arange(trace.data.size) * 0.001, printed - printed[0], motion(4000))
        np.testing.assert_allclose(trace.data, between, atol=1e-12)
        (note,) = found.notes
        assert states(note, "the times in the file ... interpolated ... 0.001 s")

    def test_invalid_files_are_refused(self):
        times = np.arange(120) * 0.005
        times[60:] += 0.02  # a piece missing on film
        refused(files.usc(times=times), "not at equal steps")
        text = files.csmip_v2()
        refused(text[: text.index("120 POINTS OF DISPL")], "no block of DISPL found")
        refused(files.csmip_pairs(units="VOLTS"), "must be a unit of acceleration")
        refused(files.usc() + "   1.000  .1000\n", "follows the 120 values stated in the header")
        refused(
            files.csmip_v1().replace("at 200 pts", "at 0 pts"),
            "sampling rate must be positive, but line 37 states 0",
        )

    def test_wrong_peak_is_refused(self):
        sound = files.csmip_v2()
        for stated in ("-160.500", "  15.050"):
            text = sound.replace("PEAK ACCELERATION =  150.500", f"PEAK ACCELERATION = {stated}")
            refused(
                text,
                rf"90: the file states a peak of {abs(float(stated)):g} cm/s\^2, but the data "
                r"that were read have 150.5 cm/s",
            )
        (note,) = contents(
            sound.replace("PEAK ACCELERATION =  150.500", "PEAK ACCELERATION =  151.500")
        ).notes
        assert states(note, "90: ... peak of 151.5 cm/s^2, ... 150.5 cm/s^2")

        # The maximum is in g, but the samples are in tenths of g; confusing them would cause a
        # factor of ten.
        sound = files.csmip_pairs()
        assert "G/10" in sound
        assert "peak" in contents(sound).compared
        refused(
            sound.replace("MAX  =  -0.150 G", "MAX  =  -1.500 G"),
            "states a peak of 1.5 g, but the data that were read have 0.15 g",
        )


class TestUsc:
    def test_text_may_follow_the_last_point(self):
        trace = only(files.usc() + "VLEE $\n\x1a")
        np.testing.assert_array_equal(trace.data, motion())

    @pytest.mark.parametrize("line_first", [False, True])
    @pytest.mark.parametrize("blocks", [("ACC",), ("ACC", "VEL", "DIS")])
    def test_volume_2_has_units_of_its_peak(self, line_first, blocks):
        """The header also states g/10, the unit of volume 1."""
        found = contents(files.usc_2(line_first=line_first, blocks=blocks))
        (trace,) = found.traces
        np.testing.assert_array_equal(trace.data, motion(peak=150.5))
        assert (trace.id, trace.stats.delta, trace.stats.tdint_units) == (
            ".0057..N00W",
            0.01,
            "cm/s^2",
        )
        assert trace.stats.tdint_event == "SOME EARTHQUAKE JAN 17, 1994 -1230 GMT"
        assert found.compared == ("number of samples", "peak")
        pgv = 0.1505 if len(blocks) > 1 else None
        assert trace.stats.tdint_peaks == (pytest.approx(pgv) if pgv else None, None)

    def test_peak_may_have_more_decimals_than_samples(self):
        assert contents(files.usc_2(peak=150.5004)).notes == ()

    @pytest.mark.parametrize("line_first", [False, True])
    def test_invalid_volume_2_is_refused(self, line_first):
        refused(files.usc_2(peak=15.05, line_first=line_first), "states a peak of 15.05 cm/s")
        for count in (112, 121):
            refused(files.usc_2(count=count, line_first=line_first), f"states {count} values, but")
        lines = files.usc_2(line_first=line_first).splitlines()
        for kept in (lines[:-20] + lines[-19:], [*lines, lines[-5]], lines[:40], lines[:28]):
            refused("\n".join(kept), "values|cut off")
        texts = files.usc_2(line_first=line_first).replace("POINTS OF ACC", "POINTS OF XYZ")
        refused(texts, "no line above line|no values of ACC|unknown format")


class TestSmc:
    def test_samples_at_unequal_times_are_interpolated(self):
        """The times are hand-digitized: their intervals are 5 to 40 ms."""
        steps = np.random.default_rng(1).integers(5, 40, 119)
        times, values = np.concatenate([[0], np.cumsum(steps)]) / 1000.0, motion()
        pairs = np.column_stack([times, values]).ravel()
        for order in (pairs, np.concatenate([times, values])):
            for count in (120, 240):  # of the samples, or of all values
                options = {"rate": 1.7e38, "npts": count}
                options["reals"] = {29: float(values.max()), 31: float(values.min())}
                found = contents(files.smc(order, **options))
                (trace,) = found.traces
                assert trace.stats.delta == 0.001
                np.testing.assert_allclose(trace.data[np.round(times * 1000).astype(int)], values)
                grid = np.arange(trace.data.size) * 0.001
                np.testing.assert_allclose(trace.data, np.interp(grid, times, values), atol=1e-12)
                assert states(found.notes[0], "interpolated linearly ... sampled at 0.001 s")

    def test_times_with_many_decimals_lose_no_peak(self):
        """The step is a fraction of the mean interval; each time is rounded to it."""
        rng = np.random.default_rng(2)
        times = np.cumsum(rng.uniform(0.002, 0.03, 120))
        printed = np.array([float(f"{time:.4E}") for time in times])
        values = motion()
        pairs = np.column_stack([printed, values]).ravel()
        options = {"reals": {29: float(values.max()), 31: float(values.min())}}
        trace = only(files.smc(pairs, rate=1.7e38, npts=120, **options))
        dt = trace.stats.delta
        assert dt <= np.diff(printed).min()
        at_times = trace.data[np.round((printed - printed[0]) / dt).astype(int)]
        np.testing.assert_allclose(at_times, values, atol=1e-12)

    def test_unequal_times_are_counted(self):
        pairs = np.column_stack([np.cumsum(np.full(120, 0.01)), motion()]).ravel()
        for npts in (119, 121, 239):
            refused(
                files.smc(pairs, rate=1.7e38, npts=npts),
                f"{npts} times and samples must follow line 29, got 240 values",
            )
        refused(files.smc(rate=1.7e38), "contain no increasing times")

    def test_header_of_comments_is_compared(self):
        """Every line of the header starts with #."""
        text = files.commented(files.smc())
        np.testing.assert_array_equal(only(text).data, only(files.smc()).data)
        assert only(text).stats.delta == 0.005
        refused(files.commented(files.smc(npts=126)), "states 126 values after line 29, .* has 120")

    def test_header_is_read(self):
        trace = only(files.smc())
        np.testing.assert_allclose(trace.data, motion(), rtol=1e-15)
        assert (trace.id, trace.stats.delta, trace.stats.tdint_units) == (
            ".SAF0A..360",
            0.005,
            "cm/s^2",
        )
        # By the day of the year, or by month and day where the text has a date
        by_month = dict(enumerate((1989, 10, 18, 0, 4, 7, 250), start=1))
        for text in (files.smc(), files.smc(integers=by_month)):
            assert str(only(text).stats.starttime) == "1989-10-18T00:04:07.250000Z"

    def test_invalid_files_are_refused(self, tmp_path):
        (tmp_path / "a.smc").write_text(files.smc(title="0 UNKNOWN"))
        refused(tmp_path / "a.smc", "does not state the units")
        assert only(files.smc(title="3 VELOCITY")).stats.tdint_units == "cm/s"
        refused(files.smc(title="5 RESPONSE SPECTRA"), "line 1 states '5 response spectra'")
        refused(files.smc(npts=119), "more than the 119")
        last = len(files.smc().splitlines())
        refused(files.smc(npts=112), f"line {last} follows the 112 values stated in the header")
        refused(files.smc(comments=3), "must be one of the 3 comments")


class TestEsm:
    def test_header_is_read(self):
        trace = only(files.esm())
        np.testing.assert_array_equal(trace.data, motion())
        assert (trace.id, trace.stats.delta, trace.stats.tdint_units) == (
            "XX.FAR1..HNE",
            0.005,
            "cm/s^2",
        )
        assert str(trace.stats.starttime) == "2019-07-28T16:09:19.870000Z"

    def test_invalid_files_are_refused(self):
        refused(files.esm(data_type="VELOCITY"), "must be a unit of velocity")
        assert only(files.esm(data_type="VELOCITY", units="cm/s")).stats.tdint_units == "cm/s"
        refused(files.esm(data_type="SPECTRUM"), "must contain a ground motion, got 'spectrum'")
        refused(
            files.esm(units="cm/s"), "must be a unit of acceleration, but the header states 'cm/s'"
        )
        refused(files.esm(ndata=121), "states 121 values")
        refused(files.esm(ndata=119), "line 138 follows the last row stated in the header")
        refused(files.esm(ndata="many"), "must state NDATA and SAMPLING_INTERVAL_S")
        for dt in ("0.0", "-1.0", "1000.0"):
            refused(files.esm().replace("0.005000", dt), "sampling interval of")


class TestGeonet:
    @pytest.mark.parametrize("volume", [1, 2])
    def test_components_are_read(self, volume):
        traces = contents(files.geonet(volume)).traces
        assert [trace.id for trace in traces] == [".FARS..S16W", ".FARS..S74E", ".FARS..UP"]
        for trace, peak in zip(traces, (41.6, -194.0, 27.3), strict=True):
            np.testing.assert_array_equal(trace.data, motion(peak=peak, decimals=1))
            assert (trace.stats.delta, trace.stats.tdint_units) == (0.02, "mm/s^2")
            assert str(trace.stats.starttime) == "2018-02-12T21:15:17.000000Z"

    def test_value_of_reading_is_unit(self):
        trace = contents(files.geonet(1, readings="2.50")).traces[0]
        assert trace.stats.tdint_units == "2.50 mm/s^2"

    def test_invalid_files_are_refused(self):
        refused(
            files.geonet().replace("at 0.020 sec", "at 0.010 sec"),
            "0.02 s as a number, but as 0.010 s",
        )
        refused(files.geonet() + "one line more\n", "cut off")
        refused(files.geonet(1, readings="0.00"), "the header states 0.00 mm/s/s")


class TestLargeFiles:
    def test_too_large_file_is_refused_before_reading(self, monkeypatch):
        monkeypatch.setattr("tdint.ground_motion.formats.lines._LARGEST", 1000)
        refused(files.at2(), "must not exceed 64 MiB")


class TestNumbersOfSmc:
    """Tests of the 48 integers and 50 reals at their positions in the format description; the first
    of each is the value for unknown numbers."""

    @pytest.mark.parametrize(
        ("vertical", "azimuth", "name"),
        [
            (90, 0, "0"), (90, 270, "270"), (90, -99, ""), (0, -99, "UP"), (180, 45, "DOWN"),
            (-99, 45, "45"),
        ],
    )  # fmt: skip
    def test_component_from_azimuths(self, vertical, azimuth, name):
        assert only(files.smc(integers={0: -99, 12: vertical, 13: azimuth})).stats.channel == name
        assert only(files.smc(integers={0: 0, 12: 0, 13: 30})).stats.channel == "30"

    @pytest.mark.parametrize(
        ("largest", "smallest", "peak"),
        [(3.0, -5.0, -5.0), (6.0, -5.0, 6.0), (1e38, -5.0, None), (3.0, 1e38, None)],
    )
    def test_peak_from_stated_extremes(self, largest, smallest, peak):
        """The peak is the larger of the stated extremes, with five digits; it is unknown if one of
        them is unknown."""
        text = files.smc(motion(peak=peak or 5.0), reals={0: 1e38, 29: largest, 31: smallest})
        compared = contents(text)
        assert ("peak" in compared.compared) == (peak is not None) and compared.notes == ()
        if peak:
            assert (
                contents(
                    files.smc(motion(peak=peak), reals={29: 1.00009 * abs(peak), 31: 0.0})
                ).notes
                == ()
            )
            (note,) = contents(
                files.smc(motion(peak=peak), reals={29: 1.0003 * abs(peak), 31: 0.0})
            ).notes
            assert "peak" in note

    @pytest.mark.parametrize("stated_date", ["", "  1994 1 17  x", "1994 01 18"])
    def test_start_from_day_of_year_or_date(self, stated_date):
        """The day of the year is used, or month and day if the date is close to the day in the
        text."""
        texts = ["", stated_date, "x"]
        by_day = [-99.0, 1994.0, 17.0, 12.0, 30.0, 55.0, 250.0, 99.0]
        assert usgs._start(by_day, texts) == datetime(1994, 1, 17, 12, 30, 55, 250000)
        by_month = [-99.0, 1994.0, 1.0, 17.0, 12.0, 30.0, 55.0, 250.0]
        assert usgs._start(by_month, texts) == (
            datetime(1994, 1, 17, 12, 30, 55, 250000)
            if stated_date
            else datetime(1994, 1, 1, 17, 12, 30, 55000)
        )
        for index in range(1, 6):
            unknown = by_day.copy()
            unknown[index] = -99.0
            assert usgs._start(unknown, texts) is None
        assert usgs._start([*by_day[:6], -99.0, -99.0], texts) == datetime(1994, 1, 17, 12, 30, 55)
        for day in (0.0, 367.0):
            assert usgs._start([-99.0, 1994.0, day, *by_day[3:]], texts) is None
        later = usgs._start([-99.0, 1994.0, 20.0, *by_day[3:]], texts)
        assert later == (None if stated_date else datetime(1994, 1, 20, 12, 30, 55, 250000))


class TestAlphanumericSac:
    def test_samples_and_header_are_those_of_sac(self, tmp_path):
        """The samples keep the digits of the text, of which a binary file keeps about seven."""
        values = np.round(1000.0 * motion(decimals=6), 4)
        path = tmp_path / "a.sac"
        path.write_text(files.sac_text(values))
        record = read_record(path, units="cm/s^2")
        np.testing.assert_allclose(record.acceleration, 0.01 * values, rtol=1e-7)
        assert (record.id, record.dt, record.event) == ("TW.TAP006..HNE", 0.01, "Somewhere")
        assert record.start == "1999-01-12T03:04:05.600000Z"
        assert "peak (largest sample)" in record.header_checks
        refused(path, "does not state the units")

    def test_file_is_compared_with_its_header(self):
        refused(files.sac_text(npts=121), "cut off: the header states 121 values")
        refused(files.sac_text(npts=119), "more than the 119 values")
        refused(files.sac_text(npts=115), "follows the 115 values")
        refused(files.sac_text(depmax=2.0), r"peak \(largest sample\) of 2")
        refused(files.sac_text(dt=-0.01), "not valid|sampling interval")
