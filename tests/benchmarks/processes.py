"""Whole processes against the imports of their packages, as a table: python
tests/benchmarks/processes.py [--first]

1. Commands with their kernels there, beside `python -c "import numpy, click, yaml"`. They take
  turns, the shortest time
   of each counts; processor time, wall time and the ratio of the latter.
2. Tall buildings: what is set up before the march, and the march.

With --first instead: the same commands with no compiled kernels anywhere, once each; this takes
some minutes.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import ROOT

from tdint import load_model, prepare, run_case
from tdint.analysis.run.run import model_record

RECORDS, CONFIGS = ROOT / "records", ROOT / "configs"
TDINT = (sys.executable, "-c", "from tdint_cli.main import main; main()")
IMPORTS = (sys.executable, "-c", "import numpy, click, yaml")
NEAR_FAULT = (RECORDS / "near-fault.mseed", "--component", "HN1", "--units", "m/s^2")
COMMANDS = {
    "run ten-story.yaml": ("run", CONFIGS / "ten-story.yaml"),
    "run ten-story-bilinear.yaml": ("run", CONFIGS / "ten-story-bilinear.yaml"),
    "spectrum near-fault.mseed": ("spectrum", *NEAR_FAULT),
    "methods": ("methods",),
    "modes ten-story.yaml": ("modes", CONFIGS / "ten-story.yaml"),
    "law ten-story-bilinear.yaml": (
        "law",
        CONFIGS / "ten-story-bilinear.yaml",
        "--story",
        "1",
        "--drift",
        "0.05",
    ),
    "--help": ("--help",),
}
FIRST = ("run ten-story.yaml", "run ten-story-bilinear.yaml", "spectrum near-fault.mseed")


def measured(command, **environment):
    """Wall and processor time of a process and its children, s."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        list(map(str, command)), check=True, capture_output=True, env={**os.environ, **environment}
    )
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime])


def shortest(commands, turns):
    """Shortest wall and processor time of each command, s, the commands taken in turns."""
    best = np.full((len(commands), 2), np.inf)
    for _ in range(turns):
        for i, command in enumerate(commands):
            best[i] = np.minimum(best[i], measured(command))
    return best


def print_commands(commands, turns=15):
    """The table of commands, given by name, whose kernels are compiled before a clock starts."""
    for command in commands.values():
        measured((*TDINT, *command))
    imports, *times = shortest(
        [IMPORTS, *((*TDINT, *command) for command in commands.values())], turns
    )
    print(
        "| process | wall ms | processor ms | over the imports, wall | processor "
        "|\n|---|---|---|---|---|"
    )
    print(
        f"| import numpy, click, yaml | {imports[0] * 1e3:.0f} | {imports[1] * 1e3:.0f} | 1 | 1 |"
    )
    for name, both in zip(commands, times, strict=True):
        ratio = both / imports
        print(
            f"| {name} | {both[0] * 1e3:.0f} | {both[1] * 1e3:.0f} | {ratio[0]:.2f} | "
            f"{ratio[1]:.2f} |"
        )


def print_first(targets=FIRST):
    """The table of first runs: no kernels are found, none are left."""
    print("| first run | wall s | processor s |\n|---|---|---|")
    for name in targets:
        with tempfile.TemporaryDirectory() as folder:
            wall, processor = measured(
                (*TDINT, *COMMANDS[name]), TDINT_CACHE_DIR=folder, TDINT_KERNELS_DIR=""
            )
        print(f"| {name} | {wall:.1f} | {processor:.1f} |", flush=True)


def tall(folder, stories):
    """A model file of equal stories with Rayleigh damping."""
    file = folder / f"{stories}-stories.yaml"
    file.write_text(
        f"name: {stories} stories\n"
        f"stories:\n  - {{repeat: {stories}, mass: 2e5, height: 3.5, stiffness: "
        f"{3.5e7 * stories:g}}}\n"
        "damping: {rayleigh: {ratio: 0.05, modes: [1, 2]}}\n"
        f"excitation: {{record: {{file: '{RECORDS / 'firm-soil.mseed'}', component: HN1, units: "
        f"m/s^2}}}}\n"
        "analysis: {method: impulse4}\n"
    )
    return file


def print_setting_up(file, samples):
    """What a tall building costs before the march, and the march over the whole record (from some
    samples of it)."""
    times = []

    def timed(function, *arguments):
        begin = time.process_time()
        result = function(*arguments)
        times.append(time.process_time() - begin)
        return result

    model = timed(load_model, file)
    record = model_record(model)
    few, many = (
        replace(record, acceleration=record.acceleration[: count + 1]) for count in (1, samples + 1)
    )
    case = timed(prepare, model, few)
    timed(run_case, case)
    setting_up = sum(times)
    timed(run_case, case.under(many))
    march = (times[-1] - times[-2]) * (record.acceleration.size - 1) / samples
    print(
        f"{file.stem}: set-up {setting_up:.2f} s, march {march:.1f} s, {setting_up / march:.3f} of "
        "it",
        flush=True,
    )


def main():
    """Print the tables."""
    if "--first" in sys.argv:
        print_first()
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print_commands({**COMMANDS, "run 1000 stories": ("run", tall(folder, 1000))})
        print()
        for stories, samples in ((1000, 4000), (20_000, 200), (100_000, 40)):
            print_setting_up(tall(folder, stories), samples)


if __name__ == "__main__":
    main()
