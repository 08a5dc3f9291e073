"""Compare the output of two installed source trees byte by byte.

    python tests/benchmarks/same_bytes.py BEFORE AFTER [NAME ...] [--kept FILE.json] [--shared]

BEFORE and AFTER are directories with a `.venv`, or the `bin` directory or the `python` of an
environment. The two trees run the same cases:

- the sessions and scripts of the READMEs of this checkout,
- `--help` and invalid calls of every command,
- the scripts of `same_bytes.ini`,
- calls of the Python interface, with all arrays as float64 to the last bit.

For each case, the exit code, standard output, standard error and every written file are compared
(figures as SVG, databases by their rows). Wall times, versions and digests of sources are ignored
(`MASKS`, `MASKED_KEYS`, `MASKED_COLUMNS`, `TIME_COLUMNS`). Each tree uses separate kernels.

NAME selects the cases by the start of their names. `--kept` stores the outcomes of BEFORE in a
file, so that the next call runs only the missing cases of BEFORE. `--shared` ignores columns of
tables, keys of JSON files and arrays that only one tree provides. The exit code is 1 if an outcome
differs.
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
"""Result of a case: lines of text by `exit code`, `stdout`, `stderr`, and name of written file."""

csv.field_size_limit(2**30)  # arrays are printed on one line

SHOWN = 3
"""Number of different lines that are printed for each part of an outcome."""
MASKS = (
    (re.compile(r"[\d.e+-]+ (?:us|ms|s) per step"), "TIME per step"),
    (re.compile(r"^(Times are|Warning: timing was disturbed) .*"), "TIMES"),
    (re.compile(r"(?<=runs in )[\d.]+ m?s\b.*"), "TIME"),
    (re.compile(r"\b0\.\d+\.\d+(?:\+\w+)?\b"), "VERSION"),
)
"""Patterns of texts that may differ, with the words that replace them."""
MASKED_KEYS = {
    "wall_time_s", "time_loop_s", "processor_time_s", "timing", "versions", "tdint_version",
}  # fmt: skip
"""Keys of JSON files that are ignored."""
MASKED_COLUMNS = {"seconds"}
"""Columns of a database of results that are ignored."""

TIME_COLUMNS = ("time_s", "time_min_s")
"""Times in the table of `tdint chart`. They are ignored in tables that contain both columns."""

MAIN = """\
import inspect, json, sys
from click.testing import CliRunner
from tdint_cli.main import cli
streams = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}
for line in json.loads(sys.argv[1]):
    result = CliRunner(**streams).invoke(cli, line, prog_name="tdint", terminal_width=100)
    print("$ tdint", *line, f"-> {result.exit_code} {result.exception!r}")
    print(result.stdout + result.stderr)
"""
"""Program that runs command lines in one process, and prints their exit codes and outputs. It runs
`--help` and invalid calls, because the start of a process takes longer than these calls."""

CALLS = "same_bytes_arrays.py"
ARRAYS = {
    f"arrays-runs-{name}": ["runs", name]
    for name in ("ten-story", "ten-story-bilinear", "collapse-prone-frame")
}
ARRAYS |= {f"arrays-{name}": [name] for name in ("spectra", "statics", "studies")}
"""Arguments of `same_bytes_arrays.py` by the name of the case."""


def cases() -> dict[str, list[str]]:
    """Return the program (`python` or `bash`) and the arguments of each case, by its name."""
    settings = configparser.ConfigParser(interpolation=None, comment_prefixes=";")
    settings.read(HERE / "same_bytes.ini", encoding="utf-8")
    invalid_arguments = settings["invalid"]["arguments"].split("\n")
    invalid_lines = settings["invalid"]["lines"].split("\n")
    result = {name: ["bash", "-c", script] for name, script in settings["scripts"].items()}
    for readme in readmes.files():
        for i, session in enumerate(readmes.sessions(readme.read_text(encoding="utf-8"))):
            name = (
                str(readme.relative_to(readmes.ROOT).parent).replace("/", "-").strip(".")
                or "first-page"
            )
            result[f"session-{name}-{i + 1}"] = [
                "bash",
                "-c",
                "\n".join(command for command, _ in session),
            ]
    for block in ("shell", "law", "elastic", "inelastic", "drift", "batch", "first"):
        result[f"script-{block}"] = ["bash", "-eu", "-c", readmes.block(block)]
    helps = [*([name, "--help"] for name in settings["valid"]), ["--help"]]
    helps += [["campaign", name, "--help"] for name in ("status", "merge", "export")]
    result["help"] = ["python", "-c", MAIN, json.dumps(helps)]
    # Each command line is made invalid by one additional argument.
    for name, valid_arguments in settings["valid"].items():
        lines = [[name, *valid_arguments.split(), *more.split()] for more in invalid_arguments]
        lines += [line.split() for line in invalid_lines if line.split(" ")[0] == name]
        result[f"errors-{name}"] = ["python", "-c", MAIN, json.dumps(lines)]
    return result | {name: ["python", CALLS, *arguments] for name, arguments in ARRAYS.items()}


def bin_directory(tree: Path) -> Path:
    """Return the absolute directory of the programs `python` and `tdint` of a source tree.

    Parameters
    ----------
    tree : Path
        Directory with a `.venv`, environment, `bin` directory, or file `python`.
    """
    if tree.is_dir() and (tree / ".venv").is_dir():
        tree = tree / ".venv"
    directory = tree / "bin" if (tree / "bin").is_dir() else tree.parent if tree.is_file() else tree
    assert (directory / "python").exists(), f"{directory} does not contain python"
    return directory.absolute()


def outcome(bin_path: Path, inputs: Path, arguments: list[str]) -> Outcome:
    """Run a case in a temporary copy of the inputs and return its outcome.

    Parameters
    ----------
    bin_path : Path
        Result of `bin_directory`.
    inputs : Path
        Directory with the files of `write_inputs`.
    arguments : list of str
        `python` or `bash`, and its arguments.

    Raises
    ------
    subprocess.TimeoutExpired
        The case takes longer than 580 s.
    """
    environment = {
        key: value for key, value in os.environ.items() if not key.startswith(("TDINT_", "PYTHON"))
    }
    environment |= {
        "PATH": f"{bin_path}{os.pathsep}{os.environ['PATH']}",
        "COLUMNS": "100",
    }
    environment |= {"SOURCE_DATE_EPOCH": "0"}
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name) / "case"
        shutil.copytree(inputs, directory)
        input_times = {path: path.stat().st_mtime_ns for path in directory.rglob("*")}
        program = str(bin_path / "python") if arguments[0] == "python" else arguments[0]
        process = subprocess.run(
            [program, *arguments[1:]],
            cwd=directory,
            env=environment,
            capture_output=True,
            timeout=580.0,
        )
        messages = _masked(process.stderr.decode(errors="replace"), name)
        result = {
            "exit code": [str(process.returncode)],
            "stdout": _masked(process.stdout.decode(errors="replace"), name),
            # Kernels are compiled only in the first case that needs them.
            "stderr": [line for line in messages if not line.startswith("note: compiling")],
        }
        for path in sorted(directory.rglob("*")):
            is_written = path.is_file() and input_times.get(path) != path.stat().st_mtime_ns
            if is_written:
                result[str(path.relative_to(directory))] = _lines(path)
        return result


def _masked(text: str, directory: str) -> list[str]:
    """Return the lines of a text; the name of the temporary directory and the texts that match
    `MASKS` are replaced, and the columns of times of a table are omitted."""
    text = text.replace(directory, "FOLDER")
    header = text.partition("\n")[0].split(",")
    if set(TIME_COLUMNS) <= set(header):
        table = list(csv.reader(text.splitlines()))
        columns = [i for i, name in enumerate(table[0]) if name not in TIME_COLUMNS]
        text = "\n".join(",".join(row[i] for i in columns) for row in table)
    for pattern, word in MASKS:
        text = pattern.sub(word, text)
    return text.splitlines()


def _lines(path: Path) -> list[str]:
    """Return the content of a file as lines, without times and versions.

    Databases are returned as rows, JSON with one value per line, and other binary files as
    hexadecimal numbers of 32 bytes.
    """
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
    """Return the content of a JSON file without the keys of `MASKED_KEYS` at any depth."""
    if isinstance(content, dict):
        return {
            key: _without_times(value) for key, value in content.items() if key not in MASKED_KEYS
        }
    return [_without_times(value) for value in content] if isinstance(content, list) else content


def _rows(path: Path) -> list[str]:
    """Return the sorted rows of all tables of a database, with floats to the last bit.

    Rows with versions or digests are omitted.
    """
    with closing(sqlite3.connect(path)) as database:
        names = [
            row[0]
            for row in database.execute(
                "SELECT name FROM sqlite_master WHERE type='table' ORDER BY name"
            )
        ]
        # The second value of a row of table_info is the name of the column.
        columns_by_table = {
            name: [
                f"[{row[1]}]"  # columns such as `from` are words of SQL
                for row in database.execute(f"PRAGMA table_info({name})")
                if row[1] not in MASKED_COLUMNS
            ]
            for name in names
        }
        rows = [
            (name, row)
            for name, columns in columns_by_table.items()
            for row in database.execute(f"SELECT {', '.join(columns)} FROM {name}")
        ]
    texts = (
        f"{name} {[value.hex() if isinstance(value, float) else value for value in row]}"
        for name, row in rows
    )
    return sorted(
        line
        for text in texts
        for line in _masked(text, str(path.parent))
        if not re.search(r"[0-9a-f]{32}|VERSION", line)
    )


def shared_parts(first: list[str], second: list[str]) -> tuple[list[str], list[str]]:
    """Return two texts without the parts that only one of them contains.

    These parts are keys of JSON objects, columns of CSV tables, and lines of arrays that are
    printed by `same_bytes_arrays.py`. Texts of other types are returned unchanged.

    Parameters
    ----------
    first, second : list of str
        Lines of the texts.
    """
    if not first or not second:
        return first, second
    if first[0] == second[0] == "{":
        contents = _shared_keys(json.loads("\n".join(first)), json.loads("\n".join(second)))
        return tuple(json.dumps(content, indent=1).splitlines() for content in contents)  # type: ignore[return-value]
    tables = [list(csv.reader(text)) for text in (first, second)]
    # A CSV table has at least three columns, and all rows have the same number of columns.
    if all(len(table[0]) > 2 and len({len(row) for row in table}) == 1 for table in tables):
        names = [name for name in tables[0][0] if name in tables[1][0]]
        texts = []
        for table in tables:
            columns = [table[0].index(name) for name in names]
            texts.append([",".join(row[i] for i in columns) for row in table])
        return texts[0], texts[1]
    if all(any(" float64 " in line for line in text) for text in (first, second)):
        # The name of a line ends before the shape of an array or before the value of a number.
        first_names, second_names = (
            [re.split(r" \(\d|\s\S+$", line)[0] for line in text] for text in (first, second)
        )
        return _select(first, first_names, second_names), _select(second, second_names, first_names)
    return first, second


def _select(lines: list[str], names: list[str], wanted: list[str]) -> list[str]:
    """Return the lines whose name, at the same index of `names`, is in `wanted`."""
    selection = set(wanted)
    return [line for line, name in zip(lines, names, strict=True) if name in selection]


def _shared_keys(first, second):
    """Return two contents of JSON files with only the keys that both contain, at any depth."""
    if isinstance(first, dict) and isinstance(second, dict):
        pairs = {key: _shared_keys(first[key], second[key]) for key in first if key in second}
        return {key: pair[0] for key, pair in pairs.items()}, {
            key: pair[1] for key, pair in pairs.items()
        }
    if isinstance(first, list) and isinstance(second, list) and len(first) == len(second):
        pairs = [_shared_keys(*pair) for pair in zip(first, second, strict=True)]
        return [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    return first, second


def describe_differences(before: Outcome, after: Outcome, only_shared: bool = False) -> list[str]:
    """Return the differences of two outcomes as lines of text; empty if the outcomes are equal.

    For each part of an outcome, the first `SHOWN` different lines are shown, from 40 characters
    before the first different character.

    Parameters
    ----------
    before, after : dict of str to list of str
        Outcomes of the same case.
    only_shared : bool
        True to compare only the columns, keys and arrays that both outcomes contain.
    """
    lines = []
    for part in dict.fromkeys([*before, *after]):
        first, second = before.get(part), after.get(part)
        if only_shared and first is not None and second is not None:
            first, second = shared_parts(first, second)
        if first == second:
            continue
        if first is None or second is None:
            lines.append(f"  {part}: only {'after' if first is None else 'before'}")
            continue
        pairs = itertools.zip_longest(first, second, fillvalue="(no line)")
        unequal = [(i, *pair) for i, pair in enumerate(pairs, 1) if pair[0] != pair[1]]
        lines.append(f"  {part}: {len(unequal)} of {len(first)} lines differ")
        for number, old, new in unequal[:SHOWN]:
            first_difference = next(
                (j for j, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]), 0
            )
            start = max(0, first_difference - 40)
            lines += [
                f"    {number} - {old[start : start + 160]}",
                f"    {number} + {new[start : start + 160]}",
            ]
    return lines


def write_inputs(directory: Path) -> None:
    """Create a directory with the input files of all cases: the files of tests/fuzz, configs and
    records of this checkout, the program for arrays, and the models in its READMEs."""
    with sandbox() as source:
        shutil.copytree(source, directory, ignore=shutil.ignore_patterns("made", "out"))
    for part in ("configs", "records"):
        shutil.copytree(
            readmes.ROOT / part, directory / part, ignore=shutil.ignore_patterns("*.png")
        )
    shutil.copy(HERE / CALLS, directory)
    for name in ("workshop", "recorded", "campaign"):
        (directory / f"{name}.yaml").write_text(readmes.block(name), encoding="utf-8")


def main() -> int:
    """Run the selected cases with both trees, print the differences, and return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument(
        "--kept",
        dest="stored",
        type=Path,
        metavar="FILE.json",
        help="file of the outcomes of BEFORE",
    )
    parser.add_argument(
        "--shared",
        action="store_true",
        help="compare only columns, keys and arrays that both outcomes contain",
    )
    options = parser.parse_args()
    selected_cases = {
        name: case
        for name, case in cases().items()
        if not options.names or name.startswith(tuple(options.names))
    }
    # Arguments and outcome of BEFORE by the name of the case. An outcome is used again if the
    # arguments of the case have not changed.
    stored = {}
    if options.stored and options.stored.exists():
        stored = json.loads(options.stored.read_text())
    before_path, after_path = bin_directory(options.before), bin_directory(options.after)
    different_cases = 0
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(2) as pool:
        inputs = Path(temporary) / "inputs"
        write_inputs(inputs)

        def run_case(case: tuple[str, list[str]]) -> tuple[str, Outcome, Outcome]:
            """Return the name of a case and its outcomes in both trees."""
            name, arguments = case
            stored_arguments, before = stored.get(name, (None, {}))
            if stored_arguments != arguments:
                before = outcome(before_path, inputs, arguments)
            return name, before, outcome(after_path, inputs, arguments)

        for name, before, after in pool.map(run_case, selected_cases.items()):
            stored[name] = [selected_cases[name], before]
            # Programs of this repository must not fail, or nothing is compared.
            if selected_cases[name][0] == "python" and after["exit code"] != ["0"]:
                sys.exit("\n".join([f"{name} failed:", *after["stderr"]]))
            lines = describe_differences(before, after, options.shared)
            different_cases += bool(lines)
            print(
                f"{name}: {'differs' if lines else 'same'} ({len(before)} parts)",
                *lines,
                sep="\n",
                flush=True,
            )
            if options.stored:
                options.stored.write_text(json.dumps(stored), encoding="utf-8")
    print(f"{different_cases} of {len(selected_cases)} cases differ")
    return 1 if different_cases else 0


if __name__ == "__main__":
    sys.exit(main())
