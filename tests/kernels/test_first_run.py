"""A first run at once: as its loops are written, which are compiled beside it."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import tdint
from tdint.analysis.run.prepared import PreparedBuilding, run_interpreted
from tdint.kernels.building import load_or_compile, store
from tdint.methods.catalogue import catalogue, parse

CONFIGS = Path(__file__).parents[2] / "configs"
INTERPRETED = """
import json, sys
import tdint
from tdint.analysis.run.prepared import run_interpreted
for file, method in json.loads(sys.argv[1]):
    case = tdint.prepare(file, method=method, allow_unstable=True)
    assert run_interpreted(case.prepared, [case.method], 100)
    response = tdint.run_case(case, duration=0.5, check=False)
    print(json.dumps([response.stories.peak_drift.tolist(), response.stories.peak_absolute_acceleration.tolist()]))
"""  # noqa: E501
LAWS = (
    "ten-story-bilinear",
    "base-isolated",
    "three-story-concrete",
    "collapse-prone-frame",
    "softening",
    "hardening",
)
CASES = [(str(CONFIGS / "ten-story.yaml"), name) for name in catalogue()]
CASES += [
    (str(CONFIGS / f"{model}.yaml"), name)
    for model in LAWS
    for name in ("impulse4", "newmark-average", "moment4")
]


def environment(cache, **further):
    """Of a user: no variables of tests or of jobs, an empty cache."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in ("CI", "TDINT_KERNELS", "TDINT_COMPILE")
    }
    return {**kept, "TDINT_CACHE_DIR": str(cache), **further}


@pytest.mark.skipif(
    store._PREBUILT.exists(), reason="this is a wheel with compiled loops: nothing is interpreted"
)
def test_every_method_and_law_gives_what_compiled_loops_give_but_for_rounding(tmp_path):
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


def test_what_python_refuses_to_divide_is_what_arrays_give():
    def kernel(h, array):
        array[0, 0] += 1.0
        array[0, 1] = h / array[1, 0]
        return array[0, 0]

    array = np.zeros((2, 2))
    assert load_or_compile.as_views(kernel)(2.0, array) == 1.0
    np.testing.assert_array_equal(array, [[1.0, np.inf], [0.0, 0.0]])


@pytest.fixture
def of_user(tmp_path, monkeypatch):
    """The environment of a user with an empty cache; programs that were started."""
    for name in ("CI", "TDINT_KERNELS", "TDINT_COMPILE", "TDINT_KERNELS_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(store, "find_object", lambda *arguments, **how: None)
    # Kernels of this process stay as they are.
    monkeypatch.setattr(
        "tdint.kernels.building.compilable.Compilable.install", lambda *arguments, **how: None
    )
    started = []
    monkeypatch.setattr(
        load_or_compile, "spawn_detached", lambda arguments, folder: started.append(arguments)
    )
    return started


def begun(model="ten-story", method="impulse4", steps=1000):
    prepared = PreparedBuilding.of(tdint.load_model(CONFIGS / f"{model}.yaml"))
    return run_interpreted(prepared, [parse(method)], steps)


def test_a_short_run_begins_at_once_and_a_long_one_does_not(of_user):
    """180 000 steps times floors, the ground among them, of which ten stories have eleven."""
    assert begun(steps=180_000 // 11) and len(of_user) == 1
    assert not begun(steps=180_000 // 11 + 1)
    assert not begun("fluid-dampers", steps=1)
    assert len(of_user) == 1


@pytest.mark.parametrize(
    "name, value",
    [("CI", "true"), ("TDINT_COMPILE", "wait"), ("SLURM_JOB_ID", "7"), ("TDINT_KERNELS", "whole")],
)
def test_nothing_is_interpreted_where_results_are_compared_or_somebody_rather_waits(
    of_user, monkeypatch, name, value
):
    assert begun()
    monkeypatch.setenv(name, value)
    assert not begun()


def test_one_process_at_a_time_compiles_and_none_where_nobody_wants_it(
    of_user, tmp_path, monkeypatch, caplog
):
    caplog.set_level("INFO", "tdint")
    monkeypatch.setenv("TDINT_COMPILE", "never")
    assert begun() and not of_user
    monkeypatch.delenv("TDINT_COMPILE")
    with (store.writable() / ".lock-beside").open("a") as stream:
        assert tdint.system.lock(stream.fileno())
        assert begun() and not of_user
    assert begun() and len(of_user) == 1
    assert [line.count("TDINT_COMPILE=wait") for line in caplog.messages] == [0, 1, 1]


def test_where_no_process_can_be_started_the_run_goes_on(of_user, monkeypatch, caplog):
    """Under `ulimit -u` and in containers with a limit; the note does not promise what fails."""
    caplog.set_level("INFO", "tdint")

    def refused(*_):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(load_or_compile, "spawn_detached", refused)
    assert begun()
    assert "no process can be started" in caplog.text
    assert "in the background" not in caplog.text


@pytest.mark.slow
def test_the_second_run_is_compiled(tmp_path):
    shutil.copy(CONFIGS / "hardening.yaml", model := tmp_path / "model.yaml")
    cache, said = tmp_path / "cache", []
    for _ in range(2):
        process = subprocess.run(
            [sys.executable, "-m", "tdint_cli", "run", model, "-o", tmp_path / str(len(said))],
            env=environment(cache),
            capture_output=True,
            text=True,
        )
        assert process.returncode == 0, process.stderr
        said.append("TDINT_COMPILE=wait" in process.stderr)
        # The process beside holds the lock from its start until the last object is kept.
        deadline = time.monotonic() + 300.0
        while not list(cache.rglob("*.object")) and time.monotonic() < deadline:
            time.sleep(1.0)
        with next(cache.rglob(".lock-beside")).open("a") as stream:
            while not tdint.system.lock(stream.fileno()) and time.monotonic() < deadline:
                time.sleep(1.0)
    assert said == [True, False]
