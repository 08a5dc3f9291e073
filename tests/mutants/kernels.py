"""Mutants of the compiled kernels: does a test fail if one operator or number is changed?

    python tests/mutants/kernels.py [--seed N] [--count N] [--journal FILE] [--kernels DIR]
        [--hours H] [--least PERCENT] [--only TEXT] [--interpreted] [--workers N]

A sample of all operators and numbers in the kernel modules is changed, one at a time, in a copy of
the package (`mutant` of tests/benchmarks/mutants.py). Each mutant is tried in two stages:

1. The tests of `INTERPRETED` that execute the changed line run without compiled loops
   (tests/mutants/first_stage.py). The package coverage measures which tests these are. The result
   is stored next to the journal (suffix .tests).
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
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "benchmarks"))
from first_stage import (  # noqa: E402
    Mutant,
    Session,
    Test,
    changed_place,
    collect,
    first_failure,
    in_copy,
    measure,
    replace_code,
    result_of,
)

from mutants import mutant, places  # noqa: E402

KERNELS = ROOT / "src" / "tdint" / "kernels"
MODULES = (
    *("peaks_*.py", "step_interpolant.py", "linear_terms.py", "equations/*.py", "laws/[a-z]*.py"),
    *("oscillators/*.py", "stories/*.py", "time_loop/*.py"),
)
"""Modules with the loops. `building` and `compiling.py` contain no loops."""

INTERPRETED = [
    "tests/kernels/test_stored_results.py",
    "tests/kernels/test_many_runs.py",
    "tests/kernels/test_halved_steps.py",
    "tests/kernels/test_oscillators_and_loads.py",
    "tests/kernels/test_oscillator_groups.py",
    "tests/kernels/test_bilinear_oscillator.py",
    "tests/kernels/test_quintic.py",
    "tests/kernels/test_parts_of_a_step.py",
    "tests/kernels/test_peaks_between_steps.py",
    "tests/kernels/test_dashpot_path.py",
    "tests/kernels/test_tridiagonal.py",
    "tests/kernels/test_bouc_wen.py",
    "tests/kernels/test_multilinear_pinching.py",
    "tests/kernels/test_softening_and_pinching.py",
    "tests/kernels/test_path.py",
    "tests/kernels/test_branches.py",
    "tests/methods/test_misdeclared_laws.py",
    "tests/methods/test_braces.py",
    "tests/response/runs/test_force_tables.py",
]
"""Files of the tests of the first stage."""

COMPILED = [
    "tests/methods/test_impulse4.py",
    "tests/methods/test_moment4.py",
    "tests/methods/test_peaks.py",
    "tests/methods/test_power_dashpots.py",
    "tests/methods/test_long_steps.py",
    "tests/methods/test_softening_and_pinching_buildings.py",
    "tests/methods/test_every_method.py",
    "tests/methods/test_tangent_damping.py",
    "tests/kernels/test_energy_of_laws.py",
    "tests/kernels/test_multilinear.py",
    "tests/kernels/test_rest.py",
    "tests/response/runs/test_contact.py",
    "tests/response/runs/test_error_estimate.py",
    "tests/response/runs/test_inertance_with_laws.py",
    "tests/response/spectra",
]
SECONDS = 1800.0
"""Time limit of the second stage, s. A mutant that loops forever is counted as killed."""

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


def compiled_stage(package: Path, cache: Path) -> tuple[bool, str]:
    """Run the tests of the second stage.

    Parameters
    ----------
    package : Path
        Directory that contains the package `tdint`.
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
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *COMPILED]
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=SECONDS
        )
    except subprocess.TimeoutExpired:
        return True, "time limit"
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return done.returncode != 0, failed.group(1) if failed else ""


def hash_of_tests() -> str:
    """Return a hash of the tests of both stages."""
    hash_value = hashlib.sha256()
    names = (*INTERPRETED, "tests/kernels/stored_results.csv", *COMPILED)
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


def measured_tests(session: Session, file: Path, workers: int) -> dict[str, Test]:
    """Return the tests of the first stage with the lines of the kernels that they execute.

    Parameters
    ----------
    session : Session
        Collected tests.
    file : Path
        File of the results. They are computed if the file does not contain results of the same
        sources.
    """
    sources = hash_of_sources()
    stored = json.loads(file.read_text("utf-8")) if file.exists() else {}
    if stored.get("sources") != sources:
        stored = {"sources": sources, "tests": {}, "files": {}}
    hashes = {name: hash_of(ROOT / name) for name in INTERPRETED}
    names = [
        name
        for name in session.items
        if stored["files"].get(name.partition("::")[0]) != hashes[name.partition("::")[0]]
    ]
    with tempfile.TemporaryDirectory() as folder:
        copies = []
        for k in range(workers):
            output = Path(folder) / f"{k}.json"
            copies.append(
                (in_copy(partial(measure, session, names[k::workers], KERNELS), output), output)
            )
        parts = [result_of(*copy) for copy in copies]
    failed = [name for part in parts for name in part["failed"]]
    if failed:
        sys.exit(f"tests must pass with unchanged sources, but {len(failed)} fail: {failed}")
    tests = {name: test for name, test in stored["tests"].items() if name in session.items}
    for part in parts:
        tests |= part["tests"]
    file.write_text(json.dumps({"sources": sources, "files": hashes, "tests": tests}), "utf-8")
    return {name: Test(**test) for name, test in tests.items()}


def hash_of_sources() -> str:
    """Return a hash of the package and the helpers of the tests."""
    hash_value = hashlib.sha256()
    helpers = (ROOT / "tests").glob("*.py")
    for file in sorted([*(ROOT / "src").rglob("*.py"), *helpers]):
        hash_value.update(file.read_bytes())
    return hash_value.hexdigest()[:12]


def interpreted_stage(
    session: Session, measured: dict[str, Test], mutant: Mutant, folder: Path
) -> tuple[bool, str]:
    """Run the tests of the first stage that execute the changed statement.

    Parameters
    ----------
    session : Session
        Collected tests.
    measured : dict
        Result of `measured_tests`.
    mutant : Mutant
        Changed module.
    folder : Path
        Empty directory.

    Returns
    -------
    bool, str
        True if a test failed, and its name.
    """
    names, output = mutant.tests(measured), folder / "failure.json"
    if not names:
        return False, ""

    def try_here() -> object:
        return first_failure(session, names, measured) if replace_code(mutant) else "new process"

    failure = result_of(in_copy(try_here, output), output)
    if failure == "new process":
        output.unlink()
        given = folder / "given.json"
        given.write_text(json.dumps({name: measured[name].seconds for name in names}), "utf-8")
        package = package_of(mutant, folder)
        command = [
            sys.executable,
            str(Path(__file__).with_name("first_stage.py")),
            str(package),
            str(given),
            str(output),
        ]
        subprocess.run(command, capture_output=True, check=False)
        # There is no result if the module cannot be imported, or after the time limit.
        failure = json.loads(output.read_text("utf-8")) if output.exists() else "no result"
    return failure != "", "time limit" if failure is None else str(failure)


def package_of(mutant: Mutant, folder: Path) -> Path:
    """Return a directory with a copy of the package that contains the changed module."""
    package = folder / "package"
    if not package.exists():
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "src" / "tdint", package / "tdint", ignore=ignored)
        file = package / "tdint" / "kernels" / f"{mutant.module}.py"
        file.write_text(mutant.text, "utf-8")
    return package


def tried(
    session: Session, measured: dict[str, Test], module: Path, place: int, kernels: Path | None
) -> dict[str, object]:
    """Try a mutant and return its line of the journal.

    Parameters
    ----------
    session : Session
        Collected tests.
    measured : dict
        Result of `measured_tests`.
    module : Path
        Module that is changed.
    place : int
        Number of the changed node.
    kernels : Path or None
        Directory of the compiled loops of the unchanged sources; None to omit the second stage.
    """
    began = time.monotonic()
    source = module.read_text("utf-8")
    line, text = mutant(source, place)
    old, new = changed_line(module, text)
    changed = Mutant(name_of(module), text, *changed_place(source, place))
    with tempfile.TemporaryDirectory() as folder:
        killed, by = interpreted_stage(session, measured, changed, Path(folder))
        if not killed and kernels is not None:
            cache = Path(folder) / "cache"
            shutil.copytree(kernels, cache)
            killed, by = compiled_stage(package_of(changed, Path(folder)), cache)
    return {
        "module": name_of(module),
        "place": place,
        "line": line,
        "old": old,
        "new": new,
        "killed": killed,
        "by": by,
        "tests_of_line": len(changed.tests(measured)),
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
    parser.add_argument("--workers", type=int, default=1, help="processes that try mutants")
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
    options.journal = options.journal.resolve()
    kernels = None if options.interpreted else options.kernels.resolve()
    tests = hash_of_tests()
    waiting = []
    for module, place in chosen:
        row = journal.get((name_of(module), place))
        if row is None or not still_valid(row, module, tests, kernels is not None):
            journal.pop((name_of(module), place), None)
            waiting.append((module, place))
    if waiting:

        def work(session: Session) -> None:
            try_all(session, waiting, options, kernels, end)

        code = collect(INTERPRETED, ROOT / "src", work)
        if code:
            sys.exit(code)
        for line in options.journal.read_text("utf-8").splitlines():
            row = json.loads(line)
            if (row["module"], row["place"]) in {(name_of(m), p) for m, p in waiting}:
                journal[row["module"], row["place"]] = row
    rows = [row for module, place in chosen if (row := journal.get((name_of(module), place)))]
    sys.exit(report(rows, len(chosen) - len(rows), options.least))


def try_all(
    session: Session,
    waiting: list[tuple[Path, int]],
    options: argparse.Namespace,
    kernels: Path | None,
    end: float,
) -> None:
    """Try mutants in several processes, and append the results to the journal.

    Parameters
    ----------
    session : Session
        Collected tests.
    waiting : list of (Path, int)
        Modules and places of the mutants.
    options : Namespace
        Options of the command line.
    kernels : Path or None
        Directory of the compiled loops of the unchanged sources; None to omit the second stage.
    end : float
        Time after which no mutant is started, in seconds of `time.monotonic`.
    """
    measured = measured_tests(session, options.journal.with_suffix(".tests"), options.workers)
    if kernels is not None:
        failed, by = compiled_stage(ROOT / "src", kernels)
        if failed:
            sys.exit(f"tests must pass with unchanged sources, but one fails: {by}")
    running: dict[int, Path] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, (module, place) in enumerate([*waiting, (None, 0)]):
            done = module is None or time.monotonic() > end
            while len(running) >= (1 if done else options.workers):
                child, status = os.wait()
                output = running.pop(child)
                if status:
                    sys.exit(output.with_suffix(".error").read_text("utf-8"))
                row = json.loads(output.read_text("utf-8"))
                with options.journal.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
                result = "killed" if row["killed"] else "survives"
                print(f"{result}: {row['module']}:{row['line']}", flush=True)
            if done:
                break
            output = Path(folder) / f"{number} {name_of(module).replace('/', '.')} {place}"
            child = in_copy(partial(tried, session, measured, module, place, kernels), output)
            running[child] = output


if __name__ == "__main__":
    main()
