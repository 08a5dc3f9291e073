"""What a compiled kernel depends on: the modules that it is made of, and no others."""

import ast
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import tdint
from tdint.analysis.run.prepared import of_everything
from tdint.kernels.building import sources
from tdint.kernels.building.store import folder_name
from tdint.kernels.laws import LAWS

PACKAGE = Path(tdint.__file__).parent
MODULES = {name: name.partition(":")[0] for name in sorted({kernel.name for kernel, _ in of_everything()})}
DIGESTS = f"""
from tdint.kernels.building.sources import digest
for name in {list(MODULES)}:
    print(name, digest(name), digest(name, ("linear",)))
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the package."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(PACKAGE, folder / "tdint", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture(scope="module")
def digests(copy):
    """Of the kernels of the copy as it is: with all laws, in a linear building."""
    return [line.split() for line in printed(DIGESTS, copy).splitlines()]


def printed(code, folder):
    """What a program prints that has the package in a folder."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout


@pytest.fixture
def changed(copy, digests):
    """The kernels that are compiled anew after an edit of a file: with all laws, in a linear building."""

    def edit(file, text="# A remark\n"):
        path = copy / "tdint" / file
        old = path.read_text()
        path.write_text(old + text)
        try:
            after = [line.split() for line in printed(DIGESTS, copy).splitlines()]
        finally:
            path.write_text(old)
        pairs = list(zip(digests, after, strict=True))
        return [{before[0] for before, now in pairs if before[k] != now[k]} for k in (1, 2)]

    return edit


def test_the_module_of_a_law_has_its_name():
    """By which those that a kernel is compiled without are found."""
    for law in LAWS:
        assert law.functions.__module__ == "tdint.kernels.laws." + law.name.replace("-", "_")


@cache
def imported(file):
    """What a file imports of kernels and methods, as parsing finds it."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file} imports from a place that is not named"
            found += [node.module, *(f"{node.module}.{name.name}" for name in node.names)]
        elif isinstance(node, ast.Import):
            found += [name.name for name in node.names]
    return found


def file_of(module):
    """The source of a module of the package, None for another name."""
    path = PACKAGE.parent.joinpath(*module.split("."))
    return next((one for one in (path.with_suffix(".py"), path / "__init__.py") if one.is_file()), None)


@pytest.mark.parametrize("name", MODULES)
def test_what_a_kernel_imports_is_found_as_by_parsing(name):
    found, new = set(), [MODULES[name]]
    while new:
        module = new.pop()
        if module not in found and (file := file_of(module)) and not module.startswith("tdint.kernels.building."):
            found.add(module)
            new += [one for one in imported(file) if one.startswith(("tdint.kernels", "tdint.methods"))]
    assert set(sources.closure(MODULES[name])) == found | set(sources._COMPILING)


def test_an_edit_of_a_method_leaves_the_kernels_of_others(changed):
    assert changed("methods/bathe.py") == [{"tdint.methods.bathe:step"}] * 2
    assert changed("kernels/building/obtaining.py") == [set(), set()]


def test_an_edit_at_two_removes_counts(changed):
    everything, linear = changed("kernels/layout.py", "\nNO_ROW = 7\n")
    assert everything == linear
    assert "tdint.methods.impulse4:step" in everything
    assert "tdint.kernels.oscillators.elastic:peaks" not in everything


def test_a_law_that_is_left_out_does_not_count(changed):
    everything, linear = changed("kernels/laws/imk.py")
    assert "tdint.methods.moment4:step" in everything
    assert not linear
    assert changed("kernels/building/compiler.py") == [set(MODULES)] * 2


def test_a_kernel_outside_the_package_counts_by_its_file_and_what_that_imports(tmp_path, copy):
    shutil.copy(Path(__file__).parents[1] / "small_kernel.py", copy / "small.py")
    code = "import small; from tdint.kernels.building.sources import digest, closure; "
    both = code + "print(digest('small:scaled'), *closure('small'))"
    first, *modules = printed(both, copy).split()
    assert {"small", "tdint.kernels.march.march", "tdint.kernels.layout"} <= set(modules)
    own = copy / "small.py"
    own.write_text(own.read_text().replace("2.0 * x", "3.0 * x"))
    assert printed(both, copy).split()[0] != first


def test_versions_alone_name_the_folder(copy):
    code = "from tdint.kernels.building.store import folder_name; print(folder_name())"
    (copy / "tdint" / "kernels" / "stepping.py").write_text("CLOSE = 1.0\n")
    assert printed(code, copy).strip() == folder_name()
