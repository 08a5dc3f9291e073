"""The figures of the READMEs belong to their inputs, by a digest, and to the commands of the pages,
by the command that each PNG file contains. Pixels are not compared."""

import re
import shlex

import pytest

import pictures
import png_text
import readmes

FIGURES = [
    file
    for folder in ("configs", "tests/benchmarks", "tests/validation")
    for file in sorted((readmes.ROOT / folder).glob("*.png"))
]
_OUTPUTS = {"-o", "--output", "--plot", "--openquake", "--geojson"}  # options that name outputs
# Options that change no figure
_SILENT = {"-q", "--quiet", "--overwrite", "--history", "--no-cache"}


def settings(command):
    """Return subcommand, arguments and options of the last tdint command in a line of shell, or the
    complete line for another program; without outputs, because they change no figure."""
    line = re.split(r" && ", command)[-1]
    calls = [part for part in line.split(" | ") if part.startswith("tdint ")]
    if not calls:
        return line.split()
    # In `tdint ida ... | tdint fragility -`, both commands determine the figure.
    arguments = [argument for call in calls for argument in shlex.split(call, comments=True)]
    settings_list = []
    while arguments:
        argument = arguments.pop(0)
        name = argument.partition("=")[0]
        if name in _OUTPUTS:
            # Its value is the next word, unless the option has it or, like --plot, needs none.
            if name == argument and arguments and not arguments[0].startswith("-"):
                arguments.pop(0)
        elif name not in _SILENT:
            settings_list.append(argument)
    return settings_list


def shown_commands(page):
    """Return the commands of a page: lines of code blocks, and code spans in its text."""
    blocks = re.findall(r"^```\w*\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    lines = [line.removeprefix("$ ") for block in blocks for line in block.splitlines()]
    text = re.sub(r"^```\w*\n.*?^```", "", page, flags=re.DOTALL | re.MULTILINE)
    spans = [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", text)]
    return [line for line in (*lines, *spans) if line.startswith(("tdint ", "python "))]


@pytest.mark.parametrize("file", FIGURES, ids=lambda file: file.name)
def test_the_command_in_a_figure_is_on_its_page(file):
    """A page that shows the figure shows a command with the same settings."""
    command = png_text.texts(file)[png_text.COMMAND]
    pages = [
        page.read_text()
        for page in readmes.files()
        if re.search(rf"\]\((?:[\w./]*/)?{re.escape(file.name)}\)", page.read_text())
    ]
    found = [settings(line) for page in pages for line in shown_commands(page)]
    assert settings(command) in found, command


def test_a_figure_of_configs_was_drawn_by_its_declared_command():
    for name, figure in pictures.PICTURES.items():
        texts = png_text.texts(pictures.FOLDER / name)
        assert texts[png_text.COMMAND] == figure.command.format(file=name), name


def test_the_first_page_shows_the_run_of_its_first_figure():
    """The first figure of README.md shows the run with the default method that the page lists."""
    page = readmes.README.read_text()
    first = re.search(r"!\[[^]]*\]\((\S+)\)", page)[1]
    command = png_text.texts(readmes.ROOT / first)[png_text.COMMAND]
    (shown,) = [line for line in shown_commands(page) if "--plot" in line and "configs/" in line]
    assert settings(command) == settings(shown) == ["tdint", "run", "configs/kaikoura-frame.yaml"]


def test_the_command_of_a_png_is_replaced_without_changing_the_image(tmp_path):
    from PIL import Image

    file = tmp_path / "figure.png"
    Image.new("RGB", (3, 2), "red").save(file)
    for command in ("tdint run, ω dt", "tdint run again"):
        png_text.stamp(file, command)
        assert png_text.texts(file) == {png_text.COMMAND: command}
        image = Image.open(file)
        assert image.text == {png_text.COMMAND: command}
        assert image.getpixel((2, 1)) == (255, 0, 0)


def test_no_figure_is_out_of_date():
    """If a figure is out of date, run `python tests/pictures.py`."""
    assert pictures.out_of_date() == []


def test_every_figure_of_configs_is_declared_and_shown():
    shown = {
        name
        for file in readmes.files()
        for name in re.findall(r"\]\((?:[\w./]*/)?([\w-]+\.png)\)", file.read_text())
    }
    assert {file.name for file in pictures.FOLDER.glob("*.png")} == set(pictures.PICTURES)
    assert set(pictures.PICTURES) <= shown
