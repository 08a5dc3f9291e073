"""The option --plot: alone it puts the picture beside the output, else it names the picture's file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from tdint.errors import UsageError

BESIDE = "\0"
"""The value of `--plot` alone; no file has such a name."""

SUFFIX = ".png"
"""Of a picture that got no name."""

_PICTURE = re.compile(r".*\.(png|pdf|svg|jpe?g|gif|e?ps|tiff?|webp|bmp|svgz|pgf)", re.IGNORECASE | re.DOTALL)
"""What follows `--plot` and names a picture; those that no picture has are refused later, in words."""


def with_named_pictures(arguments: Sequence[str]) -> list[str]:
    """A command line in which every `--plot` has its value: the next word if that is a picture's name or empty."""
    result: list[str] = []
    words = iter(enumerate(arguments))
    for i, word in words:
        if word == "--":
            return [*result, *arguments[i:]]
        if word != "--plot":
            result.append(word)
            continue
        following = arguments[i + 1] if i + 1 < len(arguments) else BESIDE
        if following == "" or _PICTURE.fullmatch(following):
            next(words)
            result.append(f"--plot={following}")
        else:
            result.append(f"--plot={BESIDE}")
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
    return table.with_suffix(SUFFIX)
