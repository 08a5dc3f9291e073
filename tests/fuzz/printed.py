"""Allowed output of commands: checks of the exit code, the streams and the written files.

    check(code, stdout, stderr, files)        raises Failure

The checks are independent of the command.
"""

import csv
import io
import json
import re
from collections.abc import Mapping

from fuzz.oracle import LARGEST_MESSAGE, Failure

CODES = {0: "done", 2: "usage", 3: "model file", 4: "record", 5: "analysis", 6: "output"}
"""Allowed exit codes and their meanings; 1 is a bug."""

_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
_NO_NUMBER = re.compile(r"[-+]?(nan|inf|infinity)%?", re.IGNORECASE)
_NO_NUMBER_IN_WORDS = re.compile(r"(?<![\w./:'-])[-+]?(nan|inf)(?![\w./:'])", re.IGNORECASE)
_LEAKS = re.compile(r"Traceback|encountered in|Warning: .*deprecat|object at 0x", re.IGNORECASE)
_FORMULA = re.compile(r"(?=[=+\-@\t\r])(?![-+]?([0-9]+\.?[0-9]*|\.[0-9]+)?([eE][-+]?[0-9]+)?\Z)")
_MOST_LINES = 400
_LOCK = ".lock"  # suffix of a lock file, which is not read


def check(code: int, stdout: bytes, stderr: str, files: Mapping[str, bytes]) -> str:
    """Return the meaning of the exit code; raise Failure for forbidden output.

    Parameters
    ----------
    code : int
        Exit code.
    stdout, stderr : bytes, str
        Printed output.
    files : mapping
        Names and contents of the files that were written.
    """
    if code not in CODES:
        raise Failure(f"exit code {code}: {stderr[-300:]!r}")
    _check_words(code, stderr)
    if code == 0:
        _check_table("standard output", _text("standard output", stdout))
    for name, content in files.items():
        _check_file(name, content)
    return CODES[code]


def _check_words(code: int, stderr: str) -> None:
    lines = stderr.splitlines()
    for line in stderr.split("\n"):
        if found := _CONTROL.search(line):
            raise Failure(f"the control character {found[0]!r} on standard error: {line[:200]!r}")
        if len(line) > LARGEST_MESSAGE:
            raise Failure(f"a line of {len(line)} characters on standard error")
        if _LEAKS.search(line):
            raise Failure(f"on standard error: {line[:300]!r}")
        if code == 0 and (found := _NO_NUMBER_IN_WORDS.search(line)):
            raise Failure(f"{found[0]} on standard error of exit code 0: {line[:300]!r}")
    if len(lines) > _MOST_LINES:
        raise Failure(f"{len(lines)} lines on standard error")
    if code != 0 and not any(line.startswith("Error: ") for line in lines):
        raise Failure(f"exit code {code} without a line that tells why: {stderr[:200]!r}")
    if code == 0 and any(line.startswith("Error: ") for line in lines):
        raise Failure(f"exit code 0 with an error: {stderr[:200]!r}")


_FRACTILE = re.compile(r"(\w+_)?(median|p16|p50|p84)(_\w+)?")
"""Pattern of the columns of fractiles, which are infinite if too many motions collapse."""


def _check_file(name: str, content: bytes) -> None:
    if name.endswith(".tmp"):
        raise Failure(f"the temporary file {name} is left")
    if not content and not name.endswith(_LOCK):
        raise Failure(f"{name} is empty")
    if name.endswith(".json"):
        try:
            json.loads(content, parse_constant=_no_constant)
        except ValueError as error:
            raise Failure(f"{name}: {error}") from error
    elif name.endswith(".csv"):
        _check_table(name, _text(name, content))


def _check_table(name: str, text: str) -> None:
    """Check that CSV, JSON, BibTeX or help text has no control characters, and that all rows of a
    table have equal numbers of valid cells."""
    for line in text.split("\n"):
        if found := _CONTROL.search(line):
            raise Failure(f"{name}: the control character {found[0]!r}: {line[:200]!r}")
    if text.startswith(("Usage:", "tdint ", "# ")):
        return
    if text.startswith("@misc{"):  # BibTeX
        return
    if text.startswith("{"):
        json.loads(text, parse_constant=_no_constant)
        return
    if text and not text.endswith("\n"):
        raise Failure(f"{name}: the last line is cut off: {text[-100:]!r}")
    rows = list(csv.reader(io.StringIO(text)))
    for row in rows:
        if len(row) != len(rows[0]):
            raise Failure(f"{name}: {len(row)} cells below {len(rows[0])} names: {row}"[:300])
        for column, cell in zip(rows[0], row, strict=True):
            is_collapse = cell == "inf" and _FRACTILE.fullmatch(column)
            if _NO_NUMBER.fullmatch(cell.strip()) and not is_collapse:
                raise Failure(f"{name}: {cell} in {row}"[:300])
            if "\n" in cell:
                raise Failure(f"{name}: a cell of two lines: {cell[:60]!r}")
            if _FORMULA.match(cell):
                raise Failure(f"{name}: the formula {cell[:60]!r}")


def _text(name: str, content: bytes) -> str:
    """Return the content as UTF-8 text; invalid bytes in file names are escaped."""
    return content.decode("utf-8", "backslashreplace")


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON")
