"""Pipes, full disks, closed streams and Ctrl-C, with the command as a separate process."""

import io
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import click
import pytest

from tdint.errors import OutputError
from tdint_cli import terminal

TDINT = f"{sys.executable} -c 'from tdint_cli.main import main; main()'"


def shell(command: str) -> subprocess.CompletedProcess[str]:
    """Run a line of bash with the command as $TDINT."""
    script = f'set -o pipefail; tdint() {{ {TDINT} "$@"; }}; {command}'
    return subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=False)


@pytest.mark.long
def test_a_closed_pipe_is_no_error(folder):
    """A closed pipe is no error for many rows and for a table that is also written to a file."""
    done = shell(
        "tdint law forced.yaml --drift 1% --points 2000 | head -n 2 && tdint run forced.yaml -o "
        "out | true"
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 2
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "stories.csv",
        "summary.json",
    ]
    assert "Broken" not in done.stderr and "Error" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_help_is_written_to_standard_output():
    """Help is written to standard output. tests/faults/test_outputs.py tests a full disk."""
    full, closed = shell("tdint run -h > /dev/full"), shell("tdint init - >&-")
    assert (full.returncode, closed.returncode) == (6, 6)
    assert full.stderr == "Error: standard output: cannot be written: No space left on device\n"
    assert closed.stderr == "Error: standard output is closed\n"


@pytest.mark.long
def test_closed_streams(folder):
    done = shell("tdint modes forced.yaml 2>&-")
    assert (done.returncode, len(done.stdout.splitlines())) == (0, 3)
    assert shell("tdint modes - <&-").returncode == 3


def test_output_is_utf8_in_any_locale(folder):
    (folder / "forced.yaml").rename(folder / "Köln.yaml")
    done = shell("LC_ALL=C PYTHONUTF8=0 PYTHONCOERCECLOCALE=0 tdint check Köln.yaml")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1].startswith("Köln.yaml,")


class _Trickle(io.RawIOBase):
    """Stream that accepts a few bytes per call and at most `limit` bytes."""

    def __init__(self, limit):
        self.taken, self.limit = b"", limit

    def write(self, data):
        part = bytes(data[: min(7, self.limit - len(self.taken))])
        self.taken += part
        return len(part)


def test_partial_writes_are_repeated_until_complete_or_refused(monkeypatch):
    data = bytes(range(256))
    monkeypatch.setattr(terminal, "_discard_further_output", lambda: None)
    complete, full = _Trickle(1000), _Trickle(100)
    for stream in (complete, full):
        monkeypatch.setattr(
            sys, "stdout", SimpleNamespace(buffer=stream, flush=lambda: None, fileno=lambda: 1)
        )
        with (
            pytest.raises(OutputError, match="cannot be written")
            if stream is full
            else nullcontext()
        ):
            terminal.emit(data)
    assert complete.taken == data


def test_equal_messages_about_files_are_one_line(capsys):
    """The part after a colon belongs to the message, and two files are named."""
    with click.Context(click.Command("some"), obj=terminal.Settings()):
        terminal.note(*(f"{name}.V2: vertical component omitted: V" for name in "abc"))
        terminal.warn(*(f"{name}.V2: vertical component omitted: {name}" for name in "ab"))
        terminal.warn("a.V2: cut", "b.V2: cut")
    assert capsys.readouterr().err.splitlines() == [
        "note: a.V2, b.V2 and 1 more: vertical component omitted: V",
        "Warning: a.V2: vertical component omitted: a",
        "Warning: b.V2: vertical component omitted: b",
        "Warning: a.V2, b.V2: cut",
    ]
