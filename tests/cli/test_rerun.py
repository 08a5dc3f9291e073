"""`tdint rerun`: repeat the command that is recorded in a JSON file, in another directory, and
compare the tables."""

import csv
import gzip
import hashlib
import io
import json
import os
import re
import socket
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import click
import pytest

from cli.conftest import STUDY, change
from selection import every
from tdint.errors import OutputError
from tdint.kernels.building import sources
from tdint.output.tables.differences import Difference, differences
from tdint_cli.main import COMMANDS, cli
from tdint_cli.options.grammar import is_recorded

ONE_RUN = ["run", "shaken.yaml", "-o", "out"]
CAMPAIGN = STUDY.replace("units:", "component: HNE, units:") + "outputs: {stories: true}\n"
UNITS = ["--units", "m/s^2", "--component", "HNE"]


def contents(folder):
    """Return all files of a directory with their content, except stores, because SQLite changes
    their logs."""
    files = sorted(
        file for file in folder.rglob("*") if file.is_file() and "sqlite" not in file.name
    )
    return {file: file.read_bytes() for file in files}


@pytest.fixture
def rerun(folder, tdint):
    """Run `tdint rerun WORDS`, and check that existing files are unchanged."""

    def run(*arguments, code=None):
        before = contents(folder)
        result = tdint("rerun", *arguments, code=code)
        now = contents(folder)
        assert {file: now.get(file) for file in before} == before
        return result

    return run


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "table"),
    [
        (
            ("run", "shaken.yaml", "--history=more/motion.csv.gz", "--plot=more/motion.pdf",
             "--report", "page.html"),
            "motion.csv.gz",
        ),
        (("run", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "--sequence"),
         "stories.csv"),
        (("spectrum", "motion.mseed", "other.mseed", *UNITS, "--period", "1", "--plot"),
         "other.csv"),
    ],
    ids=["files of all kinds", "sequence", "spectra"],
)  # fmt: skip
def test_a_directory_is_reproduced_elsewhere_and_compared(folder, tdint, rerun, arguments, table):
    """All tables are compared, including tables in other directories. test_files.py tests a call of
    each command."""
    tdint(*arguments, "-o", "some/study/", code=0)
    summary = next(file for file in sorted(Path("some/study").glob("*.json")))
    assert f"{table}: the same, byte for byte" in rerun(summary, code=0).stderr


def test_different_cells_are_reported_as_a_table(folder, tdint, rerun):
    tdint(*ONE_RUN, code=0)
    file = folder / "out" / "stories.csv"
    cells = [line.split(",") for line in file.read_text().splitlines()]
    cells[2][2] = repr(2.0 * float(cells[2][2]))
    file.write_text("".join(",".join(line) + "\n" for line in cells))
    result = rerun("out", code=5)
    header, line = result.stdout.splitlines()
    assert header == "file,row,column,before,now,relative_difference"
    assert line == f"stories.csv,2,peak_drift_m,{cells[2][2]},{float(cells[2][2]) / 2.0!r},0.5"
    assert re.search(r"stories\.csv: 1 .*50 %.*peak_drift_m.*row 2", result.stderr)
    file.unlink()
    assert "the original file is missing" in rerun("out", code=5).stderr


@pytest.mark.parametrize("arguments", ["modes forced.yaml -o out/t.csv", "run shaken.yaml -o out"])
def test_a_link_to_another_directory_is_not_compared(folder, tdint, rerun, arguments):
    """The cells of the linked file are not printed, also if the bytes are equal."""
    tdint(*arguments.split(), code=0)
    for original in sorted(Path("out").iterdir()):
        content = original.read_bytes()
        for private in (content, re.sub(rb"\d+", b"4711", content)):
            Path("private").write_bytes(private)
            original.unlink()
            original.symlink_to(folder / "private")
            if original.suffix == ".json" and private != content:
                continue  # the file contains another command line
            result = rerun(f"out/{'t.json' if 't.csv' in arguments else 'summary.json'}", code=5)
            assert f"{original.name}: not compared, because {folder / original} is a link" in (
                result.stderr
            )
            assert "4711" not in result.stdout + result.stderr
        original.unlink()
        original.write_bytes(content)


def test_an_output_outside_of_the_directory_is_compared_by_its_bytes(folder, tdint, rerun):
    """A JSON file of another author may name any file of this user as an output."""
    (folder / "work").mkdir()
    Path("work/forced.yaml").write_bytes(Path("forced.yaml").read_bytes())
    os.chdir("work")
    tdint("run", "forced.yaml", "--history=../h.csv", "-o", "out", code=0)
    assert "h.csv: the same, byte for byte" in rerun("out", code=0).stderr
    Path("../h.csv").write_text(re.sub(r"(?m)^0\.1,", "4711,", Path("../h.csv").read_text()))
    result = rerun("out", code=5)
    assert "h.csv: the bytes differ; the contents are not compared" in result.stderr
    assert "4711" not in result.stdout + result.stderr


@pytest.mark.parametrize("key", ["arguments", "export"])
def test_characters_that_cannot_be_encoded_are_refused(folder, tdint, rerun, key):
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    tdint("campaign", "campaign.yaml", "-o", "study", code=0)
    tdint("campaign", "export", "study", "--simcenter", code=0)
    summary = Path("study/summary.json")
    content = json.loads(summary.read_text())
    for index, word in enumerate(content[key]):
        changed = [*content[key]]
        changed[index] = f"{word}\ud800"
        summary.write_text(json.dumps(content | {key: changed}))
        assert len(rerun("study", code=2).stderr.splitlines()) == 1


def test_reproduced_files_are_kept_in_a_requested_directory(folder, tdint, rerun):
    tdint("modes", "forced.yaml", "-o", "modes.csv.gz", code=0)
    rerun("modes.json", "-o", "again/new", code=0)
    assert (folder / "again/new/modes.csv.gz").read_bytes() == (
        folder / "modes.csv.gz"
    ).read_bytes()
    assert re.search(r"\bagain: .*empty", rerun("modes.json", "-o", "again", code=6).stderr)


@pytest.mark.parametrize("changed", ["motion.mseed", "shaken.yaml", "of_a_run.py"])
def test_changed_inputs_are_refused_without_the_option_changed(
    folder, tdint, rerun, changed, make_record
):
    """Changed models, records and plug-ins are refused; with --changed they are listed and used."""
    # A process executes only one version of a plug-in.
    plugin = () if changed != "of_a_run.py" else ("--plugin", changed)
    if plugin:
        (folder / changed).write_text("METHODS = ()\n")
    tdint(*ONE_RUN, *plugin, code=0)
    if changed == "motion.mseed":
        make_record(folder / changed, "HNE", "HNN", peak=2.0)
    else:
        (folder / changed).write_text((folder / changed).read_text() + "# another one\n")
    refused = rerun("out", code=2).stderr
    assert f"{changed}: has changed (SHA-256 recorded " in refused and "--changed" in refused
    if not plugin:
        taken = rerun("out", "--changed", code=5 if changed == "motion.mseed" else 0)
        assert f"Warning: {changed}: has changed (SHA-256 recorded " in taken.stderr
        assert bool(taken.stdout) == (changed == "motion.mseed")


def test_standard_input_is_read_again(folder, tdint):
    model = (folder / "forced.yaml").read_bytes()
    tdint("modes", "-", "-o", "modes.csv", stdin=model, code=0)
    tdint("rerun", "modes.json", stdin=model, code=0)
    other = model.replace(b"800", b"900")
    tdint.refused("-: has changed (SHA-256 recorded ", "rerun", "modes.json", stdin=other)
    tdint("rerun", "modes.json", "--changed", stdin=other, code=5)


def test_a_missing_input_is_reported(folder, tdint, rerun):
    tdint("modes", "forced.yaml", "-o", "out/modes.csv", code=0)
    (folder / "out").rename(folder / "elsewhere")
    rerun("elsewhere/modes.json", code=0)  # The input is found from the working directory.
    os.chdir(folder / "elsewhere")
    assert re.search(r"forced\.yaml: .*modes\.json.*found", rerun("modes.json", code=2).stderr)


def test_different_versions_are_reported(folder, tdint, rerun):
    tdint("modes", "forced.yaml", "-o", "modes.csv", code=0)
    content = json.loads((folder / "modes.json").read_text())
    content["versions"]["numpy"] = "1.0"
    (folder / "modes.json").write_text(json.dumps(content))
    assert re.search(
        r"note: .*numpy is \d.*, but 1\.0 in the recorded run", rerun("modes.json", code=0).stderr
    )


@pytest.mark.parametrize(
    ("schema", "arguments", "entries", "message"),
    [
        ("another", None, {}, "must be a JSON file that tdint wrote"),
        ("tdint modes", None, {}, "contains no command line"),
        ("tdint modes", "modes", {}, "contains no command line"),
        ("tdint modes", [1], {}, "contains no command line"),
        ("tdint modes", ["-q"], {}, "name no command"),
        ("tdint modes", ["rerun", "a.json", "-o", "b"], {}, "name no command"),
        ("tdint modes", ["methods"], {}, "name no command"),
        ("tdint modes", ["compile", "--all", "--clean", "-o", "k"], {}, "name no command"),
        ("tdint modes", ["init", "a.yaml"], {}, "name no command"),
        ("tdint x", ["modes", "-o", "a.csv"], {"export": ["campaign", "other.yaml"]},
         "must be a command line of"),
        ("tdint x", ["campaign", "-o", "a"], {"export": ["campaign", "merge", "b"]},
         "must be a command line of"),
        ("tdint modes", ["modes", "forced.yaml"], {}, "have no -o"),
        ("tdint modes", ["modes", "forced.yaml", "-o", "-"], {}, "have no -o"),
        ("tdint x", ["modes", "a\0.yaml", "-o", "a.csv"], {}, "contains a null character"),
        ("tdint x", ["run", "--plugin", "\0", "-o", "a"], {}, "contains a null character"),
        ("tdint x", ["modes", "-o", "a.csv"], {"inputs": [1]}, "must be a JSON file"),
        ("tdint x", ["modes", "-o", "a.csv"], {"versions": 1}, "must be a JSON file"),
    ],
)  # fmt: skip
def test_files_without_a_command_line_are_refused(
    folder, tdint, schema, arguments, entries, message
):
    about = {"schema": {"name": schema}} | ({"arguments": arguments} if arguments else {}) | entries
    (folder / "a.json").write_text(json.dumps(about))
    assert "Traceback" not in tdint.refused(message, "rerun", "a.json").stderr


def test_empty_and_missing_files_are_refused(folder, tdint):
    (folder / "a.json").write_text("")
    tdint.refused("must be a JSON file that tdint wrote", "rerun", "a.json")
    tdint.refused("none.json", "rerun", "none.json")


def test_a_campaign_of_several_calls_is_reproduced(folder, tdint, rerun):
    """A campaign of several calls with an export is repeated in a single call. Merged shards are
    merged again."""
    pytest.importorskip("pyarrow")
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    for options in (["--max-runs", "1"], ["--max-runs", "1000"]):
        tdint("campaign", "campaign.yaml", "-o", "study", *options, code=0)
    tdint("campaign", "export", "study", "--simcenter", "--output-units", "kip", code=0)
    summary = json.loads((folder / "study/summary.json").read_text())
    # --max-runs is not recorded.
    assert summary["arguments"] == ["campaign", "campaign.yaml", "-o", "study"]
    messages = rerun("study", code=0).stderr
    assert (
        "runs.csv: the same" in messages
        and "runs.parquet: the same" in messages
        and "simcenter.csv: the same" in messages
    )
    (folder / "study/runs.parquet").unlink()
    assert "runs.parquet: not compared, " in rerun("study", code=5).stderr
    for part in ("1", "2"):
        tdint("campaign", "campaign.yaml", "-o", f"part-{part}", "--shard", f"{part}/2", code=0)
    tdint("campaign", "merge", "part-1", "part-2", "-o", "whole", code=0)
    for name in ("part-1", "whole"):
        rerun(name, code=0)


def test_a_failing_run_fails_again(tdint, rerun):
    """A failed run writes no table; its summary contains the status that is compared."""
    tdint("run", "forced.yaml", "--method", "central-difference", "--dt", "1", "-o", "out", code=5)
    assert re.search(r"status .*unstable-step, .*the same", rerun("out", code=0).stderr)


def test_parquet_is_compared(folder, tdint, rerun):
    pytest.importorskip("pyarrow")
    tdint("modes", "forced.yaml", "-o", "a.parquet", code=0)
    assert "a.parquet: the same" in rerun("a.json", code=0).stderr
    file = folder / "a.parquet"
    content = file.read_bytes()
    change("forced.yaml", ("stiffness: 600", "stiffness: 601"))
    tdint("modes", "forced.yaml", "-o", "b.parquet", code=0)
    change("forced.yaml", ("stiffness: 601", "stiffness: 600"))
    file.write_bytes((folder / "b.parquet").read_bytes())
    assert "period_s" in rerun("a.json", code=5).stdout
    file.write_bytes(content[:-9])
    assert "cannot be read as Parquet" in rerun("a.json", code=6).stderr
    file.unlink()
    assert "the original file is missing" in rerun("a.json", code=5).stderr


@pytest.mark.long
def test_measured_times_are_not_compared(folder, tdint, rerun):
    """A file is compared as a table for any file name, and a campaign without tables by
    its store."""
    (folder / "campaign.yaml").write_text(CAMPAIGN.replace("{stories: true}", "[damage]"))
    tdint("campaign", "campaign.yaml", "-o", "study", code=0)
    assert "campaign.sqlite: the same" in rerun("study", code=0).stderr
    tdint("modes", "forced.yaml", "-o", "a.txt", code=0)
    assert "a.txt: the same" in rerun("a.json", code=0).stderr
    tdint("chart forced.yaml --method newmark-average --repeat 1 -o chart.csv", code=0)
    assert re.search(r"chart\.csv: the same.*not compared: ", rerun("chart.json", code=0).stderr)


def test_plugins_are_executed_only_on_request(folder, tdint, rerun):
    """A plug-in that the recorded command used requires --trust; other plug-ins are not loaded."""
    (folder / "trusted.py").write_text("METHODS = ()\n")
    tdint(*ONE_RUN, "--plugin", "trusted.py", code=0)
    refused = rerun("out", code=2).stderr
    assert hashlib.sha256(b"METHODS = ()\n").hexdigest() in refused and "--trust" in refused
    rerun("out", "--trust", code=0)
    (folder / "evil.py").write_text("open('executed', 'w')\n")
    summary = json.loads((folder / "out/summary.json").read_text())
    for plugin in (
        ["--plugin", "evil.py"],
        ["--plugin=evil.py"],
        ["--plugin", "trusted.py,evil.py"],
        ["--plugin", "trusted.py, evil.py"],
    ):
        (folder / "out/summary.json").write_text(
            json.dumps(summary | {"arguments": [*ONE_RUN, *plugin]})
        )
        assert re.search(r"evil\.py: .*\bnot\b", rerun("out", "--trust", code=2).stderr)
        assert "--trust" in rerun("out", "--changed", code=2).stderr
    assert not (folder / "executed").exists()


@pytest.mark.parametrize(
    "sheet",
    every(
        3,
        [
            "lines.linewidth: 2",
            "text.usetex: true",
            "axes.prop_cycle: cycler('color', [().\t__class__])",
        ],
    ),
)
def test_style_sheets_are_used_only_on_request(folder, tdint, rerun, sheet):
    """A style sheet with any content is accepted only with --trust."""
    (folder / "a.mplstyle").write_text("lines.linewidth: 2\n")
    call = ["modes", "forced.yaml", "-o", "modes.csv", "--plot", "--style", "a.mplstyle"]
    tdint(*call, code=0)
    rerun("modes.json", "--trust", code=0)
    (folder / "a.mplstyle").write_text(f"{sheet}\n")
    assert "a.mplstyle (SHA-256 " in rerun("modes.json", code=2).stderr


@pytest.mark.parametrize(
    "options",
    every(
        3,
        [["--dask", "{address}"], ["--jobs", "4"], ["--max-runs=1"], ["--overwrite"], ["-q"],
         ["--help"]],
    ),
    ids=lambda options: options[0].partition("=")[0],
)  # fmt: skip
def test_options_that_select_hosts_or_jobs_are_refused(folder, tdint, rerun, options):
    """A forged command line contains an option that tdint never records; no connection is
    opened."""
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    tdint("campaign", "campaign.yaml", "-o", "study", code=0)
    summary = folder / "study/summary.json"
    honest = json.loads(summary.read_text())
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.2)
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        forged = [option.format(address=address) for option in options]
        export = ["campaign", "export", "study", *forged]
        lines = ({"arguments": [*honest["arguments"], *forged]}, {"export": export})
        for line in lines:
            summary.write_text(json.dumps(honest | line))
            refused = rerun("study", "--trust", "--changed", code=2).stderr
            assert forged[0].partition("=")[0] in refused
            assert "does not record" in refused
        with pytest.raises(TimeoutError):
            server.accept()


def test_options_that_do_not_affect_results_are_not_recorded(folder, tdint):
    """The list of these options is complete; a new option must be added deliberately."""
    group = click.Context(cli)
    unrecorded = {
        name
        for command in COMMANDS
        for option in cli.get_command(group, command).params
        if isinstance(option, click.Option) and not is_recorded(option)
        for name in option.opts
    }
    call_options = {"--jobs", "--max-runs", "--overwrite", "--quiet", "-q", "--debug", "--help-all"}
    assert unrecorded == {"--dask", "--changed"} | call_options
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    typed = ["-q", "campaign", "campaign.yaml", "--jobs", "1", "--max-runs=1000", "-qo", "study"]
    tdint(*typed, "--overwrite", "--debug", code=0)
    recorded = json.loads((folder / "study/summary.json").read_text())["arguments"]
    assert recorded == ["campaign", "campaign.yaml", "-o", "study"]


def test_missing_latex_is_reported(folder, tdint, monkeypatch):
    (folder / "a.mplstyle").write_text("text.usetex: true\n")
    monkeypatch.setenv("PATH", str(folder))
    tdint.refused("text.usetex requires latex", "modes forced.yaml --plot a.png --style a.mplstyle")


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
    assert [difference.column for difference in differences(before, now, but=("a",))] == [
        "d", "c", "b", "",
    ]  # fmt: skip
    assert (
        Difference("", 1, "a", "-2", "2").relative == 2.0
        and Difference("", 1, "a", "x", "2").relative != 0.0
    )
    now.write_bytes(b"no gzip file")
    with pytest.raises(OutputError, match="cannot be read as CSV"):
        list(differences(before, now))


# ---- Every file that the command wrote


def in_another_process(kernels, *arguments):
    """Run a command in another process with TDINT_KERNELS=kernels ("python": interpreted loops)."""
    environment = os.environ | {"TDINT_KERNELS": kernels}
    line = [sys.executable, "-m", "tdint_cli", *arguments]
    subprocess.run(line, env=environment, check=True, capture_output=True)


@pytest.mark.long
def test_interpreted_and_compiled_loops_are_equal_within_rounding(
    folder, tdint, rerun, monkeypatch
):
    """A first run may be interpreted, and the same run later be compiled."""
    # Plug-ins that other tests loaded into this process are not inputs of the run.
    monkeypatch.setattr(sources, "CODE", {})
    in_another_process("python", *ONE_RUN, "--history", "--method", "impulse4")
    assert json.loads((folder / "out/summary.json").read_text())["time_loops"] == "interpreted"
    messages = rerun("out", code=0).stderr
    for file in ("stories.csv", "history.csv", "summary.json"):
        assert f"{file}: equal within rounding" in messages or f"{file}: the same" in messages
    # A separate process is used, because interpreted loops of earlier tests remain in this process.
    in_another_process(os.environ["TDINT_KERNELS"], "run", "shaken.yaml", "-o", "now")
    loops = json.loads((folder / "now/summary.json").read_text())["time_loops"]
    assert loops == ("interpreted" if os.environ["TDINT_KERNELS"] == "python" else "compiled")


@pytest.mark.parametrize(
    ("factor", "code", "message"),
    [
        (1.0, 0, "stories.csv: the same, byte for byte"),
        (1.0 + 1e-10, 0, "stories.csv: equal within rounding: 1 number"),
        (1.0 + 1e-8, 5, "stories.csv: 1 difference"),
    ],
)
def test_last_digits_are_rounding(folder, tdint, rerun, factor, code, message):
    tdint(*ONE_RUN, code=0)
    file = folder / "out/stories.csv"
    cells = [line.split(",") for line in file.read_text().splitlines()]
    cells[2][2] = repr(factor * float(cells[2][2]))
    file.write_text("".join(",".join(line) + "\n" for line in cells))
    result = rerun("out", code=code)
    assert message in result.stderr
    assert bool(result.stdout) == (code == 5)


def test_rounding_is_relative_to_the_peak(tmp_path):
    """The rounding of errors, residuals and values near a zero crossing is relative to the peak
    response. Counts have no rounding."""
    before, now = tmp_path / "before.csv", tmp_path / "now.csv"

    def is_rounding(header, old, new):
        before.write_text(f"{header}\n{old}\n")
        now.write_text(f"{header}\n{new}\n")
        return [difference.is_rounding for difference in differences(before, now)]

    peak = "peak_drift_m,peak_drift_m_error"
    assert is_rounding(peak, "2.0,1e-6", "2.0,1.001e-6") == [True]
    assert is_rounding(peak, "2.0,1e-6", "2.0,1.003e-6") == [False]
    assert is_rounding("other,peak_drift_m_error", "2.0,1e-6", "2.0,1.001e-6") == [False]
    assert is_rounding("peak_drift_m,residual_drift_m", "2.0,1e-15", "2.0,-3e-15") == [True]
    assert is_rounding("peak_drift_m,residual_drift_m", "2.0,1e-15", "2.0,-3e-9") == [False]
    assert is_rounding("energy_error", "1e-12", "-5e-10") == [True]
    assert is_rounding("iterations", "2000000000", "2000000001") == [False]
    assert is_rounding("name", "a", "b") == [False]
    history = "time_s,drift_m"
    assert is_rounding(history, "0,4.0\n0.01,1e-12", "0,4.0\n0.01,3e-9") == [True]
    assert is_rounding(history, "0,4.0\n0.01,1e-12", "0,4.0\n0.01,5e-9") == [False]
    assert is_rounding("drift_m", "4.0\n1e-12", "4.0\n3e-9") == [False]


@pytest.mark.usefixtures("short_matching")
@pytest.mark.long
def test_matched_motions_are_compared(folder, tdint, rerun):
    """Matched ground motions are results of the command: a changed byte and a deleted file are
    reported."""
    design = "ec8:type=1,soil=B,ag=0.25g"
    options = ["--units", "m/s^2", "--component", "HNE", "--range", "0.5:0.7", "--target", design]
    tdint("match", "motion.mseed", *options, "--plot", "-o", "matched", code=0)
    assert "motion-HNE.mseed: the same" in rerun("matched/matched.json").stderr
    rerun("matched/matched.json", code=0)
    for name in ("motion-HNE.mseed", "matched.png"):
        file = folder / "matched" / name
        content = file.read_bytes()
        file.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
        changed = rerun("matched/matched.json", code=5)
        assert f"{name}: not comparable: its bytes differ" in changed.stderr
        file.unlink()
        assert f"{name}: not compared, " in rerun("matched/matched.json", code=5).stderr
        file.write_bytes(content)
    # The JSON file lists a motion that the repeated command does not write.
    summary = json.loads((folder / "matched/matched.json").read_text())
    summary["motions"].append("another.mseed")
    (folder / "matched/matched.json").write_text(json.dumps(summary))
    (folder / "matched/another.mseed").write_bytes(content)
    assert "another.mseed: not compared" in rerun("matched/matched.json", code=5).stderr


def test_numbers_of_the_json_file_are_compared(folder, tdint, rerun):
    tdint(*ONE_RUN, code=0)
    file = folder / "out/summary.json"
    summary = json.loads(file.read_text())
    summary["peaks"]["drift_m"] *= 0.9
    summary["wall_time_s"] *= 2.0
    file.write_text(json.dumps(summary))
    result = rerun("out", code=5)
    assert result.stdout.splitlines()[1].startswith("summary.json,,peaks.drift_m,")
    assert len(result.stdout.splitlines()) == 2


@pytest.mark.long
def test_an_export_into_a_directory_named_export(folder, tdint, rerun):
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    tdint("campaign", "campaign.yaml", "-o", "export", code=0)
    tdint("campaign", "export", "export", "--simcenter", code=0)
    messages = rerun("export", code=0).stderr
    assert "simcenter.csv: the same" in messages
    (folder / "export/simcenter.csv").write_text("forged\n")
    rerun("export", code=5)


@pytest.mark.long
def test_a_failing_command_is_a_failure(folder, tdint, rerun):
    """Here the repeated export fails, and its files are not reported as equal."""
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    tdint("campaign", "campaign.yaml", "-o", "study", code=0)
    tdint("campaign", "export", "study", "--simcenter", code=0)
    file = folder / "study/summary.json"
    summary = json.loads(file.read_text())
    file.write_text(json.dumps(summary | {"export": ["campaign", "export", "study", "--geojson"]}))
    messages = rerun("study", code=2).stderr
    assert "exit code 2" in messages
    assert "simcenter.csv: not compared, " in messages


def test_a_missing_plugin_is_reported(folder, tdint, rerun):
    (folder / "absent.py").write_text("METHODS = ()\n")
    tdint(*ONE_RUN, "--plugin", "absent.py", code=0)
    summary = json.loads((folder / "out/summary.json").read_text())
    summary["inputs"] = [entry for entry in summary["inputs"] if entry["file"] != "absent.py"]
    (folder / "out/summary.json").write_text(json.dumps(summary))
    (folder / "absent.py").unlink()
    assert "absent.py: plug-in of" in rerun("out", "--trust", code=2).stderr
    assert "absent.py: plug-in of" in rerun("out", code=2).stderr


@pytest.mark.parametrize(
    "forged",
    every(
        3,
        [{"files": 5, "motions": 5}, {"files": [5, {"file": 5}], "motions": {"a": 1}},
         {"peaks": 10**400}, {"peaks": {"drift_m": 10**400}}, {"peaks": float("nan")},
         {"peaks": None}, {"unknown": 1}],
    ),
)  # fmt: skip
def test_forged_json_files_are_different(folder, tdint, rerun, forged):
    tdint(*ONE_RUN, code=0)
    file = folder / "out/summary.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | forged))
    again = rerun("out", code=5)
    assert "internal error" not in again.stderr
    columns = {re.split(r"[.\[]", row["column"])[0] for row in rows(again.stdout)}
    assert columns == {*forged}


def test_the_directory_of_another_output_is_not_a_difference(folder, tdint, rerun):
    """The repeated command writes to a temporary directory, which is a setting in its JSON file."""
    (folder / "buildings.csv").write_text(
        "id,NumberOfStories,YearBuilt,StructureType,PlanArea\na,2,1990,W1,2000\n"
    )
    tdint("inventory", "buildings.csv", "--units=ft", "-o", "i.csv", "--models", "models", code=0)
    messages = rerun("i.json", code=0).stderr
    assert "i.json: the same" in messages and "models/a.yaml: the same" in messages
    content = json.loads((folder / "i.json").read_text())
    content["settings"]["models"] = "elsewhere"
    (folder / "i.json").write_text(json.dumps(content))
    assert "settings.models" in rerun("i.json", code=5).stdout


def rows(text):
    """Return the rows of a table of differences as dictionaries."""
    return list(csv.DictReader(io.StringIO(text)))


def test_a_missing_key_is_a_difference(folder, tdint, rerun):
    """A missing key is a difference only for results of the same version, because another version
    may write other keys."""
    tdint(*ONE_RUN, code=0)
    file = folder / "out/summary.json"
    content = json.loads(file.read_text())
    del content["peaks"]
    file.write_text(json.dumps(content))
    (row,) = rows(rerun("out", code=5).stdout)
    assert row["column"] == "peaks" and row["before"] == ""
    content["versions"]["sources"] = "other"
    file.write_text(json.dumps(content))
    rerun("out", code=0)


def test_a_forged_store_is_not_read(folder, tdint, rerun):
    """A view instead of a table could return an unlimited number of rows."""
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    tdint("campaign", "campaign.yaml", "-o", "study", code=0)
    with closing(sqlite3.connect(folder / "study/campaign.sqlite")) as store:
        store.execute("ALTER TABLE shock_rows RENAME TO hidden")
        store.execute("CREATE VIEW shock_rows AS SELECT * FROM hidden")
    assert "internal error" not in rerun("study", code=6).stderr
