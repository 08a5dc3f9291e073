"""Rules of the architecture that contracts of import-linter cannot express. Its numbers are upper
limits."""

import ast
import gc
import re
import sys
import tomllib
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from source_lines import code_lines
from tdint.kernels.laws import NAMES as LAW_NAMES
from tdint.methods.catalogue import FAMILIES, catalogue
from tdint.public_names import PLUGIN, PUBLIC
from tdint_cli.handlers import HANDLERS
from tdint_cli.main import COMMANDS

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LAYERS = (
    *("kernels", "ground_motion", "model", "methods", "response", "output"),
    *("assessment", "studies"),
)

LONG_SIGNATURES = {
    "ground_motion": 1,
    "response": 2,
    "assessment": 1,
    "studies": 3,
    "output": 2,
    "cli": 2,
}  # ground_motion: `process`, the keys of model files; output: `plot`, declared twice


@cache
def trees():
    """Return layer, path and syntax nodes (the tree first) of each module; computed once for all
    tests."""
    found = []
    gc.disable()  # a third of the time: each of the million nodes would be visited several times
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
    gc.freeze()
    gc.enable()
    return found


@cache
def nodes(node_type):
    """Yield all nodes of a type with their layer and path."""
    return [
        (layer, path, node)
        for layer, path, parts in trees()
        for node in parts
        if isinstance(node, node_type)
    ]


def test_class_names_are_unique_among_layers():
    layers = defaultdict(set)
    for layer, _, node in nodes(ast.ClassDef):
        layers[node.name].add(layer)
    assert {name: found for name, found in layers.items() if len(found) > 1} == {}


def test_columns_are_declared_in_table_modules():
    """Columns are created in the modules of their tables, or read from columns.csv."""
    makers = {
        path
        for _, path, node in nodes(ast.Call)
        if ast.unparse(node.func) in {"Column", "Column.named"}
    }
    other = {path for path in makers if not path.endswith(("_tables.py", "assessment/tables.py"))}
    names = ["buildings", "columns", "devices", "directions", "elements", "histories"]
    names += ["responses", "runs", "spectra", "table", "transfer"]
    assert other == {f"src/tdint/output/tables/{name}.py" for name in names} | {
        "src/tdint/studies/campaign/exports.py",
    }


def modules():
    """Return the paths of all modules relative to the directory of their package: tdint/...,
    tdint_cli/..."""
    return [Path(*Path(path).parts[1:]) for _, path, _ in trees()]


def test_directories_are_flat():
    found = [module for module in modules() if module.name != "__init__.py"]
    assert [
        module for module in found if len(module.parts) > 5
    ] == []  # the package and three directories


def imported(name, parts, known):
    """Yield the modules that a module imports: by statements (also for types and in functions), by
    `import_module` and by a module-level `__getattr__`."""
    for node in parts:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name for name in inner if name in known)
            if node.module in known and not known.issuperset(inner):
                yield node.module
    yield from (found for found in imported_by_name(name, parts) if found in known)


ANY_NAME = {
    "tdint.tabular": "packages of other projects, and modules below the package that asks",
    "tdint.ground_motion.messages": "a module of ObsPy",
    "tdint.kernels.build": "modules of kernels, whose names the process that compiles receives",
    "tdint.kernels.building.background": "as in `tdint.kernels.build`",
}
"""Modules that import by names that are not in their text, and the modules that these names can
be."""

ROOMS = [
    f"tdint.{path.parent.parent.name}.{path.parent.name}"
    for package in ("assessment", "studies")
    for path in (ROOT / "src/tdint" / package).glob("*/__init__.py")
]
"""Packages of the subjects of studies and of the assessment of methods."""

TABLES_OF_NAMES = {
    "tdint_cli.handlers": lambda: [name.partition(":")[0] for name in HANDLERS.values()],
    "tdint_cli.main": lambda: [module for module, _ in COMMANDS.values()],
    "tdint": lambda: PUBLIC.values(),
    "tdint.plugin": lambda: PLUGIN.values(),
    "tdint.kernels.laws": lambda: [
        f"tdint.kernels.laws.{name.replace('-', '_')}" for name in LAW_NAMES
    ],
    # The modules of these packages are rooms, which are packages, and `presentations`.
    **{
        name: lambda name=name: [other for other in ROOMS if other.startswith(f"{name}.")]
        for name in ("tdint.assessment", "tdint.studies")
    },
    "tdint.methods.catalogue": lambda: [f"tdint.methods.{family}" for family in FAMILIES],
}
"""Modules that import by names in a table, and the modules of the table."""


def imported_by_name(name, parts):
    """Return the modules that calls of `import_module` or similar functions can import.

    Raises
    ------
    AssertionError
        A call has an argument that is neither text nor listed in `ANY_NAME` or
        `TABLES_OF_NAMES`, or `__getattr__` of the module is of an unknown kind.
    """
    found, unknown = [], []
    for node in parts:
        function = isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2]
        if function not in ("import_module", "__import__", "run_module", "modules_on_use"):
            continue
        # A partly computed name represents all modules of its package.
        text = ast.unparse(node.args[0])
        below = re.fullmatch(r"f'\{__name__\}\.([\w.]+)'", text)
        member = re.match(r"f'(tdint[\w.]*)\.\{", text)
        if name in TABLES_OF_NAMES and not isinstance(node.args[0], ast.Constant):
            continue
        if member or text == "__name__":
            package = member[1] if member else name
            found += (path for path in dotted_names() if path.rpartition(".")[0] == package)
        elif isinstance(node.args[0], ast.Constant):
            found.append(node.args[0].value)
        elif below:
            found.append(f"{name}.{below[1]}")
        elif name not in ANY_NAME:
            unknown.append(text)
    if name in TABLES_OF_NAMES:
        found += TABLES_OF_NAMES[name]()
    assert unknown == [], f"{name} imports modules by names that this test cannot determine"
    return found


def dotted_names():
    """Return the dotted name of each module, with the nodes of its syntax."""
    names = {}
    for _, path, parts in trees():
        parts_of_path = Path(path).with_suffix("").parts[1:]
        names[
            ".".join(parts_of_path[:-1] if parts_of_path[-1] == "__init__" else parts_of_path)
        ] = parts
    return names


def layers_upward():
    """Return the layers of the contract of import-linter from the lowest, followed by the two
    modules that import from all layers for Python users."""
    (contract,) = (
        contract
        for contract in PROJECT["tool"]["importlinter"]["contracts"]
        if contract["name"] == "Imports run one way"
    )
    command_line, *below = [layer for group in contract["layers"] for layer in group.split(" | ")]
    return [*below[::-1], "tdint.plugin", "tdint", command_line]


def layer_of(name, layers):
    """Return the number of the layer of a module, from 0; the package `tdint` is a separate
    layer."""
    exact = [i for i, layer in enumerate(layers) if name == layer]
    inner = [
        i for i, layer in enumerate(layers) if layer != "tdint" and name.startswith(f"{layer}.")
    ]
    return (exact or inner or [len(layers)])[0]


def wrong_imports(graph):
    """Return the imports of a graph from a higher layer, and a cycle if one exists."""
    layers = layers_upward()
    upward = [
        f"{name} imports {other}"
        for name, others in graph.items()
        for other in sorted(others)
        if layer_of(other, layers) > layer_of(name, layers)
    ]
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return upward, error.args[1]
    return upward, []


@cache
def import_graph():
    """Return the modules that each module imports."""
    named = dotted_names()
    return {name: set(imported(name, parts, set(named))) for name, parts in named.items()}


def changed_graph(name, source):
    """Return the graph of imports if a module had another source."""
    parts = list(ast.walk(ast.parse(source)))
    return import_graph() | {name: set(imported(name, parts, set(import_graph())))}


def test_imports_have_no_cycle_and_no_higher_layer():
    """Imports by name are included."""
    graph = import_graph()
    assert layer_of("tdint.__main__", layers_upward()) == len(layers_upward())  # starts the program
    assert wrong_imports(graph) == ([], [])
    assert "tdint.output.plotting" in graph["tdint"]  # by `import_module`
    assert "tdint.methods.method" in graph["tdint.plugin"]  # by `__getattr__`
    assert "tdint.output.figures.style" in graph["tdint.output.figures"]


@pytest.mark.parametrize(
    "line",
    [
        "import_module('tdint.response.runs.run')",
        "importlib.import_module('tdint.response.runs.run')",
        "__import__('tdint.response.runs.run')",
        "def check():\n    from tdint.response.runs.run import run",
    ],
)
def test_import_by_name_that_closes_cycle_is_found(line):
    name = "tdint.response.runs.compiled_steps"
    source = (ROOT / "src/tdint/response/runs/compiled_steps.py").read_text(encoding="utf-8")
    upward, cycle = wrong_imports(changed_graph(name, f"{source}\n{line}\n"))
    assert upward == []
    assert {name, "tdint.response.runs.run"} <= set(cycle)


def test_import_by_name_of_higher_layer_is_found():
    source = "from importlib import import_module\nimport_module('tdint.output.plotting')\n"
    upward, _ = wrong_imports(changed_graph("tdint.response.static.cyclic", source))
    assert upward == ["tdint.response.static.cyclic imports tdint.output.plotting"]


def test_import_by_computed_name_is_refused():
    with pytest.raises(AssertionError, match="cannot determine"):
        changed_graph("tdint.units", "import_module('tdint.' + 'output')")


@pytest.mark.long
def test_getattr_of_modules_is_known():
    """Module-level `__getattr__` imports by a table or from its own package, or creates kernels."""
    found = {
        name
        for name, (tree, *_) in dotted_names().items()
        for node in ast.walk(tree)
        if name_of_binding(node) == "__getattr__" and not in_class(tree, node)
    }
    assert found == {
        "tdint",
        "tdint.plugin",
        "tdint.output.figures",
        "tdint.output.tables",
        "tdint.assessment",
        "tdint.studies",
        "tdint_cli.options",
    }


def name_of_binding(node):
    """Return the name that a function definition or an assignment binds, or an empty text."""
    if isinstance(node, ast.FunctionDef):
        return node.name
    return ast.unparse(node.targets[0]) if isinstance(node, ast.Assign) else ""


def in_class(tree, node):
    """Return whether a node is in the body of a class."""
    return any(isinstance(other, ast.ClassDef) and node in other.body for other in ast.walk(tree))


HOMES_OF_NAMES = {
    "src/tdint/kernels/laws/": LAW_NAMES,
    "src/tdint/methods/": tuple(catalogue()),
    "src/tdint/ground_motion/formats/": tuple(
        PROJECT["project"]["entry-points"]["obspy.plugin.waveform"]
    ),
}
"""Names of laws, methods and formats by the directory that declares their properties."""

NAMED_ELSEWHERE = {
    "ordinary words": {
        "cli/tdint_cli/assessment/overshoot.py": "linear",
        "cli/tdint_cli/commands/spectrum.py": "exact",
        "src/tdint/assessment/stability/stability.py": "linear",
        "src/tdint/response/spectra/elastic.py": "exact",
        "src/tdint/ground_motion/choice.py": "linear",
        "src/tdint/ground_motion/processing_steps.py": "linear",
        "src/tdint/assessment/stability/stability_figures.py": "linear",
        "src/tdint/output/figures/spectrum_curves.py": "exact linear",
        "src/tdint/assessment/chart/chart_summary.py": "gap",
    },
    "models with a law": {
        "src/tdint/assessment/failures/failures.py": "gauss4 polynomial tanh",
        "src/tdint/assessment/order/order.py": "bilinear linear polynomial",
        "src/tdint/methods/step_check.py": "bilinear linear peak-oriented tanh",
        "src/tdint/model/capacity.py": "multilinear-pinching",
        "src/tdint/model/mdof_lu.py": "trilinear-pinching",
        "src/tdint/model/story_laws.py": "linear",
    },
    "law whose force is a factor of the tangent damping of its story": {
        "src/tdint/kernels/stories/impact.py": "hertz",
    },
    "options that `test_choices_of_options_are_names_of_the_library` compares": {
        "cli/tdint_cli/assessment/order.py": "linear",
    },
    "methods of references, and of buildings for which they are exact": {
        "cli/tdint_cli/assessment/examples.py": "gauss4 impulse impulse4 linear moment4 rk5",
        "src/tdint/assessment/chart/problem.py": "exact gap impulse4 newmark-average",
        "src/tdint/studies/recordings/compare.py": "exact",
    },
    "published examples": {
        "src/tdint/assessment/examples/paper_examples.py": (
            "central-difference impulse newmark-average newmark-linear polynomial rk5 u0v0 wilson"
        ),
        "src/tdint/assessment/validation/validation.py": (
            "bathe bilinear central-difference exact impulse4 moment4 newmark-average "
            "newmark-linear polynomial wilson"
        ),
    },
    "methods and laws that another program provides, too": {
        "src/tdint/assessment/chart/peers.py": (
            "bilinear bouc-wen gap generalized-alpha hht linear newmark-average polynomial tanh"
        )
    },
    "lines of a figure, in their order": {
        "cli/tdint_cli/assessment/overshoot.py": "central-difference",
        "cli/tdint_cli/assessment/stability.py": "impulse",
        "cli/tdint_cli/assessment/method_options.py": (
            "bathe central-difference generalized-alpha hht impulse impulse4 moment4 "
            "newmark-average"
        ),
        "src/tdint/assessment/chart/performance_profiles.py": (
            "bathe central-difference exact gauss4 generalized-alpha hht impulse impulse4 moment4 "
            "newmark-average newmark-linear noh-bathe wilson"
        ),
        "src/tdint/assessment/chart/work_precision.py": (
            "bathe central-difference exact gauss4 generalized-alpha impulse impulse4 moment4 "
            "newmark-average newmark-linear noh-bathe"
        ),
        "src/tdint/assessment/chart/chart_figures.py": "impulse4 moment4 newmark-average",
        "src/tdint/output/figures/style.py": (
            "bathe central-difference exact gauss4 generalized-alpha hht impulse impulse4 moment4 "
            "newmark-average newmark-linear wilson"
        ),
    },
    "format of files that no other format recognizes": {
        "src/tdint/ground_motion/reading/contents.py": "TEXT"
    },
}
"""Modules outside of the directories of `HOMES_OF_NAMES` with names, by the reason."""


def names_in(parts):
    """Return the names of laws, methods and formats among the texts of a module, without
    docstrings. A name can be followed by parameters, as in `newmark:beta=0.25`. `parts` are all
    nodes of the syntax tree."""
    names = {name for found in HOMES_OF_NAMES.values() for name in found}
    docstrings = {id(node.value) for node in parts if isinstance(node, ast.Expr)}
    texts = [
        re.sub(r":\w+=.*", "", node.value)
        for node in parts
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in docstrings
    ]
    return names.intersection(texts)


def test_names_of_laws_methods_and_formats_are_in_their_modules():
    """A property of a law, method or format is a field of its declaration, not a table of names or
    a comparison with a name in another module."""
    allowed = defaultdict(set)
    for files in NAMED_ELSEWHERE.values():
        for path, names in files.items():
            allowed[path].update(names.split())
    found = {}
    for _, path, parts in trees():
        elsewhere = {
            name
            for name in names_in(parts)
            if not any(
                path.startswith(home) and name in HOMES_OF_NAMES[home] for home in HOMES_OF_NAMES
            )
        }
        if elsewhere:
            found[path] = elsewhere
    assert found == allowed


def test_table_of_names_is_found():
    lines = ('"""linear."""', 'STIFF = {"gap": 1}', 'law.name == "tanh"', 'M = "newmark:beta=0"')
    source = "\n".join([*lines, "DEFAULT = 'exact: '"])
    assert names_in(list(ast.walk(ast.parse(source)))) == {"gap", "tanh", "newmark"}


def test_choices_of_options_are_names_of_the_library():
    """These options name laws without the import of the modules that use them."""
    from tdint.assessment.order.order import STORY_LAWS
    from tdint_cli.main import cli

    for command, known in (("order", STORY_LAWS),):
        parameters = cli.get_command(None, command).params
        (option,) = (parameter for parameter in parameters if parameter.name == "law")
        assert list(option.type.choices) == list(known)


def test_imported_packages_are_dependencies():
    """Imported packages are in the Python standard library, or among the dependencies and extras of
    the project."""
    project = PROJECT["project"]
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


def is_bare(node):
    """Return True if a name is bound to a number, or to a formula of numbers only."""
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


def test_modules_with_equal_names_are_imported_with_their_folder():
    """In one call of pytest, only the first of two modules of tests with the same name is found."""
    files = [file for file in (ROOT / "tests").rglob("*.py") if file.name != "conftest.py"]
    stems = [file.stem for file in files if not file.stem.startswith("test_")]
    ambiguous = {stem for stem in stems if stems.count(stem) > 1}
    assert "run" in ambiguous
    # Parsing all files takes seconds. Only those are parsed that contain such a name, and not a
    # member of a package, in an import.
    names = "|".join(ambiguous)
    named = re.compile(
        rf"^\s*(?:from\s+(?:{names})\s|import\s(?:.*[\s,])?(?:{names})\s*(?:,|as\s|;|#|$))",
        re.MULTILINE,
    )
    assert all(map(named.search, ("def f():\n    import run as a\n", "from run import b")))
    texts = {file: file.read_text(encoding="utf-8").replace("\\\n", " ") for file in files}
    suspected = [file for file, text in texts.items() if named.search(text)]
    bare = [
        (file.relative_to(ROOT).as_posix(), name)
        for file in suspected
        for node in ast.walk(ast.parse(texts[file]))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in (
            [node.module]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
        )
        if name in ambiguous
    ]
    assert bare == []


def test_constants_have_comments():
    """A comment or a docstring next to the constant, or to its group, states its meaning or the
    reason for its value."""
    bare = []
    for _, path, (tree, *_) in trees():
        lines = (ROOT / path).read_text(encoding="utf-8").splitlines()
        for node in filter(is_bare, tree.body):
            first, last = node.lineno - 1, node.end_lineno
            while first and lines[first - 1].strip():
                first -= 1
            while last < len(lines) and lines[last].strip():
                last += 1
            has_comment = any(line.startswith(("#", '"""')) for line in lines[first:last])
            if not has_comment and "#" not in "".join(lines[node.lineno - 1 : node.end_lineno]):
                bare.append(f"{path}:{node.lineno}")
    assert bare == []


@pytest.mark.parametrize("layer", [*LAYERS, "cli", "ground"])
def test_functions_take_at_most_eight_arguments(layer):
    """Exceptions are kernels, which are entered with flat arguments, and functions that call
    through an address."""
    long = []
    for found, path, node in nodes(ast.FunctionDef):
        count = len(node.args.posonlyargs) + len(node.args.args) + len(node.args.kwonlyargs)
        # Overloads repeat the signature of a function that is counted.
        is_overload = any(ast.unparse(decorator) == "overload" for decorator in node.decorator_list)
        if found == layer and count > 8 and not is_border(node) and not is_overload:
            long.append(f"{path}: {node.name} {count}")
    assert len(long) <= LONG_SIGNATURES.get(layer, 0), long


def is_border(node):
    """Return True if a function is compiled separately (`@kernel`) or calls through an address
    (`@intrinsic`, `call_...`)."""
    decorators = [ast.unparse(decorator).partition("(")[0] for decorator in node.decorator_list]
    return bool({"kernel", "intrinsic"} & set(decorators)) or node.name.startswith("call_")


MAX_CODE_LINES = 700
"""Code lines of one file. Docstrings, comments and blank lines are not counted, so that they have
room."""


def test_code_lines_per_file_are_limited():
    counts = {path: len(code_lines(parts)) for _, path, parts in trees()}
    assert {path: count for path, count in counts.items() if count > MAX_CODE_LINES} == {}


IMPORTERS = {
    "click": r"cli/.*",
    "obspy": r"src/tdint/ground_motion/.*",
    "yaml": r"src/tdint/model/keys/.*",
    "matplotlib": r"src/tdint/output/figures/.*|.*_figures\.py",
}
"""Paths of the modules that import a package at run time, as src/README.md states under Layers."""


@pytest.mark.parametrize("package", IMPORTERS)
def test_packages_are_imported_where_the_page_states_it(package):
    for_types = {
        id(part)
        for _, _, node in nodes(ast.If)
        if ast.unparse(node.test).endswith("TYPE_CHECKING")
        for statement in node.body
        for part in ast.walk(statement)
    }
    imports = [(path, node, node.module or "") for _, path, node in nodes(ast.ImportFrom)]
    imports += [(path, node, a.name) for _, path, node in nodes(ast.Import) for a in node.names]
    found = {
        path
        for path, node, name in imports
        if name.split(".")[0] == package and id(node) not in for_types
    }
    assert found
    assert [path for path in sorted(found) if not re.fullmatch(IMPORTERS[package], path)] == []
