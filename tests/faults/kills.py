"""A campaign of many runs in shards that are killed at random times and continued; the shards are
then merged from directories without write permission.

    python tests/faults/kills.py [--runs 20000] [--kills 100] [--shards 2] [--seed 0]

The merged tables must have the bytes of the campaign that is run without interruption. After each
kill, the store must be valid and must not have fewer runs than before.
"""

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from cli.read_only import read_only
from fuzz.sandbox import invoked
from tdint.errors import UsageError
from tdint.studies.store.opening import check_chunks, open_existing

RECORDS = 20
MODEL = """\
name: small
stories: [{repeat: 2, mass: 10000, height: 3, stiffness: 8000000}]
damping: {rayleigh: {ratio: 5%, modes: [1, 2]}}
excitation: {record: {file: r0.csv, units: m/s^2}}
analysis: {method: newmark-average, duration: 2}
"""
TABLES = ("runs.csv", "stories.csv", "profiles.csv")


def write_study(runs: int) -> None:
    """Write a campaign of one building with this number of runs, a multiple of `RECORDS`."""
    source = random.Random(1)
    Path("model.yaml").write_text(MODEL)
    for number in range(RECORDS):
        samples = "\n".join(f"{source.gauss(0.0, 1.0):.6f}" for _ in range(200))
        Path(f"r{number}.csv").write_text(f"# dt = 0.01 s, units = m/s^2\n{samples}\n")
    scales = ", ".join(f"{0.001 * (i + 1):.3f}" for i in range(runs // RECORDS))
    records = ", ".join(f"r{number}.csv" for number in range(RECORDS))
    Path("study.yaml").write_text(
        "buildings: {models: [model.yaml]}\n"
        f"records: {{files: [{records}]}}\n"
        f"intensity: {{scales: [{scales}]}}\n"
        "analysis: {method: newmark-average, dt: 0.0002}\noutputs: {stories: true}\n"
    )


def tdint(line: str) -> int:
    """Run a command in this process and return its exit code; errors are printed."""
    code, messages = invoked(["-q", *line.split()])
    if code:
        print(f"{line}: exit code {code}: {messages[-500:]}", file=sys.stderr)
    return code


def forked(line: str) -> int:
    """Start a command in a forked process, which has imported all modules; return its number."""
    child = os.fork()
    if child == 0:
        os._exit(tdint(line))
    return child


def runs_in(folder: Path) -> int:
    """Return the number of runs in a valid store, 0 if the campaign has not started."""
    try:
        with open_existing(folder) as store:
            check_chunks(store)
            return sum(store.statuses().values())
    except UsageError:
        return 0


def kill_and_continue(
    line: str, folder: Path, kills: int, runs: int, source: random.Random
) -> list[int]:
    """Kill and continue a campaign of about `runs` runs; return the number of new runs before each
    kill. A campaign that is completed before the last kill is started again.

    The mean time before a kill is adapted, so that a call adds runs, but leaves runs for the
    remaining kills.
    """
    added: list[int] = []
    longest, stored = 0.5, 0  # s
    while len(added) < kills:
        child = forked(line)
        time.sleep(source.uniform(0.0, longest))
        if (ended := os.waitpid(child, os.WNOHANG)) != (0, 0):
            assert ended[1] == 0, f"{line}: status {ended[1]}"
            shutil.rmtree(folder)
            longest, stored = 0.5 * longest, 0
            continue
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        before, stored = stored, runs_in(folder)
        assert stored >= before, f"{before - stored} runs are lost"
        added.append(stored - before)
        longest *= 1.2 if added[-1] <= (runs - stored) / (kills - len(added) + 1) else 0.8
    _, status = os.waitpid(forked(line), 0)
    assert status == 0, f"{line}: status {status}"
    return added


def campaign(runs: int, kills: int, shards: int, seed: int) -> dict[str, int]:
    """Run the campaign in the working directory, and return counts; raise AssertionError if a run
    is lost or the tables differ."""
    source = random.Random(seed)
    write_study(runs)
    assert tdint("campaign study.yaml -o whole --jobs 1") == 0
    added: list[int] = []
    for number in range(1, shards + 1):
        folder = Path(f"shard-{number}")
        line = f"campaign study.yaml -o {folder} --jobs 1 --shard {number}/{shards}"
        added += kill_and_continue(line, folder, kills // shards, runs // shards, source)
        left = [path.name for path in folder.iterdir() if path.suffix == ".tmp" or "-" in path.name]
        assert not left, f"left behind: {left}"
    folders = [Path(f"shard-{number}") for number in range(1, shards + 1)]
    with ExitStack() as stack:
        for folder in folders:
            stack.enter_context(read_only(folder))
            assert tdint(f"campaign status {folder}") == 0
        assert tdint(f"campaign merge {' '.join(map(str, folders))} -o merged") == 0
    for name in TABLES:
        assert Path("merged", name).read_bytes() == Path("whole", name).read_bytes(), name
    return {
        "runs": runs_in(Path("merged")),
        "kills": len(added),
        "kills with new runs": sum(map(bool, added)),
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=20_000)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--shards", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    os.environ["TDINT_COMPILE"] = "wait"
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        began = time.monotonic()
        counts = campaign(**vars(arguments))
        os.chdir("/")
    print(", ".join(f"{name}: {count}" for name, count in counts.items()), end="; ")
    print(f"{time.monotonic() - began:.0f} s; tables equal to the uninterrupted campaign")
    return 0


if __name__ == "__main__":
    sys.exit(main())
