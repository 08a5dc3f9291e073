"""The first run starts at once with interpreted loops, while the loops are compiled in the
background."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import tdint
from csv_rows import rows as csv_rows
from tdint.kernels import layout as rows
from tdint.kernels import linear_terms
from tdint.kernels.building import (
    background,
    compilable,
    load_or_compile,
    process,
    store,
    target,
)
from tdint.kernels.building.compilable import ANY, F8, FULL, PLAIN, Variant
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws import compiled
from tdint.kernels.laws.compiled import CompiledLaw, compiled_laws
from tdint.kernels.stories import law_state
from tdint.kernels.time_loop.loop import integrate
from tdint.methods.catalogue import catalogue, parse
from tdint.response.runs import prepared
from tdint.response.runs.analysis_kernels import run_interpreted
from tdint.response.runs.prepared import PreparedBuilding

CONFIGS = Path(__file__).parents[2] / "configs"
INTERPRETED = """
import json, sys
import tdint
from tdint.response.runs.analysis_kernels import run_interpreted
for file, method in json.loads(sys.argv[1]):
    case = tdint.prepare(file, method=method, allow_unstable=True)
    assert run_interpreted(case.prepared, [case.method], True)
    response = tdint.run_case(case, duration=0.5, check=False)
    print(json.dumps([response.stories.peak_drift.tolist(), response.stories.peak_absolute_acceleration.tolist()]))
"""  # noqa: E501
LAWS = (
    "ten-story-bilinear", "base-isolated", "absorber-frame", "three-story-concrete", "infill-frame",
    "collapse-prone-frame", "softening", "blast-frame", "hardening",
)  # fmt: skip
CASES = [(str(CONFIGS / "ten-story.yaml"), name) for name in catalogue()]
CASES += [
    (str(CONFIGS / f"{model}.yaml"), name)
    for model in LAWS
    for name in ("impulse4", "newmark-average", "moment4")
]


def environment(cache, **further):
    """Return the environment of a user: an empty cache, and no variables of tests or jobs."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in ("CI", "TDINT_KERNELS", "TDINT_COMPILE")
    }
    return {**kept, "TDINT_CACHE_DIR": str(cache), **further}


@pytest.mark.skipif(
    store._PREBUILT.exists(), reason="this is a wheel with compiled loops: nothing is interpreted"
)
@pytest.mark.long
def test_interpreted_loops_agree_with_compiled_loops(tmp_path):
    process = subprocess.run(
        [sys.executable, "-c", INTERPRETED, json.dumps(CASES)],
        env=environment(tmp_path, TDINT_COMPILE="never"),
        capture_output=True,
        text=True,
    )
    lines = process.stdout.splitlines()
    assert len(lines) == len(CASES), process.stderr
    for (file, method), line in zip(CASES, lines, strict=True):
        case = tdint.prepare(file, method=method, allow_unstable=True)
        stories = tdint.run_case(case, duration=0.5, check=False).stories
        for values, other in zip(
            (stories.peak_drift, stories.peak_absolute_acceleration), json.loads(line), strict=True
        ):
            np.testing.assert_allclose(
                values, other, rtol=1e-8, atol=1e-12, err_msg=f"{file} {method}"
            )


def test_interpreted_division_by_zero_gives_infinity():
    def kernel(h, array):
        array[0, 0] += 1.0
        array[0, 1] = h / array[1, 0]
        return array[0, 0]

    array = np.zeros((2, 2))
    assert load_or_compile.as_views(kernel, FULL)(2.0, array) == 1.0
    np.testing.assert_array_equal(array, [[1.0, np.inf], [0.0, 0.0]])


def test_interpreted_kernels_omit_features_only_during_a_call():
    def kernel(array, fails):
        seen.append((linear_terms.FULL, law_state.FULL, rows.ELEMENTS))
        return 1 / array[0] if fails else 0.0

    seen, array = [], np.zeros(1)
    plain = load_or_compile.as_views(kernel, PLAIN)
    for fails in (False, True):  # the second call is repeated with arrays
        plain(array, fails)
    load_or_compile.as_views(kernel, FULL)(array, False)
    omitted, complete = (False, False, rows.ELEMENTS), (True, True, rows.ELEMENTS)
    assert seen == [omitted, omitted, omitted, complete]
    with pytest.raises(KeyError):
        load_or_compile.as_views(lambda _: {}[0], PLAIN)(array)
    assert linear_terms.FULL


COMPILED_AFTER_INTERPRETED = """
import os, sys
import numpy as np
import tdint
from tdint.kernels.building.compilable import INSTALLED
from tdint.methods.catalogue import parse
from tdint.response.runs.analysis_kernels import run_interpreted
from tdint.response.runs.prepared import PreparedBuilding
rod = {"type": "bilinear", "stiffness": 4e6, "yield_force": 6e4, "hardening": 0.0}
rod["fracture_drift"] = 0.03
frame = {"type": "linear", "stiffness": 6e6}
model = {"stories": [{"mass": 1e5, "elements": [frame, rod]}], "damping": 0.05}
record = tdint.make_record(6.0 * np.sin(4.0 * 0.01 * np.arange(101)), dt=0.01, units="m/s^2")
def drift(method):
    return tdint.run(model, record, method=method, check=False).stories.peak_drift[0]
assert run_interpreted(PreparedBuilding.of(tdint.load_model(model)), [parse("impulse4")], True)
first = drift("impulse4")
os.environ.update(TDINT_CACHE_DIR=sys.argv[1], TDINT_COMPILE="wait")
print(first, drift("newmark-average"), *sorted(INSTALLED))
"""


@pytest.mark.skipif(
    store._PREBUILT.exists(), reason="this is a wheel with compiled loops: nothing is interpreted"
)
@pytest.mark.long
def test_compiled_step_after_interpreted_run_has_its_laws(tmp_path):
    """The process crashed: laws that interpreted loops had used counted as loaded, but compiled
    code found no addresses of their functions. Interpreted loops require no compiled laws, which
    TDINT_COMPILE=never would refuse."""
    process = subprocess.run(
        [sys.executable, "-c", COMPILED_AFTER_INTERPRETED, str(store.writable().parent)],
        env=environment(tmp_path, TDINT_COMPILE="never"),
        capture_output=True,
        text=True,
    )
    assert process.returncode == 0, process.stderr
    first, second, *kinds = process.stdout.split()
    assert 0.03 < float(second) == pytest.approx(float(first), rel=1e-3)
    assert kinds == ["compiled", "interpreted"]


def test_interpreted_law_is_not_in_the_table_of_laws(monkeypatch):
    """A compiled kernel would call its functions at the address 0."""
    monkeypatch.setattr(compiled, "_IN_TABLE", {})
    monkeypatch.setattr(compilable, "INSTALLED", set())
    (law,) = compiled_laws([0.5])
    law.interpret(ANY, lambda function: function)
    assert not law.loaded(ANY)
    needed = []
    monkeypatch.setattr(load_or_compile, "load_missing", lambda items, _: needed.extend(items))
    loop = Kernel(lambda: 0.0, F8(), has_forms=True, vectorized=False)
    loop.interpret(FULL, lambda function: function)
    load_or_compile.load_or_compile([(loop, Variant(FULL, (law,)))])
    assert not needed
    load_or_compile.load_or_compile([(loop, Variant(PLAIN, (law,)))])
    assert needed == [(loop, PLAIN), (law, ANY)]


@pytest.fixture
def background_processes(tmp_path, monkeypatch):
    """Provide the environment of a user with an empty cache, and the list of started programs."""
    for name in ("CI", "TDINT_KERNELS", "TDINT_COMPILE", "TDINT_KERNELS_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(store, "find_object", lambda *arguments, **how: None)
    # Kernels of this process remain unchanged.
    for kind in (Kernel, CompiledLaw):
        monkeypatch.setattr(kind, "interpret", lambda *arguments: None)
    monkeypatch.setattr(load_or_compile, "_BACKGROUND", {})
    started = []
    monkeypatch.setattr(
        load_or_compile, "spawn_detached", lambda arguments, folder: started.append(arguments)
    )
    return started


def begun(model="ten-story", method="impulse4"):
    building = PreparedBuilding.of(tdint.load_model(CONFIGS / f"{model}.yaml"))
    return run_interpreted(building, [parse(method)], True)


def test_run_of_any_building_with_stories_starts_interpreted(background_processes):
    assert begun() and begun("fluid-dampers")
    assert len(background_processes) == 2
    assert not begun("frame-matrix")


def test_run_continues_with_loops_that_were_compiled_meanwhile(background_processes, monkeypatch):
    """The loop that another process has compiled is used from the next call of the loop on, and a
    compilation that could not start, because another one was running, is started again."""
    loaded = []
    monkeypatch.setattr(
        load_or_compile, "_load_existing", lambda items: loaded.extend(items) or items
    )
    assert begun() and len(background_processes) == 1
    loaded.clear()
    load_or_compile.use_compiled_kernels()
    assert not loaded and len(background_processes) == 1
    load_or_compile._BACKGROUND["time"] -= 60.0
    load_or_compile.use_compiled_kernels()
    assert not loaded and len(background_processes) == 2
    monkeypatch.setattr(store, "has", lambda *arguments: True)
    load_or_compile.use_compiled_kernels()
    load_or_compile.use_compiled_kernels()
    assert {"impulse4", "loop", "linear"} <= set(map(load_or_compile._label, loaded))
    assert len(loaded) == len(set(loaded))


@pytest.mark.parametrize(
    "name, value",
    [("CI", "true"), ("TDINT_COMPILE", "wait"), ("SLURM_JOB_ID", "7"), ("TDINT_KERNELS", "python")],
)
def test_environment_prevents_interpretation(background_processes, monkeypatch, name, value):
    """The loops are then compiled, and at the same time the spectra of the run."""
    requested = []
    monkeypatch.setattr(prepared, "load_or_compile", lambda pairs, _: requested.extend(pairs))
    assert begun() and not requested
    monkeypatch.setenv(name, value)
    assert not begun()
    assert {"impulse4", "loop", "elastic"} <= {load_or_compile._label(pair) for pair in requested}


@pytest.mark.parametrize("count, processes", [(1, 1), (2, 1), (8, 7)])
def test_compilation_in_background_leaves_a_processor_to_the_run(
    tmp_path, monkeypatch, count, processes
):
    requested = []
    monkeypatch.setattr(background.store, "writable", lambda: tmp_path)
    monkeypatch.setattr(background, "processors", lambda: count)
    monkeypatch.setattr(
        background, "load_missing", lambda kernels, processes: requested.append(processes)
    )
    monkeypatch.setattr(sys, "argv", ["", json.dumps([[integrate.name, PLAIN]])])
    background.compile_in_background()
    assert requested == [processes]


def test_only_one_background_process_compiles(background_processes, tmp_path, monkeypatch, caplog):
    caplog.set_level("INFO", "tdint")
    monkeypatch.setenv("TDINT_COMPILE", "never")
    assert begun() and not background_processes
    monkeypatch.delenv("TDINT_COMPILE")
    with (store.writable() / ".lock-beside").open("a") as stream:
        assert tdint.system.lock(stream.fileno())
        assert begun() and not background_processes
    assert begun() and len(background_processes) == 1
    assert [line.count("TDINT_COMPILE=wait") for line in caplog.messages] == [0, 1, 1]


def test_run_continues_if_no_process_can_be_started(background_processes, monkeypatch, caplog):
    """This occurs under `ulimit -u` and in containers with a limit; the note does not promise a
    compilation that fails."""
    caplog.set_level("INFO", "tdint")

    def refused(*_):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(load_or_compile, "spawn_detached", refused)
    assert begun()
    assert "cannot be started" in caplog.text
    assert "in the background" not in caplog.text


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes of POSIX")
def test_pipe_instead_of_lock_does_not_block_run(background_processes, caplog):
    caplog.set_level("INFO", "tdint")
    os.mkfifo(store.writable() / ".lock-beside")
    assert begun() and not background_processes
    assert (
        "process that compiles them cannot be started" in caplog.text
        and "is not a file" in caplog.text
    )


def test_no_compiler_is_started_if_no_thread_can_be_started(monkeypatch):
    """Under `ulimit -u`. The command reports the error (`test_interruption.py`)."""

    def refused(*_, **named):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(process.subprocess, "Popen", refused)
    monkeypatch.setattr(ThreadPoolExecutor, "submit", refused)
    with pytest.raises(RuntimeError, match="can't start new thread"):
        list(process.run_all(process.compilations([(integrate, PLAIN, target.NATIVE)])))


def required_loops(model):
    """Return the kernels with variants that a building needs."""
    prepared = PreparedBuilding.of(tdint.load_model(CONFIGS / f"{model}.yaml"))
    return [(integrate, prepared.variant)]


WAYS = {
    "nohup": "nohup {} > kept 2> said",
    "another session": "setsid -w {} > kept 2> said",
    "first process of a shell": "exec {} > kept 2> said",
    "no standard error": "{} > kept 2>&-",
    "no standard input": "{} > kept 2> said <&-",
    "a full standard error": "{} > kept 2> /dev/full",
    "no room for files": "ulimit -f 20; {} > kept 2> said",
    "few files": "ulimit -n 20; {} > kept 2> said",
}
CACHES = ["/proc", "/dev/null", "/dev/full", "", "file", "loop"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(("way", "cache"), [*((way, "cache") for way in WAYS),
                                            *(("nohup", cache) for cache in CACHES)])  # fmt: skip
def test_first_run_succeeds_in_every_environment(tmp_path, way, cache):
    """The results agree with a compiled run within rounding, and all messages are notes."""
    shutil.copy(CONFIGS / "hardening.yaml", tmp_path / "model.yaml")
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to("loop")
    where = cache if cache.startswith("/") or not cache else str(tmp_path / cache)
    command = f"{sys.executable} -m tdint_cli run model.yaml -o out"
    try:
        ended = subprocess.run(
            ["bash", "-c", WAYS[way].format(command)],
            cwd=tmp_path,
            env=environment(where, TDINT_TEST=str(tmp_path), HOME=str(tmp_path)),
            stdin=subprocess.DEVNULL,
            timeout=300,
        )
        messages = (tmp_path / "said").read_text() if (tmp_path / "said").exists() else ""
        assert ended.returncode == 0 and "Traceback" not in messages and "Error" not in messages, (
            messages
        )
        compiled = tdint.run(tmp_path / "model.yaml").stories.peak_drift[0]
        (row,) = csv_rows(tmp_path / "out" / "stories.csv")
        assert float(row["peak_drift_m"]) == pytest.approx(compiled, rel=1e-8)
    finally:
        end_marked_processes(str(tmp_path))


def end_marked_processes(mark):
    """End the processes with this text in their environment, because no process waits for their
    results."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with suppress(OSError):
                if f"TDINT_TEST={mark}".encode() in (entry / "environ").read_bytes():
                    os.kill(int(entry.name), signal.SIGKILL)


@pytest.mark.slow
def test_second_run_is_compiled(tmp_path):
    shutil.copy(CONFIGS / "hardening.yaml", model := tmp_path / "model.yaml")
    cache, is_interpreted = tmp_path / "cache", []
    for _ in range(2):
        process = subprocess.run(
            [
                sys.executable,
                "-m",
                "tdint_cli",
                "run",
                model,
                "-o",
                tmp_path / str(len(is_interpreted)),
            ],
            env=environment(cache),
            capture_output=True,
            text=True,
        )
        assert process.returncode == 0, process.stderr
        is_interpreted.append("TDINT_COMPILE=wait" in process.stderr)
        # The background process holds the lock from its start until the last object is stored.
        deadline = time.monotonic() + 1200.0  # on a busy machine; usually 30 s
        while not list(cache.rglob("*.object")):
            assert time.monotonic() < deadline
            time.sleep(1.0)
        with next(cache.rglob(".lock-beside")).open("a") as stream:
            while not tdint.system.lock(stream.fileno()):
                assert time.monotonic() < deadline
                time.sleep(1.0)
    assert is_interpreted == [True, False]


IN_ONE_PROCESS = """
import sys
from tdint_cli.main import cli
record = [sys.argv[2], "--units", "m/s^2", "-q"]
one = [*record, "--component", "HN1"]
for arguments in (
    ["run", sys.argv[1], *one, "--duration", "1", "-o", "run"],
    ["run", sys.argv[1], *one, "--duration", "1", "-o", "again"],
    ["ida", sys.argv[1], *one, "--max-im", "0.2g", "--precision", "50%", "-o", "ida"],
    ["campaign", "study.yaml", "-q", "-o", "campaign"],
    ["info", *record],
):
    try:
        cli(arguments)
    except SystemExit as end:
        print(arguments[0], end.code, file=sys.stderr)
"""


@pytest.mark.slow
def test_several_commands_in_one_process_with_an_empty_cache(tmp_path):
    """The first runs are interpreted while another process compiles; later commands of the process
    use compiled loops."""
    model, record = CONFIGS / "collapse-prone-frame.yaml", CONFIGS.parent / "records"
    (tmp_path / "study.yaml").write_text(
        f"buildings: {{models: [{model}]}}\n"
        f"records: {{files: [{record / 'near-fault.mseed'}], units: m/s^2, component: HN1}}\n"
        "analysis: {duration: 2}\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", IN_ONE_PROCESS, str(model), str(record / "near-fault.mseed")],
        env=environment(tmp_path / "cache"),
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    ends = [line for line in process.stderr.splitlines() if re.fullmatch(r"\w+ \S+", line)]
    assert ends == ["run 0", "run 0", "ida 0", "campaign 0", "info 0"], process.stderr
