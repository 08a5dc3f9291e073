"""Measure the cost of stories with two elements: two halves of a law instead of the law.

    python tests/benchmarks/elements.py [METHODS [LAW [REPETITIONS]]]

METHODS is a comma-separated list (default: all methods for nonlinear buildings), LAW `bilinear`
(default), `gap` or `bouc-wen`. The building has ten stories. Runs of both buildings alternate; the
ratios are those of the minima and of the medians of the processor time.
"""

import sys
import time
from statistics import median

import common  # noqa: F401  adds the directory of building_cases to the search path

from building_cases import noise
from tdint import load_model
from tdint.methods.catalogue import catalogue
from tdint.response.runs.run import prepare

STIFFNESS, STRENGTH = 3.5e8, 2.5e6  # N/m, N
LAWS = {
    "bilinear": {"type": "bilinear", "yield_force": STRENGTH, "hardening": 0.03},
    "gap": {"type": "gap", "gap": STRENGTH / STIFFNESS, "stop_stiffness": STIFFNESS},
    "bouc-wen": {
        "type": "bouc-wen",
        "yield_force": STRENGTH,
        "hardening": 0.03,
        "exponent": 1,
        "beta": 0.5,
    },
}
STEP = 0.01  # s, the sampling interval of the motion


def building(law, parts):
    """Return ten stories with the law in `parts` equal elements."""
    halved = {"yield_force", "stop_stiffness"}
    element = {key: value / parts if key in halved else value for key, value in law.items()}
    element["stiffness"] = STIFFNESS / parts
    story = {"repeat": 10, "mass": 2e5, "height": 3.5, "elements": [element] * parts}
    return load_model({"stories": [story], "damping": "3%"})


def measure(models, motion, method, repetitions):
    """Return the processor times (s) of the repetitions of each model."""
    cases = [prepare(model, motion, method=method) for model in models]
    steps = [case.steps(STEP) for case in cases]
    times = [[], []]
    for _ in range(repetitions):
        for case, case_steps, measured in zip(cases, steps, times, strict=True):
            start = time.process_time()
            case.integrate(case_steps)
            measured.append(time.process_time() - start)
    return times


def main(methods="", law="bilinear", repetitions="9"):
    """Print the ratios of each method."""
    models = [building(LAWS[law], parts) for parts in (1, 2)]
    motion = noise(samples=4001, dt=STEP, peak=6.0)
    nonlinear = [name for name in catalogue() if name != "exact"]
    print(f"{'method':20} {'ms':>7} {'minima':>7} {'medians':>7}")
    for method in methods.split(",") if methods else nonlinear:
        one, two = measure(models, motion, method, int(repetitions))
        ratios = [function(two) / function(one) for function in (min, median)]
        print(f"{method:20} {1e3 * min(one):7.1f} {ratios[0]:7.2f} {ratios[1]:7.2f}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
