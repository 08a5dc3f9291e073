"""Files of directories and archives that are no separate ground motion: documents and tables next
to the records, and the velocity, the displacement or the uncorrected acceleration of a motion with
an acceleration that is in another file."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import PurePath

from tdint.items import grouped
from tdint.number_parsing import abbreviate

_START = 4096  # bytes; start of a file where its type is recognized

_DOCUMENT_SUFFIXES = (
    r"(?i)\.(?:md|rst|rtf|pdf|docx?|odt|pptx?|html?|xml|kml|kmz|png|jpe?g|gif|tiff?|svg|bib|py|ipynb|"
    r"r|sh|bat|exe|db|ini|lnk|url|ya?ml|pptx?|eps|bmp|webp|mp4|mov|avi|pyc|tex|css|js|toml|cfg)"
)
"""Pattern of suffixes of files that never contain the samples of a ground motion."""

_DATA_SUFFIXES = (
    r"(?i)\.(?:[avd]t2|[avd]th|acc\w{0,3}|th|ath|v[12]\w?|smc|cor|raw|evt|gcf|gse2?|m?i?n?i?seed|ms|"
    r"sac|xlsx?|ods|mat|npy|npz|h5|hdf5?|gz|bz2|xz|7z|rar|tar|zip|kik|knt|(?:ns|ew|ud)[12]?)"
)
"""Pattern of suffixes of files that contain samples, also if the content shows no numbers because
it is binary, compressed or damaged."""

_SENSOR = r"(?i)(?:gyro|magnetometer|barometer|location|gps|orientation|gravity|battery).*"
"""Pattern of the names of the tables of a telephone next to its accelerations."""

_RESULT = rb'\s*\{\s*"schema":\s*\{\s*"name":\s*"tdint'
_LIST = rb"(?i)[\s\"']*(?:records?|file ?names?|files?|building)[\"']?\s*[,;\t]\s*[\"']?[a-z]"
"""Pattern of the first name of a table that lists records or contains results of records."""

_SEARCH = (
    rb"(?i)PEER (?:Ground Motion|NGA).{0,40}Database(?! Record\b)|Record Sequence Number|"
    rb"Scaled Spectra used in Search"
)
"""Pattern of the table of a search, which PEER delivers with the records."""


def other_type(name: str, data: bytes) -> str:
    """Return the type of a file in no supported format if its name or its start shows that it
    contains no ground motion; empty if it may contain one.

    Parameters
    ----------
    name : str
        Name of the file, with or without its directory.
    data : bytes
        Content of the file.
    """
    path, start = PurePath(name), data[:_START]
    if re.search(_SEARCH, start) and not re.fullmatch(r"\.[avd]t2", path.suffix, re.IGNORECASE):
        return "table of a search"
    if re.fullmatch(_DOCUMENT_SUFFIXES, path.suffix) or path.stem.upper() in ("README", "LICENSE"):
        return "document"
    if re.fullmatch(_SENSOR, path.stem):
        return "another sensor"
    if re.match(_RESULT, start) or re.match(_LIST, start):
        return "description or list of records"
    return ""


_METADATA = (
    r"rsn|record sequence.*|eqid|evid|(?:event|earthquake|eq|quake)\b.*|year|date|month|"
    r"(?:station|sta|site|network|net)\b.*|ssn|(?:m|mw|ml|mag|magnitude)\b.*|mechanism|"
    r"(?:clstd|rrup|rjb|rx|repi|rhyp|epid|hypd|jb|closest|epicentral|hypocentral|dist|distance)\b.*|"
    r"vs30.*|lat|latitude.*|lon|long|longitude.*|(?:hypocenter )?depth.*|strike|dip|rake|azimuth|"
    r"pg[avd]\b.*|arias.*|cav.*|file ?names?.*|(?:lowest )?usable.*|[hl]p\b.*|t\d+\.?\d*s|"
    r"(?:significant )?duration.*|d5-?(?:75|95).*|scale factor.*"
)
"""Pattern of a column name of a table of records (flatfile), in lower case with blanks."""

_MIN_METADATA = 3  # names; a table of samples may have a column of the station or of the peak
_MAX_NAME_LINE = 30  # lines above the table
_MIN_RECTANGULAR = 0.8  # fraction of the lines with one cell for each name


def metadata_names(data: bytes) -> list[str]:
    """Return the names of metadata in the header of a table of records; empty for other files.

    At least three columns must have such names, and the lines below must have the same number of
    cells as the line of the names: metadata above the samples of a record are no such table.
    """
    lines = data[: 16 * _START].decode("utf-8", "replace").splitlines()
    rows = [line for line in lines if line.strip(" \t,;")]
    for index, line in enumerate(rows[:_MAX_NAME_LINE]):
        mark = max("\t;,|", key=line.count)
        if line.count(mark) < _MIN_METADATA:
            continue
        cells = next(csv.reader([line], delimiter=mark))
        plain = [re.sub(r"[\W_]+", " ", cell.lower()).strip() for cell in cells]
        names = [
            cell for cell, name in zip(cells, plain, strict=True) if re.fullmatch(_METADATA, name)
        ]
        if len(names) < _MIN_METADATA:
            continue
        below = [*csv.reader(rows[index + 1 : -1] or rows[index + 1 :], delimiter=mark)]
        same = sum(len(row) == len(cells) for row in below)
        if same and same >= _MIN_RECTANGULAR * len(below):
            return names
    return []


_FEW_NUMBERS = 20
"""Numbers in rows; a file with fewer numbers is no ground motion."""

_MARKS = r"(?:[\s,;|/=<>{}\[\]()\"']|(?<=\d):(?=[-+.\d])|(?<=\"):)+"
_CELLS = "[,;\t|]"
_TAG_OR_CLOCK = r"(?i)</?[a-z][^<>]*>|(?<![.\d])\d{1,2}:\d{2}(?::\d{2}(?:\.\d+)?)?(?!\.?\d)"
_JSON_PAIR = r'"([^"]*)"\s*:\s*[-+.\deE]+'
_NUMBER_WORD = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[EeDd][-+]?\d+)?[a-z%^]{0,4}\d?"


def has_few_numbers(data: bytes) -> bool:
    """Return True if a text has fewer than 20 numbers in rows, with any separators.

    A row has at least as many numbers as other words, and starts with a number unless it has
    several: `0.01 g` and `t=0.1 a=0.2` are rows, `Depth: 5 km` and `Event 3 at noon` are not. The
    lines of a table with columns of text, which have numbers in the same cells, are also rows. A
    value of a JSON object counts if its key is repeated as the name of a column. Binary data may
    contain numbers.
    """
    if b"\0" in data:
        return False
    text = re.sub(
        _TAG_OR_CLOCK,
        lambda match: " " if match[0][0] == "<" else " clock ",
        data.decode("utf-8", "replace"),
    )
    keys = Counter(re.findall(_JSON_PAIR, text))
    text = re.sub(
        _JSON_PAIR, lambda pair: pair[0] if keys[pair[1]] >= _FEW_NUMBERS // 2 else " ", text
    )
    # Each word of the file is tested; `re` would look up the pattern each time.
    is_number = re.compile(_NUMBER_WORD).fullmatch
    found, forms = 0, Counter[tuple[bool, ...]]()
    for line in text.splitlines():
        cells = [bool(is_number(cell.strip(" \"'"))) for cell in re.split(_CELLS, line)]
        forms[tuple(cells)] += len(cells) >= _MIN_METADATA
        words = [word for word in re.split(_MARKS, line) if word]
        are_numbers = [bool(is_number(word)) for word in words]
        count = sum(are_numbers)
        if 2 * count >= len(words) and (count > 1 or are_numbers[:1] == [True]):
            found += count
    # The numbers of a table with columns of text
    found += max((count * sum(form) for form, count in forms.items()), default=0)
    return found < _FEW_NUMBERS


def has_data_suffix(name: str) -> bool:
    """Return True if a file contains samples according to the suffix of its name."""
    return bool(re.fullmatch(_DATA_SUFFIXES, PurePath(name).suffix))


def unused_text(reasons: Mapping[str, str]) -> str:
    """Return the names of files that are not used, grouped by the reason, for a note."""
    names = grouped((reason, name) for name, reason in reasons.items())
    return "; ".join(
        f"{abbreviate(listed, _MAX_NAMES)} ({reason})" for reason, listed in names.items()
    )


_MAX_NAMES = 10  # maximum number of names of each reason in a note

_PEER = r"(?i)\.(?P<quantity>[AVD])T2$"
_WORD = r"(?i)(?<![A-Z0-9])(?P<quantity>ACC|VEL|DISP?)(?![A-Z0-9])"
_VOLUME = r"(?i)\.V(?P<quantity>[12])(?=[A-Z]?$)"
"""Patterns of the part of a name that states the quantity: PEER (.AT2, .VT2, .DT2), names of ESM,
ITACA and programs (.ACC., _VEL.txt, .dis), and the volumes of strong-motion records (.V1
uncorrected, .V2 corrected)."""

_QUANTITIES = {
    "A": (0, "acceleration"),
    "V": (1, "velocity"),
    "D": (2, "displacement"),
    "2": (0, "corrected acceleration"),
    "1": (1, "uncorrected acceleration"),
}
"""Order of preference and name of a quantity by the first character of its part of the name."""


def repeated_motions(names: Iterable[str]) -> dict[str, str]:
    """Return the files that contain a ground motion that is also in another file of a set, with
    their quantity.

    The names of the files of a motion differ only in the quantity. The acceleration is used if it
    is in the set, otherwise the velocity, otherwise the displacement.

    Parameters
    ----------
    names : iterable of str
        Names of the files of the set, which may contain directories.
    """
    motions: dict[tuple[str, str, str], list[tuple[int, str, str]]] = {}
    for name in names:
        path = PurePath(name)
        for pattern in (_PEER, _VOLUME, _WORD):
            if match := re.search(pattern, path.name):
                rank, quantity = _QUANTITIES[match["quantity"][0].upper()]
                start, end = match.span("quantity")
                rest = f"{path.name[:start]}?{path.name[end:]}".upper()
                key = (str(path.parent), pattern, rest)
                motions.setdefault(key, []).append((rank, name, quantity))
                break
    repeated: dict[str, str] = {}
    for files in motions.values():
        best = min(rank for rank, _, _ in files)
        repeated |= {name: quantity for rank, name, quantity in files if rank > best}
    return repeated
