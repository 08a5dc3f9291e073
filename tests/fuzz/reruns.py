"""Attacks on the results that `tdint rerun` compares, from a seed: an output of a command is
changed, removed or replaced, the JSON file lists other files, or the repeated command fails.

Each attack must end in an exit code other than 0, with the name of the file in a message. A change
within rounding, and a link to the same bytes, may be reported as equal.
"""

import functools
import gzip
import json
import os
import random
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fuzz.oracle import Failure
from fuzz.sandbox import invoked_fully
from fuzz.study_files import MATCH, SELECT

OUTCOMES = REFUSED, EQUAL = "not approved", "equal within rounding"

_UNITS = "--units m/s^2"


@dataclass(frozen=True)
class Scene:
    """Commands that write files.

    Attributes
    ----------
    lines : tuple of str
        Command lines after `tdint`.
    json_path : str
        The JSON file, or its directory, which `rerun` reads.
    inputs : tuple of str
        Files that the commands read; without one of them the repeated command fails.
    """

    lines: tuple[str, ...]
    json_path: str
    inputs: tuple[str, ...]


SCENES = {
    "run": Scene(
        ("run linear.yaml --history --plot --report page.html -o out",), "out", ("a.txt",)
    ),
    "floors": Scene(
        (
            "run linear.yaml --floor-spectra roof --floor-period 0.1,1 --plot=more/p.svg "
            "--history=more/h.csv.gz -o out",
        ),
        "out",
        ("a.txt",),
    ),
    "runs": Scene(
        (f"run limited.yaml a.txt n.mseed {_UNITS} --plot --report out/page.html -o out",),
        "out",
        ("a.txt", "n.mseed"),
    ),
    "run of a pair": Scene(
        (f"run limited.yaml both.mseed n.mseed {_UNITS} --pair-demand mean -o out",),
        "out",
        ("both.mseed",),
    ),
    "match": Scene((" ".join(("match", *MATCH[0], "--plot")),), "out/matched/matched.json",
                   ("suite/1.txt", "target.csv")),
    "match of a pair": Scene((" ".join(("match", *MATCH[1])),), "out/pairs/matched.json",
                             ("both.mseed",)),
    "match as AT2": Scene((" ".join(("match", *MATCH[0], "--format", "at2")),),
                          "out/matched/matched.json", ("suite/1.txt", "target.csv")),
    "scale": Scene(
        (f"scale a.txt n.mseed {_UNITS} --target target.csv -o f.csv --plot",),
        "f.json",
        ("a.txt", "target.csv"),
    ),
    "select": Scene((" ".join(("scale", *SELECT, "--plot")),), "out/selected.json",
                    ("target.csv",)),
    "spectrum": Scene(
        ("spectrum a.txt --period 0.2,1 -o new/s.csv --plot",), "new/s.json", ("a.txt",)
    ),
    "spectra": Scene(
        (f"spectrum a.txt n.mseed {_UNITS} --period 0.5 -o out/ --plot",),
        "out/a.json",
        ("a.txt",),
    ),
    "drift-spectrum": Scene(
        ("drift-spectrum a.txt --period 0.2,1 -o d.csv --plot",), "d.json", ("a.txt",)
    ),
    "campaign": Scene(
        ("campaign scales.yaml -o out --plot --report page.html",), "out", ("a.txt", "linear.yaml")
    ),
    "campaign of pairs": Scene(
        ("campaign pairs.yaml -o out --im pga,sa",), "out", ("n.mseed", "limited.yaml")
    ),
    "export": Scene(
        ("campaign map.yaml -o out", "campaign export out --simcenter --geojson"),
        "out",
        ("town.csv", "grid.csv"),
    ),
    "merge": Scene(
        (
            "campaign scales.yaml -o one --shard 1/2",
            "campaign scales.yaml -o two --shard 2/2",
            "campaign merge one two -o out",
        ),
        "out",
        (),
    ),
    "ida": Scene(
        ("ida linear.yaml a.txt --precision 40% --max-im 1g -o out --plot --report page.html",),
        "out/ida.json",
        ("a.txt", "linear.yaml"),
    ),
    "fragility": Scene(
        ("fragility stripes.csv -o f.csv --plot --report f.html",), "f.json", ("stripes.csv",)
    ),
    "compare": Scene(
        ("compare linear.yaml --recorded recorded.yaml -o out --plot --report out/page.html",),
        "out",
        ("recorded.yaml", "history.csv"),
    ),
    "chart": Scene(
        (
            "chart linear.yaml --method newmark-average --halvings 0 --repeat 1 --duration 0.1 "
            "--no-cache -o c.csv --plot",
        ),
        "c.json",
        ("linear.yaml",),
    ),
    "modes": Scene(
        ("modes linear.yaml -o m.csv --plot=more/m.pdf --report m.html",),
        "m.json",
        ("linear.yaml",),
    ),
    "compressed": Scene(("modes linear.yaml -o m.csv.gz",), "m.json", ("linear.yaml",)),
    "parquet": Scene(("modes linear.yaml -o m.parquet",), "m.json", ("linear.yaml",)),
    "info": Scene((f"info a.txt n.mseed {_UNITS} -o i.csv --plot",), "i.json", ("a.txt",)),
    "law": Scene(
        ("law bilinear.yaml --drift 1% --points 3 -o l.csv --plot",), "l.json", ("bilinear.yaml",)
    ),
    "pushover": Scene(
        ("pushover bilinear.yaml --points 3 -o p.csv --plot --report p.html",),
        "p.json",
        ("bilinear.yaml",),
    ),
    "sensitivity": Scene(
        ("sensitivity linear.yaml a.txt --vary mass_factor=0.9:1.1 -o s.csv --plot",),
        "s.json",
        ("linear.yaml",),
    ),
    "inventory": Scene(
        ("inventory buildings.csv --units ft -o i.csv --models models",),
        "i.json",
        ("buildings.csv",),
    ),
    "overshoot": Scene(("overshoot --method wilson --steps 3 -o o.csv --plot",), "o.json", ()),
    "stability": Scene(
        ("stability --method wilson --dt-over-t 0.1:1:3 -o s.csv",), "s.json", ()
    ),
}  # fmt: skip
"""By name."""


@dataclass(frozen=True)
class _Outputs:
    """Files that a scene has written: directory, outputs and their bytes."""

    folder: Path
    outputs: tuple[str, ...]


_KEPT: dict[tuple[str, str], _Outputs] = {}


def _written_outputs(name: str) -> _Outputs:
    """Run the commands of a scene once for each sandbox, and check that `rerun` approves them."""
    here = str(Path.cwd())
    if (here, name) in _KEPT:
        return _KEPT[here, name]
    folder = Path(tempfile.mkdtemp(prefix=".scene-", dir=here))
    for entry in Path(here).iterdir():
        if entry.name.startswith((".scene-", ".attack-")) or entry.name == "out":
            continue
        (shutil.copytree if entry.is_dir() else shutil.copy2)(entry, folder / entry.name)
    with chdir(folder):
        before = set(_files())
        with plain_figures():
            for line in SCENES[name].lines:
                code, _, err = invoked_fully(line.split())
                if code:
                    raise Failure(f"{line}: exit code {code}: {err[-300:]!r}")
            code, out, err = invoked_fully(["rerun", SCENES[name].json_path])
        if code or out:
            raise Failure(f"rerun of the sound results: exit code {code}: {err[-500:]!r}")
        outputs = tuple(
            file
            for file in sorted(set(_files()) - before)
            if not file.endswith(("-wal", "-shm", ".lock"))
            and not file.startswith(("one/", "two/"))
        )
    _KEPT[here, name] = _Outputs(folder, outputs)
    return _KEPT[here, name]


def _files() -> Iterator[str]:
    return (str(path) for path in Path().rglob("*") if path.is_file())


@contextmanager
def plain_figures() -> Iterator[None]:
    """Draw figures small and without layout to reduce their time by a factor of ten."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    savefig, execute = Figure.savefig, ConstrainedLayoutEngine.execute

    def save(self: Figure, *arguments: Any, **options: Any) -> None:
        self.set_layout_engine(None)
        small = {"dpi": 15} if options.get("format") == "png" else {}
        savefig(self, *arguments, **options | small)

    Figure.savefig = save  # type: ignore[method-assign]
    ConstrainedLayoutEngine.execute = lambda engine, figure: None  # type: ignore[method-assign]
    try:
        yield
    finally:
        Figure.savefig = savefig  # type: ignore[method-assign]
        ConstrainedLayoutEngine.execute = execute  # type: ignore[method-assign]


# ---- Attacks on one file


def _flip(file: Path, source: random.Random) -> None:
    data = bytearray(file.read_bytes())
    data[source.randrange(len(data))] ^= 1 << source.randrange(8)
    file.write_bytes(bytes(data))


def _digit(file: Path, source: random.Random) -> None:
    """Change the first digit of a number of the content, also of a compressed one."""
    packed = file.suffix == ".gz"
    data = gzip.decompress(file.read_bytes()) if packed else file.read_bytes()
    positions = [match.start() for match in re.finditer(rb"(?<![\w.])[1-9](?=[\d.,\n])", data)]
    if not positions:
        return _flip(file, source)
    changed = bytearray(data)
    position = source.choice(positions)
    changed[position] = ord("1") + (changed[position] - ord("1") + 1) % 9
    file.write_bytes(gzip.compress(bytes(changed)) if packed else bytes(changed))
    return None


def _truncate(file: Path, source: random.Random) -> None:
    data = file.read_bytes()
    file.write_bytes(data[: source.choice((0, 1, len(data) // 2, len(data) - 1))])


def _cut_rows(file: Path, source: random.Random) -> None:
    lines = file.read_bytes().splitlines(keepends=True)
    if len(lines) > 1:
        del lines[source.randrange(1, len(lines))]
    else:
        lines = []
    file.write_bytes(b"".join(lines))


def _add_row(file: Path, source: random.Random) -> None:
    data = file.read_bytes()
    if file.suffix == ".gz":
        more = gzip.compress(gzip.decompress(data).splitlines(keepends=True)[-1])
    else:
        more = source.choice((data.splitlines(keepends=True)[-1], b"1,2,3\n", b"\n1\n", b"x"))
    file.write_bytes(data + more)


def _append_zeros(file: Path, source: random.Random) -> None:
    file.write_bytes(file.read_bytes() + b"\0" * source.choice((1, 4096)))


def _delete(file: Path, source: random.Random) -> None:
    file.unlink()


def _empty_folder(file: Path, source: random.Random) -> None:
    file.unlink()
    file.mkdir()


def _pipe(file: Path, source: random.Random) -> None:
    file.unlink()
    os.mkfifo(file)


def _link(target: str) -> Callable[[Path, random.Random], None]:
    def replace(file: Path, source: random.Random) -> None:
        file.unlink()
        file.symlink_to(target)

    return replace


def _link_to_other(file: Path, source: random.Random) -> None:
    """Link to another file of the same type, or to an input."""
    others = [
        other for other in file.parent.iterdir() if other != file and other.suffix == file.suffix
    ]
    target = source.choice(others) if others else Path("linear.yaml").absolute()
    file.unlink()
    file.symlink_to(target.absolute())


def _link_to_changed(file: Path, source: random.Random) -> None:
    elsewhere = file.with_name(f"{file.name}.moved")
    shutil.move(file, elsewhere)
    _digit(elsewhere, source)
    file.symlink_to(elsewhere.absolute())


_PRIVATE = "4711.625"
"""Number in a file that must not be printed."""


def _link_to_private(file: Path, source: random.Random) -> None:
    """Link to a file outside of the directory of the command, in which all numbers are private."""
    data = file.read_bytes()
    data = gzip.decompress(data) if file.suffix == ".gz" else data
    private = Path(tempfile.mkdtemp(prefix="private-", dir=Path.cwd().parent), file.name)
    head, separator, rest = data.partition(b"\n")
    rest = re.sub(rb"(?<![\w.])\d[\d.]*", _PRIVATE.encode(), rest)
    private.write_bytes(head + separator + rest)
    file.unlink()
    if source.random() < 0.5 or file.parent == Path():
        file.symlink_to(private)
    else:  # a link to the directory
        shutil.move(file.parent, private.parent / "moved")
        (private.parent / "moved" / file.name).write_bytes(private.read_bytes())
        file.parent.symlink_to(private.parent / "moved")


def _quoted(file: Path, source: random.Random) -> None:
    """Write text into a number."""
    data = file.read_bytes()
    match = source.choice(list(re.finditer(rb"(?<![\w.])\d[\d.]*", data)) or [None])
    if match is None:
        return _flip(file, source)
    word = source.choice((b"nan", b"inf", b"", b"1e999", b'"1"', b"0x1"))
    file.write_bytes(data[: match.start()] + word + data[match.end() :])
    return None


ON_FILES = {
    "flipped bit": _flip,
    "changed digit": _digit,
    "truncated": _truncate,
    "row removed": _cut_rows,
    "row added": _add_row,
    "zeros added": _append_zeros,
    "text for a number": _quoted,
    "deleted": _delete,
    "directory": _empty_folder,
    "pipe": _pipe,
    "link to nothing": _link("nowhere"),
    "link to itself": _link("."),
    "link to /dev/zero": _link("/dev/zero"),
    "link to /proc/self/mem": _link("/proc/self/mem"),
    "link to another file": _link_to_other,
    "link to a changed copy": _link_to_changed,
    "link to a private file": _link_to_private,
}
"""Attacks on a file that a command has written."""


# ---- Attacks on the JSON file and on the inputs


def _json_file(scene: Scene) -> Path:
    path = Path(scene.json_path)
    return path / "summary.json" if path.is_dir() else path


def _forge(scene: Scene, change: Callable[[dict[str, Any]], None]) -> str:
    file = _json_file(scene)
    about = json.loads(file.read_text())
    change(about)
    file.write_text(json.dumps(about))
    return file.name


def _keys(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the paths of the numbers of the results in a JSON file."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _keys(part, (*path, key))
    elif isinstance(value, list):
        for index, part in enumerate(value):
            yield from _keys(part, (*path, index))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


_NOT_COMPARED = re.compile(
    "wall_time_s|time_loop_s|processor_time|'versions'|'timing'|'recommended'|'usual'"
)


def _number_of_json(scene: Scene, written: _Outputs, source: random.Random) -> str | None:
    """Change a result in the JSON file."""

    def change(about: dict[str, Any]) -> None:
        paths = [path for path in _keys(about) if not _NOT_COMPARED.search(str(path))]
        path = source.choice(paths)
        part = about
        for key in path[:-1]:
            part = part[key]
        part[path[-1]] = part[path[-1]] * 1.5 + 1.0

    about = json.loads(_json_file(scene).read_text())
    if not any(not _NOT_COMPARED.search(str(path)) for path in _keys(about)):
        return None
    return _forge(scene, change)


def _removed_results(scene: Scene, written: _Outputs, source: random.Random) -> str | None:
    """Remove a result from the JSON file."""
    about = json.loads(_json_file(scene).read_text())
    paths = [path for path in _keys(about) if not _NOT_COMPARED.search(str(path))]
    paths = [path for path in paths if isinstance(path[-1], str)]
    if not paths:
        return None
    path = source.choice(paths)

    def change(about: dict[str, Any]) -> None:
        part: Any = about
        for key in path[:-1]:
            part = part[key]
        del part[path[-1]]

    return _forge(scene, change)


def _more_files(scene: Scene, written: _Outputs, source: random.Random) -> str:
    """List one file more than the command writes."""
    (_json_file(scene).parent / "more.csv").write_text("a\n1\n")

    def change(about: dict[str, Any]) -> None:
        about["files"] = [*about.get("files", []), {"file": "more.csv", "rows": 1}]

    _forge(scene, change)
    return "more.csv"


def _listed_file_deleted(scene: Scene, written: _Outputs, source: random.Random) -> str | None:
    """Delete a file and its entries in the list."""
    outputs = [file for file in written.outputs if Path(file) != _json_file(scene)]
    if not outputs:
        return None
    file = Path(source.choice(outputs))
    file.unlink()

    def change(about: dict[str, Any]) -> None:
        about["files"] = [
            entry for entry in about.get("files", []) if entry.get("file") != file.name
        ]
        if "motions" in about and isinstance(about["motions"], list):
            about["motions"] = [entry for entry in about["motions"] if entry != file.name]

    _forge(scene, change)
    return file.name


def _input_missing(scene: Scene, written: _Outputs, source: random.Random) -> str | None:
    if not scene.inputs:
        return None
    file = Path(source.choice(scene.inputs))
    file.unlink()
    return file.name


def _input_changed(scene: Scene, written: _Outputs, source: random.Random) -> str | None:
    if not scene.inputs:
        return None
    file = Path(source.choice(scene.inputs))
    file.write_bytes(file.read_bytes() + b"# one line more\n")
    return file.name


def _input_broken(scene: Scene, written: _Outputs, source: random.Random) -> str | None:
    """An input that the command refuses; the attack adds --changed."""
    if not scene.inputs:
        return None
    file = Path(source.choice(scene.inputs))
    file.write_bytes(b"\0broken")
    return file.name


def _other_argument(scene: Scene, written: _Outputs, source: random.Random) -> str:
    """Append a word that makes the repeated command fail."""
    word = source.choice(("--no-such-option", "surplus\x01word", "--method=none"))
    return _forge(scene, lambda about: about["arguments"].append(word))


def _export_fails(scene: Scene, written: _Outputs, source: random.Random) -> str | None:
    if len(scene.lines) != 2:
        return None
    word = source.choice(("--by=nothing", "--polygons=none.geojson", "--event=none", "--no-such"))
    return _forge(scene, lambda about: about["export"].append(word))


def _other_status(scene: Scene, written: _Outputs, source: random.Random) -> str:
    """Claim that the run failed."""
    return _forge(scene, lambda about: about.update(status="unstable-step"))


ON_COMMANDS: dict[str, Callable[[Scene, _Outputs, random.Random], str | None]] = {
    "number in the JSON file": _number_of_json,
    "number removed from the JSON file": _removed_results,
    "longer list of files": _more_files, "shorter list of files": _listed_file_deleted,
    "input missing": _input_missing, "input changed": _input_changed,
    "input broken": _input_broken, "command refuses its arguments": _other_argument,
    "export fails": _export_fails, "status": _other_status,
}  # fmt: skip
"""Attacks on the JSON file, the inputs and the command; each returns the name that a message must
contain, or None if it does not apply."""


def names() -> list[str]:
    """Return the names of the scenes; scenes with a store are listed again with their export."""
    return [*SCENES, "export"]


@functools.cache
def _attacks(name: str, outputs: tuple[str, ...]) -> list[tuple[str, str]]:
    """All attacks on a scene, in a fixed order without a pattern."""
    attacks = [(attack, file) for attack in ON_FILES for file in outputs]
    attacks += [(attack, "") for attack in ON_COMMANDS for _ in range(2)]
    random.Random(name).shuffle(attacks)
    return attacks


def outcome(name: str, seed: int) -> str:
    """Attack a scene within a sandbox; raise Failure if `rerun` accepts it."""
    written, scene = _written_outputs(name), SCENES[name]
    attacks = _attacks(name, written.outputs)
    attack, file = attacks[seed % len(attacks)]
    source = random.Random(f"{name} {seed}")
    folder = Path(tempfile.mkdtemp(prefix=".attack-", dir=Path.cwd()))
    try:
        shutil.copytree(written.folder, folder, dirs_exist_ok=True, symlinks=True)
        with chdir(folder):
            return _attack(scene, written, (attack, file), source)
    finally:
        shutil.rmtree(folder)


def _attack(scene: Scene, written: _Outputs, attack: tuple[str, str], source: random.Random) -> str:
    name, file = attack
    if name in ON_FILES:
        before = Path(file).read_bytes()
        ON_FILES[name](Path(file), source)
        named: str | None = Path(file).name
        if _is_file(Path(file)) and Path(file).read_bytes() == before:
            return EQUAL
    else:
        named = ON_COMMANDS[name](scene, written, source)
        if named is None:
            return EQUAL
    arguments = ["rerun", scene.json_path, *(["--changed"] if name == "input broken" else [])]
    # Other processes may use the usual directory of temporary files.
    usual, tempfile.tempdir = tempfile.tempdir, str(Path("temporary").absolute())
    Path(tempfile.tempdir).mkdir()
    try:
        with plain_figures():
            code, out, err = invoked_fully(arguments)
    finally:
        tempfile.tempdir = usual
    message = f"{name} {file}: exit code {code}: {err[-400:]!r}"
    # The user names the JSON file and its directory, which may be links.
    json_file = _json_file(scene)
    is_named = Path(file) == json_file or (
        Path(file).parent == json_file.parent and json_file.parent.is_symlink()
    )
    if _PRIVATE in out + err and file and not is_named:
        raise Failure(f"private cells are printed: {message}")
    if remaining := sorted(path.name for path in Path("temporary").iterdir()):
        raise Failure(f"{name} {file}: left behind: {remaining}")
    if code in (0, 1) and not (code == 0 and _is_rounding(err, str(named), name, file)):
        raise Failure(message)
    if "Traceback" in err or "internal error" in err or "encountered in" in err:
        raise Failure(message)
    if code and str(named) not in err + out and name not in ("status",):
        raise Failure(f"not named: {message}")
    return EQUAL if code == 0 else REFUSED


def _is_file(path: Path) -> bool:
    try:
        return path.is_file() and "/proc" not in str(path.resolve())
    except (OSError, RuntimeError):
        return False


def _is_rounding(err: str, named: str, name: str, file: str) -> bool:
    """Return True if the file is reported as equal within rounding, value by value or row by
    row."""
    approved = ("equal within rounding", "the same, ", "only the format was compared")
    lines = [line for line in err.splitlines() if f"{named}: " in line]
    return (
        any(f"{named}: {how}" in line for line in lines for how in approved)
        and name
        in (
            "flipped bit", "changed digit", "zeros added", "row added", "truncated",
            "row removed", "text for a number", "link to a changed copy",
        )
        and not any("byte for byte" in line for line in lines)
    )  # fmt: skip
