"""Commands with --overwrite that are killed at random times: as soon as the next command uses the
directory, it has the earlier result or the new one, whole.

    python tests/faults/replaced.py [--kills 200] [--seed 0]
"""

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from faults.test_renaming import COMMANDS, files_of, prepare, write_inputs
from fuzz.sandbox import invoked
from tdint.files import check_outputs

Files = dict[str, bytes]


def prepared(name: str, start: Path) -> tuple[Path, str, Files, Files, float]:
    """Return a directory with the earlier result of a command, the command that replaces it, the
    files of the earlier and of the new result, and the time of the command, s."""
    old_folder, new_folder = (start.with_name(f"{name}-{kind}") for kind in ("old", "new"))
    shutil.copytree(start, old_folder)
    os.chdir(old_folder)
    new = prepare(name)
    shutil.copytree(old_folder, new_folder)
    os.chdir(new_folder)
    before = time.perf_counter()
    assert invoked(["-q", *new.split()])[0] == 0
    duration = time.perf_counter() - before
    return old_folder, new, files_of(str(old_folder)), files_of("."), duration


def killed(line: str, seconds: float) -> bool:
    """Start a command in a forked process and kill it after a time; return False if it was
    completed before."""
    child = os.fork()
    if child == 0:
        os._exit(invoked(["-q", *line.split()])[0])
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status) or status == 0, f"{line}: status {status}"
    return os.WIFSIGNALED(status)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    source, counts, kill_count, wrong = random.Random(arguments.seed), Counter[str](), 0, 0
    with tempfile.TemporaryDirectory() as name:
        start, folder = Path(name, "start"), Path(name, "killed")
        start.mkdir()
        os.chdir(start)
        write_inputs()
        cases = {command: prepared(command, start) for command in COMMANDS}
        while kill_count < arguments.kills:
            for command, (old_folder, line, old, new, duration) in cases.items():
                os.chdir(name)
                shutil.rmtree(folder, ignore_errors=True)
                shutil.copytree(old_folder, folder)
                os.chdir(folder)
                kill_count += killed(line, duration * source.uniform(0.1, 1.2))
                for output in ("out", "other"):
                    check_outputs([Path(output, "next.csv")], overwrite=False)
                found = files_of(".")
                kind = "old" if found == old else "new" if found == new else "MIXED"
                if kill_count % 4 == 0:  # the repeated command gives the new result
                    code, messages = invoked(["-q", *line.split()])
                    if code or files_of(".") != new:
                        kind = "REPETITION DIFFERS"
                        print(messages, file=sys.stderr)
                if kind not in ("old", "new"):
                    wrong += 1
                    print(f"{command}: {kind}: {sorted(found)}", file=sys.stderr)
                counts[f"{command}: {kind}"] += 1
            print(f"{kill_count} kills, {wrong} wrong", flush=True)
        os.chdir("/")
    for label, count in sorted(counts.items()):
        print(f"{label} {count}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
