"""A command that is killed at any operation of its renaming leaves the earlier result or the new
one, whole, as soon as the next command uses the directory."""

from __future__ import annotations

import errno
import gc
import hmac
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from fuzz.sandbox import invoked
from legible import write_texts
from selection import every
from tdint import system
from tdint.errors import OutputError
from tdint.files import check_outputs, reason_of, settle, write_files
from tdint.studies.store.result_store import FILE

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="forks processes")

MODEL = """\
units: {length: m, force: kN, mass: t}
stories: [{repeat: 2, mass: 100, height: 3, stiffness: 4e4, LAW}]
damping: 3%
analysis: {method: newmark-average}
"""
STUDY = """\
buildings: {models: [MODEL]}
records: {files: [r0.csv, r1.csv]}
intensity: {scales: [SCALES]}
analysis: {method: newmark-average}
outputs: {stories: true}
"""
COMMANDS = {
    "run with a figure": "run m.yaml rN.csv --no-check -o out --plot",
    "run with files elsewhere": "run m.yaml rN.csv --no-check -o out --history=other/h.csv",
    "run of scales": "run m.yaml r0.csv --scale 1,N.5 -o out --plot",
    "spectrum": "spectrum rN.csv -o out/s.csv --plot",
    "modes": "modes mN.yaml -o out/m.csv --plot",
    "info": "info rN.csv -o out/i.csv --plot",
    "pushover": "pushover mN.yaml --drift N% -o out/p.csv --plot",
    "scale": "scale r0.csv r1.csv --target asce7:sds=1,sd1=0.N,tl=8 -o out/f.csv --plot",
    "ida": "ida m.yaml rN.csv --im pga --threshold 1% -o out --plot",
    "campaign": "campaign sN.yaml -o out --plot",
    "shard": "campaign sN.yaml --shard 1/2 -o out",
    "merge": "campaign merge partN -o out",
    "law": "law mN.yaml --drift N% --points 9 -o out/l.csv --plot",
    "drift-spectrum": "drift-spectrum rN.csv -o out/d.csv --plot",
    "sensitivity": "sensitivity m.yaml rN.csv --vary damping=2%:5% -o out/t.csv --plot",
    "fragility": "fragility partN/ida.csv --threshold 1% -o out/f.csv --plot",
    "stability": "stability --method newmark-average --dt-over-t 0.01:N:9 -o out/st.csv --plot",
}
"""Commands with several output files. N is 1 for the earlier result, and 2 for the new one."""


@pytest.fixture
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, not_laid_out: None) -> None:
    """Change to a directory with the inputs. Figures are files with only their texts: rendering
    them took most of the time, and their files are renamed in the same way."""
    monkeypatch.setattr(Figure, "savefig", write_texts)
    (tmp_path / "start").mkdir()
    monkeypatch.chdir(tmp_path / "start")
    write_inputs()


def write_inputs() -> None:
    """Write the inputs of the commands to the working directory."""
    time = np.arange(60) * 0.02
    for number in range(3):
        rows = "\n".join(f"{value:.6f}" for value in np.sin((7.0 + number) * time))
        Path(f"r{number}.csv").write_text(f"# dt = 0.02 s, units = m/s^2\n{rows}\n")
        Path(f"s{number}.yaml").write_text(
            STUDY.replace("MODEL", f"m{number}.yaml").replace("SCALES", f"1, {number}.25")
        )
        law = f"law: {{type: bilinear, yield_force: {60 + number}, hardening: 5%}}"
        Path(f"m{number}.yaml").write_text(MODEL.replace("LAW", law))
    Path("m.yaml").write_text(MODEL.replace(", LAW", ""))
    Path("other").mkdir()


def prepare(name: str) -> str:
    """Create the earlier result of a command, and return the command that replaces it."""
    line = {
        "merge": "campaign sN.yaml -o partN",
        "fragility": "ida m.yaml r0.csv rN.csv --im pga --threshold 1% -o partN",
    }.get(name)
    for number in "12" if line else ():
        assert invoked(["-q", *line.replace("N", number).split()])[0] == 0
    old, new = (COMMANDS[name].replace("N", number) for number in "12")
    assert invoked(["-q", *old.split()])[0] == 0
    return f"{new} --overwrite"


def files_of(root: str) -> dict[str, bytes]:
    """Return the visible results without times; of a store, only the presence is compared."""
    found = {
        path.relative_to(root).as_posix(): b""
        if path.suffix == ".sqlite"
        else re.sub(rb'_(?:time|loop)_s": [0-9.e-]+', b"", path.read_bytes())
        for name in ("out", "other")
        for path in sorted(Path(root, name).rglob("*"))
        if path.is_file() and not path.name.startswith(".")
    }
    # A store that is not complete, and logs of SQLite, are next to a result but not a part of it.
    return {name: data for name, data in found.items() if not name.partition(".sqlite")[2]}


def stopped(line: str, stop: int) -> bool:
    """Run a command in a child process that ends before the renaming operation `stop`, counted from
    0. Return False if the command was completed before."""
    if process := os.fork():
        return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 77
    gc.disable()  # A collection would copy the memory of all objects of the parent.
    count = -1

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        """End the process before the operation, without cleanup."""
        nonlocal count
        renames = event in ("os.rename", "os.remove", "os.link", "os.rmdir")
        journal = event == "open" and ".tdint-journal" in str(arguments[0])
        if (renames or journal) and str(arguments[0]).startswith(str(Path.cwd())):
            count += 1
            if count == stop:
                os._exit(77)

    try:
        sys.addaudithook(watch)
        code, messages = invoked(["-q", *line.split()])
        if code:
            sys.stderr.write(messages)
        os._exit(code)
    finally:
        os._exit(1)


@pytest.mark.parametrize("name", every(12, COMMANDS))
def test_a_kill_at_each_renaming_leaves_a_whole_result(inputs: None, name: str) -> None:
    new = prepare(name)
    start = Path.cwd()
    shutil.copytree(start, "../new")
    os.chdir("../new")
    assert invoked(["-q", *new.split()])[0] == 0
    os.chdir(start)
    results = {"old": files_of("."), "new": files_of("../new")}
    common = [key for key, data in results["old"].items() if results["new"].get(key) != data]
    assert common and len(results["new"]) > 1
    seen = set()
    for stop in range(200):
        shutil.rmtree("../killed", ignore_errors=True)
        shutil.copytree(start, "../killed")
        os.chdir("../killed")
        is_stopped = stopped(new, stop)
        # New files are never next to earlier ones, even before the next command.
        kinds = {
            kind
            for key, data in files_of(".").items()
            for kind in results
            if key in common and key != FILE and results[kind].get(key) == data
        }
        assert len(kinds) < 2, (stop, kinds)
        for folder in ("out", "other"):
            check_outputs([Path(folder, "next.csv")], overwrite=False)
        found = files_of(".")
        assert found in results.values(), (stop, sorted(found))
        seen |= {kind for kind in results if results[kind] == found}
        if stop % 5 == 0:  # the repeated command gives the new result
            assert invoked(["-q", *new.split()])[0] == 0
            assert files_of(".") == results["new"]
            assert not list(Path().rglob(".tdint-*"))
        assert not list(Path().rglob(".tdint-journal"))
        os.chdir(start)
        if not is_stopped:
            break
    assert stop > 3 and seen == {"old", "new"}


def _foreign_journals(folder: Path, names: list[str]) -> dict[str, bytes | Path]:
    """Return journals in a directory that this user did not sign, by what is wrong with them. A
    path is the target of a symbolic link."""
    fields = ["0", [str(folder)], {"n": "x"}, names, True]
    text = json.dumps(fields).encode()
    host = json.dumps(["far", *fields]).encode()  # the form before signatures
    forged = hmac.digest(b"another key", text, "sha256").hex().encode()
    return {
        "form of version 0.1": host,
        "no signature": b"\n" + text,
        "no text": b"\n",
        "key of somebody else": forged + b"\n" + text,
        "not a journal": b"my notes",
        "link to a file": folder.parent / "outside.csv",
        "link to no file": folder.parent / "missing.csv",
    }


@pytest.mark.parametrize("kind", _foreign_journals(Path("in"), []))
def test_a_journal_without_the_signature_of_the_user_has_no_effect(
    tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Commands that read report it, commands that write are refused, and it remains."""
    folder, outside = tmp_path / "in", tmp_path / "outside.csv"
    folder.mkdir()
    outside.write_bytes(b"mine")
    (folder / "kept.csv").write_bytes(b"mine")
    (folder / "n").write_bytes(b"theirs")
    (folder / "x").symlink_to(outside)
    journal, content = folder / ".tdint-journal", _foreign_journals(folder, ["kept.csv"])[kind]
    if isinstance(content, Path):
        journal.symlink_to(content)
    else:
        journal.write_bytes(content)
    before = {path.relative_to(tmp_path): digest(path) for path in tmp_path.rglob("*")}
    for _ in range(2):
        settle(folder, is_read=True)
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    for files in ([folder / "a.csv"], [folder / "a.csv", folder / "b.csv"]):
        with pytest.raises(OutputError, match=r"no signature of this user.*delete it.*--overwrite"):
            write_files(dict.fromkeys(files, b"new"), overwrite=True)
    assert {path.relative_to(tmp_path): digest(path) for path in tmp_path.rglob("*")} == before


def digest(path: Path) -> bytes:
    """Return the content of a file, or the target of a symbolic link."""
    if path.is_symlink():
        return os.fsencode(path.readlink())
    return path.read_bytes() if path.is_file() else b""


@pytest.mark.parametrize("home", ["same", "other", ""])
def test_only_the_key_that_signed_a_journal_completes_the_renaming(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: str
) -> None:
    """A command was killed with the key of the cache `same`. On another machine the user has
    another cache, or none."""
    folder = tmp_path / "out"

    def fail(*_: object) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(system, "cache_home", lambda: tmp_path / "same")
    assert system.user_key() == system.user_key() != b""
    with monkeypatch.context() as patch, pytest.raises(OutputError, match="Input/output error"):
        patch.setattr(Path, "replace", fail)
        write_files({folder / "a.csv": b"new", folder / "b.csv": b"new"}, overwrite=True)
    monkeypatch.setattr(system, "cache_home", lambda: tmp_path / home if home else None)
    if home == "same":
        settle(folder)
        assert sorted(file.name for file in folder.iterdir()) == ["a.csv", "b.csv"]
        return
    with pytest.raises(OutputError, match="no signature of this user"):
        settle(folder)
    (folder / ".tdint-journal").unlink()
    write_files({folder / "a.csv": b"again", folder / "b.csv": b"again"}, overwrite=True)
    assert (folder / "b.csv").read_bytes() == b"again"


def test_a_failed_renaming_is_completed_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """After the earlier files are removed, an error keeps the new ones for the next command."""
    files = [tmp_path / name for name in ("a.csv", "b.csv")]
    write_files(dict.fromkeys(files, b"old"), overwrite=False)

    def fail(*_: object) -> None:
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as patch, pytest.raises(Exception, match="Input/output error"):
        patch.setattr(Path, "replace", fail)
        write_files(dict.fromkeys(files, b"new"), overwrite=True)
    assert not any(file.exists() for file in files)
    settle(tmp_path, is_read=True)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {
        "a.csv": b"new",
        "b.csv": b"new",
    }


def test_two_writers_do_not_mix_their_files(tmp_path: Path) -> None:
    """Processes that replace the same files at the same time leave the files of one of them."""
    names = [tmp_path / f"{letter}.csv" for letter in "abcdef"]
    write_files(dict.fromkeys(names, b"0"), overwrite=False)
    children = []
    for number in (b"1", b"2", b"3"):
        process = os.fork()
        if not process:
            try:
                for _ in range(20):
                    write_files(dict.fromkeys(names, number), overwrite=True)
                os._exit(0)
            finally:
                os._exit(1)  # also after an error, which would run the other tests in this process
        children.append(process)
    codes = [os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) for process in children]
    assert codes == [0, 0, 0]
    assert len({file.read_bytes() for file in names}) == 1
    assert sorted(tmp_path.iterdir()) == names


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_file_that_another_process_removes_is_no_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    """The file is removed after a number of examinations."""
    file, examined, examine = tmp_path / "a.csv", [], Path.stat
    file.write_bytes(b"")

    def watch(path: Path, **how: bool) -> os.stat_result:
        found = examine(path, **how)
        if path == file:
            examined.append(path)
            if len(examined) == count:
                file.unlink()
        return found

    monkeypatch.setattr(Path, "stat", watch)
    check_outputs([file], overwrite=True)


def test_too_few_file_descriptors_are_reported_with_the_remedy(inputs: None) -> None:
    """Python reports modules that cannot be opened as missing. With five descriptors, this was an
    internal error."""
    script = (
        "import resource, sys; from tdint_cli.main import main; "
        "resource.setrlimit(resource.RLIMIT_NOFILE, (COUNT, COUNT)); main()"
    )
    for limit in (5, 6):
        command = [sys.executable, "-c", script.replace("COUNT", str(limit)), "run", "m.yaml"]
        result = subprocess.run([*command, "r0.csv", "-q"], capture_output=True, text=True)
        assert (result.returncode, "ulimit -n" in result.stderr) == (5, True), result.stderr
        assert len(result.stderr.splitlines()) == 1


def test_a_disk_without_inodes_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = list(os.statvfs(tmp_path))
    disk[5:8] = [100, 0, 0]  # inodes: all, free, available
    monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result(disk))
    full = OSError(errno.ENOSPC, "No space left on device")
    assert "no free inode" in reason_of(full, tmp_path / "a.csv")
    assert reason_of(OSError(errno.EACCES, "no"), tmp_path / "a.csv") == "no"
