"""The plan of the house: what the contracts of import-linter cannot say. Its numbers are
ceilings."""

import ast
import re
import sys
import tomllib
from collections import Counter, defaultdict
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from source_lines import code_lines

ROOT = Path(__file__).parents[1]
LAYERS = ("kernels", "ground_motion", "model", "methods", "analysis", "campaign", "output")

NAMED_MORE_OFTEN = {"modes.py"}
SKIPS = 10
LONG_SIGNATURES = {
    "analysis": 3,
    "campaign": 2,
    "output": 2,
    "cli": 2,
}  # output: `plot`, declared twice


@cache
def trees():
    """Each module's layer (the command line and the ground are two), path and the nodes of its
    syntax, its tree first: gone through once for all tests."""
    found = []
    for home in ("src", "cli"):
        for path in sorted((ROOT / home).rglob("*.py")):
            part = path.relative_to(ROOT / home).parts[1]
            layer = "cli" if home == "cli" else part if part in LAYERS else "ground"
            found.append(
                (
                    layer,
                    path.relative_to(ROOT).as_posix(),
                    list(ast.walk(ast.parse(path.read_bytes()))),
                )
            )
    return found


@cache
def nodes(kind):
    """All nodes of a kind with their layer and path."""
    return [
        (layer, path, node)
        for layer, path, parts in trees()
        for node in parts
        if isinstance(node, kind)
    ]


def test_no_class_name_stands_in_two_layers():
    layers = defaultdict(set)
    for layer, _, node in nodes(ast.ClassDef):
        layers[node.name].add(layer)
    assert {name: found for name, found in layers.items() if len(found) > 1} == {}


def test_the_arrays_of_a_march_are_made_in_two_places():
    """For a march, and for the single steps of which an amplification matrix is made."""
    calls = {
        path for _, path, node in nodes(ast.Call) if getattr(node.func, "id", "") == "workspace"
    }
    assert calls == {f"src/tdint/analysis/run/{name}.py" for name in ("prepared", "workspace")}


def test_no_result_is_declared_twice():
    """The output takes the analyses' own results: a protocol there is of what several results have
    in common."""
    protocols = [
        node.name
        for layer, _, node in nodes(ast.ClassDef)
        if layer == "output" and any(getattr(base, "id", "") == "Protocol" for base in node.bases)
    ]
    assert protocols == ["OverPeriods"]


def test_a_column_is_declared_in_one_place():
    """Columns are made where their tables are."""
    makers = {path for _, path, node in nodes(ast.Call) if getattr(node.func, "id", "") == "Column"}
    subjects = {
        "buildings",
        "responses",
        "spectra",
        "methods",
        "campaign",
        "damage_states",
        "studies",
        "exports",
        "differences",
    }
    assert makers == {f"src/tdint/output/tables/{name}.py" for name in subjects | {"table"}}


def modules():
    """The paths of all modules, below the folder of their package: tdint/..., tdint_cli/..."""
    return [Path(*Path(path).parts[1:]) for _, path, _ in trees()]


def test_modules_are_few_and_their_folders_flat():
    found = [module for module in modules() if module.name != "__init__.py"]
    crowded = [
        folder.name
        for folder, count in Counter(module.parent for module in found).items()
        if count > 14
    ]
    assert sorted(crowded) == ["campaign", "commands"]  # a command a file; a campaign has 17
    assert [
        module for module in found if len(module.parts) > 5
    ] == []  # the package and three folders


def test_a_name_stands_for_two_modules_at_most():
    names = Counter(module.name for module in modules() if module.name != "__init__.py")
    assert {name for name, count in names.items() if count > 2} <= NAMED_MORE_OFTEN


def imported(parts, known):
    """The modules that a module names, those for types and in functions, too."""
    for node in parts:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name for name in inner if name in known)
            if node.module in known and not known.issuperset(inner):
                yield node.module


def test_no_module_needs_itself():
    named = {}
    for _, path, nodes_of_it in trees():
        names = Path(path).with_suffix("").parts[1:]
        named[".".join(names[:-1] if names[-1] == "__init__" else names)] = nodes_of_it
    known = set(named)
    order = TopologicalSorter({name: set(imported(parts, known)) for name, parts in named.items()})
    assert len(tuple(order.static_order())) == len(
        known
    )  # a circle raises CycleError, which names it


def test_what_is_imported_is_declared():
    """Packages that are not Python's own, by the dependencies and extras of the project."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    declared = " ".join([*project["dependencies"], *(line for extra in extras for line in extra)])
    names = {name.lower() for name in re.findall(r"(?:^| )([A-Za-z][\w-]*)", declared)}
    named = [alias.name for _, _, node in nodes(ast.Import) for alias in node.names]
    named += [node.module for _, _, node in nodes(ast.ImportFrom) if not node.level]
    foreign = (
        {name.partition(".")[0] for name in named}
        - {"tdint", "tdint_cli"}
        - set(sys.stdlib_module_names)
    )
    assert {"numpy", "matplotlib", "yaml"} <= foreign
    assert {{"yaml": "pyyaml"}.get(name, name) for name in foreign} <= names


def test_code_is_laid_out_by_the_formatter():
    """Where it is not, in src, a table reads as one."""
    skips = [
        path
        for _, path, _ in trees()
        for _ in range((ROOT / path).read_text().count("# fmt: " + "skip"))
    ]
    assert len([path for path in skips if path.startswith("src")]) <= SKIPS


def is_bare(node):
    """A name bound to a number, or to a formula of numbers alone."""
    value = getattr(node, "value", None) if isinstance(node, ast.Assign | ast.AnnAssign) else None
    parts = (
        list(ast.walk(value)) if isinstance(value, ast.Constant | ast.UnaryOp | ast.BinOp) else []
    )
    numbers = [
        part
        for part in parts
        if isinstance(part, ast.Constant) and type(part.value) in (int, float)
    ]
    return bool(numbers) and not any(isinstance(part, ast.Name | ast.Attribute) for part in parts)


def test_a_constant_has_its_reason():
    """Beside it, or with those that it stands among: why this number, or what it is of."""
    bare = []
    for _, path, (tree, *_) in trees():
        lines = (ROOT / path).read_text(encoding="utf-8").splitlines()
        for node in filter(is_bare, tree.body):
            first, last = node.lineno - 1, node.end_lineno
            while first and lines[first - 1].strip():
                first -= 1
            while last < len(lines) and lines[last].strip():
                last += 1
            told = any(line.startswith(("#", '"""')) for line in lines[first:last])
            if not told and "#" not in "".join(lines[node.lineno - 1 : node.end_lineno]):
                bare.append(f"{path}:{node.lineno}")
    assert bare == []


@pytest.mark.parametrize("layer", [*LAYERS, "cli", "ground"])
def test_functions_take_at_most_eight_arguments(layer):
    """But for kernels, which are entered with flat arguments, and what calls through an address."""
    long = []
    for found, path, node in nodes(ast.FunctionDef):
        count = len(node.args.posonlyargs) + len(node.args.args) + len(node.args.kwonlyargs)
        # Overloads repeat the signature of a function that is counted itself.
        is_overload = any(ast.unparse(one) == "overload" for one in node.decorator_list)
        if found == layer and count > 8 and not is_border(node) and not is_overload:
            long.append(f"{path}: {node.name} {count}")
    assert len(long) <= LONG_SIGNATURES.get(layer, 0), long


def is_border(node):
    """Whether a function is compiled by itself (`@kernel`) or calls through an address
    (`@intrinsic`, `call_...`)."""
    decorators = [ast.unparse(one).partition("(")[0] for one in node.decorator_list]
    return bool({"kernel", "intrinsic"} & set(decorators)) or node.name.startswith("call_")


def test_terms_of_the_field_are_said_where_shorter_words_are_used():
    said = {
        "src/tdint/kernels/laws/README.md": ("hysteretic model", "backbone"),
        "src/tdint/analysis/run/demands.py": ("Engineering demand parameters",),
    }
    assert [
        (path, term)
        for path, terms in said.items()
        for term in terms
        if term not in (ROOT / path).read_text()
    ] == []
    assert [path for _, path, _ in trees() if "storey" in (ROOT / path).read_text().lower()] == []


MAX_CODE_LINES = 600
"""Code lines of one file. Docstrings, comments and blank lines are not counted, so that they have
room."""


def test_no_file_has_more_code_lines_than_the_limit():
    counts = {path: len(code_lines(parts)) for _, path, parts in trees()}
    assert {path: count for path, count in counts.items() if count > MAX_CODE_LINES} == {}
