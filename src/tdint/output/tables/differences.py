"""Differences between two versions of a file: tables, JSON files and others.

Differences by rounding are distinguished from other differences, because interpreted and compiled
time loops, and different processors, give different last digits.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import Any

from tdint.errors import OutputError
from tdint.number_parsing import pluralize
from tdint.output.tables.table import PARQUET, Column
from tdint.tabular import import_optional

ROUNDING = 1e-9
"""Relative difference below which two results are equal within rounding. Time integration over
about 1e4 time steps amplifies the rounding of 1e-16 to at most 1e-12; tables have 12 digits."""

TIME = "time_s"
"""First column of tables of a response history."""


@dataclass(frozen=True)
class Difference:
    """A cell or a value that differs between two files.

    Attributes
    ----------
    row : int | None
        Row number from 1; None for a difference of the complete table.
    column : str
        Name of the column, or the path of a value in a JSON file.
    before, now : str | None
        The values as text; None if a file does not have the value.
    is_rounding : bool
        True if the values are equal within rounding.
    """

    file: str
    row: int | None
    column: str
    before: str | None
    now: str | None
    is_rounding: bool = False

    @property
    def relative(self) -> float:
        """Difference divided by the larger magnitude; nan if a value is not a number."""
        before, now = _number(self.before), _number(self.now)
        largest = max(abs(before), abs(now))
        return abs(now - before) / largest if 0.0 < largest < math.inf else math.nan


DIFFERENCE = (
    Column("file", "text", "file", "file of the table"),
    Column(
        "row",
        "1",
        "row",
        "row below the header, from 1; empty for a difference of the complete table",
    ),
    Column("column", "text", "column", "name of the column, or the path of a value in a JSON file"),
    Column("before", "text", "before", "previous cell; empty if it did not exist"),
    Column("now", "text", "now", "current cell; empty if it does not exist"),
    Column(
        "relative_difference",
        "1",
        "relative",
        "difference divided by the larger magnitude; empty if a cell is not a number",
    ),
)


def _number(text: str | None) -> float:
    """Return the number in a cell; nan for an empty cell and for text."""
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan


# ---- Tables


def differences(before: Path, now: Path, *, but: Collection[str] = ()) -> Iterator[Difference]:
    """Yield the cells that differ between two files of a table, in the order of the rows.

    Parameters
    ----------
    before, now : Path
        CSV (compressed or not) or Parquet files, which are read while the result is consumed.
    but : collection of str
        Columns that are not compared.

    Raises
    ------
    OutputError
        A file cannot be read as CSV or Parquet.
    UsageError
        The files are Parquet, and pyarrow is not installed.
    """
    file = now.name
    old_rows, new_rows = _cells(before), _cells(now)
    old_header, new_header = next(old_rows, []), next(new_rows, [])
    # First the columns that only one file has, then the cells of common columns.
    for column in dict.fromkeys((*old_header, *new_header)):
        if column not in new_header:
            yield Difference(file, None, column, "a column", None)
        elif column not in old_header:
            yield Difference(file, None, column, None, "a column")
    if old_header != new_header and sorted(old_header) == sorted(new_header):
        yield Difference(file, None, "", "these columns", "in another order")
    common_columns = _common_columns(old_header, new_header, but)
    scale = _Scale(before, old_header)
    # Rows are compared while they are read, because files may be larger than memory.
    old_count = new_count = 0
    for number, (old, new) in enumerate(zip_longest(old_rows, new_rows), start=1):
        old_count += old is not None
        new_count += new is not None
        if old is None or new is None:
            continue
        for column, i, j in common_columns:
            cells = old[i] if i < len(old) else None, new[j] if j < len(new) else None
            if cells[0] != cells[1]:
                is_rounding = scale.is_rounding(column, old, cells)
                yield Difference(file, number, column, *cells, is_rounding)
        # Cells to the right of the last column of the header were not compared above.
        if max(0, len(old) - len(old_header)) != max(0, len(new) - len(new_header)):
            old_text, new_text = (pluralize(len(row), "cell") for row in (old, new))
            yield Difference(file, number, "", old_text, new_text)
    # Additional rows at the end of a file are counted, because a list of their cells would be long.
    if old_count != new_count:
        old_text, new_text = (pluralize(count, "row") for count in (old_count, new_count))
        yield Difference(file, None, "", old_text, new_text)


def _common_columns(
    old_header: Sequence[str], new_header: Sequence[str], but: Collection[str]
) -> list[tuple[str, int, int]]:
    """Return the columns that both headers contain, except the columns in `but`, as tuples of the
    name, the index in the old header and the index in the new header."""
    # In equal headers, columns with the same name are compared by their position.
    if old_header == new_header:
        return [(column, i, i) for i, column in enumerate(old_header) if column not in but]
    return [
        (column, old_header.index(column), new_header.index(column))
        for column in old_header
        if column in new_header and column not in but
    ]


@dataclass(frozen=True)
class _Scale:
    """Magnitudes to which rounding differences of the cells of a table are relative.

    Attributes
    ----------
    file : Path
        The previous table.
    """

    file: Path
    header: Sequence[str]

    def is_rounding(
        self, column: str, row: Sequence[str], cells: tuple[str | None, str | None]
    ) -> bool:
        """Return True if two cells of a column are numbers that are equal within rounding.

        `column` is the name of the column. `cells` is the previous and current cell; None if the
        row has no such cell.
        """
        before, now = map(_number, cells)
        if not math.isfinite(now - before):
            return False
        if _is_whole(cells[0]) and _is_whole(cells[1]):
            return False  # counts have no rounding
        magnitude = max(abs(before), abs(now))
        reference = _reference(column)
        if reference == "":
            magnitude = max(magnitude, 1.0)
        elif reference in self.header:
            magnitude = max(magnitude, abs(_finite(row, self.header.index(reference))))
        # Near a zero crossing, a number of a response history is small, but its rounding is as
        # large as at the peak. Therefore it is compared with the peak of its column.
        if self.header[:1] == [TIME]:
            peaks = self._peaks
            magnitude = max(magnitude, peaks.get(column, 0.0), peaks.get(reference, 0.0))
        return abs(now - before) <= ROUNDING * magnitude

    @cached_property
    def _peaks(self) -> dict[str, float]:
        """Maximum magnitude in each column of the previous table, by the name of the column. The
        complete file is read at the first access."""
        rows = _cells(self.file)
        header = next(rows, [])
        peaks = [0.0] * len(header)
        for row in rows:
            for i in range(min(len(row), len(header))):
                peaks[i] = max(peaks[i], abs(_finite(row, i)))
        return dict(zip(header, peaks, strict=True))


def _is_whole(text: str | None) -> bool:
    """Return True if a cell contains a whole number without a decimal point, such as a count."""
    return (text or "").lstrip("-").isdecimal()


def _finite(row: Sequence[str], index: int) -> float:
    """Return the number in the cell `index` of a row; 0 for a missing cell, a text, nan and inf."""
    number = _number(row[index]) if index < len(row) else 0.0
    return number if math.isfinite(number) else 0.0


def _reference(column: str) -> str:
    """Return the name of the reference column of a column; rounding differences are relative to its
    numbers.

    An estimated error is the difference of two results, and a residual drift or oscillation is
    small compared with the peak drift, so their rounding is relative to the peak: the result for
    `peak_drift_error` is `peak_drift`. Most other columns are their own reference. The name is
    empty for a relative error, such as the energy error: its rounding is relative to 1.
    """
    if column in ("error", "energy_error", "drift_error"):
        return ""
    name = column.removesuffix("_error")
    for small in ("residual_drift", "moving_drift"):
        name = name.replace(small, "peak_drift") if name.startswith(small) else name
    return name


def _cells(file: Path) -> Iterator[list[str]]:
    """Yield the rows of a table file as lists of texts, the header first. The file is CSV, CSV
    compressed by gzip, or Parquet; numbers of Parquet files have all digits.
    """
    import gzip
    import zlib

    suffix = file.suffix.lower()
    if suffix == ".parquet":
        reader = import_optional("pyarrow.parquet", *PARQUET)
        format_name, read_error = "Parquet", import_optional("pyarrow", *PARQUET).lib.ArrowException
    else:
        format_name, read_error = "CSV", csv.Error
    try:
        if suffix == ".parquet":
            with reader.ParquetFile(file) as content:
                yield list(content.schema_arrow.names)
                for batch in content.iter_batches():
                    columns = [column.to_pylist() for column in batch.columns]
                    for row in zip(*columns, strict=True):
                        yield ["" if cell is None else str(cell) for cell in row]
            return
        open_file = gzip.open if suffix == ".gz" else open
        with open_file(file, "rt", encoding="utf-8", newline="") as stream:
            yield from csv.reader(stream)
    except (OSError, EOFError, ValueError, read_error, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{file}: cannot be read as {format_name}: {reason}") from None


# ---- JSON files

_NOT_RESULTS = frozenset(
    (
        *("schema", "command", "settings", "arguments", "export", "versions", "time_loops"),
        *("inputs", "files", "columns", "meanings", "notes", "warnings", "profiles", "fingerprint"),
        *("message", "wall_time_s", "time_loop_s", "time_loop_clock", "processor_time_s"),
    )
)
"""Keys of JSON files with descriptions and measured times, which may differ between equal results.

Inputs and versions are compared separately.
"""

_NOT_COMPARED = frozenset(
    (
        *("arguments", "export", "versions", "time_loops", "inputs", "sha256"),
        *("wall_time_s", "time_loop_s", "time_loop_clock", "processor_time_s"),
    )
)
"""Keys of JSON files that may differ between two calls of the same version of tdint.

These are paths, measured times, and keys that are compared separately. The digest `sha256` of a
file differs if its numbers are equal within rounding; the file is compared instead.
"""

_MAX_TEXT = 200
"""Maximum number of characters of a value in the table of differences."""

_MAX_NUMBER = 1e300
"""Maximum number of a JSON file that is compared as a number, because whole numbers of Python are
unlimited."""


def json_differences(
    before: Path,
    now: Path,
    *,
    is_same_version: bool = False,
    ignored_keys: Collection[str] = (),
    original_paths: Mapping[str, str] | None = None,
) -> Iterator[Difference]:
    """Yield the results that differ between two JSON files: numbers, text and lengths of lists.

    Parameters
    ----------
    is_same_version : bool
        True if the same version of tdint has written both files. Keys that only one file has,
        descriptions and notes are then compared as well.
    ignored_keys : collection of str
        Keys that are not compared, at any depth.
    original_paths : mapping of str to str, optional
        Paths in the file `before`, by the paths that replace them in the file `now`.

    Raises
    ------
    OutputError
        A file cannot be read as JSON.
    """
    contents = []
    for file in (before, now):
        try:
            contents.append(json.loads(file.read_bytes()))
        except (OSError, ValueError, RecursionError) as error:
            reason = getattr(error, "strerror", None) or error
            raise OutputError(f"{file}: cannot be read as JSON: {reason}") from None
    before_content, now_content = contents
    # Only the current file is searched recursively. This program has just written it, so its
    # nesting cannot be too deep for a recursion, in contrast to a file from elsewhere.
    magnitudes: dict[str, float] = {}
    _collect_magnitudes(now_content, magnitudes)
    not_compared = _NOT_COMPARED if is_same_version else _NOT_RESULTS
    scope = _Scope(is_same_version, not_compared.union(ignored_keys), original_paths or {})
    yield from _json_differences(now.name, "", before_content, now_content, magnitudes, scope)


def _collect_magnitudes(value: Any, magnitudes: dict[str, float]) -> None:
    """Return the maximum magnitude of the numbers of each key in a JSON value, at any depth.

    `magnitudes`: maximum magnitude by key, which is updated.
    """
    if isinstance(value, Mapping):
        for key, item in value.items():
            if _is_number(item):
                magnitudes[key] = max(magnitudes.get(key, 0.0), abs(item))
            _collect_magnitudes(item, magnitudes)
    elif isinstance(value, list):
        for item in value:
            _collect_magnitudes(item, magnitudes)


@dataclass(frozen=True)
class _Scope:
    """Compared keys of JSON files.

    Attributes
    ----------
    has_same_keys : bool
        True if a key that only one file has is a difference.
    """

    has_same_keys: bool
    ignored_keys: frozenset[str]
    original_paths: Mapping[str, str]


def _json_differences(
    file: str, path: str, before: Any, now: Any, magnitudes: Mapping[str, float], scope: _Scope
) -> Iterator[Difference]:
    """Yield the differences between two JSON values."""
    if isinstance(now, str):
        now = scope.original_paths.get(now, now)
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in dict.fromkeys((*before, *now)):
            if key in scope.ignored_keys:
                continue
            key_path = f"{path}.{key}" if path else key
            if key in before and key in now:
                yield from _json_differences(
                    file, key_path, before[key], now[key], magnitudes, scope
                )
            # A key that only one version of tdint writes is not a difference of results.
            elif scope.has_same_keys:
                old_text = _value_text(before[key]) if key in before else None
                new_text = _value_text(now[key]) if key in now else None
                yield Difference(file, None, key_path, old_text, new_text)
    elif isinstance(before, list) and isinstance(now, list):
        if len(before) != len(now):
            old_text, new_text = (pluralize(len(items), "item") for items in (before, now))
            yield Difference(file, None, path, old_text, new_text)
        for number, (old, new) in enumerate(zip(before, now, strict=False), start=1):
            yield from _json_differences(file, f"{path}[{number}]", old, new, magnitudes, scope)
    # In Python, True is equal to 1, but they are different JSON values.
    elif before != now or _is_number(before) != _is_number(now):
        is_rounding = False
        if _is_number(before) and _is_number(now):
            # The path `stories[2].drift[1]` has the key `drift`.
            key = path.rpartition(".")[2].partition("[")[0]
            magnitude = max(abs(before), abs(now), _json_magnitude(key, magnitudes))
            are_whole = isinstance(before, int) and isinstance(now, int)
            is_rounding = not are_whole and abs(now - before) <= ROUNDING * magnitude
        yield Difference(file, None, path, _value_text(before), _value_text(now), is_rounding)


def _value_text(value: Any) -> str:
    """Return a JSON value as text for the table of differences, with at most 200 characters."""
    return json.dumps(value)[:_MAX_TEXT]


def _json_magnitude(key: str, magnitudes: Mapping[str, float]) -> float:
    """Return the magnitude that determines the rounding of the numbers of a key."""
    reference = _reference(key)
    if reference == "":
        return 1.0
    # The rounding of the energies at the end, such as `strain_J`, is relative to the input energy.
    name, _, unit = key.rpartition("_")
    input_energy = magnitudes.get(f"input_{unit}", 0.0) if name else 0.0
    names = (reference, reference.removeprefix("peak_"))
    return max(input_energy, *(magnitudes.get(name, 0.0) for name in names))


def _is_number(value: object) -> bool:
    """Return True for a finite number; False for Booleans, nan and very large whole numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= _MAX_NUMBER
