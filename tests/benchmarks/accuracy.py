"""Measure the errors of methods for the ten-story bilinear building.

    python tests/benchmarks/accuracy.py

Prints a Markdown table of errors and times per step for several methods and time steps. The
reference solution is `impulse4` with dt/256. Average acceleration, extrapolated from dt/512 and
dt/1024, confirms it. Times are those of the time loop, the minimum of `REPEATS` runs; the methods
run alternately.
"""

from itertools import product

import numpy as np
from common import ROOT

from tdint import load_model, run

MODEL = load_model(ROOT / "configs" / "ten-story-bilinear.yaml")
DT = 0.01  # s; sampling interval of the record
METHODS = (
    "newmark-average", "generalized-alpha", "bathe", "impulse", "gauss4", "impulse4:rho_inf=0.5",
    "impulse4",
)  # fmt: skip
STEPS_PER_SAMPLE = (1, 2, 4)
REPEATS = 9


def run_with_history(method, steps_per_sample):
    """Return the displacements at the samples of the record, shape (samples, stories), in m, and
    the response."""
    response = run(MODEL, method=method, dt=DT / steps_per_sample, history=True)
    return response.history.displacement[::steps_per_sample], response


def seconds_per_step(method, steps_per_sample):
    """Return the time of the time loop per step, s."""
    response = run(MODEL, method=method, dt=DT / steps_per_sample)
    return response.solver_time / response.steps


def main():
    """Print the difference of the two references and the table."""
    reference, response = run_with_history("impulse4", 256)
    reference_drift = response.stories.peak_drift
    reference_norm = np.linalg.norm(reference)
    # Richardson extrapolation of a method of order 2 from two steps h and h/2: (4 fine - coarse)/3.
    coarse, fine = (run_with_history("newmark-average", count)[0] for count in (512, 1024))
    gap = np.linalg.norm((4.0 * fine - coarse) / 3.0 - reference) / reference_norm
    print(
        f"difference of the reference solutions {gap:.1e}, branch changes "
        f"{response.branch_changes}\n"
    )
    cases = list(product(METHODS, STEPS_PER_SAMPLE))
    times = np.min([[seconds_per_step(*case) for case in cases] for _ in range(REPEATS)], axis=0)
    print(
        "| method | dt (s) | L2 error | maximum error of a peak drift | energy error | us per step "
        "|"
    )
    print("|---|---|---|---|---|---|")
    for (method, steps_per_sample), seconds in zip(cases, times, strict=True):
        displacement, response = run_with_history(method, steps_per_sample)
        l2 = np.linalg.norm(displacement - reference) / reference_norm
        drift_error = np.max(np.abs(response.stories.peak_drift / reference_drift - 1.0))
        energy_error = abs(response.energy.error)
        print(
            f"| {method} | {DT / steps_per_sample:g} | {l2:.1e} | {drift_error:.1e} | "
            f"{energy_error:.1e} | {seconds * 1e6:.2f} |"
        )


if __name__ == "__main__":
    main()
