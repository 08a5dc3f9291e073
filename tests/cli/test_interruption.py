"""Ctrl-C and SIGTERM while a library is executing and Python cannot handle signals."""

import errno
import re
import signal
import subprocess
import sys
import time

import click
import pytest

from selection import every
from tdint_cli.main import COMMANDS, cli
from tdint_cli.terminal import Settings, exit_code_of

# The process writes a file and spends more than ten seconds in LAPACK.
STUCK = """
import sys
from pathlib import Path
import numpy as np
from tdint.files import write_files
from tdint_cli.terminal import end_in_time, exit_code_of
from tdint_cli.terminal import Settings

def write(stream):
    stream.write(b"1,2")
    matrix = np.random.default_rng(1).random((3000, 3000))
    print("ready", flush=True)
    np.linalg.svd(matrix)

end_in_time()
file = Path(sys.argv[1]) / "out.csv"
sys.exit(exit_code_of(lambda: write_files({file: write}, overwrite=False), Settings()))
"""


ASKED = [(signal.SIGINT, 130, "Interrupted"), (signal.SIGTERM, 143, "Terminated")]
OTHERS = [
    (getattr(signal, name), 128 + getattr(signal, name), "Terminated")
    for name in ("SIGHUP", "SIGXCPU", "SIGQUIT", "SIGALRM", "SIGUSR1", "SIGUSR2")
    if hasattr(signal, name)
]


def started(ends, *arguments):
    """Start Python processes that have printed their marker line, one per expected outcome; they
    mostly wait."""
    command = [sys.executable, *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    processes = {subprocess.Popen(command, **pipes): end for end in ends}
    assert all(process.stdout.readline() == "ready\n" for process in processes)
    return processes


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.long
def test_a_signal_ends_the_command_inside_a_library(tmp_path):
    """The signals are Ctrl-C and the hang-up of a terminal, sent to separate commands."""
    ends = started([ASKED[0], *OTHERS[:1]], "-c", STUCK, str(tmp_path))
    time.sleep(0.1)  # The process enters LAPACK.
    for process, (number, _, _) in ends.items():
        process.send_signal(number)
    for process, (number, code, word) in ends.items():
        _, messages = process.communicate(timeout=30)
        assert (process.returncode, messages) == (code, f"{word}\n"), number
    assert list(tmp_path.iterdir()) == []


# Ctrl-C occurs during the import of the module `signal`.
EARLY = """
import sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "signal":
            raise KeyboardInterrupt

sys.modules.pop("signal", None)
sys.meta_path.insert(0, Interrupting())
from tdint_cli import start
start()
"""


def test_a_signal_during_start_ends_the_command_without_a_traceback():
    ended = subprocess.run([sys.executable, "-c", EARLY], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


# The command has ended, and Python waits for a thread that still works.
LINGERING = """
import sys, time
from concurrent.futures import ThreadPoolExecutor
from tdint_cli.terminal import end_in_time, exit_code_of
from tdint_cli.terminal import Settings

def command():
    ThreadPoolExecutor().submit(time.sleep, 20)
    print("ready", flush=True)
    time.sleep(20)

ended = end_in_time()
try:
    sys.exit(exit_code_of(command, Settings()))
finally:
    ended()
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_repeated_signals_are_reported_once():
    """The signal is sent once to a command and three times to other commands."""
    ends = started(zip([*ASKED, *OTHERS[-1:]], (1, 3, 3), strict=False), "-c", LINGERING)
    for again, pause in enumerate((0.1, 0.1, 0.05)):
        time.sleep(pause)
        for process, ((number, _, _), times) in ends.items():
            if again < times:
                process.send_signal(number)
    for process, ((_, code, word), times) in ends.items():
        _, messages = process.communicate(timeout=15)
        assert (process.returncode, messages) == (code, f"{word}\n"), times


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, *(number for number, _, _ in OTHERS)])
def test_an_exception_after_a_signal_is_reported_as_the_signal(capsys, number):
    """Modules that are being imported convert the interrupt into other exceptions."""

    def command():
        try:
            signal.raise_signal(number)
        except BaseException as error:
            raise ImportError("cannot load this") from error

    # A test run in the background of a shell or under nohup inherits ignored signals.
    default = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
    inherited = signal.signal(number, default)
    try:
        assert exit_code_of(command, Settings()) == 128 + number
        assert capsys.readouterr().err == (
            "Interrupted\n" if number == signal.SIGINT else "Terminated\n"
        )
        assert signal.getsignal(number) == default
    finally:
        signal.signal(number, inherited)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_an_ignored_signal_is_ignored(capsys):
    """This is the case with `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert exit_code_of(lambda: signal.raise_signal(signal.SIGHUP), Settings()) == 0
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (MemoryError(), "not enough memory; "),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "not enough memory; "),
        (ImportError("libx.so: failed to map segment from shared object"), "not enough memory; "),
        (RuntimeError("can't start new thread"), "no process or thread can be started; "),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "no process or thread"),
    ],
)
@pytest.mark.parametrize("name", every(9, COMMANDS))
def test_missing_memory_and_threads_are_one_line_with_options_of_the_command(
    capsys, name, error, message
):
    def command():
        raise ValueError("something else") from error

    parameters = cli.get_command(click.Context(cli), name).params
    options = frozenset(word for parameter in parameters for word in parameter.opts)
    assert exit_code_of(command, Settings(options=options)) == 5
    text = capsys.readouterr().err
    assert text.startswith(f"Error: {message}") and text.count("\n") == 1
    assert options.issuperset(re.findall(r"--[a-z-]+", text))
