"""Processes that are terminated: no orphan process, no temporary or incomplete file, no hang, and
the correct exit code."""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from faults.conftest import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

JOBS = ("spectrum", "many", "--jobs", "2", "-o", "out/", "--periods", "0.1:10:3000")


def tables(folder):
    return (
        sorted(path.name for path in (folder / "out").glob("*.csv"))
        if (folder / "out").is_dir()
        else []
    )


def temporary_files(folder):
    return [path.name for path in folder.rglob(".*") if path.is_file()]


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGTERM, 143),
        (signal.SIGINT, 130),
        pytest.param(signal.SIGKILL, -9, marks=pytest.mark.slow),
    ],
)
@pytest.mark.long
def test_a_signal_ends_a_command_and_its_workers(folder, start, number, code):
    command = start(*JOBS)
    command.wait_for(lambda: len(command.children()) == 2 and len(tables(folder)) >= 1)
    # Ctrl-C at a terminal is sent to all processes.
    (os.killpg if number == signal.SIGINT else os.kill)(command.process.pid, number)
    ended, _, messages = command.end()
    assert ended == code, messages
    command.nobody_is_left()
    if number != signal.SIGKILL:
        lines = [line for line in messages.splitlines() if line and "compiling" not in line]
        assert lines == [{143: "Terminated", 130: "Interrupted"}[code]]
        assert not temporary_files(folder)
    for name in tables(folder):
        assert (folder / "out" / name).read_text().endswith("\n")


@pytest.mark.parametrize(
    ("done", "which"),
    [(0, 0), *(pytest.param(done, 1, marks=pytest.mark.slow) for done in (1, 3, 5))],
)
@pytest.mark.long
def test_a_killed_worker_loses_one_record(folder, start, done, which):
    """The record of a killed worker is reported, and all other records are completed."""
    command = start("spectrum", "many", "--jobs", "2", "-o", "out/", "--periods", "0.1:10:500")
    command.wait_for(
        lambda: (
            (len(command.children()) == 2 and len(tables(folder)) >= done)
            or command.process.poll() is not None
        )
    )
    for worker in command.children()[which : which + 1]:
        with suppress(ProcessLookupError):
            os.kill(worker, signal.SIGKILL)
    code, _, messages = command.end()
    errors = [line for line in messages.splitlines() if "ended unexpectedly" in line]
    # The worker may have been killed between two records.
    assert (code, len(errors)) in ((5, 1), (0, 0)), messages
    assert len(tables(folder)) >= 8 - len(errors)
    assert not temporary_files(folder)
    command.nobody_is_left()


@pytest.mark.slow
def test_all_workers_killed_at_once(folder, start):
    command = start(*JOBS)
    command.wait_for(lambda: len(command.children()) == 2)
    for pid in command.children():
        os.kill(pid, signal.SIGKILL)
    code, _, messages = command.end()
    assert code in (0, 5), messages
    assert len(tables(folder)) >= 6, messages


@pytest.mark.long
def test_a_terminated_run_leaves_no_incomplete_file(folder, start):
    command = start("run", "model.yaml", "--history", "-o", "out", "--dt", "2e-5")
    command.wait_for(lambda: (folder / "out").is_dir() or command.process.poll() is not None)
    if command.process.poll() is None:
        os.kill(command.process.pid, signal.SIGTERM)
    code = command.end()[0]
    assert code in (0, 143) and not temporary_files(folder)
    assert not code or not (folder / "out" / "summary.json").exists()


@pytest.mark.slow
def test_a_complete_run_removes_the_files_of_a_killed_run(folder, start):
    line = ("run", "model.yaml", "--history", "-o", "out", "--dt", "2e-5")
    killed = start(*line)
    killed.wait_for(lambda: temporary_files(folder))
    os.kill(killed.process.pid, signal.SIGKILL)
    killed.end()
    assert temporary_files(folder)
    code, _, messages = start(*line[:-2]).end()
    assert code == 0, messages
    assert not temporary_files(folder)


WORKER = """\
import sys, time
from tdint.assessment.chart import opensees_worker
opensees_worker.find_spec = lambda name: print("started", flush=True) or time.sleep(100)
sys.exit(opensees_worker.main())
"""
"""The worker of OpenSeesPy with a run that never ends."""

WAITING = """\
import os, threading, time
from tdint_cli.processes import _end_with_parent
threading.Thread(target=_end_with_parent, daemon=True).start()
print("started", flush=True)
time.sleep(100)
"""
"""Code of a worker on systems that send no signal when the parent process ends."""

PARENTS = {
    "opensees": f"import os, subprocess, sys\nsubprocess.run([sys.executable, '-c', {WORKER!r}, "
    "str(os.getpid())])\n",
    "other systems": "import multiprocessing\n"
    "context = multiprocessing.get_context('fork')\n"
    f"process = context.Process(target=exec, args=({WAITING!r}, {{}}))\n"
    "process.start()\nprocess.join()\n",
}


@pytest.mark.parametrize("name", PARENTS)
def test_a_worker_ends_with_a_killed_parent(name):
    """No handler of the parent runs, because it is killed."""
    environment = os.environ | {"TDINT_KERNELS": "python"}
    line = [sys.executable, "-c", PARENTS[name]]
    with subprocess.Popen(
        line, stdout=subprocess.PIPE, env=environment, start_new_session=True
    ) as parent:
        assert parent.stdout is not None and parent.stdout.readline() == b"started\n"
        parent.kill()
        parent.wait()
        # The worker has inherited the pipe, which ends with the worker.
        os.set_blocking(parent.stdout.fileno(), False)
        wait_until(lambda: parent.stdout.read() == b"", 20.0)


@pytest.mark.long
def test_workers_of_fuzz_tests_end_with_a_killed_parent():
    """A batch of a worker needs minutes, so that the worker would remain."""
    script = Path(__file__).parents[1] / "fuzz/run.py"
    line = [sys.executable, str(script), "--of", "studies", "--cases", "5000", "--jobs", "1"]
    with subprocess.Popen(
        line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
    ) as parent:
        assert parent.stdout is not None
        wait_until(lambda: any_worker(parent.pid), 60.0)
        os.kill(parent.pid, signal.SIGKILL)
        parent.wait()
        os.set_blocking(parent.stdout.fileno(), False)
        wait_until(lambda: parent.stdout.read() == b"", 20.0)


def any_worker(parent):
    """Return True if a process of the pool is running a batch: its working directory is a
    sandbox."""
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(fields[1]) == parent and (entry / "cwd").readlink() != Path.cwd():
                return True
    return False


@pytest.mark.slow
def test_sixteen_processes_with_an_empty_cache(folder, start, tmp_path):
    """One compiles the loop of spectra; all print equal tables, and no temporary file is left."""
    cache = tmp_path / "cache"
    started = [
        start("info", "r0.csv", TDINT_CACHE_DIR=str(cache), TDINT_COMPILE="wait") for _ in range(16)
    ]
    ends = [process.end(600.0) for process in started]
    assert {code for code, _, _ in ends} == {0}
    assert len({table for _, table, _ in ends}) == 1
    assert not list(cache.rglob("*.part")) and list(cache.rglob("*.object"))
    assert cache.stat().st_mode & 0o777 == 0o700
