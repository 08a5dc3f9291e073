"""The method and the law that READMEs add as examples pass the tests of the catalogue in a copy of the project.

Nothing is changed in the copy but what the READMEs say.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys

import pytest

import readmes

LAWS = "src/tdint/kernels/laws"
CHANGES = (
    ("member", "src/tdint/methods/single_step.py", "METHODS = (\n"),
    ("member-accuracy", "tests/analysis/assessment/test_stability.py", "ACCURACY = {\n"),
    ("member-powers", "tests/analysis/assessment/test_overshoot.py", "POWERS = {\n"),
    ("law-import", f"{LAWS}/__init__.py", "from __future__ import annotations\n\n"),
    ("law-line", f"{LAWS}/__init__.py", "    tanh.LAW,\n"),
    ("law-case", "tests/kernels/test_branches.py", "LAW_CASES = {\n"),
)


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A copy of the project with the examples in it, and an environment in which Python takes tdint from it."""
    folder = tmp_path_factory.mktemp("extended")
    for name in readmes.FOLDERS:
        shutil.copytree(readmes.ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(readmes.ROOT / name, folder)
    (folder / LAWS / "hyperbolic.py").write_text(readmes.block("law-file"))
    for kind, name, before in CHANGES:
        path = folder / name
        head, found, tail = path.read_text().partition(before)
        assert found, f"{name} has no {before!r}"
        path.write_text(head + found + re.sub(r"^\+", "", readmes.block(kind), flags=re.MULTILINE) + tail)
    paths = os.pathsep.join(str(folder / name) for name in ("src", "cli"))
    return folder, {**os.environ, "PYTHONPATH": paths, "TDINT_CACHE_DIR": str(folder / "cache")}


def python(extended, *arguments):
    folder, environment = extended
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, timeout=3000
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    return done.stdout


@pytest.mark.slow
def test_the_examples_pass_the_tests_of_the_catalogue(extended):
    folder, _ = extended
    assert str(folder) in python(extended, "-c", "import tdint; print(tdint.__file__)")
    python(extended, "tests/readmes.py", "--parts")
    assert "| `newmark-step` |" in (folder / "src/tdint/methods/README.md").read_text()
    assert "| `hyperbolic` |" in (folder / "configs/README.md").read_text()
    named = [
        str(path.relative_to(folder))
        for path in sorted((folder / "tests").rglob("test_*.py"))
        if re.search(r"\bcatalogue\(\)|\bLAWS\b", path.read_text()) and path.parent.name != "documentation"
    ]
    assert len(named) > 8
    words = "newmark-step or hyperbolic or table_holds or every_law or up_to_date"
    output = python(
        extended, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", words, *named, "tests/documentation"
    )
    passed = int(re.search(r"(\d+) passed", output)[1])
    assert passed > 20
