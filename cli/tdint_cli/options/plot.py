"""Options whose file may be left out: --plot and --history alone put it beside the output, else they name it."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from pathlib import Path

from tdint.errors import UsageError

BESIDE = "\0"
"""The value of such an option alone; no file has such a name."""

SUFFIX = ".png"
"""Of a picture that got no name."""

_NAMES = {
    "--plot": re.compile(r".*\.(png|pdf|svg|jpe?g|gif|e?ps|tiff?|webp|bmp|svgz|pgf)", re.IGNORECASE | re.DOTALL),
    "--history": re.compile(r".*\.csv(\.gz)?", re.IGNORECASE | re.DOTALL),
}
"""What follows such an option and names its file; pictures that cannot be are refused later, in words."""


def with_named_files(arguments: Sequence[str], options: Collection[str] = tuple(_NAMES)) -> list[str]:
    """A command line in which every option of these has its value: the next word if that is such a name or empty."""
    result: list[str] = []
    words = iter(enumerate(arguments))
    for i, word in words:
        if word == "--":
            return [*result, *arguments[i:]]
        if word not in _NAMES or word not in options:
            result.append(word)
            continue
        following = arguments[i + 1] if i + 1 < len(arguments) else BESIDE
        if following == "" or _NAMES[word].fullmatch(following):
            next(words)
            result.append(f"{word}={following}")
        else:
            result.append(f"{word}={BESIDE}")
    return result


def picture_file(plot: str | None, table: Path | None) -> Path | None:
    """The file of a picture, if one is asked for; the table's name with another suffix if it got no name.

    Raises
    ------
    UsageError
        It has no name, and there is no table beside which it could lie.
    """
    if plot != BESIDE:
        return Path(plot) if plot else None
    if table is None:
        raise UsageError("--plot alone puts the picture beside the output: add -o, or name it: --plot=FILE.png")
    return beside(table, SUFFIX)


def beside(table: Path, suffix: str) -> Path:
    """The file of another kind beside a table, which may be packed (.csv.gz)."""
    return (table.with_suffix("") if table.suffix.lower() == ".gz" else table).with_suffix(suffix)
