"""Beside each table that -o writes lies a JSON file that says what it came from."""

import hashlib
import json
from importlib import import_module
from pathlib import Path

import pytest

import tdint
from tdint.system import __version__, version_of_sources
from tdint_cli.main import COMMANDS

INVENTORY = """\
id,NumberOfStories,YearBuilt,OccupancyClass,PlanArea,StructureType,Latitude,Longitude
1,3,1990,COM1,1000,C1,37,-122
"""
CASES = {
    "modes": (["forced.yaml"], ["forced.yaml"]),
    "law": (["shaken.yaml", "--drift", "1%"], ["shaken.yaml"]),
    "pushover": (["shaken.yaml", "--drift", "1%", "--points", "5"], ["shaken.yaml"]),
    "inventory": (["buildings.csv", "--units", "m"], ["buildings.csv"]),
    "info": (["motion.mseed", "--units", "m/s^2"], ["motion.mseed"]),
    "spectrum": (["motion.mseed", "--units", "m/s^2", "--period", "1"], ["motion.mseed"]),
    "drift-spectrum": (["motion.mseed", "--units", "m/s^2", "--period", "1"], ["motion.mseed"]),
    "scale": (
        ["motion.mseed", "--units", "m/s^2", "--target", "target.csv", "--range", "0.5:1"],
        ["motion.mseed", "target.csv"],
    ),
    "fragility": (["stripes.csv"], ["stripes.csv"]),
    "sensitivity": (
        ["shaken.yaml", "motion.mseed", "--units", "m/s^2", "--component", "HNE", "--vary", "damping=0.02:0.08"],
        ["motion.mseed", "shaken.yaml"],
    ),
    "stability": (["--method", "hht", "--dt-over-t", "0.1:1:3"], []),
    "overshoot": (["--method", "hht", "--steps", "3"], []),
    "order": (["--method", "newmark-average", "--load", "record"], []),
    "failures": (["--method", "newmark-average", "--problem", "large-step"], []),
    "chart": (["forced.yaml", "--method", "newmark-average", "--dt", "0.02", "--repeat", "1"], ["forced.yaml"]),
}
"""Of each command that writes a table to -o a command line and the files that it reads."""
APART = {
    "validate": "as `modes`, but long",
    "init": "writes a model",
    "check": "writes none",
    "methods": "writes none",
    "rerun": "writes what another one does",
    "compile": "writes objects",
    **dict.fromkeys(("run", "compare", "campaign", "ida", "match"), "JSON in the folder"),
    "examples": "several tables",
}


@pytest.fixture
def read(folder):
    """The folder with what the command lines read."""
    (folder / "buildings.csv").write_text(INVENTORY)
    (folder / "target.csv").write_text("period_s,sa_g\n0.1,0.5\n1,0.5\n3,0.2\n")
    (folder / "stripes.csv").write_text("im,collapses,records\n0.5,1,20\n1,8,20\n2,19,20\n")
    return folder


def test_all_commands_are_here():
    assert set(CASES) | set(APART) == set(COMMANDS)
    for name in CASES:
        command = import_module(f"tdint_cli.commands.{COMMANDS[name][0]}").command
        assert any("--output" in option.opts for option in command.params)


@pytest.mark.parametrize("name", CASES)
def test_what_a_table_came_from(read, tdint, name):
    """The files that were read with their SHA-256, the options, what each column means, versions and sources; the call
    again writes the same bytes, and `rerun` leaves them and finds the same cells."""
    words, inputs = CASES[name]
    tdint(name, *words, "-o", "table.csv", code=0)
    about = json.loads((read / "table.json").read_text())
    assert (about["schema"]["name"], about["command"]) == (f"tdint {name}", name)
    assert about["inputs"] == [
        {"file": file, "sha256": hashlib.sha256((read / file).read_bytes()).hexdigest()} for file in inputs
    ]
    header = (read / "table.csv").read_text().partition("\n")[0].split(",")
    assert set(header) <= set(about["columns"])
    assert about["versions"]["sources"] == version_of_sources()[1]
    assert name == "chart" or about["settings"]
    assert about["arguments"] == [name, *words, "-o", "table.csv"]
    before = {file: file.read_bytes() for file in read.iterdir()}
    again = tdint("rerun", "table.json", code=0)
    assert again.stdout == "" and "table.csv: the same, cell by cell" in again.stderr
    if name in ("modes", "law", "inventory", "fragility", "order", "scale"):  # what takes little time
        (read / "table.csv").unlink()
        (read / "table.json").unlink()
        tdint(name, *words, "-o", "table.csv", code=0)
    assert {file: file.read_bytes() for file in read.iterdir()} == before


def test_options_and_units_are_told(folder, tdint):
    model = (folder / "shaken.yaml").read_bytes()
    words = ("--story", 2, "--drift", "1%,5mm", "--output-units", "kN,mm", "-o", "law.csv.gz")
    tdint("law", "-", *words, stdin=model, code=0)
    about = json.loads((folder / "law.json").read_text())
    assert about["settings"]["story"] == 2 and about["settings"]["drifts"] == ["1%", "5mm"]
    assert about["settings"]["output_units"] == "kN,mm,kg"
    assert about["columns"]["drift_mm"]["unit"] == "mm"
    assert about["inputs"] == [{"file": "-", "sha256": hashlib.sha256(model).hexdigest()}]


def test_a_checkout_does_not_call_itself_a_release(tmp_path, monkeypatch):
    """Nor does a package with an edited file; the hash is that of its sources, wherever they are."""
    own = Path(tdint.__file__).parent
    system, digest = version_of_sources()
    assert system in (__version__, f"{__version__}+sources.{digest[:8]}")
    names = sorted(file.relative_to(own).as_posix() for file in own.rglob("*.py"))
    lines = "".join(f"{name} {hashlib.sha256((own / name).read_bytes()).hexdigest()}\n" for name in names)
    assert digest == hashlib.sha256(lines.encode()).hexdigest()[:16]
    _packed(tmp_path, monkeypatch)
    assert version_of_sources.__wrapped__()[0] == __version__
    (tmp_path / "tdint" / "terminal.py").write_text("changed = True\n")
    changed, other = version_of_sources.__wrapped__()
    assert changed == f"{__version__}+sources.{other[:8]}" and other != digest


def _packed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """tdint as an installed package would be, with two files, and the record of its installation."""
    from base64 import urlsafe_b64encode
    from importlib.metadata import Distribution

    from tdint import system

    about = folder / "tdint-0.dist-info"
    (folder / "tdint").mkdir()
    about.mkdir()
    record = ""
    for name in ("system.py", "terminal.py"):
        content = f"name = {name!r}\n".encode()
        (folder / "tdint" / name).write_bytes(content)
        digest = urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"tdint/{name},sha256={digest},{len(content)}\n"
    (about / "RECORD").write_text(record)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: tdint\nVersion: 0\n")
    monkeypatch.setattr(system, "__file__", str(folder / "tdint" / "system.py"))
    monkeypatch.setattr("importlib.metadata.distribution", lambda _: Distribution.at(about))
