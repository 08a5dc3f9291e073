"""Descriptions of records in place of records, the question for missing properties, and options
that a description replaces."""

import re
import shlex
from dataclasses import fields

import pytest

from csv_rows import rows
from facts import states
from ground_motion.free_tables import accelerogram, column
from tdint.ground_motion.choice import Processing, TextLayout
from tdint.ground_motion.horizontals import at_right_angles
from tdint_cli.options.grammar import DESCRIBED_OPTIONS

PGA = ("--to", "pga=0.3g")


@pytest.fixture
def columns(folder):
    """Working directory with two columns of numbers, and their description."""
    for name, peak in (("a.dat", 0.2), ("b.dat", 0.4)):
        (folder / name).write_text(column(accelerogram(400, peak, len(name))))
    (folder / "set.yaml").write_text('files: ["*.dat"]\nstep: 0.02\nunits: g\n')
    return folder


def factors(result):
    return [(row["record"], float(row["factor"])) for row in rows(result.stdout)]


RIGHT = [("a.dat", pytest.approx(1.5, rel=1e-5)), ("b.dat", pytest.approx(0.75, rel=1e-5))]


def test_description_replaces_records(columns, tdint):
    assert factors(tdint("scale", "set.yaml", *PGA)) == RIGHT
    named = tdint("info", "a.dat", "b.dat", "--step", "0.02", "--units", "g")
    assert tdint("info", "set.yaml").stdout == named.stdout
    # Paths are relative to the description; a directory is replaced by its records.
    (columns / "deep").mkdir()
    (columns / "deep" / "d.yaml").write_text("files: [../a.dat]\nstep: 0.02\nunits: g\n")
    assert factors(tdint("scale", "deep/d.yaml", *PGA)) == RIGHT[:1]


def test_options_complete_a_description(columns, tdint):
    (columns / "part.yaml").write_text("files: [a.dat, b.dat]\nstep: 0.02\n")
    assert factors(tdint("scale", "part.yaml", *PGA, "--units", "g")) == RIGHT
    assert factors(tdint("scale", "set.yaml", *PGA, "--units", "g")) == RIGHT


@pytest.mark.parametrize(
    ("command", "options"),
    [("scale", ("--units", "gal", *PGA)), ("info", ("--step", "0.01"))],
)
def test_contradictions_are_refused(columns, tdint, command, options):
    message = tdint(command, "set.yaml", *options, code=2).stderr
    assert re.search(r"--(units gal|step 0\.01) contradicts `\w+: \S+` in set\.yaml", message)


def test_errors_of_a_description(columns, tdint):
    (columns / "bad.yaml").write_text("files: [a.dat]\nstepp: 0.02\nunits: 3\n")
    message = tdint("scale", "bad.yaml", *PGA, code=3).stderr
    assert "bad.yaml:2:1: stepp: unknown key" in message
    (columns / "bad.yaml").write_text("step: 0.02\n")
    assert "files" in tdint("scale", "bad.yaml", *PGA, code=3).stderr
    (columns / "none.yaml").write_text("files: ['*.AT2']\n")
    assert "no file matches" in tdint("scale", "none.yaml", *PGA, code=4).stderr


def test_run_with_a_description(columns, tdint):
    """A description of one file is one record, a description of several files several runs."""
    (columns / "one.yaml").write_text("files: [a.dat]\nstep: 0.02\nunits: g\n")
    direct = tdint("run", "shaken.yaml", "a.dat", "--step", "0.02", "--units", "g", "--no-check")
    for arguments in (("one.yaml",), ("--record", "one.yaml")):
        assert tdint("run", "shaken.yaml", *arguments, "--no-check").stdout == direct.stdout
    (columns / "two.yaml").write_text("files: [a.dat, b.dat]\nstep: 0.02\nunits: g\n")
    assert "accepts one" in tdint("run", "shaken.yaml", "--record", "two.yaml", code=2).stderr
    assert "is a model" in tdint("run", "shaken.yaml", "forced.yaml", code=2).stderr


def test_pairs_of_a_description(columns, tdint):
    for name in "ab":
        (columns / f"x_{name}.dat").write_text((columns / f"{name}.dat").read_text())
    (columns / "pair.yaml").write_text(
        "files: ['x_*.dat']\nstep: 0.02\nunits: g\npairs: '{}_a.dat,{}_b.dat'\n"
    )
    first, second = factors(tdint("scale", "pair.yaml", *PGA))
    assert first[1] == second[1] == pytest.approx(0.3 / (0.2 * 0.4) ** 0.5, rel=1e-5)


def lines_in(message):
    """Return the command lines in a message, without the name of the program."""
    found = re.findall(r"tdint (.+?)(?:, then:? |\n|$| \(or )", message)
    return [shlex.split(line) for line in found]


@pytest.mark.parametrize(
    ("command", "options"),
    [("scale", PGA), ("drift-spectrum", ("--stories", "2", "--period", "1"))],
)
def test_moved_option_is_answered_by_lines(columns, tdint, command, options):
    """An option that other commands have is answered by two command lines that work."""
    message = tdint(
        command, "a.dat", "b.dat", "--step=0.02", "--units", "g", *options, code=2
    ).stderr
    description, study = lines_in(message)
    tdint(*description)
    result = tdint(*study)
    assert study[:2] == [command, "records.yaml"]
    assert {row["record"] for row in rows(result.stdout)} == {"a.dat", "b.dat"}


def test_moved_options_are_those_of_layout_and_processing():
    """Every setting of the layout and the processing has an answer in commands without options."""
    names = [item.name for item in (*fields(TextLayout), *fields(Processing))]
    assert set(DESCRIBED_OPTIONS) == {f"--{name.replace('_', '-')}" for name in names}


@pytest.mark.parametrize("arguments", [("info", "a.dat"), ("scale", "a.dat", *PGA)])
def test_question_is_a_command_line(columns, tdint, arguments):
    """The message about missing properties contains command lines that work unchanged."""
    message = tdint(*arguments, code=4).stderr
    lines = lines_in(message)
    assert "--step" in lines[0]
    assert "--units" in lines[0]
    for line in lines:
        result = tdint(*line)
    assert rows(result.stdout)[0]["record"] == "a.dat"


def test_former_measures_of_scale(columns, tdint):
    assert factors(tdint("scale", "set.yaml", "--pga", "0.3g")) == RIGHT
    assert factors(tdint("scale", "set.yaml", "--pga=0.3g")) == RIGHT


def test_export_of_a_description(columns, tdint):
    """The description reads the records with the same options, from any directory."""
    (columns / "out").mkdir()
    options = ("--step", "0.02", "--units", "g", "--highpass", "0.2", "--trim", ":4")
    direct = tdint("info", "a.dat", "b.dat", *options, "--export", "out/set.yaml")
    assert tdint("info", "out/set.yaml").stdout == direct.stdout
    tdint("info", "out/set.yaml", "--export", "out/copy.yaml")
    assert (columns / "out/copy.yaml").read_text() == (columns / "out/set.yaml").read_text()
    assert (
        "the file exists"
        in tdint("info", "out/set.yaml", "--export", "out/copy.yaml", code=6).stderr
    )


def test_export_to_a_directory(columns, tdint):
    tdint("info", "set.yaml", "--export", "exported/")
    assert {path.name for path in (columns / "exported").iterdir()} == {
        "a.mseed",
        "a.json",
        "b.mseed",
        "b.json",
    }
    result = tdint("scale", "exported", *PGA)
    assert [factor for _, factor in factors(result)] == [factor for _, factor in RIGHT]
    assert "2 of 2 files used" in result.stderr


def test_exported_files_of_a_pair_remain_a_pair(columns, tdint):
    for name, column_of_file in (("a_N.txt", "a.dat"), ("a_E.txt", "b.dat")):
        (columns / name).write_bytes((columns / column_of_file).read_bytes())
    options = ("--units", "g", "--step", 0.01)
    pair = ("--rotd", "100", "--period", 1)
    original = tdint("spectrum", "a_N.txt", "a_E.txt", *options, *pair, code=0).stdout
    tdint("info", "a_N.txt", "a_E.txt", *options, "--export", "pair/", code=0)
    exported = tdint("spectrum", "pair/a_N.mseed", "pair/a_E.mseed", *pair, code=0).stdout
    assert rows(exported)[0]["rotd100_psa_m_s2"] == rows(original)[0]["rotd100_psa_m_s2"]


@pytest.mark.parametrize(
    ("names", "channels"),
    [
        (("NS", "EW", "UD"), ["HNN", "HNE", "HNZ"]),
        (("067", "UP", "337"), ["HNY", "HNZ", "HNX"]),
        (("A", "B", "UD"), ["HN1", "HN1", "HNZ"]),
    ],
)
def test_exported_components_keep_their_directions(columns, tdint, names, channels):
    samples = accelerogram(60, 0.2, 1)
    lines = [f"{0.01 * i:.2f},{a:.6f},{a * a:.6f},{-a:.6f}" for i, a in enumerate(samples)]
    head = "time_s," + ",".join(f"{name} (g)" for name in names)
    (columns / "table.csv").write_text("\n".join([head, *lines, ""]))
    tdint("info", "table.csv", "--export", "table.mseed", code=0)
    exported = rows(tdint("info", "table.mseed", code=0).stdout)
    assert [row["id"].split(".")[3] for row in exported] == channels
    chosen = [rows(tdint("scale", name, *PGA).stdout) for name in ("table.csv", "table.mseed")]
    assert [[row["factor"] for row in table] for table in chosen] == [
        [row["factor"] for row in chosen[0]]
    ] * 2


def test_two_motions_in_an_exported_file_are_no_pair(columns, tdint):
    tdint("info", "set.yaml", "--export", "two.mseed", code=0)
    names = [row["id"].split(".")[1] for row in rows(tdint("info", "two.mseed", code=0).stdout)]
    assert names == ["R01", "R02"] and not at_right_angles(*names)


def test_exported_files_with_equal_names_are_refused(folder, tdint):
    for directory in ("a", "b"):
        (folder / directory).mkdir()
        (folder / directory / "x.mseed").write_bytes((folder / "motion.mseed").read_bytes())
    message = "x.mseed.mseed: both a/x.mseed and b/x.mseed ... use --export NAME.mseed for one file"
    call = ("info", "a/x.mseed", "b/x.mseed", "--export", "out/")
    assert states(tdint(*call, code=6).stderr, message)


def test_exported_records_of_one_station(folder, make_record, tdint):
    """Components of one file have different names in `scale`, and `run` reads its table."""
    make_record(folder / "x.mseed", "HNE", "HNN")
    make_record(folder / "y.mseed", "HNE", "HNN", peak=2.0)
    tdint("info", "x.mseed", "y.mseed", "--export", "all.mseed")
    tdint("scale", "all.mseed", *PGA, "-o", "factors.csv")
    table = rows((folder / "factors.csv").read_text())
    factors = {row["component"]: row["factor"] for row in table}
    assert len(table) == len(factors) == 4
    # Both components of a recording have one factor.
    assert factors[".R01.SI.HNE"] == factors[".R01.SI.HNN"] != factors[".R02.SI.HNE"]
    assert factors[".R02.SI.HNE"] == factors[".R02.SI.HNN"]
    runs = rows(tdint("run", "shaken.yaml", "--factors", "factors.csv", "--no-check").stdout)
    assert len(runs) == 4 and {row["component"]: row["scale"] for row in runs} == factors


def test_selection_omits_unusable_files(columns, tdint):
    """A selection goes on without the files that cannot be used, and ends with code 4."""
    (columns / "set").mkdir()
    for number in range(4):
        for direction in "NE":
            values = accelerogram(2000, 0.2, 10 * number + ord(direction))
            (columns / "set" / f"r{number}_{direction}.txt").write_text(
                "# dt = 0.01 s, units = g\n" + column(values)
            )
    damaged = column(accelerogram(2000, 0.2, 1)).replace("\n", "x\n", 1)
    (columns / "set" / "damaged_N.txt").write_text("# dt = 0.01 s, units = g\n" + damaged)
    (columns / "target.csv").write_text("period_s,sa_g\n0.1,0.6\n0.5,0.6\n2,0.15\n")
    result = tdint(
        *("scale", "set", "--target", "target.csv", "--range", "0.2:2", "--select", "3"),
        *("--factor-range", "0.01:100"),
        code=4,
    )
    chosen = rows(result.stdout)
    # Three recordings of two components each
    assert len({row["record"] for row in chosen}) == len(chosen) == 6
    assert len({row["record"].split("_")[0] for row in chosen}) == 3
    assert "damaged_N.txt" in result.stderr
    assert "8 of 9 files used" in result.stderr


def test_one_file_and_unknown_keys(columns, tdint):
    (columns / "one.yaml").write_text("files: a.dat\nstep: 0.02\nunits: g\n")
    assert factors(tdint("scale", "one.yaml", *PGA)) == RIGHT[:1]
    (columns / "key.yaml").write_text("records: [a.dat]\nunits: g\n")
    message = tdint("info", "key.yaml", code=3).stderr
    assert "records: unknown key; known: files" in message


@pytest.mark.parametrize("name", ["a\tb.dat", "a\nb.dat"])
def test_description_that_cannot_be_read_is_not_written(columns, tdint, name):
    (columns / name).write_text((columns / "a.dat").read_text())
    options = ("--step", "0.02", "--units", "g", "--export", "new.yaml")
    result = tdint("info", name, *options, code=2)
    assert "a description of records cannot contain" in result.stderr
    assert not (columns / "new.yaml").exists()


def test_brackets_in_the_name_of_a_directory(columns, tdint):
    folder = columns / "set [2024]"
    folder.mkdir()
    for name in ("a.dat", "b.dat"):
        (folder / name).write_text((columns / name).read_text())
    options = ("--step", "0.02", "--units", "g")
    read = tdint("info", "set [2024]/*.dat", *options)
    assert [row["record"] for row in rows(read.stdout)] == ["set [2024]/a.dat", "set [2024]/b.dat"]
    tdint("info", "set [2024]/*.dat", *options, "--export", "new.yaml")
    assert tdint("info", "new.yaml").stdout == read.stdout
    tdint("info", "set [2024]/*.dat", "--step", "0.02", "--units", "set [2024]/*.dat=g")
    assert "file not found" in tdint("info", "set [2024]/c.dat", *options, code=4).stderr


def test_units_of_some_files_are_asked_for_by_file(folder, tdint):
    (folder / "set").mkdir()
    values = column(accelerogram(400, 0.2, 1))
    (folder / "set" / "a.txt").write_text(f"# dt = 0.02, units = g\n{values}")
    (folder / "set" / "b.txt").write_text(f"# dt = 0.02\n{values}")
    example = tdint("info", "set", code=4).stderr.rpartition("For example: ")[2]
    assert "--units b.txt=g" in example
    tdint(*shlex.split(example)[1:], code=0)
