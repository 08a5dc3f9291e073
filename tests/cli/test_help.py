"""Help with two levels: the common options on one screen, and all options with --help-all."""

import csv
import shlex
import time
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

import readmes
from selection import every
from tdint_cli.main import COMMANDS, cli
from tdint_cli.options.grammar import COMMON, LINES

CAMPAIGN = """\
buildings: {models: [office.yaml]}
records: {files: [office-motion.txt]}
intensity: {scales: [1.0]}
analysis: {method: newmark-average, duration: 4}
"""
RECORDED = """\
base: {file: office-motion.txt}
floors:
  5: {file: recorded/floors.mseed, component: F05, units: m/s^2}
"""


def command_of(name):
    return cli.get_command(click.Context(cli), name)


def screen(*arguments):
    """Return the output of a command line on a terminal with 80 columns; click uses 78 columns."""
    result = CliRunner().invoke(cli, list(arguments), prog_name="tdint", terminal_width=78)
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.parametrize("name", every(3, COMMANDS))
def test_help_fits_one_screen_and_help_all_lists_all_options(name):
    command, short, long = command_of(name), screen(name, "--help"), screen(name, "--help-all")
    options = [option for option in command.params if isinstance(option, click.Option)]
    assert len(short.splitlines()) <= LINES and sum(option.common for option in options) <= COMMON
    assert short.startswith(f"Usage: tdint {name} [OPTIONS]")
    completed = {
        item.value for item in ShellComplete(cli, {}, "tdint", "").get_completions([name], "--")
    }
    assert "None]" not in long  # the range of a number without bounds
    for option in options:
        flag = max(option.opts, key=len)
        assert f"{flag} " in long or f"{flag}\n" in long
        assert (f"  {flag}" in short or f", {flag}" in short) == option.common, flag
        assert {flag for flag in option.opts if flag.startswith("--")} <= completed
    assert (
        short.splitlines()[-1]
        == f"  All options and a detailed description: tdint {name} --help-all"
    )
    assert len(command.examples) == 2 and all(example in short for example in command.examples)
    assert all(f"\n  {code}  {meaning}" in short for code, meaning in command.exits.items())
    # The complete help contains all paragraphs of the description.
    assert "".join(command.help.split()) in "".join(long.split())


@pytest.fixture(scope="module")
def office(tmp_path_factory):
    """Directory in which the examples run in order: office.yaml, and files that users would
    provide."""
    folder = tmp_path_factory.mktemp("office")
    for name in ("buildings.csv", "stripes.csv"):
        (folder / name).write_bytes((readmes.ROOT / "configs" / name).read_bytes())
    (folder / "campaign.yaml").write_text(CAMPAIGN, encoding="utf-8")
    (folder / "recorded.yaml").write_text(RECORDED, encoding="utf-8")
    return folder


MARKS = {"examples": [pytest.mark.slow], "compile": [pytest.mark.long]}


def test_global_options_have_one_line_each(tdint):
    """`tdint --help` is the longest text that a page asks to print."""
    general = tdint("--help").stdout.partition("General:\n")[2].partition("\n\n")[0].splitlines()
    assert [line.split()[0] for line in general] == ["-q,", "--debug", "--version", "-h,"]


@pytest.mark.parametrize(
    "name", every(2, [pytest.param(name, marks=MARKS.get(name, [])) for name in COMMANDS])
)
@pytest.mark.usefixtures("short_matching")
def test_examples_run(name, office, monkeypatch, tdint):
    """The examples of each command run. Nearly the same calls of `tdint examples` are also in
    test_examples.py."""
    monkeypatch.chdir(office)
    if not Path("office.yaml").exists():
        tdint("init", "office.yaml", "--stories", "5", "--period", "0.8", code=0)
    motion = Path("office-motion.txt")  # shortened to the pulse, without 20 s of free vibration
    motion.write_text("".join(motion.read_text().splitlines(keepends=True)[:600]))
    if not Path("recorded").exists():
        tdint("run", "office.yaml", "-o", "recorded", "--export-floors", "mseed", code=0)
    for written in Path().glob("loop.*") if name == "law" else ():
        written.unlink()
    began = time.time() - 1.0
    for example in command_of(name).examples:
        _, *arguments = shlex.split(example)
        assert arguments[0] == name
        # Fewer steps, for a faster test
        options = {"init": ["--overwrite"], "pushover": ["--points", "20"]}.get(name, [])
        result = tdint(*arguments, *options, code=0)
        tables = [result.stdout] if "," in result.stdout.partition("\n")[0] else []
        tables += [
            path.read_text() for path in Path().rglob("*.csv") if path.stat().st_mtime >= began
        ]
        for table in filter(None, tables):
            head, *rows = csv.reader(table.splitlines())
            assert {len(row) for row in rows} <= {len(head)}, example
