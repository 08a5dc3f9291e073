"""Plain text with one or two columns: declarations, column names and refused input."""

import numpy as np
import pytest

from ground_motion.format_files import motion, one_column, text, two_columns
from ground_motion.test_formats import contents, only, refused
from tdint.ground_motion.reading.read import read_record, read_records
from tdint.units import STANDARD_GRAVITY


class TestOneColumn:
    @pytest.mark.parametrize(
        "header",
        [
            "# dt = 0.01 s, units = g",
            "% Sampling interval: 10 ms; Units: G",
            "dt: 0.01\nunits: g",
            "# Event: somewhere, far, dt=0.01 sec\n# acceleration (g)",
            "// sampling rate = 100 Hz\n! unit = g",
            "fs = 100\nacceleration_g",
            "# samples = 120, dt = .01, rate: x\n\n# units=g",
        ],
    )
    def test_declarations_in_header(self, header):
        trace = only(one_column(header=header))
        np.testing.assert_array_equal(trace.data, motion())
        assert (trace.stats.delta, trace.stats.tdint_units) == (0.01, "g")

    def test_names_and_start_in_header(self):
        header = (
            "# dt = 0.01 s, units = 0.1 g\n# network = XX, station = Far Hill, location = 00, "
            "component = NS\n"
            "# start = 2020-01-02T03:04:05+01:00"
        )
        trace = only(one_column(header=header))
        assert (trace.id, str(trace.stats.starttime)) == (
            "XX.Far-Hill.00.NS",
            "2020-01-02T02:04:05.000000Z",
        )
        assert only(one_column(header="# dt = 1 s\n# start: noon")).stats.starttime.timestamp == 0

    def test_blank_and_comment_lines_are_ignored(self):
        assert contents(one_column()).notes == ()
        np.testing.assert_array_equal(
            only("# dt = 1\n1\n\n# between\n2.5\n-.5").data, [1.0, 2.5, -0.5]
        )
        np.testing.assert_array_equal(only("\n\n0 1\n1 2.5\n").data, [1.0, 2.5])

    @pytest.mark.parametrize(
        ("header", "message"),
        [
            (
                None,
                "the sampling interval .* is required; declare it .* `# dt = 0.01 s, units = g`",
            ),
            ("# units = g", "sampling interval .* required"),
            ("# dt = 0 s", "dt .* header states '0 s'"),
            ("# dt = 0.01 h", "dt .* header states '0.01 h'"),
            ("# dt = 0.01, fs = 200", "sampling intervals, 0.01 s and 0.005 s"),
            ("# dt = 0.01, units = cm/min", "unit of acceleration, .*'cm/min'"),
            ("# dt = 0.01, samples = 121", "states 121 samples, but the table has 120"),
        ],
    )
    def test_invalid_headers_are_refused(self, header, message):
        refused(one_column(header=header), message)


class TestTwoColumns:
    @pytest.mark.parametrize(
        ("header", "separator", "units"),
        [
            ("time_s,acceleration_m_s2", ",", "m/s^2"),
            ("Time (s); Acceleration (cm/s^2)", "; ", "cm/s^2"),
            ("# t [sec]\ta [gal]", "\t", "cm/s^2"),
            ("Time (s)   Acc (g)", "   ", "g"),
            ('"time","ground_acceleration_mm_s2"', ",", "mm/s^2"),
            ("# units = g", " ", "g"),
            (None, ",", ""),
        ],
    )
    def test_names_and_separators(self, header, separator, units):
        trace = only(two_columns(header=header, separator=separator))
        np.testing.assert_array_equal(trace.data, motion())
        assert (trace.stats.delta, trace.stats.tdint_units) == (0.01, units)

    def test_milliseconds_and_decimal_commas(self):
        rows = text(
            "time_ms;acceleration_g",
            [f"{5 * i};{value:.3f}".replace(".", ",") for i, value in enumerate(motion())],
        )
        trace = only(rows)
        np.testing.assert_array_equal(trace.data, motion())
        assert trace.stats.delta == 0.005

    def test_trailing_separator_and_byte_order_mark(self):
        rows = two_columns().replace("\n", ",\n").replace("acceleration_m_s2,", "acceleration_m_s2")
        np.testing.assert_array_equal(only("\ufeff" + rows).data, motion())

    @pytest.mark.parametrize(
        ("dt", "decimals", "expected"),
        [
            (0.01, 2, 0.01),
            (0.005, 3, 0.005),
            (1 / 300, 4, 1 / 300),
            (1 / 128, 7, 1 / 128),
            (0.015, 3, 0.015),
        ],
    )
    def test_sampling_interval_of_rounded_times(self, dt, decimals, expected):
        assert only(two_columns(dt=dt, decimals=decimals)).stats.delta == expected

    def test_declared_interval_must_agree_with_times(self):
        assert only(two_columns(header="# dt = 0.01")).stats.delta == 0.01
        refused(two_columns(header="# dt = 0.02"), "sampling intervals, 0.02 s and 0.01 s")

    # A time may slip by a fiftieth of the interval.
    @pytest.mark.parametrize(
        ("later", "change", "message"),
        [
            *(
                (50, change, "steps of 0.0[01].* s: the interval after 0.69 s is 0.0")
                for change in (0.01, 4e-3, -4e-3)
            ),
            (1, 0.0003, "steps of 0.01 s"),
            (1, 0.00015, None),
            (1, -0.00015, None),
        ],
    )
    def test_unequal_time_steps_are_refused(self, later, change, message):
        times = np.arange(120) * 0.01
        times[70 : 70 + later] += change
        rows = text([f"{t:.5f} {value:.3f}" for t, value in zip(times, motion(), strict=True)])
        if message:
            refused(rows, f"not at equal {message}")
        else:
            assert only(rows).stats.delta == 0.01

    def test_times_must_increase(self):
        lines = two_columns().splitlines(keepends=True)
        refused(
            "".join([*lines[:50], *lines[40:]]), "times must increase, but do not after sample 48"
        )
        refused(two_columns(dt=0.004, decimals=2), "times must increase, but do not after sample 0")


class TestOtherText:
    @pytest.mark.parametrize(
        ("other", "message"),
        [
            ("period_s,psa_m_s2\n0.1,2\n0.2,3\n", "spectrum"),
            ("time_s,temperature\n0.1,2\n0.2,3\n", "not a ground motion"),
            ("0.2 2 3\n0.1 3 4\n", "3 values per line"),
            ("0.1\n", "only one row"),
            ("1,,2\n2,,3\n", "cell is empty"),
            ("1 2\n2 3\n3 4 5\n", "from line 1 have different numbers of values, 2 to 3;"),
            ("3 1\n2 1\n1 1\n", "2 values per line"),
            ("mass: 5\n1\n2\n", "sampling interval .* required"),
            ("nan\nnan\n", "unknown format"),
        ],
    )
    def test_other_text_is_refused(self, other, message):
        refused(other, message)

    def test_words_after_first_rows_are_refused(self):
        refused(one_column() * 100 + "end\n1\n", "follow the text 'end'")
        refused(two_columns() + "1.2, nan\n", "'1.2, nan' next to the samples must contain numbers")

    def test_truncated_last_number_is_refused(self):
        rows = "".join(f"{value:.3f}\n" for value in motion(80))
        assert only(f"# dt = 1, units = g\n0\n{rows}0").data[-1] == 0.0
        refused(f"# dt = 1, units = g\n{rows}0", "cut off within its last number")


class TestTables:
    """Tests of tables with several components, or with velocity and displacement next to the
    acceleration."""

    t = np.arange(60) * 0.02

    def table(self, header, columns, separator=","):
        rows = np.column_stack([self.t, *columns])
        return text(
            [header] if header else [],
            [separator.join(f"{value:.4f}" for value in row) for row in rows],
        )

    @pytest.fixture
    def three(self):
        return [motion(60, peak, 4) for peak in (1.0, -2.0, 0.5)]

    def test_peaks_are_taken_from_velocity_and_displacement_columns(self, tmp_path, three):
        (tmp_path / "a.csv").write_text(self.table("Time (s),Acc (g),Vel (cm/s),Disp (cm)", three))
        record = read_record(tmp_path / "a.csv")
        assert (record.pga, record.units) == (pytest.approx(STANDARD_GRAVITY), "g")
        assert record.peaks == (pytest.approx(0.02), pytest.approx(0.005))
        assert record.header_checks == ("sampling interval",)

    def test_missing_units_are_not_guessed(self, tmp_path, three):
        (tmp_path / "a.csv").write_text(self.table("Time,Acc,Vel,Disp", three))
        refused(tmp_path / "a.csv", "does not state the units")
        record = read_record(tmp_path / "a.csv", units="gal")
        assert (record.pga, record.peaks) == (pytest.approx(0.01), (None, None))

    @pytest.mark.parametrize(
        ("header", "separator", "names"),
        [
            ("t N V E", " ", ("N", "V", "E")),
            ("Time\tNS\tUD\tEW", "\t", ("NS", "UD", "EW")),
            ("time_s,HNE_gal,HNN_gal,HNZ_gal", ",", ("HNE", "HNN", "HNZ")),
            ("time;acc_x;acc_y;acc_z", ";", ("X", "Y", "Z")),
            ("# units = gal\ntime,090,360,UP", ",", ("090", "360", "UP")),
            ("", "  ", ("2", "3", "4")),
        ],
    )
    def test_components_of_table(self, tmp_path, three, header, separator, names):
        for mark, encoding in (
            (b"", "utf-8"),
            (b"\xef\xbb\xbf", "utf-8"),
            (b"\xff\xfe", "utf-16-le"),
        ):
            data = mark + self.table(header, three, separator).encode(encoding)
            (tmp_path / "a.csv").write_bytes(data)
            units = None if "gal" in header else "gal"
            records = read_records(tmp_path / "a.csv", units=units)
            assert tuple(record.component for record in records) == names
            assert [record.pga for record in records] == pytest.approx([0.01, 0.02, 0.005])
            assert read_record(
                tmp_path / "a.csv", units=units, component=names[1]
            ).pga == pytest.approx(0.02)

    def test_invalid_tables_are_refused(self, three):
        refused(self.table("time,N,E", three), "names 3 columns, but the rows have 4")
        refused(
            self.table("time,N (g),E (s),Z (g)", three),
            "must be a unit of acceleration, but the header states 's'",
        )
        refused(
            self.table("time,N,E,Z", three) + "1.2,1,2\n", r"unknown format|must contain 4 numbers"
        )
