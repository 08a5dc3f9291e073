"""What `tdint.run_many` costs beside its compiled loops: python tests/benchmarks/run_many.py [RUNS]

One story, 1000 steps, histories of drift and absolute acceleration. Wall time on two threads, over
that of nothing but the loops of the same runs with a history on two threads; both in turns, the
least of five.
"""

import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import tdint
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.time_steps import Steps
from tdint.methods.catalogue import parse

RECORDS, DT, STEPS, JOBS, TURNS = 100, 0.01, 1000, 2, 5
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
    records = [tdint.make_record(one, dt=DT, units="m/s^2") for one in noise]
    scales = np.linspace(0.1, 1.5, count // RECORDS)
    model = tdint.load_model(BUILDING)
    prepared, integrator, steps = PreparedBuilding.of(model), parse("impulse4"), Steps(DT, STEPS)

    def loops(part):
        marched = (
            prepared.integrate(integrator, steps, scale * one.acceleration, history_rows=STEPS)
            for one in part
            for scale in scales
        )
        return sum(one.seconds for one in marched)

    def alone():
        with ThreadPoolExecutor(JOBS) as pool:
            return sum(pool.map(loops, [records[i::8] for i in range(8)])) / JOBS

    def clocked(**more):
        began = time.perf_counter()
        tdint.run_many(model, records, scales=scales, jobs=JOBS, **more)
        return time.perf_counter() - began

    kept = ("drift", "absolute_acceleration")
    out = {name: np.zeros((len(scales) * RECORDS, STEPS + 1, 1), np.float32) for name in kept}
    works = {
        "the loops": alone,
        "run_many": lambda: clocked(history=kept),
        "into given float32": lambda: clocked(history=kept, out=out),
    }
    found = np.min([[work() for work in works.values()] for _ in range(TURNS)], axis=0)
    for name, seconds in zip(works, found, strict=True):
        each = 1e3 * seconds / (len(scales) * RECORDS)
        print(
            f"{name:20s} {seconds:6.2f} s, {each:.3f} ms a run, {seconds / found[0]:.2f} times the "
            "loops"
        )


if __name__ == "__main__":
    main()
