"""Compare the processor time of calls of tdint with a plain compiled loop.

    python tests/benchmarks/plain_loop.py

The plain loop is 40 lines of average acceleration for bilinear stories, compiled with numba. It is
compared with `run_case` of impulse4 for ten random bilinear buildings under the ground motions of
records. Each program uses the longest time step for which it and all shorter steps meet a
tolerance. In addition, the time of `run_case` and `run` without error estimate is compared with the
time of their time loop for ten stories with 750 steps. All times are processor times of the thread;
the calls run alternately in one process, and the minimum counts.

Results are written to plain_loop.csv and fixed_cost.csv, and run.py writes tables from these files.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import raw_points
from common import NAMES, ROOT, components, minimum_times
from long_steps import random_bilinear
from newmark_loop import loop_arguments, plain_loop

from tdint import load_model, prepare, run, run_case
from tdint.arrays import Array
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import parse
from tdint.model.definition import Model
from tdint.response.runs.case import Case
from tdint.response.runs.run import model_record

FILE = Path(__file__).with_name("plain_loop.csv")
FIXED = Path(__file__).with_name("fixed_cost.csv")
HEADS = ("building", "stories", "motion", "tolerance", "program", "dt_s", "error", "time_s")
FIXED_HEADS = ("call", "loop", "stories", "steps", "loop_s", "call_s")
BUILDINGS, SEED = 10, 69
TOLERANCES = (0.1, 0.01, 0.001, 0.0001, 0.00001)
STEP_LENGTHS = (8, 6, 4, 3, 2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 8, 1 / 16, 1 / 32, 1 / 64)
"""Time steps in sampling intervals."""
FINE = 128
"""Time steps of the reference, impulse4, per sampling interval."""
REPEATS = 15
SECONDS = 0.6
"""Maximum time of one repetition of all calls, s. If it takes longer, there are fewer repetitions
than `REPEATS`."""
STEPS, CALLS = 750, 400
"""Time steps and repetitions for the fixed cost."""


def plain_call(case: Case, part: float) -> Callable[[], Array]:
    """Return a function that runs the plain loop and returns the peak drifts, m.

    The arrays of the building are prepared here. The ground acceleration at the time steps is
    interpolated in the call.

    Parameters
    ----------
    case : Case
        Building and ground motion.
    part : float
        Time step, sampling intervals.
    """
    building, record = case.building, case.record
    assert record is not None
    arguments = loop_arguments(building)
    ground, h = record.acceleration, part * record.dt
    samples = np.arange(ground.size, dtype=float)
    steps = math.ceil((ground.size - 1) / part - 1e-9)

    def call() -> Array:
        peak = np.zeros(building.stories)
        shaking = np.interp(part * np.arange(steps + 1), samples, ground, right=0.0)
        plain_loop(*arguments, shaking, h, peak)
        return peak

    return call


def tdint_call(case: Case, part: float) -> Callable[[], Array]:
    """Return a function that calls `run_case` with time steps of `part` sampling intervals, and
    returns the peak drifts, m."""
    assert case.record is not None
    h = part * case.record.dt
    return lambda: run_case(case, dt=h, check=False).stories.peak_drift


def fastest(calls: Sequence[Callable[[], object]]) -> list[float]:
    """Return the minimum time of each call, s. The calls run alternately."""
    first_times = minimum_times(calls, 1, time.thread_time)
    repeats = min(REPEATS, max(2, int(REPEATS * SECONDS / sum(first_times))))
    return list(map(min, first_times, minimum_times(calls, repeats, time.thread_time)))


def compare(number: int, model: Model, record: Record, motion: str) -> list[list[str]]:
    """Return the rows of plain_loop.csv for a building (columns `HEADS`).

    There is a row for each tolerance and program. Programs that do not meet a tolerance with any
    time step have no row.

    Parameters
    ----------
    number : int
        Number of the building.
    model, record : Model, Record
        Building and ground motion.
    motion : str
        Name of the ground motion.
    """
    case = prepare(model, record, method="impulse4")
    case.prepared.compile([parse("impulse4")])
    true = run_case(case, dt=record.dt / FINE, check=False).stories.peak_drift
    programs = {"plain loop": plain_call, "run_case": tdint_call}
    calls = {name: [make(case, part) for part in STEP_LENGTHS] for name, make in programs.items()}
    errors = {
        name: [float(np.max(np.abs(call() / true - 1.0))) for call in calls_of_program]
        for name, calls_of_program in calls.items()
    }
    rows = []
    for tolerance in TOLERANCES:
        # Index of the longest time step for which it and all shorter steps meet the tolerance.
        chosen: dict[str, int] = {}
        for name, errors_of_program in errors.items():
            # The negation includes errors that are nan.
            too_large = [i for i, error in enumerate(errors_of_program) if not error <= tolerance]
            first = too_large[-1] + 1 if too_large else 0
            if first < len(STEP_LENGTHS):
                chosen[name] = first
        times = fastest([calls[name][i] for name, i in chosen.items()])
        for (name, i), seconds in zip(chosen.items(), times, strict=True):
            numbers = (STEP_LENGTHS[i] * record.dt, errors[name][i], seconds)
            head = [str(number), str(case.building.stories), motion, f"{tolerance:g}", name]
            rows.append([*head, *(f"{value:.4g}" for value in numbers)])
    return rows


def fixed_costs() -> list[list[str]]:
    """Return the rows of fixed_cost.csv (columns `FIXED_HEADS`): the times of `run_case` and `run`
    and of their time loop, for ten stories."""
    model = load_model(ROOT / "configs" / "ten-story-bilinear.yaml")
    record = model_record(model)
    record = replace(record, acceleration=record.acceleration[: STEPS + 1].copy())
    case = prepare(model, record)
    case.prepared.compile([case.method])
    calls = {
        "run_case, no error estimate": lambda: run_case(case, check=False),
        "run, no error estimate": lambda: run(model, record, check=False),
    }
    loop = math.inf
    best = dict.fromkeys(calls, math.inf)
    for _ in range(CALLS):
        for name, call in calls.items():
            start = time.thread_time()
            response = call()
            best[name] = min(best[name], time.thread_time() - start)
            loop = min(loop, response.solver_time)
    return [
        [name, "impulse4", str(case.building.stories), str(STEPS), f"{loop:.4g}", f"{call:.4g}"]
        for name, call in best.items()
    ]


def main() -> None:
    """Measure and write both files."""
    rows = fixed_costs()
    raw_points.write(FIXED, FIXED_HEADS, rows)
    for row in rows:
        print(*row, flush=True)
    rng, motions = np.random.default_rng(SEED), components()
    results = []
    for number in range(1, BUILDINGS + 1):
        # `components` returns the two components of each name of `NAMES` in sequence.
        i = number % len(motions)
        motion = f"{NAMES[i // 2]} {'first' if i % 2 == 0 else 'second'}"
        rows = compare(number, random_bilinear(rng), motions[i], motion)
        results += rows
        for row in rows:
            print(*row, flush=True)
    raw_points.write(FILE, HEADS, results)


if __name__ == "__main__":
    sys.exit(main())
