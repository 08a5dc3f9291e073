"""How impulse4's error falls with the step in random buildings of all laws that are linear branch by branch.

python tests/benchmarks/events.py [BUILDINGS [FIRST]]
python tests/benchmarks/events.py halvings [BUILDINGS]     # steps of 4 to 40 samples: how many do not converge

A line for each building whose error at a step is more than twice that at the next larger one; `times` is by how much
the building itself enlarges a small change of the motion. Where that is a lot (mostly pounding that repeats) no method
can tell its course.
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))
import numpy as np

from events_study import PARTS, study
from random_buildings import piecewise_building
from tdint import run
from tdint.analysis.run.outcome import FailedRun


def main(count=200, first=0):
    """Print the buildings that stand out, and how many there are."""
    outliers = chaotic = 0
    print("worst: largest ratio of the errors at a step and the one before; errors at dt /", *PARTS)
    for seed in range(first, first + count):
        found = study(seed)
        chaotic += found.chaotic
        outliers += found.worst > 2.0 and not found.chaotic
        if found.worst > 2.0:
            laws = " ".join(story.law.name for story in found.building.stories)
            errors = " ".join(f"{error:.0e}" for error in found.errors)
            print(f"{seed:4d} worst {found.worst:7.1e} times {found.growth:7.1e} {errors} {laws}", flush=True)
    print(f"{outliers} of {count} buildings stand out; {chaotic} more enlarge a small change ten thousand times")


def halvings(count=40):
    """Halved steps, runs that failed, and solves a step where Newton's iteration goes straight over kinks."""
    for method in ("gauss4", "newmark-average", "moment4", "impulse"):
        for samples in (4, 10, 20, 40):
            halved = failed = solves = steps = 0
            for seed in range(count):
                building, motion = piecewise_building(np.random.default_rng(seed))
                try:
                    response = run(building, motion, method=method, dt=samples * motion.dt)
                except FailedRun:
                    failed += 1
                    continue
                halved += response.halvings
                solves += response.iterations
                steps += response.steps
            per_step = solves / steps
            print(f"{method:16s} {samples:3d} samples: {halved:5d} halved, {failed:3d} failed, {per_step:5.2f} solves")


if __name__ == "__main__":
    if sys.argv[1:2] == ["halvings"]:
        halvings(*map(int, sys.argv[2:]))
    else:
        main(*map(int, sys.argv[1:]))
