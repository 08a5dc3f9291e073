"""What a user installs: metadata, source archive, the package as a command."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from importlib.metadata import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("package", ["tdint", "tdint_cli"])
def test_the_package_is_the_command(package, tmp_path):
    words = subprocess.run([sys.executable, "-m", package, "--version"], capture_output=True, text=True, cwd=tmp_path)
    assert words.stdout.startswith("tdint ")
    fault = subprocess.run([sys.executable, "-m", package, "run", "none.yaml"], capture_output=True, cwd=tmp_path)
    assert fault.returncode == 3


def test_what_is_imported_is_declared():
    extras = PROJECT["project"]["optional-dependencies"].values()
    declared = " ".join([*PROJECT["project"]["dependencies"], *(one for extra in extras for one in extra)])
    names = {name.lower() for name in re.findall(r"(?:^| )([A-Za-z][\w-]*)", declared)}
    packages = {"yaml": "pyyaml"}
    own = {"tdint", "tdint_cli", "__future__"}
    imported = set()
    for file in [*(ROOT / "src").rglob("*.py"), *(ROOT / "cli").rglob("*.py")]:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                imported.add(str(node.module).partition(".")[0])
    foreign = imported - own - set(sys.stdlib_module_names)
    assert {"numpy", "matplotlib", "yaml"} <= foreign
    assert {packages.get(name, name) for name in foreign} <= names


def test_the_description_leads_nowhere_that_an_index_has_not():
    description = metadata("tdint")["Description"] or metadata("tdint").get_payload()
    assert "tdint run" in description
    assert re.findall(r"\]\((?!https?:)[^)]*\)", description) == []
    assert "<!--" not in description


def test_the_source_archive_has_what_the_checkout_has():
    listing = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listing.returncode:
        pytest.skip("not a checkout")
    taken = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    top = {line.partition("/")[0] for line in listing.stdout.splitlines()}
    assert top - set(taken) <= {"pyproject.toml", ".gitignore"}  # which hatchling takes by itself


@pytest.mark.slow  # mypy reads the package anew, without what it keeps
def test_a_checker_of_types_knows_what_tdint_has(tmp_path):
    pytest.importorskip("mypy")
    program = tmp_path / "program.py"
    program.write_text("import tdint\ntdint.run\ntdint.nothing\n")
    found = subprocess.run(
        [
            sys.executable,
            "-m",
            "mypy",
            "--config-file=",
            "--ignore-missing-imports",
            "--follow-imports=silent",
            program,
        ],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=300,
    )
    assert re.findall(r'^program.py:(\d+): error: Module has no attribute "(\w+)"', found.stdout, re.MULTILINE) == [
        ("3", "nothing")
    ]
