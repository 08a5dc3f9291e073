"""Tests of ratios and grids from text."""

import numpy as np
import pytest

from tdint.errors import UsageError
from tdint.grids import MAX_GRID_POINTS, Grid, parse_grid
from tdint.number_parsing import number_text, parse_ratio, table_number
from tdint.units import parse_output_units


def test_ratio_is_number_or_percentage():
    for text, ratio in (
        ("0.05", 0.05),
        ("5%", 0.05),
        (" 5 % ", 0.05),
        ("1e-2", 0.01),
        ("-3%", -0.03),
        ("0", 0.0),
    ):
        assert parse_ratio(text) == pytest.approx(ratio, rel=1e-15)


@pytest.mark.parametrize("text", ["", "%", "a", "5%%", "nan", "inf%", "1/0"])
def test_invalid_ratios_are_refused(text):
    with pytest.raises(UsageError, match="neither a ratio such as"):
        parse_ratio(text)


def test_grid_has_equal_ratios_and_both_ends():
    values = parse_grid("0.01:10:200").values()
    assert (values[0], values[-1], values.size) == (0.01, 10.0, 200)
    assert np.ptp(np.diff(np.log(values))) < 1e-12
    assert parse_grid("0.3").values().tolist() == [0.3]


def test_text_of_grid_is_parsed_to_same_grid():
    for grid in (Grid(0.01, 10.0, 200), Grid(0.123456789, 2.0, 2)):
        assert parse_grid(str(grid)) == grid


@pytest.mark.parametrize(
    "text",
    [
        "", "1:2", "2:1:5", "0:1:5", "-1:1:5", "1:2:1", "a:b:c", "1:2:3:4", "1:inf:5", "nan", "0",
        "1:2:1e3",
    ],
)  # fmt: skip
def test_invalid_grids_are_refused(text):
    with pytest.raises(UsageError, match="FIRST"):
        parse_grid(text)
    with pytest.raises(UsageError, match=str(MAX_GRID_POINTS)):
        parse_grid(f"1:2:{MAX_GRID_POINTS + 1}")


def test_number_text_differs_from_missed_limit():
    assert number_text(0.89999, unlike=0.9) == "0.89999"
    assert number_text(0.8999, unlike=0.9) == "0.8999"
    assert number_text(0.9, unlike=0.9) == "0.9"
    assert number_text(np.nextafter(0.9, 0.0), unlike=0.9) == "0.8999999999999999"


def test_unit_of_mass_follows_from_force():
    """1218 t in the units of a model in kip and in are 1218e3 / 175126.8 kip*s^2/in."""
    mass = 1.218e6
    for units, text in (
        ("kip,in", "6.955 kip*s^2/in"),
        ("kip,ft", "83.46 kip*s^2/ft"),
        ("kN,mm", "1218 t"),
        ("kip,in,lb", "2.685e+06 lb"),
        ("N,m", "1.218e+06 kg"),
    ):
        assert parse_output_units(units).text(mass, "kg") == text


@pytest.mark.parametrize(
    ("value", "largest", "text"),
    [
        (-7.04e-15, 7.04e-15, "below 0.0001"),  # rounding instead of a residual drift
        (-7.04e-15, 1.0, "0"),
        (-3e-6, 3e-6, "-0.0000030"),
        (3e-6, None, "below 0.0001"),
        (0.0, 0.0, "0"),
    ],
)
def test_small_numbers_of_a_table_have_digits_or_a_bound(value, largest, text):
    assert table_number(value, largest) == text
