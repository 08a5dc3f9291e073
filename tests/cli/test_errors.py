"""Errors are written as lines to standard error and determine the exit code."""

import math
import os
import subprocess
import sys
import warnings
from pathlib import Path

import click
import pytest

from cli.conftest import STUDY, Command
from tdint import errors
from tdint_cli.main import LazyGroup
from tdint_cli.options import grammar
from tdint_cli.terminal import Failures, Settings, exit_code_of


def raises(error: BaseException):
    def command():
        raise error

    return command


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (errors.UsageError("no"), 2, "Error: no\n"),
        (errors.ModelError("a.yaml: no"), 3, "Error: a.yaml: no\n"),
        (errors.RecordError("no"), 4, "Error: no\n"),
        (errors.AnalysisError("no"), 5, "Error: no\n"),
        (errors.OutputError("no"), 6, "Error: no\n"),
        (Failures([errors.AnalysisError("one"), errors.RecordError("two")]), 4,
         "Error: one\nError: two\n"),
        (errors.ModelError([errors.ModelFault("a.yaml", i, 1, "k", "bad") for i in (1, 2)]), 3,
         "Error: a.yaml:1:1: k: bad\nError: a.yaml:2:1: k: bad\n"),
        (KeyError("x"), 1,
         "Error: internal error (a bug): KeyError: 'x'; run again with --debug\n"),
        (RuntimeError("two\nlines"), 1,
         "Error: internal error (a bug): RuntimeError: two lines; run again"),
        (MemoryError(), 5, "Error: not enough memory; use a smaller model or record"),
        (KeyboardInterrupt(), 130, "Interrupted\n"),
        (click.Abort(), 130, "Interrupted\n"),
        (click.UsageError("no"), 2, "Error: no\n"),
    ],
)  # fmt: skip
def test_an_error_is_a_line_and_an_exit_code(capsys, error, code, text):
    assert exit_code_of(raises(error), Settings()) == code
    captured = capsys.readouterr()
    assert captured.err.startswith(text)
    assert captured.out == ""
    assert "Traceback" not in captured.err


def test_messages_of_the_library_name_options_of_the_command(tdint, folder):
    """A message names an option of the command, or a key of the model or campaign file if the input
    is a key."""
    (folder / "motion.csv").write_text("0 0\n0.01 1\n0.02 3\n")
    (folder / "campaign.yaml").write_text(
        "buildings: {models: [frame.yaml]}\nrecords: {files: [motion.csv]}\n"
    )
    (folder / "frame.yaml").write_text("stories: [{mass: 1, height: 3, stiffness: 1}]\n")
    (folder / "feet.yaml").write_text(
        "units: {length: ft, force: kip}\n" + (folder / "frame.yaml").read_text()
    )
    (folder / "empty.yaml").write_text("name: none\n")
    for line, code, message in (
        ("info motion.csv", 4, "--units g, cm/s^2 or m/s^2"),
        ("campaign campaign.yaml -o out", 4, "`units: g`, cm/s^2 or m/s^2"),
        ("run feet.yaml motion.csv", 3, "add mass to `units` ("),
        ("campaign empty.yaml -o out", 3, "buildings: is missing; give `models` or an `inventory`"),
    ):
        assert message in tdint(*line.split(), code=code).stderr


@pytest.mark.parametrize(("damping", "has_hint"), [("5", True), ("500", False)])
def test_a_percentage_is_proposed_only_if_it_is_valid(tdint, damping, has_hint):
    result = tdint("spectrum", "motion.mseed", "--damping", damping, code=2)
    assert (f"did you mean {damping}%?" in result.stderr) == has_hint


def test_debug_adds_the_traceback(capsys):
    assert exit_code_of(raises(errors.RecordError("no")), Settings(debug=True)) == 4
    text = capsys.readouterr().err
    assert text.startswith("Traceback")
    assert text.endswith("Error: no\n")


@pytest.mark.parametrize("arguments", [["--debug", "broken"], ["broken", "--debug"], ["broken"]])
def test_debug_before_or_after_the_command(tdint, monkeypatch, arguments):
    @click.command("broken", cls=grammar.Command)
    def broken():
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(LazyGroup, "get_command", lambda *_: broken)
    monkeypatch.setattr(LazyGroup, "resolve_command", click.Group.resolve_command)
    result = tdint(*arguments, code=1)
    assert ("Traceback" in result.stderr) == ("--debug" in arguments)
    assert "internal error (a bug): ZeroDivisionError: a bug" in result.stderr


def test_warnings_are_lines(capsys):
    def command():
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn("mind\nthe gap", UserWarning, stacklevel=1)

    assert exit_code_of(command, Settings()) == 0
    assert capsys.readouterr().err == "Warning: mind the gap\n"


@pytest.mark.parametrize(("returned", "code"), [(7, 7), (None, 0)])
def test_an_exit_code_is_returned(returned, code):
    assert exit_code_of(lambda: returned, Settings()) == code


LONG = 300 * "a"  # characters; file systems allow names of at most 255 bytes


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["campaign", "status", LONG], 2), (["campaign", "export", LONG], 2),
     (["campaign", "merge", LONG, "-o", "x"], 2), (["campaign", "campaign.yaml", "-o", LONG], 6),
     (["fragility", LONG, "-o", "x.csv"], 3), (["sensitivity", LONG], 2),
     (["run", "shaken.yaml", "--plugin", f"{LONG}.py"], 2), (["check", LONG], 3),
     (["check", "/proc/self/mem"], 3)],
    ids=lambda value: " ".join(value[:2])[:20] if isinstance(value, list) else "",
)  # fmt: skip
def test_invalid_file_names_are_reported_in_one_line(folder, tdint, arguments, code):
    """The error is a line without a traceback. /proc/self/mem exists, but cannot be read."""
    (folder / "campaign.yaml").write_text(STUDY)
    messages = tdint(*arguments, code=code).stderr
    assert "internal error" not in messages
    assert messages.splitlines()[-1].startswith("Error: ")


@pytest.mark.usefixtures("short_matching")
def test_the_mean_of_one_ground_motion_has_no_scatter(folder, tdint):
    """The message contains no scatter, and no numpy warning occurs."""
    arguments = ["--units", "m/s^2", "--component", "HNE", "--range", "0.1:1", "-o", "matched"]
    target = ["--target", "ec8:type=1,soil=B,ag=0.25g", "--suite", "mean"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        messages = tdint("match", "motion.mseed", *arguments, *target, code=0).stderr
    assert "mean spectrum of 1 ground motion" in messages
    # The displacement of the record ends at its peak, also after matching.
    assert "note: motion.mseed HNE: the displacement at the end is" in messages
    assert "Warning: motion.mseed HNE, matched: the displacement at the end is" in messages
    assert "scatter" not in messages


def test_the_command_runs_without_a_thread_for_signals(folder):
    """The system refuses new threads, as with `ulimit -u`."""
    program = (
        "import sys, threading\n"
        'def refused(*_): raise RuntimeError("can\'t start new thread")\n'
        "threading._start_new_thread = refused\n"
        "from tdint_cli.main import main\n"
        "sys.argv = ['tdint', 'modes', 'forced.yaml', '-q']\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout.startswith("mode,")


def test_a_key_in_the_wrong_section_and_a_missing_percent_sign_have_a_remedy(
    folder: Path, tdint: Command
) -> None:
    Path("wrong.yaml").write_text(
        "stories: [{mass: 1, stiffness: 1}]\ndamping: 5\nrecord: motion.mseed\ndt: 0.01\n"
    )
    lines = tdint("check", "wrong.yaml", code=3).stderr.splitlines()
    assert lines[0].startswith("Error: wrong.yaml:2:10: damping: ")
    assert lines[0].endswith("; did you mean 5%?")
    assert lines[1].endswith("belongs to `excitation`: write `excitation: {record: ...}`")
    assert lines[2].endswith("belongs to `analysis`: write `analysis: {dt: ...}`")


def test_a_run_without_ground_motion_reports_that_it_is_missing(
    folder: Path, tdint: Command
) -> None:
    """With a force on a floor, the time step is missing instead."""
    text = "name: x\nstories: [{mass: 1000, stiffness: 1.0e+6}]\n"
    Path("still.yaml").write_text(text)
    assert "x: the ground motion is missing" in tdint("run", "still.yaml", code=2).stderr
    force = "excitation: {forces: [{floor: 1, amplitude: 1, omega: 2}]}\n"
    Path("forced.yaml").write_text(text + force)
    assert "the time step is required" in tdint("run", "forced.yaml", code=2).stderr


def test_a_wrong_unit_is_reported_before_a_smaller_step_is_recommended(
    folder: Path, tdint: Command
) -> None:
    """Samples in mm/s^2 are declared as m/s^2, and the time step is too long. The message about the
    unit is first."""
    text = (
        "stories: [{repeat: 2, mass: 1.0e+5, height: 3, stiffness: 1.0e+8}]\ndamping: 5%\n"
        "analysis: {method: newmark-average, dt: 0.05}\n"
    )
    Path("stiff.yaml").write_text(text)
    samples = [f"{900 * math.sin(0.3 * k):.4f}" for k in range(400)]
    Path("mm.txt").write_text("# dt = 0.05 s, units = m/s^2\n" + "\n".join(samples) + "\n")
    messages = tdint("run", "stiff.yaml", "mm.txt").stderr
    unit, smaller = messages.index("check the units and the scale"), messages.index("use a smaller")
    assert unit < messages.index("newmark-average: ") and unit < smaller


def test_the_backend_of_a_notebook_is_named(tmp_path):
    """A notebook sets a backend that need not be installed in the environment of tdint."""
    model = Path(__file__).parents[2] / "configs" / "hardening.yaml"
    ended = subprocess.run(
        [sys.executable, "-m", "tdint_cli", "run", model, "-o", tmp_path, "--plot"],
        env={**os.environ, "MPLBACKEND": "not-installed"},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == errors.UsageError.exit_code
    assert "unset the environment variable MPLBACKEND" in ended.stderr
    assert list(tmp_path.iterdir()) == []
