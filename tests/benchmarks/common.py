"""Ground motions, timing and error measures that several benchmarks share."""

import math
import sys
import time
from pathlib import Path

import numpy as np

from tdint import read_horizontals
from tdint.ground_motion.record import Record

ROOT = Path(__file__).parents[2]
# The benchmarks use modules of the tests. They import this module before those modules.
sys.path.append(str(ROOT / "tests"))
NAMES = ("firm-soil", "near-fault", "soft-soil")


def pairs():
    """Return the two horizontal components of each ground motion of `NAMES`."""
    return [read_horizontals(ROOT / "records" / f"{name}.mseed", units="m/s^2") for name in NAMES]


def components():
    """Return the six horizontal components of the ground motions of `NAMES` as a list."""
    return [record for pair in pairs() for record in (pair.first, pair.second)]


def rotated_motions(count):
    """Return `count` different ground motions that are derived from the records of `NAMES`.

    Motion i is the component in the direction of 23 i degrees, scaled by 0.7 + 0.03 i, after 7 i
    samples of zeros.
    """
    record_pairs, motions = pairs(), []
    for i in range(count):
        pair, angle = record_pairs[i % len(record_pairs)], math.radians(23.0 * i)
        samples = (
            math.cos(angle) * pair.first.acceleration + math.sin(angle) * pair.second.acceleration
        )
        shifted = np.concatenate([np.zeros(7 * i), samples]) * (0.7 + 0.03 * i)
        motions.append(
            Record(shifted, pair.first.dt, "", "", f"{(23 * i) % 360:03d}", f"{NAMES[i % 3]}-{i}")
        )
    return motions


def minimum_times(functions, repeats, clock=time.process_time):
    """Return the minimum time of each function, s.

    The functions are called alternately, so that other work on the machine affects all functions.

    Parameters
    ----------
    functions : sequence of callable
        Functions without arguments.
    repeats : int
        Number of calls of each function.
    clock : callable
        Function that returns the time, s. Default: processor time of this process.
    """
    minimum = [math.inf] * len(functions)
    for _ in range(repeats):
        for i, function in enumerate(functions):
            start = clock()
            function()
            minimum[i] = min(minimum[i], clock() - start)
    return minimum


def l2_error(history, exact):
    """Return the relative L2 difference of two histories over their common rows (time steps)."""
    rows = min(len(history), len(exact))
    return np.linalg.norm(history[:rows] - exact[:rows]) / np.linalg.norm(exact[:rows])


def max_relative_error(values, exact):
    """Return the maximum relative error of an array of values."""
    return np.max(np.abs(values / exact - 1.0))
