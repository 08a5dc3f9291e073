"""Directory with records and a model, and the command as a separate process."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

MODEL = """\
name: fault
stories:
  - {repeat: 2, mass: 10, height: 3, stiffness: 8000}
damping: {rayleigh: {ratio: 0.05, modes: [1, 2]}}
excitation: {record: {file: r0.csv, units: m/s^2}}
analysis: {method: newmark-average}
"""
MAIN = "from tdint_cli.main import main; main()"


def write_table(file: Path, samples: int) -> None:
    t = np.arange(samples) * 0.01
    rows = "\n".join(f"{value:.6f}" for value in 3.0 * np.sin(9.0 * t) * np.exp(-0.1 * t))
    file.write_text(f"# dt = 0.01 s, units = m/s^2, samples = {samples}\n{rows}\n")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Change to a directory with model.yaml, r0.csv, and the records r0.csv to r7.csv with 5000
    samples in `many`."""
    work = tmp_path / "work"
    (work / "many").mkdir(parents=True)
    write_table(work / "many" / "r0.csv", 5000)
    for i in range(1, 8):
        (work / "many" / f"r{i}.csv").hardlink_to(work / "many" / "r0.csv")
    write_table(work / "r0.csv", 500)
    (work / "model.yaml").write_text(MODEL)
    monkeypatch.chdir(work)
    return work


def wait_until(has_happened, seconds, message=lambda: ""):
    """Wait until `has_happened()` is true; after `seconds`, fail with `message()`."""
    end = time.monotonic() + seconds
    while not has_happened():
        assert time.monotonic() < end, message()
        time.sleep(0.03)


class Command:
    """`tdint ARGUMENTS` in a separate session, so that remaining processes can be identified."""

    def __init__(self, *arguments, cwd, **environment):
        additional = {key: value for key, value in environment.items() if value is not None}
        base = {key: value for key, value in os.environ.items() if key not in environment}
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", MAIN, *map(str, arguments)],
            cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True, env={**base, **additional},
        )  # fmt: skip

    def wait_for(self, happened, seconds=60.0):
        def happened_or_ended():
            if happened():
                return True
            assert self.process.poll() is None, self.process.communicate()[1]
            return False

        wait_until(happened_or_ended, seconds)

    def end(self, seconds=60.0):
        """Wait for the end; return exit code, standard output and standard error."""
        out, err = self.process.communicate(timeout=seconds)
        return self.process.returncode, out, err

    def children(self):
        """Return the process numbers of this command, except the first process."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != self.process.pid:
                try:
                    fields = (entry / "stat").read_text().rpartition(")")[2].split()
                except OSError:
                    continue
                if (
                    int(fields[3]) == self.process.pid and fields[0] != "Z"
                ):  # fields[3] is the session.
                    found.append(int(entry.name))
        return found

    def nobody_is_left(self, seconds=10.0):
        wait_until(lambda: not self.children(), seconds, self.children)


@pytest.fixture
def start(folder):
    """Return a function that starts commands. Remaining processes are killed after the test."""
    started = []

    def begin(*arguments, **environment):
        command = Command(*arguments, cwd=folder, **environment)
        started.append(command)
        return command

    yield begin
    for command in started:
        for pid in [*command.children(), command.process.pid]:
            with suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        command.process.wait()
