"""Ground motions written as files: MiniSEED, AT2 and CSV.

A file keeps the event, the station and the component of its source, in its name and in its header,
so that every command recognizes the two files of a pair.
"""

from __future__ import annotations

import os
import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tdint.ground_motion.formats.at2 import at2_text
from tdint.ground_motion.formats.table_columns import ORIGIN
from tdint.ground_motion.horizontals import at_right_angles, azimuth, motion_names
from tdint.ground_motion.origin import MotionOrigin, header_statement
from tdint.ground_motion.reading.suites import GroundMotion, components
from tdint.ground_motion.record import SI_LOCATION, Record, component_names, to_mseed
from tdint.output.tables.spectra import ground_table

_STATION = 5  # characters of a station code in MiniSEED
_CHANNEL = 3  # characters of a channel code in MiniSEED
_OTHER_INSTRUMENT = r"([A-Z])[HLGMPD]([ENZ123])"
"""Channel codes that MiniSEED readers would not take for an accelerometer's."""

_PAIR_COMPONENTS = ("H1", "H2")
"""Components of a pair whose own names do not identify them."""


def motion_file_names(motions: Sequence[GroundMotion], file_format: str) -> list[str]:
    """Return the name of a file for each component of ground motions.

    A file has the name of its source, with the component at the end if this name does not identify
    it. Names that would occur more than once start with the number of the motion.

    Parameters
    ----------
    motions : sequence of Record or Horizontals
        The motions. The sources are the files that they were read from.
    file_format : str
        Format of the files, which is also the suffix of the names: mseed, at2 or csv.
    """
    names_of_motions = [_names_of_components(components(motion), file_format) for motion in motions]
    count = Counter(name for names in names_of_motions for name in names)
    result: list[str] = []
    for number, names in enumerate(names_of_motions, start=1):
        # All components of a motion get its number if one of their names is not unique.
        prefix = f"{number}-" if any(count[name] > 1 for name in names) else ""
        result += [f"{prefix}{name}" for name in names]
    return result


def motion_contents(
    motions: Sequence[GroundMotion], file_format: str, origins: Sequence[MotionOrigin] = ()
) -> tuple[list[bytes], tuple[str, ...]]:
    """Return the contents of a file for each component of ground motions, and notes about them.

    Parameters
    ----------
    origins : sequence of MotionOrigin, optional
        Origins of all components, stated in the headers of AT2 and CSV files; a header of MiniSEED
        has no place for them. Default: none.

    Returns
    -------
    list of bytes
        Content of the file of each component, in the order of `motion_file_names`.
    tuple of str
        Notes, for example about a shortened station code; empty for AT2 and CSV.

    Raises
    ------
    OutputError
        MiniSEED cannot express a sampling interval.
    """
    records = [record for motion in motions for record in _named_components(components(motion))]
    stated: Sequence[MotionOrigin | None] = origins or [None] * len(records)
    if file_format == "at2":
        texts = map(at2_text, records, stated)
        return [text.encode() for text in texts], ()
    if file_format == "csv":
        return [
            _csv_content(record, origin) for record, origin in zip(records, stated, strict=True)
        ], ()

    # MiniSEED has short codes for the station and the component, and no place for the event.
    stations = _short_stations([_codes(record)[1] for record in records])
    contents: list[bytes] = []
    notes: list[str] = []
    for motion in motions:
        named_records = _named_components(components(motion))
        channels = _channels([record.component for record in named_records])
        for record, channel in zip(named_records, channels, strict=True):
            network, station, _, _ = _codes(record)
            # The location code states that the samples are in SI units.
            record_id = ".".join((network[:2], stations[station], SI_LOCATION, channel))
            content, mseed_notes = to_mseed([replace(record, id=record_id)])
            contents.append(content)
            notes += mseed_notes
            if stations[station] != station:
                notes.append(
                    f"MiniSEED has {_STATION} ASCII characters for a station: {station} is written "
                    f"as {stations[station] or 'an empty code'}"
                )
    return contents, tuple(dict.fromkeys(notes))


def _names_of_components(records: Sequence[Record], file_format: str) -> list[str]:
    """Return file names for the components of a ground motion, such that readers recognize two
    files as the components of a pair by their names.

    `file_format` is the suffix of the names, without a dot.
    """
    stems = [Path(record.source).stem.strip(" -") or "motion" for record in records]
    suffixes = [_component_suffix(name) for name in component_names(records)]
    with_suffixes = [
        f"{stem}-{suffix}".rstrip("-") for stem, suffix in zip(stems, suffixes, strict=True)
    ]
    if len(records) == 1:
        # The file name of a single component must contain the component.
        has_component = _is_in_name(suffixes[0], stems[0])
        return [f"{(stems if has_component else with_suffixes)[0]}.{file_format}"]

    # Try the names of the sources, these names with the component, and the common start of the
    # names with the component. Use the first pair of names that identifies the two files as a
    # single ground motion.
    common = os.path.commonprefix(stems).rstrip(" -_.") or stems[0]  # noqa: RUF071  of letters
    for candidates in (stems, with_suffixes, [f"{common}-{suffix}" for suffix in suffixes]):
        names = [f"{name}.{file_format}" for name in candidates]
        if names[0] != names[1] and len(set(motion_names(names))) == 1:
            return names
    return [f"{common}-{suffix}.{file_format}" for suffix in _PAIR_COMPONENTS]


def _is_in_name(component: str, stem: str) -> bool:
    """Return True if a file name without suffix contains the component: a name such as HNE as a
    separate word, a direction such as 090 only at the end of the file name."""
    if component.isdecimal():
        return bool(re.search(rf"(?<!\d){component}$", stem))
    word = rf"(?<![A-Z0-9]){re.escape(component)}(?![A-Z0-9])"
    return bool(component and re.search(word, stem, re.IGNORECASE))


def _component_suffix(component: str) -> str:
    """Return the text of a component at the end of a file name: a direction in degrees has three
    digits (`090`), special characters are replaced by hyphens."""
    name = re.sub(r"[^\w-]+", "-", component.strip())
    return f"{int(name):03d}" if name.isdecimal() else name


def _named_components(records: Sequence[Record]) -> list[Record]:
    """Return the components of a ground motion. If the components of a pair have no names or equal
    names, they are called H1 and H2."""
    names = [record.component.strip() for record in records]
    if len(records) == 2 and (not all(names) or names[0] == names[1]):
        names = list(_PAIR_COMPONENTS)
    return [replace(record, component=name) for record, name in zip(records, names, strict=True)]


def _codes(record: Record) -> list[str]:
    """Return the codes of the network, station, location and channel of a record; four empty texts
    if they are unknown."""
    codes = record.id.split(".")
    return codes if len(codes) == 4 else [""] * 4


def _csv_content(record: Record, origin: MotionOrigin | None) -> bytes:
    """Return the content of a CSV file of samples. Comment lines before the table state event,
    network, station, component, start time and origin; unknown values are omitted."""
    table = ground_table(record).csv()
    network, station, _, _ = _codes(record)
    declared = {
        "event": re.sub("[,;]", " ", record.event),
        "network": network,
        "station": station,
        "component": record.component,
        "start": record.start,
    }
    if origin:
        # The checksum in the statement is the checksum of the written digits, in the second column.
        samples = [float(row.split(b",")[1]) for row in table.splitlines()[1:]]
        declared[ORIGIN] = header_statement(origin, samples)
    header = "".join(f"# {key} = {value}\n" for key, value in declared.items() if value)
    return header.encode() + table


def _short_stations(stations: Sequence[str]) -> dict[str, str]:
    """Return a unique code for each station name with at most five ASCII characters, as MiniSEED
    requires.

    A name that meets these requirements is not changed. Any other name is reduced to its first
    alphanumeric ASCII characters, without accents; the code is empty if no such character exists.
    """
    codes: dict[str, str] = {}
    for station in dict.fromkeys(stations):
        # NFKD separates a letter from its accent; `re.ASCII` then removes the accent.
        decomposed = unicodedata.normalize("NFKD", station)
        letters_and_digits = re.sub(r"[\W_]+", "", decomposed, flags=re.ASCII)
        is_valid = len(station) <= _STATION and station.isascii()
        code = station if is_valid else letters_and_digits[:_STATION]
        # If the code is already used, replace its end by a number.
        number = 1
        while code in codes.values():
            number += 1
            code = f"{letters_and_digits[: _STATION - len(str(number))]}{number}"
        codes[station] = code
    return codes


def _channels(names: Sequence[str]) -> list[str]:
    """Return the channel codes of the components of a motion in MiniSEED.

    A code is the name of the component, or its direction in degrees if the name is too long. The
    components of a pair are HN1 and HN2 if their codes do not identify perpendicular directions.
    """
    codes = []
    for name in names:
        code, direction = name.upper(), azimuth(name)
        if len(code) > _CHANNEL and direction is not None:
            code = f"{round(direction) % 360:03d}"
        # The second letter of a code is the type of the instrument. It is replaced by N, the letter
        # of accelerometers, because the file contains accelerations.
        code = re.sub(_OTHER_INSTRUMENT, r"\1N\2", code)
        is_valid = len(code) <= _CHANNEL and code.isalnum() and code.isascii()
        codes.append(code if is_valid else "")
    if len(codes) == 1:
        return codes
    # The code of an unsuitable component name is empty, and an empty code is not at right angles to
    # any code.
    return codes if at_right_angles(*codes) else ["HN1", "HN2"]
