"""Units of the samples of several files, by format, by file name, or by a table of files.

`AT2=g,*.mseed=m/s^2` specifies units by format (the name used in messages) or by the end of the
path. The first entry that matches a file is used; an entry that matches no file of a call is an
error. `suite.csv` is a table with the columns `record` and `units`. A file that matches no entry
must state its units. Upper and lower case are equivalent.
"""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.files import STDIN, pattern_of
from tdint.units import Units, parse_units

SampleUnits = str | Mapping[str, str]
"""Units of all files, or units by format or file name."""

_COUNTS = ("counts", "count")
"""Units in the text of the user that request the removal of the instrument response."""

_PATH_CHARACTERS = "./*?["
"""Characters that distinguish the pattern of a path from the name of a format."""

_RELATIVE_PREFIX = "./"
"""Prefix of patterns that are compared with the end of a path."""


class FileUnits(NamedTuple):
    """Units of samples specified by the user, by file.

    Attributes
    ----------
    entries : tuple of (str, Units or None)
        Name of a format or end of a path, in lower case, and the units of the matching files; None
        for counts.
    for_all : bool
        True if the units apply to all files.
    """

    entries: tuple[tuple[str, Units | None], ...] = ()
    for_all: bool = False

    def of(self, source: str, format_name: str) -> Units | None:
        """Return the units of a file by its name and its format; None for counts, or if no entry
        matches.
        """
        path = _lower_path(source)
        return next(
            (units for pattern, units in self.entries if _matches(pattern, path, format_name)), None
        )

    def require_matches(
        self, files: Iterable[str], record_formats: Callable[[str], Iterable[tuple[str, str]]]
    ) -> None:
        """Raise UsageError if an entry of the units by file matches no file.

        An entry with a spelling error would otherwise be ignored, and units assumed for its file.

        Parameters
        ----------
        files : iterable of str
            File names; files are read only until all entries are matched.
        record_formats : callable
            Function of a file name; returns names and formats of the records in the file. It raises
            RecordError for a file that cannot be read. The entries are then not checked, because
            the error is reported when the file is read.

        Raises
        ------
        UsageError
            An entry matches no file.
        """
        unmatched = [] if self.for_all else [pattern for pattern, _ in self.entries]
        names = list(files)
        for file in names:
            # Standard input cannot be read twice, so its format cannot be detected here.
            if not unmatched or file == STDIN:
                return
            try:
                parts = [(_lower_path(part), name) for part, name in record_formats(file)]
            except RecordError:
                return
            unmatched = [
                pattern
                for pattern in unmatched
                if not any(_matches(pattern, path, name) for path, name in parts)
            ]
        if unmatched and names:
            listed = ", ".join(repr(pattern.removeprefix("./")) for pattern in unmatched[:10])
            raise UsageError(
                f"units of {listed}: no file of this call matches; correct the name, or remove "
                "the entry"
            )


def file_units(units: SampleUnits | None) -> FileUnits:
    """Interpret the `units` argument of the reading functions.

    Parameters
    ----------
    units : str, mapping or None
        Units of all files; entries `PATTERN=UNITS,...` or a mapping of patterns to units; the name
        of a table (`.csv`);; None if the user specifies no units.

    Raises
    ------
    UsageError
        Units or a format are unknown, or an entry is not a pattern with units.
    ModelError
        A table cannot be read.
    """
    if units is None:
        return FileUnits()
    stated = units_of_text(units) if isinstance(units, str) else units
    if not isinstance(stated, Mapping):
        # The pattern * matches every file.
        return FileUnits((("*", parse_units(stated)),), for_all=True)
    entries: list[tuple[str, Units | None]] = []
    for name, text in stated.items():
        pattern = _to_pattern(name)
        if pattern in dict(entries):
            raise UsageError(
                f"units: {name[:40]!r} is specified twice, in upper and lower case, which are "
                "equivalent"
            )
        if not isinstance(text, str):
            raise UsageError(
                f"units of {name[:40]!r} must be a text such as 'm/s^2', got {text!r:.40}"
            )
        try:
            parsed = None if text.strip().lower() in _COUNTS else parse_units(text)
        except UsageError as error:
            raise UsageError(f"units of {name[:40]!r}: {error}") from None
        entries.append((pattern, parsed))
    return FileUnits(tuple(entries))


def units_of_text(text: str, folder: Path | None = None) -> SampleUnits:
    """Parse a text that specifies the units of the samples of one or several files.

    Parameters
    ----------
    text : str
        Units of all files, entries `PATTERN=UNITS,...`, or the name of a table (`.csv`).
    folder : Path, optional
        Directory of the table, if its name is a relative path. Default: the current directory.

    Returns
    -------
    str or dict
        Units of all files unchanged, or units by pattern.

    Raises
    ------
    UsageError, ModelError
        Raised for the same reasons as by `file_units`.
    """
    by_file: dict[str, str] = {}
    if "=" in text:
        for entry in text.split(","):
            pattern, equals, units = (part.strip() for part in entry.partition("="))
            if not (pattern and equals and units):
                example = "FORMAT=UNITS or *.SUFFIX=UNITS, such as AT2=g,*.mseed=m/s^2"
                raise UsageError(f"invalid units {entry[:40]!r}; expected {example}")
            if pattern in by_file:
                raise UsageError(
                    f"units: {pattern[:40]!r} is specified twice, as {by_file[pattern]} and "
                    f"{units}; keep one"
                )
            by_file[pattern] = units
        return by_file
    if not text.strip().lower().endswith(".csv"):
        return text

    from tdint.csv_table import read_table

    # If the table has no units for a record file, the record file must state its units.
    file = str((folder or Path()) / text.strip())
    table = read_table(
        file,
        "a table of units must be a CSV file with the columns record, units",
        columns=("record", "units"),
    )
    table.need("record", "units")
    # Other columns (for example units by component) could change the units: they are refused.
    if foreign := [title for title in table.titles if title.lower() not in ("record", "units", "")]:
        raise UsageError(
            f"{file}: unknown columns {', '.join(foreign)[:80]}; a table of units must have only "
            "the columns record, units"
        )
    for record, (line, cell) in zip(
        table.texts("record", empty=False), table.lines("units"), strict=True
    ):
        # A name in the table is the end of a path; its characters are not wildcards.
        name, units = f"./{glob.escape(record)}", cell.strip()
        if units and by_file.setdefault(name, units) != units:
            raise UsageError(
                f"{file}:{line}: {record} has two units, {by_file[name]} and {units}; keep one row"
            )
    return by_file


def _lower_path(source: str) -> PurePosixPath:
    """Return the absolute path of a file in lower case."""
    return PurePosixPath(Path(source).absolute().as_posix().lower())


def _matches(pattern: str, path: PurePosixPath, format_name: str) -> bool:
    """Return True if a pattern matches the end of the path of a file, or is the name of its
    format."""
    return path.match(pattern) if _is_path(pattern) else pattern == format_name.lower()


def _is_path(pattern: str) -> bool:
    """Return True if a pattern is compared with the path of a file, False if it names a format."""
    return any(character in pattern for character in _PATH_CHARACTERS)


def _to_pattern(name: str) -> str:
    """Convert the name in an entry of units by file (a format, or the end of a path, possibly with
    wildcards) to a pattern in lower case.

    A relative path gets the prefix `./`. UsageError is raised if the entry is not a supported
    format and not a path.
    """
    if not _is_path(name):
        # The list of formats is imported only if needed, because it loads the readers.
        from tdint.ground_motion.reading.contents import plugins

        formats = [plugin.name for plugin in plugins()]
        if name.upper() not in formats:
            hint = did_you_mean(name.upper(), formats) or f"; the formats are {', '.join(formats)}"
            raise UsageError(
                f"units of {name[:40]!r}: unknown file format; specify files with a pattern such "
                f"as *.txt{hint}"
            )
        return name.lower()
    # Parent directories (..) have no known name and are removed; the remaining parts are the end of
    # a path.
    parts = PurePosixPath(Path(pattern_of(name)).as_posix().lower()).parts
    path = PurePosixPath(*(part for part in parts if part != ".."))
    return str(path) if path.is_absolute() else f"{_RELATIVE_PREFIX}{path}"
