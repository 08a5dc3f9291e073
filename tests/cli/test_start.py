"""What each command loads, in its own process: a small real call loads no package and no module
that it can spare."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from source_lines import count_code_lines
from tdint.methods.catalogue import FAMILIES
from tdint_cli.main import COMMANDS

HEAVY = {"numba", "scipy.stats", "scipy.optimize", "matplotlib", "obspy"}
"""Packages that take a tenth of a second and more; a command has those that its work is done
with."""

SPARED = {
    "scipy",
    "numpy.ma",
    "numpy.random",
    "argparse",
    "difflib",
    "gzip",
    "secrets",
    "tdint.campaign",
    "tdint.analysis.run.sequence",
    "tdint.analysis.spectra.floors",
    "tdint.analysis.run.step_choice",
    "tdint.ground_motion.horizontals",
    "tdint.ground_motion.reading.instrument",
}
"""What runs and spectra of records have no part in."""

WITHOUT_RECORDS = {"importlib.metadata", "tdint.ground_motion.reading.read"}
WITHOUT_RUNS = {"numpy.polynomial", "tdint.methods", "tdint.analysis.run.outcome"}
WITHOUT_FILES = {"yaml", "tdint.model.config", *WITHOUT_RECORDS}

CALLS = {
    "init": ("new.yaml", 3_850, ""),
    "check": ("office.yaml", 13_700, "obspy"),
    "run": ("office.yaml", 17_700, "obspy"),
    "modes": ("office.yaml", 9_150, ""),
    "law": ("office.yaml --drift 1%", 11_450, ""),
    "pushover": ("office.yaml --points 20", 11_450, ""),
    "compare": ("office.yaml --recorded recorded.yaml", 24_850, "scipy.optimize"),
    "inventory": ("buildings.csv --units ft", 8_050, ""),
    "info": ("motion.mseed --trim 0.5:2.5 --baseline linear --pad 1:2", 12_550, "obspy"),
    "spectrum": ("motion.mseed --period 1", 14_950, "obspy"),
    "drift-spectrum": ("motion.mseed --period 1", 14_650, "obspy"),
    "match": ("motion.mseed --target asce7:sds=1,sd1=0.6,tl=8 --range 0.2:1 -o m", 16_450, "obspy"),
    "campaign": ("status study", 29_700, ""),
    "scale": ("motion.mseed --pga 0.4g", 31_050, "obspy"),
    "ida": ("office.yaml motion.mseed --im pga --max-im 0.5g --precision 20%", 33_500, "obspy"),
    "sensitivity": ("office.yaml motion.mseed --vary damping=2%:5%", 35_150, "obspy"),
    "fragility": ("stripes.csv", 33_300, ""),
    "methods": ("", 12_400, ""),
    "stability": ("--method impulse4 --dt-over-t 0.1", 17_100, ""),
    "overshoot": ("--method impulse4 --steps 3", 17_100, ""),
    "order": ("--method impulse4 --load free", 19_450, "scipy.optimize"),
    "failures": ("--method impulse4 --problem large-step", 18_600, ""),
    "examples": ("1 --method newmark-average", 18_700, ""),
    "chart": ("office.yaml --method impulse4 --dt 0.01 --repeat 1 --duration 1", 23_650, "obspy"),
    "compile": ("office.yaml --show", 14_000, ""),
    "validate": ("", 23_300, "obspy"),
    "rerun": ("loop.json", 12_250, ""),
}
"""For each command: arguments, maximum number of lines of tdint's own code that it loads (5 % above
the present number, because a kernel that is not in the cache loads more), and the packages of
`HEAVY` that it needs."""

BEFORE = {
    "compare": ("run office.yaml --history=h.csv",),
    "campaign": ("campaign study.yaml -o study",),
    "rerun": ("law office.yaml --drift 1% -o loop.csv",),
}
"""What writes the files that they read."""

MORE = {
    "run": SPARED
    | {"numpy.fft", "obspy.imaging", "obspy.signal", "obspy.clients"}
    | {"tdint_cli.campaigns", "tdint.model.law_checks", "tdint.methods.step_check"}
    | {f"tdint.kernels.laws.{law}" for law in ("imk", "bouc_wen", "multilinear_pinching", "gap")}
    | {
        "tdint.kernels.oscillators",
        "tdint.analysis.spectra",
        "tdint.csv_table",
        "tdint.ground_motion.measures",
    }
    | {"tdint.ground_motion.processing_steps", "tdint.output.run_summary", "tdint.output.summary"}
    | {f"tdint.methods.{family}" for family in FAMILIES if family != "impulse4"},
    "spectrum": SPARED - {"numpy.ma", "tdint.ground_motion.horizontals"} | {"yaml"},
    "law": SPARED | WITHOUT_RECORDS | WITHOUT_RUNS | {"tdint.kernels.time_loop"},
    "modes": SPARED | WITHOUT_RECORDS | WITHOUT_RUNS | {"llvmlite", "shutil", "tempfile"},
    "check": {"tdint.analysis.run.outcome", "tdint.analysis.run.run"},
    "inventory": WITHOUT_RUNS | {"yaml"},
    "info": {"scipy.signal"},  # of filters
    **dict.fromkeys(("stability", "overshoot", "failures", "examples"), WITHOUT_FILES),
    "methods": SPARED
    | (WITHOUT_RECORDS - {"importlib.metadata"})
    | {"tdint.analysis.run.outcome", "llvmlite", "yaml", "tdint.model.config", "hashlib"},
}
"""What these must not load beside, if numpy, click and yaml do not: it takes its time."""

LONG = {
    "match",
    "campaign",
    "chart",
    "compare",
    "fragility",
    "ida",
    "order",
    "sensitivity",
    "validate",
    "failures",
    "overshoot",
    "stability",
    "examples",
}
"""Those that take more than half a second or load what another one of the suite does."""


STARTER = """
import json, os, sys
import click, numpy

for line in sys.stdin:
    child = os.fork()
    if not child:
        break
    print(os.waitpid(child, 0)[1], flush=True)
else:
    sys.exit()
code, file, *sys.argv = json.loads(line)
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
try:
    exec(code)
finally:
    with open(file, "w") as stream:
        print(*sys.modules, file=stream)
"""
"""A process that has what all commands load, and for each line that it reads makes a copy of
itself, which does it."""


class Starter:
    """Runs code in processes that have loaded nothing but click and numpy."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with (folder / "said").open("w") as said:
            self.process = subprocess.Popen(
                [sys.executable, "-c", STARTER],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said, text=True, cwd=folder,
            )  # fmt: skip

    def __call__(
        self, *words: str, code: str = "from tdint_cli.main import main; main()"
    ) -> set[str]:
        """The modules that are loaded when `tdint WORDS`, or this code, is done."""
        self.process.stdin.write(json.dumps([code, "modules", "tdint", *words]) + "\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline() == "0\n", (self.folder / "said").read_text()
        return set((self.folder / "modules").read_text().split())


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    """Commands in a folder with a model, its motion as a table and as MiniSEED, and what they read
    beside them."""
    if not hasattr(os, "fork"):
        pytest.skip("copies of a process are made on POSIX")
    folder = tmp_path_factory.mktemp("office")
    root = Path(__file__).parents[2]
    for name in ("stripes.csv", "buildings.csv"):
        (folder / name).write_bytes((root / "configs" / name).read_bytes())
    (folder / "recorded.yaml").write_text(
        "base: {file: h.csv, column: ground_acceleration_g}\n"
        "floors: {roof: {file: h.csv, column: floor_2_absolute_acceleration_g, quantity: "
        "acceleration}}\n"
    )
    (folder / "study.yaml").write_text(
        "buildings: {models: [office.yaml]}\nrecords: {files: [office-motion.txt]}\n"
    )
    start = Starter(folder)
    # In other processes: files tell the plug-ins that this one has, and `rerun` would look for
    # them.
    start("init", "office.yaml", "--stories", "2")
    start("info", "office-motion.txt", "--export", "motion.mseed")
    model = (folder / "office.yaml").read_text()
    (folder / "office.yaml").write_text(model.replace('"office-motion.txt"', "motion.mseed"))
    yield start
    start.process.communicate(timeout=30)


@pytest.fixture(scope="module")
def common(start):
    """What numpy, click and yaml load themselves."""
    return start(code="import yaml") - {"yaml"}


@pytest.mark.parametrize(
    "command",
    [pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in CALLS],
)
def test_a_command_loads_only_required_modules(start, common, command):
    for line in BEFORE.get(command, ()):
        start(*line.split())
    line, most, names = CALLS[command]
    loaded, needed = start(command, *line.split()), set(names.split())
    assert sorted((HEAVY - needed | MORE.get(command, set()) - HEAVY) & loaded - common) == []
    assert needed <= loaded, f"{command} does without: take it out of CALLS"
    files = [
        str(find_spec(name).origin)
        for name in loaded
        if name.partition(".")[0] in ("tdint", "tdint_cli")
    ]
    lines = sum(map(count_code_lines, files))
    assert 0 < lines <= most, (
        f"{command} loads {lines} lines of code; import within functions what it spares"
    )


def test_every_command_is_started():
    assert set(CALLS) == set(COMMANDS)


def test_names_of_unneeded_modules_exist():
    """A module that was renamed would be spared by nobody noticing."""
    ours = {name for names in MORE.values() for name in names if name.startswith("tdint")}
    assert [name for name in sorted(ours) if find_spec(name) is None] == []
