"""Attacks on the shards of a campaign from a seed: inputs change between the shards, or a finished
shard is corrupted, exchanged or missing.

Either a shard or `campaign merge` refuses, or the merged tables have the bytes of the campaign that
is computed without shards.
"""

import functools
import random
import shutil
import tempfile
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path

from fuzz.oracle import Failure
from fuzz.sandbox import invoked

OUTCOMES = REFUSED, EQUAL = "refused", "equal to the campaign at once"

_CAMPAIGN = "map.yaml"
_TABLES = ("runs.csv", "stories.csv")


def _change_cell(source: random.Random) -> None:
    """Change a number in a row of the inventory."""
    file = Path("town.csv")
    old, new = source.choice((("1931", "1985"), (",3,", ",4,"), ("4500", "4600"), ("0.07", "0.08")))
    file.write_text(file.read_text().replace(old, new, 1))


def _change_rows(source: random.Random) -> None:
    """Remove, repeat, rename or reorder rows of the inventory."""
    head, *rows = Path("town.csv").read_text().splitlines()
    match source.randrange(5):
        case 0:
            rows.pop(source.randrange(len(rows)))
        case 1:
            rows.append(source.choice(rows))
        case 2:
            rows.reverse()
        case 3:
            rows.append(f"mill{rows[0]}")
        case _:
            number = source.randrange(len(rows))
            rows[number] = f"x{rows[number]}"
    Path("town.csv").write_text("\n".join([head, *rows]) + "\n")


def _change_motion(source: random.Random) -> None:
    """Change a sample of a ground motion, or its factor."""
    name, old, new = source.choice(
        (("single.json", "0.5", "0.6"), ("pair.json", "0.3", "0.31"), ("here.csv", "1.0", "1.1"))
    )
    file = Path(name)
    text = file.read_text()
    file.write_text(text.replace(old, new, 1) if old in text else text.replace("0.", "0.9", 1))


def _change_campaign(source: random.Random) -> None:
    """Change the seed, the method or the scatter of the campaign file."""
    old, new = source.choice(
        (("seed: 3", "seed: 4"), ("newmark-average", "impulse4"), ("0.2,", "0.3,"))
    )
    file = Path(_CAMPAIGN)
    file.write_text(file.read_text().replace(old, new, 1))


BETWEEN = {
    "cell of the inventory": _change_cell,
    "rows of the inventory": _change_rows,
    "ground motion": _change_motion,
    "campaign file": _change_campaign,
}
"""Changes of inputs between the first and the second shard."""


def _flip(source: random.Random) -> None:
    file = Path(source.choice(("one", "two"))) / "campaign.sqlite"
    data = bytearray(file.read_bytes())
    data[source.randrange(len(data))] ^= 1 << source.randrange(8)
    file.write_bytes(bytes(data))


def _truncate(source: random.Random) -> None:
    file = Path(source.choice(("one", "two"))) / "campaign.sqlite"
    data = file.read_bytes()
    file.write_bytes(data[: source.choice((0, 100, len(data) // 2, len(data) - 1))])


def _same_shard_twice(source: random.Random) -> None:
    first, second = source.sample(("one", "two"), 2)
    shutil.rmtree(second)
    shutil.copytree(first, second)


def _no_store(source: random.Random) -> None:
    (Path(source.choice(("one", "two"))) / "campaign.sqlite").unlink()


def _other_division(source: random.Random) -> None:
    """Replace the division of one shard: a third instead of a half."""
    name = source.choice(("one", "two"))
    shutil.rmtree(name)
    _run("campaign", _CAMPAIGN, "-o", name, "--shard", source.choice(("1/3", "2/3", "3/3")))


def _changed_table(source: random.Random) -> None:
    """Change the table of a shard, which `merge` does not read because it uses the stores."""
    file = Path(source.choice(("one", "two"))) / "runs.csv"
    if file.exists():
        file.write_bytes(file.read_bytes().replace(b"done", b"gone", 1))


AFTER = {
    "flipped bit": _flip, "truncated store": _truncate,
    "same shard twice": _same_shard_twice, "store missing": _no_store,
    "other division": _other_division, "changed table": _changed_table,
}  # fmt: skip
"""Damages of the finished shards."""


def names() -> list[str]:
    """Return the names of the attacks."""
    return [*BETWEEN, *AFTER]


def _run(*arguments: str) -> None:
    """Run a command that must succeed."""
    code, messages = invoked(arguments)
    if code:
        raise Failure(f"{' '.join(arguments)}: exit code {code}: {messages[-300:]!r}")


def _extend_inventory() -> None:
    """Repeat the buildings of the inventory under other names, so that both shards have some."""
    head, *rows = Path("town.csv").read_text().splitlines()
    if len(rows) < _BUILDINGS:
        named = [f"n{i}-{rows[i % len(rows)]}" for i in range(_BUILDINGS)]
        Path("town.csv").write_text("\n".join([head, *named]) + "\n")


_BUILDINGS = 30
"""Number of buildings; each of both shards then has several."""


@functools.cache
def _tables_at_once() -> dict[str, bytes]:
    """Return the tables of the campaign that is computed without shards."""
    shutil.rmtree("whole", ignore_errors=True)
    _run("campaign", _CAMPAIGN, "-o", "whole")
    tables = {name: (Path("whole") / name).read_bytes() for name in _TABLES}
    shutil.rmtree("whole")
    return tables


def outcome(name: str, seed: int) -> str:
    """Attack the shards within a sandbox; raise Failure if a wrong campaign is merged."""
    source = random.Random(f"{name} {seed}")
    _extend_inventory()
    expected = _tables_at_once()
    folder = Path(tempfile.mkdtemp(prefix=".shards-", dir=Path.cwd()))
    try:
        for entry in Path.cwd().iterdir():
            if entry.is_file():
                shutil.copy2(entry, folder / entry.name)
        with chdir(folder):
            return _attack(name, source, expected)
    finally:
        shutil.rmtree(folder)


def _attack(name: str, source: random.Random, expected: dict[str, bytes]) -> str:
    """Compute two shards with an attack, merge them, and compare the tables."""
    change: Callable[[random.Random], None] | None = BETWEEN.get(name)
    _run("campaign", _CAMPAIGN, "-o", "one", "--shard", "1/2")
    if change:
        change(source)
    code, messages = invoked(("campaign", _CAMPAIGN, "-o", "two", "--shard", "2/2"))
    if "Traceback" in messages or "internal error" in messages:
        raise Failure(f"{name}: {messages[-300:]!r}")
    if not change:
        AFTER[name](source)
    # A shard that was refused must not be merged either.
    refused = code != 0
    code, messages = invoked(("campaign", "merge", "one", "two", "-o", "out-of-both"))
    if "Traceback" in messages or "internal error" in messages:
        raise Failure(f"{name}: {messages[-300:]!r}")
    if code:
        return REFUSED
    if refused:
        raise Failure(f"{name}: a refused shard was merged")
    merged = {table: (Path("out-of-both") / table).read_bytes() for table in _TABLES}
    if merged != expected:
        raise Failure(
            f"{name}: merged with exit code 0, and the tables differ: {messages[-300:]!r}"
        )
    return EQUAL
