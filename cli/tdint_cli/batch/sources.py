"""A name for what is written of each record of a command line, and what is said of them."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tdint.errors import OutputError
from tdint.input_bytes import STDIN

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record


def tables_of(files: Sequence[str], folder: Path) -> list[Path]:
    """The CSV file in `folder` for each record: its name without suffix, or with it where several have the same stem.

    Raises
    ------
    OutputError
        Two records would still have the same one.
    """
    stems = ["stdin" if file == STDIN else Path(file).stem for file in files]
    count = Counter(stems)
    tables: dict[Path, str] = {}
    for file, stem in zip(files, stems, strict=True):
        name = stem if count[stem] == 1 or file == STDIN else Path(file).name
        table = folder / f"{name}.csv"
        if table in tables:
            raise OutputError(
                f"{table}: both {tables[table]} and {file} would be written to it; use -o FILE for all in one file, "
                "or one folder each"
            )
        tables[table] = file
    return list(tables)


def refuse_inputs(outputs: Iterable[Path], inputs: Iterable[str | None]) -> None:
    """Raise OutputError for an output that is one of the files that are read, whatever --overwrite says."""
    read = {os.path.realpath(file) for file in inputs if file and file != STDIN}
    for output in outputs:
        if os.path.realpath(output) in read:
            raise OutputError(f"{output}: is read by this command; write to another place")


def notes_of_components(records: Sequence[Record], notes_of: Callable[[Record], Sequence[str]]) -> tuple[str, ...]:
    """Notes about the components of one file, with its name; what holds for all of them is said once."""
    notes: dict[str, None] = {}  # a set in the order of arrival
    for record in records:
        for note in notes_of(record):
            common = all(note in notes_of(other) for other in records)
            whose = record.source if common else f"{record.source}: {record.component or record.id}"
            notes[f"{whose}: {note}"] = None
    return tuple(notes)
