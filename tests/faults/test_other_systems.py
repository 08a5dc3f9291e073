"""What other operating systems have not: commands run through without the names that only POSIX or
Linux has."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

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
"""As `sitecustomize` in every process of Python, those that a command starts among them."""

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
    ("run", CONFIGS / "ten-story.yaml", *NEAR_FAULT, "--scale", "1,2", "-o", "runs.csv"),
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
"""Commands one after the other in a process, which takes most of the time to begin."""


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """What runs `tdint` in a folder with models: in a process on a system that has less, or
    here."""
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

    def run(*words, **environment):
        environment = {**os.environ, "PYTHONPATH": "less", **environment}
        return subprocess.run([sys.executable, *words], env=environment, capture_output=True)

    return run


def printed_here(*arguments):
    """What a command prints in this process, where nothing is missing."""
    return runner().invoke(cli, [*map(str, arguments)], prog_name="tdint").stdout_bytes


@pytest.mark.parametrize(
    "commands", [COMMANDS, pytest.param(SLOW, marks=pytest.mark.slow)], ids=["few", "slow"]
)
def test_commands_run_without_posix_functions(elsewhere, commands):
    done = elsewhere("-c", ALL_OF.format(lines=[[*map(str, command)] for command in commands]))
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False), done.stderr.decode()
    assert done.stdout.endswith(
        b"".join(printed_here(*command) for command in commands if "-o" not in command)
    )


@pytest.mark.parametrize("encoding", ["cp1252", pytest.param("ascii", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("command", "code"),
    [(("chart", "--help"), 0), (("check", "büro-β.yaml", "nö-β.yaml"), 3)],
    ids=["help", "data and an error"],
)
def test_a_console_of_another_encoding_gets_messages_and_data(elsewhere, command, code, encoding):
    """Words are shown as far as it can; data are UTF-8 everywhere."""
    done = elsewhere("-m", "tdint", *command, PYTHONPATH="", PYTHONIOENCODING=encoding)
    assert (done.returncode, b"internal error" in done.stderr) == (code, False), done.stderr
    # Lines of a help are as long as what looks at it is wide.
    assert done.stdout.split() == printed_here(*command).split()
