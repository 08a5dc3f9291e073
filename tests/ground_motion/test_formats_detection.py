"""A file is detected only by its own format, from its first bytes, and ObsPy reads it with this
format."""

import io

import pytest

from ground_motion.samples import SAMPLES
from selection import every
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.reading.contents import plugins

with quiet_import():
    import obspy

CHECKS = {plugin.name: plugin.is_format.load() for plugin in plugins() if plugin.is_own}


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
