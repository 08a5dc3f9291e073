"""Sequential reading of the lines of a text file: skipped lines, and line numbers in messages."""

import pytest

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import Lines

TEXT = "first\n\n \n\n1 2\n3 4\nend\n"


def test_blank_lines_are_skipped_individually():
    """Skipping two lines at once would skip a row or pass the end for one or three blank lines."""
    lines = Lines(TEXT)
    assert (lines.peek(), lines.number) == ("first", 0)
    lines.skip(1)
    assert (lines.peek(), lines.number) == ("1 2", 4)
    assert Lines("\n5 6\n7 8\n").table(2, 2).tolist() == [[5.0, 7.0], [6.0, 8.0]]
    assert Lines("\n\n").peek() is None


def test_take_returns_blank_lines():
    lines = Lines(TEXT)
    assert [lines.take() for _ in range(3)] == ["first", "", " "]
    assert lines.number == 3
    assert lines.take_until(lambda line: line.startswith("3"), "row") == ["", "1 2"]
    assert (lines.number, lines.at_numbers()) == (5, True)
    assert lines.numbers(2).tolist() == [3.0, 4.0]
    assert (lines.at_numbers(), lines.take()) == (False, "end")
    with pytest.raises(RecordError, match="ends with line 7"):
        lines.take()


def test_errors_contain_line_number():
    lines = Lines(TEXT)
    with pytest.raises(RecordError, match=r"7 lines, .* 8"):
        lines.skip(8)
    lines.skip(4)
    with pytest.raises(RecordError, match="no trailer found after line 4"):
        lines.take_until(lambda line: line == "trailer", "trailer")
    with pytest.raises(RecordError, match="line 5 must contain 3 numbers, got 2"):
        lines.table(1, 3)
    with pytest.raises(RecordError, match=r"more than the 1 values .* line 5"):
        lines.numbers(1)
    with pytest.raises(RecordError, match="line 7 follows the last row"):
        lines.expect_end()
    with pytest.raises(RecordError, match=r"line 7 .*got 'end'"):
        lines.numbers(1)
