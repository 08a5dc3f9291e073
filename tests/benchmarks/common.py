"""What several benchmarks share: shipped motions, the same motion with more samples, least times,
errors."""

import math
import sys
import time
from pathlib import Path

import numpy as np

from tdint import read_horizontals
from tdint.ground_motion.record import Record

ROOT = Path(__file__).parents[2]
sys.path.append(
    str(ROOT / "tests")
)  # the scripts that import this one first share modules with the tests
NAMES = ("firm-soil", "near-fault", "soft-soil")


def pairs():
    """The horizontal components of the shipped motions, two by two."""
    return [read_horizontals(ROOT / "records" / f"{name}.mseed", units="m/s^2") for name in NAMES]


def components():
    """The six horizontal components of the shipped motions."""
    return [record for pair in pairs() for record in (pair.first, pair.second)]


def turned(count):
    """Shipped motions in many directions, each with another start and another strength: no two are
    alike."""
    shipped, result = pairs(), []
    for i in range(count):
        pair, angle = shipped[i % len(shipped)], math.radians(23.0 * i)
        samples = (
            math.cos(angle) * pair.first.acceleration + math.sin(angle) * pair.second.acceleration
        )
        shifted = np.concatenate([np.zeros(7 * i), samples]) * (0.7 + 0.03 * i)
        result.append(
            Record(shifted, pair.first.dt, "", "", f"{(23 * i) % 360:03d}", f"{NAMES[i % 3]}-{i}")
        )
    return result


def least(works, repeats, clock=time.process_time):
    """The least time of each work, s; they take turns, so that what else the machine does meets all
    alike."""
    best = [math.inf] * len(works)
    for _ in range(repeats):
        for i, work in enumerate(works):
            began = clock()
            work()
            best[i] = min(best[i], clock() - began)
    return best


def difference(u, exact):
    """Relative L2 difference of two histories."""
    rows = min(len(u), len(exact))
    return np.linalg.norm(u[:rows] - exact[:rows]) / np.linalg.norm(exact[:rows])


def largest(values, exact):
    """Largest relative error of some values."""
    return np.max(np.abs(values / exact - 1.0))
