"""Object files of kernels: never stale, never in the way, loaded without the compiler."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tdint
from tdint.kernels.building import store
from tdint.kernels.building.compiler import called, object_of, specialized
from tdint.kernels.building.loading import Loaded
from tdint.kernels.building.objects import pack, unpack
from tdint.kernels.building.target import Target
from tdint.kernels.building.variant import EVERYTHING, Variant, parse
from tdint.kernels.compiling import F8, I8, TABLE, VECTOR

PACKAGE = Path(tdint.__file__).parent
FINGERPRINT = "from tdint.kernels.building.store import fingerprint; print(fingerprint())"
# A kernel of a line, with a function of its own and one of another file in it: fast to compile.
KERNEL = """
from tdint.kernels.compiling import F8, VECTOR, inlined, kernel
from tdint.kernels.march.march import ground_at

@inlined
def twice(x):
    return 2.0 * x

@kernel(F8(VECTOR, F8), parts=())
def scaled(ground, x):
    return twice(x) * ground_at(ground, 1, 1, 1)
"""
CALL = """
import logging, sys
import numpy as np
from small import scaled
logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
for _ in range(2):
    print(scaled.compiled(np.array([1.0, 3.0]), 4.0))
print("numba" in sys.modules)
"""


def python(code, folder, **environment):
    """What a program prints; kernels in it may be found in `folder`."""
    environment = {"TDINT_KERNELS": "", **environment}
    result = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(folder), **environment},
        capture_output=True,
        text=True,
        cwd=folder,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.fixture
def small(tmp_path):
    """A folder with a module of one small kernel."""
    (tmp_path / "small.py").write_text(KERNEL)
    return tmp_path


def test_an_edit_of_any_kernel_file_leads_to_another_folder(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "tdint", ignore=shutil.ignore_patterns("__pycache__"))
    before = python(FINGERPRINT, tmp_path)
    assert python(FINGERPRINT, tmp_path) == before
    for file in ("kernels/laws/gap.py", "methods/impulse4.py"):
        source = tmp_path / "tdint" / file
        source.write_text(source.read_text().replace("0.5", "0.25", 1))
        after = python(FINGERPRINT, tmp_path)
        assert after != before
        before = after


def test_a_kernel_is_compiled_once_and_then_loaded_without_the_compiler(small):
    cache = {"TDINT_CACHE_DIR": str(small / "cache")}
    first = python(CALL, small, **cache).splitlines()
    assert first[0].startswith("compiling 1 time loop for this machine, once, about 5 s: small (kept in ")
    assert first[1:] == ["24.0", "24.0", "False"]
    assert python(CALL, small, **cache).splitlines() == ["24.0", "24.0", "False"]
    (file,) = (small / "cache").rglob("*.object")
    code, about = unpack(file.read_bytes())
    assert code[1:4] == b"ELF" or sys.platform != "linux"
    assert about["kernel"] == "small:scaled"
    assert not list((small / "cache").rglob("*.part"))
    # A folder that is named is taken as it is, and not written.
    shared = {"TDINT_KERNELS_DIR": str(small / "cache"), "TDINT_CACHE_DIR": str(small / "other")}
    assert python(CALL, small, **shared).splitlines() == ["24.0", "24.0", "False"]
    assert not (small / "other").exists()


@pytest.mark.parametrize("harm", ["cut off", "changed", "open to others", "of another", "a folder", "nothing"])
def test_a_damaged_object_is_not_loaded(tmp_path, monkeypatch, harm):
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("TDINT_KERNELS_DIR", raising=False)
    target = Target("some", "")
    data = pack(b"machine code", {"kernel": "a:b", "symbol": "b"})
    path = store.keep(data, "a:b", "all", target)
    assert store.find("a:b", "all", (Target("none", ""), target)) == (b"machine code", "b")
    assert store.find("a:b", "linear", (target,)) is None
    match harm:
        case "cut off":
            path.write_bytes(data[:-1])
        case "changed":
            path.write_bytes(data[:-1] + b"?")
        case "open to others":
            path.chmod(0o666)
        case "of another":
            try:
                os.chown(path, 12345, -1)
            except (OSError, AttributeError):
                pytest.skip("only root can give a file away")
        case "a folder":
            path.unlink()
            path.mkdir()
        case "nothing":
            path.write_bytes(b"")
    assert store.find("a:b", "all", (target,)) is None
    if harm != "a folder":
        store.keep(data, "a:b", "all", target)
        assert store.find("a:b", "all", (target,)) == (b"machine code", "b")


def test_a_folder_that_cannot_be_written_costs_only_time(small):
    (small / "file").write_text("")
    output = python(CALL, small, TDINT_CACHE_DIR=str(small / "file"))
    assert "not kept" in output
    assert output.count("24.0") == 2


def test_kernels_can_be_run_as_they_are_written(small):
    output = python(CALL, small, TDINT_CACHE_DIR=str(small / "cache"), TDINT_KERNELS="python")
    assert output.splitlines() == ["24.0", "24.0", "False"]
    assert not (small / "cache").exists()


def test_folders_long_unused_are_removed(tmp_path, monkeypatch):
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path))
    old = tmp_path / "kernels-0123456789abcdef"
    other = tmp_path / "something"
    for folder in (old, other):
        folder.mkdir()
        os.utime(folder, (0, 0))
    current = store.keep(b"", "a:b", "all", Target("some", ""))
    assert current.parent == tmp_path / f"kernels-{store.fingerprint()}"
    assert other.exists()
    assert not old.exists()


def add(table, numbers, factor, row):
    for i in range(numbers.size):
        table[row, i] += factor * numbers[i]
    return table.shape[1]


def test_a_loaded_kernel_takes_numbers_and_arrays():
    signature = I8(TABLE, VECTOR, F8, I8)
    kernel = Loaded(*object_of(add, signature), signature)
    table, numbers = np.ones((2, 4)), np.arange(3.0)
    assert kernel(table, numbers, 2.0, 1) == 4
    assert table.tolist() == [[1.0] * 4, [1.0, 3.0, 5.0, 1.0]]
    read_only = np.ones(3)
    read_only.flags.writeable = False
    for wrong in (np.arange(3), np.ones((3, 1)), np.ones(6)[::2], read_only, np.ones(3, dtype=np.float32)):
        with pytest.raises(TypeError, match="float64 in C order"):
            kernel(table, wrong, 2.0, 1)


def test_a_kernel_that_allocates_is_refused():
    def allocates(numbers):
        return np.zeros(numbers.size).sum()

    with pytest.raises(Exception, match=r"NRT|allocate"):
        object_of(allocates, F8(VECTOR))


@pytest.mark.parametrize(("decorate", "times"), [(called, 1), (specialized, 2)])
def test_constants_make_another_function_only_where_that_is_wanted(decorate, times):
    @decorate
    def power(x, n):
        return x**n

    object_of(lambda x: power(x, 2) + power(x, 3), F8(F8))
    assert len(power.overloads) == times


def test_a_variant_is_read_as_it_is_written():
    for variant in (EVERYTHING, Variant(("linear", "bilinear"), modal=False, forces=True, dashpots=False)):
        assert parse(variant.text) == variant
    assert parse("linear") == Variant(("linear",), modal=False, forces=False, dashpots=False)
    assert parse("linear+modal").only(("laws",)) == Variant(("linear",))
    with pytest.raises(ValueError, match="unknown"):
        parse("linear+else")
