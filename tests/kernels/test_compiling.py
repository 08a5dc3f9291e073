"""The cache of compiled kernels: never stale, never in the way."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tdint

PACKAGE = Path(tdint.__file__).parent
FOLDER = "from tdint.kernels.compiling import cache_folder; print(cache_folder())"
# A kernel of a line, with a function of another file in it: fast to compile.
KERNEL = (
    "import logging, sys; logging.basicConfig(level=logging.INFO, stream=sys.stdout, format='%(message)s');"
    "from tdint.kernels.compiling import F8, inlined, kernel\n"
    "from tdint.kernels.march import stepping\n"
    "def twice(x):\n    return 2.0 * x\n"
    "for _ in range(2):\n    print(kernel(F8(F8))(twice).compiled(4.0))\n"
)


def python(code, folder, **environment):
    (folder / "script.py").write_text(code)  # numba keeps no function that stands in no file
    result = subprocess.run(
        [sys.executable, "script.py"],
        env={**os.environ, "PYTHONPATH": str(folder), **environment},
        capture_output=True,
        text=True,
        cwd=folder,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_an_edit_of_any_kernel_file_leads_to_another_folder(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "tdint", ignore=shutil.ignore_patterns("__pycache__"))
    cache = {"TDINT_CACHE_DIR": str(tmp_path / "cache")}
    before = python(FOLDER, tmp_path, **cache)
    assert python(FOLDER, tmp_path, **cache) == before
    for file in ("kernels/laws/gap.py", "methods/impulse4.py"):
        source = tmp_path / "tdint" / file
        source.write_text(source.read_text().replace("0.5", "0.25", 1))
        after = python(FOLDER, tmp_path, **cache)
        assert after != before
        before = after


def test_the_note_is_said_once(tmp_path):
    output = python(KERNEL, tmp_path, TDINT_CACHE_DIR=str(tmp_path / "cache"))
    assert output.count("compiling") == 1
    assert output.count("8.0") == 2


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path):
    (tmp_path / "file").write_text("")
    output = python(KERNEL, tmp_path, TDINT_CACHE_DIR=str(tmp_path / "file"))
    assert "not kept" in output
    assert output.count("8.0") == 2


def test_folders_long_unused_are_removed(tmp_path):
    old = tmp_path / "kernels-0123456789abcdef"
    other = tmp_path / "something"
    for folder in (old, other):
        folder.mkdir()
        os.utime(folder, (0, 0))
    current = Path(python(FOLDER, tmp_path, TDINT_CACHE_DIR=str(tmp_path)).strip())
    assert current.exists()
    assert other.exists()
    assert not old.exists()


def test_a_folder_that_others_may_write_to_is_not_used(tmp_path):
    """What lies in it is run."""
    cache = tmp_path / "cache"
    folder = Path(python(FOLDER, tmp_path, TDINT_CACHE_DIR=str(cache)).strip())
    assert folder.parent == cache
    for place, mode in ((folder, 0o777), (folder, 0o720), (cache, 0o777)):
        before = place.stat().st_mode
        place.chmod(mode)
        assert python(FOLDER, tmp_path, TDINT_CACHE_DIR=str(cache)).strip() == "None"
        place.chmod(before & 0o7777)
    cache.chmod(0o1777)  # Sticky, as /tmp: nobody may rename what belongs to another.
    assert python(FOLDER, tmp_path, TDINT_CACHE_DIR=str(cache)).strip() == str(folder)


def test_a_folder_of_another_user_is_not_used(tmp_path):
    cache = tmp_path / "cache"
    folder = Path(python(FOLDER, tmp_path, TDINT_CACHE_DIR=str(cache)).strip())
    try:
        os.chown(folder, 12345, -1)
    except (OSError, AttributeError):
        pytest.skip("only root can give a folder away")
    assert python(FOLDER, tmp_path, TDINT_CACHE_DIR=str(cache)).strip() == "None"
