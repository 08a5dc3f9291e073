"""Docstrings and comments state what the code does not show: the part that a program can check."""

import ast
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from docstring_sections import entries
from readmes import ROOT
from tdint.public_names import DEFINED_AS, PLUGIN, PUBLIC

SOURCES = sorted((ROOT / "src").rglob("*.py")) + sorted((ROOT / "cli").rglob("*.py"))
KERNELS = ("src/tdint/kernels/", "src/tdint/methods/")
HALF_LINE = 50
"""Characters of half a line."""

ARTICLES = {"a", "an", "the", "of"}


class Definition(NamedTuple):
    """Function or class with a docstring; `is_private` also for nested functions."""

    name: str
    docstring: str
    is_private: bool
    is_exported: bool


@cache
def exported():
    """Modules and names that `tdint` and `tdint.plugin` export."""
    names = [*PUBLIC.items(), *PLUGIN.items()]
    return {(module, DEFINED_AS.get(name, name)) for name, module in names}


@cache
def tree_of(source):
    """Return the syntax tree of a module; several tests read each module."""
    return ast.parse(source)


def statements(parent):
    """Yield the statements inside a statement or module, without their expressions."""
    for field in ("body", "orelse", "handlers", "finalbody", "cases"):
        yield from getattr(parent, field, ())


def docstrings(parent):
    """Yield the docstrings of a module, and of its classes and functions."""
    if isinstance(parent, ast.Module | ast.ClassDef | ast.FunctionDef):
        yield ast.get_docstring(parent) or ""
    for node in statements(parent):
        yield from docstrings(node)


@cache
def definitions(source, module=""):
    """Return functions and classes of a module that have a docstring.

    The base class of an exported class counts as exported, because its methods are inherited.
    """
    found = []
    tree = tree_of(source)
    names = {name for origin, name in exported() if origin == module}
    names |= {
        base.id
        for node in tree.body
        if isinstance(node, ast.ClassDef) and node.name in names
        for base in node.bases
        if isinstance(base, ast.Name)
    }

    def add(parent, within, is_private, is_exported):
        for node in statements(parent):
            if not isinstance(node, ast.FunctionDef | ast.ClassDef):
                add(node, within, is_private, is_exported)
                continue
            name = f"{within}{node.name}"
            is_special = node.name.startswith("__")
            private = is_private or (node.name.startswith("_") and not is_special)
            public = is_exported or (not within and node.name in names)
            if text := ast.get_docstring(node):
                found.append(Definition(name, text, private, public))
            is_function = isinstance(node, ast.FunctionDef)
            add(node, f"{name}.", private or is_function, public)

    add(tree, "", False, False)
    return found


def vocabulary(docstring):
    """Names that the docstring of `kernels/layout.py` defines for all kernels."""
    names = set()
    for line in docstring.splitlines():
        if match := re.match(r"    (\w+(?:, \w+)*)(?:  |$)", line):
            names.update(name for name in match[1].split(", ") if not name.startswith("_"))
    return names


def of_vocabulary(source, module, names):
    """Return entries of Parameters that describe a name of the vocabulary again."""
    return [
        f"{each.name}: {', '.join(given)}"
        for each in definitions(source, module)
        if not each.is_exported
        for given, _, _ in entries(each.docstring)
        if set(given) <= names
    ]


def needless_sections(source, module):
    """Return private functions with a Parameters section that has only short entries."""
    return [
        each.name
        for each in definitions(source, module)
        if each.is_private and not each.is_exported
        if (given := entries(each.docstring))
        and all(len(description) <= HALF_LINE for _, _, description in given)
    ]


def _words(text):
    return [word for word in re.findall(r"[a-z]+", text.lower()) if word not in ARTICLES]


def repeating_the_name(source, module):
    """Return entries whose description consists of the words of name and type."""
    return [
        f"{each.name}: {', '.join(given)}"
        for each in definitions(source, module)
        if not each.is_exported
        for given, kind, description in entries(each.docstring)
        if description
        and set(_words(description)) <= {*_words(" ".join(given).replace("_", " ")), *_words(kind)}
    ]


def _sentences(text):
    parts = re.split(r"(?<=[.:;])\s+", " ".join(text.split()))
    return [part.rstrip(".:;") for part in parts if len(part.split()) >= 8]


def repeated_comments(source):
    """Return sentences of comments that are also in a docstring of the module."""
    told = {
        sentence for docstring in docstrings(tree_of(source)) for sentence in _sentences(docstring)
    }
    blocks = [""]
    previous = 0
    for number, line in enumerate(source.splitlines(), 1):
        _, sign, comment = line.partition("# ")
        if sign:
            if number != previous + 1:
                blocks.append("")
            blocks[-1] += f" {comment.strip()}"
            previous = number
    return [sentence for block in blocks for sentence in _sentences(block) if sentence in told]


def _module(path: Path):
    parts = path.relative_to(ROOT).with_suffix("").parts[1:]
    return ".".join(parts).removesuffix(".__init__")


def _failures(check, paths=SOURCES):
    return {
        str(path.relative_to(ROOT)): found
        for path in paths
        if (found := check(path.read_text(encoding="utf-8"), _module(path)))
    }


def test_kernels_do_not_describe_names_of_the_vocabulary_again():
    layout = ROOT / "src" / "tdint" / "kernels" / "layout.py"
    names = vocabulary(ast.get_docstring(ast.parse(layout.read_text(encoding="utf-8"))))
    assert {"i", "link", "law_state", "scratch", "previous", "step_status"} <= names
    kernels = [p for p in SOURCES if p.relative_to(ROOT).as_posix().startswith(KERNELS)]
    assert not _failures(lambda source, module: of_vocabulary(source, module, names), kernels)


def test_private_functions_have_no_section_of_short_entries():
    assert not _failures(needless_sections)


def test_entries_do_not_repeat_name_and_type():
    assert not _failures(repeating_the_name)


def test_comments_do_not_repeat_a_docstring_of_the_module():
    assert not _failures(lambda source, module: repeated_comments(source))


FUNCTION = '''
def {name}(building, i, width):
    """Do something.

    Parameters
    ----------
    building : Building
        {building}
    i : int
        Index of the story.
    width : float
        {width}

    Returns
    -------
    float
        Width of the building.
    """
'''


@pytest.mark.parametrize(
    ("name", "building", "width", "failing"),
    [
        ("area", "Building.", "Width, m.", "vocabulary name"),
        ("area", "With one story.", "Width of the floor, m.", "vocabulary"),
        ("_area", "With one story.", "Width of the floor, m.", "vocabulary section"),
        (
            "_area",
            "With one story.",
            "Width of the floor without its balconies and stairs, m.",
            "vocabulary",
        ),
    ],
)
def test_checks_find_wrong_docstrings(name, building, width, failing):
    source = FUNCTION.format(name=name, building=building, width=width)
    assert bool(of_vocabulary(source, "", {"i", "n"})) == ("vocabulary" in failing)
    assert bool(needless_sections(source, "")) == ("section" in failing)
    assert bool(repeating_the_name(source, "")) == ("name" in failing)


def test_nested_functions_are_private():
    nested = "def outer():\n" + "".join(
        f"    {line}\n" if line else "\n"
        for line in FUNCTION.format(name="area", building="One.", width="m.").splitlines()
    )
    assert needless_sections(nested, "") == ["outer.area"]


def test_exported_names_keep_their_sections():
    module, name = next(iter(exported()))
    source = FUNCTION.format(name=name, building="Building.", width="m.")
    assert not of_vocabulary(source, module, {"i"}) and not repeating_the_name(source, module)


@pytest.mark.parametrize(
    ("comment", "repeats"),
    [
        ("The mean of both forces is the\n    # force of the step.", True),
        ("The mean is more accurate, because the force is curved.", False),
    ],
)
def test_repeated_comments_are_found(comment, repeats):
    source = (
        "def force():\n"
        '    """Compute a force. The mean of both forces is the force of the step."""\n'
        f"    # {comment}\n    return 0.0\n"
    )
    assert bool(repeated_comments(source)) == repeats
