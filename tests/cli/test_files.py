"""Files of all commands. The outputs of a call are listed and can be reproduced; a file that a
command did not write is not replaced without --overwrite; no command waits for a pipe."""

import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import click
import pytest

from cli.conftest import Command, check_parquet
from csv_rows import rows
from facts import each_states, states
from selection import every
from tdint.assessment.chart.problem import _load
from tdint.errors import UsageError
from tdint.kernels.building.store import _find_in, file_name
from tdint.kernels.building.target import native
from tdint.system import locked, version_of_sources
from tdint_cli.main import cli
from tdint_cli.options.option_types import FileName

MOTION = "motion.mseed --units m/s^2 --component HNE"
ASCE7 = "asce7:sds=1,sd1=0.6,tl=8"
CONTINUED = {"campaign", "ida", "runs", "merge"}
"""Calls that continue with their own outputs; other commands refuse existing files."""

WRITING = {
    "init": ("init new.yaml --period 0.5", "new.yaml"),
    "run": (
        "run shaken.yaml MOTION -o out --history --plot --floor-spectra roof --floor-period 1",
        "out/stories.csv out/summary.json out/history.csv out/response.png out/floor-spectra.csv",
    ),
    "histories": ("run shaken.yaml MOTION --history=h.csv.gz --plot=p.svg", "h.csv.gz p.svg"),
    "runs": ("run shaken.yaml MOTION --scale 0.5,1 -o out", "out/runs.csv out/summary.json"),
    "modes": ("modes shaken.yaml -o new/m.csv", "new/m.csv"),
    "law": ("law shaken.yaml --drift 0.02 -o l.csv --plot", "l.csv l.png"),
    "pushover": ("pushover shaken.yaml --points 3 -o p.csv --plot", "p.csv p.png"),
    "compare": (
        "compare shaken.yaml --recorded recorded.yaml -o out --plot",
        "out/comparison.csv out/spectra.csv out/summary.json out/comparison.png",
    ),
    "inventory": (
        "inventory town.csv --units ft -o models.csv --models models",
        "models.csv models/house.yaml",
    ),
    "info": ("info MOTION -o i.csv --plot", "i.csv i.png"),
    "spectrum": ("spectrum MOTION --period 0.2,1 -o s.csv --plot=other.pdf", "s.csv other.pdf"),
    "drift-spectrum": ("drift-spectrum MOTION --period 0.2,1 -o d.csv --plot", "d.csv d.png"),
    "campaign": ("campaign study.yaml -o out", "out/runs.csv out/stories.csv out/summary.json"),
    "merge": ("campaign merge part -o out", "out/runs.csv out/stories.csv out/summary.json"),
    "match": (
        f"match motion.mseed UNITS --component HNE --target {ASCE7} --range 0.5:0.7 -o out --plot",
        "out/matched.csv out/matched.json out/matched.png out/motion-HNE.mseed",
    ),
    "scale": (
        "scale motion.mseed UNITS --target target.csv --range 0.2:1 -o f.csv --plot",
        "f.csv f.json f.png",
    ),
    "ida": (
        "ida shaken.yaml MOTION --precision 40% --max-im 1g -o out --plot",
        "out/ida.csv out/capacities.csv out/ida.json out/ida.png",
    ),
    "sensitivity": (
        "sensitivity shaken.yaml MOTION --vary mass_factor=0.9:1.1 -o s.csv --plot",
        "s.csv s.png",
    ),
    "fragility": ("fragility stripes.csv -o f.csv --plot", "f.csv f.png"),
    "stability": ("stability --method wilson --dt-over-t 0.1:1:3 -o s.csv --plot", "s.csv s.png"),
    "overshoot": ("overshoot --method wilson --steps 3 -o s.csv --plot", "s.csv s.png"),
    "order": ("order --method newmark-average --load free -o o.csv --plot", "o.csv o.png"),
    "failures": (
        "failures --problem stiff-node --method newmark-average -o f.csv --plot",
        "f.csv f.png",
    ),
    "examples": (
        "examples 1 --method newmark-average -o out",
        "out/example-1-errors.csv out/figure-07.png",
    ),
    "chart": (
        "chart shaken.yaml --method newmark-average --dt 0.02 --repeat 1 --duration 1 -o c.csv "
        "--plot",
        "c.csv c.png c.json",
    ),
    "validate": ("validate -o v.csv", "v.csv"),
}
"""Call and written files of each command that writes files."""


@pytest.fixture
def study(folder: Path, short_matching: None) -> Path:
    """Directory with the input files of all calls."""
    for name, text in {
        "study.yaml": "buildings: {models: [shaken.yaml]}\nrecords: {files: [other.mseed], units: "
        "m/s^2}\n"
        "outputs: {stories: true}\n",
        "town.csv": "id,NumberOfStories,YearBuilt,StructureType,PlanArea\nhouse,1,1975,W1,1500\nshop,2,1950,URM,900\n",  # noqa: E501
        "stripes.csv": "im,collapses,records\n0.2,1,40\n0.6,4,40\n0.8,13,40\n1,16,40\n",
        "recorded.yaml": "base: {file: motion.mseed, component: HNE, units: m/s^2}\n"
        "floors: {2: {file: motion.mseed, component: HNN, units: m/s^2}}\n",
        "curves.csv": "story,drift_m,shear_N\n"
        + "".join(f"1,{0.01 * i:g},{1e5 + 1e3 * i:g}\n" for i in range(1, 9)),
        "path.csv": "drift_m\n0.01\n-0.01\n",
        "target.csv": "period_s,sa_g\n0.1,1\n2,0.5\n",
        "own.py": "METHODS = ()\n",
    }.items():
        (folder / name).write_text(text)
    return folder


def files_in(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".campaign") and ".sqlite" not in path.name
    }


def arguments_of(line: str, **names: object) -> list[str]:
    """Return the arguments of a command line, with the placeholders MOTION, RECORD and UNITS
    replaced by common options."""
    record = MOTION.replace("motion.mseed", "{read}")
    line = (
        line.replace("MOTION", MOTION).replace("RECORD", record).replace("UNITS", "--units m/s^2")
    )
    return line.format(**names).split()


def parameters_of(name: str) -> list[click.Parameter]:
    command = cli.get_command(click.Context(cli), name)
    return command.params if command else []


def writing_commands() -> set[str]:
    """Return the commands with an option for an output file, a figure or another file."""
    names = cli.list_commands(click.Context(cli))
    return {
        name
        for name in names
        if {"output", "plot", "overwrite"} & {parameter.name for parameter in parameters_of(name)}
    }


def test_every_command_that_writes_or_reads_files_is_tested() -> None:
    """Exceptions are `compile`, which names its files by a hash of their content, and
    `pushover`, which reads its model in the same way as `modes`."""
    assert writing_commands() - {"compile"} == {line.split()[0] for line, _ in WRITING.values()}
    names = cli.list_commands(click.Context(cli))
    takes_files = {
        name
        for name in names
        if any(isinstance(parameter.type, FileName) for parameter in parameters_of(name))
    }
    assert takes_files <= {line.split()[0] for line, _ in READING.values()} | {"pushover"}


@pytest.mark.parametrize("name", cli.list_commands(click.Context(cli)))
def test_empty_file_names_are_refused(name: str) -> None:
    """They are usually unset variables of a shell, and `Path("")` is the working directory."""
    for parameter in parameters_of(name):
        if isinstance(getattr(parameter.type, "item", parameter.type), FileName):
            with pytest.raises(UsageError, match=r"^\S+ must not be empty; specify a name"):
                parameter.type.convert("", parameter, None)


def check_json_file(
    tdint: Command, arguments: list[str], read: dict[str, bytes], written: dict[str, bytes]
) -> None:
    """Check the JSON file of an output: inputs, their sources, options, the meaning of each column,
    and no path except the paths that were typed."""
    (file,) = (
        name for name, data in written.items() if name.endswith(".json") and b'"arguments"' in data
    )
    about = json.loads(written[file])
    assert (
        about["schema"]["name"] in (f"tdint {arguments[0]}", "tdint campaign")
        and about["arguments"] == arguments
    )
    inputs = {entry["file"]: entry["sha256"] for entry in about["inputs"]}
    assert inputs == {name: sha256(read[name]).hexdigest() for name in inputs}
    assert read.keys() & arguments <= inputs.keys()
    assert about["versions"]["sources"] == version_of_sources()[1]
    assert str(Path.cwd()).encode() not in written[file]
    header = written.get(f"{file.removesuffix('json')}csv", b"").decode().partition("\n")[0]
    assert not header or set(header.split(",")) <= set(about["columns"])


@pytest.mark.parametrize("name", WRITING)
def test_overwrite_replaces_an_existing_file(study: Path, tdint: Command, name: str) -> None:
    """Without the option the file is kept."""
    if name == "merge":
        tdint("campaign", "study.yaml", "-o", "part", code=0)
    arguments, file = arguments_of(WRITING[name][0]), study / WRITING[name][1].split()[0]
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(b"mine")
    tdint(*arguments, code=6)
    assert file.read_bytes() == b"mine"
    tdint(*arguments, "--overwrite", code=0)
    assert file.read_bytes() != b"mine"


@pytest.mark.long
@pytest.mark.parametrize("name", WRITING)
def test_files_of_other_origin_are_not_replaced(study: Path, tdint: Command, name: str) -> None:
    """A command lists the files that it wrote, and writes them again without --overwrite, with
    equal bytes except for times."""
    line, listed_files = WRITING[name]
    arguments, files = arguments_of(line), listed_files.split()
    if name == "merge":
        tdint("campaign", "study.yaml", "-o", "part", code=0)
    before = files_in(study)
    for file in files:
        path = study / file
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"mine")
        result = tdint.refused(f"{file}: the file exists", *arguments, code=6)
        assert "--overwrite to replace it" in result.stderr
        assert files_in(study) == before | {file: b"mine"}
        path.unlink()
    tdint(*arguments, code=0)
    written = {file: data for file, data in files_in(study).items() if file not in before}
    assert set(files) <= set(written)
    if name not in ("init", "histories"):
        check_json_file(tdint, arguments, before, written)
    tdint(*arguments, code=0 if name in CONTINUED else 6)
    assert files_in(study) == before | written
    for file in written:
        (study / file).write_bytes(b"mine")
        result = tdint(*arguments)
        assert (result.exit_code, (study / file).read_bytes()) == (6, b"mine"), (
            file,
            result.output,
        )
        (study / file).write_bytes(written[file])
    (study / files[0]).write_bytes(b"mine")
    tdint(*arguments, "--overwrite", code=0)
    now = files_in(study)
    timed = {"out/summary.json", "c.csv", "c.json", "c.png"}  # These files contain measured times.
    assert {file: now[file] for file in written if file not in timed} == {
        file: data for file, data in written.items() if file not in timed
    }
    assert (study / files[0]).read_bytes() != b"mine"


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in WRITING if name != "merge"])
def test_files_of_a_command_are_replaced_together(
    study: Path, tdint: Command, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """When the first new file has its name, no earlier file of the command is left: a command that
    is killed at any moment leaves no mixture."""
    arguments = arguments_of(WRITING[name][0])
    before = files_in(study)
    tdint(*arguments, code=0)
    written = files_in(study).keys() - before
    for file in written:
        (study / file).write_bytes(b"mine")
    replace, left = Path.replace, []

    def watched(source: Path, target: Path) -> Path:
        left.append({file for file in written if (study / file).read_bytes() == b"mine"})
        return replace(source, target)

    def read_bytes(file: Path) -> bytes:
        return read(file) if file.exists() else b""

    read = Path.read_bytes
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", watched)
        patch.setattr(Path, "read_bytes", read_bytes)
        tdint(*arguments, "--overwrite", code=0)
    assert len(left) >= len(written) and set().union(*left) == set()


HOSTILE = {
    "journal": "no signature of this user",
    "link to a file": "symbolic link|not a regular file|levels of symbolic links",
    "link to no file": "symbolic link|not a regular file|levels of symbolic links",
}
"""Contents of a directory from somebody else, with the reason for which no command writes to it."""


def states_of(folder: Path) -> dict[str, bytes]:
    """Return the content of each file except locks, and the target of each symbolic link."""
    return {
        str(path.relative_to(folder)): os.fsencode(path.readlink())
        if path.is_symlink()
        else path.read_bytes()
        for path in folder.rglob("*")
        if path.is_symlink() or (path.is_file() and path.name != ".campaign.lock")
    }


def lay_traps(folder: Path, names: list[str], home: Path, kind: str) -> None:
    """Write a journal that replaces a file of the user to a directory, or links of these names to
    the directory `home`, which contains or does not contain the targets."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "notes.txt").write_bytes(b"mine")
    if kind == "journal":
        (folder / "n").write_bytes(b"theirs")
        (folder / "x").symlink_to(home / "settings")
        fields = ["far", "0", ["/x"], {"n": "x"}, ["notes.txt"], True]
        (folder / ".tdint-journal").write_text(json.dumps(fields))
    for name in names if "link" in kind else ():
        (folder / name).symlink_to(home / ("settings" if kind == "link to a file" else name))


@pytest.mark.parametrize("kind", HOSTILE)
@pytest.mark.parametrize("name", WRITING)
def test_a_directory_from_somebody_else_changes_no_other_file(
    study: Path, tdint: Command, tmp_path_factory: pytest.TempPathFactory, name: str, kind: str
) -> None:
    """A journal in the directory of the outputs, or outputs and locks that are links: nothing is
    written, even with --overwrite."""
    home = tmp_path_factory.mktemp("home")
    (home / "settings").write_bytes(b"mine")
    if name == "merge":
        tdint("campaign", "study.yaml", "-o", "part", code=0)
    line, files = WRITING[name]
    written = [study / file for file in files.split()]
    for folder in {file.parent for file in written}:
        lay_traps(folder, [file.name for file in written if file.parent == folder], home, kind)
    before = states_of(study) | states_of(home)
    for option in ([], ["--overwrite"]):
        assert re.search(HOSTILE[kind], tdint(*arguments_of(line), *option, code=6).stderr) or (
            kind == "link to a file" and not option  # the file exists
        )
        assert states_of(study) | states_of(home) == before


@pytest.mark.parametrize("name", [".campaign.lock", "campaign.sqlite", "campaign.sqlite-wal"])
def test_locks_and_stores_are_never_links(study: Path, tdint: Command, name: str) -> None:
    for target in ("missing", "town.csv"):
        (study / "out").mkdir(exist_ok=True)
        (study / "out" / name).symlink_to(study / target)
        before = states_of(study)
        for option in ([], ["--overwrite"]):
            tdint("campaign", "study.yaml", "-o", "out", *option, code=6)
            assert states_of(study) == before
        (study / "out" / name).unlink()


LOOKING = [
    "campaign status DIR",
    "campaign status DIR/*",
    "campaign export DIR",
    "campaign merge DIR -o new",
    "fragility DIR --threshold 1%",
    "info DIR UNITS",
    "spectrum DIR UNITS --period 1",
    "run shaken.yaml DIR/motion.mseed UNITS --component HNE --no-check",
    "check DIR/shaken.yaml",
    "modes DIR/shaken.yaml",
    "scale DIR UNITS --to pga=0.4g",
]
"""Calls that read a directory or a file in it."""


@pytest.mark.parametrize("line", LOOKING)
def test_a_directory_that_is_read_is_not_changed(study: Path, tdint: Command, line: str) -> None:
    """Neither a journal nor a store in it changes a file; the journal is named."""
    tdint("campaign", "study.yaml", "-o", "DIR", code=0)
    for name in ("shaken.yaml", "motion.mseed"):
        shutil.copy(study / name, study / "DIR" / name)
    home = study / "home"
    home.mkdir()
    (home / "settings").write_bytes(b"mine")
    lay_traps(study / "DIR", [], home, "journal")
    before = states_of(study)
    result = tdint(*arguments_of(line))
    assert "no signature of this user" in result.stderr, result.output
    after = states_of(study)
    assert {file: after.get(file) for file in before} == before
    assert {file.split("/")[0] for file in after.keys() - before.keys()} <= {"new"}


READING = {
    "init": ("init FIFO --overwrite", 6),
    "check": ("check FIFO", 3),
    "model": ("run FIFO", 3),
    "record": ("run shaken.yaml FIFO", 4),
    "record of a model": ("run piped.yaml", 4),
    "response of an instrument": ("info motion.mseed --inventory FIFO", 4),
    "history": ("run shaken.yaml MOTION --history=FIFO.csv --overwrite", 6),
    "figure": ("info MOTION --plot=FIFO.png --overwrite", 6),
    "factors": ("run shaken.yaml motion.mseed UNITS --factors FIFO", 3),
    "path": ("law shaken.yaml --path FIFO", 2),
    "recordings": ("compare shaken.yaml --recorded FIFO -o out", 3),
    "table": ("modes shaken.yaml -o FIFO.csv --overwrite", 6),
    "inventory": ("inventory FIFO --units ft", 3),
    "models": ("inventory town.csv --units ft --models FIFO --overwrite", 6),
    "target": ("scale motion.mseed UNITS --target FIFO", 3),
    "spectrum": ("spectrum MOTION --against FIFO", 4),
    "match": (f"match FIFO UNITS --target {ASCE7} -o out", 4),
    "target of a spectrum": ("spectrum MOTION --target FIFO --plot=s.png", 3),
    "drift-spectrum": ("drift-spectrum FIFO UNITS", 4),
    "campaign": ("campaign FIFO -o out", 3),
    "status": ("campaign status FIFO", 2),
    "merge": ("campaign merge FIFO -o out", 2),
    "output directory": ("campaign study.yaml -o FIFO", 6),
    "ida": ("ida shaken.yaml FIFO UNITS", 4),
    "fragility": ("fragility FIFO", 3),
    "chart": ("chart FIFO", 3),
    "overshoot": ("overshoot -o FIFO.csv --overwrite", 6),
    "stability": ("stability -o FIFO.csv --overwrite", 6),
    "order": ("order --method newmark-average --load free -o FIFO.csv --overwrite", 6),
    "failures": ("failures -o FIFO.csv --overwrite", 6),
    "examples": ("examples 1 -o FIFO --overwrite", 6),
    "validate": ("validate -o FIFO.csv --overwrite", 6),
    "compile": ("compile FIFO", 3),
    "sensitivity": ("sensitivity FIFO MOTION --vary mass_factor=0.9:1.1", 3),
    "plug-in": ("methods --plugin FIFO.py", 2),
}
"""Calls with a named pipe instead of a file, and their exit codes."""


@contextmanager
def not_longer_than(seconds: float) -> Iterator[None]:
    """Raise TimeoutError if the block exceeds the time."""

    def too_long(*_: Any) -> None:
        raise TimeoutError(f"waited for {seconds} s")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
@pytest.mark.parametrize("name", every(3, READING))
def test_a_named_pipe_does_not_block_a_command(study: Path, tdint: Command, name: str) -> None:
    line, code = READING[name]
    arguments = arguments_of(line)
    (study / "piped.yaml").write_text(
        (study / "shaken.yaml").read_text().replace("motion.mseed", "FIFO")
    )
    for pipe in {word.rpartition("=")[2] for word in arguments if "FIFO" in word} | {"FIFO"}:
        os.mkfifo(study / pipe)
    with not_longer_than(60.0):
        result = tdint(*arguments)
    assert (result.exit_code, len(result.stderr.splitlines())) == (code, 1), result.output
    assert "FIFO" in result.stderr


@pytest.mark.parametrize("name", every(3, [name for name in READING if "FIFO" in READING[name][0]]))
@pytest.mark.parametrize("text", ["root:secret-hash:20228:0\nbin:*:20228\n", "secret-hash 20228\n"])
def test_no_command_prints_the_content_of_another_file(
    study: Path, tdint: Command, name: str, text: str
) -> None:
    """Messages about a file that is not of the expected type do not contain its text."""
    line, _ = READING[name]
    arguments = arguments_of(line)
    for file in {word.rpartition("=")[2] for word in arguments if "FIFO" in word}:
        (study / file).write_text(text)
    result = tdint(*arguments)
    assert "20228" not in result.output and "secret-hash" not in result.output


@pytest.mark.parametrize("text", ["root:secret-hash:20228:0\nbin:*:20228\n", "secret-hash 20228\n"])
@pytest.mark.parametrize("command", ["check", "run"])
def test_a_table_of_forces_does_not_print_another_file(
    study: Path, tdint: Command, command: str, text: str
) -> None:
    (study / "settings.txt").write_text(text)
    (study / "pushed.yaml").write_text(
        "stories: [{mass: 1, stiffness: 1}]\nanalysis: {duration: 1}\n"
        "excitation: {forces: [{floor: 1, file: settings.txt, column: f_kN}]}\n"
    )
    result = tdint(command, "pushed.yaml")
    assert result.exit_code in (3, 4) and "settings.txt" in result.stderr
    assert "20228" not in result.output and "secret-hash" not in result.output


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
@pytest.mark.parametrize("cached_file", ["object", "lock", "reference"])
def test_a_named_pipe_in_the_cache_does_not_block_a_command(
    study: Path, tdint: Command, monkeypatch: pytest.MonkeyPatch, cached_file: str
) -> None:
    pipe = study / "pipe"
    os.mkfifo(pipe)
    with not_longer_than(60.0):
        if cached_file == "lock":
            with locked(pipe, lambda: None):
                pass
        elif cached_file == "reference":
            assert _load(pipe, None, 1) is None  # type: ignore[arg-type]
        else:
            target = native()
            shutil.move(pipe, study / file_name("a:b", "v", target))
            assert _find_in(study, False, "a:b", "v", (target,)) is None


KEPT_SAFE = {
    "run --plot": ("shaken.yaml", ".png", "run {read} MOTION --plot={written}"),
    "run --report": ("shaken.yaml", ".html", "run {read} MOTION --report {written}"),
    "run --history": ("shaken.yaml", ".csv", "run {read} MOTION --history={written}"),
    "run RECORD": ("motion.mseed", ".png", "run shaken.yaml RECORD --plot={written}"),
    "run, the model's record": ("motion.mseed", ".png", "run own.yaml --plot={written}"),
    "runs --plot": ("shaken.yaml", ".png", "run {read} MOTION --scale 1,2 --plot={written}"),
    "runs --report": (
        "shaken.yaml",
        ".html",
        "run {read} MOTION --scale 1,2 -o o --report {written}",
    ),
    "modes -o": ("shaken.yaml", ".csv", "modes {read} -o {written}"),
    "modes -o of the summary": ("shaken.yaml", ".json", "modes {read} -o {beside}.csv"),
    "modes --report": (
        "shaken.yaml",
        ".html",
        "modes {read} --target asce7:sds=1,sd1=0.6,tl=8 --report {written}",
    ),
    "compare --report": (
        "shaken.yaml",
        ".html",
        "compare {read} --recorded recorded.yaml --report {written}",
    ),
    "pushover --report": ("shaken.yaml", ".html", "pushover {read} --report {written}"),
    "modes --plot": ("shaken.yaml", ".png", "modes {read} -o m.csv --plot={written}"),
    "law -o": ("shaken.yaml", ".csv", "law {read} --drift 1% -o {written}"),
    "law --path": ("path.csv", ".csv", "law shaken.yaml --path {read} -o {written}"),
    "pushover -o": ("shaken.yaml", ".csv", "pushover {read} -o {written}"),
    "compare -o": ("recorded.yaml", ".csv", "compare shaken.yaml --recorded {read} -o {written}"),
    "compare --plot": (
        "shaken.yaml",
        ".png",
        "compare {read} --recorded recorded.yaml --plot={written}",
    ),
    "inventory -o": ("town.csv", ".csv", "inventory {read} --units ft -o {written}"),
    "inventory --models": ("town.csv", ".yaml", "inventory {read} --units ft --models . -o t.csv"),
    "info -o": ("motion.mseed", ".csv", "info RECORD -o {written}"),
    "info --export": ("motion.mseed", ".mseed", "info RECORD --export {written}"),
    "info DIR": ("motion.mseed", ".mseed", "info many UNITS -o {written}"),
    "spectrum -o": ("motion.mseed", ".csv", "spectrum RECORD --period 1 -o {written}"),
    "spectrum --jobs": (
        "motion.mseed",
        ".mseed",
        "spectrum many UNITS --period 1 --jobs 2 -o {written}",
    ),
    "spectrum --against": ("target.csv", ".csv", "spectrum MOTION --against {read} -o {written}"),
    "spectrum --target": ("target.csv", ".csv", "spectrum --target {read} -o {written}"),
    "drift-spectrum -o": ("motion.mseed", ".csv", "drift-spectrum RECORD --period 1 -o {written}"),
    "campaign --plot": ("study.yaml", ".png", "campaign {read} -o o --plot={written}"),
    "campaign --report": ("shaken.yaml", ".html", "campaign of-it.yaml -o o --report {written}"),
    "campaign -o": ("study.yaml", ".csv", "campaign {read} -o {folder}"),
    "match --plot": (
        "motion.mseed",
        ".png",
        f"match RECORD --target {ASCE7} -o o --plot={{written}}",
    ),
    "scale -o": ("motion.mseed", ".csv", "scale RECORD --to pga=0.4g -o {written}"),
    "scale --spectra": ("target.csv", ".csv", "scale MOTION --target {read} --spectra {written}"),
    "ida --plot": ("shaken.yaml", ".png", "ida {read} MOTION --precision 40% --plot={written}"),
    "ida --report": (
        "shaken.yaml",
        ".html",
        "ida {read} MOTION --precision 40% -o o --report {written}",
    ),
    "sensitivity -o": (
        "motion.mseed",
        ".csv",
        "sensitivity shaken.yaml RECORD --vary mass_factor=0.9:1.1 -o {written}",
    ),
    "fragility --report": ("stripes.csv", ".html", "fragility {read} --report {written}"),
    "fragility -o": ("stripes.csv", ".csv", "fragility {read} -o {written}"),
    "fragility --openquake": ("stripes.csv", ".xml", "fragility {read} --openquake {written}"),
    "chart -o": ("shaken.yaml", ".csv", "chart {read} --method newmark-average -o {written}"),
    "stability --plugin": (
        "own.py",
        ".py",
        "stability --plugin {read} --method wilson -o {written}",
    ),
}
"""For each option that writes a file: the input file with the name of the output, its suffix, and
the call."""


def test_every_option_that_writes_a_file_is_tested() -> None:
    """Exceptions are directories with fixed file names, commands without inputs, and options that
    are part of `Outputs` in every command."""
    lines = [line.split() for _, _, line in KEPT_SAFE.values()]
    tried = {
        (arguments[0], argument.partition("=")[0]) for arguments in lines for argument in arguments
    }
    for name in writing_commands():
        for option in parameters_of(name):
            is_written = isinstance(option.type, FileName) and option.type.written
            if is_written and option.opts[0] not in ("--plot", "-o"):
                assert (name, option.opts[0]) in tried | {("init", "file")}, name
    reading = {arguments[0] for arguments in lines}
    assert writing_commands() - reading == {
        "init", "overshoot", "failures", "examples", "order", "validate", "compile",
    }  # fmt: skip


def lay_out(study: Path, file: str, read: Path, copy: str = "") -> None:
    """Write a copy of a file. own.yaml refers to `copy` as record, of-it.yaml as model; by default,
    both refer to the files of the study."""
    (study / "many").mkdir()
    shutil.copy(study / file, study / read)
    text = (study / "shaken.yaml").read_text().partition("excitation:")[0]
    record = f"{{file: {copy or 'motion.mseed'}, units: m/s^2, component: HNE}}"
    (study / "own.yaml").write_text(f"{text}excitation: {{record: {record}}}\n")
    (study / "of-it.yaml").write_text(
        (study / "study.yaml").read_text().replace("shaken.yaml", copy or "shaken.yaml")
    )


@pytest.mark.parametrize(
    ("name", "link"),
    every(
        3,
        [
            *((name, "") for name in KEPT_SAFE),
            *itertools.product(("modes -o", "run RECORD"), ("symbolic", "hard")),
        ],
    ),
)
def test_input_files_are_never_replaced(study: Path, tdint: Command, name: str, link: str) -> None:
    file, suffix, line = KEPT_SAFE[name]
    folder = {"campaign -o": "runs", "inventory --models": "house"}.get(name, "kept")
    read = Path("many", f"a{suffix}") if "many" in line else Path(f"{folder}{suffix}")
    lay_out(study, file, read, copy=str(read))
    written = read
    if link:
        written = Path(f"link{suffix}")
        (os.symlink if link == "symbolic" else os.link)(study / read, study / written)
    before = files_in(study)
    arguments = arguments_of(line, read=read, written=written, beside=written.stem, folder=".")
    result = tdint(*arguments, "--overwrite")
    assert result.exit_code == 6, result.output
    assert "this command reads the file" in result.stderr
    after = files_in(study)
    assert {file: after.get(file) for file in before} == before


@pytest.mark.parametrize("where", every(2, ["is a file, not a directory", "the file exists"]))
@pytest.mark.parametrize(
    "name",
    every(
        3,
        [
            name
            for name, (file, _, line) in KEPT_SAFE.items()
            if "{written}" in line and file != "own.py"
        ],
    ),
)
def test_unwritable_outputs_are_reported_before_the_computation(
    study: Path, tdint: Command, name: str, where: str
) -> None:
    """Every output of every command that cannot be written causes exit code 6 before the
    computation starts."""
    file, suffix, line = KEPT_SAFE[name]
    lay_out(study, file, Path("many", f"a{Path(file).suffix}"))
    written = Path(f"there{suffix}") if "exists" in where else Path(f"shaken.yaml/there{suffix}")
    if "exists" in where:
        (study / written).write_bytes(b"mine")
    before = files_in(study)
    result = tdint(
        *arguments_of(line, read=file, written=written, beside="", folder=".").copy(), code=6
    )
    assert where in result.stderr and result.stdout == ""
    assert files_in(study) == before


def test_standard_input_from_a_file_is_not_replaced(study: Path) -> None:
    before = (study / "shaken.yaml").read_bytes()
    command = [sys.executable, "-m", "tdint_cli", "modes", "-", "-o", "shaken.yaml", "--overwrite"]
    with (study / "shaken.yaml").open("rb") as stream:
        done = subprocess.run(command, stdin=stream, capture_output=True, text=True, check=False)
    assert (done.returncode, "this command reads the file" in done.stderr) == (6, True), done.stderr
    assert (study / "shaken.yaml").read_bytes() == before


def test_a_run_removes_only_files_of_an_earlier_run(study: Path, tdint: Command) -> None:
    call = arguments_of("run shaken.yaml MOTION -o out --overwrite")
    tdint(
        *call, "--history", "--plot", "--floor-spectra", "roof", "--export-floors", "mseed", code=0
    )
    first = files_in(study / "out")
    listed = json.loads(first["summary.json"])["files"]
    assert {entry["file"]: entry["sha256"] for entry in listed} == {
        name: sha256(data).hexdigest() for name, data in first.items() if name != "summary.json"
    }
    edited = {"history.csv": b"mine", "response.png": b"mine", "notes.txt": b"mine"}
    for name, data in edited.items():
        (study / "out" / name).write_bytes(data)
    messages = tdint(*call, code=0).stderr
    assert states(messages, "history.csv, response.png ... not removed, ... changed")
    remaining = files_in(study / "out")
    assert set(remaining) == {"stories.csv", "summary.json", *edited}
    assert {name: remaining[name] for name in edited} == edited
    (study / "out" / "summary.json").write_bytes(b"[")  # invalid summary without a list of files
    messages = tdint(*call, code=0).stderr
    assert states(messages, "history.csv, response.png ... not removed, ... does not list")
    assert {name: files_in(study / "out")[name] for name in edited} == edited


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--plot=x.jpg",), "a figure must be written as .png, .pdf or .svg"),
        (("--plot", "mine.png"), "mine.png: the file exists"),
        (("--report", "mine.html"), "mine.html: the file exists"),
        (("--report", "many/no/r.html"), "many is a file, not a directory"),
        (("--report", "r.pdf"), "the report is HTML"),
    ],
)
@pytest.mark.parametrize("call", ["campaign study.yaml", "run shaken.yaml MOTION --scale 1,2"])
def test_output_names_are_checked_before_the_runs(
    study: Path, tdint: Command, options: tuple[str, ...], message: str, call: str
) -> None:
    for name in ("mine.png", "mine.html", "many"):
        (study / name).write_bytes(b"mine")
    before = files_in(study)
    tdint.refused(
        message,
        *arguments_of(call),
        "-o",
        "out",
        *options,
        code=6 if "many" in options[-1] or "exists" in message else 2,
    )
    assert files_in(study) == before and not (study / "out" / "campaign.sqlite").exists()


def test_a_dash_is_standard_output(study: Path, tdint: Command) -> None:
    before = files_in(study)
    for line in (
        "modes shaken.yaml",
        "spectrum MOTION --period 1",
        "stability --method wilson --dt-over-t 0.1",
    ):
        arguments = arguments_of(line)
        assert tdint(*arguments, "-o", "-").stdout == tdint(*arguments).stdout != ""
    tdint.refused("this command writes a directory", *arguments_of("run shaken.yaml MOTION -o -"))
    assert files_in(study) == before


@pytest.mark.parametrize(
    "line",
    [
        "modes shaken.yaml --output-units kN,mm,t",
        "law shaken.yaml --drift 1%",
        "pushover shaken.yaml --points 5",
        "info motion.mseed",
        "stability --method hht --dt-over-t 0.1:1:3",
        "validate",
    ],
)
def test_a_single_table_is_written_as_parquet(folder, tdint, line):
    """The Parquet file has the columns and texts of the CSV file, and its numbers to 12 digits;
    each column states its unit."""
    pytest.importorskip("pyarrow")
    for file in ("a.csv", "a.parquet"):
        tdint(*line.split(), "-o", file, "--overwrite", code=0)
    table = check_parquet("a.parquet", rows(Path("a.csv").read_text()))
    columns = json.loads(Path("a.json").read_text())["columns"]
    for name in table.column_names:
        known = {key.decode(): value.decode() for key, value in table.field(name).metadata.items()}
        assert known["meaning"] and known.get("unit") == columns[name].get("unit")


@pytest.mark.parametrize(
    "line", ["spectrum motion.mseed", "run shaken.yaml", "ida shaken.yaml motion.mseed"]
)
def test_parquet_is_refused_for_commands_with_several_tables(folder, tdint, line):
    result = tdint(*line.split(), "-o", "a.parquet", code=2)
    assert each_states(result.stderr.splitlines(), ["Error: -o a.parquet: ... only CSV"])


def test_parquet_without_pyarrow_is_refused_before_the_computation(folder, tdint, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    result = tdint("modes", "none.yaml", "-o", "a.parquet", code=2)
    facts = "Error: ... Parquet ... pyarrow, ... not installed; ... pip install 'tdint[parquet]'"
    assert each_states(result.stderr.splitlines(), [facts])
