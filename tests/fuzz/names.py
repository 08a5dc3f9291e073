"""File names from a seed: for new models, which must be valid, for tables and for missing files;
and runs of many steps with limited memory."""

import random
import tracemalloc
from pathlib import Path

from fuzz.oracle import Failure
from fuzz.sandbox import OUTPUT, invoked, run

_PARTS = (
    *(
        "a",
        "model",
        ".",
        "..",
        " ",
        "-",
        "--dt",
        "=cmd()",
        "@",
        "%s",
        "'",
        '"',
        "$x",
        "*",
        "?",
        "~",
        "#",
        ":",
        "\\",
    ),
    *(
        "\n",
        "\r",
        "\t",
        "\x1b[31m",
        "\x7f",
        "\x85",
        "\u2028",
        "\u202e",
        "\u00e9",
        "\U0001f3db",
        "\udce9",
        "\udcff",
    ),
    "x" * 300,
)
_ENDS = (".yaml", ".yml", ".csv", ".csv.gz", ".txt", "")
CALLS = ("init", "modes", "check", "run")

MOST_MEMORY = 8e7
"""Bytes that a run may take beside what is there before."""


def names() -> list[str]:
    """Return the commands that are called with unusual names, and `memory` for runs of many
    steps."""
    return [*CALLS, "memory"]


def outcome(name: str, seed: int) -> str:
    """Return the outcome of a call within a sandbox; raise Failure for forbidden behavior."""
    source = random.Random(f"{name} {seed}")
    if name == "memory":
        return _memory(source)
    file = f"{OUTPUT}/{_file(source)}"
    if name == "modes":
        return run(["modes", "linear.yaml", "-o", file])
    if name == "run":
        return run(["run", "linear.yaml", f"--history={file}"])
    found = run([name, file])
    if (name, found) == ("init", "done"):
        code, messages = invoked(["check", file])
        if code:
            raise Failure(f"a model that was begun as {file!r} is none: {messages[:200]!r}")
    return found


def _file(source: random.Random) -> str:
    parts = "".join(source.choice(_PARTS) for _ in range(source.choice((1, 1, 2, 3))))
    return f"{parts.replace('/', '')}{source.choice(_ENDS)}"


def _memory(source: random.Random) -> str:
    """Run up to 10^6 steps and write about a hundred rows; raise Failure if the memory grows."""
    steps = round(10.0 ** source.uniform(4.0, 6.0))
    every = max(1, steps // source.choice((10, 100, 300)))
    line = [
        "run",
        "linear.yaml",
        "--dt",
        f"{1e-2 / -(-steps // 30):.12g}",
        f"--history={OUTPUT}/h.csv",
    ]
    tracemalloc.start()
    try:
        found = run([*line, "--history-every", str(every)])
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    if peak > MOST_MEMORY:
        raise Failure(f"{steps} steps, every {every}: {peak / 1e6:.0f} MB")
    if found != "done" or not Path(OUTPUT, "h.csv").exists():
        raise Failure(f"a run of {steps} steps ends with {found}")
    return found
