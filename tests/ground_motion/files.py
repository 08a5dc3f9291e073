"""Record files that the tests write with ObsPy."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from tdint.errors import RecordError
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.miniseed_checks import Damaged
from tdint.ground_motion.reading.contents import read_contents
from tdint.ground_motion.reading.read import read_record

with quiet_import():
    from obspy import Stream, Trace, UTCDateTime

START = UTCDateTime(2020, 1, 2, 3, 4, 5)


def wave(samples=1000, dt=0.01, peak=3.0):
    """Return a sine of 1.3 Hz with its largest sample scaled to `peak`."""
    sine = np.sin(2 * np.pi * 1.3 * np.arange(samples) * dt)
    return sine * (peak / np.abs(sine).max())


def counts(samples=1000):
    return np.round(wave(samples, peak=100000.0)).astype(np.int32)


def trace(data, channel="HNE", dt=0.01, start=START, **header):
    header = {"network": "XX", "station": "ABC", "location": "00"} | header
    return Trace(
        np.array(data), header=header | {"channel": channel, "delta": dt, "starttime": start}
    )


def write(path, *traces, format="MSEED", **options):
    """Write traces to a file and return its path."""
    with quiet_import():
        Stream(list(traces)).write(str(path), format=format, **options)
    return path


def obspy_data(name):
    """Return a file of the test data in the ObsPy wheel, or None if this installation has no test
    data."""
    path = Path(find_spec("obspy").origin).parent / "io" / name
    return path if path.is_file() else None


def need_obspy_data(name):
    """Return a file of the test data of ObsPy, or skip the test if it is missing."""
    return obspy_data(name) or pytest.skip("this obspy comes without its test data")


def refused(source, match, **options):
    """Check that a record, given as a path or as bytes, is refused with a message."""
    with pytest.raises(RecordError, match=match) as caught:
        if isinstance(source, bytes | bytearray):
            read_contents(bytes(source), "file")
        else:
            read_record(source, **options)
    assert caught.value.exit_code == 4
    if isinstance(source, str | Path):
        assert str(caught.value).startswith(f"{source}: ")


def refused_by(read_headers, data, match):
    """Check that a function that inspects a format refuses the data with a message."""
    with pytest.raises(Damaged, match=match):
        read_headers(bytes(data))
