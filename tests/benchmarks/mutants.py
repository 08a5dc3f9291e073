"""Operators and constants of modules changed one at a time: does a test notice?

    python tests/benchmarks/mutants.py [--seed N] [--count N] MODULE.py ... -- TESTS ...

MODULE are files of src/tdint, TESTS what pytest is given to try each mutant. A sample of all places is changed in a
copy of the package, which stands before the installed one; kernels are those of the store, so modules of kernels are
none for this. Survivors are shown with their line; what comes of it is for a person to judge.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 400.0
OTHER = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult,
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.And: ast.Or, ast.Or: ast.And, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip


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
    """Line and text with one node changed: an operator replaced, a number doubled, or raised if it is whole or 0."""
    tree = ast.parse(source)
    node = list(ast.walk(tree))[place]
    if isinstance(node, ast.BinOp | ast.BoolOp):
        node.op = OTHER[type(node.op)]()
    elif isinstance(node, ast.Compare):
        node.ops[0] = OTHER[type(node.ops[0])]()
    elif isinstance(node, ast.Constant):
        node.value = 2 * node.value if isinstance(node.value, float) and node.value else node.value + 1
    return node.lineno, ast.unparse(tree)


def survives(package: Path, module: Path, text: str, tests: list[str]) -> bool:
    """Whether all tests pass with a module's text in place of its own."""
    file = package / "tdint" / module.relative_to(ROOT / "src" / "tdint")
    before = file.read_text(encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(package), "PYTHONPYCACHEPREFIX": str(package / "bytecode")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    try:
        return not subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, timeout=SECONDS).returncode
    except subprocess.TimeoutExpired:
        return False
    finally:
        file.write_text(before, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    split = sys.argv.index("--")
    parser.add_argument("modules", nargs="+", type=Path)
    given = parser.parse_args(sys.argv[1:split])
    tests = sys.argv[split + 1 :]
    every = [(one.resolve(), place) for one in given.modules for place in places(one.read_text(encoding="utf-8"))]
    chosen = random.Random(given.seed).sample(every, min(given.count, len(every)))
    killed = 0
    with tempfile.TemporaryDirectory() as name:
        package = Path(name)
        shutil.copytree(ROOT / "src" / "tdint", package / "tdint", ignore=shutil.ignore_patterns("__pycache__"))
        # Tests that fail, or are not there, would be counted as noticing everything.
        plain = given.modules[0].resolve()
        if not survives(package, plain, plain.read_text(encoding="utf-8"), tests):
            sys.exit(f"{' '.join(tests)}: these do not pass with the modules as they stand")
        for module, place in chosen:
            line, text = mutant(module.read_text(encoding="utf-8"), place)
            lives = survives(package, module, text, tests)
            killed += not lives
            if lives:
                was = module.read_text(encoding="utf-8").splitlines()[line - 1].strip()
                here = next(
                    (new for old, new in zip(_plain(module), text.splitlines(), strict=False) if old != new), ""
                )
                print(f"survives: {module.relative_to(ROOT)}:{line}: {was}\n    as {here.strip()}", flush=True)
    print(f"{killed} of {len(chosen)} killed")


def _plain(module: Path) -> list[str]:
    return ast.unparse(ast.parse(module.read_text(encoding="utf-8"))).splitlines()


if __name__ == "__main__":
    main()
