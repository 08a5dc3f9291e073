"""Units of the samples of several files in one call: by the format or the name of each, or by a
table of files.

`AT2=g,*.mseed=m/s^2` says the units of files by their format (its name, as messages have it) or by
the end of their path; the first entry that fits a file counts, one that fits none of a call is
refused. `suite.csv` is a table with the columns `record` and `units`. A file that no entry fits
says its units itself. Upper and lower case are the same.
"""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from tdint.csv_table import read_table
from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.files import STDIN
from tdint.units import Units, parse_units

SampleUnits = str | Mapping[str, str]
"""Units of all files, or of those of a format or a name."""

_COUNTS = ("counts", "count")
"""What is said of samples whose instrument's response is to be removed."""

_OF_A_PATH = "./*?["
"""Signs that no name of a format has."""

_END = "./"
"""What the end of a path begins with among the entries."""


@dataclass(frozen=True)
class FileUnits:
    """What is said of the samples of each file.

    Attributes
    ----------
    entries : tuple of (str, Units or None)
        A format's name or the end of a path, in lower case, and the units of the files that it
        fits; None for counts.
    for_all : bool
        Whether they are said of all files, whatever these are.
    """

    entries: tuple[tuple[str, Units | None], ...] = ()
    for_all: bool = False

    def of(self, source: str, format_name: str) -> Units | None:
        """Units of a file by its name and its format; None where nothing is said of it."""
        path = _lower(source)
        return next(
            (units for pattern, units in self.entries if _fits(pattern, path, format_name)), None
        )

    def refuse_unfit(
        self, files: Iterable[str], formats_of: Callable[[str], Iterable[tuple[str, str]]]
    ) -> None:
        """Refuse an entry that fits none of the files of a call: a mistaken name, for which units
        would be assumed.

        Parameters
        ----------
        files : iterable of str
            The files; no more of them are looked at than it takes.
        formats_of : callable
            Names and formats of what is in a file; RecordError for one that cannot be read, which
            reading tells.

        Raises
        ------
        UsageError
            There is one.
        """
        left = [] if self.for_all else [pattern for pattern, _ in self.entries]
        names = list(files)
        for file in names:
            # Standard input can be read once only.
            if not left or file == STDIN:
                return
            try:
                parts = [(_lower(part), name) for part, name in formats_of(file)]
            except RecordError:
                return
            left = [pattern for pattern in left if not any(_fits(pattern, *part) for part in parts)]
        if left and names:
            listed = ", ".join(repr(pattern.removeprefix("./")) for pattern in left[:10])
            raise UsageError(
                f"units of {listed}: fit no file of this call; correct the name, or leave it out"
            )


def file_units(given: SampleUnits | None) -> FileUnits:
    """Understand what `units` says of files.

    Raises
    ------
    UsageError
        Units or a format that are unknown; an entry that is no pattern and its units.
    ModelError
        A table that cannot be read.
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
                f"units: {name[:40]!r} is given twice, in upper and lower case, which are the same"
            )
        if not isinstance(text, str):
            raise UsageError(f"units of {name[:40]!r} are a text such as 'm/s^2', got {text!r:.40}")
        try:
            units = None if text.strip().lower() in _COUNTS else parse_units(text)
        except UsageError as error:
            raise UsageError(f"of {name[:40]!r}, {error}") from None
        entries.append((pattern, units))
    return FileUnits(tuple(entries))


def units_of_text(text: str, folder: Path | None = None) -> SampleUnits:
    """What a text says: units of all files as they are, entries `PATTERN=UNITS,...` or a table as a
    dict.

    Parameters
    ----------
    text : str
        Units, entries, or the name of a table (`.csv`).
    folder : Path, optional
        Where the name of a table starts from.

    Raises
    ------
    UsageError, ModelError
        As of `file_units`.
    """
    by_file: dict[str, str] = {}
    if "=" in text:
        for entry in text.split(","):
            pattern, equals, units = (part.strip() for part in entry.partition("="))
            if not (pattern and equals and units):
                example = "FORMAT=UNITS or *.SUFFIX=UNITS, such as AT2=g,*.mseed=m/s^2"
                raise UsageError(f"units {entry[:40]!r}: write {example}")
            if pattern in by_file:
                raise UsageError(
                    f"units: {pattern[:40]!r} is given twice, {by_file[pattern]} and {units}; keep "
                    "one"
                )
            by_file[pattern] = units
        return by_file
    if not text.strip().lower().endswith(".csv"):
        return text

    # Files of a table without units say theirs themselves.
    file = str((folder or Path()) / text.strip())
    table = read_table(
        file,
        "a table of units is a CSV file with the columns record, units",
        columns=("record", "units"),
    )
    table.need("record", "units")
    # A component's units, say, would be passed over in silence.
    if foreign := [title for title in table.titles if title.lower() not in ("record", "units", "")]:
        raise UsageError(
            f"{file}: columns that nothing is done with: {', '.join(foreign)[:80]}; it has record, "
            "units"
        )
    for record, (line, cell) in zip(
        table.texts("record", empty=False), table.lines("units"), strict=True
    ):
        # A name in the table stands for the end of a path, whatever signs it has in it.
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
    """An entry's format or end of a path in lower case.

    Raises
    ------
    UsageError
        It is neither.
    """
    if not _is_path(name):
        # Formats are known with the readers, which a model that names none does without.
        from tdint.ground_motion.reading.contents import plugins

        formats = [plugin.name for plugin in plugins()]
        if name.upper() not in formats:
            hint = did_you_mean(name.upper(), formats) or f"; known: {', '.join(formats)}"
            raise UsageError(
                f"units of {name[:40]!r}: no format of records; a file is named as *.txt{hint}"
            )
        return name.lower()
    # Folders above are not known by name: what is left of the path is its end.
    path = PurePosixPath(
        *(part for part in PurePosixPath(Path(name).as_posix().lower()).parts if part != "..")
    )
    return str(path) if path.is_absolute() else f"{_END}{path}"
