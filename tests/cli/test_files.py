"""Files of all commands: none that a command did not write is replaced without --overwrite, none is waited for."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import Result

from tdint.analysis.chart.reference import _load
from tdint.kernels.building.store import _look_up_in, file_name
from tdint.kernels.building.target import native
from tdint.system import locked
from tdint_cli.main import cli
from tdint_cli.options.values import FileName

Run = Callable[..., Result]

UNITS = ("--units", "m/s^2")
MOTION = ("motion.mseed", *UNITS, "--component", "HNE")
CONFIGS = Path(__file__).parents[2] / "configs"
GOES_ON = {"campaign", "ida", "runs", "merge"}
"""Commands that go on with what they wrote, where others refuse it."""

WRITING: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "init": (("init", "new.yaml", "--period", "0.5"), ("new.yaml",)),
    "run": (
        ("run", "shaken.yaml", *MOTION, "-o", "out", "--history", "--plot", "--floor-spectra", "roof"),
        ("out/stories.csv", "out/summary.json", "out/history.csv", "out/response.png", "out/floor-spectra.csv"),
    ),
    "histories": (
        ("run", "shaken.yaml", *MOTION, "--history=h.csv.gz", "--plot=p.svg"),
        ("h.csv.gz", "p.svg"),
    ),
    "runs": (
        ("run", "shaken.yaml", *MOTION, "--scale", "0.5,1", "-o", "out"),
        ("out/runs.csv", "out/summary.json"),
    ),
    "modes": (("modes", "shaken.yaml", "-o", "new/m.csv"), ("new/m.csv",)),
    "law": (("law", "shaken.yaml", "--drift", "0.02", "-o", "l.csv", "--plot"), ("l.csv", "l.png")),
    "pushover": (("pushover", "shaken.yaml", "-o", "p.csv", "--plot"), ("p.csv", "p.png")),
    "compare": (
        ("compare", "shaken.yaml", "--recorded", "recorded.yaml", "-o", "out", "--plot"),
        ("out/comparison.csv", "out/spectra.csv", "out/summary.json", "out/comparison.png"),
    ),
    "inventory": (
        ("inventory", "town.csv", "--units", "ft", "-o", "models.csv", "--models", "models"),
        ("models.csv", "models/house.yaml"),
    ),
    "info": (("info", *MOTION, "-o", "i.csv", "--plot"), ("i.csv", "i.png")),
    "spectrum": (
        ("spectrum", *MOTION, "--period", "0.2,1", "-o", "s.csv", "--plot=other.pdf"),
        ("s.csv", "other.pdf"),
    ),
    "drift-spectrum": (
        ("drift-spectrum", *MOTION, "--period", "0.2,1", "-o", "d.csv", "--plot"),
        ("d.csv", "d.png"),
    ),
    "campaign": (("campaign", "study.yaml", "-o", "out"), ("out/runs.csv", "out/stories.csv", "out/summary.json")),
    "merge": (
        ("campaign", "merge", "part", "-o", "out"),
        ("out/runs.csv", "out/stories.csv", "out/summary.json"),
    ),
    "scale": (
        ("scale", "motion.mseed", *UNITS, "--pga", "0.4g", "-o", "f.csv", "--plot"),
        ("f.csv", "f.json", "f.png"),
    ),
    "ida": (
        ("ida", "shaken.yaml", *MOTION, "--precision", "40%", "-o", "out", "--plot"),
        ("out/ida.csv", "out/capacities.csv", "out/ida.json", "out/ida.png"),
    ),
    "sensitivity": (
        ("sensitivity", "shaken.yaml", *MOTION, "--vary", "mass_factor=0.9:1.1", "-o", "s.csv", "--plot"),
        ("s.csv", "s.png"),
    ),
    "fragility": (("fragility", "stripes.csv", "-o", "f.csv", "--plot"), ("f.csv", "f.png")),
    "stability": (
        ("stability", "--method", "wilson", "--dt-over-t", "0.1:1:3", "-o", "s.csv", "--plot"),
        ("s.csv", "s.png"),
    ),
    "overshoot": (("overshoot", "--method", "wilson", "-o", "s.csv", "--plot"), ("s.csv", "s.png")),
    "order": (
        ("order", "--method", "newmark-average", "--load", "free", "-o", "o.csv", "--plot"),
        ("o.csv", "o.png"),
    ),
    "failures": (
        ("failures", "--problem", "stiff-node", "--method", "newmark-average", "-o", "f.csv", "--plot"),
        ("f.csv", "f.png"),
    ),
    "examples": (
        ("examples", "1", "--method", "newmark-average", "-o", "out"),
        ("out/example-1-errors.csv", "out/figure-07.png"),
    ),
    "chart": (
        ("chart", "shaken.yaml", "--method", "newmark-average", "--repeat", "1", "-o", "c.csv", "--plot"),
        ("c.csv", "c.png", "c.json"),
    ),
    "validate": (("validate", "-o", "v.csv"), ("v.csv",)),
}
"""Of each command that writes a call, and the files that come of it."""


@pytest.fixture
def study(folder: Path) -> Path:
    """The folder with what all calls read."""
    (folder / "study.yaml").write_text(
        "buildings: {models: [shaken.yaml]}\nrecords: {files: [other.mseed], units: m/s^2}\noutputs: {stories: true}\n"
    )
    (folder / "town.csv").write_text(
        "id,NumberOfStories,YearBuilt,StructureType,PlanArea\nhouse,1,1975,W1,1500\nshop,2,1950,URM,900\n"
    )
    (folder / "stripes.csv").write_text("im,collapses,records\n0.2,1,40\n0.6,4,40\n0.8,13,40\n1,16,40\n")
    (folder / "recorded.yaml").write_text(
        "base: {file: motion.mseed, component: HNE, units: m/s^2}\n"
        "floors: {2: {file: motion.mseed, component: HNN, units: m/s^2}}\n"
    )
    return folder


def files_in(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".campaign") and ".sqlite" not in path.name
    }


def writing_commands() -> set[str]:
    """Commands that have an output, a picture or a file to write among their options."""
    context = click.Context(cli)
    commands = {name: cli.get_command(context, name) for name in cli.list_commands(context)}
    wanted = {"output", "plot", "overwrite"}
    return {name for name, command in commands.items() if command and wanted & {one.name for one in command.params}}


def test_every_command_that_writes_is_here() -> None:
    """But for `compile`, whose files are named by a hash of what is in them."""
    assert writing_commands() - {"compile"} == {arguments[0] for arguments, _ in WRITING.values()}


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize("name", WRITING)
def test_what_a_command_did_not_write_it_does_not_replace(study: Path, tdint: Run, name: str) -> None:
    arguments, files = WRITING[name]
    if name == "merge":
        assert tdint("campaign", "study.yaml", "-o", "part").exit_code == 0
    before = files_in(study)
    for file in files:
        mine = study / file
        mine.parent.mkdir(exist_ok=True)
        mine.write_bytes(b"mine")
        result = tdint(*arguments)
        assert (result.exit_code, f"{file}: exists already" in result.stderr) == (6, True), result.output
        assert files_in(study) == before | {file: b"mine"}
        mine.unlink()
    first = tdint(*arguments)
    assert first.exit_code == 0, first.output
    written = {file: data for file, data in files_in(study).items() if file not in before}
    assert set(files) <= set(written)
    again = tdint(*arguments)
    assert again.exit_code == (0 if name in GOES_ON else 6), again.output
    assert files_in(study) == before | written
    for file in written:
        (study / file).write_bytes(b"mine")
        result = tdint(*arguments)
        assert (result.exit_code, (study / file).read_bytes()) == (6, b"mine"), (file, result.output)
        (study / file).write_bytes(written[file])
    (study / files[0]).write_bytes(b"mine")
    assert tdint(*arguments, "--overwrite").exit_code == 0
    assert (study / files[0]).read_bytes() != b"mine"


READING: dict[str, tuple[tuple[str, ...], int]] = {
    "init": (("init", "FIFO", "--overwrite"), 6),
    "check": (("check", "FIFO"), 3),
    "model": (("run", "FIFO"), 3),
    "record": (("run", "shaken.yaml", "FIFO"), 4),
    "record of a model": (("run", "piped.yaml"), 4),
    "response of an instrument": (("info", "motion.mseed", "--inventory", "FIFO"), 4),
    "history": (("run", "shaken.yaml", *MOTION, "--history=FIFO.csv", "--overwrite"), 6),
    "picture": (("info", *MOTION, "--plot=FIFO.png", "--overwrite"), 6),
    "factors": (("run", "shaken.yaml", "motion.mseed", *UNITS, "--factors", "FIFO"), 3),
    "path": (("law", "shaken.yaml", "--path", "FIFO"), 2),
    "recordings": (("compare", "shaken.yaml", "--recorded", "FIFO", "-o", "out"), 3),
    "table": (("modes", "shaken.yaml", "-o", "FIFO", "--overwrite"), 6),
    "inventory": (("inventory", "FIFO", "--units", "ft"), 3),
    "models": (("inventory", "town.csv", "--units", "ft", "--models", "FIFO", "--overwrite"), 6),
    "target": (("scale", "motion.mseed", *UNITS, "--target", "FIFO"), 3),
    "spectrum": (("spectrum", *MOTION, "--against", "FIFO"), 4),
    "target of a spectrum": (("spectrum", *MOTION, "--target", "FIFO", "--plot=s.png"), 3),
    "drift-spectrum": (("drift-spectrum", "FIFO", *UNITS), 4),
    "campaign": (("campaign", "FIFO", "-o", "out"), 3),
    "status": (("campaign", "status", "FIFO"), 2),
    "merge": (("campaign", "merge", "FIFO", "-o", "out"), 2),
    "folder": (("campaign", "study.yaml", "-o", "FIFO"), 6),
    "certificate": (("campaign", "study.yaml", "-o", "out", "--dask", "tls://far.example:8786", "--tls-ca", "FIFO",
                     "--tls-cert", "FIFO", "--tls-key", "FIFO"), 2),
    "ida": (("ida", "shaken.yaml", "FIFO", *UNITS), 4),
    "fragility": (("fragility", "FIFO"), 3),
    "chart": (("chart", "FIFO"), 3),
    "overshoot": (("overshoot", "-o", "FIFO", "--overwrite"), 6),
    "stability": (("stability", "-o", "FIFO", "--overwrite"), 6),
    "order": (("order", "-o", "FIFO", "--overwrite"), 6),
    "failures": (("failures", "-o", "FIFO", "--overwrite"), 6),
    "examples": (("examples", "1", "-o", "FIFO", "--overwrite"), 6),
    "validate": (("validate", "-o", "FIFO", "--overwrite"), 6),
    "compile": (("compile", "FIFO"), 3),
    "sensitivity": (("sensitivity", "FIFO", *MOTION, "--vary", "mass_factor=0.9:1.1"), 3),
    "plug-in": (("methods", "--plugin", "FIFO.py"), 2),
}  # fmt: skip
"""Calls with a named pipe in the place of a file, and how they end."""


def takes_files(name: str) -> bool:
    command = cli.get_command(click.Context(cli), name)
    return any(isinstance(one.type, FileName) for one in command.params) if command else False


def test_every_command_that_takes_files_is_here() -> None:
    assert {name for name in cli.list_commands(click.Context(cli)) if takes_files(name)} <= {
        arguments[0] for arguments, _ in READING.values()
    } | {"pushover"}  # whose model is read as that of modes


@contextmanager
def not_longer_than(seconds: float) -> Iterator[None]:
    """Raise TimeoutError in what waits for longer."""

    def too_long(*_: Any) -> None:
        raise TimeoutError(f"waited for {seconds} s")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
@pytest.mark.parametrize("name", READING)
def test_a_named_pipe_is_not_waited_for(study: Path, tdint: Run, name: str) -> None:
    arguments, code = READING[name]
    (study / "piped.yaml").write_text((study / "shaken.yaml").read_text().replace("motion.mseed", "FIFO"))
    for pipe in {word.rpartition("=")[2] for word in arguments if "FIFO" in word} | {"FIFO"}:
        os.mkfifo(study / pipe)
    with not_longer_than(60.0):
        result = tdint(*arguments)
    assert (result.exit_code, len(result.stderr.splitlines())) == (code, 1), result.output
    assert "FIFO" in result.stderr


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
@pytest.mark.parametrize("place", ["object", "lock", "reference"])
def test_a_named_pipe_in_the_cache_is_not_waited_for(
    study: Path, tdint: Run, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    pipe = study / "pipe"
    os.mkfifo(pipe)
    with not_longer_than(60.0):
        if place == "lock":
            with locked(pipe, lambda: None):
                pass
        elif place == "reference":
            assert _load(pipe, None, 1) is None  # type: ignore[arg-type]
        else:
            target = native()
            shutil.move(pipe, study / file_name("a:b", "v", target))
            assert _look_up_in(study, False, "a:b", "v", (target,)) is None
