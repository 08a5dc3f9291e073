"""The documentation site: its pages exist, its links have targets, and its search contains them."""

import inspect
import json
import os
import re
import subprocess
import sys
from html import unescape
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

import pytest
import yaml
from click.testing import CliRunner

import readmes
import tdint
from selection import every
from tdint.methods.catalogue import catalogue
from tdint.methods.publications import references
from tdint_cli.main import COMMANDS, cli

EXTERNAL_LINKS = {"https://zensical.org/"}
"""External links of every page: the generator adds a link to its own site."""


@pytest.fixture(scope="module")
def maker():
    """Program that generates the site."""
    return readmes.program("make_site")


@pytest.fixture(scope="module")
def pages(maker):
    return maker.pages()


def test_every_command_method_and_model_has_a_page(pages):
    commands = {f"cli/{name}.md" for name in COMMANDS}
    methods = {f"src/tdint/methods/{name}.md" for name in catalogue()}
    models = {f"configs/{path.name}.md" for path in (readmes.ROOT / "configs").glob("*.yaml")}
    assert {"CHANGELOG.md"} | commands | methods | models <= set(pages)


def without_code(text):
    return re.sub(r"^````?.*?^````?$", "", text, flags=re.DOTALL | re.MULTILINE)


def bare(text):
    """Return a text without link targets, link marks and code blocks."""
    text = re.sub(r"\]\([^)\s]*\)", "]", without_code(text))
    return re.sub(r"\s+", " ", re.sub(r"[\[\]]", "", text)).strip()


def test_each_section_of_a_readme_is_on_one_page_of_the_site(maker, pages):
    """Sections of README.md may be copied; its installation from a checkout is replaced."""
    contents = {name: bare(text) for name, text in pages.items()}
    for path in readmes.files():
        name = path.relative_to(readmes.ROOT).as_posix()
        for section in maker.sections_of(path.read_text("utf-8")):
            text = bare(section).lstrip("# ")
            if text.startswith(
                ("The methods", "Quick start", "Columns", "Documentation")
            ):  # The site changes these sections.
                continue
            found = [page for page, content in contents.items() if text in content]
            assert len(found) == 1 or (name == "README.md" and found), (name, text[:40], found)
            if len(text) > 100:  # A short section may also be part of another page.
                assert contents[found[0]].count(text) == 1, (name, text[:40])


@pytest.mark.long
def test_tasks_are_listed_in_the_order_of_use(maker, pages):
    guide = maker.settings(pages)["nav"][0]["Guide"]
    titles = [title for entry in guide for title in entry]
    tasks = ["Install", "First run", "Run your own record on your own building"]
    tasks += ["Which method and which step", "Choose and match motions", "Spectra", "Report"]
    tasks += ["Many runs", "Fragility", "Regions", "From Python", "Extend", "Validation"]
    assert [title for title in titles if title in tasks] == tasks
    assert titles[-3:] == ["Benchmark", "Glossary", "Notions"]


def test_pages_of_a_section_contain_its_subsections_with_changed_links(maker):
    texts = {
        "README.md": "# Top\n\n## One\n\n[there](sub/README.md#inner)\n",
        "sub/README.md": "# Sub\n\n## Outer\n\ntext [up](../README.md#one)\n\n### Inner\n\n"
        "```\n# no heading [x](y)\n```\n\n#### Deep\n\n[file](a.yaml)\n\n## Rest\n",
    }
    layout = {"new/page.md": {"title": "New", "purpose": "P.", "sections": ["sub/README.md#inner"]}}
    found = maker.assemble(texts, layout, lambda name: f"{name}.md")
    assert "## Inner\n\n```\n# no heading [x](y)\n```\n\n### Deep" in found["new/page.md"]
    assert "[file](../sub/a.yaml.md)" in found["new/page.md"]
    assert "[there](new/page.md#inner)" in found["README.md"]
    assert "Inner" not in found["sub/README.md"] and "## Rest" in found["sub/README.md"]
    layout["new/page.md"]["sections"] = ["sub/README.md#absent"]
    with pytest.raises(ValueError, match="absent"):
        maker.assemble(texts, layout, str)


# ---- Width of code blocks


FILES = r"LICENSE|\.py\.md$|\.csv\.md$|standard_problems"
"""Pages with unchanged files; `site.css` wraps their lines."""


def test_code_blocks_have_short_lines(pages):
    """Printed output and patches are excluded, because they are shown unchanged."""
    for page, text in pages.items():
        if re.search(FILES, page):
            continue
        for language, code in re.findall(r"^````?(\w*)\n(.*?)^````?$", text, re.DOTALL | re.M):
            lines = [] if language == "diff" else code.splitlines()
            if language in ("console", "pycon", "text", ""):
                lines = [line for line in lines if re.match(r"\$ |>>> |\.\.\. ", line)]
            assert not [line for line in lines if len(line) > 85], page


@pytest.mark.parametrize(
    "path", sorted((readmes.ROOT / "configs").glob("*.yaml")), ids=lambda path: path.stem
)
def test_wrapped_yaml_is_equivalent(maker, path):
    text = path.read_text("utf-8")
    narrow = maker.narrow_blocks(f"```yaml\n{text}```\n")[8:-4]
    assert yaml.safe_load(narrow) == yaml.safe_load(text)
    assert max(map(len, narrow.splitlines())) <= 85


def test_wrapped_commands_are_equivalent(maker):
    command = (
        "printf '%s|' 'a quoted text that is long, and has -- and | in it' " + "x " * 20 + "| cat"
    )
    narrow = maker.narrow_blocks(f"```sh\n{command}  # a comment\n```\n")
    assert narrow.startswith("```sh\n# a comment\nprintf")
    assert "\\\n" in narrow and max(map(len, narrow.splitlines())) <= 85
    printed = [
        subprocess.run(["bash", "-c", script], capture_output=True, text=True).stdout
        for script in (command, narrow[6:-4])
    ]
    assert printed[0] and printed[0] == printed[1]


@pytest.mark.long
def test_the_first_page_installs_without_a_checkout(maker, pages, monkeypatch):
    assert "pip install PATH/OF/TDINT\n" in pages["README.md"]
    assert "pip install -q ." not in pages["README.md"]
    parts = ["## Install", "pip install", "Python 3.11 or newer", "![Histories", "tdint init"]
    text = (readmes.ROOT / "README.md").read_text("utf-8")
    addresses = {"repository": "https://example.org/tdint", "site": "https://example.org/pages"}
    monkeypatch.setattr(maker, "addresses", lambda: addresses)
    for first in (pages["README.md"], maker.home(text)):
        positions = [first.index(part) for part in parts]
        assert positions == sorted(positions)
        assert first.count("![Histories") == 1
    assert "pip install git+https://example.org/tdint\n" in maker.home(text)
    assert "git clone https://example.org/tdint\n" in maker.home(text)
    monkeypatch.setattr(maker, "is_published", lambda: True)
    assert "pip install tdint\n" in maker.home(text)
    found = maker.settings(pages)
    assert found["repo_url"] == addresses["repository"]
    assert found["site_url"] == f"{addresses['site']}/"


@pytest.mark.long
def test_each_page_has_links_for_editing_its_files(maker, monkeypatch):
    """With an address of the repository, each link refers to an existing file."""
    addresses = {"repository": "https://example.org/tdint", "site": ""}
    monkeypatch.setattr(maker, "addresses", lambda: addresses)
    found = maker.pages()
    link = re.compile(r"\(https://example\.org/tdint/(?:edit|blob)/main/([^)]+)\)")
    for page, text in found.items():
        files = link.findall(text)
        assert files, page
        assert all((readmes.ROOT / file).is_file() for file in files), page
    edited = {page: link.findall(text.rpartition("\nEdit: ")[2]) for page, text in found.items()}
    assert edited["guide/first-run.md"] == ["README.md", "cli/README.md"]
    assert edited["cli/run.md"] == ["cli/tdint_cli/commands/run.py"]
    assert edited["src/tdint/methods/impulse4.md"] == ["src/tdint/methods/impulse4.py"]
    assert edited["configs/kaikoura-frame.yaml.md"] == ["configs/kaikoura-frame.yaml"]


def test_the_page_of_columns_has_the_unit_and_meaning_of_each(pages):
    page = pages["cli/COLUMNS.md"]
    for table, group in readmes.columns().items():
        assert f"\n## {table}\n" in page
        for column in group:
            unit = "" if column.unit in ("1", "text") else f" ({column.unit})"
            base = column.name.removesuffix("_error")
            estimate = column.meaning == f"estimated absolute error of {base}"
            entry = f"- `{column.name}`{unit}: {column.meaning}\n"
            assert entry in page or (estimate and f"`{base}`" in page), column.name


def test_the_reference_has_each_public_name_with_its_parameters(pages):
    """Each parameter of each public function is in the signature on its page."""
    reference = {page: text for page, text in pages.items() if page.startswith("src/reference/")}
    content = "\n".join(reference.values())
    for name in dir(tdint):
        if name.startswith("_"):
            continue
        heading = f"## tdint.{name} {{ #"
        assert heading in content, name
        section = content.partition(heading)[2].partition("\n## ")[0]
        for parameter in inspect.signature(getattr(tdint, name)).parameters:
            assert re.search(rf"\b{parameter}\b", section), (name, parameter)
    assert "[`tdint.run`](" in "\n".join(pages.values())


def test_links_have_existing_pages_and_figures(maker, pages):
    drawn = {f"{maker.METHODS}/{maker.picture_of(name)}" for name in catalogue()}
    targets = {*pages, *maker.pictures(), *drawn}
    for page, text in pages.items():
        assert set(maker.links(page, text)) <= targets | {page, str(PurePosixPath(page).parent)}, (
            page
        )


def test_the_navigation_lists_each_page_once(maker, pages):
    named = re.findall(r"[\w./-]+\.md", json.dumps(maker.settings(pages)["nav"]))
    assert len(named) == len(set(named))
    lead = {page for page in pages if not page.endswith(".md.md")}
    shown = {page for page in pages if re.fullmatch(r".*\.(yaml|csv|py)\.md|.*LICENSE\.md", page)}
    # Pages of folders without a README list their modules, and stand in no menu.
    shown |= {
        page
        for page in pages
        if page.endswith("/README.md") and not (readmes.ROOT / page).is_file()
    }
    assert set(named) >= lead - shown
    assert set(named) <= set(pages)


def without_layout(text):
    """Return a text without white space and characters that Markdown or a terminal layout adds."""
    return re.sub(r"[\s\\`]", "", unescape(text))


@pytest.mark.parametrize("name", every(3, COMMANDS))
def test_the_page_of_a_command_contains_its_complete_help(pages, name):
    help_all = (
        CliRunner().invoke(cli, [name, "--help-all"], prog_name="tdint", terminal_width=100).stdout
    )
    paragraphs = [
        without_layout(paragraph)
        for paragraph in re.split(r"\n\s*\n|\n(?=\w+:\n)|\n(?=  -)", help_all)
    ]
    page = without_layout(re.sub(r"\n:   ", "\n", pages[f"cli/{name}.md"]))
    expected = [
        paragraph.removeprefix("Usage:")
        for paragraph in paragraphs
        if paragraph and not re.fullmatch(r"\w+:", paragraph)
    ]
    assert len(expected) > 5
    assert [paragraph for paragraph in expected if paragraph not in page] == []


@pytest.mark.parametrize("name", catalogue())
def test_the_page_of_a_method_has_equations_figure_and_publications(pages, name):
    page = pages[f"src/tdint/methods/{name}.md"]
    equations = page.partition("## Equations")[2].partition("## Stability")[0]
    assert re.search(r"= .*[uv]", equations)
    assert f"({name}-stability.png)" in page
    assert all(
        publication.title.strip("{}") in page.replace("\\", "")
        for publication in references().get(name, ())
    )


def test_the_table_of_methods_links_to_their_pages(pages):
    rows = re.findall(
        r"^\| \[`([\w-]+)`\]\(([\w-]+)\.md\) \|(.*)$",
        pages["src/tdint/methods/README.md"],
        re.MULTILINE,
    )
    assert [name for name, target, _ in rows if name == target] == list(catalogue())
    assert {cells.count("|") for _, _, cells in rows} == {4}  # order, limit, rho_inf, source


class Found:
    """Links, loaded files and anchors of a page, from the attributes of its tags. The generator
    writes attributes with quotes."""

    def __init__(self, text):
        self.leads, self.loads, self.anchors = set(), set(), set()
        for tag, inside in re.findall(r"<(\w+)\s([^>]*)>", text):
            attributes = {
                key: unescape(value) for key, value in re.findall(r'([\w-]+)="([^"]*)"', inside)
            }
            self.anchors |= {attributes[key] for key in ("id", "name") if attributes.get(key)}
            if tag == "a" and attributes.get("href"):
                self.leads.add(attributes["href"])
            if tag in ("img", "script", "link"):
                self.loads |= {attributes[key] for key in ("src", "href") if attributes.get(key)}


@pytest.fixture(scope="module")
def site(maker, tmp_path_factory):
    """Directory of the generated site. The figure of the first method is used for all methods,
    because each figure needs a second."""
    pytest.importorskip("zensical", reason="the extra site is not installed")
    folder = tmp_path_factory.mktemp("site")
    first = next(iter(catalogue()))
    drawn = folder / "stability.png"
    maker.draw(first, drawn)
    before, maker.draw = maker.draw, lambda name, file: file.write_bytes(drawn.read_bytes())
    maker.write(folder)
    maker.draw = before
    command = [
        sys.executable, "-m", "zensical", "build", "--strict", "--config-file",
        str(folder / "site.yml"),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "site"


@pytest.mark.long
def test_links_of_the_site_have_targets_and_no_external_files_are_loaded(site):
    found = {
        file: Found(file.read_text("utf-8"))
        for file in site.rglob("*.html")
        if file.name != "404.html"
    }
    files = {file for file in site.rglob("*") if file.is_file()}
    assert all(page.leads and page.loads and page.anchors for page in found.values())
    for file, page in found.items():
        for target in page.leads | page.loads:
            if target in EXTERNAL_LINKS:
                continue
            assert not re.match(r"\w+:|//", target) or target in page.leads, (file, target)
            if re.match(r"\w+:", target):
                continue
            path, _, anchor = unquote(target).partition("#")
            target_file = Path(os.path.normpath(file.parent / path)) if path else file
            target_file = target_file if target_file in files else target_file / "index.html"
            assert target_file in files, (file, target)
            assert (
                not anchor
                or target_file not in found
                or anchor in found[target_file].anchors | {"__skip"}
            ), (file, target)


@pytest.mark.long
def test_lists_are_rendered_and_every_page_is_in_the_search_index(site, pages):
    for file in site.rglob("*.html"):
        assert not re.search(r"<p>[^<]*\n[-*] ", file.read_text("utf-8")), file
    index_text = (site / "search.json").read_text("utf-8")
    assert len(list(site.rglob("index.html"))) == len(pages)
    assert all(
        term in index_text for term in ("glossary", "moment4", "--tolerance", "tdint pushover")
    )


@pytest.mark.parametrize(
    "term",
    [
        *("interstory drift", "multiple stripe", "spectral matching", "tutorial", "EDP"),
        *("engineering demand parameter", "average annual loss", "loss exceedance", "order of"),
        *("work-precision", "discretization error", "response history analysis", "Duhamel"),
        *("incremental dynamic analysis", "RotD50", "time integration", "error estimate"),
        *("install", "reference", "plug-in", "convergence", "numerical damping", "overshoot"),
        *("P-delta", "pinching", "fragility", "inventory", "exposure", "residual drift"),
        *(
            "floor spectrum",
            "base shear",
            "ductility",
            "peak floor acceleration",
            "response spectr",
        ),
        *("record selection", "maximum direction", "percentile", "Rayleigh", "damping ratio"),
        *("tdint.run", "getting started", "AT2", "choose a time-integration method"),
    ],
)
@pytest.mark.long
def test_the_search_finds_the_terms_of_the_field(site, term):
    """The search index contains the term in a text, so the search leads to its page."""
    index = json.loads((site / "search.json").read_text("utf-8"))
    assert term.lower() in json.dumps(index).lower()
