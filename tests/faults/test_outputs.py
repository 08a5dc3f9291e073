"""Disks that are full and sizes that are limited, for files and for standard output."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")

TDINT = f"{sys.executable} -P -c 'from tdint_cli.main import main; main()'"
SPECTRUM = "spectrum r0.csv --periods 0.1:10:2000"


def shell(command, folder):
    return subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize(("unbuffered", "command"), [("", SPECTRUM), ("", "methods"), ("PYTHONUNBUFFERED=1", SPECTRUM)])
def test_a_full_disk_behind_standard_output(folder, unbuffered, command):
    done = shell(f"{unbuffered} {TDINT} {command} > /dev/full", folder)
    assert done.returncode == 6
    assert "Error: standard output: cannot be written: No space left on device" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("unbuffered", ["", "PYTHONUNBUFFERED=1"])
def test_a_size_limit_behind_standard_output(folder, unbuffered):
    """Without a buffer `write` takes what still fits and tells so by a smaller number only."""
    done = shell(f"ulimit -f 16; {unbuffered} {TDINT} {SPECTRUM} > out.csv", folder)
    assert done.returncode == 6
    assert "Error: standard output: cannot be written" in done.stderr


@pytest.mark.parametrize(
    "command", ["spectrum r0.csv --periods 0.1:10:2000 -o out.csv", "run model.yaml --history -o out"]
)
def test_a_size_limit_of_files(folder, command):
    done = shell(f"ulimit -f 8; {TDINT} {command} > /dev/null", folder)
    assert done.returncode == 6, done.stderr
    assert "cannot be written: File too large" in done.stderr
    assert not [path for path in folder.rglob("*") if "out" in path.name or path.name.startswith(".")]
