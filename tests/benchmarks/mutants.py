"""Operators and constants of modules changed one at a time: does a test notice?

    python tests/benchmarks/mutants.py [--seed N] [--count N] MODULE.py ... -- TESTS ...
    python tests/benchmarks/mutants.py [--seed N] [--count N] --reached DATA MODULE.py ...

MODULE are files of src/tdint, TESTS what pytest is given to try each mutant. A sample of all places
is changed in a copy of the package, which stands before the installed one; kernels are those of the
store, so modules of kernels are none for this. Survivors are shown with their line; what comes of
it is for a person to judge.

With DATA of coverage, each mutant gets the tests that reach its module in their own process, first
those of its line, and of these first those that reach least besides. A module that none reaches
counts as surviving. DATA is made once, by tests that all pass, in about fifteen minutes:

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
"""A test that takes longer hangs; the slowest of the suite takes ten."""

OTHER = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}


def places(source: str) -> list[int]:
    """Numbers of the nodes that can be changed: operators, and numbers."""
    return [
        i
        for i, node in enumerate(ast.walk(ast.parse(source)))
        if (isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in OTHER)
        or (isinstance(node, ast.Compare) and type(node.ops[0]) in OTHER)
        or (isinstance(node, ast.Constant) and type(node.value) in (int, float))
    ]


def mutant(source: str, place: int) -> tuple[int, str]:
    """Line and text with one node changed: an operator replaced, a number doubled, or raised if it
    is whole or 0."""
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
    """Whether all tests pass with a module's text in place of its own."""
    file = package / "tdint" / module.relative_to(ROOT / "src" / "tdint")
    before = file.read_text(encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    environment = {
        **os.environ,
        "PYTHONPATH": str(package),
        "PYTHONPYCACHEPREFIX": str(package / "bytecode"),
    }
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    hangs = ("-o", f"faulthandler_timeout={SECONDS}", "-o", "faulthandler_exit_on_timeout=true")
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *hangs, *tests]
    try:
        return not subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True
        ).returncode
    finally:
        file.write_text(before, encoding="utf-8")


class Reach:
    """Which tests reach a module: `path::function`."""

    def __init__(self, file: Path) -> None:
        from coverage import CoverageData

        self._data = CoverageData(str(file))
        self._data.read()
        self._lines: Counter[str] = Counter()
        for module in self._data.measured_files():
            for contexts in self._data.contexts_by_lineno(module).values():
                self._lines.update(contexts)

    def tests(self, module: Path, line: int) -> list[str]:
        """Those of the line, then those of the module's other lines: what is cached runs in the
        first test alone."""
        by_line = self._data.contexts_by_lineno(str(module))
        of_line = set(by_line.get(line, ()))
        of_module = set[str]().union(*by_line.values())
        # hypothesis has functions that are called test, too.
        ours = [context for context in of_module if context.startswith("tests.")]
        return [
            _node(test)
            for test in sorted(ours, key=lambda test: (test not in of_line, self._lines[test]))
        ]


def _node(context: str) -> str:
    """pytest's name of a test that coverage calls `tests.folder.test_file.Class.function`; all of a
    file for one that hypothesis has wrapped, which is called `accept.<locals>.function`."""
    parts = context.partition(".accept.<locals>")[0].split(".")
    size = next(
        i
        for i in range(1, len(parts) + 1)
        if (ROOT / Path(*parts[:i]).with_suffix(".py")).is_file()
    )
    return "::".join([f"{Path(*parts[:size])}.py", *parts[size:]])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--reached", type=Path)
    parser.add_argument("modules", nargs="+", type=Path)
    split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    given = parser.parse_args(sys.argv[1:split])
    tests = sys.argv[split + 1 :]
    if bool(tests) == bool(given.reached):
        parser.error("give either tests, behind --, or the data of --reached")
    reach = Reach(given.reached) if given.reached else None
    every = [
        (one.resolve(), place)
        for one in given.modules
        for place in places(one.read_text(encoding="utf-8"))
    ]
    chosen = random.Random(given.seed).sample(every, min(given.count, len(every)))
    mutants = [
        (module, *mutant(module.read_text(encoding="utf-8"), place)) for module, place in chosen
    ]
    killed = 0
    with tempfile.TemporaryDirectory() as name:
        package = Path(name)
        shutil.copytree(
            ROOT / "src" / "tdint", package / "tdint", ignore=shutil.ignore_patterns("__pycache__")
        )
        # Tests that fail, or are not there, would be counted as noticing everything.
        plain = given.modules[0].resolve()
        asked = [reach.tests(module, line) if reach else tests for module, line, _ in mutants]
        # Those of DATA passed when it was made: their names must still be right.
        all_of_them = ["--collect-only", *sorted(set().union(*asked))] if reach else tests
        if not survives(package, plain, plain.read_text(encoding="utf-8"), all_of_them):
            sys.exit("the tests are not there, or do not pass with the modules as they stand")
        for (module, line, text), of_mutant in zip(mutants, asked, strict=True):
            lives = not of_mutant or survives(package, module, text, of_mutant)
            killed += not lives
            if lives:
                was = module.read_text(encoding="utf-8").splitlines()[line - 1].strip()
                here = next(
                    (
                        new
                        for old, new in zip(_plain(module), text.splitlines(), strict=False)
                        if old != new
                    ),
                    "",
                )
                print(
                    f"survives: {module.relative_to(ROOT)}:{line}: {was}\n    as {here.strip()}",
                    flush=True,
                )
    print(f"{killed} of {len(mutants)} killed")


def _plain(module: Path) -> list[str]:
    return ast.unparse(ast.parse(module.read_text(encoding="utf-8"))).splitlines()


if __name__ == "__main__":
    main()
