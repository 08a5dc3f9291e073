"""Damage files of every format by the hundred thousand, and count what becomes of them.

    python tests/fuzz/run.py --cases 100000 [--seed 0] [--jobs 2] [--format MSEED]
    python tests/fuzz/run.py --bits                # every single bit of the headers of MiniSEED and SAC

Each case is a sound file and a seed; a failure is printed with both, so that `--format NAME --only SEED` repeats it. A
case that ends its process (a crash) or does not come back is a failure, too.
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import resource
import signal
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.corpus import Sound, corpus
from fuzz.mutators import mutated
from fuzz.oracle import LONGEST, OUTCOMES, Failure, outcome, read

FAILED = "FAILED"
_BATCH = 250
_MEMORY = 6 * 2**30


def cases(sounds: list[Sound], count: int, seed: int) -> Iterator[list[tuple[int, int]]]:
    """Places in the corpus and seeds, in batches of one file each."""
    each = -(-count // len(sounds))
    for place in range(len(sounds)):
        for start in range(0, each, _BATCH):
            yield [(place, seed + start + i) for i in range(min(_BATCH, each - start))]


def run_batch(batch: list[tuple[int, int]]) -> list[tuple[int, int, str, str]]:
    """Outcome and, of a failure, the reason for each case."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    logging.getLogger("tdint").setLevel(logging.CRITICAL)
    signal.signal(signal.SIGALRM, _too_long)
    sound = corpus()[batch[0][0]]
    before = read(sound.data, sound.units)
    found = []
    for place, seed in batch:
        signal.alarm(int(2 * LONGEST))
        try:
            found.append((place, seed, outcome(sound, before, mutated(sound.data, seed)), ""))
        except Failure as failure:
            found.append((place, seed, FAILED, str(failure)))
        finally:
            signal.alarm(0)
    return found


def _too_long(*_: object) -> None:
    raise Failure(f"took over {2 * LONGEST:.0f} s")


def all_outcomes(count: int, seed: int, jobs: int, name: str) -> tuple[dict[str, Counter[str]], list[str]]:
    """Counts of outcomes by format, and a line for every failure."""
    sounds = corpus()
    batches = [batch for batch in cases(sounds, count, seed) if sounds[batch[0][0]].name.startswith(name)]
    table: dict[str, Counter[str]] = defaultdict(Counter)
    failures: list[str] = []
    # A pool forks from a process with threads when it replaces one of its own, which may stand still for ever.
    with multiprocessing.get_context("spawn").Pool(jobs, maxtasksperchild=20) as pool:
        waiting = [(batch, pool.apply_async(run_batch, (batch,))) for batch in batches]
        for batch, result in waiting:
            label = sounds[batch[0][0]].name
            try:
                found = result.get(timeout=_BATCH * 4.0)
            except Exception as error:  # A process that crashed never answers.
                failures.append(f"{label}: seeds {batch[0][1]} to {batch[-1][1]}: {type(error).__name__} {error}")
                table[label][FAILED] += 1
                continue
            for _, number, what, why in found:
                table[label][what] += 1
                if why:
                    failures.append(f"{label} (file {batch[0][0]}), seed {number}: {why}")
    return table, failures


def print_table(table: dict[str, Counter[str]]) -> None:
    columns = (*OUTCOMES, FAILED)
    print("| format | cases | " + " | ".join(columns) + " |")
    print("|---|" + "---:|" * (len(columns) + 1))
    total: Counter[str] = Counter()
    for name, counter in sorted(table.items()):
        total += counter
        print(f"| {name} | {sum(counter.values())} | " + " | ".join(str(counter[column]) for column in columns) + " |")
    print(f"| all | {sum(total.values())} | " + " | ".join(str(total[column]) for column in columns) + " |")


def flipped_bits(name: str, length: int) -> tuple[dict[int, Counter[str]], list[str]]:
    """Outcomes of every single-bit flip of the first bytes of a file, by byte."""
    sound = next(one for one in corpus() if one.name == name)
    before = read(sound.data, sound.units)
    table: dict[int, Counter[str]] = defaultdict(Counter)
    failures = []
    for place in range(length):
        for bit in range(8):
            data = bytearray(sound.data)
            data[place] ^= 1 << bit
            try:
                table[place][outcome(sound, before, bytes(data))] += 1
            except Failure as failure:
                table[place][FAILED] += 1
                failures.append(f"{name}: byte {place}, bit {bit}: {failure}")
    return table, failures


BITS = {"MSEED FLOAT64": 64, "MSEED STEIM2": 64, "SAC": 632}
"""Headers whose every bit is tried, and their lengths."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--format", default="")
    parser.add_argument("--only", type=int)
    parser.add_argument("--bits", action="store_true")
    given = parser.parse_args()
    logging.getLogger("tdint").setLevel(logging.CRITICAL)
    failures: list[str] = []
    if given.only is not None:
        for sound in (one for one in corpus() if one.name.startswith(given.format)):
            data = mutated(sound.data, given.only)
            Path("fuzzed").write_bytes(data)
            print(sound.name, outcome(sound, read(sound.data, sound.units), data))
    elif given.bits:
        for name, length in BITS.items():
            table, found = flipped_bits(name, length)
            failures += found
            print(name)
            print_table({f"byte {place:3d}": counter for place, counter in table.items()})
    else:
        counts, failures = all_outcomes(given.cases, given.seed, given.jobs, given.format)
        print_table(counts)
    for line in failures:
        print(line[:300])
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
