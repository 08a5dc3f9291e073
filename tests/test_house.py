"""The plan of the house: what the layers' contracts of import-linter cannot say."""

from __future__ import annotations

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
LAYERS = ("kernels", "ground_motion", "model", "methods", "analysis", "campaign", "output")


@cache
def trees():
    """Each module's layer (the command line and the ground are two), path and syntax tree."""
    found = []
    for home in ("src", "cli"):
        for path in sorted((ROOT / home).rglob("*.py")):
            part = path.relative_to(ROOT / home).parts[1]
            layer = "cli" if home == "cli" else part if part in LAYERS else "ground"
            found.append((layer, path.relative_to(ROOT).as_posix(), ast.parse(path.read_text(encoding="utf-8"))))
    return found


def nodes(kind):
    """All nodes of a kind with their layer and path."""
    return [(layer, path, node) for layer, path, tree in trees() for node in ast.walk(tree) if isinstance(node, kind)]


def test_no_class_name_stands_in_two_layers():
    layers = defaultdict(set)
    for layer, _, node in nodes(ast.ClassDef):
        layers[node.name].add(layer)
    assert {name: found for name, found in layers.items() if len(found) > 1} == {}


def test_the_arrays_of_a_march_are_made_in_two_places():
    """For a march, and for the single steps of which an amplification matrix is made."""
    calls = {path for _, path, node in nodes(ast.Call) if getattr(node.func, "id", "") == "workspace"}
    assert calls == {f"src/tdint/analysis/run/{name}.py" for name in ("prepared", "amplification")}


def test_no_result_is_declared_twice():
    """The output takes the analyses' own results: a protocol there is of what several results have in common."""
    protocols = [
        node.name
        for layer, _, node in nodes(ast.ClassDef)
        if layer == "output" and any(getattr(base, "id", "") == "Protocol" for base in node.bases)
    ]
    assert protocols == ["OverPeriods"]


def test_a_column_is_declared_in_one_place():
    """Columns are made where all are declared; the machinery alone makes those of errors from them."""
    makers = {path for _, path, node in nodes(ast.Call) if getattr(node.func, "id", "") == "Column"}
    subjects = ("shared", "buildings", "spectra", "methods", "campaign", "studies")
    assert makers == {
        f"src/tdint/output/tables/{name}.py"
        for name in (*(f"columns/{subject}" for subject in subjects), "table", "validation")
    }
