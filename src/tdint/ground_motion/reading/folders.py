"""The records that someone named: files as they are, folders taken apart."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tdint.errors import RecordError, UsageError
from tdint.files import is_folder
from tdint.input_bytes import STDIN

if TYPE_CHECKING:
    from tdint.ground_motion.text_layout import TextLayout

_MOST_NAMES = 10


@dataclass(frozen=True)
class Sources:
    """Records to be read.

    Attributes
    ----------
    files : tuple of str
        The files to read, in order; `-` is standard input.
    notes : tuple of str
        What was left out of folders, a sentence each.
    failures : tuple of RecordError
        Folders without records.
    """

    files: tuple[str, ...]
    notes: tuple[str, ...]
    failures: tuple[RecordError, ...]


def records_of(arguments: Sequence[str], layout: TextLayout | None = None) -> Sources:
    """Files as they are given; of a folder the records in it, by name.

    What a folder holds besides (hidden files, folders, files of unknown format) is left out. A file that cannot be read
    stays, so that its failure is told. With a layout, text tables are records that would not be recognized without.

    Raises
    ------
    UsageError
        Standard input is given more than once.
    """
    if arguments.count(STDIN) > 1:
        raise UsageError("standard input (-) can be read only once")
    files: list[str] = []
    notes: list[str] = []
    failures: list[RecordError] = []
    for argument in arguments:
        if argument == STDIN or not is_folder(argument):
            files.append(argument)
            continue
        try:
            found, others = _contents(argument, layout)
        except RecordError as error:
            failures.append(error)
            continue
        files += found
        if others:
            notes.append(f"{argument}: not taken for records: {_listed(others)}")
    return Sources(tuple(files), tuple(notes), tuple(failures))


def _contents(folder: str, layout: TextLayout | None) -> tuple[list[str], list[str]]:
    """The records in a folder with its name before theirs, and the names of all else that is not hidden.

    Raises
    ------
    RecordError
        The folder cannot be read, or has no record in it.
    """
    try:
        names = sorted(path.name for path in Path(folder).iterdir() if not path.name.startswith("."))
    except OSError as error:
        raise RecordError(f"{folder}: the folder cannot be read: {error.strerror or error}") from error
    records, others = [], []
    for name in names:
        file = os.path.join(folder, name)  # noqa: PTH118  Path would shorten what the user wrote
        if Path(file).is_dir():
            others.append(f"{name}/")
        elif Path(file).is_file() and is_record(file, layout):  # A pipe would never end.
            records.append(file)
        else:
            others.append(name)
    if not records:
        raise RecordError(f"{folder}: there is no record in this folder; it holds {_listed(others) or 'nothing'}")
    return records, others


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def is_record(source: str | Path, layout: TextLayout | None = None) -> bool:
    """Whether a file has one of the known formats; True as well for one that cannot be read, which reading will tell.

    A file that has a known format may still be damaged.
    """
    from tdint.ground_motion.reading.plugins import has_known_format
    from tdint.ground_motion.reading.source import is_archive, read_bytes
    from tdint.ground_motion.text_layout import AS_STATED

    try:
        data = read_bytes(source)
        if is_archive(data):  # Spreadsheets and others are zip files, too: the name tells.
            return str(source).lower().endswith(".zip")
        return has_known_format(data, layout or AS_STATED)
    except RecordError:
        return True
