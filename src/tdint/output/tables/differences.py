"""Differences between two files that one command wrote: tables, JSON files and others.

Numbers that differ by rounding alone are told from numbers that differ: interpreted and compiled
time loops, and other processors, give other last digits.
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
from tdint.output.tables.table import PARQUET, Column
from tdint.tabular import optional
from tdint.written_numbers import how_many

ROUNDING = 1e-9
"""Difference over a number, below which two results are equal within rounding. Time integration of
some 1e4 steps amplifies the rounding of 1e-16 to 1e-12 at most; tables have 12 digits."""

TIME = "time_s"
"""First column of a table whose rows are instants of one time history."""


@dataclass(frozen=True)
class Difference:
    """A cell or a value that differs between two files.

    Attributes
    ----------
    file : str
        Name of the file.
    row : int or None
        Row of a table from 1; None for a difference of the whole table.
    column : str
        Name of the column, or the path of a value in a JSON file.
    before, now : str or None
        The values as text; None where a file has no such value.
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
        """Difference over the larger of both numbers; nan where a value is not a number."""
        before, now = _number(self.before), _number(self.now)
        largest = max(abs(before), abs(now))
        return abs(now - before) / largest if 0.0 < largest < math.inf else math.nan


DIFFERENCE = (
    Column("file", "text", "file", "file of the table"),
    Column(
        "row",
        "1",
        "row",
        "row below the header, from 1; empty for what the whole table has otherwise",
    ),
    Column("column", "text", "column", "name of the column, or the path of a value in a JSON file"),
    Column("before", "text", "before", "the cell as it was; empty where there was none"),
    Column("now", "text", "now", "the cell as it is now; empty where there is none"),
    Column(
        "relative_difference",
        "1",
        "relative",
        "difference over the larger of both; empty where one is no number",
    ),
)


def _number(text: str | None) -> float:
    """Return the number that a cell shows; nan for an empty cell and for words."""
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
    # Columns that one of them alone has, then the cells of the others.
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
    # Row beside row, as far as both go: files may be longer than memory.
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
        # Cells that stand in no column
        if max(0, len(row) - len(old)) != max(0, len(other) - len(new)):
            then, today = (how_many(len(cells), "cell") for cells in (row, other))
            yield Difference(name, number, "", then, today)
    # Rows that one of them alone has are counted, not listed.
    if counts[0] != counts[1]:
        then, today = (how_many(count, "row") for count in counts)
        yield Difference(name, None, "", then, today)


@dataclass(frozen=True)
class _Scale:
    """The numbers that differences of the cells of a table are relative to.

    Attributes
    ----------
    file : Path
        The table before.
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
        # In a time history a number near a zero crossing has the rounding of its peak.
        if self.header[:1] == [TIME]:
            size = max(size, self._peaks.get(column, 0.0), self._peaks.get(reference, 0.0))
        return abs(now - before) <= ROUNDING * size

    @cached_property
    def _peaks(self) -> dict[str, float]:
        """The largest magnitude in each column."""
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
    """Return the number in a cell of a row; 0 for a cell that is missing or no finite number."""
    number = _number(row[place]) if place < len(row) else 0.0
    return number if math.isfinite(number) else 0.0


def _reference(column: str) -> str:
    """Return the name of the number that the rounding of another one is relative to.

    An estimated error is the difference of two results, and a residual or a vibration at rest is
    small beside the peak before it: their last digits are those of the peak. An energy error is
    itself relative, to the input energy: the empty name.
    """
    if column in ("error", "energy_error", "drift_error"):
        return ""
    name = column.removesuffix("_error")
    for small in ("residual_drift", "moving_drift"):
        name = name.replace(small, "peak_drift") if name.startswith(small) else name
    return name


def _cells(file: Path) -> Iterator[list[str]]:
    """Yield the rows of a table, its header first; numbers of Parquet with all their digits."""
    import gzip
    import zlib

    packed = file.suffix.lower()
    if packed == ".parquet":
        reader = optional("pyarrow.parquet", *PARQUET)
        kind, broken = "Parquet", optional("pyarrow", *PARQUET).lib.ArrowException
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
"""Keys of a JSON file next to tables that describe how the results were made, and measured times:
they may differ where the results are the same. Inputs and versions are compared by themselves."""


_MAX_NUMBER = 1e300
"""Largest number of a JSON file that is compared as a number; whole numbers of Python have no
limit."""


def json_differences(before: Path, now: Path) -> Iterator[Difference]:
    """Yield the results that differ between two JSON files: numbers, words and lengths of lists.

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
    # The file that is written now is not nested deeply: of the two alone this one is looked at.
    _collect_sizes(contents[1], sizes)
    yield from _json_differences(now.name, "", contents[0], contents[1], sizes)


def _collect_sizes(value: Any, sizes: dict[str, float]) -> None:
    """Collect the largest magnitude of the numbers under each key, however deep."""
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
        Keys that lead to the values, with dots between them.
    before, now : object
        The values.
    sizes : mapping
        The largest magnitude of the numbers under each key.
    """
    # A key that one version of tdint alone writes is no difference of results.
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in before:
            if key in now and key not in _NOT_RESULTS:
                below = f"{path}.{key}" if path else key
                yield from _json_differences(file, below, before[key], now[key], sizes)
    elif isinstance(before, list) and isinstance(now, list):
        if len(before) != len(now):
            then, today = (how_many(len(items), "item") for items in (before, now))
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
    """Return the magnitude that the rounding of the number under a key is relative to."""
    reference = _reference(key)
    if reference == "":
        return 1.0
    # Energies at the end are relative to the input energy.
    name, _, unit = key.rpartition("_")
    energy = sizes.get(f"input_{unit}", 0.0) if name else 0.0
    names = (reference, reference.removeprefix("peak_"))
    return max(energy, *(sizes.get(name, 0.0) for name in names))


def _is_number(value: object) -> bool:
    """Return True for a number to compute with; True and False, nan and 10**400 are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= _MAX_NUMBER
