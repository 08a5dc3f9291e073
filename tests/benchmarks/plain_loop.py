"""Cost of a call of tdint over a plain compiled loop: python tests/benchmarks/plain_loop.py

The plain loop is 40 lines of average acceleration for bilinear stories, compiled with numba
(`march.plain_loop` with peak drifts). It is compared with `run_case` of impulse4 on ten random
bilinear buildings under the shipped motions, each with the longest time step that is within a
tolerance, as are all shorter steps. In addition, the time of `run_case` and `run` without error
estimate is compared with the time of their time loop on ten stories with 750 steps. All times are
processor times of the thread; the calls take turns in one process, and the minimum counts.

Results are written to plain_loop.csv and fixed_cost.csv, from which run.py makes tables.
"""

from __future__ import annotations

import csv
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
from common import NAMES, ROOT, components
from long_steps import random_bilinear

from tdint import load_model, prepare, run, run_case
from tdint.analysis.run.case import Case
from tdint.analysis.run.run import model_record
from tdint.arrays import Array
from tdint.ground_motion.record import Record
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.model.definition import Model

FILE = Path(__file__).with_name("plain_loop.csv")
FIXED = Path(__file__).with_name("fixed_cost.csv")
HEADS = ("building", "stories", "motion", "tolerance", "program", "dt_s", "error", "time_s")
FIXED_HEADS = ("call", "loop", "stories", "steps", "loop_s", "call_s")
BUILDINGS, SEED = 10, 69
TOLERANCES = (0.1, 0.01, 0.001, 0.0001, 0.00001)
PARTS = (8, 6, 4, 3, 2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 8, 1 / 16, 1 / 32, 1 / 64)
"""Time steps in sampling intervals."""
FINE = 128
"""Time steps of the reference, impulse4, per sampling interval."""
REPEATS = 15
SECONDS = 0.6
"""Maximum time of a run that is repeated `REPEATS` times, s, divided by `REPEATS`."""
STEPS, CALLS = 750, 400
"""Time steps and repetitions for the fixed cost."""


@numba.njit(error_model="numpy")
def plain_loop(m, k, strength, hardening, floor, damper, ground, h, peak):
    """Average acceleration with Newton's method, tridiagonal elimination, and peak drifts."""
    n = m.size
    u, v, a, z, d = np.zeros(n), np.zeros(n), np.full(n, -ground[0]), np.zeros(n), np.zeros(n)
    u1, v1, a1, z1, d1 = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    force, residual, diagonal, coupling = np.zeros(n + 1), np.zeros(n), np.zeros(n), np.zeros(n + 1)
    for s in range(1, ground.size):
        for i in range(n):
            u1[i] = u[i] + h * v[i]
        for _ in range(40):
            for i in range(n):
                a1[i] = 4.0 / h**2 * (u1[i] - u[i] - h * v[i]) - a[i]
                v1[i] = v[i] + 0.5 * h * (a[i] + a1[i])
            below_u = below_v = 0.0
            for i in range(n):
                d1[i] = u1[i] - below_u
                z1[i] = z[i] + (1.0 - hardening[i]) * k[i] * (d1[i] - d[i])
                tangent = k[i]
                if abs(z1[i]) > strength[i]:
                    z1[i] = strength[i] if z1[i] > 0.0 else -strength[i]
                    tangent = hardening[i] * k[i]
                force[i] = hardening[i] * k[i] * d1[i] + z1[i] + damper[i] * (v1[i] - below_v)
                spring = tangent + 2.0 / h * damper[i]
                diagonal[i] = m[i] * 4.0 / h**2 + 2.0 / h * floor[i] + spring
                coupling[i] = -spring
                below_u, below_v = u1[i], v1[i]
            for i in range(n):
                residual[i] = (
                    -m[i] * (ground[s] + a1[i]) - floor[i] * v1[i] - force[i] + force[i + 1]
                )
                if i < n - 1:
                    diagonal[i] -= coupling[i + 1]
            for i in range(1, n):
                w = coupling[i] / diagonal[i - 1]
                diagonal[i] -= w * coupling[i]
                residual[i] -= w * residual[i - 1]
            largest = correction = 0.0
            coupling[n] = 0.0
            for i in range(n - 1, -1, -1):
                correction = (residual[i] - coupling[i + 1] * correction) / diagonal[i]
                u1[i] += correction
                largest = max(largest, abs(correction))
            if largest < 1e-10:
                break
        for i in range(n):
            new = 4.0 / h**2 * (u1[i] - u[i] - h * v[i]) - a[i]
            v[i] += 0.5 * h * (a[i] + new)
            a[i], u[i], z[i], d[i] = new, u1[i], z1[i], d1[i]
            peak[i] = max(peak[i], abs(d1[i]))


def plain_call(case: Case, part: float) -> Callable[[], Array]:
    """Return a function that runs the plain loop with time steps of some sampling intervals.

    The arrays of the building are prepared; the ground acceleration at the time steps is
    interpolated in the call.
    """
    building, record = case.building, case.record
    assert record is not None
    n = building.stories
    hardening = building.law_parameters[rows.FIRST_PARAMETER + 1, :n].copy()
    arguments = (
        building.mass.copy(),
        building.law_parameters[rows.STIFFNESS, :n].copy(),
        (1.0 - hardening) * building.law_parameters[rows.FIRST_PARAMETER, :n],
        hardening,
        building.linear_terms[rows.FLOOR_DAMPER, :n].copy(),
        building.linear_terms[rows.STORY_DAMPER, :n].copy(),
    )
    ground, h = record.acceleration, part * record.dt
    samples = np.arange(ground.size, dtype=float)
    steps = math.ceil((ground.size - 1) / part - 1e-9)

    def call() -> Array:
        peak = np.zeros(n)
        shaking = np.interp(part * np.arange(steps + 1), samples, ground, right=0.0)
        plain_loop(*arguments, shaking, h, peak)
        return peak

    return call


def tdint_call(case: Case, part: float) -> Callable[[], Array]:
    """Return a function that calls `run_case` with time steps of some sampling intervals."""
    assert case.record is not None
    h = part * case.record.dt
    return lambda: run_case(case, dt=h, check=False).stories.peak_drift


def seconds(call: Callable[[], object]) -> float:
    """Return the processor time of a call, s."""
    begin = time.thread_time()
    call()
    return time.thread_time() - begin


def fastest(calls: Sequence[Callable[[], object]]) -> list[float]:
    """Return the minimum time of each call, s. The calls take turns."""
    best = [seconds(call) for call in calls]
    for _ in range(min(REPEATS, max(2, int(REPEATS * SECONDS / sum(best))))):
        best = [min(one, seconds(call)) for one, call in zip(best, calls, strict=True)]
    return best


def compare(number: int, model: Model, record: Record, motion: str) -> list[list[str]]:
    """Return the rows of a building: for each tolerance the times of both programs.

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
    case.prepared.compile([parse("impulse4")], own_loops=True)
    true = run_case(case, dt=record.dt / FINE, check=False).stories.peak_drift
    programs = {"plain loop": plain_call, "run_case": tdint_call}
    calls = {name: [make(case, part) for part in PARTS] for name, make in programs.items()}
    errors = {
        name: [float(np.max(np.abs(call() / true - 1.0))) for call in of_one]
        for name, of_one in calls.items()
    }
    found = []
    for tolerance in TOLERANCES:
        # The longest time step that is within the tolerance, as are all shorter ones
        chosen: dict[str, int] = {}
        for name, of_one in errors.items():
            beyond = [i for i, error in enumerate(of_one) if not error <= tolerance]
            first = beyond[-1] + 1 if beyond else 0
            if first < len(PARTS):
                chosen[name] = first
        times = fastest([calls[name][i] for name, i in chosen.items()])
        for (name, i), taken in zip(chosen.items(), times, strict=True):
            numbers = (PARTS[i] * record.dt, errors[name][i], taken)
            head = [str(number), str(case.building.stories), motion, f"{tolerance:g}", name]
            found.append([*head, *(f"{x:.4g}" for x in numbers)])
    return found


def fixed_costs() -> list[list[str]]:
    """Return the times of `run_case` and `run` and of their time loop, for ten stories."""
    model = load_model(ROOT / "configs" / "ten-story-bilinear.yaml")
    record = model_record(model)
    record = replace(record, acceleration=record.acceleration[: STEPS + 1].copy())
    case = prepare(model, record)
    case.prepared.compile([case.method], own_loops=True)
    calls = {
        "run_case, no error estimate": lambda: run_case(case, check=False),
        "run, no error estimate": lambda: run(model, record, check=False),
    }
    loop = math.inf
    best = dict.fromkeys(calls, math.inf)
    for _ in range(CALLS):
        for name, call in calls.items():
            begin = time.thread_time()
            response = call()
            best[name] = min(best[name], time.thread_time() - begin)
            loop = min(loop, response.solver_time)
    return [
        [name, "impulse4", str(case.building.stories), str(STEPS), f"{loop:.4g}", f"{one:.4g}"]
        for name, one in best.items()
    ]


def write(file: Path, heads: Sequence[str], found: Sequence[Sequence[str]]) -> None:
    """Write a CSV file."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerows([heads, *found])


def main() -> None:
    """Measure and write both files."""
    found = fixed_costs()
    write(FIXED, FIXED_HEADS, found)
    for row in found:
        print(*row, flush=True)
    rng, motions = np.random.default_rng(SEED), components()
    results = []
    for number in range(1, BUILDINGS + 1):
        i = number % len(motions)
        motion = f"{NAMES[i // 2]} {'first' if i % 2 == 0 else 'second'}"
        of_one = compare(number, random_bilinear(rng), motions[i], motion)
        results += of_one
        for row in of_one:
            print(*row, flush=True)
    write(FILE, HEADS, results)


if __name__ == "__main__":
    sys.exit(main())
