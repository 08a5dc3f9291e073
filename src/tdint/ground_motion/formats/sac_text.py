"""Alphanumeric SAC files: the header and the samples of a SAC file as text.

The header consists of 70 reals (5G15.7), 40 integers (5I10) and 24 texts of eight characters (three
in a line). Samples follow in 5G15.7 (SAC manual, data format). The file is converted to the binary
format, so that header, units and checks are the same as for SAC; the samples keep all digits of the
text.
"""

from __future__ import annotations

import struct
from io import BytesIO
from typing import Any

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import read_lines, recognizer, row_of_numbers
from tdint.ground_motion.header_checks import look_at_sac, sac_statements
from tdint.ground_motion.messages import obspy_function, one_line
from tdint.ground_motion.miniseed_checks import compare

_REAL_ROWS, _INTEGER_ROWS, _TEXT_ROWS, _PER_ROW = 14, 8, 8, 5
_REAL_WIDTH, _INTEGER_WIDTH, _TEXT_WIDTH = 15, 10, 24
"""Characters of a real and of an integer, and of a line with three texts."""

_VERSION, _SIZE = 6, 9
"""Indices of the version of the header and of the number of samples in the integers."""
_VERSIONS = (6, 7)


@recognizer
def is_sac_text(lines: list[str]) -> object:
    """Return True if a file starts with the reals and integers of a SAC header, with the version of
    the header."""
    rows = [row_of_numbers(line, _REAL_WIDTH) for line in lines[:_REAL_ROWS]]
    end = _REAL_ROWS + _INTEGER_ROWS
    integers = [row_of_numbers(line, _INTEGER_WIDTH) for line in lines[_REAL_ROWS:end]]
    has_header = all(len(row) == _PER_ROW for row in (*rows, *integers))
    row, column = divmod(_VERSION, _PER_ROW)
    return has_header and len(integers) == _INTEGER_ROWS and integers[row][column] in _VERSIONS


def read_sac_text(file: Any, headonly: bool = False, **_: Any) -> Any:
    """Read an alphanumeric SAC file.

    Raises
    ------
    RecordError
        The file is cut off, has more samples than its header states, or its samples do not match
        its header.
    """
    lines = read_lines(file)
    reals = lines.numbers(_REAL_ROWS * _PER_ROW, _REAL_WIDTH)
    integers = [int(value) for value in lines.numbers(_INTEGER_ROWS * _PER_ROW, _INTEGER_WIDTH)]
    texts = [lines.take()[:_TEXT_WIDTH].ljust(_TEXT_WIDTH) for _ in range(_TEXT_ROWS)]
    count = integers[_SIZE]
    if count < 1:
        raise RecordError(f"the header must state a positive number of samples, got {count}")
    samples = lines.numbers(count, _REAL_WIDTH)
    lines.expect_aligned_end(_REAL_WIDTH)
    lines.expect_no_numbers(count)
    function = obspy_function("obspy.plugin.waveform.SAC", "readFormat")
    # Read the binary file by ObsPy, and replace its samples, which have only single precision.
    try:
        data = (
            struct.pack(f"<{reals.size}f{len(integers)}i", *reals, *integers)
            + "".join(texts).encode("latin-1", "replace")
            + samples.astype("<f4").tobytes()
        )
        header = look_at_sac(data)
        stream = function(BytesIO(data), headonly=headonly)
    except RecordError:
        raise
    except Exception as error:  # ObsPy raises many exception types for an invalid header.
        raise RecordError(f"the SAC header is not valid: {one_line(str(error))}") from error
    (trace,) = stream
    if not headonly:
        trace.data = samples
        trace.stats["tdint_compared"] = compare(sac_statements(header, [trace]))
    return stream
