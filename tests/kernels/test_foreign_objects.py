"""Objects for other systems: undefined symbols, and equal results where this machine can execute
the objects."""

import importlib.util
import math
import pickle
import platform
import subprocess
import sys
from pathlib import Path

import llvmlite.binding as llvm
import pytest

from small_foreign_kernel import SIGNATURE
from tdint.errors import UsageError
from tdint.kernels.building import target
from tdint.kernels.building.compiler import local, objects_of
from tdint.kernels.building.target import AARCH64, LEVELS, named, native
from tdint_cli.commands.compile import TARGETS

TESTS = Path(__file__).parents[1]
NAMES = [
    "linux-x86-64-v2", "linux-aarch64", "macos-x86-64-v2", "macos-aarch64", "windows-x86-64-v2",
    "windows-x86-64",
]  # fmt: skip
MAGIC = {"linux": b"\x7fELF", "darwin": b"\xcf\xfa\xed\xfe", "win32": b"\x64\x86"}


def checks():
    """Return the module that inspects the objects of a wheel."""
    file = TESTS.parent / ".github" / "foreign_objects.py"
    specification = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def weighed(x, table, row, out, factor):
    """Return sums of functions of x, weighted by a row of a table; an array on the stack is longer
    than a page of memory."""
    kept = local(3000)
    for i in range(kept.size):
        kept[i] = i
    for i in range(out.size):
        out[i] = 0.0
    total = 0.0
    for i in range(x.size):
        out[i] += (
            math.exp(x[i])
            + math.sin(x[i]) * math.cos(x[i])
            + math.tanh(x[i])
            + x[i] ** 1.7
            + math.log1p(x[i])
        )
        total += factor * out[i] * table[row, i]
    return total + kept[row] + kept[2999]


@pytest.fixture(scope="module")
def compiled():
    """Return a kernel that uses all functions that kernels call, compiled for this machine and for
    each of NAMES, and the symbol of all."""
    return objects_of(weighed, SIGNATURE, [native(), *map(named, NAMES)])


@pytest.fixture(scope="module")
def objects(compiled):
    """Return the object and the target of each of NAMES."""
    return {name: (code, named(name)) for name, code in zip(NAMES, compiled[0][1:], strict=True)}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.long
def test_object_requires_only_mathematical_library(objects, name):
    code, target = objects[name]
    assert code.startswith(MAGIC[target.platform])
    about = {"kernel": "weighed", "target": target.text, "platform": target.platform}
    checks().check(code, about)
    symbols, relocations = checks().undefined_symbols(code, target.platform)
    assert {"exp", "tanh", "pow"} <= symbols
    assert relocations
    assert not any("chkstk" in symbol for symbol in symbols)


@pytest.mark.long
def test_object_with_unknown_symbols_is_refused(monkeypatch, objects):
    module = checks()
    code, target = objects["windows-x86-64-v2"]
    monkeypatch.setattr(module, "LIBRARY", module.LIBRARY - {"exp"})
    with pytest.raises(ValueError, match=r"weighed for x86-64-v2 on win32: exp$"):
        module.check(
            code, {"kernel": "weighed", "target": target.text, "platform": target.platform}
        )
    monkeypatch.setattr(module, "NEAR", {"AMD64_ADDR64"})
    with pytest.raises(ValueError, match=r"exp, AMD64_ADDR64$"):
        module.check(
            code, {"kernel": "weighed", "target": target.text, "platform": target.platform}
        )


@pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="runs them on Linux on Intel"
)
@pytest.mark.skipif(
    llvm.llvm_version_info < (15,), reason="an older LLVM reads no pointers without types"
)
@pytest.mark.parametrize("system", [pytest.param("macos", marks=pytest.mark.slow), "windows"])
@pytest.mark.long
def test_object_of_other_system_gives_same_result(compiled, objects, system):
    """The object is called with the calling convention of the other system and with functions of
    the library of this machine."""
    data = pickle.dumps((compiled[0][0], objects[f"{system}-x86-64-v2"][0], compiled[1]))
    command = [sys.executable, TESTS / "small_foreign_kernel.py", system]
    done = subprocess.run(command, input=data, capture_output=True, timeout=300)
    assert done.returncode == 0, done.stderr.decode()
    here, there = map(float, done.stdout.split())
    assert here == there
    assert abs(here) > 1.0


@pytest.mark.parametrize("name", TARGETS)
def test_requestable_targets_are_known(name):
    target = named(name)
    assert name == "native" or target.cpu in LEVELS or target.cpu == AARCH64
    systems = {"linux": "linux", "macos": "darwin", "windows": "win32"}
    assert target.platform == systems.get(name.partition("-")[0], sys.platform)


def test_unknown_target_is_refused():
    for name in ("x87", "windows-aarch64", "solaris-x86-64"):
        with pytest.raises(UsageError, match=name):
            named(name)


@pytest.mark.parametrize(
    ("triple", "families"),
    [
        ("powerpc64le-unknown-linux-gnu", set()),
        ("riscv64-unknown-linux-gnu", set()),
        ("s390x-ibm-linux-gnu", set()),
        ("i686-pc-linux-gnu", set()),
        ("armv7l-unknown-linux-gnueabihf", set()),
        ("aarch64-unknown-linux-gnu", {AARCH64}),
        ("arm64-apple-darwin23.1.0", {AARCH64}),
        ("x86_64-unknown-linux-gnu", {"x86-64-v2", "x86-64"}),
    ],
)
def test_processor_loads_only_objects_of_its_family(monkeypatch, triple, families):
    """The triple is simulated: on a processor without objects, only objects that were compiled on
    it are loaded."""
    native = target.native()  # of this processor, before its features are replaced
    features = dict.fromkeys(LEVELS["x86-64-v2"], True)
    monkeypatch.setattr(target.llvm, "get_process_triple", lambda: triple)
    monkeypatch.setattr(target.llvm, "get_host_cpu_features", lambda: features)
    own, *others = target.runnable.__wrapped__()
    assert own == native
    assert {other.cpu for other in others} == families
