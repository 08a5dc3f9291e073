"""Units of the samples of several files, by format, by file name, or by a table of files.

`AT2=g,*.mseed=m/s^2` specifies units by format (the name used in messages) or by the end of the
path. The first entry that matches a file is used; an entry that matches no file of a call is an
error. `suite.csv` is a table with the columns `record` and `units`. A file that matches no entry
must state its units. Upper and lower case are equivalent.
"""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.files import STDIN
from tdint.units import Units, parse_units

SampleUnits = str | Mapping[str, str]
"""Units of all files, or units by format or file name."""

_COUNTS = ("counts", "count")
"""Units of samples from which the instrument response is to be removed."""

_OF_A_PATH = "./*?["
"""Characters that identify a path, because format names do not contain them."""

_END = "./"
"""Start of the entries that are the end of a path."""


@dataclass(frozen=True)
class FileUnits:
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
        """Return the units of a file by its name and its format; None if no entry matches.

        Parameters
        ----------
        source : str
            Name of the file.
        format_name : str
            Name of its format.
        """
        path = _lower(source)
        return next(
            (units for pattern, units in self.entries if _fits(pattern, path, format_name)), None
        )

    def refuse_unfit(
        self, files: Iterable[str], record_formats: Callable[[str], Iterable[tuple[str, str]]]
    ) -> None:
        """Raise UsageError for an entry that matches no file, because units would be assumed for a
        file with a misspelled entry.

        Parameters
        ----------
        files : iterable of str
            File names; files are read only until all entries are matched.
        formats_of : callable
            Function of a file name; returns names and formats of the records in the file. Raises
            RecordError for a file that cannot be read, which is reported when it is read.

        Raises
        ------
        UsageError
            An entry matches no file.
        """
        left = [] if self.for_all else [pattern for pattern, _ in self.entries]
        names = list(files)
        for file in names:
            # Standard input can be read only once.
            if not left or file == STDIN:
                return
            try:
                parts = [(_lower(part), name) for part, name in record_formats(file)]
            except RecordError:
                return
            left = [pattern for pattern in left if not any(_fits(pattern, *part) for part in parts)]
        if left and names:
            listed = ", ".join(repr(pattern.removeprefix("./")) for pattern in left[:10])
            raise UsageError(
                f"units of {listed}: no file of this call matches; correct the name, or remove "
                "the entry"
            )


def file_units(given: SampleUnits | None) -> FileUnits:
    """Interpret the `units` argument of the reading functions.

    Raises
    ------
    UsageError
        Units or a format are unknown, or an entry is not a pattern with units.
    ModelError
        A table cannot be read.
    """
    if given is None:
        return FileUnits()
    stated = units_of_text(given) if isinstance(given, str) else given
    if not isinstance(stated, Mapping):
        return FileUnits((("*", parse_units(stated)),), for_all=True)
    entries: list[tuple[str, Units | None]] = []
    for name, text in stated.items():
        pattern = _pattern(name)
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
            units = None if text.strip().lower() in _COUNTS else parse_units(text)
        except UsageError as error:
            raise UsageError(f"units of {name[:40]!r}: {error}") from None
        entries.append((pattern, units))
    return FileUnits(tuple(entries))


def units_of_text(text: str, folder: Path | None = None) -> SampleUnits:
    """Parse a text with units: return units of all files unchanged, and entries or a table as a
    dict.

    Parameters
    ----------
    text : str
        Units, entries `PATTERN=UNITS,...`, or the name of a table (`.csv`).
    folder : Path, optional
        Directory to which the name of a table is relative. Default: the current directory.

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

    # A file without units in the table must state its units.
    file = str((folder or Path()) / text.strip())
    table = read_table(
        file,
        "a table of units must be a CSV file with the columns record, units",
        columns=("record", "units"),
    )
    table.need("record", "units")
    # Other columns (for example units by component) must not be ignored silently.
    if foreign := [title for title in table.titles if title.lower() not in ("record", "units", "")]:
        raise UsageError(
            f"{file}: unknown columns are ignored: {', '.join(foreign)[:80]}; a table of units "
            "has the columns record, units"
        )
    for record, (line, cell) in zip(
        table.texts("record", empty=False), table.lines("units"), strict=True
    ):
        # A name in the table is the end of a path; its characters are not wildcards.
        name, units = f"./{glob.escape(record)}", cell.strip()
        if units and by_file.setdefault(name, units) != units:
            raise UsageError(f"{file}:{line}: {record} has two units, {by_file[name]} and {units}")
    return by_file


def _lower(source: str) -> PurePosixPath:
    return PurePosixPath(Path(source).absolute().as_posix().lower())


def _fits(pattern: str, path: PurePosixPath, format_name: str) -> bool:
    return path.match(pattern) if _is_path(pattern) else pattern == format_name.lower()


def _is_path(pattern: str) -> bool:
    return any(sign in pattern for sign in _OF_A_PATH)


def _pattern(name: str) -> str:
    """Return the format or the end of a path of an entry in lower case.

    Raises
    ------
    UsageError
        The entry is neither a supported format nor a path.
    """
    if not _is_path(name):
        # The list of formats is imported only if needed, because it loads the readers.
        from tdint.ground_motion.reading.contents import plugins

        formats = [plugin.name for plugin in plugins()]
        if name.upper() not in formats:
            hint = did_you_mean(name.upper(), formats) or f"; known: {', '.join(formats)}"
            raise UsageError(
                f"units of {name[:40]!r}: unknown file format; specify files with a pattern such "
                f"as *.txt{hint}"
            )
        return name.lower()
    # Parent directories (..) have no known name and are removed; the remainder is the end of a
    # path.
    path = PurePosixPath(
        *(part for part in PurePosixPath(Path(name).as_posix().lower()).parts if part != "..")
    )
    return str(path) if path.is_absolute() else f"{_END}{path}"
