"""Small models and records, and functions that run the command in this process."""

import functools
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from facts import states
from separate_streams import runner
from tdint.ground_motion.messages import quiet_import
from tdint_cli import terminal
from tdint_cli.main import cli
from tdint_cli.terminal import BUG

FORCED = """\
    name: forced
    stories:
      - {mass: 10, height: 3, stiffness: 800, dashpot: 5}
      - {mass: 8, height: 3, stiffness: 600, dashpot: 4}
    excitation:
      forces: [{floor: 2, amplitude: 5, omega: 6}]
    analysis: {method: impulse4, dt: 0.02, duration: 2}
"""
SHAKEN = """\
    name: shaken
    stories:
      - {repeat: 2, mass: 10, height: 3, stiffness: 8000, law: {type: bilinear, yield_force: 50, hardening: 0.1}}
    damping: {rayleigh: {ratio: 0.05, modes: [1, 2]}}
    excitation: {record: {file: motion.mseed, component: HNE}}
    analysis: {method: newmark-average}
"""  # noqa: E501
WITHOUT_LAW = (", law: {type: bilinear, yield_force: 50, hardening: 0.1}", "")
"""Change of shaken.yaml to a linear building, whose report has no pushover. The pushover takes most
of the time of a report."""
STUDY = """\
buildings: {models: [shaken.yaml]}
records: {files: [motion.mseed, other.mseed], units: m/s^2}
intensity: {scales: [0.5, 1]}
analysis: {method: newmark-average}
"""


@pytest.fixture
def working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change to an empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def folder(working_directory: Path) -> Path:
    """Change to a working directory with the models forced.yaml and shaken.yaml and the records
    motion.mseed and other.mseed."""
    return write_folder(working_directory)


def write_folder(folder: Path) -> Path:
    """Write the files of `folder`."""
    (folder / "forced.yaml").write_text(dedent(FORCED), encoding="utf-8")
    (folder / "shaken.yaml").write_text(dedent(SHAKEN), encoding="utf-8")
    write_record(folder / "motion.mseed", "HNE", "HNN")
    write_record(folder / "other.mseed", "HNE", peak=1.0)
    return folder


def write_record(file: str | Path, *channels: str, **shape: Any) -> None:
    """Write a decaying sine as MiniSEED."""
    Path(file).write_bytes(decaying_sine(*channels, **shape))


@functools.cache
def decaying_sine(
    *channels: str,
    peak: float = 3.0,
    samples: int = 300,
    integer: bool = False,
    frequency: float = 9.0,
) -> bytes:
    """Return a record as MiniSEED, FLOAT64 in m/s^2 or INT32 counts, sampled at 0.01 s. Records of
    different frequencies (rad/s) are different motions, not copies."""
    with quiet_import():
        from obspy import Stream, Trace

    t = np.arange(samples) * 0.01
    wave = np.sin(frequency * t) * np.exp(-t)
    wave = peak * (wave - wave.mean())
    data = (1000.0 * wave).astype(np.int32) if integer else wave
    header: dict[str, Any] = {"network": "TD", "station": "TEST", "delta": 0.01}
    traces = [
        Trace(data * (i + 1), {**header, "channel": channel}) for i, channel in enumerate(channels)
    ]
    stream = io.BytesIO()
    Stream(traces).write(stream, format="MSEED")
    return stream.getvalue()


def made_once(folders: pytest.TempPathFactory, make: Callable[[Path], None]) -> Path:
    """Return a directory for a fixture of a complete test file; `make` fills it, as the working
    directory."""
    folder = folders.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        make(folder)
    return folder


def check_parquet(file: str, table: list[dict[str, str]]) -> Any:
    """Check that the rows of a Parquet file equal a table that was read from CSV, to the digits of
    CSV; return the Parquet table."""
    found = pytest.importorskip("pyarrow.parquet").read_table(file)
    assert found.column_names == list(table[0])
    for parquet_row, csv_row in zip(found.to_pylist(), table, strict=True):
        for name, cell in parquet_row.items():
            if isinstance(cell, float) and not np.isnan(cell):
                assert float(csv_row[name]) == pytest.approx(cell, rel=1e-11, abs=0.0)
            else:
                assert ("" if cell is None or cell != cell else str(cell)).lower() == csv_row[
                    name
                ].lower()
    return found


def copy_of(made: str) -> Any:
    """Create a fixture that changes to a copy of the directory of the module fixture `made`."""

    @pytest.fixture
    def copy(request: pytest.FixtureRequest, working_directory: Path) -> Path:
        return Path(
            shutil.copytree(request.getfixturevalue(made), working_directory, dirs_exist_ok=True)
        )

    return copy


def change(file: str | Path, *changes: tuple[str, str]) -> None:
    """Replace texts in a file; the file must contain each text."""
    text = Path(file).read_text()
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    Path(file).write_text(text)


_missing_resource = terminal._missing_resource


def note_bug(bugs: list[BaseException], error: BaseException | None, options: Any) -> str:
    """Add an error to `bugs` unless it reports a missing resource; return the message of the
    resource."""
    if error is not None and not (message := _missing_resource(error, options)):
        bugs.append(error)
        return ""
    return message


class Command:
    """Run `tdint ARGUMENTS` in this process. The result has exit_code, stdout and stderr. Messages
    about the compilation of kernels are removed, because they depend on the cache
    (tests/kernels/test_compiling.py tests them)."""

    def __call__(
        self,
        line: object = "",
        *arguments: object,
        stdin: bytes | None = None,
        code: int | None = None,
    ) -> Result:
        """Run the command and return its result. The words of `line` are the first arguments;
        `code` is the required exit code. An internal error that `code` does not require is raised,
        so that the test shows its traceback."""
        texts = [*str(line).split(), *map(str, arguments)]
        bugs: list[BaseException] = []
        with pytest.MonkeyPatch.context() as patch:
            # The last test of an error before it is reported as internal
            patch.setattr(terminal, "_missing_resource", partial(note_bug, bugs))
            result = runner().invoke(cli, texts, input=stdin, prog_name="tdint")
        if result.exit_code == BUG != code and bugs:
            raise AssertionError(result.stderr) from bugs[-1]
        result.stderr_bytes = re.sub(rb"(?m)^note: compiling .*\n", b"", result.stderr_bytes or b"")
        assert code is None or result.exit_code == code, result.stderr
        return result

    def refused(
        self, message: str, *arguments: object, stdin: bytes | None = None, code: int = 2
    ) -> Result:
        """Check an invalid call: facts of its message (see `facts.states`), exit code, empty
        standard output, and no new file or directory."""
        before = {*Path().iterdir(), *map(Path, ("__pycache__", ".hypothesis", ".pytest_cache"))}
        result = self(*arguments, stdin=stdin, code=code)
        assert result.stdout == ""
        assert before.issuperset(Path().iterdir())
        assert states(result.stderr, message), result.stderr
        return result


@pytest.fixture
def tdint() -> Command:
    """Return the function `tdint(*ARGUMENTS)`, which runs the command."""
    return Command()


def at_a_terminal(line: str, to_terminal: bool = True) -> tuple[bytes, int]:
    """Run `tdint LINE` in a separate process with a terminal as standard error (and optionally
    standard output); return its output and exit code."""
    import pty

    terminal_end, process_end = pty.openpty()
    command = [sys.executable, "-c", "from tdint_cli.main import main; main()", *line.split()]
    process = subprocess.Popen(
        command, stdout=process_end if to_terminal else subprocess.DEVNULL, stderr=process_end
    )
    os.close(process_end)
    shown = b""
    with suppress(OSError):  # The end of a terminal is an error on Linux.
        while piece := os.read(terminal_end, 65536):
            shown += piece
    os.close(terminal_end)
    return shown, process.wait(timeout=60.0)


@pytest.fixture
def drawn() -> None:
    """Render figures completely, for tests of file formats and of figures that are difficult to
    render."""


@pytest.fixture(autouse=True)
def _pictures(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, not_laid_out: None
) -> None:
    """Replace the rendering of figures, unless a test uses `drawn` or `laid_out`: files contain
    only the signature of their format and the texts of the figure. tests/output/test_plots.py
    renders all types of figures."""
    if not {"drawn", "laid_out"} & set(request.fixturenames):
        from matplotlib.axis import Axis
        from matplotlib.figure import Figure

        import legible

        monkeypatch.setattr(Figure, "savefig", legible.write_texts)
        monkeypatch.setattr(Axis, "get_children", legible.children_without_ticks)


@pytest.fixture
def make_record() -> Callable[..., None]:
    """Return `write_record`, for additional records."""
    return write_record
