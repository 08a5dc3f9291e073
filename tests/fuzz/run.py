"""Mutate hundreds of thousands of records, models, studies, command lines and calls, and count their
outcomes.

    python tests/fuzz/run.py [--of records|models|changes|studies|stores|names|commands|characters|api] [--cases 100000] [--seed 0]
                             [--jobs 2] [--name MSEED]
    python tests/fuzz/run.py --bits                # every single bit of the headers of MiniSEED and SAC

Each case has a name and a seed. A failure is printed with both, so that `--of KIND --name NAME
--only SEED` repeats it. A case that crashes its process or does not return is also a failure.
"""  # noqa: E501

import argparse
import logging
import os
import resource
import signal
import sys
import warnings
from collections import Counter, defaultdict, deque
from functools import partial
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.corpus import corpus
from fuzz.kinds import KINDS
from fuzz.oracle import LONGEST, OUTCOMES, Failure, outcome, read
from fuzz.sandbox import sandbox
from tdint_cli.processes import _Worker

FAILED = "FAILED"
_BATCH = 250
_MEMORY = 6 * 2**30

Case = tuple[str, int]


def batches(names: list[str], count: int, seed: int) -> list[list[Case]]:
    """Return batches of names and seeds; a name that is listed twice gets twice as many seeds."""
    share = Counter(names)
    each = -(-count // len(names))
    cases = [(name, seed + i) for name in share for i in range(share[name] * each)]
    return [cases[start : start + _BATCH] for start in range(0, len(cases), _BATCH)]


def run_batch(input_type: str, batch: list[Case]) -> list[tuple[str, int, str, str]]:
    """Return the outcome of each case and the reason of each failure."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    logging.getLogger("tdint").setLevel(logging.CRITICAL)
    signal.signal(signal.SIGPROF, _too_long)
    found = []
    with sandbox(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, seed in batch:
            signal.setitimer(
                signal.ITIMER_PROF, LONGEST
            )  # processor time, because other processes or compilation may delay a case
            try:
                found.append((name, seed, KINDS[input_type].outcome(name, seed), ""))
            except Failure as failure:
                found.append((name, seed, FAILED, str(failure)))
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
    return found


def _too_long(*_: object) -> None:
    raise Failure(f"took over {LONGEST:.0f} s of the processor")


def all_outcomes(
    input_type: str, names: list[str], count: int, seed: int, jobs: int
) -> tuple[dict[str, Counter[str]], list[str]]:
    """Return the counts of outcomes by name and a line for every failure."""
    table: dict[str, Counter[str]] = defaultdict(Counter)
    failures: list[str] = []
    waiting = deque(batches(names, count, seed))
    running: dict[Any, tuple[_Worker, list[Case]]] = {}
    while waiting or running:
        while waiting and len(running) < jobs:
            # Each batch has its own process, which is lost without stopping the others.
            batch, process = waiting.popleft(), _Worker()
            process.begin(partial(run_batch, input_type), batch)
            running[process.pipe] = process, batch
        for pipe in wait(list(running), timeout=_BATCH * 4.0) or [next(iter(running))]:
            process, batch = running.pop(pipe)
            with process:
                found, error = (pipe.poll() and process.outcome()) or (None, "the process ended")
            if found is None:
                failures.append(f"{batch[0]} to {batch[-1]}: {error!r}")
                table[batch[0][0]][FAILED] += 1
                continue
            for name, number, meaning, reason in found:
                table[name][meaning] += 1
                if reason:
                    failures.append(f"{name}: seed {number}: {reason}")
                    print(failures[-1][:300], file=sys.stderr, flush=True)
    return table, failures


def print_table(table: dict[str, Counter[str]], outcomes: tuple[str, ...] = OUTCOMES) -> None:
    columns = (*outcomes, FAILED)
    print("| of | cases | " + " | ".join(columns) + " |")
    print("|---|" + "---:|" * (len(columns) + 1))
    total: Counter[str] = Counter()
    together: dict[str, Counter[str]] = defaultdict(Counter)
    for name, counter in table.items():
        together[name.lstrip("0123456789 ")] += counter
        total += counter
    for name, counter in [*sorted(together.items()), ("all", total)]:
        print(
            f"| {name} | {sum(counter.values())} | "
            + " | ".join(str(counter[column]) for column in columns)
            + " |"
        )


def flipped_bits(name: str, length: int) -> tuple[dict[int, Counter[str]], list[str]]:
    """Return the outcomes of every single-bit flip of the first bytes of a file, by byte."""
    sound = next(candidate for candidate in corpus() if candidate.name == name)
    before = read(sound.data, sound.units)
    table: dict[int, Counter[str]] = defaultdict(Counter)
    failures = []
    for position in range(length):
        for bit in range(8):
            data = bytearray(sound.data)
            data[position] ^= 1 << bit
            try:
                table[position][outcome(sound, before, bytes(data))] += 1
            except Failure as failure:
                table[position][FAILED] += 1
                failures.append(f"{name}: byte {position}, bit {bit}: {failure}")
    return table, failures


BITS = {"MSEED FLOAT64": 64, "MSEED STEIM2": 64, "SAC": 632}
"""Headers whose every bit is tried, and their lengths."""


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--of", choices=KINDS, default="records")
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--name", default="")
    parser.add_argument("--only", type=int)
    parser.add_argument("--bits", action="store_true")
    arguments = parser.parse_args()
    logging.getLogger("tdint").setLevel(logging.CRITICAL)
    # A process tries many commands: it must not use the uncompiled loops of a first short run.
    os.environ["TDINT_COMPILE"] = "wait"
    failures: list[str] = []
    if arguments.bits:
        for name, length in BITS.items():
            table, found = flipped_bits(name, length)
            failures += found
            print(name)
            print_table({f"byte {position:3d}": counter for position, counter in table.items()})
    else:
        names = [name for name in KINDS[arguments.of].names() if arguments.name in name]
        if arguments.only is not None:
            print(
                *(
                    row
                    for name in dict.fromkeys(names)
                    for row in run_batch(arguments.of, [(name, arguments.only)])
                ),
                sep="\n",
            )
        else:
            counts, failures = all_outcomes(
                arguments.of, names, arguments.cases, arguments.seed, arguments.jobs
            )
            print_table(counts, KINDS[arguments.of].outcomes)
    for line in failures:
        print(line[:300])
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
