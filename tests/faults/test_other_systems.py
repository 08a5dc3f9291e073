"""Commands run without functions that exist only on POSIX or Linux, as on other systems."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from selection import every
from separate_streams import runner
from tdint_cli.main import cli

CONFIGS = Path(__file__).parents[2] / "configs"
RECORDS = Path(__file__).parents[2] / "records"

TAKE_AWAY = """
import os, signal, sys

import platformdirs.unix  # which has other modules for other systems

set_blocking, set_wakeup_fd = os.set_blocking, signal.set_wakeup_fd

def taking_any_pipe(descriptor, **more):  # as on Windows
    if descriptor >= 0:
        set_blocking(descriptor, False)
    return set_wakeup_fd(descriptor, **more)

signal.set_wakeup_fd = taking_any_pipe
for module, names in {
    os: ("set_blocking", "getuid", "geteuid", "getgid", "sched_getaffinity", "sysconf", "memfd_create", "mkfifo",
         "fork", "statvfs", "killpg", "setsid", "pread", "pwrite", "posix_fallocate", "O_DIRECTORY", "O_NOFOLLOW"),
    signal: ("pthread_sigmask", "pthread_kill", "SIGHUP", "SIGUSR1", "SIGALRM", "setitimer", "alarm"),
}.items():
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
for name in ("fcntl", "resource", "pwd", "grp", "termios", "tty", "pty"):
    sys.modules[name] = None

import ctypes

class WithoutPrctl(ctypes.CDLL):
    def __getattr__(self, name):
        if name == "prctl":
            raise AttributeError(name)
        return super().__getattr__(name)

ctypes.CDLL = WithoutPrctl
"""  # noqa: E501
"""`sitecustomize` of every Python process, including the processes that a command starts. It
removes the functions."""

NEAR_FAULT = (RECORDS / "near-fault.mseed", "--component", "HN1", "--units", "m/s^2")
CAMPAIGN = f"""\
buildings: {{models: ['{CONFIGS}/ten-story.yaml']}}
records: {{files: ['{RECORDS}/near-fault.mseed'], units: m/s^2}}
intensity: {{scales: [0.5, 1]}}
"""
COMMANDS = [
    ("spectrum", RECORDS, "--units", "m/s^2", "--period", "0.5,1", "-o", "spectra/", "--jobs", "2"),
    ("campaign", "campaign.yaml", "-o", "campaign/", "--jobs", "1"),
    ("run", CONFIGS / "ten-story.yaml"),
]
SLOW = [
    ("run", CONFIGS / "ten-story.yaml", *NEAR_FAULT, "--scale", "1,2", "-o", "runs/"),
    ("ida", CONFIGS / "ten-story.yaml", *NEAR_FAULT, "-o", "ida/"),
]
ALL_OF = """
import sys
from tdint_cli.main import main

for line in {lines!r}:
    sys.argv = ["tdint", *line]
    try:
        main()
    except SystemExit as end:
        assert not end.code, line
"""
"""Script that runs commands in a single process, because starting a process needs most of the
time."""


@pytest.fixture
def restricted(tmp_path, monkeypatch):
    """Return a function that runs Python in a directory with models, without the functions of
    POSIX."""
    (tmp_path / "less").mkdir()
    (tmp_path / "less" / "sitecustomize.py").write_text(TAKE_AWAY, encoding="utf-8")
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN, encoding="utf-8")
    model = (
        (CONFIGS / "ten-story.yaml")
        .read_text(encoding="utf-8")
        .replace("../", f"{CONFIGS.parent}/")
    )
    (tmp_path / "büro-β.yaml").write_text(model, encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    def run(*arguments, **environment):
        environment = {**os.environ, "PYTHONPATH": "less", **environment}
        return subprocess.run([sys.executable, *arguments], env=environment, capture_output=True)

    return run


def printed_in_process(*arguments):
    """Return the output of a command in this process, which has all functions."""
    return runner().invoke(cli, [*map(str, arguments)], prog_name="tdint").stdout_bytes


@pytest.mark.parametrize(
    "commands", [COMMANDS, pytest.param(SLOW, marks=pytest.mark.slow)], ids=["few", "slow"]
)
@pytest.mark.long
def test_commands_run_without_posix_functions(restricted, commands):
    done = restricted("-c", ALL_OF.format(lines=[[*map(str, command)] for command in commands]))
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False), done.stderr.decode()
    assert done.stdout.endswith(
        b"".join(printed_in_process(*command) for command in commands if "-o" not in command)
    )


@pytest.mark.parametrize(
    "encoding", every(3, ["cp1252", pytest.param("ascii", marks=pytest.mark.slow)])
)
@pytest.mark.parametrize(
    ("command", "code"),
    [(("chart", "--help"), 0), (("check", "büro-β.yaml", "nö-β.yaml"), 3)],
    ids=["help", "data and an error"],
)
def test_a_console_of_another_encoding_gets_messages_and_data(restricted, command, code, encoding):
    """Characters that the encoding does not contain are replaced in messages. Data are always
    UTF-8."""
    done = restricted("-m", "tdint", *command, PYTHONPATH="", PYTHONIOENCODING=encoding)
    assert (done.returncode, b"internal error" in done.stderr) == (code, False), done.stderr
    # The line breaks of a help depend on the width of the terminal.
    assert done.stdout.split() == printed_in_process(*command).split()
