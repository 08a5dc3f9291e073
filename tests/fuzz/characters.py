"""Command lines from a seed with characters that cannot be encoded, or with bytes that are not
UTF-8, in any argument.

A character that cannot be encoded is an error of usage. Bytes that are not UTF-8 can be part of
file names.
"""

import random

from fuzz import command_lines
from fuzz.oracle import Failure
from fuzz.sandbox import run
from fuzz.study_files import FILES

_UNENCODABLE = ("\ud800", "\udbff", "\udfff", "\udc7f", "\ud83c")
_BYTES = ("\udc80", "\udcff", "\udce9")


def names() -> list[str]:
    """Return the names of the commands that are tried, without those that take seconds."""
    return [*dict.fromkeys(command_lines.names())]


def outcome(name: str, seed: int) -> str:
    """Return the outcome of a call within a sandbox; raise Failure for forbidden behavior."""
    source = random.Random(f"characters {name} {seed}")
    arguments = command_lines.command_line(name, seed) if name in command_lines.names() else [name]
    if name not in command_lines.SOUND:
        arguments = [name, source.choice(list(FILES))]
    is_encodable = source.random() < 0.3
    index = source.randrange(1, len(arguments)) if len(arguments) > 1 else 0
    word, character = arguments[index], source.choice(_BYTES if is_encodable else _UNENCODABLE)
    position = source.randrange(len(word) + 1)
    arguments[index] = word[:position] + character + word[position:]
    found = run(arguments)
    if not is_encodable and found != "usage":
        raise Failure(f"{arguments!r}: a character that cannot be encoded ends with {found}")
    return found
