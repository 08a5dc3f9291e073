"""Layout options of text tables, on the command line and in model files."""

import json

import click
import numpy as np
import pytest

from cli.test_info import errors, rows
from facts import states
from tdint.units import STANDARD_GRAVITY
from tdint_cli.main import COMMANDS, cli

LAYOUT = ("--skip-lines", "2", "--step", "0.01", "--units", "g")
MODEL = """\
stories: [{mass: 10, height: 3, stiffness: 8000}]
damping: {modal: 0.05}
excitation: {record: {file: tables/a.txt, units: g, step: 0.01, column: Floor, skip_lines: 2}}
analysis: {method: exact}
"""


@pytest.fixture
def tables(folder):
    """Write two tables with two columns below two text lines and the column names, and a text file
    that is not a table."""
    (folder / "tables").mkdir()
    t = np.arange(200) * 0.01
    for name, peak in (("a", 0.1), ("b", 0.2)):
        values = peak * np.sin(9.0 * t)
        lines = [f"{value:.5f} {3.0 * value:.5f}" for value in values]
        (folder / "tables" / f"{name}.txt").write_text(
            "\n".join(["Test 7", "at noon", "Table Floor", *lines, ""])
        )
    (folder / "tables" / "words.txt").write_text("nothing here\n")
    return folder


@pytest.mark.parametrize(
    ("column", "names", "factor"),
    [((), ["Table", "Floor"], 1.0), (("--column", "floor"), ["Floor"], 3.0)],
)
def test_info_of_a_directory(tables, tdint, column, names, factor):
    result = tdint(
        "info", "tables", *LAYOUT, *(column or ("--column", "1,2")), "-o", "info.csv", code=0
    )
    found = rows((tables / "info.csv").read_text())
    assert [row["component"] for row in found] == names * 2
    assert float(found[0]["pga_m_s2"]) == pytest.approx(0.1 * factor * STANDARD_GRAVITY, rel=1e-3)
    assert "words.txt" in result.stderr
    layout = json.loads((tables / "info.json").read_text())["settings"]["layout"]
    assert layout == {"step": 0.01, "column": ["floor"] if column else ["1", "2"], "skip_lines": 2}


def test_spectra_of_a_directory(tables, tdint):
    for command in (("spectrum",), ("drift-spectrum", "--stories", "1")):
        arguments = (
            command[0],
            "tables",
            *command[1:],
            "--period",
            "0.5",
            *LAYOUT,
            "--column",
            "2",
        )
        assert len(rows(tdint(*arguments, code=0).stdout)) == 2
    tdint(
        "spectrum",
        "tables/a.txt",
        "--period",
        "0.5",
        "--rotd",
        "50",
        *LAYOUT,
        "--column",
        "1,2",
        code=0,
    )


def test_run_by_the_model_and_by_options(tables, tdint):
    (tables / "m.yaml").write_text(MODEL)
    (tables / "bare.yaml").write_text(MODEL.replace(", column: Floor, skip_lines: 2", ""))
    by_model = tdint("run", "m.yaml", code=0)
    assert (
        tdint("run", "bare.yaml", "--column", "floor", "--skip-lines", "2").stdout
        == by_model.stdout
    )
    assert (
        tdint("run", "bare.yaml", "tables/a.txt", *LAYOUT, "--column", "2").stdout
        == by_model.stdout
    )
    assert tdint("run", "m.yaml", "--column", "1").stdout != by_model.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (
            "info motion.mseed --step 0.02",
            4,
            "0.01 s, which contradicts --step 0.02",
        ),
        ("info motion.mseed --column 2", 4, "--column 2 cannot be used with the file format MSEED"),
        ("info motion.mseed --step 0", 2, "--step"),
        ("info tables/a.txt --skip-lines -1", 2, "--skip-lines"),
        ("info tables/a.txt --column=", 2, "column"),
        (
            "info tables/a.txt",
            4,
            "starts in line 4: ... --step ... --column ... --skip-lines",
        ),
        ("run forced.yaml --step 0.01", 2, "requires a record"),
    ],
)
def test_invalid_options_are_refused(tables, tdint, arguments, code, message):
    (line,) = errors(tdint.refused(message, *arguments.split(), code=code))
    assert states(line, message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda line, i: line[:5] if i == 50 else line,
            "line 51 ... 2 numbers, got '0.49,'",
        ),
        (
            lambda line, i: line[:5] if i == 1 else line,
            "line 2 ... 2 numbers, got '0.00,'",
        ),
        (
            lambda line, i: f"{i - 1 if i else ''},{line}",
            "line 1: ',time,acc' ... first column",
        ),
    ],
)
def test_incomplete_rows_are_reported_with_their_line(folder, tdint, change, message):
    lines = ["time,acc", *(f"{0.01 * i:.2f},{np.sin(0.1 * i):.6f}" for i in range(200))]
    (folder / "t.csv").write_text("\n".join(change(line, i) for i, line in enumerate(lines)) + "\n")
    assert states(tdint("info", "t.csv", "--units", "g", code=4).stderr, message)


def test_a_table_without_units_causes_a_note_about_the_option(folder, tdint):
    (folder / "t.csv").write_text(
        "time,acc\n" + "".join(f"{0.01 * i:.2f},{np.sin(0.1 * i):.6f}\n" for i in range(200))
    )
    assert "--units g," in tdint("info", "t.csv").stderr


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_that_reads_records_has_the_options(name):
    command = cli.get_command(click.Context(cli), name)
    options = {option for parameter in command.params for option in parameter.opts}
    assert {"--step", "--column", "--skip-lines"} <= options or not {
        "--units",
        "--component",
    } <= options
