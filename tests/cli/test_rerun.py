"""`tdint rerun`: what a JSON file beside a table says, done again elsewhere, and the tables compared."""

import gzip
import json
import os

import pytest

from tdint.errors import OutputError
from tdint.output.tables.table import Difference, differences

STORY = ["run", "shaken.yaml", "-o", "out"]
RECORDED = """\
base: {file: motion.mseed, component: HNE, units: m/s^2}
floors:
  2: {file: recorded/floors.mseed, component: F02, units: m/s^2}
"""
CAMPAIGN = """\
buildings: {models: [shaken.yaml]}
records: {files: [motion.mseed, other.mseed], component: HNE, units: m/s^2}
intensity: {scales: [0.5, 1.0]}
outputs: {stories: true}
"""
UNITS = ["--units", "m/s^2", "--component", "HNE"]


def contents(folder):
    """All files of a folder and what they hold, but for the stores, whose logs SQLite writes."""
    files = sorted(file for file in folder.rglob("*") if file.is_file() and "sqlite" not in file.name)
    return {file: file.read_bytes() for file in files}


def rerun(tdint, folder, *words):
    """The result of a rerun, after which all that there was is as it was."""
    before = contents(folder)
    result = tdint("rerun", *words)
    now = contents(folder)
    assert {file: now.get(file) for file in before} == before
    return result


CASES = {
    "run": (["shaken.yaml"], "stories.csv"),
    "run of one with files of all kinds": (
        ["shaken.yaml", "--history=more/motion.csv.gz", "--plot=more/motion.pdf", "--report", "page.html", "--check"],
        "motion.csv.gz",
    ),
    "run of several": (["shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "--plot"], "profiles.csv"),
    "run of a sequence": (["shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "--sequence"], "stories.csv"),
    "compare": (["shaken.yaml", "--recorded", "recorded.yaml"], "comparison.csv"),
    "ida": (["shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "--max-im", "2g"], "capacities.csv"),
    "campaign": (["campaign.yaml", "--im", "pga"], "measures.csv"),
    "examples": (["1", "--method", "newmark-average"], "example-1-errors.csv"),
    "spectrum": (["motion.mseed", "other.mseed", *UNITS, "--period", "1", "--plot"], "other.csv"),
}
"""Of commands that write folders, beside those of test_provenance.py."""


@pytest.mark.parametrize("name", CASES)
def test_a_folder_is_written_again_elsewhere_and_compared(folder, tdint, name, blank_pictures):
    """All its tables, those that were named beside it, too, and from another working directory."""
    words, table = CASES[name]
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    if name == "compare":
        (folder / "recorded.yaml").write_text(RECORDED)
        assert tdint("run", "shaken.yaml", "-o", "recorded", "--export-floors", "mseed").exit_code == 0
    end = "/" * (name == "spectrum")
    tdint(name.split()[0], *words, "-o", f"some/study{end}", code=0)
    study = folder / "some" / "study"
    told = next(file for file in sorted(study.glob("*.json")) if "arguments" in json.loads(file.read_text()))
    assert str(folder) not in told.read_text()  # no path but those that were typed
    os.chdir(study)
    again = rerun(tdint, folder, told.name)
    assert (again.exit_code, again.stdout) == (0, ""), again.stderr
    assert f"{table}: the same, cell by cell" in again.stderr and "difference" not in again.stderr


@pytest.mark.slow
def test_validate_too(folder, tdint):
    assert tdint("validate", "-o", "cases.csv").exit_code == 0
    assert rerun(tdint, folder, "cases.json").exit_code == 0


def test_cells_that_differ_are_a_table(folder, tdint):
    assert tdint(*STORY).exit_code == 0
    file = folder / "out" / "stories.csv"
    rows = [line.split(",") for line in file.read_text().splitlines()]
    true = rows[2][2]
    rows[2][2] = repr(2.0 * float(true))
    file.write_text("".join(",".join(row) + "\n" for row in rows))
    result = rerun(tdint, folder, "out")
    assert result.exit_code == 5
    header, line = result.stdout.splitlines()
    assert header == "file,row,column,before,now,relative_difference"
    assert line == f"stories.csv,2,peak_drift_m,{rows[2][2]},{true},0.5"
    assert "stories.csv: 1 difference, at most 50 % (peak_drift_m, row 2)" in result.stderr
    file.unlink()
    gone = rerun(tdint, folder, "out")
    assert (gone.exit_code, "not there where it was" in gone.stderr) == (5, True)


def test_what_is_written_now_stays_where_it_is_asked_for(folder, tdint):
    assert tdint("modes", "forced.yaml", "-o", "modes.csv.gz").exit_code == 0
    assert rerun(tdint, folder, "modes.json", "-o", "again/new").exit_code == 0
    assert (folder / "again/new/modes.csv.gz").read_bytes() == (folder / "modes.csv.gz").read_bytes()
    refused = rerun(tdint, folder, "modes.json", "-o", "again")
    assert (refused.exit_code, "not an empty folder" in refused.stderr) == (6, True)


@pytest.mark.parametrize("changed", ["motion.mseed", "shaken.yaml", "plugin"])
def test_other_inputs_are_refused_unless_asked_for(folder, tdint, changed, make_record):
    """Models, records and plug-ins; asked for, they are named and taken."""
    plugin = f"of_{changed.partition('.')[0]}.py"  # of which one version is executed in a process
    (folder / plugin).write_text("METHODS = ()\n")
    assert tdint(*STORY, "--plugin", plugin).exit_code == 0
    changed = plugin if changed == "plugin" else changed
    if changed == "motion.mseed":
        make_record(folder / changed, "HNE", "HNN", peak=2.0)
    else:
        (folder / changed).write_text((folder / changed).read_text() + "# another one\n")
    refused = rerun(tdint, folder, "out")
    assert refused.exit_code == 2
    assert f"{changed}: is not what was read then" in refused.stderr and "--changed" in refused.stderr
    if changed == plugin:
        return
    taken = rerun(tdint, folder, "out", "--changed")
    assert f"Warning: {changed}: is not what was read then" in taken.stderr
    assert taken.exit_code == (5 if changed == "motion.mseed" else 0)
    assert bool(taken.stdout) == (changed == "motion.mseed")


def test_standard_input_is_asked_for_again(folder, tdint):
    model = (folder / "forced.yaml").read_bytes()
    assert tdint("modes", "-", "-o", "modes.csv", stdin=model).exit_code == 0
    assert tdint("rerun", "modes.json", stdin=model).exit_code == 0
    tdint.refused("-: is not what was read then", "rerun", "modes.json", stdin=model.replace(b"800", b"900"))
    assert tdint("rerun", "modes.json", "--changed", stdin=model.replace(b"800", b"900")).exit_code == 5


def test_an_input_that_is_not_there(folder, tdint):
    assert tdint("modes", "forced.yaml", "-o", "out/modes.csv").exit_code == 0
    (folder / "elsewhere").mkdir()
    (folder / "out/modes.json").rename(folder / "elsewhere/modes.json")
    (folder / "out/modes.csv").rename(folder / "elsewhere/modes.csv")
    assert rerun(tdint, folder, "elsewhere/modes.json").exit_code == 0  # seen from the working directory
    os.chdir(folder / "elsewhere")
    result = rerun(tdint, folder, "modes.json")
    assert (result.exit_code, "forced.yaml: an input of modes.json, is not there" in result.stderr) == (2, True)


def test_versions_that_are_others_are_named(folder, tdint):
    assert tdint("modes", "forced.yaml", "-o", "modes.csv").exit_code == 0
    told = json.loads((folder / "modes.json").read_text())
    told["versions"]["numpy"] = "1.0"
    (folder / "modes.json").write_text(json.dumps(told))
    result = rerun(tdint, folder, "modes.json")
    assert result.exit_code == 0 and "note: numpy 1.0 then, " in result.stderr


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is no JSON file that tdint wrote"),
        ('{"schema": {"name": "another"}}', "is no JSON file that tdint wrote"),
        ('{"schema": {"name": "tdint modes"}}', "says no command line"),
        ('{"schema": {"name": "tdint modes"}, "arguments": "modes"}', "says no command line"),
        ('{"schema": {"name": "tdint modes"}, "arguments": [1]}', "says no command line"),
        ('{"schema": {"name": "tdint modes"}, "arguments": ["-q"]}', "name no command"),
        ('{"schema": {"name": "tdint modes"}, "arguments": ["rerun", "a.json", "-o", "b"]}', "name no command"),
        ('{"schema": {"name": "tdint modes"}, "arguments": ["methods"]}', "name no command"),
        ('{"schema": {"name": "tdint modes"}, "arguments": ["modes", "forced.yaml"]}', "have no -o"),
        ('{"schema": {"name": "tdint modes"}, "arguments": ["modes", "forced.yaml", "-o", "-"]}', "have no -o"),
        ('{"schema": {"name": "tdint x"}, "arguments": ["modes", "-o", "a.csv"], "inputs": [1]}', "is no JSON file"),
        ('{"schema": {"name": "tdint x"}, "arguments": ["modes", "-o", "a.csv"], "versions": 1}', "is no JSON file"),
    ],
)
def test_files_that_say_no_command_line(folder, tdint, content, message):
    (folder / "a.json").write_text(content)
    result = rerun(tdint, folder, "a.json")
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr and "Traceback" not in result.stderr
    assert rerun(tdint, folder, "none.json").exit_code == 2


def test_a_campaign_that_was_done_in_parts(folder, tdint):
    """Of several calls, and exported: as in one. Of shards that were merged: merged again."""
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    for more in (["--max-runs", "1"], ["--max-runs", "1000"]):
        assert tdint("campaign", "campaign.yaml", "-o", "study", *more).exit_code == 0
    assert tdint("campaign", "export", "study").exit_code == 0
    told = json.loads((folder / "study/summary.json").read_text())
    assert told["arguments"] == ["campaign", "campaign.yaml", "-o", "study"]  # how many at a time is not kept
    result = rerun(tdint, folder, "study")
    assert result.exit_code == 0 and "runs.csv: the same" in result.stderr
    for part in ("1", "2"):
        assert tdint("campaign", "campaign.yaml", "-o", f"part-{part}", "--shard", f"{part}/2").exit_code == 0
    assert tdint("campaign", "merge", "part-1", "part-2", "-o", "whole").exit_code == 0
    for name in ("part-1", "whole"):
        assert rerun(tdint, folder, name).exit_code == 0


def test_a_run_that_fails_fails_again(folder, tdint):
    """Without a table: its summary says how it ended."""
    words = ["run", "forced.yaml", "--method", "central-difference", "--dt", "1"]
    assert tdint(*words, "-o", "out").exit_code == 5
    result = rerun(tdint, folder, "out")
    assert "the run was unstable-step then, and is so now" in result.stderr and result.exit_code == 0


def test_differences_of_two_files(tmp_path):
    before, now = tmp_path / "before.csv", tmp_path / "now.csv.gz"
    before.write_text('a,b,d\n1,"x,y",0\n2,,0\n3,z,0\n')
    now.write_bytes(gzip.compress(b'a,b,c\n1,"x,y",\n4,w,\n'))
    assert list(differences(before, now)) == [
        Difference("now.csv.gz", None, "d", "a column", None),
        Difference("now.csv.gz", None, "c", None, "a column"),
        Difference("now.csv.gz", 2, "a", "2", "4"),
        Difference("now.csv.gz", 2, "b", "", "w"),
        Difference("now.csv.gz", None, "", "3 rows", "2 rows"),
    ]
    assert [one.column for one in differences(before, now, but=("a",))] == ["d", "c", "b", ""]
    assert Difference("", 1, "a", "-2", "2").relative == 2.0 and Difference("", 1, "a", "x", "2").relative != 0.0
    now.write_bytes(b"no gzip file")
    with pytest.raises(OutputError, match="cannot be read as CSV"):
        list(differences(before, now))
