"""File names from a seed: for new models, which must be valid, for tables and for missing files;
and runs of many steps with limited memory."""

import random
import tracemalloc
from pathlib import Path

from fuzz.oracle import Failure
from fuzz.sandbox import OUTPUT, STRANGE_NAMES, invoked, run

_PARTS = (
    *(
        "a", "model", ".", "..", " ", "-", "--dt", "=cmd()", "@", "%s", "'", '"', "$x",
        "*", "?", "~", "#", ":", "\\",
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
)  # fmt: skip
_ENDS = (".yaml", ".yml", ".csv", ".csv.gz", ".txt", "")
CALLS = ("init", "modes", "check", "run", "runs", "campaign")

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
    if name == "runs":  # a missing or an existing record, whose name is stored
        record = file if source.random() < 0.5 else source.choice(STRANGE_NAMES)
        return run(["run", "linear.yaml", "a.txt", record, "-o", f"{OUTPUT}/runs"])
    if name == "campaign":
        return _campaign(source)
    if name == "run":
        return run(["run", "linear.yaml", f"--history={file}"])
    found = run([name, file])
    if (name, found) == ("init", "done"):
        code, messages = invoked(["check", file])
        if code:
            raise Failure(f"a model that was begun as {file!r} is none: {messages[:200]!r}")
    return found


_STUDY = """\
buildings: {models: [linear.yaml]}
records: {files: [a.txt]}
intensity: {scales: [1]}
analysis: {method: newmark-average}
"""


def _campaign(source: random.Random) -> str:
    """Run a campaign with an unusual name, directory and figure; the second call is `status`,
    `export` or the same call, and must end in the same way."""
    study = Path(_file(source).partition("\n")[0][:100] + ".yaml")
    folder = f"{OUTPUT}/{_file(source)[:100]}"
    if study.exists() or not study.name:
        return run(["campaign", str(study), "-o", folder])
    study.write_text(_STUDY)
    plot = source.choice(([], [f"--plot={OUTPUT}/{_file(source)[:100]}.svg"]))
    line = ["campaign", f"./{study}", "-o", folder]
    try:
        found = run([*line, *plot])
        if found == "done":
            for second in (["campaign", "status", folder], ["campaign", "export", folder], line):
                code, messages = invoked(second)
                if code:
                    raise Failure(f"{second!r}: {code}: {messages[:300]!r}")
        return found
    finally:
        study.unlink()


def _file(source: random.Random) -> str:
    parts = "".join(source.choice(_PARTS) for _ in range(source.choice((1, 1, 2, 3))))
    return f"{parts.replace('/', '')}{source.choice(_ENDS)}"


def _memory(source: random.Random) -> str:
    """Run up to 10^6 steps and write about a hundred rows; raise Failure if the memory grows."""
    steps = round(10.0 ** source.uniform(4.0, 6.0))
    every = max(1, steps // source.choice((10, 100, 300)))
    line = [
        "run", "linear.yaml", "--dt", f"{1e-2 / -(-steps // 30):.12g}",
        f"--history={OUTPUT}/h.csv",
    ]  # fmt: skip
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
