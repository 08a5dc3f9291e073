"""Reference pages of the Python interface, written from signatures and docstrings.

`make_site.py` adds these pages to the site: one page for each group of public names of `tdint`, and
one for `tdint.plugin`.
"""

from __future__ import annotations

import functools
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import tdint
import tdint.plugin
from tdint.tabular import Tabular

ROOT = Path(__file__).parents[1]

FOLDER = "src/reference"
"""Directory of the pages in the sources of the site."""

GROUPS = {
    "models": ("Models", ("tdint.model",)),
    "records": (
        "Records and suites",
        (
            "tdint.ground_motion",
            "tdint.studies.motions.matching",
            "tdint.studies.motions.scaling",
            "tdint.studies.motions.selection",
            "tdint.output.tables.spectra",
        ),
    ),
    "runs": (
        "Runs",
        (
            "tdint.response.runs",
            "tdint.response.overview",
            "tdint.response.static.cyclic",
            "tdint.response.static.pushover",
            "tdint.response.static.target_displacement",
        ),
    ),
    "spectra": ("Spectra", ("tdint.response.spectra",)),
    "studies": ("Studies of many runs", ("tdint.studies",)),
    "methods": (
        "Methods",
        ("tdint.methods", "tdint.assessment", "tdint.assessment.chart", "tdint.response"),
    ),
    "results": ("Results and errors", ("tdint.",)),
}
"""Title of each page, and the modules that define its names. The first match is used, so a name of
`tdint.studies.motions.scaling` is on the page of records."""

PLUGIN_PAGE = "plug-ins"
TABLE_PAGE = "results"
"""Page of the members that all results with a table share."""

_SECTION = re.compile(r"^([A-Z]\w+(?: \w+)?)\n-{3,}\n", re.MULTILINE)
_ENTRIES = {"Parameters", "Attributes", "Returns", "Yields", "Raises", "Warns", "Methods"}
_MENTION = re.compile(r"(?<!\[)`tdint\.(\w+)(?:\([^`]*\))?`(?!\])")


def public_names() -> dict[str, str]:
    """Return the page of each public name of `tdint`."""
    found = {}
    for name in dir(tdint):
        if name.startswith("_"):
            continue
        home = _module_of(public_object(name))
        found[name] = next(
            page
            for page, (_, modules) in GROUPS.items()
            if any(f"{home}.".startswith(module) for module in modules)
        )
    return found


def public_object(name: str) -> Any:
    """Return the function or class of a public name; `tdint.methods` is also a package."""
    return tdint.__getattr__(name)


def reference_pages(repository: str = "") -> dict[str, str]:
    """Return the Markdown of all reference pages by their paths in the sources of the site.

    With the address of a repository, the module of each name links to its file.
    """
    pages = {}
    homes = public_names()
    for page, (title, _) in GROUPS.items():
        names = [name for name, home in homes.items() if home == page]
        names.sort(key=lambda name: inspect.isclass(public_object(name)))
        parts = [f"# Python API reference: {title}", _index(names)]
        parts += [_entry("tdint", name, public_object(name), repository) for name in names]
        if page == TABLE_PAGE:
            parts += [_tables()]
        pages[f"{FOLDER}/{page}.md"] = "\n\n".join(parts) + "\n"
    names = [name for name in dir(tdint.plugin) if name in tdint.plugin.PLUGIN]
    parts = ["# Python API reference: plug-ins", _prose(inspect.getdoc(tdint.plugin) or "")]
    parts += [_index(names)]
    parts += [
        _entry("tdint.plugin", name, getattr(tdint.plugin, name), repository) for name in names
    ]
    pages[f"{FOLDER}/{PLUGIN_PAGE}.md"] = "\n\n".join(parts) + "\n"
    return pages


def link_mentions(text: str, prefix: str) -> str:
    """Return Markdown with a link from each public name, such as `tdint.run`, to its reference.

    Parameters
    ----------
    text : str
        Markdown without code blocks.
    prefix : str
        Relative path from the directory of the page to the root of the sources, "" or "../../".
    """
    homes = public_names()

    def linked(match: re.Match[str]) -> str:
        name = match[1]
        if name not in homes:
            return match[0]
        return f"[{match[0]}]({prefix}{FOLDER}/{homes[name]}.md#{anchor(name)})"

    return _MENTION.sub(linked, text)


def anchor(name: str) -> str:
    """Return the anchor of a public name, which differs for `Chart` and `chart`."""
    return f"tdint-{name.lower()}{'-class' * name[0].isupper()}"


def _module_of(thing: Any) -> str:
    """Return the module that defines a function or class; a package that can be called counts."""
    thing = inspect.unwrap(thing)
    return str(getattr(thing, "__module__", None) or getattr(thing, "__name__", "tdint"))


def _index(names: list[str]) -> str:
    """Return a list of links to the entries of a page."""
    return ", ".join(f"[`{name}`](#{anchor(name)})" for name in names)


def _entry(package: str, name: str, thing: Any, repository: str) -> str:
    """Return the section of a public name: signature, docstring, members of a class, source.

    Parameters
    ----------
    package : str
        Package that contains the name.
    name : str
        Public name.
    thing : object
        Function, class or constant of this name.
    repository : str
        Address of the repository, or "".
    """
    parts = [f"## {package}.{name} {{ #{anchor(name)} }}"]
    if callable(thing):
        parts.append(_signature(f"{package}.{name}", thing))
    if isinstance(thing, str | int | float | tuple):
        parts.append(f"    {name} = {thing!r}")
    else:
        parts.append(_docstring(inspect.getdoc(thing) or ""))
    if inspect.isclass(thing):
        parts += [_member(name, member, value) for member, value in _members(thing)]
        if issubclass(thing, Tabular):
            parts.append(f"Also: {_shared_members(thing)}, see [tables]({TABLE_PAGE}.md#tables).")
    parts.append(f"Defined in {_source(_module_of(thing), repository)}.")
    return "\n\n".join(filter(None, parts))


def _source(module: str, repository: str) -> str:
    """Return the name of a module, with a link to its file if the repository has an address."""
    path = f"src/{module.replace('.', '/')}"
    file = f"{path}.py" if (ROOT / f"{path}.py").is_file() else f"{path}/__init__.py"
    return f"[`{module}`]({repository}/blob/main/{file})" if repository else f"`{module}`"


def _tables() -> str:
    """Return the section of the members that all results with a table share."""
    parts = ["## Tables { #tables }", "Each result that is a table has the following members."]
    parts += [_member("Tabular", member, value) for member, value in _members(Tabular)]
    return "\n\n".join(parts)


def _shared_members(kind: type) -> str:
    """Return the names of the members that a result inherits from `Tabular`."""
    names = [name for name, value in _members(Tabular) if getattr(kind, name) is value]
    return ", ".join(f"`{name}`" for name in names)


def _members(kind: type) -> Iterator[tuple[str, Any]]:
    """Yield the documented public methods and properties that classes of tdint define.

    Members that a result inherits from `Tabular` are described by `_tables`.
    """
    homes = [
        base
        for base in kind.__mro__
        if base.__module__.startswith("tdint") and (base is not Tabular or kind is Tabular)
    ]
    for member in sorted({name for base in homes for name in vars(base)}):
        value = getattr(kind, member)
        is_documented = callable(value) or isinstance(value, property | functools.cached_property)
        if not member.startswith("_") and is_documented and inspect.getdoc(value):
            yield member, value


def _member(owner: str, name: str, value: Any) -> str:
    """Return the section of a method or property."""
    heading = f"### {owner}.{name}"
    if isinstance(value, property | functools.cached_property) or inspect.isclass(value):
        return f"{heading}\n\n{_docstring(inspect.getdoc(value) or '')}"
    return f"{heading}\n\n{_signature(name, value)}\n\n{_docstring(inspect.getdoc(value) or '')}"


def _signature(name: str, function: Callable[..., Any]) -> str:
    """Return a code block with the signature, one parameter a line if it is long."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return ""
    # Annotations are strings here; without this they would be printed in quotation marks.
    if inspect.isclass(function):
        signature = signature.replace(return_annotation=inspect.Signature.empty)
    line = name + re.sub(r"'([^']*)'(?=[,)= ]|$)", r"\1", str(signature))
    if len(line) > 80:
        parts = [str(parameter) for parameter in signature.parameters.values()]
        plain = [re.sub(r": '([^']*)'", r": \1", part) for part in parts]
        plain = [re.sub(r"<function .*?>", "...", part) for part in plain]
        plain = [line for part in plain for line in _parameter_lines(part)]
        result = line.rpartition(" -> ")[2] if " -> " in line else ""
        line = f"{name}(\n    " + "\n    ".join(plain) + "\n)" + (f" -> {result}" if result else "")
    return f"```python\n{line}\n```"


def _parameter_lines(parameter: str) -> list[str]:
    """Return a parameter with its comma; long types and defaults are broken at spaces."""
    return textwrap.wrap(
        f"{parameter},",
        80,
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def _docstring(text: str) -> str:
    """Return the Markdown of a NumPy docstring: prose, and a definition list for each section."""
    first, *sections = _SECTION.split(text)
    parts = [_prose(first)]
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        rendered = _definitions(body) if title in _ENTRIES else _prose(body)
        parts.append(f"**{title}**\n\n{rendered}")
    return "\n\n".join(filter(None, parts))


def _definitions(body: str) -> str:
    """Return a definition list of the entries of a section; an entry starts in the first column."""
    entries = re.split(r"\n(?=\S)", inspect.cleandoc(body))
    lines = []
    for entry in entries:
        heading, _, description = entry.partition("\n")
        text = " ".join(inspect.cleandoc(description).split())
        lines.append(f"`{heading.strip()}`\n:   {_escaped(text) or '-'}")
    return "\n\n".join(lines)


def _prose(text: str) -> str:
    """Return paragraphs with doctests and indented formulas as code."""
    parts = []
    for block in re.split(r"\n\n+", inspect.cleandoc(text)):
        if block.startswith(">>>"):
            parts.append(f"```pycon\n{block}\n```")
        elif block.startswith("    "):
            parts.append(block)
        elif block:
            parts.append(_escaped(" ".join(block.split())))
    return "\n\n".join(parts)


def _escaped(text: str) -> str:
    """Escape the characters of Markdown outside backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [re.sub(r"([*_\[\]])", r"\\\1", part.replace("<", "&lt;")) for part in parts[::2]]
    return "".join(parts)
