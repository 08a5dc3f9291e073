"""What other operating systems have not: commands run through without the names that only POSIX or Linux has."""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

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
"""
"""As `sitecustomize` in every process of Python, those that a command starts among them."""

NEAR_FAULT = (RECORDS / "near-fault.mseed", "--component", "HN1", "--units", "m/s^2")
CAMPAIGN = f"""\
buildings: {{models: ['{CONFIGS}/ten-story.yaml']}}
records: {{files: ['{RECORDS}/near-fault.mseed'], units: m/s^2}}
intensity: {{scales: [0.5, 1]}}
"""
COMMANDS = [
    ("run", CONFIGS / "ten-story.yaml", "-o", "out/"),
    pytest.param(
        ("run", CONFIGS / "ten-story.yaml", *NEAR_FAULT, "--scale", "1,2", "-o", "runs.csv"), marks=pytest.mark.slow
    ),
    ("spectrum", RECORDS, "--units", "m/s^2", "-o", "spectra/", "--jobs", "2"),
    pytest.param(("ida", CONFIGS / "ten-story.yaml", *NEAR_FAULT, "-o", "ida/"), marks=pytest.mark.slow),
    ("campaign", "campaign.yaml", "-o", "campaign/"),
]


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory):
    """A folder with models, and what runs `tdint` in it on a system that has less."""
    folder = tmp_path_factory.mktemp("elsewhere")
    (folder / "less").mkdir()
    (folder / "less" / "sitecustomize.py").write_text(TAKE_AWAY, encoding="utf-8")
    (folder / "campaign.yaml").write_text(CAMPAIGN, encoding="utf-8")

    def run(*arguments, less=True, **environment):
        paths = [str(folder / "less")] if less else []
        return subprocess.run(
            [sys.executable, "-m", "tdint", *map(str, arguments)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), **environment},
            capture_output=True,
            cwd=folder,
        )

    return folder, run


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(map(str, command[:2])))
def test_a_command_needs_nothing_that_only_posix_has(elsewhere, command):
    _folder, run = elsewhere
    done = run(*command)
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False), done.stderr.decode()


def test_what_has_less_writes_the_same(elsewhere):
    _folder, run = elsewhere
    command = ("run", CONFIGS / "ten-story.yaml")
    less, all_of_it = run(*command), run(*command, less=False)
    assert (less.returncode, less.stdout) == (0, all_of_it.stdout)


@pytest.fixture(scope="module")
def in_utf8(elsewhere):
    """What a command prints where nothing is missing."""
    _folder, run = elsewhere
    return cache(lambda *command: run(*command, less=False, PYTHONUTF8="1").stdout)


@pytest.mark.parametrize("encoding", ["cp1252", pytest.param("ascii", marks=pytest.mark.slow)])
def test_a_console_of_another_encoding_gets_words_and_data(elsewhere, in_utf8, encoding):
    """Words are shown as far as it can; data are UTF-8 everywhere."""
    folder, run = elsewhere
    model = (CONFIGS / "ten-story.yaml").read_text(encoding="utf-8").replace("../", f"{CONFIGS.parent}/")
    (folder / "büro-β.yaml").write_text(model, encoding="utf-8")
    for command, code in [
        (("chart", "--help"), 0),
        (("methods",), 0),
        (("run", "büro-β.yaml"), 0),
        (("run", "nö-β.yaml"), 3),
    ]:
        done = run(*command, PYTHONIOENCODING=encoding)
        assert (done.returncode, b"internal error" in done.stderr) == (code, False), done.stderr
        assert done.stdout == in_utf8(*command)  # fmt: skip
