"""Tests of damaged files, which cause a RecordError or give the right samples, without exhausting
memory. tests/fuzz damages files at random."""

import contextlib
import io
import re
import tracemalloc
import warnings
from itertools import cycle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ground_motion.files import trace, wave, write
from ground_motion.samples import SAMPLES
from selection import every
from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import is_row_of_numbers
from tdint.ground_motion.reading.contents import OBSPY_FORMATS, plugins, read_contents

OWN = [plugin for plugin in plugins() if plugin.name not in OBSPY_FORMATS]
READERS = {plugin.name: plugin.read_format.load() for plugin in OWN}
CASES = [(name, make().encode()) for name, makes in SAMPLES.items() for make in makes]
LARGEST = 100e6  # bytes


def read(name, data):
    """Return the samples of each component, or None if the file is refused; no other exception is
    allowed."""
    with warnings.catch_warnings():
        # A corrupt header may contradict the samples, which causes a warning.
        warnings.filterwarnings(
            "ignore",
            message=".*the file states a |the times in the file|.*(one is repeated|row omitted)",
        )
        try:
            return {trace.id: trace.data for trace in READERS[name](io.BytesIO(data))}
        except RecordError as error:
            assert str(error)
            return None


def check_complete(name, data, complete):
    """Check that all components that were read are complete. For plain text without a stated
    length, the first rows may be read."""
    for component, samples in (read(name, data) or {}).items():
        expected = complete[component]
        if name == "TEXT":
            assert samples.size <= expected.size
            expected = expected[: samples.size]
        np.testing.assert_array_equal(samples, expected)


@pytest.mark.parametrize(("name", "data"), every(3, CASES))
def test_truncated_files_are_refused(name, data):
    complete = read(name, data)
    shortest = (
        200 if name == "TEXT" else 0
    )  # The number of decimals cannot be determined from a few rows.
    for length in (*range(shortest, len(data), 97), *range(len(data) - 30, len(data))):
        check_complete(name, data[:length], complete)


def with_lines_changed(data):
    """Yield copies of a file without a row of numbers, and with the row repeated."""
    lines = data.decode().splitlines(keepends=True)
    rows = [index for index, line in enumerate(lines) if is_row_of_numbers(line)]
    for index in sorted({*rows[::7], *rows[-3:]}):
        yield "".join(lines[:index] + lines[index + 1 :]).encode()
        yield "".join(lines[: index + 1] + lines[index:]).encode()


@pytest.mark.parametrize(("name", "data"), every(3, [case for case in CASES if case[0] != "TEXT"]))
def test_missing_and_repeated_rows_are_refused(name, data):
    """The integers of the header of some formats are not used, so that a change of their rows does
    not change the samples. UNAM files may repeat the last row."""
    complete = read(name, data)
    for changed in with_lines_changed(data):
        samples = read(name, changed) or {}
        for component, values in samples.items():
            np.testing.assert_array_equal(values, complete[component])


@pytest.mark.parametrize("name", ["SLIST", "TSPAIR", "SH_ASC"])
def test_missing_and_repeated_rows_of_obspy_formats_are_refused(name, tmp_path):
    data = write(tmp_path / "file", trace(wave(100)), format=name).read_bytes()
    assert read_contents(data, "file").traces[0].stats.npts == 100
    for changed in with_lines_changed(data):
        with pytest.raises(RecordError):
            read_contents(changed, "file")


def test_number_of_samples_of_sh_asc_is_required(tmp_path):
    """ObsPy omits the last channel if no blank line follows."""
    data = write(tmp_path / "file", *2 * [trace(wave(100))], format="SH_ASC").read_bytes()
    for changed in (data.replace(b"LENGTH: 100\n", b"", 1), data.rstrip(b"\n") + b"\n"):
        with pytest.raises(RecordError, match=r"DELTA and LENGTH|has 2 headers .* but 1 could"):
            read_contents(changed, "file")


OTHERS = (b"-1", b"1e308", b"9" * 5000, b"1e-308", b"1e" + b"9" * 20)


@pytest.mark.parametrize(("name", "data"), every(3, CASES))
@pytest.mark.parametrize(
    "turn", [0, *(pytest.param(turn, marks=pytest.mark.slow) for turn in (1, 2, 3, 4))]
)
def test_changed_numbers_in_header_are_read_or_refused(name, data, turn):
    """At each position, the next number of the list is inserted, starting with a different number
    in each turn. Of repeated equal numbers, such as marks of unknown values, only the first is
    replaced."""
    before, others = b"", cycle(OTHERS[turn:] + OTHERS[:turn])
    for match in re.finditer(rb"\d+\.?\d*", data[: 300 if name == "TEXT" else 1500]):
        if match[0] != before:
            read(name, data[: match.start()] + next(others) + data[match.end() :])
        before = match[0]


@pytest.mark.parametrize(("name", "data"), every(3, CASES))
def test_huge_number_of_samples_does_not_fill_memory(name, data):
    """The file has 120 samples and states 10^12, which would not fit into any memory."""
    tracemalloc.start()
    try:
        for match in re.finditer(rb"\b120\b", data):
            read(name, data[: match.start()] + b"9" * 12 + data[match.end() :])
        assert tracemalloc.get_traced_memory()[1] < LARGEST
    finally:
        tracemalloc.stop()


LETTERS = st.text(alphabet="NPTSDT=,.0123456789\n eE+-#", max_size=400)


@pytest.mark.long
@settings(max_examples=60, deadline=None)
@given(
    data=st.binary(max_size=600) | LETTERS.map(str.encode) | st.text(max_size=300).map(str.encode)
)
def test_arbitrary_bytes_are_refused(data):
    """Each reader and all readers together refuse the bytes, and no check of a format raises an
    error."""
    for plugin in OWN:
        plugin.is_format.load()(io.BytesIO(data))
        read(plugin.name, data)
    with contextlib.suppress(RecordError):
        read_contents(data, "file")


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize(
    "word",
    every(8, [b"#", b" ", b"1", b"1 2,", b"units = ", b"NPTS= 1 ", b"POINTS OF ", b"CHAN 1:  "]),
)
def test_very_long_lines_are_refused(name, word):
    line, sound = word * (100_000 // len(word)), SAMPLES[name][0]().encode()
    for data in (line, b"\n".join([line] * 5), sound + line, line + b"\n" + sound):
        read(name, data)
