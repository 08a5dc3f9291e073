"""Build the site: python .github/make_site.py [DIR] writes DIR/site, by default build/site.

Its pages are sections of the READMEs, arranged by task (`page_sections.py`), the glossary and the
changelog, and generated pages: one for each command (`--help-all`), for each method (equations,
parameters, figure of stability, publications), and for each file that a README links.
`pip install '.[site]'` installs the generator; `.github/site.yml` contains its settings.
"""

from __future__ import annotations

import ast
import inspect
import math
import posixpath
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))  # for python_reference, if a test loads this file

import click
import numpy as np
import yaml
from narrow_code import narrow_blocks
from page_sections import FENCE, assemble, split_sections
from python_reference import FOLDER as REFERENCE
from python_reference import GROUPS, PLUGIN_PAGE, link_mentions, reference_pages

import tdint
from tdint.methods.catalogue import catalogue, parse
from tdint.methods.method import Integrator
from tdint.methods.publications import references_of
from tdint_cli.main import COMMANDS, cli
from tdint_cli.options.grammar import GENERAL, ORDER, Command

ROOT = Path(__file__).parents[1]
SETTINGS = ROOT / ".github" / "site.yml"
ASSETS = (ROOT / ".github" / "site.css", ROOT / ".github" / "copy.js")
METHODS = "src/tdint/methods"
PICTURES = {".png", ".svg", ".pdf"}
_LANGUAGES = {".yaml": "yaml", ".py": "python"}
_LINK = re.compile(r"\]\((?!\w+:)([^)\s#]+)(#[^)\s]*)?\)")
_CHECKOUT = re.compile(r"<!-- checkout -->.*?<!-- end: checkout -->\n", re.DOTALL)
_FIRST_RUN = """
## Install

Install tdint in a virtual environment{source}:

```sh
python3 -m venv .venv && . .venv/bin/activate
{install}
```
"""
_COPY = """
The tutorials and the example models use files of the repository:

```sh
git clone {repository}
```
"""
_PICTURE = re.compile(r"^!\[[^]]*\]\([^)]*\)\n\n", re.MULTILINE)
_CAPTION = "`tdint run --plot` plots the response, here of a yielding six-story frame:\n\n"
_COEFFICIENTS = re.compile(r"^# Coefficients.*\n((?:[A-Z]\w* = \d+.*\n)+)", re.MULTILINE)

STEPS = np.geomspace(1e-3, 1e3, 400)
"""dt/T of the figures: the default of `tdint stability`."""

REFERENCE_METHOD = "newmark-average"
"""Method in the figure of each method, for comparison: most programs have it."""


# ---- Pages that are files of the repository


def readmes() -> list[Path]:
    """Return the pages that are written by hand."""
    folders = (ROOT / name for name in ("cli", "configs", "records", "src", "tests"))
    return [
        ROOT / "README.md",
        ROOT / "CHANGELOG.md",
        *(file for one in folders for file in sorted(one.rglob("*.md"))),
    ]


def links(page: str, text: str) -> Iterator[str]:
    """Yield the targets of links within the repository, as paths from its root."""
    for part in FENCE.split(text)[::2]:
        for target, _ in _LINK.findall(part):
            yield posixpath.normpath(posixpath.join(posixpath.dirname(page), target))


def sections_of(text: str) -> list[str]:
    """Return the sections of a README, each from its heading to the next heading."""
    return [section.text for section in split_sections(text)][1:]


def page_of_file(name: str) -> str:
    """Return the page of a path in the repository: its text, its figure, or a README's page."""
    file = ROOT / name
    if file.is_dir():
        return posixpath.join(name, "README.md")
    return f"{name}.md" if is_shown(file) else name


def is_shown(file: Path) -> bool:
    """Return True if a file has a separate page, which shows its text."""
    return file.suffix not in {".md", *PICTURES}


def shown(name: str) -> str:
    """Return the page of a file, which shows its text."""
    file = ROOT / name
    return f"# {file.name}\n\n`{name}`\n\n````{_LANGUAGES.get(file.suffix, 'text')}\n{file.read_text('utf-8')}````\n"  # noqa: E501


def modules_of(name: str) -> str:
    """Return the page of a source directory without a README: its modules and their first
    sentences."""
    listed = [f"# {name}\n"]
    for file in sorted((ROOT / name).glob("*.py")):
        first = (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").split("\n\n")[0]
        listed.append(f"- `{file.name}`: {' '.join(first.split())}")
    return "\n".join(listed) + "\n"


def with_links_to_methods(text: str) -> str:
    """Return the table of methods with a link to the page of each method.

    The column of parameters is removed, since these pages contain the parameters.
    """
    begin, table, rest = re.split(
        r"^<!-- (?:generated: methods|end: methods) -->\n", text, flags=re.MULTILINE
    )
    rows = [re.sub(r"^(\|[^|]*\|)[^|]*\|", r"\1", row) for row in table.splitlines()]
    rows = [re.sub(r"^\| `([\w-]+)` ", r"| [`\1`](\1.md) ", row) for row in rows]
    return begin + "\n".join(rows) + "\n" + rest


def with_links_to_commands(text: str) -> str:
    """Return the index of commands with a link from each command to its page."""
    return re.sub(r"^- `tdint ([\w-]+)`:", r"- [`tdint \1`](\1.md):", text, flags=re.MULTILINE)


def with_links_to_reference(page: str, text: str) -> str:
    """Return a page with links from Python names outside code to their reference."""
    prefix = "../" * page.count("/")
    parts = FENCE.split(text)
    parts[::2] = [link_mentions(part, prefix) for part in parts[::2]]
    return "".join(parts)


def is_published() -> bool:
    """Return True if this version was released, and is therefore on the package index."""
    return bool(re.search(r"^date-released:", (ROOT / "CITATION.cff").read_text("utf-8"), re.M))


def home(text: str) -> str:
    """Return the first page with an installation that needs no checkout, above the figure.

    A released version is installed from the package index. Otherwise it is installed from the
    repository in `pyproject.toml`, [tool.tdint], or from a copy if the address is empty.
    """
    repository = addresses()["repository"]
    install, source = "pip install PATH/OF/TDINT", ", from a copy of its repository"
    if is_published():
        install, source = "pip install tdint", ""
    elif repository:
        install, source = f"pip install git+{repository}", ", from its repository"
    lines = _FIRST_RUN.format(install=install, source=source)
    if repository:
        lines += _COPY.format(repository=repository)
    picture = _PICTURE.search(text)
    assert picture is not None
    text = _CHECKOUT.sub(lambda _: lines, _PICTURE.sub("", text, count=1))
    text = text.replace("## Quick start", f"{_CAPTION}{picture[0]}## Quick start", 1)
    # Pages of this directory are no pages of the site.
    text = re.sub(
        r"\[(\w+)\]\((\.github/\S+)\)",
        rf"[\1]({repository}/blob/main/\2)" if repository else r"\1 (`\2`)",
        text,
    )
    return text.replace(
        "In an empty directory, with `.venv/bin` on your `PATH`:", "In an empty directory:"
    )


def addresses() -> dict[str, str]:
    """Return `[tool.tdint]` of pyproject.toml: repository, site and contact, empty if not set."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return {name: value.rstrip("/") for name, value in project["tool"]["tdint"].items()}


# ---- Pages that the program writes


def escaped(text: str) -> str:
    """Escape the characters of Markdown outside backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [re.sub(r"([*_\[\]])", r"\\\1", part.replace("<", "&lt;")) for part in parts[::2]]
    return "".join(parts)


def paragraphs(text: str) -> str:
    """Return a docstring as Markdown: indented formulas as code, all other text as prose."""
    blocks = re.split(r"\n\n+", inspect.cleandoc(text))
    return "\n\n".join(
        block if block.startswith("    ") else escaped(" ".join(block.split())) for block in blocks
    )


def command_page(name: str) -> str:
    """Return the page of a command: the text of `tdint NAME --help-all`."""
    command = import_module(COMMANDS[name][0]).command
    assert isinstance(command, Command)
    context = click.Context(
        command,
        parent=click.Context(cli, info_name="tdint", **cli.context_settings),
        info_name=name,
    )
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    parts = [f"# tdint {name}", f"    {usage}", paragraphs(command.help or "")]
    parts += ["## Examples", "```sh\n" + "\n".join(command.examples) + "\n```"]
    for heading in ORDER:
        options = [
            one
            for one in command.get_params(context)
            if getattr(one, "heading", GENERAL) == heading
        ]
        records = [record for one in options if (record := one.get_help_record(context))]
        if records:
            parts += [
                f"## {heading}",
                *(f"`{flags}`\n:   {escaped(text)}" for flags, text in records),
            ]
    if command.exits:
        parts += [
            "## Exit codes",
            "\n".join(f"- {code}: {escaped(meaning)}" for code, meaning in command.exits.items()),
        ]
    return "\n\n".join(parts) + "\n"


def method_page(name: str) -> str:
    """Return the page of a method: properties, equations, figure of stability, publications."""
    integrator = parse(name)
    method = integrator.method
    step = method.family.step.function
    module = sys.modules[step.__module__]
    parts = [f"# {name}", f"Source: {escaped(method.source)}.", facts(integrator)]
    parts += ["## Equations", *map(paragraphs, (module.__doc__ or "", step.__doc__ or ""))]
    parts += [coefficients(integrator, inspect.getsource(module))]
    picture = (
        f"![Spectral radius, period error and damping of {name} over dt/T]({picture_of(name)})"
    )
    parts += [
        "## Stability and accuracy",
        picture,
        f"    tdint stability --method {name},{REFERENCE_METHOD} --plot=stability.png",
    ]
    if publications := references_of(method):
        texts = [f"{one.text} doi:{one.doi}" if one.doi else one.text for one in publications]
        parts += ["## Publications", "\n".join(f"- {escaped(text)}" for text in texts)]
    return "\n\n".join(filter(None, parts)) + "\n"


def facts(integrator: Integrator) -> str:
    """Return a list of parameters, order and limits, for the default parameters."""
    method = integrator.method
    named = zip(method.parameters, integrator.values, strict=True)
    lines = [
        f"parameter `{one.name}`, in {one.range}: {value:.6g} by default" for one, value in named
    ]
    limit = integrator.stability_limit
    lines += [f"order {integrator.order} for a smooth load"]
    lines += [
        "stable at any step"
        if math.isinf(limit)
        else f"stable up to omega dt = {limit:.4g} without damping"
    ]
    if not math.isnan(integrator.rho_inf):
        lines += [f"spectral radius of {integrator.rho_inf:.4g} at very large steps (rho_inf)"]
    lines += ["implicit" if integrator.implicit else "explicit"] + [
        "for linear buildings"
    ] * method.family.linear_only
    return "\n".join(f"- {escaped(line)}" for line in lines)


def coefficients(integrator: Integrator, source: str) -> str:
    """Return the coefficients of a step by their names in the module, for default parameters."""
    found = _COEFFICIENTS.search(source)
    values = integrator.method.coefficients(*integrator.values)
    if found is None or not values:
        return ""
    places = {
        name: int(place) for name, place in re.findall(r"^(\w+) = (\d+)", found[1], re.MULTILINE)
    }
    ends = [*list(places.values())[1:], len(values)]
    lines = [
        f"    {name} = {', '.join(f'{value:.10g}' for value in values[place:end])}"
        for (name, place), end in zip(places.items(), ends, strict=True)
        if place < len(values)
    ]
    return "Coefficients at the defaults:\n\n" + "\n".join(lines)


def picture_of(name: str) -> str:
    """Return the file name of the figure of a method, in the directory of its page."""
    return f"{name}-stability.png"


def draw(name: str, file: Path) -> None:
    """Plot the stability of a method, with the reference method for comparison."""
    curves = [tdint.stability(one, STEPS) for one in dict.fromkeys((name, REFERENCE_METHOD))]
    tdint.plot(curves, file=file)


# ---- The whole


def pages() -> dict[str, str]:
    """Return the Markdown of every page by its path in the sources of the site."""
    texts = {file.relative_to(ROOT).as_posix(): file.read_text("utf-8") for file in readmes()}
    led = {target for page, text in texts.items() for target in links(page, text)}
    files = [name for name in sorted(led) if (ROOT / name).is_file() and is_shown(ROOT / name)]
    texts["README.md"] = home(texts["README.md"])
    texts[f"{METHODS}/README.md"] = with_links_to_methods(texts[f"{METHODS}/README.md"])
    texts["cli/README.md"] = with_links_to_commands(texts["cli/README.md"])
    layout = yaml.safe_load(SETTINGS.read_text("utf-8"))["pages"]
    found = assemble(texts, layout, page_of_file)
    found = {page: with_links_to_reference(page, text) for page, text in found.items()}
    found |= reference_pages(addresses()["repository"])
    found |= {f"cli/{name}.md": command_page(name) for name in COMMANDS}
    found |= {f"{METHODS}/{name}.md": method_page(name) for name in catalogue()}
    found |= {f"{name}.md": shown(name) for name in files}
    folders = [name for name in sorted(led) if (ROOT / name).is_dir()]
    found |= {
        page: modules_of(name)
        for name in folders
        if name.startswith("src/tdint/") and (page := page_of_file(name)) not in texts
    }
    repository = addresses()["repository"]
    return {
        page: narrow_blocks(text) + edit_links(source_files(page, layout), repository)
        for page, text in found.items()
    }


def source_files(page: str, layout: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the files that contain the text of a page; none for the reference."""
    if page in layout:
        return list(dict.fromkeys(name.partition("#")[0] for name in layout[page]["sections"]))
    folder, name = posixpath.split(page.removesuffix(".md"))
    if (ROOT / page).is_file():
        return [page]
    if folder == "cli" and name in COMMANDS:
        return [f"cli/{COMMANDS[name][0].replace('.', '/')}.py"]
    if folder == METHODS and name in catalogue():
        module = parse(name).method.family.step.function.__module__
        return [f"src/{module.replace('.', '/')}.py"]
    return [posixpath.join(folder, name)] if (ROOT / folder / name).is_file() else []


def edit_links(files: Iterable[str], repository: str) -> str:
    """Return a line with a link for editing each file; empty without a repository."""
    links_to = [f"[`{file}`]({repository}/edit/main/{file})" for file in files]
    return f"\nEdit: {', '.join(links_to)}\n" if repository and links_to else ""


def pictures() -> list[str]:
    """Return the images of READMEs, as paths from the root."""
    texts = ((file.relative_to(ROOT).as_posix(), file.read_text("utf-8")) for file in readmes())
    return sorted(
        {one for page, text in texts for one in links(page, text) if Path(one).suffix in PICTURES}
    )


def settings(names: Iterable[str]) -> dict[str, Any]:
    """Return the settings of the generator, with the lists of pages filled in."""
    found: dict[str, Any] = yaml.safe_load(SETTINGS.read_text("utf-8"))
    del found["pages"]
    models = (name for name in names if re.fullmatch(r"configs/[\w-]+\.yaml\.md", name))
    lists: dict[str, list[Any]] = {
        "...cli": [{f"tdint {name}": f"cli/{name}.md"} for name in COMMANDS],
        "...methods": [{name: f"{METHODS}/{name}.md"} for name in catalogue()],
        "...configs": [{Path(name).name.partition(".")[0]: name} for name in models],
    }

    lists["...reference"] = [
        *({title: f"{REFERENCE}/{page}.md"} for page, (title, _) in GROUPS.items()),
        {"Plug-ins": f"{REFERENCE}/{PLUGIN_PAGE}.md"},
    ]
    place = addresses()
    if place["repository"]:
        found["repo_url"] = place["repository"]
    if place["site"]:
        found["site_url"] = f"{place['site']}/"

    def filled(entries: list[Any]) -> list[Any]:
        result: list[Any] = []
        for entry in entries:
            if isinstance(entry, str):
                result += lists[entry]
            else:
                ((title, inner),) = entry.items()
                result.append({title: filled(inner) if isinstance(inner, list) else inner})
        return result

    return found | {"nav": filled(found["nav"])}


def write(folder: Path) -> None:
    """Write the input of the generator to a directory: settings, pages, images."""
    shutil.rmtree(folder / "source", ignore_errors=True)
    texts = pages()
    for name, text in texts.items():
        file = folder / "source" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    for name in pictures():
        (folder / "source" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, folder / "source" / name)
    for asset in ASSETS:
        shutil.copyfile(asset, folder / "source" / asset.name)
    for name in catalogue():
        draw(name, folder / "source" / METHODS / picture_of(name))
    (folder / SETTINGS.name).write_text(
        yaml.safe_dump(settings(texts), sort_keys=False), encoding="utf-8"
    )


def build(folder: Path) -> int:
    """Build the site in folder/site and return the exit code; a broken link is an error."""
    write(folder)
    generator = [sys.executable, "-m", "zensical", "build", "--strict", "--clean"]
    return subprocess.run([*generator, "--config-file", folder / SETTINGS.name]).returncode


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build"
    sys.exit(build(folder.absolute()))
