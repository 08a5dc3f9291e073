"""Forms in which programs write tables: first lines that are no samples, spectra, times and text in
any column, lists, statements and units of headers."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from facts import states
from ground_motion.files import trace, write
from ground_motion.free_tables import accelerogram, column, lines
from ground_motion.test_free_tables import message, read
from selection import every
from tdint.errors import RecordError
from tdint.ground_motion.missing import IncompleteRecord, OtherContent
from tdint.units import STANDARD_GRAVITY

COUNT = 600
A, B = np.round([accelerogram(COUNT, peak, seed) for seed, peak in ((1, 0.3), (2, 0.25))], 6)
TIMES = 0.01 * np.arange(COUNT)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "a.txt"


def table(*columns, separator=",", end="", forms=None):
    forms = forms or ["%.2f"] + ["%.6f"] * (len(columns) - 1)
    rows = zip(*columns, strict=True)
    return "".join(separator.join(map(str.__mod__, forms, row)) + end + "\n" for row in rows)


def is_read(file, content, *motions, unit=STANDARD_GRAVITY, units=None, **layout):
    """Check that a file contains these motions with the sampling interval .01 s."""
    records = read(file, content, units, **layout)
    assert [record.dt for record in records] == pytest.approx([0.01] * len(motions))
    for record, motion in zip(records, motions, strict=True):
        np.testing.assert_allclose(record.acceleration, unit * motion, atol=1e-6 * unit)
    return records


class TestFirstLines:
    @pytest.mark.parametrize(
        "first",
        [
            "1\n0.01\n", " 1 \n 1.000000e-02 \n", "1 0.01\n", f"{COUNT}\n0.01\n", "2\n1.0D-02\n",
            "a name\n1\n.01\n", f"953\n{COUNT}\n0.01\n", f"{COUNT}.\n0.01\n",
            f"name\n {COUNT}    1.00000E-02  0  0  0.  0.\n",
        ],
    )  # fmt: skip
    @pytest.mark.parametrize("width", [1, 6])
    def test_flag_or_count_and_interval(self, file, first, width):
        """The far-field set of FEMA P-695 has the lines 1 and .01 above its samples."""
        content = first + lines(A, width, " %.6f")
        layout = {"rows": True} if width > 1 else {}
        for step in (None, 0.01):
            is_read(file, content, A, units="g", step=step, **layout)
        assert states(message(file, content, "g", step=0.02, **layout), "0.01 s, which contradicts")

    @pytest.mark.parametrize("first", ["640\n0.01\n", "640 0.01\n", "0.01\n640\n", "a\n640\n.01\n"])
    def test_other_count_is_an_error(self, file, first):
        for step in (None, 0.01):
            found = message(file, first + column(A), "g", step=step)
            assert "640" in found
            assert "600" in found

    def test_zero_and_a_number_may_be_samples(self, file):
        rest = np.round(A[2:], 2)
        content = "0\n0.01\n" + column(rest, "%.2f")
        (record,) = read(file, content, "g", step=0.02)
        assert record.acceleration.size == COUNT

    def test_column_numbers(self, file):
        is_read(file, "0 1\n" + table(TIMES, A, separator=" "), A, units="g")

    def test_peak_in_the_first_sample_is_a_question(self, file):
        """It may be a peak or a factor of the header, unless an option or a name decides."""
        content = "# dt = 0.01 s, units = g\n1.000\n" + column(A, "%.3f")
        with pytest.raises(RecordError, match=r"1\.000 in line 2.*skip_lines=2.*skip_lines=0"):
            read(file, content)
        named = "# dt = 0.01 s\nAcceleration (g)\n1.000\n" + column(A, "%.3f")
        (record,) = read(file, named)
        assert any("first sample" in warning for warning in record.warnings)


@pytest.mark.parametrize(
    "header",
    [
        "T (s),Sa (g)", "Period (s),Sa (g)", "Frequency (Hz),FAS", "periodo (s),Sa (g)", "T,PSA",
        "Damping 5 %\nPeriod [sec],Acceleration [g]", "# Spectral acceleration",
        "Natural period (s),Spectral acceleration (g)",
    ],
)  # fmt: skip
@pytest.mark.parametrize("step", [None, 0.02])
def test_spectra_are_no_motions(file, header, step):
    for periods in (0.02 * np.arange(100), np.geomspace(0.01, 10.0, 100)):
        content = table(periods, np.exp(-periods), forms=["%.4f", "%.5f"])
        file.write_text(f"{header}\n{content}")
        with pytest.raises(OtherContent, match="spectr"):
            read(file, f"{header}\n{content}", "g", step=step)


class TestColumns:
    @pytest.mark.parametrize(
        "names", ["X,Y", "col1,col2", "a,b", "N,E", "", "Zeit,Signal", "# t y"]
    )
    def test_equal_steps_are_times_under_any_name(self, file, names):
        for start in (0.0, 3.4):
            content = names + "\n" * bool(names) + table(TIMES + start, A)
            for step in (None, 0.01):
                is_read(file, content, A, units="g", step=step)
            assert states(message(file, content, "g", step=0.02), "0.01 s, which contradicts")

    @pytest.mark.parametrize(
        ("names", "stamp"),
        [
            ("Date Time,X (g),Y (g)", "%Y-%m-%d %H:%M:%S.%f,"),
            ("Date,Time,X (g),Y (g)", "%Y/%m/%d,%H:%M:%S.%f,"),
            ("Timestamp;X (g);Y (g)", "%Y-%m-%dT%H:%M:%S.%fZ;"),
            ("Time,RelativeTime(s),X(g),Y(g)", "%Y/%m/%d %H:%M:%S,SECONDS,"),
            ("Time\tX (g)\tY (g)", "%H:%M:%S.%f\t"),
            ("Date Time X(g) Y(g)", "%Y-%m-%d %H:%M:%S.%f "),
            ("Name,Time (s),X (g),Y (g)", "ABC,SECONDS,"),
        ],
    )
    def test_dates_and_other_text(self, file, names, stamp):
        mark = stamp[-1]
        start = datetime(2020, 3, 11, 23, 59, 58)
        rows = [
            (start + timedelta(seconds=t)).strftime(stamp).replace("SECONDS", f"{t:.2f}")
            + f"{a:.6f}{mark}{b:.6f}\n"
            for t, a, b in zip(TIMES.tolist(), A, B, strict=True)
        ]
        is_read(file, f"{names}\n{''.join(rows)}", A, B)

    @pytest.mark.parametrize(
        ("names", "units", "mark"),
        [
            ("Time,LED,Table", "seconds,,g's", ","),
            ("Time;A1;A2", "[s];[g];[g]", ";"),
            ("Time A1 A2", "(sec) (g) (g)", " "),
        ],
    )
    def test_units_below_names(self, file, names, units, mark):
        content = f"{names}\n{units}\n{table(TIMES, A, B, separator=mark)}"
        is_read(file, content, B, column="3")

    @pytest.mark.parametrize(
        "content",
        [
            "t,acc_g\n" + table(TIMES, A) + ",\n" * 50,
            ",,,\nt,acc_g,,\n" + table(TIMES, A, end=",,") + ",,,\n",
            "t\tacc_g\t\n" + table(TIMES, A, separator="\t", end="\t"),
            ",t,acc_g\n" + table(np.arange(COUNT), TIMES, A, forms=["%d", "%.2f", "%.6f"]),
            "dt,0.01,,\nunits,g,,\n" + column(A),
        ],
    )
    def test_spreadsheets(self, file, content):
        is_read(file, content, A)

    @pytest.mark.parametrize("names", ['"time (ms)","N, left","N, right"', '"t, s" (ms),A,B'])
    def test_separators_between_quotation_marks(self, file, names):
        content = names + "\n" + table(1000.0 * TIMES, A, B)
        is_read(file, content, A, B, units="g", column=("2", "3"))

    @pytest.mark.parametrize("names", ["time (ms),Acc, g", "Time [msec] Acc of floor", "# t in ms"])
    def test_milliseconds_without_names_of_columns_are_refused(self, file, names):
        content = names + "\n" + table(1000.0 * TIMES, A)
        assert states(message(file, content, "g"), "the times may be in ms ... does not name")

    def test_words_of_a_statement_are_no_names(self, file):
        content = "DT= 0.01 SEC\nUNITS: GAL\n" + table(A, B, separator=" ", forms=["%.6f"] * 2)
        (record,) = is_read(file, content, A, unit=0.01, column="1")
        assert record.component == "1"


@pytest.mark.parametrize(
    "content",
    [
        lines(A, 5, "%14.6e").replace("\n", "\\\n"),
        "set ag {\\\n" + lines(A, 4, " %.6f").replace("\n", " \\\n") + "}\n",
        "ag = [ ...\n" + lines(A, 5, " %.6f").replace("\n", " ...\n") + "];\n",
        "list = (" + lines(A, 5, " %.6f,") + ")\n",
        "timeSeries Path 1 -dt 0.01 -values {\n" + lines(A, 8, " %.6f") + "}\n",
    ],
)
def test_lists(file, content):
    for rows in (False, True):
        is_read(file, content, A, units="g", step=0.01, rows=rows)


def test_numbers_of_cards_and_filled_rows(file):
    head = "ACCELERATION DT = 0.01 SEC, UNITS OF G\n"
    rows = lines(A[:-3], 8, "%9.6f").splitlines()
    cards = "".join(f"{row}{number:7d}\n" for number, row in enumerate(rows, start=1))
    is_read(file, head + cards, A[:-3])
    for stated in (f"# {COUNT - 3} points at equal spacing of 0.01 sec\n# units: g\n",
                   f"NPTS= {COUNT - 3}, DT= 0.01\nunits of g\n"):  # fmt: skip
        filled = np.append(A[:-3], np.zeros(3))
        is_read(file, stated + lines(filled, 8, "%10.6f"), A[:-3])
        filled[-1] = 0.01
        assert states(message(file, stated + lines(filled, 8, "%10.6f")), f"{COUNT - 3}")


@pytest.mark.parametrize(
    "header",
    [
        "% Acc. in cm/sec^2 and dt=0.01 sec.", "# acceleration in gal, sampling rate 100 Hz",
        "Acceleration (cm/s2), 100 samples per second", "Sampled at 100 Hz. Units are cm/s/s.",
        '"dt",0.01\n"units","cm/s2"', "Sampling Frequency (Hz),100,\nUnit,gal,",
        "# values in cm/s^2 every 0.01 s",
        "CORRECTED ACCELERATION CM/SEC/SEC  600 POINTS AT 0.01 SEC",
    ],
)  # fmt: skip
@pytest.mark.parametrize("mark", ["", "  ", "\t\t", ","])
def test_statements_count_in_every_layout(file, header, mark):
    columns, selected = ((A,), None) if not mark else ((B, A), "2")
    content = f"{header}\n{table(*columns, separator=mark, forms=['%.6f'] * len(columns))}"
    layout = {"column": selected} if selected else {}
    is_read(file, content, A, unit=0.01, **layout)
    assert states(message(file, content, step=0.02, **layout), "0.01 s, which contradicts")
    assert states(message(file, content, "g", **layout), "states its units (cm/s^2)")


@pytest.mark.parametrize(
    ("units", "value"),
    [
        ("m s^-2", 1.0), ("m·s⁻²", 1.0), ("m/seg2", 1.0), ("cm s-2", 0.01), ("m.s-2", 1.0),
        ("mg", 1e-3 * STANDARD_GRAVITY), ("%g", 1e-2 * STANDARD_GRAVITY), ("cm/sec²", 0.01),
        ("g's", STANDARD_GRAVITY), ("gal (cm/s/s)", 0.01),
    ],
)  # fmt: skip
def test_spellings_of_units(file, units, value):
    is_read(file, f"Time [s],Acceleration [{units}]\n{table(TIMES, A)}", A, unit=value)
    is_read(file, f"# dt = 0.01 s, units = {units}\n{column(A)}", A, unit=value)


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("# dt = 0.01 s, units = cm", 0.01), ("Displacement (mm), dt = 0.01 s", 1e-3),
        ("# dt = 0.01, units: m", 1.0), ("time (s),x (m)", 1.0), ("t,displacement (cm)", 0.01),
    ],
)  # fmt: skip
def test_displacements_become_accelerations(file, header, unit):
    motion = 0.1 * np.sin(3.0 * TIMES) ** 4
    content = column(motion / unit, "%.9e")
    if "," in header and "dt" not in header:
        content = table(TIMES, motion / unit, forms=["%.2f", "%.9e"])
    (record,) = read(file, f"{header}\n{content}")
    assert record.quantity == "displacement"
    sine, cosine = np.sin(3.0 * TIMES), np.cos(3.0 * TIMES)
    expected = 0.1 * 36.0 * sine**2 * (3.0 * cosine**2 - sine**2)
    np.testing.assert_allclose(record.acceleration[4:-4], expected[4:-4], atol=4e-3)


def test_everything_that_is_missing_is_stated_together(file):
    for content, missing in (
        (column(A), {"step": True, "units": "g", "columns": (), "rows": False}),
        (table(A, B, forms=["%.6f"] * 2),
         {"step": True, "units": "g", "columns": ("1", "2"), "rows": True}),
        ("time (s),p,q\n" + table(TIMES, A, B),
         {"step": False, "units": "g", "columns": ("p", "q"), "rows": False}),
    ):  # fmt: skip
        with pytest.raises(IncompleteRecord) as error:
            read(file, content)
        found = error.value.missing._asdict()
        assert {name: found[name] for name in missing} == missing


@pytest.mark.parametrize(("factor", "units"), [(1.0, "g"), (9.8, "m/s^2"), (980.0, "cm/s^2")])
def test_the_example_of_units_is_plausible(file, factor, units):
    """The example of a question is a command line that people follow."""
    with pytest.raises(IncompleteRecord) as error:
        read(file, "# dt = 0.01 s\n" + column(factor * A / np.max(np.abs(A))))
    assert error.value.missing.units == units


class TestUnitsOfNames:
    @pytest.mark.parametrize("name", ["X.ACC.MP.mseed", "X.HNE.D.VEL.CV.mseed", "a_disp.mseed"])
    def test_names_that_state_other_units(self, tmp_path, name):
        path = write(tmp_path / name, trace(np.sin(np.arange(400.0)), channel="HNE"))
        with pytest.raises(IncompleteRecord, match="units"):
            read_file(path)
        quantity = {"X.ACC": "cm/s^2", "X.HNE": "cm/s", "a_dis": "cm"}[name[:5]]
        assert read_file(path, quantity).units == quantity
        if quantity != "cm/s^2":
            with pytest.raises(RecordError, match="its name states"):
                read_file(path, "m/s^2")

    @pytest.mark.parametrize("period", every(2, [2.0, 20.0]))
    def test_impossible_velocities(self, tmp_path, period):
        motion = 25.0 * np.sin(2.0 * np.pi / period * 0.01 * np.arange(8000))
        path = write(tmp_path / "a.mseed", trace(motion, channel="HNE"))
        if period == 20.0:
            with pytest.raises(IncompleteRecord, match="peak velocity"):
                read_file(path)
        else:
            assert read_file(path).units_from == "assumed"


def read_file(path, units=None):
    from tdint.ground_motion.reading.read import read_record

    return read_record(path, units=units)


@pytest.mark.parametrize(
    ("name", "content", "facts"),
    [
        ("a.xls", b"\xd0\xcf\x11\xe0" + b"\0" * 600, "spreadsheet ... CSV"),
        ("a.json", b'{"dT": 0.01, "data": [0.1, 0.2, 0.3]}', "JSON"),
    ],
)
def test_other_files(tmp_path, name, content, facts):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordError) as error:
        read_file(tmp_path / name)
    assert states(str(error.value), facts)
