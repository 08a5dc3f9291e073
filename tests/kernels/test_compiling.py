"""Object files of kernels are always up to date, do not interfere with each other, and are loaded
without the compiler."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from queue import SimpleQueue
from threading import Event

import numpy as np
import pytest

from facts import states
from small_kernel import scaled
from tdint import load_model
from tdint.errors import AnalysisError, OutputError
from tdint.kernels import build
from tdint.kernels.building import compiler, store
from tdint.kernels.building import load_or_compile as building_module
from tdint.kernels.building import process as process_module
from tdint.kernels.building.compilable import ANY, EVERYTHING, FULL, PLAIN, Variant, bind
from tdint.kernels.building.compiler import objects_of, outlined
from tdint.kernels.building.load_or_compile import compile_ahead
from tdint.kernels.building.loading import Loaded, pack, unpack
from tdint.kernels.building.process import Compilation
from tdint.kernels.building.target import NATIVE, Target, named, native, runnable
from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, Kernel
from tdint.kernels.laws import NAMES
from tdint.kernels.laws.compiled import compiled_laws
from tdint.kernels.stories.law_state import follow
from tdint.methods.catalogue import parse as parse_method
from tdint.response.runs.analysis_kernels import all_kernels, kernels_of_model
from tdint.system import lock

SMALL = Path(__file__).parents[1] / "small_kernel.py"
CALL = """
import logging, sys
import numpy as np
from small import scaled
logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
for _ in range(2):
    print(scaled.compiled(np.array([1.0, 3.0]), 4.0))
print("numba" in sys.modules)
"""


def started(code, folder, **environment):
    """Start a Python program; `folder` may contain compiled kernels."""
    environment = {"TDINT_KERNELS": "", **environment}
    return subprocess.Popen(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(folder), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
    )


def printed(process):
    """Return the standard output of a program."""
    output, errors = process.communicate()
    assert process.returncode == 0, errors
    return output


@pytest.fixture
def small(tmp_path):
    """Return a directory with a module of one small kernel."""
    shutil.copy(SMALL, tmp_path / "small.py")
    return tmp_path


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """Return an empty directory, which is the only cache of kernels."""
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("TDINT_KERNELS_DIR", raising=False)
    return tmp_path


@pytest.mark.long
def test_kernel_is_compiled_once_and_loaded_without_compiler(small):
    """If two processes need the kernel at the same time, one compiles it, and the other waits or
    loads the completed file."""
    running = [started(CALL, small, TDINT_CACHE_DIR=str(small / "cache")) for _ in range(2)]
    outputs = [printed(process).splitlines() for process in running]
    assert all(lines[-3:] == ["24.0", "24.0", "False"] for lines in outputs)
    (message,) = (line for lines in outputs for line in lines if line.startswith("compiling"))
    assert states(message, "compiling 1 time loop ... (about 3 s): small; stored in ")
    (file,) = (small / "cache").rglob("*.object")
    content = file.read_bytes()
    code, about = unpack(content)
    assert code[1:4] == b"ELF" or sys.platform != "linux"
    assert about["kernel"] == "small:scaled"
    assert not list((small / "cache").rglob("*.part"))


WANTED = [
    (scaled, EVERYTHING),
    (scaled, Variant(PLAIN)),
]  # equal, because the kernel has no forms


def file_for(target):
    """Return the name of the object file for a processor."""
    return store.file_name(scaled.name, ANY, named(target))


@pytest.fixture(scope="module")
def ahead(tmp_path_factory):
    """Return a directory with object files of the small kernel for two processors."""
    folder, done = tmp_path_factory.mktemp("ahead") / "objects", []
    files = compile_ahead(WANTED, ["native", "x86-64-v2"], folder, done.append)
    assert sorted(file.name for file in files) == sorted(map(file_for, ("native", "x86-64-v2")))
    assert done == [0.5, 1.0]
    return folder


def new_kernel(has_forms=False):
    """Return the small kernel, not yet loaded."""
    return Kernel(scaled.function, scaled.signature, has_forms, vectorized=False)


def computed():
    """Load the small kernel in a new process and return its result."""
    return new_kernel().compiled(np.array([1.0, 3.0]), 4.0)


@pytest.mark.long
def test_unwritable_cache_is_tolerated_and_truncated_object_is_recompiled(
    cache, ahead, monkeypatch, caplog
):
    (object_file,) = ahead.rglob(file_for("native"))
    compiled = []

    def run_all(compilations, processes):
        compiled.extend(compilations)
        return ((compilation, [object_file.read_bytes()]) for compilation in compilations)

    monkeypatch.setattr("tdint.kernels.building.process.run_all", run_all)
    caplog.set_level("INFO", "tdint")
    (cache / "file").write_text("")
    for directory, message in (
        (cache / "file", "not stored: "),
        (cache / "folder", "; stored in "),
    ):
        monkeypatch.setenv("TDINT_CACHE_DIR", str(directory))
        assert computed() == 24.0
        assert message in caplog.messages[-1]
    (file,) = (cache / "folder").rglob("*.object")
    file.write_bytes(object_file.read_bytes()[:-100])
    assert computed() == computed() == 24.0
    assert len(compiled) == len(caplog.messages) == 3
    assert file.read_bytes() == object_file.read_bytes()
    assert not list((cache / "folder").rglob("*.part"))


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of processes")
@pytest.mark.long
def test_kernel_runs_from_memory_if_disk_is_full(cache, monkeypatch, caplog):
    """The disk is full only when the object file is written, because files are limited to 100
    bytes."""
    import resource

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    caplog.set_level("INFO", "tdint")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        assert computed() == 24.0
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    first, second = caplog.messages
    assert "; stored in " in first
    assert "is not writable: " in second
    assert not list(cache.rglob("*.object")) + list(cache.rglob("*.part"))


@pytest.mark.long
def test_kernels_are_compiled_ahead_for_several_processors(tmp_path, ahead, monkeypatch):
    folder = shutil.copytree(ahead, tmp_path / "ahead")
    assert compile_ahead(WANTED, ["native"], folder, print) == []
    # The kernels are copied once to the cache directory and then found there.
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("TDINT_KERNELS_DIR", str(folder))
    (kept,) = compile_ahead(WANTED, ["native"], None, lambda done: None)
    assert kept.is_relative_to(tmp_path / "cache")
    assert compile_ahead(WANTED, ["native"], None, print) == []
    # A directory that is set explicitly is used unchanged; the object for other processors is also
    # accepted.
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path / "other"))
    assert computed() == 24.0
    if named("x86-64-v2") in runnable():
        next(folder.rglob(file_for("native"))).unlink()
        assert computed() == 24.0
        assert not store.has(scaled.name, ANY, native(), folder)
    assert not (tmp_path / "other").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        compile_ahead(WANTED, ["native"], tmp_path / "file", print)


def test_form_and_laws_follow_from_the_building():
    configs = Path(__file__).parents[2] / "configs"
    for name, expected in {
        "ten-story": (PLAIN, ["linear"]),
        "ten-story-bilinear": (PLAIN, ["linear", "bilinear"]),
        "wind-tower": (FULL, ["linear"]),
        "absorber-frame": (FULL, ["linear"]),
        "fluid-dampers": (FULL, ["linear", "bouc-wen"]),
    }.items():
        required = kernels_of_model(load_model(configs / f"{name}.yaml"), parse_method("moment4"))
        names = {kernel.name.rpartition(".")[2] for kernel, _ in required}
        assert names >= {"moment4:step", "loop:integrate", "law_state:follow", "elastic:peaks"}
        variants = {variant for kernel, variant in required if kernel.has_forms}
        (variant,) = variants
        laws = [law.name.rpartition(".")[2] for law in variant.laws]
        assert (variant.form, laws) == expected, name


def test_all_forms_and_laws_are_compiled_ahead():
    """A building of any features and laws of tdint finds its loops in a wheel."""
    names = {(name, form) for name, form, *_ in building_module.list_objects(all_kernels())}
    assert {("tdint.methods.impulse4:step", form) for form in (PLAIN, FULL)} <= names
    assert {("tdint.kernels.stories.law_state:follow", form) for form in (PLAIN, FULL)} <= names
    laws = {name.partition(":law.")[2] for name, form in names if form == ANY}
    assert set(NAMES) <= laws


SOME = Target("some", "")


def packed(name, processor=SOME, **other):
    """Return the content of an object file for all buildings, except for the given arguments."""
    return pack(
        b"machine code", {**store.identity(name, "full", processor), "symbol": "b", **other}
    )


TWO = """
from tdint.kernels.compiling import F8, I8, VECTOR, kernel, outlined

@outlined
def reciprocal(numbers, n):
    return 1 // n + numbers[(1, 2, 3)[n]] ** n  # numba raises exceptions for each of the three

@kernel(F8(VECTOR, I8), has_forms=False)
def first(numbers, n):
    return reciprocal(numbers, n)

@kernel(F8(VECTOR, I8), has_forms=False)
def second(numbers, n):
    return 2.0 * reciprocal(numbers, n)
"""
AHEAD = """
import os, two
from pathlib import Path
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.building.load_or_compile import compile_ahead
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, list(os.sched_getaffinity(0))[:1])  # one process compiles both
compile_ahead([(two.{}, EVERYTHING), (two.{}, EVERYTHING)], ["native"], Path("out"), lambda done: None)
"""  # noqa: E501


@pytest.mark.long
def test_compilation_is_reproducible(tmp_path):
    """The object file does not depend on the location of the sources, the order of compilation and
    the hash seed of Python, and contains no path."""
    running, objects = [], []
    for directory, seed, names in (
        ("a", "1", ("first", "second")),
        ("b/deeper", "2", ("second", "first")),
    ):
        folder = tmp_path / directory
        folder.mkdir(parents=True)
        (folder / "two.py").write_text(TWO)
        setting = {"TDINT_CACHE_DIR": str(folder / "cache"), "PYTHONHASHSEED": seed}
        running.append((folder, started(AHEAD.format(*names), folder, **setting)))
    for folder, process in running:
        printed(process)
        objects.append(
            {file.name: file.read_bytes() for file in (folder / "out").rglob("*.object")}
        )
    assert objects[0] == objects[1] and len(objects[0]) == 2
    for data in objects[0].values():
        code, about = unpack(data)
        assert about["symbol"].partition(".")[0] in ("first", "second")
        for word in (str(tmp_path), sys.prefix, "site-packages", "builtins", "Error"):
            assert word.encode() not in code


COMPILE = """
import os, sys
from pathlib import Path
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.building.load_or_compile import compile_ahead
from tdint.methods import gauss, model_based
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, list(os.sched_getaffinity(0))[:1])  # one process compiles both
steps = [gauss.implicit_step, model_based.step][int(sys.argv[1]):]
compile_ahead([(step, EVERYTHING) for step in steps], ["x86-64-v2"], Path("out"), lambda done: None)
"""


@pytest.mark.slow
def test_object_does_not_depend_on_earlier_compilations(tmp_path):
    """Two processes with different hash seeds of Python compile a step, one of them after the step
    of another method, whose functions use functions of numba first."""
    running, objects = [], []
    for first in ("0", "1"):
        folder = tmp_path / first
        folder.mkdir()
        setting = {"TDINT_CACHE_DIR": str(folder / "cache"), "PYTHONHASHSEED": first}
        program = f"import sys; sys.argv[1:] = ['{first}']\n{COMPILE}"
        running.append((folder, started(program, folder, **setting)))
    for folder, process in running:
        printed(process)
        (file,) = (folder / "out").rglob("*model_based.step-full*.object")
        objects.append(file.read_bytes())
    assert objects[0] == objects[1]


INNER = F8(TABLE, I8)
inner_at = compiler.indirect_caller(INNER)


@outlined
def with_unused(table, row, unused):
    """Return a sum over a row; LLVM does not copy the function into its callers."""
    total = unused - unused
    for i in range(table.shape[1]):
        x = table[row, i]
        total += ((((x + 1.0) * x + 2.0) * x + 3.0) * x // 4.0) % 5.0
    return total


def outer(address, table, unused):
    """Call a kernel and another function twice."""
    by_rows = with_unused(table, 0, unused) + with_unused(table, 1, unused)
    return by_rows + inner_at(address, table, 1)


def test_generated_code_is_reduced(monkeypatch):
    """A call of a kernel passes three of the nine numbers of a table. The functions of a kernel
    are internal, are not copied again, and receive only the parts of a table that they use."""
    monkeypatch.setattr(compiler, "_emitted", lambda text, target: text)
    (text,), symbol = objects_of(outer, F8(INNER, TABLE, F8), [native()])
    (entry,) = re.findall(r'^define (?!internal).*@"(\S+)"\(', text, re.MULTILINE)
    ((parts, number),) = re.findall(r"^define internal .*?\((.*)\).*#(\d+)", text, re.MULTILINE)
    (passed,) = re.findall(r"call i32 %\S*\((.*?)\),", text)
    assert entry == symbol == "outer.0"
    assert "%arg.table.4" in parts and "%arg.table.5.1" in parts
    assert not re.search(r"%arg\.(table\.[0-36]|table\.5\.0|excinfo)", parts)
    assert "noinline" in re.search(rf"^attributes #{number} = .*", text, re.MULTILINE)[0]
    assert passed.count("undef") == 6


@pytest.mark.parametrize("vectorizes", [False, True])
def test_short_loops_are_not_prepared_for_unrolling(monkeypatch, vectorizes):
    given = []
    monkeypatch.setattr(compiler.numba.core.config, "LOOP_VECTORIZE", vectorizes)
    monkeypatch.setattr(compiler.llvm, "set_option", lambda name, option: given.append(option))
    compiler._set_loop_options.__wrapped__()
    assert given == ([] if vectorizes else ["--unroll-runtime=false", "--disable-lsr"])


NOT_REDUCED = """
from tdint.kernels.building import compiler
compiler.REDUCED = False
from tdint.kernels import build
build.main()
"""
RUN = """
import hashlib, sys
import numpy as np
from pathlib import Path
from tdint import load_model, read_record
from tdint.response.runs.batch import Subject
root = Path(sys.argv[1])
record = read_record(root / "records/near-fault.mseed", component="HN1", units="m/s^2")
for config, method in zip(sys.argv[2::2], sys.argv[3::2]):
    subject = Subject(load_model(root / config), method)
    prepared, integrator = subject.prepared, subject.integrator
    for h in (0.02, 0.005, 0.04):
        steps = subject.case(record).steps(h, 20.0)
        space = prepared.loaded_arrays(integrator, steps.h, steps.count + 1)
        ground = np.zeros(len(record.acceleration) + 50)
        ground[: len(record.acceleration)] = 3.0 * record.acceleration
        code = prepared.loop(integrator, steps.h, ground, space)(steps, 0, steps.count)
        arrays = (*space.memory, *space.seen, space.forces, space.history, space.totals)
        digest = hashlib.sha256(b"".join(array.tobytes() for array in arrays))
        print(config, method, h, code, space.history.shape, digest.hexdigest())
"""


@pytest.mark.slow
def test_reduced_code_computes_equal_bits(tmp_path, monkeypatch):
    """Loops with and without the reductions of machine code fill equal arrays, in both forms."""
    root = Path(__file__).parents[2]
    runs = [
        ("configs/ten-story-bilinear.yaml", "newmark-average"),
        ("configs/ten-story-bilinear.yaml", "impulse4"),
        ("configs/equipment-on-floors.yaml", "newmark-average"),
    ]
    required = [
        pair
        for config, method in runs
        for pair in kernels_of_model(load_model(root / config), parse_method(method))
    ]
    start_instead(monkeypatch, NOT_REDUCED)
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path))  # without objects to copy
    monkeypatch.delenv("TDINT_KERNELS_DIR", raising=False)
    folder = tmp_path / "objects"
    compile_ahead(required, ["native"], folder, lambda done: None)
    monkeypatch.undo()
    given = [str(root), *(text for run in runs for text in run)]
    program = f"import sys; sys.argv[1:] = {given}\n{RUN}"
    outputs = [
        printed(started(program, tmp_path, TDINT_KERNELS_DIR=directory))
        for directory in ("", str(folder))
    ]
    assert outputs[0] == outputs[1] and len(outputs[0].splitlines()) == 3 * len(runs)


HARMS = [
    "cut off", "changed", "open to others", "of another", "a folder", "a pipe", "nothing", "deep",
    "symbol",
]  # fmt: skip


@pytest.mark.parametrize(
    "harm", [*HARMS, "kernel", "form", "target", "platform", "sources", "convention"]
)
def test_corrupt_object_is_not_loaded(cache, harm):
    data = packed("a:b")
    path = store.save(data, "a:b", "full", SOME)
    assert store.find_object("a:b", "full", (Target("none", ""), SOME))[1] == b"machine code"
    assert store.find_object("a:b", "plain", (SOME,)) is None
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
        case "a pipe":
            path.unlink()
            os.mkfifo(path)
        case "nothing":
            path.write_bytes(b"")
        case "deep":
            path.write_bytes(b"[" * 200_000 + b"\n")
        case "symbol":  # the head is included in the hash of the code
            path.write_bytes(data.replace(b'"symbol": "b"', b'"symbol": "c"'))
        case _:  # a valid object of another kernel with the file name of this kernel
            path.write_bytes(packed("a:b", **{harm: "other"}))
    assert store.find_object("a:b", "full", (SOME,)) is None
    if harm not in ("a folder", "a pipe"):
        store.save(data, "a:b", "full", SOME)
        assert store.find_object("a:b", "full", (SOME,))[1] == b"machine code"


def test_kernels_can_be_interpreted(cache, monkeypatch):
    monkeypatch.setenv("TDINT_KERNELS", "python")
    assert computed() == 24.0
    assert not list(cache.iterdir())


def test_unused_objects_are_removed(cache):
    versions, other = cache / "kernels-0123456789abcdef", cache / "something"
    versions.mkdir()
    other.mkdir()
    files = [store.save(packed("a:used"), name, "full", SOME) for name in ("a:used", "a:unused")]
    # Processes that were killed while they wrote an object, and one that writes at present
    parts = [files[0].with_name(f".{name}.part") for name in ("old", "new")]
    for part in parts:
        part.touch()
    for old in (versions, other, *files, parts[0]):
        os.utime(old, (0, 0))
    assert store.find_object("a:used", "full", (SOME,))
    current = store.save(packed("a:used"), "a:new", "full", SOME)
    assert current.parent == cache / store.folder_name()
    assert other.exists()
    assert not versions.exists()
    assert [file.exists() for file in files] == [True, False]
    assert [part.exists() for part in parts] == [False, True]


def add(factor, row, table, numbers):
    for i in range(numbers.size):
        table[row, i] += factor * numbers[i]
    return table.shape[1]


@pytest.mark.long
def test_loaded_kernel_accepts_numbers_and_arrays():
    signature = I8(F8, I8, TABLE, VECTOR)
    (code,), symbol = objects_of(add, signature, [native()])
    kernel = Loaded(code, symbol, signature)
    table, numbers = np.ones((2, 4)), np.arange(3.0)
    assert kernel(2.0, 1, table, numbers) == 4
    assert table.tolist() == [[1.0] * 4, [1.0, 3.0, 5.0, 1.0]]
    # The bound function keeps the arrays alive and calls with their present values.
    bound = bind(kernel, table, numbers.copy())
    assert (bound(3.0, 0), bound(3.0, np.int64(0))) == (4, 4)
    assert table.tolist() == [[1.0, 7.0, 13.0, 1.0], [1.0, 3.0, 5.0, 1.0]]
    assert bind(add, table, numbers)(2.0, 0) == 4  # a Python function
    assert table[0].tolist() == [1.0, 9.0, 17.0, 1.0]
    with pytest.raises(ValueError, match="argument"):
        bound(3.0, 0, table)
    read_only = np.ones(3)
    read_only.flags.writeable = False
    for wrong, cause in (
        (np.arange(3), "array of int64"),
        (np.ones((3, 1)), "with 2 dimensions"),
        (np.ones(6)[::2], "not in C order"),
        (read_only, "got a read-only array"),
        (np.ones(3, dtype=np.float32), "array of float32"),
    ):
        with pytest.raises(TypeError, match=rf"^argument 4 must .* float64 in C order .*{cause}"):
            kernel(2.0, 1, table, wrong)


def test_allocating_kernel_is_refused():
    def allocates(numbers):
        return np.zeros(numbers.size).sum()

    with pytest.raises(Exception, match=r"NRT|allocate"):
        objects_of(allocates, F8(VECTOR), [native()])


def test_outlined_function_is_compiled_once_for_all_constants():
    @outlined
    def power(x, n):
        return x**n

    objects_of(lambda x: power(x, 2) + power(x, 3), F8(F8), [native()])
    assert len(power.overloads) == 1


def test_clean_removes_objects_outside_package(cache, monkeypatch):
    path = store.save(packed("a:b"), "a:b", "full", SOME)
    old = cache / "kernels-0123456789abcdef"
    old.mkdir()
    (old / "an.object").write_bytes(b"")
    (cache / "references").mkdir()
    assert store.clean() == 2
    assert not path.exists()
    assert [left.name for left in cache.iterdir()] == ["references"]
    monkeypatch.delenv("TDINT_CACHE_DIR")
    assert not store.writable().is_relative_to(Path(store.__file__).parents[2])


def test_clean_counts_only_removed_objects(cache, monkeypatch):
    for folder, name in (("used", "one"), ("used", "two"), ("unused", "three")):
        (cache / f"kernels-{folder}").mkdir(exist_ok=True)
        (cache / f"kernels-{folder}" / f"{name}.object").write_bytes(b"")
    remove = os.unlink

    def refuse(path, **options):
        """Remove a file, unless it is used."""
        if Path(path).name == "two.object":
            raise PermissionError(13, "Access is denied", path)
        remove(path, **options)

    monkeypatch.setattr(os, "unlink", refuse)
    assert store.clean() == 2
    assert [file.name for file in cache.rglob("*.object")] == ["two.object"]


@pytest.mark.skipif(sys.platform == "win32", reason="no locks of other open files")
def test_clean_keeps_only_locks_in_use(cache):
    for number in (1, 2):
        (cache / "kernels-0123" / "part").mkdir(parents=True, exist_ok=True)
        (cache / "kernels-0123" / f".lock-{number}").touch()
    with (cache / "kernels-0123" / ".lock-1").open("ab") as stream:
        assert lock(stream.fileno())
        store.clean()
        assert [path.name for path in (cache / "kernels-0123").iterdir()] == [".lock-1"]
    store.clean()
    assert not list(cache.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="no umask")
def test_shared_directory_is_readable_with_any_umask(tmp_path):
    before = os.umask(0o077)
    try:
        path = store.save(packed("a:b"), "a:b", "full", SOME, tmp_path / "shared" / "kernels")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o644
    for folder in (path.parent, path.parent.parent, path.parent.parent.parent):
        assert folder.stat().st_mode & 0o777 == 0o755


def test_prebuilt_objects_are_used_last(cache, monkeypatch):
    monkeypatch.setattr(store, "_PREBUILT", cache / "prebuilt")
    prebuilt = cache / "prebuilt" / sys.platform / store.file_name("a:b", "full", SOME)
    prebuilt.parent.mkdir(parents=True)
    prebuilt.write_bytes(packed("a:b"))
    assert store.find_object("a:b", "full", (SOME,))[0] == prebuilt
    assert not store.has("a:b", "full", SOME)
    kept = store.save(packed("a:b"), "a:b", "full", SOME)
    assert store.find_object("a:b", "full", (SOME,))[0] == kept


def test_missing_loop_without_compiler_is_reported(cache, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, package=None: None)
    message = (
        "small_kernel:scaled: compiled time loops are not included in this installation; "
        "install numba to compile them"
    )
    with pytest.raises(AnalysisError, match=message):
        _ = new_kernel().compiled


def test_compilation_error_of_other_module_has_reason_and_line():
    """The message contains the explanation of numba and the last line of the module that numba
    names."""
    compilation = Compilation(scaled, ANY, {})
    own = compilation.request[2]
    name = Path(own).name
    text = [
        "Traceback", f'  File "/a/b/{name}", line 3, in scaled',
        f'  File "C:\\a\\{name}", line 17, in scaled',
        '  File "/a/b/other.py", line 99, in scaled', "Failed in nopython mode pipeline", "  ",
        "  cannot unify float64 and int64  ", "During: typing of assignment",
    ]  # fmt: skip
    assert compilation.reason(text) == f"{own}:17: cannot unify float64 and int64"
    assert compilation.reason([text[0], *text[3:]]) == f"{own}: cannot unify float64 and int64"
    assert (
        compilation.reason(["NameError", "name 'nowhere' is not defined"])
        == f"{own}: name 'nowhere' is not defined"
    )
    assert compilation.reason(["one line"]) == f"{own}: one line"
    assert compilation.reason([]) == ""
    package = Compilation(follow, FULL, {})
    assert package.request == ("tdint.kernels.stories.law_state:follow", FULL, None)
    assert package.reason(text) == "cannot unify float64 and int64" and package.reason([]) == ""


def test_position_in_external_file_precedes_if_its_name_is_not_normalized(monkeypatch):
    """A module that was found by a relative entry of `sys.path` has such a name."""
    module = sys.modules[scaled.function.__module__]
    file = Path(module.__file__)
    monkeypatch.setattr(module, "__file__", f"{file.parent}{os.sep}.{os.sep}{file.name}")
    text = [
        f'  File "/a/b/{file.name}", line 17, in scaled',
        "Failed in nopython mode pipeline",
        "cannot unify float64 and int64",
        '  File "/a/tdint/kernels/layout.py", line 3, in ground_at',
    ]
    message = Compilation(scaled, ANY, {}).reason(text)
    assert message == f"{file}:17: cannot unify float64 and int64"


def start_instead(monkeypatch, program):
    """Let `_process` start a Python program instead of the program that compiles kernels."""
    start = subprocess.Popen
    monkeypatch.setattr(
        process_module.subprocess,
        "Popen",
        lambda command, **options: start([sys.executable, "-c", program], **options),
    )


@pytest.mark.parametrize("second", [r"7\nobj", r"7\n"], ids=["half", "nothing"])
def test_truncated_object_of_ended_process_is_refused(cache, monkeypatch, second):
    """The process ends while it writes the second of two objects."""
    written = r"7\nobject1" + second
    program = f"input(); print(end='{written}'); raise SystemExit('out of memory')"
    start_instead(monkeypatch, program)
    monkeypatch.setattr(process_module, "processors", lambda: 1)
    requested = [(scaled, ANY, name) for name in ("linux-aarch64", "macos-aarch64")]
    with pytest.raises(AnalysisError, match=r"small_kernel\.py: out of memory$") as caught:
        list(process_module.run_all(process_module.compilations(requested)))
    assert str(caught.value).startswith("small_kernel:scaled cannot be compiled: ")
    assert "\n" not in str(caught.value)
    with pytest.raises(AnalysisError, match="out of memory"):
        compile_ahead(WANTED, ["linux-aarch64", "macos-aarch64"], None, print)
    assert not list(cache.rglob("*.object"))


def test_process_of_a_form_also_compiles_kernels_without_forms():
    """A process starts for about half a second, and code that kernels share is compiled in each."""
    targets = {NATIVE: named(NATIVE)}
    full, plain, law = (
        Compilation(*pair, targets) for pair in ((follow, FULL), (follow, PLAIN), (scaled, ANY))
    )
    work = process_module._Work([plain, law, full], SimpleQueue(), set(), [], Event())
    assert process_module._next(work) is plain
    assert process_module._next(work) is full  # no process can compile it
    assert process_module._next(work, plain.settings) is law
    work.waiting.append(full)
    assert process_module._next(work, plain.settings) is None


PROGRAM_WITHOUT_COMPILER = """
import os, sys
from types import SimpleNamespace
os.environ["TDINT_KERNELS"] = ""  # decorators without numba
compiler = SimpleNamespace(
    objects_of=lambda function, *_: ([b"machine code"], function.__name__),
    objects_of_law=None,
    law_entry=None,
    law_function=None,
)
sys.modules["tdint.kernels.building.compiler"] = compiler
from tdint.kernels import build
build._take_shortcuts = lambda: None
build.main()
"""


def test_printed_text_of_plugin_is_not_read_as_object(tmp_path, monkeypatch):
    """The program that compiles kernels is complete, except for the compiler."""
    (tmp_path / "small_that_prints.py").write_text(SMALL.read_text() + "print('loaded')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = importlib.import_module("small_that_prints")
    start_instead(monkeypatch, PROGRAM_WITHOUT_COMPILER)
    requested = process_module.compilations([(module.scaled, ANY, "native")])
    ((_, (data,)),) = process_module.run_all(requested)
    code, description = unpack(data)
    assert (code, description["symbol"]) == (b"machine code", "scaled")


PACKAGE = {
    "__init__.py": "from .hyper import LAW",
    "hyper.py": "from .constants import FACTOR\nLAW = FACTOR",
    "constants.py": "FACTOR = 3",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return the directory of PACKAGE; the modules that a test imports from it are removed."""
    folder = tmp_path / "small_package"
    folder.mkdir()
    for file, text in PACKAGE.items():
        (folder / file).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield folder
    for module in [
        module for module in sys.modules if module.startswith(("small_package", "small_unknown"))
    ]:
        del sys.modules[module]


def test_package_of_module_is_imported_before_it(package):
    """The package imports the module, and the module imports another module of the package."""
    assert build._module("small_package.hyper", str(package / "hyper.py")).LAW == 3


def test_module_is_executed_alone_only_if_its_package_is_not_found(package):
    constants = package / "constants.py"
    assert build._module("small_unknown.constants", str(constants)).FACTOR == 3
    constants.write_text("import small_missing_module")
    with pytest.raises(ModuleNotFoundError, match="small_missing_module"):
        build._module("small_package.hyper", str(package / "hyper.py"))


def test_process_started_after_stop_is_killed(monkeypatch):
    """The thread has taken the compilation from the list, but not yet started its process."""
    start_instead(monkeypatch, "import time; time.sleep(60)")
    (compilation,) = process_module.compilations([(scaled, ANY, "linux-aarch64")])
    work = process_module._Work([], SimpleQueue(), set(), [], Event())
    work.stopped.set()
    with process_module._process(compilation, work) as (process, _):
        assert process.wait(30) != 0
    assert not work.running


def test_misspelled_name_is_reported_with_line():
    """This includes kernels of tdint, for which numba does not report a position."""
    head = "Failed in nopython mode pipeline"
    message = Compilation(follow, FULL, {}).reason(
        [head, "of a caller", head, "NameError: name 'drifts' is not defined"]
    )
    path, line, reason = message.split(":", 2)
    assert (Path(path).name, reason) == (
        "law_state.py",
        " NameError: name 'drifts' is not defined",
    )
    assert "drifts" in Path(path).read_text().splitlines()[int(line) - 1]


def test_compilation_message_counts_loops_and_laws(monkeypatch):
    """The message lists time loops by module, and laws by name. The estimated time is the time of
    the longest compilation, or the total time divided by the processors."""
    variant = Variant(PLAIN, compiled_laws((0.0, 8.5)))
    needed = building_module.required([(follow, variant), (scaled, variant)])
    assert list(map(building_module._label, needed)) == [
        "law_state",
        "linear",
        "imk~",
        "small_kernel",
    ]
    assert building_module.counted(needed) == "2 time loops and 2 laws"
    assert building_module.counted(needed[:1]) == "1 time loop"
    monkeypatch.setattr(building_module, "processors", lambda: 2)
    plain, full, other = (building_module.duration([(follow, form)]) for form in (PLAIN, FULL, ANY))
    assert other < plain < full
    assert building_module.duration([(follow, PLAIN)] * 8) == 4 * plain
    assert building_module.duration([(follow, FULL), (scaled, ANY)]) == full


def test_form_that_runs_require_is_compiled_ahead(cache, monkeypatch):
    """The listed object file is the file that was written."""
    pairs = [(new_kernel(has_forms=True), Variant(form)) for form in (PLAIN, FULL)]

    def run_all(compilations):
        for compilation in compilations:
            names = compilation.kernel.name, compilation.form, native()
            yield compilation, [pack(b"code", {**store.identity(*names), "symbol": "b"})]

    monkeypatch.setattr("tdint.kernels.building.process.run_all", run_all)
    written = compile_ahead(pairs, ["native"], None, lambda done: None)
    assert sorted(map(str, written)) == sorted(
        file for _, _, file, _ in building_module.list_objects(pairs)
    )
    assert len(written) == 2
