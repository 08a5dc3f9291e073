"""Directory with small valid and unusual models and records, in which `tdint` is executed in this
process."""

import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from click.testing import Result

from fuzz import printed
from fuzz.study_files import FILES
from ground_motion.files import counts, trace, wave, write
from separate_streams import runner
from tdint_cli.main import cli

MODELS = {
    "linear.yaml": """\
name: linear
stories: [{repeat: 2, mass: 10, height: 3, stiffness: 8000}]
damping: {rayleigh: {ratio: 0.05, modes: [1, 2]}}
excitation: {record: {file: a.txt, units: m/s^2}}
analysis: {method: newmark-average, duration: 0.3}
""",
    "bilinear.yaml": """\
name: bilinear
units: {length: cm, force: kN, mass: t}
stories:
  - {mass: 10, height: 300, stiffness: 8, law: {type: bilinear, yield_force: 5, hardening: 0.1}, dashpot: 0.01}
  - {repeat: 2, mass: 8, height: 300, stiffness: 8, law: {type: bilinear, yield_force: 4, hardening: 0.1}}
damping: {rayleigh: {mass: 0.1, stiffness: 0.001}}
p_delta: true
excitation: {record: {file: n.mseed, units: m/s^2, component: HNE, scale: 2, baseline: constant}}
analysis: {method: impulse4, dt: 0.01, duration: 0.3}
collapse_drift: 0.05
""",  # noqa: E501
    "forced.yaml": """\
stories: [{mass: 10, stiffness: 800, dashpot: 5}, {mass: 8, stiffness: 600}]
excitation: {forces: [{floor: 2, amplitude: 5, omega: 6, phase: sin}]}
initial: {displacement: [0.1, 0], velocity: [0, 1]}
analysis: {method: newmark-average, dt: 0.02, duration: 0.3}
""",
    "modal.yaml": """\
stories: [{repeat: 3, mass: 10, height: 3, stiffness: 8000}]
damping: {modal: [0.05, 0.02]}
excitation: {record: {file: table.csv, column: 3, step: 0.01, skip_lines: 1}}
analysis: {method: exact, duration: 0.3}
""",
    "limited.yaml": """\
stories:
  - {mass: 10, stiffness: 800, dashpot: 5, isolator: true}
  - {repeat: 2, mass: 10, height: 3, stiffness: 8000}
excitation: {record: {file: a.txt, units: m/s^2}}
analysis: {method: newmark-average, duration: 0.3}
limits: {drift_ratio: 0.5%, isolator_displacement: 2 mm, floor_acceleration: 0.1 g}
""",
}
COMPOSITE_MODELS = {
    "elements.yaml": """\
name: elements
stories:
  - mass: 10
    height: 3
    elements:
      - {name: frame, type: bilinear, stiffness: 5000, yield_force: 20, hardening: 0.05, fracture_drift: 2%}
      - {name: rods, type: multilinear, rule: peak, backbone: [[0.01, 30]], pinching: {drift: 1, force: 0}, angle: 30}
    dashpot: {coefficient: 5, brace: 1e4, relief: {force: 3, ratio: 0.1}}
  - mass: 8
    height: 3
    stiffness: 6000
    law: {type: steel, yield_force: 20, hardening: 0.02}
    dashpot: {coefficient: 5, exponent: 0.4, linear_below: 0.001}
damping: {rayleigh: {ratio: 0.05, modes: [1, 2]}}
excitation: {record: {file: a.txt, units: m/s^2}}
analysis: {method: impulse4, duration: 0.3}
""",  # noqa: E501
    "devices.yaml": """\
name: devices
stories:
  - {repeat: 3, mass: 10, height: 3, stiffness: 8000, law: {type: bilinear, yield_force: 20, hardening: 0.1}}
damping: 5%
attachments: [{name: tank, floor: 2, mass: 1, stiffness: 200, dashpot: 1}]
links:
  - {name: tie, from: tank, to: 3, stiffness: 100}
  - {name: damper, from: ground, to: 2, dashpot: 5}
excitation: {record: {file: a.txt, units: m/s^2}}
analysis: {method: impulse4, duration: 0.3}
""",  # noqa: E501
    "matrices.yaml": """\
name: matrices
matrices: {stiffness: [[16000, -8000], [-8000, 8000]], mass: [10, 8], damping: [[2, -1], [-1, 1]]}
excitation: {record: {file: a.txt, units: m/s^2}}
analysis: {method: exact, duration: 0.3}
""",
    "wall.yaml": """\
name: wall
stories: [{repeat: 3, mass: 10, height: 3, flexural: {EI: 1e6, GA: 1e5}}]
base: {rotation: 1e6}
damping: {modal: 4%}
excitation: {record: {file: a.txt, units: m/s^2}}
analysis: {method: exact, duration: 0.3}
""",
}
"""Models of several elements, devices, matrices and flexural stories, for command lines only."""

BUILDINGS = "id,NumberOfStories,YearBuilt,StructureType,PlanArea\nschool,3,1985,C1,600\nshop,2,1970,S1,400\n"  # noqa: E501
STRANGE_NAMES = (
    "=cmd().txt", "esc\x1b[31m.txt", "two\nlines.txt", "-dash.txt", "\u202e.txt",
    "caf\udce9.txt", "inf.txt",
)  # fmt: skip
"""Names of sound records that a table or a terminal must not be given as they are."""

OUTPUT, OLD = "out", "old.csv"
"""The folder of a command's outputs, empty at its start but for this file."""

_MARK = "made"


@contextmanager
def sandbox() -> Iterator[Path]:
    """Provide a new working directory with the files above, which is removed afterwards."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _fill(folder)
        os.chdir(folder)
        try:
            yield folder
        finally:
            os.chdir(before)


@contextmanager
def replaced(name: str, content: bytes) -> Iterator[None]:
    """Replace a file of the working directory by other content within a `with` block."""
    file = Path(name)
    before, times = file.read_bytes(), file.stat()
    stamp = (
        times.st_atime_ns,
        times.st_mtime_ns,
    )  # The time of the sandbox, because otherwise the files would be written again.
    file.write_bytes(content)
    os.utime(file, ns=stamp)
    try:
        yield
    finally:
        file.write_bytes(before)
        os.utime(file, ns=stamp)


def _changed(folder: Path) -> bool:
    """Return True if a case has overwritten files of the sandbox, which an output option may
    cause."""
    mark = folder / _MARK
    return any(
        file.stat().st_mtime_ns > mark.stat().st_mtime_ns
        for file in folder.iterdir()
        if file.is_file()
    )


def _fill(folder: Path) -> None:
    for name, text in (MODELS | COMPOSITE_MODELS).items():
        (folder / name).write_text(text)
    (folder / "buildings.csv").write_text(BUILDINGS)
    for name, text in FILES.items():
        (folder / name).write_text(text)
    samples = wave(60)
    rows = "\n".join(f"{value:.6f}" for value in samples)
    table = f"# dt = 0.01 s, units = m/s^2\n{rows}\n"
    for name in ("a.txt", *STRANGE_NAMES):
        (folder / name).write_text(table)
    lines = [f"{0.01 * i:.2f},{v:.5f},{2 * v:.5f}" for i, v in enumerate(samples)]
    (folder / "table.csv").write_text("\n".join(["Test", "Zeit (s),A (g),B (gal)", *lines, ""]))
    (folder / "nan.txt").write_text(table.replace("\n", "\nnan\n", 3))
    (folder / "cut.mseed").write_bytes(b"000001D TD")
    write(folder / "n.mseed", trace(samples, channel="HNE"), trace(samples[::-1], channel="HNN"))
    pair = np.sin(np.outer([0.1, 0.15], np.arange(200)) ** 1.1)
    write(folder / "both.mseed", trace(pair[0], channel="HNE"), trace(pair[1], channel="HNN"))
    write(folder / "counts.mseed", trace(counts(60), channel="HNZ"))
    write(folder / "s.sac", trace(samples.astype(np.float32)), format="SAC")
    many = folder / "many"
    many.mkdir(exist_ok=True)
    (many / "b.txt").write_text(table)
    (many / "notes.md").write_text("no record\n")
    suite = folder / "suite"
    suite.mkdir(exist_ok=True)
    for number in range(1, 6):
        values = [
            0.2 * number * math.sin(0.05 * number * i * (1.0 + 0.002 * i)) for i in range(200)
        ]
        rows = "\n".join(f"{value:.6f}" for value in values)
        (suite / f"{number}.txt").write_text(f"# dt = 0.01 s, units = m/s^2\n{rows}\n")
    (folder / _MARK).write_text("the folder is as it was made\n")


def run(arguments: Sequence[str], stdin: bytes | None = None) -> str:
    """Run `tdint ARGUMENTS`, check its output and the files in `out`, and return the meaning of its
    exit code.

    Raises
    ------
    Failure
        The output is forbidden (`fuzz.printed`).
    """
    if _changed(Path()):
        _fill(Path())
    shutil.rmtree(OUTPUT, ignore_errors=True)
    Path(OUTPUT).mkdir()
    Path(OUTPUT, OLD).write_text("a\n1\n")
    result = _result(arguments, stdin)
    files = {str(path): path.read_bytes() for path in Path(OUTPUT).rglob("*") if path.is_file()}
    return printed.check(result.exit_code, result.stdout_bytes, result.stderr, files)


def invoked(arguments: Sequence[str]) -> tuple[int, str]:
    """Run `tdint ARGUMENTS` in the current directory; return its exit code and its messages."""
    result = _result(arguments)
    return result.exit_code, result.stderr


def invoked_fully(arguments: Sequence[str]) -> tuple[int, str, str]:
    """Run `tdint ARGUMENTS`; return its exit code, standard output and standard error."""
    result = _result(arguments)
    text = (result.stdout_bytes or b"").decode("utf-8", "backslashreplace")
    return result.exit_code, text, result.stderr


def _result(arguments: Sequence[str], stdin: bytes | None = None) -> Result:
    return runner().invoke(cli, list(arguments), input=stdin, prog_name="tdint")
