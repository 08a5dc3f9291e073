"""Choose the interpreters for `.ci/run`, and the tests of each.

Standard input is the output of `uv python list --output-format json`. The arguments are three
lists of test files, separated by spaces: the tests of features that depend on the interpreter and
the libraries, the tests that compile loops, and the tests with the lowest libraries. Each line of
the output describes an environment: NAME PYTHON RESOLUTION FILE...
"""

from __future__ import annotations

import json
import sys
from typing import Any

Version = tuple[int, ...]


def newest_of_each_minor(listed: list[dict[str, Any]]) -> dict[Version, tuple[Version, str]]:
    """Return the newest version and its path by (major, minor).

    Shims, builds without the interpreter lock and previews are omitted.
    """
    interpreters: dict[Version, tuple[Version, str]] = {}
    for entry in listed:
        is_usual = entry["implementation"] == "cpython" and entry["variant"] == "default"
        is_release = entry["version"].replace(".", "").isdigit()
        if is_usual and is_release and "/shims/" not in entry["path"]:
            version = tuple(map(int, entry["version"].split(".")))
            interpreters[version[:2]] = max(
                interpreters.get(version[:2], ((), "")), (version, entry["path"])
            )
    return interpreters


def environments(
    interpreters: dict[Version, tuple[Version, str]],
    differs: list[str],
    compiles: list[str],
    lowest: list[str],
) -> list[list[str]]:
    """Return the line of each environment as a list; environments with few tests are last.

    Python 3.11 gets the lowest libraries. The interpreter that executes this file is omitted with
    the newest libraries, because the complete suite runs in it.
    """
    ranked = []
    for minor, (_, path) in sorted(interpreters.items(), reverse=True):
        name = ".".join(map(str, minor))
        if minor == (3, 11):
            ranked.append((0, [f"{name}-lowest", path, "lowest-direct", *lowest]))
        if minor != sys.version_info[:2]:
            is_newest = minor == max(interpreters)
            files = differs if is_newest else compiles
            ranked.append((1 if is_newest else 2, [name, path, "highest", *files]))
    return [words for _, words in sorted(ranked)]


if __name__ == "__main__":
    lists = (words.split() for words in sys.argv[1:])
    for line in environments(newest_of_each_minor(json.load(sys.stdin)), *lists):
        print(*line)
