"""Compare the wall time of `tdint.run_many` with the time of its compiled time loops.

    python tests/benchmarks/run_many.py [RUNS]

The building has one story; each run (default 10 000 runs) has 1000 steps and stores the histories
of drift and absolute acceleration. Two threads are used. The reference is the time of the
time loops of the same runs with a history on two threads. Both run alternately, and the minimum of
`REPEATS` times counts.
"""

import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import tdint
from tdint.methods.catalogue import parse
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.time_steps import Steps

RECORDS = 100
DT = 0.01  # s
STEPS = 1000
JOBS = 2
REPEATS = 5
LAW = {"type": "bilinear", "yield_force": 5e4, "hardening": 0.03}
BUILDING = {
    "stories": [{"mass": 1e5, "stiffness": 4e6, "law": LAW}],
    "damping": {"rayleigh": {"mass": 0.3, "stiffness": 0.0}},
}


def main():
    """Print the times and their ratios."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    generator = np.random.default_rng(1)
    noise = 2.0 * generator.standard_normal((RECORDS, STEPS + 1))
    records = [tdint.make_record(samples, dt=DT, units="m/s^2") for samples in noise]
    scales = np.linspace(0.1, 1.5, count // RECORDS)
    model = tdint.load_model(BUILDING)
    prepared, integrator, steps = PreparedBuilding.of(model), parse("impulse4"), Steps(DT, STEPS)

    def loop_time(some_records):
        """Return the sum of the times of the time loops for all scales of some records, s."""
        return sum(
            prepared.integrate(
                integrator, steps, scale * record.acceleration, history_rows=STEPS
            ).seconds
            for record in some_records
            for scale in scales
        )

    def loop_time_per_job():
        """Return the time of all time loops, distributed over the threads, s."""
        # Eight parts, so that both threads finish at about the same time.
        parts = [records[i::8] for i in range(8)]
        with ThreadPoolExecutor(JOBS) as pool:
            return sum(pool.map(loop_time, parts)) / JOBS

    def run_many_time(**options):
        """Return the wall time of `run_many`, s."""
        start = time.perf_counter()
        tdint.run_many(model, records, scales=scales, jobs=JOBS, **options)
        return time.perf_counter() - start

    quantities = ("drift", "absolute_acceleration")
    arrays = {
        name: np.zeros((len(scales) * RECORDS, STEPS + 1, 1), np.float32) for name in quantities
    }
    measurements = {
        "time loops": loop_time_per_job,
        "run_many": lambda: run_many_time(history=quantities),
        "with float32 arrays": lambda: run_many_time(history=quantities, out=arrays),
    }
    times = np.min(
        [[measure() for measure in measurements.values()] for _ in range(REPEATS)], axis=0
    )
    for name, seconds in zip(measurements, times, strict=True):
        per_run = 1e3 * seconds / (len(scales) * RECORDS)
        print(
            f"{name:20s} {seconds:6.2f} s, {per_run:.3f} ms per run, {seconds / times[0]:.2f} "
            "times the time loops"
        )


if __name__ == "__main__":
    main()
