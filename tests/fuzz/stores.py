"""Damage stores of campaigns and studies, from a seed. The next call repairs them with a message or
refuses them, and no table has a wrong byte."""

import functools
import random
import re
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

from fuzz.mutators import mutated
from fuzz.oracle import Failure
from fuzz.sandbox import OUTPUT, invoked

_RECORD = ("a.txt", "--units", "m/s^2")
CALLS = {
    "campaign": ("campaign", "scales.yaml", "-o", OUTPUT, "--jobs", "1"),
    "study": (
        "ida", "bilinear.yaml", *_RECORD, "--precision", "50%", "--max-im", "3g", "-o",
        OUTPUT, "--jobs", "1",
    ),
}  # fmt: skip
"""Calls that go on with a store."""

HEALED, SOUND, REFUSED = "healed, said", "nothing to do", "refused"
OUTCOMES = (HEALED, SOUND, REFUSED)

_DONE_AGAIN = re.compile(r"done again|\d+ runs in")
_VALUES: tuple[object, ...] = (
    *(None, 0, 1, -1, 2**63 - 1, 0.5, -1e308, 9e999),
    *("", "done", "collapsed", "=1+1", "nan", "\x1b[31m", "\n", b"\xff\0"),
)


@functools.cache
def _sound_files(name: str) -> dict[str, bytes]:
    """Return the files of a successful call."""
    shutil.rmtree(OUTPUT, ignore_errors=True)
    code, messages = invoked(CALLS[name])
    if code:
        raise Failure(f"the sound call ends with {code}: {messages}")
    return {file.name: file.read_bytes() for file in Path(OUTPUT).iterdir()}


def outcome(name: str, seed: int) -> str:
    """Return the outcome of the next call for a corrupt store within a sandbox; raise Failure for
    forbidden behavior."""
    sound_files = _sound_files(name)
    source = random.Random(f"{name} {seed}")
    file = Path(
        OUTPUT,
        next(name_of_file for name_of_file in sound_files if name_of_file.endswith(".sqlite")),
    )
    shutil.rmtree(OUTPUT, ignore_errors=True)
    Path(OUTPUT).mkdir()
    for name_of_file, content in sound_files.items():
        Path(OUTPUT, name_of_file).write_bytes(content)
    for _ in range(source.choice((1, 1, 1, 2, 4))):
        source.choice(DAMAGES)(file, source)
    code, messages = invoked(CALLS[name])
    if code not in (0, 6):
        raise Failure(f"exit code {code}: {messages[-300:]!r}")
    if "Traceback" in messages or (code == 6 and messages.count("Error: ") != 1):
        raise Failure(messages[-300:])
    for name_of_file, content in sound_files.items():
        if name_of_file.endswith(".csv") and Path(OUTPUT, name_of_file).read_bytes() != content:
            raise Failure(f"{name_of_file} is another one, exit code {code}: {messages[-200:]!r}")
    if code == 6:
        return REFUSED
    return HEALED if _DONE_AGAIN.search(messages) or "to do" not in messages else SOUND


def _bytes(file: Path, source: random.Random) -> None:
    if data := file.read_bytes():
        file.write_bytes(mutated(data, source.randrange(2**31)))


def _page(file: Path, source: random.Random) -> None:
    """Replace a page by zeros, random bytes or another page."""
    data = bytearray(file.read_bytes())
    size = int.from_bytes(data[16:18], "big") or 4096
    first, other = (source.randrange(max(1, len(data) // size)) * size for _ in range(2))
    page = source.choice((bytes(size), source.randbytes(size), bytes(data[other : other + size])))
    data[first : first + size] = page
    file.write_bytes(data)


def _row(file: Path, source: random.Random) -> None:
    """Change a cell, a row or a table; changes that SQLite refuses are ignored."""
    with suppress(sqlite3.Error), closing(sqlite3.connect(file)) as connection, connection:
        tables = [
            name
            for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        ]
        if not tables:
            return
        table = source.choice(tables)
        column = source.choice(
            [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
        )
        count = connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
        value, offset = source.choice(_VALUES), source.randrange(max(1, count))
        chosen = f"{column} IN (SELECT {column} FROM {table} LIMIT 1 OFFSET {offset})"
        statement, values = source.choice(
            (
                (f"UPDATE {table} SET {column} = ? WHERE {chosen}", (value,)),
                (f"UPDATE {table} SET {column} = ?", (value,)),
                (f"UPDATE {table} SET {column} = {column} * 1.0000001 WHERE {chosen}", ()),
                (f"DELETE FROM {table} WHERE {chosen}", ()),
                (f"DELETE FROM {table}", ()),
                (f"DROP TABLE {table}", ()),
                (f"ALTER TABLE {table} ADD COLUMN more", ()),
                (f"INSERT INTO {table} SELECT * FROM {table} LIMIT 1", ()),
            )
        )
        connection.execute(statement, values)


def _additional_file(file: Path, source: random.Random) -> None:
    """Write a file that a killed process or a copy may leave next to a store."""
    end = source.choice(("-wal", "-shm", "-journal"))
    content = source.choice(
        (b"", source.randbytes(600), file.read_bytes()[:5000], b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7")
    )
    file.with_name(file.name + end).write_bytes(content)


def _emptied(file: Path, source: random.Random) -> None:
    file.write_bytes(
        source.choice((b"", b"SQLite format 3\0", b"hello\n" * 100, source.randbytes(8192)))
    )


DAMAGES: tuple[Callable[[Path, random.Random], None], ...] = (
    _bytes, _bytes, _page, _row, _row, _row, _additional_file, _emptied,
)  # fmt: skip
