"""Files of directories and archives that are no separate ground motion: documents and tables beside
the records, and the velocity, the displacement or the uncorrected acceleration of a motion with an
acceleration that is in another file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import PurePath

from tdint.number_parsing import abbreviate

_START = 4096  # bytes; start of a file where its type is recognized

_DOCUMENT_SUFFIXES = re.compile(
    r"\.(?:md|rst|rtf|pdf|docx?|odt|pptx?|html?|xml|kml|kmz|png|jpe?g|gif|tiff?|svg|bib|py|ipynb|r|"
    r"sh|bat|exe|db|ini|lnk|url|ya?ml)",
    re.IGNORECASE,
)
"""Pattern of suffixes of files that never contain the samples of a ground motion."""

_DATA_SUFFIXES = re.compile(
    r"\.(?:[avd]t2|[avd]th|acc\w{0,3}|th|ath|v[12]\w?|smc|cor|raw|evt|gcf|gse2?|m?i?n?i?seed|ms|sac|"
    r"xlsx?|ods|mat|npy|npz|h5|hdf5?|gz|bz2|xz|7z|rar|tar|zip|kik|knt|(?:ns|ew|ud)[12]?)",
    re.IGNORECASE,
)
"""Pattern of suffixes of files that contain samples, also if the content shows no numbers because
it is binary, compressed or damaged."""

_RESULT = re.compile(rb'\s*\{\s*"schema":\s*\{\s*"name":\s*"tdint')
_LIST = re.compile(
    rb"[\s\"']*(?:records?|file ?names?|files?|building)[\"']?\s*[,;\t]\s*[\"']?[a-z]",
    re.IGNORECASE,
)
"""Pattern of the first name of a table that lists records or contains results of records."""

_SEARCH = re.compile(
    rb"PEER (?:Ground Motion|NGA).{0,40}Database|Record Sequence Number|"
    rb"Scaled Spectra used in Search",
    re.IGNORECASE,
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
    if _SEARCH.search(start) and not re.fullmatch(r"\.[avd]t2", path.suffix, re.IGNORECASE):
        return "table of a search"
    if _DOCUMENT_SUFFIXES.fullmatch(path.suffix) or path.stem.upper() in ("README", "LICENSE"):
        return "document"
    if _RESULT.match(start) or _LIST.match(start):
        return "description or list of records"
    return ""


def has_data_suffix(name: str) -> bool:
    """Return True if a file contains samples according to the suffix of its name."""
    return bool(_DATA_SUFFIXES.fullmatch(PurePath(name).suffix))


def unused_text(reasons: Mapping[str, str]) -> str:
    """Return the names of files that are not used, grouped by the reason, for a note."""
    names: dict[str, list[str]] = {}
    for name, reason in reasons.items():
        names.setdefault(reason, []).append(name)
    return "; ".join(
        f"{abbreviate(listed, _MAX_NAMES)} ({reason})" for reason, listed in names.items()
    )


_MAX_NAMES = 10  # maximum number of names of each reason in a note

_PEER = re.compile(r"\.(?P<quantity>[AVD])T2$", re.IGNORECASE)
_WORD = re.compile(
    r"(?<![A-Z0-9])(?P<quantity>ACC|VEL|DISP?)(?![A-Z0-9])",
    re.IGNORECASE,
)
_VOLUME = re.compile(r"\.V(?P<quantity>[12])(?=[A-Z]?$)", re.IGNORECASE)
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
            if match := pattern.search(path.name):
                rank, quantity = _QUANTITIES[match["quantity"][0].upper()]
                start, end = match.span("quantity")
                rest = f"{path.name[:start]}?{path.name[end:]}".upper()
                key = (str(path.parent), pattern.pattern, rest)
                motions.setdefault(key, []).append((rank, name, quantity))
                break
    repeated: dict[str, str] = {}
    for files in motions.values():
        best = min(rank for rank, _, _ in files)
        repeated |= {name: quantity for rank, name, quantity in files if rank > best}
    return repeated
