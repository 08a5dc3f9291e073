"""Compare additional runs that estimate the errors of `impulse4` where forces change abruptly.

    python tests/grid/additional_runs.py [--seed SEED] [--cases COUNT]

draws buildings of covering arrays that have power-law dashpots, braces of dampers or tangent
damping. The true values are those of `gauss4`, or of `moment4` for buildings that `gauss4` refuses,
with a sixteenth of a sample; their difference from `impulse4` is not counted as an error. The table
has the number of values whose error exceeds twice and ten times the estimate, the share of
estimates more than ten times too large, and the processor time of the runs with their estimates.
"""

import argparse
import os
import random
import sys
import time
import warnings
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("TDINT_COMPILE", "wait")

import numpy as np

from grid.axes import build
from grid.covering import covering_rows
from grid.judge import RESOLUTION, attempt, model_of, motion_of
from tdint.methods.catalogue import parse
from tdint.response.runs import error_estimate
from tdint.response.time_steps import finer

DAMPERS = ("relief", "mixed", "braced power .35", "power .35")
QUANTITIES = ("peak_drift", "peak_shear", "peak_total_shear", "peak_velocity", "residual_drift",
              "peak_absolute_acceleration")  # fmt: skip
STEPS = (0.5, 1.0, 2.0)  # sampling intervals
SIXTEENTH = 1.0 / 16.0
WAYS = {"impulse4 1/2": 1, "impulse4 1/4": 2, "moment4 1/2": 1, "moment4 1/4": 2}
"""Method and step of the additional run, and how often the step is halved."""


def abrupt_cases(seed, count):
    """Yield cases with abrupt forces and their models."""
    generator, made, number = random.Random(seed), 0, 0
    while made < count:
        for row in covering_rows([], generator.random()):
            if row["damper"] in DAMPERS or row["damping"] == "tangent":
                number += 1
                case = build(row, 10_000 * (seed + 1) + number)
                if made < count and (model := model_of(case)) is not None:
                    made += 1
                    yield case, model


def estimated_by(way):
    """Let the additional runs of `impulse4` have a method and a step of `WAYS`."""
    method, halvings = parse(way.partition(" ")[0]), WAYS[way]

    def steps(case, shorter):
        for _ in range(halvings):
            shorter = finer(shorter)
        return shorter

    error_estimate.reference_method = lambda case: method
    error_estimate.reference_steps = steps


def compare(case, model, counts, seconds):
    """Add the values of a case to the counts and times of all ways."""
    interval, motion = case.interval, motion_of(case)
    solutions = [
        attempt(model, motion, method, SIXTEENTH * interval, case.duration, check=False)
        for method in ("gauss4", "moment4", "impulse4")
    ]
    solved = [item for item in solutions if not isinstance(item, tuple)]
    if len(solved) < 2:
        return
    true, other = solved[0], solved[-1]
    for samples in STEPS:
        for way in WAYS:
            estimated_by(way)
            start = time.thread_time()
            response = attempt(model, motion, "impulse4", samples * interval, case.duration)
            seconds[way] += time.thread_time() - start
            if isinstance(response, tuple):
                continue
            for name in QUANTITIES:
                values = getattr(true.stories, name)
                error = np.abs(getattr(response.stories, name) - values)
                doubt = np.abs(values - getattr(other.stories, name))
                doubt += RESOLUTION * np.max(np.abs(values))
                estimate = getattr(response.check.errors, name)
                counts[way, "values"] += values.size
                counts[way, "twice"] += int(np.sum(error > 2.0 * estimate + doubt))
                counts[way, "ten times"] += int(np.sum(error > 10.0 * estimate + doubt))
                counts[way, "too large"] += int(
                    np.sum((estimate > 10.0 * error) & (estimate > 5.0 * RESOLUTION * values))
                )


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--cases", type=int, default=250)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    counts, seconds = Counter(), Counter()
    for case, model in abrupt_cases(options.seed, options.cases):
        compare(case, model, counts, seconds)
    for way in WAYS:
        values, twice, ten, large = (
            counts[way, key] for key in ("values", "twice", "ten times", "too large")
        )
        print(
            f"{way}: {values} values, {twice} beyond twice, {ten} beyond ten times, "
            f"{large / max(values, 1):.1%} too large, {seconds[way]:.1f} s"
        )


if __name__ == "__main__":
    main()
