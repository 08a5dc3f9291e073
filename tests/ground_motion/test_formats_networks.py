"""Tests of the formats of single networks: components, units, steps, and the peaks in their
headers."""

from datetime import datetime

import numpy as np
import pytest

from ground_motion import network_files as files
from ground_motion.format_files import fortran, motion
from ground_motion.test_formats import contents, refused


def ids(text):
    return [trace.id for trace in contents(text).traces]


@pytest.mark.parametrize(
    ("write", "units", "dt", "names", "start"),
    [
        (files.afad, "cm/s^2", 0.01, [".0921..NS", ".0921..EW", ".0921..UD"],
         "2017-07-20T22:30:58.500000Z"),
        (files.cwb, "cm/s^2", 0.02, [".ECU..U", ".ECU..N", ".ECU..E"],
         "2018-02-06T15:50:29.000000Z"),
        (files.unam, "cm/s^2", 0.004, [".CUP5..V", ".CUP5..N90E", ".CUP5..N00E"],
         "2004-01-02T00:00:01.000000Z"),
        (files.bhrc, "0.1 g", 0.005, [".Avin..50", ".Avin..V", ".Avin..140"],
         "1970-01-01T00:00:00.000000Z"),
    ],
)  # fmt: skip
def test_components_of_network_formats(write, units, dt, names, start):
    found = contents(write())
    expected = files.components(decimals=6 if write is files.bhrc else 3)
    assert ids(write()) == names
    for trace, samples in zip(found.traces, expected, strict=True):
        np.testing.assert_array_equal(trace.data, samples)
        assert (trace.stats.delta, trace.stats.tdint_units) == (pytest.approx(dt, rel=1e-12), units)
        assert str(trace.stats.starttime) == start
    assert "number of samples" in found.compared
    assert ("peak" in found.compared) == (write is not files.bhrc)
    assert found.notes == ()


def test_wrong_numbers_of_samples_are_refused():
    for write in (files.afad, files.unam):
        refused(write(count=121), "121 rows after line .*, the file has 120")
        refused(write(count=119), "follows the last row stated in the header")
    refused(
        files.bhrc(count=121),
        "states a number of samples of 121, but the data that were read have 120",
    )
    for length in (2.36, 2.42):
        refused(
            files.cwb(length=length),
            r"states a number of samples of \d+, but the data that were read have",
        )


def test_bhrc_header_is_read_by_width():
    """From 10 000 samples on, the number in 14I5 is not separated from the number before it."""
    values = [motion(10_240, peak, 6) for peak in files.PEAKS]
    text = files.bhrc(values)
    assert "    010240" in text
    found = contents(text)
    for trace, samples in zip(found.traces, values, strict=True):
        np.testing.assert_array_equal(trace.data, samples)
    refused(files.bhrc(values, count=10_241), "states a number of samples of 10241, but")


@pytest.mark.parametrize(
    ("station", "code"),
    [
        ("64ABC 40.000N 80.000E", "64ABC"),
        ("ZHONGGUANCUN(91ZGC) 39.800N 116.267E", "91ZGC"),
        ("ZHONGGUANCUN\N{FULLWIDTH LEFT PARENTHESIS}91ZGC) 39.800N 116.267E", "91ZGC"),
        ("ZHONGGUANCUN\xa3\xa891ZGC\xa3\xa9 39.800N 116.267E", "91ZGC"),
    ],
)
def test_csmnc_is_read(station, code):
    found = contents(files.csmnc(station=station, component="V"))
    (trace,) = found.traces
    np.testing.assert_array_equal(trace.data, motion(120, 182.34))
    assert (trace.id, trace.stats.delta, trace.stats.tdint_units) == (
        f".{code}..V",
        0.005,
        "cm/s^2",
    )
    assert trace.stats.tdint_event == "SOMEWHERE,CHINA 2022-07-14 01:15:12"
    assert found.compared == ("number of samples", "peak")


def test_csmnc_is_compared_with_its_header():
    refused(files.csmnc(count=121), "cut off: the header states 121 values")
    refused(files.csmnc(count=119), "more than the 119 values")
    refused(files.csmnc(count=112), "follows the 112 values")
    refused(files.csmnc(peak=-192.3), "states a peak of 192.3 cm/s")
    # Older files have fewer decimals and no blank between the numbers.
    values = motion(120, -1235.746, 3)
    older = files.csmnc(values).splitlines()[:15]
    older[10] = "UNCORRECTED ACCCELERATION UNIT: CM/SEC/SEC"
    older[13] = "PRE-EVENT TIME: 20 SEC SITE CONDITION: soil"
    (trace,) = contents("\n".join([*older, "CSMNC", *fortran(values, 8, 10, 3), ""])).traces
    np.testing.assert_array_equal(trace.data, values)


def test_incomplete_header_row_is_refused():
    """The incomplete row is the twelfth of the header."""
    for numbers in (11, 10):
        lines = files.bhrc().splitlines()
        lines[7] = lines[7][: 5 * numbers]
        refused("\n".join(lines), "the header before line 13 must contain only numbers")


def test_wrong_sampling_intervals_and_peaks_are_refused():
    refused(
        files.cwb(rate=100),
        "states a sampling interval of 0.01 s, but the data that were read have 0.02",
    )
    refused(
        files.bhrc(rate=100.0),
        "states a sampling interval of 0.01 s, but the data that were read have 0.005 s",
    )
    refused(files.afad(peaks=(1.5, 2.4, 0.5)), "EW: the file states a peak of 2.4 cm/s")
    cwb = files.cwb().replace("   -2.250\n#AmplitudeMAX. E", "   -2.500\n#AmplitudeMAX. E")
    refused(cwb, "N: the file states a peak of 2.5")
    refused(files.unam().replace("/1.50/", "/1.40/"), "V: the file states a peak of 1.4 cm/s")


def test_repeated_last_rows_are_omitted():
    found = contents(files.unam(repeated=2))
    assert {trace.data.size for trace in found.traces} == {120}
    assert found.notes == ("2 rows omitted that repeat the last row stated in the header",)


def test_missing_row_before_repeated_rows_is_refused():
    """A repeated row replaces the last stated row, so that the number of rows is correct."""
    lines = files.unam(repeated=2).splitlines()
    del lines[60]
    refused("\n".join(lines) + "\n", "120 rows .* 1 extra row after it: a row is missing")


def test_row_with_wrong_number_of_values_is_refused():
    lines = files.afad().splitlines()
    lines[20] += " 0.1"
    refused("\n".join(lines) + "\n", "must contain 3 numbers, got 4")


@pytest.mark.parametrize(
    ("origin", "first", "day"),
    [
        ("10:01:02", "10:01:30", 5),
        ("23:59:50.5", "00:00:01.5", 6),
        ("", "00:00:01", 5),
        ("13:00:00", "01:00:00", 5),
        ("00:00:10", "23:59:50", 4),
    ],
)
def test_start_of_unam_record_near_midnight(origin, first, day):
    """The header states the day of the earthquake, and the first sample is within twelve hours of
    the origin time."""
    header = files.unam().replace("2004/01/01", "2004/03/05").replace("00:00:01    ", first)
    header = header.replace("23:58:02.7", origin)
    hour, minute, second = first.split(":")
    seconds, _, part = second.partition(".")
    expected = datetime(
        2004, 3, day, int(hour), int(minute), int(seconds), 100_000 * int(part or 0)
    )
    assert contents(header).traces[0].stats.starttime == expected
    for key in ("FECHA DEL SISMO", "HORA DE LA PRIMERA"):
        assert contents(header.replace(key, "NADA")).traces[0].stats.starttime == datetime(
            1970, 1, 1
        )
