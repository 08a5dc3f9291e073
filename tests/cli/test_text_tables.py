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
        "info tables", *LAYOUT, *(column or ("--column", "1,2")), "-o", "info.csv", code=0
    )
    found = rows((tables / "info.csv").read_text())
    assert [row["component"] for row in found] == names * 2
    assert float(found[0]["pga_m_s2"]) == pytest.approx(0.1 * factor * STANDARD_GRAVITY, rel=1e-3)
    assert "words.txt" in result.stderr
    layout = json.loads((tables / "info.json").read_text())["settings"]["layout"]
    columns = ["floor"] if column else ["1", "2"]
    assert layout == {
        "step": 0.01,
        "column": columns,
        "skip_lines": 2,
        "rows": False,
        "one_sided": False,
    }


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


@pytest.fixture
def noise(folder):
    """Write a table of noise with four numbers per line, which does not show its layout, and the
    same samples in one column."""
    values = np.round(0.1 * np.random.default_rng(1).normal(size=(50, 4)), 4)
    (folder / "noise.txt").write_text(
        "\n".join(" ".join(map(str, row)) for row in values.tolist()) + "\n"
    )
    (folder / "one.txt").write_text("\n".join(map(str, values.ravel().tolist())) + "\n")
    return folder


ROWS = ("--rows", "--step", "0.01", "--units", "g")


@pytest.mark.parametrize(
    "command",
    [
        ("info",),
        ("spectrum", "--period", "0.5"),
        ("drift-spectrum", "--stories", "1", "--period", "0.5"),
        ("match", "--target", "asce7:sds=1,sd1=0.6,tl=8", "--range", "0.2:0.3", "-o", "matched"),
    ],
)
def test_rows_in_commands(noise, tdint, command):
    """By the option, or by the key of a description in commands without the option."""
    tables = []
    for file, options in (("noise.txt", ROWS), ("one.txt", ROWS[1:])):
        if command[0] in ("info", "spectrum"):
            tables.append(tdint(command[0], file, *command[1:], *options, code=0))
            continue
        lines = [f"files: [{file}]", "step: 0.01", "units: g"] + ["rows: true"] * (options == ROWS)
        (noise / "described.yaml").write_text("\n".join(lines))
        overwrite = ["--overwrite"] * (command[0] == "match")
        tables.append(tdint(command[0], "described.yaml", *command[1:], *overwrite, code=0))
    with_names = [table.stdout.replace("noise.txt", "one.txt") for table in tables]
    if command[0] == "info":
        with_names = [",".join(row.split(",")[:20]) for row in with_names]
    assert with_names[0] == with_names[1]


def test_rows_in_a_model_file(noise, tdint):
    model = MODEL.replace("tables/a.txt", "noise.txt").replace(", column: Floor, skip_lines: 2", "")
    (noise / "asked.yaml").write_text(model)
    (noise / "rows.yaml").write_text(model.replace("step: 0.01", "step: 0.01, rows: true"))
    (noise / "one.yaml").write_text(model.replace("noise.txt", "one.txt"))
    (noise / "both.yaml").write_text(model.replace("step: 0.01", "column: 1, rows: true"))
    asked = errors(tdint.refused("rows", "run", "asked.yaml", code=4))
    assert states(asked[0], "4 values per line ... --rows ... --column")
    expected = tdint("run", "one.yaml", code=0).stdout
    assert tdint("run", "rows.yaml", code=0).stdout == expected
    assert tdint("run", "asked.yaml", "--rows", code=0).stdout == expected
    (line,) = errors(tdint.refused("rows", "run", "both.yaml", code=3))
    assert states(line, "both.yaml:3 ... rows ... column ... cannot be combined")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ("info motion.mseed --rows", 4, "--rows cannot be used with the file format MSEED"),
        ("info motion.mseed --rows --column 1", 2, "--rows and --column cannot be combined"),
        ("run forced.yaml --rows", 2, "requires a record"),
        ("info motion.mseed --step 0.02", 4, "0.01 s, which contradicts --step 0.02"),
        ("info motion.mseed --column 2", 4, "--column 2 cannot be used with the file format MSEED"),
        ("info motion.mseed --step 0", 2, "--step"),
        ("info tables/a.txt --skip-lines -1", 2, "--skip-lines"),
        ("info tables/a.txt --column=", 2, "column"),
        (
            "info tables/a.txt",
            4,
            "starts in line 4 ... --rows ... --column ... --step",
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
        (lambda line, i: line[:5] if i == 50 else line, "line 51 ... 2 numbers, got '0.49'"),
        (lambda line, i: line[:5] if i == 1 else line, "line 2 ... 2 numbers, got '0.00'"),
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
def test_commands_that_describe_records_have_the_options_of_tables(name):
    command = cli.get_command(click.Context(cli), name)
    options = {option for parameter in command.params for option in parameter.opts}
    layout = {"--step", "--column", "--skip-lines", "--rows"}
    assert (layout & options == layout) == (name in ("run", "info", "spectrum", "chart"))
