"""Tables are aligned for reading at a terminal, and CSV in all other outputs."""

import math

import pytest

from cli.conftest import at_a_terminal
from tdint.output.tables.table import Table
from tdint_cli.drawing import draw, table_bytes

NUMBERS = [(1, 0.123456789, None), (2, -1234567.0, None), (10, 0.0, None)]


def test_numbers_are_aligned_in_few_digits_without_empty_columns():
    text = draw(("story", "peak_drift_m", "ductility"), NUMBERS, 80, {"peak_drift_m": "m"})
    assert text == (
        "        peak drift\n"
        "story            m\n"
        "-----  -----------\n"
        "    1      0.12346\n"
        "    2  -1.2346e+06\n"
        "   10            0\n"
    )


def test_a_text_common_to_all_rows_is_printed_once_above():
    text = draw(("record", "period_s"), [("a.mseed", 1.0), ("a.mseed", 2.0)], 80)
    assert text.splitlines()[0] == "record: a.mseed"
    assert text.count("a.mseed") == 1


@pytest.mark.parametrize("width", [20, 40, 80, 200])
def test_no_line_is_wider_than_the_screen_and_no_number_is_lost(width):
    columns = ["story", *(f"quantity_number_{i}" for i in range(12))]
    rows = [(k, *(k + 0.001 * i for i in range(12))) for k in range(1, 6)]
    text = draw(columns, rows, width)
    assert max(map(len, text.splitlines())) <= width
    for row in rows:
        for value in row[1:]:
            assert f"{value:.5g}" in text.split()
    for block in text.split("\n\n"):
        assert "story" in block


def test_a_few_wide_rows_are_transposed():
    columns = [f"name_{i}" for i in range(30)]
    lines = draw(columns, [tuple(range(30))], 80).splitlines()
    assert lines == [f"name_{i}".ljust(7) + f"  {i}" for i in range(30)]


@pytest.mark.parametrize("columns", [3, 20])
def test_records_with_long_names_that_differ_at_the_end_keep_distinct_names(columns):
    """File names with 70 equal first characters are abbreviated differently, also in a transposed
    table."""
    names = [f"{70 * 'a'}-{end}.mseed" for end in ("firm", "near-fault", "soft")]
    rows = [(name, *(float(i + k) for k in range(columns))) for i, name in enumerate(names)]
    text = draw(("record", *(f"quantity_{k}" for k in range(columns))), rows, 80)
    shown = [word for word in text.split() if "..." in word]
    assert len(set(shown)) == 3
    assert max(map(len, text.splitlines())) <= 80


def test_a_table_without_rows_has_its_column_names():
    assert draw(("a", "b"), [], 80).split() == ["a", "b", "-", "-"]


def test_nan_is_empty_and_control_characters_are_replaced():
    text = draw(("name", "x", "ok"), [("\x1b[2Jevil", math.nan, True), ("good", 1.0, False)], 80)
    assert "\x1b" not in text
    assert "\\x1b[2Jevil" in text
    assert text.splitlines()[-1].split() == ["good", "1", "false"]


def test_a_terminal_gets_an_aligned_table_and_a_pipe_gets_csv(folder, tdint):
    shown, code = at_a_terminal("modes forced.yaml")
    piped = tdint("modes", "forced.yaml").stdout
    assert code == 0 and piped.startswith("mode,period_s,frequency_hz,")
    assert not any(
        b"," in line
        for line in shown.splitlines()
        if not any(word in line for word in (b"Warning", b"usual", b"note:"))
    )
    first = float(piped.splitlines()[1].split(",")[1])
    assert f"{first:.5g}" in shown.decode().split()


def test_units_other_than_si_are_complete_in_the_column_heads():
    units = {"peak_velocity_in_s": "in/s", "work_kipin_error": "kip*in", "ratio": "1"}
    text = draw(tuple(units), [(float(i), 2.0, 3.0) for i in range(5)], 60, units)
    head = text.splitlines()[:4]
    assert any("in/s" in line for line in head) and any("kip*in" in line for line in head)
    assert "kipin" not in text and "in s" not in text


def test_transposed_rows_keep_the_common_directory():
    names = ("record", *(f"measure_{i}_m_s2" for i in range(8)))
    text = draw(names, [(f"motions/{file}.at2", *range(8)) for file in "ab"], 40)
    assert text.splitlines()[0] == "record: in motions/"
    assert text.splitlines()[1].split() == ["record", "a.at2", "b.at2"]


def test_errors_are_printed_in_percent_next_to_their_quantities():
    columns = ("story", "drift_m", "shear_N", "drift_m_error", "shear_N_error", "energy_error")
    rows = [(1, 0.2, -50.0, 0.001, 0.5, 1e-9), (2, 0.0, 40.0, 0.001, math.nan, 1e-9)]
    about = {
        name: {"meaning": "", "unit": unit} for name, unit in zip(columns, "1mNmN1", strict=True)
    }
    lines = table_bytes(Table(columns, rows, about), 80).decode().splitlines()
    assert lines[-2].split() == ["1", "0.2", "0.5", "-50", "1", "1e-09"]
    assert lines[-1].split() == ["2", "0", "40", "1e-09"]
    for width in range(20, 60):  # An error follows its column also in a table of several blocks.
        heads = [
            line
            for line in table_bytes(Table(columns, rows, about), width).decode().splitlines()
            if "error" in line
        ]
        assert not any(line.split()[:2] == ["story", "error"] for line in heads), width
