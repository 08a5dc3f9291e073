"""Error of the ten-story bilinear building over method and step: python
tests/benchmarks/accuracy.py

Prints a table in Markdown. The reference is impulse4 at dt/256; average acceleration extrapolated
from dt/512 and dt/1024 confirms it. Times are those of the march alone, the fastest of several, the
methods taking turns.
"""

from itertools import product

import numpy as np
from common import ROOT

from tdint import load_model, run

MODEL = load_model(ROOT / "configs" / "ten-story-bilinear.yaml")
DT = 0.01
METHODS = (
    "newmark-average",
    "generalized-alpha",
    "bathe",
    "impulse",
    "gauss4",
    "impulse4:rho_inf=0.5",
    "impulse4",
)
PARTS = (1, 2, 4)
REPEATS = 9


def displacement(method, parts):
    """Displacements at the record's samples, and the response."""
    response = run(MODEL, method=method, dt=DT / parts, history=True)
    return response.history.displacement[::parts], response


def seconds_per_step(method, parts):
    response = run(MODEL, method=method, dt=DT / parts)
    return response.solver_time / response.steps


def main():
    """Print the table."""
    reference, response = displacement("impulse4", 256)
    peak = response.stories.peak_drift
    size = np.linalg.norm(reference)
    coarse, fine = (displacement("newmark-average", parts)[0] for parts in (512, 1024))
    gap = np.linalg.norm((4.0 * fine - coarse) / 3.0 - reference) / size
    print(f"gap between the references {gap:.1e}, events {response.branch_changes}\n")
    cases = list(product(METHODS, PARTS))
    times = np.min([[seconds_per_step(*case) for case in cases] for _ in range(REPEATS)], axis=0)
    print(
        "| method | dt (s) | L2 error | largest error of a peak drift | energy error | us per step "
        "|"
    )
    print("|---|---|---|---|---|---|")
    for (method, parts), seconds in zip(cases, times, strict=True):
        u, response = displacement(method, parts)
        l2 = np.linalg.norm(u - reference) / size
        drift = np.max(np.abs(response.stories.peak_drift / peak - 1.0))
        energy = abs(response.energy.error)
        print(
            f"| {method} | {DT / parts:g} | {l2:.1e} | {drift:.1e} | {energy:.1e} | "
            f"{seconds * 1e6:.2f} |"
        )


if __name__ == "__main__":
    main()
