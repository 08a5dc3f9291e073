"""Long text tables: the values of their words, and their memory."""

import math
import subprocess
import sys

import numpy as np
import pytest

from tdint.ground_motion.formats.lines import TextLines
from tdint.ground_motion.formats.table_lines import NumberBlock, block_numbers
from tdint.ground_motion.reading.read import read_record

FORMS = ("{:.6f}", "{:+.3f}", "{:.7E}", "{:.3e}", "{:.15f}", "{:.17g}", "{:.0f}.", "{:g}")


@pytest.mark.parametrize("form", FORMS)
def test_values_are_those_of_python(form):
    rng = np.random.default_rng(1)
    values = rng.standard_normal(400) * 10.0 ** rng.uniform(-9, 9, 400)
    words = [form.format(value) for value in [0.0, -0.0, *values]]
    numbers = block_numbers(NumberBlock([], words, range(1, len(words) + 1))).values
    right = np.array([float(word) for word in words])
    np.testing.assert_array_equal(numbers.view(np.int64), right.view(np.int64))


@pytest.mark.parametrize(
    ("words", "right"),
    [
        (["-0.0", "-.5", "5.", "+.25"], [-0.0, -0.5, 5.0, 0.25]),
        (["1.5E+02", "-.5e-3", "0.E0"], [150.0, -0.0005, 0.0]),
        (["1.5", "2"], [1.5, 2.0]),
        (["1.5E2", "2.5"], [150.0, 2.5]),
        (["1.25-2.5", "3.0 4.0"], [1.25, -2.5, 3.0, 4.0]),
        (["1.25D2 3.5D-1"], [125.0, 0.35]),
        (["9007199254740993.5", "0.1"], [9007199254740993.5, 0.1]),
        (["1.0E-300", "4.9E-324"], [1e-300, 4.9e-324]),
    ],
)
def test_forms_of_numbers(words, right):
    numbers = block_numbers(NumberBlock([], words, range(1, len(words) + 1))).values
    assert numbers.tolist() == right
    assert [math.copysign(1.0, n) for n in numbers] == [math.copysign(1.0, n) for n in right]


def test_lines_are_those_of_split():
    text = "Höhe\n\n1.0 2.0\n" + "3.0\n" * 100_000 + "end"
    lines = TextLines(text.encode())
    right = text.split("\n")
    assert list(lines) == right
    assert lines[0] == "Höhe"
    assert lines[-1] == "end"
    assert list(lines[2:-1]) == right[2:-1]
    assert list(lines[5:5]) == []
    with pytest.raises(IndexError):
        lines[len(right)]


def test_row_far_below_is_still_examined(tmp_path):
    rows = ["dt = 0.01 s, units = m/s^2", *(["0.125000", "-0.250000"] * 60_000)]
    rows[100_000] = "0125000"
    file = tmp_path / "lost.txt"
    file.write_text("\n".join(rows) + "\n")
    with pytest.raises(Exception, match="line 100001: 0125000 has no decimal point"):
        read_record(file)


MEMORY = """
import resource, sys
import tdint.ground_motion.formats.text, tdint.ground_motion.reading.read as read
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
read.read_record(sys.argv[1])  # imports
before = peak()
record = read.read_record(sys.argv[2])
print((peak() - before) * 1024 / record.acceleration.nbytes)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the unit of ru_maxrss")
def test_memory_is_a_few_times_the_samples(tmp_path):
    values = [f"{value:.6f}\n" for value in np.random.default_rng(1).standard_normal(1_000_000)]
    short, long = tmp_path / "short.txt", tmp_path / "long.txt"
    for file, rows in ((short, values[:100]), (long, values)):
        file.write_text("dt = 0.01 s, units = m/s^2\n" + "".join(rows))
    command = [sys.executable, "-c", MEMORY, str(short), str(long)]
    ratio = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert ratio < 5.0
