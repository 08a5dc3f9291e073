"""Measure the time of complete processes.

    python tests/benchmarks/processes.py [--first]

The first part is a Markdown table of commands with compiled kernels. Their wall and processor times
are divided by the times of `python -c "import numpy, click, yaml"`. All commands run alternately,
and the minimum times count. The second part compares the set-up of tall buildings with the time
integration.

With `--first`, some of the commands are measured once without compiled kernels instead. This takes
several minutes.
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
from tdint.response.runs.run import model_record

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
# Commands that are measured by `--first`.
FIRST = ("run ten-story.yaml", "run ten-story-bilinear.yaml", "spectrum near-fault.mseed")


def measure(command, **environment):
    """Run a command and return its wall and processor time with its children, s, as an array.

    Parameters
    ----------
    command : sequence of str or Path
        Program and arguments.
    **environment : str
        Additional environment variables.
    """
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        list(map(str, command)), check=True, capture_output=True, env={**os.environ, **environment}
    )
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime])


def minimum_times(commands, repeats):
    """Return the minimum wall and processor times, s, shape (commands, 2); the commands run
    alternately."""
    best = np.full((len(commands), 2), np.inf)
    for _ in range(repeats):
        for i, command in enumerate(commands):
            best[i] = np.minimum(best[i], measure(command))
    return best


def print_commands(commands, repeats=15):
    """Print the table of commands with compiled kernels.

    Parameters
    ----------
    commands : dict
        Arguments of `tdint` by the name of the row.
    repeats : int
        Number of measurements of each command.
    """
    # Compile the kernels before the measurement.
    for command in commands.values():
        measure((*TDINT, *command))
    imports, *times = minimum_times(
        [IMPORTS, *((*TDINT, *command) for command in commands.values())], repeats
    )
    print(
        "| process | wall ms | processor ms | wall / imports | processor / imports "
        "|\n|---|---|---|---|---|"
    )
    print(
        f"| import numpy, click, yaml | {imports[0] * 1e3:.0f} | {imports[1] * 1e3:.0f} | 1 | 1 |"
    )
    for name, (wall, processor) in zip(commands, times, strict=True):
        print(
            f"| {name} | {wall * 1e3:.0f} | {processor * 1e3:.0f} | {wall / imports[0]:.2f} | "
            f"{processor / imports[1]:.2f} |"
        )


def print_first_runs(names=FIRST):
    """Print the times of commands that compile their kernels, with an empty temporary cache.

    Parameters
    ----------
    names : sequence of str
        Keys of `COMMANDS`.
    """
    print("| first run | wall s | processor s |\n|---|---|---|")
    for name in names:
        with tempfile.TemporaryDirectory() as directory:
            wall, processor = measure(
                (*TDINT, *COMMANDS[name]), TDINT_CACHE_DIR=directory, TDINT_KERNELS_DIR=""
            )
        print(f"| {name} | {wall:.1f} | {processor:.1f} |", flush=True)


def write_tall_model(directory, stories):
    """Write a model file of equal stories with Rayleigh damping, and return its path.

    The story stiffness is proportional to the number of stories.
    """
    file = directory / f"{stories}-stories.yaml"
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


def print_set_up(file, samples):
    """Print the processor times of the set-up and of the time integration of a tall building.

    Parameters
    ----------
    file : Path
        Model file.
    samples : int
        Number of sampling intervals that are integrated. The time is extrapolated to the complete
        record.
    """
    times = []

    def call_timed(function, *arguments):
        """Call a function, append its processor time to `times`, and return its result."""
        start = time.process_time()
        result = function(*arguments)
        times.append(time.process_time() - start)
        return result

    model = call_timed(load_model, file)
    record = model_record(model)
    # A run of one step measures the set-up.
    one_step, many_steps = (
        replace(record, acceleration=record.acceleration[: count + 1]) for count in (1, samples + 1)
    )
    case = call_timed(prepare, model, one_step)
    call_timed(run_case, case)
    set_up = sum(times)
    call_timed(run_case, case.under(many_steps))
    # The difference of the last two runs, without the set-up that both contain.
    integration = (times[-1] - times[-2]) * (record.acceleration.size - 1) / samples
    print(
        f"{file.stem}: set-up {set_up:.2f} s, time integration {integration:.1f} s, ratio "
        f"{set_up / integration:.3f}",
        flush=True,
    )


def main():
    """Print the tables."""
    if "--first" in sys.argv:
        print_first_runs()
        return
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        tall_model = write_tall_model(directory, 1000)
        print_commands({**COMMANDS, "run 1000 stories": ("run", tall_model)})
        print()
        for stories, samples in ((1000, 4000), (20_000, 200), (100_000, 40)):
            print_set_up(write_tall_model(directory, stories), samples)


if __name__ == "__main__":
    main()
