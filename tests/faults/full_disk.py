"""System calls that fail at each position: a full disk at each write, synchronization, change of
size and renaming, while a campaign is run, continued, merged or exported, or a run is written.

    python tests/faults/full_disk.py [--every 1] [--seed 0] [--scene campaign]

The C compiler builds faults.c, which is loaded before the C library. A command that meets the fault
ends with exit code 6 or 0 and one line, and leaves no file in part: a file has its earlier or its
new content, or its new content waits under a temporary name that a journal lists. After that, the
same command without a fault writes the same bytes as a command that met no fault.
"""

import argparse
import ctypes
import errno
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.sandbox import invoked
from tdint.files import _JOURNAL, _Journal

CALLS = ("write", "sync", "rename", "truncate", "lock")
"""Types of calls in the order of the constants in faults.c."""

ERRORS = {"write": errno.ENOSPC, "sync": errno.EIO, "rename": errno.ENOSPC,
          "truncate": errno.ENOSPC, "lock": errno.ENOLCK}  # fmt: skip

MODEL = """\
name: fault
stories: [{mass: 10000, height: 3, stiffness: 8000000}]
excitation: {record: {file: r.csv, units: m/s^2}}
analysis: {method: newmark-average, duration: 0.3}
"""
STUDY = """\
buildings: {models: [model.yaml]}
records: {files: [r.csv]}
intensity: {scales: [0.5, 1, 2, 4]}
analysis: {method: newmark-average}
outputs: {stories: true}
"""
RECORD = "# dt = 0.01 s, units = m/s^2, samples = 30\n" + "1\n-1\n0.5\n" * 10


@dataclass(frozen=True)
class Scene:
    """Command lines after `tdint`.

    Attributes
    ----------
    before : tuple of str
        Commands that are executed without a fault.
    line : str
        Command that meets the fault. It writes to the directory `out`.
    again : str
        Option of the command that repeats it, if its results may exist already.
    """

    before: tuple[str, ...]
    line: str
    again: str = ""


SCENES = {
    "campaign": Scene((), "campaign study.yaml -o out"),
    "continued campaign": Scene(
        ("campaign study.yaml -o out --max-runs 1",), "campaign study.yaml -o out"
    ),
    "export": Scene(("campaign study.yaml -o out",), "campaign export out --simcenter"),
    "merge": Scene(
        ("campaign study.yaml -o one --shard 1/2", "campaign study.yaml -o two --shard 2/2"),
        "campaign merge one two -o out",
    ),
    "run": Scene((), "run model.yaml --history -o out", "--overwrite"),
    "ida": Scene((), "ida model.yaml r.csv --precision 40% --max-im 1g -o out"),
}

_STORE = (".sqlite", "-wal", "-shm", "-journal", ".lock")
"""Suffixes of the files of a store, which are not compared, because they contain times."""

_MEASURED = re.compile(rb'"(processor_time|wall_time|time_loop)_s": [-+.e0-9]+')


def built() -> Path:
    """Build the library and return its path."""
    library = Path(tempfile.mkdtemp(prefix="faults-"), "faults.so")
    source = Path(__file__).with_name("faults.c")
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"], check=True
    )
    return library


class Failure(AssertionError):
    """Error: forbidden behavior."""


def _contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a directory that are compared, by name, without measured times."""
    return {
        path.name: _MEASURED.sub(b"", path.read_bytes())
        for path in sorted(folder.glob("*"))
        if path.is_file() and not path.name.endswith(_STORE)
    }


def forked(line: str, fault: Callable[[], None] = lambda: None) -> tuple[int, str, list[int]]:
    """Run a command in a forked process, which calls `fault` first. Return its exit code, its
    messages and the number of calls of each type."""
    library = ctypes.CDLL(None)
    with tempfile.TemporaryFile() as report:
        child = os.fork()
        if child == 0:
            fault()
            code, messages = invoked(line.split())
            counts = [library.count_of(number) for number in range(len(CALLS))]
            os.write(report.fileno(), f"{code} {counts}\n{messages}".encode())
            os._exit(0)
        _, status = os.waitpid(child, 0)
        report.seek(0)
        head, _, messages = report.read().decode().partition("\n")
        if status or not head:
            raise Failure(f"{line}: the process ended with status {status}")
        code_text, _, counts_text = head.partition(" ")
        return int(code_text), messages, [int(item) for item in counts_text[1:-1].split(",")]


def _prepare(scene: Scene) -> None:
    """Empty the working directory, and run the commands that precede the fault."""
    for path in Path().iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    for name, text in (("model.yaml", MODEL), ("study.yaml", STUDY), ("r.csv", RECORD)):
        Path(name).write_text(text)
    for line in scene.before:
        code, messages, _ = forked(line)
        if code:
            raise Failure(f"{line}: exit code {code}: {messages}")


def positions(name: str, every: int, source: random.Random) -> Iterator[tuple[str, int, bool]]:
    """Yield the faults of a scene: type of the call, its number, and True if it lasts."""
    scene = SCENES[name]
    _prepare(scene)
    folder = str(Path("out").absolute())
    _, _, counts = forked(scene.line, lambda: _set(CALLS.index("lock"), 0, False, folder))
    for call, count in zip(CALLS, counts, strict=True):
        # Each type of call fails at least once.
        for number in range(1 + source.randrange(min(every, count) or 1), count + 1, every):
            yield call, number, False
            # A command waits several seconds for a lock; a lock that fails always is tried once.
            if call != "lock" or number == 1:
                yield call, number, True


def _set(call: int, number: int, lasts: bool, folder: str) -> None:
    """Set the fault of this process."""
    ctypes.CDLL(None).set_fault(
        call, ctypes.c_long(number), int(lasts), ERRORS[CALLS[call]], folder.encode()
    )


def check(name: str, call: str, number: int, lasts: bool, expected: dict[str, bytes]) -> str:
    """Run a scene with a fault; return the outcome.

    Raises
    ------
    Failure
        The exit code or the messages are wrong, a file is incomplete, or the repeated command
        writes other bytes.
    """
    scene, folder = SCENES[name], Path("out")
    label = f"{name}: {call} {number}{' and all later' if lasts else ''}"
    _prepare(scene)
    before = _contents(folder)
    absolute = str(folder.absolute())
    code, messages, _ = forked(scene.line, lambda: _set(CALLS.index(call), number, lasts, absolute))
    lines = [line for line in messages.splitlines() if line.startswith("Error: ")]
    if code not in (0, 6) or (code == 6) != (len(lines) == 1) or "Traceback" in messages:
        raise Failure(f"{label}: exit code {code}: {messages[-500:]}")
    # A failed renaming is completed by the next command that reads or writes in the directory.
    journal = folder / _JOURNAL
    final_names = (
        _Journal(*json.loads(journal.read_bytes().partition(b"\n")[2])).renamed
        if journal.exists()
        else {}
    )
    for file, content in _contents(folder).items():
        final = final_names.get(file, file)
        if content not in (before.get(final), expected.get(final)):
            raise Failure(f"{label}: {file} is left with other contents, exit code {code}")
    if code == 0 and _contents(folder) != expected:
        raise Failure(f"{label}: exit code 0, but files are missing")
    repeated = f"{scene.line} {scene.again}" if folder.exists() else scene.line
    again, messages, _ = forked(repeated)
    left = [path.name for path in folder.glob("*") if path.name.endswith(_STORE[1:4])]
    if again or left or _contents(folder) != expected:
        names = sorted({*_contents(folder)} ^ {*expected}) + left
        raise Failure(f"{label}: repeated with exit code {again}, {names}: {messages[-500:]}")
    return "done" if code == 0 else "reported"


def outcomes(name: str, every: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Return the outcomes of the faults of a scene, and a line for each failure."""
    counts: Counter[str] = Counter()
    failures: list[str] = []
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            _prepare(SCENES[name])
            # The first command of this process loads the modules and kernels for its forks.
            code, messages = invoked(SCENES[name].line.split())
            assert code == 0, messages
            # A repeated command records other arguments only if it has another option.
            expected = _contents(Path("out"))
            for call, number, lasts in list(positions(name, every, random.Random(seed))):
                try:
                    counts[check(name, call, number, lasts, expected)] += 1
                except Failure as failure:
                    failures.append(str(failure))
                    print(failures[-1], file=sys.stderr, flush=True)
        finally:
            os.chdir(before)
    return counts, failures


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scene", choices=SCENES)
    arguments = parser.parse_args()
    if "faults.so" not in os.environ.get("LD_PRELOAD", ""):
        os.environ["LD_PRELOAD"] = str(built())
        os.execv(sys.executable, [sys.executable, *sys.argv])
    with suppress(KeyError):
        library = os.environ.pop("LD_PRELOAD")
        shutil.rmtree(Path(library).parent, ignore_errors=True)
    # The kernels are loaded before the process is forked.
    os.environ["TDINT_COMPILE"] = "wait"
    print("| scene | faults | reported | done | FAILED |")
    print("|---|---:|---:|---:|---:|")
    failed = 0
    for name in [arguments.scene] if arguments.scene else SCENES:
        counts, failures = outcomes(name, arguments.every, arguments.seed)
        total = sum(counts.values()) + len(failures)
        print(
            f"| {name} | {total} | {counts['reported']} | {counts['done']} | {len(failures)} |",
            flush=True,
        )
        failed += len(failures)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
