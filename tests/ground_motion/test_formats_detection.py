"""A file is claimed by its own format alone, from its first bytes, and a check never raises."""

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ground_motion.files import obspy_data, trace, wave, write
from ground_motion.samples import SAMPLES
from tdint.ground_motion.reading.contents import plugins

CHECKS = {plugin.name: plugin.is_format.load() for plugin in plugins() if plugin.is_own}


def claims(file):
    return [name for name, check in CHECKS.items() if check(file)]


def test_every_format_is_registered_and_has_samples():
    assert list(CHECKS) == sorted(SAMPLES)


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_are_claimed_by_their_own_format(name, tmp_path):
    for make in SAMPLES[name]:
        data = make().encode()
        file = io.BytesIO(b"before" + data)
        file.seek(6)
        assert claims(file) == [name]
        assert file.tell() == 6
        path = tmp_path / "file"
        path.write_bytes(data)
        assert claims(path) == claims(str(path)) == [name]


@pytest.mark.parametrize("name", ["MSEED", "SAC", "GSE2", "SLIST", "TSPAIR", "SH_ASC"])
def test_formats_of_obspy_are_not_claimed(name, tmp_path):
    data = wave().astype(np.int32 if name == "GSE2" else np.float32)
    assert claims(write(tmp_path / "file", trace(data), format=name)) == []


def test_knet_is_not_claimed():
    path = obspy_data("nied/tests/data/test.knet") or pytest.skip("this obspy comes without its test data")
    assert claims(path) == []


def test_other_text_is_not_claimed():
    root = Path(__file__).parents[2]
    for path in (*root.glob("*.md"), *root.glob("*.toml"), *root.glob("configs/*"), *root.glob("tests/**/*.py")):
        assert claims(path) == [], path


@pytest.mark.parametrize(("rows", "claimed"), [("0 5\n1 5\n2 3\n", True), ("0 5\n1 5\n1 3\n", False)])
def test_of_columns_without_names_the_first_one_grows(rows, claimed):
    assert claims(io.BytesIO(rows.encode())) == ["TEXT"] * claimed


@pytest.mark.parametrize("file", ["missing", 3, None, io.StringIO("text"), io.BytesIO()])
def test_what_is_no_file_is_not_claimed(file):
    assert claims(file) == []


@pytest.mark.parametrize("name", SAMPLES)
def test_a_check_reads_the_beginning_only(name):
    class Counting(io.BytesIO):
        got = 0

        def read(self, size=-1):
            data = super().read(size)
            self.got += len(data)
            return data

    file = Counting(SAMPLES[name][0]().encode() + b"0.5\n" * 100_000)
    assert CHECKS[name](file)
    assert file.got <= 8192


@given(st.binary(max_size=300))
def test_random_bytes(data):
    claims(io.BytesIO(data))
