"""The first run of a model, which is interpreted, and later runs, which are compiled, have the same
tables: for each law and each optional feature, in one cache, as a user runs them."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

import tdint
from csv_rows import rows
from tdint.assessment.validation.validation import pulse
from tdint.kernels.building import store
from validation.separate_solver import cases

TOLERANCE = 1e-8
"""Of a cell, divided by the largest number of its column: rounding, in iterations and where two
floors have nearly the same motion."""
DEADLINE = 1500.0
"""Time until all time loops are compiled, s."""


def run(folder, name, out, **settings):
    """Run a model in a separate process with the settings of a user; return True if its time loops
    were interpreted."""
    jobs = ("CI", "TDINT_KERNELS", "TDINT_COMPILE", "SLURM_JOB_ID", "PBS_JOBID", "LSB_JOBID")
    environment = {key: value for key, value in os.environ.items() if key not in jobs}
    command = [sys.executable, "-P", "-m", "tdint_cli", "run", f"{name}.yaml", "motion.csv"]
    command += ["--units", "m/s^2", "--history", "-o", out]
    process = subprocess.run(
        command,
        cwd=folder,
        env={**environment, "TDINT_CACHE_DIR": str(folder / "cache"), **settings},
        capture_output=True,
        text=True,
    )
    assert process.returncode == 0, process.stderr
    return "uncompiled time loops are used" in process.stderr


def wait_for_compilation(folder, deadline):
    """Wait until no process in the background compiles for the cache."""
    for file in (folder / "cache").rglob(".lock-beside"):
        with file.open("a") as stream:
            while not tdint.system.lock(stream.fileno()):
                assert time.monotonic() < deadline
                time.sleep(1.0)


def numbers(text):
    """Return the cells of a column; nan for a text."""
    values = []
    for cell in text:
        try:
            values.append(float(cell))
        except ValueError:
            values.append(np.nan)
    return np.array(values)


def assert_same_tables(first, second):
    """Compare all columns of all tables of two runs."""
    files = sorted(file.name for file in first.glob("*.csv"))
    assert files == sorted(file.name for file in second.glob("*.csv")) and "stories.csv" in files
    for name in files:
        before, after = rows(first / name), rows(second / name)
        assert len(before) == len(after) and before[0].keys() == after[0].keys()
        for column in before[0]:
            values, others = ([row[column] for row in table] for table in (before, after))
            if column.endswith("_error"):
                continue  # the difference of two runs, in which rounding is larger
            if not np.isfinite(found := numbers(values)).all():
                assert values == others, (name, column)
                continue
            difference = np.max(np.abs(found - numbers(others)), initial=0.0)
            largest = np.max(np.abs(found), initial=0.0)
            assert difference <= TOLERANCE * largest + 1e-13, (first.name, name, column)


@pytest.mark.skipif(
    store._PREBUILT.exists(), reason="this is a wheel with compiled loops: nothing is interpreted"
)
@pytest.mark.slow
def test_first_run_and_second_run_have_the_same_tables(tmp_path):
    # Inerters need no time loops: the matrices of the building are integrated by numpy.
    with_loops = [case for case in cases() if "inertance" not in case["model"]]
    names = [case["name"] for case in with_loops]
    for case in with_loops:
        (tmp_path / f"{case['name']}.yaml").write_text(case["model"])
    lines = (f"{0.02 * i:.2f},{value!r}\n" for i, value in enumerate(pulse().tolist()))
    (tmp_path / "motion.csv").write_text("time_s,acceleration\n" + "".join(lines))
    for name in names:
        assert run(tmp_path, name, f"interpreted/{name}", TDINT_COMPILE="never")
    # A run that finds no compiled loops starts their compilation; later runs find them.
    deadline = time.monotonic() + DEADLINE
    waiting, round_of_runs = names, 0
    while waiting:
        round_of_runs += 1
        assert time.monotonic() < deadline, f"still interpreted: {', '.join(waiting)}"
        interpreted = []
        for name in waiting:
            out = f"{round_of_runs}/{name}"
            if run(tmp_path, name, out):
                interpreted.append(name)
            assert_same_tables(tmp_path / "interpreted" / name, tmp_path / out)
        waiting = interpreted
        wait_for_compilation(tmp_path, deadline)
    assert round_of_runs > 1
