"""System calls that fail: a full disk, and a file system without locks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from faults import full_disk

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        sys.platform != "linux" or shutil.which("cc") is None, reason="needs a C compiler"
    ),
]

SCRIPT = Path(full_disk.__file__)

WITHOUT_LOCKS = """\
import ctypes, errno, os, sys
from tdint_cli.main import main
ctypes.CDLL(None).set_fault(4, ctypes.c_long(1), 1, errno.ENOLCK, os.getcwd().encode())
main()
"""


@pytest.mark.parametrize("scene", full_disk.SCENES)
def test_a_failed_call_loses_nothing_and_leaves_no_file_in_part(scene):
    every = "1" if scene == "run" else "11"  # a run has few calls
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--scene", scene, "--every", every, "--seed", "3"],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    faults, reported, *_ = (int(cell) for cell in done.stdout.splitlines()[-1].split("|")[2:-1])
    assert faults > 10 and reported > 5


@pytest.fixture(scope="module")
def library():
    library = full_disk.built()
    yield library
    shutil.rmtree(library.parent)


def test_a_file_system_without_locks_is_reported_and_read(folder, library):
    """The reason is not a lock of another process. Stores on it can be read."""
    (folder / "study.yaml").write_text(full_disk.STUDY.replace("r.csv", "r0.csv"))

    def run(*arguments, code, locks=False):
        environment = os.environ if locks else {**os.environ, "LD_PRELOAD": str(library)}
        script = "from tdint_cli.main import main; main()" if locks else WITHOUT_LOCKS
        done = subprocess.run(
            [sys.executable, "-c", script, *arguments],
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == code, done.stderr
        return done.stderr

    message = run("campaign", "study.yaml", "-o", "out", code=6)
    assert "does not support locks (No locks available)" in message and "in use" not in message
    assert not (folder / "out").exists()
    run("campaign", "study.yaml", "-o", "out", code=0, locks=True)
    before = sorted(path.name for path in (folder / "out").iterdir())
    assert "4 of 4 runs completed" in run("campaign", "status", "out", code=0)
    message = run("campaign", "export", "out", code=6)
    assert "does not support locks (No locks available)" in message
    assert sorted(path.name for path in (folder / "out").iterdir()) == before
