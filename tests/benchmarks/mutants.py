"""Change operators and numbers of modules one at a time, and check that a test fails.

    python tests/benchmarks/mutants.py [--seed N] [--count N] MODULE.py ... -- TESTS ...
    python tests/benchmarks/mutants.py [--seed N] [--count N] --reached DATA MODULE.py ...

MODULE are files of src/tdint. TESTS are the arguments of pytest with which each mutant is tried. A
random sample of all operators and numbers is changed, one at a time, in a copy of the package,
which is imported instead of the installed one. Compiled kernels are not changed; mutants of kernels
are tried by tests/mutants/kernels.py. The script prints the line of each survivor. A person must
decide whether a test is missing or the mutant is equivalent.

DATA is a data file of coverage with the tests that reach each line. With DATA, each mutant is tried
with the tests that reach its module: first those that reach the changed line, and of these first
the tests that reach the fewest lines. A mutant of a module that no test reaches counts as a
survivor. All tests must pass when DATA is made, which takes about fifteen minutes:

    printf '[run]\\nsource = src/tdint\\ndynamic_context = test_function\\n' > contexts.ini
    coverage run --rcfile contexts.ini --data-file DATA -m pytest -q
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 60.0
"""Time limit of a test, s. The slowest test of the suite takes 10 s; a longer test has no end."""

OTHER = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE,
    ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
"""Operator that replaces each operator."""


def places(source: str) -> list[int]:
    """Return the indices of the nodes that can be changed: operators and numbers."""
    return [
        i
        for i, node in enumerate(ast.walk(ast.parse(source)))
        if (isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in OTHER)
        or (isinstance(node, ast.Compare) and type(node.ops[0]) in OTHER)
        or (isinstance(node, ast.Constant) and type(node.value) in (int, float))
    ]


def mutant(source: str, place: int) -> tuple[int, str]:
    """Return the line number of a node, and the source text with this node changed.

    An operator is replaced as listed in `OTHER`. A number with decimals is doubled; 1 is added to
    an integer and to 0.0. `place` is an index of `places`.
    """
    tree = ast.parse(source)
    node = list(ast.walk(tree))[place]
    if isinstance(node, ast.BinOp | ast.BoolOp):
        node.op = OTHER[type(node.op)]()
    elif isinstance(node, ast.Compare):
        node.ops[0] = OTHER[type(node.ops[0])]()
    elif isinstance(node, ast.Constant):
        node.value = (
            2 * node.value if isinstance(node.value, float) and node.value else node.value + 1
        )
    return node.lineno, ast.unparse(tree)


def survives(package: Path, module: Path, text: str, tests: list[str]) -> bool:
    """Return True if all tests pass with the text of a mutant as the source of the module.

    Parameters
    ----------
    package : Path
        Directory with the copy of the package `tdint`. The module in it is replaced temporarily.
    module : Path
        Module in src/tdint of this repository.
    text : str
        Source text of the mutant.
    tests : list of str
        Arguments of pytest.
    """
    file = package / "tdint" / module.relative_to(ROOT / "src" / "tdint")
    before = file.read_text(encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    environment = {
        **os.environ,
        "PYTHONPATH": str(package),
        "PYTHONPYCACHEPREFIX": str(package / "bytecode"),
    }
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    # A test that exceeds the time limit ends the process, which counts as a failure.
    time_limit = (
        "-o",
        f"faulthandler_timeout={SECONDS}",
        "-o",
        "faulthandler_exit_on_timeout=true",
    )
    command = [
        sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *time_limit, *tests,
    ]  # fmt: skip
    try:
        return not subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True
        ).returncode
    finally:
        file.write_text(before, encoding="utf-8")


class Reach:
    """Tests that reach the lines of the modules, from a data file of coverage."""

    def __init__(self, file: Path) -> None:
        from coverage import CoverageData

        self._data = CoverageData(str(file))
        self._data.read()
        self._lines: Counter[str] = Counter()
        for module in self._data.measured_files():
            for contexts in self._data.contexts_by_lineno(module).values():
                self._lines.update(contexts)

    def tests(self, module: Path, line: int) -> list[str]:
        """Return the tests that reach a module, by their names for pytest.

        Tests that reach the line are first, ordered by the number of lines that they reach.

        The other tests of the module are needed, because the code of a cached value is executed
        only in the first test that uses the value.
        """
        by_line = self._data.contexts_by_lineno(str(module))
        of_line = set(by_line.get(line, ()))
        of_module = set[str]().union(*by_line.values())
        # Contexts of functions of hypothesis that are also called "test" are ignored.
        ours = [context for context in of_module if context.startswith("tests.")]
        return [
            _node(test)
            for test in sorted(ours, key=lambda test: (test not in of_line, self._lines[test]))
        ]


def _node(context: str) -> str:
    """Return the name by which pytest selects a test.

    Coverage calls the test `tests.folder.test_file.Class.function`. A test that is wrapped by
    hypothesis is called `accept.<locals>.function`; in this case the name selects its file.
    """
    parts = context.partition(".accept.<locals>")[0].split(".")
    size = next(
        i
        for i in range(1, len(parts) + 1)
        if (ROOT / Path(*parts[:i]).with_suffix(".py")).is_file()
    )
    return "::".join([f"{Path(*parts[:size])}.py", *parts[size:]])


def main() -> None:
    """Try a random sample of mutants, and print the survivors and the number of killed mutants."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--reached", type=Path)
    parser.add_argument("modules", nargs="+", type=Path)
    split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    options = parser.parse_args(sys.argv[1:split])
    tests = sys.argv[split + 1 :]
    if bool(tests) == bool(options.reached):
        parser.error("either tests (after --) or --reached DATA is required, but not both")
    reach = Reach(options.reached) if options.reached else None
    population = [
        (module.resolve(), place)
        for module in options.modules
        for place in places(module.read_text(encoding="utf-8"))
    ]
    chosen = random.Random(options.seed).sample(population, min(options.count, len(population)))
    mutants = [
        (module, *mutant(module.read_text(encoding="utf-8"), place)) for module, place in chosen
    ]
    killed = 0
    with tempfile.TemporaryDirectory() as name:
        package = Path(name)
        shutil.copytree(
            ROOT / "src" / "tdint", package / "tdint", ignore=shutil.ignore_patterns("__pycache__")
        )
        # Tests that fail or do not exist would seem to kill each mutant: check them first.
        first_module = options.modules[0].resolve()
        tests_by_mutant = [
            reach.tests(module, line) if reach else tests for module, line, _ in mutants
        ]
        # The tests of DATA passed when it was made. Only check that they still exist.
        all_tests = ["--collect-only", *sorted(set().union(*tests_by_mutant))] if reach else tests
        original = first_module.read_text(encoding="utf-8")
        if not survives(package, first_module, original, all_tests):
            sys.exit("tests not found, or tests fail with the unchanged modules")
        for (module, line, text), selected in zip(mutants, tests_by_mutant, strict=True):
            is_survivor = not selected or survives(package, module, text, selected)
            killed += not is_survivor
            if is_survivor:
                old_line = module.read_text(encoding="utf-8").splitlines()[line - 1].strip()
                new_line = next(
                    (
                        new
                        for old, new in zip(_formatted(module), text.splitlines(), strict=False)
                        if old != new
                    ),
                    "",
                )
                print(
                    f"survives: {module.relative_to(ROOT)}:{line}: {old_line}\n"
                    f"    as {new_line.strip()}",
                    flush=True,
                )
    print(f"{killed} of {len(mutants)} killed")


def _formatted(module: Path) -> list[str]:
    """Return the lines of a module, formatted like the text of a mutant."""
    return ast.unparse(ast.parse(module.read_text(encoding="utf-8"))).splitlines()


if __name__ == "__main__":
    main()
