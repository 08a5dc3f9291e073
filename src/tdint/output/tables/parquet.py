"""The tables of a campaign as Parquet files, in SI units, where pyarrow is there; few rows are held at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, BinaryIO

from tdint.analysis.run.outcome import STORY as STORY_QUANTITIES
from tdint.campaign.engine.runs import RUN
from tdint.output.tables.campaign import SAMPLE, numeric, run_columns, run_rows, story_columns, story_rows
from tdint.output.tables.damage_states import damage_rows, damage_table_columns
from tdint.output.tables.table import TEXT, Column

if TYPE_CHECKING:
    from tdint.campaign.store.store import Store

_ROWS_AT_ONCE = 131_072

_COUNTED = {SAMPLE.name, "story", *(one.column for one in (*RUN, *STORY_QUANTITIES) if one.kind is int)}


def runs_parquet(store: Store) -> Callable[[BinaryIO], None] | None:
    """What writes runs.parquet; None without pyarrow."""
    return parquet_writer(store, run_columns(store), lambda: run_rows(store), carried=len(store.inventory_columns()))


def stories_parquet(store: Store) -> Callable[[BinaryIO], None] | None:
    """What writes stories.parquet; None without pyarrow."""
    return parquet_writer(store, story_columns(store), lambda: story_rows(store))


def damage_parquet(store: Store) -> Callable[[BinaryIO], None] | None:
    """What writes damage.parquet; None without pyarrow."""
    columns = damage_table_columns(store)
    return parquet_writer(store, columns, lambda: damage_rows(store), carried=len(store.inventory_columns()))


def parquet_writer(
    store: Store, columns: Sequence[Column], rows: Callable[[], Iterable[Sequence[Any]]], *, carried: int = 0
) -> Callable[[BinaryIO], None] | None:
    """What writes rows under some columns, the last `carried` of which are the inventory's; None without pyarrow.

    A column of words is one of strings, unless it is of the inventory and has numbers alone.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return None

    def write(stream: BinaryIO) -> None:
        first = len(columns) - carried
        places = [first + place for place, is_number in enumerate(numeric(store)) if is_number] if carried else []
        words = {one.name for place, one in enumerate(columns) if one.unit == TEXT and place not in places}
        kinds = {one.name: pyarrow.int64() if one.name in _COUNTED else pyarrow.float64() for one in columns}
        schema = pyarrow.schema(list((kinds | dict.fromkeys(words, pyarrow.string())).items()))
        with parquet.ParquetWriter(stream, schema) as writer:
            for batch in _batches(rows()):
                found = [_as_numbers(row, places) for row in batch]
                cells = zip(*found, strict=True)
                arrays = [pyarrow.array(one, field.type) for one, field in zip(cells, schema, strict=True)]
                writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))

    return write


def _batches(rows: Iterable[Sequence[Any]]) -> Iterator[list[Sequence[Any]]]:
    source = iter(rows)
    while batch := list(islice(source, _ROWS_AT_ONCE)):
        yield batch


def _as_numbers(row: Sequence[Any], places: Sequence[int]) -> Sequence[Any]:
    if not places:
        return row
    found = list(row)
    for place in places:
        found[place] = float(found[place]) if found[place] else None
    return found
