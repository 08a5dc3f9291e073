"""Consistency of the pages: links, headings, and named files, commands and options."""

import re

import click
import pytest

import readmes
from tdint_cli.main import COMMANDS, cli


def relative_path(path):
    return str(path.relative_to(readmes.ROOT))


def prose(text):
    """Return the text of a README without code blocks, because # and ]( have other meanings
    there."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(path):
    """Return the anchors that GitHub creates for the headings of a file."""
    headings = re.findall(r"^#+ +(.*)$", prose(path.read_text()), re.MULTILINE)
    return [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]


def pages():
    """Return all pages."""
    github = sorted((readmes.ROOT / ".github").rglob("*.md"))
    return [*readmes.files(), readmes.ROOT / "CHANGELOG.md", *github]


@pytest.mark.parametrize("path", pages(), ids=relative_path)
def test_links_have_existing_targets(path):
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(path.read_text())):
        if re.match(r"\w+:", target):
            continue
        name, _, anchor = target.partition("#")
        aim = (path.parent / name).resolve() if name else path
        assert aim.exists(), target
        assert aim.is_relative_to(readmes.ROOT), target
        aim = aim / "README.md" if aim.is_dir() else aim
        assert not anchor or anchor in anchors(aim), target


@pytest.mark.parametrize("path", readmes.files(), ids=relative_path)
def test_headings_of_a_page_are_unique(path):
    assert len(anchors(path)) == len(set(anchors(path)))


def options(command):
    """Return the options of a command, and the common options of tdint."""
    context = click.Context(cli)
    found = cli.get_command(context, command)
    assert found, f"there is no command {command}"
    return {
        name
        for part in (found, cli)
        for option in part.params
        for name in (*option.opts, *option.secondary_opts)
    }


def code(text):
    """Return the lines of the code blocks and the code spans of a README without its generated
    parts."""
    text = re.sub(
        r"^<!-- generated: (\w+) -->$.*?^<!-- end: \1 -->$",
        "",
        text,
        flags=re.DOTALL | re.MULTILINE,
    )
    text = re.sub(r"^```bibtex$.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)
    blocks = re.findall(r"^```.*?^```$", text, flags=re.DOTALL | re.MULTILINE)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return [*lines, *(" ".join(span.split()) for span in re.findall(r"`([^`]+)`", prose(text)))]


@pytest.mark.parametrize("path", readmes.files(), ids=relative_path)
def test_commands_and_options_exist(path):
    all_options = {option for name in COMMANDS for option in options(name)}
    for line in code(path.read_text()):
        for name, arguments in re.findall(r"(?:^|[\s/])tdint ([a-z][a-z-]*)([^|#>]*)", line):
            assert set(re.findall(r"(?<!\S)--[a-z][a-z0-9-]*", arguments)) <= options(name), line
        if "tdint" not in line and not re.match(r"\$|python|pytest|dask", line):
            assert set(re.findall(r"(?<!\S)--[a-z][a-z0-9-]*", line)) <= all_options, line


@pytest.mark.parametrize("path", readmes.files()[1:], ids=relative_path)
def test_the_first_page_links_to_every_other(path):
    assert f"]({relative_path(path)}" in readmes.README.read_text()


@pytest.mark.parametrize(
    "text",
    [
        "| `bouc-wen` |",  # list of laws
        "buildings: {models:",  # example campaign
        "Open an issue",  # where to ask
        "`kip*s^2/in`",  # units of mass
        "pip install git+",  # installation without a clone
    ],
)
def test_tasks_of_a_newcomer_are_one_link_from_the_first_page(text):
    first = readmes.README.read_text()
    targets = {target.partition("#")[0] for target in re.findall(r"\]\(([^)\s:]+)\)", first)}
    linked = [readmes.ROOT / target for target in targets if target.endswith(".md")]
    assert any(text in page.read_text() for page in (readmes.README, *linked))


@pytest.mark.parametrize("path", readmes.files(), ids=relative_path)
def test_named_files_directories_and_modules_exist(path):
    text = path.read_text()
    for name in re.findall(r"(?:pytest|python) (?:-\S+ )*((?:tests|records)/[\w/.]+)", text):
        assert (readmes.ROOT / name).exists(), name
    for name in re.findall(r"`((?:src|cli|tests|tdint)/[\w/.]+)`", text):
        assert any((root / name).exists() for root in (readmes.ROOT, readmes.ROOT / "src")), name
    for name, file in re.findall(r"`(\w+)` in `((?:cli|tdint)/[\w/]+\.py)`", text):
        module = next(
            root / file for root in (readmes.ROOT, readmes.ROOT / "src") if (root / file).exists()
        )
        assert re.search(
            rf"^ *(?:def|class) {name}\b", module.read_text(encoding="utf-8"), re.MULTILINE
        ), (name, file)


@pytest.mark.parametrize("path", readmes.files(), ids=relative_path)
def test_commands_of_a_page_have_different_outputs(path):
    """Otherwise, a command would report that a file exists. A table, an exported record and their
    summary have the same stem."""
    blocks = re.findall(r"^```.*?^```$", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    outputs = [
        re.sub(r"\.(?:csv|mseed|parquet)$", "", name)
        for line in "".join(blocks).replace("\\\n", " ").splitlines()
        for name in re.findall(r"tdint [a-z][^|>#]*? -o ([^\s$]+)(?![^|>#]*--overwrite)", line)
    ]
    assert sorted(outputs) == sorted(set(outputs))


@pytest.mark.parametrize(
    "page",
    [
        relative_path(path)
        for path in readmes.files()
        if re.search(r"`[^`\n]*pytest\s[^`]*tests/", path.read_text())
    ],
)
def test_commands_that_check_the_numbers_of_a_page_select_all_tests(page):
    """Without -m, pytest omits the long and the slow tests of a file."""
    spans = [
        " ".join(span.split())
        for span in re.findall(r"`([^`]+)`", (readmes.ROOT / page).read_text())
    ]
    commands = [span for span in spans if "pytest " in span and "tests/" in span]
    assert commands
    for command in commands:
        for name in re.findall(r"tests/[\w/.]+", command):
            path = readmes.ROOT / name
            files = path.rglob("test_*.py") if path.is_dir() else [path]
            marked = any(
                re.search(r"mark\.(?:long|slow)|\bevery\(", file.read_text()) for file in files
            )
            assert " -m " in command or not marked, command
