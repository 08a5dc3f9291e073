"""Roles of columns: telephones and loggers, titles, first lines, lists, resultants, components that
no name explains, damaged rows, and files that contain the quantities of one motion."""

import io
import json
import re

import numpy as np
import pytest

from facts import states
from ground_motion import format_files
from ground_motion.test_what_a_file_is import (
    DT,
    PEAK,
    TOTAL,
    A,
    B,
    C,
    T,
    column,
    is_right,
    message,
    read,
    table,
)
from tdint.errors import RecordError
from tdint.ground_motion.choice import Processing, RecordChoice
from tdint.ground_motion.formats.table_roles import axis
from tdint.ground_motion.reading.read import channel_records
from tdint.ground_motion.reading.suites import read_suite
from tdint.units import STANDARD_GRAVITY

TWO = table(T, A, mark=" ")
EPOCH = 1_700_000_000  # s


def of_rows(names, *columns, mark=","):
    """Return a table with texts."""
    return "\n".join([*([names] if names else []), *map(mark.join, zip(*columns, strict=True)), ""])


def texts(values, form="%.5f"):
    return [form % value for value in values]


def test_axis_permits_a_repeated_step_and_names_no_samples():
    repeated = np.insert(T, 300, T[300])
    assert axis(T).is_even
    assert not axis(T).breaks
    assert (axis(repeated).is_even, axis(repeated).breaks) == (True, 1)
    assert not axis(np.geomspace(0.01, 10.0, 80)).is_even
    assert axis(np.round(0.0025 * np.arange(600), 3)).is_even  # steps of 0.002 and 0.003
    assert axis(A) is None
    assert axis(np.zeros(100)) is None


# ---- Telephones and loggers


@pytest.mark.parametrize(("unit", "scale"), [("s", 1), ("ms", 1000), ("us", 10**6), ("ns", 10**9)])
@pytest.mark.parametrize("names", ["time,x", "timestamp,accel", "Time ({}),a", ""])
def test_unix_times_are_offsets(tmp_path, unit, scale, names):
    whole = [EPOCH * scale + i * scale // 100 for i in range(T.size)]
    times = [f"{EPOCH + i // 100}.{i % 100:02d}" for i in range(T.size)]
    times = times if unit == "s" else [*map(str, whole)]
    is_right(tmp_path, of_rows(names.format(unit), times, texts(A)), "g")


def test_seconds_are_preferred_to_nanoseconds(tmp_path):
    times = [str(EPOCH * 10**9 + 10**7 * i) for i in range(T.size)]
    names = "time,seconds_elapsed,z,y,x"
    content = of_rows(names, times, texts(T, "%.4f"), texts(C), texts(B), texts(A))
    records = read(tmp_path, content, "m/s^2")
    assert [record.component for record in records] == ["Z", "Y", "X"]
    assert [record.dt for record in records] == pytest.approx([DT] * 3)
    assert records[2].pga == pytest.approx(PEAK)


def test_times_of_a_running_clock_name_their_unit(tmp_path):
    content = of_rows(
        "timestamp,x", [str(123_456_789_012 + 10**7 * i) for i in range(600)], texts(A)
    )
    assert states(message(tmp_path, content, "g"), "in ns, specify `step=0.01` ... Time (ns)")
    is_right(tmp_path, content, "g", step=DT)


def test_resultant_is_the_largest_column(tmp_path):
    """The vertical component of a telephone contains gravity and has one sign, too."""
    vertical = C + 9.81
    total = np.sqrt(A**2 + B**2 + vertical**2)
    for names in ("t,x,y,z,all", "", "time,ax,ay,az,aT"):
        columns = [texts(v) for v in (T, A, B, vertical, total)]
        records = read(tmp_path, of_rows(names, *columns), "m/s^2")
        assert [r.pga for r in records] == pytest.approx(
            [np.max(np.abs(v)) for v in (A, B, vertical)], abs=1e-5
        )


def test_unequal_times_are_interpolated_if_resampled(tmp_path):
    """The motion is linear between its samples, so that its peak remains."""
    times = T + np.where(np.arange(T.size) % 3 == 1, 0.002, 0.0)
    content = of_rows("Time (s),Acc (g)", texts(times, "%.3f"), texts(A))
    assert states(message(tmp_path, content), "not at equal steps ... `resample=0.01`")
    choice = RecordChoice(processing=Processing(resample=0.001))
    (record,) = channel_records(str(tmp_path / "a.txt"), choice, single=False)
    assert record.dt == pytest.approx(0.001)
    grid = 0.001 * np.arange(record.acceleration.size)
    expected = STANDARD_GRAVITY * np.interp(grid, times, A)
    assert record.acceleration == pytest.approx(expected, abs=1e-9)


def test_other_sensors_of_a_telephone_are_listed(tmp_path):
    names = "time,seconds_elapsed,z,y,x"
    times = [str(EPOCH * 10**9 + 10**7 * i) for i in range(T.size)]
    xyz = of_rows(names, times, texts(T, "%.4f"), texts(C), texts(B), texts(A))
    (tmp_path / "Accelerometer.csv").write_text(xyz)
    (tmp_path / "Gyroscope.csv").write_text(xyz)
    (tmp_path / "turn.csv").write_text(table(T, A, B, names="Time (s),X (rad/s),Y (rad/s)"))
    (tmp_path / "path.csv").write_text(table(T, A + 45, B + 7, names="Time,Latitude,Longitude"))
    suite = read_suite([str(tmp_path)], RecordChoice("m/s^2"))
    assert not suite.failures
    assert len(suite.motions) == 2  # the horizontal components
    assert states(suite.notes[0], "Gyroscope.csv ... path.csv, turn.csv (other quantities)")


# ---- Names and titles


@pytest.mark.parametrize("names", ["EO VER NS", "EO,NS,UD", "N-S E-O Z", "NS OE UP"])
def test_este_oeste_is_a_component(tmp_path, names):
    mark = "," if "," in names else " "
    records = read(
        tmp_path, table(A, B, C, names=names, mark=mark, forms=["%.5f"] * 3), "g", step=DT
    )
    assert [record.component for record in records] == names.split(mark)


@pytest.mark.parametrize("names", ["t,X,Y,sensor", "t,HNE,HNN,foo", "Time,EW,NS,third"])
def test_unknown_column_next_to_components_is_asked_for(tmp_path, names):
    content = table(T, A, B, C, names=names)
    unknown = names.rpartition(",")[2]
    assert states(message(tmp_path, content, "g"), f"select the ground motion ... {unknown}")
    one_sided = table(T, A, B, np.abs(C) + 20, names=names)  # a temperature
    assert len(read(tmp_path, one_sided, "g")) == 2


@pytest.mark.parametrize(
    "title", ["Time series EW", "time history of X", "Test of the table", "Earthquake record, NS"]
)
def test_title_of_as_many_words_as_columns_names_none(tmp_path, title):
    columns = (A, B, C)[: len(title.split()) - 1]
    records = read(tmp_path, table(T, *columns, names=title, mark=" "), "g")
    assert [r.pga for r in records] == pytest.approx(
        [STANDARD_GRAVITY * np.max(np.abs(v)) for v in columns]
    )


def test_title_above_pairs_names_no_columns(tmp_path):
    words = [f"{t:.2f} {a:.5f}" for t, a in zip(T, A, strict=True)]
    rows = "\n".join("  ".join(words[i : i + 3]) for i in range(0, 600, 3))
    for title in ("Time series of station 86 EW", "Time Acc Time Acc Time Acc"):
        is_right(tmp_path, f"{title}\n{rows}\n", "g")


@pytest.mark.parametrize("names", ["t a", "time,acc"])
@pytest.mark.parametrize("row", ['"{}"', "r{}", "{}"])
def test_names_of_rows_have_no_name(tmp_path, names, row):
    mark = "," if "," in names else " "
    rows = [row.format(i) for i in range(T.size)]
    is_right(tmp_path, of_rows(names, rows, texts(T, "%.2f"), texts(A), mark=mark), "g")


# ---- First lines


@pytest.mark.parametrize(
    "line",
    [
        *("% NPTS= 600, DT= .01", "NPTS= 600, DT= 0.01 SEC", "# 600 0.01", "#600 0.0100 0 0 0."),
        *("! 600 points at 0.01 s", "; NPTS=600, DT=.01", '"NPTS= 600, DT= .01"'),
    ],
)
def test_header_above_columns(tmp_path, line):
    is_right(tmp_path, f"{line}\n{TWO}", "g")
    is_right(tmp_path, f"{line}\n{column(A)}", "g")
    xyz = f"{line}\n{table(A, B, C, mark=' ', forms=['%.5f'] * 3)}"
    assert len(read(tmp_path, xyz, "g", column=("1", "2", "3"))) == 3


@pytest.mark.parametrize("first", ["0.01", "0.0100000", "1.0000000E-02", "0.01000"])
@pytest.mark.parametrize("form", ["%.5f", "%.7E", "%g"])
def test_zero_below_the_step_is_a_sample(tmp_path, first, form):
    is_right(tmp_path, f"{first}\n{column(A, form)}", "g", step=DT)


@pytest.mark.parametrize("header", ["dt = 0.01 s", "Sampling rate: 100 Hz", "600 0.01"])
def test_times_in_ms_next_to_a_step_in_s(tmp_path, header):
    is_right(tmp_path, f"{header}\n{table(1000 * T, A, mark=' ', forms=['%.0f', '%.5f'])}", "g")


@pytest.mark.parametrize(
    "line", ["UNIDADES: gales", "Aceleracion (gales)", "ACELERACION EN GALES", "# units = gales"]
)
def test_gales(tmp_path, line):
    content = f"INTERVALO DE MUESTREO (s): 0.01\n{line}\n{column(980.665 * A, '%.4f')}"
    is_right(tmp_path, content)


# ---- Lists and lines


@pytest.mark.parametrize("form", ["acc = [{}];", "a={{{}}}", "({})", "set acc {{{}}}"])
@pytest.mark.parametrize("mark", [", ", ",\n"])
def test_lists_with_commas(tmp_path, form, mark):
    is_right(tmp_path, form.format(mark.join(texts(A))) + "\n", "g", step=DT)


def test_values_above_times(tmp_path):
    for names in (("", ""), ("a;", "t;")):
        lines = [names[0] + ";".join(texts(A)), names[1] + ";".join(texts(T, "%.2f")), ""]
        is_right(tmp_path, "\n".join(lines), "g")


@pytest.mark.parametrize("form", ["{};{}", "{}\t{}", '"{}","{}"'])
def test_thousands_with_points(tmp_path, form):
    def grouped(value):
        return f"{value:,.2f}".replace(",", "_").replace(".", ",").replace("_", ".")

    rows = [form.format(grouped(t), grouped(9806.65 * a)) for t, a in zip(T, A, strict=True)]
    assert re.search(r"\d\.\d{3},\d", rows[int(np.argmax(np.abs(A)))])
    is_right(tmp_path, "\n".join(rows) + "\n", "mm/s^2")
    samples = [f"{98066.5 * a:,.0f}".replace(",", ".") for a in A]
    whole = [form.format(grouped(t), text) for t, text in zip(T, samples, strict=True)]
    is_right(tmp_path, "\n".join(whole) + "\n", "0.1 mm/s^2")
    points = table(T + 1.0, 100.0 * A, forms=["%.3f", "%.0f"])  # no thousands: 1.005,12
    assert read(tmp_path, points, "cm/s^2")[0].dt == pytest.approx(DT)


# ---- No motion


@pytest.mark.parametrize(
    "values", [T, T[::-1], np.arange(600.0), np.geomspace(0.01, 10.0, 80), np.arange(1, 101) / 20]
)
def test_column_of_times_or_periods_is_no_motion(tmp_path, values):
    ramp = f"# dt = 0.01 s, units = g\n{column(values, '%.4f')}"
    assert "one_sided" in message(tmp_path, ramp)
    assert read(tmp_path, ramp, one_sided=True)[0].acceleration.size == values.size


def test_times_as_ramp_with_their_step(tmp_path):
    (record,) = read(tmp_path, column(T, "%.2f"), "g", step=DT, one_sided=True)
    assert record.acceleration == pytest.approx(STANDARD_GRAVITY * T)


def test_list_of_peaks_is_no_motion(tmp_path):
    peaks = np.random.default_rng(2).uniform(0.05, 0.6, 40)
    for name in ("", "PGA (g)\n", "Sa\n"):
        content = name + column(peaks, "%.4f")
        with pytest.raises(RecordError, match=r"one_sided|PGA|spectrum"):
            read(tmp_path, content, "g", step=DT)
    for constant in (0.0, 0.1):
        assert read(tmp_path, column(np.full(100, constant)), "g", step=DT)[0].dt == DT


@pytest.mark.parametrize("bad", ["nan", "***", "null", "#N/A", "0.1O3", ""])
@pytest.mark.parametrize("index", [0, 1, 20, 300, 599])
def test_damaged_row_is_named(tmp_path, bad, index):
    rows = TWO.splitlines()
    rows[index] = f"{T[index]:.2f} {bad}"
    found = message(tmp_path, "\n".join(rows) + "\n", "g")
    assert f"line {index + 1}" in found or f"'{rows[index]}'" in found or "`skip_lines" in found
    assert "precede the samples" not in found


@pytest.mark.parametrize("index", [0, 1, 59, 300, 599])
def test_lost_number_beside_a_whole_time_is_named(tmp_path, index):
    """Times in ms are whole numbers, so that a row with asterisks has no decimal point."""
    rows = [
        f"{1000.0 * t:.0f} {row.split()[1]}" for t, row in zip(T, TWO.splitlines(), strict=True)
    ]
    rows[index] = f"{1000.0 * T[index]:.0f} ***"
    found = message(tmp_path, "\n".join(["Time (ms) Acc (g)", *rows]) + "\n", "g")
    assert f"line {index + 2}" in found or "***" in found
    assert "skip_lines" not in found and "precede the samples" not in found


def test_repeated_time_is_named(tmp_path):
    rows = TWO.splitlines()
    found = message(tmp_path, "\n".join([*rows[:300], *rows[299:]]) + "\n", "g")
    assert states(found, "times must increase ... sample 299 ... remove a repeated row")


@pytest.mark.parametrize(
    ("name", "content", "facts"),
    [
        ("a.npy", b"\x93NUMPY\x01\0", "NumPy ... numpy.load('a.npy') ... savetxt"),
        ("a.mat", b"MATLAB 5.0 MAT-file\0", "MATLAB ... scipy.io.loadmat('a.mat') ... savetxt"),
        ("b.mat", b"MATLAB 7.3 MAT-file\0", "HDF5 ... h5py.File('b.mat') ... savetxt"),
        ("a.jsonl", b'{"t": 0, "a": 0}\n{"t": 1, "a": 2}\n', "JSON ... for line in ... savetxt"),
        ("a.json", json.dumps([{"t": 0}, {"t": 1}], indent=0).encode(), "JSON ... json.load(open"),
    ],
)
def test_files_of_programs_have_a_remedy(tmp_path, name, content, facts):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordError) as error:
        channel_records(str(tmp_path / name), RecordChoice(), single=False)
    assert states(str(error.value), facts)
    assert "supported formats" not in str(error.value)


def seed_file(samples, channel, form):
    """Return the bytes of a SAC or MiniSEED file without units."""
    from obspy import Trace

    data, header = io.BytesIO(), {"delta": DT, "channel": channel, "station": "BAN"}
    Trace(np.asarray(samples, np.float32), header).write(data, form)
    return data.getvalue()


def test_counts_in_sac(tmp_path):
    file = tmp_path / "a.sac"
    for samples, channel in ((np.round(1e5 * A), ""), (1234.5 * A, "HHZ"), (1234.5 * A, "BHE")):
        file.write_bytes(seed_file(samples, channel, "SAC"))
        with pytest.raises(RecordError, match=r"probably counts.*inventory"):
            channel_records(str(file), RecordChoice(), single=False)
    file.write_bytes(seed_file(A, "HNZ", "SAC"))
    with pytest.raises(RecordError, match=r"units=g`, cm/s\^2"):
        channel_records(str(file), RecordChoice(), single=False)


def test_assumed_unit_states_the_possible_peaks(tmp_path):
    (tmp_path / "a.mseed").write_bytes(seed_file(2.0 * A / PEAK, "HNZ", "MSEED"))
    (record,) = channel_records(str(tmp_path / "a.mseed"), RecordChoice(), single=False)
    peaks = "0.204 g in m/s^2 or 0.00204 g in cm/s^2 or 2 g in g"
    assert peaks in record.warnings[0]


# ---- Directories


@pytest.mark.parametrize("names", ["{}a.x {}v.x {}d.x", "{}_1.v2c {}_2.v2c {}_3.v2c"])
@pytest.mark.parametrize("form", ["SMC", "COSMOS"])
def test_quantities_of_a_motion_are_one_motion(tmp_path, names, form):
    """The content states the quantity; the names do not."""
    for angle in (0, 90):
        if form == "SMC":
            titles = ("2 CORRECTED ACCELEROGRAM", "3 VELOCITY", "4 DISPLACEMENT")
            contents = [format_files.smc(title=t, integers={12: 90, 13: angle}) for t in titles]
        else:
            kinds = {
                "acceleration": "cm/sec2(04)",
                "velocity": "cm/sec(05)",
                "displacement": "cm(06)",
            }
            contents = [
                format_files.cosmos(units=units, quantity=kind, channel=f"1: {angle}")
                for kind, units in kinds.items()
            ]
        for name, content in zip(names.format(*[angle] * 3).split(), contents, strict=True):
            (tmp_path / name).write_text(content)
    suite = read_suite([str(tmp_path)], RecordChoice())
    assert not suite.failures
    assert len(suite.motions) == 2
    assert "another file contains the motion" in suite.notes[0]
    for name in (names.format(*[angle] * 3).split()[0] for angle in (0, 90)):
        (tmp_path / name).unlink()  # without the accelerations, the others are read
    assert len(read_suite([str(tmp_path)], RecordChoice()).motions) == 4


def test_spectra_of_any_name_are_listed(tmp_path):
    periods = np.geomspace(0.01, 10.0, 60)
    spectrum = table(periods, 0.3 * np.exp(-periods), forms=["%.4f"] * 2, mark=" ")
    (tmp_path / "a.txt").write_text(f"# dt = 0.01 s, units = g\n{column(A)}")
    for name in ("a.rs2", "a.fs1", "a.sp"):
        (tmp_path / name).write_text(f"Response spectrum, damping 5 %\n{spectrum}-1 12.5\n")
    for name, title in (("b.smc", "5 RESPONSE SPECTRA"), ("c.smc", "6 FOURIER AMPLITUDE SPECTRUM")):
        (tmp_path / name).write_text(format_files.smc(title=title))
    suite = read_suite([str(tmp_path)], RecordChoice())
    assert not suite.failures
    assert states(suite.notes[0], "a.fs1, a.rs2, a.sp, b.smc, c.smc (spectrum)")


def test_resultant_cannot_be_selected(tmp_path):
    content = table(T, A, B, C, TOTAL, names="t,x,y,z,R")
    assert states(message(tmp_path, content, "g", column="R"), "resultant ... x, y, z")


def test_quoted_title_above_unix_times_with_commas(tmp_path):
    times = [f"{EPOCH + 0.01 * i:.3f}" for i in range(T.size)]
    names = '"Sismo de prueba"\nNo.,Time,Acc'
    is_right(tmp_path, of_rows(names, [str(i + 1) for i in range(600)], times, texts(A)), "g")
