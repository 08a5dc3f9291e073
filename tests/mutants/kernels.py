"""Mutants of the compiled kernels: does a test fail if one operator or number is changed?

    python tests/mutants/kernels.py [--seed N] [--count N] [--journal FILE] [--hours H]
        [--only TEXT] [--interpreted]

A sample of all operators and numbers in the kernel modules is changed, one at a time, in a copy of
the package (`mutant` of tests/benchmarks/mutants.py). Each mutant is tried in two stages:

1. The tests of the kernels run with TDINT_KERNELS=python. The loops are then Python functions, and
   no mutant has to be compiled.
2. For a mutant that survives, the loops are compiled into a cache of its own, and the tests of the
   methods run.

The journal has one JSON line per mutant (module, line, old and new source line, result, test that
failed, seconds). A second call with the same journal continues after its last line. At the end the
script prints the table of the survivors.

First result (2026-11-24, seed 1, --interpreted): the first stage killed 19 of the first 33 mutants.
The second stage and the other 167 mutants have not been run, and the survivors have not been
examined.
"""

import argparse
import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "benchmarks"))
from mutants import mutant, places  # noqa: E402

KERNELS = ROOT / "src" / "tdint" / "kernels"
MODULES = (
    *("peaks_between_steps.py", "linear_terms.py", "equations/*.py", "laws/[a-z]*.py"),
    *("oscillators/*.py", "stories/*.py", "time_loop/*.py"),
)
"""Modules with the loops. `building` and `compiling.py` contain no loops."""

FIRST = {
    "peaks_between_steps": ["tests/kernels/test_peaks_between_steps.py"],
    "equations/tridiagonal": ["tests/kernels/test_tridiagonal.py"],
    "laws/bouc_wen": ["tests/kernels/test_bouc_wen.py"],
    "laws/multilinear_pinching": ["tests/kernels/test_multilinear_pinching.py"],
    "stories/path": ["tests/kernels/test_path.py"],
    "stories/branches": ["tests/kernels/test_branches.py"],
    "time_loop/observer": ["tests/kernels/test_peaks_between_steps.py"],
}
"""Tests of a module, which run before the other tests of the kernels."""

INTERPRETED = [
    "tests/kernels/test_parts_of_a_step.py",
    "tests/kernels/test_path.py",
    "tests/kernels/test_branches.py",
    "tests/kernels/test_tridiagonal.py",
    "tests/kernels/test_peaks_between_steps.py",
    "tests/kernels/test_softening_and_pinching.py",
    "tests/kernels/test_multilinear_pinching.py",
    "tests/kernels/test_bouc_wen.py",
]
COMPILED = [
    "tests/methods/test_impulse4.py",
    "tests/methods/test_moment4.py",
    "tests/methods/test_peaks.py",
    "tests/methods/test_power_dashpots.py",
    "tests/methods/test_long_steps.py",
    "tests/methods/test_softening_and_pinching_buildings.py",
    "tests/methods/test_every_method.py",
    "tests/analysis/spectra",
]
SECONDS = {"interpreted": 600.0, "compiled": 2400.0}
"""Time limits of the stages, s. A mutant that loops forever is counted as killed."""


def modules() -> list[Path]:
    """Return the modules with loops."""
    return sorted({file for pattern in MODULES for file in KERNELS.glob(pattern)})


def candidates() -> list[tuple[Path, int]]:
    """Return all operators and numbers that can be changed, with their modules."""
    return [(module, place) for module in modules() for place in places(module.read_text("utf-8"))]


def changed_line(module: Path, text: str) -> tuple[str, str]:
    """Return the line that a mutant changes, before and after the change."""
    before = ast.unparse(ast.parse(module.read_text("utf-8"))).splitlines()
    for old, new in zip(before, text.splitlines(), strict=True):
        if old != new:
            return old.strip(), new.strip()
    return "", ""


def stage(package: Path, tests: list[str], interpreted: bool) -> tuple[bool, str]:
    """Run tests with a changed package.

    Returns
    -------
    bool, str
        True if a test failed, and its name.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": str(package),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "TDINT_CACHE_DIR": str(package / "cache"),
        "TDINT_COMPILE": "wait",
    }
    environment.pop("TDINT_KERNELS", None)
    environment.pop("TDINT_KERNELS_DIR", None)
    if interpreted:
        environment["TDINT_KERNELS"] = "python"
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    limit = SECONDS["interpreted" if interpreted else "compiled"]
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=limit
        )
    except subprocess.TimeoutExpired:
        return True, "time limit"
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return done.returncode != 0, failed.group(1) if failed else ""


def tried(module: Path, place: int, compiled: bool) -> dict[str, object]:
    """Try a mutant and return its line of the journal."""
    began = time.monotonic()
    line, text = mutant(module.read_text("utf-8"), place)
    old, new = changed_line(module, text)
    name = module.relative_to(KERNELS).with_suffix("").as_posix()
    first = FIRST.get(name, [])
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder)
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "src" / "tdint", package / "tdint", ignore=ignored)
        (package / "tdint" / module.relative_to(ROOT / "src" / "tdint")).write_text(text, "utf-8")
        others = [test for test in INTERPRETED if test not in first]
        killed, by = stage(package, [*first, *others], interpreted=True)
        if not killed and compiled:
            killed, by = stage(package, COMPILED, interpreted=False)
    return {
        "module": name,
        "place": place,
        "line": line,
        "old": old,
        "new": new,
        "killed": killed,
        "by": by,
        "compiled": compiled,
        "seconds": round(time.monotonic() - began, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--journal", type=Path, default=Path("mutants.jsonl"))
    parser.add_argument("--hours", type=float, default=5.0, help="start no mutant after this time")
    parser.add_argument("--only", default="", help="part of the name of the modules")
    parser.add_argument(
        "--interpreted", action="store_true", help="omit the second stage, which compiles"
    )
    given = parser.parse_args()
    end = time.monotonic() + 3600.0 * given.hours
    every = [one for one in candidates() if given.only in one[0].as_posix()]
    chosen = random.Random(given.seed).sample(every, min(given.count, len(every)))
    lines = given.journal.read_text("utf-8").splitlines() if given.journal.exists() else []
    done = [json.loads(line) for line in lines]
    known = {(row["module"], row["place"]) for row in done}
    for module, place in chosen:
        name = module.relative_to(KERNELS).with_suffix("").as_posix()
        if (name, place) in known or time.monotonic() > end:
            continue
        row = tried(module, place, not given.interpreted)
        done.append(row)
        with given.journal.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(f"{'killed' if row['killed'] else 'survives'}: {name}:{row['line']}", flush=True)
    survivors = [row for row in done if not row["killed"]]
    print("| module | line | source | mutant |\n|---|---|---|---|")
    for row in survivors:
        print(f"| {row['module']} | {row['line']} | `{row['old']}` | `{row['new']}` |")
    print(f"{len(done) - len(survivors)} of {len(done)} killed")


if __name__ == "__main__":
    main()
