"""Figures of the READMEs in configs: `python tests/pictures.py` draws figures that are out of date.

configs/pictures.json stores a digest of the command of a figure, its input files, the methods of
the catalog if the figure shows them, and the sources that draw it; tests/documentation compares.
The command is also stored in the PNG file (`png_text`), so that a test compares it with the page.
Pixels are not compared, because they differ between machines. Work-precision diagrams show times:
they are drawn on an idle machine, and only by name, as in `python tests/pictures.py
chain-150-chart.png`.
"""

import ast
import hashlib
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import png_text
import readmes
from tdint.methods.catalogue import catalogue

FOLDER = readmes.ROOT / "configs"
DIGESTS = FOLDER / "pictures.json"
_PACKAGE = readmes.ROOT / "src" / "tdint"
_IDA = "tdint ida configs/collapse-prone-frame.yaml records --units m/s^2 -q"
_REGION = " && ".join(
    next(
        [command.replace("{", "{{").replace("}", "}}") for command, _ in session[:2]]
        for session in readmes.sessions(
            (readmes.ROOT / "src" / "tdint" / "studies" / "README.md").read_text()
        )
        if "region.yaml" in "".join(command for command, _ in session)
    )
)
"""The inventory and the campaign of the README's region."""


@dataclass(frozen=True)
class Picture:
    """Definition of a figure: a shell command, with `{file}` for the file name, and the module that
    draws it."""

    command: str
    module: str
    shows_methods: bool = False
    timed: bool = False


PICTURES = {
    "kaikoura-frame.png": Picture(
        "tdint run configs/kaikoura-frame.yaml --plot={file}", "output/figures/runs"
    ),
    "two-directions.png": Picture(
        "tdint run configs/two-directions.yaml --plot={file}", "output/figures/runs"
    ),
    "three-story-concrete-loops.png": Picture(
        "tdint law configs/three-story-concrete.yaml --drift 1% --drift 2% --drift 3% --cycles 2 "
        "--plot={file}",
        "output/figures/static_curves",
    ),
    "design-spectrum.png": Picture(
        "tdint scale records --units m/s^2 --target configs/design-spectrum.csv --range 0.2:2 "
        "--plot={file}",
        "studies/motions/scaling_figures",
    ),
    "collapse-prone-frame-ida.png": Picture(f"{_IDA} --plot={{file}}", "studies/ida/ida_figures"),
    "collapse-prone-frame-fragility.png": Picture(
        f"{_IDA} | tdint fragility - --threshold 10% --modeling-dispersion 0.35 --plot={{file}}",
        "studies/fragility/fragility_figures",
    ),
    "region-fragility.png": Picture(
        f"{_REGION} && tdint fragility region --by type --im pga --plot={{file}}",
        "studies/fragility/fragility_figures",
    ),
    "failures.png": Picture(
        "tdint failures --plot={file}", "assessment/failures/failure_figures", shows_methods=True
    ),
    "ten-story-bilinear-chart.png": Picture(
        "tdint chart configs/ten-story-bilinear.yaml --peers --repeat 20 --plot={file}",
        "assessment/chart/chart_figures",
        timed=True,
    ),
    "chain-150-chart.png": Picture(
        "tdint chart configs/chain-150.yaml --repeat 5 --plot={file}",
        "assessment/chart/chart_figures",
        timed=True,
    ),
}


def _sources(module: str) -> set[Path]:
    """Return the source files of a module and of the figure modules that it imports."""
    found: set[Path] = set()
    names = {module}
    while names:
        file = _PACKAGE / f"{names.pop()}.py"
        if file not in found:
            found.add(file)
            imported = re.findall(
                r"^from tdint\.([\w.]*figures[\w.]*) import (\([^)]*\)|[^\n]*)",
                file.read_text(),
                re.M,
            )
            for package, items in imported:
                path = package.replace(".", "/")
                modules = [path, *(f"{path}/{item}" for item in re.findall(r"\w+", items))]
                names |= {name for name in modules if (_PACKAGE / f"{name}.py").exists()}
    return found


def _inputs(command: str) -> set[Path]:
    """Return the files in a command, including the records of models and of directories."""
    named = [readmes.ROOT / word for word in command.split() if (readmes.ROOT / word).exists()]
    files = {file for path in named for file in (path.glob("*.mseed") if path.is_dir() else [path])}
    references = (
        re.findall(r"\.\./records/[\w./-]+", file.read_text())
        for file in files
        if file.suffix == ".yaml"
    )
    return files | {
        readmes.ROOT / name.removeprefix("../") for names in references for name in names
    }


def digest(picture: Picture) -> str:
    """Return the digest of a command, its inputs and the sources of the figure; work-precision
    diagrams have no sources. File names count, directories do not."""
    checksum = hashlib.sha256(picture.command.encode())
    if picture.shows_methods:
        checksum.update(" ".join(catalogue()).encode())
    sources = set() if picture.timed else _sources(picture.module)
    for file in sorted(sources | _inputs(picture.command), key=lambda file: file.name):
        checksum.update(file.name.encode() + b"\0" + _content(file))
    return checksum.hexdigest()


def _content(file: Path) -> bytes:
    """Return the content of a file; of Python sources only the code, because comments and
    docstrings do not change a figure."""
    if file.suffix != ".py":
        return file.read_bytes()
    tree = ast.parse(file.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            node.body[0].value.value = ""
    # Names, texts and numbers in order: `ast.dump` differs between versions of Python.
    parts = [
        (
            type(node).__name__,
            *(str(value) for _, value in ast.iter_fields(node) if is_plain(value)),
        )
        for node in ast.walk(tree)
    ]
    return repr(parts).encode()


def is_plain(value: object) -> bool:
    """Return True if a field of a syntax node is a name, a text or a number."""
    return isinstance(value, str | int | float | bytes)


def out_of_date() -> list[str]:
    """Return the names of figures with a changed digest or a missing file."""
    known = json.loads(DIGESTS.read_text()) if DIGESTS.exists() else {}
    return [
        name
        for name, picture in PICTURES.items()
        if known.get(name) != digest(picture) or not (FOLDER / name).exists()
    ]


def draw(names: list[str]) -> None:
    """Draw figures and write their digests."""
    known = json.loads(DIGESTS.read_text()) if DIGESTS.exists() else {}
    for name in names:
        print(name, flush=True)
        with readmes.checkout() as (folder, environment):
            code, _, messages = readmes.shell(
                PICTURES[name].command.format(file=name), folder, environment
            )
            assert code == 0, messages
            (FOLDER / name).write_bytes((folder / name).read_bytes())
            png_text.stamp(FOLDER / name, PICTURES[name].command.format(file=name))
        known[name] = digest(PICTURES[name])
        DIGESTS.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    stale = out_of_date()
    draw(sys.argv[1:] or [name for name in stale if not PICTURES[name].timed])
    if untimed := [name for name in stale if PICTURES[name].timed and name not in sys.argv]:
        print("drawn by name, on a quiet machine:", *untimed)
