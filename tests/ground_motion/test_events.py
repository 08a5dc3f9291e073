"""Tests of the events of ground motions, as stated in the headers of the formats, and of their
identity."""

import numpy as np
import pytest

from ground_motion import format_files as files
from ground_motion import network_files as networks
from tdint.ground_motion.events import event_of, is_same_event, parse_event
from tdint.ground_motion.reading.read import read_record, read_records
from tdint.ground_motion.record import Record


@pytest.mark.parametrize(
    ("text", "label"),
    [
        ("Loma Prieta 10/18/1989", "Loma Prieta 1989-10-18"),
        ("Chi-Chi Taiwan-03 9/20/1999", "Chi-Chi Taiwan-03 1999-09-20"),
        ("IMPERIAL VALLEY 10/15/79 2316", "IMPERIAL VALLEY 1979-10-15T23:16:00"),
        ("NORTHRIDGE EQ 1/17/94 12:31", "NORTHRIDGE EQ 1994-01-17T12:31:00"),
        ("DUZCE 11/12/05", "DUZCE 2005-11-12"),
        ("BIG BEAR 06/28/92, 15:05:30.5 UTC", "BIG BEAR 1992-06-28T15:05:30"),
        ("X JUNE 28, 1992 08:05 PDT", "X 1992-06-28T15:05:00"),
        ("X JAN 17, 1994 -1230 GMT", "X 1994-01-17T12:30:00"),
        ("X 15 OCT 1979 - 2317 UTC", "X 1979-10-15T23:17:00"),
        ("2018 February 12    21:15:54", "2018-02-12T21:15:54"),
        ("2018/02/06-23:50:42", "2018-02-06T23:50:42"),
        ("Kobe", "Kobe"),
        ("X 13/45/1999", "X 13/45/1999"),  # no date
        ("Event 7 of 12", "Event 7 of 12"),
        ("", ""),
    ],
)
def test_event_labels_from_headers(text, label):
    assert parse_event(text).label == label


def with_line(text, after, line):
    """Return a file with one line more in its header."""
    lines = text.split("\n")
    index = next(i for i, each in enumerate(lines) if each.startswith(after))
    return "\n".join([*lines[: index + 1], line, *lines[index + 1 :]])


def with_other(text, old, new):
    assert old in text
    return text.replace(old, new)


CSMIP_ORIGIN = "SOME EARTHQUAKE   (ORIGIN(BRK): 05/02/83, 23:42:38.5 UTC)"
FILES = {
    "at2": (files.at2(), "Somewhere 2003-01-02"),
    "at2, old": (
        with_other(
            files.at2(),
            "Somewhere, 1/2/2003, Far Hill - Coll. #2, 067",
            "IV 10/15/79 2316, EC, 067",
        ),
        "IV 1979-10-15T23:16:00",
    ),
    "at2, comma in the name": (
        with_other(files.at2(), "Somewhere, 1/2", "Chi-Chi, Taiwan-03, 1/2"),
        "Chi-Chi Taiwan-03 2003-01-02",
    ),
    "cosmos": (
        with_other(
            with_other(
                files.cosmos(), "Record of Somewhere", "Record of Far Point Earthquake of Fri"
            ),
            "Origin:",
            "Origin: 06/16/2005, 20:53:26.1 UTC (SCSN)",
        ),
        "Far Point 2005-06-16T20:53:26",
    ),
    "csmip": (
        with_line(files.csmip_pairs(), "SOME EARTHQUAKE", "MAY 2, 1983 16:42 PDT"),
        "SOME 1983-05-02T23:42:00",
    ),
    "csmip, origin": (
        with_line(
            files.csmip_pairs(),
            "SOME EARTHQUAKE",
            "MAY 2, 1983 16:42 PDT          (ORIGIN(BRK): 05/02/83, 23:42:38.5 UTC)",
        ),
        "SOME 1983-05-02T23:42:38",
    ),
    "usc": (
        with_line(files.usc(), "COMP", "NORTHRIDGE EARTHQUAKE   JAN 17, 1994 -1230 GMT     46"),
        "NORTHRIDGE EARTHQUAKE 1994-01-17T12:30:00",
    ),
    "smc": (files.smc(), "Somewhere 1989-10-18T00:04:00"),
    "esm": (
        with_line(
            with_line(files.esm(), "EVENT_ID", "EVENT_DATE_YYYYMMDD: 20190728"),
            "EVENT_ID",
            "EVENT_TIME_HHMMSS: 160908",
        ),
        "SOMEWHERE 2019-07-28T16:09:08",
    ),
    "geonet": (
        with_other(files.geonet(), "none\nnone\nnone", "2018 February 12         21:15:54 UT\n\n"),
        "2018-02-12T21:15:54",
    ),
    "afad": (
        with_line(networks.afad(), "PLACE", "EARTHQUAKE DATE         : 2017/07/20 22:31:09 (GMT)"),
        "2017-07-20T22:31:09",
    ),
    "cwb": (networks.cwb(), "2018-02-06T15:50:42"),  # the header states it eight hours east of UTC
    "unam": (networks.unam(), "2004-01-01T23:58:02"),
    "bhrc": (
        networks.bhrc().replace("COMP", "Origin Time : 2012/08/11   12:23:16\nCOMP"),
        "2012-08-11T12:23:16",
    ),
    "text": (
        "# event = Kobe 1/16/1995\n# dt = 0.01 s, units = g\n0\n0.1\n-0.1\n",
        "Kobe 1995-01-16",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_formats_state_event(name, tmp_path):
    """Every component of a file has the event of its header."""
    text, label = FILES[name]
    (tmp_path / "motion").write_text(text)
    events = [event_of(record) for record in read_records(tmp_path / "motion")]
    assert {(event.label, event.is_start) for event in events} == {(label, False)}


def test_sac_header_states_event(tmp_path):
    """The origin time of SAC is relative to the reference time, and `b` is the time of the first
    sample."""
    import obspy

    start = obspy.UTCDateTime(2019, 7, 6, 3, 20)
    trace = obspy.Trace(np.array([0.0, 1.0, -1.0], dtype=np.float32), {"starttime": start})
    trace.stats.sac = {"o": -7.0, "b": 0.0, "kevnm": "Ridge"}
    trace.write(str(tmp_path / "a.sac"), format="SAC")
    record = read_record(tmp_path / "a.sac", units="m/s^2")
    assert event_of(record).label == "Ridge 2019-07-06T03:19:53"


def record(event="", start=""):
    samples = np.array([0.0, 1.0, -1.0])
    return Record(samples, 0.01, start=start, id="", component="", source="", event=event)


@pytest.mark.parametrize(
    ("event", "other", "same"),
    [
        # Names and dates
        (("Loma Prieta 10/18/1989",), ("LOMA PRIETA, CA EARTHQUAKE 10/17/1989",), True),
        (("Loma Prieta 10/18/1989",), ("Loma Prieta 10/20/1989",), False),
        (("Loma Prieta 10/18/1989",), ("Northridge-01 10/18/1989",), False),
        (("Imperial Valley-06 10/15/1979",), ("Imperial Valley-07 10/15/1979",), False),
        (("Kobe",), ("Kobe 1/16/1995",), True),
        (("Kobe",), ("1995-01-16 20:46",), False),
        (("Loma Prieta 10/18/1989",), ("1989-10-18 00:04:15",), True),
        # Origin times
        (("LOMA PRIETA 10/18/89 00:05",), ("Santa Cruz Mts 1989-10-18 0004",), True),
        (("IV 10/15/79 2316",), ("IV 10/15/79 2319",), False),
        # Starts of records
        (("", "2016-11-13T11:02:50"), ("", "2016-11-13T11:12:40"), True),
        (("", "2016-11-13T11:02:50"), ("", "2016-11-13T11:13:00"), False),
        (("2016-11-13 11:02:56",), ("", "2016-11-13T11:04:00.5Z"), True),
        (("Kaikoura 2016-11-14", "2016-11-13T11:03:00"), ("", "2016-11-13T11:04:00"), True),
        # A wrong clock does not replace the date of the header.
        (("Loma Prieta 10/18/1989", "1980-01-01T00:00:00"), ("Loma Prieta 10/17/1989",), True),
        # Unknown
        (("",), ("",), False),
        (("", "1970-01-01T00:00:00"), ("", "1970-01-01T00:00:00"), False),
    ],
)
def test_equality_of_events(event, other, same):
    first, second = event_of(record(*event)), event_of(record(*other))
    assert is_same_event(first, second) is is_same_event(second, first) is same
