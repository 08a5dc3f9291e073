"""Mutants of the compiled kernels: does a test fail if one operator or number is changed?

    python tests/mutants/kernels.py [--seed N] [--count N] [--journal FILE] [--kernels DIR]
        [--hours H] [--least PERCENT] [--only TEXT] [--interpreted]

A sample of all operators and numbers in the kernel modules is changed, one at a time, in a copy of
the package (`mutant` of tests/benchmarks/mutants.py). Each mutant is tried in two stages:

1. The tests of the changed module (`INTERPRETED`) run with TDINT_KERNELS=python. The loops are then
   Python functions, and no mutant has to be compiled.
2. For a mutant that survives, the changed loops are compiled, and the tests of the methods run. The
   compiled loops are in a cache of their own: a copy of the directory --kernels, which contains the
   loops of the unchanged sources. The cache of the user is neither read nor changed.

Before the first mutant, all these tests must pass with unchanged sources.

The journal has one JSON line per mutant (module, line, old and new source line, result, test that
failed, seconds, hashes of the module and of the tests). A second call with the same journal
continues after its last line. It tries a mutant again if its module has changed, and a survivor
also if the tests have changed, or if it has been tried in the first stage only.

tests/mutants/survivors.csv contains the reasons of examined survivors. Those with the reason
"equivalent" do not change any result by more than rounding; they are not counted. At the end the
script prints a table of the survivors. Its exit code is 1 if fewer than --least percent of the
other mutants are killed.
"""

import argparse
import ast
import csv
import hashlib
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

_RUNS = "tests/kernels/test_stored_results.py::test_runs_have_the_stored_results"
_SPECTRA = "tests/kernels/test_stored_results.py::test_spectra_have_the_stored_results"
_OSCILLATORS = "tests/kernels/test_oscillators_and_loads.py"
_PARTS = "tests/kernels/test_parts_of_a_step.py"

INTERPRETED = {
    "peaks_between_steps": [_RUNS, "tests/kernels/test_peaks_between_steps.py"],
    "equations/tridiagonal": [_RUNS, "tests/kernels/test_tridiagonal.py"],
    "laws/bouc_wen": [_RUNS, "tests/kernels/test_bouc_wen.py"],
    "laws/multilinear_pinching": [_RUNS, "tests/kernels/test_multilinear_pinching.py"],
    "laws": [_RUNS, "tests/kernels/test_softening_and_pinching.py"],
    "stories/path": [_RUNS, "tests/kernels/test_path.py"],
    "stories/branches": [_RUNS, _OSCILLATORS, "tests/kernels/test_branches.py"],
    "time_loop/observer": [_RUNS, "tests/kernels/test_peaks_between_steps.py"],
    "time_loop/ground": [_RUNS, _SPECTRA, _OSCILLATORS],
    "time_loop/loop": [_RUNS, "tests/methods/test_misdeclared_laws.py"],
    "linear_terms": [_RUNS, _OSCILLATORS],
    "oscillators": [_SPECTRA, _OSCILLATORS],
    "equations": [_RUNS, _PARTS],
    "stories": [_RUNS, _PARTS],
}
"""Tests of the first stage by module or directory, in the order in which they run. The stored
results are first: they detect most mutants in a few seconds."""

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
SECONDS = {"interpreted": 600.0, "compiled": 1800.0}
"""Time limits of the stages, s. A mutant that loops forever is counted as killed."""

REASONS = Path(__file__).with_name("survivors.csv")
"""Examined survivors: module, old and new source line, reason."""
EQUIVALENT = "equivalent"


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


def stage(package: Path, tests: list[str], interpreted: bool, cache: Path) -> tuple[bool, str]:
    """Run tests with a changed package.

    Parameters
    ----------
    package : Path
        Directory that contains the package `tdint`.
    tests : list of str
        Files and directories of tests.
    interpreted : bool
        Do not compile loops.
    cache : Path
        Directory of the compiled loops.

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
        "TDINT_CACHE_DIR": str(cache),
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


def all_interpreted() -> list[str]:
    """Return all tests of the first stage."""
    return sorted({name for names in INTERPRETED.values() for name in names})


def hash_of_tests() -> str:
    """Return a hash of the tests of both stages."""
    hash_value = hashlib.sha256()
    names = (*all_interpreted(), "tests/kernels/stored_results.csv", *COMPILED)
    for name in sorted({name.partition("::")[0] for name in names}):
        path = ROOT / name
        for file in [path] if path.is_file() else sorted(path.rglob("*.py")):
            hash_value.update(file.read_bytes())
    return hash_value.hexdigest()[:12]


def hash_of(module: Path) -> str:
    """Return a hash of the text of a module."""
    return hashlib.sha256(module.read_bytes()).hexdigest()[:12]


def name_of(module: Path) -> str:
    """Return the name of a module in the journal."""
    return module.relative_to(KERNELS).with_suffix("").as_posix()


def require_passing_tests(kernels: Path | None) -> None:
    """Stop the script if a test fails with unchanged sources.

    Parameters
    ----------
    kernels : Path or None
        Directory of the compiled loops of the unchanged sources, which are compiled if necessary;
        None to check only the first stage.
    """
    failed, by = stage(ROOT / "src", all_interpreted(), True, Path(tempfile.gettempdir()))
    if not failed and kernels is not None:
        failed, by = stage(ROOT / "src", COMPILED, False, kernels)
    if failed:
        sys.exit(f"tests must pass with unchanged sources, but one fails: {by or 'no test ran'}")


def tried(module: Path, place: int, kernels: Path | None) -> dict[str, object]:
    """Try a mutant and return its line of the journal.

    Parameters
    ----------
    module : Path
        Module that is changed.
    place : int
        Number of the changed node.
    kernels : Path or None
        Directory of the compiled loops of the unchanged sources; None to omit the second stage.
    """
    began = time.monotonic()
    line, text = mutant(module.read_text("utf-8"), place)
    old, new = changed_line(module, text)
    tests = INTERPRETED.get(name_of(module)) or INTERPRETED[module.parent.name]
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder)
        cache = package / "cache"
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "src" / "tdint", package / "tdint", ignore=ignored)
        (package / "tdint" / module.relative_to(ROOT / "src" / "tdint")).write_text(text, "utf-8")
        killed, by = stage(package, tests, True, cache)
        if not killed and kernels is not None:
            shutil.copytree(kernels, cache, dirs_exist_ok=True)
            killed, by = stage(package, COMPILED, False, cache)
    return {
        "module": name_of(module),
        "place": place,
        "line": line,
        "old": old,
        "new": new,
        "killed": killed,
        "by": by,
        "compiled": kernels is not None,
        "seconds": round(time.monotonic() - began, 1),
        "source": hash_of(module),
        "tests": hash_of_tests(),
    }


def still_valid(row: dict[str, object], module: Path, tests: str, compiled: bool) -> bool:
    """Return True if a mutant of the journal need not be tried again.

    Parameters
    ----------
    row : dict
        Line of the journal.
    module : Path
        Changed module.
    tests : str
        Result of `hash_of_tests`.
    compiled : bool
        The second stage is not omitted.
    """
    if row.get("source") != hash_of(module):
        return False
    return bool(row["killed"]) or (
        row.get("tests") == tests and (bool(row["compiled"]) or not compiled)
    )


def report(rows: list[dict[str, object]], remaining: int, least: float) -> int:
    """Print the table of survivors and return the exit code.

    Parameters
    ----------
    rows : list of dict
        Lines of the journal.
    remaining : int
        Number of mutants that have not been tried.
    least : float
        Smallest allowed percentage of killed mutants.
    """
    with REASONS.open(encoding="utf-8", newline="") as file:
        reasons = {(row["module"], row["old"], row["new"]): row for row in csv.DictReader(file)}
    print("| module | line | source | mutant | reason |\n|---|---|---|---|---|")
    equivalent, survivors = 0, [row for row in rows if not row["killed"]]
    for row in survivors:
        known = reasons.get((str(row["module"]), str(row["old"]), str(row["new"])), {})
        reason = known.get("reason", "not examined")
        equivalent += reason == EQUIVALENT
        explanation = ": ".join(filter(None, (reason, known.get("explanation"))))
        source = f"`{row['old']}` | `{row['new']}`"
        print(f"| {row['module']} | {row['line']} | {source} | {explanation} |")
    killed, counted = len(rows) - len(survivors), len(rows) - equivalent
    percent = 100.0 * killed / counted if counted else 100.0
    print(
        f"{len(rows)} mutants, {remaining} not tried: {killed} killed, {len(survivors)} survived, "
        f"of which {equivalent} are equivalent; {percent:.1f} % of {counted} killed, "
        f"at least {least:g} % required"
    )
    return int(percent < least)


def parsed() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--journal", type=Path, default=Path("mutants.jsonl"))
    parser.add_argument(
        "--kernels", type=Path, default=Path("mutants-kernels"), help="loops of unchanged sources"
    )
    parser.add_argument("--hours", type=float, default=5.0, help="start no mutant after this time")
    parser.add_argument("--least", type=float, default=0.0, help="percentage that must be killed")
    parser.add_argument("--only", default="", help="part of the name of the modules")
    parser.add_argument(
        "--interpreted", action="store_true", help="omit the second stage, which compiles"
    )
    return parser.parse_args()


def main() -> None:
    options = parsed()
    end = time.monotonic() + 3600.0 * options.hours

    # Draw the mutants, and read the results of earlier calls.
    population = [
        (module, place) for module, place in candidates() if options.only in module.as_posix()
    ]
    chosen = random.Random(options.seed).sample(population, min(options.count, len(population)))
    lines = options.journal.read_text("utf-8").splitlines() if options.journal.exists() else []
    journal = {(row["module"], row["place"]): row for row in map(json.loads, lines)}

    # Try the mutants without a valid result.
    kernels = None if options.interpreted else options.kernels.resolve()
    tests, rows, passing = hash_of_tests(), [], False
    for module, place in chosen:
        row = journal.get((name_of(module), place))
        if row is None or not still_valid(row, module, tests, kernels is not None):
            if time.monotonic() > end:
                continue
            if not passing:
                require_passing_tests(kernels)
                passing = True
            row = tried(module, place, kernels)
            with options.journal.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            result = "killed" if row["killed"] else "survives"
            print(f"{result}: {row['module']}:{row['line']}", flush=True)
        rows.append(row)
    sys.exit(report(rows, len(chosen) - len(rows), options.least))


if __name__ == "__main__":
    main()
