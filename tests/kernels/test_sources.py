"""Dependencies of a compiled kernel: exactly the modules that it consists of."""

import ast
import io
import shutil
import sys
import tokenize
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest

import tdint
from tdint.kernels.building import sources
from tdint.kernels.building.load_or_compile import required
from tdint.kernels.building.store import folder_name
from tdint.kernels.laws import LAWS
from tdint.kernels.stories.law_state import follow
from tdint.response.runs.analysis_kernels import all_kernels

PACKAGE = Path(tdint.__file__).parent
NAMES = sorted({kernel.name for kernel, _ in required(all_kernels())})
LOOPS = {name for name in NAMES if ":law." not in name}
LAWS_PACKAGE = "tdint.kernels.laws"
SMALL = Path(__file__).parents[1] / "small_kernel.py"


def forget():
    """Clear the caches of file contents, so that files are read again."""
    for cached in (
        sources.digest,
        sources.digest_of_all,
        sources._read,
        sources._imported,
        sources._own_file,
    ):
        cached.cache_clear()


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """Return a copy of the package."""
    folder = tmp_path_factory.mktemp("copy") / "tdint"
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture
def copy(copied, monkeypatch):
    """Return a copy of the package whose files are used for the digests."""
    monkeypatch.setattr(sources, "_PACKAGE", copied)
    forget()
    yield copied
    forget()


@pytest.fixture
def changed(copy):
    """Return a function that edits a file and returns the kernels and laws that must be
    recompiled."""

    def digests():
        forget()
        return {name: sources.digest(name) for name in NAMES}

    def edit(file, text="UNUSED = 0\n"):
        before, old = digests(), (copy / file).read_text()
        (copy / file).write_text(old + text)
        after = digests()
        (copy / file).write_text(old)
        return {name for name in NAMES if before[name] != after[name]}

    return edit


def test_module_of_law_has_name_of_law():
    """The process that compiles a law imports this module."""
    for law in LAWS:
        assert law.functions.__module__ == f"{LAWS_PACKAGE}." + law.name.replace("-", "_")


@cache
def imported(file):
    """Return the imports of kernels and methods of a file, determined by parsing."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file} imports from a place that is not named"
            found += [node.module, *(f"{node.module}.{name.name}" for name in node.names)]
        elif isinstance(node, ast.Import):
            found += [name.name for name in node.names]
    return found


def file_of(module):
    """Return the source of a module of the package, and None for another name."""
    path = PACKAGE.parent.joinpath(*module.split("."))
    return next(
        (
            candidate
            for candidate in (path.with_suffix(".py"), path / "__init__.py")
            if candidate.is_file()
        ),
        None,
    )


@pytest.mark.parametrize("name", NAMES)
def test_imports_of_kernel_agree_with_parsed_imports(name):
    found, new = set(), [name.partition(":")[0]]
    if name not in LOOPS:
        new.append(f"{LAWS_PACKAGE}.hooks")
    while new:
        module = new.pop()
        if (
            module not in found
            and (file := file_of(module))
            and not module.startswith("tdint.kernels.building.")
        ):
            found.add(module)
            new += [
                name_of_import
                for name_of_import in imported(file)
                if name_of_import.startswith(("tdint.kernels", "tdint.methods"))
            ]
    assert set(sources.closure(name)) == found | set(sources._COMPILING)


def test_edited_method_does_not_change_other_kernels(changed):
    assert changed("methods/bathe.py") == {"tdint.methods.bathe:step"}
    assert changed("kernels/building/load_or_compile.py") == set()


def test_edited_indirect_import_changes_kernels(changed):
    recompiled = changed("kernels/layout.py", "\nNO_ROW = 7\n")
    assert "tdint.methods.impulse4:step" in recompiled
    assert "tdint.kernels.oscillators.elastic:peaks" not in recompiled


def test_edited_law_changes_only_its_object(changed):
    """The kernels contain only functions of the linear and the bilinear law."""
    assert changed("kernels/laws/imk.py") == {"tdint.kernels.laws.imk:law.imk"}
    assert "tdint.methods.moment4:step" in changed("kernels/laws/bilinear.py")
    assert changed("kernels/building/compiler.py") == set(NAMES)


def test_edited_text_does_not_change_kernels(changed):
    """A docstring or a comment never causes a compilation."""
    for file in ("kernels/layout.py", "methods/bathe.py", "kernels/building/compiler.py"):
        assert changed(file, '\n"""A further docstring: f"no code".\n"""\n\n# A remark\n') == set()


def tokens_of_code(text):
    """Return the tokens of a module without comments and docstrings, joined without white space."""
    kept, begins_line = [], True
    for token in tokenize.tokenize(io.BytesIO(text).readline):
        is_docstring = begins_line and token.type == tokenize.STRING
        if token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING):
            begins_line = True
        elif token.type not in (tokenize.COMMENT, tokenize.NL, tokenize.ENDMARKER):
            begins_line = False
            if not is_docstring:
                kept.append(token.string)
    return "".join("".join(kept).split()).encode()


@pytest.mark.parametrize("folder", ["kernels", "methods"])
def test_hashed_text_contains_the_complete_code(folder):
    """The hash includes each token of each module on which an object file depends, and the
    indentation of its lines."""
    hashed_files = {file for name in NAMES for file in sources.closure(name).values()}
    for file in sorted(hashed_files):
        text = file.read_bytes()
        if file.is_relative_to(PACKAGE / folder):
            code = sources.code_of_text(text)
            assert b"".join(code.split()) == tokens_of_code(text), file
            assert set(code.split(b"\n")) <= {
                sources._COMMENT.sub(b"", line).rstrip() for line in text.split(b"\n")
            }


def test_digest_of_external_kernel_includes_its_imports(tmp_path, copy, monkeypatch):
    small = tmp_path / "small.py"
    small.write_text(SMALL.read_text())
    monkeypatch.setitem(sys.modules, "small", SimpleNamespace(__file__=str(small)))
    first = sources.digest("small:scaled")
    assert {"small", "tdint.kernels.time_loop.loop", "tdint.kernels.layout"} <= sources.closure(
        "small:scaled"
    ).keys()
    small.write_text(SMALL.read_text().replace("2.0 * x", "3.0 * x"))
    forget()
    assert sources.digest("small:scaled") != first


def test_directory_name_depends_only_on_versions(copy):
    before, named, stepping = (
        sources.digest_of_all(),
        folder_name.__wrapped__(),
        copy / "kernels" / "stepping.py",
    )
    text = stepping.read_text()
    stepping.write_text(text + "UNUSED = 0\n")
    forget()
    assert sources.digest_of_all() != before
    assert folder_name.__wrapped__() == named
    stepping.write_text(text)


@pytest.mark.parametrize(("name", "counts"), [("process", False), ("compiler", True)])
def test_modules_of_the_compilation_count_if_objects_depend_on_them(copy, name, counts):
    file = copy / "kernels" / "building" / f"{name}.py"
    before = sources.digest_of_all()
    file.write_text(file.read_text() + "UNUSED = 0\n")
    forget()
    assert (sources.digest_of_all() != before) is counts


def test_kernel_that_calls_laws_is_not_compiled_without_them():
    """Such a kernel is requested with the laws of a building: without them, it would call address
    zero."""
    with pytest.raises(ValueError, match=r"law_state:follow calls laws: use `variant`"):
        _ = follow.compiled
