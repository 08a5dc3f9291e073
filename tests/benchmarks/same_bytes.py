"""What two installed trees print and write for the same commands and calls, byte by byte.

    python tests/benchmarks/same_bytes.py BEFORE AFTER [NAME ...] [--kept FILE.json] [--shared]

BEFORE and AFTER are folders with a `.venv`, or an environment's `bin` or `python`. Each tree uses
its own kernels, all variants in one, as the tests do. Compared are exit code, standard output,
standard error and every file written (a picture as SVG, a store as its rows), of the sessions and
scripts of this checkout's READMEs, `--help` and errors of every command, the scripts of
`same_bytes.ini`, and arrays of the Python interface as float64 to the last bit. NAME runs those
alone whose name begins with it; `--kept` keeps what BEFORE gave, and asks it only for what is
missing; `--shared` compares what both have: columns of tables, keys of JSON, arrays of a name. Left
out are wall times, versions and the digests of sources (`MASKS`, `MASKED_KEYS`, `MASKED_COLUMNS`,
`TIMED`). The exit code is 1 where anything differs.
"""

import argparse
import configparser
import csv
import itertools
import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import readmes
from fuzz.sandbox import sandbox

HERE = Path(__file__).resolve().parent
Outcome = dict[str, list[str]]
"""Lines of what came of a command: `exit code`, `stdout`, `stderr`, and each file by its name."""

SHOWN = 3
MASKS = (
    (re.compile(r"[\d.e+-]+ (?:us|ms|s) per step"), "TIME per step"),
    (re.compile(r"^(Times are|Warning: timing was disturbed) .*"), "TIMES"),
    (re.compile(r"(?<=runs in )[\d.]+ m?s\b.*"), "TIME"),
    (re.compile(r"\b0\.\d+\.\d+(?:\+\w+)?\b"), "VERSION"),
)
MASKED_KEYS = {
    "wall_time_s",
    "time_loop_s",
    "processor_time_s",
    "timing",
    "versions",
    "tdint_version",
}
MASKED_COLUMNS = {"seconds"}
"""Of a store."""

TIMED = ("time_s", "time_min_s")
"""Columns of a table that has both: times of a chart."""

MAIN = """\
import inspect, json, sys
from click.testing import CliRunner
from tdint_cli.main import cli
apart = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}
for line in json.loads(sys.argv[1]):
    result = CliRunner(**apart).invoke(cli, line, prog_name="tdint", terminal_width=100)
    print("$ tdint", *line, f"-> {result.exit_code} {result.exception!r}")
    print(result.stdout + result.stderr)
"""
"""Runs command lines in one process: those that do no more than help or refuse."""

CALLS = "same_bytes_arrays.py"
ARRAYS = {
    f"arrays-runs-{name}": ["runs", name]
    for name in ("ten-story", "ten-story-bilinear", "collapse-prone-frame")
}
ARRAYS |= {f"arrays-{name}": [name] for name in ("spectra", "statics", "studies")}
"""Its arguments."""


def cases() -> dict[str, list[str]]:
    """Arguments of a tree's `python`, or of `bash`, by the name of the case."""
    said = configparser.ConfigParser(interpolation=None, comment_prefixes=";")
    said.read(HERE / "same_bytes.ini", encoding="utf-8")
    spoiled, refused = said["spoiled"]["with"].split("\n"), said["errors"]["all"].split("\n")
    found = {name: ["bash", "-c", script] for name, script in said["scripts"].items()}
    for readme in readmes.files():
        for i, session in enumerate(readmes.sessions(readme.read_text(encoding="utf-8"))):
            name = (
                str(readme.relative_to(readmes.ROOT).parent).replace("/", "-").strip(".")
                or "first-page"
            )
            found[f"session-{name}-{i + 1}"] = [
                "bash",
                "-c",
                "\n".join(command for command, _ in session),
            ]
    for block in ("shell", "law", "elastic", "inelastic", "drift", "batch", "first"):
        found[f"script-{block}"] = ["bash", "-eu", "-c", readmes.block(block)]
    helps = [*([name, "--help"] for name in said["sound"]), ["--help"]]
    helps += [["campaign", name, "--help"] for name in ("status", "merge", "export")]
    found["help"] = ["python", "-c", MAIN, json.dumps(helps)]
    for name, sound in said["sound"].items():
        lines = [[name, *sound.split(), *more.split()] for more in spoiled]
        lines += [line.split() for line in refused if line.split(" ")[0] == name]
        found[f"errors-{name}"] = ["python", "-c", MAIN, json.dumps(lines)]
    return found | {name: ["python", CALLS, *which] for name, which in ARRAYS.items()}


def bin_folder(tree: Path) -> Path:
    """The folder of a tree's `python` and `tdint`."""
    if tree.is_dir() and (tree / ".venv").is_dir():
        tree = tree / ".venv"
    place = tree / "bin" if (tree / "bin").is_dir() else tree.parent if tree.is_file() else tree
    assert (place / "python").exists(), f"{place} holds no python"
    return place.absolute()


def outcome(place: Path, inputs: Path, arguments: list[str]) -> Outcome:
    """What comes of a case in a copy of the inputs, by the tree of a bin folder."""
    environment = {
        key: value for key, value in os.environ.items() if not key.startswith(("TDINT_", "PYTHON"))
    }
    environment |= {
        "PATH": f"{place}{os.pathsep}{os.environ['PATH']}",
        "TDINT_KERNELS": "whole",
        "COLUMNS": "100",
    }
    environment |= {"SOURCE_DATE_EPOCH": "0"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "case"
        shutil.copytree(inputs, folder)
        before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
        program = str(place / "python") if arguments[0] == "python" else arguments[0]
        done = subprocess.run(
            [program, *arguments[1:]],
            cwd=folder,
            env=environment,
            capture_output=True,
            timeout=580.0,
        )
        said = _masked(done.stderr.decode(errors="replace"), name)
        found = {
            "exit code": [str(done.returncode)],
            "stdout": _masked(done.stdout.decode(errors="replace"), name),
            "stderr": [line for line in said if not line.startswith("note: compiling")],
        }
        for path in sorted(folder.rglob("*")):
            if path.is_file() and before.get(path) != path.stat().st_mtime_ns:
                found[str(path.relative_to(folder))] = _lines(path)
        return found


def _masked(text: str, folder: str) -> list[str]:
    text = text.replace(folder, "FOLDER")
    if set(TIMED) <= set(text.partition("\n")[0].split(",")):
        table = list(csv.reader(text.splitlines()))
        kept = [i for i, name in enumerate(table[0]) if name not in TIMED]
        text = "\n".join(",".join(row[i] for i in kept) for row in table)
    for pattern, word in MASKS:
        text = pattern.sub(word, text)
    return text.splitlines()


def _lines(path: Path) -> list[str]:
    """What a file holds, without what is left out."""
    data = path.read_bytes()
    if data.startswith(b"SQLite format 3"):
        return _rows(path)
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return [data[i : i + 32].hex() for i in range(0, len(data), 32)]
    if path.suffix == ".json":
        return json.dumps(_without_times(json.loads(text)), indent=1).splitlines()
    return _masked(text, str(path.parent))


def _without_times(content):
    if isinstance(content, dict):
        return {
            key: _without_times(value) for key, value in content.items() if key not in MASKED_KEYS
        }
    return [_without_times(value) for value in content] if isinstance(content, list) else content


def _rows(path: Path) -> list[str]:
    """The rows of a store, floats to the last bit; without versions and digests."""
    with closing(sqlite3.connect(path)) as store:
        names = [
            row[0]
            for row in store.execute(
                "SELECT name FROM sqlite_master WHERE type='table' ORDER BY name"
            )
        ]
        kept = {
            name: [row[1] for row in store.execute(f"PRAGMA table_info({name})")] for name in names
        }
        rows = [
            (name, row)
            for name, columns in kept.items()
            for row in store.execute(
                f"SELECT {', '.join(c for c in columns if c not in MASKED_COLUMNS)} FROM {name}"
            )
        ]
    shown = (
        f"{name} {[value.hex() if isinstance(value, float) else value for value in row]}"
        for name, row in rows
    )
    return sorted(
        line
        for row in shown
        for line in _masked(row, str(path.parent))
        if not re.search(r"[0-9a-f]{32}|VERSION", line)
    )


def shared(one: list[str], other: list[str]) -> tuple[list[str], list[str]]:
    """Of two texts that are tables, JSON or lists of arrays what both have; else as they are."""
    if not one or not other:
        return one, other
    if one[0] == other[0] == "{":
        both = _shared_keys(json.loads("\n".join(one)), json.loads("\n".join(other)))
        return tuple(json.dumps(content, indent=1).splitlines() for content in both)  # type: ignore[return-value]
    tables = [list(csv.reader(text)) for text in (one, other)]
    if all(len(table[0]) > 2 and len({len(row) for row in table}) == 1 for table in tables):
        common = [name for name in tables[0][0] if name in tables[1][0]]
        places = [[table[0].index(name) for name in common] for table in tables]
        kept = [
            [",".join(row[i] for i in at) for row in table]
            for table, at in zip(tables, places, strict=True)
        ]
        return kept[0], kept[1]
    if all(any(" float64 " in line for line in text) for text in (one, other)):
        names = [[re.split(r" \(\d|\s\S+$", line)[0] for line in text] for text in (one, other)]
        pairs = zip((one, other), names, (set(names[1]), set(names[0])), strict=True)
        kept = [
            [line for line, name in zip(text, own, strict=True) if name in both]
            for text, own, both in pairs
        ]
        return kept[0], kept[1]
    return one, other


def _shared_keys(one, other):
    if isinstance(one, dict) and isinstance(other, dict):
        pairs = {key: _shared_keys(one[key], other[key]) for key in one if key in other}
        return {key: pair[0] for key, pair in pairs.items()}, {
            key: pair[1] for key, pair in pairs.items()
        }
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = [_shared_keys(*pair) for pair in zip(one, other, strict=True)]
        return [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    return one, other


def told(before: Outcome, after: Outcome, of_both: bool = False) -> list[str]:
    """Where two outcomes differ: of each part the first lines that do."""
    lines = []
    for part in dict.fromkeys([*before, *after]):
        one, other = before.get(part), after.get(part)
        if of_both and one is not None and other is not None:
            one, other = shared(one, other)
        if one == other:
            continue
        if one is None or other is None:
            lines.append(f"  {part}: only {'after' if one is None else 'before'}")
            continue
        pairs = itertools.zip_longest(one, other, fillvalue="(no line)")
        unequal = [(i + 1, *pair) for i, pair in enumerate(pairs) if pair[0] != pair[1]]
        lines.append(f"  {part}: {len(unequal)} of {len(one)} lines differ")
        for i, was, now in unequal[:SHOWN]:
            same = next(
                (j for j, pair in enumerate(zip(was, now, strict=False)) if pair[0] != pair[1]), 0
            )
            start = max(0, same - 40)
            lines += [
                f"    {i} - {was[start : start + 160]}",
                f"    {i} + {now[start : start + 160]}",
            ]
    return lines


def inputs_in(folder: Path) -> None:
    """Write what the cases read: models and records of this checkout, models of its READMEs, files
    of tests/fuzz."""
    with sandbox() as made:
        shutil.copytree(made, folder, ignore=shutil.ignore_patterns("made", "out"))
    for part in ("configs", "records"):
        shutil.copytree(readmes.ROOT / part, folder / part, ignore=shutil.ignore_patterns("*.png"))
    shutil.copy(HERE / CALLS, folder)
    for shown in ("workshop", "recorded", "campaign"):
        (folder / f"{shown}.yaml").write_text(readmes.block(shown), encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument(
        "--kept", type=Path, metavar="FILE.json", help="outcomes of BEFORE, kept for the next time"
    )
    parser.add_argument("--shared", action="store_true", help="compare what both have alone")
    given = parser.parse_args()
    chosen = {
        name: case
        for name, case in cases().items()
        if not given.names or name.startswith(tuple(given.names))
    }
    kept = json.loads(given.kept.read_text()) if given.kept and given.kept.exists() else {}
    places = bin_folder(given.before), bin_folder(given.after)
    differ = 0
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        inputs = Path(name) / "inputs"
        inputs_in(inputs)

        def one(case: tuple[str, list[str]]) -> tuple[str, Outcome, Outcome]:
            name, arguments = case
            was = kept.get(name)
            if was is None or was[0] != arguments:
                was = [arguments, outcome(places[0], inputs, arguments)]
            return name, was[1], outcome(places[1], inputs, arguments)

        for name, before, after in pool.map(one, chosen.items()):
            kept[name] = [chosen[name], before]
            lines = told(before, after, given.shared)
            differ += bool(lines)
            print(
                f"{name}: {'differs' if lines else 'same'} ({len(before)} parts)",
                *lines,
                sep="\n",
                flush=True,
            )
            if given.kept:
                given.kept.write_text(json.dumps(kept), encoding="utf-8")
    print(f"{differ} of {len(chosen)} cases differ")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
