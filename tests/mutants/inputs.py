"""Mutants of what a user specifies: options of commands, keys of files, arguments of functions.

`python tests/mutants/inputs.py options` (or `keys`, `arguments`, or several of them) runs the tests
once, and records what each test specifies. It then tries two mutants of each option, key or
argument, in copies of this process: the program receives the default in place of the value
(`ignored`), and another option, key or argument of the same type receives the value (`as NAME`).
The tests that specify it run until one fails. The report names the mutants that no test notices,
and what no test specifies. `--only scale` restricts the names, `--seconds S` the time of the tests
of each mutant.
"""

import argparse
import gc
import os
import re
import resource
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from mutants.first_stage import Session, in_copy, result_of  # noqa: E402
from mutants.places import Mutant, Place  # noqa: E402

COMMANDS = ("tests/cli", "tests/studies", "tests/faults", "tests/documentation/test_examples.py")
PACKAGE = (
    "tests/response",
    "tests/model",
    "tests/methods",
    "tests/ground_motion",
    "tests/output",
    "tests/test_python_calls.py",
    "tests/test_one_or_several.py",
)
TESTS = {"options": COMMANDS, "keys": COMMANDS + PACKAGE, "arguments": COMMANDS + PACKAGE}
"""Tests that specify options, keys and arguments."""

CPU_SECONDS = 20.0
"""Time limit of the tests of a mutant, in addition to three times their time with unchanged
programs, s of processor time. A mutant that exceeds it is noticed."""


class Inputs(Protocol):
    """Patch of the program that records what is specified, and applies one mutant.

    Attributes
    ----------
    specified : set of tuple of str
        Specified options, keys or arguments since the last `clear`.
    mutant : Mutant or None
        Mutant that is applied.
    """

    specified: set[Place]
    mutant: Mutant | None

    def mutants(self) -> Iterator[Mutant]:
        """Yield the mutants of all declared options, keys or arguments."""


@dataclass
class Measured:
    """Test with the unchanged program: time, s, and what it specifies."""

    seconds: float
    specified: set[Place]

    @property
    def rank(self) -> float:
        """Order of the tests: fast tests first that specify few other things."""
        return self.seconds * (3 + len(self.specified))


def measure(session: Session, inputs: list[Inputs]) -> dict[str, Measured]:
    """Run all tests, and return those that pass."""
    measured = {}
    began = time.monotonic()
    for name, failed in session.run(list(session.items)):
        specified = set[Place]().union(*(each.specified for each in inputs))
        if failed:
            print(f"fails with the unchanged program, not used: {name}", flush=True)
        elif specified:
            measured[name] = Measured(time.monotonic() - began, specified)
        for each in inputs:
            each.specified.clear()
        began = time.monotonic()
    return measured


def tests_of(mutant: Mutant, measured: dict[str, Measured], seconds: float) -> list[str]:
    """Return the tests that specify what the mutant changes, the first of them within a time."""
    found, total = list[str](), 0.0
    tests = (name for name, test in measured.items() if mutant.place in test.specified)
    for name in sorted(tests, key=lambda name: measured[name].rank):
        total += measured[name].seconds
        if found and total > seconds:
            break
        found.append(name)
    return found


def noticed_before(reports: list[str]) -> dict[str, str]:
    """Return the mutants that earlier reports name, with the test that noticed each."""
    lines = (line for report in reports for line in Path(report).read_text("utf-8").splitlines())
    found = (re.match(r"(.+: .+): (tests/.*|None|interrupted)$", line) for line in lines)
    return {match[1]: match[2] for match in found if match}


def try_all(session: Session, inputs: list[Inputs], arguments: argparse.Namespace) -> None:
    """Try all mutants, and print the report."""
    measured = measure(session, inputs)
    known, first = noticed_before(arguments.known), noticed_before(arguments.first)
    found, late, survivors, untested = 0, 0, [], []
    gc.freeze()  # a copy would otherwise copy the memory of all objects
    with TemporaryDirectory() as folder:
        mutants = ((each, mutant) for each in inputs for mutant in each.mutants())
        for number, (each, mutant) in enumerate(mutants):
            if not any(part in str(mutant) for part in arguments.only):
                continue
            if str(mutant) in known:
                found += 1
                continue
            names = tests_of(mutant, measured, arguments.seconds)
            if not names:
                untested.append(mutant)
                continue
            if (test := first.get(str(mutant))) in measured:
                names = [test, *(name for name in names if name != test)]

            def work(each: Inputs = each, mutant: Mutant = mutant, names: list[str] = names) -> str:
                limit = int(CPU_SECONDS + 3.0 * sum(measured[name].seconds for name in names))
                used = int(time.process_time())
                resource.setrlimit(resource.RLIMIT_CPU, (used + limit, used + limit))
                signal.alarm(5 * limit)  # ends a test that waits forever
                each.mutant = mutant
                try:
                    return next((name for name, failed in session.run(names) if failed), "")
                except KeyboardInterrupt:  # a test that raises it expects that a function is called
                    return "interrupted"

            output = Path(folder) / f"{number}.json"
            noticed_by = result_of(in_copy(work, output), output)
            if noticed_by == "":
                survivors.append(mutant)
                print(f"\nnot noticed by {len(names)} tests: {mutant}", flush=True)
            else:
                found += 1
                late += noticed_by is None
                if arguments.verbose:
                    print(f"\n{mutant}: {noticed_by}", flush=True)
    places = sorted({mutant.place for mutant in untested})
    for owner, name in places:
        print(f"no test: {owner} {name}")
    tried = found + len(survivors)
    print(f"{tried} mutants tried, {found} noticed ({found / max(tried, 1):.1%})")
    print(f"{late} of these by the time limit")
    print(f"{len(places)} places with {len(untested)} mutants without a test")
    print(f"noticed of all: {found / max(tried + len(untested), 1):.1%}")


def main() -> None:
    """Collect the tests, and try the mutants."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("kinds", nargs="+", choices=list(TESTS))
    parser.add_argument("--only", nargs="+", default=[""], help="parts of names of mutants")
    parser.add_argument("--seconds", type=float, default=20.0, help="time of the tests of a mutant")
    parser.add_argument("--tests", nargs="+", help="files and directories of tests")
    parser.add_argument("--verbose", action="store_true", help="name the test that notices each")
    parser.add_argument("--known", nargs="+", default=[], help="outputs of earlier --verbose runs")
    parser.add_argument(
        "--first", nargs="+", default=[], help="such outputs; their tests run first"
    )
    arguments = parser.parse_args()
    os.environ.update(OPENBLAS_NUM_THREADS="1", TDINT_COMPILE="wait")
    os.chdir(ROOT)
    # The kernels read the settings when they are imported.
    from mutants.arguments import Arguments
    from mutants.keys import FileKeys
    from mutants.options import Options

    kinds = {"options": Options, "keys": FileKeys, "arguments": Arguments}
    inputs: list[Inputs] = [kinds[kind]() for kind in arguments.kinds]
    tests = arguments.tests or dict.fromkeys(
        test for kind in arguments.kinds for test in TESTS[kind]
    )
    session = Session(lambda session: try_all(session, inputs, arguments))
    call = ["-q", "-p", "no:cacheprovider", "-p", "no:faulthandler", *tests]
    sys.exit(int(pytest.main(call, plugins=[session])))


if __name__ == "__main__":
    main()
