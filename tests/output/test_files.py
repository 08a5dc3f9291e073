"""Files are written completely or not at all, and existing files are kept without permission."""

import errno
import json
import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from tdint.errors import OutputError
from tdint.files import (
    PROTECTED,
    check_outputs,
    protect_input,
    refuse_protected,
    remove_abandoned,
    write_files,
)
from tdint.system import process_start, this_host


def writes(content: bytes):
    return lambda stream: stream.write(content)


def fails(error: BaseException):
    def write(stream):
        stream.write(b"half a fi")
        raise error

    return write


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture(params=[True, False], ids=["links", "no-links"])
def linkable(request, monkeypatch):
    """Run the test with and without hard links."""

    def no_links(*_):
        raise PermissionError(errno.EPERM, "no hard links here")

    if not request.param:
        monkeypatch.setattr(os, "link", no_links)


@pytest.mark.usefixtures("linkable")
def test_a_file_is_written_with_the_usual_permissions(tmp_path):
    file, plain = tmp_path / "a.csv", tmp_path / "plain"
    write_files({file: writes(b"x\n")}, overwrite=False)
    plain.write_bytes(b"")
    assert file.read_bytes() == b"x\n"
    assert file.stat().st_mode == plain.stat().st_mode
    assert names(tmp_path) == ["a.csv", "plain"]


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("a bug"), MemoryError()])
def test_a_failing_writer_changes_no_file(tmp_path, error, overwrite):
    first, second = tmp_path / "a.csv", tmp_path / "b.csv"
    if overwrite:
        second.write_bytes(b"old")
    with pytest.raises(type(error)):
        write_files({first: writes(b"x"), second: fails(error)}, overwrite=overwrite)
    assert names(tmp_path) == (["b.csv"] if overwrite else [])
    assert not overwrite or second.read_bytes() == b"old"


def test_an_existing_file_is_kept_without_overwrite(tmp_path):
    file = tmp_path / "a.csv"
    file.write_bytes(b"old")
    for call in (
        lambda: check_outputs([tmp_path / "b.csv", file], overwrite=False),
        lambda: write_files(
            {tmp_path / "b.csv": writes(b"x"), file: writes(b"x")}, overwrite=False
        ),
    ):
        with pytest.raises(OutputError, match=r"a\.csv: .*exists; .*--overwrite"):
            call()
    assert file.read_bytes() == b"old"
    assert names(tmp_path) == ["a.csv"]
    write_files({file: writes(b"new")}, overwrite=True)
    assert file.read_bytes() == b"new"


@pytest.mark.usefixtures("linkable")
def test_a_file_created_during_writing_is_kept(tmp_path):
    file = tmp_path / "a.csv"
    with pytest.raises(OutputError, match="the file exists"):
        write_files({file: lambda stream: file.write_bytes(b"theirs")}, overwrite=False)
    assert file.read_bytes() == b"theirs"
    assert names(tmp_path) == ["a.csv"]


def test_a_symbolic_link_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    target, link = tmp_path / "real" / "a.csv", tmp_path / "link.csv"
    target.write_bytes(b"old")
    link.symlink_to(target)
    write_files({link: writes(b"new")}, overwrite=True)
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_missing_directories_are_created_and_removed_after_a_failure(tmp_path):
    file = tmp_path / "new" / "deep" / "a.csv"
    check_outputs([file], overwrite=False)
    assert names(tmp_path) == []
    with pytest.raises(KeyboardInterrupt):
        write_files({file: fails(KeyboardInterrupt())}, overwrite=False)
    assert names(tmp_path) == []
    write_files({file: writes(b"x"), tmp_path / "new" / "b.csv": writes(b"y")}, overwrite=False)
    assert file.read_bytes() == b"x"
    assert names(tmp_path / "new") == ["b.csv", "deep"]


def test_files_of_another_process_in_a_new_directory_are_kept(tmp_path):
    folder = tmp_path / "new" / "deep"

    def write(stream):
        (tmp_path / "new" / "theirs").write_bytes(b"")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_files({folder / "a.csv": write}, overwrite=False)
    assert names(tmp_path / "new") == ["theirs"]


def test_invalid_output_paths_are_reported(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_bytes(b"")
    os.mkfifo(tmp_path / "pipe")
    for path, message in (
        ("folder", "this is a directory; specify a file"),
        ("file/a.csv", "file is a file, not a directory"),
        ("file/new/a.csv", "file is a file, not a directory"),
        ("pipe", "this is a device or a pipe"),
        ("x" * 300, "File name too long"),
        ("a\0b", "must not contain a null character"),
    ):
        with pytest.raises(OutputError, match=message):
            check_outputs([tmp_path / path], overwrite=True)  # fmt: skip
    with pytest.raises(OutputError, match="two outputs have this file name"):
        check_outputs([tmp_path / "a.csv", tmp_path / "folder" / ".." / "a.csv"], overwrite=True)


def test_a_directory_without_permission_is_reported_before_the_computation(tmp_path, monkeypatch):
    # The permission is simulated, because root has all permissions.
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(OutputError, match="no permission to write to the directory"):
        check_outputs([tmp_path / "a.csv"], overwrite=False)


@pytest.mark.parametrize("overwrite", [False, True])
def test_stale_files_are_removed_only_with_overwrite_and_if_unchanged(tmp_path, overwrite):
    stale, other, link = tmp_path / "old.csv", tmp_path / "other.csv", tmp_path / "link.csv"
    stale.write_bytes(b"old")
    other.write_bytes(b"mine")
    link.symlink_to(other)
    as_written = dict.fromkeys([stale, other, tmp_path / "never.csv"], sha256(b"old").hexdigest())
    as_written[link] = sha256(b"mine").hexdigest()
    write_files({tmp_path / "a.csv": writes(b"x")}, overwrite=overwrite, stale=as_written)
    kept = ["a.csv", "link.csv", "other.csv"]
    assert names(tmp_path) == (kept if overwrite else sorted([*kept, "old.csv"]))


def test_the_last_file_contains_the_digests_of_the_others(tmp_path):
    first, packed, last = tmp_path / "a.csv", tmp_path / "b.csv.gz", tmp_path / "c.json"
    made = []
    write_files(
        {first: b"x", packed: b"y"},
        overwrite=False,
        last=(
            last,
            lambda digests: json.dumps({file.name: sha for file, sha in digests.items()}).encode(),
        ),
        on_written=made.append,
    )
    content = json.loads(last.read_bytes())
    assert content == {file.name: sha256(file.read_bytes()).hexdigest() for file in (first, packed)}
    assert made == [{file: sha256(file.read_bytes()).hexdigest() for file in (first, packed, last)}]


@pytest.fixture
def reading():
    """Protect inputs as a command does."""
    before = PROTECTED.set({})
    yield
    PROTECTED.reset(before)


@pytest.mark.usefixtures("reading")
def test_inputs_are_never_written_or_removed(tmp_path):
    model, link, hard, other = (tmp_path / name for name in ("m.yaml", "link", "hard", "other"))
    model.write_bytes(b"mine")
    link.symlink_to(model)
    hard.hardlink_to(model)
    other.write_bytes(b"old")
    for read in (link, hard, model):
        PROTECTED.set({})
        protect_input(read)
        for file in (model, link, hard, tmp_path / "." / "m.yaml"):
            with pytest.raises(OutputError, match="this command reads the file"):
                write_files({other: b"new", file: b"new"}, overwrite=True)
            with pytest.raises(OutputError, match="this command reads the file"):
                refuse_protected([file])
    assert (model.read_bytes(), other.read_bytes()) == (b"mine", b"old")
    write_files({other: b"new"}, overwrite=True, stale={model: sha256(b"mine").hexdigest()})
    assert model.read_bytes() == b"mine"


WAITS = """
import sys, time
from pathlib import Path
from tdint.files import write_files

def wait(stream):
    print("half", flush=True)
    time.sleep(60)

write_files({Path(sys.argv[1]): wait}, overwrite=False)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_temporary_files_of_running_processes_and_other_machines_are_kept(tmp_path):
    command = [sys.executable, "-c", WAITS, str(tmp_path / "a.csv")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None and writer.stdout.readline() == "half\n"
        (running,) = names(tmp_path)
        assert str(writer.pid) in running and this_host() in running
        # Earlier process with the same number
        ended = running.replace(f"-{process_start(writer.pid)}-", "-1-")
        remote, old = running.replace(this_host(), "far.0a1b2c3d"), ".tdint-0123456789abcdef.tmp"
        for name in (ended, remote, old):
            (tmp_path / name).write_bytes(b"half")
        remove_abandoned(tmp_path)
        assert names(tmp_path) == sorted([running, remote, old])
        writer.kill()
    remove_abandoned(tmp_path)
    assert names(tmp_path) == sorted([remote, old])


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_a_later_call_removes_the_temporary_files_of_a_killed_process(tmp_path):
    """Both calls write to the same directories; the second call is complete."""
    (tmp_path / "more").mkdir()
    for number in range(2):
        command = [sys.executable, "-c", WAITS, str(tmp_path / ("more/b.csv", "a.csv")[number])]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None and writer.stdout.readline() == "half\n"
            writer.kill()
    assert len(list(tmp_path.rglob(".tdint-*"))) == 2
    write_files({tmp_path / "a.csv": b"x", tmp_path / "more/b.csv": b"y"}, overwrite=False)
    assert names(tmp_path) == ["a.csv", "more"] and names(tmp_path / "more") == ["b.csv"]


@pytest.mark.parametrize(
    ("error", "is_there"), [(PermissionError, True), (ProcessLookupError, False), (None, False)]
)
def test_temporary_files_of_hidden_processes_are_kept(tmp_path, monkeypatch, error, is_there):
    """If /proc is mounted with hidepid=2, it hides the processes of other users, but not the
    processes of this user."""

    def kill(process, number):
        if error:
            raise error

    temporary = tmp_path / f".tdint-{this_host()}-4194303-7-0123456789abcdef.tmp"
    temporary.write_text("live")
    monkeypatch.setattr(os, "kill", kill)
    remove_abandoned(tmp_path)
    assert temporary.exists() == is_there
