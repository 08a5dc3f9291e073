"""Completion in the shell: commands, options, and values of options."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete

from tdint.methods.catalogue import catalogue
from tdint_cli.main import COMMANDS, cli


def completions(*arguments: str) -> list[tuple[str, str]]:
    *before, incomplete = arguments
    items = ShellComplete(cli, {}, "tdint", "").get_completions(list(before), incomplete)
    return [(item.type, item.value) for item in items]


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("s", {name for name in COMMANDS if name.startswith("s")}),
        ("run x.yaml --met", {"--method"}),
        ("run x.yaml --method newm", {"newmark", "newmark-average", "newmark-linear"}),
        ("chart x.yaml --method ", set(catalogue())),
        ("spectrum --units c", {"cm/s^2", "cm/s", "cm"}),
        ("order --law ", {"linear", "polynomial"}),
        ("failures --problem hardening,soft", {"hardening,softening", "hardening,soft-node"}),
        ("spectrum --maxima p", {"peer"}),
    ],
)
def test_commands_options_and_values_are_completed(line, names):
    assert set(completions(*line.split(" "))) == {("plain", name) for name in names}


@pytest.mark.parametrize("line", ["run x", "spectrum x", "run m.yaml --record x"])
def test_files_are_completed_by_the_shell(line):
    assert completions(*line.split()) == [("file", "x")]


def test_completion_imports_only_click():
    """bash, zsh and fish request completions in a single process. fish passes the word, the other
    shells pass its position."""
    code = (
        "import os, sys\nfrom tdint_cli.main import main\n"
        "for shell, word in (('bash', '1'), ('zsh', '1'), ('fish', 's')):\n"
        "    os.environ |= {'_TDINT_COMPLETE': f'{shell}_complete', 'COMP_WORDS': 'tdint s', "
        "'COMP_CWORD': word}\n"
        "    try:\n        main()\n"
        "    except SystemExit:\n        print('asked by', shell)\n"
        "    print([n for n in ('numpy', 'numba', 'obspy', 'yaml') if n in sys.modules], "
        "file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.splitlines() == ["[]"] * 3
    *lists, remaining = re.split("asked by .*\n", done.stdout)
    assert (
        remaining == ""
        and [all(name in names for name in ("spectrum", "stability")) for names in lists]
        == [True] * 3
    )


def test_the_bash_script_enables_completion():
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    script = 'eval "$(_TDINT_COMPLETE=bash_source tdint)"; complete -p tdint'
    done = subprocess.run(
        ["bash", "-c", script], env={**os.environ, "PATH": path}, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(" tdint\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_a_full_disk_is_reported_with_exit_code_6(monkeypatch):
    command = [sys.executable, "-c", "from tdint_cli.main import main; main()"]
    with Path("/dev/full").open("w") as full:
        environment = os.environ | {"_TDINT_COMPLETE": "bash_source"}
        done = subprocess.run(
            command, env=environment, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert (done.returncode, "standard output: cannot be written" in done.stderr) == (6, True)
