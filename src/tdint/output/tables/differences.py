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
    file : str
        Name of the file.
    row : int or None
        Row number from 1; None for a difference of the complete table.
    column : str
        Name of the column, or the path of a value in a JSON file.
    before, now : str or None
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
        A file cannot be read, or is no such table.
    UsageError
        The files are Parquet, and pyarrow is not installed.
    """
    name = now.name
    first, second = _cells(before), _cells(now)
    old, new = next(first, []), next(second, [])
    # First the columns that only one file has, then the cells of shared columns.
    for column in dict.fromkeys((*old, *new)):
        if (column in old) != (column in new):
            then, today = ("a column" if column in header else None for header in (old, new))
            yield Difference(name, None, column, then, today)
    if old == new:
        shared = [(column, i, i) for i, column in enumerate(old) if column not in but]
    else:
        if sorted(old) == sorted(new):
            yield Difference(name, None, "", "these columns", "in another order")
        shared = [
            (column, old.index(column), new.index(column))
            for column in old
            if column in {*new} - {*but}
        ]
    scale = _Scale(before, old)
    # Rows are compared while they are read, because files may be larger than memory.
    counts = [0, 0]
    for number, (row, other) in enumerate(zip_longest(first, second), start=1):
        counts = [counts[0] + (row is not None), counts[1] + (other is not None)]
        if row is None or other is None:
            continue
        for column, i, j in shared:
            cells = row[i] if i < len(row) else None, other[j] if j < len(other) else None
            if cells[0] != cells[1]:
                is_rounding = scale.is_rounding(column, row, cells)
                yield Difference(name, number, column, *cells, is_rounding)
        # Cells outside of the columns of the header.
        if max(0, len(row) - len(old)) != max(0, len(other) - len(new)):
            then, today = (pluralize(len(cells), "cell") for cells in (row, other))
            yield Difference(name, number, "", then, today)
    # Additional rows of one file are counted, not listed.
    if counts[0] != counts[1]:
        then, today = (pluralize(count, "row") for count in counts)
        yield Difference(name, None, "", then, today)


@dataclass(frozen=True)
class _Scale:
    """Reference values for relative differences of the cells of a table.

    Attributes
    ----------
    file : Path
        The previous table.
    header : sequence of str
        Its columns.
    """

    file: Path
    header: Sequence[str]

    def is_rounding(
        self, column: str, row: Sequence[str], cells: tuple[str | None, str | None]
    ) -> bool:
        """Return True if two cells of a column are numbers that are equal within rounding."""
        before, now = map(_number, cells)
        if not math.isfinite(now - before):
            return False
        if _is_whole(cells[0]) and _is_whole(cells[1]):
            return False  # counts have no rounding
        size = max(abs(before), abs(now))
        reference = _reference(column)
        if reference == "":
            size = max(size, 1.0)
        elif reference in self.header:
            size = max(size, abs(_finite(row, self.header.index(reference))))
        # In a response history, the rounding of a number near a zero crossing is that of the peak.
        if self.header[:1] == [TIME]:
            size = max(size, self._peaks.get(column, 0.0), self._peaks.get(reference, 0.0))
        return abs(now - before) <= ROUNDING * size

    @cached_property
    def _peaks(self) -> dict[str, float]:
        """Maximum magnitude in each column."""
        rows = _cells(self.file)
        header = next(rows, [])
        peaks = [0.0] * len(header)
        for row in rows:
            for i in range(min(len(row), len(header))):
                peaks[i] = max(peaks[i], abs(_finite(row, i)))
        return dict(zip(header, peaks, strict=True))


def _is_whole(text: str | None) -> bool:
    """Return True if a cell shows a whole number, as counts do."""
    return (text or "").lstrip("-").isdecimal()


def _finite(row: Sequence[str], place: int) -> float:
    """Return the number in a cell of a row; 0 for a missing cell and for a non-finite value."""
    number = _number(row[place]) if place < len(row) else 0.0
    return number if math.isfinite(number) else 0.0


def _reference(column: str) -> str:
    """Return the name of the number that determines the rounding of another number.

    An estimated error is the difference of two results, and a residual drift or oscillation is
    small compared with the peak, so their rounding is that of the peak. An energy error is relative
    to the input energy; the name is empty in this case.
    """
    if column in ("error", "energy_error", "drift_error"):
        return ""
    name = column.removesuffix("_error")
    for small in ("residual_drift", "moving_drift"):
        name = name.replace(small, "peak_drift") if name.startswith(small) else name
    return name


def _cells(file: Path) -> Iterator[list[str]]:
    """Yield the rows of a table, the header first; numbers of Parquet files have all digits."""
    import gzip
    import zlib

    packed = file.suffix.lower()
    if packed == ".parquet":
        reader = import_optional("pyarrow.parquet", *PARQUET)
        kind, broken = "Parquet", import_optional("pyarrow", *PARQUET).lib.ArrowException
    else:
        kind, broken = "CSV", csv.Error
    try:
        if packed == ".parquet":
            with reader.ParquetFile(file) as content:
                yield list(content.schema_arrow.names)
                for batch in content.iter_batches():
                    cells = [column.to_pylist() for column in batch.columns]
                    yield from (
                        ["" if cell is None else str(cell) for cell in row]
                        for row in zip(*cells, strict=True)
                    )
            return
        with (gzip.open if packed == ".gz" else open)(
            file, "rt", encoding="utf-8", newline=""
        ) as stream:
            yield from csv.reader(stream)
    except (OSError, EOFError, ValueError, broken, zlib.error) as error:
        why = getattr(error, "strerror", None) or error
        raise OutputError(f"{file}: cannot be read as {kind}: {why}") from None


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


_MAX_NUMBER = 1e300
"""Maximum number of a JSON file that is compared as a number, because whole numbers of Python are
unlimited."""


def json_differences(before: Path, now: Path) -> Iterator[Difference]:
    """Yield the results that differ between two JSON files: numbers, text and lengths of lists.

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
            why = getattr(error, "strerror", None) or error
            raise OutputError(f"{file}: cannot be read as JSON: {why}") from None
    sizes: dict[str, float] = {}
    # The current file was written by this program, so its nesting is limited; only it is searched.
    _collect_sizes(contents[1], sizes)
    yield from _json_differences(now.name, "", contents[0], contents[1], sizes)


def _collect_sizes(value: Any, sizes: dict[str, float]) -> None:
    """Collect the maximum magnitude of the numbers of each key at any depth."""
    for key, part in value.items() if isinstance(value, Mapping) else ():
        if _is_number(part):
            sizes[key] = max(sizes.get(key, 0.0), abs(part))
    parts = value.values() if isinstance(value, Mapping) else value
    for part in parts if isinstance(value, Mapping | list) else ():
        _collect_sizes(part, sizes)


def _json_differences(
    file: str, path: str, before: Any, now: Any, sizes: Mapping[str, float]
) -> Iterator[Difference]:
    """Yield the differences of two values of JSON.

    Parameters
    ----------
    file : str
        Name of the file.
    path : str
        Keys that lead to the values, separated by dots.
    before, now : object
        The values.
    sizes : mapping
        Maximum magnitude of the numbers of each key.
    """
    # A key that only one version of tdint writes is not a difference of results.
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in before:
            if key in now and key not in _NOT_RESULTS:
                below = f"{path}.{key}" if path else key
                yield from _json_differences(file, below, before[key], now[key], sizes)
    elif isinstance(before, list) and isinstance(now, list):
        if len(before) != len(now):
            then, today = (pluralize(len(items), "item") for items in (before, now))
            yield Difference(file, None, path, then, today)
        for place, (old, new) in enumerate(zip(before, now, strict=False), start=1):
            yield from _json_differences(file, f"{path}[{place}]", old, new, sizes)
    elif before != now or _is_number(before) != _is_number(now):
        is_rounding = False
        if _is_number(before) and _is_number(now):
            key = path.rpartition(".")[2].partition("[")[0]
            size = max(abs(before), abs(now), _json_size(key, sizes))
            both_whole = isinstance(before, int) and isinstance(now, int)
            is_rounding = not both_whole and abs(now - before) <= ROUNDING * size
        then, today = (json.dumps(value)[:200] for value in (before, now))
        yield Difference(file, None, path, then, today, is_rounding)


def _json_size(key: str, sizes: Mapping[str, float]) -> float:
    """Return the magnitude that determines the rounding of the number of a key."""
    reference = _reference(key)
    if reference == "":
        return 1.0
    # Final energies are relative to the input energy.
    name, _, unit = key.rpartition("_")
    energy = sizes.get(f"input_{unit}", 0.0) if name else 0.0
    names = (reference, reference.removeprefix("peak_"))
    return max(energy, *(sizes.get(name, 0.0) for name in names))


def _is_number(value: object) -> bool:
    """Return True for a finite number; False for Booleans, nan and very large whole numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= _MAX_NUMBER
