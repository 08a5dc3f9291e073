"""A file is detected only by its own format, from its first bytes, and ObsPy reads it with this
format."""

import io

import numpy as np
import pytest

from ground_motion.files import trace, wave, write
from ground_motion.samples import SAMPLES
from selection import every
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.reading.contents import OBSPY_FORMATS, plugins

with quiet_import():
    import obspy

CHECKS = {
    plugin.name: plugin.is_format.load() for plugin in plugins() if plugin.name not in OBSPY_FORMATS
}


def claims(file):
    return [name for name, check in CHECKS.items() if check(file)]


@pytest.mark.parametrize("name", every(2, SAMPLES))
def test_examples_are_detected_by_their_own_format_only(name, tmp_path):
    path = tmp_path / "file"
    for make in SAMPLES[name]:
        data = make().encode()
        file = io.BytesIO(b"before" + data)
        file.seek(6)
        assert claims(file) == [name]
        assert file.tell() == 6
        path.write_bytes(data)
        assert claims(path) == claims(str(path)) == [name]
        stream = obspy.read(path)
        # ObsPy also has a reader of alphanumeric SAC files, which does not detect corrupt files.
        expected = "SACXY" if name == "SACTEXT" else name
        assert {trace.stats._format for trace in stream} == {expected}
        headers = obspy.read(io.BytesIO(data), format=name, headonly=True)
        assert [trace.stats.npts for trace in headers] == [trace.stats.npts for trace in stream]
        assert all(trace.data.size == 0 for trace in headers)


@pytest.mark.parametrize("name", ["MSEED", "SAC", "GSE2", "SLIST", "TSPAIR", "SH_ASC"])
def test_obspy_formats_are_not_detected(name, tmp_path):
    data = wave().astype(np.int32 if name == "GSE2" else np.float32)
    assert claims(write(tmp_path / "file", trace(data), format=name)) == []


@pytest.mark.parametrize("file", ["missing", 3, None, io.StringIO("text"), io.BytesIO()])
def test_invalid_file_arguments_are_not_detected(file):
    assert claims(file) == []


@pytest.mark.parametrize("name", CHECKS)  # every format has an example
def test_detection_reads_only_beginning_of_file(name):
    class Counting(io.BytesIO):
        got = 0

        def read(self, size=-1):
            data = super().read(size)
            self.got += len(data)
            return data

    file = Counting(SAMPLES[name][0]().encode() + b"0.5\n" * 100_000)
    assert CHECKS[name](file)
    assert file.got <= 8192
