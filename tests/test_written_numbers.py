"""Ratios and grids from text."""

import numpy as np
import pytest

from tdint.errors import UsageError
from tdint.written_numbers import MOST_POINTS, Grid, parse_grid, parse_ratio


def test_a_ratio_is_a_number_or_a_percentage():
    for text, ratio in (
        ("0.05", 0.05),
        ("5%", 0.05),
        (" 5 % ", 0.05),
        ("1e-2", 0.01),
        ("-3%", -0.03),
        ("0", 0.0),
    ):
        assert parse_ratio(text) == pytest.approx(ratio, rel=1e-15)


@pytest.mark.parametrize("text", ["", "%", "a", "5%%", "nan", "inf%", "1/2"])
def test_what_is_no_ratio(text):
    with pytest.raises(UsageError, match="neither a ratio such as"):
        parse_ratio(text)


def test_a_grid_has_equal_ratios_and_both_ends():
    values = parse_grid("0.01:10:200").values()
    assert (values[0], values[-1], values.size) == (0.01, 10.0, 200)
    assert np.ptp(np.diff(np.log(values))) < 1e-12
    assert parse_grid("0.3").values().tolist() == [0.3]


def test_a_grid_is_written_as_it_is_read():
    for grid in (Grid(0.01, 10.0, 200), Grid(0.123456789, 2.0, 2)):
        assert parse_grid(str(grid)) == grid


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1:2",
        "2:1:5",
        "0:1:5",
        "-1:1:5",
        "1:2:1",
        "a:b:c",
        "1:2:3:4",
        "1:inf:5",
        "nan",
        "0",
        "1:2:1e3",
    ],
)
def test_what_is_no_grid(text):
    with pytest.raises(UsageError, match="FIRST"):
        parse_grid(text)
    with pytest.raises(UsageError, match=str(MOST_POINTS)):
        parse_grid(f"1:2:{MOST_POINTS + 1}")
