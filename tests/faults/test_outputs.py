"""Full disks and limited file sizes, for files and for standard output."""

import subprocess
import sys
from pathlib import Path

import pytest

from selection import every

pytestmark = pytest.mark.skipif(
    not Path("/dev/full").exists(), reason="no device that is always full"
)

TDINT = f"{sys.executable} -P -c 'from tdint_cli.main import main; main()'"


def shell(command, folder):
    return subprocess.run(
        ["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=120
    )


@pytest.mark.parametrize(
    ("limit", "target", "message"),
    every(
        3,
        [
            ("", "/dev/full", "No space left on device"),
            # Without a buffer, `write` writes a part of the data and returns only the smaller
            # number.
            ("ulimit -f 1; PYTHONUNBUFFERED=1", "out.csv", ""),
            ("ulimit -f 1;", "out.csv", ""),
        ],
    ),
)
def test_a_full_standard_output_is_reported(folder, limit, target, message):
    done = shell(f"{limit} {TDINT} init - > {target}", folder)
    assert done.returncode == 6
    assert f"Error: standard output: cannot be written: {message}" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "command", ["law model.yaml --drift 1% -o out.csv", "run model.yaml --history -o out"]
)
@pytest.mark.long
def test_a_size_limit_of_files_is_reported(folder, command):
    done = shell(f"ulimit -f 1; {TDINT} {command} > /dev/null", folder)
    assert done.returncode == 6, done.stderr
    assert "cannot be written: File too large" in done.stderr
    assert not [
        path for path in folder.rglob("*") if "out" in path.name or path.name.startswith(".")
    ]
