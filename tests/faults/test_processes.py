"""Processes that are ended from outside: no orphan, no temporary file, no half file, no hang, the
right exit code."""

import os
import signal
import sys
from contextlib import suppress

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

JOBS = ("spectrum", "many", "--jobs", "2", "-o", "out/", "--periods", "0.1:10:3000")


def tables(folder):
    return (
        sorted(path.name for path in (folder / "out").glob("*.csv"))
        if (folder / "out").is_dir()
        else []
    )


def temporary(folder):
    return [path.name for path in folder.rglob(".*") if path.is_file()]


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGTERM, 143),
        (signal.SIGINT, 130),
        pytest.param(signal.SIGKILL, -9, marks=pytest.mark.slow),
    ],
)
def test_a_command_with_workers_that_is_ended(folder, start, number, code):
    command = start(*JOBS)
    command.wait_for(lambda: len(command.children()) == 2 and len(tables(folder)) >= 1)
    # Ctrl-C at a terminal goes to all processes.
    (os.killpg if number == signal.SIGINT else os.kill)(command.process.pid, number)
    ended, _, words = command.end()
    assert ended == code, words
    command.nobody_is_left()
    if number != signal.SIGKILL:
        said = [line for line in words.splitlines() if line and "compiling" not in line]
        assert said == [{143: "Terminated", 130: "Interrupted"}[code]]
        assert not temporary(folder)
    for name in tables(folder):
        assert (folder / "out" / name).read_text().endswith("\n")


@pytest.mark.parametrize(
    ("done", "which"),
    [(0, 0), *(pytest.param(done, 1, marks=pytest.mark.slow) for done in (1, 3, 5))],
)
def test_a_killed_worker(folder, start, done, which):
    """A killed worker costs one record, which is named; the others are done."""
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
    code, _, words = command.end()
    lost = [line for line in words.splitlines() if "ended unexpectedly" in line]
    # It may have been between two records.
    assert (code, len(lost)) in ((5, 1), (0, 0)), words
    assert len(tables(folder)) >= 8 - len(lost)
    assert not temporary(folder)
    command.nobody_is_left()


@pytest.mark.slow
def test_all_workers_killed_at_once(folder, start):
    command = start(*JOBS)
    command.wait_for(lambda: len(command.children()) == 2)
    for pid in command.children():
        os.kill(pid, signal.SIGKILL)
    code, _, words = command.end()
    assert code in (0, 5)
    assert len(tables(folder)) >= 6, words


def test_a_run_that_is_ended_leaves_no_half_file(folder, start):
    command = start("run", "model.yaml", "--history", "-o", "out", "--dt", "2e-5")
    command.wait_for(lambda: (folder / "out").is_dir() or command.process.poll() is not None)
    if command.process.poll() is None:
        os.kill(command.process.pid, signal.SIGTERM)
    code = command.end()[0]
    assert code in (0, 143) and not temporary(folder)
    assert not code or not (folder / "out" / "summary.json").exists()
